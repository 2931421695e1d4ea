"""Events within a step: every crossing of functions that oscillate, dip or rest there, against closed forms."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.simulation.trajectory.trajectory import Trajectory

SPIN, START = 2.0, 0.01  # rad/s and rad of a body that turns freely: q = START + SPIN t to rounding, in few long steps
URDF = """<robot name="spin"><link name="base"/><link name="wheel"><inertial><mass value="1"/>
  <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <joint name="spin" type="continuous"><parent link="base"/><child link="wheel"/><axis xyz="0 0 1"/></joint></robot>"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    folder: Path = tmp_path_factory.mktemp("wheel")
    (folder / "spin.urdf").write_text(URDF)
    (folder / "spin.yaml").write_text(
        f"urdf: spin.urdf\ngravity: [0, 0, 0]\ninitial: {{spin: {START}, velocity: {{spin: {SPIN}}}}}\n"
    )
    return load_scene(folder / "spin.yaml")


def watched(scene: Scene, expression: str, *, changes: dict[str, Any] | None = None, **settings: Any) -> Trajectory:
    event = {"name": "e", "when": {"expression": expression}} | (changes or {})
    return bc.simulate(scene, overrides={"events": [event]}, samples=2, **settings)


def times(run: Trajectory) -> np.ndarray:
    return np.array([event.time for event in run.events])


def zeros(frequency: float, duration: float) -> np.ndarray:
    """The times at which sin(frequency q) is zero."""
    first, last = (frequency * q / np.pi for q in (START, START + SPIN * duration))
    return (np.arange(np.ceil(first), np.floor(last) + 1) * np.pi / frequency - START) / SPIN


@pytest.mark.parametrize("solver", ["DOP853", "RK45", "Radau"])
@pytest.mark.parametrize(("frequency", "count"), [(50, 318), (500, 3183)])
def test_every_crossing_of_a_function_that_oscillates_within_a_step_is_found(wheel, solver, frequency, count):
    run = watched(wheel, f"sin({frequency}*spin.position)", duration=10.0, solver=solver)
    assert run.statistics.steps < 10  # many periods in each
    assert len(run.events) == count
    np.testing.assert_allclose(times(run), zeros(frequency, 10.0), rtol=0, atol=1e-11)
    assert run.warnings == ()


@pytest.mark.parametrize("solver", ["DOP853", "RK45", "Radau"])
def test_the_state_of_an_event_is_on_its_level_however_loose_the_tolerance(wheel, solver):
    """The dense output of such long steps is off by up to 6e-4: the event is that of a step which ends there."""
    spring = {"kind": "joint_spring", "joint": "spin", "stiffness": 1.0}  # q = cos t
    event = {"name": "e", "when": {"expression": "spin.position - 0.4"}, "stop": True}
    changes = {"forces": [spring], "events": [event], "initial": {"spin": 1.0}}
    run = bc.simulate(wheel, duration=6.0, solver=solver, rtol=1e-3, atol=1e-3, samples=2, overrides=changes)
    assert run.statistics.steps < 10
    assert run.events[0].position[0] == pytest.approx(0.4, abs=1e-14)
    assert run.time[-1] == run.events[0].time == pytest.approx(np.arccos(0.4), abs=1e-3)


@pytest.mark.tier2
def test_every_crossing_is_found_whatever_the_frequency_and_phase(wheel):
    random = np.random.default_rng(7)
    for frequency in np.exp(random.uniform(np.log(3.0), np.log(900.0), 60)).tolist():
        level = float(random.choice([0.0, 0.5, 0.99, -0.9]))
        run = watched(wheel, f"sin({frequency!r}*spin.position)-{level!r}", duration=4.0)
        ends = np.array([START, START + SPIN * 4.0]) * frequency
        turns = np.arange(-1.0, ends[1] / (2 * np.pi) + 1)
        phases = np.concatenate([np.arcsin(level) + 2 * np.pi * turns, np.pi - np.arcsin(level) + 2 * np.pi * turns])
        expected = np.sort((phases[(phases > ends[0]) & (phases < ends[1])] / frequency - START) / SPIN)
        assert len(run.events) == len(expected), (frequency, level)
        np.testing.assert_allclose(times(run), expected, rtol=0, atol=1e-9)


def test_crossings_one_way_are_every_other_one(wheel):
    both = times(watched(wheel, "sin(300*spin.position)", duration=5.0))
    for direction, first in (("down", 0), ("up", 1)):
        one = times(watched(wheel, "sin(300*spin.position)", duration=5.0, changes={"direction": direction}))
        np.testing.assert_allclose(one, both[first::2], rtol=0, atol=1e-13)


