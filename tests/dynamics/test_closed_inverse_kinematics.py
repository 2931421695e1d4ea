"""Frames of closed linkages along paths, against closed forms, Pinocchio's accelerations and differences."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import minimize

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.dynamics.inverse.scene_inverse_dynamics import scene_inverse_dynamics
from bellcrank.errors import InputError, UnreachableError
from bellcrank.motion.generators.frame_motions import line

BASE, PLATFORM, ARM, ROD, HALF = 0.2, 0.06, 0.2, 0.5, 0.04
TURNS = [2 * np.pi * k / 3 for k in range(3)]


def link(name, mass, at=0.0):
    inertia = '<inertia ixx="2e-3" ixy="0" ixz="0" iyy="3e-3" iyz="0" izz="4e-3"/>'
    return f'<link name="{name}"><inertial><origin xyz="{at} 0 0"/><mass value="{mass}"/>{inertia}</inertial></link>'


def joint(name, parent, child, axis, xyz=(0, 0, 0), yaw=0.0, kind="continuous"):
    limit = '<limit lower="-2" upper="2" effort="1e3" velocity="1e2"/>' if kind == "prismatic" else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz[0]} {xyz[1]} {xyz[2]}" rpy="0 0 {yaw}"/><axis xyz="{axis}"/>{limit}</joint>'
    )


def delta(folder, carried, motions):
    """A spatial delta of three arms, its platform carried by three slides or by the whole first leg.

    In both the other legs are rods between points: one each where slides keep the platform level, two each (a
    parallelogram) where the first leg has two universal joints.
    """
    text = '<robot name="delta"><link name="ground"/>'
    for k, turn in enumerate(TURNS):
        text += link(f"arm_{k}", 0.5, ARM / 2)
        text += joint(f"arm_{k}", "ground", f"arm_{k}", "0 1 0", (BASE * np.cos(turn), BASE * np.sin(turn), 0), turn)
    if carried == "slides":
        steps = [("px", "1 0 0", 0), ("py", "0 1 0", 0), ("pz", "0 0 1", 0)]
        parent, kind, guesses = "ground", "prismatic", "pz: {guess: -0.4}"
    else:
        steps = [("bend", "0 1 0", ARM), ("swing", "0 0 1", 0), ("unswing", "0 0 1", ROD), ("unbend", "0 1 0", 0)]
        parent, kind = "arm_0", "continuous"
        guesses = "bend: {guess: 1.3}, unbend: {guess: -1.6}"
    for k, (name, axis, at) in enumerate(steps):
        child = "hub" if k + 1 == len(steps) else f"{name}_link"
        text += (link(child, 0.1) if child != "hub" else link(child, 1.0)) + joint(
            name, parent, child, axis, (at, 0, 0), 0.0, kind
        )
        parent = child
    middle = "0" if carried == "slides" else str(-PLATFORM)  # from the hub's origin to the platform's centre
    frames, constraints = f"  tool: {{link: hub, xyz: [{middle}, 0, 0]}}\n", ""
    for k, turn in enumerate(TURNS):
        sides = [0.0] if carried == "slides" else [] if k == 0 else [-HALF, HALF]
        for side in sides:
            at = np.array(
                [PLATFORM * np.cos(turn) - side * np.sin(turn), PLATFORM * np.sin(turn) + side * np.cos(turn)]
            )
            name = f"{k}_{'n' if side < 0 else 'p'}"
            frames += f"  elbow_{name}: {{link: arm_{k}, xyz: [{ARM}, {side}, 0]}}\n"
            frames += f"  corner_{name}: {{link: hub, xyz: [{at[0] + float(middle)}, {at[1]}, 0]}}\n"
            rod = f"kind: distance, frame_a: elbow_{name}, frame_b: corner_{name}, length: {ROD}"
            constraints += f"  - {{name: rod_{name}, {rod}}}\n"
    (folder / "delta.urdf").write_text(text + "</robot>")
    (folder / "delta.yaml").write_text(
        f"name: Delta\nurdf: delta.urdf\ngravity: [0, 0, -9.81]\nframes:\n{frames}constraints:\n{constraints}"
        f"initial: {{arm_0: 0.3, arm_1: 0.3, arm_2: 0.3, {guesses}}}\nactuated: [arm_0, arm_1, arm_2]\n"
        f"motions:\n{motions}"
    )
    return bc.load_scene(folder / "delta.yaml")


PICK = (
    "  pick: {kind: line, frame: tool, begin: [-0.1, 0, -0.45], end: [0.12, 0, -0.4], duration: 0.5, samples: 201}\n"
    "  ring: {kind: circle, frame: tool, center: [0.02, 0.01, -0.45], radius: 0.08, normal: [0.3, 0.2, 1],\n"
    "         duration: 1, profile: quintic, samples: 301}\n"
    "  there_and_back: {kind: join, parts: [pick, {kind: dwell, duration: 0.1}, {kind: line, frame: tool,\n"
    "                   end: [-0.1, 0.05, -0.45], duration: 0.4, samples: 101}]}\n"
    "  plane: {kind: waypoints, times: [0, 1], positions: [{px: 0, pz: -0.4}, {px: 0.1, pz: -0.4}]}\n"
    "  free_y: {kind: line, frame: tool, begin: [-0.1, 0, -0.45], end: [0.12, 0, -0.4], duration: 0.5,\n"
    "           coordinates: [x, z]}\n"
    "  far: {kind: line, frame: tool, begin: [0, 0, -0.45], end: [0.9, 0, -0.45], duration: 0.5, samples: 51}\n"
)


def arm_angles(x):
    """The arms' angles (n, 3) at platform centres x (n, 3), elbows outward: A cos θ − B sin θ = C for each leg."""
    found = []
    for turn in TURNS:
        out = np.array([np.cos(turn), np.sin(turn), 0])
        d = x + PLATFORM * out - BASE * out  # from the shoulder to the corner
        a, b = d @ out, d[:, 2]
        c = (np.einsum("ij,ij->i", d, d) + ARM**2 - ROD**2) / (2 * ARM)
        found.append(-np.arccos(c / np.hypot(a, b)) - np.arctan2(b, a))
    return np.array(found).T


