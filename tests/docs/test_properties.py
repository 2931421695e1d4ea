"""The page "What is tested where" names tests that exist, in the column of their tier, and leaves out no test file."""

import ast
import functools
import re
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
ROOT = TESTS.parent
PAGE = ROOT / "docs" / "properties.md"
HEADER = "| property (claim) | first tier | second tier |"
NAMED = re.compile(r"`tests/([\w/.]+)((?:::\w+)*)`")


def rows(text):
    """Cells of the tables: the claim, the tests of the first tier, the tests of the second tier."""
    lines = [line for line in text.splitlines() if line.startswith("| ") and line != HEADER]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def marked_tier2(node):
    """Whether `pytest.mark.tier2` is in this code."""
    return any(isinstance(part, ast.Attribute) and part.attr == "tier2" for part in ast.walk(node))


def tier_of(node, cases):
    """{1}, {2}, or both where some cases of a test are of the second tier; None where its marks do not say."""
    tier = None
    for mark in node.decorator_list:
        if "parametrize" not in ast.unparse(mark):
            if marked_tier2(mark):
                return {2}
        elif marked_tier2(mark) or any(isinstance(part, ast.Name) and part.id in cases for part in ast.walk(mark)):
            tier = {1, 2}
    return tier


def tiers_in(body, tier=None, cases=frozenset(), prefix=""):
    """Name, such as Class::test_this, -> tiers of the tests of a module or class."""
    found = {}
    for node in body:
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
            found[prefix + node.name] = tier or tier_of(node, cases) or {1}
        elif isinstance(node, ast.ClassDef):
            found |= tiers_in(node.body, tier or tier_of(node, cases), cases, f"{prefix}{node.name}::")
    return found


@functools.cache
def tiers_of_file(path):
    """The tests of a file of Python, with those that its classes inherit from tests/machines/properties."""
    body = ast.parse(path.read_text(encoding="utf-8")).body
    marked = {
        target
        for node in body
        if isinstance(node, ast.Assign) and marked_tier2(node.value)
        for target in map(ast.unparse, node.targets)
    }
    tier = {2} if "pytestmark" in marked else None
    found = tiers_in(body, tier, marked)
    for node in body:
        for base in node.bases if isinstance(node, ast.ClassDef) else ():
            for name, own in properties_of_machines().get(ast.unparse(base), {}).items():
                found[f"{node.name}::{name}"] = tier or tier_of(node, marked) or own
    return found


@functools.cache
def properties_of_machines():
    """Class -> its tests."""
    files = (TESTS / "machines" / "properties").glob("*.py")
    classes = [node for path in files for node in ast.parse(path.read_text("utf-8")).body]
    return {node.name: tiers_in(node.body) for node in classes if isinstance(node, ast.ClassDef)}


def tiers_of_name(file, name):
    """Tiers of what a cell names: a test, or all tests of a file; raises LookupError where it is not there."""
    path = TESTS / file
    if not path.is_file():
        raise LookupError(f"there is no tests/{file}")
    if path.suffix == ".cpp":
        return {2}  # tests/cpp/test_cpp.py runs it
    found = tiers_of_file(path)
    if name:
        return found[name.removeprefix("::")]
    return set().union(*found.values())


def test_each_named_test_exists_and_stands_in_the_column_of_its_tier():
    wrong = []
    for claim, *columns in rows(PAGE.read_text(encoding="utf-8")):
        for column, cell in enumerate(columns, 1):
            for file, name in NAMED.findall(cell):
                try:
                    if column not in tiers_of_name(file, name):
                        wrong.append(f"{claim}: tests/{file}{name} is not of tier {column}")
                except LookupError:
                    wrong.append(f"{claim}: there is no tests/{file}{name}")
    assert not wrong, "\n".join(wrong)


def test_each_property_has_a_test_and_nothing_else_stands_in_its_cells():
    page = rows(PAGE.read_text(encoding="utf-8"))
    assert len(page) > 100
    for row in page:
        assert len(row) == 3, row
        assert any(NAMED.search(cell) for cell in row[1:]), f"no test: {row[0]}"
        for cell in row[1:]:
            assert not NAMED.sub("", cell).replace("<br>", "").strip(), cell


def test_each_file_of_tests_is_on_the_page():
    named = {file for file, _ in NAMED.findall(PAGE.read_text(encoding="utf-8"))}
    there = {str(path.relative_to(TESTS)) for kind in ("py", "cpp") for path in TESTS.rglob(f"test_*.{kind}")}
    assert there - named == set()


def test_each_guide_has_a_property():
    linked = set(re.findall(r"\]\((guide/[\w-]+\.md)\)", PAGE.read_text(encoding="utf-8")))
    assert {f"guide/{path.name}" for path in (ROOT / "docs" / "guide").glob("*.md")} - linked == set()


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("def test_a(): ...", {"test_a": {1}}),
        ("@pytest.mark.tier2\ndef test_a(): ...", {"test_a": {2}}),
        ("pytestmark = pytest.mark.tier2\ndef test_a(): ...", {"test_a": {2}}),
        (
            "@pytest.mark.parametrize('n', [1, pytest.param(2, marks=pytest.mark.tier2)])\ndef test_a(n): ...",
            {"test_a": {1, 2}},
        ),
        (
            "CASES = [1, pytest.param(2, marks=pytest.mark.tier2)]\n"
            "@pytest.mark.parametrize('n', CASES)\ndef test_a(n): ...",
            {"test_a": {1, 2}},
        ),
        ("class TestMine:\n    @pytest.mark.tier2\n    def test_a(self): ...", {"TestMine::test_a": {2}}),
    ],
    ids=["plain", "marked", "module", "some cases", "some named cases", "class"],
)
def test_tiers_are_read_from_the_marks(tmp_path, source, expected):
    (tmp_path / "test_made.py").write_text(source)
    assert tiers_of_file(tmp_path / "test_made.py") == expected
