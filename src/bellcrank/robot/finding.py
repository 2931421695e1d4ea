"""A finding about a URDF, and its text."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

Severity = Literal["error", "warning", "note"]
ORDER: tuple[Severity, ...] = ("error", "warning", "note")
SHOWN = 5  # names or files of one kind that are written out


@dataclass(frozen=True)
class Finding:
    """One finding about a URDF: its severity, the element it is about, and a sentence."""

    severity: Severity
    where: str
    message: str


def format_findings(findings: list[Finding]) -> str:
    """Findings as text for a terminal: one a line, then how many there are of each severity."""
    lines = [f"  {found.severity:<8} {found.where}: {found.message}" for found in findings]
    counts = [sum(found.severity == severity for found in findings) for severity in ORDER]
    summary = ", ".join(
        f"{count} {severity}{'' if count == 1 else 's'}" for count, severity in zip(counts, ORDER, strict=True) if count
    )
    return "\n".join([*lines, f"  {summary or 'nothing found'}"])


def listed(kind: str, names: list[str]) -> str:
    """Names, the first SHOWN of them: link 'a', or links 'a', 'b' and 3 more."""
    if len(names) == 1:
        return f"{kind} '{names[0]}'"
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return f"{kind}s " + ", ".join(f"'{name}'" for name in names[:SHOWN]) + more


def without_source(source: Path, message: str) -> str:
    """A message without the file's name at its beginning."""
    return message.removeprefix(f"{source}: ")
