"""A scene's equations of motion assembled as casadi expressions, which can be inspected before they are compiled.

The state x is q (nq), v (nv), the auxiliary states z (nz) of drives and, where a force has power that comes from no
potential, the work W of actuators, dampers and friction. With τ the sum of the joint forces of the scene,

    q̇ = E(q) v,    v̇ = M(q)⁻¹ (τ − bias(q, v)) by the articulated-body algorithm,    Ẇ = power.

Constraints add their multipliers (constraint_derivatives.py, kkt.py), and joints that dry friction keeps at rest the
forces that do so (stuck_joints.py). Source: Featherstone, Rigid Body Dynamics
Algorithms (2008), ch. 7, by Pinocchio.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

from bellcrank.dynamics.constraints.constraint_derivatives import SymbolicRows, differentiate_constraints
from bellcrank.dynamics.constraints.constraint_rows import rows_of
from bellcrank.dynamics.constraints.reactions import ConstraintReactions
from bellcrank.dynamics.equations.base_frame_elimination import mass_matrix
from bellcrank.dynamics.equations.gear_losses import GearLosses
from bellcrank.dynamics.equations.kkt import (
    REFINEMENTS,
    ConstrainedSolution,
    Factor,
    KktSolution,
    proximal,
    solve_constrained,
)
from bellcrank.dynamics.equations.stuck_joints import StuckJoints, key_of
from bellcrank.elements.dry_friction import RestingJoint
from bellcrank.elements.rotor_friction import RotorFriction
from bellcrank.elements.symbols import Additions, Symbols
from bellcrank.errors import InputError
from bellcrank.robot.model.joints import lengths_in_velocity
from bellcrank.scene.output_quantities import EquationSymbols

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
        z: Auxiliary states (nz).
        work: The symbol of the work W, J.
        rate: q̇ (nq).
        auxiliary_rate: ż (nz), and `auxiliary_start` z at the start of a run.
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
    z: casadi.SX
    work: casadi.SX
    rate: casadi.SX
    auxiliary_rate: casadi.SX
    auxiliary_start: casadi.SX
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

        own = casadi.vertcat(self.q, self.v, self.z)
        return casadi.vertcat(own, self.work) if self.has_work else own

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

        own = casadi.vertcat(self.rate, acceleration, self.auxiliary_rate)
        return casadi.vertcat(own, power) if self.has_work else own

    def frame(self, name: str) -> casadi.SX:
        """A frame's position 3, rotation 9 (row major), linear and angular velocity 3 each, world axes."""
        import casadi

        f = self.symbols.frame(name)
        return casadi.vertcat(f.position, casadi.vec(f.rotation.T), f.linear, f.angular)


