"""Values computed from an object's data when first needed, kept with the object, and not part of its copies."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, Generic, Self, TypeVar, overload

import numpy as np

T = TypeVar("T")


class cached_property(Generic[T]):
    """functools.cached_property without the lock that Python 3.11 holds while the value is computed.

    That lock belongs to the class: a thread that computes the value of one object would block all other threads, and
    the lock would stay taken in a process that is forked meanwhile. Two threads may compute a value twice.
    """

    def __init__(self, function: Callable[[Any], T]) -> None:
        self.function, self.__doc__ = function, function.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...

    @overload
    def __get__(self, instance: object, owner: type) -> T: ...

    def __get__(self, instance: object | None, owner: type) -> Self | T:
        if instance is None:
            return self
        value: T = vars(instance).setdefault(self.name, self.function(instance))
        return value


def computed_once(function: Callable[[Any], T]) -> Callable[[Any], T]:
    """Decorate a function of one object: its value is kept with the object, like that of a cached property.

    This is for values that a higher room computes from an object of a lower one, such as the equations of a scene.
    """
    place = f"{function.__module__}.{function.__qualname__}"

    @wraps(function)
    def once(owner: Any) -> T:
        kept: dict[str, T] = owner.__dict__
        try:
            return kept[place]
        except KeyError:
            return kept.setdefault(place, function(owner))

    return once


class Portable:
    """A base class whose objects are pickled and copied by their data alone, to the bit.

    Cached properties, values of `computed_once`, and the attributes in `left_out` are not copied; they are computed
    again when needed. Read-only arrays stay read-only.
    """

    left_out: tuple[str, ...] = ()

    def __getstate__(self) -> tuple[dict[str, Any], tuple[str, ...]]:
        derived = _derived(type(self))
        state = {name: value for name, value in vars(self).items() if name not in derived and "." not in name}
        return state, tuple(n for n, v in state.items() if isinstance(v, np.ndarray) and not v.flags.writeable)

    def __setstate__(self, saved: tuple[dict[str, Any], tuple[str, ...]]) -> None:
        state, frozen = saved
        vars(self).update(state)
        for name in frozen:
            state[name].flags.writeable = False


def _derived(kind: type) -> frozenset[str]:
    """The names of a class's cached properties, and those that it leaves out."""
    found = {name for base in kind.__mro__ for name, value in vars(base).items() if isinstance(value, cached_property)}
    return frozenset(found | set(getattr(kind, "left_out", ())))
