"""Joints of every type, in the middle of a chain, against a model that is built of Pinocchio's joints by hand."""

import numpy as np
import pinocchio as pin
import pytest
from extended_robots import joint, link
from extrapolated import slope
from plain_pinocchio import PlainRobot
from properties.dynamics import close

import bellcrank as bc

AXIS, OTHER = np.array([0.48, -0.6, 0.64]), np.array([0.2, 0.9, -0.4])
ACROSS = np.cross(AXIS, OTHER) / np.linalg.norm(np.cross(AXIS, OTHER))  # both of length 1, and normal to each other
XYZ, RPY = np.array([0.3, -0.2, 0.5]), np.array([0.4, -0.7, 1.1])
ORIGIN = f'<origin xyz="{" ".join(map(repr, XYZ.tolist()))}" rpy="{" ".join(map(repr, RPY.tolist()))}"/>'
LIMIT = '<limit lower="-2" upper="3" effort="7" velocity="5"/>'
PITCH = -0.35  # m per revolution: a left-handed thread
GRAVITY, WIDTH = (1.3, -2.7, -8.9), 0.4


def axis_of(axis, tag="axis"):
    return f'<{tag} xyz="{" ".join(repr(float(x)) for x in axis)}"/>'


MIMIC = '<mimic joint="continuous" multiplier="-1.7" offset="0.2"/><dynamics damping="0.3" friction="0.2"/>'
TYPES = {  # what stands in the joint, its attributes, and Pinocchio's joints
    "revolute": (axis_of(AXIS) + LIMIT, "", [pin.JointModelRevoluteUnaligned(AXIS)]),
    "continuous": (axis_of(ACROSS), "", [pin.JointModelRevoluteUnaligned(ACROSS)]),
    "prismatic": (axis_of(AXIS) + LIMIT, "", [pin.JointModelPrismaticUnaligned(AXIS)]),
    "screw": (axis_of(AXIS) + LIMIT, f'pitch="{PITCH}"', [pin.JointModelHelicalUnaligned(AXIS, PITCH / (2 * np.pi))]),
    "spherical": ("", "", [pin.JointModelSpherical()]),
    "universal": (
        axis_of(AXIS) + axis_of(ACROSS, "axis2"), "",
        [pin.JointModelRevoluteUnaligned(AXIS), pin.JointModelRevoluteUnaligned(ACROSS)],
    ),
    "planar": (axis_of((0, 0, 1)), "", [pin.JointModelPlanar()]),
    "floating": ("", "", [pin.JointModelFreeFlyer()]),
    "mimic": (axis_of(AXIS) + LIMIT + MIMIC, "", [pin.JointModelRevoluteUnaligned(AXIS)]),
}  # fmt: skip
CHAINS = (
    ("continuous", "spherical", "screw"), ("revolute", "floating", "universal"), ("planar", "prismatic", "continuous"),
    ("continuous", "mimic", "revolute"),
)  # fmt: skip


@pytest.fixture(scope="module", params=CHAINS, ids="-".join)
def pair(request, tmp_path_factory):
    """The types, the robot with friction, rotors and gravity askew, and the same by hand."""
    chain, path = request.param, tmp_path_factory.mktemp("chain") / "chain.urdf"
    lines, above = ['<robot name="chain"><link name="world"/>'], "world"
    for k, kind in enumerate(chain):
        inner, attributes, _ = TYPES[kind]
        lines.append(link(f"link_{k}", mass=1.7 - 0.4 * k))
        written = "revolute" if kind == "mimic" else kind
        lines.append(joint(kind, written, above, f"link_{k}", inner, ORIGIN, attributes))
        above = f"link_{k}"
    path.write_text("\n".join([*lines, "</robot>"]))
    mimics = "mimic" in chain
    names = [j.name for j in bc.load_robot(path).joints if j.nv == 1 or j.kind == "spherical"]
    friction = {name: (0.3 + 0.1 * k, 0.5 + 0.2 * k) for k, name in enumerate(names)}
    if mimics:  # the file's own: a follower's acts on its leader through the ratio
        friction = {"continuous": (1.7**2 * 0.3, 1.7 * 0.2)}
    options = {"gravity": GRAVITY, "rotor_inertia": {name: 0.02 + 0.03 * k for k, name in enumerate(names)}}
    own = {"friction": "urdf" if mimics else friction, "friction_width": WIDTH, "clean": False}
    robot = bc.load_robot(path, **options, **own)
    return chain, robot, PlainRobot(robot, path, **options, model=by_hand(chain)), friction


