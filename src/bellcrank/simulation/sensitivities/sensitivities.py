"""The sensitivities of a run: derivatives of everything that follows from its states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array, Mask
from bellcrank.cached_values import cached_property
from bellcrank.elements.signals import Signal, values_at
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.notes import Note, ranked
from bellcrank.present.results import Result
from bellcrank.present.tables import aligned

if TYPE_CHECKING:
    from bellcrank.dynamics.equations.directional_equations import DirectionalEquations
    from bellcrank.dynamics.postures.start_sensitivities import StartVariable
    from bellcrank.simulation.trajectory.events import Event
    from bellcrank.simulation.trajectory.trajectory import Trajectory

GRAZING = 1e-9  # of the changes of an event function: below this rate it touches zero and does not cross it


@dataclass(frozen=True, eq=False, kw_only=True)
class ComputedSensitivities:
    """The sensitivities of a run by several variables.

    Attributes:
        variables: What they are taken with respect to.
        equations: Directional derivatives of the equations.
        changes: dp (variables, parameters of `equations`).
        rows: ∂(q, v) (variables, n, nq + nv) in the rows of the run.
        event_times: Times (e,) s of events.
        event_rows: ∂(q, v) (variables, e, nq + nv) at these times.
        by_differences: For which variables the derivative of the start was computed by differences.
        steps: The steps of the integration.
        kernel_time: The time of the integration, s.
        evaluations: The number of evaluations of the equations with all their directions.
    """

    variables: tuple[StartVariable, ...]
    equations: DirectionalEquations
    changes: Array
    rows: Array
    event_times: Array
    event_rows: Array
    by_differences: Mask
    steps: int
    kernel_time: float
    evaluations: int

    def named(self, run: Trajectory, name: str) -> RunSensitivity:
        """The sensitivity by a variable. Raises InputError where there is none of this name."""
        names = [variable.name for variable in self.variables]
        if arguments.text("name", name, "the name of a parameter or start") not in names:
            raise InputError(f"{run.scene.name}: {unknown_name('sensitivity', name, names)}")
        return RunSensitivity(run, self, names.index(name))


@dataclass(frozen=True, eq=False, kw_only=True)
class EventSensitivity:
    """How an event of a run changes with a variable.

    Attributes:
        name: The event's name.
        time: ∂t/∂p of the event's time: −(g_x S + g_p)/ġ with the event function g; s per unit of p.
        position: Total derivative (nq,) of the position at the event, its time moving: S + q̇ ∂t/∂p.
        velocity: Total derivative (nv,) of the velocity at the event, before an impact.
        latch_velocity: That of the velocity (nv,) after the impact of a latch; None without one.
        impulse: That of the impulse of a latch; 0 without one.
        energy_lost: That of the energy lost in a latch, J per unit of p; 0 without one.

    Example:
        >>> import bellcrank as bc
        >>> run = bc.simulate("four_bar", sensitivities=["crank_length"])
        >>> round(run.sensitivity("crank_length").event("lock").time, 1)
        340.5
    """

    name: str
    time: float
    position: Array
    velocity: Array
    latch_velocity: Array | None = None
    impulse: float = 0.0
    energy_lost: float = 0.0


class RunSensitivity(Result):
    """The derivative of a run by one variable p, at constant time in each row.

    Made by `Trajectory.sensitivity`. All quantities are per unit of p. `to_csv` writes one row a time: the derivatives
    of positions, velocities and outputs.

    Attributes:
        run: The run.
        name: The name of the variable, such as "crank_length" or "initial.crank".
        unit: The unit of the variable.
    """

    def __init__(self, run: Trajectory, of: ComputedSensitivities, index: int) -> None:
        self.run, self._of, self._index = run, of, index
        self.name, self.unit = of.variables[index].name, of.variables[index].unit

    def __repr__(self) -> str:
        return f"RunSensitivity({self.run.scene.name!r} by {self.name} [{self.unit or '1'}], {len(self.time)} rows)"

    def per(self, unit: str) -> str:
        """Write the unit of the derivative of a quantity.

        Args:
            unit: The quantity's unit.

        Returns:
            Such as "rad/s per m".

        Raises:
            InputError: `unit` is no text.

        Example:
            >>> import bellcrank as bc
            >>> run = bc.simulate("four_bar", samples=3, sensitivities=["crank_length"])
            >>> run.sensitivity("crank_length").per("rad")
            'rad per m'
        """
        unit = arguments.text("unit", unit, "a unit", empty=True) or "1"
        return f"{unit} per {self.unit}" if self.unit else unit

    @cached_property
    def notes(self) -> tuple[Note, ...]:
        """What to know about these derivatives, and the notes of the run; none where they are exact but for tolerances.

        Example:
            >>> import bellcrank as bc
            >>> run = bc.simulate("four_bar", samples=3, sensitivities=["crank_length"])
            >>> run.sensitivity("crank_length").notes
            ()
        """
        found = []
        if self._of.by_differences[self._index]:
            found.append(
                "the constraints do not determine the start: its derivative is that of the nearest start, by "
                "extrapolated differences of the search for it; give more values under 'initial' to determine it"
            )
        if switches := self._of.equations.switches:
            found.append(
                f"the equations contain conditions ({', '.join(switches)}): where the motion crosses one at which a "
                "force jumps, the derivative lacks the part of that jump"
            )
        return ranked([*found, *self.run.notes])

    # ---- rows

    @property
    def time(self) -> Array:
        """Times (n,) s of the rows, those of the run."""
        return self.run.time

    @property
    def state(self) -> Array:
        """∂(q, v)/∂p (n, nq + nv)."""
        rows: Array = self._of.rows[self._index]
        return rows

    @property
    def position(self) -> Array:
        """∂q/∂p (n, nq)."""
        return self.state[:, : self.run.robot.nq]

    @property
    def velocity(self) -> Array:
        """∂v/∂p (n, nv)."""
        return self.state[:, self.run.robot.nq :]

    @cached_property
    def _observed(self) -> tuple[Array, ...]:
        """The derivatives of v̇, λ, (T, V), actuator and passive forces, then of the outputs."""
        run = self.run
        point = run.time[:, None], run.state, run.inputs, run.parameters
        found = self._of.equations.observation.rows(*point, self.state, self._of.changes[self._index])
        return tuple(np.asarray(each) for each in found)

    @property
    def acceleration(self) -> Array:
        """∂v̇/∂p (n, nv)."""
        return self._observed[0]

    @property
    def multipliers(self) -> Array:
        """∂λ/∂p (n, rows), in the order of the run's `multiplier_names`."""
        return self._observed[1]

    @property
    def kinetic_energy(self) -> Array:
        """∂T/∂p (n,)."""
        return self._observed[2][:, 0]

    @property
    def potential_energy(self) -> Array:
        """∂V/∂p (n,)."""
        return self._observed[2][:, 1]

    @property
    def actuator_torque(self) -> Array:
        """∂τ/∂p (n, nv) of actuators and controllers."""
        return self._observed[3]

    @property
    def torque(self) -> Array:
        """∂τ/∂p (n, nv) of all forces of the scene."""
        return self._observed[3] + self._observed[4]

    @property
    def outputs(self) -> Mapping[str, Array]:
        """∂/∂p of the named outputs of the scene, (n,) or (n, k) each."""
        found = self._observed[5:]
        names = self.run.scene.outputs
        return {k: x[:, 0] if x.shape[1] == 1 else x for k, x in zip(names, found, strict=True)}

    def output(self, name: str) -> Array:
        """Get the derivative of a named output.

        Args:
            name: The name under `outputs` in the scene.

        Returns:
            (n,) or (n, k), in the output's unit per unit of p.

        Raises:
            InputError: The scene has no such output; the message lists the names.

        Example:
            >>> import bellcrank as bc
            >>> run = bc.simulate("pendulum", duration=1.0, samples=11, sensitivities=["initial.swing"])
            >>> run.sensitivity("initial.swing").output("P1").shape
            (11, 3)
        """
        scene = self.run.scene
        if arguments.text("name", name, "the name of an output") not in scene.outputs:
            raise InputError(f"{scene.name}: {unknown_name('output', name, scene.outputs)}")
        return self.outputs[name]

    # ---- events

    @cached_property
    def events(self) -> tuple[EventSensitivity, ...]:
        """The derivatives of the run's events, in their order. Raises InputError for an event that touches zero."""
        return tuple(self._event(event) for event in self.run.events)

    @property
    def event_times(self) -> Array:
        """∂t/∂p (e,) of the times of the run's events; infinite for an event that touches zero without crossing it."""
        found = []
        for event in self.run.events:
            try:
                found.append(self._event(event).time)
            except InputError:
                found.append(np.inf)
        return np.array(found)

    def event(self, name: str, occurrence: int = 0) -> EventSensitivity:
        """Get the derivative of an event.

        Args:
            name: The event's name in the scene.
            occurrence: Which of the events of this name, from 0 on; −1 for the last.

        Returns:
            The derivatives of its time and state.

        Raises:
            InputError: The run has no such event, or it touches zero without crossing it.

        Example:
            >>> import bellcrank as bc
            >>> run = bc.simulate("four_bar", sensitivities=["crank_length"])
            >>> print(f"{run.sensitivity('crank_length').event('lock').time:.2f} s/m")
            340.53 s/m
        """
        arguments.text("name", name, "the name of an event")
        mine = [event for event in self.run.events if event.name == name]
        if not mine:
            known = dict.fromkeys(event.name for event in self.run.events)
            raise InputError(f"{self.run.scene.name}: {unknown_name('event of the run', name, list(known))}")
        occurrence = arguments.whole("occurrence", occurrence, least=-len(mine), most=len(mine) - 1)
        return self._event(mine[occurrence])

    def _event(self, event: Event) -> EventSensitivity:
        run, of = self.run, self._of
        robot, t = run.robot, np.array([event.time])
        place = int(np.searchsorted(of.event_times, event.time))
        sensitivity, dp = of.event_rows[self._index, place], of.changes[self._index]
        x = np.zeros(run.state.shape[1])
        x[: robot.nq], x[robot.nq : robot.nq + robot.nv] = event.position, event.velocity
        u, du = values_at(run.signals, t)[0], signal_rates(run.signals, event.time)
        point = t, x, u, run.parameters
        k = next(k for k, rule in enumerate(run.scene.events) if rule.name == event.name)
        rate, change = of.equations.events(*point, sensitivity, dp, du)
        size = float(np.abs(rate).max(initial=0.0) + np.abs(change).max(initial=0.0))
        if not abs(rate[k]) > GRAZING * size:
            raise InputError(
                f"{run.scene.name}: event '{event.name}' at {event.time:.6g} s touches zero without crossing it, so "
                "its time has no derivative"
            )
        dt = float(-change[k] / rate[k])
        tangent = of.equations.rate.point(*point)[0]
        total = sensitivity + tangent * dt
        latch = {}
        if event.latch is not None:
            after, _, impulse, lost = of.equations.latch(k)(*point, total, dp, du, np.array([dt]))
            latch = {"latch_velocity": after, "impulse": float(impulse[0]), "energy_lost": float(lost[0])}
        return EventSensitivity(
            name=event.name, time=dt, position=total[: robot.nq], velocity=total[robot.nq :], **latch
        )

    # ---- to read, and other formats

    def table(self) -> str:
        """The derivatives of the times of events, and of all quantities at the end, as text.

        Returns:
            A line a quantity.

        Example:
            >>> import bellcrank as bc
            >>> run = bc.simulate("four_bar", sensitivities=["crank_length"])
            >>> print(run.sensitivity("crank_length").table().splitlines()[0])
            Deployable four-bar: derivatives by crank_length
        """
        lines = [f"{self.run.scene.name}: derivatives by {self.name}"]
        rows = [[f"time of {name}", f"{value:.6g} {self.per('s')}"] for name, value in self._times()]
        rows += [[title, f"{value:.6g} {unit}"] for title, unit, value in self._end()]
        return "\n".join([*lines, *aligned([["", "at the end"], *rows]), *(f"note: {text}" for text in self.notes)])

    def as_dict(self) -> dict[str, Any]:
        """The derivatives at events and at the end as data for JSON.

        Returns:
            The variable with its unit, ∂t/∂p of the events, and all quantities at the end.

        Example:
            >>> import bellcrank as bc
            >>> run = bc.simulate("four_bar", sensitivities=["crank_length"])
            >>> run.sensitivity("crank_length").as_dict()["unit"]
            'm'
        """
        return {
            "scene": self.run.scene.name,
            "name": self.name,
            "unit": self.unit,
            "events": [{"name": name, "time": value} for name, value in self._times()],
            "end": {title: {"value": value, "unit": unit} for title, unit, value in self._end()},
            "notes": [note.as_dict() for note in self.notes],
        }

    def _times(self) -> list[tuple[str, float]]:
        return [(event.name, value) for event, value in zip(self.run.events, self.event_times.tolist(), strict=True)]

    def _end(self) -> list[tuple[str, str, float]]:
        """(quantity, unit of its derivative, derivative) in the last row."""
        from bellcrank.simulation.files.run_csv import derivative_columns

        labels, rows = derivative_columns([self])
        return [(name, unit, value) for (name, unit), value in zip(labels[1:], rows[-1, 1:].tolist(), strict=True)]

    def _rows(self) -> list[Sequence[object]]:
        from bellcrank.simulation.files.run_csv import derivative_columns

        labels, rows = derivative_columns([self])
        return [[f"{name} [{unit}]" for name, unit in labels], *rows.tolist()]


def signal_rates(signals: tuple[Signal, ...], time: float) -> Array:
    """du/dt (nu,) of piecewise polynomials at a time."""
    rates = [np.zeros(0)]
    for signal in signals:
        c, powers = signal.coefficients, np.arange(signal.coefficients.shape[1])
        slopes = c[:, 1:] * powers[1:, None] if len(powers) > 1 else np.zeros_like(c)
        found = Signal(signal.breaks, slopes, signal.derivatives, True).at(np.array([time]))[0]
        rates.append(found if signal.breaks[0] <= time <= signal.breaks[-1] else np.zeros_like(found))
    return np.concatenate(rates)
