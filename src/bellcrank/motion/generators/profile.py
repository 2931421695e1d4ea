"""Timing along a path: distance s(t) with its speed and acceleration, under limits.

Four kinds: `constant` has one speed, which jumps at both ends. `trapezoid` accelerates, cruises and decelerates with
one magnitude of acceleration. `quintic` is s = S (10 u³ − 15 u⁴ + 6 u⁵), u = t/T. `s_curve` is the trapezoid with ramps
of acceleration, seven pieces of constant jerk (L. Biagiotti, C. Melchiorri, Trajectory Planning for Automatic Machines
and Robots, 3.4). With limits and no duration the profile is the fastest within them; with a duration it is stretched in
time, which lowers speed, acceleration and jerk alike. Where no limit determines them, accelerating, cruising and
decelerating last a third of the time each, and an s_curve's ramps of acceleration a quarter of accelerating.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cbrt, inf, isfinite, sqrt
from typing import Any, Literal

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name

KINDS = ("constant", "trapezoid", "quintic", "s_curve")
LEAST, MOST = 1e-30, 1e30  # of distances, times and limits, in SI units: fifth powers of them are numbers
SAME = 1e-12  # of the whole distance: distances closer than this are one
_UNITS = {"distance": "m", "duration": "s", "speed": "m/s", "acceleration": "m/s²", "jerk": "m/s³"}


@dataclass(frozen=True)
class Profile:
    """Distance along a path over time: a polynomial a piece, from s(0) = 0 to s(duration) = distance.

    `breaks` (k + 1,) in s; `coefficients` (k, 6): s − s(break) = Σ c_i (t − break)^i; `distance` in m (or
    rad).
    """

    kind: str
    distance: float
    breaks: Array
    coefficients: Array

    @property
    def duration(self) -> float:
        """Time from start to end, s."""
        return float(self.breaks[-1])

    def at(self, t: Any, side: Literal["after", "before"] = "after") -> tuple[Array, Array, Array]:
        """Distance, speed and acceleration (m,) at times t (m,) in s; `side` picks the limit at a break."""
        times = np.asarray(t, dtype=np.float64)
        k = np.searchsorted(self.breaks, times, side="right" if side == "after" else "left") - 1
        return self._piece(np.clip(k, 0, len(self.coefficients) - 1), times)

    def _piece(self, k: Any, times: Array) -> tuple[Array, Array, Array]:
        c, u = self.coefficients[k], times - self.breaks[k]
        powers = np.arange(6.0)
        first, second = c * powers, c * powers * (powers - 1.0)
        s = _horner(c, u, 0)
        return s, _horner(first, u, 1), _horner(second, u, 2)

    def rows(self, samples: int, through: Array | None = None) -> tuple[Array, Array, Array, Array]:
        """Time, distance, speed and acceleration of at least `samples` rows, evenly spaced within each piece.

        Every break is a row, and so are the distances `through`; where the acceleration jumps there are two rows of
        one time, the limits from either side.
        """
        count = len(self.coefficients)
        times, pieces = [], []
        for k in range(count):
            begin, end = float(self.breaks[k]), float(self.breaks[k + 1])
            share = (samples - 1) * (end - begin) / self.duration
            steps = samples - 1 if count == 1 else max(2, int(np.ceil(share - 1e-9)))
            even = begin + (end - begin) * (np.arange(steps + 1) / steps)
            even[-1] = end
            if through is not None:
                even = np.union1d(even, self._times_within(k, through))
            times.append(even if k == 0 or self.kind == "trapezoid" else even[1:])
            pieces.append(np.full(len(times[-1]), k))
        time, piece = np.concatenate(times), np.concatenate(pieces)
        s, speed, acceleration = self._piece(piece, time)
        s = np.clip(s, 0.0, self.distance)
        s[-1] = self.distance
        if self.kind != "constant":
            speed[0] = speed[-1] = 0.0
        if self.kind in ("quintic", "s_curve"):
            acceleration[0] = acceleration[-1] = 0.0
        return time, s, speed, acceleration

    def _times_within(self, k: int, distances: Array) -> Array:
        """The times strictly inside piece k at which distances are reached, those next to its ends left out: near rest
        a distance that differs by rounding is reached at a time that differs by the root of it.
        """
        begin, end = float(self.breaks[k]), float(self.breaks[k + 1])
        edges = self._piece(k, np.array([begin, end]))[0]
        same = SAME * self.distance
        wanted = distances[(distances > edges[0] + same) & (distances < edges[1] - same)]
        low, high = np.full(len(wanted), begin), np.full(len(wanted), end)
        for _ in range(100):  # the distance increases: bisection to the last digit
            middle = (low + high) / 2.0
            short = self._piece(k, middle)[0] < wanted
            low, high = np.where(short, middle, low), np.where(short, high, middle)
        apart = 1e-9 * (end - begin)
        return np.asarray(high[(high - begin > apart) & (end - high > apart)])

    def peaks(self) -> tuple[float, float, float]:
        """Largest speed, acceleration and jerk (infinite where the acceleration jumps, the ends included)."""
        speeds: list[float] = []
        accelerations: list[float] = []
        jerks: list[float] = []
        for k, c in enumerate(self.coefficients):
            span = float(self.breaks[k + 1] - self.breaks[k])
            first = np.polynomial.Polynomial(c).deriv()
            second = first.deriv()
            third = second.deriv()
            for values, polynomial in ((speeds, first), (accelerations, second), (jerks, third)):
                turning = np.atleast_1d(polynomial.deriv().trim(1e-300).roots()).astype(complex)
                inside = turning.real[np.abs(turning.imag) < 1e-9]
                places = np.array([0.0, span, *inside[(inside > 0.0) & (inside < span)]])
                values.append(float(np.max(np.abs(polynomial(places)))))
        sudden = self.kind in ("constant", "trapezoid")
        return (
            max(speeds),
            inf if self.kind == "constant" else max(accelerations),
            inf if sudden else max(jerks),
        )


def profile(
    kind: str,
    distance: float,
    duration: float | None = None,
    speed: float | None = None,
    acceleration: float | None = None,
    jerk: float | None = None,
) -> Profile:
    """The profile of this kind over `distance` m, in `duration` s or within limits (m/s, m/s², m/s³) along the path.

    Raises InputError for an unknown kind, for limits that the kind cannot keep (acceleration for `constant`, jerk for
    `trapezoid`), for numbers outside LEAST to MOST, for neither a duration nor a limit, and for a duration shorter than
    the limits allow.
    """
    if arguments.text("profile", kind, "the name of a profile") not in KINDS:
        raise InputError(unknown_name("profile", kind, KINDS))
    given = {"duration": duration, "speed": speed, "acceleration": acceleration, "jerk": jerk}
    for key, value in {"distance": distance, **given}.items():
        if value is None:
            continue
        arguments.number(key, value, above=0.0, where=f"profile '{kind}'")
        if not LEAST <= value <= MOST:
            raise InputError(
                f"profile '{kind}': {key} must be from {LEAST:g} to {MOST:g} {_UNITS[key]}, got {value:g}; "
                "omit limits that have no effect"
            )
    kept = {"constant": 1, "trapezoid": 2}.get(kind, 3)
    for key in ("speed", "acceleration", "jerk")[kept:]:
        if given[key] is not None:
            raise InputError(
                f"profile '{kind}' cannot keep a limit of {key}: its {key} is infinite at the ends; "
                f"choose {'trapezoid, ' if key == 'acceleration' else ''}quintic or s_curve"
            )
    limits = {key: value for key, value in given.items() if key != "duration" and value is not None}
    if duration is None and not limits:
        raise InputError(f"profile '{kind}': give a duration or a limit (speed, acceleration, jerk)")
    if limits:
        fastest = _fastest(kind, distance, limits)
    else:
        fastest = _fastest(kind, distance, {"speed": distance})
        assert duration is not None
        fastest = _stretched(fastest, duration)
    if duration is None:
        return fastest
    if duration < fastest.duration * (1.0 - 1e-12):
        words = ", ".join(f"{key} {value:g}" for key, value in limits.items())
        raise InputError(
            f"profile '{kind}': a duration of {duration:g} s is too short for a distance of {distance:g} "
            f"within {words}; the least duration is {fastest.duration:.6g} s"
        )
    return _stretched(fastest, duration)


def _fastest(kind: str, distance: float, limits: dict[str, float]) -> Profile:
    v, a, j = (limits.get(key, inf) for key in ("speed", "acceleration", "jerk"))
    if kind == "constant":
        return Profile(kind, distance, np.array([0.0, distance / v]), np.array([[0.0, v, 0.0, 0.0, 0.0, 0.0]]))
    if kind == "quintic":
        least = max(1.875 * distance / v, sqrt(10.0 / sqrt(3.0) * distance / a), cbrt(60.0 * distance / j))
        powers = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0]) * distance
        return Profile(kind, distance, np.array([0.0, least]), (powers / least ** np.arange(6.0))[None])
    if kind == "s_curve" and isfinite(j):
        ramp, flat, cruise = _seven_pieces(distance, v, a, j)
    else:
        part = 0.25 if kind == "s_curve" else 0.0  # share of speeding up that each ramp of acceleration takes
        if not isfinite(a):
            whole = distance / (2.0 * v)  # a third each
            cruise = whole
        else:
            whole = min(v, sqrt(a * (1.0 - part) * distance)) / (a * (1.0 - part))
            cruise = max(0.0, distance / (a * (1.0 - part) * whole) - whole)
        ramp, flat = part * whole, (1.0 - 2.0 * part) * whole
    return _symmetric(kind, distance, ramp, flat, cruise)


def _seven_pieces(distance: float, v: float, a: float, j: float) -> tuple[float, float, float]:
    """Times of a ramp of acceleration, of constant acceleration and of cruising, of the fastest within all limits."""
    ramp = min(a / j, sqrt(v / j))
    flat = v / (j * ramp) - ramp if isfinite(v) else inf
    if isfinite(flat) and v * (2.0 * ramp + flat) <= distance:
        return ramp, max(flat, 0.0), (distance - v * (2.0 * ramp + max(flat, 0.0))) / v
    ramp = min(a / j, cbrt(distance / (2.0 * j)))
    flat = 0.5 * (sqrt(ramp * ramp + 4.0 * distance / (j * ramp)) - 3.0 * ramp)
    return ramp, max(flat, 0.0), 0.0


def _symmetric(kind: str, distance: float, ramp: float, flat: float, cruise: float) -> Profile:
    top = distance / (2.0 * ramp + flat + cruise)  # cruising speed: distance = top · (speeding up + cruise)
    peak = top / (ramp + flat)
    jerk = peak / ramp if ramp > 0.0 else 0.0
    spans = [ramp, flat, ramp, cruise, ramp, flat, ramp]
    jerks = [jerk, 0.0, -jerk, 0.0, -jerk, 0.0, jerk]
    accelerations = [0.0 if ramp > 0.0 else peak, peak, peak, 0.0, 0.0, -peak, -peak]
    breaks, rows = [0.0], []
    s, v = 0.0, 0.0
    for span, third, second in zip(spans, jerks, accelerations, strict=True):
        if span <= 1e-12 * (2.0 * ramp + flat + cruise):
            continue
        rows.append([s, v, second / 2.0, third / 6.0, 0.0, 0.0])
        s += span * (v + span * (second / 2.0 + span * third / 6.0))
        v += span * (second + span * third / 2.0)
        breaks.append(breaks[-1] + span)
    return Profile(kind, distance, np.array(breaks), np.array(rows))


def _stretched(fast: Profile, duration: float) -> Profile:
    scale = duration / fast.duration
    breaks = fast.breaks * scale
    breaks[-1] = duration
    return Profile(fast.kind, fast.distance, breaks, fast.coefficients / scale ** np.arange(6.0))


def _horner(coefficients: Array, u: Array, lowest: int) -> Array:
    total = np.zeros_like(u)
    for i in range(5, lowest - 1, -1):
        total = total * u + coefficients[..., i]
    return total
