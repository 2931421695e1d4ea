"""What nature does, a simulation does too: conservation, reversal, balances, closed forms, and independent routes."""

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import cumulative_simpson, simpson
from scipy.special import ellipk

from bellcrank.dynamics.equations.system import system_of
from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.scene.scene import load_scene
from bellcrank.simulation.simulate import simulate
from bellcrank_bench.problems.problem import scene_of
from bellcrank_bench.problems.urdf_texts import joint, link, robot

G = 9.81
DOWN, NONE = [0.0, 0.0, -G], [0.0, 0.0, 0.0]
FINE = {"rtol": 1e-11, "atol": 1e-12}
SLIDE = robot("block", link("rail"), link("block", 2.0), joint("slide", "prismatic", "rail", "block", axis=(1, 0, 0)))
# A tree that uses everything: two skew revolute joints, a prismatic one, and full inertias.
CRANE = robot(
    "crane",
    link("base", 1.2, (0, 0.1, 0.2), (0.05, 0.06, 0.07)),
    link("upper", 2.0, (0.5, 0, 0.1), (0.02, 0.2, 0.2)),
    link("fore", 1.0, (0.4, 0.1, 0), (0.01, 0.1, 0.1)),
    link("rod", 0.5, (0.1, 0, 0.05), (0.01, 0.02, 0.02)),
    joint("shoulder", "continuous", "base", "upper", axis=(0, 1, 0)),
    joint("elbow", "continuous", "upper", "fore", (1, 0, 0), (0, 0, 1)),
    joint("slide", "prismatic", "fore", "rod", (0.8, 0, 0), (1, 0, 0)),
)
START = {"shoulder": 0.3, "elbow": 0.5, "slide": 0.1, "velocity": {"shoulder": 0.4, "elbow": -1.0, "slide": 0.2}}
SPRINGS = [
    {"kind": "joint_spring", "joint": "slide", "stiffness": 300, "rest": 0.1},
    {"kind": "joint_spring", "joint": "elbow", "stiffness": 8, "rest": 0.4, "preload": 2.0},
    {"kind": "spring", "frame_a": "rod", "frame_b": "world", "point": [1, 0, 2], "stiffness": 30, "free_length": 1.2},
]
LOSSES = [
    {"name": "drag", "kind": "damper", "joint": "elbow", "coefficient": 0.7},
    {"kind": "friction", "joint": "shoulder", "viscous": 0.2, "coulomb": 0.5, "width": 0.05},
]


def crane(**more):
    return scene_of(CRANE, {"gravity": DOWN, "initial": START, **more})


def block(**more):
    return scene_of(SLIDE, {"gravity": NONE, **more})


# ---- conservation


@pytest.mark.parametrize("solver", ["DOP853", "RK45", "Radau"])
def test_gravity_and_springs_keep_the_energy(solver):
    run = simulate(crane(forces=SPRINGS), duration=3, solver=solver, rtol=1e-9, atol=1e-9)
    exchanged = np.ptp(run.kinetic_energy)
    assert exchanged > 5.0 and np.ptp(run.total_energy) < 1e-6 * exchanged
    assert not run.work.any()


def test_a_free_robots_springs_and_dampers_leave_its_momentum_alone_while_energy_falls():
    forces = [SPRINGS[0], *LOSSES]
    base = {"linear_velocity": [0.3, -0.2, 0.1], "angular_velocity": [0.5, 1.0, -0.7]}
    momenta = {name: {"momentum": name} for name in ("linear", "angular")}
    scene = scene_of(CRANE, {"gravity": NONE, "floating_base": True, "base": base, "initial": START, "forces": forces,
                             "outputs": momenta})  # fmt: skip
    run = simulate(scene, duration=4, **FINE)
    for name in momenta:
        rows = run.output(name)
        assert np.linalg.norm(rows[0]) > 0.3
        assert_allclose(rows, np.tile(rows[0], (len(rows), 1)), rtol=0, atol=1e-10)
    assert np.all(np.diff(run.total_energy) < 0.0) and run.total_energy[-1] < run.total_energy[0] - 0.3
    assert run.energy_drift() < 1e-10


