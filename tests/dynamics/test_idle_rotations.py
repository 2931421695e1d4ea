"""Rotations of spherical joints that no motor drives, and the message that names them."""

import numpy as np
import pytest
import yaml
from extended_robots import diagonal, joint, link

import bellcrank as bc
from bellcrank.dynamics.idle_rotations import idle_rotations
from bellcrank.errors import InputError

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


def written(folder, kind, axes=""):
    text = ROD.replace('type="KIND" ', f'type="{kind}" ').replace(
        '<child link="rod"/>', f'<child link="rod"/>{axes}'
    )  # fmt: skip
    (folder / "rod.urdf").write_text(text)
    (folder / "rod.yaml").write_text(yaml.safe_dump(SCENE))
    return folder / "rod.yaml"


def test_sizing_names_the_rotation_without_a_motor(tmp_path):
    message = (
        r"has 2 degrees of freedom and this motion prescribes 1 \(turn\); no motor drives 1 of them: joint 'ball' "
        r"about \(1, 0, 0\) of link 'rod' turns by itself; .* make the joint universal"
    )
    with pytest.raises(InputError, match=message):
        bc.size(written(tmp_path, "spherical"))


def test_the_remedy_of_the_message_works(tmp_path):
    path = written(tmp_path, "universal", '<axis xyz="0 1 0"/><axis2 xyz="0 0 1"/>')
    linkage = bc.Linkage(bc.load_scene(path))
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


def test_two_balls_of_a_welded_rod_turn_together(tmp_path):
    """A J that holds all but equal and opposite turns about one axis of two balls."""
    text = ROD.replace('type="KIND" ', 'type="spherical" ')
    more = link("tail", "0 0 0.1", 0.2) + joint("second", "spherical", "rod", "tail")
    path = tmp_path / "two.urdf"
    path.write_text(text.replace("</robot>", more + "</robot>"))
    robot = bc.load_robot(path)
    free = np.zeros(robot.nv)
    free[robot.joint("ball").v], free[robot.joint("second").v] = 1.0, -1.0
    jacobian = np.eye(robot.nv) - np.outer(free, free) / 2.0
    (sentence,) = idle_rotations(robot, jacobian)
    assert sentence == (
        "joint 'ball' about (1, 0, 0) of link 'rod' with joint 'second' about (-1, 0, 0) of link 'tail' turn by "
        "themselves"
    )
    assert idle_rotations(robot, np.eye(robot.nv)) == []
    assert idle_rotations(bc.load_robot("planar_2r"), np.zeros((0, 2))) == []
