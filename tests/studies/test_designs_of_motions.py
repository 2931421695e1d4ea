"""Designs of motions: times of waypoints, placements of paths, and fastest motions, against closed forms and SciPy."""

import numpy as np
import pytest
import yaml
from scipy.optimize import minimize_scalar

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.errors import InputError
from bellcrank.studies.designs.axes import read_axis
from bellcrank.studies.designs.sizing_changes import unit_of
from bellcrank.studies.execution.sizing_runner import SizingRunner
from bellcrank.studies.results.sizing_measures import measures_of

MASS, FORCE = 3.0, 20.0  # kg, N
SLIDER = f"""<robot name="slider"><link name="rail"/><link name="cart"><inertial><mass value="{MASS}"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="slide" type="prismatic">
<parent link="rail"/><child link="cart"/><axis xyz="1 0 0"/><limit lower="-9" upper="9" effort="{FORCE}" velocity="99"/>
</joint></robot>"""
LINE = {"kind": "line", "frame": "tip", "begin": [1.2, -0.3, 0.0], "end": [1.2, 0.5, 0.0], "duration": 1.0}
LINE |= {"coordinates": ["x", "y"], "start": {"shoulder": -0.6, "elbow": 1.0}}


@pytest.fixture
def slider(tmp_path):
    (tmp_path / "slider.urdf").write_text(SLIDER)
    postures = [{"slide": 0.0}, {"slide": 1.0}, {"slide": 2.0}]
    motions = {
        "go": {"kind": "waypoints", "times": [0.0, 0.8, 2.0], "positions": postures},
        "back": {
            "kind": "point_to_point",
            "positions": [{"slide": 0.5}, {"slide": 0.0}],
            "acceleration": 5.0,
            "profile": "trapezoid",
        },
    }
    path = tmp_path / "slider.yaml"
    path.write_text(yaml.safe_dump({"urdf": "slider.urdf", "motions": motions}))
    return path


def placed_arm(**placement):
    motions = {"seam": LINE | ({"placement": placement} if placement else {})}
    return bc.load_scene("planar_2r", {"motions": motions})


def test_the_fastest_time_of_a_mass_is_that_of_full_force_forth_and_back(slider):
    masses = [1.0, 6.0]
    found = bc.sweep(slider, {"link.cart.mass": masses}, fastest=True, threads=2)
    for name, distance in (("go", 2.0), ("back", 0.5)):
        expected = 2.0 * np.sqrt(np.array(masses) * distance / FORCE)
        assert found.column(f"{name}.time") == pytest.approx(
            expected, rel=2e-7
        )  # cells are refined until 1e-6 of limits is left
    assert found.column("cycle_time") == pytest.approx(found.column("go.time") + found.column("back.time"), rel=1e-12)
    assert found.timed and not found.sized and list(found.status) == ["finished"] * 2


@pytest.mark.tier2
def test_the_middle_waypoint_of_least_rms_force_is_passed_at_half_the_time(slider):
    best = bc.optimise(
        slider, {"motions.go.times.2": (0.5, 1.6)}, minimise="slide.rms_torque", size=True, samples=8, starts=2,
        overrides={"motions.back": {"kind": "dwell", "duration": 1.0, "position": {"slide": 0.0}}},
    )  # fmt: skip
    assert best.converged and best.values["motions.go.times.2"] == pytest.approx(1.0, abs=1e-6)  # by symmetry
    assert "motions.go.times.2 [s]     0.8" in best.table()


ARM = {"kind": "waypoints", "times": [0.1, 0.8, 1.5, 2.4], "speed_factor": 1.3}
ARM |= {"positions": [{"shoulder": -0.5}, {"shoulder": 0.4, "elbow": 1.0}, {"shoulder": 1.0, "elbow": 0.2}, {}]}
UR5 = {"kind": "waypoints", "times": [0.0, 0.8, 1.5, 2.4], "positions": [[0, -1.5, 1.0, 0, 0.5, 0]] * 4}
OF_ARM = {
    "times.2": (0.3, 1.4),
    "times.4": (1.7, 4.0),
    "positions.3.elbow": (-1.0, 1.5),
    "positions.1.shoulder": (-1, 1),
}
OF_UR5 = {
    "times.2": (0.1, 1.4),
    "positions.2.3": (-1.0, 1.5),
    "positions.3.2": ("-60 deg", "10 deg"),
    "duration": (1, 4),
}


