"""Notes on a scene: a sentence for each thing that is unusual without being wrong."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.arrays import Array
from bellcrank.dynamics.constraints.constraint_rows import rows_of
from bellcrank.dynamics.equations.system import start_states, system_of, system_parameters
from bellcrank.dynamics.inverse.input_breakpoints import prescribed_motion_end
from bellcrank.dynamics.inverse.motion_notes import path_notes
from bellcrank.dynamics.postures.consistent_start import (
    MOVED,
    consistent_start,
    corrections,
    given_posture,
    starts_further_away,
)
from bellcrank.elements.controllers import PD
from bellcrank.elements.element import Force, joint_unit, table_span
from bellcrank.elements.expression import has_time
from bellcrank.elements.force_table import COMPONENTS
from bellcrank.elements.frame_forces import Wrench
from bellcrank.elements.joint_constraints import PrescribedMotion
from bellcrank.elements.joint_forces import Torque
from bellcrank.elements.sampled_controllers import StateSpace, samples_of
from bellcrank.motion.limit_checks import FAR_OUT, MOST_TURNED
from bellcrank.notes import Note

if TYPE_CHECKING:
    from bellcrank.elements.signals import Signal
    from bellcrank.scene.scene import Scene

MOVING = 1e-4  # of a motion's largest speed: slower counts as at rest
OVERSHOOT = 3.0  # times the range of a table's values: so far a cubic spline may overshoot without a note


def scene_notes(scene: Scene, duration: float | None = None) -> tuple[Note, ...]:
    """The notes on a scene that is simulated for a duration (s), by default its own.

    They take the scene's motions, and compile its event functions.
    """
    duration = scene.settings.duration if duration is None else duration
    changes = (*_rows(scene), *_branch(scene), *_saved(scene), *_events(scene))
    information = (
        *_limits(scene), *_targets(scene), *_signals(scene, duration), *_paths(scene), *_drives(scene, duration)
    )  # fmt: skip
    found = [Note(text, "reached", "limit", time=0.0) for text in _start(scene)]
    found += [Note(text, "changes") for text in changes]
    return (*found, *map(Note, information), *file_notes(scene))


def file_notes(scene: Scene) -> tuple[Note, ...]:
    """The notes on a scene whatever its start and duration: what its files say and is not modelled, and its motors."""
    return (*map(Note, (*_coupled_motors(scene), *_all_driven(scene), *_motor_drives(scene))), *scene.notes)


def _rows(scene: Scene) -> Iterator[str]:
    """Constraints, or rows of them, that are left out because no joint affects them."""
    left_out = rows_of(scene).left_out if scene.constraints else ()
    for constraint in scene.constraints:
        rows = [(label, gap) for name, label, gap in left_out if name == constraint.name]
        if not rows:
            continue
        far = max(gap for _, gap in rows)
        if len(rows) == len(constraint.labels(scene.robot)):
            yield (
                f"constraint '{constraint.name}' does not depend on any joint (residual {far:.3g} m or rad); it is "
                "left out"
            )
        else:
            named = ", ".join(label for label, _ in rows)
            yield (
                f"constraint '{constraint.name}': no joint affects its row{'s' if len(rows) > 1 else ''} {named} "
                f"(residual {far:.3g} m or rad); left out"
            )


def _coupled_motors(scene: Scene) -> Iterator[str]:
    """Actuators of coupled transmissions, whose rotors are not part of the robot."""
    if names := [name for name in scene.config.actuators if name in scene.config.coupled_motors]:
        yield (
            f"the rotors of the motors of coupled transmissions are not included: {', '.join(names)}; controllers act "
            "on the joints"
        )


def _motor_drives(scene: Scene) -> Iterator[str]:
    """What of motors and gears of drives is not simulated, and drives that nothing limits."""
    for drive in scene.drives:
        name, (_, gear) = drive.joint.name, scene.config.actuators[drive.joint.name].rows
        if drive.contact is not None and (gear.efficiency or 0.0) < 1.0:
            yield (
                f"drive of '{name}': losses of the gear by load are not simulated behind rigid backlash; give its "
                "stiffness for that"
            )
        elif not drive.has_own_rotor:
            stated = [
                text
                for text, there in (
                    ("its stiffness", gear.stiffness is not None),
                    ("its backlash", bool(gear.backlash)),
                )
                if there
            ]
            if stated:
                yield f"drive of '{name}': the gear is rigid, {', '.join(stated)} not simulated; write 'elastic'"
            if gear.efficiency is None:
                yield (
                    f"drive of '{name}': the gear's efficiency is not stated, its losses by load are not simulated; "
                    "state gear.efficiency"
                )
        if not drive.is_limited:
            what = "torque" if drive.model == "torque" else "voltage"
            yield f"drive of '{name}': no limit of its {what} is stated, so that nothing limits it"


def _all_driven(scene: Scene) -> Iterator[str]:
    """Controllers of all joints, where the file says nothing of motors."""
    config = scene.config
    if config.actuated or config.joints_with_actuators:
        return
    for part in scene.control:
        if part.place.raw("joints", "all") == "all" and not {"joint", "target"} & {*part.place}:
            yield (f"control '{part.name}' acts at all joints: none is named under 'actuated' and none has an actuator")


def _branch(scene: Scene) -> Iterator[str]:
    """A start that is not near the given posture and may be on another branch than is meant."""
    if not starts_further_away(scene):
        return
    moved = np.abs(consistent_start(scene)[0] - given_posture(scene))
    k = int(moved.argmax())
    joint = next(j for j in reversed(scene.robot.joints) if j.q <= k)
    yield (
        "no posture near the given one satisfies the constraints; of the starts found further away the nearest is "
        f"taken: joint '{joint.name}' moves most, by {moved[k]:.3g} (SI units); another branch may be meant: write "
        "guesses nearer to it ({guess: …})"
    )


def _start(scene: Scene) -> Iterator[str]:
    """Joints that start outside their range in the URDF."""
    robot, q = scene.robot, consistent_start(scene)[0]
    for j in robot.joints:
        if j.nq == 1 and not robot.lower[j.q] <= q[j.q] <= robot.upper[j.q]:
            unit = joint_unit(j, "position")
            yield (
                f"joint '{j.name}' starts at {q[j.q]:.6g} {unit}, outside its range of {robot.lower[j.q]:.6g} to "
                f"{robot.upper[j.q]:.6g} {unit}; joint limits are not enforced"
            )


def _saved(scene: Scene) -> Iterator[str]:
    """Differences from the saved run, motion or keyframe that the scene starts from: corrections, and the clock."""
    saved, robot = scene.initial.saved, scene.robot
    q, v = consistent_start(scene)
    if moved := corrections(scene, given_posture(scene), q):
        most = moved[0]
        others = f", and {len(moved) - 1} other joints by less" if len(moved) > 1 else ""
        yield (
            f"{most.by} does not satisfy the constraints: they move joint '{most.joint.name}' from {most.before:.6g} "
            f"to {most.after:.6g} {joint_unit(most.joint, 'position') if most.joint.nq == 1 else '(SI units)'}{others}"
        )
    for part in scene.constraints:
        if isinstance(part, PrescribedMotion) and part.joint.name in scene.initial.guesses:
            guess, start = scene.initial.position[part.joint.name], float(q[part.joint.q])
            if abs(start - guess) > MOVED * max(1.0, abs(guess)):
                yield (
                    f"constraint '{part.name}' prescribes the start of joint '{part.joint.name}', "
                    f"{start:.6g} {joint_unit(part.joint, 'position')}; its guess of {guess:.6g} is not used"
                )
    if saved is None:
        return
    for control in scene.control:
        if not isinstance(control, StateSpace) or "holds" in control.place:
            continue
        if samples_of(control.name) not in saved.held or not control.holds:
            yield f"control '{control.name}' starts anew: {saved.name} holds no state that fits it"
        elif "initial" in control.place:
            yield f"control '{control.name}': its initial state is not used; it goes on with that of {saved.name}"
    rates = scene.initial.rates(robot, given_posture(scene))
    change = np.abs(v - rates)
    if change.max(initial=0.0) > MOVED * max(1.0, float(np.abs(rates).max(initial=0.0))):
        k = int(change.argmax())
        joint = next(j for j in reversed(robot.joints) if j.v <= k)
        yield (
            f"the run {saved.name} does not satisfy the constraints: the velocity of joint '{joint.name}' is changed "
            f"by {change[k]:.3g} (SI units), which is not computed as an impact, as at a latch"
        )
    if saved.clock != scene.initial.clock and (moving := ", ".join(_with_time(scene))):
        yield (
            f"{saved.name} ends at clock time {saved.clock:.6g} s, and this run starts at clock time "
            f"{scene.initial.clock:.6g} s, which affects {moving}; without initial.clock it goes on"
        )


def _with_time(scene: Scene) -> Iterator[str]:
    """What in a scene depends on time explicitly: tables, motions and expressions with t."""
    for source in scene.signal_sources:
        if source not in scene.held_sources:
            yield source.name
    whole: list[tuple[str, Any]] = [(f"{part.owner} '{part.name}'", part) for part in scene.elements]
    whole += [(f"event '{event.name}'", event) for event in scene.events]
    whole += [(f"output '{name}'", output) for name, output in scene.outputs.items()]
    yield from (name for name, part in whole if has_time(part))


def _limits(scene: Scene) -> Iterator[str]:
    """Effort limits that are 0 or missing, where a controller uses them."""
    for part in scene.control:
        if not isinstance(part.limit, Mapping):
            continue
        off = [name for name, most in part.limit.items() if most == 0.0]
        free = [name for name, most in part.limit.items() if math.isinf(most)]
        if off:
            yield (
                f"control '{part.name}': the URDF's effort limit is 0 at {_joints(off)}, so 'limit: effort' switches "
                "it off there; give a number as limit, or remove it"
            )
        if free:
            yield f"control '{part.name}': the URDF has no effort limit at {_joints(free)}, so nothing is limited there"


def _targets(scene: Scene) -> Iterator[str]:
    """Targets of pd controllers outside the joint's range."""
    robot = scene.robot
    given = {target: parameter.value for parameter in scene.parameters.values() for target in parameter.sets}
    for part in scene.control:
        if not isinstance(part, PD) or part.target is None:
            continue
        for j in part.joints:
            aim = given.get(f"control.{part.name}.target.{j.name}", part.target[j.name])
            excess = max(robot.lower[j.q] - aim, aim - robot.upper[j.q])
            if excess > 0.0:
                unit = joint_unit(j, "position")
                degrees = unit == "rad" and (excess > FAR_OUT or abs(aim) > MOST_TURNED)
                yield (
                    f"control '{part.name}': its target of {aim:.6g} {unit} is outside the range of joint '{j.name}', "
                    f"{robot.lower[j.q]:.6g} to {robot.upper[j.q]:.6g} {unit}"
                    + (f"; were degrees meant? write '{aim:g} deg'" if degrees else "")
                )


