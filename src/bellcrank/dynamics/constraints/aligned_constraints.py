"""Constraints whose rotation residuals are sines of angles, which vanish at half a turn too: welds and hinges."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bellcrank.elements.loop_constraints import Hinge, Weld

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene


def aligned_constraints(scene: Scene) -> tuple[str, ...]:
    """The names of these constraints, in the order of the scene."""
    return tuple(constraint.name for constraint in scene.constraints if isinstance(constraint, (Weld, Hinge)))


def sine_rows(scene: Scene, rows: Sequence[tuple[str, str]]) -> dict[str, list[int]]:
    """Which of the kept rows, given as (constraint, label), are sines of angles, by constraint."""
    return {
        constraint: [k for k, (name, label) in enumerate(rows) if name == constraint and label.endswith("[N m]")]
        for constraint in aligned_constraints(scene)
    }


def alignment_owners(scene: Scene) -> list[int]:
    """Which of these constraints, by number, each row of their alignment residual belongs to."""
    aligned = [constraint for constraint in scene.constraints if isinstance(constraint, (Weld, Hinge))]
    return [k for k, constraint in enumerate(aligned) for _ in range(constraint.alignment_rows)]
