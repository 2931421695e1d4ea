"""Linkages in metres and in the world's plane, checked apart from the closed form that found them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from bellcrank.arrays import Array, Complex

WORDS = {
    "four_bar": "four-bar",
    "slider_crank": "slider-crank",
    "stephenson": "Stephenson six-bar",
    "watt": "Watt six-bar",
}
CHECKED = 720  # crank angles over one turn, or over the range of a function


@dataclass(frozen=True, eq=False, kw_only=True)
class PlaneLinkage(ABC):
    """A crank and a coupler, in the plane x-y.

    Attributes:
        crank: m.
        coupler: m.
        pivot: The pivot of the crank (2,), m.
        ground_angle: rad, from x: the direction from the crank's pivot to that of a rocker, or in which a slider moves.
        point: The coupler point (2,), m: along the line from the crank's end to the coupler's other end, and to its
            left.
        angles: The crank's angles (n,) from the ground's direction at the given points, rad.
        error: The sum of the squared distances of the coupler point from the given points, m², or of the squared
            differences of the output from a given function, rad² or m².
        turn: The angle from the coupler's line to the direction that is given for it, rad; 0 where none is.
        turn_error: The sum of the squared angles from given directions, rad².
        input_offset: The crank's angle from the ground's direction less that which a function gives, rad; else 0.
        output_offset: The rocker's angle from the ground's direction, rad, or the slider's distance from the crank's
            pivot along the guide, m, less that which a function gives; else 0.
        of_range: Whether it is made for the range of its angles; else the crank turns fully.
    """

    crank: float
    coupler: float
    pivot: tuple[float, float]
    ground_angle: float
    point: tuple[float, float] = (0.0, 0.0)
    angles: Array
    error: float = 0.0
    turn: float = 0.0
    turn_error: float = 0.0
    input_offset: float = 0.0
    output_offset: float = 0.0
    of_range: bool = False

    @property
    @abstractmethod
    def lengths(self) -> dict[str, float]:
        """Its lengths by name, m."""

    @abstractmethod
    def postures(self, angles: Array) -> tuple[Complex, Complex]:
        """Both ends (n,) of the coupler in the plane as x + i y, that of the crank first, by the intersection of a
        circle about the crank's end with a circle or line; NaN where there is none.
        """

    @abstractmethod
    def output(self, angles: Array) -> Array:
        """The output (n,) at crank angles (n,) from the ground's direction, as a function gives it: the rocker's angle,
        rad, without jumps and up to whole turns, or the slider's position, m.
        """

    @property
    @abstractmethod
    def turns_fully(self) -> bool:
        """Whether the crank turns fully, by the lengths alone."""

    @abstractmethod
    def _transmission(self, angles: Array) -> Array:
        """The transmission angles (n,) from 0 to 90 deg, rad, at crank angles (n,) from the ground's direction."""

    def _carrier(self, angles: Array) -> tuple[Complex, Complex, float]:
        """Both ends (n,) of the link with the coupler point, as x + i y, and its length, m."""
        return *self.postures(angles), self.coupler

    def directions(self, angles: Array) -> Complex:
        """e^{iα} (n,) of the coupler's direction α in the plane at crank angles (n,) from the ground's direction."""
        end, tip, length = self._carrier(angles)
        found: Complex = (tip - end) / length * np.exp(1j * self.turn)
        return found

    def path(self, angles: Array) -> Array:
        """The coupler points (n, 2), m, at crank angles (n,) from the ground's direction."""
        end, tip, length = self._carrier(angles)
        found = end + complex(*self.point) * (tip - end) / length
        return np.stack([found.real, found.imag], axis=1)

    def checked_angles(self, count: int = CHECKED + 1) -> Array:
        """Crank angles (count,) over a turn, or over the range that it is made for."""
        if self.of_range:
            return np.linspace(self.angles[0], self.angles[-1], count)
        return np.linspace(0.0, 2.0 * np.pi, count)

    @property
    def transmission_angle(self) -> float:
        """The least transmission angle over a turn, or over the range that it is made for, rad: that between coupler
        and rocker, or between coupler and the normal of the guide. NaN where it does not assemble.
        """
        return float(self._transmission(self.checked_angles()).min())

    @property
    def assembles(self) -> bool:
        """Whether circles, or circle and line, intersect at 720 crank angles over a turn, and the crank turns fully by
        the lengths; or at 720 angles over the range that it is made for.
        """
        there = np.isfinite(self.path(self.checked_angles())).all()
        return bool(there) and (self.of_range or self.turns_fully)

    def _crank_ends(self, angles: Array) -> Complex:
        ends: Complex = complex(*self.pivot) + self.crank * np.exp(1j * (angles + self.ground_angle))
        return ends


