"""Drake's MultibodyPlant under Simulator: in continuous time with its integrators, or in discrete time with
constraints, as its continuous plants take none.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Iterator, Mapping
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from bellcrank_bench.peers.peer import Outcome, Peer, Run, substeps
from bellcrank_bench.problems.checks import Array
from bellcrank_bench.problems.problem import Benchmark
from bellcrank_bench.textbook.bricard import BricardRing
from bellcrank_bench.textbook.four_bar import ReducedFourBar
from bellcrank_bench.textbook.pendulum import SimplePendulum
from bellcrank_bench.textbook.planar_2r import PlanarTwoLink
from bellcrank_bench.textbook.rolling_disk import ReducedRollingDisk
from bellcrank_bench.textbook.spring_pendulum import SpringPendulum

NAME = "Drake"
NOTE = "Simulator.AdvanceTo from output to output, made and initialised before the clock starts"


def runs(benchmark: Benchmark, settings: Mapping[str, Any]) -> Iterator[Run]:
    """Every integrator at every accuracy and fixed step; with constraints every step and contact stiffness (N/m)."""
    importlib.import_module("pydrake")
    return (_discrete_runs if benchmark.constrained else _continuous_runs)(benchmark, settings)


def _continuous_runs(benchmark: Benchmark, settings: Mapping[str, Any]) -> Iterator[Run]:
    plant, start = _plant(benchmark)
    for scheme, accuracies in settings["adaptive"].items():
        for accuracy in accuracies:
            once = partial(_continuous_run, benchmark, plant, start, scheme, accuracy, None)
            yield Run(tool=NAME, method=scheme, setting=f"accuracy {accuracy:g}", note=NOTE, once=once)
    for scheme, steps in settings["fixed"].items():
        for step in steps:
            _, h = substeps(benchmark, step)
            once = partial(_continuous_run, benchmark, plant, start, scheme, 0.1, h)
            yield Run(tool=NAME, method=f"{scheme} fixed", setting=f"h {h:.3g}", note=NOTE, once=once)


def _discrete_runs(benchmark: Benchmark, settings: Mapping[str, Any]) -> Iterator[Run]:
    # the loops are as stiff as the step allows
    for step, stiffness in product(settings["step"], settings.get("stiffness", [0.0])):
        _, h = substeps(benchmark, step)
        if isinstance(benchmark.equations, ReducedFourBar):
            made = _four_bar(benchmark, h)
        elif isinstance(benchmark.equations, BricardRing):
            made = _ring(benchmark, h)
        else:
            made = _disk(benchmark, h, stiffness)
        label = f"h {h:.3g}" + (f", {stiffness:g} N/m" if stiffness else "")
        once = partial(_discrete_run, benchmark, *made)
        yield Run(tool=NAME, method="discrete, SAP", setting=label, note=f"{NOTE}; SAP", once=once)


def _plant(benchmark: Benchmark) -> tuple[Any, Array]:
    """The scene as a plant, and its start state (q, v)."""
    tree: Any = importlib.import_module("pydrake.multibody.tree")
    math: Any = importlib.import_module("pydrake.math")
    transform = math.RigidTransform

    def body(name: str, mass: float, center: float, inertia: float) -> Any:
        about = tree.RotationalInertia(inertia, inertia, inertia)
        return plant.AddRigidBody(name, tree.SpatialInertia.MakeFromCentralInertia(mass, [center, 0.0, 0.0], about))

    equations = benchmark.equations
    plant: Any = importlib.import_module("pydrake.multibody.plant").MultibodyPlant(time_step=0.0)
    plant.mutable_gravity_field().set_gravity_vector([0.0, -equations.g, 0.0])
    world = plant.world_frame()
    if isinstance(equations, SpringPendulum):
        arm = plant.AddRigidBody("arm", tree.SpatialInertia.Zero())
        point = body("point", equations.mass, 0.0, 0.0)
        plant.AddJoint(tree.RevoluteJoint("swing", world, arm.body_frame(), [0.0, 0.0, 1.0]))
        slide = tree.PrismaticJoint("spring", arm.body_frame(), point.body_frame(), [0.0, -1.0, 0.0])
        plant.AddForceElement(tree.PrismaticSpring(plant.AddJoint(slide), equations.free_length, equations.stiffness))
    elif isinstance(equations, SimplePendulum):
        # hanging along x at angle 0 of a joint whose frame is turned by -90 deg
        rod = body("rod", equations.mass, equations.length, 0.0)
        turned = transform(math.RollPitchYaw(0.0, 0.0, -np.pi / 2), [0.0, 0.0, 0.0])
        frame = plant.AddFrame(tree.FixedOffsetFrame("hanging", world, turned))
        plant.AddJoint(tree.RevoluteJoint("swing", frame, rod.body_frame(), [0.0, 0.0, 1.0]))
    else:
        assert isinstance(equations, PlanarTwoLink)
        inner = body("inner", equations.m1, equations.r1, equations.i1)
        outer = body("outer", equations.m2, equations.r2, equations.i2)
        tip = tree.FixedOffsetFrame("tip", inner.body_frame(), transform([equations.l1, 0.0, 0.0]))
        plant.AddJoint(tree.RevoluteJoint("shoulder", world, inner.body_frame(), [0.0, 0.0, 1.0]))
        plant.AddJoint(tree.RevoluteJoint("elbow", plant.AddFrame(tip), outer.body_frame(), [0.0, 0.0, 1.0]))
    plant.Finalize()
    return plant, np.array(benchmark.start)


def _four_bar(benchmark: Benchmark, step: float) -> tuple[Any, Any, Array]:
    tree: Any = importlib.import_module("pydrake.multibody.tree")
    transform: Any = importlib.import_module("pydrake.math").RigidTransform
    equations = benchmark.equations
    assert isinstance(equations, ReducedFourBar)
    plant: Any = importlib.import_module("pydrake.multibody.plant").MultibodyPlant(time_step=step)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
    bodies = [
        plant.AddRigidBody(
            name, tree.SpatialInertia.MakeFromCentralInertia(mass, [center, 0, 0], tree.RotationalInertia(i, i, i))
        )
        for name, mass, center, i in zip(
            benchmark.joints, equations.mass, equations.center, equations.inertia, strict=True
        )
    ]
    world, axis = plant.world_frame(), [0.0, 0.0, 1.0]

    def pin(name: str, parent: Any, offset: float, child: Any) -> Any:
        at = plant.AddFrame(tree.FixedOffsetFrame(f"{name}_pin", parent, transform([offset, 0.0, 0.0])))
        return plant.AddJoint(tree.RevoluteJoint(name, at, child.body_frame(), axis))

    crank = pin("crank", world, 0.0, bodies[0])
    pin("coupler", bodies[0].body_frame(), equations.length[0], bodies[1])
    pin("rocker", world, equations.ground, bodies[2])
    plant.AddForceElement(tree.RevoluteSpring(crank, equations.preload / equations.stiffness, equations.stiffness))
    ends = [[length, 0.0, 0.0] for length in equations.length[1:]]
    plant.AddBallConstraint(bodies[1], ends[0], bodies[2], ends[1])
    plant.Finalize()
    return plant, plant, benchmark.unreduced(np.array(benchmark.start))


def _ring(benchmark: Benchmark, step: float) -> tuple[Any, Any, Array]:
    """Five hinges; the sixth is closed at two points, P5 and 1 m along its axis."""
    tree: Any = importlib.import_module("pydrake.multibody.tree")
    transform: Any = importlib.import_module("pydrake.math").RigidTransform
    equations = benchmark.equations
    assert isinstance(equations, BricardRing)
    plant: Any = importlib.import_module("pydrake.multibody.plant").MultibodyPlant(time_step=step)
    plant.mutable_gravity_field().set_gravity_vector([0.0, -equations.g, 0.0])
    parent, at, axes = plant.world_frame(), np.zeros(3), np.eye(3)[[1, 2, 0, 1, 2]]
    for k, (rod, inertia, axis) in enumerate(zip(equations.rods, equations.inertias, axes, strict=True)):
        about = tree.RotationalInertia(*np.diag(inertia))
        body = plant.AddRigidBody(f"rod_{k}", tree.SpatialInertia.MakeFromCentralInertia(1.0, rod / 2, about))
        place = plant.AddFrame(tree.FixedOffsetFrame(f"corner_{k}", parent, transform(at)))
        plant.AddJoint(tree.RevoluteJoint(f"hinge_{k}", place, body.body_frame(), axis))
        parent, at = body.body_frame(), rod
    # a body welded to the world, as Drake 1.51 crashes if a constraint acts on the world itself
    about = tree.SpatialInertia.MakeFromCentralInertia(1.0, np.zeros(3), tree.RotationalInertia(1.0, 1.0, 1.0))
    ground = plant.AddRigidBody("ground", about)
    plant.WeldFrames(plant.world_frame(), ground.body_frame())
    for along in (np.zeros(3), np.array([1.0, 0.0, 0.0])):
        plant.AddBallConstraint(ground, np.array([0.0, 0.0, 1.0]) + along, body, at + along)
    plant.Finalize()
    return plant, plant, np.zeros(10)


def _disk(benchmark: Benchmark, step: float, stiffness: float) -> tuple[Any, Any, Array]:
    tree: Any = importlib.import_module("pydrake.multibody.tree")
    math: Any = importlib.import_module("pydrake.math")
    geometry: Any = importlib.import_module("pydrake.geometry")
    framework: Any = importlib.import_module("pydrake.systems.framework")
    module: Any = importlib.import_module("pydrake.multibody.plant")
    equations = benchmark.equations
    assert isinstance(equations, ReducedRollingDisk)
    builder = framework.DiagramBuilder()
    plant, _ = module.AddMultibodyPlantSceneGraph(builder, step)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -equations.g])
    mass, r = 0.5, equations.radius
    across, axial = 0.25 * mass * r * r, 0.5 * mass * r * r
    about = tree.RotationalInertia(across, axial, across)
    disk = plant.AddRigidBody("disk", tree.SpatialInertia.MakeFromCentralInertia(mass, [0.0, 0.0, 0.0], about))
    properties = geometry.ProximityProperties()
    geometry.AddContactMaterial(0.0, stiffness, module.CoulombFriction(3.0, 3.0), properties)  # no dissipation
    turned = math.RigidTransform(math.RollPitchYaw(np.pi / 2, 0.0, 0.0), [0.0, 0.0, 0.0])
    plant.RegisterCollisionGeometry(disk, turned, geometry.Cylinder(r, 1e-4), "rim", properties)
    plant.RegisterCollisionGeometry(
        plant.world_body(), math.RigidTransform(), geometry.HalfSpace(), "floor", properties
    )
    plant.Finalize()
    q, v = equations.free_body(np.array(benchmark.start))
    turn = math.RotationMatrix(importlib.import_module("pydrake.common.eigen_geometry").Quaternion(*q[3:]))
    # Drake: quaternion, centre; angular velocity in world axes, velocity
    state = np.concatenate([q[3:], q[:3], turn.matrix() @ v[3:], v[:3]])
    return builder.Build(), plant, state


def _continuous_run(
    benchmark: Benchmark, plant: Any, start: Array, scheme: str, accuracy: float, step: float | None
) -> Outcome:
    analysis: Any = importlib.import_module("pydrake.systems.analysis")
    simulator = analysis.Simulator(plant)
    config = analysis.SimulatorConfig(
        integration_scheme=scheme, accuracy=accuracy, use_error_control=step is None,
        max_step_size=benchmark.duration if step is None else step * (1 + 1e-9),  # no tiny step before an output
        publish_every_time_step=False,
    )  # fmt: skip
    analysis.ApplySimulatorConfig(config, simulator)
    context = simulator.get_mutable_context()
    context.SetTime(0.0)
    context.SetContinuousState(start)
    simulator.Initialize()
    times = benchmark.times.tolist()
    position = np.empty((len(times), benchmark.count))
    advance, read = simulator.AdvanceTo, plant.GetPositions
    begun = time.perf_counter()
    position[0] = start[: benchmark.count]
    for k in range(1, len(times)):
        advance(times[k])
        position[k] = read(context)
    seconds = time.perf_counter() - begun
    used = simulator.get_integrator()
    evaluations, steps = used.get_num_derivative_evaluations(), used.get_num_steps_taken()
    return Outcome(seconds=seconds, position=position, evaluations=evaluations, steps=steps)


def _discrete_run(benchmark: Benchmark, system: Any, plant: Any, start: Array) -> Outcome:
    analysis: Any = importlib.import_module("pydrake.systems.analysis")
    simulator = analysis.Simulator(system)
    context = simulator.get_mutable_context()
    inner = context if plant is system else plant.GetMyMutableContextFromRoot(context)
    plant.SetPositionsAndVelocities(inner, start)
    simulator.Initialize()
    times = benchmark.times.tolist()
    position = np.empty((len(times), len(start) - plant.num_velocities()))
    advance, read = simulator.AdvanceTo, plant.GetPositions
    begun = time.perf_counter()
    position[0] = read(inner)
    for k in range(1, len(times)):
        advance(times[k])
        position[k] = read(inner)
    seconds = time.perf_counter() - begun
    if isinstance(benchmark.equations, BricardRing):
        position = benchmark.equations.corner_of(position)
    elif plant is not system:
        position = position[:, 4:]
    return Outcome(seconds=seconds, position=position, steps=round(times[-1] / plant.time_step()))


PEER = Peer(NAME, "drake", runs)
