"""The order of modes, and their picture: what grows comes first, and every eigenvalue is where it is drawn."""

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.analysis.root_locus_plot import plot_eigenvalues


def marks(figure):
    """The points that are drawn as crosses, in ascending order."""
    found = [complex(*line.get_xydata()[0]) for line in figure.axes[0].lines if line.get_marker() == "x"]
    return np.sort_complex(found)


@pytest.mark.parametrize(("scene", "scale"), [("furuta", "symlog"), ("two_wheeler", "linear"), ("pendulum", "linear")])
def test_every_eigenvalue_is_drawn_with_its_conjugate(scene, scale):
    linear = bc.linearise(scene)
    figure = plot_eigenvalues(linear)
    values = {mode.eigenvalue for mode in linear.modes}
    expected = np.sort_complex(list(values | {value.conjugate() for value in values}))
    np.testing.assert_array_equal(marks(figure), expected)
    assert figure.axes[0].get_xscale() == scale
    numbers = {int(part) for text in figure.axes[0].texts for part in text.get_text().split(", ") if part.isdigit()}
    assert numbers == set(range(1, len(linear.modes) + 1))


def test_modes_that_grow_come_first_and_fast_ones_after_slow_ones():
    real = [mode.eigenvalue.real for mode in bc.linearise("furuta").modes if not mode.symmetry]
    growing = [value > 0.0 for value in real]
    assert growing == sorted(growing, reverse=True) and any(growing) and not all(growing)
    assert real[: sum(growing)] == sorted(real[: sum(growing)])
