"""Two reports as one: their tables row by row, and what differs is marked."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from bellcrank.reports.document import Document, Facts, Picture, Table

BOTH = "both"  # whose a row is that is equal in both


def compared_documents(first: Document, second: Document, names: tuple[str, str]) -> Document:
    """The report of two results of the same kind or of different ones, which `names` call; without their pictures.

    Tables of the same title stand in one, with the rows of the two one below the other where they differ, as printed.
    """
    rest = {part.title: part for part in second.parts if not isinstance(part, Picture)}
    parts: list[Facts | Table | Picture] = []
    for part in first.parts:
        if not isinstance(part, Picture):
            other = rest.pop(part.title, None)
            parts.append(_titled(part, names[0]) if other is None else _compared(part, other, names))
    parts += [_titled(part, names[1]) for part in rest.values()]
    tables = [part for part in parts if isinstance(part, Table)]
    count = sum(len({table.rows[row][0] for row, _ in table.marked or ()}) for table in tables)
    lines = [f"{name}: {line}" for name, one in zip(names, (first, second), strict=True) for line in one.verdict]
    differing = f"{count} row{'' if count == 1 else 's'} of the tables below differ{'s' if count == 1 else ''}"
    status = (first.status, second.status)
    return Document(
        title=first.title,
        status=status[0] if status[0] == status[1] else " and ".join(status),
        success=first.success and second.success,
        partial=first.success and second.success and (first.partial or second.partial),
        verdict=(*lines, f"{differing}, as printed; what is not equal is marked." if count else "No row differs."),
        about=tuple(dict.fromkeys((*first.about, *second.about))),
        warnings=_said(first.warnings, second.warnings, names),
        notes=_said(first.notes, second.notes, names),
        still=first.still,
        parts=tuple(parts),
    )


def _titled(part: Facts | Table, name: str) -> Facts | Table:
    title = f"{part.title}, {name} only"
    return Facts(title, part.rows) if isinstance(part, Facts) else Table(title, part.header, part.rows, part.note)


def _said(first: Sequence[str], second: Sequence[str], names: tuple[str, str]) -> tuple[str, ...]:
    """What both say, once, and what one says, with its name."""
    alone = [text if text in second else f"{names[0]}: {text}" for text in first]
    return (*alone, *(f"{names[1]}: {text}" for text in second if text not in first))


def _compared(first: Facts | Table, second: Facts | Table, names: tuple[str, str]) -> Facts | Table:
    """One table of two; facts that are all equal stay facts."""
    if isinstance(first, Facts) or isinstance(second, Facts):
        if first == second:
            return first
        return _side_by_side(first.title, first.rows, second.rows, names)
    header = (first.header[0], "of", *first.header[1:])
    if first.header != second.header:
        header = (first.header[0], "of", *dict.fromkeys((*first.header[1:], *second.header[1:])))
    lines: list[tuple[str, ...]] = []
    marked = set()
    ours, theirs = (_by_name(table, header) for table in (first, second))
    for key in dict.fromkeys((*ours, *theirs)):
        one, other = ours.get(key), theirs.get(key)
        if one == other and one is not None:
            lines.append((key[0], BOTH, *one))
            continue
        for name, cells, against in ((names[0], one, other), (names[1], other, one)):
            if cells is not None:
                differing = [k for k, cell in enumerate(cells) if against is None or cell != against[k]]
                marked |= {(len(lines), 2 + k) for k in differing}
                lines.append((key[0], name, *cells))
    notes = [first.note] if first.note else []
    if first.note != second.note:
        notes = [f"{name}: {one.note}" for name, one in zip(names, (first, second), strict=True) if one.note]
    return Table(first.title, header, tuple(lines), " ".join(notes), frozenset(marked))


def _by_name(table: Table, header: Sequence[str]) -> dict[tuple[str, int], tuple[str, ...]]:
    """The cells of each row under the columns of a common header from the third on, "" where the table has none.

    Rows are called by their name, and by their number among those of the same name.
    """
    found: dict[tuple[str, int], tuple[str, ...]] = {}
    for name, *cells in table.rows:
        own = dict(zip(table.header[1:], cells, strict=True))
        number = 0
        while (name, number) in found:
            number += 1
        found[name, number] = tuple(own.get(column, "") for column in header[2:])
    return found


def _side_by_side(
    title: str, first: Iterable[Sequence[str]], second: Iterable[Sequence[str]], names: tuple[str, str]
) -> Table:
    """Facts of both in columns of their own."""
    ours, theirs = ({row[0]: ", ".join(row[1:]) for row in rows} for rows in (first, second))
    rows = tuple((name, ours.get(name, ""), theirs.get(name, "")) for name in dict.fromkeys((*ours, *theirs)))
    marked = {(k, column) for k, row in enumerate(rows) if row[1] != row[2] for column in (1, 2)}
    return Table(title, ("", *names), rows, "", frozenset(marked))
