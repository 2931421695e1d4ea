"""The replay page in a real browser: what is seen is what the film says, by pixels, and nothing gets in or out."""

import base64
import dataclasses
import hashlib
import io
import json
import re
import zlib

import numpy as np
import pytest
from PIL import Image, ImageDraw
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from bellcrank.errors import InputError
from bellcrank.replays.film.arrows import arrow_scales
from bellcrank.replays.film.film import (
    Arrow,
    BodyLayer,
    Camera,
    Chart,
    Film,
    FilmAxis,
    FilmLine,
    FilmSpring,
    Ground,
    Rod,
    TimelineEvent,
    Trace,
    XYPlot,
)
from bellcrank.replays.geometry.shapes import DrawnBody, DrawnShape, Mesh
from bellcrank.replays.page.page import ASSETS, page_html, write_page

pytestmark = pytest.mark.tier2

pytest_plugins = ("browser",)

BLUE, GREEN, RED = (0.1, 0.3, 0.8, 1.0), (0.1, 0.6, 0.3, 1.0), (0.9, 0.1, 0.1, 1.0)
UPPER, FORE, BALL = 0.5, 0.4, 0.03
BOX = np.array([0.4, 0.07, 0.09])  # of the forearm, whose middle is half its length along x
HOSTILE = (
    '<!-- <script {{arrays}} </script><script>window.hacked = 1</script><img src=x onerror="window.hacked = 2">'
    "'\"&\u2028 ж \ud800"
)
EMPTY = {"springs": (), "arrows": (), "axes": (), "traces": (), "ground": None}


def angles(t):
    return 1.2 * np.sin(0.9 * t) - 0.5, 1.6 * np.sin(1.7 * t + 0.4)


def kinematics(t):
    """Places of upper arm, forearm and ball in the world, and how far they are rotate about -y."""
    q1, q2 = angles(np.asarray(t, dtype=float))
    along = lambda q: np.stack([np.cos(q), 0 * q, np.sin(q)], axis=-1)  # noqa: E731
    shoulder = np.broadcast_to([0.0, 0.0, 0.7], (*np.shape(q1), 3))
    elbow = shoulder + UPPER * along(q1)
    ball = elbow + (FORE + BALL) * along(q1 + q2)
    return np.stack([shoulder, elbow, ball], axis=-2), np.stack([q1, q1 + q2, 0 * q1], axis=-1)


def arm(n=601, end=10.0, **changes):
    """A film of two boxes and a ball, with something of everything."""
    t = np.linspace(0.0, end, n)
    places, rotate = kinematics(t)
    poses = np.concatenate([places, np.zeros((n, 3, 4))], axis=2)
    for k in range(3):
        poses[:, k, 3:] = Rotation.from_rotvec(np.outer(rotate[:, k], [0, -1, 0])).as_quat()
    q1, q2 = angles(t)
    force = np.stack([30 * np.sin(t), 0 * t, 20 + 0 * t], axis=1)
    fields = {
        "title": "Arm of two boxes",
        "time": t,
        "poses": poses,
        "bodies": (
            DrawnBody(
                "upper", (DrawnShape(kind="box", size=(0.5, 0.08, 0.1), colour=BLUE, pose=(0.25, 0, 0, 0, 0, 0, 1)),)
            ),
            DrawnBody("fore", (DrawnShape(kind="box", size=tuple(BOX), colour=GREEN, pose=(0.2, 0, 0, 0, 0, 0, 1)),)),
            DrawnBody("ball", (DrawnShape(kind="sphere", size=(BALL,), colour=RED),)),
        ),
        "camera": Camera((0.4, -2.6, 1.2), (0.0, 0.0, 0.6), (0, 0, 1)),
        "error_bound": 1e-4,
        "ground": Ground((0, 0, 1), 0.0),
        "traces": (Trace("path of the ball", t, places[:, 2]),),
        "arrows": (
            Arrow(name="contact", unit="N", points=places[:, 2], vectors=force),
            Arrow(name="motor", unit="N m", points=places[:, 1], vectors=0.1 * force, is_torque=True),
        ),
        "springs": (FilmSpring("spring", np.stack([0 * places[:, 0] + [-0.6, 0, 1.2], places[:, 1]], axis=1)),),
        "axes": (
            FilmAxis(name="shoulder", body=0, point=(0, 0, 0), direction=(0, 1, 0), torsion_spring=True),
            FilmAxis(name="elbow", body=1, point=(0, 0, 0), direction=(0, 1, 0)),
        ),
        "events": (TimelineEvent(2.5, "lock engages"), TimelineEvent(7.0, "contact lost")),
        "charts": (
            Chart(title="position", unit="rad", time=t, lines=(FilmLine("shoulder", q1), FilmLine("elbow", q2))),
            Chart(
                title="residual",
                unit="m",
                time=t,
                lines=(FilmLine("loop", np.abs(1e-12 * np.sin(9 * t))),),
                logarithmic=True,
            ),
        ),
        "xy_plots": (
            XYPlot(
                title="motor",
                x_label="speed [rad/s]",
                y_label="torque [N m]",
                time=t,
                x=np.cos(t),
                y=q1,
                limits=(("peak", np.eye(3, 2)),),
            ),
        ),
        "facts": (("solver", "DOP853"),),
        "notes": ("A note.",),
    }
    return Film(**{**fields, **changes})


