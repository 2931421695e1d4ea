"""Find the keys of the YAML files: read sample files and record what the readers ask for."""

from __future__ import annotations

import functools
import re
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bellcrank as bc
from bellcrank.config.fields import Fields
from bellcrank.messages import format_value

SAMPLES = Path(__file__).parent / "samples"
# Mappings whose keys are names that the user chooses, or names of joints; an entry is recorded as its own section.
NAMES = {
    "actuators",
    "frames",
    "friction",
    "joints",
    "motions",
    "mounts",
    "outputs",
    "parameters",
    "initial",
    "initial.velocity",
}
BY_JOINT = re.compile(r"\.(target|kp|kd|start|position|positions|linear_velocity|angular_velocity)$")
READERS = (
    "number", "optional_number", "integer", "vector", "rows", "numbers", "text", "unit", "file", "flag", "choice",
    "mapping", "mappings", "raw",
)  # fmt: skip


@dataclass(frozen=True)
class Asked:
    """What a reader asked for: the value in words, and the default as it is written in a file (None: none is known)."""

    value: str
    default: str | None = None


def recorded() -> dict[str, dict[str, Asked]]:
    """Section -> key -> what the readers of bellcrank ask for, over all sample files."""
    found: dict[str, dict[str, Asked]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for sample in SAMPLES.iterdir():
            (Path(folder) / sample.name).write_text(sample.read_text(encoding="utf-8"), encoding="utf-8")
        bc.simulate("pendulum", duration=0.1).save(Path(folder) / "earlier.npz")
        with _recording(found):
            for sample in sorted(Path(folder).glob("*.yaml")):
                if not sample.name.startswith("loops"):  # read by the samples that name it
                    bc.load_scene(sample)
    return found


@contextmanager
def _recording(found: dict[str, dict[str, Asked]]) -> Iterator[None]:
    originals = {name: getattr(Fields, name) for name in (*READERS, "known")}
    depth = 0

    def reader(name: str) -> Callable[..., Any]:
        original = originals[name]

        @functools.wraps(original)
        def call(self: Fields, key: str = "unit", *args: Any, **kwargs: Any) -> Any:
            nonlocal depth
            if depth == 0:
                _note(found, self, key, _asked(name, args, kwargs))
            depth += 1
            try:
                return original(self, *(() if name == "unit" else (key,)), *args, **kwargs)
            finally:
                depth -= 1

        return call

    def known(self: Fields, *keys: str) -> None:
        if depth == 0:
            for key in keys:
                _note(found, self, key, Asked("", None))
        originals["known"](self, *keys)

    for name in READERS:
        setattr(Fields, name, reader(name))
    Fields.known = known  # type: ignore[method-assign]
    try:
        yield
    finally:
        for name, original in originals.items():
            setattr(Fields, name, original)


def _note(found: dict[str, dict[str, Asked]], fields: Fields, key: str, asked: Asked) -> None:
    section = _section(fields)
    if section is None or (section in NAMES and _named_by_user(fields, section, key)):
        return
    before = found.setdefault(section, {}).get(key)
    if before is None or not before.value or (before.value == "mapping" and asked.value != "mapping"):
        found[section][key] = asked


def _named_by_user(fields: Fields, section: str, key: str) -> bool:
    return section != "initial" or key not in (
        "velocity", "hold", "motion", "run", "time", "clock", "largest_correction",
    )  # fmt: skip


def _section(fields: Fields) -> str | None:
    """The heading under which the keys of a mapping stand, None for mappings whose keys are joints or components."""
    if fields.where.endswith(".json"):  # the matrices of a controller, which are keys of the scene too
        return None
    path = re.sub(r"\[\d+\]", "[]", fields.path)
    if path.endswith(".placement"):
        return "motions.NAME.placement"
    if path.startswith("motions.") or ".parts[]" in path:
        return None if BY_JOINT.search(path) else f"motions: {fields._data['kind']}"
    top, _, rest = path.partition(".")
    if top == "constraints[]" and rest == "dry_friction":
        return "constraints.NAME.dry_friction"
    if top in ("forces[]", "control[]", "constraints[]"):
        return None if rest else f"{top[:-2]}: {fields._data.get('kind', '?')}"
    parts_of_drives = ("elastic", "rotor_friction", "temperatures", "servo")
    if top == "actuators" and rest.count(".") and rest.split(".")[1] in parts_of_drives:
        return ".".join([top, "NAME", *rest.split(".")[1:]])
    if top in ("frames", "actuators", "mounts", "parameters", "outputs", "friction") and rest:
        return None if "." in rest else f"{top}.NAME"
    if top == "joints" and rest:
        return ".".join([top, "NAME", *rest.split(".")[1:]])
    if top == "conditions" and rest:
        return None
    if top == "base" or (top == "initial" and rest not in ("", "velocity")):
        if "." in rest or (top == "base" and rest):
            return None
        return "base" if "guess" not in fields else "initial.JOINT"
    return path.replace("[]", "")


def _asked(name: str, args: tuple[Any, ...], kwargs: dict[str, Any]) -> Asked:
    """What a call of a reader's method asks for, in words."""
    positive = " > 0" if kwargs.get("positive") else " ≥ 0" if kwargs.get("nonnegative") else ""
    most = kwargs.get("maximum")
    bound = positive + (f", at most {most:g}" if most is not None else "")

    def argument(place: int, key: str, otherwise: Any = None) -> Any:
        return args[place] if len(args) > place else kwargs.get(key, otherwise)

    default: Any = None
    if name in ("number", "optional_number"):
        unit = argument(0, "unit", "")
        value = f"number{bound}{f', {unit}' if unit else ''}"
        default = argument(1, "default") if name == "number" else "none"
    elif name == "integer":
        value, default = "whole number", argument(0, "default")
    elif name == "vector":
        unit = argument(1, "unit", "")
        value, default = f"{argument(0, 'length')} numbers{f', {unit}' if unit else ''}", argument(2, "default")
    elif name in ("rows", "numbers"):
        unit = argument(1 if name == "rows" else 0, "unit", "")
        value = (f"list of rows of {args[0]} numbers" if name == "rows" else "list of numbers") + (
            f", {unit}" if unit else ""
        )
    elif name in ("text", "unit", "file"):
        value = {"text": "text", "unit": "unit", "file": "file name"}[name]
        default = argument(0, "default") if name == "text" else None
    elif name == "flag":
        value, default = "`true` or `false`", argument(0, "default")
    elif name == "choice":
        value, default = " or ".join(f"`{option}`" for option in argument(0, "options")), argument(1, "default")
    elif name == "mapping":
        value, default = "mapping", "none" if args or kwargs else None
    elif name == "mappings":
        value, default = "list of mappings", "none"
    else:
        value, default = "", argument(0, "default")
        default = "none" if (args or kwargs) and not isinstance(default, (int, float, str)) else default
    return Asked(value, None if default is None else _written(default))


def _written(default: Any) -> str:
    """A default as a file would have it."""
    if isinstance(default, bool):
        return str(default).lower()
    if isinstance(default, (tuple, list)):
        return "[" + ", ".join(_written(entry) for entry in default) + "]"
    if isinstance(default, float):
        return f"{default:g}"
    return default if isinstance(default, str) else format_value(default)
