"""Peak loads of many designs of one mechanism along a motion.

The points are those of one grid, made for the mechanism itself and for designs in which one parameter differs at a
time, so that torques are integrated as `bellcrank.size` does (sizing/loads/motion_grid.py); where a design's torque
changes its sign within a part, shaft torques are integrated on both sides of that. Torques come from a compiled
function with the parameters of each design; peaks between the points are refined for many designs at once
(sizing/loads/series_maxima.py). Designs follow the motion, perhaps in other times, or motions of their own that are as
smooth (sizing/loads/design_states.py).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.powertrain import PowerTrains
from bellcrank.actuators.product_arrays import Curves, GearArrays, MotorArrays
from bellcrank.actuators.short_time_limits import curve_use
from bellcrank.arrays import Array, Indices, Mask
from bellcrank.cached_values import cached_property
from bellcrank.dynamics.inverse.input_breakpoints import force_breaks
from bellcrank.dynamics.inverse.mechanism import Mechanism, coulomb_widths
from bellcrank.motion.motion import Motion
from bellcrank.sizing.loads.design_states import MotionStates, OwnGrid
from bellcrank.sizing.loads.motion_grid import (
    GAUSS,
    NOISE,
    ROUNDED,
    Grid,
    coarse_grid_along,
    reversal_times,
    root_mean_square,
    with_probes,
)
from bellcrank.sizing.loads.series_maxima import MaximaSearch

Whole = Indices
Index = Any  # what selects designs or motors: numbers, or arrays of them
Torques = Callable[[Array, Array, Array, Array, Array], Array]  # (t, q, v, a, p) -> (n, k)
LARGEST = 1e100  # N m or N, as in inverse dynamics: larger torques are not used
SERIES = ("max_torque", "min_torque", "power", "shaft_torque", "curve_use")


@dataclass(frozen=True, eq=False, kw_only=True)
class DesignInputs:
    """What differs between n designs of a mechanism with k motors.

    Attributes:
        parameters: The values (n, np) of the scene's parameters.
        states: Their states along the motion.
        joints: Which of the k motors have a known shaft torque.
        actuators: Their actuators, as they are without changes.
        ratings: Their ratings, arrays (n, len(joints)) by the names of `RATINGS`; NaN where unknown. They differ from
            design to design only for actuators that are made from ratings.
        rotor_inertia: Inertias (k,) that the torques of the mechanism contain and that count at the shaft.
    """

    parameters: Array
    states: MotionStates
    joints: Indices
    actuators: tuple[Actuator, ...]
    ratings: Mapping[str, Array]
    rotor_inertia: Array

    def __len__(self) -> int:
        return len(self.parameters)

    @property
    def _each(self) -> Indices:
        return np.tile(np.arange(len(self.actuators)), (len(self), 1))

    @cached_property
    def trains(self) -> PowerTrains:
        """The motors and gears (n, len(joints))."""
        ratings = self.ratings
        motors = MotorArrays.of([one.rows[0] for one in self.actuators])[self._each]
        gears = GearArrays.of([one.rows[1] for one in self.actuators])[self._each]
        driven = np.where(motors.by_ratings == 1.0, ratings["efficiency"], gears.driven_efficiency)
        return PowerTrains(
            motors.with_figures(rotor_inertia=ratings["rotor_inertia"]),
            gears.with_figures(
                ratio=ratings["ratio"],
                efficiency=ratings["efficiency"],
                driven_efficiency=driven,
                inertia=ratings["gear_inertia"],
            ),
        )

    @cached_property
    def curves(self) -> Curves:
        """The torque-speed curves (n, len(joints)) of those that are made from ratings."""
        curves = Curves.of([one.curve or ((0.0, 0.0),) * 3 for one in self.actuators])[self._each]
        for k, one in enumerate(self.actuators):
            if one.curve is None:
                rated, last, peak = (self.ratings[name][:, k] for name in ("rated_speed", "max_speed", "peak_torque"))
                curves.x[:, k, :3] = np.stack([np.zeros(len(self)), rated, last], axis=1)
                curves.y[:, k, :3] = np.stack([peak, peak, np.where(last > rated, 0.0, peak)], axis=1)
        return curves

    def curve_use(self, designs: Index, shafts: Index, torque: Array, velocity: Array) -> Array:
        """The share of the limits of torque over speed that is used, with the safety factor, as `Actuator.curve_use`.

        `torque` is at the shaft, `velocity` at the joint; `designs` and `shafts` (numbers) broadcast with them.
        """
        used = self.ratings["safety_factor"][designs, shafts] * torque
        speed = self.ratings["ratio"][designs, shafts] * velocity
        found = curve_use(self.curves[designs, shafts], used, speed)
        for k, one in enumerate(self.actuators):
            if not one.by_ratings and (here := np.broadcast_to(shafts == k, torque.shape)).any():
                found[here] = one.curve_use(used[here], np.broadcast_to(speed, torque.shape)[here])
        return found


@dataclass(frozen=True, eq=False, kw_only=True)
class DesignPeaks:
    """Peaks of n designs at k motors, and at the shafts of those with known shaft torque; all at least 0 but
    `min_torque`. `finite` (n,) says where torques are numbers below 1e100, and a design's own grid is fine enough for
    them.
    """

    max_torque: Array
    min_torque: Array
    power: Array
    shaft_torque: Array
    curve_use: Array
    rms_torque: Array
    rms_shaft_torque: Array
    finite: Mask


class DesignMotion:
    """A motion along which many designs of a mechanism are sized.

    Args:
        mechanism: The mechanism.
        motion: A motion of all of its joints.
        torques: The torques of its motors, of samples with parameters of their own.
        representative: Parameters (m, np) of designs for which the grid is made.
    """

    def __init__(self, mechanism: Mechanism, motion: Motion, torques: Torques, representative: Sequence[Array]) -> None:
        self.motion, self.torques = motion, torques
        self.columns = [joint.v for joint in mechanism.motors]

        def loads(t: Array, q: Array, v: Array, a: Array) -> Array:
            return np.concatenate([torques(t, q, v, a, p) for p in representative], axis=1)

        probes = reversal_times(motion, coulomb_widths(mechanism))
        coarse = coarse_grid_along(motion, force_breaks(mechanism), loads)
        self.grid: Grid = with_probes(motion, coarse, probes)

    def peaks(self, designs: DesignInputs) -> DesignPeaks:
        """The peaks of designs. Those of one do not depend on the others, to the last bit."""
        k, n = len(self.columns), len(designs)
        count = 3 * k + 2 * len(designs.joints)
        search, finite = MaximaSearch(n, count), np.zeros(n, dtype=bool)
        rms, rms_shaft = np.zeros((n, k)), np.zeros((n, len(designs.joints)))
        for d in range(n):
            grid = designs.states.on_grid(d)
            v, a = grid.velocity.T[self.columns], grid.acceleration.T[self.columns]
            torque = self.torques(
                grid.force_time, grid.position, grid.velocity, grid.acceleration, designs.parameters[d]
            ).T
            torque = np.ascontiguousarray(torque - designs.rotor_inertia[:, None] * a)
            if not (np.abs(torque) < LARGEST).all() or (isinstance(grid, OwnGrid) and not grid.settled(torque)):
                continue
            table = self._series(designs, d, torque, (v, a))
            finite[d] = np.isfinite(table).all()
            if not finite[d]:
                continue
            search.add(d, grid.time, table)
            duration = float(grid.time[-1] - grid.time[0])
            rms[d] = root_mean_square(grid.weight, torque, duration)
            shaft = table[3 * k : 3 * k + len(designs.joints)]
            more = self._missed_at_zeros(designs, d, grid.weight, (torque, v, a), shaft)
            rms_shaft[d] = root_mean_square(grid.weight, shaft, duration, more)
        largest = search.largest(partial(self._between, designs)).value
        cuts = np.cumsum([k, k, k, len(designs.joints)])
        parts = dict(zip(SERIES, np.split(largest, cuts, axis=1), strict=True))
        parts["min_torque"] = -parts["min_torque"]
        return DesignPeaks(**parts, rms_torque=rms, rms_shaft_torque=rms_shaft, finite=finite)

    def _series(self, designs: DesignInputs, d: int, torque: Array, motion: tuple[Array, Array]) -> Array:
        """All series (c, n) of one design, in the order of `SERIES`."""
        of, here = designs.joints, np.arange(len(designs.joints))[:, None]
        speed, rate = motion[0][of], motion[1][of]
        shaft = designs.trains[d, here].shaft_torque(torque[of], speed, rate)
        use = designs.curve_use(d, here, shaft, speed)
        limited = np.array([one.has_limits for one in designs.actuators], dtype=bool)
        use[~limited] = 0.0
        return np.concatenate([torque, -torque, np.abs(torque * motion[0]), np.abs(shaft), use])

    def _missed_at_zeros(
        self, designs: DesignInputs, d: int, weight: Array, loads: tuple[Array, Array, Array], shaft: Array
    ) -> Array:
        """What the integrals of squared shaft torques (c, n) of one design lack (c,), because parts of its grid do
        not end where a joint's torque changes its sign, and the losses of its gear with it. In such a part torque,
        speed and acceleration are parabolas through the points of Gauss's rule, which is applied to both sides of the
        zeros.
        """
        of, missed = designs.joints, np.zeros(len(designs.joints))
        inner = np.flatnonzero(weight > 0.0).reshape(-1, 3)  # the points of Gauss's rule in each part
        at = [line[of][:, inner] for line in loads]
        low, middle, high = np.moveaxis(at[0], 2, 0)
        bend, slope = (low + high - 2.0 * middle) / (2.0 * GAUSS**2), (high - low) / (2.0 * GAUSS)
        with np.errstate(all="ignore"):
            root = -0.5 * (slope + np.copysign(np.sqrt(slope**2 - 4.0 * bend * middle), slope))
            zeros = np.stack([root / bend, middle / root])  # of a parabola, without cancellation
        zeros = np.sort(np.clip(np.nan_to_num(zeros, nan=0.5, posinf=0.5, neginf=-0.5), -0.5, 0.5), axis=0)
        size = np.abs(at[0]).max(axis=2)
        largest = size.max(axis=1, initial=0.0)
        certain = size > np.where(largest > NOISE * largest.max(initial=0.0), ROUNDED * largest, np.inf)[:, None]
        series, part = np.nonzero((np.abs(zeros) < 0.5).any(axis=0) & certain)
        if not len(part):
            return missed
        ends = np.full(len(part), 0.5)
        edges = np.stack([-ends, *zeros[:, series, part], ends])
        length = np.diff(edges, axis=0)[:, :, None]
        place = 0.5 * (edges[1:] + edges[:-1])[:, :, None] + length * GAUSS * np.array([-1.0, 0.0, 1.0])
        lines = []
        for line in at:
            before, centre, after = line[series, part].T[:, None, :, None]
            curve, rise = (before + after - 2.0 * centre) / (2.0 * GAUSS**2), (after - before) / (2.0 * GAUSS)
            lines.append(centre + place * (rise + place * curve))
        lines[1] = np.copysign(lines[1], at[1][series, part, 1][:, None])  # speeds keep their sign in a part
        there = designs.trains[d, series[:, None]].shaft_torque(*lines)
        weight = weight[inner[part]]
        whole = weight.sum(axis=1)
        exact = whole * (length * (weight / whole[:, None]) * there**2).sum(axis=(0, 2))
        np.add.at(missed, series, exact - (weight * shaft[series[:, None], inner[part]] ** 2).sum(axis=1))
        return missed

    def _between(self, designs: DesignInputs, own: Whole, series: Whole, times: Array) -> Array:
        """The values (m,) of series of designs (m,) at times (m,), between the points of the grid."""
        k, shafts, each = len(self.columns), len(designs.joints), np.arange(len(times))
        kind = np.searchsorted(np.cumsum([k, k, k, shafts]), series, side="right")
        shaft = np.where(kind >= 3, series - np.array([0, 0, 0, 3 * k, 3 * k + shafts])[kind], 0)
        column = np.where(kind >= 3, designs.joints[shaft] if shafts else 0, series % k)
        q, v, a = designs.states.between(own, times)
        forces = np.minimum(times, self.grid.force_time[-1])  # the motion ends before a jump at its end
        speed, rate = (x[each, np.array(self.columns)[column]] for x in (v, a))
        torque = self.torques(forces, q, v, a, designs.parameters[own])[each, column]
        torque = torque - designs.rotor_inertia[column] * rate
        line = np.where(kind == 1, -torque, np.where(kind == 2, np.abs(torque * speed), torque))
        if (on := np.flatnonzero(kind >= 3)).size:
            of = own[on], shaft[on]
            load = designs.trains[of].shaft_torque(torque[on], speed[on], rate[on])
            use = designs.curve_use(*of, load, speed[on])
            line[on] = np.where(kind[on] == 3, np.abs(load), use)
        return np.asarray(line)