def seen_at(camera, points, size):
    """Pixels (k, 2) of points (k, 3): a pinhole camera, 40 degrees high, or as wide as 4:3 where it is narrower."""
    eye, target, up = (np.array(each, dtype=float) for each in (camera.position, camera.target, camera.up))
    ahead = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(ahead, up)
    right /= np.linalg.norm(right)
    off = np.asarray(points) - eye
    depth = off @ ahead
    scale = 0.5 * size[1] / np.tan(np.deg2rad(20.0)) / max(4 / 3 / (size[0] / size[1]), 1.0)
    return np.stack(
        [size[0] / 2 + scale * (off @ right) / depth, size[1] / 2 - scale * (off @ np.cross(right, ahead)) / depth], -1
    )  # fmt: skip


def corners_at(t):
    """The forearm's corners (8, 3) in the world at time t."""
    places, rotate = kinematics(t)
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T
    return places[1] + Rotation.from_rotvec([0, -rotate[1], 0]).apply([FORE / 2, 0, 0] + 0.5 * BOX * signs)


def picture(opened, t):
    """The view at time t, (height, width, 3)."""
    url = opened.do("(b.seek(x), b.capture())", float(t))
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(url.split(",")[1]))).convert("RGB")).astype(int)


def pixels_of(opened, body, t):
    """Which pixels (height, width) a body covers at time t: those that change when it is hidden."""
    there = picture(opened, t)
    opened.do("b.showBody(x, false)", body)
    hidden = picture(opened, t)
    opened.do("b.showBody(x, true)", body)
    return np.abs(there - hidden).sum(axis=2) > 24


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("pages")


@pytest.fixture(scope="module")
def arm_page(open_page, folder):
    """The arm in a window of a desktop."""
    return open_page(write_page(arm(), folder / "arm.html"), size=(1280, 800))


@pytest.fixture
def player(arm_page):
    """The arm at its start, at rest."""
    arm_page.do("(b.pause(), b.speed = 1, b.loop = false, b.seek(b.start))")
    yield arm_page
    assert arm_page.clean


@pytest.fixture(scope="module")
def boxes(open_page, folder):
    """The bodies alone, in a view of 640 by 480."""
    return open_page(write_page(arm(**EMPTY), folder / "boxes.html", plots=False), "#still=1")


# ---- what is seen


@pytest.mark.tier2
def test_a_rod_is_drawn_between_its_ends_and_moves_with_them(open_page, folder):
    places = kinematics(arm().time)[0]
    ends = np.stack([0 * places[:, 0] + [-0.6, 0.0, 0.2], places[:, 2]], axis=1)
    with_rod = open_page(
        write_page(arm(**{**EMPTY, "rods": (Rod("coupler", ends),)}), folder / "rod.html", plots=False), "#still=1"
    )
    without = open_page(write_page(arm(**EMPTY), folder / "no_rod.html", plots=False), "#still=1")
    for t in (0.7, 8.9):
        changed = np.abs(picture(with_rod, t) - picture(without, t)).sum(axis=2) > 24
        way = np.linspace(ends[0, 0], kinematics(t)[0][2], 50)[1:40]
        seen = np.rint(seen_at(boxes_camera(), way, (640, 480))).astype(int)
        assert np.mean([grown(changed, 1)[y, x] for x, y in seen]) > 0.9  # bodies hide what is behind them
        outline = np.zeros_like(changed)
        for x, y in np.rint(
            seen_at(boxes_camera(), np.linspace(ends[0, 0], kinematics(t)[0][2], 2000), (640, 480))
        ).astype(int):
            outline[y, x] = True
        assert not (changed & ~grown(outline, 6)).any()


@pytest.mark.tier2
def test_a_page_opens_from_its_file_with_no_request_and_no_error_and_is_small(player, folder):
    assert player.tab.title() == "Arm of two boxes"
    assert player.do("[b.start, b.end, b.duration, b.frames, b.time]") == [0, 10, 10, 601, 0]
    assert player.do("b.firstFrame") > 0
    assert (folder / "arm.html").stat().st_size < 500_000


@pytest.mark.tier2
def test_pictures_differ_between_times_and_are_the_same_at_one(boxes):
    first, later, again = (picture(boxes, t) for t in (1.0, 3.0, 1.0))
    assert (np.abs(first - later).sum(axis=2) > 24).sum() > 2000
    assert np.array_equal(first, again)


@pytest.mark.tier2
@pytest.mark.parametrize("t", [0.7, 4.243, 8.9])
def test_the_forearm_covers_the_silhouette_of_its_corners(boxes, t):
    corners = seen_at(boxes_camera(), corners_at(t), (640, 480))
    assert np.abs(corners - [boxes.do("b.project(x)", corner.tolist()) for corner in corners_at(t)]).max() < 0.01
    outline = Image.new("1", (640, 480))
    ImageDraw.Draw(outline).polygon([tuple(corners[k]) for k in ConvexHull(corners).vertices], fill=1)
    expected, covered = np.asarray(outline), pixels_of(boxes, 1, t)
    assert (expected & covered).sum() > 0.8 * expected.sum()  # the upper arm hides a part of it
    assert not (covered & ~grown(expected, 2)).any()


@pytest.mark.tier2
@pytest.mark.parametrize("t", [0.7, 4.243, 8.9])
def test_the_tip_is_seen_where_the_kinematics_say_within_two_pixels(boxes, t):
    rows, columns = np.nonzero(pixels_of(boxes, 2, t))
    middle = np.array([columns.min() + columns.max() + 1, rows.min() + rows.max() + 1]) / 2
    assert np.abs(middle - seen_at(boxes_camera(), kinematics(t)[0][2], (640, 480))).max() < 2.0


