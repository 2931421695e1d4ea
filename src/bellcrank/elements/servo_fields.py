"""Reads the servo of a drive: a cascade, a state space, or a formula of torque or voltage."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Final

from bellcrank.config.fields import Fields
from bellcrank.elements.controller import ControlContext
from bellcrank.elements.controller_fields import all_joints, read_motion_name
from bellcrank.elements.element import NONNEGATIVE, joint_unit, number
from bellcrank.elements.expression import Expression
from bellcrank.elements.sampled_controllers import MOST_WAITING, samples_of
from bellcrank.elements.servos import LOOPS, Cascade, Servo
from bellcrank.elements.signals import motion_source
from bellcrank.elements.state_space_servo import StateSpaceServo
from bellcrank.robot.robot import RobotJoint

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
