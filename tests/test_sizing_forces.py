"""Forces of a scene in inverse dynamics and sizing, against the multipliers of drives that hold a simulated scene."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.motion.csv_file import write_motion

LINK = (
    '<link name="{name}"><inertial><origin xyz="{at}"/><mass value="{mass}"/><inertia ixx="0.02" iyy="0.05" izz="0.04" '
    'ixy="0.003" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = (
    '<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{at}" rpy="{rpy}"/>'
    '<axis xyz="{axis}"/><limit lower="-1.5" upper="2.5" effort="900" velocity="20"/>'
    '<dynamics damping="0.2" friction="0.5"/></joint>'
)
ARM = (
    '<robot name="arm"><link name="base"/>'
    + LINK.format(name="upper", at="0.2 0.05 0", mass="3")
    + LINK.format(name="rod", at="0.1 0 0.02", mass="2")
    + JOINT.format(name="turn", kind="revolute", parent="base", child="upper", at="0 0 0.3", rpy="0.2 0 0", axis="0 1 0")
    + JOINT.format(name="slide", kind="prismatic", parent="upper", child="rod", at="0.4 0 0", rpy="0 0.1 0.3", axis="1 0 0")
    + "</robot>"
)
# A slider-crank in a vertical plane: crank 0.2 m, rod 0.7 m, slider along x.
CRANK = (
    '<robot name="crank"><link name="base"/>'
    + LINK.format(name="crank_link", at="0.1 0 0", mass="1.5")
    + LINK.format(name="rod_link", at="0.35 0.02 0", mass="2")
    + LINK.format(name="slider_link", at="0 0 0", mass="3")
    + JOINT.format(name="crank", kind="continuous", parent="base", child="crank_link", at="0 0 0", rpy="0 0 0", axis="0 0 1")
    + JOINT.format(
        name="rod", kind="continuous", parent="crank_link", child="rod_link", at="0.2 0 0", rpy="0 0 0", axis="0 0 1"
    )
    + JOINT.format(
        name="slider", kind="prismatic", parent="base", child="slider_link", at="0 0 0", rpy="0 0 0", axis="1 0 0"
    )
    + "</robot>"
)
DRIVE = "{ratio: 50, rated_torque: 1, peak_torque: 4, rated_speed: 300, max_speed: 500, rotor_inertia: 1.0e-4}"
SCENES = {
    "open": f"""
urdf: arm.urdf
gravity: [0.5, 0, -9.81]
frames: {{tip: {{link: rod, xyz: [0.3, 0, 0.1], rpy: [0.3, 0.2, 0.1]}}, side: {{link: upper, xyz: [0, 0.2, 0.1]}}}}
motions:
  go: {{kind: waypoints, times: [0, 1, 2], positions: [{{turn: 0.2, slide: 0.1}}, {{turn: 1.2, slide: 0.5}},
       {{turn: -0.6, slide: 0.2}}], samples: 201}}
  stay: {{kind: dwell, position: {{turn: 0.7, slide: 0.3}}, duration: 2}}
drives: {{turn: {DRIVE}}}
""",
    "closed": f"""
urdf: crank.urdf
gravity: [0.5, -9.81, 0]
frames:
  tip: {{link: rod_link, xyz: [0.7, 0, 0], rpy: [0.3, 0.2, 0.1]}}
  side: {{link: crank_link, xyz: [0, 0.2, 0.1]}}
closures: [{{name: pin, kind: point, frame_a: tip, frame_b: slider_link}}]
initial: {{crank: 0.4, rod: {{guess: -0.5}}, slider: {{guess: 0.88}}}}
actuated: [crank]
motions:
  go: {{kind: waypoints, times: [0, 1, 2], positions: [{{crank: 0.4}}, {{crank: 2.2}}, {{crank: -0.6}}], samples: 201}}
  stay: {{kind: dwell, position: {{crank: 0.7}}, duration: 2}}
