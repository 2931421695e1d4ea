"""Files that say the same in two ways: SDFormat's placement_frame, MJCF's <replicate>, joints without names."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import bellcrank as bc

REPLICATE = json.loads((Path(__file__).parent / "mjcf" / "replicate.json").read_text())


def placements(robot, names):
    q = np.zeros(robot.nq)
    return np.array([np.concatenate([at, *turn.T[:2]]) for at, turn in (robot.frame_pose(name, q) for name in names)])


# ---- <replicate>


@pytest.mark.tier2
def test_copies_stand_where_mujoco_places_them(tmp_path):
    """100 random files; MuJoCo's figures are stored with 11 digits."""
    assert REPLICATE["source"].startswith("MuJoCo") and len(REPLICATE["cases"]) == 100
    for case in REPLICATE["cases"]:
        (tmp_path / "copies.xml").write_text(case["xml"])
        robot = bc.load_robot(tmp_path / "copies.xml")
        given = np.array(case["placements"])
        np.testing.assert_allclose(placements(robot, [f"b{k}" for k in range(len(given))]), given, atol=1e-9)


@pytest.mark.tier2
def test_copies_are_bodies_written_out_by_hand(tmp_path):
    """Copy k stands at Σ R(i θ) offset, i < k, turned by R(k θ): MuJoCo's XML reference, `replicate`."""
    rng = np.random.default_rng(7)
    for _ in range(100):
        count, euler, offset = int(rng.integers(2, 6)), rng.uniform(-80, 80, 3), rng.uniform(-1, 1, 3)
        bodies, at = "", np.zeros(3)
        for k in range(count):
            turn = Rotation.from_euler("XYZ", k * euler, degrees=True)
            place = (at + turn.apply([1.0, 0.0, 0.0])).tolist()
            x, y, z, w = turn.as_quat().tolist()
            bodies += (
                f'<body name="b{k}" pos="{place[0]!r} {place[1]!r} {place[2]!r}" quat="{w!r} {x!r} {y!r} {z!r}">'
                '<geom size="0.1"/></body>'
            )
            at = at + turn.apply(offset)
        numbers = [" ".join(map(repr, map(float, each))) for each in (offset, euler)]
        copies = (
            f'<replicate count="{count}" offset="{numbers[0]}" euler="{numbers[1]}"><body name="b" pos="1 0 0">'
            '<geom size="0.1"/></body></replicate>'
        )
        robots = []
        for name, inside in (("hand.xml", bodies), ("copies.xml", copies)):
            (tmp_path / name).write_text(f"<mujoco><worldbody>{inside}</worldbody></mujoco>")
            robots.append(bc.load_robot(tmp_path / name))
        names = [f"b{k}" for k in range(count)]
        np.testing.assert_allclose(placements(robots[1], names), placements(robots[0], names), atol=1e-9)


# ---- placement_frame


def pose(place):
    return f"{' '.join(f'{x:.17g}' for x in place[:3, 3])} " + " ".join(
        f"{x:.17g}" for x in Rotation.from_matrix(place[:3, :3]).as_quat()
    )


def random_place(rng):
    place = np.eye(4)
    place[:3, :3], place[:3, 3] = Rotation.random(random_state=rng).as_matrix(), rng.uniform(-1, 1, 3)
    return place


def arm(attributes, place, links, tail=""):
    """A nested model of three links; `links` are their poses in the model."""
    parts = [f'<model name="arm" {attributes}><pose rotation_format="quat_xyzw">{pose(place)}</pose>']
    parts += [f'<link name="l{k}"><pose rotation_format="quat_xyzw">{pose(one)}</pose></link>' for k, one in
              enumerate(links)]  # fmt: skip
    parts += [
        f'<joint name="j{k}" type="revolute"><parent>l{k - 1}</parent><child>l{k}</child><axis><xyz>0 1 0</xyz>'
        "</axis></joint>"
        for k in (1, 2)
    ]
    return "".join([*parts, tail, "</model>"])


