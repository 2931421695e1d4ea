"""A scene's equations of motion as casadi expressions, to look at before anything is compiled.

The state x is q (nq), v (nv) and, where some force's power comes from no potential, the work W of actuators, dampers
and friction. With τ the sum of the joint forces of the scene,

    q̇ = E(q) v,    v̇ = M(q)⁻¹ (τ − bias(q, v)) by the articulated-body algorithm,    Ẇ = power.

Constraints add their multipliers (closed.py). Source: Featherstone, Rigid Body Dynamics Algorithms (2008), ch. 7, by
Pinocchio.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bellcrank.dynamics.base_frame_elimination import mass_matrix
from bellcrank.dynamics.constraint_rows import rows_of
from bellcrank.dynamics.constraint_derivatives import Rows, Solution, close, solve
from bellcrank.dynamics.reactions import Reactions
from bellcrank.elements.symbols import Symbols
from bellcrank.robot.joints import lengths_in_velocity

if TYPE_CHECKING:
    import casadi

    from bellcrank.scene.scene import Scene


@dataclass(frozen=True)
class Assembly:
    """Expressions over time t, position q, velocity v, signals u and parameters p (SI units, N m and N for forces).

    `actuator` and `passive` (nv) are the joint forces of motors (torques, control) and of everything else (springs,
    dampers, friction, wrenches); `power` (W) is what enters `work`, and `plain_power` the same by the plain solve of
    constraints; `outputs` are column vectors by name.
    """

    t: casadi.SX
    q: casadi.SX
    v: casadi.SX
    u: casadi.SX
    p: casadi.SX
    rate: casadi.SX
    acceleration: casadi.SX
    actuator: casadi.SX
    passive: casadi.SX
    power: casadi.SX
    plain_power: casadi.SX
    kinetic: casadi.SX
    potential: casadi.SX
    residual: casadi.SX
    bias: casadi.SX
    outputs: dict[str, casadi.SX]
    events: casadi.SX
    work: casadi.SX
    symbols: Symbols
    solution: Solution | None = None  # of a scene with constraints

    @property
    def has_work(self) -> bool:
        """Whether any power comes from no potential, so that the state carries the work."""
        return not self.power.is_zero()

    @property
    def state(self) -> casadi.SX:
        """The state x as symbols."""
        import casadi

        return casadi.vertcat(self.q, self.v, self.work) if self.has_work else casadi.vertcat(self.q, self.v)

    @property
    def state_rate(self) -> casadi.SX:
        """dx/dt."""
        return self._rate(self.acceleration, self.power)

    @property
    def plain_state_rate(self) -> casadi.SX:
        """dx/dt by the plain solve, for a scene with constraints."""
        assert self.solution is not None
        return self._rate(self.solution.plain_acceleration, self.plain_power)

    def _rate(self, acceleration: casadi.SX, power: casadi.SX) -> casadi.SX:
        import casadi

        both = casadi.vertcat(self.rate, acceleration)
        return casadi.vertcat(both, power) if self.has_work else both

    def frame(self, name: str) -> casadi.SX:
        """A frame's position 3, rotation 9 (row major), linear and angular velocity 3 each, world axes."""
        import casadi

        f = self.symbols.frame(name)
        return casadi.vertcat(f.position, casadi.vec(f.rotation.T), f.linear, f.angular)


def assemble(scene: Scene) -> Assembly:
    """The equations of motion of a scene. Raises InputError where a force cannot act on this robot."""
    import casadi

    robot = scene.robot
    s = Symbols(robot, scene.parameters, scene.frames, scene.initial.clock)
    actuator, passive = casadi.SX.zeros(robot.nv, 1), casadi.SX.zeros(robot.nv, 1)
    potential, power = casadi.SX(0), casadi.SX(0)
    for item in (*scene.forces, *scene.control):
        applied = item.apply(s)
        if applied.actuator:
            actuator += applied.force
        else:
            passive += applied.force
        potential += applied.potential
        power += applied.power
    friction = robot.equations.friction(s.v)
    passive -= friction
    power -= casadi.dot(friction, s.v)
    torque = actuator + passive
    newton_euler = s.algorithm("inverse_dynamics")
    bias = newton_euler(s.q, s.v, casadi.SX(robot.nv, 1), s.tracer_parameters)
    gains = casadi.SX.sym("gains", 2 if scene.settings.stabilisation.kind == "baumgarte" else 0)
    p = casadi.vertcat(s.p, gains)
    solution, reaction, plain_power = None, casadi.SX(robot.nv, 1), power
    if scene.constraints:
        rows, sizes = _rows(scene)
        closed = close(scene.constraints, rows, s)
        share = casadi.SX.sym("regularisation")
        solution = solve(mass_matrix(s), closed, torque - bias, gains, share)
        p = casadi.vertcat(p, sizes, share)
        acceleration, reaction = solution.acceleration, closed.jacobian.T @ solution.multipliers
        power, plain_power = (
            power + closed.power(solution.multipliers),
            power + closed.power(solution.plain_multipliers),
        )
    else:
        acceleration = s.algorithm("forward_dynamics")(s.q, s.v, torque, s.tracer_parameters)
    s.acceleration = acceleration
    energy = s.algorithm("energy")(s.q, s.v, s.tracer_parameters)
    # the other route to the same accelerations: recursive Newton-Euler gives back the torque
    residual = newton_euler(s.q, s.v, acceleration, s.tracer_parameters) - torque - reaction
    s.joint_torque = torque
    s.kinetic, s.potential = energy[0], energy[1] + potential
    if solution is not None:
        s.reactions = Reactions(scene.constraints, solution, solution.multipliers, s)
    outputs = {name: output.apply(s) for name, output in scene.outputs.items()}
    if solution is not None:
        s.reactions = Reactions(scene.constraints, solution, solution.quick_multipliers, s)
    events = casadi.vertcat(*[event.apply(s) for event in scene.events])
    return Assembly(
        s.t, s.q, s.v, s.u, p, s.algorithm("configuration_rate")(s.q, s.v), acceleration,
        actuator, passive, power, plain_power, energy[0], energy[1] + potential, residual, bias, outputs,
        casadi.SX(events), casadi.SX.sym("W"), s, solution,
    )  # fmt: skip


def _rows(scene: Scene) -> tuple[Rows, casadi.SX]:
    """The rows that bind, and what of them are parameters: all numbers where any depends on the scene's parameters."""
    import casadi

    found, count = rows_of(scene), len(rows_of(scene).kept)
    sizes = casadi.SX.sym("rows", len(found.parameters))
    if found.parametric:
        scale, square, unit, length = casadi.vertsplit(sizes, [0, count, 2 * count, 3 * count, 3 * count + 1])
    else:
        scale, square, unit = (casadi.SX(casadi.DM(x)) for x in (found.scale, found.square, found.unit))
        length = casadi.SX(found.length)
    columns = casadi.vertcat(*[length if far else casadi.SX(1.0) for far in lengths_in_velocity(scene.robot)])
    return Rows(found.kept, scale, square, unit, columns, found.singular), sizes
