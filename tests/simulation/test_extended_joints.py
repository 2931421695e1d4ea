"""Simulations with spherical, universal and screw joints, against closed forms and other models of the same body."""

import math

import numpy as np
import pytest
import yaml
from extended_robots import BOLT, MIXED, TOP, diagonal, joint, link, three_revolutes
from scipy.integrate import solve_ivp

import bellcrank as bc
from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.errors import InputError

GRAVITY = 9.81
MASS, ARM, ACROSS, ALONG = 0.5, 0.2, 0.004 + 0.5 * 0.2**2, 0.003  # of TOP, about its pivot


@pytest.fixture
def scene(tmp_path):
    def make(urdf, name="robot", **keys):
        (tmp_path / f"{name}.urdf").write_text(urdf)
        path = tmp_path / f"{name}.yaml"
        path.write_text(yaml.safe_dump({"name": name, "urdf": f"{name}.urdf", **keys}))
        return bc.load_scene(path)

    return make


def tight(solver="DOP853"):
    return {"solver": solver, "rtol": 1e-10, "atol": 1e-10} if solver != "Radau" else {"solver": solver, "rtol": 1e-9}


START = {"ball": {"rpy": ["60 deg", 0, 0], "angular_velocity": [0.4, 0.3, 7.0], "expressed_in": "parent"}}


@pytest.mark.tier2
@pytest.mark.parametrize("solver", ["DOP853", "RK45", "Radau"])
def test_a_top_follows_eulers_equations(scene, solver):
    """d′ = ω × d, H′ = d × (m g l) with H = A ω + (C − A)(ω·d) d: a top in world axes, without a quaternion."""
    run = bc.simulate(scene(TOP, initial=START), duration=2.0, samples=101, **tight(solver))
    axis = run.frame("body").rotation[:, :, 2]
    spin = run.frame("body").angular_velocity
    momentum = ACROSS * spin + (ALONG - ACROSS) * np.sum(spin * axis, axis=1, keepdims=True) * axis

    def rates(_, y):
        d, h = y[:3], y[3:]
        along = h @ d / ALONG
        omega = (h - (ALONG - ACROSS) * along * d) / ACROSS
        return np.concatenate([np.cross(omega, d), np.cross(d, [0.0, 0.0, -MASS * GRAVITY * ARM])])

    start = np.concatenate([axis[0], momentum[0]])
    reference = solve_ivp(rates, (0.0, 2.0), start, "DOP853", run.time, rtol=1e-12, atol=1e-13).y.T
    assert np.abs(axis - reference[:, :3]).max() <= 1e-7
    assert np.abs(momentum - reference[:, 3:]).max() <= 1e-7
    assert np.ptp(momentum[:, 2]) <= 1e-8  # about the vertical nothing acts
    assert np.ptp(np.sum(spin * axis, axis=1)) <= 1e-6  # nor about the axis of symmetry
    assert run.energy_drift() <= 1e-8
    assert np.abs(np.linalg.norm(run.position, axis=1) - 1.0).max() <= 1e-14


def test_steady_precession_of_a_top(scene):
    """A Ω² cos θ − C ω₃ Ω + m g l = 0 keeps the tilt θ (Goldstein, Classical Mechanics, section 5.7)."""
    tilt, spin = 0.7, 150.0
    a, b, c = ACROSS * math.cos(tilt), -ALONG * spin, MASS * GRAVITY * ARM
    for sign in (-1.0, 1.0):
        rate = (-b + sign * math.sqrt(b * b - 4.0 * a * c)) / (2.0 * a)
        along = spin - rate * math.cos(tilt)
        direction = np.array([0.0, -math.sin(tilt), math.cos(tilt)])  # of the body's axis after roll `tilt`
        omega = rate * np.array([0.0, 0.0, 1.0]) + along * direction
        start = {"ball": {"rpy": [tilt, 0, 0], "angular_velocity": omega.tolist(), "expressed_in": "parent"}}
        run = bc.simulate(scene(TOP, initial=start), duration=1.0, samples=201, **tight())
        axis = run.frame("body").rotation[:, :, 2]
        assert np.abs(np.arccos(axis[:, 2]) - tilt).max() <= 1e-7
        azimuth = np.unwrap(np.arctan2(axis[:, 1], axis[:, 0]))
        assert np.abs(azimuth - azimuth[0] - rate * run.time).max() <= 1e-7


