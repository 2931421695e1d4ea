"""Sizings of many designs at once, from compiled torques in which what the designs vary is an input.

This needs designs that share the mechanism, its motions (apart from their durations) and the kind of each actuator;
`SizingBatch.single_reason` says why designs of a study are sized one by one instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.actuator_designs import ActuatorDesigns
from bellcrank.cached_values import Portable, cached_property
from bellcrank.dynamics.closed_inverse_dynamics import Linkage
from bellcrank.dynamics.force_table_breakpoints import with_force_rows
from bellcrank.dynamics.mechanism import Mechanism, coulomb_widths
from bellcrank.dynamics.motor_torques import MotorTorques
from bellcrank.elements.expression import has_time
from bellcrank.elements.joint_forces import Damper, Friction
from bellcrank.motion.motion import Motion
from bellcrank.robot.traced_tree import MASS, SCALE
from bellcrank.scene.scene import Scene
from bellcrank.sizing.design_peaks import DesignInputs, DesignMotion, DesignPeaks
from bellcrank.sizing.holding_designs import HoldingSearch
from bellcrank.sizing.joint_loads import JointLoads
from bellcrank.sizing.margin_arrays import margin_arrays
from bellcrank.sizing.massless_motors import massless_motors
from bellcrank.sizing.maxima import maxima
from bellcrank.sizing.motion_grid import grid_along
from bellcrank.sizing.size import sizing_subject
from bellcrank.studies.sizing_axes import Change
from bellcrank.studies.sizing_measures import MARGINS

if TYPE_CHECKING:
    from bellcrank.robot.robot import RobotJoint

Array = NDArray[np.float64]
SHARE = 0.3  # by which each parameter differs in the designs that the grid of a motion is made for
BLOCK = 64  # designs whose peaks are refined together
REGULAR = 1e-3  # of the largest singular value of the dependent joints' Jacobian, at least, along a motion
INERTIA_RATINGS = ("ratio", "rotor_inertia", "gear_inertia")


class SizingBatch(Portable):
    """The sizings of designs of a scene.

    Args:
        scene: The scene, with a parameter for every number of the tree that designs vary.
        changes: What the values of a design change, in order.
        motions: Names of the motions; None: all.
    """

    def __init__(self, scene: Scene, changes: Sequence[Change], motions: Sequence[str] | None) -> None:
        self.scene, self.changes, self.motion_names = scene, tuple(changes), motions

    # ---- what designs share

    @cached_property
    def _subject(self) -> tuple[Mechanism, list[Motion], JointLoads]:
        subject = sizing_subject(self.scene, self.motion_names)
        mechanism = subject.mechanism
        motions = [with_force_rows(mechanism, motion) for motion in subject.motions]
        return mechanism, motions, JointLoads(mechanism, subject.actuators, 0.0)

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism of all designs."""
        return self._subject[0]

    @cached_property
    def _scene(self) -> Scene:
        """The scene with the robot of the mechanism."""
        return replace(self.scene, robot=self.mechanism.robot)

    @cached_property
    def _known(self) -> list[int]:
        """The motors whose shaft torque is known."""
        loads = self._subject[2]
        return [k for k, name in enumerate(loads.joint_names) if loads.knows_shaft(name)]

    @cached_property
    def _with_actuator(self) -> list[int]:
        """The motors with an actuator."""
        return [k for k, name in enumerate(self._subject[2].joint_names) if name in self._subject[2].actuators]

    @cached_property
    def _torques(self) -> MotorTorques:
        mechanism, independent = self.mechanism, tuple["RobotJoint", ...]()
        if isinstance(mechanism, Linkage):
            candidates = [joint for joint in mechanism.robot.joints if joint.nv == 1]
            candidates.sort(key=lambda joint: joint not in mechanism.motors)
            independent = mechanism.kinematics.independent(candidates, self._subject[1][0].name)
        return MotorTorques(self._scene, mechanism.motors, independent)

    @cached_property
    def _representative(self) -> list[Array]:
        """Parameters of the scene, and with each that is varied changed; masses above 0."""
        base, names = self._scene.parameter_values, list(self._scene.parameters)
        varied = {names.index(change.path): change for change in self.changes if change.kind == "parameter"}
        for k, change in varied.items():
            if base[k] == 0.0 and {what for _, what in change.places} & {MASS, SCALE}:
                base[k] = 1.0
        found = [base]
        for k in varied:
            more = base.copy()
            more[k] = (1.0 + SHARE) * base[k] if base[k] else 0.1 * SHARE
            found.append(more)
        return found

    @cached_property
    def _motions(self) -> list[DesignMotion]:
        mechanism, motions, _ = self._subject
        return [DesignMotion(mechanism, motion, self._torques, self._representative) for motion in motions]

    @cached_property
    def _speeds(self) -> list[dict[str, Array]]:
        """Peak and mean speed and the range of position (k,) of the motors' joints along each motion, as sized."""
        mechanism, motions, _ = self._subject
        q, v = ([getattr(joint, name) for joint in mechanism.motors] for name in ("q", "v"))
        found = []
        for motion in motions:
            grid = grid_along(motion)
            values, largest = maxima(
                motion,
                grid,
                lambda _t, position, speed, _a: {
                    "speed": np.abs(speed[:, v]), "highest": position[:, q], "lowest": -position[:, q]
                },
            )  # fmt: skip
            mean = np.einsum("n,nk->k", grid.weight, values["speed"]) / motion.duration
            found.append({name: each.value for name, each in largest.items()} | {"mean": mean})
        return found

    @cached_property
    def holding(self) -> HoldingSearch | None:
        """The search for holding torques; None where a batch does not compute them."""
        if not self.reports_holding:
            return None
        robot, code = self.mechanism.robot, MotorTorques(self._scene, self.mechanism.motors)
        columns = [joint.v for joint in self.mechanism.motors]

        def gravity(q: Array, p: Array) -> Array:
            rest = np.zeros((len(q), robot.nv))
            found = np.zeros((len(q), robot.nv))
            found[:, columns] = code(np.zeros(len(q)), q, rest, rest, p)
            return found

        return HoldingSearch(robot, gravity, self._representative)

    @property
    def reports_holding(self) -> bool:
        """Whether holding torques are measures: of an open chain under gravity alone."""
        mechanism = self.mechanism
        acting = [force for force in mechanism.equations.forces if not isinstance(force, Damper | Friction)]
        return not mechanism.closed and not acting and HoldingSearch.covers(mechanism.robot)

    @cached_property
    def single_reason(self) -> str:
        """Why designs are sized one by one; empty where they are sized together."""
        mechanism, kinds = self.mechanism, {change.kind for change in self.changes}
        others = [change.path for change in self.changes if change.kind == "override"]
        if others:
            return f"'{others[0]}' is no parameter of the equations, rating of an actuator or duration"
        if self.scene.config.transmissions:
            return "the robot has coupled transmissions"
        if "duration" in kinds and (coulomb_widths(mechanism) or self._timed):
            return "Coulomb friction, or a force that depends on time, does not scale with the duration of a motion"
        if isinstance(mechanism, Linkage):
            return self._reason_of_linkage(mechanism)
        return ""

    @property
    def _timed(self) -> bool:
        """Whether a force or constraint depends on time."""
        parts = (*self.mechanism.equations.forces, *self.scene.constraints)
        return any(part.source is not None or has_time(part) for part in parts)

    def _reason_of_linkage(self, mechanism: Linkage) -> str:
        moved = [change.path for change in self.changes if change.moves]
        if moved:
            return f"'{moved[0]}' changes how the joints of the linkage depend on each other"
        if not self._torques.solvable:
            return "the constraints of the linkage are redundant, or many"
        redundant = len(mechanism.motors) > len(self._torques.independent)
        if redundant and any(change.path.rpartition(".")[2] in INERTIA_RATINGS for change in self.changes):
            return "motors share the load of the linkage, so that the inertia of one changes the torques of the others"
        lead = [joint.v for joint in self._torques.independent]
        follow = [v for v in range(mechanism.robot.nv) if v not in lead]
        for motion in self._subject[1]:
            jacobian = mechanism.kinematics.scaled(mechanism.kinematics.jacobian(motion.time, motion.position))
            values = np.linalg.svd(jacobian[:, :, follow], compute_uv=False)
            if not (values[:, -1] > REGULAR * values[:, 0]).all():
                return f"motion '{motion.name}' comes near a dead point of the linkage"
        return ""

    @cached_property
    def unsizable(self) -> str:
        """Why a motor cannot be sized in any design of positive masses; empty where all can."""
        mechanism, motions, _ = self._subject
        base = dict(zip(self._scene.parameters, self._representative[0], strict=True))
        parameters = {n: replace(p, value=float(base[n])) for n, p in self._scene.parameters.items()}
        massive = sizing_subject(replace(self._scene, parameters=parameters), motions[:1]).mechanism
        refused = massless_motors(massive if not mechanism.closed else mechanism, motions).refused
        return "; ".join(refused.values())

    # ---- designs

    def certain(self, values: Array) -> NDArray[np.bool_]:
        """Whether each design (n, axes), in SI units, is one that certainly can be built, and belongs in a batch."""
        good = np.ones(len(values), dtype=bool)
        for change, column in zip(self.changes, values.T, strict=True):
            good &= change.certain(column)
        with np.errstate(invalid="ignore"):
            actuators = self._actuators(values)
            ratings = actuators.ratings
            for low, high in (("rated_torque", "peak_torque"), ("rated_speed", "max_speed")):
                good &= ~(ratings[low] > ratings[high]).any(axis=1)
            good &= ~(ratings["efficiency"] > 1.0).any(axis=1) & ~(ratings["safety_factor"] < 1.0).any(axis=1)
        return good & self._bodies(values)

    def _bodies(self, values: Array) -> NDArray[np.bool_]:
        """Whether inertias that are varied are those of bodies (n,): principal moments of 0 or more."""
        frames, good = self.mechanism.robot.equations.tree.frames, np.ones(len(values), dtype=bool)
        parameters, names = self._parameters(values), list(self._scene.parameters)
        places = {place: k for k, p in enumerate(self._scene.parameters.values()) for place in p.places}
        varied = {names.index(change.path) for change in self.changes if change.kind == "parameter"}
        for frame in {frame for (frame, what), k in places.items() if 10 <= what < 16 and k in varied}:
            entries = [
                parameters[:, places[frame, 10 + k]] if (frame, 10 + k) in places else np.full(len(values), number)
                for k, number in enumerate(frames[frame].inertia)
            ]
            xx, xy, yy, xz, yz, zz = entries
            moments = np.linalg.eigvalsh(np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=1).reshape(-1, 3, 3))
            good &= moments[:, 0] > 0.0
        return good

    def _parameters(self, values: Array) -> Array:
        """The parameters (n, np) of designs."""
        names = list(self._scene.parameters)
        found = np.tile(self._scene.parameter_values, (len(values), 1))
        for change, column in zip(self.changes, values.T, strict=True):
            if change.kind == "parameter":
                found[:, names.index(change.path)] = column
        return found

    def _actuators(self, values: Array) -> ActuatorDesigns:
        """The actuators of the motors that have one, in designs."""
        loads = self._subject[2]
        names = [loads.joint_names[k] for k in self._with_actuator]
        varied = {
            (names.index(change.owner), change.path.rpartition(".")[2]): column
            for change, column in zip(self.changes, values.T, strict=True)
            if change.kind == "rating" and change.owner in names
        }
        return ActuatorDesigns.of([loads.actuators[name] for name in names], varied, len(values))

    def _stretches(self, values: Array) -> list[Array]:
        """The factors (n,) on the duration of each motion."""
        found = []
        for motion in self._subject[1]:
            factor = np.ones(len(values))
            for change, column in zip(self.changes, values.T, strict=True):
                if change.kind == "duration" and change.owner == motion.name:
                    factor = column / motion.duration
            found.append(factor)
        return found

    def measures(self, values: Array) -> tuple[dict[str, Array], NDArray[np.bool_]]:
        """The measures (n,) of designs (n, axes), in SI units, but for smallest margins; and whether all loads of a
        design are finite. A row depends on its own values alone, to the last bit.
        """
        actuators, stretches = self._actuators(values), self._stretches(values)
        loads = self._subject[2]
        shafts = [self._with_actuator.index(k) for k in self._known]
        known = actuators.only(shafts)
        each: list[DesignPeaks] = []
        for motion, stretch in zip(self._motions, stretches, strict=True):
            inputs = DesignInputs(
                parameters=self._parameters(values),
                stretch=stretch,
                actuators=known,
                joints=np.array(self._known, dtype=np.intp),
                rotor_inertia=loads.rotor_inertia,
            )
            each.append(motion.peaks(inputs))
        found = self._joint_measures(values, each, stretches)
        for place, k in enumerate(self._with_actuator):
            found |= self._shaft_measures(place, k, actuators, each, stretches)
        return found, np.logical_and.reduce([peaks.finite for peaks in each])

    def prepare(self) -> None:
        """Compute what all designs share, before threads use it."""
        _ = self._motions, self._speeds, self.holding

    def _joint_measures(
        self, values: Array, each: Sequence[DesignPeaks], stretches: Sequence[Array]
    ) -> dict[str, Array]:
        """The measures at the joints."""
        robot, names = self.mechanism.robot, self._subject[2].joint_names
        highest = np.max([peaks.max_torque for peaks in each], axis=0)
        lowest = np.min([peaks.min_torque for peaks in each], axis=0)
        torque = np.where(highest >= -lowest, highest, -lowest)
        rms = np.max([peaks.rms_torque for peaks in each], axis=0)
        power = np.max([peaks.power for peaks in each], axis=0)
        holding = None if self.holding is None else self.holding.torques(self._parameters(values))
        found: dict[str, Array] = {}
        for k, name in enumerate(names):
            joint = self.mechanism.motors[k]
            speed = self._peak_speed(k, stretches)
            found |= {
                f"{name}.peak_torque": np.abs(torque[:, k]),
                f"{name}.rms_torque": rms[:, k],
                f"{name}.peak_speed": speed,
                f"{name}.peak_power": power[:, k],
            }
            if holding is not None:
                found[f"{name}.holding_torque"] = holding[:, k]
            for limit, used, margin in (
                (float(robot.effort_limit[joint.v]), np.abs(torque[:, k]), "effort_margin"),
                (float(robot.velocity_limit[joint.v]), speed, "velocity_margin"),
            ):
                if np.isfinite(limit):
                    found[f"{name}.{margin}"] = 1.0 - used / limit if limit else np.where(used == 0.0, 0.0, np.nan)
            lower, upper = (float(limits[joint.q]) for limits in (robot.lower, robot.upper))
            low, high = -max(s["lowest"][k] for s in self._speeds), max(s["highest"][k] for s in self._speeds)
            distance = min(low - lower, upper - high)
            if np.isfinite(distance):
                found[f"{name}.position_margin"] = np.full(len(values), distance)
        return found

    def _peak_speed(self, k: int, stretches: Sequence[Array]) -> Array:
        """The peak speed (n,) of the k-th joint over all motions."""
        pairs = zip(self._speeds, stretches, strict=True)
        return np.asarray(np.max([speeds["speed"][k] / stretch for speeds, stretch in pairs], axis=0))

    def _shaft_measures(
        self,
        place: int,
        k: int,
        actuators: ActuatorDesigns,
        each: Sequence[DesignPeaks],
        stretches: Sequence[Array],
    ) -> dict[str, Array]:
        """The measures at the shaft of the k-th motor, whose actuator is that at a place among all."""
        name, ratio = self._subject[2].joint_names[k], actuators.ratings["ratio"][:, place]
        unknown = np.full((len(ratio), len(each)), np.nan)
        torque, rms, curve = unknown, unknown, unknown
        if k in self._known:
            at = self._known.index(k)
            torque = np.stack([peaks.shaft_torque[:, at] for peaks in each], axis=1)
            rms = np.stack([peaks.rms_shaft_torque[:, at] for peaks in each], axis=1)
            if actuators.actuators[place].has_limits:
                curve = np.stack([peaks.curve_use[:, at] for peaks in each], axis=1)
        speed = ratio * self._peak_speed(k, stretches)
        mean = np.stack(
            [ratio * speeds["mean"][k] / stretch for speeds, stretch in zip(self._speeds, stretches, strict=True)],
            axis=1,
        )
        peaks = {"torque": torque.max(axis=1), "speed": speed, "curve": curve.max(axis=1)}
        margins = margin_arrays(actuators, place, peaks, rms, mean)
        found = {"motor_torque": peaks["torque"], "motor_rms_torque": rms.max(axis=1), "motor_speed": speed}
        found |= {MARGINS[criterion][0]: margin for criterion, margin in margins.items()}
        return {f"{name}.{measure}": column for measure, column in found.items()}
