"""MuJoCo, from MJCF text with the numbers of the scene; everything that the scene does not need is disabled.

Loops are closed by equality constraints of two sites, rolling is contact with friction. Both are springs of MuJoCo's
own, whose rate (`solref`) and impedance (`solimp`) are varied along with the step.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from bellcrank_bench.peers.peer import Outcome, Peer, Run, substeps
from bellcrank_bench.problems.checks import Array
from bellcrank_bench.problems.problem import Benchmark
from bellcrank_bench.textbook.bricard import BricardRing
from bellcrank_bench.textbook.four_bar import ReducedFourBar
from bellcrank_bench.textbook.pendulum import SimplePendulum
from bellcrank_bench.textbook.planar_2r import PlanarTwoLink
from bellcrank_bench.textbook.rolling_disk import ReducedRollingDisk
from bellcrank_bench.textbook.spring_pendulum import SpringPendulum

NAME = "MuJoCo"
DISABLED = ("sensor", "actuation", "autoreset", "midphase", "nativeccd", "island", "eulerdamp")
CONSTRAINT_GRID = ("integrator", "step", "rate", "impedance", "shape")
NOTE = "mj_step(model, data, nstep) from output to output: C loop, GIL-free"


@dataclass(frozen=True, eq=False, kw_only=True)
class Stepping:
    """A model of a benchmark with an integrator and a step, of which `count` go from one output time to the next."""

    mujoco: Any
    benchmark: Benchmark
    method: str
    setting: str
    note: str
    model: Any
    count: int

    @property
    def run(self) -> Run:
        """One run with all its outputs."""
        once = partial(_run, self.mujoco, self.benchmark, self.model, self.mujoco.MjData(self.model), self.count)
        return Run(tool=NAME, method=self.method, setting=self.setting, note=self.note, once=once)

    def rollout(self, runs: int, threads: int) -> tuple[Callable[[], Any], Callable[[], Array]]:
        """A call of mujoco.rollout that computes so many runs; and where the last run ends, (compared_count,)."""
        module: Any = importlib.import_module("mujoco.rollout")
        kind = self.mujoco.mjtState.mjSTATE_FULLPHYSICS
        memories = [self.mujoco.MjData(self.model) for _ in range(threads)]
        memories[0].qpos[:], memories[0].qvel[:] = _start(self.benchmark)
        start = np.empty(self.mujoco.mj_stateSize(self.model, kind))
        self.mujoco.mj_getState(self.model, memories[0], start, kind)
        steps = self.count * (len(self.benchmark.times) - 1)
        states = np.empty((runs, steps, len(start)))
        starts, pool = np.tile(start, (runs, 1)), module.Rollout(nthread=threads if threads > 1 else 0)

        def once() -> Any:
            return pool.rollout(self.model, memories, starts, nstep=steps, state=states)

        return once, lambda: states[-1, -1, 1 : 1 + self.benchmark.compared_count]


def runs(benchmark: Benchmark, settings: Mapping[str, Any]) -> Iterator[Run]:
    """Every integrator at every time step; with constraints also every rate, impedance and shape of the rim."""
    return (stepping.run for stepping in steppings(benchmark, settings))


def steppings(benchmark: Benchmark, settings: Mapping[str, Any]) -> Iterator[Stepping]:
    """The models of `runs`. Raises ImportError if MuJoCo is not installed."""
    mujoco: Any = importlib.import_module("mujoco")
    return (_constrained_steppings if benchmark.constrained else _tree_steppings)(mujoco, benchmark, settings)


def _tree_steppings(mujoco: Any, benchmark: Benchmark, settings: Mapping[str, Any]) -> Iterator[Stepping]:
    for integrator, steps in settings.items():
        for step in steps:
            count, h = substeps(benchmark, step)
            yield Stepping(
                mujoco=mujoco,
                benchmark=benchmark,
                method=integrator,
                setting=f"h {h:.3g}",
                note=f"{NOTE} (rollout takes as long)",
                model=mujoco.MjModel.from_xml_string(_tree(benchmark.equations, integrator, h)),
                count=count,
            )


def _constrained_steppings(mujoco: Any, benchmark: Benchmark, settings: Mapping[str, Any]) -> Iterator[Stepping]:
    mujoco.set_mju_user_warning(lambda _: None)  # a run that diverges is a row that failed, not lines on the screen
    for integrator, step, rate_step, impedance, shape in product(*(settings[key] for key in CONSTRAINT_GRID)):
        count, h = substeps(benchmark, step)
        rate = rate_step / h
        # critically damped at `rate` (1/s), in MuJoCo's direct format (-stiffness, -damping)
        solid = f'solref="{-rate * rate!r} {-2.0 * rate!r}" solimp="{impedance!r} {impedance!r} 0.001 0.5 2"'
        yield Stepping(
            mujoco=mujoco,
            benchmark=benchmark,
            method=integrator,
            setting=f"h {h:.3g}, {rate:.3g}/s, {impedance:g}, {shape}",
            note=f"{NOTE}; Newton's solver, warm starts",
            model=mujoco.MjModel.from_xml_string(_constrained(benchmark.equations, integrator, h, solid, shape)),
            count=count,
        )


def _tree(equations: Any, integrator: str, step: float) -> str:
    flags = " ".join(f'{name}="disable"' for name in ("constraint", "contact", "warmstart", *DISABLED))
    if isinstance(equations, SpringPendulum):
        spring = f'stiffness="{equations.stiffness!r}" springref="{equations.free_length!r}"'
        # MuJoCo demands an inertia: 1e-12 kg m² beside m r² = 50 kg m²
        bodies = f"""<body><joint axis="0 0 1"/>
            <joint type="slide" axis="0 -1 0" {spring}/>
            <inertial pos="0 0 0" mass="{equations.mass!r}" diaginertia="1e-12 1e-12 1e-12"/></body>"""
    elif isinstance(equations, SimplePendulum):
        bodies = f"""<body><joint axis="0 0 1"/>
            <inertial pos="0 {-equations.length!r} 0" mass="{equations.mass!r}"
              diaginertia="1e-12 1e-12 1e-12"/></body>"""
    else:
        assert isinstance(equations, PlanarTwoLink)
        link = '<joint axis="0 0 1"/><inertial pos="{1!r} 0 0" mass="{0!r}" diaginertia="{2!r} {2!r} {2!r}"/>'
        inner = link.format(equations.m1, equations.r1, equations.i1)
        outer = link.format(equations.m2, equations.r2, equations.i2)
        bodies = f'<body>{inner}<body pos="{equations.l1!r} 0 0">{outer}</body></body>'
    return f"""<mujoco><compiler angle="radian" autolimits="false"/>
        <option gravity="0 {-equations.g!r} 0" timestep="{step!r}" integrator="{integrator}"><flag {flags}/></option>
        <worldbody>{bodies}</worldbody></mujoco>"""


def _constrained(equations: Any, integrator: str, step: float, solid: str, shape: str) -> str:
    disabled, equality = [*DISABLED, "refsafe"], ""
    if isinstance(equations, ReducedFourBar):
        disabled, gravity = [*disabled, "contact"], "0 0 0"
        bodies = _four_bar(equations)
        equality = f'<equality><connect site1="a" site2="b" {solid}/></equality>'
    elif isinstance(equations, BricardRing):
        disabled, gravity = [*disabled, "contact"], f"0 {-equations.g!r} 0"
        bodies = _ring(equations)
        pairs = "".join(f'<connect site1="a{k}" site2="b{k}" {solid}/>' for k in range(2))
        equality = f"<equality>{pairs}</equality>"
    else:
        assert isinstance(equations, ReducedRollingDisk)
        gravity, bodies = f"0 0 {-equations.g!r}", _disk(equations, solid, shape)
    flags = " ".join(f'{name}="disable"' for name in disabled)
    return f"""<mujoco><compiler angle="radian" autolimits="false"/>
        <option gravity="{gravity}" timestep="{step!r}" integrator="{integrator}" cone="elliptic" impratio="100"
          tolerance="1e-15"><flag {flags}/></option>
        <worldbody>{bodies}</worldbody>{equality}</mujoco>"""


def _four_bar(equations: ReducedFourBar) -> str:
    link = '<joint axis="0 0 1" {3}/><inertial pos="{1!r} 0 0" mass="{0!r}" diaginertia="{2!r} {2!r} {2!r}"/>'
    spring = f'stiffness="{equations.stiffness!r}" springref="{equations.preload / equations.stiffness!r}"'
    crank, coupler, rocker = (
        link.format(*values, spring if k == 0 else "")
        for k, values in enumerate(zip(equations.mass, equations.center, equations.inertia, strict=True))
    )
    l1, l2, l3 = equations.length
    return f"""<body>{crank}<body pos="{l1!r} 0 0">{coupler}<site name="a" pos="{l2!r} 0 0"/></body></body>
        <body pos="{equations.ground!r} 0 0">{rocker}<site name="b" pos="{l3!r} 0 0"/></body>"""


def _ring(equations: BricardRing) -> str:
    """Five nested bodies; the sixth hinge is closed at two points, P5 and 1 m along its axis."""
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


def _disk(equations: ReducedRollingDisk, solid: str, shape: str) -> str:
    r = equations.radius
    size = {"cylinder": f"{r!r} 1e-5", "ellipsoid": f"{r!r} {r!r} 1e-3"}[shape]
    across, axial, rough = 0.125 * r * r, 0.25 * r * r, f'friction="3 0 0" {solid}'
    return f"""<geom type="plane" size="0 0 1" {rough}/>
        <body><freejoint/><geom type="{shape}" size="{size}" euler="1.5707963267948966 0 0" {rough}/>
        <inertial pos="0 0 0" mass="0.5" diaginertia="{across!r} {axial!r} {across!r}"/></body>"""


def _start(benchmark: Benchmark) -> tuple[Array, Array]:
    """Position and velocity in MuJoCo's coordinates."""
    equations, start = benchmark.equations, np.array(benchmark.start)
    if isinstance(equations, BricardRing):
        return np.zeros(5), np.zeros(5)
    if isinstance(equations, ReducedRollingDisk):
        return equations.free_body(start)
    state = benchmark.unreduced(start)
    return state[: benchmark.count], state[benchmark.count :]


def _run(mujoco: Any, benchmark: Benchmark, model: Any, data: Any, count: int) -> Outcome:
    mujoco.mj_resetData(model, data)
    data.qpos[:], data.qvel[:] = _start(benchmark)
    ring = benchmark.equations if isinstance(benchmark.equations, BricardRing) else None
    width = 5 if ring else benchmark.compared_count
    position = np.empty((len(benchmark.times), width))
    step, now = mujoco.mj_step, data.qpos[:width]
    begun = time.perf_counter()
    position[0] = now
    for k in range(1, len(position)):
        step(model, data, count)
        position[k] = now
    seconds = time.perf_counter() - begun
    compared = ring.corner_of(position) if ring else position
    return Outcome(seconds=seconds, position=compared, steps=count * (len(position) - 1))


PEER = Peer(NAME, "mujoco", runs)
