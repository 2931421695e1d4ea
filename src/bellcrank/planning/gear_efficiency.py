"""The efficiency of an actuator's gear by the direction of power, as the fastest motion uses it."""

from __future__ import annotations

from typing import NamedTuple

from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.motor_with_gear import MotorWithGear


class GearEfficiencies(NamedTuple):
    """Efficiencies of a gear.

    Attributes:
        driving: Where the motor drives: the torque at the shaft is τ / (N driving).
        driven: Where the load gives power back: it is τ driven / N.
        varies: Whether they depend on the load; then they are the lowest and the highest value of the curve, with which
            the shaft torque is larger than it is while driving, and larger than it is while braking.
    """

    driving: float
    driven: float
    varies: bool


def gear_efficiencies(actuator: Actuator) -> GearEfficiencies:
    """The efficiencies of an actuator whose shaft torque is known."""
    if not isinstance(actuator, MotorWithGear):
        efficiency = 1.0 if actuator.efficiency is None else actuator.efficiency
        return GearEfficiencies(efficiency, efficiency, False)
    gear = actuator.conditions.completed(actuator.gear)
    if gear.efficiency_curve is not None:
        values = [efficiency for _, efficiency in gear.efficiency_curve]
        driven = max(values) if gear.back_efficiency is None else gear.back_efficiency
        return GearEfficiencies(min(values), driven, min(values) != max(values))
    driving = 1.0 if gear.efficiency is None else gear.efficiency
    return GearEfficiencies(driving, driving if gear.back_efficiency is None else gear.back_efficiency, False)
