"""`select` over linkages equals every combination under the linkage's inverse dynamics with actuators as payloads."""

import itertools

import numpy as np
import pytest
from actuator_bodies import cylinders
from sized_catalogue import sized_catalogue

import bellcrank as bc
from bellcrank.actuators.conditions import Conditions
from bellcrank.sizing.selection.axis_loads_of import axis_loads
from bellcrank.sizing.selection.judge import judge
from bellcrank.sizing.selection.load_reductions import reduce_loads
from bellcrank.sizing.selection.pairs import Pairs
from bellcrank.sizing.sizing_subject import sizing_subject
from tests.support import actuator_bodies

pytestmark = pytest.mark.tier2

CONDITIONS = Conditions(voltage=48.0, inertia_ratio=300.0)  # the rotors are light
MOUNTS = {  # where motors move; that of the five-bar loads both axes, that of the four-bar its own axis
    "five_bar": {"right_motor": bc.Mount(link="left_forearm")},
    "four_bar": {"crank": bc.Mount(link="coupler_link")},
}


def loaded(name, motor, gear):
    """The mechanism and motions with the body of the last axis's pair as a payload at its mount."""
    [mount], one = MOUNTS[name].values(), cylinders(motor, gear)
    payload = actuator_bodies.body(mount.link, one.mass, one.axial_inertia, one.transverse_inertia, (0.0, 0.0, 1.0))
    subject = sizing_subject(name, None, [payload])
    return subject.mechanism, subject.motions


def exhaustive(name, catalogue):
    """Mass, loss and largest use of every combination of which all criteria are shown, by its pairs."""
    pairs = Pairs.possible(catalogue.motors, catalogue.gears, "rotary")
    found, under = {}, []
    for number in range(len(pairs)):
        loads = axis_loads(*loaded(name, *pairs.rows(number)))
        under.append([judge(pairs, each, CONDITIONS) for each in reduce_loads(loads.axes, loads.cycles)])
    for combination in itertools.product(range(len(pairs)), repeat=len(under[0])):
        rows, judged = [pairs.rows(pair) for pair in combination], under[combination[-1]]
        if all(one.tier[pair] == 0 for one, pair in zip(judged, combination, strict=True)):
            ids = tuple(m.id if g.kind == "direct" else f"{m.id}+{g.id}" for m, g in rows)
            found[ids] = {
                "mass": sum(motor.mass + gear.mass for motor, gear in rows),
                "loss": sum(one.loss[pair] for one, pair in zip(judged, combination, strict=True)),
                "margin": max(one.largest_use[pair] for one, pair in zip(judged, combination, strict=True)),
            }
    return found


@pytest.fixture(
    scope="module",
    params=[
        ("five_bar", 5, 3, 1, 1.5),
        ("four_bar", 2, 6, 3, 8.0, "gear_0000", "gear_0001", "motor_0003", "motor_0004", "motor_0005"),
    ],
    ids=lambda p: p[0],
)
def problem(request):
    name, seed, motors, gears, largest, *exclude = request.param
    catalogue = sized_catalogue(seed, motors, gears, largest=largest).filtered(exclude=exclude)
    return name, catalogue, exhaustive(name, catalogue)


@pytest.mark.parametrize("objective", ["mass", "loss", "margin"])
def test_the_choice_is_the_best_of_all_combinations(problem, objective):
    name, catalogue, every = problem
    assert every
    found = bc.select(name, None, catalogue, objective, conditions=CONDITIONS, mounts=MOUNTS[name], effort=10**7)
    ids = tuple(one.chosen.id for one in found.axes)
    assert found.proof.startswith("optimal") and ids in every
    assert every[ids][objective] == pytest.approx(min(one[objective] for one in every.values()), rel=1e-9)
    assert every[ids]["margin"] == pytest.approx(max(one.chosen.largest_use for one in found.axes), rel=1e-9)
    assert every[ids]["loss"] == pytest.approx(found.loss, rel=1e-9)


def test_the_loads_are_those_of_size(problem):
    name, catalogue, _ = problem
    found = bc.select(name, None, catalogue, conditions=CONDITIONS, mounts=MOUNTS[name], candidates=1)
    chosen = found.axes[-1].chosen
    sizing, bare = bc.size(*loaded(name, chosen.motor, chosen.gear)), bc.size(name)
    for k, (one, joint) in enumerate(zip(found.axes, sizing.joints, strict=True)):
        assert one.axis.name == joint.name
        for cycle, stated in zip(found.cycles, joint.cycles, strict=True):
            # the samples are placed for the masses of the URDF: the peak may lie next to one
            assert np.abs(cycle.torque[:, k]).max() == pytest.approx(joint.peak_torque, rel=1e-5)
            rms = np.sqrt(cycle.weight @ cycle.torque[:, k] ** 2 / cycle.duration)
            assert rms == pytest.approx(stated.rms_torque, rel=1e-6)
        assert abs(joint.peak_torque / bare.joints[k].peak_torque - 1.0) > 1e-4  # the actuators' masses count
