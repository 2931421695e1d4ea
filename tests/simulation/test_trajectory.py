"""Runs: what they say of themselves is recomputed here from textbook equations, and files give them back to the bit."""

import csv
import dataclasses
import io
import json
import re
import shutil
import subprocess
import sys
import zipfile

import numpy as np
import pytest
from scipy.integrate import simpson

import bellcrank as bc
from bellcrank.errors import InputError
from bellcrank.simulation.files.run_csv import columns
from bellcrank.simulation.trajectory.run_plot import plot_run
from bellcrank.simulation.trajectory.run_warnings import run_warnings
from bellcrank_bench.textbook.planar_2r import PlanarTwoLink

ARM = """
name: Swinging arm
urdf: planar_2r
gravity: [0, -9.81, 0]
initial: {shoulder: 20 deg, elbow: 30 deg}
outputs:
  tip: {frame: tip}
  reach: {expression: "sqrt(frame('tip').x**2 + frame('tip').y**2)", unit: m}
simulate: {duration: 3, samples: 301, rtol: 1.0e-10, atol: 1.0e-10}
"""
DAMPED = ARM.replace("outputs:", "forces:\n  - {kind: damper, joint: elbow, coefficient: 3}\noutputs:")
SLIDER = """<?xml version="1.0"?>
<robot name="slider">
  <link name="rail"/>
  <link name="cart"><inertial><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
  </link>
  <joint name="slide" type="prismatic"><parent link="rail"/><child link="cart"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="10" velocity="10"/></joint>
</robot>
"""
OSCILLATOR = """
name: Cart on a spring
urdf: slider.urdf
forces: [{kind: joint_spring, joint: slide, stiffness: 8 N/m}]
initial: {slide: 0.1}
simulate: {duration: 10, samples: 101, rtol: 1.0e-6, atol: 1.0e-9}
"""
FOLLOWING = """
name: Arm on a table of torques
urdf: planar_2r
gravity: [0, -9.81, 0]
motions: {path: {kind: csv, file: data/path.csv}}
forces: [{kind: torque, joint: shoulder, file: torque.csv}]
control: [{kind: pd, motion: path, joints: [elbow], kp: 300, kd: 40}]
initial: {shoulder: 0.2, elbow: 0.1}
simulate: {duration: 2, samples: 41}
"""


def scene(folder, text, name="scene.yaml"):
    (folder / name).write_text(text)
    (folder / "slider.urdf").write_text(SLIDER)
    return folder / name


def following(folder):
    time = np.linspace(0.0, 2.0, 21)
    rows = zip(time.tolist(), (40.0 * np.cos(time)).tolist(), strict=True)
    (folder / "torque.csv").write_text("time [s],shoulder torque [N m]\n" + "".join(f"{t!r},{x!r}\n" for t, x in rows))
    (folder / "data").mkdir()
    rows = zip(time.tolist(), np.sin(time).tolist(), strict=True)
    (folder / "data" / "path.csv").write_text(
        "time [s],shoulder position [rad],elbow position [rad]\n" + "".join(f"{t!r},0.0,{x!r}\n" for t, x in rows)
    )
    return scene(folder, FOLLOWING)


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return bc.simulate(scene(tmp_path_factory.mktemp("arm"), ARM))


@pytest.fixture(scope="module")
def damped(tmp_path_factory):
    return bc.simulate(scene(tmp_path_factory.mktemp("damped"), DAMPED))


# ---- what a run says of itself


def test_energies_of_the_two_link_arm_are_the_textbooks_and_their_sum_stays(arm):
    kinetic, potential = PlanarTwoLink().energy(arm.position, arm.velocity)
    scale = np.abs(kinetic).max()
    assert np.abs(arm.kinetic_energy - kinetic).max() < 1e-12 * scale
    assert np.abs((arm.potential_energy - potential) - (arm.potential_energy - potential)[0]).max() < 1e-12 * scale
    total = kinetic + potential
    drift = np.abs(total - total[0]).max() / (kinetic + np.abs(potential - potential[0])).max()
    assert 0.0 < drift < 1e-9
    assert arm.energy_drift() == pytest.approx(drift, rel=1e-3, abs=1e-14)


