"""Elements of an MJCF file, with the files that it includes in place of <include>."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess
from bellcrank.messages import format_value, unknown_name
from bellcrank.robot.formats.xml_tree import MOST_DEPTH, XmlElement, parse_xml, read_text

LARGEST = 1e30  # of lengths, masses, inertias and other numbers
_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")


@dataclass(frozen=True)
class MjcfElement:
    """An element: tag, attributes (its own; of a resolved element those of its default class too), line and file."""

    tag: str
    attributes: Mapping[str, str]
    line: int
    source: Path
    children: tuple[MjcfElement, ...] = ()

    @property
    def name(self) -> str:
        """Its name, "" without one. Raises InputError where it cannot be printed."""
        name = self.attributes.get("name", "").strip()
        if not name.isprintable():
            raise self.fail("the name has control characters; remove them")
        return name

    def fail(self, message: str) -> InputError:
        """An InputError that names the file, the line and this element."""
        name = self.attributes.get("name", "")[:80]
        shown = f" name={name!r}" if name else ""
        return InputError(f"{self.source}: line {self.line}: <{self.tag[:80]}{shown}>: {message}")

    def find_all(self, *tags: str) -> Iterator[MjcfElement]:
        """The children of these tags, in the order of the file."""
        return (child for child in self.children if child.tag in tags)

    def walk(self) -> Iterator[MjcfElement]:
        """This element and everything below it, in the order of the file."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            yield element
            waiting.extend(reversed(element.children))

    def required(self, key: str) -> str:
        """The text of an attribute, without blanks around it. Raises InputError where it is missing."""
        text = self.attributes.get(key, "").strip()
        if not text:
            raise self.fail(f'has no {key}; give {key}="…"')
        return text

    def choice(self, key: str, default: str, *choices: str) -> str:
        """The text of an attribute, one of `choices`. Raises InputError for another text."""
        text = self.attributes.get(key, default)
        if text not in choices:
            raise self.fail(unknown_name(key, text, choices))
        return text

    def flag(self, key: str, default: bool) -> bool:
        """Whether an attribute is "true". Raises InputError for another text than true and false."""
        return self.choice(key, "true" if default else "false", "true", "false") == "true"

    def numbers(self, key: str, least: int, most: int) -> tuple[float, ...] | None:
        """The `least` to `most` numbers of an attribute, or None where it is missing. Raises InputError."""
        if key not in self.attributes:
            return None
        words = self.attributes[key].split()
        if not least <= len(words) <= most:
            expected = f"{least}" if least == most else f"{least} to {most}"
            raise self.fail(f"{key}: expected {expected} numbers, found {len(words)}")
        return tuple(self._parsed(key, word) for word in words)

    def vector(self, key: str, default: tuple[float, ...]) -> tuple[float, ...]:
        """As many numbers as the default has. Raises InputError."""
        return self.numbers(key, len(default), len(default)) or default

    def number(self, key: str, default: float, least: float = -LARGEST) -> float:
        """One number, at least `least`. Raises InputError."""
        found = self.numbers(key, 1, 1)
        if found is not None and found[0] < least:
            raise self.fail(f"{key}: is {found[0]:g}; expected {least:g} or more")
        return default if found is None else found[0]

    def _parsed(self, key: str, word: str) -> float:
        if not _NUMBER.fullmatch(word):
            raise self.fail(f"{key}: expected a number, found {format_value(word)}")
        value = float(word)
        if not abs(value) <= LARGEST:
            raise self.fail(f"{key}: {format_value(word)} is too large; expected at most {LARGEST:g}")
        return value


def read_mjcf_elements(text: str, source: Path, access: FileAccess) -> MjcfElement:
    """The root <mujoco> of an MJCF text, each <include> replaced by the children of the included file's root.

    Included names are relative to the folder of the main file, as in MuJoCo. Raises InputError.
    """
    return _Reading(access, [source]).element(parse_xml(text, source), source, 1)


@dataclass(frozen=True)
class _Reading:
    access: FileAccess
    files: list[Path]

    def element(self, element: XmlElement, source: Path, depth: int) -> MjcfElement:
        found = MjcfElement(element.tag, element.attributes, element.line, source)
        if depth > MOST_DEPTH:
            raise found.fail(f"elements are nested more than {MOST_DEPTH} deep; this is not a robot description")
        children: list[MjcfElement] = []
        for child in element.children:
            below = self.element(child, source, depth + 1)
            children.extend(self._included(below, depth) if child.tag == "include" else [below])
        return replace(found, children=tuple(children))

    def _included(self, include: MjcfElement, depth: int) -> tuple[MjcfElement, ...]:
        try:
            path = self.access.path(include.required("file"))
        except InputError as error:
            raise include.fail(str(error)) from None
        if path in self.files:
            raise include.fail(f"the file {path.name} is included already; each file can be included once")
        self.files.append(path)
        try:
            root = parse_xml(read_text(path), path)
        except InputError as error:
            raise include.fail(str(error)) from None
        return self.element(root, path, depth).children
