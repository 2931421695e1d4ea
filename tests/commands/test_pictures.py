"""Pictures of commands: the same as Matplotlib's own way of saving them, whoever draws them."""

import io
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

import bellcrank as bc
from bellcrank.present import plot_style
from bellcrank.present.plot_style import DPI, new_figure, save_figure
from bellcrank.sizing.plots import sizing_figures, write_plots


def pixels(file):
    return np.asarray(Image.open(file).convert("RGBA"))


@pytest.mark.parametrize("name", ["over_time_elbow_up.png", "torque_speed.png"])
def test_a_picture_drawn_once_is_the_one_that_matplotlib_saves(name):
    sizing = bc.size("planar_2r")
    ours, theirs = io.BytesIO(), io.BytesIO()
    save_figure(sizing_figures(sizing)[name], ours, "png", dpi=DPI)
    sizing_figures(sizing)[name].savefig(theirs, format="png", dpi=DPI)
    np.testing.assert_array_equal(pixels(ours), pixels(theirs))


def test_a_figure_is_as_it_was_after_it_was_saved():
    figure = new_figure(3.0, 2.0)
    figure.subplots().plot([0, 1])
    before = figure.dpi, type(figure.get_layout_engine())
    save_figure(figure, io.BytesIO(), "png", dpi=DPI)
    assert (figure.dpi, type(figure.get_layout_engine())) == before


@pytest.mark.tier2
def test_pictures_that_two_processes_draw_are_those_of_one(tmp_path):
    subprocess.run(
        [sys.executable, "-m", "bellcrank", "size", "planar_2r", "--out", str(tmp_path / "two")],
        capture_output=True, check=True,
    )  # fmt: skip
    files = write_plots(bc.size("planar_2r"), tmp_path)
    assert len(files) == 4
    for file in files:
        np.testing.assert_array_equal(pixels(tmp_path / "two" / file.name), pixels(file))


def test_what_the_second_process_cannot_draw_is_said_by_the_first(tmp_path, monkeypatch):
    def broken():
        raise bc.InputError("no picture of this")

    def drawn():
        figure = new_figure(2.0, 2.0)
        figure.subplots().plot([0, 1])
        return figure

    monkeypatch.setattr(plot_style.threading, "active_count", lambda: 1)  # those of the test runner are asleep
    with pytest.raises(bc.InputError, match="no picture of this"):
        plot_style.write_figures({"a.png": drawn, "b.png": broken}, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]
