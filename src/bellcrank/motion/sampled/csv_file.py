"""Motions in CSV files: one row a time, a header that names each column and its unit.

time [s],shoulder position [rad],shoulder velocity [rad/s],shoulder acceleration [rad/s^2],…
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.config.units import decimal_number, units_for
from bellcrank.errors import InputError
from bellcrank.files.access import MOST_TABLE, read_text
from bellcrank.files.csv_files import ROWS, unguarded, write_table
from bellcrank.messages import readable, unknown_name
from bellcrank.motion.coordinates import position_labels, velocity_labels
from bellcrank.motion.limit_checks import LARGEST, limit_notes
from bellcrank.motion.motion import Motion
from bellcrank.motion.sampled.file_checks import FileRows, end_speed_noise, half_unit, inconsistencies, repaired
from bellcrank.motion.sampled.sampled_motion import sampled_motion
from bellcrank.robot.model.joints import JointLike, RobotLike, unit_vector

ENERGIES = "kinetic energy [J]"
_FREE = re.compile(r"\A.* position q[xyzw]\b")
_HEADER = re.compile(r"^(?P<name>.*\S)\s*\[(?P<unit>[^\[\]]*)\]$")


@dataclass(frozen=True)
class _Columns:
    """Labels (name, unit) of all columns that a file of a robot's motion can have."""

    position: list[tuple[str, str]]
    velocity: list[tuple[str, str]]
    acceleration: list[tuple[str, str]]
    torque: list[tuple[str, str]]  # of joints of one degree of freedom; results have them, reading ignores them

    @property
    def shaft(self) -> list[tuple[str, str]]:
        """Those of motor shafts, which results have and reading ignores."""
        joints = [name.removesuffix(" torque") for name, _ in self.torque]
        kinds = (("torque", "N m"), ("speed", "rad/s"), ("power", "W"))
        return [(f"{joint} shaft {what}", unit) for joint in joints for what, unit in kinds]

    @classmethod
    def of(cls, joints: tuple[JointLike, ...]) -> _Columns:
        torques = [(f"{j.name} torque", "N" if j.kind == "prismatic" else "N m") for j in joints if j.nv == 1]
        return cls(position_labels(joints), velocity_labels(joints, 1), velocity_labels(joints, 2), torques)

    @property
    def units(self) -> dict[str, str]:
        actuators = [(name.removesuffix("torque") + "actuator torque", unit) for name, unit in self.torque]
        return dict(
            [("time", "s"), *self.position, *self.velocity, *self.acceleration, *self.torque, *actuators, *self.shaft]
        )


@arguments.named
def write_motion(
    motion: Motion,
    path: str | Path,
    torque: Array | None = None,
    more: Mapping[tuple[str, str], Array] | None = None,
) -> Path:
    """Write a motion as a CSV file, every number with the digits that give it back exactly.

    The file is replaced in one step, or not at all.

    Args:
        motion: The motion.
        path: Path of the file.
        torque: Torques or forces (n, joints of one degree of freedom), N m or N, as further columns.
        more: Further columns: values (n,) by (title, unit).

    Returns:
        The path of the file.

    Raises:
        InputError: An argument is wrong, or the file cannot be written.

    Example:
        >>> import bellcrank as bc, tempfile, pathlib
        >>> motion = bc.dwell(bc.load_robot("planar_2r"), {}, 1.0)
        >>> path = bc.write_motion(motion, pathlib.Path(tempfile.mkdtemp()) / "rest.csv")
        >>> path.read_text().split(",")[1]
        'shoulder position [rad]'
    """
    arguments.instance("motion", motion, Motion, "a Motion")
    target = arguments.path("path", path, "the path of a file")
    columns = _Columns.of(tuple(motion.joints))
    labels = [("time", "s"), *columns.position, *columns.velocity, *columns.acceleration]
    parts = [motion.time, motion.position, motion.velocity, motion.acceleration]
    if torque is not None:
        labels += columns.torque
        parts.append(arguments.array("torque", torque, (len(motion.time), len(columns.torque)), "N m or N"))
    for label, values in _more(more).items():
        labels.append(label)
        parts.append(arguments.array("more", values, (len(motion.time),), finite=False))
    blocks = (
        np.column_stack([part[first : first + ROWS] for part in parts]) for first in range(0, len(motion.time), ROWS)
    )
    return write_table(target, labels, blocks)