@pytest.mark.parametrize(
    ("robot", "motion", "vary", "count"),
    [
        ("planar_2r", ARM, OF_ARM, 3),
        pytest.param("planar_2r", ARM, OF_ARM, 30, marks=pytest.mark.tier2),
        pytest.param("ur5", UR5, OF_UR5, 12, marks=pytest.mark.tier2),
    ],
)
def test_designs_of_waypoints_run_together_have_the_loads_of_each_sized_alone(robot, motion, vary, count):
    scene = bc.load_scene(robot, {"motions": {"go": motion, "rest": {"kind": "dwell", "duration": 1, "position": {}}}})
    axes = [read_axis(scene, f"motions.go.{path}", list(values), unit_of(scene, f"motions.go.{path}"))
            for path, values in vary.items()]  # fmt: skip
    runner = SizingRunner(scene, axes)
    assert not runner.shared.single_reason
    low, high = np.array([axis.numbers for axis in axes]).T
    values = low + (high - low) * np.random.default_rng(count).random((count, len(axes)))
    found = runner.run(values)
    for row, numbers in enumerate(values):
        for name, value in measures_of(runner.design(numbers.tolist())).items():
            what = name.rpartition(".")[2]
            if name not in found.measures:
                assert what == "holding_torque" or np.isnan(value), name
                continue
            # Integrals at shafts do not follow where power changes its direction within a part (test_sizing_sweep.py).
            kink = 1e-6 if what in ("motor_rms_torque", "continuous_torque_margin", "drive_margin") else 1e-9
            assert found.measures[name][row] == pytest.approx(value, rel=kink, abs=kink, nan_ok=True), (row, name)


def test_a_peak_force_is_least_where_its_two_maxima_are_equal_and_a_limit_of_speed_is_kept(slider):
    """By symmetry the middle waypoint is passed at half the time, where the forces forth and back are equal: a kink of
    the peak, which the search reaches with the gradients of both."""
    asked = {"size": True, "samples": 8, "starts": 2}
    only = bc.load_scene(slider, {"motions": {"go": yaml.safe_load(slider.read_text())["motions"]["go"]}})
    best = bc.optimise(only, {"motions.go.times.2": (0.5, 1.6)}, minimise="slide.peak_torque", **asked)
    assert best.converged and best.values["motions.go.times.2"] == pytest.approx(1.0, abs=1e-6)
    assert set(best.gradients.values()) == {"differences"}
    # Of all such motions the quintic of 15 d / (8 T) has the least peak speed.
    vary = {"motions.go.times.2": (0.5, 1.6), "motions.go.duration": (1.0, 4.0)}
    held = bc.optimise(only, vary, minimise="go.duration", limits=["slide.peak_speed <= 1.5 m/s"], **asked)
    assert held.converged and held.objective == pytest.approx(15.0 * 2.0 / (8.0 * 1.5), rel=1e-6)


def test_designs_whose_motion_a_batch_does_not_cover_are_sized_one_by_one(slider):
    paths, bounds = ["motions.go.times.2", "motions.go.positions.2.slide", "motions.go.positions.2.turn"], (0.5, 1.0)
    assert [unit_of(bc.load_scene(slider), path) for path in paths] == ["s", "m", None]
    degrees = ARM | {"positions": [{"elbow": "30 deg"}, {"elbow": "60 deg"}, {}, {}]}
    turned = bc.optimise(
        bc.load_scene("planar_2r", {"motions": {"go": degrees}}), {"motions.go.positions.2.elbow": (0.4, "90 deg")},
        minimise="elbow.peak_speed", size=True, samples=2, starts=1,
    )  # fmt: skip
    assert np.isfinite(turned.before[0]) and "motions.go.positions.2.elbow [rad]" in turned.table()
    disordered = bc.sweep(slider, {"motions.go.times.2": [1.0, 2.5]}, size=True)
    assert list(disordered.status) == ["pass", "infeasible"] and "increasing times" in disordered.reasons[1]
    rubbed = bc.load_scene(slider, {"forces": [{"kind": "friction", "joint": "slide", "coulomb": 1.0, "width": 0.01}]})
    for scene, path in ((rubbed, "motions.go.times.2"), (bc.load_scene(slider), "motions.back.acceleration")):
        runner = SizingRunner(scene, [read_axis(scene, path, list(bounds), unit_of(scene, path))])
        assert runner.shared.single_reason and any("one by one" in note for note in runner.notes)


def test_a_placed_path_is_the_path_written_there_and_turns_with_its_orientation():
    moved = bc.size(placed_arm(x=0.1, y="-5 cm"))
    written = bc.size(
        placed_arm(), overrides={"motions.seam.begin": [1.3, -0.35, 0.0], "motions.seam.end": [1.3, 0.45, 0.0]}
    )
    for one, other in zip(moved.joints, written.joints, strict=True):
        assert one.peak_torque == pytest.approx(other.peak_torque, rel=1e-9)
    # A UR5 whose path is turned about its first axis, which is vertical, turns that axis and bears the same loads.
    plain, turned = (
        bc.size("ur5", ["circle"], overrides=changes) for changes in (None, {"motions.circle.placement.yaw": "25 deg"})
    )
    for one, other in zip(plain.joints, turned.joints, strict=True):
        assert one.peak_torque == pytest.approx(other.peak_torque, abs=1e-8)
        assert one.rms_torque == pytest.approx(other.rms_torque, abs=1e-9)


