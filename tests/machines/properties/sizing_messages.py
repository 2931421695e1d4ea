"""What is wrong with a sizing, selection or fastest motion is one sentence; commands and their exit codes."""

import csv
import json

import numpy as np
import pytest
import yaml

import bellcrank as bc
from bellcrank.cli import main

RATINGS = {"ratio": 2.0, "rated_torque": 1.0, "peak_torque": 2.0, "rated_speed": 1.0, "max_speed": 2.0}
# What is done with the file of the arm, and the sentence.
MISTAKES = {
    "unknown motion": (
        lambda f: bc.size(f, "reech"),
        "{file}: unknown motion 'reech'; did you mean 'reach'? (expected: reach, back), nor a file of that name",
    ),
    "no motion": (
        lambda f: bc.size(f, []),
        "sizing of planar_2r: there is no motion; give at least one",
    ),
    "unknown joint of an actuator": (
        lambda f: bc.size(f, actuators={"shouldr": bc.Actuator(**RATINGS)}),
        "{file}: planar_2r: unknown joint 'shouldr'; did you mean 'shoulder'? (expected: shoulder, elbow)",
    ),
    "tolerance": (
        lambda f: bc.size(f, mass_tolerance=1.5),
        "argument 'mass_tolerance': expected a share of at least 0 and below 1, such as 0.1, found 1.5",
    ),
    "negative ratio": (
        lambda f: bc.size(f, overrides={"actuators.shoulder.ratio": -3}),
        "override 'actuators.shoulder.ratio': {file}: actuators.shoulder.ratio: expected more than 0, found -3",
    ),
    "unknown joint of a result": (
        lambda f: bc.size(f, "back").joint("elbw"),
        "sizing of Planar 2R arm: unknown joint 'elbw'; did you mean 'elbow'? (expected: shoulder, elbow)",
    ),
    "no parameters": (
        lambda f: bc.size(f, "back").sensitivities(["length"]),
        "Planar 2R arm: sensitivities are taken by parameters of a scene; this sizing has none; write them under "
        "'parameters' in the robot configuration",
    ),
    "objective": (
        lambda f: bc.select(f, objective="weight"),
        "argument 'objective': unknown choice 'weight' (expected: mass, cost, loss, margin)",
    ),
    "kept axis": (
        lambda f: bc.select(f, keep={"elbw": "m"}),
        "argument 'keep': unknown axis 'elbw'; did you mean 'elbow'? (expected: shoulder, elbow)",
    ),
    "duty": (
        lambda f: bc.select(f, duty=["reech"]),
        "duty: unknown motion 'reech'; did you mean 'reach'? (expected: reach, back)",
    ),
    "pauses alone": (
        lambda f: bc.select(f, duty=[{"pause": 1.0}]),
        "duty: there is no motion, only pauses; a pause holds the posture of the motion before it",
    ),
    "mount": (
        lambda f: bc.select(f, mounts={"elbw": bc.Mount()}),
        "mounts of planar_2r: unknown joint or motor 'elbw'; did you mean 'elbow'? (expected: shoulder, elbow)",
    ),
    "limited joint": (
        lambda f: bc.time_optimal(f, "reach", bc.MotionLimits(speed={"elbw": 1.0})),
        "planar_2r: unknown joint 'elbw'; did you mean 'elbow'? (expected: shoulder, elbow)",
    ),
    "tool without a limit": (
        lambda f: bc.MotionLimits(tool="tip"),
        "limits: argument 'tool': expected a frame together with a limit of it, such as tool_speed, found 'tip'",
    ),
    "grid": (
        lambda f: bc.time_optimal(f, "reach", grid=1),
        "argument 'grid': expected a whole number of at least 2 and at most 1000000, found 1",
    ),
    "nothing limits": (
        lambda f: bc.time_optimal(f, "reach", bc.MotionLimits(speed="none", torque="none", actuators=False)),
        "nothing limits the motion: the URDF gives neither speeds nor torques, and there is no actuator; give limits",
    ),
    "jerk of a factor": (
        lambda f: bc.speed_factor(f, "reach", bc.MotionLimits(jerk={"elbow": 9.0})),
        "limits: the speed factor does not take limits of jerk; leave jerk out",
    ),
    "limit of a cycle": (
        lambda f: bc.repeated_cycle(f, "reach", limit="heat"),
        "argument 'limit': unknown choice 'heat' (expected: rms, temperature)",
    ),
    "efficiency of a gear": (
        lambda f: bc.Gear(id="g", maker="", model="", kind="spur", ratio=5.0, efficiency=1.2),
        "gear 'g': argument 'efficiency': expected a finite number of more than 0 and at most 1, found 1.2",
    ),
    "altitude": (
        lambda f: bc.Conditions(altitude=5000.0),
        "conditions: argument 'altitude': expected a finite number of at least -500 and at most 4000, found 5000.0",
    ),
}


