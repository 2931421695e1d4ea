"""A sizing as functions of the numbers that a page lets its reader change, compiled to WebAssembly.

Two functions say all that the page computes; it only sums and compares what they return along the motions:

    sample   (begin, end, place, side, speed, p, closed) -> shown, sizes, rates
    verdict  (largest sizes, means of rates, p) -> figures, uses, exceeded

`sample` takes a quintic of a motion (live_motion.py); the place in it: the share, and how long the quintic lasts; the
signs of the joints' speeds in the piece; the factor on the motion's speed; the settings p; and of a linkage whose
lengths are among them the positions of the joints that follow from others, which a third function finds
(live_motion.py). It gives the joints' torques by the expressions of `robot.inverse_dynamics` and, for a linkage, by the
principle of virtual power (dynamics/inverse/motor_shares.py); live_criteria.py gives the torques at the motors' shafts,
and the criteria of motors and gears, which `verdict` ends. Tests compare both with `bellcrank.size` and
`bellcrank.judge`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bellcrank.codegen.expression_graph import graph_of
from bellcrank.codegen.webassembly import webassembly
from bellcrank.config.units import RPM
from bellcrank.dynamics.constraints.constraint_derivatives import SymbolicRows, differentiate_constraints
from bellcrank.dynamics.constraints.constraint_rows import rows_of
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.elements.symbols import Symbols
from bellcrank.motion.sampled.quintic_splines import quintic_polynomial
from bellcrank.simulation.live_settings import Setting
from bellcrank.sizing.live.live_choice import Choices, LiveChoice
from bellcrank.sizing.live.live_criteria import LiveDrive, LiveSample
from bellcrank.sizing.live.live_inputs import LiveSettings, changeable_parameters, own_parameters, payload_parameters
from bellcrank.sizing.live.live_motion import LiveLoops, leading_joints, velocities
from bellcrank.sizing.loads.motion_grid import ONE_SIDE, STILL
from bellcrank.sizing.selection.criteria import TOLERANCE

if TYPE_CHECKING:
    import casadi

    from bellcrank.dynamics.inverse.mechanism import Mechanism
    from bellcrank.elements.parameters import Parameter
    from bellcrank.sizing.joint_sizing import JointSizing
    from bellcrank.sizing.result import Sizing

FIGURES = ("peak torque", "RMS torque", "peak speed", "peak motor torque", "RMS motor torque", "mean motor speed")
NONE = Choices()
EFFORT, VELOCITY = "URDF effort limit", "URDF velocity limit"


class Use(NamedTuple):
    """A limit of one joint.

    Attributes:
        joint: The joint.
        name: The limit.
        place: Its place in the uses of `verdict`; None where it is not recomputed.
        listed: Of which motors and gears of the joint it is a limit; None: of all.
        computed: Of which of them it is recomputed, if `place` is given.
    """

    joint: str
    name: str
    place: int | None
    listed: tuple[int, ...] | None = None
    computed: tuple[int, ...] | None = None


@dataclass(frozen=True, kw_only=True)
class Posed:
    """The positions of all joints as expressions of what a page gives to its functions.

    Attributes:
        position: The positions (nq).
        parameters: The parameters of the robot's tree and the scene.
        values: Their values.
        inputs: The symbols begin, end, place, p, and closed where loops are closed.
    """

    position: casadi.SX
    parameters: dict[str, Parameter]
    values: casadi.SX
    inputs: tuple[casadi.SX, ...]


@dataclass(frozen=True, kw_only=True)
class LiveSizing:
    """What a page needs to compute a sizing.

    Attributes:
        settings: What can be changed, in the order of p.
        fixed: Sentences on parameters of the scene that cannot be changed.
        speeds: The place in p of the factor on the speed of each motion.
        uses: The limits of the joints.
        sample: The function of a sample.
        verdict: That of the verdict.
        close: That of a step by which dependent joints close the loops; None where no setting moves them.
        closing: The settings on which their positions depend.
        closed: How many joints these are.
        sizes: How many numbers both return: shown, sizes, rates, figures, uses.
        posed: The positions of all joints.
    """

    settings: tuple[Setting, ...]
    fixed: tuple[str, ...]
    speeds: tuple[int, ...]
    uses: tuple[Use, ...]
    sample: casadi.Function
    verdict: casadi.Function
    close: casadi.Function | None
    closing: tuple[int, ...]
    closed: int
    sizes: tuple[int, ...]
    posed: Posed


def live_sizing(sizing: Sizing, choices: Choices = NONE) -> LiveSizing | str:
    """The functions and settings of a sizing; or a clause that says why a page cannot compute it. `choices` are the
    motors and gears among which its reader chooses.
    """
    import casadi

    if reason := _obstacle(sizing):
        return reason
    assert sizing.inputs is not None
    mechanism, motions, actuators = sizing.inputs
    scene, n, k = mechanism.equations.scene, mechanism.robot.nq, len(mechanism.motors)
    parameters = {**own_parameters(mechanism), **payload_parameters(mechanism, choices)}
    symbols = Symbols(mechanism.robot, parameters, () if scene is None else scene.frames)
    loads = _loads(mechanism, actuators.keys(), symbols)
    if loads is None:
        return "forces of the scene depend on time"
    closes = isinstance(mechanism, Linkage) and mechanism.robot.nq == mechanism.robot.nv
    lead = leading_joints(mechanism, motions) if isinstance(mechanism, Linkage) and closes else None
    loops = LiveLoops(mechanism, symbols, lead) if isinstance(mechanism, Linkage) and lead is not None else None
    changeable, fixed = changeable_parameters(sizing, _at(loads, symbols), symbols, loops)
    residual = casadi.SX(0, 1) if loops is None else loops.residual
    closing = [name for name in changeable if casadi.depends_on(residual, symbols.parameter(name))]
    loops = loops if closing else None
    settings = LiveSettings(sizing, changeable, choices)
    p, speed = casadi.SX.sym("p", len(settings.all)), casadi.SX.sym("speed")
    begin, end, place = (casadi.SX.sym(name, size) for name, size in (("begin", 3 * n), ("end", 3 * n), ("place", 2)))
    side, closed = (
        casadi.SX.sym("side", mechanism.robot.nv),
        casadi.SX.sym("closed", 0 if loops is None else len(loops.rest)),
    )
    values = settings.values(p, parameters)
    given = q, v, a = velocities(mechanism.robot, _states(begin, end, place[1], place[0]))
    if loops is not None:
        q, v, a = loops.states(given, closed, values)
    v, a = speed * v, speed**2 * a
    columns = [joint.v for joint in mechanism.motors]
    torque, inertia = loads(q, v, a, values, *settings.surroundings(p, mechanism.robot))
    speed_of, acceleration_of = v[columns], a[columns]
    sided = casadi.if_else(casadi.fabs(speed_of) <= STILL, ONE_SIDE * side[columns], speed_of)
    drives = [_drive(joint, settings, p, choices) for joint in sizing.joints]
    follows = [] if loops is None else [q]
    shown, sizes = [torque, v, a], [torque, -torque, casadi.fabs(sided)]
    rates, shafts, turns = [torque**2, casadi.fabs(sided)], [], []
    more: list[list[casadi.SX]] = [[], []]  # sizes and rates of drives, beside those that all joints have
    counts = []
    for i, drive in enumerate(drives):
        if drive is None:
            shafts.append(torque[i])
            turns.append(speed_of[i])
            counts.append((0, 0))
        else:
            at = drive.at(LiveSample(torque[i], sided[i], acceleration_of[i], inertia[i]))
            shafts.append(at.shaft)
            turns.append(RPM * drive.ratio * speed_of[i])
            counts.append((len(at.sizes), len(at.rates)))
            more[0] += at.sizes
            more[1] += at.rates
    shown += [casadi.vertcat(*turns), casadi.vertcat(*shafts), *follows]
    largest = [*casadi.vertsplit(casadi.vertcat(*sizes, casadi.fabs(shown[4]))), *more[0]]
    means = [*casadi.vertsplit(casadi.vertcat(*rates)), *more[1]]
    most = [casadi.SX.sym(f"most {j}") for j in range(len(largest))]
    mean = [casadi.SX.sym(f"mean {j}") for j in range(len(means))]
    of_joint: list[tuple[casadi.SX, ...]] = []
    uses: list[casadi.SX] = []
    named: list[Use] = []
    places = [4 * k, 2 * k]
    for i, (joint, drive) in enumerate(zip(sizing.joints, drives, strict=True)):
        peak, fast, shaft = casadi.fmax(most[i], most[k + i]), most[2 * k + i], most[3 * k + i]
        rms, slow = casadi.sqrt(mean[i]), mean[k + i]
        own = [each[place : place + count] for each, place, count in zip((most, mean), places, counts[i], strict=True)]
        places = [place + count for place, count in zip(places, counts[i], strict=True)]
        judged = None if drive is None else drive.uses(own[0], own[1], (peak, fast, slow, shaft))
        if drive is None or judged is None:
            of_joint.append((peak, rms, fast, shaft, rms, slow))
        else:
            of_joint.append((peak, rms, fast, shaft, judged.rms_torque, RPM * drive.ratio * slow))
        listed = _listed(joint, drive)
        for name, share in _uses(joint, peak, fast, {} if judged is None else judged.uses, listed):
            of = listed.get(name) if isinstance(drive, LiveChoice) else None
            computed = tuple(drive.computed.get(name, ())) if isinstance(drive, LiveChoice) and of else None
            named.append(Use(joint.name, name, None if share is None else len(uses), of, computed))
            uses += [] if share is None else [share]
    figures = casadi.vertcat(*(casadi.vertcat(*kind) for kind in zip(*of_joint, strict=True)))
    every = casadi.vertcat(casadi.SX(0, 1), *uses)
    needed = {symbol.element_hash() for symbol in casadi.symvar(casadi.vertcat(figures, every))}
    kept = [[j for j, one in enumerate(each) if one.element_hash() in needed] for each in (most, mean)]
    picked = [casadi.vertcat(*(each[j] for j in rows)) for each, rows in zip((largest, means), kept, strict=True)]
    sample = casadi.Function(
        "sample",
        [begin, end, place, side, speed, p, *([] if loops is None else [closed])],
        [casadi.densify(each) for each in (casadi.vertcat(*shown), *picked)],
    )
    inputs = [casadi.vertcat(*(each[j] for j in rows)) for each, rows in zip((most, mean), kept, strict=True)]
    results = (figures, every, every > 1.0 + TOLERANCE)
    verdict = casadi.Function("verdict", [*inputs, p], [casadi.densify(each) for each in results])
    close = None
    if loops is not None:
        steps = loops.step(given[0], closed, values)
        close = casadi.Function("close", [begin, end, place, p, closed], list(map(casadi.densify, steps)))
    return LiveSizing(
        settings=tuple(settings.all),
        fixed=tuple(fixed),
        speeds=tuple(settings.place("speed", motion.name) for motion in motions),
        uses=tuple(named),
        sample=sample,
        verdict=verdict,
        close=close,
        closing=tuple(settings.place("parameter", name) for name in closing),
        closed=closed.numel(),
        sizes=(sum(each.numel() for each in shown), *map(len, kept), 6 * k, len(uses)),
        posed=Posed(
            position=q,
            parameters=parameters,
            values=values,
            inputs=(begin, end, place, p, *([] if loops is None else [closed])),
        ),
    )


def _obstacle(sizing: Sizing) -> str:
    """Why a page cannot compute a sizing; empty where nothing of its inputs says so."""
    if sizing.inputs is None:
        return "the sizing does not hold its motions"
    mechanism = sizing.inputs.mechanism
    robot, scene, config = mechanism.robot, mechanism.equations.scene, sizing.config
    if robot.floating_base or (any(joint.nv != 1 for joint in robot.joints) and not isinstance(mechanism, Linkage)):
        return "the robot has joints with several degrees of freedom, and no loop"
    if sizing.mass_tolerance:
        return "the masses have a tolerance"
    if sizing.motors or (config is not None and config.transmissions):
        return "the robot has coupled transmissions"
    if config is not None and config.duty:
        return "the motors are judged along a duty program"
    if sizing.unsizable:
        return "some motors cannot be sized"
    if scene is not None and scene.signal_sources:
        return "forces of the scene depend on time"
    if isinstance(mechanism, Linkage):
        others = robot.nv - len(mechanism.motors)
        if mechanism.idle_rotations or len(rows_of(mechanism.kinematics.scene).kept) != others:
            return "the constraints of the linkage do not determine the other joints by those with motors"
    return ""


def module_of(function: casadi.Function) -> bytes:
    """A function as a WebAssembly module."""
    return webassembly(graph_of(function.serialize().encode("latin-1")))


def _states(begin: casadi.SX, end: casadi.SX, length: casadi.SX, s: casadi.SX | float) -> list[casadi.SX]:
    """q, q̇ and q̈ at a share s of a piece of a motion."""
    import casadi

    (q0, v0, a0), (q1, v1, a1) = (casadi.vertsplit(each, each.size1() // 3) for each in (begin, end))
    ends = (v0 * length, a0 * length**2), (v1 * length, a1 * length**2)
    p, pd, pdd = quintic_polynomial(s, q0, q1 - q0, *ends)
    return [p, pd / length, pdd / length**2]


def _loads(mechanism: Mechanism, actuated: Collection[str], symbols: Symbols) -> casadi.Function | None:
    """(q, v, a, values of parameters, gravity, viscous, coulomb) -> the torques at the motors' joints, without the
    rotors of those joints that have an actuator, and the inertia that accelerates with each of them alone, without
    rotors; None where they depend on time.
    """
    import casadi

    robot = mechanism.robot
    a = casadi.SX.sym("a", robot.nv)
    rotor = np.zeros(robot.nv)
    own = [joint.v for joint in robot.joints if joint.name in actuated]
    rotor[own] = robot.rotor_inertia[own]
    need = symbols.inverse_dynamics(symbols.q, symbols.v, a) - casadi.DM(rotor) * a
    gravity = casadi.SX.sym("gravity", 3)
    need += symbols.holding_force(symbols.q, gravity - casadi.DM(robot.gravity))
    columns = [joint.v for joint in mechanism.motors]
    rotors = np.zeros(robot.nv)
    rotors[columns] = robot.rotor_inertia[columns]
    mass = casadi.jacobian(need, a) - casadi.diag(casadi.DM(rotors - rotor))
    coefficients = [casadi.SX.sym(name, robot.nv) for name in ("viscous", "coulomb")]
    need += robot.equations.friction_of(symbols.v, *coefficients)
    for force in mechanism.equations.forces:
        need -= force.generalised_force(symbols).force
    if isinstance(mechanism, Linkage):
        kept = SymbolicRows.unscaled(rows_of(mechanism.kinematics.scene).kept)
        jacobian = differentiate_constraints(mechanism.kinematics.scene.constraints, kept, symbols).jacobian
        others = [v for v in range(robot.nv) if v not in columns]
        held = casadi.solve(casadi.densify(jacobian[:, others]).T, need[others])
        torque = need[columns] - jacobian[:, columns].T @ held
        motion = casadi.SX(robot.nv, len(columns))
        motion[columns, :] = casadi.SX.eye(len(columns))
        motion[others, :] = -casadi.solve(casadi.densify(jacobian[:, others]), jacobian[:, columns])
        inertia = casadi.sum1(motion * (mass @ motion)).T
    else:
        torque, inertia = need[columns], casadi.diag(mass)[columns]
    if casadi.depends_on(torque, symbols.t):
        return None
    inputs = [symbols.q, symbols.v, a, symbols.p, gravity, *coefficients]
    return casadi.Function("loads", inputs, [torque, inertia])


def _at(loads: casadi.Function, symbols: Symbols) -> casadi.SX:
    """All loads, of which only the parameters are symbols of `symbols`."""
    import casadi

    q, v, a, _, *others = loads.sx_in()
    torque, inertia = loads(q, v, a, symbols.p, *others)
    return casadi.vertcat(torque, inertia)


def _drive(joint: JointSizing, settings: LiveSettings, p: casadi.SX, choices: Choices) -> LiveDrive | LiveChoice | None:
    """The motor and gear of a joint, or several; None where it has none, or its torque needs unknown figures."""
    if joint.shaft is None or joint.shaft.actuator.unknown_of_torque:
        return None
    choice = settings.choice(p, joint.name)
    if choice is not None:
        pairs = choices.pairs[joint.name]
        return LiveChoice([LiveDrive(joint, one.actuator, one.judged, one.actuator.ratio) for one in pairs], choice)
    actuator, ratio = joint.shaft.actuator, settings.symbol(p, "ratio", joint.name, joint.shaft.actuator.ratio)
    return LiveDrive(joint, actuator, joint.shaft.judged.judged, ratio)


def _listed(joint: JointSizing, drive: LiveDrive | LiveChoice | None) -> dict[str, tuple[int, ...]]:
    """The criteria of the motors and gears of a joint, and of which of them they are."""
    if not isinstance(drive, LiveChoice):
        return {} if joint.shaft is None else {one.name: () for one in joint.shaft.judged.judged}
    names = dict.fromkeys(one.name for each in drive.drives for one in each.judged)
    return {
        name: tuple(k for k, each in enumerate(drive.drives) if any(one.name == name for one in each.judged))
        for name in names
    }


def _uses(
    joint: JointSizing, peak: casadi.SX, fast: casadi.SX, judged: dict[str, casadi.SX], names: Iterable[str]
) -> list[tuple[str, casadi.SX | None]]:
    """The shares of the limits of a joint, those of criteria with these names given; None of what is not recomputed."""
    uses: list[tuple[str, casadi.SX | None]] = []
    if joint.effort_limit is not None:
        uses.append((EFFORT, peak / joint.effort_limit if joint.effort_limit else None))
    if joint.velocity_limit is not None:
        uses.append((VELOCITY, fast / joint.velocity_limit if joint.velocity_limit else None))
    return uses + [(name, judged.get(name)) for name in names]
