"""A four-bar in metres and in the world's plane, checked apart from the closed form that found it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bellcrank.studies.synthesis.four_bar import Array, Complex

CHECKED = 720  # crank angles over one turn


@dataclass(frozen=True, eq=False, kw_only=True)
class FourBar:
    """A crank-rocker with a coupler point, in the plane x-y.

    Attributes:
        ground: The distance of the pivots, m.
        crank: m.
        coupler: m.
        rocker: m.
        pivot: The pivot of the crank (2,), m; that of the rocker lies at `ground` in the direction `ground_angle`.
        ground_angle: rad, from x.
        point: The coupler point (2,), m: along the line from the crank's end to the rocker's, and to its left.
        branch: 1.0 where the rocker's end is to the left of the line from the crank's end to the rocker's pivot, else
            −1.0.
        angles: The crank's angles (n,) from the ground line at the given points, rad.
        error: The sum of the squared distances of the coupler point from the given points, m².
    """

    ground: float
    crank: float
    coupler: float
    rocker: float
    pivot: tuple[float, float]
    ground_angle: float
    point: tuple[float, float]
    branch: float
    angles: Array
    error: float

    def postures(self, angles: Array) -> tuple[Complex, Complex]:
        """The ends (n,) of crank and rocker in the plane as x + i y, by the intersection of circles; NaN where there is
        none.
        """
        crank_pivot = complex(*self.pivot)
        rocker_pivot = crank_pivot + self.ground * np.exp(1j * self.ground_angle)
        end = crank_pivot + self.crank * np.exp(1j * (angles + self.ground_angle))
        between = rocker_pivot - end
        distance = np.abs(between)
        along = (self.coupler**2 - self.rocker**2 + distance**2) / (2.0 * distance)
        with np.errstate(invalid="ignore"):
            across = self.branch * np.sqrt(self.coupler**2 - along**2)
        return end, end + between / distance * (along + 1j * across)

    def path(self, angles: Array) -> Array:
        """The coupler points (n, 2), m, at crank angles (n,) from the ground line."""
        end, tip = self.postures(angles)
        found = end + complex(*self.point) * (tip - end) / self.coupler
        return np.stack([found.real, found.imag], axis=1)

    @property
    def transmission_angle(self) -> float:
        """The least angle between the lines of coupler and rocker over a turn, rad; NaN where it does not assemble."""
        end, tip = self.postures(np.linspace(0.0, 2.0 * np.pi, CHECKED + 1))
        pivot = complex(*self.pivot) + self.ground * np.exp(1j * self.ground_angle)
        angle = np.abs(np.angle((end - tip) / (pivot - tip)))
        return float(np.minimum(angle, np.pi - angle).min())

    @property
    def assembles(self) -> bool:
        """Whether circles intersect at 720 crank angles over a turn, and the crank is the shortest link of a Grashof
        linkage.
        """
        links = sorted([self.ground, self.crank, self.coupler, self.rocker])
        grashof = links[0] == self.crank and links[0] + links[3] < links[1] + links[2]
        return grashof and bool(np.isfinite(self.path(np.linspace(0.0, 2.0 * np.pi, CHECKED, endpoint=False))).all())


def four_bar(
    links: Array, branch: float, placement: Complex, angles: Array, centre: complex, size: float, points: Complex
) -> FourBar:
    """The linkage of a fit to points that were moved by their `centre` and divided by their `size`; `points` are as
    they were given.
    """
    pivot, crank, coupler = centre + size * placement[0], size * placement[1], size * placement[2]
    length, direction = abs(crank), crank / abs(crank)
    point = coupler / direction  # the coupler's angle is measured from the ground line
    found = FourBar(
        ground=float(links[0] * length),
        crank=float(length),
        coupler=float(links[1] * length),
        rocker=float(links[2] * length),
        pivot=(float(pivot.real), float(pivot.imag)),
        ground_angle=float(np.angle(direction)),
        point=(float(point.real), float(point.imag)),
        branch=branch,
        angles=angles,
        error=0.0,
    )
    gaps = found.path(angles) @ np.array([1.0, 1.0j]) - points
    return replace(found, error=float((np.abs(gaps) ** 2).sum()))


def file_texts(linkage: FourBar, name: str, urdf: str, remark: str) -> tuple[str, str]:
    """The texts of the URDF and of the scene in which the crank turns once and the coupler passes the points; `urdf` is
    the name of the former's file.
    """
    import yaml

    first, last = float(linkage.angles[0]), float(linkage.angles[-1])
    turn = first + (2.0 * np.pi if last >= first else -2.0 * np.pi)
    end, tip = linkage.postures(np.array([first]))
    pivot = complex(*linkage.pivot) + linkage.ground * np.exp(1j * linkage.ground_angle)
    coupler = float(np.angle((tip - end)[0])) - linkage.ground_angle - first
    rocker = float(np.angle((tip - pivot)[0])) - linkage.ground_angle
    data = {
        "name": name,
        "urdf": urdf,
        "gravity": [0, 0, 0],
        "frames": {
            "coupler_end": {"link": "coupler_link", "xyz": [linkage.coupler, 0.0, 0.0]},
            "rocker_end": {"link": "rocker_link", "xyz": [linkage.rocker, 0.0, 0.0]},
            "coupler_point": {"link": "coupler_link", "xyz": [*linkage.point, 0.0]},
        },
        "constraints": [
            {"name": "pin", "kind": "point", "frame_a": "coupler_end", "frame_b": "rocker_end"},
            {"name": "drive", "kind": "prescribed_motion", "joint": "crank", "motion": "turn"},
        ],
        "actuated": ["crank"],
        "motions": {"turn": {"kind": "waypoints", "times": [0, 4], "positions": [{"crank": first}, {"crank": turn}]}},
        "initial": {
            "crank": first,
            "coupler": {"guess": float(np.angle(np.exp(1j * coupler)))},
            "rocker": {"guess": float(np.angle(np.exp(1j * rocker)))},
        },
        "parameters": {
            "crank_length": {"value": linkage.crank, "sets": ["joint.coupler.origin.x"]},
            "coupler_length": {"value": linkage.coupler, "sets": ["frame.coupler_end.origin.x"]},
            "rocker_length": {"value": linkage.rocker, "sets": ["frame.rocker_end.origin.x"]},
            "ground_length": {"value": linkage.ground, "sets": ["joint.rocker.origin.x"]},
        },
        "outputs": {"point": {"frame": "coupler_point", "what": "position"}},
        "simulate": {"duration": 4, "rtol": 1e-9, "atol": 1e-9},
    }
    head = f"# {remark}\n# The bars of the URDF have 1 kg/m, an assumption that acts on torques only."
    body = yaml.safe_dump(data, sort_keys=False, width=120)
    return _urdf(linkage, name), f"{head}\n{body}"


def _urdf(linkage: FourBar, name: str) -> str:
    links = ['  <link name="base"/>', '  <link name="ground"/>']
    for link, length in (("crank", linkage.crank), ("coupler", linkage.coupler), ("rocker", linkage.rocker)):
        inertia, thick = length**3 / 12.0, 0.04 * linkage.ground
        boxes = [(0.0, 0.0, length, 0.0)] + [(0.0, 0.0, *linkage.point)] * (link == "coupler")
        visuals = "".join(_bar(*box, thick) for box in boxes)
        links.append(
            f'  <link name="{link}_link">\n    <inertial><origin xyz="{0.5 * length!r} 0 0"/><mass value="{length!r}"/>'
            f'<inertia ixx="{1e-4 * inertia!r}" ixy="0" ixz="0" iyy="{inertia!r}" iyz="0" izz="{inertia!r}"/>'
            "</inertial>\n"
            f"{visuals}  </link>"
        )
    joints = [
        ("mount", "fixed", "base", "ground", f"{linkage.pivot[0]!r} {linkage.pivot[1]!r} 0", linkage.ground_angle),
        ("crank", "continuous", "ground", "crank_link", "0 0 0", 0.0),
        ("coupler", "continuous", "crank_link", "coupler_link", f"{linkage.crank!r} 0 0", 0.0),
        ("rocker", "continuous", "ground", "rocker_link", f"{linkage.ground!r} 0 0", 0.0),
    ]
    for joint, kind, parent, child, place, angle in joints:
        axis = "" if kind == "fixed" else '<axis xyz="0 0 1"/>'
        links.append(
            f'  <joint name="{joint}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{place}" rpy="0 0 {angle!r}"/>{axis}</joint>'
        )
    return f'<?xml version="1.0"?>\n<robot name="{name}">\n' + "\n".join(links) + "\n</robot>\n"


def _bar(x: float, y: float, to_x: float, to_y: float, thick: float) -> str:
    length, angle = float(np.hypot(to_x - x, to_y - y)), float(np.arctan2(to_y - y, to_x - x))
    return (
        f'    <visual><origin xyz="{0.5 * (x + to_x)!r} {0.5 * (y + to_y)!r} 0" rpy="0 0 {angle!r}"/>'
        f'<geometry><box size="{max(length, thick)!r} {thick!r} {0.5 * thick!r}"/></geometry></visual>\n'
    )