def test_accelerations_obey_the_textbooks_equations_of_motion(arm):
    textbook = PlanarTwoLink().forward_dynamics(arm.position, arm.velocity, np.zeros((len(arm), 2)))
    assert np.abs(arm.acceleration - textbook).max() < 1e-11 * np.abs(textbook).max()
    assert arm.equation_residual() < 1e-13


def test_velocities_are_the_slopes_of_positions_and_accelerations_those_of_velocities(damped):
    h = damped.time[1] - damped.time[0]
    for rows, slope in ((damped.position, damped.velocity), (damped.velocity, damped.acceleration)):
        central = (8.0 * (rows[3:-1] - rows[1:-3]) - (rows[4:] - rows[:-4])) / (12.0 * h)  # order 4
        assert np.abs(central - slope[2:-2]).max() < 1e-3 * np.abs(slope).max()


def test_the_damper_takes_out_the_work_that_the_energies_lack(damped):
    power = -3.0 * damped.joint("elbow").velocity ** 2
    assert damped.work[-1] == pytest.approx(simpson(power, x=damped.time), rel=1e-6)
    kinetic, potential = PlanarTwoLink().energy(damped.position, damped.velocity)
    lost = (kinetic + potential) - (kinetic + potential)[0]
    assert damped.work[-1] < -1.0
    assert np.abs(lost - damped.work).max() < 1e-8 * np.abs(lost).max()
    assert damped.energy_drift() < 1e-8


def test_a_wrong_state_shows_as_drift_of_energy(arm):
    state = arm.state.copy()
    state[150, 2] *= 1.01
    assert dataclasses.replace(arm, state=state).energy_drift() > 1e-4


def test_the_tip_is_where_the_links_put_it_and_moves_as_they_turn(arm):
    q, v = arm.position, arm.velocity
    a, b, rate = q[:, 0], q[:, 0] + q[:, 1], v[:, 0] + v[:, 1]
    tip = np.stack([np.cos(a) + np.cos(b), np.sin(a) + np.sin(b), 0 * a], 1)
    speed = np.stack([-np.sin(a) * v[:, 0] - np.sin(b) * rate, np.cos(a) * v[:, 0] + np.cos(b) * rate, 0 * a], 1)
    frame = arm.frame("tip")
    assert np.abs(frame.position - tip).max() < 1e-13
    assert np.abs(frame.velocity - speed).max() < 1e-12 * np.abs(speed).max()
    assert np.abs(frame.angular_velocity[:, 2] - rate).max() < 1e-12 * np.abs(rate).max()
    assert np.array_equal(arm.output("tip"), frame.position)
    assert np.abs(arm.output("reach") - np.linalg.norm(tip, axis=1)).max() < 1e-13


def test_the_estimated_error_of_an_oscillator_is_near_its_true_error(tmp_path):
    run = bc.simulate(scene(tmp_path, OSCILLATOR))
    true = np.abs(run.position[:, 0] - 0.1 * np.cos(2.0 * run.time)).max()  # omega = sqrt(8 / 2)
    assert true > 1e-12
    assert 0.3 * true < run.error_estimate() < 3.0 * true


def test_the_estimated_error_of_fixed_steps_is_near_their_true_error(tmp_path):
    run = bc.simulate(scene(tmp_path, OSCILLATOR), solver="RK4", step=0.05)
    true = np.abs(run.position[:, 0] - 0.1 * np.cos(2.0 * run.time)).max()
    assert run.error_estimate() == pytest.approx(true, rel=0.01)


