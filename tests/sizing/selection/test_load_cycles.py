"""Cycles of duty programs, and their torques against Pinocchio, bellcrank.size and closed forms."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

import bellcrank as bc
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.dynamics.inverse.mechanism import mechanism_of
from bellcrank.errors import InputError
from bellcrank.motion.motion_entry import DutyStep, checked_duty
from bellcrank.sizing.selection.axis_loads import AddedMass
from bellcrank.sizing.selection.axis_loads_of import axis_loads
from bellcrank.sizing.sizing_subject import sizing_subject


def arm_and_motions(friction="urdf"):
    arm = bc.load_robot("planar_2r", gravity=(0.0, -9.81, 0.0), friction=friction)
    there = bc.waypoints(arm, [0.0, 1.0], [{}, {"elbow": 1.0, "shoulder": 0.4}], samples=101, name="there")
    back = bc.waypoints(arm, [0.0, 0.5], [{"elbow": 1.0, "shoulder": 0.4}, {}], samples=101, name="back")
    return arm, [there, back]


def squares(cycle):
    return cycle.weight @ cycle.torque**2


# ---- against other routes


@pytest.mark.tier2
@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_torques_are_those_of_pinocchio_without_rotors_and_with_added_bodies(name):
    subject = sizing_subject(name, None)
    mechanism, motions = subject.mechanism, subject.motions
    robot = mechanism.robot
    loads = axis_loads(mechanism, motions[:1])
    bodies = {axis.name: AddedMass(mass=1.0 + k, axial_inertia=0.01, transverse_inertia=0.02 + 0.01 * k)
              for k, axis in enumerate(loads.axes)}  # fmt: skip
    for added in ({}, bodies):
        [cycle] = loads.with_masses(added)
        model = pin.Model(robot.model)
        model.armature[:] = 0.0
        for joint, one in added.items():
            number = model.getJointId(joint)
            axis = robot.joint_axis(joint)
            inertia = one.transverse_inertia * np.eye(3)
            inertia += (one.axial_inertia - one.transverse_inertia) * np.outer(axis, axis)
            body = pin.Inertia(one.mass, np.zeros(3), inertia)
            model.appendBodyToJoint(model.parents[number], body, model.jointPlacements[number])
        data, rows = model.createData(), slice(0, None, 37)
        friction = robot.friction_torque(cycle.speed[rows])
        states = zip(cycle.position[rows], cycle.speed[rows], cycle.acceleration[rows], strict=True)
        expected = np.array([pin.rnea(model, data, *state) for state in states]) + friction
        assert np.abs(cycle.torque[rows] - expected).max() < 1e-9 * np.abs(expected).max()
        held = np.array([pin.computeGeneralizedGravity(model, data, q) for q in cycle.position[rows]])
        assert np.abs(cycle.static_torque[rows] - held).max() < 1e-9 * np.abs(held).max()
        felt = np.array([np.diag(pin.crba(model, data, q)) for q in cycle.position[rows]])
        assert np.abs(cycle.inertia[rows] - felt).max() < 1e-9 * felt.max()


@pytest.mark.tier2
@pytest.mark.parametrize("name", ["ur5", "geared_pendulum", "planar_2r", "xarm7", "five_bar", "four_bar"])
def test_peaks_and_integrals_are_those_of_size(name):
    subject = sizing_subject(name, None)
    loads, sizing = axis_loads(subject.mechanism, subject.motions), bc.size(name)
    for k, joint in enumerate(sizing.joints):
        scale = max(joint.peak_torque, 1e-9)
        assert max(abs(cycle.torque[:, k]).max() for cycle in loads.cycles) == pytest.approx(joint.peak_torque, 1e-9)
        assert max(abs(cycle.speed[:, k]).max() for cycle in loads.cycles) == pytest.approx(
            joint.peak_speed, 1e-9, 1e-9
        )
        for found, expected in (
            (max(cycle.inertia[:, k].max() for cycle in loads.cycles), joint.largest_inertia),
            (max(cycle.tilting_moment[:, k].max() for cycle in loads.cycles), joint.peak_tilting_moment),
        ):
            assert found == pytest.approx(expected, rel=1e-4, abs=1e-9)
            assert found <= expected * (1.0 + 1e-9) + 1e-12
        for cycle, stated in zip(loads.cycles, joint.cycles, strict=True):
            assert cycle.duration == stated.duration
            rms = np.sqrt(cycle.weight @ cycle.torque[:, k] ** 2 / cycle.duration)
            assert rms == pytest.approx(stated.rms_torque, rel=1e-6, abs=1e-9 * scale)
            mean = cycle.weight @ np.abs(cycle.speed[:, k]) / cycle.duration
            assert mean == pytest.approx(stated.mean_speed, rel=1e-6, abs=1e-9)  # slower is at rest
            power = cycle.torque[:, k] * cycle.speed[:, k]
            energy = cycle.weight @ np.maximum(power, 0.0)
            assert energy == pytest.approx(stated.motoring_energy, rel=1e-4, abs=1e-6 * scale + 1e-9)


def test_a_pendulum_in_closed_form():
    """τ = J q̈ + friction + the torque of gravity, a sinusoid of the angle, for q = A sin ω t; and its mean square."""
    robot = bc.load_robot("pendulum")
    time = np.linspace(0.0, 2.0, 401)
    size, rate = 0.7, np.pi
    q, v, a = size * np.sin(rate * time), size * rate * np.cos(rate * time), -size * rate**2 * np.sin(rate * time)
    motion = bc.Motion(robot.joints, time, q[:, None], v[:, None], a[:, None], "swing")
    [cycle] = axis_loads(mechanism_of(robot), [motion]).cycles
    lever = robot.gravity_torque(np.array([[0.0], [np.pi / 2]]))[:, 0]  # cosine and sine part of the gravity torque
    inertia = float(robot.mass_matrix([0.0])[0, 0])
    x = size * np.sin(rate * cycle.time)
    exact = -inertia * size * rate**2 * np.sin(rate * cycle.time) + lever[0] * np.cos(x) + lever[1] * np.sin(x)
    exact += robot.friction_torque(size * rate * np.cos(rate * cycle.time)[:, None])[:, 0]
    assert np.abs(cycle.torque[:, 0] - exact).max() < 1e-8 * np.abs(exact).max()
    assert cycle.inertia == pytest.approx(inertia)
    fine = np.linspace(0.0, 2.0, 200_001)[:-1]  # the trapezoidal rule converges fast for a periodic function
    x = size * np.sin(rate * fine)
    torque = -inertia * rate**2 * x + lever[0] * np.cos(x) + lever[1] * np.sin(x)
    torque += robot.friction_torque(size * rate * np.cos(rate * fine)[:, None])[:, 0]
    assert squares(cycle)[0] == pytest.approx(2.0 * np.mean(torque**2), rel=1e-7)


def test_the_energy_of_a_closed_cycle_is_what_friction_takes():
    viscous = {"shoulder": (0.3, 0.0), "elbow": (0.2, 0.0)}
    for friction, coefficients in (("none", np.zeros(2)), (viscous, np.array([0.3, 0.2]))):
        arm, motions = arm_and_motions(friction)
        [cycle] = axis_loads(mechanism_of(arm), motions, checked_duty(["there", "back", {"pause": 1.0}])).cycles
        work = cycle.weight @ (cycle.torque * cycle.speed).sum(axis=1)
        lost = cycle.weight @ (cycle.speed**2 @ coefficients)
        assert work == pytest.approx(lost, abs=1e-9 * np.abs(cycle.torque).max())


def test_rotors_of_the_robot_are_not_part_of_the_loads():
    arm, motions = arm_and_motions()
    geared = bc.load_robot("planar_2r", gravity=(0.0, -9.81, 0.0), rotor_inertia={"shoulder": 0.8, "elbow": 0.3})
    assert geared.rotor_inertia.tolist() == [0.8, 0.3]
    for one, other in zip(
        axis_loads(mechanism_of(arm), motions).cycles, axis_loads(mechanism_of(geared), motions).cycles, strict=True
    ):
        weighted = one.weight > 0.0  # the times of peaks are found only to the rounding of their values
        assert np.array_equal(weighted, other.weight > 0.0)
        for key in ("torque", "inertia", "static_torque", "tilting_moment"):
            assert np.allclose(getattr(one, key)[weighted], getattr(other, key)[weighted], rtol=0.0, atol=1e-9)


@pytest.mark.tier2
@pytest.mark.parametrize("actuated", [None, ["left_motor", "right_motor", "left_elbow"]])
def test_rotors_of_a_linkage_are_not_part_of_the_loads(actuated):
    scene = bc.load_scene("five_bar")
    robot = bc.load_robot(
        "five_bar", gravity=(0, -9.81, 0), frames=dict(scene.config.frames),
        rotor_inertia={"left_motor": 1e-3, "right_motor": 2e-3},
    )  # fmt: skip
    found = []
    for one in (None, robot):
        linkage = Linkage(scene, one, actuated)
        found.append(axis_loads(linkage, [linkage.motion("pick")]).cycles[0])
    assert found[0].torque.shape == found[1].torque.shape
    weighted = found[0].weight > 0.0  # the times of peaks are found only to the rounding of their values
    assert np.array_equal(weighted, found[1].weight > 0.0)
    for key in ("torque", "inertia", "static_torque", "axial_force"):
        assert np.allclose(getattr(found[0], key)[weighted], getattr(found[1], key)[weighted], rtol=0.0, atol=1e-9)


# ---- duty programs


def test_a_duty_program_is_the_sum_of_its_parts():
    arm, motions = arm_and_motions()
    loads = axis_loads(mechanism_of(arm), motions)
    there, back = loads.cycles
    program = checked_duty(["there", "back", {"motion": "there", "repeat": 3}, {"pause": "2 s"}, "back", "back"])
    [duty] = axis_loads(mechanism_of(arm), motions, program).cycles
    held = arm.gravity_torque([0.4, 1.0])
    assert duty.duration == pytest.approx(1.0 + 0.5 + 3.0 + 2.0 + 1.0)
    assert duty.weight.sum() == pytest.approx(duty.duration)
    assert squares(duty) == pytest.approx(4 * squares(there) + 3 * squares(back) + 2.0 * held**2)
    assert len(duty.time) == len(there.time) + len(back.time) + 1
    ends = np.cumsum([0, there.interval[-1] + 1, back.interval[-1] + 1, 1])
    first, second, pause = pairwise(ends.tolist())
    assert duty.sequence == ((*first, 1), (*second, 1), (*first, 3), (*pause, 1), (*second, 2))
    passed = sum(duty.interval_duration[a:b].sum() * count for a, b, count in duty.sequence)
    assert passed == pytest.approx(duty.duration)
    [at] = np.flatnonzero(duty.interval == ends[2])
    assert duty.torque[at] == pytest.approx(held) and duty.static_torque[at] == pytest.approx(held)
    assert not duty.speed[at].any() and not duty.acceleration[at].any()
    assert duty.position[at] == pytest.approx([0.4, 1.0])
    assert duty.time[at] == pytest.approx(1.0 + 0.5 + 3.0)


def test_repeats_need_no_memory():
    arm, motions = arm_and_motions()
    once, often = (
        axis_loads(mechanism_of(arm), motions, [DutyStep("there", count), DutyStep("back")]).cycles[0]
        for count in (1, 100_000)
    )
    assert len(once.time) == len(often.time)
    assert often.duration == pytest.approx(100_000.5)
    assert often.interval_duration == pytest.approx(once.interval_duration)


def test_a_pause_first_holds_the_end_of_the_last_motion():
    arm, motions = arm_and_motions()
    [cycle] = axis_loads(mechanism_of(arm), motions, [DutyStep(pause=1.0), DutyStep("back"), DutyStep("there")]).cycles
    assert cycle.position[0] == pytest.approx([0.4, 1.0])


def test_means_over_intervals_are_those_of_the_weights():
    arm, motions = arm_and_motions()
    [cycle] = axis_loads(
        mechanism_of(arm), motions, [DutyStep("there", 2), DutyStep("back"), DutyStep(pause=0.3)]
    ).cycles
    mean = cycle.interval_mean(cycle.torque)
    assert mean.shape == (cycle.interval[-1] + 1, 2)
    total = sum(cycle.interval_duration[a:b] @ mean[a:b] * count for a, b, count in cycle.sequence)
    assert total == pytest.approx(cycle.weight @ cycle.torque)
    assert mean[-1] == pytest.approx(cycle.torque[-1])
    assert cycle.interval_mean(cycle.torque[:, 0]) == pytest.approx(mean[:, 0])


# ---- whether motions meet


def test_motions_that_meet_cause_no_warning():
    arm, motions = arm_and_motions()
    duty = checked_duty(["there", {"pause": 1}, "back"])
    assert axis_loads(mechanism_of(arm), motions, duty).warnings == ()


def test_motions_that_do_not_meet_are_named_with_joint_and_jump():
    arm, motions = arm_and_motions()
    (note, _) = axis_loads(mechanism_of(arm), motions).warnings
    assert note == (
        "motion 'there' repeats, which starts elsewhere: elbow position jumps by -1 rad, from 1 to 0 rad (the largest "
        "of 2 jumps); the transition is not included in the loads"
    )
    notes = axis_loads(mechanism_of(arm), motions, checked_duty(["there", {"motion": "back", "repeat": 2}])).warnings
    assert [note[:28] for note in notes] == ["motion 'back' repeats, which"]
    (note,) = axis_loads(mechanism_of(arm), motions, checked_duty(["there", "back", {"pause": 1}, "back"])).warnings[:1]
    assert note.startswith("motion 'back' is followed by motion 'back'") or note.startswith("motion 'back' repeats")


def spinning(turns=1.0, name="spin"):
    robot = bc.load_robot("pendulum")
    time = np.linspace(0.0, 1.0, 51)
    rate = 2.0 * np.pi * turns
    still = np.zeros((51, 1))
    return robot, bc.Motion(robot.joints, time, rate * time[:, None], still + rate, still, name)


def test_a_whole_turn_of_a_joint_without_limits_is_no_jump():
    robot, motion = spinning()
    assert np.isinf(robot.upper[0])
    assert axis_loads(mechanism_of(robot), [motion]).warnings == ()
    robot, motion = spinning(0.75)
    (note,) = axis_loads(mechanism_of(robot), [motion]).warnings
    assert "jumps by 1.571 rad" in note


def test_a_pause_after_a_motion_that_does_not_stop():
    robot, motion = spinning()
    notes = axis_loads(mechanism_of(robot), [motion], [DutyStep("spin"), DutyStep(pause=1.0)]).warnings
    assert len(notes) == 2
    assert "ends before a pause with" in notes[0] and "6.283 rad/s" in notes[0]
    assert "starts after a pause with" in notes[1] and "6.283 rad/s" in notes[1]


# ---- wrong programs


@pytest.mark.parametrize(
    ("duty", "message"),
    [
        (["ther"], "duty: unknown motion 'ther'"),
        ([{"pause": 1}], "duty: there is no motion, only pauses"),
        ([{"motion": "there", "repeat": 0}], "expected a whole number of 1 or more"),
        ([{"motion": "there", "repeats": 2}], "unknown key 'repeats'"),
        ([{"pause": "2 kg"}], "duty[1].pause"),
        ([{"pause": -1}], "expected more than 0 s"),
        ([{"motion": "there", "pause": 1}], "unknown key 'motion'"),
        ([], "found nothing"),
        ([3], "found 3 as entry 1"),
        ("there", "a list of motions and pauses"),
    ],
)
def test_wrong_duty_programs(duty, message):
    arm, motions = arm_and_motions()
    with pytest.raises(InputError, match=r".*") as caught:
        axis_loads(mechanism_of(arm), motions, checked_duty(duty))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_motions_need_different_names():
    arm, motions = arm_and_motions()
    with pytest.raises(InputError, match="two motions are named 'there'"):
        axis_loads(mechanism_of(arm), [motions[0], motions[0]])
    with pytest.raises(InputError, match="there is no motion"):
        axis_loads(mechanism_of(arm), [])
