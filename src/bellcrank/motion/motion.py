"""A motion: positions, velocities and accelerations of a robot's joints over time, exact at its samples; and joining
motions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.cached_values import Portable, cached_property
from bellcrank.errors import InputError
from bellcrank.motion.coordinates import continuous, from_rates, rates, sizes, velocity_labels
from bellcrank.motion.generators.closed_form import NEXT, ClosedForm, Side, States, covering
from bellcrank.motion.limit_checks import check_size, check_times
from bellcrank.motion.sampled.quintic_splines import quintic
from bellcrank.robot.model.joints import JointLike, RobotLike, unit_vector

POSITION_GAP = 1e-6  # rad or m: two rows of one time, or two joined motions, may differ by this much
AT_REST = 1e-6  # of the motion's largest speed: slower than this counts as rest
NOISE = 1e-2  # of the motion's largest speed: so much may be unknown of a speed that counts as rest


@dataclass(frozen=True, eq=False)
class Motion(Portable):
    """Joint motion over time: rows of time, position, velocity and acceleration, finite, in order of time.

    A time that occurs twice marks a jump of acceleration: the two rows are its limits from before and from after, with
    the same position. The arrays are read-only.

    Attributes:
        joints: The robot's joints, which say which column belongs to which joint.
        time: Times (n,), s, n >= 2.
        position: Positions (n, nq), rad or m.
        velocity: Velocities (n, nv), rad/s or m/s.
        acceleration: Accelerations (n, nv), rad/s² or m/s².
        name: Name in messages and plots.
        notes: Warnings from the function that made the motion.
        position_noise: How much is unknown of positions (nq,) that were read from a file with few digits.
        speed_noise: The same for velocities (nv,).
        forms: Closed forms of stretches of the motion, in order of time, of which the rows are samples; elsewhere the
            motion is interpolated between its rows. Those with which the rows do not agree are left out.
        derived_from: "positions" or "velocities", where the accelerations were found by differentiating these.

    Raises:
        InputError: The data are not a motion.

    Example:
        >>> import bellcrank as bc
        >>> arm = bc.load_robot("planar_2r")
        >>> motion = bc.waypoints(arm, [0.0, 1.0], [{}, {"elbow": 1.0}], samples=11)
        >>> motion.joint_names, motion.duration, motion.position.shape
        (('shoulder', 'elbow'), 1.0, (11, 2))
    """

    joints: Sequence[JointLike]
    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    name: str = "motion"
    notes: tuple[str, ...] = field(default=())
    position_noise: Sequence[float] = ()
    speed_noise: Sequence[float] = ()
    forms: tuple[ClosedForm, ...] = field(default=(), repr=False)
    derived_from: str = field(default="", repr=False)

    def __post_init__(self) -> None:
        arguments.text("name", self.name, empty=True)
        object.__setattr__(self, "joints", _joints(self.joints))
        for key, count in zip(("position_noise", "speed_noise"), sizes(self.joints), strict=True):
            noise = tuple(arguments.vector(key, getattr(self, key), None, where=self._title).tolist()) or (0.0,) * count
            if len(noise) != count or min(noise, default=0.0) < 0.0:
                arguments.refuse(key, f"{count} numbers of at least 0", getattr(self, key), self._title)
            object.__setattr__(self, key, noise)
        notes = arguments.several("notes", self.notes, str, "texts", where=self._title)
        object.__setattr__(self, "notes", notes)
        nq, nv = sizes(self.joints)
        time = arguments.as_array("time", self.time, "a list of numbers (s)", self._title)
        n = np.size(time)
        shapes = {"time": (n,), "position": (n, nq), "velocity": (n, nv), "acceleration": (n, nv)}
        for key, shape in shapes.items():
            value = time if key == "time" else getattr(self, key)
            given = arguments.as_array(key, value, f"an array of shape {shape}", self._title)
            if given.shape != shape:
                raise InputError(f"{self._title}: {key} has shape {given.shape}, expected {shape}")
            array = np.array(given, dtype=np.float64, order="C")
            array.flags.writeable = False
            if not np.all(np.isfinite(array)):
                row = int(np.argmin(np.isfinite(array.reshape(n, -1)).all(axis=1)))
                raise InputError(f"{self._title}: {key} holds a value that is not finite, in row {row}")
            object.__setattr__(self, key, array)
        if n < 2:
            raise InputError(f"{self._title}: a motion needs at least 2 rows, got {n}")
        self._check_time()
        for order, key in enumerate(("position", "velocity", "acceleration")):
            check_size(self._title, key, getattr(self, key), order)
        self._check_rotations()
        arguments.one_of("derived_from", self.derived_from, ("", "positions", "velocities"), where=self._title)
        forms = arguments.several("forms", self.forms, ClosedForm, "ClosedForms", where=self._title)
        object.__setattr__(self, "forms", tuple(form for form in forms if self._agrees(form)))

    def _agrees(self, form: ClosedForm) -> bool:
        slack = NEXT * max(abs(form.begin), abs(form.end))  # at its ends, rows of a jump belong to other stretches too
        first = int(np.searchsorted(self.time, form.begin + slack, side="right")) - 1
        rows = slice(max(first, 0), int(np.searchsorted(self.time, form.end - slack)) + 1)
        return form.holds(self.time[rows], (self.position[rows], self.velocity[rows], self.acceleration[rows]))

    def _check_time(self) -> None:
        check_times(self._title, self.time)
        step = np.diff(self.time)
        if np.any(step < 0.0):
            k = int(np.argmax(step < 0.0))
            raise InputError(
                f"{self._title}: time decreases, from {self.time[k]:g} s to {self.time[k + 1]:g} s (rows {k}, {k + 1})"
            )
        if np.any((step[1:] == 0.0) & (step[:-1] == 0.0)):
            k = int(np.argmax((step[1:] == 0.0) & (step[:-1] == 0.0)))
            raise InputError(f"{self._title}: time {self.time[k]:g} s occurs more than twice")
        if step[0] == 0.0 or step[-1] == 0.0:
            raise InputError(
                f"{self._title}: the first or the last time occurs twice; there is no acceleration beyond it"
            )
        twin = np.flatnonzero(step == 0.0)
        gap = np.abs(self._smooth_position[twin + 1] - self._smooth_position[twin])
        if np.any(gap > POSITION_GAP):
            row, column = np.unravel_index(int(np.argmax(gap)), gap.shape)
            raise InputError(
                f"{self._title}: joint '{self._joint_at(int(column)).name}' jumps by {gap.max():.3g} (rad or "
                f"m) at {self.time[twin[row]]:g} s; a position must be continuous"
            )

    def _check_rotations(self) -> None:
        for joint in self.joints:
            if (part := unit_vector(joint)) is not None:
                length = np.linalg.norm(self.position[:, part], axis=1)
                if np.any(np.abs(length - 1.0) > 1e-6):
                    k = int(np.argmax(np.abs(length - 1.0)))
                    raise InputError(
                        f"{self._title}: the rotation of joint '{joint.name}' has length {length[k]:g} in "
                        f"row {k}, expected 1"
                    )

    @property
    def _title(self) -> str:
        return f"motion '{self.name}'"

    def _joint_at(self, column: int, speed: bool = False) -> JointLike:
        if speed:
            return next(joint for joint in self.joints if joint.v <= column < joint.v + joint.nv)
        return next(joint for joint in self.joints if joint.q <= column < joint.q + joint.nq)

    def __len__(self) -> int:
        return len(self.time)

    def __add__(self, other: Motion) -> Motion:
        return join(self, other)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of their columns."""
        return tuple(joint.name for joint in self.joints)

    @property
    def nq(self) -> int:
        """Number of position coordinates."""
        return int(self.position.shape[1])

    @property
    def nv(self) -> int:
        """Number of velocity coordinates."""
        return int(self.velocity.shape[1])

    @property
    def duration(self) -> float:
        """Time from the first row to the last, s."""
        return float(self.time[-1] - self.time[0])

    @cached_property
    def pieces(self) -> tuple[slice, ...]:
        """Row ranges between jumps of acceleration: inside each the motion is smooth."""
        edges = np.flatnonzero(np.diff(self.time) == 0.0) + 1
        bounds = [0, *edges.tolist(), len(self.time)]
        return tuple(slice(a, b) for a, b in pairwise(bounds))

    @cached_property
    def interpolated(self) -> Any:
        """Whether the states after each row but the last (n − 1,) are interpolated, as no closed form is known."""
        if not self.forms:
            return np.ones(len(self.time) - 1, dtype=bool)
        middle = 0.5 * (self.time[:-1] + self.time[1:])
        return (covering(self.forms, middle, "after") < 0) & (np.diff(self.time) > 0.0)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Warnings: the notes, and torques that are not included, of a motion that does not start or end at rest or
        whose velocity jumps.
        """
        found = list(self.notes)
        peak = float(np.max(np.abs(self.velocity), initial=0.0))
        rest = np.maximum(AT_REST * peak, np.minimum(self.speed_noise, NOISE * peak))
        for row, what in ((0, "starts"), (-1, "ends")):
            speed = np.abs(self.velocity[row])
            if np.any(speed > rest):
                column = int(np.argmax(np.where(speed > rest, speed, 0.0)))
                name, unit = velocity_labels(self.joints)[column]
                unknown = self.speed_noise[column]
                doubt = (
                    f" (the digits of its file leave ±{unknown:.2g} {unit} unknown)" if speed[column] <= unknown else ""
                )
                found.append(
                    f"{self._title} {what} moving: {name} {self.velocity[row, column]:.4g} {unit} at "
                    f"{self.time[row]:g} s{doubt}; the torque to {'reach' if row == 0 else 'lose'} this speed is not "
                    "included"
                )
        for piece in self.pieces[1:]:
            jump = np.abs(self.velocity[piece.start] - self.velocity[piece.start - 1])
            if np.any(jump > rest):
                column = int(np.argmax(jump))
                name, unit = velocity_labels(self.joints)[column]
                found.append(
                    f"{self._title} jumps in velocity at {self.time[piece.start]:g} s: {name} by "
                    f"{jump[column]:.4g} {unit}; the torque of the jump is not included"
                )
        return tuple(found)

    @cached_property
    def _smooth_position(self) -> Array:
        return self.position * continuous(self.joints, self.position)

    @cached_property
    def _rates(self) -> tuple[Array, Array]:
        return rates(self.joints, self._smooth_position, self.velocity, self.acceleration)

    def at(self, t: Any, side: Literal["after", "before"] = "after") -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration at any time of the motion.

        They are exact at the samples, and everywhere in motions of `point_to_point`, `waypoints` and `dwell`. Between
        two samples of other motions they are those of the quintic Hermite polynomial that matches position, velocity
        and acceleration at both (error of the acceleration of order step⁴).

        Args:
            t: A time, or times (m,), s.
            side: Which limit to give at a jump of acceleration: "after" or "before".

        Returns:
            Position (nq,), velocity (nv,) and acceleration (nv,); (m, nq), (m, nv) and (m, nv) for several times.

        Raises:
            InputError: A time is outside the motion.

        Example:
            >>> import bellcrank as bc
            >>> motion = bc.waypoints(bc.load_robot("planar_2r"), [0.0, 1.0], [{}, {"elbow": 1.0}])
            >>> q, v, a = motion.at(0.5)
            >>> q.round(9)
            array([0. , 0.5])
        """
        given = arguments.as_array("t", t, "a time or a list of times (s)", self._title)
        arguments.one_of("side", side, ("after", "before"), where=self._title)
        times = np.atleast_1d(given)
        if times.ndim != 1:
            raise InputError(f"{self._title}: times must be a number or one-dimensional, got shape {times.shape}")
        first, last = float(self.time[0]), float(self.time[-1])
        slack = 1e-12 * max(abs(first), abs(last))
        outside = ~((times >= first - slack) & (times <= last + slack))
        if np.any(outside):
            raise InputError(
                f"{self._title}: time {times[np.argmax(outside)]:g} s lies outside it ({first:g} s to {last:g} s)"
            )
        times = np.clip(times, first, last)
        if side == "after":
            k = np.searchsorted(self.time, times, side="right") - 1
        else:
            k = np.searchsorted(self.time, times, side="left") - 1
        k = np.clip(k, 0, len(self.time) - 2)
        q, v, a = self._between(times, k, side)
        for row in (k, k + 1):
            exact = times == self.time[row]
            q[exact], v[exact], a[exact] = (
                self.position[row[exact]],
                self.velocity[row[exact]],
                self.acceleration[row[exact]],
            )
        if given.ndim == 0:
            return q[0], v[0], a[0]
        return q, v, a

    def _between(self, times: Array, step: Any, side: Side) -> States:
        """States at times (m,) that lie in these steps (m,) between rows."""
        form = covering(self.forms, times, side) if self.forms else np.full(len(times), -1)
        order = np.argsort(form, kind="stable")
        edges = np.flatnonzero(np.diff(form[order], prepend=-2))
        q, v, a = (np.empty((len(times), count)) for count in (self.nq, self.nv, self.nv))
        for begin, end in pairwise([*edges.tolist(), len(times)]):
            those = order[begin:end]
            if (which := form[those[0]]) >= 0:
                found = self.forms[which].at(times[those], side)
            else:
                moved = quintic(self.time, self._smooth_position, *self._rates, times[those], step[those])
                found = from_rates(self.joints, *moved)
            q[those], v[those], a[those] = found
        return q, v, a


