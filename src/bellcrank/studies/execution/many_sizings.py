"""Sizings of many designs at once, from compiled torques in which what the designs vary is an input.

`size_mechanism` (sizing/mechanism_sizing.py) gives each figure with its time, its posture and its notes, in any
mechanism. Here are the measures alone, of mechanisms whose torques are one compiled function, in 1/65 (UR5) to 1/114
(planar 2R) of its time a design. Both search maxima by series_maxima.py; tests compare them design by design.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from bellcrank.actuators.actuator import RATINGS, Actuator
from bellcrank.arrays import Array, Mask
from bellcrank.motion.entry_kinds import WaypointsEntry
from bellcrank.sizing.loads.design_peaks import DesignInputs, DesignMotion, DesignPeaks
from bellcrank.sizing.loads.design_states import MotionStates, OwnStates, SharedStates, WaypointStates
from bellcrank.studies.designs.scene_designs import SceneDesigns
from bellcrank.studies.execution.shared_sizing import SharedSizing

SHORTEST = 1e-4  # of a motion: designs whose waypoints are closer are sized one by one


class SizingBatch:
    """The sizings of n designs that certainly can be built.

    Args:
        shared: What they share.
        values: What they differ in (n, axes), in SI units.
    """

    def __init__(self, shared: SharedSizing, values: Array) -> None:
        self.shared, self.values = shared, values
        self.parameters = parameters_of(shared, values)
        self.actuators = actuators_of(shared)
        self.ratings = ratings_of(shared, values)
        self.stretches = [self._stretch(motion.name, motion.duration) for motion in shared.motions]

    def __len__(self) -> int:
        return len(self.values)

    def _stretch(self, motion: str, duration: float | Array) -> Array:
        """The factors (n,) on the duration of a motion, s."""
        for change, column in zip(self.shared.changes, self.values.T, strict=True):
            if change.kind == "duration" and change.owner == motion:
                return np.asarray(column / duration)
        return np.ones(len(self))

    def measures(self) -> tuple[dict[str, Array], Mask]:
        """The measures (n,) but for smallest margins, and which designs have them: those that can follow the motions,
        with finite loads. A row depends on its own values alone, to the last bit.
        """
        shared = self.shared
        places = [shared.with_actuator.index(k) for k in shared.known]
        each: list[DesignPeaks] = []
        good = np.ones(len(self), dtype=bool)
        states = self.states(good)
        for own, motion in zip(states, shared.design_motions, strict=True):
            inputs = DesignInputs(
                parameters=self.parameters,
                states=own,
                joints=np.array(shared.known, dtype=np.intp),
                actuators=tuple(self.actuators[place] for place in places),
                ratings={name: column[:, places] for name, column in self.ratings.items()},
                rotor_inertia=shared.loads.rotor_inertia,
            )
            each.append(motion.peaks(inputs))
            good &= each[-1].finite
        self._extremes = [self._extremes_along(k, own) for k, own in enumerate(states)]
        found = {
            f"{one.motion.name}.duration": own.duration for one, own in zip(shared.design_motions, states, strict=True)
        }
        found |= self._joint_measures(each)
        for place, k in enumerate(shared.with_actuator):
            found |= self._shaft_measures(place, k, each)
        return found, good

    def states(self, good: Mask) -> list[MotionStates]:
        """The states of the designs along each motion; `good` (n,) becomes False where a design cannot follow one."""
        shared, linkage = self.shared, self.shared.changed_linkage
        motions = zip(shared.design_motions, self.stretches, strict=True)
        if linkage is None:
            return [self._waypoints(one) or SharedStates(one.motion, one.grid, stretch) for one, stretch in motions]
        varied = [k for k, change in enumerate(shared.changes) if change.kind == "parameter"]
        designs = SceneDesigns(shared.scene, [_ParameterAxis(shared.changes[k].path) for k in varied])
        start = designs.block(self.values[:, varied]).start_position
        found: list[MotionStates] = []
        for one, stretch in motions:
            followed = linkage.kinematics.follow_designs(one.motion, shared.independent, start, self.parameters)
            good &= followed.followed
            found.append(
                OwnStates(
                    motion=one.motion,
                    grid=one.grid,
                    position=followed.position,
                    velocity=followed.velocity,
                    acceleration=followed.acceleration,
                    stretch=stretch,
                )
            )
        return found

    def _waypoints(self, one: DesignMotion) -> WaypointStates | None:
        """The states along a motion through waypoints of each design; None where designs share them."""
        entry, robot = self.shared.entry(one.motion.name), self.shared.mechanism.robot
        if entry is None:
            return None
        knots, points = waypoints_of(self.shared, entry, self.values)
        own = (knots[:, -1] - knots[:, 0]) / entry.speed_factor
        factor = self._stretch(one.motion.name, own) / entry.speed_factor
        times = np.array(entry.times)
        times = times[0] + 1.0 / entry.speed_factor * (times - times[0])  # of the motion, as `stretched` has them
        return WaypointStates(robot.joints, one.grid, times, knots, points, factor, bool(self.shared.known))

    def _extremes_along(self, k: int, states: MotionStates) -> dict[str, Array]:
        """Of the motors' joints along the k-th motion (n, joints): see `SharedSizing.speeds`."""
        if isinstance(states, WaypointStates):
            motors = self.shared.mechanism.motors
            return states.extremes([joint.q for joint in motors], [joint.v for joint in motors])
        shared = {name: np.tile(each, (len(self), 1)) for name, each in self.shared.speeds[k].items()}
        return shared | {"peak": shared["peak"] / self.stretches[k][:, None]}

    def _joint_measures(self, each: Sequence[DesignPeaks]) -> dict[str, Array]:
        """The measures at the joints."""
        shared, robot = self.shared, self.shared.mechanism.robot
        highest = np.max([peaks.max_torque for peaks in each], axis=0)
        lowest = np.min([peaks.min_torque for peaks in each], axis=0)
        torque = np.maximum(np.abs(highest), np.abs(lowest))
        rms = np.max([peaks.rms_torque for peaks in each], axis=0)
        power = np.max([peaks.power for peaks in each], axis=0)
        holding = None if shared.holding is None else shared.holding.torques(self.parameters)
        found: dict[str, Array] = {}
        for k, joint in enumerate(shared.mechanism.motors):
            speed = self._extreme("peak", k)
            own = {
                "peak_torque": torque[:, k],
                "rms_torque": rms[:, k],
                "peak_speed": speed,
                "peak_power": power[:, k],
            }
            if holding is not None:
                own["holding_torque"] = holding[:, k]
            for limit, used, margin in (
                (float(robot.effort_limit[joint.v]), torque[:, k], "effort_margin"),
                (float(robot.velocity_limit[joint.v]), speed, "velocity_margin"),
            ):
                if np.isfinite(limit):
                    own[margin] = 1.0 - used / limit if limit else np.where(used == 0.0, 0.0, -np.inf)
            lower, upper = (float(limits[joint.q]) for limits in (robot.lower, robot.upper))
            low, high = (self._extreme(name, k) for name in ("lowest", "highest"))
            if np.isfinite(lower) or np.isfinite(upper):
                own["position_margin"] = np.minimum(-low - lower, upper - high)
            found |= {f"{joint.name}.{name}": column for name, column in own.items()}
        return found

    def _extreme(self, name: str, k: int) -> Array:
        """The extreme (n,) of the k-th joint over all motions."""
        return np.asarray(np.max([one[name][:, k] for one in self._extremes], axis=0))

    def _shaft_measures(self, place: int, k: int, each: Sequence[DesignPeaks]) -> dict[str, Array]:
        """The measures at the shaft of the k-th motor, whose actuator is that at a place among all."""
        shared, ratio = self.shared, self.ratings["ratio"][:, place]
        torque = rms = curve = np.full((len(self), len(each)), np.nan)
        if k in shared.known:
            at = shared.known.index(k)
            torque = np.stack([peaks.shaft_torque[:, at] for peaks in each], axis=1)
            rms = np.stack([peaks.rms_shaft_torque[:, at] for peaks in each], axis=1)
            if self.actuators[place].has_limits:
                curve = np.stack([peaks.curve_use[:, at] for peaks in each], axis=1)
        speed = ratio * self._extreme("peak", k)
        rating = {name: values[:, place] for name, values in self.ratings.items()}
        peak, effective, factor = torque.max(axis=1), rms.max(axis=1), rating["safety_factor"]
        margins = {  # what the criteria of these names (sizing/selection) say of ratings
            "peak_torque_margin": 1.0 - factor * peak / rating["peak_torque"],
            "continuous_torque_margin": 1.0 - factor * effective / rating["rated_torque"],
            "speed_margin": 1.0 - speed / rating["max_speed"],
            "curve_margin": 1.0 - curve.max(axis=1),
        }
        found = {"motor_torque": peak, "motor_rms_torque": effective, "motor_speed": speed} | margins
        found["drive_margin"] = np.min(list(margins.values()), axis=0)
        return {f"{shared.loads.joint_names[k]}.{measure}": column for measure, column in found.items()}


