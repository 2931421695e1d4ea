"""A headless browser for stills and videos of a page: Chromium or a relative of it, controlled by Playwright."""

from __future__ import annotations

import logging
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from bellcrank.errors import BellcrankError, InputError

if TYPE_CHECKING:
    from playwright.sync_api import Page

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "microsoft-edge")
TIMEOUT = 60_000  # ms until a page must be drawn


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