def by_hand(chain):
    model, body = pin.Model(), 0
    moments = np.array([[0.02, 0.001, 0.002], [0.001, 0.03, -0.001], [0.002, -0.001, 0.025]])
    for number, kind in enumerate(chain):
        place, parts = pin.SE3(pin.rpy.rpyToMatrix(*RPY), XYZ), TYPES[kind][2]
        for k, part in enumerate(parts):
            own = kind if len(parts) == 1 else f"{kind}_{k + 1}"
            body = model.addJoint(body, part, place if k == 0 else pin.SE3.Identity(), own)
        inertia = pin.Inertia(1.7 - 0.4 * number, np.array([0.1, 0.05, -0.8]), moments)
        model.appendBodyToJoint(body, inertia, pin.SE3.Identity())
        model.addFrame(pin.Frame(f"link_{number}", body, pin.SE3.Identity(), pin.FrameType.BODY))
    return model


def states(robot, count, seed=4):
    random = np.random.default_rng(seed)
    q, (v, a) = random.uniform(-1.3, 1.3, (count, robot.nq)), random.normal(size=(2, count, robot.nv))
    for own in robot.joints:
        if own.nq != own.nv:
            part = slice(own.q + {"planar": 2, "floating": 3, "spherical": 0}[own.kind], own.q + own.nq)
            q[:, part] /= np.linalg.norm(q[:, part], axis=1, keepdims=True)
    return q, v, a


def friction_by_hand(robot, friction, v):
    """Of each joint by itself; about a ball along its angular velocity."""
    found = np.zeros_like(v)
    for name, (viscous, coulomb) in friction.items():
        own = robot.joint(name)
        part = slice(own.v, own.v + own.nv)
        found[part] = viscous * v[part] + coulomb * v[part] / np.hypot(np.linalg.norm(v[part]), WIDTH)
    return found


def test_coordinates_are_those_of_the_types(pair):
    chain, robot, _, _ = pair
    sizes = {"spherical": (4, 3), "planar": (4, 3), "floating": (7, 6), "universal": (2, 2), "mimic": (0, 0)}
    nq, nv = np.sum([sizes.get(kind, (1, 1)) for kind in chain], axis=0)
    assert (robot.nq, robot.nv) == (nq, nv)
    for own in robot.joints:
        if own.name in ("revolute", "prismatic", "screw"):
            assert (robot.lower[own.q], robot.upper[own.q]) == (-2.0, 3.0)
            assert (robot.effort_limit[own.v], robot.velocity_limit[own.v]) == (7.0, 5.0)
    if "mimic" in chain:  # −2 to 3 rad at −1.7 q + 0.2, and 5 rad/s at 1.7
        assert robot.lower[0] == pytest.approx((3.0 - 0.2) / -1.7) and robot.upper[0] == pytest.approx(2.2 / 1.7)
        assert robot.velocity_limit[0] == pytest.approx(5.0 / 1.7)


def test_dynamics_are_those_of_pinocchios_joints(pair):
    _, robot, plain, friction = pair
    q, v, a = states(robot, 6)
    found, mass = robot.inverse_dynamics(q, v, a), robot.mass_matrix(q)
    energies, forward, still = robot.energy(q, v), robot.forward_dynamics(q, v, a), robot.gravity_torque(q)
    for k, state in enumerate(zip(q, v, a, strict=True)):
        lost = friction_by_hand(robot, friction, v[k])
        close(robot.friction_torque(v[k]), lost)
        close(found[k], plain.inverse_dynamics(*state) + lost)
        close(mass[k], plain.mass_matrix(q[k]))
        close(still[k], plain.gravity_torque(q[k]))
        close([energy[k] for energy in energies], plain.energy(q[k], v[k]))
        close(forward[k], plain.forward_dynamics(q[k], v[k], a[k] - lost), 1e-10)


