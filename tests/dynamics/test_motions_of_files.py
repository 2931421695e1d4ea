"""Inverse dynamics of an open chain with forces, along a motion that is read from a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import bellcrank as bc
from bellcrank.motion.sampled.csv_file import write_motion


def test_an_arm_with_a_spring_needs_the_same_torques_along_a_motion_and_along_its_file(tmp_path: Path) -> None:
    (tmp_path / "arm.yaml").write_text(
        "urdf: planar_2r\ngravity: [0, -9.81, 0]\nforces: [{kind: joint_spring, joint: elbow, stiffness: 3}]\n"
    )
    scene = bc.load_scene(tmp_path / "arm.yaml")
    motion = bc.waypoints(scene.robot, [0.0, 1.0], [{}, {"elbow": 1.0}])
    write_motion(motion, tmp_path / "lift.csv")
    given, read = (bc.scene_inverse_dynamics(scene, one) for one in (motion, tmp_path / "lift.csv"))
    assert np.array_equal(read.torque, given.torque)
    bare = scene.robot.inverse_dynamics(motion.position, motion.velocity, motion.acceleration)
    spring = np.column_stack([np.zeros(len(motion.time)), 3.0 * motion.position[:, 1]])  # what stretches it
    np.testing.assert_allclose(read.torque, bare + spring, atol=1e-12)
