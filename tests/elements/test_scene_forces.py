"""Forces, controllers, parameters, outputs and formulas of scenes against finite differences and other routes."""

import math
from dataclasses import replace

import casadi
import numpy as np
import pinocchio as pin
import pytest
import two_link
from crane import FILES
from hypothesis import given, settings
from hypothesis import strategies as st

from bellcrank.elements.expression import FUNCTIONS, parse_expression
from bellcrank.elements.force_table import table_signal
from bellcrank.elements.signals import motion_signal
from bellcrank.elements.symbols import Symbols
from bellcrank.errors import InputError
from bellcrank.motion.motion import Motion
from bellcrank.scene.output_quantities import EquationSymbols
from bellcrank.scene.scene import load_scene

HOOK = {"hook": {"link": "tip", "xyz": [0.1, 0.05, 0]}}
RNG = np.random.default_rng(7)
FORCES = [
    {"kind": "joint_spring", "joint": "slide", "stiffness": 500, "rest": 0.2, "preload": 3, "damping": 4},
    {"kind": "joint_spring", "joint": "shoulder", "stiffness": 5, "preload": -1},
    {"kind": "spring", "frame_a": "hook", "frame_b": "upper", "stiffness": 40, "damping": 3, "free_length": 0.4},
    {"kind": "spring", "frame_a": "hook", "frame_b": "world", "point": [1, 0.5, 2], "stiffness": 4, "free_length": 1},
    {"kind": "spring", "frame_a": "hook", "frame_b": "base", "stiffness": 40, "damping": 2},
    {"kind": "damper", "joint": "elbow", "coefficient": 0.4},
    {"kind": "friction", "joint": "shoulder", "viscous": 0.1, "coulomb": 0.5, "width": 0.1},
    {"kind": "torque", "joint": "elbow", "value": -2.5},
    {"kind": "torque", "joint": "elbow", "file": "torque.csv"},
    {"kind": "wrench", "frame": "hook", "force": [1, 2, 3], "torque": [0.3, -0.1, 0.2]},
    {"kind": "wrench", "frame": "hook", "force": [1, 2, 3], "torque": [0.3, -0.1, 0.2], "expressed_in": "frame"},
]  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    where = tmp_path_factory.mktemp("crane")
    for name, text in FILES.items():
        (where / name).write_text(text)
    return where


def crane(folder, **keys):
    return load_scene(folder / "crane.urdf", {"gravity": [0, 0, -9.81], "frames": HOOK, **keys})


def function(scene, *builds):
    """(t, q, v) -> the expressions that the builds make of Symbols, signals and parameters at their values."""
    s = Symbols(scene.robot, scene.parameters)
    outputs = [casadi.densify(casadi.SX(build(s))) for build in builds]
    f = casadi.Function("f", [s.t, s.q, s.v, s.u, s.p], outputs)

    def call(t, q, v):
        u = scene.signals_at(np.array([t]))[0]
        values = f.call([np.float64(t), q, v, u, scene.parameter_values])
        return [np.array(x).squeeze() for x in values]

    return call


def state(robot):
    """A position and velocity at random, quaternions unit."""
    q, v = robot.posture(None), RNG.normal(size=robot.nv)
    for j in robot.joints:
        x = RNG.normal(size=j.nq) * (0.3 if j.kind == "prismatic" else 0.8)
        if j.kind == "floating":
            x[3:] /= np.linalg.norm(x[3:])
        q[j.q : j.q + j.nq] = x
    return q, v