class SizingMessages:
    """Of the planar arm, whose joints and motions the sentences name."""

    @pytest.fixture(scope="class")
    def sized_file(self, sized_scene, tmp_path_factory):
        """The configuration that is sized, as a file."""
        path = tmp_path_factory.mktemp("sized") / "arm.yaml"
        data = json.loads(json.dumps({**sized_scene.data, "urdf": "planar_2r"}))
        path.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
        return path

    @pytest.mark.parametrize("mistake", MISTAKES)
    def test_a_mistake_is_one_sentence_that_says_what_was_expected(self, sized_file, mistake):
        act, sentence = MISTAKES[mistake]
        with pytest.raises(bc.InputError) as caught:
            act(sized_file)
        assert str(caught.value) == sentence.format(file=sized_file)

    def test_a_missing_rating_is_named_with_file_and_key(self, sized_file, tmp_path):
        data = yaml.safe_load(sized_file.read_text(encoding="utf-8"))
        del data["actuators"]["shoulder"]["rated_torque"]
        path = tmp_path / "arm.yaml"
        path.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
        with pytest.raises(bc.InputError) as caught:
            bc.size(path)
        text = str(caught.value)
        assert text.startswith(f"{path}: actuators.shoulder") and "the key 'rated_torque' is missing" in text

    def test_size_writes_what_the_sizing_holds_and_exits_with_1_where_a_limit_is_exceeded(
        self, sized_file, sized, tmp_path, capsys
    ):
        code = main(["size", str(sized_file), "--no-plots", "--out", str(tmp_path / "out")])
        assert (code, sized.inside) == (1, False)
        printed = capsys.readouterr().out
        assert sized.exceeded and all(text in printed for text in sized.exceeded)
        document = json.loads((tmp_path / "out" / "sizing.json").read_text(encoding="utf-8"))
        for entry, joint in zip(document["joints"], sized.joints, strict=True):
            assert entry["peaks"]["peak_torque"]["value"] == pytest.approx(joint.peaks["peak_torque"].value, rel=1e-12)
            assert entry["holding"]["torque"] == pytest.approx(joint.holding_torque, rel=1e-12)
        for motion in sized.inputs.motions:
            history = sized.histories[motion.name]
            with (tmp_path / "out" / f"history_{motion.name}.csv").open(encoding="utf-8", newline="") as file:
                rows = list(csv.DictReader(file))
            for joint in history.joints:
                column = next(name for name in rows[0] if name.startswith(f"{joint.name} shaft torque"))
                assert column.endswith("[N m]")
                assert [float(row[column]) for row in rows] == pytest.approx(joint.shaft.torque.tolist(), rel=1e-9)

    def test_size_exits_with_0_where_all_is_inside(self, sized_file, tmp_path):
        strong = ["--set", "actuators.shoulder.rated_torque=9", "--set", "actuators.shoulder.peak_torque=30"]
        ratings = "{ratio: 90, rated_torque: 9, peak_torque: 30, rated_speed: 300, max_speed: 600}"
        strong += ["--set", f"actuators.elbow={ratings}"]
        options = ["--motion", "back", *strong, "--no-plots", "--out", str(tmp_path / "out")]
        assert main(["size", str(sized_file), *options]) == 0

    def test_wrong_options_exit_with_2_and_write_nothing(self, sized_file, tmp_path, capsys):
        for command, *options in (
            ("size", "--motion", "reech"), ("size", "--set", "actuators.shoulder.ratio=-3"),
            ("fastest", "--motion", "reach", "--speed", "elbw=1"), ("select", "--keep", "elbw=m"),
        ):  # fmt: skip
            assert main([command, str(sized_file), *options, "--no-plots", "--out", str(tmp_path / "none")]) == 2
            assert len(capsys.readouterr().err.strip().splitlines()) == 1
        assert not (tmp_path / "none").exists()

    def test_fastest_writes_a_motion_that_keeps_the_limits_and_a_factor_too_large_exits_with_1(
        self, sized_file, sized_scene, tmp_path
    ):
        options = ["--motion", "reach", "--grid", "60", "--no-plots", "--out", str(tmp_path)]
        assert main(["fastest", str(sized_file), *options]) == 0
        found = bc.time_optimal(sized_scene, "reach", grid=60, costs=False)
        document = json.loads((tmp_path / "fastest_reach.json").read_text(encoding="utf-8"))
        assert document["duration"] == pytest.approx(found.duration, rel=1e-12)
        written = bc.read_motion(sized_scene.robot, tmp_path / "fastest_reach.csv")
        assert written.duration == pytest.approx(found.duration, rel=1e-9)
        most = bc.speed_factor(sized_scene, "reach").factor
        for share, code in ((0.99, 0), (1.01, 1)):
            scale = ["--motion", "reach", "--scale", repr(share * most), "--no-plots", "--out", str(tmp_path)]
            assert main(["fastest", str(sized_file), *scale]) == code


