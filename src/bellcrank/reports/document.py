"""A report as plain data: a verdict, and parts below it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Facts:
    """Names with their values."""

    title: str
    rows: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Table:
    """Rows of cells under a header; the first column names the row. A header's second line is its unit."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


@dataclass(frozen=True)
class Picture:
    """A picture for paper as SVG text, and what it shows; on a screen the page's own plots show it."""

    title: str
    svg: str


@dataclass(frozen=True)
class Still:
    """The moment of the replay (s of the film) that stands for it on paper, and what it shows."""

    time: float
    caption: str


@dataclass(frozen=True)
class Document:
    """A report: `word` is the answer, `good` whether it is yes, `verdict` why; `about` says what was asked, of what.

    `warnings` speak against the answer, `notes` are worth knowing beside it.
    """

    title: str
    word: str
    good: bool
    verdict: tuple[str, ...]
    about: tuple[str, ...]
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    still: Still
    parts: tuple[Facts | Table | Picture, ...]
