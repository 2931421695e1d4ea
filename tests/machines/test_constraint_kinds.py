"""Each kind of constraint: a body that is held by it moves as one that hangs at the joint, and forces balance.

The arm has two joints about skew axes. Its bob hangs at a joint of the tree (the reference), or is a free body that a
constraint holds.
"""

import math

import numpy as np
import pinocchio as pin
import pytest
import yaml
from scipy.integrate import cumulative_simpson

import bellcrank as bc

GRAVITY = [0.7, -1.3, -9.2]
MASS, CENTRE = 1.7, np.array([0.11, -0.07, 0.23])
ABOUT = np.array([[0.021, 0.002, -0.003], [0.002, 0.034, 0.004], [-0.003, 0.004, 0.027]])  # kg m², about the centre
PLACE, TURN = [0.4, 0.1, -0.2], [0.3, -0.5, 0.2]  # of the joint on the second link
AXIS = "0.6 0 0.8"
TIGHT = {"solver": "DOP853", "rtol": 1e-11, "atol": 1e-12, "samples": 21}
START = {"shoulder": 0.4, "elbow": -0.7, "velocity": {"shoulder": 0.9, "elbow": -1.2}}


def link(name, mass, centre, about):
    xx, xy, xz, yy, yz, zz = about
    return (
        f'<link name="{name}"><inertial><origin xyz="{" ".join(map(str, centre))}"/><mass value="{mass}"/>'
        f'<inertia ixx="{xx}" ixy="{xy}" ixz="{xz}" iyy="{yy}" iyz="{yz}" izz="{zz}"/></inertial></link>'
    )


def joint(name, kind, parent, child, axis="0 0 1", xyz=(0, 0, 0), rpy=(0, 0, 0), more=""):
    place = f'<origin xyz="{" ".join(map(str, xyz))}" rpy="{" ".join(map(str, rpy))}"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{place}'
        f'<axis xyz="{axis}"/><limit lower="-9" upper="9" effort="99" velocity="99"/>{more}</joint>'
    )


def arm(*more, mimic=""):
    return "".join(
        [
            '<robot name="arm"><link name="base"/>',
            link("upper", 2.3, (0.3, 0.05, 0.1), (0.02, 0.003, 0.001, 0.09, -0.002, 0.08)),
            link("fore", 1.4, (0.2, -0.04, 0.06), (0.01, 0.001, -0.002, 0.05, 0.003, 0.04)),
            joint("shoulder", "revolute", "base", "upper", "0 0.8 0.6"),
            joint("elbow", "revolute", "upper", "fore", "0.8 0 -0.6", (0.6, 0.1, 0), (0.2, 0, 0.4), mimic),
            *more,
            "</robot>",
        ]
    )


BOB = link("bob", MASS, CENTRE, (ABOUT[0, 0], ABOUT[0, 1], ABOUT[0, 2], ABOUT[1, 1], ABOUT[1, 2], ABOUT[2, 2]))
FREE = arm(BOB, joint("bob_pose", "floating", "base", "bob"))


def hung(*joints):
    """The arm whose bob hangs at joints of one degree of freedom: (kind, axis), from the arm outwards."""
    parts, parent = [BOB], "fore"
    for k, (kind, axis) in enumerate(joints):
        last = k == len(joints) - 1
        child = "bob" if last else f"between_{k}"
        parts += [] if last else [f'<link name="{child}"/>']
        first = {"xyz": PLACE, "rpy": TURN} if k == 0 else {}
        parts.append(joint(f"hold_{k}", kind, parent, child, axis, **first))
        parent = child
    return arm(*parts)


