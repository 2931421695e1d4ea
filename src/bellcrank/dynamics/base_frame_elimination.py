"""What the bodies next to the world make simpler: a mass matrix without their coordinates, and a free base's rotation
as nine symbols while constraints are differentiated.

Both save most of the work of a wheel or a disk, and M keeps its digits however far from the origin the base has gone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from bellcrank.elements.symbols import FrameSymbols, Symbols

if TYPE_CHECKING:
    import casadi


def mass_matrix(s: Symbols) -> casadi.SX:
    """M (nv, nv), sparse, in kg, kg m and kg m².

    The kinetic energy is the same wherever a joint on the world stands, as its velocity is told in axes that it turns
    with: such joints are traced at their neutral position, unless another joint mimics them.
    """
    import casadi

    tree = s.robot.equations.tree
    leaders = {mimic.leader for mimic in tree.mimics}
    on_world = {j.name for k, j in enumerate(tree.joints) if j.parent == 0 and k + 1 not in leaders}
    matrix = s.algorithm("mass_matrix")(_neutral(s, on_world), s.tracer_parameters)
    return casadi.sparsify(casadi.reshape(matrix, s.robot.nv, s.robot.nv))


class Turning(Symbols):
    """Symbols of a robot with a free base, whose frames are written in its rotation `turn` (3, 3), nine symbols.

    Along the motion turn' = turn [ω]×, ω the angular velocity in the base's axes, which is far less to differentiate
    than a quaternion.
    """

    def __init__(self, s: Symbols) -> None:
        import casadi

        self.__dict__.update(s.__dict__)
        self.turn = casadi.SX.sym("turn", 3, 3)
        self._frames = {}
        self._local: dict[str, FrameSymbols] = {}

    def frame(self, name: str) -> FrameSymbols:
        """A frame's placement and velocity in the world."""
        if name not in self._frames:
            local, axes = self.local_frame(name)
            if axes is not self.turn:
                return local
            position, rotation, linear, angular = (axes @ part for part in local)
            self._frames[name] = FrameSymbols(self.q[:3] + position, rotation, linear, angular)
        return self._frames[name]

    def local_frame(self, name: str) -> tuple[FrameSymbols, casadi.SX]:
        """A frame's placement from the base, and its velocity, in the base's axes; and these axes."""
        if self._on_world(name):
            return super().local_frame(name)
        if name not in self._local:
            wanted = [n for n in dict.fromkeys([*self._gathered, name]) if n not in self._local]
            q = _neutral(self, {self.robot.joints[0].name})
            self._local |= self._named_frames([n for n in wanted if not self._on_world(n)], q)
        return self._local[name], self.turn

    def _on_world(self, name: str) -> bool:
        index = self.robot.frame_index(name)
        return self.robot.equations.tree.frames[index].parent_joint == 0

    def expand(self, expression: casadi.SX) -> casadi.SX:
        """An expression with the rotation written in the quaternion (x, y, z, w)."""
        import casadi

        x, y, z, w = casadi.vertsplit(self.q[3:7])
        a, b, c = 2.0 * x, 2.0 * y, 2.0 * z  # in the terms of the traced algorithms, to share them
        rows = (
            (1.0 - (b * y + c * z), b * x - c * w, c * x + b * w),
            (b * x + c * w, 1.0 - (a * x + c * z), c * y - a * w),
            (c * x - b * w, c * y + a * w, 1.0 - (a * x + b * y)),
        )
        rotation = casadi.vertcat(*[casadi.horzcat(*row) for row in rows])
        return casadi.sparsify(casadi.substitute(expression, casadi.vec(self.turn), casadi.vec(rotation)))


def _neutral(s: Symbols, joints: set[str]) -> casadi.SX:
    """q with the coordinates of some joints at their neutral position."""
    import casadi

    q = casadi.SX(s.q)
    for joint in s.robot.joints:
        if joint.name in joints:
            for k in range(joint.q, joint.q + joint.nq):
                q[k] = float(s.robot.neutral[k])
    return q
