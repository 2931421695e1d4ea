"""`report`: a run or a sizing on one page, the verdict first."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank import arguments
from bellcrank.errors import InputError
from bellcrank.motion.motion import Motion
from bellcrank.replays.geometry.meshes import Detail
from bellcrank.replays.page.page import write_page
from bellcrank.replays.replay import film_of, load_source, source_name
from bellcrank.reports.html import document_html
from bellcrank.sizing.history import file_name
from bellcrank.sizing.result import Sizing

if TYPE_CHECKING:
    from bellcrank.replays.film.film import Film
    from bellcrank.reports.document import Document
    from bellcrank.simulation.trajectory import Trajectory


def report(
    thing: Trajectory | Sizing | str | Path,
    path: str | Path | None = None,
    *,
    trace: Iterable[str] = (),
    detail: Detail = "reduced",
    title: str | None = None,
) -> Path:
    """Write one HTML page with the verdict of a run or a sizing, its replay, tables and pictures; its path.

    `thing` may be a run's file or folder, too; without a `path` the page is named after it, in the working folder. The
    page needs no other file, and prints. `trace` and `detail` as in `replay`. Raises InputError for what cannot be
    told of, and where the file cannot be written.
    """
    source = load_source(thing, "report", "thing")
    if title is None or (isinstance(title, str) and not title):
        title = _title(source)
    if path is not None:
        path = arguments.path("path", path, "the path of a page")
    film = film_of(source, trace=trace, detail=detail, title=title)
    document = _document(source, film)
    target = f"{file_name(source_name(source))}_report.html" if path is None else path
    return write_page(film, target, around=document_html(document))


def _title(thing: Trajectory | Motion | Sizing) -> str:
    if isinstance(thing, Motion):
        raise InputError(
            f"report: motion '{thing.name}' is no result yet; size it first, or write its page with replay"
        )
    return thing.robot if isinstance(thing, Sizing) else thing.scene.name


def _document(thing: Trajectory | Motion | Sizing, film: Film) -> Document:
    from bellcrank.reports.run_document import run_document
    from bellcrank.reports.sizing_document import sizing_document

    if isinstance(thing, Sizing):
        return sizing_document(thing, film)
    assert not isinstance(thing, Motion)
    return run_document(thing)
