"""`bellcrank.verify_selection`: whether the axes follow their motions with their drives in the loop."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np

from bellcrank import arguments
from bellcrank.actuators.electrical import copper_loss, friction_loss
from bellcrank.actuators.product_arrays import MotorArrays
from bellcrank.actuators.thermal import HeatCycle, ThermalModel
from bellcrank.actuators.thermal_cycle import periodic_temperatures
from bellcrank.arguments import PROGRESS, Progress
from bellcrank.arrays import Array
from bellcrank.dynamics.inverse.drive_loops import DriveDynamics
from bellcrank.dynamics.inverse.mechanism import mechanism_of
from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess, Trust
from bellcrank.messages import unknown_name
from bellcrank.motion.sampled.csv_file import write_motion
from bellcrank.notes import Note, WithNotes
from bellcrank.present.results import JsonLayout, Result
from bellcrank.present.tables import TableContent, text_table
from bellcrank.scene.load import given_scene
from bellcrank.scene.scene import Scene
from bellcrank.simulation.simulate import simulate
from bellcrank.simulation.trajectory.events import AT_LIMIT, drive_columns, largest_bus_voltage
from bellcrank.sizing.selection.selection import Selection

if TYPE_CHECKING:
    from bellcrank.elements.drives import Drive
    from bellcrank.simulation.trajectory.trajectory import Trajectory

SPACING, MOST_ROWS = 5e-4, 20_001  # of the rows in which peaks are looked for, s
LIMITS: Final = {"tracking_error": "", "tool_error": "m", "settling_time": "s", "command_over_limit": "",
                 "winding_temperature": "°C", "bus_voltage": "V"}  # fmt: skip
OF_MOTIONS: Final = ("tool_error", "bus_voltage")  # limits that are not those of an axis
LONGEST_REST = 1e6  # s
BESIDE: Final = 1e-6  # rad or m: a linkage that starts further from its motion starts in another assembly
BAND: Final = {"rad": 1e-3, "m": 1e-4}  # within which a joint has settled


@dataclass(frozen=True, kw_only=True)
class FollowedAxis:
    """How one axis follows one motion.

    Attributes:
        joint: Its joint, and `unit` that of its position, rad or m.
        motion: The motion.
        tracking_error: Largest |reference − position|.
        settling_time: From the end of the motion until the error stays within the band, s; infinite where it does not.
        command_over_limit: Largest command over the limit of torque or voltage; None where no limit is known.
        time_at_limit: How long the command is at or above it, s.
        motor_torque: Root of the mean square of the electrical torque, N m.
        current: Largest, A, and `voltage`, V; None for `model: torque`.
        stuck: How long friction holds the rotor, s.
        winding_temperature: Largest where motion and rest repeat indefinitely, °C; None where unknown.
    """

    joint: str
    unit: str
    motion: str
    tracking_error: float
    settling_time: float
    command_over_limit: float | None
    time_at_limit: float
    motor_torque: float
    current: float | None
    voltage: float | None
    stuck: float
    winding_temperature: float | None


@dataclass(frozen=True, kw_only=True)
class SelectionVerification(WithNotes, Result):
    """Whether the axes of a robot follow its motions with their drives in the loop; made by `verify_selection`.

    `to_csv` writes one row an axis and motion.

    Attributes:
        robot: Name of the robot or robot configuration.
        axes: Each axis along each motion.
        tool_errors: By motion the largest distance (m) of the frame from where the motion has it.
        frame: The frame.
        bus_voltages: By motion the largest voltage of the bus, V; empty without a `supply`.
        drives: Resonances, bandwidth and margins of each drive at the start; empty where they cannot be computed.
        limits: The limits that were given, by name.
        unfinished: (motion, reason) of runs that ended early.
        band: Within which a joint has settled: rad and m.
        warnings: What else to know.
    """

    robot: str
    axes: tuple[FollowedAxis, ...]
    tool_errors: Mapping[str, float]
    frame: str
    bus_voltages: Mapping[str, float]
    drives: tuple[DriveDynamics, ...]
    limits: Mapping[str, float]
    unfinished: tuple[tuple[str, str], ...]
    band: Mapping[str, float]
    warnings: tuple[str, ...]
    json_layout: ClassVar = JsonLayout(1, ascii_only=True)

    def __repr__(self) -> str:
        return f"SelectionVerification('{self.robot}', {self.verdict})"

    @property
    def exceeded(self) -> tuple[str, ...]:
        """A sentence for each limit that is exceeded or not known, each run that ended early and each unstable loop."""
        found = [f"motion '{motion}': the run ended early: {why}" for motion, why in self.unfinished]
        found += [f"drive of {drive.joint}: its loop is unstable" for drive in self.drives if drive.stable is False]
        for name, limit in self.limits.items():
            if name in OF_MOTIONS:
                values = self.tool_errors if name == "tool_error" else self.bus_voltages
                found += [
                    f"motion '{motion}': {name.replace('_', ' ')} {value:.4g} {LIMITS[name]} is above {limit:g}"
                    for motion, value in values.items()
                    if not value <= limit
                ]
                if not values:
                    found.append(f"{name.replace('_', ' ')} is unknown: the scene has no 'supply'")
                continue
            for axis in self.axes:
                value = getattr(axis, name)
                words = f"{axis.joint}, motion '{axis.motion}': {name.replace('_', ' ')}"
                if value is None:
                    found.append(f"{words} is unknown")
                elif not value <= limit:
                    found.append(f"{words} {value:.4g} is above {limit:g}")
        return tuple(found)

    @property
    def exceeding(self) -> tuple[str, ...]:
        """The names of the axes that exceed a limit of their own, or whose loop is unstable."""
        unstable = [drive.joint for drive in self.drives if drive.stable is False]
        over = [
            axis.joint
            for axis in self.axes
            for name, limit in self.limits.items()
            if name not in OF_MOTIONS and not (getattr(axis, name) is not None and getattr(axis, name) <= limit)
        ]
        return tuple(dict.fromkeys([*unstable, *over]))

    @property
    def kept(self) -> bool:
        """Whether all runs ended as they should, with stable loops, and every limit that was given is kept."""
        return not self.exceeded

    @property
    def verdict(self) -> str:
        """ "kept" or "exceeded"."""
        return "kept" if self.kept else "exceeded"

    def table(self) -> str:
        """The result as text.

        Returns:
            A row for each axis and motion, tool errors, the dynamics of the drives, notes, and the verdict.

        Example:
            >>> import bellcrank as bc
            >>> bc.verify_selection("manutec_axis").table().splitlines()[0]
            'Manutec axis, drives in the loop'
        """
        header = ["joint", "motion", "tracking\nerror", "settled\nafter [s]", "command\nof limit", "at limit\n[s]",
                  "torque RMS\n[N m]", "current\n[A]", "voltage\n[V]", "stuck\n[s]", "winding\n[°C]"]  # fmt: skip
        rows = [
            [
                one.joint, one.motion, f"{one.tracking_error:.4g} {one.unit}",
                f"{one.settling_time:.4g}" if math.isfinite(one.settling_time) else "not yet",
                "unknown" if one.command_over_limit is None else f"{one.command_over_limit:.1%}",
                f"{one.time_at_limit:.4g}", f"{one.motor_torque:.4g}", _cell(one.current), _cell(one.voltage),
                f"{one.stuck:.4g}", "unknown" if one.winding_temperature is None else f"{one.winding_temperature:.4g}",
            ]
            for one in self.axes
        ]  # fmt: skip
        parts = [f"{self.robot}, drives in the loop", text_table(TableContent(header, rows), (0, 1))]
        parts.append(f"settled: within {self.band['rad']:g} rad or {self.band['m']:g} m")
        if self.frame:
            errors = ", ".join(f"{error:.4g} m along {motion}" for motion, error in self.tool_errors.items())
            parts.append(f"largest distance of frame '{self.frame}' from its path: {errors}")
        if self.bus_voltages:
            peaks = ", ".join(f"{value:.4g} V along {motion}" for motion, value in self.bus_voltages.items())
            parts.append(f"largest voltage of the bus: {peaks}")
        parts += [
            f"drive of {drive.joint}: {'; '.join(f'{name} {value}' for name, value in drive.rows())}"
            for drive in self.drives
        ]
        parts += [f"note: {text}" for text in self.warnings]
        if self.exceeded:
            parts += ["EXCEEDED:", *(f"  - {text}" for text in self.exceeded)]
        else:
            parts.append("All limits that were given are kept." if self.limits else "No limit was given.")
        return "\n".join(parts)

    def _rows(self) -> list[Sequence[object]]:
        header = [
            "joint", "motion", "unit of the error", "tracking error", "settling time [s]", "command over limit",
            "time at limit [s]", "RMS torque of the motor [N m]", "current [A]", "voltage [V]", "stuck [s]",
            "winding temperature [°C]",
        ]  # fmt: skip
        order = ("joint", "motion", "unit", "tracking_error", "settling_time", "command_over_limit", "time_at_limit",
                 "motor_torque", "current", "voltage", "stuck", "winding_temperature")  # fmt: skip
        return [header, *([_csv_cell(getattr(one, name)) for name in order] for one in self.axes)]

    def as_dict(self) -> dict[str, Any]:
        """The result as data that JSON can hold.

        Returns:
            Axes, tool errors, drives, limits and notes; None where a number is infinite or unknown.

        Example:
            >>> import bellcrank as bc
            >>> bc.verify_selection("manutec_axis").as_dict()["kept"]
            True
        """

        def finite(value: Any) -> Any:
            return None if isinstance(value, float) and not math.isfinite(value) else value

        return {
            "robot": self.robot,
            "kept": self.kept,
            "exceeded": list(self.exceeded),
            "axes": [{key: finite(value) for key, value in asdict(one).items()} for one in self.axes],
            "tool_errors": {motion: finite(error) for motion, error in self.tool_errors.items()},
            "frame": self.frame,
            "bus_voltages": {motion: finite(value) for motion, value in self.bus_voltages.items()},
            "drives": [drive.as_dict() for drive in self.drives],
            "limits": dict(self.limits),
            "band": dict(self.band),
            "notes": [str(text) for text in self.warnings],
        }


def _csv_cell(value: object) -> object:
    return "" if value is None or (isinstance(value, float) and not math.isfinite(value)) else value


@arguments.named
def verify_selection(
    scene: Scene | Selection | str | Path,
    motions: str | Sequence[str] | None = None,
    *,
    settle: float = 0.5,
    frame: str | None = None,
    limits: Mapping[str, float] | None = None,
    sample_time: float = 1e-3,
    overrides: Mapping[str, Any] | None = None,
    trust: Trust = (),
    progress: Progress | None = None,
) -> SelectionVerification:
    """Simulate a robot with its drives in the loop along its motions, and measure how the axes follow.

    Each run starts at the start of a motion, follows it, and goes on at rest for the time `settle`. Actuators without
    `model` in the file are taken as `model: torque` with a rigid gear and a servo whose gains are found automatically,
    which a note says.

    Args:
        scene: A scene or robot configuration with actuators, its path or name, or the result of `select`.
        motions: Names of motions of the configuration; by default all.
        settle: Time after the end of each motion, s.
        frame: The frame whose distance from its path is measured; by default the last one under `frames`, or the last
            link of an open chain.
        limits: Limits by name: "tracking_error" (rad or m), "tool_error" (m), "settling_time" (s),
            "command_over_limit" (1), "winding_temperature" (°C) and "bus_voltage" (V).
        sample_time: Of servos that the file does not describe, s.
        overrides: Values of the scene to change, by dotted path.
        trust: Folders whose files the scene may name, besides those near it.
        progress: Called with the number of motions that are simulated, and of all.

    Returns:
        The SelectionVerification; `print` shows it.

    Raises:
        InputError: There are no motions or actuators, a name is unknown, or a run cannot start.

    Example:
        >>> import bellcrank as bc
        >>> found = bc.verify_selection("manutec_axis", limits={"tracking_error": 2e-3})
        >>> found.kept, round(found.axes[0].tracking_error, 5)
        (True, 0.00182)
    """
    rest = arguments.number("settle", settle, "s", least=0.0, most=LONGEST_REST)
    given_limits = checked_limits(limits)
    period = arguments.number("sample_time", sample_time, "s", least=0.0)
    if not period > 0.0:
        arguments.refuse("sample_time", "a time of more than 0 (s)", sample_time)
    if progress is not None:
        arguments.function("progress", progress, PROGRESS)
    with ExitStack() as stack:
        whole = _scene_of(scene, overrides, trust, stack)
        names = _motion_names(whole, motions)
        whole, notes = _with_drives(_of_joints(whole, names, stack), names[0], period)
        point = _frame(whole, frame)
        runs = {}
        for name in names:
            runs[name] = _run(whole, name, rest)
            if progress is not None:
                progress(len(runs), len(names))
    axes = [_followed(run, drive, name) for name, run in runs.items() for drive in run.scene.drives]
    drives, why = _dynamics(runs[names[0]])
    notes += why
    for run in runs.values():
        notes += [note for note in (*run.notes, *run.warnings) if "its motion ends at" not in note]
    return SelectionVerification(
        robot=whole.name,
        axes=tuple(axes),
        tool_errors={} if not point else {name: _tool_error(run, name, point) for name, run in runs.items()},
        bus_voltages={name: largest_bus_voltage(run) for name, run in runs.items() if run.scene.supply is not None},
        frame=point,
        drives=drives,
        limits=given_limits,
        unfinished=tuple((name, run.reason) for name, run in runs.items() if not run.success),
        band=BAND,
        warnings=tuple(dict.fromkeys(notes)),
    )


def _cell(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def checked_limits(limits: Mapping[str, float] | None, name: str = "limits") -> dict[str, float]:
    """Limits in simulation, by name. Raises InputError."""
    found: dict[str, float] = {}
    if limits is None:
        return found
    for key, value in arguments.mapping(name, limits, "a mapping such as {'tracking_error': 1e-3}").items():
        if key not in LIMITS:
            raise InputError(f"argument '{name}': {unknown_name('limit', key, LIMITS)}")
        found[key] = arguments.number(f"{name}.{key}", value, LIMITS[key], least=0.0)
    return found


def _scene_of(
    given: Scene | Selection | str | Path, overrides: Mapping[str, Any] | None, trust: Trust, stack: ExitStack
) -> Scene:
    if not isinstance(given, Selection):
        return given_scene(given, overrides, trust)
    config = None if given.inputs is None else given.inputs.config
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
    path = given.write_config(folder / "selection.yaml")
    beside = [] if config is None else [config.source.resolve().parent, config.urdf.resolve().parent]
    more = [trust] if isinstance(trust, (str, Path)) else list(trust)
    return given_scene(path, overrides, [*beside, *more])


def _motion_names(scene: Scene, motions: str | Sequence[str] | None) -> list[str]:
    known = list(scene.config.motions)
    names = known
    if motions is not None:
        given = [motions] if isinstance(motions, str) else motions
        names = list(arguments.several("motions", given, str, "names of motions"))
    for name in names:
        if name not in known:
            raise InputError(f"argument 'motions': {unknown_name('motion', name, known)}")
    if not names:
        raise InputError(f"{scene.source}: there is no motion to follow; write some under 'motions'")
    return names


def _of_joints(scene: Scene, motions: Sequence[str], stack: ExitStack) -> Scene:
    """The scene with motions of a linkage's tool as those of its joints, which drives follow. Raises BellcrankError."""
    changes: dict[str, Any] = {}
    for k, name in enumerate(motions if scene.constraints else ()):
        try:
            scene.motion(name)
        except InputError:  # the tool's path alone, without the constraints, moves no joint
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory())).resolve()
            path = write_motion(mechanism_of(scene).along(name)[0], folder / f"motion_{k}.csv")
            changes[f"motions.{name}"] = {"kind": "csv", "file": str(path)}
            access = scene.access or FileAccess.below(folder)
            scene = replace(scene, access=replace(access, trusted=(*access.trusted, folder)))
    return scene.with_overrides(changes) if changes else scene


