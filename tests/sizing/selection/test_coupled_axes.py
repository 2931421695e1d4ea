"""Coupled transmissions: a differential wrist, a SCARA's screw-spline and a belt, with numbers derived by hand."""

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.actuators.coupled_transmission import CoupledTransmission
from bellcrank.actuators.mount import Mount
from bellcrank.dynamics.inverse.mechanism import mechanism_of
from bellcrank.errors import InputError
from bellcrank.sizing.selection.axis_loads import AddedMass
from bellcrank.sizing.selection.axis_loads_of import axis_loads
from tests.support.actuator_bodies import body
from tests.support.coupled_robots import SCARA, WRIST

LEAD = 0.02  # m per turn of the SCARA's screw
PER_METRE = 2.0 * np.pi / LEAD
# The spline turns the shaft: θ_s = w. The nut lifts it by LEAD per turn relative to the shaft: z = LEAD/2π (θ_n − w).
SCREW = CoupledTransmission(("z", "w"), ("nut", "spline"), ((PER_METRE, 1.0), (0.0, 1.0)))


@pytest.fixture
def scara(tmp_path):
    path = tmp_path / "scara.urdf"
    path.write_text(SCARA)
    return bc.load_robot(path)


def lifting(robot):
    """z, w and the shoulder move together, from rest to rest."""
    there = {"z": 0.2, "w": 3.0, "shoulder": 0.5}
    return bc.waypoints(robot, [0.0, 0.6], [{}, there], samples=201, name="lift")


def test_a_scara_screw_spline_by_hand(scara):
    mechanism = mechanism_of(scara)
    plain = axis_loads(mechanism, [lifting(scara)])
    coupled = axis_loads(mechanism, [lifting(scara)], transmissions=[SCREW])
    assert [(axis.name, axis.kind, axis.joints, axis.mount) for axis in coupled.axes] == [
        ("shoulder", "rotary", ("shoulder",), "base"),
        ("nut", "rotary", ("z", "w"), "arm"),
        ("spline", "rotary", ("w",), "arm"),
    ]
    [joints], [motors] = plain.cycles, coupled.cycles
    # F at z and τ at w: the nut bears F LEAD/2π, the spline τ less this, as the nut's torque also turns the shaft.
    force, torque = joints.torque[:, 1], joints.torque[:, 2]
    assert motors.torque[:, 1] == pytest.approx(force * LEAD / (2.0 * np.pi), abs=1e-12)
    assert motors.torque[:, 2] == pytest.approx(torque - force * LEAD / (2.0 * np.pi), abs=1e-12)
    assert motors.static_torque[0, 1] == pytest.approx(2.0 * 9.81 * 0.02 / (2.0 * np.pi))  # 0.06245 N m
    assert motors.static_torque[0, 1:] == pytest.approx([0.062452, -0.062452], abs=1e-6)
    z, w = joints.speed[:, 1], joints.speed[:, 2]
    assert motors.speed[:, 1] == pytest.approx(z * PER_METRE + w) and motors.speed[:, 2] == pytest.approx(w)
    assert motors.position[-1, 1] == pytest.approx(0.2 * PER_METRE + 3.0)
    # Power is conserved, τᵀ q̇ = τ_mᵀ θ̇, at each sample.
    assert (motors.torque * motors.speed).sum(axis=1) == pytest.approx((joints.torque * joints.speed).sum(axis=1))
    # Kinetic energy ½ m z² + ½ J w² with z = (θ_n − θ_s) LEAD/2π, w = θ_s: the nut feels m (LEAD/2π)².
    felt = 2.0 * (LEAD / (2.0 * np.pi)) ** 2
    assert motors.inertia[:, 1] == pytest.approx(felt)
    assert motors.inertia[:, 2] == pytest.approx(felt + 0.005)
    assert np.isnan(motors.axial_force[:, 1]).all() and np.isnan(motors.tilting_moment[:, 1]).all()
    # The spline's axis moves only w, whose wrench is its own.
    assert motors.axial_force[:, 0] == pytest.approx(joints.axial_force[:, 0])
    assert not np.isnan(motors.axial_force[:, 0]).any()
    assert np.array_equal(motors.torque[:, 0], joints.torque[:, 0])


BEVEL = CoupledTransmission(("pitch", "roll"), ("left", "right"), ((1.0, 1.0), (1.0, -1.0)))


@pytest.fixture
def wrist(tmp_path):
    path = tmp_path / "wrist.urdf"
    path.write_text(WRIST)
    return bc.load_robot(path, rotor_inertia={"pitch": 0.01})


