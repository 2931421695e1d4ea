"""`select_designs`: standard sizes of a robot's parameters together with the motors and gears of a catalogue."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bellcrank import arguments
from bellcrank.actuators.catalogue import Catalogue
from bellcrank.actuators.condition_fields import OF_AN_AXIS
from bellcrank.actuators.conditions import Conditions
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.access import Trust
from bellcrank.robot.payload import Payload
from bellcrank.scene.given_scene import given_scene
from bellcrank.scene.scene import Scene
from bellcrank.sizing.selection.judge import TIERS
from bellcrank.sizing.selection.judged_axes import MAIN
from bellcrank.sizing.selection.ranking import NOTHING, RankKey, Verdicts, as_key, rank_keys, total
from bellcrank.sizing.selection.select import select
from bellcrank.sizing.selection.selection import Candidate, Objective, Selection
from bellcrank.sizing.subject import OneMotion, changed_scene
from bellcrank.studies.axes import Axis
from bellcrank.studies.design_selection import DesignRow, DesignSelection
from bellcrank.studies.design_space import DesignSpace
from bellcrank.studies.infeasible_reasons import infeasible_reason
from bellcrank.studies.sweep_plan import axes_of_sizings

MOST_DESIGNS = 100_000
_PAYLOAD = re.compile(r"\Apayload\.")
_CONDITION = re.compile(r"\A(conditions|actuators\.[^.]+)\.(.+)\Z")


@arguments.named
def select_designs(
    scene: Scene | str | Path,
    vary: Mapping[str, Any],
    motions: OneMotion | Sequence[OneMotion] | None = None,
    catalogue: Catalogue | str | Path | Sequence[str | Path] | None = None,
    objective: Objective = "mass",
    *,
    conditions: Conditions | Mapping[str, Any] | None = None,
    keep: Mapping[str, str] | None = None,
    exclude: Iterable[str] = (),
    makers: Iterable[str] = (),
    feedback: bool = True,
    candidates: int = 12,
    effort: int | None = None,
    payloads: Iterable[Payload] = (),
    allow_massless: Iterable[str] = (),
    overrides: Mapping[str, Any] | None = None,
    progress: Callable[[int, int], object] | None = None,
    trust: Trust = (),
) -> DesignSelection:
    """Choose standard sizes of parameters together with the motor and gear of every axis.

    The motors of each combination of sizes are chosen by `select`, whose branch and bound tries or excludes every
    combination of motors and gears. The designs are ranked as `select` ranks combinations of motors: first those inside
    all limits, then by how many criteria are shown, then by the objective, then by the largest utilisation. Where every
    search was complete, no design of the sizes and the catalogue is ranked better than the result.

    Args:
        scene: A robot configuration or scene, or the path or name of its file.
        vary: Values by parameter or dotted path, as for `sweep(size=True)`: link lengths, masses, payloads, parameters
            of the scene, conditions such as "conditions.voltage".
        motions: As for `select`.
        catalogue: As for `select`.
        objective: As for `select`: "mass", "cost", "loss" or "margin".
        conditions: As for `select`.
        keep: As for `select`.
        exclude: As for `select`.
        makers: As for `select`.
        feedback: As for `select`.
        candidates: As for `select`.
        effort: As for `select`, for each design.
        payloads: As for `select`.
        allow_massless: As for `select`.
        overrides: Changes of the scene beforehand, by dotted path.
        progress: Called with the number of designs done, and of all.
        trust: Where `scene` is a file, folders whose files it may name, besides those near it.

    Returns:
        The best design with its `Selection`, and a row for each design. Ctrl-C keeps the best so far.

    Raises:
        InputError: As `select` and `sweep`.
        BellcrankError: Motors can be chosen for none of the designs.

    Example:
        >>> import bellcrank as bc
        >>> result = bc.select_designs("geared_pendulum", {"link.pendulum.mass": [2, 3]}, makers="ROBOTIS")
        >>> result.values, result.gap
        ({'link.pendulum.mass': 2.0}, 0.0)
    """
    scene = given_scene(scene, None, trust)
    if overrides is not None:
        scene = changed_scene(scene, overrides)
    if progress is not None:
        arguments.function("progress", progress)
    axes = axes_of_sizings(scene, arguments.mapping("vary", vary, "a mapping of parameters to their values"))
    space = DesignSpace(axes)
    if len(space) > MOST_DESIGNS:
        raise InputError(f"select_designs {scene.name}: expected at most {MOST_DESIGNS} designs, found {len(space)}")
    _refuse_without_effect(axes, Conditions().updated(conditions))
    makers = arguments.several("makers", makers, str, "makers", alone=True)  # which may be iterators
    exclude = arguments.several("exclude", exclude, str, "ids", alone=True)
    payloads = arguments.several("payloads", payloads, Payload, "Payloads", alone=True)
    allow_massless = arguments.several("allow_massless", allow_massless, str, "names of links", alone=True)
    rows: list[DesignRow] = []
    best: tuple[tuple[int, ...], int, Selection, Scene] | None = None
    complete = True
    try:
        for number, values in enumerate(space.values().tolist()):
            changed = {
                _PAYLOAD.sub("payloads.1.", axis.path): axis.value(value)
                for axis, value in zip(axes, values, strict=True)
            }
            try:
                design = changed_scene(scene, changed)
                selection = select(
                    design, motions, catalogue, objective, conditions=conditions, keep=keep, exclude=exclude,
                    makers=makers, feedback=feedback, candidates=candidates, effort=effort, payloads=payloads,
                    allow_massless=allow_massless,
                )  # fmt: skip
            except BellcrankError as error:
                if not number and isinstance(error, InputError) and str(error).startswith("argument"):
                    raise
                rows.append(DesignRow(tuple(values), reason=infeasible_reason(error, scene)))
            else:
                rank = rank_of(selection)
                rows.append(DesignRow.of(tuple(values), selection, rank))
                if best is None or rank < best[0]:
                    best = rank, number, selection, design
            if progress is not None:
                progress(number + 1, len(space))
    except KeyboardInterrupt:
        complete = False
        if best is None:
            raise
    if best is None:
        raise BellcrankError(f"motors can be chosen for none of {len(rows)} designs: {rows[0].reason}")
    _, number, selection, design = best
    return DesignSelection(design, axes, tuple(rows), number, selection, len(space), complete)


def _refuse_without_effect(axes: Sequence[Axis], given: Conditions) -> None:
    """Raise InputError for what the selection would replace: figures of actuators, and conditions that are given."""
    for path in (axis.path for axis in axes):
        match = _CONDITION.match(path)
        if match is None:
            continue
        name = match[2]
        if match[1] != "conditions" and name.partition(".")[0] not in OF_AN_AXIS:
            raise InputError(f"'{path}': the actuators are chosen here, and their figures cannot be varied")
        if name in given.sources:
            raise InputError(f"'{path}': '{name}' is among the conditions that are given, which replace it")


def rank_of(selection: Selection) -> tuple[int, ...]:
    """The rank of what was chosen, as combinations of pairs are ranked; whether it is inside all limits comes first."""
    keys = [NOTHING if one.chosen is None else _key(selection.objective, one.chosen) for one in selection.axes]
    return (int(not selection.inside), *total(keys, selection.objective == "margin"))


def _key(objective: Objective, one: Candidate) -> RankKey:
    """The key of a pair."""
    margin = None if one.tier == TIERS[1] else one.largest_use  # a margin that is not shown is unknown
    value = {"mass": one.mass, "cost": one.cost, "loss": one.loss, "margin": margin}[objective]
    verdicts = Verdicts(
        tier=np.array([TIERS.index(one.tier)], dtype=np.int8),
        main_unknown=np.array([len(MAIN & set(one.unknown))], dtype=np.int8),
        objective=np.array([np.nan if value is None else value]),
        use=np.array([one.largest_use]),
    )
    return as_key(rank_keys(verdicts)[0])
