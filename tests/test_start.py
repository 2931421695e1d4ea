"""The start of a scene: floating and planar joints, velocities that are given in part, and saved runs."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import bellcrank as bc
from bellcrank.errors import InputError
from bellcrank.scene.scene import load_scene
from bellcrank.simulation.simulate import simulate

BODY = (
    '<inertial><origin xyz="0.02 -0.03 0.05"/><mass value="{mass}"/>'
    '<inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.03" iyz="0.002" izz="0.025"/></inertial>'
)
CARRIER = f"""<robot name="carrier"><link name="ground"/>
<link name="arm">{BODY.format(mass=2)}</link><link name="puck">{BODY.format(mass=0.5)}</link>
<joint name="turn" type="continuous"><parent link="ground"/><child link="arm"/>
  <origin xyz="0.1 0.2 0.3" rpy="0.3 -0.2 0.5"/><axis xyz="0 0 1"/></joint>
<joint name="loose" type="KIND"><parent link="arm"/><child link="puck"/>
  <origin xyz="0.4 -0.1 0.2" rpy="-0.4 0.6 0.2"/><axis xyz="0 0 1"/></joint></robot>"""


def carrier(folder, kind, text=""):
    """A turning arm that a body is joined to by a floating or planar joint, as a scene."""
    (folder / "carrier.urdf").write_text(CARRIER.replace("KIND", kind))
    (folder / "carrier.yaml").write_text(f"name: Carrier\nurdf: carrier.urdf\ngravity: [0, 0, 0]\n{text}")
    return load_scene(folder / "carrier.yaml")


def pose_of(scene, q):
    """Position and rotation of the puck in the joint's frame on the arm, by Pinocchio's own placements."""
    import pinocchio as pin

    model = scene.robot.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    joint = model.getJointId("loose")
    holder = data.oMi[model.parents[joint]] * model.jointPlacements[joint]
    found = holder.actInv(data.oMi[joint])
    return found.translation, found.rotation


def rate_of(scene, q, v, h=1e-5):
    """Rates of that pose, in the axes of the joint's frame, by central differences."""
    import pinocchio as pin

    (p1, r1), (p2, r2) = (pose_of(scene, pin.integrate(scene.robot.model, q, s * h * v)) for s in (-1.0, 1.0))
    return (p2 - p1) / (2 * h), Rotation.from_matrix(r2 @ r1.T).as_rotvec() / (2 * h)


@pytest.mark.parametrize("axes", ["parent", "body"])
def test_a_floating_joint_in_the_tree_starts_at_its_pose_and_velocity(tmp_path, axes):
    position, rpy, linear, angular = [0.1, -0.2, 0.3], [0.4, 0.5, -0.6], [0.3, -0.1, 0.2], [1.0, -2.0, 0.5]
    scene = carrier(
        tmp_path,
        "floating",
        f"initial: {{turn: 0.7, loose: {{position: {position}, rpy: {rpy}, linear_velocity: {linear}, "
        f"angular_velocity: {angular}, expressed_in: {axes}}}, velocity: {{turn: 2}}}}",
    )
    q, v = scene.start
    found, turned = pose_of(scene, q)
    np.testing.assert_allclose(found, position, atol=1e-14)
    wanted = Rotation.from_euler("xyz", rpy).as_matrix()
    np.testing.assert_allclose(turned, wanted, atol=1e-14)
    speed, spin = rate_of(scene, q, v)
    back = wanted if axes == "body" else np.eye(3)
    np.testing.assert_allclose(speed, back @ linear, atol=1e-8)
    np.testing.assert_allclose(spin, back @ angular, atol=1e-8)
    quaternion = Rotation.from_euler("xyz", rpy).as_quat().tolist()
    free = dict(scene.data["initial"]["loose"], quaternion_xyzw=quaternion)
    del free["rpy"]
    np.testing.assert_allclose(scene.with_overrides({"initial.loose": free}).start[0], q, atol=1e-15)


@pytest.mark.parametrize("axes", ["parent", "body"])
def test_a_planar_joint_starts_at_its_place_angle_and_rates(tmp_path, axes):
    scene = carrier(
        tmp_path,
        "planar",
        "initial: {turn: -0.4, loose: {position: [0.1, -0.2], angle: 70 deg, linear_velocity: [0.3, -0.1], "
        f"angular_velocity: 90 deg/s, expressed_in: {axes}}}}}",
    )
    q, v = scene.start
    found, turned = pose_of(scene, q)
    wanted = Rotation.from_euler("z", 70, degrees=True).as_matrix()
    np.testing.assert_allclose(found, [0.1, -0.2, 0], atol=1e-14)
    np.testing.assert_allclose(turned, wanted, atol=1e-14)
    speed, spin = rate_of(scene, q, v)
    np.testing.assert_allclose(speed, (wanted if axes == "body" else np.eye(3)) @ [0.3, -0.1, 0], atol=1e-8)
    np.testing.assert_allclose(spin, [0, 0, np.pi / 2], atol=1e-8)


def test_a_floating_joint_under_a_fixed_arm_flies_as_a_thrown_body(tmp_path):
    scene = carrier(
        tmp_path,
        "floating",
        "initial: {loose: {position: [0.1, 0, 0], linear_velocity: [1, 2, 3], angular_velocity: [3, 4, 5]}}\n"
        "outputs: {energy: {energy: kinetic}}\nsimulate: {duration: 0.5, rtol: 1e-11, atol: 1e-11}",
    )
    run = simulate(scene)
    assert run.success
    model, mass = scene.robot.model, 0.5
    import pinocchio as pin

    data = model.createData()
    centre = []
    for q in run.position[[0, -1]]:
        pin.framesForwardKinematics(model, data, q)
        centre.append(data.oMi[2].act(model.inertias[2].lever))
    pin.framesForwardKinematics(model, data, run.position[0])
    twist = data.oMi[2].rotation @ (run.velocity[0, 1:4] + np.cross(run.velocity[0, 4:], model.inertias[2].lever))
    np.testing.assert_allclose(centre[1] - centre[0], 0.5 * twist, atol=1e-9)  # no gravity: straight on
    assert model.inertias[2].mass == mass
    np.testing.assert_allclose(run.kinetic_energy, run.kinetic_energy[0], rtol=1e-9)


# ---- velocities and positions that are given in part

ROLLER = """
name: Roller
urdf: thin_disk
floating_base: true
closures: [{{name: floor, kind: rolling_disk, frame: disk, axis: [0, 1, 0], radius: 0.1}}]
base: {{{base}}}
"""
TILTED = "position: [0, 0, 0.09], rpy: [{tilt}, 0.3, 0.4]"


def roller(folder, base):
    (folder / "roller.yaml").write_text(ROLLER.format(base=base))
    return load_scene(folder / "roller.yaml")
