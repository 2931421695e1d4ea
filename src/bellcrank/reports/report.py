"""`bellcrank.report`: the report of a run or a sizing as one HTML page, with all outside text escaped."""

from __future__ import annotations

import base64
from collections.abc import Iterable
from html import escape
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
from bellcrank.reports.document import Document, Facts, Picture, Table
from bellcrank.sizing.result import Sizing
from bellcrank.text import file_name

if TYPE_CHECKING:
    from bellcrank.replays.film.film import Film
    from bellcrank.reports.document import Document
    from bellcrank.simulation.trajectory import Trajectory


@renamed_arguments(thing="source")
def report(
    source: Trajectory | Sizing | str | Path,
    path: str | Path | None = None,
    *,
    trace: Iterable[str] = (),
    detail: Detail = "reduced",
    title: str | None = None,
    trust: Trust = (),
) -> Path:
    """Write one HTML page with the verdict of a run or a sizing, its replay, tables and pictures.

    The page needs no other file, and can be printed.

    Args:
        source: A run, a sizing, or the path of a run: its file, or the folder that `bellcrank simulate` writes.
        path: The file to write. Default: the source's name and "_report.html", in the working folder.
        trace: Names of frames whose paths are drawn. Default: the frames of the scene's outputs, or the tip.
        detail: "reduced" simplifies meshes without visible loss, "full" keeps all faces.
        title: The title of the page. Default: the name of the scene or sizing.
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

        kinds = "a run, a sizing, or the path of a run"
        given = load_run(find_run(arguments.path("source", source, kinds)), trust=trust)
    elif arguments.several("trust", [trust] if isinstance(trust, (str, Path)) else trust, object, "folders"):
        raise InputError("argument 'trust': it is for files, and 'source' is loaded already; give it to load_run")
    result = load_source(given, "report")
    if title is None or (isinstance(title, str) and not title):
        title = _title(result)
    if path is not None:
        path = arguments.path("path", path, "the path of a page")
    film = film_of(result, trace=trace, detail=detail, title=title)
    document = _document(result, film)
    target = f"{file_name(source_name(result))}_report.html" if path is None else path
    before, after = document_html(document)
    return write_page(film, target, around=Surroundings(before=before, after=after))


def _title(result: Trajectory | Motion | Sizing) -> str:
    if isinstance(result, Motion):
        raise InputError(
            f"report: motion '{result.name}' has no result to report; size it first, or use replay to show the motion"
        )
    return result.robot if isinstance(result, Sizing) else result.scene.name


def _document(result: Trajectory | Motion | Sizing, film: Film) -> Document:
    from bellcrank.reports.run_report import run_document
    from bellcrank.reports.sizing_report import sizing_document

    if isinstance(result, Sizing):
        return sizing_document(result, film)
    assert not isinstance(result, Motion)
    return run_document(result)


def document_html(document: Document) -> tuple[str, str]:
    """The HTML before the replay (verdict, warnings, the still for paper) and after it (the parts)."""
    lines = "".join(f"<p>{escape(line)}</p>" for line in document.verdict)
    before = (
        f'<section class="verdict {"good" if document.success else "bad"}" aria-label="verdict">'
        f'<span class="word">{escape(document.status)}</span><div>{lines}'
        f'<p class="about">{" · ".join(map(escape, document.about))}</p></div></section>'
        + _list("Warnings", "warnings", document.warnings)
        + _list("Notes", "notes", document.notes)
        + f'<figure class="paper" id="still" data-time="{document.still.time!r}" hidden>'
        f'<img alt="the 3-D view"><figcaption>{escape(document.still.caption)}</figcaption></figure>'
    )
    return before, "".join(map(_part, document.parts))


def _list(title: str, kind: str, texts: Iterable[str]) -> str:
    items = "".join(f"<li>{escape(text)}</li>" for text in texts)
    return f'<section class="{kind}"><h2>{title}</h2><ul>{items}</ul></section>' if items else ""


def _part(part: Facts | Table | Picture) -> str:
    """One part of a report as HTML."""
    title = escape(part.title)
    if isinstance(part, Picture):
        data = base64.b64encode(part.svg.encode("utf-8")).decode("ascii")
        return (
            f'<figure class="paper"><h2>{title}</h2><img alt="{title}" src="data:image/svg+xml;base64,{data}"></figure>'
        )
    if isinstance(part, Facts):
        rows = "".join(f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in part.rows)
        return f'<section><h2>{title}</h2><table class="facts">{rows}</table></section>'
    words = [all(_is_word(row[k]) for row in part.rows) for k in range(len(part.header))]
    head = _row(part.header, words, ("th",) * len(words))
    body = "".join(_row(row, words, ("th", *("td",) * (len(words) - 1))) for row in part.rows)
    note = f"<p>{escape(part.note)}</p>" if part.note else ""
    table = f"<table><thead>{head}</thead><tbody>{body}</tbody></table>"
    return f'<section><h2>{title}</h2><div class="wide">{table}</div>{note}</section>'


def _row(cells: Iterable[str], words: Iterable[bool], tags: Iterable[str]) -> str:
    row = "".join(
        f"<{tag}{' class=text' if word else ''}>{escape(cell).replace(chr(10), '<br>')}</{tag}>"
        for cell, word, tag in zip(cells, words, tags, strict=True)
    )
    return f"<tr>{row}</tr>"


def _is_word(cell: str) -> bool:
    """Whether a cell is text, which is aligned left and may wrap, rather than a number."""
    return not any(letter.isdigit() for letter in cell.partition(" ")[0])