def boxes_camera():
    return arm().camera


def grown(mask, by):
    out = mask.copy()
    for dy in range(-by, by + 1):
        for dx in range(-by, by + 1):
            out |= np.roll(mask, (dy, dx), axis=(0, 1))
    return out


@pytest.mark.tier2
@pytest.mark.parametrize(("scale", "bound"), [(1.0, 1e-4), (1e-3, 1e-9), (1e3, 0.0)])
def test_poses_come_back_within_the_bound_that_the_page_states(open_page, folder, scale, bound):
    film = arm(error_bound=bound, **EMPTY, charts=(), xy_plots=(), events=())
    poses = film.poses.copy()
    poses[:, :, :3] *= scale
    poses[300:, :, 3:] *= -1.0  # the other quaternion of the same orientation
    film = dataclasses.replace(film, poses=poses, camera=Camera((0, -3 * scale, 0), (0, 0, 0), (0, 0, 1)))
    opened = open_page(write_page(film, folder / "poses.html"))
    stated = json.loads(opened.tab.locator("#film").text_content())["error_bound"]
    allowed = stated - bound
    assert allowed <= max(0.11 * bound, 2e-6 * scale + 1e-6)
    for t in (film.time[299], 0.5 * (film.time[299] + film.time[300]), film.time[17]):
        (k, part), body = divmod(t / (film.time[1]), 1.0), 1
        drawn = np.array(opened.do("(b.seek(x[0]), b.pose(x[1]))", [float(t), body]))
        exact = poses[int(k), body, :3] * (1 - part) + poses[min(int(k) + 1, 600), body, :3] * part
        assert np.abs(drawn[:3] - exact).max() < allowed + 3e-7 * scale  # the page's own numbers are float32
        turn = Rotation.from_quat(drawn[3:]) * Rotation.from_rotvec([0, kinematics(t)[1][body], 0])
        assert 0.41 * turn.magnitude() < allowed + 2e-5  # at the end of the forearm
    assert opened.clean


@pytest.mark.tier2
def test_a_trace_is_drawn_to_the_very_point_reached(open_page, folder):
    time = np.array([0.0, 4.0, 10.0])
    line = np.array([[-0.5, 0, 0.6], [-0.1, 0, 0.6], [0.5, 0, 0.6]])
    film = arm(**{**EMPTY, "traces": (Trace("line", time, line),)}, bodies=arm().bodies[:1], poses=arm().poses[:, :1])
    film = dataclasses.replace(film, camera=Camera((0, -2, 0.6), (0, 0, 0.6), (0, 0, 1)))
    opened = open_page(write_page(film, folder / "trace.html", plots=False), "#still=1")
    opened.do("b.showBody(0, false)")
    for t in (3.0, 7.3):
        orange = np.abs(picture(opened, t) - [0xD5, 0x5E, 0]).sum(axis=2) < 60
        end = [np.interp(t, time, line[:, 0]), 0.0, 0.6]
        assert np.nonzero(orange)[1].max() + 1 == pytest.approx(seen_at(film.camera, end, (640, 480))[0], abs=2.0)


@pytest.mark.tier2
def test_layers_are_switched_by_their_names(player):
    names = [layer["name"] for layer in player.do("b.layers()")]
    assert names == ["path of the ball", "spring", "contact [N]", "motor [N m]", "axes", "torsion springs"]
    everything = picture(player, 6.0)
    for k in range(len(names)):
        player.do("b.showLayer(x, false)", k)
        assert (np.abs(everything - picture(player, 6.0)).sum(axis=2) > 24).sum() > 30
        player.do("b.showLayer(x, true)", k)
    assert np.array_equal(everything, picture(player, 6.0))


@pytest.mark.tier2
def test_a_drag_turns_the_camera_and_the_screen_shows_what_is_captured(open_page, folder):
    opened = open_page(folder / "arm.html", "#t=3&still=1")
    opened.tab.add_style_tag(content="#scale, #caption { display: none !important; }")
    point, places = [0.3, 0.2, 0.9], []
    rotate = lambda: drag(opened.tab.mouse, (300, 150), (200, 200))  # noqa: E731
    for change in (lambda: None, rotate, lambda: opened.do("b.resetCamera()")):
        change()
        places.append(opened.do("b.project(x)", point))
        opened.do("new Promise((drawn) => setTimeout(() => requestAnimationFrame(() => requestAnimationFrame(drawn))))")
        screen = np.asarray(Image.open(io.BytesIO(opened.tab.locator("#pane").screenshot())).convert("RGB")).astype(int)
        assert (np.abs(screen - picture(opened, 3.0)).sum(axis=2) > 12).mean() < 1e-3
    assert places[0] == places[2] and np.abs(np.subtract(places[0], places[1])).max() > 20 and opened.clean


def drag(mouse, start, end):
    mouse.move(*start)
    mouse.down()
    mouse.move(*end, steps=4)
    mouse.up()


@pytest.mark.tier2
def test_a_mesh_is_drawn_and_shared_meshes_are_stored_once(open_page, folder):
    vertices = np.array([[0, 0, 0], [0.4, 0, 0], [0, 0.4, 0], [0, 0, 0.4]], dtype=np.float32)
    mesh = Mesh(vertices, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], dtype=np.int32))
    shapes = tuple(DrawnShape(kind="mesh", size=(s, s, s), colour=RED, mesh=mesh) for s in (1.0, 0.5))
    film = arm(**EMPTY, bodies=(DrawnBody("upper", shapes), *arm().bodies[1:]))
    opened = open_page(write_page(film, folder / "mesh.html", plots=False))
    assert len(json.loads(opened.tab.locator("#film").text_content())["meshes"]) == 1
    assert pixels_of(opened, 0, 2.0).sum() > 500 and opened.clean