@dataclass(frozen=True, eq=False, kw_only=True)
class FourBar(PlaneLinkage):
    """A four-bar with a coupler point; a crank-rocker, unless it is made for a range of the crank's angle.

    Attributes:
        ground: The distance of the pivots, m; that of the rocker lies in the direction `ground_angle`.
        rocker: m.
        branch: 1.0 where the rocker's end is to the left of the line from the crank's end to the rocker's pivot, else
            −1.0.
    """

    ground: float
    rocker: float
    branch: float

    @property
    def lengths(self) -> dict[str, float]:
        """Its lengths by name, m."""
        return {name: getattr(self, name) for name in ("ground", "crank", "coupler", "rocker")}

    def postures(self, angles: Array) -> tuple[Complex, Complex]:
        """The ends (n,) of crank and rocker in the plane as x + i y, by the intersection of circles; NaN where there is
        none.
        """
        end = self._crank_ends(angles)
        return end, _corner(end, self.rocker_pivot, self.coupler, self.rocker, self.branch)

    @property
    def rocker_pivot(self) -> complex:
        """The pivot of the rocker in the plane as x + i y, m."""
        return complex(complex(*self.pivot) + self.ground * np.exp(1j * self.ground_angle))

    def output(self, angles: Array) -> Array:
        """See `PlaneLinkage`."""
        on_rocker = (self.postures(angles)[1] - self.rocker_pivot) * np.exp(-1j * self.ground_angle)
        return np.unwrap(np.angle(on_rocker * np.exp(-1j * self.output_offset)))

    @property
    def turns_fully(self) -> bool:
        """Whether it is a Grashof linkage whose crank turns fully: the crank is the shortest link; or the ground is,
        where it is made for a range.
        """
        links = sorted(self.lengths.values())
        turning = (self.crank, self.ground) if self.of_range else (self.crank,)
        return links[0] in turning and links[0] + links[3] < links[1] + links[2]

    def _transmission(self, angles: Array) -> Array:
        end, tip = self.postures(angles)
        return _between(end - tip, self.rocker_pivot - tip)


