"""UR5: a six-axis arm with a payload.

Pages of robots with meshes take seconds to simplify these; `tests/replays` has them.
"""

from loads import Loads
from machine import Machine, Tool
from properties.actuators import Actuators, CoupledMotors
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
from properties.selection import WrittenSelection
from properties.sensitivities import OutputSensitivities
from properties.simulation import Simulation
from properties.sizing import Sizing
from properties.solvers import Solvers
from properties.sweep import Sweeps


class TestUr5(
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
    WrittenSelection,
    Actuators,
    CoupledMotors,
):
    machine = Machine(
        "ur5",
        "ur5_held",
        sized_name="ur5",
        resting={
            "control.weight.mass_error": 0.12,
            "parameters": {"error": {"value": 0.12, "sets": ["control.weight.mass_error"]}},
        },
        locus=("error", [-0.1, 0.05, 0.2]),
        tool=Tool(
            "tool0",
            {
                "shoulder_pan_joint": 0.3,
                "shoulder_lift_joint": -1.4,
                "elbow_joint": 1.5,
                "wrist_1_joint": -1.1,
                "wrist_2_joint": -1.3,
                "wrist_3_joint": 0.4,
            },
            0.11,
        ),
        loads=Loads(
            links=("wrist_3_link", "forearm_link"),
            joints={"shoulder_lift_joint": 60.0, "elbow_joint": 30.0},
            force=40.0,
            reach=0.5,
            duration=0.4,
            start={
                "control": [],
                "initial": {
                    "shoulder_pan_joint": 0.3,
                    "shoulder_lift_joint": -1.2,
                    "elbow_joint": 0.8,
                    "wrist_1_joint": -0.5,
                    "wrist_2_joint": 0.9,
                    "wrist_3_joint": -0.4,
                    "velocity": {
                        "shoulder_pan_joint": 0.7,
                        "shoulder_lift_joint": -0.4,
                        "elbow_joint": 0.9,
                        "wrist_1_joint": -1.3,
                        "wrist_2_joint": 0.6,
                        "wrist_3_joint": 1.7,
                    },
                },
            },
        ),
    )
