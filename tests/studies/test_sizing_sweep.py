"""Sizings of many designs: against closed forms, and against `bellcrank.size` of each design."""

from __future__ import annotations

import csv
import math
import pickle
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.errors import InputError
from bellcrank.motion.motion_entry import stretched
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.sizing.size import size
from bellcrank.studies.designs.axes import read_axis
from bellcrank.studies.execution.design_runner import StudyInterrupted
from bellcrank.studies.execution.many_sizings import SizingBatch
from bellcrank.studies.execution.sizing_runner import BLOCK, SizingRunner
from bellcrank.studies.results.sizing_measures import measures_of
from bellcrank.studies.results.study_columns import StudyColumns

pytestmark = pytest.mark.tier2

Array = NDArray[np.float64]
G = 9.81
EQUAL = 1e-9  # peaks, of the value
RMS = (
    5e-9  # of the shared grid, whose parts are cut where a design's torque changes its sign; parabolas replace it there
)
DUST = 1e-9  # of a joint's peak torque times its speed: smaller powers are rounding of joints that hardly move


def runner(scene: Scene | str, **vary: Any) -> SizingRunner:
    """A runner over paths, whose dots are written as two underscores."""
    scene = load_scene(scene) if isinstance(scene, str) else scene
    return over(scene, {path.replace("__", "."): values for path, values in vary.items()})


def over(scene: Scene, vary: Mapping[str, Any]) -> SizingRunner:
    return SizingRunner(scene, [read_axis(scene, path, values) for path, values in vary.items()])


def drawn(ranges: Sequence[tuple[float, float]], count: int, seed: int = 0) -> Array:
    low, high = np.array(ranges).T
    return np.asarray(low + (high - low) * np.random.default_rng(seed).random((count, len(ranges))))


def compare(found: StudyColumns, row: int, expected: Mapping[str, float]) -> None:
    """Each measure of a row against that of one sizing."""
    for name, value in expected.items():
        if name not in found.measures:
            assert name.endswith("holding_torque") or math.isnan(value), name
            continue
        here, what = float(found.measures[name][row]), name.rpartition(".")[2]
        joint = name.rpartition(".")[0]
        if what == "peak_power":
            dust = DUST * expected[f"{joint}.peak_torque"] * max(expected[f"{joint}.peak_speed"], 1.0)
            assert here == pytest.approx(value, rel=EQUAL, abs=dust), name
        elif "rms" in what or what in ("rated_torque_margin", "margin"):
            assert here == pytest.approx(value, rel=RMS, abs=RMS, nan_ok=True), name
        else:
            assert here == pytest.approx(
                value, rel=EQUAL, abs=EQUAL if what.endswith("margin") else 1e-12, nan_ok=True
            ), name


# ---- closed forms


def test_a_pendulum_that_is_held_level_needs_its_weight_times_its_length() -> None:
    """The motion of geared_pendulum holds the rod of length l level: the peak torque is m g l, also as the holding
    torque, and m g l / (N η) at the shaft of a gear with ratio N and efficiency η (the configuration's comment). While
    it swings the torque is less: m l² q̈ is largest where the weight's lever is not."""
    vary = {"link.pendulum.mass": [2.0], "link.pendulum.cg.z": [-0.5], "actuators.shoulder.ratio": [50.0]}
    study = over(load_scene("geared_pendulum"), vary)
    assert not study.shared.single_reason and study.notes == ()
    values = drawn([(1.0, 4.0), (-0.6, -0.3), (20.0, 90.0)], 40)
    found = study.run(values)
    weight = values[:, 0] * G * -values[:, 1]
    assert found.measures["shoulder.peak_torque"] == pytest.approx(weight, rel=1e-12)
    assert found.measures["shoulder.holding_torque"] == pytest.approx(weight, rel=1e-12)
    still = weight / (0.8 * values[:, 2])
    assert (found.measures["shoulder.motor_torque"] >= still * (1.0 - 1e-12)).all()
    assert found.measures["shoulder.effort_margin"] == pytest.approx(1.0 - weight / 40.0, rel=1e-12)
    limit = found.measures["shoulder.peak_torque_margin"]
    assert limit == pytest.approx(1.0 - 1.25 * found.measures["shoulder.motor_torque"] / 0.95, rel=1e-12)
    smallest = np.min([found.measures[name] for name in study.judged.margins("shoulder")], axis=0)
    assert (found.measures["margin"] == smallest).all() and (found.measures["shoulder.margin"] == smallest).all()
    failed = np.array([found.statuses[k] == "fail" for k in found.status])
    assert (failed == (smallest < 0.0)).all() and 0 < failed.sum() < 40
    assert set(found.reasons) == set(np.flatnonzero(failed))
    assert all("exceeds the actuator's" in text and "%" in text for text in found.reasons.values())