def _with_drives(scene: Scene, motion: str, period: float) -> tuple[Scene, list[str]]:
    """The scene with a drive for each actuator, and notes on those that the file does not describe."""
    there = {drive.joint.name for drive in scene.drives}
    coupled = set(scene.config.coupled_motors)
    missing = [name for name in scene.config.actuators if name not in there and name not in coupled]
    if not scene.config.actuators:
        raise InputError(f"{scene.source}: there is no actuator; write motors and gears under 'actuators'")
    if coupled:
        raise InputError(
            f"{scene.source}: drives of coupled transmissions ({', '.join(sorted(coupled))}) are not supported"
        )
    notes: list[str] = []
    changes: dict[str, Any] = {}
    rough = []
    for name in missing:
        motor, _ = scene.config.actuators[name].rows
        changes[f"actuators.{name}.model"] = "torque"
        changes[f"actuators.{name}.servo"] = {"motion": motion, "gains": "auto", "sample_time": period}
        if motor.coulomb_torque is None or motor.viscous_coefficient is None:
            changes[f"actuators.{name}.rotor_friction"] = "none"
            rough.append(name)
    replaced = [part.name for part in scene.control if {joint.name for joint in part.joints} <= {*missing}]
    if missing and replaced:
        kept = [entry for entry in scene.data["control"] if entry.get("name", entry.get("kind")) not in replaced]
        changes["control"] = kept
        notes.append(Note(f"control {', '.join(replaced)} of the file is left out: the servos command these joints"))
    if missing:
        notes.append(
            Note(
                f"the file describes no drive of {', '.join(missing)}; taken: model torque, a rigid gear, and a servo "
                f"of {period:g} s whose gains are found"
            )
        )
    if open_loop := [drive.joint.name for drive in scene.drives if drive.servo is None]:
        raise InputError(
            f"{scene.source}: actuators.{open_loop[0]}.servo is a command, which follows no motion; give a cascade of "
            "controllers or gains: auto"
        )
    if rough:
        notes.append(Note(f"the friction of the motors of {', '.join(rough)} is not stated, and is left out"))
    return (scene.with_overrides(changes) if changes else scene), notes


