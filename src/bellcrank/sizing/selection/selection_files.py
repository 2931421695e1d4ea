"""The files that a selection is written to: selection.csv and selection.json, with units."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.actuators.catalogue.product_fields import product_data
from bellcrank.actuators.conditions import BY_NAME, Conditions
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.files import atomic_write, json_files

if TYPE_CHECKING:
    from bellcrank.sizing.selection.selection import AxisSelection, Candidate, Selection

RESULTS = ("selection.csv", "selection.json")
PICTURES = ("motors.png", "utilisation.png", "pareto.png")
REPORT = "report.html"
FILES = (*RESULTS, *PICTURES, REPORT)  # all that a selection writes into its folder
_OURS = re.compile(r"\A(?:(?:motors|utilisation|pareto)\.png|selection\.csv|report\.html)\Z")
UNITS = {
    "mass": "kg",
    "loss": "W",
    "cost": "in the currency of the row",
    "use": "1 at the limit",
    "torque": "N m (N on linear axes)",
    "speed": "rad/s (m/s)",
    "duration": "s",
    "voltage": "V",
    "temperature": "°C",
    "motor": "SI units: V, A, Ω, H, N m, rad/s, kg m^2, K/W, s, kg, m",
    "gear": "SI units: N m (N), rad/s at the input, kg m^2 at the input, N m/rad, rad, h, kg, m",
}


def write_results(selection: Selection, folder: str | Path) -> list[Path]:
    """Write selection.csv and selection.json into a folder, each as a whole or not at all, and return their paths.

    Raises InputError where a file cannot be written.
    """
    folder = Path(folder)
    text = json_text(selection)
    atomic_write.write_text(folder / "selection.json", text)
    return [selection.to_csv(folder / "selection.csv"), folder / "selection.json"]


def earlier_files(folder: str | Path) -> list[str]:
    """Names of the files that the selection.json of a folder lists; none where there is no such file."""
    return json_files.listed_files(Path(folder) / "selection.json", _OURS)


def selection_rows(selection: Selection) -> list[Sequence[object]]:
    """The rows of selection.csv, first its header: one an axis and candidate; cells of what is unknown are empty."""
    names = _criterion_names(selection)
    rows = [
        _row(one, rank, candidate, names)
        for one in selection.axes
        for rank, candidate in enumerate(one.candidates or (None,), 1)
    ]
    return [list(rows[0]), *(list(row.values()) for row in rows)]


def json_text(selection: Selection, files: Iterable[str] = RESULTS) -> str:
    """The text of selection.json. "files" lists `files`; `json_files.list_files` adds those that are written later."""
    return json_files.json_text(selection_data(selection, files), **selection.json_layout._asdict())


def selection_data(selection: Selection, files: Iterable[str] = ()) -> dict[str, Any]:
    """The whole selection in SI units, as selection.json holds it, with None for what is unknown."""
    return {
        "robot": selection.robot,
        "objective": selection.objective,
        "files": list(files),
        "inside": selection.inside,
        "all_criteria_shown": selection.shown,
        "mass": selection.mass,
        "loss": selection.loss,
        "cost": selection.cost,
        "warnings": list(selection.warnings),
        "notes": [note.as_dict() for note in selection.notes],
        **({"undetermined": list(selection.undetermined)} if selection.undetermined else {}),
        **({"simulated": _simulated(selection)} if selection.simulated_limits else {}),
        "conditions": _conditions(selection.conditions),
        "units": UNITS,
        "cycles": [_cycle(selection, k) for k in range(len(selection.cycles))],
        "axes": [_axis(selection, one) for one in selection.axes],
        "system": [one.as_dict() for one in selection.system],
        "iterations": [list(one) for one in selection.iterations],
        "proof": selection.proof,
        "pareto": [one._asdict() for one in selection.pareto],
        "pareto_proof": selection.pareto_proof,
    }


def _simulated(selection: Selection) -> dict[str, Any]:
    """The limits in simulation, and how the chosen drives keep them; null where they could not be simulated."""
    found = selection.verification
    return {"limits": dict(selection.simulated_limits), "verification": None if found is None else found.as_dict()}


def _conditions(conditions: Conditions) -> dict[str, Any]:
    """All conditions, and where those that are stated come from."""
    return {**vars(conditions), **{name: dict(getattr(conditions, name)) for name in (*BY_NAME, "sources")}}


def _criterion_names(selection: Selection) -> list[str]:
    """The names of all criteria, in their order."""
    return list(
        dict.fromkeys(
            each.name for one in selection.axes for candidate in one.candidates for each in candidate.criteria
        )
    )


def _row(one: AxisSelection, rank: int, candidate: Candidate | None, names: list[str]) -> dict[str, Any]:
    """The cells of a candidate's line by column; of an axis without candidates only its name."""
    criteria = {} if candidate is None else {each.name: each for each in candidate.criteria}
    row: dict[str, Any] = {
        "axis": one.axis.name,
        "kind": one.axis.kind,
        "mounted on": one.axis.mount,
        "rank": rank if candidate else None,
        "chosen": candidate is not None and one.chosen is not None and candidate.id == one.chosen.id,
        "motor": candidate and candidate.motor.id,
        "gear": candidate and candidate.gear.id,
        "motor maker": candidate and candidate.motor.maker,
        "gear maker": candidate and candidate.gear.maker,
        "class": candidate and candidate.tier,
        "largest use [1]": candidate and candidate.largest_use,
        "binding criterion": candidate and candidate.binding,
        "mass [kg]": candidate and candidate.mass,
        "price": candidate and candidate.cost,
        "currency": candidate and candidate.motor.currency,
        "loss [W]": candidate and candidate.loss,
        "fit": candidate and candidate.fit,
    }
    for name in names:
        result = criteria.get(name)
        row[f"{name} use [1]"] = result and result.use
        row[f"{name} verdict"] = result and result.verdict
    return {key: _cell(value) for key, value in row.items()}


