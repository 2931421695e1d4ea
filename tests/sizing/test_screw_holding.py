"""Holding torques and loads of a screw, against all postures on a fine grid and against its closed form."""

import math

import numpy as np
import pytest
from extended_robots import BOLT, diagonal, joint, link

import bellcrank as bc
from bellcrank.sizing.holding_gravity import gravity_holding_torques

LEAD = 0.02  # m per revolution
ARM = "".join(
    [
        '<robot name="arm"><link name="base"/>',
        link("arm", "0.3 0 0", 2.0, diagonal(0.001, 0.06, 0.06)),
        link("carriage", "0 0.05 0.02", 1.5, diagonal(0.002, 0.002, 0.003)),
        joint("lift", "revolute", "base", "arm",
              '<axis xyz="0 1 0"/><limit lower="-1.5" upper="1.5" effort="90" velocity="3"/>'),
        joint("spindle", "screw", "arm", "carriage",
              f'<axis xyz="1 0 0"/><limit lower="-70" upper="{8 * math.pi}" effort="9" velocity="90"/>',
              '<origin xyz="0.4 0 0"/>', f'pitch="{LEAD}"'),
        "</robot>",
    ]
)  # fmt: skip


@pytest.fixture
def arm(tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM)
    return bc.load_robot(tmp_path / "arm.urdf")


@pytest.mark.tier2
@pytest.mark.parametrize("tolerance", [0.0, 0.1])
def test_holding_torques_are_those_of_a_fine_grid(arm, tolerance):
    lift, spindle = np.linspace(-1.5, 1.5, 301), np.linspace(-70.0, 8.0 * math.pi, 4001)
    q = np.stack([x.ravel() for x in np.meshgrid(lift, spindle, indexing="ij")], axis=1)
    torque = np.abs(arm.gravity_torque(q))
    if tolerance:
        still = np.zeros_like(q)
        torque = torque + tolerance * np.abs(arm.link_torques(q, still, still)).sum(axis=1)
    found = gravity_holding_torques(arm, mass_tolerance=tolerance)
    assert found.joints == ("lift", "spindle")
    assert (found.torque >= torque.max(axis=0) - 1e-12).all()
    assert found.torque == pytest.approx(torque.max(axis=0), rel=2e-4)  # the grid's distance from the crest


def test_a_screw_without_limits_is_held_at_zero_and_says_so(tmp_path):
    (tmp_path / "bolt.urdf").write_text(BOLT)
    found = gravity_holding_torques(bc.load_robot(tmp_path / "bolt.urdf"))
    assert found.torque == pytest.approx([0.8 * 9.81 * 0.4 / (2.0 * math.pi)], rel=1e-12)
    assert found.notes == ("joint 'screw' screws without limits: it is held at 0 rad for the holding torques",)


def test_loads_of_a_screw(tmp_path):
    """τ = (I + m h²) α + m g h at the nut; its bearing takes the weight and the thrust, m (g + h α)."""
    (tmp_path / "bolt.urdf").write_text(BOLT)
    robot = bc.load_robot(tmp_path / "bolt.urdf")
    motion = bc.waypoints(robot, [0.0, 1.0, 2.0], [{"screw": 0.0}, {"screw": 3.0}, {"screw": 0.0}])
    sizing = bc.size(robot, [motion])
    h, most = 0.4 / (2.0 * math.pi), motion.acceleration.max()
    found = sizing.joint("screw")
    assert found.kind == "screw"
    assert found.peak_torque == pytest.approx((0.003 + 0.8 * h * h) * most + 0.8 * 9.81 * h, rel=1e-4)
    assert found.peak_bearing_force == pytest.approx(0.8 * (9.81 + h * most), rel=1e-4)
    assert found.largest_inertia == pytest.approx(0.003 + 0.8 * h * h, rel=1e-12)
