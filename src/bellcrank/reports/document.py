"""The content of a report as plain data, and as HTML with all its texts escaped."""

from __future__ import annotations

import base64
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from html import escape


@dataclass(frozen=True)
class Facts:
    """Names with their values."""

    title: str
    rows: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Table:
    """Rows of cells under a header. The first column names the row; the second line of a header is a unit.

    Of a table that compares two results, `marked` are the (row, column) of the cells that differ.
    """

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    marked: frozenset[tuple[int, int]] | None = None


@dataclass(frozen=True)
class Picture:
    """A picture as SVG text for the printed page, and with `screen` for the screen too.

    Where the page's interactive plots show the same, it is not shown on the screen.
    """

    title: str
    svg: str
    screen: bool = False


@dataclass(frozen=True)
class Still:
    """The time of the replay, s, whose still replaces it on the printed page, and a caption."""

    time: float
    caption: str


@dataclass(frozen=True, kw_only=True)
class Document:
    """A report.

    Attributes:
        title: Title of the page.
        status: The result in a word or two, such as "OK" or "Exceeded".
        success: Whether the result is good.
        verdict: Sentences that explain the status.
        about: What was computed, from which file, with which version.
        warnings: Sentences that put the result in question.
        notes: Further sentences.
        still: The still of the replay for the printed page.
        parts: Tables and pictures, in order.
        partial: Whether a good result holds for what is known, and not everything is.
    """

    title: str
    status: str
    success: bool
    verdict: tuple[str, ...]
    about: tuple[str, ...]
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    still: Still
    parts: tuple[Facts | Table | Picture, ...]
    partial: bool = False


def document_html(document: Document) -> tuple[str, str]:
    """The HTML before the replay (verdict, warnings, the still for paper) and after it (the parts)."""
    lines = "".join(f"<p>{escape(line)}</p>" for line in document.verdict)
    kind = "partial" if document.partial else "good" if document.success else "bad"
    before = (
        f'<section class="verdict {kind}" aria-label="verdict">'
        f'<span class="word">{escape(document.status)}</span><div>{lines}'
        f'<p class="about">{" · ".join(map(escape, document.about))}</p></div></section>'
        + _list("Warnings", "warnings", document.warnings)
        + _list("Notes", "notes", document.notes)
        + f'<figure class="paper" id="still" data-time="{document.still.time!r}" hidden>'
        f'<img alt="the 3-D view"><figcaption>{escape(document.still.caption)}</figcaption></figure>'
    )
    return before, "".join(map(part_html, document.parts))


def _list(title: str, kind: str, texts: Iterable[str]) -> str:
    items = "".join(f"<li>{escape(text)}</li>" for text in texts)
    return f'<section class="{kind}"><h2>{title}</h2><ul>{items}</ul></section>' if items else ""


def part_html(part: Facts | Table | Picture) -> str:
    """One part of a report as HTML."""
    title = escape(part.title)
    if isinstance(part, Picture):
        data = base64.b64encode(part.svg.encode("utf-8")).decode("ascii")
        image = f'<h2>{title}</h2><img alt="{title}" src="data:image/svg+xml;base64,{data}">'
        return f'<section class="drawn">{image}</section>' if part.screen else f'<figure class="paper">{image}</figure>'
    if isinstance(part, Facts):
        rows = "".join(f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in part.rows)
        return f'<section><h2>{title}</h2><table class="facts">{rows}</table></section>'
    words = [all(_is_word(row[k]) for row in part.rows) for k in range(len(part.header))]
    head = _row(part.header, words, ("th",) * len(words))
    names = ("", *(" ".join(name.split()) for name in part.header[1:]))
    tags = ("th", *("td",) * (len(words) - 1))
    body = "".join(
        _row(row, words, tags, names, {column for line, column in part.marked or () if line == k})
        for k, row in enumerate(part.rows)
    )
    note = f"<p>{escape(part.note)}</p>" if part.note else ""
    table = f"<table><thead>{head}</thead><tbody>{body}</tbody></table>"
    kind = "wide" if part.marked is None else "wide both"
    return f'<section><h2>{title}</h2><div class="{kind}">{table}</div>{note}</section>'


def _row(
    cells: Sequence[str], words: Iterable[bool], tags: Iterable[str], names: Sequence[str] = (),
    marked: Collection[int] = (),
) -> str:  # fmt: skip
    """A row; on a narrow screen its cells stand below each other, each with the name of its column (report.css)."""
    row = "".join(
        f"<{tag}{_class(word, k in marked)}{_named(name)}>{_content(cell, k in marked)}</{tag}>"
        for k, (cell, word, tag, name) in enumerate(zip(cells, words, tags, names or ("",) * len(cells), strict=True))
    )
    return f"<tr>{row}</tr>"


def _class(word: bool, marked: bool) -> str:
    names = " ".join(name for name, wanted in (("text", word), ("differs", marked)) if wanted)
    return f' class="{names}"' if names else ""


def _content(cell: str, marked: bool) -> str:
    text = escape(cell).replace("\n", "<br>")
    return f"<mark>{text}</mark>" if marked else text  # read aloud and printed as such, too


def _named(name: str) -> str:
    return f' data-name="{escape(name)}"' if name else ""


def _is_word(cell: str) -> bool:
    """Whether a cell is text, which is aligned left and may wrap, rather than a number."""
    return not any(letter.isdigit() for letter in cell.partition(" ")[0])
