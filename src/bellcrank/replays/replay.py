"""`replay` and `show`: a run, a motion, a sizing or a selection as an interactive HTML page."""

from __future__ import annotations

import html
import sys
import webbrowser
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bellcrank import arguments
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.access import Trust, for_files_only
from bellcrank.files.temporaries import new_folder
from bellcrank.messages import file_name
from bellcrank.motion.motion import Motion
from bellcrank.planning.fastest_motion import FastestMotion
from bellcrank.replays.film.film import Film
from bellcrank.replays.geometry.meshes import Detail
from bellcrank.replays.page.page import page_html, write_page
from bellcrank.sizing.result import Sizing
from bellcrank.sizing.selection.selection import Selection
from bellcrank.terminal.progress import share_bar

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene
    from bellcrank.simulation.trajectory.trajectory import Trajectory

NOTEBOOK_HEIGHT = 640  # px


@dataclass(frozen=True)
class NotebookPage:
    """A page that a notebook displays; `page` is its HTML text."""

    page: str

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{html.escape(self.page)}" sandbox="allow-scripts" width="100%" '
            f'height="{NOTEBOOK_HEIGHT}" style="border:0"></iframe>'
        )

    def __repr__(self) -> str:
        return f"a replay of {len(self.page) / 1e6:.2f} MB"


@arguments.named
def replay(
    source: Trajectory | Motion | FastestMotion | Sizing | Selection | str | Path,
    path: str | Path | None = None,
    *,
    robot: Robot | Scene | None = None,
    over: Trajectory | Motion | FastestMotion | Sizing | Selection | str | Path | None = None,
    trace: Iterable[str] = (),
    detail: Detail = "reduced",
    title: str | None = None,
    plots: bool = True,
    live: bool | None = None,
    trust: Trust = (),
) -> Path | NotebookPage:
    """Write one HTML page that plays a run, motion, sizing or selection, and needs no server, network or other file.

    The page shows the robot in 3-D with traces, forces and torques as arrows, springs and events, and plots beside it.
    No point of a body is drawn further from the smooth curve through the rows of the run than the page states. Lengths
    are in m, forces in N, torques in N m; the world frame is the robot's.

    Args:
        source: A run, a motion, a fastest motion (with the limit that is active at each time, its joint highlighted,
            and the phase plane), a sizing, a selection (with its motors and gears as cylinders), or the path of a run:
            its file, or the folder that `bellcrank simulate` writes.
        path: The file to write; .html is added if it has another suffix. Default: the source's name in the working
            folder, or in a notebook no file.
        robot: The robot of a motion, or a scene whose forces act on it. Other sources have their own.
        over: Another source, shown over the first: tinted and translucent, its lines in the same charts.
        trace: Names of frames whose paths are drawn. Default: the frames of the scene's outputs, or the tip.
        detail: "reduced" simplifies meshes without visible loss, "full" keeps all faces.
        title: The title of the page; default: the name of the scene, motion, sizing or selection.
        plots: Whether plots stand beside the 3-D view.
        live: Whether the page computes: the reader of a sizing changes parameters, payloads, speeds, ratios and
            friction, and sees torques, margins and the verdict; that of a selection chooses motors and gears too; that
            of a run changes parameters and the start, and sees the run anew. Default: where the page can, and grows by
            less than 400 kB.
        trust: With the path of a run, folders whose meshes it may name, besides its own folder.

    Returns:
        The path of the page; in a notebook without `path`, the page itself, which the notebook displays.

    Raises:
        InputError: The source cannot be shown, a frame is unknown, a motion has no robot, or the file cannot be
            written.

    Example:
        >>> import tempfile
        >>> import bellcrank as bc
        >>> run = bc.simulate("pendulum", duration=1.0)
        >>> page = bc.replay(run, tempfile.mkdtemp() + "/pendulum.html", title="Pendulum", plots=False)
        >>> page.name
        'pendulum.html'
        >>> "<title>Pendulum</title>" in page.read_text(encoding="utf-8")
        True
    """
    loaded = load_source(source, trust=trust)
    if path is not None:
        path = arguments.path("path", path, "the path of a page")
    arguments.flag("plots", plots)
    if live is not None:
        arguments.flag("live", live)
    computes = live if over is None and plots else False
    film = film_of(loaded, robot, trace=trace, detail=detail, title=title, live=computes)
    if over is not None:
        other = film_of(load_source(over, trust=trust, name="over"), robot, trace=trace, detail=detail)
        film = film_over(film, other, title)
    if path is None and _in_notebook():
        return NotebookPage(page_html(film, plots=plots))
    target = f"{file_name(source_name(loaded))}.html" if path is None else path
    return write_page(film, target, plots=plots)


@arguments.named
def show(
    source: Trajectory | Motion | FastestMotion | Sizing | Selection | str | Path,
    *,
    robot: Robot | Scene | None = None,
    trace: Iterable[str] = (),
    detail: Detail = "reduced",
    title: str | None = None,
    plots: bool = True,
    trust: Trust = (),
) -> Path:
    """Write a replay to a temporary file and open it in the web browser.

    Args:
        source: A run, a motion, a sizing, a selection, or the path of a run, as in `replay`.
        robot: The robot of a motion, or a scene whose forces act on it.
        trace: Names of frames whose paths are drawn.
        detail: "reduced" simplifies meshes without visible loss, "full" keeps all faces.
        title: The title of the page; default: the name of the scene, motion, sizing or selection.
        plots: Whether plots stand beside the 3-D view.
        trust: With the path of a run, folders whose meshes it may name, besides its own folder.

    Returns:
        The path of the temporary file.

    Raises:
        InputError: The source cannot be shown, as in `replay`.
        BellcrankError: No browser could be started; the message names the file.

    Example:
        >>> import bellcrank as bc
        >>> run = bc.simulate("pendulum")
        >>> bc.show(run)  # opens a browser  # doctest: +SKIP
    """
    loaded = load_source(source, "show", trust)
    target = new_folder("show") / f"{file_name(source_name(loaded))}.html"
    written = replay(loaded, target, robot=robot, trace=trace, detail=detail, title=title, plots=plots)
    assert isinstance(written, Path)
    open_browser(written)
    return written