def _paths(scene: Scene) -> list[str]:
    """Motions of the start, of controllers and of constraints whose frame moves along another path than is given."""
    parts = (*scene.control, *scene.constraints)
    followed = [scene.initial.motion, *(part.place.raw("motion", None) for part in parts)]
    return path_notes(scene, [name for name in followed if isinstance(name, str)])


def _signals(scene: Scene, duration: float) -> Iterator[str]:
    """Tables and motions that do not cover the run, and splines that overshoot."""
    parts: tuple[Force, ...] = (*scene.forces, *scene.control)
    for part in parts:
        if part.source is None:
            continue
        signal, table = part.source.signal, isinstance(part, Torque | Wrench)
        first, last = table_span(part) if table else (float(signal.breaks[0]), float(signal.breaks[-1]))
        first, last = first - scene.initial.clock, last - scene.initial.clock
        who = f"{part.owner} '{part.name}': its {'table' if table else 'motion'}"
        if last < duration:
            after = "the last value is held" if table else "the last posture is the target, at rest"
            moving = "" if table else _moving(signal, np.array([signal.breaks[-1]]))
            yield f"{who} ends at {last:.6g} s{moving} and the run at {duration:.6g} s; from then on {after}"
        if first > 0.0:
            before = "the first value is held" if table else "the first posture is the target, at rest"
            moving = "" if table else _moving(signal, np.array([signal.breaks[0]]))
            yield f"{who} begins at {first:.6g} s{moving}; until then {before}"
        if isinstance(part, Torque) and not signal.kinked:
            yield from _overshoot(who, signal, 0, f"values of {{}} {joint_unit(part.joint, 'torque')}")
        elif isinstance(part, Wrench) and not signal.kinked:
            for k, (name, unit) in enumerate(COMPONENTS.items()):
                yield from _overshoot(who, signal, k, f"{name} values of {{}} {unit}")


