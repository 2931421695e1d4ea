"""The tables and the verdict of a selection, as text for the terminal and as HTML for notebooks."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING

from bellcrank.actuators.actuator_fields import OF_AN_AXIS, UNITS
from bellcrank.actuators.conditions import Conditions, entries
from bellcrank.notes import Note
from bellcrank.present.tables import WIDTH, TableContent, counted, html_table, listed, text_table, wrapped
from bellcrank.sizing.selection.judged_axes import MAIN

if TYPE_CHECKING:
    from bellcrank.sizing.selection.selection import AxisSelection, Candidate, Selection

UNKNOWN = "unknown"
NOTHING = "nothing fits"
NOT_CHECKED = "fit not checked"
CLASSES = {"all criteria shown": "all met", "passes what is known": "some unknown", "fails": "fails"}
LITTLE_RESERVE = 0.95  # use from which a verdict says so: loads and data sheets are rarely known to 5 %
OF_WIDTH = 16  # characters of the name of a criterion, where the table is too wide
AIMS = {"mass": "least mass", "cost": "least cost", "loss": "least loss", "margin": "largest margin"}


def table(selection: Selection, top: int = 3) -> str:
    """The selection as text: the chosen pairs, for each axis the next best, and the criteria of the whole robot."""
    parts = [wrapped(_about(selection)) + "\n", _chosen_table(selection), _totals(selection)]
    for one in selection.axes:
        parts += ["", *_axis_lines(one, top)]
    if selection.system:
        parts += ["", "All axes together:", text_table(system_rows(selection), (0, 2))]
        parts += [wrapped(f"{result.name}: {result.text}", "  ") for result in selection.system]
    parts += ["", wrapped(f"Choice: {selection.proof} ({_passes(selection)})")]
    if selection.pareto:
        front = f"Pareto front of mass, largest use, loss and cost ({len(selection.pareto)} in selection.json)"
        parts.append(wrapped(f"{front}: {selection.pareto_proof or 'combinations'}"))
    return "\n".join(parts)


def selection_html(selection: Selection) -> str:
    """The verdict and the tables of a selection as HTML; names are escaped."""
    answer = "<br>".join(escape(line) for line in verdict(selection).split("\n"))
    parts = [f"<p><b>{answer}</b><br>{escape(_about(selection))}</p>", html_table("Chosen", chosen_rows(selection))]
    parts += [html_table(one.axis.name, candidate_rows(one)) for one in selection.axes if one.candidates]
    if selection.system:
        parts.append(html_table("All axes together", system_rows(selection)))
    notes = "".join(f"<li>{escape(text)}</li>" for text in selection.warnings)
    return "".join(parts) + (f"<ul>{notes}</ul>" if notes else "")


def verdict(selection: Selection) -> str:
    """Which axes have no pair, which limits are exceeded, or that all are kept, and what is unknown."""
    nothing = _without_pair(selection)
    lines = listed(f"NOTHING FITS: {counted(len(nothing), 'axis', 'axes')}", nothing)
    lines += exceeded_limits(_exceeded(selection))
    lines += not_verified(maybe_too_weak(selection))
    lines += undetermined_lines(selection.undetermined)
    if selection.inside:
        lines.append(wrapped(_kept(selection)))
    unchecked = [one.axis.name for one in selection.axes if one.chosen is not None and one.chosen.fit == NOT_CHECKED]
    if unchecked:
        lines.append(wrapped(f"Not checked: whether motor and gear fit together, of {', '.join(unchecked)}"))
    lines += unknown_limits([f"{where}: {', '.join(names)}" for where, names in unknown_criteria(selection)])
    return "\n".join(lines)


def unknown_criteria(selection: Selection) -> list[tuple[str, list[str]]]:
    """The criteria that are unknown, by axis and for the whole robot."""
    found = []
    for one in selection.axes:
        if one.chosen is not None:
            found.append((one.axis.name, [each.name for each in one.chosen.criteria if each.verdict == "unknown"]))
    found.append(("all axes together", [each.name for each in selection.system if each.verdict == "unknown"]))
    return [(where, names) for where, names in found if names]


def chosen_rows(selection: Selection) -> TableContent:
    """What was chosen for each axis, and its binding criterion."""
    header = ["axis", "motor", "gear", "largest\nuse", "of", "mass\n[kg]", "loss\n[W]", "criteria"]
    return TableContent(header, [_chosen_row(one) for one in selection.axes])


def candidate_rows(axis: AxisSelection) -> TableContent:
    """The candidates of an axis, best first."""
    header = ["", "motor + gear", "largest\nuse", "of", "mass\n[kg]", "loss\n[W]", "class"]
    rows = []
    for k, one in enumerate(axis.candidates):
        mark = "chosen" if axis.chosen is not None and one.id == axis.chosen.id else str(k + 1)
        rows.append([mark, one.id, percent(one.largest_use), one.binding, figure(one.mass), figure(one.loss), one.tier])
    return TableContent(header, rows)


def system_rows(selection: Selection) -> TableContent:
    """The criteria of all axes together."""
    rows = [
        [one.name, percent(one.use) if one.use is not None else "-" if one.verdict == "note" else UNKNOWN, one.verdict]
        for one in selection.system
    ]
    return TableContent(["criterion", "use", "verdict"], rows)


def selected_for(common: Conditions, of_axes: Mapping[str, Conditions] | None = None) -> list[tuple[str, str]]:
    """(name, value) of voltage, ambient temperature and the other conditions that are stated, each with its source.

    The conditions of axes, by name, follow where they are not those of the whole robot.
    """
    reserve = condition_text(common, "voltage_reserve")
    rows = [("voltage", f"{condition_text(common, 'voltage')} less {reserve}")]
    rows.append(("ambient", condition_text(common, "ambient")))
    shown = ("voltage", "voltage_reserve", "ambient")
    rows += [(_label(name), condition_text(common, name)) for name in common.sources if name not in shown]
    own: dict[tuple[str, str], list[str]] = {}
    for axis, conditions in (of_axes or {}).items():
        for name in entries(conditions, OF_AN_AXIS):
            text = condition_text(conditions, name, source=False)
            if text != condition_text(common, name, source=False):
                own.setdefault((_label(name), text), []).append(axis)
    return rows + [
        (label, f"{text} ({', '.join(f'actuators.{name}' for name in names)})") for (label, text), names in own.items()
    ]


def condition_text(conditions: Conditions, name: str, source: bool = True) -> str:
    """The value of a condition with its unit and, in parentheses, its source; names are those of `sources`."""
    field, _, entry = name.partition(".")
    value = dict(getattr(conditions, field)).get(entry) if entry else getattr(conditions, field)
    where = f" ({conditions.sources[name]})" if source and name in conditions.sources else ""
    if value is None:
        text = "the nominal voltage of each motor" if name == "voltage" else "none"
    elif isinstance(value, str):
        text = value
    elif isinstance(value, bool):
        text = "required" if value else "not required"
    else:
        text = f"{100.0 * value:g}%" if name == "voltage_reserve" else f"{value:g} {UNITS.get(name, '')}".strip()
    return text + where


def _label(name: str) -> str:
    """How tables call a condition."""
    field, _, entry = name.partition(".")
    return {"assume": f"assumed {entry}", "momentary_loads": f"momentary load of {entry}"}.get(
        field, field.replace("_", " ")
    )


def figure(value: float | None) -> str:
    """A number with four digits, or "unknown"."""
    return UNKNOWN if value is None else f"{value:.4g}"


def percent(use: float) -> str:
    """A utilisation in per cent."""
    if math.isinf(use):
        return "infinite"
    return f"{use:.1%}" if use < 100.0 else f"{100.0 * use:.3g}%"


def maybe_too_weak(selection: Selection) -> list[str]:
    """The chosen pairs of which main criteria are unknown."""
    found = []
    for one in selection.axes:
        if one.chosen is not None and one.chosen.tier == "passes what is known":
            names = [name for name in one.chosen.unknown if name in MAIN]
            if names:
                found.append(f"{one.axis.name}: {one.chosen.id}: {', '.join(names)} unknown")
    return found


def _chosen_table(selection: Selection) -> str:
    """The chosen pairs; where a line would be too long, the gear is below the motor and names are in two lines."""
    content = chosen_rows(selection)
    text = text_table(content, (0, 1, 2, 4, 7))
    if max(map(len, text.splitlines())) <= WIDTH:
        return text
    axis, motor, _, *others = content.header
    rows = []
    for name, motor_id, gear_id, use, of, *rest in content.rows:
        criterion, *below = textwrap.wrap(of, OF_WIDTH) or [""]
        rows.append([name, motor_id, use, criterion, *rest])
        gear = f"+ {gear_id}" if gear_id not in ("", "none") else ""
        if gear or below:
            rows.append(["", gear, "", " ".join(below), *("" for _ in rest)])
    return text_table(TableContent([axis, f"{motor}\n+ gear", *others], rows), (0, 1, 3, 6))


def _chosen_row(one: AxisSelection) -> list[str]:
    chosen = one.chosen
    if chosen is None:
        return [one.axis.name, NOTHING, "", "", "", "", "", ""]
    gear = "none" if chosen.gear.kind == "direct" else chosen.gear.id
    use = percent(chosen.largest_use) if chosen.binding else UNKNOWN
    return [
        one.axis.name, chosen.motor.id, gear, use, chosen.binding, figure(chosen.mass), figure(chosen.loss),
        CLASSES[chosen.tier],
    ]  # fmt: skip


def _axis_lines(one: AxisSelection, top: int) -> list[str]:
    """How many pairs are in each class, the next best pairs, and what is unknown of the chosen one."""
    counts = ", ".join(f"{count} {tier}" for tier, count in one.counts)
    lines = [wrapped(f"{one.axis.name} ({_drive(one)}): pairs: {counts}")]
    if one.unknown_masses:
        lines.append(wrapped(f"loads without the unknown masses of: {', '.join(one.unknown_masses)}", "  "))
    chosen = one.chosen
    if chosen is not None:
        lines.append(wrapped(f"chosen: {_brief(chosen)}; {_sentence(chosen)}", "  ", "    "))
    others = [each for each in one.candidates if chosen is None or each.id != chosen.id]
    lines += [
        wrapped(f"{'fails' if each.tier == 'fails' else 'next'}: {_brief(each)}", "  ", "    ") for each in others[:top]
    ]
    return lines


def _drive(one: AxisSelection) -> str:
    joints = "" if one.axis.joints == (one.axis.name,) else f", moves {', '.join(one.axis.joints)}"
    return f"{one.axis.kind}, mounted on {one.axis.mount}{joints}{', given' if one.kept else ''}"


def _brief(one: Candidate) -> str:
    mass = "mass unknown" if one.mass is None else f"{one.mass:.4g} kg"
    loss = "loss unknown" if one.loss is None else f"{one.loss:.4g} W"
    cost = "" if one.cost is None else f", {one.cost:.4g} {one.motor.currency or ''}".rstrip()
    return f"{one.id}: {_use(one)}, {mass}, {loss}{cost}, {one.fit}" + ("" if one.tier == "fails" else f"; {one.tier}")


def _use(one: Candidate) -> str:
    return f"{percent(one.largest_use)} of {one.binding}" if one.binding else "no criterion is known"


def _sentence(one: Candidate) -> str:
    """The binding criterion in words."""
    return next((each.text for each in one.criteria if each.name == one.binding), "what it needs is not stated")


def _about(selection: Selection) -> str:
    of_axes = {one.axis.name: one.conditions for one in selection.axes}
    conditions = "; ".join(f"{name} {value}" for name, value in selected_for(selection.conditions, of_axes))
    cycles = ", ".join(cycle.name for cycle in selection.cycles)
    masses = f"masses of motors and gears {'added to' if selection.feedback else 'not added to'} the robot's"
    return f"{selection.robot}, {AIMS[selection.objective]}, over {cycles}; {conditions}; {masses}"


def _totals(selection: Selection) -> str:
    if any(one.chosen is None for one in selection.axes):
        return ""
    cost = "" if selection.cost is None else f", {selection.cost:.4g} in price"
    mass = "mass unknown" if selection.mass is None else f"{selection.mass:.4g} kg"
    loss = "loss unknown" if selection.loss is None else f"{selection.loss:.4g} W lost"
    return f"\nTogether: {mass}, {loss}{cost}"


def _passes(selection: Selection) -> str:
    return f"{counted(len(selection.iterations), 'pass', 'passes')} of the feedback of masses"


def _without_pair(selection: Selection) -> list[str]:
    return [f"{one.axis.name}: {one.advice or 'no pair is left'}" for one in selection.axes if one.chosen is None]


def _exceeded(selection: Selection) -> list[str]:
    found = [
        f"{one.axis.name}: {one.chosen.id}: {each.text}"
        for one in selection.axes
        if one.chosen is not None
        for each in one.chosen.criteria
        if each.verdict == "exceeded"
    ]
    found += [f"all axes together: {each.text}" for each in selection.system if each.verdict == "exceeded"]
    if selection.follows:
        return found
    return [*found, *(("limits in simulation: not known",) if selection.verification is None else
                      (f"in simulation: {text}" for text in selection.verification.exceeded))]  # fmt: skip


def _kept(selection: Selection) -> str:
    """That every axis has a pair, with the largest utilisation."""
    uses = [
        (one.chosen.largest_use, f"{one.axis.name}'s {one.chosen.binding}")
        for one in selection.axes
        if one.chosen is not None and one.chosen.binding
    ]
    uses += [(each.use, f"the {each.name} of all axes") for each in selection.system if each.use is not None]
    if not uses:
        return "No criterion is known of any motor."
    use, where = max(uses)
    largest = f"{percent(use)}, {where}"
    if selection.shown:
        text = f"All inside: every axis has a motor that keeps all criteria; the largest use is {largest}."
    elif maybe_too_weak(selection):
        text = f"No known limit is exceeded; the largest known use is {largest}."
    else:
        known = "every axis has a motor that passes what is known"
        text = f"Inside as far as known: {known}; the largest known use is {largest}."
    return text + reserve_note(use)


def reserve_note(use: float) -> str:
    """A sentence where the largest use leaves little to what the model does not contain; else nothing."""
    if use < LITTLE_RESERVE:
        return ""
    return f" Less than {1.0 - LITTLE_RESERVE:.0%} is left in reserve; a safety factor asks for more."


# ---- Parts of a verdict: a title, and its texts below; nothing where there is no text.


def exceeded_limits(texts: Sequence[str], wrap: bool = True) -> list[str]:
    """The limits that are exceeded."""
    return listed(f"EXCEEDED: {counted(len(texts), 'limit')}", texts, wrap)


def not_verified(texts: Sequence[str], wrap: bool = True) -> list[str]:
    """The motors of which a main criterion is unknown."""
    return listed(f"Not verified: {counted(len(texts), 'motor')} may be far too weak or too slow", texts, wrap)


def undetermined_lines(texts: Sequence[str], wrap: bool = True) -> list[str]:
    """What is not known, by its reason: what a robot's file says and is not modelled, and the rows of motions."""
    omitted = [text for text in texts if isinstance(text, Note)]
    peaks = [text for text in texts if not isinstance(text, Note)]
    return [
        *listed("Not known: what the robot's file says, acts along the motions, and is not modelled", omitted, wrap),
        *listed("Not known: peaks that the rows of a motion do not determine", peaks, wrap),
    ]


def unknown_limits(texts: Sequence[str], wrap: bool = True) -> list[str]:
    """What could not be compared."""
    return listed("Unknown, because what they need is not stated:", texts, wrap)
