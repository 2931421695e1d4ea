"""Forces of a scene in inverse dynamics and sizing, against the multipliers of drives that hold a simulated scene."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.dynamics.equations.system import system_of
from bellcrank.dynamics.inverse.mechanism import mechanism_of
from bellcrank.motion.sampled.csv_file import write_motion
from bellcrank.simulation.trajectory.scene_notes import scene_notes
from bellcrank.sizing.tables import table

LINK = (
    '<link name="{name}"><inertial><origin xyz="{at}"/><mass value="{mass}"/><inertia ixx="0.02" iyy="0.05" izz="0.04" '
    'ixy="0.003" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = (
    '<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
    '<origin xyz="{at}" rpy="{rpy}"/><axis xyz="{axis}"/><limit lower="-1.5" upper="2.5" effort="900" velocity="20"/>'
    '<dynamics damping="0.2" friction="0.5"/></joint>'
)
ARM = (
    '<robot name="arm"><link name="base"/>'
    + LINK.format(name="upper", at="0.2 0.05 0", mass="3")
    + LINK.format(name="rod", at="0.1 0 0.02", mass="2")
    + JOINT.format(
        name="turn", kind="revolute", parent="base", child="upper", at="0 0 0.3", rpy="0.2 0 0", axis="0 1 0"
    )
    + JOINT.format(
        name="slide", kind="prismatic", parent="upper", child="rod", at="0.4 0 0", rpy="0 0.1 0.3", axis="1 0 0"
    )
    + "</robot>"
)
# A slider-crank in a vertical plane: crank 0.2 m, rod 0.7 m, slider along x.
CRANK = (
    '<robot name="crank"><link name="base"/>'
    + LINK.format(name="crank_link", at="0.1 0 0", mass="1.5")
    + LINK.format(name="rod_link", at="0.35 0.02 0", mass="2")
    + LINK.format(name="slider_link", at="0 0 0", mass="3")
    + JOINT.format(
        name="crank", kind="continuous", parent="base", child="crank_link", at="0 0 0", rpy="0 0 0", axis="0 0 1"
    )
    + JOINT.format(
        name="rod", kind="continuous", parent="crank_link", child="rod_link", at="0.2 0 0", rpy="0 0 0", axis="0 0 1"
    )
    + JOINT.format(
        name="slider", kind="prismatic", parent="base", child="slider_link", at="0 0 0", rpy="0 0 0", axis="1 0 0"
    )
    + "</robot>"
)
DRIVE = "{ratio: 50, rated_torque: 4, peak_torque: 9, rated_speed: 300, max_speed: 500, rotor_inertia: 1.0e-4}"
SCENES = {
    "open": f"""
urdf: arm.urdf
gravity: [0.5, 0, -9.81]
frames: {{tip: {{link: rod, xyz: [0.3, 0, 0.1], rpy: [0.3, 0.2, 0.1]}}, side: {{link: upper, xyz: [0, 0.2, 0.1]}}}}
motions:
  go: {{kind: waypoints, times: [0, 1, 2], positions: [{{turn: 0.2, slide: 0.1}}, {{turn: 1.2, slide: 0.5}},
       {{turn: -0.6, slide: 0.2}}], samples: 201}}
  stay: {{kind: dwell, position: {{turn: 0.7, slide: 0.3}}, duration: 2}}
actuators: {{turn: {DRIVE}}}
""",
    "closed": f"""
urdf: crank.urdf
gravity: [0.5, -9.81, 0]
frames:
  tip: {{link: rod_link, xyz: [0.7, 0, 0], rpy: [0.3, 0.2, 0.1]}}
  side: {{link: crank_link, xyz: [0, 0.2, 0.1]}}
constraints: [{{name: pin, kind: point, frame_a: tip, frame_b: slider_link}}]
initial: {{crank: 0.4, rod: {{guess: -0.5}}, slider: {{guess: 0.88}}}}
actuated: [crank]
motions:
  go: {{kind: waypoints, times: [0, 1, 2], positions: [{{crank: 0.4}}, {{crank: 2.2}}, {{crank: -0.6}}], samples: 201}}
  stay: {{kind: dwell, position: {{crank: 0.7}}, duration: 2}}
