"""The mechanism that a robot's configuration describes, with the forces that act on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bellcrank.dynamics.linkage import Linkage
from bellcrank.dynamics.mechanism import Mechanism, mechanism_of
from bellcrank.dynamics.open_chain import OpenChain

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.robot_config import RobotConfig

__all__ = ["Linkage", "Mechanism", "mechanism_of", "mechanism_of_config"]


def mechanism_of_config(config: RobotConfig, robot: Robot) -> Mechanism:
    """The mechanism of a configuration's file with its constraints, forces and parameters, for its robot with payloads."""
    from bellcrank.scene.renamed_keys import read_scene_data
    from bellcrank.scene.scene import load_scene

    if config.source == config.urdf or read_scene_data(config.source)[0].keys().isdisjoint(COUNTED):
        return OpenChain(robot, actuated=config.actuated or None)
    trusted = () if config.access is None else [folder for folder in config.access.trusted if folder.is_dir()]
    return mechanism_of(load_scene(config.source, trust=trusted), robot)


COUNTED = ("constraints", "forces", "control", "parameters", "initial", "base")  # keys of a scene that sizing looks at
