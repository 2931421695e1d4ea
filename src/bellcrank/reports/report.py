"""`report`: a run or a sizing on one page, the verdict first."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank.atomic import write_text
from bellcrank.errors import InputError
from bellcrank.replays.meshes import Detail
from bellcrank.replays.page import page
from bellcrank.replays.replay import film_of, name_of, opened
from bellcrank.reports.html import document_html
from bellcrank.sizing.history import file_name
from bellcrank.sizing.result import Sizing

if TYPE_CHECKING:
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
    source = opened(thing)
    document = _document(source)
    film = film_of(source, trace=trace, detail=detail, title=title or document.title)
    target = Path(f"{file_name(name_of(source))}_report.html" if path is None else path)
    if target.suffix.lower() not in (".html", ".htm"):
        target = target.with_name(target.name + ".html")
    write_text(target, page(film, around=document_html(document)))
    return target


def _document(thing: object) -> Document:
    from bellcrank.reports.run_document import run_document
    from bellcrank.reports.sizing_document import sizing_document
    from bellcrank.simulation.trajectory import Trajectory

    if isinstance(thing, Sizing):
        return sizing_document(thing)
    if isinstance(thing, Trajectory):
        return run_document(thing)
    raise InputError(
        f"report: expected a run, a sizing, or the path of a run, found a {type(thing).__name__}; "
        "a motion is sized first"
    )