@pytest.mark.tier2
@pytest.mark.parametrize(("far", "offered", "taken"), [(0.0, False, False), (15.0, True, False), (500.0, True, True)])
def test_bodies_that_travel_far_can_be_followed_and_are_where_nothing_would_be_seen(
    open_page, folder, far, offered, taken
):
    film = arm(**{**EMPTY, "ground": Ground((0, 0, 1), 0.0)})
    poses = film.poses.copy()
    poses[:, :, 0] += far * film.time[:, None] / 10.0
    camera = Camera((far / 2, -2.6 - 1.1 * far, 1.2), (far / 2, 0.0, 0.6), (0, 0, 1))
    film = dataclasses.replace(film, poses=poses, camera=camera)
    opened = open_page(write_page(film, folder / "far.html", plots=False), "#still=1")
    assert opened.do("b.layers()") == [{"group": "Camera", "name": "follow the bodies", "on": taken}] * offered
    for follows in [taken, *([not taken] if offered else [])]:
        if follows != taken:
            opened.do("b.showLayer(0, x)", follows)
        for t in (2.0, 9.0):
            covered = pixels_of(opened, 1, t)
            middle = poses[int(60 * t), :, :3]
            pixel = opened.do("b.project(x)", [float(c) for c in (middle.min(axis=0) + middle.max(axis=0)) / 2])
            if follows:
                assert covered.sum() > 400 and np.abs(np.subtract(pixel, [320, 240])).max() < 1.0
            else:
                assert pixel == pytest.approx(seen_at(camera, middle.mean(axis=0), (640, 480)), abs=40)
    assert opened.clean


# ---- the player


@pytest.mark.tier2
def test_play_runs_the_time_pause_stops_it_and_speed_and_loop_are_kept(open_page, folder):
    opened = open_page(folder / "arm.html", wait=False)
    opened.tab.clock.install()
    opened.tab.reload()
    opened.tab.evaluate("() => window.bellcrank.ready")
    clock = opened.tab.clock
    clock.pause_at("2100-01-01")

    def passed(ms):
        before = opened.do("b.time")
        clock.run_for(ms)
        return opened.do("b.time") - before

    assert passed(300) == 0.0
    opened.tab.click("#play")
    assert opened.do("b.playing") and passed(500) == pytest.approx(0.5, abs=0.04)
    opened.tab.select_option("#speed", "0.1")
    assert opened.do("b.speed") == 0.1 and passed(500) == pytest.approx(0.05, abs=0.004)
    opened.tab.click("#play")
    assert not opened.do("b.playing") and passed(300) == 0.0
    opened.do("(b.speed = 10, b.seek(9.5), b.play())")
    assert passed(300) == pytest.approx(0.5) and not opened.do("b.playing")  # it stops at the end
    opened.tab.click("#loop")
    opened.do("(b.seek(9.5), b.play())")
    assert passed(200) == pytest.approx(2.0 - 10.0, abs=0.4) and opened.do("b.playing")
    assert len(opened.do("b.frameTimes")) > 40 and opened.clean


@pytest.mark.tier2
def test_times_since_1970_are_told_apart_to_the_microsecond(open_page, folder):
    film, since = arm(61, 1.0), 1.7e9
    shifted = dataclasses.replace(film, time=film.time + since, traces=(), charts=(), xy_plots=(), events=())
    opened = open_page(write_page(shifted, folder / "stamped.html"))
    assert opened.do("b.end - b.start") == pytest.approx(1.0, abs=1e-6)
    drawn = opened.do("(b.seek(x), b.pose(2))", since + 0.3)
    np.testing.assert_allclose(drawn[:3], kinematics(np.array([0.3]))[0][0, 2], atol=2e-3)
    assert opened.clean


@pytest.mark.tier2
def test_keys(player):
    step = 10.0 / 600

    def pressed(key, script="b.time"):
        player.tab.keyboard.press(key)
        return player.do(script)

    assert [pressed(" ", "b.playing"), pressed(" ", "b.playing")] == [True, False]
    player.do("b.seek(5)")
    assert [pressed("ArrowRight"), pressed("."), pressed("ArrowLeft"), pressed(",")] == pytest.approx(
        [5 + step, 5 + 2 * step, 5 + step, 5], abs=1e-6
    )
    assert pressed("Shift+ArrowRight") == pytest.approx(5 + 10 * step, abs=1e-6)
    assert [pressed("End"), pressed("Home")] == [10, 0]
    assert [pressed(key, "b.speed") for key in ("]", "+", "[", "-", "[")] == [2, 5, 2, 1, 0.5]
    assert [pressed("l", "b.loop"), pressed("L", "b.loop")] == [True, False]
    assert pressed("?", "document.getElementById('help').open") is True
    assert "0.11 mm" in player.tab.inner_text("#notes") and "A note." in player.tab.inner_text("#notes")
    assert "MIT License" in player.tab.text_content("#licences")
    assert pressed("Escape", "document.getElementById('help').open") is False


@pytest.mark.tier2
def test_a_step_back_from_between_frames_is_the_frame_before(player):
    player.do("b.seek(5.01)")
    player.tab.click("#back")
    assert player.do("b.time") == pytest.approx(5.0, abs=1e-6)
    player.tab.click("#forth")
    assert player.do("b.time") == pytest.approx(5.0 + 10 / 600, abs=1e-6)


