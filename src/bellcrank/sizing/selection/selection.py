"""`Selection`: the ranked motors and gears of every axis, what was chosen, and why."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from bellcrank import arguments
from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.cached_values import Portable
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.notes import WithNotes
from bellcrank.present.results import JsonLayout, Result
from bellcrank.sizing.selection.axis_loads import DrivenAxis, LoadCycle
from bellcrank.sizing.selection.criteria import CriterionResult
from bellcrank.sizing.selection.judge import Tier
from bellcrank.sizing.selection.judged_axes import Objective

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bellcrank.actuators.catalogue.catalogue import Catalogue
    from bellcrank.dynamics.inverse.mechanism import Mechanism
    from bellcrank.motion.motion import Motion
    from bellcrank.motion.motion_entry import DutyStep
    from bellcrank.scene.robot_config import RobotConfig
    from bellcrank.sizing.verification import SelectionVerification


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A motor and gear for one axis, judged.

    Attributes:
        motor: The motor.
        gear: The gear; `DIRECT` without one.
        tier: Its class.
        criteria: Every criterion and note, in words.
        binding: Name of the criterion with the largest utilisation.
        mass: kg; None where unknown.
        cost: In the motor's currency; None where unknown.
        loss: Mean electrical loss of the worst cycle, W; None where unknown.
        largest_use: Largest known utilisation; where another actuator's mass is not stated, without that mass.
        fit: "fits", or "fit not checked".
        unknown: Names of the criteria that are unknown.
    """

    motor: Motor
    gear: Gear
    tier: Tier
    criteria: Sequence[CriterionResult]
    binding: str
    mass: float | None
    cost: float | None
    loss: float | None
    largest_use: float
    fit: str
    unknown: tuple[str, ...] = ()

    @property
    def id(self) -> str:
        """The ids of the motor and the gear, "motor+gear"; of the motor alone without a gear."""
        return pair_id(self.motor, self.gear)


def pair_id(motor: Motor, gear: Gear) -> str:
    """The ids of a motor and a gear, "motor+gear"; of the motor alone without a gear."""
    return motor.id if gear.kind == "direct" else f"{motor.id}+{gear.id}"


@dataclass(frozen=True, kw_only=True)
class AxisSelection:
    """The candidates of one axis, best first.

    Attributes:
        axis: The axis.
        conditions: What was assumed of this axis; `sources` says where it comes from.
        chosen: What was chosen; None where nothing in the catalogue can drive the axis.
        candidates: The chosen pair and the best others, ranked under the masses of the actuators chosen for the other
            axes; where few pass, the failing ones nearest to the limits come last.
        counts: Number of pairs in each tier, counted when first asked for.
        advice: Where nothing fits: which criterion fails for the nearest pair, by how much, and what would help.
        unknown_masses: Names of the axes whose actuators' masses change this axis's loads and are not stated. Criteria
            that depend on the loads are then unknown, unless they are exceeded without these masses already.
        kept: Whether the pair was given.
    """

    axis: DrivenAxis
    chosen: Candidate | None
    candidates: tuple[Candidate, ...]
    counts: Sequence[tuple[Tier, int]]
    advice: str = ""
    unknown_masses: tuple[str, ...] = ()
    kept: bool = False
    conditions: Conditions = field(default_factory=Conditions)


class ParetoPoint(NamedTuple):
    """A combination of one pair an axis that no other one betters in every respect.

    Attributes:
        mass: Total mass of the actuators, kg; None where one is unknown.
        largest_use: The largest known utilisation of all axes.
        loss: Total mean electrical loss, W; None where one is unknown.
        cost: Total price; None where one is unknown.
        pairs: The ids of the pairs ("motor+gear"), by axis.
    """

    mass: float | None
    largest_use: float
    loss: float | None
    cost: float | None
    pairs: tuple[str, ...]


class SelectionInputs(NamedTuple):
    """What was selected for: the mechanism and its motions, which a report shows; the robot configuration, None where
    there is none; the products as they are stated, without assumed values; and the duty program, None where each motion
    is a cycle of its own.
    """

    mechanism: Mechanism
    motions: tuple[Motion, ...]
    config: RobotConfig | None = None
    catalogue: Catalogue | None = None
    duty: tuple[DutyStep, ...] | None = None