def test_the_motion_runs_back_when_all_velocities_are_turned_round():
    scene = crane(forces=SPRINGS)
    there = simulate(scene, duration=2, rtol=1e-13, atol=1e-14)
    q, v = there.position[-1].tolist(), (-there.velocity[-1]).tolist()
    names = ("shoulder", "elbow", "slide")
    start = {**dict(zip(names, q, strict=True)), "velocity": dict(zip(names, v, strict=True))}
    back = simulate(scene, duration=2, rtol=1e-13, atol=1e-14, overrides={"initial": start})
    assert_allclose(back.position[::-1], there.position, rtol=0, atol=1e-9)
    assert_allclose(-back.velocity[::-1], there.velocity, rtol=0, atol=1e-9)


# ---- balances


def test_a_dampers_loss_is_the_integral_of_d_v_squared():
    run = simulate(crane(forces=[SPRINGS[0], LOSSES[0]]), duration=3, samples=3001, **FINE)
    loss = cumulative_simpson(0.7 * run.joint("elbow").velocity ** 2, x=run.time, initial=0)
    assert loss[-1] > 1.0
    assert_allclose(run.work, -loss, rtol=0, atol=1e-8)
    assert_allclose(run.total_energy - run.total_energy[0], run.work, rtol=0, atol=1e-9)


def test_work_is_the_power_of_motors_friction_and_wrenches_integrated():
    push = {"kind": "torque", "joint": "shoulder", "value": 12.0}
    wind = {"kind": "wrench", "frame": "rod", "force": [1, 2, 3], "torque": [0.1, 0.2, -0.3]}
    control = [{"kind": "pd", "joints": ["elbow"], "target": {"elbow": -0.5}, "kp": 20, "kd": 2}]
    scene = crane(forces=[*SPRINGS, *LOSSES, push, wind], control=control)
    run = simulate(scene, duration=2, samples=4001, **FINE)
    rod, v = run.frame("rod"), run.velocity
    friction = -v[:, 0] * (0.2 * v[:, 0] + 0.5 * v[:, 0] / np.sqrt(v[:, 0] ** 2 + 0.05**2)) - 0.7 * v[:, 1] ** 2
    motors = 12.0 * v[:, 0] + (20 * (-0.5 - run.position[:, 1]) - 2 * v[:, 1]) * v[:, 1]
    wrench = rod.velocity @ [1, 2, 3] + rod.angular_velocity @ [0.1, 0.2, -0.3]
    assert_allclose(run.work[-1], simpson(friction + motors + wrench, x=run.time), rtol=1e-7)
    assert_allclose(np.einsum("ij,ij->i", run.actuator_torque, v), motors, rtol=1e-12, atol=1e-12)
    assert run.energy_drift() < 1e-10


def test_coulomb_friction_stops_a_block_where_its_kinetic_energy_is_spent():
    v0, friction, width = 2.0, 3.0, 1e-3
    force = {"kind": "friction", "joint": "slide", "coulomb": friction, "width": width}
    run = simulate(
        block(forces=[force], initial={"velocity": {"slide": v0}}), duration=3, rtol=1e-10, atol=1e-12, solver="Radau"
    )
    way = 2.0 / (2 * friction) * (v0 * np.hypot(v0, width) + width**2 * np.arcsinh(v0 / width))  # ∫ m v dv / F(v)
    assert_allclose(run.position[-1, 0], way, rtol=1e-8)
    assert abs(run.velocity[-1, 0]) < 1e-10
    assert_allclose(run.work[-1], -0.5 * 2.0 * v0**2, rtol=1e-8)


# ---- an independent route


