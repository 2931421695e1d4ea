"""The size of the code: its lines, its rooms, the files that a first call enters, and circles of imports.

python docs/tools/house.py             # the table
python docs/tools/house.py --modules   # and the short modules with one importer, which could belong to it
"""

from __future__ import annotations

import argparse
import ast
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import grimp

PACKAGE = Path(__file__).resolve().parents[2] / "src" / "bellcrank"
SHORT = 110  # lines: a shorter module with one importer could be a part of it
CALLS = {
    "simulate": 'bc.simulate("four_bar")',
    "size": 'bc.size("ur5")',
    "select": 'bc.select("geared_pendulum")',
    "sweep": 'bc.sweep("four_bar", {"crank_length": "1.21:1.24:3"})',
    "time_optimal": 'bc.time_optimal("planar_2r", "elbow_up")',
}
ENTERED = """
import importlib, pkgutil, sys, threading
import bellcrank as bc
for module in pkgutil.walk_packages(bc.__path__, "bellcrank."):  # so that no import is counted as a call
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
places = set()
def note(frame, event, argument):
    if event == "call":
        places.add((frame.f_code.co_filename, frame.f_code.co_qualname))
threading.setprofile(note)
sys.setprofile(note)
CALL
sys.setprofile(None)
inside = {(file, name) for file, name in list(places) if "/src/bellcrank/" in file}
print(len({file for file, name in inside}), len(inside))
"""


def texts() -> dict[str, str]:
    """Module -> its text, of the whole package."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path.read_text(encoding="utf-8")
    return found


def docstring_lines(tree: ast.Module) -> int:
    """The lines of all docstrings of a module."""
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    lines = 0
    for node in ast.walk(tree):
        if isinstance(node, documented) and ast.get_docstring(node, clean=False) is not None:
            lines += (node.body[0].end_lineno or 0) - node.body[0].lineno + 1
    return lines


def imports(package: str = PACKAGE.name) -> grimp.ImportGraph:
    """Which module imports which at run time, also inside functions."""
    return grimp.build_graph(package, exclude_type_checking_imports=True, cache_dir=None)


def circles(graph: grimp.ImportGraph) -> list[list[str]]:
    """The sets of modules that reach each other through imports."""
    below = {module: graph.find_upstream_modules(module) for module in graph.modules}
    rings = {frozenset({m, *(other for other in upstream if m in below[other])}) for m, upstream in below.items()}
    return sorted((sorted(ring) for ring in rings if len(ring) > 1), key=len)


def entered(call: str) -> tuple[int, int]:
    """How many files and functions of the package a call enters in a fresh process with an empty cache."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"BELLCRANK_CACHE": f"{folder}/cache", "PYTHONDONTWRITEBYTECODE": "1"}
        done = subprocess.run(
            [sys.executable, "-c", ENTERED.replace("CALL", call)],
            cwd=folder, env=environment, capture_output=True, text=True, check=True,
        )  # fmt: skip
    files, functions = done.stdout.split()[-2:]
    return int(files), int(functions)


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--modules", action="store_true", help="list the short modules with one importer")
    parser.add_argument("--no-calls", action="store_true", help="leave out the calls, which take a minute")
    arguments = parser.parse_args()
    modules = texts()
    lines = {module: text.count("\n") for module, text in modules.items()}
    trees = {module: ast.parse(text) for module, text in modules.items()}
    statements = {module: sum(isinstance(node, ast.stmt) for node in ast.walk(tree)) for module, tree in trees.items()}
    graph = imports()
    importers = {module: graph.find_modules_that_directly_import(module) for module in modules}
    short = {module: users for module, users in importers.items() if len(users) == 1 and 0 < lines[module] < SHORT}

    print(f"{'room':<14}{'files':>7}{'lines':>9}{'statements':>12}{'short, one importer':>21}")
    rooms = sorted({module.split(".")[1] for module in modules if "." in module})
    rows = {room: {m for m in modules if m.split(".")[1:2] == [room]} for room in rooms}
    large = {room: held for room, held in rows.items() if len(held) > 1}
    for room, held in (large | {"all": set(modules)}).items():
        row = (len(held), sum(lines[m] for m in held), sum(statements[m] for m in held), len(held & short.keys()))
        print(f"{room:<14}{row[0]:>7}{row[1]:>9,}{row[2]:>12,}{row[3]:>21}")
    total = sum(lines.values())
    print(f"\nlines of docstrings: {sum(map(docstring_lines, trees.values())) / total:.1%}")
    print(f"modules with one importer: {sum(len(users) == 1 for users in importers.values())}")
    rings = circles(graph)
    print(f"circles of files at run time: {len(rings)}")
    for ring in rings:
        print(f"  {len(ring)}: {', '.join(ring)}")
    if arguments.modules:
        for module, users in sorted(short.items()):
            (user,) = users
            print(f"  {module} ({lines[module]}) -> {user} ({lines[user]})")
    if not arguments.no_calls:
        print(f"\n{'a first call':<14}{'files':>7}{'functions':>12}")
        for name, call in CALLS.items():
            files, functions = entered(call)
            print(f"{name:<14}{files:>7}{functions:>12}")


if __name__ == "__main__":
    main()
