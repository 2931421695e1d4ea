"""Derivatives of inverse and forward dynamics against complex steps of the undifferentiated algorithms."""

import subprocess
import sys
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bellcrank as bc
from tests.support.complex_step import directional_derivatives
from tests.support.complex_step import dynamics_derivatives as expected
from tests.support.complex_step import random_state as state
from tests.support.extended_robots import MIXED, joint, link

pytestmark = pytest.mark.tier2

FRICTION_2R = {"shoulder": (0.7, 0.3), "elbow": (0.2, 0.0)}
ROBOTS = {
    "planar_2r with friction": ("planar_2r", {"friction": FRICTION_2R, "gravity": (0.3, -9.81, 0.2)}),
    "ur5": ("ur5", {}),
    "panda, a finger mimics": ("panda", {}),
    "solo12, free base": ("solo12", {"floating_base": True}),
    "talos, free base": ("talos", {"floating_base": True, "friction": "none"}),
}


def loaded(name):
    path, options = ROBOTS[name]
    return bc.load_robot(path, **options)


def assert_close(found, expected, tolerance=1e-10):
    for one, other in zip(found, expected, strict=True):
        assert np.abs(one - other).max() <= tolerance * np.abs(other).max()


@pytest.mark.parametrize("name", ROBOTS)
def test_derivatives_of_inverse_dynamics_are_those_of_complex_steps(name):
    robot = loaded(name)
    at = state(robot)
    assert_close(robot.inverse_dynamics_derivatives(*at), expected(robot, "inverse_dynamics", *at))


@pytest.mark.parametrize("name", ROBOTS)
def test_derivatives_of_forward_dynamics_are_those_of_complex_steps(name):
    robot = loaded(name)
    q, v, tau = state(robot)
    at = q, v, robot.inverse_dynamics(q, v, tau)
    assert_close(robot.forward_dynamics_derivatives(*at), expected(robot, "forward_dynamics", *at))


@pytest.fixture
def mixed(tmp_path):
    """A ball, a universal joint and a screw, with friction, also about the ball."""
    path = tmp_path / "mixed.urdf"
    path.write_text(MIXED)
    return bc.load_robot(path, friction={"ball": (0.4, 0.3), "screw": (0.1, 0.2)}, rotor_inertia={"screw": 0.05})


def test_derivatives_of_a_ball_a_universal_joint_and_a_screw(mixed):
    q, v, a = state(mixed)
    assert_close(mixed.inverse_dynamics_derivatives(q, v, a), expected(mixed, "inverse_dynamics", q, v, a))
    tau = mixed.inverse_dynamics(q, v, a)
    assert_close(mixed.forward_dynamics_derivatives(q, v, tau), expected(mixed, "forward_dynamics", q, v, tau))


@pytest.mark.parametrize("kind", ["planar", "prismatic", "continuous", "screw"])
def test_a_root_of_any_kind_and_several_roots(tmp_path, kind):
    """All that moves with one root is differentiated in a world that turns with it; with two roots there is none."""
    axis = "0 0 1" if kind == "planar" else "0.6 0 0.8"
    limit = '<limit lower="-1" upper="2" effort="3" velocity="4"/>' if kind in ("prismatic", "screw") else ""
    pitch = 'pitch="0.1"' if kind == "screw" else ""
    origin = '<origin xyz="0.3 0.2 0.1" rpy="0.4 0.3 0.2"/>'
    one = [
        '<link name="world"/>', link("body"), link("arm", "0.1 0.05 -0.3", 0.7),
        joint("root", kind, "world", "body", f'<axis xyz="{axis}"/>{limit}', origin, pitch),
        joint("turn", "continuous", "body", "arm", '<axis xyz="0 0.6 0.8"/>', origin),
    ]  # fmt: skip
    two = [*one, link("other"), joint("beside", "continuous", "world", "other", '<axis xyz="1 0 0"/>', origin)]
    for name, parts in (("one", one), ("two", two)):
        path = tmp_path / f"{name}.urdf"
        path.write_text("\n".join([f'<robot name="{name}">', *parts, "</robot>"]))
        robot = bc.load_robot(path, gravity=(1.0, 2.0, -9.0))
        q, v, a = state(robot)
        assert_close(robot.inverse_dynamics_derivatives(q, v, a), expected(robot, "inverse_dynamics", q, v, a))
        tau = robot.inverse_dynamics(q, v, a)
        assert_close(robot.forward_dynamics_derivatives(q, v, tau), expected(robot, "forward_dynamics", q, v, tau))


