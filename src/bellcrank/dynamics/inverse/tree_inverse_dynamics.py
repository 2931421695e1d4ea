"""Inverse dynamics of a robot's tree of joints under the forces and parameters of a scene, as machine code.

The joint forces that a motion requires are

    Q = M(q) a + bias(q, v) + friction(v) − Σ forces(t, q, v),

the sum being over all forces of the scene: springs, dampers, friction, wrenches, and torques, which act in addition to
the motors. M includes rotors, reflected to the joints. Source: recursive Newton-Euler, Featherstone, Rigid Body
Dynamics Algorithms (2008), ch. 5, by Pinocchio.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.elements.dry_friction import DryFriction
from bellcrank.elements.joint_forces import Friction
from bellcrank.elements.symbols import Symbols
from bellcrank.errors import InputError
from bellcrank.robot.model.traced_tree import MASS, SCALE, trace_tree

if TYPE_CHECKING:
    import casadi

    from bellcrank.codegen.compile import Compiled
    from bellcrank.elements.element import Force
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene

LARGEST = 1e100  # N or N m: the squares of larger ones, needed for the RMS, overflow


class TreeInverseDynamics:
    """Joint forces and mass matrices of a robot under a scene's forces and parameters, or of the robot alone.

    The scene's constraints and control are not included. All methods take batches: times t (n,) s, positions q (n, nq),
    velocities v and accelerations a (n, nv). Tables are evaluated at these times, whatever the clock of the scene's
    start.
    """

    def __init__(self, robot: Robot, scene: Scene | None = None) -> None:
        self.robot = robot
        self.scene = None
        if scene is not None:
            bare = replace(scene, robot=robot, constraints=(), control=(), events=(), outputs={})
            self.scene = replace(bare, initial=replace(scene.initial, clock=0.0))
        self.forces: tuple[Force, ...] = () if scene is None else scene.forces
        self.parameters: Array = np.zeros(0) if scene is None else scene.parameter_values
        self.sets_tree = scene is not None and any(p.places for p in scene.parameters.values())
        self._code: dict[str, Compiled] = {}

    # ---- forces

    def needed(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """The joint forces Q (n, nv), N m or N. Raises InputError where they overflow."""
        if not self.sets_tree:
            need = np.asarray(self.robot.inverse_dynamics(q, v, a))
        else:
            need = self._with_parameters("needed", self._inverse_dynamics, q, v, a)
        if self.forces:
            need = need - self.applied(t, q, v)
        held = np.abs(need) <= LARGEST
        if not held.all():
            row = int(np.argmin(held.all(axis=1)))
            column = int(np.argmin(held[row]))
            joint = next(j.name for j in reversed(self.robot.joints) if j.v <= column)
            raise InputError(
                f"{self.robot.name}: the motion and the scene's forces require {need[row, column]:.4g} N or N m of "
                f"joint "
                f"'{joint}' at {round(float(t[row]), 9) + 0.0:.6g} s, expected at most {LARGEST:g}; check units"
            )
        return need

    def applied(self, t: Array, q: Array, v: Array) -> Array:
        """The generalised force (n, nv) of all forces of the scene, N m or N."""
        return self._forces(t, q, v)[0] if self.forces else np.zeros((len(t), self.robot.nv))

    def friction(self, t: Array, q: Array, v: Array) -> Array:
        """The force (n, nv) that overcomes the friction of the robot and of the scene's `friction` elements."""
        own = np.asarray(self.robot.friction_torque(v))
        return own - self._forces(t, q, v)[1] if self.forces else own

    def _forces(self, t: Array, q: Array, v: Array) -> tuple[Array, Array]:
        assert self.scene is not None
        total, friction = self._forces_code(t[:, None], q, v, self.scene.signals_at(t), self.parameters)
        return np.asarray(total), np.asarray(friction)

    @cached_property
    def _forces_code(self) -> Compiled:
        """(t, q, v, u, p) -> the sum of all forces, and of friction elements, (nv) each."""
        scene = self.scene
        assert scene is not None

        def build() -> casadi.Function:
            import casadi

            s = Symbols(self.robot, scene.parameters, scene.frames)
            for source in scene.signal_sources:  # all of them, in the order of the scene's signals
                s.signal(source)
            total, friction = casadi.SX.zeros(self.robot.nv, 1), casadi.SX.zeros(self.robot.nv, 1)
            for part in scene.forces:
                force = part.generalised_force(s).force
                total += force
                if isinstance(part, Friction | DryFriction):
                    friction += force
            return casadi.Function("forces", [s.t, s.q, s.v, s.u, s.p], [total, friction])

        return self.robot.compiled("forces " + scene.physics_key(), build)

    def slopes(self, q: Array, v: Array, inputs: int) -> Array:
        """The derivative (n, inputs, nv) of the forces with respect to the values of tables, in which they are
        linear.
        """
        scene, n = self.scene, len(q)
        assert scene is not None
        t = np.zeros((n, 1))
        base = np.asarray(self._forces_code(t, q, v, np.zeros((n, inputs)), self.parameters)[0])
        ones = np.eye(inputs)
        more = [self._forces_code(t, q, v, np.tile(one, (n, 1)), self.parameters)[0] for one in ones]
        return np.stack([np.asarray(each) - base for each in more], axis=1)

    # ---- mass

    @property
    def set_masses(self) -> dict[int, float]:
        """The masses, kg, that parameters set, by the number of the frame in the tree."""
        if self.scene is None:
            return {}
        given = {place: p.value for p in self.scene.parameters.values() for place in p.places}
        frames = self.robot.equations.tree.frames
        return {
            frame: given.get((frame, MASS), frames[frame].mass) * given.get((frame, SCALE), 1.0)
            for frame, what in given
            if what in (MASS, SCALE)
        }

    def mass_matrix(self, q: Array) -> Array:
        """M(q) (n, nv, nv), rotors included."""
        if not self.sets_tree:
            return np.asarray(self.robot.mass_matrix(q))
        flat = self._with_parameters("mass matrix", _mass_matrix, q)
        return flat.reshape(len(q), self.robot.nv, self.robot.nv)

    def link_torques(self, q: Array, v: Array, a: Array) -> Array:
        """The part (n, links, nv) of Q that each link's mass and inertia cause, as `Robot.link_torques`."""
        if not self.sets_tree:
            return np.asarray(self.robot.link_torques(q, v, a))
        flat = self._with_parameters("link torques", _link_torques, q, v, a)
        return flat.reshape(len(q), -1, self.robot.nv)

    def _with_parameters(self, name: str, build: Callable[[Scene], casadi.Function], *states: Array) -> Array:
        scene = self.scene
        assert scene is not None
        if name not in self._code:
            targets = [parameter.sets for parameter in scene.parameters.values()]
            self._code[name] = self.robot.compiled(f"{name} {targets!r}", lambda: build(scene))
        return np.asarray(self._code[name](*states, self.parameters))

    def _inverse_dynamics(self, scene: Scene) -> casadi.Function:
        import casadi

        s, a = Symbols(self.robot, scene.parameters), casadi.SX.sym("a", self.robot.nv)
        need = s.inverse_dynamics(s.q, s.v, a) + self.robot.equations.friction(s.v)
        return casadi.Function("needed", [s.q, s.v, a, s.p], [casadi.densify(need)])


