"""`bellcrank.select`: choose the motor and gear of every axis of a robot from a catalogue."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast, get_args

from bellcrank import arguments
from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.catalogue.catalogue import Catalogue, load_catalogue
from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.coupled_transmission import CoupledTransmission
from bellcrank.actuators.gear import DIRECT
from bellcrank.actuators.mount import Mount
from bellcrank.errors import InputError
from bellcrank.files.access import Trust
from bellcrank.motion.motion_entry import DutyStep, checked_duty
from bellcrank.notes import reached
from bellcrank.robot.model.payload import Payload
from bellcrank.sizing.drive_verdicts import check_momentary_loads, conditions_of
from bellcrank.sizing.loads.load_checks import refuse_massless
from bellcrank.sizing.loads.motion_peaks import undetermined_peaks
from bellcrank.sizing.mechanism_sizing import motion_warnings
from bellcrank.sizing.selection.axis_loads_of import AxisModel, axis_model
from bellcrank.sizing.selection.axis_pairs import AxisPairs, axis_pairs, check_prices
from bellcrank.sizing.selection.choose import choose, selection_of
from bellcrank.sizing.selection.joint_problem import Choice
from bellcrank.sizing.selection.judged_axes import JudgedAxes, Objective
from bellcrank.sizing.selection.selection import Selection, SelectionInputs
from bellcrank.sizing.sizing_subject import OneMotion, SizingSubject, override_notes, sizing_subject
from bellcrank.terminal.progress import counting

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene

EFFORT = 300_000
MANY_PAIRS = 100_000  # of all axes together
EFFORT_OF_MANY_PAIRS = 30_000


@arguments.named
def select(
    robot: Robot | Scene | str | Path,
    motions: OneMotion | Sequence[OneMotion] | None = None,
    catalogue: Catalogue | str | Path | Sequence[str | Path] | None = None,
    objective: Objective = "mass",
    *,
    conditions: Conditions | Mapping[str, Any] | None = None,
    duty: Sequence[Any] | None = None,
    keep: Mapping[str, str] | None = None,
    exclude: Iterable[str] = (),
    makers: Iterable[str] = (),
    transmissions: Iterable[CoupledTransmission] | None = None,
    mounts: Mapping[str, Mount] | None = None,
    feedback: bool = True,
    candidates: int = 12,
    effort: int | None = None,
    payloads: Iterable[Payload] = (),
    allow_massless: Iterable[str] = (),
    simulated_limits: Mapping[str, float] | None = None,
    overrides: Mapping[str, Any] | None = None,
    trust: Trust = (),
) -> Selection:
    """Choose the motor and gear of every axis from a catalogue.

    All combinations of motors and gears that go together are judged for each axis, by every criterion, along load
    cycles. They are ranked: first those of which all criteria are shown, then those that pass what is known, with fewer
    unknown main criteria first; then by the objective, where a known value comes before an unknown one; then by the
    largest utilisation. The masses of the chosen actuators load other axes, so the best combination of all axes is
    searched for, from the tip to the base (branch and bound); `Selection.proof` says what is proven of it.

    Where the mass of an actuator is not stated, the loads of the axes that it influences are unknown: there, no
    criterion that depends on loads is shown.

    Args:
        robot: As for `size`: a Robot or Linkage; or a RobotConfig, a Scene, or the path or name of a robot
            configuration or URDF.
        motions: As for `size`.
        catalogue: The products to choose from, or folders and files of products besides those that come with bellcrank;
            by default the latter, and those of the robot configuration's key `catalogue`.
        objective: "mass", "cost" or "loss" (least total), or "margin" (least largest utilisation).
        conditions: Supply, surroundings and safety, as Conditions or a mapping such as {"voltage": 48.0}. The fields
            that are given replace those of the robot configuration: of an axis (`actuators.NAME`), else of the robot
            (`conditions`).
        duty: The cycle: names of motions, and mappings such as {"motion": "pick", "repeat": 3} and {"pause": 2.0}; by
            default that of the robot configuration if `motions` are its own, else each motion is a cycle that repeats.
        keep: Pairs that are given, by the name of the axis: the ids "motor+gear", or "motor" with any gear.
        exclude: Ids of products to leave out.
        makers: Makers to choose from; empty: all.
        transmissions: Coupled transmissions, whose motors are axes in place of their joints; by default those of the
            robot configuration.
        mounts: Where actuators are mounted, by the name of the axis; by default those of the robot configuration, else
            on the joint's parent link.
        feedback: Whether the masses of actuators are added to those of the robot; False where the URDF contains them.
        candidates: How many pairs of each axis the result lists.
        effort: How many pairs the search may judge once a first combination is found; by default 300 000, or 30 000
            where the axes have more than 100 000 pairs together, of which no search tries every combination.
        payloads: Payloads besides those that the robot carries.
        allow_massless: Links without mass that motors may move, as for `size`.
        simulated_limits: Limits that the chosen drives keep when they are simulated along the motions of a robot
            configuration, by the names of `verify_selection`, such as {"tracking_error": 0.01}; candidates that do not
            are passed over.
        overrides: Values of a scene, configuration or URDF to change, by dotted path, as for `size`.
        trust: Folders whose files a robot configuration or URDF may name, besides those near it.

    Returns:
        The Selection; `print` shows its tables, `Selection.inside` is the verdict.

    Raises:
        InputError: For what `size` refuses; for an unknown objective, maker, product or axis; for a catalogue without
            motors, and one without prices, or with several currencies, where the objective is the cost.

    Example:
        >>> import bellcrank as bc
        >>> selection = bc.select("geared_pendulum", candidates=3)
        >>> selection.axis("shoulder").chosen.mass == selection.mass
        True
    """
    candidates = arguments.whole("candidates", candidates, least=1, most=arguments.MOST_ITEMS)
    if effort is not None:
        effort = arguments.whole("effort", effort, least=0)
    limits: dict[str, float] = {}
    if simulated_limits is not None:
        from bellcrank.sizing.verification import checked_limits

        limits = checked_limits(simulated_limits, "simulated_limits")
    exclude, makers = _repeatable(exclude), _repeatable(makers)
    payloads, allow_massless = _repeatable(payloads), _repeatable(allow_massless)
    prepare = partial(
        prepare_selection, robot, motions, catalogue, objective, conditions=conditions, duty=duty, exclude=exclude,
        makers=makers, transmissions=transmissions, mounts=mounts, feedback=feedback, payloads=payloads,
        allow_massless=allow_massless, overrides=overrides, trust=trust,
    )  # fmt: skip
    prepared = prepare(keep=keep)
    whole = prepared.choose(candidates, effort)
    if not limits:
        return whole
    if prepared.subject.config is None:
        raise InputError("argument 'simulated_limits': a selection for a bare robot has no file to simulate")
    from bellcrank.sizing.followed_selection import followed_selection

    def again(given_pairs: Mapping[str, str]) -> Selection:
        return prepare(keep={**prepared.kept, **given_pairs}).choose(candidates, effort)

    return replace(followed_selection(whole, again, limits), simulated_limits=limits)


@dataclass(frozen=True, eq=False, kw_only=True)
class PreparedSelection:
    """The pairs of all axes of a robot under its loads, from which `select` chooses.

    Attributes:
        subject: The robot and its motions.
        products: What is chosen from, without assumed values.
        kept: Given pairs by axis.
        model: The axes and the model of their loads.
        duty: The duty program.
        problem: The pairs, judged.
        warnings: What to know about the subject and what is assumed.
    """

    subject: SizingSubject
    products: Catalogue
    kept: Mapping[str, str]
    model: AxisModel
    duty: tuple[DutyStep, ...] | None
    problem: JudgedAxes
    warnings: tuple[str, ...]

    def choose(self, candidates: int = 1, effort: int | None = None) -> Selection:
        """Choose, and list some candidates of each axis."""
        subject, problem = self.subject, self.problem
        if effort is None:
            many = sum(len(one.pairs) for one in problem.axes) > MANY_PAIRS
            effort = EFFORT_OF_MANY_PAIRS if many else EFFORT
        with counting("select", " pairs") as bar:
            problem.progress = lambda done: bar(done, done)
            chosen = choose(problem, effort)
            drives = _chosen_drives(problem, chosen.choice)
            added = problem.added_masses(problem.choice_masses(chosen.choice))
            known = set(drives) <= set(self.kept) and not added
            final = problem
            if not known:
                final = replace(problem, loads=self.model.along(subject.motions, self.duty, drives, added=added))
            selection = selection_of(problem, final, chosen, candidates, effort)
        undetermined = undetermined_peaks(subject.mechanism, subject.motions, {})
        return replace(
            selection,
            robot=subject.mechanism.robot.name if subject.config is None else subject.config.name,
            feedback=problem.feedback,
            inputs=SelectionInputs(subject.mechanism, tuple(subject.motions), subject.config, self.products, self.duty),
            warnings=tuple(dict.fromkeys([*self.warnings, *selection.warnings])),
            undetermined=(*undetermined, *reached(subject.file_notes)),
        )


def prepare_selection(
    robot: Robot | Scene | str | Path,
    motions: OneMotion | Sequence[OneMotion] | None,
    catalogue: Catalogue | str | Path | Sequence[str | Path] | None,
    objective: Objective,
    *,
    conditions: Conditions | Mapping[str, Any] | None = None,
    duty: Sequence[Any] | None = None,
    keep: Mapping[str, str] | None = None,
    exclude: Iterable[str] = (),
    makers: Iterable[str] = (),
    transmissions: Iterable[CoupledTransmission] | None = None,
    mounts: Mapping[str, Mount] | None = None,
    feedback: bool = True,
    payloads: Iterable[Payload] = (),
    allow_massless: Iterable[str] = (),
    overrides: Mapping[str, Any] | None = None,
    trust: Trust = (),
) -> PreparedSelection:
    """The pairs that `select` with these arguments chooses from. Raises InputError as `select`."""
    objective = cast(Objective, arguments.one_of("objective", objective, get_args(Objective)))
    feedback = arguments.flag("feedback", feedback)
    given = Conditions().updated(conditions)
    subject = sizing_subject(robot, motions, payloads, trust, overrides=overrides)
    own = None if subject.config is None else subject.config.catalogue
    products = _products(own if catalogue is None else catalogue, makers, exclude)
    refuse_massless("selection", subject.mechanism, subject.motions, allow_massless)
    kept = _kept(keep)
    model = _model(subject, transmissions, mounts)
    program = checked_duty(subject.duty if duty is None else duty)
    drives = _kept_drives(kept, products, lambda axis: conditions_of(subject.config, axis, given))
    loads = model.along(subject.motions, program, drives)
    common = conditions_of(subject.config, None, given)
    of_axes = [conditions_of(subject.config, axis.name, given) for axis in loads.axes]
    check_momentary_loads(common, [axis.name for axis in loads.axes])
    pairs = axis_pairs(loads.axes, _completed(products, of_axes), kept)
    check_prices(pairs, objective)
    warnings = [
        *(subject.duty_notes if duty is None else ()),
        *_subject_warnings(subject),
        *loads.warnings,
        *_assumed_notes(products, pairs, of_axes),
    ]
    return PreparedSelection(
        subject=subject,
        products=products,
        kept=kept,
        model=model,
        duty=program,
        problem=JudgedAxes(loads, pairs, of_axes, common, objective, feedback),
        warnings=tuple(warnings),
    )


def _repeatable(items: Iterable[Any]) -> Iterable[Any]:
    """The items, which may be gone through more than once."""
    return tuple(items) if isinstance(items, Iterator) else items


def _products(
    given: Catalogue | str | Path | Sequence[str | Path] | None, makers: Iterable[str], exclude: Iterable[str]
) -> Catalogue:
    """The products to choose from. Raises InputError."""
    if given is None:
        catalogue = load_catalogue()
    elif isinstance(given, Catalogue):
        catalogue = given
    else:
        folders = [given] if isinstance(given, (str, Path)) else given
        paths = arguments.several("catalogue", folders, object, "folders or files")
        catalogue = load_catalogue(*(arguments.path("catalogue", one, "a folder or file") for one in paths))
    catalogue = catalogue.filtered(makers=makers, exclude=exclude)
    if not catalogue.motors:
        raise InputError("argument 'catalogue': no motor is left to choose from; name other makers, or exclude less")
    return catalogue


def _kept(given: Mapping[str, str] | None) -> dict[str, str]:
    """Given pairs by axis. Raises InputError."""
    kept = {} if given is None else arguments.mapping("keep", given, "a mapping of axes to ids of motors and gears")
    for name, ids in kept.items():
        arguments.text(f'keep["{name:.80}"]', ids, 'ids such as "motor+gear"')
    return kept


def _model(
    subject: SizingSubject,
    transmissions: Iterable[CoupledTransmission] | None,
    mounts: Mapping[str, Mount] | None,
) -> AxisModel:
    """The axes, with the transmissions and mounts of the configuration where none are given. Raises InputError."""
    if subject.config is not None:
        transmissions = subject.config.transmissions if transmissions is None else transmissions
        mounts = subject.config.mounts if mounts is None else mounts
    return axis_model(subject.mechanism, subject.motions, transmissions, mounts)


def _kept_drives(
    kept: Mapping[str, str], products: Catalogue, conditions: Callable[[str], Conditions]
) -> dict[str, Actuator]:
    """The actuators of the axes whose motor and gear are both given; wrong ids are refused elsewhere."""
    motors = {row.id: row for row in products.motors}
    gears = {row.id: row for row in products.gears}
    found: dict[str, Actuator] = {}
    for axis, ids in kept.items():
        motor, plus, gear = (part.strip() for part in ids.partition("+"))
        whole = motor in motors and not plus and motors[motor].kind == "actuator"
        if whole or (motor in motors and (gear in gears or gear == DIRECT.id)):
            found[axis] = Actuator.of(motors[motor], gears.get(gear), conditions(axis))
    return found


def _chosen_drives(problem: JudgedAxes, choice: Choice) -> dict[str, Actuator]:
    """The actuators of the axes for which something was chosen, by the name of the axis."""
    found: dict[str, Actuator] = {}
    for one, pair, conditions in zip(problem.axes, choice, problem.conditions, strict=True):
        if pair is not None:
            motor, gear = one.pairs.rows(pair)
            found[one.axis.name] = Actuator.of(motor, gear, conditions)
    return found


def _completed(catalogue: Catalogue, conditions: Sequence[Conditions]) -> list[Catalogue]:
    """The products with the values that are assumed of each axis, where they state none."""
    found: dict[Any, Catalogue] = {(): catalogue}
    for one in conditions:
        if one.assume not in found:
            motors = tuple(one.completed(row) for row in catalogue.motors)
            found[one.assume] = Catalogue(motors, tuple(one.completed(row) for row in catalogue.gears))
    return [found[one.assume] for one in conditions]


def _assumed_notes(catalogue: Catalogue, axes: Sequence[AxisPairs], conditions: Sequence[Conditions]) -> list[str]:
    """A sentence for each assumed value, with the number of products that it is taken for, and for which axes."""
    names: dict[tuple[str, float], list[str]] = {}
    for axis, one in zip(axes, conditions, strict=True):
        for pair in dict(one.assume).items():
            names.setdefault(pair, []).append(axis.axis.name)
    notes = []
    for (name, value), of in names.items():
        room, _, field = name.partition(".")
        rows = catalogue.motors if room == "motor" else catalogue.gears
        one = Conditions(assume={name: value})
        count = sum(field in dict(one.filled(row)) for row in rows)
        where = "" if len(of) == len(axes) else f" at {', '.join(of)}"
        notes.append(f"{name} = {value:g} is assumed for {count} of {len(rows)} {room}s{where}, which do not state it")
    return notes


def _subject_warnings(subject: SizingSubject) -> list[str]:
    robot = subject.mechanism.robot
    config = subject.config
    found = [
        *subject.file_notes,
        *([] if config is None else override_notes(config)),
        *robot.findings,
        *robot.inertia_warnings,
    ]
    return found + motion_warnings(subject.mechanism, subject.motions)
