"""The start of a scene: floating and planar joints, velocities that are given in part, and saved runs."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.dynamics.constraints.constraint_rows import rows_of
from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.errors import InputError
from bellcrank.scene.scene import load_scene
from bellcrank.simulation.simulate import simulate
from bellcrank.simulation.trajectory.scene_notes import scene_notes

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
    q, v = consistent_start(scene)
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
    np.testing.assert_allclose(consistent_start(scene.with_overrides({"initial.loose": free}))[0], q, atol=1e-15)


@pytest.mark.parametrize("axes", ["parent", "body"])
def test_a_planar_joint_starts_at_its_place_angle_and_rates(tmp_path, axes):
    scene = carrier(
        tmp_path,
        "planar",
        "initial: {turn: -0.4, loose: {position: [0.1, -0.2], angle: 70 deg, linear_velocity: [0.3, -0.1], "
        f"angular_velocity: 90 deg/s, expressed_in: {axes}}}}}",
    )
    q, v = consistent_start(scene)
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

ROLLER = """\
name: Roller
urdf: thin_disk
floating_base: true
constraints: [{{name: floor, kind: rolling_disk, frame: disk, axis: [0, 1, 0], radius: 0.1}}]
base: {{{base}}}
"""


def roller(folder, base):
    (folder / "roller.yaml").write_text(ROLLER.format(base=base))
    return load_scene(folder / "roller.yaml")


def world_velocity(scene):
    """Linear and angular velocity (3) of the disk in world axes, and the arm (3) from its centre to the contact."""
    q, v = consistent_start(scene)
    turn = Rotation.from_quat(q[3:7])
    axis = turn.apply([0.0, 1.0, 0.0])
    down = axis[2] * axis - np.array([0.0, 0.0, 1.0])
    return turn.apply(v[:3]), turn.apply(v[3:]), 0.1 * down / np.linalg.norm(down)


@pytest.mark.parametrize("axes", ["world", "body"])
@pytest.mark.parametrize("component", [0, 1, 2])
def test_one_component_of_a_disks_spin_is_held_and_the_rest_is_the_least_that_rolls(tmp_path, axes, component):
    start = "position: [0.2, -0.1, 0.09], rpy: [0.3, 0.2, 0.4]"
    entries = ["~"] * 3
    entries[component] = "-6"
    where = f"{start}, expressed_in: {axes}, angular_velocity"
    free_height = where.replace("0.09]", "~]")  # the height follows
    scene = roller(tmp_path, f"{free_height}: [{', '.join(entries)}]")
    linear, angular, arm = world_velocity(scene)
    np.testing.assert_allclose(consistent_start(scene)[0][:2], [0.2, -0.1], atol=1e-13)
    np.testing.assert_allclose(consistent_start(scene)[0][2], -arm[2], atol=1e-13)
    np.testing.assert_allclose(linear + np.cross(angular, arm), 0, atol=1e-12)  # the contact point is at rest
    turn = np.eye(3) if axes == "world" else Rotation.from_quat(consistent_start(scene)[0][3:7]).as_matrix()
    assert (turn.T @ angular)[component] == pytest.approx(-6, abs=1e-12)
    cross = np.cross(np.eye(3), arm)  # rows e_k x arm: the contact's velocity by spins about the axes
    rows = np.vstack([np.hstack([np.eye(3), cross.T]), np.concatenate([np.zeros(3), turn[:, component]])])
    sizes = np.where(np.arange(6) < 3, rows_of(scene).length, 1.0)  # speeds count in lengths of the mechanism a second
    least = sizes * np.linalg.lstsq(rows * sizes, np.array([0, 0, 0, -6.0]), rcond=None)[0]
    np.testing.assert_allclose(np.concatenate([linear, angular]), least, atol=1e-11)
    named = roller(tmp_path, f"{free_height}: {{{'xyz'[component]}: -6}}")
    np.testing.assert_allclose(consistent_start(named)[1], consistent_start(scene)[1], atol=1e-13)
    later = roller(tmp_path, free_height.removesuffix(", angular_velocity")).with_overrides(
        {f"base.angular_velocity.{'xyz'[component]}": -6}
    )
    np.testing.assert_allclose(consistent_start(later)[1], consistent_start(scene)[1], atol=1e-13)


def test_a_speed_in_part_gives_a_disk_its_spin_and_drift_follows(tmp_path):
    scene = roller(tmp_path, "position: [0, 0, 0.1], rpy: [0, 0, 30 deg], linear_velocity: [1.5, ~, ~]")
    linear, angular, arm = world_velocity(scene)
    assert linear[0] == pytest.approx(1.5, abs=1e-13)
    np.testing.assert_allclose(linear + np.cross(angular, arm), 0, atol=1e-12)


def test_a_world_velocity_stays_where_the_attitude_is_a_guess(tmp_path):
    """The constraint turns the disk upright; the velocity held in world axes must not turn with it."""
    text = ROLLER.format(
        base="position: [0, 0, 0.1], rpy: {guess: [0.2, 0, 0.4]}, angular_velocity: [~, ~, 3], linear_velocity: {x: 1}"
    )
    (tmp_path / "roller.yaml").write_text(text)
    scene = load_scene(tmp_path / "roller.yaml")
    linear, angular, arm = world_velocity(scene)
    assert abs(consistent_start(scene)[0][3]) < 1e-6 and linear[0] == pytest.approx(1, abs=1e-12)
    assert angular[2] == pytest.approx(3, abs=1e-12)
    np.testing.assert_allclose(linear + np.cross(angular, arm), 0, atol=1e-9)


def test_components_that_are_not_given_are_0_where_nothing_closes(tmp_path):
    scene = carrier(tmp_path, "floating", "initial: {loose: {angular_velocity: {z: 2}, position: [~, 0.1, ~]}}")
    np.testing.assert_array_equal(consistent_start(scene)[1], [0, 0, 0, 0, 0, 0, 2])
    np.testing.assert_array_equal(consistent_start(scene)[0][1:], [0, 0.1, 0, 0, 0, 0, 1])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("loose: 0.3", "joint 'loose' is floating; expected a mapping"),
        ("loose: {position: [1, 2]}", "position (line 4): expected a list of 3 numbers in m, with ~ for open ones"),
        ("loose: {position: {w: 1}}", "unknown key 'w'"),
        ("loose: {expressed_in: world}", "(expected: parent, body)"),
        ("loose: {rpy: [0, 0, 0], quaternion_xyzw: [0, 0, 0, 1]}", "expected 'rpy' or 'quaternion_xyzw', found both"),
        ("loose: {quaternion_xyzw: [0, 0, 0, 2]}", "of length 1, found length 2"),
        ("loose: {angle: 3}", "unknown key 'angle'"),
        ("velocity: {loose: 3}", "write initial: {loose: {linear_velocity: …, angular_velocity: …}}"),
    ],
)
def test_a_wrong_start_of_a_floating_joint_is_one_sentence(tmp_path, text, words):
    with pytest.raises(InputError) as refusal:
        carrier(tmp_path, "floating", f"initial: {{{text}}}")
    assert words in str(refusal.value)
    assert "initial" in str(refusal.value)


def test_the_free_base_is_not_started_twice(tmp_path):
    roller(tmp_path, "position: [0, 0, 0.1]")
    with pytest.raises(InputError, match="key 'base'"):
        load_scene(tmp_path / "roller.yaml", {"initial.root_joint": {"position": [0, 0, 1]}})


@pytest.mark.parametrize("one", ["1", "1.0", "'1'"])
def test_a_plain_number_has_the_unit_1(tmp_path, one):
    scene = carrier(tmp_path, "floating", f"outputs: {{turns: {{expression: turn.position / (2 * pi), unit: {one}}}}}")
    assert scene.outputs["turns"].labels == ("turns [1]",)
    with pytest.raises(InputError, match=r"turns\.unit.*or 1 for a plain number, found 2"):
        scene.with_overrides({"outputs.turns.unit": 2})


# ---- starts from saved runs


def split_in_two(scene, folder, half, changes=None):
    """The last rows of a whole run and of one that stops half way and goes on from its file."""
    whole = simulate(scene, duration=2 * half)
    first = simulate(scene, duration=half)
    first.save(folder / "half.npz")
    second = simulate(scene, half, overrides={"initial": {"run": str(folder / "half.npz"), **(changes or {})}})
    assert first.success and second.success
    assert second.time[0] == 0 and second.time[-1] == half
    return whole, first, second


def continued(scene):
    """The scene without what `base` gives, which would go before the run's."""
    data = {key: value for key, value in scene.data.items() if key not in ("base", "initial")}
    path = scene.source.with_name("continued.yaml")
    import yaml

    path.write_text(yaml.safe_dump(data))
    return load_scene(path)


