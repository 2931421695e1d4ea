"""Drake's MultibodyPlant on scenes with constraints: in discrete time, since its continuous plants take none."""

from __future__ import annotations

import importlib
import time
from collections.abc import Iterator, Mapping
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from bellcrank_bench.bench.bench_problem import Array, Outcome, Problem, Run
from bellcrank_bench.peers import disk_start, substeps
from bellcrank_bench.textbook.reduced_coordinates import BricardRing, FourBar, RollingDisk

NOTE = "Simulator.AdvanceTo from output to output, made and initialised before the clock starts; SAP"


def runs(problem: Problem, settings: Mapping[str, Any]) -> Iterator[Run]:
    """Every step with every stiffness of the contact (N/m; loops are as stiff as the step allows)."""
    for step, stiffness in product(settings["step"], settings.get("stiffness", [0.0])):
        _, h = substeps(problem, step)
        if isinstance(problem.equations, FourBar):
            made = _four_bar(problem, h)
        elif isinstance(problem.equations, BricardRing):
            made = _ring(problem, h)
        else:
            made = _disk(problem, h, stiffness)
        label = f"h {h:.3g}" + (f", {stiffness:g} N/m" if stiffness else "")
        yield Run("Drake", "discrete, SAP", label, NOTE, partial(_run, problem, *made))


def _four_bar(problem: Problem, step: float) -> tuple[Any, Any, Array]:
    tree: Any = importlib.import_module("pydrake.multibody.tree")
    transform: Any = importlib.import_module("pydrake.math").RigidTransform
    equations = problem.equations
    assert isinstance(equations, FourBar)
    plant: Any = importlib.import_module("pydrake.multibody.plant").MultibodyPlant(time_step=step)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
    bodies = [
        plant.AddRigidBody(
            name, tree.SpatialInertia.MakeFromCentralInertia(mass, [center, 0, 0], tree.RotationalInertia(i, i, i))
        )
        for name, mass, center, i in zip(
            problem.joints, equations.mass, equations.center, equations.inertia, strict=True
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
    return plant, plant, problem.unreduced(np.array(problem.start))


def _ring(problem: Problem, step: float) -> tuple[Any, Any, Array]:
    """Five hinges; the sixth is held at two points, P5 and 1 m along its axis."""
    tree: Any = importlib.import_module("pydrake.multibody.tree")
    transform: Any = importlib.import_module("pydrake.math").RigidTransform
    equations = problem.equations
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
    # a body of its own, as Drake 1.51 crashes where a constraint takes hold of the world's
    about = tree.SpatialInertia.MakeFromCentralInertia(1.0, np.zeros(3), tree.RotationalInertia(1.0, 1.0, 1.0))
    ground = plant.AddRigidBody("ground", about)
    plant.WeldFrames(plant.world_frame(), ground.body_frame())
    for along in (np.zeros(3), np.array([1.0, 0.0, 0.0])):
        plant.AddBallConstraint(ground, np.array([0.0, 0.0, 1.0]) + along, body, at + along)
    plant.Finalize()
    return plant, plant, np.zeros(10)


def _disk(problem: Problem, step: float, stiffness: float) -> tuple[Any, Any, Array]:
    tree: Any = importlib.import_module("pydrake.multibody.tree")
    math: Any = importlib.import_module("pydrake.math")
    geometry: Any = importlib.import_module("pydrake.geometry")
    framework: Any = importlib.import_module("pydrake.systems.framework")
    module: Any = importlib.import_module("pydrake.multibody.plant")
    equations = problem.equations
    assert isinstance(equations, RollingDisk)
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
    q, v = disk_start(problem)
    turn = math.RotationMatrix(importlib.import_module("pydrake.common.eigen_geometry").Quaternion(*q[3:]))
    # Drake: quaternion, centre; angular velocity in world axes, velocity
    state = np.concatenate([q[3:], q[:3], turn.matrix() @ v[3:], v[:3]])
    return builder.Build(), plant, state


def _run(problem: Problem, system: Any, plant: Any, start: Array) -> Outcome:
    analysis: Any = importlib.import_module("pydrake.systems.analysis")
    simulator = analysis.Simulator(system)
    context = simulator.get_mutable_context()
    inner = context if plant is system else plant.GetMyMutableContextFromRoot(context)
    plant.SetPositionsAndVelocities(inner, start)
    simulator.Initialize()
    times = problem.times.tolist()
    position = np.empty((len(times), len(start) - plant.num_velocities()))
    advance, read = simulator.AdvanceTo, plant.GetPositions
    begun = time.perf_counter()
    position[0] = read(inner)
    for k in range(1, len(times)):
        advance(times[k])
        position[k] = read(inner)
    seconds = time.perf_counter() - begun
    if isinstance(problem.equations, BricardRing):
        position = problem.equations.corner_of(position)
    elif plant is not system:
        position = position[:, 4:]
    return Outcome(seconds, position, steps=round(times[-1] / plant.time_step()))
