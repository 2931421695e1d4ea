"""A payload: a rigid body fixed to a frame of a robot."""

from __future__ import annotations

from dataclasses import dataclass

from bellcrank import arguments
from bellcrank.errors import InputError


@dataclass(frozen=True)
class Payload:
    """A rigid body fixed to a frame.

    Attributes:
        mass: Mass, kg.
        frame: Name of the frame that carries it.
        cg: Centre of gravity (3,) in the frame, m.
        inertia: Inertia (6,) about the centre of gravity, in the axes of the frame, kg m², order xx xy yy xz yz zz.

    Raises:
        InputError: The mass is not positive, or no rigid body has the inertia.

    Example:
        >>> import bellcrank as bc
        >>> bc.Payload(2.0, "tip", cg=(0.0, 0.0, 0.1)).mass
        2.0
    """

    mass: float
    frame: str
    cg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    inertia: tuple[float, float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        where = f"payload on frame '{arguments.text('frame', self.frame, 'the name of a frame')}'"
        most = arguments.LARGEST
        set_ = object.__setattr__
        set_(self, "mass", arguments.number("mass", self.mass, "kg", above=0.0, most=most, where=where))
        set_(self, "cg", tuple(arguments.vector("cg", self.cg, 3, "m", most=most, where=where).tolist()))
        set_(
            self,
            "inertia",
            tuple(arguments.vector("inertia", self.inertia, 6, "kg m²", most=most, where=where).tolist()),
        )
        xx, xy, yy, xz, yz, zz = self.inertia
        det = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
        scale = max(xx, yy, zz, 1e-30)
        minors = (xx, yy, zz, (xx * yy - xy * xy) / scale, (xx * zz - xz * xz) / scale, (yy * zz - yz * yz) / scale)
        if min(minors) < -1e-12 * scale or det < -1e-12 * scale**3 or 2 * max(xx, yy, zz) > (xx + yy + zz) * (1 + 1e-9):
            raise InputError(
                f"payload on frame '{self.frame}': no rigid body has the inertia {list(self.inertia)}; it must be "
                "positive, and each moment at most the sum of the other two (order xx xy yy xz yz zz, about the centre "
                "of gravity)"
            )