@arguments.named
def join(*motions: Motion, name: str | None = None) -> Motion:
    """Join motions one after the other.

    Args:
        motions: Motions of one robot; each starts where the one before it ends. Times continue those of the first.
        name: Name of the whole; left out, the names joined by " + ".

    Returns:
        The whole motion; where the acceleration jumps, a time occurs twice.

    Raises:
        InputError: There is no motion, the joints differ, or there is a gap in position of more than 1e-6 rad or m.

    Example:
        >>> import bellcrank as bc
        >>> arm = bc.load_robot("planar_2r")
        >>> there = bc.waypoints(arm, [0.0, 1.0], [{}, {"elbow": 1.0}])
        >>> bc.join(there, bc.dwell(arm, {"elbow": 1.0}, 0.5)).duration
        1.5
    """
    if not motions:
        raise InputError("join needs at least one motion, got none")
    for motion in motions:
        arguments.instance("motions", motion, Motion, "Motions")
    if name is not None:
        arguments.text("name", name, empty=True)
    first = motions[0]
    rows: list[tuple[Array, ...]] = [(first.time, first.position, first.velocity, first.acceleration)]
    forms = list(first.forms)
    for before, after in pairwise(motions):
        if _layout(before) != _layout(after):
            raise InputError(
                f"motions '{before.name}' and '{after.name}' cannot be joined: their joints are "
                f"{', '.join(before.joint_names)} and {', '.join(after.joint_names)}"
            )
        gap = np.abs(after.position[0] * _facing(before, after) - before.position[-1])
        if np.any(gap > POSITION_GAP):
            column = int(np.argmax(gap))
            joint = before._joint_at(column)
            raise InputError(
                f"motions '{before.name}' and '{after.name}' cannot be joined: the first ends with joint "
                f"'{joint.name}' at {before.position[-1, column]:.9g}, the second starts at "
                f"{after.position[0, column]:.9g} (rad or m)"
            )
        ends = (before.position[-1], before.velocity[-1], before.acceleration[-1])
        starts = (after.position[0], after.velocity[0], after.acceleration[0])
        same = all(np.array_equal(end, begin) for end, begin in zip(ends, starts, strict=True))
        skip = 1 if same else 0
        start = rows[-1][0][-1]
        time = start + (after.time - after.time[0])
        forms += [form.moved(start - after.time[0]) for form in after.forms]
        rows.append((time[skip:], after.position[skip:], after.velocity[skip:], after.acceleration[skip:]))
    time, position, velocity, acceleration = (np.concatenate(part) for part in zip(*rows, strict=True))
    notes = tuple(dict.fromkeys(note for motion in motions for note in motion.notes))
    title = " + ".join(motion.name for motion in motions) if name is None else name
    position_noise, speed_noise = (
        tuple(np.max([getattr(motion, key) for motion in motions], axis=0).tolist())
        for key in ("position_noise", "speed_noise")
    )
    return Motion(
        first.joints, time, position, velocity, acceleration, title, notes, position_noise, speed_noise, tuple(forms)
    )


