"""A sizing as functions of the numbers that a page lets its reader change, compiled to WebAssembly.

Two functions say all that the page computes; it only sums and compares what they return along the motions:

    sample   (begin, end, place, side, speed, p) -> shown, sizes, rates
    verdict  (largest sizes, means of rates, p) -> figures, uses, exceeded

`sample` takes a quintic of a motion (live_motion.py); the place in it: the share, and how long the quintic lasts; the
signs of the joints' speeds in the piece; the factor on the motion's speed; and the
settings p. It gives the joints' torques by the expressions of `robot.inverse_dynamics` and, for a linkage, by the
principle of virtual power (dynamics/motor_shares.py); live_criteria.py gives the torques at the motors' shafts, and the
criteria of motors and gears, which `verdict` ends. Tests compare both with
`bellcrank.size` and `bellcrank.judge`.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from bellcrank.actuators.actuator import Actuator
from bellcrank.codegen.expression_graph import graph_of
from bellcrank.codegen.webassembly import webassembly
from bellcrank.dynamics.closed_inverse_dynamics import Linkage
from bellcrank.dynamics.constraint_derivatives import SymbolicRows, differentiate_constraints
from bellcrank.dynamics.constraint_rows import rows_of
from bellcrank.elements.parameters import Parameter
from bellcrank.elements.symbols import Symbols
from bellcrank.motion.hermite import quintic_polynomial
from bellcrank.robot.traced_tree import ORIGIN, setting
from bellcrank.simulation.live_settings import Setting, slider_end
from bellcrank.sizing.live_criteria import LiveDrive, Sample
from bellcrank.sizing.one_sided import ONE_SIDE, STILL
from bellcrank.sizing.selection.criteria import TOLERANCE

if TYPE_CHECKING:
    import casadi

    from bellcrank.dynamics.mechanism import Mechanism
    from bellcrank.robot.robot import Robot
    from bellcrank.sizing.joint_sizing import JointSizing
    from bellcrank.sizing.result import Sizing

RPM = 30.0 / math.pi
FIGURES = ("peak torque", "RMS torque", "peak speed", "peak motor torque", "RMS motor torque", "mean motor speed")
EFFORT, VELOCITY = "URDF effort limit", "URDF velocity limit"
REACH = 0.3  # m: how far a slider moves the centre of a payload
FRICTION = 0.3  # of the peak torque: the most friction of a slider


class Use(NamedTuple):
    """A limit of one joint: its name, and its place in the uses of `verdict`; None where it is not recomputed."""

    joint: str
    name: str
    place: int | None


@dataclass(frozen=True, kw_only=True)
class LiveSizing:
    """What a page needs to compute a sizing.

    Attributes:
        settings: What can be changed, in the order of p.
        speeds: The place in p of the factor on the speed of each motion.
        uses: The limits of the joints.
        sample: The function of a sample, as a WebAssembly module.
        verdict: That of the verdict.
        sizes: How many numbers both return: shown, sizes, rates, figures, uses.
    """

    settings: tuple[Setting, ...]
    speeds: tuple[int, ...]
    uses: tuple[Use, ...]
    sample: bytes
    verdict: bytes
    sizes: tuple[int, ...]


def live_sizing(sizing: Sizing) -> LiveSizing | str:
    """The functions and settings of a sizing; or a clause that says why a page cannot compute it."""
    import casadi

    if reason := _obstacle(sizing):
        return reason
    assert sizing.inputs is not None
    mechanism, motions, actuators = sizing.inputs
    settings = _Settings(sizing)
    n, k = mechanism.robot.nv, len(mechanism.motors)
    p, speed = casadi.SX.sym("p", len(settings.all)), casadi.SX.sym("speed")
    begin, end, place = (casadi.SX.sym(name, size) for name, size in (("begin", 3 * n), ("end", 3 * n), ("place", 2)))
    side = casadi.SX.sym("side", n)
    q, v, a = _states(begin, end, place[1], place[0])
    v, a = speed * v, speed**2 * a
    columns = [joint.v for joint in mechanism.motors]
    found = _torques(mechanism, actuators.keys(), settings, p, (q, v, a))
    if found is None:
        return "forces of the scene depend on time"
    torque, inertia = found
    speed_of, acceleration_of = v[columns], a[columns]
    sided = casadi.if_else(casadi.fabs(speed_of) <= STILL, ONE_SIDE * side[columns], speed_of)
    drives = [_drive(joint, settings, p) for joint in sizing.joints]
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
            at = drive.at(Sample(torque[i], sided[i], acceleration_of[i], inertia[i]))
            shafts.append(at.shaft)
            turns.append(RPM * drive.ratio * speed_of[i])
            counts.append((len(at.sizes), len(at.rates)))
            more[0] += at.sizes
            more[1] += at.rates
    shown += [casadi.vertcat(*turns), casadi.vertcat(*shafts)]
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
        for name, share in _uses(joint, peak, fast, {} if judged is None else judged.uses):
            named.append(Use(joint.name, name, None if share is None else len(uses)))
            uses += [] if share is None else [share]
    figures = casadi.vertcat(*(casadi.vertcat(*kind) for kind in zip(*of_joint, strict=True)))
    every = casadi.vertcat(casadi.SX(0, 1), *uses)
    needed = {symbol.element_hash() for symbol in casadi.symvar(casadi.vertcat(figures, every))}
    kept = [[j for j, one in enumerate(each) if one.element_hash() in needed] for each in (most, mean)]
    picked = [casadi.vertcat(*(each[j] for j in rows)) for each, rows in zip((largest, means), kept, strict=True)]
    sample = casadi.Function(
        "sample",
        [begin, end, place, side, speed, p],
        [casadi.densify(each) for each in (casadi.vertcat(*shown), *picked)],
    )
    inputs = [casadi.vertcat(*(each[j] for j in rows)) for each, rows in zip((most, mean), kept, strict=True)]
    results = (figures, every, every > 1.0 + TOLERANCE)
    verdict = casadi.Function("verdict", [*inputs, p], [casadi.densify(each) for each in results])
    return LiveSizing(
        settings=tuple(settings.all),
        speeds=tuple(settings.place("speed", motion.name) for motion in motions),
        uses=tuple(named),
        sample=_module(sample),
        verdict=_module(verdict),
        sizes=(3 * k + 2 * n, *map(len, kept), 6 * k, len(uses)),
    )


def _obstacle(sizing: Sizing) -> str:
    """Why a page cannot compute a sizing; empty where nothing of its inputs says so."""
    if sizing.inputs is None:
        return "the sizing does not hold its motions"
    mechanism = sizing.inputs.mechanism
    robot, scene, config = mechanism.robot, mechanism.equations.scene, sizing.config
    if robot.floating_base or any(joint.nv != 1 for joint in robot.joints) or robot.nq != robot.nv:
        return "the robot has joints with several degrees of freedom"
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


def _module(function: casadi.Function) -> bytes:
    return webassembly(graph_of(function.serialize().encode("latin-1")))


def _states(begin: casadi.SX, end: casadi.SX, length: casadi.SX, s: casadi.SX | float) -> list[casadi.SX]:
    """Position, velocity and acceleration at a share s of a piece of a motion."""
    import casadi

    (q0, v0, a0), (q1, v1, a1) = (casadi.vertsplit(each, each.size1() // 3) for each in (begin, end))
    ends = (v0 * length, a0 * length**2), (v1 * length, a1 * length**2)
    p, pd, pdd = quintic_polynomial(s, q0, q1 - q0, *ends)
    return [p, pd / length, pdd / length**2]


class _Settings:
    """The settings, and which symbol of p each of them is."""

    def __init__(self, sizing: Sizing) -> None:
        assert sizing.inputs is not None
        mechanism, motions, actuators = sizing.inputs
        self.all: list[Setting] = []
        self._places: dict[tuple[str, str], int] = {}
        self.targets: dict[str, int] = {}  # of the robot's tree
        config, robot = sizing.config, mechanism.robot
        for number, payload in enumerate(robot.payloads, 1):
            path = f"payloads.{number}" if config is not None and number <= len(config.payloads) else ""
            group = f"payload {number} at {payload.frame}" if len(robot.payloads) > 1 else f"payload at {payload.frame}"
            self._target(
                f"link.payload {number}.mass",
                Setting(
                    group=group,
                    name="mass",
                    unit="kg",
                    value=payload.mass,
                    range=(0.0, slider_end(3.0 * payload.mass)),
                    above=True,
                    path=path and f"{path}.mass",
                ),
            )
            for axis, value, entry in zip(ORIGIN[:3], payload.cg, "123", strict=True):
                self._target(
                    f"link.payload {number}.cg.{axis}",
                    Setting(
                        group=group,
                        name=f"centre {axis}",
                        unit="m",
                        value=value,
                        range=(value - REACH, value + REACH),
                        least=-math.inf,
                        path=path and f"{path}.cg",
                        entry=entry,
                    ),
                )
        named = set() if config is None else set(config.motions)
        for motion in motions:
            path = f"motions.{motion.name}.speed_factor" if motion.name in named else ""
            stated = 1.0 if not path or config is None else config.motions[motion.name].speed_factor
            self._add(
                "speed",
                motion.name,
                Setting(
                    group="speed of motions",
                    name=motion.name,
                    unit="",
                    value=stated,
                    range=(0.2 * stated, 2.0 * stated),
                    above=True,
                    path=path,
                ),
            )
        given = {} if config is None else config.actuators
        for joint in sizing.joints:
            if joint.name in actuators and _of_ratings(actuators[joint.name]):
                path = f"actuators.{joint.name}.ratio" if joint.name in given else ""
                unit = "rad/m" if joint.kind == "prismatic" else ""
                ratio = actuators[joint.name].ratio
                self._add(
                    "ratio",
                    joint.name,
                    Setting(
                        group="gear ratio",
                        name=joint.name,
                        unit=unit,
                        value=ratio,
                        range=(0.3 * ratio, 2.0 * ratio),
                        above=True,
                        path=path,
                    ),
                )
        for kind, values, units in (
            ("viscous", robot.viscous, ("N m s/rad", "N s/m")),
            ("coulomb", robot.coulomb, ("N m", "N")),
        ):
            for one in robot.joints:
                if config is not None and one.name in config.without_friction:  # the scene's dry friction counts there
                    continue
                value, sized = float(values[one.v]), next((j for j in sizing.joints if j.name == one.name), None)
                most = 1.0 if sized is None else FRICTION * sized.peak_torque
                if sized is not None and kind == "viscous" and sized.peak_speed:
                    most /= sized.peak_speed
                self._add(
                    kind,
                    one.name,
                    Setting(
                        group=f"{kind} friction",
                        name=one.name,
                        unit=units[one.kind == "prismatic"],
                        value=value,
                        range=(0.0, slider_end(max(most, 3.0 * value))),
                        path="" if config is None else "friction",
                        entry=f"{one.name}/{kind}",
                    ),
                )
        most = float(np.linalg.norm(robot.gravity)) or 9.81
        for axis, value, entry in zip(ORIGIN[:3], robot.gravity.tolist(), "123", strict=True):
            self._add(
                "gravity",
                axis,
                Setting(
                    group="gravity (tilt of the base)",
                    name=axis,
                    unit="m/s²",
                    value=value,
                    range=(-most, most),
                    least=-math.inf,
                    path="" if config is None else "gravity",
                    entry=entry,
                ),
            )

    def _add(self, kind: str, name: str, made: Setting) -> None:
        self._places[kind, name] = len(self.all)
        self.all.append(made)

    def _target(self, target: str, made: Setting) -> None:
        self.targets[target] = len(self.all)
        self.all.append(made)

    def place(self, kind: str, name: str) -> int:
        """The place of a setting in p."""
        return self._places[kind, name]

    def symbol(self, p: casadi.SX, kind: str, name: str, otherwise: float) -> casadi.SX | float:
        """The symbol of a setting; a number where there is none."""
        place = self._places.get((kind, name))
        return otherwise if place is None else p[place]


def _of_ratings(actuator: Actuator) -> bool:
    """Whether an actuator is given by its ratings, and states what the torque at its shaft needs."""
    return actuator.by_ratings and not actuator.unknown_of_torque


def _torques(
    mechanism: Mechanism, actuated: Collection[str], settings: _Settings, p: casadi.SX, states: tuple[casadi.SX, ...]
) -> tuple[casadi.SX, casadi.SX] | None:
    """The torques at the motors' joints, without the rotors of those joints that have an actuator, and the inertia that
    accelerates with each of them alone, without rotors; None where they depend on time.
    """
    import casadi

    robot, scene = mechanism.robot, mechanism.equations.scene
    own = {} if scene is None else scene.parameters
    varied = {f"varied {place}": _parameter(robot, target) for target, place in settings.targets.items()}
    symbols = Symbols(robot, {**own, **varied}, () if scene is None else scene.frames)
    a = casadi.SX.sym("a", robot.nv)
    rotor = np.array([robot.rotor_inertia[joint.v] if joint.name in actuated else 0.0 for joint in robot.joints])
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
    inputs = [symbols.q, symbols.v, a, symbols.p, symbols.t, gravity, *coefficients]
    function = casadi.Function("torques", inputs, [torque, inertia])
    values = casadi.vertcat(
        casadi.SX(0, 1), *(one.value for one in own.values()), *(p[place] for place in settings.targets.values())
    )
    down = casadi.vertcat(*(p[settings.place("gravity", axis)] for axis in ORIGIN[:3]))
    friction = [
        casadi.vertcat(*(settings.symbol(p, kind, joint.name, float(stated[joint.v])) for joint in robot.joints))
        for kind, stated in (("viscous", robot.viscous), ("coulomb", robot.coulomb))
    ]
    return cast("tuple[casadi.SX, casadi.SX]", function(*states, values, 0.0, down, *friction))


def _parameter(robot: Robot, target: str) -> Parameter:
    return Parameter(target, 0.0, "", (target,), (setting(robot.equations.tree, target),))


def _drive(joint: JointSizing, settings: _Settings, p: casadi.SX) -> LiveDrive | None:
    """The motor and gear of a joint; None where it has none, or figures are unknown that its torque needs."""
    if joint.shaft is None or joint.shaft.actuator.unknown_of_torque:
        return None
    return LiveDrive(joint, settings.symbol(p, "ratio", joint.name, joint.shaft.actuator.ratio))


def _uses(
    joint: JointSizing, peak: casadi.SX, fast: casadi.SX, judged: dict[str, casadi.SX]
) -> list[tuple[str, casadi.SX | None]]:
    """The shares of the limits of a joint, those of criteria by name given; None of those that are not recomputed."""
    uses: list[tuple[str, casadi.SX | None]] = []
    if joint.effort_limit is not None:
        uses.append((EFFORT, peak / joint.effort_limit if joint.effort_limit else None))
    if joint.velocity_limit is not None:
        uses.append((VELOCITY, fast / joint.velocity_limit if joint.velocity_limit else None))
    if joint.shaft is None:
        return uses
    return uses + [(one.name, judged.get(one.name)) for one in joint.shaft.judged.judged]
