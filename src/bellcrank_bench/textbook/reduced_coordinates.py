"""Mechanisms with constraints reduced by hand to their fewest coordinates: no multiplier, and no constraint that drifts.

Sources of the mechanisms: A. Ghosal, Dynamics and Control of Mechanical Systems, NPTEL 2022, lecture 18; IFToMM library
of computational benchmark problems, A02 and A04.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class FourBar:
    """A planar four-bar without gravity, whose crank a spring turns with the torque preload − stiffness · angle.

    Lengths (ground, crank, coupler, rocker) and CG distances in m, masses in kg, inertias about the CG in kg m², the
    spring in N m and N m/rad. The reduced state is (crank's angle, its rate), (..., 2); the loop is closed by the
    cosine rule, on the branch with the closing joint left of the way from the crank's tip to the rocker's pivot.
    """

    ground: float = 1.241
    length: tuple[float, float, float] = (1.241, 1.2, 1.2)
    mass: tuple[float, float, float] = (20.15, 8.25, 8.25)
    center: tuple[float, float, float] = (1.2, 0.6, 0.6)
    inertia: tuple[float, float, float] = (9.6, 0.06, 0.06)
    preload: float = 1.96
    stiffness: float = 0.1

    def directions(self, crank: NDArray[Any]) -> NDArray[Any]:
        """Unit vectors along crank, coupler and rocker, (3, ..., 2), at angles of the crank (...)."""
        l1, l2, l3 = self.length
        first = np.stack([np.cos(crank), np.sin(crank)], -1)
        way = np.array([self.ground, 0.0]) - l1 * first  # from the crank's tip to the rocker's pivot
        distance = np.sqrt((way * way).sum(-1))[..., None]
        along = way / distance
        cosine = (distance * distance + l2 * l2 - l3 * l3) / (2.0 * l2 * distance)
        left = np.stack([-along[..., 1], along[..., 0]], -1)
        second = cosine * along + np.sqrt(1.0 - cosine * cosine) * left
        return np.stack([first, second, (l2 * second - way) / l3])

    def derivative(self, x: NDArray[Any]) -> NDArray[Any]:
        """Rates (..., 2) of the reduced state, in its own precision: Jourdain's principle along the one free motion."""
        e = self.directions(x[..., 0])
        w, bend = self._rates(e, x[..., 1])
        k, _ = self._rates(e, np.ones_like(x[..., 1]))
        m, h = self._inertial(e, w)
        spring = self.preload - self.stiffness * x[..., 0]
        force = spring - (k * (np.einsum("ij...,j...->i...", m, bend) + h)).sum(0)
        return np.stack([x[..., 1], force / np.einsum("i...,ij...,j...->...", k, m, k)], -1)

    def angles(self, x: NDArray[Any]) -> NDArray[Any]:
        """Crank, coupler (relative to it, in [0, 2π)) and rocker, rad, and their rates, rad/s, (..., 6)."""
        e = self.directions(x[..., 0])
        w, _ = self._rates(e, x[..., 1])
        second, third = (np.arctan2(d[..., 1], d[..., 0]) for d in e[1:])
        # pi as exact as the state: numpy's constant is a double
        coupler = np.mod(second - x[..., 0], 8 * np.arctan(np.ones((), x.dtype)))
        return np.stack([x[..., 0], coupler, third, w[0], w[1] - w[0], w[2]], -1)

    def energy(self, x: NDArray[Any]) -> NDArray[Any]:
        """Kinetic energy and what is left of the spring's, J, (...)."""
        e = self.directions(x[..., 0])
        w, _ = self._rates(e, x[..., 1])
        m, _ = self._inertial(e, w)
        kinetic = 0.5 * np.einsum("i...,ij...,j...->...", w, m, w)
        return np.asarray(kinetic - self.preload * x[..., 0] + 0.5 * self.stiffness * x[..., 0] ** 2)

    def _rates(self, e: NDArray[Any], rate: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Angular velocities (3, ...) of the links, and their angular accelerations where the crank's is zero."""
        l1, l2, l3 = self.length
        s12, s13, s23 = (_sine(e[i], e[j]) for i, j in ((0, 1), (0, 2), (1, 2)))
        c12, c13, c23 = ((e[i] * e[j]).sum(-1) for i, j in ((0, 1), (0, 2), (1, 2)))
        w = np.stack([rate, -rate * l1 * s13 / (l2 * s23), -rate * l1 * s12 / (l3 * s23)])
        q1, q2, q3 = w * w
        second = (l3 * q3 - l1 * q1 * c13 - l2 * q2 * c23) / (l2 * s23)
        third = (l3 * q3 * c23 - l1 * q1 * c12 - l2 * q2) / (l3 * s23)
        return w, np.stack([np.zeros_like(rate), second, third])

    def _inertial(self, e: NDArray[Any], w: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Mass matrix (3, 3, ...) and centrifugal torques (3, ...) in the links' absolute angles."""
        (l1, _, _), (m1, m2, m3), (r1, r2, r3) = self.length, self.mass, self.center
        i1, i2, i3 = self.inertia
        coupling = m2 * l1 * r2
        c, s = coupling * (e[0] * e[1]).sum(-1), coupling * _sine(e[0], e[1])
        none, one = np.zeros_like(c), np.ones_like(c)
        crank, coupler, rocker = i1 + m1 * r1 * r1 + m2 * l1 * l1, i2 + m2 * r2 * r2, i3 + m3 * r3 * r3
        matrix = np.array([[crank * one, c, none], [c, coupler * one, none], [none, none, rocker * one]])
        return matrix, np.stack([s * w[1] * w[1], -s * w[0] * w[0], none])


@dataclass(frozen=True)
class RollingDisk:
    """A thin disk that rolls on a horizontal plane; radius in m, g in m/s². The mass has no influence.

    The state (..., 8) is (x, y) of the centre, the angles tilt, heading and spin (about X', Z and Y''), and the
    angular velocity in the axes after heading and tilt. Moments about the contact point and v = ω × (r ẑ') are all
    there is: no constraint is left.
    """

    radius: float = 0.1
    g: float = 9.81

    def derivative(self, x: NDArray[Any]) -> NDArray[Any]:
        """Rates (..., 8), in the state's own precision."""
        tilt, heading, (wx, wy, wz) = x[..., 2], x[..., 3], np.moveaxis(x[..., 5:], -1, 0)
        s, c, r = np.sin(tilt), np.cos(tilt), self.radius
        turn = wz * s / c  # angular velocity of the axes about the disk's
        forward, side = r * wy, -r * wx  # velocity of the centre along X' and Y'
        return np.stack([
            forward * np.cos(heading) - side * np.sin(heading) * c,
            forward * np.sin(heading) + side * np.cos(heading) * c,
            wx, wz / c, wy - turn,
            (6 * wy * wz - turn * wz + 4 * self.g / r * s) / 5,  # about X': inertia (1/4 + 1) m r²
            -2 * wx * wz / 3,  # about the axis: (1/2 + 1) m r²
            wx * (turn - 2 * wy),
        ], -1)  # fmt: skip

    def centre(self, x: NDArray[Any]) -> NDArray[Any]:
        """Position (..., 3) of the centre from (x, y, tilt, ...)."""
        return np.stack([x[..., 0], x[..., 1], self.radius * np.cos(x[..., 2])], -1)

    def energy(self, x: NDArray[Any]) -> NDArray[Any]:
        """Kinetic and potential energy by the mass, J/kg, (...)."""
        wx, wy, wz = np.moveaxis(x[..., 5:], -1, 0)
        kinetic = 0.5 * self.radius**2 * (1.25 * wx * wx + 1.5 * wy * wy + 0.25 * wz * wz)
        return np.asarray(kinetic + self.g * self.radius * np.cos(x[..., 2]))


@dataclass(frozen=True)
class FourBars:
    """`loops` parallelogram four-bars in a row, of rods of 1 m and 1 kg: a pendulum, singular wherever it lies flat.

    The state (..., 2) is a crank's angle from upright, rad, and its rate; g in m/s².
    """

    loops: int
    g: float = 9.81

    def derivative(self, x: NDArray[Any]) -> NDArray[Any]:
        """Rates (..., 2), in the state's own precision."""
        weight, inertia = self._sums(x.dtype)
        return np.stack([x[..., 1], self.g * weight / inertia * np.sin(x[..., 0])], -1)

    def energy(self, x: NDArray[Any]) -> NDArray[Any]:
        """Kinetic and potential energy, J, (...)."""
        weight, inertia = self._sums(x.dtype)
        return np.asarray(0.5 * inertia * x[..., 1] ** 2 + self.g * weight * np.cos(x[..., 0]))

    def _sums(self, kind: Any) -> tuple[Any, Any]:
        """First and second moment of all rods, kg m and kg m²: cranks turn, couplers go round with their tops."""
        cranks = np.array(self.loops + 1, kind)
        return cranks / 2 + self.loops, cranks / 3 + self.loops


@dataclass(frozen=True)
class SteadyTurn:
    """A cart on two wheels of one axle that goes round steadily: speed in m/s, rate in rad/s, height of the axle in m.

    The state (..., 3) is (x, y, heading). Its centre of mass lies below the axle, on the line that does not move: no
    force turns or pitches it, and the wheels' kinematics are all there is.
    """

    speed: float = 1.1
    rate: float = 0.5
    height: float = 0.1

    def derivative(self, x: NDArray[Any]) -> NDArray[Any]:
        """Rates (..., 3), in the state's own precision."""
        turn = np.full_like(x[..., 2], self.rate)
        return np.stack([self.speed * np.cos(x[..., 2]), self.speed * np.sin(x[..., 2]), turn], -1)

    def place(self, x: NDArray[Any]) -> NDArray[Any]:
        """Position (..., 3) of the middle of the axle from (x, y, ...)."""
        return np.stack([x[..., 0], x[..., 1], np.full_like(x[..., 0], self.height)], -1)


@dataclass(frozen=True)
class BricardRing:
    """Six rods of 1 m and 1 kg, of square section, hinged in a ring at right angles, one of them the ground; g in m/s²
    along -y.

    The angles between successive rods are in turn θ and φ, and the ring is closed where cos θ + cos φ + cos θ cos φ = 0
    (Y. Chen, Z. You and T. Tarnai, Int. J. Solids Struct. 42 (2005) 2287, at a twist of 90°). With p = (φ + θ)/2 and
    m = (φ − θ)/2 that is cos p + cos m = 1, so one parameter s goes round all postures: sin(p/2) = sin(s)/√2,
    sin(m/2) = cos(s)/√2. The state (..., 2) is (s, ṡ); s = π/2 is the hexagon on a cube.
    """

    side: float = 0.1
    g: float = 9.81

    @property
    def rods(self) -> NDArray[np.float64]:
        """The five moving rods at the start, (5, 3), m, from P0 = 0 on; hinges along y, z, x, y, z and, at P5, x."""
        return np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, 1], [-1, 0, 0], [0, 1, 0]])

    @property
    def inertias(self) -> NDArray[np.float64]:
        """Inertias (5, 3, 3) of the moving rods about their middles at the start, kg m²."""
        across, axial = (1 + self.side**2) / 12, self.side**2 / 6
        return np.array([across * np.eye(3) - (across - axial) * np.outer(rod, rod) for rod in self.rods])

    def derivative(self, x: NDArray[Any]) -> NDArray[Any]:
        """Rates (..., 2), in the state's own precision: Jourdain's principle along the one free motion."""
        inertia, bias, weight = self._sums(x[..., 0])
        return np.stack([x[..., 1], -(weight + bias * x[..., 1] ** 2) / inertia], -1)

    def energy(self, x: NDArray[Any]) -> NDArray[Any]:
        """Kinetic and potential energy (zero at the start, s = π/2), J, (...)."""
        rods, _ = _rods(self._five(x[..., 0])[0])
        middle = (np.cumsum(rods, 0) - rods / 2)[..., 1].sum(0)
        return np.asarray(0.5 * self._sums(x[..., 0])[0] * x[..., 1] ** 2 + self.g * (middle + 3.5))

    def corner(self, x: NDArray[Any]) -> NDArray[Any]:
        """The point P3 (..., 3), m, between the third rod and the fourth, from states (..., 1 or 2)."""
        return np.asarray(_rods(self._five(x[..., 0])[0])[0][:3].sum(0))

    def hinges(self, x: NDArray[Any]) -> NDArray[Any]:
        """Angles (..., 5) of the hinges from P0 on, rad, 0 at the start, from states (..., 1 or 2)."""
        return np.moveaxis(np.pi / 2 - self._five(x[..., 0])[0], 0, -1)

    def corner_of(self, hinges: NDArray[Any]) -> NDArray[Any]:
        """The same from the angles (..., 5) of the hinges from P0 on, rad, 0 at the start."""
        rods, _ = _rods(np.moveaxis(np.pi / 2 - hinges, -1, 0))
        return np.asarray(rods[:3].sum(0))

    def _five(self, s: NDArray[Any]) -> NDArray[Any]:
        """The angles θ, φ, θ, φ, θ between rods and their first and second derivatives by s, (3, 5, ...)."""
        root = np.sqrt(np.full_like(s, 2.0))
        sine, cosine = np.sin(s), np.cos(s)
        a, b = np.sqrt(1 - sine**2 / 2), np.sqrt(1 - cosine**2 / 2)  # cos(p/2) and cos(m/2)
        p = np.stack([2 * np.arcsin(sine / root), root * cosine / a, -sine / (root * a**3)])
        m = np.stack([2 * np.arcsin(cosine / root), -root * sine / b, -cosine / (root * b**3)])
        return np.stack([p - m, p + m], 1)[:, [0, 1, 0, 1, 0]]

    def _sums(self, s: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Inertia I, its half derivative and the derivative of the potential by s: I s̈ + ½ I' ṡ² + V' = 0."""
        angle, first, second = self._five(s)
        rods, axes = _rods(angle)
        first, second = first[..., None], second[..., None]
        turning = -(first * axes).cumsum(0)
        turning_rate = -(second * axes + first * _cross(turning, axes)).cumsum(0)
        along = _cross(turning, rods)
        bending = _cross(turning_rate, rods) + _cross(turning, along)
        moving, moving_rate = along.cumsum(0) - along / 2, bending.cumsum(0) - bending / 2
        across = (1 + self.side**2) / 12
        momentum = across * turning - (across - self.side**2 / 6) * (rods * turning).sum(-1, keepdims=True) * rods
        inertia = (moving * moving + turning * momentum).sum((0, -1))
        bias = (moving * moving_rate + momentum * turning_rate).sum((0, -1))
        return inertia, bias, self.g * moving[..., 1].sum(0)


def _rods(angle: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Unit vectors (5, ..., 3) along Bricard's moving rods and along the hinges at their beginnings, from the angles
    (5, ...) between successive rods.
    """
    cosines, sines, identity = np.cos(angle)[..., None], np.sin(angle)[..., None], np.eye(3, dtype=angle.dtype)
    # the ground, from P5 to P0; the hinge at P5; normal = rod × axis
    rod, axis, normal = -identity[2], identity[0], -identity[1]
    rods, axes = [], []
    for k, (c, s) in enumerate(zip(cosines, sines, strict=True)):
        sign = 1 if k % 2 else -1
        turned = sign * axis
        rod, axis, normal = c * rod - s * turned, sign * normal, -(c * turned + s * rod)
        rods.append(rod)
        axes.append(axis)
    axes[0] = np.broadcast_to(axes[0], rods[0].shape)
    return np.array(rods), np.array(axes)


def _sine(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """sin(α − β) of unit vectors (..., 2) at the angles α and β."""
    return np.asarray(a[..., 1] * b[..., 0] - a[..., 0] * b[..., 1])


def _cross(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """a × b of vectors (..., 3); faster than numpy's where there are few."""
    one, two = np.array([1, 2, 0]), np.array([2, 0, 1])
    return np.asarray(a.take(one, -1) * b.take(two, -1) - a.take(two, -1) * b.take(one, -1))
