"""Dry friction and stops: sticking, sliding and impacts against closed forms, and the time next to SciPy's events."""

from __future__ import annotations

import math
import time
from math import inf
from typing import Any

import numpy as np

from bellcrank.scene.scene import Scene
from bellcrank.simulation.simulate import simulate
from bellcrank_bench.problems.checks import Check
from bellcrank_bench.problems.problem import scene_of
from bellcrank_bench.problems.urdf_texts import joint, link, robot

G = 9.81
PERIOD = 12.001031294791842  # s, of the block on a belt below, by DOP853 at 1e-13
BELT, FALL = 0.2, 3.0  # m/s, and 1 / (m/s): friction 1 / (1 + 3 |v|)
DURATION = 60.0
_TIGHT: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-12}


def friction_and_stops() -> list[Check]:
    """A block on a belt (R. Leine & H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004), a
    Coulomb oscillator, and a ball that comes to rest after infinitely many impacts; all of mass, stiffness and friction
    1. The time of the first one next to SciPy's DOP853 with events, best of 5 and of 2.
    """
    spring = [{"kind": "torque", "joint": "slide", "value": f"-(slide.position + {BELT}*t)"}]
    friction = {"coulomb": 0.0, "static": 1.0, "speed": 1.0 / FALL, "law": "hyperbolic"}
    belt = _block({"dry_friction": friction}, forces=spring, initial={"slide": 1.0, "velocity": {"slide": -BELT}})
    run = simulate(belt, DURATION, **_TIGHT)
    begun = run.stuck("slide")[1:, 0]
    oscillator = _block(
        {"dry_friction": {"coulomb": 0.15}}, initial={"slide": 1.0},
        forces=[{"kind": "joint_spring", "joint": "slide", "stiffness": 1.0}],
    )  # fmt: skip
    rest = simulate(oscillator, 20.0, **_TIGHT).stuck("slide")[0, 0]
    ball = _block({"stop": {"lower": 0.0, "restitution": 0.8}}, gravity=[-G, 0.0, 0.0], initial={"slide": 1.0})
    lies = simulate(ball, 10.0, **_TIGHT).at_stop("slide")[0, 0]
    kernel = min(simulate(belt, DURATION, rtol=1e-9, atol=1e-9).statistics.kernel_time for _ in range(5))
    scipy = min(_scipy_seconds() for _ in range(2))
    return [
        Check("block on a belt: period", float(np.abs(np.diff(begun) - PERIOD).max()), 1e-9, "s"),
        Check("Coulomb oscillator: time of rest", abs(float(rest) - 3.0 * math.pi), 1e-9, "s"),
        Check("ball: end of infinitely many impacts", abs(float(lies) - 9.0 * math.sqrt(2.0 / G)), 1e-9, "s"),
        Check(f"block on a belt, {DURATION:g} s: integrator", kernel * 1e3, inf, "ms"),
        Check("block on a belt: of SciPy's time with events", kernel / scipy, 1.0 / 20.0, "times"),
    ]


def _block(contact: dict[str, Any], **keys: Any) -> Scene:
    urdf = robot("block", link("ground"), link("block", 1.0, inertia=(1.0, 1.0, 1.0)),
                 joint("slide", "prismatic", "ground", "block", axis=(1, 0, 0)))  # fmt: skip
    return scene_of(urdf, {"gravity": [0.0, 0.0, 0.0], "joints": {"slide": contact}, **keys})


def _scipy_seconds() -> float:
    """Seconds of the block on a belt by DOP853, phase after phase, at 1e-9."""
    from scipy.integrate import solve_ivp

    def slides(direction: float) -> Any:
        return lambda t, x: [x[1], -(x[0] + BELT * t) - direction / (1.0 + FALL * abs(x[1]))]

    def stops(t: float, x: Any) -> float:
        return float(x[1])

    def gives_way(t: float, x: Any) -> float:
        return float(1.0 - abs(x[0] + BELT * t))

    for event in (stops, gives_way):
        event.terminal = True  # type: ignore[attr-defined]
    begun = time.perf_counter()
    t, x, direction = 0.0, [1.0, -BELT], -1.0
    while t < DURATION:
        equation = slides(direction) if direction else lambda t, x: [0.0, 0.0]
        event = stops if direction else gives_way
        found = solve_ivp(equation, (t, DURATION), x, "DOP853", rtol=1e-9, atol=1e-9, events=event, first_step=1e-3)
        t, x = float(found.t[-1]), [float(found.y[0, -1]), 0.0]
        load = -(x[0] + BELT * t)
        direction = 0.0 if direction and abs(load) < 1.0 else math.copysign(1.0, load)
        x[1] = 1e-9 * direction  # so that the first event is not the beginning
    return float(time.perf_counter() - begun)
