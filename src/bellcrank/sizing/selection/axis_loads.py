"""What each motor's axis must deliver along each cycle, and how the masses of actuators change it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from bellcrank.arrays import Array, Indices, Mask
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.sizing.selection.body_loads import AxisLoadSamples, UnitBodyLoads


@dataclass(frozen=True, kw_only=True)
class AddedMass:
    """What an actuator adds at the mount of its axis: point mass, and the inertia of its body as a cylinder.

    Attributes:
        mass: kg.
        axial_inertia: About the joint's axis, kg m².
        transverse_inertia: About an axis across it, kg m².
    """

    mass: float = 0.0
    axial_inertia: float = 0.0
    transverse_inertia: float = 0.0

    @property
    def numbers(self) -> Array:
        """Mass, axial and transverse inertia (3,)."""
        return np.array([self.mass, self.axial_inertia, self.transverse_inertia])


@dataclass(frozen=True, kw_only=True)
class DrivenAxis:
    """What a motor and gear drive: a joint, or one motor coordinate of a coupled transmission.

    Attributes:
        name: The joint's name, or the motor's name in a coupled transmission.
        kind: "rotary" or "linear"; units of the axis are rad, N m or m, N.
        joints: Names of the joints that it moves (one, but for coupled transmissions).
        mount: Name of the link or frame that carries the motor and gear.
        mount_point: Centre of gravity (3,) of the motor and gear in that link or frame, m.
        mount_direction: The axis (3,) of the motor and gear in that link or frame, a unit vector.
        included: The part of an actuator that the robot's URDF contains already; `AxisLoads.with_masses` replaces it.
    """

    name: str
    kind: Literal["rotary", "linear"]
    joints: tuple[str, ...]
    mount: str
    mount_point: tuple[float, ...] = (0.0, 0.0, 0.0)
    mount_direction: tuple[float, ...] = (0.0, 0.0, 1.0)
    included: AddedMass = field(default_factory=AddedMass)


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadCycle:
    """One duty cycle of all k axes: motions and pauses, each sampled once, however often it is repeated.

    The n samples are those of the cycle's different parts, one part after the other. Sums with `weight` are integrals
    over the whole cycle with all repeats; what depends on the order (temperature) follows `sequence`.

    Attributes:
        name: "duty", or the name of the motion that repeats.
        duration: s.
        time: Times (n,), s, at which each sample occurs first.
        weight: Weights (n,), s, of integrals over the cycle; they sum to `duration`, and may be 0 (ends of intervals).
        interval: Number (n,) of the interval that each time belongs to, from 0; heat is averaged over intervals.
        sequence: (first interval, interval after the last, passes) of each part in the order of the cycle; a part may
            occur several times.
        torque: Torque (n, k) at the axis that the actuator must deliver, without the actuator's own inertia.
        static_torque: Torque (n, k) that holds the axis at rest in the posture of each sample.
        speed: Speed (n, k).
        acceleration: Acceleration (n, k).
        position: Position (n, k).
        axial_force: |Force| (n, k) of the joint's wrench along its axis, N; NaN for coupled axes.
        tilting_moment: |Moment| (n, k) of the joint's wrench across its axis, N m, on a prismatic joint the whole
            moment; NaN for coupled axes.
        inertia: Inertia (n, k) of the load felt at the axis, kg m² or kg.
    """

    name: str
    duration: float
    time: Array
    weight: Array
    interval: Indices
    sequence: tuple[tuple[int, int, int], ...]
    torque: Array
    static_torque: Array
    speed: Array
    acceleration: Array
    position: Array
    axial_force: Array
    tilting_moment: Array
    inertia: Array

    @property
    def interval_duration(self) -> Array:
        """The time (p,), s, that one pass of each of the p intervals takes."""
        passes = np.zeros(int(self.interval[-1]) + 1)
        for first, end, count in self.sequence:
            passes[first:end] += count
        return np.bincount(self.interval, self.weight, len(passes)) / passes

    def interval_mean(self, values: Array) -> Array:
        """The mean (p, …) over each interval of values (n, …) at the samples."""
        first = np.searchsorted(self.interval, np.arange(int(self.interval[-1]) + 1))
        weight = self.weight.reshape(-1, *(1,) * (values.ndim - 1))
        return np.asarray(np.add.reduceat(values * weight, first) / np.add.reduceat(weight, first))


@dataclass(frozen=True, eq=False)
class CycleTerms:
    """The loads of a cycle's samples, and what a unit of each body adds to them, from which its LoadCycle is made."""

    samples: AxisLoadSamples
    bodies: tuple[UnitBodyLoads, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class AxisLoads:
    """The cycles of a mechanism, and their change with the masses of its actuators.

    Loads are linear in the added masses and inertias, so a change needs no inverse dynamics.

    Attributes:
        axes: The k axes.
        cycles: The cycles with the masses that the robot's URDF contains.
        influence: (k, k) whether the mass at the mount of axis j (column) changes the load of axis i (row).
        terms: Of each cycle, from which `with_masses` makes it.
        warnings: Sentences about transitions that are not included.
    """

    axes: tuple[DrivenAxis, ...]
    cycles: tuple[LoadCycle, ...]
    influence: Mask
    terms: tuple[CycleTerms, ...]
    warnings: tuple[str, ...] = ()

    def with_masses(self, added: Mapping[str, AddedMass]) -> tuple[LoadCycle, ...]:
        """The cycles with actuators of these masses at the mounts of their axes.

        They replace what the URDF contains (`Axis.included`); an axis that is not named keeps that, so an actuator of
        unknown mass is left out of `added`.

        Args:
            added: What each actuator adds, by the name of the axis.

        Returns:
            The cycles, in the order of `cycles`.

        Raises:
            InputError: An axis is unknown.

        Example:
            >>> import bellcrank as bc
            >>> from bellcrank.sizing.selection.axis_loads import AddedMass
            >>> from bellcrank.dynamics.inverse.mechanism import mechanism_of
            >>> from bellcrank.sizing.selection.axis_loads_of import axis_loads
            >>> arm = bc.load_robot("planar_2r", gravity=(0, -9.81, 0))
            >>> motion = bc.waypoints(arm, [0.0, 1.0], [{}, {"elbow": 1.0}])
            >>> loads = axis_loads(mechanism_of(arm), [motion])
            >>> [cycle] = loads.with_masses({"elbow": AddedMass(mass=2.0)})
            >>> heavier = cycle.static_torque[0] - loads.cycles[0].static_torque[0]
            >>> heavier.round(6)
            array([19.62,  0.  ])
        """
        places = {axis.name: number for number, axis in enumerate(self.axes)}
        changes: dict[int, Array] = {}
        for name, one in added.items():
            if name not in places:
                raise InputError(f"with_masses: {unknown_name('axis', name, places)}")
            change = one.numbers - self.axes[places[name]].included.numbers
            if change.any():
                changes[places[name]] = change
        if not changes:
            return self.cycles
        return tuple(
            _with_loads(cycle, _changed(terms, changes)) for cycle, terms in zip(self.cycles, self.terms, strict=True)
        )


def _changed(terms: CycleTerms, changes: Mapping[int, Array]) -> AxisLoadSamples:
    """The loads of the samples with bodies at the mounts of some axes changed by mass, axial, transverse inertia."""
    changed = AxisLoadSamples(*(np.array(each) for each in terms.samples))
    for number, change in changes.items():
        unit = terms.bodies[number]
        for total, part in (
            (changed.torque, unit.torque),
            (changed.axial_force, unit.axial_force),
            (changed.moment, unit.moment),
            (changed.inertia, unit.inertia),
        ):
            total[:, unit.axes] += (part.reshape(-1, 3) @ change).reshape(part.shape[:-1])  # one product of matrices
        changed.static_torque[:, unit.axes] += change[0] * unit.static_torque
    return changed


def _with_loads(cycle: LoadCycle, samples: AxisLoadSamples) -> LoadCycle:
    return replace(
        cycle,
        torque=samples.torque,
        static_torque=samples.static_torque,
        axial_force=np.abs(samples.axial_force),
        tilting_moment=np.linalg.norm(samples.moment, axis=-1),
        inertia=samples.inertia,
    )
