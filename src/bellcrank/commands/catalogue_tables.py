"""What `bellcrank catalogue` prints: lists of products, one product with all its figures, and the result of checks."""

from __future__ import annotations

import math
import shutil
import textwrap
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from bellcrank.actuators.catalogue.catalogue import Catalogue
from bellcrank.actuators.catalogue.catalogue_checks import checks_applied, contradictions
from bellcrank.actuators.catalogue.catalogue_columns import CURVE_FIELDS, GEAR_COLUMNS, MOTOR_COLUMNS, QUALITIES, Column
from bellcrank.actuators.catalogue.catalogue_tables import Placed, Product
from bellcrank.actuators.gear import DIRECT, LINEAR_KINDS, Gear
from bellcrank.actuators.motor import Motor
from bellcrank.arrays import Mask
from bellcrank.config.units import RPM
from bellcrank.files import json_files
from bellcrank.present import tables as present
from bellcrank.sizing.selection.criteria import Criterion, lacks
from bellcrank.sizing.selection.judge import CRITERIA

_NONE = Motor(id="none", maker="", model="")
SHOWN_IN = {  # unit of a field -> unit on the screen, factor
    "rad/s": ("rpm", RPM),
    "rad/s/V": ("rpm/V", RPM),
    "kg m^2": ("g cm²", 1e7),
    "rad": ("arcmin", 60.0 * 180.0 / math.pi),
    "m": ("mm", 1e3),
    "H": ("mH", 1e3),
}
LARGE_INERTIA = 1e-2  # kg m²; smaller ones are shown in g cm²
Cells = Sequence[Sequence[str]]
MOTOR_HEADER = ("id", "kind", "V", "continuous\nN m", "peak\nN m", "speed\nrpm", "mass\nkg", "maker", "quality")
GEAR_HEADER = ("id", "kind", "ratio", "average\nN m", "peak\nN m", "efficiency", "mass\nkg", "maker", "quality")


@dataclass(frozen=True, kw_only=True)
class Completeness:
    """How many products state what a criterion needs.

    Attributes:
        criterion: Its name.
        motors: Number of motors that state what it needs of a motor; None where it needs nothing of them.
        gears: Number of gears, in the same way.
        pairs: Share of all pairs of a motor and a gear (or none) that state everything; None where there is no motor.
    """

    criterion: str
    motors: int | None
    gears: int | None
    pairs: float | None


def completeness(catalogue: Catalogue) -> tuple[Completeness, ...]:
    """How many products of a catalogue state what each criterion needs, in the order of the criteria.

    Actuators sold as one pair with `DIRECT` alone, motors also with every gear.
    """
    return tuple(_of(criterion, catalogue) for criterion in CRITERIA)


def _of(criterion: Criterion, catalogue: Catalogue) -> Completeness:
    motors, gears = catalogue.motors, (*catalogue.gears, DIRECT)
    of_motor = np.array([[_states(needed, "motor", one, DIRECT) for one in motors] for needed in criterion.needs])
    of_gear = np.array([[_states(needed, "gear", _NONE, one) for one in gears] for needed in criterion.needs])
    possible = np.ones((len(motors), len(gears)), dtype=bool)
    possible[[one.kind == "actuator" for one in motors], :-1] = False
    complete = (of_motor[:, :, None] & of_gear[:, None, :]).any(axis=0) & possible if len(motors) else possible
    return Completeness(
        criterion=criterion.name,
        motors=_count(of_motor[_asking("motor", criterion)]),
        gears=_count(of_gear[_asking("gear", criterion), :-1]),
        pairs=float(complete.sum() / possible.sum()) if len(motors) else None,
    )


def _states(needed: Sequence[str], side: str, motor: Motor, gear: Gear) -> bool:
    """Whether a product states those of the needed fields that belong to its side."""
    return not lacks(tuple(name for name in needed if name.startswith(side)), motor, gear)


def _asking(side: str, criterion: Criterion) -> list[int]:
    """Numbers of the alternatives that need something of a side."""
    return [k for k, needed in enumerate(criterion.needs) if any(name.startswith(f"{side}.") for name in needed)]


def _count(states: Mask) -> int | None:
    """The number of products (columns) that satisfy one of the alternatives (rows); None without any."""
    return int(states.any(axis=0).sum()) if len(states) else None