def test_a_tumbling_body_goes_on_from_its_file_to_the_bit(tmp_path):
    free = "loose: {position: [0.1, 0, 0], linear_velocity: [1, 2, 3], angular_velocity: [3, 4, 5]}"
    scene = carrier(
        tmp_path,
        "floating",
        f"initial: {{turn: 0.4, {free}, velocity: {{turn: 1.5}}}}\nsimulate: {{rtol: 1e-11, atol: 1e-11}}",
    )
    whole, first, second = split_in_two(scene, tmp_path, 0.5)
    np.testing.assert_array_equal(second.state[0], first.state[-1])  # the quaternion too
    np.testing.assert_allclose(second.state[-1], whole.state[-1], atol=1e-9)


@pytest.mark.tier2
@pytest.mark.parametrize("name", ["rolling_disk", "four_bar"])
def test_a_closed_scene_goes_on_from_its_file(tmp_path, name):
    import shutil

    bundled = load_scene(name)
    shutil.copy(bundled.robot.source, tmp_path)
    data = {**bundled.data, "urdf": bundled.robot.source.name}
    import yaml

    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(data))
    scene = load_scene(tmp_path / "scene.yaml", {"simulate.rtol": 1e-11, "simulate.atol": 1e-11})
    whole, first = simulate(scene, duration=0.6), simulate(scene, duration=0.3)
    first.save(tmp_path / "half.npz")
    second = simulate(continued(scene), 0.3, overrides={"initial.run": "half.npz"}, rtol=1e-11, atol=1e-11)
    size = scene.robot.nq + scene.robot.nv
    np.testing.assert_allclose(second.state[0, :size], first.state[-1, :size], rtol=0, atol=1e-13)
    np.testing.assert_allclose(second.state[-1, :size], whole.state[-1, :size], rtol=0, atol=1e-8)


