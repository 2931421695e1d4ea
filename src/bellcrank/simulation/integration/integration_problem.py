"""What the integrator is given, as typed records. The extension `_step` reads each attribute once (integrate.cpp)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.cached_values import computed_once
from bellcrank.codegen.compile import make_ready
from bellcrank.dynamics.equations.system import system_of
from bellcrank.elements.drives import Drive
from bellcrank.elements.dry_friction import DryFriction, JointDryFriction, RestingJoint
from bellcrank.elements.element import found_signal
from bellcrank.elements.joint_stops import GearContact, JointStop
from bellcrank.elements.rotor_friction import RotorFriction
from bellcrank.elements.sampled_controllers import FunctionController, Sampled
from bellcrank.elements.signals import Signal

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene

Update = Callable[[float, Array, Array], Array]  # (t, x, values) -> the values after it


@dataclass(frozen=True, eq=False, kw_only=True)
class Kernels:
    """Addresses of compiled functions of (t, x, u, p); 0 where there is none.

    Attributes:
        rhs: The state's rate; where `fallback` is given, a guard as well.
        staged: `rhs` and `fallback` take (t, x, u, p, k, s) and evaluate at x + s k; up to 16 states.
        fallback: The state's rate where the guard of `rhs` is not positive.
        derivatives: Makes the derivatives when a method first needs them; None: those below.
        jacobian: d rhs / dx (n, n), column by column, for Radau.
        tangent: d rhs / dx · dx for many dx at once, for Radau without a Jacobian.
        lanes: How many rows a batch kernel computes at once.
        events: The event functions.
        project: A Newton correction of (q, v) onto the constraints, and a guard; applied until it no longer moves q.
        project_fallback: The correction where the guard of `project` is not positive.
        project_batch: `project` for many states at once, for outputs; only without signals.
    """

    rhs: int
    staged: bool = False
    fallback: int = 0
    derivatives: Callable[[], DerivativeKernels] | None = None
    jacobian: int = 0
    tangent: int = 0
    lanes: int = 1
    events: int = 0
    project: int = 0
    project_fallback: int = 0
    project_batch: int = 0


@dataclass(frozen=True, eq=False, kw_only=True)
class DerivativeKernels:
    """Addresses of the derivatives of the right-hand side, as in Kernels: `jacobian` or `tangent`, and `lanes`."""

    jacobian: int = 0
    tangent: int = 0
    lanes: int = 1


@dataclass(frozen=True, eq=False, kw_only=True)
class StateLayout:
    """The parts of a state.

    Attributes:
        norm_size: How many of the first entries the error control looks at.
        nq: How many of the first entries are positions.
        unit_parts: (first, length) of the parts that stay unit vectors.
        joints: (first of q, their number, first of v, their number) of each joint, ascending, where q' of a joint
            depends on its own q and v alone and no rate depends on what follows v; empty: not known.
        weights: 1 over the characteristic size of each position (nq,), for corrections; None: all are 1.
        mixed: Whether there are states beside positions and velocities among those that the error control looks at.
    """

    norm_size: int
    nq: int = 0
    unit_parts: Sequence[tuple[int, int]] = ()
    joints: Sequence[tuple[int, int, int, int]] = ()
    weights: Array | None = None
    mixed: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class EventSearch:
    """How events are looked for; one entry an event function.

    Attributes:
        terminal: Whether the event ends the run.
        direction: 1: from below zero to above; −1: from above to below; 0: both.
        samples: How often the functions are evaluated in a step at first: 2, or else 8 times.
    """

    terminal: Sequence[bool] = ()
    direction: Sequence[int] = ()
    samples: int = 8


@dataclass(frozen=True, eq=False, kw_only=True)
class StepControl:
    """The method and its step sizes.

    Attributes:
        method: "RK4", "RK45", "DOP853", "Radau" or "auto", which switches between the last two.
        rtol: Relative tolerance.
        atol: Absolute tolerance; the error is kept below atol + rtol |x|, as in scipy.integrate.solve_ivp.
        step: A fixed step size, s; 0: the error control chooses it.
        first_step: The first step size, s; 0: chosen.
        max_step: The largest step size, s.
        max_evaluations: The run ends after so many evaluations of the right-hand side.
    """

    method: str
    rtol: float
    atol: float
    step: float = 0.0
    first_step: float = 0.0
    max_step: float = math.inf
    max_evaluations: int = 10**8


@dataclass(frozen=True, eq=False, kw_only=True)
class HeldEntries:
    """The last entries of u, which change only at instants of the run: sides of switches, then modes of joints with dry
    friction and stops, then what updates compute.

    Attributes:
        start: Their values at the start.
        switch_count: How many of the first are sides, 1 or -1.
        switches: Address of (t, x, u, p) -> the functions whose signs they are, and those that are positive while the
            modes last; 0 where there are none.
        mode_kinds: 0 for dry friction, 1 for a stop, 2 for one that latches, 3 for a joint without forces in a
            linkage, 4 for dry friction of a gear with losses by load.
        mode_sides: Which of the switches is the side of such a gear; −1 for others.
        mode_ends: 1 where a contact, or friction that brings a joint to rest, ends the run, else 0.
        mode_rows: The entries of x that are the velocities of the joints with modes, and `mode_places` their positions.
        work_row: The entry of x that is the work, which impacts change; −1: there is none.
        response_rows: How many entries of x, from the velocities on, the forces of modes accelerate.
        mode_turn: Address of (t, x, u, p) -> what new modes are found by (`StuckJoints.turn`); 0 without modes.
        updates: (address of (t, x, u, p) -> all entries after sides and modes, first time s, period s) of each update;
            with the address 0 a function that `PreparedProblem.run` is given computes them.
    """

    start: Array
    switch_count: int = 0
    switches: int = 0
    mode_kinds: Sequence[int] = ()
    mode_sides: Sequence[int] = ()
    mode_ends: Sequence[int] = ()
    mode_rows: Sequence[int] = ()
    mode_places: Sequence[int] = ()
    work_row: int = -1
    response_rows: int = 0
    mode_turn: int = 0
    updates: Sequence[tuple[int, float, float]] = ()


@dataclass(frozen=True, eq=False, kw_only=True)
class IntegrationProblem:
    """x' = rhs(t, x, u, p) from t0 to t1, with events, outputs and what is called meanwhile.

    Attributes:
        kernels: The compiled functions.
        layout: The parts of the state.
        control: The method and its step sizes.
        t0: s.
        t1: s.
        x0: State (n,) at t0.
        parameters: p.
        signals: u, as piecewise polynomials of t.
        held: What follows them in u; None: nothing.
        stops: Times, s, at which forces jump: steps end there.
        events: How events are looked for.
        times: Times, s, at which the state is wanted, increasing.
        every_step: The state is wanted at the end of every step instead.
        observe: Address of (t, x, u, p) -> the quantities whose extremes are wanted; 0 where there are none.
        observed: How many they are.
        observed_within: How many of the first are looked at within steps too.
    """

    kernels: Kernels
    layout: StateLayout
    control: StepControl
    t0: float = 0.0
    t1: float
    x0: Array
    parameters: Array
    signals: Sequence[Signal] = ()
    held: HeldEntries | None = None
    stops: Array = field(default_factory=lambda: np.empty(0))
    events: EventSearch = EventSearch()
    times: Array = field(default_factory=lambda: np.empty(0))
    every_step: bool = False
    observe: int = 0
    observed: int = 0
    observed_within: int = 0


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
