"""Derivatives of the results of a sizing by parameters of its scene.

A peak is a maximum over the time, so that its derivative is that of the load at its own time and posture. Those of RMS
torques and energies are integrals over the same grid as the results. Source: of peaks, J. M. Danskin, The Theory of
Max-Min (1967): the derivative of a maximum where it is attained at one point.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.dynamics.inverse.mechanism import Mechanism
from bellcrank.dynamics.inverse.motor_torques import Loads, MotorTorqueDerivatives
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.notes import Note
from bellcrank.present.results import Result
from bellcrank.present.tables import aligned
from bellcrank.sizing.loads.joint_loads import JointLoads
from bellcrank.sizing.loads.motion_grid import root_mean_square
from bellcrank.sizing.loads.motion_peaks import loads_grid

if TYPE_CHECKING:
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import RobotJoint
    from bellcrank.scene.scene import Scene
    from bellcrank.sizing.joint_sizing import Peak
    from bellcrank.sizing.result import Sizing

SAME_TIME = 1e-9  # s per s: rows this near a peak are candidates for its side of a jump
LEAST_SHARE = 0.5  # of the peak: smaller maxima are far from being one
PEAKS = ("max_torque", "min_torque", "peak_torque", "peak_speed", "peak_motoring_power", "peak_regenerating_power")


@dataclass(frozen=True, kw_only=True)
class JointSensitivity:
    """How the results of one joint of a sizing change with a parameter; each per unit of the parameter.

    Attributes:
        name: Name of the joint.
        max_torque: Of the largest signed torque, N m or N.
        min_torque: Of the smallest signed torque.
        peak_torque: Of the largest magnitude of the torque.
        peak_speed: Of the largest |speed|, rad/s or m/s; 0 but in closed linkages.
        peak_motoring_power: Of the largest power into the joint, W.
        peak_regenerating_power: Of the largest power out of the joint, W.
        rms_torque: Of the RMS torque of the motion in which it is largest.
        motoring_energy: Of the energy into the joint in one cycle, J, of the motion in which it is largest.
        regenerated_energy: Of the energy out of the joint in one cycle, J, of the motion in which it is largest.

    Example:
        >>> import bellcrank as bc
        >>> [by_length] = bc.size("four_bar").sensitivities(["crank_length"])
        >>> round(by_length.joint("crank").peak_torque)
        30
    """

    name: str
    max_torque: float
    min_torque: float
    peak_torque: float
    peak_speed: float
    peak_motoring_power: float
    peak_regenerating_power: float
    rms_torque: float
    motoring_energy: float
    regenerated_energy: float


@dataclass(frozen=True)
class SizingSensitivity(Result):
    """The derivatives of a sizing by one parameter.

    `to_csv` writes one row a joint.

    Attributes:
        name: The parameter.
        unit: Its unit.
        joints: The derivatives of each joint's results.
        notes: Those of the sizing.
    """

    name: str
    unit: str
    joints: tuple[JointSensitivity, ...]
    notes: tuple[Note, ...] = ()

    def joint(self, name: str) -> JointSensitivity:
        """Get the derivatives of one joint's results.

        Args:
            name: The name of a joint with a motor.

        Returns:
            The derivatives, per unit of the parameter.

        Raises:
            InputError: No motor has this name.

        Example:
            >>> import bellcrank as bc
            >>> [found] = bc.size("four_bar").sensitivities(["crank_length"])
            >>> found.joint("crank").name
            'crank'
        """
        arguments.text("name", name, "the name of a joint with a motor")
        joints = {joint.name: joint for joint in self.joints}
        if name not in joints:
            raise InputError(f"sensitivity by {self.name}: {unknown_name('joint', name, joints)}")
        return joints[name]

    def table(self) -> str:
        """The derivatives of each joint as text.

        Returns:
            A line a joint.

        Example:
            >>> import bellcrank as bc
            >>> [found] = bc.size("four_bar").sensitivities(["crank_length"])
            >>> print(found.table().splitlines()[0])
            derivatives by crank_length [m]
        """
        header, *rows = self._rows()
        cells = [
            list(map(str, header)),
            *([f"{it:.6g}" if isinstance(it, float) else str(it) for it in row] for row in rows),
        ]
        return "\n".join(
            [
                f"derivatives by {self.name} [{self.unit or '1'}]",
                *aligned(cells, (0,)),
                *(f"{note.label}: {note}" for note in self.notes),
            ]
        )

    def as_dict(self) -> dict[str, Any]:
        """The derivatives as data for JSON.

        Returns:
            The parameter, its unit, and the derivatives of each joint by name.

        Example:
            >>> import bellcrank as bc
            >>> [found] = bc.size("four_bar").sensitivities(["crank_length"])
            >>> found.as_dict()["name"]
            'crank_length'
        """
        return asdict(self) | {"notes": [note.as_dict() for note in self.notes]}

    def _rows(self) -> list[Sequence[object]]:
        names = [each.name for each in fields(JointSensitivity)]
        header = ["joint", *(name.replace("_", " ") for name in names[1:])]
        return [header, *([getattr(joint, name) for name in names] for joint in self.joints)]


class TorqueMaximum(NamedTuple):
    """A maximum of a joint's |torque| over time: the largest of them is its peak.

    Attributes:
        motion: The name of the motion.
        time: s.
        torque: The signed torque, N m or N.
        slope: Its derivatives (parameters,) per unit of each parameter.
    """

    motion: str
    time: float
    torque: float
    slope: Array


def sizing_sensitivities(sizing: Sizing, names: Sequence[str]) -> tuple[SizingSensitivity, ...]:
    """The derivatives of a sizing by parameters of its scene (`Sizing.sensitivities`)."""
    scene, along = _scene(sizing), _along(sizing, names)
    found = []
    for j, name in enumerate(names):
        joints = tuple(_joint(sizing, k, j, along) for k in range(len(sizing.joints)))
        found.append(SizingSensitivity(name, scene.parameters[name].unit, joints, sizing.notes))
    return tuple(found)


def torque_maxima(sizing: Sizing, names: Sequence[str]) -> dict[str, list[TorqueMaximum]]:
    """The maxima of each joint's |torque| of at least half its peak, with derivatives by parameters of the scene.

    Raises InputError as `Sizing.sensitivities`.
    """
    along = _along(sizing, names)
    return {joint.name: [it for one in along for it in one.maxima(k)] for k, joint in enumerate(sizing.joints)}


def _along(sizing: Sizing, names: Sequence[str]) -> list[_MotionLoads]:
    """The loads along each motion with their derivatives. Raises InputError where they are not known."""
    scene, inputs = _scene(sizing), sizing.inputs
    assert inputs is not None
    places = []
    for name in names:
        if name not in scene.parameters:
            raise InputError(f"{scene.source}: sensitivities: {unknown_name('parameter', name, scene.parameters)}")
        places.append(list(scene.parameters).index(name))
    mechanism = inputs.mechanism
    derivatives = MotorTorqueDerivatives(
        scene, mechanism.motors, independent_joints(mechanism, sizing.motions[0]), tuple(places)
    )
    if not derivatives.solvable:
        raise InputError(
            f"{scene.source}: sensitivities: the constraints of the linkage have redundant rows, or more than can be "
            "solved as one expression; use differences of sizings"
        )
    return [_MotionLoads(sizing, motion, derivatives) for motion in inputs.motions]


def _scene(sizing: Sizing) -> Scene:
    """The scene of a sizing with its robot. Raises InputError where its derivatives are not known."""
    from dataclasses import replace

    inputs = sizing.inputs
    scene = None if inputs is None else inputs.mechanism.scene
    if inputs is None or scene is None or not scene.parameters:
        raise InputError(
            f"{sizing.robot}: sensitivities are taken by parameters of a scene; this sizing has none; write them under "
            "'parameters' in the robot configuration"
        )
    if sizing.mass_tolerance:
        raise InputError(f"{sizing.robot}: sensitivities are those of the nominal masses; size with mass_tolerance=0")
    return replace(scene, robot=inputs.mechanism.robot)


def independent_joints(mechanism: Mechanism, motion: str) -> tuple[RobotJoint, ...]:
    """Of a closed linkage the joints that determine the others, motors first; a motion is named in errors."""
    if not isinstance(mechanism, Linkage):
        return ()
    candidates = [joint for joint in mechanism.robot.joints if joint.nv == 1]
    candidates.sort(key=lambda joint: joint not in mechanism.motors)
    return mechanism.kinematics.independent(candidates, motion)


class _MotionLoads:
    """The loads along one motion and their derivatives, on the grid of its sizing."""

    def __init__(self, sizing: Sizing, motion: Motion, derivatives: MotorTorqueDerivatives) -> None:
        assert sizing.inputs is not None
        mechanism = sizing.inputs.mechanism
        self.motion, self._derivatives = motion, derivatives
        loads = JointLoads(mechanism, sizing.inputs.actuators, 0.0)
        self._rotor, self._columns = loads.rotor_inertia, loads.columns
        self.grid = g = loads_grid(loads, motion)
        self.loads, self.speed = self._at(g.force_time, g.position, g.velocity, g.acceleration)

    def _at(self, t: Array, q: Array, v: Array, a: Array) -> tuple[Loads, Array]:
        """Torques at the gears' outputs, with derivatives, and speeds."""
        found = self._derivatives.loads(t, q, v, a)
        torque = found.torque - self._rotor * a[:, self._columns]
        slope = found.torque_slope - self._rotor * found.acceleration_slope
        return found._replace(torque=torque, torque_slope=slope), v[:, self._columns]

    def at_peak(self, peak: Peak, name: str, k: int, j: int) -> float:
        """The derivative of the load that is largest at a peak, for motor k and parameter j."""
        grid = self.grid
        near = np.flatnonzero(np.abs(grid.time - peak.time) <= SAME_TIME * max(1.0, abs(peak.time)))
        time = np.array([peak.time])
        q, v, a = self.motion.at(time)
        own = self._at(np.minimum(time, grid.force_time[-1]), q, v, a)
        sides = [(own, 0), *(((self.loads, self.speed), int(row)) for row in near)]
        values = [_value(name, x.torque[row, k], speed[row, k]) for (x, speed), row in sides]
        (loads, speed), row = sides[int(np.argmin(np.abs(np.array(values) - peak.value)))]
        torque, rate = float(loads.torque[row, k]), float(speed[row, k])
        change, faster = float(loads.torque_slope[row, j, k]), float(loads.speed_slope[row, j, k])
        if name == "peak_speed":
            return float(np.sign(rate)) * faster
        if name in ("peak_motoring_power", "peak_regenerating_power"):
            if peak.value <= 0.0:
                return 0.0
            return (1.0 if name == "peak_motoring_power" else -1.0) * (change * rate + torque * faster)
        return change * (float(np.sign(peak.value)) if name == "peak_torque" else 1.0)

    def maxima(self, k: int) -> list[TorqueMaximum]:
        """The maxima of |torque| of motor k of at least `LEAST_SHARE` of the largest, between rows by a parabola."""
        size = np.abs(self.loads.torque[:, k])
        order = np.lexsort((-size, self.grid.time))  # of rows at one time the larger first
        rows = order[np.diff(self.grid.time[order], prepend=-np.inf) > 0.0]
        time, size = self.grid.time[rows], size[rows]
        beside = np.concatenate([[-np.inf], size, [-np.inf]])
        tops = np.flatnonzero((size > beside[:-2]) & (size >= beside[2:]) & (size >= LEAST_SHARE * size.max()))
        found = []
        for top in tops.tolist():
            loads, at, when = self.loads, int(rows[top]), float(time[top])
            if 0 < top < len(time) - 1:
                times, heights, width = time[top - 1 : top + 2], size[top - 1 : top + 2], time[top + 1] - time[top - 1]
                for spacing in (0.05 * width, 1e-3 * width):  # the error of a parabola falls with its width's square
                    curve = np.polyfit(times - when, heights, 2)
                    best = when - 0.5 * curve[1] / curve[0] if curve[0] < 0.0 else np.nan
                    if not time[top - 1] + spacing < best < time[top + 1] - spacing:
                        break
                    times = best + spacing * np.arange(-1.0, 2.0)
                    near, _ = self._at(times, *self.grid.at(self.motion, times))
                    heights = np.abs(near.torque[:, k])
                    if heights[1] < size[top]:
                        break
                    loads, at, when = near, 1, float(best)
            torque, slope = float(loads.torque[at, k]), loads.torque_slope[at, :, k]
            found.append(TorqueMaximum(self.motion.name, when, torque, slope))
        return found

    def rms(self, k: int, j: int) -> float:
        """The derivative of the RMS torque."""
        w, torque = self.grid.weight, self.loads.torque[:, k]
        rms = float(root_mean_square(w, torque[None], self.motion.duration)[0])
        if rms == 0.0:
            return 0.0
        return float(w @ (torque * self.loads.torque_slope[:, j, k])) / (self.motion.duration * rms)

    def energy(self, k: int, j: int, sign: float) -> float:
        """The derivative of the energy into (sign 1) or out of (−1) a joint."""
        torque, speed = self.loads.torque[:, k], self.speed[:, k]
        change = self.loads.torque_slope[:, j, k] * speed + torque * self.loads.speed_slope[:, j, k]
        return float(self.grid.weight @ np.where(sign * torque * speed > 0.0, sign * change, 0.0))


def _value(name: str, torque: float, speed: float) -> float:
    """The load whose largest value is a peak of this name, as the peak has it."""
    powers = {"peak_motoring_power": torque * speed, "peak_regenerating_power": -torque * speed}
    return powers.get(name, abs(speed) if name == "peak_speed" else torque)


def _joint(sizing: Sizing, k: int, j: int, along: Sequence[_MotionLoads]) -> JointSensitivity:
    joint = sizing.joints[k]
    of = {one.motion.name: one for one in along}
    largest = {
        what: of[max(joint.cycles, key=lambda cycle: float(getattr(cycle, what))).motion]
        for what in ("rms_torque", "motoring_energy", "regenerated_energy")
    }
    peaks = {name: of[joint.peaks[name].motion].at_peak(joint.peaks[name], name, k, j) for name in PEAKS}
    return JointSensitivity(
        name=joint.name,
        **peaks,
        rms_torque=largest["rms_torque"].rms(k, j),
        motoring_energy=largest["motoring_energy"].energy(k, j, 1.0),
        regenerated_energy=largest["regenerated_energy"].energy(k, j, -1.0),
    )
