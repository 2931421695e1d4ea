"""What the reader of a sizing's page can change: parameters of the scene, payloads, speeds, gear ratios, friction and
gravity.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.actuators.actuator import Actuator
from bellcrank.dynamics.constraints.constraint_derivatives import differentiate_constraints
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.elements.frame_joints import path_frames
from bellcrank.elements.parameters import Parameter
from bellcrank.elements.symbols import Symbols
from bellcrank.motion.entry_kinds import joins
from bellcrank.robot.model.payload import Payload
from bellcrank.robot.model.traced_tree import INERTIA, ORIGIN, setting
from bellcrank.simulation.live_settings import Setting, parameter_settings, slider_end
from bellcrank.sizing.live.live_choice import Choices, pick
from bellcrank.sizing.live.live_motion import LiveLoops

if TYPE_CHECKING:
    import casadi

    from bellcrank.dynamics.inverse.mechanism import Mechanism
    from bellcrank.robot.robot import Robot
    from bellcrank.sizing.result import Sizing

REACH = 0.3  # m: how far a slider moves the centre of a payload
FRICTION = 0.3  # of the peak torque: the most friction of a slider


class LiveSettings:
    """The settings, those of the scene's parameters first, and which symbol of p each of them is."""

    def __init__(self, sizing: Sizing, parameters: Mapping[str, Setting], choices: Choices) -> None:
        assert sizing.inputs is not None
        mechanism, motions, actuators = sizing.inputs
        self.all: list[Setting] = []
        self._places: dict[tuple[str, str], int] = {}
        self._choices = choices
        for name, pairs in choices.pairs.items():
            if len(pairs) > 1:
                self._add(
                    "choice",
                    name,
                    Setting(
                        group="motor and gear",
                        name=name,
                        unit="",
                        value=0.0,
                        range=(0.0, len(pairs) - 1.0),
                        options=tuple(pair.label for pair in pairs),
                    ),
                )
        config, robot = sizing.config, mechanism.robot
        for name, made in parameters.items():
            self._add("parameter", name, made)
        targets = payload_parameters(mechanism, choices)
        for number, payload in enumerate(robot.payloads, 1):
            if number in choices.bodies.values():
                continue
            path = f"payloads.{number}" if config is not None and number <= len(config.payloads) else ""
            several = len(robot.payloads) > 1 + len(choices.bodies)
            group = f"payload {number} at {payload.frame}" if several else f"payload at {payload.frame}"
            self._target(
                targets,
                f"link.payload {number}.mass",
                Setting(
                    group=group,
                    name="mass",
                    unit="kg",
                    value=payload.mass,
                    range=(0.0, slider_end(3.0 * payload.mass)),
                    above=True,
                    path=path and f"{path}.mass",
                ),
            )
            for axis, value, entry in zip(ORIGIN[:3], payload.cg, "123", strict=True):
                self._target(
                    targets,
                    f"link.payload {number}.cg.{axis}",
                    Setting(
                        group=group,
                        name=f"centre {axis}",
                        unit="m",
                        value=value,
                        range=(value - REACH, value + REACH),
                        least=-math.inf,
                        path=path and f"{path}.cg",
                        entry=entry,
                    ),
                )
        entries = {} if config is None else config.motions
        # The key of a motion from which others are joined changes these too; the page changes each by itself.
        named = {name for name in entries if not any(joins(one, name) for one in entries.values())}
        for motion in motions:
            path = f"motions.{motion.name}.speed_factor" if motion.name in named else ""
            stated = 1.0 if not path or config is None else config.motions[motion.name].speed_factor
            self._add(
                "speed",
                motion.name,
                Setting(
                    group="speed of motions",
                    name=motion.name,
                    unit="",
                    value=stated,
                    range=(0.2 * stated, 2.0 * stated),
                    above=True,
                    path=path,
                ),
            )
        given = {} if config is None else config.actuators
        for joint in sizing.joints:
            if joint.name in actuators and of_ratings(actuators[joint.name]):
                path = f"actuators.{joint.name}.ratio" if joint.name in given else ""
                unit = "rad/m" if joint.kind == "prismatic" else ""
                ratio = actuators[joint.name].ratio
                self._add(
                    "ratio",
                    joint.name,
                    Setting(
                        group="gear ratio",
                        name=joint.name,
                        unit=unit,
                        value=ratio,
                        range=(0.3 * ratio, 2.0 * ratio),
                        above=True,
                        path=path,
                    ),
                )
        for kind, values, units in (
            ("viscous", robot.viscous, ("N m s/rad", "N s/m")),
            ("coulomb", robot.coulomb, ("N m", "N")),
        ):
            for one in robot.joints:
                dry = (
                    config is not None and one.name in config.without_friction
                )  # the scene's dry friction counts there
                if dry or one.nv != 1:
                    continue
                value, sized = float(values[one.v]), next((j for j in sizing.joints if j.name == one.name), None)
                most = 1.0 if sized is None else FRICTION * sized.peak_torque
                if sized is not None and kind == "viscous" and sized.peak_speed:
                    most /= sized.peak_speed
                self._add(
                    kind,
                    one.name,
                    Setting(
                        group=f"{kind} friction",
                        name=one.name,
                        unit=units[one.kind == "prismatic"],
                        value=value,
                        range=(0.0, slider_end(max(most, 3.0 * value))),
                        path="" if config is None else "friction",
                        entry=f"{one.name}/{kind}",
                    ),
                )
        most = float(np.linalg.norm(robot.gravity)) or 9.81
        for axis, value, entry in zip(ORIGIN[:3], robot.gravity.tolist(), "123", strict=True):
            self._add(
                "gravity",
                axis,
                Setting(
                    group="gravity (tilt of the base)",
                    name=axis,
                    unit="m/s²",
                    value=value,
                    range=(-most, most),
                    least=-math.inf,
                    path="" if config is None else "gravity",
                    entry=entry,
                ),
            )

    def _add(self, kind: str, name: str, made: Setting) -> None:
        self._places[kind, name] = len(self.all)
        self.all.append(made)

    def _target(self, targets: Collection[str], target: str, made: Setting) -> None:
        if target in targets:
            self._add("parameter", target, made)

    def place(self, kind: str, name: str) -> int:
        """The place of a setting in p."""
        return self._places[kind, name]

    def symbol(self, p: casadi.SX, kind: str, name: str, otherwise: float) -> casadi.SX | float:
        """The symbol of a setting; a number where there is none."""
        place = self._places.get((kind, name))
        return otherwise if place is None else p[place]

    def surroundings(self, p: casadi.SX, robot: Robot) -> list[casadi.SX]:
        """Gravity (3), and viscous and Coulomb friction of each joint."""
        import casadi

        down = casadi.vertcat(*(p[self.place("gravity", axis)] for axis in ORIGIN[:3]))
        friction = [
            self.symbol(p, kind, joint.name, float(stated[v]))
            for kind, stated in (("viscous", robot.viscous), ("coulomb", robot.coulomb))
            for joint in robot.joints
            for v in range(joint.v, joint.v + joint.nv)
        ]
        return [down, casadi.vertcat(*friction[: robot.nv]), casadi.vertcat(*friction[robot.nv :])]

    def values(self, p: casadi.SX, parameters: Mapping[str, Parameter]) -> casadi.SX:
        """The values of parameters: symbols of those that are settings, and the numbers of the others."""
        import casadi

        picked = dict[str, casadi.SX]()
        for name, number in self._choices.bodies.items():
            bodies = [numbers_of(pair.body, number) for pair in self._choices.pairs[name] if pair.body is not None]
            if ("choice", name) in self._places:
                choice = p[self.place("choice", name)]
                picked |= {target: pick(choice, [body[target] for body in bodies]) for target in bodies[0]}
        found = (
            picked.get(name, self.symbol(p, "parameter", name, parameter.value))
            for name, parameter in parameters.items()
        )
        return casadi.vertcat(casadi.SX(0, 1), *found)

    def choice(self, p: casadi.SX, name: str) -> casadi.SX | None:
        """The number of the motor and gear of a joint; None where there is no choice."""
        return p[self.place("choice", name)] if ("choice", name) in self._places else None


