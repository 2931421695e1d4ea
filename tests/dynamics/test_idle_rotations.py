"""Idle rotations: turns of links about the line through their connections, which need no motor; others are refused."""

import json

import numpy as np
import pytest
import yaml
from extended_robots import diagonal, joint, link

import bellcrank as bc
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.errors import BellcrankError, InputError

ROD = "".join(
    [
        '<robot name="rod"><link name="base"/>',
        link("crank", "0.15 0 0", 0.6, diagonal(0.001, 0.004, 0.004)),
        link("arm", "0 0.2 0", 0.8, diagonal(0.005, 0.001, 0.005)),
        link("rod", "0.25 0 0", 0.3, diagonal(0.0001, 0.006, 0.006)),
        joint("turn", "continuous", "base", "crank", '<axis xyz="0 0 1"/>'),
        joint("swing", "continuous", "base", "arm", '<axis xyz="1 0 0"/>', '<origin xyz="0.8 0 0.1"/>'),
        joint("ball", "KIND", "crank", "rod", origin='<origin xyz="0.3 0 0"/>'),
        "</robot>",
    ]
)
SCENE = {
    "name": "rod",
    "urdf": "rod.urdf",
    "frames": {"pin": {"link": "arm", "xyz": [0, 0.4, 0]}, "end": {"link": "rod", "xyz": [0.65, 0, 0]}},
    "constraints": [{"kind": "point", "frame_a": "end", "frame_b": "pin"}],
    "actuated": ["turn"],
    "motions": {
        "wave": {"kind": "waypoints", "times": [0, 1, 2], "positions": [{"turn": 0.2}, {"turn": 0.5}, {"turn": 0.2}]}
    },
}


def written(folder, kind, axes="", text=ROD, **keys):
    text = text.replace('type="KIND" ', f'type="{kind}" ').replace(
        '<child link="rod"/>', f'<child link="rod"/>{axes}'
    )  # fmt: skip
    (folder / "rod.urdf").write_text(text)
    (folder / "rod.yaml").write_text(yaml.safe_dump(SCENE | keys))
    return folder / "rod.yaml"


@pytest.mark.tier2
def test_a_rod_between_two_balls_turns_freely(tmp_path):
    """Sizing goes through, says so, and the torque is that with a universal joint, in which the rod cannot turn: it
    is slender, so that turning changes the torque by little.
    """
    path = written(tmp_path, "spherical")
    linkage = Linkage(bc.load_scene(path))
    (turn,) = linkage.idle_rotations
    assert turn.joints == ("ball",) and turn.links == ("rod",)
    np.testing.assert_allclose(turn.rates[linkage.robot.joint("ball").v :][:3], [1.0, 0.0, 0.0], atol=1e-12)
    motion = linkage.motion("wave")
    (note,) = [note for note in motion.notes if "idle" in note]
    assert "leaves 1 idle rotation, which no motor drives: link 'rod' (joint ball); they turn freely" in note
    states = (motion.time, motion.position, motion.velocity, motion.acceleration)
    free = linkage.torques(*states)[0][:, 0]
    assert linkage.residuals(*states) < (1e-12, 1e-12)
    sizing = bc.size(path)
    assert any("idle rotation" in text for text in sizing.warnings)
    assert sizing.joint("turn").sampled_torque == pytest.approx(np.abs(free).max(), rel=1e-9)
    held = Linkage(bc.load_scene(written(tmp_path, "universal", '<axis xyz="0 1 0"/><axis2 xyz="0 0 1"/>')))
    whole = held.motion("wave")
    torque = held.torques(whole.time, whole.position, whole.velocity, whole.acceleration)[0][:, 0]
    assert 0.0 < np.abs(torque - free).max() < 2e-3 * np.abs(torque).max()


