"""Overrides of a scene by dotted path, such as {"initial.crank": "1.5 deg"}, applied before the scene is checked.

A path consists of the scene's keys. Entries of a list are addressed by their name, or by their number from 1. A key may
contain dots, as names of joints may; the longest matching key is used. "parameters.NAME" and NAME alone stand for the
value of that parameter.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from bellcrank import arguments
from bellcrank.config.units import whole_number
from bellcrank.config.yaml_file import read_value
from bellcrank.elements.element import entry_names
from bellcrank.elements.parameters import is_of_the_tree, parameter_name, target_of
from bellcrank.errors import InputError
from bellcrank.messages import format_value, unknown_name
from bellcrank.scene.free_joint_start import START_KEYS
from bellcrank.scene.robot_config import CONFIG_KEYS, SCENE_KEYS
from bellcrank.scene.settings import Settings
from bellcrank.scene.source_mapping import SourceMapping, source_mapping

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene

EXPECTED_OVERRIDES = "a mapping such as {'simulate.rtol': 1e-6}"
SETTINGS = tuple(field.name for field in fields(Settings))
_TABLES = (
    "frames",
    "motions",
    "actuators",
    "mounts",
    "friction",
    "parameters",
    "outputs",
    "joints",
)  # keys whose values are mappings by name


def parse_assignment(text: str) -> tuple[str, Any]:
    """Split "path=value"; the value is read as YAML: a number, a text, [1, 2, 3]. Raises InputError."""
    path, equals, value = text.partition("=")
    if not equals or not path.strip():
        raise InputError(
            f"{format_value(text)}: expected PATH=VALUE, such as initial.crank=1.5deg or simulate.rtol=1e-6"
        )
    return path.strip(), read_value(value, f"override {format_value(path.strip())}: {format_value(value)}")


def apply_overrides(data: Mapping[str, Any], overrides: Mapping[str, Any]) -> SourceMapping:
    """Copy a scene's mapping with overrides applied.

    Each key that an override sets is marked with the path of the override. Raises InputError for a path that does not
    exist.
    """
    overrides = arguments.mapping("overrides", overrides, EXPECTED_OVERRIDES)
    changed: SourceMapping = source_mapping(data)
    for given, value in overrides.items():
        path = given.strip()
        if not path:
            raise InputError(
                f"override {format_value(given)}: expected a path of keys with dots, such as simulate.rtol"
            )
        try:
            _set(changed, path, source_mapping(value, path))
        except InputError as error:
            raise InputError(" ".join(f"override '{given}': {error}".splitlines())) from None
    return changed


def _set(data: SourceMapping, path: str, value: Any) -> None:
    at: Any = data
    holder, at_key = data, ""  # a change within a list is recorded at the key of the list
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
                f"'{at_key}' is {format_value(at)}, not a mapping or a list; cannot set '{'.'.join(keys)}' in it"
            )
    holder.overrides[at_key] = path


def declared(scene: Scene, overrides: Mapping[str, Any]) -> Mapping[str, Any]:
    """The overrides, where those of numbers of the robot's tree (link.NAME.mass) set parameters that are declared.

    Raises InputError where there is no such link, joint or number.
    """
    if not isinstance(overrides, Mapping):
        return overrides  # which `apply_overrides` refuses
    changes, found = dict[str, Any](), dict[str, Any]()
    for path, value in overrides.items():
        if not is_of_the_tree(path) or path in scene.parameters:
            changes[path] = value
            continue
        try:
            target_of(path, scene.robot, (*scene.forces, *scene.control, *scene.constraints))
        except InputError as error:
            raise InputError(f"override '{path}': {error}") from None
        own = next((name for name, parameter in scene.parameters.items() if parameter.sets == (path,)), None)
        if own is not None:
            changes[own] = value
        else:
            name = parameter_name(path, [*scene.parameters, *found])
            found[name] = {"value": value, "sets": [path]}
    return changes | {f"parameters.{name}": entry for name, entry in found.items()}


def _with_parameter(data: Mapping[str, Any], path: str, value: Any) -> list[str]:
    """Split a path into keys; the name of a parameter becomes the path of its value. Raises InputError."""
    known = (*CONFIG_KEYS, *SCENE_KEYS)
    parameters = data.get("parameters")
    names = list(parameters) if isinstance(parameters, Mapping) else []
    name = path.removeprefix("parameters.")
    if path not in known and name in names and not isinstance(value, Mapping):
        return ["parameters", name, "value"]
    keys = path.split(".")
    if keys[0] in names and keys[0] not in known:
        whole = f"parameters.{'.'.join(keys)}"
        raise InputError(f"'{keys[0]}' is a parameter; write '{keys[0]}' for its value, or '{whole}' for a key of it")
    if keys[0] not in known:
        raise InputError(_unknown(path, keys[0], [*names, *known]))
    return keys


def _unknown(path: str, key: str, known: list[str]) -> str:
    """The message for a path that begins with an unknown key."""
    if path in SETTINGS:
        return f"there is no key or parameter '{path}'; did you mean 'simulate.{path}'?"
    return unknown_name("key or parameter", key, known)


def _longest(at: Mapping[str, Any], keys: list[str]) -> int:
    """The number of leading keys that, joined by dots, form the longest existing key; 0 if there is none."""
    return next((n for n in range(len(keys), 0, -1) if ".".join(keys[:n]) in at), 0)


def _new(inside: str, keys: list[str]) -> int:
    """The number of leading keys that, joined by dots, form the key to add to the mapping under the key `inside`."""
    if inside == "" or (inside == "initial" and keys[0] == "velocity") or keys[0] in (*START_KEYS, "placement"):
        return 1
    if inside == "initial" and (inner := next((k for k, key in enumerate(keys) if key in START_KEYS), 0)):
        return inner  # the keys before it are the name of the joint
    table = inside in _TABLES or (inside == "initial" and keys[-1] == "guess")
    return max(len(keys) - 1, 1) if table else len(keys)


def _entry(at: list[Any], keys: list[str]) -> tuple[int, int]:
    """The index of the list entry that the leading keys address, and the number of these keys. Raises InputError."""
    mappings = [entry for entry in at if isinstance(entry, Mapping)]
    names = entry_names(mappings) if len(mappings) == len(at) else []
    for used in range(len(keys), 0, -1):
        if ".".join(keys[:used]) in names:
            return names.index(".".join(keys[:used])), used
    number = whole_number(keys[0])
    if number is not None and 1 <= number <= len(at):
        return number - 1, 1
    raise InputError(unknown_name("entry", keys[0], [*names, *map(str, range(1, len(at) + 1))]))
