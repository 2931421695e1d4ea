"""The accelerations of idle rotations along a motion, and what holding them still would change.

The kinematics give the least joint rates of an idle rotation, as if something held it still. It turns freely instead:
its acceleration follows from its own equation of motion, on which no force but those of springs and friction acts
(motor_shares.py). The mass of a rod about its own axis is small, so that this hardly changes the motors' torques. Where
it does, the weight of what turns matters, and the motion is refused.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.dynamics.inverse.input_breakpoints import force_times
from bellcrank.dynamics.inverse.motor_shares import held_shares, motor_shares
from bellcrank.errors import InputError
from bellcrank.numerics import products

if TYPE_CHECKING:
    from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
    from bellcrank.motion.motion import Motion

MATTERS = 0.05  # of a motor's largest torque: a rotation that changes it by more is not idle


def freed_motion(linkage: Linkage, motion: Motion) -> Motion:
    """The motion with the accelerations of idle rotations that turn freely, and a note that says so.

    Raises InputError where holding them still would change the torque of a motor by more than 5 % of its largest.
    """
    idle = linkage.idle_rotations
    if not idle:
        return motion
    t, q, v, a = force_times(motion.time, motion.time[-1]), motion.position, motion.velocity, motion.acceleration
    jacobian = linkage.kinematics.terms(t, q, v).jacobian
    need = linkage.equations.needed(t, q, v, a)
    shares = motor_shares(linkage, q, jacobian, t)
    assert shares.idle is not None
    torque, held = products(shares.torques, need), products(held_shares(linkage, jacobian), need)
    largest = max(float(np.abs(torque).max()), float(np.abs(held).max()))
    change = float(np.abs(held - torque).max()) / largest if largest else 0.0
    turns = f"{len(idle)} idle rotation{'s' * (len(idle) > 1)}, which no motor drives: {'; '.join(map(str, idle))}"
    if change > MATTERS:
        raise InputError(
            f"motion '{motion.name}': the mechanism has {turns}; held still, they change motor torques by "
            f"{change:.2%} of the largest, so that how they turn matters: give such a joint a motor (actuated), fix "
            "it, or simulate the scene with prescribed motions of the motors, whose multipliers are the torques"
        )
    note = (
        f"motion '{motion.name}' leaves {turns}; they turn freely, from rest, with no force but those of springs and "
        f"friction; held still, they would change motor torques by {change:.2g} of the largest"
    )
    return replace(motion, acceleration=a + shares.idle.accelerations(need), notes=(*motion.notes, note))