def _frame(scene: Scene, frame: str | None) -> str:
    """The frame whose distance from its path is measured; empty where there is none."""
    robot = scene.robot
    if frame is not None:
        if arguments.text("frame", frame, "the name of a frame") not in robot.frame_names:
            raise InputError(f"argument 'frame': {unknown_name('frame', frame, robot.frame_names)}")
        return frame
    tree = robot.equations.tree
    parents = {joint.parent for joint in tree.joints}
    ends = [k + 1 for k in range(len(tree.joints)) if k + 1 not in parents]
    if len(ends) != 1 or scene.constraints:
        return ""
    links = [name for name in robot.frame_names if not name.startswith("payload ")]
    return list(scene.config.frames or links)[-1]


def _run(scene: Scene, motion: str, rest: float) -> Trajectory:
    length = scene.motion(motion).duration
    changes: dict[str, Any] = {"initial": _start(scene, motion), "simulate.duration": length + rest}
    for drive in scene.drives:
        servo = scene.data["actuators"][drive.joint.name]["servo"]
        kept = {key: value for key, value in servo.items() if key != "target"}
        changes[f"actuators.{drive.joint.name}.servo"] = {**kept, "motion": motion}
    duration = length + rest
    rows = min(max(math.ceil(duration / SPACING) + 1, 1001), MOST_ROWS)
    run = simulate(scene.with_overrides(changes), samples=rows)
    for drive in run.scene.drives if scene.constraints else ():
        beside = abs(float(drive_columns(run, drive).get("tracking error", np.zeros(1))[0]))
        if beside > BESIDE:
            raise InputError(
                f"{scene.source}: the linkage does not start where motion '{motion}' does: joint "
                f"'{drive.joint.name}' is {beside:.3g} rad or m beside it; its assembly may be another one"
            )
    return run


