"""The motors' shares of joint forces by virtual power against those by singular values, and the torques they give."""

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.dynamics.inverse import motor_shares as module
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.dynamics.inverse.mechanism import mechanism_of
from bellcrank.dynamics.inverse.motor_shares import motor_shares, torque_shares

pytestmark = pytest.mark.tier2

MOTIONS = {"delta": "pick", "planar_delta": "pick", "five_bar": "pick", "four_bar": "unfold"}


@pytest.mark.parametrize("name", MOTIONS)
def test_shares_of_determined_joints_are_those_of_the_singular_values(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    linkage = mechanism_of(bc.load_scene(name))
    assert isinstance(linkage, Linkage)
    motion = linkage.motion(MOTIONS[name])
    t, q = motion.time[::50], motion.position[::50]
    jacobian = linkage.kinematics.jacobian(t, q)
    expected = motor_shares(linkage, q, jacobian, t).torques

    def refuse(*_: object) -> None:
        raise AssertionError("singular values are not needed here")

    monkeypatch.setattr(module, "motor_shares", refuse)
    np.testing.assert_allclose(
        torque_shares(linkage, q, jacobian, t), expected, rtol=0.0, atol=1e-12 * np.abs(expected).max()
    )


@pytest.mark.parametrize("off", [0.0, 1e-9])
def test_motors_at_a_dead_point_are_refused_as_with_singular_values(off: float) -> None:
    linkage = Linkage(bc.load_scene("four_bar"))
    motion = linkage.motion("unfold")
    t, q = motion.time[:3], motion.position[:3]
    jacobian = linkage.kinematics.jacobian(t, q).copy()
    others = np.setdiff1d(np.arange(linkage.robot.nv), linkage.motor_columns)
    jacobian[1, 0, others] = jacobian[1, 1, others] * (1.0 + off)
    with pytest.raises(bc.UnreachableError, match=f"cannot move .* at {t[1]:.6g} s"):
        torque_shares(linkage, q, jacobian, t)


@pytest.mark.parametrize("name", MOTIONS)
def test_the_map_of_joint_forces_gives_the_torques_of_the_motion(name: str) -> None:
    linkage = mechanism_of(bc.load_scene(name))
    motion = linkage.along(MOTIONS[name])[0]
    t, q, v, a = (each[::50] for each in (motion.time, motion.position, motion.velocity, motion.acceleration))
    expected = linkage.torques(t, q, v, a)[0]
    found = linkage.torque_map(t, q)(linkage.equations.needed(t, q, v, a))
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max())