@pytest.mark.tier2
@pytest.mark.parametrize("where", ["nested", "top"])
@pytest.mark.parametrize("kind", ["link", "frame", "frame on a joint"])
def test_a_model_placed_by_a_frame_in_it_is_the_model_placed_by_hand(where, kind, tmp_path):
    """The model stands at P T⁻¹, where P is its pose and T that of the frame in it: SDFormat 1.8, pose semantics."""
    rng = np.random.default_rng([len(where), len(kind)])
    for _ in range(17):
        place, links, extra = random_place(rng), [random_place(rng) for _ in range(3)], random_place(rng)
        base = {"link": np.eye(4), "frame": links[2], "frame on a joint": links[1]}[kind]
        onto = {"link": "", "frame": "l2", "frame on a joint": "j1"}[kind]
        name, inside = ("l2", links[2]) if kind == "link" else ("tip", base @ extra)
        tip = (
            f'<frame name="tip" attached_to="{onto}"><pose rotation_format="quat_xyzw">{pose(extra)}</pose></frame>'
            if onto
            else ""
        )
        models = {
            "placed.sdf": arm(f'placement_frame="{name}"', place, links, tip),
            "hand.sdf": arm("", place @ np.linalg.inv(inside), links, tip),
        }
        found = []
        for file, model in models.items():
            if where == "nested":
                model = (
                    f'<model name="cell"><link name="floor"/>{model}<joint name="bolt" type="fixed"><parent>floor'
                    "</parent><child>arm::l0</child></joint></model>"
                )
            else:
                model = model.replace("</model>", '<joint name="bolt" type="fixed"><parent>world</parent><child>l0'
                                      "</child></joint></model>")  # fmt: skip
            (tmp_path / file).write_text(f'<sdf version="1.9">{model}</sdf>')
            robot = bc.load_robot(tmp_path / file)
            prefix = "arm::" if where == "nested" else ""
            found.append(placements(robot, [name for k in range(3) if (name := f"{prefix}l{k}")]))
        np.testing.assert_allclose(found[0], found[1], atol=1e-9)


def test_models_placed_by_frames_of_each_other_in_a_circle_are_refused(tmp_path):
    (tmp_path / "circle.sdf").write_text(
        '<sdf version="1.9"><model name="m" placement_frame="f"><link name="a"/><frame name="f"><pose '
        'relative_to="g"/></frame><frame name="g"><pose relative_to="f"/></frame></model></sdf>'
    )
    with pytest.raises(bc.InputError, match="in a circle"):
        bc.load_robot(tmp_path / "circle.sdf")


# ---- Gepetto's types and motors, joints without names

LINK = (
    '<link name="{}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    "</link>"
)


def chain(*joints):
    """A URDF of links l0, l1, … and the joints between them."""
    links = "".join(LINK.format(f"l{k}") for k in range(len(joints) + 1))
    ends = ((joint, f'<parent link="l{k}"/><child link="l{k + 1}"/>') for k, joint in enumerate(joints))
    return f'<robot name="r">{links}{"".join(joint.replace("ENDS", end) for joint, end in ends)}</robot>'


HINGE = (
    '<joint name="{}" type="revolute">ENDS<axis xyz="0 1 0"/>'
    '<limit lower="-1" upper="1" effort="9" velocity="9"/>{}</joint>'
)


@pytest.mark.parametrize("pair", ["XY", "XZ", "YX", "YZ", "ZX", "ZY"])
def test_a_universal_joint_of_any_two_axes_is_two_hinges(pair, tmp_path):
    axes = {"X": "1 0 0", "Y": "0 1 0", "Z": "0 0 1"}
    (tmp_path / "u.urdf").write_text(chain(HINGE.format("u", "")))
    (tmp_path / "u.yaml").write_text(f"closed_loop: []\ntype: []\njoint_name: [u]\njoint_type: [UJOINT_{pair}]\n")
    two = [HINGE.format(f"u{k}", "").replace("0 1 0", axes[letter]) for k, letter in enumerate(pair)]
    (tmp_path / "two.urdf").write_text(chain(*two))
    one, other = bc.load_robot(tmp_path / "u.urdf"), bc.load_robot(tmp_path / "two.urdf")
    turned = placements_at(one, "l1", [0.3, -0.7]), placements_at(other, "l2", [0.3, -0.7])
    np.testing.assert_allclose(*turned, atol=1e-12)


