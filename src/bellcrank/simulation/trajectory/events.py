"""Events of a run, impacts, and when joints were kept at rest by friction or met their stops."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.dynamics.equations.system import system_of
from bellcrank.elements.drives import BUS
from bellcrank.elements.dry_friction import DryFriction, JointDryFriction
from bellcrank.elements.joint_stops import JointStop
from bellcrank.elements.signals import values_at
from bellcrank.elements.supply import BAND
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.notes import Note
from bellcrank.scene.outputs import output_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bellcrank.elements.drives import Drive
    from bellcrank.elements.signals import Signal
    from bellcrank.scene.scene import Scene
    from bellcrank.simulation.trajectory.trajectory import Trajectory


NO_SIGNALS: Array = np.zeros(0)
AT_LIMIT = 1.0 - 1e-9  # of a drive's command: what a sampled servo holds is cut off at its limit
SHOWN = 4  # intervals or impacts of a joint in a summary


@dataclass(frozen=True, eq=False, kw_only=True)
class Latch:
    """A latch that closed: a plastic impact that the constraints take part in.

    Attributes:
        velocity: Velocity (nv,) after the impact.
        impulse: Impulse of the latch, in `unit`.
        unit: N m s or N s for a latch at a joint.
        constraint_impulses: Impulses (rows,) of the constraints, in the order of the multipliers, each in the unit of
            its multiplier times s.
        energy_lost: Kinetic energy lost in the impact, J.
    """

    velocity: Array
    impulse: float
    unit: str
    constraint_impulses: Array
    energy_lost: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Event:
    """An event of a run.

    Attributes:
        name: The event's name in the scene.
        time: s.
        position: Position (nq,) at the event.
        velocity: Velocity (nv,) at the event, before any impact.
        stopped: Whether it ended the run.
        multipliers: Lagrange multipliers (rows,) at the event.
        latch: The impact of its latch; None without one.
        auxiliary: States of drives (nz,) at the event (`Trajectory.auxiliary`).
    """

    name: str
    time: float
    position: Array
    velocity: Array
    stopped: bool
    multipliers: Array = field(default_factory=lambda: np.zeros(0))
    latch: Latch | None = None
    auxiliary: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def state(self) -> Array:
        """Position, velocity and auxiliary states (nq + nv + nz,)."""
        return np.concatenate([self.position, self.velocity, self.auxiliary])

    @property
    def impulse(self) -> float:
        """The impulse of its latch, in `latch.unit`; 0 without one."""
        return 0.0 if self.latch is None else self.latch.impulse

    @property
    def energy_lost(self) -> float:
        """The kinetic energy lost in its latch, J; 0 without one."""
        return 0.0 if self.latch is None else self.latch.energy_lost


def event_at(
    scene: Scene,
    k: int,
    time: float,
    state: Array,
    parameters: Array,
    signals: Sequence[Signal] | None = None,
) -> Event:
    """Event number k of a scene at a time (s) and a state, with multipliers and the impact of its latch.

    The state is that of the equations, with or without the work.

    `signals`: those of the run, by default the scene's.
    """
    system, rule = system_of(scene), scene.events[k]
    x, t = np.zeros(system.size), np.array([time])
    moving, own = system.nq + system.nv, system.nq + system.nv + system.nz
    x[:own] = state[:own]
    signals = scene.signals if signals is None else signals
    arguments = (t, x, values_at(signals, t)[0] if signals else NO_SIGNALS, parameters)
    multipliers = system.constraint(*arguments)[0] if scene.constraints else np.zeros(0)
    latch = None
    if rule.latch:
        after, impulses, impulse, lost = system.latch(k)(*arguments)
        latch = Latch(
            velocity=after,
            impulse=float(impulse[0]),
            unit=rule.impulse_unit,
            constraint_impulses=impulses,
            energy_lost=float(lost[0]),
        )
    return Event(
        name=rule.name,
        time=time,
        position=x[: system.nq].copy(),
        velocity=x[system.nq : moving].copy(),
        auxiliary=x[moving:own].copy(),
        stopped=rule.stop,
        multipliers=multipliers,
        latch=latch,
    )


def stuck_intervals(run: Trajectory, joint: str) -> Array:
    """Beginnings and ends (n, 2), s, of the intervals in which friction held a joint. Raises InputError."""
    parts = run.scene.sticking
    if joint not in parts:
        raise InputError(f"{run.scene.name}: {unknown_name('joint or rotor with dry friction', joint, parts)}")
    time, modes = _modes(run, parts[joint])
    return _intervals(run, time, modes[:, 1] == 0.0)


def drive_columns(run: Trajectory, drive: Drive) -> dict[str, Array]:
    """The columns (n,) of the output of a drive, by their names without unit."""
    output = output_of(run.scene.outputs, drive)
    assert output is not None, "every drive has an output"
    labels = [label.removeprefix(f"{output.name} ").rpartition(" [")[0] for label in output.labels]
    return dict(zip(labels, run.outputs[output.name].T, strict=True))


def saturated_intervals(run: Trajectory, drive: Drive) -> Array:
    """Beginnings and ends (n, 2), s, of the intervals of rows in which a drive is at or above its limit."""
    found = drive_columns(run, drive).get("command over limit")
    if found is None:
        return np.zeros((0, 2))
    over = found >= AT_LIMIT
    padded = np.concatenate([[False], over, [False]])
    edges = np.flatnonzero(padded[1:] != padded[:-1]).reshape(-1, 2)
    return np.column_stack([run.time[edges[:, 0]], run.time[edges[:, 1] - 1]])


def intervals_at_stops(run: Trajectory, joint: str) -> Array:
    """Beginnings and ends (n, 2), s, of the intervals in which a stop held a joint, or flanks of "JOINT gear" met."""
    time, modes = _modes(run, _stop(run, joint))
    return _intervals(run, time, modes[:, 2] == 1.0)


def impacts_at_stops(run: Trajectory, joint: str) -> Array:
    """Times (s) and impulses (N m s or N s) (n, 2) of impacts at the stops of a joint, or flanks of "JOINT gear"."""
    time, modes = _modes(run, _stop(run, joint))
    hits = np.flatnonzero(modes[:, 3])
    return np.stack([time[hits], modes[hits, 3]], axis=1)


def ending_contacts(run: Trajectory) -> str:
    """What ended a run at a contact, as a clause: the joints at their stops, and those that brakes have stopped."""
    found = []
    for part in run.scene.parts_with_modes:
        if isinstance(part, JointStop) and part.ends_run and _modes(run, part)[1][-1, 2:].any():
            found.append(f"joint '{part.joint.name}' met its stop")
        elif isinstance(part, JointDryFriction) and part.ends_run and not _modes(run, part)[1][-1, 1]:
            found.append(f"the brake of joint '{part.joint.name}' brought it to rest")
    return f"{' and '.join(found)}, with stop: true"


def contact_rows(run: Trajectory) -> Iterator[tuple[str, str]]:
    """(name, value) of a summary: how long joints and rotors with dry friction were stuck, and how joints met stops."""
    for k, name in enumerate(run.scene.sticking):
        found = stuck_intervals(run, name)
        yield ("stuck" if k == 0 else "", f"{name} {_told(run, found) if len(found) else 'never'}")
    limited = [(drive, found) for drive in run.scene.drives if len(found := saturated_intervals(run, drive))]
    for k, (drive, found) in enumerate(limited):
        what = "torque" if drive.model == "torque" else "voltage"
        yield ("at its limit" if k == 0 else "", f"{drive.joint.name}: {what} {_told(run, found)}")
    if (supply := run.scene.supply) is not None:
        bus, given, burnt = _supply_states(run)
        resistor = "" if supply.brake is None else f", brake resistor {burnt[-1]:.5g} J"
        yield "bus", f"{bus.min():.5g} to {bus.max():.5g} V; source {given[-1]:.5g} J{resistor}"
    first = True
    for stop in run.scene.contacts:
        hits, held = impacts_at_stops(run, stop.held), intervals_at_stops(run, stop.held)
        unit = "N s" if stop.joint.kind == "prismatic" else "N m s"
        texts = []
        if len(hits):
            listed = ", ".join(f"{impulse:.6g} {unit} at {time:.6g} s" for time, impulse in hits[:SHOWN].tolist())
            more = f", … ({len(hits)} in all, the last at {hits[-1, 0]:.6g} s)" if len(hits) > SHOWN else ""
            texts.append(f"impacts {listed}{more}")
        if len(held):
            texts.append(f"held {_told(run, held)}")
        if texts:
            yield ("stops" if first else "", f"{stop.held}: {'; '.join(texts)}")
            first = False


def shared_rest(run: Trajectory) -> tuple[Note, ...]:
    """A note where joints of closed linkages hold each other, so that their forces are not unique."""
    names = []
    for part in run.scene.dry_friction:
        _, modes = _modes(run, part)
        if ((modes[:, 1] == 0.0) & (modes[:, 2] == 0.0)).any():
            names.append(part.held)
    if not names:
        return ()
    return (
        Note(
            "friction or stops of several joints hold the same linkage, so that the forces of friction at rest, and "
            f"those of constraints, are not unique; the motion is (joints {', '.join(names)} give way to others)"
        ),
    )


def simultaneous_impacts(run: Trajectory) -> tuple[Note, ...]:
    """A note where several joints met their stops at one instant, so that the impulses depend on the law of impact."""
    times: dict[float, list[str]] = {}
    for stop in run.scene.contacts:
        for time in impacts_at_stops(run, stop.held)[:, 0].tolist():
            times.setdefault(time, []).append(stop.held)
    several = {time: names for time, names in times.items() if len(names) > 1}
    if not several:
        return ()
    time, names = next(iter(several.items()))
    more = f", and at {len(several) - 1} more instants" if len(several) > 1 else ""
    return (
        Note(
            f"joints {', '.join(names)} strike their stops at once at {time:.6g} s{more}: impulses and velocities "
            "after it follow from the law of impact (Newton's, Poisson's where it would raise the energy), not from "
            "mechanics alone"
        ),
    )


def largest_bus_voltage(run: Trajectory) -> float:
    """The largest voltage of the bus at the rows of a run, V."""
    return float(_supply_states(run)[0].max())


def bus_limit(run: Trajectory) -> tuple[Note, ...]:
    """A note where drives that brake lift the bus above the voltage at which the brake resistor is fully on."""
    supply = run.scene.supply
    if supply is None or supply.largest is None:
        return ()
    bus = _supply_states(run)[0]
    above = np.flatnonzero(bus > (1.0 + BAND) * supply.largest)
    if not len(above):
        return ()
    why = "there is no brake resistor" if supply.brake is None else "the brake resistor takes too little"
    return (
        Note(
            f"the bus reaches {bus.max():.5g} V, above bus_max_voltage {supply.largest:g} V, from "
            f"{run.time[above[0]]:.5g} s on: {why} (conditions: brake_resistance, bus_capacitance)"
        ),
    )


def _supply_states(run: Trajectory) -> tuple[Array, Array, Array]:
    """Bus voltage (n,), V, and the energies of source and brake resistor (n,), J."""
    states = run.scene.auxiliary_states
    first = sum(each.size for each in states[: states.index(BUS)])
    bus, given, burnt = run.auxiliary[:, first : first + BUS.size].T
    return bus, given, burnt


def _stop(run: Trajectory, joint: str) -> JointStop:
    parts = {part.held: part for part in run.scene.contacts}
    if joint not in parts:
        raise InputError(
            f"{run.scene.name}: {unknown_name('gear with rigid backlash or joint with a rigid stop', joint, parts)}"
        )
    return parts[joint]


def _told(run: Trajectory, found: Array) -> str:
    end = float(run.time[-1])
    listed = [f"from {a:.6g} s to {'the end' if b == end else f'{b:.6g} s'}" for a, b in found[:SHOWN].tolist()]
    more = f", … ({len(found)} times)" if len(found) > SHOWN else ""
    return f"for {float(np.sum(found[:, 1] - found[:, 0])):.6g} s: {', '.join(listed)}{more}"


def _intervals(run: Trajectory, time: Array, rest: Mask) -> Array:
    padded = np.concatenate([[False], rest, [False]])
    edges = np.flatnonzero(padded[1:] != padded[:-1]).reshape(-1, 2)
    found = np.clip(time[edges], run.time[0], run.time[-1])
    return found[found[:, 1] > found[:, 0]]


def _modes(run: Trajectory, part: DryFriction | JointStop) -> tuple[Array, Array]:
    """The times (n + 1,), s, between which the mode of a joint (n, 4) lasts (`DryFriction.mode`, `JointStop.mode`)."""
    signal = run.signals[run.scene.signal_sources.index(part.mode)]
    time = signal.breaks.copy()
    time[-1] = np.inf
    return time, signal.coefficients[:, 0, :]
