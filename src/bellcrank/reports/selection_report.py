"""The report of a selection: verdict and choice, candidates to explore, comparison, Pareto picture, inputs."""

from __future__ import annotations

import functools
from dataclasses import replace
from html import escape
from pathlib import Path

from bellcrank.actuators.conditions import Conditions
from bellcrank.replays.film.film import Film
from bellcrank.replays.page.page import Surroundings
from bellcrank.reports.document import Document, Facts, Picture, Still, Table, document_html, part_html
from bellcrank.reports.input_tables import about, joint_table, made_with, motion_table, robot_facts
from bellcrank.reports.selection_data import encoded_selection, title
from bellcrank.sizing.selection.matching_criteria import InertiaRatio
from bellcrank.sizing.selection.selection import AxisSelection, Candidate, Selection
from bellcrank.sizing.selection.tables import maybe_too_weak, selected_for

ASSETS = Path(__file__).with_name("assets")
SCRIPTS = (  # in the order in which they stand in the page
    "svg_plot.js", "torque_speed_plane.js", "use_bars.js", "temperature_chart.js", "selection_data.js", "pair_view.js",
    "candidate_table.js", "comparison.js", "pareto_chart.js", "selection.js",
)  # fmt: skip
OF_ONE = ("candidate_table.js", "pareto_chart.js")  # not for two selections
WORDS = {  # how a report calls a condition, and its unit
    "voltage": ("bus voltage", "V"),
    "voltage_ratio": ("ratio of bus and nominal voltage", ""),
    "voltage_reserve": ("voltage reserve for control", "%"),
    "winding_temperature": ("winding temperature of the voltage limit", "°C"),
    "ambient": ("ambient temperature", "°C"),
    "altitude": ("altitude", "m"),
    "safety_factor": ("safety factor on torques", ""),
    "inertia_ratio": ("allowed ratio of inertias", ""),
    "commutation": ("commutation", ""),
    "construction": ("construction", ""),
    "life": ("required life of gears", "h"),
    "brake": ("holding brake", ""),
    "bus_capacitance": ("bus capacitance", "F"),
    "bus_max_voltage": ("voltage that switches the brake resistor on", "V"),
    "brake_resistor_power": ("continuous power of the brake resistor", "W"),
    "brake_resistance": ("resistance of the brake resistor", "Ω"),
    "brake_resistor_peak_power": ("power of the brake resistor in a pulse", "W"),
    "supply_power": ("largest power of the supply", "W"),
}
NOISE = 1e-9  # of the largest load of any joint: rounding errors of a joint that rests, written as 0
OBJECTIVES = {"mass": "least mass", "cost": "least cost", "loss": "least loss", "margin": "largest margin"}
DEFAULTS = {  # what None means
    "voltage": "each motor's nominal voltage",
    "life": "none: life is reported and not judged",
    "brake_resistor_power": "no brake resistor",
    "commutation": "brushed or brushless",
    "construction": "housed or frameless",
}
EXPLORER = """<section id="chooser-section" class="selection"><h2>Candidates</h2><div id="axis-summary"></div>
<div id="chooser"><div id="candidates"></div><div id="pair" aria-live="polite"></div></div></section>
<section id="comparison" class="selection"></section>
"""
BOTH = """<section id="comparison" class="selection" aria-live="polite" data-first="{}" data-second="{}"></section>
<div id="paper-pairs"></div>
"""
FURTHER = """<section><h2>Pareto picture</h2><p>{proof}</p><div id="pareto"></div></section>
<section><h2>The whole robot</h2><div id="system"></div></section>
<div id="paper-pairs"></div>
"""


def selection_surroundings(selection: Selection, film: Film) -> Surroundings:
    """What stands around the replay of a selection.

    Args:
        selection: The selection.
        film: Its film.

    Returns:
        HTML with the data of the selection, style and scripts.
    """
    before, after = document_html(selection_document(selection, film))
    data = f'<script type="text/plain" id="selection">{encoded_selection(selection)}</script>'
    return Surroundings(
        before=before + part_html(choice_table(selection)) + EXPLORER,
        after=FURTHER.format(proof=escape(selection.pareto_proof)) + after + data,
        style=_asset("svg_plot.css") + _asset("selection.css"),
        scripts=tuple(map(_asset, SCRIPTS)),
    )


