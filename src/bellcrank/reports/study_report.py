"""The report of a study of many designs: what was found in words, a map whose designs move, statistics."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.errors import InputError
from bellcrank.present.plot_style import svg_of
from bellcrank.replays.page.page import Surroundings, write_page
from bellcrank.reports.document import Document, Facts, Picture, Still, Table, document_html
from bellcrank.reports.input_tables import about, made_with
from bellcrank.reports.study_data import DEFAULT_VIEW, View, encoded_live_study, encoded_study, live_study, study_film
from bellcrank.studies.designs.samples import SensitivitySample
from bellcrank.studies.results.exceedance import Exceedance, interval_text, missing_text, parse_limit
from bellcrank.studies.results.sample_statistics import TABLE_LEVELS
from bellcrank.studies.results.sensitivity import index_text
from bellcrank.studies.results.sweep_statistics import sweep_sensitivity, sweep_statistics
from bellcrank.studies.results.tolerance import Estimate, figure
from bellcrank.terminal.progress import share_bar

if TYPE_CHECKING:
    from bellcrank.studies.results.sample_statistics import SampleStatistics
    from bellcrank.studies.results.sensitivity import Sensitivity
    from bellcrank.studies.results.sweep_result import Sweep

ASSETS = Path(__file__).with_name("assets")
SCRIPTS = ("svg_plot.js", "design_map.js", "study.js")  # in the order in which they stand in the page
STYLES = ("svg_plot.css", "study.css")
MOST_MEASURES = 12
IN_WORDS = 4  # measures of the verdict


def write_study(
    sweep: Sweep,
    path: str | Path,
    *,
    measures: Sequence[str] | None = None,
    limits: Sequence[str] = (),
    title: str | None = None,
    view: View = DEFAULT_VIEW,
    live: bool = False,
) -> Path:
    """Write the page of a study.

    Args:
        sweep: The designs with their measures.
        path: The file; .html is added if it has another suffix.
        measures: Names of the measures that are shown; by default those that tables show.
        limits: Limits such as "lock.time > 13 s".
        title: The title of the page; by default the name of the scene.
        view: How the designs are drawn.
        live: Whether the page computes designs, instead of keeping motions of some.

    Returns:
        The path of the file.

    Raises:
        InputError: No design could be run, a measure or limit is unknown, limits are given and the designs are not a
            sample, the page cannot compute the designs, or the file cannot be written.
    """
    read = [parse_limit(limit, sweep.units, "limit") for limit in limits]
    names = (*(measures or sweep.default_measures), *(limit.measure for limit in read))
    shown = tuple(dict.fromkeys(names))[:MOST_MEASURES]
    for name in shown:
        sweep.column(name)  # refuses an unknown one
    statistics = _statistics(sweep, needed=bool(limits))
    sensitivity = sweep_sensitivity(sweep) if isinstance(sweep.space.sample, SensitivitySample) else None
    found = [statistics.exceedance(limit) for limit in limits] if statistics is not None else []
    name = title or sweep.scene.name
    if live:
        made = live_study(sweep, title=name, view=view)
        data, film = encoded_live_study(sweep, made.settings, shown, read), made.film
        still = Still(0.0, "The scene of the study, at the start")
    else:
        with share_bar("motions of designs") as progress:
            designs = study_film(sweep, shown, title=name, view=view, progress=progress)
        data, film = encoded_study(sweep, designs, shown, read)[:2], designs.designs.film
        end = float(designs.designs.motions[0].time[-1])
        still = Still(end, "A design whose first measure is the median of all, at its end")
    document = study_document(sweep, name, still, shown, found, statistics, sensitivity)
    return write_page(film, path, plots=live, around=_surroundings(document, *data))


def _statistics(sweep: Sweep, *, needed: bool) -> SampleStatistics | None:
    """The statistics, or None where the designs are not a sample whose error is known and none are `needed`."""
    try:
        return sweep_statistics(sweep)
    except InputError:
        if needed:
            raise
        return None


def _surroundings(document: Document, study: str, arrays: str) -> Surroundings:
    before, after = document_html(document)
    data = f'<script type="application/json" id="study">{study}</script>'
    data += f'<script type="text/plain" id="study-arrays">{arrays}</script>'
    return Surroundings(
        before=before,
        after=after + data,
        style="".join(map(_asset, STYLES)),
        scripts=tuple(map(_asset, SCRIPTS)),
    )


def study_document(
    sweep: Sweep,
    title: str,
    still: Still,
    measures: Sequence[str],
    found: Sequence[Exceedance],
    statistics: SampleStatistics | None,
    sensitivity: Sensitivity | None,
) -> Document:
    """Verdict, tables and pictures of a study."""
    made = made_with()
    parts: list[Facts | Table | Picture] = []
    if found:
        parts.append(limit_table(found))
    if statistics is not None and measures:
        parts.append(distribution_table(statistics, measures))
        parts.append(
            Picture(
                "Distributions",
                svg_of(statistics.plot(measures=measures, limits=[str(e.limit) for e in found])),
                screen=True,
            )
        )
    elif measures:
        parts.append(Picture("Measures over the designs", svg_of(sweep.plot(measures=measures)), screen=True))
    if sensitivity is not None:
        varying = [name for name in measures if sensitivity.indices(name).varies]
        if varying:
            parts.append(Picture("Sobol indices", svg_of(sensitivity.plot(measures=varying)), screen=True))
            parts.append(index_table(sensitivity, varying))
    parts += [axis_table(sweep), status_table(sweep), Facts("Made with", (("scene", sweep.scene.source.name), *made))]
    failed = len(sweep) - sweep.finished
    sample = sweep.space.sample
    kind = "grid of all combinations" if sample is None else sample.identity
    return Document(
        title=title,
        status=_status(sweep, found),
        success=bool(sweep.finished),
        partial=bool(failed) or not sweep.complete or any(one.exceeded for one in found),
        verdict=tuple(_verdict(sweep, measures, found, statistics, sensitivity)),
        about=("study of designs", sweep.scene.source.name, kind, *about(made)),
        warnings=sweep.not_known,
        notes=(
            *(note for note in sweep.notes if note.matter != "reached"),
            *([sample.note] if sample is not None and sample.note else []),
        ),
        still=still,
        parts=tuple(parts),
    )


def _status(sweep: Sweep, found: Sequence[Exceedance]) -> str:
    """The result in a few words; "OK" only where all designs finished and none exceeds a limit."""
    if not sweep.complete:
        return "Interrupted"
    if failed := len(sweep) - sweep.finished:
        return f"{failed:,} failed"
    worst = max((one.probability for one in found if one.exceeded), default=0.0)
    if worst:
        return f"A limit is exceeded with a probability of {100.0 * worst:.3g} %"
    return "Not known" if sweep.not_known else "OK"


def _verdict(
    sweep: Sweep,
    measures: Sequence[str],
    found: Sequence[Exceedance],
    statistics: SampleStatistics | None,
    sensitivity: Sensitivity | None,
) -> list[str]:
    """What was found, in sentences."""
    paths = ", ".join(axis.path for axis in sweep.axes)
    did = "pass" if sweep.sized else "reached their target"
    reached = f"{sweep.finished:,} {did}" if sweep.finished < len(sweep) else f"all {did}"
    lines = [f"{len(sweep):,} designs over {paths}: {reached}."]
    if not sweep.complete:
        lines.append(f"The study was interrupted: {len(sweep.space):,} designs were asked for.")
    for one in found:
        share = f"{100.0 * one.probability:.3g} %" if np.isfinite(one.probability) else "unknown"
        low, high = (f"{100.0 * end:.3g}" for end in one.interval)
        lines.append(f"{one.limit}: probability {share} (95 % interval {low} to {high} %).")
    for name in measures[:IN_WORDS]:
        lines += _measure_words(sweep, name, statistics, sensitivity)
    return lines


def _measure_words(
    sweep: Sweep, name: str, statistics: SampleStatistics | None, sensitivity: Sensitivity | None
) -> list[str]:
    unit = "" if sweep.units[name] == "1" else sweep.units[name]
    if statistics is None:
        known = sweep.column(name)[np.isfinite(sweep.column(name))]
        return [f"{name}: {known.min():.6g} to {known.max():.6g} {unit}".rstrip() + "."] if len(known) else []
    one = statistics.distribution(name, TABLE_LEVELS)
    if not one.count:
        return []
    low, middle, high = (each.value for each in one.quantiles.values())
    lines = [f"{name}: median {middle:.6g}, 90 % of the designs from {low:.6g} to {high:.6g} {unit}".rstrip() + "."]
    if sensitivity is not None and (indices := sensitivity.indices(name)).varies:
        best = max(range(len(indices.total)), key=lambda k: indices.total[k].value)
        share, error = 100.0 * indices.first[best].value, 100.0 * indices.first[best].half_width
        lines[0] += (
            f" {indices.parameters[best]} explains {share:.1f} ± {error:.1f} % of its variance by itself; no parameter "
            "has a larger total index."
        )
    return lines


# ---- tables


def limit_table(found: Sequence[Exceedance]) -> Table:
    """Limits with their probabilities."""
    header = (
        "limit",
        "probability",
        "95 % interval",
        "designs",
        "if designs without the measure\nall pass or all exceed",
    )
    rows = tuple(
        (
            str(one.limit),
            f"{one.probability:.4g}" if np.isfinite(one.probability) else "unknown",
            interval_text(one.interval),
            f"{one.exceeded:,} of {one.count:,}",
            f"{interval_text(one.bounds)}; {missing_text(one.missing)}" if one.missing else "every design has it",
        )
        for one in found
    )
    return Table("Limits", header, rows, f"Intervals: {found[0].method}.")


def distribution_table(statistics: SampleStatistics, measures: Sequence[str]) -> Table:
    """Mean, standard deviation and quantiles of measures, with their intervals."""
    header = ("measure", "unit", "mean", "standard deviation", "5 %", "median", "95 %", "designs")
    rows = []
    for name in measures:
        one = statistics.distribution(name, TABLE_LEVELS)
        numbers = (one.mean, one.deviation, *one.quantiles.values())
        cells = (_two_lines(each) for each in numbers)
        rows.append((name, one.unit, *cells, f"{one.count:,}"))
    return Table(
        "Distributions", header, tuple(rows), f"Below each number its 95 % interval ({statistics.layout.method})."
    )


def index_table(sensitivity: Sensitivity, measures: Sequence[str]) -> Table:
    """First-order and total Sobol indices."""
    rows, left_out = [], []
    for name in measures:
        found = sensitivity.indices(name)
        for path, first, total in zip(found.parameters, found.first, found.total, strict=True):
            rows.append((f"{name}: {path}", index_text(first), index_text(total)))
        if found.left_out:
            left_out.append(f"{name}: {found.left_out:,} of {found.left_out + found.blocks:,}")
    note = (
        "Shares of the variance, with 95 % intervals: what a parameter explains by itself, and with all interactions "
        f"({sensitivity.sample.content})."
    )
    if left_out:
        note += (
            f" Blocks of designs left out because a design does not have the measure: {', '.join(left_out)}; the "
            "indices of these measures are approximate."
        )
    return Table("Sobol indices", ("", "first order", "total"), tuple(rows), note)


def axis_table(sweep: Sweep) -> Table:
    """What was varied."""
    rows = []
    for axis in sweep.axes:
        if axis.distribution is not None:
            given = str(axis.distribution)
        else:
            given = (
                f"{len(axis):,} values from {axis.shown(axis.numbers[0])} to {axis.shown(axis.numbers[-1])} {axis.unit}"
            )
        rows.append((axis.path, given.rstrip()))
    return Table("Parameters", ("", "varied over"), tuple(rows))


def status_table(sweep: Sweep) -> Table:
    """How many designs have which status, and the most frequent reasons."""
    counts = np.bincount(sweep.columns.status, minlength=len(sweep.columns.statuses))
    rows = []
    for status, (name, count) in enumerate(zip(sweep.columns.statuses, counts.tolist(), strict=True)):
        if count:
            reason = next((text for row, text in sweep.reasons.items() if sweep.columns.status[row] == status), "")
            rows.append((name, f"{count:,}", reason))
    return Table("Statuses", ("", "designs", "a reason"), tuple(rows))


def _two_lines(each: Estimate) -> str:
    """A number, and below it its interval."""
    low, high = (figure(end, each.half_width) for end in each.interval)
    return f"{figure(each.value, each.half_width)}\n{low} … {high}"


@functools.cache
def _asset(name: str) -> str:
    return (ASSETS / name).read_text("utf-8")
