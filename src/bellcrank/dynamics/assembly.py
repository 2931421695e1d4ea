"""A scene's equations of motion assembled as casadi expressions, which can be inspected before they are compiled.

The state x is q (nq), v (nv) and, where a force has power that comes from no potential, the work W of actuators,
dampers and friction. With τ the sum of the joint forces of the scene,

    q̇ = E(q) v,    v̇ = M(q)⁻¹ (τ − bias(q, v)) by the articulated-body algorithm,    Ẇ = power.

Constraints add their multipliers (constraint_derivatives.py, kkt.py), and joints that dry friction keeps at rest the
forces that do so (stuck_joints.py). Source: Featherstone, Rigid Body Dynamics
Algorithms (2008), ch. 7, by Pinocchio.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

from bellcrank.dynamics.base_frame_elimination import mass_matrix
from bellcrank.dynamics.constraint_derivatives import SymbolicRows, differentiate_constraints
from bellcrank.dynamics.constraint_rows import rows_of
from bellcrank.dynamics.kkt import REFINEMENTS, ConstrainedSolution, KktSolution, proximal, solve_constrained
from bellcrank.dynamics.reactions import ConstraintReactions
from bellcrank.dynamics.stuck_joints import StuckJoints, entries
from bellcrank.elements.dry_friction import DryFriction
from bellcrank.elements.joint_stops import JointStop
from bellcrank.elements.symbols import Symbols
from bellcrank.errors import InputError
from bellcrank.robot.joints import lengths_in_velocity
from bellcrank.scene.equation_symbols import EquationSymbols

if TYPE_CHECKING:
    import casadi

    from bellcrank.scene.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Assembly:
    """Equations of motion as expressions, in SI units.

    Attributes:
        t: Time, s.
        q: Position (nq).
        v: Velocity (nv).
        u: Signals (nu).
        p: Parameters (np).
        work: The symbol of the work W, J.
        rate: q̇ (nq).
        acceleration: v̇ (nv).
        actuator: Joint forces of motors (nv): torques and control, N m or N.
        passive: Joint forces (nv) of everything else: springs, dampers, friction, wrenches.
        power: Ẇ, W.
        plain_power: Ẇ by the plain solution of the constraints (kkt.py).
        kinetic: Kinetic energy, J.
        potential: Potential energy, J.
        residual: Inverse dynamics of the acceleration less the joint forces (nv), which must vanish.
        bias: Gravity, Coriolis and centrifugal forces (nv).
        outputs: Named outputs, column vectors.
        events: The event functions (events).
        symbols: The symbols that elements write their expressions in.
        solution: The solved constraints; None for a scene without constraints.
        mode_switches: Functions that are positive while the modes of joints with dry friction last.
        impacts: Whether impacts at stops change the energy.
        mode_turn: What a run needs to find their new modes (`StuckJoints.turn`).
    """

    t: casadi.SX
    q: casadi.SX
    v: casadi.SX
    u: casadi.SX
    p: casadi.SX
    work: casadi.SX
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
    symbols: Symbols
    event_equations: EquationSymbols  # what events are written in
    solution: ConstrainedSolution | None = None  # of a scene with constraints
    mode_switches: casadi.SX
    mode_turn: casadi.SX
    impacts: bool

    @property
    def has_work(self) -> bool:
        """Whether some power comes from no potential, so that the state includes the work."""
        return self.impacts or not self.power.is_zero()

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
        """dx/dt by the plain solution, for a scene with constraints."""
        assert self.solution is not None
        return self._rate(self.solution.plain.acceleration, self.plain_power)

    def _rate(self, acceleration: casadi.SX, power: casadi.SX) -> casadi.SX:
        import casadi

        both = casadi.vertcat(self.rate, acceleration)
        return casadi.vertcat(both, power) if self.has_work else both

    def frame(self, name: str) -> casadi.SX:
        """A frame's position 3, rotation 9 (row major), linear and angular velocity 3 each, world axes."""
        import casadi

        f = self.symbols.frame(name)
        return casadi.vertcat(f.position, casadi.vec(f.rotation.T), f.linear, f.angular)


