"""Solo12: a quadruped with a free base and twelve joints.

It falls, so that it has no equilibrium and no modes; linear equations at a moment of its run are the rolling disk's,
since with twelve joints they are more code than a case of the first tier may compile. So are sweeps, and derivatives of
a run's outputs. Its page would simplify its meshes for seconds; `tests/replays` has pages of meshes.
"""

import pytest
from loads import Loads
from machine import Machine, Tool
from properties.certificates import Certificates
from properties.command_line import CommandLine
from properties.derivatives import Derivatives, JointDerivatives, SceneDerivatives
from properties.dynamics import Dynamics, FreeBaseDynamics
from properties.events import Events
from properties.files import RunFiles
from properties.free_base import FreeBase
from properties.messages import Messages
from properties.motions import FrameMotions, JointMotions
from properties.robot_files import RobotFiles
from properties.scene_dynamics import DrivenScene, SceneEquations
from properties.sensitivities import Sensitivities
from properties.simulation import Simulation
from properties.sizing_messages import FreeBaseSizing
from properties.solvers import Solvers

import bellcrank as bc


class TestQuadruped(
    RobotFiles,
    Dynamics,
    FreeBaseDynamics,
    JointMotions,
    FrameMotions,
    Derivatives,
    JointDerivatives,
    SceneEquations,
    DrivenScene,
    SceneDerivatives,
    Certificates,
    FreeBase,
    Simulation,
    Solvers,
    Events,
    Sensitivities,
    RunFiles,
    Messages,
    CommandLine,
    FreeBaseSizing,
):
    machine = Machine(
        "solo12",
        "solo12",
        floating_base=True,
        overrides={"floating_base": True},
        tool=Tool("FL_FOOT", {"FL_HAA": 0.2, "FL_HFE": 0.7, "FL_KFE": -1.4}, 0.04, orientation=None),
        loads=Loads(
            links=("FL_LOWER_LEG", "HR_UPPER_LEG"),
            joints={"FL_HFE": 0.3, "HR_KFE": 0.1},
            force=1.2,
            reach=0.2,
            start={
                "base": {
                    "position": [0.1, -0.2, 0.5],
                    "rpy": [0.3, -0.4, 0.7],
                    "linear_velocity": [0.5, -0.3, 0.9],
                    "angular_velocity": [1.3, -0.8, 0.6],
                    "expressed_in": "world",
                },
                "initial": {
                    "FL_HAA": 0.2,
                    "FL_HFE": 0.7,
                    "FL_KFE": -1.4,
                    "FR_HFE": 0.5,
                    "HL_KFE": 1.1,
                    "HR_HFE": -0.6,
                    "HR_KFE": 1.2,
                    "velocity": {"FL_HFE": 1.5, "FR_KFE": -2.1, "HL_HAA": 0.9, "HR_KFE": 1.8},
                },
            },
        ),
    )

    def test_a_falling_machine_has_no_equilibrium(self, scene):
        with pytest.raises(bc.InputError, match="no equilibrium was found"):
            bc.linearise(scene, at="equilibrium")