drives: {{crank: {DRIVE}}}
""",
}
MOTORS = {"open": ("turn", "slide"), "closed": ("crank",)}
JOINT_OF = {"open": "slide", "closed": "rod"}  # one that the linkage moves without a motor
TORQUE_CSV = "time [s],turn torque [N m],slide torque [N],rod torque [N m]\n0.1,5,3,3\n0.7,-20,8,8\n1.3,9,-6,-6\n1.6,1,2,2\n"
WRENCH_CSV = "time [s],force x [N],force z [kN],torque z [N m]\n0,10,0.02,1\n0.7,-20,0.08,3\n1.3,90,-0.06,0\n2.5,1,0.02,8\n"
KINDS: dict[str, dict[str, Any]] = {
    "joint_spring": {"kind": "joint_spring", "joint": "J", "stiffness": 40.0, "rest": 0.3, "preload": 7.0, "damping": 2.0},
    "spring_to_world": {"kind": "spring", "frame_a": "side", "frame_b": "world", "point": [0.5, 0.3, -0.4],
                        "stiffness": 300.0, "damping": 9.0, "free_length": 0.2},
    "spring_between": {"kind": "spring", "frame_a": "tip", "frame_b": "side", "stiffness": 200.0, "free_length": 0.1},
    "damper": {"kind": "damper", "joint": "J", "coefficient": 11.0},
    "friction": {"kind": "friction", "joint": "J", "viscous": 1.5, "coulomb": 6.0, "width": 0.05},
    "torque": {"kind": "torque", "joint": "J", "value": 12.0},
    "torque_linear": {"kind": "torque", "joint": "J", "file": "torque.csv"},
    "torque_cubic": {"kind": "torque", "joint": "J", "file": "torque.csv", "interpolation": "cubic"},
    "torque_hold": {"kind": "torque", "joint": "J", "file": "torque.csv", "interpolation": "hold"},
    "wrench_world": {"kind": "wrench", "frame": "tip", "force": [30, -20, 50], "torque": [1, 2, 3]},
    "wrench_frame": {"kind": "wrench", "frame": "tip", "force": [30, -20, 50], "torque": [1, 2, 3],
                     "expressed_in": "frame"},
    "wrench_linear": {"kind": "wrench", "frame": "tip", "file": "wrench.csv"},
    "wrench_cubic": {"kind": "wrench", "frame": "tip", "file": "wrench.csv", "interpolation": "cubic",
                     "expressed_in": "frame"},
    "wrench_hold": {"kind": "wrench", "frame": "side", "file": "wrench.csv", "interpolation": "hold"},
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("forces")
    (path / "arm.urdf").write_text(ARM)
    (path / "crank.urdf").write_text(CRANK)
    for name, text in SCENES.items():
        (path / f"{name}.yaml").write_text(text)
    (path / "torque.csv").write_text(TORQUE_CSV)
    (path / "wrench.csv").write_text(WRENCH_CSV)
    return path


def loaded(folder: Path, shape: str, *kinds: str, **more: Any) -> bc.Scene:
    """The scene of that shape with forces of these kinds."""
    forces = [{"name": kind, **KINDS[kind]} for kind in kinds]
    for force in forces:
        if force.get("joint") == "J":
            force["joint"] = JOINT_OF[shape]
    return bc.load_scene(folder / f"{shape}.yaml", {"forces": forces, **more})


def held(scene: bc.Scene, shape: str, motion: str, times: Any) -> np.ndarray[Any, Any]:
    """The multipliers (n, k) of drives at the motors that hold the simulated scene on a motion."""
    drives = [{"name": f"drive_{j}", "kind": "drive", "joint": j, "motion": motion} for j in MOTORS[shape]]
    start = {j: float(scene.motion(motion).position[0, scene.robot.joint(j).q]) for j in MOTORS[shape]}
    velocity = {j: float(scene.motion(motion).velocity[0, scene.robot.joint(j).v]) for j in MOTORS[shape]}
    assert set(velocity.values()) == {0.0}
    guesses = {"rod": {"guess": -0.5}, "slider": {"guess": 0.85}} if shape == "closed" else {}
    driven = scene.with_overrides(
        {
            "closures": [*scene.data.get("closures", []), *drives],
            "initial": {**start, **guesses},
            "simulate": {"duration": float(times[-1]), "rtol": 1e-12, "atol": 1e-12},
        }
    )
    run = bc.simulate(driven, times=times)
    assert run.success, run.message
    names = [name for name, _ in driven.system.multiplier_names]
    return run.multipliers[:, [names.index(f"drive_{j}") for j in MOTORS[shape]]]


TIMES = np.array([0.0, 0.13, 0.4, 0.69, 0.71, 0.96, 1.2, 1.31, 1.57, 1.83])


@pytest.mark.parametrize("shape", ["open", "closed"])
@pytest.mark.parametrize("kind", list(KINDS))
def test_drives_that_hold_a_simulated_scene_give_what_inverse_dynamics_finds(
    folder: Path, tmp_path: Path, shape: str, kind: str
) -> None:
    scene = loaded(folder, shape, kind)
    without = bc.scene_inverse_dynamics(loaded(folder, shape), "go")
    for name in ("go", "stay"):
        found = bc.scene_inverse_dynamics(scene, name)
        np.testing.assert_allclose(found.constraint_residual(), 0.0, atol=1e-12)
        wanted = held(scene, shape, name, TIMES)
        q, v, a = found.motion.at(TIMES)
        at_times = found.mechanism.torques(TIMES, q, v, a)[0]
        scale = np.abs(wanted).max()
        if name == "stay" or shape == "open":
            np.testing.assert_allclose(at_times, wanted, rtol=0, atol=1e-8 * scale)
        else:  # between its rows a linkage's motion is a polynomial: at its rows it is exact
            rows = np.searchsorted(found.time, TIMES - 1e-9)
            np.testing.assert_allclose(found.torque[rows], wanted, rtol=0, atol=1e-8 * scale)
    moving = bc.scene_inverse_dynamics(scene, "go")
    assert np.abs(moving.torque - without.torque).max() > 1e-2 * np.abs(without.torque).max()  # the force is felt
    path = write_motion(moving.motion, tmp_path / "go.csv")
    again = bc.scene_inverse_dynamics(scene, path)
    np.testing.assert_allclose(again.torque, moving.torque, rtol=0, atol=1e-8 * np.abs(moving.torque).max())
