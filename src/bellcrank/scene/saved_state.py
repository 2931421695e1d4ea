"""A start in the state of a saved run: initial: {run: FILE.npz, time: …, clock: …}.

The path is relative to the scene's folder or, in an override, also to the working directory. The state is that of the
last row, or of the row at `time`; for a run that ended with a latch, the velocity is that after the impact. The run
must have the joints of the scene's robot. Other keys of `initial` and `base` take precedence over it. If the state does
not satisfy the constraints, the search for a consistent start changes it, by `largest_correction` at most. The time of
the new run starts at 0; `clock` is the value of t for expressions, tables and motions at that time: by default
(`continue`) its value in the saved run, or a number (s).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.arrays import Array
from bellcrank.config.fields import Fields
from bellcrank.errors import InputError
from bellcrank.files.npz_archive import brief
from bellcrank.robot.model.joints import unit_vector
from bellcrank.scene.run_contents import refusing, run_contents, unpacked_scene

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot, RobotJoint

SAME_TIME = 1e-12  # relative difference of the time of a row and the time in the scene
SAME = 1e-9  # relative difference of the last time and the duration
UNIT = 1e-6  # difference of a quaternion's length from 1; in saved runs it is a rounding error


@dataclass(frozen=True)
class RunScene:
    """The facts that a start uses from the scene inside a run.

    They are the robot, the clock at time 0 (s), the names of latching events, and the names and widths of the signals
    that the run found, which are its last ones, and those of the auxiliary states of its elements.
    """

    robot: Robot
    clock: float
    latches: frozenset[str]
    held: tuple[tuple[str, int], ...] = ()
    auxiliary: tuple[tuple[str, int], ...] = ()


SceneReader = Callable[[Path], RunScene]


@dataclass(frozen=True, eq=False)
class SavedState:
    """A row of a saved run: joints, position (nq,), velocity (nv,), clock, s, what sampled controllers
    held, and the auxiliary states by the name of their element.

    Where they sample at that time, it is what they held before: the run that starts there samples then.
    """

    name: str
    joints: tuple[RobotJoint, ...]
    position: Array
    velocity: Array
    clock: float
    held: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    auxiliary: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    def write_position(self, robot: Robot, q: Array) -> None:
        """Write the position into q (nq,) of a robot with these joints."""
        for j in self.joints:
            here = robot.joint(j.name)
            q[here.q : here.q + here.nq] = self.position[j.q : j.q + j.nq]

    def write_velocity(self, robot: Robot, v: Array) -> None:
        """Write the velocity into v (nv,) of a robot with these joints."""
        for j in self.joints:
            here = robot.joint(j.name)
            v[here.v : here.v + here.nv] = self.velocity[j.v : j.v + j.nv]


def read_run_start(start: Fields, robot: Robot, read_scene: SceneReader, timed: bool = True) -> SavedState:
    """Read the keys `run`, and `time` if `timed`, of `initial`. Raises InputError naming file and key."""
    file = _file(start).resolve()
    time = start.optional_number("time", "s") if timed else None
    try:
        facts = file.stat()
        saved = _cached_state(file, time, read_scene, facts.st_mtime_ns, facts.st_size)
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
            f"the joints of the run in {file} differ from those of {robot.name}: {'; '.join(parts)}; a start requires "
            "a run with the same joints",
        )
    return saved


def read_clock(start: Fields, saved: SavedState | None) -> float:
    """Read the clock at the start, s: by default that of a saved run, or 0. Raises InputError naming file and key."""
    if start.raw("clock", 0.0 if saved is None else "continue") != "continue":
        return start.number("clock", "s", 0.0)
    if saved is None:
        raise start.error("clock", "'continue' requires a saved run; name the run as run: FILE.npz")
    return saved.clock


def saved_state(path: str | Path, time: float | None, read_scene: SceneReader) -> SavedState:
    """The last row of a saved run, or the row at a time (s).

    Only times, states, events and the scene are read and checked. Raises InputError for a file that is not a run, for
    a time without a row, and for a state that is not finite.
    """
    file = Path(path)
    about, arrays = run_contents(file)
    with refusing(file):
        _check_texts(about)
        scene = read_scene(unpacked_scene(about))
        own = sum(size for _, size in scene.auxiliary)
        times, states = _checked_rows(about, arrays, scene.robot, own)
    robot = scene.robot
    k = len(times) - 1 if time is None else int(np.abs(times - time).argmin())
    if time is not None and not abs(times[k] - time) <= SAME_TIME * max(1.0, abs(time)):
        near = ", ".join(f"{t:.12g}" for t in np.sort(times[np.argsort(np.abs(times - time))[:2]]))
        raise InputError(f"{file}: the run has no row at {time:.12g} s; the nearest are at {near} s")
    q, v = states[k, : robot.nq], states[k, robot.nq : robot.nq + robot.nv]
    ended_by_event = k == len(times) - 1 and about["status"] == "event" and about["events"]
    if ended_by_event and about["events"][-1]["name"] in scene.latches:
        v = _latch_velocity(file, arrays, robot)
    if not (np.isfinite(q).all() and np.isfinite(v).all()):
        raise InputError(f"{file}: the state at {times[k]:.6g} s is not finite; start from an earlier `time`")
    signals = about.get("signals")
    count = len(signals) if isinstance(signals, list) else 0
    held = _held(arrays, count, scene.held, float(times[k]))
    auxiliary, first = {}, robot.nq + robot.nv
    for name, size in scene.auxiliary:
        auxiliary[name] = tuple(states[k, first : first + size].tolist())
        first += size
    return SavedState(file.name, robot.joints, q, v, float(times[k]) + scene.clock, held, auxiliary)


def _held(arrays: Mapping[str, Array], count: int, named: Sequence[tuple[str, int]], time: float) -> dict[str, Any]:
    """What the held signals of a run were just before a time (s), by name; those that do not fit are left out."""
    found = {}
    for k, (name, width) in enumerate(named, start=count - len(named)):
        breaks, values = (arrays.get(f"signal_{k}_{part}") for part in ("breaks", "coefficients"))
        if breaks is None or values is None or values.shape != (len(breaks) - 1, 1, width):
            continue
        row = int(np.searchsorted(breaks[:-1], time - SAME * max(1.0, time))) - 1
        if row >= 0 and np.isfinite(values[row]).all():
            found[name] = tuple(values[row, 0].tolist())
    return found


def _latch_velocity(file: Path, arrays: Mapping[str, Array], robot: Robot) -> Array:
    """The velocity (nv,) after the impact of the latch that ended a run. Raises InputError."""
    velocity = arrays.get("latch_velocity")
    if velocity is None:
        raise InputError(
            f"{file}: the run ended with a latch, but the velocity after its impact is missing, as in "
            "checkpoints; load it and save it again: bc.load_run(FILE).save(FILE)"
        )
    if velocity.shape != (robot.nv,):
        raise InputError(f"{file}: 'latch_velocity' has the shape {velocity.shape}, expected ({robot.nv},)")
    return velocity


def _check_texts(about: Mapping[str, Any]) -> None:
    """Check the types of the entries of a run's JSON text. Raises ValueError."""
    files, events, settings = about.get("files"), about.get("events"), about.get("settings")
    if not isinstance(files, dict) or not all(isinstance(text, str) for text in files.values()):
        raise ValueError("'files': expected a mapping of names to texts")
    for key in ("scene", "status"):
        if not isinstance(about.get(key), str):
            raise ValueError(f"'{key}': expected a text, found {brief(about.get(key))}")
    if not isinstance(events, list) or not all(isinstance(e, dict) and isinstance(e.get("name"), str) for e in events):
        raise ValueError("'events': expected a list of mappings with names")
    if not isinstance(settings, dict) or type(settings.get("duration")) not in (int, float):
        raise ValueError("'settings.duration': expected a number")


