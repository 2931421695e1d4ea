"""Traces Pinocchio's algorithms on symbols (src/cpp/tracer); functions come back as casadi serialises them."""

from collections.abc import Sequence
from typing import Any

class Placement:
    def __init__(self, rotation: Sequence[float], translation: Sequence[float]) -> None: ...

class Joint:
    def __init__(
        self,
        kind: int,
        sign: float,
        parent: int,
        axis: Sequence[float],
        placement: Placement,
        mass: float,
        lever: Sequence[float],
        inertia: Sequence[float],
        armature: Sequence[float],
    ) -> None: ...

class Frame:
    def __init__(
        self,
        parent_frame: int,
        parent_joint: int,
        moving_joint: int,
        placement: Placement,
        in_parent: Placement,
        rpy: Sequence[float],
        mass: float,
        lever: Sequence[float],
        inertia: Sequence[float],
    ) -> None: ...

class Mimic:
    def __init__(self, follower: int, leader: int, multiplier: float, offset: float) -> None: ...

class Setting:
    def __init__(self, frame: int, what: int, parameter: int) -> None: ...

class Tree:
    def __init__(
        self,
        joints: Sequence[Joint],
        frames: Sequence[Frame],
        mimics: Sequence[Mimic],
        settings: Sequence[Setting],
        gravity: Sequence[float],
        parameters: int,
    ) -> None: ...
    def inverse_dynamics(self) -> bytes: ...
    def reactions(self) -> bytes: ...
    def forward_dynamics(self) -> bytes: ...
    def mass_matrix(self) -> bytes: ...
    def energy(self) -> bytes: ...
    def configuration_rate(self) -> bytes: ...
    def frames(self, which: Sequence[int]) -> bytes: ...

def instructions(function: bytes) -> tuple[Any, ...]: ...
def operations() -> dict[int, str]: ...