@pytest.mark.tier2
def test_an_event_that_unstable_steps_make_up_is_warned_of_and_a_true_or_sudden_one_is_not(tmp_path):
    stiff = ARM.replace("outputs:", "forces: [{kind: joint_spring, joint: elbow, stiffness: 40000}]\noutputs:")
    low = [{"name": "low", "when": {"expression": "frame('tip').y + 0.5"}, "direction": "down", "stop": True}]
    told = "event 'low' is not at a zero of its function"
    stiff = scene(tmp_path, stiff, "stiff.yaml")
    assert any(told in text for text in bc.simulate(stiff, solver="RK4", step=0.1, overrides={"events": low}).warnings)
    true = bc.simulate(scene(tmp_path, ARM), overrides={"events": low})
    assert true.events and true.warnings == ()
    low[0]["when"] = {"expression": "sign(0.5 - t)"}
    sudden = bc.simulate(scene(tmp_path, ARM), overrides={"events": low})
    assert sudden.events and sudden.warnings == ()


def test_the_error_is_not_estimated_from_a_second_run_that_an_event_ended_earlier(tmp_path):
    stop = [{"name": "low", "when": {"joint": "shoulder", "position": 0}, "stop": True}]
    run = bc.simulate(scene(tmp_path, ARM), overrides={"events": stop})
    assert run.error_estimate() < 1e-6
    late = dataclasses.replace(run, time=run.time * 1.001)
    assert late.error_estimate() == np.inf


def test_a_joint_that_leaves_its_range_is_noted_with_the_time(tmp_path):
    run = bc.simulate(scene(tmp_path, OSCILLATOR), overrides={"initial": {"velocity": {"slide": 3.0}}})
    when = np.arcsin(1.0 / 1.5) / 2.0  # x = 1.5 sin 2t passes the limit of 1 m
    told = re.search(r"not known +joint 'slide' leaves its range at (\S+) s: it reaches (-?[\d.]+) m", run.table())
    assert 0.0 <= float(told[1]) - when < 0.1 and abs(float(told[2])) == pytest.approx(1.5, abs=0.01)
    assert "leaves its range" not in bc.simulate(scene(tmp_path, OSCILLATOR)).table()


def test_the_table_of_a_run_with_motors_has_their_torque_and_is_a_motion_still(damped, tmp_path):
    run = bc.simulate(following(tmp_path))
    labels, table = columns(run)
    place = [f"{name} [{unit}]" for name, unit in labels].index("elbow actuator torque [N m]")
    assert np.array_equal(table[:, place], run.joint("elbow").actuator_torque)
    assert np.array_equal(bc.read_motion(run.robot, run.to_csv(tmp_path / "run.csv")).position, run.position)
    assert not any("actuator" in name for name, _ in columns(damped)[0])


def test_size_says_how_a_run_becomes_a_motion(arm):
    for given in (arm, [arm]):
        with pytest.raises(InputError, match=r"run.to_csv.*read_motion"):
            bc.size(arm.robot, given)


def test_a_picture_of_an_unknown_format_is_refused(arm, tmp_path):
    with pytest.raises(InputError, match="unknown picture format 'pgn'; did you mean 'png'"):
        arm.plot(tmp_path / "run.pgn")
    assert arm.plot(tmp_path / "run.svg") and "<svg" in (tmp_path / "run.svg").read_text(encoding="utf-8")


def test_panels_have_titles_of_their_own(tmp_path):
    several = "outputs:\n  push: {expression: '1', unit: N}\n  pull: {expression: t, unit: N m}"
    figure = bc.simulate(scene(tmp_path, ARM.replace("outputs:", several))).plot()
    titles = [axis.get_title(loc="left") for axis in figure.axes]
    assert len(set(titles)) == len(titles) and {"outputs: push", "outputs: pull", "outputs: tip, reach"} <= set(titles)


def test_unknown_names_are_refused_with_what_there_is(arm):
    for ask, there in ((arm.joint, "shoulder"), (arm.frame, "tip"), (arm.output, "reach")):
        with pytest.raises(InputError, match=there):
            ask("wrist")


