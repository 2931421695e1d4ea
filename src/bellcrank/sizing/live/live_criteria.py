"""The criteria of a motor and gear as expressions, for pages: the judge's own code, called with expressions.

A page has no samples to give to criteria. Of each sample it computes `sizes`, whose largest values along the motion,
and `rates`, whose means, give the uses of all criteria:

- criteria of points (peak current, voltage limit, peak curve) are largest at one of the samples: their use in a cycle
  of one sample is a size itself;
- criteria of reductions (largest and RMS torques, largest and mean speed: selection/load_reductions.py) follow from
  those of the motion.

So a formula that a criterion has, its bounds where figures are unknown included, is not written here again. Criteria
that follow the order of samples (temperatures; peak duration, where the torque exceeds the continuous one) or need the
joint's wrench (bearings) are not computed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from bellcrank.actuators.actuator import Actuator
from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.codegen.expression_array import ExpressionArray, expressions
from bellcrank.sizing.drive_verdicts import pair_of
from bellcrank.sizing.joint_sizing import JointSizing
from bellcrank.sizing.selection.axis_loads import DrivenAxis
from bellcrank.sizing.selection.criteria import Criterion, CriterionResult
from bellcrank.sizing.selection.judge import GEAR_CRITERIA
from bellcrank.sizing.selection.load_reductions import ReducedCycle, features_of
from bellcrank.sizing.selection.matching_criteria import InertiaRatio, MotorType, NominalVoltage
from bellcrank.sizing.selection.motor_criteria import (
    ContinuousTorqueCriterion,
    MotorSpeed,
    PeakCurrent,
    PeakTorque,
    VoltageLimit,
)
from bellcrank.sizing.selection.pairs import Pairs
from bellcrank.sizing.selection.shaft_loads import shaft_coefficients
from bellcrank.sizing.selection.short_time_criteria import PeakCurve, PeakDuration

if TYPE_CHECKING:
    import casadi

OF_POINTS: tuple[Criterion, ...] = (PeakCurrent(), VoltageLimit(), PeakCurve())
OF_REDUCTIONS: tuple[Criterion, ...] = (
    *GEAR_CRITERIA, MotorSpeed(), ContinuousTorqueCriterion(), PeakTorque(), MotorType(), NominalVoltage(),
    InertiaRatio(), PeakDuration(),
)  # fmt: skip


class LiveSample(NamedTuple):
    """What a joint bears at a sample: torque, speed (of 0 with the sign of its side), acceleration, load's inertia."""

    torque: casadi.SX
    speed: casadi.SX
    acceleration: casadi.SX
    inertia: casadi.SX


class DriveSample(NamedTuple):
    """Torque at the shaft, times the safety factor; sizes and rates of the drive."""

    shaft: casadi.SX
    sizes: list[casadi.SX]
    rates: list[casadi.SX]


class DriveUses(NamedTuple):
    """RMS torque at the shaft, times the safety factor; the uses of criteria by name."""

    rms_torque: casadi.SX
    uses: dict[str, casadi.SX]


class _OneSample(ReducedCycle):
    """A cycle of one sample, of expressions."""

    @cached_property
    def forward(self) -> Array:
        """The sample with a speed of 0 or more. At rest the other sign has the same largest values."""
        return np.where(self.speed[:, None] < 0.0, -self.features, self.features)


@dataclass(eq=False)
class _Reductions:
    """What criteria ask of a `ReducedCycle` besides its samples, as expressions. Anything else is a TypeError."""

    axis: DrivenAxis
    safety_factor: float
    includes_gear: bool
    max_speed: ExpressionArray
    max_torque: ExpressionArray
    max_inertia: ExpressionArray
    mean_speed: ExpressionArray
    travel: dict[float, ExpressionArray]
    name: str = ""

    def average_torque(self, exponent: float) -> ExpressionArray:
        """As `ReducedCycle.average_torque`, of the means of |q̇| |τ|^p and |q̇|."""
        mean = self.travel[exponent] / np.where(self.mean_speed == 0.0, 1.0, self.mean_speed)
        return cast(ExpressionArray, mean ** (1.0 / exponent))

    def __getattr__(self, name: str) -> None:
        raise TypeError(f"a page does not have the {name} of a cycle")


