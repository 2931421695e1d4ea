"""What other programs write into a URDF: read as the scene's own elements are, refused, or listed."""

import numpy as np
import pytest
import yaml

import bellcrank as bc

LINK = (
    '<link name="{name}"><inertial><origin xyz="0.2 0 0.05"/><mass value="{mass}"/>'
    '<inertia ixx="0.01" iyy="0.02" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = (
    '<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
    '<origin xyz="{x} 0 0"/><axis xyz="0 1 0"/><dynamics damping="0.1"/></joint>'
)


def urdf(extra="", edit=lambda text: text):
    """Two arms of two links each, side by side."""
    parts = ['<robot name="arms" xmlns:drake="d"><link name="base"/>']
    for side, x in (("a", 0.0), ("b", 0.7)):
        parts += [LINK.format(name=f"{side}1", mass=1.0), LINK.format(name=f"{side}2", mass=0.5)]
        parts.append(JOINT.format(name=f"j{side}1", parent="base", child=f"{side}1", x=x))
        parts.append(JOINT.format(name=f"j{side}2", parent=f"{side}1", child=f"{side}2", x=0.4))
    return edit("\n".join([*parts, extra, "</robot>"]))


def scene(folder, text, **keys):
    """A scene of this URDF."""
    (folder / "arms.urdf").write_text(text)
    start = {"ja1": 0.3, "ja2": {"guess": 0.9}, "jb1": {"guess": 2.6}, "jb2": {"guess": -0.8}}
    data = {"urdf": "arms.urdf", "initial": start, "simulate": {"duration": 0.4}} | keys
    (folder / "arms.yaml").write_text(yaml.safe_dump(data))
    return bc.load_scene(folder / "arms.yaml")


BALL = """<drake:ball_constraint>
  <drake:ball_constraint_body_A name="a2"/><drake:ball_constraint_body_B name="b2"/>
  <drake:ball_constraint_p_AP value="0.4 0 0"/><drake:ball_constraint_p_BQ value="0.35 0 0"/>
</drake:ball_constraint>"""
SPRING = """<drake:linear_spring_damper>
  <drake:linear_spring_damper_body_A name="a2"/><drake:linear_spring_damper_p_AP value="0.1 0.02 0"/>
  <drake:linear_spring_damper_body_B name="b1"/><drake:linear_spring_damper_p_BQ value="0.2 0 0.03"/>
  <drake:linear_spring_damper_free_length value="0.3"/><drake:linear_spring_damper_stiffness value="80"/>
  <drake:linear_spring_damper_damping value="1.5"/>
</drake:linear_spring_damper>"""
FRAMES = {
    "p": {"link": "a2", "xyz": [0.1, 0.02, 0.0]}, "q": {"link": "b1", "xyz": [0.2, 0.0, 0.03]},
    "tip": {"link": "a2", "xyz": [0.4, 0.0, 0.0]}, "end": {"link": "b2", "xyz": [0.35, 0.0, 0.0]},
}  # fmt: skip


BUSHING = """<frame name="q" link="b1" xyz="0.2 0 0.03" rpy="0 0.2 0"/>
<drake:linear_bushing_rpy>
  <drake:bushing_frameA name="a2"/><drake:bushing_frameC name="q"/>
  <drake:bushing_torque_stiffness value="12 9 7"/><drake:bushing_torque_damping value="0.4 0.3 0.2"/>
  <drake:bushing_force_stiffness value="120 90 70"/><drake:bushing_force_damping value="3 2 1"/>
</drake:linear_bushing_rpy>"""
CLOSING = """<gazebo><joint name="close" type="ball"><parent>b2</parent><child>a2</child><pose>0.4 0 0.1 0 0 0</pose>
</joint></gazebo>"""


def same_run(one, other):
    """Whether two scenes have the same run."""
    first, second = bc.simulate(one), bc.simulate(other)
    assert np.ptp(first.position, axis=0).max() > 0.1
    np.testing.assert_allclose(first.position, second.position, rtol=0, atol=1e-9)


