"""The data of a study's page: the designs of its map, their motions, and what the page computes.

A page holds a few thousand designs of the map and at most `MOST_MOTIONS` motions. Of more designs some are chosen:
those with the least, the median and the largest value of each measure, and others spread evenly over all.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.arrays import Array, Indices
from bellcrank.config.fields import parse_number
from bellcrank.errors import InputError
from bellcrank.messages import readable
from bellcrank.replays.film.design_film import DesignFilm, film_of_designs
from bellcrank.replays.film.film import Film
from bellcrank.replays.film.run_film import film_of_run
from bellcrank.replays.film.sizing_film import film_of_sizing
from bellcrank.replays.geometry.meshes import Detail
from bellcrank.replays.page.film_encoding import ArrayEncoder, encode_motions, safe_json
from bellcrank.robot.model.traced_tree import ORIGIN
from bellcrank.simulation.integration.statistics import Status
from bellcrank.simulation.simulate import simulate
from bellcrank.sizing.size import size
from bellcrank.studies.designs.sizing_changes import changes_of, present_duration
from bellcrank.studies.execution.run_outcomes import INFEASIBLE
from bellcrank.studies.execution.sizing_runner import SizingRunner

if TYPE_CHECKING:
    from bellcrank.simulation.trajectory.trajectory import Trajectory
    from bellcrank.sizing.loads.joint_histories import SizingInputs
    from bellcrank.studies.designs.axes import StudyAxis
    from bellcrank.studies.results.exceedance import Limit
    from bellcrank.studies.results.sweep_result import Sweep


Rows = Indices
MOST_MOTIONS = 200
MOST_DESIGNS = 4000  # of the map
LARGEST = 3_500_000  # characters of the motions; a page has half a megabyte besides
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
_PARAMETER = re.compile(r"\A(?:parameters\.)?(.+?)(?:\.value)?\Z")
_PAYLOAD = re.compile(r"\Apayloads?\.(?:(\d+)\.)?(mass|cg)(?:\.(\w+))?\Z")
_DURATION = re.compile(r"\A(motions\..+)\.duration\Z")


@dataclass(frozen=True, kw_only=True)
class View:
    """How designs are drawn: frames to trace, by default those of outputs or the tip, and the meshes' detail."""

    trace: tuple[str, ...] = ()
    detail: Detail = "reduced"


DEFAULT_VIEW = View()


@dataclass(frozen=True, eq=False, kw_only=True)
class StudyFilm:
    """The designs of a study that can move: their rows, in the order of the motions of the film."""

    rows: Rows
    designs: DesignFilm


def study_film(
    sweep: Sweep,
    measures: Sequence[str],
    *,
    title: str,
    view: View = DEFAULT_VIEW,
    progress: Callable[[float], object] | None = None,
) -> StudyFilm:
    """Simulate, or move, designs that represent the others, and make a film of them.

    Raises InputError where no design has a run.
    """
    able = np.flatnonzero([name != INFEASIBLE for name in sweep.columns.statuses])
    candidates = np.flatnonzero(np.isin(sweep.columns.status, able))
    wanted = representative_rows([sweep.columns.measures[name] for name in measures], candidates, MOST_MOTIONS)
    design = _designs(sweep)
    results: list[Trajectory | SizingInputs] = []
    rows: list[int] = []
    for done, row in enumerate(wanted.tolist()):
        with contextlib.suppress(InputError):  # such a design is among those without a motion
            results.append(design(sweep.values[row].tolist()))
            rows.append(row)
        if progress is not None:
            progress((done + 1) / len(wanted))
    film = film_of_designs(results, title=title, trace=view.trace, detail=view.detail)
    return StudyFilm(rows=np.array(rows, dtype=np.intp), designs=film)


def _designs(sweep: Sweep) -> Callable[[Sequence[float]], Trajectory | SizingInputs]:
    """What simulates one design by its values, or finds its motions; InputError where that is not possible."""
    if sweep.sized:
        return SizingRunner(sweep.scene, sweep.axes).inputs

    def simulated(values: Sequence[float]) -> Trajectory:
        overrides = {axis.path: axis.value(number) for axis, number in zip(sweep.axes, values, strict=True)}
        run = simulate(sweep.scene.with_overrides(overrides))
        if run.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        if not np.isfinite(run.state[0]).all():
            raise InputError(f"{sweep.scene.name}: its first state is not finite")
        return run

    return simulated


