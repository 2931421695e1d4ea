"""How a scene is integrated: the key `simulate`. Names and meanings are those of scipy.integrate.solve_ivp."""

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
SOLVERS = ("RK45", "RK4", "DOP853", "Radau")
FINEST_RTOL = 1e-13  # below this the error estimate is rounding noise
MOST_NUMBERS = 4 * 10**9 // 8  # doubles in the states of a run: 4 GB


@dataclass(frozen=True)
class Stabilisation:
    """How constraints are kept from drifting: kind "projection" (back onto them after each step), "baumgarte" with gains
    alpha and beta (1/s), or "none". `auto`: the gains follow from solver, tolerances and step
    (simulation/baumgarte_gains.py).
    """

    kind: str = "projection"
    alpha: float = 0.0
    beta: float = 0.0
    auto: bool = False


@dataclass(frozen=True)
class Settings:
    """Solver settings, checked.

    duration s; solver RK45, DOP853, Radau (stiff) or RK4; rtol (relative) and atol (rad, m, rad/s, m/s) bound the error
    of a step; `step` s fixes the step and is what RK4 needs; `first_step` and `max_step` s, None for automatic and
    none; `samples` equally spaced output times; `max_evaluations` of the right-hand side end a run. Raises InputError.
    """

    duration: float = 10.0
    solver: str = "DOP853"
    rtol: float = 1e-9
    atol: float = 1e-9
    step: float | None = None
    first_step: float | None = None
    max_step: float | None = None
    samples: int = 1001
    max_evaluations: int = 10**8
    stabilisation: Stabilisation = Stabilisation()

    def __post_init__(self) -> None:
        if not isinstance(self.solver, str) or self.solver not in SOLVERS:
            solver = arguments.text("solver", self.solver, f"one of {', '.join(SOLVERS)}")
            raise InputError(f"solver: {unknown_name('solver', solver, SOLVERS)}")
        for name in ("duration", "rtol", "atol", "step", "first_step", "max_step"):
            value = getattr(self, name)
            if value is None and name in ("step", "first_step", "max_step"):
                continue
            if type(value) is not float or not 0.0 < value < math.inf:  # simulate comes here every time
                object.__setattr__(self, name, arguments.number(name, value, above=0.0))
        if self.rtol < FINEST_RTOL:
            raise InputError(
                f"rtol: expected {FINEST_RTOL:g} or more, found {self.rtol:g}; doubles carry no smaller relative error"
            )
        for name, least, most in (("samples", 2, MOST_NUMBERS), ("max_evaluations", 1, 2**62)):
            object.__setattr__(self, name, arguments.whole(name, getattr(self, name), least=least, most=most))
        object.__setattr__(self, "stabilisation", stabilisation(self.stabilisation))
        if self.solver == "RK4" and self.step is None:
            raise InputError("step: the solver RK4 has a fixed step and needs it, such as step: 1 ms")


def read_settings(read: Fields) -> Settings:
    """The settings of the mapping `simulate`; InputError naming file and key."""
    units = {"duration": "s", "rtol": "", "atol": "", "step": "s", "first_step": "s", "max_step": "s"}
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
        key, _, text = str(error).removeprefix("argument ").partition(": ")
        raise read.error(key.strip("'"), text) from None


def check_rows(samples: int, width: int, copies: float = 1.25) -> None:
    """Refuse more rows of positions and velocities (`width` numbers each) than 4 GB of memory hold, or than the memory
    that is free does (InputError). `copies` is how many times the states are held in all, other results among them.
    """
    if samples * width > MOST_NUMBERS:
        raise InputError(
            f"expected at most {MOST_NUMBERS // width} rows, so that positions and velocities take no more than 4 GB, "
            f"found {samples}"
        )
    check_memory(samples, 8.0 * copies * (width + 2), "samples")


def stabilisation(value: Stabilisation | Mapping[str, Any] | str) -> Stabilisation:
    """What a text or mapping says: "projection", "none", {"kind": "baumgarte", "alpha": …, "beta": …} or {"kind":
    "baumgarte", "gains": "auto"}. Raises InputError.
    """
    if not isinstance(value, (Stabilisation, Mapping, str)):
        arguments.refuse("stabilisation", f"one of {', '.join(map(repr, STABILISATIONS))}, or a mapping", value)
    return value if isinstance(value, Stabilisation) else _read_stabilisation(Fields({"stabilisation": value}))


def _read_stabilisation(read: Fields) -> Stabilisation:
    key = "stabilisation"
    given = read.raw(key)
    if not isinstance(given, Mapping):
        kind = read.choice(key, STABILISATIONS)
        if kind == "baumgarte":
            raise read.error(key, "baumgarte needs gains: {kind: baumgarte, gains: auto} or with alpha and beta (1/s)")
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
