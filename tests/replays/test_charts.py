"""The plots of a page show what the run, or the motion, says at any time: every bundled page, and what jumps."""

from dataclasses import replace

import numpy as np
import pytest
from page_series import decoded, value_at

import bellcrank as bc
from bellcrank.files.bundled_data import folder
from bellcrank.motion.generators.waypoints import dwell
from bellcrank.motion.motion import join
from bellcrank.motion.sampled.resampling import SHARE
from bellcrank.replays.film import motion_film
from bellcrank.replays.film.charts import run_charts
from bellcrank.replays.film.film import Camera, Film
from bellcrank.replays.film.motion_film import GAP, film_of_motion
from bellcrank.replays.film.run_film import film_of_run
from bellcrank.replays.film.sizing_film import film_of_sizing
from bellcrank.replays.geometry.shapes import DrawnBody
from bellcrank.replays.page.film_encoding import encode_film
from bellcrank.replays.page.page import write_page
from bellcrank.simulation.trajectory.plot_panels import linear_panels, shown_unit
from bellcrank.sizing.loads.joint_histories import SampledStates, joint_torques

pytest_plugins = ("browser",)
SOLVED = 1e-7  # of the largest value of a unit: what the solver's own interpolation is off between its steps
NAMES = sorted(path.stem for path in folder("robots").glob("*.yaml"))
HUGE = "n_four_bar_40"  # takes a minute to compile; n_four_bar_2 is the same in small
COUNT = 200  # random times


def bare(charts):
    """A film of charts and nothing else."""
    render_still = np.array([[[0, 0, 0, 0, 0, 0, 1.0]]])
    return Film(
        title="series",
        time=np.zeros(1),
        poses=render_still,
        bodies=(DrawnBody("b", ()),),
        camera=Camera((1, 0, 0), (0, 0, 0), (0, 0, 1)),
        error_bound=1e-3,
        charts=charts,
    )


def charts_of(page):
    """(title, unit, line) -> line, with its chart's bound, of the charts that go straight between rows."""
    return {
        (chart["title"], chart["unit"], line["name"]): {**line, "tolerance": chart["tolerance"]}
        for chart in page["charts"] if not chart["logarithmic"] for line in chart["lines"]
    }  # fmt: skip


def compared(lines, truth, times):
    """Fail where a line of a page is further off than the page says; how many were looked at."""
    sizes = {}
    for (_, unit, _), values in truth.items():
        sizes[unit] = max(sizes.get(unit, 0.0), float(np.abs(values).max()))
    for key, line in lines.items():
        _, unit, _ = key
        values = truth[key]
        assert line["tolerance"] is not None, key
        span = np.ptp(np.concatenate([line["values"][np.isfinite(line["values"])], values]))
        off = np.abs(value_at(line, times) - values)
        allowed = line["tolerance"] * span + SOLVED * sizes[unit]
        assert off.max() <= allowed, (key, off.max() / max(span, 1e-300), times[off.argmax()])
    return len(lines)


# Fast and small, so that the rows do not say what is between them: the finger's velocity in panda_held is of the size
# of the solver's tolerance, a joint of xarm7 settles before the second row, manutec_axis's current within 0.2 ms,
# where rows are 1.8 ms apart. Their pages are compared at the rows.
UNRESOLVED = ("manutec_axis", "panda_held", "xarm7")


def simulated(run, times):
    """The run's own scene at other times: every line's values there."""
    again = bc.simulate(run.scene, duration=float(run.settings.duration), times=times)
    again = replace(again, time=again.time[: len(times)], state=again.state[: len(times)])  # an event may add its row
    assert np.array_equal(again.time, times)
    return named(again)


def named(run):
    """(title, unit, line) -> values, of all lines of a run."""
    return {
        (panel.title.removesuffix(f", {shown_unit(panel.unit)}"), shown_unit(panel.unit), name): values
        for panel in linear_panels(run)
        for name, values in panel.lines
    }


def looked_up(lines, truth):
    """Lines by the titles of the truth: a page adds the drift of energy to a title."""
    return {
        (("energy" if title.startswith("energy") else title), unit, name): line
        for (title, unit, name), line in lines.items()
    }


