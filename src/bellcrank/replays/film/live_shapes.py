"""What the view of a page that computes shows, as expressions of a state: bodies, traces, springs, rods, stretch.

The page of a run has them among what it shows of each state (live_run_film.py), that of a sizing in a function of the
places in its motions (live_film.py).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.arrays import Array
from bellcrank.elements.frame_forces import Spring as FrameSpring
from bellcrank.elements.joint_forces import JointSpring
from bellcrank.elements.loop_constraints import WORLD, Distance
from bellcrank.elements.rolling_constraint import RollingDisk
from bellcrank.motion.kinematics.rotations import conjugate, from_matrices, rotate
from bellcrank.numerics import pseudo_inverse
from bellcrank.replays.film.arrows import child_link
from bellcrank.replays.film.sampled_trajectory import frame_pose_function
from bellcrank.replays.geometry.placeholder_shapes import LinkLayout
from bellcrank.replays.geometry.shapes import DrawnBody

if TYPE_CHECKING:
    import casadi

    from bellcrank.codegen.compile import Compiled
    from bellcrank.elements.parameters import Parameter
    from bellcrank.elements.symbols import Symbols
    from bellcrank.replays.film.film import Film
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene


NEGLIGIBLE = 1e-9  # of the largest distance of a point on the link: rounding errors
_POSE_NUMBERS = 12  # position 3, rotation 9


class LinkStretch:
    """Linear maps that stretch the shapes of bodies from the URDF's link lengths to those of a design.

    The points of a link are where joints, fixed links and user frames are on it. With these points E (3, m) of the URDF
    and E' of the design, both in the frame of the body, the map is I + (E' - E) E⁺. Among those that fit E' best it
    changes the least (the Frobenius norm of its difference from I), so that nothing happens across the points.
    """

    def __init__(self, robot: Robot, bodies: Sequence[DrawnBody], parameters: Mapping[str, Parameter]) -> None:
        layout = LinkLayout(robot.urdf, robot.user_frames)
        ends: dict[str, list[str]] = {carrier: [] for carrier in layout.links_of}
        for joint in robot.urdf.joints.values():
            ends[layout.carrier[joint.parent]].append(joint.child)
        for name, (link, _, _) in robot.user_frames.items():
            ends[layout.carrier[link]].append(name)
        self.rows = dict[str, int]()  # of bodies of one name the first is the link
        for k, body in enumerate(bodies):
            self.rows.setdefault(body.name, k)
        self.ends = [(name, ends[layout.carrier[name]]) for name in self.rows if name in layout.carrier]
        self.count = len(bodies)
        self.frames = tuple(dict.fromkeys(name for body, points in self.ends for name in (body, *points)))
        self.neutral = robot.neutral[None]
        self.pose_function = frame_pose_function(robot, self.frames, parameters)
        self.nominal = self._points(frame_pose_function(robot, self.frames), np.zeros(0))

    def maps(self, parameters: Array) -> Array:
        """The maps (bodies, 3, 3) for values (np,) of the parameters."""
        found = np.tile(np.eye(3), (self.count, 1, 1))
        for name, points in self._points(self.pose_function, parameters).items():
            nominal = self.nominal[name]
            change = points - nominal
            if np.isfinite(change).all() and np.abs(change).max() > NEGLIGIBLE * np.abs(nominal).max():
                found[self.rows[name]] += change @ pseudo_inverse(nominal, "points on a link are", NEGLIGIBLE)
        return found

    def expressions(self, symbols: Symbols) -> Iterator[tuple[int, casadi.SX]]:
        """(number of the body, its map (3, 3)) as an expression of the parameters, of those that depend on them."""
        import casadi

        frames = symbols.frames_at(self.frames, casadi.SX(casadi.DM(self.neutral[0])))
        for body, ends in self.ends:
            if not ends:
                continue
            here, nominal = frames[body], self.nominal[body]
            points = casadi.horzcat(*(here.rotation.T @ (frames[name].position - here.position) for name in ends))
            if casadi.depends_on(casadi.vec(points), symbols.p) and np.abs(nominal).max() > 0.0:
                back = pseudo_inverse(nominal, "points on a link are", NEGLIGIBLE)
                yield self.rows[body], casadi.SX.eye(3) + (points - casadi.DM(nominal)) @ casadi.DM(back)

    def _points(self, pose_function: Compiled, parameters: Array) -> dict[str, Array]:
        """The points (3, m) of each body in its frame."""
        poses = np.asarray(pose_function(self.neutral, parameters)).reshape(len(self.frames), _POSE_NUMBERS)
        index = {name: k for k, name in enumerate(self.frames)}
        found = {}
        for body, points in self.ends:
            if points:
                place, turn = poses[index[body], :3], from_matrices(poses[index[body], 3:].reshape(3, 3))
                away = poses[[index[name] for name in points], :3] - place
                found[body] = rotate(np.tile(conjugate(turn), (len(away), 1)), away).T
        return found


class ShownExpressions:
    """Expressions, one after the other, and the place of each among them; `film` is what the page shows.

    `content` names the places: of twelve numbers of each body (position, and rotation row by row), nine of each
    stretched link, three of each trace, six of each spring and rod.
    """

    def __init__(self, film: Film, scene: Scene | None) -> None:
        self.film, self.scene = film, scene
        self.found: list[casadi.SX] = []
        self.size = 0
        self.content: dict[str, Any] = {}

    def add(self, value: casadi.SX) -> int:
        """The place of an expression, whose elements follow each other column by column."""
        import casadi

        value = casadi.vec(casadi.densify(value))
        self.found.append(value)
        self.size += value.numel()
        return self.size - value.numel()

    def all(self) -> casadi.SX:
        """All of them."""
        import casadi

        return casadi.vertcat(casadi.SX(0, 1), *self.found)

    def add_shapes(self, symbols: Symbols, parameters: dict[str, Parameter]) -> None:
        """Everything that the view shows but arrows; `parameters` are those of `symbols`."""
        import casadi

        film = self.film
        frames = [symbols.frame(body.name) for body in film.bodies]
        poses = (casadi.vertcat(each.position, casadi.vec(each.rotation.T)) for each in frames)
        self.content["bodies"] = [self.add(pose) for pose in poses]
        stretch = LinkStretch(symbols.robot, film.bodies, parameters).expressions(symbols)
        self.content["stretch"] = [[body, self.add(way.T)] for body, way in stretch]
        self.content["traces"] = [self.add(self._traced(symbols, trace.name)) for trace in film.traces]
        springs, rods = dict(self._springs(symbols)), dict(self._rods(symbols))
        self.content["springs"] = [self.add(springs[spring.name]) for spring in film.springs]
        self.content["rods"] = [self.add(rods[rod.name]) for rod in film.rods]

    def _traced(self, symbols: Symbols, name: str) -> casadi.SX:
        constraints = () if self.scene is None else self.scene.constraints
        disks = {f"{each.name} contact": each for each in constraints if isinstance(each, RollingDisk)}
        return disks[name].contact_point(symbols) if name in disks else symbols.frame(name).position

    def _springs(self, symbols: Symbols) -> Iterator[tuple[str, casadi.SX]]:
        """The ends of springs, as `scene_springs` (arrows.py)."""
        import casadi

        for force in () if self.scene is None else self.scene.forces:
            if isinstance(force, FrameSpring):
                fixed = force.frame_b == WORLD
                b = force.vector(symbols, "point") if fixed else symbols.frame(force.frame_b).position
                yield force.name, casadi.vertcat(symbols.frame(force.frame_a).position, b)
            elif isinstance(force, JointSpring) and force.joint.kind == "prismatic":
                link = symbols.frame(child_link(symbols.robot, force.joint.name))
                axis = casadi.DM(symbols.robot.joint_axis(force.joint.name))
                travel = symbols.q[force.joint.q] * (link.rotation @ axis)
                yield force.name, casadi.vertcat(link.position - travel, link.position)

    def _rods(self, symbols: Symbols) -> Iterator[tuple[str, casadi.SX]]:
        import casadi

        for constraint in () if self.scene is None else self.scene.constraints:
            if isinstance(constraint, Distance):
                yield constraint.name, casadi.vertcat(*(side.position for side in constraint.sides(symbols)))