@pytest.mark.tier2
def test_a_ball_moves_as_three_revolute_joints_do(scene):
    """MIXED with its ball replaced by revolute joints about x, y and z, with massless links between them."""
    outputs = {"tip": {"frame": "nut", "what": "position"}}
    motion = {"cardan_1": 0.3, "screw": 0.4, "velocity": {"screw": 1.0, "cardan_2": -0.5}}
    ball = {"quaternion_xyzw": [0, 0, 0, 1], "angular_velocity": [0.5, -0.4, 0.3]}
    runs = [
        bc.simulate(scene(MIXED, "ball", initial={**motion, "ball": ball}, outputs=outputs), duration=1.0, **tight()),
        bc.simulate(
            scene(
                three_revolutes(MIXED, "ball", "bob"), "three", outputs=outputs,
                initial=motion | {"velocity": motion["velocity"] | {"ball_x": 0.5, "ball_y": -0.4, "ball_z": 0.3}},
            ),
            duration=1.0, **tight(),
        ),
    ]  # fmt: skip
    first, second = (run.outputs["tip"] for run in runs)
    assert np.ptp(first, axis=0).max() > 0.1
    assert np.abs(first - second).max() <= 1e-8
    assert np.abs(runs[0].joint("screw").position - runs[1].joint("screw").position).max() <= 1e-8
    assert all(run.energy_drift() <= 1e-9 for run in runs)


def test_a_bolt_falls_along_its_thread(scene):
    """(I + m h²) θ̈ = −m g h with h = pitch / 2π: the fall of a nut on a vertical screw without friction."""
    h = 0.4 / (2.0 * math.pi)
    angle = -0.8 * GRAVITY * h / (0.003 + 0.8 * h * h)
    run = bc.simulate(scene(BOLT, initial={"screw": 0.5, "velocity": {"screw": 1.0}}), duration=1.0, samples=51)
    expected = 0.5 + run.time + 0.5 * angle * run.time**2
    assert run.joint("screw").position == pytest.approx(expected, rel=1e-10, abs=1e-10)
    assert run.frame("nut").position[:, 2] == pytest.approx(h * expected, rel=1e-10, abs=1e-10)
    assert run.acceleration[:, 0] == pytest.approx(angle, rel=1e-12)
    assert run.energy_drift() <= 1e-12


def test_a_screw_is_a_revolute_and_a_coupled_prismatic_joint(scene):
    """The same with a revolute and a prismatic joint that a coupling ties together, whose multiplier is the thread."""
    pair = MIXED.replace('type="screw" pitch="0.1"', 'type="revolute"').replace(
        '<child link="nut"/>', '<child link="ring"/>'
    )
    slide = (
        '<link name="ring"/><joint name="slide" type="prismatic"><parent link="ring"/><child link="nut"/>'
        '<axis xyz="0.6 0 0.8"/><limit lower="-9" upper="9" effort="9" velocity="9"/></joint></robot>'
    )
    pair = pair.replace("</robot>", slide)
    h = 0.1 / (2.0 * math.pi)
    coupling = [{"kind": "coupling", "joint_a": "screw", "joint_b": "slide", "ratio": h}]
    initial = {"screw": 0.4, "velocity": {"screw": 1.0}, "ball": START["ball"]}
    runs = [
        bc.simulate(scene(MIXED, "one", initial=initial), duration=0.5, **tight()),
        bc.simulate(scene(pair, "two", initial=initial, constraints=coupling), duration=0.5, **tight()),
    ]
    for name in ("screw", "cardan_1", "ball"):
        assert np.abs(runs[0].joint(name).position - runs[1].joint(name).position).max() <= 1e-7, name


def test_a_spring_of_a_ball_against_energy_and_against_its_own_pendulum(scene):
    """Small turns about z of a body without gravity: θ̈ = −(k/C) θ; large ones keep T + V."""
    spring = {"kind": "spherical_spring", "joint": "ball", "stiffness": 0.8, "rpy": [0, 0, "90 deg"]}
    start = {"ball": {"rpy": [0, 0, "30 deg"]}}
    free = {"gravity": [0, 0, 0], "forces": [spring], "outputs": {"torque": {"force": "spherical_spring"}}}
    run = bc.simulate(scene(TOP, initial=start, **free), duration=2.0, samples=101, **tight())
    angle = 2.0 * np.arctan2(run.position[:, 2], run.position[:, 3])
    expected = math.radians(90.0) - math.radians(60.0) * np.cos(math.sqrt(0.8 / ALONG) * run.time)
    assert np.abs(angle - expected).max() <= 1e-7
    assert run.outputs["torque"][0] == pytest.approx([0.0, 0.0, 0.8 * math.radians(60.0)], abs=1e-12)
    start = {"ball": {"rpy": ["100 deg", "20 deg", "-80 deg"], "angular_velocity": [0.3, 2.0, 1.0]}}
    run = bc.simulate(scene(TOP, initial=start, forces=[spring]), duration=2.0, **tight())
    assert run.energy_drift() <= 1e-8


