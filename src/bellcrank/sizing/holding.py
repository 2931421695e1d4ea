"""The largest torque that holds each motor's joint at rest, which is what a brake must hold."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array, Indices
from bellcrank.dynamics.inverse.input_breakpoints import force_breaks
from bellcrank.dynamics.inverse.mechanism import OpenChain
from bellcrank.elements.dry_friction import DryFriction
from bellcrank.elements.expression import has_time
from bellcrank.elements.joint_forces import Damper, Friction, JointSpring
from bellcrank.elements.joint_stops import JointStop
from bellcrank.elements.supply import Supply
from bellcrank.sizing.holding_gravity import gravity_holding_torques
from bellcrank.sizing.holding_search import AscentSettings, CoordinateAscent, Holding, joint_ranges, moved, refined
from bellcrank.sizing.loads.motion_grid import grid_along
from bellcrank.sizing.loads.series_maxima import Maxima, maxima, on_grid

if TYPE_CHECKING:
    from bellcrank.dynamics.inverse.mechanism import Mechanism
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import RobotJoint


def holding_torques(mechanism: Mechanism, motions: Sequence[Motion], mass_tolerance: float) -> Holding:
    """The largest static torque (k,), N m or N, of each motor's joint, its position q (k, nq), and notes.

    Of an open chain over the ranges of all joints, with the forces of a scene over all times of their tables; of a
    closed linkage, whose joints have no independent ranges, over the positions and times of the motions.
    """
    if mechanism.closed:
        found = motion_holding_torques(mechanism, motions, mass_tolerance)
        note = "holding torques are the largest at the postures of the motions: the constraints tie the joints together"
        return Holding(found.joints, found.torque, found.position, (note,))
    assert isinstance(mechanism, OpenChain)
    resisting = Damper | Friction | DryFriction | JointStop | Supply
    acting = [force for force in mechanism.equations.forces if not isinstance(force, resisting)]
    if not acting:
        statics = mechanism if mechanism.equations.sets_tree else None
        return gravity_holding_torques(mechanism.robot, mass_tolerance=mass_tolerance, statics=statics)
    over_ranges = scene_holding_torques(mechanism, mass_tolerance)
    over_motions = motion_holding_torques(mechanism, motions, mass_tolerance)
    larger = over_motions.torque > over_ranges.torque  # joints without limits may go further than a turn
    notes = list(over_ranges.notes)
    for joint in mechanism.motors:
        limited = np.isfinite([mechanism.robot.lower[joint.q], mechanism.robot.upper[joint.q]]).all()
        springs = [force.name for force in acting if isinstance(force, JointSpring) and force.joint == joint]
        if not limited and springs and joint.kind == "revolute":
            notes.append(
                f"joint '{joint.name}' turns without limits: the holding torque includes spring '{springs[0]}' over "
                "one turn, and over the motions"
            )
    return Holding(
        over_ranges.joints,
        np.where(larger, over_motions.torque, over_ranges.torque),
        np.where(larger[:, None], over_motions.position, over_ranges.position),
        tuple(notes),
    )


def motion_holding_torques(mechanism: Mechanism, motions: Sequence[Motion], mass_tolerance: float) -> Holding:
    """The largest torque that holds each motor's joint at rest at a position of the motions, at its time."""

    def at_rest(t: Array, q: Array, v: Array, a: Array) -> dict[str, Array]:
        zero = np.zeros_like(v)
        torque = np.abs(mechanism.torques(t, q, zero, zero)[0])
        if mass_tolerance:
            torque = torque + mass_tolerance * np.abs(mechanism.link_torques(t, q, zero, zero)).sum(axis=1)
        return {"holding": torque}

    def largest_along(motion: Motion) -> Maxima:
        grid = grid_along(motion, None, force_breaks(mechanism))
        return maxima(motion, grid, on_grid(motion, grid, at_rest), at_rest)["holding"]

    found = [largest_along(motion) for motion in motions]
    torque = np.array([largest.value for largest in found])
    worst = torque.argmax(axis=0)
    position = np.array([motions[m].at(float(found[m].time[k]))[0] for k, m in enumerate(worst)])
    return Holding(tuple(joint.name for joint in mechanism.motors), torque.max(axis=0), position, ())


# ---- The largest static torque of each motor of an open chain under gravity and the forces of a scene.
#
# At rest dampers and friction exert no force; springs, preloads, wrenches and torques do, so that a torque is not
# affine in the cosine and sine of each coordinate, as holding_gravity.py requires. The largest |τ| + tolerance ·
# Σ|share of a link| over the joint ranges is searched for from many random postures: the best of them are improved
# one coordinate after the other and then all together (L-BFGS-B: Byrd, Lu, Nocedal & Zhu, SIAM J. Sci. Comput. 16,
# 1995). Forces given by tables are linear in the tables' values, so all values of the tables are compared at every
# posture.


Value = Callable[[Array], Array]

SPREAD = 8192  # random postures to start from
KEPT = 10  # of them for each motor and sign
POINTS = 33  # along one coordinate
SWEEPS = 12  # at most, over all coordinates
POLISHED = 3  # starts of each motor and sign of which all coordinates are improved together
BETWEEN = 16  # points between two rows of a table
MOST_VALUES = 20_000  # numbers of tables compared at one time


