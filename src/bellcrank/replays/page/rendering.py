"""Stills and videos of a replay page (PNG, GIF, MP4), rendered by a headless browser."""

from __future__ import annotations

import base64
import io
import logging
import math
import os
import shutil
import subprocess
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arguments import Progress
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.atomic_write import writing

if TYPE_CHECKING:
    from PIL.Image import Image
    from playwright.sync_api import Page


BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "microsoft-edge")
TIMEOUT = 60_000  # ms until a page must be drawn
SIZE = (960, 720)  # pixels
MOST_FRAMES = 5_000
DEFAULT_FPS = {".gif": 15.0, ".mp4": 30.0}
MOST_FPS = {".gif": 50.0, ".mp4": 60.0}  # viewers slow down faster GIFs


def find_browser() -> str:
    """The path of a browser that can run headless. Raises InputError with what to install."""
    for name in BROWSERS:
        if path := shutil.which(name):
            return path
    raise InputError(
        f"stills and films are rendered by a browser, and none of {', '.join(BROWSERS)} is on the PATH; install one "
        "(on Debian: apt-get install chromium), or write the HTML page, which needs no browser here"
    )


def find_playwright() -> ModuleType:
    """Playwright's synchronous module. Raises InputError with what to install."""
    try:
        from playwright import sync_api
    except ImportError:
        raise InputError(
            "stills and films need the package playwright; install it with: pip install 'bellcrank[film]'"
        ) from None
    return sync_api


@contextmanager
def open_page(page: str | Path, size: tuple[int, int]) -> Iterator[Page]:
    """A page's file, open and drawn in a headless window of (width, height) pixels without network.

    Raises InputError if there is no browser or no Playwright, and BellcrankError if the page is not drawn.
    """
    browser, playwright_module = find_browser(), find_playwright()
    flags = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars", "--disable-gpu-sandbox"]
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        flags.append("--no-sandbox")  # Chromium refuses to start for root otherwise
    try:
        with playwright_module.sync_playwright() as playwright:
            chromium = playwright.chromium.launch(executable_path=browser, args=flags)
            try:
                context = chromium.new_context(viewport={"width": size[0], "height": size[1]}, offline=True)
                tab = context.new_page()
                tab.goto(Path(page).resolve().as_uri() + "#still=1", timeout=TIMEOUT)
                tab.wait_for_function("window.bellcrank && window.bellcrank.ready", timeout=TIMEOUT)
                tab.evaluate("() => window.bellcrank.ready")
                yield tab
            finally:
                chromium.close()
    except KeyboardInterrupt:  # it also ends Playwright's process, whose last answers are not awaited
        logging.getLogger("asyncio").addFilter(lambda record: "never retrieved" not in record.getMessage())
        raise
    except playwright_module.Error as error:
        first = str(error).strip().splitlines()[0]
        raise BellcrankError(f"{page}: the browser {browser} could not draw it: {first}") from None


def check_rendering_tools(kinds: Iterable[str]) -> None:
    """Raise InputError, with what to install, if a tool is missing that files of these kinds need, such as "mp4"."""
    find_browser()
    find_playwright()
    if "mp4" in kinds:
        find_encoder()


def render_still(page: str | Path, out: str | Path, time: float | None = None, size: tuple[int, int] = SIZE) -> Path:
    """Write the 3-D view of a page as PNG.

    Args:
        page: The file of a replay page.
        out: The file to write.
        time: The time to show, s; default: the end.
        size: Width and height in pixels.

    Returns:
        The path of the PNG.

    Raises:
        InputError: There is no browser, the time is outside the replay, or the file cannot be written.
        BellcrankError: The browser could not draw the page.

    Example:
        `render_still(bc.replay(run), "still.png", time=2.5)` renders the state of a run at 2.5 s.
    """
    with writing(out) as temporary, open_page(page, size) as tab:
        start, end = _span(tab)
        if time is not None and not start <= time <= end:
            raise InputError(f"a still at {time:g} s: expected a time from {start:g} s to {end:g} s, the replay's")
        temporary.write_bytes(_capture(tab, end if time is None else time))
    return Path(out)