def test_a_flying_humanoid_moves_as_scipy_and_pinocchio_have_it_on_the_manifold():
    """Pinocchio's `integrate` and its own tangent: the quaternion is advanced by exponentials of small steps."""
    run = simulate("talos_free_fall", duration=0.1, times=[0.0, 0.1], rtol=1e-11, atol=1e-11)
    model = run.robot.model
    data = model.createData()
    q, v, steps = run.position[0].copy(), run.velocity[0].copy(), 40
    h = 0.1 / steps

    def acceleration(q, v):
        return pin.aba(model, data, q, v, np.zeros(model.nv))

    for _ in range(steps):  # Runge-Kutta-Munthe-Kaas of order 4, brackets left out at their third order
        k1v, k1a = v, acceleration(q, v)
        k2v = v + h / 2 * k1a
        k2a = acceleration(pin.integrate(model, q, h / 2 * k1v), k2v)
        k3v = v + h / 2 * k2a
        k3a = acceleration(pin.integrate(model, q, h / 2 * k2v), k3v)
        k4v = v + h * k3a
        k4a = acceleration(pin.integrate(model, q, h * k3v), k4v)
        q = pin.integrate(model, q, h / 6 * (k1v + 2 * k2v + 2 * k3v + k4v))
        v = v + h / 6 * (k1a + 2 * k2a + 2 * k3a + k4a)
    gap = pin.difference(model, run.position[-1], q)
    assert np.linalg.norm(pin.difference(model, run.position[0], q)) > 0.1
    assert_allclose(gap, 0, atol=1e-6)
    assert_allclose(run.velocity[-1], v, rtol=0, atol=1e-5)


def test_all_four_solvers_find_the_same_motion():
    scene = crane(forces=[*SPRINGS, *LOSSES])
    ends = [simulate(scene, duration=1, solver=name, rtol=1e-10, atol=1e-10).state[-1]
            for name in ("DOP853", "RK45", "Radau")]  # fmt: skip
    ends.append(simulate(scene, duration=1, solver="RK4", step=2e-4).state[-1])
    assert_allclose(ends[1:], [ends[0]] * 3, rtol=0, atol=1e-8)


# ---- parameters and overrides


def test_a_parameter_changed_without_compiling_is_the_scene_written_with_that_number():
    parameters = {
        "rod_mass": {"value": 0.5, "sets": ["link.rod.mass"]},
        "reach": {"value": 1.0, "sets": ["joint.elbow.origin.x"]},
        "stiffness": {"value": 300, "sets": ["force.joint_spring.stiffness"]},
    }
    scene = crane(forces=[SPRINGS[0]], parameters=parameters)
    changed = scene.with_overrides({"rod_mass": 0.9, "reach": 1.3, "stiffness": 200})
    assert system_of(changed) is system_of(scene)
    heavier = CRANE.replace('<mass value="0.5"/>', '<mass value="0.9"/>').replace(
        '<child link="fore"/><origin xyz="1.0', '<child link="fore"/><origin xyz="1.3'
    )
    written = scene_of(heavier, {"gravity": DOWN, "initial": START, "forces": [{**SPRINGS[0], "stiffness": 200}]})
    ours, theirs = (simulate(s, duration=2, **FINE) for s in (changed, written))
    assert_allclose(ours.state, theirs.state, rtol=0, atol=1e-9)
    before = simulate(scene, duration=2, **FINE)
    assert np.abs(before.position[-1] - ours.position[-1]).max() > 0.05


def test_an_override_is_the_scene_written_with_that_number():
    scene = crane(forces=SPRINGS[:1], simulate={"duration": 0.5})
    given = {"initial.elbow": "40 deg", "forces.joint_spring.damping": 5, "gravity": [0, 0, -1.62]}
    written = crane(
        forces=[{**SPRINGS[0], "damping": 5}], simulate={"duration": 0.5}, gravity=[0, 0, -1.62],
        initial={**START, "elbow": "40 deg"},
    )  # fmt: skip
    ours, theirs = simulate(scene, overrides=given), simulate(written)
    assert_allclose(ours.state, theirs.state, rtol=0, atol=0)
    assert ours.energy_drift() < 1e-8


# ---- events


