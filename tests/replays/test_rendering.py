"""Stills and films: what they show and how long, and one sentence with nothing left where a tool is missing."""

import gc
import io
import os
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

import bellcrank as bc
from bellcrank.commands import replay as command
from bellcrank.errors import BellcrankError, InputError
from bellcrank.replays.page import rendering
from bellcrank.replays.replay import replay

ARM = """
urdf: planar_2r
gravity: [0, -9.81, 0]
initial: {shoulder: 0.3, elbow: 0.5}
simulate: {duration: 1, samples: 51}
"""
SMALL = (160, 120)


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    try:
        rendering.find_browser()
    except InputError as error:
        (pytest.fail if os.environ.get("CI") else pytest.skip)(str(error))
    folder = tmp_path_factory.mktemp("page")
    (folder / "arm.yaml").write_text(ARM)
    return replay(bc.simulate(folder / "arm.yaml"), folder / "arm.html", plots=False)


@pytest.fixture
def no_browser(monkeypatch):
    monkeypatch.setattr(rendering.shutil, "which", lambda name: None)


def colours(picture):
    return np.asarray(picture.convert("RGB"), dtype=int)


# ---- what they show


@pytest.mark.tier2
def test_a_still_is_the_view_at_its_time_in_its_size(page, tmp_path):
    first = Image.open(rendering.render_still(page, tmp_path / "a.png", 0.0, SMALL))
    last = Image.open(rendering.render_still(page, tmp_path / "b.png", size=SMALL))
    assert first.size == last.size == SMALL and np.abs(colours(first) - colours(last)).max() > 60
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.png", "b.png"]


@pytest.mark.tier2
def test_a_gif_runs_as_long_as_the_run_and_its_ends_are_the_stills(page, tmp_path):
    told = []
    out = rendering.render_video(page, tmp_path / "a.gif", 2.0, 15, SMALL, lambda done, of: told.append((done, of)))
    with Image.open(out) as film:
        lasts, frames = [], []
        for k in range(film.n_frames):
            film.seek(k)
            lasts.append(film.info["duration"])
            frames.append(colours(film))
    assert told == [(k + 1, len(frames)) for k in range(len(frames))] and film.info["loop"] == 0
    assert sum(lasts[:-1]) == pytest.approx(500.0, abs=40.0)  # twice as fast; the last frame stays as long as any
    for time, frame in ((0.0, frames[0]), (1.0, frames[-1])):
        render_still = colours(Image.open(rendering.render_still(page, tmp_path / "s.png", time, SMALL)))
        assert np.abs(render_still - frame).mean() < 3.0  # of 255: the colours of a GIF are 256


@pytest.mark.tier2
def test_a_gif_of_many_frames_takes_no_more_memory_than_one_of_few(tmp_path):
    alive = []

    def frames():
        for k in range(60):
            alive.append(sum(isinstance(each, Image.Image) for each in gc.get_objects()))
            picture = Image.new("RGB", (400, 300), (250, 250, 250))
            picture.paste((20, 80, 200), (k, 50, k + 40, 90))
            buffer = io.BytesIO()
            picture.save(buffer, "PNG")
            yield buffer.getvalue()

    palette = Image.open(io.BytesIO(next(frames()))).quantize(256)
    alive.clear()
    rendering._write_gif(frames(), tmp_path / "a.gif", 30, palette)
    assert max(alive[10:]) <= max(alive[:10])
    with Image.open(tmp_path / "a.gif") as film:
        assert film.n_frames == 60
        film.seek(59)
        shown = colours(film)
    assert np.ptp(shown[70, 60:98], axis=0).max() == 0 and np.abs(shown[70, 75] - shown[70, 20]).max() > 50


@pytest.mark.tier2
def test_an_mp4_holds_every_frame(page, tmp_path):
    out = rendering.render_video(page, tmp_path / "a.mp4", 1.0, 20, (161, 121))  # odd sides are made even
    said = subprocess.run(
        [rendering.find_encoder(), "-i", str(out), "-map", "0:v", "-f", "framemd5", "-"], capture_output=True, text=True
    ).stdout
    rows = [line.split(",")[-1].strip() for line in said.splitlines() if not line.startswith("#")]
    assert "160x120" in said and len(rows) == 21 and len(set(rows)) > 15


# ---- what is refused


@pytest.mark.tier2
@pytest.mark.parametrize(
    ("name", "options", "sentence"),
    [
        ("a.avi", {}, "expected a file name that ends in .gif or .mp4"),
        ("a.gif", {"speed": 0.0}, "expected a number above 0, found 0.0"),
        ("a.gif", {"fps": 60.0}, "expected 1 to 50 for .gif, found 60.0"),
        ("a.mp4", {"speed": 1e-3}, "the most is 5000; use a higher speed"),
    ],
)
def test_a_film_that_cannot_be_is_refused_and_leaves_nothing(page, tmp_path, name, options, sentence):
    with pytest.raises(InputError, match=sentence):
        rendering.render_video(page, tmp_path / name, size=SMALL, **options)
    assert not list(tmp_path.iterdir())


def test_without_a_browser_the_command_says_so_before_it_simulates(no_browser, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(command, "compute_or_load", lambda arguments: pytest.fail("it was simulated"))
    parser = command.argparse.ArgumentParser()
    command.add_arguments(parser)
    with pytest.raises(InputError, match=r"none of chromium.* is on the PATH; install one") as caught:
        command.run(parser.parse_args(["planar_2r_swing", "--gif", "a.gif"]))
    assert "\n" not in str(caught.value) and not list(tmp_path.iterdir())


@pytest.mark.tier2
def test_without_playwright_it_says_what_to_install(page, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "playwright", None)
    with pytest.raises(InputError, match=r"pip install 'bellcrank\[film\]'"):
        rendering.render_still(page, tmp_path / "a.png")
    assert not list(tmp_path.iterdir())


@pytest.mark.tier2
def test_without_an_encoder_it_says_so_and_one_that_fails_tells_why(page, monkeypatch, tmp_path):
    monkeypatch.setattr(rendering.shutil, "which", lambda name: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(InputError, match=r"ffmpeg, which is not on the PATH; .* write a \.gif"):
        rendering.render_video(page, tmp_path / "a.mp4")
    failing = tmp_path / "ffmpeg"
    failing.write_text("#!/bin/sh\necho no such codec >&2\nexit 3\n")
    failing.chmod(0o755)
    with pytest.raises(BellcrankError, match="could not encode it: no such codec"):
        rendering._write_mp4(iter([b"x" * 10] * 3), tmp_path / "a.mp4", 30, str(failing))


@pytest.mark.tier2
def test_a_film_that_is_interrupted_leaves_nothing_and_stops_the_encoder(page, tmp_path):
    def stop(done, of):
        if done == 3:
            raise KeyboardInterrupt

    for name in ("a.gif", "a.mp4"):
        with pytest.raises(KeyboardInterrupt):
            rendering.render_video(page, tmp_path / name, size=SMALL, progress=stop)
    assert not list(tmp_path.iterdir())


@pytest.mark.tier2
def test_a_page_that_does_not_draw_is_told_of(page, tmp_path, monkeypatch):
    monkeypatch.setattr(rendering, "TIMEOUT", 500)
    (tmp_path / "blank.html").write_text("<p>nothing</p>")
    with pytest.raises(BellcrankError, match=r"blank.html: the browser .* could not draw it: .*Timeout 500ms"):
        rendering.render_still(tmp_path / "blank.html", tmp_path / "a.png")
    assert [path.name for path in tmp_path.iterdir()] == ["blank.html"]
