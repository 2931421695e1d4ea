"""Planar 2R arm: two links in a vertical plane, with motors."""

import numpy as np
import pytest
from loads import Loads
from machine import Machine, Tool
from properties.actuators import Actuators, CoupledMotors
from properties.certificates import Certificates
from properties.command_line import CommandLine
from properties.derivatives import Derivatives, JointDerivatives, SceneDerivatives
from properties.dynamics import Dynamics, close
from properties.events import Events
from properties.fastest import FastestInDetail, StraightPaths
from properties.files import Continuation, RunFiles
from properties.messages import Messages
from properties.modes import LinearEquations, Modes, matched
from properties.motions import FrameMotions, JointMotions
from properties.pages import Pages, Reports
from properties.robot_files import RobotFiles
from properties.scene_dynamics import DrivenScene, SceneEquations
from properties.selection import WrittenSelection
from properties.sensitivities import LatchSensitivities, OutputSensitivities
from properties.simulation import Simulation
from properties.sizing import Sizing
from properties.sizing_messages import SizingMessages
from properties.sizing_studies import SizingStudies
from properties.solvers import Solvers
from properties.sweep import Sweeps
from two_link import I1, I2, L1, M1, M2, R1, R2, G, TwoLink

import bellcrank as bc


class TestPlanar2R(
    RobotFiles,
    Dynamics,
    JointMotions,
    FrameMotions,
    Derivatives,
    JointDerivatives,
    SceneEquations,
    DrivenScene,
    SceneDerivatives,
    LinearEquations,
    Modes,
    Certificates,
    Simulation,
    Solvers,
    Events,
    OutputSensitivities,
    Sizing,
    Sweeps,
    RunFiles,
    Pages,
    Reports,
    Messages,
    CommandLine,
    Continuation,
    LatchSensitivities,
    FastestInDetail,
    StraightPaths,
    WrittenSelection,
    Actuators,
    CoupledMotors,
    SizingMessages,
    SizingStudies,
):
    machine = Machine(
        "planar_2r",
        "planar_2r_swing",
        duration=2.0,
        sized_name="planar_2r",
        resting={"gravity": [1.7, -9.3, 0.4]},
        locus=("gravity", [[1.7, -9.3, 0.4], [1.2, -4.5, 0.3], [0.3, -1.1, 0.1]]),
        tool=Tool("tip", {"shoulder": 0.4, "elbow": 0.9}, 0.25, (0.0, 0.0, 1.0), (-0.6, -0.5, 0.0), None),
        loads=Loads(
            links=("link_2", "link_1"),
            joints={"shoulder": 90.0, "elbow": 50.0},
            force=60.0,
            reach=0.7,
            duration=0.6,
            start={"initial": {"shoulder": -0.8, "elbow": 0.9, "velocity": {"shoulder": 0.4, "elbow": -1.1}}},
        ),
    )

    def test_dynamics_are_lagranges_equations_of_two_links(self, states):
        """By hand, gravity along −y; rotors, viscous and Coulomb friction at both joints."""
        joints = ("shoulder", "elbow")
        robot = bc.load_robot(
            "planar_2r",
            gravity=(0, -G, 0),
            rotor_inertia=dict(zip(joints, (0.9, 0.4), strict=True)),
            friction=dict.fromkeys(joints, (1.3, 2.1)),
        )
        by_hand = TwoLink(viscous=1.3, coulomb=2.1, rotor=(0.9, 0.4))
        q, v, a = states
        close(robot.inverse_dynamics(q, v, a), by_hand.inverse_dynamics(q, v, a))
        close(robot.mass_matrix(q), by_hand.mass_matrix(q))
        close(robot.gravity_torque(q), by_hand.gravity_torque(q))
        close(robot.link_torques(q, v, a), by_hand.link_torques(q, v, a))
        angles = q.cumsum(axis=1)
        heights = R1 * M1 * np.sin(angles[:, 0]) + M2 * (L1 * np.sin(angles[:, 0]) + R2 * np.sin(angles[:, 1]))
        close(robot.energy(q, v)[1], G * heights)

    def test_hanging_arm_swings_as_the_double_pendulum_by_hand(self):
        """q̈ = −M⁻¹ K q at the straight posture, from the Lagrangian; λ² are the eigenvalues of −M⁻¹ K."""
        linear = bc.linearise("planar_2r_swing", at="equilibrium")
        assert linear.position == pytest.approx([-np.pi / 2, 0.0], abs=1e-12)
        coupling = I2 + M2 * (R2**2 + L1 * R2)
        mass = np.array([[I1 + M1 * R1**2 + M2 * (L1**2 + L1 * R2) + coupling, coupling], [coupling, I2 + M2 * R2**2]])
        stiffness = G * np.array([[M1 * R1 + M2 * (L1 + R2), M2 * R2], [M2 * R2, M2 * R2]])
        roots = np.sqrt(np.linalg.eigvals(-np.linalg.solve(mass, stiffness)).astype(complex))
        matched(linear.eigenvalues, [*roots, *-roots], 1e-11)
        assert [name for name, _ in linear.states] == ["shoulder", "elbow", "shoulder rate", "elbow rate"]
        close(linear.B, np.vstack([np.zeros((2, 2)), np.linalg.inv(mass)]))
        assert linear.stable is True

    @pytest.mark.parametrize(("solver", "step", "order"), [("RK4", 0.01, 4), ("RK45", 0.04, 5), ("DOP853", 0.1, 8)])
    def test_halved_steps_have_errors_of_the_order_of_the_method(self, scene, solver, step, order):
        tight = bc.simulate(scene, 2.0, "DOP853", rtol=1e-13, atol=1e-13, samples=2).state[-1]
        steps = step / 2.0 ** np.arange(3)
        ends = [bc.simulate(scene, 2.0, solver, step=h, samples=2) for h in steps]
        assert [end.statistics.steps for end in ends] == [round(2.0 / h) for h in steps]
        errors = [np.abs(end.state[-1] - tight).max() for end in ends]
        assert 0.5 * np.log2(errors[0] / errors[2]) == pytest.approx(order, abs=0.35)
