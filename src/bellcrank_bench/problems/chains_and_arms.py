"""Reference problems of chains of up to 100 links and of industrial arms: falling, and held by a controller."""

from __future__ import annotations

from typing import Any

import numpy as np

from bellcrank.scene.scene import Scene, load_scene
from bellcrank.simulation.trajectory.trajectory import Trajectory
from bellcrank_bench.problems import urdf_texts
from bellcrank_bench.problems.checks import Check, finished, largest
from bellcrank_bench.problems.problem import Problem, scene_of

LINKS = (5, 10, 20, 50, 100)
CHAIN_SETTINGS: dict[str, Any] = {"duration": 1.0, "rtol": 1e-10, "atol": 1e-10, "samples": 101}
POSTURES = {  # rad
    "ur5": {
        "shoulder_pan_joint": 0.4, "shoulder_lift_joint": -1.2, "elbow_joint": 1.4, "wrist_1_joint": -0.6,
        "wrist_2_joint": 0.9, "wrist_3_joint": 0.2,
    },
    "panda": {
        "panda_joint1": 0.2, "panda_joint2": -0.5, "panda_joint3": 0.3, "panda_joint4": -2.0, "panda_joint5": 0.4,
        "panda_joint6": 1.6, "panda_joint7": 0.8,
    },
}  # fmt: skip


def chain_scene(links: int) -> Scene:
    """Uniform rods of 1 m and 1 kg in a row, horizontal and at rest, that hang from one end."""
    return scene_of(urdf_texts.chain(links), {"gravity": [0.0, -9.81, 0.0]})


def held_scene(name: str) -> Scene:
    """A robot in a bent posture, held by gravity compensation and PD control, without joint friction."""
    joints, target = list(POSTURES[name]), POSTURES[name]
    weight = {"kind": "gravity_compensation", "joints": joints}
    pd = {"kind": "pd", "target": target, "kp": 400.0, "kd": 40.0}
    return scene_of(None, {"urdf": name, "friction": "none", "initial": target, "control": [weight, pd]})


def judge_fall(run: Trajectory) -> list[Check]:
    """Known: the energy is conserved, and Pinocchio's articulated-body algorithm gives the accelerations."""
    rows = np.unique(np.linspace(0, len(run) - 1, 21).astype(int))
    ours, theirs = run.acceleration[rows], pinocchio_accelerations(run, rows)
    return [
        finished(run),
        Check("energy drift", run.energy_drift(), 1e-9),
        Check("accelerations", largest(ours - theirs) / largest(theirs), 1e-10, "relative"),
    ]


def judge_held(run: Trajectory) -> list[Check]:
    """Known: the torques balance gravity exactly, so nothing moves."""
    return [finished(run), Check("moved", largest(run.position - run.position[0]), 1e-10, "rad")]


def pinocchio_accelerations(run: Trajectory, rows: np.ndarray) -> np.ndarray:
    """Accelerations (rows, nv) by Pinocchio's own algorithm, or by its mass matrix if there are mimic joints."""
    import pinocchio as pin

    model = run.robot.model
    data = model.createData()
    found = []
    for q, v, tau in zip(run.position[rows], run.velocity[rows], run.torque[rows], strict=True):
        if run.robot.mimics():
            mass = np.triu(pin.crba(model, data, q))
            mass += np.triu(mass, 1).T
            found.append(np.linalg.solve(mass, tau - pin.rnea(model, data, q, v, np.zeros(model.nv))))
        else:
            found.append(np.array(pin.aba(model, data, q, v, tau)))
    return np.array(found)


def _chain(links: int) -> Problem:
    return Problem(
        name=f"chain_{links}",
        title=f"chain of {links} rods falling from horizontal, 1 s",
        source="conservation of energy, and Pinocchio's articulated-body algorithm",
        make=lambda: chain_scene(links),
        judge=judge_fall,
        settings=CHAIN_SETTINGS,
    )


def _arm(name: str, title: str) -> tuple[Problem, Problem]:
    fine = {"rtol": 1e-10, "atol": 1e-10, "samples": 201}
    fall = Problem(
        name=f"{name}_fall",
        title=f"{title} released, 3 s",
        source="conservation of energy, and Pinocchio's articulated-body algorithm",
        make=lambda: load_scene(f"{name}_falling"),
        judge=judge_fall,
        settings=fine | {"duration": 3.0},
    )
    held = Problem(
        name=f"{name}_held",
        title=f"{title} held by gravity compensation and PD control, 10 s",
        source="equilibrium",
        make=lambda: held_scene(name),
        judge=judge_held,
        settings=fine | {"duration": 10.0},
    )
    return fall, held


PROBLEMS = (*map(_chain, LINKS), *_arm("ur5", "UR5"), *_arm("panda", "Panda"))
