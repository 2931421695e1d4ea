"""The forces of joints that dry friction keeps at rest, and the equations by which a run finds which joints those are.

Forces x at the joints with dry friction change the accelerations to v̇ + C x, C being the response to unit forces,
constraints included. With S = diag(1 for joints that hold, else 0) and A the rows of C at these joints, they stay at
rest with

    (S A S + 1 − S) x = −S v̇.

A is symmetric and, where the joints move freely of each other, positive definite. Near postures where constraints make
those that hold depend on each other, a small multiple of 1 is added and its effect taken away again by repeated solves
(kkt.py). Source: Pfeiffer & Glocker, Multibody Dynamics with Unilateral Contacts (1996), ch. 5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.dry_friction import DryFriction
    from bellcrank.elements.symbols import Symbols

REGULARISATION = 1e-9  # of a joint's own inertia
REFINEMENTS = 3


@dataclass(frozen=True)
class StuckJoints:
    """The joints of a scene with dry friction (n) as expressions.

    Attributes:
        rows: Their rows in v.
        direction: 1 forwards, −1 backwards, of joints that slide or are at their largest force (n).
        moves: 1 for joints that slide, else 0 (n).
        holds: 1 for joints that their force keeps at rest, else 0 (n).
        velocity: rad/s or m/s (n).
        limit: The largest force at rest (n), N m or N.
        sliding: The force of the others (n); 0 for those that hold.
    """

    rows: tuple[int, ...]
    direction: casadi.SX
    moves: casadi.SX
    holds: casadi.SX
    velocity: casadi.SX
    limit: casadi.SX
    sliding: casadi.SX

    @classmethod
    def of(cls, parts: Sequence[DryFriction], s: Symbols) -> StuckJoints:
        """Those of a scene's dry friction, in a run."""
        import casadi

        modes = [casadi.vertsplit(s.signal(part.mode)) for part in parts]
        direction, moves, holds = (casadi.vertcat(*column) for column in zip(*modes, strict=True))
        return cls(
            tuple(part.joint.v for part in parts),
            direction,
            moves,
            holds,
            casadi.vertcat(*[s.joint(part.joint).velocity for part in parts]),
            casadi.vertcat(*[part.limit(s) for part in parts]),
            casadi.vertcat(*[part.sliding(s, mode[0]) for part, mode in zip(parts, modes, strict=True)]),
        )

    def forces(self, acceleration: casadi.SX, response: casadi.SX, inertia: casadi.SX, *, regular: bool) -> casadi.SX:
        """x (n) of accelerations (nv) without it, the response C (nv, n), and the joints' own inertias (n).

        `regular`: the joints move freely of each other.
        """
        import casadi

        rows, count = list(self.rows), len(self.rows)
        masked = casadi.diag(self.holds * casadi.sqrt(inertia))
        matrix = masked @ response[rows, :] @ masked + casadi.diag(1.0 - self.holds)
        right = -(masked @ acceleration[rows])
        if regular:
            return masked @ _solved(matrix, right)
        factored = matrix + REGULARISATION * casadi.SX.eye(count)
        x = _solved(factored, right)
        for _ in range(REFINEMENTS):
            x = x + _solved(factored, right - matrix @ x)
        return masked @ x

    def at_rest(self, vector: casadi.SX) -> casadi.SX:
        """Accelerations or displacements (nv), exactly 0 at joints that do not move."""
        import casadi

        found = casadi.SX(vector)
        for k, row in enumerate(self.rows):
            found[row] = self.moves[k] * vector[row]
        return found

    def switches(self, x: casadi.SX) -> casadi.SX:
        """Functions (n) that are positive while the modes last: d v of joints that slide, else 1 − (x / limit)²."""
        share = x / self.limit
        return self.moves * self.direction * self.velocity + (1.0 - self.moves) * (1.0 - share * share)

    def turn(self, acceleration: casadi.SX, response: casadi.SX) -> casadi.SX:
        """What a run needs to find new modes: velocity (n), acceleration without the forces x (n), A (n, n) row after
        row, limits (n), and the forces of the joints that do not hold (n).
        """
        import casadi

        rows = list(self.rows)
        matrix = casadi.vec(casadi.densify(response[rows, :].T))
        return casadi.vertcat(self.velocity, acceleration[rows], matrix, self.limit, self.sliding)


def _solved(matrix: casadi.SX, right: casadi.SX) -> casadi.SX:
    """The solution of a symmetric positive definite system by L D Lᵀ."""
    import casadi

    pivots, lower, order = casadi.ldl(casadi.densify(matrix), False)
    return casadi.ldl_solve(right, pivots, lower, order)
