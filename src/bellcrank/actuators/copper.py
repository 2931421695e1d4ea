"""The electrical resistance of copper windings over temperature."""

from __future__ import annotations

import numpy as np

from bellcrank.arrays import Array

COPPER = 0.0039  # 1/K, rise of the resistance per kelvin, related to that at
REFERENCE = 25.0  # °C, at which catalogues state resistances


def resistance_factor(temperature: Array | float) -> Array:
    """Resistance at a temperature (°C) over that at 25 °C, 1 + α (T - 25)."""
    return np.asarray(1.0 + COPPER * (np.asarray(temperature) - REFERENCE))
