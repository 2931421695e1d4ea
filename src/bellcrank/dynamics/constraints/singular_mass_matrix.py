"""Refuse a scene whose mass matrix is singular along a motion that the constraints allow."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.codegen import cache as disk
from bellcrank.codegen.locks import making
from bellcrank.dynamics.constraints.constraint_rows import (
    ROUNDING,
    characteristic_length,
    massless_motions,
    rows_of,
    velocity_units,
)
from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.errors import InputError
from bellcrank.numerics import checked
from bellcrank.robot.model.joints import random_posture

if TYPE_CHECKING:
    from bellcrank.dynamics.equations.assembly import Assembly
    from bellcrank.scene.scene import Scene

POSTURES = 3
TAKES_PART = 1e-3  # of the largest component of such a motion: a coordinate with less takes no part in it
MISSED = 1e-6  # of the largest joint force: the residual up to which accelerations satisfy the equations


def refuse_singular_mass_matrix(scene: Scene) -> None:
    """Raise InputError, naming the joints, where accelerations do not follow from forces.

    That is so where, at every posture, the constraints allow a motion that moves no mass. A massless link at the end of
    a chain is accepted where no force acts on it, because the rest then moves as it should. The result for a scene's
    parameters is kept on disk.
    """
    if not rows_of(scene).massless:
        return
    key = "massless-" + disk.digest(scene.structure_key, scene.parameter_values.tobytes())
    stored: str | None = disk.load_data(key, str)
    if stored is None:
        with making:
            stored = _massless_joints(scene, system_of(scene).assembly) or ""
        disk.store(key, json.dumps(stored).encode())
    if stored:
        raise InputError(f"{scene.source}: {stored}")


def _massless_joints(scene: Scene, assembly: Assembly) -> str | None:
    """The joints that move no mass, whatever the posture, as a clause with its remedy; None where there are none."""
    random = np.random.default_rng(0)
    for _ in range(POSTURES):
        q = random_posture(scene.robot, random, characteristic_length(scene))
        mass, jacobian = _mass_and_jacobian(scene, assembly, q)
        checked(mass, f"{scene.source}: the mass matrix of '{scene.robot.name}' is")
        massless = massless_motions(mass, jacobian, scene)
        if not massless.size:
            return None
    own = mass.diagonal()
    heavy = own > ROUNDING * own.max(initial=0.0)
    motion = np.abs(massless).max(axis=1)
    if heavy.any() and motion[heavy].max() < TAKES_PART and _satisfied(scene, assembly, q, random):
        return None
    robot, urdf = scene.robot, scene.robot.urdf
    part = [j for j in robot.joints if motion[j.v : j.v + j.nv].max() > TAKES_PART * motion.max()]
    base = int(robot.floating_base and part[0] is robot.joints[0])
    who = ["the free base"] * base + [f"joint '{j.name}'" for j in part[base:]]
    links = [urdf.root] * base + [urdf.joints[j.name].child for j in part[base:]]
    bare = [name for name in links if urdf.links[name].inertial is None] or links
    return (
        f"the motion of {' and '.join(who)} has no inertia: the mass matrix is singular; give link "
        f"{' and '.join(repr(name) for name in bare)} mass and inertia, or make a joint there fixed"
    )


def _mass_and_jacobian(scene: Scene, assembly: Assembly, q: Array) -> tuple[Array, Array]:
    """M (nv, nv) and J (rows, nv) in a posture, in units of the characteristic length."""
    import casadi

    a, columns = assembly, velocity_units(scene)
    p = scene.parameter_values[: None if a.symbols.tracer_parameters.numel() else 0]
    mass = np.array(a.symbols.inertia()(q, np.eye(scene.robot.nv), p)) * np.outer(columns, columns)
    if a.solution is None:
        return mass, np.zeros((0, scene.robot.nv))
    f = casadi.Function("rows", [a.t, a.state, a.u, a.p], [a.solution.derivatives.jacobian])
    state = np.concatenate([q, np.zeros(system_of(scene).size - len(q))])
    rows = np.array(f(0.0, state, scene.signals_at(np.zeros(1))[0], system_parameters(scene)).full())
    return mass, rows / rows_of(scene).unit[:, None] * columns


def _satisfied(scene: Scene, assembly: Assembly, q: Array, random: np.random.Generator) -> bool:
    """Whether the computed accelerations at some velocity are finite and satisfy the equations of motion."""
    import casadi

    a = assembly
    forces = casadi.vertcat(a.bias, a.actuator, a.passive)
    f = casadi.Function("residual", [a.t, a.state, a.u, a.p], [a.acceleration, a.residual, forces])
    x = np.concatenate([q, random.normal(size=scene.robot.nv), np.zeros(int(a.has_work))])
    rate, missed, sizes = (np.array(y) for y in f(0.0, x, scene.signals_at(np.zeros(1))[0], system_parameters(scene)))
    return bool(np.isfinite(rate).all() and np.abs(missed).max() <= MISSED * np.abs(sizes).max())
