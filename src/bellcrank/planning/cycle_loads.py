"""What a cycle that repeats asks continuously of motors: RMS torque against the continuous torque, or the winding's
temperature in the periodic state.

A pause at the end of the motion adds a time at rest under the torque that holds the posture. The sums over the motion
are those of `bellcrank.size`; losses are means over the parts of its grid.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.electrical import electrical_torque, friction_loss, loss_per_squared_torque
from bellcrank.actuators.motor_with_gear import MotorWithGear
from bellcrank.actuators.product_arrays import MotorArrays
from bellcrank.actuators.thermal import HeatCycle, ThermalModel
from bellcrank.actuators.thermal_cycle import periodic_temperatures
from bellcrank.dynamics.force_table_breakpoints import force_breaks, with_force_rows
from bellcrank.dynamics.mechanism import Mechanism, coulomb_widths
from bellcrank.motion.motion import Motion
from bellcrank.sizing.joint_loads import JointLoads
from bellcrank.sizing.motion_grid import grid_along, reversal_times

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class MotorCycle:
    """The shaft of one motor over a motion, and at rest in its last posture.

    Attributes:
        actuator: Motor and gear.
        weight: Integration weights (n,), s.
        part: Number (n,) of the part of the motion of each sample, from 0.
        torque: Shaft torque (n,), N m.
        speed: Shaft speed (n,), rad/s.
        held: Shaft torque at rest in the last posture, N m.
    """

    actuator: Actuator
    weight: Array
    part: NDArray[np.intp]
    torque: Array
    speed: Array
    held: float

    @property
    def duration(self) -> float:
        """The time of the motion, s."""
        return float(self.weight.sum())

    def squared_torque(self) -> float:
        """∫ T² dt over the motion, (N m)² s."""
        return float(self.weight @ self.torque**2)

    def turned(self) -> float:
        """∫ |ω| dt over the motion, rad."""
        return float(self.weight @ np.abs(self.speed))

    def rms_use(self, pause: float) -> float | None:
        """The share of the continuous torque at the mean speed that the RMS torque of motion and pause uses, with the
        safety factor; None where the continuous torque is unknown.
        """
        period = self.duration + pause
        rms = float(np.sqrt((self.squared_torque() + self.held**2 * pause) / period))
        limit = self.actuator.continuous_torque(self.turned() / period)
        return None if limit is None else self.actuator.safety_factor * rms / limit

    def pause_for_rms(self) -> float | None:
        """The pause, s, after which the RMS torque is the continuous torque, if that does not depend on the speed:
        (∫T² + T_h² p) / (t + p) = L², so p = (∫T² - L² t) / (L² - T_h²). None where no pause suffices, or it depends.
        """
        if isinstance(self.actuator, MotorWithGear) or (limit := self.actuator.continuous_torque(0.0)) is None:
            return None
        limit /= self.actuator.safety_factor
        spare = limit**2 - self.held**2
        return None if spare <= 0.0 else max(0.0, (self.squared_torque() - limit**2 * self.duration) / spare)

    def temperature_use(self, pause: float) -> float | None:
        """The largest rise of the winding's temperature above the ambient in the periodic state, over the permitted
        rise; infinite on thermal runaway, None where a figure is unknown.
        """
        actuator = self.actuator
        if not isinstance(actuator, MotorWithGear):
            return None
        motor, conditions = actuator.conditions.completed(actuator.motor), actuator.conditions
        motors = MotorArrays.of([motor])
        limit = float(motors.max_winding_temperature[0])
        heat = self._heat(motors, pause)
        model = ThermalModel.of(motors, conditions)
        peak = float(periodic_temperatures(model, heat).winding_peak[0])
        if np.isnan(peak) or np.isnan(limit):
            return None
        permitted = limit - conditions.ambient
        return (peak - conditions.ambient) / permitted if permitted > 0.0 else np.inf

    def _heat(self, motors: MotorArrays, pause: float) -> HeatCycle:
        copper = loss_per_squared_torque(motors) * electrical_torque(motors, self.torque, self.speed) ** 2
        held = float(loss_per_squared_torque(motors)[0]) * self.held**2
        duration, *energies = (
            np.asarray(np.bincount(self.part, self.weight * values), dtype=np.float64)
            for values in (np.ones_like(self.torque), copper, friction_loss(motors, self.speed))
        )
        long = duration > 0.0
        losses = [energy[long] / duration[long] for energy in energies]
        last = np.array([pause])[: int(pause > 0.0)]
        return HeatCycle(
            duration=np.concatenate([duration[long], last]),
            copper_loss=np.concatenate([losses[0], held + 0.0 * last])[None],
            friction_loss=np.concatenate([losses[1], 0.0 * last])[None],
        )


def motor_cycles(mechanism: Mechanism, actuators: Mapping[str, Actuator], motion: Motion) -> dict[str, MotorCycle]:
    """The shafts of the motors whose torque is known, by joint."""
    loads = JointLoads(mechanism, actuators, 0.0)
    motion = with_force_rows(mechanism, motion)
    probes = reversal_times(motion, coulomb_widths(mechanism))
    grid = grid_along(motion, probes, force_breaks(mechanism), loads.nominal_torque)
    torque = loads.nominal_torque(grid.force_time, grid.position, grid.velocity, grid.acceleration)
    still = np.zeros((1, motion.nv))
    end = np.nextafter(motion.time[-1:], -np.inf)
    held = loads.nominal_torque(end, np.array(motion.position[-1:]), still, still)
    found = {}
    for k, joint in enumerate(loads.joints):
        if not loads.knows_shaft(joint.name):
            continue
        actuator = actuators[joint.name]
        speed, rate = grid.velocity[:, joint.v], grid.acceleration[:, joint.v]
        rest = np.zeros(1)
        found[joint.name] = MotorCycle(
            actuator=actuator,
            weight=grid.weight,
            part=grid.part,
            torque=actuator.shaft_torque(torque[:, k], speed, rate),
            speed=actuator.ratio * speed,
            held=float(actuator.shaft_torque(held[:, k], rest, rest)[0]),
        )
    return found
