"""Every criterion of one motor and gear, sample by sample in plain numpy: the slow way, for comparison."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.linalg import expm

ALPHA = 0.0039
TO_DC = {"dc": 1.0, "phase_rms": math.sqrt(2.0 / 3.0), "phase_peak": 2.0 / math.sqrt(3.0)}


def value(number: float | None) -> float:
    return math.nan if number is None else float(number)


class Brute:
    """One motor and gear on one axis of one cycle, all samples."""

    def __init__(self, motor: Any, gear: Any, cycle: Any, axis: int, conditions: Any) -> None:
        self.motor, self.gear, self.cycle, self.axis, self.conditions = motor, gear, cycle, axis, conditions
        self.safety = safety = conditions.safety_factor
        self.load = cycle.torque[:, axis]
        self.tau = safety * self.load  # what the gear's output bears
        self.static = safety * cycle.static_torque[:, axis]
        self.dq, self.ddq = cycle.speed[:, axis], cycle.acceleration[:, axis]
        self.tilt = safety * cycle.tilting_moment[:, axis]
        self.axial = safety * cycle.axial_force[:, axis]
        self.w, self.t = cycle.weight, cycle.duration
        self.N = value(gear.ratio)
        self.omega = self.N * self.dq
        # The factor multiplies the whole torque at the shaft: (T_load + T_acceleration) S (Oriental Motor, Technical
        # reference, required torque).
        self.T = safety * (self.through_gear() + (value(motor.rotor_inertia) + value(gear.inertia)) * self.N * self.ddq)
        if motor.coulomb_friction is not None and motor.viscous_friction is not None:
            self.tc, self.cv = motor.coulomb_friction, motor.viscous_friction
        else:
            self.tc, self.cv = value(motor.torque_constant) * value(motor.no_load_current), 0.0
            self.cv += 0.0 * self.tc
        self.k = value(motor.torque_constant) * TO_DC.get(motor.torque_constant_basis, math.nan)
        self.ke = self.k if motor.voltage_constant is None else motor.voltage_constant
        self.Te = self.T + safety * (self.tc * np.sign(self.omega) + self.cv * self.omega)

    def through_gear(self) -> np.ndarray:
        """Torque at the gear's input, without the safety factor."""
        gear, tau = self.gear, self.load
        driven = tau * self.dq < 0.0
        if gear.efficiency_curve:
            x, y = np.array(gear.efficiency_curve).T
            size = np.maximum(np.abs(tau), x[0] * value(gear.rated_torque))
            eta = np.interp(size / value(gear.rated_torque), x, y)
            back = eta if gear.back_efficiency is None else np.full_like(eta, gear.back_efficiency)
            lost = size * np.where(driven, 1.0 - back, 1.0 / eta - 1.0)
            direction = np.where(self.dq != 0.0, np.sign(self.dq), np.sign(tau))
            return (tau + direction * lost) / self.N
        eta = value(gear.efficiency)
        back = eta if gear.back_efficiency is None else gear.back_efficiency
        # An unknown efficiency counts as unknown in either direction.
        return np.where(driven, tau * back, tau / eta) / self.N + 0.0 * (eta + back)

    def mean(self, samples: np.ndarray) -> float:
        return float(np.sum(self.w * samples) / self.t)

    def average_torque(self) -> float:
        p = value(self.gear.life_exponent)
        if not np.any(self.dq):
            return 0.0
        travel = np.sum(self.w * np.abs(self.dq))
        return float((np.sum(self.w * np.abs(self.dq) * np.abs(self.tau) ** p) / travel) ** (1.0 / p))

    def heat_share(self) -> float:
        """Share of the friction loss in the housing with which the nominal point is a thermal limit; 1 if unknown."""
        m = self.motor
        r_wh, r_ha = value(m.resistance_winding_housing), value(m.resistance_housing_ambient)
        rise, speed = value(m.max_winding_temperature) - 25.0, value(m.nominal_speed)
        friction = self.tc + self.cv * speed
        current = (value(m.nominal_torque) + friction) / self.k
        copper = value(m.resistance) * current**2 * (1.0 + ALPHA * rise)
        share = (rise - (r_wh + r_ha) * copper) / (r_ha * friction * speed)
        return 1.0 if math.isnan(share) else min(max(share, 0.0), 1.0)

    def derating(self) -> tuple[float, float]:
        """What is left of the permitted rise at the altitude, and of printed torques there and at the ambient."""
        m, ambient = self.motor, self.conditions.ambient
        thin = 1.0 - max(self.conditions.altitude - 1000.0, 0.0) / 1e4
        reference = 25.0 if m.reference_temperature is None else m.reference_temperature
        if ambient <= reference:
            return thin, thin
        hottest = value(m.max_winding_temperature)
        return thin, thin * max(hottest - ambient, 0.0) / (hottest - reference)

    def s1(self, speed: np.ndarray) -> np.ndarray:
        """Continuous torque at speeds, at the ambient temperature and altitude."""
        m, (thin, printed_share) = self.motor, self.derating()
        speed = np.abs(np.atleast_1d(np.asarray(speed, dtype=float)))
        if m.continuous_curve:
            x, y = np.array(m.continuous_curve).T
            ended = np.where((y[-1] == 0.0) | (speed > value(m.max_speed)), 0.0, math.nan)
            return printed_share * np.where(speed > x[-1], ended, np.interp(speed, x, y))
        r_wh, r_ha = value(m.resistance_winding_housing) / thin, value(m.resistance_housing_ambient) / thin
        rise = value(m.max_winding_temperature) - self.conditions.ambient
        friction = self.tc * np.sign(speed) + self.cv * speed
        heat = self.heat_share() * friction * speed
        copper = (rise - r_ha * heat) / (r_wh + r_ha)
        if m.max_housing_temperature is not None:
            copper = np.minimum(copper, (m.max_housing_temperature - self.conditions.ambient) / r_ha - heat)
        per_torque = value(m.resistance) / self.k**2 * (1.0 + ALPHA * (value(m.max_winding_temperature) - 25.0))
        thermal = np.maximum(np.sqrt(np.maximum(copper, 0.0) / per_torque) - friction, 0.0)
        nominal = printed_share * value(m.nominal_torque)
        at_nominal = (speed <= value(m.nominal_speed)) | (speed == 0.0)
        printed = np.where(at_nominal & (np.isnan(thermal) | (printed_share == 1.0)), nominal, math.nan)
        above = np.where(np.isnan(thermal), math.nan, np.fmin(thermal, nominal))
        return np.where(np.isnan(printed), above, printed)

    def in_order(self) -> np.ndarray:
        """Numbers of the samples in the order of the whole cycle, with all passes."""
        return np.concatenate(
            [
                np.tile(np.flatnonzero((self.cycle.interval >= a) & (self.cycle.interval < b)), passes)
                for a, b, passes in self.cycle.sequence
            ]
        )

    def pass_weight(self) -> np.ndarray:
        count = np.zeros(len(self.w))
        for a, b, passes in self.cycle.sequence:
            count[(self.cycle.interval >= a) & (self.cycle.interval < b)] += passes
        return self.w / count

    def longest_above(self) -> float:
        order = self.in_order()
        above = (np.abs(self.T) > self.s1(self.omega))[order]
        weight = self.pass_weight()[order]
        if above.all():
            return math.inf
        longest = run = 0.0
        for one, length in zip(np.tile(above, 2), np.tile(weight, 2), strict=True):  # twice: across the end
            run = run + length if one else 0.0
            longest = max(longest, run)
        return longest if above.any() else -1.0

    def losses(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Durations, copper losses at 25 °C and friction losses of the intervals in their order."""
        weight, cycle = self.pass_weight(), self.cycle
        copper = value(self.motor.resistance) / self.k**2 * self.Te**2
        friction = (self.tc * np.sign(self.omega) + self.cv * self.omega) * self.omega
        order = np.concatenate([np.tile(np.arange(a, b), passes) for a, b, passes in cycle.sequence])
        intervals = [np.flatnonzero(cycle.interval == k) for k in range(int(cycle.interval.max()) + 1)]
        rows = [
            (np.sum(weight[i]), weight[i] @ copper[i] / weight[i].sum(), weight[i] @ friction[i] / weight[i].sum())
            for i in intervals
        ]
        duration, copper, friction = np.array(rows)[order].T
        return duration, copper, friction

    def temperatures(self) -> tuple[float, float]:
        """Largest winding and housing temperature of the periodic state, at 20 moments of each interval."""
        m, ambient, thin = self.motor, self.conditions.ambient, self.derating()[0]
        r_wh, r_ha = value(m.resistance_winding_housing), value(m.resistance_housing_ambient)
        c_w, c_h = value(m.time_constant_winding) / r_wh, value(m.time_constant_motor) / r_ha
        r_wh, r_ha = r_wh / thin, r_ha / thin
        length, copper, friction = self.losses()
        if np.isnan(length + copper + friction + c_w + c_h).any():
            return math.nan, math.nan
        systems = np.zeros((len(length), 3, 3))
        systems[:, 0, 0], systems[:, 0, 1] = (ALPHA * copper - 1.0 / r_wh) / c_w, 1.0 / (r_wh * c_w)
        systems[:, 0, 2] = copper * (1.0 + ALPHA * (ambient - 25.0)) / c_w
        systems[:, 1, 0], systems[:, 1, 1] = 1.0 / (r_wh * c_h), -(1.0 / r_wh + 1.0 / r_ha) / c_h
        systems[:, 1, 2] = self.heat_share() * friction / c_h
        steps, flow = expm(systems * length[:, None, None] / 20.0), np.eye(3)
        for step in np.linalg.matrix_power(steps, 20):
            flow = step @ flow
        if not np.isfinite(flow).all() or np.max(np.abs(np.linalg.eigvals(flow[:2, :2]))) >= 1.0:
            return math.inf, math.inf
        state = np.append(np.linalg.solve(np.eye(2) - flow[:2, :2], flow[:2, 2]), 1.0)
        peak = state.copy()
        for step in steps:
            for _ in range(20):
                state = step @ state
                peak = np.maximum(peak, state)
        return ambient + peak[0], ambient + peak[1]

    def peak_curve(self) -> float:
        """Use of the printed peak curve, by bisection along the ray of each sample."""
        if not self.motor.peak_curve:
            return math.nan
        x, y = np.array(self.motor.peak_curve).T
        if self.conditions.voltage is not None:
            x = x - max(value(self.motor.nominal_voltage) - self.conditions.voltage, 0.0) / (
                self.motor.voltage_constant or self.k
            )
        torque, speed = np.abs(self.T), np.abs(self.omega)
        if np.isnan(torque).any():
            return math.nan
        low, high = np.zeros_like(torque), np.full_like(torque, 1e9)
        for _ in range(200):
            factor = 0.5 * (low + high)
            inside = (factor * torque <= np.interp(factor * speed, x, y, right=-1.0)) & (factor * speed <= x[-1])
            low, high = np.where(inside, factor, low), np.where(inside, high, factor)
        return float(np.max(1.0 / low))

    def uses(self, temperatures: bool = True) -> dict[str, float]:
        """Utilisation by the name of the criterion; NaN unknown. `temperatures` take long."""
        m, g, c = self.motor, self.gear, self.conditions
        over = lambda load, limit: load / value(limit)  # noqa: E731
        speed, mean_speed = np.max(np.abs(self.omega)), self.mean(np.abs(self.omega))
        bus = value(m.nominal_voltage) if c.voltage is None else c.voltage
        usable = bus * (1.0 - c.voltage_reserve)
        warm = value(m.resistance) * (1.0 + ALPHA * (c.winding_temperature - 25.0))
        volts = warm / self.k * self.Te + self.ke * self.omega
        current = value(m.torque_constant) * value(m.peak_current)
        life = value(g.life) * value(g.rated_speed) / mean_speed if mean_speed else math.inf + 0.0 * value(g.life)
        average = self.average_torque()
        life *= (value(g.rated_torque) / average) ** value(g.life_exponent) if average else math.inf
        continuous = float(np.sqrt(self.mean(self.T**2)) / self.s1(mean_speed)[0])
        overloaded = continuous > 3.0 or not temperatures  # exponentials overflow
        winding, housing = (math.inf, math.inf) if overloaded else self.temperatures()
        longest = self.longest_above()
        ratio = (np.max(self.cycle.inertia[:, self.axis]) / self.N**2 + value(g.inertia)) / value(m.rotor_inertia)
        found = {
            "nominal voltage": abs(math.log(bus / value(m.nominal_voltage))) / math.log(c.voltage_ratio),
            "inertia ratio": ratio / c.inertia_ratio,
            "motor speed": over(speed, m.max_speed),
            "continuous torque": continuous,
            "peak torque": over(np.max(np.abs(self.T)), m.peak_torque),
            "peak current": over(np.max(np.abs(self.Te)), current),
            "voltage limit": float(np.max(np.abs(volts)) / usable),
            "peak curve": self.peak_curve(),
            "peak duration": 0.0 if longest < 0.0 else over(longest, m.peak_time),
            "winding temperature": (winding - c.ambient) / (value(m.max_winding_temperature) - c.ambient),
            "housing temperature": (housing - c.ambient) / (value(m.max_housing_temperature) - c.ambient),
            "holding brake": over(np.max(np.abs(self.static)) / self.N, m.brake_torque),
            "gear average torque": over(average, g.average_torque),
            "gear repeated peak torque": over(np.max(np.abs(self.tau)), g.repeated_peak_torque),
            "gear average input speed": over(mean_speed, g.average_speed),
            "gear largest input speed": over(speed, g.max_speed),
            "gear life": (math.nan if c.life is None else c.life) / life,
            "tilting moment": over(np.max(self.tilt), g.tilting_moment),
            "axial load": over(np.max(self.axial), g.axial_load),
        }
        if np.isnan(self.T).any() or np.isnan(self.s1(self.omega)).any():
            found["peak duration"] = math.nan
        if overloaded:
            del found["winding temperature"], found["housing temperature"]
        return found
