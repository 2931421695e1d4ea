"""Size the motors of a mechanism over one or several motions: at the joints, at the motor shafts and at the supply.

The torque at a joint follows from inverse dynamics, τ = M(q) q̈ + C(q, q̇) q̇ + g(q) + friction − the scene's forces
(Ghosal, lecture 18; dynamics/inverse/scene_inverse_dynamics.py), that of a closed linkage from its motors' share of it
(dynamics/inverse/closed_inverse_dynamics.py). Where a joint has an actuator, the torque is that at the gear's output,
and the rotor's inertia counts at the shaft.

A mass tolerance scales each massive link and payload as a whole, mass and inertia together, by one factor within
1 ± tolerance. Torque is linear in these factors, so it changes by at most tolerance · Σ|share of each link|, and that
bound is reached: peaks are exact worst cases; RMS torques and energies are upper bounds. Reactions and inertias are
those of the nominal masses.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.coupled_transmission import CoupledTransmission
from bellcrank.dynamics.inverse.input_breakpoints import with_force_rows
from bellcrank.dynamics.inverse.mechanism import Mechanism, applied_forces, parameter_values
from bellcrank.dynamics.inverse.motion_notes import mechanism_notes, motion_notes
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.motion.motion import Motion, require_joints
from bellcrank.sizing.drive_verdicts import DriveJudging
from bellcrank.sizing.holding import holding_torques
from bellcrank.sizing.holding_search import Holding
from bellcrank.sizing.joint_sizing import Cycle, JointSizing, MotorSizing, Peak, ShaftSizing, largest_peak
from bellcrank.sizing.loads.joint_histories import SizingInputs
from bellcrank.sizing.loads.joint_loads import JointLoads, MotorLoads, axis_coordinates
from bellcrank.sizing.loads.load_checks import (
    massless_motors,
    refuse_non_finite_joint,
    refuse_non_finite_motor,
    singular_joints,
)
from bellcrank.sizing.loads.motion_peaks import MotionPeaks, peaks_along, worst_peaks
from bellcrank.sizing.loads.structure_loads import worst_loads
from bellcrank.sizing.result import Sizing

if TYPE_CHECKING:
    from bellcrank.actuators.conditions import Conditions
    from bellcrank.actuators.mount import Mount
    from bellcrank.motion.motion_entry import DutyStep

PEAKS = (
    "max_torque", "min_torque", "peak_speed", "peak_motoring_power", "peak_regenerating_power", "peak_bearing_force",
    "peak_tilting_moment", "largest_inertia", "sampled_torque", "peak_torque",
)  # fmt: skip
PHRASES = {
    "efficiency": "the gear's efficiency",
    "rotor_inertia": "the rotor inertia",
    "gear_inertia": "the gear's inertia",
}


def size_mechanism(
    mechanism: Mechanism,
    motions: Sequence[Motion],
    actuators: Mapping[str, Actuator],
    mass_tolerance: float = 0.0,
    allow_massless: Iterable[str] = (),
    transmissions: Sequence[CoupledTransmission] = (),
    *,
    duty: Sequence[DutyStep] | None = None,
    mounts: Mapping[str, Mount] | None = None,
    conditions: Conditions | None = None,
) -> Sizing:
    """Size every motor of a mechanism over motions of all of its joints; `bellcrank.size` says what is included.

    `actuators` are by joint, those of coupled transmissions by motor; they are judged along the cycle of `duty`, by
    default along each motion as a cycle, when `Sizing.judging` is asked for its verdicts.

    Raises InputError where there is no motion or a motion is of another robot, where an actuator names no joint or
    gives its rotor another inertia than the robot has, and where a load or margin is not a finite number.
    """
    coupled = {motor for one in transmissions for motor in one.motors if motor in actuators}
    at_axes, actuators = actuators, {name: one for name, one in actuators.items() if name not in coupled}
    _check(mechanism, motions, actuators)
    robot = mechanism.robot
    motions = [with_force_rows(mechanism, motion) for motion in motions]
    judging = DriveJudging(
        mechanism=mechanism,
        motions=motions,
        drives=at_axes,
        duty=duty,
        transmissions=transmissions,
        mounts=mounts,
        conditions=conditions,
        mass_tolerance=mass_tolerance,
    )
    loads: JointLoads = JointLoads(mechanism, actuators, mass_tolerance)
    supplied, motors = loads, tuple[MotorSizing, ...]()
    with np.errstate(all="ignore"):  # what overflows or is not a number is refused, with its place
        each = supply = [_peaks_along(loads, motion) for motion in motions]
        if coupled:
            coordinates = axis_coordinates(mechanism, transmissions)
            supplied = MotorLoads(mechanism, at_axes, mass_tolerance, coordinates)
            supply = [_peaks_along(supplied, motion) for motion in motions]
            motors = _motor_sizings(supplied, supply, coupled, judging)
        holding = holding_torques(mechanism, motions, mass_tolerance)
    joints = tuple(_joint_sizing(loads, k, each, motions, holding, judging) for k in range(len(loads.joints)))
    for joint in joints:
        refuse_non_finite_joint(robot.name, joint)
    massless = massless_motors(mechanism, motions, allow_massless)
    errors = list(robot.findings)
    if not mechanism.closed:  # a loop can give a joint the inertia that its own links do not have
        explained = {*massless.refused, *massless.allowed}
        errors += [text for name, text in singular_joints(mechanism).items() if name not in explained]
    warnings = [*errors, *robot.inertia_warnings, *massless.allowed.values()]
    warnings += motion_warnings(mechanism, motions)
    for name, one in at_axes.items():
        what = _what(name, coupled)
        warnings += [f"actuator of {what}: {text}" for text in one.doubts]
    warnings += judging.warnings
    warnings += gear_notes(mechanism, joints, at_axes)
    warnings += [f"the power of all joints together is unknown; {text}" for text in _unknown_supply(supplied, coupled)]
    undetermined = tuple(dict.fromkeys(text for peaks in each for text in peaks.undetermined))
    warnings += undetermined
    warnings += holding.notes
    if others := ", ".join(f"'{joint.name}' ({joint.kind})" for joint in robot.joints if joint.nv != 1):
        warnings.append(f"joints with several degrees of freedom have no single motor and are not sized: {others}")
    return Sizing(
        robot=robot.name,
        motions=tuple(motion.name for motion in motions),
        mass_tolerance=mass_tolerance,
        joints=joints,
        supply_peak=largest_peak(peaks.supply for peaks in supply),
        regeneration_peak=largest_peak(peaks.regeneration for peaks in supply),
        warnings=tuple(dict.fromkeys(warnings)),
        gravity=tuple(map(float, robot.gravity)),
        payloads=tuple((float(payload.mass), payload.frame) for payload in robot.payloads),
        inputs=SizingInputs(mechanism, tuple(motions), actuators),
        forces=applied_forces(mechanism),
        parameters=parameter_values(mechanism),
        unsizable=tuple(massless.refused.values()),
        urdf_errors=tuple(errors),
        allowed_massless=tuple(massless.allowed),
        motors=motors,
        structure=worst_loads([peaks.structure for peaks in each]),
        undetermined=undetermined,
        judging=judging,
    )


def gear_notes(mechanism: Mechanism, joints: Sequence[JointSizing], actuators: Container[str]) -> list[str]:
    """A sentence on motors whose gear the robot file gives, where no actuator replaces them: what they must deliver."""
    file, each = mechanism.robot.file, {joint.name: joint for joint in joints}
    found = [
        f"{motor.name} {each[motor.joint].peak_torque / abs(motor.gear):.4g} {each[motor.joint].torque_unit} and "
        f"{each[motor.joint].peak_speed * abs(motor.gear):.4g} {each[motor.joint].speed_unit} (gear {motor.gear:g})"
        for motor in (() if file is None else file.motors)
        if motor.gear not in (0.0, 1.0) and motor.joint in each and motor.joint not in actuators
    ]
    if not found:
        return []
    return [
        "torques and speeds are those of the joints; the robot file gives gears, behind which the motors' peaks are, "
        f"without losses: {', '.join(found)}"
    ]


def motion_warnings(mechanism: Mechanism, motions: Sequence[Motion]) -> list[str]:
    """Sentences about the motions, and about what of a scene is not included."""
    found = [warning for motion in motions for warning in motion.warnings]
    found += mechanism_notes(mechanism)
    return found + [note for motion in motions for note in motion_notes(mechanism, motion)]


def _peaks_along(loads: JointLoads, motion: Motion) -> MotionPeaks:
    try:
        return peaks_along(loads, motion)
    except InputError as error:
        raise InputError(f"motion '{motion.name}': {error}") from None


def _check(mechanism: Mechanism, motions: Sequence[Motion], actuators: Mapping[str, Actuator]) -> None:
    """Refuse motions and actuators that are not the mechanism's (InputError)."""
    robot, joints = mechanism.robot, mechanism.motors
    if not motions:
        raise InputError(f"sizing of {robot.name}: there is no motion; give at least one")
    if not joints:
        raise InputError(f"sizing of {robot.name}: the robot has no joint that a motor could drive")
    for motion in motions:
        require_joints(motion, robot)
    known = [joint.name for joint in joints]
    for name in actuators:
        if name not in known:
            raise InputError(f"actuators of {robot.name}: {unknown_name('joint', name, known)}")
    for joint in joints:
        actuator, given = actuators.get(joint.name), float(robot.rotor_inertia[joint.v])
        if actuator is None or given == 0.0 or math.isclose(given, actuator.known_inertia, rel_tol=1e-9):
            continue
        unit = "kg" if joint.kind == "prismatic" else "kg m²"
        raise InputError(
            f"sizing of {robot.name}: the rotor inertia of joint '{joint.name}' is given twice, with two values: the "
            f"robot's rotor_inertia is {given:.6g} {unit}, its actuator's reflected inertia ratio² · (rotor_inertia + "
            f"gear_inertia) is {actuator.known_inertia:.6g} {unit}; load the robot without rotor_inertia for this "
            "joint, or with the actuator's reflected_inertia"
        )


