"""The figures by which a run says how far it is to be trusted, computed again from its rows."""

import numpy as np
import pytest

import bellcrank as bc

DIGITS = 1e-8  # of robot files, see simulation.py


class Certificates:
    def test_energy_drift_is_the_largest_gap_of_the_balance(self, loaded_run, plain_rows):
        """Energies by plain Pinocchio in a run with large errors, so that the drift is far above rounding."""
        coarse = bc.simulate(loaded_run.scene, solver="RK45", rtol=1e-3, atol=1e-3)
        t, v, w = coarse.kinetic_energy, coarse.potential_energy, coarse.work
        gap = np.abs(t - t[0] + v - v[0] - w).max()
        assert coarse.energy_drift() == pytest.approx(gap / (t + np.abs(v - v[0]) + np.abs(w)).max(), rel=1e-12)
        assert coarse.energy_drift() > 100 * loaded_run.energy_drift() > 0.0
        kinetic, potential = plain_rows["kinetic"], plain_rows["potential"]
        balance = kinetic + potential - kinetic[0] - potential[0]
        assert balance == pytest.approx(loaded_run.work, abs=10 * DIGITS * np.abs(potential).max())
        assert loaded_run.energy_drift() < 1e-9 and np.abs(loaded_run.work[-1]) > 1e-3 * kinetic.max()

    def test_equation_residual_is_rounding(self, loaded_run, plain_rows):
        """And the accelerations satisfy the equations: what forces and multipliers leave of M v̇ is nothing."""
        assert loaded_run.equation_residual() < 1e-12
        gap = np.abs(loaded_run.acceleration - plain_rows["acceleration"]).max()
        assert gap < DIGITS * np.abs(plain_rows["acceleration"]).max()

    def test_error_estimate_is_the_error_against_a_tight_run(self, loaded_run):
        """The run is repeated with a hundredth of the tolerances, which has about a hundredth of the error."""
        run = bc.simulate(loaded_run.scene, solver="RK45", rtol=1e-5, atol=1e-6)
        error = np.abs(run.position - loaded_run.position).max()
        assert run.known_estimate is None
        assert 0.5 < run.error_estimate() / error < 2.0
        assert run.known_estimate == run.error_estimate()

    def test_error_estimate_of_a_fixed_step_is_that_of_richardson(self, loaded_run):
        run = bc.simulate(loaded_run.scene, solver="RK4", step=loaded_run.statistics.longest_step / 5)
        error = np.abs(run.position - loaded_run.position).max()
        assert 0.4 < run.error_estimate() / error < 2.5

    def test_a_sound_run_has_no_warning_and_says_how_it_ended(self, loaded_run):
        end = loaded_run.time[-1]
        assert loaded_run.success and loaded_run.warnings == () and loaded_run.non_finite == ()
        text = f"{loaded_run.scene.name}: finished at {end:.9g} s: the whole duration was simulated"
        assert loaded_run.message == text
        assert loaded_run.table().splitlines()[0].startswith(loaded_run.scene.name)

    def test_a_run_that_spends_its_evaluations_ends_early_and_says_so(self, loaded_run):
        run = bc.simulate(loaded_run.scene, max_evaluations=60)
        assert not run.success and run.status == "evaluations_spent" and run.time[-1] < loaded_run.time[-1]
        assert run.statistics.evaluations <= 60 + 15
        assert any("ended before its duration" in warning for warning in run.warnings)
        k = np.searchsorted(loaded_run.time, run.time[-1]) - 1
        assert run.state[k] == pytest.approx(loaded_run.state[k], rel=1e-9, abs=1e-9)
