"""What the integrator is given, as typed records. The extension `_step` reads each attribute once (integrate.cpp)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array

if TYPE_CHECKING:
    from bellcrank.elements.signals import Signal


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
