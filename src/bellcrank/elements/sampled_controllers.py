"""Controllers that are sampled: between two samples their torques are constant.

At the times k `sample_time` of the clock the state is measured and the torque is computed; it is applied `delay` later
and held until the next one. No integration step crosses such a time. What a controller holds is a part of u
(element.py): its state, the torques that wait for the delay, newest first, and the torques that it applies.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from bellcrank.arrays import Array
from bellcrank.config.fields import Fields
from bellcrank.config.yaml_file import read_yaml
from bellcrank.elements.controller import ControlContext, Controller, Gain, read_joints, read_limit
from bellcrank.elements.element import GeneralisedForce, HeldSource, held_source
from bellcrank.elements.expression import Expression
from bellcrank.elements.force_table import table_text
from bellcrank.elements.formulas import common
from bellcrank.errors import InputError
from bellcrank.messages import format_value

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols
    from bellcrank.robot.robot import RobotJoint

    Torques = Callable[[list[casadi.SX]], tuple[list[casadi.SX], list[casadi.SX]]]

Matrix = tuple[tuple[float, ...], ...]
ROUNDING = 1e-9  # of a sample time: a delay that is nearer to a multiple of it is that multiple
MOST_WAITING = 1000  # samples within the delay


@dataclass(frozen=True)
class Instants:
    """Times at which a controller changes what it holds: first, first + period, … s of the simulation."""

    first: float
    period: float


def samples_of(name: str) -> str:
    """The name of the signal of what the controller of this name holds."""
    return f"samples of control {name}"


@dataclass(frozen=True)
class Sampled(Controller):
    """A controller that is sampled. `clock` is that of the start of the simulation, s."""

    sample_time: float
    delay: float
    clock: float

    @property
    def states(self) -> int:
        """How many states of its own it has."""
        return 0

    @property
    def start(self) -> Sequence[float]:
        """Its states at the start."""
        return ()

    @property
    def waiting(self) -> int:
        """How many samples later a torque is applied; the rest of the delay is less than a sample time."""
        return math.floor(self.delay / self.sample_time + ROUNDING)

    @property
    def rest(self) -> float:
        """The part of the delay that is not a multiple of the sample time, s."""
        rest = self.delay - self.waiting * self.sample_time
        return rest if rest > ROUNDING * self.sample_time else 0.0

    @property
    def samples(self) -> HeldSource:
        """Its states, the torques that wait, and the torques at its joints."""
        return held_source(samples_of(self.name), self.held_start)

    @property
    def held_start(self) -> Sequence[float]:
        """What it holds at the start."""
        return (*self.start, *[0.0] * (len(self.joints) * (self.waiting + 2)))

    @property
    def instants(self) -> tuple[Instants, ...]:
        """When it samples, and where the delay is no multiple of the sample time, when it applies a torque."""
        found = []
        for offset in (0.0, self.rest)[: 1 + (self.rest > 0.0)]:
            number = math.ceil((self.clock - offset) / self.sample_time - ROUNDING)
            found.append(Instants(number * self.sample_time + offset - self.clock, self.sample_time))
        return tuple(found)

    def torques(self, symbols: Symbols, states: list[casadi.SX]) -> tuple[list[casadi.SX], list[casadi.SX]]:
        """The states after a sample, and the torques before the limit."""
        raise NotImplementedError

    def update(self, instant: int, symbols: Symbols) -> casadi.SX:
        """What it holds after one of its instants."""
        return self.after(instant, symbols, partial(self.torques, symbols))

    def after(self, instant: int, symbols: Symbols, torques: Torques) -> casadi.SX:
        """What it holds after one of its instants, by what gives states and torques from the states."""
        import casadi

        now, count = casadi.vertsplit(symbols.signal(self.samples)), len(self.joints)
        states, queue, applied = now[: self.states], now[self.states : -count], now[-count:]
        if instant == 0:
            states, wanted = torques(states)
            queue = [*self.within_limit(symbols, wanted), *queue[:-count]]
        if instant > 0 or not self.rest > 0.0:
            applied = queue[self.waiting * count : (self.waiting + 1) * count]
        return casadi.vertcat(*states, *queue, *applied)

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The generalised force, potential energy and power that it adds to the equations of motion."""
        held, count = symbols.signal(self.samples), len(self.joints)
        return self.applied(symbols, [held[held.numel() - count + k] for k in range(count)])