def two_point_masses(q: Array, v: Array, a: Array, lengths: tuple[float, float], masses: tuple[float, float]) -> Array:
    """Torques (n, 2) of a planar arm with point masses at the ends of its links, gravity along −y, the second angle
    relative to the first link (Craig, Introduction to Robotics, 3rd ed., 6.7)."""
    (l1, l2), (m1, m2) = lengths, masses
    c1, c2, s2, c12 = np.cos(q[:, 0]), np.cos(q[:, 1]), np.sin(q[:, 1]), np.cos(q[:, 0] + q[:, 1])
    far = m2 * l2**2 * (a[:, 0] + a[:, 1]) + m2 * l1 * l2 * c2 * a[:, 0] + m2 * l2 * G * c12
    second = far + m2 * l1 * l2 * s2 * v[:, 0] ** 2
    first = (
        m2 * l2**2 * (a[:, 0] + a[:, 1]) + m2 * l1 * l2 * c2 * (2.0 * a[:, 0] + a[:, 1]) + (m1 + m2) * l1**2 * a[:, 0]
        - m2 * l1 * l2 * s2 * v[:, 1] ** 2 - 2.0 * m2 * l1 * l2 * s2 * v[:, 0] * v[:, 1]
        + m2 * l2 * G * c12 + (m1 + m2) * l1 * G * c1
    )  # fmt: skip
    return np.stack([first, second], axis=1)


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """A planar arm with a point mass at the end of each link."""
    folder = tmp_path_factory.mktemp("arm")
    link = (
        '<inertial><origin xyz="{0} 0 0"/><mass value="{1}"/>'
        '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
    )
    joint = (
        '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin xyz="{3} 0 0"/>'
        '<axis xyz="0 0 1"/><limit lower="-3.2" upper="3.2" effort="1000" velocity="20"/></joint>'
    )
    (folder / "arm.urdf").write_text(
        '<robot name="arm"><link name="base"/>'
        f'<link name="upper">{link.format(0.8, 3.0)}</link><link name="fore">{link.format(0.6, 2.0)}</link>'
        f"{joint.format('shoulder', 'base', 'upper', 0)}{joint.format('elbow', 'upper', 'fore', 0.8)}</robot>"
    )
    (folder / "arm.yaml").write_text(
        "urdf: arm.urdf\ngravity: [0, -9.81, 0]\nmotions:\n"
        "  rest: {kind: dwell, duration: 1, position: {shoulder: 20 deg, elbow: -50 deg}}\n"
        "  swing: {kind: waypoints, times: [0, 0.5, 1.2], positions: [{shoulder: -60 deg, elbow: 10 deg},"
        " {shoulder: 40 deg, elbow: 80 deg}, {shoulder: 10 deg, elbow: -30 deg}]}\n"
    )
    return load_scene(folder / "arm.yaml")


ARM = {
    "joint.elbow.origin.x": [0.8], "link.upper.cg.x": [0.8], "link.fore.cg.x": [0.6], "link.upper.mass": [3.0],
    "link.fore.mass": [2.0], "motions.swing.duration": [1.2],
}  # fmt: skip


