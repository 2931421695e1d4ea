"""Derivatives of a run by parameters and by its start, against differences of runs."""

import numpy as np
import pytest

import bellcrank as bc

STENCIL = {-2: 1 / 12, -1: -2 / 3, 1: 2 / 3, 2: -1 / 12}  # central differences of order 4
TIGHT = {"rtol": 1e-12, "atol": 1e-13}


class Sensitivities:
    @pytest.fixture(scope="class")
    def variables(self, machine, loaded):
        """What derivatives are taken by, with the steps of differences."""
        values = dict(zip(loaded.parameters, loaded.parameter_values.tolist(), strict=True))
        found = {name: (values[name], 5e-4 * values[name]) for name in ("stiffness", "offset", "load")}
        initial = machine.loads.start.get("initial", {})
        for name in machine.loads.joints:
            if isinstance(initial.get(name), float):
                found[f"initial.{name}"] = initial[name], 3e-4
            if name in initial.get("velocity", {}):
                found[f"initial.velocity.{name}"] = initial["velocity"][name], 3e-4
        return found

    @pytest.fixture(scope="class")
    def derived(self, loaded, level, variables):
        return bc.simulate(loaded, overrides={"level": level}, sensitivities=list(variables), **TIGHT)

    @pytest.fixture(scope="class")
    def neighbours(self, loaded, level, variables):
        """Runs beside it, by variable and step."""

        def run(name, k):
            value, step = variables[name]
            return bc.simulate(loaded, overrides={"level": level, name: value + k * step}, **TIGHT)

        return {name: {k: run(name, k) for k in STENCIL} for name in variables}

    @staticmethod
    def difference(runs, step, of):
        return sum(weight * np.asarray(of(runs[k])) for k, weight in STENCIL.items()) / step

    def check(self, derived, neighbours, variables, pairs):
        """`pairs`: of a sensitivity, and of a run."""
        for name, (_, step) in variables.items():
            found = derived.sensitivity(name)
            assert found.name == name
            for of_sensitivity, of_run in pairs:
                expected = self.difference(neighbours[name], step, of_run)
                own = np.asarray(of_sensitivity(found))
                size = np.abs(expected).max(initial=0.0) + 1e-3 * np.abs(of_run(derived)).max(initial=0.0)
                assert own.shape == expected.shape
                assert np.abs(own - expected).max(initial=0.0) <= 1e-6 * size + 1e-9

    def test_derivatives_of_the_motion_are_those_of_differences(self, derived, neighbours, variables):
        names = ("position", "velocity", "state")
        count = derived.robot.nq + derived.robot.nv  # the state of a run has the work as well
        pairs = [(lambda s, n=n: getattr(s, n), lambda r, n=n: getattr(r, n)[:, :count]) for n in names]
        self.check(derived, neighbours, variables, pairs)
        for name in variables:
            assert np.abs(derived.sensitivity(name).state).max() > 1e-6

    def test_derivatives_of_events_are_those_of_differences(self, derived, neighbours, variables):
        """The time moves, and the state with it."""
        count = len(derived.events)
        assert count >= 2
        for name, (_, step) in variables.items():
            found = derived.sensitivity(name)
            for k in range(count):
                event, runs = found.events[k], neighbours[name]
                pairs = [(event.time, lambda r, k=k: r.events[k].time)]
                pairs += [(event.position, lambda r, k=k: r.events[k].position)]
                pairs += [(event.velocity, lambda r, k=k: r.events[k].velocity)]
                for own, of in pairs:
                    expected = self.difference(runs, step, of)
                    assert (
                        np.abs(own - expected).max() <= 1e-5 * np.abs(expected).max() + 1e-7 * np.abs(of(derived)).max()
                    )
                assert event.name == derived.events[k].name
            assert found.event_times == pytest.approx([event.time for event in found.events], rel=1e-12)
            assert found.event("passes").time == found.events[1].time

    def test_units_are_those_of_the_quantity_per_the_variables(self, derived, variables):
        units = {"stiffness": "N/m", "offset": "m", "load": ""}
        for name in variables:
            joint = derived.robot.joint(name.rpartition(".")[2]) if "." in name else None
            angle = "m" if joint is not None and joint.kind == "prismatic" else "rad"
            unit = units.get(name, f"{angle}/s" if "velocity" in name else angle)
            found = derived.sensitivity(name)
            assert found.unit == unit and found.per("J") == (f"J per {unit}" if unit else "J")


class OutputSensitivities(Sensitivities):
    """Beside the motion, what follows from it."""

    def test_derivatives_of_accelerations_energies_and_forces_are_those_of_differences(
        self, derived, neighbours, variables
    ):
        names = ("acceleration", "kinetic_energy", "potential_energy", "torque", "actuator_torque", "multipliers")
        pairs = [(lambda s, n=n: getattr(s, n), lambda r, n=n: getattr(r, n)) for n in names]
        self.check(derived, neighbours, variables, pairs)

    def test_derivatives_of_outputs_are_those_of_differences(self, derived, neighbours, variables):
        names = derived.scene.outputs
        assert list(derived.sensitivity("load").outputs) == list(names)
        self.check(
            derived, neighbours, variables, [(lambda s, n=n: s.output(n), lambda r, n=n: r.output(n)) for n in names]
        )

    def test_the_table_of_derivatives_holds_their_numbers(self, derived, variables, tmp_path):
        found = derived.sensitivity("offset")
        lines = found.to_csv(tmp_path / "by_offset.csv").read_text().splitlines()
        titles = lines[0].split(",")
        table = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
        assert titles[0] == "time [s]" and np.array_equal(table[:, 0], derived.time)
        nq, nv = derived.robot.nq, derived.robot.nv
        assert np.array_equal(table[:, 1 : 1 + nq + nv], found.state)
        place = next(k for k, title in enumerate(titles) if title.startswith("d(mixed)"))
        assert (
            np.array_equal(table[:, place], found.output("mixed")) and titles[place] == "d(mixed)/d(offset) [1 per m]"
        )


class LatchSensitivities:
    """Of the impact of a latch, whose time moves."""

    def test_derivatives_of_a_latch_are_those_of_differences(self, loaded, level):
        scene = loaded.with_overrides({"level": level, "events.passes.latch": True})
        values = dict(zip(scene.parameters, scene.parameter_values.tolist(), strict=True))
        names = ("stiffness", "load")
        run = bc.simulate(scene, sensitivities=names, **TIGHT)
        for name in names:
            step = 5e-4 * values[name]
            runs = {k: bc.simulate(scene, overrides={name: values[name] + k * step}, **TIGHT) for k in STENCIL}
            found = run.sensitivity(name).events[-1]
            for what in ("impulse", "energy_lost"):
                expected = Sensitivities.difference(runs, step, lambda r, what=what: getattr(r.events[-1], what))
                size = abs(expected) + 1e-3 * abs(getattr(run.events[-1], what))
                assert getattr(found, what) == pytest.approx(expected, abs=1e-6 * size)
            expected = Sensitivities.difference(runs, step, lambda r: r.events[-1].latch.velocity)
            assert found.latch_velocity == pytest.approx(expected, abs=1e-6 * np.abs(expected).max() + 1e-9)
            assert abs(found.energy_lost) > 0.0
