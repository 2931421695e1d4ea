"""A picture of Sobol indices: bars with their intervals, the most influential parameter on top."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.files.atomic_write import writing
from bellcrank.plot_style import DPI, PALETTE, literal, new_figure, plain, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bellcrank.studies.sobol_indices import SobolIndices
    from bellcrank.studies.tolerance import Estimate

FIRST, TOTAL = PALETTE[0], PALETTE[4]
MOST_PANELS = 12
MOST_BARS = 20  # parameters of a panel: those with the largest total index
LONGEST = 28  # characters of a parameter's name


def plot_indices(indices: Sequence[SobolIndices], title: str, path: str | Path | None = None) -> Figure:
    """Draw first-order and total indices of each measure as horizontal bars, in the order of the total index.

    Args:
        indices: Of some measures; at most `MOST_PANELS` are drawn.
        title: The title of the figure.
        path: Where the picture is written (PNG); None: nowhere.

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
    if path is not None:
        with writing(path) as temporary:
            save_figure(figure, temporary, "png", dpi=DPI)
    return figure


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
