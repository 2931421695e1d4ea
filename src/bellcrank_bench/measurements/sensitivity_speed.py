"""What the derivatives of a run by 20 parameters cost, in runs: the kernels' time, and the CPU time of whole calls."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass

from bellcrank.codegen import llvm as machine
from bellcrank.errors import InputError
from bellcrank.robot.model.traced_tree import INERTIA
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.simulation.simulate import simulate

SCENES = ("four_bar", "planar_2r_swing", "ur5_falling", "panda_falling")
COUNT = 20
SETTLING = 20.0  # s, until optimised code of long functions is in use
CALLS = 5  # of a measurement of CPU time
LENGTHS = {
    "four_bar": (
        "joint.coupler.origin.x",
        "joint.rocker.origin.x",
        "joint.coupler.origin.y",
        "joint.rocker.origin.y",
        "frame.coupler_tip.origin.x",
        "frame.rocker_tip.origin.x",
        "frame.coupler_tip.origin.y",
        "frame.rocker_tip.origin.y",
    ),
    "planar_2r_swing": ("joint.elbow.origin.x", "joint.elbow.origin.y"),
}


@dataclass(frozen=True, kw_only=True)
class SensitivityRow:
    """The cost of a gradient along a run.

    Attributes:
        scene: The scene.
        target: The instruction set.
        variables: How many derivatives: parameters first, then values of the start.
        run: Least kernel time of a run, s.
        gradient: Least kernel time of a run and its sensitivities, s.
        run_steps: Steps of the run.
        gradient_steps: Steps of the sensitivities.
        call_ratio: CPU time of `simulate` with sensitivities over that without, for two rows.
    """

    scene: str
    target: str
    variables: int
    run: float
    gradient: float
    run_steps: int
    gradient_steps: int
    call_ratio: float

    @property
    def ratio(self) -> float:
        """The gradient's kernel time in runs."""
        return self.gradient / self.run


def sensitivity_rows(names: Sequence[str], repeats: int) -> Iterator[SensitivityRow]:
    """Measure scenes with AVX-512, where the processor has it, and with AVX2."""
    for name in names:
        scene, variables = with_parameters(load_scene(name), COUNT)
        for target in ("avx512", "avx2"):
            with _target(target) as known:
                if known:
                    yield _row(scene, name, target, variables, repeats)


def with_parameters(scene: Scene, count: int) -> tuple[Scene, list[str]]:
    """The scene with parameters that set lengths, masses, centres of mass and inertias, and names of variables.

    Where there are fewer than `count` of them, positions and velocities of the start follow.
    """
    frames = {frame.name: frame for frame in scene.robot.equations.tree.frames if not frame.is_body}
    values = {}
    for target in LENGTHS.get(scene.source.stem, ()):
        _, joint, _, axis = target.split(".")
        values[target] = frames[joint].in_parent.translation["xyz".index(axis)]
    planar = bool(values)
    for link in scene.robot.equations.tree.frames:
        if link.is_body and link.mass > 0.0:
            values[f"link.{link.name}.mass"] = link.mass
            values |= {f"link.{link.name}.cg.{c}": link.lever["xyz".index(c)] for c in ("xy" if planar else "xyz")}
            if planar:
                values[f"link.{link.name}.inertia.zz"] = link.inertia[INERTIA.index("zz")]
    chosen = dict(list(values.items())[:count])
    parameters = {f"p{k}": {"value": float(v), "sets": [t]} for k, (t, v) in enumerate(chosen.items())}
    joints = [joint.name for joint in scene.robot.joints if joint.nv == 1]
    starts = [f"initial.{name}" for name in joints] + [f"initial.velocity.{name}" for name in joints]
    return scene.with_overrides({"parameters": parameters}), [*parameters, *starts][:count]


def _row(scene: Scene, name: str, target: str, variables: list[str], repeats: int) -> SensitivityRow:
    for _ in range(2):
        simulate(scene, samples=2, sensitivities=variables)
    time.sleep(SETTLING)
    alone, both, steps = [], [], (0, 0)
    for _ in range(repeats):
        alone.append(simulate(scene, samples=2).statistics.kernel_time)
        run = simulate(scene, samples=2, sensitivities=variables)
        found = run.computed_sensitivities
        both.append(run.statistics.kernel_time + found.kernel_time)
        steps = len(run.steps) - 1, found.steps
    cpu = [_cpu(scene, wanted) for wanted in ([], variables)]
    return SensitivityRow(
        scene=name,
        target=target,
        variables=len(variables),
        run=min(alone),
        gradient=min(both),
        run_steps=steps[0],
        gradient_steps=steps[1],
        call_ratio=cpu[1] / cpu[0],
    )


def _cpu(scene: Scene, variables: list[str]) -> float:
    begun = time.process_time()
    for _ in range(CALLS):
        simulate(scene, samples=2, sensitivities=variables)
    return time.process_time() - begun


@contextmanager
def _target(name: str) -> Iterator[bool]:
    """Generate code for a target meanwhile; False where the processor cannot run it."""
    before = os.environ.get("BELLCRANK_TARGET")
    os.environ["BELLCRANK_TARGET"] = name
    try:
        try:
            machine.target()
            known = True
        except InputError:
            known = False
        yield known
    finally:
        if before is None:
            del os.environ["BELLCRANK_TARGET"]
        else:
            os.environ["BELLCRANK_TARGET"] = before


def table(rows: Sequence[SensitivityRow]) -> list[str]:
    """The rows as lines of text."""
    head = f"{'scene':18} {'code':7} {'by':>3} {'run':>10} {'gradient':>10} {'ratio':>6} {'steps':>11} {'calls':>6}"
    lines = [head]
    for row in rows:
        steps = f"{row.gradient_steps}/{row.run_steps}"
        times = f"{1e6 * row.run:8.1f}us {1e6 * row.gradient:8.1f}us {row.ratio:6.2f}"
        lines.append(f"{row.scene:18} {row.target:7} {row.variables:3} {times} {steps:>11} {row.call_ratio:6.2f}")
    return lines


def as_json(rows: Sequence[SensitivityRow]) -> list[dict[str, object]]:
    """The rows for a file."""
    return [{**asdict(row), "ratio": row.ratio} for row in rows]
