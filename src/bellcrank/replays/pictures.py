"""Stills and films of a replay page: PNG, GIF and MP4, by a browser without a window."""

from __future__ import annotations

import base64
import io
import math
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.atomic import writing
from bellcrank.errors import BellcrankError, InputError
from bellcrank.replays.browser import opened

if TYPE_CHECKING:
    from playwright.sync_api import Page

SIZE = (960, 720)  # pixels
MOST_FRAMES = 5_000
FILMS = {".gif": 15.0, ".mp4": 30.0}  # frames a second, where nothing is said


def still(page: str | Path, out: str | Path, time: float | None = None, size: tuple[int, int] = SIZE) -> Path:
    """Write a PNG of a page's 3-D view at a time (s), the end where none is given; `size` in pixels.

    Raises InputError where there is no browser, or the file cannot be written.
    """
    with writing(out) as temporary, opened(page, size) as tab:
        temporary.write_bytes(_captured(tab, _span(tab)[1] if time is None else time))
    return Path(out)


def film(
    page: str | Path,
    out: str | Path,
    speed: float = 1.0,
    fps: float | None = None,
    size: tuple[int, int] = SIZE,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> Path:
    """Write the whole replay as .gif or .mp4, by the name's suffix, `speed` times as fast as it was.

    `progress` is called with the frames that are done, and their number. Raises InputError for another suffix, a film
    of too many frames, and where browser or encoder are missing.
    """
    kind = Path(out).suffix.lower()
    if kind not in FILMS:
        raise InputError(f"{out}: a film is written as {' or '.join(FILMS)}, not as '{kind or 'nothing'}'")
    if not (math.isfinite(speed) and speed > 0.0):
        raise InputError(f"speed of a film: expected a number above 0, found {speed!r}")
    fps = FILMS[kind] if fps is None else fps
    if not 1.0 <= fps <= 60.0:
        raise InputError(f"frames a second of a film: expected 1 to 60, found {fps!r}")
    encoder = None if kind == ".gif" else find_encoder()
    width, height = (2 * (length // 2) for length in size)  # the codec takes even numbers only
    with writing(out) as temporary, opened(page, (width, height)) as tab:
        start, end = _span(tab)
        duration = end - start
        count = max(1, math.ceil(duration / speed * fps)) + 1
        if count > MOST_FRAMES:
            raise InputError(
                f"{out}: {duration:g} s at {fps:g} frames a second and speed {speed:g} are {count} frames, the most is "
                f"{MOST_FRAMES}; film it faster"
            )
        frames = _frames(tab, np.linspace(start, end, count).tolist(), progress)
        if encoder is None:
            _write_gif(frames, temporary, fps)
        else:
            _write_mp4(frames, temporary, fps, encoder)
    return Path(out)


def find_encoder() -> str:
    """The path of ffmpeg. Raises InputError with what to install."""
    if path := shutil.which("ffmpeg"):
        return path
    try:
        import imageio_ffmpeg
    except ImportError:
        raise InputError(
            "an MP4 is encoded by ffmpeg, which is not on the PATH; install it, or pip install 'bellcrank[film]', or "
            "write a .gif"
        ) from None
    return str(imageio_ffmpeg.get_ffmpeg_exe())


def _captured(tab: Page, time: float) -> bytes:
    url = tab.evaluate("(t) => { window.bellcrank.seek(t); return window.bellcrank.capture(); }", time)
    return base64.b64decode(url.partition(",")[2])


def _span(tab: Page) -> tuple[float, float]:
    start, end = tab.evaluate("() => [window.bellcrank.start, window.bellcrank.end]")
    return float(start), float(end)


def _frames(tab: Page, times: list[float], progress: Callable[[int, int], None]) -> Iterator[bytes]:
    for k, time in enumerate(times):
        yield _captured(tab, time)
        progress(k + 1, len(times))


def _write_gif(frames: Iterator[bytes], path: Path, fps: float) -> None:
    from PIL import Image

    pictures = [Image.open(io.BytesIO(frame)).convert("P", palette=Image.Palette.ADAPTIVE) for frame in frames]
    pictures[0].save(path, format="GIF", save_all=True, append_images=pictures[1:], duration=1000.0 / fps, loop=0)


def _write_mp4(frames: Iterator[bytes], path: Path, fps: float, encoder: str) -> None:
    command = [
        encoder, "-y", "-loglevel", "error", "-f", "image2pipe", "-framerate", f"{fps:g}", "-i", "-", "-vf",
        "crop=trunc(iw/2)*2:trunc(ih/2)*2", "-c:v", "libx264", "-pix_fmt", "yuv420p", "-movflags", "+faststart",
        "-f", "mp4", str(path),
    ]  # fmt: skip
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None and process.stderr is not None
        try:
            for frame in frames:
                process.stdin.write(frame)
        except BrokenPipeError:
            pass  # what went wrong is in its own words below
        except BaseException:
            process.kill()
            raise
        process.stdin.close()
        said = process.stderr.read().decode(errors="replace").strip()
    if process.returncode:
        raise BellcrankError(
            f"{path.name}: {encoder} could not encode it: {(said or 'no reason given').splitlines()[-1]}"
        )
