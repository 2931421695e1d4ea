"""The conditions of one axis: what is given, what its actuator states, what the configuration states, or defaults."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from bellcrank.actuators.condition_fields import ROBOT_WIDE
from bellcrank.actuators.conditions import Conditions
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name

if TYPE_CHECKING:
    from bellcrank.scene.robot_config import RobotConfig


def conditions_of(
    config: RobotConfig | None, axis: str | None = None, given: Conditions | Mapping[str, Any] | None = None
) -> Conditions:
    """The conditions under which the motor and gear of an axis are judged.

    Each field is what is given; else what `actuators.NAME` of the configuration states; else what its `conditions`
    state; else the default. Entries of `assume` and `momentary_loads` count as fields.

    Args:
        config: The robot configuration; None: there is none.
        axis: Name of the joint, or of the motor of a coupled transmission; None: of the whole robot.
        given: Conditions, or a mapping of their fields; of Conditions those that `sources` names.

    Returns:
        The conditions, whose `sources` say where each stated field comes from.

    Raises:
        InputError: For an unknown field or a wrong value in `given`.

    Example:
        >>> import bellcrank as bc
        >>> from bellcrank.sizing.axis_conditions import conditions_of
        >>> conditions = conditions_of(bc.load_scene("planar_2r").config, "elbow", {"ambient": 40.0})
        >>> conditions.safety_factor, dict(conditions.sources)
        (1.2, {'ambient': 'given', 'safety_factor': 'actuators.elbow'})
    """
    common = Conditions() if config is None else config.conditions
    actuator = None if config is None or axis is None else config.actuators.get(axis)
    stated: Mapping[str, Any] = {}
    if actuator is not None and not actuator.by_ratings:
        own = actuator.conditions
        stated = own.only(name for name, source in own.sources.items() if source != ROBOT_WIDE)
    elif actuator is not None and actuator.safety_factor != common.safety_factor:
        stated = {"safety_factor": actuator.safety_factor}
    return common.updated(stated, f"actuators.{axis}").updated(given)


def check_momentary_loads(conditions: Conditions, axes: Sequence[str]) -> None:
    """Refuse momentary loads of an axis that there is not (InputError)."""
    for name in dict(conditions.momentary_loads):
        if name not in axes:
            raise InputError(f"conditions: momentary_loads: {unknown_name('axis', name, axes)}")