@pytest.mark.parametrize("frequency", [50, 500, 50000])
def test_a_run_that_an_event_ends_ends_at_the_first_of_many(wheel, frequency):
    run = watched(wheel, f"sin({frequency}*spin.position)", duration=10.0, changes={"stop": True})
    assert len(run.events) == 1
    assert run.time[-1] == pytest.approx(zeros(frequency, 1.0)[0], abs=1e-13)


@pytest.mark.parametrize("depth", [1e-2, 1e-5, 1e-9])
def test_both_crossings_of_every_dip_are_found_however_shallow(wheel, depth):
    """cos(20 q) + 1 − depth is negative within √(2 depth)/20 of q = (2k + 1) π/20."""
    run = watched(wheel, f"cos(20*spin.position)+{1 - depth!r}", duration=10.0)
    turns = np.arange(np.ceil((20 * START / np.pi - 1) / 2), (20 * (START + SPIN * 10) / np.pi - 1) / 2)
    middle, half = (2 * turns + 1) * np.pi / 20, np.arccos(1 - depth) / 20
    expected = (np.sort(np.concatenate([middle - half, middle + half])) - START) / SPIN
    np.testing.assert_allclose(times(run), expected, rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    "expression", ["(spin.position-7.3)**2+1e-9", "abs(spin.position-7.3)+1e-9", "1.01+sin(900*t)"]
)
def test_what_comes_near_zero_and_does_not_reach_it_is_no_event(wheel, expression):
    run = watched(wheel, expression, duration=10.0)
    assert run.events == () and run.warnings == ()


def test_a_jump_through_zero_within_a_step_is_found_where_it_is(wheel):
    run = watched(wheel, "sign(spin.position-7.3)*(2+sin(3*t))", duration=10.0)
    np.testing.assert_allclose(times(run), [(7.3 - START) / SPIN], rtol=0, atol=1e-12)


def test_crossings_at_the_ends_of_fixed_steps_count_once(wheel):
    step = np.pi / 10
    run = watched(wheel, "sin(10*t)", duration=31.4, solver="RK4", step=step)
    np.testing.assert_allclose(times(run), np.arange(1, 100) * step, rtol=0, atol=1e-12)


@pytest.mark.tier2
def test_crossings_that_may_have_been_missed_are_told_with_event_steps_time_and_remedy(wheel, tmp_path):
    run = watched(wheel, "sin(50000*spin.position)", duration=4.0)
    assert 0 < len(run.events) < len(zeros(50000, 4.0))
    (told,) = run.warnings
    assert "event 'e'" in told and "may have been missed" in told and "max_step" in told
    (found,) = run.statistics.unresolved
    assert found.event == "e" and found.steps <= run.statistics.steps and f"from {found.first:.6g} s on" in told
    assert bc.load_run(run.save(tmp_path / "run")).statistics.unresolved == run.statistics.unresolved
    finer = watched(wheel, "sin(5000*spin.position)", duration=4.0, max_step=0.1)
    assert finer.warnings == () and len(finer.events) == len(zeros(5000, 4.0))


@pytest.mark.parametrize("tolerance", [1e-4, 1e-7])
@pytest.mark.parametrize(("joint", "kind"), [("shoulder", "position"), ("elbow", "velocity")])
def test_shallow_crossings_of_a_swinging_arm_are_those_of_its_dense_output(joint, kind, tolerance):
    """Long steps of DOP853: what a cubic through their ends misses is found too."""
    scene, random = load_scene("planar_2r_swing"), np.random.default_rng(11)
    rows = bc.simulate(scene, rtol=tolerance, atol=tolerance, duration=5.0, samples=20001)
    x = getattr(rows.joint(joint), kind)
    extrema = x[1:-1][np.diff(x)[1:] * np.diff(x)[:-1] < 0]
    for extreme in extrema.tolist():
        level = extreme + float(random.choice([-1, 1]) * 10.0 ** random.uniform(-5, -2) * np.ptp(x))
        event = [{"name": "e", "when": {"expression": f"{joint}.{kind}-level"}}]
        changes = {"parameters": {"level": {"value": level}}, "events": event}
        run = bc.simulate(scene, rtol=tolerance, atol=tolerance, duration=5.0, samples=2, overrides=changes)
        assert len(run.events) >= np.count_nonzero(np.diff(np.sign(x - level)))