# Torques (N m) of the passive forces of a ball joint with stiffness 0.8 and damping 0.05 at five random states, as
# MuJoCo 4.0.0 computes them (qfrc_passive after mj_forward).
MUJOCO_BALL_SPRING = (
    (-0.4005611035219611, 0.43093159707301004, -2.2419331789585857),
    (0.32131292909890075, 0.8492181631846721, 0.3773609806269378),
    (0.030738265931542177, -0.3910192600218787, -0.24749844534456586),
    (1.4094256331371917, -1.7257802873922543, 0.385095142659218),
    (0.7901076929569684, 0.19005478026728037, -1.7761227802476316),
)


@pytest.mark.parametrize("seed", range(5))
def test_a_spring_of_a_ball_is_that_of_mujoco(scene, seed):
    rng = np.random.default_rng(seed)
    quaternion = rng.normal(size=4)
    quaternion /= np.linalg.norm(quaternion)
    start = {"ball": {"quaternion_xyzw": quaternion.tolist(), "angular_velocity": rng.normal(size=3).tolist(),
                      "expressed_in": "body"}}  # fmt: skip
    spring = {"kind": "spherical_spring", "joint": "ball", "stiffness": 0.8, "damping": 0.05}
    made = scene(TOP, initial=start, forces=[spring], outputs={"torque": {"force": "spherical_spring"}})
    run = bc.simulate(made, duration=1e-9, samples=2)
    assert run.outputs["torque"][0] == pytest.approx(MUJOCO_BALL_SPRING[seed], rel=1e-12, abs=1e-14)


@pytest.mark.tier2
def test_a_rod_with_a_ball_at_each_end_keeps_its_length(scene):
    """A ball at one end and a point at the other: as far apart as a distance constraint holds the same two points."""
    crank = [
        '<robot name="rod"><link name="base"/>',
        link("crank", "0.15 0 0", 0.6, diagonal(0.001, 0.004, 0.004)),
        link("arm", "0 0.2 0", 0.8, diagonal(0.005, 0.001, 0.005)),
        joint("turn", "continuous", "base", "crank", '<axis xyz="0 0 1"/>'),
        joint("swing", "continuous", "base", "arm", '<axis xyz="1 0 0"/>', '<origin xyz="0.8 0 0.1"/>'),
    ]
    rod = [
        link("rod", "0.25 0 0", 0.3, diagonal(0.0001, 0.006, 0.006)),
        joint("ball", "spherical", "crank", "rod", origin='<origin xyz="0.3 0 0"/>'),
    ]
    frames = {"pin": {"link": "arm", "xyz": [0, 0.4, 0]}, "eye": {"link": "crank", "xyz": [0.3, 0, 0]}}
    motion = {"turn": 0.2, "swing": {"guess": 0.3}, "velocity": {"turn": 1.5}}
    with_rod = {
        "frames": frames | {"end": {"link": "rod", "xyz": [0.65, 0, 0]}}, "initial": motion,
        "constraints": [{"kind": "point", "frame_a": "end", "frame_b": "pin"}],
    }  # fmt: skip
    robot = scene("".join([*crank, *rod, "</robot>"]), "rod", **with_rod)
    q = consistent_start(robot)[0]
    assert np.linalg.norm(q[robot.robot.joint("ball").q :][:4]) == pytest.approx(1.0, abs=1e-14)
    assert q[robot.robot.joint("turn").q] == 0.2
    for solver in ("DOP853", "Radau"):
        run = bc.simulate(robot, duration=1.0, samples=51, **tight(solver))
        assert run.constraint_residual() <= 1e-10
        assert run.energy_drift() <= 1e-7
        distance = np.linalg.norm(run.frame("pin").position - run.frame("eye").position, axis=1)
        assert np.abs(distance - 0.65).max() <= 1e-10
    light = scene(
        "".join([*crank, *rod, "</robot>"]).replace('mass value="0.3"', 'mass value="1e-9"')
        .replace(diagonal(0.0001, 0.006, 0.006), diagonal(1e-9, 1e-9, 1e-9)), "light", **with_rod,
    )  # fmt: skip
    tie = [{"kind": "distance", "frame_a": "eye", "frame_b": "pin", "length": 0.65}]
    swing = {"swing": {"guess": float(q[robot.robot.joint("swing").q])}}
    massless = scene("".join([*crank, "</robot>"]), "tie", frames=frames, initial=motion | swing, constraints=tie)
    first, second = (
        bc.simulate(s, duration=0.5, samples=26, rtol=1e-9).joint("swing").position for s in (light, massless)
    )
    assert np.ptp(first) > 0.05
    assert np.abs(first - second).max() <= 1e-5  # the light rod's own mass