@dataclass(frozen=True)
class StateSpace(Sampled):
    """A discrete linear system: τ_k = C ξ_k + D y_k, ξ_{k+1} = A ξ_k + B y_k, at its joints.

    `inputs` are the formulas y, references included. A (n × n), B (n × inputs), C (joints × n) and D (joints × inputs)
    are keys, or keys of a YAML or JSON `file`, which may hold `sample_time` too; a missing D is 0, and a system without
    A, B and C is the gain D. `holds` are its states, the torques that wait and those that act at the start; by default
    those of the saved run that the scene continues, else `initial` and 0. Source: K. J. Åström and B. Wittenmark,
    Computer-Controlled Systems (3rd ed. 1997), ch. 2.
    """

    inputs: tuple[Expression, ...]
    a: Matrix
    b: Matrix
    c: Matrix
    d: Matrix
    initial: tuple[float, ...]
    text: str = field(default="", repr=False, compare=False)  # of its file
    holds: tuple[float, ...] = ()
    kind: ClassVar[str] = "state_space"

    @classmethod
    def read(cls, name: str, read: Fields, context: ControlContext) -> Self:
        """Read it from its entry. Raises InputError naming file and key."""
        known = ("joint", "joints", "inputs", "A", "B", "C", "D", "sample_time", "delay", "limit", "initial", "file",
                 "holds")  # fmt: skip
        read.known(*known)
        driven = context.driven
        joints = read_joints(read, driven, driven.joints)
        inputs = context.formulas.several(read, "inputs")
        return cls.of(name, read, joints, inputs, read_limit(read, joints, driven.robot), context)

    @classmethod
    def of(
        cls, name: str, read: Fields, joints: Sequence[RobotJoint], inputs: Sequence[Expression],
        limit: Gain | None, context: ControlContext,
    ) -> Self:  # fmt: skip
        """Read its matrices and times. Raises InputError naming file and key."""
        there, text = read, ""
        if "file" in read:
            path = read.file("file")
            for key in ("A", "B", "C", "D"):
                if key in read:
                    raise read.error(key, f"'{key}' and 'file' exclude each other; remove one of them")
            text = table_text(path)
            try:
                there = Fields(read_yaml(path), str(path))
                there.only(("A", "B", "C", "D", "sample_time"))
            except InputError as error:
                raise read.error("file", str(error)) from None
        n = len(_rows(there, "A"))
        a, b = _matrix(there, "A", n, n), _matrix(there, "B", n, len(inputs))
        c = _matrix(there, "C", len(joints) if n else 0, n)
        d = _matrix(there, "D", len(joints), len(inputs), optional=n > 0)
        timed = there if "sample_time" not in read else read
        if "sample_time" not in timed:
            raise read.error(
                "sample_time",
                "the key 'sample_time' (s) is missing: a state_space controller is discrete; "
                "scipy.signal.cont2discrete or python-control's c2d makes a continuous one discrete",
            )
        sample_time = timed.number("sample_time", "s", positive=True)
        delay = read.number("delay", "s", 0.0, nonnegative=True)
        if delay > MOST_WAITING * sample_time:
            raise read.error("delay", f"expected at most {MOST_WAITING} sample times, found {delay / sample_time:.6g}")
        initial = read.vector("initial", n, "", (0.0,) * n)
        timing = sample_time, delay, context.clock
        found = cls(name, read, tuple(joints), limit, *timing, tuple(inputs), a, b, c, d, initial, text)
        holds = context.held.get(samples_of(name), ())
        width = found.samples.width
        if "holds" in read:
            holds = read.vector("holds", width)
        return replace(found, holds=tuple(holds)) if len(holds) == width else found

    @property
    def states(self) -> int:
        """n."""
        return len(self.a)

    @property
    def held_start(self) -> Sequence[float]:
        """What it holds at the start: what it held at the end of the run that is continued, or ξ_0 and no torques."""
        return self.holds or super().held_start

    @property
    def start(self) -> Sequence[float]:
        """ξ_0."""
        return self.initial

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames in its inputs."""
        return common(self.inputs)

    def torques(self, symbols: Symbols, states: list[casadi.SX]) -> tuple[list[casadi.SX], list[casadi.SX]]:
        """The states after a sample, and the torques before the limit."""
        return self.step(states, [one.value(symbols) for one in self.inputs])

    def step(self, states: list[casadi.SX], inputs: list[casadi.SX]) -> tuple[list[casadi.SX], list[casadi.SX]]:
        """The states after a sample with these inputs, and the torques before the limit."""
        import casadi

        y = casadi.vertcat(*inputs)
        torque = _product(self.d, y)
        if states:
            now = casadi.vertcat(*states)
            torque += _product(self.c, now)
            states = casadi.vertsplit(_product(self.a, now) + _product(self.b, y))
        return states, casadi.vertsplit(torque)


@dataclass(frozen=True)
class FunctionController(Sampled):
    """A Python function (t, q, v) -> the torques at its joints (k,), for prototypes; made by `simulate`."""

    function: Callable[[float, Array, Array], Any] = field(compare=False)
    kind: ClassVar[str] = "function"

    def called(self, t: float, position: Array, velocity: Array) -> Array:
        """The torques at a time (s) of the simulation and a state.

        Raises InputError where the function returns something else.
        """
        expected = f"the torques of {', '.join(joint.name for joint in self.joints)}"
        found = self.function(t + self.clock, position, velocity)
        if isinstance(found, Mapping):
            unknown = [name for name in found if name not in {joint.name for joint in self.joints}]
            if unknown:
                raise InputError(
                    f"controller: '{unknown[0]}' is not one of the joints with motors: expected {expected}"
                )
            found = [found.get(joint.name, 0.0) for joint in self.joints]
        try:
            torques = np.atleast_1d(np.asarray(found, dtype=np.float64))
        except (TypeError, ValueError):
            torques = np.zeros(0)
        if torques.shape != (len(self.joints),) or not np.isfinite(torques).all():
            raise InputError(
                f"controller: at t = {t:.6g} s it returned {format_value(found)}; expected {expected}, finite numbers"
            )
        return torques


def _product(matrix: Matrix, x: casadi.SX) -> casadi.SX:
    import casadi

    return casadi.SX(casadi.sparsify(casadi.DM(np.array(matrix)))) @ x


def _rows(read: Fields, key: str) -> Sequence[Any]:
    given = read.raw(key, ())
    if not isinstance(given, (list, tuple)):
        raise read.error(key, f"expected a list of rows, found {format_value(given)}")
    return given


def _matrix(read: Fields, key: str, rows: int, columns: int, *, optional: bool = False) -> Matrix:
    """Read a matrix. Raises InputError naming file and key."""
    if key not in read and (optional or not rows or not columns):
        return ((0.0,) * columns,) * rows
    size = f"{rows} row{'s' if rows != 1 else ''} of {columns} number{'s' if columns != 1 else ''}"
    if key not in read:
        raise read.error("", f"the key '{key}' is missing: expected {size}")
    given = _rows(read, key)
    if len(given) != rows:
        raise read.error(key, f"expected {size}, found {len(given)} row{'s' if len(given) != 1 else ''}")
    return read.rows(key, columns) if rows and columns else ()
