"""The solver settings of a scene, under the key `simulate`. Their names are those of scipy.integrate.solve_ivp."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from bellcrank import arguments
from bellcrank.config.fields import Fields
from bellcrank.errors import InputError
from bellcrank.memory import check_memory
from bellcrank.messages import unknown_name

STABILISATIONS = ("projection", "none", "baumgarte")
SOLVERS = ("RK45", "RK4", "DOP853", "Radau", "auto")
IMPLICIT = ("Radau", "auto")  # those that may need derivatives
ERROR_BOUND = 1e-3  # default share of a coordinate's range
FINEST_RTOL = 1e-13  # for smaller values the error estimate consists of rounding errors
MOST_NUMBERS = 4 * 10**9 // 8  # doubles in the states of a run: 4 GB


@dataclass(frozen=True)
class Stabilisation:
    """The method that limits the drift of constraints.

    Attributes:
        kind: "projection" (positions and velocities are projected onto the constraints after each step), "baumgarte"
            (φ̈ + 2 alpha φ̇ + beta² φ = 0 instead of φ̈ = 0) or "none".
        alpha: Baumgarte's gain on the velocity residual, 1/s.
        beta: Baumgarte's gain on the position residual, 1/s.
        auto: Whether the gains are chosen from solver, tolerances and step (simulation/integration/automatic_gains.py).
    """

    kind: str = "projection"
    alpha: float = 0.0
    beta: float = 0.0
    auto: bool = False


@dataclass(frozen=True)
class Settings:
    """Solver settings.

    Args:
        duration: Simulated time, s.
        solver: "RK45" or "DOP853" (explicit, variable step), "Radau" (implicit, for stiff equations), "auto" (DOP853
            where the equations are not stiff, Radau where they are; with a fixed step always DOP853) or "RK4" (fixed
            step).
        rtol: Relative tolerance of the error of one step, from 1e-13 to 1.
        atol: Absolute tolerance of the error of one step: rad, m, rad/s, m/s.
        step: Fixed step, s; None for a variable one. RK4 requires it.
        first_step: First step, s; None for an automatic one.
        max_step: Largest step, s; None for no limit.
        samples: Number of equally spaced output times, at least 2.
        max_evaluations: Number of evaluations of the equations of motion after which a simulation is stopped.
        error_bound: Up to which error a position counts as known: this share of the range of its coordinate in the run,
            or of 1e-3 rad or m if that is larger.
        stabilisation: How constraints are kept from drifting: "projection", "none", {"kind": "baumgarte", "alpha": …,
            "beta": …} (1/s) or {"kind": "baumgarte", "gains": "auto"}.

    Raises:
        InputError: A value is out of range, or the solver is unknown.

    Example:
        >>> import bellcrank as bc
        >>> settings = bc.results.Settings(duration=2.0, solver="RK4", step=1e-3)
        >>> settings.stabilisation.kind
        'projection'
    """

    duration: float = 10.0
    solver: str = "auto"
    rtol: float = 1e-9
    atol: float = 1e-9
    step: float | None = None
    first_step: float | None = None
    max_step: float | None = None
    samples: int = 1001
    max_evaluations: int = 10**8
    error_bound: float = ERROR_BOUND
    stabilisation: Stabilisation = Stabilisation()

    def __post_init__(self) -> None:
        if not isinstance(self.solver, str) or self.solver not in SOLVERS:
            solver = arguments.text("solver", self.solver, f"one of {', '.join(SOLVERS)}")
            raise InputError(unknown_name("solver", solver, SOLVERS), argument="solver")
        for name in ("duration", "rtol", "atol", "step", "first_step", "max_step", "error_bound"):
            value = getattr(self, name)
            if value is None and name in ("step", "first_step", "max_step"):
                continue
            if type(value) is not float or not 0.0 < value < math.inf:  # fast path: every simulation comes here
                object.__setattr__(self, name, arguments.number(name, value, above=0.0))
        if self.rtol < FINEST_RTOL:
            raise InputError(
                f"expected {FINEST_RTOL:g} or more, found {self.rtol:g}; double precision allows no smaller error",
                argument="rtol",
            )
        if self.rtol > 1.0:
            raise InputError(f"expected at most 1, an error as large as the value, found {self.rtol:g}", "", "rtol")
        for name, least, most in (("samples", 2, MOST_NUMBERS), ("max_evaluations", 1, 2**62)):
            object.__setattr__(self, name, arguments.whole(name, getattr(self, name), least=least, most=most))
        object.__setattr__(self, "stabilisation", stabilisation(self.stabilisation))
        if self.solver == "RK4" and self.step is None:
            raise InputError("the solver RK4 requires a fixed step, such as step: 1 ms", argument="step")


def read_settings(read: Fields) -> Settings:
    """Read the mapping `simulate`. Raises InputError naming file and key."""
    units = {"duration": "s", "step": "s", "first_step": "s", "max_step": "s"}
    units |= dict.fromkeys(("rtol", "atol", "error_bound"), "")
    values: dict[str, Any] = {}
    for field in fields(Settings):
        name = field.name
        if name not in read:
            read.known(name)
        elif name == "solver":
            values[name] = read.choice(name, SOLVERS)
        elif name == "stabilisation":
            values[name] = _read_stabilisation(read)
        elif name in units:
            values[name] = read.number(name, units[name], positive=True)
        else:
            values[name] = read.integer(name, minimum=1)
    read.done()
    try:
        return Settings(**values)
    except InputError as error:
        raise read.error(error.argument, error.reason) from None


def check_rows(samples: int, width: int, copies: float = 1.25) -> None:
    """Raise InputError if rows of `width` numbers do not fit into 4 GB, or into the free memory.

    `copies` is the total size of all results, in multiples of the size of the states.
    """
    if samples * width > MOST_NUMBERS:
        raise InputError(
            f"expected at most {MOST_NUMBERS // width} rows, so that positions and velocities use at most 4 GB, "
            f"found {samples}"
        )
    check_memory(samples, 8.0 * copies * (width + 2), "samples")


def stabilisation(value: Stabilisation | Mapping[str, Any] | str) -> Stabilisation:
    """Convert a text or mapping to a Stabilisation; `Settings` lists what it may be. Raises InputError."""
    if not isinstance(value, (Stabilisation, Mapping, str)):
        arguments.refuse("stabilisation", f"one of {', '.join(map(repr, STABILISATIONS))}, or a mapping", value)
    return value if isinstance(value, Stabilisation) else _read_stabilisation(Fields({"stabilisation": value}))


def _read_stabilisation(read: Fields) -> Stabilisation:
    key = "stabilisation"
    given = read.raw(key)
    if not isinstance(given, Mapping):
        kind = read.choice(key, STABILISATIONS)
        if kind == "baumgarte":
            raise read.error(key, "baumgarte requires gains: {kind: baumgarte, gains: auto}, or alpha and beta (1/s)")
        return Stabilisation(kind)
    entry = read.mapping(key)
    kind = entry.choice("kind", STABILISATIONS)
    alpha = beta = 0.0
    auto = False
    if kind == "baumgarte":
        auto = "gains" in entry and entry.choice("gains", ("auto",)) == "auto"
        if auto and ("alpha" in entry or "beta" in entry):
            raise entry.error("gains", "expected 'gains: auto' or alpha and beta, found both")
        if not auto:
            entry.known("gains")
            alpha, beta = entry.number("alpha", "1/s", nonnegative=True), entry.number("beta", "1/s", nonnegative=True)
    entry.done()
    return Stabilisation(kind, alpha, beta, auto)
