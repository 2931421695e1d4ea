"""Links of the posture on the page of a sizing are dragged in the view, with mouse and touch; their joints follow."""

import numpy as np
import pytest
import yaml

import bellcrank as bc
from bellcrank.replays.film.sizing_film import film_of_sizing
from tests.campaigns.live_pages import scara
from tests.replays.test_live_sizing import page_of

pytest_plugins = ("browser",)
SIZE = (900, 700)


def test_each_body_has_the_joint_that_carries_it():
    film = film_of_sizing(bc.size("ur5"))
    names, dragged = film.live.content["all_joints"], film.live.content["dragged"]
    joint = {body.name: names[k] if k >= 0 else None for body, k in zip(film.bodies, dragged, strict=True)}
    assert joint["base_link"] is None and joint["upper_arm_link"] == "shoulder_lift_joint"
    assert joint["forearm_link"] == "elbow_joint" and joint["wrist_3_link"] == "wrist_3_joint"


@pytest.fixture(scope="module")
def pages(open_page, tmp_path_factory):
    """A function that opens the page of a robot with its posture."""

    def opened(name, **options):
        folder = tmp_path_factory.mktemp("page")
        subject = scara(folder) if name == "scara" else name
        page = open_page(page_of(bc.size(subject), folder), size=SIZE, **options)
        page.tab.get_by_role("button", name="Move joints").click()
        page.do("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        return page, bc.size(subject).inputs.mechanism.robot

    return opened


def pixel_of(page, robot, q, link, place):
    """The pixel of the window of a point of a link."""
    origin, rotation = robot.frame_pose(link, np.array(q))
    x, y = page.do("b.project(x)", (origin + rotation @ np.array(place)).tolist())
    box = page.tab.locator("#pane").bounding_box()
    return np.array([box["x"] + x, box["y"] + y])


def drag(page, start, end, steps=8):
    mouse = page.tab.mouse
    mouse.move(*start)
    mouse.down()
    for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
        mouse.move(*(start + share * (end - start)))
    mouse.up()
    page.do("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def values_of(page):
    return page.do("b.live.rest([])")["values"]


ARM, FOREARM = [0.5, 0.0, 0.0], [0.5, 0.0, 0.0]  # m, in the links of the 2R arm


@pytest.mark.tier2
class TestMouse:
    @pytest.mark.parametrize(("link", "joint", "turn"), [("link_1", 0, 0.5), ("link_2", 1, -0.7)])
    def test_the_point_that_was_picked_follows_the_pointer(self, pages, link, joint, turn):
        page, robot = pages("planar_2r")
        q = values_of(page)
        goal = list(q)
        goal[joint] += turn
        start, end = (pixel_of(page, robot, each, link, ARM) for each in (q, goal))
        drag(page, start, end)
        found = values_of(page)
        # The point below the pointer is on the surface of the link, not on its middle line.
        assert found[joint] == pytest.approx(goal[joint], abs=0.06) and found[1 - joint] == q[1 - joint]
        torque = robot.inverse_dynamics(np.array(found), np.zeros(2), np.zeros(2))
        np.testing.assert_allclose(page.do("b.live.rest([])")["torques"], torque, rtol=1e-9)
        field = page.tab.get_by_label(f"posture: {robot.joint_names[joint]}", exact=True)
        assert float(field.input_value()) == found[joint]  # the slider has the same posture
        drag(page, end, start)
        np.testing.assert_allclose(values_of(page), q, atol=4e-3)  # half a pixel
        assert page.clean

    def test_a_drag_far_away_keeps_the_limits_of_the_joint(self, pages):
        page, robot = pages("scara")
        q = values_of(page)
        start = pixel_of(page, robot, q, "elbow link", [0.12, 0.0, 0.0])
        for end in ([5.0, 5.0], [SIZE[0] / 2, 5.0], [5.0, SIZE[1] / 2]):
            drag(page, start, np.array(end), 4)
            found = np.array(values_of(page))
            assert (
                np.isfinite(found).all()
                and (found >= robot.lower - 1e-12).all()
                and (found <= robot.upper + 1e-12).all()
            )
            start = pixel_of(page, robot, found, "elbow link", [0.12, 0.0, 0.0])
        assert page.clean

    def test_a_drag_of_empty_space_turns_the_camera_and_no_joint(self, pages):
        page, robot = pages("planar_2r")
        q, before = values_of(page), page.do("b.project([1, 0, 0])")
        box = page.tab.locator("#pane").bounding_box()
        corner = np.array([box["x"] + 15.0, box["y"] + box["height"] - 60.0])
        drag(page, corner, corner + np.array([80.0, -30.0]))
        assert values_of(page) == q
        assert np.linalg.norm(np.subtract(page.do("b.project([1, 0, 0])"), before)) > 5.0
        start = pixel_of(page, robot, q, "link_2", FOREARM)
        turned = page.do("b.project([1, 0, 0])")
        drag(page, start, start + np.array([30.0, 40.0]))
        assert values_of(page) != q and page.clean
        np.testing.assert_allclose(page.do("b.project([1, 0, 0])"), turned, atol=1e-6)

    def test_links_are_not_dragged_while_no_posture_is_shown(self, pages):
        page, robot = pages("planar_2r")
        q = values_of(page)
        page.tab.get_by_role("button", name="Move joints").click()
        start = pixel_of(page, robot, q, "link_2", FOREARM)
        drag(page, start, start + np.array([40.0, 40.0]))
        assert values_of(page) == q and page.clean


@pytest.mark.tier2
def test_a_finger_drags_a_link_and_a_second_one_does_not_disturb_it(pages):
    page, robot = pages("planar_2r", has_touch=True)
    q = values_of(page)
    goal = [q[0], q[1] + 0.5]
    start, end = (pixel_of(page, robot, each, "link_2", FOREARM) for each in (q, goal))
    client = page.tab.context.new_cdp_session(page.tab)

    def touch(kind, *points):
        where = [{"x": float(x), "y": float(y), "id": k} for k, (x, y) in enumerate(points)]
        client.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": where})

    camera = page.do("b.project([1, 0, 0])")
    touch("touchStart", start)
    for share in (0.3, 0.6):
        touch("touchMove", start + share * (end - start))
    touch("touchStart", start + 0.6 * (end - start), [40, 600])
    touch("touchMove", end, [60, 500])
    touch("touchEnd")
    page.do("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert values_of(page)[1] == pytest.approx(goal[1], abs=0.02) and values_of(page)[0] == q[0]
    assert page.do("b.project([1, 0, 0])") == camera and page.clean


@pytest.mark.tier2
def test_a_link_is_dragged_where_a_changed_length_puts_it(pages):
    page, _ = pages("balanced_arm")
    place = next(k for k, one in enumerate(page.do("b.live.settings")) if one["name"] == "upper_arm")
    assert page.do("b.live.set([[x, 1.3]])", place)
    long = bc.size("balanced_arm", overrides={"upper_arm": 1.3})
    names = [body.name for body in film_of_sizing(long, live=False).bodies]
    q = values_of(page)

    def elbow_and_far(values):
        page.do("b.live.rest(x)", [[k, value] for k, value in enumerate(values)])
        found = np.array(page.do("b.live.rest([])")["positions"]).reshape(-1, 3)
        return found[names.index("link_2")], found[names.index("link_2")] + 0.5 * direction(values)

    def direction(values):
        return np.array([np.cos(sum(values)), np.sin(sum(values)), 0.0])

    box = page.tab.locator("#pane").bounding_box()
    corner = np.array([box["x"], box["y"]])
    goal = [q[0], q[1] - 0.4]
    elbow, there = elbow_and_far(goal)
    assert np.linalg.norm(elbow) == pytest.approx(1.3, abs=1e-6)
    end = corner + page.do("b.project(x)", there.tolist())
    start = corner + page.do("b.project(x)", elbow_and_far(q)[1].tolist())
    page.do("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    drag(page, start, end)
    np.testing.assert_allclose(values_of(page), goal, atol=0.02)
    assert page.clean


@pytest.mark.tier2
def test_a_prismatic_joint_follows_the_pointer(pages, tmp_path):
    urdf = """<robot name="lift"><link name="world"/><link name="carriage"><inertial><mass value="2"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
      <visual><geometry><box size="0.3 0.3 0.3"/></geometry></visual></link>
      <joint name="rail" type="prismatic"><parent link="world"/><child link="carriage"/><axis xyz="0 0 1"/>
      <limit effort="500" velocity="9" lower="-1" upper="1"/></joint></robot>"""
    (tmp_path / "lift.urdf").write_text(urdf)
    waypoints = {"kind": "waypoints", "times": [0, 1], "positions": [{"rail": 0.0}, {"rail": 0.5}]}
    (tmp_path / "lift.yaml").write_text(
        yaml.safe_dump({"name": "lift", "urdf": "lift.urdf", "motions": {"up": waypoints}})
    )
    page, robot = pages(tmp_path / "lift.yaml")
    (q,) = values_of(page)
    start, end = (pixel_of(page, robot, [each], "carriage", [0.0, -0.15, 0.0]) for each in (q, q + 0.3))
    drag(page, start, end)
    assert values_of(page)[0] == pytest.approx(q + 0.3, abs=0.06)
    drag(page, end, start)
    assert values_of(page)[0] == pytest.approx(q, abs=4e-3)
    drag(page, start, end)
    drag(page, end, end - [0.0, 3000.0])
    assert -1.0 <= values_of(page)[0] <= 1.0 and page.clean
