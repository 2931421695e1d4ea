"""Welds and hinges close with the correct orientation; constraints between fixed frames are reported."""

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.dynamics.constraints.constraint_alignment import full_angle_residuals
from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.errors import InputError
from bellcrank.scene.scene import load_scene
from bellcrank.simulation.integration.statistics import Status
from bellcrank.simulation.trajectory.scene_notes import scene_notes

ROBOT = """<robot name="chain"><link name="ground"/>
{links}
<joint name="a" type="continuous"><parent link="ground"/><child link="a"/><axis xyz="0 0 1"/></joint>
<joint name="b" type="{kind}"><parent link="a"/><child link="b"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/></joint>
<joint name="c" type="continuous"><parent link="b"/><child link="c"/><origin xyz="1 0 0"/><axis xyz="{axis}"/></joint>
<joint name="d" type="continuous"><parent link="c"/><child link="d"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/></joint>
</robot>"""
LINK = (
    '<link name="{}"><inertial><origin xyz="0.5 0 0"/><mass value="1"/>'
    '<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>'
)


@pytest.fixture
def chain(tmp_path):
    """A function that makes the scene of a chain of four links with these constraints."""

    def make(constraints, initial="{a: 0}", more="", axis="0 0 1"):
        links = "".join(LINK.format(name) for name in "abcd")
        (tmp_path / "chain.urdf").write_text(ROBOT.format(links=links, kind="continuous", axis=axis))
        listed = "\n".join(f"  - {constraint}" for constraint in constraints)
        (tmp_path / "scene.yaml").write_text(
            f"name: chain\nurdf: chain.urdf\ngravity: [0, -9.81, 0]\nframes:\n"
            "  tip: {link: d, xyz: [1, 0, 0]}\n  on_b: {link: b, xyz: [0.3, 0, 0]}\n"
            "  turned_on_b: {link: b, xyz: [0.3, 0, 0], rpy: [0, 0, 180 deg]}\n  on_ground: {link: ground}\n"
            f"constraints:\n{listed}\ninitial: {initial}\nsimulate: {{duration: 0.3, samples: 7}}\n{more}\n"
        )
        return load_scene(tmp_path / "scene.yaml")

    return make


GUESSES = (-10, 80, 100, 170, 179.999, 180, 181, 200, 260, -100, -200)
SHUT = ("{kind: weld, frame_a: b, frame_b: world, point: [1, 0, 0]}",
        "{kind: hinge, axis: [1, 0, 0], frame_a: b, frame_b: world, point: [1, 0, 0]}")  # fmt: skip


def angle_to_x(scene, frame, q):
    """By Pinocchio's own kinematics, rad."""
    _, rotation = scene.robot.frame_pose(frame, q)
    return np.arccos(np.clip(rotation[0, 0], -1.0, 1.0))


@pytest.mark.parametrize("constraint", SHUT, ids=["weld", "hinge"])
@pytest.mark.parametrize("guess", GUESSES)
def test_a_guess_at_any_angle_closes_with_the_frames_aligned(chain, constraint, guess):
    initial = f"{{a: {{guess: 10 deg}}, b: {{guess: {guess - 10} deg}}, c: 20 deg, d: 0}}"
    scene = chain([constraint], initial)
    q, _ = consistent_start(scene)
    assert angle_to_x(scene, "b", q) < 1e-7  # arccos near 1
    run = bc.simulate(scene)
    assert run.success and run.constraint_residual() < 1e-12


@pytest.mark.tier2
def test_a_weld_that_only_half_a_turn_closes_is_refused_by_name(chain):
    for kind in ("weld", "hinge, axis: [1, 0, 0]"):
        constraint = f"{{name: shut, kind: {kind}, frame_a: turned_on_b, frame_b: world, point: [1.3, 0, 0]}}"
        scene = chain([constraint], "{a: 0, b: 0}")
        with pytest.raises(InputError, match="'shut' can be satisfied only with its sides rotated by 180 deg"):
            bc.simulate(scene)


def test_the_residual_is_the_angle_and_not_its_sine(chain):
    scene = chain(["{name: shut, kind: weld, frame_a: b, frame_b: world, point: [1, 0, 0]}"], "{c: 20 deg}")
    angle = np.array([1e-9, 0.3, 1.5, 2.0, 3.0, np.pi])
    gap = np.zeros((len(angle), 3))  # x, y, rz
    gap[:, 2] = np.sin(angle)
    found = full_angle_residuals(scene, gap, np.cos(angle)[:, None])
    np.testing.assert_allclose(found[:, 2], angle, rtol=1e-7)


