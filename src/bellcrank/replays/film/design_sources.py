"""What the film of a study shows of one design: a run of a scene, or a motion over which it was sized."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.replays.film.arrows import SceneFrames
from bellcrank.replays.film.film import TimelineEvent
from bellcrank.replays.film.film_samples import FramePose
from bellcrank.replays.film.motion_film import MotionSequence, motion_trajectories
from bellcrank.replays.film.run_film import finite_rows, output_frames, run_trajectory
from bellcrank.sizing.joint_histories import SizingInputs

if TYPE_CHECKING:
    from bellcrank.replays.film.sampled_trajectory import SampledTrajectory
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene
    from bellcrank.simulation.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class DesignSource:
    """One design.

    Attributes:
        robot: Its robot.
        scene: Its scene; None where there is none.
        parameters: Values of the scene's parameters.
        trajectory: Its motion, with the poses of these frames.
        events: What is marked on the time line.
        traced: The frames that are traced by default.
    """

    robot: Robot
    scene: Scene | None
    parameters: Array
    trajectory: Callable[[tuple[str, ...]], SampledTrajectory]
    events: tuple[TimelineEvent, ...] = ()
    traced: tuple[str, ...] = ()

    def frames(self, position: Array, frame_pose: FramePose) -> SceneFrames | None:
        """What springs and rods are drawn from, at positions (n, nq)."""
        if self.scene is None:
            return None
        return SceneFrames(scene=self.scene, parameters=self.parameters, state=position, frame_pose=frame_pose)


def design_source(result: Trajectory | SizingInputs) -> DesignSource:
    """A design that was simulated, or is sized: then its first motion is shown."""
    if isinstance(result, SizingInputs):
        mechanism, motions, _ = result
        scene = mechanism.scene
        sequence = MotionSequence(mechanism=mechanism, motions=motions[:1], actuators={})
        return DesignSource(
            robot=mechanism.robot,
            scene=scene,
            parameters=np.zeros(0) if scene is None else scene.parameter_values,
            trajectory=lambda frames: motion_trajectories(sequence, frames)[0],
        )
    run = result
    return DesignSource(
        robot=run.robot,
        scene=run.scene,
        parameters=run.parameters,
        trajectory=lambda frames: run_trajectory(run, finite_rows(run), frames),
        events=tuple(TimelineEvent(event.time, event.name) for event in run.events),
        traced=output_frames(run),
    )