def test_an_ensemble_does_what_single_runs_do(scene):
    made = scene(
        TOP, initial=START, parameters={"load": {"value": 0.5, "sets": ["link.body.mass"]}}, simulate={"duration": 0.5}
    )
    labels = [f"ball.q{c}" for c in "xyzw"] + [f"ball.r{c}.velocity" for c in "xyz"]
    masses = [0.4, 0.5, 0.7]
    found = bc.sweep(made, {"load": masses})
    for row, mass in enumerate(masses):
        run = bc.simulate(made, overrides={"parameters.load.value": mass})
        ends = [float(found.column(f"end.{name}")[row]) for name in labels]
        assert ends == pytest.approx([*run.position[-1], *run.velocity[-1]], rel=1e-7, abs=1e-9)


def test_a_saved_run_is_read_and_continued(scene, tmp_path):
    made = scene(MIXED, initial={**START, "screw": 0.4})
    whole = bc.simulate(made, duration=0.6, samples=61, **tight())
    half = bc.simulate(made, duration=0.3, samples=31, **tight())
    half.save(tmp_path / "half.npz")
    again = bc.load_run(tmp_path / "half.npz")
    assert np.array_equal(again.state, half.state)
    rest = bc.simulate(scene(MIXED, "rest", initial={"run": "half.npz"}), duration=0.3, samples=31, **tight())
    assert np.abs(rest.position[-1] - whole.position[-1]).max() <= 1e-8


def test_a_run_as_csv_is_a_motion_again(scene, tmp_path):
    made = scene(MIXED, initial={**START, "screw": 0.4})
    run = bc.simulate(made, duration=0.4, samples=401, **tight())
    run.to_csv(tmp_path / "run.csv")
    header = (tmp_path / "run.csv").read_text().splitlines()[0]
    assert "ball position qx [1],ball position qy [1],ball position qz [1],ball position qw [1]," in header
    assert "ball velocity rx [rad/s]" in header
    assert "screw position [rad]" in header
    motion = bc.read_motion(made.robot, tmp_path / "run.csv")
    assert np.abs(motion.position - run.position).max() <= 1e-12
    q, v, a = motion.at(0.1234)
    torque = made.robot.inverse_dynamics(q, v, a)
    assert np.abs(torque).max() <= 1e-4  # nothing drives it: the polynomials between rows leave this


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"initial": {"ball": 0.3}}, "joint 'ball' is spherical; expected a mapping {rpy: "),
        ({"initial": {"ball": {"position": [0, 0, 0]}}}, "unknown key 'position'"),
        ({"initial": {"ball": {"quaternion_xyzw": [0, 0, 0, 2]}}}, "of length 1, found length 2"),
        ({"initial": {"velocity": {"ball": 1}}}, "this joint has several degrees of freedom"),
        ({"forces": [{"kind": "damper", "joint": "ball", "coefficient": 1}]}, "joint 'ball' is spherical"),
        ({"forces": [{"kind": "spherical_spring", "joint": "screw"}]}, "joint 'screw' is screw; expected a spherical"),
        ({"outputs": {"x": {"expression": "joint('ball').position"}}}, "joint 'ball' is spherical; write frame"),
        ({"events": [{"name": "e", "when": {"joint": "ball", "position": 1}}]}, "joint 'ball' is spherical"),
        ({"control": [{"kind": "pd", "target": {"ball": 1}, "kp": 1}]}, "joint 'ball' is spherical"),
    ],
)
def test_what_a_ball_cannot_take_is_refused(scene, keys, message):
    with pytest.raises(InputError, match=message):
        scene(MIXED, **keys)