def placements_at(robot, name, q):
    return robot.frame_pose(name, np.array(q))[1]


@pytest.mark.parametrize("kind", ["UJOINT_XX", "UJOINT_XW", "UJOINT"])
def test_a_universal_joint_without_two_axes_is_refused(kind, tmp_path):
    (tmp_path / "u.urdf").write_text(chain(HINGE.format("u", "")))
    (tmp_path / "u.yaml").write_text(f"closed_loop: []\ntype: []\njoint_name: [u]\njoint_type: [{kind}]\n")
    with pytest.raises(bc.InputError, match=f"joint_type of 'u'.*{kind}.*UJOINT_"):
        bc.load_robot(tmp_path / "u.urdf")


def test_motors_of_fixed_and_mimic_joints_are_notes(tmp_path):
    mimic = HINGE.format("follower", '<mimic joint="hip"/>')
    (tmp_path / "r.urdf").write_text(
        chain(HINGE.format("hip", ""), '<joint name="weld" type="fixed">ENDS</joint>', mimic)
    )
    (tmp_path / "r.yaml").write_text("closed_loop: []\ntype: []\nname_mot: [hip, weld, follower]\n")
    robot = bc.load_robot(tmp_path / "r.urdf")
    assert [motor.joint for motor in robot.file.motors] == ["hip"]
    said = " ".join(robot.notes)
    assert "name_mot: joint 'weld' is fixed" in said and "joint 'follower' follows joint 'hip' (mimic)" in said
    (tmp_path / "r.yaml").write_text("closed_loop: []\ntype: []\nname_mot: [hipp]\n")
    with pytest.raises(bc.InputError, match=r"name_mot.*'hipp'.*did you mean 'hip'"):
        bc.load_robot(tmp_path / "r.urdf")


def test_a_yaml_of_loops_beside_a_urdf_of_another_name_is_named(tmp_path):
    (tmp_path / "r.urdf").write_text(chain(HINGE.format("hip", ""), HINGE.format("knee", "")))
    (tmp_path / "legs.yaml").write_text("closed_loop: [[hip, knee]]\ntype: [3d]\n")
    [note] = bc.simulate(tmp_path / "r.urdf", duration=0.1).notes
    assert "legs.yaml beside it closes loops (closed_loop) and is not used" in note and "r.yaml" in note
    assert note.matter == "changes"
    scene = "urdf: r.urdf\nconstraints: [{kind: gepetto, file: legs.yaml}]\n"
    (tmp_path / "scene.yaml").write_text(scene)
    assert not [note for note in bc.load_scene(tmp_path / "scene.yaml").notes if "beside it" in note]
    (tmp_path / "legs.urdf").write_text(chain(HINGE.format("hip", "")))  # to which it belongs
    assert bc.load_robot(tmp_path / "r.urdf").notes == ()


def test_joints_without_a_name_are_named_after_their_links(tmp_path):
    bare = HINGE.format("", "").replace('name="" ', "")
    (tmp_path / "r.urdf").write_text(chain(HINGE.format("l2_joint", ""), bare))
    robot = bc.load_robot(tmp_path / "r.urdf")
    assert robot.joint_names == ("l2_joint", "l2_joint1")
    assert re.search(r"the joint of link 'l2' has no name; it is called 'l2_joint1'", " ".join(robot.notes))
    (tmp_path / "r.sdf").write_text(
        '<sdf version="1.9"><model name="m"><link name="a"/><link name="b"/><joint type="revolute"><parent>a</parent>'
        "<child>b</child><axis><xyz>0 1 0</xyz></axis></joint></model></sdf>"
    )
    robot = bc.load_robot(tmp_path / "r.sdf")
    assert robot.joint_names == ("b_joint",) and any("has no name; it is 'b_joint'" in note for note in robot.notes)
