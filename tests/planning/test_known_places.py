"""Places of a path whose states and torques are kept give the same results as those that are computed anew."""

import numpy as np
import pytest
from numpy.typing import NDArray

import bellcrank as bc
from bellcrank.dynamics.inverse.mechanism import mechanism_of
from bellcrank.planning import fastest_pass
from bellcrank.planning.fastest_pass import fastest_refined
from bellcrank.planning.joint_path import JointPath, joint_path, paths_of_motion
from bellcrank.planning.limits.motion_limits import MotionLimits
from bellcrank.planning.limits.path_limits import PathLimits
from bellcrank.planning.limits.path_torques import KnownPlaces, PathPlaces

Array = NDArray[np.float64]
TORQUES = {"shoulder": 40.0, "elbow": 15.0}


def arm() -> tuple[JointPath, PathLimits]:
    """A 2R arm with viscous and Coulomb friction, along a path on which both joints turn around."""
    robot = bc.load_robot("planar_2r", friction={"shoulder": (0.5, 1.0), "elbow": (0.2, 0.4)})
    path = joint_path(robot, [{}, {"elbow": 1.0, "shoulder": 0.5}, {"elbow": -0.5}, {"shoulder": -0.7}])
    return path, PathLimits(mechanism_of(robot), {}, MotionLimits(speed="none", torque=TORQUES))


def linkage() -> tuple[JointPath, PathLimits]:
    """A five-bar robot along a part of its motion."""
    config = bc.load_scene("five_bar").config
    mechanism = mechanism_of(bc.load_scene("five_bar"))
    path = paths_of_motion(mechanism.along("pick")[0])[0]
    return path, PathLimits(mechanism, config.actuators, MotionLimits())


def test_every_place_is_computed_once() -> None:
    asked: list[float] = []
    path, limits = arm()

    def compute(s: Array) -> PathPlaces:
        asked.extend(s.tolist())
        return limits.places(path, s)

    known = KnownPlaces(compute)
    every = np.linspace(0.0, path.length, 33)
    for wanted in (every[::8], every[::4], every[4:20], every, every[::-1]):
        found, anew = known.at(wanted), limits.places(path, wanted)
        for own, other in zip(found._arrays, anew._arrays, strict=True):
            np.testing.assert_array_equal(own, other)
    assert sorted(asked) == every.tolist()


@pytest.mark.tier2
@pytest.mark.parametrize("case", [arm, linkage])
def test_the_motion_is_the_same_without_kept_places(case: object, monkeypatch: pytest.MonkeyPatch) -> None:
    assert callable(case)
    path, limits = case()
    kept = fastest_refined(path, limits)

    class Forgetful(KnownPlaces):
        def at(self, s: Array) -> PathPlaces:
            return self._compute(s)

    monkeypatch.setattr(fastest_pass, "KnownPlaces", Forgetful)
    anew = fastest_refined(path, limits)
    np.testing.assert_allclose(kept.s, anew.s, rtol=1e-15)
    assert kept.duration == pytest.approx(anew.duration, rel=1e-12)


def test_a_joint_that_stands_still_up_to_rounding_has_no_turning_points() -> None:
    path, _ = arm()
    turns = path.turning_points()
    rates = path.spline(turns, 1)
    assert len(turns) >= 2
    assert np.min(np.abs(rates), axis=1) == pytest.approx(0.0, abs=1e-13)

    def trembling(s: Array, order: int) -> Array:
        found = path.spline(s, order).copy()
        found[:, 0] = 1e-12 * np.sin(1e6 * s)
        return found

    still = JointPath(path.joints, path.length, trembling, path.knots)
    elbow = [s for s, rate in zip(turns, rates, strict=True) if abs(rate[1]) < 1e-12]
    np.testing.assert_allclose(still.turning_points(), elbow, rtol=1e-12)
