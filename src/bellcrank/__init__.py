"""Size motors and simulate robots from a URDF, on machine code made for that robot."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from bellcrank.codegen import locks as _locks

_HOME = {
    "BellcrankError": "errors",
    "InputError": "errors",
    "UnreachableError": "errors",
    "CompileError": "errors",
    "NotSavedError": "errors",
    "Robot": "robot.robot",
    "load_robot": "robot.load",
    "Payload": "robot.payload",
    "Motion": "motion.motion",
    "circle": "motion.frame_motions",
    "line": "motion.frame_motions",
    "waypoints": "motion.waypoints",
    "tool_path": "motion.tool_path",
    "point_to_point": "motion.point_to_point",
    "dwell": "motion.waypoints",
    "join": "motion.motion",
    "read_motion": "motion.csv_file",
    "write_motion": "motion.csv_file",
    "RobotConfig": "scene.robot_config",
    "load_robot_config": "scene.robot_config",
    "Actuator": "actuators.actuator",
    "Motor": "actuators.motor",
    "Gear": "actuators.gear",
    "Conditions": "actuators.conditions",
    "Mount": "actuators.mount",
    "CoupledTransmission": "actuators.coupled_transmission",
    "Catalogue": "actuators.catalogue",
    "load_catalogue": "actuators.catalogue",
    "write_catalogue": "actuators.catalogue_writer",
    "Sizing": "sizing.result",
    "size": "sizing.size",
    "DriveVerdicts": "sizing.drive_verdicts",
    "judge": "sizing.judge",
    "verify_selection": "sizing.verification",
    "SelectionVerification": "sizing.verification",
    "SizingSensitivity": "sizing.sensitivities",
    "JointSensitivity": "sizing.sensitivities",
    "Selection": "sizing.selection.selection",
    "select": "sizing.selection.select",
    "Scene": "scene.scene",
    "load_scene": "scene.scene",
    "Settings": "scene.settings",
    "simulate": "simulation.simulate",
    "prepare": "simulation.prepared_simulation",
    "PreparedSimulation": "simulation.prepared_simulation",
    "PreparedRun": "simulation.prepared_simulation",
    "Trajectory": "simulation.trajectory",
    "RunSensitivity": "simulation.sensitivities",
    "EventSensitivity": "simulation.sensitivities",
    "load_run": "simulation.load_run",
    "linearise": "analysis.linearise",
    "Linearisation": "analysis.linearisation",
    "Mode": "analysis.mode",
    "root_loci": "analysis.root_loci",
    "RootLoci": "analysis.root_loci",
    "floquet": "analysis.floquet",
    "FloquetModes": "analysis.floquet",
    "sweep": "studies.sweep",
    "optimise": "studies.optimisation.optimise",
    "pareto_front": "studies.optimisation.front",
    "select_designs": "studies.select_designs",
    "DesignSelection": "studies.design_selection",
    "ParetoFront": "studies.optimisation.pareto_result",
    "Optimum": "studies.optimisation.optimum",
    "synthesise": "studies.synthesis.synthesise",
    "Synthesis": "studies.synthesis.synthesis",
    "Sweep": "studies.sweep_result",
    "time_optimal": "planning.time_optimal",
    "speed_factor": "planning.speed_scaling",
    "repeated_cycle": "planning.repeated_cycle",
    "RepeatedCycle": "planning.cycle_result",
    "SpeedFactor": "planning.speed_scaling",
    "FastestMotion": "planning.fastest_motion",
    "LimitCost": "planning.fastest_motion",
    "MotionLimits": "planning.motion_limits",
    "JointPath": "planning.joint_path",
    "joint_path": "planning.joint_path",
    "sobol_indices": "studies.sensitivity_study",
    "Sensitivity": "studies.sensitivity",
    "SampleStatistics": "studies.sample_statistics",
    "scene_derivatives": "dynamics.scene_derivatives",
    "SceneDerivatives": "dynamics.scene_derivatives",
    "Slopes": "dynamics.scene_derivatives",
    "scene_casadi": "dynamics.scene_casadi",
    "scene_inverse_dynamics": "dynamics.scene_inverse_dynamics",
    "Linkage": "dynamics.closed_inverse_dynamics",
    "Mobility": "dynamics.mobility",
    "mobility": "dynamics.mobility",
    "plot": "simulation.run_plot:plot_run",
    "replay": "replays.replay",
    "show": "replays.replay",
    "report": "reports.report",
    "check_urdf": "robot.check",
    "wait_for_optimised_code": "codegen.full_tier",
}
__all__ = [  # written out, because type checkers do not evaluate it
    "Actuator",
    "BellcrankError",
    "Catalogue",
    "CompileError",
    "Conditions",
    "CoupledTransmission",
    "DesignSelection",
    "DriveVerdicts",
    "EventSensitivity",
    "FastestMotion",
    "FloquetModes",
    "Gear",
    "InputError",
    "JointPath",
    "JointSensitivity",
    "LimitCost",
    "Linearisation",
    "Linkage",
    "Mobility",
    "Mode",
    "Motion",
    "MotionLimits",
    "Motor",
    "Mount",
    "NotSavedError",
    "Optimum",
    "ParetoFront",
    "Payload",
    "PreparedRun",
    "PreparedSimulation",
    "RepeatedCycle",
    "Robot",
    "RobotConfig",
    "RootLoci",
    "RunSensitivity",
    "SampleStatistics",
    "Scene",
    "SceneDerivatives",
    "Selection",
    "SelectionVerification",
    "Sensitivity",
    "Settings",
    "Sizing",
    "SizingSensitivity",
    "Slopes",
    "SpeedFactor",
    "Sweep",
    "Synthesis",
    "Trajectory",
    "UnreachableError",
    "__version__",
    "check_urdf",
    "circle",
    "dwell",
    "floquet",
    "join",
    "joint_path",
    "judge",
    "line",
    "linearise",
    "load_catalogue",
    "load_robot",
    "load_robot_config",
    "load_run",
    "load_scene",
    "mobility",
    "optimise",
    "pareto_front",
    "plot",
    "point_to_point",
    "prepare",
    "read_motion",
    "repeated_cycle",
    "replay",
    "report",
    "root_loci",
    "scene_casadi",
    "scene_derivatives",
    "scene_inverse_dynamics",
    "select",
    "select_designs",
    "show",
    "simulate",
    "size",
    "sobol_indices",
    "speed_factor",
    "sweep",
    "synthesise",
    "time_optimal",
    "tool_path",
    "verify_selection",
    "wait_for_optimised_code",
    "waypoints",
    "write_catalogue",
    "write_motion",
]

if TYPE_CHECKING:
    __version__: str
    from bellcrank.actuators.actuator import Actuator
    from bellcrank.actuators.catalogue import Catalogue, load_catalogue
    from bellcrank.actuators.catalogue_writer import write_catalogue
    from bellcrank.actuators.conditions import Conditions
    from bellcrank.actuators.coupled_transmission import CoupledTransmission
    from bellcrank.actuators.gear import Gear
    from bellcrank.actuators.motor import Motor
    from bellcrank.actuators.mount import Mount
    from bellcrank.analysis.floquet import FloquetModes, floquet
    from bellcrank.analysis.linearisation import Linearisation
    from bellcrank.analysis.linearise import linearise
    from bellcrank.analysis.mode import Mode
    from bellcrank.analysis.root_loci import RootLoci, root_loci
    from bellcrank.codegen.full_tier import wait_for_optimised_code
    from bellcrank.dynamics.closed_inverse_dynamics import Linkage
    from bellcrank.dynamics.mobility import Mobility, mobility
    from bellcrank.dynamics.scene_casadi import scene_casadi
    from bellcrank.dynamics.scene_derivatives import SceneDerivatives, Slopes, scene_derivatives
    from bellcrank.dynamics.scene_inverse_dynamics import scene_inverse_dynamics
    from bellcrank.errors import BellcrankError, CompileError, InputError, NotSavedError, UnreachableError
    from bellcrank.motion.csv_file import read_motion, write_motion
    from bellcrank.motion.frame_motions import circle, line
    from bellcrank.motion.motion import Motion, join
    from bellcrank.motion.point_to_point import point_to_point
    from bellcrank.motion.tool_path import tool_path
    from bellcrank.motion.waypoints import dwell, waypoints
    from bellcrank.planning.cycle_result import RepeatedCycle
    from bellcrank.planning.fastest_motion import FastestMotion, LimitCost
    from bellcrank.planning.joint_path import JointPath, joint_path
    from bellcrank.planning.motion_limits import MotionLimits
    from bellcrank.planning.repeated_cycle import repeated_cycle
    from bellcrank.planning.speed_scaling import SpeedFactor, speed_factor
    from bellcrank.planning.time_optimal import time_optimal
    from bellcrank.replays.replay import replay, show
    from bellcrank.reports.report import report
    from bellcrank.robot.check import check_urdf
    from bellcrank.robot.load import load_robot
    from bellcrank.robot.payload import Payload
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.robot_config import RobotConfig, load_robot_config
    from bellcrank.scene.scene import Scene, load_scene
    from bellcrank.scene.settings import Settings
    from bellcrank.simulation.load_run import load_run
    from bellcrank.simulation.prepared_simulation import PreparedRun, PreparedSimulation, prepare
    from bellcrank.simulation.run_plot import plot_run as plot
    from bellcrank.simulation.sensitivities import EventSensitivity, RunSensitivity
    from bellcrank.simulation.simulate import simulate
    from bellcrank.simulation.trajectory import Trajectory
    from bellcrank.sizing.drive_verdicts import DriveVerdicts
    from bellcrank.sizing.judge import judge
    from bellcrank.sizing.result import Sizing
    from bellcrank.sizing.selection.select import select
    from bellcrank.sizing.selection.selection import Selection
    from bellcrank.sizing.sensitivities import JointSensitivity, SizingSensitivity
    from bellcrank.sizing.size import size
    from bellcrank.sizing.verification import SelectionVerification, verify_selection
    from bellcrank.studies.design_selection import DesignSelection
    from bellcrank.studies.optimisation.front import pareto_front
    from bellcrank.studies.optimisation.optimise import optimise
    from bellcrank.studies.optimisation.optimum import Optimum
    from bellcrank.studies.optimisation.pareto_result import ParetoFront
    from bellcrank.studies.sample_statistics import SampleStatistics
    from bellcrank.studies.select_designs import select_designs
    from bellcrank.studies.sensitivity import Sensitivity
    from bellcrank.studies.sensitivity_study import sobol_indices
    from bellcrank.studies.sweep import sweep
    from bellcrank.studies.sweep_result import Sweep
    from bellcrank.studies.synthesis.synthesis import Synthesis
    from bellcrank.studies.synthesis.synthesise import synthesise


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from bellcrank.version import version

        return version()
    if name in _HOME:
        module, _, attribute = _HOME[name].partition(":")
        return getattr(importlib.import_module(f"bellcrank.{module}"), attribute or name)
    raise AttributeError(f"module 'bellcrank' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(__all__)