def _start(scene: Scene, motion: str) -> dict[str, Any]:
    """The entry `initial` of the start of a motion, with that of the joints that constraints move."""
    found: dict[str, Any] = {"motion": motion}
    if not scene.constraints:
        return found
    whole, independent = mechanism_of(scene).along(motion)
    for joint in scene.robot.joints[scene.robot.floating_base :]:  # a free base keeps its own entry
        place = whole.position[0, joint.q : joint.q + joint.nq].tolist()
        if joint.nq == 1 and joint.name not in independent:
            found[joint.name] = {"guess": place[0]}
        elif joint.kind == "planar":
            found[joint.name] = {"position": {"guess": place[:2]}, "angle": {"guess": math.atan2(place[3], place[2])}}
        elif joint.kind in ("floating", "spherical"):
            turn = {"quaternion_xyzw": {"guess": place[-4:]}}
            found[joint.name] = turn if joint.kind == "spherical" else {"position": {"guess": place[:3]}, **turn}
    return found


def _followed(run: Trajectory, drive: Drive, motion: str) -> FollowedAxis:
    columns = drive_columns(run, drive)
    unit = "m" if drive.joint.kind == "prismatic" else "rad"
    wanted = run.scene.motion(motion)
    error = np.abs(columns.get("tracking error", np.zeros(1)))
    outside = np.flatnonzero(error > BAND[unit])
    settled = 0.0
    if len(outside) and drive.servo is not None:
        last = int(outside[-1])
        settled = math.inf if last == len(error) - 1 else max(float(run.time[last + 1]) - wanted.duration, 0.0)
    over = columns.get("command over limit")
    step = np.gradient(run.time) if len(run.time) > 1 else np.zeros(len(run.time))
    torque = columns["motor torque"]
    name = f"{drive.joint.name} rotor"
    held = run.stuck(name) if name in run.scene.sticking else np.zeros((0, 2))
    return FollowedAxis(
        joint=drive.joint.name,
        unit=unit,
        motion=motion,
        tracking_error=float(error.max()),
        settling_time=settled,
        command_over_limit=None if over is None else float(over.max()),
        time_at_limit=0.0 if over is None else float(step[over >= AT_LIMIT].sum()),
        motor_torque=_root_mean_square(run.time, torque),
        current=_largest(columns.get("current")),
        voltage=_largest(columns.get("voltage")),
        stuck=float((held[:, 1] - held[:, 0]).sum()),
        winding_temperature=_temperature(run, drive, torque, columns["rotor velocity"]),
    )


