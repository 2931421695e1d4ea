"""The exceptions of bellcrank: one base, whose message is one line that is safe to print."""

from __future__ import annotations

from typing import Any

from bellcrank.messages import one_line, printable


class BellcrankError(Exception):
    """Base of all errors of bellcrank.

    The message is one line, without control characters: what is wrong, where (file, key, joint, time), and the remedy.

    Example:
        >>> import bellcrank as bc
        >>> try:
        ...     bc.load_robot("planar_3r")
        ... except bc.BellcrankError as error:
        ...     print(str(error)[:25])
        unknown robot 'planar_3r'
    """

    def __str__(self) -> str:
        return printable(one_line(super().__str__()))


class InputError(BellcrankError):
    """A file, a key or an argument is not as expected.

    Attributes:
        reason: The message without the place and the argument.
        argument: The name of the argument that is refused; empty where it is none.

    Example:
        >>> import bellcrank as bc
        >>> try:
        ...     bc.load_robot("planar_2r", gravity=(0.0, 9.81))
        ... except bc.InputError as error:
        ...     print(error)
        argument 'gravity': expected 3 numbers (m/s²), found an array of shape (2,)
    """

    def __init__(self, reason: str = "", place: str = "", argument: str = "") -> None:
        super().__init__(": ".join(filter(None, (place, argument and f"argument '{argument}'", reason))))
        self.reason, self.argument = reason, argument


class NotSavedError(InputError):
    """A finished run cannot be saved; the attribute `run` is the run, which can be saved elsewhere.

    Example:
        >>> import bellcrank as bc
        >>> issubclass(bc.NotSavedError, bc.InputError)
        True
    """

    def __init__(self, text: str, run: Any) -> None:
        super().__init__(text)
        self.run = run


class UnreachableError(BellcrankError):
    """A path leaves the robot's reach, or passes a singular posture where it cannot be followed.

    Example:
        >>> import bellcrank as bc
        >>> robot = bc.load_robot("planar_2r")
        >>> try:
        ...     bc.line(robot, "tip", end=(3.0, 0.0, 0.0), start={"shoulder": 0.4, "elbow": 0.4}, duration=1.0)
        ... except bc.UnreachableError as error:
        ...     print(type(error).__name__)
        UnreachableError
    """


class CompileError(BellcrankError):
    """An expression cannot be compiled to machine code.

    Example:
        >>> import bellcrank as bc
        >>> issubclass(bc.CompileError, bc.BellcrankError)
        True
    """
