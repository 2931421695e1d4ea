"""The measures of a sizing, and the verdict on a design that follows from them.

Of a joint NAME: NAME.peak_torque, .rms_torque, .peak_speed, .peak_power, .holding_torque; NAME.effort_margin and
.velocity_margin where the URDF has these limits, and .position_margin (rad or m). With an actuator, at its shaft:
NAME.motor_torque (the peak), .motor_rms_torque, .motor_speed (the peak), and the margins .peak_torque_margin,
.continuous_torque_margin, .speed_margin and .curve_margin (of the torque-speed curve, the voltage and the peak
current); .drive_margin is the smallest of all criteria of the motor and gear. NAME.margin is the smallest known margin
of the joint, `margin` that of all; position margins, which are no shares, are not among them. A margin that is unknown
is NaN. Where designs change a motion, MOTION.duration is a measure too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.sizing.drive_verdicts import kept, smallest
from bellcrank.sizing.joint_sizing import OVERSHOOT, JointSizing, MotorSizing, ShaftSizing
from bellcrank.sizing.result import Sizing
from bellcrank.sizing.selection.criteria import TOLERANCE
from bellcrank.studies.results.study_columns import StudyColumns

PASS, FAIL, UNKNOWN, INFEASIBLE = STATUSES = ("pass", "fail", "unknown", "infeasible")
MARGINS = {  # of a shaft: the measure, words, and the criteria of which it is the smallest margin; none: of all
    "peak_torque_margin": ("the actuator's peak torque", ("peak torque",)),
    "continuous_torque_margin": ("the actuator's continuous torque", ("continuous torque",)),
    "speed_margin": ("the actuator's speed", ("motor speed",)),
    "curve_margin": ("the actuator's torque-speed curve", ("peak curve", "voltage limit", "peak current")),
    "drive_margin": ("a limit of the motor or gear", ()),
}
URDF_MARGINS = {"effort_margin": "the URDF's effort limit", "velocity_margin": "the URDF's velocity limit"}
WORDS = {name: words for name, (words, _) in MARGINS.items()} | URDF_MARGINS
POSITION_SLACK = 1e-9  # rad or m, as in JointSizing


@dataclass(frozen=True)
class Judged:
    """What of a sizing is the same in all designs of a mechanism.

    Attributes:
        units: Every measure by name with its unit, in the order of columns.
        position_slack: How far a joint may be outside its range, rad or m, by name.
    """

    units: Mapping[str, str]
    position_slack: Mapping[str, float]

    @property
    def joints(self) -> tuple[str, ...]:
        """The joints and motors that have margins, in order."""
        return tuple(name.removesuffix(".margin") for name in self.units if name.endswith(".margin"))

    def margins(self, joint: str) -> list[str]:
        """The measures that are margins of a joint or motor, as shares of limits."""
        return [f"{joint}.{name}" for name in WORDS if f"{joint}.{name}" in self.units]

    def columns(
        self, measures: dict[str, Array], infeasible: Mapping[int, str], unsizable: Mapping[int, str]
    ) -> StudyColumns:
        """Rows with their smallest margins and verdicts.

        `infeasible` and `unsizable` say why a design cannot be built, and why a motor of it cannot be sized or its
        peaks are not known, by row.
        """
        count = len(next(iter(measures.values()), ()))
        listed = [name for joint in self.joints for name in self.margins(joint)]
        every = _stacked([measures[name] for name in listed], count)
        for joint in self.joints:
            measures[f"{joint}.margin"] = _smallest([measures[name] for name in self.margins(joint)], count)
        measures["margin"] = _smallest([every[:, k] for k in range(len(listed))], count)
        outside = {joint: measures[f"{joint}.position_margin"] < -slack for joint, slack in self.position_slack.items()}
        left = reduce(np.logical_or, outside.values(), np.zeros(count, dtype=bool))
        negative, unknown = every < -TOLERANCE, np.isnan(every)
        status = np.where(unknown.any(axis=1) | (not listed and not outside), STATUSES.index(UNKNOWN), 0)
        status[list(unsizable)] = STATUSES.index(UNKNOWN)
        status[negative.any(axis=1) | left] = STATUSES.index(FAIL)
        status[list(infeasible)] = STATUSES.index(INFEASIBLE)
        reasons = dict(infeasible)
        for row in np.flatnonzero((status > 0) & (status < STATUSES.index(INFEASIBLE))).tolist():
            if status[row] == STATUSES.index(FAIL):
                reasons[row] = self._failure(every[row], listed, [joint for joint in outside if outside[joint][row]])
            elif row in unsizable:
                reasons[row] = unsizable[row]
            else:
                reasons[row] = self._unknown(unknown[row], listed)
        ordered = {name: measures[name] for name in self.units}
        return StudyColumns(statuses=STATUSES, status=status.astype(np.int8), measures=ordered, reasons=reasons)

    def _failure(self, margins: Array, names: list[str], outside: list[str]) -> str:
        """A sentence about the limit that is exceeded most, and how many others are."""
        exceeded = int(np.count_nonzero(margins < -TOLERANCE))
        if not exceeded:
            return f"joint '{outside[0]}' leaves its position range"
        joint, _, name = names[int(np.nanargmin(margins))].rpartition(".")
        more = exceeded - 1 + len(outside)
        others = f" (and {more} other limit{'s' * (more > 1)})" if more else ""
        excess = -float(np.nanmin(margins))
        amount = f"by {excess:.1%}" if math.isfinite(excess) else "without bound (no steady temperature)"
        return f"'{joint}' exceeds {WORDS[name]} {amount}{others}"

    def _unknown(self, unknown: Mask, names: list[str]) -> str:
        """A sentence about the first margin that is unknown, and how many others are."""
        if not names:
            return "there is no actuator, and no limit in the URDF, to compare with"
        joint, _, name = names[int(np.argmax(unknown))].rpartition(".")
        more = int(np.count_nonzero(unknown)) - 1
        others = f" (and {more} other limit{'s' * (more > 1)})" if more else ""
        return f"'{joint}': {WORDS[name]} or what it needs is not stated, and cannot be compared{others}"


def judged(sizing: Sizing, holding: bool) -> Judged:
    """What of a sizing is the same in all designs; `holding` says whether holding torques are among the measures."""
    units: dict[str, str] = {}
    for joint in sizing.joints:
        torque, speed = joint.torque_unit, joint.speed_unit
        own = {"peak_torque": torque, "rms_torque": torque, "peak_speed": speed, "peak_power": "W"}
        if holding:
            own["holding_torque"] = torque
        limits = {name: "1" for name in URDF_MARGINS if getattr(joint, name) is not None}
        if joint.position_margin is not None:
            limits["position_margin"] = joint.position_unit
        own |= limits | _shaft_units(joint.shaft)
        if joint.shaft is not None or limits.keys() & URDF_MARGINS.keys():
            own["margin"] = "1"
        units |= {f"{joint.name}.{name}": unit for name, unit in own.items()}
    for motor in sizing.motors:
        own = {"peak_torque": "N m", "rms_torque": "N m", "peak_speed": "rad/s"} | _shaft_units(motor.shaft)
        units |= {f"{motor.name}.{name}": unit for name, unit in (own | {"margin": "1"}).items()}
    slack = {
        joint.name: POSITION_SLACK + OVERSHOOT * joint.position_noise
        for joint in sizing.joints
        if joint.position_margin is not None
    }
    return Judged(units | {"margin": "1"}, slack)


def measures_of(sizing: Sizing) -> dict[str, float]:
    """The measures of one sizing but for the smallest margins; NaN where unknown, -inf of a use without bound."""
    found: dict[str, float | None] = {}
    for joint in sizing.joints:
        names = ("peak_torque", "rms_torque", "peak_speed", "peak_power", "holding_torque", "position_margin")
        found |= {f"{joint.name}.{name}": getattr(joint, name) for name in (*names, *URDF_MARGINS)}
        found |= _shaft_measures(joint)
    for motor in sizing.motors:
        found |= {
            f"{motor.name}.peak_torque": abs(motor.peak_torque.value),
            f"{motor.name}.rms_torque": motor.rms_torque,
            f"{motor.name}.peak_speed": motor.peak_speed.value,
        }
        found |= _shaft_measures(motor)
    return {name: math.nan if value is None else value for name, value in found.items()}


def _shaft_units(shaft: ShaftSizing | None) -> dict[str, str]:
    """The measures at the shaft of a motor, with their units."""
    if shaft is None:
        return {}
    own = {"motor_torque": "N m", "motor_rms_torque": "N m", "motor_speed": "rad/s"}
    return own | dict.fromkeys(MARGINS, "1")


def _shaft_measures(one: JointSizing | MotorSizing) -> dict[str, float | None]:
    """The measures at the shaft of a motor."""
    shaft = one.shaft
    if shaft is None:
        return {}
    found: dict[str, float | None] = {
        "motor_torque": None if shaft.peak_torque is None else shaft.peak_torque.value,
        "motor_rms_torque": shaft.rms_torque,
        "motor_speed": shaft.peak_speed.value,
    }
    margins = shaft.margins
    for measure, (_, names) in MARGINS.items():
        found[measure] = _smallest_of([margin for name, margin in margins.items() if name in names or not names])
    return {f"{one.name}.{name}": value for name, value in found.items()}


def _smallest_of(margins: list[float | None]) -> float | None:
    """The smallest margin; None where there is none, or an unknown one decides."""
    least = smallest(margins)
    return least if least is not None and (None not in margins or not kept(least)) else None


def _stacked(columns: list[Array], count: int) -> Array:
    return np.stack(columns, axis=1) if columns else np.zeros((count, 0))


def _smallest(columns: list[Array], count: int) -> Array:
    """The smallest number (n,) of columns (n,) that is not NaN; NaN where there is none."""
    return reduce(np.fmin, columns, np.full(count, np.nan))
