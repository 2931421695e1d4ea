"""Rolling contact: a thin disk or wheel on a plane, whose lowest point does not move."""

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

    The disk has its centre c at the frame's origin, the `axis` a (frame's axes) and a `radius` r (m); the plane has the
    unit `normal` n and lies `height` (m) along it. With s = |a × n|, the disk heads along f = (a × n)/s, and the rim's
    lowest point is p = c − r (n − (n·a) a)/s. φ = c·n − height − r s keeps it on the plane (holonomic). ψ is the
    velocity of p forwards and sideways, along f and n × f in the plane: v·f − r ω·a, and v·(n × f) + r s ω·f
    (non-holonomic). The multipliers are the normal force and the components of friction that the plane exerts on the
    disk, N. A plane cannot pull, so the run ends where the normal force passes zero, unless `two_sided` says that it
    may, as a rail does; and it ends where the disk comes to lie flat. Source: A. Ghosal, NPTEL 2022, lecture 18, for
    the velocity condition.
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
        """The constraint of an entry. Raises InputError naming file and key."""
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
        """The normal row, and two tangential ones."""
        import casadi

        disk, _ = symbols.local_frame(self.frame)
        radius, height = self.value(symbols, "radius"), self.value(symbols, "height")
        n, a, forward, steepness = self._directions(symbols)
        gap = casadi.dot(casadi.DM(self.normal), symbols.frame(self.frame).position) - height - radius * steepness
        # n × f = (a − (n·a) n)/s
        sideways = (casadi.dot(a, disk.linear) - casadi.dot(n, a) * casadi.dot(n, disk.linear)) / steepness
        slip = casadi.vertcat(
            casadi.dot(forward, disk.linear) / steepness - radius * casadi.dot(a, disk.angular),
            sideways + radius * casadi.dot(forward, disk.angular),
        )
        return Residual(gap, slip)

    def lengths(self, symbols: Symbols) -> casadi.SX:
        """The radius."""
        import casadi

        return casadi.SX(self.value(symbols, "radius"))

    def contact_point(self, symbols: Symbols) -> casadi.SX:
        """The rim's lowest point (3) m in the world."""
        import casadi

        n, a, _, steepness = self._directions(symbols)
        up = symbols.local_frame(self.frame)[1] @ (n - casadi.dot(n, a) * a)
        return symbols.frame(self.frame).position - self.value(symbols, "radius") / steepness * up

    def steepness(self, symbols: Symbols) -> casadi.SX:
        """s, the sine of the angle between axis and normal: 1 upright, 0 lying flat, where no point is the lowest."""
        return self._directions(symbols)[3]

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """Normal force and friction, from the plane on the disk."""
        return ("normal [N]", "friction forwards [N]", "friction sideways [N]")

    def _directions(self, symbols: Symbols) -> tuple[casadi.SX, casadi.SX, casadi.SX, casadi.SX]:
        """n, a and s f in the frame's local axes, and s."""
        import casadi

        disk, axes = symbols.local_frame(self.frame)
        n, a = axes.T @ casadi.DM(self.normal), disk.rotation @ casadi.DM(self.axis)
        across = casadi.cross(a, n)  # also where the disk lies nearly flat, s has all its digits this way
        return n, a, across, casadi.sqrt(casadi.dot(across, across))
