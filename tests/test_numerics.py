"""Linear algebra, profiles and motions at the ends of the range of numbers: answered or refused, at once."""

import math
import re
from functools import partial
from itertools import product

import numpy as np
import pytest

import bellcrank as bc
from bellcrank import numerics
from bellcrank.motion.generators.profile import KINDS, profile

HUGE = (1e-320, 1e-300, 1e-160, 1e-100, 1e-60, 1e60, 1e100, 1e160, 1e300, 1.7e308)


@pytest.mark.parametrize("size", [1e-280, 1e-160, 1.0, 1e160, 1e300])
def test_linear_algebra_is_that_of_the_matrix_of_usual_size_times_its_size(size):
    random = np.random.default_rng(5)
    a, b = random.normal(size=(6, 4)), random.normal(size=6)
    assert numerics.least_squares(a * size, b * size, "it is") == pytest.approx(np.linalg.lstsq(a, b)[0], rel=1e-12)
    values = np.linalg.svd(a, compute_uv=False)
    assert numerics.singular_values(a * size, "it is") / size == pytest.approx(values, rel=1e-12)
    u, found, vt = numerics.svd(a * size, "it is", full=False)
    assert (u * (found / size)) @ vt == pytest.approx(a, rel=1e-12)
    assert numerics.pseudo_inverse(a * size, "it is") * size == pytest.approx(np.linalg.pinv(a), rel=1e-11)
    symmetric = a.T @ a
    assert numerics.eigenvectors(symmetric * size, "it is")[0] / size == pytest.approx(
        np.linalg.eigvalsh(symmetric), rel=1e-11
    )
    assert numerics.length(b * size) / size == pytest.approx(np.linalg.norm(b), rel=1e-12)
    assert numerics.unit(b * size, "it is") == pytest.approx(b / np.linalg.norm(b), rel=1e-12)


def test_linear_algebra_of_usual_numbers_is_numpys_to_the_bit():
    a, b = np.random.default_rng(6).normal(size=(5, 3)), np.arange(5.0)
    assert np.array_equal(numerics.least_squares(a, b, "it is", 1e-10), np.linalg.lstsq(a, b, rcond=1e-10)[0])
    assert np.array_equal(numerics.pseudo_inverse(a, "it is", 1e-8), np.linalg.pinv(a, rcond=1e-8))


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_linear_algebra_refuses_what_is_not_finite_with_the_place(bad):
    a, b = np.eye(3), np.ones(3)
    a[1, 2] = bad
    for call in (numerics.singular_values, numerics.svd, numerics.pseudo_inverse, numerics.eigenvectors):
        with pytest.raises(bc.InputError, match="the place is not finite"):
            call(a, "the place is")
    with pytest.raises(bc.InputError, match="the place is not finite"):
        numerics.least_squares(np.eye(3), a[1], "the place is")
    with pytest.raises(bc.InputError, match="the place is not finite"):
        numerics.least_squares(np.eye(3) * 1e-300, b * 1e300, "the place is")  # the solution overflows


# ---- profiles and motions


def refusal(call, match="", kinds=bc.InputError):
    """What is wrong with how a call is refused: nothing where it raises the error in one sentence that matches."""
    try:
        call()
    except kinds as error:
        text = str(error)
        return "" if re.search(match, text) and "\n" not in text else text
    except Exception as error:
        return repr(error)
    return "it is not refused"


def test_a_profile_far_from_any_machine_is_refused_with_its_limits():
    keys, wrong = ["distance", "duration", "speed", "acceleration", "jerk"], {}
    for kind, value, (k, key) in product(KINDS, HUGE, enumerate(keys)):
        given = {"distance": 1.0, key: value} | ({"duration": 1.0} if key == "distance" else {})
        allowed = {"constant": 3, "trapezoid": 4}.get(kind, 5)
        message = rf"{key} must be from 1e-30 to 1e\+30 .*, got" if k < allowed else ""
        wrong[kind, key, value] = refusal(partial(profile, kind, **given), message)
    assert len(wrong) == len(KINDS) * len(HUGE) * len(keys)
    assert not {case: text for case, text in wrong.items() if text}


@pytest.mark.parametrize("kind", KINDS)
def test_profiles_at_the_limits_have_finite_rows_that_end_where_they_should(kind):
    random = np.random.default_rng(3)
    keys = ["speed", "acceleration", "jerk"][: {"constant": 1, "trapezoid": 2}.get(kind, 3)]
    for _ in range(200):
        distance, duration = (float(random.choice([1e-30, 1e-15, 1.0, 1e15, 1e30])) for _ in range(2))
        limits = {key: float(random.choice([1e-30, 1e-10, 1.0, 1e10, 1e30])) for key in keys if random.random() < 0.6}
        made = profile(kind, distance, **limits) if limits else profile(kind, distance, duration)
        time, s, speed, acceleration = made.rows(21)
        for rows in (time, s, speed, acceleration):
            assert np.isfinite(rows).all()
        assert s[0] == 0.0
        assert s[-1] == distance
        assert np.all(np.diff(s) >= -1e-12 * distance)


@pytest.fixture(scope="module")
def arm():
    return bc.load_robot("planar_2r", gravity=(0.0, -9.81, 0.0))


def test_paths_of_any_time_and_size_end_in_a_motion_or_in_one_sentence(arm):
    """`circle` with a duration of 1e-100 s did not come to an end."""
    circle = {"center": (1.2, 1.2, 0.0), "radius": 0.2, "duration": 10.0, "start": {"elbow": -1.0}, "samples": 11}
    wrong = {}
    for value in HUGE:
        for change in (
            {"duration": value}, {"radius": value}, {"turns": value}, {"center": (value, 1.2, 0.0)},
            {"speed": value, "duration": None},
        ):  # fmt: skip
            if value < 1e-30 and "center" in change:
                continue  # near the middle
            wrong[str(change)] = refusal(partial(bc.circle, arm, "tip", **circle | change), kinds=bc.BellcrankError)
        normal = partial(bc.circle, arm, "tip", **circle | {"normal": (0.0, 0.0, value)})
        if 1e-12 < value <= 1e100:  # a direction as good as any
            assert normal().position.shape == (11, 2)
        else:
            wrong[f"normal {value}"] = refusal(normal, "normal")
    assert not {case: text for case, text in wrong.items() if text}


@pytest.mark.parametrize(("solver", "atol"), [("DOP853", 1e-300), ("Radau", 5e-324)])
def test_a_tolerance_of_nothing_is_one_of_relative_error(solver, atol):
    run = bc.simulate("pendulum", 0.2, solver=solver, atol=atol, max_evaluations=200_000)
    assert run.success
    fine = bc.simulate("pendulum", 0.2, solver=solver, rtol=1e-11, atol=1e-11)
    assert run.position[-1] == pytest.approx(fine.position[-1], abs=1e-7)


def test_the_shortest_duration_that_there_is_has_a_summary():
    run = bc.simulate("pendulum", 5e-324, max_evaluations=10_000)
    assert run.success
    assert "finished at 4.94065646e-324 s" in run.table()


def test_a_step_limit_that_time_cannot_resolve_allows_no_step():
    """At the start of time ten spacings of its numbers, the least step of Radau, are 4.9e-323 s."""
    run = bc.simulate("pendulum", 1e-3, solver="Radau", first_step=10 * 5e-324, max_step=5e-324, max_evaluations=1000)
    assert run.status == "step_too_small"
    assert run.statistics.steps == 0