def test_links_and_joints_move_and_bear_as_pinocchios(pair):
    _, robot, plain, _ = pair
    q, v, a = states(robot, 6)
    found = [*robot.frame_pose("link_2", q), *robot.frame_velocity("link_2", q, v)]
    found += robot.frame_acceleration("link_2", q, v, a)
    wrenches = robot.joint_reactions(q, v, a)
    for k, state in enumerate(zip(q, v, a, strict=True)):
        for own, value in zip(found, plain.frame("link_2", *state).values(), strict=True):
            close(own[k], value)
        expected = plain.reactions(*state)
        close(wrenches[k], [expected[name] for name in robot.all_joint_names])
        rate = slope(lambda h, k=k: plain.displaced(q[k], h * v[k]))
        assert robot.configuration_rate(q[k], v[k]) == pytest.approx(rate, rel=1e-10, abs=1e-10)


def test_derivatives_are_extrapolated_differences(pair):
    _, robot, plain, friction = pair
    q, v, a = (x[0] for x in states(robot, 1, seed=9))
    found = robot.inverse_dynamics_derivatives(q, v, a)

    def torque(q, v):
        return plain.inverse_dynamics(q, v, a) + friction_by_hand(robot, friction, v)

    unit = np.eye(robot.nv)
    close(
        found.by_position, np.array([slope(lambda h, e=e: torque(plain.displaced(q, h * e), v)) for e in unit]).T, 1e-9
    )
    close(found.by_velocity, np.array([slope(lambda h, e=e: torque(q, v + h * e)) for e in unit]).T, 1e-9)
    forward = robot.forward_dynamics_derivatives(q, v, torque(q, v))
    mass = plain.mass_matrix(q)
    close(mass @ forward.by_position, -found.by_position, 1e-9)
    close(mass @ forward.by_velocity, -found.by_velocity, 1e-9)
    assert forward.inverse_mass_matrix @ mass == pytest.approx(np.eye(robot.nv), abs=1e-10)


def test_between_rows_velocities_and_accelerations_are_the_rates_of_positions(pair, tmp_path):
    """q̇ = E(q) v and v̇ = a of a motion's interpolation, whatever its rows; and a file gives it back."""
    _, robot, plain, _ = pair
    (first,), (v, a) = states(robot, 1)[0], states(robot, 2, seed=6)[1:]
    rows = np.stack([first, plain.displaced(first, 0.2 * v[0] + 0.05 * a[0])])
    motion = bc.Motion(robot.joints, [0.0, 0.3], rows, v, a)
    for t in (0.07, 0.21):
        q, speed, growth = motion.at(t)
        rate = slope(lambda h, t=t: motion.at(t + h)[0], 0.02)
        assert robot.configuration_rate(q, speed) == pytest.approx(rate, rel=1e-8, abs=1e-8)
        assert growth == pytest.approx(slope(lambda h, t=t: motion.at(t + h)[1], 0.02), rel=1e-8, abs=1e-8)
    again = bc.read_motion(robot, bc.write_motion(motion, tmp_path / "motion.csv"))
    for key in ("time", "position", "velocity", "acceleration"):
        assert np.array_equal(getattr(again, key), getattr(motion, key))


def test_linear_equations_of_a_moving_chain_turn_with_its_bodies(pair):
    """A = [[−ad(v), 1], [∂v̇/∂q, ∂v̇/∂v]]: ad(v) by the difference of two neighbouring motions, δ̇ = δv − ad(v) δ."""
    _, robot, plain, _ = pair
    run = bc.simulate(robot.source, 0.3, samples=3)
    linear, q, v = bc.linearise(run, at=0.3), run.position[-1], run.velocity[-1]
    slopes = run.robot.forward_dynamics_derivatives(q, v, np.zeros(robot.nv))
    bracket = np.array([slope(lambda h, e=e: apart(plain, q, v, e, h)) for e in np.eye(robot.nv)]).T
    expected = np.block([[bracket, np.eye(robot.nv)], [slopes.by_position, slopes.by_velocity]])
    close(linear.A, expected, 1e-8)
    turning = [np.abs(v[own.v : own.v + own.nv]).min() for own in run.robot.joints if own.nv > 1]
    assert min(turning, default=1.0) > 1e-3


def apart(plain, q, v, direction, time):
    """The displacement (per unit of it) between two motions at a constant velocity, which begin a little apart."""
    size, model, fast = 1e-5, plain.model, time * (plain.map @ v)
    here = pin.integrate(model, plain.position(q), fast)
    there, back = (
        pin.integrate(model, plain.position(plain.displaced(q, sign * size * direction)), fast) for sign in (1.0, -1.0)
    )
    gap = pin.difference(model, here, there) - pin.difference(model, here, back)
    return np.linalg.lstsq(plain.map, gap / (2.0 * size), rcond=None)[0]
