"""The time of single calls of forward dynamics, as a stepper makes them, next to libpinocchio and the C baseline."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bellcrank.codegen.compile import Compiled
from bellcrank.errors import BellcrankError
from bellcrank.files.temporaries import temporary_folder
from bellcrank.robot.catalog import find_urdf
from bellcrank.robot.formats.xml_tree import read_text
from bellcrank.robot.load import load_robot
from bellcrank.robot.robot import Robot
from bellcrank_bench.c_baseline.baseline import NAME as C_BASELINE
from bellcrank_bench.c_baseline.compiler import FLAGS, shared_library
from bellcrank_bench.measurements.dynamics_peers import pinocchio_parallel
from bellcrank_bench.measurements.dynamics_speed import FLOATING, PINOCCHIO, random_states
from bellcrank_bench.measurements.machine import best_of
from bellcrank_bench.measurements.native_loop import loop
from bellcrank_bench.measurements.row import Row

Array = NDArray[np.float64]
ROBOTS = ("planar_2r", "ur5", "panda", "talos")
COMPILED = "bellcrank, one sample per call"
SAMPLES = 512  # states in turn: too many for branch predictors to learn, few enough to stay in the cache

_MIMIC = re.compile(r"<mimic\b[^<>]*/>")
_WRAPPER = """#define _GNU_SOURCE
#include "planar_2r_swing.h"
int evaluate(const double *const *in, double *const *out) { rhs(in[0], out[0]); return 0; }
"""


def forward_dynamics_calls(robot_name: str, repeats: int = 40) -> list[Row]:
    """The rows of single calls of forward dynamics (q, v, tau) -> a without friction: libpinocchio's, then bellcrank's.

    planar_2r, with gravity along -y, adds the right-hand side (q, v) -> (v, a) of the arm, from the C baseline and
    compiled: the lecture's equations (A. Ghosal, NPTEL 2022, lecture 18; c_baseline/planar_2r_swing.h). Mimic joints
    are independent here, because libpinocchio's algorithm does not take them.
    """
    robot = without_mimics(robot_name)
    states = random_states(robot, SAMPLES)
    code = robot.dynamics("forward_dynamics")
    out = np.empty((SAMPLES, robot.nv))
    run = loop(code.address("scalar"), states, [out])
    made = pinocchio_parallel(robot, "forward_dynamics", *states)
    if isinstance(made, str):
        raise BellcrankError(f"{robot_name}: {made}")
    pinocchio, columns = made
    rows = [
        Row(subject=robot_name, method="forward_dynamics", tool=PINOCCHIO, error=0.0),
        Row(subject=robot_name, method="forward_dynamics", tool=COMPILED, error=0.0),
    ]
    rows = _time(rows, [pinocchio, run], repeats)
    reference = columns.T
    rows[1] = replace(rows[1], error=float(np.abs(out - reference).max() / np.abs(reference).max()))
    return rows + (_right_hand_sides(robot, repeats) if robot_name == "planar_2r" else [])


def _time(rows: list[Row], runs: Sequence[Callable[[], object]], repeats: int) -> list[Row]:
    """The rows with their best times, taken in turns: a ratio must not mix two states of the machine."""
    best = [float("inf")] * len(runs)
    for _ in range(repeats):
        for k, run in enumerate(runs):
            best[k] = min(best[k], best_of(run, 3))
    return [replace(row, seconds=seconds / SAMPLES) for row, seconds in zip(rows, best, strict=True)]


def without_mimics(name: str) -> Robot:
    """The robot without friction, whose mimicking joints are independent."""
    gravity = (0.0, -9.81, 0.0) if name == "planar_2r" else (0.0, 0.0, -9.81)
    robot = load_robot(name, gravity, floating_base=name.startswith(FLOATING), friction="none")
    if not robot.mimics():
        return robot
    with temporary_folder("bench") as folder:
        path = folder / f"{name}.urdf"
        path.write_text(_MIMIC.sub("", read_text(find_urdf(name))), encoding="utf-8")
        independent = load_robot(path, gravity, floating_base=name.startswith(FLOATING), friction="none")
        independent.dynamics("forward_dynamics").address("scalar")  # traced and compiled while the file exists
        independent.model  # noqa: B018  likewise
        return independent


def _right_hand_sides(robot: Robot, repeats: int) -> list[Row]:
    """The 2R arm's right-hand side x = (q, v) -> dx/dt without torques: the C baseline, and the compiled graph."""
    x = np.hstack(random_states(robot, SAMPLES, seed=1)[:2])
    code = right_hand_side(robot)
    outs = [np.empty_like(x), np.empty_like(x)]
    try:
        with temporary_folder("bench") as folder:
            source = folder / "right_hand_side.c"
            source.write_text(_WRAPPER, encoding="utf-8")
            library = shared_library(source)
    except BellcrankError as failure:
        return [Row(subject=robot.name, method="right_hand_side", tool=C_BASELINE, note=str(failure))]
    address = ctypes.cast(library.evaluate, ctypes.c_void_p).value or 0
    runs = [loop(address, [x], outs[:1]), loop(code.address("scalar"), [x], outs[1:])]
    rows = [
        Row(subject=robot.name, method="right_hand_side", tool=C_BASELINE, error=0.0, note=" ".join(FLAGS)),
        Row(subject=robot.name, method="right_hand_side", tool=COMPILED, error=0.0),
    ]
    rows = _time(rows, runs, repeats)
    error = float(np.abs(outs[0] - outs[1]).max() / np.abs(outs[0]).max())
    return [rows[0], replace(rows[1], error=error)]


def right_hand_side(robot: Robot) -> Compiled:
    """The compiled (q, v) as one vector -> (dq/dt, dv/dt) under gravity alone, for robots whose dq/dt is v."""
    import casadi

    def build() -> casadi.Function:
        x = casadi.SX.sym("x", 2 * robot.nv)
        q, v = x[: robot.nv], x[robot.nv :]
        forward = robot.equations.dynamics("forward_dynamics")
        return casadi.Function("right_hand_side", [x], [casadi.vertcat(v, forward(q, v, casadi.SX(robot.nv, 1)))])

    return robot.compiled("right_hand_side", build)
