"""Methods of integration agree, a prepared simulation is a simulation, a parameter is the number in the file."""

from xml.etree import ElementTree

import numpy as np
import pytest
import yaml

import bellcrank as bc


def same_motion(found, expected, bound):
    """Whether the rows of two runs agree, to a bound relative to the largest entry of each quantity."""
    size = np.abs(expected.state).max()
    assert found.success and np.array_equal(found.time, expected.time)
    assert np.abs(found.state - expected.state).max() <= bound * size


class Solvers:
    @pytest.mark.parametrize("solver", ["RK45", "Radau"])
    def test_methods_of_other_orders_find_the_same_motion(self, loaded_run, solver):
        run = bc.simulate(loaded_run.scene, solver=solver, rtol=1e-8, atol=1e-10)
        assert run.settings.solver == solver and run.statistics.steps != loaded_run.statistics.steps
        assert (run.statistics.implicit_steps > 0) == (solver == "Radau") == (run.statistics.jacobians > 0)
        same_motion(run, loaded_run, 1e-6)

    def test_runge_kutta_of_order_4_finds_the_same_motion_with_a_fixed_step(self, loaded_run):
        step = loaded_run.time[-1] / 5000  # short, since steps across the kink of a clamped torque are of order 2
        run = bc.simulate(loaded_run.scene, solver="RK4", step=step)
        assert run.statistics.rejected == 0 and run.statistics.longest_step <= step * (1 + 1e-9)
        same_motion(run, loaded_run, 1e-6)

    def test_auto_is_dop853_to_the_bit_where_nothing_is_stiff(self, loaded_run):
        run = bc.simulate(loaded_run.scene, solver="auto")
        assert run.statistics.switches == 0
        assert np.array_equal(run.state, loaded_run.state)

    def test_tolerances_bound_the_error_and_tighter_ones_take_more_steps(self, loaded_run):
        steps, errors = [], []
        for tolerance in (1e-4, 1e-7):
            run = bc.simulate(loaded_run.scene, solver="RK45", rtol=tolerance, atol=tolerance)
            steps.append(run.statistics.steps)
            errors.append(np.abs(run.position - loaded_run.position).max())
        assert steps[0] < steps[1]
        assert errors[1] < errors[0] < 1e-2 and errors[1] < 1e-5

    def test_steps_are_no_longer_than_the_longest_that_is_allowed(self, loaded_run):
        most = loaded_run.time[-1] / 150
        run = bc.simulate(loaded_run.scene, max_step=most, first_step=most / 7)
        lengths = np.diff(run.steps)
        assert lengths[0] == pytest.approx(most / 7, rel=1e-9) and lengths.max() <= most * (1 + 1e-9)
        assert lengths.sum() == pytest.approx(loaded_run.time[-1]) and run.statistics.steps == len(lengths)
        same_motion(run, loaded_run, 1e-8)

    def test_a_prepared_simulation_is_a_simulation(self, loaded):
        prepared = bc.prepare(loaded, samples=13)
        stiffness, offset = loaded.parameter_values[-4] * 1.7, loaded.parameter_values[-3] * 1.2
        for values in ({}, {"stiffness": stiffness, "offset": offset}):
            lone = bc.simulate(loaded, samples=13, overrides=values)
            found = prepared(values)
            assert found.status == lone.status and np.array_equal(found.time, lone.time)
            assert np.array_equal(found.state, lone.state)
            assert np.array_equal(found.position, lone.position) and np.array_equal(found.velocity, lone.velocity)
            assert np.array_equal(prepared.trajectory(values).state, lone.state)

    def test_a_parameter_is_the_number_in_the_file(self, machine, loaded, loaded_file, loaded_run):
        """Parameters, which compile nothing, against files with these numbers."""
        parameters = dict(zip(loaded.parameters, loaded.parameter_values.tolist(), strict=True))
        stiffness, offset, load = 1.3 * parameters["stiffness"], 1.2 * parameters["offset"], 1.4
        run = bc.simulate(loaded, overrides={"stiffness": stiffness, "offset": offset, "load": load})
        data = yaml.safe_load(loaded_file.read_text())
        next(entry for entry in data["forces"] if entry["name"] == "tie")["stiffness"] = stiffness
        data["frames"]["hook"]["xyz"][0] = offset
        data["urdf"] = str(_heavier(loaded.robot.source, machine.loads.links[0], load, loaded_file.parent))
        data["parameters"] = {name: p for name, p in data["parameters"].items() if name == "level"}
        written = loaded_file.with_name("written.yaml")
        written.write_text(yaml.safe_dump(data))
        same_motion(bc.simulate(written), run, 1e-9)
        assert np.abs(run.state - loaded_run.state).max() > 1e-4


def _heavier(path, link, scale, folder):
    """A robot file with the mass and inertia of one link scaled."""
    tree = ElementTree.parse(path)
    [body] = [each for each in tree.getroot().iter("link") if each.get("name") == link]
    numbers = [body.find("inertial/mass"), body.find("inertial/inertia")]
    for element in numbers:
        for key, value in element.attrib.items():
            element.set(key, repr(scale * float(value)))
    for each in tree.getroot().iter("link"):
        for shape in each.findall("visual") + each.findall("collision"):
            each.remove(shape)
    tree.write(folder / "heavier.urdf")
    return folder / "heavier.urdf"