@arguments.named
def read_motion(robot: RobotLike, path: str | Path, name: str | None = None, text: str | None = None) -> Motion:
    """Read a motion from a CSV file with one column a coordinate, in any order, units in the header.

    Positions of every joint are required. Velocities and accelerations may be left out (all of one kind): missing
    velocities come from the quintic spline through the positions, missing accelerations from the one through the
    velocities (not-a-knot, so that nothing is assumed about the ends). A time that occurs twice marks a jump of
    acceleration; jumps that the columns show are detected, and the motion has rows for them. Rows closer in time than
    the digits allow are merged. An angle that jumps by a turn, far faster than the rest of the file, was wrapped: it is
    continued without the jump where the joint's limits allow that, and refused otherwise.

    Args:
        robot: The robot.
        path: Path of the file.
        name: Name of the motion; left out, that of the file.
        text: What the file holds, where it was read before.

    Returns:
        The motion; its notes say what was derived and what does not agree.

    Raises:
        InputError: The file is not a motion of the robot; the message names file and line.

    Example:
        >>> import bellcrank as bc, tempfile, pathlib
        >>> path = pathlib.Path(tempfile.mkdtemp()) / "own.csv"
        >>> rows = "time [s],shoulder position [deg],elbow position [rad]", "0,0,0", "1,45,0.5", "2,90,1"
        >>> _ = path.write_text("\\n".join(rows))
        >>> bc.read_motion(bc.load_robot("planar_2r"), path).position[-1].round(4)
        array([1.5708, 1.    ])
    """
    file = arguments.path("path", path, "the path of a CSV file")
    joints = tuple(arguments.robot(robot).joints)
    if name is not None:
        arguments.text("name", name, empty=True)
    if text is not None:
        arguments.text("text", text, "what the file holds, as a text", empty=True)
    columns = _Columns.of(joints)
    header, table = _table(file, motion_text(file) if text is None else text)
    _refuse_free_base(file, robot, header)
    values, unknown = _converted(file, header, table, columns.units)
    for label, _ in [("time", "s"), *columns.position]:
        if label not in values:
            raise InputError(
                f"{file}: column '{label} [{columns.units[label]}]' is missing; the robot '{robot.name}' "
                "needs 'time [s]' and a position of each of its joints "
                f"({', '.join(joint.name for joint in joints)})"
            )
    time = values["time"]
    _check_time(file, time)
    position = np.column_stack([values[label] for label, _ in columns.position])
    position = _normalised(file, joints, position)
    velocity = _complete(file, values, columns.velocity, "velocity")
    acceleration = _complete(file, values, columns.acceleration, "acceleration")
    if acceleration is not None and velocity is None:
        raise InputError(f"{file}: there are acceleration columns but no velocity columns; give both or leave both out")
    title = readable(file.stem) if name is None else name
    derived = "positions" if velocity is None else "velocities" if acceleration is None else ""
    try:
        rows = repaired(robot, joints, FileRows(time, position, velocity, acceleration), title)
        time, position, velocity, acceleration = rows.time, rows.position, rows.velocity, rows.acceleration
        motion = sampled_motion(joints, time, position, velocity, acceleration, title)
    except InputError as error:
        raise InputError(f"{file}: {error}") from None
    position_noise = [unknown[label] for label, _ in columns.position]
    speed_noise = [unknown.get(label, 0.0) for label, _ in columns.velocity]
    if velocity is None and len(position_noise) == len(speed_noise):  # one coordinate a joint
        speed_noise = end_speed_noise(time, position_noise)
    motion = replace(motion, position_noise=tuple(position_noise), speed_noise=tuple(speed_noise))
    notes = (*rows.notes, *motion.notes)
    if velocity is not None:
        notes = (*inconsistencies(motion, time, position, velocity, acceleration), *notes)
    if derived:
        notes += (
            f"motion '{title}': accelerations come from differentiating the {derived}; noise in them is amplified",
        )
    notes += limit_notes(robot, title, time, position, "give the column the unit [deg]", position_noise)
    return replace(motion, notes=notes, derived_from=derived)


def _more(given: object) -> Mapping[tuple[str, str], Array]:
    """Columns by (title, unit). Raises InputError."""
    if given is None:
        return {}
    expected = "a mapping of (title, unit) to values"
    if not isinstance(given, Mapping):
        arguments.refuse("more", expected, given)
    for label in given:
        if not isinstance(label, tuple) or len(label) != 2 or not all(isinstance(part, str) for part in label):
            arguments.refuse("more", expected, label)
    return given


def motion_text(file: Path) -> str:
    """The text of a motion's file. Raises InputError, one sentence with the file."""
    return read_text(file, MOST_TABLE)


