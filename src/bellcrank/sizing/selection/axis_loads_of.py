"""`axis_loads`: the cycles of all axes of a mechanism, without its actuators."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.coupled_transmission import CoupledTransmission, checked_transmissions
from bellcrank.actuators.mount import Mount, checked_mounts
from bellcrank.arrays import Array, Mask
from bellcrank.dynamics.inverse.input_breakpoints import with_force_rows
from bellcrank.dynamics.inverse.mechanism import Mechanism
from bellcrank.errors import InputError
from bellcrank.motion.motion import Motion, require_joints
from bellcrank.motion.motion_entry import DutyStep
from bellcrank.sizing.loads.joint_loads import axis_coordinates, of_axes
from bellcrank.sizing.loads.load_checks import refuse_non_finite
from bellcrank.sizing.selection.axis_loads import AddedMass, AxisLoads, CycleTerms, DrivenAxis, LoadCycle
from bellcrank.sizing.selection.body_loads import AxisLoadSamples, LoadModel, UnitBodyLoads
from bellcrank.sizing.selection.load_cycles import PlannedCycle, Shafts, planned_cycles, transition_notes
from bellcrank.sizing.selection.mounted_bodies import MountedBody, MountKinematics, States


def axis_loads(
    mechanism: Mechanism,
    motions: Sequence[Motion],
    duty: Sequence[DutyStep] | None = None,
    transmissions: Sequence[CoupledTransmission] = (),
    mounts: Mapping[str, Mount] | None = None,
    drives: Mapping[str, Actuator] | None = None,
    mass_tolerance: float = 0.0,
    added: Mapping[str, AddedMass] | None = None,
) -> AxisLoads:
    """What the motor of each axis must deliver along the cycles of a mechanism.

    The reflected inertia of rotors at the motors' joints, which the robot of a configuration with actuators has, is not
    part of the loads; nor are masses of actuators, except those that the links of the URDF contain. Friction of joints,
    and forces of a scene, are.

    Args:
        mechanism: An open chain or a linkage.
        motions: Motions of all of its joints, each with another name.
        duty: The order of motions and pauses in the cycle; None: each motion is a cycle that repeats.
        transmissions: Coupled transmissions, whose motors are axes in place of their joints.
        mounts: Where actuators are mounted, by the name of the axis, where that is not the joint's parent link.
        drives: Actuators by the name of the axis, whose largest shaft torques and shares of torque-speed limits are
            among the samples.
        mass_tolerance: Share by which each link's mass and inertia may be off. Each cycle is then there twice: with the
            torques that load the drive's shaft most, and with those of the largest size.
        added: What actuators add, by the name of the axis: the largest loads with these masses are among the samples.
            The loads are without them; `AxisLoads.with_masses` adds them.

    Returns:
        The loads of each cycle.

    Raises:
        InputError: A motion is of another robot; a name is unknown; or a load is not a finite number.
        UnreachableError: The motors of a linkage cannot move it.

    Example:
        >>> import bellcrank as bc
        >>> from bellcrank.dynamics.inverse.mechanism import mechanism_of
        >>> from bellcrank.sizing.selection.axis_loads_of import axis_loads
        >>> arm = bc.load_robot("planar_2r")
        >>> motion = bc.waypoints(arm, [0.0, 1.0], [{}, {"elbow": 1.0}])
        >>> loads = axis_loads(mechanism_of(arm), [motion])
        >>> [axis.name for axis in loads.axes], loads.cycles[0].duration
        (['shoulder', 'elbow'], 1.0)
    """
    return axis_model(mechanism, motions, transmissions, mounts).along(motions, duty, drives, mass_tolerance, added)


def axis_model(
    mechanism: Mechanism,
    motions: Sequence[Motion],
    transmissions: Iterable[CoupledTransmission] | None,
    mounts: Mapping[str, Mount] | None,
) -> AxisModel:
    """The axes of a mechanism and the model of their loads. Raises InputError as `axis_loads`, but for loads."""
    if not mechanism.motors:
        raise InputError(f"loads of {mechanism.robot.name}: the robot has no joint that a motor could drive")
    for motion in motions:
        require_joints(motion, mechanism.robot)
    names = [motion.name for motion in motions]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"loads of {mechanism.robot.name}: two motions are named '{name}'; give one another name")
    chosen = checked_mounts(mounts)
    coupled = axis_coordinates(mechanism, checked_transmissions(transmissions))
    kinematics = MountKinematics(mechanism, coupled.mounted_at, chosen)
    _check_included(mechanism, kinematics.bodies, chosen)
    axes = tuple(
        DrivenAxis(
            name=body.name,
            kind=kind,
            joints=joints,
            mount=body.mount,
            mount_point=body.mount_point,
            mount_direction=body.mount_direction,
            included=_included(chosen.get(body.name)),
        )
        for body, kind, joints in zip(kinematics.bodies, coupled.kinds, coupled.joints, strict=True)
    )
    return AxisModel(axes, LoadModel(kinematics, coupled.matrix))


@dataclass(frozen=True, eq=False)
class AxisModel:
    """The axes of a mechanism, and the model of their loads."""

    axes: tuple[DrivenAxis, ...]
    model: LoadModel

    def along(
        self,
        motions: Sequence[Motion],
        duty: Sequence[DutyStep] | None,
        drives: Mapping[str, Actuator] | None = None,
        mass_tolerance: float = 0.0,
        added: Mapping[str, AddedMass] | None = None,
        other_masses: bool = True,
    ) -> AxisLoads:
        """The loads of each cycle: see `axis_loads`; without `other_masses` those of the given masses alone."""
        model, names = self.model, [axis.name for axis in self.axes]
        mechanism = model.mechanism
        changes = {
            number: one.numbers - axis.included.numbers
            for number, axis in enumerate(self.axes)
            if (one := (added or {}).get(axis.name)) is not None
        }
        motions = [with_force_rows(mechanism, motion) for motion in motions]
        given = {names.index(name): one for name, one in (drives or {}).items() if not one.unknown_of_torque}
        plans = planned_cycles(
            mechanism,
            motions,
            duty,
            lambda *states: model.laden_torques(States(*states), changes),
            _shafts(given, model.coordinates),
        )
        terms = tuple(_terms(model, plan, names, other_masses) for plan in plans)
        cycles = tuple(_cycle(model, plan, each.samples) for plan, each in zip(plans, terms, strict=True))
        if mass_tolerance:
            cycles = tuple(
                worst
                for plan, cycle in zip(plans, cycles, strict=True)
                for worst in _off_by(model, plan, cycle, mass_tolerance, given)
            )
        return AxisLoads(
            axes=self.axes,
            cycles=cycles,
            influence=_influence(len(names), terms),
            terms=terms,
            warnings=transition_notes(mechanism, motions, duty),
        )


def _shafts(drives: Mapping[int, Actuator], coordinates: Array) -> Shafts | None:
    """The shaft torques of drives, by the number of the axis, and the shares of limits that they use, of the torques,
    speeds and accelerations (n, k) of joints; None without drives.
    """
    if not drives:
        return None
    force = np.linalg.inv(coordinates)

    def found(torque: Array, speed: Array, acceleration: Array) -> dict[str, Array]:
        axes = torque @ force, speed @ coordinates.T, acceleration @ coordinates.T
        shaft = np.stack([one.shaft_torque(*(each[:, k] for each in axes)) for k, one in drives.items()], axis=1)
        uses = [
            one.limit_uses(one.safety_factor * shaft[:, place], one.ratio * axes[1][:, k])
            for place, (k, one) in enumerate(drives.items())
        ]
        return {"shaft": np.abs(shaft), "limits": np.concatenate(uses).T}

    return found


def _off_by(
    model: LoadModel, plan: PlannedCycle, cycle: LoadCycle, tolerance: float, drives: Mapping[int, Actuator]
) -> tuple[LoadCycle, LoadCycle]:
    """A cycle with each link's mass and inertia off by a share: at each sample with the torque that loads the shaft of
    the drive most, and with the torque of the largest size. Peaks are reached; means of squares are upper bounds.
    """
    states = [part.states for part in plan.parts]
    links = np.concatenate([model.mechanism.link_torques(*each) for each in states])
    spread = tolerance * np.abs(links @ np.linalg.inv(model.coordinates)).sum(axis=1)
    low, high = cycle.torque - spread, cycle.torque + spread
    largest = np.where(np.abs(low) > np.abs(high), low, high)
    at_shaft = largest.copy()
    for k, one in drives.items():
        ends = [one.shaft_torque(end[:, k], cycle.speed[:, k], cycle.acceleration[:, k]) for end in (low, high)]
        at_shaft[:, k] = np.where(np.abs(ends[0]) > np.abs(ends[1]), low[:, k], high[:, k])
    return replace(cycle, torque=at_shaft), replace(cycle, torque=largest)


def _check_included(mechanism: Mechanism, bodies: Sequence[MountedBody], mounts: Mapping[str, Mount]) -> None:
    """InputError where more mass is said to be included than there is."""
    tree, set_masses = mechanism.robot.equations.tree, mechanism.equations.set_masses
    for carrier in {body.carrier for body in bodies if body.carrier}:
        frames = [k for k, frame in enumerate(tree.frames) if frame.parent_joint == carrier]
        there = sum(set_masses.get(k, tree.frames[k].mass) for k in frames)
        stated = {body.name: mounts[body.name].included_mass for body in bodies
                  if body.carrier == carrier and body.name in mounts}  # fmt: skip
        if sum(stated.values()) > there * (1.0 + 1e-9):
            masses = ", ".join(f"{name} {mass:.4g} kg" for name, mass in stated.items() if mass)
            raise InputError(
                f"mounts of {mechanism.robot.name}: included_mass: {masses}: the links that move with joint "
                f"'{tree.joints[carrier - 1].name}', which carry {'it' if len(stated) == 1 else 'them'}, have a mass "
                f"of {there:.4g} kg altogether"
            )


def _included(mount: Mount | None) -> AddedMass:
    """What the URDF contains of an actuator."""
    if mount is None:
        return AddedMass()
    return AddedMass(
        mass=mount.included_mass,
        axial_inertia=mount.included_axial_inertia,
        transverse_inertia=mount.included_transverse_inertia,
    )


def _terms(model: LoadModel, plan: PlannedCycle, names: Sequence[str], other_masses: bool) -> CycleTerms:
    """The loads of all parts of a cycle, one after the other, and with `other_masses` what bodies would change."""
    samples, bodies = [], []
    with np.errstate(all="ignore"):  # what overflows or is not a number is refused, with its place
        for part in plan.parts:
            samples.append(model.loads(part.states))
            bodies.append(model.unit_bodies(part.states) if other_masses else ())
    whole = AxisLoadSamples(*(np.concatenate(each) for each in zip(*samples, strict=True)))
    time = np.concatenate([part.time for part in plan.parts])
    quantities = {"torque": whole.torque, "static torque": whole.static_torque, "inertia": whole.inertia}
    refuse_non_finite(f"cycle '{plan.name}' of {model.mechanism.robot.name}", list(names), time, quantities)
    return CycleTerms(whole, tuple(_joined(parts) for parts in zip(*bodies, strict=True)))


def _joined(parts: Sequence[UnitBodyLoads]) -> UnitBodyLoads:
    """The loads of one body along all parts of a cycle."""
    return UnitBodyLoads(
        parts[0].axes, *(np.concatenate(each) for each in zip(*(part[1:] for part in parts), strict=True))
    )


def _cycle(model: LoadModel, plan: PlannedCycle, samples: AxisLoadSamples) -> LoadCycle:
    """A cycle with the loads of its samples."""
    passes = [sum(count for number, count in plan.order if number == k) for k in range(len(plan.parts))]
    edges = np.cumsum([0, *(part.intervals for part in plan.parts)])
    coordinates, motors = model.coordinates, model.mechanism.motors
    positions, columns = [joint.q for joint in motors], [joint.v for joint in motors]

    def along(values: Sequence[Array]) -> Array:
        return of_axes(coordinates, np.concatenate(values))

    states = [part.states for part in plan.parts]
    return LoadCycle(
        name=plan.name,
        duration=sum(plan.parts[number].duration * count for number, count in plan.order),
        time=np.concatenate([part.time + start for part, start in zip(plan.parts, _starts(plan), strict=True)]),
        weight=np.concatenate([part.weight * count for part, count in zip(plan.parts, passes, strict=True)]),
        interval=np.concatenate([part.interval + edge for part, edge in zip(plan.parts, edges[:-1], strict=True)]),
        sequence=tuple((int(edges[number]), int(edges[number + 1]), count) for number, count in plan.order),
        torque=samples.torque,
        static_torque=samples.static_torque,
        speed=along([each.velocity[:, columns] for each in states]),
        acceleration=along([each.acceleration[:, columns] for each in states]),
        position=along([each.position[:, positions] for each in states]),
        axial_force=np.abs(samples.axial_force),
        tilting_moment=np.linalg.norm(samples.moment, axis=-1),
        inertia=samples.inertia,
    )


def _starts(plan: PlannedCycle) -> list[float]:
    """The time at which each part of a cycle occurs first."""
    starts: dict[int, float] = {}
    time = 0.0
    for number, count in plan.order:
        starts.setdefault(number, time)
        time += plan.parts[number].duration * count
    return [starts[number] for number in range(len(plan.parts))]


def _influence(k: int, terms: Sequence[CycleTerms]) -> Mask:
    """Whether a body at the mount of axis j (column) changes a load of axis i (row) anywhere."""
    found = np.zeros((k, k), dtype=bool)
    for cycle in terms:
        for number, unit in enumerate(cycle.bodies):
            for part in unit[1:]:
                others = tuple(axis for axis in range(part.ndim) if axis != 1)
                found[unit.axes, number] |= (np.nan_to_num(part) != 0.0).any(axis=others)
    return found
