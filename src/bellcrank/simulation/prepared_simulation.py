"""`prepare`: a scene that is simulated again and again with other parameters or another start."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.dynamics.constraints.constraint_derivatives import aligned_constraints
from bellcrank.dynamics.equations.design_parameters import design_parameters
from bellcrank.dynamics.equations.system import start_states
from bellcrank.dynamics.postures.consistent_start import consistent_postures, consistent_velocities
from bellcrank.elements.parameters import parameter_bounds
from bellcrank.errors import InputError
from bellcrank.files.access import Trust
from bellcrank.messages import unknown_name
from bellcrank.robot.model.pinocchio_model import LEAST_MASS
from bellcrank.scene.events import ContactLost, LiesFlat
from bellcrank.scene.load import given_scene
from bellcrank.scene.scene import Scene
from bellcrank.simulation.integration.statistics import Status
from bellcrank.simulation.simulate import prepare_integration, simulate

if TYPE_CHECKING:
    from bellcrank.elements.element import Bound
    from bellcrank.elements.parameters import Parameter
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.settings import Stabilisation
    from bellcrank.simulation.integration.integration import Integration
    from bellcrank.simulation.trajectory.trajectory import Trajectory

INERTIAS = range(10, 16)  # the tracer's numbers of a link's moments of inertia, which are checked together
START = "initial."


@dataclass(frozen=True, eq=False, kw_only=True)
class PreparedRun:
    """A run of a prepared simulation: its rows and how it ended.

    Attributes:
        simulation: The prepared simulation.
        values: The values that it was called with.
        status: Why the run ended.
        time: Times (n,) s of the rows; where the run ended early, the last is its end.
        state: States (n, nx): q, v and maybe the work W.
        events: (name, time in s) of each event, in the order of time.
    """

    simulation: PreparedSimulation
    values: Mapping[str, float]
    status: Status
    time: Array
    state: Array
    events: tuple[tuple[str, float], ...]

    def __repr__(self) -> str:
        return f"PreparedRun({self.status} at {self.time[-1]:g} s, {len(self.time)} rows)"

    @property
    def position(self) -> Array:
        """Positions (n, nq), rad and m."""
        return self.state[:, : self.simulation.scene.robot.nq]

    @property
    def velocity(self) -> Array:
        """Velocities (n, nv), rad/s and m/s."""
        robot = self.simulation.scene.robot
        return self.state[:, robot.nq : robot.nq + robot.nv]

    def trajectory(self) -> Trajectory:
        """Simulate the same scene with `simulate`, for everything that follows from the states.

        Returns:
            The run as a Trajectory, with the same rows.

        Raises:
            InputError: As `simulate`.

        Example:
            >>> import bellcrank as bc
            >>> run = bc.prepare("four_bar", samples=11)({"crank_length": 1.23})
            >>> bool(run.trajectory().constraint_residual() < 1e-12)
            True
        """
        return self.simulation.trajectory(self.values)


class PreparedSimulation:
    """A scene that is ready to run; made by `prepare`, and called with the numbers that change.

    Attributes:
        scene: The scene.
    """

    def __init__(self, scene: Scene, given: Mapping[str, Any]) -> None:
        arguments.instance("scene", scene, Scene, "a scene", remedy="use bc.prepare for one that is ready to run")
        given = arguments.mapping("given", given, "a mapping of settings")
        self.scene, self._given = scene, given
        self._integration: Integration = prepare_integration(scene, given)
        self._places = {name: k for k, name in enumerate(scene.parameters)}
        initial, robot = scene.initial, scene.robot
        motion = None if initial.motion is None else scene.motion(initial.motion)
        self._position = initial.posture(robot, motion)[None]
        self._motion, self._held = motion, initial.held(robot)

    def __call__(self, values: Mapping[str, float] | None = None) -> PreparedRun:
        """Simulate with other values, which takes little longer than stepping.

        Args:
            values: Numbers in SI units by name: parameters of the scene, and "initial.JOINT" for positions of joints
                that the scene gives.

        Returns:
            The run. Calls do not depend on each other.

        Raises:
            InputError: There is no such name, or the scene cannot start with these values.

        Example:
            >>> import bellcrank as bc
            >>> simulate = bc.prepare("four_bar", samples=2)
            >>> for length in (1.22, 1.24):
            ...     print(f"{simulate({'crank_length': length}).events[-1][1]:.3f}")
            18.559
            12.109
        """
        changes = {} if values is None else self._checked(values)
        start = self._start(changes) if self._quick else None
        if start is None:
            return self._slow(changes)
        p, x0 = start
        found = self._integration.stepper.run(x0=x0, parameters=p)
        status = _STATUSES[found.status]
        if status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        if not found.finite or (status is Status.NON_FINITE and found.accepted == 0):
            return self._slow(changes)  # which says why
        names = self._event_names
        events = tuple(
            (names[k], t) for k, t in zip(found.event_index.tolist(), found.event_time.tolist(), strict=True)
        )
        return PreparedRun(
            simulation=self, values=changes, status=status, time=found.time, state=found.state, events=events
        )

    def trajectory(self, values: Mapping[str, float] | None = None) -> Trajectory:
        """Simulate with other values as `simulate` does.

        Args:
            values: As for a call.

        Returns:
            The run with everything that follows from it.

        Raises:
            InputError: As `simulate`.

        Example:
            >>> import bellcrank as bc
            >>> bc.prepare("four_bar").trajectory({"crank_length": 1.22}).events[-1].name
            'lock'
        """
        return simulate(self.scene, overrides=({} if values is None else self._checked(values)) or None, **self._given)

    @cached_property
    def _quick(self) -> bool:
        """Whether nothing of a run has to be looked at in Python."""
        scene, integration = self.scene, self._integration
        guarded = any(isinstance(event.when, (ContactLost, LiesFlat)) for event in scene.events)
        whole = integration.duration == integration.settings.duration
        return whole and not guarded and not aligned_constraints(scene)

    @cached_property
    def _event_names(self) -> list[str]:
        return [event.name for event in self.scene.events]

    @cached_property
    def _bounds(self) -> dict[str, list[Bound]]:
        scene = self.scene
        parts = (*scene.forces, *scene.control, *scene.constraints)
        return {name: parameter_bounds(p, scene.robot, parts) for name, p in scene.parameters.items()}

    def _checked(self, values: Mapping[str, float]) -> dict[str, float]:
        listed = arguments.mapping("values", values, "a mapping such as {'crank_length': 1.22}")
        for name, value in listed.items():
            joint = name.removeprefix(START) if isinstance(name, str) else ""
            if name not in self._places and not (name.startswith(START) and joint in self.scene.initial.position):
                known = [*self._places, *[START + joint for joint in self.scene.initial.position]]
                raise InputError(
                    f"{self.scene.source}: argument 'values': {unknown_name('parameter or start', str(name), known)}"
                )
            if type(value) is not float or not math.isfinite(value):
                listed[name] = arguments.number(name, value)
        return listed

    def _start(self, changes: Mapping[str, float]) -> tuple[Array, Array] | None:
        """p and x at the start; None where the scene has to be read anew with the changes, or cannot start."""
        scene, robot = self.scene, self.scene.robot
        own, q = scene.own_parameters[None], self._position
        if changes:
            own, q = own.copy(), q.copy()
        for name, value in changes.items():
            if name in self._places:
                if not self._admits(scene.parameters[name], value):
                    return None
                own[0, self._places[name]] = value
            else:
                q[0, robot.joint(name.removeprefix(START)).q] = value
        found = design_parameters(scene, own)
        if not found.alike[0]:
            return None
        if scene.constraints:
            q, verdicts = consistent_postures(scene, found.constrained, q, self._held[0])
            if verdicts.code[0]:
                return None
        v = scene.initial.rates(robot, q, self._motion)
        if scene.constraints:
            v, verdicts = consistent_velocities(scene, found.constrained, q, v, self._held[1])
            if verdicts.code[0]:
                return None
        p = found.constrained.parameters
        return p[0], start_states(scene, q, v, p)[0]

    def _admits(self, parameter: Parameter, value: float) -> bool:
        if any(place[1] in INERTIAS for place in parameter.places):
            return False
        light = parameter.unit == "kg" and 0.0 < value < LEAST_MASS
        return not light and all(bound.admits(value) for bound in self._bounds[parameter.name])

    def _slow(self, changes: dict[str, float]) -> PreparedRun:
        run = self.trajectory(changes)
        events = tuple((event.name, event.time) for event in run.events)
        return PreparedRun(
            simulation=self, values=changes, status=run.status, time=run.time, state=run.state, events=events
        )


_STATUSES = tuple(Status)


@arguments.named
def prepare(
    scene: Scene | Robot | str | Path,
    duration: float | None = None,
    solver: str | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    step: float | None = None,
    *,
    samples: int | None = None,
    first_step: float | None = None,
    max_step: float | None = None,
    max_evaluations: int | None = None,
    stabilisation: Stabilisation | Mapping[str, Any] | str | None = None,
    overrides: Mapping[str, Any] | None = None,
    trust: Trust = (),
) -> PreparedSimulation:
    """Prepare a scene for many single runs, such as those of an optimiser.

    Equations are compiled, settings checked and arrays allocated once; a call with other parameters or another start
    then takes little longer than stepping. For many runs that are known beforehand `sweep` is faster.

    Args:
        scene: A scene or robot, or the path or name of its file.
        duration: s.
        solver: As for `simulate`, like the other settings.
        rtol: Relative tolerance.
        atol: Absolute tolerance.
        step: Fixed step size, s.
        samples: The number of equally spaced times at which rows are wanted.
        first_step: First step size, s.
        max_step: Largest step size, s.
        max_evaluations: A run ends after so many evaluations of the equations.
        stabilisation: How constraints are kept. Automatic gains are chosen once, for the scene as it is.
        overrides: Changes of the scene by dotted path.
        trust: Where `scene` is a file, folders whose files it may name, besides those near it.

    Returns:
        A simulation to call.

    Raises:
        InputError: An argument is wrong, or the scene cannot start.

    Example:
        >>> import bellcrank as bc
        >>> simulate = bc.prepare("four_bar", samples=2)
        >>> simulate({"crank_length": 1.22})
        PreparedRun(event at 18.5589 s, 2 rows)
    """
    scene = given_scene(scene, overrides, trust)
    given = {
        "duration": duration, "solver": solver, "rtol": rtol, "atol": atol, "step": step, "samples": samples,
        "first_step": first_step, "max_step": max_step, "max_evaluations": max_evaluations,
        "stabilisation": stabilisation,
    }  # fmt: skip
    return PreparedSimulation(scene, given)
