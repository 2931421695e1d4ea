"""Motions sampled in CSV files: between the rows the acceleration is what the columns say, jumps included.

The exact motions are those of `profile` (piecewise polynomials), a bang-bang motion, a sine, and a move after a dwell.
"""

from __future__ import annotations

import numpy as np
import pytest

import bellcrank
from bellcrank.motion.generators.profile import profile
from bellcrank.motion.motion import Motion
from bellcrank.motion.sampled.acceleration_jumps import with_jumps
from bellcrank.motion.sampled.csv_file import read_motion, write_motion
from bellcrank.motion.sampled.file_checks import rounding_of
from bellcrank.motion.sampled.sampled_motion import smooth_pieces

ELBOW = -0.7  # the elbow moves by this share of the shoulder
TELLS = ("too far apart", "does not agree", "rounded to", "rests on interpolation")


@pytest.fixture(scope="module")
def arm():
    return bellcrank.load_robot("planar_2r", gravity=(0, -9.81, 0))


def bang_bang(t):
    late = t >= 0.5
    return (
        np.where(late, 1.0 - 2.0 * (1.0 - t) ** 2, 2.0 * t * t),
        np.where(late, 4.0 * (1.0 - t), 4.0 * t),
        np.where(late, -4.0, 4.0),
    )


def dwell_and_move(t):
    moving = t > 0.2137
    s, v, a = profile("trapezoid", 1.0, 1.0).at(np.clip(t - 0.2137, 0.0, None))
    return np.where(moving, s, 0.0), np.where(moving, v, 0.0), np.where(moving, a, 0.0)


def sine(t):
    w = 2.0 * np.pi
    return 0.5 * (1.0 - np.cos(w * t)), 0.5 * w * np.sin(w * t), 0.5 * w * w * np.cos(w * t)


SHAPES = {
    "trapezoid": profile("trapezoid", 1.0, 1.0).at,
    "s_curve": profile("s_curve", 1.0, 1.0).at,
    "bang-bang": bang_bang,
    "dwell and move": dwell_and_move,
    "sine": sine,
}


def times(dt):
    if dt == "uneven":
        t = np.cumsum(np.random.default_rng(3).uniform(0.004, 0.02, 300))
        return np.concatenate([[0.0], t[t < 0.99], [1.0]])
    return np.arange(round(1.0 / dt) + 1) * dt


def columns(t, shape, kinds):
    """Header and numbers (n, …) of a CSV file with the first `kinds` of position, velocity and acceleration."""
    names, units = ("position", "velocity", "acceleration"), ("rad", "rad/s", "rad/s^2")
    header, rows = ["time [s]"], [t]
    for k, values in enumerate(SHAPES[shape](t)[:kinds]):
        header += [f"shoulder {names[k]} [{units[k]}]", f"elbow {names[k]} [{units[k]}]"]
        rows += [values, ELBOW * values + (0.3 if k == 0 else 0.0)]
    return header, np.column_stack(rows)


def written(path, header, rows, digits=None):
    number = repr if digits is None else f"{{:.{digits}f}}".format
    lines = [",".join([repr(row[0]), *map(number, row[1:])]) for row in rows.tolist()]
    path.write_text("\n".join([",".join(header), *lines]) + "\n", encoding="utf-8")
    return path


def exact_motion(shape):
    """The exact motion at many times, none of them at a jump."""
    fine = (np.arange(6000) + 0.37) / 6000
    return fine, SHAPES[shape](fine)


def torques(arm, s, v, a):
    q, qd, qdd = (np.stack([x, ELBOW * x], axis=1) for x in (s, v, a))
    q[:, 1] += 0.3
    return arm.inverse_dynamics(q, qd, qdd)


