"""The content of a report as plain data."""

from __future__ import annotations

from dataclasses import dataclass


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