def open_browser(path: Path) -> None:
    """Open a page in the web browser. Raises BellcrankError if none can be started."""
    if not webbrowser.open(path.resolve().as_uri()):
        raise BellcrankError(f"no web browser could be started; open {path} yourself")


def film_of(
    source: Trajectory | Motion | FastestMotion | Sizing | Selection,
    robot: Robot | Scene | None = None,
    *,
    trace: Iterable[str] = (),
    detail: Detail = "reduced",
    title: str | None = None,
    live: bool | None = False,
) -> Film:
    """The film of a run, motion (of `robot`), sizing or selection, with a progress bar beyond a second. `live` is as in
    `replay`.

    Raises InputError for an invalid argument, and for a motion without a robot.
    """
    from bellcrank.replays.film.fastest_film import film_of_fastest
    from bellcrank.replays.film.motion_film import film_of_motion
    from bellcrank.replays.film.run_film import film_of_run
    from bellcrank.replays.film.selection_film import film_of_selection
    from bellcrank.replays.film.sizing_film import film_of_sizing

    arguments.one_of("detail", detail, ("reduced", "full"))
    trace = arguments.several("trace", trace, str, "names of frames", alone=True)
    if title is not None:
        arguments.text("title", title, empty=True)
    if robot is not None and not hasattr(robot, "robot"):
        arguments.robot(robot)
    with share_bar("film") as progress:
        options: dict[str, Any] = {"trace": trace, "detail": detail, "title": title, "progress": progress}
        if isinstance(source, Sizing):
            return film_of_sizing(source, **options, live=live)
        if isinstance(source, Selection):
            return film_of_selection(source, **options, live=live)
        if isinstance(source, FastestMotion):
            return film_of_fastest(source, robot, **options)
        if isinstance(source, Motion):
            if robot is None:
                raise InputError(f"motion '{source.name}': a motion does not hold its robot; pass robot=ROBOT, too")
            return film_of_motion(source, robot, **options)
        return film_of_run(source, **options, live=live)


def find_run(path: str | Path) -> Path:
    """The file of a run: the path itself, or run.npz in a folder that `bellcrank simulate` wrote.

    For a run that was killed it is the folder of its blocks. Raises InputError.
    """
    from bellcrank.scene.run_contents import holds_checkpoints

    file = Path(path)
    if not file.is_dir() or holds_checkpoints(file):
        return file
    blocks = file / "run.blocks"
    if holds_checkpoints(blocks):
        if (file / "run.npz").exists():
            raise InputError(
                f"{file}: the folder contains run.npz and run.blocks, checkpoints of a later unfinished run; give one "
                f"path, such as {blocks}"
            )
        return blocks
    kinds = {"sizing": "sizing.json", "selection": "selection.json"}
    if kind := next((kind for kind, name in kinds.items() if (file / name).is_file()), None):
        raise InputError(
            f"{file}: this folder holds the results of a {kind}, not its motions; name the configuration or URDF that "
            "it is of"
        )
    if not (file / "run.npz").is_file():
        raise InputError(f"{file}: there is no run.npz in this folder; `bellcrank simulate SCENE` writes one")
    return file / "run.npz"


def film_over(film: Film, other: Film, title: str | None = None) -> Film:
    """A film with another one over it, under a title of its own where one is given."""
    from bellcrank.replays.film.compared_films import compared_films

    both = compared_films(film, other)
    return both if title is None else replace(both, title=title)


def told_apart(film: Film, other: Film, names: tuple[str, str]) -> tuple[Film, Film]:
    """Two films of one title under these names, where the names differ; other films as they are."""
    if film.title != other.title or names[0] == names[1]:
        return film, other
    return replace(film, title=names[0]), replace(other, title=names[1])


def load_source(
    source: Any, caller: str = "replay", trust: Trust = (), name: str = "source"
) -> Trajectory | Motion | FastestMotion | Sizing | Selection:
    """A run, motion, sizing or selection; a path is read, with trusted folders. Raises InputError, which names the
    caller.
    """
    kinds = "a run, a motion, a fastest motion, a sizing, a selection, or the path of a run"
    if isinstance(source, (str, Path)):
        from bellcrank.simulation.files.load_run import load_run

        return load_run(find_run(arguments.path(name, source, kinds)), trust=trust)
    for_files_only(trust, name, "load_run")
    if isinstance(source, (Motion, FastestMotion, Sizing, Selection)):
        return source
    from bellcrank.simulation.trajectory.trajectory import Trajectory

    if isinstance(source, Trajectory):
        return source
    arguments.refuse(name, kinds, source, caller, "simulate or size first")


def source_name(source: Trajectory | Motion | FastestMotion | Sizing | Selection) -> str:
    """The name after which a page is called."""
    if isinstance(source, FastestMotion):
        return source.motion.name
    if isinstance(source, Motion):
        return source.name
    if isinstance(source, Selection):
        return f"{source.robot}_selection"
    return f"{source.robot}_sizing" if isinstance(source, Sizing) else source.scene.source.stem


def _in_notebook() -> bool:
    """Whether this runs in a notebook, which displays the value of an expression."""
    interactive = sys.modules.get("IPython")
    shell = interactive.get_ipython() if interactive is not None else None
    return shell is not None and hasattr(shell, "kernel")
