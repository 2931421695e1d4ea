"""The loops of drives: resonance, bandwidth and stability margins of each, at rest in a posture.

Their equations are linear ones about the posture, without dry friction and stops, losses of gears and backlash, at
the temperatures of the start and with the bus at its voltage. Those of a closed linkage are in independent joints, by
which its constraints move the others; constant torques at the joints with drives hold the posture.

The resonances of an axis are the eigenfrequencies ω_r of its rotor and the joints, with the torque of its motor given
and the other rotors and joints without elastic gear held; the antiresonances ω_a those with its own rotor held too: the
zeros of the response of the rotor to the motor's torque. Source: D. Schröder, Elektrische Antriebe – Regelung von
Antriebssystemen (2015), ch. 19.

Margins are those of the loop that is opened at the torque which the speed controller asks, all others being closed:
the factor g and the angle θ for which κ = g or κ = exp(−iθ) at that place brings the closed loop to the border of
stability. Loops that are sampled are taken exactly, with their delays: the equations are integrated between their
instants, and the product over the longest sample time has its eigenvalues in the unit circle where the loop is stable.
Source: K. J. Åström and B. Wittenmark, Computer-Controlled Systems (3rd ed. 1997), ch. 2 and 3.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bellcrank.actuators.copper import resistance_factor
from bellcrank.arrays import Array, Complex
from bellcrank.dynamics.equations.assembly import Assembly, assemble
from bellcrank.dynamics.equations.base_frame_elimination import mass_matrix
from bellcrank.dynamics.equations.system import system_parameters
from bellcrank.elements.drives import Drive
from bellcrank.elements.dry_friction import JointDryFriction
from bellcrank.elements.element import Force
from bellcrank.elements.expression import Expression, Term
from bellcrank.elements.joint_forces import Damper
from bellcrank.elements.joint_stops import JointStop
from bellcrank.elements.pin_friction import PinFriction
from bellcrank.elements.rotor_friction import RotorFriction
from bellcrank.elements.supply import Supply
from bellcrank.errors import InputError
from bellcrank.scene.settings import Stabilisation

if TYPE_CHECKING:
    import casadi

    from bellcrank.robot.robot import RobotJoint
    from bellcrank.scene.scene import Scene

GROWTH = 1e-9  # of the largest eigenvalue, or of 1 for a sampled loop: a slower growth is rounding
LARGEST_GAIN = 1e4
GRID = 24  # factors and angles that are tried before the border between two of them is located
BISECTIONS = 32
FREQUENCIES = 1000
LOWEST = 1e-5  # of the largest frequency
MOST_INSTANTS = 20_000
COMMON = 1e-6  # relative: sample times whose ratio is nearer than this to a whole number have it
LEAST_RANK = 1e-7  # of the largest singular value: rounding of a rank that is lost
PREFERRED = 1e3  # the weight of joints with drives among those that could be independent
BANDWIDTH = 1.0 / math.sqrt(2.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class DriveDynamics:
    """The dynamics of one drive at rest in a posture; angular frequencies in rad/s.

    Attributes:
        joint: Its joint.
        resonances: Eigenfrequencies with the motor's torque given.
        antiresonances: Eigenfrequencies with the rotor held.
        stable: Whether the closed loop is stable; None without a servo.
        gain_margin: The factor on the torque that the speed controller asks at which the loop becomes unstable,
            infinite where none up to 10,000 does; None where the loop is not stable.
        phase_margin: rad, the lag there at which it becomes unstable; infinite where none up to a half turn does.
        bandwidth: At which the joint follows its reference with 1/√2; None where it is not reached.
    """

    joint: str
    resonances: tuple[float, ...]
    antiresonances: tuple[float, ...]
    stable: bool | None
    gain_margin: float | None
    phase_margin: float | None
    bandwidth: float | None

    def rows(self) -> list[tuple[str, str]]:
        """(name, value) of what is known, frequencies in Hz."""
        found = []
        for name, values in (("resonances", self.resonances), ("antiresonances", self.antiresonances)):
            if values:
                found.append((name, ", ".join(f"{value / (2.0 * math.pi):.5g} Hz" for value in values)))
        if self.stable is None:
            return found
        if not self.stable:
            return [*found, ("loop", "unstable")]
        assert self.gain_margin is not None and self.phase_margin is not None
        gain = f"{20.0 * math.log10(self.gain_margin):.4g} dB" if math.isfinite(self.gain_margin) else "above 80 dB"
        phase = f"{math.degrees(self.phase_margin):.4g}°" if math.isfinite(self.phase_margin) else "above 180°"
        found += [("gain margin", gain), ("phase margin", phase)]
        if self.bandwidth is not None:
            found.append(("bandwidth", f"{self.bandwidth / (2.0 * math.pi):.5g} Hz"))
        return found

    def as_dict(self) -> dict[str, Any]:
        """The result as data that JSON can hold, infinite margins as None."""
        finite = {
            name: None if value is None or not math.isfinite(value) else value
            for name, value in (("gain_margin", self.gain_margin), ("phase_margin", self.phase_margin))
        }
        return {
            "joint": self.joint, "resonances": list(self.resonances), "antiresonances": list(self.antiresonances),
            "stable": self.stable, **finite, "bandwidth": self.bandwidth,
        }  # fmt: skip


def refuse_nonlinear(scene: Scene) -> None:
    """Refuse a scene whose drives have no linear equations here (InputError)."""
    what = "linear equations of drives in an open chain require joints of one degree of freedom"
    for joint in scene.robot.joints if not scene.constraints else ():
        if joint.nv != 1 or joint.nq != 1:
            raise InputError(f"{scene.source}: {what}; joint '{joint.name}' is {joint.kind}")
    if rattling := [drive.joint.name for drive in scene.drives if drive.contact is not None]:
        raise InputError(
            f"{scene.source}: the drive of '{rattling[0]}' has a rigid gear with backlash, which has no linear "
            "equations; give it a stiffness, or give 'gains'"
        )
    smooth = (*scene.drives, *scene.dry_friction)
    if any(part.switches for part in scene.elements if part not in smooth and not isinstance(part, RotorFriction)):
        raise InputError(f"{scene.source}: forces with switches have no linear equations at them; remove them")
    rubbing = [part for part in scene.dry_friction if not isinstance(part, JointDryFriction)]
    if odd := [part for part in rubbing if not isinstance(part, PinFriction) or part.viscous]:
        raise InputError(
            f"{scene.source}: linear equations of drives do not know {odd[0].kind} of '{odd[0].held}'; remove it, or "
            "its viscous part"
        )
    others = [part.name for part in scene.control if part.samples is not None and part not in scene.drives]
    if others:
        raise InputError(f"{scene.source}: control '{others[0]}' is sampled, and is not part of a drive; remove it")


def smooth_scene(scene: Scene) -> Scene:
    """The scene without outputs and events, dry friction, brakes and rigid stops; its drives hold their posture."""
    forces: list[Force] = []
    for part in scene.forces:
        if isinstance(part, JointDryFriction):
            if part.viscous:
                forces.append(Damper(part.name, part.place, part.joint, part.viscous))
        elif not isinstance(part, JointStop | Supply | PinFriction):
            forces.append(part)
    control = tuple(_without_losses(part) if isinstance(part, Drive) else part for part in scene.control)
    settings = replace(scene.settings, stabilisation=Stabilisation())
    return replace(scene, forces=tuple(forces), control=control, outputs={}, events=(), settings=settings)


def _without_losses(drive: Drive) -> Drive:
    loss = {**drive.loss, "coulomb": 0.0, "static": 0.0}
    closed = {"efficiency": 1.0, "back_efficiency": 1.0, "backlash": 0.0}
    gear = {key: closed.get(key, value) for key, value in drive.gear.items() if not key.startswith("hysteresis")}
    if drive.has_hysteresis:  # about a posture it is a spring
        gear["stiffness"] += drive.gear["hysteresis_stiffness"]
    servo = None if drive.servo is None else replace(drive.servo, motion=None, target=0.0)
    circuit = drive.circuit
    if drive.heat:  # at the temperature of the start
        warm = circuit["resistance"] * float(resistance_factor(drive.heat["winding"]))
        circuit = {**circuit, "resistance": warm}
    return replace(drive, loss=loss, gear=gear, servo=servo, circuit=circuit, heat={}, supplied=False)


def with_continuous_loops(scene: Scene) -> Scene:
    """The scene with all cascades of its drives continuous."""
    drives = {
        drive.name: replace(drive, servo=replace(drive.cascade, samples={}, delay=0.0, resolution=0.0))
        for drive in scene.drives
        if drive.cascade is not None
    }
    return replace(scene, control=tuple(drives.get(part.name, part) for part in scene.control))


class _Slopes(NamedTuple):
    """∂ẋ/∂x, ∂ẋ/∂h, and of each update its ∂h⁺/∂x and ∂h⁺/∂h."""

    field: Array
    by_held: Array
    updates: list[tuple[Array, Array]]


class DriveEquations:
    """The equations of drives about a posture, as functions of the factor κ at one of them.

    Their states are small displacements of the joints (nv), velocities (nv), and the states of the drives.
    """

    def __init__(self, scene: Scene, time: Array, position: Array) -> None:
        import casadi

        self.scene = scene
        a = assemble(scene, held_sides=False, additions=True)
        s, more = a.symbols, a.symbols.additions
        assert more is not None
        names, nv = [drive.name for drive in scene.drives], scene.robot.nv
        factor, reference, torque = (
            casadi.vertcat(*[group[n] for n in names]) for group in (more.factor, more.reference, more.torque)
        )
        extra = [factor, reference, torque, more.load]
        state, rate = casadi.vertcat(a.q, a.v, a.z), casadi.vertcat(a.v, a.acceleration, a.auxiliary_rate)
        by_displacement = casadi.jacobian(a.rate, a.v)

        def slopes(values: casadi.SX) -> casadi.SX:
            own = casadi.vertcat(a.v, a.z)
            return casadi.horzcat(casadi.jacobian(values, a.q) @ by_displacement, casadi.jacobian(values, own))

        sampled = [(drive, source) for drive in scene.drives if (source := drive.samples) is not None]
        held = casadi.vertcat(casadi.SX(0, 1), *[s.signal(source) for _, source in sampled])
        self.held_size = held.numel()
        self.instants = [(drive, k, each) for drive, _ in sampled for k, each in enumerate(drive.instants)]
        updates = [
            casadi.vertcat(*[d.update(k, s) if d is drive else s.signal(source) for d, source in sampled])
            for drive, k, _ in self.instants
        ]
        args = [a.t, state, a.u, a.p, *extra]
        outputs = [rate, slopes(rate), casadi.jacobian(rate, held), casadi.jacobian(rate, reference)]
        outputs.append(casadi.jacobian(rate, casadi.vertcat(torque, more.load)))
        for update in updates:
            outputs += [
                slopes(update),
                casadi.jacobian(update, held),
                casadi.jacobian(update, reference),
            ]
        start = casadi.Function("start", args, [a.auxiliary_start])
        errors = [d.servo.error_at(d, s) if d.servo is not None else casadi.SX(0) for d in scene.drives]
        slope = casadi.jacobian(casadi.vertcat(*errors), reference)
        error = casadi.Function("error", args, [casadi.vertcat(*errors), slope])
        self._functions = casadi.Function("slopes", args, outputs), start, error
        self._mass = casadi.Function("mass", [a.q, a.p], [mass_matrix(s)])
        self._jacobian = None if a.solution is None else _jacobian(scene, a)
        self._state = np.concatenate([position, np.zeros(nv), np.zeros(a.z.numel())])
        self._size = 2 * nv + a.z.numel()
        self._time, self._signals = time, scene.signals_at(time)[0]
        constant = [False] * (2 * nv)
        for drive in scene.drives:
            states = drive.auxiliary
            if states is not None:
                own = [] if drive.servo is None else drive.servo.constant
                constant += [False] * (states.size - len(own)) + own
        self._changing = [k for k, still in enumerate(constant) if not still]
        self.take(scene.own_parameters)

    def take(self, own: Array) -> None:
        """Take other parameters of the scene (np,). Raises InputError where there are no linear equations."""
        _, start, error = self._functions
        parameters = np.concatenate([own, system_parameters(self.scene)[len(self.scene.own_parameters) :]])
        self._choose_coordinates(parameters)
        count, nv, x = len(self.scene.drives), self.scene.robot.nv, self._state.copy()
        own_states = self.scene.robot.nq + nv
        zero, one, load = np.zeros(count), np.ones(count), np.zeros(nv)
        begin = self._time, x, self._signals, parameters
        x[own_states:] = np.asarray(start(*begin, one, zero, zero, load)).ravel()
        wrong, slope = (np.asarray(m) for m in error(*begin, one, zero, zero, load))
        slope = slope.reshape(count, count)
        if not (np.isfinite(wrong).all() and np.isfinite(slope).all()):
            wrong, slope = 0.0 * zero, np.zeros((count, count))
        # integrators hold the posture where the references make the errors 0
        shift = np.linalg.lstsq(slope, -wrong.ravel(), rcond=None)[0] if slope.any() else zero
        x[own_states:] = np.asarray(start(*begin, one, shift, zero, load)).ravel()
        self._point = (*begin, zero, shift, zero, load)
        rates, self.field, _, _, self.inputs, *_ = found = self._values(one)
        rows, which = self._balanced()
        if rows and np.isfinite(rates).all() and np.isfinite(self.inputs).all():
            torques = np.zeros(count + nv)
            torques[which] = np.linalg.lstsq(self.inputs[rows][:, which], -rates.ravel()[rows], rcond=None)[0]
            self._point = (*begin, zero, shift, torques[:count], torques[count:])
            rates, self.field, _, _, self.inputs, *_ = found = self._values(one)
        if not all(np.isfinite(each).all() for each in found):
            raise InputError(
                f"{self.scene.source}: the linear equations of the drives are not finite; a figure of a motor, gear or "
                "servo is too large or too small"
            )
        sizes = np.abs(x) if own_states == 2 * nv else np.concatenate([np.ones(2 * nv), np.abs(x[own_states:])])
        terms = np.abs(self.field) @ sizes + np.abs(self.inputs).max(axis=1, initial=0.0)
        moving = np.abs(rates.ravel()[self.varying])
        self.residual = float((moving / np.maximum(terms[self.varying], 1.0)).max(initial=0.0))

    def _choose_coordinates(self, parameters: Array) -> None:
        """The entries of the state that are independent, and how the others follow."""
        self.varying, self._expand, nv = self._changing, None, self.scene.robot.nv
        if self._jacobian is None:
            return
        q = self._state[: self.scene.robot.nq]
        jacobian = np.asarray(self._jacobian(self._time, q, self._signals, parameters))
        own, basis = _motion_by_independent(self.scene, jacobian)
        whole = np.eye(self._size)
        moving = [*own, *(nv + k for k in own)]
        whole[:nv, own], whole[nv : 2 * nv, [nv + k for k in own]] = basis, basis
        self.varying = [k for k in self._changing if k >= 2 * nv or k in moving]
        self._expand = whole[:, self.varying]

    def _balanced(self) -> tuple[list[int], list[int]]:
        """The rows of ẋ that constant torques take to 0 in the posture, and these torques among the inputs.

        They are those of rotors behind elastic gears; in a linkage, whose load at the start is not known, also those of
        the joints, and forces at the joints with drives.
        """
        nv, drives = self.scene.robot.nv, self.scene.drives
        rows, which, first = list[int](), list[int](), 2 * nv
        for k, drive in enumerate(drives):
            if drive.is_elastic:
                rows, which = [*rows, first + 1], [*which, k]
            first += 0 if drive.auxiliary is None else drive.auxiliary.size
        if self._jacobian is None:
            return rows, which
        return [*range(nv, 2 * nv), *rows], [*which, *(len(drives) + drive.joint.v for drive in drives)]

    def columns(self, matrix: Array) -> Array:
        """A derivative by the state (m, n) as one by its independent entries."""
        return matrix[:, self.varying] if self._expand is None else np.asarray(matrix @ self._expand)

    def of_joint(self, joint: RobotJoint) -> Array:
        """The derivative (k,) of a joint's position by the independent entries of the state."""
        return np.asarray(self.columns(np.eye(1, self._size, joint.v))[0])

    def inertia_at_rotor(self, drive: Drive) -> float:
        """The inertia (kg m²) of rotor and load at the rotor, the other (independent) joints being held."""
        _, x, _, p, *_ = self._point
        nv, ratio = self.scene.robot.nv, drive.gear["ratio"]
        mass = np.asarray(self._mass(x[: self.scene.robot.nq], p))
        if self._expand is None:
            inertia = mass[drive.joint.v, drive.joint.v]
        else:
            basis = self._expand[:nv, [k for k, entry in enumerate(self.varying) if entry < nv]]
            reduced, way = basis.T @ mass @ basis, basis[drive.joint.v]
            held = np.flatnonzero(np.abs(way) > 0.0)  # itself, where it is independent
            inertia = 1.0 / (way[held] @ np.linalg.solve(reduced[np.ix_(held, held)], way[held]))
        return float(inertia / ratio**2 + drive.gear.get("inertia", 0.0))

    def _values(self, factor: Array) -> list[Array]:
        t, x, u, p, _, *rest = self._point
        found = self._functions[0](t, x, u, p, factor, *rest)
        return [np.asarray(m.full() if hasattr(m, "full") else m, dtype=np.float64) for m in found]

    def slopes(self, factor: Array) -> _Slopes:
        """At factors κ of the drives."""
        _, field, by_held, _, _, *updates = self._values(factor)
        pairs = [(self.columns(updates[3 * k]), updates[3 * k + 1]) for k in range(len(self.instants))]
        return _Slopes(self.columns(field[self.varying]), by_held[self.varying], pairs)

    def by_reference(self, k: int) -> tuple[Array, list[Array]]:
        """∂ẋ/∂r and ∂h⁺/∂r of the reference of drive k."""
        _, _, _, by_reference, _, *updates = self._values(np.ones(len(self.scene.drives)))
        return by_reference[self.varying, k], [updates[3 * i + 2][:, k] for i in range(len(self.instants))]


