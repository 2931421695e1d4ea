"""The two-body thermal model of motors: winding and housing, solved exactly over intervals of constant loss.

    C_w dT_w/dt = P (1 + α (T_w - 25)) - (T_w - T_h)/R_wh
    C_h dT_h/dt = (T_w - T_h)/R_wh - (T_h - T_a)/R_ha + P_f

with the copper loss at 25 °C P, the heat P_f of friction and iron losses, C_w = τ_w/R_wh and C_h = τ_m/R_ha. (Two
bodies: maxon's motor data; the same equations are those of A. M. Johnson's Motor Thermal Calculator, CMU.) The copper's
resistance rise makes P part of the matrix A of the system x' = A x + b, so each interval has a matrix of its own. The
solution over an interval is exact.

The state is the temperature of winding and housing above the ambient, and moves by x' = A x + b with constant A and b.
With μ half the trace of A, M = A - μ I and s² = -det M > 0 (real, because the off-diagonal entries are positive), the
eigenvalues are μ ± s, M² = s² I and exp(A t) = e^{μ t} (cosh(s t) I + sinh(s t)/s M). The state moves by

    x(t) - x(0) = K(t) x'(0),  K(t) = ∫ exp(A u) du over (0, t) = p I + q M,
    p = (E_1 + E_2)/2, q = (E_1 - E_2)/(2 s), E_i = (e^{λ_i t} - 1)/λ_i

which holds for a singular A too, and needs no difference of large exponentials.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, NamedTuple, Self

import numpy as np

from bellcrank import arguments
from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.copper import COPPER, resistance_factor
from bellcrank.actuators.product_arrays import MotorArrays
from bellcrank.arrays import Array, Indices

TINY = 1e-250  # 1/s, stands for an eigenvalue of 0 in (e^{λ t} - 1)/λ


class Rates(NamedTuple):
    """The linear system of one interval or of several (…, m): conductances over capacities, and heat over capacities.

    Attributes:
        copper: P / C_w, K/s.
        friction: P_f / C_h, K/s.
        winding: 1/(R_wh C_w), 1/s.
        exchange: 1/(R_wh C_h), 1/s.
        housing: 1/(R_ha C_h), 1/s.
        factor: Resistance of copper at the ambient temperature over that at 25 °C.
    """

    copper: Array
    friction: Array
    winding: Array
    exchange: Array
    housing: Array
    factor: Array

    def taken(self, interval: Indices, motor: Indices) -> Rates:
        """The systems of some intervals and motors, one each; the losses are (n, m)."""
        return Rates(
            self.copper[interval, motor], self.friction[interval, motor], *(entry[motor] for entry in self[2:])
        )

    def halves(self) -> tuple[Array, Array]:
        """Half the difference of the diagonal entries of A, and s, half the distance of its eigenvalues, 1/s."""
        half_difference = 0.5 * (COPPER * self.copper - self.winding + self.exchange + self.housing)
        return half_difference, np.sqrt(half_difference * half_difference + self.winding * self.exchange)

    def slope(self, state: Array) -> Array:
        """The derivatives (2, …, m) of winding and housing temperature, K/s, at a state (2, …, m) above the ambient."""
        winding, housing = state
        difference = winding - housing
        return np.stack(
            [
                self.copper * (self.factor + COPPER * winding) - self.winding * difference,
                self.exchange * difference - self.housing * housing + self.friction,
            ]
        )


class Kernel(NamedTuple):
    """K(t) of x(t) - x(0) = K(t) x'(0), entry by entry, s.

    Attributes:
        ww: Slope of the winding's temperature on the winding.
        wh: Slope of the housing's temperature on the winding.
        hw: Slope of the winding's temperature on the housing.
        hh: Slope of the housing's temperature on the housing.
    """

    ww: Array
    wh: Array
    hw: Array
    hh: Array

    @classmethod
    def of(cls, rates: Rates, time: Array | float) -> Kernel:
        """K after a time (s)."""
        feedback, cooling = COPPER * rates.copper, rates.exchange + rates.housing
        mean = 0.5 * (feedback - rates.winding - cooling)
        half_difference, half_gap = rates.halves()
        signed = np.copysign(half_gap, mean)
        far = mean + signed  # the eigenvalue without cancellation
        near = (rates.winding * rates.housing - feedback * cooling) / far  # determinant over the other eigenvalue
        near = near + TINY * (near == 0.0)
        far_part, near_part = np.expm1(far * time) / far, np.expm1(near * time) / near
        p = 0.5 * (far_part + near_part)
        q = 0.5 * (far_part - near_part) / signed
        on_diagonal = q * half_difference
        return cls(p + on_diagonal, q * rates.winding, q * rates.exchange, p - on_diagonal)

    def step(self, slope: Array) -> Array:
        """The changes (2, …, m) of winding and housing temperature, K, from their derivatives at the start, K/s."""
        winding, housing = slope
        return np.stack([self.ww * winding + self.wh * housing, self.hw * winding + self.hh * housing])


def extremum_times(rates: Rates, slope: Array) -> Array:
    """When the slopes of winding and housing are zero: tanh(s t) = -s x'(0) / (M x'(0)), (2, m), s.

    NaN where there is no such time, which round-off may cause although the slope changes its sign: both are 0 then.
    """
    half_difference, half_gap = rates.halves()
    winding = half_difference * slope[0] + rates.winding * slope[1]
    housing = rates.exchange * slope[0] - half_difference * slope[1]
    with np.errstate(all="ignore"):
        times = np.arctanh(-half_gap * slope / np.stack([winding, housing])) / half_gap
    return np.asarray(times)


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
