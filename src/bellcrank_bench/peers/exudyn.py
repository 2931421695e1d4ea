"""Exudyn: kinematic trees with loop joints, a mass point on a spring-damper, bodies with joints, a rolling joint."""

from __future__ import annotations

import contextlib
import importlib
import io
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from bellcrank.errors import BellcrankError
from bellcrank_bench.peers.peer import Outcome, Peer, Run
from bellcrank_bench.problems.checks import Array
from bellcrank_bench.problems.problem import Benchmark
from bellcrank_bench.textbook.bricard import BricardRing
from bellcrank_bench.textbook.four_bar import ReducedFourBar
from bellcrank_bench.textbook.n_four_bar import NFourBar
from bellcrank_bench.textbook.pendulum import SimplePendulum
from bellcrank_bench.textbook.planar_2r import PlanarTwoLink
from bellcrank_bench.textbook.rolling_disk import ReducedRollingDisk
from bellcrank_bench.textbook.spring_pendulum import SpringPendulum, cartesian, polar

NAME = "Exudyn"
ADAPTIVE = ("DOPRI5", "ODE23")
IMPLICIT = ("GeneralizedAlpha", "TrapezoidalIndex2")
NOTE = "SolveSteps alone (C++), module without range checks, no files, one sensor kept in memory"


@dataclass(frozen=True)
class Built:
    """A system that is assembled, its container, which owns it, and the sensor with its positions."""

    container: Any
    system: Any
    sensor: Any


def runs(benchmark: Benchmark, settings: Mapping[str, Any]) -> Iterator[Run]:
    """Every integrator at every step or tolerance, compared at the step ends that the sensor stored."""
    exu = _load()
    built = BUILDERS[type(benchmark.equations)](exu, benchmark)
    for solver, values in settings.items():
        for value in values:
            setting = f"{value:g}" if solver in ADAPTIVE else f"h {value:.3g}"
            once = partial(_run, exu, benchmark, built, solver, value)
            yield Run(tool=NAME, method=solver, setting=setting, note=NOTE, once=once)


def _load() -> Any:
    """Exudyn's module without range checks, unless another part of the process has loaded the slower one."""
    if "exudyn" not in sys.modules:
        sys.exudynFast = True  # type: ignore[attr-defined]  # how Exudyn is asked for it
    with contextlib.redirect_stdout(io.StringIO()):  # it prints which module it took
        return importlib.import_module("exudyn")


def _run(exu: Any, benchmark: Benchmark, built: Built, solver: str, value: float) -> Outcome:
    equations, settings = benchmark.equations, _settings(exu, benchmark, solver, value)
    if benchmark.constrained:
        settings.timeIntegration.newton.useModifiedNewton = True
    if isinstance(equations, NFourBar):
        settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    used = exu.MainSolverImplicitSecondOrder() if solver in IMPLICIT else exu.MainSolverExplicit()
    made = _integrate(built, settings, used)
    if isinstance(equations, SpringPendulum):
        return replace(made, position=polar(made.position + np.array(cartesian(benchmark.start)[0])))
    if isinstance(equations, NFourBar):
        return replace(made, position=made.position[:, 2:])
    return made


def _settings(exu: Any, benchmark: Benchmark, solver: str, value: float) -> Any:
    """Settings of a solver with its step in s, or its tolerance, without files and threads."""
    settings = exu.SimulationSettings()
    stepping, solution = settings.timeIntegration, settings.solution
    solution.file.write, solution.solverInformationFileName = False, ""
    solution.sensors.writePeriod = benchmark.times[1]
    settings.parallel.numberOfThreads = 1
    stepping.solverType = getattr(exu.DynamicSolverType, solver)
    stepping.endTime = benchmark.duration
    explicit = stepping.explicit
    explicit.computeEndOfStepAccelerations = explicit.useLieGroupIntegration = explicit.eliminateConstraints = False
    stepping.automaticStepSize = solver in ADAPTIVE
    if solver in ADAPTIVE:
        stepping.absoluteTolerance = stepping.relativeTolerance = value
        stepping.numberOfSteps = 1  # the largest step is the whole duration
        stepping.initialStepSize, stepping.minimumStepSize = 1e-3, 1e-12
    else:
        stepping.numberOfSteps = round(benchmark.duration / value)
    return settings


def _integrate(built: Built, settings: Any, used: Any) -> Outcome:
    """Run a solver; what the sensor stored at the step ends, without the time before and after SolveSteps."""
    used.InitializeSolver(built.system, settings)
    begun = time.perf_counter()
    done = used.SolveSteps(built.system, settings)
    seconds = time.perf_counter() - begun
    used.FinalizeSolver(built.system, settings)
    if not done:
        raise BellcrankError("Exudyn did not finish")
    kept: Array = np.array(built.system.GetSensorStoredData(built.sensor))
    steps = int(used.it.currentStepIndex)
    return Outcome(seconds=seconds, position=kept[:, 1:], time=kept[:, 0], steps=steps)


# ---- the scenes


def _new_system(exu: Any) -> tuple[Any, Any, Any]:
    """Exudyn's module of items, a container and its system."""
    container = exu.SystemContainer()
    return importlib.import_module("exudyn.itemInterface"), container, container.AddSystem()


def _joint_coordinates(item: Any, system: Any, position: Iterable[float], velocity: Iterable[float]) -> Any:
    """The node with the joint coordinates of a kinematic tree, with their initial values."""
    start = list(position)
    coordinates = {"referenceCoordinates": [0.0] * len(start), "numberOfODE2Coordinates": len(start)}
    initial = {"initialCoordinates": start, "initialCoordinates_t": list(velocity)}
    return system.AddNode(item.NodeGenericODE2(**coordinates, **initial))


