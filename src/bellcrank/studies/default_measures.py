"""Which measures of a simulation tables and plots show, and which differences between designs are numerical errors."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.studies.measures import target_events

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]
TOLERANCES = 10.0  # the error of a run is a few times the tolerance of one step


def default_measures(scene: Scene, measures: Iterable[str]) -> tuple[str, ...]:
    """The measures that are shown if they vary: of events that end a run, else of all events, else of the end."""
    names = list(measures)
    events = target_events(scene) or [event.name for event in scene.events]
    prefixes = tuple(f"{name}." for name in events) or ("end.",)
    found = [name for name in names if name.startswith(prefixes)]
    chosen = tuple(name for name in found if not name.endswith(".velocity") and ".force." not in name)
    return chosen or tuple(name for name in ("end.time",) if name in names)


def run_noise(scene: Scene) -> tuple[float, float]:
    """Absolute and relative differences of measures that the tolerances of the runs allow."""
    return TOLERANCES * scene.settings.atol, TOLERANCES * scene.settings.rtol


def varies(values: Array, noise: tuple[float, float]) -> bool:
    """Whether the finite values (n,) differ by more than absolute + relative × magnitude."""
    known = values[np.isfinite(values)]
    if not len(known):
        return False
    least, largest = float(known.min()), float(known.max())
    return largest - least > noise[0] + noise[1] * max(abs(least), abs(largest))