@pytest.mark.parametrize("free", [False, True], ids=["fixed base", "free base"])
@pytest.mark.parametrize("force", FORCES, ids=[f"{f['kind']} {k}" for k, f in enumerate(FORCES)])
def test_a_force_is_minus_the_gradient_of_its_potential_and_the_rest_is_its_power(folder, force, free):
    scene = crane(folder, forces=[force], floating_base=free)
    part = scene.forces[0]
    f = function(
        scene,
        lambda s: part.generalised_force(s).force,
        lambda s: part.generalised_force(s).potential,
        lambda s: part.generalised_force(s).power,
    )
    for _ in range(5):
        q, v = state(scene.robot)
        tau, _, power = f(0.3, q, v)
        rate, h = scene.robot.configuration_rate(q, v), 1e-5
        slope = (f(0.3, q + h * rate, v)[1] - f(0.3, q - h * rate, v)[1]) / (2 * h)
        assert tau @ v == pytest.approx(power - slope, rel=1e-7, abs=1e-7)
        if force["kind"] in ("joint_spring", "spring"):
            still = f(0.3, q, np.zeros_like(v))[0]
            for k in range(scene.robot.nv):
                along = scene.robot.configuration_rate(q, np.eye(scene.robot.nv)[k])
                change = (f(0.3, q + h * along, v)[1] - f(0.3, q - h * along, v)[1]) / (2 * h)
                assert still[k] == pytest.approx(-change, rel=1e-6, abs=1e-6)
        if force["kind"] in ("damper", "friction"):
            assert power < 0.0


@pytest.mark.parametrize("axes", ["world", "frame"])
def test_a_wrench_acts_through_the_transposed_jacobian_of_its_frame(folder, axes):
    wrench = {"kind": "wrench", "frame": "hook", "force": [1, -2, 3], "torque": [0.5, 0.1, -0.4], "expressed_in": axes}
    frames = {"hook": {"link": "tip", "xyz": [0.1, 0.2, 0], "rpy": [0.2, 0.3, 0]}}
    scene = crane(folder, forces=[wrench], frames=frames)
    robot, f = scene.robot, function(scene, lambda s: scene.forces[0].generalised_force(s).force)
    q, v = state(robot)
    turn = robot.frame_pose("hook", q)[1] if axes == "frame" else np.eye(3)
    force, torque = turn @ [1, -2, 3], turn @ [0.5, 0.1, -0.4]
    h, expected = 1e-6, []
    for k in range(robot.nv):
        (a, ra), (b, rb) = (robot.frame_pose("hook", q + s * h * np.eye(robot.nv)[k]) for s in (-1, 1))
        spin = (rb - ra) @ ((ra + rb) / 2).T / (2 * h)
        expected.append(force @ (b - a) / (2 * h) + torque @ [spin[2, 1], spin[0, 2], spin[1, 0]])
    np.testing.assert_allclose(f(0.0, q, v)[0], expected, rtol=1e-8, atol=1e-8)


def test_springs_pull_by_hookes_law_and_stay_finite_where_their_ends_meet(folder):
    springs = [
        {"kind": "spring", "frame_a": "hook", "frame_b": "world", "stiffness": 40, "free_length": 0.5, "damping": 1}
    ]
    scene = crane(
        folder, forces=springs, frames={"hook": {"link": "tip", "xyz": [0, 0, 0]}}, outputs={"t": {"force": "spring"}}
    )
    q, v = state(scene.robot)
    place, speed = scene.robot.frame_pose("hook", q)[0], scene.robot.frame_velocity("hook", q, v)[0]
    length = np.linalg.norm(place)
    f = function(scene, scene.outputs["t"].quantity.force.measure)
    assert f(0.0, q, v)[0] == pytest.approx(40 * (length - 0.5) + place @ speed / length, rel=1e-12)
    met = scene.with_overrides({"forces.spring.point": place.tolist()})
    parts = function(
        met, lambda s: met.forces[0].generalised_force(s).force, lambda s: met.forces[0].generalised_force(s).power
    )
    assert all(np.isfinite(x).all() for x in parts(0.0, q, v))


@pytest.mark.parametrize("size", [1e-6, 1e-3, 1e3])
def test_springs_of_any_size_pull_by_hookes_law(folder, size):
    """0.4.0: springs of some µm were longer by 5e-8 of their length, for lengths were kept from 0 by 1 nm."""
    spring = {"kind": "spring", "frame_a": "hook", "frame_b": "world", "stiffness": 40, "free_length": 0.2 * size}
    scene = crane(
        folder, forces=[spring], frames={"hook": {"link": "tip", "xyz": [0, 0, 0]}}, outputs={"t": {"force": "spring"}}
    )
    q, v = state(scene.robot)
    place = scene.robot.frame_pose("hook", q)[0]
    apart = size * np.array([0.05, -0.1, 0.02])
    near = scene.with_overrides({"forces.spring.point": (place + apart).tolist()})
    length = np.linalg.norm(np.array(near.forces[0].point) - place)
    f = function(near, near.outputs["t"].quantity.force.measure)
    assert f(0.0, q, v)[0] == pytest.approx(40 * (length - 0.2 * size), rel=1e-8, abs=0)


