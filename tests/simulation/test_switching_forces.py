"""Forces whose formulas switch, against closed solutions of one degree of freedom, and where they cannot go on."""

import math
import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rotor import INERTIA, rotor
from scipy.interpolate import CubicSpline

import bellcrank as bc
from bellcrank.errors import InputError

SOLVERS = ["DOP853", "RK45", "Radau", "auto"]


def load(value, joint="spin", **more):
    return {"name": "load", "kind": "joint_force", "joint": joint, "value": value, **more}


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_force_of_constant_size_towards_a_place_swings_in_parabolas(tmp_path, solver):
    """x'' = -F sign(x) / J from rest at A: a quarter of the period is sqrt(2 A J / F)."""
    scene = rotor(tmp_path, forces=[load("-6 * sign(spin.position)")], initial={"spin": 0.5})
    quarter = math.sqrt(2 * 0.5 * INERTIA / 6.0)
    times = [quarter * k for k in (1, 2, 3, 4, 5)]
    run = bc.simulate(scene, duration=3.0, times=times, solver=solver)
    speed = 6.0 / INERTIA * quarter
    assert run.joint("spin").position == pytest.approx([0, -0.5, 0, 0.5, 0], abs=1e-10)
    assert run.joint("spin").velocity == pytest.approx([-speed, 0, speed, 0, -speed], abs=1e-10)
    sides = run.signals[-1]
    assert sides.breaks[1:-1] == pytest.approx([quarter, 3 * quarter, 5 * quarter], abs=1e-11)
    assert sides.coefficients[:, 0, 0].tolist() == [1.0, -1.0, 1.0, -1.0]


def test_no_step_crosses_a_switch(tmp_path):
    scene = rotor(tmp_path, forces=[load("-6 * sign(spin.position)")], initial={"spin": 0.5})
    run = bc.simulate(scene)
    for time in run.signals[-1].breaks[1:-1]:
        assert np.abs(run.steps - time).min() <= 1e-12


def test_a_step_of_time_begins_where_it_is_written(tmp_path):
    force = load("4 * step(t - 0.7) - 4 * step(t - 1.3)")
    run = bc.simulate(rotor(tmp_path, forces=[force]), times=[0.7, 1.0, 1.3, 3.0])
    rate = 4.0 / INERTIA
    assert run.joint("spin").velocity == pytest.approx([0, 0.3 * rate, 0.6 * rate, 0.6 * rate], abs=1e-13)
    assert run.joint("spin").position[-1] == pytest.approx(0.18 * rate + 0.6 * rate * 1.7, abs=1e-12)


def test_drag_by_the_square_of_the_speed_slows_down_as_one_over_time(tmp_path):
    """v' = -c |v| v: v = v0 / (1 + c v0 t)."""
    force = load("-3 * abs(spin.velocity) * spin.velocity")
    run = bc.simulate(rotor(tmp_path, forces=[force], initial={"velocity": {"spin": 2.0}}))
    expected = 2.0 / (1.0 + 3.0 / INERTIA * 2.0 * run.time)
    assert np.abs(run.joint("spin").velocity - expected).max() < 1e-10


@pytest.mark.parametrize("value", ["-50 * max(0, spin.position - 0.2)", "50 * min(0, 0.2 - spin.position)"])
def test_a_stop_of_one_side_is_left_after_half_a_swing_at_the_speed_of_its_arrival(tmp_path, value):
    start = {"spin": 0.0, "velocity": {"spin": 1.0}}
    stay = math.pi * math.sqrt(INERTIA / 50.0)
    run = bc.simulate(rotor(tmp_path, forces=[load(value)], initial=start), times=[0.2, 0.2 + stay / 2, 0.2 + stay])
    assert run.joint("spin").velocity == pytest.approx([1, 0, -1], abs=1e-9)
    assert run.joint("spin").position[1] == pytest.approx(0.2 + math.sqrt(INERTIA / 50.0), abs=1e-10)


