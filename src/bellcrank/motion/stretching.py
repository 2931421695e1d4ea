"""A motion in more or less time: the same positions, velocities divided by s and accelerations by s²."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bellcrank.motion.motion import Motion


def stretched(motion: Motion, factor: float) -> Motion:
    """The motion in `factor` times its time, which begins at the same time."""
    begin = motion.time[0]
    return replace(
        motion,
        time=begin + factor * (motion.time - begin),
        velocity=motion.velocity / factor,
        acceleration=motion.acceleration / factor**2,
        speed_noise=tuple(np.array(motion.speed_noise) / factor),
        forms=tuple(form.stretched(float(begin), factor) for form in motion.forms),
    )