def _jacobian(scene: Scene, a: Assembly) -> casadi.Function:
    """J (m, nv) of the constraints of a scene. Raises InputError where they move, or are of velocities."""
    import casadi

    assert a.solution is not None
    found = a.solution.derivatives
    if found.nonholonomic_residual.numel() or not found.explicit_rate.is_zero():
        raise InputError(
            f"{scene.source}: linear equations of drives require constraints of positions that do not move; one of "
            f"{', '.join(part.name for part in scene.constraints)} is of velocities, or moves"
        )
    return casadi.Function("jacobian", [a.t, a.q, a.u, a.p], [casadi.densify(found.jacobian)])


def _motion_by_independent(scene: Scene, jacobian: Array) -> tuple[list[int], Array]:
    """The entries of v that are independent, those of drives first, and how (nv, k) they move all.

    Raises InputError where the constraints lose rank.
    """
    from scipy.linalg import qr

    _, sizes, rows = np.linalg.svd(jacobian)
    if len(sizes) and sizes[-1] < LEAST_RANK * sizes[0]:
        raise InputError(
            f"{scene.source}: the constraints are singular in the posture, where linear equations of drives do not "
            "describe the motion; start elsewhere"
        )
    null, weight = rows[len(sizes) :], np.ones(scene.robot.nv)
    weight[[drive.joint.v for drive in scene.drives]] = PREFERRED
    order = qr(null * weight, pivoting=True, mode="r")[1]
    own = sorted(int(k) for k in order[: len(null)])
    return own, np.linalg.solve(null[:, own], null).T


