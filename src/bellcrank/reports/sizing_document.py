"""The report of a sizing: whether every limit is kept, the tables, and the pictures."""

from __future__ import annotations

import io

from bellcrank.reports.document import Document, Facts, Picture, Table
from bellcrank.reports.machine_facts import made_with
from bellcrank.sizing.result import Sizing
from bellcrank.sizing.table import joint_rows, shaft_rows, sized_with, structure_rows, verdict


def sizing_document(sizing: Sizing) -> Document:
    """The report of a sizing; units as in its tables. Its pictures need what was sized (`sizing.study`)."""
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
    parts += _pictures(sizing)
    parts.append(Facts("Made with", made_with()))
    lines = tuple(line.removeprefix("  - ") for line in verdict(sizing).split("\n"))
    return Document(sizing.robot, "motor sizing", sizing.inside, lines, sizing.warnings, tuple(parts))


def _table(title: str, content: tuple[list[str], list[list[str]]], note: str = "") -> Table:
    header, rows = content
    return Table(title, tuple(header), tuple(map(tuple, rows)), note)


def _pictures(sizing: Sizing) -> list[Picture]:
    from bellcrank.sizing.plots import draw

    if sizing.study is None:
        return []
    robot, motions, drives = sizing.study
    pictures = []
    figures = draw(robot, motions, drives, sizing.robot, sizing.mass_tolerance)
    for name, figure in figures.items():
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=130)
        pictures.append(Picture(name.removesuffix(".png").replace("_", " "), buffer.getvalue()))
    return pictures
