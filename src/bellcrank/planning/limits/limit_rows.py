"""Limits of torques, accelerations and a tool as rows for the extension, and the quantities that they bound.

A tool: with the frame's Jacobian J the velocity of its origin along a path is J q' y, and its acceleration

    A u + B y²,    A = J q',    B = J q'' + J̇(q, q') q',

so that a limit of the speed bounds the path speed y, and a limit of the acceleration is a second-order cone in u and
y² (D. Verscheure et al., IEEE Trans. Automatic Control 54, 2009, write both so). B consists of a part `bend` A along A
and of one across it of the length `across`: y² is at most limit / across. The same holds for the frame's rotation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bellcrank.arrays import Array
from bellcrank.planning.limits.motion_limits import MotionLimits
from bellcrank.planning.limits.motor_limits import MotorLimits, Polyline
from bellcrank.robot.robot import Robot

if TYPE_CHECKING:
    from bellcrank.robot.robot import RobotJoint


NEGLIGIBLE = 1e-12  # of the largest |A|: smaller ones are rounding
Row = tuple[int, int, int, int, int, float, float]
NO_CURVE = (-1, -1, -1)


@dataclass(frozen=True, eq=False)
class NormCoefficients:
    """The coefficients (n, m) of m norms at n places, and their limits (m,)."""

    along: Array
    bend: Array
    across: Array
    limit: Array

    def fastest(self) -> Array:
        """The largest path speeds (n, m)."""
        with np.errstate(divide="ignore"):
            return np.asarray(np.sqrt(self.limit / self.across))


@dataclass(frozen=True)
class ToolLimits:
    """The limits of a frame of a robot; `factors` on them, by their place in `names`."""

    robot: Robot
    limits: MotionLimits

    @property
    def speeds(self) -> list[tuple[str, int, float]]:
        """What is limited, which part of the frame's velocity that is (0 linear, 1 angular), and the limit."""
        return self._given("tool_speed", "tool_angular_speed", "speed")

    @property
    def accelerations(self) -> list[tuple[str, int, float]]:
        """As `speeds`."""
        return self._given("tool_acceleration", "tool_angular_acceleration", "acceleration")

    def _given(self, linear: str, angular: str, what: str) -> list[tuple[str, int, float]]:
        pairs = ((what, 0, getattr(self.limits, linear)), (f"angular {what}", 1, getattr(self.limits, angular)))
        return [(name, part, value) for name, part, value in pairs if value is not None]

    def speed_rates(self, q: Array, first: Array) -> list[tuple[str, Array, float]]:
        """What is limited, |J q'| (n,), and the limit."""
        if not self.speeds:
            return []
        velocity = self.robot.frame_velocity(self.limits.tool, q, first)
        return [(name, np.linalg.norm(velocity[part], axis=1), limit) for name, part, limit in self.speeds]

    def norms(self, q: Array, first: Array, second: Array, slope: Array) -> NormCoefficients:
        """The coefficients of accelerations at positions q with q' = `first` and q'' = `second` (n, nv); A is that of
        `slope`.
        """
        n, given = len(q), self.accelerations
        if not given:
            return NormCoefficients(np.zeros((n, 0)), np.zeros((n, 0)), np.zeros((n, 0)), np.zeros(0))
        rates = self.robot.frame_velocity(self.limits.tool, q, slope)
        growths = self.robot.frame_acceleration(self.limits.tool, q, first, second)
        parts = []
        for _, part, _ in given:
            a, b = rates[part], growths[part]
            along = np.linalg.norm(a, axis=1)
            along = np.where(along <= NEGLIGIBLE * along.max(initial=0.0), 0.0, along)
            direction = a / np.where(along > 0.0, along, np.inf)[:, None]
            lengthwise = np.sum(b * direction, axis=1)
            across = np.linalg.norm(b - lengthwise[:, None] * direction, axis=1)
            parts.append((along, lengthwise / np.where(along > 0.0, along, np.inf), across))
        along, bend, across = (np.ascontiguousarray(np.stack(columns, axis=1)) for columns in zip(*parts, strict=True))
        return NormCoefficients(along, bend, across, np.array([limit for _, _, limit in given]))


