"""Peak loads of each joint along a motion, its cycle, and whether the rows of a sampled motion determine the peaks: one
that changes where every other row is left out, or that only interpolation makes, is not known.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bellcrank.actuators.actuator import Actuator
from bellcrank.arrays import Array
from bellcrank.dynamics.inverse.input_breakpoints import force_breaks, with_force_rows
from bellcrank.dynamics.inverse.mechanism import Mechanism, coulomb_widths
from bellcrank.motion.motion import Motion
from bellcrank.motion.sampled.sampled_motion import with_every_other_row
from bellcrank.sizing.joint_sizing import Cycle, Peak
from bellcrank.sizing.loads.joint_loads import JointLoads
from bellcrank.sizing.loads.load_checks import refuse_non_finite
from bellcrank.sizing.loads.motion_grid import Grid, grid_along, reversal_times, root_mean_square
from bellcrank.sizing.loads.series_maxima import Maxima, maxima, on_grid
from bellcrank.sizing.loads.structure_loads import StructureLoad, peaks_on_grid, structure_loads

TOLERATED = 0.02  # of a peak: it may exceed that at the rows, and another sampling may change it, by this
NOTHING = 1e-6  # of the largest peak of all joints: smaller ones are not compared
FEW = 12  # rows: fewer do not say whether they are noisy
MORE_ROWS = "give more rows, and accelerations where the motion has none"
LESS_NOISE = "its rows are noisy or have too few digits: filter them, or give accelerations"
LOWEST = ("min_torque", "lowest_position")  # minima among the peaks; they are found as maxima of the negated series


@dataclass(frozen=True)
class MotionPeaks:
    """The peaks and cycles of all joints along a motion, those of the supply, and the loads in the structure.

    Those of each joint are by name, as in `JointSizing.peaks`, with `shaft_torque` and `curve_use` of its actuator (0
    without one or where unknown), `highest_position` and `lowest_position`. The supply's are None where they are
    unknown; an open chain has no loads in its structure. `undetermined` has a sentence for each joint whose peaks the
    rows of the motion do not determine.
    """

    joints: tuple[Mapping[str, Peak], ...]
    cycles: tuple[Cycle, ...]
    supply: Peak | None
    regeneration: Peak | None
    structure: tuple[StructureLoad, ...] = ()
    undetermined: tuple[str, ...] = ()


def peaks_along(loads: JointLoads, motion: Motion) -> MotionPeaks:
    """The peaks and cycles along a motion. Raises InputError where a load is not a finite number."""
    mechanism, grid = loads.mechanism, loads_grid(loads, motion)
    values: dict[str, Array] = {}
    largest: dict[str, Maxima] = {}
    for quantities in (lambda *state: loads.history(*state).maximised(), loads.reactions, loads.inertia):
        found = on_grid(motion, grid, quantities)
        refuse_non_finite(mechanism.robot.name, loads.joint_names, grid.time, found)
        values |= found
        largest |= maxima(motion, grid, found, quantities)
    peaks = {name: _peaks(motion, found, -1.0 if name in LOWEST else 1.0) for name, found in largest.items()}
    [supply], [regeneration] = peaks.pop("supply"), peaks.pop("regeneration")
    size = np.maximum(values["max_torque"], values["min_torque"])
    peaks["sampled_torque"] = peaks_on_grid(
        motion, grid, np.where(np.isin(grid.time, motion.time)[:, None], size, -np.inf)
    )
    joints = tuple(_with_peak_torque({name: each[k] for name, each in peaks.items()}) for k in range(len(loads.joints)))
    cycles, structure = _cycles(loads, motion, grid, values), structure_loads(mechanism, motion, grid)
    doubts = _undetermined(loads, motion, grid, joints)
    if loads.unknown_supply:
        return MotionPeaks(joints, cycles, None, None, structure, doubts)
    return MotionPeaks(joints, cycles, supply, regeneration, structure, doubts)


def loads_grid(loads: JointLoads, motion: Motion) -> Grid:
    """The grid of a motion on which loads are integrated."""
    probes = reversal_times(motion, coulomb_widths(loads.mechanism))
    return grid_along(motion, probes, force_breaks(loads.mechanism), loads.nominal_torque)


def undetermined_peaks(
    mechanism: Mechanism, motions: Sequence[Motion], actuators: Mapping[str, Actuator]
) -> tuple[str, ...]:
    """A sentence for each joint whose peaks the rows of a sampled motion do not determine; actuators are by joint."""
    sampled = [motion for motion in motions if motion.interpolated.any()]
    if not sampled:
        return ()
    names = {joint.name for joint in mechanism.motors}
    loads = JointLoads(mechanism, {name: one for name, one in actuators.items() if name in names}, 0.0)
    with np.errstate(all="ignore"):  # what overflows or is not a number is refused, with its place
        each = [peaks_along(loads, with_force_rows(mechanism, motion)) for motion in sampled]
    return tuple(dict.fromkeys(text for peaks in each for text in peaks.undetermined))


def worst_peaks(each: Sequence[Mapping[str, Peak]]) -> dict[str, Peak]:
    """The largest of each of a joint's peaks over several motions; the smallest of those that are minima."""
    return _with_peak_torque(
        {
            name: (min if name in LOWEST else max)((peaks[name] for peaks in each), key=lambda peak: peak.value)
            for name in each[0]
        }
    )


