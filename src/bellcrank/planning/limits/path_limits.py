"""The limits of a mechanism along a path, as bounds of the path's acceleration.

At each place a limited quantity is  a u + b y² + d y + c + Σ_j w_j σ(q'_j y / width_j)  of the path speed y and the
path acceleration u (path_torques.py): a motor's torque, a share of it at the motor's shaft with the inertia there, or
the acceleration of a joint (limit_rows.py). Limits of speeds are bounds of y.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from bellcrank._planner import LimitArrays, excess
from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.coupled_transmission import CoupledTransmission
from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.dynamics.inverse.mechanism import Mechanism
from bellcrank.planning.limits.limit_rows import (
    CountedLimits,
    LimitRows,
    NamedLimit,
    NormCoefficients,
    ToolLimits,
    limit_rows,
)
from bellcrank.planning.limits.motion_limits import MotionLimits
from bellcrank.planning.limits.motor_limits import DrivenAxes, MotorLimits
from bellcrank.planning.limits.path_torques import PathPlaces, PathTerms, PathTorques
from bellcrank.sizing.loads.motion_grid import ONE_SIDE

if TYPE_CHECKING:
    from bellcrank.planning.joint_path import JointPath

NEGLIGIBLE = 1e-13  # of the largest coefficient of u: smaller ones are rounding
FASTEST = 1e12  # the path speed where nothing limits it


@dataclass(frozen=True, eq=False)
class PathLimits:
    """The limits of a mechanism along paths.

    Attributes:
        mechanism: The mechanism, with payloads and forces.
        actuators: Motor and gear by joint.
        limits: The limits of joints and of a tool.
        factors: Factors on limits, by the group of their names; to see what a limit costs.
        only: The group of the only limits that count; "" for all.
        transmissions: Motors that move several joints together.
    """

    mechanism: Mechanism
    actuators: Mapping[str, Actuator]
    limits: MotionLimits
    factors: Mapping[str, float] = field(default_factory=dict)
    only: str = ""
    transmissions: Sequence[CoupledTransmission] = ()

    def places(self, path: JointPath, s: Array) -> PathPlaces:
        """The states and torques at places s (n,) of a path; factors and the choice of limits do not change them.

        Where a joint stops for no finite part of the path its direction is that behind the place, at the end of the
        path that before it: the loss of its gear is a one-sided limit (sizing/loads/motion_grid.py).
        """
        q, first, second = (path.spline(s, order) for order in (0, 1, 2))
        side = np.where(s < path.length, ONE_SIDE, -ONE_SIDE)[:, None]
        first = np.where(first == 0.0, side * second, first)
        return PathPlaces(q, first, second, self._torques.terms(q, first, second))

    def at(self, path: JointPath, s: Array, directions: Array | None = None) -> LimitArrays:
        """The limits at places s (n,) of a path; Coulomb friction is that of the joints' directions at other places
        (n,) where these are given.
        """
        return self.at_places(self.places(path, s), None if directions is None else path.spline(directions, 1))

    def at_places(self, places: PathPlaces, directions: Array | None = None) -> LimitArrays:
        """The limits at places of a path; Coulomb friction is that of other directions (n, nv) of the joints where they
        are given.
        """
        q, first, second = places.q, places.first, places.second
        norms = self._norms(q, first, second, first)
        return self._arrays(places.terms, first, second, self._fastest(q, first, norms), norms, directions=directions)

    def fastest(self, path: JointPath, s: Array) -> Array:
        """The largest path speed (n,) that the limits of speeds allow at places s (n,) of a path."""
        return self._fastest_of(*(path.spline(s, order) for order in (0, 1, 2)))

    def fastest_at(self, places: PathPlaces) -> Array:
        """The same at places of a path."""
        return self._fastest_of(places.q, places.first, places.second)

    def _fastest_of(self, q: Array, first: Array, second: Array) -> Array:
        return self._fastest(q, first, self._norms(q, first, second, first))

    def of_motion(self, q: Array, v: Array, a: Array) -> LimitArrays:
        """The limits of a motion of positions q, velocities v and accelerations a (n, nv) that is faster by the path
        speed: velocities grow with it, accelerations with its square, and the path acceleration is 0.
        """
        terms, still = self._torques.terms(q, v, a), np.zeros_like(v)
        terms = PathTerms(np.zeros_like(terms.a), terms.b, terms.d, terms.c, terms.w)
        norms = self._norms(q, v, a, still)
        return self._arrays(terms, v, a, self._fastest(q, v, norms), norms, slope=still)

    def excess_of_motion(self, q: Array, v: Array, a: Array) -> Array:
        """The largest shares (n,) by which a motion of positions q, velocities v and accelerations a (n, nv) exceeds
        limits, those of jerk apart; negative within.
        """
        found = np.asarray(excess(self.of_motion(q, v, a), np.ones(len(q)), np.zeros(len(q))))
        for _, speeds in self.speed_limits(q, v):
            found = np.maximum(found, 1.0 / speeds - 1.0)
        return np.asarray(np.maximum.reduce([found, *self._excess_of_curves(q, v, a).values()]))

    def excess_by_limit(self, q: Array, v: Array, a: Array) -> dict[str, Array]:
        """The shares (n,) of `excess_of_motion` for each limit, by its name."""
        terms, still, found = self._torques.terms(q, v, a), np.zeros_like(v), dict[str, Array]()
        terms = PathTerms(np.zeros_like(terms.a), terms.b, terms.d, terms.c, terms.w)
        norms, free, count = self._norms(q, v, a, still), np.full(len(q), FASTEST), len(self._rows.rows)
        for k, name in enumerate(self.names):
            row, norm = slice(k, k + 1) if k < count else slice(0, 0), slice(max(0, k - count), max(0, k + 1 - count))
            along, bend, across = (np.ascontiguousarray(x[:, norm]) for x in (norms.along, norms.bend, norms.across))
            one = NormCoefficients(along, bend, across, norms.limit[norm])
            arrays = self._arrays(terms, v, a, free, one, slope=still, only=row)
            found[str(name)] = np.asarray(excess(arrays, np.ones(len(q)), np.zeros(len(q))))
        for name, speeds in self.speed_limits(q, v):
            found[str(name)] = 1.0 / speeds - 1.0
        return found | self._excess_of_curves(q, v, a)

    def _excess_of_curves(self, q: Array, v: Array, a: Array) -> dict[str, Array]:
        """The shares of motors whose gears have a curve of efficiency, which the rows do not hold exactly."""
        if not self._motors.varying:
            return {}
        torques = self._axes.with_torques(self._torques.exact(np.zeros(len(q)), q, v, a))
        shares = self._motors.excess_of_curves(torques, *map(self._axes.with_coordinates, (v, a)))
        return {f"motor torque of {joint}": share for joint, share in shares.items()}

    def check_states(self, q: Array, first: Array, second: Array) -> None:
        """Raise InputError where the torques at places of a path, with derivatives of the positions with respect to the
        path, are not those of the model.
        """
        self._torques.check_states(q, first, second)

    # ---- names

    @property
    def notes(self) -> tuple[str, ...]:
        """What of the actuators does not limit, or not exactly."""
        return self._motors.notes

    @property
    def axis_names(self) -> tuple[str, ...]:
        """Of each motor, its joint, or the name of a motor that moves several joints."""
        return tuple(axis.name for axis in self._axes.axes)

    @property
    def exact(self) -> bool:
        """Whether the rows are the limits, and not tighter ones, as for gears with a curve of efficiency."""
        return not self._motors.varying

    @cached_property
    def names(self) -> list[NamedLimit]:
        """The names of the rows, and of the norms that follow them."""
        return [*self._rows.names, *(NamedLimit(what, self._tool_name, "") for what in self._norm_names)]

    @property
    def linearised(self) -> list[tuple[int, str]]:
        """Those of the entries that the extension's `linearised` has for each place that are not always left out, with
        the groups of their names: two for each row, the second one for what a load gives back, and the norms.
        """
        rows, names = self._rows.rows, self._rows.names
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
            found[joint.v] *= self._counted.factor(f"jerk of {joint.name}")
        return found

    @property
    def jerk_groups(self) -> list[str]:
        """The names of the limits of jerk, in the order of the joints' coordinates."""
        joints = sorted(self.mechanism.robot.joints, key=lambda joint: joint.v)
        return [f"jerk of {joint.name}" for joint in joints if np.isfinite(self.largest_jerk[joint.v])]

    # ---- parts

    @cached_property
    def _counted(self) -> CountedLimits:
        return CountedLimits(self.factors, self.only)

    @cached_property
    def _torques(self) -> PathTorques:
        return PathTorques(self.mechanism, self.actuators, self._axes)

    @cached_property
    def _axes(self) -> DrivenAxes:
        return DrivenAxes(self.mechanism, self.transmissions)

    @cached_property
    def _motors(self) -> MotorLimits:
        return MotorLimits(self._axes.axes, self.actuators if self.limits.actuators else {})

    @cached_property
    def _rows(self) -> LimitRows:
        return limit_rows(self.mechanism.motors, self.mechanism.robot, self.limits, self._motors, self._counted)

    @cached_property
    def _tool(self) -> ToolLimits:
        return ToolLimits(self.mechanism.robot, self.limits)

    @property
    def _tool_name(self) -> str:
        return f"frame {self.limits.tool}"

    @property
    def _norm_names(self) -> list[str]:
        """What of the tool's acceleration is limited."""
        found = [what for what, _, _ in self._tool.accelerations]
        return [what for what in found if self._counted.counts(f"{what} of {self._tool_name}")]

    def _norms(self, q: Array, first: Array, second: Array, slope: Array) -> NormCoefficients:
        """The limits of the tool's accelerations that count, with their factors."""
        found = self._tool.norms(q, first, second, slope)
        kept = [k for k, (what, _, _) in enumerate(self._tool.accelerations) if what in self._norm_names]
        factors = [self._counted.factor(f"{what} of {self._tool_name}") for what in self._norm_names]
        along, bend, across = (np.ascontiguousarray(x[:, kept]) for x in (found.along, found.bend, found.across))
        return NormCoefficients(along, bend, across, found.limit[kept] * np.array(factors))

    def _arrays(
        self,
        terms: PathTerms,
        first: Array,
        second: Array,
        fastest: Array,
        norms: NormCoefficients,
        *,
        slope: Array | None = None,
        directions: Array | None = None,
        only: slice = slice(None),
    ) -> LimitArrays:
        rows, torques = self._rows, self._torques
        coordinates = self._axes.with_coordinates
        own = terms.of_quantities(rows.quantities, coordinates(first if slope is None else slope), coordinates(second))
        rate = coordinates(first)[:, [axis.column for axis in self._motors.axes]]
        for shaft in self._motors.shafts:
            rate[:, shaft.motor] *= shaft.actuator.ratio
        return LimitArrays(
            a=own.a,
            b=own.b,
            d=own.d,
            c=own.c,
            w=own.w,
            rate=np.ascontiguousarray((first if directions is None else directions)[:, torques.coulomb_columns]),
            motor_rate=np.ascontiguousarray(rate),
            fastest=fastest,
            width=torques.widths,
            negligible=NEGLIGIBLE * np.max(np.abs(own.a), axis=0),
            along=norms.along,
            bend=norms.bend,
            across=norms.across,
            norm=norms.limit,
            rows=list(rows.rows[only]),
            curves=list(rows.curves),
        )

    # ---- speeds

    def _fastest(self, q: Array, first: Array, norms: NormCoefficients) -> Array:
        """The largest path speed (n,) that the limits of speeds, and of accelerations across the path, allow."""
        fastest: Array = np.minimum(FASTEST, np.min(norms.fastest(), axis=1, initial=np.inf))
        for _, speeds in self.speed_limits(q, first):
            fastest = np.minimum(fastest, speeds)
        return fastest

    def speed_limits(self, q: Array, first: Array, second: Array | None = None) -> list[tuple[NamedLimit, Array]]:
        """The largest path speeds (n,) of each limit of a speed, by name; given `second`, also those of accelerations
        of the tool across the path.
        """
        robot = self.mechanism.robot
        limits = self.limits.of_joints("speed", robot)
        limited = [(joint, limits[joint.v]) for joint in robot.joints if np.isfinite(limits[joint.v])]
        found = []
        with np.errstate(divide="ignore"):
            for joint, top in limited:
                found.append((NamedLimit("speed", joint.name, ""), top / np.abs(first[:, joint.v])))
            rates = self._axes.with_coordinates(first)
            for axis, top in self._motors.top_speeds:
                found.append((NamedLimit("motor speed", axis.name, ""), top / np.abs(rates[:, axis.column])))
            for what, rates, limit in self._tool.speed_rates(q, first):
                found.append((NamedLimit(what, self._tool_name, ""), limit / rates))
            found = [(name, speeds * self._counted.factor(name.group)) for name, speeds in found]
            if second is not None:
                across = self._norms(q, first, second, first).fastest()
                found += [(name, across[:, k]) for k, name in enumerate(self.names[len(self._rows.names) :])]
        return found
