"""Notes on a motor and gear, which are never judged: resonance, and errors at the axis."""

from __future__ import annotations

import math

import numpy as np

from bellcrank.actuators.conditions import Conditions
from bellcrank.sizing.selection.axis_loads import Axis
from bellcrank.sizing.selection.criteria import Array, Bools, Criterion
from bellcrank.sizing.selection.load_reductions import ReducedCycle
from bellcrank.sizing.selection.pairs import Pairs

ARC_MINUTES = 60.0 * 180.0 / math.pi


class Note(Criterion):
    """A figure without a limit."""

    def judged(self, pairs: Pairs, axis: Axis, conditions: Conditions) -> Bools:
        """No pair."""
        return np.zeros(len(pairs), dtype=bool)


class Resonance(Note):
    """The lowest natural frequencies of rotor and load on the gear's stiffness.

    With the rotor held it is √(K/J_load)/2π; with a free rotor √(K (1/J_load + 1/(N² (J_rotor + J_gear))))/2π.
    """

    name = "resonance"
    formula = "√(K/J_load)/2π and √(K (1/J_load + 1/(N² J)))/2π"
    source = "two bodies on a spring, e.g. Ellis, Control System Design Guide, 2012, chapter 16"
    needs = (("gear.stiffness", "gear.ratio", "gear.inertia", "motor.rotor_inertia"),)

    def cycle_use(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """The largest inertia of the cycle, so that the lowest frequency is told."""
        return np.full(len(pairs), np.max(cycle.inertia))

    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """Both frequencies at the largest inertia of the load."""
        if pair.of_gear("direct")[0]:
            return "no gear"
        held, free = (float(one[0]) for one in resonances(pair, float(np.max(cycle.inertia))))
        if math.isnan(free):
            return self.missing(pair)
        return f"{held:.3g} Hz with the rotor held, {free:.3g} Hz free, at the largest inertia in '{cycle.name}'"


class AxisError(Note):
    """Backlash and wind-up of the gear at the axis, and what they are at a distance of 1 m."""

    name = "error at the axis"
    formula = "backlash, and max |τ| / K"
    source = "the gear's data sheet"
    needs = (("gear.backlash",), ("motor.backlash",), ("gear.stiffness",))

    def cycle_use(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """The largest torque, so that the largest wind-up is told."""
        return np.full(len(pairs), cycle.max_torque)

    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """Backlash and wind-up where they are known."""
        motor, gear = pair.rows(0)
        direct = gear.kind == "direct"
        backlash = motor.backlash if direct else gear.backlash
        parts = [f"backlash {_size(backlash, cycle)}"] if backlash is not None else []
        if not direct and gear.stiffness is not None:
            parts.append(f"wind-up {_size(cycle.max_torque / gear.stiffness, cycle)} in '{cycle.name}'")
        return "; ".join(parts) or ("no gear" if direct else "neither backlash nor stiffness is stated")


def resonances(pairs: Pairs, load_inertia: float) -> tuple[Array, Array]:
    """Natural frequencies (m,), Hz, with the rotor held and free."""
    stiffness = pairs.of_gear("stiffness")
    rotor = pairs.of_gear("ratio") ** 2 * (pairs.of_motor("rotor_inertia") + pairs.of_gear("inertia"))
    with np.errstate(divide="ignore"):
        held, free = stiffness / load_inertia, stiffness * (1.0 / np.float64(load_inertia) + 1.0 / rotor)
    return np.sqrt(held) / (2.0 * math.pi), np.sqrt(free) / (2.0 * math.pi)


def _size(error: float, cycle: ReducedCycle) -> str:
    if cycle.axis.kind == "linear":
        return f"{error * 1e3:.3g} mm"
    return f"{error * ARC_MINUTES:.3g} arcmin ({error * 1e3:.3g} mm at 1 m)"