@pytest.mark.parametrize("free_length", [0.0, 0.3])
def test_the_slope_of_a_springs_force_is_finite_where_its_ends_meet(folder, free_length):
    spring = {"kind": "spring", "frame_a": "hook", "frame_b": "world", "stiffness": 40, "damping": 1}
    frames = {"hook": {"link": "tip", "xyz": [0, 0, 0]}}
    scene = crane(folder, forces=[spring | {"free_length": free_length}], frames=frames)
    q, v = state(scene.robot)
    met = scene.with_overrides({"forces.spring.point": scene.robot.frame_pose("hook", q)[0].tolist()})

    def slopes(s):
        force = met.forces[0].generalised_force(s).force
        return casadi.densify(casadi.jacobian(force, casadi.vertcat(s.q, s.v)))

    for speed in (v, np.zeros_like(v)):
        assert np.isfinite(function(met, slopes)(0.0, q, speed)[0]).all()


def test_smoothed_coulomb_friction_reaches_its_value_at_speed(folder):
    scene = crane(folder, forces=[{"kind": "friction", "joint": "elbow", "coulomb": 2.0, "width": 0.01}])
    f = function(scene, lambda s: scene.forces[0].generalised_force(s).force)
    assert f(0, np.zeros(3), np.array([0, 0.01, 0]))[0][1] == pytest.approx(-2 / math.sqrt(2), rel=1e-12)
    assert f(0, np.zeros(3), np.array([0, -5.0, 0]))[0][1] == pytest.approx(2.0, rel=1e-5)


# ---- control


def test_computed_torque_leaves_the_error_a_linear_equation(folder):
    motion = {"kind": "waypoints", "times": [0, 1, 2], "positions": [{"elbow": 0.5}, {"shoulder": 1.0}, {"slide": 0.3}]}
    control = [
        {
            "name": "c",
            "kind": "computed_torque",
            "motion": "go",
            "kp": {"shoulder": 90, "elbow": 60, "slide": 30},
            "kd": 9,
        }
    ]
    friction = {"elbow": {"viscous": 0.3, "coulomb": 0.5}}
    actuators = {"elbow": {"ratio": 50, "rotor_inertia": 1e-4, "rated_torque": 1, "peak_torque": 2, "rated_speed": 300,
                        "max_speed": 400}}  # fmt: skip
    driven = ["shoulder", "elbow", "slide"]
    scene = crane(
        folder, motions={"go": motion}, control=control, friction=friction, actuators=actuators, actuated=driven
    )
    robot = scene.robot
    for error in (0.0, 0.2):
        wrong = scene.with_overrides({"control.c.mass_error": error})
        f = function(wrong, lambda s, part=wrong.control[0]: part.generalised_force(s).force)
        for t in (0.0, 0.7, 1.6):
            q, v = state(robot)
            qd, vd, ad = scene.motion("go").at(t)
            wanted = ad + 9 * (vd - v) + np.array([90, 60, 30]) * (qd - q)
            torque = f(t, q, v)[0]
            rotor, friction_torque = robot.rotor_inertia * wanted, robot.friction_torque(v)
            exact = robot.inverse_dynamics(q, v, wanted)
            scaled = (1 + error) * (exact - friction_torque - rotor) + rotor + friction_torque
            np.testing.assert_allclose(torque, scaled, rtol=1e-10, atol=1e-10)
            if error == 0.0:  # ë + kd ė + kp e = 0
                e, rate = qd - q, vd - v
                second = ad - robot.forward_dynamics(q, v, torque)
                np.testing.assert_allclose(second + 9 * rate + np.array([90, 60, 30]) * e, 0, atol=1e-8)


