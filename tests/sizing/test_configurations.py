"""What the sizing of a configuration reads."""

from __future__ import annotations

import shutil
from pathlib import Path

import bellcrank as bc


def test_a_robot_that_is_read_is_sized_without_its_file(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    shutil.copy(bc.load_scene("planar_2r").config.urdf, path)
    scene = bc.load_scene(path)
    motion = bc.waypoints(scene.robot, [0.0, 1.0], [{}, {"elbow": 1.0}])
    path.unlink()
    sizing = bc.size(scene, motion)
    assert sizing.joint("elbow").peak_torque == bc.size(scene.robot, motion).joint("elbow").peak_torque > 0.0
