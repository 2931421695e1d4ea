"""Rows within a step across a position at which the constraints lose rank."""

import numpy as np
import pytest

import bellcrank as bc
from bellcrank_bench.problems.n_four_bar import START
from bellcrank_bench.textbook.integrate import integrate
from bellcrank_bench.textbook.n_four_bar import NFourBar

SLOWEST, FASTEST = -1.05, -0.95  # rad/s; at -0.95576952 a stage of the dense output meets a flat position


@pytest.fixture(scope="module")
def run():
    return bc.simulate("n_four_bar_2", rtol=1e-10, atol=1e-10, samples=10_001)


@pytest.fixture(scope="module")
def exact(run):
    """Angle of the cranks and its rate at the rows, on the branch with one degree of freedom."""
    return integrate(NFourBar(2).derivative, np.array(START), run.time)


def test_rows_are_as_accurate_as_the_ends_of_steps(run, exact):
    crank = run.robot.joint("crank_0")
    angle, rate = run.position[:, crank.q] - exact[:, 0], run.velocity[:, crank.v] - exact[:, 1]
    assert np.abs(angle).max() < 1e-7
    assert np.abs(rate).max() < 1e-7


def test_the_energy_of_rows_is_that_of_the_run(run):
    energy = run.output("energy")
    assert np.ptp(energy) < 1e-6  # of 36 J


def test_the_largest_coordinate_of_a_crank_that_passes_flat_positions_is_its_length():
    speeds = [-0.95576952, *np.linspace(SLOWEST, FASTEST, 32)]
    found = bc.sweep("n_four_bar_2", {"initial.velocity.crank_0": speeds})
    np.testing.assert_allclose(found.column("largest.B0.x"), 1.0, atol=1e-8)
    np.testing.assert_allclose(found.column("largest.energy"), found.column("end.energy"), rtol=1e-7)
