"""Delta robot: a spatial closed mechanism of three motors and six rods."""

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
from properties.fastest import Fastest
from properties.files import RunFiles
from properties.messages import Messages
from properties.modes import LinearEquations, Modes
from properties.motions import JointMotions
from properties.pages import Pages
from properties.robot_files import RobotFiles
from properties.scene_dynamics import DrivenScene, SceneEquations
from properties.selection import Selection
from properties.sensitivities import OutputSensitivities
from properties.simulation import Simulation
from properties.sizing import Sizing
from properties.solvers import Solvers
from properties.sweep import ConstrainedSweeps, Sweeps


class TestDelta(
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
    Fastest,
    Selection,
    ConstrainedSweeps,
    Actuators,
):
    machine = Machine(
        "delta",
        "delta",
        sized_name="delta",
        resting={"gravity": [0.6, -1.1, -9.4]},
        locus=("gravity", [[0.6, -1.1, -9.4], [1.9, -0.7, -6.2], [0.2, 2.3, -3.1]]),
        loads=Loads(
            links=("platform", "arm_2"),
            joints={"motor_1": 6.0, "motor_3": 4.0},
            force=9.0,
            reach=0.25,
            duration=0.2,
            start={
                "gravity": [0.6, -1.1, -9.4],
                "initial": {
                    "motor_1": 0.5,
                    "motor_2": 0.2,
                    "motor_3": 0.35,
                    "platform_pose": {"position": {"guess": [0, 0, -0.8]}},
                    "velocity": {"motor_1": 0.9, "motor_2": -0.6, "motor_3": 0.4},
                },
            },
        ),
    )

    def test_the_platform_is_where_three_spheres_meet(self, loaded_run):
        """Rods of 0.8 m around the tips of the arms; the platform stays level."""
        for q in loaded_run.position[::6]:
            centres = []
            for angle, k in zip(q[:3], range(3), strict=True):
                c, s = np.cos(2 * np.pi / 3 * k), np.sin(2 * np.pi / 3 * k)
                out = 0.2 - 0.05 + 0.3 * np.cos(angle)  # joint, less the platform's own, and the arm
                centres.append([c * out, s * out, -0.3 * np.sin(angle)])
            assert q[3:6] == pytest.approx(meeting_point(*np.array(centres), 0.8), abs=1e-9)
            assert q[6:] == pytest.approx([0.0, 0.0, 0.0, 1.0], abs=1e-9)
        assert np.ptp(loaded_run.position[:, 3:6], axis=0).min() > 0.01

    def test_tool_follows_the_lines_of_the_pick_by_quintics(self, driven, plain_scene):
        """s = S (10 u³ − 15 u⁴ + 6 u⁵) along each line, with the motors turned as the loops ask."""
        begin, place = 0.0, None
        for part in plain_scene.scene_data["motions"]["pick"]["parts"]:
            duration = part["duration"]
            start = np.array(part.get("begin", place))
            way = np.array(part.get("end", start)) - start
            rows = np.flatnonzero((driven.time >= begin - 1e-12) & (driven.time <= begin + duration + 1e-12))
            for k in rows[2:-2:9]:
                u = np.array([(driven.time[k] - begin) / duration])
                shares = [
                    QUINTIC.deriv(order)(u)[0] / duration**order if order else QUINTIC(u)[0] for order in (0, 1, 2)
                ]
                found = plain_scene.tree.frame("tool", driven.position[k], driven.velocity[k], driven.acceleration[k])
                assert found["position"] == pytest.approx(start + shares[0] * way, abs=1e-11)
                assert found["velocity"] == pytest.approx(shares[1] * way, abs=1e-9)
                assert found["acceleration"] == pytest.approx(shares[2] * way, abs=1e-6)
                assert np.abs(found["spin"]).max() < 1e-10  # the rods keep the platform level
            begin, place = begin + duration, start + way
        assert driven.time[-1] == pytest.approx(begin, rel=1e-14)


def meeting_point(a, b, c, radius):
    """The lower of the two points at a distance from three centres."""
    x, z = (b - a) / np.linalg.norm(b - a), np.cross(b - a, c - a)
    z /= np.linalg.norm(z)
    y = np.cross(z, x)
    d, i, j = np.linalg.norm(b - a), x @ (c - a), y @ (c - a)
    u = d / 2
    w = (i * i + j * j - 2 * i * u) / (2 * j)
    return a + u * x + w * y - np.sign(z[2]) * np.sqrt(radius**2 - u * u - w * w) * z
