"""A joint whose acceleration is rounding is not called noisy; one whose acceleration counts is."""

import numpy as np
import pytest

import bellcrank as bc


@pytest.mark.parametrize(("noise", "said"), [(0.0, False), (1e-13, False), (1e-6, True)])
def test_only_noise_that_counts_is_said(noise, said, tmp_path):
    """The shoulder rests but for noise: 1e-13 rad at 10 ms is 1e-8 rad/s² beside 1.8 rad/s² of the elbow."""
    rng, rows = np.random.default_rng(0), ["time [s],shoulder position [rad],elbow position [rad]"]
    for t in np.linspace(0.0, 1.0, 101).tolist():
        rows.append(f"{t!r},{float(0.5 + noise * rng.normal())!r},{float(0.2 * np.sin(3.0 * t))!r}")
    (tmp_path / "n.csv").write_text("\n".join(rows) + "\n")
    motion = bc.read_motion(bc.load_robot("planar_2r"), tmp_path / "n.csv")
    assert any("too noisy" in note for note in motion.notes) is said
