"""Scenes for studies of many designs, with what is varied in them, between which values."""

from dataclasses import dataclass

import numpy as np

import bellcrank as bc
from bellcrank.studies.designs.axes import read_axis
from bellcrank.studies.execution.simulation_runner import SimulationRunner


@dataclass(frozen=True)
class StudyScene:
    """A scene with overrides, and the range of each path that is varied, in a unit."""

    scene: str
    overrides: dict
    vary: dict

    def load(self):
        return bc.load_scene(self.scene, self.overrides)

    def runner(self):
        """A runner of its designs, one axis a path."""
        scene = self.load()
        axes = [
            read_axis(scene, path, [f"{low} {unit}", f"{high} {unit}"]) for path, (low, high, unit) in self.vary.items()
        ]
        return SimulationRunner(scene, axes)

    def designs(self, count, seed=0):
        """Random values (count, axes) between the ends."""
        low, high, _ = zip(*self.vary.values(), strict=True)
        return np.random.default_rng(seed).uniform(low, high, (count, len(low)))


WAYPOINTS = [{"shoulder": 0.0, "elbow": 0.0}, {"shoulder": 0.9, "elbow": -0.4}, {"shoulder": 0.2, "elbow": 0.3}]
DRAG = {"kind": "friction", "name": "drag", "joint": "elbow", "viscous": 0.2, "coulomb": 0.4, "width": 0.05}
STUDY_SCENES = {
    "four_bar": StudyScene("four_bar", {}, {"crank_length": (1.1, 1.3, "m"), "initial.crank": (0.5, 3.0, "deg")}),
    "latched_four_bar": StudyScene(
        "four_bar",
        {"events.lock.latch": True, "simulate.rtol": 1e-9},
        {"crank_length": (1.17, 1.3, "m"), "rocker_length": (1.19, 1.21, "m")},
    ),
    "planar_2r_swing": StudyScene(
        "planar_2r_swing",
        {"simulate.duration": 3.0},
        {"initial.shoulder": (-110.0, -70.0, "deg"), "initial.elbow": (-60.0, 60.0, "deg")},
    ),
    "spring_pendulum": StudyScene(
        "spring_pendulum",
        {
            "simulate.duration": 5.0,
            "parameters": {"stiffness": {"value": 15.0, "sets": ["force.spring.stiffness"]}},
            "events": [{"name": "low", "when": {"expression": "swing.position"}, "direction": "down"}],
        },
        {"stiffness": (12.0, 18.0, "N/m"), "initial.swing": (20.0, 60.0, "deg")},
    ),
    "rolling_disk": StudyScene(
        "rolling_disk",
        {
            "simulate.duration": 3.0,
            "parameters": {"mass": {"value": 1.0, "sets": ["link.disk.mass"]}},
            "outputs.spin": {"frame": "disk", "what": "angular_velocity"},
        },
        {"mass": (0.5, 2.0, "kg")},
    ),
    "five_bar": StudyScene(
        "five_bar", {}, {"initial.left_motor": (100.0, 115.0, "deg"), "initial.right_motor": (85.0, 98.0, "deg")}
    ),
    "n_four_bar_2": StudyScene(
        "n_four_bar_2", {"simulate.duration": 1.0}, {"initial.velocity.crank_0": (-1.2, -0.8, "rad/s")}
    ),
    "stabilised_four_bar": StudyScene(
        "four_bar",
        {"simulate.stabilisation": {"kind": "baumgarte", "gains": "auto"}, "simulate.duration": 8.0},
        {"crank_length": (1.1, 1.3, "m")},
    ),
    "pendulum": StudyScene(
        "pendulum",
        {"events": [{"name": "bottom", "when": {"joint": "swing", "position": 0.0}, "stop": True}]},
        {"initial.swing": (-170.0, 170.0, "deg"), "simulate.duration": (0.5, 3.0, "s")},
    ),
    "prescribed_motion": StudyScene(
        "planar_2r_swing",
        {
            "motions": {"move": {"kind": "waypoints", "times": [0, 0.7, 1.3], "positions": WAYPOINTS}},
            "constraints": [{"kind": "prescribed_motion", "name": "motor", "joint": "shoulder", "motion": "move"}],
            "forces": [DRAG],
            "initial": {"elbow": "45 deg"},
            "parameters": {"drag": {"value": 0.2, "sets": ["force.drag.viscous"]}},
            "simulate.duration": 2.0,
        },
        {"initial.elbow": (-60.0, 60.0, "deg"), "drag": (0.1, 0.4, "N m s/rad")},
    ),
    "coulomb_friction": StudyScene(
        "planar_2r_swing",
        {
            "forces": [{"kind": "friction", "name": "dry", "joint": "shoulder", "coulomb": 0.8, "width": 0.02}],
            "parameters": {"dry": {"value": 0.8, "sets": ["force.dry.coulomb"]}},
            "simulate.duration": 2.0,
        },
        {"dry": (0.2, 1.5, "N m"), "initial.elbow": (-60.0, 60.0, "deg")},
    ),
}  # fmt: skip