def own_parameters(mechanism: Mechanism) -> dict[str, Parameter]:
    """The parameters of the mechanism's scene."""
    scene = mechanism.equations.scene
    return {} if scene is None else dict(scene.parameters)


def payload_parameters(mechanism: Mechanism, choices: Choices) -> dict[str, Parameter]:
    """Parameters that set mass and centre of payloads, by their targets, except what the scene's parameters set; of the
    bodies of motors and gears also those that set the inertia.
    """
    robot, found = mechanism.robot, dict[str, Parameter]()
    taken = {place for parameter in own_parameters(mechanism).values() for place in parameter.places}
    for number, payload in enumerate(robot.payloads, 1):
        body = number in choices.bodies.values()
        for target, value in numbers_of(payload, number).items():
            place = setting(robot.equations.tree, target)
            if place not in taken and (body or ".inertia." not in target):
                found[target] = Parameter(target, value, "", (target,), (place,))
    return found


def numbers_of(payload: Payload, number: int) -> dict[str, float]:
    """Mass, centre and inertia of the payload with a number, by the targets of parameters."""
    cg = {f"cg.{axis}": x for axis, x in zip(ORIGIN[:3], payload.cg, strict=True)}
    inertia = {f"inertia.{axes}": x for axes, x in zip(INERTIA, payload.inertia, strict=True)}
    return {f"link.payload {number}.{key}": x for key, x in ({"mass": payload.mass} | cg | inertia).items()}