@pytest.mark.tier2
@pytest.mark.parametrize("name", [name for name in NAMES if name != HUGE])
def test_every_bundled_run_is_shown_as_it_is_at_random_times(name):
    run, rng = bc.simulate(name), np.random.default_rng(5)
    lines = charts_of(decoded(encode_film(bare(run_charts(run)[0]))))
    if name in UNRESOLVED:
        k = np.sort(rng.integers(0, len(run), COUNT))
        times, truth = run.time[k], {key: values[k] for key, values in named(run).items()}
    else:
        times = np.sort(rng.uniform(0.0, run.time[-1], COUNT))
        truth = simulated(run, times)
    assert compared(looked_up(lines, truth), truth, times) >= 3
    assert max(line["tolerance"] for line in lines.values()) == SHARE


def test_twist_of_a_gear_and_rotor_velocity_are_shown_as_they_are_at_random_times():
    run, rng = bc.simulate("manutec_axis"), np.random.default_rng(5)
    lines = charts_of(decoded(encode_film(bare(run_charts(run)[0]))))
    times = np.sort(rng.uniform(0.0, run.time[-1], COUNT))
    names = ("gear output", "twist", "rotor velocity")  # what the current loop does within 0.2 ms does not move them
    slow = {key: line for key, line in looked_up(lines, {}).items() if key[2].endswith(names)}
    truth = {key: value for key, value in simulated(run, times).items() if key in slow}
    assert compared(slow, truth, times) == 3


def sized(name):
    config = bc.load_scene(name).config
    if "delta" in name:  # the tool's path is that of a closed linkage
        return bc.size(name)
    robot = config.robot()
    return bc.size(robot, [config.motion(robot, each) for each in config.motions], config.actuators)


SIZED = [name for name in NAMES if bc.load_scene(name).config.motions]


@pytest.fixture
def no_meshes(monkeypatch):
    """Films of bodies without shapes: meshes take seconds, and no plot shows them."""
    monkeypatch.setattr(
        motion_film, "film_bodies", lambda robot, detail: (tuple(DrawnBody(link, ()) for link in robot.urdf.links), ())
    )


@pytest.mark.tier2
@pytest.mark.parametrize("name", SIZED)
def test_every_bundled_sizing_is_shown_as_its_motions_are_at_random_times(name, no_meshes):
    sizing = sized(name)
    mechanism, motions, actuators = sizing.inputs
    robot = mechanism.robot
    page = decoded(encode_film(film_of_sizing(sizing)))
    lines, rng, start = charts_of(page), np.random.default_rng(6), 0.0
    joints = [joint for joint in robot.joints if joint.nv == 1]
    for motion in motions:
        times = np.sort(rng.uniform(0.0, motion.duration, COUNT)) + motion.time[0]
        q, v, a = motion.at(times)
        shown = times - motion.time[0] + start + (motion.time[0] if len(motions) == 1 else 0.0)
        for joint in joints:
            values = {"position": q[:, joint.q], "velocity": v[:, joint.v], "acceleration": a[:, joint.v]}
            values["joint torque"] = values["joint force"] = joint_torques(
                mechanism, [joint], actuators, SampledStates(times, q, v, a)
            )[:, 0]
            mine = {key: line for key, line in lines.items() if key[2] == joint.name}
            assert len(mine) >= 3
            for (title, unit, _), line in mine.items():
                span = np.nanmax(line["values"]) - np.nanmin(line["values"])
                size = max(
                    np.nanmax(np.abs(other["values"])) for key, other in lines.items() if key[:2] == (title, unit)
                )
                off = np.abs(value_at(line, shown) - values[title]).max()
                assert off <= line["tolerance"] * span + 1e-9 * size, (joint.name, title)
        start += motion.duration + GAP
    assert all(plane["tolerance"] == SHARE for plane in page["xy_plots"])


# ---- what jumps


def cycle(robot):
    """A circle at one speed, a rest, the circle again, and a rest: velocities and accelerations jump at each seam."""
    way = bc.circle(robot, "tip", (1.2, 1.2, 0.0), 0.2, duration=1.5, start={"elbow": -1.0}, samples=301)
    rest = dwell(robot, way.position[-1], 2.75)
    return join(way, rest, way, replace(rest, time=np.array([0.0, 0.5])), name="cycle")


