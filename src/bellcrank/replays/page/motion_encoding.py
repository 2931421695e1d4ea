"""The motions of several designs as a page carries them, for the bodies, springs and rods of one film."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from bellcrank.motion.kinematics.quaternions import make_continuous
from bellcrank.replays.film.design_film import FilmedMotion
from bellcrank.replays.film.film import Film
from bellcrank.replays.page.array_encoding import ArrayEncoder
from bellcrank.replays.page.film_encoding import reach_of, rounding_of

UNSTRETCHED = 1e-9


def encode_motions(film: Film, motions: Sequence[FilmedMotion], arrays: ArrayEncoder) -> list[dict[str, Any]]:
    """Motions as `showMotion` of the page's view takes them, with references to arrays.

    Positions and rotations are rounded as those of the film.
    """
    rounding = rounding_of(film)
    step = rounding / np.sqrt(3.0)
    turn_step = rounding / (4.0 * max(reach_of(film), rounding))
    found = []
    for motion in motions:
        quaternions = motion.poses[:, :, 3:] / np.linalg.norm(motion.poses[:, :, 3:], axis=2, keepdims=True)
        stretched = np.abs(motion.stretch - np.eye(3)).max(axis=(1, 2)) > UNSTRETCHED
        found.append(
            {
                "time": arrays.add_times(motion.time),
                "positions": arrays.add_fixed_point(motion.poses[:, :, :3], step),
                "quaternions": arrays.add_fixed_point(make_continuous(quaternions), turn_step),
                "stretch": [[int(k), _short(motion.stretch[k].ravel())] for k in np.flatnonzero(stretched)],
                "springs": [arrays.add_fixed_point(spring.ends, step) for spring in motion.springs],
                "rods": [arrays.add_fixed_point(rod.ends, step) for rod in motion.rods],
                "events": [{"time": event.time, "text": event.text} for event in motion.events],
            }
        )
    return found
