"""Sweeps: every design is a run by itself, statistics are NumPy's, and files hold all numbers."""

import csv
import json

import numpy as np
import pyarrow.parquet
import pytest
from loads import NOWHERE
from lone_measures import run_measures
from scipy import stats

import bellcrank as bc

EXTREMES = ("least.", "largest.", "energy_drift", "constraint_residual")  # they depend on where one looks


class Sweeps:
    @pytest.fixture(scope="class")
    def grid_values(self, loaded):
        values = dict(zip(loaded.parameters, loaded.parameter_values.tolist(), strict=True))
        return [[f * values["stiffness"] for f in (1.0, 1.6)], [f * values["offset"] for f in (0.9, 1.1, 1.25)]]

    @pytest.fixture(scope="class")
    def swept(self, loaded, level, grid_values):
        """A grid of two by three designs."""
        return bc.sweep(
            loaded, dict(zip(("stiffness", "offset"), grid_values, strict=True)), overrides={"level": level}
        )

    @pytest.fixture(scope="class")
    def lone(self, swept):
        """The runs of its designs by themselves."""
        return [bc.simulate(swept.scene, overrides={"stiffness": k, "offset": x}) for k, x in swept.values.tolist()]

    @pytest.fixture(scope="class")
    def sampled(self, loaded, level):
        """A sample of 96 independent designs."""
        values = dict(zip(loaded.parameters, loaded.parameter_values.tolist(), strict=True))
        k, x = values["stiffness"], values["offset"]
        vary = {"stiffness": f"normal({k!r} N/m, {0.04 * k!r} N/m)", "offset": f"uniform({0.8 * x!r}, {1.1 * x!r})"}
        loose = {"level": level, "simulate.rtol": 1e-7, "simulate.atol": 1e-8}
        return bc.sweep(loaded, vary, sample=96, method="random", seed=4, overrides=loose)

    def test_designs_are_all_combinations_the_last_axis_fastest(self, swept, grid_values):
        expected = [[k, x] for k in grid_values[0] for x in grid_values[1]]
        assert swept.values.tolist() == expected and swept.shape == (2, 3) and swept.complete
        assert [(axis.path, axis.unit) for axis in swept.axes] == [("stiffness", "N/m"), ("offset", "m")]
        time = swept.column("end.time")
        assert np.array_equal(swept.grid("end.time"), time.reshape(2, 3))
        assert swept.finished == len(swept) == 6 and swept.reasons == {}

    def test_each_design_is_a_run_by_itself(self, swept, lone):
        events = 0
        for k, run in enumerate(lone):
            assert swept.status[k] == run.status == "finished"
            found, sizes = swept.designs[k], {}
            assert (found.index, found.status, found.reason) == (k, "finished", "")
            for _, unit, value in run_measures(run):
                sizes[unit] = max(sizes.get(unit, 0.0), abs(value))
            for name, unit, value in run_measures(run):
                assert swept.units[name] == unit
                assert swept.column(name)[k] == found.measures[name]
                events += name == "passes.time"
                if not name.startswith(EXTREMES):
                    assert found.measures[name] == pytest.approx(value, rel=1e-7, abs=1e-7 * sizes[unit] + 1e-12)
            assert found.measures["end.work"] == pytest.approx(run.work[-1], rel=1e-7, abs=1e-9)
            own = {name for name in found.measures if not np.isnan(found.measures[name]) and name.startswith("start.")}
            starts = {f"start.{name}": run.position[0, run.robot.joint(name).q] for name in run.robot.joint_names}
            assert set(starts) <= own
            assert all(
                found.measures[name] == pytest.approx(value, rel=1e-9, abs=1e-12) for name, value in starts.items()
            )
        assert events >= 4  # most of the designs cross the level

    def test_extremes_are_those_of_a_run_with_many_rows(self, swept, lone):
        """Also between rows and steps: no row is beyond them, and a row comes near to them."""
        fine = bc.simulate(
            swept.scene, samples=3001, overrides=dict(zip(("stiffness", "offset"), swept.values[4], strict=True))
        )
        found, rows = swept.designs[4].measures, {name: x for name, _, x in run_measures(fine)}
        names = [name for name in rows if name.startswith(("least.", "largest."))]
        assert len(names) > 20
        for name in names:
            output = name.partition(".")[2]
            width = rows[f"largest.{output}"] - rows[f"least.{output}"]
            beyond = (found[name] - rows[name]) * (1 if name.startswith("largest") else -1)
            assert -1e-7 * width - 1e-9 <= beyond <= 2e-3 * width + 1e-9
        assert found["energy_drift"] < 1e-9 and found["constraint_residual"] < 1e-12

    def test_files_hold_all_numbers(self, swept, tmp_path):
        titles = [f"{name} [{unit}]" for name, unit in swept.units.items()]
        with swept.to_csv(tmp_path / "sweep.csv").open(newline="") as file:
            header, *rows = list(csv.reader(file))
        assert header == ["stiffness [N/m]", "offset [m]", "status", *titles, "reason"]
        table = pyarrow.parquet.read_table(swept.to_parquet(tmp_path / "sweep.parquet"))
        assert table.column_names[:4] == ["design", "stiffness [N/m]", "offset [m]", "status"]
        about = json.loads(table.schema.metadata[b"bellcrank"])
        assert about["units"] == dict(swept.units) and about["designs"] == 6 and about["complete"]
        document = json.loads(swept.to_json(tmp_path / "sweep.json").read_text())
        with np.load(swept.to_npz(tmp_path / "sweep.npz")) as file:
            arrays = dict(file)
        for k, row in enumerate(rows):
            assert [float(row[0]), float(row[1])] == document["designs"][k]["values"] == swept.values[k].tolist()
            assert row[2] == document["designs"][k]["status"] == table["status"][k].as_py() == swept.status[k]
            assert arrays["statuses"][arrays["status"][k]] == swept.status[k] and row[-1] == ""
        for place, (name, title) in enumerate(zip(swept.units, titles, strict=True)):
            column = swept.column(name)
            cells = [float(row[3 + place]) if row[3 + place] else np.nan for row in rows]
            assert np.array_equal(cells, column, equal_nan=True)
            assert np.array_equal(table[title].to_numpy(zero_copy_only=False).astype(float), column, equal_nan=True)
            assert np.array_equal(arrays[title], column, equal_nan=True)
            listed = [design["measures"].get(name) for design in document["designs"]]
            assert np.array_equal([np.nan if x is None else x for x in listed], column, equal_nan=True)

    def test_statistics_of_a_sample_are_those_of_numpy_and_scipy(self, sampled):
        values = sampled.column("end.hook_position.x")
        assert np.isfinite(values).all() and len(values) == 96 and np.ptp(values) > 0.0
        found = sampled.statistics.distribution("end.hook_position.x", [0.1, 0.5, 0.75])
        assert (found.count, found.unit, found.least, found.largest) == (96, "m", values.min(), values.max())
        assert found.mean.value == pytest.approx(values.mean(), rel=1e-12)
        interval = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
        assert found.mean.interval == pytest.approx((interval.low, interval.high), rel=1e-9)
        assert found.deviation.value == pytest.approx(values.std(ddof=1), rel=1e-12)
        for level, estimate in found.quantiles.items():
            assert estimate.value == pytest.approx(np.quantile(values, level), rel=1e-12)
            low, high = estimate.interval
            assert low < estimate.value < high
        limit = float(np.sort(values)[70:72].mean())
        chance = sampled.statistics.exceedance(f"end.hook_position.x > {limit!r} m")
        exact = stats.binomtest(25, 96).proportion_ci(0.95, method="exact")
        assert (chance.exceeded, chance.count, chance.probability) == (25, 96, 25 / 96)
        assert chance.interval == pytest.approx((exact.low, exact.high), rel=1e-9)

    def test_designs_of_a_sample_follow_their_distributions_and_are_runs(self, sampled, loaded):
        k, x = sampled.values.T
        values = dict(zip(loaded.parameters, loaded.parameter_values.tolist(), strict=True))
        assert stats.kstest(k, "norm", (values["stiffness"], 0.04 * values["stiffness"])).pvalue > 1e-3
        assert stats.kstest(x, "uniform", (0.8 * values["offset"], 0.3 * values["offset"])).pvalue > 1e-3
        assert abs(np.corrcoef(k, x)[0, 1]) < 0.4
        run = bc.simulate(sampled.scene, overrides={"stiffness": k[57], "offset": x[57]})
        assert sampled.column("end.hook_position.x")[57] == pytest.approx(run.frame("hook").position[-1, 0], rel=1e-5)