def test_pd_pulls_to_its_target_and_is_clamped(folder):
    control = {
        "name": "c",
        "kind": "pd",
        "target": {"elbow": 0.5, "slide": 0.1},
        "kp": 100,
        "kd": {"elbow": 2, "slide": 3},
    }
    scene = crane(folder, control=[control])
    q, v = np.array([0.3, 0.2, 0.25]), np.array([1.0, 0.5, -0.4])
    part = scene.control[0]
    free, power = function(scene, lambda s: part.generalised_force(s).force, lambda s: part.generalised_force(s).power)(
        0, q, v
    )
    np.testing.assert_allclose(free, [0, 100 * 0.3 - 2 * 0.5, -100 * 0.15 + 3 * 0.4], rtol=1e-12)
    assert power == pytest.approx(free @ v)
    for limit, expected in ((10, [0, 10, -10]), ("effort", [0, 29, -13.8])):
        clamped = scene.with_overrides({"control.c.limit": limit})
        torque = function(clamped, lambda s, c=clamped: c.control[0].generalised_force(s).force)(0, q, v)[0]
        np.testing.assert_allclose(torque, expected, rtol=1e-12)


def test_gravity_compensation_holds_the_textbook_arm():
    scene = load_scene(
        "planar_2r_swing", {"control": [{"name": "g", "kind": "gravity_compensation", "mass_error": "10 %"}]}
    )
    q = RNG.normal(size=2)
    torque = function(scene, lambda s: scene.control[0].generalised_force(s).force)(0, q, np.ones(2))[0]
    np.testing.assert_allclose(torque, 1.1 * two_link.TwoLink().gravity_torque(q)[0], rtol=1e-12)


def test_the_textbook_arms_gravity_potential():
    scene = load_scene("planar_2r_swing")
    energy = function(scene, lambda s: s.algorithm("energy")(s.q, s.v, s.tracer_parameters))
    heights = [two_link.M1 * two_link.R1 * math.sin(a) + two_link.M2 * (math.sin(a) + two_link.R2 * math.sin(a + b))
               for a, b in ((0.4, -1.1), (2.0, 0.3))]  # fmt: skip
    found = [energy(0, np.array(q), np.zeros(2))[0][1] for q in ((0.4, -1.1), (2.0, 0.3))]
    np.testing.assert_allclose(found, np.array(heights) * two_link.G, rtol=1e-12)


def test_a_free_bases_pd_leaves_the_base_alone(folder):
    scene = load_scene(folder / "flying.yaml")
    q, v = state(scene.robot)
    torque = function(scene, lambda s: scene.control[0].generalised_force(s).force)(0, q, v)[0]
    np.testing.assert_array_equal(torque[:7], 0.0)
    assert torque[7] == pytest.approx(20 * (0.3 - q[8]) - 2 * v[7]) and torque[8] != 0.0


# ---- signals


def test_a_motion_signal_is_the_motion_and_its_derivatives(folder):
    places = [{"elbow": 0.5}, {"shoulder": 1.0}, {"slide": 0.3}]
    motion = {"kind": "waypoints", "times": [0.5, 1, 2], "positions": places, "samples": 31}
    scene = crane(folder, motions={"go": motion})
    go = scene.motion("go")
    signal, stops = motion_signal(go, tuple(scene.robot.joints), 2)
    t = np.linspace(0.5, 2.0, 400)
    values = signal.at(t).reshape(len(t), 3, 3)
    for k, exact in enumerate(go.at(t)):
        np.testing.assert_allclose(values[:, k], exact, rtol=1e-9, atol=1e-10)
    outside = signal.at(np.array([0.0, 3.0])).reshape(2, 3, 3)
    np.testing.assert_allclose(outside[:, 0], go.position[[0, -1]], atol=1e-13)
    np.testing.assert_array_equal(outside[:, 1:], 0.0)
    assert not signal.kinked and len(stops) == 0


