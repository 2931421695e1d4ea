"""A start that a saved run gives: initial: {run: FILE.npz, time: …, clock: …}.

The file is looked for in the folder of the scene, and, where an override names it, in the working directory too. The
state is that of the last row, or of the row at `time`. It must have the joints of the scene's robot; whatever else
`initial` and `base` name beside it keeps what it is given there. On the way to constraints the run's values are free to
move. The run that starts there counts its own time from 0 again; `clock` says what t, tables and motions read at that
moment: a number (s), 0 unless it is given, or `continue` for what they read in the saved run.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.config.fields import Fields
from bellcrank.dynamics.consistent_start import consistent_start
from bellcrank.errors import InputError

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot, RobotJoint
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SavedState:
    """A row of a saved run: the joints, position (nq,), velocity (nv,), and what the clock read there, s."""

    name: str
    joints: tuple[RobotJoint, ...]
    position: Array
    velocity: Array
    clock: float

    def place(self, robot: Robot, q: Array) -> None:
        """Write the position into that of a robot with these joints, (nq,)."""
        for j in self.joints:
            here = robot.joint(j.name)
            q[here.q : here.q + here.nq] = self.position[j.q : j.q + j.nq]

    def move(self, robot: Robot, v: Array) -> None:
        """Write the velocity into that of a robot with these joints, (nv,)."""
        for j in self.joints:
            here = robot.joint(j.name)
            v[here.v : here.v + here.nv] = self.velocity[j.v : j.v + j.nv]


def read_run_start(start: Fields, robot: Robot, timed: bool = True) -> SavedState:
    """The state under the keys `run`, and `time` where that is no joint, of `initial`; InputError naming both."""
    file = _file(start).resolve()
    time = start.optional_number("time", "s") if timed else None
    try:
        facts = file.stat()
        saved = _saved(file, time, facts.st_mtime_ns, facts.st_size)
    except OSError:
        raise start.error("run", f"{file}: there is no such file") from None
    except InputError as error:
        raise start.error("run", str(error)) from None
    theirs, mine = ({(j.name, j.kind) for j in joints} for joints in (saved.joints, robot.joints))
    if theirs != mine:
        parts = [
            f"{what} {', '.join(f'{name} ({kind})' for name, kind in sorted(joints))}"
            for what, joints in (("only the run has", theirs - mine), ("only the robot has", mine - theirs))
            if joints
        ]
        raise start.error(
            "run",
            f"the joints of the run in {file} are not those of {robot.name}: {'; '.join(parts)}; a run can start from "
            "runs of the same joints only",
        )
    return saved


def read_clock(start: Fields, saved: SavedState | None) -> float:
    """What the clock reads at the start, s, under the key `clock`; InputError naming file and key."""
    if start.raw("clock", 0.0) != "continue":
        return start.number("clock", "s", 0.0)
    if saved is None:
        raise start.error("clock", "'continue' goes on with the clock of a saved run; name it as run: FILE.npz")
    return saved.clock


def explicit_start(scene: Scene) -> dict[str, Any]:
    """The keys `initial` and `base` of a scene with the numbers of its start in them."""
    q, v = consistent_start(scene)
    initial: dict[str, Any] = {"velocity": {}}
    found: dict[str, Any] = {}
    for k, j in enumerate(scene.robot.joints):
        position, velocity = q[j.q : j.q + j.nq].tolist(), v[j.v : j.v + j.nv].tolist()
        if j.nv == 1:
            initial[j.name], initial["velocity"][j.name] = position[0], velocity[0]
            continue
        size = 3 if j.kind == "floating" else 2
        free = {"position": position[:size], "linear_velocity": velocity[:size], "expressed_in": "body"}
        if j.kind == "floating":
            free |= {"quaternion_xyzw": position[size:], "angular_velocity": velocity[size:]}
        else:
            free |= {"angle": float(np.arctan2(position[3], position[2])), "angular_velocity": velocity[size]}
        if scene.robot.floating_base and k == 0:
            found["base"] = free
        else:
            initial[j.name] = free
    if scene.initial.clock:
        initial["clock"] = scene.initial.clock
    return found | {"initial": initial}


@lru_cache(maxsize=16)
def _saved(file: Path, time: float | None, changed: int, size: int) -> SavedState:
    from bellcrank.simulation.load_run import saved_state

    return saved_state(file, time)


def _file(start: Fields) -> Path:
    """The run's file; InputError where it may not be named, and where an override names two different ones."""
    if not start.overridden("run"):
        return start.file("run")
    name = Path(start.text("run")).expanduser()
    here, there = start.access.folder / name, Path.cwd() / name
    if not there.exists():
        return here
    if here.exists() and not here.samefile(there):
        raise start.error("run", f"there are two files of that name, {here} and {there}; write the whole path")
    return there
