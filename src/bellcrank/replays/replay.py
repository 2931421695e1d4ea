"""`replay` and `show`: a run, a motion or a sizing as a page to look at."""

from __future__ import annotations

import html
import sys
import webbrowser
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bellcrank import arguments
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.temporaries import new_folder
from bellcrank.motion.motion import Motion
from bellcrank.replays.film.film import Film
from bellcrank.replays.geometry.meshes import Detail
from bellcrank.replays.page.page import page, write_page
from bellcrank.sizing.history import file_name
from bellcrank.sizing.result import Sizing
from bellcrank.terminal.progress import share_bar

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene
    from bellcrank.simulation.trajectory import Trajectory

HEIGHT = 640  # px of a page in a notebook


@dataclass(frozen=True)
class Inline:
    """A page that a notebook shows where it stands; `page` is its HTML text."""

    page: str

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{html.escape(self.page)}" sandbox="allow-scripts" width="100%" height="{HEIGHT}" '
            'style="border:0"></iframe>'
        )

    def __repr__(self) -> str:
        return f"a replay of {len(self.page) / 1e6:.2f} MB"


def replay(
    thing: Trajectory | Motion | Sizing | str | Path,
    path: str | Path | None = None,
    *,
    robot: Robot | Scene | None = None,
    trace: Iterable[str] = (),
    detail: Detail = "reduced",
    title: str | None = None,
    plots: bool = True,
) -> Path | Inline:
    """Write one HTML page that plays a run, a motion (of `robot`) or a sizing, and needs no other file; its path.

    `thing` may be a run's file or folder, too, and `robot` a scene, whose forces count. Without a `path` a notebook
    shows the page; elsewhere it is written into the working folder under the thing's name. `trace` names the frames
    whose paths are drawn, `detail` "full" keeps all faces of meshes, `plots` says whether plots stand beside the view.
    Raises InputError for what cannot be shown, and where the file cannot be written.
    """
    source = opened(thing)
    if path is not None:
        path = arguments.path("path", path, "the path of a page")
    arguments.flag("plots", plots)
    if path is None and _in_notebook():
        return Inline(page(film_of(source, robot, trace=trace, detail=detail, title=title), plots=plots))
    target = f"{file_name(name_of(source))}.html" if path is None else path
    return write_page(film_of(source, robot, trace=trace, detail=detail, title=title), target, plots=plots)


def show(thing: Trajectory | Motion | Sizing | str | Path, **options: Any) -> Path:
    """Open a replay in the web browser, from a temporary file, whose path is returned; options as `replay` has them.

    Raises BellcrankError, with the path, where no browser can be started.
    """
    source = opened(thing)
    folder = new_folder("show")
    written = replay(source, folder / f"{file_name(name_of(source))}.html", **options)
    assert isinstance(written, Path)
    open_browser(written)
    return written


def open_browser(path: Path) -> None:
    """Open a page in the web browser. Raises BellcrankError where none can be started."""
    if not webbrowser.open(path.resolve().as_uri()):
        raise BellcrankError(f"no web browser could be started; open {path} yourself")


def film_of(
    thing: Trajectory | Motion | Sizing,
    robot: Robot | Scene | None = None,
    *,
    trace: Iterable[str] = (),
    detail: Detail = "reduced",
    title: str | None = None,
) -> Film:
    """The film of a run, a motion (of `robot`) or a sizing, with a progress bar where it takes longer than a second.

    Raises InputError for anything else.
    """
    from bellcrank.replays.film.motion_film import film_of_motion, film_of_sizing
    from bellcrank.replays.film.run_film import film_of_run

    arguments.one_of("detail", detail, ("reduced", "full"))
    trace = arguments.several("trace", trace, str, "names of frames", alone=True)
    if title is not None:
        arguments.text("title", title, empty=True)
    if robot is not None and not hasattr(robot, "robot"):
        arguments.robot(robot)
    with share_bar("film") as progress:
        options: dict[str, Any] = {"trace": trace, "detail": detail, "title": title, "progress": progress}
        if isinstance(thing, Sizing):
            return film_of_sizing(thing, **options)
        if isinstance(thing, Motion):
            if robot is None:
                raise InputError(f"motion '{thing.name}': a motion does not hold its robot; write robot=ROBOT too")
            return film_of_motion(thing, robot, **options)
        return film_of_run(thing, **options)


def find_run(path: str | Path) -> Path:
    """The file of a run: itself, or run.npz in a folder that `bellcrank simulate` wrote; of a run that was killed, the
    folder of its blocks. Raises InputError.
    """
    from bellcrank.simulation.checkpoints import holds_checkpoints

    file = Path(path)
    if not file.is_dir() or holds_checkpoints(file):
        return file
    blocks = file / "run.blocks"
    if holds_checkpoints(blocks):
        if (file / "run.npz").exists():
            raise InputError(
                f"{file}: beside run.npz there are blocks of a later run that did not come to its end, run.blocks; "
                f"name one of them, such as {blocks}"
            )
        return blocks
    if (file / "sizing.json").is_file():
        raise InputError(
            f"{file}: this folder holds the figures of a sizing, not its motions; name the configuration or URDF that was sized"
        )
    if not (file / "run.npz").is_file():
        raise InputError(f"{file}: there is no run.npz in this folder; `bellcrank simulate SCENE` writes one")
    return file / "run.npz"


def opened(thing: Any, by: str = "replay") -> Trajectory | Motion | Sizing:
    """What is to be shown, read from its file where a path is given. Raises InputError, which names what asked."""
    if isinstance(thing, (Motion, Sizing)):
        return thing
    if isinstance(thing, (str, Path)):
        from bellcrank.simulation.load_run import load_run

        return load_run(find_run(arguments.path("thing", thing, "a run, a motion, a sizing, or the path of a run")))
    from bellcrank.simulation.trajectory import Trajectory

    if isinstance(thing, Trajectory):
        return thing
    kinds = "a run, a motion, a sizing, or the path of a run"
    arguments.refuse("thing", kinds, thing, by, "simulate or size first")


def name_of(thing: Trajectory | Motion | Sizing) -> str:
    """What its page is called."""
    if isinstance(thing, Motion):
        return thing.name
    return f"{thing.robot}_sizing" if isinstance(thing, Sizing) else thing.scene.source.stem


def _in_notebook() -> bool:
    """Whether this runs in a notebook, which shows what an expression gives."""
    interactive = sys.modules.get("IPython")
    shell = interactive.get_ipython() if interactive is not None else None
    return shell is not None and hasattr(shell, "kernel")