def test_a_motions_jumps_are_stops():
    robot = load_scene("planar_2r_swing").robot
    time = np.array([0.0, 1.0, 1.0, 2.0])
    position, velocity = (
        np.array([[0, 0], [0.5, 0], [0.5, 0], [1.5, 0]]),
        np.array([[0, 0], [1.0, 0], [1.0, 0], [1.0, 0]]),
    )
    acceleration = np.array([[1.0, 0], [1.0, 0], [0, 0], [0, 0]])
    motion = Motion(robot.joints, time, position, velocity, acceleration)
    signal, stops = motion_signal(motion, tuple(robot.joints), 2)
    np.testing.assert_array_equal(stops, [0.0, 1.0, np.nextafter(2.0, 3.0)])
    np.testing.assert_allclose(signal.at(np.array([0.999999, 1.0]))[:, 4], [1.0, 0.0], atol=1e-4)
    np.testing.assert_array_equal(motion_signal(motion, tuple(robot.joints), 1)[1], [np.nextafter(2.0, 3.0)])


def test_the_stops_of_a_motion_are_those_of_the_clock_of_the_start(folder):
    go = {"kind": "point_to_point", "from": {}, "to": {"elbow": 0.5}, "speed": 1, "acceleration": 5,
          "profile": "trapezoid"}  # fmt: skip
    follow = {"kind": "computed_torque", "name": "follow", "motion": "go", "kp": 20, "kd": 10}
    scene = crane(folder, motions={"go": go}, control=[follow])
    later = replace(scene, initial=replace(scene.initial, clock=0.25))
    np.testing.assert_allclose(scene.stops, [0.0, 0.2, 0.5, 0.7], atol=1e-15)  # the acceleration jumps
    np.testing.assert_allclose(later.stops, scene.stops - 0.25, atol=1e-15)
    assert later.stops[-1] > later.signals[0].breaks[-1]  # at the last time the acceleration has not jumped yet


@pytest.mark.parametrize(
    ("interpolation", "expected"),
    [("linear", [1, 1, 2, 2.5, 4, 4]), ("hold", [1, 1, 1, 3, 4, 4]), ("cubic", [1, 1, 2.1875, 2.6875, 4, 4])],
)
def test_torque_tables_are_interpolated_and_held_beyond_their_ends(interpolation, expected):
    signal, _ = table_signal(np.array([0, 1.0, 3.0]), np.array([[1.0], [3.0], [4.0]]), interpolation)
    if interpolation == "cubic":  # three points: the parabola through them, 1 + 2.5 t - 0.5 t²
        expected = [1, 1, 1 + 2.5 * 0.5 - 0.5 * 0.25, 1 + 2.5 * 1.5 - 0.5 * 2.25, 4, 4]
    else:
        expected = [*expected[:3], {"linear": 3.25, "hold": 3}[interpolation], *expected[4:]]
    np.testing.assert_allclose(signal.at(np.array([-1, 0, 0.5, 1.5, 3.0, 9.0]))[:, 0], expected, rtol=1e-12)


def test_controllers_that_follow_one_motion_share_its_signal(folder):
    motion = {"kind": "dwell", "position": {"elbow": 0.1}, "duration": 1}
    control = [{"kind": "pd", "joints": "all", "motion": "rest", "kp": 1, "name": "a"},
               {"kind": "pd", "joints": "all", "motion": "rest", "kp": 2, "name": "b"},
               {"kind": "pd", "joint": "elbow", "motion": "rest", "kp": 2, "name": "c"}]  # fmt: skip
    scene = crane(folder, motions={"rest": motion}, control=control)
    assert [source.size for source in scene.signal_sources] == [6, 2]
    s = Symbols(scene.robot)
    for part in scene.control:
        part.generalised_force(s)
    assert s.u.numel() == 8


# ---- parameters


