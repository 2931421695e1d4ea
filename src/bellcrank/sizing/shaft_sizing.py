"""What sizing finds at the motor shaft of one joint: peaks with their time and posture, and signed margins."""

from __future__ import annotations

from dataclasses import dataclass

from bellcrank.actuators.actuator import Actuator
from bellcrank.sizing.drive_verdicts import DriveVerdict


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
        judged: What every criterion says of the motor and gear, along the cycles of its axis.

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
    judged: DriveVerdict

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
