"""Reads the servo of a drive: a cascade, a state space, or a formula of torque or voltage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final, Self

from bellcrank.config.fields import Fields
from bellcrank.elements.controller import ControlContext, all_joints, read_motion_name
from bellcrank.elements.element import NONNEGATIVE, HeldSource, joint_unit, number
from bellcrank.elements.expression import Expression
from bellcrank.elements.sampled_controllers import MOST_WAITING, Instants, StateSpace, samples_of
from bellcrank.elements.servos import LOOPS, Cascade, Servo
from bellcrank.elements.signals import motion_source
from bellcrank.robot.robot import RobotJoint

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.drives import Drive
    from bellcrank.elements.symbols import Symbols


# ---- The servo of a drive as a discrete linear system of its own (sampled_controllers.py): the keys of `state_space`.

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


ENCODERS: Final = ("motor", "load")
COMMANDS: Final = {"torque": ("torque", "N m"), "dc": ("voltage", "V")}  # by model
LONGEST: Final = 1e3  # s
SHORTEST: Final = 1e-7  # s: no servo samples faster, and a run of millions of samples would not end


def read_servo(
    entry: Fields, joint: RobotJoint, model: str, context: ControlContext
) -> tuple[Servo | None, Expression | None]:
    """Read `servo`: a cascade, or a formula of torque or voltage. Raises InputError naming file and key."""
    read = entry.mapping("servo")
    name, unit = COMMANDS.get(model, ("", ""))
    read.known("torque", "voltage")
    if name and ("torque" in read or "voltage" in read):
        read.only((name,))
        return None, context.formulas.read(read, name, unit)
    if "state_space" in read:
        read.only(("motion", "target", "encoder", "state_space"))
        follows = _reference(read, joint, context)
        found = StateSpaceServo.read(read.mapping("state_space"), joint, model, follows, context)
        read.done()
        return found, None
    read.only(("motion", "target", *LOOPS, "gains", "feedforward", "encoder", "sample_time", "delay", "resolution"))
    follows = _reference(read, joint, context)
    automatic = "gains" in read and read.choice("gains", ("auto",)) == "auto"
    loops = ("position", "speed") if model == "torque" else ("position", "speed", "current")
    if model == "torque" and "current" in read:
        raise read.error("current", "model: torque has no current; write model: dc, or remove 'current'")
    if automatic:
        for loop in loops:
            if loop in read:
                raise read.error(loop, f"'gains: auto' finds the gains of '{loop}'; remove one of the two")
        position, speed, current = ({key: 1.0 for key in LOOPS[k]} if k in loops else {} for k in LOOPS)
    else:
        position, speed = _gains(read, "position"), _gains(read, "speed", optional=("ti",))
        current = _gains(read, "current") if "current" in loops else {}
    ahead = read.mapping("feedforward", {})
    ahead.only(("speed", "torque"))
    shares = {key: number(ahead, key, "", 1.0 if key == "speed" else 0.0, NONNEGATIVE) for key in ("speed", "torque")}
    if shares["torque"] and (follows.motion is None or any(j.nv != 1 for j in context.driven.robot.joints)):
        raise ahead.error("torque", "feed-forward of torque requires a 'motion' of a robot without free or ball joints")
    ahead.done()
    samples, delay, resolution = _samples(read, model)
    if automatic and {*samples} != {*loops}:
        raise read.error("gains", "'gains: auto' requires a 'sample_time' of all loops, which bounds the gains")
    read.done()
    holds = tuple(context.held.get(samples_of(f"drive_{joint.name}"), ()))
    return Cascade(
        motion=follows.motion,
        place=follows.place,
        target=follows.target,
        encoder=follows.encoder,
        position=position,
        speed=speed,
        current=current,
        feedforward=shares,
        samples=samples,
        delay=delay,
        resolution=resolution,
        clock=context.clock,
        holds=holds,
        gains="auto" if automatic else "given",
        axes=2 if model == "dq" else 1,
    ), None


def _reference(read: Fields, joint: RobotJoint, context: ControlContext) -> Servo:
    """What a servo follows, and where it measures. Raises InputError."""
    if ("target" in read) == ("motion" in read):
        found = "both" if "target" in read else "neither"
        raise read.error("target", f"expected a constant 'target' or the name of a 'motion', found {found}")
    joints = all_joints(context.driven.robot)
    source, target = None, 0.0
    if "motion" in read:
        motion = read_motion_name(read, context.motions)
        source = motion_source(motion, partial(context.motion_of, motion), joints, 2)
    else:
        target = read.number("target", joint_unit(joint, "position"))
    place = [each.name for each in joints].index(joint.name)
    return Servo(source, place, target, read.choice("encoder", ENCODERS, "motor"))


def _samples(read: Fields, model: str) -> tuple[dict[str, float], float, float]:
    """The sample times of the sampled loops, the delay and the encoder's resolution. Raises InputError."""
    loops = tuple(loop for loop in LOOPS if model != "torque" or loop != "current")
    if isinstance(read.raw("sample_time", None), Mapping):
        each = read.mapping("sample_time")
        each.only(loops)
        given = {loop: number(each, loop, "s", 0.0, NONNEGATIVE) for loop in loops}
        each.done()
    else:
        whole = number(read, "sample_time", "s", 0.0, NONNEGATIVE)
        given = dict.fromkeys(loops, whole)
    samples = {loop: period for loop, period in given.items() if period > 0.0}
    if odd := [period for period in samples.values() if not SHORTEST <= period <= LONGEST]:
        raise read.error("sample_time", f"expected 0, or {SHORTEST:g} to {LONGEST:g} s, found {odd[0]:g} s")
    delay = number(read, "delay", "s", 0.0, NONNEGATIVE)
    resolution = number(read, "resolution", "rad", 0.0, NONNEGATIVE)
    if delay and not samples:
        raise read.error("delay", "a delay belongs to a sampled servo; give 'sample_time'")
    if resolution and not {"position", "speed"} <= {*samples}:
        raise read.error("resolution", "an encoder with a resolution is sampled; give 'sample_time'")
    if samples and delay > MOST_WAITING * (least := list(samples.values())[-1]):
        raise read.error("delay", f"expected at most {MOST_WAITING} sample times, found {delay / least:.6g}")
    return samples, delay, resolution


def _gains(read: Fields, loop: str, optional: tuple[str, ...] = ()) -> dict[str, float]:
    own = read.mapping(loop)
    own.only(tuple(LOOPS[loop]))
    found = {
        key: number(own, key, unit, bound=bound)
        for key, (unit, bound) in LOOPS[loop].items()
        if key in own or key not in optional
    }
    own.done()
    return found
