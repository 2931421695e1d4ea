"""The limits that motors and gears set to torques and speeds of their joints."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.coupled_transmission import CoupledTransmission
from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.dynamics.inverse.mechanism import Mechanism
from bellcrank.sizing.loads.joint_loads import AxisCoordinates, axis_coordinates, of_axes

# ---- The axes that motors drive: their joints, or with coupled transmissions several of them each.


class DrivenAxis(NamedTuple):
    """An axis: its name, that of a joint or of a motor, the column of its coordinate, and that of its torque."""

    name: str
    column: int
    torque: int


@dataclass(frozen=True, eq=False)
class DrivenAxes:
    """The axes of a mechanism's k motors, θ = C q of their joints, with torques C⁻ᵀ τ (see `CoupledTransmission`).

    Attributes:
        mechanism: The mechanism.
        transmissions: Its coupled transmissions.
    """

    mechanism: Mechanism
    transmissions: Sequence[CoupledTransmission] = ()

    @cached_property
    def axes(self) -> tuple[DrivenAxis, ...]:
        """The axes, in the order of the motors' joints."""
        motors, first = self.mechanism.motors, self.mechanism.robot.nv
        if not self.transmissions:
            return tuple(DrivenAxis(joint.name, joint.v, k) for k, joint in enumerate(motors))
        return tuple(
            DrivenAxis(name, first + k, len(motors) + k) for k, name in enumerate(self._coordinates.mounted_at)
        )

    def with_coordinates(self, rates: Array) -> Array:
        """Derivatives (n, nv) of the joints' coordinates, with those of all axes after them where some are coupled."""
        if not self.transmissions:
            return rates
        columns = [joint.v for joint in self.mechanism.motors]
        return np.concatenate([rates, of_axes(self._coordinates.matrix, rates[:, columns])], axis=1)

    def with_torques(self, torques: Array) -> Array:
        """Torques (..., k) of the joints, with those at all axes after them where some are coupled."""
        if not self.transmissions:
            return torques
        return np.concatenate([torques, torques @ self._inverse], axis=-1)

    @cached_property
    def _coordinates(self) -> AxisCoordinates:
        return axis_coordinates(self.mechanism, self.transmissions)

    @cached_property
    def _inverse(self) -> Array:
        return np.asarray(np.linalg.inv(self._coordinates.matrix))


class GearEfficiencies(NamedTuple):
    """Efficiencies of a gear.

    Attributes:
        driving: Where the motor drives: the torque at the shaft is τ / (N driving).
        driven: Where the load gives power back: it is τ driven / N.
        varies: Whether they depend on the load; then they are the lowest and the highest value of the curve, with which
            the shaft torque is larger than it is while driving, and larger than it is while braking.
    """

    driving: float
    driven: float
    varies: bool


def gear_efficiencies(actuator: Actuator) -> GearEfficiencies:
    """The efficiencies of an actuator whose shaft torque is known."""
    gear = actuator.rows[1]
    if gear.efficiency_curve is not None:
        values = [efficiency for _, efficiency in gear.efficiency_curve]
        driven = max(values) if gear.back_efficiency is None else gear.back_efficiency
        return GearEfficiencies(min(values), driven, min(values) != max(values))
    driving = 1.0 if gear.efficiency is None else gear.efficiency
    return GearEfficiencies(driving, driving if gear.back_efficiency is None else gear.back_efficiency, False)


class ShaftLimit(NamedTuple):
    """The actuator of the motor of number `motor`, with its torque over speed at the shaft where it drives and where it
    brakes, and the efficiencies of its gear.
    """

    motor: int
    actuator: Actuator
    driving: Polyline
    braking: Polyline
    efficiency: GearEfficiencies


