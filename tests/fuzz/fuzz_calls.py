"""Public functions, constructors and methods called by their signatures, with some arguments hostile."""

from __future__ import annotations

import functools
import inspect
import math
import random
from collections.abc import Callable
from typing import Any

import numpy as np
from fuzz_damage import Damage
from fuzz_seeds import NUMBERS, WORDS

import bellcrank as bc

# By name of a parameter: a right value where it is required.
RIGHT: dict[str, Callable[[], Any]] = {
    "robot": lambda: _robot(), "scene": lambda: "pendulum", "motion": lambda: _swing(), "motions": lambda: _swing(),
    "run": lambda: _run(), "source": lambda: _run(), "frame": lambda: "tip", "center": lambda: (1.2, 1.2, 0.0),
    "radius": lambda: 0.2, "end": lambda: (1.3, 0.9, 0.0), "position": lambda: [0.1, -0.5], "duration": lambda: 0.1,
    "positions": lambda: [[0.0, 0.0], [1.0, -1.0]], "times": lambda: [0.0, 1.0], "points": lambda: [[1.2, 0.8, 0.0]],
    "acceleration": lambda: 5.0, "speed": lambda: 1.0, "vary": lambda: {"initial.swing": [0.1, 0.2]},
    "q": lambda: [0.1, -0.5], "v": lambda: [0.3, 0.2], "a": lambda: [0.1, 0.4], "tau": lambda: [1.0, 0.5],
    "torque": lambda: [1.0, 0.5], "joint": lambda: "shoulder", "joints": lambda: ["shoulder", "elbow"],
    "name": lambda: "shoulder", "values": lambda: [0.1, 0.2], "period": lambda: 1.0, "time": lambda: 0.05,
    "parameter": lambda: "initial.swing", "path_or_name": lambda: "planar_2r",
    "mass": lambda: 1.0, "measure": lambda: "energy.total", "path": lambda: "made",
    "folder": lambda: "made", "motors": lambda: [], "gears": lambda: [], "overrides": lambda: {"simulate.samples": 3},
    "of": lambda: ["shoulder"], "seconds": lambda: 0.1, "ratio": lambda: 50.0, "id": lambda: "one", "axis": lambda: "z",
    "maker": lambda: "Acme", "model": lambda: "M1", "kind": lambda: "motor",
}  # fmt: skip
LIMITED = {"duration": 0.05, "samples": 3, "max_evaluations": 2000, "seconds": 0.1, "n": 2, "sample": 2, "effort": 100,
           "candidates": 1, "threads": 1, "grid": 20, "starts": 1}  # fmt: skip
# Classes that a user makes; objects of the others come from functions, which check their parts.
MADE = {"Actuator", "Catalogue", "Conditions", "CoupledTransmission", "Gear", "Motion", "MotionLimits", "Motor",
        "Mount", "Payload", "PreparedSimulation", "Settings"}  # fmt: skip
LEFT_OUT = {"show", "sobol_indices", "add_note", "with_traceback"}  # a browser; hours; those of exceptions
NOT_VARIED = {"workers", "scheduler", "trust", "self"}  # other processes and machines: tested in tests/studies
THINGS = [None, True, (), [], {}, [[]], [1], [1, 2], [1, 2, 3], {"elbow": math.nan}, {"a": 1}, b"x", 1j, object, print,
          [None], ["a"], np.zeros((0, 2)), np.array(["a"]), np.ma.array([1.0], mask=[True]), range(10**9),
          lambda *_: 1]  # fmt: skip


@functools.cache
def _robot() -> bc.Robot:
    return bc.load_robot("planar_2r")


@functools.cache
def _swing() -> bc.Motion:
    return bc.waypoints(_robot(), [0.0, 1.0], [[0.0, 0.0], [1.0, -1.0]], samples=21)


@functools.cache
def _run() -> bc.results.Trajectory:
    return bc.simulate("planar_2r_swing", duration=0.05, samples=5)