# ---- files


def same(a, b):
    assert a.status == b.status and a.settings == b.settings and a.statistics == b.statistics
    for name in ("time", "state", "parameters", "steps", "acceleration", "torque", "inputs"):
        x, y = getattr(a, name), getattr(b, name)
        assert x.dtype == y.dtype == np.float64 and np.array_equal(x, y), name
    assert a.energy_drift() == b.energy_drift() and a.equation_residual() == b.equation_residual()
    assert np.array_equal(a.frame("tip").position, b.frame("tip").position)
    assert [(e.name, e.time, e.stopped) for e in a.events] == [(e.name, e.time, e.stopped) for e in b.events]
    for x, y in zip(a.events, b.events, strict=True):
        assert np.array_equal(x.position, y.position) and np.array_equal(x.velocity, y.velocity)


def test_a_loaded_run_is_the_same_to_the_bit_where_the_scene_is_gone(tmp_path):
    folder = tmp_path / "gone"
    folder.mkdir()
    run = bc.simulate(following(folder), overrides={"control.1.kp": 250, "initial.shoulder": 0.123456789012345678})
    path = run.save(tmp_path / "kept")
    assert path.name == "kept.npz"
    shutil.rmtree(folder)
    again = bc.load_run(path)
    same(run, again)
    assert again.scene.name == "Arm on a table of torques" and again.scene.data["control"][0]["kp"] == 250
    assert again.message == run.message and again.table() == run.table()
    # the scene in it can be simulated: torque table, motion and overrides came along
    assert np.array_equal(bc.simulate(again.scene).state, run.state)


@pytest.mark.parametrize("spoil", ["changed", "deleted"])
def test_a_run_keeps_the_tables_it_was_made_with_though_the_files_are_other_ones_when_it_is_saved(tmp_path, spoil):
    path = following(tmp_path)
    loaded = bc.load_scene(path)
    run = bc.simulate(loaded)
    for file in (tmp_path / "torque.csv", tmp_path / "data" / "path.csv"):
        if spoil == "deleted":
            file.unlink()
        else:
            header, *rows = file.read_text().splitlines()
            file.write_text("\n".join([header, *(f"{row}5" for row in rows)]) + "\n")
    again = bc.load_run(run.save(tmp_path / "run.npz"))
    same(run, again)
    assert np.array_equal(bc.simulate(again.scene).state, run.state)


def test_a_motion_is_what_its_file_held_when_the_scene_was_loaded(tmp_path):
    path = following(tmp_path)
    first, second = bc.load_scene(path), bc.load_scene(path)
    before = first.motion("path").position
    (tmp_path / "data" / "path.csv").unlink()
    assert np.array_equal(second.motion("path").position, before)
    with pytest.raises(InputError, match=r"motions\.path.*path\.csv: there is no such file"):
        bc.load_scene(path).motion("path")


@pytest.mark.tier2
def test_events_come_back_with_their_states(tmp_path):
    text = ARM.replace(
        "outputs:", "events: [{name: level, when: {joint: shoulder, position: 0}, stop: true}]\noutputs:"
    )
    run = bc.simulate(scene(tmp_path, text))
    assert run.status == "event" and abs(run.events[-1].position[0]) < 1e-9
    same(run, bc.load_run(run.save(tmp_path / "run.npz")))


@pytest.mark.tier2
def test_another_process_reads_the_same_drift(arm, tmp_path):
    path = arm.save(tmp_path / "arm.npz")
    script = f"import bellcrank as bc; print(bc.load_run({str(path)!r}).energy_drift().hex())"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, cwd="/")
    assert done.stdout.strip() == arm.energy_drift().hex()


