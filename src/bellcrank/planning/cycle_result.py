"""`RepeatedCycle`: a cycle that the motors can repeat indefinitely."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from bellcrank.motion.motion import Motion
from bellcrank.notes import WithNotes
from bellcrank.present.results import Result
from bellcrank.present.tables import aligned

By = Literal["pause", "speed"]
Limit = Literal["rms", "temperature"]
LIMITS = {"rms": "RMS torque", "temperature": "winding temperature"}


@dataclass(frozen=True, kw_only=True, eq=False)
class RepeatedCycle(WithNotes, Result):
    """A cycle that the motors can repeat indefinitely.

    `to_csv` writes one row a motor: the share of its limit that it uses as given, and in the cycle found.

    Attributes:
        robot: Name of the robot.
        motion: The whole cycle, with its pause: like any other motion, it can be sized, written and replayed.
        original_duration: The time of the motion alone, as it was given, s.
        limit: "rms" or "temperature".
        by: "pause" or "speed".
        pause: The pause at the end of the motion, s; 0 for none.
        factor: The factor of the motion's speed; 1 as given.
        joint: The joint whose motor sets the pause or the factor; "" where the motion can be repeated as it is.
        original_uses: The share of the limit that each motor uses if the motion repeats as it is, by joint.
        uses: The same in the cycle found.
        warnings: What was not taken into account.

    Example:
        >>> import bellcrank as bc
        >>> fastest = bc.time_optimal("geared_pendulum", "lift_and_return", costs=False)
        >>> bc.repeated_cycle("geared_pendulum", fastest.motion).joint
        'shoulder'
    """

    robot: str
    motion: Motion
    original_duration: float
    limit: Limit
    by: By
    pause: float
    factor: float
    joint: str
    original_uses: Mapping[str, float]
    uses: Mapping[str, float]
    warnings: tuple[str, ...] = field(default=())

    @property
    def duration(self) -> float:
        """The time of the whole cycle, s."""
        return self.motion.duration

    def __repr__(self) -> str:
        return f"RepeatedCycle({self.robot!r}, {self.motion.name!r}: {self.duration:.6g} s)"

    def table(self) -> str:
        """The cycle, and what its motors use of their limits.

        Returns:
            The text of a table.

        Example:
            >>> import bellcrank as bc
            >>> fastest = bc.time_optimal("geared_pendulum", "lift_and_return", costs=False)
            >>> print(bc.repeated_cycle("geared_pendulum", fastest.motion).table().splitlines()[0].split(":")[0])
            to repeat, by the RMS torque of shoulder
        """
        if not self.joint:
            what = f"it can repeat without a pause, by the {LIMITS[self.limit]}"
        elif self.by == "pause":
            what = (
                f"to repeat, by the {LIMITS[self.limit]} of {self.joint}: a pause of {self.pause:.6g} s, "
                f"a cycle of {self.duration:.6g} s"
            )
        else:
            what = (
                f"to repeat, by the {LIMITS[self.limit]} of {self.joint}: at {100.0 * self.factor:.4g} % of the speed, "
                f"a cycle of {self.duration:.6g} s"
            )
        rows = [["motor", "used at once", "used in the cycle"]]
        rows += [[one, *(f"{100.0 * use[one]:.1f} %" for use in (self.original_uses, self.uses))] for one in self.uses]
        return "\n".join([what, "", *aligned(rows, (0,))])

    def _rows(self) -> list[Sequence[object]]:
        rows: list[Sequence[object]] = [["motor", "used at once", "used in the cycle"]]
        for name, use in self.uses.items():
            rows.append([name, *(value if np.isfinite(value) else "" for value in (self.original_uses[name], use))])
        return rows

    def as_dict(self) -> dict[str, Any]:
        """The result as data for JSON, without the motion's rows.

        Returns:
            Times in s; shares of the limit by joint, None where infinite.

        Example:
            >>> import bellcrank as bc
            >>> fastest = bc.time_optimal("geared_pendulum", "lift_and_return", costs=False)
            >>> bc.repeated_cycle("geared_pendulum", fastest.motion).as_dict()["by"]
            'pause'
        """

        def finite(uses: Mapping[str, float]) -> dict[str, float | None]:
            return {name: use if np.isfinite(use) else None for name, use in uses.items()}

        return {
            "robot": self.robot,
            "motion": self.motion.name,
            "limit": self.limit,
            "by": self.by,
            "pause": self.pause,
            "factor": self.factor,
            "duration": self.duration,
            "original_duration": self.original_duration,
            "joint": self.joint or None,
            "original_uses": finite(self.original_uses),
            "uses": finite(self.uses),
            "warnings": list(self.warnings),
            "notes": [note.as_dict() for note in self.notes],
        }
