"""The forces of joints that dry friction or a stop keeps at rest, and what a run needs to find which those are.

Forces x of dry friction and stops change the accelerations to v̇ + C x, C being the response to unit forces,
constraints included. The velocities of the joints are w = G v: rows of v, or those of pins of loops. With
S = diag(1 for joints that hold, else 0) and A = G C, they stay at rest with

    (S A S + 1 − S) x = −S (G v̇ + Ġ v).

A is symmetric and, where the joints move freely of each other, positive definite. Near postures where constraints make
those that hold depend on each other, a small multiple of 1 is added and its effect taken away again by repeated solves
(kkt.py). Source: Pfeiffer & Glocker, Multibody Dynamics with Unilateral Contacts (1996), ch. 5.

Other joints of a linkage that is held exert no force, and are at rest exactly (`RestingJoint`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from bellcrank.dynamics.constraints.constraint_derivatives import time_derivative
from bellcrank.dynamics.equations.kkt import REFINEMENTS, REGULARISATION
from bellcrank.elements.dry_friction import DryFriction, RestingJoint
from bellcrank.elements.element import Force
from bellcrank.elements.joint_forces import JointForce
from bellcrank.elements.joint_stops import JointStop

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols

STARTED = 1e-9  # rad/s or m/s: a joint of this speed has a direction of motion
TINY = 1e-300  # N m or N, in place of no friction
FAR = 1e300  # rad or m: an end that is not there


@dataclass(frozen=True)
class StuckJoints:
    """The dry friction and the stops of a scene's joints as expressions: n with forces, of m with modes.

    Attributes:
        rows: The rows of their velocities in v and the auxiliary states after it; −1 for pins of loops.
        rotors: The inertia of a rotor of its own, by its place among them; the others are joints, pins or gears.
        own: Of rotors and gears with backlash, by their places, which entry of these velocities a unit force
            accelerates beside the robot, and by how much.
        twists: The joints whose velocities the twist rates of gears are relative to, by their places: entries of v.
        ways: G of the pins and of rotors behind gears with backlash, and `drifts` Ġ v, by their places.
        width: The number of velocities and auxiliary states.
        count: n, those with forces, which are the first.
        direction: 1 forwards, −1 backwards, of joints that slide or are at their largest friction; 1 at a lower and −1
            at an upper stop (m).
        moves: 1 for joints that slide, or that a stop does not hold, else 0 (m).
        holds: 1 for joints that the force keeps at rest, else 0 (m).
        velocity: rad/s or m/s (m).
        least: The least and `most` the largest force at rest (m), N m or N.
        sliding: The force of the others (m); 0 for those that hold, and of stops.
        lasting: Functions (m) of x that are positive while the modes last.
        ends: Lower and upper end and restitution (m, 3); of dry friction `beyond`.
    """

    rows: tuple[int, ...]
    rotors: dict[int, casadi.SX]
    own: dict[int, tuple[int, casadi.SX]]
    twists: dict[int, int]
    ways: dict[int, casadi.SX]
    drifts: dict[int, casadi.SX]
    width: int
    count: int
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
    def of(cls, parts: Sequence[DryFriction | JointStop | RestingJoint], s: Symbols, damping: casadi.SX) -> StuckJoints:
        """Those of a scene, in a run. `damping` (1/s) times its velocity is added to the acceleration of a pin."""
        import casadi

        modes = [casadi.vertsplit(s.signal(part.mode)) for part in parts]
        direction, moves, holds, _ = (casadi.vertcat(*column) for column in zip(*modes, strict=True))
        found = [_part(part, mode, s) for part, mode in zip(parts, modes, strict=True)]
        shafts = [part.shaft(s) for part in parts]
        pins = {k: shaft.velocity for k, shaft in enumerate(shafts) if shaft.row < 0}
        return cls(
            tuple(shaft.row for shaft in shafts),
            {k: shaft.inertia for k, shaft in enumerate(shafts) if shaft.inertia is not None},
            {k: shaft.own for k, shaft in enumerate(shafts) if shaft.own is not None},
            {k: shaft.against for k, shaft in enumerate(shafts) if shaft.against is not None},
            {
                k: casadi.jacobian(velocity, s.v if shafts[k].inertia is None else casadi.vertcat(s.v, s.z))
                for k, velocity in pins.items()
            },
            {k: time_derivative(velocity, s) + damping * velocity for k, velocity in pins.items()},
            s.robot.nv + s.z.numel(),
            sum(not isinstance(part, RestingJoint) for part in parts),
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

    def unit_forces(self, nv: int) -> list[casadi.SX]:
        """The generalised forces (nv) of unit forces at those that are not rotors, in their order."""
        import casadi

        eye, found = casadi.DM.eye(nv), []
        for k, row in enumerate(self.rows):
            if k in self.twists:
                found.append(casadi.SX(-eye[:, self.twists[k]]))
            elif k not in self.rotors:
                found.append(self.ways[k].T if k in self.ways else casadi.SX(eye[:, row]))
        return found

    def responses(self, of_robot: Sequence[casadi.SX], nv: int) -> casadi.SX:
        """C (width, m) from the accelerations (nv) by `unit_forces`."""
        import casadi

        found, others = [], iter(of_robot)
        for k in range(len(self.rows)):
            column = casadi.SX(self.width, 1)
            if k not in self.rotors:
                column[:nv] = next(others)
            if k in self.own:
                row, compliance = self.own[k]
                column[row] = compliance
            found.append(self.relative(column))
        return casadi.horzcat(*found)

    def relative(self, accelerations: casadi.SX) -> casadi.SX:
        """Accelerations (width) of which those of twists, still of their rotors over the ratio, become relative."""
        import casadi

        found = casadi.SX(accelerations)
        for k, joint in self.twists.items():
            found[self.rows[k]] -= found[joint]
        return found

    def inertias(self, diagonal: casadi.SX) -> casadi.SX:
        """The own inertias (m) of rotors, and those of joints and pins by the diagonal of M (nv)."""
        import casadi

        found = []
        for k, row in enumerate(self.rows):
            if k in self.ways and k not in self.rotors:
                way = casadi.densify(self.ways[k].T)
                found.append(1.0 / (casadi.sum1(way * way / diagonal) + 1.0 / FAR))
            elif k in self.twists:
                found.append(1.0 / (self.own[k][1] + 1.0 / diagonal[self.twists[k]]))
            else:
                found.append(self.rotors[k] if k in self.rotors else diagonal[row])
        return casadi.vertcat(*found)

    def entries(self, vector: casadi.SX) -> casadi.SX:
        """G applied to velocities or a response (width, …): (m, …)."""
        import casadi

        return casadi.vertcat(
            *[self.ways[k] @ vector[: self.ways[k].size2(), :] if k in self.ways else vector[row, :]
              for k, row in enumerate(self.rows)]
        )  # fmt: skip

    def accelerations(self, vector: casadi.SX) -> casadi.SX:
        """G v̇ + Ġ v (m) of accelerations (width)."""
        import casadi

        found = casadi.SX(self.entries(vector))
        for k, drift in self.drifts.items():
            found[k] += drift
        return found

    def forces(self, rates: casadi.SX, response: casadi.SX, inertia: casadi.SX, *, regular: bool) -> casadi.SX:
        """x (n) that takes what rates (m) hold to 0, by the response C (width, m) and the own inertias (m).

        `regular`: the joints move freely of each other.
        """
        import casadi

        count = self.count
        masked = casadi.diag(self.holds[:count] * casadi.sqrt(inertia[:count]))
        coupling = self.entries(response[:, :count])[:count, :]
        matrix = masked @ coupling @ masked + casadi.diag(1.0 - self.holds[:count])
        right = -(masked @ rates[:count])
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
            if 0 <= row < found.numel():
                found[row] = self.moves[k] * found[row]
        return found

    def pins_at_rest(
        self, change: casadi.SX, velocity: casadi.SX, response: casadi.SX, inertia: casadi.SX
    ) -> casadi.SX:
        """A change (nv) of the velocity (nv) after which pins that hold have none."""
        import casadi

        change = self.at_rest(change)
        if not {*self.ways} - {*self.rotors}:
            return change
        rest = casadi.SX(self.width - change.numel(), 1)
        rates = self.entries(casadi.vertcat(velocity + change, rest))
        for k in {*self.ways} & {*self.rotors}:  # which constraints do not move
            rates[k] = 0.0
        more = response[:, : self.count] @ self.forces(rates, response, inertia, regular=False)
        return self.at_rest(change + more[: change.numel()])

    def switches(self, x: casadi.SX) -> casadi.SX:
        """Functions (m) that are positive while the modes last."""
        import casadi

        every = casadi.vertcat(x, casadi.SX(len(self.lasting) - self.count, 1))
        return casadi.vertcat(*[lasts(every[k]) for k, lasts in enumerate(self.lasting)])

    def turn(self, acceleration: casadi.SX, response: casadi.SX, inertia: casadi.SX) -> casadi.SX:
        """What a run needs to find new modes: velocity (m), acceleration without the forces x (m), C column after
        column, G C likewise, least and largest force at rest (m), the forces of the joints that do not hold (m), lower
        and upper end and restitution of stops (m), and the joints' own inertias (m).
        """
        import casadi

        columns = casadi.vertcat(
            casadi.vec(casadi.densify(response)), casadi.vec(casadi.densify(self.entries(response)))
        )
        forces = casadi.vertcat(self.least, self.most, self.sliding)
        states = casadi.vertcat(self.velocity, self.accelerations(acceleration))
        return casadi.vertcat(states, columns, forces, casadi.vec(self.ends), inertia)


def key_of(part: Force) -> str:
    """The key of a scene file that describes dry friction or a stop."""
    if isinstance(part, JointForce):
        return f"joints.{part.joint.name}.{part.kind}"
    return part.place.path


class _Part(NamedTuple):
    """One of them: bounds of its force, the force of sliding, what is positive while its mode lasts, ends (1, 3)."""

    least: casadi.SX
    most: casadi.SX
    sliding: casadi.SX
    lasts: Callable[[casadi.SX], casadi.SX]
    ends: casadi.SX


def _part(part: DryFriction | JointStop | RestingJoint, mode: Sequence[casadi.SX], s: Symbols) -> _Part:
    import casadi

    if isinstance(part, RestingJoint):
        none = casadi.SX(0)
        return _Part(none, none, none, lambda x: casadi.SX(1.0), casadi.SX.zeros(1, 3))
    return _stop(part, mode, s) if isinstance(part, JointStop) else _friction(part, mode, s)


def _friction(part: DryFriction, mode: Sequence[casadi.SX], s: Symbols) -> _Part:
    """While it slides d v is positive, else 1 − (x / limit)², with the slack that a run allows.

    A joint that constraints alone determine slides even at rest, then with d = 0 until it has a velocity.
    """
    import casadi

    direction, moves, holds, slack = mode
    (least, most), velocity = part.limits(s), part.shaft(s).velocity

    def lasts(x: casadi.SX) -> casadi.SX:
        high, low = (casadi.fmax(most, TINY), casadi.fmin(least, -TINY)) if part.is_braked else (most, least)
        share = x / high if part.is_symmetric else casadi.if_else(x > 0.0, x / high, x / low)
        begins = (1.0 - direction * direction) * (STARTED * STARTED - velocity * velocity)
        found = moves * (direction * velocity + begins) + (1.0 - moves) * (1.0 + slack - share * share)
        if not part.is_braked:
            return found
        free = 1.0 - 2.0 * casadi.fmax(holds, direction * direction)  # a released brake exerts no force
        return casadi.if_else(most > 0.0, found, free)

    gain, gained = part.gain(s), part.gained(s)
    slides = part.sliding(s, direction) * gain
    return _Part(least - gained, most - gained, slides, lasts, part.beyond(s))


def _stop(part: JointStop, mode: Sequence[casadi.SX], s: Symbols) -> _Part:
    """While it holds its force pushes, or it is latched; else the joint is in its range."""
    import casadi

    direction, moves, holds, _ = mode
    lower, upper, place = part.end(s, "lower"), part.end(s, "upper"), part.position(s)
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


def _solved(matrix: casadi.SX, right: casadi.SX) -> casadi.SX:
    """The solution of a symmetric positive definite system by L D Lᵀ."""
    import casadi

    pivots, lower, order = casadi.ldl(casadi.densify(matrix), False)
    return casadi.ldl_solve(right, pivots, lower, order)