def _mass_matrix(scene: Scene) -> casadi.Function:
    import casadi

    s = Symbols(scene.robot, scene.parameters)
    return casadi.Function(
        "mass_matrix", [s.q, s.p], [casadi.densify(s.algorithm("mass_matrix")(s.q, s.tracer_parameters))]
    )


def _link_torques(scene: Scene) -> casadi.Function:
    """(q, v, a, p) -> d torque / d σ at σ = 1, σ being a factor on each link's mass and inertia, without rotors.

    Every target of a parameter is an input of its own here, so that links that share a parameter have factors of their
    own.
    """
    import casadi

    tree = scene.robot.equations.tree
    p = casadi.SX.sym("p", len(scene.parameters))
    places = [(*place, k) for k, parameter in enumerate(scene.parameters.values()) for place in parameter.places]
    links = sorted({*tree.massive_frames(), *(frame for frame, what, _ in places if what >= 6)})
    sigma = casadi.SX.sym("sigma", len(links))
    values = [p[k] * sigma[links.index(frame)] if what == SCALE else p[k] for frame, what, k in places]
    scaled = {frame for frame, what, _ in places if what == SCALE}
    settings = [(frame, what, k) for k, (frame, what, _) in enumerate(places)]
    for k, frame in enumerate(links):
        if frame not in scaled:
            settings.append((frame, SCALE, len(values)))
            values.append(sigma[k])
    gravity = tuple(float(x) for x in scene.robot.gravity)
    traced = trace_tree(tree.without_rotors(), gravity, settings, len(values))
    torque = casadi.Function.deserialize(traced.inverse_dynamics().decode("latin-1"))
    q, v, a = (casadi.SX.sym(n, torque.size1_in(k)) for k, n in enumerate("qva"))
    slope = casadi.jacobian(torque(q, v, a, casadi.vertcat(casadi.SX(0, 1), *values)), sigma)
    at_one = casadi.substitute(slope, sigma, casadi.SX.ones(len(links), 1))
    return casadi.Function("link_torques", [q, v, a, p], [casadi.vec(casadi.densify(at_one))])
