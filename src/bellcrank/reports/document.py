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
    """A picture as PNG, and what it shows."""

    title: str
    png: bytes


@dataclass(frozen=True)
class Document:
    """A report: `good` says whether the answer is yes, `verdict` why, and `warnings` what speaks against it."""

    title: str
    kind: str
    good: bool
    verdict: tuple[str, ...]
    warnings: tuple[str, ...]
    parts: tuple[Facts | Table | Picture, ...]
