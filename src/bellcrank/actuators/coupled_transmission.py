"""`CoupledTransmission`: motors that move several joints together, such as those of a differential wrist.

The motors' angles are θ = C q with a constant matrix C of the joints' positions q. As the power is the same on both
sides, τᵀ q̇ = τ_mᵀ θ̇ for every q̇, the motors' torques are τ_m = C⁻ᵀ τ. Source: Tsai, Robot Analysis (1999), 7.4.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.errors import InputError

if TYPE_CHECKING:
    from bellcrank.config.fields import Fields

LARGEST_CONDITION = 1e6  # of the matrix with rows and columns of length 1


@dataclass(frozen=True)
class CoupledTransmission:
    """A constant linear transmission between some joints and as many motors, or the gears of these.

    A belt or gear between the selected gear and one joint is one with a 1 × 1 matrix. Its efficiency is 1.

    Args:
        joints: Names of the joints.
        motors: Names of as many motors, which name their axes, other names than the robot's joints have.
        matrix: Rows (k, k) of C, one a motor, in θ = C q: rad of the motor's axis per rad of a joint, or per m of a
            prismatic one.

    Raises:
        InputError: The numbers of joints, motors and entries differ, a name occurs twice, or the matrix has no
            accurate inverse.

    Example:
        >>> import bellcrank as bc
        >>> wrist = bc.CoupledTransmission(("pitch", "roll"), ("left", "right"), ((1.0, 1.0), (1.0, -1.0)))
        >>> wrist.motor_torques([4.0, 2.0])
        array([3., 1.])
    """

    joints: tuple[str, ...]
    motors: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        where = "a coupled transmission"
        for key in ("joints", "motors"):
            names = arguments.several(key, getattr(self, key), str, f"names of {key}", where=where)
            if not names or len(set(names)) != len(names):
                arguments.refuse(key, f"a list of different {key}", getattr(self, key), where)
            object.__setattr__(self, key, names)
        k = len(self.joints)
        if len(self.motors) != k:
            raise InputError(
                f"expected as many motors as joints, found {len(self.motors)} motors "
                f"({', '.join(self.motors)}) and {k} joints ({', '.join(self.joints)})",
                where,
            )
        if both := set(self.joints) & set(self.motors):
            raise InputError(f"'{min(both)}' names a joint and a motor; give the motor another name", where)
        matrix = arguments.array("matrix", self.matrix, (k, k), "rad/rad or rad/m", where=where)
        size = np.abs(matrix)
        rows, columns = size.max(axis=1, initial=0.0), size.max(axis=0, initial=0.0)
        for key, largest in (("motors", rows), ("joints", columns)):
            if not largest.all():
                name = getattr(self, key)[int(np.argmin(largest))]
                what = f"row of motor '{name}'" if key == "motors" else f"column of joint '{name}'"
                raise InputError(f"the {what} is 0; a matrix with an inverse is required", where, "matrix")
        if (condition := _condition(matrix)) > LARGEST_CONDITION:
            raise InputError(
                f"a matrix with an accurate inverse is required (condition number up to "
                f"{LARGEST_CONDITION:g} after scaling), found {matrix.tolist()}, whose condition number is "
                f"{condition:.3g}; its rows or columns are nearly dependent",
                where,
                "matrix",
            )
        object.__setattr__(self, "matrix", tuple(tuple(row) for row in matrix.tolist()))

    def motor_speeds(self, joint_speeds: Sequence[float] | Array) -> Array:
        """The speeds of the motors' axes, rad/s.

        Args:
            joint_speeds: Speeds (k,) or (n, k) of the joints, rad/s or m/s.

        Returns:
            θ̇ = C q̇, (k,) or (n, k).

        Raises:
            InputError: The shape does not fit, or a number is not finite.

        Example:
            >>> import bellcrank as bc
            >>> belt = bc.CoupledTransmission(("elbow",), ("elbow_motor",), ((2.0,),))
            >>> belt.motor_speeds([3.0])
            array([6.])
        """
        return np.asarray(self._rows("joint_speeds", joint_speeds) @ np.array(self.matrix).T)

    def motor_torques(self, joint_torques: Sequence[float] | Array) -> Array:
        """The torques at the motors' axes, N m.

        Args:
            joint_torques: Torques (k,) or (n, k) of the joints, N m or N.

        Returns:
            τ_m = C⁻ᵀ τ, (k,) or (n, k).

        Raises:
            InputError: The shape does not fit, or a number is not finite.

        Example:
            >>> import bellcrank as bc
            >>> belt = bc.CoupledTransmission(("elbow",), ("elbow_motor",), ((2.0,),))
            >>> belt.motor_torques([3.0])
            array([1.5])
        """
        return np.asarray(self._rows("joint_torques", joint_torques) @ np.linalg.inv(np.array(self.matrix)))

    def _rows(self, name: str, values: Sequence[float] | Array) -> Array:
        """Numbers (k,) or (n, k), checked."""
        k, given = len(self.joints), arguments.as_array(name, values, f"{len(self.joints)} numbers, or rows of them")
        return arguments.array(name, given, (k,) if given.ndim < 2 else (None, k))


def _condition(matrix: Array) -> float:
    """The condition number after rows and columns are scaled, so that units do not count."""
    for _ in range(20):
        matrix = matrix / np.linalg.norm(matrix, axis=1, keepdims=True)
        matrix = matrix / np.linalg.norm(matrix, axis=0, keepdims=True)
    return float(np.linalg.cond(matrix))


def transmissions_from_fields(fields: Fields) -> tuple[CoupledTransmission, ...]:
    """The coupled transmissions of a file. Raises InputError."""
    found = []
    for entry in fields.mappings("transmissions"):
        names = {}
        for what in ("joints", "motors"):
            value = entry.raw(what)
            if not isinstance(value, (list, tuple)) or not all(isinstance(name, str) for name in value):
                raise entry.error(what, f"expected a list of {what}, such as [{what[0]}1, {what[0]}2]")
            names[what] = tuple(value)
        matrix = entry.rows("matrix", max(1, len(names["joints"])), "")
        entry.done()
        try:
            found.append(CoupledTransmission(names["joints"], names["motors"], matrix))
        except InputError as error:
            raise entry.error(error.argument or "motors", error.reason) from None
    try:
        return checked_transmissions(found)
    except InputError as error:
        raise fields.error("transmissions", str(error)) from None


def checked_transmissions(given: Iterable[CoupledTransmission] | None) -> tuple[CoupledTransmission, ...]:
    """Coupled transmissions given as an argument, none where they are None; each joint and motor is in one of them.

    Raises InputError.
    """
    listed = () if given is None else given
    every = arguments.several("transmissions", listed, CoupledTransmission, "CoupledTransmissions", alone=True)
    for key in ("joints", "motors"):
        names = [name for one in every for name in getattr(one, key)]
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"{key[:-1]} '{name}' belongs to two coupled transmissions; combine these into one")
    return every
