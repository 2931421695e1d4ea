"""The time to find the fastest motion along a path with torque limits on a fixed grid, next to toppra and copp-py.

The clock covers what a new path costs a warm process on one thread: positions and derivatives of the spline, the
torques at the grid, and the passes of reachability analysis. Calls of the tools alternate, so that ratios do not mix
two states of the machine.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from importlib import metadata

import numpy as np
from numpy.typing import NDArray

from bellcrank.codegen.full_tier import wait_for_optimised_code
from bellcrank.dynamics.inverse.mechanism import mechanism_of
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.planning.fastest_pass import fastest_on_grid
from bellcrank.planning.joint_path import joint_path
from bellcrank.planning.limits.motion_limits import MotionLimits
from bellcrank.planning.limits.path_limits import PathLimits
from bellcrank.robot.load import load_robot
from bellcrank_bench.measurements.fastest_peers import AT_BEGINNING, RUNS, PathProblem
from bellcrank_bench.measurements.row import Row

Array = NDArray[np.float64]
BELLCRANK = "bellcrank"
CELLS = 1000
WAYPOINTS = 5
SEED = 1
CALLS = 5  # of a tool before the next one's turn
SEARCHED = 40  # random paths: the first along which the torques hold the robot is taken
ROBOTS = ("ur5", "panda", "planar_2r")


def path_problem(name: str, cells: int = CELLS) -> PathProblem:
    """Five random waypoints of a robot with the torque limits of its URDF.

    Raises InputError for an unknown robot, and for one whose URDF does not limit all torques.
    """
    if name not in ROBOTS:
        raise InputError(unknown_name("robot", name, ROBOTS))
    robot = load_robot(name, friction="none")
    torque = np.array(robot.effort_limit)
    random = np.random.default_rng(SEED)
    s = np.linspace(0.0, 1.0, cells + 1)
    for _ in range(SEARCHED):
        waypoints = random.uniform(-1.5, 1.5, (WAYPOINTS, robot.nv))
        q = joint_path(robot, waypoints, np.linspace(0.0, 1.0, WAYPOINTS)).spline(s, 0)
        still = np.zeros_like(q)
        if np.all(np.abs(robot.inverse_dynamics(q, still, still)) < torque):
            return PathProblem(robot=robot, waypoints=waypoints, torque=torque, cells=cells)
    raise InputError(f"no path of {name} was found along which its torques hold it")


def bellcrank_run(problem: PathProblem) -> Callable[[], Array]:
    """A call of bellcrank's first-order method: path speeds (cells + 1,)."""
    robot = problem.robot
    path = joint_path(robot, problem.waypoints, problem.parameters)
    limits = MotionLimits(speed="none", torque=dict(zip(robot.joint_names, problem.torque.tolist(), strict=True)))
    bounds = PathLimits(mechanism_of(robot), {}, limits)
    return lambda: fastest_on_grid(path, bounds, problem.cells).speed


def fastest_rows(name: str, repeats: int) -> list[Row]:
    """A row for each tool: the best time of a call, and the relative difference of its motion's time from that of the
    first tool that limits torques at the same places.
    """
    problem = path_problem(name)
    runs: dict[tuple[str, str], Callable[[], Array]] = {(BELLCRANK, AT_BEGINNING): bellcrank_run(problem)}
    missing = []
    for (tool, method), prepare in RUNS.items():
        try:
            runs[tool, method] = prepare(problem)
        except ImportError as error:
            missing.append(Row(subject=name, tool=tool, method=method, failure=f"not installed: {error}"))
    durations = {which: problem.duration(run()) for which, run in runs.items()}
    first: dict[str, float] = {}
    for (_, method), duration in durations.items():
        first.setdefault(method, duration)
    seconds = _best(runs, repeats)
    rows = [
        Row(
            subject=name,
            tool=tool if tool == BELLCRANK else f"{tool} {metadata.version(tool)}",
            method=method,
            setting=f"{problem.cells} cells",
            seconds=seconds[tool, method],
            error=abs(duration / first[method] - 1.0),
            repeats=repeats,
            note=f"motion of {duration:.9f} s",
        )
        for (tool, method), duration in durations.items()
    ]
    return rows + missing


def _best(runs: Mapping[tuple[str, str], Callable[[], Array]], repeats: int) -> dict[tuple[str, str], float]:
    """The shortest time of a call of each, s, in turns of several calls."""
    wait_for_optimised_code()
    best = dict.fromkeys(runs, np.inf)
    for _ in range(repeats):
        for which, run in runs.items():
            for _ in range(CALLS):
                begun = time.perf_counter()
                run()
                best[which] = min(best[which], time.perf_counter() - begun)
    return best
