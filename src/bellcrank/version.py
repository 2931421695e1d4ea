"""The version of bellcrank that is installed."""

from __future__ import annotations

from functools import cache


@cache
def version() -> str:
    """The version, such as "0.5.0"."""
    from importlib.metadata import version

    return version("bellcrank")
