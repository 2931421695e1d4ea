"""Sizing of trees of many joints: the worst posture is found, and memory does not grow with their square."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.robot.dynamics.articulated_inertia import _pivots
from bellcrank.robot.robot import Robot
from bellcrank.sizing import holding_gravity
from bellcrank.sizing.holding_gravity import gravity_holding_torques
from bellcrank.sizing.loads import motion_grid
from bellcrank_bench.problems.urdf_texts import chain

pytestmark = pytest.mark.tier2

G = 9.81
LINK, MASS = 0.1, 0.2  # m, kg


def urdf(count: int, parents: list[int], axes: Any, places: Any, levers: Any, kinds: list[str]) -> str:
    inertia = '<inertia ixx="1e-3" iyy="2e-3" izz="3e-3" ixy="0" ixz="0" iyz="0"/>'
    parts = ['<robot name="many"><link name="l0"/>']
    for k in range(1, count + 1):
        axis, place, lever = (" ".join(f"{x:.17g}" for x in rows[k - 1]) for rows in (axes, places, levers))
        low, high = (-0.1, 0.2) if kinds[k - 1] == "prismatic" else (-2.5, 2.5)
        parts.append(
            f'<link name="l{k}"><inertial><mass value="{MASS}"/><origin xyz="{lever}"/>{inertia}</inertial></link>'
            f'<joint name="j{k}" type="{kinds[k - 1]}"><parent link="l{parents[k - 1]}"/><child link="l{k}"/>'
            f'<origin xyz="{place}" rpy="0.0 0.0 0.0"/><axis xyz="{axis}"/>'
            f'<limit lower="{low}" upper="{high}" effort="100" velocity="10"/></joint>'
        )
    return "\n".join(parts) + "</robot>"


def long_chain(tmp_path: Path, count: int, second_axis: tuple[float, float, float]) -> Robot:
    """A chain along x whose odd joints turn about y, the even ones about another axis; CGs in the links' middles."""
    path = tmp_path / "chain.urdf"
    axes = [(0.0, 1.0, 0.0) if k % 2 == 0 else second_axis for k in range(count)]
    places = [(0.0, 0.0, 0.0), *[(LINK, 0.0, 0.0)] * (count - 1)]
    levers = [(LINK / 2, 0.0, 0.0)] * count
    path.write_text(urdf(count, list(range(count)), axes, places, levers, ["revolute"] * count))
    return bc.load_robot(path)


