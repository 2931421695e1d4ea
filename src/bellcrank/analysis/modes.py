"""Modes of linear equations: their eigenvalues, frequencies, damping and shapes, how they are found, and their table.

The symmetries' own directions G (n, k) are an invariant subspace of A, A G = G Λ. Eigenvalues are computed block by
block, those of Λ and those of A on the quotient, since together they have defective zeros (position and velocity of
a cart), of which an eigenvalue routine returns the square root of its rounding. Source: Golub & Van Loan, Matrix
Computations, 4th ed., 7.1 and 7.6.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from scipy.linalg import eig, matrix_balance, qr

from bellcrank.arrays import Array, Complex
from bellcrank.present.tables import aligned

if TYPE_CHECKING:
    from bellcrank.analysis.linearisation import Linearisation

SHOWN_AS_ZERO = 1e-12  # m, rad, m/s or rad/s: less is shown as 0
MOST = 0.1  # of the largest entry of a shape: a state with less is not named
# times machine precision, the norm of A and an eigenvalue's condition number: a real or imaginary part below this is 0
ROUNDING = 100.0
DEPENDENT = 1e-9  # of the largest singular value: symmetries that do the same at the operating point
NEUTRAL = 1e-6  # of the largest eigenvalue: an eigenvalue nearer than this to one of Λ has no eigenvector of its own


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

    def as_dict(self) -> dict[str, Any]:
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


def complex_text(value: complex, digits: int = 6) -> str:
    """A complex number for a table, without an imaginary part that is 0."""
    if value.imag == 0.0:
        return f"{value.real:.{digits}g}"
    return f"{value.real:.{digits}g} {'-' if value.imag < 0.0 else '+'} {abs(value.imag):.{digits}g}i"


def normalised(vector: Complex) -> Complex:
    """The vector with its largest entry at 1; unchanged where it is 0."""
    size = np.abs(vector)
    largest = vector[int(np.argmax(size))] if size.size else 0.0
    return np.asarray(vector / largest if abs(largest) > 0.0 else vector, dtype=np.complex128)


def sort_key(value: complex) -> tuple[bool, float, float]:
    """What grows first, then by the size of the eigenvalue: fast oscillations last."""
    return (value.real <= 0.0, abs(value), cmath.phase(value))


def mode_cells(linear: Linearisation, mode: Mode) -> tuple[str, ...]:
    """The cells of a mode after its number."""
    value, ratio, constant = mode.eigenvalue, mode.damping_ratio, mode.time_constant
    names = [name for name, _ in linear.states]
    largest = np.argsort(-np.abs(mode.shape), kind="stable")[:2]
    moving = ", ".join(names[k] for k in largest if abs(mode.shape[k]) > MOST)
    return (
        f"{value.real:.6g} ± {value.imag:.6g}i" if mode.oscillates else f"{value.real:.6g}",
        f"{mode.frequency:.6g}" if mode.oscillates else "",
        "" if ratio is None else f"{ratio:.4g}",
        "" if constant is None else f"{constant:.5g}",
        mode.kind + (" along a symmetry" if mode.symmetry else ""),
        moving,
    )


def mode_table(linear: Linearisation) -> str:
    """The operating point, the modes, symmetries and notes, line by line."""
    stability = f", {linear.stability}" if linear.stability else ""
    lines = [f"{linear.name}: {linear.description}{stability}", f"position q: {shown(linear.position)}"]
    if linear.velocity.any():
        lines.append(f"velocity v: {shown(linear.velocity)}")
    if linear.modes:
        lines += aligned([linear.mode_header, *linear.mode_rows()])
    else:
        values = ", ".join(f"{x:.6g}" for x in linear.frozen_eigenvalues.tolist())
        lines.append(f"eigenvalues of A at this moment, which say nothing of stability: {values}")
    for drive in linear.drives:
        lines.append(f"drive of {drive.joint}: {'; '.join(f'{name} {value}' for name, value in drive.rows())}")
    if linear.symmetries:
        left = "left out of the states" if linear.symmetries_removed else "kept among the states"
        lines.append(f"symmetries ({left}): {'; '.join(linear.symmetries)}")
    return "\n".join([*lines, *(f"{note.label}: {note}" for note in linear.notes)])


def shown(values: Array) -> str:
    """Numbers for a table; those that are rounding errors as 0."""
    return ", ".join(f"{x if abs(x) > SHOWN_AS_ZERO else 0.0:.6g}" for x in values.tolist())


@dataclass(frozen=True, eq=False)
class Quotient:
    """Linear equations without the directions of their symmetries.

    Attributes:
        kept: The states that remain.
        dropped: The states (k of them) that the symmetries move.
        projection: (n − k, n): remaining states of all states, the same along the symmetries.
        directions: G (n, k), the identity on the dropped states.
    """

    kept: list[int]
    dropped: list[int]
    projection: Array
    directions: Array

    @classmethod
    def of(cls, directions: Array, positions: int, units: Array) -> Self:
        """From directions G (n, k); positions, the first of the states, are dropped before velocities."""
        left, values, _ = np.linalg.svd(directions, full_matrices=False)
        directions = left[
            :, values > DEPENDENT * values.max(initial=1.0)
        ]  # at a fixed point of a symmetry there are fewer
        n, k = directions.shape
        weights = np.where(np.arange(n) < positions, 1.0, 1e-3) / units
        _, _, order = qr((directions * weights[:, None]).T, mode="economic", pivoting=True)
        dropped = sorted(int(place) for place in order[:k])
        kept = [place for place in range(n) if place not in dropped]
        solved = directions @ np.linalg.inv(directions[dropped]) if k else directions
        projection = np.zeros((len(kept), n))
        projection[range(len(kept)), kept] = 1.0
        projection[:, dropped] = -solved[kept]
        return cls(kept, dropped, projection, solved)

    def field(self, matrix: Array) -> Array:
        """A on the quotient (n − k, n − k)."""
        return self.projection @ matrix[:, self.kept]

    def along(self, matrix: Array) -> Array:
        """Λ (k, k)."""
        return (matrix @ self.directions)[self.dropped]


def modes_of(matrix: Array, quotient: Quotient, embedding: Array, *, reduced: bool) -> tuple[Mode, ...]:
    """The modes of A = `matrix` (n, n), those along symmetries last; without these if `reduced`.

    Their shapes are over the remaining states if `reduced`, else over all. `embedding` (nv, n) gives the
    displacement of all degrees of freedom.
    """
    field, along = quotient.field(matrix), quotient.along(matrix)
    values, vectors, error = eigen(field)
    group, basis, group_error = eigen(along)
    found = []
    largest = max(np.abs(values).max(initial=0.0), np.abs(group).max(initial=0.0))
    for value, vector, own in zip(values, vectors.T, error, strict=True):
        whole = _lifted(matrix, quotient, complex(value), vector, group, NEUTRAL * largest)
        found.append((_rounded(complex(value), own), whole, False))
    if not reduced:
        for value, vector, own in zip(group, basis.T, group_error, strict=True):
            found.append((_rounded(complex(value), own), quotient.directions @ vector, True))
    found = [entry for entry in found if entry[0].imag >= 0.0]
    return tuple(
        Mode(
            eigenvalue=value,
            shape=normalised(np.asarray(whole[quotient.kept] if reduced else whole, dtype=np.complex128)),
            displacement=normalised(np.asarray(embedding @ whole, dtype=np.complex128)),
            symmetry=symmetry,
        )
        for value, whole, symmetry in sorted(found, key=lambda entry: (entry[2], sort_key(entry[0])))
    )


def _lifted(matrix: Array, quotient: Quotient, value: complex, vector: Complex, group: Complex, near: float) -> Complex:
    """The eigenvector (n,) over all states of one of the quotient; without the symmetries' part where λ is one of Λ."""
    n, k = quotient.directions.shape
    whole = np.zeros(n, dtype=np.complex128)
    whole[quotient.kept] = vector
    if k and np.abs(group - value).min() > near:
        # (λ − Λ) s = what the remaining states do along the symmetries
        push = (matrix @ whole)[quotient.dropped]
        whole = whole + quotient.directions @ np.linalg.solve(value * np.eye(k) - quotient.along(matrix), push)
    return whole


def eigen(matrix: Array, change: float | None = None) -> tuple[Complex, Complex, Array]:
    """Eigenvalues, eigenvectors and the error of each eigenvalue.

    The error is that of a perturbation of A, by `change` or by its own rounding, times its condition number 1/|yᴴ x|.
    """
    if not len(matrix):
        return np.zeros(0, dtype=np.complex128), np.zeros((0, 0), dtype=np.complex128), np.zeros(0)
    balanced, scaling = matrix_balance(matrix, permute=False)
    values, left, right = eig(balanced, left=True, right=True)
    overlap = np.abs(np.einsum("ij,ij->j", left.conj(), right))
    rounding = ROUNDING * np.finfo(float).eps * float(np.linalg.norm(balanced, 2))
    least = np.sqrt(np.finfo(float).eps if change is None else max(change, np.finfo(float).eps))
    return values, scaling @ right, (rounding if change is None else change) / np.maximum(overlap, least)


def _rounded(value: complex, error: float) -> complex:
    real = value.real if abs(value.real) > error else 0.0
    imaginary = value.imag if abs(value.imag) > error else 0.0
    return complex(real, imaginary)
