"""Entries of u that change only at instants of a run, and are found by it: the sides of switches, and what sampled
controllers hold.

A scene's signals are known before a run; these are not. In the scene's signals they have their values at the start; the
signals of a run have those that it found, as steps. In u they follow the other signals, the sides first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from bellcrank.arrays import Array
from bellcrank.elements.signals import Signal, SignalSource


@dataclass(frozen=True)
class HeldSource(SignalSource):
    """Entries that a run finds, with the values (width,) at its start."""

    @property
    def start(self) -> Array:
        """The values at the start."""
        values: Array = self.signal.coefficients[0, 0]
        return values


def held_source(name: str, start: Sequence[float]) -> HeldSource:
    """Entries with these values at the start."""
    return HeldSource(name, len(start), 0, partial(_constant, tuple(start)))


def _constant(values: tuple[float, ...]) -> tuple[Signal, Array]:
    return Signal(np.array([0.0, 1.0]), np.array(values)[None, None, :], 0, False), np.zeros(0)


def found_signal(time: Array, values: Array) -> Signal:
    """The signal with values (m, width) from the times (m,) s on, each until the next."""
    return Signal(np.append(time, time[-1] + 1.0), values[:, None, :], 0, True)
