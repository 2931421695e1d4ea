"""Whether the equations of motion determine the accelerations, or the robot can move without moving any mass."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.codegen import cache as disk
from bellcrank.codegen.locks import making
from bellcrank.dynamics.constraint_rows import FIXED, ROUNDING, rows_of
from bellcrank.dynamics.system import system_of, system_parameters
from bellcrank.numerics import checked, eigenvectors, svd
from bellcrank.robot.joints import lengths_in_velocity, random_posture

if TYPE_CHECKING:
    from bellcrank.dynamics.assembly import Assembly
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]
POSTURES = 3
TAKES_PART = 1e-3  # of the largest share that a coordinate has in such a motion
MISSED = 1e-6  # of the largest joint force: accelerations that miss the equations by less satisfy them


def massless_motion(scene: Scene) -> str | None:
    """What can move without moving mass, whatever the posture, as a clause with its remedy; None where nothing can.

    With D² the diagonal of M = D R D and Z the null space of J D⁻¹, the least eigenvalue of Zᵀ R Z vanishes there. A
    massless link at the end of a chain is let pass where nothing pulls at it: the rest moves as it should. What was
    found at a scene's parameters is kept on disk.
    """
    key = "massless-" + disk.digest(scene.structure_key, scene.parameter_values.tobytes())
    stored: str | None = disk.load_data(key, str)
    if stored is None:
        with making:
            stored = _massless_motion(scene, system_of(scene).assembly) or ""
        disk.store(key, json.dumps(stored).encode())
    return stored or None


def _massless_motion(scene: Scene, assembly: Assembly) -> str | None:
    random = np.random.default_rng(0)
    for _ in range(POSTURES):
        q = random_posture(scene.robot, random, rows_of(scene).length)
        mass, jacobian = _inertia(scene, assembly, q)
        checked(mass, f"{scene.source}: the mass matrix of '{scene.robot.name}' is")
        own = mass.diagonal()
        heavy = own > ROUNDING * own.max(initial=0.0)
        size = np.sqrt(np.where(heavy, own, 1.0))
        _, values, vectors = svd(jacobian / size, f"{scene.source}: the closures' derivative is")
        free = vectors[np.count_nonzero(values > FIXED * values.max(initial=0.0)) :].T
        values, vectors = eigenvectors(
            free.T @ (mass / np.outer(size, size)) @ free, f"{scene.source}: the mass matrix is"
        )
        massless = free @ vectors[:, values < ROUNDING]
        if not massless.size:
            return None
    motion = np.abs(massless).max(axis=1)
    if heavy.any() and motion[heavy].max() < TAKES_PART and _satisfied(scene, assembly, q, random):
        return None
    robot, urdf = scene.robot, scene.robot.urdf
    part = [j for j in robot.joints if motion[j.v : j.v + j.nv].max() > TAKES_PART * motion.max()]
    base = int(part[0].kind == "floating")
    who = ["the free base"] * base + [f"joint '{j.name}'" for j in part[base:]]
    links = [urdf.root] * base + [urdf.joints[j.name].child for j in part[base:]]
    bare = [name for name in links if urdf.links[name].inertial is None] or links
    return (
        f"{' and '.join(who)} can move without moving any mass, so that accelerations do not follow from forces; give "
        f"link {' and '.join(repr(name) for name in bare)} mass and inertia, or make a joint there fixed"
    )


def _inertia(scene: Scene, assembly: Assembly, q: Array) -> tuple[Array, Array]:
    """M (nv, nv) and J (rows, nv) in a posture, lengths in units of the mechanism's own."""
    import casadi

    a, found = assembly, rows_of(scene)
    columns = np.where(lengths_in_velocity(scene.robot), found.length, 1.0)
    p = scene.parameter_values[: None if a.symbols.tracer_parameters.numel() else 0]
    mass = np.array(a.symbols.inertia()(q, np.eye(scene.robot.nv), p)) * np.outer(columns, columns)
    if a.solution is None:
        return mass, np.zeros((0, scene.robot.nv))
    f = casadi.Function("rows", [a.t, a.state, a.u, a.p], [a.solution.closed.jacobian])
    state = np.concatenate([q, np.zeros(system_of(scene).size - len(q))])
    rows = np.array(f(0.0, state, scene.signals_at(np.zeros(1))[0], system_parameters(scene)).full())
    return mass, rows / found.unit[:, None] * columns


def _satisfied(scene: Scene, assembly: Assembly, q: Array, random: np.random.Generator) -> bool:
    """Whether the accelerations that are computed at some velocity are finite and satisfy the equations of motion."""
    import casadi

    a = assembly
    forces = casadi.vertcat(a.bias, a.actuator, a.passive)
    f = casadi.Function("residual", [a.t, a.state, a.u, a.p], [a.acceleration, a.residual, forces])
    x = np.concatenate([q, random.normal(size=scene.robot.nv), np.zeros(int(a.has_work))])
    rate, missed, sizes = (np.array(y) for y in f(0.0, x, scene.signals_at(np.zeros(1))[0], system_parameters(scene)))
    return bool(np.isfinite(rate).all() and np.abs(missed).max() <= MISSED * np.abs(sizes).max())
