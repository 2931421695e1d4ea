"""A picture of a sample: the distribution of each measure, its limits, and the probability to exceed them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.present.plot_style import PALETTE, literal, new_figure, plain, write_figure
from bellcrank.studies.results.tolerance import histogram

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bellcrank.studies.results.exceedance import Exceedance
    from bellcrank.studies.results.sensitivity import SobolIndices
    from bellcrank.studies.results.tolerance import Estimate, MeasureDistribution

BODY, BEYOND, MIDDLE = PALETTE[5], PALETTE[1], PALETTE[6]
MOST_PANELS = 12
WIDTH, PANEL = 5.6, 3.2  # inches


def plot_distributions(
    distributions: Sequence[tuple[MeasureDistribution, Array]],
    exceedances: Sequence[Exceedance],
    title: str,
    path: str | Path | None = None,
) -> Figure:
    """Draw a histogram of each measure with its median, the range of its middle 90 %, its limits and probabilities.

    Args:
        distributions: Measures with their values (designs,); at most `MOST_PANELS` are drawn.
        exceedances: Limits of some of them.
        title: The title of the figure.
        path: Where the picture is written, in the format of its suffix (PNG without one); None: nowhere.

    Returns:
        A matplotlib figure.

    Raises:
        InputError: The file cannot be written.
    """
    figure, panels = _panels(min(len(distributions), MOST_PANELS), title)
    for place, (one, values) in zip(panels, distributions, strict=False):
        _histogram(place, one, values, [found for found in exceedances if found.limit.measure == one.measure])
    return write_figure(figure, path)


def _panels(count: int, title: str) -> tuple[Figure, list[Axes]]:
    columns = 1 if count < 2 else 2
    rows = max(1, -(-count // columns))
    figure = new_figure(WIDTH * columns + (1.5 if columns == 1 else 0.0), 0.6 + PANEL * rows)
    panels = figure.subplots(rows, columns, squeeze=False).ravel().tolist()
    for place in panels[count:]:
        place.set_visible(False)
    figure.suptitle(literal(title, 90))
    return figure, panels


def _histogram(place: Axes, one: MeasureDistribution, values: Array, exceedances: Sequence[Exceedance]) -> None:
    place.set_xlabel(literal(f"{one.measure} [{one.unit}]"))
    place.set_ylabel("density")
    plain(place)
    if not one.count:
        place.text(0.5, 0.5, "no design has this measure", ha="center", va="center", transform=place.transAxes)
        return
    if one.least == one.largest:
        text = f"{one.largest:.9g} in all designs that have it"
        place.text(0.5, 0.5, text, ha="center", va="center", transform=place.transAxes)
        return
    density, edges = histogram(values)
    place.stairs(density, edges, fill=True, color=BODY, alpha=0.75)
    low, middle, high = (one.quantiles[level].value for level in (0.05, 0.5, 0.95))
    place.axvspan(low, high, color="0.5", alpha=0.12, linewidth=0.0, label=f"90 % in {low:.5g} … {high:.5g}")
    place.axvline(middle, color=MIDDLE, linewidth=1.3, label=f"median {middle:.5g}")
    for k, found in enumerate(exceedances):
        least, most = found.interval
        text = f"P({found.limit.relation} {found.limit.value:.5g}) = {found.probability:.3g} ({least:.3g} … {most:.3g})"
        style = ("--", ":", "-.")[k % 3]
        place.axvline(found.limit.value, color=BEYOND, linewidth=1.5, linestyle=style, label=literal(text))
    if one.missing:
        absent = sum(one.missing.values())
        place.plot([], [], " ", label=f"{absent} of {absent + one.count} designs without it")
    place.legend(frameon=False, fontsize="small", loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)


# ---- A picture of Sobol indices: bars with their intervals, the most influential parameter on top.


FIRST, TOTAL = PALETTE[0], PALETTE[4]
MOST_BARS = 20  # parameters of a panel: those with the largest total index
LONGEST = 28  # characters of a parameter's name


def plot_indices(indices: Sequence[SobolIndices], title: str, path: str | Path | None = None) -> Figure:
    """Draw first-order and total indices of each measure as horizontal bars, in the order of the total index.

    Args:
        indices: Of some measures; at most `MOST_PANELS` are drawn.
        title: The title of the figure.
        path: Where the picture is written, in the format of its suffix (PNG without one); None: nowhere.

    Returns:
        A matplotlib figure.

    Raises:
        InputError: The file cannot be written.
    """
    shown = indices[:MOST_PANELS]
    columns = 1 if len(shown) < 2 else 2
    rows = max(1, -(-len(shown) // columns))
    bars = max((min(len(one.parameters), MOST_BARS) for one in shown), default=1)
    figure = new_figure(6.4 if columns == 1 else 11.0, 0.8 + rows * (1.2 + 0.42 * bars))
    panels = figure.subplots(rows, columns, squeeze=False).ravel().tolist()
    for place, one in zip(panels, shown, strict=False):
        _bars(place, one)
    for place in panels[len(shown) :]:
        place.set_visible(False)
    figure.suptitle(literal(title, 90))
    return write_figure(figure, path)


def _bars(place: Axes, one: SobolIndices) -> None:
    place.set_title(literal(one.measure), fontsize="medium")
    plain(place)
    if not one.varies:
        place.text(0.5, 0.5, "does not vary", ha="center", va="center", transform=place.transAxes)
        place.set_yticks([])
        return
    order = np.argsort([-estimate.value for estimate in one.total], kind="stable")[:MOST_BARS]
    rows = np.arange(len(order))
    for shift, estimates, colour, label in (
        (-0.19, one.first, FIRST, "first order"),
        (0.19, one.total, TOTAL, "total"),
    ):
        _one_kind(place, rows + shift, [estimates[k] for k in order], colour, label)
    names = [one.parameters[k] for k in order]
    place.set_yticks(rows, [literal(name if len(name) <= LONGEST else f"{name[: LONGEST - 1]}…") for name in names])
    place.invert_yaxis()
    place.grid(visible=False, axis="y")
    place.axvline(0.0, color="0.3", linewidth=0.8)
    place.set_xlabel("share of the variance, with 95 % interval")
    place.legend(frameon=False, fontsize="small", loc="lower right")


def _one_kind(place: Axes, rows: np.ndarray, estimates: Sequence[Estimate], colour: str, label: str) -> None:
    values = [estimate.value for estimate in estimates]
    half = [estimate.half_width for estimate in estimates]
    place.barh(rows, values, height=0.36, color=colour, label=label, xerr=half, ecolor="0.15", capsize=2.5)
