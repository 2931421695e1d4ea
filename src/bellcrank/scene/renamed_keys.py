"""Keys of scene files that were renamed in 0.5. The old keys work until 0.6, each with a deprecation note.

The data of a file and the paths of overrides are rewritten to the new keys before they are read, so that no other
module handles old keys. The line of each key, or the override that set it, is kept.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from bellcrank.config.yaml_file import read_yaml
from bellcrank.deprecated import REMOVAL
from bellcrank.elements.element import entry_names
from bellcrank.errors import InputError
from bellcrank.scene.source_mapping import SourceMapping, source_mapping

TOP_KEYS: Final = {"closures": "constraints", "drives": "actuators"}
CONSTRAINT_KINDS: Final = {"drive": "prescribed_motion", "formula": "expression"}
OUTPUT_KEYS: Final = {"closure": "constraint"}
CONDITIONS: Final = {"singular_closure": "singular_constraints"}
CONDITION_KEYS: Final = {"aligned": OUTPUT_KEYS, "friction_demand": OUTPUT_KEYS}  # keys within a condition
TARGETS: Final = {"closure": "constraint", "closures": "constraint"}  # the first word of a parameter's target
MOST_LINES = 5  # lines listed in a note
# Paths of overrides: (pattern of the text before the renamed key and of the key, new names).
_PATHS: Final = (
    (re.compile(r"^()(closures|drives)(?=\.|$)"), TOP_KEYS),
    (re.compile(r"^(outputs\..+\.)(closure)$"), OUTPUT_KEYS),
    (re.compile(r"^(events\..+\.when\.)(singular_closure)$"), CONDITIONS),
    (re.compile(r"^(events\..+\.when\.(?:aligned|friction_demand)\.)(closure)$"), OUTPUT_KEYS),
)


def read_scene_data(path: str | Path) -> tuple[SourceMapping, tuple[str, ...]]:
    """Read a scene or configuration file. Returns its mapping with the new keys, and a note on each old key.

    Raises InputError as `read_yaml` does, and for a mapping that has both an old key and its new name.
    """
    data: SourceMapping = source_mapping(read_yaml(path))
    return data, rename_keys(data, str(path))


def rename_keys(data: SourceMapping, where: str) -> tuple[str, ...]:
    """Rewrite a scene's mapping to the new keys in place, and return a note on each old key.

    Raises InputError, with the file `where`, for a mapping that has both an old key and its new name.
    """
    renaming = _Renaming(where)
    renaming.rewrite(data)
    return tuple(renaming.notes())


def rename_path(path: str) -> tuple[str, str | None]:
    """The path of an override with the new keys, and a note if it has an old one."""
    for pattern, names in _PATHS:
        if match := pattern.match(path):
            old, new = match[2], names[match[2]]
            return pattern.sub(rf"\g<1>{new}", path), _note("key", f"'{old}' (override '{path}')", f"'{new}'")
    return path, None


def _note(what: str, old: str, new: str) -> str:
    return f"{old} is now {new}; the old {what} works until {REMOVAL}"


@dataclass
class _Renaming:
    """Rewrites the mapping of a scene, and records the lines or overrides of the old keys."""

    where: str
    found: dict[tuple[str, str, str], list[str]] = field(default_factory=dict)

    def rewrite(self, data: SourceMapping) -> None:
        """Rewrite a scene's mapping in place. Values of an unexpected type are skipped; their readers refuse them."""
        self.keys(data, TOP_KEYS)
        self.constraint_kinds(data.get("constraints"))
        for output in _mappings(data.get("outputs")):
            self.keys(output, OUTPUT_KEYS)
        for event in _mappings(data.get("events")):
            for when in _mappings([event.get("when")]):
                self.keys(when, CONDITIONS)
                for condition, names in CONDITION_KEYS.items():
                    for inner in _mappings([when.get(condition)]):
                        self.keys(inner, names)
        for parameter in _mappings(data.get("parameters")):
            self.targets(parameter)

    def keys(self, data: SourceMapping, names: Mapping[str, str]) -> None:
        for old, new in names.items():
            if old not in data:
                continue
            if new in data:
                raise InputError(
                    f"{self.where}: found '{old}'{_place(data, old)} and '{new}'{_place(data, new)}: '{old}' is the "
                    f"old name of '{new}'; keep '{new}' only"
                )
            self.remember(("key", f"'{old}'", f"'{new}'"), data, old)
            data.rename(old, new)

    def constraint_kinds(self, entries: Any) -> None:
        """Rename the kinds of constraints. Entries without a name keep the name derived from their old kind."""
        if not isinstance(entries, list) or not all(isinstance(entry, SourceMapping) for entry in entries):
            return
        names = entry_names(entries)
        for name, entry in zip(names, entries, strict=True):
            kind = entry.get("kind")
            if isinstance(kind, str) and kind in CONSTRAINT_KINDS:
                self.remember(("kind", f"kind '{kind}'", f"'{CONSTRAINT_KINDS[kind]}'"), entry, "kind")
                entry["kind"] = CONSTRAINT_KINDS[kind]
                entry.setdefault("name", name)

    def targets(self, parameter: SourceMapping) -> None:
        sets = parameter.get("sets")
        if not isinstance(sets, list):
            return
        for k, target in enumerate(sets):
            kind, dot, rest = target.partition(".") if isinstance(target, str) else ("", "", "")
            if dot and kind in TARGETS:
                self.remember(("target", f"target '{target}'", f"'{TARGETS[kind]}.{rest}'"), parameter, "sets")
                sets[k] = f"{TARGETS[kind]}.{rest}"

    def remember(self, renaming: tuple[str, str, str], data: SourceMapping, key: str) -> None:
        self.found.setdefault(renaming, []).append(_source(data, key))

    def notes(self) -> Iterator[str]:
        for (what, old, new), sources in self.found.items():
            listed = list(dict.fromkeys(source for source in sources if source))
            lines = sorted(int(source.removeprefix("line ")) for source in listed if source.startswith("line "))
            places = [source for source in listed if not source.startswith("line ")]
            if lines:
                first = ", ".join(map(str, lines[:MOST_LINES])) + (", …" if len(lines) > MOST_LINES else "")
                places.insert(0, f"line{'s' if len(lines) > 1 else ''} {first}")
            yield _note(what, f"{old} ({'; '.join(places)})" if places else old, new)


def _mappings(data: Any) -> Iterator[SourceMapping]:
    entries: Iterable[Any] = data.values() if isinstance(data, Mapping) else data if isinstance(data, list) else ()
    return (entry for entry in entries if isinstance(entry, SourceMapping))


def _source(data: SourceMapping, key: str) -> str:
    """The place where a key was written: "line 12", "override 'closures'", or "" if it is unknown."""
    if key in data.overrides:
        return f"override '{data.overrides[key]}'"
    return f"line {data.lines[key]}" if key in data.lines else ""


def _place(data: SourceMapping, key: str) -> str:
    source = _source(data, key)
    return f" ({source})" if source else ""