def scene_holding_torques(chain: OpenChain, mass_tolerance: float) -> Holding:
    """The largest static torques over the ranges of the joints and the values of the tables."""
    robot, joints = chain.robot, chain.motors
    ranges = joint_ranges(robot, joints)
    lower, upper = ranges.lower, ranges.upper
    static = _StaticTorques(chain, mass_tolerance)
    torque, posture = np.zeros(len(joints)), np.tile(robot.neutral, (len(joints), 1))
    generator = np.random.default_rng(0)
    first = lower + (upper - lower) * generator.random((SPREAD, len(joints)))
    ends = np.where(generator.random((SPREAD // 8, len(joints))) < 0.5, lower, upper)
    first = np.concatenate([first, ends, np.clip(robot.neutral[[joint.q for joint in joints]], lower, upper)[None]])
    lowest, highest = static.torques(first)
    for k in range(len(joints)):
        for sign, values in ((1.0, highest[:, k]), (-1.0, -lowest[:, k])):

            def value(x: Array, k: int = k, sign: float = sign) -> Array:
                low, high = static.torques(x)
                return high[:, k] if sign > 0.0 else -low[:, k]

            best = first[np.argsort(-values)[:KEPT]]
            best, reached = _by_coordinates(value, best, lower, upper)
            order = np.argsort(-reached)[:POLISHED]
            for x in best[order]:
                x, most = _together(value, x, lower, upper)
                if most > torque[k]:
                    torque[k] = most
                    posture[k, [joint.q for joint in joints]] = x
    return Holding(tuple(joint.name for joint in joints), torque, posture, (*ranges.notes, *_timed(chain)))


def _timed(chain: OpenChain) -> tuple[str, ...]:
    """Formulas with t, which a static torque has no time for."""
    return tuple(
        f"{force.kind} '{force.name}' depends on t: the holding torque counts its value at t = 0"
        for force in chain.equations.forces
        if has_time(force)
    )


class _StaticTorques:
    """The lowest and highest static torques (n, k) at positions (n, k) of the motors' joints, over all values of the
    tables and within the mass tolerance.
    """

    def __init__(self, chain: OpenChain, tolerance: float) -> None:
        self.chain, self.tolerance = chain, tolerance
        self.joints: tuple[RobotJoint, ...] = chain.motors
        scene = chain.equations.scene
        assert scene is not None
        times = [np.zeros(1)]
        for signal in scene.signals:
            share = np.linspace(0.0, 1.0, BETWEEN + 1)[None, :-1]
            times += [(signal.breaks[:-1, None] + np.diff(signal.breaks)[:, None] * share).ravel(), signal.breaks]
        every = np.unique(np.concatenate(times))
        every = np.unique(np.concatenate([every, np.nextafter(every, -np.inf)]))
        self.times = every[np.sort(np.unique(scene.signals_at(every), axis=0, return_index=True)[1])]
        self.values = scene.signals_at(self.times)

    def torques(self, x: Array) -> tuple[Array, Array]:
        """Lowest and highest torque (n, k)."""
        equations, columns = self.chain.equations, [joint.v for joint in self.joints]
        q = np.tile(self.chain.robot.neutral, (len(x), 1))
        q[:, [joint.q for joint in self.joints]] = x
        zero = np.zeros((len(x), self.chain.robot.nv))
        now = np.full(len(x), self.times[0])
        base = equations.needed(now, q, zero, zero)[:, columns]
        low = high = base
        if len(self.times) > 1:
            slopes = self._slopes(q, zero)[:, :, columns]  # d force / d u (n, nu, k)
            change = self.values - self.values[0]
            low, high = base.copy(), base.copy()
            step = max(1, MOST_VALUES // max(1, len(x)))
            for begin in range(0, len(change), step):
                more = -np.einsum("tu,nuk->ntk", change[begin : begin + step], slopes)
                low = np.minimum(low, base + more.min(axis=1))
                high = np.maximum(high, base + more.max(axis=1))
        if self.tolerance:
            spread = self.tolerance * np.abs(self.chain.link_torques(now, q, zero, zero)).sum(axis=1)
            low, high = low - spread, high + spread
        return low, high

    def _slopes(self, q: Array, zero: Array) -> Array:
        """The derivative (n, nu, nv) of the scene's forces by the tables' values, in which they are linear."""
        return self.chain.equations.slopes(q, zero, self.values.shape[1])


def _by_coordinates(value: Value, x: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Positions (m, k) improved one coordinate after the other by a grid that is refined, and their values (m,)."""
    count = x.shape[1]
    ascent = CoordinateAscent(
        q=x.copy(),
        shares=value(x)[:, None],
        matters=np.tile(lower != upper, (len(x), 1)),
        places=list(range(count)),
        starts=len(x),
    )

    def improve(k: int, rows: Indices) -> tuple[Array, Array]:
        here = ascent.q[rows]

        def values(points: Array) -> Array:
            trial = np.repeat(here[:, None], points.shape[1], axis=1)
            trial[:, :, k] = points
            return value(trial.reshape(-1, count)).reshape(points.shape)

        best = refined(values, np.linspace(lower[k], upper[k], POINTS), len(rows), 5)
        return best, value(moved(here, k, best))[:, None]

    ascent.run(improve, AscentSettings(sweeps=SWEEPS, rough=SWEEPS, kept=len(x), settled=1e-12))
    return ascent.q, ascent.value


def _together(value: Value, x: Array, lower: Array, upper: Array) -> tuple[Array, float]:
    """A position (k,) of which all coordinates are improved at once, and its value."""
    from scipy.optimize import minimize

    count, most = len(x), float(value(x[None])[0])
    scale = max(abs(most), 1e-300)

    def slope(at: Array) -> tuple[float, Array]:
        step = 1e-6
        trial = np.concatenate([at[None], at + step * np.eye(count), at - step * np.eye(count)])
        found = -value(trial) / scale
        return float(found[0]), (found[1 : count + 1] - found[count + 1 :]) / (2.0 * step)

    bounds = list(zip(lower, upper, strict=True))
    found = minimize(slope, x, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 100})
    there = np.clip(found.x, lower, upper)
    reached = float(value(there[None])[0])
    return (there, reached) if reached > most else (x, most)
