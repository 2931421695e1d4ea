"""A real browser for tests: headless Chromium, its network cut off, that notes every error and request of a page."""

import os
import shutil
from contextlib import contextmanager

import pytest
from playwright.sync_api import sync_playwright

# Drawn by the processor, so that it is the same everywhere.
FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-gpu-sandbox", "--hide-scrollbars"]


class Opened:
    """A page that was opened from its file; `errors` of its console and `requests` for anything else, so far."""

    def __init__(self, context, path, fragment, script):
        self.errors, self.requests = [], []
        self.tab = context.new_page()
        self.tab.on("console", lambda message: self._heard(message.type, message.text))
        self.tab.on("pageerror", lambda error: self.errors.append(str(error)))
        address = path.resolve().as_uri()
        self.tab.on("request", lambda request: self._requested(request.url, address))
        if script:
            self.tab.add_init_script(script)
        self.tab.goto(address + fragment)

    def _heard(self, kind, text):
        if kind in ("error", "warning") and "ReadPixels" not in text:  # told of every picture that is read back
            self.errors.append(text)

    def _requested(self, url, address):
        if url.split("#")[0] != address and not url.startswith(("data:", "blob:")):
            self.requests.append(url)

    def do(self, script, argument=None):
        """What a script returns in the page, in which `b` is window.bellcrank."""
        return self.tab.evaluate(f"(x) => {{ const b = window.bellcrank; return ({script}); }}", argument)

    @property
    def clean(self):
        return not self.errors and not self.requests


@contextmanager
def launched(path):
    """A headless Chromium, from its path."""
    flags = [*FLAGS, "--no-sandbox"] if os.geteuid() == 0 else FLAGS  # Chromium refuses to start for root otherwise
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=flags)
        yield browser
        browser.close()


def open_in(browser, path, fragment="", size=(640, 480), script=None, wait=True, **options):
    """The page of a file in a context of its own, when it is ready; options are of Playwright's context."""
    context = browser.new_context(viewport={"width": size[0], "height": size[1]}, offline=True, **options)
    page = Opened(context, path, fragment, script)
    if wait:
        page.tab.evaluate("() => window.bellcrank.ready")
    return page


@pytest.fixture(scope="module")
def chromium():
    path = shutil.which("chromium")
    if path is None:
        give_up = pytest.fail if os.environ.get("CI") else pytest.skip
        give_up("these tests look at pages in a real browser; install it (on Debian: apt-get install chromium)")
    with launched(path) as browser:
        yield browser


@pytest.fixture(scope="module")
def open_page(chromium):
    """A function that opens a page's file, as `open_in`."""
    pages = []

    def opened(path, *args, **options):
        pages.append(open_in(chromium, path, *args, **options))
        return pages[-1]

    yield opened
    for page in pages:
        page.tab.context.close()
