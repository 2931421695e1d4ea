"""Public names are documented: arguments, results, errors and an example; the examples run."""

import ast
import doctest
import inspect
import re
import textwrap
from dataclasses import fields, is_dataclass

import numpy as np
import pytest

import bellcrank as bc
from tests.support.public_names import NAMES, public

FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
SECTION = re.compile(r"^(Args|Returns|Raises|Yields|Attributes|Examples?):$", re.MULTILINE)


def members(cls):
    """(name, what was written, its docstring) of the public methods and properties of a class and of its bases here."""
    found = {}
    for base in cls.__mro__:
        if base.__module__.startswith("bellcrank."):
            for name, written in vars(base).items():
                if not name.startswith("_") and (inspect.isroutine(written) or hasattr(type(written), "__get__")):
                    found.setdefault(name, written)
    for name, written in found.items():
        yield name, getattr(written, "__func__", written), inspect.cleandoc(getattr(written, "__doc__", None) or "")


def parts(names=tuple(NAMES)):
    """(name, the function or None for what is an attribute, docstring) of each public function, method and property."""
    for name in names:
        thing = public(name)
        if not inspect.isclass(thing):
            yield name, thing, inspect.getdoc(thing) or ""
            continue
        yield name, None, inspect.getdoc(thing) or ""
        for member, written, text in members(thing):
            yield f"{name}.{member}", written if inspect.isfunction(written) else None, text


def sections(text):
    """Title -> text of the sections of a docstring."""
    pieces = SECTION.split(text)
    return dict(zip(pieces[1::2], pieces[2::2], strict=True))


def raises(function):
    """Whether a function raises by itself, or checks its arguments."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(inspect.unwrap(function))))
    return any(
        isinstance(node, ast.Raise) or (isinstance(node, ast.Attribute) and ast.unparse(node.value) == "arguments")
        for node in ast.walk(tree)
    )


def missing(names=tuple(NAMES)):
    """What the docstrings lack, one line each."""
    found = []
    for name, function, text in parts(names):
        if not text:
            found.append(f"{name}: no docstring")
            continue
        there = sections(text)
        if function is not None:
            signature = inspect.signature(function)
            wanted = [p.name for p in signature.parameters.values() if p.name not in ("self", "cls")]
            told = re.findall(r"^ {4}\*{0,2}(\w+)\b.*?:", there.get("Args", ""), re.MULTILINE)
            found += [f"{name}: argument '{each}' is not documented" for each in wanted if each not in told]
            found += [f"{name}: there is no argument '{each}'" for each in told if each not in wanted]
            result = signature.return_annotation
            if result not in (None, "None", inspect.Signature.empty) and not {"Returns", "Yields"} & there.keys():
                found.append(f"{name}: no Returns")
            if raises(function) and "Raises" not in there:
                found.append(f"{name}: no Raises")
        elif "." not in name and is_dataclass(public(name)):
            listed = [field.name for field in fields(public(name)) if not field.name.startswith("_")]
            untold = [each for each in listed if not re.search(rf"\b{each}\b", text)]
            found += [f"{name}: field '{each}' is not documented" for each in untold]
    for name in names:
        thing = public(name)
        texts = [inspect.getdoc(thing) or "", *(text for *_, text in members(thing))] if inspect.isclass(thing) else []
        if not any(">>>" in text for text in texts or [inspect.getdoc(thing) or ""]):
            found.append(f"{name}: no example")
    return found


def test_public_names_are_documented():
    found = missing()
    assert not found, "\n".join(found)


LONG = (
    "FastestMotion",
    "JointSensitivity",
    "RepeatedCycle",
    "RootLoci",
    "Selection",
    "Sizing",
    "SpeedFactor",
    "time_optimal",
)
TIERS = [pytest.param(name, marks=[pytest.mark.tier2] if name in LONG else []) for name in NAMES]


@pytest.mark.parametrize("name", TIERS)
def test_the_examples_of_a_public_name_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for part, _, text in parts([name]):
        if ">>>" in text:
            test = doctest.DocTestParser().get_doctest(text, {"bc": bc, "np": np}, part, None, 0)
            printed = []
            result = doctest.DocTestRunner(optionflags=FLAGS).run(test, out=printed.append)
            skipped = sum("SKIP" in example.source for example in test.examples)
            assert skipped == (part == "show")  # it opens a browser
            assert result.attempted >= len(test.examples) - skipped
            assert not result.failed, "".join(printed)


def test_what_is_missing_is_found(monkeypatch):
    def bare(x: int) -> int:
        """Do it."""
        if x < 0:
            raise ValueError
        return x

    monkeypatch.setattr(bc, "bare", bare, raising=False)
    lacks = ("argument 'x' is not documented", "no Returns", "no Raises", "no example")
    assert missing(["bare"]) == [f"bare: {each}" for each in lacks]
