"""A mode of linear equations: its eigenvalue, frequency, damping and shape."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from bellcrank.arrays import Complex


@dataclass(frozen=True, eq=False, kw_only=True)
class Mode:
    """One real eigenvalue or one pair of conjugate ones: x(t) = Re (shape exp(eigenvalue t)).

    Attributes:
        eigenvalue: λ, 1/s, with an imaginary part of 0 or more.
        shape: The eigenvector (n,), over the states; its largest entry is 1.
        displacement: The displacement δ (nv,) of all degrees of freedom, those of a free base in its own axes.
        symmetry: Whether the mode is a motion along a symmetry, along which nothing changes.

    Example:
        >>> import bellcrank as bc
        >>> mode = bc.linearise(bc.load_scene("pendulum")).modes[0]
        >>> mode.kind, round(mode.natural_frequency, 6), mode.damping_ratio
        ('oscillation', 3.132092, 0.0)
    """

    eigenvalue: complex
    shape: Complex
    displacement: Complex
    symmetry: bool = False

    @property
    def oscillates(self) -> bool:
        """Whether it is a pair of conjugate eigenvalues."""
        return self.eigenvalue.imag > 0.0

    @property
    def kind(self) -> str:
        """ "oscillation", "decay", "growth", "growing oscillation", "decaying oscillation" or "neutral"."""
        real, swings = self.eigenvalue.real, self.oscillates
        if real == 0.0:
            return "oscillation" if swings else "neutral"
        if swings:
            return "growing oscillation" if real > 0.0 else "decaying oscillation"
        return "growth" if real > 0.0 else "decay"

    @property
    def natural_frequency(self) -> float:
        """|λ|, rad/s."""
        return abs(self.eigenvalue)

    @property
    def frequency(self) -> float:
        """Im λ / 2π, Hz."""
        return self.eigenvalue.imag / (2.0 * math.pi)

    @property
    def damping_ratio(self) -> float | None:
        """−Re λ / |λ|: 1 for a decay, 0 for an undamped oscillation, −1 for a growth; None for λ = 0."""
        size = abs(self.eigenvalue)
        return -self.eigenvalue.real / size + 0.0 if size > 0.0 else None

    @property
    def time_constant(self) -> float | None:
        """1/|Re λ|, s, in which it grows or decays by the factor e; None where Re λ = 0."""
        return 1.0 / abs(self.eigenvalue.real) if self.eigenvalue.real else None

    def to_dict(self) -> dict[str, Any]:
        """The mode as data that JSON can hold.

        Returns:
            Numbers and texts by name; complex numbers as [real, imaginary].
        """
        return {
            "eigenvalue": pair(self.eigenvalue),
            "kind": self.kind,
            "natural_frequency": self.natural_frequency,
            "frequency": self.frequency,
            "damping_ratio": self.damping_ratio,
            "time_constant": self.time_constant,
            "symmetry": self.symmetry,
            "shape": [pair(x) for x in self.shape.tolist()],
            "displacement": [pair(x) for x in self.displacement.tolist()],
        }


def pair(value: complex) -> list[float]:
    """A complex number as [real, imaginary]."""
    return [value.real, value.imag]


def normalised(vector: Complex) -> Complex:
    """The vector with its largest entry at 1; unchanged where it is 0."""
    size = np.abs(vector)
    largest = vector[int(np.argmax(size))] if size.size else 0.0
    return np.asarray(vector / largest if abs(largest) > 0.0 else vector, dtype=np.complex128)


def sort_key(value: complex) -> tuple[bool, float, float]:
    """What grows first, then by the size of the eigenvalue: fast oscillations last."""
    return (value.real <= 0.0, abs(value), cmath.phase(value))