# kind of the constraint: (its keys beside the frames, the joints of the tree, their positions and velocities)
HELD = {
    "weld": ({}, [("fixed", AXIS)], {}, {}),
    "hinge": ({"axis": [0.6, 0, 0.8]}, [("revolute", AXIS)], {"hold_0": 0.3}, {"hold_0": -1.1}),
    "prismatic": ({"axis": [0.6, 0, 0.8]}, [("prismatic", AXIS)], {"hold_0": 0.1}, {"hold_0": 0.5}),
    "universal": (
        {"axis": [0, 1, 0], "axis_2": [0.6, 0, 0.8]},
        [("revolute", AXIS), ("revolute", "0 1 0")],
        {"hold_0": 0.3, "hold_1": -0.4},
        {"hold_0": -1.1, "hold_1": 0.8},
    ),
    "point": (
        {},
        [("revolute", "1 0 0"), ("revolute", "0 1 0"), ("revolute", "0 0 1")],
        {"hold_0": 0.3, "hold_1": -0.4, "hold_2": 0.6},
        {"hold_0": -1.1, "hold_1": 0.8, "hold_2": 0.5},
    ),
    "planar": (
        {"axis": [0, 0, 1]},
        [("prismatic", "1 0 0"), ("prismatic", "0 1 0"), ("revolute", "0 0 1")],
        {"hold_0": 0.05, "hold_1": -0.1, "hold_2": 0.6},
        {"hold_0": 0.3, "hold_1": 0.2, "hold_2": -0.9},
    ),
}  # fmt: skip


def written(folder, name, urdf, **scene):
    (folder / f"{name}.urdf").write_text(urdf)
    path = folder / f"{name}.yaml"
    path.write_text(yaml.safe_dump({"urdf": f"{name}.urdf", "gravity": GRAVITY, "initial": START, **scene}))
    return bc.load_scene(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("kinds")


@pytest.fixture(scope="module", params=HELD)
def pair(request, folder):
    """A kind, the run of the tree, and the run of the free bob that the constraint holds."""
    kind = request.param
    keys, joints, position, velocity = HELD[kind]
    start = {**START, **position, "velocity": {**START["velocity"], **velocity}}
    tree = bc.simulate(written(folder, f"{kind}_tree", hung(*joints), initial=start), 0.5, **TIGHT)
    bob = tree.frame("bob")
    pose = {
        "position": {"guess": bob.position[0].tolist()},
        "quaternion_xyzw": {"guess": pin.Quaternion(bob.rotation[0]).coeffs().tolist()},
        "linear_velocity": bob.velocity[0].tolist(),
        "angular_velocity": bob.angular_velocity[0].tolist(),
    }
    scene = written(
        folder,
        kind,
        FREE,
        initial={**START, "bob_pose": pose},
        frames={"socket": {"link": "fore", "xyz": PLACE, "rpy": TURN}},
        constraints=[{"name": "hold", "kind": kind, "frame_a": "bob", "frame_b": "socket", **keys}],
    )
    return kind, tree, bc.simulate(scene, 0.5, **TIGHT)


def test_a_body_that_a_constraint_holds_moves_as_at_the_joint(pair):
    _, tree, held = pair
    assert held.success and held.constraint_residual() < 1e-12
    for name in ("bob", "fore"):
        expected, found = tree.frame(name), held.frame(name)
        for what in ("position", "rotation", "velocity", "angular_velocity"):
            assert getattr(found, what) == pytest.approx(getattr(expected, what), abs=1e-8)
    assert held.total_energy == pytest.approx(np.full(21, held.total_energy[0]), abs=1e-8)
    assert np.abs(tree.frame("bob").position[-1] - tree.frame("bob").position[0]).max() > 0.05


def test_forces_of_a_constraint_are_what_newton_and_euler_ask_of_the_body(pair):
    """m (a - g) = F, and dL/dt about the bob's origin = M, with force and moment by the rows of the kind."""
    kind, _, held = pair
    place = held.robot.joint("bob_pose").v
    bob, socket = held.frame("bob"), held.frame("socket").rotation
    for k in range(0, 21, 4):
        turn, spin = bob.rotation[k], bob.angular_velocity[k]
        v, a = held.velocity[k, place : place + 6], held.acceleration[k, place : place + 6]
        origin = turn @ (a[:3] + np.cross(v[3:], v[:3]))  # acceleration of the origin, in the world
        spin_up, arm_, about = turn @ a[3:], turn @ CENTRE, turn @ ABOUT @ turn.T
        centre = origin + np.cross(spin_up, arm_) + np.cross(spin, np.cross(spin, arm_))
        force = MASS * (centre - GRAVITY)
        moment = about @ spin_up + np.cross(spin, about @ spin) + np.cross(arm_, force)
        found_force, found_moment = _of_rows(kind, held.multipliers[k], bob.rotation[k], socket[k])
        size = np.abs(held.multipliers[k]).max()
        assert found_force == pytest.approx(force, abs=1e-8 * size)
        assert found_moment == pytest.approx(moment, abs=1e-8 * size)


def _of_rows(kind, rows, bob, socket):
    """Force and moment about the bob's origin, in the world, of the multipliers."""
    none = np.zeros(3)
    axis = np.array([0.6, 0.0, 0.8])
    if kind == "point":
        return rows, none
    if kind == "weld":
        return rows[:3], socket @ rows[3:]
    if kind == "universal":
        return rows[:3], rows[3] * np.cross(bob @ [0.0, 1.0, 0.0], socket @ axis)
    if kind == "planar":
        axis = np.array([0.0, 0.0, 1.0])
    first = np.cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis)
    first /= np.linalg.norm(first)
    n, k = [socket @ first, socket @ np.cross(axis, first)], bob @ axis
    if kind == "prismatic":
        return rows[0] * n[0] + rows[1] * n[1], socket @ rows[2:]
    moment = rows[-2] * np.cross(k, n[0]) + rows[-1] * np.cross(k, n[1])
    return (rows[:3] if kind == "hinge" else rows[0] * (socket @ axis)), moment