def test_a_planar_arm_with_point_masses_at_rest_and_in_motion(arm: Scene) -> None:
    values = drawn([(0.5, 1.0), (0.5, 1.0), (0.3, 0.8), (1.0, 5.0), (1.0, 5.0), (0.8, 2.0)], 8)
    values[:, 1] = values[:, 0]  # the first mass is at the elbow
    for motion in ("rest", "swing"):
        axes = [read_axis(arm, path, given) for path, given in ARM.items()]
        study = SizingRunner(arm, axes, [motion])
        found = study.run(values)
        assert not study.shared.single_reason
        for row, (l1, _, l2, m1, m2, duration) in enumerate(values.tolist()):
            moved = arm.motion(motion)
            moved = stretched(moved, duration / moved.duration) if motion == "swing" else moved
            at = moved.at(np.linspace(moved.time[0], moved.time[-1], 400_001))
            torque = two_point_masses(*at, (l1, l2), (m1, m2))
            for k, joint in enumerate(("shoulder", "elbow")):
                peak = np.abs(torque[:, k]).max()  # of points 3 µs apart: the peak between them is higher by its square
                assert found.measures[f"{joint}.peak_torque"][row] == pytest.approx(peak, rel=1e-8)
                assert found.measures[f"{joint}.peak_torque"][row] >= peak * (1.0 - 1e-10)
                rms = math.sqrt(np.mean(0.5 * (torque[1:, k] ** 2 + torque[:-1, k] ** 2)))
                assert found.measures[f"{joint}.rms_torque"][row] == pytest.approx(rms, rel=1e-7)
                power = np.abs(torque[:, k] * at[1][:, k]).max()
                assert found.measures[f"{joint}.peak_power"][row] == pytest.approx(power, rel=1e-7)
                speed = np.abs(at[1][:, k]).max()
                assert found.measures[f"{joint}.peak_speed"][row] == pytest.approx(speed, rel=1e-7)
            stretched_out = (m1 + m2) * G * l1 + m2 * G * l2
            assert found.measures["shoulder.holding_torque"][row] == pytest.approx(stretched_out, rel=1e-12)
            assert found.measures["elbow.holding_torque"][row] == pytest.approx(m2 * G * l2, rel=1e-12)


# ---- against `bellcrank.size` of each design

CASES: dict[str, dict[str, tuple[float, float]]] = {
    "ur5": {
        "joint.elbow_joint.origin.z": (0.38, 0.47),
        "joint.wrist_1_joint.origin.z": (0.35, 0.43),
        "payload.mass": (1.0, 6.0),
        "actuators.elbow_joint.ratio": (80.0, 130.0),
    },
    "planar_2r": {
        "link.link_2.inertia.zz": (0.5, 2.0),
        "actuators.shoulder.efficiency": (0.5, 1.0),
        "actuators.elbow.rotor_inertia": (1e-5, 1e-4),
        "actuators.elbow.max_speed": (400.0, 600.0),
        "motions.elbow_up.duration": (3.0, 12.0),
    },
    "xarm7": {"link.link3.mass": (1.0, 3.0), "link.link5.cg.z": (-0.2, 0.0), "link.link4.scale": (0.5, 2.0)},
    "five_bar": {"link.left_forearm.mass": (0.02, 0.3), "motions.pick.duration": (0.4, 1.0)},
}


@pytest.mark.parametrize("name", CASES)
def test_each_design_is_as_size_gives_it(name: str) -> None:
    scene, ranges = load_scene(name), list(CASES[name].values())
    study = over(scene, {path: [low] for path, (low, _) in CASES[name].items()})
    assert not study.shared.single_reason
    values = drawn(ranges, 6, seed=4)
    found = study.run(values)
    for row in range(3):
        compare(found, row, measures_of(study.design(values[row].tolist())))


