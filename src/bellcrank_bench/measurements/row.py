"""The one record of a timed computation: who computed what, in which time, with which error."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Row:
    """One tool with one method and setting: its best time and its error.

    A computation that failed has infinite time and error and a text in `failure`: it is counted, never dropped.

    Attributes:
        subject: Name of the scene or robot.
        tool: The tool.
        method: Its integrator, or the algorithm that is computed.
        setting: Tolerance or step.
        seconds: Best time on the tool's own clock, s: of a run, or of a sample.
        error: Largest error: of a position, or relative to Pinocchio.
        evaluations: Number of evaluations of the equations, if the tool tells it.
        steps: Number of accepted steps, likewise.
        rejected: Number of rejected steps, likewise.
        whole: Best time of the user's whole call, s, if it is measured apart.
        repeats: How often it was repeated.
        note: What the clock covers, or another remark.
        failure: Why it failed.
    """

    subject: str
    tool: str
    method: str
    setting: str = ""
    seconds: float = math.inf
    error: float = math.inf
    evaluations: int | None = None
    steps: int | None = None
    rejected: int | None = None
    whole: float | None = None
    repeats: int = 0
    note: str = ""
    failure: str = ""

    @property
    def reached(self) -> bool:
        """Whether the computation ended with a finite error."""
        return math.isfinite(self.error) and math.isfinite(self.seconds)

    @property
    def nanoseconds(self) -> float:
        """The time in ns."""
        return self.seconds * 1e9

    def scene_data(self) -> dict[str, Any]:
        """The row of a scene as JSON can hold it."""
        data = asdict(self)
        return finite({"scene": data.pop("subject"), **data})

    def dynamics_data(self) -> dict[str, Any]:
        """The row of a robot's dynamics as JSON can hold it."""
        return finite(
            {
                "robot": self.subject,
                "algorithm": self.method,
                "way": self.tool,
                "ns": self.nanoseconds,
                "error": self.error,
                "note": self.note,
            }
        )


def finite(data: Mapping[str, Any]) -> dict[str, Any]:
    """The mapping with None for every number that is not finite, as JSON has no infinities."""
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in data.items()}