def _joint_sizing(
    loads: JointLoads,
    k: int,
    each: Sequence[MotionPeaks],
    motions: Sequence[Motion],
    holding: Holding,
    judging: DriveJudging,
) -> JointSizing:
    """The sizing of the k-th joint from its peaks along each motion."""
    robot, joint = loads.mechanism.robot, loads.joints[k]
    worst, cycles = worst_peaks([peaks.joints[k] for peaks in each]), tuple(peaks.cycles[k] for peaks in each)
    actuator = loads.actuators.get(joint.name)
    return JointSizing(
        name=joint.name,
        kind=joint.kind,
        peaks={name: worst[name] for name in PEAKS},
        cycles=cycles,
        friction_share=_friction_share(loads, k, worst["peak_torque"], motions),
        holding_torque=float(holding.torque[k]),
        holding_position=tuple(map(float, holding.position[k])),
        effort_limit=_given(robot.effort_limit[joint.v]),
        velocity_limit=_given(robot.velocity_limit[joint.v]),
        position_range=(worst["lowest_position"].value, worst["highest_position"].value),
        position_limits=(_given(robot.lower[joint.q]), _given(robot.upper[joint.q])),
        shaft=None if actuator is None else _shaft_sizing(actuator, worst, cycles, joint.name, judging),
        position_noise=max(motion.position_noise[joint.q] for motion in motions),
    )


