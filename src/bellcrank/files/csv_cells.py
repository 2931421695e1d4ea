"""Text in cells of CSV files, so that a spreadsheet does not take somebody's name for a formula.

A cell that begins with =, +, -, @ or a control character gets an apostrophe before it (OWASP, "CSV injection"), and
loses it when it is read back. Numbers stay as they are.
"""

from __future__ import annotations

from collections.abc import Iterable

_FORMULA = tuple("=+-@\t\r\n＝＋－＠")  # the wide ones count in spreadsheets, too
MARK = "'"


def guarded(cells: Iterable[object]) -> list[object]:
    """The cells of a row, texts among them so that none is a formula."""
    return [MARK + cell if isinstance(cell, str) and _is_formula(cell) else cell for cell in cells]


def unguarded(cell: str) -> str:
    """The text of a cell that `guarded` may have written."""
    return cell[1:] if cell.startswith(MARK) and _is_formula(cell) else cell


def _is_formula(text: str) -> bool:
    """Whether a text would be a formula without the apostrophes that it begins with."""
    return text.lstrip(MARK).startswith(_FORMULA)