def test_a_run_whose_weld_is_turned_over_ends_and_names_it(chain, monkeypatch):
    scene = chain(["{name: shut, kind: weld, frame_a: b, frame_b: world, point: [1, 0, 0]}"], "{c: 20 deg}")
    whole = bc.simulate(scene)
    over = np.where(np.arange(len(whole)) < 4, 1.0, -1.0)[:, None]
    monkeypatch.setattr("bellcrank.simulation.integration.integration.alignment_cosines_along", lambda *_: over)
    run = bc.simulate(scene)
    assert run.status is Status.TURNED_OVER and not run.success
    assert len(run) == 4 and run.time[-1] == whole.time[3]
    assert "constraint 'shut'" in run.message and any("ended before" in text for text in run.warnings)


def test_closed_loops_in_space_with_a_hinge_start_the_right_way_round_from_any_guess(chain):
    hinge = "{name: shut, kind: hinge, frame_a: d, frame_b: world, point: [1.2, 0.8, 0]}"
    random = np.random.default_rng(4)
    for _ in range(12):
        a, b, c = random.uniform(-180, 180, 3)
        scene = chain([hinge], f"{{a: {{guess: {a} deg}}, b: {{guess: {b} deg}}, c: {{guess: {c} deg}}}}", axis="0 1 0")
        try:
            q, _ = consistent_start(scene)
        except InputError as error:
            assert "cannot be satisfied" in str(error) or "rotated by" in str(error)
            continue
        _, rotation = scene.robot.frame_pose("d", q)
        assert rotation[2, 2] > 1.0 - 1e-12


RIGID = {  # constraints between frames that cannot move against each other, and what is far from closing in them
    "point": ("{name: rigid, kind: point, frame_a: on_b, frame_b: turned_on_b}", None),
    "same link, turned": ("{name: rigid, kind: weld, frame_a: b, frame_b: on_b}", "x [N] has a residual of 0."),
    "the ground": ("{name: rigid, kind: weld, frame_a: on_ground, frame_b: world}", None),
    "the ground, elsewhere": ("{name: rigid, kind: point, frame_a: ground, frame_b: world, point: [0, 0, 1e-3]}",
                              "z [N] has a residual of 0.001"),
    "a rod's ends": ("{name: rigid, kind: distance, frame_a: b, frame_b: on_b, length: 0.3}", None),
    "a rod's ends, too far": ("{name: rigid, kind: distance, frame_a: b, frame_b: on_b, length: 0.4}", "push [N]"),
    "a joint's own axis": ("{name: rigid, kind: hinge, frame_a: a, frame_b: world}", None),
    "a formula of nothing": ("{name: rigid, kind: expression, expression: \"frame('on_ground').y\", unit: m}", None),
}  # fmt: skip


@pytest.mark.tier2
@pytest.mark.parametrize("alone", [True, False])
@pytest.mark.parametrize("case", RIGID)
def test_constraints_between_frames_that_cannot_move_are_refused_or_told_of(chain, case, alone):
    constraint, apart = RIGID[case]
    loop = "{name: loop, kind: point, frame_a: tip, frame_b: world, point: [2, 0.5, 0]}"
    scene = chain(
        [constraint] if alone else [loop, constraint], "{a: 70 deg, b: {guess: -80 deg}, c: {guess: -60 deg}}"
    )
    if apart is not None:
        with pytest.raises(InputError, match="'rigid' cannot hold: row") as refused:
            bc.simulate(scene)
        assert apart in str(refused.value) and "cannot move relative to each other" in str(refused.value)
        return
    run = bc.simulate(scene)
    assert run.success and run.warnings == () and run.constraint_residual() < 1e-12
    assert any("'rigid' does not depend on any joint" in note and "left out" in note for note in scene_notes(scene))
    assert np.abs(run.multipliers).max(initial=0.0) < 1e3


def test_a_free_base_held_where_its_weld_cannot_be_is_refused_and_held_at_the_weld_runs(chain):
    weld = "{name: rigid, kind: weld, frame_a: on_ground, frame_b: world, point: [0.1, 0, 0]}"
    free = "floating_base: true\nbase: {{position: [{}, 0, 0], rpy: [0, 0, 0]}}"
    with pytest.raises(InputError, match=r"of 'rigid'.*residuals: rigid 0\.1 m"):
        bc.simulate(chain([weld], more=free.format(0.0)))
    run = bc.simulate(chain([weld], more=free.format(0.1)))
    assert run.success and run.constraint_residual() < 1e-12 and np.abs(run.multipliers).max() < 1e3