def test_contact_with_a_power_of_the_depth_gives_back_all_energy(tmp_path):
    """Hertz: the formula has no value on the other side, and no stage is evaluated there."""
    force = load("-500 * max(0, spin.position - 0.2)**1.5")
    run = bc.simulate(rotor(tmp_path, forces=[force], initial={"velocity": {"spin": 1.0}}))
    assert run.status == "finished"
    assert run.joint("spin").velocity[-1] == pytest.approx(-1.0, abs=1e-7)


def test_a_force_is_active_while_its_formula_is_positive(tmp_path):
    rate = 4.0 / INERTIA
    force = load(4, active="0.5 - spin.position")
    run = bc.simulate(rotor(tmp_path, forces=[force]), times=[3.0])
    reached = math.sqrt(2 * 0.5 / rate)
    assert run.joint("spin").velocity[-1] == pytest.approx(rate * reached, abs=1e-11)
    wrench = {"kind": "wrench", "frame": "sled", "force": ["4 * step(1 - t)", 0, 0], "active": "t - 0.25"}
    run = bc.simulate(rotor(tmp_path, forces=[wrench]), times=[3.0])
    assert run.joint("slide").velocity[-1] == pytest.approx(0.75 * 2.0, abs=1e-12)


def test_switches_that_turn_together_turn_once(tmp_path):
    forces = [load("6 * step(-spin.position)"), load("-6 * step(spin.position)")]
    forces[1]["name"] = "other"
    run = bc.simulate(rotor(tmp_path, forces=forces, initial={"spin": 0.5}), samples=11)
    alone = bc.simulate(rotor(tmp_path, forces=[load("-6 * sign(spin.position)")], initial={"spin": 0.5}), samples=11)
    assert np.abs(run.position - alone.position).max() < 1e-11


def test_a_force_that_jumps_against_the_motion_on_both_sides_ends_the_run(tmp_path):
    scene = rotor(tmp_path, forces=[load("-5 * sign(spin.velocity)")], initial={"velocity": {"spin": 2.0}})
    run = bc.simulate(scene)
    assert run.status == "chattering"
    assert not run.success
    assert run.time[-1] == pytest.approx(2.0 / (5.0 / INERTIA), abs=1e-9)
    assert np.isfinite(run.state).all()
    assert "switches back and forth" in run.message


def test_a_formula_that_stays_at_its_corner_does_not_disturb(tmp_path):
    run = bc.simulate(rotor(tmp_path, forces=[load("3 * abs(spin.velocity) - 2 * max(0, spin.position)")]))
    assert run.status == "finished"
    assert not run.position.any()


@settings(max_examples=12, deadline=None)
@given(st.integers(2, 9), st.floats(0.1, 3.0), st.floats(-1.0, 1.0))
def test_a_wave_of_steps_has_all_its_steps(count, size, phase):
    with tempfile.TemporaryDirectory() as folder:
        rate = count * math.pi / 3.0
        force = load(f"{size!r} * sign(sin({rate!r} * t + {phase!r}))")
        run = bc.simulate(rotor(Path(folder), forces=[force]))
    roots = [(k * math.pi - phase) / rate for k in range(-2, count + 3)]
    inside = sorted(x for x in roots if 1e-6 < x < 3.0 - 1e-6)
    found = [x for x in run.signals[-1].breaks[1:-1] if 1e-6 < x < 3.0 - 1e-6]
    assert found == pytest.approx(inside, abs=1e-11)
    edges = [0.0, *inside, 3.0]
    middle = [0.5 * (a + b) for a, b in pairwise(edges)]
    signs = np.sign(np.sin(rate * np.array(middle) + phase))
    assert run.joint("spin").velocity[-1] == pytest.approx(size / INERTIA * float(signs @ np.diff(edges)), abs=1e-11)


