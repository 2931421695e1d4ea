"""The page of a scene's modes: a replay in which each mode moves, the table of modes, and root loci."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank.analysis.linearisation import Linearisation
from bellcrank.analysis.modes import shown
from bellcrank.analysis.root_loci import RootLoci
from bellcrank.analysis.root_locus_plot import plot_eigenvalues, plot_root_loci
from bellcrank.notes import reached
from bellcrank.present.plot_style import svg_of
from bellcrank.replays.film.posture_films import SECONDS, film_of_modes
from bellcrank.replays.page.page import Surroundings, write_page
from bellcrank.reports.document import Document, Facts, Picture, Still, document_html
from bellcrank.version import version

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene


def write_modes_page(scene: Scene, linear: Linearisation, path: str | Path, loci: RootLoci | None = None) -> Path:
    """Write one HTML page in which each mode moves; a click on a mode in the table shows it.

    Args:
        scene: The scene.
        linear: Its linear equations, whose operating point is steady.
        path: The file; .html is added if it has another suffix.
        loci: Root loci to show too.

    Returns:
        The path of the page.

    Raises:
        InputError: There is no mode, or the file cannot be written.
    """
    document = _document(scene, linear, loci)
    before, after = document_html(document)
    around = Surroundings(before=before + _table(linear), after=after)
    return write_page(film_of_modes(scene, linear), path, plots=False, around=around)


def _document(scene: Scene, linear: Linearisation, loci: RootLoci | None) -> Document:
    status = {True: "Neutral" if linear.drifts else "Stable", False: "Unstable", None: "Not steady"}[linear.stable]
    status = "Not known" if reached(linear.notes) else status
    growing = [mode for mode in linear.modes if mode.eigenvalue.real > 0.0]
    verdict = f"{len(growing)} of {len(linear.modes)} modes grow" if growing else "no mode grows"
    parts: list[Facts | Picture] = [
        Picture("Eigenvalues and damping ratios", svg_of(plot_eigenvalues(linear)), screen=True),
        Facts("Operating point", _operating_point(scene, linear)),
    ]
    parts += [Facts(f"Drive of {drive.joint}", tuple(drive.rows())) for drive in linear.drives]
    if loci is not None:
        parts.append(Picture(f"Eigenvalues over {loci.parameter}", svg_of(plot_root_loci(loci, None)), screen=True))
    return Document(
        title=f"{linear.name}: modes",
        status=status,
        success=linear.stable is True and not reached(linear.notes),
        verdict=(f"{linear.description}: {verdict}.",),
        about=(linear.name, scene.source.name, f"bellcrank {version()}"),
        warnings=(),
        notes=linear.notes,
        still=Still(0.0, "mode 1"),
        parts=tuple(parts),
    )


def _operating_point(scene: Scene, linear: Linearisation) -> tuple[tuple[str, str], ...]:
    rows = [("kind", linear.kind)]
    for joint in scene.robot.joints:
        q = shown(linear.position[joint.q : joint.q + joint.nq])
        v = shown(linear.velocity[joint.v : joint.v + joint.nv])
        rows.append((joint.name, f"position {q}; velocity {v}"))
    if linear.symmetries:
        rows.append(("symmetries", "; ".join(linear.symmetries)))
    return tuple(rows)


def _table(linear: Linearisation) -> str:
    """The table of modes, each linked to its time in the replay."""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in linear.mode_header)
    body = ""
    for k, row in enumerate(linear.mode_rows()):
        link = f'<a href="#t={k * SECONDS:g}&amp;play=1">{escape(row[0])}</a>'
        cells = zip(linear.mode_header[1:], row[1:], strict=True)
        rest = "".join(f'<td data-name="{escape(name)}">{escape(cell)}</td>' for name, cell in cells)
        body += f"<tr><th>{link}</th>{rest}</tr>"
    return (
        '<section><h2>Modes</h2><div class="wide"><table><thead><tr>'
        f"{head}</tr></thead><tbody>{body}</tbody></table></div><p>Click the number of a mode to show it.</p></section>"
    )