def slope(rows, dt):
    """Central differences of sixth order, without three rows at either end."""
    weights = np.array([-1, 9, -45, 0, 45, -9, 1]) / (60 * dt)
    return sum(w * rows[k : len(rows) - 6 + k] for k, w in enumerate(weights))


def check_along(scene, motion, frame, x, velocity, acceleration):
    """Posture, velocity and acceleration of a frame along a motion, by Pinocchio's own functions; constraints too."""
    model = scene.robot.model
    data, at = model.createData(), model.getFrameId(frame)
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    for k in range(len(motion)):
        q, v, a = motion.position[k], motion.velocity[k], motion.acceleration[k]
        pin.forwardKinematics(model, data, q, v, a)
        pin.updateFramePlacements(model, data)
        np.testing.assert_allclose(data.oMf[at].translation, x[k], atol=1e-10)
        np.testing.assert_allclose(pin.getFrameVelocity(model, data, at, axes).linear, velocity[k], atol=1e-9)
        found = pin.getFrameClassicalAcceleration(model, data, at, axes).linear
        np.testing.assert_allclose(found, acceleration[k], atol=1e-8)


def quintic(u):
    """10 u³ − 15 u⁴ + 6 u⁵ with its first and second derivatives."""
    return (
        10 * u**3 - 15 * u**4 + 6 * u**5,
        30 * u**2 - 60 * u**3 + 30 * u**4,
        60 * u - 180 * u**2 + 120 * u**3,
    )


