"""The observed quantities: what their extremes give against what a run computes of itself row by row."""

from dataclasses import replace

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.dynamics.constraints.constraint_alignment import alignment_cosines_along
from bellcrank.dynamics.equations.system import system_of

SCENES = ["four_bar", "bricard", "rolling_disk", "pendulum", "five_bar", "spring_pendulum", "planar_2r_tracking"]


@pytest.mark.tier2
@pytest.mark.parametrize("name", SCENES)
def test_the_extremes_give_drift_residuals_and_outputs_of_the_run(name):
    run = bc.simulate(name, samples=101)
    system = system_of(run.scene)
    layout, y = system.observed_layout, system.observe(*run._arguments)
    assert y.shape == (len(run), layout.size)
    columns = np.column_stack([run.output(output).reshape(len(run), -1) for output in run.scene.outputs])
    np.testing.assert_allclose(y[:, : layout.outputs], columns, rtol=1e-12, atol=1e-12 * np.abs(columns).max())
    balance, plus, minus = y[:, layout.energies].T
    v0 = run.potential_energy[0]
    drift = max(balance.max() - balance[0], balance[0] - balance.min()) / max(plus.max() - v0, minus.max() + v0)
    # a difference of energies has a few roundings of the largest of them
    np.testing.assert_allclose(drift, run.energy_drift(), rtol=1e-3, atol=1e-14)
    residual = np.abs(y[:, layout.residuals]).max(initial=0.0)
    np.testing.assert_allclose(residual, run.constraint_residual(), rtol=1e-9, atol=1e-15)
    cosines = alignment_cosines_along(run.scene, run.time, run.state, run.inputs, run.parameters)
    np.testing.assert_allclose(y[:, layout.cosines], cosines, rtol=0, atol=1e-15)


def test_the_energies_are_those_of_a_run_with_work_and_a_changing_potential():
    """A damped swing loses energy, so that the absolute values of work and of V - V0 count."""
    run = bc.simulate("planar_2r_tracking", samples=101)
    y = system_of(run.scene).observe(*run._arguments)[:, system_of(run.scene).observed_layout.energies]
    t, v, w = run.kinetic_energy, run.potential_energy, run.work
    assert np.abs(w).max() > 1.0
    np.testing.assert_allclose(y, np.column_stack([t + v - w, t + v + np.abs(w), t - v + np.abs(w)]), rtol=1e-13)
    largest = max(y[:, 1].max() - v[0], y[:, 2].max() + v[0])
    assert largest == pytest.approx((t + np.abs(v - v[0]) + np.abs(w)).max(), rel=1e-13)


def test_rotation_residuals_are_whole_angles():
    """A hinge that is torn open by more than a quarter turn; the sines in its equations fall again beyond that."""
    run = bc.simulate("bricard", samples=11)
    system, state = system_of(run.scene), run.state.copy()
    state[:, 0] += np.linspace(0.0, 2.5, 11)
    torn = replace(run, state=state)
    y = system.observe(*torn._arguments)
    found = np.abs(y[:, system.observed_layout.residuals]).max(axis=1)
    np.testing.assert_allclose(found, torn._position_residuals.max(axis=1), rtol=1e-12)
    assert found[-1] > 1.1 and y[-1, system.observed_layout.cosines].min() < 0.0


@pytest.mark.parametrize("name", ["four_bar", "rolling_disk", "five_bar"])
def test_the_plain_solution_gives_the_same_quantities_where_its_guard_holds(name):
    run = bc.simulate(name, samples=101)
    system = system_of(run.scene)
    guard = system.rhs(*run._arguments)[1][:, 0] > 0.0
    assert guard.mean() > 0.9
    exact, plain = (function(*run._arguments)[guard] for function in (system.observe, system.plain_observe))
    np.testing.assert_allclose(plain, exact, rtol=1e-8, atol=1e-12 * np.abs(exact).max())
