"""Size a robot's motors over one or several motions: at the joint, at the motor shaft and at the supply.

Torque at a joint is inverse dynamics, τ = M(q) q̈ + C(q, q̇) q̇ + g(q) + friction − the forces of the scene (Ghosal,
lecture 18; dynamics/inverse_dynamics.py), and of a linkage what its motors feel of it (dynamics/closed_chain.py).
Where a joint has a drive, that is the torque at the gear's output: the rotor's inertia counts at the shaft. A mass
tolerance scales each massive link and payload as a whole, mass and inertia together, by one factor of its own within
1 ± tolerance. Torque is linear in these factors, so it changes by at most tolerance · Σ|share of each link|, and that
bound is reached: peaks are exact worst cases, RMS and energies are upper bounds. Reactions and inertias stay nominal.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.actuator import Drive
from bellcrank.dynamics.element_forces import (
    coulomb_widths,
    elements,
    force_breaks,
    mechanism_notes,
    motion_notes,
    parameter_values,
    with_force_rows,
)
from bellcrank.dynamics.mechanism import Mechanism, mechanism_of
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.motion.motion import Motion
from bellcrank.sizing.arguments import drives_of, motions_of, renamed, tolerance_of
from bellcrank.sizing.between import between_warnings, peaks_at_rows
from bellcrank.sizing.finite import refuse_non_finite, refuse_non_finite_line, root_mean_square
from bellcrank.sizing.holding_forces import holding_of
from bellcrank.sizing.loads import Loads
from bellcrank.sizing.massless import massless_motors, singular_joints
from bellcrank.sizing.peaks import Grid, grid_along, maxima, reversal_times
from bellcrank.sizing.result import Cycle, JointSizing, Peak, ShaftSizing, Sizing

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot, RobotJoint
    from bellcrank.scene.scene import Scene

__all__ = ["JointSizing", "Peak", "ShaftSizing", "Sizing", "size"]

Array = NDArray[np.float64]
_SIGNED = {
    "max_torque": 1.0,
    "min_torque": -1.0,
}  # quantities are maximised: the smallest torque is kept negated


def size(
    robot: Robot | Scene | Mechanism,
    motions: Motion | Sequence[Motion],
    drives: Mapping[str, Drive] | None = None,
    mass_tolerance: float = 0.0,
    *,
    allow_massless: Iterable[str] = (),
) -> Sizing:
    """Size every one-degree-of-freedom joint of a robot, or every motor of a Linkage, over one or several motions: the
    worst of them counts.

    With a Scene (or a Linkage of one) all of its forces and parameters count, at the times of each motion; its control
    does not, which a warning says.
    `drives` gives motor and gear by joint name; `mass_tolerance` is a share: with 0.1 each link as
    a whole, its mass and inertia together, is scaled by one factor within 1 ± 0.1. Each motion counts as a cycle
    that repeats, for RMS and mean. A motor that moves nothing with mass is not sized (`Sizing.unsizable` says why)
    unless `allow_massless` names the links that it moves. Raises InputError where a drive names no joint or gives its
    rotor another inertia than the robot has, a motion belongs to another robot, there is no motion, a type is wrong, or
    a load or margin is not a finite number (with joint, quantity, motion and time).
    """
    mass_tolerance = tolerance_of(mass_tolerance)
    motions = renamed(motions_of(motions))
    drives = drives_of(drives)
    mechanism = mechanism_of(robot)
    robot, joints = mechanism.robot, mechanism.motors
    _check(robot, joints, motions, drives)
    motions = [with_force_rows(mechanism, motion) for motion in motions]
    loads = Loads(mechanism, drives, mass_tolerance)
    found: list[dict[str, list[Peak]]] = []
    cycles: list[list[Cycle]] = []
    with np.errstate(all="ignore"):  # what overflows, or is no number, is refused with its place
        for motion in motions:
            try:
                peaks, parts = _size_one(loads, motion)
            except InputError as error:
                raise InputError(f"motion '{motion.name}': {error}") from None
            found.append(peaks)
            cycles.append(parts)
    worst = {
        name: [
            max((peaks[name][k] for peaks in found), key=lambda peak: peak.value) for k in range(len(found[0][name]))
        ]
        for name in found[0]
    }
    with np.errstate(all="ignore"):
        holding = holding_of(mechanism, motions, mass_tolerance)
    lines = tuple(
        _joint_line(
            loads,
            k,
            {name: peaks[k] for name, peaks in worst.items() if name not in ("supply", "regeneration")},
            tuple(parts[k] for parts in cycles),
            motions,
            holding.torque[k],
            holding.position[k],
        )
        for k, _ in enumerate(joints)
    )
    for line in lines:
        refuse_non_finite_line(robot.name, line)
    refused, allowed = massless_motors(mechanism, motions, allow_massless)
    errors = list(robot.findings)
    if not mechanism.closed:  # a loop can give a joint the inertia that its own links do not have
        told = {*refused, *allowed}
        errors += [text for name, text in singular_joints(mechanism).items() if name not in told]
    warnings = [*errors, *robot.inertia_warnings, *allowed.values()]
    warnings += [warning for motion in motions for warning in motion.warnings]
    warnings += mechanism_notes(mechanism)
    warnings += [note for motion in motions for note in motion_notes(mechanism, motion)]
    warnings += [f"drive of joint '{name}': {doubt}" for name, drive in drives.items() for doubt in drive.doubts]
    warnings += between_warnings(lines)
    warnings += holding.notes
    if others := ", ".join(f"'{joint.name}' ({joint.kind})" for joint in robot.joints if joint.nv != 1):
        warnings.append(f"joints with several degrees of freedom have no single motor and are not sized: {others}")
    return Sizing(
        robot.name,
        tuple(motion.name for motion in motions),
        mass_tolerance,
        lines,
        worst["supply"][0],
        worst["regeneration"][0],
        tuple(dict.fromkeys(warnings)),
        tuple(map(float, robot.gravity)),
        tuple((float(payload.mass), payload.frame) for payload in robot.payloads),
        (mechanism, tuple(motions), drives),
        forces=elements(mechanism),
        parameters=parameter_values(mechanism),
        unsizable=tuple(refused.values()),
        urdf_errors=tuple(errors),
        allowed_massless=tuple(allowed),
    )


def _check(
    robot: Robot,
    joints: tuple[RobotJoint, ...],
    motions: list[Motion],
    drives: Mapping[str, Drive],
) -> None:
    if not motions:
        raise InputError(f"sizing of {robot.name}: there is no motion; give at least one")
    if not joints:
        raise InputError(f"sizing of {robot.name}: the robot has no joint that a motor could drive")
    layout = [(joint.name, joint.q, joint.v) for joint in robot.joints]
    for motion in motions:
        if [(joint.name, joint.q, joint.v) for joint in motion.joints] != layout:
            raise InputError(
                f"motion '{motion.name}' is for the joints {', '.join(motion.joint_names)}, "
                f"the robot {robot.name} has {', '.join(joint.name for joint in robot.joints)}"
            )
    known = [joint.name for joint in joints]
    for name in drives:
        if name not in known:
            raise InputError(f"drives of {robot.name}: {unknown_name('joint', name, known)}")
    for joint in joints:
        drive, given = drives.get(joint.name), float(robot.rotor_inertia[joint.v])
        if drive is None or given == 0.0 or math.isclose(given, drive.reflected_inertia, rel_tol=1e-9):
            continue
        unit = "kg" if joint.kind == "prismatic" else "kg m²"
        raise InputError(
            f"sizing of {robot.name}: the rotor inertia of joint '{joint.name}' is given twice, with two values: the "
            f"robot's rotor_inertia is {given:.6g} {unit}, its drive's reflected inertia ratio² · (rotor_inertia + "
            f"gear_inertia) is {drive.reflected_inertia:.6g} {unit}; load the robot without rotor_inertia for this "
            "joint, or with the drive's reflected_inertia"
        )


def _size_one(loads: Loads, motion: Motion) -> tuple[dict[str, list[Peak]], list[Cycle]]:
    mechanism = loads.mechanism
    probes = reversal_times(motion, coulomb_widths(mechanism))
    grid = grid_along(motion, probes, force_breaks(mechanism), loads.nominal)
    values: dict[str, Array] = {}
    largest: dict[str, tuple[Array, Array]] = {}
    for quantities in (loads.forces, loads.reactions, loads.inertia):
        found, most = maxima(motion, grid, quantities)
        names = [joint.name for joint in loads.joints]
        refuse_non_finite(mechanism.robot.name, names, grid.time, found)
        values |= found
        largest |= most
    peaks = {}
    for name, (top, when) in largest.items():
        postures = motion.at(when)[0]
        peaks[name] = [
            Peak(float(value), float(time), motion.name, tuple(map(float, posture)))
            for value, time, posture in zip(top, when, postures, strict=True)
        ]
    peaks["sampled_torque"] = peaks_at_rows(loads, motion)
    return peaks, _cycles(loads, motion, grid, values)


def _cycles(loads: Loads, motion: Motion, grid: Grid, values: Mapping[str, Array]) -> list[Cycle]:
    def integral(samples: Array) -> Array:
        return np.asarray(grid.weight @ samples)

    torque = np.maximum(np.abs(values["max_torque"]), np.abs(values["min_torque"]))
    rms = root_mean_square(grid.weight, torque, motion.duration)
    shaft = root_mean_square(grid.weight, values["shaft_torque"], motion.duration)
    mean = integral(values["peak_speed"]) / motion.duration
    into, out = integral(values["peak_motoring_power"]), integral(values["peak_regenerating_power"])
    return [
        Cycle(
            motion.name,
            motion.duration,
            float(rms[k]),
            float(mean[k]),
            float(into[k]),
            float(out[k]),
            float(shaft[k]) if joint.name in loads.drives else None,
        )
        for k, joint in enumerate(loads.joints)
    ]


def _joint_line(
    loads: Loads,
    k: int,
    worst: dict[str, Peak],
    cycles: tuple[Cycle, ...],
    motions: Sequence[Motion],
    holding: float,
    holding_position: Array,
) -> JointSizing:
    robot, joint = loads.mechanism.robot, loads.joints[k]
    for name in _SIGNED:
        peak = worst[name]
        worst[name] = Peak(_SIGNED[name] * peak.value, peak.time, peak.motion, peak.position)
    worst["peak_torque"] = max((worst["max_torque"], worst["min_torque"]), key=lambda peak: abs(peak.value))
    peak = worst["peak_torque"]
    motion = next(motion for motion in motions if motion.name == peak.motion)
    at, (q, v, _) = np.array([peak.time]), motion.at(np.array([peak.time]))
    rubbing = abs(float(loads.mechanism.friction(at, q, v)[0, k]))
    reach = (-worst.pop("lower").value, worst.pop("upper").value)
    shaft_peak, curve = worst.pop("shaft_torque"), worst.pop("curve_use")
    drive = loads.drives.get(joint.name)
    shaft = (
        None
        if drive is None
        else _shaft(drive, shaft_peak, curve, worst["peak_speed"], cycles, worst["largest_inertia"].value)
    )
    return JointSizing(
        joint.name,
        joint.kind,
        worst,
        cycles,
        rubbing / abs(peak.value) if peak.value else 0.0,
        float(holding),
        tuple(map(float, holding_position)),
        _given(robot.effort_limit[joint.v]),
        _given(robot.velocity_limit[joint.v]),
        reach,
        (_given(robot.lower[joint.q]), _given(robot.upper[joint.q])),
        shaft,
        max(motion.position_noise[joint.q] for motion in motions),
    )


def _shaft(drive: Drive, torque: Peak, curve: Peak, speed: Peak, cycles: tuple[Cycle, ...], load: float) -> ShaftSizing:
    rms = max(cycle.rms_shaft_torque or 0.0 for cycle in cycles)
    turns = Peak(drive.ratio * speed.value, speed.time, speed.motion, speed.position)
    margins = {
        "peak torque": 1.0 - drive.safety_factor * torque.value / drive.peak_torque,
        "rated torque": 1.0 - drive.safety_factor * rms / drive.rated_torque,
        "speed": 1.0 - turns.value / drive.max_speed,
        "torque-speed curve": 1.0 - curve.value,
    }
    ratio = load / drive.reflected_inertia if drive.reflected_inertia > 0.0 else None
    return ShaftSizing(drive, torque, rms, turns, curve, ratio, margins)


def _given(limit: float) -> float | None:
    return float(limit) if np.isfinite(limit) else None
