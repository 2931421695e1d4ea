"""What the sizing of a configuration reads."""

from __future__ import annotations

import shutil
from pathlib import Path

import bellcrank as bc


def test_a_robot_that_is_read_is_sized_without_its_file(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    shutil.copy(bc.load_robot_config("planar_2r").urdf, path)
    config = bc.load_robot_config(path)
    motion = bc.waypoints(config.robot(), [0.0, 1.0], [{}, {"elbow": 1.0}])
    path.unlink()
    sizing = bc.size(config, motion)
    assert sizing.joint("elbow").peak_torque == bc.size(config.robot(), motion).joint("elbow").peak_torque > 0.0