@dataclass(frozen=True, eq=False, kw_only=True)
class SixBar(FourBar):
    """A crank-rocker with a dyad from its coupler to the ground (Stephenson III) or to its rocker (Watt I): a link,
    which has the coupler point, and a second rocker.

    Attributes:
        on_rocker: Whether the second rocker is on the rocker.
        joint: The joint of the coupler and the link (2,), m: along the line of the coupler from the crank's end, and to
            its left.
        second_pivot: The pivot of the second rocker (2,), m: along the line of the ground from the crank's pivot, and
            to its left; or along the line of the rocker from its pivot, and to its left.
        link: m, from the coupler to the second rocker. `point` is along it from the coupler, and to its left.
        second_rocker: m.
        second_branch: 1.0 where the link's end is to the left of the line from the joint to the second pivot, else
            −1.0.
    """

    on_rocker: bool
    joint: tuple[float, float]
    second_pivot: tuple[float, float]
    link: float
    second_rocker: float
    second_branch: float

    @property
    def lengths(self) -> dict[str, float]:
        """Its lengths by name, m."""
        return super().lengths | {"link": self.link, "second rocker": self.second_rocker}

    @property
    def turns_fully(self) -> bool:
        """Whether the crank is the shortest link of a Grashof linkage, without the dyad."""
        links = sorted(super().lengths.values())
        return links[0] == self.crank and links[0] + links[3] < links[1] + links[2]

    def dyad(self, angles: Array) -> tuple[Complex, Complex, Complex]:
        """The link's ends and the second pivot (n,) in the plane as x + i y, by the intersection of circles; NaN where
        there is none.
        """
        end, tip = self.postures(angles)
        first = end + complex(*self.joint) * (tip - end) / self.coupler
        if self.on_rocker:
            last = self.rocker_pivot + complex(*self.second_pivot) * (tip - self.rocker_pivot) / self.rocker
        else:
            ahead = complex(*self.second_pivot) * np.exp(1j * self.ground_angle)
            last = np.full(len(angles), complex(*self.pivot) + ahead)
        return first, _corner(first, last, self.link, self.second_rocker, self.second_branch), last

    def _carrier(self, angles: Array) -> tuple[Complex, Complex, float]:
        first, corner, _ = self.dyad(angles)
        return first, corner, self.link

    def _transmission(self, angles: Array) -> Array:
        first, corner, last = self.dyad(angles)
        return np.minimum(super()._transmission(angles), _between(first - corner, last - corner))


@dataclass(frozen=True, eq=False, kw_only=True)
class SliderCrank(PlaneLinkage):
    """A slider-crank with a coupler point.

    Attributes:
        offset: The distance of the slider's line to the left of the crank's pivot, seen in the direction
            `ground_angle`, m.
        branch: 1.0 where the slider is ahead of the crank's end in that direction, else −1.0.
    """

    offset: float
    branch: float = 1.0

    @property
    def lengths(self) -> dict[str, float]:
        """Its lengths by name, m."""
        return {name: getattr(self, name) for name in ("crank", "coupler", "offset")}

    def postures(self, angles: Array) -> tuple[Complex, Complex]:
        """The crank's end and the slider (n,) in the plane as x + i y, by the intersection of a circle with the guide's
        line; NaN where there is none.
        """
        end, guide = self._crank_ends(angles), np.exp(1j * self.ground_angle)
        beside = (complex(*self.pivot) - end) / guide
        height = beside.imag + self.offset
        with np.errstate(invalid="ignore"):
            ahead = self.branch * np.sqrt(self.coupler**2 - height**2)
        return end, end + guide * (ahead + 1j * height)

    def output(self, angles: Array) -> Array:
        """See `PlaneLinkage`."""
        from_pivot = (self.postures(angles)[1] - complex(*self.pivot)) * np.exp(-1j * self.ground_angle)
        return np.asarray(from_pivot.real - self.output_offset)

    @property
    def turns_fully(self) -> bool:
        """Whether the crank turns fully: crank and offset together are shorter than the coupler."""
        return self.crank + abs(self.offset) < self.coupler

    def _transmission(self, angles: Array) -> Array:
        end, tip = self.postures(angles)
        along = (tip - end) * np.exp(-1j * self.ground_angle)
        return np.asarray(np.arctan2(np.abs(along.real), np.abs(along.imag)))


def _corner(first: Complex, last: Complex | complex, near: float, far: float, branch: float) -> Complex:
    """Where circles about two points (n,) with radii `near` and `far` intersect: to the left of the line from the first
    to the last for branch 1, to its right for −1; NaN where they do not.
    """
    between = last - first
    distance = np.abs(between)
    along = (near**2 - far**2 + distance**2) / (2.0 * distance)
    with np.errstate(invalid="ignore"):
        across = branch * np.sqrt(near**2 - along**2)
    found: Complex = first + between / distance * (along + 1j * across)
    return found


def _between(first: Complex, second: Complex) -> Array:
    """The angles (n,) from 0 to 90 deg between two lines, rad."""
    angle = np.abs(np.angle(first / second))
    return np.minimum(angle, np.pi - angle)