def render_video(
    page: str | Path,
    out: str | Path,
    speed: float = 1.0,
    fps: float | None = None,
    size: tuple[int, int] = SIZE,
    progress: Progress = lambda done, of: None,
) -> Path:
    """Write a whole replay as GIF or MP4.

    Args:
        page: The file of a replay page.
        out: The file to write; its suffix is .gif or .mp4.
        speed: Playback speed relative to real time.
        fps: Frames per second; default: 15 for GIF, 30 for MP4.
        size: Width and height in pixels; odd numbers are rounded down to even ones.
        progress: Called with the number of finished frames and of all frames.

    Returns:
        The path of the file.

    Raises:
        InputError: Another suffix, too many frames, or a browser or encoder that is not installed.
        BellcrankError: The browser could not draw the page, or the encoder failed.

    Example:
        `render_video(bc.replay(run), "run.gif", speed=0.5)` renders a run at half its speed.
    """
    kind = Path(out).suffix.lower()
    if kind not in DEFAULT_FPS:
        raise InputError(f"{out}: expected a file name that ends in {' or '.join(DEFAULT_FPS)}")
    if not (math.isfinite(speed) and speed > 0.0):
        raise InputError(f"speed of a film: expected a number above 0, found {speed!r}")
    fps = DEFAULT_FPS[kind] if fps is None else fps
    if not 1.0 <= fps <= MOST_FPS[kind]:
        raise InputError(f"frames per second of a film: expected 1 to {MOST_FPS[kind]:g} for {kind}, found {fps!r}")
    encoder = None if kind == ".gif" else find_encoder()
    width, height = (2 * (length // 2) for length in size)  # the codec requires even numbers
    with writing(out) as temporary, open_page(page, (width, height)) as tab:
        start, end = _span(tab)
        count = _frame_count(out, end - start, speed, fps)
        frames = _frames(tab, np.linspace(start, end, count).tolist(), progress)
        if encoder is None:
            _write_gif(frames, temporary, fps, _palette(tab, start, end))
        else:
            _write_mp4(frames, temporary, fps, encoder)
    return Path(out)


def _frame_count(out: str | Path, duration: float, speed: float, fps: float) -> int:
    """The number of frames of a film, including both ends. Raises InputError for too many."""
    wanted = duration / speed * fps
    if not wanted <= MOST_FRAMES - 1:
        raise InputError(
            f"{out}: {duration:g} s at {fps:g} frames per second and speed {speed:g} are {wanted:.6g} frames, the most "
            f"is {MOST_FRAMES}; use a higher speed or fewer frames per second"
        )
    return max(1, math.ceil(wanted)) + 1


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


def _capture(tab: Page, time: float) -> bytes:
    url = tab.evaluate("(t) => { window.bellcrank.seek(t); return window.bellcrank.capture(); }", time)
    return base64.b64decode(url.partition(",")[2])


def _span(tab: Page) -> tuple[float, float]:
    start, end = tab.evaluate("() => [window.bellcrank.start, window.bellcrank.end]")
    return float(start), float(end)


def _frames(tab: Page, times: list[float], progress: Progress) -> Iterator[bytes]:
    for k, time in enumerate(times):
        yield _capture(tab, time)
        progress(k + 1, len(times))


def _palette(tab: Page, start: float, end: float) -> Image:
    """Colours common to all frames, from five of them, so that each frame stores only what has changed."""
    from PIL import Image

    pictures = [_picture(_capture(tab, time)) for time in np.linspace(start, end, 5).tolist()]
    width, height = pictures[0].size
    sheet = Image.new("RGB", (width, height * len(pictures)))
    for k, picture in enumerate(pictures):
        sheet.paste(picture, (0, k * height))
    return sheet.quantize(256)


def _picture(png: bytes) -> Image:
    from PIL import Image

    return Image.open(io.BytesIO(png)).convert("RGB")


def _write_gif(frames: Iterator[bytes], path: Path, fps: float, palette: Image) -> None:
    """Write a GIF frame by frame, so that memory does not grow with its length; it repeats forever."""
    from PIL import Image, ImageChops
    from PIL.GifImagePlugin import getdata, getheader

    with path.open("wb") as file:
        before = None
        for k, frame in enumerate(frames):
            picture = _picture(frame).quantize(palette=palette, dither=Image.Dither.NONE)
            box = (0, 0, *picture.size)
            if before is None:
                file.write(b"".join(getheader(picture, info={"loop": 0})[0]))
            else:
                box = ImageChops.difference(before.convert("RGB"), picture.convert("RGB")).getbbox() or (0, 0, 1, 1)
            lasts = 10 * (
                round(100.0 * (k + 1) / fps) - round(100.0 * k / fps)
            )  # ms; a GIF counts hundredths of a second
            file.write(b"".join(getdata(picture.crop(box), box[:2], duration=lasts, disposal=1)))
            before = picture
        file.write(b";")


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
            process.stdin.close()
        except BrokenPipeError:
            pass  # its own message is reported below
        except BaseException:
            process.kill()
            raise
        said = process.stderr.read().decode(errors="replace").strip()
    if process.returncode:
        raise BellcrankError(
            f"{path.name}: {encoder} could not encode it: {(said or 'no reason given').splitlines()[-1]}"
        )
