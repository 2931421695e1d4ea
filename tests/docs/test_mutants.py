"""Mutants: small faults that are drawn from the physics code, to find out whether tests notice them."""

import ast
from pathlib import Path

import mutant_cpp_places
import mutant_places
import pytest
from mutant_runs import ROOT, installed
from mutants import Results, equivalent, selection

COUNT, CPP = 40, 8

pytestmark = pytest.mark.tier2


@pytest.fixture(scope="module")
def streams():
    """The streams of a seed, of one room of Python and of all of C++."""
    python = [
        mutant
        for path in (installed() / "motion").glob("*.py")
        for mutant in mutant_places.places_in(path.read_text("utf-8"), f"motion/{path.name}")
    ]
    cpp = mutant_cpp_places.cpp_places(ROOT / "src" / "cpp")
    return lambda seed: [(mutant_places.drawn(python, seed), COUNT - CPP), (mutant_places.drawn(cpp, seed), CPP)]


@pytest.fixture(scope="module")
def mutants(streams):
    return selection(streams(1), Results(None))


def text_of(mutant) -> str:
    folder = ROOT / "src" / "cpp" if mutant.is_cpp else installed()
    return Path(folder, mutant.file).read_text("utf-8")


def named(text: str, find=mutant_places.places_in) -> set[str]:
    return {mutant.name.partition(" ")[2] for mutant in find(text, "room/file")}


def test_a_seed_draws_the_same_mutants_and_another_seed_others(streams, mutants):
    assert selection(streams(1), Results(None)) == mutants
    others = {m.name for m in selection(streams(2), Results(None))}
    assert len(others & {m.name for m in mutants}) < COUNT / 4


def test_places_are_in_all_rooms_that_compute():
    rooms = {mutant.room for mutant in mutant_places.python_places(installed())}
    assert rooms == {*mutant_places.ROOMS, *mutant_places.SOME_OF, "numerics"}


def test_a_change_of_the_code_leaves_the_mutants_of_the_rest():
    text = "".join(f"x{k} = y{k} + z{k}\n" for k in range(50))
    first = mutant_places.drawn(mutant_places.places_in(text, "a.py"), 3)["sign"]
    later = mutant_places.drawn(mutant_places.places_in("w = u - v\n" + text, "a.py"), 3)["sign"]
    assert [m.source for m in later if m.source != "w = u - v"] == [m.source for m in first]
    assert [m.source for m in first] != text.splitlines()


def test_kinds_and_languages_are_drawn_in_the_numbers_that_are_asked_for(mutants):
    assert len({m.name for m in mutants}) == COUNT
    for is_cpp, count in ((False, COUNT - CPP), (True, CPP)):
        some = [m.kind for m in mutants if m.is_cpp == is_cpp]
        assert {kind: some.count(kind) for kind in mutant_places.KINDS} == dict.fromkeys(mutant_places.KINDS, count / 4)


def test_a_mutant_differs_from_its_file_in_one_place_alone(mutants):
    for mutant in mutants:
        before = text_of(mutant)
        after = mutant.applied(before)
        assert after != before and after[: mutant.start] == before[: mutant.start]
        assert after[mutant.start + len(mutant.after) :] == before[mutant.end :]
        assert before.splitlines()[mutant.line - 1] == mutant.source


def test_a_mutant_of_python_is_another_program_that_parses(mutants):
    for mutant in (m for m in mutants if not m.is_cpp):
        before = text_of(mutant)
        assert ast.dump(ast.parse(mutant.applied(before))) != ast.dump(ast.parse(before))


def test_an_incompetent_mutant_is_drawn_again_from_the_same_kind(streams, mutants):
    results = Results(None)
    results.add(mutant=mutants[0].name, tier=1, outcome="incompetent")
    again = selection(streams(1), results)
    assert mutants[0] not in again and len(again) == COUNT
    assert [m.kind for m in again] == [m.kind for m in mutants]


def test_equivalent_mutants_are_places_of_the_code_and_are_not_drawn(mutants):
    known = equivalent()
    folders = {False: installed(), True: ROOT / "src" / "cpp"}
    for (file, before, after), reason in known.items():
        is_cpp, name = file.startswith("cpp/"), file.removeprefix("cpp/")
        places = mutant_cpp_places.cpp_places_in if is_cpp else mutant_places.places_in
        text = (folders[is_cpp] / name).read_text("utf-8")
        assert (file, before, after) in {m.change for m in places(text, name)}, "the code has changed: is it still so?"
        assert reason.endswith(".") and before != after
    assert not known.keys() & {m.change for m in mutants}


def test_python_places_have_each_kind_of_fault():
    text = "def f(a: int, x):\n    return a[0] + -x * 0.5 if max(a[1:], axis=0) < 2 and x else 0\n"
    assert named(text) == {
        'sign "+" -> "-"', 'sign "-" -> ""', 'factor "-x * 0.5" -> "-x * 0.5 * 2"', 'factor "0.5" -> "1.0"',
        'index "0" -> "1"', 'index "0" -> "-1"', 'index "1" -> "2"', 'index "1" -> "0"', 'comparison "max" -> "min"',
        'comparison "<" -> "<="', 'factor "2" -> "3"', 'comparison "and" -> "or"', 'factor "0" -> "1"',
    }  # fmt: skip


def test_texts_annotations_and_messages_are_no_places():
    text = '''
"""A sum: 1 + 2."""
__all__ = [1]
x: tuple[Literal[3], int]

@cache(4)
def f(a: NDArray[5], b: str = "1 + 2") -> list[6]:
    """Not 1 + 2 either."""
    arguments.number("a", a, above=7)
    if a is None:
        raise InputError(f"{a[8]}" + b * 9)
    return f"{a[1] + 2:.3f}"

def __repr__(self):
    return self.text[10:]
'''
    assert named(text) == set()


def test_cpp_places_pass_over_comments_templates_loops_and_declarations():
    text = """#include "a + b"  // a + b
template <int n, int m = n + 1>
double f(const std::array<double, 3>& a) {  /* a * b
  a < b */
  double c[4] = {}, d[5];
  for (std::size_t i = 0; i < n; ++i) c[2] += a[i] * 2.0;
  return c[1] < d[i - 1] ? -d[i] : g("1 + 2", c);
}
"""
    assert named(text, mutant_cpp_places.cpp_places_in) == {
        'factor "0" -> "1"', 'index "2" -> "3"', 'index "2" -> "1"', 'sign "+=" -> "-="', 'factor "*" -> "* 2 *"',
        'factor "2.0" -> "4.0"', 'index "1" -> "2"', 'index "1" -> "0"', 'comparison "<" -> "<="', 'sign "-" -> "+"',
        'sign "-" -> ""',
    }  # fmt: skip