@pytest.mark.tier2
@pytest.mark.parametrize("dt", [0.001, 0.005, 0.02, 0.05, "uneven"])
@pytest.mark.parametrize("kinds", [1, 2, 3], ids=["p", "pv", "pva"])
@pytest.mark.parametrize("shape", list(SHAPES))
def test_peak_acceleration_and_torque_are_those_of_the_exact_profile_or_told(arm, tmp_path, shape, kinds, dt):
    file = written(tmp_path / "m.csv", *columns(times(dt), shape, kinds))
    motion = read_motion(arm, file)
    fine, exact = exact_motion(shape)
    peak = np.abs(torques(arm, *exact)).max(axis=0)
    _, _, acceleration = motion.at(fine)
    found = max(np.abs(acceleration[:, 0]).max(), np.abs(motion.acceleration[:, 0]).max())
    sizing = bellcrank.size(arm, motion)
    sized = np.array([joint.peak_torque for joint in sizing.joints])
    told = any(word in warning for word in TELLS for warning in sizing.warnings)
    assert not any("does not agree" in warning for warning in sizing.warnings)
    if kinds == 3 or (dt != 0.05 and shape != "s_curve"):
        assert not any("too far apart" in warning for warning in sizing.warnings)
        assert found == pytest.approx(np.abs(exact[2]).max(), rel=0.02)
        assert sized == pytest.approx(peak, rel=0.02)
    assert told or (abs(found / np.abs(exact[2]).max() - 1.0) <= 0.02 and np.all(np.abs(sized / peak - 1.0) <= 0.02))


@pytest.mark.parametrize("shape", ["trapezoid", "bang-bang", "dwell and move"])
def test_a_jump_is_found_where_it_is_and_positions_are_the_integral_of_accelerations(arm, tmp_path, shape):
    motion = read_motion(arm, written(tmp_path / "m.csv", *columns(times(0.02), shape, 3)))
    jumps = {
        "trapezoid": [1 / 3, 2 / 3],
        "bang-bang": [0.5],
        "dwell and move": [0.2137, 0.2137 + 1 / 3, 0.2137 + 2 / 3],
    }[shape]
    twins = motion.time[1:][np.diff(motion.time) == 0.0]
    assert twins == pytest.approx(jumps, abs=1e-9)
    for rows in motion.pieces:  # within a piece everything is smooth: Gauss-Legendre integrates it exactly
        low, high = motion.time[rows][:-1], motion.time[rows][1:]
        nodes, weights = np.polynomial.legendre.leggauss(4)
        at = 0.5 * (low + high)[:, None] + 0.5 * (high - low)[:, None] * nodes
        _, v, a = (x.reshape(*at.shape, -1) for x in motion.at(at.ravel()))
        half = 0.5 * (high - low)[:, None]
        assert np.einsum("nkj,k->nj", a, weights) * half == pytest.approx(
            np.diff(motion.velocity[rows], axis=0), abs=1e-12
        )
        assert np.einsum("nkj,k->nj", v, weights) * half == pytest.approx(
            np.diff(motion.position[rows], axis=0), abs=1e-12
        )


def test_smooth_samples_keep_their_order_of_accuracy_and_get_no_rows(arm, tmp_path):
    """The acceleration between exact samples of a sine is off by h⁴ ω⁶/1920 at most (quintic Hermite): order 4."""
    errors = []
    for dt in (0.02, 0.01):
        motion = read_motion(arm, written(tmp_path / "m.csv", *columns(times(dt), "sine", 3)))
        assert len(motion) == len(times(dt))
        fine = np.linspace(0.0, 1.0, 9001)
        errors.append(np.abs(motion.at(fine)[2][:, 0] - sine(fine)[2]).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.1)
    for kinds, bound in ((1, 1e-7), (2, 1e-9), (3, 1e-9)):
        motion = read_motion(arm, written(tmp_path / "m.csv", *columns(times(0.001), "sine", kinds)))
        fine = np.linspace(0.0, 1.0, 9001)
        assert len(motion) == 1001 and not any("too far" in note for note in motion.notes)
        assert np.abs(motion.at(fine)[2][:, 0] - sine(fine)[2]).max() < bound * 20.0


def test_a_bundled_circle_comes_back_bit_for_bit(arm, tmp_path):
    motion = bellcrank.circle(arm, "tip", (1.2, 1.2, 0), 0.2, 10, start={"elbow": -1.0})
    back = read_motion(arm, write_motion(motion, tmp_path / "circle.csv"))
    for key in ("time", "position", "velocity", "acceleration"):
        assert np.array_equal(getattr(motion, key), getattr(back, key))