def assemble(scene: Scene, *, held_sides: bool = True) -> Assembly:
    """The equations of motion of a scene; with `held_sides` as a simulation has them (symbols.py).

    Raises InputError where a force cannot act on this robot.
    """
    import casadi

    robot = scene.robot
    s = Symbols(robot, scene.parameters, scene.frames, scene.initial.clock, held_sides)
    for source in scene.signal_sources:  # all of them, in the order of the scene's signals
        s.signal(source)
    actuator, passive, potential, power = applied_forces(scene, s)
    torque = actuator + passive
    newton_euler = s.algorithm("inverse_dynamics")
    bias = newton_euler(s.q, s.v, casadi.SX(robot.nv, 1), s.tracer_parameters)
    gains = casadi.SX.sym("gains", 2 if scene.settings.stabilisation.kind == "baumgarte" else 0)
    p = casadi.vertcat(s.p, gains)
    solution, reaction, plain_power = None, casadi.SX(robot.nv, 1), power
    held_parts = (*scene.dry_friction, *scene.stops_of_joints)
    held = _Held(casadi.SX(0, 1), casadi.SX(0, 1), casadi.SX(0, 1))
    if scene.constraints:
        rows, sizes = _symbolic_rows(scene)
        constraints = differentiate_constraints(scene.constraints, rows, s)
        share = casadi.SX.sym("regularisation")
        solution = solve_constrained(mass_matrix(s), constraints, torque - bias, gains, share)
        p = casadi.vertcat(p, sizes, share)
        acceleration = solution.proximal.acceleration
        if held_parts:
            solution, held = _with_stuck_joints(solution, _stuck_joints(scene, s))
            acceleration = solution.proximal.acceleration
        reaction = constraints.jacobian.T @ solution.proximal.multipliers
        plain_power = power + constraints.power(solution.plain.multipliers)
        power = power + constraints.power(solution.proximal.multipliers)
    else:
        acceleration = s.algorithm("forward_dynamics")(s.q, s.v, torque, s.tracer_parameters)
        if held_parts:
            joints = _stuck_joints(scene, s)
            response, inertia = s.response(joints.rows), entries(casadi.diag(mass_matrix(s)), joints.rows)
            forces = joints.forces(acceleration, response, inertia, regular=True)
            held = _Held(forces, joints.switches(forces), joints.turn(acceleration, response, inertia))
            acceleration = joints.at_rest(acceleration + response @ forces)
    for k, part in enumerate(held_parts):
        s.holding[part.name] = held.forces[k]
        passive += s.joint_force(part.joint.v, held.forces[k])
    torque = actuator + passive
    energy = s.algorithm("energy")(s.q, s.v, s.tracer_parameters)
    # an independent check of the accelerations: recursive Newton-Euler must give back the torque
    residual = newton_euler(s.q, s.v, acceleration, s.tracer_parameters) - torque - reaction
    equations = EquationSymbols(
        symbols=s,
        acceleration=acceleration,
        joint_torque=torque,
        kinetic=energy[0],
        potential=energy[1] + potential,
        reactions=None
        if solution is None
        else ConstraintReactions(scene.constraints, solution, solution.proximal.multipliers, s),
    )
    outputs = {name: output.value(equations) for name, output in scene.outputs.items()}
    event_equations = equations
    if solution is not None:
        quick = ConstraintReactions(scene.constraints, solution, solution.event_multipliers, s)
        event_equations = replace(equations, reactions=quick)
    events = casadi.vertcat(*[event.function(event_equations) for event in scene.events])
    return Assembly(
        t=s.t,
        q=s.q,
        v=s.v,
        u=s.u,
        p=p,
        work=casadi.SX.sym("W"),
        rate=s.algorithm("configuration_rate")(s.q, s.v),
        acceleration=acceleration,
        actuator=actuator,
        passive=passive,
        power=power,
        plain_power=plain_power,
        kinetic=energy[0],
        potential=energy[1] + potential,
        residual=residual,
        bias=bias,
        outputs=outputs,
        events=casadi.SX(events),
        symbols=s,
        event_equations=event_equations,
        solution=solution,
        mode_switches=held.switches,
        mode_turn=held.turn,
        impacts=bool(scene.stops_of_joints),
    )


class _Held(NamedTuple):
    """The forces of dry friction at stuck joints, the functions while the modes last, and what finds new modes."""

    forces: casadi.SX
    switches: casadi.SX
    turn: casadi.SX


