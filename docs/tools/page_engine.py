"""Compile the explicit integrator to WebAssembly, for pages that compute a run: `python docs/tools/page_engine.py`.

It needs the extra `engine` (a compiler and a C++ library for WebAssembly, from pip). The module carries the hash of its
sources; `--check` compiles again and compares.
"""

from __future__ import annotations

import argparse
import hashlib
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "src/cpp/integrator/page_engine.cpp"
MODULE = ROOT / "src/bellcrank/replays/page/assets/page_engine.wasm"
FLAGS = (
    "-target", "wasm32-wasi", "-mexec-model=reactor", "-std=c++20", "-Os", "-g0", "-w", "-fno-math-errno",
    "-fno-exceptions", "-fno-rtti", "-Wl,--export-table", "-Wl,--growable-table", "-Wl,--strip-all",
)  # fmt: skip
SECTION = b"\x07sources"  # the name of the custom section, after its length
_INCLUDE = re.compile(r'#include "([^"]+)"')


def sources_hash() -> str:
    """The hash of the source, of all that it includes, and of how it is compiled."""
    waiting, found = [SOURCE], dict[str, str]()
    while waiting:
        file = waiting.pop()
        if file.name not in found:
            found[file.name] = text = file.read_text("utf-8")
            waiting += [file.parent / name for name in _INCLUDE.findall(text)]
    return hashlib.sha256(repr((sorted(found.items()), FLAGS)).encode()).hexdigest()


def stored_hash(module: bytes) -> str:
    """The hash that a module carries; empty where it has none."""
    before, there, rest = module.rpartition(SECTION)
    return rest.decode() if there and before else ""


def compiled() -> bytes:
    """The module, with the hash of its sources in a custom section at its end."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "engine.wasm"
        command = [sys.executable, "-m", "ziglang", "c++", *FLAGS, SOURCE.name, "-o", str(out)]
        subprocess.run(command, check=True, cwd=SOURCE.parent)
        section = SECTION + sources_hash().encode()
        return out.read_bytes() + bytes([0, len(section)]) + section


def main() -> int:
    """Write the module, or compare it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="compile and compare, and write nothing")
    check, made = parser.parse_args().check, compiled()
    if not check:
        MODULE.write_bytes(made)
        print(f"{MODULE.relative_to(ROOT)}: {len(made)} bytes")
        return 0
    if MODULE.read_bytes() == made:
        return 0
    print(f"{MODULE.relative_to(ROOT)} is not what its sources give; run python {Path(__file__).relative_to(ROOT)}")
    return 1


if __name__ == "__main__":
    sys.exit(main())
