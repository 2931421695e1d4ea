"""The result of a sizing: `Sizing` holds what was found for each joint, and what it was found for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from bellcrank import arguments
from bellcrank.cached_values import Portable, cached_property
from bellcrank.dynamics.inverse.mechanism import AppliedForce
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.notes import WithNotes
from bellcrank.present.results import JsonLayout, Result
from bellcrank.sizing.drive_verdicts import DriveJudging
from bellcrank.sizing.joint_sizing import JointSizing, MotorSizing, Peak, ShaftSizing
from bellcrank.sizing.loads.joint_histories import SizingInputs
from bellcrank.sizing.loads.structure_loads import StructureLoad
from bellcrank.sizing.selection.criteria import CriterionResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bellcrank.scene.robot_config import RobotConfig
    from bellcrank.sizing.loads.joint_histories import MotionHistory
    from bellcrank.sizing.sensitivities import SizingSensitivity


@dataclass(frozen=True, kw_only=True)
class Sizing(Portable, WithNotes, Result):
    """The sizing of a robot over its motions, made by `bellcrank.size`.

    `print` shows its tables and the verdict; a notebook shows them as HTML tables. `to_csv` writes one line a joint.

    Attributes:
        robot: Name of the robot or robot configuration.
        motions: Names of the motions.
        mass_tolerance: Each link's mass and inertia is scaled by one factor within 1 ± this share.
        joints: The sizing of each joint with a motor.
        supply_peak: Largest power that all joints together take from the supply at one instant, W; None where a figure
            of an actuator that it needs is unknown.
        regeneration_peak: Largest power that all joints together give back at one instant, W; None where unknown.
        judging: The drives of all axes, judged when their verdicts are asked for.
        warnings: Sentences about what to look at.
        gravity: Gravity in the world frame, m/s².
        payloads: (mass in kg, frame) of each payload.
        inputs: The mechanism, motions and actuators that were sized; None where the sizing does not hold them.
        config: The robot configuration that was sized; None where there is none.
        forces: The elements of the scene whose forces are included.
        parameters: (name, value, unit) of the scene's parameters.
        unsizable: A sentence for each motor that moves no mass, and so cannot be sized.
        urdf_errors: Errors of the URDF that change torques.
        allowed_massless: Joints that move no mass, as `allow_massless` allowed.
        motors: The sizing of each motor of a coupled transmission that has an actuator.
        structure: The largest force and moment in each constraint and joint without a motor of a closed linkage, such
            as those at the ends of rods.
        undetermined: A sentence for each joint whose peaks the rows of a sampled motion do not determine: another
            sampling changes them by more than 2 %; and a `Note` on each force and loop of the robot's file that is not
            modelled. With either, the verdict is not known.

    Example:
        >>> import bellcrank as bc
        >>> sizing = bc.size("geared_pendulum")
        >>> sizing.inside, sizing.motions
        (True, ('lift_and_return',))
    """

    robot: str
    motions: tuple[str, ...]
    mass_tolerance: float
    joints: tuple[JointSizing, ...]
    supply_peak: Peak | None
    regeneration_peak: Peak | None
    judging: DriveJudging = field(repr=False)
    warnings: tuple[str, ...] = ()
    gravity: tuple[float, ...] = (0.0, 0.0, -9.81)
    payloads: tuple[tuple[float, str], ...] = ()
    inputs: SizingInputs | None = field(default=None, repr=False, compare=False)
    config: RobotConfig | None = field(default=None, repr=False, compare=False)
    forces: tuple[AppliedForce, ...] = ()
    parameters: tuple[tuple[str, float, str], ...] = ()
    unsizable: tuple[str, ...] = ()
    urdf_errors: tuple[str, ...] = ()
    allowed_massless: tuple[str, ...] = ()
    motors: tuple[MotorSizing, ...] = ()
    structure: tuple[StructureLoad, ...] = ()
    undetermined: tuple[str, ...] = ()
    json_layout: ClassVar = JsonLayout(1, ascii_only=True)

    @property
    def system(self) -> tuple[CriterionResult, ...]:
        """The criteria of all axes together, supply power and regenerated energy; none unless every motor is given by
        an actuator, and a limit of theirs or the motors' own figures are stated.
        """
        return self.judging.verdicts.system

    def __repr__(self) -> str:
        inside = "inside as far as known" if self.unknown else "all inside"
        verdict = f"{len(self.exceeded)} limits exceeded" if self.exceeded else inside
        if self.undetermined and not self.exceeded:
            verdict = "not known"
        if self.unsizable:
            verdict = f"{len(self.unsizable)} joints cannot be sized, {verdict}" if self.exceeded else "cannot be sized"
        return f"Sizing('{self.robot}', {len(self.joints)} joints over {', '.join(self.motions)}: {verdict})"

    def table(self) -> str:
        """The tables of joints and motors, notes, and the verdict.

        Returns:
            Lines of text.

        Example:
            >>> import bellcrank as bc
            >>> "Geared pendulum" in bc.size("geared_pendulum").table()
            True
        """
        from bellcrank.sizing.tables import table, verdict

        return "\n".join([table(self), *(f"note: {text}" for text in self.warnings), "", verdict(self)])

    def _repr_html_(self) -> str:
        from bellcrank.sizing.tables import sizing_html

        return sizing_html(self)

    def sensitivities(self, names: Sequence[str]) -> tuple[SizingSensitivity, ...]:
        """Compute derivatives of peaks, RMS torques and energies by parameters of the scene.

        A peak changes as the load at its own time does; where two times tie, the derivative is that of the one found.
        In a closed linkage the independent joints keep their motion, and the others follow the constraints.

        Args:
            names: Parameters of the scene, as under its key `parameters`.

        Returns:
            The derivatives by each parameter, in the order of `names`.

        Raises:
            InputError: There is no such parameter, the sizing has a mass tolerance, or the linkage is too large.

        Example:
            >>> import bellcrank as bc
            >>> [by_length] = bc.size("four_bar").sensitivities(["crank_length"])
            >>> print(f"{by_length.joint('crank').peak_torque:.3f} N m per m")
            30.072 N m per m
        """
        from bellcrank.sizing.sensitivities import sizing_sensitivities

        wanted = arguments.several("names", names, str, "names of parameters", alone=True)
        return sizing_sensitivities(self, wanted)

    def as_dict(self) -> dict[str, Any]:
        """The whole sizing as data for JSON, each peak with its time and position.

        Returns:
            Values in SI units; None where one is unknown.

        Example:
            >>> import bellcrank as bc
            >>> bc.size("geared_pendulum").as_dict()["joints"][0]["name"]
            'shoulder'
        """
        from bellcrank.sizing.sizing_files import sizing_data

        return sizing_data(self)

    def _rows(self) -> list[Sequence[object]]:
        from bellcrank.sizing.sizing_files import sizing_rows

        return sizing_rows(self)

    def plot(self, path: str | Path | None = None, what: str | None = None, motion: str | None = None) -> Figure:
        """Draw the sizing.

        Args:
            path: A file to write the figure to, in the format of its suffix (PNG without one).
            what: "motors" for torque and speed at the motor shafts (the default where there are actuators), "joints"
                for torque and speed at the joints, or "time" for a motion over time.
            motion: With "time", the name of the motion; by default the first.

        Returns:
            The matplotlib Figure.

        Raises:
            InputError: For an unknown picture, motion or format, and where the file cannot be written.

        Example:
            >>> import bellcrank as bc
            >>> figure = bc.size("geared_pendulum").plot(what="joints")
            >>> figure.axes[0].get_xlabel()
            'speed [rad/s]'
        """
        from bellcrank.sizing.plots import plot_sizing

        for name, text in (("what", what), ("motion", motion)):
            if text is not None:
                arguments.text(name, text)
        return plot_sizing(self, arguments.picture(path), what, motion)

    @cached_property
    def histories(self) -> Mapping[str, MotionHistory]:
        """What each joint does at the rows of each motion, by the motion's name.

        Position, velocity, acceleration, torque and power at the joint; torque, speed and power at the motor's shaft.
        SI units, nominal masses.

        Raises:
            InputError: Where the sizing does not hold its motions.

        Example:
            >>> import bellcrank as bc
            >>> shoulder = bc.size("geared_pendulum").histories["lift_and_return"].joint("shoulder")
            >>> round(float(shoulder.torque.max()), 3)
            9.81
        """
        from bellcrank.sizing.loads.joint_histories import sizing_histories

        return sizing_histories(self)

    def joint(self, name: str) -> JointSizing:
        """The sizing of one joint.

        Args:
            name: Name of the joint.

        Returns:
            Its JointSizing.

        Raises:
            InputError: For an unknown name.

        Example:
            >>> import bellcrank as bc
            >>> bc.size("geared_pendulum").joint("shoulder").kind
            'revolute'
        """
        arguments.text("name", name, "the name of a joint")
        for joint in self.joints:
            if joint.name == name:
                return joint
        raise InputError(
            f"sizing of {self.robot}: {unknown_name('joint', name, [joint.name for joint in self.joints])}"
        )

    @property
    def joints_without_actuator(self) -> tuple[str, ...]:
        """Names of the joints that no actuator moves, which are compared with the URDF's limits only."""
        moved = {joint for motor in self.motors for joint in motor.joints}
        return tuple(joint.name for joint in self.joints if joint.shaft is None and joint.name not in moved)

    @property
    def shafts(self) -> tuple[tuple[str, ShaftSizing], ...]:
        """The shaft of each actuator, with the name of its joint or of its motor in a coupled transmission."""
        joints = [(joint.name, joint.shaft) for joint in self.joints if joint.shaft is not None]
        return (*joints, *((motor.name, motor.shaft) for motor in self.motors))

    @property
    def peak_supply_power(self) -> float | None:
        """Largest power that all joints together take from the supply at one instant, W; None where unknown."""
        return None if self.supply_peak is None else self.supply_peak.value

    @property
    def peak_regeneration(self) -> float | None:
        """Largest power that all joints together give back at one instant, W; None where unknown."""
        return None if self.regeneration_peak is None else self.regeneration_peak.value

    @property
    def exceeded(self) -> tuple[str, ...]:
        """A sentence for each limit that is exceeded."""
        found = [text for joint in self.joints for text in joint.exceeded]
        found += [text for motor in self.motors for text in motor.exceeded]
        found += [f"all axes together: {one.name}: {one.text}" for one in self.system if one.verdict == "exceeded"]
        return tuple(found)

    @property
    def unknown(self) -> tuple[str, ...]:
        """A sentence for each limit of an actuator that could not be compared, because a figure is not stated."""
        return tuple(text for joint in self.joints for text in joint.unknown) + tuple(
            text for motor in self.motors for text in motor.unknown
        )

    @property
    def not_verified(self) -> tuple[str, ...]:
        """A sentence for each actuator of which a main criterion is unknown: it may be far too weak or too slow."""
        return tuple(
            f"{name}: {', '.join(one.name for one in shaft.judged.main_unknown)} unknown"
            for name, shaft in self.shafts
            if shaft.judged.main_unknown
        )

    @property
    def inside(self) -> bool:
        """Whether every joint can be sized, its peaks are determined, and every given limit is kept, as far as limits
        are known (`unknown`).
        """
        return not self.exceeded and not self.unsizable and not self.undetermined

    @property
    def verified(self) -> bool:
        """Whether every limit is kept, and no main criterion of an actuator is unknown."""
        return self.inside and not self.not_verified
