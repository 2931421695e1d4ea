"""MuJoCo, from MJCF text with the scene's numbers; everything that the scene lacks is disabled."""

from __future__ import annotations

import importlib
import time
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from bellcrank_bench.bench.bench_problem import Outcome, Problem, Run
from bellcrank_bench.peers import substeps
from bellcrank_bench.textbook.open_chains import SimplePendulum, SpringPendulum

OFF = "constraint contact warmstart sensor actuation autoreset midphase nativeccd island eulerdamp".split()
NOTE = "mj_step(model, data, nstep) from output to output: C loop, GIL-free (rollout takes as long)"


def runs(problem: Problem, settings: Mapping[str, Sequence[float]]) -> Iterator[Run]:
    """Every integrator at every time step."""
    mujoco: Any = importlib.import_module("mujoco")
    for integrator, steps in settings.items():
        for step in steps:
            count, h = substeps(problem, step)
            model = mujoco.MjModel.from_xml_string(_mjcf(problem, integrator, h))
            once = partial(_run, mujoco, problem, model, mujoco.MjData(model), count)
            yield Run("MuJoCo", integrator, f"h {h:.3g}", NOTE, once)


def _mjcf(problem: Problem, integrator: str, step: float) -> str:
    equations = problem.equations
    flags = " ".join(f'{name}="disable"' for name in OFF)
    if isinstance(equations, SpringPendulum):
        spring = f'stiffness="{equations.stiffness!r}" springref="{equations.free_length!r}"'
        # MuJoCo wants some inertia: 1e-12 kg m² beside m r² = 50 kg m²
        bodies = f"""<body><joint axis="0 0 1"/>
            <joint type="slide" axis="0 -1 0" {spring}/>
            <inertial pos="0 0 0" mass="{equations.mass!r}" diaginertia="1e-12 1e-12 1e-12"/></body>"""
    elif isinstance(equations, SimplePendulum):
        bodies = f"""<body><joint axis="0 0 1"/>
            <inertial pos="0 {-equations.length!r} 0" mass="{equations.mass!r}"
              diaginertia="1e-12 1e-12 1e-12"/></body>"""
    else:
        link = '<joint axis="0 0 1"/><inertial pos="{1!r} 0 0" mass="{0!r}" diaginertia="{2!r} {2!r} {2!r}"/>'
        inner = link.format(equations.m1, equations.r1, equations.i1)
        outer = link.format(equations.m2, equations.r2, equations.i2)
        bodies = f'<body>{inner}<body pos="{equations.l1!r} 0 0">{outer}</body></body>'
    return f"""<mujoco><compiler angle="radian" autolimits="false"/>
        <option gravity="0 {-equations.g!r} 0" timestep="{step!r}" integrator="{integrator}"><flag {flags}/></option>
        <worldbody>{bodies}</worldbody></mujoco>"""


def _run(mujoco: Any, problem: Problem, model: Any, data: Any, count: int) -> Outcome:
    mujoco.mj_resetData(model, data)
    data.qpos[:], data.qvel[:] = problem.start[: problem.count], problem.start[problem.count :]
    position = np.empty((len(problem.times), problem.count))
    step, now = mujoco.mj_step, data.qpos
    begun = time.perf_counter()
    position[0] = now
    for k in range(1, len(position)):
        step(model, data, count)
        position[k] = now
    seconds = time.perf_counter() - begun
    return Outcome(seconds, position, steps=count * (len(position) - 1))
