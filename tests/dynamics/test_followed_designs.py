"""Motions of many designs of a linkage at once (posture_search.py, loop_kinematics.py)."""

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.motion.motion import Motion


def crank_turn(linkage: Linkage, angles: list[float]) -> Motion:
    """The crank's angles, rad, one a second."""
    robot, time = linkage.robot, np.arange(float(len(angles)))
    position, rest = np.zeros((len(angles), robot.nq)), np.zeros((len(angles), robot.nv))
    position[:, robot.joint("crank").q] = angles
    return Motion(robot.joints, time, position, rest, rest, "turn", ())


def with_crank(length: float) -> Linkage:
    overrides = {
        "initial.crank": "40 deg", "initial.coupler": {"guess": "300 deg"}, "initial.rocker": {"guess": "60 deg"},
        "parameters.crank_length": length,
    }  # fmt: skip
    return Linkage(bc.load_scene("four_bar", overrides))


def test_each_design_moves_as_it_does_alone() -> None:
    linkage = with_crank(1.2)
    motion, joints = crank_turn(linkage, np.linspace(0.7, 2.0, 30).tolist()), (linkage.robot.joint("crank"),)
    alone = [with_crank(length).kinematics for length in (1.15, 1.2, 1.3)]
    start = np.stack([one.start for one in alone] + [np.full(linkage.robot.nq, np.nan)])
    parameters = np.stack([one.scene.parameter_values for one in [*alone, alone[0]]])
    found = linkage.kinematics.follow_designs(motion, joints, start, parameters)
    assert found.followed.tolist() == [True, True, True, False]
    for k, one in enumerate(alone):
        single = one.follow(motion, joints)
        np.testing.assert_allclose(found.position[k], single.position, rtol=0, atol=1e-12)
        np.testing.assert_allclose(found.velocity[k], single.velocity, rtol=0, atol=1e-12)
        np.testing.assert_allclose(found.acceleration[k], single.acceleration, rtol=0, atol=1e-11)
        again = linkage.kinematics.follow_designs(motion, joints, start[k : k + 1], parameters[k : k + 1])
        assert np.array_equal(again.position[0], found.position[k])


def test_where_a_motion_cannot_be_followed() -> None:
    kinematics = (linkage := with_crank(1.6)).kinematics
    joints, start = (linkage.robot.joint("crank"),), float(np.radians(40.0))
    with pytest.raises(bc.UnreachableError, match=r"at 1 s: joint 'crank' moves by 6000 rad.*at most 5000"):
        kinematics.follow(crank_turn(linkage, [start, start + 6000.0]), joints)
    unreachable = crank_turn(linkage, [start, 0.5 * np.pi, np.pi])  # the crank is too long to turn this far
    with pytest.raises(
        bc.UnreachableError, match=r"at 2 s: .* up to crank 2\.\d+ but no further towards crank 2\.\d+;"
    ):
        kinematics.follow(unreachable, joints)
    p, q = kinematics.scene.parameter_values[None], kinematics.start[None]
    assert not kinematics.follow_designs(unreachable, joints, q, p).followed.any()