@dataclass(eq=False)
class LiveDrive:
    """The motor and gear of a joint as expressions.

    Attributes:
        joint: The joint.
        actuator: The motor and gear.
        judged: Their criteria, as `bellcrank.judge` finds them: those that it does not know are not expressions.
        ratio: The gear's ratio, an expression or a number.
    """

    joint: JointSizing
    actuator: Actuator
    judged: Sequence[CriterionResult]
    ratio: casadi.SX | float
    pair: Pairs = field(init=False)

    def __post_init__(self) -> None:
        self.pair = pair_of(self.actuator)
        if not isinstance(self.ratio, float):
            vars(self.pair.gears)["ratio"] = ExpressionArray.of(self.ratio, (1,))
        known = [one.name for one in self.judged if one.use is not None and np.isfinite(one.use)]
        self._points = [one for one in OF_POINTS if one.name in known]
        self._reductions = [one for one in OF_REDUCTIONS if one.name in known]
        exponent = float(self.pair.of_gear("life_exponent")[0])
        self._exponents = [1.0] if np.isnan(exponent) else list({1.0: None, exponent: None})
        self._axis = DrivenAxis(
            name=self.joint.name, joints=(self.joint.name,), mount="",
            kind="linear" if self.joint.kind == "prismatic" else "rotary",
        )  # fmt: skip
        self._through = bool(self.pair.products.gear_arrays.efficiency_curve.known[0])

    def at(self, sample: LiveSample) -> DriveSample:
        """What the drive bears at a sample."""
        torque, speed, acceleration = (ExpressionArray.of(each, (1,)) for each in sample[:3])
        features = features_of(*(cast(Array, each) for each in (torque, speed, acceleration)))
        none = np.full(1, np.nan)
        whole: ReducedCycle = _OneSample(
            axis=self._axis, name="", duration=1.0, time=np.zeros(1), weight=np.ones(1),
            interval=np.zeros(1, dtype=np.intp), sequence=((0, 1, 1),), features=features, torque=cast(Array, torque),
            static_torque=np.nan, inertia=none, axial_force=np.nan, tilting_moment=np.nan,
        )  # fmt: skip
        whole = whole.with_safety_factor(self.actuator.conditions.safety_factor)
        cycle = whole
        if self._through:
            cycle = whole.through(self.actuator.train)
        (shaft,) = expressions(shaft_coefficients(self.pair, cycle) @ cycle.features.T)
        travel = np.abs(whole.speed)
        powers = [travel * np.abs(whole.torque) ** exponent for exponent in self._exponents]
        uses = [one.cycle_use(self.pair, cycle, self.actuator.conditions) for one in self._points]
        return DriveSample(
            shaft,
            [sample.inertia, *(expression for use in uses for expression in expressions(use))],
            [shaft**2, *(expression for each in powers for expression in expressions(each))],
        )

    def uses(self, most: list[casadi.SX], mean: list[casadi.SX], joint: tuple[casadi.SX, ...]) -> DriveUses:
        """The uses, from the largest sizes and the means of rates, in the order of `at`.

        Args:
            most: Largest values of the drive's sizes.
            mean: Means of the drive's rates.
            joint: Largest |torque| and |speed| of the joint, its mean |speed|, and the largest |torque| at the shaft.
        """
        import casadi

        torque, speed, mean_speed, shaft = (ExpressionArray.of(each, ()) for each in joint)
        conditions = self.actuator.conditions
        factor = conditions.safety_factor
        travel = {p: ExpressionArray.of(value, ()) for p, value in zip(self._exponents, mean[1:], strict=True)}
        reduced = _Reductions(
            self._axis, factor, self._through, speed, factor * torque, ExpressionArray.of(most[0], ()), mean_speed,
            travel,
        )  # fmt: skip
        cycle = cast(ReducedCycle, reduced)
        rms = np.sqrt(ExpressionArray.of(mean[0], (1,)))
        self.pair.once(("largest shaft torque", cycle), lambda: cast(Array, shaft[None]))
        self.pair.once(("RMS shaft torque", cycle), lambda: cast(Array, rms))
        found = dict(zip((one.name for one in self._points), most[1:], strict=True))
        for criterion in self._reductions:
            try:
                (found[criterion.name],) = expressions(criterion.reduced_use(self.pair, cycle, conditions))
            except TypeError:  # a bound of figures that are not stated decides by samples
                continue
        return DriveUses(casadi.sqrt(mean[0]), found)
