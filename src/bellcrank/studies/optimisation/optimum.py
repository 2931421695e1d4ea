"""The result of `optimise`: the best design, what limits it, and how far that is certain."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.atomic_write import writing
from bellcrank.notes import Note, ranked
from bellcrank.present.results import Result
from bellcrank.scene.robot_file_entries import without_robot_file
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.scene.source_mapping import plain
from bellcrank.sizing.selection.written_config import check_target, moved
from bellcrank.studies.designs.sizing_changes import override
from bellcrank.studies.execution.sizing_runner import SizingRunner
from bellcrank.studies.optimisation.local_search import ACTIVE, AT_BOUND, CONVERGED, KEPT, Kkt
from bellcrank.studies.optimisation.optimum_tables import designs_figure, designs_table, rows_of, text_table
from bellcrank.studies.optimisation.robustness import CHECKED, Robustness

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bellcrank.studies.optimisation.problem import DesignProblem
    from bellcrank.studies.optimisation.size_search import Combinations


@dataclass(frozen=True)
class Basin:
    """A local optimum that was found: its objective, how many searches ended in it, and its values."""

    objective: float
    found: int
    values: tuple[float, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class Optimum(Result):
    """The result of `optimise`.

    `to_csv` writes every design that was run: variables, objective, measures of limits, and why it is infeasible.

    Attributes:
        problem: What was looked for, with every design that was run.
        point: The best design, each variable from 0 (its lower bound) to 1 (its upper bound).
        found: Its objective, then the measures of its limits, SI units.
        before: The same of the scene's own values; NaN where they are not known.
        kkt: The residual and the scaled multipliers; None after an interruption.
        reason: Why the search that found it ended.
        blocked: Why the last design beside it was infeasible; empty where it was not.
        basins: The local optima that were found, the best first.
        searches: The number of local searches.
        exact: The measures whose gradients were exact; the others' were differences.
        samples: The number of Sobol points.
        seed: Of the Sobol points.
        history: The number of designs that were run, and the best objective so far.
        complete: False after Ctrl-C.
        combinations: How the combinations of standard sizes were searched; None where no variable has sizes.

    Example:
        >>> import bellcrank as bc
        >>> best = bc.optimise("four_bar", {"crank_length": (1.22, 1.24)}, minimise="lock.time", samples=16)
        >>> best
        Optimum('Deployable four-bar': lock.time 12.1086 s, a local optimum)
    """

    problem: DesignProblem
    point: Array
    found: Array
    before: Array
    kkt: Kkt | None
    reason: str
    blocked: str
    basins: tuple[Basin, ...]
    searches: int
    exact: frozenset[str]
    samples: int
    seed: int
    history: tuple[tuple[int, float], ...] = field(repr=False)
    complete: bool
    combinations: Combinations | None = None

    def __repr__(self) -> str:
        return f"Optimum('{self.problem.scene.name}': {self.problem.measure_of(0, self.objective)}, {self.status})"

    # ---- the design

    @property
    def objective(self) -> float:
        """The objective of the best design, SI units: exact, as `sweep` has it; with tolerances, as judged."""
        return float(self.found[0])

    @property
    def values(self) -> dict[str, float]:
        """The values of the variables by name, in the units of their bounds."""
        numbers = self.problem.numbers(self.point[None])[0].tolist()
        return {one.axis.path: number for one, number in zip(self.problem.variables, numbers, strict=True)}

    @property
    def measures(self) -> dict[str, float]:
        """The objective and the measures of the limits at the best design, SI units."""
        return dict(zip(self.problem.measures, self.found.tolist(), strict=True))

    @property
    def keeps_limits(self) -> bool:
        """Whether the best design keeps all limits, up to 1e-7 of the spread of their measures."""
        return bool(self.problem.violation(self.found[None])[0] <= KEPT)

    @property
    def residual(self) -> float:
        """The scaled residual of the first-order (Karush-Kuhn-Tucker) conditions; infinite where it is not known.

        Its unit is the spread of the objective over the sample per width between the bounds of a variable. Variables
        with sizes are fixed in these conditions; where all have some, it is 0.
        """
        if len(self.problem.sizes) == len(self.problem.variables):
            return 0.0
        return math.inf if self.kkt is None else self.kkt.residual

    @property
    def converged(self) -> bool:
        """Whether it is a local optimum: the limits are kept, the residual is at most 1e-6, and each combination of
        sizes was tried or excluded.
        """
        searched = self.combinations is None or self.combinations.complete
        return self.complete and self.keeps_limits and self.residual <= CONVERGED and searched

    @property
    def status(self) -> str:
        """What it is, in words."""
        if not self.complete:
            return "the best design so far"
        if not self.keeps_limits:
            return "no design that keeps the limits was found"
        if self.combinations is not None and self.combinations.proved:
            return f"the best of all {self.combinations.count} combinations of sizes"
        if self.converged and len(self.problem.sizes) == len(self.problem.variables):
            return "the best combination of sizes found"
        return "a local optimum" if self.converged else "the best design found, no local optimum"

    @property
    def at_bounds(self) -> dict[str, str]:
        """The variables that are at a bound, with "lower" or "upper"."""
        pairs = zip(self.problem.variables, self.point.tolist(), strict=True)
        sides = {one.axis.path: "lower" if x < AT_BOUND else "upper" if x > 1.0 - AT_BOUND else "" for one, x in pairs}
        return {name: side for name, side in sides.items() if side}

    @property
    def active_limits(self) -> tuple[str, ...]:
        """The limits that the best design just keeps."""
        excess = self.problem.excess(self.found[None])[0]
        return tuple(
            str(limit) for limit, beyond in zip(self.problem.limits, excess, strict=True) if -ACTIVE < beyond <= KEPT
        )

    @property
    def multipliers(self) -> dict[str, float]:
        """How the best objective changes per unit of each active limit and bound, in SI units of both.

        A bound is named "NAME lower" or "NAME upper", in the unit in which it was given. Empty where the design is no
        optimum.
        """
        if self.kkt is None or not self.converged:
            return {}
        problem, found = self.problem, dict[str, float]()
        scale = problem.sign * problem.scales[0]
        for k, limit in enumerate(problem.limits):
            side = 1.0 if limit.relation == "=" else problem.side(k)
            if str(limit) in self.active_limits:
                found[str(limit)] = float(-scale * side * self.kkt.limits[k] / problem.scales[1 + k])
        for variable, force in zip(problem.variables, self.kkt.bounds.tolist(), strict=True):
            if (side_of := self.at_bounds.get(variable.axis.path)) and not variable.sizes:
                found[f"{variable.axis.path} {side_of}"] = -scale * force / variable.width
        return {name: value + 0.0 for name, value in found.items()}

    @property
    def gradients(self) -> dict[str, str]:
        """Whether the gradient of each measure was "exact" or by "differences"."""
        return {name: "exact" if name in self.exact else "differences" for name in self.problem.measures}

    @cached_property
    def notes(self) -> tuple[Note, ...]:
        """What to know about the result, what matters most first."""
        problem, said = self.problem, list(self.problem.notes)
        if problem.robustness is not None:
            said += self._robustness_notes(problem.robustness)
        if not self.complete:
            said.append(Note("the search was interrupted: the best design so far is no optimum", "changes"))
        for k, (limit, beyond) in enumerate(zip(problem.limits, problem.excess(self.found[None])[0], strict=True)):
            if beyond > KEPT:
                said.append(
                    Note(f"the limit {limit} is broken: {self.problem.measure_of(1 + k, self.found[1 + k])}", "changes")
                )
        if self.complete and self.keeps_limits and self.residual > CONVERGED:
            value = f"{self.residual:.1e}" if math.isfinite(self.residual) else "not known"
            why = f" ({self.reason})" if self.reason else ""
            said.append(
                Note(f"the residual is {value}, above {CONVERGED:g}{why}: a better design may be near", "changes")
            )
        if self.blocked and not self.converged:
            said.append(Note(f"the search ended beside designs that cannot be run: {self.blocked}", "changes"))
        for name, side in self.at_bounds.items():
            said.append(Note(f"'{name}' is at its {side} bound: wider bounds may allow a better design"))
        if self.combinations is not None:
            said += self._size_notes(self.combinations)
        elif self.converged:
            more = f"{len(self.basins)} local optima were found" if len(self.basins) != 1 else "no other was found"
            said.append(Note(f"it is a local optimum; {more}, and it is not proved that there is no better one"))
        if isinstance(problem.runner, SizingRunner):
            columns = problem.as_designed(self.point)
            if columns.statuses[columns.status[0]] == "fail":
                said.append(
                    Note(f"the best design exceeds a rating that is no limit here: {columns.reasons[0]}", "changes")
                )
        return ranked(said)

    def _robustness_notes(self, robust: Robustness) -> list[Note]:
        """How the design is judged, what it is without deviations, and what other deviations say."""
        problem, (designed, other) = self.problem, self._beside
        found = ", ".join(problem.measure_of(k, value) for k, value in enumerate(other.tolist()))
        said = [Note(robust.sentence)]
        if not np.isfinite(other).all():
            return [*said, Note(f"one of {CHECKED} other deviations within the tolerances cannot be run", "changes")]
        own = zip(problem.measures, designed.tolist(), strict=True)
        listed = ", ".join(f"{name} {value:.6g} {problem.unit_of(k)}".rstrip() for k, (name, value) in enumerate(own))
        said.append(Note(f"without deviations: {listed}; at {CHECKED} other deviations: {found}"))
        beyond = problem.excess(other[None])[0]
        for k, limit in enumerate(problem.limits):
            if self.keeps_limits and beyond[k] > KEPT:
                text = f"{problem.measure_of(1 + k, float(other[1 + k]))} at {CHECKED} other deviations"
                said.append(Note(f"the limit {limit} is not kept everywhere within the tolerances: {text}", "changes"))
        return said

    @cached_property
    def _beside(self) -> tuple[Array, Array]:
        """The measures (1 + limits,) without deviations, and those at other deviations than it was judged by."""
        columns = self.problem.as_designed(self.point)
        return self.problem.of_columns(columns)[0], self.problem.checked(self.point)

    def _size_notes(self, combinations: Combinations) -> list[Note]:
        if combinations.proved:
            failed = len(self.problem.reasons)
            none = f"; {failed} designs cannot be run" if failed else ""
            return [Note(f"each of the {combinations.count} combinations of sizes was run: no other is better{none}")]
        if not combinations.complete:
            return [
                Note("the search did not try or exclude each combination of sizes: another may be better", "changes")
            ]
        return [
            Note(
                f"{combinations.tried} of {combinations.count} combinations of sizes were tried; local searches with "
                "sizes in between excluded the others, which is no proof that none is better"
            )
        ]

    # ---- the scene

    @cached_property
    def scene(self) -> Scene:
        """The scene with the best design. Raises InputError where the scene has no such values."""
        values = zip(self.problem.variables, self.values.values(), strict=True)
        try:
            scene = self.problem.scene
            return scene.with_overrides(
                dict(override(scene, one.axis.path, one.axis.value(number)) for one, number in values)
            )
        except InputError as error:
            raise InputError(f"the best design cannot be written as a scene: {error}") from None

    def write_config(self, path: str | Path) -> Path:
        """Write the best design as a scene file.

        Args:
            path: The YAML file, which is replaced in one step.

        Returns:
            Its path. Files that the scene names keep their places.

        Raises:
            InputError: The file cannot be written, or is the scene's own.

        Example:
            >>> import bellcrank as bc, pathlib, tempfile
            >>> best = bc.optimise("four_bar", {"crank_length": (1.2, 1.24)}, minimise="lock.time", samples=16)
            >>> path = best.write_config(pathlib.Path(tempfile.mkdtemp()) / "best.yaml")
            >>> bc.load_scene(path).parameters["crank_length"].value
            1.24
        """
        import yaml

        target = arguments.path("path", path, "the path of a YAML file")
        check_target(target, self.scene.config)
        file = self.scene.config.file
        data = self.scene.source_data if file is None else without_robot_file(self.scene.source_data, file)
        data = moved(plain(data), self.problem.scene.source.resolve().parent, target.resolve().parent)
        body = yaml.safe_dump(data, allow_unicode=True, sort_keys=False, width=120)
        with writing(target) as temporary:
            head = f"# By bellcrank optimise: {self.problem.measure_of(0, self.objective)}, {self.status}"
            temporary.write_text(f"{head}\n{body}", encoding="utf-8")
            again = load_scene(temporary, trust=[Path(temporary.resolve().anchor)])
            if not np.array_equal(again.parameter_values, self.scene.parameter_values):
                raise BellcrankError(f"{target}: the file does not give the scene again (a fault of bellcrank)")
        return target

    # ---- tables and files

    def table(self) -> str:
        """Format the result as text.

        Returns:
            Variables, objective and limits before and after, multipliers, and the optima that were found.

        Example:
            >>> import bellcrank as bc
            >>> best = bc.optimise("four_bar", {"crank_length": (1.2, 1.24)}, minimise="lock.time", samples=16)
            >>> print(best.table().splitlines()[1].split()[0])
            crank_length
        """
        return text_table(self)

    def _robust_dict(self) -> dict[str, Any] | None:
        if (robust := self.problem.robustness) is None:
            return None
        names = self.problem.measures
        designed, other = (dict(zip(names, values.tolist(), strict=True)) for values in self._beside)
        return {
            "rule": robust.rule,
            "tolerances": {path: str(one) for path, one in robust.tolerances.items()},
            "deviations": len(robust.deviations),
            "without_deviations": designed,
            "at_other_deviations": other,
        }

    def as_dict(self) -> dict[str, Any]:
        """The result as data for JSON.

        Returns:
            Values in the units that are stated; None where a number is not known.

        Example:
            >>> import bellcrank as bc
            >>> best = bc.optimise("four_bar", {"crank_length": (1.2, 1.24)}, minimise="lock.time", samples=16)
            >>> best.as_dict()["status"]
            'a local optimum'
        """

        def known(value: float) -> float | None:
            return value if math.isfinite(value) else None

        return {
            "scene": self.problem.scene.name,
            "status": self.status,
            "keeps_limits": self.keeps_limits,
            "converged": self.converged,
            "complete": self.complete,
            "table": [
                {"name": name, "unit": unit, "before": known(before), "best": known(best), "remark": remark}
                for name, unit, before, best, remark in rows_of(self)
            ],
            "robust": self._robust_dict(),
            "at_bounds": self.at_bounds,
            "active_limits": list(self.active_limits),
            "multipliers": self.multipliers,
            "residual": known(self.residual),
            "gradients": self.gradients,
            "basins": [{"objective": it.objective, "found": it.found, "values": list(it.values)} for it in self.basins],
            "searches": self.searches,
            "combinations": None if (it := self.combinations) is None else asdict(it) | {"gap": known(it.gap)},
            "samples": self.samples,
            "seed": self.seed,
            "designs": self.problem.count,
            "history": [list(pair) for pair in self.history],
            "notes": [note.as_dict() for note in self.notes],
        }

    def _rows(self) -> list[Sequence[object]]:
        return designs_table(self)

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw the best objective over the designs that were run, and the objective of all designs over each variable.

        Args:
            path: Where the picture is written, in the format of its suffix (PNG without one); None: nowhere.

        Returns:
            A matplotlib figure.

        Raises:
            InputError: The file cannot be written.

        Example:
            >>> import bellcrank as bc
            >>> best = bc.optimise("four_bar", {"crank_length": (1.2, 1.24)}, minimise="lock.time", samples=16)
            >>> len(best.plot().axes)
            2
        """
        from bellcrank.present.plot_style import write_figure

        target = arguments.picture(path)
        return write_figure(designs_figure(self), target)
