"""The entries of u that a run finds: what the integrator is told of them, and the signals that it returns."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.cached_values import computed_once
from bellcrank.codegen.compile import make_ready
from bellcrank.dynamics.equations.system import system_of
from bellcrank.elements.drives import Drive
from bellcrank.elements.dry_friction import DryFriction, JointDryFriction, RestingJoint
from bellcrank.elements.held_inputs import found_signal
from bellcrank.elements.joint_stops import GearContact, JointStop
from bellcrank.elements.rotor_friction import RotorFriction
from bellcrank.elements.sampled_controllers import FunctionController, Sampled
from bellcrank.elements.signals import Signal
from bellcrank.simulation.integration.integration_problem import HeldEntries

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene

Update = Callable[[float, Array, Array], Array]  # (t, x, values) -> the values after it


@computed_once
def held_entries(scene: Scene) -> HeldEntries | None:
    """Those of a scene; None where it has none."""
    sources = scene.held_sources
    if not sources:
        return None
    system, count = system_of(scene), sum(len(part.switches) for part in scene.elements)
    modes = scene.parts_with_modes
    rows = [system.nq + row if row >= 0 else row for row in mode_rows(scene)]
    updates = [
        (0 if isinstance(part, FunctionController) else make_ready(((system.update(k, i), "scalar"),))[0], each)
        for k, part in enumerate(scene.control)
        if isinstance(part, Sampled | Drive)
        for i, each in enumerate(part.instants)
    ]
    return HeldEntries(
        start=np.concatenate([source.start for source in sources]),
        switch_count=count,
        switches=make_ready(((system.switches, "scalar"),))[0] if count or rows else 0,
        mode_kinds=[_mode_kind(part) for part in modes],
        mode_sides=_sides_of_gears(scene),
        mode_ends=[int(isinstance(part, JointStop | JointDryFriction) and part.ends_run) for part in modes],
        mode_rows=rows,
        mode_places=[_place(part, rows[k]) for k, part in enumerate(modes)],
        work_row=system.size - 1 if system.has_work else -1,
        response_rows=system.nv + system.nz,
        mode_turn=make_ready(((system.mode_turn, "scalar"),))[0] if rows else 0,
        updates=[(address, each.first, each.period) for address, each in updates],
    )


def _mode_kind(part: DryFriction | JointStop | RestingJoint) -> int:
    if isinstance(part, RotorFriction) and part.has_load_side:
        return 4
    return 3 if isinstance(part, RestingJoint) else 1 + part.latch if isinstance(part, JointStop) else 0


def _place(part: DryFriction | JointStop | RestingJoint, row: int) -> int:
    """Where in the state the position of a stop is, that of a gear's twist being before its rate."""
    if isinstance(part, GearContact):
        return row - 1
    return part.joint.q if isinstance(part, JointStop) else 0


def _sides_of_gears(scene: Scene) -> list[int]:
    """Which of the switches is the side of a gear with losses by load, by part with modes; −1 for others."""
    before, found = 0, list[int]()
    for part in scene.elements:
        if isinstance(part, DryFriction | JointStop | RestingJoint):  # as `Scene.parts_with_modes`
            found.append(before if _mode_kind(part) == 4 else -1)
        before += len(part.switches)
    return found


def mode_rows(scene: Scene) -> list[int]:
    """The place of the velocity of each part with modes in v and the auxiliary states; −1 for pins of loops."""
    found, states = [], scene.auxiliary_states
    for part in scene.parts_with_modes:
        own = part.rotor
        if own is None:
            found.append(part.row)
        else:
            found.append(scene.robot.nv + sum(each.size for each in states[: states.index(own[0])]) + own[1])
    return found


def function_updates(scene: Scene) -> list[Update | None]:
    """The Python functions of the updates, None where one is compiled."""
    sampled = [part for part in scene.control if isinstance(part, Sampled | Drive) and part.samples is not None]
    found: list[Update | None] = []
    first = 0
    for part in sampled:
        function = partial(_called, scene, part, first) if isinstance(part, FunctionController) else None
        found += [function] * len(part.instants)
        first += 0 if part.samples is None else part.samples.width
    return found


def _called(scene: Scene, part: FunctionController, first: int, t: float, x: Array, values: Array) -> Array:
    """What all sampled controllers hold after a sample of a Python function whose part begins at `first`."""
    nq, nv, count = scene.robot.nq, scene.robot.nv, len(part.joints)
    torques = part.called(t, x[:nq], x[nq : nq + nv])
    own = slice(first + part.states, first + part.samples.width)
    queue = np.concatenate([torques, values[own][: -2 * count]])
    values = values.copy()
    values[own] = np.concatenate([queue, queue[part.waiting * count :][:count]])
    return values


def known_signals(scene: Scene, signals: tuple[Signal, ...]) -> tuple[Signal, ...]:
    """The signals of a scene without those of its held sources, which follow them."""
    return signals[: len(signals) - len(scene.held_sources)]


def found_signals(scene: Scene, time: Array, values: Array) -> tuple[Signal, ...]:
    """The signals of a scene's held sources with values (m, h) from the times (m,) s on, as a run found them."""
    widths = [source.width for source in scene.held_sources]
    if not widths:
        return ()
    if not len(time):  # the run ended where it began
        time, values = np.zeros(1), np.concatenate([source.start for source in scene.held_sources])[None]
    parts = np.split(values, np.cumsum(widths)[:-1], axis=1)
    return tuple(found_signal(time, np.ascontiguousarray(part)) for part in parts)
