"""The servo of a drive as a discrete linear system of one's own (sampled_controllers.py), by the keys of `state_space`.

Its inputs y are formulas, or names of what the drive knows (`INPUTS`), with the ratio N of the gear:

    error               q_r − position, rad or m, where position is φ/N, or that of the joint (encoder: load)
    reference, reference_velocity, reference_acceleration      q_r, q̇_r, q̈_r
    rotor_position, rotor_velocity                             φ (rad), ω (rad/s)
    current, d_current                                         i, or i_q and i_d of model dq, A

Its outputs are the torque (N m at the rotor) of model torque, the voltage of dc, or the voltages of q and d of dq (V).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Self

from bellcrank.config.fields import Fields
from bellcrank.elements.controller import ControlContext
from bellcrank.elements.expression import Expression
from bellcrank.elements.held_inputs import HeldSource
from bellcrank.elements.sampled_controllers import Instants, StateSpace
from bellcrank.elements.servos import Servo
from bellcrank.robot.robot import RobotJoint

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.drives import Drive
    from bellcrank.elements.symbols import Symbols

KEYS: Final = ("inputs", "A", "B", "C", "D", "sample_time", "delay", "initial", "file", "holds")
INPUTS: Final = ("error", "reference", "reference_velocity", "reference_acceleration", "rotor_position",
                 "rotor_velocity", "current", "d_current")  # fmt: skip
CURRENTS: Final = {"torque": (), "dc": ("current",), "dq": ("current", "d_current")}  # by model


@dataclass(frozen=True)
class StateSpaceServo(Servo):
    """A discrete linear system between what a drive knows and its command. `inputs` are names or formulas."""

    law: StateSpace
    inputs: tuple[str | Expression, ...]

    @classmethod
    def read(cls, read: Fields, joint: RobotJoint, model: str, follows: Servo, context: ControlContext) -> Self:
        """Read it from the entry `state_space`. Raises InputError naming file and key."""
        read.only(KEYS)
        given = read.raw("inputs", ())
        if not isinstance(given, (list, tuple)) or not given:
            raise read.error("inputs", f"expected a list of formulas and of {', '.join(INPUTS)}, found {given!r}")
        inputs: list[str | Expression] = []
        for one in given:
            if one in ("current", "d_current") and one not in CURRENTS[model]:
                raise read.error("inputs", f"model: {model} has no '{one}'")
            inputs.append(one if one in INPUTS else context.formulas.parsed(read, "inputs", one))
        outputs = 2 if model == "dq" else 1
        zero = context.formulas.parsed(read, "inputs", 0.0)
        law = StateSpace.of(
            f"drive_{joint.name}", read, (joint,) * outputs, (zero,) * len(inputs), None, context
        )  # fmt: skip
        read.done()
        return cls(follows.motion, follows.place, follows.target, follows.encoder, law, tuple(inputs))

    def held(self, name: str) -> HeldSource | None:
        """Its states, and the commands that wait and act."""
        return self.law.samples

    @property
    def instants(self) -> tuple[Instants, ...]:
        """When it samples, and where its delay is no multiple of the sample time, when a command acts."""
        return self.law.instants

    def update(self, instant: int, drive: Drive, symbols: Symbols) -> casadi.SX:
        """What it holds after one of its instants."""
        return self.law.after(instant, symbols, lambda states: self.law.step(states, self._measured(drive, symbols)))

    def command(self, drive: Drive, symbols: Symbols) -> list[casadi.SX]:
        """The torque (N m) or the voltages (V) that act, before limits."""
        held, count = symbols.signal(self.law.samples), len(self.law.joints)
        factor = 1.0 if symbols.additions is None else symbols.additions.factor[drive.name]
        return [factor * held[held.numel() - count + k] for k in range(count)]

    def error_at(self, drive: Drive, symbols: Symbols) -> casadi.SX:
        """The error of the position."""
        return self._known(drive, symbols)["error"]

    def _known(self, drive: Drive, symbols: Symbols) -> dict[str, casadi.SX]:
        """What the drive knows, by the names of `INPUTS`."""
        (angle, speed), (place, rate, acceleration) = drive.rotor(symbols), self.wanted(drive, symbols)
        position = angle / drive.gear["ratio"] if self.encoder == "motor" else symbols.joint(drive.joint).position
        currents = drive.currents(symbols) if drive.model != "torque" else ()
        values = (place - position, place, rate, acceleration, angle, speed, *currents)
        return dict(zip(INPUTS, values, strict=False))

    def _measured(self, drive: Drive, symbols: Symbols) -> list[casadi.SX]:
        known = self._known(drive, symbols)
        return [known[one] if isinstance(one, str) else one.value(symbols) for one in self.inputs]

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames in its formulas."""
        return tuple(name for one in self.inputs if isinstance(one, Expression) for name in one.frames)