@pytest.mark.parametrize("solver", ["DOP853", "RK45", "Radau"])
def test_a_falling_block_passes_heights_at_the_closed_forms_times(solver):
    events = [{"name": f"down {h}", "when": {"joint": "slide", "position": -h}} for h in (0.1, 1, 5)]
    fast = {"name": "fast", "when": {"joint": "slide", "velocity": -9.0}, "stop": True}
    scene = block(gravity=[-G, 0, 0], events=[*events, fast])
    run = simulate(scene, duration=10, solver=solver)
    expected = sorted([*(np.sqrt(2 * h / G) for h in (0.1, 1)), 9.0 / G])  # 5 m would take longer than 9 m/s does
    assert [event.name for event in run.events] == ["down 0.1", "down 1", "fast"]
    assert_allclose([event.time for event in run.events], expected, rtol=1e-13)
    assert run.time[-1] == run.events[-1].time and run.events[-1].stopped
    assert_allclose(run.position[-1, 0], -(9.0**2) / (2 * G), rtol=1e-12)


def test_a_pendulum_let_go_level_passes_the_bottom_at_odd_quarter_periods():
    pendulum = robot("p", link("base"), link("bob", 1.0, (0, 0, -1)),
                     joint("swing", "continuous", "base", "bob", axis=(0, 1, 0)))  # fmt: skip
    events = [
        {"name": "left", "when": {"joint": "swing", "position": 0}, "direction": "up"},
        {"name": "right", "when": {"joint": "swing", "position": 0}, "direction": "down"},
    ]
    scene = scene_of(pendulum, {"gravity": DOWN, "initial": {"swing": "90 deg"}, "events": events})
    run = simulate(scene, duration=10, **FINE)
    quarter = 2.367841947576237449 / 4  # IFToMM benchmark A01, 40 digits by elliptic functions
    assert_allclose(ellipk(0.5) / np.sqrt(G), quarter, rtol=1e-14)
    assert [event.name for event in run.events[:3]] == ["right", "left", "right"]
    assert_allclose([event.time for event in run.events], quarter * np.arange(1, 17, 2), rtol=1e-10)
    assert_allclose([abs(event.velocity[0]) for event in run.events], np.sqrt(2 * G), rtol=1e-10)


def test_rotor_inertia_behind_its_gear_slows_a_pendulum_by_the_closed_form():
    """T/4 = K(sin²(θ0/2)) sqrt(I / (m g l)): I counts the rotor times the ratio squared."""
    lowest = {"name": "lowest", "when": {"joint": "shoulder", "position": 0}, "stop": True}
    scene = load_scene("geared_pendulum", {"initial": {"shoulder": "60 deg"}, "events": [lowest], "friction": "none"})
    run = simulate(scene, duration=5, **FINE)
    inertia = 2.0 * 0.5**2 + 50**2 * (5.0e-6 + 1.0e-6)
    assert_allclose(run.time[-1], ellipk(0.25) * np.sqrt(inertia / (2.0 * G * 0.5)), rtol=1e-10)


# ---- control and torques over time


def test_gravity_compensation_holds_any_posture_exactly():
    random = np.random.default_rng(5)
    scene = scene_of(None, {"urdf": "ur5", "friction": "none", "control": [{"kind": "gravity_compensation"}]})
    for _ in range(5):
        posture = dict(zip(scene.robot.joint_names, random.uniform(-3, 3, 6).tolist(), strict=True))
        run = simulate(scene, duration=1, samples=11, overrides={"initial": posture})
        assert np.abs(run.acceleration).max() < 1e-11
        assert np.abs(run.position - run.position[0]).max() < 1e-12
        assert_allclose(run.actuator_torque[0], run.robot.gravity_torque(run.position[0]), rtol=0, atol=1e-12)


