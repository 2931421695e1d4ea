"""Many motors or gears as arrays, one entry a product, so that formulas hold for all of them at once.

`MotorArrays.of(motors)` and `GearArrays.of(gears)` have one float array a figure, NaN where it is unknown. NaN goes
through every formula, so a result that needs an unknown figure is NaN. An index selects products, and `None` adds axes:

    motors, gears = MotorArrays.of(rows), GearArrays.of(gear_rows)
    motors[:, None], gears[None, :]     # every motor with every gear: figures broadcast to (motors, gears)
    motors[motor_index], gears[gear_index]    # a list of pairs, (pairs,)
    motors[motor_index][:, None]        # pairs against samples of a load, (pairs, samples)

Functions over them: `electrical` (torque of the current, losses, voltage), `continuous_torque`, `short_time_limits`
(half-planes and printed curves), `powertrain.PowerTrains` (motor and gear on an axis), `thermal.ThermalModel`,
`thermal_cycle.periodic_temperatures` and `time_to_limit`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from bellcrank.actuators.catalogue.product_checks import Points
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.arrays import Array, Mask
from bellcrank.numerics import floats


def column(rows: Sequence[object], name: str) -> Array:
    """An attribute of every row (n,), NaN for None."""
    return np.array([getattr(row, name) for row in rows], dtype=np.float64).reshape(len(rows))  # None becomes NaN


@dataclass(frozen=True, eq=False)
class Curves:
    """Piecewise linear curves of many products: points (…, p), padded with NaN; all NaN where there is none.

    Attributes:
        x: Abscissas, such as speeds.
        y: Ordinates, such as torques.
    """

    x: Array
    y: Array

    @classmethod
    def of(cls, curves: Sequence[Points | None]) -> Self:
        """The curves of some products; None is no curve."""
        longest = max((len(curve) for curve in curves if curve), default=1)
        points = np.full((2, len(curves), longest), np.nan)
        for k, curve in enumerate(curves):
            if curve:
                points[:, k, : len(curve)] = np.array(curve).T
        return cls(*points)

    def __getitem__(self, index: Any) -> Self:
        if isinstance(index, tuple) and any(part is Ellipsis for part in index):
            index = (*index, slice(None))  # the points stay last
        return type(self)(self.x[index], self.y[index])

    @property
    def known(self) -> Mask:
        """Whether there is a curve (…)."""
        return np.isfinite(self.x[..., 0])

    @property
    def last_x(self) -> Array:
        """The largest abscissa (…), NaN where there is no curve."""
        if not self.known.any():
            return np.full(self.x.shape[:-1], np.nan)
        return np.asarray(np.fmax.reduce(self.x, axis=-1))

    def at(self, x: Array, beyond: float | None = None) -> Array:
        """The ordinates at some abscissas, broadcast over products.

        Args:
            x: Abscissas (…).
            beyond: Value beyond the last point; None: that of the last point. Before the first point it is the first.

        Returns:
            Ordinates (…), NaN where there is no curve or x is NaN.
        """
        x = floats(x)
        y = np.where(np.isnan(x), np.nan, self.y[..., 0])
        last = self.x[..., 0]
        for k in range(self.x.shape[-1] - 1):
            x0, x1, y0, y1 = self.x[..., k], self.x[..., k + 1], self.y[..., k], self.y[..., k + 1]
            inside = (x >= x0) & (x <= x1)
            with np.errstate(invalid="ignore"):
                y = np.where(inside, y0 + (y1 - y0) * ((x - x0) / (x1 - x0)), y)
            last = np.fmax(last, x1)
        value = self._last_y if beyond is None else np.where(self.known, beyond, np.nan)
        return floats(np.where(x > last, value, y))

    @property
    def _last_y(self) -> Array:
        if self.x.shape[-1] == 1:
            return self.y[..., 0]
        count = np.maximum(np.isfinite(self.x).sum(axis=-1), 1)
        return np.asarray(np.take_along_axis(self.y, count[..., None] - 1, axis=-1)[..., 0])


class _Indexed:
    """Arrays that are indexed together; an entry of an index is taken when its figure is first asked for."""

    def __getitem__(self, index: Any) -> Self:
        found = object.__new__(type(self))
        vars(found)["_taken_from"] = self, index
        return found

    def with_figures(self, **figures: Any) -> Self:
        """The same products with other figures."""
        found = self[...]
        vars(found).update(figures)
        return found

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            if name.startswith("_") or "_taken_from" not in vars(self):
                raise AttributeError(name)
            source, index = vars(self)["_taken_from"]
            vars(self)[name] = value = getattr(source, name)[index]
            return value


@dataclass(frozen=True, kw_only=True, eq=False)
class MotorArrays(_Indexed):
    """Figures of many motors, each of the same shape, NaN where unknown; SI units, meanings as in `Motor`.

    Attributes:
        nominal_voltage: V.
        dc_torque_constant: k of the DC-equivalent motor, N m/A (`Motor.dc_torque_constant`).
        dc_voltage_constant: Back-EMF over speed of the DC-equivalent motor, V s/rad (`Motor.dc_voltage_constant`).
        resistance: Line-to-line at 25 °C, Ω.
        reactance_per_speed: Ω s/rad (`Motor.reactance_per_speed`).
        coulomb_torque: T_c of the friction and iron torque T_c + c_v ω, N m (`Motor.coulomb_torque`).
        viscous_coefficient: c_v, N m s/rad.
        friction_heat_share: Of the friction and iron loss that heats the housing (`Motor.friction_heat_share`).
        rotor_inertia: kg m².
        nominal_torque: Stated, or of the nominal current, N m (`Motor.continuous_torque`).
        nominal_speed: rad/s.
        no_load_speed: rad/s.
        stall_torque: N m.
        peak_torque: N m.
        peak_electrical_torque: k_t I_peak, N m.
        peak_time: s.
        max_speed: rad/s.
        continuous_curve: S1 curves, speed rad/s and torque N m.
        peak_curve: Curves of short-time operation.
        resistance_winding_housing: R_wh, K/W.
        resistance_housing_ambient: R_ha, K/W.
        time_constant_winding: τ_w, s.
        time_constant_motor: τ_m, s.
        max_winding_temperature: °C.
        max_housing_temperature: °C.
        reference_temperature: °C.
        brake_torque: N m.
        backlash: rad.
        tilting_moment: N m.
        axial_load: N.
        mass: kg.
        price: In the row's currency.
        by_ratings: 1 where the motor is given by its ratings alone, else 0 (`Motor.by_ratings`).
        brushless: 1 for a brushless motor, 0 for one with brushes (`Motor.brushless`).
        frameless: 1 for a rotor and stator without housing, else 0 (`Motor.frameless`).
    """

    nominal_voltage: Array
    dc_torque_constant: Array
    dc_voltage_constant: Array
    resistance: Array
    reactance_per_speed: Array
    coulomb_torque: Array
    viscous_coefficient: Array
    friction_heat_share: Array
    rotor_inertia: Array
    nominal_torque: Array
    nominal_speed: Array
    no_load_speed: Array
    stall_torque: Array
    peak_torque: Array
    peak_electrical_torque: Array
    peak_time: Array
    max_speed: Array
    continuous_curve: Curves
    peak_curve: Curves
    resistance_winding_housing: Array
    resistance_housing_ambient: Array
    time_constant_winding: Array
    time_constant_motor: Array
    max_winding_temperature: Array
    max_housing_temperature: Array
    reference_temperature: Array
    brake_torque: Array
    backlash: Array
    tilting_moment: Array
    axial_load: Array
    mass: Array
    price: Array
    by_ratings: Array
    brushless: Array
    frameless: Array

    @classmethod
    def of(cls, motors: Sequence[Motor]) -> Self:
        """The arrays (n,) of n motors."""
        return cls(
            continuous_curve=Curves.of([motor.continuous_curve for motor in motors]),
            peak_curve=Curves.of([motor.peak_curve for motor in motors]),
            nominal_torque=column(motors, "continuous_torque"),
            **{
                field.name: column(motors, field.name)
                for field in fields(cls)
                if field.name not in ("continuous_curve", "peak_curve", "nominal_torque")
            },
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class GearArrays(_Indexed):
    """Figures of many gears, each of the same shape, NaN where unknown; SI units, meanings as in `Gear`.

    Attributes:
        linear: Whether the output moves along a line (screw, rack).
        direct: Whether it is no gear at all.
        ratio: rad/rad, or rad/m.
        efficiency: Driving.
        driven_efficiency: While the load gives power back (`Gear.driven_efficiency`).
        back_efficiency: The same, only where it is stated.
        efficiency_curve: Efficiency over output torque divided by the rated torque.
        inertia: At the input, kg m².
        rated_torque: N m or N.
        rated_speed: At the input, rad/s.
        average_torque: N m or N.
        repeated_peak_torque: N m or N.
        momentary_torque: N m or N.
        average_speed: At the input, rad/s.
        max_speed: At the input, rad/s.
        life: Hours.
        life_exponent: Of the life law.
        stiffness: N m/rad or N/m.
        backlash: rad or m.
        lost_motion: rad or m.
        tilting_moment: N m.
        axial_load: N.
        mass: kg.
        price: In the row's currency.
    """

    linear: Mask
    direct: Mask
    ratio: Array
    efficiency: Array
    driven_efficiency: Array
    back_efficiency: Array
    efficiency_curve: Curves
    inertia: Array
    rated_torque: Array
    rated_speed: Array
    average_torque: Array
    repeated_peak_torque: Array
    momentary_torque: Array
    average_speed: Array
    max_speed: Array
    life: Array
    life_exponent: Array
    stiffness: Array
    backlash: Array
    lost_motion: Array
    tilting_moment: Array
    axial_load: Array
    mass: Array
    price: Array

    @classmethod
    def of(cls, gears: Sequence[Gear]) -> Self:
        """The arrays (n,) of n gears."""
        return cls(
            linear=np.array([gear.linear for gear in gears], dtype=bool),
            direct=np.array([gear.kind == "direct" for gear in gears], dtype=bool),
            efficiency_curve=Curves.of([gear.efficiency_curve for gear in gears]),
            **{
                field.name: column(gears, field.name)
                for field in fields(cls)
                if field.name not in ("linear", "direct", "efficiency_curve")
            },
        )
