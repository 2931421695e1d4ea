"""What sizing finds: peaks with their time and posture, a line per joint, and margins that are signed.

Margins are shares of the limit: 0.25 means a quarter of it is left, a negative one is exceeded, None that no
limit is given. Torques are N m on revolute joints and N on prismatic ones, speeds rad/s or m/s, powers W,
energies J.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank import arguments
from bellcrank.actuators.actuator import Drive
from bellcrank.derived import Portable, cached_property
from bellcrank.dynamics.element_forces import Element
from bellcrank.errors import InputError
from bellcrank.files import atomic_write
from bellcrank.messages import unknown_name

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bellcrank.dynamics.mechanism import Mechanism
    from bellcrank.motion.motion import Motion
    from bellcrank.sizing.histories import MotionHistory


CURVE = 4.0  # times what is unknown of positions at the rows of a file: the curve through them may leave them by this


@dataclass(frozen=True)
class Peak:
    """A largest value, the time (s) and motion in which it occurs, and the robot's position (nq,) there."""

    value: float
    time: float
    motion: str
    position: tuple[float, ...]


@dataclass(frozen=True)
class Cycle:
    """One motion as a cycle that repeats: RMS torque, mean |speed|, energies (J) put in and given back, RMS
    at the shaft."""

    motion: str
    duration: float
    rms_torque: float
    mean_speed: float
    motoring_energy: float
    regenerated_energy: float
    rms_shaft_torque: float | None


@dataclass(frozen=True)
class ShaftSizing:
    """One joint's drive at the motor shaft: torques N m, speeds rad/s, margins by name."""

    drive: Drive
    peak_torque: Peak
    rms_torque: float
    peak_speed: Peak
    curve_use: Peak
    inertia_ratio: float | None
    margins: Mapping[str, float]

    @property
    def tightest(self) -> str:
        """Name of the smallest margin."""
        return min(self.margins, key=lambda name: self.margins[name])

    @property
    def tightest_margin(self) -> float:
        """The smallest margin, a share of its limit; negative where the limit is exceeded."""
        return self.margins[self.tightest]

    @property
    def inside(self) -> bool:
        """Whether every limit of the drive is kept."""
        return self.tightest_margin >= 0.0

    @property
    def verdict(self) -> str:
        """ "inside" or "exceeded", with the tightest margin."""
        return f"{'inside' if self.inside else 'exceeded'} ({self.tightest} {self.tightest_margin:+.1%})"


@dataclass(frozen=True)
class JointSizing:
    """What one joint's motor must deliver, over all motions.

    `peaks` holds max_torque, min_torque (signed), peak_torque (the larger magnitude), sampled_torque (the same at the
    rows of the motions, without what lies between them), peak_speed,
    peak_motoring_power, peak_regenerating_power (both positive), largest_inertia (M_ii, without a drive's
    rotor, kg m² or kg), peak_bearing_force (N) and peak_tilting_moment (N m), each a Peak and each also an
    attribute. `position_noise` (rad or m) is unknown of positions that were read from a file with few digits.
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
    def peak_torque(self) -> float:
        """Largest magnitude of the torque."""
        return abs(self.peaks["peak_torque"].value)

    @property
    def sampled_torque(self) -> float:
        """Largest magnitude of the torque at the rows of the motions; more between them rests on interpolation."""
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
        """Largest power into the joint, W (0 where it never takes any)."""
        return self.peaks["peak_motoring_power"].value

    @property
    def peak_regenerating_power(self) -> float:
        """Largest power out of the joint, W (0 where it never gives any)."""
        return self.peaks["peak_regenerating_power"].value

    @property
    def peak_power(self) -> float:
        """The larger of motoring and regenerating power, W."""
        return max(self.peak_motoring_power, self.peak_regenerating_power)

    @property
    def largest_inertia(self) -> float:
        """Largest M_ii along the motions, kg m² (kg on a prismatic joint), without a drive's rotor."""
        return self.peaks["largest_inertia"].value

    @property
    def peak_bearing_force(self) -> float:
        """Largest reaction force, N; on a prismatic joint only what is across the axis."""
        return self.peaks["peak_bearing_force"].value

    @property
    def peak_tilting_moment(self) -> float:
        """Largest reaction moment across the axis, N m; on a prismatic joint the whole moment."""
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
        """1 − peak torque / URDF effort limit; None where no limit is given."""
        return _margin(self.peak_torque, self.effort_limit)

    @property
    def velocity_margin(self) -> float | None:
        """1 − peak speed / URDF velocity limit; None where no limit is given."""
        return _margin(self.peak_speed, self.velocity_limit)

    @property
    def position_margin(self) -> float | None:
        """Smallest distance to the URDF's position limits, rad or m, negative outside; None without."""
        lower, upper = self.position_limits
        distances = [] if lower is None else [self.position_range[0] - lower]
        distances += [] if upper is None else [upper - self.position_range[1]]
        return min(distances, default=None)

    @property
    def exceeded(self) -> tuple[str, ...]:
        """A sentence for each limit that is not kept."""
        found = []
        if self.effort_margin is not None and self.effort_margin < 0.0:
            found.append(
                f"joint '{self.name}' needs {self.peak_torque:.4g} {self.torque_unit}, "
                f"the URDF's effort limit is {self.effort_limit:.4g} {self.torque_unit}"
            )
        if self.velocity_margin is not None and self.velocity_margin < 0.0:
            found.append(
                f"joint '{self.name}' reaches {self.peak_speed:.4g} {self.speed_unit}, "
                f"the URDF's velocity limit is {self.velocity_limit:.4g} {self.speed_unit}"
            )
        if self.position_margin is not None and self.position_margin < -(1e-9 + CURVE * self.position_noise):
            unit = self.speed_unit[:-2]
            found.append(f"joint '{self.name}' leaves its position range by {-self.position_margin:.4g} {unit}")
        if self.shaft is not None:
            found += [
                f"joint '{self.name}': the drive's {name} limit is exceeded by {-margin:.1%}"
                for name, margin in self.shaft.margins.items()
                if margin < 0.0
            ]
        return tuple(found)


