"""Starts that Gauss-Newton steps do not reach, joints that are held, and what is said where there is no start."""

import numpy as np
import pytest
from scipy.optimize import least_squares

import bellcrank as bc
from bellcrank.dynamics.constraints.constraint_rows import rows_of, velocity_units
from bellcrank.dynamics.constraints.mobility import _jacobian, _null_space
from bellcrank.dynamics.equations.system import system_parameters
from bellcrank.dynamics.postures.consistent_start import (
    consistent_postures,
    consistent_start,
    given_posture,
    start_failure,
    starts_further_away,
)
from bellcrank.dynamics.postures.posture_search import Constrained, StartCode
from bellcrank.dynamics.postures.start_diagnosis import constraint_gaps
from bellcrank.simulation.trajectory.scene_notes import scene_notes
from tests.support.random_mechanisms import random_mechanism

LINK = (
    '<link name="{0}"><inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>'
    "</inertial></link>"
)
ARM = '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin xyz="{3} 0 0"/>'
ARM += '<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>{4}'


def arms(folder, constraints, apart, tilt=0.0, start=""):
    """Two arms of two links of 1 m each, `apart` m from base to base; one tip is tilted out of the plane, rad."""
    joints = "".join(
        ARM.format(f"{side}_{k}", "ground" if k == 1 else f"{side}_1", f"{side}_{k}", x if k == 1 else 1.0,
                   LINK.format(f"{side}_{k}"))
        for side, x in (("left", 0.0), ("right", apart)) for k in (1, 2)
    )  # fmt: skip
    (folder / "arms.urdf").write_text(f'<robot name="arms">{LINK.format("ground")}{joints}</robot>')
    (folder / "arms.yaml").write_text(
        "name: Arms\nurdf: arms.urdf\ngravity: [0, 0, 0]\nactuated: [left_1]\n"
        "frames: {left: {link: left_2, xyz: [1, 0, 0]}, right: {link: right_2, xyz: [1, 0, 0], "
        f"rpy: [{tilt}, 0, 0]}}}}\n"
        f"constraints: [{constraints}]\n{start}"
    )
    return bc.load_scene(folder / "arms.yaml")


TIP = "{name: tip, kind: point, frame_a: left, frame_b: right}"


def test_the_gap_of_arms_that_are_too_short_is_what_their_lengths_leave(tmp_path):
    scene = arms(tmp_path, TIP, 4.5, start="initial: {left_2: {guess: 0.3}, right_1: {guess: 2}}")
    failure = start_failure(scene)
    (gap,) = failure.gaps
    assert gap.constraint == "tip"
    assert gap.distance == pytest.approx(0.5, abs=1e-6)  # 4.5 m between the bases, and 2 + 2 m of links
    with pytest.raises(bc.InputError, match=r"cannot be satisfied with nothing held: .* of 'tip'.*tip 0.5 m"):
        consistent_start(scene)


def test_a_loop_that_cannot_close_is_named_and_the_others_close_without_it(tmp_path):
    far = "{name: reach, kind: distance, frame_a: left, frame_b: world, point: [0, 9, 0], length: 1}"
    failure = start_failure(arms(tmp_path, f"{TIP}, {far}", 2.0))
    assert failure.never == failure.openings == ("reach",)
    assert failure.as_points == ()


def test_of_two_loops_that_exclude_each_other_either_may_be_open(tmp_path):
    posts = [f"{{name: {n}, kind: point, frame_a: left, frame_b: world, point: [0, {y}, 0]}}" for n, y in
             (("upper", 1.0), ("lower", -1.0))]  # fmt: skip
    failure = start_failure(arms(tmp_path, ", ".join([TIP, *posts]), 1.5))
    assert failure.never == ()
    assert failure.openings == ("upper", "lower")
    assert "the other constraints can be satisfied if one of these is open: upper, lower" in failure.sentences()


def test_a_weld_between_tilted_axes_closes_as_a_point(tmp_path):
    weld = "{name: tip, kind: weld, frame_a: left, frame_b: right}"
    failure = start_failure(arms(tmp_path, weld, 2.0, tilt=0.3))
    assert failure is not None and failure.as_points == ("tip",)
    assert np.degrees(min(gap.angle for gap in failure.gaps)) <= np.degrees(0.3) + 1e-6  # as the tips can be in line
    assert start_failure(arms(tmp_path, TIP, 2.0, tilt=0.3)) is None


