"""Panda: a seven-axis arm with two fingers, one of which mimics the other.

Pages of robots with meshes take seconds to simplify these; `tests/replays` has them.
"""

from loads import Loads
from machine import Machine, Tool
from properties.actuators import Actuators
from properties.certificates import Certificates
from properties.command_line import CommandLine
from properties.derivatives import Derivatives, JointDerivatives, SceneDerivatives
from properties.dynamics import Dynamics
from properties.events import Events
from properties.fastest import Fastest, StraightPaths
from properties.files import RunFiles
from properties.messages import Messages
from properties.modes import LinearEquations, Modes
from properties.motions import FrameMotions, JointMotions
from properties.robot_files import RobotFiles
from properties.scene_dynamics import DrivenScene, SceneEquations
from properties.selection import Selection
from properties.sensitivities import OutputSensitivities
from properties.simulation import Simulation
from properties.sizing import Sizing
from properties.solvers import Solvers
from properties.sweep import Sweeps


class TestPanda(
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
    Messages,
    CommandLine,
    Fastest,
    StraightPaths,
    Selection,
    Actuators,
):
    machine = Machine(
        "panda",
        "panda_held",
        sized_name="panda",
        resting={
            "control.weight.mass_error": 0.12,
            "parameters": {"error": {"value": 0.12, "sets": ["control.weight.mass_error"]}},
        },
        locus=("error", [-0.1, 0.05, 0.2]),
        tool=Tool(
            "panda_hand_tcp",
            {
                "panda_joint1": 0.2,
                "panda_joint2": -0.6,
                "panda_joint3": 0.3,
                "panda_joint4": -2.2,
                "panda_joint5": -0.2,
                "panda_joint6": 1.7,
                "panda_joint7": 0.6,
            },
            0.09,
        ),
        loads=Loads(
            links=("panda_hand", "panda_link4"),
            joints={"panda_joint2": 25.0, "panda_finger_joint1": 0.9},
            force=20.0,
            reach=0.4,
            start={
                "control": [],
                "initial": {
                    "panda_joint1": 0.3,
                    "panda_joint2": -0.7,
                    "panda_joint3": 0.4,
                    "panda_joint4": -2.1,
                    "panda_joint5": -0.2,
                    "panda_joint6": 1.4,
                    "panda_joint7": 0.6,
                    "panda_finger_joint1": 0.03,
                    "velocity": {
                        "panda_joint1": 0.5,
                        "panda_joint2": -0.3,
                        "panda_joint3": 0.8,
                        "panda_joint4": 0.6,
                        "panda_joint5": -1.1,
                        "panda_joint6": 0.9,
                        "panda_joint7": -1.4,
                        "panda_finger_joint1": 0.05,
                    },
                },
            },
        ),
    )
