"""Names of version 0.4 that have another name since 0.5: each still works in 0.5, with a DeprecationWarning."""

from __future__ import annotations

import importlib
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any, ClassVar, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")
REMOVAL = "0.6"
NAMES = {  # of the package itself
    "Card": "RobotConfig",
    "Drive": "Actuator",
    "closed_inverse_dynamics": "scene_inverse_dynamics",
    "load_card": "load_robot_config",
}
MODULES = {
    "atomic": "files.atomic_write",
    "designs": "studies",
    "machine_code": "codegen",
    "shipped": "files.bundled_data",
    "sizing.report": "sizing.sizing_files",
}


def warn(old: str, new: str, stacklevel: int = 3) -> None:
    """Tell the caller that a name is an old one."""
    text = f"'{old}' is now '{new}'; the old name will be removed in {REMOVAL}"
    warnings.warn(text, DeprecationWarning, stacklevel=stacklevel)


class Renamed:
    """A base of classes with attributes that had other names.

    `renamed` maps an old attribute to the new one, or to "module:function" of what computes it from the object now.
    """

    renamed: ClassVar[Mapping[str, str]] = {}

    def __getattr__(self, name: str) -> Any:
        new = type(self).renamed.get(name)
        if new is None:
            raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'")
        module, colon, function = new.partition(":")
        warn(f"{type(self).__name__}.{name}", f"{module}.{function}(…)" if colon else f"{type(self).__name__}.{new}")
        return getattr(importlib.import_module(module), function)(self) if colon else getattr(self, new)


def renamed_arguments(**new_names: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """A decorator of functions that take keyword arguments by their old names too: renamed_arguments(old="new")."""

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        @wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            for old, new in new_names.items():
                if old in kwargs:
                    if new in kwargs:
                        raise TypeError(f"{function.__name__}() takes '{new}' or its old name '{old}', not both")
                    warn(f"{function.__name__}({old}=…)", f"{function.__name__}({new}=…)")
                    kwargs[new] = kwargs.pop(old)
            return function(*args, **kwargs)

        return call

    return decorate


class _OldModules:
    """Finds modules by their old names, after all other finders have not."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        loader: Any = self  # importlib.abc's base classes take 15 ms to import
        return ModuleSpec(fullname, loader, is_package=True) if _new_module(fullname) else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        new = _new_module(spec.name)
        assert new is not None
        warn(spec.name, new, stacklevel=6)
        module, there = ModuleType(spec.name), importlib.import_module(new)
        # an empty path: modules below are found here too, and not loaded a second time from the new room's folder
        module.__dict__.update(__path__=[], __getattr__=lambda name: getattr(there, name))
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Nothing: what is asked of the module is looked up in the new one."""


def _new_module(name: str) -> str | None:
    """The new name of a module; None where it is not an old one."""
    package, *parts = name.split(".")
    for count in range(len(parts), 0, -1):
        new = MODULES.get(".".join(parts[:count]))
        if package == "bellcrank" and new is not None:
            return ".".join(["bellcrank", new, *parts[count:]])
    return None


def install() -> None:
    """Let modules be imported by their old names."""
    if not any(isinstance(finder, _OldModules) for finder in sys.meta_path):
        sys.meta_path.append(_OldModules())
