"""The dry friction of a drive's rotor, with the losses of its gear by the load (drives.py, gear_losses.py)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from bellcrank.elements.dry_friction import DryFriction, JointDryFriction
from bellcrank.elements.element import GeneralisedForce
from bellcrank.elements.expression import Expression, Term
from bellcrank.elements.joint_forces import NO_ROW, Shaft

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.drives import Drive
    from bellcrank.elements.element import AuxiliaryStates
    from bellcrank.elements.symbols import Symbols

LEAST_FRICTION: Final = 1e-7  # N m, far above rounding: what a gear with losses by load holds without load


@dataclass(frozen=True)
class RotorFriction(JointDryFriction):
    """The dry friction of a drive's rotor: at its own shaft behind an elastic gear, else at the joint."""

    drive: Drive = field(repr=False, kw_only=True)

    @property
    def rotor(self) -> tuple[AuxiliaryStates, int] | None:
        """The rotor's velocity among the states of the drive; None: it is none of them."""
        states = self.drive.auxiliary
        return (states, 1) if states is not None and self.drive.is_elastic else None

    @property
    def row(self) -> int:
        """The place of the joint's velocity in v; −1 where the rotor's is another one."""
        return NO_ROW if self.drive.has_own_rotor else super().row

    def shaft(self, symbols: Symbols) -> Shaft:
        """The rotor, or the joint."""
        if not self.drive.has_own_rotor:
            return super().shaft(symbols)
        inertia = symbols.zero + self.drive.value(symbols, "gear.inertia")
        states, ratio = self.drive.auxiliary, self.drive.gear["ratio"]
        assert states is not None
        row = symbols.robot.nv + symbols.auxiliary_place(states) + 1
        speed, elastic = self.drive.rotor(symbols)[1], self.drive.is_elastic
        own = (row, 1.0 / (inertia if elastic else ratio * inertia))
        return Shaft(speed, row if elastic else NO_ROW, inertia, own)

    @property
    def _scale(self) -> float:
        """Force at the shaft over torque at the rotor."""
        return 1.0 if self.drive.has_own_rotor else self.drive.gear["ratio"]

    def value(self, symbols: Symbols, name: str) -> casadi.SX | float:
        """A number at the shaft."""
        found = self.drive.value(symbols, f"loss.{name}")
        return found / self._scale if name == "speed" else found * self._scale

    @property
    def is_symmetric(self) -> bool:
        """Whether it holds as much in both directions."""
        return self.rotor is None and not self.has_load_side

    @property
    def has_load_side(self) -> bool:
        """Whether it is that of a rigid gear with losses by load, for which a run holds who drives."""
        return self.drive.loses_by_load and not self.drive.is_elastic

    @property
    def formulas(self) -> tuple[Expression, ...]:
        """1 while the motor drives the load of a rigid gear, else 0."""
        if not self.has_load_side:
            return ()
        drives = Term("step", (Term("gear load", value=self.drive.name),))
        return (Expression("", drives, repr(drives)),)

    def gain(self, symbols: Symbols) -> casadi.SX | float:
        """What reaches the joint of the motor's torque behind a rigid gear with losses by load, as a share.

        η while the motor drives the load, 1/η_b while the load drives the motor, and 1 at rest.
        """
        if not self.has_load_side or not symbols.held_sides:
            return 1.0
        direction, moves, *_ = (symbols.signal(self.mode)[k] for k in range(4))
        driving, driven = self.drive.loss_shares
        drives = self.formulas[0].value(symbols, None, symbols.sides(self))
        share = (1.0 / (1.0 + driving)) * drives + (1.0 / (1.0 - driven)) * (1.0 - drives)
        return 1.0 + moves * direction * direction * (share - 1.0)

    def limits(self, symbols: Symbols) -> tuple[casadi.SX, casadi.SX]:
        """The least and the largest force at rest: losses of the gear depend on the direction.

        At rest the force of a rigid gear is F = T + x, T being that of the motor and x that of friction, both at the
        joint. x cannot keep the joint from moving forwards below −(f + losses of F), f being the rotor's own friction.
        """
        import casadi

        most, least = super().limit(symbols), LEAST_FRICTION
        if not self.has_load_side:
            forward, backward = (
                (self.drive.load_loss(symbols, d) if self.drive.is_elastic else symbols.zero) for d in (1.0, -1.0)
            )
            return -casadi.fmax(most + forward, least), casadi.fmax(most + backward, least)
        driving, driven = self.drive.loss_shares
        torque, least = self._motor_force(symbols), self._scale * least
        forward, backward = (
            casadi.fmax(
                casadi.fmax((most + driving * along) / (1.0 + driving), (most - driven * along) / (1.0 - driven)), least
            )
            for along in (torque, -torque)
        )
        return -forward, backward

    def _motor_force(self, symbols: Symbols) -> casadi.SX:
        return self._scale * self.drive.torque(symbols)

    def beyond(self, symbols: Symbols) -> casadi.SX:
        """c, p and r (1, 3), with which the force falls while the load drives the motor: min(0, p − c a) forwards.

        r is that of max(0, r − c a) backwards. They follow from F = e (T_m − D a) less what it is with e = η, D being
        the rotor's inertia at the joint.
        """
        import casadi

        if not self.has_load_side:
            return super().beyond(symbols)
        driving, driven = self.drive.loss_shares
        excess = 1.0 / (1.0 - driven) - 1.0 / (1.0 + driving)
        moving = self._motor_force(symbols) - self._scale * self.drive.value(symbols, "loss.viscous") * (
            self._scale * symbols.joint(self.joint).velocity
        )
        loads = [moving + DryFriction.sliding(self, symbols, casadi.SX(way)) for way in (1.0, -1.0)]
        rotor = float(symbols.robot.rotor_inertia[self.joint.v])
        return casadi.horzcat(casadi.SX(excess * rotor), *[excess * load for load in loads])

    def gained(self, symbols: Symbols) -> casadi.SX | float:
        """The force (N m or N) that `gain` adds to that of the motor."""
        return (self.gain(symbols) - 1.0) * self._motor_force(symbols) if self.has_load_side else 0.0

    def sliding(self, symbols: Symbols, direction: casadi.SX) -> casadi.SX:
        """The force at the shaft while it turns in a direction, 1 or −1; without losses of a rigid gear by its load.

        Of such a gear at rest whose friction is at its limit in a direction: that limit.
        """
        force = super().sliding(symbols, direction)
        if self.drive.has_own_rotor and not self.drive.is_elastic:
            return force
        if self.drive.is_elastic:
            return force - direction * self.drive.load_loss(symbols, direction)
        if not self.has_load_side or not symbols.held_sides:
            return force
        moves, (least, most) = symbols.signal(self.mode)[1], self.limits(symbols)
        forward, backward = 0.5 * direction * (direction + 1.0), 0.5 * direction * (direction - 1.0)
        return moves * force + (1.0 - moves) * (forward * least + backward * most)

    def at_rotor(self, symbols: Symbols) -> casadi.SX:
        """The torque (N m) at the rotor while it turns; that of a stuck one follows from the equations of motion."""
        return self.sliding(symbols, self.direction(symbols)) / self._scale

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """None: it is part of the drive's."""
        return GeneralisedForce(symbols.joint_force(self.joint.v, 0.0), symbols.zero, symbols.zero, False)
