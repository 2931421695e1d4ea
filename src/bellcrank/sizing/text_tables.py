"""Tables as text for the terminal and as HTML for notebooks."""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Sequence
from html import escape
from typing import NamedTuple

from bellcrank.notes import Note

WIDTH = 100  # characters of a line of the terminal


class TableContent(NamedTuple):
    """A header, whose second lines hold units, and rows of cells."""

    header: list[str]
    rows: list[list[str]]

    @classmethod
    def of(cls, *columns: tuple[str, list[str]]) -> TableContent:
        """A table of columns: their titles and cells."""
        titles, cells = zip(*columns, strict=True)
        return cls(list(titles), [list(row) for row in zip(*cells, strict=True)])


def text_table(content: TableContent, texts: Collection[int] | None = None) -> str:
    """Columns under headers of one or two lines.

    Columns of texts, by default the first and the last, are flush left, the others flush right.
    """
    header, rows = content
    left = (0, len(header) - 1) if texts is None else texts
    titles = [title.split("\n") for title in header]
    depth = max(map(len, titles))
    heads = [[title[k] if k < len(title) else "" for title in titles] for k in range(depth)]
    lines = [*heads, *map(list, rows)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(header))]

    def written(line: Sequence[str]) -> str:
        cells = [
            cell.ljust(width) if k in left else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(line, widths, strict=True))
        ]
        return "  ".join(cells).rstrip()

    rule = "-" * (sum(widths) + 2 * len(widths) - 2)
    return "\n".join([*map(written, heads), rule, *map(written, rows)])


def html_table(title: str, content: TableContent) -> str:
    """A table with a caption; all texts are escaped."""
    left = 'style="text-align:left"'
    head = "".join(f"<th>{escape(text).replace(chr(10), '<br>')}</th>" for text in content.header)
    body = "".join(
        f"<tr><th {left}>{escape(first)}</th>{''.join(f'<td>{escape(text)}</td>' for text in others)}</tr>"
        for first, *others in content.rows
    )
    return f"<table><caption {left}>{escape(title)}</caption><tr>{head}</tr>{body}</table>"


def wrapped(text: str, first: str = "", then: str | None = None) -> str:
    """A text in lines that fit a terminal, the first and the others indented."""
    then = first if then is None else then
    return textwrap.fill(
        text, WIDTH, initial_indent=first, subsequent_indent=then, break_long_words=False, break_on_hyphens=False
    )


def counted(count: int, one: str, many: str = "") -> str:
    """A number of things, such as "1 limit" or "2 axes"."""
    return f"{count} {one if count == 1 else many or one + 's'}"


# ---- Parts of a verdict: a title, and its texts below; nothing where there is no text.


def listed(title: str, texts: Sequence[str], wrap: bool = True) -> list[str]:
    """Texts below a title."""
    return [title, *(wrapped(text, "  - ", "    ") if wrap else f"  - {text}" for text in texts)] if texts else []


def exceeded_limits(texts: Sequence[str], wrap: bool = True) -> list[str]:
    """The limits that are exceeded."""
    return listed(f"EXCEEDED: {counted(len(texts), 'limit')}", texts, wrap)


def not_verified(texts: Sequence[str], wrap: bool = True) -> list[str]:
    """The motors of which a main criterion is unknown."""
    return listed(f"Not verified: {counted(len(texts), 'motor')} may be far too weak or too slow", texts, wrap)


def undetermined_lines(texts: Sequence[str], wrap: bool = True) -> list[str]:
    """What is not known, by its reason: what a robot's file says and is not modelled, and the rows of motions."""
    omitted = [text for text in texts if isinstance(text, Note)]
    peaks = [text for text in texts if not isinstance(text, Note)]
    return [
        *listed("Not known: what the robot's file says, acts along the motions, and is not modelled", omitted, wrap),
        *listed("Not known: peaks that the rows of a motion do not determine", peaks, wrap),
    ]


def unknown_limits(texts: Sequence[str], wrap: bool = True) -> list[str]:
    """What could not be compared."""
    return listed("Unknown, because what they need is not stated:", texts, wrap)
