"""The mass and inertia of many pairs of motors and gears, as a body at the mount of an axis.

Motor and gear are cylinders in line on the body's axis, at their catalogue diameter and length. A body whose diameter
or length is not stated is a point mass. An unknown mass stays unknown.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.arrays import Array, Indices
from bellcrank.sizing.selection.axis_loads import AddedMass
from bellcrank.sizing.selection.joint_problem import UNKNOWN_MASS


@dataclass(frozen=True, kw_only=True, eq=False)
class Bodies:
    """The bodies of m pairs, and which of them are alike.

    Attributes:
        mass: (m,) kg; NaN where that of the motor or the gear is unknown.
        classes: (m,) number of the body in `bodies`; `UNKNOWN_MASS` where the mass is unknown.
        bodies: The different bodies, the lighter first.
    """

    mass: Array
    classes: Indices
    bodies: tuple[AddedMass, ...]


def bodies_of(motors: Sequence[Motor], gears: Sequence[Gear], motor: Indices, gear: Indices) -> Bodies:
    """The bodies of pairs, given by the numbers (m,) of their motors and gears.

    A cylinder of mass m, radius r and length l has the inertia m r²/2 about its axis and m (3 r² + l²)/12 across it
    (Meriam and Kraige, Engineering Mechanics: Dynamics, table D/4). Two in line are (l₁ + l₂)/2 apart, which adds
    m₁ m₂/(m₁ + m₂) ((l₁ + l₂)/2)² across the axis about their common centre of gravity.
    """
    first, second = _cylinders(motors)[motor], _cylinders(gears)[gear]
    masses = first[:, 0] + second[:, 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        apart = np.where(masses > 0.0, first[:, 0] * second[:, 0] / masses, 0.0)
    lengths = (first[:, 3] + second[:, 3]) / 2.0
    known = np.isfinite(first[:, 3]) & np.isfinite(second[:, 3])
    across = np.nan_to_num(first[:, 2]) + np.nan_to_num(second[:, 2]) + np.where(known, apart * lengths**2, 0.0)
    along = np.nan_to_num(first[:, 1]) + np.nan_to_num(second[:, 1])
    stated = np.isfinite(masses)
    classes = np.full(len(masses), UNKNOWN_MASS, dtype=np.intp)
    different, classes[stated] = np.unique(
        np.column_stack([masses, along, across])[stated], axis=0, return_inverse=True
    )
    return Bodies(
        mass=masses,
        classes=classes,
        bodies=tuple(AddedMass(mass=m, axial_inertia=a, transverse_inertia=t) for m, a, t in different.tolist()),
    )


def body_of(motor: Motor, gear: Gear) -> AddedMass | None:
    """The body of one pair; None where a mass is unknown."""
    first = np.zeros(1, dtype=np.intp)
    return next(iter(bodies_of([motor], [gear], first, first).bodies), None)


def _cylinders(rows: Sequence[Motor] | Sequence[Gear]) -> Array:
    """Mass, inertia along and across the axis, and length (n, 4) of products; NaN where unknown."""
    mass, diameter, length = (
        np.array([getattr(row, name) for row in rows], dtype=np.float64).reshape(len(rows))
        for name in ("mass", "diameter", "length")
    )
    nothing = mass == 0.0  # no gear: a body without mass needs no dimensions
    radius, length = np.where(nothing, 0.0, diameter) / 2.0, np.where(nothing, 0.0, length)
    radius = radius + 0.0 * length  # of a body whose length is unknown, the diameter does not count: a point mass
    return np.column_stack([mass, mass * radius**2 / 2.0, mass * (3.0 * radius**2 + length**2) / 12.0, length])
