"""Why a design cannot be built, as text that is the same wherever the files of its scene lie."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene


def infeasible_reason(error: Exception, scene: Scene) -> str:
    """The message of an error without the scene's file, and other files beside it without their folder."""
    return str(error).replace(f"{scene.source}: ", "").replace(f"{scene.source.parent}{os.sep}", "")
