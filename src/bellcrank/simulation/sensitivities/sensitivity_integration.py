"""Forward sensitivities along a run: the derivatives of its states by parameters and by values of its start.

The sensitivities S = ∂(q, v)/∂p of a run satisfy S' = f_x S + f_p from the derivative of the consistent start on. They
are integrated after the run, over the same steps where it was made by DOP853, and projected where the run is projected
(src/cpp/integrator/sensitivity_pass.hpp).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bellcrank._step import propagate_sensitivities
from bellcrank.arrays import Array
from bellcrank.codegen import llvm as machine
from bellcrank.codegen.compile import make_ready
from bellcrank.codegen.machine_code import raise_failure
from bellcrank.dynamics.equations.directional_equations import DirectionalEquations
from bellcrank.dynamics.postures.start_sensitivities import StartSensitivities, StartVariable, start_sensitivities
from bellcrank.elements.element import joint_unit
from bellcrank.errors import InputError
from bellcrank.memory import check_memory
from bellcrank.messages import unknown_name
from bellcrank.simulation.integration.statistics import Status
from bellcrank.simulation.sensitivities.sensitivities import ComputedSensitivities
from bellcrank.terminal import interruption

if TYPE_CHECKING:
    from bellcrank.codegen.directional import Directional
    from bellcrank.scene.scene import Scene
    from bellcrank.simulation.integration.integration import Integration
    from bellcrank.simulation.trajectory.trajectory import Trajectory


# ---- What the integrator of sensitivities is given, as typed records (src/cpp/integrator/sensitivities.cpp).


@dataclass(frozen=True)
class DirectionalKernels:
    """Addresses of the functions of a directional derivative, and the size of the tape between them."""

    point: int
    along: int
    tape: int

    @classmethod
    def of(cls, derivative: Directional, *, later: bool = False) -> DirectionalKernels:
        """The compiled functions; `later`: compiled when first called."""
        point, along = derivative.point.code("scalar"), derivative.along.code("directions")
        tape = derivative.point.output_sizes[-1]
        if later:
            return cls(point.lazy_address, along.lazy_address, tape)
        return cls(point.address, along.address, tape)


@dataclass(frozen=True, eq=False, kw_only=True)
class SensitivityProblem:
    """S' = f_x S + f_p along a run.

    Attributes:
        rate: The directional derivative of x' = f(t, x, u, p).
        fallback: The one that holds where the guard of `rate` is not positive; None without constraints.
        project: The projection of S onto the constraints' derivatives; None where the run does not project.
        project_fallback: The one that holds where its guard is not positive.
        lanes: SIMD lanes.
        seeds: S (directions, nq + nv) at the start.
        changes: dp (directions, parameters).
        tolerance: Of S, relative to the largest position or velocity of a direction so far.
        floors: Errors (directions,) that are too small to count.
        first_step: s.
        given_steps: Whether the pass tries the steps of the run.
        steps: Times, s, at which steps end, the start first.
        marks: Times, s, at which S is wanted besides the rows; steps end there.
        times: Times (n,) s of the rows.
        states: The states (n, nx) of the run in the rows.
    """

    rate: DirectionalKernels
    fallback: DirectionalKernels | None
    project: DirectionalKernels | None
    project_fallback: DirectionalKernels | None
    lanes: int
    seeds: Array
    changes: Array
    tolerance: float
    floors: Array
    first_step: float
    given_steps: bool
    steps: Array
    marks: Array
    times: Array
    states: Array


START, START_VELOCITY = "initial.", "initial.velocity."
MOST_STEPS = 100_000  # of more steps a run keeps only some ends, which are not its steps
LEAST_TOLERANCE = 1e-13  # of states: below this, rounding is larger
LOOSER = 100.0  # tolerance of sensitivities, in tolerances of the run, whose steps mostly suffice for it
_STATUSES = tuple(Status)


def variables_of(scene: Scene, names: Sequence[str]) -> tuple[StartVariable, ...]:
    """What these names stand for: parameters of the scene, "initial.JOINT" and "initial.velocity.JOINT".

    Raises InputError for an unknown name, or one that occurs twice, and for a scene whose forces switch.
    """
    if scene.drives:
        raise InputError(
            f"{scene.source}: sensitivities: the states of drives ({scene.drives[0].name}) are not differentiated; "
            "compare runs with values that differ a little"
        )
    if scene.works:
        raise InputError(
            f"{scene.source}: sensitivities: outputs.{scene.works[0].name}: work is not differentiated; remove it"
        )
    if held := scene.held_sources:
        raise InputError(
            f"{scene.source}: sensitivities: forces that switch and sampled controllers have no derivatives here "
            f"({', '.join(source.name for source in held)}); compare runs with values that differ a little"
        )
    robot, places = scene.robot, {name: k for k, name in enumerate(scene.parameters)}
    joints = {joint.name: joint for joint in robot.joints if joint.nv == 1}
    found = []
    for name in names:
        if name in places:
            parameter = scene.parameters[name]
            found.append(StartVariable(name, parameter.unit, parameter.value, places[name]))
            continue
        velocity = name.startswith(START_VELOCITY)
        joint = joints.get(name.removeprefix(START_VELOCITY if velocity else START))
        if joint is None or not name.startswith(START):
            known = [*places, *(START + j for j in joints), *(START_VELOCITY + j for j in joints)]
            raise InputError(f"{scene.source}: sensitivities: {unknown_name('parameter or start', name, known)}")
        given = scene.initial.velocity if velocity else scene.initial.position
        if scene.constraints and joint.name not in given:
            raise InputError(
                f"{scene.source}: sensitivities: '{name}' has no value in the scene, where it follows from the "
                f"constraints; write it under 'initial{'.velocity' if velocity else ''}'"
            )
        unit = joint_unit(joint, "velocity" if velocity else "position")
        found.append(StartVariable(name, unit, given.get(joint.name, 0.0), None, joint.name, velocity))
    twice = next((name for k, name in enumerate(names) if name in names[:k]), None)
    if twice is not None:
        raise InputError(f"{scene.source}: sensitivities: '{twice}' is there twice; name it once")
    return tuple(found)


def propagated(integration: Integration, run: Trajectory, variables: Sequence[StartVariable]) -> ComputedSensitivities:
    """The sensitivities of a run that an integration has made.

    Raises InputError where the start has no derivative, or the sensitivities cannot be computed up to the run's end.
    """
    scene, problem = integration.scene, integration.problem
    places = tuple(dict.fromkeys(v.place for v in variables if v.place is not None))
    changes = np.zeros((len(variables), len(places)))
    for k, variable in enumerate(variables):
        if variable.place is not None:
            changes[k, places.index(variable.place)] = 1.0
    equations = _equations(scene, places)
    start = _start(scene, tuple(variables), equations, changes)
    events = np.array(sorted({event.time for event in run.events}))
    width = scene.robot.nq + scene.robot.nv
    check_memory(len(run) * len(variables), 8.0 * width, "rows of sensitivities")
    given = (
        run.settings.solver in ("DOP853", "auto")
        and not run.statistics.implicit_steps
        and not run.settings.step
        and len(run.steps) <= MOST_STEPS
    )
    steps = run.steps[run.steps <= max(run.time[-1], run.steps[0])]
    if len(steps) < 2 or steps[-1] < run.time[-1]:
        steps = np.append(steps, run.time[-1])
    first = float(steps[1] - steps[0]) if len(steps) > 1 else 0.0
    if not first > 0.0:
        raise InputError(f"{scene.source}: sensitivities: the run ended at its start")
    constrained, projected = bool(scene.constraints), bool(problem.kernels.project)
    wanted = [equations.rate, *([equations.project] if projected else [])]
    make_ready([pair for d in wanted for pair in ((d.point, "scalar"), (d.along, "directions"))])
    least = max(run.settings.rtol + run.settings.atol, LEAST_TOLERANCE)
    found = propagate_sensitivities(
        problem,
        SensitivityProblem(
            rate=DirectionalKernels.of(equations.rate),
            fallback=DirectionalKernels.of(equations.fallback, later=True) if constrained else None,
            project=DirectionalKernels.of(equations.project) if projected else None,
            project_fallback=DirectionalKernels.of(equations.project_fallback, later=True) if projected else None,
            lanes=machine.target().lanes,
            seeds=start.values,
            changes=changes,
            tolerance=LOOSER * least,
            floors=np.array([LOOSER * least / (abs(v.value) or 1.0) for v in variables]),
            first_step=first,
            given_steps=given,
            steps=steps if given else steps[[0, -1]],
            marks=events,
            times=run.time,
            states=np.ascontiguousarray(run.state),
        ),
    )
    raise_failure()
    status = _STATUSES[found.status]
    if status is Status.INTERRUPTED:
        interruption.cut_short()
    if status is not Status.FINISHED or not np.isfinite(found.rows).all():
        raise InputError(
            f"{scene.source}: sensitivities: they cannot be integrated up to {run.time[-1]:.6g} s ({status}): the "
            "equations are stiff or the motion is not differentiable there; simulate a shorter time, or allow more "
            "with max_evaluations"
        )
    return ComputedSensitivities(
        variables=tuple(variables),
        equations=equations,
        changes=changes,
        rows=found.rows,
        event_times=events,
        event_rows=found.marked,
        by_differences=start.by_differences,
        steps=found.steps,
        kernel_time=found.seconds,
        evaluations=found.evaluations,
    )


def _start(
    scene: Scene, variables: tuple[StartVariable, ...], equations: DirectionalEquations, changes: Array
) -> StartSensitivities:
    """The derivatives of a scene's start, which are kept for the next run."""
    kept: dict[tuple[StartVariable, ...], StartSensitivities] = vars(scene).setdefault("sensitivities.start", {})
    if variables not in kept:
        kept[variables] = start_sensitivities(scene, variables, equations, changes)
    return kept[variables]


def _equations(scene: Scene, places: tuple[int, ...]) -> DirectionalEquations:
    kept: dict[tuple[int, ...], DirectionalEquations] = vars(scene).setdefault("sensitivities.equations", {})
    if places not in kept:
        kept[places] = DirectionalEquations(scene, places)
    return kept[places]
