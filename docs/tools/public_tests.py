"""How many test functions go through the public face alone: names of `bellcrank` and its `results`, and the command.

A test does if neither it, nor what it uses of its own file, names anything else of the package. Fixtures and helpers of
other files are not followed.

python docs/tools/public_tests.py           # the share, by folder
python docs/tools/public_tests.py --list    # and each test that does not
"""

from __future__ import annotations

import argparse
import ast
from collections import Counter
from pathlib import Path

import bellcrank as bc

TESTS = Path(__file__).resolve().parents[2] / "tests"
PUBLIC = {*bc.__all__, *bc.results.__all__}
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)


def inner_names(tree: ast.Module) -> set[str]:
    """The names under which a file knows what is not public."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "bellcrank" and node.module:
            if node.module == "bellcrank.cli":  # the command
                continue
            of_package = node.module == "bellcrank"
            found |= {a.asname or a.name for a in node.names if of_package or a.name not in PUBLIC}
        elif isinstance(node, ast.Import):
            found |= {a.asname for a in node.names if a.asname and a.name.startswith("bellcrank.")}
    return found - {"bc"}


def used_names(node: ast.AST) -> set[str]:
    """The names that a piece of code uses, and the fixtures that a function asks for."""
    found = {each.id for each in ast.walk(node) if isinstance(each, ast.Name)}
    return found | {
        argument.arg for each in ast.walk(node) if isinstance(each, FUNCTIONS) for argument in each.args.args
    }


def tests_of(path: Path) -> dict[str, bool]:
    """Each test of a file, and whether it goes through public names alone."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    inner = inner_names(tree)
    own: dict[str, set[str]] = {}
    for node in tree.body:
        if isinstance(node, (*FUNCTIONS, ast.ClassDef)):
            own[node.name] = used_names(node)
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            own |= {
                each.id: used_names(node)
                for target in targets
                for each in ast.walk(target)
                if isinstance(each, ast.Name)
            }

    def reached(names: set[str], seen: set[str]) -> set[str]:
        for name in names - seen:
            seen.add(name)
            if name in own:
                reached(own[name], seen)
        return seen

    found = {}
    for node in ast.walk(tree):
        if isinstance(node, FUNCTIONS) and node.name.startswith("test_"):
            found[node.name] = not reached(used_names(node), set()) & inner
    return found


def main() -> None:
    """Prints the share of each folder and of all."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--list", action="store_true", help="each test that uses other names")
    listing = parser.parse_args().list
    every, public = Counter[str](), Counter[str]()
    for path in sorted([*TESTS.rglob("test_*.py"), *(TESTS / "machines" / "properties").glob("*.py")]):
        folder = path.relative_to(TESTS).parts[0]
        for name, goes in tests_of(path).items():
            every[folder] += 1
            public[folder] += goes
            if listing and not goes:
                print(f"{path.relative_to(TESTS)}::{name}")
    for folder, count in every.items():
        print(f"{folder:<24}{public[folder]:>6} of {count:>5}{public[folder] / count:>8.0%}")
    print(f"{'all':<24}{public.total():>6} of {every.total():>5}{public.total() / every.total():>8.0%}")


if __name__ == "__main__":
    main()
