"""Peak loads of each joint along a motion, its cycle, and a check that peaks do not rest on interpolation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from bellcrank.dynamics.force_table_breakpoints import force_breaks, force_times
from bellcrank.dynamics.mechanism import coulomb_widths
from bellcrank.motion.motion import Motion
from bellcrank.sizing.finite_checks import refuse_non_finite, root_mean_square
from bellcrank.sizing.joint_loads import JointLoads
from bellcrank.sizing.joint_sizing import Cycle, JointSizing, Peak
from bellcrank.sizing.maxima import Maxima, maxima
from bellcrank.sizing.motion_grid import Grid, grid_along, reversal_times
from bellcrank.sizing.structure_loads import StructureLoad, structure_loads

Array = NDArray[np.float64]
TOLERATED = 0.02  # of the peak: it may exceed the largest torque at the rows by this without a warning
LOWEST = ("min_torque", "lowest_position")  # minima among the peaks; they are found as maxima of the negated series


@dataclass(frozen=True, kw_only=True)
class JointPeaks:
    """The peaks of one joint; `shaft_torque` and `curve_use` are its actuator's, 0 without one or where unknown."""

    max_torque: Peak
    min_torque: Peak
    peak_speed: Peak
    peak_motoring_power: Peak
    peak_regenerating_power: Peak
    shaft_torque: Peak
    curve_use: Peak
    highest_position: Peak
    lowest_position: Peak
    peak_bearing_force: Peak
    peak_tilting_moment: Peak
    largest_inertia: Peak
    sampled_torque: Peak


@dataclass(frozen=True)
class MotionPeaks:
    """The peaks and cycles of all joints along a motion, those of the supply, and the loads in the structure.

    The supply's are None where they are unknown; an open chain has no loads in its structure.
    """

    joints: tuple[JointPeaks, ...]
    cycles: tuple[Cycle, ...]
    supply: Peak | None
    regeneration: Peak | None
    structure: tuple[StructureLoad, ...] = ()


def peaks_along(loads: JointLoads, motion: Motion) -> MotionPeaks:
    """The peaks and cycles along a motion. Raises InputError where a load is not a finite number."""
    mechanism = loads.mechanism
    probes = reversal_times(motion, coulomb_widths(mechanism))
    grid = grid_along(motion, probes, force_breaks(mechanism), loads.nominal_torque)
    values: dict[str, Array] = {}
    largest: dict[str, Maxima] = {}
    for quantities in (lambda *state: loads.history(*state).maximised(), loads.reactions, loads.inertia):
        found, most = maxima(motion, grid, quantities)
        refuse_non_finite(mechanism.robot.name, loads.joint_names, grid.time, found)
        values |= found
        largest |= most
    peaks = {name: _peaks(motion, found, -1.0 if name in LOWEST else 1.0) for name, found in largest.items()}
    [supply], [regeneration] = peaks.pop("supply"), peaks.pop("regeneration")
    peaks["sampled_torque"] = _peaks_at_rows(loads, motion)
    joints = tuple(JointPeaks(**{name: each[k] for name, each in peaks.items()}) for k in range(len(loads.joints)))
    cycles, structure = _cycles(loads, motion, grid, values), structure_loads(mechanism, motion, grid)
    if loads.unknown_supply:
        return MotionPeaks(joints, cycles, None, None, structure)
    return MotionPeaks(joints, cycles, supply, regeneration, structure)


def worst_peaks(each: Sequence[JointPeaks]) -> JointPeaks:
    """The largest of each of a joint's peaks over several motions; the smallest of those that are minima."""
    worst = {}
    for name in (entry.name for entry in fields(JointPeaks)):
        candidates: list[Peak] = [getattr(peaks, name) for peaks in each]
        worst[name] = (min if name in LOWEST else max)(candidates, key=lambda peak: peak.value)
    return JointPeaks(**worst)


def interpolation_warnings(joints: Sequence[JointSizing]) -> list[str]:
    """A sentence for each joint whose peak torque between rows exceeds that at the rows by more than 2 %."""
    found = []
    for joint in joints:
        peak, unit = joint.peaks["peak_torque"], joint.torque_unit
        if joint.peak_torque - joint.sampled_torque > TOLERATED * joint.peak_torque:
            found.append(
                f"joint '{joint.name}': its peak of {joint.peak_torque:.4g} {unit} lies between two rows of motion "
                f"'{peak.motion}' (at {peak.time:.4g} s), where it rests on interpolation; at the rows it is "
                f"{joint.sampled_torque:.4g} {unit}; give more rows, and accelerations where the motion has none"
            )
    return found


def _peaks(motion: Motion, found: Maxima, sign: float) -> list[Peak]:
    """Maxima as peaks, their values times a sign."""
    return [
        Peak(sign * float(value), float(time), motion.name, tuple(map(float, position)))
        for value, time, position in zip(found.value, found.time, motion.at(found.time)[0], strict=True)
    ]


def _peaks_at_rows(loads: JointLoads, motion: Motion) -> list[Peak]:
    """The largest |torque| of each joint at the rows of a motion."""
    low, high = loads.torque_range(
        force_times(motion.time, motion.time[-1]), motion.position, motion.velocity, motion.acceleration
    )
    torque = np.maximum(np.abs(low), np.abs(high))
    rows = torque.argmax(axis=0)
    return [
        Peak(float(torque[row, k]), float(motion.time[row]), motion.name, tuple(map(float, motion.position[row])))
        for k, row in enumerate(rows.tolist())
    ]


def _cycles(loads: JointLoads, motion: Motion, grid: Grid, values: Mapping[str, Array]) -> tuple[Cycle, ...]:
    """RMS torques, mean speeds and energies of each joint, from the values on the grid."""

    def integral(samples: Array) -> Array:
        return np.asarray(grid.weight @ samples)

    torque = np.maximum(np.abs(values["max_torque"]), np.abs(values["min_torque"]))
    rms = root_mean_square(grid.weight, torque, motion.duration)
    shaft = root_mean_square(grid.weight, values["shaft_torque"], motion.duration)
    mean = integral(values["peak_speed"]) / motion.duration
    into, out = integral(values["peak_motoring_power"]), integral(values["peak_regenerating_power"])
    return tuple(
        Cycle(
            motion=motion.name,
            duration=motion.duration,
            rms_torque=float(rms[k]),
            mean_speed=float(mean[k]),
            motoring_energy=float(into[k]),
            regenerated_energy=float(out[k]),
            rms_shaft_torque=float(shaft[k]) if loads.knows_shaft(name) else None,
        )
        for k, name in enumerate(loads.joint_names)
    )
