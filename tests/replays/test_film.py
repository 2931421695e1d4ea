"""Films: what they show is where the run was, forces point and weigh as they should, and thinning keeps its bound."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from page_series import decoded

import bellcrank as bc
from bellcrank.errors import InputError
from bellcrank.motion.kinematics.rotations import from_matrices, make_continuous, multiply, rotate
from bellcrank.motion.sampled.quintic_splines import smooth_between
from bellcrank.motion.sampled.resampling import extreme_rows
from bellcrank.replays.film.arrows import RunFrames, arrow_scales, run_arrows
from bellcrank.replays.film.camera import ASPECT, HALF_VIEW, CameraScene, choose_camera, fit_camera, motion_plane_normal
from bellcrank.replays.film.decimation import frame_rows, interpolation_error, line_rows
from bellcrank.replays.film.film import check_film
from bellcrank.replays.film.motion_film import GAP, film_of_motion
from bellcrank.replays.film.run_film import film_of_run
from bellcrank.replays.film.sampled_trajectory import SampledTrajectory, frame_pose_function, refine
from bellcrank.replays.film.sizing_film import film_of_sizing
from bellcrank.replays.geometry.shapes import DrawnBody, DrawnShape, Mesh, bounding_boxes, outlines, world_corners
from bellcrank.replays.page.film_encoding import encode_film
from bellcrank.simulation.integration.statistics import Status

SCENE = """
name: Arm under forces
urdf: planar_2r
gravity: [0, -9.81, 0]
frames: {hook: {link: tip, xyz: [-0.2, 0, 0]}}
initial: {shoulder: 20 deg, elbow: 30 deg}
forces:
  - {name: wall, kind: spring, frame_a: hook, frame_b: world, point: [2, 0, 0], stiffness: 40}
  - {name: push, kind: wrench, frame: tip, force: [0, 3, 0], torque: [0, 0, 2], expressed_in: frame}
  - {name: motor, kind: torque, joint: elbow, value: 7}
