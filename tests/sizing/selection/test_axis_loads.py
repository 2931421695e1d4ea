"""Loads of axes along cycles, and their change with the masses of actuators, against inverse dynamics."""

import numpy as np
import pinocchio as pin
import pytest

import bellcrank as bc
from bellcrank.sizing.joint_loads import JointLoads
from bellcrank.sizing.selection.axis_loads import AddedMass
from bellcrank.sizing.selection.axis_loads_of import axis_loads
from bellcrank.sizing.selection.load_cycles import planned_cycles
from bellcrank.sizing.size import mechanism_and_motions
from tests.support.actuator_bodies import payload_at_joint


def mechanism_of(name, payloads=()):
    config = bc.load_robot_config(name)
    return mechanism_and_motions(config, config.robot(payloads))


def added_to(axes):
    """A different body for each axis; each inertia is one that a rigid body can have."""
    return {
        axis.name: AddedMass(mass=0.4 + 0.3 * k, axial_inertia=0.004 + 0.001 * k, transverse_inertia=0.003 + 0.002 * k)
        for k, axis in enumerate(axes)
    }


def assert_same_cycles(found, expected, tolerance=1e-9):
    assert len(found) == len(expected)
    for one, other in zip(found, expected, strict=True):
        for key in ("torque", "static_torque", "axial_force", "tilting_moment", "inertia", "speed", "acceleration"):
            a, b = getattr(one, key), getattr(other, key)
            assert a.shape == b.shape, key
            assert np.abs(a - b).max() <= tolerance * max(1.0, np.abs(b).max()), key


def resampled(loads, mechanism, names):
    """Loads of another mechanism at the very samples of `loads` (its own grid may be divided elsewhere)."""
    from bellcrank.sizing.selection.body_loads import LoadModel
    from bellcrank.sizing.selection.mounted_bodies import MountKinematics, States

    model = LoadModel(MountKinematics(mechanism, {n: n for n in names}, {}), np.eye(len(names)))
    return model, States


@pytest.mark.parametrize("name", ["planar_2r", "ur5", "geared_pendulum", "four_bar", "five_bar"])
def test_added_masses_give_the_loads_of_a_robot_with_these_bodies(name):
    mechanism, motions = mechanism_of(name)
    loads = axis_loads(mechanism, motions[:1])
    added = added_to(loads.axes)
    bodies = [
        payload_at_joint(mechanism.robot, axis.name, one.mass, one.axial_inertia, one.transverse_inertia)
        for axis, one in zip(loads.axes, added.values(), strict=True)
    ]
    loaded, same = mechanism_of(name, bodies)
    expected = axis_loads(loaded, same[:1])
    found = loads.with_masses(added)
    if found[0].torque.shape != expected.cycles[0].torque.shape:
        pytest.fail("grids differ")
    assert_same_cycles(found, expected.cycles)
    assert np.abs(found[0].torque - loads.cycles[0].torque).max() > 1e-3
