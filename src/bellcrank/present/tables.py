"""Tables as text for the terminal and as HTML for notebooks."""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Sequence
from html import escape
from typing import NamedTuple

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


def aligned(lines: Sequence[Sequence[str]], left: Collection[int] | None = None) -> list[str]:
    """Lines of cells in columns. The columns `left` (None: all) are flush left, the others flush right."""
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    sides = ["<" if left is None or k in left else ">" for k in range(len(widths))]
    made = [[f"{c:{side}{width}}" for c, side, width in zip(line, sides, widths, strict=True)] for line in lines]
    return ["  ".join(cells).rstrip() for cells in made]


def ruled(lines: Sequence[Sequence[str]], left: Collection[int] | None = None, heads: int = 1) -> list[str]:
    """Aligned lines with a rule below the first `heads` of them."""
    made = aligned(lines, left)
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return [*made[:heads], "-" * (sum(widths) + 2 * len(widths) - 2), *made[heads:]]


def text_table(content: TableContent, texts: Collection[int] | None = None) -> str:
    """Columns under headers of one or two lines.

    Columns of texts, by default the first and the last, are flush left, the others flush right.
    """
    titles = [title.split("\n") for title in content.header]
    depth = max(map(len, titles))
    heads = [[title[k] if k < len(title) else "" for title in titles] for k in range(depth)]
    left = (0, len(titles) - 1) if texts is None else texts
    return "\n".join(ruled([*heads, *content.rows], left, depth))


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


def listed(title: str, texts: Sequence[str], wrap: bool = True) -> list[str]:
    """Texts below a title; nothing where there is no text."""
    return [title, *(wrapped(text, "  - ", "    ") if wrap else f"  - {text}" for text in texts)] if texts else []
