"""What the view of a page that computes shows, as expressions of a state: bodies, traces, springs, rods, stretch.

The page of a run has them among what it shows of each state (live_run_film.py), that of a sizing in a function of the
places in its motions (live_film.py).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from bellcrank.elements.frame_forces import Spring as FrameSpring
from bellcrank.elements.joint_forces import JointSpring
from bellcrank.elements.loop_constraints import WORLD, Distance
from bellcrank.elements.rolling_constraint import RollingDisk
from bellcrank.replays.film.arrows import child_link
from bellcrank.replays.film.link_stretch import LinkStretch

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.parameters import Parameter
    from bellcrank.elements.symbols import Symbols
    from bellcrank.replays.film.film import Film
    from bellcrank.scene.scene import Scene


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