def test_drakes_ball_constraint_is_a_point(tmp_path) -> None:
    loop = {"kind": "point", "name": "ball_constraint_1", "frame_a": "tip", "frame_b": "end"}
    same_run(scene(tmp_path, urdf(BALL)), scene(tmp_path, urdf(), frames=FRAMES, constraints=[loop]))


def test_drakes_linear_spring_damper_is_a_spring_between_points(tmp_path) -> None:
    spring = {"kind": "spring", "frame_a": "p", "frame_b": "q", "stiffness": 80, "damping": 1.5, "free_length": 0.3}
    same_run(scene(tmp_path, urdf(SPRING)), scene(tmp_path, urdf(), frames=FRAMES, forces=[spring]))


def test_gazebos_spring_stiffness_is_a_spring_at_the_joint(tmp_path) -> None:
    gazebo = (
        '<gazebo reference="ja2"><springStiffness>12</springStiffness><springReference>0.4</springReference></gazebo>'
    )
    spring = {"kind": "joint_spring", "joint": "ja2", "stiffness": 12.0, "rest": 0.4}
    same_run(scene(tmp_path, urdf(gazebo)), scene(tmp_path, urdf(), forces=[spring]))


def test_drakes_bushing_is_a_bushing_between_frames(tmp_path) -> None:
    """Its accelerations are those of Drake in test_drake.py."""
    bushing = {
        "kind": "bushing", "frame_a": "a2", "frame_b": "q", "torque_stiffness": [12, 9, 7],
        "torque_damping": [0.4, 0.3, 0.2], "force_stiffness": [120, 90, 70], "force_damping": [3, 2, 1],
    }  # fmt: skip
    turned = {"q": {"link": "b1", "xyz": [0.2, 0.0, 0.03], "rpy": [0.0, 0.2, 0.0]}}
    same_run(scene(tmp_path, urdf(BUSHING)), scene(tmp_path, urdf(), frames=turned, forces=[bushing]))


def test_a_bushings_power_is_the_work_and_its_loads_balance(tmp_path) -> None:
    """T + V − W is constant, and the forces on its frames are opposite, their moments about one point too."""
    run = bc.simulate(scene(tmp_path, urdf(BUSHING)))
    assert run.energy_drift() < 1e-7 and np.ptp(run.work) > 0.1
    assert run.equation_residual() < 1e-9


def test_gazebos_ball_joint_closes_a_loop_where_the_links_are_at_zero(tmp_path) -> None:
    """At zero the point (0.4, 0, 0.1) of a2 is at x = 0.8; b2 begins at 0.7 + 0.4, so that it is at −0.3 there."""
    loop = {"kind": "point", "name": "close", "frame_a": "end_a", "frame_b": "end_b"}
    ends = {"end_a": {"link": "a2", "xyz": [0.4, 0.0, 0.1]}, "end_b": {"link": "b2", "xyz": [-0.3, 0.0, 0.1]}}
    start = {"ja1": 0.1, "ja2": {"guess": -0.2}, "jb1": {"guess": 0.1}, "jb2": {"guess": 0.1}}
    one = scene(tmp_path, urdf(CLOSING), initial=start)
    same_run(one, scene(tmp_path, urdf(), frames=ends, constraints=[loop], initial=start))


def _turn(angle, point=(0.2, 0.05)):
    """A point (x, z) of a link that is turned by an angle about y, and its first derivative by the angle."""
    (x, z), c, s = point, np.cos(angle), np.sin(angle)
    return np.array([x * c + z * s, -x * s + z * c]), np.array([-x * s + z * c, -x * c - z * s])


