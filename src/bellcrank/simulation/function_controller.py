"""A scene with a controller that is a Python function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from bellcrank import arguments
from bellcrank.config.fields import Fields
from bellcrank.elements.controller_fields import Driven
from bellcrank.elements.sampled_controllers import FunctionController
from bellcrank.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from bellcrank.scene.scene import Scene

    Array = NDArray[np.float64]

NAME = "controller"  # the argument of `simulate`


def with_function(scene: Scene, function: Callable[[float, Array, Array], Any], sample_time: float | None) -> Scene:
    """The scene with a function that is sampled; InputError where an argument is wrong."""
    arguments.function(NAME, function, "a function (t, position, velocity) -> torques")
    if sample_time is None:
        raise InputError("argument 'sample_time': expected the seconds between two calls of `controller`, found none")
    period = arguments.number("sample_time", sample_time, "s", above=0.0)
    if scene.drives:
        raise InputError(
            f"{scene.source}: argument 'controller': its torques act on joints, and joint "
            f"'{scene.drives[0].joint.name}' has a drive; remove its 'model'"
        )
    if NAME in [part.name for part in scene.control]:
        raise InputError(f"{scene.source}: the name '{NAME}' is that of the argument; rename the entry of 'control'")
    driven = Driven.of(scene.robot, scene.config.actuated or scene.config.joints_with_actuators)
    if not driven.joints:
        raise InputError(f"{scene.source}: argument 'controller': no joint has one degree of freedom")
    added = FunctionController(
        name=NAME,
        place=Fields({}, str(scene.source)),
        joints=driven.joints,
        limit=None,
        sample_time=period,
        delay=0.0,
        clock=scene.initial.clock,
        function=function,
    )
    return replace(scene, control=(*scene.control, added))
