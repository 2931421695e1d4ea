"""Compiles C sources into shared libraries with the C compiler of this machine."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from bellcrank.errors import BellcrankError
from bellcrank.files.temporaries import temporary_folder

FLAGS = ("-O3", "-march=native", "-fno-math-errno")
HEADERS = Path(__file__).parent


def shared_library(source: Path, options: Sequence[str] = ()) -> ctypes.CDLL:
    """Compile a C source with FLAGS and other options, and load it; this folder is searched for headers.

    Raises BellcrankError if there is no C compiler, or if it fails.
    """
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise BellcrankError("no C compiler: install gcc or cc")
    with temporary_folder("bench") as folder:
        built = folder / f"{source.stem}.so"
        files = ["-shared", "-fPIC", str(source), "-o", str(built), "-lm"]
        command = [compiler, *FLAGS, *options, f"-I{HEADERS}", *files]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise BellcrankError(f"the C compiler failed: {(done.stderr.splitlines() or [str(done.returncode)])[0]}")
        return ctypes.CDLL(str(built))