# Objects whose methods are called: made once in a process.
OBJECTS: dict[str, Callable[[], Any]] = {
    "Robot": _robot, "Motion": _swing, "Trajectory": _run,
    "Scene": functools.cache(lambda: bc.load_scene("pendulum")),
    "Sizing": functools.cache(lambda: bc.size(_robot(), _swing())),
    "Sweep": functools.cache(lambda: bc.sweep("pendulum", {"initial.swing": [0.1, 0.2]}, threads=1,
                                              overrides={"simulate.duration": 0.1})),
    "Linearisation": functools.cache(lambda: bc.linearise("pendulum")),
    "RootLoci": functools.cache(lambda: bc.root_loci("pendulum", "link.bob.mass", [1.0, 2.0])),
    "Catalogue": functools.cache(bc.load_catalogue),
    "Actuator": functools.cache(
        lambda: bc.Actuator(ratio=50, rated_torque=10, peak_torque=20, rated_speed=8, max_speed=10)),
    "Conditions": functools.cache(bc.Conditions),
    "DriveVerdicts": functools.cache(lambda: bc.judge("planar_2r")),
    "SpeedFactor": functools.cache(lambda: bc.speed_factor("planar_2r", _swing())),
    "RepeatedCycle": functools.cache(lambda: bc.repeated_cycle("planar_2r", _swing())),
    "FastestMotion": functools.cache(lambda: bc.time_optimal("planar_2r", _swing(), grid=50)),
    "JointPath": functools.cache(lambda: bc.joint_path(_robot(), [[0.0, 0.0], [1.0, -1.0]])),
    "MotionLimits": functools.cache(bc.MotionLimits),
    "PreparedSimulation": functools.cache(lambda: bc.prepare("pendulum", duration=0.05, samples=3)),
}  # fmt: skip


def _public(name: str) -> Any:
    return getattr(bc.results if name in bc.results.__all__ else bc, name)


@functools.cache
def names() -> tuple[str, ...]:
    """All public functions and classes, and methods of the objects above, as "NAME" or "CLASS.METHOD"."""
    found = [
        name for name in (*bc.__all__, *bc.results.__all__)
        if name in MADE or (inspect.isfunction(_public(name)) and name not in LEFT_OUT)
    ]  # fmt: skip
    for name in OBJECTS:
        kind = _public(name)
        found += [
            f"{name}.{method}"
            for method in sorted(vars(kind).keys() | {m for base in kind.__mro__[1:-1] for m in vars(base)})
            if not method.startswith("_") and callable(getattr(kind, method)) and method not in LEFT_OUT
        ]
    return tuple(found)


def _target(name: str) -> Callable[..., Any]:
    if "." not in name:
        found: Callable[..., Any] = _public(name)
        return found
    kind, method = name.split(".")
    found = getattr(OBJECTS[kind](), method)
    return found


def call(seed: int) -> None:
    """Call one of them; most arguments are right, one or two hostile. What is refused is a BellcrankError."""
    rng = random.Random(seed)
    name = rng.choice(names())
    target = _target(name)
    parameters = {
        key: each
        for key, each in inspect.signature(target).parameters.items()
        if each.kind not in (each.VAR_KEYWORD, each.VAR_POSITIONAL) and key not in NOT_VARIED
    }
    needed = [key for key, each in parameters.items() if each.default is each.empty]
    given = {key: RIGHT[key]() if key in RIGHT else _hostile(rng, key) for key in needed}
    given |= {key: value for key, value in LIMITED.items() if key in parameters}
    for key in rng.sample(list(parameters), min(len(parameters), rng.choice([0, 1, 1, 2]))):
        given[key] = _hostile(rng, key)
    if "path" in parameters and "path" not in given:
        given["path"] = "made"
    finite(name, target(**given))


def _hostile(rng: random.Random, key: str) -> Any:
    """A value that is wrong, or right by chance; writes stay within the folder."""
    found = rng.choice([rng.choice(NUMBERS), rng.choice(WORDS), rng.choice(THINGS), Damage(rng).value()])
    if (
        key in ("path", "folder", "out", "checkpoint")
        and isinstance(found, str)
        and (found.startswith("/") or ".." in found)
    ):
        return "made"
    return found


def finite(name: str, found: Any) -> None:
    """Arrays that a function of the dynamics gives are finite."""
    numbers = isinstance(found, np.ndarray) and found.dtype.kind == "f"
    if name.startswith("Robot.") and numbers and not np.isfinite(found).all():
        raise AssertionError(f"{name} gave numbers that are not finite")
