"""The classes of results, for annotations and `isinstance`: what the functions of bellcrank give back."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

_HOME = {
    "Result": "present.results",
    "Sizing": "sizing.result",
    "DriveVerdicts": "sizing.drive_verdicts",
    "SelectionVerification": "sizing.verification",
    "SizingSensitivity": "sizing.sensitivities",
    "JointSensitivity": "sizing.sensitivities",
    "Selection": "sizing.selection.selection",
    "Settings": "scene.settings",
    "PreparedSimulation": "simulation.prepared_simulation",
    "PreparedRun": "simulation.prepared_simulation",
    "Trajectory": "simulation.trajectory.trajectory",
    "RunSensitivity": "simulation.sensitivities.sensitivities",
    "EventSensitivity": "simulation.sensitivities.sensitivities",
    "Linearisation": "analysis.linearisation",
    "Mode": "analysis.modes",
    "RootLoci": "analysis.root_loci",
    "FloquetModes": "analysis.floquet",
    "DesignSelection": "studies.selection.design_selection",
    "ParetoFront": "studies.optimisation.pareto_result",
    "Optimum": "studies.optimisation.optimum",
    "Synthesis": "studies.synthesis.synthesis",
    "Sweep": "studies.results.sweep_result",
    "RepeatedCycle": "planning.cycle_result",
    "SpeedFactor": "planning.speed_scaling",
    "FastestMotion": "planning.fastest_motion",
    "LimitCost": "planning.fastest_motion",
    "Sensitivity": "studies.results.sensitivity",
    "SampleStatistics": "studies.results.sample_statistics",
    "SceneDerivatives": "dynamics.equations.scene_functions",
    "Slopes": "dynamics.equations.scene_functions",
    "Mobility": "dynamics.constraints.mobility",
}
__all__ = [  # written out, because type checkers do not evaluate it
    "DesignSelection",
    "DriveVerdicts",
    "EventSensitivity",
    "FastestMotion",
    "FloquetModes",
    "JointSensitivity",
    "LimitCost",
    "Linearisation",
    "Mobility",
    "Mode",
    "Optimum",
    "ParetoFront",
    "PreparedRun",
    "PreparedSimulation",
    "RepeatedCycle",
    "Result",
    "RootLoci",
    "RunSensitivity",
    "SampleStatistics",
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
]

if TYPE_CHECKING:
    from bellcrank.analysis.floquet import FloquetModes
    from bellcrank.analysis.linearisation import Linearisation
    from bellcrank.analysis.modes import Mode
    from bellcrank.analysis.root_loci import RootLoci
    from bellcrank.dynamics.constraints.mobility import Mobility
    from bellcrank.dynamics.equations.scene_functions import SceneDerivatives, Slopes
    from bellcrank.planning.cycle_result import RepeatedCycle
    from bellcrank.planning.fastest_motion import FastestMotion, LimitCost
    from bellcrank.planning.speed_scaling import SpeedFactor
    from bellcrank.present.results import Result
    from bellcrank.scene.settings import Settings
    from bellcrank.simulation.prepared_simulation import PreparedRun, PreparedSimulation
    from bellcrank.simulation.sensitivities.sensitivities import EventSensitivity, RunSensitivity
    from bellcrank.simulation.trajectory.trajectory import Trajectory
    from bellcrank.sizing.drive_verdicts import DriveVerdicts
    from bellcrank.sizing.result import Sizing
    from bellcrank.sizing.selection.selection import Selection
    from bellcrank.sizing.sensitivities import JointSensitivity, SizingSensitivity
    from bellcrank.sizing.verification import SelectionVerification
    from bellcrank.studies.optimisation.optimum import Optimum
    from bellcrank.studies.optimisation.pareto_result import ParetoFront
    from bellcrank.studies.results.sample_statistics import SampleStatistics
    from bellcrank.studies.results.sensitivity import Sensitivity
    from bellcrank.studies.results.sweep_result import Sweep
    from bellcrank.studies.selection.design_selection import DesignSelection
    from bellcrank.studies.synthesis.synthesis import Synthesis


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f"bellcrank.{_HOME[name]}"), name)
    raise AttributeError(f"module 'bellcrank.results' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(__all__)
