"""A sizing as a table for notebooks."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

from bellcrank.sizing.table import joint_rows, shaft_rows, sized_with, structure_rows, verdict

if TYPE_CHECKING:
    from bellcrank.sizing.result import Sizing


def sizing_html(sizing: Sizing) -> str:
    """The verdict and the tables of a sizing as HTML; units in the headers, names escaped."""
    answer = "<br>".join(escape(line) for line in verdict(sizing).split("\n"))
    with_ = "; ".join(f"{name} {value}" for name, value in sized_with(sizing))
    about = escape(f"{sizing.robot} over {', '.join(sizing.motions)}; {with_}")
    tables = [_table("At the joints", *joint_rows(sizing))]
    if any(joint.shaft for joint in sizing.joints):
        tables.append(_table("At the motor shafts, margins with the safety factor on torques", *shaft_rows(sizing)))
    tables.append(_table("Structure and energy", *structure_rows(sizing)))
    notes = "".join(f"<li>{escape(text)}</li>" for text in sizing.warnings)
    return f"<p><b>{answer}</b><br>{about}</p>{''.join(tables)}" + (f"<ul>{notes}</ul>" if notes else "")


def _table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    left = 'style="text-align:left"'
    head = "".join(f"<th>{escape(text).replace(chr(10), '<br>')}</th>" for text in header)
    body = "".join(
        f"<tr><th {left}>{escape(first)}</th>{''.join(f'<td>{escape(text)}</td>' for text in others)}</tr>"
        for first, *others in rows
    )
    return f"<table><caption {left}>{escape(title)}</caption><tr>{head}</tr>{body}</table>"
