"""One interval of the two-body thermal model under constant losses: its linear system, and the exact step.

The state is the temperature of winding and housing above the ambient, and moves by x' = A x + b with constant A and b.
With μ half the trace of A, M = A - μ I and s² = -det M > 0 (real, because the off-diagonal entries are positive), the
eigenvalues are μ ± s, M² = s² I and exp(A t) = e^{μ t} (cosh(s t) I + sinh(s t)/s M). The state moves by

    x(t) - x(0) = K(t) x'(0),  K(t) = ∫ exp(A u) du over (0, t) = p I + q M,
    p = (E_1 + E_2)/2, q = (E_1 - E_2)/(2 s), E_i = (e^{λ_i t} - 1)/λ_i

which holds for a singular A too, and needs no difference of large exponentials.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bellcrank.actuators.copper import COPPER
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
