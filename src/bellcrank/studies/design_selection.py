"""The result of `select_designs`: a row for each design, and the motors of the best one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bellcrank import arguments
from bellcrank.errors import InputError
from bellcrank.files.atomic_write import write_text
from bellcrank.files.csv_files import csv_text
from bellcrank.files.json_files import write_json
from bellcrank.notes import Note, ranked
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.sizing.selection.selection import Selection
from bellcrank.studies.axes import Axis

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


@dataclass(frozen=True, eq=False)
class DesignSelection:
    """The result of `select_designs`.

    Attributes:
        scene: The best design, with the actuators of the file.
        axes: What is varied.
        rows: The designs in the order of the grid, the last axis fastest.
        best: The number of the best design.
        selection: Its motors and gears.
        count: How many designs there are.
        complete: False after Ctrl-C.

    Example:
        >>> import bellcrank as bc
        >>> result = bc.select_designs("geared_pendulum", {"link.pendulum.mass": [2, 3]}, makers="ROBOTIS")
        >>> result
        DesignSelection('Geared pendulum', 2 of 2 designs, best: link.pendulum.mass = 2 kg)
    """

    scene: Scene
    axes: tuple[Axis, ...]
    rows: tuple[DesignRow, ...]
    best: int
    selection: Selection
    count: int
    complete: bool

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
        """0 where each design was tried, and for each every combination of motors and gears was tried or excluded: no
        other one is ranked better. Otherwise it is not known, and infinite.
        """
        return 0.0 if self.complete and all(row.searched for row in self.rows) else math.inf

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
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        text = ["  ".join(f"{it:<{width}}" for it, width in zip(line, widths, strict=True)).rstrip() for line in lines]
        if len(ordered) > SHOWN:
            text.append(f"and {len(ordered) - SHOWN} more designs")
        gap = "0" if self.gap == 0.0 else "not known"
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
            "designs": [{name: None if value == "" else value for name, value in row.items()} for row in rows],
            "notes": [note.to_dict() for note in self.notes],
        }

    def to_json(self, path: str | Path) -> Path:
        """Write `as_dict` as JSON.

        Args:
            path: The file, which is replaced in one step.

        Returns:
            Its path.

        Raises:
            InputError: The file cannot be written.

        Example:
            >>> import bellcrank as bc
            >>> result = bc.select_designs("geared_pendulum", {"link.pendulum.mass": [2, 3]}, makers="ROBOTIS")
            >>> result.to_json("designs.json").name
            'designs.json'
        """
        return write_json(arguments.path("path", path, "the path of a file"), self.as_dict(), indent=2)

    def to_csv(self, path: str | Path) -> Path:
        """Write a row for each design as CSV, with units in the header.

        Args:
            path: The file, which is replaced in one step.

        Returns:
            Its path. Cells that are not known are empty.

        Raises:
            InputError: The file cannot be written.

        Example:
            >>> import bellcrank as bc
            >>> result = bc.select_designs("geared_pendulum", {"link.pendulum.mass": [2, 3]}, makers="ROBOTIS")
            >>> result.to_csv("designs.csv").read_text().split(",")[0]
            'link.pendulum.mass [kg]'
        """
        target = arguments.path("path", path, "the path of a file")
        rows: list[Sequence[object]] = [[*(axis.label for axis in self.axes), *HEAD]]
        write_text(target, csv_text([*rows, *map(self._cells, self.rows)]))
        return target

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