def _motor_sizings(
    loads: MotorLoads, each: Sequence[MotionPeaks], names: Container[str], judging: DriveJudging
) -> tuple[MotorSizing, ...]:
    """The sizing of motors of coupled transmissions from the peaks at their axes along each motion."""
    found = []
    for k, name in enumerate(loads.joint_names):
        if name not in names:
            continue
        worst, cycles = worst_peaks([peaks.joints[k] for peaks in each]), tuple(peaks.cycles[k] for peaks in each)
        motor = MotorSizing(
            name=name,
            joints=loads.coordinates.joints[k],
            peak_torque=worst["peak_torque"],
            peak_speed=worst["peak_speed"],
            rms_torque=max(cycle.rms_torque for cycle in cycles),
            shaft=_shaft_sizing(loads.actuators[name], worst, cycles, name, judging),
        )
        refuse_non_finite_motor(loads.mechanism.robot.name, motor)
        found.append(motor)
    return tuple(found)


def _friction_share(loads: JointLoads, k: int, peak: Peak, motions: Sequence[Motion]) -> float:
    """Share of a peak torque of the k-th joint that overcomes friction."""
    motion = next(motion for motion in motions if motion.name == peak.motion)
    time = np.array([peak.time])
    q, v, _ = motion.at(time)
    friction = abs(float(loads.mechanism.friction(time, q, v)[0, k]))
    return friction / abs(peak.value) if peak.value else 0.0


def _shaft_sizing(
    actuator: Actuator, peaks: Mapping[str, Peak], cycles: Sequence[Cycle], axis: str, judging: DriveJudging
) -> ShaftSizing:
    """What the motor's shaft delivers."""
    speed, known = peaks["peak_speed"], not actuator.unknown_of_torque
    reflected = actuator.reflected_inertia
    return ShaftSizing(
        actuator=actuator,
        peak_torque=peaks["shaft_torque"] if known else None,
        rms_torque=max(cycle.rms_shaft_torque or 0.0 for cycle in cycles) if known else None,
        peak_speed=Peak(actuator.ratio * speed.value, speed.time, speed.motion, speed.position),
        curve_use=peaks["curve_use"] if known and actuator.has_limits else None,
        inertia_ratio=peaks["largest_inertia"].value / reflected if reflected else None,
        axis=axis,
        judging=judging,
    )


def _unknown_supply(loads: JointLoads, coupled: Container[str]) -> list[str]:
    """A clause for each actuator whose power from the supply is unknown."""
    return [
        f"not stated of the actuator of {_what(name, coupled)}: {', '.join(PHRASES.get(one, one) for one in missing)}"
        for name, missing in loads.unknown_supply.items()
    ]


def _what(name: str, coupled: Container[str]) -> str:
    """The joint or the motor of a coupled transmission, in words."""
    return f"{'motor' if name in coupled else 'joint'} '{name}'"


def _given(limit: float) -> float | None:
    return float(limit) if np.isfinite(limit) else None
