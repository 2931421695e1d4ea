"""What a run reaches that is not modelled: ranges of joints, floors, and friction that would hold a joint."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.elements.joint_forces import Friction
from bellcrank.notes import Note
from bellcrank.robot.formats.robot_file import ContactShape

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene
    from bellcrank.simulation.trajectory.trajectory import Trajectory

LIMIT_TOLERANCE = 1e-9  # rad, or of the larger end of a range in m, by which a joint may pass its limit
TOUCH = 1e-6  # m, by which a shape may be below a floor
SLIDING = 3.0  # widths of the smoothed friction: slower joints would be held
LEAST_MOTION = 1e-3  # rad or m: the smallest range of a coordinate that counts


def reached_notes(run: Trajectory) -> tuple[Note, ...]:
    """A note on each omission that a run reaches, with its first time and its size."""
    return (*left_ranges(run), *passed_floors(run), *creeping_joints(run))


def left_ranges(run: Trajectory) -> tuple[Note, ...]:
    """A note for each joint that starts within its range in the robot's file and leaves it."""
    notes = []
    for j in run.robot.joints:
        if j.nq != 1:
            continue
        q, lower, upper = run.position[:, j.q], float(run.robot.lower[j.q]), float(run.robot.upper[j.q])
        edge = LIMIT_TOLERANCE * (
            max(abs(lower), abs(upper)) if j.kind == "prismatic" and np.isfinite([lower, upper]).all() else 1.0
        )
        outside = (q < lower - edge) | (q > upper + edge)
        if not outside.any() or outside[0]:  # scene_notes has those that start outside
            continue
        unit = "m" if j.kind == "prismatic" else "rad"
        far = q[np.argmax(np.maximum(q - upper, lower - q))]
        time = float(run.time[outside.argmax()])
        text = (
            f"joint '{j.name}' leaves its range at {time:.4g} s: it reaches {far:.6g} {unit}, the URDF allows "
            f"{lower:.6g} to {upper:.6g} {unit}; joint limits are not enforced"
        )
        notes.append(Note(text, "reached", "limit", (j.name,), time=time))
    return tuple(notes)


def passed_floors(run: Trajectory) -> tuple[Note, ...]:
    """A note for each link with a shape that goes below a floor of the robot's file: contacts are not modelled."""
    file = run.scene.config.file
    if file is None or not file.contacts:
        return ()
    links = list(dict.fromkeys(shape.link for shape in file.contacts))
    frames = run.robot.equations.frames([run.robot.frame_index(link) for link in links])
    good = np.isfinite(run.position).all(axis=1)
    q, time = run.position[good], run.time[good]
    rows = np.array(frames.map(len(q))(q.T, np.zeros((run.robot.nv, len(q))), np.zeros((0, len(q))))).reshape(
        len(links), 18, len(q)
    )
    worst: dict[str, tuple[float, float, str, str]] = {}  # by link: first time, depth, shape and floor
    for shape in file.contacts:
        of_link = rows[links.index(shape.link)]
        place = np.array(shape.place)
        turn = of_link[3:12].T.reshape(-1, 3, 3)
        centre, axes = of_link[:3].T + turn @ place[:3, 3], turn @ place[:3, :3]
        for floor in (file.floors[k] for k in shape.floors):
            normal = np.array(floor.normal)
            height = (centre - np.array(floor.point)) @ normal - support(shape, axes.transpose(0, 2, 1) @ normal)
            below = height < -TOUCH
            if not below.any():
                continue
            first, depth = float(time[below.argmax()]), float(-height.min())
            before = worst.get(shape.link)
            if before is None or depth > before[1]:
                first = first if before is None else min(first, before[0])
                worst[shape.link] = (first, depth, shape.name, floor.name)
    return tuple(
        Note(
            f"link '{link}' goes through '{floor}' at {first:.4g} s, by up to {depth:.4g} m ('{shape}'): contacts are "
            "not modelled",
            "reached",
            "contact",
            time=first,
        )
        for link, (first, depth, shape, floor) in worst.items()
    )


def support(shape: ContactShape, direction: Array) -> Array:
    """The largest distance (n,) of points of a shape from its centre along unit directions (n, 3) in its own axes, m.

    Source: support functions of convex bodies, any text on convex geometry.
    """
    x, y, z = np.abs(direction).T
    size = shape.size
    if shape.kind == "sphere":
        return np.full(len(direction), size[0])
    if shape.kind == "capsule":
        return np.asarray(size[0] + size[1] * z)
    if shape.kind == "cylinder":
        return np.asarray(size[0] * np.hypot(x, y) + size[1] * z)
    if shape.kind == "box":
        return np.asarray(size[0] * x + size[1] * y + size[2] * z)
    return np.asarray(np.sqrt((size[0] * x) ** 2 + (size[1] * y) ** 2 + (size[2] * z) ** 2))


def creeping_joints(run: Trajectory) -> tuple[Note, ...]:
    """A note for each joint that Coulomb friction would hold, and that creeps, as the friction is smoothed.

    Its speed is then within a few widths of the smoothing. What counts is the way that it goes so, against the run's
    bound of errors.
    """
    notes = list[Note]()
    for j in run.robot.joints:
        if j.nv != 1 or j.nq != 1:
            continue
        width = _friction_width(run, j.name, j.v)
        if width == 0.0:
            continue
        q, v = run.position[:, j.q], run.velocity[:, j.v]
        slow = (np.abs(v) < SLIDING * width) & np.isfinite(v)
        held = slow[1:] & slow[:-1]
        steps = np.abs(np.diff(q)) * held
        bound = run.settings.error_bound * max(float(np.ptp(q[np.isfinite(q)])), LEAST_MOTION)
        way = _longest_way(steps, held)
        if way[0] <= bound:
            continue
        unit = "m" if j.kind == "prismatic" else "rad"
        time = float(run.time[way[1]])
        text = (
            f"joint '{j.name}' creeps by {way[0]:.3g} {unit} from {time:.4g} s on, where friction would hold it: "
            f"Coulomb friction is smoothed over {width:g} {unit}/s; a smaller width creeps less"
        )
        notes.append(Note(text, "reached", "friction", (j.name,), time=time))
    return tuple(notes)


def _friction_width(run: Trajectory, joint: str, v: int) -> float:
    """The largest width over which the Coulomb friction of a joint is smoothed; 0 where it has none.

    A width that the scene gives is its model of friction, and is not counted.
    """
    widths = [run.robot.friction_width] if run.robot.coulomb[v] else []
    for force in run.scene.forces:
        if isinstance(force, Friction) and force.joint.name == joint and force.coulomb and "width" not in force.place:
            widths.append(force.width)
    return max(widths, default=0.0)


def _longest_way(steps: Array, held: Mask) -> tuple[float, int]:
    """The longest way of a stretch of rows where the joint would be held, and the row where it begins."""
    best, begin, way = (-math.inf, 0), 0, 0.0
    for k, (step, on) in enumerate(zip(steps.tolist(), held.tolist(), strict=True)):
        if not on:
            begin, way = k + 1, 0.0
            continue
        way += step
        best = max(best, (way, begin), key=lambda one: one[0])
    return best


def may_reach(scene: Scene) -> bool:
    """Whether runs of a scene may reach something that is not modelled."""
    robot, file = scene.robot, scene.config.file
    limited = bool(np.isfinite(robot.lower).any() or np.isfinite(robot.upper).any())
    rubs = bool(robot.coulomb.any()) or any(isinstance(force, Friction) and force.coulomb for force in scene.forces)
    return limited or rubs or (file is not None and bool(file.contacts))