def test_a_differential_wrist_by_hand(wrist):
    motion = bc.waypoints(wrist, [0.0, 1.0], [{}, {"pitch": 0.5, "roll": 1.0}], samples=101)
    [joints] = axis_loads(mechanism_of(wrist), [motion]).cycles
    [motors] = axis_loads(mechanism_of(wrist), [motion], transmissions=[BEVEL]).cycles
    pitch, roll = joints.torque.T
    assert motors.torque[:, 0] == pytest.approx((pitch + roll) / 2.0)  # left and right lift together,
    assert motors.torque[:, 1] == pytest.approx((pitch - roll) / 2.0)  # and turn the tool against each other
    # At rest, level: the tool's 1.5 kg at 0.1 m; the pitch axis points along y, so lifting is negative.
    assert motors.static_torque[0] == pytest.approx([-1.5 * 9.81 * 0.1 / 2.0] * 2)
    assert motors.speed[:, 0] == pytest.approx(joints.speed[:, 0] + joints.speed[:, 1])
    assert (motors.torque * motors.speed).sum(axis=1) == pytest.approx((joints.torque * joints.speed).sum(axis=1))
    # Level: M = diag(J_pitch, J_roll); each motor alone turns both joints by half its angle.
    about_pitch, about_roll = 0.002 + 0.004 + 1.5 * 0.1**2, 0.003
    assert motors.inertia[0] == pytest.approx([(about_pitch + about_roll) / 4.0] * 2)


def test_a_belt_is_a_transmission_of_one_joint(wrist):
    motion = bc.waypoints(wrist, [0.0, 1.0], [{}, {"pitch": 0.5, "roll": 1.0}], samples=101)
    belt = CoupledTransmission(("roll",), ("roll_motor",), ((-2.5,),))
    [joints] = axis_loads(mechanism_of(wrist), [motion]).cycles
    loads = axis_loads(mechanism_of(wrist), [motion], transmissions=[belt])
    [motors] = loads.cycles
    assert [axis.name for axis in loads.axes] == ["pitch", "roll_motor"]
    assert motors.torque[:, 1] == pytest.approx(joints.torque[:, 1] / -2.5)
    assert motors.speed[:, 1] == pytest.approx(joints.speed[:, 1] * -2.5)
    assert motors.inertia[:, 1] == pytest.approx(joints.inertia[:, 1] / 2.5**2)
    assert motors.inertia[:, 0] == pytest.approx(joints.inertia[:, 0])


def test_bodies_of_coupled_motors_are_carried_where_they_are_mounted(scara, monkeypatch):
    """Nut and spline on the arm at the z joint by default; mounts may say another link."""
    from bellcrank.sizing.selection import axis_loads_of

    plans, plan = [], axis_loads_of.planned_cycles
    monkeypatch.setattr(
        axis_loads_of, "planned_cycles", lambda *args: plans[0] if plans else plans.append(plan(*args)) or plans[0]
    )
    motions = [lifting(scara)]
    loads = axis_loads(mechanism_of(scara), motions, transmissions=[SCREW], mounts={"spline": Mount(link="lift")})
    nut = AddedMass(mass=1.2, axial_inertia=0.01, transverse_inertia=0.008)
    spline = AddedMass(mass=0.8, axial_inertia=0.002, transverse_inertia=0.003)
    [found] = loads.with_masses({"nut": nut, "spline": spline})
    heavy = scara.with_payloads([
        body("arm", 1.2, 0.01, 0.008, (0, 0, 1), (0.4, 0, 0)), body("lift", 0.8, 0.002, 0.003, (0, 0, 1)),
    ])  # fmt: skip
    [expected] = axis_loads(mechanism_of(heavy), motions, transmissions=[SCREW]).cycles
    for key in ("torque", "static_torque", "inertia"):
        assert np.abs(getattr(found, key) - getattr(expected, key)).max() < 1e-9
    assert np.abs(found.axial_force[:, 0] - expected.axial_force[:, 0]).max() < 1e-9
    assert np.isnan(found.axial_force[:, 1]).all()
    assert loads.influence.tolist() == [[False, True, True], [False, False, True], [False, False, True]]


