"""Motions of drives that end moving or jump in speed: the run ends there, says so, and its energies are in balance."""

from __future__ import annotations

import numpy as np
import pytest

import bellcrank
from bellcrank.cli import main
from bellcrank.errors import InputError
from bellcrank.motion.motion import Motion, join
from bellcrank.motion.sampled.csv_file import write_motion
from bellcrank.simulation.integration.statistics import Status
from bellcrank.simulation.trajectory.scene_notes import scene_notes

SCENE = """
name: driven
urdf: planar_2r
gravity: [0, -9.81, 0]
initial: {elbow: 0.4}
motions:
  spin: {kind: csv, file: spin.csv}
constraints:
  - {kind: prescribed_motion, name: motor, joint: shoulder, motion: spin}
simulate: {duration: 3.0, samples: 31}
"""


@pytest.fixture(scope="module")
def arm():
    return bellcrank.load_robot("planar_2r", gravity=(0, -9.81, 0))


def accelerated(arm, start, end, rate, first=0.0, begin=0.0):
    """The shoulder from `first` rad at `begin` rad/s, at a constant acceleration, from start to end s."""
    t = np.linspace(start, end, 21)
    u = (t - start)[:, None] * [1.0, 0.0]
    unit = np.array([1.0, 0.0])
    return Motion(
        arm.joints, t, first * unit + begin * u + 0.5 * rate * u**2, begin * unit + rate * u,
        np.tile(rate * unit, (21, 1)), "spin",
    )  # fmt: skip


def scene_file(folder, motion, text=SCENE):
    write_motion(motion, folder / "spin.csv")
    (folder / "driven.yaml").write_text(text, encoding="utf-8")
    return folder / "driven.yaml"


def test_a_run_ends_where_the_motion_of_a_drive_ends_moving(arm, tmp_path):
    run = bellcrank.simulate(scene_file(tmp_path, accelerated(arm, 0.0, 2.0, 0.65)))
    assert run.status is Status.PRESCRIBED_MOTION_ENDED and not run.success
    assert run.time[-1] == 2.0 and run.velocity[-1, 0] == pytest.approx(1.3, abs=1e-12)
    assert run.message == (
        "driven: prescribed_motion_ended at 2 s: motion 'spin' of constraint 'motor' ends at 2 s while joint "
        "'shoulder' still moves at 1.3 rad/s; end the motion at rest or later, or shorten the run"
    )
    assert run.energy_drift() < 1e-8  # 0.4.0: the speed jumps to 0 at 2 s, and the energy of that is lost
    assert run.velocity_residual() < 1e-9
    early, range_ = run.warnings
    assert early == "the run ended before its duration of 3 s: results are for the time before"
    assert "'elbow' leaves its range" in range_
    assert run.acceleration[-1, 0] == pytest.approx(0.65, abs=1e-9)


def test_a_run_as_long_as_its_motion_is_finished_and_has_the_limits_from_before(arm, tmp_path):
    file = scene_file(tmp_path, accelerated(arm, 0.0, 2.0, 0.65))
    run = bellcrank.simulate(file, duration=2.0)
    assert run.status is Status.FINISHED and run.velocity[-1, 0] == pytest.approx(1.3, abs=1e-12)
    assert run.error_estimate() < 1e-6
    late = bellcrank.simulate(file, times=[2.5, 3.0])
    assert late.status is Status.PRESCRIBED_MOTION_ENDED and late.time.tolist() == [2.0]


def test_a_motion_that_ends_at_rest_is_held(arm, tmp_path):
    up, down = accelerated(arm, 0.0, 1.0, 1.3), accelerated(arm, 1.0, 2.0, -1.3, 0.65, 1.3)
    run = bellcrank.simulate(scene_file(tmp_path, join(up, down)))
    assert run.status is Status.FINISHED and run.time[-1] == 3.0
    assert run.position[-1, 0] == pytest.approx(1.3, abs=1e-9) and abs(run.velocity[-1, 0]) < 1e-9
    assert run.energy_drift() < 1e-8
    assert "prescribed motion 'motor' ends at 2 s; then its last position is held" in scene_notes(run.scene)


@pytest.mark.parametrize(
    "settings", [{}, {"solver": "Radau", "rtol": 1e-7, "atol": 1e-7}, {"solver": "RK4", "step": 1e-3}]
)
@pytest.mark.parametrize("stabilisation", ["projection", {"kind": "baumgarte", "alpha": 20, "beta": 20}])
def test_a_speed_that_jumps_within_a_motion_ends_the_run_before_the_jump(arm, tmp_path, settings, stabilisation):
    first = accelerated(arm, 0.0, 1.0, 1.3)
    moving = join(first, accelerated(arm, 1.0, 2.0, 0.0, 0.65, 0.4))
    run = bellcrank.simulate(scene_file(tmp_path, moving), stabilisation=stabilisation, **settings)
    assert run.status is Status.PRESCRIBED_MOTION_ENDED and run.time[-1] == 1.0
    assert run.velocity[-1, 0] == pytest.approx(1.3, abs=1e-6)
    assert "jumps at 1 s from 1.3 to 0.4 rad/s at joint 'shoulder'" in run.message
    assert run.energy_drift() < 1e-6