@pytest.mark.tier2
def test_the_scrub_bar_goes_to_a_time_and_tells_of_marks(player):
    bar = player.tab.locator("#scrub").bounding_box()
    x = bar["x"] + 8 + 0.7 * (bar["width"] - 16)  # the bar's ends lie half a thumb inside
    player.tab.mouse.move(x, bar["y"] + 18)
    assert "7.000 s contact lost" in player.tab.inner_text("#tip")
    player.tab.mouse.click(x, bar["y"] + 18)
    assert player.do("b.time") == pytest.approx(7.0, abs=0.05)
    player.do("b.seek(7.1)")
    assert player.tab.inner_text("#caption") == "contact lost"
    player.tab.click("text=lock engages")
    assert player.do("b.time") == 2.5 and player.tab.inner_text("#clock") == "2.500 / 10 s"


@pytest.mark.tier2
def test_an_address_tells_the_time_and_hides_what_is_around(open_page, folder):
    opened = open_page(folder / "arm.html", "#t=3.2&still=1")
    assert opened.do("b.time") == 3.2
    assert not any(opened.tab.is_visible(f"#{part}") for part in ("header", "player", "panel", "tools"))
    assert opened.tab.locator("#view").bounding_box()["height"] == 480


# ---- plots


@pytest.mark.tier2
def test_dragging_the_cursor_of_a_chart_moves_the_robot_and_back(player):
    player.tab.locator(".chart .u-over").first.scroll_into_view_if_needed()
    over = player.tab.locator(".chart .u-over").first.bounding_box()
    at = lambda t: (over["x"] + over["width"] * t / 10, over["y"] + 40)  # noqa: E731
    poses, told = [], []
    player.tab.mouse.move(*at(2))
    player.tab.mouse.down()
    for t in (2, 6, 2):
        player.tab.mouse.move(*at(t), steps=3)
        assert player.do("b.time") == pytest.approx(t, abs=0.03)
        poses.append(player.do("b.pose(0)"))
        told.append(float(player.tab.inner_text(".legend output >> nth=0").replace("−", "-")))
        head = player.tab.locator(".playhead").first.bounding_box()
        assert head["x"] + 1 == pytest.approx(at(t)[0], abs=1.5)
    player.tab.mouse.up()
    player.tab.mouse.move(*at(9))
    assert player.do("b.time") == pytest.approx(2, abs=0.03)  # let go
    assert poses[0] == pytest.approx(poses[2], abs=1e-6) and abs(poses[0][4] - poses[1][4]) > 0.1
    expected = angles(np.array([2.0, 6.0, 2.0]))[0]
    assert told == pytest.approx(expected, abs=0.04)
    player.tab.mouse.move(5, 5)


@pytest.mark.tier2
def test_a_press_in_a_plane_goes_to_the_nearest_time(player):
    over = player.tab.locator(".xy-plot .u-over")
    over.scroll_into_view_if_needed()
    dot = lambda: player.tab.locator(".dot").bounding_box()  # noqa: E731
    player.do("b.seek(4)")
    there = dot()
    player.do("b.seek(0.5)")
    assert dot() != there
    player.tab.mouse.click(there["x"] + 6, there["y"] + 6)
    assert player.do("b.time") == pytest.approx(4, abs=0.1)


@pytest.mark.tier2
def test_lines_are_chosen_in_the_legend_and_only_eight_are_shown_at_first(open_page, folder):
    t = np.linspace(0, 1, 50)
    chart = Chart(title="many", unit="m", time=t, lines=tuple(FilmLine(f"line {k}", np.sin(t + k)) for k in range(11)))
    opened = open_page(write_page(arm(charts=(chart,), xy_plots=()), folder / "many.html"), size=(1000, 700))
    assert opened.tab.locator(".legend button").count() == 9
    opened.tab.click("text=3 more")
    pressed = [b.get_attribute("aria-pressed") for b in opened.tab.locator(".legend button").all()]
    assert pressed == ["true"] * 8 + ["false"] * 3
    opened.tab.click("[title='line 10']")
    opened.tab.click("[title='line 0']")
    told = [b.inner_text() for b in opened.tab.locator(".legend output").all()]
    assert told[0] == "" and told[10] == "−0.544" and opened.clean


@pytest.mark.tier2
def test_values_that_are_not_finite_are_gaps(open_page, folder):
    t = np.linspace(0.0, 10.0, 101)
    values = np.sin(t)
    values[40:61], values[80] = np.nan, np.inf
    lines = (FilmLine("broken", values), FilmLine("nothing", np.full(101, np.nan)))
    charts = (
        Chart(title="gap", unit="m", time=t, lines=lines),
        Chart(title="log", unit="m", time=t, lines=lines, logarithmic=True),
    )
    plane = XYPlot(
        title="p", x_label="x", y_label="y", time=t, x=values, y=values, limits=(("l", np.full((3, 2), np.nan)),)
    )
    arrow = Arrow(name="a", unit="N", points=np.full((601, 3), np.nan), vectors=np.full((601, 3), np.nan))
    trace = Trace("t", t, np.stack([values, values, values], axis=1))
    film = arm(charts=charts, xy_plots=(plane,), arrows=(arrow,), traces=(trace,))
    opened = open_page(write_page(film, folder / "gaps.html"), size=(1000, 700))
    for t, told in ((2.0, "0.9093"), (5.0, "–"), (8.0, "∞")):
        opened.do("b.seek(x)", t)
        assert opened.tab.inner_text(".legend output >> nth=0") == told
    assert opened.clean


