"""The losses of rigid gears that depend on their load, which follows from the accelerations.

With the motor's torque T_m less the rotor's friction, the rotor's inertia J and the ratio N, a rigid gear exerts on its
joint the force

    F = e (N T_m − N² J q̈),    e = η while F q̇ > 0 (the motor drives the load), 1/η_b while F q̇ < 0,

which is 0 on both sides where it changes its sign, so that e changes without a jump of the accelerations. A run holds
which side it is (`RotorFriction.gain`). Within one side the equations of motion are those without losses with

    M + diag((e − 1) N² J)    and    τ + (e − 1) N T_m,

M having N² J on its diagonal. As N² J is at most M, and η_b > 0, the matrix is positive definite and the sides of all
gears are unique. At rest e is 1, and the losses are part of the limits of dry friction (drives.py). In an impact a gear
has no losses. The losses are those of the judge of motors (actuators/powertrain.py).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bellcrank.elements.drives import Drive
from bellcrank.elements.rotor_friction import RotorFriction

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols
    from bellcrank.scene.scene import Scene


@dataclass(frozen=True)
class GearLosses:
    """The rigid gears of a scene with losses by load.

    Attributes:
        parts: Their drives, with the friction of the rotors.
        share: e − 1 of each joint (nv); 0 for others.
        rotor: N² J (nv), kg m² or kg.
        torque: N T_m (nv), N m or N.
    """

    parts: tuple[tuple[Drive, RotorFriction], ...]
    share: casadi.SX
    rotor: casadi.SX
    torque: casadi.SX

    @classmethod
    def of(cls, scene: Scene, s: Symbols) -> GearLosses | None:
        """Those of a scene in a run; None where it has none."""
        import casadi

        pairs = ((drive, drive.friction) for drive in scene.drives)
        parts = tuple((drive, part) for drive, part in pairs if part is not None and part.has_load_side)
        if not parts:
            return None
        share, torque = casadi.SX(scene.robot.nv, 1), casadi.SX(scene.robot.nv, 1)
        for drive, friction in parts:
            share[drive.joint.v] = friction.gain(s) - 1.0
            torque[drive.joint.v] = drive.generalised_force(s).force[drive.joint.v]
        return cls(parts, share, casadi.SX(scene.robot.rotor_inertia), torque)

    def mass(self, mass: casadi.SX) -> casadi.SX:
        """The mass matrix with e N² J in place of N² J."""
        import casadi

        return casadi.SX(mass + casadi.sparsify(casadi.diag(self.share * self.rotor)))

    @property
    def force(self) -> casadi.SX:
        """What is added to the joint forces (nv) beside `mass`."""
        return self.share * self.torque

    def lost(self, acceleration: casadi.SX) -> casadi.SX:
        """The forces (nv) of the losses at accelerations (nv), against the motion: F less N T_m − N² J q̈."""
        return self.share * (self.torque - self.rotor * acceleration)

    def set_forces(self, acceleration: casadi.SX, s: Symbols) -> None:
        """Make known the forces of the losses, and the functions that are positive while the motor drives the load."""
        lost = self.lost(acceleration)
        for drive, friction in self.parts:
            row = drive.joint.v
            s.holding[drive.name] = lost[row]
            direction, moves, *_ = (s.signal(friction.mode)[k] for k in range(4))
            (side,) = s.sides(friction).values()
            load, turns = self.torque[row] - self.rotor[row] * acceleration[row], moves * direction
            s.gear_loads[drive.name] = turns * load + (1.0 - turns * turns) * side