def _table(file: Path, text: str) -> tuple[list[str], Array]:
    try:
        lines = [
            (number, row) for number, row in enumerate(csv.reader(io.StringIO(text)), 1) if any(c.strip() for c in row)
        ]
    except csv.Error as error:
        raise InputError(f"{file}: not a CSV file: {error}") from None
    if not lines:
        raise InputError(f"{file}: the file is empty; expected a header 'time [s],…' and rows of numbers")
    header = [" ".join(unguarded(cell).split()) for cell in lines[0][1]]
    if len(header) == 1 and ";" in header[0]:
        raise InputError(f"{file}: the columns are separated by ';', expected ',' (and '.' in the numbers)")
    if all(_label(title) != "time" for title in header):  # not a motion: nothing of it is shown
        raise InputError(f"{file}: column 'time [s]' is missing; expected a header 'time [s],JOINT position [rad],…'")
    if len(lines) < 3:
        raise InputError(f"{file}: a motion needs at least 2 rows of numbers, got {len(lines) - 1}")
    table = np.empty((len(lines) - 1, len(header)))
    for k, (number, row) in enumerate(lines[1:]):
        if len(row) != len(header):
            raise InputError(f"{file}: line {number} has {len(row)} columns, the header has {len(header)}")
        for column, cell in enumerate(row):
            try:
                value = decimal_number(cell)
            except ValueError:
                value = np.nan
            if not np.isfinite(value):
                raise InputError(
                    f"{file}: line {number}, column '{header[column]}': {cell.strip()[:40]!r} is not a finite number"
                )
            if abs(value) > LARGEST[-1]:
                raise InputError(
                    f"{file}: line {number}, column '{header[column]}': {cell.strip()[:40]!r} is too large, "
                    f"expected at most {LARGEST[-1]:g}"
                )
            table[k, column] = value
    return header, table


def _label(title: str) -> str:
    """The title of a column without its unit."""
    match = _HEADER.match(title)
    return match["name"] if match else title


def _refuse_free_base(file: Path, robot: RobotLike, header: list[str]) -> None:
    """Refuse a file with a free base for a robot with a fixed one (InputError)."""
    own = {label for label, _ in position_labels(robot.joints)}
    free = next((text for text in header if _FREE.match(text) and _label(text) not in own), None)
    if free is not None and all(joint.kind != "floating" for joint in robot.joints):
        raise InputError(
            f"{file}: the file has a free base (column '{free}') and the base of the robot '{robot.name}' is fixed; "
            "write floating_base: true on its configuration, or load_robot(…, floating_base=True)"
        )


def _converted(
    file: Path, header: list[str], table: Array, units: dict[str, str]
) -> tuple[dict[str, Array], dict[str, float]]:
    """Columns in SI units by their labels, and how much is unknown of their numbers because of their digits."""
    values: dict[str, Array] = {}
    unknown: dict[str, float] = {}
    if ENERGIES in header:  # a run's file: its energies and outputs come last and are not part of the motion
        header = header[: header.index(ENERGIES)]
    for column, text in enumerate(header):
        match = _HEADER.match(text)
        label = match["name"] if match else text
        if label not in units:
            raise InputError(f"{file}: {unknown_name('column', label, units)}")
        known = units_for(units[label])
        if match is None:
            raise InputError(f"{file}: column '{label}' has no unit; write '{label} [{units[label]}]'")
        if match["unit"].strip() not in known:
            raise InputError(f"{file}: column '{label}' is in '{match['unit']}', expected {' or '.join(known)}")
        if label in values:
            raise InputError(f"{file}: column '{label}' occurs twice")
        factor = known[match["unit"].strip()]
        values[label], unknown[label] = table[:, column] * factor, half_unit(table[:, column]) * factor
    return values, unknown


def _check_time(file: Path, time: Array) -> None:
    step = np.diff(time)
    if np.any(step < 0.0):
        k = int(np.argmax(step < 0.0))
        raise InputError(f"{file}: time must not decrease, but row {k + 2} ({time[k + 1]:g} s) follows {time[k]:g} s")


def _normalised(file: Path, joints: tuple[JointLike, ...], position: Array) -> Array:
    for joint in joints:
        block = unit_vector(joint)
        if block is None:
            continue
        length = np.linalg.norm(position[:, block], axis=1)
        if np.any(np.abs(length - 1.0) > 1e-3):
            k = int(np.argmax(np.abs(length - 1.0)))
            raise InputError(
                f"{file}: the rotation of joint '{joint.name}' has length {length[k]:g} in row {k + 1}, expected 1"
            )
        off = np.abs(length - 1.0) > 1e-15
        position[off, block] /= length[off, None]
    return position


def _complete(file: Path, values: dict[str, Array], labels: list[tuple[str, str]], what: str) -> Array | None:
    there = [label for label, _ in labels if label in values]
    if not there:
        return None
    for label, unit in labels:
        if label not in values:
            raise InputError(
                f"{file}: column '{label} [{unit}]' is missing though '{there[0]}' is there; "
                f"give the {what} of every joint or of none"
            )
    return np.column_stack([values[label] for label, _ in labels])
