"""The result of `select_designs`: a row for each design, and the motors of the best one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bellcrank.errors import InputError
from bellcrank.notes import Note, ranked
from bellcrank.present.results import Result
from bellcrank.present.tables import aligned
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.sizing.selection.selection import Selection
from bellcrank.studies.designs.axes import StudyAxis

SHOWN = 10  # designs in a table
HEAD = (
    "inside", "axes not all shown", "main criteria unknown", "mass [kg]", "cost", "loss [W]", "largest use",
    "motors and gears", "search", "reason",
)  # fmt: skip
TEXTS = 2  # columns at the end that a table leaves out


@dataclass(frozen=True)
class DesignRow:
    """One design: its values in the units of the axes, what was chosen for it, and why nothing could be.

    Attributes:
        values: By axis.
        pairs: The ids of motors and gears by joint; "" where nothing fits.
        inside: Whether the choice passes what is known.
        mass: kg; None where unknown, like `cost` and `loss`.
        cost: In the catalogue's currency.
        loss: W.
        largest_use: The largest known utilisation; None where an axis has no motor.
        proof: How far the choice is proven to be the best of this design.
        rank: Smaller is better: whether it is not inside, then as combinations of pairs are ranked.
        reason: Why the design cannot be built or judged; empty where it can.
    """

    values: tuple[float, ...]
    pairs: tuple[str, ...] = ()
    inside: bool = False
    mass: float | None = None
    cost: float | None = None
    loss: float | None = None
    largest_use: float | None = None
    proof: str = ""
    rank: tuple[int, ...] = field(default=(), repr=False)
    reason: str = ""

    @classmethod
    def of(cls, values: tuple[float, ...], chosen: Selection, rank: tuple[int, ...]) -> DesignRow:
        """The row of a design for which motors were chosen."""
        pairs = tuple("" if one.chosen is None else one.chosen.id for one in chosen.axes)
        uses = [one.chosen.largest_use for one in chosen.axes if one.chosen is not None]
        use = max(uses) if len(uses) == len(pairs) else None
        return cls(values, pairs, chosen.inside, chosen.mass, chosen.cost, chosen.loss, use, chosen.proof, rank)

    @property
    def searched(self) -> bool:
        """Whether every combination of motors and gears was tried or excluded."""
        return bool(self.reason) or not self.proof.startswith("best found")


@dataclass(frozen=True)
class Inside:
    """How continuous values were searched.

    Attributes:
        sampled: How many designs of the ranges were run first.
        searched: For how many lighter combinations of pairs values were searched.
        gap: How much less mass or cost, at most, a combination has that was neither tried nor left out; None where the
            objective is neither.
        nearest: The lighter combination that comes nearest to passing, by axis; empty where none was tried.
        nearest_use: Its least largest utilisation.
    """

    sampled: int
    searched: int = 0
    gap: float | None = None
    nearest: tuple[str, ...] = ()
    nearest_use: float = math.inf


@dataclass(frozen=True, eq=False)
class DesignSelection(Result):
    """The result of `select_designs`.

    `to_csv` writes a row for each design.

    Attributes:
        scene: The best design, with the actuators of the file.
        axes: What is varied.
        rows: The designs in the order of the grid, the last axis fastest; where ranges are varied, as they were run.
        best: The number of the best design.
        selection: Its motors and gears.
        count: How many designs there are.
        complete: False after Ctrl-C.
        inside: How ranges were searched; None where none is varied.

    Example:
        >>> import bellcrank as bc
        >>> result = bc.select_designs("geared_pendulum", {"link.pendulum.mass": [2, 3]}, makers="ROBOTIS")
        >>> result
        DesignSelection('Geared pendulum', 2 of 2 designs, best: link.pendulum.mass = 2 kg)
    """

    scene: Scene
    axes: tuple[StudyAxis, ...]
    rows: tuple[DesignRow, ...]
    best: int
    selection: Selection
    count: int
    complete: bool
    inside: Inside | None = None

    def __repr__(self) -> str:
        return f"DesignSelection('{self.scene.name}', {len(self.rows)} of {self.count} designs, best: {self._said()})"

    def _said(self) -> str:
        said = []
        for axis, (name, value) in zip(self.axes, self.values.items(), strict=True):
            said.append(f"{name} = {value:g} {axis.unit}".rstrip() if axis.numeric else f"{name} = {value}")
        return ", ".join(said)

    @property
    def values(self) -> dict[str, Any]:
        """The values of the best design by path, in the units of the axes."""
        numbers = self.rows[self.best].values
        return {axis.path: axis.shown(number) for axis, number in zip(self.axes, numbers, strict=True)}

    @property
    def gap(self) -> float:
        """How much better than the result, at most, what was neither tried nor excluded is; infinite where not known.

        0 where each design was tried, and for each every combination of motors and gears was tried or excluded. Where
        ranges are varied, kg or the currency of the objective, as far as the sample and local searches show, which are
        no proof; infinite for the objectives "loss" and "margin".
        """
        if not self.complete or not all(row.searched for row in self.rows):
            return math.inf
        if self.inside is None:
            return 0.0
        return math.inf if self.inside.gap is None else self.inside.gap

    @property
    def notes(self) -> tuple[Note, ...]:
        """What to know about the search, what matters most first; `selection.notes` are those on the best design."""
        said = []
        if not self.complete:
            said.append(Note("the search was interrupted: a better design may be among the others", "changes"))
        if left := sum(not row.searched for row in self.rows):
            said.append(
                Note(f"of {left} designs some combinations of motors were neither tried nor excluded", "changes")
            )
        if (one := self.inside) is not None and one.nearest:
            said.append(
                Note(
                    f"of {one.searched} lighter or cheaper combinations for which values were searched, the nearest, "
                    f"{' '.join(one.nearest)}, is used to {one.nearest_use:.1%} at best"
                )
            )
        if failed := [row.reason for row in self.rows if row.reason]:
            said.append(Note(f"{len(failed)} designs cannot be built or judged: {failed[0]}"))
        return ranked(said)

    def _cells(self, row: DesignRow) -> list[object]:
        numbers: list[object] = [axis.shown(value) for axis, value in zip(self.axes, row.values, strict=True)]
        given = (row.mass, row.cost, row.loss, row.largest_use)
        values: list[object] = ["" if it is None else it for it in given]
        shown: list[object] = list(row.rank[2:4]) or ["", ""]
        return [*numbers, "yes" if row.inside else "no", *shown, *values, " ".join(row.pairs), row.proof, row.reason]

    def table(self) -> str:
        """Format the designs as text.

        Returns:
            The best designs, best first, how many there are, and the gap to the best possible.

        Example:
            >>> import bellcrank as bc
            >>> result = bc.select_designs("geared_pendulum", {"link.pendulum.mass": [2, 3]}, makers="ROBOTIS")
            >>> print(result.table().splitlines()[-1])
            2 of 2 designs were tried; gap to the best: 0
        """
        ordered = sorted((row for row in self.rows if not row.reason), key=lambda row: row.rank)
        head = [axis.label for axis in self.axes]
        lines = [[*head, *HEAD[:-TEXTS]]]
        for row in ordered[:SHOWN]:
            cells = self._cells(row)[:-TEXTS]
            lines.append([f"{it:.5g}" if isinstance(it, float) else str(it) for it in cells])
        text = aligned(lines)
        if len(ordered) > SHOWN:
            text.append(f"and {len(ordered) - SHOWN} more designs")
        gap = f"{self.gap:.4g}" if math.isfinite(self.gap) else "not known"
        if self.inside is not None and math.isfinite(self.gap):
            gap += f" {'kg' if self.selection.objective == 'mass' else ''}".rstrip()
            gap += ", as far as samples and local searches show"
        return "\n".join([*text, f"{len(self.rows)} of {self.count} designs were tried; gap to the best: {gap}"])

    def as_dict(self) -> dict[str, Any]:
        """The result as data for JSON.

        Returns:
            The values of the best design, its motors, whether the search is complete, and a row for each design.

        Example:
            >>> import bellcrank as bc
            >>> result = bc.select_designs("geared_pendulum", {"link.pendulum.mass": [2, 3]}, makers="ROBOTIS")
            >>> result.as_dict()["values"]
            {'link.pendulum.mass': 2.0}
        """
        head = [axis.label for axis in self.axes]
        names = [*head, *HEAD]
        rows = [dict(zip(names, self._cells(row), strict=True)) for row in self.rows]
        return {
            "scene": self.scene.name,
            "objective": self.selection.objective,
            "values": self.values,
            "pairs": {one.axis.name: None if one.chosen is None else one.chosen.id for one in self.selection.axes},
            "inside": self.selection.inside,
            "verified": self.selection.verified,
            "complete": self.complete,
            "gap": self.gap if math.isfinite(self.gap) else None,
            "ranges": self._inside_data(),
            "designs": [{name: None if value == "" else value for name, value in row.items()} for row in rows],
            "notes": [note.as_dict() for note in self.notes],
        }

    def _inside_data(self) -> dict[str, Any] | None:
        """How ranges were searched, as data for JSON."""
        if (one := self.inside) is None:
            return None
        use = one.nearest_use if math.isfinite(one.nearest_use) else None
        return {"sampled": one.sampled, "searched": one.searched, "nearest": list(one.nearest), "nearest_use": use}

    def _rows(self) -> list[Sequence[object]]:
        return [[*(axis.label for axis in self.axes), *HEAD], *map(self._cells, self.rows)]

    def write_config(self, path: str | Path) -> Path:
        """Write the robot configuration with the best sizes and the chosen motors and gears (`Selection.write_config`).

        Args:
            path: The YAML file.

        Returns:
            Its path.

        Raises:
            InputError: An axis has no motor, or the file cannot be written.

        Example:
            >>> import bellcrank as bc
            >>> result = bc.select_designs("geared_pendulum", {"link.pendulum.mass": [2, 3]}, makers="ROBOTIS")
            >>> result.write_config("best.yaml").name
            'best.yaml'
        """
        target = self.selection.write_config(path)
        again = load_scene(target, trust=[Path(target.resolve().anchor)]).parameters
        if any(name not in again or again[name].value != own.value for name, own in self.scene.parameters.items()):
            target.unlink()
            raise InputError(
                f"{target}: not written: the scene that was varied differs from its file; give changes as overrides"
            )
        return target
