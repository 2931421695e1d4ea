"""What sizing finds for one joint: peaks with their time and posture, cycles, the motor's shaft, and signed margins.

A margin is the share of a limit that is left: 0.25 means that a quarter of the limit is left, a negative margin that
the limit is exceeded, None that no limit is given. Torques are N m on revolute joints and N on prismatic ones, speeds
rad/s or m/s, powers W, energies J.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from bellcrank.actuators.actuator import Actuator
from bellcrank.sizing.drive_verdicts import DriveJudging, DriveVerdict, kept

# ---- What sizing finds at the motor shaft of one joint: peaks with their time and posture, and signed margins.


@dataclass(frozen=True)
class Peak:
    """The largest value of a quantity, with the place where it occurs.

    Attributes:
        value: The value, in the quantity's SI unit.
        time: Time in the motion, s.
        motion: Name of the motion.
        position: The robot's position q (nq,) at that time.
    """

    value: float
    time: float
    motion: str
    position: tuple[float, ...]


def largest_peak(peaks: Iterable[Peak | None]) -> Peak | None:
    """The largest of the peaks that are known; None where none is."""
    return max((peak for peak in peaks if peak is not None), key=lambda peak: peak.value, default=None)


@dataclass(frozen=True, kw_only=True)
class ShaftSizing:
    """What the motor of one joint must deliver at its shaft, compared with the limits of its actuator.

    Attributes:
        actuator: The actuator that was compared.
        peak_torque: Largest |shaft torque|, N m, without the safety factor; None where the actuator's efficiency or
            inertia is unknown.
        rms_torque: RMS shaft torque of the motion in which it is largest, N m, without the safety factor; None where
            unknown.
        peak_speed: Largest |shaft speed|, rad/s.
        curve_use: Largest share of the torque-speed curve used, with the safety factor; more than 1 is outside. Of a
            curve that is partly unknown, of the part that is known; None where nothing is.
        inertia_ratio: Largest joint inertia over the rotor's reflected inertia; None where the rotor has no inertia, or
            an unknown one.
        axis: Name of the joint, or of the motor of a coupled transmission.
        judging: The drives of all axes, judged when their verdicts are asked for.

    Example:
        >>> import bellcrank as bc
        >>> shaft = bc.size("geared_pendulum").joint("shoulder").shaft
        >>> shaft.verdict
        'inside (continuous torque +40.8%)'
    """

    actuator: Actuator
    peak_torque: Peak | None
    rms_torque: float | None
    peak_speed: Peak
    curve_use: Peak | None
    inertia_ratio: float | None
    axis: str
    judging: DriveJudging = field(repr=False)

    @property
    def judged(self) -> DriveVerdict:
        """What every criterion says of the motor and gear, along the cycles of its axis."""
        return self.judging.verdicts.of(self.axis)

    @property
    def margins(self) -> dict[str, float | None]:
        """The share of its limit that is left, of each criterion that is judged: 1 - use; negative where exceeded, None
        where a figure that it needs is unknown.
        """
        return self.judged.margins

    @property
    def unknown(self) -> dict[str, str]:
        """What is missing for each margin that is None."""
        return {one.name: one.text for one in self.judged.unknown}

    @property
    def known_margins(self) -> dict[str, float]:
        """The margins that are known."""
        return {name: margin for name, margin in self.margins.items() if margin is not None}

    @property
    def tightest(self) -> str | None:
        """Name of the smallest known margin; None where none is known."""
        known = self.known_margins
        return min(known, key=lambda name: known[name], default=None)

    @property
    def tightest_margin(self) -> float | None:
        """The smallest known margin, a share of its limit; negative where the limit is exceeded."""
        return min(self.known_margins.values(), default=None)

    @property
    def inside(self) -> bool:
        """Whether no limit of the actuator is exceeded, as far as its limits are known (`unknown`)."""
        return not self.judged.exceeded

    @property
    def state(self) -> str:
        """ "inside", "exceeded", "inside as far as known" where a criterion is unknown, or "not verified" where without
        it the motor may be far too weak or too slow.
        """
        if not self.inside:
            return "exceeded"
        return "not verified" if self.judged.main_unknown else "inside as far as known" if self.unknown else "inside"

    @property
    def verdict(self) -> str:
        """The state, with the smallest margin and the names of the unknown ones."""
        notes = [] if self.tightest is None else [f"{self.tightest} {self.tightest_margin:+.1%}"]
        notes += [f"{len(self.unknown)} unknown"] if self.unknown else []
        return f"{self.state} ({'; '.join(notes)})"

    def exceeded_limits(self, what: str) -> tuple[str, ...]:
        """A sentence for each limit of the actuator of a joint or motor, such as "joint 'elbow'", that is not kept."""
        return tuple(
            f"{what}: {one.name} is exceeded by {(one.use or 0.0) - 1.0:.1%}: {one.text}"
            for one in self.judged.exceeded
        )

    def unknown_limits(self, what: str) -> tuple[str, ...]:
        """A sentence for each limit of the actuator of a joint or motor that could not be compared."""
        return tuple(f"{what}: {name} is unknown: {text}" for name, text in self.unknown.items())


@dataclass(frozen=True, kw_only=True)
class MotorSizing:
    """What a motor of a coupled transmission must deliver at its axis and shaft, over all motions.

    Attributes:
        name: Name of the motor.
        joints: Names of the joints that it moves.
        peak_torque: Largest torque by magnitude at the motor's axis, signed, N m, without the actuator's own inertia.
        peak_speed: Largest |speed| of the axis, rad/s.
        rms_torque: RMS torque at the axis of the motion in which it is largest, N m.
        shaft: The motor's shaft.
    """

    name: str
    joints: tuple[str, ...]
    peak_torque: Peak
    peak_speed: Peak
    rms_torque: float
    shaft: ShaftSizing

    @property
    def unknown(self) -> tuple[str, ...]:
        """A sentence for each limit of the actuator that could not be compared."""
        return self.shaft.unknown_limits(f"motor '{self.name}'")

    @property
    def exceeded(self) -> tuple[str, ...]:
        """A sentence for each limit of the actuator that is not kept."""
        return self.shaft.exceeded_limits(f"motor '{self.name}'")


OVERSHOOT = 4.0  # times the rounding of positions in a file: interpolation may overshoot the rows by this much


@dataclass(frozen=True, kw_only=True)
class Cycle:
    """One motion of one joint, taken as a cycle that repeats.

    Attributes:
        motion: Name of the motion.
        duration: Its duration, s.
        rms_torque: RMS torque at the joint, N m or N.
        mean_speed: Mean |speed| of the joint, rad/s or m/s.
        motoring_energy: Energy into the joint in one cycle, J.
        regenerated_energy: Energy out of the joint in one cycle, J.
        rms_shaft_torque: RMS torque at the motor shaft, N m, without the safety factor; None without an actuator, and
            where it is unknown.
    """

    motion: str
    duration: float
    rms_torque: float
    mean_speed: float
    motoring_energy: float
    regenerated_energy: float
    rms_shaft_torque: float | None


@dataclass(frozen=True, kw_only=True)
class JointSizing:
    """What the motor of one joint must deliver, over all motions.

    Torques do not include the inertia of an actuator's rotor, which counts at the shaft.

    Attributes:
        name: Name of the joint.
        kind: "revolute" or "prismatic".
        peaks: Each of these as a Peak; each is also an attribute that holds its value: max_torque and min_torque
            (signed), peak_torque (of the two, the one of larger magnitude), sampled_torque (largest magnitude at the
            rows of the motions), peak_speed, peak_motoring_power and peak_regenerating_power (both positive),
            largest_inertia (M_ii, kg m² or kg), peak_bearing_force (N) and peak_tilting_moment (N m).
        cycles: Each motion as a cycle that repeats.
        friction_share: Share of the peak torque that overcomes friction.
        holding_torque: Largest torque that holds the joint at rest, N m or N.
        holding_position: The robot's position q (nq,) at which it is needed.
        effort_limit: The URDF's effort limit, N m or N; None where none is given.
        velocity_limit: The URDF's velocity limit, rad/s or m/s; None where none is given.
        position_range: Lowest and highest position of the motions, rad or m.
        position_limits: The URDF's lower and upper position limit, rad or m; None where none is given.
        shaft: The motor's shaft; None without an actuator.
        position_noise: Uncertainty of positions that were read from a file with few digits, rad or m.

    Example:
        >>> import bellcrank as bc
        >>> joint = bc.size("geared_pendulum").joint("shoulder")
        >>> round(joint.peak_torque, 3), joint.torque_unit
        (9.81, 'N m')
    """

    name: str
    kind: str
    peaks: Mapping[str, Peak]
    cycles: tuple[Cycle, ...]
    friction_share: float
    holding_torque: float
    holding_position: tuple[float, ...]
    effort_limit: float | None
    velocity_limit: float | None
    position_range: tuple[float, float]
    position_limits: tuple[float | None, float | None]
    shaft: ShaftSizing | None = None
    position_noise: float = 0.0

    @property
    def torque_unit(self) -> str:
        """ "N m" or, on a prismatic joint, "N"."""
        return "N" if self.kind == "prismatic" else "N m"

    @property
    def speed_unit(self) -> str:
        """ "rad/s" or, on a prismatic joint, "m/s"."""
        return "m/s" if self.kind == "prismatic" else "rad/s"

    @property
    def position_unit(self) -> str:
        """ "rad" or, on a prismatic joint, "m"."""
        return "m" if self.kind == "prismatic" else "rad"

    @property
    def peak_torque(self) -> float:
        """Largest magnitude of the torque."""
        return abs(self.peaks["peak_torque"].value)

    @property
    def sampled_torque(self) -> float:
        """Largest magnitude of the torque at the rows of the motions; the peak torque may lie between two rows."""
        return self.peaks["sampled_torque"].value

    @property
    def max_torque(self) -> float:
        """Largest signed torque."""
        return self.peaks["max_torque"].value

    @property
    def min_torque(self) -> float:
        """Smallest signed torque."""
        return self.peaks["min_torque"].value

    @property
    def peak_speed(self) -> float:
        """Largest |speed|."""
        return self.peaks["peak_speed"].value

    @property
    def peak_motoring_power(self) -> float:
        """Largest power into the joint, W; 0 where it takes none."""
        return self.peaks["peak_motoring_power"].value

    @property
    def peak_regenerating_power(self) -> float:
        """Largest power out of the joint, W; 0 where it gives none."""
        return self.peaks["peak_regenerating_power"].value

    @property
    def peak_power(self) -> float:
        """The larger of motoring and regenerating power, W."""
        return max(self.peak_motoring_power, self.peak_regenerating_power)

    @property
    def largest_inertia(self) -> float:
        """Largest M_ii along the motions, kg m² (kg on a prismatic joint), without an actuator's rotor."""
        return self.peaks["largest_inertia"].value

    @property
    def peak_bearing_force(self) -> float:
        """Largest reaction force, N; on a prismatic joint its component perpendicular to the axis."""
        return self.peaks["peak_bearing_force"].value

    @property
    def peak_tilting_moment(self) -> float:
        """Largest reaction moment perpendicular to the axis, N m; on a prismatic joint the whole moment."""
        return self.peaks["peak_tilting_moment"].value

    @property
    def rms_torque(self) -> float:
        """RMS torque of the motion in which it is largest."""
        return max(cycle.rms_torque for cycle in self.cycles)

    @property
    def mean_speed(self) -> float:
        """Mean |speed| of the motion in which it is largest."""
        return max(cycle.mean_speed for cycle in self.cycles)

    @property
    def motoring_energy(self) -> float:
        """Energy into the joint in one cycle, J, of the motion in which it is largest."""
        return max(cycle.motoring_energy for cycle in self.cycles)

    @property
    def regenerated_energy(self) -> float:
        """Energy out of the joint in one cycle, J, of the motion in which it is largest."""
        return max(cycle.regenerated_energy for cycle in self.cycles)

    @property
    def effort_margin(self) -> float | None:
        """1 − peak torque / the URDF's effort limit; None where no limit is given."""
        return _margin(self.peak_torque, self.effort_limit)

    @property
    def velocity_margin(self) -> float | None:
        """1 − peak speed / the URDF's velocity limit; None where no limit is given."""
        return _margin(self.peak_speed, self.velocity_limit)

    @property
    def position_margin(self) -> float | None:
        """Smallest distance to the URDF's position limits, rad or m, negative outside; None where none is given."""
        lower, upper = self.position_limits
        distances = [] if lower is None else [self.position_range[0] - lower]
        distances += [] if upper is None else [upper - self.position_range[1]]
        return min(distances, default=None)

    @property
    def unknown(self) -> tuple[str, ...]:
        """A sentence for each limit of the actuator that could not be compared."""
        return () if self.shaft is None else self.shaft.unknown_limits(f"joint '{self.name}'")

    @property
    def beyond_range(self) -> str:
        """A sentence where the joint leaves its position range; else empty."""
        if self.position_margin is None or self.position_margin >= -(1e-9 + OVERSHOOT * self.position_noise):
            return ""
        return f"joint '{self.name}' leaves its position range by {-self.position_margin:.4g} {self.position_unit}"

    @property
    def exceeded(self) -> tuple[str, ...]:
        """A sentence for each limit that is not kept."""
        found = []
        if not kept(self.effort_margin):
            found.append(
                f"joint '{self.name}' needs {self.peak_torque:.4g} {self.torque_unit}, "
                f"the URDF's effort limit is {self.effort_limit:.4g} {self.torque_unit}"
            )
        if not kept(self.velocity_margin):
            found.append(
                f"joint '{self.name}' reaches {self.peak_speed:.4g} {self.speed_unit}, "
                f"the URDF's velocity limit is {self.velocity_limit:.4g} {self.speed_unit}"
            )
        if self.beyond_range:
            found.append(self.beyond_range)
        if self.shaft is not None:
            found += self.shaft.exceeded_limits(f"joint '{self.name}'")
        return tuple(found)


def _margin(used: float, limit: float | None) -> float | None:
    if limit is None:
        return None
    if limit == 0.0:
        return 0.0 if used == 0.0 else -math.inf
    return 1.0 - used / limit
