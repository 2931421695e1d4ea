"""Events of a run, and the impacts of latches."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.dynamics.equations.system import system_of
from bellcrank.elements.signals import values_at

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bellcrank.elements.signals import Signal
    from bellcrank.scene.scene import Scene

NO_SIGNALS: Array = np.zeros(0)


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
