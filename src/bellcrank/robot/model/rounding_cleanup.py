"""Removing rounding residues from a model: a quarter turn written as 1.5708 becomes exact.

The residues of the sines and cosines of such angles keep operations alive that the robot does not have. Entries of
rotation matrices within 1e-11 of −1, 0 and 1 become exact, and the joints' inertias are gathered anew over the cleaned
placements.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

NEAR = 1e-11  # a rotation entry this close to -1, 0 or 1 is taken to be that number


@dataclass
class Cleaning:
    """What cleaning changed: how many matrix entries, and the largest change."""

    entries: int = 0
    largest: float = 0.0

    def rotation(self, r: Any) -> Any:
        """The rotation (3, 3) with entries near −1, 0 and 1 made exact, orthonormal again."""
        out = np.where(np.abs(r) <= NEAR, 0.0, r)
        for i, k in zip(*np.nonzero(np.abs(out) >= 1.0 - NEAR), strict=True):
            # 1 - 7e-12 beside 3.7e-6 is no residue but a rotation: only an entry alone in row and column is one
            if np.count_nonzero(out[i]) == 1 and np.count_nonzero(out[:, k]) == 1:
                out[i, k] = np.sign(out[i, k])
        if np.array_equal(out, r):
            return r
        if np.abs(out @ out.T - np.eye(3)).max() > 0.0:
            u, _, vt = np.linalg.svd(out)
            polar = u @ vt
            alone = np.abs(out) * (np.abs(polar - out) < 1e-15)
            out = np.where((np.abs(polar) < 1e-15) | (alone == 1.0), out, polar)
        self.entries += int(np.count_nonzero(out != r))
        self.largest = max(self.largest, float(np.abs(out - r).max()))
        return out

    def numbers(self, x: Any, scale: float) -> Any:
        """The numbers, those below NEAR times the scale set to zero."""
        near = (np.abs(x) <= NEAR * scale) & (x != 0.0)
        if not near.any():
            return x
        self.entries += int(near.sum())
        self.largest = max(self.largest, float(np.abs(x[near]).max()))
        return np.where(near, 0.0, x)


def clean_model(model: Any) -> Cleaning:
    """Clean a pinocchio.Model in place, its frames holding the inertias of their links; what was changed."""
    import pinocchio as pin

    cleaning, size = Cleaning(), length_scale(model)

    def placed(m: Any) -> Any:
        return pin.SE3(cleaning.rotation(m.rotation), cleaning.numbers(m.translation, size))

    def inertia(i: Any) -> Any:
        spread = float(np.trace(i.inertia))
        return body_inertia(i.mass, cleaning.numbers(i.lever, size), cleaning.numbers(i.inertia, spread))

    for j in range(1, model.njoints):
        model.jointPlacements[j] = placed(model.jointPlacements[j])
    bodies: list[Any] = [None] * model.njoints
    for frame in model.frames:
        frame.placement = placed(frame.placement)
        frame.inertia = inertia(frame.inertia)
        if frame.inertia.mass > 0.0 or np.any(frame.inertia.inertia):
            part, before = frame.placement.act(frame.inertia), bodies[frame.parentJoint]
            # a sum with nothing would round the lever, and equal numbers would no longer fold
            bodies[frame.parentJoint] = part if before is None else before + part
    for j in range(1, model.njoints):
        model.inertias[j] = pin.Inertia.Zero() if bodies[j] is None else inertia(bodies[j])
    return cleaning


def length_scale(model: Any) -> float:
    """What lengths of a model are compared with, m: its longest one, or 1 m where it is longer."""
    lengths = [p.translation for p in model.jointPlacements] + [f.placement.translation for f in model.frames]
    return min(1.0, float(np.abs(lengths).max(initial=0.0)) or 1.0)


def body_inertia(mass: float, lever: Any, about_cg: Any) -> Any:
    """A pinocchio.Inertia of any numbers; its own constructor refuses some of real URDFs, which check_urdf reports."""
    import pinocchio as pin

    inertia = pin.Inertia.Zero()
    inertia.mass, inertia.lever, inertia.inertia = float(mass), lever, about_cg
    return inertia