@dataclass(frozen=True)
class NamedLimit:
    """A limit with its name: what is limited, of which joint, in which direction."""

    what: str
    joint: str
    side: str

    @property
    def group(self) -> str:
        """The name without the direction, such as "torque of elbow"."""
        return f"{self.what} of {self.joint}"

    def __str__(self) -> str:
        return f"{self.group} ({self.side})" if self.side else self.group


@dataclass(frozen=True)
class CountedLimits:
    """Which limits count and how much: those of the group `only`, "" being all, times their `factors` by group."""

    factors: Mapping[str, float] = field(default_factory=dict)
    only: str = ""

    def counts(self, group: str) -> bool:
        """Whether the limits of a group count."""
        return self.only in ("", group)

    def factor(self, group: str) -> float:
        """The factor on the limits of a group."""
        return self.factors.get(group, 1.0)


class LimitedQuantity(NamedTuple):
    """`share` of the torque of number `motor`, and `inertia` times the acceleration of the coordinate `column`."""

    motor: int
    share: float
    column: int
    inertia: float


@dataclass(frozen=True)
class LimitRows:
    """Rows of limits.

    Attributes:
        rows: Rows for the extension: the quantity where the load takes power and where it gives power back (-1: there
            is one quantity), the motor and its curves of driving and braking (-1: none), the sense and the limit.
        names: The names of the rows.
        curves: Largest torques over speed at motors' shafts.
        quantities: The quantities that are limited; first the motors' torques.
    """

    rows: tuple[Row, ...]
    names: tuple[NamedLimit, ...]
    curves: tuple[Polyline, ...]
    quantities: tuple[LimitedQuantity, ...]


def limit_rows(
    joints: Sequence[RobotJoint], robot: Robot, limits: MotionLimits, motors: MotorLimits, counted: CountedLimits
) -> LimitRows:
    """The rows of the limits of torques of the joints with motors, of accelerations, and of torques at shafts."""
    rows, names = list[Row](), list[NamedLimit]()
    curves = list[Polyline]()
    torque_count = max((axis.torque + 1 for axis in motors.axes), default=0)
    quantities = [LimitedQuantity(k, 1.0, 0, 0.0) for k in range(torque_count)]

    def add(quantity: tuple[int, int], curve: tuple[int, int, int], limit: float, what: str, joint: str) -> None:
        group = f"{what} of {joint}"
        if counted.counts(group):
            for sense, side in ((1.0, "upper"), (-1.0, "lower")):
                rows.append((*quantity, *curve, sense, limit * counted.factor(group)))
                names.append(NamedLimit(what, joint, side))

    torques = limits.of_joints("torque", robot)
    for k, (joint, axis) in enumerate(zip(joints, motors.axes, strict=True)):
        if np.isfinite(torques[joint.v]):
            add((k, -1), NO_CURVE, float(torques[joint.v]), "torque", joint.name)
        if k in motors.gear_torques:
            add((axis.torque, -1), NO_CURVE, motors.gear_torques[k], "gear torque", axis.name)
    accelerations = limits.of_joints("acceleration", robot)
    named = {joint.v: joint.name for joint in robot.joints}
    for column in np.flatnonzero(np.isfinite(accelerations)).tolist():
        quantities.append(LimitedQuantity(0, 0.0, column, 1.0))
        add((len(quantities) - 1, -1), NO_CURVE, float(accelerations[column]), "acceleration", named[column])
    for shaft in motors.shafts:
        actuator, axis, efficiency = shaft.actuator, motors.axes[shaft.motor], shaft.efficiency
        factor = actuator.safety_factor / counted.factor(f"motor torque of {axis.name}")
        for points in (shaft.driving, shaft.braking):
            curves.append(tuple((speed, torque / factor) for speed, torque in points))
        inertia = (actuator.shaft_inertia or 0.0) * actuator.ratio
        for share in (1.0 / (actuator.ratio * efficiency.driving), efficiency.driven / actuator.ratio):
            quantities.append(LimitedQuantity(axis.torque, share, axis.column, inertia))
        last = len(quantities) - 1
        pair = (last - 1, last if efficiency.driving * efficiency.driven != 1.0 else -1)
        top = max(torque for _, torque in shaft.driving) / actuator.safety_factor
        add(pair, (shaft.motor, len(curves) - 2, len(curves) - 1), top, "motor torque", axis.name)
    return LimitRows(tuple(rows), tuple(names), tuple(curves), tuple(quantities))