class Arms:
    """The two planar arms by hand: d'Alembert's principle, Σ ∂x/∂q · m (x'' + g) + Σ I_y ω' = Q − 0.1 q'.

    Source: T. R. Kane and D. A. Levinson, Dynamics (1985), ch. 6, with x'' = Σ (∂x/∂θ θ'' − (x − its centre) θ'²).
    """

    def __init__(self, q, v):
        self.q, self.v = q, v
        self.mass, self.force = np.zeros((4, 4)), -0.1 * v
        for k in (0, 2):
            for mass, angles in ((1.0, 1), (0.5, 2)):
                jacobian, bias = self.point(k, angles, (0.2, 0.05))[1:]
                self.mass += mass * jacobian.T @ jacobian
                self.force -= mass * jacobian.T @ (bias + np.array([0.0, 9.81]))
                turns = np.zeros(4)
                turns[k : k + angles] = 1.0
                self.mass += 0.02 * np.outer(turns, turns)

    def point(self, k, angles, place):
        """Of the arm whose joints start at k: a point of its first or second link, its ∂/∂q, and x'' at q'' = 0."""
        points = [place] if angles == 1 else [(0.4, 0.0), place]
        x, jacobian, bias = np.array([0.35 * k, 0.0]), np.zeros((2, 4)), np.zeros(2)
        for j, at in enumerate(points):
            angle, speed = self.q[k : k + j + 1].sum(), self.v[k : k + j + 1].sum()
            arm, slope = _turn(angle, at)
            x, bias = x + arm, bias - arm * speed**2
            jacobian[:, k : k + j + 1] += slope[:, None]
        return x, jacobian, bias


def starts(scene, count, **guess):
    """The first rows of runs from random states."""
    rng = np.random.default_rng(5)
    names = [joint.name for joint in scene.robot.joints]
    for _ in range(count):
        q, v = rng.uniform(-0.4, 0.4, size=(2, 4))
        free = 1 if guess else 4
        initial = dict(zip(names[:free], q[:free].tolist(), strict=True)) | guess
        initial["velocity"] = dict(zip(names[:free], v[:free].tolist(), strict=True))
        yield bc.simulate(scene, overrides={"initial": initial})


def test_accelerations_with_gazebos_spring_are_those_of_equations_by_hand(tmp_path) -> None:
    gazebo = (
        '<gazebo reference="ja2"><springStiffness>12</springStiffness><springReference>0.4</springReference></gazebo>'
    )
    short = {"duration": 1e-6, "samples": 2}
    for run in starts(scene(tmp_path, urdf(gazebo), simulate=short), 100):
        arms = Arms(run.position[0], run.velocity[0])
        arms.force[1] -= 12.0 * (arms.q[1] - 0.4)
        a = np.linalg.solve(arms.mass, arms.force)
        np.testing.assert_allclose(run.acceleration[0], a, rtol=0.0, atol=1e-9 * np.abs(a).max())


def test_accelerations_with_gazebos_ball_joint_are_those_of_equations_by_hand(tmp_path) -> None:
    """M a = f + Jᵀ λ with J a = −J' v, at states that satisfy the closed loop."""
    guess = {"ja2": {"guess": -0.2}, "jb1": {"guess": 0.1}, "jb2": {"guess": 0.1}}
    one = scene(tmp_path, urdf(CLOSING), initial={"ja1": 0.1} | guess, simulate={"duration": 1e-6, "samples": 2})
    for run in starts(one, 100, **guess):
        arms = Arms(run.position[0], run.velocity[0])
        ends = [arms.point(0, 2, (0.4, 0.1)), arms.point(2, 2, (-0.3, 0.1))]
        gap, jacobian, bias = (b - a for a, b in zip(*ends, strict=True))
        np.testing.assert_allclose(gap, 0.0, atol=1e-9)
        np.testing.assert_allclose(jacobian @ arms.v, 0.0, atol=1e-9)
        matrix = np.block([[arms.mass, jacobian.T], [jacobian, np.zeros((2, 2))]])
        a = np.linalg.solve(matrix, [*arms.force, *-bias])[:4]
        np.testing.assert_allclose(run.acceleration[0], a, rtol=0.0, atol=1e-9 * np.abs(a).max())


