"""Why a design cannot be built, as text that is the same wherever the files of its scene lie."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from bellcrank.dynamics.postures.consistent_start import NoConsistentStart

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene


def infeasible_reason(error: Exception, scene: Scene) -> str:
    """The message of an error without the scene's file, and other files beside it without their folder; of a start that
    cannot be, without its diagnosis, so that designs that are made together and alone have the same reason.
    """
    text = error.brief if isinstance(error, NoConsistentStart) else str(error)
    return text.replace(f"{scene.source}: ", "").replace(f"{scene.source.parent}{os.sep}", "")
