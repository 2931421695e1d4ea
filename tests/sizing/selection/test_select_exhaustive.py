"""`select` with feedback of masses equals the exhaustive search over all joints at once."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from actuator_bodies import cylinders
from sized_catalogue import sized_catalogue

import bellcrank as bc
from bellcrank.actuators.conditions import Conditions
from bellcrank.dynamics.inverse.mechanism import mechanism_of
from bellcrank.sizing.selection.axis_loads import AddedMass
from bellcrank.sizing.selection.axis_loads_of import axis_loads
from bellcrank.sizing.selection.judge import judge
from bellcrank.sizing.selection.load_reductions import reduce_loads
from bellcrank.sizing.selection.pairs import Pairs
from bellcrank.sizing.selection.pareto_search import non_dominated

pytestmark = pytest.mark.tier2

OBJECTIVES = ("mass", "cost", "loss", "margin")


def arm_2r():
    arm = bc.load_robot("planar_2r")
    return arm, [bc.waypoints(arm, [0.0, 1.5, 3.0], [{}, {"shoulder": 1.0, "elbow": -0.8}, {}], name="reach")]


def arm_3r(folder):
    """A turning column, an upper arm and a forearm."""
    links = "".join(
        f"""<link name="l{k}"><inertial><origin xyz="0 0 {0.0 if k == 1 else 0.2}"/><mass value="{4 - k}"/>
        <inertia ixx="0.05" iyy="0.05" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
        for k in (1, 2, 3)
    )
    joints = "".join(
        f"""<joint name="j{k}" type="revolute"><parent link="l{k - 1}"/><child link="l{k}"/><origin xyz="0 0 {z}"/>
        <axis xyz="{axis}"/><limit lower="-3" upper="3" effort="500" velocity="9"/></joint>"""
        for k, z, axis in ((1, 0.1, "0 0 1"), (2, 0.1, "0 1 0"), (3, 0.4, "0 1 0"))
    )
    (folder / "arm.urdf").write_text(f'<robot name="arm"><link name="l0"/>{links}{joints}</robot>')
    arm = bc.load_robot(folder / "arm.urdf")
    poses = [{"j2": 0.5, "j3": 0.5}, {"j1": 0.9, "j2": 1.1, "j3": 0.9}, {"j2": 0.5, "j3": 0.5}]
    return arm, [bc.waypoints(arm, [0.0, 2.0, 4.0], poses, name="reach")]


def loaded(loads, rows):
    """The cycles where each axis carries the body of its pair."""
    added = {}
    for axis, (motor, gear) in zip(loads.axes, rows, strict=True):
        one = cylinders(motor, gear)
        added[axis.name] = AddedMass(
            mass=one.mass, axial_inertia=one.axial_inertia, transverse_inertia=one.transverse_inertia
        )
    return reduce_loads(loads.axes, loads.with_masses(added))


class Exhaustive:
    """Every combination under the loads of its own masses: totals of those in which every axis passes."""

    def __init__(self, arm, motions, catalogues, conditions):
        loads = axis_loads(mechanism_of(arm), motions)
        every = [Pairs.possible(one.motors, one.gears, "rotary") for one in catalogues]
        self.points, self.ids = [], []
        known = {}
        for combination in itertools.product(*(range(len(pairs)) for pairs in every)):
            rows = [pairs.rows(pair) for pairs, pair in zip(every, combination, strict=True)]
            points = []
            for axis, pair in enumerate(combination):
                key = (axis, tuple(combination[j] for j in np.flatnonzero(loads.influence[axis])))
                if key not in known:
                    known[key] = self.judged(every[axis], loaded(loads, rows)[axis], conditions)
                if known[key][pair] is None:
                    break
                points.append(known[key][pair])
            else:
                mass, cost, loss, use = zip(*points, strict=True)
                self.points.append((math.fsum(mass), max(use), math.fsum(loss), math.fsum(cost)))
                self.ids.append(tuple(m.id if g.kind == "direct" else f"{m.id}+{g.id}" for m, g in rows))

    @staticmethod
    def judged(pairs, loads, conditions):
        found = judge(pairs, loads, conditions)
        points = []
        for number in range(len(pairs)):
            motor, gear = pairs.rows(number)
            point = (
                motor.mass + gear.mass,
                motor.price + (gear.price or 0.0),
                found.loss[number],
                found.largest_use[number],
            )
            points.append(point if found.tier[number] == 0 else None)
        return points

    def best(self, objective):
        column = {"mass": 0, "margin": 1, "loss": 2, "cost": 3}[objective]
        return min(point[column] for point in self.points)