def test_parameters_and_overrides_of_a_design_give_the_same_sizing() -> None:
    """A parameter of a batch is the number in the file: `size` with overrides of the file agrees."""
    scene = load_scene("ur5")
    paths = {
        "payload.mass": 5.0,
        "payload.cg.z": 0.12,
        "payload.inertia.xx": 0.01,
        "actuators.wrist_1_joint.ratio": 81.0,
    }
    study = over(scene, {path: [value] for path, value in paths.items()} | {"motions.circle.duration": [2.5]})
    assert not study.shared.single_reason
    found = study.run(np.array([[*paths.values(), 2.5]]))
    changed = {
        "payloads.1.mass": 5.0, "payloads.1.cg": [0.0, 0.0, 0.12], "payloads.1.inertia": [0.01, 0, 0.006, 0, 0, 0.004],
        "actuators.wrist_1_joint.ratio": 81.0, "motions.circle.duration": 2.5,
    }  # fmt: skip
    compare(found, 0, measures_of(size("ur5", overrides=changed)))


OPEN = {  # a four-bar that does not come near the posture in which it is folded, where torques are ill-conditioned
    "motions.unfold": {"kind": "waypoints", "times": [0, 4], "positions": [{"crank": "40 deg"}, {"crank": "120 deg"}]},
    "initial.crank": "40 deg", "initial.coupler": {"guess": "300 deg"}, "initial.rocker": {"guess": "60 deg"},
}  # fmt: skip


def test_the_lengths_of_a_linkage_change_how_its_joints_move() -> None:
    scene = load_scene("four_bar", OPEN)
    study = over(scene, {"crank_length": [1.2], "rocker_length": [1.2], "link.coupler_link.mass": [1.0]})
    assert not study.shared.single_reason and study.shared.changed_linkage is not None
    values = drawn([(1.15, 1.3), (1.15, 1.3), (0.5, 2.0)], 5, seed=1)
    values[4, 0] = 9.0  # the loop cannot be closed
    found = study.run(values)
    for row in range(3):
        compare(found, row, measures_of(study.design(values[row].tolist())))
    assert found.statuses[found.status[4]] == "infeasible" and "cannot be" in found.reasons[4]
    assert np.isnan(found.measures["crank.peak_torque"][4])


# ---- rows


def columns_equal(a: StudyColumns, b: StudyColumns) -> bool:
    same = all(np.array_equal(a.measures[name], b.measures[name], equal_nan=True) for name in a.measures)
    return same and np.array_equal(a.status, b.status) and a.reasons == b.reasons


@pytest.mark.parametrize("name", ["planar_2r", "four_bar"])
def test_a_row_depends_on_its_own_values_alone(name: str) -> None:
    scene = load_scene(name, OPEN if name == "four_bar" else None)
    if name == "four_bar":
        study = over(scene, {"crank_length": [1.2], "link.coupler_link.mass": [1.0]})
        values = drawn([(1.15, 1.3), (0.5, 2.0)], 70)
    else:
        study = over(scene, {"joint.elbow.origin.x": [1.0], "actuators.elbow.ratio": [100.0]})
        values = drawn([(0.8, 1.2), (50.0, 150.0)], 70)
    values[3, 0] = math.nan
    whole = study.run(values)
    assert columns_equal(study.run(values, threads=3), whole)
    order = np.random.default_rng(1).permutation(70)
    assert columns_equal(study.run(values[order]), whole.take(order))
    for few in ([5], [3, 4], list(range(10, 21))):
        assert columns_equal(study.run(values[few]), whole.take(np.array(few)))
    again = pickle.loads(pickle.dumps(study))
    assert columns_equal(again.run(values[:8]), whole.take(np.arange(8))) and again.identity == study.identity
    assert whole.statuses[whole.status[3]] == "infeasible" and len(study.run(values[:0])) == 0


def test_what_cannot_be_is_a_row_with_its_reason() -> None:
    study = runner(
        "planar_2r", link__link_2__mass=[1.0], actuators__elbow__efficiency=[0.8], motions__elbow_up__duration=[8]
    )
    good = [12.0, 0.8, 10.0]
    bad = [[-1.0, 0.8, 10.0], [12.0, 1.2, 10.0], [12.0, 0.8, -3.0], [1e-300, 0.8, 10.0], [math.inf, 0.8, 1.0]]
    found = study.run(np.array([good, *bad]))
    assert [found.statuses[k] for k in found.status] == ["pass"] + ["infeasible"] * 5
    for row, part in enumerate(("0 kg or more", "at most 1", "more than 0 s", "2.3e-16 kg or more", "finite"), 1):
        assert part in found.reasons[row], found.reasons[row]
        assert str(study.scene.source.parent) not in found.reasons[row]
    assert all(np.isnan(column[1:]).all() for name, column in found.measures.items())


