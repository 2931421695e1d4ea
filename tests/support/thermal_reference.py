"""The two-body thermal model by other routes than the product's: scipy's integrator, and explicit Euler steps."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

ALPHA = 0.0039


def model(
    capacities: tuple[float, float], resistances: tuple[float, float], ambient: float = 25.0, count: int = 1
) -> Any:
    """The product's model of `count` equal motors."""
    from bellcrank.actuators.thermal import ThermalModel

    winding, housing, inner, outer = (np.full(count, x) for x in (*capacities, *resistances))
    return ThermalModel(
        winding_capacity=winding, housing_capacity=housing, winding_resistance=inner, housing_resistance=outer,
        friction_share=np.ones(count), ambient=np.full(count, ambient),
    )  # fmt: skip


def slope(thermal: Any, state: Any, copper: float, friction: float) -> list[float]:
    """The derivatives of both temperatures, from the equations as they are written in textbooks."""
    winding, housing = state
    c1, c2, r1, r2, ambient = (
        float(x[0])
        for x in (
            thermal.winding_capacity,
            thermal.housing_capacity,
            thermal.winding_resistance,
            thermal.housing_resistance,
            thermal.ambient,
        )
    )
    inward = (winding - housing) / r1
    return [
        (copper * (1.0 + ALPHA * (winding - 25.0)) - inward) / c1,
        (inward - (housing - ambient) / r2 + friction) / c2,
    ]


def integrated(thermal: Any, heat: Any, start: Any = None, *, dense: int = 0) -> Any:
    """States at the ends of the intervals, by Radau's method at tight tolerance; (n + 1, 2), °C.

    With `dense` it returns that many samples an interval instead, ends included.
    """
    state = np.array([float(thermal.ambient[0])] * 2 if start is None else start)
    found = [state]
    for k, duration in enumerate(heat.duration.tolist()):
        if duration == 0.0:
            found.append(state)
            continue
        copper, friction = float(heat.copper_loss[0, k]), float(heat.friction_loss[0, k])
        solved = solve_ivp(
            lambda t, x, p=copper, f=friction: slope(thermal, x, p, f),
            (0.0, duration),
            state,
            method="Radau",
            rtol=1e-12,
            atol=1e-11,
            t_eval=np.linspace(0.0, duration, max(dense, 2)),
        )
        state = solved.y[:, -1]
        found.extend(solved.y.T if dense else [state])
    return np.array(found[1:] if dense else found)


def cycle_matrix(thermal: Any, heat: Any) -> Any:
    """The matrix of the change of temperatures over a cycle, from scipy's matrix exponentials."""
    c1, c2, r1, r2 = (
        float(x[0])
        for x in (
            thermal.winding_capacity,
            thermal.housing_capacity,
            thermal.winding_resistance,
            thermal.housing_resistance,
        )
    )
    product = np.eye(2)
    for copper, duration in zip(heat.copper_loss[0], heat.duration, strict=True):
        a = [[(ALPHA * copper - 1.0 / r1) / c1, 1.0 / (r1 * c1)], [1.0 / (r1 * c2), -(1.0 / r1 + 1.0 / r2) / c2]]
        product = expm(np.array(a) * duration) @ product
    return product


def euler_sheet(thermal: Any, copper: float, on: float, total: float, step: float) -> Any:
    """Time and winding temperature of an explicit Euler sheet, from the ambient temperature."""
    state, rows = np.array([float(thermal.ambient[0])] * 2), []
    for k in range(round(total / step) + 1):
        rows.append((k * step, state[0]))
        power = copper if k * step < on - 1e-9 else 0.0
        state = state + step * np.array(slope(thermal, state, power, 0.0))
    return np.array(rows)