def certain(shared: SharedSizing, values: Array) -> Mask:
    """Whether each design (n, axes), in SI units, is one that certainly can be built; others are checked singly."""
    good = np.ones(len(values), dtype=bool)
    for change, column in zip(shared.changes, values.T, strict=True):
        good &= change.certain(column)
    ratings = ratings_of(shared, values)
    with np.errstate(invalid="ignore"):  # NaN is unknown, and accepted
        for low, high in (("rated_torque", "peak_torque"), ("rated_speed", "max_speed")):
            good &= ~(ratings[low] > ratings[high]).any(axis=1)
        good &= ~(ratings["efficiency"] > 1.0).any(axis=1) & ~(ratings["safety_factor"] < 1.0).any(axis=1)
    for name in dict.fromkeys(change.owner for change in shared.changes if change.kind == "waypoint"):
        entry = shared.entry(name)
        assert entry is not None
        times = waypoints_of(shared, entry, values)[0]
        good &= (np.diff(times, axis=1) > SHORTEST * np.ptp(times, axis=1)[:, None]).all(axis=1)
    return good & _bodies(shared, values)


def _bodies(shared: SharedSizing, values: Array) -> Mask:
    """Whether the inertias (n,) that are varied are those of bodies: principal moments above 0."""
    frames, good = shared.mechanism.robot.equations.tree.frames, np.ones(len(values), dtype=bool)
    parameters, names = parameters_of(shared, values), list(shared.scene.parameters)
    places = {place: k for k, one in enumerate(shared.scene.parameters.values()) for place in one.places}
    varied = {names.index(change.path) for change in shared.changes if change.kind == "parameter"}
    for frame in {frame for (frame, what), k in places.items() if 10 <= what < 16 and k in varied}:
        xx, xy, yy, xz, yz, zz = (
            parameters[:, places[frame, 10 + k]] if (frame, 10 + k) in places else np.full(len(values), number)
            for k, number in enumerate(frames[frame].inertia)
        )
        moments = np.linalg.eigvalsh(np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=1).reshape(-1, 3, 3))
        good &= moments[:, 0] > 0.0
    return good


