"""The extension `_trace`, which runs Pinocchio's algorithms on symbols and hands expression graphs to the compiler.

It is imported here alone, and when first asked for: a run whose functions are all cached loads neither Pinocchio nor
casadi.
"""

from __future__ import annotations

import importlib
import importlib.metadata
from functools import cache
from typing import Any

from bellcrank._codegen import CASADI_VERSION
from bellcrank.errors import BellcrankError


def check_casadi() -> None:
    """Raise BellcrankError where the installed casadi is not the version that the tracer was built with.

    The tracer calls casadi's C++ library, whose interface changes between versions while its file name does not: with
    another version it would compute wrong expressions or end the process.
    """
    try:
        installed = importlib.metadata.version("casadi")
    except importlib.metadata.PackageNotFoundError:
        installed = None
    if installed != CASADI_VERSION:
        there = "casadi is not installed" if installed is None else f"casadi {installed} is installed"
        raise BellcrankError(
            f"{there}, and this bellcrank was built with casadi {CASADI_VERSION} and works with no other: "
            f"pip install casadi=={CASADI_VERSION}"
        )


@cache
def extension() -> Any:
    """The extension module. Raises BellcrankError where it cannot be loaded, or casadi is not the right version."""
    check_casadi()
    try:
        import casadi  # noqa: F401  loads the shared library that the extension links to

        return importlib.import_module("bellcrank._trace")
    except ImportError as error:
        raise BellcrankError(
            f"the tracer cannot be loaded ({error}): reinstall bellcrank, and casadi {CASADI_VERSION} with it"
        ) from error
