"""A film: everything that a replay page shows, as plain data, whatever it was made from.

Lengths in m, times in s, angles in rad; positions and directions in the world, but for what says otherwise. A pose is
seven numbers: position x y z and quaternion x y z w.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bellcrank.motion.resampling import SHARE

Array = NDArray[np.float64]
Triple = tuple[float, float, float]
Pose = tuple[float, float, float, float, float, float, float]
HOME: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles: vertices (k, 3) float32 in m, and faces (m, 3) int32, counter-clockwise from outside."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]


@dataclass(frozen=True)
class Shape:
    """One solid of a body, at a `pose` in the body's frame, of a `colour` (red, green, blue, opacity; 0 to 1 each).

    `size` is (x, y, z) of a box, (radius, length along z) of a cylinder, (radius,) of a sphere, and the scale along x,
    y and z of a mesh. Shapes may share a `mesh`. `stand_in` says that the URDF has no visual there and this is only a
    hint.
    """

    kind: Literal["box", "cylinder", "sphere", "mesh"]
    size: tuple[float, ...]
    colour: tuple[float, float, float, float]
    pose: Pose = HOME
    mesh: Mesh | None = None
    stand_in: bool = False


@dataclass(frozen=True)
class Body:
    """Shapes that move together, by the link's name."""

    name: str
    shapes: tuple[Shape, ...]


@dataclass(frozen=True, eq=False)
class Trace:
    """A curve that is drawn as it happens: points (m, 3) at times (m,), such as a tip's path or a contact's trace."""

    name: str
    time: Array
    points: Array


@dataclass(frozen=True, eq=False)
class Arrow:
    """A force or torque, in `unit`, that acts at points (n, 3): vectors (n, 3), one a frame of the film.

    `about` says that it turns about its vector, as a torque does. With `time` (n,), which does not go back, there is
    one of each a time of its own instead.
    """

    name: str
    unit: str
    points: Array
    vectors: Array
    about: bool = False
    time: Array | None = None


@dataclass(frozen=True, eq=False)
class Spring:
    """A spring between two points: ends (n, 2, 3), one pair a frame of the film."""

    name: str
    ends: Array


@dataclass(frozen=True, eq=False)
class Rod:
    """A thin rod between two points: ends (n, 2, 3), one pair a frame of the film."""

    name: str
    ends: Array


@dataclass(frozen=True)
class Axis:
    """A joint's axis: a point and a unit direction in the frame of body number `body`; `spring`: a torsion spring."""

    name: str
    body: int
    point: Triple
    direction: Triple
    spring: bool = False


@dataclass(frozen=True)
class Mark:
    """Something that happened, as a mark on the time line with its text."""

    time: float
    text: str


@dataclass(frozen=True, eq=False)
class Line:
    """Values (m,) of one name at times (m,) of its own that do not go back: a jump has its time twice; else over its
    chart's time.
    """

    name: str
    values: Array
    time: Array | None = None


@dataclass(frozen=True, eq=False)
class Chart:
    """Lines of one unit over times (m,) that do not go back; `share` of its range is how far a line that goes straight
    between its times may be off, None where there are only extremes, between which nothing is known.
    """

    title: str
    unit: str
    time: Array
    lines: tuple[Line, ...]
    logarithmic: bool = False
    share: float | None = SHARE


@dataclass(frozen=True, eq=False)
class Plane:
    """One quantity against another over times (m,), such as torque against speed, with closed limits (k, 2) around;
    times, and `share`, are as a chart's.
    """

    title: str
    x_label: str
    y_label: str
    time: Array
    x: Array
    y: Array
    limits: tuple[tuple[str, Array], ...] = ()
    share: float | None = SHARE


@dataclass(frozen=True)
class Ground:
    """A plane to draw: its unit normal and how far along it it lies (m)."""

    normal: Triple
    height: float


@dataclass(frozen=True)
class Camera:
    """Where the eye is, what it looks at, and which way is up; its vertical field of view is 40 degrees."""

    position: Triple
    target: Triple
    up: Triple


@dataclass(frozen=True, eq=False)
class Film:
    """Poses (n, bodies, 7) at increasing times (n,), and what goes with them.

    Between frames positions go straight and orientations turn evenly; frames are so close that this is off by no more
    than `bound` (m) at any point of the bodies; what is filmed is a smooth curve through the rows that are known.
    `facts` are what a reader wants to know at the top: (name, value), the answer first, which `good` says is yes.
    """

    title: str
    time: Array
    poses: Array
    bodies: tuple[Body, ...]
    camera: Camera
    bound: float
    ground: Ground | None = None
    traces: tuple[Trace, ...] = ()
    arrows: tuple[Arrow, ...] = ()
    springs: tuple[Spring, ...] = ()
    axes: tuple[Axis, ...] = ()
    marks: tuple[Mark, ...] = ()
    charts: tuple[Chart, ...] = ()
    planes: tuple[Plane, ...] = ()
    facts: tuple[tuple[str, str], ...] = ()
    good: bool = True
    rods: tuple[Rod, ...] = ()
    notes: tuple[str, ...] = field(default=())  # what a reader should know of the picture: simplified meshes, stand-ins