def overview(catalogue: Catalogue) -> str:
    """Lists of motors and gears, and what is known of them as a whole."""
    width = shutil.get_terminal_size((100, 24)).columns
    wrong = {one.product.id for one in contradictions(catalogue.products)}
    parts = []
    if catalogue.motors:
        rows = [_motor_row(one, one.id in wrong) for one in catalogue.motors]
        parts += [fitted(MOTOR_HEADER, rows, width), ""]
    if catalogue.gears:
        rows = [_gear_row(one, one.id in wrong) for one in catalogue.gears]
        parts += [fitted(GEAR_HEADER, rows, width), ""]
    if not catalogue.products:
        return "no product of the catalogue satisfies all of the filters"
    parts += [_counts(catalogue, len(wrong)), ""]
    parts += ["Products that state what a criterion needs:", _completeness(catalogue)]
    return "\n".join(parts)


def _motor_row(motor: Motor, wrong: bool) -> list[str]:
    speed = motor.nominal_speed or motor.max_speed or motor.no_load_speed
    return [
        motor.id + (" *" if wrong else ""),
        motor.kind,
        figure(motor.nominal_voltage),
        figure(motor.continuous_torque),
        figure(motor.peak_torque),
        figure(None if speed is None else speed * RPM),
        figure(motor.mass),
        motor.maker,
        motor.quality,
    ]


def _gear_row(gear: Gear, wrong: bool) -> list[str]:
    average = gear.rated_torque if gear.average_torque is None else gear.average_torque
    unit = " N" if gear.kind in LINEAR_KINDS else ""
    return [
        gear.id + (" *" if wrong else ""),
        gear.kind,
        _transmission(gear),
        figure(average) + (unit if average is not None else ""),
        figure(gear.repeated_peak_torque) + (unit if gear.repeated_peak_torque is not None else ""),
        figure(gear.efficiency),
        figure(gear.mass),
        gear.maker,
        gear.quality,
    ]


def _transmission(gear: Gear) -> str:
    """The ratio; the lead of a screw and the radius of a rack's pinion."""
    if gear.ratio is None or gear.kind not in LINEAR_KINDS:
        return figure(gear.ratio)
    screw = gear.kind == "screw"
    return f"{(2.0 * math.pi if screw else 1.0) / gear.ratio * 1e3:.4g} mm {'lead' if screw else 'radius'}"


def figure(value: float | None) -> str:
    """A number with four digits; a dash where it is unknown."""
    return "-" if value is None else f"{value:.4g}"


def fitted(header: Sequence[str], rows: Cells, width: int) -> str:
    """A text table of the first columns that fit the width; those that do not are named below."""
    for count in range(len(header), 2, -1):
        text = text_table(header[:count], [row[:count] for row in rows])
        if max(map(len, text.splitlines())) <= width:
            break
    left = ", ".join(title.split("\n")[0] for title in header[count:])
    note = f"(not shown for lack of width: {left})" if left else ""
    return "\n".join([text, *textwrap.wrap(note, max(width, 40))])


def text_table(header: Sequence[str], rows: Cells) -> str:
    """Columns under headers of one or two lines; numbers to the right."""
    numeric = [all(not row[k] or row[k][0] in "-.0123456789" for row in rows) for k in range(len(header))]
    left = [k for k, right in enumerate(numeric) if not right]
    return present.text_table(present.TableContent(list(header), list(map(list, rows))), left)


def _counts(catalogue: Catalogue, wrong: int) -> str:
    """Numbers of products, by quality, and of those that contradict themselves."""
    motors, gears = Counter(one.quality for one in catalogue.motors), Counter(one.quality for one in catalogue.gears)
    listed = [name for name in QUALITIES if motors[name] or gears[name]]
    rows = [[name, str(motors[name]), str(gears[name])] for name in listed]
    rows.append(["all", str(len(catalogue.motors)), str(len(catalogue.gears))])
    text = text_table(("quality", "motors", "gears"), rows)
    if wrong:
        text += (
            f"\n* contradicts itself: {wrong} {'product' if wrong == 1 else 'products'}, which a selection leaves out "
            "(`bellcrank catalogue check` says why)"
        )
    return text


def _completeness(catalogue: Catalogue) -> str:
    rows = [
        [one.criterion, _share(one.motors, len(catalogue.motors)), _share(one.gears, len(catalogue.gears)),
         "-" if one.pairs is None else f"{one.pairs:.1%}"]
        for one in completeness(catalogue)
        if (catalogue.motors and one.motors is not None) or (catalogue.gears and one.gears is not None)
    ]  # fmt: skip
    return text_table(("criterion", "motors", "gears", "pairs"), rows)


