"""The scene that an argument `scene` of a public function stands for, with its `overrides` and `trust`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bellcrank import arguments
from bellcrank.files.access import Trust, for_files_only
from bellcrank.scene.overrides import EXPECTED_OVERRIDES
from bellcrank.scene.scene import Scene, load_scene


def given_scene(scene: Scene | str | Path, overrides: Mapping[str, Any] | None = None, trust: Trust = ()) -> Scene:
    """A scene, or that of a path or name, with overrides. Raises InputError, also where `trust` goes with no file."""
    if isinstance(scene, Scene):
        for_files_only(trust, "scene", "load_scene")
    else:
        scene = load_scene(arguments.subject("scene", scene, "a scene"), trust=trust)
    if overrides is not None and (changed := arguments.mapping("overrides", overrides, EXPECTED_OVERRIDES)):
        scene = scene.with_overrides(changed)
    return scene