PUSHED = """
forces:
  - {name: push, kind: torque, joint: turn, file: push.csv}
constraints: [{name: way, kind: expression, expression: "loose_x.position - 0.1 * sin(3 * t)", unit: m}]
"""


def pushed(folder):
    """Two prismatic joints and an arm: a tabulated torque drives the arm, a formula of t one slide."""
    inertial = BODY.format(mass=2)
    (folder / "pushed.urdf").write_text(
        f'<robot name="pushed"><link name="ground"/><link name="arm">{inertial}</link>'
        f'<link name="cart">{inertial}</link>'
        '<joint name="turn" type="continuous"><parent link="ground"/><child link="arm"/><axis xyz="0 1 0"/></joint>'
        '<joint name="loose_x" type="prismatic"><parent link="arm"/><child link="cart"/><axis xyz="1 0 0"/>'
        '<limit lower="-9" upper="9" effort="9" velocity="9"/></joint></robot>'
    )
    rows = "".join(f"{t},{np.cos(5 * t)}\n" for t in np.linspace(0, 2, 41))
    (folder / "push.csv").write_text("time [s],turn torque [N m]\n" + rows)
    text = "name: Pushed\nurdf: pushed.urdf\nsimulate: {duration: 0.5, rtol: 1e-11, atol: 1e-11}\n"
    (folder / "pushed.yaml").write_text(text + PUSHED)
    return load_scene(folder / "pushed.yaml")