def assemble(scene: Scene, *, held_sides: bool = True, additions: bool = False) -> Assembly:
    """The equations of motion of a scene; with `held_sides` as a simulation has them (symbols.py).

    `additions`: with those symbols at drives that their linear equations need (`Symbols.additions`).
    Raises InputError where a force cannot act on this robot.
    """
    import casadi

    robot = scene.robot
    s = Symbols(robot, scene.parameters, scene.frames, scene.initial.clock, held_sides)
    if additions:
        names = [drive.name for drive in scene.drives]
        factors, references, torques = (
            {name: casadi.SX.sym(f"{what} {name}") for name in names} for what in ("factor", "reference", "torque")
        )
        s.additions = Additions(factors, references, torques, casadi.SX.sym("load", robot.nv))
    for source in scene.signal_sources:  # all of them, in the order of the scene's signals
        s.signal(source)
    with_states = [part for part in scene.elements if part.auxiliary is not None]
    for states in scene.auxiliary_states:
        s.auxiliary(states)
    actuator, passive, potential, power, rotors = applied_forces(scene, s)
    if s.additions is not None:
        passive += s.additions.load
    none = casadi.SX(0, 1)
    s.load_at_start = _load_at_start(scene, s)
    works, spent = casadi.SX(sum(work.states.size for work in scene.works), 1), casadi.SX.sym("W")
    z_rate = casadi.vertcat(none, *[part.auxiliary_rate(s) for part in with_states], works)
    z_start = casadi.vertcat(none, *[part.auxiliary_start(s) for part in with_states], casadi.SX.zeros(works.shape))
    torque = actuator + passive
    newton_euler = s.algorithm("inverse_dynamics")
    bias = newton_euler(s.q, s.v, casadi.SX(robot.nv, 1), s.tracer_parameters)
    gains = casadi.SX.sym("gains", 2 if scene.settings.stabilisation.kind == "baumgarte" else 0)
    p = casadi.vertcat(s.p, gains)
    solution, reaction, plain_power = None, casadi.SX(robot.nv, 1), power
    held_parts = scene.parts_with_modes
    held, losses = _Held(none, none, none, z_rate), GearLosses.of(scene, s) if held_sides else None
    if scene.constraints:
        rows, sizes = _symbolic_rows(scene)
        constraints = differentiate_constraints(scene.constraints, rows, s)
        share = casadi.SX.sym("regularisation")
        mass, force = mass_matrix(s), torque - bias
        if losses is not None:
            mass, force = losses.mass(mass), force + losses.force
        solution = solve_constrained(mass, constraints, force, gains, share)
        p = casadi.vertcat(p, sizes, share)
        acceleration = solution.proximal.acceleration
        if held_parts:
            solution, held = _with_stuck_joints(solution, _stuck_joints(scene, s, gains), s.v, z_rate)
            acceleration = solution.proximal.acceleration
        reaction = constraints.jacobian.T @ solution.proximal.multipliers
        plain_power = power + constraints.power(solution.plain.multipliers)
        if losses is not None:
            plain_power += casadi.dot(losses.lost(solution.plain.acceleration), s.v)
        power = power + constraints.power(solution.proximal.multipliers)
    else:
        chain = _OpenChain(s, None if losses is None else losses.mass(mass_matrix(s)))
        acceleration = chain.acceleration(torque if losses is None else torque + losses.force, bias)
        if held_parts:
            joints = _stuck_joints(scene, s, gains)
            response = joints.responses(chain.responses(joints.unit_forces(robot.nv)), robot.nv)
            inertia = joints.inertias(casadi.diag(mass_matrix(s) if chain.mass is None else chain.mass))
            before = joints.relative(casadi.vertcat(acceleration, z_rate))
            forces = joints.forces(joints.accelerations(before), response, inertia, regular=not joints.ways)
            acceleration, rates = _parted(joints.at_rest(before + response[:, : joints.count] @ forces), robot.nv)
            held = _Held(forces, joints.switches(forces), joints.turn(before, response, inertia), rates)
    for k, part in enumerate(held_parts[: held.forces.numel()]):
        s.holding[part.name] = held.forces[k]
        on_rotor = isinstance(part, RotorFriction) and part.drive.has_own_rotor
        if not on_rotor and not isinstance(part, RestingJoint):
            passive += part.along(s, held.forces[k])
    if losses is not None:
        losses.set_forces(acceleration, s)
        passive += losses.lost(acceleration)
        power += casadi.dot(losses.lost(acceleration), s.v)
    rates = held.auxiliary_rate
    if scene.works:
        rates = casadi.vertcat(rates[: -works.numel()], *[work.rate(s) for work in scene.works])
    torque = actuator + passive
    energy = s.algorithm("energy")(s.q, s.v, s.tracer_parameters)
    # an independent check of the accelerations: recursive Newton-Euler must give back the torque
    residual = newton_euler(s.q, s.v, acceleration, s.tracer_parameters) - torque - reaction
    equations = EquationSymbols(
        symbols=s,
        acceleration=acceleration,
        joint_torque=torque,
        kinetic=energy[0] + rotors,
        potential=energy[1] + potential,
        reactions=None
        if solution is None
        else ConstraintReactions(scene.constraints, solution, solution.proximal.multipliers, s),
        work=spent,
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
        z=s.z,
        work=spent,
        rate=s.algorithm("configuration_rate")(s.q, s.v),
        auxiliary_rate=rates,
        auxiliary_start=z_start,
        acceleration=acceleration,
        actuator=actuator,
        passive=passive,
        power=power,
        plain_power=plain_power,
        kinetic=energy[0] + rotors,
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
        impacts=bool(scene.contacts),
    )


class _OpenChain(NamedTuple):
    """Accelerations without constraints, by the articulated-body algorithm, or by a mass matrix of their own."""

    s: Symbols
    mass: casadi.SX | None

    def acceleration(self, torque: casadi.SX, bias: casadi.SX) -> casadi.SX:
        """v̇ (nv) by joint forces and bias (nv)."""
        if self.mass is None:
            found: casadi.SX = self.s.algorithm("forward_dynamics")(
                self.s.q, self.s.v, torque, self.s.tracer_parameters
            )
            return found
        return self.responses([torque - bias])[0]

    def responses(self, forces: Sequence[casadi.SX]) -> list[casadi.SX]:
        """The accelerations (nv) by generalised forces (nv) alone."""
        import casadi

        if not forces:
            return []
        if self.mass is None:
            return list(casadi.horzsplit(self.s.response(forces)))
        factor, none = Factor(self.mass, casadi.SX(0, self.mass.size1()), casadi.SX(0, 1)), casadi.SX(0, 1)
        return [factor.solve(force, none)[0] for force in forces]


class _Held(NamedTuple):
    """The forces of dry friction at stuck joints, the functions while the modes last, what finds new modes, and ż."""

    forces: casadi.SX
    switches: casadi.SX
    turn: casadi.SX
    auxiliary_rate: casadi.SX


def _parted(both: casadi.SX, nv: int) -> tuple[casadi.SX, casadi.SX]:
    """Accelerations (nv), and the rates of auxiliary states after them."""
    import casadi

    first, second = casadi.vertsplit(both, [0, nv, both.size1()])
    return first, second


