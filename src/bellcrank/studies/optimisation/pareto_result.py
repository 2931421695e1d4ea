"""The result of `pareto_front`: designs between objectives, as text, CSV, JSON, picture and scene files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array, Mask
from bellcrank.errors import InputError
from bellcrank.files.atomic_write import check_folder
from bellcrank.notes import Note, ranked
from bellcrank.present.results import Result
from bellcrank.present.tables import aligned
from bellcrank.studies.optimisation.local_search import KEPT
from bellcrank.studies.optimisation.optimum import Optimum

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bellcrank.studies.optimisation.problem import DesignProblem
    from bellcrank.studies.results.exceedance import Limit

BETTER = 1e-6  # of objectives in units of their spread: a smaller difference is an error of the searches
ROUNDING = 1e-12
BLOCK = 1000  # designs that are compared at once


def dominates(known: Array, values: Array) -> Mask:
    """Whether (m,) some of the known objectives (n, k) are nowhere worse than values (m, k), and better in one."""
    found = np.zeros(len(values), dtype=bool)
    for first in range(0, len(known), BLOCK):
        gain = values[None] - known[first : first + BLOCK, None]
        found |= ((gain >= -ROUNDING).all(axis=2) & (gain > BETTER).any(axis=2)).any(axis=0)
    return found


@dataclass(frozen=True, eq=False)
class ParetoFront(Result):
    """The result of `pareto_front`.

    `to_csv` writes a row for each design: its number, objectives, variables and status.

    Attributes:
        problem: What was looked for, with every design that was run.
        signed: The objectives, each with 1 where it is to be small and −1 where large.
        limits: Conditions that all designs keep.
        designs: The designs in the order of the first objective, from its best value on.
        left_out: How many others were found and left out: another design is better, or they break a limit.
        complete: False after Ctrl-C.

    Example:
        >>> import bellcrank as bc
        >>> front = bc.pareto_front("four_bar", {"crank_length": {"sizes": [1.22, 1.23, 1.24]}},
        ...                         minimise="lock.time", maximise="lock.crank")
        >>> front
        ParetoFront('Deployable four-bar': 3 designs between lock.time and lock.crank)
    """

    problem: DesignProblem
    signed: tuple[tuple[str, float], ...]
    limits: tuple[Limit, ...]
    designs: tuple[Optimum, ...]
    left_out: int
    complete: bool

    def __repr__(self) -> str:
        names = " and ".join(self.objectives)
        return f"ParetoFront('{self.problem.scene.name}': {len(self.designs)} designs between {names})"

    def __len__(self) -> int:
        return len(self.designs)

    @property
    def objectives(self) -> tuple[str, ...]:
        """The names of the objectives."""
        return tuple(name for name, _ in self.signed)

    @property
    def values(self) -> Array:
        """The objectives (designs, objectives), SI units."""
        return np.array([[one.measures[name] for name in self.objectives] for one in self.designs])

    @property
    def converged(self) -> bool:
        """Whether there is a design, and each is a local optimum of one objective at its levels of the others."""
        return self.complete and bool(self.designs) and all(one.converged for one in self.designs)

    @property
    def proved(self) -> bool:
        """Whether all combinations of sizes were run, so that these are all designs of the front."""
        return self.complete and all(one.combinations is not None and one.combinations.proved for one in self.designs)

    @property
    def notes(self) -> tuple[Note, ...]:
        """What to know about the result, what matters most first."""
        said = list(self.problem.notes)
        if not self.complete:
            said.append(Note("the search was interrupted: parts of the front may be missing", "changes"))
        if poor := sum(not one.converged for one in self.designs):
            said.append(
                Note(f"{poor} of {len(self.designs)} designs are no local optima: better ones may be near", "changes")
            )
        if self.left_out:
            said.append(Note(f"{self.left_out} more designs were found and left out, because another one is better"))
        if self.proved:
            said.append(Note("all combinations of sizes were run: these are all designs of the front"))
        else:
            said.append(
                Note("no design that was run betters one of these in all objectives; that none exists is not proved")
            )
        return ranked(said)

    def _units(self) -> list[str]:
        units = self.problem.units
        return ["" if units[name] == "1" else units[name] for name in self.objectives]

    def _rows(self) -> list[Sequence[object]]:
        """A header with units, and a row for each design: number, objectives, variables, status."""
        head = [f"{name} [{unit or '1'}]" for name, unit in zip(self.objectives, self._units(), strict=True)]
        rows: list[Sequence[object]] = [
            ["design", *head, *(one.axis.label for one in self.problem.variables), "status"]
        ]
        for k, (one, values) in enumerate(zip(self.designs, self.values.tolist(), strict=True), 1):
            rows.append([k, *values, *one.values.values(), one.status])
        return rows

    def table(self) -> str:
        """Format the front as text.

        Returns:
            A row for each design: its objectives, its variables, and whether it is an optimum at its levels.

        Example:
            >>> import bellcrank as bc
            >>> front = bc.pareto_front("four_bar", {"crank_length": {"sizes": [1.22, 1.24]}},
            ...                         minimise="lock.time", maximise="lock.crank")
            >>> print(front.table().split()[0])
            design
        """
        cells = [[f"{it:.6g}" if isinstance(it, float) else str(it) for it in row] for row in self._rows()]
        return "\n".join([*aligned(cells, (len(cells[0]) - 1,)), f"{self.problem.count} designs were run"])

    def as_dict(self) -> dict[str, Any]:
        """The front as data for JSON.

        Returns:
            Objectives with their units, and the designs, each as `Optimum.as_dict`.

        Example:
            >>> import bellcrank as bc
            >>> front = bc.pareto_front("four_bar", {"crank_length": {"sizes": [1.22, 1.24]}},
            ...                         minimise="lock.time", maximise="lock.crank")
            >>> front.as_dict()["proved"]
            True
        """
        objectives = [
            {"measure": name, "unit": unit, "goal": "minimise" if sign > 0.0 else "maximise"}
            for (name, sign), unit in zip(self.signed, self._units(), strict=True)
        ]
        designs = []
        for one, values in zip(self.designs, self.values.tolist(), strict=True):
            rest = one.as_dict()
            rest.pop("history"), rest.pop("notes"), rest.pop("scene")
            designs.append({"objectives": values, "values": one.values, **rest})
        return {
            "scene": self.problem.scene.name,
            "objectives": objectives,
            "limits": list(map(str, self.limits)),
            "complete": self.complete,
            "converged": self.converged,
            "proved": self.proved,
            "left_out": self.left_out,
            "designs": designs,
            "designs_run": self.problem.count,
            "notes": [note.as_dict() for note in self.notes],
        }

    def write_configs(self, folder: str | Path) -> tuple[Path, ...]:
        """Write each design as a scene file: design_1.yaml, design_2.yaml, and so on, in the order of `designs`.

        Args:
            folder: The folder, which is made where it is not there.

        Returns:
            Their paths.

        Raises:
            InputError: A file cannot be written.

        Example:
            >>> import bellcrank as bc
            >>> front = bc.pareto_front("four_bar", {"crank_length": {"sizes": [1.22, 1.24]}},
            ...                         minimise="lock.time", maximise="lock.crank")
            >>> [path.name for path in front.write_configs("front")]
            ['design_1.yaml', 'design_2.yaml']
        """
        target = arguments.path("folder", folder, "the path of a folder")
        names = self.config_names
        check_folder("folder", target, names)
        try:
            target.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{target}: cannot be made: {error.strerror}") from None
        return tuple(one.write_config(target / name) for one, name in zip(self.designs, names, strict=True))

    @property
    def config_names(self) -> tuple[str, ...]:
        """The names of the files of `write_configs`."""
        width = len(str(len(self.designs)))
        return tuple(f"design_{k:0{width}}.yaml" for k in range(1, len(self.designs) + 1))

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw the front over the other designs that were run and keep the limits: each objective over the first.

        Args:
            path: Where the picture is written, in the format of its suffix (PNG without one); None: nowhere.

        Returns:
            A matplotlib figure.

        Raises:
            InputError: The file cannot be written.

        Example:
            >>> import bellcrank as bc
            >>> front = bc.pareto_front("four_bar", {"crank_length": {"sizes": [1.22, 1.24]}},
            ...                         minimise="lock.time", maximise="lock.crank")
            >>> len(front.plot().axes)
            1
        """
        from bellcrank.present.plot_style import write_figure

        target = arguments.picture(path)
        return write_figure(self._figure(), target)

    def _figure(self) -> Figure:
        from bellcrank.present.plot_style import colour, literal, new_figure, plain

        problem, count = self.problem, len(self.objectives) - 1
        figure = new_figure(5.0 * count, 4.0)
        axes = np.atleast_1d(figure.subplots(1, count))
        columns = [problem.measures.index(name) for name in self.objectives]
        every = np.concatenate(problem.values)
        kept = problem.within(np.concatenate(problem.points)) & (problem.violation(every) <= KEPT)
        rest = every[kept][:, columns]
        front = self.values.reshape(-1, 1 + count)
        labels = [f"{name} [{unit or '1'}]" for name, unit in zip(self.objectives, self._units(), strict=True)]
        for k, axis in enumerate(axes, 1):
            axis.plot(rest[:, 0], rest[:, k], ".", color="0.75", markersize=3, label="other designs")
            style = "D-" if count == 1 else "D"
            axis.plot(front[:, 0], front[:, k], style, color=colour(1), markersize=5, linewidth=1, label="front")
            for number, (x, y) in enumerate(front[:, [0, k]].tolist(), 1):
                axis.annotate(str(number), (x, y), xytext=(4, 4), textcoords="offset points", fontsize="small")
            axis.set(xlabel=literal(labels[0]), ylabel=literal(labels[k]))
            for column, limit in ((0, axis.set_xlim), (k, axis.set_ylim)):
                low, high = float(front[:, column].min()), float(front[:, column].max())
                if high > low:
                    limit(low - 0.5 * (high - low), high + 0.5 * (high - low))
            plain(axis)
        axes[-1].legend(fontsize="small")
        return figure