def _with_peak_torque(peaks: dict[str, Peak]) -> dict[str, Peak]:
    """Peaks of a joint with the one of its signed torques that is larger by magnitude."""
    return peaks | {"peak_torque": max(peaks["max_torque"], peaks["min_torque"], key=lambda peak: abs(peak.value))}


def _peaks(motion: Motion, found: Maxima, sign: float) -> list[Peak]:
    """Maxima as peaks, their values times a sign."""
    return [
        Peak(sign * float(value), float(time), motion.name, tuple(map(float, position)))
        for value, time, position in zip(found.value, found.time, motion.at(found.time)[0], strict=True)
    ]


def _cycles(loads: JointLoads, motion: Motion, grid: Grid, values: Mapping[str, Array]) -> tuple[Cycle, ...]:
    """RMS torques, mean speeds and energies of each joint, from the values on the grid."""

    def integral(samples: Array) -> Array:
        return np.asarray(grid.weight @ samples)

    torque = np.maximum(np.abs(values["max_torque"]), np.abs(values["min_torque"]))
    rms, shaft = (root_mean_square(grid.weight, rows.T, motion.duration) for rows in (torque, values["shaft_torque"]))
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


def _undetermined(
    loads: JointLoads, motion: Motion, grid: Grid, joints: Sequence[Mapping[str, Peak]]
) -> tuple[str, ...]:
    """A sentence for each joint whose peak torque or speed along a motion its rows do not determine to 2 %."""
    if not motion.interpolated.any():
        return ()
    fewer = with_every_other_row(motion)
    if fewer is None:
        return _between_rows(loads, motion, joints)
    inside = np.flatnonzero(grid.weight > 0.0)
    times, forces = grid.time[inside], grid.force_time[inside]
    whole, half = (_sampled(loads, one, times, forces) for one in (motion, fewer))
    changed = np.abs(whole - half) > TOLERATED * whole
    changed &= whole > NOTHING * whole.max(axis=1, initial=0.0, keepdims=True)
    found: dict[str, str] = {}
    for what, k in np.argwhere(changed).tolist():
        joint = loads.joints[k]
        unit = (("N m", "N"), ("rad/s", "m/s"))[what][joint.kind == "prismatic"]
        remedy = LESS_NOISE if any(map(_noisy, motion.acceleration.T)) else MORE_ROWS
        text = (
            f"joint '{joint.name}': its peak {('torque', 'speed')[what]} along motion '{motion.name}' is not known: it "
            f"is {whole[what, k]:.4g} {unit}, and {half[what, k]:.4g} {unit} where every other row is left out; "
            f"{remedy}"
        )
        found.setdefault(joint.name, text)
    return tuple(found.values())


def _noisy(acceleration: Array) -> bool:
    """Whether the second differences of an acceleration at rows (n,) are mostly of alternating sign, as of noise."""
    bend = np.diff(acceleration, 2)
    if len(bend) < FEW:
        return False
    turns = bend[1:] * bend[:-1] < 0.0
    return bool(np.abs(bend[1:][turns]).sum() > 0.5 * np.abs(bend).sum())


def _between_rows(loads: JointLoads, motion: Motion, joints: Sequence[Mapping[str, Peak]]) -> tuple[str, ...]:
    """A sentence for each joint whose peak torque lies where the motion is interpolated and exceeds that at the rows by
    more than 2 %.
    """
    found = []
    for joint, peaks in zip(loads.joints, joints, strict=True):
        peak, sampled = peaks["peak_torque"], peaks["sampled_torque"].value
        row = int(np.clip(np.searchsorted(motion.time, peak.time, side="right") - 1, 0, len(motion) - 2))
        if abs(peak.value) - sampled <= TOLERATED * abs(peak.value) or not motion.interpolated[row]:
            continue
        unit = "N" if joint.kind == "prismatic" else "N m"
        found.append(
            f"joint '{joint.name}': its peak of {abs(peak.value):.4g} {unit} lies between two rows of motion "
            f"'{motion.name}' (at {peak.time:.4g} s), where it rests on interpolation; at the rows it is "
            f"{sampled:.4g} {unit}; {MORE_ROWS}"
        )
    return tuple(found)


def _sampled(loads: JointLoads, motion: Motion, times: Array, forces: Array) -> Array:
    """The largest torques and speeds (2, k) at times (m,)."""
    q, v, a = motion.at(times)
    low, high = loads.torque_range(forces, q, v, a)
    speed = np.abs(loads.moving(v[:, loads.columns])).max(axis=0)
    return np.stack([np.maximum(np.abs(low), np.abs(high)).max(axis=0), speed])