@dataclass(frozen=True, eq=False)
class MotorLimits:
    """The limits of actuators.

    Attributes:
        axes: The axes of the motors.
        actuators: The actuators that limit, by axis.
    """

    axes: tuple[DrivenAxis, ...]
    actuators: Mapping[str, Actuator]

    @property
    def shafts(self) -> tuple[ShaftLimit, ...]:
        """Of actuators whose shaft torque is known and has limits."""
        return self._found[0]

    @property
    def notes(self) -> tuple[str, ...]:
        """What of the actuators does not limit, or not exactly."""
        return self._found[1]

    @cached_property
    def _found(self) -> tuple[tuple[ShaftLimit, ...], tuple[str, ...]]:
        found, notes = [], list[str]()
        for k, name, actuator in self._given:
            of_motor = f"of the motor at joint '{name}'"
            if actuator.unknown_of_torque:
                unknown = ", ".join(actuator.unknown_of_torque)
                notes.append(f"the torque {of_motor} is not limited: its {unknown} is unknown")
                continue
            curves = torque_speed_polylines(actuator)
            if curves is None:
                notes.append(f"the torque {of_motor} is not limited: its limit over speed is unknown")
                continue
            if actuator.unknown_limits:
                unknown = " and ".join(actuator.unknown_limits)
                notes.append(f"{of_motor} {unknown} is unknown and does not limit the motion")
            efficiency = gear_efficiencies(actuator)
            if efficiency.varies:
                notes.append(
                    f"the efficiency of the gear at joint '{name}' is a curve over the load: its lowest value, "
                    f"{100.0 * efficiency.driving:.3g} %, limits the motion where the motor drives, and its highest, "
                    f"{100.0 * efficiency.driven:.3g} %, where the load gives power back; a faster motion may exist"
                )
            found.append(ShaftLimit(k, actuator, *curves, efficiency))
        return tuple(found), tuple(notes)

    @property
    def _given(self) -> list[tuple[int, str, Actuator]]:
        """Number, axis and actuator of the motors that have one."""
        named = [(k, axis.name, self.actuators.get(axis.name)) for k, axis in enumerate(self.axes)]
        return [(k, name, actuator) for k, name, actuator in named if actuator is not None]

    @cached_property
    def gear_torques(self) -> dict[int, float]:
        """By motor: the largest torque, N m or N, that the gear may pass on repeatedly, with the safety factor."""
        found = {}
        for k, _, actuator in self._given:
            if (limit := actuator.rows[1].repeated_peak_torque) is not None:
                found[k] = limit / actuator.safety_factor
        return found

    @cached_property
    def top_speeds(self) -> list[tuple[DrivenAxis, float]]:
        """Axes with their largest speed, rad/s or m/s, that motor and gear allow."""
        last = {shaft.motor: (shaft.driving[-1][0], shaft.braking[-1][0]) for shaft in self.shafts}
        found = []
        for k, _, actuator in self._given:
            tops = [*last.get(k, ())]
            tops += [top for top in (actuator.max_speed, actuator.rows[1].max_speed) if top is not None]
            if tops:
                found.append((self.axes[k], min(tops) / actuator.ratio))
        return found

    @property
    def varying(self) -> list[ShaftLimit]:
        """Those whose gears have a curve of efficiency."""
        return [shaft for shaft in self.shafts if shaft.efficiency.varies]

    def excess_of_curves(self, torque: Array, v: Array, a: Array) -> dict[str, Array]:
        """The shares (n,) by which torques, velocities v and accelerations a (n, columns of the axes) exceed the limits
        of motors whose gears have a curve of efficiency, by axis; negative within.
        """
        found = {}
        for shaft in self.varying:
            actuator, axis = shaft.actuator, self.axes[shaft.motor]
            column = axis.column
            needed = actuator.shaft_torque(torque[:, axis.torque], v[:, column], a[:, column])
            use = actuator.curve_use(actuator.safety_factor * needed, actuator.ratio * v[:, column])
            found[axis.name] = np.where(np.isnan(use), -np.inf, use - 1.0)
        return found


# ---- The limits of torque over speed at a motor's shaft as polylines, for driving and for braking.


Polyline = tuple[tuple[float, float], ...]
SAMPLES = 401
STRAIGHT = 1e-9  # of the largest torque: a corner bends more than this


def torque_speed_polylines(actuator: Actuator) -> tuple[Polyline, Polyline] | None:
    """(speed rad/s, torque N m) of the largest torque that drives the shaft, and of the largest that brakes it, without
    the safety factor; None where no limit of the torque over the speed is known.

    For an actuator of a catalogue the limits are straight lines between corners, which are found by intersecting the
    lines beside them.
    """
    if actuator.by_ratings:
        points = actuator.curve_points
        return None if points is None else (points, points)
    outline = actuator.outline
    if outline is None:
        return None
    top = float(np.max(outline[:, 0]))
    region = actuator.short_time_region
    return (
        _polyline(lambda speed: np.asarray(region.highest_torque(speed)), top),
        _polyline(lambda speed: np.asarray(region.highest_torque(-speed)), top),
    )


def _polyline(torque: Callable[[Array], Array], top: float) -> Polyline:
    """The corners of a function of the speed that consists of straight lines, from standstill to the largest speed."""
    speed = np.linspace(0.0, top, SAMPLES)
    speed[0] = 1e-9 * top  # friction opposes the motion, so standstill itself differs
    value = np.maximum(torque(speed), 0.0)
    known = np.isfinite(value)
    speed, value = speed[known], value[known]
    slope = np.diff(value) / np.diff(speed)
    bent = np.abs(np.diff(slope)) * (speed[2:] - speed[1:-1]) > STRAIGHT * float(value.max())
    corners = [(0.0, float(value[0]))]
    k = 0
    while k < len(bent):
        if not bent[k]:
            k += 1
            continue
        if k + 1 < len(bent) and bent[k + 1] and (k + 2 >= len(bent) or not bent[k + 2]):
            corners.append(_meeting(speed, value, slope, k))  # a corner within the piece between two samples
            k += 2
        else:
            corners.append((float(speed[k + 1]), float(value[k + 1])))
            k += 1
    return (*corners, (float(speed[-1]), float(value[-1])))


def _meeting(speed: Array, value: Array, slope: Array, k: int) -> tuple[float, float]:
    """Where the lines before and after piece k + 1 meet."""
    a, b = slope[k], slope[k + 2] if k + 2 < len(slope) else slope[k + 1]
    if a == b:
        return float(speed[k + 1]), float(value[k + 1])
    x = (value[k + 2] - b * speed[k + 2] - value[k] + a * speed[k]) / (a - b)
    x = float(np.clip(x, speed[k + 1], speed[k + 2]))
    return x, float(value[k] + a * (x - speed[k]))
