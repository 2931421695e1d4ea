"""What a robot is loaded with, besides its URDF."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from bellcrank import arguments
from bellcrank.robot.model.friction import FRICTION_WIDTH, Friction
from bellcrank.robot.model.payload import Payload

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