@pytest.mark.parametrize("shape", list(SHAPES))
@pytest.mark.parametrize("dt", [0.001, 0.005, 0.02, 0.05])
@pytest.mark.parametrize("kinds", [2, 3], ids=["pv", "pva"])
def test_six_decimals_make_no_jumps(arm, tmp_path, shape, dt, kinds):
    """Rounding by 5e-7 rad at 1 kHz is 6 δ/h² = 3 rad/s² in the quintic: within what the file says it is settled."""
    file = written(tmp_path / "m.csv", *columns(times(dt), shape, kinds), digits=6)
    motion = read_motion(arm, file)
    fine, exact = exact_motion(shape)
    q, _, acceleration = motion.at(fine)
    scale = np.abs(exact[2]).max()
    told = any(word in note for word in TELLS for note in motion.notes)
    assert told == (dt == 0.05 and shape == "s_curve" and kinds == 2)
    assert np.abs(acceleration[:, 0]).max() < (1.04 if told else 1.02) * scale
    if not told:
        # the ramps of the s_curve take 1.7 steps of 50 ms: its corners are known to the quintic's error only
        assert np.abs(q[:, 0] - exact[0]).max() < (1e-5 if dt == 0.05 else 3e-6)
        assert np.sqrt(np.mean((acceleration[:, 0] - exact[2]) ** 2)) < 0.005 * scale


@pytest.mark.parametrize("shape", ["sine", "trapezoid", "s_curve"])
def test_positions_of_six_decimals_at_1_khz_are_differentiated_over_longer_steps(arm, tmp_path, shape):
    file = written(tmp_path / "m.csv", *columns(times(0.001), shape, 1), digits=6)
    motion = read_motion(arm, file)
    assert any(
        "positions are rounded to 1e-06, too much for accelerations over steps of 0.001 s" in n for n in motion.notes
    )
    fine, exact = exact_motion(shape)
    q, _, acceleration = motion.at(fine)
    assert np.abs(acceleration[:, 0]).max() == pytest.approx(np.abs(exact[2]).max(), rel=0.02)
    assert np.abs(q[:, 0] - exact[0]).max() < 3e-6
    assert np.all(np.isin(times(0.001), motion.time))


@pytest.mark.tier2
@pytest.mark.parametrize("samples", [1001, 201, 101, 51])
def test_a_bang_bang_run_sized_from_its_own_file_has_the_torques_it_was_driven_by(tmp_path, samples):
    (tmp_path / "a.csv").write_text("time [s],shoulder torque [N m]\n0,200\n0.5,-200\n1,-200\n", encoding="utf-8")
    (tmp_path / "b.csv").write_text("time [s],elbow torque [N m]\n0,60\n0.37,-60\n0.81,60\n1,60\n", encoding="utf-8")
    (tmp_path / "s.yaml").write_text(
        """
name: bang
urdf: planar_2r
gravity: [0, 0, 0]
forces:
  - {kind: torque, joint: shoulder, file: a.csv, interpolation: hold}
  - {kind: torque, joint: elbow, file: b.csv, interpolation: hold}
simulate: {duration: 1.0}
""",
        encoding="utf-8",
    )
    run = bellcrank.simulate(tmp_path / "s.yaml", samples=samples)
    motion = read_motion(run.robot, run.to_csv(tmp_path / "run.csv"))
    sizing = bellcrank.size(run.robot, motion)
    assert [joint.peak_torque for joint in sizing.joints] == pytest.approx([200.0, 60.0], rel=0.02)
    assert not any("rests on interpolation" in warning for warning in sizing.warnings)


def test_torques_that_only_interpolation_makes_are_told_beside_those_at_the_rows(arm):
    """One quintic from rest to rest: its rows hold the arm, all acceleration lies between them."""
    rest = np.zeros((2, 2))
    motion = Motion(arm.joints, np.array([0.0, 0.5]), np.array([[0.0, 0.0], [1.0, 1.0]]), rest, rest, "one step")
    sizing = bellcrank.size(arm, motion)
    shoulder = sizing.joint("shoulder")
    held = np.abs(np.asarray(arm.inverse_dynamics(motion.position, rest, rest))).max(axis=0)[0]
    assert shoulder.sampled_torque == pytest.approx(held)
    assert shoulder.peak_torque > 1.02 * held
    lines = str(sizing).splitlines()
    first = next(k for k, line in enumerate(lines) if line.split()[1:4] == ["peak", "at", "rows"])
    cells = next(line.split() for line in lines[first:] if line.startswith("shoulder"))
    assert float(cells[1]) == pytest.approx(held, rel=1e-3)
    assert any(
        f"joint 'shoulder': its peak of {shoulder.peak_torque:.4g} N m lies between two rows" in warning
        and f"at the rows it is {held:.4g} N m" in warning
        for warning in sizing.warnings
    )