def _cell(value: Any) -> Any:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "" if value is None or (isinstance(value, float) and not math.isfinite(value)) else value


def _axis(selection: Selection, one: AxisSelection) -> dict[str, Any]:
    return {
        "name": one.axis.name,
        "kind": one.axis.kind,
        "joints": list(one.axis.joints),
        "mount": one.axis.mount,
        "kept": one.kept,
        "conditions": _conditions(one.conditions),
        "chosen": one.chosen and one.chosen.id,
        "counts": dict(one.counts),
        "advice": one.advice,
        "unknown_masses": list(one.unknown_masses),
        "candidates": [_candidate(candidate, *selection.stated(candidate)) for candidate in one.candidates],
    }


def _candidate(one: Candidate, motor: Motor, gear: Gear) -> dict[str, Any]:
    """A candidate, with motor and gear as they are stated."""
    return {
        "pair": one.id,
        "motor": product_data(motor),
        "gear": None if gear.kind == "direct" else product_data(gear),
        "class": one.tier,
        "binding": one.binding,
        "largest_use": one.largest_use,
        "mass": one.mass,
        "cost": one.cost,
        "loss": one.loss,
        "fit": one.fit,
        "criteria": [each.as_dict() for each in one.criteria],
    }


def _cycle(selection: Selection, number: int) -> dict[str, Any]:
    """The duration of a cycle, and RMS torque, peak torque, mean and largest speed of each axis, with the actuators'
    masses.
    """
    cycle = selection.cycles[number]
    weight = cycle.weight / cycle.duration
    return {
        "name": cycle.name,
        "duration": cycle.duration,
        "axes": [
            {
                "name": one.axis.name,
                "rms_torque": float(np.sqrt(weight @ cycle.torque[:, k] ** 2)),
                "peak_torque": float(np.abs(cycle.torque[:, k]).max()),
                "mean_speed": float(weight @ np.abs(cycle.speed[:, k])),
                "peak_speed": float(np.abs(cycle.speed[:, k]).max()),
            }
            for k, one in enumerate(selection.axes)
        ],
    }