def test_a_saved_run_is_saved_again_as_the_same_arrays(arm, tmp_path):
    first = arm.save(tmp_path / "first.npz")
    second = bc.load_run(first).save(tmp_path / "second.npz")
    with np.load(first) as a, np.load(second) as b:
        assert a.files == b.files
        assert all(np.array_equal(a[name], b[name]) for name in a.files if name != "about")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["first.npz", "second.npz"]


def rewritten(path, arrays=None, **changes):
    """The run's file with some arrays, or keys of its JSON text, changed."""
    with np.load(path) as stored:
        content = {name: stored[name] for name in stored.files}
    about = json.loads(content["about"].tobytes()) | changes
    content["about"] = np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)
    for name, value in (arrays or {}).items():
        content[name] = value
        if value is None:
            del content[name]
    np.savez(path, **content)


BROKEN = {
    "missing": (lambda p: p.unlink(), "no such file"),
    "empty": (lambda p: p.write_bytes(b""), "damaged"),
    "text": (lambda p: p.write_text("time,state\n0,1\n"), "damaged"),
    "truncated": (lambda p: p.write_bytes(p.read_bytes()[:-200]), "damaged"),
    "its middle cut out": (lambda p: p.write_bytes(p.read_bytes()[:900] + p.read_bytes()[1300:]), "damaged"),
    "a folder": (lambda p: (p.unlink(), p.mkdir()), "folder"),
    "another npz": (lambda p: np.savez(p, time=np.zeros(3)), "not a run"),
    "a single array": (
        lambda p: (np.save(p.with_suffix(".npy"), np.zeros(3)), p.with_suffix(".npy").rename(p)),
        "damaged",
    ),
    "an empty archive": (lambda p: zipfile.ZipFile(p, "w").close(), "not a run"),
    "JSON of another program": (lambda p: rewritten(p, format="other"), "not a run"),
    "a later format": (lambda p: rewritten(p, version=99), "99"),
    "no scene": (lambda p: rewritten(p, scene=None), "damaged"),
    "no files": (lambda p: rewritten(p, files={}), "scene"),
    "a file outside": (lambda p: rewritten(p, files={"../evil.yaml": "x"}), "evil"),
    "an unknown status": (lambda p: rewritten(p, status="lost"), "lost"),
    "unknown settings": (lambda p: rewritten(p, settings={"speed": 3}), "damaged"),
    "a bad tolerance": (lambda p: rewritten(p, settings={"rtol": -1.0}), "rtol"),
    "no state": (lambda p: rewritten(p, {"state": None}), "state"),
    "state of another robot": (lambda p: rewritten(p, {"state": np.zeros((301, 9))}), "state"),
    "fewer rows than times": (lambda p: rewritten(p, {"state": np.zeros((300, 4))}), "state"),
    "no rows": (lambda p: rewritten(p, {"time": np.zeros(0), "state": np.zeros((0, 4))}), "time"),
    "single precision": (lambda p: rewritten(p, {"time": np.zeros(301, np.float32)}), "float32"),
    "events without names": (lambda p: rewritten(p, {"event_time": np.zeros(2)}), "event_time"),
    "pickled objects": (lambda p: rewritten(p, {"time": np.array([{}] * 301, dtype=object)}), "damaged"),
}


@pytest.mark.parametrize("what", BROKEN)
def test_a_broken_file_is_one_sentence(arm, tmp_path, what):
    path = arm.save(tmp_path / "run.npz")
    spoil, words = BROKEN[what]
    spoil(path)
    with pytest.raises(InputError, match=words) as caught:
        bc.load_run(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)
    assert not (tmp_path.parent / "evil.yaml").exists()


def test_no_flipped_byte_goes_unnoticed_in_the_numbers(arm, tmp_path):
    path = arm.save(tmp_path / "run.npz")
    whole = path.read_bytes()
    random = np.random.default_rng(7)
    refused = 0
    for place in random.integers(0, len(whole), 60):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << int(random.integers(8))
        path.write_bytes(damaged)
        try:
            again = bc.load_run(path)
        except InputError:
            refused += 1
            continue
        # what still loads was hit where zip keeps dates and the like
        assert np.array_equal(again.state, arm.state) and np.array_equal(again.time, arm.time)
    assert refused > 40