def test_a_critically_damped_pd_brings_a_block_home_by_the_closed_form():
    """x = (1 + ω t) e^(-ω t) with kp = m ω², kd = 2 m ω."""
    control = [{"kind": "pd", "target": {"slide": 0.0}, "kp": 2.0 * 16, "kd": 2 * 2.0 * 4}]
    run = simulate(block(control=control, initial={"slide": 1.0}), duration=3, **FINE)
    assert_allclose(run.position[:, 0], (1 + 4 * run.time) * np.exp(-4 * run.time), rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    ("interpolation", "velocity"),
    [  # of the force 0, 4, -2 N at 0, 1, 3 s on 2 kg, held at -2 N after
        ("linear", lambda t: np.select(
            [t <= 1, t <= 3], [t**2, 1 + 2 * (t - 1) - 0.75 * (t - 1) ** 2], 2 - (t - 3))),
        ("hold", lambda t: np.select([t <= 1, t <= 3], [0 * t, 2 * (t - 1)], 4 - (t - 3))),
    ],
)  # fmt: skip
@pytest.mark.parametrize("solver", ["DOP853", "Radau"])
def test_a_tabulated_force_drives_a_block_by_its_integral(tmp_path, interpolation, velocity, solver):
    (tmp_path / "block.urdf").write_text(SLIDE)
    (tmp_path / "push.csv").write_text("time [s],slide torque [N]\n0,0\n1,4\n3,-2\n")
    (tmp_path / "scene.yaml").write_text(
        "urdf: block.urdf\ngravity: [0, 0, 0]\n"
        f"forces: [{{kind: torque, joint: slide, file: push.csv, interpolation: {interpolation}}}]\n"
    )
    run = simulate(tmp_path / "scene.yaml", duration=4, solver=solver, samples=401)
    assert_allclose(run.velocity[:, 0], velocity(run.time), rtol=0, atol=1e-11)
    path = np.concatenate([[0.0], np.cumsum([simpson(velocity(np.linspace(a, b, 3)), dx=(b - a) / 2)
                                             for a, b in zip(run.time, run.time[1:], strict=False)])])  # fmt: skip
    assert_allclose(run.position[:, 0], path, rtol=0, atol=1e-10)
    # between Radau's steps, which are seconds long here, the work is a cubic beside the energy's quartic
    assert_allclose(run.work[-1], run.kinetic_energy[-1], rtol=0, atol=1e-10)


# ---- kinds of joints


def test_a_block_on_a_spring_swings_as_a_cosine():
    spring = {"kind": "joint_spring", "joint": "slide", "stiffness": 18, "rest": 0.2}
    run = simulate(block(forces=[spring], initial={"slide": 0.5}), duration=10, **FINE)
    assert_allclose(run.position[:, 0], 0.2 + 0.3 * np.cos(3 * run.time), rtol=0, atol=1e-9)


def test_a_body_on_a_planar_joint_slides_straight_while_it_turns():
    """Pinocchio's planar velocity is in the body's own axes; the CG lies off the joint, and falls along -y."""
    turn, arm = 2.0, 0.3
    urdf = robot("puck", link("table"), link("puck", 1.5, (arm, 0, 0), (0.01, 0.01, 0.02)),
                 joint("float", "planar", "table", "puck"))  # fmt: skip
    scene = scene_of(urdf, {"gravity": [0, -G, 0]})
    consistent_start(scene)[1][:] = [0.4, 0.1, turn]
    run = simulate(scene, duration=2, **FINE)
    angle = np.arctan2(run.position[:, 3], run.position[:, 2])
    assert_allclose(np.unwrap(angle), turn * run.time, rtol=0, atol=1e-9)
    centre = run.position[:, :2] + arm * run.position[:, 2:]
    ways = np.outer(run.time, [0.4, 0.1 + turn * arm])
    ways[:, 1] -= G * run.time**2 / 2
    assert_allclose(centre, np.array([arm, 0.0]) + ways, rtol=0, atol=1e-9)
    assert run.constraint_residual() < 1e-14 and run.energy_drift() < 1e-11