def _share(count: int | None, of: int) -> str:
    return "" if count is None or not of else f"{count} of {of}"


def product_text(product: Product) -> str:
    """A product with all its figures, what is unknown, and where it is from."""
    columns = GEAR_COLUMNS if isinstance(product, Gear) else MOTOR_COLUMNS
    stated, unknown = [], []
    for column in columns.values():
        if column.convert == "x ratio^2" or (column.kinds and product.kind not in column.kinds):
            continue
        if column.field in ("id", "maker", "model", "kind", "quality", "source", "checked", "notes"):
            continue
        value = getattr(product, column.field)
        if value is None:
            follows = column.field == "voltage_constant" and getattr(product, "dc_voltage_constant", None) is not None
            unknown += [] if follows else [_words(column.name)]
        else:
            stated.append([_words(column.name), _shown(column, value)])
    curves = [name for name in CURVE_FIELDS if getattr(product, name, None)]
    stated += [[_words(name), f"{len(getattr(product, name))} points"] for name in curves]
    if isinstance(product, Motor) and product.dc_torque_constant is not None:
        stated.append(["torque constant of the DC-equivalent motor", f"{product.dc_torque_constant:.5g} N m/A"])
    name_width = max((len(name) for name, _ in stated), default=0)
    lines = [f"{product.id}: {product.maker} {product.model} ({product.kind})"]
    lines += [f"  {name.ljust(name_width)}  {value}" for name, value in stated]
    lines += _paragraph("unknown", ", ".join(unknown))
    lines += _paragraph("source", product.source or "not stated")
    lines += [f"quality: {product.quality}" + (f"; checked {product.checked}" if product.checked else "")]
    lines += _paragraph("notes", product.notes)
    found = contradictions([product])
    lines.append(f"checks: {checks_applied(product)} that its figures allow, {len(found)} contradicted")
    lines += [line for one in found for line in _paragraph(f"  {one.check}", one.text)]
    return "\n".join(lines)


def _words(name: str) -> str:
    return name.replace("no_load", "no-load").replace("_", " ")


def _shown(column: Column, value: object) -> str:
    if not isinstance(value, float):
        return str(value)
    unit, factor = SHOWN_IN.get(column.unit or "", (column.unit or "", 1.0))
    if column.unit == "kg m^2" and value >= LARGE_INERTIA:
        unit, factor = "kg m²", 1.0
    if column.convert:  # a lead or a radius
        value = (2.0 * math.pi if column.convert == "2 pi / x" else 1.0) / value
    return f"{value * factor:.6g} {unit}".rstrip()


def _paragraph(title: str, text: str) -> list[str]:
    if not text:
        return []
    width = min(shutil.get_terminal_size((100, 24)).columns, 120)
    return textwrap.wrap(f"{title}: {text}", max(width, 40), subsequent_indent="  ", break_on_hyphens=False)


def check_text(products: Sequence[Placed]) -> str:
    """What contradicts itself, with its place, and how many checks were possible."""
    places = {one.product.id: one.place for one in products}
    found = contradictions(one.product for one in products)
    lines = [f"{places[one.product.id]}: {one.product.id}: {one.check}: {one.text}" for one in found]
    counts = [checks_applied(one.product) for one in products]
    wrong = len({one.product.id for one in found})
    verdict = f"{wrong} contradict themselves" if wrong > 1 else f"{wrong or 'none'} contradicts itself"
    lines.append(
        f"{len(products)} product{'' if len(products) == 1 else 's'}, {sum(counts)} checks that their figures allow "
        f"(none for {counts.count(0)} of them): {verdict}"
    )
    without = [one.product.id for one in products if not one.product.source]
    if without:
        lines.append(f"without a source: {', '.join(without[:10])}{', …' if len(without) > 10 else ''}")
    return "\n".join(lines)


def write_json(catalogue: Catalogue, path: Path) -> Path:
    """Write products, contradictions and completeness as JSON, in SI units; unknown values are null."""
    found = contradictions(catalogue.products)
    document = {
        "motors": [asdict(one) for one in catalogue.motors],
        "gears": [asdict(one) for one in catalogue.gears],
        "contradictions": [{"id": one.product.id, "check": one.check, "text": one.text} for one in found],
        "completeness": [asdict(one) for one in completeness(catalogue)],
    }
    return json_files.write_json(path, document)