def _moving(signal: Signal, time: Array) -> str:
    """ ", moving, …" where the target's velocity jumps to or from rest there."""
    width = signal.coefficients.shape[2]
    if signal.derivatives == 0:
        return ""
    speeds, all_speeds = (np.abs(signal.at(t)[:, width : 2 * width]).max() for t in (time, signal.breaks))
    return f" while it still moves at up to {speeds:.4g} rad/s or m/s," if speeds > MOVING * all_speeds else ""


def _drives(scene: Scene, duration: float) -> Iterator[str]:
    """Prescribed motions that do not cover the run and are held; where they cannot be held, the run ends."""
    end = prescribed_motion_end(scene)
    until = duration if end is None else min(duration, end.time)
    for constraint in scene.constraints:
        if not isinstance(constraint, PrescribedMotion) or constraint.source is None:
            continue
        breaks = constraint.source.signal.breaks - scene.initial.clock
        if breaks[-1] < until:
            yield f"prescribed motion '{constraint.name}' ends at {breaks[-1]:.6g} s; then its last position is held"
        if 0.0 < breaks[0] <= until:
            yield (
                f"prescribed motion '{constraint.name}' begins at {breaks[0]:.6g} s; before, its first position is held"
            )


def _overshoot(who: str, signal: Signal, column: int, values: str) -> Iterator[str]:
    fine = np.linspace(signal.breaks[:-1], signal.breaks[1:], 17).T.ravel()
    rows, between = signal.at(signal.breaks)[:, column], signal.at(fine)[:, column]
    low, high = float(rows.min()), float(rows.max())
    if max(between.max() - high, low - between.min()) > OVERSHOOT * (high - low) > 0.0:
        far = float(between[np.abs(between).argmax()])
        yield (
            f"{who} has {values.format(f'{low:.4g} to {high:.4g}')}, and its cubic spline reaches {far:.4g} between "
            "them because rows are very close; interpolation: linear avoids it"
        )


def _events(scene: Scene) -> Iterator[str]:
    """Events whose function is not a number at the start."""
    if not scene.events:
        return
    q, v = consistent_start(scene)
    state = start_states(scene, q[None], v[None], system_parameters(scene))[0]
    inputs = scene.signals_at(np.zeros(1))[0]
    values = system_of(scene).events(np.zeros(1), state, inputs, system_parameters(scene))
    for event, value in zip(scene.events, np.atleast_1d(values).tolist(), strict=True):
        if math.isnan(value):
            yield (
                f"event '{event.name}': its function is not a number at the start; no event is detected while that is "
                "so"
            )


def _joints(names: list[str]) -> str:
    return f"joint{'s' if len(names) > 1 else ''} {', '.join(names)}"
