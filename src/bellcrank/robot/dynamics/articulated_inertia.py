"""The articulated inertia of each joint: its inertia about its own axis when all joints beyond it move freely."""

from __future__ import annotations

from typing import Any

from bellcrank.robot.formats.urdf_file import Urdf
from bellcrank.robot.model.pinocchio_model import plain_model

POSTURES, SEED = 5, 20240229
RELATIVE = 1e-10  # of the joint's entry of the mass matrix: below this, nothing but round-off is left
ABSOLUTE = 1e-14  # of the robot's mass (times its squared size for a turning joint)


def articulated_inertias(urdf: Urdf, model: Any = None) -> dict[str, tuple[float, float]]:
    """The articulated inertia of each independent joint about its axis, and the threshold below which it counts as 0.

    The articulated inertia is D = Sᵀ I_A S of Featherstone's articulated-body algorithm (Rigid Body Dynamics
    Algorithms, 2008, section 7.3), kg m² (kg for sliding joints), here the pivots of eliminating the mass
    matrix from the tips to the base. The result is the one of the largest magnitude over POSTURES seeded random
    postures: where that vanishes, forward dynamics is undefined. For a planar or floating joint it is the
    smallest of its coordinates. `model` is the pinocchio.Model of the URDF with more bodies, such as payloads; it
    has a fixed base and no mimic joints.
    """
    import numpy as np
    import pinocchio as pin

    if model is None:
        model = plain_model(urdf)
    if model.nv == 0:
        return {}
    names = [""] * model.nv
    for name in urdf.joints:
        if model.existJointName(name):
            joint = model.joints[model.getJointId(name)]
            names[joint.idx_v : joint.idx_v + joint.nv] = [name] * joint.nv
    reduction, kept = _independent(urdf, names)
    random = np.random.default_rng(SEED)
    pivots, diagonals, size = [], [], 1e-3
    for _ in range(POSTURES):
        step = random.uniform(-np.pi, np.pi, model.nv)
        for index, name in enumerate(names):
            if urdf.joints[name].type == "prismatic":
                step[index] = random.uniform(-0.1, 0.1)
        q = pin.integrate(model, pin.neutral(model), _followed(urdf, names, step))
        matrix, placements = mass_matrix(model, q)
        plain = len(kept) == model.nv
        reduced = matrix if plain else reduction.T @ matrix @ reduction
        size = max([size, *(float(np.linalg.norm(placement.translation)) for placement in placements)])
        diagonals.append(np.diag(reduced).copy())
        pivots.append(_pivots(reduced))
    magnitude = np.max(np.abs(pivots), axis=0)
    chosen = np.asarray(pivots)[np.argmax(np.abs(pivots), axis=0), np.arange(len(kept))]
    mass = sum(link.inertial.mass for link in urdf.links.values() if link.inertial is not None)
    found: dict[str, tuple[float, float]] = {}
    for index, original in enumerate(kept):
        name = names[original]
        scale = mass if urdf.joints[name].type == "prismatic" else mass * size**2
        threshold = float(RELATIVE * np.max(np.abs(np.asarray(diagonals)[:, index])) + ABSOLUTE * scale)
        if name not in found or magnitude[index] < abs(found[name][0]):
            found[name] = (float(chosen[index]), threshold)
    return found


def mass_matrix(model: Any, q: Any) -> tuple[Any, list[Any]]:
    """The mass matrix (nv, nv) of a pinocchio.Model without mimic joints, and the placements of its joints.

    By composite inertias in world axes (Featherstone 2008, section 6.2). Pinocchio's own function needs its Data, which
    holds four arrays of nv x nv x nv numbers: 2 GB for 400 joints.
    """
    import numpy as np
    import pinocchio as pin

    placements = [pin.SE3.Identity()]
    axes, owner = np.zeros((6, model.nv)), np.zeros(model.nv, dtype=int)
    inertias = np.zeros((model.njoints, 6, 6))
    carries = np.eye(model.njoints, dtype=bool)  # whether a joint (row) carries another one, or is it
    for k in range(1, model.njoints):
        joint, parent = model.joints[k], model.parents[k]
        state = joint.createData()
        joint.calc(state, q)
        placements.append(placements[parent] * model.jointPlacements[k] * state.M)
        columns = slice(joint.idx_v, joint.idx_v + joint.nv)
        axes[:, columns] = placements[k].action @ np.reshape(state.S, (6, joint.nv))
        owner[columns] = k
        inertias[k] = placements[k].act(model.inertias[k]).matrix()
        carries[:, k] |= carries[:, parent]
    for k in range(model.njoints - 1, 0, -1):
        inertias[model.parents[k]] += inertias[k]
    forces = np.einsum("kij,jk->ik", inertias[owner], axes)
    above = carries[np.ix_(owner, owner)]
    half = np.where(above, axes.T @ forces, 0.0)
    return np.where(above, half, half.T) + np.diag(model.armature), placements


def _independent(urdf: Urdf, names: list[str]) -> tuple[Any, list[int]]:
    """G in v = G v_independent (nv, kept), and the kept indices: mimic followers move with their leader."""
    import numpy as np

    kept = [index for index, name in enumerate(names) if urdf.joints[name].mimic is None]
    matrix = np.zeros((len(names), len(kept)))
    for index, name in enumerate(names):
        mimic = urdf.joints[name].mimic
        if mimic is None:
            matrix[index, kept.index(index)] = 1.0
        else:
            matrix[index, kept.index(names.index(mimic.joint))] = mimic.multiplier
    return matrix, kept


def _followed(urdf: Urdf, names: list[str], step: Any) -> Any:
    """The step with mimicking joints where their leaders put them."""
    for index, name in enumerate(names):
        mimic = urdf.joints[name].mimic
        if mimic is not None:
            step[index] = mimic.multiplier * step[names.index(mimic.joint)] + mimic.offset
    return step


def _pivots(matrix: Any) -> Any:
    """The pivots (n,) of eliminating a symmetric matrix from its last row to its first; zeros are skipped.

    Joints that do not carry each other have zeros in common, and eliminating one leaves the other's row as it is.
    """
    import numpy as np

    remaining = matrix.copy()
    pivots = np.zeros(len(remaining))
    for k in range(len(remaining) - 1, -1, -1):
        pivots[k] = remaining[k, k]
        if abs(pivots[k]) > RELATIVE * abs(matrix[k, k]) > 0.0:
            column = remaining[:k, k] / pivots[k]
            rows = np.flatnonzero(column)
            if 2 * len(rows) > k:
                remaining[:k, :k] -= np.outer(column, remaining[k, :k])
            elif len(rows):
                remaining[np.ix_(rows, rows)] -= np.outer(column[rows], remaining[k, rows])
    return pivots


def vanishing_pivots(matrices: Any) -> Any:
    """Which articulated inertias (nv,) vanish in all of these mass matrices (n, nv, nv), up to rounding."""
    import numpy as np

    pivots = np.max([np.abs(_pivots(matrix)) for matrix in matrices], axis=0)
    diagonal = np.abs(np.diagonal(matrices, axis1=1, axis2=2)).max(axis=0)
    return pivots <= RELATIVE * diagonal + ABSOLUTE * diagonal.max(initial=0.0)


def vanishing_inertia(urdf: Urdf, name: str, least: float) -> str:
    """The sentence about a joint about whose axis there is no inertia (`least`, kg m² or kg)."""
    what = "mass" if urdf.joints[name].type == "prismatic" else "inertia"
    return (
        f"the {what} that it moves vanishes ({least:.2g}): the mass matrix is singular and the acceleration undefined; "
        "give a link beyond it a mass (off the axis) or an inertia"
    )