def _root_mean_square(time: Array, values: Array) -> float:
    squares = 0.5 * (values[1:] ** 2 + values[:-1] ** 2) * np.diff(time)
    return math.sqrt(float(squares.sum()) / float(time[-1] - time[0])) if len(time) > 1 else abs(float(values[0]))


def _largest(values: Array | None) -> float | None:
    return None if values is None else float(np.abs(values).max())


def _temperature(run: Trajectory, drive: Drive, torque: Array, speed: Array) -> float | None:
    """The largest winding temperature where the run repeats indefinitely, °C; None where unknown."""
    actuator = run.scene.config.actuators[drive.joint.name]
    motor, _ = actuator.rows
    motors, conditions = MotorArrays.of((motor,)), actuator.conditions
    if len(run.time) < 2:
        return None
    copper, friction = copper_loss(motors, torque), np.abs(friction_loss(motors, speed))
    heat = HeatCycle(
        duration=np.diff(run.time),
        copper_loss=0.5 * (copper[1:] + copper[:-1])[None],
        friction_loss=0.5 * (friction[1:] + friction[:-1])[None],
    )
    found = float(periodic_temperatures(ThermalModel.of(motors, conditions), heat).winding_peak[0])
    return None if math.isnan(found) else found


def _tool_error(run: Trajectory, motion: str, frame: str) -> float:
    """The largest distance of a frame from where the motion has it, m."""
    robot = run.robot
    joints = [joint for joint in robot.joints if joint.nv == 1]
    at = np.minimum(run.time, run.scene.motion(motion).duration)
    wanted = mechanism_of(run.scene).along(motion)[0].at(at)[0] if run.scene.constraints else run.position.copy()
    references = {} if run.scene.constraints else {d.name: d for d in run.scene.drives if d.servo is not None}
    for drive in references.values():
        assert drive.servo is not None and drive.servo.motion is not None
        place = [joint.name for joint in joints].index(drive.joint.name)
        wanted[:, drive.joint.q] = drive.servo.motion.signal.at(at)[:, place]
    distance = robot.frame_pose(frame, run.position)[0] - robot.frame_pose(frame, wanted)[0]
    return float(np.sqrt((distance**2).sum(axis=1)).max())


def _dynamics(run: Trajectory) -> tuple[tuple[DriveDynamics, ...], list[str]]:
    """The dynamics of the drives at the start of a run, or a note on why they cannot be computed."""
    from bellcrank.analysis.linearise import linearise

    try:
        return linearise(run).drives, []
    except InputError as error:
        return (), [Note(f"resonances and margins are not computed: {error}")]
