"""A run of a scene with every kind of force, against SciPy's integrator on equations of plain Pinocchio and NumPy."""

import numpy as np
import pytest
from loads import TABLE
from properties.dynamics import close

import bellcrank as bc

# Robot files write right angles with nine digits, which are read as right angles: the equations agree to these digits.
DIGITS = 1e-8


class Simulation:
    def test_accelerations_are_those_of_plain_pinocchio(self, loaded_run, plain_rows):
        close(loaded_run.acceleration, plain_rows["acceleration"], DIGITS)

    def test_torques_are_those_of_the_formulas_of_all_forces(self, loaded_run, plain_rows):
        close(loaded_run.actuator_torque, plain_rows["actuators"], DIGITS)
        close(loaded_run.torque, plain_rows["torque"], DIGITS)

    def test_each_force_and_controller_shows_what_its_formula_gives(self, loaded_run, plain_rows):
        names = [name for name in plain_rows if name.startswith("force ")]
        assert len(names) == len(loaded_run.scene.forces) + len(loaded_run.scene.control)
        for name in names:
            expected = plain_rows[name].reshape(len(loaded_run), -1)
            assert np.abs(expected).max() > 0.0
            close(loaded_run.output(name.replace(" ", "_")).reshape(expected.shape), expected, DIGITS)

    def test_energies_are_those_of_pinocchio_and_of_the_springs(self, loaded_run, plain_rows):
        kinetic, potential = plain_rows["kinetic"], plain_rows["potential"]
        for found in (loaded_run.kinetic_energy, loaded_run.output("energy_kinetic")):
            close(found, kinetic, DIGITS)
        for found in (loaded_run.potential_energy, loaded_run.output("energy_potential")):
            close(found, potential, DIGITS)
        for found in (loaded_run.total_energy, loaded_run.output("energy_total")):
            assert found == pytest.approx(kinetic + potential, abs=DIGITS * np.abs(potential).max())

    def test_motion_and_work_are_those_of_scipy(self, loaded_run, scipy_motion):
        found = np.hstack([loaded_run.position, loaded_run.velocity, loaded_run.work[:, None]])
        expected = np.array([scipy_motion(t) for t in loaded_run.time])
        assert np.abs(found - expected).max() < 10 * DIGITS * np.abs(expected).max()
        assert np.abs(loaded_run.position[-1] - loaded_run.position[0]).max() > 0.01

    def test_steps_end_at_the_kinks_of_a_table(self, machine, loaded_run):
        kinks = TABLE[1:, 0] if machine.loads.joints else TABLE[:0, 0]
        assert set(kinks[kinks < loaded_run.time[-1]].tolist()) <= set(loaded_run.steps.tolist())
        assert (loaded_run.steps[0], loaded_run.steps[-1]) == (0.0, loaded_run.time[-1])
        assert len(loaded_run.steps) == loaded_run.statistics.steps + 1

    def test_joints_of_a_run_are_its_columns(self, loaded_run):
        for joint in loaded_run.robot.joints:
            history = loaded_run.joint(joint.name)
            q, v = slice(joint.q, joint.q + joint.nq), slice(joint.v, joint.v + joint.nv)
            for found, rows in (
                (history.position, loaded_run.position[:, q]),
                (history.velocity, loaded_run.velocity[:, v]),
                (history.acceleration, loaded_run.acceleration[:, v]),
                (history.torque, loaded_run.torque[:, v]),
                (history.actuator_torque, loaded_run.actuator_torque[:, v]),
            ):
                assert np.array_equal(found.reshape(rows.shape), rows)
        for name in loaded_run.scene.outputs:
            joint, _, what = name.rpartition("_")
            if joint in loaded_run.robot.joint_names:
                assert loaded_run.output(name) == pytest.approx(getattr(loaded_run.joint(joint), what), rel=1e-12)

    def test_frames_move_as_pinocchio_has_them(self, machine, loaded_run, plain_scene):
        histories = {name: loaded_run.frame(name) for name in ("hook", "eye", machine.loads.links[1])}
        outputs = {what: loaded_run.output(f"hook_{what}") for what in ("position", "velocity", "angular_velocity")}
        for k in range(0, len(loaded_run), 15):
            plain_scene.at(loaded_run.time[k], loaded_run.position[k], loaded_run.velocity[k])
            for name, history in histories.items():
                expected = plain_scene.frame(name)
                for what in ("position", "rotation", "velocity", "angular_velocity"):
                    found, wanted = getattr(history, what)[k], getattr(expected, what)
                    assert found == pytest.approx(wanted, abs=DIGITS * (1.0 + np.abs(wanted).max()))
            for what, rows in outputs.items():
                assert rows[k] == pytest.approx(getattr(histories["hook"], what)[k], rel=1e-12, abs=1e-13)
            rotation = histories["hook"].rotation[k].ravel()
            assert loaded_run.output("hook_rotation")[k] == pytest.approx(rotation, abs=1e-13)

    def test_an_expression_is_computed_from_frames_and_time(self, loaded_run):
        hook, t = loaded_run.frame("hook"), loaded_run.time
        expected = 2 * hook.velocity[:, 0] ** 2 - 3 * np.sin(hook.position[:, 2]) * t + np.sqrt(1 + t**2)
        assert loaded_run.output("mixed") == pytest.approx(expected, rel=1e-12, abs=1e-12)

    def test_quaternions_have_length_one_and_velocities_are_the_rates_of_positions(self, loaded_run, plain_scene):
        """By differences of rows that are close to each other."""
        t = 0.4 * loaded_run.time[-1]
        h = 1e-3 * loaded_run.time[-1]
        near = bc.simulate(loaded_run.scene, times=[0.0, *(t + h * np.arange(-2, 3))])
        q = near.position[1:]
        rate = (q[0] - 8 * q[1] + 8 * q[3] - q[4]) / (12 * h)
        expected = plain_scene.at(t, q[2], near.velocity[3]).position_rate()
        assert rate == pytest.approx(expected, abs=1e-6 * (1.0 + np.abs(expected).max()))
        for joint in loaded_run.robot.joints:
            if joint.kind == "floating":
                turns = loaded_run.position[:, joint.q + 3 : joint.q + 7]
                assert np.linalg.norm(turns, axis=1) == pytest.approx(1.0, abs=1e-14)

    def test_rows_are_where_they_are_asked_for(self, loaded_run):
        end = loaded_run.time[-1]
        assert loaded_run.time == pytest.approx(np.linspace(0.0, end, 61), abs=1e-15)
        chosen = np.array([0.0, 0.137, 0.5, 0.731, 1.0]) * end
        run = bc.simulate(loaded_run.scene, times=chosen, duration=end)
        assert np.array_equal(run.time, chosen)
        assert run.state[2] == pytest.approx(loaded_run.state[30], rel=1e-9, abs=1e-9)
        coarse = bc.simulate(loaded_run.scene, samples=7)
        assert coarse.state == pytest.approx(loaded_run.state[::10], rel=1e-9, abs=1e-9)