@pytest.mark.tier2
def test_rounding_is_told_as_zero_beside_what_is_large(open_page, folder):
    t = np.linspace(0.0, 10.0, 101)
    chart = Chart(
        title="speed", unit="m/s", time=t, lines=(FilmLine("one", 2.0 + 0 * t), FilmLine("noise", 8e-17 + 0 * t))
    )
    small = Chart(title="small", unit="m", time=t, lines=(FilmLine("all small", 8e-17 + 0 * t),))
    plane = XYPlot(title="p", x_label="x", y_label="y", time=t, x=np.cos(t), y=1e-17 * t)
    film = arm(charts=(chart, small), xy_plots=(dataclasses.replace(plane, y=np.where(t > 5, 1.0, 1e-17)),))
    opened = open_page(write_page(film, folder / "noise.html"), size=(1000, 700))
    opened.do("b.seek(1)")
    told = [each.inner_text() for each in opened.tab.locator(".legend output").all()]
    assert told == ["2", "0", "8e−17", "0.5403, 0 at 1.000 s"] and opened.clean


@pytest.mark.tier2
def test_lines_are_drawn_to_fractions_of_a_pixel_and_broken_between_motions(open_page, folder):
    """A slope of one pixel in twenty shows shades between its colour and the paper's; a gap of 1 ms is a gap."""
    t = np.array([0.0, 5.0, 5.0005, 5.001, 10.0])
    film = arm(
        charts=(
            Chart(title="two", unit="m", time=t, lines=(FilmLine("line", np.array([0.0, 0.1, np.nan, 1.0, 1.1])),)),
        ),
        xy_plots=(),
        events=(),
    )
    opened = open_page(write_page(film, folder / "smooth.html"), size=(1000, 700))
    opened.do("b.seek(10)")
    shot = opened.tab.locator(".chart .u-over").first.screenshot()
    seen = np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")).astype(int)
    middle = seen.shape[1] // 2
    blue = np.abs(seen - [0x00, 0x72, 0xB2]).sum(axis=2) < 40
    assert not blue[30:-30, middle - 4 : middle + 4].any()
    sloped = seen[:, 10 : middle - 10, 0][:, ::7]
    assert len(np.unique(sloped[sloped < 200])) > 5


@pytest.mark.tier2
def test_a_peak_that_would_hide_all_else_makes_a_chart_logarithmic_above_the_usual(open_page, folder):
    t = np.linspace(0.0, 10.0, 1001)
    peak = np.where(t > 9.9, 3000.0, np.sin(t))
    charts = (
        Chart(title="force", unit="N", time=t, lines=(FilmLine("a", peak),)),
        Chart(title="usual", unit="N", time=t, lines=(FilmLine("a", np.sin(t)),)),
    )
    opened = open_page(write_page(arm(charts=charts), folder / "peak.html"), size=(1000, 700))
    heads = [each.inner_text() for each in opened.tab.locator(".chart > header span").all()]
    assert heads == ["[N], logarithmic above 1", "[N]"] and opened.clean


@pytest.mark.tier2
def test_a_long_panel_has_a_list_of_its_plots_to_go_to(player):
    assert player.tab.locator("[aria-label='Go to a plot'] option").all_inner_texts()[1:] == [
        "position", "residual", "motor", "events",
    ]  # fmt: skip
    player.tab.select_option("[aria-label='Go to a plot']", label="events")
    player.tab.wait_for_function("() => document.getElementById('panel').scrollTop > 50")
    player.do("document.getElementById('panel').scrollTo(0, 0)")


@pytest.mark.tier2
def test_the_first_fact_is_told_whole_on_a_phone(open_page, folder):
    facts = (
        ("verdict", "All inside: the tightest margin is 11 %, " + "shoulder_pan_joint's speed. " * 2),
        ("b", "c" * 90),
    )
    opened = open_page(write_page(arm(facts=facts), folder / "facts.html"), size=(390, 844))
    whole = "(([f, first]) => first.offsetTop + first.offsetHeight <= f.offsetTop + f.clientHeight + 1)"
    assert opened.do(f"{whole}([document.querySelector('#facts'), document.querySelector('#facts div')])")
    assert opened.tab.locator("#facts").bounding_box()["height"] < 100
    opened.tab.click("#more")
    assert opened.tab.inner_text("#more") == "fewer facts" and opened.tab.locator("#facts dd >> nth=1").is_visible()


@pytest.mark.tier2
@pytest.mark.parametrize("width", [296, 320, 360])
@pytest.mark.parametrize("end", [0.73004, 10.0, 86400.5])
def test_a_narrow_phone_shows_all_buttons_without_scrolling_sideways(open_page, folder, width, end):
    opened = open_page(write_page(arm(end=end), folder / "narrow.html"), size=(width, 640))
    tab = opened.tab
    assert tab.evaluate("() => document.documentElement.scrollWidth") == width
    edges = [tab.locator(f"#{name}").bounding_box() for name in ("back", "play", "forth", "clock", "speed", "loop")]
    ends = [box["x"] + box["width"] for box in edges]
    assert all(end <= box["x"] + 0.5 for end, box in zip(ends, edges[1:], strict=False)) and ends[-1] <= width
    assert opened.clean


@pytest.mark.tier2
def test_without_plots_the_page_has_none(boxes):
    assert boxes.tab.locator(".u-over").count() == 0
    assert boxes.do("typeof uPlot") == "undefined" and boxes.clean