def total(selection, objective):
    if objective == "margin":
        return max(one.chosen.largest_use for one in selection.axes)
    return getattr(selection, objective)


@pytest.fixture(scope="module")
def two_joints():
    arm, motions = arm_2r()
    catalogue = sized_catalogue(11, 10, 5, largest=100.0)  # one in which the feedback of masses changes the choice
    conditions = Conditions(voltage=48.0)
    return arm, motions, catalogue, conditions, Exhaustive(arm, motions, [catalogue] * 2, conditions)


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_two_joints_with_50_pairs_equal_the_exhaustive_search(two_joints, objective):
    arm, motions, catalogue, conditions, exhaustive = two_joints
    assert len(exhaustive.points) > 20
    selection = bc.select(arm, motions, catalogue, objective, conditions=conditions, effort=10**7)
    assert selection.proof.startswith("optimal")
    # what is chosen is sampled at its own largest uses and zeros with its own masses, every combination at those of the
    # bare arm: uses between samples are larger, and losses bend at other zeros
    bound = {"margin": 1e-5, "loss": 5e-7}.get(objective, 1e-9)
    assert total(selection, objective) == pytest.approx(exhaustive.best(objective), rel=bound)
    assert tuple(one.chosen.id for one in selection.axes) in exhaustive.ids


@pytest.fixture(scope="module")
def three_joints(tmp_path_factory):
    arm, motions = arm_3r(tmp_path_factory.mktemp("arm"))
    catalogue = sized_catalogue(3, 5, 3, largest=60.0)
    conditions = Conditions(voltage=48.0)
    return arm, motions, catalogue, conditions, Exhaustive(arm, motions, [catalogue] * 3, conditions)


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_three_joints_equal_the_exhaustive_search(three_joints, objective):
    arm, motions, catalogue, conditions, exhaustive = three_joints
    assert len(exhaustive.points) > 20
    selection = bc.select(arm, motions, catalogue, objective, conditions=conditions, effort=10**7, candidates=1)
    assert selection.proof.startswith("optimal")
    # what is chosen is sampled at its own largest uses and zeros with its own masses, every combination at those of the
    # bare arm: uses between samples are larger, and losses bend at other zeros
    bound = {"margin": 1e-5, "loss": 5e-7}.get(objective, 1e-9)
    assert total(selection, objective) == pytest.approx(exhaustive.best(objective), rel=bound)
    assert tuple(one.chosen.id for one in selection.axes) in exhaustive.ids


def test_the_masses_matter(two_joints):
    arm, motions, catalogue, conditions, _ = two_joints
    found = [
        bc.select(arm, motions, catalogue, "margin", conditions=conditions, feedback=on, candidates=1)
        for on in (True, False)
    ]
    heavy, light = ([one.chosen for one in each.axes] for each in found)
    assert [one.id for one in heavy] != [one.id for one in light]
    assert heavy[0].largest_use > light[0].largest_use


def test_the_pareto_front_equals_that_of_all_combinations(two_joints):
    arm, motions, catalogue, conditions, exhaustive = two_joints
    selection = bc.select(arm, motions, catalogue, conditions=conditions, effort=10**7)
    assert selection.pareto_proof.startswith("all combinations")
    points = np.array(exhaustive.points)
    expected = points[non_dominated(points)]
    found = np.array([(p.mass, p.largest_use, p.loss, p.cost) for p in selection.pareto])
    assert len(found) == len(expected) > 3
    for point in found:
        assert np.isclose(expected, point, rtol=1e-9).all(axis=1).any()


def dominated(points):
    """By definition, pair by pair."""
    return [any((other <= point).all() and (other < point).any() for other in points) for point in points]


def test_non_dominated_points_are_those_of_the_definition():
    points = np.random.default_rng(0).integers(0, 5, (300, 4)).astype(float)
    rows = non_dominated(points)
    expected = {tuple(point) for point, out in zip(points, dominated(points), strict=True) if not out}
    assert {tuple(point) for point in points[rows]} == expected
    assert len(rows) == len(expected)
