"""What a command shows: a run that is there, a scene that is simulated first, or a configuration that is sized first."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank.commands.size import add_allow_massless
from bellcrank.commands.trust import add_trust
from bellcrank.errors import InputError

if TYPE_CHECKING:
    from bellcrank.scene.robot_config import RobotConfig
    from bellcrank.scene.scene import Scene
    from bellcrank.simulation.trajectory import Trajectory
    from bellcrank.sizing.result import Sizing

_MOVED = ("constraints", "forces", "control", "initial", "base")  # keys that make a configuration a scene to simulate


def add_shown(parser: argparse.ArgumentParser) -> None:
    """The arguments that say what is shown."""
    parser.add_argument(
        "run", metavar="RUN",
        help="what bellcrank simulate wrote (run.npz or its folder), or a scene, which is simulated first, or a robot "
        "configuration with motions, which is sized first",
    )  # fmt: skip
    parser.add_argument(
        "--motion", action="append", default=[], metavar="FILE", help="size RUN, a configuration or URDF, over this motion of "
        "the configuration or CSV file; may be repeated",
    )  # fmt: skip
    add_allow_massless(parser)
    add_trust(parser)
    what = parser.add_mutually_exclusive_group()
    what.add_argument(
        "--simulate", action="store_true", help="simulate a configuration that has both drives and a start"
    )
    what.add_argument("--size", action="store_true", help="size a scene that has motions")


def stem(name: str) -> str:
    """What a file about it is called: as the scene or the run; "run" itself says nothing, its folder does."""
    given = Path(name)
    if given.is_dir():
        given = given.resolve()
        return given.parent.name if given.name.startswith("run.blocks") else given.name
    return given.resolve().parent.name if given.name == "run.npz" else given.stem


def shown(arguments: argparse.Namespace) -> Trajectory | Sizing:
    """The run or sizing that the arguments mean. Raises BellcrankError."""
    from bellcrank.replays.replay import find_run
    from bellcrank.scene.renamed_keys import read_scene_data
    from bellcrank.scene.robot_config import find_config, load_robot_config
    from bellcrank.scene.scene import load_scene
    from bellcrank.simulation.load_run import load_run

    name, simulated, sized = arguments.run, arguments.simulate, arguments.size or bool(arguments.motion)
    path = Path(name)
    if arguments.motion and simulated:
        raise InputError("--motion is to size over; leave --simulate out")
    if path.is_dir() or path.suffix.lower() == ".npz":
        if simulated or sized or arguments.allow_massless:
            option = (
                "simulate" if simulated else "motion" if arguments.motion else "size" if sized else "allow-massless"
            )
            raise InputError(f"--{option} is for a scene or configuration; {name} is a run already")
        return load_run(find_run(path), trust=arguments.trust)
    source, urdf = find_config(name)
    data = {} if urdf else read_scene_data(source)[0]
    if sized or (not simulated and "motions" in data and ("actuators" in data or data.keys().isdisjoint(_MOVED))):
        return _sized(load_robot_config(name, trust=arguments.trust), arguments.motion, arguments.allow_massless)
    if arguments.allow_massless:
        raise InputError(f"--allow-massless is for sizing; {name} is simulated")
    return _simulated(load_scene(name, trust=arguments.trust))


def _sized(config: RobotConfig, motions: list[str], allow_massless: list[str]) -> Sizing:
    from bellcrank.sizing.front import size

    return size(config, motions or None, allow_massless=allow_massless)


def _simulated(scene: Scene) -> Trajectory:
    from bellcrank.commands.simulate import simulated_bar
    from bellcrank.simulation.simulate import simulate

    with simulated_bar(scene.settings.duration) as progress:
        run = simulate(scene, progress=progress)
        progress(float(run.time[-1]))
    return run


def verdict_of(thing: Trajectory | Sizing) -> tuple[bool, str]:
    """Whether the answer is yes, and the answer."""
    from bellcrank.sizing.result import Sizing
    from bellcrank.sizing.table import verdict

    if isinstance(thing, Sizing):
        return thing.inside, verdict(thing)
    return thing.success and not thing.non_finite, thing.message


def remarks_of(thing: Trajectory | Sizing) -> list[tuple[str, str]]:
    """Errors, warnings and notes about a run or a sizing, each with what it is."""
    from bellcrank.sizing.result import Sizing

    if isinstance(thing, Sizing):
        bare = () if thing.study is None else thing.study[0].robot.inertia_warnings
        kinds = dict.fromkeys(thing.urdf_errors, "error") | dict.fromkeys(bare, "warning")
        return [(kinds.get(text, "note"), text) for text in thing.warnings]
    from bellcrank.simulation.summary import run_facts

    return [(name, text) for name, text in run_facts(thing) if name in ("warning", "note")]
