"""Every robot of example-robot-data: loaded, traced and compiled once, and all its properties on the same object."""

from functools import cached_property

import numpy as np
import pinocchio as pin
import pytest
from example_robots import SOUND, gathered
from kinetic_energy import half_v_m_v, rotors, traced_energy
from urdf_records import urdf_of_file

import bellcrank as bc
from bellcrank.errors import InputError
from bellcrank.robot.model.pinocchio_model import plain_model
from bellcrank_bench.measurements.dynamics_speed import random_states
from tests.campaigns.derivatives_of_example_robots import check

pytestmark = pytest.mark.tier2

STATES = 1000  # of the compiled code: they cost little beside compiling
UNCLEANED = {"ur5", "panda", "talos", "tiago_dual", "icub", "baxter"}
FREE_BASE = {"ur5", "talos", "solo12", "anymal"}


class Example:
    """A robot with a fixed base and without friction, its random states and what Pinocchio says of them."""

    def __init__(self, name):
        self.name, self.robot = name, bc.load_robot(name, friction="none")
        self.states = random_states(self.robot, STATES)

    @cached_property
    def torques(self):
        robot, model, data = self.robot, self.robot.model, self.robot.model.createData()
        if model.nv == robot.nv:
            return np.array([pin.rnea(model, data, *state) for state in zip(*self.states, strict=True)])
        # a leader after its follower, which Pinocchio's mimic joints do not take: gather by hand
        return gathered(robot, model, data, *self.states)

    @cached_property
    def accelerations(self):
        q, _, a = self.states
        if not self.robot.mimics():
            model, data = self.robot.model, self.robot.model.createData()
            return np.array([pin.aba(model, data, *state) for state in zip(*self.states, strict=True)])
        # Pinocchio's ABA does not take mimic joints: the mass matrix and the bias stand in
        mass = self.robot.mass_matrix(q)
        bias = self.torques - np.einsum("nij,nj->ni", mass, a)
        try:
            return np.linalg.solve(mass, (a - bias)[..., None])[..., 0]
        except np.linalg.LinAlgError:
            return np.full_like(bias, np.nan)


@pytest.fixture(scope="module", params=SOUND)
def example(request):
    return Example(request.param)


def test_rnea_agrees_with_pinocchio_at_1000_random_states(example):
    robot, (q, v, a) = example.robot, example.states
    tau = robot.inverse_dynamics(q, v, a)
    assert tau.shape == (STATES, robot.nv)
    if not robot.nv:
        return
    scale = np.abs(example.torques).max()
    assert np.abs(tau - example.torques).max() <= 1e-12 * scale
    if robot.nv <= 8:  # the scalar code too
        assert np.abs(robot.inverse_dynamics(q[0], v[0], a[0]) - example.torques[0]).max() <= 1e-12 * scale


def test_aba_agrees_with_pinocchio_at_1000_random_states(example):
    robot = example.robot
    if not robot.nv:
        return
    expected = example.accelerations
    if not np.isfinite(expected).all():  # massless branches: Pinocchio answers NaN, bellcrank a sentence
        with pytest.raises(InputError, match=r"no finite answer at joint '.+'.*bellcrank check"):
            robot.forward_dynamics(*example.states)
        return
    error = np.abs(robot.forward_dynamics(*example.states) - expected).max(axis=1) / np.abs(expected).max(axis=1)
    far = error > 1e-12
    if far.any():
        # near-singular mass matrices (icub's hands, mimic grippers): no algorithm in doubles can do better than
        # rounding times the condition number, and Pinocchio's own answer is no closer to the exact one
        condition = np.linalg.cond(robot.mass_matrix(example.states[0][far]))
        assert np.all(error[far] <= np.finfo(float).eps * condition * (20.0 if robot.mimics() else 1.0))


def test_derivatives_are_those_of_complex_steps(example):
    """The base is free at every other robot: the equations differ by its joint alone. The campaign has both bases."""
    check(example.name, floating_base=SOUND.index(example.name) % 2 == 1)


def test_kinetic_energy_is_half_v_m_v_with_a_rotor_on_every_joint(example):
    if not example.robot.nv:
        assert not example.robot.joints
        return
    random = np.random.default_rng(len(example.name))
    floating = bool(random.integers(2)) and not example.robot.mimics()  # `gathered` takes no quaternion
    plain = bc.load_robot(example.name, friction="none", floating_base=True) if floating else example.robot
    geared = bc.load_robot(example.name, friction="none", floating_base=floating, rotor_inertia=rotors(plain, random))
    q, v, _ = random_states(geared, 4)
    np.testing.assert_allclose(traced_energy(geared, q, v), half_v_m_v(geared, q, v), rtol=1e-10)
    without = traced_energy(plain, q, v) + 0.5 * v**2 @ geared.rotor_inertia
    np.testing.assert_allclose(traced_energy(geared, q, v), without, rtol=1e-12)


def test_the_model_is_pinocchios_own(example):
    """In bits, but for continuous joints, which have two coordinates there, and the inertias that frames keep."""
    ours, theirs = plain_model(urdf_of_file(example.robot.source)), pin.buildModelFromUrdf(str(example.robot.source))
    for what in ("names", "parents", "jointPlacements", "inertias"):
        assert all(a == b for a, b in zip(getattr(ours, what), getattr(theirs, what), strict=True)), what
    for a, b in zip(ours.frames, theirs.frames, strict=True):
        assert (a.name, a.type, a.parentJoint, a.parentFrame) == (b.name, b.type, b.parentJoint, b.parentFrame)
        assert a.placement == b.placement


@pytest.mark.parametrize("name", sorted(UNCLEANED))
def test_uncleaned_dynamics_agree_with_pinocchio_reading_the_file_itself(name):
    robot = bc.load_robot(name, friction="none", clean=False)
    model = pin.buildModelFromUrdf(str(robot.source), bool(robot.mimics()))
    q, v, a = random_states(robot, 30)
    q_file = q if model.nq == robot.nq else None
    if q_file is None:  # continuous joints are (cos, sin) there
        q_file = np.zeros((30, model.nq))
        for j in robot.joints:
            k = model.getJointId(j.name)
            at, wide = model.idx_qs[k], model.nqs[k] == 2
            q_file[:, at] = np.cos(q[:, j.q]) if wide else q[:, j.q]
            if wide:
                q_file[:, at + 1] = np.sin(q[:, j.q])
    data = model.createData()
    expected = np.array([pin.rnea(model, data, *state) for state in zip(q_file, v, a, strict=True)])
    found = np.array(robot.equations.dynamics("inverse_dynamics")(q.T, v.T, a.T)).T  # compiled code has its own test
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("name", sorted(FREE_BASE))
def test_free_base_dynamics_agree_with_pinocchio(name):
    robot = bc.load_robot(name, friction="none", floating_base=True)
    q, v, a = random_states(robot, 200)
    model, data = robot.model, robot.model.createData()
    tau = np.array([pin.rnea(model, data, *state) for state in zip(q, v, a, strict=True)])
    acceleration = np.array([pin.aba(model, data, *state) for state in zip(q, v, a, strict=True)])
    assert np.abs(robot.inverse_dynamics(q, v, a) - tau).max() <= 1e-12 * np.abs(tau).max()
    assert np.abs(robot.forward_dynamics(q, v, a) - acceleration).max() <= 1e-12 * np.abs(acceleration).max()
