"""The start of a scene written out in numbers, for the scene inside a saved run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.dynamics.consistent_start import consistent_start

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene


def explicit_start(scene: Scene) -> dict[str, Any]:
    """The keys `initial` and `base` of a scene with the numbers of its consistent start, SI units."""
    q, v = consistent_start(scene)
    initial: dict[str, Any] = {"velocity": {}}
    found: dict[str, Any] = {}
    for k, j in enumerate(scene.robot.joints):
        position, velocity = q[j.q : j.q + j.nq].tolist(), v[j.v : j.v + j.nv].tolist()
        if j.nv == 1:
            initial[j.name], initial["velocity"][j.name] = position[0], velocity[0]
            continue
        size = 3 if j.kind == "floating" else 2
        free = {"position": position[:size], "linear_velocity": velocity[:size], "expressed_in": "body"}
        if j.kind == "floating":
            free |= {"quaternion_xyzw": position[size:], "angular_velocity": velocity[size:]}
        else:
            free |= {"angle": float(np.arctan2(position[3], position[2])), "angular_velocity": velocity[size]}
        if scene.robot.floating_base and k == 0:
            found["base"] = free
        else:
            initial[j.name] = free
    if scene.initial.clock:
        initial["clock"] = scene.initial.clock
    return found | {"initial": initial}
