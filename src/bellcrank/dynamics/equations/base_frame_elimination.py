"""Expressions without the coordinates of the joints that are attached to the world.

The mass matrix does not depend on these coordinates, and while constraints are differentiated the rotation of a free
base stands as nine symbols in place of its quaternion. Both remove most of the operations of a wheel or a disk, and the
mass matrix keeps its digits however far the base is from the origin.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from bellcrank.elements.symbols import FrameSymbols, Symbols

if TYPE_CHECKING:
    import casadi


def mass_matrix(s: Symbols) -> casadi.SX:
    """M (nv, nv), sparse, in kg, kg m and kg m².

    Kinetic energy does not depend on the position of a joint on the world, because its velocity is given in axes that
    turn with it. Such joints are traced at their neutral position, unless another joint mimics them.
    """
    import casadi

    tree = s.robot.equations.tree
    leaders = {mimic.leader for mimic in tree.mimics}
    on_world = {j.name for k, j in enumerate(tree.joints) if j.parent == 0 and k + 1 not in leaders}
    matrix = s.algorithm("mass_matrix")(_at_neutral(s, on_world), s.tracer_parameters)
    return casadi.sparsify(casadi.reshape(matrix, s.robot.nv, s.robot.nv))


class BaseRotation:
    """The rotation of a free base as nine symbols, and frames written in them (a FrameSource of `Symbols`).

    The rotation R (3, 3) changes at the rate R [ω]×, with ω the angular velocity in the base's axes, which has far
    fewer operations to differentiate than a quaternion.
    """

    def __init__(self, s: Symbols) -> None:
        import casadi

        self._symbols = s
        self.rotation = casadi.SX.sym("turn", 3, 3)
        self._local: dict[str, FrameSymbols] = {}
        self._in_world: dict[str, FrameSymbols] = {}

    def frame(self, name: str) -> FrameSymbols:
        """A frame's placement and velocity in the world."""
        if self._fixed_to_world(name):
            return self._symbols.frame(name)
        if name not in self._in_world:
            local, axes = self.local_frame(name)
            position, rotation, linear, angular = (axes @ part for part in local)
            self._in_world[name] = FrameSymbols(self._symbols.q[:3] + position, rotation, linear, angular)
        return self._in_world[name]

    def local_frame(self, name: str) -> tuple[FrameSymbols, casadi.SX]:
        """A frame's placement relative to the base, and its velocity, in the base's axes; and these axes (3, 3)."""
        s = self._symbols
        if self._fixed_to_world(name):
            return s.local_frame(name)
        if name not in self._local:
            wanted = [n for n in dict.fromkeys([*s.named_frames, name]) if n not in self._local]
            q = _at_neutral(s, {s.robot.joints[0].name})
            self._local |= s.frames_at([n for n in wanted if not self._fixed_to_world(n)], q)
        return self._local[name], self.rotation

    def derivative_along(self, expression: casadi.SX, step: casadi.SX) -> casadi.SX:
        """The derivative of an expression of q, v and the rotation, q moving along E(q) `step` (nv)."""
        import casadi

        s = self._symbols
        q_rate = s.algorithm("configuration_rate")(s.q, step)
        q_rate[:3] = self.rotation @ step[:3]
        rotation_rate = casadi.vec(self.rotation @ casadi.skew(step[3:6]))
        symbols = casadi.vertcat(s.q, casadi.vec(self.rotation))
        return casadi.jtimes(expression, symbols, casadi.vertcat(q_rate, rotation_rate))

    def expand(self, expression: casadi.SX) -> casadi.SX:
        """An expression with the rotation written in the quaternion (x, y, z, w)."""
        import casadi

        x, y, z, w = casadi.vertsplit(self._symbols.q[3:7])
        a, b, c = 2.0 * x, 2.0 * y, 2.0 * z  # the same terms as in the traced algorithms, to share them
        rows = (
            (1.0 - (b * y + c * z), b * x - c * w, c * x + b * w),
            (b * x + c * w, 1.0 - (a * x + c * z), c * y - a * w),
            (c * x - b * w, c * y + a * w, 1.0 - (a * x + b * y)),
        )
        rotation = casadi.vertcat(*[casadi.horzcat(*row) for row in rows])
        return casadi.sparsify(casadi.substitute(expression, casadi.vec(self.rotation), casadi.vec(rotation)))

    def _fixed_to_world(self, name: str) -> bool:
        robot = self._symbols.robot
        return robot.equations.tree.frames[robot.frame_index(name)].parent_joint == 0


def _at_neutral(s: Symbols, joints: set[str]) -> casadi.SX:
    """q with the coordinates of some joints at their neutral position."""
    import casadi

    q = casadi.SX(s.q)
    for joint in s.robot.joints:
        if joint.name in joints:
            for k in range(joint.q, joint.q + joint.nq):
                q[k] = float(s.robot.neutral[k])
    return q
