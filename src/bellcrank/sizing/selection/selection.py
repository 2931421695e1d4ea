"""`Selection`: the ranked motors and gears of every axis, what was chosen, and why."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, NamedTuple

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.sizing.selection.axis_loads import Axis, LoadCycle

if TYPE_CHECKING:
    from bellcrank.dynamics.mechanism import Mechanism
    from bellcrank.motion.motion import Motion

Verdict = Literal["inside", "exceeded", "unknown", "note"]
Tier = Literal["all criteria shown", "passes what is known", "fails"]
Objective = Literal["mass", "cost", "loss", "margin"]


@dataclass(frozen=True, kw_only=True)
class CriterionResult:
    """One criterion of one pair.

    Attributes:
        name: Such as "voltage limit".
        use: Utilisation, 1 at the limit; None where unknown or a note.
        verdict: "inside", "exceeded", "unknown" (something that it needs is not stated), or "note" (not judged).
        text: A sentence: the load, the limit, and where they come from; or what is missing.
    """

    name: str
    use: float | None
    verdict: Verdict
    text: str


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A motor and gear for one axis, judged.

    Attributes:
        motor: The motor.
        gear: The gear; `DIRECT` without one.
        tier: Its class.
        criteria: Every criterion.
        binding: Name of the criterion with the largest utilisation.
        mass: kg; None where unknown.
        cost: In the motor's currency; None where unknown.
        loss: Mean electrical loss of the worst cycle, W; None where unknown.
        largest_use: Largest known utilisation.
        fit: "fits", or "fit not checked".
    """

    motor: Motor
    gear: Gear
    tier: Tier
    criteria: tuple[CriterionResult, ...]
    binding: str
    mass: float | None
    cost: float | None
    loss: float | None
    largest_use: float
    fit: str


@dataclass(frozen=True, kw_only=True)
class AxisSelection:
    """The candidates of one axis, best first.

    Attributes:
        axis: The axis.
        chosen: What was chosen; None where nothing in the catalogue can drive the axis.
        candidates: The best of them, ranked; the failing ones nearest to the limits come last.
        counts: Number of pairs in each tier.
        advice: Where nothing fits: which criterion fails for the nearest pair, by how much, and what would help.
    """

    axis: Axis
    chosen: Candidate | None
    candidates: tuple[Candidate, ...]
    counts: tuple[tuple[Tier, int], ...]
    advice: str = ""


class SelectionInputs(NamedTuple):
    """What was selected for: the mechanism and its motions, which a report shows."""

    mechanism: Mechanism
    motions: tuple[Motion, ...]


@dataclass(frozen=True, kw_only=True)
class Selection:
    """The result of `bellcrank.select`.

    Attributes:
        robot: Name of the robot or robot configuration.
        objective: What was minimised (margin: maximised).
        axes: The selection of each axis.
        cycles: The load cycles with the chosen actuators' masses.
        conditions: What was assumed.
        system: Criteria of all axes together: supply power, regenerated energy.
        iterations: What each pass of the feedback of masses chose.
        proof: How far the choice is proven: "optimal: every combination was excluded or tried", or what was not tried.
        pareto: Total (mass kg, largest utilisation, loss W) of the combinations that no other one dominates, each with
            the ids of its pairs.
        warnings: Sentences about what to look at.
        inputs: The mechanism and its motions; None where the selection does not hold them.
    """

    robot: str
    objective: Objective
    axes: tuple[AxisSelection, ...]
    cycles: tuple[LoadCycle, ...]
    conditions: Conditions
    system: tuple[CriterionResult, ...]
    iterations: tuple[tuple[str, ...], ...]
    proof: str
    pareto: tuple[tuple[float | None, float, float | None, tuple[str, ...]], ...]
    warnings: tuple[str, ...] = ()
    inputs: SelectionInputs | None = field(default=None, repr=False, compare=False)

    @property
    def inside(self) -> bool:
        """Whether every axis has a pair that passes, and the system's criteria hold."""
        return all(one.chosen is not None and one.chosen.tier != "fails" for one in self.axes) and all(
            result.verdict != "exceeded" for result in self.system
        )