def test_a_rod_carries_a_conical_pendulum(folder):
    """ω² = g / (l cos α): the bob circles at its height, and the rod pulls with m g / cos α."""
    length, angle, g = 0.8, 0.6, 9.81
    rate = math.sqrt(g / (length * math.cos(angle)))
    radius, fixed = length * math.sin(angle), [0.3, -0.2, 1.1]
    ball = f'<robot name="ball">{link("ball", 1.3, (0, 0, 0), (0.01, 0, 0, 0.02, 0, 0.03))}</robot>'
    scene = written(
        folder,
        "ball",
        ball,
        floating_base=True,
        gravity=[0, 0, -g],
        initial={},
        base={"position": [fixed[0] + radius, fixed[1], fixed[2] - length * math.cos(angle)],
              "linear_velocity": [0, radius * rate, 0]},
        constraints=[{"kind": "distance", "frame_a": "ball", "frame_b": "world", "point": fixed,
                      "length": length}],
    )  # fmt: skip
    run = bc.simulate(scene, 2.0, **TIGHT)
    turned = rate * run.time
    expected = fixed + np.stack(
        [radius * np.cos(turned), radius * np.sin(turned), 0 * turned - length * np.cos(angle)], 1
    )
    assert run.position[:, :3] == pytest.approx(expected, abs=1e-8)
    assert run.multipliers[:, 0] == pytest.approx(np.full(21, -1.3 * g / np.cos(angle)), rel=1e-8)


def test_a_coupling_is_a_mimic_joint_and_its_multiplier_the_torque_on_the_second_joint(folder):
    ratio, offset = -1.6, 0.35
    start = {"shoulder": 0.4, "elbow": {"guess": -0.3}, "velocity": {"shoulder": 0.9}}
    coupling = {"kind": "coupling", "joint_a": "shoulder", "joint_b": "elbow", "ratio": ratio, "offset": offset}
    held = bc.simulate(written(folder, "coupled", arm(), initial=start, constraints=[coupling]), 0.6, **TIGHT)
    mimic = arm(mimic=f'<mimic joint="shoulder" multiplier="{ratio}" offset="{offset}"/>')
    start = {"shoulder": 0.4, "velocity": {"shoulder": 0.9}}
    tree = bc.simulate(written(folder, "mimic", mimic, initial=start), 0.6, **TIGHT)
    assert held.position[:, 0] == pytest.approx(tree.position[:, 0], abs=1e-9)
    assert held.position[:, 1] == pytest.approx(ratio * tree.position[:, 0] + offset, abs=1e-9)
    torque = held.robot.inverse_dynamics(held.position, held.velocity, held.acceleration)
    assert torque[:, 1] == pytest.approx(held.multipliers[:, 0], abs=1e-9)
    assert torque[:, 0] == pytest.approx(-ratio * held.multipliers[:, 0], abs=1e-9)
    assert np.abs(held.multipliers).max() > 1.0 and held.multiplier_names == (("coupling", "torque on elbow [N m]"),)


