"""`bellcrank doctor`: versions, processor, cache, browser and extras of this installation, and what is wrong."""

from __future__ import annotations

import argparse
import importlib
import importlib.metadata
import os
import platform
import re
import shutil
import sys
import textwrap
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from bellcrank.errors import BellcrankError
from bellcrank.version import version

PURPOSES = {
    "film": "stills, PNG and MP4 of a replay",
    "cluster": "`sweep --workers` and `--scheduler`",
    "parquet": "`sweep` into Parquet files",
    "xacro": "robots as .xacro files",
    "peers": "`bench --peers`",
    "docs": "the pages of the documentation",
    "test": "the tests",
}
_EXTENSIONS = ("_step", "_codegen", "_planner")
_NAME = re.compile(r"[A-Za-z0-9._-]+")
_EXTRA = re.compile(r"""extra\s*==\s*['"]([\w-]+)['"]""")

State = Literal["ok", "missing", "fault"]
_MARKS = {"ok": " ", "missing": "-", "fault": "!"}
_SUBJECT = 12


@dataclass(frozen=True)
class InstallationFinding:
    """One fact about the installation.

    Attributes:
        subject: What was looked at.
        text: What there is.
        state: "fault" keeps bellcrank from working, "missing" keeps one feature from working or slows it.
        remedy: What to do about it; empty where the state is "ok".
    """

    subject: str
    text: str
    state: State = "ok"
    remedy: str = ""


def findings() -> Iterator[InstallationFinding]:
    """Every fact, in the order in which one thing needs the other."""
    yield _guarded("bellcrank", _bellcrank)
    yield InstallationFinding("Python", f"{platform.python_version()}, {sys.executable}")
    yield from _packages()
    casadi = _guarded("casadi", _casadi)
    yield casadi
    yield _guarded("extensions", _extensions)
    yield _guarded("processor", _processor)
    if casadi.state == "fault":
        yield InstallationFinding("compiling", "is not tried, since it needs casadi", "fault", "mend casadi first")
    else:
        yield _guarded("compiling", _compiling)
    yield _guarded("cache", _cache)
    yield _guarded("browser", _browser)
    yield _guarded("ffmpeg", _ffmpeg)
    yield from _extras()


def _guarded(subject: str, look: Callable[[], InstallationFinding]) -> InstallationFinding:
    """The finding, or the fault that looking for it ran into."""
    try:
        return look()
    except BellcrankError as error:
        return InstallationFinding(subject, str(error), "fault", "see the message")
    except Exception as error:  # whatever is broken here must not hide the findings after it
        return InstallationFinding(subject, f"{type(error).__name__}: {error}", "fault", "reinstall bellcrank")


def _bellcrank() -> InstallationFinding:
    return InstallationFinding("bellcrank", f"{version()}, {Path(__file__).parents[1]}")


def _requirements() -> list[tuple[str, str, str]]:
    """Each requirement of bellcrank: the package, the requirement, and the extra that it belongs to ("" if none)."""
    found = []
    for line in importlib.metadata.requires("bellcrank") or ():
        requirement, _, marker = line.partition(";")
        name, extra = _NAME.match(requirement), _EXTRA.search(marker)
        if name:
            found.append((name.group(), requirement.strip(), extra.group(1) if extra else ""))
    return found


def _installed(name: str) -> str | None:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def _fits(requirement: str, installed: str) -> bool:
    """Whether an installed version is within the range of a requirement."""
    try:
        from packaging.requirements import Requirement
    except ImportError:
        return True  # the range cannot be checked; the exact pin of casadi is checked by itself
    return Requirement(requirement).specifier.contains(installed, prereleases=True)


def _packages() -> Iterator[InstallationFinding]:
    """The packages that every installation needs."""
    fine: list[str] = []
    for name, requirement, extra in _requirements():
        if extra or name == "casadi":
            continue
        there = _installed(name)
        if there is None:
            state: State = "missing" if name == "example-robot-data" else "fault"  # only its robots need that one
            yield InstallationFinding(name, "is not installed", state, f"pip install '{requirement}'")
        elif not _fits(requirement, there):
            yield InstallationFinding(
                name, f"{there}; expected: {requirement}", "fault", f"pip install '{requirement}'"
            )
        else:
            fine.append(f"{name} {there}")
    yield InstallationFinding("packages", ", ".join(fine))


def _casadi() -> InstallationFinding:
    from bellcrank._codegen import CASADI_VERSION
    from bellcrank.codegen.tracer import check_casadi, extension

    try:
        check_casadi()
    except BellcrankError as error:
        return InstallationFinding(
            "casadi", str(error).partition(": ")[0], "fault", f"pip install casadi=={CASADI_VERSION}"
        )
    try:
        extension()
    except BellcrankError as error:
        remedy = (
            f"pip install --force-reinstall casadi=={CASADI_VERSION}, and reinstall bellcrank if that is not enough"
        )
        return InstallationFinding("casadi", str(error).rpartition(": ")[0], "fault", remedy)
    return InstallationFinding("casadi", f"{CASADI_VERSION}, the version that the tracer was built with")