def test_a_thrown_body_flies_on_a_parabola_and_turns_evenly_about_a_principal_axis():
    urdf = robot("stone", link("stone", 1.5, (0, 0, 0), (0.1, 0.2, 0.25)))
    base = {"position": [1, 2, 3], "rpy": [0.4, 0.1, -0.2], "linear_velocity": [2, 0, 5], "expressed_in": "world"}
    scene = scene_of(urdf, {"floating_base": True, "base": base})
    consistent_start(scene)[1][5] = 3.0
    run = simulate(scene, duration=2, **FINE)
    t = run.time[:, None]
    assert_allclose(run.position[:, :3], [1, 2, 3] + [2, 0, 5] * t - [0, 0, G / 2] * t**2, rtol=0, atol=1e-9)
    first, half = pin.Quaternion(run.position[0, 3:7]), 1.5 * run.time
    expected = [(first * pin.Quaternion(np.cos(a), 0, 0, np.sin(a))).coeffs() for a in half]
    assert_allclose(run.position[:, 3:7], expected, rtol=0, atol=1e-9)


def test_a_wrench_fixed_in_a_free_body_turns_it_up_as_torque_over_inertia():
    urdf = robot("wheel", link("wheel", 1.5, (0, 0, 0), (0.1, 0.2, 0.25)))
    wrench = {"kind": "wrench", "frame": "wheel", "torque": [0, 0, 0.5], "force": [0, 0, 3], "expressed_in": "frame"}
    base = {"rpy": [0.7, 0.2, 0.0]}
    scene = scene_of(urdf, {"floating_base": True, "base": base, "gravity": NONE, "forces": [wrench]})
    run = simulate(scene, duration=3, **FINE)
    assert_allclose(run.velocity[:, 5], 2.0 * run.time, rtol=0, atol=1e-11)
    axis = run.frame("wheel").rotation[0, :, 2]
    assert_allclose(run.position[:, :3], np.outer(run.time**2, axis), rtol=0, atol=1e-10)
    assert_allclose(run.work, 1.5 * (2 * run.time) ** 2 / 2 + 0.25 * (2 * run.time) ** 2 / 2, rtol=0, atol=1e-10)


def test_mimicking_fingers_move_as_one_with_the_mass_of_both():
    """One coordinate s drives fingers by 1 and -½: the mass that a force feels is m1 + m2/4."""
    followed = joint("right", "prismatic", "palm", "finger_2", axis=(1, 0, 0)).replace(
        "</joint>", '<mimic joint="left" multiplier="-0.5" offset="0.01"/></joint>'
    )
    urdf = robot("gripper", link("palm"), link("finger_1", 0.3), link("finger_2", 0.8),
                 joint("left", "prismatic", "palm", "finger_1", axis=(1, 0, 0)), followed)  # fmt: skip
    push = {"kind": "torque", "joint": "left", "value": 2.0}
    run = simulate(scene_of(urdf, {"gravity": NONE, "forces": [push]}), duration=1, **FINE)
    assert_allclose(run.position[:, 0], run.time**2 / (0.3 + 0.8 / 4), rtol=0, atol=1e-11)
    assert_allclose(run.frame("finger_2").position[:, 0], 0.01 - 0.5 * run.position[:, 0], rtol=0, atol=1e-15)
    assert_allclose(run.work, run.kinetic_energy, rtol=0, atol=1e-11)


def test_the_pandas_fingers_open_together_while_the_arm_falls():
    scene = load_scene("panda_falling", {"forces": [{"kind": "torque", "joint": "panda_finger_joint1", "value": 0.5}]})
    run = simulate(scene, duration=0.3, samples=31, **FINE)
    hand, left, right = (run.frame(name) for name in ("panda_hand", "panda_leftfinger", "panda_rightfinger"))
    ways = [np.einsum("nji,nj->ni", hand.rotation, f.position - hand.position)[:, 1] for f in (left, right)]
    assert_allclose(ways[0], -ways[1], rtol=0, atol=1e-12)
    assert_allclose(ways[0], run.joint("panda_finger_joint1").position, rtol=0, atol=1e-12)
    assert np.ptp(ways[0]) > 0.05 and run.energy_drift() < 1e-10
