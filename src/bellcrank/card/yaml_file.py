"""Reading a YAML file whose top is a mapping: duplicate keys refused, line numbers kept, faults in one
sentence."""

from __future__ import annotations

import reprlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from bellcrank.errors import InputError


class Lines(dict[str, Any]):
    """A mapping read from YAML that remembers the line of each key (from 1)."""

    lines: dict[str, int]


def read_yaml(path: str | Path) -> Mapping[str, Any]:
    """The top mapping of a YAML file; InputError, in one sentence with the line, for anything else."""
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: expected a text file in UTF-8, found a byte that is not at {error.start}") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    data = _value(text, str(path), lines=True)
    if data is None:
        raise InputError(f"{path}: expected a mapping of keys to values, found an empty file")
    if not isinstance(data, dict):
        raise InputError(f"{path}: expected a mapping of keys to values, found {shown(data)}")
    return data


def read_value(text: str, where: str) -> Any:
    """The value of an argument that is written as YAML; InputError, which begins with `where`, for anything else."""
    return _value(text, where, lines=False)


def _value(text: str, where: str, lines: bool) -> Any:
    import yaml

    try:
        return yaml.load(text, Loader=_loader(yaml))  # a SafeLoader
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f" (line {mark.line + 1})" if mark and lines else ""
        raise InputError(f"{where}{line}: not valid YAML: {' '.join(str(error.problem or error).split())}") from None
    except (
        yaml.YAMLError,
        ValueError,
        OverflowError,
        TypeError,
        KeyError,
        IndexError,
        AttributeError,
    ) as error:
        detail = " ".join(str(error).split())[:100]
        raise InputError(f"{where}: not valid YAML: a value does not fit its type ({detail})") from None
    except RecursionError:
        raise InputError(f"{where}: not valid YAML: nested too deeply") from None


def _loader(yaml: Any) -> Any:
    class Loader(yaml.SafeLoader):  # type: ignore[misc]
        """SafeLoader that refuses a key written twice and keeps line numbers."""

    def mapping(loader: Any, node: Any) -> Iterator[Lines]:
        result = Lines()
        result.lines = {}
        yield result
        own = [(key, value) for key, value in node.value if key.tag != "tag:yaml.org,2002:merge"]
        seen: dict[Any, int] = {}
        for key_node, _ in own:
            key = loader.construct_object(key_node, deep=True)
            line = key_node.start_mark.line + 1
            if not isinstance(key, str):
                raise yaml.constructor.ConstructorError(
                    None,
                    None,
                    f"expected a text as key, found {shown(key)}; put it in quotes",
                    key_node.start_mark,
                )
            if key in seen:
                raise yaml.constructor.ConstructorError(
                    None,
                    None,
                    f"the key '{key}' stands twice (first on line {seen[key]})",
                    key_node.start_mark,
                )
            seen[key] = line
        loader.flatten_mapping(node)
        for key_node, value_node in node.value:
            key = loader.construct_object(key_node, deep=True)
            result[str(key)] = loader.construct_object(value_node, deep=True)
            result.lines[str(key)] = key_node.start_mark.line + 1

    Loader.add_constructor("tag:yaml.org,2002:map", mapping)
    Loader.add_constructor("tag:yaml.org,2002:timestamp", yaml.SafeLoader.construct_yaml_str)
    return Loader


def shown(value: object) -> str:
    """A value as an error message shows it: short, on one line."""
    if value is None:
        return "nothing"
    if isinstance(value, Mapping):
        return "a mapping"
    if isinstance(value, (list, tuple)):
        return f"a list of {len(value)}"
    text = " ".join(str(value).split())
    text = text if len(text) <= 60 else text[:57] + "…"
    return f"'{text}'" if isinstance(value, str) else reprlib.repr(value) if len(text) > 57 else text