class ConstrainedSweeps:
    """Designs whose constraints drift, with a latch that closes or does not."""

    @staticmethod
    def designs(loaded, level):
        """Two designs with a latch at a level, and their runs by themselves."""
        values = dict(zip(loaded.parameters, loaded.parameter_values.tolist(), strict=True))
        loose = {"solver": "RK45", "rtol": 1e-4, "atol": 1e-4, "stabilisation": "none"}
        changes = {"level": level, "events.passes.latch": True, **{f"simulate.{k}": x for k, x in loose.items()}}
        vary = {"stiffness": [0.8 * values["stiffness"], 1.1 * values["stiffness"]]}
        result = bc.sweep(loaded, vary, overrides=changes)
        return result, [bc.simulate(result.scene, overrides={"stiffness": k}) for k in vary["stiffness"]]

    def test_impacts_of_latches_are_those_of_runs_by_themselves(self, loaded, level):
        result, runs = self.designs(loaded, level)
        for k, run in enumerate(runs):
            event = run.events[-1]
            assert result.status[k] == run.status == "event" and event.energy_lost > 0.0
            assert result.column("passes.time")[k] == pytest.approx(event.time, rel=1e-9)
            assert result.column("passes.impulse")[k] == pytest.approx(event.impulse, rel=1e-7)
            assert result.column("passes.energy_lost")[k] == pytest.approx(event.energy_lost, rel=1e-7)

    def test_certificates_of_designs_are_those_at_the_ends_of_steps(self, loaded):
        result, runs = self.designs(loaded, NOWHERE)
        for k, run in enumerate(runs):
            steps = bc.simulate(run.scene, times=run.steps)
            residual, drift = steps.constraint_residual(), steps.energy_drift()
            assert result.status[k] == run.status == "finished" and residual > 1e-12 and drift > 1e-9
            assert result.column("constraint_residual")[k] == pytest.approx(residual, rel=1e-6)
            assert result.column("energy_drift")[k] == pytest.approx(drift, rel=1e-6)