def test_the_rod_accelerates_by_itself_so_that_no_torque_turns_it(tmp_path):
    """Torque, force at the pin and the rod's own acceleration α together solve S τ + Jᵀ λ − M n α = M a + h."""
    linkage = Linkage(bc.load_scene(written(tmp_path, "spherical")))
    motion, robot = linkage.motion("wave"), linkage.robot
    torque, force = linkage.torques(motion.time, motion.position, motion.velocity, motion.acceleration)
    turn, own = np.zeros((2, robot.nv))
    turn[robot.joint("turn").v] = own[robot.joint("ball").v] = 1.0  # the rod lies along its own x
    need = robot.inverse_dynamics(motion.position, motion.velocity, motion.acceleration)
    jacobians = linkage.kinematics.jacobian(motion.time, motion.position)
    for k in range(0, len(motion.time), len(motion.time) // 7):
        mass = robot.mass_matrix(motion.position[k])
        balance = np.column_stack([turn, jacobians[k].T, -mass @ own])
        (tau, *pin, _), *_ = np.linalg.lstsq(balance, need[k], rcond=None)
        np.testing.assert_allclose(torque[k], tau, rtol=1e-9)
        np.testing.assert_allclose(force[k], pin, rtol=1e-9)


def test_the_torque_is_the_power_of_the_motion(tmp_path):
    linkage = Linkage(bc.load_scene(written(tmp_path, "universal", '<axis xyz="0 1 0"/><axis2 xyz="0 0 1"/>')))
    motion = linkage.motion("wave")
    states = (motion.time, motion.position, motion.velocity, motion.acceleration)
    torque, _ = linkage.torques(*states)
    # power balance without gravity and friction losses: τ · ω is the rate of T + V
    kinetic, potential = linkage.robot.energy(motion.position, motion.velocity)
    rate = np.gradient(kinetic + potential, motion.time, edge_order=2)
    power = torque[:, 0] * motion.velocity[:, linkage.robot.joint("turn").v]
    inner = slice(3, -3)
    # central differences over the motion's rows
    assert np.abs(rate - power)[inner].max() <= 2e-3 * np.abs(power).max()


@pytest.mark.tier2
def test_a_rod_whose_weight_turns_it_is_refused(tmp_path):
    """A heavy lump beside the line through the balls: a pendulum, and how it swings matters to the motor."""
    lump = link("rod", "0.25 0.3 0", 3.0, diagonal(0.0001, 0.006, 0.006))
    text = ROD.replace(link("rod", "0.25 0 0", 0.3, diagonal(0.0001, 0.006, 0.006)), lump)
    with pytest.raises(
        InputError, match=r"1 idle rotation, .* link 'rod' \(joint ball\); held still, they change"
    ) as e:
        bc.size(written(tmp_path, "spherical", text=text))
    assert "give such a joint a motor" in str(e.value)


def test_a_link_with_one_connection_is_not_idle(tmp_path):
    """A pendulum on the crank is neither prescribed nor idle: the count of what is missing, and the remedy."""
    more = link("bob", "0 0 -0.1", 0.2) + joint("hang", "continuous", "crank", "bob", '<axis xyz="0 1 0"/>')
    path = written(tmp_path, "spherical", text=ROD.replace("</robot>", more + "</robot>"))
    message = (
        r"has 3 degrees of freedom and this motion prescribes 1 \(turn\); 1 more is an idle rotation, which needs no "
        r"motor: link 'rod' \(joint ball\); prescribe 1 more: write also the position of a joint"
    )
    with pytest.raises(InputError, match=message):
        bc.size(path)


def test_motors_that_leave_more_than_idle_rotations_are_refused(tmp_path):
    more = link("bob", "0 0 -0.1", 0.2) + joint("hang", "continuous", "crank", "bob", '<axis xyz="0 1 0"/>')
    path = written(tmp_path, "spherical", text=ROD.replace("</robot>", more + "</robot>"))
    linkage = Linkage(bc.load_scene(path))
    q = linkage.kinematics.start[None]
    zero = np.zeros((1, linkage.robot.nv))
    with pytest.raises(BellcrankError, match=r"cannot move the 3 degrees of freedom \(1 of them idle rotations"):
        linkage.torques(np.zeros(1), q, zero, zero)


def test_a_motor_on_the_axis_of_the_rod_is_not_idle(tmp_path):
    """The turn of a rod about its own axis by a motor is prescribed by the motion, or refused."""
    axes = '<axis xyz="0 1 0"/><axis2 xyz="0 0 1"/>'
    parts = ROD.replace('joint name="ball"', 'joint name="cardan"')
    half = link("half", "0 0 0", 0.1) + joint("spin", "continuous", "half", "rod", '<axis xyz="1 0 0"/>')
    parts = parts.replace('<child link="rod"/>', f'<child link="half"/>{axes}').replace("</robot>", half + "</robot>")
    keys = {"actuated": ["turn", "spin"]}
    path = written(tmp_path, "universal", text=parts, **keys)
    assert Linkage(bc.load_scene(path)).idle_rotations == ()
    with pytest.raises(InputError, match=r"has 2 degrees of freedom and this motion prescribes 1 \(turn\)"):
        bc.size(path)


@pytest.mark.tier2
def test_a_path_of_a_frame_leaves_idle_rotations_free(tmp_path):
    """The pin of the arm moves along z; the rod turns freely, as in the motion of the motor that it follows from."""
    lift = {"kind": "line", "frame": "pin", "coordinates": ["z"], "duration": 1.0, "end": [0, 0, 0.2], "samples": 61}
    path = written(tmp_path, "spherical", motions={"lift": lift})
    linkage = Linkage(bc.load_scene(path))
    motion, independent = linkage.along("lift")
    assert independent == ("turn",)
    height = linkage.robot.frame_pose("pin", motion.position)[0][:, 2]
    assert abs(height[0] - 0.2) > 0.01 and abs(height[-1] - 0.2) < 1e-9
    assert any("1 idle rotation" in note for note in motion.notes)
    assert bc.size(path).joint("turn").peak_torque > 0.0


@pytest.mark.tier2
def test_forces_in_the_rod_are_in_the_results(tmp_path):
    """The force at the rod's end is the constraint's multiplier; a table, sizing.csv and sizing.json hold it."""
    path = written(tmp_path, "spherical")
    sizing = bc.size(path)
    by_name = {load.name: load for load in sizing.structure}
    assert list(by_name) == ["point", "swing", "ball"] or set(by_name) == {"point_1", "swing", "ball"}
    (end,) = [load for load in sizing.structure if load.kind == "point constraint"]
    linkage, (motion,) = sizing.inputs.mechanism, sizing.inputs.motions
    _, multipliers = linkage.torques(motion.time, motion.position, motion.velocity, motion.acceleration)
    at_rows = np.linalg.norm(multipliers, axis=1).max()
    assert at_rows <= end.peak_force.value < 1.01 * at_rows
    ball = by_name["ball"]
    assert ball.kind == "spherical joint" and ball.peak_moment.value < 1e-9 * ball.peak_force.value  # a ball has none
    assert "In the structure" in str(sizing) and end.name in str(sizing)
    document = json.loads(sizing.to_json(tmp_path / "sizing.json").read_text())
    assert document["structure"][0]["peaks"]["force"]["value"] == end.peak_force.value
    lines = sizing.to_csv(tmp_path / "sizing.csv").read_text().splitlines()
    assert any(line.startswith(f"{end.name},") and ",point constraint," in line for line in lines)


def test_idle_rotations_are_found_whatever_else_moves():
    assert Linkage(bc.load_scene("five_bar")).idle_rotations == ()
