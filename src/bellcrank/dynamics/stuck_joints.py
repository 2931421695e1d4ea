"""The forces of joints that dry friction or a stop keeps at rest, and what a run needs to find which those are.

Forces x of dry friction and stops change the accelerations to v̇ + C x, C being the response to unit forces,
constraints included. With S = diag(1 for joints that hold, else 0) and A the rows of C at these joints, they stay at
rest with

    (S A S + 1 − S) x = −S v̇.

A is symmetric and, where the joints move freely of each other, positive definite. Near postures where constraints make
those that hold depend on each other, a small multiple of 1 is added and its effect taken away again by repeated solves
(kkt.py). Source: Pfeiffer & Glocker, Multibody Dynamics with Unilateral Contacts (1996), ch. 5.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from bellcrank.dynamics.kkt import REFINEMENTS, REGULARISATION
from bellcrank.elements.dry_friction import DryFriction
from bellcrank.elements.joint_stops import JointStop

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols

STARTED = 1e-9  # rad/s or m/s: a joint of this speed has a direction of motion
TINY = 1e-300  # N m or N, in place of no friction
FAR = 1e300  # rad or m: an end that is not there


@dataclass(frozen=True)
class StuckJoints:
    """The dry friction and the stops of a scene's joints (n) as expressions.

    Attributes:
        rows: The rows of their velocities in v and the auxiliary states after it.
        rotors: The inertia of a rotor of its own, by its place among them; the others are joints.
        width: The number of velocities and auxiliary states.
        direction: 1 forwards, −1 backwards, of joints that slide or are at their largest friction; 1 at a lower and −1
            at an upper stop (n).
        moves: 1 for joints that slide, or that a stop does not hold, else 0 (n).
        holds: 1 for joints that the force keeps at rest, else 0 (n).
        velocity: rad/s or m/s (n).
        least: The least and `most` the largest force at rest (n), N m or N.
        sliding: The force of the others (n); 0 for those that hold, and of stops.
        lasting: Functions (n) of x that are positive while the modes last.
        ends: Lower and upper end and restitution (n, 3); 0 for dry friction.
    """

    rows: tuple[int, ...]
    rotors: dict[int, casadi.SX]
    width: int
    direction: casadi.SX
    moves: casadi.SX
    holds: casadi.SX
    velocity: casadi.SX
    least: casadi.SX
    most: casadi.SX
    sliding: casadi.SX
    lasting: tuple[Callable[[casadi.SX], casadi.SX], ...]
    ends: casadi.SX

    @classmethod
    def of(cls, parts: Sequence[DryFriction | JointStop], s: Symbols) -> StuckJoints:
        """Those of a scene, in a run."""
        import casadi

        modes = [casadi.vertsplit(s.signal(part.mode)) for part in parts]
        direction, moves, holds, _ = (casadi.vertcat(*column) for column in zip(*modes, strict=True))
        found = [
            _stop(part, mode, s) if isinstance(part, JointStop) else _friction(part, mode, s)
            for part, mode in zip(parts, modes, strict=True)
        ]
        shafts = [part.shaft(s) for part in parts]
        return cls(
            tuple(shaft.row for shaft in shafts),
            {k: shaft.inertia for k, shaft in enumerate(shafts) if shaft.inertia is not None},
            s.robot.nv + s.z.numel(),
            direction,
            moves,
            holds,
            casadi.vertcat(*[shaft.velocity for shaft in shafts]),
            casadi.vertcat(*[each.least for each in found]),
            casadi.vertcat(*[each.most for each in found]),
            casadi.vertcat(*[each.sliding for each in found]),
            tuple(each.lasts for each in found),
            casadi.vertcat(*[each.ends for each in found]),
        )

    def responses(self, of_joints: Sequence[casadi.SX], nv: int) -> casadi.SX:
        """C (width, n) from the accelerations (nv) by unit forces at the joints among them, in their order."""
        import casadi

        found, joints = [], iter(of_joints)
        for k, row in enumerate(self.rows):
            column = casadi.SX(self.width, 1)
            if k in self.rotors:
                column[row] = 1.0 / self.rotors[k]
            else:
                column[:nv] = next(joints)
            found.append(column)
        return casadi.horzcat(*found)

    def inertias(self, diagonal: casadi.SX) -> casadi.SX:
        """The own inertias (n) of rotors, and of joints from the diagonal of M (nv)."""
        import casadi

        return casadi.vertcat(
            *[self.rotors[k] if k in self.rotors else diagonal[row] for k, row in enumerate(self.rows)]
        )

    def forces(self, acceleration: casadi.SX, response: casadi.SX, inertia: casadi.SX, *, regular: bool) -> casadi.SX:
        """x (n) of accelerations (width) without it, the response C (width, n), and the own inertias (n).

        `regular`: the joints move freely of each other.
        """
        import casadi

        rows, count = list(self.rows), len(self.rows)
        masked = casadi.diag(self.holds * casadi.sqrt(inertia))
        matrix = masked @ response[rows, :] @ masked + casadi.diag(1.0 - self.holds)
        right = -(masked @ entries(acceleration, rows))
        if regular:
            return masked @ _solved(matrix, right)
        factored = matrix + REGULARISATION * casadi.SX.eye(count)
        x = _solved(factored, right)
        for _ in range(REFINEMENTS):
            x = x + _solved(factored, right - matrix @ x)
        return masked @ x

    def at_rest(self, vector: casadi.SX) -> casadi.SX:
        """Accelerations (width) or displacements (nv), exactly 0 where a joint or rotor does not move."""
        import casadi

        found = casadi.SX(vector)
        for k, row in enumerate(self.rows):
            if row < found.numel():
                found[row] = self.moves[k] * found[row]
        return found

    def switches(self, x: casadi.SX) -> casadi.SX:
        """Functions (n) that are positive while the modes last."""
        import casadi

        return casadi.vertcat(*[lasts(x[k]) for k, lasts in enumerate(self.lasting)])

    def turn(self, acceleration: casadi.SX, response: casadi.SX, inertia: casadi.SX) -> casadi.SX:
        """What a run needs to find new modes: velocity (n), acceleration without the forces x (n), C column after
        column, least and largest force at rest (n), the forces of the joints that do not hold (n), lower and upper end
        and restitution of stops (n), and the joints' own inertias (n).
        """
        import casadi

        columns = casadi.vec(casadi.densify(response))
        forces = casadi.vertcat(self.least, self.most, self.sliding)
        states = casadi.vertcat(self.velocity, entries(acceleration, self.rows))
        return casadi.vertcat(states, columns, forces, casadi.vec(self.ends), inertia)


class _Part(NamedTuple):
    """One of them: bounds of its force, the force of sliding, what is positive while its mode lasts, ends (1, 3)."""

    least: casadi.SX
    most: casadi.SX
    sliding: casadi.SX
    lasts: Callable[[casadi.SX], casadi.SX]
    ends: casadi.SX


def _friction(part: DryFriction, mode: Sequence[casadi.SX], s: Symbols) -> _Part:
    """While it slides d v is positive, else 1 − (x / limit)², with the slack that a run allows.

    A joint that constraints alone determine slides even at rest, then with d = 0 until it has a velocity.
    """
    import casadi

    direction, moves, _, slack = mode
    (least, most), velocity = part.limits(s), part.shaft(s).velocity

    def lasts(x: casadi.SX) -> casadi.SX:
        share = x / most if part.rotor is None else casadi.if_else(x > 0.0, x / most, x / least)
        if part.engaged is not None:
            share = x / casadi.fmax(most, TINY)
        begins = (1.0 - direction * direction) * (STARTED * STARTED - velocity * velocity)
        found = moves * (direction * velocity + begins) + (1.0 - moves) * (1.0 + slack - share * share)
        if part.engaged is None:
            return found
        free = 2.0 * moves * (1.0 - direction * direction) - 1.0  # a released brake: neither stuck nor sliding
        return casadi.if_else(most > 0.0, found, free)

    return _Part(least, most, part.sliding(s, direction), lasts, casadi.SX.zeros(1, 3))


def _stop(part: JointStop, mode: Sequence[casadi.SX], s: Symbols) -> _Part:
    """While it holds its force pushes, or it is latched; else the joint is in its range."""
    import casadi

    direction, moves, holds, _ = mode
    lower, upper, place = part.end(s, "lower"), part.end(s, "upper"), s.joint(part.joint).position
    above, below = math.isfinite(part.number("lower")), math.isfinite(part.number("upper"))
    room = place - lower if above else upper - place
    if above and below:
        room = room * (upper - place) / (upper - lower)
    ends = [lower if above else casadi.SX(-FAR), upper if below else casadi.SX(FAR)]
    none = casadi.SX(0)
    latched = part.latch
    return _Part(
        none, none, none, lambda x: holds * (1.0 if latched else direction * x) + moves * room,
        casadi.horzcat(*ends, casadi.SX(part.value(s, "restitution"))),
    )  # fmt: skip


def entries(vector: casadi.SX, rows: Sequence[int]) -> casadi.SX:
    """Entries of a column as a column; casadi's own indices give a row where the column has one entry."""
    import casadi

    return casadi.vertcat(*[vector[row] for row in rows])


def _solved(matrix: casadi.SX, right: casadi.SX) -> casadi.SX:
    """The solution of a symmetric positive definite system by L D Lᵀ."""
    import casadi

    pivots, lower, order = casadi.ldl(casadi.densify(matrix), False)
    return casadi.ldl_solve(right, pivots, lower, order)
