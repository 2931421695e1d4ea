"""A film as one HTML page that needs no server, no network and no other file."""

from __future__ import annotations

import base64
import functools
import hashlib
import html
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from bellcrank.files.atomic_write import write_text
from bellcrank.messages import readable
from bellcrank.replays.film.film import Film
from bellcrank.replays.page.film_encoding import deflate_base64, encode_film
from bellcrank.version import version

ASSETS = Path(__file__).with_name("assets")
SCRIPTS = (  # in the order in which they stand in the page
    "decode.js", "formatting.js", "lines.js", "geometries.js", "arrows.js", "animation.js", "camera_follow.js",
    "view.js", "player.js", "chart_scales.js", "charts.js", "xy_plots.js", "main.js", "report.js",
)  # fmt: skip
_STATE = ("live_state.js", "live_text.js", "live_panel.js")
LIVE_SCRIPTS = {  # of pages that compute
    "": (),
    "sizing": (
        *_STATE,
        "live_loops.js",
        "live_functions.js",
        "live_motion.js",
        "live_verdict.js",
        "live_drag.js",
        "live_posture.js",
        "live_sizing.js",
        "live_page.js",
    ),
    "run": (*_STATE, "live_worker.js", "live_run.js", "live_run_film.js", "live_page.js"),
}
LIVE_POLICY = " 'wasm-unsafe-eval'"  # WebAssembly may be compiled; no text becomes a script
WORKER_POLICY = "worker-src blob:; "  # a script of the page may run beside it
_PLACEHOLDER = re.compile(r"\{\{(\w+)\}\}")


@dataclass(frozen=True, kw_only=True)
class Surroundings:
    """What stands around the replay; a page that has any scrolls and can be printed.

    Attributes:
        before: HTML before the replay, already escaped.
        after: HTML after it, already escaped.
        style: CSS after that of the page.
        scripts: Scripts after those of the page, in a scope of their own within that of the page.
    """

    before: str = ""
    after: str = ""
    style: str = ""
    scripts: tuple[str, ...] = ()


NOTHING = Surroundings()


def page_html(film: Film, *, plots: bool = True, around: Surroundings = NOTHING) -> str:
    """The HTML text of a page that plays a film.

    The page has a content security policy: no scripts run but those written here, and nothing is fetched. `#t=3.2`
    after its address opens it at 3.2 s, `#still=1` without header, player and plots, `#play=1` playing. Scripts control
    it through `window.bellcrank` (see `assets/main.js`).

    Args:
        film: What the page shows.
        plots: Whether plots stand beside the 3-D view.
        around: What stands before and after the replay.

    Raises:
        InputError: The parts of the film do not fit together, or are not finite.
    """
    film_json, arrays = encode_film(film, plots=plots)
    live = film.live if plots else None
    kind = "" if live is None else live.content["kind"]
    library, hashes = _library(plots, kind, around.scripts)
    report = bool(around.before or around.after)
    loader = _asset("loader.js")
    scripts = " ".join(f"'sha256-{each}'" for each in (*hashes, _hash(loader)))
    policy = (
        f"default-src 'none'; script-src {scripts}{LIVE_POLICY if live else ''}; style-src 'unsafe-inline'; "
        f"img-src data: blob:; {WORKER_POLICY if kind == 'run' else ''}base-uri 'none'; form-action 'none'"
    )
    parts = {
        "policy": policy,
        "version": version(),
        "title": html.escape(readable(film.title)),
        "style": _asset("uplot/uPlot.min.css")
        + _asset("page.css")
        + (_asset("report.css") if report else "")
        + (_asset("live.css") if live else "")
        + around.style,
        "film": film_json,
        "arrays": arrays,
        "library": library,
        "live": "" if live is None else deflate_base64(b"".join((*live.blocks, *_engine(kind)))),
        "script": loader,
        "kind": "report" if report else "",
        "before": around.before,
        "after": around.after,
    }
    # in one pass, so that inserted text is never searched for placeholders
    return _PLACEHOLDER.sub(lambda found: parts[found[1]], _asset("page.html"))


def write_page(film: Film, path: str | Path, *, plots: bool = True, around: Surroundings = NOTHING) -> Path:
    """Write the page of a film, completely or not at all.

    Args:
        film: What the page shows.
        path: The file; .html is added if it has another suffix.
        plots: Whether plots stand beside the 3-D view.
        around: What stands before and after the replay, as in `page_html`.

    Returns:
        The path of the file.

    Raises:
        InputError: The film is invalid, as in `page_html`, or the file cannot be written.
    """
    target = Path(path)
    if target.suffix.lower() not in (".html", ".htm"):
        target = target.with_name(target.name + ".html")
    write_text(target, page_html(film, plots=plots, around=around))
    return target


@functools.cache
def _library(plots: bool, live: str, more: tuple[str, ...]) -> tuple[str, tuple[str, ...]]:
    """All scripts but the loader, and their licences, as one deflated text; and the scripts' hashes for the policy.

    The page adds the scripts to itself unchanged, so that the hashes allow them; deflated they are a third as large.
    """
    scripts = [_asset("meshcat/main.min.js")]
    licences = list(_meshcat_licences())
    if plots:
        scripts.append(_asset("uplot/uPlot.iife.min.js"))
        licences.append(("uPlot 1.6.32", _asset("uplot/LICENSE")))
    scripts.append(
        '"use strict";(() => {'
        + "".join((*map(_asset, (*SCRIPTS[:-2], *LIVE_SCRIPTS[live], *SCRIPTS[-2:])), "{\n", *more, "}\n"))
        + "})();"
    )
    text = "\n\n".join(f"==== {name}\n\n{licence.strip()}" for name, licence in licences)
    content = json.dumps({"scripts": scripts, "licences": text})
    return deflate_base64(content.encode("utf-8")), tuple(_hash(script) for script in scripts)


def _meshcat_licences() -> Iterator[tuple[str, str]]:
    """The licences of meshcat's viewer and of the libraries that its script contains, with their names."""
    yield "meshcat 0.3.2 (its viewer)", _asset("meshcat/LICENSE")
    for library in json.loads(_asset("meshcat/main.min.js.THIRD_PARTY_LICENSES.json")):
        title = ", ".join(library[key] for key in ("name", "version", "license", "author", "repository"))
        yield title, library.get("licenseText") or _asset(f"meshcat/{library['name']}.LICENSE.txt")
    yield "notices in meshcat's viewer", _asset("meshcat/main.min.js.LICENSE.txt")


def _engine(kind: str) -> tuple[bytes, ...]:
    """The integrator, for the page of a run (docs/tools/page_engine.py)."""
    return ((ASSETS / "page_engine.wasm").read_bytes(),) if kind == "run" else ()


@functools.cache
def _asset(name: str) -> str:
    return (ASSETS / name).read_text("utf-8")


def _hash(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
