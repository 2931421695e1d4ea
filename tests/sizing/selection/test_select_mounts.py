"""A duty program and mounts through `select`: masses count once, where the actuators are."""

import numpy as np
import pytest
from actuator_bodies import cylinders
from sized_catalogue import sized_catalogue

import bellcrank as bc
from bellcrank.actuators.conditions import Conditions
from tests.support import actuator_bodies

pytestmark = pytest.mark.tier2

CONDITIONS = Conditions(voltage=48.0)
KEEP = {"shoulder": "motor_0000+gear_0000", "elbow": "motor_0001+gear_0001"}
DUTY = [{"motion": "reach", "repeat": 2}, {"pause": 3.0}]


def arm(*payloads):
    robot = bc.load_robot("planar_2r", gravity=(0.0, -9.81, 0.0)).with_payloads(payloads)
    return robot, [bc.waypoints(robot, [0.0, 1.5, 3.0], [{}, {"shoulder": 1.0, "elbow": -0.8}, {}], name="reach")]


def selected(mounts, *payloads):
    """The loads do not depend on whether the pairs, which are given, pass."""
    return bc.select(
        *arm(*payloads), sized_catalogue(11, 6, 3, largest=100.0), conditions=CONDITIONS, duty=DUTY, mounts=mounts,
        keep=KEEP, candidates=2,
    )  # fmt: skip


def bodies(found, mounts):
    """The bodies of the chosen pairs as payloads: at their mounts' origins, else at the joint on its parent link."""
    robot, payloads = arm()[0], []
    for one in found.axes:
        added, name = cylinders(one.chosen.motor, one.chosen.gear), one.axis.name
        figures = (added.mass, added.axial_inertia, added.transverse_inertia)
        if name in mounts:
            axis = mounts[name].axis or (0.0, 0.0, 1.0)
            payloads.append(actuator_bodies.body(mounts[name].link, *figures, axis))
        elif name == "elbow":
            payloads.append(actuator_bodies.payload_at_joint(robot, name, *figures))
    return payloads  # the shoulder's default mount is at rest


MOUNTS = [
    {"elbow": bc.Mount(link="base")},  # at rest: loads nothing
    {"elbow": bc.Mount(link="link_2")},  # carried by its own axis
    {"shoulder": bc.Mount(link="link_2")},  # a motor on another link that loads itself and the elbow
    {"elbow": bc.Mount(link="tip", axis=(1.0, 0.0, 0.0))},
]


@pytest.mark.parametrize("mounts", MOUNTS, ids=["base", "own link", "other link", "tip"])
def test_the_loads_are_those_of_a_robot_that_carries_the_chosen_actuators(mounts):
    found = selected(mounts)
    carried = [one for one in bodies(found, mounts) if one.frame != "base"]
    expected, without = bc.size(*arm(*carried)), bc.size(*arm())
    [cycle] = found.cycles
    assert cycle.name == "duty" and cycle.duration == pytest.approx(9.0) and cycle.weight[-1] == pytest.approx(3.0)
    for k, joint in enumerate(expected.joints):
        # the samples are placed for the masses of the URDF: the peak may lie next to one
        assert np.abs(cycle.torque[:, k]).max() == pytest.approx(joint.peak_torque, rel=1e-4)
        squares = 2 * 3.0 * joint.rms_torque**2 + 3.0 * cycle.torque[-1, k] ** 2
        assert cycle.weight @ cycle.torque[:, k] ** 2 == pytest.approx(squares, rel=1e-6)
    heavier = expected.joint("shoulder").peak_torque > without.joint("shoulder").peak_torque * 1.01
    assert heavier == (mounts.get("elbow", bc.Mount()).link != "base")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("length", [5e-324, 1e300])
def test_the_length_of_a_mounts_direction_does_not_matter(length):
    found = [selected({"elbow": bc.Mount(axis=(size, size, 0.0))}) for size in (1.0, length)]
    np.testing.assert_array_equal(*(one.cycles[0].torque for one in found))


def test_an_included_mass_is_not_counted_twice():
    """The URDF's link_2 carries the very actuator: stated as included it counts once, unstated twice."""
    mounts = {"elbow": bc.Mount(link="link_2")}
    plain = selected(mounts)
    added = cylinders(plain.axes[1].chosen.motor, plain.axes[1].chosen.gear)
    figures = (added.mass, added.axial_inertia, added.transverse_inertia)
    there = actuator_bodies.body("link_2", *figures, (0.0, 0.0, 1.0))
    names = ("included_mass", "included_axial_inertia", "included_transverse_inertia")
    included = {"elbow": bc.Mount(link="link_2", **dict(zip(names, figures, strict=True)))}
    once, twice = selected(included, there), selected(mounts, there)
    for first, second in zip(plain.axes, once.axes, strict=True):
        for one, other in zip(first.chosen.criteria, second.chosen.criteria, strict=True):
            assert other.use is None if one.use is None else other.use == pytest.approx(one.use, rel=1e-4)
    peaks = [np.abs(found.cycles[0].torque).max(axis=0) for found in (plain, once, twice)]
    assert peaks[1] == pytest.approx(peaks[0], rel=1e-4) and peaks[2][0] > peaks[0][0] * 1.01
