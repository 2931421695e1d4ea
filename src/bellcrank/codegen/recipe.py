"""What the cache holds of a compiled function: the sizes of its vectors, and its machine code by kind and target."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from bellcrank.codegen import cache as disk
from bellcrank.codegen import llvm as machine
from bellcrank.codegen.expression_graph import Graph

_LENGTH = 8  # bytes of the size of quickly compiled code


@dataclass(frozen=True)
class StoredCode:
    """Machine code from the cache, and the compressed IR whose optimised code is yet to come, if any."""

    code: bytes
    ir: bytes = b""


class Recipe:
    """The entry of a function in the cache, which names the entries of its machine code.

    Attributes:
        input_sizes: The sizes of the function's inputs.
        output_sizes: Those of its outputs.
    """

    def __init__(self, key: str, stored: dict[str, Any]) -> None:
        self._key, self._objects = key, dict[str, str](stored["objects"])
        self.input_sizes: tuple[int, ...] = tuple(stored["inputs"])
        self.output_sizes: tuple[int, ...] = tuple(stored["outputs"])

    @classmethod
    def load(cls, key: str, inputs: Sequence[int]) -> Recipe | None:
        """The recipe from the cache; None where there is none, or its first inputs have other sizes."""
        kind = {"inputs": [int], "outputs": [int], "objects": {str: str}}
        stored: dict[str, Any] | None = disk.load_data(key, kind)
        if not stored or min([*stored["inputs"], *stored["outputs"]], default=0) < 0:
            return None
        return cls(key, stored) if stored["inputs"][: len(inputs)] == list(inputs) else None

    @classmethod
    def of(cls, key: str, graph: Graph) -> Recipe:
        """A new recipe."""
        return cls(key, {**_sizes(graph), "objects": {}})

    def code(self, kind: str, target: machine.Target) -> StoredCode | None:
        """The cached code: the optimised one, or else the quickly compiled one; None where there is none."""
        optimised = self._payload(_hint(kind, target))
        if optimised is not None:
            return StoredCode(optimised)
        quick = self._payload("quick:" + _hint(kind, target))
        if quick is None:
            return None
        end = _LENGTH + int.from_bytes(quick[:_LENGTH], "little")
        return StoredCode(quick[_LENGTH:end], quick[end:])

    def store(self, kind: str, target: machine.Target, made: StoredCode, key: str, graph: Graph | None = None) -> None:
        """Store new code under a key; with IR, as quickly compiled code. `graph` gives the sizes anew."""
        if graph is not None:
            sizes = _sizes(graph)
            self.input_sizes, self.output_sizes = tuple(sizes["inputs"]), tuple(sizes["outputs"])
        quick, payload = bool(made.ir), made.code
        if quick:
            payload = len(made.code).to_bytes(_LENGTH, "little") + made.code + made.ir
        disk.store(key, self._signature() + b"\n" + payload)
        self._objects["quick:" * quick + _hint(kind, target)] = key
        entry = {"inputs": self.input_sizes, "outputs": self.output_sizes, "objects": self._objects}
        disk.store(self._key, json.dumps(entry).encode())

    def _payload(self, hint: str) -> bytes | None:
        key = self._objects.get(hint)
        stored = disk.load(key) if key else None
        sizes, _, payload = (stored or b"").partition(b"\n")
        return payload if payload and sizes == self._signature() else None

    def _signature(self) -> bytes:
        return json.dumps([self.input_sizes, self.output_sizes]).encode()


def _hint(kind: str, target: machine.Target) -> str:
    return f"{kind}:{target.name}:{target.cpu}:{target.features}"


def _sizes(graph: Graph) -> dict[str, list[int]]:
    return {"inputs": list(graph.input_sizes), "outputs": [size for size, *_ in graph.outputs]}