def test_drakes_rotor_inertia_counts_with_the_square_of_the_gear_ratio(tmp_path) -> None:
    drive = (
        '<transmission type="SimpleTransmission"><joint name="ja1"/><actuator name="m">'
        '<drake:rotor_inertia value="2e-5"/><drake:gear_ratio value="50"/></actuator></transmission>'
    )
    found = scene(tmp_path, urdf(drive))
    assert found.robot.rotor_inertia == pytest.approx([2e-5 * 2500, 0.0, 0.0, 0.0])
    same_run(found, scene(tmp_path, urdf(), rotor_inertia={"ja1": 0.05}))


@pytest.mark.parametrize(
    ("element", "words"),
    [
        (BUSHING.replace('"a2"', '"a3"'), "unknown frame 'a3'"),
        (BUSHING.replace('<drake:bushing_frameC name="q"/>', ""), "has no <drake:bushing_frameC>"),
        (BUSHING.replace("12 9 7", "12 -9 7"), "expected numbers of 0 or more, found -9"),
        (BUSHING.replace('link="b1"', 'link="b9"'), "unknown link 'b9'"),
        (CLOSING.replace("<parent>b2", "<parent>b9"), "joint 'close', <parent>: unknown link 'b9'"),
        (CLOSING.replace("<pose>", '<pose relative_to="b2">'), "expected a pose in the child link 'a2', found 'b2'"),
        ("<drake:tendon_constraint/>", "couples joints by a tendon"),
        ('<drake:joint name="x" type="ball"/>', "adds a joint"),
        ("<drake:spline_thing/>", "<drake:spline_thing> is not known"),
        ('<constraint name="c"/>', "<constraint> closes a loop"),
        ("<loop_joints/>", "<loop_joints> closes a loop"),
        (CLOSING.replace("ball", "revolute"), "<gazebo> closes a loop with <joint name=\"close\">, type 'revolute'"),
        (BALL.replace('"a2"', '"a3"'), "unknown link 'a3'"),
        (BALL.replace('<drake:ball_constraint_p_AP value="0.4 0 0"/>', ""), "has no <drake:ball_constraint_p_AP>"),
        (BALL.replace("0.4 0 0", "0.4 0"), "ball_constraint_p_AP"),
        (SPRING.replace('"80"', '"-80"'), "expected a number above 0, found -80"),
        (SPRING.replace('value="0.3"', 'value="0"'), "expected a number above 0, found 0"),
        ('<gazebo reference="no"><springStiffness>1</springStiffness></gazebo>', "unknown joint 'no'"),
        ('<gazebo reference="ja1"><springStiffness>x</springStiffness></gazebo>', "expected a number, found 'x'"),
    ],
)  # fmt: skip
def test_what_closes_a_loop_or_adds_a_force_is_read_or_refused_with_its_line(tmp_path, element, words) -> None:
    with pytest.raises(bc.InputError, match=r"line \d+") as caught:
        scene(tmp_path, urdf(element))
    assert words in str(caught.value) and "arms.urdf" in str(caught.value)