def test_a_dwell_between_motions_is_shown_at_rest_with_the_torque_that_holds_it(no_meshes):
    robot = bc.load_scene("planar_2r").config.robot()
    motion = cycle(robot)
    page = decoded(encode_film(film_of_motion(motion, robot)))
    lines = charts_of(page)
    times = np.sort(np.concatenate([np.random.default_rng(7).uniform(0.0, motion.duration, 2000), [2.0, 4.2, 6.0]]))
    q, v, a = motion.at(times)
    torque = robot.inverse_dynamics(q, v, a)
    for k, joint in enumerate(("shoulder", "elbow")):
        for title, unit, values in (
            ("joint torque", "N m", torque),
            ("acceleration", "rad/s²", a),
            ("velocity", "rad/s", v),
        ):
            line = lines[title, unit, joint]
            span = np.ptp(line["values"])
            assert np.isfinite(line["values"]).all()
            assert np.abs(value_at(line, times) - values[:, k]).max() <= SHARE * span * (1 + 1e-6)
    twice = lines["joint torque", "N m", "shoulder"]["time"]
    seams = motion.time[np.flatnonzero(np.diff(motion.time) == 0.0)]
    assert len(seams) >= 3
    for seam in seams:
        assert (np.abs(twice - seam) < 1e-8).sum() == 2  # both sides
    arrow = next(arrow for arrow in page["arrows"] if arrow["name"] == "shoulder motor")
    for t in (2.0, 3.3, 4.2):  # arrows are frames no longer: they hold while nothing moves
        z = value_at({"time": arrow["time"], "values": arrow["vectors"][:, 2]}, np.array([t]))
        assert z == pytest.approx(robot.inverse_dynamics(*motion.at(np.array([t])))[:, 0], rel=1e-3)
    plane = page["xy_plots"][0]
    for values, key in ((v[:, 0], "x"), (torque[:, 0], "y")):
        off = np.abs(value_at({"time": plane["time"], "values": plane[key]}, times) - values)
        assert off.max() <= SHARE * np.ptp(plane[key]) * (1 + 1e-6)


TABLE = """
name: Arm under a table
urdf: planar_2r
gravity: [0, -9.81, 0]
initial: {shoulder: -80 deg, elbow: 20 deg}
forces: [{name: motor, kind: torque, joint: elbow, file: motor.csv, interpolation: hold}]
outputs: {push: {force: motor}}
simulate: {duration: 2, samples: 101, rtol: 1.0e-10, atol: 1.0e-10}
"""


@pytest.fixture(scope="module")
def held(tmp_path_factory):
    """A run under torques that jump between its rows, and at one of them."""
    where = tmp_path_factory.mktemp("held")
    steps = [(0, 0), (0.313, 40), (0.317, -25), (0.9999, 10), (1.2, 55.5), (1.61, 0)]
    (where / "motor.csv").write_text("time [s],elbow torque [N m]\n" + "".join(f"{t},{x}\n" for t, x in steps))
    (where / "arm.yaml").write_text(TABLE)
    return bc.simulate(where / "arm.yaml"), np.array(steps, dtype=float)


def test_torques_that_are_held_jump_in_a_page_where_they_do_and_nothing_else_is_bent_by_it(held, tmp_path):
    run, steps = held
    film = film_of_run(run)
    page = decoded(encode_film(film))
    lines = charts_of(page)
    times = np.sort(np.concatenate([np.random.default_rng(8).uniform(0.0, 2.0, 1000), [0.315, 0.318, 0.9998, 1.199]]))
    truth = simulated(run, times)
    compared(looked_up(lines, truth), truth, times)
    torque = lines["joint torque", "N m", "elbow"]
    for t, before, after in zip(steps[1:, 0], steps[:-1, 1], steps[1:, 1], strict=True):
        assert value_at(torque, np.array([t - 1e-6, t + 1e-6])) == pytest.approx([before, after], abs=1e-6)
        assert (np.abs(torque["time"] - t) < 1e-7).sum() == 2
    arrow = next(arrow for arrow in page["arrows"] if arrow["name"] == "elbow motor")
    line = {"time": arrow["time"], "values": arrow["vectors"][:, 2]}
    assert value_at(line, np.array([0.3129, 0.315, 0.32])) == pytest.approx([0.0, 40.0, -25.0], abs=1e-3)