def test_a_mass_of_0_is_sized_as_such() -> None:
    """A pendulum without mass is no load: its motor cannot be sized, which is unknown, not passed."""
    found = runner("geared_pendulum", link__pendulum__mass=[1.0]).run(np.array([[0.0], [2.0]]))
    assert [found.statuses[k] for k in found.status] == ["unknown", "pass"]
    assert "moves no mass" in found.reasons[0] and found.measures["shoulder.peak_torque"][0] == 0.0


def test_figures_that_are_not_stated_leave_the_verdict_open(tmp_path: Path) -> None:
    motor = "{id: m, maker: M, model: X, rotor_inertia: 2.0e-4, nominal_torque: 0.3, max_speed: 600}"
    gear = "{id: g, maker: M, model: Y, kind: planetary, ratio: 50, inertia: 1.0e-6, inertia_side: input}"
    scene = load_scene("geared_pendulum", {"actuators.shoulder": {"motor": _mapping(motor), "gear": _mapping(gear)}})
    study = runner(scene, link__pendulum__mass=[1.0])
    found = study.run(np.array([[1.0], [2.0], [9.0]]))
    assert [found.statuses[k] for k in found.status] == ["unknown", "unknown", "fail"]
    assert "not stated" in found.reasons[0] and "effort limit" in found.reasons[2]
    for row, mass in enumerate((1.0, 2.0, 9.0)):
        compare(found, row, measures_of(study.design([mass])))


def _mapping(text: str) -> Any:
    import yaml

    return yaml.safe_load(text)


# ---- paths


def test_units_and_names_of_paths() -> None:
    scene = load_scene("planar_2r")
    study = over(
        scene, {"joint.elbow.origin.x": ["900 mm", "1.1 m"], "actuators.elbow.max_speed": ["4000 rpm", "5000 rpm"]}
    )
    assert study.units["elbow.peak_torque"] == "N m" and study.units["elbow.motor_speed"] == "rad/s"
    mixed = study.axes[0]
    assert not mixed.numeric and "sized one by one" in study.notes[-1]
    plain = over(scene, {"joint.elbow.origin.x": ["900 mm", "950 mm"], "actuators.elbow.max_speed": ["4000 rpm"]})
    assert not plain.shared.single_reason
    si = over(scene, {"joint.elbow.origin.x": [0.9], "actuators.elbow.max_speed": [4000.0 * math.pi / 30.0]})
    ours, theirs = plain.run(np.array([[900.0, 4000.0]])), si.run(np.array([[0.9, 4000.0 * math.pi / 30.0]]))
    for name in ours.measures:
        assert ours.measures[name] == pytest.approx(theirs.measures[name], rel=1e-12, nan_ok=True)