def test_csv_holds_every_number_exactly_with_units(damped, tmp_path):
    path = damped.to_csv(tmp_path / "run.csv")
    rows = list(csv.reader(io.StringIO(path.read_text())))
    assert rows[0][:3] == ["time [s]", "shoulder position [rad]", "elbow position [rad]"]
    assert rows[0][3:9] == [
        f"{joint} {what}"
        for what in ("velocity [rad/s]", "acceleration [rad/s^2]", "torque [N m]")
        for joint in ("shoulder", "elbow")
    ]
    assert rows[0][9:] == [
        "kinetic energy [J]", "potential energy [J]", "work [J]", "tip x [m]", "tip y [m]", "tip z [m]", "reach [m]",
    ]  # fmt: skip
    assert np.array_equal(np.array(rows[1:], dtype=float), columns(damped)[1])
    table = np.array(rows[1:], dtype=float)
    assert np.array_equal(table[:, 3:5], damped.velocity) and np.array_equal(table[:, 11], damped.work)
    assert np.array_equal(table[:, 8], -3.0 * damped.velocity[:, 1])


def test_a_runs_csv_is_a_motion_that_can_be_sized(arm, tmp_path):
    motion = bc.read_motion(arm.robot, arm.to_csv(tmp_path / "run.csv"))
    assert motion.notes == () or all("range" in note or "limit" in note for note in motion.notes)
    assert np.array_equal(motion.velocity, arm.velocity)
    torque = arm.robot.inverse_dynamics(motion.position, motion.velocity, motion.acceleration)
    assert np.abs(torque).max() < 1e-9  # a free arm needs no motors


def test_files_cannot_be_written_below_a_file(arm, tmp_path):
    (tmp_path / "here").write_text("")
    for write, name in ((arm.save, "run.npz"), (arm.to_csv, "run.csv"), (arm.plot, "run.png")):
        with pytest.raises(InputError, match="cannot write"):
            write(tmp_path / "here" / name)


# ---- pictures and summaries


@pytest.mark.tier2
def test_the_plot_has_a_panel_for_each_unit_of_each_quantity(damped, tmp_path):
    figure = damped.plot(tmp_path / "run.png")
    titles = [axis.get_title(loc="left") for axis in figure.axes]
    assert [t.split(" (")[0] for t in titles] == [
        "position",
        "velocity",
        "energy",
        "joint torque",
        "outputs: tip, reach",
    ]
    assert f"{damped.energy_drift():.1e}" in titles[2]
    assert [axis.get_ylabel() for axis in figure.axes] == ["[rad]", "[rad/s]", "[J]", "[N m]", "[m]"]
    labels = figure.axes[2].get_legend_handles_labels()[1]
    assert labels == ["kinetic T", "potential V", "T + V", "work W"]
    assert (tmp_path / "run.png").read_bytes().startswith(b"\x89PNG")
    import matplotlib.pyplot as plt

    assert plt.get_fignums() == []  # nothing is left open


def test_a_chain_of_many_joints_keeps_a_short_legend(tmp_path):
    links = "".join(
        f'<link name="l{k}"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>'
        '<inertia ixx=".01" ixy="0" ixz="0" iyy=".01" iyz="0" izz=".01"/></inertial></link>'
        for k in range(12)
    )
    joints = "".join(
        f'<joint name="j{k}" type="continuous"><parent link="{"base" if k == 0 else f"l{k - 1}"}"/>'
        f'<child link="l{k}"/><origin xyz="0.2 0 0"/><axis xyz="0 1 0"/></joint>'
        for k in range(12)
    )
    (tmp_path / "chain.urdf").write_text(f'<robot name="chain"><link name="base"/>{links}{joints}</robot>')
    run = bc.simulate(tmp_path / "chain.urdf", duration=0.2, samples=21, rtol=1e-6, atol=1e-6)
    labels = run.plot().axes[0].get_legend_handles_labels()[1]
    assert len(labels) == 9 and labels[-1].startswith("4 more")