def _checked_rows(about: Mapping[str, Any], arrays: Mapping[str, Array], robot: Robot, own: int) -> tuple[Array, Array]:
    """Check and return the times (n,), s, and states (n, nq + nv + own, or one more) of a run. Raises ValueError."""
    for name in ("time", "state"):
        if name not in arrays:
            raise ValueError(f"there is no '{name}'")
    times, states = arrays["time"], arrays["state"]
    widths = (robot.nq + robot.nv + own, robot.nq + robot.nv + own + 1)  # without and with the work W
    if times.ndim != 1 or not len(times) or not np.isfinite(times).all() or np.any(np.diff(times) < 0.0):
        raise ValueError("'time' is not a list of finite times in non-decreasing order")
    latest = float(about["settings"]["duration"]) * (1.0 + SAME)
    if not 0.0 <= times[0] <= times[-1] <= latest:
        raise ValueError(f"'time' is {times[0]:.6g} to {times[-1]:.6g} s, expected 0 to {latest:.6g} s")
    if states.shape not in [(len(times), width) for width in widths]:
        raise ValueError(f"'state' has the shape {states.shape}, expected {(len(times), widths[0])}")
    if not np.isfinite(states[:-1]).all():
        raise ValueError("'state' is not finite before its last row")
    whole = states[np.isfinite(states).all(axis=1)]
    for j in robot.joints:
        if (part := unit_vector(j)) is not None:
            length = np.sqrt(np.square(whole[:, part]).sum(axis=1))
            if not (np.abs(length - 1.0) <= UNIT).all():
                raise ValueError("'state' has a rotation whose length is not 1")
    return times, states


@lru_cache(maxsize=16)
def _cached_state(file: Path, time: float | None, read_scene: SceneReader, changed: int, size: int) -> SavedState:
    """The result of `saved_state`; `changed` and `size` distinguish versions of the file."""
    return saved_state(file, time, read_scene)


def _file(start: Fields) -> Path:
    """The path of the run. Raises InputError if it may not be read, or if an override's path matches two files."""
    if not start.overridden("run"):
        return start.file("run")
    name = Path(start.text("run")).expanduser()
    here, there = start.access.folder / name, Path.cwd() / name
    if not there.exists():
        return here
    if here.exists() and not here.samefile(there):
        raise start.error("run", f"two files match, {here} and {there}; write an absolute path")
    return there