def _stuck_joints(scene: Scene, s: Symbols) -> StuckJoints:
    """The dry friction and stops of a scene's joints, in a run. Raises InputError outside of one."""
    parts: list[DryFriction | JointStop] = [*scene.dry_friction, *scene.stops_of_joints]
    if not s.held_sides:
        raise InputError(
            f"{scene.source}: joints.{parts[0].joint.name}.{parts[0].kind}: a joint that sticks or meets a "
            "stop has no equations of motion without what a run holds; remove it, or give it a smoothed friction "
            "(forces, kind: friction)"
        )
    return StuckJoints.of(parts, s)


def _with_stuck_joints(solution: ConstrainedSolution, joints: StuckJoints) -> tuple[ConstrainedSolution, _Held]:
    """Solved constraints with the forces at stuck joints, by both ways of solving them."""
    import casadi

    nv, rows = solution.mass.size1(), list(joints.rows)
    unit = [casadi.SX(casadi.DM.eye(nv)[:, row]) for row in rows]
    none, inertia = casadi.SX(solution.plain_factor.m, 1), entries(casadi.diag(solution.mass), rows)

    def held(found: KktSolution, responses: list[tuple[casadi.SX, casadi.SX]]) -> tuple[KktSolution, casadi.SX]:
        response = casadi.horzcat(*[a for a, _ in responses])
        forces = joints.forces(found.acceleration, response, inertia, regular=False)
        return KktSolution(
            joints.at_rest(found.acceleration + response @ forces),
            found.multipliers + casadi.horzcat(*[m for _, m in responses]) @ forces,
            joints.at_rest(found.displacement),
            joints.at_rest(found.velocity_change),
        ), forces

    regular = [proximal(solution.proximal_factor, e, none, REFINEMENTS) for e in unit]
    plain, _ = held(solution.plain, [solution.plain_factor.solve(e, none) for e in unit])
    slow, forces = held(solution.proximal, regular)
    quick = casadi.horzcat(*[solution.proximal_factor.solve(e, none)[1] for e in unit])
    turn = joints.turn(solution.proximal.acceleration, casadi.horzcat(*[a for a, _ in regular]), inertia)
    return replace(
        solution, plain=plain, proximal=slow, event_multipliers=solution.event_multipliers + quick @ forces
    ), _Held(forces, joints.switches(forces), turn)


class AppliedForces(NamedTuple):
    """Joint forces (nv) of motors and of everything else, the potential energy, and the power of what has none."""

    actuator: casadi.SX
    passive: casadi.SX
    potential: casadi.SX
    power: casadi.SX


def applied_forces(scene: Scene, s: Symbols) -> AppliedForces:
    """The forces, controllers and friction of a scene. Raises InputError where a force cannot act on this robot."""
    import casadi

    robot = scene.robot
    actuator, passive = casadi.SX.zeros(robot.nv, 1), casadi.SX.zeros(robot.nv, 1)
    potential, power = casadi.SX(0), casadi.SX(0)
    for item in (*scene.forces, *scene.control):
        applied = item.generalised_force(s)
        if applied.actuator:
            actuator += applied.force
        else:
            passive += applied.force
        potential += applied.potential
        power += applied.power
    friction = robot.equations.friction(s.v)
    return AppliedForces(actuator, passive - friction, potential, power - casadi.dot(friction, s.v))


def _symbolic_rows(scene: Scene) -> tuple[SymbolicRows, casadi.SX]:
    """The kept rows, and which of their sizes are parameters: none, or all where any depends on the scene's
    parameters.
    """
    import casadi

    found, count = rows_of(scene), len(rows_of(scene).kept)
    sizes = casadi.SX.sym("rows", len(found.parameters))
    if found.parametric:
        scale, square, unit, length = casadi.vertsplit(sizes, [0, count, 2 * count, 3 * count, 3 * count + 1])
    else:
        scale, square, unit = (casadi.SX(casadi.DM(x)) for x in (found.scale, found.square, found.unit))
        length = casadi.SX(found.length)
    columns = casadi.vertcat(*[length if far else casadi.SX(1.0) for far in lengths_in_velocity(scene.robot)])
    return SymbolicRows(found.kept, scale, square, unit, columns, found.singular), sizes
