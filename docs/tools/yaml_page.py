"""The page of all YAML keys, from what the readers ask for and the sentences of yaml_keys.yaml."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml
from yaml_recorder import Asked, recorded

import bellcrank as bc
from bellcrank.config.units import UNITS

KEYS = Path(__file__).parent / "yaml_keys.yaml"
# In these sections units depend on the joint: what a revolute joint asks for stands for both kinds.
BY_JOINT = tuple(
    "forces: joint_spring|forces: damper|forces: friction|forces: torque|control: |constraints: coupling|events.when"
    "|initial.JOINT".split("|")
)
SLIDING = {"N m/rad": "N/m", "N m s/rad": "N s/m", "N m": "N", "rad/s": "m/s", "rad": "m"}
HEAD = """# YAML reference

Every key of robot configurations and scenes, made from the code that reads them. [Robot
configurations](../guide/robot-configuration.md), [Motions](../guide/motions.md), [Scenes](../guide/scenes.md) and
[Constraints](../guide/constraints.md) explain how they are used.

Values are in SI units. A number may have a unit of its own, as in `30 deg` or `3000 rpm`; the [units](#units) are at
the end of this page. A key without a default is required, unless its section says otherwise. A key that is not in
these tables is an error, which names the file, the line and the nearest key.
"""


def sections() -> list[dict[str, Any]]:
    """The sections in the order of the page, each with `section`, `title`, `text` and `keys`."""
    found: list[dict[str, Any]] = yaml.safe_load(KEYS.read_text(encoding="utf-8"))
    return found


def differences() -> list[str]:
    """What the readers ask for and has no sentence, and the other way round; nothing where all is well."""
    asked = recorded()
    written = {entry["section"]: entry["keys"] for entry in sections()}
    found = [f"section '{name}' is not described" for name in asked if name not in written]
    found += [f"section '{name}' is not read" for name in written if name not in asked]
    for name in asked.keys() & written.keys():
        found += [f"{name}: key '{key}' is not described" for key in asked[name] if key not in written[name]]
        found += [f"{name}: key '{key}' is not read" for key in written[name] if key not in asked[name]]
        for key, given in written[name].items():
            if not isinstance(given, str) and (set(given) - {"text", "value", "default"} or "text" not in given):
                found.append(f"{name}: key '{key}': expected a sentence, or text, value and default")
    return sorted(found)


def page() -> str:
    """The page as Markdown."""
    asked, lines = recorded(), [HEAD]
    for entry in sections():
        lines += [f"\n## {entry['title']}\n", entry.get("text", "").strip() + "\n" if "text" in entry else ""]
        lines += ["| key | value | default | meaning |", "|---|---|---|---|"]
        for key, given in entry["keys"].items():
            lines.append(_row(entry["section"], key, given, asked[entry["section"]][key]))
    return "\n".join([*lines, "", *_units(), ""])


def _row(section: str, key: str, given: Any, asked: Asked) -> str:
    given = {"text": given} if isinstance(given, str) else given
    value, default = given.get("value", asked.value), given.get("default", asked.default)
    if section.startswith(BY_JOINT) and "value" not in given:
        number, comma, unit = value.rpartition(", ")
        value = f"{number}{comma}{unit} or {SLIDING[unit]}" if unit in SLIDING else value
    if section == "simulate" and default is None:
        setting = getattr(bc.results.Settings(), key)
        default = setting.kind if key == "stabilisation" else f"{setting:g}" if isinstance(setting, float) else setting
    cells = [f"`{key}`", value, "" if default is None else str(default), given["text"]]
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _units() -> list[str]:
    rows = []
    for unit, known in UNITS.items():
        if " or " in unit:
            continue
        others = [f"`{name}`" for name in known if name and name != unit]
        if others or unit:
            rows.append(f"| {f'`{unit}`' if unit else '1'} | {', '.join(others)} |")
    return ["## Units\n", "| SI unit | other spellings and units |", "|---|---|", *rows]
