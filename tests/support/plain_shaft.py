"""What motors do at their shafts along a load, by the formulas of the data sheets, sample by sample in NumPy."""

import math
from types import SimpleNamespace

import numpy as np
from brute_criteria import Brute


class PlainShaft:
    """A motor with its gear that drives an axis: torque, speed and acceleration (n,) of the axis, and weights (n,)."""

    def __init__(self, actuator, torque, speed, acceleration, weight):
        self.actuator, self.weight = actuator, weight
        self.speed = actuator.ratio * speed
        self.products = None if actuator.by_ratings else actuator.motor
        if self.products is not None:
            self.brute = self._brute(torque, speed, acceleration)
            self.torque = self.brute.T / self.brute.safety
            return
        driving = torque * speed >= 0.0
        gear = np.where(driving, torque / actuator.efficiency, torque * actuator.efficiency) / actuator.ratio
        inertia = actuator.rotor_inertia + actuator.gear_inertia
        self.torque = gear + inertia * actuator.ratio * acceleration

    def _brute(self, torque, speed, acceleration):
        columns = {"torque": torque, "speed": speed, "acceleration": acceleration}
        cycle = SimpleNamespace(
            **{key: each[:, None] for key, each in columns.items()},
            **dict.fromkeys(("static_torque", "tilting_moment", "axial_force"), np.zeros((len(torque), 1))),
            weight=self.weight, duration=self.weight.sum(),
        )  # fmt: skip
        return Brute(self.actuator.motor, self.actuator.gear, cycle, 0, self.actuator.conditions)

    @property
    def rms(self):
        """RMS torque, N m."""
        return math.sqrt(self.weight @ self.torque**2 / self.weight.sum())

    @property
    def continuous_torque(self):
        """At the mean speed, N m."""
        if self.products is None:
            return self.actuator.rated_torque
        return float(self.brute.s1(self.weight @ np.abs(self.speed) / self.weight.sum())[0])

    def curve_use(self):
        """The share (n,) of the limits of torque over speed, along the ray from the origin, with the safety factor."""
        torque, speed = self.actuator.safety_factor * self.torque, self.speed
        if self.products is not None:
            return self._short_time_use(torque, speed)
        one = self.actuator
        corners = one.curve or ((0.0, one.peak_torque), (one.rated_speed, one.peak_torque), (one.max_speed, 0.0))
        return ray_use(corners, np.abs(torque), np.abs(speed))

    def _short_time_use(self, torque, speed):
        motor, b = self.actuator.motor, self.brute
        electrical = torque + b.tc * np.sign(speed) + b.cv * speed
        bus = motor.nominal_voltage if b.conditions.voltage is None else b.conditions.voltage
        volts = motor.resistance / b.k * electrical + b.k * speed
        uses = [
            np.abs(torque) / motor.peak_torque,
            np.abs(electrical) / (motor.torque_constant * motor.peak_current),
            np.abs(volts) / (bus * (1.0 - b.conditions.voltage_reserve)),
            np.abs(speed) / motor.max_speed,
        ]
        return np.max(uses, axis=0)

    def supply_power(self):
        """What is taken from the supply (n,), W."""
        mechanical = self.torque * self.speed
        if self.products is None:
            eta = self.actuator.motor_efficiency or 1.0
            return np.where(mechanical >= 0.0, mechanical / eta, mechanical * eta)
        b = self.brute
        electrical = self.torque + b.tc * np.sign(self.speed) + b.cv * self.speed
        return self.actuator.motor.resistance * (electrical / b.k) ** 2 + electrical * self.speed


def ray_use(corners, torque, speed):
    """By bisection the factor along the ray from the origin at which a curve of torque over speed is left, inverted."""
    x, y = np.array(corners).T
    low, high = np.zeros_like(torque), np.full_like(torque, 1e12)
    for _ in range(160):
        factor = 0.5 * (low + high)
        inside = (factor * torque <= np.interp(factor * speed, x, y, right=-1.0)) & (factor * speed <= x[-1])
        low, high = np.where(inside, factor, low), np.where(inside, high, factor)
    return 1.0 / low
