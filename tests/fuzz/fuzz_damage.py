"""Random damage of the fuzz test to numbers, texts, bytes and data."""

from __future__ import annotations

import json
import random
import re
from typing import Any
from xml.sax.saxutils import escape

from fuzz_seeds import CALLS, NUMBERS, SHAPES, STRANGE, TERMS, WORDS


class Damage:
    """Random damage to numbers, texts, bytes and data of YAML and JSON."""

    def __init__(self, rng: random.Random) -> None:
        self.rng = rng

    def number(self) -> Any:
        if self.rng.random() < 0.4:
            return self.rng.choice(
                [0, 0.5, 1, 2, 1e-3, 1e-6, round(self.rng.uniform(-3.0, 3.0), 3), round(self.rng.uniform(0.0, 3.0), 3)]
            )
        return self.rng.choice([*NUMBERS, self.rng.uniform(-10.0, 10.0), 10.0 ** self.rng.uniform(-320.0, 308.0)])

    def value(self, depth: int = 0) -> Any:
        what = self.rng.randrange(10 if depth < 3 else 7)
        if what < 4:
            return self.number()
        if what < 7:
            return self.rng.choice([*WORDS, None, True, False])
        if what < 9:
            return [self.value(depth + 1) for _ in range(self.rng.choice([0, 1, 3, 7]))]
        return {str(self.value(3)): self.value(depth + 1) for _ in range(self.rng.choice([0, 1, 2]))}

    def text(self, text: str) -> str:
        for _ in range(self.rng.choice([1, 1, 2, 4])):
            tokens = re.split(r"([\s<>\"'=:,{}\[\]/]+)", text)
            k, j = self.rng.randrange(len(tokens)), self.rng.randrange(len(tokens))
            numeric = [i for i, token in enumerate(tokens) if re.fullmatch(r"-?\d+(\.\d*)?(e-?\d+)?", token)]
            what = self.rng.randrange(8)
            if what < 3 and numeric:
                tokens[self.rng.choice(numeric)] = str(self.number())
            elif what < 4:
                tokens[k] = self.rng.choice(WORDS)
            elif what < 5:
                tokens[k], tokens[j] = tokens[j], tokens[k]
            elif what < 6:
                del tokens[k : k + self.rng.choice([1, 2, 10])]
            elif what < 7:
                tokens[k:k] = tokens[k : k + self.rng.choice([2, 20, 100])]
            else:
                tokens = tokens[: k + 1]
            text = "".join(tokens)
        return text

    def attributes(self, text: str) -> str:
        """XML with the texts of some attributes damaged, or elements left out or doubled, well formed all the same."""
        for _ in range(self.rng.choice([1, 1, 2, 3])):
            what = self.rng.randrange(8)
            if what < 6:
                found = list(re.finditer(r'"([^"<>]*)"', text))
                at = self.rng.choice(found)
                parts = at.group(1).split(" ")
                other = self.rng.choice(found).group(1)
                new = self.rng.choice([str(self.number()), str(self.number()), other, *self.rng.sample(WORDS, 1)])
                parts[self.rng.randrange(len(parts))] = escape(new, {'"': "&quot;"})
                text = f"{text[: at.start(1)]}{' '.join(parts)}{text[at.end(1) :]}"
            else:
                found = list(re.finditer(r"<[a-z]+ [^<>]*/>", text))
                if not found:  # all of them have been left out
                    continue
                at = self.rng.choice(found)
                text = text[: at.start()] + at.group() * (0 if what == 6 else 2) + text[at.end() :]
        return text

    def bytes(self, data: bytes) -> bytes:
        found = bytearray(data)
        for _ in range(self.rng.choice([1, 2, 8])):
            k, n = self.rng.randrange(len(found) + 1), self.rng.choice([1, 4, 64])
            what = self.rng.randrange(4)
            if what == 0:
                found[k : k + n] = self.rng.randbytes(n)
            elif what == 1:
                found[k:k] = found[: n * 4]
            elif what == 2:
                del found[k : k + n]
            elif k < len(found):
                found[k] ^= 1 << self.rng.randrange(8)
        return bytes(found)

    def data(self, data: Any, gentle: float = 0.6) -> Any:
        """Data with some of its places changed: gently to other numbers where there were numbers."""
        data = json.loads(json.dumps(data))
        places: list[tuple[Any, Any]] = []

        def walk(node: Any) -> None:
            for key in list(node) if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ():
                places.append((node, key))
                walk(node[key])

        walk(data)
        numeric = [(node, key) for node, key in places if isinstance(node[key], (int, float))]
        for _ in range(self.rng.choice([1, 1, 2, 3])):
            gently = bool(numeric) and self.rng.random() < gentle
            node, key = self.rng.choice(numeric if gently else places)
            if (isinstance(node, dict) and key not in node) or (isinstance(node, list) and key >= len(node)):
                continue  # it went with what was taken out before
            if gently:
                node[key] = self.number()
                continue
            what = self.rng.randrange(6)
            if what < 2:
                node[key] = self.value()
            elif what == 2:
                del node[key]
            elif what == 3 and isinstance(node, dict):
                node[self.rng.choice([*WORDS, str(self.rng.choice(places)[1])])] = node[key]
            elif what == 4:
                node[key] = [node[key]]
            else:
                node[key] = json.loads(json.dumps(self.rng.choice(places)[0]))
        return data

    def expression(self, depth: int = 0) -> str:
        if self.rng.random() < 0.04:
            shape = self.rng.choice(STRANGE)
            return shape.replace("{}", self.rng.choice(TERMS))
        if depth > 3 or self.rng.random() < 0.25:
            return self.rng.choice(TERMS)
        if self.rng.random() < 0.5:
            return self.rng.choice(CALLS).format(self.expression(depth + 1))
        return self.rng.choice(SHAPES).format(self.expression(depth + 1), self.expression(depth + 1))