def test_the_convention_of_a_free_base_is_pinocchios():
    robot = bc.load_robot("solo12", floating_base=True, friction="none")
    q, v, a = state(robot)
    data = robot.model.createData()
    pin.computeRNEADerivatives(robot.model, data, q, v, a)
    upper = np.triu(data.M)
    symmetric = upper + np.triu(upper, 1).T
    assert_close(robot.inverse_dynamics_derivatives(q, v, a), (data.dtau_dq, data.dtau_dv, symmetric), 1e-12)
    step = 1e-6  # the definition, by Pinocchio's ⊕
    for k, delta in enumerate(step * np.eye(robot.nv)):
        higher, lower = (robot.inverse_dynamics(pin.integrate(robot.model, q, s * delta), v, a) for s in (1, -1))
        found = robot.inverse_dynamics_derivatives(q, v, a).by_position[:, k]
        assert np.abs((higher - lower) / (2 * step) - found).max() < 1e-7 * max(1.0, np.abs(found).max())


def test_a_batch_has_the_derivatives_of_its_samples():
    robot = bc.load_robot("panda")
    samples = [state(robot, seed) for seed in range(11)]
    q, v, a = (np.array(x) for x in zip(*samples, strict=True))
    for method in (robot.inverse_dynamics_derivatives, robot.forward_dynamics_derivatives):
        batch = method(q, v, a)
        assert [x.shape for x in batch] == [(11, robot.nv, robot.nv)] * 3
        for k, sample in enumerate(samples):
            assert_close([x[k] for x in batch], method(*sample), 1e-13)
        assert [x.shape for x in method(q[:0], v[:0], a[:0])] == [(0, robot.nv, robot.nv)] * 3
        repeated = method(q[0], v, a)  # a position is held
        assert_close([x[0] for x in repeated], method(*samples[0]), 1e-13)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-3, 3), min_size=18, max_size=18))
def test_the_mass_matrix_is_symmetric_and_both_derivatives_belong_together(numbers):
    robot = bc.load_robot("ur5", friction={"elbow_joint": (0.3, 0.4)})
    q, v, a = np.reshape(numbers, (3, 6))
    by_q, by_v, mass = robot.inverse_dynamics_derivatives(q, v, a)
    assert np.abs(mass - mass.T).max() <= 1e-13 * np.abs(mass).max()
    assert np.linalg.eigvalsh(mass).min() > 0.0
    tau = robot.inverse_dynamics(q, v, a)
    forward = robot.forward_dynamics_derivatives(q, v, tau)
    assert np.abs(forward.inverse_mass_matrix @ mass - np.eye(6)).max() < 1e-10
    assert np.abs(mass @ forward.by_position + by_q).max() <= 1e-9 * max(1.0, np.abs(by_q).max())
    assert np.abs(mass @ forward.by_velocity + by_v).max() <= 1e-9 * max(1.0, np.abs(by_v).max())


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-3, 3), min_size=12, max_size=12))
def test_the_derivative_of_the_energy_is_the_power(numbers):
    """∂τ/∂q at rest is the Hessian of the potential, and v' (Ṁ − 2 C) v = 0: ½ v' ∂τ/∂v v = v' C v = ½ v' Ṁ v."""
    robot = bc.load_robot("ur5", friction="none", gravity=(0.4, 0.2, -9.81))
    q, v = np.reshape(numbers, (2, 6))
    rest = np.zeros(6)
    hessian = robot.inverse_dynamics_derivatives(q, rest, rest).by_position
    assert np.abs(hessian - hessian.T).max() <= 1e-12 * max(1.0, np.abs(hessian).max())
    weightless = bc.load_robot("ur5", friction="none", gravity=(0, 0, 0))
    by_v = weightless.inverse_dynamics_derivatives(q, v, rest).by_velocity
    by_q = weightless.inverse_dynamics_derivatives(q, rest, v).by_position  # column k: ∂M/∂q_k v
    power = v @ weightless.inverse_dynamics(q, v, rest)  # v' C v
    assert abs(0.5 * v @ by_v @ v - power) <= 1e-10 * max(1.0, np.abs(by_v).max() * (v @ v))
    assert abs(0.5 * v @ by_q @ v - power) <= 1e-10 * max(1.0, np.abs(by_q).max() * (v @ v))


