"""The film of a scene's modes, one after the other: each moves about the operating point, loops kept closed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bellcrank.analysis.linearisation import Linearisation
from bellcrank.analysis.mode import Mode
from bellcrank.analysis.symmetries import project
from bellcrank.arrays import Array, Complex
from bellcrank.dynamics.constraints.constraint_rows import velocity_units
from bellcrank.dynamics.postures.consistent_start import displaced
from bellcrank.errors import InputError
from bellcrank.replays.film.arrows import SceneFrames, element_frames, scene_rods, scene_springs
from bellcrank.replays.film.camera import choose_camera, choose_ground
from bellcrank.replays.film.film import Film, TimelineEvent
from bellcrank.replays.film.film_samples import sample_frames
from bellcrank.replays.film.robot_view import camera_scene, film_axes, film_bodies, frame_origins, traced_frames
from bellcrank.replays.film.sampled_trajectory import SampledTrajectory, frame_pose_function
from bellcrank.version import version

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene

SECONDS = 6.0  # of the film for each mode
PERIODS = 3  # of an oscillation in that time
SAMPLES = 120  # postures of each mode
AMPLITUDE = 0.35  # rad or characteristic lengths: the largest displacement of a mode
SMALLER = (1.0, 0.5, 0.25, 0.1, 0.02)  # shares of it that are tried where loops cannot be closed
RANGE = 3.0  # a growth or decay by e³ is shown


def film_of_modes(scene: Scene, linear: Linearisation) -> Film:
    """The film of the modes of a linearised scene, SECONDS each: not to scale in time or amplitude.

    An oscillation is shown for PERIODS periods, growing or decaying at its own rate; a growth or decay by a factor e³.
    A steady motion is seen from the frame that moves along. Raises InputError where there is no mode.
    """
    modes = linear.modes
    if not modes:
        raise InputError(f"{linear.name}: there are no modes to show: the operating point is {linear.kind}")
    robot = scene.robot
    parts = [_postures(scene, linear, mode) for mode in modes]
    time = np.concatenate(
        [k * SECONDS + np.linspace(0.0, 1.0, SAMPLES, endpoint=False) * SECONDS for k in range(len(modes))]
    )
    position = np.concatenate([part for part, _ in parts])
    bodies, notes = film_bodies(robot, "reduced")
    traced = traced_frames(robot, ())
    frames = tuple(dict.fromkeys([*(body.name for body in bodies), *element_frames(scene), *traced]))

    def interpolate(t: Array) -> tuple[Array, Array]:
        found = np.stack([np.interp(t, time, column) for column in position.T], axis=1)
        return found, np.zeros((len(t), robot.nv))

    trajectory = SampledTrajectory(
        robot=robot,
        time=time,
        position=position,
        velocity=np.zeros((len(time), robot.nv)),
        interpolate=interpolate,
        frames=frames,
        pose_function=frame_pose_function(robot, frames, scene.parameters),
        parameters=scene.parameter_values,
    )
    sampled = sample_frames(
        trajectory, bodies, frame_origins(trajectory, traced), [k * SECONDS for k in range(len(modes))]
    )
    placed = SceneFrames(
        scene=scene, parameters=trajectory.parameters,
        state=np.hstack([sampled.position, np.zeros((len(sampled.time), robot.nv))]), frame_pose=sampled.frame_pose,
    )  # fmt: skip
    springs, rods = tuple(scene_springs(placed)), tuple(scene_rods(placed))
    ends = [*(spring.ends for spring in springs), *(rod.ends for rod in rods)]
    view = camera_scene(sampled, (), [each.reshape(-1, 3) for each in ends])
    small = [f"mode {k + 1}" for k, (_, share) in enumerate(parts) if share < 1.0]
    smaller = (f"smaller, as loops do not close further away: {', '.join(small)}",) if small else ()
    return Film(
        title=f"{scene.name}: modes",
        time=sampled.time,
        poses=sampled.poses,
        bodies=bodies,
        camera=choose_camera(view),
        error_bound=sampled.error_bound,
        ground=choose_ground([], view, not robot.floating_base),
        springs=springs,
        rods=rods,
        axes=film_axes(robot, bodies),
        events=tuple(TimelineEvent(k * SECONDS, f"mode {k + 1}: {mode_words(mode)}") for k, mode in enumerate(modes)),
        facts=(("operating point", linear.kind), ("modes", str(len(modes))), ("bellcrank", version())),
        success=linear.stable is not False,
        notes=(
            f"Each mode is shown for {SECONDS:g} s, not to scale in time and amplitude.",
            *smaller,
            *linear.notes,
            *notes,
        ),
    )


def mode_words(mode: Mode) -> str:
    """A mode in a few words, such as "oscillation, 0.498 Hz"."""
    if mode.oscillates:
        return f"{mode.kind}, {mode.frequency:.4g} Hz"
    return mode.kind if mode.time_constant is None else f"{mode.kind}, {mode.time_constant:.4g} s"


def _postures(scene: Scene, linear: Linearisation, mode: Mode) -> tuple[Array, float]:
    """Postures (SAMPLES, nq) of a mode that satisfy the constraints, and the share of AMPLITUDE that they reach."""
    unit = velocity_units(scene) if scene.constraints else np.ones(scene.robot.nv)
    history = np.outer(_course(mode), mode.displacement).real
    history *= AMPLITUDE / max(float(np.abs(history / unit).max(initial=0.0)), 1e-300)
    for share in SMALLER:
        try:
            return np.stack([_closed(scene, linear, share * step) for step in history]), share
        except InputError:
            continue
    return np.tile(linear.position, (SAMPLES, 1)), 0.0


def _course(mode: Mode) -> Complex:
    """The mode's factor (SAMPLES,) over its time in the film, at most 1."""
    share = np.linspace(0.0, 1.0, SAMPLES, endpoint=False)
    real, imaginary = mode.eigenvalue.real, mode.eigenvalue.imag
    if mode.oscillates:
        grown = np.clip(2.0 * np.pi * PERIODS * real / imaginary, -RANGE, RANGE)
        found = np.exp((grown + 2j * np.pi * PERIODS) * share)
        return np.asarray(found / np.abs(found).max())
    if real == 0.0:
        return np.asarray(np.sin(2.0 * np.pi * share) + 0j)
    return np.asarray(np.exp(RANGE * (share - 1.0 if real > 0.0 else -share)) + 0j)


def _closed(scene: Scene, linear: Linearisation, step: Array) -> Array:
    """The posture after a displacement, moved onto the constraints."""
    there = displaced(scene, linear.position, step)
    return project(scene, linear.time, there, linear.velocity)[0] if scene.constraints else there