def _extensions() -> InstallationFinding:
    for name in _EXTENSIONS:
        importlib.import_module(f"bellcrank.{name}")
    return InstallationFinding("extensions", ", ".join((*_EXTENSIONS, "_trace")) + " load")


def _processor() -> InstallationFinding:
    from bellcrank.codegen.llvm import processor, target

    chosen = target()
    text = f"{processor()}; code for {chosen.cpu}, {chosen.lanes} numbers at a time; {os.cpu_count()} cores"
    if platform.machine() != "x86_64":
        return InstallationFinding("processor", text, "missing", "only x86-64 is tested")
    return InstallationFinding("processor", text)


def _compiling() -> InstallationFinding:
    """A small function is compiled, or taken from the cache, and called."""
    import numpy as np

    from bellcrank.robot.load import load_robot

    robot = load_robot("planar_2r")
    torque = robot.inverse_dynamics(np.zeros(robot.nq), np.zeros(robot.nv), np.ones(robot.nv))
    if not np.isfinite(torque).all():
        return InstallationFinding(
            "compiling", f"torques of planar_2r: {torque}", "fault", "report this with the lines above"
        )
    return InstallationFinding("compiling", "the inverse dynamics of planar_2r was traced, compiled and called")


def _cache() -> InstallationFinding:
    from bellcrank.codegen.cache import secret
    from bellcrank.codegen.cache_folder import folder, limit, why_unused

    if os.environ.get("BELLCRANK_CACHE", "").lower() == "off":
        return InstallationFinding("cache", "off, by BELLCRANK_CACHE: every process compiles anew")
    if why := why_unused():
        remedy = "let BELLCRANK_CACHE name a folder that you can write to"
        return InstallationFinding(
            "cache", f"is not used, so that every process compiles anew: {why}", "missing", remedy
        )
    place = folder()
    if place is None or secret() is None:
        remedy = "let XDG_STATE_HOME name a folder that you can write to"
        return InstallationFinding(
            "cache", "is not used: the secret that protects its entries cannot be kept", "missing", remedy
        )
    used = sum(file.stat().st_blocks * 512 for file in place.iterdir() if file.is_file())
    return InstallationFinding("cache", f"{place}, {used / 1e6:.0f} of at most {limit() / 1e6:.0f} MB")


def _browser() -> InstallationFinding:
    from bellcrank.replays.page.rendering import BROWSERS, find_browser

    try:
        return InstallationFinding("browser", find_browser())
    except BellcrankError:
        text = f"none of {', '.join(BROWSERS)} is on the PATH; pages are written, stills and films are not"
        return InstallationFinding("browser", text, "missing", "install one (on Debian: apt-get install chromium)")


def _ffmpeg() -> InstallationFinding:
    from bellcrank.replays.page.rendering import find_encoder

    try:
        return InstallationFinding("ffmpeg", find_encoder())
    except BellcrankError:
        remedy = "install it (on Debian: apt-get install ffmpeg), or pip install 'bellcrank[film]'"
        return InstallationFinding("ffmpeg", "is not on the PATH; films as MP4 need it", "missing", remedy)


def _extras() -> Iterator[InstallationFinding]:
    """Which extras are whole. An extra that is not there is no fault: nobody asked for it."""
    missing: dict[str, list[str]] = {}
    for name, requirement, extra in _requirements():
        if extra:
            there = _installed(name)
            missing.setdefault(extra, [])
            if there is None or not _fits(requirement, there):
                missing[extra].append(name)
    for extra, names in missing.items():
        purpose = PURPOSES.get(extra, "")
        state = "installed" if not names else f"not installed ({', '.join(names)})"
        yield InstallationFinding(f"[{extra}]", f"{state}; for {purpose}" if purpose else state)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """No arguments."""


def run(arguments: argparse.Namespace) -> int:
    """Print what was found. Exit code 0 where bellcrank works, 1 where it does not."""

    width = max(60, min(shutil.get_terminal_size().columns, 120))
    faults: list[InstallationFinding] = []
    missing: list[InstallationFinding] = []
    for finding in _without_warnings(findings()):
        start = f"{_MARKS[finding.state]} {finding.subject:{_SUBJECT}} "
        indent = " " * len(start) if len(start) <= _SUBJECT + 3 else " " * (_SUBJECT + 3)
        wrapped = textwrap.TextWrapper(
            width, initial_indent=start, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
        )
        print(wrapped.fill(finding.text), flush=True)
        (faults if finding.state == "fault" else missing if finding.state == "missing" else []).append(finding)
    print()
    for finding in faults:
        print(f"! {finding.subject}: {finding.remedy}")
    for finding in missing:
        print(f"- {finding.subject}: {finding.remedy}")
    verdict = "works, but for what is marked -" if missing else "works"
    print(f"bellcrank does not work: {len(faults)} fault(s)" if faults else f"bellcrank {verdict}")
    return 1 if faults else 0


def _without_warnings(found: Iterator[InstallationFinding]) -> Iterator[InstallationFinding]:
    """The findings; what libraries warn of while they are looked for is among them."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield from found