def changeable_parameters(
    sizing: Sizing, loads: casadi.SX, symbols: Symbols, loops: LiveLoops | None
) -> tuple[dict[str, Setting], list[str]]:
    """The settings of the scene's parameters that change `loads`, expressions of `symbols`, or the motion, by name; and
    sentences on the others, and on motions that do not follow.
    """
    import casadi

    assert sizing.inputs is not None
    mechanism, motions, _ = sizing.inputs
    scene, config = mechanism.scene, sizing.config
    if scene is None:
        return {}, []
    found, fixed = parameter_settings(scene, own_parameters(mechanism), config is not None)
    closed = isinstance(mechanism, Linkage)
    residual = casadi.SX(0, 1)
    if loops is not None:
        residual = loops.residual
    elif isinstance(mechanism, Linkage):
        kinematics = mechanism.kinematics.scene
        residual = differentiate_constraints(kinematics.constraints, None, symbols).position_residual
    for name in list(found):
        symbol, moves = symbols.parameter(name), any(what < 6 for _, what in scene.parameters[name].places)
        if casadi.depends_on(residual, symbol) and loops is None:
            why = "the motions here do not all follow from the same independent joints"
            if mechanism.robot.nq != mechanism.robot.nv:
                why = "the page does not move joints with several degrees of freedom otherwise"
            fixed.append(f"parameter {name} keeps its value: it changes the motion of the linkage, and {why}")
            del found[name]
        elif not casadi.depends_on(casadi.vertcat(residual, loads), symbol):
            fixed.append(f"parameter {name} does not change a sizing")
            del found[name]
        elif moves and not closed and config is not None:
            entries = config.motions
            fixed += [
                f"with another {name} motion {motion.name} keeps the positions of its joints, and its frame moves "
                "along another path"
                for motion in motions
                if motion.name in entries and any(path_frames(entries[motion.name], entries))
            ]
    return found, fixed


def of_ratings(actuator: Actuator) -> bool:
    """Whether an actuator is given by its ratings, and states what the torque at its shaft needs."""
    return actuator.by_ratings and not actuator.unknown_of_torque