@pytest.mark.tier2
def test_the_path_of_a_frame_is_drawn_in_its_plane(arm, tmp_path):
    figure = plot_run(arm, tmp_path / "path.png", frame="tip")
    assert (figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()) == ("x [m]", "y [m]")
    assert figure.axes[0].get_aspect() == 1.0
    with pytest.raises(InputError, match="tip"):
        plot_run(arm, frame="top")


def test_the_summary_says_why_it_ended_what_it_cost_and_certifies_itself(damped):
    text = damped.table()
    for piece in (
        "Swinging arm: finished at 3 s", "auto, rtol 1e-10", f"{damped.statistics.evaluations} evaluations",
        f"energy drift       {damped.energy_drift():.1e}", f"{damped.equation_residual():.1e}",
        f"{damped.position[-1, 0]:.6g} rad", f"work {damped.work[-1]:.6g} J",
    ):  # fmt: skip
        assert piece in text, text
    assert max(map(len, text.splitlines())) < 120


@pytest.mark.tier2
def test_a_good_run_has_no_warnings_and_bundled_scenes_are_good(damped):
    assert run_warnings(damped) == () and "warning" not in damped.table()
    for name in ("planar_2r_swing", "spring_pendulum", "ur5_held"):
        assert run_warnings(bc.simulate(name)) == (), name


def test_drift_of_energy_and_an_early_end_are_warned_of(arm, tmp_path):
    rough = bc.simulate(scene(tmp_path, ARM), solver="RK4", step=0.2)
    (warning,) = run_warnings(rough)
    assert "the energy balance is violated" in warning and f"  warning            {warning}" in rough.table()
    short = bc.simulate(scene(tmp_path, ARM), max_evaluations=300)
    (warning,) = run_warnings(short)
    assert "ended before its duration of 3 s" in warning and warning in short._repr_html_()


def test_a_robot_at_rest_is_not_warned_of_the_rounding_of_its_energies():
    hold = {"control": [{"kind": "gravity_compensation"}], "initial": {"shoulder": 0.3, "elbow": 0.4}}
    run = bc.simulate("planar_2r_swing", overrides=hold, duration=1.0)
    assert np.abs(run.velocity).max() < 1e-9 and run_warnings(run) == ()


def test_negative_kinetic_energy_is_warned_of(damped):
    import dataclasses

    wrong = dataclasses.replace(damped)
    accelerations, energies, *rest = damped._observed
    wrong.__dict__["_observed"] = (accelerations, energies * [-1.0, 1.0], *rest)
    assert any("kinetic energy is negative" in text for text in run_warnings(wrong))


def test_a_run_that_blows_up_can_be_looked_at_kept_and_loaded(tmp_path):
    run = bc.simulate(
        scene(tmp_path, OSCILLATOR), solver="RK4", step=1.0, overrides={"forces.1.stiffness": 1e9}, duration=60
    )
    assert run.status == "non_finite" and not run.success
    assert "try a smaller one" in run.table() and "non_finite" in run._repr_html_()
    run.plot(tmp_path / "run.png")
    run.to_csv(tmp_path / "run.csv")
    assert np.array_equal(bc.load_run(run.save(tmp_path / "run")).state, run.state, equal_nan=True)


def test_the_html_summary_escapes_names(tmp_path):
    run = bc.simulate(scene(tmp_path, ARM.replace("Swinging arm", "'<script>alert(1)</script> & co'")))
    html = run._repr_html_()
    assert "<script>" not in html and "&lt;script&gt;" in html and "&amp; co" in html
    assert html.count("<tr>") == html.count("</tr>") and f"{run.energy_drift():.1e}" in html
