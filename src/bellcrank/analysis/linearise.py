"""`linearise`: a scene's linear equations about an operating point.

States are the displacements and velocities of the joints, and the states of the drives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank import arguments
from bellcrank.analysis.linearisation import EQUILIBRIUM, MOVING, STEADY_MOTION, Linearisation
from bellcrank.analysis.modes import Quotient, modes_of
from bellcrank.analysis.operating_point import (
    OperatingPoint,
    coordinate_names,
    independent_states,
    operating_point,
    relaxed_point,
    state_names,
    state_units,
    steady_point,
)
from bellcrank.analysis.symmetries import states_nearby, symmetries_of
from bellcrank.arrays import Array
from bellcrank.dynamics.equations.linear_equations import equation_code
from bellcrank.dynamics.inverse.drive_loops import (
    DriveEquations,
    drive_dynamics,
    refuse_nonlinear,
    smooth_scene,
    with_continuous_loops,
)
from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.dynamics.postures.posture_search import motors_of
from bellcrank.elements.joint_forces import Friction
from bellcrank.errors import InputError
from bellcrank.files.access import Trust
from bellcrank.messages import format_value, unknown_name
from bellcrank.notes import Note, ranked
from bellcrank.scene.load import given_scene
from bellcrank.scene.scene import Scene
from bellcrank.simulation.integration.automatic_gains import tuned
from bellcrank.simulation.simulate import simulate
from bellcrank.simulation.trajectory.scene_notes import file_notes
from bellcrank.simulation.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot, RobotJoint


STILL = 1e-9  # of the largest terms: rates below this are 0 at an equilibrium
Names = tuple[tuple[str, str], ...]
AT = ("start", "equilibrium", "steady")
SAME_TIME = 1e-9  # s
NEARBY = 0.05  # of the largest velocity: a steady motion that differs more from the start is said to be another one
INVARIANT = 1e-8  # of the largest entry: an output that changes less along symmetries does not depend on them


def linearise_drives(scene: Scene, time: float, position: Array) -> Linearisation:
    """The linear equations of a scene with drives, at rest in a posture (nq,). Raises InputError."""
    refuse_nonlinear(scene)
    scene = tuned(scene)
    drives, robot, t = scene.drives, scene.robot, np.array([time])
    smooth = smooth_scene(scene)
    equations = DriveEquations(with_continuous_loops(smooth), t, position)
    keep = equations.varying
    a = equations.columns(equations.field[keep])
    size = sum(k < robot.nv for k in keep)
    names = [*coordinate_names(robot)]
    names += [(f"{name} rate", f"{unit}/s") for name, unit in names]
    states = [(f"{own.name} {label.rpartition(' [')[0]}", label.rpartition(" [")[2][:-1])
              for own in with_continuous_loops(smooth).auxiliary_states for label in own.labels]  # fmt: skip
    named = [*names, *states]
    quotient = Quotient.of(np.zeros((len(keep), 0)), size, np.ones(len(keep)))
    rest = equations.residual < STILL
    modes = modes_of(a, quotient, np.eye(len(keep))[:size], reduced=False) if rest else ()
    joints = [joint for joint in robot.joints if joint.nv == 1]
    inputs = [(f"{drive.joint.name} motor torque", "N m") for drive in drives]
    inputs += [(f"{j.name} {'force' if j.kind == 'prismatic' else 'torque'}", "N" if j.kind == "prismatic" else "N m")
               for j in joints]  # fmt: skip
    notes = [
        *file_notes(scene),
        Note("linear equations leave out dry friction, stops, and the losses and backlash of gears"),
    ]
    if any(drive.has_hysteresis for drive in drives):
        notes.append(Note("linear equations take the hysteresis of gears as a spring, as small motions do"))
    if any(drive.servo is not None and drive.cascade is None for drive in drives):
        notes.append(
            Note("the matrices leave out servos of kind state_space; margins and bandwidths of the drives do not")
        )
    if any(drive.cascade is not None and drive.cascade.samples for drive in drives):
        notes.append(
            Note(
                "the matrices take sampled loops as continuous, without delay; margins and bandwidths of the drives "
                "take their samples exactly"
            )
        )
    return Linearisation(
        name=scene.name,
        kind=EQUILIBRIUM if rest else MOVING,
        time=time,
        position=position,
        velocity=np.zeros(robot.nv),
        states=tuple(named[k] for k in keep),
        inputs=tuple(inputs),
        outputs=tuple(named[k] for k in keep),
        A=a,
        B=equations.inputs[np.ix_(keep, [*range(len(drives)), *(len(drives) + joint.v for joint in joints)])],
        C=np.eye(len(keep)),
        D=np.zeros((len(keep), len(inputs))),
        modes=modes,
        symmetries=(),
        symmetries_removed=False,
        residual=equations.residual,
        notes=ranked(tuple(notes)),
        drives=tuple(drive_dynamics(smooth, drive, t, position) for drive in smooth.drives),
    )


@arguments.named
def linearise(
    scene: Scene | Robot | Trajectory | str | Path,
    at: str | float | None = None,
    *,
    inputs: Sequence[str] | None = None,
    keep_symmetries: bool | None = None,
    overrides: Mapping[str, Any] | None = None,
    trust: Trust = (),
) -> Linearisation:
    """Linearise a scene's equations of motion about an operating point.

    With the position q ⊕ δ (a small displacement δ, in the axes of v), the equations v̇ = F(q, v, τ) are differentiated
    exactly, by implicit differentiation of the equations with their multipliers. Constraints are eliminated:
    positions by the holonomic rows, velocities by all rows.

    A steady motion (a wheel that rolls straight or round a circle) is a relative equilibrium: it moves along a
    symmetry of the equations, and its A holds in the frame that moves along. Symmetries are found from the
    equations. Their directions are then left out of the states, unless `keep_symmetries`.

    Args:
        scene: A scene, the path or name of one, or a run.
        at: "equilibrium", the nearest equilibrium to the scene's start, at rest; "steady", the nearest steady motion to
            the start; "start", the start as it is; or a time, s, of a run. By default "steady" where the start moves
            and a steady motion is found, else "equilibrium".
        inputs: Names of the joints whose torque or force is an input; by default those with motors, or all joints of
            one degree of freedom where none has one.
        keep_symmetries: Whether states along symmetries are kept; by default for equilibria only.
        overrides: Changes of the scene by dotted path, such as {"initial.crank": "1.5 deg"}.
        trust: Where `scene` is a file, folders whose files it may name, besides those near it.

    Returns:
        A, B, C and D with names, and the modes. The outputs are those of the scene, or all joints where it has none;
        outputs that change along symmetries that are left out are left out too, which `notes` says.

    Raises:
        InputError: There is no equilibrium or steady motion near the start, or an argument is wrong.

    Example:
        >>> import bellcrank as bc
        >>> linear = bc.linearise("pendulum")
        >>> [name for name, unit in linear.states], linear.eigenvalues.round(4).tolist()
        (['swing', 'swing rate'], [3.1321j, -3.1321j])
    """
    run = scene if isinstance(scene, Trajectory) else None
    if run is not None and overrides:
        raise InputError("applies only to scenes; change the scene before the run", argument="overrides")
    scene = given_scene(scene.scene if isinstance(scene, Trajectory) else scene, overrides, trust)
    if scene.drives:
        return linearise_drives(scene, *_held_posture(scene, run, at))
    joints = _input_joints(scene, inputs)
    if keep_symmetries is not None:
        keep_symmetries = arguments.flag("keep_symmetries", keep_symmetries)
    point = _point(scene, run, at)
    _check_regular(point)
    linear = linear_equations(point, joints, keep_symmetries)
    return linear if isinstance(at, str | float | int) and at not in AT[1:] else _with_distance(linear, point, run)


def _held_posture(scene: Scene, run: Trajectory | None, at: str | float | None) -> tuple[float, Array]:
    """The time and the posture in which drives hold the robot. Raises InputError."""
    if arguments.is_number(at):
        time, q, _ = _state_at(scene, run, arguments.number("at", at, "s", least=0.0))
        return time, q
    if at not in (None, "start", "equilibrium"):
        raise InputError(f"argument 'at': drives hold the robot at rest: expected 'start' or a time (s), found {at!r}")
    return 0.0, run.position[0] if run is not None else consistent_start(scene)[0]


def _check_regular(point: OperatingPoint) -> None:
    """Raise InputError where the constraints lose rank at the operating point, where linear equations do not hold."""
    scene, rank = point.symmetries.scene, point.equations.solver.rank
    nearby = max(state.solver.rank for state in states_nearby(scene, point.time, point.position, point.velocity))
    if rank < nearby:
        raise InputError(
            f"{scene.source}: the operating point is a singular posture: {rank} conditions of the constraints are "
            f"independent there, {nearby} nearby; linear equations do not describe the motion; start elsewhere"
        )


def _with_distance(linear: Linearisation, point: OperatingPoint, run: Trajectory | None) -> Linearisation:
    """With a note where a steady motion that was searched for is not near the start."""
    scene = point.symmetries.scene
    if point.at_rest or not point.steady:
        return linear
    v = run.velocity[0] if run is not None else consistent_start(scene)[1]
    change = np.abs(point.velocity - v) / state_units(scene)
    if change.max(initial=0.0) <= NEARBY * np.abs(v / state_units(scene)).max(initial=0.0):
        return linear
    name = coordinate_names(scene.robot)[int(np.argmax(change))][0]
    note = f"the steady motion found is not near the start: most of all, the velocity of {name} differs"
    return replace(linear, notes=ranked((*linear.notes, note)))


def linear_equations(point: OperatingPoint, joints: Sequence[RobotJoint], keep: bool | None) -> Linearisation:
    """The linear equations at an operating point, the torques of some joints being the inputs."""
    scene = point.symmetries.scene
    kind = MOVING if not point.steady else EQUILIBRIUM if point.at_rest else STEADY_MOTION
    states = independent_states(point)
    rows, embedding = states.rows, states.embedding
    a = point.linear_field[rows] @ embedding
    by_torque = point.equations.solved_by("torque")[0][:, [joint.v for joint in joints]]
    b = np.concatenate([np.zeros((len(states.positions), len(joints))), by_torque[list(states.velocities)]])
    fields = point.fields
    directions = np.concatenate([fields.displacement, fields.change])[rows]
    units = np.tile(state_units(scene), 2)[rows]
    quotient = Quotient.of(directions, len(states.positions), units)
    removed = kind == STEADY_MOTION if keep is None else not keep
    outputs, c, d = _outputs(point, joints)
    c = c @ embedding
    notes = _notes(scene)
    if removed and point.symmetries.count:
        varies = np.abs(c @ quotient.directions).max(axis=1, initial=0.0) > INVARIANT * np.abs(c).max(initial=0.0)
        if varies.any():
            gone = ", ".join(name for (name, _), out in zip(outputs, varies, strict=True) if out)
            notes += (Note(f"outputs that change along symmetries are left out: {gone}"),)
        fixed = np.flatnonzero(~varies)
        outputs, c, d = tuple(outputs[k] for k in fixed), c[fixed], d[fixed]
    reduce = removed and point.symmetries.count > 0
    modes = modes_of(a, quotient, embedding[: len(point.velocity)], reduced=reduce) if point.steady else ()
    kept = quotient.kept if reduce else list(range(len(a)))
    names = state_names(scene, states)
    return Linearisation(
        name=scene.name,
        kind=kind,
        time=point.time,
        position=point.position,
        velocity=point.velocity,
        states=tuple(names[k] for k in kept),
        inputs=tuple((f"{joint.name} {what}", unit) for joint in joints for what, unit in [_effort(joint)]),
        outputs=outputs,
        A=quotient.field(a) if reduce else a,
        B=quotient.projection @ b if reduce else b,
        C=c[:, kept],
        D=d,
        modes=modes,
        symmetries=point.symmetries.names,
        symmetries_removed=reduce,
        residual=point.residual,
        notes=notes,
    )


def _point(scene: Scene, run: Trajectory | None, at: str | float | None) -> OperatingPoint:
    """The operating point that `at` asks for. Raises InputError where there is none."""
    if arguments.is_number(at):
        time, q, v = _state_at(scene, run, arguments.number("at", at, "s", least=0.0))
        return operating_point(scene, time, q, v, symmetries_of(scene, time, q, v))
    if isinstance(at, str) and at not in AT:
        raise InputError(f"argument 'at': {unknown_name('choice', at, AT)}, or a time (s)")
    if at is not None and not isinstance(at, str):
        arguments.refuse("at", f"{', '.join(map(repr, AT))} or a time (s)", at)
    q, v = (run.position[0], run.velocity[0]) if run is not None else consistent_start(scene)
    wanted = ("steady" if v.any() else "equilibrium") if at is None else at
    if wanted == "start":
        return operating_point(scene, 0.0, q, v, symmetries_of(scene, 0.0, q, v))
    found = None
    if wanted == "steady":
        found = steady_point(operating_point(scene, 0.0, q, v, symmetries_of(scene, 0.0, q, v)))
        slow = np.abs(found.velocity / state_units(scene)).max(initial=0.0) <= STILL
        if found.steady and not slow:
            return found
    if wanted == "equilibrium" or at is None:
        q, v = (q if found is None or not found.steady else found.position), np.zeros_like(v)
        rest = operating_point(scene, 0.0, q, v, symmetries_of(scene, 0.0, q, v))
        found = steady_point(rest)
        if not found.steady:  # Newton's method needs a start that is near; a descent leads to a stable equilibrium
            found = steady_point(relaxed_point(rest))
        if found.steady:
            return found
    what = {None: "equilibrium or steady motion", "steady": "steady motion"}.get(at, "equilibrium")
    share = "" if found is None or found.steady else f" (residual {found.residual:.2g} of the equations' terms)"
    raise InputError(
        f"{scene.source}: no {what} was found near the start{share}; start nearer to one (initial: …), or linearise at "
        "'start' or at a time of a run"
    )


def _state_at(scene: Scene, run: Trajectory | None, time: float) -> tuple[float, Array, Array]:
    """The time and state of a run at a time; the scene is simulated up to it where there is no run yet."""
    if run is None:
        if time == 0.0:
            return 0.0, *consistent_start(scene)
        run = simulate(scene, duration=time, samples=2)
    k = int(np.argmin(np.abs(run.time - time)))
    if abs(run.time[k] - time) > SAME_TIME * max(time, 1.0):
        raise InputError(
            f"argument 'at': the run has no row at {time:g} s; the nearest is at {format_value(float(run.time[k]))} s "
            f"(it ends at {run.time[-1]:g} s: {run.status})"
        )
    return float(run.time[k]), run.position[k], run.velocity[k]


def _input_joints(scene: Scene, names: Sequence[str] | None) -> list[RobotJoint]:
    joints = {joint.name: joint for joint in scene.robot.joints if joint.nv == 1}
    if names is None:
        motors = [name for name in motors_of(scene) if name in joints]
        return [joints[name] for name in motors] if motors else list(joints.values())
    listed = arguments.several("inputs", names, str, "names of joints")
    for name in listed:
        if name not in joints:
            raise InputError(f"argument 'inputs': {unknown_name('joint', name, joints)}")
    return [joints[name] for name in dict.fromkeys(listed)]


def _effort(joint: RobotJoint) -> tuple[str, str]:
    return ("force", "N") if joint.kind == "prismatic" else ("torque", "N m")


def _outputs(point: OperatingPoint, joints: Sequence[RobotJoint]) -> tuple[Names, Array, Array]:
    """The outputs, and their derivatives by all (δ, v) and by the inputs, v̇ and λ following from these."""
    scene, at, nv = point.symmetries.scene, point.equations, len(point.velocity)
    columns = [joint.v for joint in joints]
    if not scene.outputs:
        own = [joint for joint in scene.robot.joints if joint.nv == 1]
        names = coordinate_names(scene.robot)
        found = [names[j.v] for j in own] + [(f"{j.name} rate", f"{names[j.v][1]}/s") for j in own]
        rows = [j.v for j in own] + [nv + j.v for j in own]
        return tuple(found), np.eye(2 * nv)[rows], np.zeros((len(rows), len(joints)))
    _, slopes = equation_code(scene).outputs_at(point.time, point.position, point.velocity, at)

    def total(direction: str) -> Array:
        acceleration, multipliers = at.solved_by(direction)
        return slopes[direction] + slopes["acceleration"] @ acceleration + slopes["multipliers"] @ multipliers

    labels = [label for output in scene.outputs.values() for label in output.labels]
    parts = [label.removesuffix("]").rpartition(" [") for label in labels]
    titles = tuple((title, unit) for title, _, unit in parts)
    return titles, np.hstack([total("position"), total("velocity")]), total("torque")[:, columns]


def _notes(scene: Scene) -> tuple[Note, ...]:
    """What a linear model does not tell of this scene."""
    rough = [force.name for force in scene.forces if isinstance(force, Friction) and force.coulomb]
    told = ranked(file_notes(scene))
    if scene.robot.coulomb.any() or rough:
        return (
            *told,
            Note(
                "Coulomb friction is smoothed within a small velocity; at rest its slope there is a large viscous "
                "coefficient, and a joint may stay where it is although the linear equations say that it creeps"
            ),
        )
    return told
