"""The replay of a fastest motion: the active limit at each time, its joint, and the phase plane."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.replays.film.fastest_film import active_limits, film_of_fastest


@pytest.fixture(scope="module")
def fastest() -> bc.results.FastestMotion:
    return bc.time_optimal("planar_2r", "elbow_up")


@pytest.mark.tier2
def test_each_time_has_the_limit_that_is_active_in_its_cell(fastest: bc.results.FastestMotion) -> None:
    film = film_of_fastest(fastest)
    starts = [limit.time for limit in film.limits]
    assert starts[0] == fastest.motion.time[0]
    assert np.all(np.diff(starts) > 0.0)
    length = np.diff(fastest.time)
    middle = fastest.time[:-1] + length / 2.0
    shown = [film.limits[int(np.searchsorted(starts, t, side="right")) - 1] for t in middle]
    wrong = sum(d for d, limit, name in zip(length, shown, fastest.active, strict=True) if limit.text != name)
    assert wrong < 2e-3 * fastest.duration * len(film.limits)  # limits active for an instant are not named
    for limit in film.limits:
        assert film.axes[limit.axis].name == limit.text.rpartition(" of ")[2]


@pytest.mark.tier2
def test_limits_of_a_frame_have_no_axis(fastest: bc.results.FastestMotion) -> None:
    robot = bc.load_robot("planar_2r", friction="none")
    limits = bc.MotionLimits(speed="none", torque="none", tool="tip", tool_acceleration=3.0)
    found = bc.time_optimal(robot, bc.joint_path(robot, [{}, {"elbow": 1.0}]), limits, costs=False)
    assert [(each.text, each.axis) for each in active_limits(found, film_of_fastest(fastest).axes)] == [
        ("acceleration of frame tip", -1)
    ]


def test_the_phase_plane_is_below_the_largest_speed(fastest: bc.results.FastestMotion) -> None:
    plot = film_of_fastest(fastest).xy_plots[0]
    assert plot.title == "path speed over path"
    ((_, curve),) = plot.limits
    top = np.interp(plot.x, curve[:-2, 0], curve[:-2, 1])
    assert np.all(plot.y <= top * (1.0 + 1e-2) + 1e-2 * plot.y.max())


def test_a_page_needs_no_robot_and_names_the_limits(fastest: bc.results.FastestMotion, tmp_path: Path) -> None:
    page = bc.replay(fastest, tmp_path / "fastest.html")
    text = Path(str(page)).read_text(encoding="utf-8")
    assert '"limits":[{"time":' in text
    assert "torque of shoulder" in text
