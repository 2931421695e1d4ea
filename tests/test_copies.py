"""Copies and pickles of robots, scenes, runs, sizings, sweeps, motions and functions give equal numbers."""

import copy
import multiprocessing
import pickle
import shutil

import numpy as np
import pytest

import bellcrank as bc

WAYS = {"pickle": lambda x: pickle.loads(pickle.dumps(x)), "deepcopy": copy.deepcopy, "copy": copy.copy}
SCENES = ("four_bar", "planar_2r_tracking", "rolling_disk_six", "spring_pendulum", "geared_pendulum", "two_wheeler")


@pytest.fixture(params=WAYS)
def copied(request):
    return WAYS[request.param]


def state(scene):
    return bc.simulate(scene, duration=0.05, samples=4).state


def equal_links(symbols):
    """A constraint of one's own, at the top level of a module, as pickling wants it."""
    return symbols.joint("shoulder").position - 2.0 * symbols.joint("elbow").position


@pytest.mark.parametrize("name", SCENES)
def test_a_copied_scene_runs_to_the_bit(copied, name):
    scene = bc.load_scene(name)
    fresh = copied(scene)
    expected = state(scene)
    np.testing.assert_array_equal(state(fresh), expected)
    np.testing.assert_array_equal(state(copied(scene)), expected)  # after its system was made, which stays behind
    assert copied(scene).data == scene.data and repr(copied(scene)) == repr(scene)


def test_a_copied_robot_has_equal_dynamics_and_still_cannot_be_written_to(copied):
    robot = bc.load_robot("planar_2r", rotor_inertia={"elbow": 0.01}, friction={"shoulder": (0.1, 0.2)})
    q = np.random.default_rng(1).normal(size=(7, 2))
    torque = robot.inverse_dynamics(q, q, q)
    again = copied(robot)
    np.testing.assert_array_equal(again.inverse_dynamics(q, q, q), torque)
    np.testing.assert_array_equal(again.energy(q, q), robot.energy(q, q))
    assert again.key == robot.key and again.joints == robot.joints and again.urdf.name == robot.urdf.name
    for name in ("gravity", "lower", "upper", "rotor_inertia", "viscous", "neutral"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(again, name)[...] = 0.0


def test_a_pickle_holds_no_machine_code_and_an_unpickled_object_traces_anew(monkeypatch):
    scene = bc.load_scene("planar_2r_swing")
    before = pickle.dumps(scene)
    expected = state(scene)
    assert len(pickle.dumps(scene)) == len(before) < 100_000
    monkeypatch.setenv("BELLCRANK_CACHE", "off")
    np.testing.assert_array_equal(state(pickle.loads(before)), expected)


def test_a_copied_run_has_equal_rows_and_equal_results(copied):
    run = bc.simulate("four_bar", duration=0.1, samples=6)
    energy, forces = run.total_energy, run.multipliers
    again = copied(run)
    for name in ("time", "state", "steps", "parameters"):
        np.testing.assert_array_equal(getattr(again, name), getattr(run, name))
    np.testing.assert_array_equal(again.total_energy, energy)
    np.testing.assert_array_equal(again.multipliers, forces)
    assert (again.status, again.statistics, again.message) == (run.status, run.statistics, run.message)


def test_a_deep_copy_of_a_run_has_arrays_of_its_own():
    run = bc.simulate("planar_2r_swing", duration=0.02, samples=3)
    before = run.state.copy()
    copy.deepcopy(run).state[...] = 0.0
    np.testing.assert_array_equal(run.state, before)


@pytest.mark.tier2
def test_a_copied_sizing_says_the_same(copied):
    sizing = bc.size("planar_2r")
    again = copied(sizing)
    assert str(again) == str(sizing) and again.joints == sizing.joints and again.supply_peak == sizing.supply_peak


def test_a_copied_sweep_says_the_same(copied):
    found = bc.sweep(
        "planar_2r_swing", {"initial.shoulder": [0.1, 0.2]}, overrides={"simulate.duration": 0.02}, threads=1
    )
    again = copied(found)
    np.testing.assert_array_equal(again.values, found.values)
    assert again.designs == found.designs and again.table() == found.table()


def test_a_copied_motion_has_equal_rows_that_still_cannot_be_written_to(copied):
    scene = bc.load_scene("planar_2r_tracking")
    motion = scene.motion(next(iter(scene.config.motions)))
    again = copied(motion)
    for name in ("time", "position", "velocity", "acceleration"):
        np.testing.assert_array_equal(getattr(again, name), getattr(motion, name))
        assert not getattr(again, name).flags.writeable
    t = 0.5 * (motion.time[0] + motion.time[1])
    np.testing.assert_array_equal(again.at(t), motion.at(t))


def test_a_copied_function_gives_equal_numbers(copied):
    code = bc.load_robot("planar_2r").dynamics("forward_dynamics")
    q = np.array([0.1, -0.4])
    np.testing.assert_array_equal(copied(code)(q, q, q), code(q, q, q))


def test_a_scene_with_a_table_needs_no_file_when_it_is_unpickled(tmp_path):
    folder = tmp_path / "scene"
    folder.mkdir()
    urdf = bc.load_robot("pendulum").source
    shutil.copy(urdf, folder / "pendulum.urdf")
    joint = bc.load_robot("pendulum").joint_names[0]
    (folder / "torque.csv").write_text(f"time [s],{joint} torque [N m]\n0,0\n0.5,1\n1,0\n")
    (folder / "s.yaml").write_text(
        "name: S\nurdf: pendulum.urdf\n"
        f"forces: [{{name: push, kind: torque, joint: {joint}, file: torque.csv, interpolation: linear}}]\n"
        "simulate: {duration: 1}\n"
    )
    scene = bc.load_scene(folder / "s.yaml", {"simulate.rtol": 1e-7})
    data, expected, files = pickle.dumps(scene), state(scene), scene.files
    shutil.rmtree(folder)
    again = pickle.loads(data)
    np.testing.assert_array_equal(state(again), expected)
    assert again.files == files and again.settings.rtol == 1e-7
    assert again.source_data["simulate"].overrides == {"rtol": "simulate.rtol"}


def test_a_constraint_of_ones_own_is_pickled_by_its_function_where_that_has_a_name(copied):
    scene = bc.load_scene("planar_2r_swing", {"initial": {"shoulder": 0.4, "elbow": 0.2}})
    own = scene.with_constraint(equal_links)
    np.testing.assert_array_equal(state(copied(own)), state(own))
    nameless = scene.with_constraint(lambda symbols: equal_links(symbols))
    np.testing.assert_array_equal(state(copy.deepcopy(nameless)), state(own))
    with pytest.raises((pickle.PicklingError, AttributeError), match="lambda"):
        pickle.dumps(nameless)


@pytest.mark.tier2
@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_processes_of_a_pool_take_scenes_and_give_back_runs(method):
    scenes = [bc.load_scene("planar_2r_swing", {"initial.shoulder": angle}) for angle in (0.3, 0.6)]
    expected = [state(scene) for scene in scenes]
    with multiprocessing.get_context(method).Pool(2) as pool:
        runs = pool.map(_run, scenes)
    for run, there in zip(runs, expected, strict=True):
        np.testing.assert_array_equal(run.state, there)
        assert run.success


def _run(scene):
    return bc.simulate(scene, duration=0.05, samples=4)
