"""Drake's MultibodyPlant in continuous time, under Simulator with its integrators."""

from __future__ import annotations

import importlib
import time
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from bellcrank_bench.bench.bench_problem import Array, Outcome, Problem, Run
from bellcrank_bench.peers import substeps
from bellcrank_bench.textbook.open_chains import SimplePendulum, SpringPendulum

NOTE = "Simulator.AdvanceTo from output to output, made and initialised before the clock starts"


def runs(problem: Problem, settings: Mapping[str, Mapping[str, Sequence[float]]]) -> Iterator[Run]:
    """Every integrator at every accuracy, and at every fixed step."""
    plant, start = _plant(problem)
    for scheme, accuracies in settings["adaptive"].items():
        for accuracy in accuracies:
            once = partial(_run, problem, plant, start, scheme, accuracy, None)
            yield Run("Drake", scheme, f"accuracy {accuracy:g}", NOTE, once)
    for scheme, steps in settings["fixed"].items():
        for step in steps:
            _, h = substeps(problem, step)
            once = partial(_run, problem, plant, start, scheme, 0.1, h)
            yield Run("Drake", f"{scheme} fixed", f"h {h:.3g}", NOTE, once)


def _plant(problem: Problem) -> tuple[Any, Array]:
    """The scene as a plant, and its start state (q, v)."""
    tree: Any = importlib.import_module("pydrake.multibody.tree")
    math: Any = importlib.import_module("pydrake.math")
    transform = math.RigidTransform

    def body(name: str, mass: float, center: float, inertia: float) -> Any:
        about = tree.RotationalInertia(inertia, inertia, inertia)
        return plant.AddRigidBody(name, tree.SpatialInertia.MakeFromCentralInertia(mass, [center, 0.0, 0.0], about))

    equations = problem.equations
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
        inner = body("inner", equations.m1, equations.r1, equations.i1)
        outer = body("outer", equations.m2, equations.r2, equations.i2)
        tip = tree.FixedOffsetFrame("tip", inner.body_frame(), transform([equations.l1, 0.0, 0.0]))
        plant.AddJoint(tree.RevoluteJoint("shoulder", world, inner.body_frame(), [0.0, 0.0, 1.0]))
        plant.AddJoint(tree.RevoluteJoint("elbow", plant.AddFrame(tip), outer.body_frame(), [0.0, 0.0, 1.0]))
    plant.Finalize()
    return plant, np.array(problem.start)


def _run(problem: Problem, plant: Any, start: Array, scheme: str, accuracy: float, step: float | None) -> Outcome:
    analysis: Any = importlib.import_module("pydrake.systems.analysis")
    simulator = analysis.Simulator(plant)
    config = analysis.SimulatorConfig(
        integration_scheme=scheme, accuracy=accuracy, use_error_control=step is None,
        max_step_size=problem.duration if step is None else step * (1 + 1e-9),  # no sliver of a step before an output
        publish_every_time_step=False,
    )  # fmt: skip
    analysis.ApplySimulatorConfig(config, simulator)
    context = simulator.get_mutable_context()
    context.SetTime(0.0)
    context.SetContinuousState(start)
    simulator.Initialize()
    times = problem.times.tolist()
    position = np.empty((len(times), problem.count))
    advance, read = simulator.AdvanceTo, plant.GetPositions
    begun = time.perf_counter()
    position[0] = start[: problem.count]
    for k in range(1, len(times)):
        advance(times[k])
        position[k] = read(context)
    seconds = time.perf_counter() - begun
    used = simulator.get_integrator()
    evaluations, steps = used.get_num_derivative_evaluations(), used.get_num_steps_taken()
    return Outcome(seconds, position, evaluations=evaluations, steps=steps)
