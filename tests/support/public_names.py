"""All public names: those of `bellcrank`, and the classes of `bellcrank.results`."""

from __future__ import annotations

from typing import Any

import bellcrank as bc

NAMES = [name for name in (*bc.__all__, *bc.results.__all__) if not name.startswith("__") and name != "results"]


def public(name: str) -> Any:
    """What a public name stands for."""
    return getattr(bc.results if name in bc.results.__all__ else bc, name)
