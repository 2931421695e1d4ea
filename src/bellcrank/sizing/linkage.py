"""The mechanism that a robot's configuration describes, with the forces that act on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bellcrank.dynamics.linkage import Linkage
from bellcrank.dynamics.mechanism import Mechanism, mechanism_of
from bellcrank.dynamics.open_chain import OpenChain

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.robot_config import Card

__all__ = ["Linkage", "Mechanism", "mechanism_of", "mechanism_of_card"]


def mechanism_of_card(card: Card, robot: Robot) -> Mechanism:
    """The mechanism of a card's file with its closures, forces and parameters, for its robot with payloads."""
    from bellcrank.config.yaml_file import read_yaml
    from bellcrank.scene.scene import load_scene

    if card.source == card.urdf or read_yaml(card.source).keys().isdisjoint(COUNTED):
        return OpenChain(robot, actuated=card.actuated or None)
    trusted = () if card.access is None else [folder for folder in card.access.trusted if folder.is_dir()]
    return mechanism_of(load_scene(card.source, trust=trusted), robot)


COUNTED = ("closures", "forces", "control", "parameters", "initial", "base")  # keys of a scene that sizing looks at
