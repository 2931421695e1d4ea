"""Exudyn on scenes with constraints: a kinematic tree whose loop a joint closes, and a body on a rolling joint."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from bellcrank_bench.bench.bench_problem import Outcome, Problem, Run
from bellcrank_bench.peers import disk_start
from bellcrank_bench.peers.exudyn import NOTE, exudyn_module, integrate, step_settings
from bellcrank_bench.textbook.reduced_coordinates import BricardRing, FourBar, FourBars, RollingDisk


def runs(problem: Problem, settings: Mapping[str, Sequence[float]]) -> Iterator[Run]:
    """Every integrator at every step."""
    exu = exudyn_module()
    build = {BricardRing: _ring, FourBar: _four_bar, FourBars: _four_bars, RollingDisk: _disk}[type(problem.equations)]
    built = build(exu, problem)
    for solver, steps in settings.items():
        for step in steps:
            yield Run("Exudyn", solver, f"h {step:.3g}", NOTE, partial(_run, exu, problem, built, solver, step))


def _four_bar(exu: Any, problem: Problem) -> tuple[Any, Any, Any]:
    item: Any = importlib.import_module("exudyn.itemInterface")
    equations = problem.equations
    assert isinstance(equations, FourBar)
    container = exu.SystemContainer()
    system = container.AddSystem()
    start = problem.unreduced(np.array(problem.start))
    node = system.AddNode(
        item.NodeGenericODE2(
            referenceCoordinates=[0.0] * 3, initialCoordinates=list(start[:3]),
            initialCoordinates_t=list(start[3:]), numberOfODE2Coordinates=3,
        )
    )  # fmt: skip
    tree = system.AddObject(
        item.ObjectKinematicTree(
            nodeNumber=node, jointTypes=[exu.JointType.RevoluteZ] * 3, linkParents=[-1, 0, -1],
            jointTransformations=exu.Matrix3DList([np.eye(3)] * 3),
            jointOffsets=exu.Vector3DList([[x, 0.0, 0.0] for x in (0.0, equations.length[0], equations.ground)]),
            linkInertiasCOM=exu.Matrix3DList([np.diag([0.0, i, i]) for i in equations.inertia]),
            linkCOMs=exu.Vector3DList([[c, 0.0, 0.0] for c in equations.center]), linkMasses=list(equations.mass),
            jointPControlVector=[equations.stiffness, 0.0, 0.0],
            jointPositionOffsetVector=[equations.preload / equations.stiffness, 0.0, 0.0],
        )
    )  # fmt: skip
    ends = [
        system.AddMarker(
            item.MarkerKinematicTreeRigid(objectNumber=tree, linkNumber=k, localPosition=[equations.length[k], 0, 0])
        )
        for k in (1, 2)
    ]
    system.AddObject(item.ObjectJointSpherical(markerNumbers=ends, constrainedAxes=[1, 1, 0]))
    return _finished(exu, item, container, system, node)


def _ring(exu: Any, problem: Problem) -> tuple[Any, Any, Any]:
    """A tree of five hinges; the sixth without the row that repeats others, as Exudyn takes no dependent rows."""
    item: Any = importlib.import_module("exudyn.itemInterface")
    equations = problem.equations
    assert isinstance(equations, BricardRing)
    container = exu.SystemContainer()
    system = container.AddSystem()
    zero, rods = [0.0] * 5, equations.rods
    node = system.AddNode(
        item.NodeGenericODE2(
            referenceCoordinates=zero, initialCoordinates=zero, initialCoordinates_t=zero, numberOfODE2Coordinates=5
        )
    )
    kinds = [getattr(exu.JointType, f"Revolute{axis}") for axis in "YZXYZ"]
    tree = system.AddObject(
        item.ObjectKinematicTree(
            nodeNumber=node, jointTypes=kinds, linkParents=[-1, 0, 1, 2, 3],
            jointTransformations=exu.Matrix3DList([np.eye(3)] * 5),
            jointOffsets=exu.Vector3DList([[0.0] * 3, *rods[:4].tolist()]),
            linkInertiasCOM=exu.Matrix3DList(list(equations.inertias)),
            linkCOMs=exu.Vector3DList((rods / 2).tolist()), linkMasses=[1.0] * 5, gravity=[0.0, -equations.g, 0.0],
        )
    )  # fmt: skip
    end = item.MarkerKinematicTreeRigid(objectNumber=tree, linkNumber=4, localPosition=rods[4].tolist())
    place = item.MarkerBodyRigid(bodyNumber=system.AddObject(item.ObjectGround()), localPosition=[0.0, 0.0, 1.0])
    ends = [system.AddMarker(place), system.AddMarker(end)]
    system.AddObject(item.ObjectJointGeneric(markerNumbers=ends, constrainedAxes=[1, 1, 1, 0, 1, 0]))
    sensor = system.AddSensor(
        item.SensorKinematicTree(
            objectNumber=tree, linkNumber=3, localPosition=[0.0] * 3, storeInternal=True,
            outputVariableType=exu.OutputVariableType.Position,
        )
    )  # fmt: skip
    system.Assemble()
    return container, system, sensor


def _four_bars(exu: Any, problem: Problem) -> tuple[Any, Any, Any]:
    """Planar bodies at their centres; x, y and the angle each."""
    item: Any = importlib.import_module("exudyn.itemInterface")
    equations = problem.equations
    assert isinstance(equations, FourBars)
    container = exu.SystemContainer()
    system = container.AddSystem()
    ground = system.AddObject(item.ObjectGround())
    _, rate = problem.start

    def rod(place: list[float], velocity: list[float]) -> tuple[int, int]:
        node = system.AddNode(
            item.NodeRigidBody2D(referenceCoordinates=[*place, 0.0], initialCoordinates=[0.0, 0.0, 0.0],
                                 initialVelocities=velocity)
        )  # fmt: skip
        body = system.AddObject(item.ObjectRigidBody2D(nodeNumber=node, mass=1.0, inertia=1.0 / 12.0))
        center = system.AddMarker(item.MarkerBodyPosition(bodyNumber=body))
        system.AddLoad(item.LoadForceVector(markerNumber=center, loadVector=[0.0, -equations.g, 0.0]))
        return node, body

    def pin(first: int, at: list[float], second: int, there: list[float]) -> None:
        ends = [
            system.AddMarker(item.MarkerBodyPosition(bodyNumber=body, localPosition=[*place, 0.0]))
            for body, place in ((first, at), (second, there))
        ]
        system.AddObject(item.ObjectJointRevolute2D(markerNumbers=ends))

    count = equations.loops + 1
    cranks = [rod([k, 0.5], [-0.5 * rate, 0.0, rate]) for k in range(count)]
    couplers = [rod([k + 0.5, 1.0], [-rate, 0.0, 0.0])[1] for k in range(count - 1)]
    for k, (_, crank) in enumerate(cranks):
        pin(ground, [k, 0.0], crank, [0.0, -0.5])
    for k, coupler in enumerate(couplers):
        pin(cranks[k][1], [0.0, 0.5], coupler, [-0.5, 0.0])
        pin(cranks[k + 1][1], [0.0, 0.5], coupler, [0.5, 0.0])
    return _finished(exu, item, container, system, cranks[0][0])


def _disk(exu: Any, problem: Problem) -> tuple[Any, Any, Any]:
    item: Any = importlib.import_module("exudyn.itemInterface")
    q, v = disk_start(problem)
    equations = problem.equations
    assert isinstance(equations, RollingDisk)
    mass, r = 0.5, equations.radius
    container = exu.SystemContainer()
    system = container.AddSystem()
    rigid: Any = importlib.import_module("exudyn.rigidBodyUtilities")
    turn = rigid.EulerParameters2RotationMatrix(q[3:])
    across, axial = 0.25 * mass * r * r, 0.5 * mass * r * r
    body = system.CreateRigidBody(
        nodeType=exu.NodeType.RotationEulerParameters, referencePosition=q[:3], referenceRotationMatrix=turn,
        inertia=rigid.RigidBodyInertia(mass, np.diag([across, axial, across])), initialVelocity=v[:3],
        initialAngularVelocity=turn @ v[3:], gravity=[0.0, 0.0, -equations.g], returnDict=True,
    )  # fmt: skip
    ground = system.AddMarker(item.MarkerBodyRigid(bodyNumber=system.AddObject(item.ObjectGround())))
    marker = system.AddMarker(item.MarkerBodyRigid(bodyNumber=body["bodyNumber"]))
    system.AddObject(
        item.ObjectJointRollingDisc(
            markerNumbers=[ground, marker], constrainedAxes=[1, 1, 1], discRadius=r,
            discAxis=[0, 1, 0], planeNormal=[0, 0, 1],
        )
    )  # fmt: skip
    return _finished(exu, item, container, system, body["nodeNumber"], exu.OutputVariableType.Position)


def _finished(exu: Any, item: Any, container: Any, system: Any, node: Any, what: Any = None) -> tuple[Any, Any, Any]:
    kind = exu.OutputVariableType.Coordinates if what is None else what
    sensor = system.AddSensor(item.SensorNode(nodeNumber=node, storeInternal=True, outputVariableType=kind))
    system.Assemble()
    return container, system, sensor


def _run(exu: Any, problem: Problem, built: tuple[Any, Any, Any], solver: str, step: float) -> Outcome:
    settings = step_settings(exu, problem, solver, step)
    settings.timeIntegration.newton.useModifiedNewton = True
    if isinstance(problem.equations, FourBars):
        settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    made = integrate(exu, built[1], built[2], settings, exu.MainSolverImplicitSecondOrder())
    if isinstance(problem.equations, FourBars):
        return replace(made, position=made.position[:, 2:])
    return made
