"""A motion from sampled columns: positions, and velocities and accelerations where they are given.

What is missing is differentiated, separately on each side of a jump; jumps of the acceleration
between samples are detected (acceleration_jumps.py).

A spline across a jump oscillates; splines on both sides of it do not. A jump shows in divided differences: those across
it are many times larger than those beside it, while neighbouring differences of smooth samples are of similar size
(A. Harten et al., Uniformly high order accurate essentially non-oscillatory schemes, J. Comput. Phys. 71, 1987).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from bellcrank.arrays import Array, Indices
from bellcrank.errors import InputError
from bellcrank.motion.generators.waypoints import derivative, interpolate, second_derivatives
from bellcrank.motion.limit_checks import check_size, check_times
from bellcrank.motion.motion import Motion
from bellcrank.motion.sampled.acceleration_jumps import with_jumps
from bellcrank.motion.sampled.file_checks import differences, rounding_noise, rounding_of, typical_noise
from bellcrank.robot.model.joints import JointLike

RISE = 6.0  # times the differences beside it: differences around a jump are larger than this
DIGITS = 2.0**-52  # of the largest number: what numbers of double precision round to
AGREES = 0.05  # of a jump times h²: what a jump found in positions may miss
GOOD = 0.01  # and what leaves no doubt of where it is
NEAR = 12  # samples on either side of a jump that say where it is
LEAST = 1e-4  # of the largest acceleration: smaller jumps are left to the spline
NOISE = 0.01  # of the largest acceleration: more noise of rounding than this makes rows be left out
SPREAD = (6.0, 3.0)  # times rounding / h^order: the noise in accelerations of a spline of positions, velocities
FAR = 4.0  # times rounding: how far the curve may pass a position
UNDETERMINED = 0.02  # of the largest acceleration: by this the curve may exceed the samples' differences
NEGLIGIBLE = 1e-6  # of the largest acceleration of all joints: a smaller one is not looked at
ROUNDINGS = 64.0  # of the samples, whose differences are no acceleration


def positions_differentiated(time: Array, position: Array, rounding: float) -> tuple[Array, Array, list[int]]:
    """Velocity and acceleration (n,) at the samples of a position (n,), which is known to ± `rounding`, and the samples
    after which the acceleration jumps.
    """
    velocity, acceleration = np.zeros_like(position), np.zeros_like(position)
    pieces = _pieces_that_agree(time, position, 2, rounding)
    for piece in pieces:
        velocity[piece], acceleration[piece] = second_derivatives(time[piece], position[piece])
    return velocity, acceleration, [piece.stop - 1 for piece in pieces[:-1]]


def velocity_differentiated(time: Array, velocity: Array, rounding: float) -> Array:
    """Acceleration (n,) at the samples of a velocity (n,), which is known to ± `rounding`."""
    acceleration = np.zeros_like(velocity)
    for piece in _pieces_that_agree(time, velocity, 1, rounding):
        acceleration[piece] = derivative(time[piece], velocity[piece, None])[:, 0]
    return acceleration


def _pieces_that_agree(time: Array, values: Array, order: int, rounding: float) -> list[slice]:
    """The smooth pieces, joined where no jump between them agrees with speeds and positions: samples that are too far
    apart look like jumps, and are taken to be smooth.
    """
    edges = [0, *(piece.stop for piece in smooth_pieces(time, values, order, rounding))]
    for place in range(len(edges) - 2, 0, -1):
        edge = _best_edge(time, values, order, edges[place - 1], edges[place], edges[place + 1])
        edges[place : place + 1] = [] if edge is None else [edge]
    return [slice(a, b) for a, b in pairwise(edges)]


def _best_edge(time: Array, values: Array, order: int, first: int, edge: int, last: int) -> int | None:
    """The first sample after a jump: this one, or a neighbour where rounding hides on which side a sample lies.

    It is the one for which a jump between both sides' accelerations agrees best with speeds and positions there; None
    where none agrees.
    """
    best, least = None, 2.0 * AGREES
    for k in (edge, edge - 1, edge + 1):
        if least < GOOD:
            break
        if k - first < order + 1 or last - k < order + 1:
            continue
        sides = (slice(max(first, k - NEAR), k), slice(k, min(last, k + NEAR)))
        if order == 2:
            (v0, a0), (v1, a1) = (second_derivatives(time[side], values[side]) for side in sides)
        else:
            v0, v1 = (values[side] for side in sides)
            a0, a1 = (derivative(time[side], values[side, None])[:, 0] for side in sides)
        h, jump = time[k] - time[k - 1], a0[-1] - a1[0]
        if jump == 0.0:
            continue
        until = (v1[0] - v0[-1] - a1[0] * h) / jump  # of the step, when the acceleration jumps
        miss = max(-until, until - h, 0.0) / h
        if order == 2:
            place = values[k - 1] + h * v0[-1] + 0.5 * a1[0] * h * h + jump * until * (h - 0.5 * until)
            miss += abs(values[k] - place) / (abs(jump) * h * h)
        if miss < 0.5 * least:  # neighbours only where they are clearly better
            best, least = k, miss
    return best


def smooth_pieces(time: Array, values: Array, order: int, rounding: float) -> list[slice]:
    """Ranges of samples (n,) between jumps of the derivative of this order (1 or 2); no jump lies inside a range.

    Each has at least order + 1 samples, so that it determines that derivative. Where jumps are closer, the largest are
    kept.
    """
    if len(time) < order + 4:
        return [slice(0, len(time))]
    # Rounding by ± q changes a difference over equal steps h by at most 2^width q.
    width = order + 2
    most = 2.0**width * rounding / (float(time[-1] - time[0]) / (len(time) - 1)) ** order
    noise = typical_noise(differences(time, values, width, order), most) / most if most > 0.0 else 0.0
    least = LEAST * np.abs(differences(time, values, order, order)).max(initial=0.0)
    found, open_ranges = [], [slice(0, len(time))]
    while open_ranges:
        piece = open_ranges.pop()
        split = _split(
            time[piece], values[piece], order, least, noise * rounding + DIGITS * float(np.abs(values).max())
        )
        if split is None:
            found.append(piece)
        else:
            open_ranges += [slice(piece.start, piece.start + split), slice(piece.start + split, piece.stop)]
    return sorted(found, key=lambda piece: piece.start)


def _split(time: Array, values: Array, order: int, least: float, rounding: float) -> int | None:
    """Number of samples before the most distinct jump; None where there is none."""
    n, width = len(time), order + 2
    if n < width + 2:
        return None
    difference = np.abs(differences(time, values, width, order))
    span = (time[width:] - time[:-width]) / width
    floor = least + 2.0**width * rounding / span**order
    inside, around = _sliding(difference, width), _sliding(floor, width)  # of all differences across each step
    padded = np.pad(difference, width + 3)
    place = np.arange(n - 1) + 3  # of the difference that ends with a step's first sample
    left, right = padded[place], padded[place + width + 1]
    # At an end there is one side, where a difference may be 0 by chance: look further.
    further = np.maximum.reduce(
        [padded[place - j] for j in (1, 2, 3)] + [padded[place + width + 1 + j] for j in (1, 2)]
    )
    one_sided = (np.arange(n - 1) < width) | (np.arange(n - 1) + width >= n - 1)
    quiet = np.maximum(np.maximum(left, right), np.where(one_sided, further, 0.0))
    score = inside / np.maximum(np.maximum(quiet, around), 1e-300)
    score[:order] = score[n - 1 - order :] = 0.0
    k = int(np.argmax(score))
    if k + width >= n - 1:  # at the end several steps have the same differences across them, and the last has the jump
        k = int(np.flatnonzero(score > 0.5 * score[k])[-1])
    return k + 1 if score[k] > RISE else None


def _sliding(difference: Array, width: int) -> Array:
    """Largest of the differences (m,) across each of the m + width − 1 steps."""
    padded = np.pad(difference, width - 1)
    return np.asarray(np.lib.stride_tricks.sliding_window_view(padded, width).max(axis=1))


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
