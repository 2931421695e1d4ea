"""Scenes with other actuators than those of their file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import bellcrank as bc


def with_actuators(scene: bc.Scene, actuators: Mapping[str, bc.Actuator]) -> bc.Scene:
    """The scene with actuators by joint in place of its own, whose rotors are then the robot's."""
    config = replace(scene.config, actuators=actuators)
    return replace(scene, config=config, robot=config.robot())
