"""Runs a function on what a stranger's file says in a process of its own, with limits of CPU time and memory.

A format that can compute can grow: ten macros that each call the one before ten times are 10⁹ calls. Limits of single
constructs miss the next one; the operating system's limits (setrlimit) hold for all of them, and leave this process as
it was. Where the system has none (Windows), the limit of the time alone holds.
"""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import ParamSpec, Self

from bellcrank.errors import BellcrankError, InputError

SECONDS, MEMORY = "BELLCRANK_LOADING_SECONDS", "BELLCRANK_LOADING_MEMORY"
WAITING = 10.0  # times the CPU time: on a busy machine a process gets a part of a processor
P = ParamSpec("P")


class OverBudgetError(Exception):
    """A function took more than its budget."""


@dataclass(frozen=True)
class Budget:
    """What a file may take to be read.

    Attributes:
        seconds: Of CPU time.
        memory: Of address space, MB.
    """

    seconds: float = 10.0
    memory: float = 1000.0

    @classmethod
    def of_environment(cls) -> Self:
        """The budget that the variables of the environment state. Raises InputError."""
        return cls(_stated(SECONDS, cls.seconds), _stated(MEMORY, cls.memory))

    def __str__(self) -> str:
        return f"{self.seconds:g} s of CPU time or {self.memory:g} MB of memory"


def _stated(name: str, default: float) -> float:
    text = os.environ.get(name, "")
    try:
        value = float(text) if text else default
    except ValueError:
        value = 0.0
    if not 1.0 <= value <= 1e7:
        raise InputError(f"{name}: expected a number from 1 to 1e7, found {text[:40]!r}")
    return value


def limited(function: Callable[P, str], budget: Budget, *args: P.args, **kwargs: P.kwargs) -> str:
    """What a function of a module returns, which runs in a process of its own.

    Raises InputError where the function does, and OverBudgetError where the process used up its budget or died.
    """
    try:
        process = subprocess.run(
            [sys.executable, "-P", "-m", __name__], input=pickle.dumps((budget, function, args, kwargs)),
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment_here(), check=False,
            timeout=WAITING * budget.seconds,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise OverBudgetError from None
    except OSError as error:
        raise BellcrankError(f"a process cannot be started: {error.strerror}; close other programs") from None
    try:
        answer = json.loads(process.stdout)
    except ValueError:
        raise OverBudgetError from None
    if "refused" in answer:
        raise InputError(answer["refused"])
    return str(answer["text"])


def environment_here() -> dict[str, str]:
    """The environment of a process that imports what this one does."""
    places = os.pathsep.join(str(Path(path).absolute()) for path in sys.path)
    return os.environ | {"PYTHONPATH": places}


def _restrict(budget: Budget) -> None:
    """Limit this process."""
    with contextlib.suppress(ImportError, ValueError, OSError):  # Windows; a harder limit that is there already
        import resource

        seconds, size = int(budget.seconds), int(budget.memory * 1e6)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
        resource.setrlimit(resource.RLIMIT_AS, (size, size))


def _main() -> None:
    """Run what standard input names; what it returned or refused goes to standard output."""
    budget, function, args, kwargs = pickle.load(sys.stdin.buffer)
    _restrict(budget)
    try:
        answer = {"text": function(*args, **kwargs)}
    except InputError as error:
        answer = {"refused": str(error)}
    sys.stdout.buffer.write(json.dumps(answer).encode())


if __name__ == "__main__":
    _main()
