"""Tables of the inputs of a result: the robot, its joints, actuators and motions, the scene's forces, and
versions and machine."""

from __future__ import annotations

import datetime
import math
import os
import platform
from collections.abc import Mapping, Sequence
from importlib import metadata
from typing import TYPE_CHECKING

from bellcrank.actuators.gear import DIRECT
from bellcrank.codegen.llvm import processor
from bellcrank.config.units import RPM
from bellcrank.dynamics.inverse.mechanism import acts_on
from bellcrank.reports.document import Table
from bellcrank.reports.selection_data import origin
from bellcrank.version import version

if TYPE_CHECKING:
    from bellcrank.actuators.actuator import Actuator
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.model.payload import Payload
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene
    from bellcrank.simulation.trajectory.trajectory import Trajectory


def robot_facts(robot: Robot) -> list[tuple[str, str]]:
    """(name, value) of the URDF, the base, gravity and the payloads."""
    rows = [
        ("URDF", f"{robot.source.name}, robot '{robot.urdf.name}'"),
        ("base", "free" if robot.floating_base else "fixed"),
        ("gravity", f"({', '.join(f'{x:g}' for x in robot.gravity)}) m/s²"),
    ]
    loads = [("payload", _payload(load)) for load in robot.payloads]
    return [*rows, *(loads or [("payload", "none")])]


def _payload(load: Payload) -> str:
    text = f"{load.mass:g} kg @ {load.frame}"
    if any(load.cg):
        text += f", centre of gravity at ({', '.join(f'{x:g}' for x in load.cg)}) m"
    if any(load.inertia):
        text += f", inertia xx xy yy xz yz zz ({', '.join(f'{x:g}' for x in load.inertia)}) kg m²"
    return text


def joint_table(robot: Robot) -> Table:
    """Limits and friction of the joints with one degree of freedom."""
    header = (
        "joint", "kind", "range", "effort limit", "speed limit", "viscous friction", "Coulomb friction",
        "rotor inertia\nat the joint",
    )  # fmt: skip
    rows = []
    for joint in robot.joints:
        if joint.nv != 1:
            continue
        slides = joint.kind == "prismatic"
        length, force = ("m", "N") if slides else ("rad", "N m")
        low, high = float(robot.lower[joint.q]), float(robot.upper[joint.q])
        rows.append(
            (
                joint.name,
                joint.kind,
                f"{_number(low)} to {_number(high)} {length}"
                if low > -math.inf or high < math.inf
                else "no limit given",
                _limit(robot.effort_limit[joint.v], force),
                _limit(robot.velocity_limit[joint.v], f"{length}/s"),
                f"{robot.viscous[joint.v]:.4g} {force} s/{length}",
                f"{robot.coulomb[joint.v]:.4g} {force}",
                f"{robot.rotor_inertia[joint.v]:.4g} {'kg' if slides else 'kg m²'}",
            )
        )
    return Table("Joints", header, tuple(rows))


def actuator_table(actuators: Mapping[str, Actuator]) -> Table:
    """The actuators' data; torques and inertias at the motor shaft, speeds in rpm; and where products are from."""
    header = (
        "joint", "ratio", "gear\nefficiency", "rated\n[N m]", "peak\n[N m]", "rated speed\n[rpm]",
        "largest speed\n[rpm]", "rotor inertia\n[kg m²]", "gear inertia\n[kg m²]", "safety\nfactor",
        "motor\nefficiency", "curve",
    )  # fmt: skip
    rows = tuple(
        (
            name,
            f"{one.ratio:.6g}",
            *(_known(value) for value in (one.efficiency, one.rated_torque, one.peak_torque)),
            *(_known(speed and speed * RPM) for speed in (one.rated_speed, one.max_speed)),
            *(_known(value) for value in (one.rotor_inertia, one.gear_inertia, one.safety_factor)),
            _motor_efficiency(one),
            _curve(one),
        )
        for name, one in actuators.items()
    )
    products = dict.fromkeys(part for one in actuators.values() for part in (one.motor, one.gear) if part.source)
    sources = [f"{part.id}: {origin(part)}." for part in products if part.id != DIRECT.id]
    return Table("Actuators", header, rows, " ".join(["Figures are from:", *sources] if sources else []))


def _known(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.4g}"


def _motor_efficiency(actuator: Actuator) -> str:
    if not actuator.by_ratings:
        return "from the motor"
    return "1, not given" if actuator.motor_efficiency is None else f"{actuator.motor_efficiency:.4g}"


def _curve(actuator: Actuator) -> str:
    if not actuator.by_ratings:
        gear = "" if actuator.gear.kind == "direct" else f" with {actuator.gear.id}"
        return f"of {actuator.motor.id}{gear}"
    return "from the ratings" if actuator.curve is None else f"{len(actuator.curve)} points"


def motion_table(motions: Sequence[Motion]) -> Table:
    """The motions' durations and numbers of rows."""
    rows = tuple((motion.name, f"{motion.duration:.6g}", str(len(motion))) for motion in motions)
    return Table("Motions", ("motion", "duration\n[s]", "rows"), rows)


def scene_facts(run: Trajectory) -> list[tuple[str, str]]:
    """(name, value) of the forces, controllers and parameters of a run's scene."""
    scene = run.scene
    forces = ", ".join(f"{part.kind} '{part.name}'" for part in scene.forces)
    control = ", ".join(f"{part.kind} '{part.name}'" for part in scene.control)
    values = zip(scene.parameters.items(), run.parameters.tolist(), strict=False)
    parameters = ", ".join(f"{name} = {value:.6g} {each.unit}".rstrip() for (name, each), value in values)
    return [("forces", forces or "none"), ("control", control or "none")] + (
        [("parameters", parameters)] if parameters else []
    )


def force_table(scene: Scene, parameters: Sequence[float]) -> Table:
    """The forces and controllers of a scene with their values, those of its parameters included."""
    sets = zip(scene.parameters.values(), parameters, strict=False)
    given = {target: float(value) for parameter, value in sets for target in parameter.sets}
    rows = []
    for part in (*scene.forces, *scene.control):
        numbers = [
            f"{field} {given.get(f'{part.owner}.{part.name}.{field}', part.number(field)):.6g} {each.unit}".rstrip()
            for field, each in part.settable.items()
        ]
        where = acts_on(part) if part.owner == "force" else ", ".join(j.name for j in getattr(part, "joints", ()))
        rows.append((part.name, part.kind, where, ", ".join(numbers) or "given over time by a file"))
    return Table("Forces and controllers", ("name", "kind", "acts on", "values"), tuple(rows))


def _number(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else "no limit"


def _limit(value: float, unit: str) -> str:
    return f"{value:.4g} {unit}" if math.isfinite(value) else "no limit given"


PACKAGES = ("pin", "casadi", "llvmlite", "numpy")


def made_with() -> tuple[tuple[str, str], ...]:
    """(name, value) of the versions of bellcrank and its main dependencies, the machine and the date."""
    return (
        ("bellcrank", version()),
        ("with", ", ".join(f"{name} {metadata.version(name)}" for name in PACKAGES)),
        ("Python", f"{platform.python_version()} on {platform.system()} {platform.machine()}"),
        ("processor", f"{processor()}, {os.cpu_count()} threads"),
        ("written on", datetime.date.today().isoformat()),
    )


def about(made: tuple[tuple[str, str], ...]) -> tuple[str, str]:
    """The version of bellcrank, and the date."""
    named = dict(made)
    return f"bellcrank {named['bellcrank']}", named["written on"]
