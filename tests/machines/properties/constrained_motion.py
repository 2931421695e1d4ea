"""Closed loops and rolling: forces of constraints, residuals, stabilisation, and a consistent start."""

import numpy as np
import pytest
from properties.dynamics import close
from scipy.linalg import null_space

import bellcrank as bc

DIGITS = 1e-8  # of robot files, see simulation.py
LOOSE = {"solver": "RK45", "rtol": 1e-4, "atol": 1e-4}  # so that constraints drift far above rounding


class ConstrainedMotion:
    @pytest.fixture(scope="class")
    def drifting(self, loaded):
        """A run whose constraints are left to the error of the integration."""
        return bc.simulate(loaded, **LOOSE, stabilisation="none")

    @staticmethod
    def columns(run, plain):
        """Which rows of the plain equations the run has: those of a planar loop out of its plane are left out."""
        plain.at(run.time[0], run.position[0], run.velocity[0])
        return np.flatnonzero(np.abs(plain.jacobian()[0]).max(axis=1) > 1e-9)

    def test_multipliers_are_those_of_plain_pinocchio(self, loaded_run, plain_scene, plain_rows):
        kept = self.columns(loaded_run, plain_scene)
        close(loaded_run.multipliers, plain_rows["multipliers"][:, kept], DIGITS)
        assert len(loaded_run.multiplier_names) == len(kept) == loaded_run.constraint_rank().rank
        shown = [loaded_run.output(f"constraint_{c.name}") for c in loaded_run.scene.constraints]
        shown = np.hstack([rows.reshape(len(loaded_run), -1) for rows in shown])
        close(shown, plain_rows["multipliers"], DIGITS)
        for constraint in loaded_run.scene.constraints:
            own = [k for k, (name, _) in enumerate(loaded_run.multiplier_names) if name == constraint.name]
            history = loaded_run.constraint(constraint.name)
            assert np.array_equal(history.multipliers, loaded_run.multipliers[:, own])
            assert history.labels == tuple(loaded_run.multiplier_names[k][1] for k in own)

    def test_forces_of_constraints_do_no_work(self, loaded_run, plain_scene, plain_rows):
        for k in range(0, len(loaded_run), 10):
            plain_scene.at(loaded_run.time[k], loaded_run.position[k], loaded_run.velocity[k])
            force = plain_scene.jacobian()[0].T @ plain_rows["multipliers"][k]
            assert np.linalg.norm(force) > 0.01
            assert abs(force @ loaded_run.velocity[k]) < 1e-9 * np.linalg.norm(force)

    def test_singular_values_of_the_constraints_are_those_in_the_metric_of_the_masses(self, loaded_run, plain_scene):
        k = len(loaded_run) // 3
        kept = self.columns(loaded_run, plain_scene)
        plain_scene.at(loaded_run.time[k], loaded_run.position[k], loaded_run.velocity[k])
        jacobian = plain_scene.jacobian()[0][kept]
        weighted = np.linalg.solve(np.linalg.cholesky(plain_scene.mass_matrix()), jacobian.T).T
        weighted /= np.linalg.norm(weighted, axis=1, keepdims=True)
        found = loaded_run.constraint_rank(k)
        assert found.singular_values == pytest.approx(np.linalg.svd(weighted, compute_uv=False), rel=1e-7)
        assert found.rank == len(jacobian) and found.unique.all()

    def test_residuals_are_those_of_pinocchios_frames(self, drifting, plain_scene):
        constraints = plain_scene.scene_data["constraints"]
        gaps, rates = [], []
        for row in zip(drifting.time, drifting.position, drifting.velocity, strict=True):
            plain_scene.at(*row)
            gaps.append([np.abs(plain_scene.gap(entry)).max() for entry in constraints])
            rates.append([np.abs(plain_scene.constraint(entry)[0] @ row[2]).max() for entry in constraints])
        gaps, rates = np.array(gaps), np.array(rates)
        assert gaps.max() > 1e-10
        for k, entry in enumerate(constraints):
            history = drifting.constraint(entry["name"])
            assert history.residual == pytest.approx(gaps[:, k], abs=1e-6 * gaps.max() + 1e-15)
            assert history.velocity_residual == pytest.approx(rates[:, k], abs=1e-6 * rates.max() + 1e-15)
        off = [
            np.linalg.norm(drifting.position[:, j.q + 3 : j.q + 7], axis=1) - 1
            for j in drifting.robot.joints
            if j.nq > 1
        ]
        assert drifting.constraint_residual() == pytest.approx(max(gaps.max(), np.abs(off).max(initial=0)), rel=1e-5)
        assert drifting.velocity_residual() == pytest.approx(rates.max(), rel=1e-5)
        for k in range(1, len(drifting), 6):  # one row at a time, so that the largest has either sign
            row = drifting.part(slice(k, k + 1))
            assert row.constraint_residual() == pytest.approx(gaps[k].max(), abs=1e-6 * gaps.max() + 1e-15)
            assert row.velocity_residual() == pytest.approx(rates[k].max(), abs=1e-6 * rates.max() + 1e-15)
        by_unit = drifting.constraint_residuals
        assert by_unit["m"] == pytest.approx(gaps.max(axis=1), abs=1e-6 * gaps.max() + 1e-15)
        assert by_unit["m/s"] == pytest.approx(rates.max(axis=1), abs=1e-6 * rates.max() + 1e-15)

    def test_projection_keeps_constraints_to_rounding(self, loaded, drifting):
        run = bc.simulate(loaded, **LOOSE)
        assert run.settings.stabilisation.kind == "projection"
        assert run.constraint_residual() < 1e-13 and run.velocity_residual() < 1e-12
        assert drifting.constraint_residual() > 1e3 * run.constraint_residual()

    @pytest.mark.parametrize("kind", ["none", {"kind": "baumgarte", "alpha": 6.0, "beta": 11.0}])
    def test_every_stabilisation_finds_the_motion_where_tolerances_are_tight(self, loaded, loaded_run, kind):
        run = bc.simulate(loaded, stabilisation=kind)
        assert np.abs(run.state - loaded_run.state).max() < 1e-8 * np.abs(loaded_run.state).max()
        assert 0.0 < run.constraint_residual() < 1e-9

    def test_baumgartes_terms_pull_constraints_back(self, loaded, plain_scene):
        """J v̇ + γ = −2 α (φ̇, ψ) − β² φ in every row."""
        alpha, beta = 7.0, 13.0
        run = bc.simulate(loaded, **LOOSE, stabilisation={"kind": "baumgarte", "alpha": alpha, "beta": beta})
        kept, worst, size = self.columns(run, plain_scene), 0.0, 0.0
        for row in zip(run.time, run.position, run.velocity, run.acceleration, strict=True):
            plain_scene.at(*row[:3])
            jacobian, gamma = plain_scene.jacobian()
            gaps = np.hstack([plain_scene.gap(entry) for entry in plain_scene.scene_data["constraints"]])
            gaps = np.pad(gaps, (0, len(gamma) - len(gaps)))  # nothing of which ψ is the rate
            pull = -2 * alpha * jacobian @ row[2] - beta**2 * gaps
            worst = max(worst, np.abs(jacobian @ row[3] + gamma - pull)[kept].max())
            size = max(size, np.abs(pull).max())
        assert size > 1e-8 and worst < 1e-3 * size + 1e-12

    def test_automatic_gains_keep_constraints_within_some_tolerances(self, loaded):
        tight = {"solver": "DOP853", "rtol": 1e-7, "atol": 1e-7}
        run = bc.simulate(loaded, **tight, stabilisation={"kind": "baumgarte", "gains": "auto"})
        used = run.settings.stabilisation
        assert used.alpha == used.beta > 0.1 / run.time[-1]
        assert 0.0 < run.constraint_residual() < 1e-6

    def test_mobility_is_the_null_space_of_the_constraints(self, loaded, loaded_run, plain_scene):
        """Also with motors at some joints: what they leave free, and which joints move then."""
        plain_scene.at(0.0, loaded_run.position[0], loaded_run.velocity[0])
        jacobian = plain_scene.jacobian()[0]
        kept = int((np.abs(jacobian).max(axis=1) > 1e-9).sum())
        free = null_space(jacobian)
        names = loaded.robot.joint_names
        for motors in (names[:0], names[:1], names[:2], names):
            found = bc.mobility(loaded.with_overrides({"actuated": list(motors)}) if motors else loaded)
            if not motors:
                motors = found.motors
            driven = [loaded.robot.joint(name).v for name in motors]
            passive = free @ null_space(free[driven]) if driven else free
            assert (found.freedoms, found.joint_freedoms) == (free.shape[1], loaded.robot.nv)
            assert (found.conditions, found.rank, found.redundant) == (kept, loaded.robot.nv - free.shape[1], ())
            assert found.motors == tuple(motors) and found.passive_freedoms == passive.shape[1]
            moving = np.abs(passive).max(axis=1, initial=0.0) > 1e-6
            joints = loaded.robot.joints
            assert found.passive_joints == tuple(j.name for j in joints if moving[j.v : j.v + j.nv].any())
            assert len(found.independent_motors) == np.linalg.matrix_rank(free[driven]) if driven else True
            assert found.nearby_freedoms == found.freedoms

    def test_a_start_keeps_what_is_given_and_satisfies_the_constraints(self, machine, loaded_run, plain_scene):
        q, v = loaded_run.position[0], loaded_run.velocity[0]
        initial = machine.loads.start.get("initial", {})
        for name, value in initial.items():
            if isinstance(value, float):
                assert q[loaded_run.robot.joint(name).q] == value
            elif "guess" in value and isinstance(value["guess"], float):
                assert 1e-6 < abs(q[loaded_run.robot.joint(name).q] - value["guess"]) < 0.05
        for name, value in initial.get("velocity", {}).items():
            assert v[loaded_run.robot.joint(name).v] == pytest.approx(value, rel=1e-14)
        if "base" in machine.loads.start:
            assert v[3:6] == pytest.approx(machine.loads.start["base"]["angular_velocity"], rel=1e-14)
        plain_scene.at(0.0, q, v)
        gaps = [np.abs(plain_scene.gap(entry)).max() for entry in plain_scene.scene_data["constraints"]]
        assert max(gaps) < 1e-8 and np.abs(plain_scene.jacobian()[0] @ v).max() < 1e-8
        assert np.abs(v).max() > 0.1
