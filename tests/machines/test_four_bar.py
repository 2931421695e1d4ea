"""Deployable four-bar: a planar closed linkage that a spring unfolds."""

import numpy as np
import pytest
from loads import Loads
from machine import Machine
from path_profiles import QUINTIC
from properties.actuators import Actuators
from properties.certificates import Certificates
from properties.command_line import CommandLine
from properties.constrained_motion import ConstrainedMotion
from properties.derivatives import Derivatives, JointDerivatives, SceneDerivatives
from properties.dynamics import Dynamics
from properties.events import Events
from properties.fastest import FastestInDetail
from properties.files import Continuation, RunFiles
from properties.messages import Messages
from properties.modes import LinearEquations, Modes
from properties.motions import JointMotions
from properties.pages import Pages
from properties.robot_files import RobotFiles
from properties.scene_dynamics import DrivenScene, SceneEquations
from properties.selection import Selection
from properties.sensitivities import LatchSensitivities, OutputSensitivities
from properties.simulation import Simulation
from properties.sizing import Sizing
from properties.sizing_studies import SizingStudies
from properties.solvers import Solvers
from properties.sweep import ConstrainedSweeps, Sweeps

import bellcrank as bc


class TestFourBar(
    RobotFiles,
    Dynamics,
    JointMotions,
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
    ConstrainedMotion,
    Events,
    OutputSensitivities,
    Sizing,
    Sweeps,
    RunFiles,
    Pages,
    Messages,
    CommandLine,
    Continuation,
    LatchSensitivities,
    FastestInDetail,
    Selection,
    ConstrainedSweeps,
    Actuators,
    SizingStudies,
):
    machine = Machine(
        "four_bar",
        "four_bar",
        duration=5.0,
        sized_name="four_bar",
        resting={
            "forces.spring.stiffness": 40.0,
            "forces.spring.rest": 0.7,
            "gravity": [0.3, -0.5, 0.2],
            "initial": {"crank": 0.7, "coupler": {"guess": 4.9}, "rocker": {"guess": 0.7}},
            "parameters": {"stiffness": {"value": 40.0, "sets": ["forces.spring.stiffness"]}},
        },
        locus=("stiffness", [40.0, 60.0, 90.0]),
        loads=Loads(
            links=("coupler_link", "rocker_link"),
            joints={"crank": 4.0, "rocker": 2.5},
            passive=("rocker",),
            force=3.0,
            reach=0.6,
            duration=0.5,
            start={
                "gravity": [0.4, -9.1, 0.7],
                "initial": {
                    "crank": 0.6,
                    "coupler": {"guess": 5.67},
                    "rocker": {"guess": 0.61},
                    "velocity": {"crank": 0.5},
                },
            },
        ),
    )

    @pytest.fixture(scope="class")
    def locked(self):
        """The bundled scene, with derivatives by the crank's length and start."""
        return bc.simulate("four_bar", rtol=1e-12, atol=1e-12, sensitivities=["crank_length", "initial.crank"])

    def test_it_locks_when_its_equation_in_one_coordinate_has_it(self, locked):
        [lock] = locked.events
        assert lock.name == "lock" and lock.stopped and locked.status == "event"
        assert lock.time == pytest.approx(lock_time(), abs=1e-8)
        assert lock.position[0] == pytest.approx(2 * np.arcsin(1.2 / 1.241), abs=1e-9)  # the links are one line
        crank, coupler, rocker = lock.position
        assert np.cos(crank + coupler - rocker) == pytest.approx(-1.0, abs=1e-12)
        start = np.pi / 180
        work = 1.96 * (crank - start) - 0.05 * (crank**2 - start**2)  # of the spring
        assert locked.kinetic_energy[-1] == pytest.approx(work, rel=1e-10)
        energy = locked.sensitivity("initial.crank")
        slope = energy.kinetic_energy + energy.potential_energy
        assert slope == pytest.approx(np.full(len(slope), -1.96 + 0.1 * start), rel=1e-6)  # all of it is there at rest

    def test_lock_time_changes_as_its_equation_in_one_coordinate_has_it(self, locked):
        by_length = lock_time(crank=1.241 + 1e-30j).imag / 1e-30
        by_start = lock_time(start=np.radians(1.0) + 1e-30j).imag / 1e-30
        assert locked.sensitivity("crank_length").event("lock").time == pytest.approx(by_length, rel=1e-7)
        assert locked.sensitivity("initial.crank").event("lock").time == pytest.approx(by_start, rel=1e-7)

    def test_swept_cranks_lock_when_their_equation_has_it(self):
        lengths = [1.215, 1.228, 1.235, 1.241]
        result = bc.sweep("four_bar", {"crank_length": lengths})
        assert result.column("lock.time") == pytest.approx([lock_time(crank=length) for length in lengths], rel=1e-8)

    def test_constraints_come_near_to_singular_where_their_singular_values_have_it(self, loaded, plain_scene):
        """σ_min/σ_max of J M^(-1/2) at the event is its threshold."""

        def closeness(q, v):
            plain_scene.at(0.0, q, v)
            jacobian = plain_scene.jacobian()[0][:2]
            values = np.linalg.svd(np.linalg.solve(np.linalg.cholesky(plain_scene.mass_matrix()), jacobian.T))[1]
            return values[-1] / values[0]

        free = bc.simulate(loaded, samples=11)
        along = [closeness(q, v) for q, v in zip(free.position, free.velocity, strict=True)]
        threshold = float(0.5 * (min(along) + max(along)))
        event = {"name": "near", "when": {"singular_constraints": threshold}, "direction": "any"}
        run = bc.simulate(loaded, overrides={"events": [event]})
        assert len(run.events) >= 1 and max(along) > 1.01 * min(along)
        for event in run.events:
            # the run estimates the singular values by some power iterations
            assert closeness(event.position, event.velocity) == pytest.approx(threshold, rel=1e-4)

    def test_crank_unfolds_by_a_quintic_and_the_others_follow(self, driven, plain_scene):
        """θ from 1° to 140° in 4 s; the loop's angles by the law of cosines."""
        crank, coupler, rocker = (plain_scene.joints[name].q for name in ("crank", "coupler", "rocker"))
        first, last = np.radians([1.0, 140.0])
        for order, found in enumerate((driven.position, driven.velocity, driven.acceleration)):
            share = (QUINTIC.deriv(order) if order else QUINTIC)(driven.time / 4.0) / 4.0**order
            expected = (last - first) * share + (first if order == 0 else 0.0)
            assert found[:, crank] == pytest.approx(expected, abs=1e-12)
        ground, length, equal = 1.241, 1.241, 1.2  # m: ground and crank; coupler and rocker
        angle = driven.position[:, crank]
        x, y = length * np.cos(angle) - ground, length * np.sin(angle)  # from the rocker's pivot to the crank's tip
        half = np.hypot(x, y) / 2.0
        lean = np.arctan2(y, x) - np.arccos(half / equal)  # of the rocker, on the side on which the linkage starts
        turned = driven.position[:, rocker]
        assert np.cos(turned) == pytest.approx(np.cos(lean), abs=1e-9)
        assert np.sin(turned) == pytest.approx(np.sin(lean), abs=1e-9)
        tip = np.stack([x, y], axis=1) + equal * np.stack(
            [np.cos(angle + driven.position[:, coupler]), np.sin(angle + driven.position[:, coupler])], axis=1
        )
        assert tip == pytest.approx(equal * np.stack([np.cos(turned), np.sin(turned)], axis=1), abs=1e-12)