def random_tree(tmp_path: Path, count: int, seed: int) -> Robot:
    """A branching tree of turning and a few sliding joints."""
    random = np.random.default_rng(seed)
    axes = random.normal(size=(count, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    kinds = ["prismatic" if k % 5 == 3 else "revolute" for k in range(count)]
    parents = [0, *(int(random.integers(max(0, k - 3), k)) + 1 for k in range(1, count))]
    path = tmp_path / "tree.urdf"
    path.write_text(urdf(count, parents, axes, *(0.1 * random.normal(size=(2, count, 3))), kinds))
    return bc.load_robot(path, gravity=(2.0, -3.0, -9.0))


def test_a_long_chain_is_held_stretched_out_horizontally(tmp_path: Path) -> None:
    count = 64
    found = gravity_holding_torques(long_chain(tmp_path, count, (0.0, 0.0, 1.0)))
    distances = LINK * (np.arange(count) + 0.5)
    stretched = MASS * G * np.array([distances[: count - k].sum() for k in range(count)])
    assert np.all(found.torque <= stretched * (1 + 1e-12))  # no posture needs more
    # A joint about z holds as much: one before it turns its axis to the horizontal, and it the rest of the chain.
    np.testing.assert_allclose(found.torque, stretched, rtol=1e-6)
    np.testing.assert_allclose(found.torque[::2], stretched[::2], rtol=1e-9)
    assert found.notes == ()


@pytest.mark.parametrize("tolerance", [0.0, 0.2])
def test_passes_along_a_tree_find_what_the_search_by_all_torques_finds(
    tmp_path: Path, tolerance: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = random_tree(tmp_path, 14, seed=5)
    by_all = gravity_holding_torques(robot, mass_tolerance=tolerance)
    monkeypatch.setattr(holding_gravity, "MANY", 4)
    by_passes = gravity_holding_torques(robot, mass_tolerance=tolerance)
    scale = by_all.torque.max()
    # Sweeps of the search by all torques end before it has settled to 1e-6; masses that are set in turn with the
    # coordinates may end at a lower torque, which a note says.
    least = 1e-6 if tolerance == 0.0 else 1e-3
    assert np.all(by_passes.torque >= by_all.torque * (1.0 - least) - 1e-9 * scale)
    assert np.all(by_passes.torque <= by_all.torque * (1.0 + 1e-4) + 1e-9 * scale)
    assert any("larger ones may exist" in note for note in by_passes.notes) == (tolerance > 0.0)
    for k, posture in enumerate(by_passes.position):  # the posture told needs as much, by inverse dynamics
        shares = robot.link_gravity_torques(posture)[:, k]
        needed = abs(shares.sum()) + tolerance * np.abs(shares).sum()
        assert needed == pytest.approx(by_passes.torque[k], rel=1e-11, abs=1e-13 * scale)
        assert np.all((posture >= robot.lower) & (posture <= robot.upper))


def test_fewer_starts_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = urdf(2, [0, 1], [(0, 1, 0)] * 2, [(0, 0, 0), (1, 0, 0)], [(0.5, 0, 0)] * 2, ["revolute"] * 2)
    path = tmp_path / "follow.urdf"
    path.write_text(text.replace('<limit lower="-2.5" upper="2.5" effort="100" velocity="10"/></joint></robot>',
                                 '<limit lower="-2.5" upper="2.5" effort="100" velocity="10"/>'
                                 '<mimic joint="j1" multiplier="0"/></joint></robot>'))  # fmt: skip
    robot = bc.load_robot(path)
    whole = gravity_holding_torques(robot)
    monkeypatch.setattr(holding_gravity, "MANY", 0)
    fewer = gravity_holding_torques(robot)
    assert whole.notes == () and "from 2 postures a joint instead of 48" in fewer.notes[0]
    np.testing.assert_allclose(fewer.torque, MASS * G * (0.5 + 1.5), rtol=1e-12)


def test_the_diagonal_of_the_mass_matrix_grows_with_the_joints_and_is_that_of_the_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = random_tree(tmp_path, 14, seed=6)
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (5, 14))
    whole = np.diagonal(robot.mass_matrix(q), axis1=1, axis2=2)
    monkeypatch.setattr("bellcrank.robot.robot.LARGEST_WHOLE", 4)
    np.testing.assert_allclose(robot.inertia_diagonal(q), whole, rtol=1e-13)
    np.testing.assert_allclose(robot.inertia_diagonal(q[2]), whole[2], rtol=1e-13)
    from bellcrank.robot.dynamics.equations import inertia_diagonal

    counts = []
    for links in (6, 12, 24):
        (tmp_path / "c.urdf").write_text(chain(links))
        counts.append(inertia_diagonal(bc.load_robot(tmp_path / "c.urdf").equations.tree).n_instructions())
    assert counts[2] - counts[1] == pytest.approx(2 * (counts[1] - counts[0]), rel=0.05)


def test_a_sizing_looks_at_few_states_at_a_time_and_blocks_do_not_change_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = random_tree(tmp_path, 6, seed=7)
    stops = np.random.default_rng(2).uniform(-0.1, 0.1, (3, 6))
    motion = bc.waypoints(robot, [0.0, 0.6, 1.3], stops, samples=41)
    whole = bc.size(robot, motion)
    looked: list[int] = []
    inverse_dynamics = Robot.inverse_dynamics

    def counted(self: Robot, q: Any, v: Any, a: Any) -> Any:
        looked.append(len(np.atleast_2d(q)))
        return inverse_dynamics(self, q, v, a)

    monkeypatch.setattr(Robot, "inverse_dynamics", counted)
    monkeypatch.setattr(motion_grid, "BLOCK_NUMBERS", 6 * 200)
    blocks = bc.size(robot, motion)
    assert max(looked) <= 3 * 200
    for one, other in zip(whole.joints, blocks.joints, strict=True):
        assert one.cycles == other.cycles and one.holding_torque == other.holding_torque
        assert {k: p.value for k, p in one.peaks.items()} == pytest.approx(
            {k: p.value for k, p in other.peaks.items()}, rel=1e-13
        )


def test_a_robot_of_too_many_joints_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        bc.InputError, match=r"has 2001 joints that move, expected at most 2000; leave some out, or make them fixed"
    ):
        long_chain(tmp_path, 2001, (0.0, 0.0, 1.0))


def test_eliminating_joints_that_do_not_carry_each_other_gives_the_pivots_of_the_dense_matrix(tmp_path: Path) -> None:
    """The pivots are 1/(M⁻¹)_kk of the leading blocks: det of the trailing block from k on, over that from k + 1 on."""
    robot = random_tree(tmp_path, 30, 4)
    matrix = robot.mass_matrix(np.random.default_rng(1).normal(size=30))
    logs = [np.linalg.slogdet(matrix[k:, k:])[1] for k in range(30)] + [0.0]
    np.testing.assert_allclose(_pivots(matrix), np.exp(-np.diff(logs)), rtol=1e-9)
