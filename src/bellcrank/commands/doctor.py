"""`bellcrank doctor`: versions, processor, cache, browser and extras of this installation, and what is wrong."""

from __future__ import annotations

import argparse
import shutil
import textwrap
import warnings
from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bellcrank.commands.installation import InstallationFinding

_MARKS = {"ok": " ", "missing": "-", "fault": "!"}
_SUBJECT = 12


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """No arguments."""


def run(arguments: argparse.Namespace) -> int:
    """Print what was found. Exit code 0 where bellcrank works, 1 where it does not."""
    from bellcrank.commands.installation import findings

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
