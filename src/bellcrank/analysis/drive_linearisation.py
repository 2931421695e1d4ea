"""Linear equations of scenes with drives, at rest in a posture in which the drives hold the robot.

States are the displacements and velocities of the joints, and the states of the drives.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bellcrank.analysis.independent_states import coordinate_names
from bellcrank.analysis.linearisation import EQUILIBRIUM, MOVING, Linearisation
from bellcrank.analysis.modal_analysis import Quotient, modes_of
from bellcrank.arrays import Array
from bellcrank.dynamics.inverse.drive_loops import (
    DriveEquations,
    drive_dynamics,
    refuse_nonlinear,
    smooth_scene,
    with_continuous_loops,
)
from bellcrank.notes import Note, ranked
from bellcrank.simulation.integration.drive_gains import tuned
from bellcrank.simulation.trajectory.scene_notes import file_notes

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene

STILL = 1e-9  # of the largest terms: rates below this are 0 at an equilibrium


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
