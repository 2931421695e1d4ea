"""What a machine of the first tier is: its robot, its scene, and what of the product applies to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from loads import Loads
from numpy.typing import NDArray

import bellcrank as bc

Array = NDArray[np.float64]
SEED = 2026


@dataclass(frozen=True)
class Tool:
    """A frame that follows paths.

    Attributes:
        frame: Its name.
        start: The posture at the start of the paths.
        reach: The size of the paths, m.
        normal: The normal of circles, askew but where the tool moves in a plane.
        way: The direction of lines, in units of the reach.
        orientation: "hold" where the tool can keep its orientation.
    """

    frame: str
    start: Mapping[str, float]
    reach: float
    normal: tuple[float, float, float] = (0.3, -0.5, 0.8)
    way: tuple[float, float, float] = (0.6, -0.5, 0.4)
    orientation: str | None = "hold"


@dataclass(frozen=True)
class Machine:
    """A machine, by the names of what is bundled. `overrides` change the scene that is simulated."""

    robot_name: str
    scene_name: str
    floating_base: bool = False
    overrides: Mapping[str, Any] = field(default_factory=dict)
    duration: float = 0.5  # of the run, s
    loads: Loads | None = None  # of the scene with every kind of force
    resting: Mapping[str, Any] = field(default_factory=dict)  # changes of the scene that give it an equilibrium
    locus: tuple[str, Sequence[Any]] = ("", ())  # the path of a number of the scene, and values of it
    tool: Tool | None = None  # which follows paths, where the machine is a tree
    sized_name: str | None = None  # the configuration that is sized; None where no joint has a motor

    def load_robot(self, **options: Any) -> bc.Robot:
        """The tree of the machine, without forces and constraints of a scene."""
        return bc.load_robot(self.robot_name, floating_base=self.floating_base, **options)

    def load_scene(self, **overrides: Any) -> bc.Scene:
        """The scene that is simulated; `overrides` are added to those of the machine."""
        return bc.load_scene(self.scene_name, {**self.overrides, **overrides})


def random_states(robot: bc.Robot, count: int, seed: int = SEED) -> tuple[Array, Array, Array]:
    """Positions (count, nq), with unit quaternions, and velocities and accelerations (count, nv); SI units."""
    random = np.random.default_rng(seed)
    q = random.uniform(-1.5, 1.5, (count, robot.nq))
    for joint in robot.joints:
        if joint.kind == "floating":  # position, then quaternion x y z w
            turn = slice(joint.q + 3, joint.q + 7)
            q[:, turn] /= np.linalg.norm(q[:, turn], axis=1, keepdims=True)
    v, a = random.normal(size=(2, count, robot.nv))
    return q, v, a


def wandering(robot: bc.Robot, samples: int = 61) -> bc.Motion:
    """A motion of all joints through five seeded postures, a free base held."""
    random, postures = np.random.default_rng(SEED), np.tile(robot.neutral, (5, 1))
    columns = [joint.q for joint in robot.joints if joint.nv == 1]
    postures[:, columns] += random.uniform(-0.8, 0.8, (5, len(columns)))
    return bc.waypoints(robot, [0.0, 0.4, 0.9, 1.3, 2.0], postures, samples=samples, name="wandering")


def laden_options(robot: bc.Robot) -> dict[str, Any]:
    """Options of `bc.load_robot` with all that a robot can be loaded with, in numbers that all differ."""
    joints = list(enumerate(robot.joint_names))
    return {
        "clean": False,  # which would move the UR5's axes by 1e-11
        "gravity": (1.3, -2.7, -8.9),
        "friction": {name: (0.3 + 0.1 * k, 0.7 + 0.2 * k) for k, name in joints},
        "friction_width": 0.4,
        "rotor_inertia": {name: 0.04 + 0.03 * k for k, name in joints},
        "frames": {"gripper": (robot.massive_links[-1], (0.11, -0.07, 0.23), (0.4, -0.9, 1.3))},
        "payloads": [
            bc.Payload(1.7, "gripper", (0.05, -0.03, 0.08), (0.012, 0.001, 0.015, -0.002, 0.0015, 0.018)),
            bc.Payload(0.6, robot.massive_links[0], (-0.04, 0.06, 0.02)),
        ],
    }
