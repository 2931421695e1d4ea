"""Strict parsing of XML with line numbers, by Python's expat: no repairs, no entities, no network; and writing it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from bellcrank.errors import InputError
from bellcrank.files.access import read_bytes

ENDS_TOO_EARLY = (3, 5, 6, 20)  # expat's codes: no element, unclosed token, partial character, unclosed CDATA
_DECLARED = re.compile(rb"\A(?:\xef\xbb\xbf)?\s*<\?xml[^>]*?encoding\s*=\s*[\"']([A-Za-z0-9._-]+)[\"']")
MOST_DEPTH = 200  # of nesting
# xml.sax.saxutils does the same, and imports Python's network modules: 25 ms of each command
_IN_TEXT = {"&": "&amp;", "<": "&lt;", ">": "&gt;"}
_ESCAPED = str.maketrans(_IN_TEXT)
_QUOTED = str.maketrans({**_IN_TEXT, '"': "&quot;", "\n": "&#10;", "\r": "&#13;", "\t": "&#9;"})


@dataclass(slots=True)
class XmlElement:
    """One XML element: tag (with its prefix, as in `xacro:macro`), attributes, children, text and line."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[XmlElement] = field(default_factory=list)
    text: str = ""

    def find(self, tag: str) -> XmlElement | None:
        """The first child of this tag, or None."""
        return next((child for child in self.children if child.tag == tag), None)

    def find_all(self, tag: str) -> list[XmlElement]:
        """All children of this tag, in the order of the file."""
        return [child for child in self.children if child.tag == tag]

    def walk(self) -> Iterator[XmlElement]:
        """This element and everything below it, in the order of the file."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            yield element
            waiting.extend(reversed(element.children))


def read_text(path: Path) -> str:
    """The text of an XML file, decoded as its declaration says (UTF-8 without one).

    Raises InputError where the file is missing, unreadable or not text.
    """
    return decoded(read_bytes(path), path)


def decoded(raw: bytes, source: Path | str) -> str:
    """The text of XML bytes, decoded as their declaration says (UTF-8 without one). Raises InputError."""
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        encoding = "utf-16"
    else:
        declared = _DECLARED.match(raw)
        encoding = declared.group(1).decode("ascii") if declared else "utf-8"
    if encoding.lower().replace("_", "-") in ("utf-8", "utf8"):
        encoding = "utf-8-sig"
    try:
        return raw.decode(encoding)
    except (UnicodeError, LookupError):
        raise InputError(
            f"{source}: is not text in the encoding {encoding.removesuffix('-sig')[:40]}; save it as UTF-8"
        ) from None


def parse_xml(text: str, source: Path | str) -> XmlElement:
    """The root element of an XML text.

    Raises InputError, naming the line, where the text is empty or not well-formed XML (truncated, mismatched
    tags, …), is nested too deeply or declares entities of its own.
    """
    if not text.strip("\ufeff \t\r\n"):
        raise InputError(f"{source}: the file is empty; an XML file with a <robot> element was expected")
    parser = expat.ParserCreate("utf-8")
    parser.buffer_text = True
    roots: list[XmlElement] = []
    open_elements: list[XmlElement] = []
    texts: list[list[str]] = []  # of the open elements, in pieces: adding to one text would copy it each time

    def start(tag: str, attributes: dict[str, str]) -> None:
        element = XmlElement(tag, attributes, parser.CurrentLineNumber)
        if len(open_elements) >= MOST_DEPTH:
            raise InputError(
                f"{source}: line {element.line}: elements are nested more than {MOST_DEPTH} deep; "
                "this is not a robot description"
            )
        (open_elements[-1].children if open_elements else roots).append(element)
        open_elements.append(element)
        texts.append([])

    def end(tag: str) -> None:
        open_elements.pop().text = "".join(texts.pop())

    def characters(data: str) -> None:
        if texts:
            texts[-1].append(data)

    def entity(*declaration: object) -> None:
        raise InputError(
            f"{source}: line {parser.CurrentLineNumber}: declares an XML entity, which is not supported; write its "
            f"text instead"
        )

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = characters
    parser.EntityDeclHandler = entity
    try:
        parser.Parse(text.encode("utf-8"), True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        where = f"{source}: line {error.lineno}"
        at_end = error.code in ENDS_TOO_EARLY
        if at_end and open_elements:
            last = open_elements[-1]
            tag = (
                f"<{last.tag}>" if roots[0].tag == "robot" else "its element"
            )  # nothing is shown of a file that is not a URDF
            raise InputError(
                f"{where}: the file ends before {tag} (line {last.line}) is closed ({reason}); is it truncated?"
            ) from None
        if at_end:
            raise InputError(f"{where}: the file ends too early ({reason}); is it truncated?") from None
        if not roots:
            raise InputError(f"{where}: is not XML ({reason}); a <robot> element was expected") from None
        raise InputError(f"{where}: is not well-formed XML ({reason}); correct it there") from None
    except UnicodeError:
        raise InputError(f"{source}: contains characters that are not valid in XML; save it as UTF-8") from None
    return roots[0]


def escaped(text: str) -> str:
    """The text as content of an element."""
    return text.translate(_ESCAPED)


def quoted(text: str) -> str:
    """The text as the value of an attribute, with its quotation marks."""
    return f'"{text.translate(_QUOTED)}"'


def xml_text(element: XmlElement) -> str:
    """The text of an element and everything below it, each in its line."""
    pieces: list[str] = []
    _write(element, pieces, 1)
    return "".join(pieces)


def _write(element: XmlElement, pieces: list[str], line: int) -> int:
    """Add the text of an element to the pieces, from this line on, each tag in its own line; the line of its end."""
    pieces.append("\n" * max(element.line - line, 0))
    line = max(line, element.line)
    attributes = "".join(f" {key}={quoted(value)}" for key, value in element.attributes.items())
    written = escaped(element.text.strip())
    if not element.children and not written:
        pieces.append(f"<{element.tag}{attributes}/>")
        return line
    pieces.append(f"<{element.tag}{attributes}>{written}")
    line += written.count("\n")
    for child in element.children:
        line = _write(child, pieces, line)
    pieces.append(f"</{element.tag}>")
    return line
