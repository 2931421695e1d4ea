"""Designs of a robot for which motors and gears are chosen, one after the other, and the best of them so far."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from bellcrank.actuators.catalogue.catalogue import Catalogue
from bellcrank.errors import BellcrankError, InputError
from bellcrank.scene.scene import Scene
from bellcrank.sizing.selection.judge import TIERS
from bellcrank.sizing.selection.judged_axes import MAIN
from bellcrank.sizing.selection.pairs import NOTHING, PairVerdicts, RankKey, as_key, rank_keys, total
from bellcrank.sizing.selection.select import PreparedSelection, prepare_selection
from bellcrank.sizing.selection.selection import Candidate, Selection
from bellcrank.sizing.sizing_subject import OneMotion, changed_scene
from bellcrank.studies.designs.axes import StudyAxis
from bellcrank.studies.designs.sizing_changes import override
from bellcrank.studies.execution.design_runner import infeasible_reason
from bellcrank.studies.selection.design_selection import DesignRow

_PAYLOAD = re.compile(r"\Apayload\.")


class DesignsWithMotors:
    """The designs that were tried.

    Args:
        scene: The robot configuration.
        axes: What is varied.
        motions: As for `select`.
        catalogue: What is chosen from.
        settings: Other arguments of `prepare_selection`.
        listed: How many candidates of each axis a selection lists, and the effort of its search.
        done: Called with the number of designs after each.

    Attributes:
        rows: A row for each design.
        best: The number of the best row, its selection and its scene; None before there is one.
    """

    def __init__(
        self,
        scene: Scene,
        axes: Sequence[StudyAxis],
        motions: OneMotion | Sequence[OneMotion] | None,
        catalogue: Any,
        settings: Mapping[str, Any],
        listed: tuple[int, int | None],
        done: Callable[[int], object],
    ) -> None:
        self.scene, self.axes, self.motions = scene, tuple(axes), motions
        self.catalogue, self.settings, self.listed, self.done = catalogue, dict(settings), listed, done
        self.rows: list[DesignRow] = []
        self.best: tuple[int, Selection, Scene] | None = None

    def design(self, values: Sequence[float]) -> Scene:
        """The scene of a design. Raises BellcrankError where it cannot be built."""
        return changed_scene(
            self.scene,
            dict(
                override(self.scene, _PAYLOAD.sub("payloads.1.", axis.path), axis.value(value))
                for axis, value in zip(self.axes, values, strict=True)
            ),
        )

    def prepared(
        self, design: Scene, keep: Mapping[str, str] | None = None, products: Catalogue | None = None
    ) -> PreparedSelection:
        """The pairs of a design, perhaps with given ones. Raises BellcrankError."""
        settings = self.settings if keep is None else self.settings | {"keep": keep}
        return prepare_selection(design, self.motions, self.catalogue if products is None else products, **settings)

    def run(self, values: Sequence[float]) -> tuple[PreparedSelection, Selection] | None:
        """Choose the motors of a design, and keep its row; None where it cannot be built or judged.

        Raises InputError for a wrong argument.
        """
        try:
            design = self.design(values)
            prepared = self.prepared(design)
            selection = prepared.choose(*self.listed)
        except BellcrankError as error:
            if not self.rows and isinstance(error, InputError) and str(error).startswith("argument"):
                raise
            self.rows.append(DesignRow(tuple(values), reason=infeasible_reason(error, self.scene)))
            self.done(len(self.rows))
            return None
        rank = rank_of(selection)
        self.rows.append(DesignRow.of(tuple(values), selection, rank))
        if self.best is None or rank < self.rows[self.best[0]].rank:
            self.best = len(self.rows) - 1, selection, design
        self.done(len(self.rows))
        return prepared, selection


def rank_of(selection: Selection) -> tuple[int, ...]:
    """The rank of what was chosen, as combinations of pairs are ranked; whether it is inside all limits comes first."""
    keys = [NOTHING if one.chosen is None else _key(selection.objective, one.chosen) for one in selection.axes]
    return (int(not selection.inside), *total(keys, selection.objective == "margin"))


def _key(objective: str, one: Candidate) -> RankKey:
    """The key of a pair."""
    margin = None if one.tier == TIERS[1] else one.largest_use  # a margin that is not shown is unknown
    value = {"mass": one.mass, "cost": one.cost, "loss": one.loss, "margin": margin}[objective]
    verdicts = PairVerdicts(
        tier=np.array([TIERS.index(one.tier)], dtype=np.int8),
        main_unknown=np.array([len(MAIN & set(one.unknown))], dtype=np.int8),
        objective=np.array([np.nan if value is None else value]),
        use=np.array([one.largest_use]),
    )
    return as_key(rank_keys(verdicts)[0])
