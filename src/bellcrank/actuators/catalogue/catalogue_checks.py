"""Products that contradict themselves: every check that a product's figures allow, and what does not agree."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from bellcrank.actuators.catalogue.catalogue_tables import Product
from bellcrank.actuators.catalogue.motor_checks import MOTOR_CHECKS
from bellcrank.actuators.catalogue.product_checks import Check, order, plausible, quotient
from bellcrank.actuators.gear import LINEAR_KINDS, Gear

# ---- Checks of gears against themselves: the order of their limits, and figures that look like another unit.


_DENSITY = 7000.0  # kg/m³, of gears as a whole: steel, with some aluminium


def _rotary(gear: Gear) -> bool:
    return gear.kind not in LINEAR_KINDS


def _efficiency(gear: Gear) -> float | None:
    values = [gear.efficiency, *(eta for _, eta in gear.efficiency_curve or ())]
    return max((value for value in values if value is not None), default=None)


def _ratio_per_stage(gear: Gear) -> float | None:
    if gear.kind != "planetary" or gear.ratio is None or gear.stages is None:
        return None
    return float(gear.ratio ** (1.0 / gear.stages))


def _torque(gear: Gear) -> float | None:
    return (gear.rated_torque or gear.average_torque or gear.repeated_peak_torque) if _rotary(gear) else None


def _gyration(gear: Gear) -> float | None:
    if not _rotary(gear) or gear.inertia is None or not gear.mass:
        return None
    return quotient(math.sqrt(gear.inertia / gear.mass), math.cbrt(gear.mass / _DENSITY))


GEAR_CHECKS: tuple[Check[Gear], ...] = (
    order("rated_torque", "repeated_peak_torque", "N m"),
    order("average_torque", "repeated_peak_torque", "N m"),
    order("rated_torque", "momentary_torque", "N m"),
    order("repeated_peak_torque", "momentary_torque", "N m"),
    order("average_speed", "max_speed", "rad/s"),
    order("rated_speed", "max_speed", "rad/s"),
    order("back_efficiency", "efficiency", most=1.02),
    plausible(
        "efficiency",
        "efficiency (worm gears and sliding screws reach down to 20 %)",
        _efficiency,
        (0.05, 1.0),
        "is it in %, or a loss?",
    ),
    plausible(
        "ratio per stage",
        "ratio^(1 / stages), 3 to 10 for simple planetary stages",
        _ratio_per_stage,
        (1.2, 16.0),
        "check ratio and number of stages",
    ),
    plausible(
        "twist at the rated torque",
        "torque over stiffness, in rad",
        lambda gear: quotient(_torque(gear), gear.stiffness),
        (1e-5, 0.1),
        "check the unit of the stiffness: N m/rad, N m/arcmin or N m/deg",
    ),
    plausible(
        "inertia and mass",
        "√(J / m) over (m / 7000 kg/m³)^(1/3), the radius of gyration over the gear's size",
        _gyration,
        (0.002, 0.6),
        "check the inertia: its unit, and whether it is at the input or at the output",
    ),
    plausible(
        "torque per mass",
        "rated (or average) torque over mass, in N m/kg",
        lambda gear: quotient(_torque(gear), gear.mass),
        (0.3, 1000.0),
        "check the units of torque and mass",
    ),
    plausible(
        "backlash",
        "backlash, in rad",
        lambda gear: gear.backlash if _rotary(gear) else None,
        (0.0, 0.2),
        "is it in arcmin or degrees?",
    ),
    Check(
        name="starting torque",
        formula="starting torque at the input <= rated torque / ratio",
        source="definition",
        figures=lambda gear: (gear.starting_torque, quotient(gear.rated_torque, gear.ratio)),
        unit="N m",
        most=1.0,
        reason="the friction at no load is below the load",
        advice="is it at the output, or in another unit?",
    ),
    plausible(
        "life", "L10 life at the rated torque and speed, in h", lambda gear: gear.life, (200.0, 5e5), "check its unit"
    ),
    plausible(
        "life exponent",
        "exponent of the life law (3 for balls and strain waves, 10/3 for rollers, up to 10 for teeth)",
        lambda gear: gear.life_exponent,
        (2.0, 15.0),
        "is it the exponent of the torque?",
    ),
)


class Contradiction(NamedTuple):
    """Figures of a product that do not agree: the product, the name of the check, and a sentence."""

    product: Product
    check: str
    text: str


def contradictions(products: Iterable[Product]) -> tuple[Contradiction, ...]:
    """What contradicts itself in products, in their order."""
    found = []
    for product in products:
        if isinstance(product, Gear):
            texts = [(one.name, one.contradiction(product)) for one in GEAR_CHECKS]
        else:
            texts = [(one.name, one.contradiction(product)) for one in MOTOR_CHECKS]
        found += [Contradiction(product, name, text) for name, text in texts if text is not None]
    return tuple(found)


def checks_applied(product: Product) -> int:
    """The number of checks that the figures of a product allow."""
    if isinstance(product, Gear):
        return sum(one.ratio(product) is not None for one in GEAR_CHECKS)
    return sum(one.ratio(product) is not None for one in MOTOR_CHECKS)