actuators: {{crank: {DRIVE}}}
""",
}
MOTORS = {"open": ("turn", "slide"), "closed": ("crank",)}
JOINT_OF = {"open": "slide", "closed": "rod"}  # one that the linkage moves without a motor
TORQUE_CSV = (
    "time [s],turn torque [N m],slide torque [N],rod torque [N m]\n0.1,5,3,3\n0.7,-20,8,8\n1.3,9,-6,-6\n1.6,1,2,2\n"
)
WRENCH_CSV = (
    "time [s],force x [N],force z [kN],torque z [N m]\n0,10,0.02,1\n0.7,-20,0.08,3\n1.3,90,-0.06,0\n2.5,1,0.02,8\n"
)
KINDS: dict[str, dict[str, Any]] = {
    "joint_spring": {"kind": "joint_spring", "joint": "J", "stiffness": 40.0, "rest": 0.3, "preload": 7.0,
                     "damping": 2.0},
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
    drives = [{"name": f"drive_{j}", "kind": "prescribed_motion", "joint": j, "motion": motion} for j in MOTORS[shape]]
    start = {j: float(scene.motion(motion).position[0, scene.robot.joint(j).q]) for j in MOTORS[shape]}
    velocity = {j: float(scene.motion(motion).velocity[0, scene.robot.joint(j).v]) for j in MOTORS[shape]}
    assert set(velocity.values()) == {0.0}
    guesses = {"rod": {"guess": -0.5}, "slider": {"guess": 0.85}} if shape == "closed" else {}
    driven = scene.with_overrides(
        {
            "constraints": [*scene.data.get("constraints", []), *drives],
            "initial": {**start, **guesses},
            "simulate": {"duration": float(times[-1]), "rtol": 1e-12, "atol": 1e-12},
        }
    )
    run = bc.simulate(driven, times=times)
    assert run.success, run.message
    names = [name for name, _ in system_of(driven).multiplier_names]
    return run.multipliers[:, [names.index(f"drive_{j}") for j in MOTORS[shape]]]


TIMES = np.array([0.0, 0.13, 0.4, 0.69, 0.71, 0.96, 1.2, 1.31, 1.57, 1.83])


@pytest.mark.tier2
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


EVERY = ("joint_spring", "spring_to_world", "spring_between", "damper", "friction", "torque_hold", "wrench_frame",
         "wrench_linear")  # fmt: skip
PARAMETERS = {
    "mass": {"value": 3.5, "sets": ["link.rod.mass"]},
    "factor": {"value": 1.3, "sets": ["link.upper.scale"]},
    "length": {"value": 0.55, "sets": ["joint.slide.origin.x"]},
    "stiffness": {"value": 90.0, "sets": ["force.joint_spring.stiffness"]},
    "push": {"value": -70.0, "sets": ["force.wrench_frame.force.y"]},
}


@pytest.mark.tier2
def test_parameters_count_at_their_values_with_all_forces_together(folder: Path) -> None:
    scene = loaded(folder, "open", *EVERY, parameters=PARAMETERS)
    found = bc.scene_inverse_dynamics(scene, "go")
    wanted = held(scene, "open", "go", TIMES)
    at_times = found.mechanism.torques(TIMES, *found.motion.at(TIMES))[0]
    np.testing.assert_allclose(at_times, wanted, rtol=0, atol=1e-8 * np.abs(wanted).max())
    plain = bc.scene_inverse_dynamics(loaded(folder, "open", *EVERY), "go").torque
    assert np.abs(plain - found.torque).max() > 0.1 * np.abs(plain).max()
    q, v, a = found.position, found.velocity, found.acceleration
    shares = found.mechanism.link_torques(found.time, q, v, a)
    rest = found.mechanism.equations.friction(found.time, q, v) - scene.robot.friction_torque(v)
    without = bc.scene_inverse_dynamics(
        scene.with_overrides({"forces": [], "parameters": dict(list(PARAMETERS.items())[:3])}), "go"
    )
    assert np.abs(rest).max() > 1.0  # friction elements are part of the share of friction
    rotor = scene.robot.rotor_inertia * a
    np.testing.assert_allclose(shares.sum(axis=1), without.torque - scene.robot.friction_torque(v) - rotor, atol=1e-9)
    mass = without.mechanism.inertia(found.time, q)
    assert (
        np.abs(mass - bc.scene_inverse_dynamics(loaded(folder, "open"), "go").mechanism.inertia(found.time, q)).max()
        > 1.0
    )


@pytest.mark.tier2
def test_a_parameter_of_a_linkage_counts_in_sizing(folder: Path) -> None:
    values = {
        "radius": {"value": 0.25, "sets": ["joint.rod.origin.x"]},
        "heavy": {"value": 9.0, "sets": ["link.rod_link.mass"]},
    }
    scene = loaded(folder, "closed", "damper", "wrench_cubic", parameters=values)
    found = bc.scene_inverse_dynamics(scene, "go")
    rows = np.searchsorted(found.time, TIMES - 1e-9)
    wanted = held(scene, "closed", "go", TIMES)
    np.testing.assert_allclose(found.torque[rows], wanted, rtol=0, atol=1e-8 * np.abs(wanted).max())
    sizing = bc.size(scene, found.motion, scene.config.actuators)
    assert sizing.parameters == (("radius", 0.25, "m"), ("heavy", 9.0, "kg"))
    rotor = scene.robot.rotor_inertia[0] * found.acceleration[:, 0]
    assert sizing.joint("crank").max_torque == pytest.approx((found.torque[:, 0] - rotor).max(), rel=1e-3)


def test_reactions_of_an_open_chain_are_pinocchio_s_with_external_forces(folder: Path) -> None:
    import pinocchio as pin

    scene = loaded(folder, "open", "spring_to_world", "spring_between", "wrench_frame", "wrench_linear", "joint_spring")
    found = bc.scene_inverse_dynamics(scene, "go")
    rows = np.arange(3, len(found.time), 17)
    model, robot, names = scene.robot.model, scene.robot, scene.robot.all_joint_names
    data = model.createData()
    for row in rows:
        t, q, v, a = found.time[row], found.position[row], found.velocity[row], found.acceleration[row]
        pose = {name: robot.frame_pose(name, q) for name in ("tip", "side")}
        speed = {name: robot.frame_velocity(name, q, v)[0] for name in ("tip", "side")}
        forces = {"tip": np.zeros(6), "side": np.zeros(6)}
        way = np.array([0.5, 0.3, -0.4]) - pose["side"][0]
        length = np.linalg.norm(way)
        forces["side"][:3] += (300.0 * (length - 0.2) + 9.0 * (way @ -speed["side"]) / length) * way / length
        way = pose["side"][0] - pose["tip"][0]
        length = np.linalg.norm(way)
        pull = 200.0 * (length - 0.1) * way / length
        forces["tip"][:3] += pull
        forces["side"][:3] -= pull
        turn = pose["tip"][1]
        forces["tip"] += np.concatenate([turn @ [30, -20, 50], turn @ [1, 2, 3]])
        table = np.loadtxt(folder / "wrench.csv", delimiter=",", skiprows=1)
        for column, place, unit in ((1, 0, 1.0), (2, 2, 1000.0), (3, 5, 1.0)):
            forces["tip"][place] += unit * np.interp(t, table[:, 0], table[:, column])
        pin.forwardKinematics(model, data, q)
        external = [pin.Force.Zero() for _ in range(model.njoints)]
        for frame, joint in (("tip", "slide"), ("side", "turn")):
            k = model.getJointId(joint)
            place, force = data.oMi[k], forces[frame]
            moment = force[3:] + np.cross(pose[frame][0] - place.translation, force[:3])
            external[k] = pin.Force(place.rotation.T @ force[:3], place.rotation.T @ moment)
        pin.rnea(model, data, q, v, a, external)
        for k, name in enumerate(names):
            wrench = data.f[model.getJointId(name)].vector
            np.testing.assert_allclose(found.reactions[row, k], wrench, rtol=0, atol=1e-9 * np.abs(wrench).max())


@pytest.mark.tier2
def test_what_the_ground_gives_a_loaded_linkage_balances_its_momentum_and_all_forces(folder: Path) -> None:
    import pinocchio as pin

    scene = loaded(folder, "closed", *EVERY)
    found = bc.scene_inverse_dynamics(scene, "go")
    robot, model = scene.robot, scene.robot.model
    data, names = model.createData(), list(robot.all_joint_names)
    applied = found.applied
    # a hinge without a motor passes what its own elements and friction give about its axis, and nothing else
    rod = robot.joint("rod").v
    own = bc.scene_inverse_dynamics(
        loaded(folder, "closed", "joint_spring", "damper", "friction", "torque_hold"), "go"
    ).applied
    passed = own[:, rod] - robot.friction_torque(found.velocity)[:, rod]
    np.testing.assert_allclose(found.reactions[:, names.index("rod"), 5], passed, atol=1e-8 * np.abs(applied).max())
    table = np.loadtxt(folder / "wrench.csv", delimiter=",", skiprows=1)
    for row in range(4, len(found.time), 23):
        t, q, v, a = found.time[row], found.position[row], found.velocity[row], found.acceleration[row]
        pin.computeCentroidalMomentumTimeVariation(model, data, q, v, a)
        rate = data.dhg.vector  # about the centre of mass
        pose = {name: robot.frame_pose(name, q) for name in ("tip", "side", "crank", "slider")}
        total = np.zeros(6)

        def act(place: Any, force: Any, moment: Any, total: Any = total) -> None:
            total[:3] += force
            total[3:] += moment + np.cross(place - data.com[0], force)

        act(data.com[0], sum(i.mass for i in model.inertias) * np.asarray(model.gravity.linear), np.zeros(3))
        for base in ("crank", "slider"):
            wrench, turn = found.reactions[row, names.index(base)], pose[base][1]
            act(pose[base][0], turn @ wrench[:3], turn @ wrench[3:])
        way = np.array([0.5, 0.3, -0.4]) - pose["side"][0]
        length = np.linalg.norm(way)
        slope = way @ -robot.frame_velocity("side", q, v)[0] / length
        act(pose["side"][0], (300.0 * (length - 0.2) + 9.0 * slope) * way / length, np.zeros(3))
        turn = pose["tip"][1]
        act(pose["tip"][0], turn @ [30, -20, 50], turn @ [1, 2, 3])
        fx, fz, mz = (np.interp(t, table[:, 0], table[:, k]) for k in (1, 2, 3))
        act(pose["tip"][0], np.array([fx, 0.0, 1000.0 * fz]), np.array([0.0, 0.0, mz]))
        np.testing.assert_allclose(total, rate, rtol=0, atol=1e-9 * np.abs(found.reactions[row]).max())


# ---- holding


@pytest.mark.tier2
@pytest.mark.parametrize("tolerance", [0.0, 0.25])
@pytest.mark.parametrize(
    "kinds",
    [("joint_spring", "damper"), ("spring_to_world", "friction"), ("wrench_frame", "torque"),
     ("spring_between", "wrench_hold", "torque_cubic")],
)  # fmt: skip
def test_holding_torques_with_forces_are_the_worst_of_a_dense_grid_of_postures_and_times(
    folder: Path, kinds: tuple[str, ...], tolerance: float
) -> None:
    scene = loaded(folder, "open", *kinds)
    sizing = bc.size(scene, scene.motion("stay"), mass_tolerance=tolerance)
    mechanism = bc.scene_inverse_dynamics(scene, "stay").mechanism
    both = np.stack(np.meshgrid(np.linspace(-1.5, 2.5, 161), np.linspace(-1.5, 2.5, 161)), axis=-1).reshape(-1, 2)
    still = np.zeros_like(both)
    worst = np.zeros(2)
    times = np.linspace(0.0, 3.0, 61) if scene.signal_sources else np.zeros(1)
    for t in times:
        torque = np.abs(mechanism.torques(np.full(len(both), t), both, still, still)[0])
        torque += tolerance * np.abs(scene.robot.link_torques(both, still, still)).sum(axis=1)
        worst = np.maximum(worst, torque.max(axis=0))
    found = np.array([line.holding_torque for line in sizing.joints])
    assert np.all(found >= worst * (1.0 - 1e-12))
    np.testing.assert_allclose(found, worst, rtol=2e-3)  # a grid of 0.025 rad or m and 0.05 s stops short
    quiet = bc.size(loaded(folder, "open"), scene.motion("stay"), mass_tolerance=tolerance)
    assert not np.allclose(found, [line.holding_torque for line in quiet.joints], rtol=1e-3)


def test_dampers_and_friction_hold_nothing(folder: Path) -> None:
    scene = loaded(folder, "open", "damper", "friction")
    sizing, quiet = (bc.size(each, scene.motion("go")) for each in (scene, loaded(folder, "open")))
    for line, other in zip(sizing.joints, quiet.joints, strict=True):
        assert line.holding_torque == pytest.approx(other.holding_torque, rel=1e-12)
        assert line.name == "turn" or line.peak_torque > 1.3 * other.peak_torque


@pytest.mark.tier2
def test_a_linkage_s_holding_torque_counts_springs_and_wrenches_at_the_postures_of_its_motion(folder: Path) -> None:
    scene = loaded(folder, "closed", "spring_to_world", "wrench_world", "damper")
    found = bc.scene_inverse_dynamics(scene, "go")
    energy = scene.robot.energy(found.position, np.zeros_like(found.velocity))[1]
    side, tip = scene.robot.frame_pose("side", found.position)[0], scene.robot.frame_pose("tip", found.position)
    length = np.linalg.norm(side - [0.5, 0.3, -0.4], axis=1)
    energy = energy + 0.5 * 300.0 * (length - 0.2) ** 2 - tip[0] @ [30.0, -20.0, 50.0]
    angle = found.position[:, scene.robot.joint("crank").q]
    rod = angle + found.position[:, scene.robot.joint("rod").q]
    slope = np.gradient(energy - 3.0 * rod, angle)[2:-2]  # the wrench's moment of 3 N m turns the rod by that
    held_by = bc.size(scene, found.motion).joint("crank").holding_torque
    assert held_by == pytest.approx(np.nanmax(np.abs(slope[np.isfinite(slope)])), rel=5e-3)


# ---- sizing


@pytest.mark.tier2
def test_size_over_a_run_made_with_forces_gives_the_actuators_of_that_run(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for shape in ("open", "closed"):
        kinds = ("joint_spring", "spring_to_world", "damper", "torque_cubic", "wrench_frame")
        scene = loaded(folder, shape, *kinds)
        drives = [
            {"name": f"drive_{j}", "kind": "prescribed_motion", "joint": j, "motion": "go"} for j in MOTORS[shape]
        ]
        constraints = [*scene.data.get("constraints", []), *drives]
        at_start = {"initial": {"turn": 0.2, "slide": 0.1}} if shape == "open" else {}
        driven = scene.with_overrides({"constraints": constraints, **at_start})
        run = bc.simulate(driven, duration=2.0, rtol=1e-11, atol=1e-11,
                          samples=401)  # fmt: skip
        run.to_csv(tmp_path / "run.csv")
        import yaml

        path = folder / f"{shape}_driven.yaml"
        path.write_text(yaml.safe_dump({**scene.data, "constraints": constraints, **at_start}))
        monkeypatch.chdir(tmp_path)
        assert main(["size", str(path), "--motion", "run.csv", "--no-plots", "--out", shape]) == 0
        out = capsys.readouterr().out
        assert "forces joint_spring 'joint_spring', spring 'spring_to_world', damper 'damper'" in out
        assert f"torque 'torque_cubic' of the scene acts on joint '{JOINT_OF[shape]}' in addition to the motor" in out
        assert "its table ends at 1.6 s, motion 'run' at 2 s; after the table its last value is used" in out
        report = json.loads((tmp_path / shape / "sizing.json").read_text(encoding="utf-8"))
        assert [force["name"] for force in report["forces"]] == list(kinds)
        names = [name for name, _ in system_of(run.scene).multiplier_names]
        for joint in report["joints"]:
            v = scene.robot.joint(joint["name"]).v
            wanted = run.multipliers[:, names.index(f"drive_{joint['name']}")]
            wanted = wanted - scene.robot.rotor_inertia[v] * run.acceleration[:, v]
            assert joint["peaks"]["max_torque"]["value"] == pytest.approx(wanted.max(), rel=2e-3)
            assert joint["peaks"]["min_torque"]["value"] == pytest.approx(wanted.min(), rel=2e-3)
            history = (tmp_path / shape / "history_run.csv").read_text().splitlines()
            column = [title.split(" [")[0] for title in history[0].split(",")].index(f"{joint['name']} torque")
            table = np.loadtxt(history[1:], delimiter=",")
            np.testing.assert_allclose(table[:, column], wanted, rtol=0, atol=1e-6 * np.abs(wanted).max())


SLIDER = (
    '<robot name="slider"><link name="base"/><link name="block"><inertial><mass value="2"/><inertia ixx="1" iyy="1" '
    'izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="slide" type="prismatic"><parent link="base"/>'
    '<child link="block"/><axis xyz="1 0 0"/><limit lower="-2" upper="2" effort="100" velocity="9"/></joint></robot>'
)


def slider(path: Path, *forces: dict[str, Any], motion: str = "") -> bc.Scene:
    (path / "slider.urdf").write_text(SLIDER)
    motion = motion or "{kind: waypoints, times: [0, 4], positions: [{slide: 0}, {slide: 1}], samples: 5}"
    text = f"urdf: slider.urdf\nmotions:\n  go: {motion}\n  stay: {{kind: dwell, position: {{}}, duration: 4}}\n"
    (path / "slider.yaml").write_text(text)
    return bc.load_scene(path / "slider.yaml", {"forces": list(forces)})


@pytest.mark.parametrize("interpolation", ["linear", "hold"])
def test_jumps_of_tables_between_the_rows_of_a_motion_are_seen_from_both_sides(
    tmp_path: Path, interpolation: str
) -> None:
    (tmp_path / "push.csv").write_text("time [s],force x [N]\n0,3\n1.234,3\n1.235,40\n1.2351,-70\n3.3,5\n")
    push = {"name": "push", "kind": "wrench", "frame": "block", "file": "push.csv", "interpolation": interpolation}
    scene = slider(tmp_path, push)
    line = bc.size(scene, scene.motion("stay")).joint("slide")
    assert (line.max_torque, line.min_torque) == (70.0, -40.0) and line.holding_torque == 70.0
    if interpolation == "hold":
        square = 1.235 * 9.0 + 1e-4 * 1600.0 + (3.3 - 1.2351) * 4900.0 + 0.7 * 25.0
    else:
        pieces = [(1.234, 3, 3), (1e-3, 3, 40), (1e-4, 40, -70), (3.3 - 1.2351, -70, 5), (0.7, 5, 5)]
        square = sum(h * (a * a + a * b + b * b) / 3.0 for h, a, b in pieces)
    assert line.rms_torque == pytest.approx(np.sqrt(square / 4.0), rel=1e-12)


@pytest.mark.tier2
def test_a_friction_element_s_jump_at_a_reversal_is_resolved(tmp_path: Path) -> None:
    rub = {"name": "rub", "kind": "friction", "joint": "slide", "coulomb": 30.0, "width": 1e-4}
    back = "{kind: waypoints, times: [0, 1.1, 2], positions: [{slide: 0}, {slide: 1}, {slide: 0.2}], samples: 41}"
    scene = slider(tmp_path, rub, motion=back)
    motion = scene.motion("go")
    line = bc.size(scene, motion).joint("slide")
    t = np.linspace(0.0, 2.0, 1_000_001)
    _, v, a = motion.at(t)
    force = 2.0 * a[:, 0] + 30.0 * v[:, 0] / np.sqrt(v[:, 0] ** 2 + 1e-8)
    assert line.max_torque == pytest.approx(force.max(), rel=1e-6) and line.min_torque == pytest.approx(
        force.min(), rel=1e-6
    )
    assert line.rms_torque == pytest.approx(np.sqrt(np.trapezoid(force**2, t) / 2.0), rel=2e-7)
    assert 0.0 < line.friction_share <= 1.0


def test_a_wrench_s_table_pushes_a_simulated_block_as_its_polynomials_say(tmp_path: Path) -> None:
    (tmp_path / "push.csv").write_text("time [s],force x [kN],torque y [N m]\n0,0,5\n2,0.004,5\n")
    push = {"name": "push", "kind": "wrench", "frame": "block", "file": "push.csv"}
    run = bc.simulate(slider(tmp_path, push), duration=3.0, rtol=1e-11, atol=1e-11, samples=7)
    t = run.time  # F = 2 t up to 2 s, then 4 N, on 2 kg
    x = np.where(t <= 2.0, t**3 / 6.0, 8.0 / 6.0 + 2.0 * (t - 2.0) + (t - 2.0) ** 2)
    np.testing.assert_allclose(run.position[:, 0], x, atol=1e-9)
    assert any("its table ends at 2 s and the run at" in note for note in scene_notes(run.scene))


@pytest.mark.parametrize(
    ("table", "keys", "message"),
    [
        ("time [s],force_x [N]\n0,1\n1,2\n", {}, "unknown column of a wrench 'force_x'; did you mean 'force x'"),
        ("time [s],force x [N],temperature [C]\n0,1,2\n1,2,2\n", {}, "unknown column of a wrench 'temperature'"),
        ("time [s]\n0\n1\n", {}, "no column of a wrench found; expected: force x"),
        ("time [s],force x\n0,1\n1,2\n", {}, "column 'force x' has no unit; write 'force x \\[N\\]'"),
        ("time [s],force x [N m]\n0,1\n1,2\n", {}, "column 'force x' is in 'N m', expected"),
        ("time [s],torque z [N]\n0,1\n1,2\n", {}, "column 'torque z' is in 'N', expected"),
        ("time [s],force x [N]\n0,1\n0,2\n", {}, "time must increase"),
        ("time [s],force x [N]\n0,1\n1,nan\n", {}, "line 3, column 'force x \\[N\\]': 'nan' is not a finite number"),
        ("time [s],force x [N],force x [N]\n0,1,1\n1,2,1\n", {}, "there are two columns 'force x'"),
        ("time [s],force x [N]\n0,1\n1,2\n", {"force": [1, 0, 0]}, "'force' and 'file' exclude each other"),
        (None, {"file": None, "force": [1, 0, 0], "interpolation": "hold"}, "without a table is not interpolated"),
        (None, {}, "there is no such file"),
    ],
)  # fmt: skip
def test_a_wrench_s_table_that_cannot_be_meant_is_refused(
    tmp_path: Path, table: str | None, keys: dict[str, Any], message: str
) -> None:
    if table is not None:
        (tmp_path / "w.csv").write_text(table)
    force = {"name": "w", "kind": "wrench", "frame": "block", "file": "w.csv", **keys}
    with pytest.raises(bc.InputError, match=message):
        slider(tmp_path, {key: value for key, value in force.items() if value is not None})


def test_a_controller_does_not_count_and_is_named(folder: Path) -> None:
    control = [{"name": "keep", "kind": "pd", "joints": ["turn"], "target": {"turn": 1.0}, "kp": 500.0, "kd": 20.0}]
    scene = loaded(folder, "open", "damper", control=control)
    with_control, without = (bc.scene_inverse_dynamics(s, "go") for s in (scene, loaded(folder, "open", "damper")))
    assert np.array_equal(with_control.torque, without.torque)
    (note,) = with_control.notes
    assert (
        note.startswith("control 'keep' of the scene is not included")
        and note in bc.size(scene, scene.motion("go")).warnings
    )


@pytest.mark.tier2
def test_payloads_and_forces_count_together(folder: Path) -> None:
    scene = loaded(folder, "open", "spring_between", "wrench_linear")
    heavy = scene.with_overrides({"payloads": [{"mass": 4.0, "frame": "tip"}]})
    sized = bc.size(
        mechanism_of(scene, scene.config.robot([bc.Payload(4.0, "tip")])), scene.motion("go"), scene.config.actuators
    )
    wanted = held(heavy, "open", "go", TIMES)
    found = bc.scene_inverse_dynamics(heavy, "go")
    at_times = found.mechanism.torques(TIMES, *found.motion.at(TIMES))[0]
    np.testing.assert_allclose(at_times, wanted, rtol=0, atol=1e-8 * np.abs(wanted).max())
    assert sized.joint("slide").max_torque == pytest.approx(found.torque[:, 1].max(), rel=1e-3)
    assert sized.payloads == ((4.0, "tip"),)


@pytest.mark.tier2
def test_a_free_base_s_joints_are_sized_under_forces_and_the_base_is_named(tmp_path: Path) -> None:
    (tmp_path / "slider.urdf").write_text(SLIDER)
    text = "urdf: slider.urdf\nfloating_base: true\nmotions: {stay: {kind: dwell, position: {}, duration: 1}}\n"
    (tmp_path / "free.yaml").write_text(text)
    force = {"name": "w", "kind": "wrench", "frame": "block", "force": [7, 0, 3]}
    scene = bc.load_scene(tmp_path / "free.yaml", {"forces": [force]})
    found = bc.scene_inverse_dynamics(scene, "stay")
    assert found.actuated == ("slide",)
    np.testing.assert_allclose(found.torque, -7.0, atol=1e-12)
    assert found.equation_residual() > 0.5  # nothing holds the base against weight and push
    assert any("several degrees of freedom" in warning for warning in bc.size(scene, found.motion).warnings)


@pytest.mark.tier2
def test_a_counterbalance_spring_and_process_forces_change_the_sizing(tmp_path: Path) -> None:
    scene = bc.load_scene("planar_2r")
    spring = {"name": "balance", "kind": "joint_spring", "joint": "shoulder", "stiffness": 200.0}
    sprung = bc.load_scene("planar_2r", {"forces": [spring]})
    for name in ("elbow_up", "elbow_down"):
        plain, found = (bc.scene_inverse_dynamics(each, name) for each in (scene, sprung))
        np.testing.assert_allclose(found.torque - plain.torque, found.position * [200.0, 0.0], atol=1e-9)
    sizing = bc.size(sprung, [sprung.motion("elbow_up")], sprung.config.actuators)
    assert sizing.joint("shoulder").peak_torque > 1.5 * 168.3 and "forces joint_spring 'balance'" in table(sizing)


def test_the_mechanism_of_an_unknown_motion_or_joint_is_refused(folder: Path) -> None:
    scene = loaded(folder, "open", "damper")
    with pytest.raises(bc.InputError, match="did you mean 'stay'"):
        bc.scene_inverse_dynamics(scene, "stya")
    with pytest.raises(bc.InputError, match="all joints of an open chain are independent \\(turn, slide\\); remove"):
        bc.scene_inverse_dynamics(scene, "stay", independent=["turn"])
    with pytest.raises(bc.InputError, match="actuated leaves out slide"):
        bc.scene_inverse_dynamics(scene, "stay", actuated=["turn"])


@pytest.mark.tier2
def test_a_spring_that_the_block_passes_closely_is_resolved(tmp_path: Path) -> None:
    spring = {"name": "s", "kind": "spring", "frame_a": "block", "frame_b": "world", "point": [0.437, 2e-4, 0],
              "stiffness": 1.0e4, "free_length": 0.1}  # fmt: skip
    scene = slider(tmp_path, spring)  # its force along x jumps from -1000 N to 1000 N within 0.2 mm
    motion = scene.motion("go")
    line = bc.size(scene, motion).joint("slide")
    t = np.linspace(0.0, 4.0, 1_000_001)
    q, _, a = motion.at(t)
    way = 0.437 - q[:, 0]
    length = np.hypot(way, 2e-4)
    force = 2.0 * a[:, 0] - 1e4 * (length - 0.1) * way / length
    assert line.max_torque == pytest.approx(force.max(), rel=1e-6) and line.min_torque == pytest.approx(
        force.min(), rel=1e-6
    )
    assert line.rms_torque == pytest.approx(np.sqrt(np.trapezoid(force**2, t) / 4.0), rel=1e-7)


def test_a_frame_s_path_is_said_to_be_another_where_parameters_change_lengths() -> None:
    longer = {"reach": {"value": 1.1, "sets": ["joint.elbow.origin.x"]}}
    same = {"reach": {"value": 1.0, "sets": ["joint.elbow.origin.x"]}}
    for parameters, told in ((longer, True), (same, False)):
        found = bc.scene_inverse_dynamics("planar_2r", "elbow_up", overrides={"parameters": parameters})
        assert (
            any("'elbow_up' was made from a frame's path" in note and "reach" in note for note in found.notes) == told
        )


def test_a_saved_run_keeps_the_table_of_its_wrench(tmp_path: Path) -> None:
    (tmp_path / "push.csv").write_text("time [s],force x [N]\n0,1\n1,5\n2,-3\n")
    push = {"name": "push", "kind": "wrench", "frame": "block", "file": "push.csv", "interpolation": "cubic"}
    scene = slider(tmp_path, push)
    bc.simulate(scene, duration=1.0, samples=11).save(tmp_path / "run.npz")
    (tmp_path / "push.csv").unlink()
    run = bc.load_run(tmp_path / "run.npz")
    assert run.scene.forces[0].source is not None
    from scipy.interpolate import CubicSpline

    spline = CubicSpline([0.0, 1.0, 2.0], [1.0, 5.0, -3.0])
    np.testing.assert_allclose(run.acceleration[:, 0], spline(run.time) / 2.0, atol=1e-12)


def test_histories_have_both_sides_of_a_table_s_jump_and_are_the_same_motion(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "push.csv").write_text("time [s],force x [N]\n0,3\n1.0,40\n1.235,-70\n3.3,5\n")
    push = {"name": "push", "kind": "wrench", "frame": "block", "file": "push.csv", "interpolation": "hold"}
    scene = slider(tmp_path, push)
    with (tmp_path / "slider.yaml").open("a") as file:
        file.write(f"forces: [{json.dumps(push)}]\n")
    assert main(["size", "slider.yaml", "--motion", "go", "--no-plots", "--out", "o"]) == 0
    table = np.loadtxt(tmp_path / "o" / "history_go.csv", delimiter=",", skiprows=1)
    time, force = table[:, 0], table[:, 4] - 2.0 * table[:, 3]
    assert time.tolist() == [0.0, 1.0, 1.0, 1.235, 1.235, 2.0, 3.0, 3.3, 3.3, 4.0]
    np.testing.assert_allclose(force, [-3, -3, -40, -40, 70, 70, 70, 70, -5, -5], atol=1e-9)
    again, motion = bc.read_motion(scene.robot, tmp_path / "o" / "history_go.csv"), scene.motion("go")
    t = np.linspace(0.0, 4.0, 1001)
    for found, wanted in zip(again.at(t), motion.at(t), strict=True):
        np.testing.assert_allclose(found, wanted, atol=1e-9)


@pytest.mark.parametrize("shape", ["open", "closed"])
def test_tables_are_read_at_the_times_of_the_motion_whatever_the_clock_of_the_scene_s_start(
    folder: Path, shape: str
) -> None:
    scene = loaded(folder, shape, "wrench_linear", "torque_cubic")
    later = replace(scene, initial=replace(scene.initial, clock=0.7))
    found, wanted = (bc.scene_inverse_dynamics(each, "go") for each in (later, scene))
    assert np.array_equal(found.torque, wanted.torque) and np.array_equal(found.reactions, wanted.reactions)