def test_a_singular_mass_matrix_is_refused(tmp_path):
    path = tmp_path / "light.urdf"
    path.write_text(
        '<robot name="light"><link name="base"/><link name="rod"/><joint name="pivot" type="continuous">'
        '<parent link="base"/><child link="rod"/><axis xyz="0 0 1"/></joint></robot>'
    )
    robot = bc.load_robot(path)
    with pytest.raises(bc.InputError, match="mass matrix is singular"):
        robot.forward_dynamics_derivatives([0.0], [0.0], [1.0])


def test_shapes_and_numbers_are_checked():
    robot = bc.load_robot("planar_2r")
    with pytest.raises(bc.InputError, match="argument 'v': expected an array of shape"):
        robot.inverse_dynamics_derivatives([0.0, 0.0], [0.0], [0.0, 0.0])
    with pytest.raises(bc.InputError, match="argument 'tau': expected finite numbers"):
        robot.forward_dynamics_derivatives([0.0, 0.0], [0.0, 0.0], [0.0, np.nan])


# ---- parameters

SPREAD = [
    "joint.elbow_joint.origin.x", "joint.elbow_joint.origin.pitch", "joint.wrist_1_joint.origin.yaw",
    "link.forearm_link.mass", "link.forearm_link.cg.y", "link.wrist_1_link.inertia.xy", "link.wrist_2_link.scale",
    "joint.elbow_joint.rotor_inertia", "joint.elbow_joint.viscous", "joint.elbow_joint.coulomb", "gravity.z",
]  # fmt: skip


def with_number(robot, name, shift):
    """A robot like this one whose number of that name is larger by `shift`, by other means than symbols."""
    kind, rest = name.split(".", 1)
    own, _, what = rest.rpartition(".")
    options = {"friction": {"elbow_joint": (0.3, 0.4)}, "rotor_inertia": {"elbow_joint": 0.2}, "gravity": (0, 0, -9.81)}
    if kind == "gravity":
        return bc.load_robot("ur5", **options | {"gravity": (0, 0, -9.81 + shift)})
    if what == "rotor_inertia":
        return bc.load_robot("ur5", **options | {"rotor_inertia": {own: 0.2 + shift}})
    if what in ("viscous", "coulomb"):
        pair = (0.3 + shift, 0.4) if what == "viscous" else (0.3, 0.4 + shift)
        return bc.load_robot("ur5", **options | {"friction": {own: pair}})
    raise AssertionError(name)


def parametric(robot, names):
    """(q, v, a, p) of the traced algorithm with parameters, which scenes use too, and the values of p."""
    return robot.equations.parametric("inverse_dynamics", names)


def test_derivatives_by_numbers_of_links_and_joints_are_those_of_complex_steps():
    robot = bc.load_robot("ur5", friction={"elbow_joint": (0.3, 0.4)}, rotor_inertia={"elbow_joint": 0.2})
    q, v, a = state(robot)
    found = robot.inverse_dynamics_parameter_derivatives(q, v, a, SPREAD)
    names = SPREAD[:7]
    tree = robot.equations.tree
    values = []
    for name in names:
        kind, rest = name.split(".", 1)
        own, *what = rest.split(".")
        frame = tree.frames[
            next(k for k, f in enumerate(tree.frames) if f.name == own and f.is_body == (kind == "link"))
        ]
        values.append({
            "x": frame.in_parent.translation[0], "pitch": frame.rpy[1], "yaw": frame.rpy[2], "mass": frame.mass,
            "y": frame.lever[1], "xy": frame.inertia[1], "scale": 1.0,
        }[what[-1]])  # fmt: skip
    zeros = [np.zeros((6, 7))] * 3
    steps = directional_derivatives(parametric(robot, names), (q, v, a, np.array(values)), [*zeros, np.eye(7)])
    for k in range(7):
        assert np.abs(found[:, k] - steps[:, k]).max() <= 1e-10 * np.abs(steps[:, k]).max()
    for k in range(7, len(SPREAD)):  # linear in these: any difference is exact but for rounding
        higher, lower = (with_number(robot, SPREAD[k], s).inverse_dynamics(q, v, a) for s in (0.1, -0.1))
        slope = (higher - lower) / 0.2
        assert np.abs(found[:, k] - slope).max() <= 1e-11 * np.abs(robot.inverse_dynamics(q, v, a)).max()
        assert np.abs(slope).max() > 0.01