def test_a_motion_that_begins_moving_later_than_the_run_ends_it_there(arm, tmp_path):
    run = bellcrank.simulate(scene_file(tmp_path, accelerated(arm, 0.5, 2.0, 0.0, 0.2, 0.7)))
    assert run.status is Status.PRESCRIBED_MOTION_ENDED and run.time[-1] == 0.5
    assert run.position[-1, 0] == pytest.approx(0.2, abs=1e-9) and abs(run.velocity[-1, 0]) < 1e-9
    assert "jumps at 0.5 s from 0 to 0.7 rad/s" in run.message


def test_a_motion_that_moves_at_the_start_is_started_at_its_speed(arm, tmp_path):
    run = bellcrank.simulate(scene_file(tmp_path, accelerated(arm, 0.0, 3.5, 0.0, 0.2, 0.7)))
    assert run.status is Status.FINISHED
    assert run.velocity[:, 0] == pytest.approx(np.full(len(run), 0.7), abs=1e-9)
    assert run.energy_drift() < 1e-8


def test_what_a_file_rounds_off_is_no_jump(arm, tmp_path):
    up, down = accelerated(arm, 0.0, 1.0, 1.3), accelerated(arm, 1.0, 2.0, -1.3, 0.65, 1.3)
    motion = join(up, down)
    rounded = [np.round(x, 6) for x in (motion.position, motion.velocity + 6e-6, motion.acceleration)]
    run = bellcrank.simulate(scene_file(tmp_path, Motion(arm.joints, motion.time, *rounded, "spin")))
    assert run.status is Status.FINISHED


def test_saved_runs_keep_status_and_reason(arm, tmp_path):
    run = bellcrank.simulate(scene_file(tmp_path, accelerated(arm, 0.0, 2.0, 0.65)))
    again = bellcrank.load_run(run.save(tmp_path / "run.npz"))
    assert again.status is Status.PRESCRIBED_MOTION_ENDED and again.message == run.message
    assert np.array_equal(again.velocity, run.velocity)
    assert np.array_equal(again.multipliers, run.multipliers)


def test_a_sweep_gives_the_reason_and_the_command_line_exits_with_1(arm, tmp_path, capsys):
    file = scene_file(tmp_path, accelerated(arm, 0.0, 2.0, 0.65))
    swept = bellcrank.sweep(file, {"initial.elbow": [0.1, 0.4]})
    for design in swept.designs:
        assert design.status == "prescribed_motion_ended" and "still moves at 1.3 rad/s" in design.reason
    out = tmp_path / "out"
    assert main(["simulate", str(file), "--out", str(out), "--no-plots"]) == 1
    assert "ends at 2 s while joint 'shoulder' still moves at 1.3 rad/s" in capsys.readouterr().out
    assert (out / "run.npz").exists() and (out / "run.csv").exists()
    assert main(["simulate", str(file), "--out", str(out), "--no-plots", "--duration", "2"]) == 1
    told = capsys.readouterr().out  # it finished; the elbow leaves its range
    assert "finished at 2 s" in told and "ended at 2 s" not in told


@pytest.mark.parametrize("kind", ["pd", "computed_torque"])
def test_a_controller_holds_the_end_of_a_moving_motion_and_says_so(arm, tmp_path, kind):
    control = f"control:\n  - {{kind: {kind}, name: servo, motion: spin, kp: 100, kd: 20}}"
    text = SCENE.replace(
        "constraints:\n  - {kind: prescribed_motion, name: motor, joint: shoulder, motion: spin}", control
    )
    run = bellcrank.simulate(scene_file(tmp_path, accelerated(arm, 0.0, 2.0, 0.65), text))
    assert run.status is Status.FINISHED
    assert (
        "control 'servo': its motion ends at 2 s while it still moves at up to 1.3 rad/s or m/s, and the run at 3 s; "
        "from then on the last posture is the target, at rest"
    ) in scene_notes(run.scene)


def test_a_run_that_goes_on_from_a_saved_one_meets_the_end_of_the_motion_by_the_same_clock(arm, tmp_path):
    file = scene_file(tmp_path, accelerated(arm, 0.0, 2.0, 0.65))
    bellcrank.simulate(file, duration=0.75).save(tmp_path / "first.npz")
    later = bellcrank.simulate(file, overrides={"initial": {"run": "first.npz", "clock": "continue"}})
    assert later.status is Status.PRESCRIBED_MOTION_ENDED and later.time[-1] == pytest.approx(1.25, abs=1e-12)
    assert later.velocity[-1, 0] == pytest.approx(1.3, abs=1e-9) and later.energy_drift() < 1e-8
    bellcrank.simulate(file).save(tmp_path / "first.npz")
    with pytest.raises(InputError, match="ends when the run starts, while joint 'shoulder' still moves at 1"):
        bellcrank.simulate(file, overrides={"initial": {"run": "first.npz", "clock": "continue"}})
