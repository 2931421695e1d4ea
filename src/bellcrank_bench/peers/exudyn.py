"""Exudyn in minimal coordinates: a kinematic tree for the arm, a mass point on a spring-damper for the pendulum."""

from __future__ import annotations

import contextlib
import importlib
import io
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from bellcrank.errors import BellcrankError
from bellcrank_bench.bench.bench_problem import Array, Outcome, Problem, Run, cartesian, polar
from bellcrank_bench.textbook.open_chains import SimplePendulum, SpringPendulum

ADAPTIVE = ("DOPRI5", "ODE23")
IMPLICIT = ("GeneralizedAlpha", "TrapezoidalIndex2")
NOTE = "SolveSteps alone (C++), module without range checks, no files, one sensor kept in memory"


def exudyn_module() -> Any:
    """Exudyn's module without range checks, unless another part of the process has loaded the slower one."""
    if "exudyn" not in sys.modules:
        sys.exudynFast = True  # type: ignore[attr-defined]  # how Exudyn is asked for it
    with contextlib.redirect_stdout(io.StringIO()):  # it says which module it took
        return importlib.import_module("exudyn")


def runs(problem: Problem, settings: Mapping[str, Sequence[float]]) -> Iterator[Run]:
    """Every integrator at every step or tolerance, compared at the step ends that the sensor kept."""
    exu = exudyn_module()
    keep, system, sensor = _system(exu, problem)
    for solver, values in settings.items():
        for value in values:
            setting = f"{value:g}" if solver in ADAPTIVE else f"h {value:.3g}"
            once = partial(_run, exu, problem, (keep, system, sensor), solver, value)
            yield Run("Exudyn", solver, setting, NOTE, once)


def _system(exu: Any, problem: Problem) -> tuple[Any, Any, Any]:
    item: Any = importlib.import_module("exudyn.itemInterface")
    equations = problem.equations
    container = exu.SystemContainer()
    system = container.AddSystem()
    coordinates = exu.OutputVariableType.Coordinates
    if isinstance(equations, SpringPendulum):  # twice as fast as a kinematic tree of two joints
        place, speed = cartesian(problem.start)
        node = system.AddNode(item.NodePoint2D(referenceCoordinates=place, initialVelocities=speed))
        system.AddObject(item.ObjectMassPoint2D(nodeNumber=node, mass=equations.mass))
        ground = system.AddMarker(item.MarkerBodyPosition(bodyNumber=system.AddObject(item.ObjectGround())))
        point = system.AddMarker(item.MarkerNodePosition(nodeNumber=node))
        system.AddObject(
            item.ObjectConnectorSpringDamper(
                markerNumbers=[ground, point], stiffness=equations.stiffness, referenceLength=equations.free_length
            )
        )
        weight = [0.0, -equations.mass * equations.g, 0.0]
        system.AddLoad(item.LoadForceVector(markerNumber=point, loadVector=weight))
    else:
        count = problem.count
        node = system.AddNode(
            item.NodeGenericODE2(
                referenceCoordinates=[0.0] * count, initialCoordinates=list(problem.start[:count]),
                initialCoordinates_t=list(problem.start[count:]), numberOfODE2Coordinates=count,
            )
        )  # fmt: skip
        if isinstance(equations, SimplePendulum):
            offsets, centers = [[0.0] * 3], [[0.0, -equations.length, 0.0]]
            masses, inertias = [equations.mass], [np.zeros((3, 3))]
        else:
            offsets, centers = (
                [[0.0] * 3, [equations.l1, 0.0, 0.0]],
                [[r, 0.0, 0.0] for r in (equations.r1, equations.r2)],
            )
            masses = [equations.m1, equations.m2]
            inertias = [np.diag([0.0, inertia, inertia]) for inertia in (equations.i1, equations.i2)]
        system.AddObject(
            item.ObjectKinematicTree(
                nodeNumber=node, jointTypes=[exu.JointType.RevoluteZ] * count,
                linkParents=list(range(-1, count - 1)), jointTransformations=exu.Matrix3DList([np.eye(3)] * count),
                jointOffsets=exu.Vector3DList(offsets), linkInertiasCOM=exu.Matrix3DList(inertias),
                linkCOMs=exu.Vector3DList(centers), linkMasses=masses, gravity=[0.0, -equations.g, 0.0],
            )
        )  # fmt: skip
    sensor = system.AddSensor(item.SensorNode(nodeNumber=node, storeInternal=True, outputVariableType=coordinates))
    system.Assemble()
    return container, system, sensor


def step_settings(exu: Any, problem: Problem, solver: str, value: float) -> Any:
    """Settings of a solver with its step in s, or its tolerance, without files and threads."""
    settings = exu.SimulationSettings()
    stepping, solution = settings.timeIntegration, settings.solution
    solution.file.write, solution.solverInformationFileName = False, ""
    solution.sensors.writePeriod = problem.times[1]
    settings.parallel.numberOfThreads = 1
    stepping.solverType = getattr(exu.DynamicSolverType, solver)
    stepping.endTime = problem.duration
    explicit = stepping.explicit
    explicit.computeEndOfStepAccelerations = explicit.useLieGroupIntegration = explicit.eliminateConstraints = False
    stepping.automaticStepSize = solver in ADAPTIVE
    if solver in ADAPTIVE:
        stepping.absoluteTolerance = stepping.relativeTolerance = value
        stepping.numberOfSteps = 1  # the largest step is the whole duration
        stepping.initialStepSize, stepping.minimumStepSize = 1e-3, 1e-12
    else:
        stepping.numberOfSteps = round(problem.duration / value)
    return settings


def _run(exu: Any, problem: Problem, built: tuple[Any, Any, Any], solver: str, value: float) -> Outcome:
    _, system, sensor = built
    settings = step_settings(exu, problem, solver, value)
    used = exu.MainSolverImplicitSecondOrder() if solver in IMPLICIT else exu.MainSolverExplicit()
    made = integrate(exu, system, sensor, settings, used)
    if isinstance(problem.equations, SpringPendulum):
        place = polar(made.position + np.array(cartesian(problem.start)[0]))
        return replace(made, position=place)
    return made


def integrate(exu: Any, system: Any, sensor: Any, settings: Any, used: Any) -> Outcome:
    """Run a solver; what the sensor kept at the step ends, without the time before and after SolveSteps."""
    used.InitializeSolver(system, settings)
    begun = time.perf_counter()
    done = used.SolveSteps(system, settings)
    seconds = time.perf_counter() - begun
    used.FinalizeSolver(system, settings)
    if not done:
        raise BellcrankError("Exudyn did not finish")
    kept: Array = np.array(system.GetSensorStoredData(sensor))
    return Outcome(seconds, kept[:, 1:], kept[:, 0], steps=int(used.it.currentStepIndex))
