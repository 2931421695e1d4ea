"""The machine that a figure belongs to, and the clocks: repeated calls, and new processes with an empty cache."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict
from importlib import metadata
from typing import Any

from bellcrank.codegen import llvm
from bellcrank.codegen.full_tier import wait_for_optimised_code
from bellcrank.errors import BellcrankError
from bellcrank.files.temporaries import temporary_folder


def machine_facts() -> dict[str, Any]:
    """Processor, versions and settings."""
    packages = ("libpinocchio", "casadi", "llvmlite", "numpy")
    return {
        "cpu": llvm.processor(),
        "cores": os.cpu_count(),
        "target": asdict(llvm.target()),
        "python": platform.python_version(),
        "versions": {p: metadata.version(p) for p in packages},
    }


def best_of(function: Callable[[], Any], repeats: int, seconds: float = 2.0) -> float:
    """The shortest of several timed calls of optimised code, s; it stops early once they take longer than `seconds` in
    all.
    """
    function()
    wait_for_optimised_code()
    best, begun = float("inf"), time.perf_counter()
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        end = time.perf_counter()
        best = min(best, end - start)
        if end - begun > seconds:
            break
    return best


def seconds_in_new_processes(statements: str, before: str = "") -> tuple[float, float]:
    """Seconds that statements take in a new process with an empty cache, and again in another one with that cache.

    `before` is executed before the clock starts. Raises BellcrankError if a process fails.
    """
    script = f"import time\n{before}\nbegun = time.perf_counter()\n{statements}\nprint(time.perf_counter() - begun)\n"
    with temporary_folder("bench") as folder:
        environment, seconds = {**os.environ, "BELLCRANK_CACHE": str(folder)}, []
        for _ in range(2):
            command = [sys.executable, "-c", script]
            done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
            if done.returncode:
                reason = "".join(done.stderr.strip().splitlines()[-1:])
                raise BellcrankError(f"timing '{statements.splitlines()[-1]}' in a new process failed: {reason}")
            seconds.append(float(done.stdout))
    return seconds[0], seconds[1]