def _spring_pendulum(exu: Any, benchmark: Benchmark) -> Built:
    """A mass point on a spring-damper: twice as fast as a kinematic tree of two joints."""
    item, container, system = _new_system(exu)
    equations: SpringPendulum = benchmark.equations
    place, speed = cartesian(benchmark.start)
    node = system.AddNode(item.NodePoint2D(referenceCoordinates=place, initialVelocities=speed))
    system.AddObject(item.ObjectMassPoint2D(nodeNumber=node, mass=equations.mass))
    ground = system.AddMarker(item.MarkerBodyPosition(bodyNumber=system.AddObject(item.ObjectGround())))
    point = system.AddMarker(item.MarkerNodePosition(nodeNumber=node))
    system.AddObject(
        item.ObjectConnectorSpringDamper(
            markerNumbers=[ground, point], stiffness=equations.stiffness, referenceLength=equations.free_length
        )
    )
    system.AddLoad(item.LoadForceVector(markerNumber=point, loadVector=[0.0, -equations.mass * equations.g, 0.0]))
    return _finished(exu, item, container, system, node)


def _open_chain(exu: Any, benchmark: Benchmark) -> Built:
    """A kinematic tree of one or two links."""
    item, container, system = _new_system(exu)
    equations: SimplePendulum | PlanarTwoLink = benchmark.equations
    count = benchmark.count
    node = _joint_coordinates(item, system, benchmark.start[:count], benchmark.start[count:])
    if isinstance(equations, SimplePendulum):
        offsets, centers = [[0.0] * 3], [[0.0, -equations.length, 0.0]]
        masses, inertias = [equations.mass], [np.zeros((3, 3))]
    else:
        offsets, centers = [[0.0] * 3, [equations.l1, 0.0, 0.0]], [[equations.r1, 0.0, 0.0], [equations.r2, 0.0, 0.0]]
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
    return _finished(exu, item, container, system, node)


def _four_bar(exu: Any, benchmark: Benchmark) -> Built:
    item, container, system = _new_system(exu)
    equations: ReducedFourBar = benchmark.equations
    start = benchmark.unreduced(np.array(benchmark.start))
    node = _joint_coordinates(item, system, start[:3], start[3:])
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


def _ring(exu: Any, benchmark: Benchmark) -> Built:
    """A tree of five hinges; the sixth without its redundant row, as Exudyn takes no redundant constraints."""
    item, container, system = _new_system(exu)
    equations: BricardRing = benchmark.equations
    rods = equations.rods
    node = _joint_coordinates(item, system, [0.0] * 5, [0.0] * 5)
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
    return Built(container, system, sensor)


def _n_four_bar(exu: Any, benchmark: Benchmark) -> Built:
    """Planar bodies with their centres as origins; x, y and the angle each."""
    item, container, system = _new_system(exu)
    equations: NFourBar = benchmark.equations
    ground = system.AddObject(item.ObjectGround())
    _, rate = benchmark.start

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


def _disk(exu: Any, benchmark: Benchmark) -> Built:
    item, container, system = _new_system(exu)
    equations: ReducedRollingDisk = benchmark.equations
    q, v = equations.free_body(np.array(benchmark.start))
    rigid: Any = importlib.import_module("exudyn.rigidBodyUtilities")
    turn, mass, r = rigid.EulerParameters2RotationMatrix(q[3:]), 0.5, equations.radius
    across, axial = 0.25 * mass * r * r, 0.5 * mass * r * r
    body = system.CreateRigidBody(
        nodeType=exu.NodeType.RotationEulerParameters, referencePosition=q[:3], referenceRotationMatrix=turn,
        inertia=rigid.RigidBodyInertia(mass, np.diag([across, axial, across])), initialVelocity=v[:3],
        initialAngularVelocity=turn @ v[3:], gravity=[0.0, 0.0, -equations.g], returnDict=True,
    )  # fmt: skip
    ground = system.AddMarker(item.MarkerBodyRigid(bodyNumber=system.AddObject(item.ObjectGround())))
    marker = system.AddMarker(item.MarkerBodyRigid(bodyNumber=body["bodyNumber"]))
    axes = {"constrainedAxes": [1, 1, 1], "discAxis": [0, 1, 0], "planeNormal": [0, 0, 1]}
    system.AddObject(item.ObjectJointRollingDisc(markerNumbers=[ground, marker], discRadius=r, **axes))
    return _finished(exu, item, container, system, body["nodeNumber"], "Position")


def _finished(exu: Any, item: Any, container: Any, system: Any, node: Any, output: str = "Coordinates") -> Built:
    kind = getattr(exu.OutputVariableType, output)
    sensor = system.AddSensor(item.SensorNode(nodeNumber=node, storeInternal=True, outputVariableType=kind))
    system.Assemble()
    return Built(container, system, sensor)


BUILDERS: dict[type, Callable[[Any, Benchmark], Built]] = {
    SimplePendulum: _open_chain,
    PlanarTwoLink: _open_chain,
    SpringPendulum: _spring_pendulum,
    ReducedFourBar: _four_bar,
    BricardRing: _ring,
    NFourBar: _n_four_bar,
    ReducedRollingDisk: _disk,
}


PEER = Peer(NAME, "exudyn", runs)