def lock_time(crank=1.241, start=np.pi / 180, coupler=1.2, rocker=1.2, ground=1.241):
    """The time (s) at which coupler and rocker are one line, by energy in the angle ψ between them as coordinate.

    t = ∫ √(I(ψ) / 2 W(ψ)) dψ with the kinetic energy I ψ̇²/2 and the work W of the crank's spring, by Gauss and Legendre
    in the root of ψ - ψ₀, in which the integrand is smooth; analytic in its arguments, so that complex steps
    differentiate it.
    """
    nodes, weights = np.polynomial.legendre.leggauss(80)
    reach = crank**2 + ground**2 - 2 * crank * ground * np.cos(start)  # squared, from tip of crank to end of ground
    first = np.arccos((coupler**2 + rocker**2 - reach) / (2 * coupler * rocker))
    width = np.sqrt(np.pi - first)
    root = 0.5 * width * (nodes + 1.0)
    c, s = np.cos(first + root**2), np.sin(first + root**2)
    reach = coupler**2 + rocker**2 - 2 * coupler * rocker * c
    angle = np.arccos((crank**2 + ground**2 - reach) / (2 * crank * ground))
    rate = coupler * rocker * s / (crank * ground * np.sin(angle))  # d angle / dψ
    turn = (crank**2 - crank * ground * np.cos(angle)) / reach * rate  # of the line from the crank's tip to the ground
    coupler_rate = turn + (coupler * rocker * c - rocker**2) / reach
    rocker_rate = turn - (coupler * rocker * c - coupler**2) / reach
    line = -np.arctan(crank * np.sin(angle) / (ground - crank * np.cos(angle)))
    bend = np.cos(angle - line - np.arctan(rocker * s / (coupler - rocker * c)))  # of the angle crank to coupler
    inertia = (9.6 + 20.15 * 1.2**2) * rate**2 + (0.06 + 8.25 * 0.6**2) * (coupler_rate**2 + rocker_rate**2)
    inertia += 8.25 * (crank**2 * rate**2 + 2 * 0.6 * crank * rate * coupler_rate * bend)
    work = 1.96 * (angle - start) - 0.5 * 0.1 * (angle**2 - start**2)
    return 0.5 * width * (weights * 2 * root * np.sqrt(inertia / (2 * work))).sum()