def test_pictures_of_a_run_step_where_torques_do(held):
    run, steps = held
    figure = bc.plot(run)
    (axis,) = [axis for axis in figure.axes if axis.get_title(loc="left").startswith("joint torque")]
    elbow = next(line for line in axis.get_lines() if line.get_label() == "elbow")
    t, x = elbow.get_xdata(), elbow.get_ydata()
    for at, before, after in zip(steps[1:, 0], steps[:-1, 1], steps[1:, 1], strict=True):
        k = np.searchsorted(t, at)
        assert t[k] == at and t[k] - t[k - 1] < 1e-12 and (x[k - 1], x[k]) == pytest.approx((before, after))


def test_a_coarse_run_is_shown_on_the_curve_through_its_rows(no_meshes):
    coarse, times = bc.simulate("planar_2r", duration=2.0, samples=101), np.linspace(0.003, 1.997, 300)
    lines = charts_of(decoded(encode_film(bare(run_charts(coarse)[0]))))
    truth = simulated(coarse, times)
    assert compared(looked_up(lines, truth), truth, times) > 6


@pytest.mark.tier2
def test_a_million_rows_make_a_small_page_whose_series_are_right():
    base = bc.simulate("pendulum", duration=10.0, samples=11)
    run = bc.simulate("pendulum", duration=10.0, samples=1_000_001)
    text = encode_film(bare(run_charts(run)[0]))
    assert len(text[1]) < 200_000 and len(base) == 11
    lines = charts_of(decoded(text))
    k = np.random.default_rng(9).integers(0, len(run), 500)
    off = np.abs(value_at(lines["position", "rad", "swing"], run.time[k]) - run.position[k, 0])
    assert off.max() <= SHARE * np.ptp(run.position)


def test_what_cannot_be_told_in_so_few_numbers_is_said_to_be_extremes():
    run = bc.simulate("pendulum", duration=1.0, samples=200_001)
    noisy = run.state.copy()
    noisy[:, 1] = np.random.default_rng(0).normal(size=len(noisy))
    charts = {chart.title: chart for chart in run_charts(replace(run, state=noisy))[0]}
    assert charts["velocity"].tolerance is None or charts["velocity"].tolerance > SHARE
    assert len(charts["velocity"].time) < 20_000


# ---- in a browser


@pytest.mark.tier2
def test_the_page_reads_off_what_is_true_in_a_dwell_and_after_a_zoom_its_playhead_stays_with_its_time(
    open_page, tmp_path, no_meshes
):
    robot = bc.load_scene("planar_2r").config.robot()
    motion = cycle(robot)
    page = open_page(write_page(film_of_motion(motion, robot), tmp_path / "cycle.html"), size=(1280, 800))
    page.tab.wait_for_selector(".chart .playhead")

    def legend(title):
        section = page.tab.locator("section.chart", has=page.tab.locator("b", has_text=title)).first
        return [float(text.replace("\u2212", "-")) for text in section.locator("output").all_text_contents()]

    for t in (0.7, 1.4999, 2.0, 4.2, 6.0):
        page.do("b.seek(x)", t)
        want = robot.inverse_dynamics(*motion.at(np.array([t])))[0]
        page.tab.wait_for_function("t => document.querySelector('.bar span').textContent.includes(t.toFixed(3))", arg=t)
        assert legend("joint torque") == pytest.approx(want, rel=2e-3, abs=0.3), t
    line = """() => { const u = document.querySelector('.chart .playhead');
              const [own, box] = [u, u.parentElement].map((each) => each.getBoundingClientRect());
              return [own.left + own.width / 2 - box.left, box.width]; }"""
    over = page.tab.locator(".chart .u-over").first.bounding_box()
    page.do("b.seek(x)", 3.0)
    span = motion.duration
    at, width = page.tab.evaluate(line)
    assert at / width == pytest.approx(3.0 / span, abs=0.01)
    page.tab.mouse.move(over["x"] + 0.25 * over["width"], over["y"] + 60)
    page.tab.keyboard.down("Control")
    page.tab.mouse.wheel(0, -300)
    page.tab.keyboard.up("Control")
    low, high = 0.25 * span * (1 - np.exp(-0.6)), 0.25 * span + 0.75 * span * np.exp(-0.6)
    page.tab.wait_for_timeout(300)
    at, width = page.tab.evaluate(line)
    assert at / width == pytest.approx((3.0 - low) / (high - low), abs=0.02)
    assert page.clean
