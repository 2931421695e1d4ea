"""What is read of MJCF elements, what is refused and what is listed as not used."""

import math

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.robot.formats.file_readers import read_robot_file
from bellcrank.robot.formats.robot_file import FileJointSpring, FileSphericalSpring, JointCoupling, JointMotor
from bellcrank.robot.formats.xml_tree import xml_text

BALL = '<geom type="sphere" size="0.1"/>'
CUBE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n" + "".join(
    f"f {face}\n" for face in ("1 4 3 2", "5 6 7 8", "1 2 6 5", "2 3 7 6", "3 4 8 7", "4 1 5 8")
)


@pytest.fixture
def read(tmp_path):
    """Reads the bodies of a file, and what stands beside them."""

    def reading(bodies, beside="", compiler=""):
        path = tmp_path / "robot.xml"
        path.write_text(
            f'<mujoco model="m"><compiler {compiler}/>{beside}<worldbody>{bodies}</worldbody></mujoco>',
            encoding="utf-8",
        )
        return read_robot_file(path)

    return reading


def loaded(file):
    return bc.load_robot(file.source)


def joint(attributes="", name="j"):
    return f'<body name="b"><joint name="{name}" {attributes}/>{BALL}</body>'


@pytest.mark.parametrize(
    ("bodies", "beside", "words"),
    [
        ('<body name="b" pos="1 2"/>', "", "line 1: <body name='b'>: pos: expected 3 numbers, found 2"),
        ('<body name="b" pos="1 2 x"/>', "", "expected a number, found 'x'"),
        ('<body name="b" pos="1 2 nan"/>', "", "expected a number, found 'nan'"),
        ('<body quat="1 0 0 0" euler="0 0 1"/>', "", "has quat and euler; an element has one orientation"),
        ('<body quat="0 0 0 0"/>', "", "quat: a vector has the length zero"),
        ('<body childclass="legs"/>', '<default><default class="leg"/></default>', "did you mean 'leg'"),
        (joint('class="arm"'), "", "unknown default class 'arm'"),
        (joint('type="hing"'), "", "did you mean 'hinge'"),
        (joint('axis="0 0 0"'), "", "axis: has the length zero"),
        (joint('range="1 -1"'), "", "range: expected a lower and a larger upper number"),
        (joint('damping="1 2 3 4"'), "", "damping: expected 1 to 3 numbers"),
        (joint('damping="-1"'), "", "damping: is -1, which would add energy"),
        (joint('frictionloss="-1"'), "", "frictionloss: is -1; expected 0 or more"),
        (f"<body><joint/><freejoint/>{BALL}</body>", "", "must be the only joint of a body in <worldbody>"),
        (f"<body><body><freejoint/>{BALL}</body></body>", "", "must be the only joint of a body in <worldbody>"),
        (f'<body><joint type="ball"/><joint/>{BALL}</body>', "", "ball joint followed by a rotation"),
        ("<joint/><body/>", "", "the world has no joints"),
        (joint() + joint(name="k"), "", "the name 'b' is used twice, also in line 1"),
        (joint() + joint().replace('"b"', '"c"'), "", "the name 'j' is used twice, also in line 1"),
        ('<body><geom type="spher" size="1"/></body>', "", "did you mean 'sphere'"),
        ('<body><geom type="box" size="1 1"/></body>', "", "a box needs 3 numbers"),
        ('<body><geom size="-1"/></body>', "", "size: expected lengths from"),
        ('<body><geom type="capsule" size="1" fromto="0 0 0 0 0 0"/></body>', "", "the two points coincide"),
        ('<body><geom type="ellipsoid" size="1 1 1" shellinertia="true"/></body>', "", "give its body an <inertial>"),
        ('<body><inertial mass="1"/></body>', "", "has no pos"),
        ('<body><inertial pos="0 0 0" mass="1"/><inertial pos="0 0 0" mass="1"/></body>', "", "second <inertial>"),
        ('<body><inertial pos="0 0 0" mass="-1"/></body>', "", "mass: is -1; expected 0 or more"),
        ("<light/>", "", "has no <body>"),
        ('<body/><composite type="cable"/>', "", "<composite> is not supported; load the file with MuJoCo and save it"),
        ('<replicate count="1e9"><body/></replicate>', "", "makes more than 20000 copies"),
        ('<replicate count="0"><body/></replicate>', "", "count: expected a whole number from 1 on"),
        (joint(), '<include file="nothing.xml"/>', "line 1: <include>: "),
        (joint(), '<include file="../../../etc/passwd"/>', "is not allowed"),
        (joint(), '<include file="robot.xml"/>', "is included already"),
        (joint(), '<equality><connect body1="b" body2="c" anchor="0 0 0"/></equality>', "unknown body 'c'"),
        (joint(), '<equality><connect body1="b"/></equality>', "has no anchor"),
        (joint(), '<equality><weld body1="b" body2="b"/></equality>', "constrains a body to itself"),
        (joint(), '<equality><weld site1="s" site2="t"/></equality>', "unknown site 's'"),
        (joint(), '<equality><joint joint1="j" joint2="j"/></equality>', "couples a joint to itself"),
        (joint('type="ball"'), '<equality><joint joint1="j"/></equality>', "is a ball joint; expected a hinge"),
        (joint(), '<actuator><motor joint="k"/></actuator>', "unknown joint 'k'"),
        (joint(), '<keyframe><key qpos="1 2"/></keyframe>', "qpos: expected 1 numbers, found 2"),
        (joint(), '<option gravity="0 0"/>', "gravity: expected 3 numbers"),
        (joint(), '<option><flag gravity="off"/></option>', "unknown gravity 'off'"),
        (joint(), '<default><default class="a"/><default class="a"/></default>', "class 'a' is defined twice"),
        (joint(), '<default><default/></default>', "has no class"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_refused_with_its_place(read, bodies, beside, words):
    with pytest.raises(bc.InputError) as caught:
        read(bodies, beside)
    assert words in str(caught.value)
    assert "robot.xml" in str(caught.value)


@pytest.mark.parametrize(
    ("compiler", "words"),
    [
        ('angle="grad"', "unknown angle 'grad'"),
        ('eulerseq="xy"', "eulerseq: expected three of the letters"),
        ('coordinate="global"', 'coordinate="global" is not supported'),
        ('autolimits="false"', "has range but not limited"),
    ],
)
def test_compiler_options_that_are_wrong(read, compiler, words):
    with pytest.raises(bc.InputError) as caught:
        read(joint('range="-1 1"'), compiler=compiler)
    assert words in str(caught.value)


def test_the_root_must_be_mujoco_and_the_file_must_have_a_world(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text("<mujoco/>")
    with pytest.raises(bc.InputError, match="has no <worldbody>"):
        read_robot_file(path)


@pytest.mark.parametrize(
    ("attributes", "limits"),
    [
        ('range="-90 45"', (-math.pi / 2, math.pi / 4)),
        ('range="-90 45" limited="true"', (-math.pi / 2, math.pi / 4)),
        ('range="-90 45" limited="false"', None),
        ('range="0 0"', None),
        ('type="slide" range="-0.5 0.5"', (-0.5, 0.5)),
    ],
)
def test_ranges_are_limits_of_joints(read, attributes, limits):
    found = loaded(read(joint(attributes))).urdf.joints["j"]
    expected = (None, None) if limits is None else pytest.approx(limits, rel=1e-15)
    assert (found.lower, found.upper) == expected


def test_springs_dampers_friction_and_armature(read):
    file = read(
        joint('stiffness="3" springref="90" damping="0.2" frictionloss="0.4" armature="0.05"'),
        '<actuator><motor name="m" joint="j" gear="-10" armature="0.001" damping="0.002" ctrlrange="-2 3"/></actuator>',
    )
    assert file.springs == (FileJointSpring(joint="j", stiffness=3.0, reference=math.pi / 2),)
    assert file.rotor_inertia == {"j": pytest.approx(0.05 + 100 * 0.001)}
    assert file.motors == (JointMotor(name="m", joint="j", gear=-10.0, effort=30.0),)
    found = loaded(file).urdf.joints["j"]
    assert (found.damping, found.friction, found.effort) == (pytest.approx(0.4), 0.4, 30.0)


@pytest.mark.parametrize(
    ("actuator", "effort"),
    [
        ('<motor joint="j" gear="2" ctrlrange="-1 5" forcerange="-4 3"/>', 8.0),
        ('<motor joint="j" gear="2" ctrlrange="-1 5" ctrllimited="false"/>', None),
        ('<general joint="j" gear="2" gainprm="3" ctrlrange="-1 1"/>', 6.0),
        ('<general joint="j" gear="2" gainprm="3" biastype="affine" ctrlrange="-1 1"/>', None),
        ('<position joint="j" kp="30" ctrlrange="-1 1" forcerange="-7 7"/>', 7.0),
        ('<velocity jointinparent="j" kv="3"/>', None),
    ],
)
def test_efforts_of_motors(read, actuator, effort):
    (motor,) = read(joint(), f"<actuator>{actuator}</actuator>").motors
    assert motor.effort == effort


def test_motors_at_a_joint_add_up_within_its_own_range(read):
    two = '<actuator><motor joint="j" forcerange="-3 3"/><motor joint="j" forcerange="-4 4"/></actuator>'
    assert loaded(read(joint(), two)).urdf.joints["j"].effort == 7.0
    assert loaded(read(joint('actuatorfrcrange="-5 5"'), two)).urdf.joints["j"].effort == 5.0
    one = '<actuator><motor joint="j" forcerange="-3 3"/><motor joint="j"/></actuator>'
    assert loaded(read(joint(), one)).urdf.joints["j"].effort is None


def test_flags_disable_what_they_name(read):
    flags = " ".join(f'{key}="disable"' for key in ("gravity", "spring", "damper", "frictionloss"))
    flags = f'<option gravity="1 2 3"><flag {flags}/></option>'
    file = read(joint('stiffness="3" damping="0.2" frictionloss="0.4"'), flags)
    assert (file.gravity, file.springs) == ((0.0, 0.0, 0.0), ())
    found = loaded(file).urdf.joints["j"]
    assert (found.damping, found.friction) == (None, None)
    held = '<equality><joint joint1="j"/></equality><option><flag equality="disable"/></option>'
    file = read(joint(), held)
    assert not file.loops
    assert any("disabled" in note for note in file.notes)


def test_a_coupling_is_multiplied_out_about_the_references(read):
    bodies = joint('ref="30"') + joint('ref="20"', "k").replace('"b"', '"c"')
    (found,) = read(bodies, '<equality><joint joint1="j" joint2="k" polycoef="0.1 2 3 4 5"/></equality>').loops
    assert isinstance(found, JointCoupling)
    for x in np.linspace(-2.0, 2.0, 9):
        step = x - math.radians(20)
        expected = math.radians(30) + 0.1 + 2 * step + 3 * step**2 + 4 * step**3 + 5 * step**4
        assert np.polynomial.Polynomial(found.coefficients)(x) == pytest.approx(expected, rel=1e-13)


def test_an_equality_of_fixed_tendons_is_a_linear_relation(read):
    bodies = joint('ref="30"') + joint('type="slide" ref="0.2"', "k").replace('"b"', '"c"')
    tendons = (
        '<tendon><fixed name="a"><joint joint="j" coef="2"/></fixed><fixed name="b"><joint joint="k" coef="3"/></fixed>'
    )
    equality = '</tendon><equality><tendon name="e" tendon1="a" tendon2="b" polycoef="0.1 0.5"/></equality>'
    (found,) = read(bodies, tendons + equality).loops
    assert found.terms == (("j", 2.0), ("k", -1.5))
    assert found.constant == pytest.approx(2 * math.radians(30) - 1.5 * 0.2 + 0.1)
    for polycoef in ("0 1 1", "0 0 0 0 1"):
        file = read(bodies, tendons + equality.replace("0.1 0.5", polycoef))
        assert not file.loops
        assert any("<tendon> under <equality> is not modelled" in note for note in file.notes)
    with pytest.raises(bc.InputError, match="unknown joint 'x'"):
        read(bodies, tendons.replace('joint="j"', 'joint="x"') + equality)


@pytest.mark.parametrize("kind", ["hinge", "ball"])
def test_a_springdamper_gives_the_time_constant_and_the_damping_ratio(read, kind):
    """Of a ball of 0.1 m that turns about its centre, with armature: I (θ'' + 2/T θ' + θ/(T ζ)²) = 0."""
    file = read(joint(f'type="{kind}" springdamper="0.5 0.8" stiffness="9" armature="0.03"'))
    inertia = 0.4 * (1000 * 4 / 3 * math.pi * 0.1**3) * 0.01 + 0.03
    (spring,) = file.springs
    assert spring.stiffness == pytest.approx(inertia / (0.5 * 0.8) ** 2, rel=1e-12)
    assert loaded(file).urdf.joints["j"].damping == pytest.approx(2 * inertia / 0.5, rel=1e-12)


def test_a_springdamper_needs_inertia(read):
    massless = '<body name="b"><joint name="j" springdamper="1 1"/></body>'
    with pytest.raises(bc.InputError, match="springdamper needs the inertia of all joints"):
        read(massless)


def test_a_ball_joint_has_a_spring(read):
    file = read(joint('type="ball" stiffness="2"'))
    assert file.springs == (FileSphericalSpring(joint="j", stiffness=2.0),)
    force = bc.load_scene(file.source).forces[0]
    assert (force.kind, force.stiffness, force.joint.name) == ("spherical_spring", 2.0, "j")


def test_the_start_is_the_keyframe_home_or_the_posture_of_the_file(read):
    bodies = f'<body name="f" pos="1 2 3" euler="0 0 90"><freejoint/>{BALL}</body>' + joint('ref="90"')
    assert read(bodies).start == {
        "f_free": pytest.approx((1.0, 2.0, 3.0, 0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))),
        "j": math.pi / 2,
    }
    keys = '<key qpos="0 0 0 1 0 0 0 1"/><key name="home" qpos="4 5 6 0 0 0 2 0.5" qvel="1 0 0 0 0 0 0"/>'
    file = read(bodies, f"<keyframe>{keys}</keyframe>")
    assert file.start == {"f_free": pytest.approx((4.0, 5.0, 6.0, 0.0, 0.0, 1.0, 0.0)), "j": 0.5}
    assert "line 1: the start is the keyframe 'home'." in file.notes
    assert any("qvel" in note for note in file.notes)


def test_names_are_given_where_there_are_none_and_copies_are_numbered(read):
    file = read(
        f'<body><joint/><joint type="slide"/>{BALL}<site name="world"/><site name="a"/></body>'
        f'<replicate count="11" sep="_" offset="1 0 0"><body name="r"><joint name="r"/>{BALL}</body></replicate>'
    )
    robot = loaded(file)
    assert {"world_child", "site world", "a", "r_00", "r_10"} <= set(robot.urdf.links)
    assert {"world_child_hinge", "world_child_slide", "r_00", "r_10"} <= set(robot.joint_names)
    assert robot.frame_pose("r_10", robot.neutral)[0] == pytest.approx([10.0, 0.0, 0.0])


def test_blanks_around_names_do_not_count(read):
    connect = '<equality><connect body1=" b" body2="c " anchor="0 0 0"/></equality>'
    file = read(joint().replace('"b"', '" b "') + joint(name="k").replace('"b"', '"c"'), connect)
    assert (file.loops[0].a.frame, file.loops[0].b.frame) == ("b", "c")
    assert {"b", "c"} <= set(loaded(file).urdf.links)


def test_included_files_count_as_if_written_in_place(read, tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "body.xml").write_text(f"<any>{joint('axis=' + chr(34) + '1 0 0' + chr(34))}</any>")
    (tmp_path / "parts" / "bad.xml").write_text("<any>\n<body name='x' pos='1'/></any>")
    assert loaded(read('<include file="parts/body.xml"/>')).urdf.joints["j"].axis == (1.0, 0.0, 0.0)
    with pytest.raises(bc.InputError, match=r"bad\.xml: line 2: <body name='x'>: pos"):
        read('<include file="parts/bad.xml"/>')


def test_the_mass_of_a_mesh_without_inertial(read, tmp_path):
    geom = '<body name="b"><joint name="j"/><geom type="mesh" mesh="cube" density="100" pos="1 0 0"/></body>'
    beside = '<asset><mesh file="cube.obj" scale="2 -1 1"/></asset>'
    with pytest.raises(bc.InputError, match=r"mesh 'cube' is in the file 'cube\.obj', which is missing"):
        read(geom, beside)
    (tmp_path / "cube.obj").write_text(CUBE)
    found = loaded(read(geom, beside)).urdf.links["b"].inertial
    assert found.mass == pytest.approx(200.0, rel=1e-12)
    assert found.xyz == pytest.approx((2.0, -0.5, 0.5), rel=1e-12)
    assert found.inertia == pytest.approx((200 / 6, 0.0, 0.0, 200 * 5 / 12, 0.0, 200 * 5 / 12), abs=1e-10)


@pytest.mark.parametrize("mode", ["legacy", "exact", "convex"])
def test_a_mesh_that_is_not_star_shaped(read, mode):
    """A U of three boxes: 7 units exactly, its hull 9. MuJoCo 4.0 finds 8.6175392 by default."""
    outline = [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]
    points = [(x, y, z) for z in (0, 1) for x, y in outline]
    faces = [f for a, b, c in [(0, 1, 4), (0, 4, 5), (1, 2, 4), (2, 3, 4), (0, 5, 7), (5, 6, 7)]
             for f in ((a, c, b), (a + 8, b + 8, c + 8))]  # fmt: skip
    faces += [f for i in range(8) for j in [(i + 1) % 8] for f in ((i, j, j + 8), (i, j + 8, i + 8))]
    text = {key: " ".join(str(n) for row in rows for n in row) for key, rows in (("vertex", points), ("face", faces))}
    asset = f'<asset><mesh name="u" vertex="{text["vertex"]}" face="{text["face"]}" inertia="{mode}"/></asset>'
    file = read('<body name="b"><joint name="j"/><geom type="mesh" mesh="u" density="1"/></body>', asset)
    expected = {"legacy": 8.6175392, "exact": 7.0, "convex": 9.0}[mode]
    assert loaded(file).urdf.links["b"].inertial.mass == pytest.approx(expected, rel=2e-7)


def test_total_mass(read):
    found = loaded(read(joint() + joint(name="k").replace('"b"', '"c"'), compiler='settotalmass="7"')).urdf.links
    assert found["b"].inertial.mass == found["c"].inertial.mass == pytest.approx(3.5)
    assert found["b"].inertial.inertia[0] == pytest.approx(0.4 * 3.5 * 0.01)


@pytest.mark.parametrize(
    ("bodies", "beside", "words"),
    [
        (joint(), "", "contacts are not modelled: 1 of 1 shapes may collide in MuJoCo."),
        (joint('stiffness="1 2"'), "", "only the first, linear coefficient is used (j)"),
        (joint('type="free" stiffness="2"'), "", "the stiffness of free joints is not used (j)"),
        (joint('type="ball" range="0 30"'), "", "the range of ball joints is not used (j)"),
        (joint('type="free" damping="1"'), "", "damping, friction and armature of free joints are not used (j)"),
        (joint('colour="red"'), "", "line 1: colour of <joint> is not used."),
        (joint(), '<option density="1.2"/>', "forces of a fluid are not modelled (density of <option>)."),
        (joint(), '<option timestep="0.1"/>', "MuJoCo's solver settings are not used (timestep)."),
        (joint(), "<option><flag contact='disable'/></option>", "flags of <option> are not used (contact)."),
        (joint().replace("<body ", '<body gravcomp="1" '), "", "gravcomp is not used"),
        (joint() + '<body name="m" mocap="true"/>', "", "mocap bodies stand still (m)."),
        (joint(), "<sensor><clock/></sensor><custom><text name='a'/></custom>", "not used: <custom>, <sensor>."),
        (joint() + "<light/>", "<sensor><clock/></sensor>", "not used: <sensor>, <light>."),
        (joint(), '<tendon><fixed><joint joint="j" coef="1"/></fixed></tendon>', "1 tendons are not modelled"),
        (joint(), '<equality><joint joint1="j" active="false"/></equality>', "is inactive and left out"),
        (joint(), '<equality><tendon tendon1="t"/></equality>', "<tendon> under <equality> is not modelled"),
        (joint(), '<equality><joint joint1="j"/></equality>', "MuJoCo's softness (solref, solimp) is not used"),
        (joint(), '<actuator><position name="p" joint="j"/></actuator>', "are motors without it (p)."),
        (joint(), '<actuator><motor name="p" tendon="t"/></actuator>', "are not modelled (p: tendon)."),
        (joint('type="ball"'), '<actuator><motor name="p" joint="j"/></actuator>', "are not modelled (p: ball joint)."),
        (joint(), '<asset><mesh file="a.obj"/></asset>', "mesh files are missing and not drawn: a.obj."),
        (joint(), '<future version="9"/>', "line 1: <future> is not known and not used."),
        (joint() + '<body><geom type="ellipsoid" size="1 1 1"/></body>', "", "are not drawn: ellipsoid."),
    ],
)  # fmt: skip
def test_what_is_not_modelled_is_listed(read, bodies, beside, words):
    notes = read(bodies, beside).notes
    assert any(words in note for note in notes), notes
    assert all(note.endswith(".") for note in notes)


def test_shapes_of_the_visible_groups_are_drawn(read, tmp_path):
    (tmp_path / "cube.obj").write_text(CUBE)
    file = read(
        '<body name="b"><joint name="j"/><geom type="box" size="1 2 3" rgba="1 0 0 1"/><geom size="1" group="3"/>'
        '<geom type="capsule" size="0.1 0.2" material="blue"/><geom type="mesh" mesh="cube" mass="1"/></body>',
        '<asset><mesh file="cube.obj" scale="2 1 1" refpos="1 0 0"/><material name="blue" rgba="0 0 1 1"/></asset>',
    )
    text = xml_text(file.urdf).replace("\n", "")
    assert '<box size="2.0 4.0 6.0"/></geometry><material name=""><color rgba="1 0 0 1"/>' in text
    assert '<capsule radius="0.1" length="0.4"/></geometry><material name=""><color rgba="0 0 1 1"/>' in text
    assert (
        '<origin xyz="-2.0 0.0 0.0" rpy="0.0 0.0 0.0"/><geometry><mesh filename="cube.obj" scale="2.0 1.0 1.0"/>'
        in text
    )
    assert "sphere" not in text


def test_a_springdamper_of_no_time_is_refused(read):
    with pytest.raises(bc.InputError, match=r"springdamper 0.2 2.8e-291 gives a stiffness above 1e\+100"):
        read(joint('type="hinge" springdamper="0.2 2.8e-291" armature="0.03"'))


def test_copies_with_too_many_joints_are_refused_before_they_are_made(tmp_path):
    path = tmp_path / "many.xml"
    body = '<replicate count="17548" offset="1 0 0"><body><joint/><geom size="0.1"/></body></replicate>'
    path.write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    with pytest.raises(bc.InputError, match="line 1: <body>: there are more than 2000 joints"):
        bc.load_robot(path)
