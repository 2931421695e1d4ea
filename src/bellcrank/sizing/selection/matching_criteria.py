"""Whether a motor suits its supply and its load, whatever the torques: nominal voltage, and ratio of inertias."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bellcrank.actuators.conditions import Conditions
from bellcrank.arrays import Array, Mask
from bellcrank.numerics import floats
from bellcrank.sizing.selection.axis_loads import DrivenAxis
from bellcrank.sizing.selection.criteria import Criterion, CriterionResult, exceeds
from bellcrank.sizing.selection.load_reductions import ReducedCycle
from bellcrank.sizing.selection.pairs import Pairs

COMMON_BUS = "common bus"


class MotorType(Criterion):
    """Whether the motor is of the wanted commutation and construction; a note where neither is asked for.

    Brushes wear, and a motor with them needs another drive than a brushless one; a frameless motor has no housing and
    no bearings. Its use is 0 where the motor is of the wanted type, and infinite where it is not.
    """

    name = "motor type"
    formula = "commutation and construction as asked for"
    source = "the motor's data sheet"
    needs = (("motor.commutation",),)

    def judged(self, pairs: Pairs, axis: DrivenAxis, conditions: Conditions) -> Mask:
        """All pairs, where one of the two is asked for."""
        return np.full(len(pairs), conditions.commutation is not None or conditions.construction is not None)

    def cycle_use(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """0 or infinity; NaN where the commutation is asked for and not stated, and nothing else decides."""
        use = np.zeros(len(pairs))
        if conditions.commutation is not None:
            wanted = float(conditions.commutation == "brushless")
            brushless = pairs.of_motor("brushless")
            use = np.where(np.isnan(brushless), np.nan, np.where(brushless == wanted, 0.0, np.inf))
        if conditions.construction is not None:
            wanted = float(conditions.construction == "frameless")
            use = np.where(pairs.of_motor("frameless") == wanted, use, np.inf)
        return use

    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """What the motor is, and what is asked for."""
        asked = [text for text in (conditions.commutation, conditions.construction) if text is not None]
        brushless = float(pair.of_motor("brushless")[0])
        known = [] if math.isnan(brushless) else ["brushless" if brushless else "brushed"]
        known.append("frameless" if pair.of_motor("frameless")[0] else "housed")
        text = f"the motor is {' and '.join(known)}; asked for: {' and '.join(asked) or 'no type'}"
        lacks = conditions.commutation is not None and math.isnan(brushless)
        return f"{text}; {self.missing(pair)}" if lacks else text


class NominalVoltage(Criterion):
    """The motor's nominal voltage against that of the bus, in both directions; a note where no bus voltage is given.

    A winding for a much lower voltage has a small inductance for the drive's switching and may not be insulated for the
    bus; one for a much higher voltage reaches a small share of its speed. The limit is a convention, a condition of its
    own (`voltage_ratio`), and no law of physics. Its use is 0 where both voltages are equal, and 1 at the limit.
    """

    name = "nominal voltage"
    formula = "|ln(U / U_N)| ≤ ln(voltage_ratio)"
    source = "a convention of this program; makers state U_N as the voltage for which their figures hold"
    needs = (("motor.nominal_voltage",),)

    def judged(self, pairs: Pairs, axis: DrivenAxis, conditions: Conditions) -> Mask:
        """All pairs, where the voltage of the bus is given."""
        return np.full(len(pairs), conditions.voltage is not None)

    def cycle_use(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """|ln(U / U_N)| / ln(voltage_ratio); it is the same in all cycles."""
        nominal = pairs.of_motor("nominal_voltage")
        bus = nominal if conditions.voltage is None else np.full(len(pairs), conditions.voltage)
        return np.asarray(np.abs(np.log(bus / nominal)) / math.log(conditions.voltage_ratio))

    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """Both voltages and the ratio that is allowed."""
        nominal = float(pair.of_motor("nominal_voltage")[0])
        if conditions.voltage is None:
            return "not judged: no voltage of the bus is given"
        if math.isnan(nominal):
            return self.missing(pair)
        return (
            f"nominal voltage {nominal:.4g} V on a bus of {conditions.voltage:.4g} V, at most "
            f"{conditions.voltage_ratio:g} times higher or lower"
        )


class InertiaRatio(Criterion):
    """Inertia of load and gear over that of the rotor, both at the shaft, so that the drive can control the load.

    The limit is guidance of makers, not a law of physics: a condition of its own (`inertia_ratio`). Ratings do not
    contain it.
    """

    name = "inertia ratio"
    of_ratings = True
    formula = "(J_load / N² + J_gear) / J_rotor ≤ inertia_ratio"
    source = "makers' guidance: THK, ball screw selection (3 to 10); Mitsubishi, MELSERVO J2S manual (3 to 5)"
    needs = (("gear.ratio", "gear.inertia", "motor.rotor_inertia"),)

    def judged(self, pairs: Pairs, axis: DrivenAxis, conditions: Conditions) -> Mask:
        """All products."""
        return np.asarray(pairs.of_motor("by_ratings") == 0.0)

    def cycle_use(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """The largest ratio of the cycle over the allowed one."""
        return inertia_ratio(pairs, cycle.max_inertia) / conditions.inertia_ratio

    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """The range over the cycle, and what is allowed of products."""
        least, most = (float(inertia_ratio(pair, float(f(cycle.inertia)))[0]) for f in (np.min, np.max))
        if math.isnan(most):
            return self.missing(pair)
        allowed = "" if pair.of_motor("by_ratings")[0] else f", at most {conditions.inertia_ratio:g}"
        return f"{least:.3g} to {most:.3g} times the rotor's inertia in '{cycle.name}'{allowed}"


def inertia_ratio(pairs: Pairs, load_inertia: Array | float) -> Array:
    """(J_load / N² + J_gear) / J_rotor (m,)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return floats(
            (load_inertia / pairs.of_gear("ratio") ** 2 + pairs.of_gear("inertia")) / pairs.of_motor("rotor_inertia")
        )


def common_bus(pairs: Sequence[Pairs], conditions: Conditions) -> CriterionResult:
    """Whether one bus suits the motors of all axes, each by `NominalVoltage`; a note where its voltage is given.

    Args:
        pairs: One pair for each axis; those given by ratings are left out.
        conditions: The voltage of the bus, and the ratio that is allowed.

    Returns:
        The verdict: within the ratio of the best voltage, the geometric mean of the lowest and the highest nominal one.
    """
    motors = [pair.rows(0)[0] for pair in pairs if not pair.of_motor("by_ratings")[0]]
    if conditions.voltage is not None or not motors:
        text = "no motor is a product" if not motors else "each motor is compared with the voltage that is given"
        return CriterionResult(name=COMMON_BUS, use=None, verdict="note", text=text)
    voltages = [motor.nominal_voltage for motor in motors if motor.nominal_voltage is not None]
    unknown = list(dict.fromkeys(motor.id for motor in motors if motor.nominal_voltage is None))
    use = math.log(max(voltages) / min(voltages)) / (2.0 * math.log(conditions.voltage_ratio)) if voltages else 0.0
    span = f"nominal voltages from {min(voltages):.4g} V to {max(voltages):.4g} V, " if voltages else ""
    text = f"{span}each at most {conditions.voltage_ratio:g} times higher or lower than that of one bus"
    if unknown and not exceeds(use):
        text += f"; not stated of: {', '.join(unknown)}"
        return CriterionResult(name=COMMON_BUS, use=None, verdict="unknown", text=text)
    return CriterionResult(name=COMMON_BUS, use=use, verdict="exceeded" if exceeds(use) else "inside", text=text)