def compared_selections(document: Document, both: tuple[Selection, Selection], names: tuple[str, str]) -> Surroundings:
    """What stands around two selections over each other, which `names` call: `document`, whose first part is the choice
    of both, and the motors and gears of each joint side by side.
    """
    before, after = document_html(replace(document, parts=document.parts[1:]))
    data = "".join(
        f'<script type="text/plain" id="{key}">{encoded_selection(_choice_alone(one))}</script>'
        for key, one in zip(("selection", "other-selection"), both, strict=True)
    )
    return Surroundings(
        before=before + part_html(document.parts[0]),
        after=BOTH.format(*map(escape, names)) + after + data,
        style=_asset("svg_plot.css") + _asset("selection.css"),
        scripts=tuple(_asset(name) for name in SCRIPTS if name not in OF_ONE),
    )


def _choice_alone(selection: Selection) -> Selection:
    """A selection with no other candidates than those that it chose."""
    axes = tuple(replace(one, candidates=() if one.chosen is None else (one.chosen,)) for one in selection.axes)
    return replace(selection, axes=axes, pareto=())


def selection_document(selection: Selection, film: Film) -> Document:
    """Verdict, warnings, and the parts after the replay."""
    made = made_with()
    count = f"{len(selection.axes)} joint{'' if len(selection.axes) == 1 else 's'}"
    parts: list[Facts | Table | Picture] = [_load_table(selection), conditions_facts(selection)]
    if selection.inputs is not None:
        robot, motions = selection.inputs.mechanism.robot, selection.inputs.motions
        parts += [Facts("Robot", tuple(robot_facts(robot))), joint_table(robot), motion_table(motions)]
    return Document(
        title=selection.robot,
        status=_status(selection),
        success=selection.inside,
        partial=selection.inside and not selection.shown,
        verdict=tuple(_verdict(selection)),
        about=("motor selection", count, f"objective: {OBJECTIVES[selection.objective]}", *about(made)),
        warnings=(*(one.advice for one in selection.axes if one.advice), *selection.warnings),
        notes=(),
        still=Still(float(film.time[0]), "The chosen motors (blue) and gears (orange) at the start of the motions"),
        parts=(*parts, Facts("Made with", made)),
    )


def choice_table(selection: Selection) -> Table:
    """The motor and gear of every axis."""
    header = (
        "joint", "motor", "gear", "tier", "binding criterion", "largest\nutilisation", "inertia\nratio", "mass\n[kg]",
        "cost", "loss\n[W]", "fit",
    )  # fmt: skip
    rows = tuple(_choice(axis) for axis in selection.axes)
    total = [
        f"{name} {value:.4g} {unit}" if value is not None else f"{name} unknown"
        for name, value, unit in (("mass", selection.mass, "kg"), ("loss", selection.loss, "W"))
    ]
    return Table("The choice", header, rows, f"All together: {', '.join(total)}. {_sentence(selection.proof)}")


def _choice(axis: AxisSelection) -> tuple[str, ...]:
    name, one = axis.axis.name, axis.chosen
    if one is None:
        return (name, "nothing fits", *[""] * 9)
    gear = "direct" if one.gear.kind == "direct" else title(one.gear)
    cost = "unknown" if one.cost is None else f"{one.cost:.4g} {one.motor.currency or ''}".strip()
    figures = (percent(one.largest_use), _inertia_ratio(axis, one), _known(one.mass), cost, _known(one.loss))
    return (name, title(one.motor), gear, one.tier, one.binding, *figures, one.fit)


def _inertia_ratio(axis: AxisSelection, one: Candidate) -> str:
    """The inertia of load and gear over the rotor's, and what is allowed."""
    found = next((each for each in one.criteria if each.name == InertiaRatio.name), None)
    allowed = axis.conditions.inertia_ratio
    if found is None or found.use is None:
        return "not judged" if found is None or found.verdict == "note" else found.verdict
    return f"{found.use * allowed:.3g} of {allowed:g}"


def conditions_facts(selection: Selection) -> Facts:
    """The conditions, the values assumed for rows that lack them, and how the choice was found."""
    conditions = selection.conditions
    rows = [(title, f"{_condition(conditions, name)}{_source(conditions, name)}") for name, (title, _) in WORDS.items()]
    units = {axis.axis.name: "N" if axis.axis.kind == "linear" else "N m" for axis in selection.axes}
    momentary = [
        f"{name}: {load:g} {units.get(name, '')}".strip() + _source(conditions, f"momentary_loads.{name}")
        for name, load in dict(conditions.momentary_loads).items()
    ]
    rows.append(("rare loads", "; ".join(momentary) or "none given"))
    assumed = [
        f"{name} = {value:g}{_source(conditions, f'assume.{name}')}" for name, value in dict(conditions.assume).items()
    ]
    nothing = "nothing: what a product does not state stays unknown"
    rows.append(("assumed where not stated", "; ".join(assumed) or nothing))
    common = selected_for(conditions)
    for axis in selection.axes:
        own = [row for row in selected_for(conditions, {axis.axis.name: axis.conditions}) if row not in common]
        if own:
            rows.append((f"at {axis.axis.name}", "; ".join(f"{name} {value}" for name, value in own)))
    for number, choice in enumerate(selection.iterations):
        rows.append((f"pass {number + 1} of the feedback of masses", "; ".join(pair or "nothing" for pair in choice)))
    return Facts("Conditions and assumptions", tuple(rows))


