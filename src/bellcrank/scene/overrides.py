"""Changes to a scene by dotted path, such as {"initial.crank": "1.5 deg"}, made before the scene is read and checked.

A path follows the scene's keys; entries of a list are addressed by their name, else by their number from 1; a key may
itself hold dots (joint names do), and the longest that fits is taken. "parameters.NAME", and NAME alone, mean that
parameter's value.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from bellcrank import arguments
from bellcrank.config.numbers import whole_number
from bellcrank.config.yaml_file import read_value
from bellcrank.elements.element import entry_names
from bellcrank.errors import InputError
from bellcrank.messages import format_value, unknown_name
from bellcrank.scene.free_joint_start import START_KEYS
from bellcrank.scene.renamed_keys import rename_keys, rename_path
from bellcrank.scene.robot_config import CONFIG_KEYS, SCENE_KEYS
from bellcrank.scene.settings import Settings
from bellcrank.scene.source_mapping import SourceMapping, source_mapping

EXPECTED_OVERRIDES = "a mapping such as {'simulate.rtol': 1e-6}"
SETTINGS = tuple(field.name for field in fields(Settings))
_TABLES = ("frames", "motions", "actuators", "friction", "parameters", "outputs")  # of mappings by name


def parse_assignment(text: str) -> tuple[str, Any]:
    """The path and value of "path=value", the value read as YAML: a number, a text, [1, 2, 3]. Raises InputError."""
    path, equals, value = text.partition("=")
    if not equals or not path.strip():
        raise InputError(
            f"{format_value(text)}: expected PATH=VALUE, such as initial.crank=1.5deg or simulate.rtol=1e-6"
        )
    return path.strip(), read_value(value, f"override {format_value(path.strip())}: {format_value(value)}")


def apply_overrides(
    data: Mapping[str, Any], overrides: Mapping[str, Any], where: str
) -> tuple[SourceMapping, tuple[str, ...]]:
    """A copy of a scene's mapping with the overrides in it, and a note on each old key that they use.

    Each key that an override sets is marked with the path of the override. Raises InputError, with the file `where`,
    for a path that leads nowhere.
    """
    overrides = arguments.mapping("overrides", overrides, EXPECTED_OVERRIDES)
    changed: SourceMapping = source_mapping(data)
    notes: list[str] = []
    written: dict[str, str] = {}
    for path, value in overrides.items():
        new_path, note = rename_path(path.strip())
        if not new_path:
            raise InputError(f"override {format_value(path)}: expected a path of keys with dots, such as simulate.rtol")
        if new_path in written:
            raise InputError(f"overrides '{written[new_path]}' and '{path}' set the same key; keep '{new_path}' only")
        written[new_path] = path
        notes += [note] if note else []
        try:
            _set(changed, new_path, source_mapping(value, path.strip()), path.strip())
        except InputError as error:
            raise InputError(" ".join(f"override '{path}': {error}".splitlines())) from None
    return changed, (*notes, *rename_keys(changed, where))


def _set(data: SourceMapping, path: str, value: Any, override: str) -> None:
    at: Any = data
    holder, at_key = data, ""  # a change inside a list is a change of the mapping's key that holds the list
    keys = _with_parameter(data, path, value)
    while True:
        if isinstance(at, SourceMapping):
            used = _longest(at, keys) or _new(at_key, keys)
            holder, at_key = at, ".".join(keys[:used])
            keys = keys[used:]
            if keys and at_key not in at:
                at[at_key] = SourceMapping.like({})
            if not keys:
                at[at_key] = value
                break
            at = at[at_key]
        elif isinstance(at, list):
            k, used = _entry(at, keys)
            keys = keys[used:]
            if not keys:
                at[k] = value
                break
            at = at[k]
        else:
            raise InputError(
                f"'{at_key}' is {format_value(at)}, so there is nothing in it to set at '{'.'.join(keys)}'"
            )
    holder.overrides[at_key] = override


def _with_parameter(data: Mapping[str, Any], path: str, value: Any) -> list[str]:
    """The keys of a path; those of a parameter's value where the path names a parameter."""
    known = (*CONFIG_KEYS, *SCENE_KEYS)
    parameters = data.get("parameters")
    names = list(parameters) if isinstance(parameters, Mapping) else []
    name = path.removeprefix("parameters.")
    if path not in known and name in names and not isinstance(value, Mapping):
        return ["parameters", name, "value"]
    keys = path.split(".")
    if keys[0] not in known:
        raise InputError(_unknown(path, keys[0], [*known, *names]))
    return keys


def _unknown(path: str, key: str, known: list[str]) -> str:
    """What to say of a path that begins with an unknown key."""
    if path in SETTINGS:
        return f"there is no key or parameter '{path}'; did you mean 'simulate.{path}'?"
    if key in ("link", "joint"):
        return (
            f"an override changes the scene's file, and '{path}' is in the URDF; name it in the scene as a parameter, "
            f"parameters: {{NAME: {{value: …, sets: [{path}]}}}}, and set NAME"
        )
    return unknown_name("key or parameter", key, known)


def _longest(at: Mapping[str, Any], keys: list[str]) -> int:
    """How many of the keys, joined by dots, make the longest key that is there; 0 where none does."""
    return next((n for n in range(len(keys), 0, -1) if ".".join(keys[:n]) in at), 0)


def _new(inside: str, keys: list[str]) -> int:
    """How many of the keys, joined by dots, make the key to add to the mapping that stands under the key `inside`."""
    if inside == "" or (inside == "initial" and keys[0] == "velocity") or keys[0] in START_KEYS:
        return 1
    if inside == "initial" and (inner := next((k for k, key in enumerate(keys) if key in START_KEYS), 0)):
        return inner  # the joint's name; what follows is of its start
    table = inside in _TABLES or (inside == "initial" and keys[-1] == "guess")
    return max(len(keys) - 1, 1) if table else len(keys)


def _entry(at: list[Any], keys: list[str]) -> tuple[int, int]:
    """The index of the entry that the keys begin with, and how many of them name it."""
    mappings = [entry for entry in at if isinstance(entry, Mapping)]
    names = entry_names(mappings) if len(mappings) == len(at) else []
    for used in range(len(keys), 0, -1):
        if ".".join(keys[:used]) in names:
            return names.index(".".join(keys[:used])), used
    number = whole_number(keys[0])
    if number is not None and 1 <= number <= len(at):
        return number - 1, 1
    raise InputError(unknown_name("entry", keys[0], [*names, *map(str, range(1, len(at) + 1))]))