def test_tables_over_an_output_are_their_formulas(tmp_path):
    """The table of |x| and the formula abs(x), through an output and its definition."""
    table = {"spring.csv": "angle [deg],spin torque [N m]\n-180,-9.42477796076938\n0,0\n180,-9.42477796076938\n"}
    outputs = {"angle": {"joint": "spin"}, "twice": {"expression": "2 * spin.position"}}
    start = {"spin": -0.3, "velocity": {"spin": 0.9}}
    by_table = {"name": "load", "kind": "joint_force", "joint": "spin", "file": "spring.csv", "over": "output('angle')"}
    one = bc.simulate(rotor(tmp_path, table, forces=[by_table], outputs=outputs, initial=start))
    two = bc.simulate(rotor(tmp_path, forces=[load("-1.5 * abs(output('twice'))")], outputs=outputs, initial=start))
    assert np.abs(one.position - two.position).max() < 1e-10
    assert one.output("twice") == pytest.approx(2 * one.output("angle"), abs=1e-15)


def test_a_table_keeps_its_end_values_and_a_cubic_one_is_its_spline(tmp_path):
    x, y = np.array([0.0, 0.1, 0.25, 0.4, 0.6]), np.array([1.0, 3.0, -2.0, 0.5, 4.0])
    rows = "\n".join(f"{a},{b}" for a, b in zip(x, y, strict=True))
    files = {"table.csv": f"place [m],slide torque [N]\n{rows}\n"}
    start = {"slide": -0.2, "velocity": {"slide": 1.0}}
    for interpolation, function in (("linear", lambda z: np.interp(z, x, y)), ("cubic", CubicSpline(x, y))):
        force = {"name": "load", "kind": "joint_force", "joint": "slide", "file": "table.csv",
                 "over": "slide.position", "interpolation": interpolation}  # fmt: skip
        scene = rotor(tmp_path, files, forces=[force], outputs={"f": {"force": "load"}}, initial=start)
        run = bc.simulate(scene, duration=1.0, samples=301)
        place = run.joint("slide").position
        assert place.min() < -0.1 and place.max() > 0.65
        assert run.output("f") == pytest.approx(function(np.clip(place, 0.0, 0.6)), abs=1e-12)


def test_formulas_of_parameters_and_frames_change_without_compiling(tmp_path):
    keys = {"frames": {"rim": {"link": "wheel", "xyz": [1, 0, 0]}}, "parameters": {"pull": {"value": 2.0}}}
    scene = rotor(
        tmp_path, forces=[load("-pull * frame('rim').y - 0.1 * frame('rim').wz")], **keys, initial={"spin": 1}
    )
    run = bc.simulate(scene, overrides={"pull": 5.0}, samples=51)
    equal = rotor(tmp_path, forces=[load("-5 * sin(spin.position) - 0.1 * spin.velocity")], initial={"spin": 1})
    assert np.abs(run.position - bc.simulate(equal, samples=51).position).max() < 1e-11
    assert scene.structure_key == scene.with_overrides({"pull": 5.0}).structure_key


@pytest.mark.parametrize(
    ("force", "why"),
    [
        (load("3 Nmm"), "expected a number in N m or a formula: '3 Nmm' is not an expression"),
        (load("1 + foo"), "unknown name 'foo'"),
        (load("spin.acceleration"), "not of accelerations"),
        (load("output('nothing')"), "unknown output 'nothing'"),
        (load("output('tip')"), r"expected output\('tip'\).x"),
        (load("output('energy')"), "is not a position or velocity"),
        (load("output('loop')"), "depend on each other"),
        (load(None, over="t"), "requires a 'file'"),
        (load("1", interpolation="cubic"), "requires a 'file'"),
        (load("1", active="abs()"), "active"),
    ],
)
def test_a_formula_that_cannot_be_meant_is_refused(tmp_path, force, why):
    outputs = {"tip": {"frame": "wheel"}, "energy": {"energy": "total"}, "loop": {"expression": "output('loop')"}}
    force = {key: value for key, value in force.items() if value is not None}
    force.setdefault("value", "1")
    with pytest.raises(InputError, match=why):
        rotor(tmp_path, forces=[force], outputs=outputs)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("place,slide torque [N]\n0,1\n1,2\n", "has no unit"),
        ("place [furlong],slide torque [N]\n0,1\n1,2\n", "'furlong' of the first column is not known"),
        ("place [m],slide torque [N]\n1,1\n0,2\n", "must increase"),
        ("place [m],slide force [N]\n0,1\n1,2\n", "unknown column 'slide force'"),
        ("place [m],slide torque [kg]\n0,1\n1,2\n", "has the unit 'kg'"),
        ("place [m],slide torque [N]\n" + "".join(f"{k},1\n" for k in range(301)), "at most 300 rows"),
    ],
)
def test_a_table_over_a_formula_that_cannot_be_meant_is_refused(tmp_path, text, why):
    force = {"kind": "joint_force", "joint": "slide", "file": "table.csv", "over": "slide.position"}
    with pytest.raises(InputError, match=why):
        rotor(tmp_path, {"table.csv": text}, forces=[force])