def test_a_parameter_does_what_the_number_in_the_file_would(folder):
    values = {"load": 1.7, "reach": 1.3, "hook": 0.25, "stiff": 55.0, "error": 0.1}
    scene = crane(
        folder,
        frames={"hook": {"link": "tip", "xyz": [0.1, 0, 0]}},
        forces=[{"kind": "spring", "frame_a": "hook", "frame_b": "world", "stiffness": 40}],
        control=[{"name": "g", "kind": "gravity_compensation"}],
        parameters={
            "load": {"value": 0.5, "sets": ["link.rod.mass"]},
            "reach": {"value": 1.0, "sets": ["joint.elbow.origin.x"]},
            "hook": {"value": 0.1, "sets": ["frame.hook.origin.x"]},
            "stiff": {"value": 40, "sets": ["force.spring.stiffness"]},
            "error": {"value": 0, "sets": ["control.g.mass_error"]},
        },
    )
    changed = scene.with_overrides(values)
    assert changed.physics_key() == scene.physics_key()
    text = (
        FILES["crane.urdf"]
        .replace('mass value="0.5"', 'mass value="1.7"')
        .replace('xyz="1 0 0"/>\n    <axis xyz="0 0 1', 'xyz="1.3 0 0"/>\n    <axis xyz="0 0 1')
    )
    (folder / "other.urdf").write_text(text)
    plain = scene.with_overrides({"urdf": "other.urdf", "parameters": {}, "frames.hook.xyz.1": 0.25,
                                  "forces.spring.stiffness": 55, "control.g.mass_error": 0.1})  # fmt: skip
    q, v = state(scene.robot)

    def parts(s, where):
        return casadi.vertcat(where.forces[0].generalised_force(s).force, where.control[0].generalised_force(s).force,
                              s.algorithm("energy")(s.q, s.v, s.tracer_parameters))  # fmt: skip

    found, wanted = (function(x, lambda s, x=x: parts(s, x))(0, q, v)[0] for x in (changed, plain))
    np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12)


# ---- outputs and formulas


def test_momentum_is_pinocchios_moved_to_the_worlds_origin(folder):
    outputs = {"p": {"momentum": "linear"}, "l": {"momentum": "angular"}}
    scene = load_scene(folder / "flying.yaml", {"outputs": outputs})
    robot = scene.robot
    q, v = state(robot)

    def momenta(s):
        kinetic, potential = casadi.vertsplit(s.algorithm("energy")(s.q, s.v, s.tracer_parameters))
        none = casadi.SX(robot.nv, 1)
        equations = EquationSymbols(
            symbols=s,
            acceleration=none,
            joint_torque=none,
            kinetic=kinetic,
            potential=potential,
            reactions=None,
            work=none,
        )
        return casadi.vertcat(*[output.value(equations) for output in scene.outputs.values()])

    found = function(scene, momenta)(0, q, v)[0]
    data = robot.model.createData()
    about_com = pin.computeCentroidalMomentum(robot.model, data, q, v)
    angular = about_com.angular + np.cross(data.com[0], about_com.linear)
    np.testing.assert_allclose(found, [*about_com.linear, *angular], rtol=1e-11, atol=1e-11)
    assert scene.outputs["l"].labels[2] == "l z [kg m^2/s]"


_LEAVES = {"t": 0.7, "elbow.velocity": -0.4, "joint('slide').position": 0.3, "frame('tip').vx": None, "2.5": 2.5,
           "load": 0.5, "pi": math.pi, "frame('tip').z": None}  # fmt: skip


@pytest.mark.tier2
@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    st.recursive(
        st.sampled_from(sorted(_LEAVES)),
        lambda x: st.tuples(x, st.sampled_from("+-*"), x).map(lambda e: f"({e[0]} {e[1]} {e[2]})")
        | x.map(lambda e: f"sin({e})") | x.map(lambda e: f"-{e}") | x.map(lambda e: f"({e})**2")
        | st.tuples(x, x).map(lambda e: f"atan2({e[0]}, {e[1]})")
        | st.tuples(x, x).map(lambda e: f"min({e[0]}, {e[1]})")
        | x.map(lambda e: f"abs({e}) / 2"),
        max_leaves=8,
    )
)  # fmt: skip
def test_a_formula_is_what_python_makes_of_it(flying_free_scene, formula):
    scene, q, v, values = flying_free_scene
    found = function(scene, parse_expression(formula, scene.robot, scene.parameters).value)(0.7, q, v)[0]
    text = formula
    for name, value in values.items():
        text = text.replace(name, f"({value!r})")
    expected = eval(text, {"sin": math.sin, "atan2": math.atan2, "min": min, "abs": abs, "pi": math.pi, "t": 0.7})
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.fixture(scope="module")
def flying_free_scene(folder):
    scene = crane(folder, parameters={"load": {"value": 0.5, "sets": ["link.rod.mass"]}})
    q, v = np.array([0.2, 0.6, 0.3]), np.array([0.5, -0.4, 0.1])
    place, speed = scene.robot.frame_pose("tip", q)[0], scene.robot.frame_velocity("tip", q, v)[0]
    values = {"elbow.velocity": -0.4, "joint('slide').position": 0.3, "frame('tip').vx": float(speed[0]),
              "frame('tip').z": float(place[2]), "load": 0.5}  # fmt: skip
    return scene, q, v, values