def test_the_clock_goes_on_for_tables_and_formulas(tmp_path):
    scene = pushed(tmp_path)
    whole, first, second = split_in_two(scene, tmp_path, 0.4, {})
    np.testing.assert_allclose(second.state[0, :4], first.state[-1, :4], atol=1e-12)
    np.testing.assert_allclose(second.state[-1, :4], whole.state[-1, :4], atol=1e-8)
    assert not [note for note in scene_notes(second.scene) if "clock" in note]
    # the second run saves itself with its state and clock, and needs the first no more
    second.save(tmp_path / "second.npz")
    (tmp_path / "half.npz").unlink()
    again = bc.load_run(tmp_path / "second.npz")
    assert again.scene.initial.clock == 0.4
    np.testing.assert_array_equal(
        np.concatenate(consistent_start(again.scene)), np.concatenate(consistent_start(second.scene))
    )
    np.testing.assert_allclose(simulate(again.scene, 0.4).state[-1], second.state[-1], atol=1e-12)
    third = simulate(scene, 0.1, overrides={"initial": {"run": "second.npz", "clock": "continue"}})
    assert third.scene.initial.clock == 0.8


def test_a_clock_that_starts_anew_and_a_moved_start_are_said(tmp_path):
    scene = pushed(tmp_path)
    simulate(scene, duration=0.4).save(tmp_path / "half.npz")
    anew = scene.with_overrides({"initial.run": "half.npz", "initial.clock": 0})
    notes = " ".join(scene_notes(anew))
    assert "half.npz ends at clock time 0.4 s" in notes and "push" in notes and "constraint 'way'" in notes
    assert "the run half.npz does not satisfy the constraints" in notes