def test_derivatives_by_the_ratio_and_offset_of_a_mimicking_joint(tmp_path):
    text = """<robot name="pair"><link name="base"/>{}{}
    <joint name="drive" type="revolute"><parent link="base"/><child link="one"/><axis xyz="0 1 0"/>
      <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
    <joint name="driven" type="revolute"><parent link="one"/><child link="two"/><origin xyz="0.3 0.1 0"/>
      <axis xyz="0 -1 0"/><limit lower="-9" upper="9" effort="1" velocity="1"/>
      <mimic joint="drive" multiplier="{}" offset="{}"/></joint></robot>"""
    link = (
        '<link name="{}"><inertial><origin xyz="0.2 0.1 0.05"/><mass value="1.5"/>'
        '<inertia ixx="0.1" iyy="0.2" izz="0.15" ixy="0.01" ixz="0" iyz="0"/></inertial></link>'
    )

    def robot(ratio, offset):
        path = tmp_path / f"pair_{ratio}_{offset}.urdf"
        path.write_text(text.format(link.format("one"), link.format("two"), repr(ratio), repr(offset)))
        return bc.load_robot(path, friction="none")

    at = [0.4], [1.3], [-0.7]
    names = ["joint.driven.ratio", "joint.driven.offset", "link.two.mass"]
    found = robot(-1.5, 0.2).inverse_dynamics_parameter_derivatives(*at, names)[0]

    def extrapolated(slope):  # Richardson's, over steps of 1e-2, 5e-3, 2.5e-3: the error is of the sixth order
        rows = [slope(1e-2 / 2**k) for k in range(3)]
        rows = [(4 * finer - coarser) / 3 for coarser, finer in pairwise(rows)]
        return (16 * rows[1] - rows[0]) / 15

    torque = lambda ratio, offset: robot(ratio, offset).inverse_dynamics(*at)[0]  # noqa: E731
    ratio = extrapolated(lambda h: (torque(-1.5 + h, 0.2) - torque(-1.5 - h, 0.2)) / (2 * h))
    offset = extrapolated(lambda h: (torque(-1.5, 0.2 + h) - torque(-1.5, 0.2 - h)) / (2 * h))
    assert found[0] == pytest.approx(ratio, rel=1e-9)
    assert found[1] == pytest.approx(offset, rel=1e-9)


def test_batches_and_names_of_parameters():
    robot = bc.load_robot("ur5")
    q, v, a = (np.tile(x, (9, 1)) for x in state(robot))
    names = ["link.forearm_link.mass", "gravity.z"]
    batch = robot.inverse_dynamics_parameter_derivatives(q, v, a, names)
    assert batch.shape == (9, 6, 2)
    assert np.allclose(batch[3], robot.inverse_dynamics_parameter_derivatives(q[0], v[0], a[0], names), rtol=1e-13)
    assert robot.inverse_dynamics_parameter_derivatives(q, v, a, []).shape == (9, 6, 0)
    for name, message in {
        "link.forearm.mass": "forearm_link",
        "link.forearm_link.colour": "a parameter cannot set .*gravity.x",
        "joint.elbow.viscous": "did you mean",
        "joint.elbow_joint.ratio": "joint that mimics",
    }.items():
        with pytest.raises(bc.InputError, match=message):
            robot.inverse_dynamics_parameter_derivatives(q, v, a, [name])


def test_cached_derivatives_import_neither_casadi_nor_the_tracer():
    program = (
        "import sys, bellcrank as bc\n"
        "robot, q = bc.load_robot('planar_2r'), [0.1, 0.2]\n"
        "robot.inverse_dynamics_derivatives(q, q, q), robot.forward_dynamics_derivatives(q, q, q)\n"
        "robot.inverse_dynamics_parameter_derivatives(q, q, q, ['link.link_1.mass', 'gravity.y'])\n"
        "print('casadi' in sys.modules or 'bellcrank._trace' in sys.modules)"
    )
    runs = [subprocess.run([sys.executable, "-c", program], capture_output=True, text=True) for _ in range(2)]
    assert runs[1].stdout.strip() == "False", runs[1].stderr