def parameters_of(shared: SharedSizing, values: Array) -> Array:
    """The parameters (n, np) of designs (n, axes)."""
    names = list(shared.scene.parameters)
    found = np.tile(shared.scene.parameter_values, (len(values), 1))
    for change, column in zip(shared.changes, values.T, strict=True):
        if change.kind == "parameter":
            found[:, names.index(change.path)] = column
    return found


def waypoints_of(shared: SharedSizing, entry: WaypointsEntry, values: Array) -> tuple[Array, Array]:
    """The times (n, k), s, and postures (n, k, nq) of the waypoints of designs (n, axes) along a motion."""
    robot = shared.mechanism.robot
    knots = np.tile(np.array(entry.times), (len(values), 1))
    points = np.tile(np.stack([robot.posture(one) for one in entry.positions]), (len(values), 1, 1))
    for change, column in zip(shared.changes, values.T, strict=True):
        if change.kind == "waypoint" and change.owner == entry.name:
            k, coordinate = change.waypoint
            if coordinate is None:
                knots[:, k] = column
            else:
                points[:, k, coordinate] = column
    return knots, points


def actuators_of(shared: SharedSizing) -> list[Actuator]:
    """The actuators of the motors that have one, without changes."""
    return [shared.loads.actuators[shared.loads.joint_names[k]] for k in shared.with_actuator]


def ratings_of(shared: SharedSizing, values: Array) -> dict[str, Array]:
    """The ratings (n, actuators) of designs (n, axes); NaN where unknown."""
    names = [shared.loads.joint_names[k] for k in shared.with_actuator]
    stated = {name: np.array([getattr(one, name) for one in actuators_of(shared)], dtype=float) for name in RATINGS}
    found = {name: np.tile(each, (len(values), 1)) for name, each in stated.items()}
    for change, column in zip(shared.changes, values.T, strict=True):
        if change.kind == "rating" and change.owner in names:
            found[change.path.rpartition(".")[2]][:, names.index(change.owner)] = column
    return found


class _ParameterAxis:
    """A parameter as an axis of designs, in its SI unit."""

    unit, numeric = "", True

    def __init__(self, name: str) -> None:
        self.path = name

    def value(self, number: float) -> Any:
        """The number."""
        return number
