"""Pictures of a synthesised linkage: its links with the coupler curve, and its output with a function."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.present.plot_style import colour, plain
from bellcrank.studies.synthesis.linkage import FourBar, SixBar, SliderCrank

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_linkage(axis: Axes, linkage: FourBar | SliderCrank, points: Array | None) -> None:
    """The linkage at the first point, and the curve of its coupler point where points are given."""
    if points is not None:
        axis.plot(*linkage.path(np.linspace(0.0, 2.0 * np.pi, 361)).T, color=colour(0), label="coupler point")
    end, tip = linkage.postures(linkage.angles[:1])
    pivot = complex(*linkage.pivot)
    bars = [pivot, end[0], tip[0]]
    if isinstance(linkage, FourBar):
        bars.append(linkage.rocker_pivot)
    if isinstance(linkage, SixBar):
        first, corner, last = linkage.dyad(linkage.angles[:1])
        dyad = np.array([first[0], corner[0], last[0]])
        axis.plot(dyad.real, dyad.imag, "o-", color=colour(2), label="link, second rocker")
        plates = [[end[0], first[0], tip[0]]]
        plates += [[linkage.rocker_pivot, last[0], tip[0]]] if linkage.on_rocker else []
        for corners in plates:
            axis.fill(np.real(corners), np.imag(corners), color="0.4", alpha=0.15)
        end, tip = first, corner
    label = "crank, coupler, rocker" if isinstance(linkage, FourBar) else "crank, coupler"
    axis.plot(np.real(bars), np.imag(bars), "o-", color="0.4", label=label)
    if isinstance(linkage, SliderCrank):
        _, places = linkage.postures(np.linspace(0.0, 2.0 * np.pi, 361))
        axis.plot(places.real, places.imag, ":", color="0.4", label="path of the slider")
        axis.plot(tip.real, tip.imag, "s", color="0.4")
    if points is not None:
        corner = linkage.path(linkage.angles[:1]) @ np.array([1.0, 1.0j])
        plate = np.array([end[0], corner[0], tip[0]])
        axis.fill(plate.real, plate.imag, color="0.4", alpha=0.15)
        axis.plot(*points.T, "x", color=colour(1), label="given points")
    axis.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axis.legend(fontsize="small")
    plain(axis)


def draw_function(axis: Axes, linkage: FourBar | SliderCrank, function: Array, differences: Array) -> None:
    """The output over the crank's angle, and the given pairs."""
    slider = isinstance(linkage, SliderCrank)
    scale = 1.0 if slider else np.degrees(1.0)
    crank = np.linspace(linkage.angles[0], linkage.angles[-1], 361)
    output = linkage.output(crank)
    output += function[0, 1] + differences[0] - output[0]  # without whole turns
    axis.plot(np.degrees(crank - linkage.input_offset), scale * output, color=colour(0), label="linkage")
    axis.plot(np.degrees(function[:, 0]), scale * function[:, 1], "x", color=colour(1), label="given")
    axis.set(xlabel="crank [deg]", ylabel="slider [m]" if slider else "rocker [deg]")
    axis.legend(fontsize="small")
    plain(axis)
