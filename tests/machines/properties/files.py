"""Files of a run: read back they hold the same numbers, need nothing beside them, and are refused where damaged."""

import csv
import pickle
import shutil

import numpy as np
import pytest
from loads import TABLE

import bellcrank as bc


def same_run(found, expected):
    """Whether two runs have the same rows, and the same quantities follow from them, to the last bit."""
    for name in ("time", "state", "acceleration", "torque", "actuator_torque", "kinetic_energy", "potential_energy",
                 "multipliers", "work", "steps"):  # fmt: skip
        assert np.array_equal(getattr(found, name), getattr(expected, name)), name
    assert found.status == expected.status and found.message == expected.message
    assert [(event.name, event.time) for event in found.events] == [(e.name, e.time) for e in expected.events]
    assert all(np.array_equal(a.position, b.position) for a, b in zip(found.events, expected.events, strict=True))
    assert found.outputs.keys() == expected.outputs.keys()
    assert all(np.array_equal(rows, expected.output(name)) for name, rows in found.outputs.items())
    assert found.statistics == expected.statistics and found.settings == expected.settings
    assert found.energy_drift() == expected.energy_drift()


class RunFiles:
    @pytest.fixture(scope="class")
    def archive(self, loaded_file, level, tmp_path_factory):
        """A run with events from files that are gone, and the file that it was saved to."""
        folder = tmp_path_factory.mktemp("gone")
        shutil.copytree(loaded_file.parent, folder / "scene")
        run = bc.simulate(folder / "scene" / loaded_file.name, overrides={"level": level})
        path = run.save(folder / "run")
        shutil.rmtree(folder / "scene")
        return run, path

    def test_a_saved_run_is_read_back_to_the_bit_without_the_files_it_came_from(self, archive):
        run, path = archive
        assert path.name == "run.npz" and len(run.events) >= 2
        same_run(bc.load_run(path), run)

    def test_the_scene_of_a_saved_run_simulates_the_same_again(self, archive):
        run, path = archive
        again = bc.simulate(bc.load_run(path).scene)
        assert np.array_equal(again.state, run.state)
        assert [event.time for event in again.events] == [event.time for event in run.events]

    def test_a_pickled_run_and_scene_are_the_same(self, archive):
        run, _ = archive
        same_run(pickle.loads(pickle.dumps(run)), run)
        scene = pickle.loads(pickle.dumps(run.scene))
        assert np.array_equal(bc.simulate(scene, samples=3).state, run.state[::30])

    def test_the_table_of_a_run_names_units_and_holds_all_numbers(self, loaded_run, tmp_path):
        with loaded_run.to_csv(tmp_path / "run.csv").open(newline="") as file:
            titles, *rows = list(csv.reader(file))
        table = {title: np.array([float(row[k]) for row in rows]) for k, title in enumerate(titles)}
        assert len(table) == len(titles)
        expected = {"time [s]": loaded_run.time, "work [J]": loaded_run.work}
        expected |= {f"{kind} energy [J]": getattr(loaded_run, f"{kind}_energy") for kind in ("kinetic", "potential")}
        for joint in loaded_run.robot.joints:
            history = loaded_run.joint(joint.name)
            if joint.nv > 1:
                expected |= _free_columns(joint.name, history)
                continue
            unit, torque = ("m", "N") if joint.kind == "prismatic" else ("rad", "N m")
            expected[f"{joint.name} position [{unit}]"] = history.position
            expected[f"{joint.name} velocity [{unit}/s]"] = history.velocity
            expected[f"{joint.name} acceleration [{unit}/s^2]"] = history.acceleration
            expected[f"{joint.name} torque [{torque}]"] = history.torque
            if loaded_run.scene.control:
                expected[f"{joint.name} actuator torque [{torque}]"] = history.actuator_torque
        for constraint in loaded_run.scene.constraints:
            history = loaded_run.constraint(constraint.name)
            for label, column in zip(history.labels, history.multipliers.T, strict=True):
                expected[f"{constraint.name} {label}"] = column
            expected[f"{constraint.name} residual [m or rad]"] = history.residual
        for c, unit in enumerate("xyz"):
            expected[f"hook_position {unit} [m]"] = loaded_run.output("hook_position")[:, c]
            expected[f"force_push {unit} [N]"] = loaded_run.output("force_push")[:, c]
            expected[f"force_push r{unit} [N m]"] = loaded_run.output("force_push")[:, 3 + c]
        expected["hook_rotation r23 [1]"] = loaded_run.output("hook_rotation")[:, 5]
        expected["force_tie [N]"], expected["mixed [1]"] = loaded_run.output("force_tie"), loaded_run.output("mixed")
        for title, column in expected.items():
            assert np.array_equal(table[title], column), title
        others = {title for title in table if title not in expected}
        assert all(title.split()[0] in loaded_run.scene.outputs for title in others)

    def test_a_damaged_file_is_refused_in_one_sentence_or_holds_the_same_run(self, archive, tmp_path):
        run, path = archive
        whole, random, refused = path.read_bytes(), np.random.default_rng(3), 0
        for k in range(8):
            broken = bytearray(whole)
            if k < 2:
                broken = broken[: int(random.integers(10, len(whole)))]
            else:
                at = int(random.integers(0, len(whole)))
                broken[at] ^= int(random.integers(1, 256))
            file = tmp_path / f"broken{k}.npz"
            file.write_bytes(broken)
            try:
                found = bc.load_run(file)
            except bc.InputError as error:
                refused += 1
                assert str(file) in str(error) and "\n" not in str(error)
            else:
                assert np.array_equal(found.state, run.state)
        assert refused >= 4


class Continuation:
    def test_a_run_goes_on_from_a_saved_one(self, machine, loaded, loaded_run, tmp_path):
        half = loaded_run.time[30]
        first = bc.simulate(loaded, duration=half, samples=31).save(tmp_path / "first.npz")
        changes = {"initial": {"run": str(first), "clock": "continue"}} | (
            {"base": {}} if "base" in loaded.data else {}
        )
        rest = loaded_run.time[-1] - half
        run = bc.simulate(loaded, duration=rest, samples=31, overrides=changes)
        kinks = TABLE[1:, 0] if machine.loads.joints else TABLE[:0, 0]
        later = kinks[(kinks > half) & (kinks < loaded_run.time[-1])] - half
        assert all(np.abs(run.steps - kink).min() < 1e-12 for kink in later)
        count = loaded_run.robot.nq + loaded_run.robot.nv
        size = np.abs(loaded_run.state[:, :count]).max()
        assert run.state[0, :count] == pytest.approx(loaded_run.state[30, :count], abs=1e-9 * size)
        assert run.state[:, :count] == pytest.approx(loaded_run.state[30:, :count], abs=1e-8 * size)


def _free_columns(name, history):
    """Columns of a free joint: position and quaternion; linear and angular velocity and acceleration."""
    found = {}
    for k, (place, unit) in enumerate(zip(("x", "y", "z", "qx", "qy", "qz", "qw"), ["m"] * 3 + ["1"] * 4, strict=True)):
        found[f"{name} position {place} [{unit}]"] = history.position[:, k]
    for k, (place, unit) in enumerate(zip(("x", "y", "z", "rx", "ry", "rz"), ["m"] * 3 + ["rad"] * 3, strict=True)):
        found[f"{name} velocity {place} [{unit}/s]"] = history.velocity[:, k]
        found[f"{name} acceleration {place} [{unit}/s^2]"] = history.acceleration[:, k]
    return found
