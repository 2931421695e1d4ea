"""A motion from sampled columns: positions, and velocities and accelerations where they are given.

What is missing is differentiated, separately on each side of a jump (differentiation.py); jumps of the acceleration
between samples are detected (acceleration_jumps.py).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from bellcrank.arrays import Array, Indices
from bellcrank.errors import InputError
from bellcrank.motion.generators.waypoints import interpolate
from bellcrank.motion.magnitude_limits import check_size, check_times
from bellcrank.motion.motion import Motion
from bellcrank.motion.sampled.acceleration_jumps import with_jumps
from bellcrank.motion.sampled.differentiation import positions_differentiated, velocity_differentiated
from bellcrank.motion.sampled.file_precision import differences, rounding_noise, rounding_of
from bellcrank.robot.model.joints import JointLike

NOISE = 0.01  # of the largest acceleration: more noise of rounding than this makes rows be left out
SPREAD = (6.0, 3.0)  # times rounding / h^order: the noise in accelerations of a spline of positions, velocities
FAR = 4.0  # times rounding: how far the curve may pass a position
UNDETERMINED = 0.02  # of the largest acceleration: by this the curve may exceed the samples' differences
NEGLIGIBLE = 1e-6  # of the largest acceleration of all joints: a smaller one is not looked at
ROUNDINGS = 64.0  # of the samples, whose differences are no acceleration


def sampled_motion(
    joints: tuple[JointLike, ...],
    time: Array,
    position: Array,
    velocity: Array | None,
    acceleration: Array | None,
    name: str,
) -> Motion:
    """The motion of these columns (n,), (n, nq), (n, nv), (n, nv), in s, rad or m. Raises InputError.

    Rows of one time mark a known jump. Where numbers are rounded so much that differences between neighbouring rows are
    mostly noise, only rows further apart are differentiated, and a note says so.
    """
    check_times(f"motion '{name}'", time)
    for order, (what, values) in enumerate(
        (("position", position), ("velocity", velocity), ("acceleration", acceleration))
    ):
        if values is not None:
            check_size(f"motion '{name}'", what, values, order)
    single = [joint for joint in joints if joint.nq == 1]
    rounding = rounding_of([position[:, joint.q] for joint in single])
    if velocity is not None and acceleration is not None:
        return with_jumps(Motion(joints, time, position, velocity, acceleration, name), rounding)
    if len(single) == len(joints) and np.all(np.diff(time) > 0.0):
        values, order, rough = (
            (position, 2, rounding) if velocity is None else (velocity, 1, rounding_of([*velocity.T]))
        )
        spacing = _least_spacing(time, values, order, rough)
        while spacing > 1.5 * float(np.median(np.diff(time))):
            keep = _kept(time, spacing)
            thin = _completed(
                joints, time[keep], position[keep], None if velocity is None else velocity[keep], name, rounding
            )
            far = float(np.abs(thin.at(time)[0] - position).max())
            if far <= FAR * rounding:
                what = ("positions", "velocities")[2 - order]
                note = (
                    f"motion '{name}': its {what} are rounded to {2.0 * rough:.3g}, too much for accelerations over "
                    f"steps of {np.median(np.diff(time)):.3g} s; they were taken over steps of {spacing:.3g} s, and "
                    f"the curve passes all positions within {far:.2g} (rad or m)"
                )
                return _filled(replace(thin, notes=(*thin.notes, note)), time)
            spacing *= 0.7
    return _completed(joints, time, position, velocity, name, rounding)


def _least_spacing(time: Array, values: Array, order: int, rounding: float) -> float:
    """The time between samples, s, from which on rounding (± rounding) puts less than NOISE into accelerations; 0.0
    where it does so nowhere.
    """
    spacing = 0.0
    for column in values.T:
        if not rounding_noise(time, column, order, rounding):
            continue
        wanted = 0.0
        for _ in range(6):  # the largest acceleration is known once the noise is out of it
            keep = _kept(time, wanted)
            most = np.abs(differences(time[keep], column[keep], order, order)).max(initial=0.0)
            wanted = (SPREAD[2 - order] * rounding / (NOISE * most)) ** (1.0 / order) if most > 0.0 else 0.0
            wanted = min(wanted, (time[-1] - time[0]) / 12.0)
        spacing = max(spacing, wanted)
    return spacing


def _kept(time: Array, spacing: float) -> Indices:
    """Samples that lie at least this far apart, the first and the last among them."""
    keep = [0]
    for k in range(1, len(time) - 1):
        if time[k] - time[keep[-1]] >= spacing * (1.0 - 1e-9) and time[-1] - time[k] >= 0.5 * spacing:
            keep.append(k)
    return np.array([*keep, len(time) - 1], dtype=np.intp)


def _filled(motion: Motion, time: Array) -> Motion:
    """The same motion with rows at these times too."""
    more = np.setdiff1d(time, motion.time)
    place = np.searchsorted(motion.time, more)
    q, v, a = motion.at(more)
    return replace(
        motion,
        time=np.insert(motion.time, place, more),
        position=np.insert(motion.position, place, q, axis=0),
        velocity=np.insert(motion.velocity, place, v, axis=0),
        acceleration=np.insert(motion.acceleration, place, a, axis=0),
    )


def _completed(
    joints: tuple[JointLike, ...], time: Array, position: Array, velocity: Array | None, name: str, rounding: float
) -> Motion:
    """With the accelerations, and where they are missing the velocities too, by differentiating."""
    edges = [0, *(np.flatnonzero(np.diff(time) == 0.0) + 1).tolist(), len(time)]
    given = velocity is not None
    speed = np.zeros((len(time), sum(joint.nv for joint in joints))) if velocity is None else velocity
    acceleration = np.zeros_like(speed)
    steps: dict[int, list[int]] = {joint.v: [] for joint in joints if joint.nv == 1}
    rough = rounding_of(list(speed.T)) if given else rounding
    for rows in (slice(a, b) for a, b in pairwise(edges)):
        knots = time[rows]
        if len(knots) < 2:
            continue  # refused by Motion
        if given:
            for column in range(speed.shape[1]):
                acceleration[rows, column] = velocity_differentiated(knots, speed[rows, column], rough)
            continue
        if any(joint.nv != 1 for joint in joints):
            _, speed[rows], acceleration[rows] = interpolate(joints, knots, position[rows], knots, rest=False)
        for joint in joints:
            if joint.nv == 1:
                v, a, breaks = positions_differentiated(knots, position[rows, joint.q], rounding)
                speed[rows, joint.v], acceleration[rows, joint.v] = v, a
                steps[joint.v] += [rows.start + k for k in breaks]
    motion = with_jumps(Motion(joints, time, position, speed, acceleration, name), rounding, None if given else steps)
    return replace(
        motion, notes=_undetermined(motion, time, position if velocity is None else velocity, 1 if given else 2)
    )


def _undetermined(motion: Motion, time: Array, values: Array, order: int) -> tuple[str, ...]:
    """A sentence for each joint whose acceleration exceeds the differences of its samples, which are means of it, and
    so is not determined by them.
    """
    edges = [0, *(np.flatnonzero(np.diff(time) == 0.0) + 1).tolist(), len(time)]
    parts = np.linspace(0.0, 1.0, 9)[1:-1]
    between = (motion.time[:-1, None] + np.diff(motion.time)[:, None] * parts).ravel()
    acceleration = np.concatenate([motion.acceleration, motion.at(between)[2]])
    times = np.concatenate([motion.time, between])
    notes = []
    spacing = np.diff(time)
    least = spacing[spacing > 0.0].min(initial=np.inf)
    largest = np.abs(acceleration).max(initial=0.0)
    for joint in motion.joints:
        if joint.nv != 1:
            continue
        given = np.abs(values[:, joint.q if order == 2 else joint.v]).max(initial=0.0)
        nothing = max(1e-9, NEGLIGIBLE * largest, ROUNDINGS * float(np.spacing(given)) / least**order)
        known = 0.0
        for rows in (slice(a, b) for a, b in pairwise(edges)):
            if rows.stop - rows.start > order:
                mean = differences(time[rows], values[rows, joint.q if order == 2 else joint.v], order, order)
                ends = [2.0 * mean[0] - mean[1], 2.0 * mean[-1] - mean[-2]] if len(mean) > 1 else []
                known = max(known, float(np.abs([*mean, *ends]).max()))
        size = np.abs(acceleration[:, joint.v])
        if size.max() > (1.0 + UNDETERMINED) * known + nothing:
            unit = "m/s²" if joint.kind == "prismatic" else "rad/s²"
            what = "positions" if order == 2 else "velocities"
            notes.append(
                f"motion '{motion.name}': its rows are too far apart, or too noisy, to determine the acceleration of "
                f"joint '{joint.name}': differences of the {what} reach {known:.4g} {unit}, the curve through them "
                f"{size.max():.4g} {unit} at {times[size.argmax()]:.4g} s; give accelerations, or more rows"
            )
    return tuple(notes)


def with_every_other_row(motion: Motion) -> Motion | None:
    """The motion with every other one of its interpolated rows left out, accelerations that were found by
    differentiating found anew; both rows of a jump, and the ends, are kept. None where no row can be left out.
    """
    step, free = np.diff(motion.time), motion.interpolated
    inner = np.zeros(len(motion), dtype=bool)
    inner[1:-1] = free[1:] & free[:-1] & (step[1:] > 0.0) & (step[:-1] > 0.0)
    runs = np.cumsum(inner) - np.maximum.accumulate(np.where(inner, 0, np.cumsum(inner)))  # place in their run
    keep = runs % 2 == 0
    if keep.all():
        return None
    rows = motion.time[keep], motion.position[keep], motion.velocity[keep], motion.acceleration[keep]
    if not motion.derived_from:
        time, position, speed, acceleration = rows
        return replace(motion, time=time, position=position, velocity=speed, acceleration=acceleration)
    velocity = None if motion.derived_from == "positions" else rows[2]
    try:
        found = sampled_motion(tuple(motion.joints), rows[0], rows[1], velocity, None, motion.name)
    except InputError:
        return None
    return replace(found, derived_from=motion.derived_from)
