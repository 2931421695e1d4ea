"""What a robot is loaded with beside its file: payloads, which are rigid bodies fixed to frames, and other options."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from bellcrank import arguments
from bellcrank.errors import InputError
from bellcrank.robot.model.friction import FRICTION_WIDTH, Friction


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


FrameTable = dict[str, tuple[str, tuple[float, ...], tuple[float, ...]]]  # name: (link, xyz in m, rpy in rad)


@dataclass(frozen=True, kw_only=True)
class LoadOptions:
    """The checked arguments of `load_robot`, which describes them."""

    gravity: tuple[float, ...] = (0.0, 0.0, -9.81)
    floating_base: bool = False
    friction: Friction = "urdf"
    friction_width: float = FRICTION_WIDTH
    without_friction: frozenset[str] = frozenset()  # joints that a scene gives other friction
    payloads: tuple[Payload, ...] = ()
    rotor_inertia: Mapping[str, float] = field(default_factory=dict)
    frames: FrameTable = field(default_factory=dict)
    clean: bool = True


def checked_frames(frames: object) -> FrameTable:
    """Frames by name: (link, xyz in m, rpy in rad) each. Raises InputError."""
    table: FrameTable = {}
    expected = "a mapping of names of frames to (link, xyz in m, rpy in rad)"
    for name, entry in arguments.mapping("frames", frames, expected).items():
        if not isinstance(entry, (list, tuple)) or len(entry) != 3:
            arguments.refuse("frames", expected, entry, remedy=f"it is the entry '{name:.80}'")
        link, xyz, rpy = entry
        own = f'frames["{name:.80}"]'
        place = arguments.vector(own, xyz, 3, "m", most=arguments.LARGEST)
        turn = arguments.vector(own, rpy, 3, "rad")
        table[name] = (arguments.text(own, link, "the name of a link"), tuple(place.tolist()), tuple(turn.tolist()))
    return table
