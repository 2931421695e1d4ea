"""Drives in the loop: the axis of the Manutec r3 next to SciPy's events on the same equations, and closed forms."""

from __future__ import annotations

import math
import time
from math import inf
from typing import Any

import numpy as np

from bellcrank.analysis.linearise import linearise
from bellcrank.scene.scene import load_scene
from bellcrank.simulation.simulate import simulate
from bellcrank_bench.problems.checks import Check

RATIO, STIFFNESS, DAMPING, ROTOR, LOAD = 210.0, 8.0, 0.01, 0.0013, 15.0 * 1.14**2  # at the rotor; the load at the joint
CONSTANT, RESISTANCE, COULOMB, VISCOUS = 1.1616, 250.0, 0.5, 0.1 / 130.0
INDUCTANCE, KI = RESISTANCE / (2.0 * 0.6 * 5500.0), 5500.0 / (0.008 * 0.6)
KV, ASKED, TI = 5.0, 0.5, 0.05
LAST_SWITCH = 1.3536239494719329  # s, of the published trajectory
TOLERANCE = 1e-6


def drives() -> list[Check]:
    """The last switch of the rotor's friction as published (Modelica Standard Library 4.0, OneAxis), the resonance of
    its two masses without damping, and its time next to SciPy's DOP853 with events, best of 5 and of 2.
    """
    run = simulate("manutec_axis")
    bare = {"model": "torque", "servo": {"torque": 0}, "rotor_friction": "none",
            "elastic": {"stiffness": STIFFNESS * RATIO**2, "damping": 0}}  # fmt: skip
    free = {f"actuators.axis.{key}": value for key, value in bare.items()}
    drive = linearise(load_scene("manutec_axis", free)).drives[0]
    lower = math.sqrt(STIFFNESS * RATIO**2 / LOAD)
    upper = lower * math.sqrt(1.0 + LOAD / (ROTOR * RATIO**2))
    worst = max(abs(drive.antiresonances[0] / lower - 1.0), abs(drive.resonances[0] / upper - 1.0))
    kernel = min(simulate("manutec_axis", rtol=TOLERANCE, atol=TOLERANCE).statistics.kernel_time for _ in range(5))
    scipy, switches = min(_by_scipy() for _ in range(2))
    mine = run.stuck("axis rotor")
    return [
        Check("last friction switch, as published", abs(float(mine[-1, 1]) - LAST_SWITCH), 2e-4, "s"),
        Check("last friction switch, as SciPy has it", abs(float(mine[-1, 1]) - switches[-1]), 1e-4, "s"),
        Check("resonances of the two masses", worst, 1e-9, "relative"),
        Check("1.8 s of the axis: integrator", kernel * 1e3, inf, "ms"),
        Check("1.8 s of the axis: of SciPy's time with events", kernel / scipy, 1.0 / 20.0, "times"),
    ]


def _reference(t: float) -> tuple[float, float]:
    """The trapezoid of 120 degrees with 3 rad/s and 10 rad/s²: position and velocity."""
    way, speed, acceleration = 2.0 * math.pi / 3.0, 3.0, 10.0
    ramp, end = speed / acceleration, way / speed + speed / acceleration
    if t < ramp:
        return 0.5 * acceleration * t * t, acceleration * t
    if t < end - ramp:
        return speed * (t - 0.5 * ramp), speed
    left = max(end - t, 0.0)
    return way - 0.5 * acceleration * left * left, acceleration * left


def _by_scipy() -> tuple[float, list[float]]:
    """Seconds of the axis by DOP853, phase after phase, and the ends of those in which friction holds the rotor."""
    from scipy.integrate import solve_ivp

    def torques(x: Any) -> float:
        q, v, angle, speed, current = x[:5]
        return float(CONSTANT * current + STIFFNESS * (RATIO * q - angle) + DAMPING * (RATIO * v - speed))

    def rates(direction: float) -> Any:
        def rate(t: float, x: Any) -> list[float]:
            q, v, angle, speed, current, integral, volts = x
            place, wanted = _reference(t)
            error = RATIO * wanted + KV * (RATIO * place - angle) - speed
            asked = ASKED * (integral + error)
            spring = STIFFNESS * (RATIO * q - angle) + DAMPING * (RATIO * v - speed)
            friction = direction * COULOMB + VISCOUS * speed
            turning = (CONSTANT * current + spring - friction) / ROTOR if direction else 0.0
            return [v, -RATIO * spring / LOAD, speed if direction else 0.0, turning,
                    (volts - RESISTANCE * current - CONSTANT * speed) / INDUCTANCE, error / TI,
                    KI * (asked - current)]  # fmt: skip

        return rate

    def stops(t: float, x: Any) -> float:
        return float(x[3])

    def gives_way(t: float, x: Any) -> float:
        return COULOMB - abs(torques(x))

    for event in (stops, gives_way):
        event.terminal = True  # type: ignore[attr-defined]
    begun = time.perf_counter()
    breaks = [0.3, 2.0 * math.pi / 9.0, 2.0 * math.pi / 9.0 + 0.3, 1.8]
    t, x, direction, ends = 0.0, np.zeros(7), 0.0, []
    while t < 1.8:
        until = next(b for b in breaks if b > t + 1e-12)
        event = stops if direction else gives_way
        found = solve_ivp(rates(direction), (t, until), x, "DOP853", rtol=TOLERANCE, atol=TOLERANCE, events=event,
                          first_step=1e-6)  # fmt: skip
        t, x = float(found.t[-1]), found.y[:, -1].copy()
        if found.status != 1:
            continue
        load = torques(x)
        if not direction:
            ends.append(t)
        direction = 0.0 if direction and abs(load) < COULOMB else math.copysign(1.0, load)
        x[3] = 1e-9 * direction  # so that the first event is not the beginning
    return float(time.perf_counter() - begun), ends
