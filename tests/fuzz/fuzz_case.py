"""A case of the fuzz test, and damaged YAML."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import yaml
from fuzz_damage import Damage


@dataclass(frozen=True)
class Case:
    """Files by name, and what to do: the name of an action (fuzz_actions.py) and its arguments."""

    files: dict[str, bytes]
    action: str
    arguments: tuple[Any, ...]


def yaml_bytes(d: Damage, data: Any) -> bytes:
    """Damaged data as YAML, sometimes with its text damaged too, sometimes after aliases of aliases."""
    text = yaml.safe_dump(d.data(data), allow_unicode=True, sort_keys=False)
    if d.rng.random() < 0.15:
        text = d.text(text)
    if d.rng.random() < 0.05:
        text = (
            "a: &a [x, x, x]\n"
            + "".join(f"b{k}: &b{k} [{', '.join(['*' + ('a' if k == 0 else f'b{k - 1}')] * 9)}]\n" for k in range(9))
            + text
        )
    return text.encode("utf-8", "replace")
