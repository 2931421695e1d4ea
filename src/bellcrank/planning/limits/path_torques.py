"""The motors' torques along a path, as functions of the path speed and the path acceleration.

Along a path q(s), with the path speed y = ds/dt and the path acceleration u = d²s/dt²,

    q̇ = q' y,    q̈ = q' u + q'' y²,    τ = M q' u + (M q'' + C(q, q') q') y² + g + friction(q' y),

so that each torque is  a u + b y² + d y + c + Σ_j w_j σ(q'_j y / width_j)  with all that is linear in the speed in d,
viscous friction and linear dampers alike, and Coulomb friction, smoothed as in the equations of motion, in w (Bobrow,
Dubowsky, Gibson, Int. J. Robotics Research 4, 1985; without friction). a, b, c and d follow from inverse dynamics at
four states a place, two of which move forth and back, w from the friction of each joint through the motors' shares.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bellcrank.actuators.actuator import Actuator
from bellcrank.arrays import Array, Indices
from bellcrank.cached_values import cached_property
from bellcrank.dynamics.inverse.mechanism import Mechanism, joint_frictions
from bellcrank.errors import InputError
from bellcrank.planning.limits.limit_rows import LimitedQuantity
from bellcrank.planning.limits.motor_limits import DrivenAxes

ROUNDING = 1e-5  # of the largest torque of any joint, by which smaller ones may be rounding
NO_DAMPING = 1e-12  # of the largest torque: less that is odd in the speed is rounding
AGREEMENT = 1e-8  # relative: the model of a torque over the path speed against inverse dynamics
CHECKED = ((2.0, 0.0), (0.5, 1.0))  # path speeds and times at which the model is compared
CHECKED_ACCELERATION = 0.3


@dataclass(frozen=True, eq=False)
class PathTerms:
    """Coefficients at n places of k quantities: a, b, d, c (n, k) and w (n, k, j)."""

    a: Array
    b: Array
    d: Array
    c: Array
    w: Array

    def of_quantities(self, quantities: Sequence[LimitedQuantity], slope: Array, second: Array) -> PathTerms:
        """The coefficients of shares of the torques with inertias added, in C order.

        Args:
            quantities: The first k are the torques themselves.
            slope: Derivatives (n, c) of the coordinates with respect to the path, by which u accelerates them.
            second: Their second derivatives.

        Returns:
            The coefficients.
        """
        if len(quantities) == self.a.shape[1]:
            return PathTerms(*(np.ascontiguousarray(each) for each in (self.a, self.b, self.d, self.c, self.w)))
        motor, share, column, inertia = (np.array(each) for each in zip(*quantities, strict=True))
        a, b, d, c = (np.ascontiguousarray(each[:, motor] * share) for each in (self.a, self.b, self.d, self.c))
        a += slope[:, column] * inertia
        b += second[:, column] * inertia
        return PathTerms(a, b, d, c, np.ascontiguousarray(self.w[:, motor] * share[:, None]))


@dataclass(frozen=True, eq=False)
class PathTorques:
    """The torques of a mechanism's motors along paths, without the rotors of actuators.

    Attributes:
        mechanism: The mechanism, with payloads and forces.
        actuators: Motor and gear by joint.
        axes: The axes of the motors.
    """

    mechanism: Mechanism
    actuators: Mapping[str, Actuator]
    axes: DrivenAxes

    @cached_property
    def columns(self) -> list[int]:
        """The velocity coordinates (k,) of the motors' joints."""
        return [joint.v for joint in self.mechanism.motors]

    @cached_property
    def _rotor(self) -> Array:
        """Inertia (k,) in the mechanism's torques that belongs to an actuator's rotor."""
        given = self.mechanism.robot.rotor_inertia
        return np.array([given[j.v] if j.name in self.actuators else 0.0 for j in self.mechanism.motors])

    @cached_property
    def _coulomb(self) -> Array:
        """Of each Coulomb friction the joint forces (j, nv)."""
        dry = [friction for friction in joint_frictions(self.mechanism) if friction.coulomb > 0.0]
        found = np.zeros((len(dry), self.mechanism.robot.nv))
        for k, friction in enumerate(dry):
            found[k, friction.column] = friction.coulomb
        return found

    @cached_property
    def coulomb_columns(self) -> list[int]:
        """The velocity coordinates (j,) of the Coulomb frictions."""
        return [friction.column for friction in joint_frictions(self.mechanism) if friction.coulomb > 0.0]

    @cached_property
    def widths(self) -> Array:
        """The speeds (j,), rad/s or m/s, over which the Coulomb frictions are smoothed."""
        return np.array([friction.width for friction in joint_frictions(self.mechanism) if friction.coulomb > 0.0])

    def exact(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """The torques (n, k) of a motion of positions q, velocities v and accelerations a (n, nv)."""
        return self.mechanism.torques(t, q, v, a)[0] - self._rotor * a[:, self.columns]

    def terms(self, q: Array, first: Array, second: Array) -> PathTerms:
        """The coefficients at places of a path, with derivatives (n, nv) of the positions with respect to the path: of
        the joints' torques, and where motors move several joints of the torques at all axes after them.
        """
        found = self._of_joints(q, first, second)
        a, b, d, c = (self.axes.with_torques(each) for each in (found.a, found.b, found.d, found.c))
        return PathTerms(a, b, d, c, self.axes.with_torques(found.w.swapaxes(1, 2)).swapaxes(1, 2))

    def _of_joints(self, q: Array, first: Array, second: Array) -> PathTerms:
        t, still = np.zeros(len(q)), np.zeros_like(first)
        equations, motors = self.mechanism.equations, self.mechanism.torque_map(t, q)
        c = motors(equations.needed(t, q, still, still))
        a = motors(equations.needed(t, q, still, first)) - c
        forth, back = (motors(equations.needed(t, q, way * first, second)) for way in (1.0, -1.0))
        b, d = (forth + back) / 2.0 - c, (forth - back) / 2.0
        w = np.zeros((*c.shape, len(self.widths)))
        if len(self.widths):
            for k, forces in enumerate(self._coulomb):
                w[:, :, k] = motors(np.broadcast_to(forces, first.shape))
            d = d - self._friction(w, first, 1.0)
        d[np.abs(d) <= NO_DAMPING * np.abs(forth).max(initial=0.0)] = 0.0
        columns = self.columns
        return PathTerms(a - self._rotor * first[:, columns], b - self._rotor * second[:, columns], d, c, w)

    def _friction(self, w: Array, first: Array, speed: float) -> Array:
        """Coulomb friction (n, k) at a path speed."""
        z = first[:, self.coulomb_columns] * speed / self.widths
        return np.asarray(np.einsum("nkj,nj->nk", w, z / np.sqrt(1.0 + z * z)))

    def check_states(self, q: Array, first: Array, second: Array) -> None:
        """Raise InputError where the torques at places of a path, with derivatives of the positions with respect to the
        path, are not those of the model: where a force depends on time, or on velocity otherwise than by inertia,
        linear damping and friction.
        """
        terms, u = self._of_joints(q, first, second), CHECKED_ACCELERATION
        for speed, time in CHECKED:
            exact = self.exact(np.full(len(q), time), q, speed * first, u * first + speed * speed * second)
            model = u * terms.a + speed * speed * terms.b + speed * terms.d + terms.c
            model += self._friction(terms.w, first, speed)
            scale = sum(np.max(np.abs(each), axis=0) for each in (terms.a, terms.b, terms.c))
            off = np.max(np.abs(model - exact), axis=0) - AGREEMENT * (scale + ROUNDING * np.max(scale))
            if np.any(off > 0.0):
                joint = self.mechanism.motors[int(np.argmax(off))].name
                raise InputError(
                    f"the torque of joint '{joint}' depends on time, or on velocity otherwise than by inertia, linear "
                    "damping and Coulomb friction; the fastest motion along a path cannot be computed with such forces"
                )


# ---- The states and torques of a mechanism at places of a path, each place computed once.


@dataclass(frozen=True, eq=False)
class PathPlaces:
    """Places of a path.

    Attributes:
        q: Positions (n, nq).
        first: Their first derivatives (n, nv) with respect to the path.
        second: Their second derivatives.
        terms: The coefficients of the motors' torques.
    """

    q: Array
    first: Array
    second: Array
    terms: PathTerms

    @property
    def _arrays(self) -> tuple[Array, ...]:
        terms = self.terms
        return self.q, self.first, self.second, terms.a, terms.b, terms.d, terms.c, terms.w

    def taken(self, index: Indices) -> PathPlaces:
        """The places of these numbers."""
        q, first, second, *terms = (each[index] for each in self._arrays)
        return PathPlaces(q, first, second, PathTerms(*terms))

    def joined(self, other: PathPlaces) -> PathPlaces:
        """These places and others behind them."""
        pairs = zip(self._arrays, other._arrays, strict=True)
        q, first, second, *terms = (np.concatenate(pair) for pair in pairs)
        return PathPlaces(q, first, second, PathTerms(*terms))


class KnownPlaces:
    """Places that are kept once `compute` has found them for path parameters (n,)."""

    def __init__(self, compute: Callable[[Array], PathPlaces]) -> None:
        self._compute = compute
        self._s: Array = np.zeros(0)  # rising
        self._found: PathPlaces | None = None

    def at(self, s: Array) -> PathPlaces:
        """The places at path parameters (n,)."""
        new = np.setdiff1d(s, self._s)
        if self._found is None:
            self._s, self._found = new, self._compute(new)
        elif len(new):
            both = np.concatenate([self._s, new])
            order = np.argsort(both)
            self._s, self._found = both[order], self._found.joined(self._compute(new)).taken(order)
        return self._found.taken(np.searchsorted(self._s, s))
