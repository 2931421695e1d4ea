"""Places of the C++ where a small fault can be put: the same kinds of mutants as in mutant_places.py.

Tokens of lines are enough, since the sources are formatted: operators of two operands have spaces around them, and
brackets of templates have none.
"""

from __future__ import annotations

import re
from pathlib import Path

from mutant_places import SWAPPED, Mutant, scaled

CPP_ROOMS = {"integrator": "_step", "planner": "_planner", "tracer": "_trace", "codegen": "_codegen"}  # to extensions
BLANKED = re.compile(  # comments, texts, and lines of the preprocessor: nothing is sought in them
    r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])+\'|^[ \t]*#(?:\\\n|[^\n])*', re.S | re.M
)
ARGUMENTS = re.compile(r"(?<=\w)<[^<>;(){}=]*>")  # of templates, the innermost
STATEMENTS = re.compile(  # which compute nothing at run time
    r"^[^\n]*\b(?:template|static_assert|using|throw|operator|enum|typedef|m\.def|nb::arg|alignas)\b[^\n]*", re.M
)
DECLARED = re.compile(  # arrays and their sizes
    r"\b(?:double|int|bool|char|std::\w+) \w+(?:\[[^\]\n]*\])+(?: = \{\})?(?:, \w+(?:\[[^\]\n]*\])+)*"
)
LOOP = re.compile(r"\bfor \([^;\n]*;([^;\n]*);")  # a loop that goes too far reads any memory: its end is left alone
NUMBER = re.compile(r"(?<![\w.])(?:\d+\.\d*(?:e[+-]?\d+)?|\d+e[+-]?\d+|\d+)(?![\w.])")
CPP_PLACES = (
    ("sign", re.compile(r"(?<= )[+-](?= )|(?<= )[+-]=(?= )")),
    ("sign", re.compile(r"(?<=[(\[,?:] )-(?=[\w(])|(?<=[(\[])-(?=[\w(])|(?<=return )-(?=[\w(])|(?<== )-(?=[\w(])")),
    ("comparison", re.compile(r"(?<= )(?:<=|>=|==|!=|<|>|&&|\|\|)(?= )|(?<=std::)(?:min|max)\b")),
    ("factor", re.compile(r"(?<= )\*(?= )")),
    ("factor", NUMBER),
)


def cpp_places(sources: Path) -> list[Mutant]:
    """One mutant of each place of src/cpp; the bindings to Python (module.cpp) are left alone."""
    files = [path for room in CPP_ROOMS for path in (sources / room).glob("*.[ch]pp") if path.name != "module.cpp"]
    return [m for path in sorted(files) for m in cpp_places_in(path.read_text("utf-8"), str(path.relative_to(sources)))]


def cpp_places_in(text: str, file: str) -> list[Mutant]:
    """One mutant of each place of a C++ text."""
    seen = text
    for pattern in (BLANKED, STATEMENTS, DECLARED):
        seen = pattern.sub(_blank, seen)
    before = ""
    while before != seen:
        before, seen = seen, ARGUMENTS.sub(_blank, seen)
    found = []

    def add(kind: str, start: int, end: int, after: str) -> None:
        begin = text.rfind("\n", 0, start) + 1
        line = text.count("\n", 0, start) + 1
        source = text[begin : text.find("\n", begin)]
        found.append(Mutant(kind, file, line, start, end, after, source, start - begin))

    ends = [m.span(1) for m in LOOP.finditer(seen)]
    brackets = [m.span(1) for m in re.finditer(r"(?<=[\w)\]])\[([^\[\]\n]*)\]", seen)]
    for kind, pattern in CPP_PLACES:
        for match in pattern.finditer(seen):
            start, end, symbol = *match.span(), match[0]
            inside = any(low <= start < high for low, high in brackets)
            if pattern is NUMBER and inside and symbol.isdigit():
                add("index", start, end, str(int(symbol) + 1))
                if int(symbol):
                    add("index", start, end, str(int(symbol) - 1))
            elif pattern is NUMBER:
                add(kind, start, end, str(int(symbol) + 1 if symbol.isdigit() else scaled(float(symbol))))
            elif kind == "factor":
                if not inside:
                    add(kind, start, end, "* 2 *")
            elif kind == "sign" and symbol == "-" and text[end] != " ":
                add(kind, start, end, "")
            elif kind != "comparison" or not any(low <= start < high for low, high in ends):
                add(kind, start, end, SWAPPED[symbol])
    return found


def _blank(match: re.Match[str]) -> str:
    return re.sub(r"[^\n]", " ", match[0])
