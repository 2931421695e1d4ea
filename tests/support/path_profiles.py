"""Distance, speed and acceleration over time of motions along a path, by their definitions: the textbook's profiles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]
Course = Callable[[Array], tuple[Array, Array, Array]]
QUINTIC = Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])


def fastest(
    kind: str, distance: float, speed: float, acceleration: float = np.inf, jerk: float = np.inf
) -> tuple[float, Course]:
    """The shortest time within limits, and the course."""
    if kind == "constant":
        return distance / speed, lambda t: (speed * t, speed + 0.0 * t, 0.0 * t)
    if kind == "quintic":
        limits = (speed, acceleration, jerk)
        duration = max((distance * _peak(k) / limit) ** (1.0 / k) for k, limit in enumerate(limits, 1))

        def smooth(t: Array) -> tuple[Array, Array, Array]:
            u = t / duration
            rows = [distance * QUINTIC.deriv(k)(u) / duration**k for k in (1, 2)]
            return distance * QUINTIC(u), rows[0], rows[1]

        return duration, smooth

    def ramps(top: float) -> tuple[float, float]:
        """Durations of a ramp of the acceleration and of its plateau, on the way to a speed."""
        ramp = min(acceleration / jerk, np.sqrt(top / jerk)) if np.isfinite(jerk) else 0.0
        return ramp, top / (jerk * ramp) - ramp if ramp else top / acceleration

    def way(top: float) -> float:
        ramp, flat = ramps(top)
        return top * (2.0 * ramp + flat)

    top = speed if way(speed) <= distance else float(brentq(lambda v: way(v) - distance, 1e-12, speed, xtol=1e-15))
    ramp, flat = ramps(top)
    cruise = (distance - way(top)) / top
    plateau = jerk * ramp if ramp else acceleration
    spans = np.array([ramp, flat, ramp, cruise, ramp, flat, ramp])
    jerks = np.array([1, 0, -1, 0, -1, 0, 1]) * (jerk if ramp else 0.0)
    firsts = np.array([0.0 if ramp else plateau, plateau, plateau, 0.0, 0.0, -plateau, -plateau])
    return float(spans.sum()), _pieces(spans, firsts, jerks)


def stretched(profile: tuple[float, Course], duration: float) -> Course:
    """The same course in another time."""
    own, course = profile

    def slow(t: Array) -> tuple[Array, Array, Array]:
        s, v, a = course(t * own / duration)
        return s, v * own / duration, a * (own / duration) ** 2

    return slow


def _peak(order: int) -> float:
    """The largest size of a derivative of the quintic on [0, 1]."""
    values = QUINTIC.deriv(order)
    places = [0.0, 1.0, *(x.real for x in values.deriv().roots() if 0.0 < x.real < 1.0)]
    return float(np.abs(values(np.array(places))).max())


def _pieces(spans: Array, firsts: Array, jerks: Array) -> Course:
    begins = np.concatenate([[0.0], np.cumsum(spans)])
    s, v = [0.0], [0.0]
    for span, a, j in zip(spans, firsts, jerks, strict=True):
        s.append(s[-1] + v[-1] * span + a * span**2 / 2.0 + j * span**3 / 6.0)
        v.append(v[-1] + a * span + j * span**2 / 2.0)

    def course(t: Array) -> tuple[Array, Array, Array]:
        k = np.clip(np.searchsorted(begins, t, side="right") - 1, 0, len(spans) - 1)
        u, a, j = t - begins[k], firsts[k], jerks[k]
        there, speed = np.array(s)[k], np.array(v)[k]
        return there + u * (speed + u * (a / 2.0 + u * j / 6.0)), speed + u * (a + u * j / 2.0), a + u * j

    return course