@pytest.mark.tier2
@pytest.mark.parametrize("carried", ["slides", "leg"])
def test_a_deltas_arms_follow_a_line_of_its_platform_as_in_closed_form(tmp_path, carried):
    scene = delta(tmp_path, carried, PICK)
    found = scene_inverse_dynamics(scene, "pick")
    motion, time = found.motion, found.time
    begin, end = np.array([-0.1, 0, -0.45]), np.array([0.12, 0, -0.4])
    s, ds, dds = (x[:, None] / 0.5**k * (end - begin) for k, x in enumerate(quintic(time / 0.5)))
    check_along(scene, motion, "tool", begin + s, ds, dds)
    arms = [scene.robot.joint(f"arm_{k}").v for k in range(3)]
    np.testing.assert_allclose(motion.position[:, arms], arm_angles(begin + s), atol=1e-9)
    # all joints: rates are the derivatives of positions, by differences
    dt = time[1] - time[0]
    np.testing.assert_allclose(slope(motion.position, dt), motion.velocity[3:-3], atol=1e-8)
    np.testing.assert_allclose(slope(motion.velocity, dt), motion.acceleration[3:-3], atol=2e-6)
    turn = scene.robot.frame_pose("tool", motion.position)[1]
    np.testing.assert_allclose(turn, np.tile(np.eye(3), (201, 1, 1)), atol=1e-9)
    # the motors' power is the rate of the energy
    power = np.einsum("ij,ij->i", found.torque, motion.velocity[:, arms])
    energy = np.sum(scene.robot.energy(motion.position, motion.velocity), axis=0)
    np.testing.assert_allclose(slope(energy, dt), power[3:-3], atol=1e-6 * np.abs(power).max())


def test_a_tilted_ring_of_a_delta_carried_by_its_leg_is_right_to_the_acceleration(tmp_path):
    scene = delta(tmp_path, "leg", PICK)
    motion = scene_inverse_dynamics(scene, "ring").motion
    n = np.array([0.3, 0.2, 1]) / np.linalg.norm([0.3, 0.2, 1])
    e1 = np.eye(3)[0] - n[0] * n
    e1 /= np.linalg.norm(e1)
    e2 = np.cross(n, e1)
    angle, rate, growth = (2 * np.pi * x[:, None] for x in quintic(motion.time))
    out, along = np.cos(angle) * e1 + np.sin(angle) * e2, np.cos(angle) * e2 - np.sin(angle) * e1
    x = np.array([0.02, 0.01, -0.45]) + 0.08 * out
    check_along(scene, motion, "tool", x, 0.08 * rate * along, 0.08 * (growth * along - rate**2 * out))
    np.testing.assert_allclose(motion.position[0], motion.position[-1], atol=1e-10)  # a closed path ends at its start


@pytest.mark.parametrize("carried", ["slides", "leg"])
def test_a_joined_motion_goes_on_from_where_its_parts_ended(tmp_path, carried):
    scene = delta(tmp_path, carried, PICK)
    motion = scene_inverse_dynamics(scene, "there_and_back").motion
    assert motion.time[-1] == pytest.approx(1.0)
    x = scene.robot.frame_pose("tool", motion.position)[0]
    resting = (motion.time >= 0.5) & (motion.time <= 0.6)
    np.testing.assert_allclose(x[resting], np.tile([0.12, 0, -0.4], (resting.sum(), 1)), atol=1e-10)
    np.testing.assert_allclose(x[-1], [-0.1, 0.05, -0.45], atol=1e-10)
    arms = [scene.robot.joint(f"arm_{k}").q for k in range(3)]
    np.testing.assert_allclose(motion.position[:, arms], arm_angles(x), atol=1e-9)


def test_a_speed_factor_makes_a_path_of_a_linkage_faster(tmp_path):
    scene = delta(tmp_path, "slides", PICK)
    for name in ("pick", "there_and_back"):
        once, fast = (
            Linkage(bc.load_scene(scene.source, overrides={f"motions.{name}.speed_factor": factor})).motion(name)
            for factor in (1.0, 2.0)
        )
        np.testing.assert_allclose(fast.time, 0.5 * once.time)
        np.testing.assert_allclose(fast.position, once.position)
        np.testing.assert_allclose(fast.velocity, 2.0 * once.velocity)
        np.testing.assert_allclose(fast.acceleration, 4.0 * once.acceleration)


