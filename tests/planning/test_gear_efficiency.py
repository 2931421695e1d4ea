"""Fastest motions with gears whose efficiency depends on the direction of power or on the load, sized again."""

from __future__ import annotations

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.dynamics.inverse.mechanism import mechanism_of
from bellcrank.planning.fastest_pass import fastest_on_grid
from bellcrank.planning.limits.path_limits import PathLimits
from tests.support.scenes import with_actuators

pytestmark = pytest.mark.tier2

MOTOR = {"peak_torque": 0.6, "nominal_torque": 0.3, "nominal_speed": 300.0, "max_speed": 700.0, "rotor_inertia": 2e-5}


def pendulum(**gear: object) -> bc.Scene:
    scene = bc.load_scene("geared_pendulum")
    motor = bc.Motor(id="m", maker="", model="", peak_curve=((0.0, 0.6), (700.0, 0.3)), **MOTOR)  # type: ignore[arg-type]
    chosen = bc.Gear(id="g", maker="", model="", kind="planetary", ratio=50.0, inertia=0.0, rated_torque=20.0, **gear)  # type: ignore[arg-type]
    return with_actuators(scene, {"shoulder": bc.Actuator.of(motor, chosen)})


def fastest(scene: bc.Scene) -> bc.results.FastestMotion:
    limits = bc.MotionLimits(speed="none", torque="none")
    return bc.time_optimal(scene, "lift_and_return", limits, costs=False)


def used(scene: bc.Scene, motion: bc.Motion) -> float:
    shaft = bc.size(scene, [motion]).joint("shoulder").shaft
    assert shaft is not None
    margins = [shaft.margins[key] for key in ("peak torque", "peak curve")]
    return 1.0 - min(margin for margin in margins if margin is not None)


@pytest.mark.parametrize("back", [0.0, 0.3, 0.7, 1.0])
def test_the_limit_is_just_used_with_another_efficiency_where_the_load_gives_power_back(back: float) -> None:
    scene = pendulum(efficiency=0.7, back_efficiency=back)
    found = fastest(scene)
    assert used(scene, found.motion) == pytest.approx(1.0, abs=1e-5)
    assert -1e-5 < found.excess <= 1e-6


def test_a_gear_that_loses_more_while_braking_stops_faster() -> None:
    times = [fastest(pendulum(efficiency=0.7, back_efficiency=back)).duration for back in (0.2, 0.7, 1.0)]
    assert times == sorted(times) and times[0] < times[-1] * 0.999


def test_a_curve_of_efficiency_over_the_load_is_kept_or_its_excess_is_told() -> None:
    scene = pendulum(efficiency_curve=((0.1, 0.6), (0.5, 0.72), (1.0, 0.8)))
    found = fastest(scene)
    assert any("curve over the load" in warning for warning in found.warnings)
    assert used(scene, found.motion) <= 1.0 + 1e-6
    slow, quick = (fastest(pendulum(efficiency=0.6, back_efficiency=0.8)), fastest(pendulum(efficiency=0.8)))
    assert found.duration == pytest.approx(slow.duration, rel=1e-9)
    assert found.duration > quick.duration


def test_no_dynamic_programme_over_speeds_is_faster_with_gears_that_lose_power_by_direction() -> None:
    """The programme takes shaft torques from the actuators, and knows neither intervals nor rows."""
    arm = bc.load_robot("planar_2r", friction={"shoulder": (6.0, 1.0), "elbow": (4.0, 0.5)})
    rated = {"rated_torque": 1.0, "rated_speed": 1e3, "max_speed": 1e4, "rotor_inertia": 2e-4, "efficiency": 0.6}
    actuators = {
        "shoulder": bc.Actuator(ratio=60.0, peak_torque=3.5, **rated),
        "elbow": bc.Actuator(ratio=40.0, peak_torque=2.4, **rated),
    }
    path = bc.joint_path(arm, [{}, {"shoulder": 0.7, "elbow": -0.9}, {"shoulder": 1.5, "elbow": 0.2}])
    cells, levels = 40, 300
    bounds = PathLimits(mechanism_of(arm), actuators, bc.MotionLimits(speed="none", torque="none"))
    found = fastest_on_grid(path, bounds, cells).duration
    s = np.linspace(0.0, path.length, cells + 1)
    q, first, second = path.at(s)
    y = np.linspace(0.0, 8.0, levels)
    cost = np.full(levels, np.inf)
    cost[0] = 0.0
    for i in range(cells - 1, -1, -1):
        u = ((y[None, :] ** 2 - y[:, None] ** 2) / (2.0 * (s[1] - s[0]))).reshape(-1, 1)
        speed = np.repeat(y, levels)[:, None]
        v, a = first[i] * speed, first[i] * u + second[i] * speed**2
        load = arm.inverse_dynamics(np.repeat(q[i][None], levels**2, axis=0), v, a)
        allowed = np.ones(levels**2, dtype=bool)
        for k, actuator in enumerate(actuators.values()):
            shaft = actuator.shaft_torque(load[:, k], v[:, k], a[:, k])
            allowed &= actuator.curve_use(shaft, actuator.ratio * v[:, k]) <= 1.0 + 1e-12
        with np.errstate(divide="ignore"):
            time = 2.0 * (s[1] - s[0]) / (y[:, None] + y[None, :])
        cost = np.min(np.where(allowed.reshape(levels, levels), time + cost[None, :], np.inf), axis=1)
    assert found <= cost[0] * (1.0 + 1e-9)
    assert found == pytest.approx(cost[0], rel=0.03)  # the programme's speeds are rounded to levels