@pytest.mark.parametrize("factor", [180.0 / np.pi, 0.0, -1.0])
def test_accelerations_that_contradict_the_velocities_are_told(arm, tmp_path, factor):
    header, rows = columns(times(0.01), "sine", 3)
    rows[:, 6] *= factor
    notes = read_motion(arm, written(tmp_path / "m.csv", header, rows)).notes
    assert any("the acceleration of joint 'elbow' does not agree with its velocity" in note for note in notes)
    assert not any("of joint 'shoulder'" in note for note in notes)


@pytest.mark.parametrize(("acceleration", "told"), [(3e-7, False), (3e-3, True)])
def test_accelerations_of_a_joint_at_rest_that_cannot_be_seen_in_its_position_are_not_told(
    arm, tmp_path, acceleration, told
):
    header, rows = columns(times(0.01), "sine", 3)
    rows[:, [2, 4]] = 0.0
    rows[:, 6] = acceleration * np.sin(40.0 * rows[:, 0])
    notes = read_motion(arm, written(tmp_path / "m.csv", header, rows)).notes
    assert any("the acceleration of joint 'elbow' does not agree" in note for note in notes) == told


def test_a_jump_at_a_row_is_found_whatever_side_the_row_is_of(arm):
    """A row at the time of the jump may have the acceleration before it, after it or the mean of both."""
    t = np.linspace(0.0, 1.0, 21)
    s, v, a = bang_bang(t)
    for value in (4.0, -4.0, 0.0):
        a[10] = value
        rest = np.zeros_like(t)
        motion = with_jumps(
            Motion(arm.joints, t, np.stack([s, rest], 1), np.stack([v, rest], 1), np.stack([a, rest], 1))
        )
        fine = np.linspace(0.0, 1.0, 5001)
        assert motion.at(fine)[0][:, 0] == pytest.approx(bang_bang(fine)[0], abs=1e-9)
        assert np.abs(motion.at(fine)[2]).max() == pytest.approx(4.0, abs=1e-6)


def test_pieces_are_cut_where_a_derivative_jumps_and_nowhere_else():
    t = np.linspace(0.0, 1.0, 41)
    assert smooth_pieces(t, np.sin(7.0 * t), 2, 0.0) == [slice(0, 41)]
    corner = np.where(t < 0.51, 0.0, 3.0 * (t - 0.51)) + np.sin(2.0 * t)
    assert smooth_pieces(t, corner, 1, 0.0) == [slice(0, 21), slice(21, 41)]
    bend = np.where(t < 0.51, 0.0, 3.0 * (t - 0.51) ** 2) + np.sin(2.0 * t)
    assert smooth_pieces(t, bend, 2, 0.0) == [slice(0, 21), slice(21, 41)]


def test_rounding_is_half_of_the_last_decimal_of_the_largest_numbers():
    rng = np.random.default_rng(5)
    values = rng.normal(size=500)
    assert rounding_of([np.round(values, 6)]) == pytest.approx(5e-7)
    assert rounding_of([values]) == 0.0
    assert rounding_of([np.array([float(f"{value:.6g}") for value in values])]) == pytest.approx(5e-6, rel=0.01)
    assert rounding_of([np.zeros(5)]) == 0.0


@pytest.mark.parametrize("samples", [51, 201, 401])
def test_a_smooth_run_with_few_rows_gets_no_jumps(samples):
    """A swinging arm whose elbow snaps over: accelerations change by their own size within a row, yet smoothly."""
    run = bellcrank.simulate("planar_2r", duration=3.0, samples=samples, overrides={"initial": {"shoulder": 1.0}})
    assert np.abs(run.acceleration).max() > 20.0
    motion = Motion(run.robot.joints, run.time, run.position, run.velocity, run.acceleration, "run")
    assert with_jumps(motion) is motion
