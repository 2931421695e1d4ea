"""Rolling contact: a thin disk or wheel that rolls without slip on a plane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Self

from bellcrank.config.fields import Fields
from bellcrank.elements.constraint import Constraint, ReadContext, Residual
from bellcrank.elements.element import POSITIVE, Settable, read_frame
from bellcrank.elements.loop_constraints import read_direction
from bellcrank.robot.robot import Robot

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols


@dataclass(frozen=True)
class RollingDisk(Constraint):
    """A thin disk rolls without slip on a plane.

    The disk has its centre c at the frame's origin, the unit `axis` a (in the frame's axes) and the `radius` r (m); the
    plane has the unit `normal` n and the distance `height` (m) from the world's origin. With s = |a × n|, the disk
    rolls along f = (a × n)/s, and the lowest point of its rim is p = c − r (n − (n·a) a)/s. φ = c·n − height − r s
    keeps p on the plane (holonomic). ψ is the velocity of p in the plane along f and n × f: v·f − r ω·a, and
    v·(n × f) + r s ω·f (non-holonomic). The multipliers are the normal force and the two components of friction on the
    disk, N.

    The simulation ends where the normal force becomes negative, unless `two_sided` allows it (as on a rail), and where
    the disk lies flat. Source of the velocity condition: A. Ghosal, NPTEL 2022, lecture 18.
    """

    frame: str
    radius: float
    axis: tuple[float, ...]
    normal: tuple[float, ...]
    height: float
    two_sided: bool
    kind: ClassVar[str] = "rolling_disk"

    @classmethod
    def read(cls, name: str, read: Fields, context: ReadContext) -> Self:
        """Read the constraint from its entry. Raises InputError naming file and key."""
        axis = read_direction(read, "axis", (0.0, 1.0, 0.0))
        normal = read_direction(read, "normal", (0.0, 0.0, 1.0))
        radius, height = read.number("radius", "m", positive=True), read.number("height", "m", 0.0)
        return cls(
            name, read, read_frame(read, context.robot), radius, axis, normal, height, read.flag("two_sided", False)
        )

    @property
    def settable(self) -> dict[str, Settable]:
        """Radius and height can be set."""
        return {"radius": Settable("m", POSITIVE), "height": Settable("m")}

    @property
    def frames(self) -> tuple[str, ...]:
        """The disk's frame."""
        return (self.frame,)

    def residual(self, symbols: Symbols) -> Residual:
        """The normal residual, and two tangential velocities."""
        import casadi

        disk, _ = symbols.local_frame(self.frame)
        radius, height = self.value(symbols, "radius"), self.value(symbols, "height")
        n, a, forward, steepness = self._directions(symbols)
        residual = casadi.dot(casadi.DM(self.normal), symbols.frame(self.frame).position) - height - radius * steepness
        # n × f = (a − (n·a) n)/s
        sideways = (casadi.dot(a, disk.linear) - casadi.dot(n, a) * casadi.dot(n, disk.linear)) / steepness
        slip = casadi.vertcat(
            casadi.dot(forward, disk.linear) / steepness - radius * casadi.dot(a, disk.angular),
            sideways + radius * casadi.dot(forward, disk.angular),
        )
        return Residual(residual, slip)

    def lengths(self, symbols: Symbols) -> casadi.SX:
        """The radius."""
        import casadi

        return casadi.SX(self.value(symbols, "radius"))

    def contact_point(self, symbols: Symbols) -> casadi.SX:
        """The lowest point of the rim (3), m, in the world."""
        import casadi

        n, a, _, steepness = self._directions(symbols)
        up = symbols.local_frame(self.frame)[1] @ (n - casadi.dot(n, a) * a)
        return symbols.frame(self.frame).position - self.value(symbols, "radius") / steepness * up

    def steepness(self, symbols: Symbols) -> casadi.SX:
        """s, the sine of the angle between axis and normal: 1 if the disk is upright, 0 if it lies flat."""
        return self._directions(symbols)[3]

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """The normal force and the friction that the plane exerts on the disk."""
        return ("normal [N]", "friction forwards [N]", "friction sideways [N]")

    def _directions(self, symbols: Symbols) -> tuple[casadi.SX, casadi.SX, casadi.SX, casadi.SX]:
        """n, a and s f in the frame's local axes, and s."""
        import casadi

        disk, axes = symbols.local_frame(self.frame)
        n, a = axes.T @ casadi.DM(self.normal), disk.rotation @ casadi.DM(self.axis)
        across = casadi.cross(a, n)  # this keeps s accurate where the disk nearly lies flat
        return n, a, across, casadi.sqrt(casadi.dot(across, across))