@pytest.mark.parametrize(
    ("name", "path", "message"),
    [
        ("planar_2r", "link.link_9.mass", "unknown link 'link_9'"),
        ("planar_2r", "joint.elbow.origin.w", "cannot set 'joint.elbow.origin.w'"),
        ("planar_2r", "payload.mass", "there is no payload; write payloads"),
        ("ur5", "payloads.2.mass", "there are 1 payloads"),
        ("ur5", "payload.cg.w", "unknown number of a payload 'cg.w'"),
        ("ur5", "motions.circel.duration", "did you mean 'circle'"),
    ],
)
def test_paths_that_do_not_exist(name: str, path: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        over(load_scene(name), {path: [1.0]})


def test_one_quantity_is_varied_once() -> None:
    with pytest.raises(InputError, match="already set by the parameter"):
        over(load_scene("four_bar"), {"crank_length": [1.2], "joint.coupler.origin.x": [1.2]})


def test_any_other_override_is_sized_by_itself() -> None:
    study = over(
        load_scene("geared_pendulum"), {"gravity": [[0, 0, -1.62], [0, 0, -9.81]], "link.pendulum.mass": [1.0, 2.0]}
    )
    assert "'gravity' is no parameter" in study.notes[-1]
    found = study.run(np.array([[0.0, 1.0], [1.0, 2.0]]))
    assert found.measures["shoulder.holding_torque"] == pytest.approx([1.62 * 0.5, 9.81], rel=1e-9)
    assert study.units["shoulder.holding_torque"] == "N m"


def test_a_frame_follows_another_path_where_lengths_differ() -> None:
    study = runner("planar_2r", joint__elbow__origin__x=[1.0])
    notes = [note for note in study.notes if "another path" in note]
    assert len(notes) == 2 and "'elbow_up'" in notes[0] and "joint.elbow.origin.x" in notes[0]


# ---- a study


def test_ctrl_c_hands_over_what_is_done() -> None:
    study = runner("geared_pendulum", link__pendulum__mass=[1.0])
    values = np.linspace(1.0, 3.0, 200)[:, None]
    whole, seen = study.run(values), []

    def progress(done: int) -> None:
        seen.append(done)
        if done >= 100:
            raise KeyboardInterrupt

    with pytest.raises(StudyInterrupted) as caught:
        study.run(values, progress=progress)
    assert seen == [64, 128] and columns_equal(caught.value.columns, whole.take(caught.value.rows))
    assert caught.value.rows.tolist() == list(range(128))


def test_designs_are_sized_together_and_none_of_them_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """What makes many designs cheap: blocks of them share each call (`bellcrank bench --ensembles` tells the times)."""
    study = runner("planar_2r", joint__elbow__origin__x=[1.0], actuators__elbow__ratio=[100.0])
    blocks: list[int] = []
    measures = SizingBatch.measures
    monkeypatch.setattr(SizingBatch, "measures", lambda batch: blocks.append(1) or measures(batch))
    monkeypatch.setattr(study, "design", lambda numbers: pytest.fail("a design was sized alone"))
    found = study.run(drawn([(0.8, 1.2), (50.0, 150.0)], 3 * BLOCK))
    assert len(blocks) == 3 and np.isfinite(found.measures["elbow.peak_torque"]).all()


def test_the_command_sizes_the_designs_of_a_sweep(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vary = ["--vary", "link.pendulum.mass=1:4:4", "--vary", "actuators.shoulder.ratio=30,80"]
    assert main(["sweep", "geared_pendulum", "--size", *vary, "--out", str(tmp_path), "--no-plots"]) == 0
    text = capsys.readouterr().out
    assert "8 designs, 6 pass, 2 do not" in text and "link.pendulum.mass [kg]" in text
    with (tmp_path / "sweep.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["status"] for row in rows].count("fail") == 2
    for row in rows:
        weight = float(row["link.pendulum.mass [kg]"]) * G * 0.5
        assert float(row["shoulder.peak_torque [N m]"]) == pytest.approx(weight, rel=1e-12)


def test_a_sweep_of_sizings_in_python(capsys: pytest.CaptureFixture[str]) -> None:
    result = bc.sweep("planar_2r", {"joint.elbow.origin.x": "normal(1 m, 10 mm)"}, sample=16, size=True)
    assert len(result) == 16 and result.axes[0].unit == "m" and "another path" in result.notes[-1]
    assert set(result.status) <= {"pass", "fail"} and (result.column("shoulder.peak_torque") > 200.0).all()
    with pytest.raises(InputError, match="there is no payload"):
        bc.sweep("planar_2r", {"payload.mass": [1.0]}, size=True)
    with pytest.raises(InputError, match="unknown key or parameter 'actuatorz'"):
        bc.sweep("planar_2r", {"actuatorz.elbow.ratio": [1.0]}, size=True)
    assert main(["sweep", "planar_2r", "--vary", "link.link_3.mass=1,2", "--no-plots"]) == 2
    assert "unknown link 'link_3'; did you mean 'link_2'" in capsys.readouterr().err