def drive_dynamics(scene: Scene, drive: Drive, time: Array, position: Array) -> DriveDynamics:
    """The dynamics of a drive of a scene without losses, at rest in a posture (nq,). Raises InputError."""
    resonances, antiresonances = _resonances(scene, drive, time, position) if drive.is_elastic else ((), ())
    found = DriveDynamics(
        joint=drive.joint.name, resonances=resonances, antiresonances=antiresonances, stable=None, gain_margin=None,
        phase_margin=None, bandwidth=None,
    )  # fmt: skip
    if drive.servo is None:
        return found
    loop = DriveLoop(DriveEquations(scene, time, position), drive.name)
    if not loop.stable(1.0):
        return replace(found, stable=False)
    return replace(
        found,
        stable=True,
        gain_margin=loop.border(lambda s: LARGEST_GAIN**s, lambda s: LARGEST_GAIN**s),
        phase_margin=loop.border(lambda s: np.exp(-1j * math.pi * s), lambda s: math.pi * s),
        bandwidth=loop.bandwidth(),
    )


def _resonances(
    scene: Scene, drive: Drive, time: Array, position: Array
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The angular frequencies (rad/s) of the axis with the motor's torque given, and with its rotor held."""
    zero = Expression("0", Term("number", value=0.0))

    def open_loop(each: Drive) -> Drive:
        return replace(each, model="torque", circuit={}, servo=None, command=zero)

    mechanical = replace(scene, control=tuple(open_loop(p) if p in scene.drives else p for p in scene.control))
    equations, nv = DriveEquations(mechanical, time, position), scene.robot.nv
    moving, own, first = list[int](), list[int](), 2 * nv
    elastic = {each.joint.v for each in mechanical.drives if each.is_elastic}
    for each in mechanical.drives:
        if each.is_elastic:
            own = [first, first + 1] if each.name == drive.name else own
            first += 2
    for column in range(nv):
        if column in elastic or column == drive.joint.v:
            moving += [column, nv + column]
    if not drive.is_elastic:
        moving, own = (
            [k for k in moving if k not in (drive.joint.v, nv + drive.joint.v)],
            [drive.joint.v, nv + drive.joint.v],
        )

    field = equations.columns(equations.field[equations.varying])

    def frequencies(rows: list[int]) -> tuple[float, ...]:
        kept = [equations.varying.index(row) for row in rows if row in equations.varying]
        values = np.linalg.eigvals(field[np.ix_(kept, kept)]) if kept else np.zeros(0)
        least = 1e-6 * np.abs(values).max(initial=0.0)
        return tuple(sorted(float(abs(value)) for value in values if value.imag > least))

    return frequencies(moving + own), frequencies(moving)


class DriveLoop:
    """The closed loop of all drives with a factor κ at one of them."""

    def __init__(self, equations: DriveEquations, drive: str) -> None:
        self.equations, scene = equations, equations.scene
        self.number = [each.name for each in scene.drives].index(drive)
        self.drive = scene.drives[self.number]
        ones, without = np.ones(len(scene.drives)), np.ones(len(scene.drives))
        without[self.number] = 0.0
        self._one, self._zero = self.equations.slopes(ones), self.equations.slopes(without)
        self.period, self._schedule = self._instants()
        self._spans: dict[float, tuple[Complex, Complex]] = {}

    def _instants(self) -> tuple[float, list[tuple[float, int]]]:
        """The longest sample time, and (time, update) within it in order."""
        every = [(each.period, each.first) for _, _, each in self.equations.instants]
        if not every:
            return 0.0, []
        longest = max(period for period, _ in every)
        if sum(longest / period for period, _ in every) > MOST_INSTANTS:
            raise InputError(
                f"{self.equations.scene.source}: drives take more than {MOST_INSTANTS} samples in {longest:g} s, the "
                "longest sample time; choose sample times that are nearer to each other"
            )
        found = []
        for k, (period, first) in enumerate(every):
            ratio = longest / period
            if abs(ratio - round(ratio)) > COMMON * ratio:
                raise InputError(
                    f"{self.equations.scene.source}: the sample times {longest:g} and {period:g} s of drives have no "
                    "whole ratio, so that margins cannot be computed; choose multiples of each other"
                )
            offset = math.fmod(first, period)
            found += [(offset + i * period if offset < period else i * period, k) for i in range(round(ratio))]
        return longest, sorted(found, key=lambda each: (round(each[0] / longest, 9), each[1]))

    def _at(self, factor: complex) -> _Slopes:
        one, zero = self._one, self._zero
        if factor.imag == 0.0:
            factor = factor.real  # real matrices take half the time

        def mixed(a: Array, b: Array) -> Array:
            return np.asarray(b + factor * (a - b))  # the equations are linear in κ

        updates = [(mixed(a, c), mixed(b, d)) for (a, b), (c, d) in zip(one.updates, zero.updates, strict=True)]
        return _Slopes(mixed(one.field, zero.field), mixed(one.by_held, zero.by_held), updates)

    def monodromy(self, factor: complex, driven: Array | None = None, kicks: list[Array] | None = None) -> Complex:
        """The matrix of a period over (x, h), and with `driven` and `kicks` a last column for a constant input."""
        slopes = self._at(factor)
        n, m = len(slopes.field), self.equations.held_size
        whole: Complex = np.eye(n + m + 1, dtype=slopes.field.dtype)
        now = 0.0
        for time, k in [*self._schedule, (self.period, -1)]:
            span = round((time - now) / self.period, 9) * self.period
            if span > 0.0:
                whole, now = self._over(span, factor, slopes, driven) @ whole, time
            if k >= 0:
                jump = np.eye(n + m + 1, dtype=slopes.field.dtype)
                jump[n : n + m, :n], jump[n : n + m, n : n + m] = slopes.updates[k]
                if kicks is not None:
                    jump[n : n + m, -1] = kicks[k]
                whole = jump @ whole
        return whole

    def _over(self, span: float, factor: complex, slopes: _Slopes, driven: Array | None) -> Complex:
        """The change of (x, h, 1) over a time (s) without an instant."""
        if driven is not None or not (self._one.field == self._zero.field).all():
            return self._exponential(span, slopes, driven)
        # κ acts through what is held only, in which the change is linear
        if span not in self._spans:
            ends = [self._exponential(span, each, None) for each in (self._one, self._zero)]
            self._spans[span] = ends[0] - ends[1], ends[1]
        change, without = self._spans[span]
        return np.asarray(without + factor * change)

    def _exponential(self, span: float, slopes: _Slopes, driven: Array | None) -> Complex:
        from scipy.linalg import expm

        n, m = len(slopes.field), self.equations.held_size
        rates = np.zeros((n + m + 1, n + m + 1), dtype=slopes.field.dtype)
        rates[:n, :n], rates[:n, n : n + m] = slopes.field, slopes.by_held
        if driven is not None:
            rates[:n, -1] = driven
        return np.asarray(expm(rates * span))

    def stable(self, factor: complex) -> bool:
        """Whether the closed loop is stable with this factor."""
        if not self._schedule:
            values = np.linalg.eigvals(self._at(factor).field)
            return bool(values.real.max(initial=-1.0) < GROWTH * np.abs(values).max(initial=0.0))
        whole = self.monodromy(factor)[:-1, :-1]
        if not np.isfinite(whole).all():  # it grows beyond numbers within a period
            return False
        return bool(np.abs(np.linalg.eigvals(whole)).max(initial=0.0) < 1.0 + GROWTH)

    def border(self, factor: Callable[[float], complex], value: Callable[[float], float]) -> float:
        """The value at the first border of stability for a share from 0 to 1; infinite where there is none."""
        before = 0.0
        for share in np.linspace(0.0, 1.0, GRID + 1)[1:].tolist():
            if not self.stable(factor(share)):
                good, bad = before, share
                for _ in range(BISECTIONS):
                    middle = 0.5 * (good + bad)
                    good, bad = (middle, bad) if self.stable(factor(middle)) else (good, middle)
                return value(good)
            before = share
        return math.inf

    def bandwidth(self) -> float | None:
        """The angular frequency (rad/s) at which the joint follows its reference with 1/√2; None: there is none."""
        by_reference, kicks = self.equations.by_reference(self.number)
        out = self.equations.of_joint(self.drive.joint)
        if not self._schedule:
            a = self._at(1.0).field
            top = 10.0 * float(np.abs(np.linalg.eigvals(a)).max(initial=1.0))
            values, vectors = np.linalg.eig(a)
            modal, shape = np.linalg.solve(vectors, by_reference), out @ vectors

            def response(w: float) -> float:
                return float(abs(np.sum(shape * modal / (1j * w - values))))
        else:
            whole = self.monodromy(1.0, by_reference, kicks)
            over_period, b = whole[:-1, :-1], whole[:-1, -1]
            top = math.pi / self.period

            def response(w: float) -> float:
                z = np.exp(1j * w * self.period)
                return float(abs(out @ np.linalg.solve(z * np.eye(len(b)) - over_period, b)[: len(out)]))

        grid = np.geomspace(LOWEST * top, top, FREQUENCIES)
        size = [response(w) for w in grid.tolist()]
        for k in range(1, len(grid)):
            if size[k - 1] >= BANDWIDTH > size[k]:
                low, high = float(grid[k - 1]), float(grid[k])
                for _ in range(50):
                    middle = math.sqrt(low * high)
                    low, high = (middle, high) if response(middle) >= BANDWIDTH else (low, middle)
                return low
        return None
