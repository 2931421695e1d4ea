"""Products that contradict themselves: every check that a product's figures allow, and what does not agree."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from bellcrank.actuators.catalogue_curves import Product
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.gear_checks import GEAR_CHECKS
from bellcrank.actuators.motor_checks import MOTOR_CHECKS


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