@dataclass(frozen=True, kw_only=True)
class Selection(Portable, WithNotes, Result):
    """The motors and gears of a robot, made by `bellcrank.select`.

    `print` shows its tables and the verdict; a notebook shows them as HTML tables. `to_csv` writes one line an axis and
    candidate.

    Attributes:
        robot: Name of the robot or robot configuration.
        objective: What was minimised: "mass", "cost", "loss"; "margin": the largest utilisation.
        axes: The selection of each axis.
        cycles: The load cycles with the chosen actuators' masses.
        conditions: What was assumed of the whole robot; `axes` have their own.
        system: Criteria of all axes together: supply power, regenerated energy.
        iterations: What each pass of the feedback of masses chose: the ids of the pairs by axis, "" for none. The first
            pass is without the actuators' masses.
        proof: How far the choice is proven: "optimal: every combination was excluded or tried", or what was not tried.
        pareto: Combinations that no other one betters in mass, largest utilisation, loss and cost together.
        pareto_proof: Whether these are all such combinations, or which were considered.
        warnings: Sentences about what to look at.
        feedback: Whether the masses of the chosen actuators are part of the loads.
        inputs: The mechanism and its motions; None where the selection does not hold them.
        undetermined: A sentence for each joint whose peaks the rows of a sampled motion do not determine, and a `Note`
            on each force and loop of the robot's file that is not modelled.
        verification: How the chosen drives follow the motions in simulation (`verify_selection`), where limits on it
            were given; None otherwise, or where they could not be simulated.
        simulated_limits: These limits by name, or none.

    Example:
        >>> import bellcrank as bc
        >>> selection = bc.select("geared_pendulum")
        >>> selection.axis("shoulder").chosen is not None
        True
    """

    robot: str
    objective: Objective
    axes: tuple[AxisSelection, ...]
    cycles: tuple[LoadCycle, ...]
    conditions: Conditions
    system: tuple[CriterionResult, ...]
    iterations: tuple[tuple[str, ...], ...]
    proof: str
    pareto: tuple[ParetoPoint, ...]
    pareto_proof: str = ""
    warnings: tuple[str, ...] = ()
    feedback: bool = True
    inputs: SelectionInputs | None = field(default=None, repr=False, compare=False)
    undetermined: tuple[str, ...] = ()
    verification: SelectionVerification | None = field(default=None, repr=False, compare=False)
    simulated_limits: Mapping[str, float] = field(default_factory=dict)
    json_layout: ClassVar = JsonLayout(1)

    def __repr__(self) -> str:
        chosen = ", ".join(f"{one.axis.name}: {one.chosen.id if one.chosen else 'nothing fits'}" for one in self.axes)
        return f"Selection('{self.robot}', {chosen})"

    def table(self) -> str:
        """The motors and gears of every axis, notes, and the verdict.

        Returns:
            Lines of text.

        Example:
            >>> import bellcrank as bc
            >>> "Geared pendulum" in bc.select("geared_pendulum").table()
            True
        """
        from bellcrank.sizing.selection.tables import table, verdict

        return "\n".join([table(self), *(f"note: {text}" for text in self.warnings), "", verdict(self)])

    def _repr_html_(self) -> str:
        from bellcrank.sizing.selection.tables import selection_html

        return selection_html(self)

    def axis(self, name: str) -> AxisSelection:
        """The selection of one axis.

        Args:
            name: Name of the joint, or of the motor of a coupled transmission.

        Returns:
            Its AxisSelection.

        Raises:
            InputError: For an unknown name.

        Example:
            >>> import bellcrank as bc
            >>> bc.select("geared_pendulum").axis("shoulder").axis.kind
            'rotary'
        """
        arguments.text("name", name, "the name of a joint or motor")
        for one in self.axes:
            if one.axis.name == name:
                return one
        raise InputError(
            f"selection for {self.robot}: {unknown_name('axis', name, [one.axis.name for one in self.axes])}"
        )

    def stated(self, candidate: Candidate) -> tuple[Motor, Gear]:
        """The motor and gear of a candidate as the catalogue states them, without assumed values.

        Args:
            candidate: A candidate of one of the axes.

        Returns:
            The rows of the catalogue.

        Raises:
            InputError: For something else.
        """
        arguments.instance("candidate", candidate, Candidate, "a Candidate")
        motor, gear = candidate.motor, candidate.gear
        if self.inputs is None or self.inputs.catalogue is None:
            return motor, gear
        motors = {one.id: one for one in self.inputs.catalogue.motors}
        gears = {one.id: one for one in self.inputs.catalogue.gears}
        return motors.get(motor.id, motor), gears.get(gear.id, gear)

    def as_dict(self) -> dict[str, Any]:
        """The whole selection as data for JSON.

        Returns:
            Values in SI units; None where one is unknown.

        Example:
            >>> import bellcrank as bc
            >>> bc.select("geared_pendulum").as_dict()["objective"]
            'mass'
        """
        from bellcrank.sizing.selection.selection_files import selection_data

        return selection_data(self)

    def _rows(self) -> list[Sequence[object]]:
        from bellcrank.sizing.selection.selection_files import selection_rows

        return selection_rows(self)

    def plot(self, path: str | Path | None = None, what: str | None = None) -> Figure:
        """Draw the selection.

        Args:
            path: A file to write the figure to, in the format of its suffix (PNG without one).
            what: "motors" for torque and speed of the chosen motors (the default), "utilisation" for a bar each
                criterion, or "pareto" for utilisation over mass of the combinations that no other one betters.

        Returns:
            The matplotlib Figure.

        Raises:
            InputError: For an unknown picture or format, where nothing was chosen, and where the file cannot be
                written.

        Example:
            >>> import bellcrank as bc
            >>> figure = bc.select("geared_pendulum").plot()
            >>> figure.axes[0].get_xlabel()
            'motor speed [rpm]'
        """
        from bellcrank.sizing.selection.plots import plot_selection

        return plot_selection(self, arguments.picture(path), None if what is None else arguments.text("what", what))

    def write_config(self, path: str | Path) -> Path:
        """Write the robot configuration with the chosen actuators, which `size`, `simulate` and `replay` open.

        It keeps what the original file has. The actuators are written with their figures, and their masses as payloads
        at their mounts; a mass that is unknown is not part of it.

        Args:
            path: The YAML file to write.

        Returns:
            The path of the file.

        Raises:
            InputError: Where an axis has no motor, the selection was not made for a file, or the file cannot be
                written.

        Example:
            >>> import bellcrank as bc
            >>> path = bc.select("geared_pendulum").write_config("chosen.yaml")
            >>> list(bc.load_scene(path, trust=".").actuators)
            ['shoulder']
        """
        from bellcrank.sizing.selection.written_config import write_config

        return write_config(self, arguments.path("path", path, "the path of a YAML file"))[0]

    @property
    def mass(self) -> float | None:
        """Total mass of the chosen actuators, kg; None where one is unknown or missing."""
        return _sum(one.chosen.mass if one.chosen else None for one in self.axes)

    @property
    def cost(self) -> float | None:
        """Total price of the chosen actuators; None where one is unknown or missing."""
        return _sum(one.chosen.cost if one.chosen else None for one in self.axes)

    @property
    def loss(self) -> float | None:
        """Total mean electrical loss, each axis in its worst cycle, W; None where one is unknown or missing."""
        return _sum(one.chosen.loss if one.chosen else None for one in self.axes)

    @property
    def inside(self) -> bool:
        """Whether every axis has a pair that passes what is known, no criterion of the whole robot is exceeded, and the
        motions determine the peaks; and the limits in simulation are kept, if any were given.
        """
        return (
            not self.undetermined
            and self.follows
            and all(one.chosen is not None and one.chosen.tier != "fails" for one in self.axes)
            and all(result.verdict != "exceeded" for result in self.system)
        )

    @property
    def verified(self) -> bool:
        """Whether `inside` holds and no main criterion of a chosen pair is unknown: no motor may be far too weak."""
        from bellcrank.sizing.selection.tables import maybe_too_weak

        return self.inside and not maybe_too_weak(self)

    @property
    def follows(self) -> bool:
        """Whether the chosen drives keep the limits in simulation; True where none were given."""
        return not self.simulated_limits or (self.verification is not None and self.verification.kept)

    @property
    def shown(self) -> bool:
        """Whether every criterion of the chosen pairs and of the whole robot is known and kept."""
        return (
            not self.undetermined
            and self.follows
            and all(one.chosen is not None and one.chosen.tier == "all criteria shown" for one in self.axes)
            and all(result.verdict in ("inside", "note") for result in self.system)
        )


def _sum(values: Iterable[float | None]) -> float | None:
    """The sum; None where one is None."""
    listed = list(values)
    known = [value for value in listed if value is not None]
    return math.fsum(known) if len(known) == len(listed) else None
