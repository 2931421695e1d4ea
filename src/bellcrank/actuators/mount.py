"""`Mount`: where the mass of an actuator is, and which part of it the robot's URDF contains already."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bellcrank import arguments

if TYPE_CHECKING:
    from bellcrank.config.fields import Fields


@dataclass(frozen=True, kw_only=True)
class Mount:
    """Where an actuator's body is mounted, and what of it the URDF contains.

    Without a mount of its own an actuator is on the parent link of its joint, at the joint's origin, with its axis
    along the joint's axis; that of a coupled transmission is where its joint next to the base is.

    Args:
        link: Name of the link or frame that carries the body; None: the joint's parent link. Another link or frame than
            the parent link carries the body at its origin.
        axis: Direction (3,) of the body's axis in that link or frame; None: the joint's axis on its parent link, else
            the z axis.
        included_mass: Mass, kg, of the actuator that the URDF's links contain already. It is replaced by the chosen
            actuator's mass.
        included_axial_inertia: The same for the inertia about the axis, kg m².
        included_transverse_inertia: The same for the inertia across the axis, kg m².

    Raises:
        InputError: A number is negative or not finite, or the axis has no direction.

    Example:
        >>> import bellcrank as bc
        >>> bc.Mount(link="base_link", included_mass=2.1).axis is None
        True
    """

    link: str | None = None
    axis: tuple[float, float, float] | None = None
    included_mass: float = 0.0
    included_axial_inertia: float = 0.0
    included_transverse_inertia: float = 0.0

    def __post_init__(self) -> None:
        if self.link is not None:
            arguments.text("link", self.link, "the name of a link or frame")
        if self.axis is not None:
            direction = arguments.vector("axis", self.axis, 3, where="a mount")
            if not float(abs(direction).max()) > 0.0:
                arguments.refuse("axis", "a direction of three numbers, not all 0", self.axis, "a mount")
            object.__setattr__(self, "axis", tuple(direction.tolist()))
        for name in ("included_mass", "included_axial_inertia", "included_transverse_inertia"):
            number = arguments.number(name, getattr(self, name), least=0.0, most=arguments.LARGEST, where="a mount")
            object.__setattr__(self, name, number)


def mounts_from_fields(fields: Fields) -> dict[str, Mount]:
    """The mounts of a file by the name of the joint or motor. Raises InputError."""
    found = {}
    for name in fields:
        entry = fields.mapping(name)
        axis = entry.vector("axis", 3) if "axis" in entry else None
        if axis is not None and not any(axis):
            raise entry.error("axis", "expected a direction of three numbers, not all 0")
        found[name] = Mount(
            link=entry.text("link") if "link" in entry else None,
            axis=None if axis is None else (axis[0], axis[1], axis[2]),
            included_mass=entry.number("included_mass", "kg", 0.0, nonnegative=True),
            included_axial_inertia=entry.number("included_axial_inertia", "kg m^2", 0.0, nonnegative=True),
            included_transverse_inertia=entry.number("included_transverse_inertia", "kg m^2", 0.0, nonnegative=True),
        )
        entry.done()
    return found


def checked_mounts(given: Mapping[str, Mount] | None) -> dict[str, Mount]:
    """Mounts given as an argument, by the name of the axis; none where they are None. Raises InputError."""
    listed = {} if given is None else arguments.mapping("mounts", given, "a mapping of joint or motor names to Mounts")
    for name, mount in listed.items():
        arguments.instance(f'mounts["{name:.80}"]', mount, Mount, "a Mount")
    return dict(listed)