@pytest.mark.tier2
def test_without_webgl_the_plots_work_and_a_message_says_so(open_page, folder):
    none = (
        "const get = HTMLCanvasElement.prototype.getContext; HTMLCanvasElement.prototype.getContext = "
        "function (kind, ...rest) { return /webgl/.test(kind) ? null : get.call(this, kind, ...rest); };"
    )
    opened = open_page(folder / "arm.html", size=(1000, 700), script=none)
    assert "no WebGL" in opened.tab.inner_text("#message")
    opened.do("b.seek(2)")
    assert opened.tab.inner_text(".legend output >> nth=0") == "0.6686" and opened.clean


# ---- what may be wrong


@pytest.mark.tier2
def test_names_cannot_bring_anything_into_the_page(open_page, folder):
    names = ("__proto__", "constructor", "toString", "a/b", HOSTILE)
    t = np.array([0.0, 1.0])
    film = Film(
        title=HOSTILE,
        time=t,
        poses=np.tile([0.0, 0, 0, 0, 0, 0, 1], (2, len(names), 1)),
        bodies=tuple(DrawnBody(name, (DrawnShape(kind="box", size=(0.1, 0.1, 0.1), colour=RED),)) for name in names),
        camera=Camera((1, 1, 1), (0, 0, 0), (0, 0, 1)),
        error_bound=0.0,
        ground=None,
        traces=tuple(Trace(name, t, np.eye(2, 3)) for name in names),
        arrows=tuple(Arrow(name=name, unit=name, points=np.eye(2, 3), vectors=np.eye(2, 3)) for name in names),
        springs=tuple(FilmSpring(name, np.ones((2, 2, 3)) * [[[0], [1]]]) for name in names),
        axes=tuple(FilmAxis(name=name, body=0, point=(0, 0, 0), direction=(0, 0, 1)) for name in names),
        events=tuple(TimelineEvent(0.5, name) for name in names),
        charts=tuple(
            Chart(title=name, unit=name, time=t, lines=tuple(FilmLine(each, t) for each in names)) for name in names
        ),
        xy_plots=tuple(
            XYPlot(title=name, x_label=name, y_label=name, time=t, x=t, y=t, limits=((name, np.eye(3, 2)),))
            for name in names
        ),
        facts=tuple((name, name) for name in names),
        notes=names,
    )
    opened = open_page(write_page(film, folder / "hostile.html"), size=(1280, 800))
    shown = HOSTILE.replace("\ud800", "?")
    assert opened.tab.text_content("h1") == shown and opened.tab.title() == shown
    assert opened.tab.locator("#facts dd").all_text_contents()[:4] == list(names[:4])
    assert opened.tab.locator("img").count() == 0 and opened.do("window.hacked ?? 0") == 0
    assert opened.do("Object.keys(Object.prototype).length") == 0 and len(opened.do("b.layers()")) == 16
    assert opened.clean


@pytest.mark.tier2
def test_the_policy_lets_no_other_script_run(open_page, folder):
    text = page_html(arm(), plots=False)
    injected = '<script>window.hacked = 1</script><img src="x:" onerror="window.hacked = 2">'
    (folder / "injected.html").write_text(text.replace("<noscript>", injected + "<noscript>"), encoding="utf-8")
    opened = open_page(folder / "injected.html")
    opened.do(
        "[document.head.append(Object.assign(document.createElement('script'), { textContent: 'window.hacked = 3' })), "
        "document.body.setAttribute('onclick', 'window.hacked = 4'), document.body.click()].length"
    )
    assert opened.do("window.hacked ?? 0") == 0
    assert opened.do("fetch('https://example.org').then(() => 'came', () => 'kept')") == "kept"
    assert len([error for error in opened.errors if "Content Security Policy" in error]) >= 4


@pytest.mark.tier2
def test_a_film_of_one_frame_is_a_still(open_page, folder):
    full = arm()
    one = {name: getattr(full, name)[:1] for name in ("time", "poses")}
    arrows = tuple(dataclasses.replace(a, points=a.points[:1], vectors=a.vectors[:1]) for a in full.arrows)
    springs = tuple(dataclasses.replace(s, ends=s.ends[:1]) for s in full.springs)
    charts = (Chart(title="position", unit="rad", time=full.time[:1], lines=(FilmLine("shoulder", np.array([1.5])),)),)
    traces = (Trace("none", full.time[:1], np.zeros((1, 3))),)
    film = arm(**one, arrows=arrows, springs=springs, charts=charts, traces=traces, xy_plots=())
    opened = open_page(write_page(film, folder / "one.html"), size=(1000, 700))
    opened.do("(b.play(), b.step(1), b.seek(7))")
    assert opened.do("[b.frames, b.duration, b.time, b.playing]") == [1, 0, 0, False]
    assert opened.tab.is_disabled("#play") and opened.tab.is_disabled("#scrub")
    assert opened.tab.inner_text(".legend output >> nth=0") == "1.5"
    assert pixels_of(opened, 1, 0.0).sum() > 500 and opened.clean


@pytest.mark.tier2
def test_a_phone_has_no_sideways_scroll_and_targets_for_fingers(open_page, folder):
    opened = open_page(folder / "arm.html", size=(390, 844), has_touch=True, is_mobile=True, device_scale_factor=2)
    assert opened.do("document.documentElement.scrollWidth") == 390
    for target in opened.tab.locator("button:visible, select:visible").all():
        box = target.bounding_box()
        assert box["height"] >= 36 and box["width"] >= 36, target.inner_text()
    opened.tab.tap("#play")
    assert opened.do("b.playing")
    over = opened.tab.locator(".chart .u-over").first
    over.scroll_into_view_if_needed()
    opened.do("b.pause()")
    box = over.bounding_box()
    opened.tab.touchscreen.tap(box["x"] + box["width"] / 2, box["y"] + 20)
    assert opened.do("b.time") == pytest.approx(5, abs=0.1)
    assert opened.tab.locator("#view").bounding_box()["y"] >= 0  # the view stays beside the plot
    assert opened.clean


