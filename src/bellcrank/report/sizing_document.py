"""The report of a sizing: whether every limit is kept, the tables, and the pictures."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from bellcrank.report.document import Document, Facts, Picture, Table
from bellcrank.report.machine_facts import made_with
from bellcrank.sizing.drive import Drive
from bellcrank.sizing.result import Sizing
from bellcrank.sizing.table import joint_rows, shaft_rows, sized_with, structure_rows, verdict

if TYPE_CHECKING:
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import Robot


def sizing_document(
    sizing: Sizing, robot: Robot, motions: Sequence[Motion], drives: Mapping[str, Drive] | None = None
) -> Document:
    """The report of a sizing of a robot over motions; units as in its tables."""
    parts: list[Facts | Table | Picture] = [_table("At the joints", joint_rows(sizing))]
    if any(joint.shaft for joint in sizing.joints):
        note = "Margins with the safety factor on torques."
        parts.append(_table("At the motor shafts", shaft_rows(sizing), note))
    parts.append(_table("Structure and energy", structure_rows(sizing)))
    supply, back = sizing.supply_peak, sizing.regeneration_peak
    parts.append(
        Facts(
            "Sized for",
            (
                ("motions", ", ".join(sizing.motions)),
                *sized_with(sizing),
                ("largest power from the supply", f"{supply.value:.4g} W at {supply.time:.4g} s of {supply.motion}"),
                ("largest power given back", f"{back.value:.4g} W at {back.time:.4g} s of {back.motion}"),
            ),
        )
    )
    parts += _pictures(sizing, robot, motions, drives)
    parts.append(Facts("Made with", made_with()))
    lines = tuple(line.removeprefix("  - ") for line in verdict(sizing).split("\n"))
    return Document(sizing.robot, "motor sizing", sizing.inside, lines, sizing.warnings, tuple(parts))


def _table(title: str, content: tuple[list[str], list[list[str]]], note: str = "") -> Table:
    header, rows = content
    return Table(title, tuple(header), tuple(map(tuple, rows)), note)


def _pictures(
    sizing: Sizing, robot: Robot, motions: Sequence[Motion], drives: Mapping[str, Drive] | None
) -> list[Picture]:
    from bellcrank.sizing.plots import draw

    pictures = []
    figures = draw(robot, motions, drives, sizing.robot, sizing.mass_tolerance)
    for name, figure in figures.items():
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=130)
        pictures.append(Picture(name.removesuffix(".png").replace("_", " "), buffer.getvalue()))
    return pictures
