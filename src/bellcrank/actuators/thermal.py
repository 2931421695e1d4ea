"""The two-body thermal model of motors: winding and housing, solved exactly over intervals of constant loss.

    C_w dT_w/dt = P (1 + α (T_w - 25)) - (T_w - T_h)/R_wh
    C_h dT_h/dt = (T_w - T_h)/R_wh - (T_h - T_a)/R_ha + P_f

with the copper loss at 25 °C P, the heat P_f of friction and iron losses, C_w = τ_w/R_wh and C_h = τ_m/R_ha. (Two
bodies: maxon's motor data; the same equations are those of A. M. Johnson's Motor Thermal Calculator, CMU.) The copper's
resistance rise makes P part of the matrix A of the system x' = A x + b, so each interval has a matrix of its own. The
solution over an interval is exact (thermal_interval.py).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np

from bellcrank import arguments
from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.copper import COPPER, resistance_factor
from bellcrank.actuators.product_arrays import MotorArrays
from bellcrank.actuators.thermal_interval import Kernel, Rates
from bellcrank.arrays import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class ThermalModel:
    """Two-body models of m motors; NaN where a figure is unknown.

    Attributes:
        winding_capacity: C_w (m,), J/K.
        housing_capacity: C_h (m,), J/K.
        winding_resistance: R_wh (m,), K/W.
        housing_resistance: R_ha (m,), K/W.
        friction_share: Share (m,) of the friction and iron loss that heats the housing (`Motor.friction_heat_share`).
        ambient: T_a (m,), °C.
    """

    winding_capacity: Array
    housing_capacity: Array
    winding_resistance: Array
    housing_resistance: Array
    friction_share: Array
    ambient: Array

    @classmethod
    def of(cls, motors: MotorArrays, conditions: Conditions) -> Self:
        """The models of motors (m,) at an ambient temperature; in thin air both resistances are larger by 1/f.

        f is the permitted temperature rise of IEC 60034-1 over that up to 1000 m (`Conditions.altitude_factor`); the
        capacities are those at sea level.
        """
        winding, housing = motors.resistance_winding_housing, motors.resistance_housing_ambient
        return cls(
            winding_capacity=motors.time_constant_winding / winding,
            housing_capacity=motors.time_constant_motor / housing,
            winding_resistance=winding / conditions.altitude_factor,
            housing_resistance=housing / conditions.altitude_factor,
            friction_share=motors.friction_heat_share,
            ambient=np.full_like(winding, conditions.ambient),
        )

    def __getitem__(self, index: Any) -> Self:
        return type(self)(**{field.name: getattr(self, field.name)[index] for field in fields(self)})

    def rates(self, copper_loss: Array, friction_loss: Array) -> Rates:
        """The linear systems under a copper loss at 25 °C and a friction loss (…, m), W."""
        return Rates(
            copper_loss / self.winding_capacity,
            self.friction_share * friction_loss / self.housing_capacity,
            1.0 / (self.winding_resistance * self.winding_capacity),
            1.0 / (self.winding_resistance * self.housing_capacity),
            1.0 / (self.housing_resistance * self.housing_capacity),
            resistance_factor(self.ambient),
        )

    def steady_temperatures(self, copper_loss: Array, friction_loss: Array) -> tuple[Array, Array]:
        """Winding and housing temperature in the end under constant losses, °C; infinite on thermal runaway.

        With the losses' largest values of a cycle they bound its temperatures whatever the capacities are.

        Args:
            copper_loss: At 25 °C (m,), W.
            friction_loss: Friction and iron loss (m,), W.

        Returns:
            Winding and housing temperature (m,), °C; NaN where unknown.
        """
        total = self.winding_resistance + self.housing_resistance
        margin = 1.0 - COPPER * copper_loss * total
        with np.errstate(divide="ignore", invalid="ignore"):
            heat = copper_loss * resistance_factor(self.ambient)
            friction = self.friction_share * friction_loss
            rise = (total * heat + self.housing_resistance * friction) / margin
            winding = np.where(margin <= 0.0, np.inf, self.ambient + rise)
            warm = copper_loss * resistance_factor(winding) + friction
            housing = np.where(margin <= 0.0, np.inf, self.ambient + self.housing_resistance * warm)
        return winding, housing


@dataclass(frozen=True, kw_only=True, eq=False)
class HeatCycle:
    """Losses of m motors over the n intervals of a cycle.

    Attributes:
        duration: Of each interval (n,), s.
        copper_loss: Mean copper loss at 25 °C (m, n), W.
        friction_loss: Mean friction and iron loss (m, n), W.

    Raises:
        InputError: For arrays whose shapes do not fit, negative losses or durations, or no duration at all.

    Example:
        >>> import numpy as np
        >>> from bellcrank.actuators.thermal import HeatCycle
        >>> loss = np.array([[110.0, 0.0]])
        >>> HeatCycle(duration=np.array([30.0, 30.0]), copper_loss=loss, friction_loss=0.0 * loss).period
        60.0
    """

    duration: Array
    copper_loss: Array
    friction_loss: Array

    def __post_init__(self) -> None:
        where = "a heat cycle"
        duration = arguments.array("duration", self.duration, (None,), "s", where=where)
        if not duration.sum() > 0.0 or duration.min() < 0.0:
            arguments.refuse("duration", "durations of 0 or more that are not all 0 (s)", self.duration, where)
        object.__setattr__(self, "duration", duration)
        for name in ("copper_loss", "friction_loss"):
            loss = arguments.array(name, getattr(self, name), (None, len(duration)), "W", finite=False, where=where)
            if (loss < 0.0).any():
                arguments.refuse(name, "losses of 0 or more (W)", float(np.nanmin(loss)), where)
            object.__setattr__(self, name, loss)
        if len(self.copper_loss) != len(self.friction_loss):
            arguments.refuse("friction_loss", f"{len(self.copper_loss)} rows", self.friction_loss, where)

    def __getitem__(self, index: Any) -> Self:
        """The losses of some of the motors."""
        return type(self)(
            duration=self.duration, copper_loss=self.copper_loss[index], friction_loss=self.friction_loss[index]
        )

    @property
    def period(self) -> float:
        """Duration of the cycle, s."""
        return float(self.duration.sum())

    def repeated(self, times: int) -> Self:
        """The cycle several times in a row."""
        return type(self)(
            duration=np.tile(self.duration, times),
            copper_loss=np.tile(self.copper_loss, (1, times)),
            friction_loss=np.tile(self.friction_loss, (1, times)),
        )

    def divided(self, parts: int) -> Self:
        """Every interval divided into equal parts, for temperatures in between."""
        return type(self)(
            duration=np.repeat(self.duration / parts, parts),
            copper_loss=np.repeat(self.copper_loss, parts, axis=1),
            friction_loss=np.repeat(self.friction_loss, parts, axis=1),
        )


def temperatures(
    model: ThermalModel, heat: HeatCycle, start: tuple[Array, Array] | None = None
) -> tuple[Array, Array, Array]:
    """Winding and housing temperature at the ends of the intervals, exactly.

    For a curve use `heat.divided(parts)`, for several cycles `heat.repeated(times)`.

    Args:
        model: Models of m motors.
        heat: Losses of the m motors.
        start: Winding and housing temperature (m,) at the start, °C; None: both at the ambient.

    Returns:
        Times (n + 1,), s, and temperatures (m, n + 1) of winding and housing, °C; NaN where unknown.

    Example:
        >>> import numpy as np
        >>> from bellcrank.actuators.thermal import HeatCycle, ThermalModel, temperatures
        >>> one = np.ones(1)
        >>> model = ThermalModel(winding_capacity=5.568 * one, housing_capacity=108.036 * one,
        ...                      winding_resistance=0.74 * one, housing_resistance=8.96 * one,
        ...                      friction_share=one, ambient=25.0 * one)
        >>> heat = HeatCycle(duration=np.array([30.0]), copper_loss=110.4 * one[:, None],
        ...                  friction_loss=np.zeros((1, 1)))
        >>> time, winding, housing = temperatures(model, heat)
        >>> round(float(winding[0, -1]))
        183
    """
    count = len(heat.duration)
    states = np.empty((2, count + 1, len(heat.copper_loss)))
    states[:, 0] = 0.0 if start is None else np.stack(start) - model.ambient
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for k in range(count):
            rates = model.rates(heat.copper_loss[:, k], heat.friction_loss[:, k])
            states[:, k + 1] = states[:, k] + Kernel.of(rates, heat.duration[k]).step(rates.slope(states[:, k]))
    time = np.concatenate([[0.0], np.cumsum(heat.duration)])
    winding, housing = np.swapaxes(states + model.ambient, 1, 2)
    return time, winding, housing