def _source(conditions: Conditions, name: str) -> str:
    """Where a condition that is stated comes from, in parentheses."""
    return f" ({conditions.sources[name]})" if name in conditions.sources else ""


def _condition(conditions: Conditions, name: str) -> str:
    value, unit = getattr(conditions, name), WORDS[name][1]
    if value is None:
        return DEFAULTS.get(name, "unknown")
    if isinstance(value, bool):
        return "required" if value else "not required"
    return f"{100 * value:g} %" if unit == "%" else f"{value:g} {unit}".strip()


def _load_table(selection: Selection) -> Table:
    """The loads of each axis in each cycle, with the masses of the chosen actuators."""
    header = ("joint", "cycle", "largest torque", "RMS torque", "largest speed", "mean speed", "duration\n[s]")
    noise = [NOISE * max(abs(getattr(cycle, name)).max() for cycle in selection.cycles) for name in ("torque", "speed")]
    rows = []
    for number, axis in enumerate(selection.axes):
        units = ("N", "m/s") if axis.axis.kind == "linear" else ("N m", "rad/s")
        for cycle in selection.cycles:
            torque, speed = cycle.torque[:, number], abs(cycle.speed[:, number])
            rms = float((cycle.weight @ torque**2 / cycle.duration) ** 0.5)
            figures = (abs(torque).max(), rms, speed.max(), float(cycle.weight @ speed) / cycle.duration)
            texts = (f"{v if v > noise[k // 2] else 0.0:.4g} {units[k // 2]}" for k, v in enumerate(figures))
            rows.append((axis.axis.name, cycle.name, *texts, f"{cycle.duration:.4g}"))
    note = "At the joint, with the masses of the chosen motors and gears, without the inertia of rotors and gears."
    return Table("Loads", header, tuple(rows), note)


def _status(selection: Selection) -> str:
    if any(axis.chosen is None for axis in selection.axes):
        return "No choice"
    if not replace(selection, undetermined=()).inside:
        return "Exceeded"
    if selection.undetermined:
        return "Not known"
    return "OK" if selection.shown else "Passes what is known"


def _verdict(selection: Selection) -> list[str]:
    """Sentences: what was chosen, what is not shown, what is exceeded."""
    axes = selection.axes
    found = [axis for axis in axes if axis.chosen is not None]
    lines = [f"{len(found)} of {len(axes)} joints have a motor and gear."]
    lines += [f"Nothing in the catalogue can drive {axis.axis.name}." for axis in axes if axis.chosen is None]
    for tier, text in (
        ("all criteria shown", "All criteria are met for"),
        ("passes what is known", "Some criteria are unknown, and the rest pass, for"),
        ("fails", "A criterion is exceeded for"),
    ):
        names = [axis.axis.name for axis in found if axis.chosen is not None and axis.chosen.tier == tier]
        if names:
            lines.append(f"{text} {', '.join(names)}.")
    lines += [f"May be far too weak or too slow: {text}." for text in maybe_too_weak(selection)]
    lines += [f"The whole robot: {result.text}" for result in selection.system if result.verdict == "exceeded"]
    unfit = [axis.axis.name for axis in found if axis.chosen is not None and axis.chosen.fit == "fit not checked"]
    if unfit:
        lines.append(
            f"Flange and shaft of motor and gear are not stated, so the fit is not checked: {', '.join(unfit)}."
        )
    unknown = [result.name for result in selection.system if result.verdict == "unknown"]
    if unknown:
        lines.append(f"Of the whole robot, {' and '.join(unknown)} {'is' if len(unknown) == 1 else 'are'} unknown.")
    return lines


def percent(use: float) -> str:
    """A utilisation in %, which says on which side of the limit it is where rounding would hide that."""
    text = f"{100.0 * use:.3g}"
    return f"{text if text != '100' or use == 1.0 else '> 100' if use > 1.0 else '< 100'} %"


def _known(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.4g}"


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:] + "." if text else ""


@functools.cache
def _asset(name: str) -> str:
    return (ASSETS / name).read_text("utf-8")
