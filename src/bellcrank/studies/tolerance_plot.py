"""A picture of a sample: the distribution of each measure, its limits, and the probability to exceed them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank.files.atomic_write import writing
from bellcrank.plot_style import DPI, PALETTE, literal, new_figure, plain, save_figure
from bellcrank.studies.tolerance import histogram

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bellcrank.studies.exceedance import Exceedance
    from bellcrank.studies.intervals import Array
    from bellcrank.studies.tolerance import MeasureDistribution

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
        path: Where the picture is written (PNG); None: nowhere.

    Returns:
        A matplotlib figure.

    Raises:
        InputError: The file cannot be written.
    """
    figure, panels = _panels(min(len(distributions), MOST_PANELS), title)
    for place, (one, values) in zip(panels, distributions, strict=False):
        _histogram(place, one, values, [found for found in exceedances if found.limit.measure == one.measure])
    return _written(figure, path)


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


def _written(figure: Figure, path: str | Path | None) -> Figure:
    if path is not None:
        with writing(path) as temporary:
            save_figure(figure, temporary, "png", dpi=DPI)
    return figure
