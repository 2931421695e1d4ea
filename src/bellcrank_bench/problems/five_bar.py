"""Reference problem: a five-bar robot under PD control."""

from __future__ import annotations

import numpy as np

from bellcrank.dynamics.equations.system import system_of
from bellcrank.scene.scene import load_scene
from bellcrank.simulation.trajectory.trajectory import Trajectory
from bellcrank_bench.problems.checks import Check, constraints_satisfied, finished, largest
from bellcrank_bench.problems.problem import Problem


def judge(run: Trajectory) -> list[Check]:
    """Known: the energy changes by the work of motors and bearings; at rest in the end, the motor torques balance
    gravity in every motion that the constraint allows.
    """
    system = system_of(run.scene)
    jacobian = system.linearised_constraints(run.time[-1:], run.state[-1], run.inputs[-1], run.parameters)[2]
    allowed = np.linalg.svd(jacobian)[2][2:]
    gravity = run.robot.inverse_dynamics(run.position[-1], np.zeros(system.nv), np.zeros(system.nv))
    return [
        finished(run),
        Check("velocity at the end", largest(run.velocity[-1]), 1e-4, "rad/s"),
        Check("torques less gravity", largest(allowed @ (run.torque[-1] - gravity)), 1e-4, "N m"),
        Check("energy drift", run.energy_drift(), 1e-8),
        *constraints_satisfied(run),
    ]


PROBLEMS = (
    Problem(
        name="five_bar",
        title="five-bar robot under PD control, 3 s",
        source="balance of energy, and static equilibrium at the end",
        make=lambda: load_scene("five_bar"),
        judge=judge,
        settings={"duration": 3.0, "rtol": 1e-10, "atol": 1e-10},
    ),
)
