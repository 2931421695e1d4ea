"""Derivatives of traced functions by the complex step: Im f(x + i h) / h, exact but for rounding as h is tiny.

The graph is evaluated by numpy, operation by operation, on all directions at once: neither the compiled code nor any
differentiation of expressions has a part in it.
Source: Squire & Trapp, Using Complex Variables to Estimate Derivatives of Real Functions, SIAM Review 40 (1998).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi
import numpy as np
from numpy.typing import NDArray

from bellcrank.codegen.expression_graph import graph_of
from bellcrank.robot.model.joints import unit_vectors
from bellcrank.robot.robot import Robot

Array = NDArray[np.float64]
STEP = 1e-40
OPERATIONS: dict[str, Callable[..., NDArray[np.complex128]]] = {
    "add": np.add, "sub": np.subtract, "mul": np.multiply, "div": np.divide, "neg": np.negative, "sqrt": np.sqrt,
    "sin": np.sin, "cos": np.cos, "sq": np.square, "twice": lambda x: 2.0 * x, "inv": np.reciprocal,
    "fmax": lambda x, y: np.where(x.real >= y.real, x, y),
}  # fmt: skip


def directional_derivatives(function: casadi.Function, at: Sequence[Array], along: Sequence[Array]) -> Array:
    """d function(at + s along) / ds at s = 0, (size, directions), for `along` of (size of input, directions) each."""
    graph = graph_of(function.serialize().encode("latin-1"))
    inputs = [x[:, None] + 1j * STEP * np.asarray(d) for x, d in zip(at, along, strict=True)]
    values: list[NDArray[np.complex128]] = []
    for node in graph.nodes:
        if node.op == "const":
            values.append(np.array([node.value + 0j]))
        elif node.op == "input":
            values.append(inputs[node.place[0]][node.place[1]])
        else:
            values.append(OPERATIONS[node.op](*(values[k] for k in node.args)))
    ((size, entries, nodes),) = graph.outputs
    found = np.zeros((size, along[0].shape[1]))
    for entry, node in zip(entries, nodes, strict=True):
        found[entry] = values[node].imag / STEP
    return found


def random_state(robot: Robot, seed: int = 1) -> tuple[Array, Array, Array]:
    """Positions with unit quaternions and headings, velocities, and accelerations or torques."""
    random = np.random.default_rng(seed)
    q = random.uniform(-1.5, 1.5, robot.nq)
    for part in unit_vectors(robot.joints):
        q[part] /= np.linalg.norm(q[part])
    return q, random.normal(size=robot.nv), random.normal(size=robot.nv)


def dynamics_derivatives(robot: Robot, algorithm: str, q: Array, v: Array, third: Array) -> list[Array]:
    """The derivatives of inverse or forward dynamics with friction, along E(q) δ for positions."""
    nv = robot.nv
    rates = robot.configuration_rate(np.tile(q, (nv, 1)), np.eye(nv)).T
    none, every = np.zeros((nv, nv)), np.eye(nv)
    along = [
        np.hstack([rates, np.zeros((robot.nq, 2 * nv))]), np.hstack([none, every, none]), np.hstack([none, none, every])
    ]  # fmt: skip
    found = directional_derivatives(robot.equations.dynamics(algorithm), (q, v, third), along)
    return np.hsplit(found, 3)
