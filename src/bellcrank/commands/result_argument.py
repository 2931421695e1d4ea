"""The argument RUN of commands that show a result: a saved run, a scene to simulate or a configuration to size."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank.commands.options import add_allow_massless, add_trust
from bellcrank.errors import InputError

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene
    from bellcrank.simulation.trajectory.trajectory import Trajectory
    from bellcrank.sizing.result import Sizing
    from bellcrank.sizing.selection.selection import Selection

_SCENE_KEYS = (  # keys of a file that is a scene to simulate
    "constraints", "forces", "joints", "joint_stops", "control", "initial", "base",
)  # fmt: skip


def add_result_argument(parser: argparse.ArgumentParser) -> None:
    """RUN, and the options that say whether and how it is computed first."""
    parser.add_argument(
        "run",
        metavar="RUN",
        help="a saved run (run.npz or its folder), a scene, which is simulated first, or a robot configuration with "
        "motions, which is sized first (--select: whose motors are chosen first)",
    )
    parser.add_argument(
        "--motion",
        action="append",
        default=[],
        metavar="FILE|NAME",
        help="size RUN, a configuration or URDF, over this CSV file or motion of the configuration; may be repeated",
    )
    add_allow_massless(parser)
    add_trust(parser)
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--simulate", action="store_true", help="simulate RUN, even if it has motions and could be sized")
    what.add_argument("--size", action="store_true", help="size RUN, even if it could be simulated")
    what.add_argument("--select", action="store_true", help="choose the motors and gears of RUN from the catalogue")


def add_other(parser: argparse.ArgumentParser) -> None:
    """OTHER, which is compared with RUN."""
    parser.add_argument(
        "other", nargs="?", metavar="OTHER",
        help="another one, which is shown over the first: tinted and translucent, its lines in the same charts; "
        "tables of both say what differs",
    )  # fmt: skip


def stem(name: str) -> str:
    """The name of a result for file names: that of its file, or of the folder of a run.npz."""
    given = Path(name)
    if given.is_dir():
        given = given.resolve()
        return given.parent.name if given.name.startswith("run.blocks") else given.name
    return given.resolve().parent.name if given.name == "run.npz" else given.stem


def compute_or_load(arguments: argparse.Namespace) -> Trajectory | Sizing | Selection:
    """The run, sizing or selection that the arguments mean. Raises BellcrankError."""
    from bellcrank.config.yaml_file import read_yaml
    from bellcrank.replays.replay import find_run
    from bellcrank.scene.robot_config import find_config
    from bellcrank.scene.scene import load_scene
    from bellcrank.simulation.files.load_run import load_run

    name, simulated = arguments.run, arguments.simulate
    sized = arguments.size or bool(arguments.motion and not arguments.select)
    path = Path(name)
    if arguments.motion and simulated:
        raise InputError("--motion is for sizing and --simulate is given; leave one of them out")
    if path.is_dir() or path.suffix.lower() == ".npz":
        options = {
            "simulate": simulated, "motion": arguments.motion, "size": sized, "select": arguments.select,
            "allow-massless": arguments.allow_massless
        }  # fmt: skip
        for option, given in options.items():
            if given:
                raise InputError(f"--{option} is for a scene or configuration, and {name} is a saved run; leave it out")
        return load_run(find_run(path), trust=arguments.trust)
    if path.suffix.lower() == ".json" and path.is_file():
        raise InputError(
            f"{name}: results in JSON hold no motion; expected a saved run (.npz, or its folder), a scene, a robot "
            "configuration (.yaml) or a robot file; name the one that was simulated, sized or selected for"
        )
    if arguments.select:
        return _selected(name, arguments)
    source, urdf = find_config(name)
    data = {} if urdf else read_yaml(source)
    if sized or (not simulated and "motions" in data and ("actuators" in data or data.keys().isdisjoint(_SCENE_KEYS))):
        return _sized(load_scene(name, trust=arguments.trust), arguments.motion, arguments.allow_massless)
    if arguments.allow_massless:
        raise InputError(f"--allow-massless is for sizing, and {name} is simulated; leave it out, or add --size")
    return _simulated(load_scene(name, trust=arguments.trust))


def _sized(scene: Scene, motions: list[str], allow_massless: list[str]) -> Sizing:
    from bellcrank.sizing.size import size

    return size(scene, motions or None, allow_massless=allow_massless)


def _selected(name: str, arguments: argparse.Namespace) -> Selection:
    """The selection from the bundled catalogue under the conditions of the configuration."""
    from bellcrank.scene.scene import load_scene
    from bellcrank.sizing.selection.select import select

    scene = load_scene(name, trust=arguments.trust)
    return select(scene, arguments.motion or None, allow_massless=arguments.allow_massless)


def _simulated(scene: Scene) -> Trajectory:
    from bellcrank.commands.simulate import simulation_progress
    from bellcrank.simulation.simulate import simulate

    with simulation_progress(scene.settings.duration) as progress:
        run = simulate(scene, progress=lambda time, _: progress(time))
        progress(float(run.time[-1]))
    return run


def verdict_of(result: Trajectory | Sizing | Selection) -> tuple[bool, str]:
    """Whether a run finished and is known, or a sizing or a selection keeps all limits; and what says so."""
    from bellcrank.sizing.result import Sizing
    from bellcrank.sizing.tables import verdict

    if isinstance(result, Sizing):
        return result.inside, verdict(result)
    from bellcrank.sizing.selection import tables
    from bellcrank.sizing.selection.selection import Selection

    if isinstance(result, Selection):
        return result.verified, tables.verdict(result)
    return result.success and not result.non_finite and not result.not_known, result.message


def remarks_of(result: Trajectory | Sizing | Selection) -> list[tuple[str, str]]:
    """What is said about a run, a sizing or a selection: ("error", "warning", "not known" or "note", text)."""
    from bellcrank.sizing.result import Sizing

    if isinstance(result, Sizing):
        masses = () if result.inputs is None else result.inputs.mechanism.robot.inertia_warnings
        kinds = dict.fromkeys(result.urdf_errors, "error") | dict.fromkeys(masses, "warning")
        return [(kinds.get(text, "note"), text) for text in result.warnings]
    from bellcrank.sizing.selection.selection import Selection

    if isinstance(result, Selection):
        return [("note", text) for text in result.warnings]
    from bellcrank.simulation.trajectory.summary import run_facts

    return [(name, text) for name, text in run_facts(result) if name in ("warning", "note", "not known")]
