"""The YAML files of Gepetto's parallel robots (example-parallel-robots), which close the loops of a URDF.

`closed_loop` lists pairs of frames, `type` is 3d (the origins coincide) or 6d (the frames coincide), `name_mot` lists
the joints with motors, and `joint_name` and `joint_type` give joints another type than the URDF does.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bellcrank.config.yaml_file import read_yaml
from bellcrank.errors import InputError
from bellcrank.files.access import MOST_YAML, FileAccess, read_bytes
from bellcrank.messages import format_value, unknown_name
from bellcrank.notes import Note
from bellcrank.robot.formats.robot_file import FrameLoop, FramePlace

SUFFIXES = (".yaml", ".yml")
MOST_FILES = 50  # of a folder that are looked at
KEYS = ("closed_loop", "type", "name_mot", "joint_name", "joint_type")


@dataclass(frozen=True)
class GepettoLoops:
    """The contents of a Gepetto YAML: (frame a, frame b, "3d" or "6d") of each loop, the joints with motors, the new
    types of joints as they are written, and sentences about keys that are not used.
    """

    loops: tuple[tuple[str, str, str], ...]
    motors: tuple[str, ...]
    joint_types: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def frame_loops(self, name: str) -> tuple[FrameLoop, ...]:
        """The loops as records, named NAME_1, NAME_2, …"""
        return tuple(
            FrameLoop(name=f"{name}_{k}", kind="point" if kind == "3d" else "weld", a=FramePlace(a), b=FramePlace(b))
            for k, (a, b, kind) in enumerate(self.loops, 1)
        )


def read_gepetto(path: str | Path) -> GepettoLoops:
    """Read a Gepetto YAML. Raises InputError, one sentence, for other contents."""
    data = read_yaml(path)
    pairs, kinds = data.get("closed_loop", []), data.get("type", [])
    if not isinstance(pairs, list) or not all(isinstance(p, list) and len(p) == 2 for p in pairs):
        raise InputError(f"{path}: closed_loop: expected a list of pairs of frames, such as [[loop_A, loop_B]]")
    if not isinstance(kinds, list) or len(kinds) != len(pairs):
        raise InputError(
            f"{path}: type: expected one of 3d and 6d for each of the {len(pairs)} loops, found {format_value(kinds)}"
        )
    for kind in kinds:
        if str(kind).lower() not in ("3d", "6d"):
            raise InputError(f"{path}: type: {unknown_name('type', str(kind), ['3d', '6d'])}")
    return GepettoLoops(
        loops=tuple((str(a), str(b), str(kind).lower()) for (a, b), kind in zip(pairs, kinds, strict=True)),
        motors=_names(data, "name_mot"),
        joint_types=_joint_types(path, data),
        notes=tuple(f"{Path(path).name}: the key '{key}' is not used." for key in data if key not in KEYS),
    )


def gepetto_beside(urdf: Path, access: FileAccess) -> Path | None:
    """The Gepetto YAML beside a URDF: robot.yaml beside robot.urdf, with the key `closed_loop`; None without one."""
    for suffix in SUFFIXES:
        path = urdf.with_suffix(suffix)
        if path.is_file() and access.allows(path) and b"closed_loop" in read_bytes(path, MOST_YAML):
            return path if "closed_loop" in read_yaml(path) else None
    return None


def gepetto_of_others(urdf: Path, access: FileAccess) -> tuple[Note, ...]:
    """A note on each YAML of Gepetto in the folder of a URDF that closes loops and belongs to no URDF by its name."""
    if access.held or not urdf.parent.is_dir():
        return ()
    found = []
    listed = itertools.islice((path for path in sorted(urdf.parent.iterdir()) if path.suffix in SUFFIXES), MOST_FILES)
    for path in listed:
        named = any(path.with_suffix(suffix).is_file() for suffix in (".urdf", ".xacro"))
        if named or path.stem == urdf.stem or not path.is_file() or not access.allows(path):
            continue
        if path.stat().st_size > MOST_YAML or b"\nclosed_loop" not in b"\n" + path.read_bytes():
            continue
        text = (
            f"{path.name} beside it closes loops (closed_loop) and is not used; where it belongs to this file, call it "
            f"{urdf.with_suffix('.yaml').name}, or name it under 'constraints' of a scene"
        )
        found.append(Note(text, "changes"))
    return tuple(found)


def _names(data: Mapping[str, Any], key: str) -> tuple[str, ...]:
    names = data.get(key) or []
    return tuple(map(str, names if isinstance(names, list) else [names]))


def _joint_types(path: str | Path, data: Mapping[str, Any]) -> dict[str, str]:
    names, kinds = _names(data, "joint_name"), _names(data, "joint_type")
    if len(names) != len(kinds):
        raise InputError(
            f"{path}: joint_type: expected a type for each of the {len(names)} joints of joint_name, found {len(kinds)}"
        )
    return dict(zip(names, kinds, strict=True))
