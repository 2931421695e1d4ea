"""Tables as text for the terminal and as HTML for notebooks."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from html import escape
from typing import NamedTuple


class TableContent(NamedTuple):
    """A header, whose second lines hold units, and rows of cells."""

    header: list[str]
    rows: list[list[str]]


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