@pytest.mark.tier2
@pytest.mark.parametrize("seed", [4, 14, 44, 70, 78, 85, 93, 183, 214])
def test_starts_that_gauss_newton_steps_do_not_reach(seed, tmp_path):
    """Further searches find them, as least squares by SciPy from the posture at which the loops were closed would."""
    mechanism = random_mechanism(seed, tmp_path)
    scene = mechanism.scene
    assert starts_further_away(scene)
    q = consistent_start(scene)[0]
    assert max(gap.size for gap in constraint_gaps(scene, q)) < 1e-10
    (note,) = [note for note in scene_notes(scene) if "found further away" in note]
    moved = np.abs(q - given_posture(scene))
    assert f"joint '{scene.robot.joints[int(moved.argmax())].name}' moves most, by {moved.max():.3g}" in note
    np.testing.assert_array_equal(q, consistent_start(bc.load_scene(scene.source))[0])  # the same in every run


def test_the_start_is_brought_near_the_given_posture(tmp_path):
    """No posture on the branch that a small step leads to is nearer: the gradient of the distance is across it."""
    scene = random_mechanism(78, tmp_path).scene
    q, given = consistent_start(scene)[0], given_posture(scene)
    units = velocity_units(scene)
    free = _null_space(_jacobian(scene, q, np.zeros(scene.robot.nv)))
    away = (q - given) / units
    assert np.linalg.norm(free.T @ away) < 0.02 * np.linalg.norm(away)


def test_motors_are_held_where_initial_says_so(tmp_path):
    free = arms(tmp_path, TIP, 2.5, start="initial: {left_2: {guess: 0.4}, right_1: {guess: 1.5}, right_2: {guess: 1}}")
    held = free.with_overrides({"initial.hold": "motors"})
    assert abs(consistent_start(free)[0][free.robot.joint("left_1").q]) > 1e-3
    q = consistent_start(held)[0]
    assert q[held.robot.joint("left_1").q] == 0.0
    assert max(gap.size for gap in constraint_gaps(held, q)) < 1e-12
    two = free.with_overrides({"initial.hold": ["left_1", "right_1"], "initial.left_1": 0.5})
    q = consistent_start(two)[0]
    assert q[two.robot.joint("left_1").q] == 0.5
    assert q[two.robot.joint("right_1").q] == 1.5 or "right_1" in two.initial.guesses
    for wrong, text in (("all", r"hold: expected motors or a list of joints, found 'all'"), (["left_9"], "left_9")):
        with pytest.raises(bc.InputError, match=text):
            free.with_overrides({"initial.hold": wrong})


@pytest.mark.tier2
def test_least_squares_by_scipy_finds_no_start_either_where_none_is_found(tmp_path):
    weld = "{name: tip, kind: weld, frame_a: left, frame_b: right}"
    scene = arms(tmp_path, weld, 2.0, tilt=0.3)

    def residuals(q):
        return [part for gap in constraint_gaps(scene, q) for part in (gap.distance, gap.angle)]

    random = np.random.default_rng(0)
    best = min(least_squares(residuals, random.uniform(-3, 3, 4)).cost for _ in range(20))
    assert best > 1e-4
    assert start_failure(scene) is not None


def test_an_ensemble_finds_the_starts_that_lone_designs_find(tmp_path, monkeypatch):
    """In several blocks; with all joints held none has a start."""
    scene = random_mechanism(4, tmp_path).scene
    monkeypatch.setattr("bellcrank.dynamics.postures.consistent_start.BLOCK", 2)
    rows = rows_of(scene)
    designs = Constrained(np.tile(system_parameters(scene), (5, 1)), rows.unit[None], np.array([rows.length]))
    given = np.tile(given_posture(scene), (5, 1))
    found, verdicts = consistent_postures(scene, designs, given, np.zeros(scene.robot.nv, dtype=bool), threads=2)
    assert (verdicts.code == StartCode.CONSISTENT).all()
    np.testing.assert_array_equal(found, np.tile(consistent_start(scene)[0], (5, 1)))
    found, verdicts = consistent_postures(scene, designs, given, np.ones(scene.robot.nv, dtype=bool))
    assert (verdicts.code == StartCode.UNSATISFIED).all()