def test_what_needs_smooth_forces_says_so(tmp_path):
    scene = rotor(tmp_path, forces=[load("-6 * sign(spin.position) - spin.velocity")], parameters={"a": {"value": 1}})
    with pytest.raises(InputError, match="have no derivatives here"):
        bc.simulate(scene, sensitivities=["a"])
    with pytest.raises(InputError, match="is not smooth at this state"):
        bc.linearise(scene)
    beside = bc.linearise(scene.with_overrides({"initial.spin": 0.2}), at=0.0)
    assert beside.A[-1, -1] == pytest.approx(-0.5)


def test_a_run_that_switches_is_saved_and_read_back(tmp_path):
    scene = rotor(
        tmp_path, forces=[load("-6 * sign(spin.position)")], initial={"spin": 0.5}, outputs={"f": {"force": "load"}}
    )
    run = bc.simulate(scene)
    again = bc.load_run(run.save(tmp_path / "run.npz"))
    assert (again.output("f") == run.output("f")).all()
    assert (np.abs(run.output("f")) == 6.0).all()
    assert run.energy_drift() < 1e-10


def test_sweeps_of_forces_that_switch_are_runs_by_themselves(tmp_path):
    keys = {"parameters": {"pull": {"value": 6.0}}, "outputs": {"x": {"joint": "spin"}, "f": {"force": "load"}},
            "events": [{"name": "middle", "when": {"joint": "spin", "position": 0}}]}  # fmt: skip
    scene = rotor(tmp_path, forces=[load("-pull * sign(spin.position)")], initial={"spin": 0.5}, **keys)
    study = bc.sweep(scene, {"pull": [2.0, 6.0, 9.0]})
    for row, pull in enumerate((2.0, 6.0, 9.0)):
        run = bc.simulate(scene, overrides={"pull": pull})
        assert study.column("end.x")[row] == pytest.approx(run.output("x")[-1], abs=1e-12)
        assert study.column("end.f")[row] == run.output("f")[-1]
        assert study.column("middle.time")[row] == pytest.approx(math.sqrt(2 * 0.5 * INERTIA / pull), abs=1e-10)
        assert study.column("largest.x")[row] == pytest.approx(0.5, abs=1e-11)


def test_sizing_counts_a_load_that_switches(tmp_path):
    motions = {"turn": {"kind": "waypoints", "times": [0, 1], "positions": [{"spin": 0}, {"spin": 1}]}}
    scene = rotor(tmp_path, forces=[load("-7 * step(spin.position - 0.5)")], motions=motions)
    bare = rotor(tmp_path, motions=motions)
    with_load, without = bc.size(scene), bc.size(bare)
    history, plain = with_load.histories["turn"], without.histories["turn"]
    loaded, bare_torque = (np.interp(0.7, h.time, h.joint("spin").torque) for h in (history, plain))
    torque = loaded - bare_torque
    assert torque == pytest.approx(7.0, abs=1e-6)
    assert any("joint_force 'load'" in note and "as a load" in note for note in with_load.warnings)