def nan_pose(film):
    poses = film.poses.copy()
    poses[12, 1, 4] = np.nan
    return dataclasses.replace(film, poses=poses)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (nan_pose, r"film 'Arm of two boxes': the pose of body 'fore' at 0.2 s is not a finite number"),
        (lambda f: dataclasses.replace(f, time=f.time[:0]), "it has no frame"),
        (lambda f: dataclasses.replace(f, time=f.time[::-1]), "its times do not increase"),
        (lambda f: dataclasses.replace(f, poses=f.poses[1:]), r"poses are \(600, 3, 7\); expected \(601, 3, 7\)"),
        (lambda f: dataclasses.replace(f, poses=0 * f.poses), "a quaternion of its poses is zero"),
        (
            lambda f: dataclasses.replace(f, camera=Camera((0, 0, 1), (0, 0, 0), (0, 0, 1))),
            "its camera has no view direction",
        ),
        (lambda f: dataclasses.replace(f, error_bound=np.nan), "its error_bound is nan"),
        (
            lambda f: dataclasses.replace(f, springs=(FilmSpring("s", np.ones((2, 2, 3))),)),
            "spring 's' has no finite ends",
        ),
        (
            lambda f: dataclasses.replace(f, axes=(FilmAxis(name="a", body=3, point=(0, 0, 0), direction=(0, 0, 1)),)),
            "axis 'a' is of body 3",
        ),
        (
            lambda f: dataclasses.replace(f, layers=(BodyLayer("motors", "elbow", (1, 3)),)),
            r"layer 'elbow' has bodies \(1, 3\); there are 3",
        ),
        (lambda f: dataclasses.replace(f, traces=(Trace("t", f.time, np.ones((2, 3))),)), r"trace 't' has points"),
        (
            lambda f: dataclasses.replace(
                f, charts=(Chart(title="c", unit="m", time=f.time, lines=(FilmLine("l", np.ones(2)),)),)
            ),
            "line 'l' of chart 'c' does not have one value for each time",
        ),
        (lambda f: dataclasses.replace(f, events=(TimelineEvent(np.inf, "m"),)), "the time of an event"),
    ],
)
def test_a_film_that_contradicts_itself_is_refused(change, message):
    with pytest.raises(InputError, match=message):
        page_html(change(arm()))


def test_a_page_that_cannot_be_written_leaves_nothing_behind(tmp_path):
    (tmp_path / "file").write_text("kept", encoding="utf-8")
    (tmp_path / "folder.html").mkdir()
    for path in (tmp_path / "file" / "page.html", tmp_path / "folder.html"):
        with pytest.raises(InputError, match=re.escape(str(path))):
            write_page(arm(), path)
    bad = tmp_path / "bad.html"
    with pytest.raises(InputError, match="finite"):
        write_page(nan_pose(arm()), bad)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder.html"]


# ---- bundled scripts


@pytest.mark.parametrize("library", ["meshcat", "uplot"])
def test_bundled_scripts_are_those_that_their_readme_states(library):
    folder = ASSETS / library
    stated = re.findall(r"^\| `([^`]+)` \|.*\| `([0-9a-f]{64})` \|$", (folder / "README.md").read_text(), re.MULTILINE)
    assert len(stated) >= 3
    for name, digest in stated:
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest, name


def test_a_page_names_its_libraries_with_versions_and_holds_the_text_of_each_licence():
    library = re.search(r'id="library">([^<]*)<', page_html(arm()))[1]
    licences = json.loads(zlib.decompress(base64.b64decode(library)))["licences"]
    parts = {part.split("\n\n", 1)[0]: part.split("\n\n", 1)[1] for part in licences.split("==== ")[1:]}
    names = ("meshcat 0.3.2", "three, 0.132.2", "dat.gui, 0.7.7", "msgpack-lite", "isarray, 1.0.0", "uPlot 1.6.32")
    for name in names:
        (text,) = (text for title, text in parts.items() if title.startswith(name))
        assert "Permission is hereby granted" in text or "Apache License" in text, name
    assert len(parts) == 12 and min(map(len, parts.values())) > 800


# ---- arrows


def test_a_blow_a_hundred_times_the_usual_does_not_hide_the_usual():
    vectors = np.tile([10.0, 0.0, 0.0], (601, 1))
    vectors[300:303] *= 100.0
    film = arm(
        arrows=(
            Arrow(name="lock", unit="N", points=np.zeros((601, 3)), vectors=vectors),
            Arrow(name="m", unit="N m", points=0 * vectors, vectors=0 * vectors),
        )
    )
    force, torque = arrow_scales(film)
    assert force.usual == 10.0 and force.peak == 1000.0 and torque.peak == 0.0
    longest = force.length + force.decade * np.log10(force.peak / force.usual)
    assert longest == pytest.approx(torque.length) and force.length == pytest.approx(0.7 * longest)


def test_arrows_of_like_size_are_on_one_linear_scale():
    (scale, _) = arrow_scales(arm())
    assert scale.decade == 0.0 and scale.usual == scale.peak == pytest.approx(np.hypot(30, 20), rel=1e-4)
