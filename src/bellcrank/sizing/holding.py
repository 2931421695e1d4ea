"""The largest torque that holds each motor's joint at rest, which is what a brake must hold."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.dynamics.force_table_breakpoints import force_breaks
from bellcrank.dynamics.open_chain_inverse_dynamics import OpenChain
from bellcrank.elements.dry_friction import DryFriction
from bellcrank.elements.joint_forces import Damper, Friction, JointSpring
from bellcrank.elements.joint_stops import JointStop
from bellcrank.elements.supply import Supply
from bellcrank.sizing.holding_gravity import gravity_holding_torques
from bellcrank.sizing.holding_scene_forces import scene_holding_torques
from bellcrank.sizing.holding_search import Holding
from bellcrank.sizing.maxima import maxima
from bellcrank.sizing.motion_grid import grid_along

if TYPE_CHECKING:
    from bellcrank.dynamics.mechanism import Mechanism
    from bellcrank.motion.motion import Motion

Array = NDArray[np.float64]


def holding_torques(mechanism: Mechanism, motions: Sequence[Motion], mass_tolerance: float) -> Holding:
    """The largest static torque (k,), N m or N, of each motor's joint, its position q (k, nq), and notes.

    Of an open chain over the ranges of all joints, with the forces of a scene over all times of their tables; of a
    closed linkage, whose joints have no independent ranges, over the positions and times of the motions.
    """
    if mechanism.closed:
        found = motion_holding_torques(mechanism, motions, mass_tolerance)
        note = "holding torques are the largest at the postures of the motions: the constraints tie the joints together"
        return Holding(found.joints, found.torque, found.position, (note,))
    assert isinstance(mechanism, OpenChain)
    resisting = Damper | Friction | DryFriction | JointStop | Supply
    acting = [force for force in mechanism.equations.forces if not isinstance(force, resisting)]
    if not acting:
        statics = mechanism if mechanism.equations.sets_tree else None
        return gravity_holding_torques(mechanism.robot, mass_tolerance=mass_tolerance, statics=statics)
    over_ranges = scene_holding_torques(mechanism, mass_tolerance)
    over_motions = motion_holding_torques(mechanism, motions, mass_tolerance)
    larger = over_motions.torque > over_ranges.torque  # joints without limits may go further than a turn
    notes = list(over_ranges.notes)
    for joint in mechanism.motors:
        limited = np.isfinite([mechanism.robot.lower[joint.q], mechanism.robot.upper[joint.q]]).all()
        springs = [force.name for force in acting if isinstance(force, JointSpring) and force.joint == joint]
        if not limited and springs and joint.kind == "revolute":
            notes.append(
                f"joint '{joint.name}' turns without limits: the holding torque includes spring '{springs[0]}' over "
                "one turn, and over the motions"
            )
    return Holding(
        over_ranges.joints,
        np.where(larger, over_motions.torque, over_ranges.torque),
        np.where(larger[:, None], over_motions.position, over_ranges.position),
        tuple(notes),
    )


def motion_holding_torques(mechanism: Mechanism, motions: Sequence[Motion], mass_tolerance: float) -> Holding:
    """The largest torque that holds each motor's joint at rest at a position of the motions, at its time."""

    def at_rest(t: Array, q: Array, v: Array, a: Array) -> dict[str, Array]:
        zero = np.zeros_like(v)
        torque = np.abs(mechanism.torques(t, q, zero, zero)[0])
        if mass_tolerance:
            torque = torque + mass_tolerance * np.abs(mechanism.link_torques(t, q, zero, zero)).sum(axis=1)
        return {"holding": torque}

    breaks = force_breaks(mechanism)
    found = [maxima(motion, grid_along(motion, None, breaks), at_rest)[1]["holding"] for motion in motions]
    torque = np.array([largest.value for largest in found])
    worst = torque.argmax(axis=0)
    position = np.array([motions[m].at(float(found[m].time[k]))[0] for k, m in enumerate(worst)])
    return Holding(tuple(joint.name for joint in mechanism.motors), torque.max(axis=0), position, ())
