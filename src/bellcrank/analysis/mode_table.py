"""The table of modes as text for a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array

if TYPE_CHECKING:
    from bellcrank.analysis.linearisation import Linearisation
    from bellcrank.analysis.mode import Mode

SHOWN_AS_ZERO = 1e-12  # m, rad, m/s or rad/s: less is shown as 0
MOST = 0.1  # of the largest entry of a shape: a state with less is not named


def mode_cells(linear: Linearisation, mode: Mode) -> tuple[str, ...]:
    """The cells of a mode after its number."""
    value, ratio, constant = mode.eigenvalue, mode.damping_ratio, mode.time_constant
    names = [name for name, _ in linear.states]
    largest = np.argsort(-np.abs(mode.shape), kind="stable")[:2]
    moving = ", ".join(names[k] for k in largest if abs(mode.shape[k]) > MOST)
    return (
        f"{value.real:.6g} ± {value.imag:.6g}i" if mode.oscillates else f"{value.real:.6g}",
        f"{mode.frequency:.6g}" if mode.oscillates else "",
        "" if ratio is None else f"{ratio:.4g}",
        "" if constant is None else f"{constant:.5g}",
        mode.kind + (" along a symmetry" if mode.symmetry else ""),
        moving,
    )


def mode_table(linear: Linearisation) -> str:
    """The operating point, the modes, symmetries and notes, line by line."""
    stability = f", {linear.stability}" if linear.stability else ""
    lines = [f"{linear.name}: {linear.description}{stability}", f"position q: {shown(linear.position)}"]
    if linear.velocity.any():
        lines.append(f"velocity v: {shown(linear.velocity)}")
    if linear.modes:
        rows = [linear.mode_header, *linear.mode_rows()]
        widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
        lines += [
            "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
        ]
    else:
        values = ", ".join(f"{x:.6g}" for x in linear.frozen_eigenvalues.tolist())
        lines.append(f"eigenvalues of A at this moment, which say nothing of stability: {values}")
    for drive in linear.drives:
        lines.append(f"drive of {drive.joint}: {'; '.join(f'{name} {value}' for name, value in drive.rows())}")
    if linear.symmetries:
        left = "left out of the states" if linear.symmetries_removed else "kept among the states"
        lines.append(f"symmetries ({left}): {'; '.join(linear.symmetries)}")
    return "\n".join([*lines, *(f"{note.label}: {note}" for note in linear.notes)])


def shown(values: Array) -> str:
    """Numbers for a table; those that are rounding errors as 0."""
    return ", ".join(f"{x if abs(x) > SHOWN_AS_ZERO else 0.0:.6g}" for x in values.tolist())
