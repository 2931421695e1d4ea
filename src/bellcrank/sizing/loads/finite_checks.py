"""Checks that loads and results are finite numbers: where one is not, sizing gives no verdict."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.arrays import Array
from bellcrank.errors import InputError

if TYPE_CHECKING:
    from bellcrank.sizing.joint_sizing import JointSizing, MotorSizing

REMEDY = "so the motor cannot be sized; check the masses, lengths, forces, actuator and accelerations there"


def refuse_non_finite(robot: str, joints: Sequence[str], time: Array, values: Mapping[str, Array]) -> None:
    """InputError naming joint, quantity and the first time (n,) at which one of the values (n, k) is not finite."""
    bad = {name: ~np.isfinite(rows) for name, rows in values.items()}
    rows = {name: int(each.any(axis=1).argmax()) for name, each in bad.items() if each.any()}
    if not rows:
        return
    name = min(rows, key=lambda name: rows[name])
    row = rows[name]
    column = int(bad[name][row].argmax())
    who = f" of joint '{joints[column]}'" if values[name].shape[1] == len(joints) else " of all joints"
    raise InputError(
        f"sizing of {robot}: the {name.replace('_', ' ')}{who} is {_found(float(values[name][row, column]))} at "
        f"{time[row]:.6g} s, {REMEDY}"
    )


def refuse_non_finite_joint(robot: str, joint: JointSizing) -> None:
    """InputError naming joint and quantity where a number of a joint's sizing is not finite.

    A margin may be infinite where its limit is 0.
    """
    for name, value in _numbers(joint, ""):
        if not math.isfinite(value):
            raise InputError(f"sizing of {robot}: the {name} of joint '{joint.name}' is {_found(value)}, {REMEDY}")
    for name, margin, limit in (
        ("effort margin", joint.effort_margin, joint.effort_limit),
        ("velocity margin", joint.velocity_margin, joint.velocity_limit),
    ):
        if margin is not None and not math.isfinite(margin) and limit:
            raise InputError(f"sizing of {robot}: the {name} of joint '{joint.name}' is {_found(margin)}, {REMEDY}")


def refuse_non_finite_motor(robot: str, motor: MotorSizing) -> None:
    """InputError naming motor and quantity where a number of the sizing of a coupled transmission's motor is not
    finite.
    """
    for name, value in _numbers(motor, ""):
        if not math.isfinite(value):
            raise InputError(f"sizing of {robot}: the {name} of motor '{motor.name}' is {_found(value)}, {REMEDY}")


def _numbers(value: Any, name: str) -> Iterable[tuple[str, float]]:
    """All floats in a result, with the names of their fields."""
    if isinstance(value, float):
        yield name, value
    elif is_dataclass(value):
        for entry in fields(value):
            if entry.name == "judging":  # a use is infinite where the limit is 0, or the temperature rises without end
                continue
            yield from _numbers(getattr(value, entry.name), f"{name} {entry.name}".replace("_", " ").strip())
    elif isinstance(value, Mapping):
        for key, each in value.items():
            yield from _numbers(each, f"{name} {key}".replace("_", " ").removeprefix("peaks "))
    elif isinstance(value, tuple):
        for each in value:
            yield from _numbers(each, name)


def _found(value: float) -> str:
    return "not a number (NaN)" if math.isnan(value) else "infinite"
