"""`bellcrank doctor`: versions, processor, cache, browser and extras of this installation, and what is wrong."""

from __future__ import annotations

import argparse
import shutil
import textwrap

_MARKS = {"ok": " ", "missing": "-", "fault": "!"}
_SUBJECT = 12


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """No arguments."""


def run(arguments: argparse.Namespace) -> int:
    """Print what was found. Exit code 0 where bellcrank works, 1 where it does not."""
    from bellcrank.commands.installation import Finding, findings

    width = max(60, min(shutil.get_terminal_size().columns, 120))
    faults: list[Finding] = []
    missing: list[Finding] = []
    for finding in findings():
        start = f"{_MARKS[finding.state]} {finding.subject:{_SUBJECT}} "
        indent = " " * len(start) if len(start) <= _SUBJECT + 3 else " " * (_SUBJECT + 3)
        print(textwrap.fill(finding.text, width, initial_indent=start, subsequent_indent=indent), flush=True)
        (faults if finding.state == "fault" else missing if finding.state == "missing" else []).append(finding)
    print()
    for finding in faults:
        print(f"! {finding.subject}: {finding.remedy}")
    for finding in missing:
        print(f"- {finding.subject}: {finding.remedy}")
    verdict = "works, but for what is marked -" if missing else "works"
    print(f"bellcrank does not work: {len(faults)} fault(s)" if faults else f"bellcrank {verdict}")
    return 1 if faults else 0
