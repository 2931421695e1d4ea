"""MuJoCo on scenes with constraints: the loop as an equality of two sites, the rolling as contact with friction.

Both are springs of MuJoCo's own making, whose stiffness (`solref`) and hardness (`solimp`) are searched along with the
step.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Iterator, Mapping
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from bellcrank_bench.bench.bench_problem import Array, Outcome, Problem, Run
from bellcrank_bench.peers import disk_start, substeps
from bellcrank_bench.textbook.reduced_coordinates import BricardRing, FourBar, RollingDisk

OFF = "sensor actuation autoreset midphase nativeccd island eulerdamp refsafe".split()
GRID = ("integrator", "step", "speed", "hardness", "shape")
NOTE = "mj_step(model, data, nstep) from output to output: C loop, GIL-free; Newton's solver, warm starts"


def runs(problem: Problem, settings: Mapping[str, Any]) -> Iterator[Run]:
    """Every integrator at every step, speed of the constraint's own motion (per step), hardness, shape of the rim."""
    mujoco: Any = importlib.import_module("mujoco")
    mujoco.set_mju_user_warning(lambda _: None)  # a run that bursts is a row that failed, not lines on the screen
    start = _start(problem)
    for integrator, step, speed, hardness, shape in product(*(settings[key] for key in GRID)):
        count, h = substeps(problem, step)
        rate = speed / h
        # critically damped at `rate` (1/s), in MuJoCo's direct format (-stiffness, -damping)
        reference = f"{-rate * rate!r} {-2.0 * rate!r}"
        model = mujoco.MjModel.from_xml_string(_mjcf(problem, integrator, h, reference, hardness, shape))
        once = partial(_run, mujoco, problem, model, mujoco.MjData(model), count, start)
        yield Run("MuJoCo", integrator, f"h {h:.3g}, {rate:.3g}/s, {hardness:g}, {shape}", NOTE, once)


def _start(problem: Problem) -> tuple[Array, Array]:
    if isinstance(problem.equations, FourBar):
        state = problem.unreduced(np.array(problem.start))
        return state[:3], state[3:]
    if isinstance(problem.equations, BricardRing):
        return np.zeros(5), np.zeros(5)
    return disk_start(problem)


def _mjcf(problem: Problem, integrator: str, step: float, reference: str, hardness: float, shape: str) -> str:
    equations = problem.equations
    solid = f'solref="{reference}" solimp="{hardness!r} {hardness!r} 0.001 0.5 2"'
    flags = " ".join(f'{name}="disable"' for name in OFF)
    if isinstance(equations, FourBar):
        flags += ' contact="disable"'
        link = '<joint axis="0 0 1" {3}/><inertial pos="{1!r} 0 0" mass="{0!r}" diaginertia="{2!r} {2!r} {2!r}"/>'
        spring = f'stiffness="{equations.stiffness!r}" springref="{equations.preload / equations.stiffness!r}"'
        crank, coupler, rocker = (
            link.format(*values, spring if k == 0 else "")
            for k, values in enumerate(zip(equations.mass, equations.center, equations.inertia, strict=True))
        )
        l1, l2, l3 = equations.length
        bodies = f"""<body>{crank}<body pos="{l1!r} 0 0">{coupler}<site name="a" pos="{l2!r} 0 0"/></body></body>
            <body pos="{equations.ground!r} 0 0">{rocker}<site name="b" pos="{l3!r} 0 0"/></body>"""
        constraint, gravity = f'<equality><connect site1="a" site2="b" {solid}/></equality>', "0 0 0"
    elif isinstance(equations, BricardRing):
        flags += ' contact="disable"'
        bodies = _ring(equations)
        pairs = "".join(f'<connect site1="a{k}" site2="b{k}" {solid}/>' for k in range(2))
        constraint, gravity = f"<equality>{pairs}</equality>", f"0 {-equations.g!r} 0"
    else:
        assert isinstance(equations, RollingDisk)
        r = equations.radius
        size = {"cylinder": f"{r!r} 1e-5", "ellipsoid": f"{r!r} {r!r} 1e-3"}[shape]
        across, axial, rough = 0.125 * r * r, 0.25 * r * r, f'friction="3 0 0" {solid}'
        bodies = f"""<geom type="plane" size="0 0 1" {rough}/>
            <body><freejoint/><geom type="{shape}" size="{size}" euler="1.5707963267948966 0 0" {rough}/>
            <inertial pos="0 0 0" mass="0.5" diaginertia="{across!r} {axial!r} {across!r}"/></body>"""
        constraint, gravity = "", f"0 0 {-equations.g!r}"
    return f"""<mujoco><compiler angle="radian" autolimits="false"/>
        <option gravity="{gravity}" timestep="{step!r}" integrator="{integrator}" cone="elliptic" impratio="100"
          tolerance="1e-15"><flag {flags}/></option>
        <worldbody>{bodies}</worldbody>{constraint}</mujoco>"""


def _ring(equations: BricardRing) -> str:
    """Five bodies, one in the other; the sixth hinge is held at two points, P5 and 1 m along its axis."""
    rods = equations.rods
    ends = "".join(f'<site name="a{k}" pos="{k} 1 0"/>' for k in range(2))
    for rod, inertia, axis, at in zip(
        rods[::-1], equations.inertias[::-1], "zyxzy", [*rods[3::-1], np.zeros(3)], strict=True
    ):
        along = " ".join("1" if name == axis else "0" for name in "xyz")
        center, place = (" ".join(f"{float(x)!r}" for x in point) for point in (rod / 2, at))
        about = " ".join(f"{float(x)!r}" for x in np.diag(inertia))
        ends = f"""<body pos="{place}"><joint axis="{along}"/><inertial pos="{center}" mass="1" diaginertia="{about}"/>
            {ends}</body>"""
    return ends + "".join(f'<site name="b{k}" pos="{k} 0 1"/>' for k in range(2))


def _run(mujoco: Any, problem: Problem, model: Any, data: Any, count: int, start: tuple[Array, Array]) -> Outcome:
    mujoco.mj_resetData(model, data)
    data.qpos[:], data.qvel[:] = start
    ring = problem.equations if isinstance(problem.equations, BricardRing) else None
    n = 5 if ring else 3
    position = np.empty((len(problem.times), n))
    step, now = mujoco.mj_step, data.qpos[:n]
    begun = time.perf_counter()
    position[0] = now
    for k in range(1, len(position)):
        step(model, data, count)
        position[k] = now
    seconds = time.perf_counter() - begun
    found = ring.corner_of(position) if ring else position
    return Outcome(seconds, found, steps=count * (len(position) - 1))