@pytest.mark.tier2
def test_the_placement_of_a_path_for_the_least_time_is_that_of_scipy():
    def time(x, y):
        arm = placed_arm(x=x, y=y)
        return bc.time_optimal(arm, "seam", costs=False).duration

    asked = {"minimise": "seam.time", "fastest": True, "samples": 16, "starts": 2}
    best = bc.optimise(placed_arm(), {"motions.seam.placement.y": (-0.4, 0.4)}, **asked)
    assert best.converged and not best.at_bounds and np.isfinite(best.before[0])  # where it is written
    reference = minimize_scalar(lambda y: time(0.0, y), bounds=(-0.4, 0.4), method="bounded", options={"xatol": 1e-5})
    assert best.objective == pytest.approx(reference.fun, rel=2e-5)  # a motion is slowed by up to 1e-5
    assert best.values["motions.seam.placement.y"] == pytest.approx(reference.x, abs=5e-3)


@pytest.mark.parametrize(
    ("variables", "asked", "words"),
    [
        ({"motions.seam.duration": (0.5, 1.0)}, {"fastest": True}, "a fastest motion has a duration of its own"),
        ({"motions.seam.placement.x": (0, 0.1)}, {"fastest": True, "size": True}, "sized or timed"),
        ({"motions.seam.placement.x": ("0 s", 0.1)}, {"fastest": True}, "seam.placement.x"),
        ({"motions.seam.placement.u": (0, 0.1)}, {"fastest": True}, "unknown key 'u'"),
        ({"motions.seam.speed_factor": (0.5, 1)}, {"fastest": True, "samples": 4}, "changes"),
    ],
)
def test_bad_designs_of_motions_are_one_sentence(variables, asked, words):
    with pytest.raises(InputError, match=words) as caught:
        bc.optimise(placed_arm(), variables, minimise="seam.time", **asked)
    assert "\n" not in str(caught.value)


def test_a_path_that_begins_where_the_frame_is_cannot_be_placed():
    motion = {key: value for key, value in LINE.items() if key != "begin"} | {"placement": {"x": 0.1}}
    with pytest.raises(InputError, match=r"placement.*give 'begin'"):
        bc.load_scene("planar_2r", {"motions": {"seam": motion}})


@pytest.mark.tier2
def test_the_command_sweeps_and_optimises_fastest_motions_of_a_scene_that_says_so(slider, tmp_path, capsys):
    scene = yaml.safe_load(slider.read_text())
    scene["optimise"] = {"vary": {"link.cart.mass": [1, 5]}, "minimise": "back.time", "fastest": True, "samples": 4}
    slider.write_text(yaml.safe_dump(scene))
    assert main(["optimise", str(slider), "--out", str(tmp_path / "best")]) == 0
    said = capsys.readouterr().out
    assert "link.cart.mass [kg]" in said and "at the lower bound" in said and "differences of back.time" in said
    command = ["sweep", str(slider), "--fastest", "--vary", "link.cart.mass=1,2", "--no-plots"]
    assert main([*command, "--out", str(tmp_path / "swept")]) == 0
    assert "cycle_time [s]" in capsys.readouterr().out


def test_the_best_duration_of_waypoints_is_written_as_a_speed_factor(tmp_path) -> None:
    scene = bc.load_scene("balanced_arm", {"motions.lift.speed_factor": 1.5})
    best = bc.optimise(scene, {"motions.lift.duration": (5.0, 9.0)}, minimise="shoulder.peak_torque", size=True,
                       samples=4, starts=1)  # fmt: skip
    again = bc.size(best.scene)
    assert again.joint("shoulder").peak_torque == pytest.approx(best.measures["shoulder.peak_torque"], rel=1e-9)
    duration = best.values["motions.lift.duration"]
    assert best.scene.data["motions"]["lift"]["speed_factor"] == pytest.approx(6.0 / duration, rel=1e-12)


@pytest.mark.tier2
def test_the_duration_of_a_motion_changes_those_that_are_joined_from_it(tmp_path) -> None:
    """`sweep`, `optimise` with its scene, and `size` with the speed factor give one answer."""
    (tmp_path / "joined.yaml").write_text(
        "name: joined\nurdf: planar_2r\nmotions:\n"
        "  a: {kind: waypoints, times: [0, 1, 2], positions: [{}, {shoulder: 40 deg}, {}]}\n"
        "  both: {kind: join, parts: [a, {kind: join, parts: [a]}]}\n"
    )
    scene = bc.load_scene(tmp_path / "joined.yaml")
    swept = bc.sweep(scene, {"motions.a.duration": [1.0, 4.0]}, size=True).column("shoulder.peak_torque")
    sized = [bc.size(scene, overrides={"motions.a.speed_factor": 2.0 / duration}) for duration in (1.0, 4.0)]
    assert swept.tolist() == pytest.approx([one.joint("shoulder").peak_torque for one in sized], rel=1e-9)
    best = bc.optimise(scene, {"motions.a.duration": (1.0, 4.0)}, minimise="shoulder.peak_torque", size=True, samples=2,
                       starts=1)  # fmt: skip
    again = bc.size(best.scene).joint("shoulder").peak_torque
    assert again == pytest.approx(best.measures["shoulder.peak_torque"], rel=1e-9)
