"""Show in a tutorial, or a page on the theory, the HTML pages that its own blocks write: replays and reports.

A line `<!-- page: NAME.html CAPTION -->` of a tutorial shows the file NAME.html. The build runs the tutorial in an
empty folder and copies the file to TUTORIAL/NAME.html beside the tutorial's page.
"""

from __future__ import annotations

import functools
import html
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

PAGE = re.compile(r"^<!-- page: (?P<name>[\w/-]+\.html) (?P<caption>.+) -->$", re.MULTILINE)
PROCESSES = 2


def names(text: str) -> list[str]:
    """Names of the pages that the text of a tutorial shows."""
    return [found["name"] for found in PAGE.finditer(text)]


def written(tutorials: Iterable[Path]) -> dict[str, str]:
    """Run the tutorials that show pages; path in docs/ -> text of each page."""
    with ThreadPoolExecutor(PROCESSES) as pool:
        runs = pool.map(lambda path: _run(path, path.read_text(encoding="utf-8")), tutorials)
        return {path: text for pages in runs for path, text in pages.items()}


def shown(markdown: str, stem: str) -> str:
    """The text of the tutorial `stem` with frames in which its pages are shown."""

    def frame(found: re.Match[str]) -> str:
        page, caption = f"{stem}/{found['name']}", html.escape(found["caption"])
        return (
            f'<figure class="page"><iframe src="{page}" title="{caption}" loading="lazy"></iframe>'
            f'<figcaption>{caption} <a href="{page}" target="_blank">Open it on a page of its own.</a></figcaption>'
            "</figure>"
        )

    return PAGE.sub(frame, markdown)


@functools.cache
def _run(path: Path, text: str) -> dict[str, str]:
    """Run one tutorial up to the last page that it shows, unless its text has been run already (`mkdocs serve` builds
    again and again).
    """
    shows = list(PAGE.finditer(text))
    if not shows:
        return {}
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as beside:
        begun = Path(beside, path.name)
        begun.write_text(text[: shows[-1].end()], encoding="utf-8")
        program = Path(__file__).with_name("tutorial.py")
        done = subprocess.run([sys.executable, program, begun], cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"{path.name}: {done.stderr}")
        here = f"{path.parent.name}/{path.stem}"
        return {f"{here}/{name}": Path(folder, name).read_text(encoding="utf-8") for name in names(text)}
