"""What the search needs to know of a kind of linkage: bounds of its shape, and how its coupler or its output moves."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from bellcrank.arrays import Array, Complex

SAFE = 1e-3  # rad: of a least transmission angle at least, so that no linkage is flat
NONE = np.zeros((0, 0))
NO_JOINT = np.zeros((0, 0), dtype=complex)


class Turning(NamedTuple):
    """The directions e^{iφ} (n, points) of the link with the point, and the derivatives of φ by the crank's angle
    (n, points) and by the shape (n, points, k); the joint (n, points) from which that link begins, with its
    derivatives, or None where this is the crank's end; and the longest link (n,) over the crank.
    """

    directions: Complex
    longest: Array
    by_angle: Array = NONE
    by_shape: Array = NONE
    base: Complex | None = None
    base_by_angle: Complex = NO_JOINT
    base_by_shape: Complex = NO_JOINT


def longest_of(links: Array) -> Array:
    """The longest link (n,) of linkages with links (n, k) over the crank."""
    return np.asarray(np.maximum(1.0, np.abs(links).max(axis=1)))


class SynthesisOutput(NamedTuple):
    """The output (n, points): an angle, or a position over the length of the crank, and its derivatives by a common
    change of the crank's angles (n, points) and by the shape (n, points, k).
    """

    value: Array
    by_start: Array = NONE
    by_shape: Array = NONE


class LinkageKind(Protocol):
    """A kind of linkage whose crank is the unit of length; its shape is k numbers within bounds."""

    @property
    def effort(self) -> int:
        """How many times as many samples, linkages and steps a search has as that of a four-bar."""

    @property
    def branches(self) -> tuple[float, ...]:
        """The ways in which it is assembled."""

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds (k,) of a shape."""

    def shapes(self, drawn: Array) -> Array:
        """Shapes (n, k) at points (n, k) of the unit cube."""


class CouplerKind(LinkageKind, Protocol):
    """A kind whose coupler is to pass points."""

    def turning(self, shape: Array, crank: Array, branch: Array, slopes: bool) -> Turning:
        """How the coupler turns at crank angles (n, points), on the branches (n,)."""


class OutputKind(LinkageKind, Protocol):
    """A kind whose output is to be a function of the crank's angle."""

    @property
    def angular(self) -> bool:
        """Whether its output is an angle; else a position."""

    def output(self, shape: Array, crank: Array, branch: Array, slopes: bool) -> SynthesisOutput:
        """The output at crank angles (n, points), on the branches (n,); NaN where it does not assemble."""