@pytest.mark.parametrize(
    ("written", "instead", "words"),
    [
        ("damping=", "dampning=", "'dampning' of <dynamics> is not known and not used; was 'damping' meant?"),
        ('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"/><mimic joint="jb1" multipler="2"/>', "was 'multiplier' meant?"),
        ('type="continuous"', 'type="continuous" damping="3"', "was 'damping' of <dynamics> meant?"),
        ("<dynamics", "<dynamcs", "<dynamcs> in <joint> is not known and not used; was <dynamics> meant?"),
        ("<mass value", '<mass units="kg" value', "the attribute 'units' of <mass> (4 times, first in line 2)"),
        ('<link name="base"/>', '<link name="base"><contact/></link>', "<contact> in <link> (once, in line 1)"),
        ('<link name="base"/>', '<link name="base"/><self_collide/>', "<self_collide> in <robot>"),
        ("<inertial>", '<inertial frame="x">', "'frame'"),
        ("<parent link", '<parent lnk="q" link', "was 'link' meant?"),
        ("<mass value", '<mass valu="3" value', "'valu' of <mass> is not known and not used; was 'value' meant?"),
        ("<inertia ixx", '<inertia ixz0="0" ixx', "was 'ixz' meant?"),
        ("<axis xyz", '<axis xyzz="1 0 0" xyz', "'xyzz' of <axis> is not known and not used; was 'xyz' meant?"),
        ("<origin xyz", '<origin rpyy="1 0 0" xyz', "was 'rpy' meant?"),
        ("<child link", '<child links="q" link', "was 'link' meant?"),
        ('type="continuous"', 'type="continuous" effort="3"', "was 'effort' of <limit> meant?"),
        ('type="continuous"', 'type="continuous" multiplier="3"', "was 'multiplier' of <mimic> meant?"),
        ('type="continuous"', 'type="continuous" friction="3"', "was 'friction' of <dynamics> meant?"),
        ('type="continuous"', 'type="continuous" ixx="3"', "was 'ixx' of <inertia> meant?"),
        ('type="continuous"', 'type="continuous" pich="3"', "was 'pitch' meant?"),
        ('type="continuous"', 'type="continuous" kind="3"', "the attribute 'kind' of <joint>"),
        ("<dynamics", '<dynamics stiction="2"', "the attribute 'stiction' of <dynamics>"),
        ("<dynamics", '<dynamics fricton="2"', "was 'friction' meant?"),
        ("<dynamics", '<limit uper="2"/><dynamics', "was 'upper' meant?"),
        ("<dynamics", '<limit velocty="2"/><dynamics', "was 'velocity' meant?"),
        ("<dynamics", '<limit acceleration="2"/><dynamics', "the attribute 'acceleration' of <limit>"),
        ("<dynamics", '<limits lower="2"/><dynamics', "<limits> in <joint> is not known and not used; was <limit>"),
        ("<dynamics", "<mimick/><dynamics", "was <mimic> meant?"),
        ("<dynamics", "<stiffness/><dynamics", "<stiffness> in <joint>"),
        ("<dynamics", "<spring/><dynamics", "<spring> in <joint>"),
        ("<dynamics", "<hardwareInterface/><dynamics", "<hardwareInterface> in <joint>"),
        ("<dynamics", "<safety_controler/><dynamics", "was <safety_controller> meant?"),
        ('<link name="base"/>', '<link name="base"><visuals/></link>', "was <visual> meant?"),
        ('<link name="base"/>', '<link name="base"><colision/></link>', "was <collision> meant?"),
        ('<link name="base"/>', '<link name="base"><inertia/></link>', "was <inertial> meant?"),
        ('<link name="base"/>', '<link name="base"><mass/></link>', "<mass> in <link>"),
        ('<link name="base"/>', '<link name="base" mas="1"/>', "the attribute 'mas' of <link>"),
        ('<link name="base"/>', '<link name="base"/><links/>', "was <link> meant?"),
        ('<link name="base"/>', '<link name="base"/><jiont/>', "was <joint> meant?"),
        ('<link name="base"/>', '<link name="base"/><transmision/>', "was <transmission> meant?"),
        ('<link name="base"/>', '<link name="base"/><gravity/>', "<gravity> in <robot>"),
        ('<link name="base"/>', '<link name="base"/><disable_collisions/>', "<disable_collisions> in <robot>"),
        ('rpy="0 0 0"', "", ""),
    ],
)  # fmt: skip
def test_what_is_not_known_is_listed_with_its_line(tmp_path, written, instead, words) -> None:
    text = urdf(edit=lambda text: text.replace(written, instead, 4 if "mass" in written else 1))
    (tmp_path / "arms.urdf").write_text(text)
    notes = "\n".join(bc.load_robot(tmp_path / "arms.urdf").file.notes)
    assert words in notes and bool(words) == bool(notes)


def test_a_plain_file_of_the_field_has_nothing_to_list() -> None:
    for name in ("ur5", "talos", "tiago", "planar_2r"):
        assert bc.load_robot(name).file.notes == ()