def _joints(given: object) -> tuple[JointLike, ...]:
    """Joints that say where their columns lie. Raises InputError."""
    expected = "the joints of a robot (robot.joints)"
    if not isinstance(given, (list, tuple)) or not given:
        arguments.refuse("joints", expected, given)
    for joint in given:
        if not all(hasattr(joint, key) for key in ("name", "kind", "q", "nq", "v", "nv")):
            arguments.refuse("joints", expected, joint)
    return tuple(given)


def _layout(motion: Motion) -> list[tuple[str, str, int, int]]:
    return [(joint.name, joint.kind, joint.q, joint.v) for joint in motion.joints]


def _facing(before: Motion, after: Motion) -> Array:
    pair = np.stack([before.position[-1], after.position[0]])
    return np.asarray(continuous(before.joints, pair)[1])


def require_joints(motion: Motion, robot: RobotLike) -> None:
    """Raise InputError where a motion is for other joints than a robot's."""
    layout = [(joint.name, joint.q, joint.v) for joint in robot.joints]
    if [(joint.name, joint.q, joint.v) for joint in motion.joints] != layout:
        raise other_joints(motion, robot)


def other_joints(motion: Motion, robot: RobotLike) -> InputError:
    """The error of a motion for other joints than a robot's."""
    theirs, own = (", ".join(joint.name for joint in x.joints) for x in (motion, robot))
    return InputError(
        f"motion '{motion.name}' has the joints {theirs}, but the robot '{robot.name}' has {own}; give a motion of "
        f"this robot"
    )