class FreeBaseSizing:
    """A robot whose free base is prescribed too: motors bear what inverse dynamics of the tree asks of them."""

    def test_motors_of_a_moving_robot_bear_the_inverse_dynamics_of_its_tree(self, laden, plain_laden):
        random = np.random.default_rng(8)
        begin = np.array(laden.neutral, dtype=float)
        begin[7:] = random.uniform(-0.7, 0.7, laden.nq - 7)
        end = plain_laden.displaced(begin, random.uniform(-0.5, 0.5, laden.nv))
        motion = bc.waypoints(laden, [0.0, 0.9], [begin, end], samples=31)
        sizing = bc.size(laden, motion)
        states = (motion.position, motion.velocity, motion.acceleration)
        torque = np.array([plain_laden.inverse_dynamics(*row) for row in zip(*states, strict=True)])
        torque += laden.friction_torque(motion.velocity)
        scale = np.abs(torque).max()
        assert [joint.name for joint in sizing.joints] == list(laden.joint_names)[-12:]
        for joint, history in zip(sizing.joints, sizing.histories[motion.name].joints, strict=True):
            column = laden.joint(joint.name).v
            assert np.abs(history.torque - torque[:, column]).max() <= 1e-9 * scale
            assert joint.sampled_torque == np.abs(history.torque).max() <= joint.peak_torque * (1.0 + 1e-12)
            peak = joint.peaks["peak_torque"]
            q, v, a = (x[0] for x in motion.at([peak.time]))
            there = plain_laden.inverse_dynamics(q, v, a) + laden.friction_torque(v)
            assert peak.value == pytest.approx(there[column], rel=1e-9, abs=1e-9 * scale)


class NotSized:
    def test_a_rolling_body_is_refused_with_what_to_do_instead(self, machine):
        source = bc.load_scene(machine.scene_name).source
        for refused in (bc.size, bc.select):
            with pytest.raises(bc.InputError) as caught:
                refused(machine.scene_name)
            assert str(caught.value) == (
                f"{source}: constraint 'floor' rolls, so that positions depend on the path; simulate the scene with "
                "prescribed motions instead: their multipliers are the motors' torques"
            )
