"""The arguments of a sizing, checked."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from bellcrank.errors import InputError
from bellcrank.motion.motion import Motion
from bellcrank.sizing.drive import Drive


def tolerance_of(value: object) -> float:
    """A mass tolerance, a share of at least 0 and below 1; InputError."""
    number = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    if not number or not 0.0 <= float(value) < 1.0:  # type: ignore[arg-type]
        raise InputError(f"mass tolerance: expected a share of at least 0 and below 1, such as 0.1, found {value!r}")
    return float(value)  # type: ignore[arg-type]


def motions_of(given: object) -> list[Motion]:
    """One motion or a list of them as a list; InputError."""
    if isinstance(given, Motion):
        return [given]
    if isinstance(given, (str, bytes, Mapping)) or not isinstance(given, Iterable):
        raise InputError(f"motions: expected a Motion or a list of them, found {_kind(given)}{_of_run(given)}")
    motions = list(given)
    for motion in motions:
        if not isinstance(motion, Motion):
            raise InputError(
                f"motions: expected a Motion or a list of them, found {_kind(motion)} in the list{_of_run(motion)}"
            )
    return motions


def _of_run(given: object) -> str:
    """What to do with a run of a simulation, where one is given instead of a motion."""
    from bellcrank.simulation.trajectory import Trajectory

    remedy = "; write the run with run.to_csv(path) and read it with read_motion(robot, path)"
    return remedy if isinstance(given, Trajectory) else ""


def drives_of(given: object) -> dict[str, Drive]:
    """Drives by the names of joints, none where they are None; InputError."""
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise InputError(f"drives: expected a mapping of joint names to Drives, found {_kind(given)}")
    for name, drive in given.items():
        if not isinstance(name, str) or not isinstance(drive, Drive):
            raise InputError(
                f"drives: expected a mapping of joint names to Drives, found {_kind(drive)} under {name!r}"
            )
    return dict(given)


def _kind(value: object) -> str:
    return f"{value!r}"[:60] if isinstance(value, (str, int, float)) else f"a {type(value).__name__}"


def renamed(motions: list[Motion]) -> list[Motion]:
    """The motions with names of their own: the second "circle" becomes "circle (2)"."""
    names: list[str] = []
    for motion in motions:
        name, number = motion.name, 1
        while name in names:
            number += 1
            name = f"{motion.name} ({number})"
        names.append(name)
    return [
        motion if motion.name == name else replace(motion, name=name)
        for motion, name in zip(motions, names, strict=True)
    ]
