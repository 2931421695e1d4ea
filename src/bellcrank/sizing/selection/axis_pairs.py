"""The pairs that an axis chooses from, in the order of their ids, with their masses and prices.

Motor and gear are cylinders in line on the body's axis, at their catalogue diameter and length. A body whose diameter
or length is not stated is a point mass. An unknown mass stays unknown.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bellcrank.actuators.catalogue.catalogue import Catalogue
from bellcrank.actuators.gear import DIRECT, Gear
from bellcrank.actuators.motor import Motor
from bellcrank.arrays import Array, Indices
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.sizing.selection.axis_loads import AddedMass, DrivenAxis
from bellcrank.sizing.selection.joint_problem import UNKNOWN_MASS
from bellcrank.sizing.selection.pairs import Pairs


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


@dataclass(frozen=True, kw_only=True, eq=False)
class AxisPairs:
    """The pairs of one axis.

    Attributes:
        axis: The axis.
        pairs: The pairs, in the order of the ids of motors and gears.
        bodies: Their masses and inertias.
        cost: (m,) price of motor and gear together; NaN where unknown, or where they have different currencies.
        kept: Whether the axis's pair was given.
    """

    axis: DrivenAxis
    pairs: Pairs
    bodies: Bodies
    cost: Array
    kept: bool


def axis_pairs(
    axes: Sequence[DrivenAxis], catalogues: Sequence[Catalogue], keep: Mapping[str, str]
) -> tuple[AxisPairs, ...]:
    """The pairs of each axis.

    Args:
        axes: The axes.
        catalogues: The products to choose from, of each axis; axes with the same catalogue share pairs.
        keep: Ids by the name of the axis, "motor+gear", or "motor" for any gear; these products are in the catalogue.

    Returns:
        The pairs by axis. Axes of the same kind and catalogue without a given pair share them.

    Raises:
        InputError: An axis, a motor or a gear is unknown, or they do not go together.
    """
    names = [axis.name for axis in axes]
    for name in keep:
        if name not in names:
            raise InputError(unknown_name("axis", name, names), argument="keep")
    shared: dict[tuple[str, int], AxisPairs] = {}
    found = []
    for axis, catalogue in zip(axes, catalogues, strict=True):
        motors = sorted(catalogue.motors, key=lambda row: row.id)
        gears = sorted(catalogue.gears, key=lambda row: row.id)
        if axis.name in keep:
            found.append(_kept(axis, motors, gears, keep[axis.name]))
            continue
        key = (axis.kind, id(catalogue))
        if key not in shared:
            shared[key] = _with_figures(axis, Pairs.possible(motors, gears, axis.kind), kept=False)
        one = shared[key]
        found.append(AxisPairs(axis=axis, pairs=one.pairs, bodies=one.bodies, cost=one.cost, kept=False))
    return tuple(found)


def _kept(axis: DrivenAxis, motors: Sequence[Motor], gears: Sequence[Gear], given: str) -> AxisPairs:
    """The pairs of an axis whose motor, or motor and gear, is given. Raises InputError."""
    where = f"axis '{axis.name}'"
    motor_id, plus, gear_id = (part.strip() for part in given.partition("+"))
    motor = [row for row in motors if row.id == motor_id]
    if not motor:
        raise InputError(f"{where}: {unknown_name('motor', motor_id, [row.id for row in motors])}", argument="keep")
    if plus and gear_id != DIRECT.id:
        named = [row for row in gears if row.id == gear_id]
        if not named:
            raise InputError(f"{where}: {unknown_name('gear', gear_id, [row.id for row in gears])}", argument="keep")
        gears = named
    pairs = Pairs.possible(motor, gears, axis.kind)
    if plus:
        direct = np.array([pairs.products.gears[g].kind == "direct" for g in pairs.gear], dtype=bool)
        pairs = pairs.take(direct if gear_id == DIRECT.id else ~direct)
    if not len(pairs):
        raise InputError(
            f"{where} ({axis.kind}): '{given}' cannot drive it: a linear axis takes screws and racks, a rotary one "
            "other gears; a motor and gear sold as one takes no further gear; flange and shaft must fit",
            argument="keep",
        )
    return _with_figures(axis, pairs, kept=True)


def _with_figures(axis: DrivenAxis, pairs: Pairs, kept: bool) -> AxisPairs:
    products = pairs.products
    return AxisPairs(
        axis=axis,
        pairs=pairs,
        bodies=bodies_of(products.motors, products.gears, pairs.motor, pairs.gear),
        cost=_cost(pairs),
        kept=kept,
    )


def _cost(pairs: Pairs) -> Array:
    """Price (m,) of each pair; a pair without a gear costs what the motor does."""
    motors, gears = pairs.products.motors, pairs.products.gears
    prices = np.array([row.price for row in motors], dtype=np.float64)
    gear_prices = np.array([0.0 if row.kind == "direct" else row.price for row in gears], dtype=np.float64)
    rows: list[Motor | Gear] = [*motors, *gears]
    names = {name: number for number, name in enumerate(sorted({row.currency or "" for row in rows}))}
    motor_currency = np.array([names[row.currency or ""] for row in motors], dtype=np.intp)
    gear_currency = np.array([names[row.currency or ""] for row in gears], dtype=np.intp)
    direct = np.array([row.kind == "direct" for row in gears], dtype=bool)
    alike = (motor_currency[pairs.motor] == gear_currency[pairs.gear]) | direct[pairs.gear]
    return np.where(alike, prices[pairs.motor] + gear_prices[pairs.gear], np.nan)


def check_prices(axes: Sequence[AxisPairs], objective: str) -> None:
    """Refuse the least cost where no pair has a price, or prices have several currencies (InputError)."""
    if objective != "cost":
        return
    rows: dict[str, Motor | Gear] = {}
    for one in axes:
        rows |= {row.id: row for row in one.pairs.products.motors}
        rows |= {row.id: row for row in one.pairs.products.gears}
    priced = [row for row in rows.values() if row.price is not None and row.kind != "direct"]
    currencies = sorted({row.currency or "no currency stated" for row in priced})
    if len(currencies) > 1:
        raise InputError(
            f"objective 'cost': the catalogue has prices in several currencies ({', '.join(currencies)}); convert them "
            "to one, or exclude products"
        )
    if not any(np.isfinite(one.cost).any() for one in axes):
        raise InputError("objective 'cost': no motor and gear that go together both state a price; add prices")