@pytest.mark.tier2
@pytest.mark.parametrize("carried", ["slides", "leg"])
def test_a_delta_is_sized_along_a_path_of_its_platform(tmp_path, carried, capsys):
    scene = delta(tmp_path, carried, PICK)
    out = tmp_path / "out"
    assert main(["size", str(scene.source), "--motion", "pick", "--out", str(out), "--no-plots"]) == 0
    assert "arm_2" in capsys.readouterr().out
    # its history drives the scene: the platform ends where the path does
    drives = [
        {"kind": "prescribed_motion", "name": f"motor_{k}", "joint": f"arm_{k}", "motion": "solved"} for k in range(3)
    ]
    changes = {
        "motions.solved": {"kind": "csv", "file": "out/history_pick.csv"},
        "constraints": [*scene.data["constraints"], *drives],
        "initial": {"motion": "solved"},
    }
    run = bc.simulate(scene.with_overrides(changes), 0.5)
    assert run.success
    np.testing.assert_allclose(run.frame("tool").position[-1], [0.12, 0, -0.4], atol=1e-6)


@pytest.mark.parametrize(
    ("carried", "motion", "words"),
    [
        (
            "slides",
            "plane",
            "has 3 degrees of freedom and this motion prescribes 2 (px, pz); prescribe 1",
        ),
        ("leg", "free_y", "prescribes 2 (x, z of frame 'tool'); prescribe 1 more, such as y (coordinates)"),
        ("slides", "free_y", "prescribes 2 (x, z of frame 'tool'); prescribe 1 more, such as y (coordinates)"),
    ],
)
def test_a_motion_that_leaves_freedoms_open_says_what_it_prescribes(tmp_path, carried, motion, words):
    scene = delta(tmp_path, carried, PICK)
    with pytest.raises(InputError) as refusal:
        scene_inverse_dynamics(scene, motion)
    assert words in str(refusal.value)


def test_a_path_that_leaves_the_reach_of_a_delta_says_when_and_where(tmp_path):
    scene = delta(tmp_path, "slides", PICK)
    with pytest.raises(UnreachableError, match=r"motion 'far' cannot be followed at 0\.\d+ s: frame"):
        scene_inverse_dynamics(scene, "far")


def test_coordinates_must_be_axes(tmp_path):
    with pytest.raises(InputError, match=r"pick\.coordinates.*expected a list of some of x, y, z"):
        delta(tmp_path, "slides", PICK.replace("samples: 201", "coordinates: [x, q]"))


def test_an_open_arm_keeps_the_coordinates_that_a_path_does_not_prescribe_nearest_to_its_start():
    robot = bc.load_robot("planar_2r")
    start = {"shoulder": 0.4, "elbow": 1.0}
    frame = robot.frame_names[-1]
    here = robot.frame_pose(frame, robot.posture(start))[0]
    end = here + np.array([-0.3, 5.0, 7.0])  # y and z are not asked for
    motion = line(robot, frame, end, duration=1.0, begin=here, start=start, samples=5, coordinates=["x"])
    x = robot.frame_pose(frame, motion.position)[0][:, 0]
    for k, wanted in enumerate(x):
        nearest = minimize(
            lambda q: np.sum((q - motion.position[0]) ** 2),
            motion.position[k],
            constraints={"type": "eq", "fun": lambda q, wanted=wanted: robot.frame_pose(frame, q)[0][0] - wanted},
            method="SLSQP",
            options={"ftol": 1e-15},
        )
        np.testing.assert_allclose(motion.position[k], nearest.x, atol=1e-6)
    assert x[0] - x[-1] == pytest.approx(0.3, abs=1e-12)


def test_a_drive_or_controller_that_a_frames_path_does_not_reach_is_refused(tmp_path):
    scene = delta(tmp_path, "leg", PICK)
    drive = {"name": "motor", "kind": "prescribed_motion", "joint": "arm_1", "motion": "there_and_back"}
    with pytest.raises(InputError, match=r"moves frame 'tool' along a path, but arm_1 does not carry that frame"):
        scene.with_overrides({"constraints": [*scene.data["constraints"], drive]})
    pd = {"name": "servo", "kind": "pd", "joint": "arm_2", "motion": "pick", "kp": 10, "kd": 1}
    with pytest.raises(InputError, match=r"but arm_2 does not carry that frame"):
        scene.with_overrides({"control": [pd]})
    scene.with_overrides({"control": [{**pd, "joint": "arm_0"}]})
