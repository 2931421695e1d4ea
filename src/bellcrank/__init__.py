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
    "Payload": "robot.model.payload",
    "Motion": "motion.motion",
    "circle": "motion.generators.frame_motions",
    "line": "motion.generators.frame_motions",
    "waypoints": "motion.generators.waypoints",
    "tool_path": "motion.generators.tool_path",
    "point_to_point": "motion.generators.point_to_point",
    "dwell": "motion.generators.waypoints",
    "join": "motion.motion",
    "read_motion": "motion.sampled.csv_file",
    "write_motion": "motion.sampled.csv_file",
    "Actuator": "actuators.actuator",
    "Motor": "actuators.motor",
    "Gear": "actuators.gear",
    "Conditions": "actuators.conditions",
    "Mount": "actuators.mount",
    "CoupledTransmission": "actuators.coupled_transmission",
    "Catalogue": "actuators.catalogue.catalogue",
    "load_catalogue": "actuators.catalogue.catalogue",
    "write_catalogue": "actuators.catalogue.catalogue_files",
    "size": "sizing.size",
    "judge": "sizing.judge",
    "verify_selection": "sizing.verification",
    "select": "sizing.selection.select",
    "Scene": "scene.scene",
    "load": "scene.load",
    "load_scene": "scene.scene",
    "simulate": "simulation.simulate",
    "prepare": "simulation.prepared_simulation",
    "load_run": "simulation.files.load_run",
    "linearise": "analysis.linearise",
    "root_loci": "analysis.root_loci",
    "floquet": "analysis.floquet",
    "sweep": "studies.sweep",
    "optimise": "studies.optimisation.optimise",
    "pareto_front": "studies.optimisation.front",
    "select_designs": "studies.selection.select_designs",
    "synthesise": "studies.synthesis.synthesise",
    "time_optimal": "planning.time_optimal",
    "speed_factor": "planning.speed_scaling",
    "repeated_cycle": "planning.repeated_cycle",
    "MotionLimits": "planning.limits.motion_limits",
    "JointPath": "planning.joint_path",
    "joint_path": "planning.joint_path",
    "sobol_indices": "studies.sweep",
    "scene_derivatives": "dynamics.equations.scene_functions",
    "scene_casadi": "dynamics.equations.scene_functions",
    "scene_inverse_dynamics": "dynamics.inverse.scene_inverse_dynamics",
    "mobility": "dynamics.constraints.mobility",
    "plot": "simulation.trajectory.run_plot:plot_run",
    "replay": "replays.replay",
    "show": "replays.replay",
    "report": "reports.report",
    "check_urdf": "robot.checks.check",
    "wait_for_optimised_code": "codegen.full_tier",
}
__all__ = [  # written out, because type checkers do not evaluate it
    "Actuator",
    "BellcrankError",
    "Catalogue",
    "CompileError",
    "Conditions",
    "CoupledTransmission",
    "Gear",
    "InputError",
    "JointPath",
    "Motion",
    "MotionLimits",
    "Motor",
    "Mount",
    "NotSavedError",
    "Payload",
    "Robot",
    "Scene",
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
    "load",
    "load_catalogue",
    "load_robot",
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
    "results",
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
    from bellcrank import results
    from bellcrank.actuators.actuator import Actuator
    from bellcrank.actuators.catalogue.catalogue import Catalogue, load_catalogue
    from bellcrank.actuators.catalogue.catalogue_files import write_catalogue
    from bellcrank.actuators.conditions import Conditions
    from bellcrank.actuators.coupled_transmission import CoupledTransmission
    from bellcrank.actuators.gear import Gear
    from bellcrank.actuators.motor import Motor
    from bellcrank.actuators.mount import Mount
    from bellcrank.analysis.floquet import floquet
    from bellcrank.analysis.linearise import linearise
    from bellcrank.analysis.root_loci import root_loci
    from bellcrank.codegen.full_tier import wait_for_optimised_code
    from bellcrank.dynamics.constraints.mobility import mobility
    from bellcrank.dynamics.equations.scene_functions import scene_casadi, scene_derivatives
    from bellcrank.dynamics.inverse.scene_inverse_dynamics import scene_inverse_dynamics
    from bellcrank.errors import BellcrankError, CompileError, InputError, NotSavedError, UnreachableError
    from bellcrank.motion.generators.frame_motions import circle, line
    from bellcrank.motion.generators.point_to_point import point_to_point
    from bellcrank.motion.generators.tool_path import tool_path
    from bellcrank.motion.generators.waypoints import dwell, waypoints
    from bellcrank.motion.motion import Motion, join
    from bellcrank.motion.sampled.csv_file import read_motion, write_motion
    from bellcrank.planning.joint_path import JointPath, joint_path
    from bellcrank.planning.limits.motion_limits import MotionLimits
    from bellcrank.planning.repeated_cycle import repeated_cycle
    from bellcrank.planning.speed_scaling import speed_factor
    from bellcrank.planning.time_optimal import time_optimal
    from bellcrank.replays.replay import replay, show
    from bellcrank.reports.report import report
    from bellcrank.robot.checks.check import check_urdf
    from bellcrank.robot.load import load_robot
    from bellcrank.robot.model.payload import Payload
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.load import load
    from bellcrank.scene.scene import Scene, load_scene
    from bellcrank.simulation.files.load_run import load_run
    from bellcrank.simulation.prepared_simulation import prepare
    from bellcrank.simulation.simulate import simulate
    from bellcrank.simulation.trajectory.run_plot import plot_run as plot
    from bellcrank.sizing.judge import judge
    from bellcrank.sizing.selection.select import select
    from bellcrank.sizing.size import size
    from bellcrank.sizing.verification import verify_selection
    from bellcrank.studies.optimisation.front import pareto_front
    from bellcrank.studies.optimisation.optimise import optimise
    from bellcrank.studies.selection.select_designs import select_designs
    from bellcrank.studies.sweep import sobol_indices, sweep
    from bellcrank.studies.synthesis.synthesise import synthesise
    from bellcrank.version import version


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from bellcrank.version import version

        return version()
    if name == "results":
        return importlib.import_module("bellcrank.results")
    if name in _HOME:
        module, _, attribute = _HOME[name].partition(":")
        return getattr(importlib.import_module(f"bellcrank.{module}"), attribute or name)
    raise AttributeError(f"module 'bellcrank' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(__all__)
