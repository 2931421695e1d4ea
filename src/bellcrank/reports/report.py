"""`bellcrank.report`: the report of a run, sizing or selection as one HTML page, with all outside text escaped."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank import arguments
from bellcrank.deprecated import renamed_arguments
from bellcrank.errors import InputError
from bellcrank.files.access import Trust
from bellcrank.motion.motion import Motion
from bellcrank.replays.geometry.meshes import Detail
from bellcrank.replays.page.page import Surroundings, write_page
from bellcrank.replays.replay import film_of, find_run, load_source, source_name
from bellcrank.reports.document_html import document_html
from bellcrank.sizing.result import Sizing
from bellcrank.sizing.selection.selection import Selection
from bellcrank.text import file_name

if TYPE_CHECKING:
    from bellcrank.replays.film.film import Film
    from bellcrank.reports.document import Document
    from bellcrank.simulation.trajectory import Trajectory


@renamed_arguments(thing="source")
def report(
    source: Trajectory | Sizing | Selection | str | Path,
    path: str | Path | None = None,
    *,
    trace: Iterable[str] = (),
    detail: Detail = "reduced",
    title: str | None = None,
    trust: Trust = (),
) -> Path:
    """Write one HTML page with the verdict of a run, sizing or selection, its replay, tables and pictures.

    The page needs no other file, and can be printed.

    Args:
        source: A run, a sizing, a selection, or the path of a run: its file, or the folder that `bellcrank simulate`
            writes.
        path: The file to write. Default: the source's name and "_report.html", in the working folder.
        trace: Names of frames whose paths are drawn. Default: the frames of the scene's outputs, or the tip.
        detail: "reduced" simplifies meshes without visible loss, "full" keeps all faces.
        title: The title of the page. Default: the name of the scene, sizing or selection.
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
    if isinstance(source, (str, Path)):
        from bellcrank.simulation.load_run import load_run

        kinds = "a run, a sizing, a selection, or the path of a run"
        given = load_run(find_run(arguments.path("source", source, kinds)), trust=trust)
    elif arguments.several("trust", [trust] if isinstance(trust, (str, Path)) else trust, object, "folders"):
        raise InputError("argument 'trust': it is for files, and 'source' is loaded already; give it to load_run")
    result = load_source(given, "report")
    if title is None or (isinstance(title, str) and not title):
        title = _title(result)
    if path is not None:
        path = arguments.path("path", path, "the path of a page")
    film = film_of(result, trace=trace, detail=detail, title=title)
    target = f"{file_name(source_name(result))}_report.html" if path is None else path
    if isinstance(result, Selection):
        from bellcrank.reports.selection_report import selection_surroundings

        return write_page(film, target, plots=False, around=selection_surroundings(result, film))
    document = _document(result, film)
    before, after = document_html(document)
    return write_page(film, target, around=Surroundings(before=before, after=after))


def _title(result: Trajectory | Motion | Sizing | Selection) -> str:
    if isinstance(result, Motion):
        raise InputError(
            f"report: motion '{result.name}' has no result to report; size it first, or use replay to show the motion"
        )
    return result.robot if isinstance(result, (Sizing, Selection)) else result.scene.name


def _document(result: Trajectory | Motion | Sizing, film: Film) -> Document:
    from bellcrank.reports.run_report import run_document
    from bellcrank.reports.sizing_report import sizing_document

    if isinstance(result, Sizing):
        return sizing_document(result, film)
    assert not isinstance(result, Motion)
    return run_document(result)