def test_included_masses_are_replaced(scara):
    motions = [lifting(scara)]
    plain = axis_loads(mechanism_of(scara), motions)
    mounts = {"z": Mount(included_mass=1.0, included_axial_inertia=0.002, included_transverse_inertia=0.003)}
    stated = axis_loads(mechanism_of(scara), motions, mounts=mounts)
    same = AddedMass(mass=1.0, axial_inertia=0.002, transverse_inertia=0.003)
    assert stated.with_masses({"z": same}) is stated.cycles  # the very actuator that the URDF contains
    heavier = AddedMass(mass=3.0, axial_inertia=0.004, transverse_inertia=0.005)
    difference = AddedMass(mass=2.0, axial_inertia=0.002, transverse_inertia=0.002)
    [found], [expected] = stated.with_masses({"z": heavier}), plain.with_masses({"z": difference})
    assert np.array_equal(found.torque, expected.torque)
    assert np.abs(found.torque - plain.cycles[0].torque).max() > 0.1
    with pytest.raises(InputError, match=r"unknown axis 'zz'; did you mean 'z'\?"):
        stated.with_masses({"zz": same})


def test_no_more_mass_is_included_than_there_is(scara):
    with pytest.raises(InputError, match=r"included_mass: z 3.5 kg: the links that move with joint 'shoulder', which "):
        axis_loads(mechanism_of(scara), [lifting(scara)], mounts={"z": Mount(included_mass=3.5)})
    with pytest.raises(InputError, match=r"nut 2 kg, spline 1.5 kg: .* which carry them, have a mass of 3 kg"):
        mounts = {"nut": Mount(included_mass=2.0), "spline": Mount(included_mass=1.5)}
        axis_loads(mechanism_of(scara), [lifting(scara)], transmissions=[SCREW], mounts=mounts)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((("a", "b"), ("m",), ((1.0,),)), "as many motors as joints, found 1 motors (m) and 2 joints (a, b)"),
        ((("a", "b"), ("m", "n"), ((1.0, 2.0), (2.0, 4.0))), "a matrix with an accurate inverse is required"),
        ((("a", "b"), ("m", "n"), ((1.0, 0.0), (3.0, 0.0))), "the column of joint 'b' is 0"),
        ((("a", "b"), ("m", "n"), ((0.0, 0.0), (3.0, 1.0))), "the row of motor 'm' is 0"),
        ((("a", "b"), ("m", "n"), ((1.0, 2.0),)), "matrix"),
        ((("a", "b"), ("m", "n"), ((1.0, float("nan")), (0.0, 1.0))), "matrix"),
        ((("a", "a"), ("m", "n"), ((1.0, 0.0), (0.0, 1.0))), "a list of different joints"),
        ((("a", "b"), ("m", "a"), ((1.0, 0.0), (0.0, 1.0))), "'a' names a joint and a motor"),
    ],
)
def test_impossible_transmissions(arguments, message):
    with pytest.raises(InputError) as caught:
        CoupledTransmission(*arguments)
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_units_of_the_matrix_do_not_make_it_ill_conditioned():
    """A screw of 1 µm lead gives 6.3e6 rad/m beside 1 rad/rad."""
    screw = CoupledTransmission(("z", "w"), ("n", "s"), ((2e6 * np.pi, 1.0), (0.0, 1.0)))
    assert screw.motor_torques([1.0, 0.0]) == pytest.approx([5e-7 / np.pi, -5e-7 / np.pi])


def test_transmissions_of_unknown_joints_and_clashing_names(wrist):
    motion = bc.waypoints(wrist, [0.0, 1.0], [{}, {"pitch": 0.5}], samples=11)

    def loads(*transmissions, mounts=None):
        return axis_loads(mechanism_of(wrist), [motion], transmissions=transmissions, mounts=mounts)

    with pytest.raises(InputError, match=r"unknown joint with a motor 'rol'; did you mean 'roll'\?"):
        loads(CoupledTransmission(("rol",), ("m",), ((1.0,),)))
    with pytest.raises(InputError, match="motor 'pitch' has the name of a joint"):
        loads(CoupledTransmission(("roll",), ("pitch",), ((1.0,),)))
    with pytest.raises(InputError, match="joint 'roll' belongs to two coupled transmissions"):
        loads(BEVEL, CoupledTransmission(("roll",), ("m",), ((1.0,),)))
    with pytest.raises(InputError, match=r"mounts of wrist: unknown joint or motor 'lefty'; did you mean 'left'\?"):
        loads(BEVEL, mounts={"lefty": Mount()})
    with pytest.raises(InputError, match=r"left: unknown link or frame 'yok'; did you mean 'yoke'\?"):
        loads(BEVEL, mounts={"left": Mount(link="yok")})
