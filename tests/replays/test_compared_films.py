"""Two films over each other: each moves as it does alone, and nothing of either is lost."""

import dataclasses

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.replays.film.camera import ASPECT, HALF_VIEW
from bellcrank.replays.film.compared_films import compared_films
from bellcrank.replays.film.film import check_film
from bellcrank.replays.replay import film_of


@pytest.fixture(scope="module")
def films():
    """A pendulum, and the same that starts elsewhere and ends earlier."""
    one = bc.simulate("pendulum", duration=2.0)
    two = bc.simulate("pendulum", duration=1.3, overrides={"initial.swing": 0.4})
    return film_of(one), film_of(two, title="other")


def poses_between(film, time):
    """The poses at a time by SciPy's spherical interpolation, one body after another."""
    from scipy.spatial.transform import Rotation, Slerp

    time = min(time, film.time[-1])
    found = []
    for k in range(len(film.bodies)):
        points = [np.interp(time, film.time, film.poses[:, k, c]) for c in range(3)]
        turn = Slerp(film.time, Rotation.from_quat(film.poses[:, k, 3:]))(time).as_quat()
        found.append([*points, *turn])
    return np.array(found)


def test_each_moves_as_it_does_alone(films):
    both = compared_films(*films)
    check_film(both)
    count = len(films[0].bodies)
    assert both.time[-1] == films[0].time[-1] and set(films[1].time) <= set(both.time)
    for film, part in ((films[0], slice(None, count)), (films[1], slice(count, None))):
        for row in range(0, len(both.time), 7):
            alone, here = poses_between(film, both.time[row]), both.poses[row, part]
            np.testing.assert_allclose(here[:, :3], alone[:, :3], atol=1e-12)
            np.testing.assert_allclose(np.abs((here[:, 3:] * alone[:, 3:]).sum(axis=1)), 1.0, atol=1e-12)


def test_nothing_of_either_is_lost_and_the_second_is_tinted(films):
    one, two = films
    both = compared_films(one, two)
    assert both.title == f"{one.title} and other"
    assert [body.name for body in both.bodies] == [
        *(b.name for b in one.bodies),
        *(f"other: {b.name}" for b in two.bodies),
    ]
    assert all(shape.colour[3] < 0.5 for body in both.bodies[len(one.bodies) :] for shape in body.shapes)
    assert [chart.title for chart in both.charts] == [chart.title for chart in one.charts]
    for chart, a, b in zip(both.charts, one.charts, two.charts, strict=True):
        assert [line.name for line in chart.lines] == [
            *(x.name for x in a.lines),
            *(f"other: {x.name}" for x in b.lines),
        ]
        for line, whole in zip(chart.lines[len(a.lines) :], b.lines, strict=True):
            np.testing.assert_array_equal(line.values, whole.values)
            np.testing.assert_array_equal(line.time, b.time if whole.time is None else whole.time)
    assert len(both.axes) == len(one.axes) + len(two.axes) and len(both.arrows) == len(one.arrows) + len(two.arrows)
    assert any("other ends at 1.3 s and stands still" in note for note in both.notes)
    assert {f"other: {name}" for name, _ in two.facts} <= {name for name, _ in both.facts}


def test_charts_of_other_quantities_stand_by_themselves_and_verdicts_count(films):
    one, two = films
    strange = dataclasses.replace(two.charts[0], title="something else")
    both = compared_films(one, dataclasses.replace(two, charts=(strange,), success=False))
    assert [chart.title for chart in both.charts] == [*(c.title for c in one.charts), "other: something else"]
    assert not both.success


def test_the_camera_sees_both(films):
    one, two = films
    far = dataclasses.replace(two, poses=two.poses + np.eye(7)[0] * 3.0)
    both = compared_films(one, far)
    position, target = np.array(both.camera.position), np.array(both.camera.target)
    axis = (target - position) / np.linalg.norm(target - position)
    right = np.cross(axis, both.camera.up)
    right /= np.linalg.norm(right)
    seen = both.poses[..., :3].reshape(-1, 3) - position
    depth = seen @ axis
    assert (np.abs(seen @ np.cross(right, axis)) < HALF_VIEW * depth).all()
    assert (np.abs(seen @ right) < HALF_VIEW * ASPECT * depth).all()


def test_a_page_of_two_runs_is_written_by_python_and_by_the_command(tmp_path, capsys):
    from bellcrank.cli import main

    one, two = bc.simulate("pendulum", duration=0.5), bc.simulate("pendulum", duration=0.4)
    for run, name in ((one, "a"), (two, "b")):
        run.save(tmp_path / f"{name}.npz")
    page = bc.replay(one, tmp_path / "python.html", over=two, title="Both")
    assert "<title>Both</title>" in page.read_text(encoding="utf-8")
    out = tmp_path / "command.html"
    assert main(["replay", str(tmp_path / "a.npz"), str(tmp_path / "b.npz"), "--out", str(out)]) == 0
    assert "<title>a and b</title>" in out.read_text(encoding="utf-8")
    assert capsys.readouterr().out.count("the whole duration was simulated") == 2
    with pytest.raises(bc.InputError, match="over"):
        bc.replay(one, tmp_path / "x.html", over=3)