parameters: {pull: {value: 2.5, sets: [force.wall.point.x]}}
simulate: {duration: 1, samples: 51}
"""


@pytest.fixture(scope="module")
def four_bar():
    return bc.simulate("four_bar")


@pytest.fixture(scope="module")
def disk():
    return bc.simulate("rolling_disk")


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    path = tmp_path_factory.mktemp("arm") / "arm.yaml"
    path.write_text(SCENE)
    return bc.simulate(path)


@pytest.fixture(scope="module")
def sizing():
    config = bc.load_scene("planar_2r").config
    robot = config.robot()
    return bc.size(robot, [config.motion(robot, name) for name in config.motions], config.actuators)


def rotation(turns):
    x, y, z, w = np.moveaxis(turns, -1, 0)
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], axis=-1),
            np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], axis=-1),
            np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=-1),
        ],
        axis=-2,
    )


def shown(film, body, times):
    """Where a film has a body at times: straight between frames, and evenly turned."""
    poses = film.poses[:, [b.name for b in film.bodies].index(body)]
    k = np.clip(np.searchsorted(film.time, times, side="right") - 1, 0, len(film.time) - 2)
    s = ((times - film.time[k]) / (film.time[k + 1] - film.time[k]))[:, None]
    points = (1 - s) * poses[k, :3] + s * poses[k + 1, :3]
    half = np.arccos(np.clip(np.sum(poses[k, 3:] * poses[k + 1, 3:], axis=1), -1, 1))[:, None]
    size = np.where(half < 1e-6, 1.0, np.sin(half))
    a, b = (np.where(half < 1e-6, x, np.sin(x * half) / size) for x in (1 - s, s))
    return points, rotation(a * poses[k, 3:] + b * poses[k + 1, 3:])


# ---- poses


@pytest.mark.tier2
@pytest.mark.parametrize("name", ["four_bar", "disk", "arm"])
def test_frames_are_where_the_run_says_and_between_them_no_point_is_off_by_more_than_the_bound(name, request):
    run = request.getfixturevalue(name)
    film = film_of_run(run)
    check_film(film)
    there = np.isin(film.time, run.time)
    assert there.sum() > 20
    rows = np.searchsorted(run.time, film.time[there])
    for body, corners in zip(film.bodies, bounding_boxes(film.bodies), strict=True):
        truth = run.frame(body.name)
        k = film.bodies.index(body)
        assert np.abs(film.poses[there, k, :3] - truth.position[rows]).max() < 1e-12
        assert np.abs(rotation(film.poses[there, k, 3:]) - truth.rotation[rows]).max() < 1e-12
        points, turns = shown(film, body.name, run.time)
        for corner in corners:
            off = points + turns @ corner - truth.position - truth.rotation @ corner
            assert np.linalg.norm(off, axis=1).max() <= film.error_bound * (1 + 1e-9)


def test_quaternions_of_a_film_do_not_jump(disk):
    film = film_of_run(disk)
    assert np.sum(film.poses[1:, :, 3:] * film.poses[:-1, :, 3:], axis=2).min() > 0.7


def test_a_run_of_a_few_solver_steps_is_filled_so_that_a_finer_run_agrees():
    sparse, fine = bc.simulate("four_bar", times="steps"), bc.simulate("four_bar", samples=2001)
    film = film_of_run(sparse)
    assert len(sparse) < 60 < len(film.time)
    body = film.bodies[-1].name
    rows = fine.time <= film.time[-1]
    points, _ = shown(film, body, fine.time[rows])
    assert np.linalg.norm(points - fine.frame(body).position[rows], axis=1).max() < 2.0 * film.error_bound


def test_the_parameters_of_a_run_move_its_film():
    longer = bc.simulate("four_bar", duration=2.0, overrides={"crank_length": 1.3, "ground_length": 1.3})
    film = film_of_run(longer)
    k = [body.name for body in film.bodies].index("coupler_link")
    assert np.linalg.norm(film.poses[:, k, :3], axis=1) == pytest.approx(np.full(len(film.time), 1.3), abs=1e-12)


# ---- forces, contacts, marks


def test_the_arrow_at_the_lock_is_the_force_at_the_apex_and_its_mark_says_so(four_bar):
    film = film_of_run(four_bar)
    (arrow,) = film.arrows
    assert arrow.name == "apex on coupler_link" and arrow.unit == "N" and not arrow.is_torque
    assert arrow.vectors[-1] == pytest.approx([1500.133, -380.510, 0.0], abs=0.01)
    assert arrow.points[-1] == pytest.approx(four_bar.frame("coupler_tip").position[-1], abs=1e-12)
    (mark,) = film.events
    assert mark.time == pytest.approx(12.2678, abs=1e-4) and film.time[-1] == mark.time
    assert mark.text.startswith("lock, which ended the run; crank 150.46°")
    assert "apex x 1500.13 N, apex y -380.51 N" in mark.text


def test_the_contact_is_traced_on_the_floor_and_its_force_is_what_newton_asks_for(disk):
    film = film_of_run(disk)
    traces = {trace.name: trace for trace in film.traces}
    contact = traces["floor contact"]
    assert set(traces) == {"disk", "floor contact"} and np.abs(contact.points[:, 2]).max() < 0.05 * film.error_bound
    rows = np.flatnonzero(np.isin(contact.time, disk.time))
    want = disk.output("contact")[np.searchsorted(disk.time, contact.time[rows])]
    assert np.abs(contact.points[rows] - want).max() < 1e-12 and np.abs(contact.points[rows, 2]).max() < 1e-12
    (arrow,) = film.arrows
    there = np.isin(arrow.time, disk.time)
    at = np.searchsorted(disk.time, arrow.time[there])
    v, a, frame = disk.velocity[at], disk.acceleration[at], disk.frame("disk")
    accelerated = (frame.rotation[at] @ (a[:, :3] + np.cross(v[:, 3:], v[:, :3]))[..., None])[..., 0]
    force = disk.robot.model.inertias[1].mass * (accelerated + np.array([0.0, 0.0, 9.81]))  # Newton: m (a − g)
    assert np.abs(arrow.vectors[there] - force).max() < 1e-8 * np.abs(force).max()
    assert film.ground.normal == (0.0, 0.0, 1.0) and film.ground.height == 0.0


def test_forces_of_a_scene_become_springs_and_arrows(arm):
    film = film_of_run(arm)
    there = np.isin(film.time, arm.time)
    rows = np.searchsorted(arm.time, film.time[there])
    (spring,) = film.springs
    assert spring.ends[there, 0] == pytest.approx(arm.frame("hook").position[rows], abs=1e-12)
    assert np.all(spring.ends[:, 1] == [2.5, 0.0, 0.0])  # the parameter's, not the file's
    arrows = {arrow.name: arrow for arrow in film.arrows}
    assert set(arrows) == {"elbow motor", "push force", "push torque"}
    assert np.all(arrows["elbow motor"].vectors == [0.0, 0.0, 7.0]) and arrows["elbow motor"].is_torque
    push = arrows["push force"]
    there = np.isin(push.time, arm.time)
    rows = np.searchsorted(arm.time, push.time[there])
    assert push.vectors[there] == pytest.approx(arm.frame("tip").rotation[rows] @ [0.0, 3.0, 0.0]) and len(rows) > 10
    assert arrows["push torque"].unit == "N m"


ROD = "{name: rod, kind: distance, frame_a: panda_link4, frame_b: world, point: [0.3, 0.4, 0], length: 0.8}"
PIN = "{name: pin, kind: hinge, frame_a: grip, frame_b: world, point: [0.5, 0.1, 0.5], axis: [0, 1, 0]}"
WELD = "{name: weld, kind: weld, frame_a: grip, frame_b: world, point: [0.5, 0.1, 0.5]}"


@pytest.mark.tier2
@pytest.mark.parametrize("constraints", [f"{ROD}, {PIN}", WELD], ids=["rod and hinge", "weld"])
def test_arrows_of_constraints_do_the_work_of_their_multipliers(tmp_path, constraints):
    """Jᵀ λ at a joint is axis · (moment about it) of all that the arrows put on the links beyond it."""
    (tmp_path / "loop.yaml").write_text(
        "name: held\nurdf: panda\nfriction: none\ninitial: {panda_joint2: {guess: -0.5}, panda_joint4: {guess: -2.0}, "
        "panda_joint6: {guess: 1.6}}\n"
        "frames: {grip: {link: panda_link7, xyz: [0.02, 0.01, 0.1], rpy: [180 deg, 10 deg, 0]}}\n"
        f"constraints: [{constraints}]\n"
        "simulate: {duration: 0.1, samples: 3}\n"
    )
    run = bc.simulate(tmp_path / "loop.yaml")
    q = run.position

    def placed(name):
        frame = run.frame(name)
        return frame.position, from_matrices(frame.rotation)

    moments = RunFrames(
        scene=run.scene, parameters=run.parameters, state=run.state, frame_pose=placed, run=run, time=run.time
    )
    need = run.robot.inverse_dynamics(q, run.velocity, run.acceleration) - run.torque
    names = list(run.robot.joint_names)
    arrows = list(run_arrows(moments))
    assert len(arrows) == 2 + ("rod" in constraints)
    assert all(arrow.name.endswith((" on panda_link4", " on panda_link7")) for arrow in arrows)
    got = np.zeros_like(need)
    for arrow in arrows:
        for k in range(names.index("panda_joint4" if arrow.name == "rod on panda_link4" else "panda_joint7") + 1):
            link = run.robot.urdf.joints[names[k]].child
            place, turn = placed(link)
            axis = rotate(turn, run.robot.joint_axis(names[k]))
            arm = arrow.vectors if arrow.is_torque else np.cross(arrow.points - place, arrow.vectors)
            got[:, k] += np.sum(axis * arm, axis=1)
    assert np.abs(got - need).max() < 1e-8 * np.abs(need).max()


@pytest.mark.tier2
def test_the_film_of_a_sizing_has_rods_springs_and_the_lengths_that_parameters_give(tmp_path):
    (tmp_path / "rod.yaml").write_text(
        "name: rod\nurdf: planar_2r\ngravity: [0, -9.81, 0]\nactuated: [shoulder]\n"
        "initial: {shoulder: -60 deg, elbow: {guess: 60 deg}}\n"
        "constraints: [{name: link, kind: distance, frame_a: tip, frame_b: world, point: [2.5, 0.5, 0], length: 1.6}]\n"
        "forces: [{name: pull, kind: spring, frame_a: tip, frame_b: world, point: [0, 2, 0], stiffness: 10}]\n"
        "parameters: {reach: {value: 1.3, sets: [joint.elbow.origin.x]}}\n"
        "motions: {swing: {kind: waypoints, times: [0, 1], positions: [{shoulder: -60 deg}, {shoulder: -50 deg}]}}\n"
    )
    sizing = bc.size(tmp_path / "rod.yaml")
    film = film_of_sizing(sizing)
    (rod,), (spring,) = film.rods, film.springs
    assert rod.name == "link" and spring.name == "pull" and rod.ends.shape == (len(film.time), 2, 3)
    assert np.linalg.norm(rod.ends[:, 1] - rod.ends[:, 0], axis=1) == pytest.approx(1.6, abs=1e-6)
    assert np.all(rod.ends[:, 1] == [2.5, 0.5, 0.0]) and np.all(spring.ends[:, 1] == [0.0, 2.0, 0.0])
    assert np.array_equal(rod.ends[:, 0], spring.ends[:, 0])
    shoulder = sizing.inputs[1][0].at(film.time)[0][:, 0]
    elbow = film.poses[:, [body.name for body in film.bodies].index("link_2")][:, :3]
    assert elbow[:, :2] == pytest.approx(1.3 * np.column_stack([np.cos(shoulder), np.sin(shoulder)]), abs=1e-6)


def test_the_rod_of_a_distance_is_a_thin_rod_between_its_two_points_as_long_as_it_is_to_be(tmp_path):
    (tmp_path / "rod.yaml").write_text(
        "name: rod\nurdf: planar_2r\ngravity: [0, -9.81, 0]\n"
        "initial: {shoulder: -60 deg, elbow: {guess: 60 deg}}\n"
        "constraints: [{name: link, kind: distance, frame_a: tip, frame_b: world, point: [2.5, 0.5, 0], length: 1.6}]\n"
        "simulate: {duration: 1, samples: 101}\n"
    )
    run = bc.simulate(tmp_path / "rod.yaml")
    film = film_of_run(run)
    (rod,) = film.rods
    there = np.isin(film.time, run.time)
    rows = np.searchsorted(run.time, film.time[there])
    assert rod.name == "link" and rod.ends.shape == (len(film.time), 2, 3) and len(rows) > 50
    assert rod.ends[there, 0] == pytest.approx(run.frame("tip").position[rows], abs=1e-9)
    assert np.all(rod.ends[:, 1] == [2.5, 0.5, 0.0]) and np.ptp(rod.ends[:, 0], axis=0).max() > 0.01
    assert np.linalg.norm(rod.ends[:, 1] - rod.ends[:, 0], axis=1) == pytest.approx(1.6, abs=1e-6)
    (packed,) = decoded(encode_film(film))["rods"]
    assert np.abs(packed["ends"].reshape(-1, 2, 3) - rod.ends).max() <= film.error_bound


# ---- what else a film holds


def test_charts_are_those_of_the_plots_and_keep_values_of_the_run(four_bar):
    charts = {chart.title: chart for chart in film_of_run(four_bar).charts}
    assert {"position", "velocity", "joint torque", "multiplier"} <= set(charts)
    crank = charts["position"].lines[0]
    there = np.isin(crank.time, four_bar.time)
    assert there.sum() > 20
    assert np.array_equal(
        crank.values[there], four_bar.joint("crank").position[np.searchsorted(four_bar.time, crank.time[there])]
    )
    assert charts["multiplier"].unit == "N"
    for title, unit in (("constraint position residual", "m"), ("constraint velocity residual", "m/s")):
        assert charts[title].logarithmic and charts[title].unit == unit


@pytest.mark.tier2
def test_the_most_telling_charts_come_first_and_no_title_repeats_its_unit(four_bar, sizing):
    closed = [chart.title.split(" ")[0] for chart in film_of_run(four_bar).charts]
    assert closed[:4] == ["position", "velocity", "multiplier", "energy"] and closed.index("outputs:") == 4
    open_ones = film_of_run(bc.simulate("spring_pendulum", duration=1.0)).charts
    assert open_ones[0].title == "outputs: coriolis, centrifugal, tangential" and open_ones[0].unit == "m/s²"
    velocities = [chart.unit for chart in open_ones if chart.title == "velocity"]
    assert sorted(velocities) == ["m/s", "rad/s"] and open_ones[-1].title == "outputs: energy"
    assert [chart.title for chart in film_of_sizing(sizing).charts] == [
        "joint torque", "position", "velocity", "acceleration",
    ]  # fmt: skip


def test_facts_begin_with_how_it_ended_and_repeat_no_title(four_bar, sizing):
    assert film_of_run(four_bar).facts[0] == ("ended", "event at 12.267789 s: event 'lock' ended the run")
    film = film_of_sizing(sizing)
    assert film.facts[0][0] == "verdict" and film.facts[0][1].startswith("All inside: the tightest margin is 26.2%")
    assert "robot" not in dict(film.facts) and ("robot", "planar_2r") in film_of_sizing(sizing, title="My arm").facts


@pytest.mark.tier2
@pytest.mark.parametrize("name", ["rolling_disk", "rolling_disk_six", "two_wheeler"])
def test_what_rolls_has_marks_off_its_axle_by_which_its_spin_is_seen(name):
    film = film_of_run(bc.simulate(name, duration=0.1))
    rolling = [body for body in film.bodies if body.name == "disk" or "wheel" in body.name]
    assert len(rolling) == (2 if name == "two_wheeler" else 1)
    for body in rolling:
        largest = max(shape.size[0] for shape in body.shapes if shape.kind == "cylinder")
        assert largest == 0.1 and len({shape.colour for shape in body.shapes}) == 3
        assert any(np.hypot(*np.take(shape.pose, [0, 2])) == pytest.approx(0.07) for shape in body.shapes)


def test_torsion_springs_axes_and_prismatic_springs_are_there():
    film = film_of_run(bc.simulate("four_bar", duration=0.5))
    assert [axis.name for axis in film.axes if axis.torsion_spring] == ["crank"] and len(film.axes) == 3
    run = bc.simulate("spring_pendulum", duration=1.0)
    (spring,) = (film := film_of_run(run)).springs
    length = np.linalg.norm(spring.ends[:, 1] - spring.ends[:, 0], axis=1)
    assert length == pytest.approx(np.interp(film.time, run.time, run.joint("slide").position), abs=1e-3)


def test_a_run_of_one_row_is_a_film_of_one_frame(four_bar):
    one = replace(four_bar, time=four_bar.time[:1], state=four_bar.state[:1], events=(), status=Status.FINISHED)
    film = film_of_run(one)
    check_film(film)
    assert len(film.time) == 1 and film.arrows[0].vectors.shape == (1, 3)


def test_a_run_is_shown_until_its_first_row_that_is_no_number(four_bar):
    state = four_bar.state.copy()
    state[100:, 1] = np.nan
    film = film_of_run(replace(four_bar, state=state, events=(), status=Status.FINISHED))
    check_film(film)
    assert film.time[-1] == four_bar.time[99] and any("finite" in note for note in film.notes)
    state[0, 0] = np.inf
    with pytest.raises(InputError, match="first state is not finite"):
        film_of_run(replace(four_bar, state=state))


def test_an_unknown_frame_to_trace_is_refused_with_what_there_is(four_bar):
    with pytest.raises(InputError, match=r"trace: unknown frame 'coupler_tp'; did you mean 'coupler_tip'"):
        film_of_run(four_bar, trace=["coupler_tp"])
    assert [trace.name for trace in film_of_run(four_bar, trace=["crank_link", "rocker_tip"]).traces] == [
        "crank_link", "rocker_tip",
    ]  # fmt: skip


# ---- motions and sizings


def test_a_sizing_plays_its_motions_one_after_the_other_with_its_torques_and_limits(sizing):
    film = film_of_sizing(sizing)
    check_film(film)
    first, second = sizing.inputs[1]
    assert film.time[-1] == pytest.approx(first.duration + GAP + second.duration)
    assert [mark.text for mark in film.events] == ["motion elbow_up begins", "motion elbow_down begins"]
    robot = sizing.inputs[0].robot
    late = film.time > first.duration + GAP / 2
    times = film.time[late] - first.duration - GAP
    k = [body.name for body in film.bodies].index("link_2")
    assert film.poses[late, k, :3] == pytest.approx(robot.frame_pose("link_2", second.at(times)[0])[0], abs=1e-12)
    motors = {arrow.name: arrow for arrow in film.arrows}
    assert np.abs(motors["shoulder motor"].vectors[:, 2]).max() == pytest.approx(242.27, abs=0.3)
    for chart in film.charts:
        assert len(chart.time) < 2010 and np.isnan(chart.lines[0].values).sum() == 1  # between the motions
    plane = next(plane for plane in film.xy_plots if plane.title.startswith("shoulder"))
    assert np.nanmax(np.abs(plane.y)) == pytest.approx(1.2 * sizing.joint("shoulder").shaft.peak_torque.value, rel=1e-3)
    assert np.isnan(plane.x).sum() == 1 and plane.limits[0][1][:, 1].max() == 7.1


def test_where_a_limit_is_exceeded_a_sizing_has_a_mark():
    config = bc.load_scene("planar_2r").config
    robot = config.robot()
    weak = {"shoulder": replace(config.actuators["shoulder"], rated_torque=0.1, peak_torque=0.5)}
    sizing = bc.size(robot, config.motion(robot, "elbow_down"), weak)
    marks = film_of_sizing(sizing).events
    worst = sizing.joint("shoulder").shaft.peak_torque
    assert any("shoulder exceeds its motor's peak torque" in m.text and m.time == worst.time for m in marks)


def test_a_motion_needs_its_own_robot(sizing):
    mechanism, (motion, _), _ = sizing.inputs
    robot = mechanism.robot
    film = film_of_motion(motion, robot)
    check_film(film)
    (trace,) = film.traces
    assert np.linalg.norm(trace.points - [1.2, 1.2, 0.0], axis=1) == pytest.approx(np.full(len(trace.time), 0.2))
    with pytest.raises(InputError, match="motion 'elbow_up' has the joints shoulder, elbow, but the robot"):
        film_of_motion(motion, bc.load_robot("four_bar"))


# ---- thinning


def smooth(seed, rows, bodies):
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.2, 1.0, rows)) / rows
    wave = rng.uniform(1.0, 40.0, (bodies, 3))
    points = np.sin(time[:, None, None] * wave + rng.uniform(0, 6, (bodies, 3)))
    half = rng.uniform(-20, 20, bodies) * time[:, None]
    axis = rng.normal(size=(bodies, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    turns = np.concatenate([np.sin(half)[..., None] * axis, np.cos(half)[..., None]], axis=2)
    points[rows // 2 :, 0] += rng.normal()  # a blow
    return time, points, turns, rng.uniform(0.0, 0.5, bodies)


@given(seed=st.integers(0, 2**32 - 1), rows=st.integers(2, 400), bodies=st.integers(1, 4), bound=st.floats(1e-4, 0.5))
@settings(max_examples=60, deadline=None)
def test_every_row_left_out_is_within_the_bound(seed, rows, bodies, bound):
    time, points, turns, reach = smooth(seed, rows, bodies)
    kept = frame_rows(time, points, turns, reach, bound, [rows // 3])
    assert kept[0] == 0 and kept[-1] == rows - 1 and rows // 3 in kept and np.all(np.diff(kept) > 0)
    every = np.setdiff1d(np.arange(rows), kept)
    k = np.clip(np.searchsorted(kept, every, side="right") - 1, 0, len(kept) - 2)
    assert interpolation_error(time, points, turns, reach, every, kept[k], kept[k + 1]).max(initial=0.0) <= bound


def test_the_error_is_that_of_points_and_a_bound_on_it():
    rng = np.random.default_rng(4)
    time, points, turns, reach = smooth(7, 400, 3)
    error = interpolation_error(time, points, turns, reach, np.arange(1, 9), np.zeros(8, int), np.full(8, 9))
    worst = np.zeros(8)
    for body in range(3):
        for _ in range(200):
            arm = rng.normal(size=3)
            arm *= reach[body] / np.linalg.norm(arm)
            s = (time[1:9] - time[0]) / (time[9] - time[0])
            back = turns[0, body] * [-1, -1, -1, 1]
            way = multiply(back, turns[9, body])
            angle = 2 * np.arctan2(np.linalg.norm(way[:3]), way[3])
            axis = way[:3] / np.linalg.norm(way[:3])
            part = np.concatenate([np.sin(s * angle / 2)[:, None] * axis, np.cos(s * angle / 2)[:, None]], axis=1)
            place = (1 - s)[:, None] * points[0, body] + s[:, None] * points[9, body]
            there = place + rotate(multiply(np.broadcast_to(turns[0, body], part.shape), part), arm)
            truth = points[1:9, body] + rotate(turns[1:9, body], arm)
            worst = np.maximum(worst, np.linalg.norm(there - truth, axis=1))
    assert np.all(worst <= error + 1e-12) and np.all(error < 3.0 * worst + 1e-9)


def test_an_even_motion_needs_two_frames_and_more_turns_need_more():
    time = np.linspace(0.0, 1.0, 1001)
    points = np.stack([time, 0 * time, 0 * time], axis=1)[:, None]
    for turn, most in ((1.0, 2), (30.0, 45)):
        half = 0.5 * turn * time
        turns = np.stack([0 * half, 0 * half, np.sin(half), np.cos(half)], axis=1)[:, None]
        assert 2 <= len(frame_rows(time, points, turns, np.ones(1), 1e-6)) <= most


@given(rows=st.integers(1, 5000), lines=st.integers(1, 6), most=st.integers(20, 2000), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_extremes_of_a_series_are_kept_with_its_ends(rows, lines, most, seed):
    rng = np.random.default_rng(seed)
    table = rng.normal(size=(rows, lines)).cumsum(axis=0)
    table[rng.integers(rows), 0] = 1e6  # a peak of one row
    table[rng.uniform(size=table.shape) < 0.01] = np.nan
    kept = extreme_rows(table, most)
    assert len(kept) <= max(most, 2 * lines + 2) and kept[0] == 0 and kept[-1] == rows - 1
    assert np.all(np.diff(kept) > 0)
    for line in table.T:
        if np.isfinite(line).any():
            assert np.nanmax(line) == np.nanmax(line[kept]) and np.nanmin(line) == np.nanmin(line[kept])


@given(rows=st.integers(2, 3000), lines=st.integers(1, 5), seed=st.integers(0, 2**32 - 1), bound=st.floats(1e-3, 1.0))
@settings(max_examples=40, deadline=None)
def test_every_row_left_out_of_a_line_is_within_its_own_bound_and_gaps_and_jumps_stay(rows, lines, seed, bound):
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.1, 1.0, rows))
    time[rows // 2] = time[rows // 2 - 1]  # a jump
    table = np.sin(time[:, None] * rng.uniform(0.001, 0.1, lines)) * 10.0 ** rng.integers(-3, 4, lines)
    table[rows // 2 :] += rng.normal(size=lines)
    table[rows // 5 : rows // 4, 0] = np.nan
    own = bound * np.nanmax(np.abs(table), axis=0, initial=1e-9)
    for k, kept in enumerate(line_rows(time, table, own, 10**9)):
        assert kept[0] == 0 and kept[-1] == rows - 1 and np.all(np.diff(kept) > 0)
        if abs(table[rows // 2, k] - table[rows // 2 - 1, k]) > 2 * own[k]:  # else one line may pass by both
            assert {rows // 2 - 1, rows // 2} <= set(kept)
        out = np.setdiff1d(np.arange(rows), kept)
        at = np.searchsorted(kept, out) - 1
        a, b = kept[at], kept[at + 1]
        share = np.divide(time[out] - time[a], time[b] - time[a], out=np.zeros(len(out)), where=time[b] > time[a])
        straight = table[a, k] + share * (table[b, k] - table[a, k])
        assert np.array_equal(np.isnan(table[out, k]), np.isnan(straight))
        assert np.nanmax(np.abs(table[out, k] - straight), initial=0.0) <= own[k] * (1 + 1e-9)


def test_between_sparse_rows_a_rolling_disk_is_where_a_finer_run_has_it():
    sparse, fine = (bc.simulate("rolling_disk", samples=n) for n in (501, 4001))
    film = film_of_run(sparse)
    assert not any("uncertain" in note for note in film.notes)
    centre = np.stack([np.interp(fine.time, film.time, film.poses[:, 0, c]) for c in range(3)], axis=1)
    assert np.abs(centre - fine.position[:, :3]).max() < 2.0 * film.error_bound
    mine, true = film.arrows[0], film_of_run(fine).arrows[0]
    force = np.array([np.interp(fine.time, mine.time, mine.vectors[:, c]) for c in range(3)]).T
    there = np.array([np.interp(fine.time, true.time, true.vectors[:, c]) for c in range(3)]).T
    assert np.abs(force - there).max() < 0.01 * np.abs(there).max()


def test_rows_too_far_apart_to_tell_how_something_turned_are_told_of():
    run = bc.simulate("rolling_disk", samples=31)
    assert any("turns by up to" in note and "more samples" in note for note in film_of_run(run).notes)


@pytest.mark.tier2
def test_a_run_that_flies_apart_gives_a_film_of_bounded_length(four_bar):
    state = four_bar.state.copy()
    state[-3:, 0] += (1e6, 1e12, 1e69)
    film = film_of_run(replace(four_bar, state=state, events=(), status=Status.FINISHED))
    assert len(film.time) < 300_000


@pytest.mark.tier2
def test_a_saved_run_keeps_the_meshes_of_its_robot(tmp_path):
    run = bc.simulate("ur5_falling", duration=0.1, samples=11)
    film = film_of_run(bc.load_run(run.save(tmp_path / "run.npz")))
    assert not any("not found" in note for note in film.notes)
    meshes = [sum(shape.mesh is not None for shape in body.shapes) for body in film.bodies]
    assert meshes == [sum(shape.mesh is not None for shape in body.shapes) for body in film_of_run(run).bodies]
    assert sum(meshes) >= 7


def test_a_body_that_turns_many_times_between_two_rows_is_not_shown_at_rest():
    robot = bc.load_robot("pendulum", gravity=(0, 0, 0))
    time = np.array([0.0, 1.0])
    q, v = np.array([[0.0], [8.0 * np.pi]]), np.full((2, 1), 8.0 * np.pi)
    frames = tuple(robot.urdf.links)
    course = SampledTrajectory(
        robot=robot,
        time=time,
        position=q,
        velocity=v,
        interpolate=smooth_between(robot.joints, time, q, v, np.zeros((2, 1))),
        frames=frames,
        pose_function=frame_pose_function(robot, frames),
        parameters=np.zeros(0),
    )
    dense = refine(course, [len(frames) - 1], np.ones(1), 1.0, 1e-3)
    assert np.diff(dense.position[:, 0]).max() < 0.8 and len(dense.time) > 32


def test_a_million_rows_are_thinned_to_the_same_few_frames_as_a_thousand():
    counts = []
    for rows in (1_001, 1_000_001):
        t = np.linspace(0.0, 5.0, rows)
        points = np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)[:, None]
        turns = np.stack([0 * t, 0 * t, np.sin(t / 2), np.cos(t / 2)], axis=1)[:, None]
        counts.append(len(frame_rows(t, points, turns, np.ones(1), 1e-3)))
    assert counts[0] <= counts[1] <= 1.3 * counts[0] < 130


# ---- rotations, extents and the camera


def test_quaternions_give_their_matrices_back_and_continue():
    rng = np.random.default_rng(0)
    turns = rng.normal(size=(500, 4))
    turns[:3] = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]  # half turns
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    found = from_matrices(rotation(turns))
    assert np.abs(rotation(found) - rotation(turns)).max() < 1e-14
    assert np.abs(np.abs(np.sum(found * turns, axis=1)) - 1.0).max() < 1e-14
    angle = np.linspace(0.0, 40.0, 400)
    spin = np.stack([0 * angle, np.sin(angle / 2), 0 * angle, np.cos(angle / 2)], axis=1)[:, None]
    assert np.sum(np.diff(make_continuous(from_matrices(rotation(spin))), axis=0) ** 2, axis=2).max() < 0.01


@pytest.mark.parametrize("kind", ["box", "cylinder", "sphere", "mesh"])
def test_an_outline_is_on_the_surface_and_reaches_as_far_as_the_shape_to_6_percent(kind):
    rng = np.random.default_rng(4)
    vertices = rng.normal(size=(500, 3)).astype(np.float32) * np.float32([1.0, 2.0, 0.5])
    size, half, reach = {  # half the extents, and how far the shape reaches in a direction
        "box": ((2.0, 0.2, 0.4), (1.0, 0.1, 0.2), lambda way: np.abs(way) @ [1.0, 0.1, 0.2]),
        "cylinder": ((0.3, 1.1), (0.3, 0.3, 0.55), lambda way: 0.3 * np.hypot(*way[:2]) + 0.55 * abs(way[2])),
        "sphere": ((0.7,), (0.7, 0.7, 0.7), lambda way: 0.7),
        "mesh": ((1.0, 1.0, 1.0), np.abs(vertices).max(axis=0), lambda way: (vertices @ way).max()),
    }[kind]
    pose, mesh = (1.0, 0.0, 0.0, 0.0, 0.0, 0.6, 0.8), Mesh(vertices, np.zeros((0, 3), np.int32))
    shape = DrawnShape(kind=kind, size=size, colour=(1,) * 4, pose=pose, mesh=mesh if kind == "mesh" else None)
    (points,) = outlines([DrawnBody("b", (shape,))])
    local = rotate(np.array([0.0, 0.0, -0.6, 0.8]), points - [1.0, 0.0, 0.0])
    for way in rng.normal(size=(200, 3)):
        way = way / np.linalg.norm(way)
        found = (local @ way).max()
        assert reach(way) - 0.06 * np.linalg.norm(way * half) <= found <= reach(way) * (1.0 + 1e-6)


@pytest.mark.parametrize("name", ["planar_2r", "runs", pytest.param("ur5", marks=pytest.mark.tier2)])
def test_the_whole_motion_is_in_view_and_in_its_middle(name, sizing, four_bar, disk):
    runs = name == "runs"
    results = [four_bar, disk] if runs else [sizing if name == "planar_2r" else bc.size(name)]
    for film in map(film_of_run if runs else film_of_sizing, results):
        tips = []
        for scale in arrow_scales(film):
            for arrow in (film.arrows[k] for k in scale.arrows):
                magnitudes = np.linalg.norm(arrow.vectors, axis=1)
                unit = arrow.vectors / np.maximum(magnitudes, 1e-300)[:, None]
                tips.append(arrow.points + unit * scale.lengths(magnitudes)[:, None])
        ends = [part.ends.reshape(-1, 3) for part in (*film.springs, *film.rods)]
        surfaces = world_corners(film.poses, outlines(film.bodies)).reshape(-1, 3)
        points = np.concatenate([surfaces, *tips, *ends, *(trace.points for trace in film.traces)])
        points = points[np.isfinite(points).all(axis=1)]
        eye, target, up = (np.array(x) for x in (film.camera.position, film.camera.target, film.camera.up))
        z = (eye - target) / np.linalg.norm(eye - target)
        x = np.cross(up, z) / np.linalg.norm(np.cross(up, z))
        seen = (points - eye) @ np.stack([x, np.cross(z, x), z], axis=1)
        across = seen[:, :2] / -seen[:, 2:] / [HALF_VIEW * ASPECT, HALF_VIEW]
        low, high = across.min(axis=0), across.max(axis=0)
        assert low.min() > -1.0 and high.max() < 1.0
        assert np.abs(low + high).max() < 0.12 and (high - low).max() > 1.6  # of 2, the height of the view


def test_a_box_of_corners_holds_a_turned_shape():
    quarter = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))
    body = DrawnBody(
        "b",
        (
            DrawnShape(kind="box", size=(2.0, 0.2, 0.4), colour=(1, 1, 1, 1), pose=(1.0, 0.0, 0.0, *quarter)),
            DrawnShape(kind="sphere", size=(0.1,), colour=(1,) * 4),
        ),
    )
    (corners,) = bounding_boxes([body])
    assert corners.min(axis=0) == pytest.approx([-0.1, -1.0, -0.2]) and corners.max(axis=0) == pytest.approx(
        [1.1, 1.0, 0.2]
    )
    assert world_corners(np.array([[[0, 0, 5, 0, 0, 0, 1.0]]]), [corners])[0, :, 2].max() == pytest.approx(5.2)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None)
def test_a_fitted_camera_sees_every_point_and_no_nearer_one_would(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(30, 3)) * rng.uniform(0.1, 10.0, 3) + rng.normal(size=3) * 5.0
    back = rng.normal(size=3)
    camera = fit_camera(points, back, np.array([0.0, 0.0, 1.0]))
    eye, target, up = (np.array(x) for x in (camera.position, camera.target, camera.up))
    z = (eye - target) / np.linalg.norm(eye - target)
    x = np.cross(up, z) / np.linalg.norm(np.cross(up, z))
    seen = (points - eye) @ np.stack([x, np.cross(z, x), z], axis=1)
    reach = np.abs(seen[:, :2] / -seen[:, 2:]) / [HALF_VIEW * ASPECT, HALF_VIEW]
    assert np.all(seen[:, 2] < 0.0) and reach.max() < 1.0 and reach.max() > 0.3


def test_planar_scenes_are_looked_at_square_on_with_gravity_down(four_bar, arm, disk):
    for run in (four_bar, arm):
        camera = film_of_run(run).camera
        way = np.subtract(camera.position, camera.target)
        assert camera.up == (0.0, 1.0, 0.0) and way[2] > 0.95 * np.linalg.norm(way)
    camera = film_of_run(disk).camera
    way = np.subtract(camera.position, camera.target)
    assert camera.up == (0.0, 0.0, 1.0) and 0.2 < way[2] / np.linalg.norm(way) < 0.6


def test_a_motion_out_of_its_plane_is_not_planar():
    t = np.linspace(0.0, 1.0, 20)
    turns = np.stack([np.sin(t / 2), 0 * t, 0 * t, np.cos(t / 2)], axis=1)
    poses = np.concatenate([np.stack([0 * t, t, t], axis=1), turns], axis=1)[:, None]
    scenery = CameraScene(
        points=poses[:, 0, :3], poses=poses, axes=np.zeros((0, 3)), gravity=np.array([0.0, 0.0, -9.81])
    )
    assert motion_plane_normal(scenery) == pytest.approx([1.0, 0.0, 0.0])
    assert choose_camera(scenery).up == (0.0, 0.0, 1.0) and choose_camera(scenery).position[0] > 0.0
    poses[:, 0, 0] = 0.1 * t
    assert motion_plane_normal(scenery) is None
