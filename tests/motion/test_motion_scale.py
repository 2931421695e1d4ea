"""Motions and tables of extreme numbers: refused in one sentence, or finite all through, without a warning of numpy."""

import math
import random
import warnings

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.elements.force_table import read_table, table_signal
from bellcrank.errors import InputError
from bellcrank.motion.generators.waypoints import waypoints
from bellcrank.motion.limit_checks import LARGEST, LONGEST, SHORTEST, check_times
from bellcrank.motion.motion import Motion
from bellcrank.motion.sampled.csv_file import read_motion
from bellcrank.motion.sampled.quintic_splines import quintic


@pytest.fixture(scope="module")
def arm():
    return bc.load_robot("planar_2r")


def rows(draw, columns):
    """A CSV motion whose numbers span what doubles can hold."""
    size = draw.choice([1.0, 1e6, 1e25, 1e29, 1e40, 1e150, 1e300])
    span = draw.choice([1e-310, 1e-100, 1e-21, 1e-18, 1e-6, 1.0, 1e9, 1e28, 1e100, 1e308])
    count = draw.choice([2, 3, 5, 8, 30])
    time = sorted(draw.uniform(0.0, 1.0) for _ in range(count)) if draw.random() < 0.5 else np.linspace(0, 1, count)
    lines = ["time [s]," + ",".join(columns)]
    for t in time:
        cells = [draw.choice([-1, 0, 1, draw.random()]) * size for _ in columns]
        lines.append(",".join(repr(float(x)) for x in (t * span, *cells)))
    return "\n".join(lines) + "\n"


POSITIONS = ["shoulder position [rad]", "elbow position [rad]"]
SPEEDS = ["shoulder velocity [rad/s]", "elbow velocity [rad/s]"]
RATES = ["shoulder acceleration [rad/s^2]", "elbow acceleration [rad/s^2]"]


def test_a_motion_of_any_numbers_is_refused_or_finite_without_a_warning(arm, tmp_path):
    draw, read = random.Random(17), 0
    for k in range(150):
        columns = draw.choice([POSITIONS, POSITIONS + SPEEDS, POSITIONS + SPEEDS + RATES])
        text = rows(draw, columns)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                motion = read_motion(arm, tmp_path / f"m{k}.csv", text=text)
            except InputError as error:
                assert "\n" not in str(error) and len(str(error)) < 600
                continue
            read += 1
            times = np.linspace(motion.time[0], motion.time[-1], 23)
            for values in (motion.position, motion.velocity, motion.acceleration, *motion.at(times)):
                assert np.isfinite(values).all()
    assert read > 30


@pytest.mark.parametrize(
    ("times", "words"),
    [
        ("0 1e308", "expected at most"),
        ("-1e308 1e308", "expected at most"),
        ("0 1e-320 1", "rows 1 and 2 are 1e-320 s apart"),
        ("0 1 1e50", r"time 1e\+50 s in row 3: expected at most 1e\+30 s"),
    ],
)
def test_times_that_no_motion_has_are_refused_with_their_row(arm, tmp_path, times, words):
    lines = ["time [s]," + ",".join(POSITIONS), *(f"{t},0.1,0.{k}" for k, t in enumerate(times.split()))]
    (tmp_path / "m.csv").write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match=words):
        read_motion(arm, tmp_path / "m.csv")
    with pytest.raises(InputError, match=words):
        waypoints(arm, [float(t) for t in times.split()], [[0.0, 0.1 * k] for k, _ in enumerate(times.split())])
    table = "time [s],shoulder torque [N m]\n" + "".join(f"{t},{k}\n" for k, t in enumerate(times.split()))
    with pytest.raises(InputError, match=words):
        read_table(tmp_path / "t.csv", table, "shoulder torque", "N m")


@pytest.mark.parametrize("cell", ["1_0", "٣", "²", "0x1p3", "nan", "inf", "1e400", ""])
def test_a_cell_that_is_no_plain_number_is_refused_with_its_line(arm, tmp_path, cell):
    text = f"time [s],{','.join(POSITIONS)}\n0,0,0\n1,{cell},0\n2,0,0\n"
    with pytest.raises(InputError, match=r"line 3, column 'shoulder position \[rad\]'"):
        read_motion(arm, tmp_path / "m.csv", text=text)
    with pytest.raises(InputError, match="line 3, column 'shoulder torque"):
        table = f"time [s],shoulder torque [N m]\n0,0\n1,{cell}\n2,0\n"
        read_table(tmp_path / "t.csv", table, "shoulder torque", "N m")


def test_a_table_within_the_limits_has_finite_slopes(tmp_path):
    text = f"time [s],shoulder torque [N m]\n0,{-LARGEST[0]}\n{2 * SHORTEST},{LARGEST[0]}\n{LONGEST},0\n"
    time, torque = read_table(tmp_path / "t.csv", text, "shoulder torque", "N m")
    signal, _ = table_signal(time, torque[:, None], "linear")
    assert np.isfinite(signal.coefficients).all()
    with pytest.raises(InputError, match="expected at most"):
        read_table(tmp_path / "t.csv", text.replace(str(LARGEST[0]), "1e31"), "shoulder torque", "N m")


def test_arrays_of_a_motion_are_limited_as_those_of_a_file(arm):
    still = np.zeros((2, 2))
    time = np.array([0.0, 1.0])
    for k, key in enumerate(("position", "velocity", "acceleration")):
        for size, good in ((LARGEST[k], True), (10.0 * LARGEST[k], False)):
            values = [still, still, still]
            values[k] = np.array([[0.0, 0.0], [size, 0.0]])
            if good:
                assert Motion(arm.joints, time, *values).position.shape == (2, 2)
            else:
                with pytest.raises(InputError, match=f"{key} .* in row 2"):
                    Motion(arm.joints, time, *values)
    check_times("t", np.array([0.0, 0.0, SHORTEST, 1.0]))
    assert math.isfinite(LARGEST[2] ** 2 * LONGEST**2)


@pytest.mark.parametrize("step", [1e-300, 1e-200, 1e-155, 1e-153, 1e-9, 1.0])
def test_between_rows_however_close_a_parabola_has_its_own_slope_and_curvature(step):
    """x = 3 t + 4 t²/2, of which the quintic between two rows is the parabola itself; 1e-155² underflows."""
    knots = np.array([0.0, step])
    at = np.array([0.0, 0.25, 0.5, 1.0]) * step

    def parabola(t):
        return np.stack([3.0 * t + 2.0 * t * t, 3.0 + 4.0 * t, np.full(t.shape, 4.0)])[:, :, None]

    with np.errstate(all="raise", under="ignore"):
        x, slope, curvature = quintic(knots, *parabola(knots), at)
    exact = parabola(at)
    np.testing.assert_allclose(x, exact[0], rtol=1e-13)
    np.testing.assert_allclose(slope, exact[1], rtol=1e-13)
    if step == 1.0 or step < 1e-154:  # else a rounding of the slope, over the step, is as large as the curvature
        np.testing.assert_allclose(curvature, exact[2], rtol=1e-12)
    assert np.isfinite(curvature).all()
