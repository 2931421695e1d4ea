"""What a COLLADA file holds, counted before it is read: elements, depth, the files that it names, and how often its
nodes are used. A few lines of nodes that use each other twice stand for any number of them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from xml.parsers import expat

from bellcrank.errors import InputError
from bellcrank.replays.geometry.triangle_files import MOST_TEXTURES, MeshError, too_many
from bellcrank.robot.xml_tree import decoded

MOST_ELEMENTS, MOST_DEPTH = 400_000, 250
MOST_USES = 200_000  # nodes and shapes of a scene with those that its nodes use
MOST_CHAIN = 50  # nodes that use nodes that use nodes …
_TEXTS = ("init_from", "ref", "vcount")  # elements whose text is looked at
_USES = ("instance_geometry", "instance_controller")


@dataclass
class _Node:
    """A node: how many shapes it has of its own, itself counted too, and the numbers or names of nodes that it uses."""

    own: int = 1
    uses: list[int | str] = field(default_factory=list)


class _Counter:
    """Counts what expat finds."""

    def __init__(self) -> None:
        self.elements = 0
        self.open: list[str] = []
        self.nodes = [_Node()]  # first what stands in no node
        self.within = [0]  # numbers of the nodes around, outermost first
        self.ended: list[int] = []  # numbers of nodes in the order of their ends
        self.numbers: dict[str, int] = {}  # of the nodes that have names
        self.names: dict[str, None] = {}  # of files
        self.corners = 0  # of polygons, as their counts claim
        self.text: list[str] | None = None

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        name = tag.rpartition(":")[2]
        self.elements += 1
        self.open.append(name)
        if self.elements > MOST_ELEMENTS or len(self.open) > MOST_DEPTH:
            raise MeshError(f"has more than {MOST_ELEMENTS} elements, or {MOST_DEPTH} within each other")
        around = self.nodes[self.within[-1]]
        if name in _TEXTS:
            self.text = []
        elif name == "node":
            number = len(self.nodes)
            self.nodes.append(_Node())
            around.uses.append(number)
            self.within.append(number)
            self.numbers.setdefault(attributes.get("id", ""), number)
        elif name == "instance_node":
            around.uses.append(attributes.get("url", "").removeprefix("#"))
        elif name in _USES:
            around.own += 1

    def end(self, tag: str) -> None:
        name = self.open.pop()
        if name == "node":
            self.ended.append(self.within.pop())
        elif self.text is not None and name in _TEXTS:
            text, self.text = "".join(self.text), None
            if name == "vcount":
                self.corners += sum(int(word) for word in text.split() if word.isdecimal() and len(word) < 16)
            else:
                self.names[text.strip()] = None

    def characters(self, text: str) -> None:
        if self.text is not None:
            self.text.append(text)

    def doctype(self, *_: object) -> None:
        raise MeshError("declares XML entities, which are not read")


def check_collada(data: bytes) -> tuple[str, ...]:
    """The textures that a COLLADA file names. Raises MeshError where it is not XML, or holds more than is read."""
    counter = _Counter()
    parser = expat.ParserCreate("utf-8")
    parser.buffer_text = True
    parser.StartElementHandler = counter.start
    parser.EndElementHandler = counter.end
    parser.CharacterDataHandler = counter.characters
    parser.StartDoctypeDeclHandler = counter.doctype
    try:
        parser.Parse(decoded(data, "it").encode("utf-8"), True)
    except (expat.ExpatError, InputError, UnicodeError) as error:
        raise MeshError(f"is broken (XML Parsing Error: {str(error)[:80]})") from None
    if counter.corners > len(data):  # each takes a number, and so two characters
        raise MeshError("claims more corners of polygons than it holds")
    if len(counter.names) > MOST_TEXTURES:
        raise MeshError(f"names more than the {MOST_TEXTURES} textures that are read")
    _check_uses(counter)
    return tuple(name for name in counter.names if name and not set("<>") & set(name))


def _check_uses(counter: _Counter) -> None:
    """Refuse chains of nodes that are too long, and scenes that use too many; circles are the reader's to refuse."""
    total: dict[int, int] = {}  # what a node stands for with all that it uses
    waiting = [*counter.ended, 0]
    for _ in range(MOST_CHAIN):
        left = []
        for number in waiting:
            node = counter.nodes[number]
            uses = [use if isinstance(use, int) else counter.numbers.get(use) for use in node.uses]
            known = [total.get(use) for use in uses if use is not None]
            if None in known:
                left.append(number)
            else:
                total[number] = min(node.own + sum(count or 0 for count in known), MOST_USES + 1)
        if not left or len(left) == len(waiting):
            break
        waiting = left
    else:
        raise MeshError(f"has more than {MOST_CHAIN} nodes that use each other in a row")
    outermost = sum(total.get(use, 0) for use in counter.nodes[0].uses if isinstance(use, int))
    if max(outermost, *total.values(), 0) > MOST_USES:
        raise too_many()