def representative_rows(columns: Iterable[Array], candidates: Rows, most: int) -> Rows:
    """At most `most` of the candidates: the median of the first column, extremes and medians of all, then others.

    The others follow the multiples of the golden section, which spread evenly however many they are, along a grid or
    the points of a sample (H. Weyl, Math. Ann. 77 (1916) 313-352).
    """
    chosen: list[int] = []
    for values in columns:
        there = candidates[np.isfinite(values[candidates])]
        if len(there):
            order = there[np.argsort(values[there], kind="stable")]
            chosen += [int(order[len(order) // 2]), int(order[0]), int(order[-1])]
    steps = np.arange(len(candidates)) if len(candidates) <= most else np.arange(4 * most)
    spread = (
        candidates if len(candidates) <= most else candidates[(len(candidates) * (steps * GOLDEN % 1.0)).astype(int)]
    )
    return np.array(list(dict.fromkeys([*chosen, *spread.tolist()]))[:most], dtype=np.intp)


def encoded_study(
    sweep: Sweep, film: StudyFilm, measures: Sequence[str], limits: Sequence[Limit]
) -> tuple[str, str, int]:
    """The JSON text of a study, its block of arrays, and the number of designs that can move.

    `measures` are the columns of the map beside the axes. There are as many motions as `LARGEST` allows.
    """
    count = len(film.rows)
    while True:
        text, arrays = _encoded(sweep, film, measures, limits, count)
        if len(arrays) <= LARGEST or count <= 1:
            return text, arrays, count
        count = max(1, min(count - 1, int(0.95 * count * LARGEST / len(arrays))))


def encoded_live_study(
    sweep: Sweep, settings: Sequence[dict[str, Any]], measures: Sequence[str], limits: Sequence[Limit]
) -> tuple[str, str]:
    """The JSON text of a study whose designs the page computes, and its block of arrays; see LiveStudy."""
    able = [name != INFEASIBLE for name in sweep.columns.statuses]
    rows = representative_rows([], np.flatnonzero(np.array(able)[sweep.columns.status]), MOST_DESIGNS)
    return _encoded_rows(sweep, rows, measures, limits, lambda arrays, plotted: {
        "settings": list(settings), "values": sweep.values[plotted].tolist(), "motions": [], "traced": [],
        "hint": _live_hint(len(sweep), len(plotted)),
    })  # fmt: skip


def _encoded(
    sweep: Sweep, film: StudyFilm, measures: Sequence[str], limits: Sequence[Limit], count: int
) -> tuple[str, str]:
    return _encoded_rows(sweep, film.rows[:count], measures, limits, lambda arrays, plotted: {
        "settings": None,
        "motions": encode_motions(film.designs.film, film.designs.motions[:count], arrays),
        "traced": list(film.designs.traced),
        "hint": _hint(len(sweep), len(plotted), count),
    })  # fmt: skip


def _encoded_rows(
    sweep: Sweep,
    rows: Rows,
    measures: Sequence[str],
    limits: Sequence[Limit],
    motions: Callable[[ArrayEncoder, Rows], dict[str, Any]],
) -> tuple[str, str]:
    """The data of a study in which designs `rows` can be shown, with what moves them, given the rows that are drawn."""
    plotted = np.unique(np.concatenate([rows, representative_rows([], np.arange(len(sweep)), MOST_DESIGNS)]))
    arrays, columns = ArrayEncoder(), sweep.columns
    reasons = list(dict.fromkeys(columns.reasons.get(row, "") for row in plotted.tolist()))
    number = {reason: k for k, reason in enumerate(reasons)}
    data: dict[str, Any] = {
        "columns": [
            {"name": readable(name), "unit": unit or "1", "values": arrays.add_centred_floats(values)}
            for name, unit, values in (
                *((axis.path, axis.unit, sweep.values[plotted, k]) for k, axis in enumerate(sweep.axes)),
                *((name, sweep.units[name], columns.measures[name][plotted]) for name in measures),
            )
        ],
        "number": arrays.add_integers(sweep.index[plotted]),
        "status": arrays.add_integers(columns.status[plotted].astype(np.int32)),
        "statuses": [readable(name) for name in columns.statuses],
        "reason": arrays.add_integers(np.array([number[columns.reasons.get(row, "")] for row in plotted.tolist()])),
        "reasons": [readable(reason) for reason in reasons],
        "shown": arrays.add_integers(np.searchsorted(plotted, rows)),
        "limits": [dataclasses.asdict(limit) for limit in limits],
        "chosen": _choice(len(sweep.axes), len(measures)),
        **motions(arrays, plotted),
    }
    return safe_json(data), arrays.text()


def _choice(axes: int, measures: int) -> dict[str, int]:
    """The columns of the map at first: two axes coloured by the first measure, or one measure over the only axis."""
    first = axes if measures else 0
    return {"x": 0, "y": 1 if axes > 1 else first, "colour": first}


def _live_hint(designs: int, plotted: int) -> str:
    drawn = f"{plotted:,} of {designs:,} designs are drawn. " if plotted < designs else ""
    return f"{drawn}A design that is clicked is computed here, and so are those between, with the sliders below."


def _hint(designs: int, plotted: int, movable: int) -> str:
    drawn = f"{plotted:,} of {designs:,} designs are drawn. " if plotted < designs else ""
    which = "Every design moves when it is clicked" if movable == designs else (
        f"A click shows the nearest of {movable:,} designs whose motion is in this page (large dots)"
    )  # fmt: skip
    return f"{drawn}{which}; its links have its own lengths."


@dataclass(frozen=True, eq=False, kw_only=True)
class LiveStudy:
    """What the page of a study computes.

    Attributes:
        film: The film of the scene itself, which computes.
        settings: Of each axis the number of its setting, the factor from values of the axis to it, and whether the
            setting is the factor over the value, as the speed of a motion is over its duration.
    """

    film: Film
    settings: tuple[dict[str, Any], ...]


def live_study(sweep: Sweep, *, title: str, view: View) -> LiveStudy:
    """The film of a study's scene that computes its designs.

    Raises InputError where the page cannot compute the scene, or an axis is none of its settings.
    """
    options: dict[str, Any] = {"trace": view.trace, "detail": view.detail, "title": title, "live": True}
    if sweep.sized:
        film = film_of_sizing(size(sweep.scene), **options)
    else:
        film = film_of_run(simulate(sweep.scene), **options)
    if film.live is None:
        raise InputError(f"sweep of {sweep.scene.name}: {film.notes[-1]}")
    found = [_setting(sweep, axis, film.live.content["settings"]) for axis in sweep.axes]
    for axis, one in zip(sweep.axes, found, strict=True):
        if one is None:
            raise InputError(
                f"sweep of {sweep.scene.name}: its page cannot compute designs, because '{axis.path}' is none of the "
                "values that a page can change; leave live out, and the page keeps the motions of some designs"
            )
    return LiveStudy(film=film, settings=tuple(one for one in found if one is not None))


def _setting(sweep: Sweep, axis: StudyAxis, settings: list[dict[str, Any]]) -> dict[str, Any] | None:
    """The setting of an axis; None where there is none."""
    if not axis.numeric:
        return None
    path, entry, inverse = _PARAMETER.sub(r"\1", axis.path), "", False
    if (match := _PAYLOAD.match(axis.path)) is not None:
        number, what, component = match.groups()
        path = f"payloads.{number or 1}.{what}"
        entry = str(ORIGIN.index(component) + 1) if component in ORIGIN[:3] else component or ""
    elif (match := _DURATION.match(axis.path)) is not None:
        if changes_of(sweep.scene, [axis])[1][0].kind != "duration":
            return None  # it changes motions that are joined from it too
        path, inverse = f"{match[1]}.speed_factor", True
    for k, one in enumerate(settings):
        if (one.get("path"), one.get("entry", "")) == (path, entry) and not one.get("options"):
            try:
                factor = parse_number(axis.value(1.0), "s" if inverse else one["unit"])
            except ValueError:
                return None
            if inverse:
                duration = present_duration(sweep.scene, axis.path)
                if duration is None:  # a key of the motion's own
                    duration = sweep.scene.config.motion(sweep.scene.robot, axis.path.split(".", 1)[1][:-9]).duration
                factor = one["value"] * duration / factor
            return {"setting": k, "factor": factor, "inverse": inverse}
    return None