def test_a_saved_start_that_constraints_move_far_is_refused_unless_that_is_allowed(tmp_path):
    """The slide is at 0.1 sin(1.2) m, and the formula of t begins anew at 0."""
    scene = pushed(tmp_path)
    simulate(scene, duration=0.4).save(tmp_path / "half.npz")
    there = f"{0.1 * np.sin(1.2):.6g}"
    anew = {"initial.run": "half.npz", "initial.clock": 0}
    with pytest.raises(InputError, match=rf"run half.npz places joint 'loose_x' at {there} m.*largest_correction: "):
        consistent_start(scene.with_overrides(anew | {"initial.largest_correction": 0.01}))
    moved = scene.with_overrides(anew | {"initial.largest_correction": "30 deg"})
    assert f"joint 'loose_x' from {there} to 0 m" in " ".join(scene_notes(moved))
    assert consistent_start(moved)[0][1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("kind", ["motion", "guess"])
def test_a_start_that_a_prescribed_motion_moves_is_refused_or_said(kind, tmp_path):
    go = {"kind": "waypoints", "times": [0, 1], "positions": [{"shoulder": 0.1}, {"shoulder": 0.5}]}
    other = {"kind": "waypoints", "times": [0, 1], "positions": [{"shoulder": 1.2}, {"shoulder": 0.5}]}
    data = {"urdf": "planar_2r", "motions": {"go": go, "other": other}, "simulate": {"duration": 0.1},
            "constraints": [{"kind": "prescribed_motion", "name": "drive", "joint": "shoulder", "motion": "go"}],
            "initial": {"motion": "other"} if kind == "motion" else {"shoulder": {"guess": 1.2}}}  # fmt: skip
    (tmp_path / "arm.yaml").write_text(json.dumps(data))
    if kind == "motion":
        with pytest.raises(InputError, match=r"'other' places joint 'shoulder' at 1\.2 rad.*move it to 0\.1 rad"):
            simulate(tmp_path / "arm.yaml")
        allowed = simulate(tmp_path / "arm.yaml", overrides={"initial.largest_correction": 1.2})
        assert any("from 1.2 to 0.1 rad" in note for note in allowed.notes)
    else:
        notes = simulate(tmp_path / "arm.yaml").notes
        assert any("0.1 rad; its guess of 1.2 is not used" in note for note in notes)


def test_another_time_of_a_run_is_one_of_its_rows(tmp_path):
    scene = pushed(tmp_path)
    run = simulate(scene, samples=11)
    run.save(tmp_path / "run.npz")
    start = consistent_start(scene.with_overrides({"initial": {"run": "run.npz", "time": 0.15, "clock": "continue"}}))
    np.testing.assert_allclose(np.concatenate(start), run.state[3, :4], atol=1e-12)
    with pytest.raises(InputError, match=r"initial\.run.*no row at 0\.16 s; the nearest are at 0\.15, 0\.2 s"):
        scene.with_overrides({"initial": {"run": "run.npz", "time": 0.16}})


def test_what_is_named_beside_a_run_goes_before_it(tmp_path):
    free = "loose: {position: [0.1, 0, 0], rpy: [1, 0.5, 0.2], linear_velocity: [1, 2, 3]}"
    scene = carrier(tmp_path, "floating", f"initial: {{turn: 0.4, {free}, velocity: {{turn: 1.5}}}}")
    first = simulate(scene, duration=0.2)
    first.save(tmp_path / "first.npz")
    q, v = first.position[-1].copy(), first.velocity[-1].copy()
    given = {"run": "first.npz", "turn": 0.1, "loose": {"position": [None, 7, None], "linear_velocity": {"z": 5}}}
    start = consistent_start(scene.with_overrides({"initial": given}))
    wanted = q.copy()
    wanted[0], wanted[2] = 0.1, 7
    np.testing.assert_array_equal(start[0], wanted)
    turn = Rotation.from_quat(q[4:8])
    before, after = turn.apply(v[1:4]), turn.apply(start[1][1:4])
    np.testing.assert_allclose(after, [before[0], before[1], 5], atol=1e-13)
    np.testing.assert_array_equal(start[1][[0, 4, 5, 6]], v[[0, 4, 5, 6]])


def test_after_a_latch_a_run_goes_on_behind_the_impact(tmp_path):
    (tmp_path / "carrier.urdf").write_text(CARRIER.replace("KIND", "revolute").replace(
        '<axis xyz="0 0 1"/></joint></robot>',
        '<axis xyz="0 0 1"/><limit lower="-9" upper="9" effort="9" velocity="9"/></joint></robot>'))  # fmt: skip
    (tmp_path / "lock.yaml").write_text(
        "name: Lock\nurdf: carrier.urdf\ngravity: [0, 0, 0]\n"
        "initial: {velocity: {loose: 2, turn: 0.3}}\nsimulate: {duration: 5}\n"
        "events: [{name: shut, when: {joint: loose, position: 0.5}, latch: true}]\n"
    )
    scene = load_scene(tmp_path / "lock.yaml")
    run = simulate(scene)
    latch = run.events[-1].latch
    assert latch is not None and abs(run.velocity[-1, 1]) > 0.1
    run.save(tmp_path / "shut.npz")
    q, v = consistent_start(scene.with_overrides({"initial": {"run": "shut.npz"}}))
    np.testing.assert_array_equal(q, run.position[-1])
    np.testing.assert_allclose(v, latch.velocity, atol=1e-13)
    assert abs(v[1]) < 1e-12
    # checkpoints lack the velocity after the impact; saved again, the run has it
    with np.load(tmp_path / "shut.npz") as archive:
        members = {name: archive[name] for name in archive.files if name != "latch_velocity"}
    np.savez(tmp_path / "old.npz", **members)
    with pytest.raises(InputError, match=r"old\.npz: the run ended with a latch, .*bc\.load_run\(FILE\)\.save\(FILE\)"):
        scene.with_overrides({"initial": {"run": "old.npz"}})
    bc.load_run(tmp_path / "old.npz").save(tmp_path / "old.npz")
    again = consistent_start(scene.with_overrides({"initial": {"run": "old.npz"}}))
    np.testing.assert_allclose(again[1], v, rtol=0, atol=1e-13)
    # the velocity that a file holds is checked
    for wrong in (np.zeros(5), np.full(2, np.nan)):
        np.savez(tmp_path / "wrong.npz", **members, latch_velocity=wrong)
        with pytest.raises(InputError, match=r"latch_velocity|not finite"):
            scene.with_overrides({"initial": {"run": "wrong.npz"}})
        with pytest.raises(InputError, match="latch_velocity"):
            bc.load_run(tmp_path / "wrong.npz")


@pytest.mark.parametrize(
    ("start", "words"),
    [
        ({"run": "none.npz"}, "there is no such file"),
        ({"run": "pushed.urdf"}, "not a run"),
        ({"run": "half.npz", "motion": "m"}, "expected 'run' or 'motion', found both"),
        ({"time": 0.2}, "name the run as run: FILE.npz"),
        ({"clock": "continue"}, "name the run as run: FILE.npz"),
        ({"run": "other.npz"}, "only the run has loose (floating); only the robot has loose_x (prismatic)"),
    ],
)
def test_a_run_that_cannot_be_gone_on_from_is_one_sentence(tmp_path, start, words):
    other = carrier(tmp_path, "floating")
    simulate(other, duration=0.01).save(tmp_path / "other.npz")
    scene = pushed(tmp_path)
    simulate(scene, duration=0.01).save(tmp_path / "half.npz")
    scene = scene.with_overrides({"motions.m": {"kind": "dwell", "duration": 1, "position": {"turn": 0}}})
    with pytest.raises(InputError) as refusal:
        scene.with_overrides({"initial": start})
    assert words in str(refusal.value) and "initial" in str(refusal.value)


@pytest.mark.tier2
def test_the_command_line_finds_a_run_where_one_stands(tmp_path, monkeypatch, capsys):
    scene = pushed(tmp_path)
    here = tmp_path / "here"
    here.mkdir()
    run = simulate(scene, duration=0.2)
    run.save(here / "mine.npz")
    monkeypatch.chdir(here)
    arguments = ["simulate", str(scene.source), "--set", "initial.run=mine.npz", "--set", "initial.clock=continue"]
    assert main([*arguments, "--out", "out"]) == 0
    run.save(tmp_path / "mine.npz")
    assert main([*arguments, "--out", "out"]) == 2
    assert "two files match" in capsys.readouterr().err


@pytest.mark.parametrize("axes", ["parent", "body"])
def test_a_planar_joint_held_in_part_moves_onto_a_rod_by_the_rest(tmp_path, axes):
    rod = "constraints: [{name: rod, kind: distance, frame_a: puck, frame_b: post, length: 0.6}]\n"
    rod += "frames: {post: {link: ground, xyz: [0.9, 0.1, 0.6]}}\n"
    given = f"position: [0.1, ~], angle: 0.8, linear_velocity: [0.5, ~], angular_velocity: 1, expressed_in: {axes}"
    scene = carrier(tmp_path, "planar", f"{rod}initial: {{turn: 0.2, loose: {{{given}}}, velocity: {{turn: 0}}}}")
    q, v = consistent_start(scene)
    found, turned = pose_of(scene, q)
    assert found[0] == pytest.approx(0.1, abs=1e-13) and q[0] == 0.2
    np.testing.assert_allclose(turned, Rotation.from_euler("z", 0.8).as_matrix(), atol=1e-13)
    speed, spin = rate_of(scene, q, v)
    held = (turned.T if axes == "body" else np.eye(3)) @ speed
    assert held[0] == pytest.approx(0.5, abs=1e-8) and spin[2] == pytest.approx(1, abs=1e-8)
    place = scene.robot.frame_pose("puck", q)[0] - [0.9, 0.1, 0.6]
    assert np.linalg.norm(place) == pytest.approx(0.6, abs=1e-12)
    assert place @ scene.robot.frame_velocity("puck", q, v)[0] == pytest.approx(0, abs=1e-12)


def test_runs_go_on_one_after_the_other_on_the_command_line(tmp_path, monkeypatch):
    scene = pushed(tmp_path)
    monkeypatch.chdir(tmp_path)
    common = ["simulate", "pushed.yaml", "--duration", "0.2", "--no-plots"]
    assert main([*common, "--out", "one"]) == 0
    more = ["--set", "initial.run=one/run.npz", "--set", "initial.clock=continue"]
    assert main([*common, *more, "--out", "two"]) == 0
    two, whole = bc.load_run(tmp_path / "two" / "run.npz"), simulate(scene, duration=0.4)
    np.testing.assert_allclose(two.position[-1], whole.position[-1], atol=1e-8)
