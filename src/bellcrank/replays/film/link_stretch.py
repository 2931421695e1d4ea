"""How the shapes of links follow parameters of a design that move joints and frames on them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.motion.kinematics.quaternions import conjugate, from_matrices, rotate
from bellcrank.numerics import pseudo_inverse
from bellcrank.replays.film.sampled_trajectory import frame_pose_function
from bellcrank.replays.geometry.link_layout import LinkLayout
from bellcrank.replays.geometry.shapes import DrawnBody

if TYPE_CHECKING:
    import casadi

    from bellcrank.codegen.compile import Compiled
    from bellcrank.elements.parameters import Parameter
    from bellcrank.elements.symbols import Symbols
    from bellcrank.robot.robot import Robot

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
