"""The data of a selection's page: products, candidates, criteria and loads as one compressed block of JSON.

Names and sentences that occur often are stored once and referred to by number. Of each load cycle only the samples that
a plot needs are kept: every corner of the convex hull of (torque, acceleration, speed), which decides every straight
limit, and samples in between.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Sequence
from itertools import product
from typing import Any, get_args

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.arrays import Array, Indices
from bellcrank.messages import readable
from bellcrank.replays.page.film_encoding import deflate_base64
from bellcrank.sizing.selection.criteria import CriterionResult, Verdict
from bellcrank.sizing.selection.judge import TIERS
from bellcrank.sizing.selection.load_reductions import (
    ACCELERATION,
    DIRECTION,
    DRIVEN,
    DRIVING,
    SPEED,
    ReducedCycle,
    reduce_loads,
)
from bellcrank.sizing.selection.pair_detail import PairDetail, motor_curves, pair_details
from bellcrank.sizing.selection.selection import AxisSelection, Candidate, ParetoPoint, Selection, pair_id

MOST_TEMPERATURES = 80  # of a cycle
DIGITS = 5
OF_USES = 12  # of what the page rounds again: 0.704497 is 70.4 %, and not by 0.7045 70.5 %
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


class Numbering:
    """Texts or products in the order in which they first occur."""

    def __init__(self) -> None:
        self.number: dict[Any, int] = {}

    def __call__(self, item: Any) -> int:
        """The number of an item, a new one where it has none."""
        return self.number.setdefault(item, len(self.number))


def encoded_selection(selection: Selection) -> str:
    """The data of a selection, deflated (zlib), in base64."""
    text = json.dumps(selection_data(selection), allow_nan=False, separators=(",", ":"))
    return deflate_base64(text.encode("utf-8"))


def selection_data(selection: Selection) -> dict[str, Any]:
    """The data of a selection, as it stands in the page (see selection_data.js); unknown numbers are None."""
    names, texts, motors, gears = Numbering(), Numbering(), Numbering(), Numbering()
    loads = reduce_loads(tuple(each.axis for each in selection.axes), selection.cycles)

    def criterion(result: CriterionResult) -> list[int | float | None]:
        use = result.estimate if result.use is None else result.use
        return [names(result.name), number(use, OF_USES), VERDICTS.index(result.verdict), texts(readable(result.text))]

    def candidate(one: Candidate, detail: PairDetail, conditions: Conditions) -> dict[str, Any]:
        return {
            "motor": motors((one.motor, conditions)),
            "gear": gears(one.gear),
            "tier": TIERS.index(one.tier),
            "criteria": [criterion(result) for result in one.criteria],
            "binding": one.binding,
            "mass": number(one.mass),
            "cost": number(one.cost),
            "loss": number(one.loss),
            "use": number(one.largest_use, OF_USES),
            "fit": one.fit,
            **_pair(detail),
        }

    axes = [
        {
            "name": readable(each.axis.name),
            "kind": each.axis.kind,
            "mount": readable(each.axis.mount),
            "chosen": chosen_rank(each),
            "counts": list(each.counts),
            "unknownMasses": list(map(readable, each.unknown_masses)),
            "kept": each.kept,
            "advice": readable(each.advice),
            "cycles": [_cycle(cycle) for cycle in load.cycles],
            "candidates": [
                candidate(one, detail, each.conditions)
                for one, detail in zip(listed(each), pair_details(selection, each, listed(each)), strict=True)
            ],
        }
        for each, load in zip(selection.axes, loads, strict=True)
    ]
    return {
        "axes": axes,
        "system": [criterion(result) for result in selection.system],
        "pareto": _combinations(selection),
        "motors": [_motor(motor, conditions) for motor, conditions in motors.number],
        "gears": [_gear(gear) for gear in gears.number],
        "names": list(names.number),
        "texts": list(texts.number),
        "tiers": TIERS,
        "verdicts": VERDICTS,
    }


VERDICTS: tuple[Verdict, ...] = get_args(Verdict)


def listed(axis: AxisSelection) -> tuple[Candidate, ...]:
    """The candidates of an axis with the chosen one, which comes first where it is not among them."""
    missing = axis.chosen is not None and _rank(axis, axis.candidates) is None
    return (axis.chosen, *axis.candidates) if missing and axis.chosen is not None else axis.candidates


def chosen_rank(axis: AxisSelection) -> int | None:
    """The number of the chosen candidate in the list; None where nothing is chosen."""
    return _rank(axis, listed(axis))


def title(product: Motor | Gear) -> str:
    """Maker and model of a product, and the voltage or ratio that tells it from its like, each once."""
    text = product.model
    if product.maker.casefold() not in text.casefold():
        text = f"{product.maker} {text}"
    if isinstance(product, Gear):
        turns = product.ratio is not None and not product.linear and product.kind != "direct"
        apart = f"{product.ratio:.4g}:1" if turns else ""
    else:
        apart = f"{product.nominal_voltage:g} V" if product.nominal_voltage is not None else ""
    stated = apart.removesuffix(" V").removesuffix(":1") in _NUMBER.findall(product.model)
    return readable(text if stated or not apart else f"{text}, {apart}")


def origin(product: Motor | Gear) -> str:
    """Where the figures of a product are from: kind of the source, the source, and when they were compared with it."""
    text = ": ".join(part for part in (product.quality.replace("_", " "), product.source) if part)
    return readable(f"{text} (compared {product.checked})" if product.checked else text)


def number(value: float | None, digits: int = DIGITS) -> float | None:
    """A number with so many digits; None where it is unknown or not finite."""
    return None if value is None or not math.isfinite(value) else float(f"{value:.{digits}g}")


def _numbers(values: Iterable[float]) -> list[float | None]:
    return [number(float(value)) for value in values]


def _rank(axis: AxisSelection, candidates: Sequence[Candidate]) -> int | None:
    if axis.chosen is None:
        return None
    ids = (axis.chosen.motor.id, axis.chosen.gear.id)
    return next((k for k, each in enumerate(candidates) if (each.motor.id, each.gear.id) == ids), None)


def _motor(motor: Motor, conditions: Conditions) -> dict[str, Any]:
    curves = motor_curves(motor, conditions)
    return {
        "id": readable(motor.id),
        "title": title(motor),
        "origin": origin(motor),
        "maker": readable(motor.maker),
        "currency": readable(motor.currency or ""),
        "curves": {
            "continuous": _curve(curves.continuous),
            "region": None if curves.short_time is None else [_numbers(column) for column in curves.short_time.T],
            "voltage": _curve(curves.voltage),
        },
        "unknown": curves.unknown,
        "limits": {"winding": number(motor.max_winding_temperature), "housing": number(motor.max_housing_temperature)},
    }


def _gear(gear: Gear) -> dict[str, Any]:
    return {
        "id": readable(gear.id),
        "title": title(gear),
        "origin": origin(gear),
        "maker": readable(gear.maker),
        "direct": gear.kind == "direct",
    }


def _curve(points: Array | None) -> list[list[float | None]] | None:
    """Points (k, 2) as a list of speeds and one of torques."""
    return None if points is None else [_numbers(points[:, 0]), _numbers(points[:, 1])]


def _pair(detail: PairDetail) -> dict[str, Any]:
    """What plots of a pair need beside the loads of its axis and the curves of its motor."""
    shaft = detail.shaft
    return {
        "shaft": {
            "ratio": number(shaft.ratio),
            "efficiency": number(shaft.efficiency),
            "backEfficiency": number(shaft.back_efficiency),
            "efficiencyCurve": _curve(shaft.efficiency_curve),
            "inertia": number(shaft.inertia),
            "safety": number(shaft.safety_factor),
            "leftOut": shaft.left_out,
        },
        "cycles": [
            {
                "meanSpeed": number(cycle.mean_speed),
                "rmsTorque": number(cycle.rms_torque),
                "temperature": _temperature(cycle.temperature),
            }
            for cycle in detail.cycles
        ],
        "temperatureText": detail.temperature_text,
    }


def _temperature(table: Array | None) -> dict[str, list[float | None]] | None:
    """Times, winding and housing temperatures (n, 3), thinned; extremes of the winding are kept."""
    if table is None:
        return None
    rows = thinned(table, MOST_TEMPERATURES)
    return {name: _numbers(table[rows, k]) for k, name in enumerate(("time", "winding", "housing"))}


def _cycle(cycle: ReducedCycle) -> dict[str, Any]:
    """The load of an axis along a cycle: some of its samples, then its extremes (at speeds that are not negative)."""
    table = load_points(cycle)
    names = ("torque", "speed", "acceleration")
    return {"name": readable(cycle.name), **{name: _numbers(table[:, k]) for k, name in enumerate(names)}}


def _combinations(selection: Selection) -> list[dict[str, Any]]:
    """The Pareto front and the choice, with the names of the products where these are known here."""
    titles = {pair_id(one.motor, one.gear): _pair_title(one) for axis in selection.axes for one in listed(axis)}
    chosen = [axis.chosen for axis in selection.axes if axis.chosen is not None]
    choice, points = tuple(one.id for one in chosen), list(selection.pareto)
    if len(chosen) == len(selection.axes) and choice not in {point.pairs for point in points}:
        use = max(one.largest_use for one in chosen)
        points.append(ParetoPoint(selection.mass, use, selection.loss, selection.cost, choice))
    return [
        {
            "mass": number(point.mass),
            "use": number(point.largest_use),
            "loss": number(point.loss),
            "cost": number(point.cost),
            "pairs": [titles.get(pair, readable(pair)) for pair in point.pairs],
            "chosen": point.pairs == choice,
        }
        for point in points
    ]


def _pair_title(one: Candidate) -> str:
    return title(one.motor) if one.gear.kind == "direct" else f"{title(one.motor)} + {title(one.gear)}"


# ---- The points of a load that a plot shows: some of all samples, and those that decide limits.
#
# A limit a T + b ω ≤ 1 at a motor's shaft is linear in the axis's torque, acceleration and speed, for the samples
# where the motor drives and for those where the load drives apart. So the corners of the convex hulls of both decide
# it. A smooth motion has most of its samples on the hull; of these so many are kept that every sample is within
# TOLERANCE of the hull of what is kept, so that no limit is off by more.


MOST_SAMPLES = 400  # besides the corners
TOLERANCE = 5e-4  # of the largest magnitude of each quantity
FEW = 12  # points of which a hull is not worth its while
MOST_ROUNDS = 60


def load_points(cycle: ReducedCycle) -> Array:
    """Points (n, 3) of torque, speed and acceleration of an axis along a cycle.

    The first are samples, as they are. The others, those that decide limits, are turned to speeds that are not
    negative: the signs of all three together change no limit.
    """
    samples = np.column_stack([cycle.torque, cycle.speed, cycle.features[:, ACCELERATION]])
    hull = cycle.hull
    corners = np.column_stack([hull[:, DRIVING] + hull[:, DRIVEN], hull[:, SPEED], hull[:, ACCELERATION]])
    groups = 2 * (hull[:, DIRECTION] == 0.0) + (hull[:, DRIVEN] != 0.0)
    kept = [corners[groups == group] for group in np.unique(groups)]
    return np.concatenate([samples[thinned(samples, MOST_SAMPLES)], *(points[corner_rows(points)] for points in kept)])


def thinned(table: Array, most: int) -> Indices:
    """About `most` rows of a table (n, m), evenly spread, and those of the extremes of each column."""
    even = np.linspace(0, len(table) - 1, min(most, len(table))).astype(np.intp)
    return np.unique(np.concatenate([even, np.argmin(table, axis=0), np.argmax(table, axis=0)]))


def corner_rows(points: Array) -> Indices:
    """Rows of points (n, 3) of whose convex hull no other point is further outside than TOLERANCE.

    The points farthest outside are added until there are none, each column measured by its largest magnitude. Points
    whose hull is too thin to be computed are all kept.
    """
    everything = np.arange(len(points))
    spread = _spread(points)
    dimensions = spread.shape[1]
    kept = np.unique(np.concatenate([spread.argmin(axis=0), spread.argmax(axis=0), everything[:1]]))
    if dimensions < 2:
        return kept
    if len(points) <= FEW:
        return everything
    diagonals = np.array(list(product((-1.0, 1.0), repeat=dimensions)))
    kept = np.union1d(kept, np.argmax(spread @ diagonals.T, axis=0))
    for _ in range(MOST_ROUNDS):
        try:
            facets = ConvexHull(spread[kept]).equations
        except QhullError:
            return everything
        outside = spread @ facets[:, :-1].T + facets[:, -1]
        farther = np.setdiff1d(outside.argmax(axis=0)[outside.max(axis=0) > TOLERANCE], kept)
        if not len(farther):
            return kept
        kept = np.union1d(kept, farther)
    return everything


def _spread(points: Array) -> Array:
    """Points (n, 3), each column over its largest magnitude, in the one to three directions in which they spread."""
    largest = np.abs(points).max(axis=0)
    scaled = points / np.where(largest > 0.0, largest, 1.0)
    centred = scaled - scaled.mean(axis=0)
    _, sizes, directions = np.linalg.svd(centred, full_matrices=False)
    rank = max(int(np.sum(sizes > 0.1 * TOLERANCE)), 1)  # no point is further off than the singular value
    return np.asarray(centred @ directions[:rank].T)