def test_a_prescribed_motion_is_followed_with_the_torque_of_inverse_dynamics(folder):
    motion = {
        "kind": "waypoints",
        "times": [0, 0.3, 0.7],
        "positions": [{"shoulder": 0.4}, {"shoulder": 0.9}, {"shoulder": 0.1}],
    }
    start = {"motion": "move", "elbow": -0.7, "velocity": {"elbow": -1.2}}
    scene = written(
        folder,
        "driven",
        arm(),
        initial=start,
        motions={"move": motion},
        constraints=[{"name": "motor", "kind": "prescribed_motion", "joint": "shoulder", "motion": "move"}],
    )
    run = bc.simulate(scene, 0.7, "DOP853", rtol=1e-11, atol=1e-12, samples=1401)
    position, velocity, acceleration = (rows[:, 0] for rows in scene.motion("move").at(run.time))
    assert run.position[:, 0] == pytest.approx(position, abs=1e-10)
    assert run.velocity[:, 0] == pytest.approx(velocity, abs=1e-9)
    assert run.acceleration[:, 0] == pytest.approx(acceleration, abs=1e-8)
    torque = run.robot.inverse_dynamics(run.position, run.velocity, run.acceleration)
    assert torque == pytest.approx(np.stack([run.multipliers[:, 0], 0 * run.time], axis=1), abs=1e-9)
    work = cumulative_simpson(run.multipliers[:, 0] * run.velocity[:, 0], x=run.time, initial=0.0)
    assert np.abs(work).max() > 1.0 and run.work == pytest.approx(work, abs=1e-6)
    assert run.energy_drift() < 1e-9


@pytest.mark.parametrize("moving", [False, True], ids=["positions", "velocities"])
def test_an_expression_is_kept_with_forces_along_its_gradient(folder, moving):
    """φ = elbow - 0.7 sin(2 shoulder) - 0.3 t + c, or its rate: M v̇ + h = λ ∂φ/∂q in both cases."""
    shift = -0.7 - 0.7 * math.sin(0.8)
    expression = f"elbow.position - 0.7*sin(2*shoulder.position) - 0.3*t - ({shift!r})"
    if moving:
        expression = "elbow.velocity - 1.4*cos(2*shoulder.position)*shoulder.velocity - 0.3"
    entry = {"name": "own", "kind": "expression", "expression": expression, "unit": "rad/s" if moving else "rad"}
    start = {"shoulder": 0.4, "elbow": -0.7, "velocity": {"shoulder": 0.9}}
    scene = written(folder, f"own_{moving}", arm(), initial=start, constraints=[entry])
    run = bc.simulate(scene, 0.5, **TIGHT)
    q, v = run.position, run.velocity
    assert q[:, 1] == pytest.approx(0.7 * np.sin(2 * q[:, 0]) + 0.3 * run.time + shift, abs=1e-9)
    gradient = np.stack([-1.4 * np.cos(2 * q[:, 0]), np.ones(21)], axis=1)
    assert (gradient * v).sum(axis=1) == pytest.approx(np.full(21, 0.3), abs=1e-9)
    torque = run.robot.inverse_dynamics(q, v, run.acceleration)
    assert torque == pytest.approx(run.multipliers[:, :1] * gradient, abs=1e-9)
    assert np.abs(run.multipliers).max() > 1.0 and run.multiplier_names == (("own", "torque [N m]"),)


def test_a_constraint_by_a_python_function_is_the_expression(folder):
    scene = written(folder, "bare", arm(), initial={"shoulder": 0.4, "elbow": -0.7, "velocity": {"shoulder": 0.9}})

    def straight(symbols):
        return symbols.joint("elbow").position + 2 * symbols.joint("shoulder").position - 0.1

    own = bc.simulate(scene.with_constraint(straight, name="own", unit="rad"), 0.4, **TIGHT)
    entry = {
        "name": "own",
        "kind": "expression",
        "expression": "elbow.position + 2*shoulder.position - 0.1",
        "unit": "rad",
    }
    text = bc.simulate(scene.with_overrides({"constraints": [entry]}), 0.4, **TIGHT)
    assert own.state == pytest.approx(text.state, abs=1e-12)
    assert own.multipliers == pytest.approx(text.multipliers, abs=1e-9)
    assert own.position[:, 1] == pytest.approx(0.1 - 2 * own.position[:, 0], abs=1e-12)
