"""`bellcrank.report`: the report of a run, sizing, selection or sweep as one HTML page; all outside text is escaped."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank import arguments
from bellcrank.errors import InputError
from bellcrank.files.access import Trust, for_files_only
from bellcrank.messages import file_name
from bellcrank.motion.motion import Motion
from bellcrank.planning.fastest_motion import FastestMotion
from bellcrank.replays.geometry.meshes import Detail
from bellcrank.replays.page.page import Surroundings, write_page
from bellcrank.replays.replay import film_of, film_over, find_run, load_source, source_name, told_apart
from bellcrank.reports.document import Document, Facts, Picture, Table, document_html
from bellcrank.reports.study_data import View
from bellcrank.sizing.result import Sizing
from bellcrank.sizing.selection.selection import Selection
from bellcrank.studies.results.sweep_result import Sweep

if TYPE_CHECKING:
    from bellcrank.replays.film.film import Film
    from bellcrank.reports.document import Document
    from bellcrank.simulation.trajectory.trajectory import Trajectory


# ---- Two reports as one: their tables row by row, and what differs is marked.

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


@arguments.named
def report(
    source: Trajectory | Sizing | Selection | Sweep | str | Path,
    path: str | Path | None = None,
    *,
    over: Trajectory | Sizing | Selection | str | Path | None = None,
    measures: Iterable[str] | None = None,
    limits: Iterable[str] = (),
    trace: Iterable[str] = (),
    detail: Detail = "reduced",
    title: str | None = None,
    live: bool | None = None,
    trust: Trust = (),
) -> Path:
    """Write one HTML page with the verdict of a run, sizing, selection or sweep, its replay, tables and pictures.

    The page needs no other file, and can be printed. That of a sweep has a map of the designs; the one that is clicked
    moves, with its own link lengths.

    Args:
        source: A run, a sizing, a selection, a sweep, or the path of a run: its file, or the folder that `bellcrank
            simulate` writes.
        path: The file to write. Default: the source's name and "_report.html", in the working folder.
        over: Another run, sizing or selection, which is compared: its motion over the first, as `replay` shows it, and
            the tables of both in one, in which what differs is marked.
        measures: Of a sweep, the measures that are shown. Default: those that its table shows.
        limits: Of a sweep whose designs are a sample, limits such as "lock.time > 13 s", whose probability is given.
        trace: Names of frames whose paths are drawn. Default: the frames of the scene's outputs, or the tip.
        detail: "reduced" simplifies meshes without visible loss, "full" keeps all faces.
        title: The title of the page. Default: the name of the scene, sizing or selection.
        live: Whether the page computes, as `replay` has it. Verdict, tables and pictures of the report stay those of
            the sizing or run, and the page says so while values are changed. Default: where it adds less than 400 kB,
            and not of a sweep. That of a sweep computes a design that is clicked, and those between, in place of
            motions that it keeps of some; all that is varied must be a value that such a page can change.
        trust: With the path of a run, folders whose meshes it may name, besides its own folder.

    Returns:
        The path of the page.

    Raises:
        InputError: For a source that cannot be reported, an unknown frame, and where the file cannot be written.

    Example:
        >>> import tempfile
        >>> import bellcrank as bc
        >>> page = bc.report(bc.simulate("pendulum", duration=1.0), tempfile.mkdtemp() + "/pendulum.html")
        >>> page.name
        'pendulum.html'
    """
    given: object = source
    if isinstance(source, Sweep):
        if over is not None:
            raise InputError("argument 'over': a sweep has no motion to show another one over; give a run of each")
        return _report_sweep(source, path, measures, limits, title, (trace, detail, trust), live)
    if measures is not None or arguments.several("limits", limits, str, "limits", alone=True):
        raise InputError("arguments 'measures' and 'limits': they are for a sweep, and 'source' is none")
    if isinstance(source, (str, Path)):
        from bellcrank.simulation.files.load_run import load_run

        kinds = "a run, a sizing, a selection, or the path of a run"
        given = load_run(find_run(arguments.path("source", source, kinds)), trust=trust)
    else:
        for_files_only(trust, "source", "load_run")
    if live is not None:
        arguments.flag("live", live)
    result = load_source(given, "report")
    other = None if over is None else load_source(over, "report", trust, "over")
    if isinstance(result, FastestMotion) or isinstance(other, FastestMotion):
        raise InputError("a fastest motion has no report: bc.replay shows it, and bc.size makes a sizing of its motion")
    name = _title(result)
    title = title or None
    if path is not None:
        path = arguments.path("path", path, "the path of a page")
    computes = live if other is None and not isinstance(result, Selection) else False
    film = film_of(result, trace=trace, detail=detail, title=name if title is None else title, live=computes)
    target = f"{file_name(source_name(result))}_report.html" if path is None else path
    if other is not None:
        second = film_of(other, trace=trace, detail=detail, title=_title(other))
        film, second = told_apart(film, second, (_file_of(result), _file_of(other)))
        around = compared_surroundings((result, film), (other, second))
        return write_page(film_over(film, second, title), target, around=around)
    if isinstance(result, Selection):
        from bellcrank.reports.selection_report import selection_surroundings

        return write_page(film, target, plots=False, around=selection_surroundings(result, film))
    document = _document(result, film)
    before, after = document_html(document)
    return write_page(film, target, around=Surroundings(before=before, after=after))


def compared_surroundings(
    first: tuple[Trajectory | Motion | Sizing | Selection, Film],
    second: tuple[Trajectory | Motion | Sizing | Selection, Film],
) -> Surroundings:
    """What stands around two results over each other: what is said of each, and the tables of both in one.

    Each is given with its film. Raises InputError for a motion, which has no tables.
    """
    from bellcrank.replays.film.compared_films import names_of

    documents = (_document(*first, pictures=False), _document(*second, pictures=False))
    names = names_of(first[1], second[1])
    document = compared_documents(*documents, names)
    one, other = first[0], second[0]
    if not (isinstance(one, Selection) and isinstance(other, Selection)):
        before, after = document_html(document)
        return Surroundings(before=before, after=after)
    from bellcrank.reports.selection_report import compared_selections

    return compared_selections(document, (one, other), names)


def _report_sweep(
    sweep: Sweep,
    path: str | Path | None,
    measures: Iterable[str] | None,
    limits: Iterable[str],
    title: str | None,
    options: tuple[Iterable[str], Detail, Trust],
    live: bool | None,
) -> Path:
    from bellcrank.reports.study_report import write_study

    trace, detail, trust = options
    for_files_only(trust, "source", "load_scene")
    arguments.one_of("detail", detail, ("reduced", "full"))
    return write_study(
        sweep,
        f"{file_name(sweep.scene.source.stem)}_report.html" if path is None else arguments.path("path", path),
        measures=None if measures is None else arguments.several("measures", measures, str, "measures", alone=True),
        limits=arguments.several("limits", limits, str, "limits", alone=True),
        title=title if title is None else arguments.text("title", title, empty=True) or None,
        view=View(trace=arguments.several("trace", trace, str, "names of frames", alone=True), detail=detail),
        live=live is not None and arguments.flag("live", live),
    )


def _title(result: Trajectory | Motion | Sizing | Selection) -> str:
    if isinstance(result, Motion):
        raise InputError(
            f"report: motion '{result.name}' has no result to report; size it first, or use replay to show the motion"
        )
    return result.robot if isinstance(result, (Sizing, Selection)) else result.scene.name


def _file_of(result: Trajectory | Motion | Sizing | Selection) -> str:
    """The name of the file that a result is of, as far as the result holds it; else that of the robot."""
    if isinstance(result, Selection) and result.inputs is not None and result.inputs.config is not None:
        return result.inputs.config.source.stem
    return source_name(result)


def _document(result: Trajectory | Motion | Sizing | Selection, film: Film, pictures: bool = True) -> Document:
    from bellcrank.reports.run_report import run_document
    from bellcrank.reports.selection_report import choice_table, selection_document
    from bellcrank.reports.sizing_report import sizing_document

    if isinstance(result, Selection):
        document = selection_document(result, film)
        return replace(document, parts=(choice_table(result), *document.parts))
    if isinstance(result, Sizing):
        return sizing_document(result, film, pictures)
    assert not isinstance(result, Motion)
    return run_document(result, pictures)