def _stuck_joints(scene: Scene, s: Symbols, gains: casadi.SX) -> StuckJoints:
    """The dry friction and stops of a scene's joints, in a run. Raises InputError outside of one."""
    parts = scene.parts_with_modes
    if not s.held_sides:
        raise InputError(
            f"{scene.source}: {key_of(parts[0])}: a joint that sticks or meets a "
            "stop has no equations of motion without what a run holds; remove it, or give it a smoothed friction "
            "(forces, kind: friction)"
        )
    return StuckJoints.of(parts, s, 2.0 * gains[0] if gains.numel() else s.zero)


def _with_stuck_joints(
    solution: ConstrainedSolution, joints: StuckJoints, v: casadi.SX, z_rate: casadi.SX
) -> tuple[ConstrainedSolution, _Held]:
    """Solved constraints with the forces at stuck joints, by both ways of solving them."""
    import casadi

    nv, m = solution.mass.size1(), solution.plain_factor.m
    units = joints.unit_forces(nv)
    none, inertia = casadi.SX(m, 1), joints.inertias(casadi.diag(solution.mass))
    own = [k for k in range(joints.count) if k not in joints.rotors]
    place = casadi.SX(casadi.DM.eye(joints.count))[:, own]  # of joints and pins among all that have forces

    def held(
        found: KktSolution, responses: list[tuple[casadi.SX, casadi.SX]]
    ) -> tuple[KktSolution, casadi.SX, casadi.SX]:
        response = joints.responses([a for a, _ in responses], nv)
        before = joints.relative(casadi.vertcat(found.acceleration, z_rate))
        forces = joints.forces(joints.accelerations(before), response, inertia, regular=False)
        acceleration, rates = _parted(joints.at_rest(before + response[:, : joints.count] @ forces), nv)
        reactions = casadi.horzcat(casadi.SX(m, 0), *[r for _, r in responses[: len(own)]])
        return (
            KktSolution(
                acceleration,
                found.multipliers + reactions @ (place.T @ forces),
                joints.at_rest(found.displacement),
                joints.pins_at_rest(found.velocity_change, v, response, inertia),
            ),
            forces,
            rates,
        )

    regular = [proximal(solution.proximal_factor, e, none, REFINEMENTS) for e in units]
    plain, _, _ = held(solution.plain, [solution.plain_factor.solve(e, none) for e in units])
    slow, forces, rates = held(solution.proximal, regular)
    quick = casadi.horzcat(casadi.SX(m, 0), *[solution.proximal_factor.solve(e, none)[1] for e in units[: len(own)]])
    before = joints.relative(casadi.vertcat(solution.proximal.acceleration, z_rate))
    turn = joints.turn(before, joints.responses([a for a, _ in regular], nv), inertia)
    quick_multipliers = solution.event_multipliers + quick @ (place.T @ forces)
    return replace(solution, plain=plain, proximal=slow, event_multipliers=quick_multipliers), _Held(
        forces, joints.switches(forces), turn, rates
    )


class AppliedForces(NamedTuple):
    """Joint forces (nv) of motors and of everything else, the potential energy, the power of what has none, and the
    kinetic energy of bodies that are not the robot's.
    """

    actuator: casadi.SX
    passive: casadi.SX
    potential: casadi.SX
    power: casadi.SX
    kinetic: casadi.SX


def applied_forces(scene: Scene, s: Symbols) -> AppliedForces:
    """The forces, controllers and friction of a scene. Raises InputError where a force cannot act on this robot."""
    import casadi

    robot = scene.robot
    actuator, passive = casadi.SX.zeros(robot.nv, 1), casadi.SX.zeros(robot.nv, 1)
    potential, power, kinetic = casadi.SX(0), casadi.SX(0), casadi.SX(0)
    for item in (*scene.forces, *scene.control):
        applied = item.generalised_force(s)
        if applied.actuator:
            actuator += applied.force
        else:
            passive += applied.force
        potential += applied.potential
        power += applied.power
        kinetic += 0.0 if applied.kinetic is None else applied.kinetic
    friction = robot.equations.friction(s.v)
    return AppliedForces(actuator, passive - friction, potential, power - casadi.dot(friction, s.v), kinetic)


def _load_at_start(scene: Scene, s: Symbols) -> casadi.SX:
    """The joint forces (nv) that keep the velocity at the start; 0 in closed linkages, where they are not unique."""
    import casadi

    if scene.constraints or not scene.drives:
        return casadi.SX(scene.robot.nv, 1)
    others = replace(scene, control=tuple(part for part in scene.control if part not in scene.drives))
    actuator, passive, *_ = applied_forces(others, s)
    bias = s.algorithm("inverse_dynamics")(s.q, s.v, casadi.SX(scene.robot.nv, 1), s.tracer_parameters)
    return bias - actuator - passive


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
