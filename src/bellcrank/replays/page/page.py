"""A film as one HTML page that needs nothing else: no server, no network, no other file."""

from __future__ import annotations

import base64
import functools
import hashlib
import html
import importlib.util
import json
import re
from pathlib import Path

from bellcrank.errors import BellcrankError
from bellcrank.files.atomic_write import write_text
from bellcrank.replays.film.film import Film
from bellcrank.replays.page.block import compressed
from bellcrank.replays.page.pack import pack
from bellcrank.text import readable
from bellcrank.version import version

_PLACE = re.compile(r"\{\{(\w+)\}\}")
ASSETS = Path(__file__).with_name("assets")
SCRIPTS = (
    "block.js", "text.js", "lines.js", "solids.js", "arrows.js", "movers.js", "follower.js", "view.js", "player.js",
    "scales.js", "charts.js", "planes.js", "main.js", "report.js",
)  # fmt: skip


def page(film: Film, *, plots: bool = True, around: tuple[str, str] = ("", "")) -> str:
    """The HTML text of a page that plays a film, with its plots beside the 3-D view unless `plots` is false.

    `around` is HTML to stand before and after it, whose author has escaped it; such a page scrolls, and prints.
    The page carries a content security policy under which nothing runs but the scripts written here, and nothing is
    fetched. `#t=3.2` after its address opens it at 3.2 s, `#still=1` without header, player and plots, `#play=1`
    playing; scripts drive it through `window.bellcrank` (see `assets/main.js`). Raises InputError where the film
    contradicts itself, and BellcrankError where meshcat's viewer is not installed.
    """
    film_json, block = pack(film, plots=plots)
    library, hashes = _library(plots)
    loader = _asset("loader.js")
    scripts = " ".join(f"'sha256-{each}'" for each in (*hashes, _hash(loader)))
    policy = (
        f"default-src 'none'; script-src {scripts}; style-src 'unsafe-inline'; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'"
    )
    parts = {
        "policy": policy,
        "version": version(),
        "title": html.escape(readable(film.title)),
        "style": _asset("uplot/uPlot.min.css") + _asset("page.css") + (_asset("report.css") if any(around) else ""),
        "film": film_json,
        "block": block,
        "library": library,
        "script": loader,
        "kind": "report" if any(around) else "",
        "before": around[0],
        "after": around[1],
    }
    # in one pass, so that what is filled in is never searched for names
    return _PLACE.sub(lambda found: parts[found[1]], _asset("page.html"))


def write_page(film: Film, path: str | Path, *, plots: bool = True, around: tuple[str, str] = ("", "")) -> Path:
    """Write the page of a film to `path`, .html added where it is missing, whole or not at all, and return the path.

    Raises what `page` raises, and InputError where the file cannot be written.
    """
    target = Path(path)
    if target.suffix.lower() not in (".html", ".htm"):
        target = target.with_name(target.name + ".html")
    write_text(target, page(film, plots=plots, around=around))
    return target


@functools.cache
def _library(plots: bool) -> tuple[str, tuple[str, ...]]:
    """All scripts but the loader, and the licences, as one deflated text; and the scripts' hashes for the policy.

    The page adds the scripts to itself as they are here, so that a hash allows each; deflated they take a third.
    """
    viewer = _meshcat()
    licences = [
        ("meshcat", (viewer / "LICENSE").read_text("utf-8")),
        *((name, text) for name, text in _third_parties(viewer)),
    ]
    scripts = [(viewer / "dist" / "main.min.js").read_text("utf-8")]
    if plots:
        scripts.append(_asset("uplot/uPlot.iife.min.js"))
        licences.append(("uPlot 1.6.32", _asset("uplot/LICENSE")))
    scripts.append('"use strict";(() => {' + "".join(_asset(name) for name in SCRIPTS) + "})();")
    told = "\n\n".join(f"==== {name}\n\n{text.strip()}" for name, text in licences)
    content = json.dumps({"scripts": scripts, "licences": told})
    return compressed(content.encode("utf-8")), tuple(_hash(script) for script in scripts)


def _meshcat() -> Path:
    """The folder of meshcat's viewer, found without importing the server that comes with it."""
    found = importlib.util.find_spec("meshcat")
    for place in (found.submodule_search_locations or ()) if found else ():
        viewer = Path(place) / "viewer"
        if (viewer / "dist" / "main.min.js").is_file():
            return viewer
    raise BellcrankError(
        "the replay page shows the robot with meshcat's viewer, which is not installed; install it with "
        "`pip install meshcat`"
    )


def _third_parties(viewer: Path) -> list[tuple[str, str]]:
    """What meshcat's viewer contains of others: names with versions, and the texts of their licences."""
    listed = json.loads((viewer / "dist" / "main.min.js.THIRD_PARTY_LICENSES.json").read_text("utf-8"))
    notices = (viewer / "dist" / "main.min.js.LICENSE.txt").read_text("utf-8")
    told = ("name", "version", "license", "author", "repository")
    texts = [(", ".join(each[key] for key in told), each.get("licenseText") or "") for each in listed]
    return [*texts, ("notices in meshcat's viewer", notices)]


@functools.cache
def _asset(name: str) -> str:
    return (ASSETS / name).read_text("utf-8")


def _hash(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
