"""Pictures of eigenvalues: those of one operating point, and root loci."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.present.plot_style import colour, literal, new_figure, plain, write_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bellcrank.analysis.linearisation import Linearisation
    from bellcrank.analysis.root_loci import RootLoci

UNSTABLE = "#D55E00"
SPREAD = 50.0  # of the sizes of eigenvalues that one linear scale shows apart


def plot_eigenvalues(linear: Linearisation) -> Figure:
    """The eigenvalues of a linearisation in the complex plane, with the numbers of their modes.

    Modes that grow are in the shaded half; rays are lines of the same damping ratio. Where the sizes differ by more
    than SPREAD, the scales are logarithmic away from the smallest, and there are no rays.
    """
    figure = new_figure(10.0, 4.6)
    plane = figure.add_subplot()
    values = np.array([mode.eigenvalue for mode in linear.modes])
    size = 1.25 * max(np.abs(values).max(initial=0.0), 1e-9)
    least = min(np.abs(values)[values != 0.0], default=size)
    wide = size > SPREAD * least
    if wide:
        plane.set_xscale("symlog", linthresh=least)
        plane.set_yscale("symlog", linthresh=least)
    for ratio in () if wide else (0.1, 0.3, 0.5, 0.7, 0.9):
        x, y = -size * ratio, size * np.sqrt(1.0 - ratio**2)
        plane.plot([0.0, x, np.nan, 0.0, x], [0.0, y, np.nan, 0.0, -y], color="0.85", linewidth=0.8, zorder=1)
        plane.annotate(f"{ratio:g}", (x, y), fontsize=8, color="0.5", ha="right")
    plane.axvspan(0.0, size, color=UNSTABLE, alpha=0.08, linewidth=0.0)
    plane.axvline(0.0, color="black", linewidth=0.8)
    plane.axhline(0.0, color="0.6", linewidth=0.6)
    places: dict[complex, list[str]] = {}
    for k, value in enumerate(values.tolist(), 1):
        places.setdefault(value, []).append(str(k))
    for value, numbers in places.items():
        tint = UNSTABLE if value.real > 0.0 else colour(0)
        for part in dict.fromkeys((value.imag, -value.imag)):
            plane.plot(value.real, part, "x", color=tint, markersize=9, markeredgewidth=2.0, zorder=3)
        plane.annotate(
            ", ".join(numbers), (value.real, value.imag), (6, 5), textcoords="offset points", color=tint, zorder=4
        )
    plane.set_xlim(-size, size)
    plane.set_ylim(-size, size)
    plain(plane)
    plane.set_xlabel("real part [1/s]: growth to the right, decay to the left")
    plane.set_ylabel("imaginary part [1/s]")
    return figure


def plot_root_loci(loci: RootLoci, path: Path | None) -> Figure:
    """Eigenvalues in the complex plane, coloured by the number, and their parts over it; unstable values are shaded."""
    figure = new_figure(10.0, 6.5)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.1, 1.0))
    plane = figure.add_subplot(grid[:, 0])
    real, imaginary = figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])
    numbers, values = loci.numbers, loci.eigenvalues
    there = np.isfinite(values)
    column = np.broadcast_to(numbers[:, None], values.shape)
    marks = plane.scatter(values.real[there], values.imag[there], c=column[there], s=12, cmap="viridis", zorder=3)
    for k in range(values.shape[1]):
        plane.plot(values[:, k].real, values[:, k].imag, color="0.75", linewidth=0.8, zorder=2)
        for axes, part in ((real, values[:, k].real), (imaginary, values[:, k].imag)):
            axes.plot(numbers, part, color=colour(k), linewidth=1.2, marker="." if len(numbers) < 60 else None)
    plane.axvline(0.0, color="black", linewidth=0.8)
    real.axhline(0.0, color="black", linewidth=0.8)
    for axes in (real, imaginary):
        _shade_unstable(axes, loci)
    name = literal(loci.parameter)
    for axes, x, y, title in (
        (plane, "real part [1/s]", "imaginary part [1/s]", "eigenvalues"),
        (real, "", "real part [1/s]", "growth (shaded where a mode grows)"),
        (imaginary, name, "imaginary part [1/s]", "angular frequency"),
    ):
        plain(axes)
        axes.set_xlabel(x)
        axes.set_ylabel(y)
        axes.set_title(title, loc="left", fontsize=10)
    figure.colorbar(marks, ax=plane, orientation="horizontal", label=name, pad=0.12)
    figure.suptitle(literal(loci.name), x=0.02, ha="left")
    return write_figure(figure, path)


def _shade_unstable(axes: Axes, loci: RootLoci) -> None:
    """Shade the values at which a mode grows, halfway to the neighbouring ones."""
    numbers = loci.numbers
    order = np.argsort(numbers)
    edges = np.concatenate([numbers[order][:1], (numbers[order][1:] + numbers[order][:-1]) / 2, numbers[order][-1:]])
    for place, k in enumerate(order):
        found = loci.linearisations[int(k)]
        if found is not None and found.stable is False:
            axes.axvspan(edges[place], edges[place + 1], color=UNSTABLE, alpha=0.12, linewidth=0.0)
