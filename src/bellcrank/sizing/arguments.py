"""The arguments of a sizing, checked."""

from __future__ import annotations

from dataclasses import replace

from bellcrank import arguments
from bellcrank.actuators.actuator import Drive
from bellcrank.motion.motion import Motion


def tolerance_of(value: object) -> float:
    """A mass tolerance, a share of at least 0 and below 1; InputError."""
    share = arguments.number("mass_tolerance", value, least=0.0)
    if share >= 1.0:
        arguments.refuse("mass_tolerance", "a share of at least 0 and below 1, such as 0.1", value)
    return share


def motions_of(given: object) -> list[Motion]:
    """One motion or a list of them as a list; InputError."""
    from bellcrank.simulation.trajectory import Trajectory

    listed = arguments.several(
        "motions", [given] if isinstance(given, (Motion, Trajectory)) else given, object, "Motions"
    )
    for one in listed:
        if isinstance(one, Trajectory):
            remedy = "write the run with run.to_csv(path) and read it with read_motion(robot, path)"
            arguments.refuse("motions", "a Motion or a list of them", one, remedy=remedy)
    return list(arguments.several("motions", listed, Motion, "Motions"))


def drives_of(given: object) -> dict[str, Drive]:
    """Drives by the names of joints, none where they are None; InputError."""
    if given is None:
        return {}
    listed = arguments.mapping("drives", given, "a mapping of joint names to Drives")
    for name, drive in listed.items():
        arguments.instance(f'drives["{name:.80}"]', drive, Drive, "a Drive")
    return listed


def renamed(motions: list[Motion]) -> list[Motion]:
    """The motions with names of their own: the second "circle" becomes "circle (2)"."""
    names: list[str] = []
    for motion in motions:
        name, number = motion.name, 1
        while name in names:
            number += 1
            name = f"{motion.name} ({number})"
        names.append(name)
    return [
        motion if motion.name == name else replace(motion, name=name)
        for motion, name in zip(motions, names, strict=True)
    ]
