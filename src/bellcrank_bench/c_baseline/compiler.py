"""Compiles C and C++ sources into shared libraries with the compiler of this machine."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from bellcrank.errors import BellcrankError
from bellcrank.files.temporaries import temporary_folder

FLAGS: tuple[str, ...] = ("-O3", "-march=native", "-fno-math-errno")
CPP_FLAGS = ("-O3",)  # types that are shared with a library need its alignment
HEADERS = Path(__file__).parent


def shared_library(source: Path, options: Sequence[str] = ()) -> ctypes.CDLL:
    """Compile a C or C++ source with FLAGS and other options, and load it; this folder is searched for headers.

    C++ sources have the suffix .cpp. Raises BellcrankError if there is no compiler, or if it fails.
    """
    language, names, flags = "C", ("gcc", "cc"), FLAGS
    if source.suffix == ".cpp":
        language, names, flags = "C++", ("g++", "c++"), CPP_FLAGS
    compiler = next(filter(None, map(shutil.which, names)), None)
    if compiler is None:
        raise BellcrankError(f"no {language} compiler: install {names[0]}")
    with temporary_folder("bench") as folder:
        built = folder / f"{source.stem}.so"
        files = ["-shared", "-fPIC", f"-I{HEADERS}", str(source), "-o", str(built), *options, "-lm"]
        command = [compiler, *flags, *files]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise BellcrankError(
                f"the {language} compiler failed: {(done.stderr.splitlines() or [str(done.returncode)])[0]}"
            )
        return ctypes.CDLL(str(built))
