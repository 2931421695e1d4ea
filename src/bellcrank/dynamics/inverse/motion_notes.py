"""Notes for the reader of inverse dynamics: what of a scene does not count, and where its tables do not match.

Inverse kinematics along a path takes the lengths of the URDF and the configuration, not those that parameters of the
scene set. Where they differ, notes say so.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.elements.clutch import Clutch
from bellcrank.elements.drives import Drive
from bellcrank.elements.dry_friction import DryFriction
from bellcrank.elements.element import table_span
from bellcrank.elements.expression import has_time
from bellcrank.elements.frame_joints import path_frames
from bellcrank.elements.joint_constraints import PrescribedMotion
from bellcrank.elements.joint_forces import Torque
from bellcrank.elements.pin_friction import PinFriction
from bellcrank.robot.model.joints import quaternion_part

if TYPE_CHECKING:
    from bellcrank.dynamics.inverse.mechanism import Mechanism
    from bellcrank.motion.motion import Motion
    from bellcrank.scene.scene import Scene

ELSEWHERE = 1e-6  # m, or of a quaternion: the largest difference between a start and a motion that counts as the same


def path_notes(scene: Scene, names: Iterable[str]) -> list[str]:
    """A sentence for each of the scene's motions with these names whose frame moves along another path than given."""
    entries = scene.config.motions
    changed = changed_lengths(scene)
    return [
        f"motion '{name}' was made from a frame's path with the lengths of the URDF, which the parameters "
        f"{', '.join(changed)} change: the frame moves along another path; write the motion in joint positions"
        for name in dict.fromkeys(names)
        if changed and name in entries and any(path_frames(entries[name], entries))
    ]


def changed_lengths(scene: Scene) -> list[str]:
    """The parameters that place a joint or frame elsewhere than the URDF or the configuration."""
    frames = scene.robot.equations.tree.frames
    found = []
    for name, parameter in scene.parameters.items():
        for frame, what in parameter.places:
            if what < 6:
                now = [*frames[frame].in_parent.translation, *frames[frame].rpy][what]
                if abs(parameter.value - now) > 1e-9 * max(1.0, abs(now)) and name not in found:
                    found.append(name)
    return found


def mechanism_notes(mechanism: Mechanism) -> tuple[str, ...]:
    """A sentence for each torque that acts in addition to a motor, and for each element that is not included."""
    found = [
        f"{force.kind} '{force.name}' of the scene acts on joint '{force.joint.name}' "
        + ("in addition to the motor" if force.actuator else "as a load")
        for force in mechanism.equations.forces
        if isinstance(force, Torque)
    ]
    if mechanism.scene is not None:
        found += [
            f"control '{part.name}' of the scene is not included: the motors provide what the motion and the other "
            f"forces "
            "require"
            for part in mechanism.scene.control
            if not isinstance(part, Drive)
        ]
        if drives := [part.joint.name for part in mechanism.scene.drives]:
            found.append(
                f"model, elastic, rotor_friction, temperatures and servo of actuators ({', '.join(drives)}) act in "
                "simulations only: motors are judged as if joints followed the motion exactly"
            )
        if mechanism.scene.supply is not None:
            found.append("supply acts in simulations only: its bus is judged by 'conditions'")
        if brakes := [
            part.held
            for part in mechanism.scene.forces
            if isinstance(part, DryFriction) and (part.is_braked or isinstance(part, Clutch))
        ]:
            found.append(f"brakes and clutches ({', '.join(brakes)}) are taken as released: the motion is given")
        if pins := [part.held for part in mechanism.scene.forces if isinstance(part, PinFriction)]:
            found.append(f"friction of pins ({', '.join(pins)}) changes its side between the rows of the motion")
        stops = [part.joint.name for part in mechanism.scene.stops_of_joints]
        if stops:
            found.append(f"rigid stops ({', '.join(stops)}) exert no force: the motion is given")
        found += mechanism.scene.replaced_friction()
        found += _clock_notes(mechanism.scene)
    return tuple(found)


def _clock_notes(scene: Scene) -> Iterator[str]:
    """A sentence about what depends on time, where a simulation of the scene starts with another clock than 0."""
    clock = scene.initial.clock
    timed = [force for force in scene.forces if force.source is not None or has_time(force)]
    moving = [f"{force.kind} '{force.name}'" for force in timed]
    moving += [
        f"constraint '{part.name}'"
        for part in scene.constraints
        if not isinstance(part, PrescribedMotion) and has_time(part)
    ]
    if clock and moving:
        yield (
            f"initial.clock, {clock:.6g} s, is not included: {', '.join(moving)} {'is' if len(moving) == 1 else 'are'} "
            "evaluated at the times of the motions, whereas a simulation adds the clock; to size a simulated run, add "
            "the clock to the times of its CSV"
        )


def motion_notes(mechanism: Mechanism, motion: Motion) -> Iterator[str]:
    """A sentence for each table that does not cover a motion, and for each other way in which scene and motion
    differ.
    """
    if mechanism.scene is not None and not mechanism.closed:
        yield from path_notes(mechanism.scene, [motion.name])
    begin, end = float(motion.time[0]), float(motion.time[-1])
    if mechanism.scene is not None:
        yield from _base_notes(mechanism.scene, motion)
        yield from _drive_notes(mechanism.scene, motion)
    for force in mechanism.equations.forces:
        if force.source is None:
            continue
        first, last = table_span(force)
        who = f"{force.kind} '{force.name}': its table"
        if last < end:
            yield (
                f"{who} ends at {last:.6g} s, motion '{motion.name}' at {end:.6g} s; after the table its last value is "
                "used"
            )
        if first > begin:
            yield (
                f"{who} begins at {first:.6g} s, motion '{motion.name}' at {begin:.6g} s; before the table its first "
                "value is used"
            )


def _base_notes(scene: Scene, motion: Motion) -> Iterator[str]:
    """A sentence for each free joint, also a free base, that a motion places elsewhere than the scene's start."""
    posture = scene.initial.posture(scene.robot)
    for name in scene.initial.free:
        joint = scene.robot.joint(name)
        whole, turned = slice(joint.q, joint.q + joint.nq), posture.copy()
        if (part := quaternion_part(joint)) is not None:
            turned[part] *= -1.0  # the same rotation
        first = motion.position[0, whole]
        if min(np.abs(first - posture[whole]).max(), np.abs(first - turned[whole]).max()) > ELSEWHERE:
            yield (
                f"motion '{motion.name}' places joint '{name}' elsewhere than the scene's start (initial, base); the "
                "motion is used, also for the direction of gravity"
            )


def _drive_notes(scene: Scene, motion: Motion) -> Iterator[str]:
    """A sentence for each prescribed motion of the scene that is another motion."""
    for constraint in scene.constraints:
        if isinstance(constraint, PrescribedMotion) and (follows := str(constraint.place.raw("motion"))) != motion.name:
            yield (
                f"constraint '{constraint.name}' of the scene prescribes motion '{follows}'; here its joint follows "
                f"motion '{motion.name}'"
            )
