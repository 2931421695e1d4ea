"""The extension `_trace`, which runs Pinocchio's algorithms on symbols and hands expression graphs to the compiler.

It is imported here alone, and when first asked for: a run whose functions are all cached loads neither Pinocchio nor
casadi.
"""

from __future__ import annotations

import importlib
import importlib.metadata
from typing import Any

from bellcrank.errors import BellcrankError


def extension() -> Any:
    """The extension module; BellcrankError where the casadi it was built with is not the one installed."""
    try:
        import casadi  # noqa: F401  loads the shared library that the extension links to

        found = importlib.import_module("bellcrank._trace")
    except ImportError as error:
        try:
            installed = importlib.metadata.version("casadi")
        except importlib.metadata.PackageNotFoundError:
            installed = "none"
        raise BellcrankError(
            f"the tracer cannot be loaded ({error}); it needs the casadi that bellcrank was built with (see "
            f"`pip show bellcrank`), and casadi {installed} is installed: reinstall bellcrank"
        ) from error
    return found
