"""What a robot carries: a rigid mass fixed to one of its frames."""

from __future__ import annotations

from dataclasses import dataclass

from bellcrank import arguments
from bellcrank.errors import InputError


@dataclass(frozen=True)
class Payload:
    """A rigid body fixed to a frame.

    mass in kg; cg (3,) in m and inertia (6,) in kg m² about the CG, order xx xy yy xz yz zz, both in
    the axes of `frame`. Raises InputError where the mass is not positive or the inertia impossible.
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
                f"payload on frame '{self.frame}': no body has the inertia {list(self.inertia)}; it must be positive "
                "and each moment at most the sum of the other two (order xx xy yy xz yz zz, about the CG)"
            )
