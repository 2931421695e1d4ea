"""Reads YAML: the mapping of a file, or one value of a command-line argument.

Duplicate keys are refused, and the line of each key is kept. An error message is one line. The number of entries, the
depth and the length of texts are limited; entries repeated by aliases (*NAME, <<) count each time they are repeated.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from bellcrank.config.units import decimal_comma
from bellcrank.errors import InputError
from bellcrank.files.access import MOST_YAML, read_text
from bellcrank.messages import format_value

MOST_ENTRIES = 1_000_000  # keys, values and entries of lists: tables of 100,000 rows of ten
MOST_REPEATED = 100_000  # of them by aliases
MOST_DEPTH = 100
MOST_LETTERS = 100_000  # of a text
MOST_DIGITS = 400  # of a number: 1e308 written out has 309
_DAMAGE = (ValueError, OverflowError, TypeError, KeyError, IndexError, AttributeError)  # of YAML's own readers
# What PyYAML says, and what is said instead; what it quotes from the file is left out.
_PLAIN = (
    (re.compile(r"found character '\\t'"), "a tab is used for indentation; use spaces"),
    (re.compile(r"found character '(.)' that cannot"), r"a value cannot begin with '\1'; put it in quotes"),
    (re.compile(r"expected <block end>|expected <block mapping"),
     "the indentation differs from the lines above; indent the entries of a mapping or list alike"),
    (re.compile(r"mapping values are not allowed"),
     "unexpected ': '; check the indentation, write one 'key: value' a line, and put a text with ': ' in quotes"),
    (re.compile(r"could not find expected ':'"), "the ':' after the key is missing; write 'key: value'"),
    (re.compile(r"expected ',' or '([]}])'"),
     r"the '\1' that closes a list or mapping is missing, or a ',' before an entry"),
    (re.compile(r"expected the node content"), "a value is missing before a bracket or comma"),
    (re.compile(r"unexpected end of stream"), "the closing quote of a text is missing"),
    (re.compile(r"unknown escape character"),
     "unknown escape sequence after a backslash; use single quotes, or write the backslash twice"),
    (re.compile(r"found another document"), "a second document begins here with '---'; expected one"),
    (re.compile(r"found undefined alias"),
     "an alias (*NAME) repeats a value that no anchor (&NAME) marks; put a text that begins with * in quotes"),
    (re.compile(r"second occurrence|duplicate anchor"), "the same anchor (&NAME) is used twice"),
    (re.compile(r"determine a constructor for the tag"), "unknown tag (!NAME); remove it, or put the text in quotes"),
    (re.compile(r"unhashable key"), "expected a string key; put it in quotes"),
    (re.compile(r"expected <document start>"), "unexpected text after the end of the value"),
)  # fmt: skip


class Lines(dict[str, Any]):
    """A mapping read from YAML that remembers the line of each key (from 1)."""

    lines: dict[str, int]


def read_yaml(path: str | Path) -> Mapping[str, Any]:
    """The top mapping of a YAML file. Raises InputError, with the line, for anything else."""
    data = _value(read_text(path, MOST_YAML), str(path), lines=True)
    if data is None:
        raise InputError(f"{path}: expected a mapping of keys to values, found an empty file")
    if not isinstance(data, dict):
        kind = format_value(data) if isinstance(data, list) else "a text" if isinstance(data, str) else "one value"
        raise InputError(f"{path}: expected a mapping of keys to values, found {kind}")
    return data


def read_value(text: str, where: str) -> Any:
    """The value of an argument written as YAML. Raises InputError, which begins with `where`, for invalid YAML."""
    return _value(text, where, lines=False)


def _value(text: str, where: str, lines: bool) -> Any:
    import yaml

    try:
        loader = _loader()(text)
        try:
            return loader.get_single_data()
        finally:
            loader.dispose()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f" (line {mark.line + 1})" if mark and lines else ""
        problem = _plain(" ".join(str(error.problem or "it cannot be read").split()))
        raise InputError(f"{where}{line}: not valid YAML: {problem}") from None
    except yaml.YAMLError as error:
        raise InputError(f"{where}: not valid YAML: {' '.join(str(error).split())[:200]}") from None
    except RecursionError:
        raise InputError(f"{where}: not valid YAML: nested too deeply") from None


def _plain(problem: str) -> str:
    """What is wrong in plain words, and how to write it."""
    for pattern, words in _PLAIN:
        found = pattern.search(problem)
        if found is not None:
            return found.expand(words)
    return problem


@cache
def _loader() -> Callable[[str], Any]:
    """The YAML loader class; PyYAML is imported when it is first needed."""
    import yaml

    def refuse(problem: str, node: Any) -> yaml.MarkedYAMLError:
        return yaml.constructor.ConstructorError(None, None, problem, node.start_mark)

    class Loader(yaml.SafeLoader):
        """SafeLoader with limits."""

        def __init__(self, text: str) -> None:
            super().__init__(text)
            self._depth = self._deepest = 0
            self._written = self._repeated = 0
            self._anchored: dict[str, tuple[int, int]] = {}  # entries and depth of what has a name

        def fetch_flow_collection_start(self, token: Any) -> None:
            """A bracket. The scanner's time grows fast with hundreds of nested ones."""
            if self.flow_level >= MOST_DEPTH:
                raise yaml.scanner.ScannerError(None, None, f"nested more than {MOST_DEPTH} deep", self.get_mark())
            super().fetch_flow_collection_start(token)

        def compose_node(self, parent: Any, index: Any) -> Any:
            """A node, after a check of the limits."""
            event: Any = self.peek_event()  # type: ignore[no-untyped-call]
            if isinstance(event, yaml.AliasEvent):
                self._repeat(event)
                return super().compose_node(parent, index)
            self._written += 1
            before, deepest = self._written + self._repeated, self._deepest
            self._depth += 1
            self._deepest = self._depth
            if self._depth > MOST_DEPTH:
                raise refuse(f"nested more than {MOST_DEPTH} deep", event)
            if self._written > MOST_ENTRIES:
                raise refuse(f"more than {MOST_ENTRIES} entries", event)
            if isinstance(event, yaml.ScalarEvent) and len(event.value) > MOST_LETTERS:
                raise refuse(f"a text of more than {MOST_LETTERS} characters", event)
            node = super().compose_node(parent, index)
            if event.anchor is not None:
                size = self._written + self._repeated - before + 1
                self._anchored[event.anchor] = (size, self._deepest - self._depth + 1)
            self._deepest = max(deepest, self._deepest)
            self._depth -= 1
            return node

        def _repeat(self, event: Any) -> None:
            if event.anchor not in self._anchored:
                if event.anchor in self.anchors:
                    raise refuse("an alias repeats a value that contains the alias itself", event)
                return
            size, height = self._anchored[event.anchor]
            self._repeated += size
            self._deepest = max(self._deepest, self._depth + height)
            if self._repeated > MOST_REPEATED:
                raise refuse(
                    f"aliases repeat more than {MOST_REPEATED} entries; write them out, or leave some out", event
                )
            if self._deepest > MOST_DEPTH:
                raise refuse(f"nested more than {MOST_DEPTH} deep by aliases", event)

    def mapping(loader: Any, node: Any) -> Iterator[Lines]:
        result = Lines()
        result.lines = {}
        yield result
        if not isinstance(node, yaml.MappingNode):
            raise refuse("a value does not fit its type", node)
        own = [(key, value) for key, value in node.value if key.tag != "tag:yaml.org,2002:merge"]
        seen: dict[Any, int] = {}
        before = ""
        for key_node, value_node in own:
            key = loader.construct_object(key_node, deep=True)
            if node.flow_style and value_node.value == "" and (pointed := decimal_comma(f"{before},{key_node.value}")):
                raise refuse(f"a comma in a number separates entries here; write {pointed}", key_node)
            before = value_node.value if isinstance(value_node, yaml.ScalarNode) else ""
            line = key_node.start_mark.line + 1
            if not isinstance(key, str):
                raise refuse(f"expected a string key, found {format_value(key)}; put it in quotes", key_node)
            if key in seen:
                raise refuse(f"duplicate key '{key}' (first on line {seen[key]})", key_node)
            seen[key] = line
        loader.flatten_mapping(node)
        for key_node, value_node in node.value:
            key = loader.construct_object(key_node, deep=True)
            result[str(key)] = loader.construct_object(value_node, deep=True)
            result.lines[str(key)] = key_node.start_mark.line + 1

    def checked(construct: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
        def value(loader: Any, node: Any) -> Any:
            if isinstance(node.value, str) and len(node.value) > MOST_DIGITS:
                raise refuse(f"a number of more than {MOST_DIGITS} characters", node)
            try:
                return construct(loader, node)
            except _DAMAGE:
                raise refuse("a value does not fit its type", node) from None

        return value

    safe: Any = yaml.SafeLoader
    Loader.add_constructor("tag:yaml.org,2002:map", mapping)
    Loader.add_constructor("tag:yaml.org,2002:timestamp", safe.construct_yaml_str)
    for kind in ("int", "float", "bool", "null"):
        Loader.add_constructor(f"tag:yaml.org,2002:{kind}", checked(getattr(safe, f"construct_yaml_{kind}")))
    return Loader