@pytest.mark.parametrize("name", sorted(set(FUNCTIONS) - {"min", "max", "atan2", "sign", "step", "abs"}))
def test_every_function_of_formulas(flying_free_scene, name):
    scene, q, v, _ = flying_free_scene
    found = function(scene, parse_expression(f"{name}(t - 0.2)", scene.robot, {}).value)(0.7, q, v)[0]
    assert found == pytest.approx(getattr(math, name)(0.5), rel=1e-14)


def test_signs_and_extremes_of_formulas(flying_free_scene):
    scene, q, v, _ = flying_free_scene
    formulas = {
        "sign(-t)": -1,
        "step(-t)": 0,
        "step(t)": 1,
        "max(1, t, 3, -2)": 3,
        "min(1, t, 3)": 0.7,
        "2**-1 + t**(1/2)": 0.5 + math.sqrt(0.7),
        "-2**2": -4,
        "frame('base').x + frame('base').vz": 0.0,
    }
    for formula, expected in formulas.items():
        f = function(scene, parse_expression(formula, scene.robot, {}).value)
        assert f(0.7, q, v)[0] == pytest.approx(expected), formula


@pytest.mark.parametrize(
    ("formula", "words"),
    [
        ("elbow", "expected one of elbow.position"), ("elbow.position.x", "expected JOINT.position"),
        ("frame('tip')", "such as frame('NAME').x"), ("frame(tip).x", "expected frame('NAME')"),
        ("2 ** t", "'t': an exponent must be"), ("2 ** (1/0)", "'1/0': an exponent must be"),
        ("1e999", "'1e999': expected a finite"),
        ("t if t else 1", "expected numbers"), ("[t]", "expected numbers"), ("'x'", "expected a number"),
        ("True", "expected a number"), ("1j", "expected a number"), ("sin(t, t)", "requires 1 argument, found 2"),
        ("max(t)", "at least two arguments"), ("sin(x=t)", "expected numbers"), ("t.real", "unknown joint 't'"),
        ("__import__('os')", "unknown function"), ("(lambda: t)()", "expected numbers"), ("t <", "not an expression"),
        ("+".join(["t"] * 1500), "at most 2000"), ("-" * 500 + "t", "nested too deeply"), ("", "not an expression"),
        ("frame('tip').w", "unknown component of a frame 'w'"), ("t and t", "expected numbers"),
        ("t % 2", "expected numbers"),
    ],
)  # fmt: skip
def test_a_formula_that_is_none_is_refused_at_the_piece(flying_free_scene, formula, words):
    with pytest.raises(InputError) as caught:
        parse_expression(formula, flying_free_scene[0].robot, {})
    assert words in str(caught.value), caught.value


@pytest.mark.tier2
@settings(max_examples=400, deadline=None, derandomize=True)
@given(st.text(max_size=30) | st.text(alphabet="t().,*+-/19e'\"[]{}:=<>\\ ajsin", max_size=30))
def test_any_text_is_a_formula_or_an_input_error(flying_free_scene, text):
    try:
        parse_expression(text, flying_free_scene[0].robot, {"a": 1})
    except InputError as error:
        assert "\n" not in str(error)


def test_a_cubic_table_of_very_uneven_times_is_refused(tmp_path):
    (tmp_path / "torque.csv").write_text("time [s],swing torque [N m]\n0,1\n0.05,2\n1e17,-1\n")
    force = "{kind: torque, joint: swing, file: torque.csv, interpolation: cubic}"
    (tmp_path / "scene.yaml").write_text(f"urdf: pendulum\nforces: [{force}]\n")
    with pytest.raises(InputError, match=r"differ by a factor of at most 1e\+12, .* from 0.05 s to 1e\+17 s"):
        load_scene(tmp_path / "scene.yaml")
