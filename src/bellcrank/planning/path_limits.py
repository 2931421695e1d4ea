"""The limits of a mechanism along a path, as bounds of the path's acceleration.

Along a path q(s), with the path speed y = ds/dt and the path acceleration u = d²s/dt²,

    q̇ = q' y,    q̈ = q' u + q'' y²,    τ = M q' u + (M q'' + C(q, q') q') y² + g + friction(q' y),

so that each limited quantity is  a u + b y² + d y + c + Σ_j w_j σ(q'_j y / width_j)  with viscous friction in d and
Coulomb friction, smoothed as in the equations of motion, in w (Bobrow, Dubowsky, Gibson, Int. J. Robotics Research 4,
1985; without friction). The coefficients follow from inverse dynamics at three states a place.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank._planner import LimitArrays
from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.motor_with_gear import MotorWithGear
from bellcrank.cached_values import cached_property
from bellcrank.dynamics.mechanism import Mechanism, coulomb_widths
from bellcrank.errors import InputError
from bellcrank.planning.gear_efficiency import gear_efficiencies
from bellcrank.planning.motion_limits import MotionLimits
from bellcrank.planning.tool_limits import NormCoefficients, ToolLimits
from bellcrank.planning.torque_speed_limits import Polyline, torque_speed_polylines

if TYPE_CHECKING:
    from bellcrank.planning.joint_path import JointPath
    from bellcrank.robot.robot import RobotJoint

Array = NDArray[np.float64]
NEGLIGIBLE = 1e-13  # of the largest coefficient of u: smaller ones are rounding
ROUNDING = 1e-5  # of the largest torque of any joint, by which smaller ones may be rounding
AGREEMENT = 1e-8  # relative: the model of a torque over the path speed against inverse dynamics


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


@dataclass(frozen=True, eq=False)
class PathLimits:
    """The limits of a mechanism along paths.

    Attributes:
        mechanism: The mechanism, with payloads and forces.
        actuators: Motor and gear by joint.
        limits: The limits of joints and of a tool.
        creep: The path speed up to which gears lose power as at standstill, where the load counts as taking power.
        only: The group of the only limits that count; "" for all.
        factors: Factors on limits, by the group of their names; to see what a limit costs.
    """

    mechanism: Mechanism
    actuators: Mapping[str, Actuator]
    limits: MotionLimits
    factors: Mapping[str, float] = field(default_factory=dict)
    creep: float = 0.0
    only: str = ""
    notes: list[str] = field(default_factory=list)

    @cached_property
    def _torque_limits(self) -> Array:
        """Of the motors (k,)."""
        found = self.limits.of_joints("torque", self.mechanism.robot)
        return found[[joint.v for joint in self.mechanism.motors]]

    @cached_property
    def _driven(self) -> dict[int, tuple[Actuator, Polyline, Polyline]]:
        """By motor: actuators whose shaft torque is known and has limits."""
        found = {}
        for k, joint in enumerate(self.mechanism.motors):
            actuator = self.actuators.get(joint.name) if self.limits.actuators else None
            if actuator is None:
                continue
            if actuator.unknown_of_torque:
                self.notes.append(
                    f"the torque of the motor at joint '{joint.name}' is not limited: its "
                    f"{', '.join(actuator.unknown_of_torque)} is unknown"
                )
                continue
            curves = torque_speed_polylines(actuator)
            if curves is None:
                self.notes.append(
                    f"the torque of the motor at joint '{joint.name}' is not limited: its limit over speed is unknown"
                )
                continue
            if actuator.unknown_limits:
                self.notes.append(f"of the motor at joint '{joint.name}' {' and '.join(actuator.unknown_limits)} is "
                                  "unknown and does not limit the motion")  # fmt: skip
            efficiency = gear_efficiencies(actuator)
            if efficiency.varies:
                self.notes.append(
                    f"the efficiency of the gear at joint '{joint.name}' is a curve over the load: its lowest value, "
                    f"{100.0 * efficiency.driving:.3g} %, limits the motion where the motor drives, and its highest, "
                    f"{100.0 * efficiency.driven:.3g} %, where the load gives power back; a faster motion may exist"
                )
            found[k] = (actuator, *curves)
        return found

    @cached_property
    def _gears(self) -> dict[int, float]:
        """By motor: the largest torque, N m or N, that the gear may pass on repeatedly, with the safety factor."""
        found = {}
        for k, joint in enumerate(self.mechanism.motors):
            actuator = self.actuators.get(joint.name) if self.limits.actuators else None
            if isinstance(actuator, MotorWithGear) and (limit := actuator.gear.repeated_peak_torque) is not None:
                found[k] = limit / actuator.safety_factor
        return found

    @cached_property
    def _rotor(self) -> Array:
        """Inertia (k,) in the mechanism's torques that belongs to an actuator's rotor."""
        given = self.mechanism.robot.rotor_inertia
        return np.array([given[j.v] if j.name in self.actuators else 0.0 for j in self.mechanism.motors])

    def at(self, path: JointPath, s: Array, directions: Array | None = None) -> LimitArrays:
        """The limits at places s (n,) of a path; Coulomb friction is that of the joints' directions at other places
        (n,) where these are given.
        """
        q, first, second = (path.spline(s, order) for order in (0, 1, 2))
        terms, norms = self._terms(q, first, second), self._norms(q, first, second, first)
        found = None if directions is None else path.spline(directions, 1)
        return self._arrays(terms, first, second, self._fastest(q, first, norms), norms, directions=found)

    def fastest(self, path: JointPath, s: Array) -> Array:
        """The largest path speed (n,) that the limits of speeds allow at places s (n,) of a path."""
        q, first, second = (path.spline(s, order) for order in (0, 1, 2))
        return self._fastest(q, first, self._norms(q, first, second, first))

    def of_motion(self, q: Array, v: Array, a: Array) -> LimitArrays:
        """The limits of a motion of positions q, velocities v and accelerations a (n, nv) that is faster by the path
        speed: velocities grow with it, accelerations with its square, and the path acceleration is 0.
        """
        terms = self._terms(q, v, a)
        still = np.zeros_like(v)
        terms = (np.zeros_like(terms[0]), *terms[1:])
        norms = self._norms(q, v, a, still)
        return self._arrays(terms, v, a, self._fastest(q, v, norms), norms, slope=still)

    def excess_of_curves(self, q: Array, v: Array, a: Array) -> float:
        """The largest share by which a motion of positions q, velocities v and accelerations a (n, nv) exceeds the
        limits of motors whose gears have a curve of efficiency, which the rows do not hold exactly; negative within.
        """
        worst = -np.inf
        varying = {k: one for k, (one, _, _) in self._driven.items() if gear_efficiencies(one).varies}
        if not varying:
            return worst
        columns = [joint.v for joint in self.mechanism.motors]
        torque = self.mechanism.torques(np.zeros(len(q)), q, v, a)[0] - self._rotor * a[:, columns]
        for k, actuator in varying.items():
            speed = v[:, columns[k]]
            shaft = actuator.shaft_torque(torque[:, k], speed, a[:, columns[k]])
            use = actuator.curve_use(actuator.safety_factor * shaft, actuator.ratio * speed)
            worst = max(worst, float(np.max(use)) - 1.0)
        return worst

    def check_states(self, q: Array, first: Array, second: Array) -> None:
        """Raise InputError where the torques at places of a path, with derivatives of the positions with respect to the
        path, are not those of the model: where a force depends on time, or on velocity otherwise than by inertia and
        friction.
        """
        a, b, d, c, w = self._terms(q, first, second)
        columns = [joint.v for joint in self.mechanism.motors]
        for speed, time in ((2.0, 0.0), (0.5, 1.0)):
            t = np.full(len(q), time)
            v, acceleration = speed * first, 0.3 * first + speed * speed * second
            exact = self.mechanism.torques(t, q, v, acceleration)[0] - self._rotor * acceleration[:, columns]
            model = 0.3 * a + speed * speed * b + speed * d + c + self._coulomb(w, first, speed)
            scale = np.max(np.abs(a), axis=0) + np.max(np.abs(b), axis=0) + np.max(np.abs(c), axis=0)
            off = np.max(np.abs(model - exact), axis=0) - AGREEMENT * (scale + ROUNDING * np.max(scale))
            if np.any(off > 0.0):
                joint = self.mechanism.motors[int(np.argmax(off))].name
                raise InputError(
                    f"the torque of joint '{joint}' depends on time, or on velocity otherwise than by inertia, viscous "
                    "and Coulomb friction; the fastest motion along a path cannot be computed with such forces"
                )

    def _terms(self, q: Array, first: Array, second: Array) -> tuple[Array, ...]:
        """a, b, d, c (n, k) and w (n, k, j) of the motors' torques without the rotors of actuators."""
        t, still = np.zeros(len(q)), np.zeros_like(first)

        def torques(v: Array, a: Array) -> Array:
            return self.mechanism.torques(t, q, v, a)[0]

        columns = [joint.v for joint in self.mechanism.motors]
        c = torques(still, still)
        a = torques(still, first) - c
        b, d, w = self._speed_terms(q, first, torques(first, second) - c)
        return a - self._rotor * first[:, columns], b - self._rotor * second[:, columns], d, c, w

    def _speed_terms(self, q: Array, first: Array, at_one: Array) -> tuple[Array, Array, Array]:
        """b, d and w, of the torques `at_one` that arise at the path speed 1, friction included."""
        if not self._has_friction:
            return at_one, np.zeros_like(at_one), np.zeros((*at_one.shape, len(self._columns)))
        d, w = self._friction_terms(q, first)
        return at_one - d - self._coulomb(w, first, 1.0), d, w

    @cached_property
    def _widths(self) -> Array:
        """Of all frictions (j,), rad/s or m/s; `_columns` are their velocity coordinates."""
        return np.array([width for _, width in coulomb_widths(self.mechanism)])

    @cached_property
    def _columns(self) -> list[int]:
        return [column for column, _ in coulomb_widths(self.mechanism)]

    @cached_property
    def _has_friction(self) -> bool:
        robot = self.mechanism.robot
        return bool(np.any(robot.viscous > 0.0) or self._columns or self.mechanism.equations.forces)

    def _friction_terms(self, q: Array, first: Array) -> tuple[Array, Array]:
        """Viscous d (n, k) and Coulomb w (n, k, j): each tree joint's friction through the motors' shares of it.

        A friction acts on a joint's own coordinate, so that two path speeds tell viscous from Coulomb friction; which
        part of a Coulomb friction belongs to which joint follows from one sign at a time.
        """
        robot, t = self.mechanism.robot, np.zeros(len(q))

        def at(v: Array) -> Array:
            return self.mechanism.friction(t, q, v)

        k = len(self.mechanism.motors)
        w = np.zeros((len(q), k, len(self._columns)))
        d = np.zeros((len(q), k))
        fast = 1e9 * float(np.max(self._widths, initial=1.0))
        for column in range(robot.nv):
            unit = np.zeros_like(first)
            unit[:, column] = 1.0
            once, twice = at(fast * unit), at(2.0 * fast * unit)
            slope = (twice - once) / fast
            d += slope * first[:, [column]]
            places = [j for j, own in enumerate(self._columns) if own == column]
            if places:
                slow = at(1e3 * self._widths[places[0]] * unit)
                sigma = 1e3 / np.sqrt(1.0 + 1e6)
                w[:, :, places[0]] = (slow - slope * 1e3 * self._widths[places[0]]) / sigma
        return d, w

    def _coulomb(self, w: Array, first: Array, speed: float) -> Array:
        z = first[:, self._columns] * speed / self._widths
        return np.asarray(np.einsum("nkj,nj->nk", w, z / np.sqrt(1.0 + z * z)))

    # ---- rows

    @cached_property
    def _accelerated(self) -> list[int]:
        """Velocity coordinates of the joints whose acceleration is limited."""
        return np.flatnonzero(np.isfinite(self.limits.of_joints("acceleration", self.mechanism.robot))).tolist()

    @cached_property
    def _rows(self) -> tuple[list[tuple[int, int, int, int, int, float, float]], list[NamedLimit], list[Polyline]]:
        """Rows for the extension, their names, and curves. Quantities: k torques; the accelerations that are limited;
        for each motor with a known shaft two torques there, driving and driven.
        """
        motors, robot = self.mechanism.motors, self.mechanism.robot
        rows: list[tuple[int, int, int, int, int, float, float]] = []
        names: list[NamedLimit] = []
        curves: list[Polyline] = []

        def add(quantities: tuple[int, int], curve: tuple[int, int, int], limit: float, what: str, joint: str) -> None:
            if self.only not in ("", f"{what} of {joint}"):
                return
            limit *= self.factors.get(f"{what} of {joint}", 1.0)
            for sense, side in ((1.0, "upper"), (-1.0, "lower")):
                rows.append((*quantities, *curve, sense, limit))
                names.append(NamedLimit(what, joint, side))

        for k, joint in enumerate(motors):
            if np.isfinite(limit := self._torque_limits[k]):
                add((k, -1), (-1, -1, -1), float(limit), "torque", joint.name)
            if k in self._gears:
                add((k, -1), (-1, -1, -1), self._gears[k], "gear torque", joint.name)
        accelerations = self.limits.of_joints("acceleration", robot)
        for number, column in enumerate(self._accelerated):
            name = next(joint.name for joint in robot.joints if joint.v == column)
            add((len(motors) + number, -1), (-1, -1, -1), float(accelerations[column]), "acceleration", name)
        for number, (k, (actuator, drive, brake)) in enumerate(self._driven.items()):
            first = len(motors) + len(self._accelerated) + 2 * number
            factor = actuator.safety_factor / self.factors.get(f"motor torque of {motors[k].name}", 1.0)
            places = []
            for points in (drive, brake):
                curves.append(tuple((speed, torque / factor) for speed, torque in points))
                places.append(len(curves) - 1)
            efficiency = gear_efficiencies(actuator)
            pair = (first, first + 1 if efficiency.driving * efficiency.driven != 1.0 else -1)
            top = max(torque for _, torque in drive) / actuator.safety_factor
            add(pair, (k, places[0], places[1]), top, "motor torque", motors[k].name)
        return rows, names, curves

    @cached_property
    def names(self) -> list[NamedLimit]:
        """The names of the rows, and of the norms that follow them."""
        return [*self._rows[1], *(NamedLimit(what, self._tool_name, "") for what in self._norm_names)]

    @property
    def _tool_name(self) -> str:
        return f"frame {self.limits.tool}"

    @property
    def _norm_names(self) -> list[str]:
        """What of the tool's acceleration is limited."""
        found = [what for what, _, _ in self._tool.accelerations]
        return [what for what in found if self.only in ("", f"{what} of {self._tool_name}")]

    @cached_property
    def _tool(self) -> ToolLimits:
        return ToolLimits(self.mechanism.robot, self.limits)

    def _norms(self, q: Array, first: Array, second: Array, slope: Array) -> NormCoefficients:
        """The limits of the tool's accelerations that count, with their factors."""
        found = self._tool.norms(q, first, second, slope)
        kept = [k for k, (what, _, _) in enumerate(self._tool.accelerations) if what in self._norm_names]
        factors = [self.factors.get(f"{what} of {self._tool_name}", 1.0) for what in self._norm_names]
        along, bend, across = (np.ascontiguousarray(x[:, kept]) for x in (found.along, found.bend, found.across))
        return NormCoefficients(along, bend, across, found.limit[kept] * np.array(factors))

    @property
    def linearised(self) -> list[tuple[int, str]]:
        """Those of the entries that the extension's `linearised` has for each place that are not always left out, with
        the groups of their names: two for each row, the second one for what a load gives back, and the norms.
        """
        rows, names, _ = self._rows
        found = [(2 * k, name.group) for k, name in enumerate(names)]
        found += [(2 * k + 1, name.group) for k, (name, row) in enumerate(zip(names, rows, strict=True)) if row[1] >= 0]
        return found + [(2 * len(rows) + k, name.group) for k, name in enumerate(self.names[len(rows) :])]

    @property
    def norm_count(self) -> int:
        """Number of norms that are limited."""
        return len(self._norm_names)

    @cached_property
    def largest_jerk(self) -> Array:
        """The largest jerk of all joints (nv,), infinite where it is not limited."""
        found = self.limits.of_joints("jerk", self.mechanism.robot)
        for joint in self.mechanism.robot.joints:
            found[joint.v] *= self.factors.get(f"jerk of {joint.name}", 1.0)
        return found

    @property
    def jerk_groups(self) -> list[str]:
        """The names of the limits of jerk, in the order of the joints' coordinates."""
        joints = sorted(self.mechanism.robot.joints, key=lambda joint: joint.v)
        return [f"jerk of {joint.name}" for joint in joints if np.isfinite(self.largest_jerk[joint.v])]

    def _arrays(
        self,
        terms: tuple[Array, ...],
        first: Array,
        second: Array,
        fastest: Array,
        norms: NormCoefficients,
        *,
        slope: Array | None = None,
        directions: Array | None = None,
    ) -> LimitArrays:
        a, b, d, c, w = terms
        motors, n = self.mechanism.motors, len(first)
        columns = [joint.v for joint in motors]
        slope = first if slope is None else slope
        parts = [[a], [b], [d], [c], [w]]
        if limited := self._accelerated:
            zero, none = np.zeros((n, len(limited))), np.zeros((n, len(limited), w.shape[2]))
            for part, value in zip(parts, [slope[:, limited], second[:, limited], zero, zero, none], strict=True):
                part.append(value)
        rate = first[:, columns].copy()
        for k, (actuator, _, _) in self._driven.items():
            ratio, inertia = actuator.ratio, actuator.shaft_inertia or 0.0
            rate[:, k] *= ratio
            efficiency = gear_efficiencies(actuator)
            for share in (1.0 / (ratio * efficiency.driving), efficiency.driven / ratio):
                own = [a[:, k] * share + inertia * ratio * slope[:, columns[k]]]
                own += [b[:, k] * share + inertia * ratio * second[:, columns[k]], d[:, k] * share, c[:, k] * share]
                for part, value in zip(parts, [*own, w[:, k] * share], strict=True):
                    part.append(value[:, None])
        a, b, d, c, w = (
            np.ascontiguousarray(np.concatenate(part, axis=1) if len(part) > 1 else part[0]) for part in parts
        )
        rows, _, curves = self._rows
        return LimitArrays(
            a=a,
            b=b,
            d=d,
            c=c,
            w=w,
            rate=np.ascontiguousarray((first if directions is None else directions)[:, self._columns]),
            motor_rate=np.ascontiguousarray(rate),
            fastest=fastest,
            width=self._widths,
            negligible=NEGLIGIBLE * np.max(np.abs(a), axis=0),
            along=norms.along,
            bend=norms.bend,
            across=norms.across,
            norm=norms.limit,
            creep=self.creep if any(row[1] >= 0 for row in rows) else 0.0,
            rows=list(rows),
            curves=list(curves),
        )

    # ---- speeds

    def _fastest(self, q: Array, first: Array, norms: NormCoefficients) -> Array:
        """The largest path speed (n,) that the limits of speeds, and of accelerations across the path, allow."""
        fastest: Array = np.minimum(1e12, np.min(norms.fastest(), axis=1, initial=np.inf))
        for _, speeds in self.speed_limits(q, first):
            fastest = np.minimum(fastest, speeds)
        return fastest

    def speed_limits(self, q: Array, first: Array, second: Array | None = None) -> list[tuple[NamedLimit, Array]]:
        """The largest path speeds (n,) of each limit of a speed, by name; given `second`, also those of accelerations
        of the tool across the path.
        """
        robot = self.mechanism.robot
        limits = self.limits.of_joints("speed", robot)
        found = []
        with np.errstate(divide="ignore"):
            for joint in robot.joints:
                if np.isfinite(limit := limits[joint.v]):
                    found.append((NamedLimit("speed", joint.name, ""), limit / np.abs(first[:, joint.v])))
            for joint, top in self._shaft_speeds():
                found.append((NamedLimit("motor speed", joint.name, ""), top / np.abs(first[:, joint.v])))
            for what, rates, limit in self._tool.speed_rates(q, first):
                found.append((NamedLimit(what, self._tool_name, ""), limit / rates))
            found = [(name, speeds * self.factors.get(name.group, 1.0)) for name, speeds in found]
            if second is not None:
                tops = self._norms(q, first, second, first).fastest()
                found += [(name, tops[:, k]) for k, name in enumerate(self.names[len(self._rows[1]) :])]
        return found

    def _shaft_speeds(self) -> list[tuple[RobotJoint, float]]:
        """Motors with the largest speed of the joint, rad/s or m/s, that motor and gear allow."""
        found = []
        for k, joint in enumerate(self.mechanism.motors):
            actuator = self.actuators.get(joint.name) if self.limits.actuators else None
            if actuator is None:
                continue
            tops = [actuator.max_speed] if actuator.max_speed is not None else []
            if k in self._driven:
                tops += [points[-1][0] for points in self._driven[k][1:]]
            if isinstance(actuator, MotorWithGear) and actuator.gear.max_speed is not None:
                tops.append(actuator.gear.max_speed)
            if tops:
                found.append((joint, min(tops) / actuator.ratio))
        return found