@dataclass(frozen=True)
class Sizing(Portable):
    """The sizing of a robot over its motions; `peak_supply_power` and `peak_regeneration` (W) sum all joints
    at one instant.

    `gravity` (m/s², in the world) and `payloads`, each (mass in kg, frame), are those sized with. `study` is what was
    sized, for pictures and replays: the mechanism, its motions (with rows where tables of forces have theirs), and
    drives by joint. `forces` are the elements of the scene that counted besides the motors, `parameters` its (name,
    value, unit). `unsizable` has a sentence for each motor that moves nothing with mass, `allowed_massless` the joints
    for which that was allowed, and `urdf_errors` the errors of the URDF that change torques.
    """

    robot: str
    motions: tuple[str, ...]
    mass_tolerance: float
    joints: tuple[JointSizing, ...]
    supply_peak: Peak
    regeneration_peak: Peak
    warnings: tuple[str, ...] = field(default=())
    gravity: tuple[float, ...] = (0.0, 0.0, -9.81)
    payloads: tuple[tuple[float, str], ...] = ()
    study: tuple[Mechanism, tuple[Motion, ...], Mapping[str, Drive]] | None = field(
        default=None, repr=False, compare=False
    )
    forces: tuple[Element, ...] = ()
    parameters: tuple[tuple[str, float, str], ...] = ()
    unsizable: tuple[str, ...] = ()
    urdf_errors: tuple[str, ...] = ()
    allowed_massless: tuple[str, ...] = ()

    def __repr__(self) -> str:
        told = f"{len(self.exceeded)} limits exceeded" if self.exceeded else "all inside"
        if self.unsizable:
            told = f"{len(self.unsizable)} joints cannot be sized, {told}" if self.exceeded else "cannot be sized"
        return f"Sizing('{self.robot}', {len(self.joints)} joints over {', '.join(self.motions)}: {told})"

    def __str__(self) -> str:
        from bellcrank.sizing.table import table, verdict

        return "\n".join([table(self), *(f"note: {text}" for text in self.warnings), "", verdict(self)])

    def _repr_html_(self) -> str:
        from bellcrank.sizing.notebook import sizing_html

        return sizing_html(self)

    def to_csv(self, path: str | Path) -> Path:
        """Write one line a joint, units in the header; the path. Raises InputError where it cannot be written."""
        from bellcrank.sizing.report import csv_text

        return _written(path, csv_text(self))

    def to_json(self, path: str | Path) -> Path:
        """Write the whole sizing, SI units, peaks with time and posture; the path. Raises InputError where it cannot be
        written.
        """
        from bellcrank.sizing.report import json_text

        return _written(path, json_text(self, ()))

    def plot(self, path: str | Path | None = None, what: str | None = None, motion: str | None = None) -> Figure:
        """Draw the sizing: a matplotlib Figure, written to `path` in the format of its suffix (PNG without one).

        `what` is "motors" (torque and speed at the shafts, the default where there are drives), "joints" (the same at
        the joints) or "time" (a motion over time, `motion` by name, by default the first). Raises InputError for
        anything else, and where the file cannot be written.
        """
        from bellcrank.sizing.plots import plot_sizing

        if path is not None:
            path = arguments.path("path", path, "the path of a picture")
        for name, text in (("what", what), ("motion", motion)):
            if text is not None:
                arguments.text(name, text)
        return plot_sizing(self, path, what, motion)

    @cached_property
    def histories(self) -> Mapping[str, MotionHistory]:
        """By motion what each sized joint does over its rows: position, velocity, acceleration, torque and power at the
        joint, and torque, speed and power at the motor's shaft; SI units, nominal masses. InputError where the sizing
        does not hold its motions.

        Example:
            >>> sizing.histories["pick"].joint("elbow").shaft.torque
        """
        from bellcrank.sizing.history import sizing_histories

        return sizing_histories(self)

    def joint(self, name: str) -> JointSizing:
        """The line of one joint; InputError for an unknown name."""
        arguments.text("name", name, "the name of a joint")
        for joint in self.joints:
            if joint.name == name:
                return joint
        raise InputError(
            f"sizing of {self.robot}: {unknown_name('joint', name, [joint.name for joint in self.joints])}"
        )

    @property
    def undriven(self) -> tuple[str, ...]:
        """Names of the joints without a drive: no motor was compared with what they need."""
        return tuple(joint.name for joint in self.joints if joint.shaft is None)

    @property
    def peak_supply_power(self) -> float:
        """Largest power that all joints take from the supply at one instant, W."""
        return self.supply_peak.value

    @property
    def peak_regeneration(self) -> float:
        """Largest power that all joints give back at one instant, W."""
        return self.regeneration_peak.value

    @property
    def exceeded(self) -> tuple[str, ...]:
        """A sentence for each limit of any joint that is not kept."""
        return tuple(text for joint in self.joints for text in joint.exceeded)

    @property
    def inside(self) -> bool:
        """Whether every joint can be sized and every limit that is given is kept."""
        return not self.exceeded and not self.unsizable


def _written(path: str | Path, text: str) -> Path:
    target = arguments.path("path", path, "the path of a file")
    atomic_write.write_text(target, text)
    return target


def _margin(used: float, limit: float | None) -> float | None:
    if limit is None:
        return None
    if limit == 0.0:
        return 0.0 if used == 0.0 else -math.inf
    return 1.0 - used / limit
