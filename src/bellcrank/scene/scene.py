"""A scene: a robot configuration with forces, control, a start, parameters, events, outputs and solver settings.

One YAML file serves sizing and simulation: to the keys of a configuration (robot_config.py) it adds forces (forces.py), control
(control.py), initial and base (initial.py), parameters (parameters.py), events (events.py), outputs (outputs.py) and
simulate (settings.py), all optional.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.cached_values import Portable, cached_property
from bellcrank.config.fields import Fields
from bellcrank.deprecated import Renamed
from bellcrank.elements.constraint import Constraint, ReadContext
from bellcrank.elements.constraint_importers import imported_motors
from bellcrank.elements.constraints import read_constraints
from bellcrank.elements.controllers import Controller, read_control
from bellcrank.elements.element import Element, Force
from bellcrank.elements.expression_constraint import FunctionConstraint, function_constraint
from bellcrank.elements.forces import read_forces
from bellcrank.elements.frame_forces import Wrench
from bellcrank.elements.frame_joints import refuse_joints_off_paths
from bellcrank.elements.joint_forces import Torque
from bellcrank.elements.parameters import Parameter, read_parameters
from bellcrank.elements.signals import Signal, SignalSource, signal_after, stops_after, values_at
from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess, Trust, read_text
from bellcrank.motion.entry_kinds import csv_texts
from bellcrank.robot.robot import Robot, RobotJoint
from bellcrank.scene.events import EventRule, read_events
from bellcrank.scene.initial import Initial, read_initial
from bellcrank.scene.outputs import Output, read_outputs
from bellcrank.scene.overrides import apply_overrides
from bellcrank.scene.renamed_keys import read_scene_data
from bellcrank.scene.robot_config import SCENE_KEYS, RobotConfig, config_from_fields, find_config
from bellcrank.scene.saved_state import RunScene
from bellcrank.scene.settings import Settings, check_rows, read_settings
from bellcrank.scene.source_mapping import plain, source_mapping

if TYPE_CHECKING:
    from bellcrank.elements.symbols import Symbols
    from bellcrank.motion.motion import Motion

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene(Portable, Renamed):
    """What a scene file says, checked against the robot. Made by `load_scene`."""

    config: RobotConfig
    robot: Robot
    constraints: tuple[Constraint, ...]
    forces: tuple[Force, ...]
    control: tuple[Controller, ...]
    initial: Initial
    parameters: Mapping[str, Parameter]
    events: tuple[EventRule, ...]
    outputs: Mapping[str, Output]
    settings: Settings
    motion_of: Callable[[str], Motion] = field(repr=False)
    source_data: Mapping[str, Any] = field(repr=False)  # with the lines and overrides of its keys
    access: FileAccess = field(repr=False)  # which files it may name
    # texts of files that constraints were read from
    loop_files: dict[str, str] = field(repr=False, default_factory=dict)

    renamed: ClassVar[Mapping[str, str]] = {
        "card": "config",
        "closures": "constraints",
        "start": "bellcrank.dynamics.consistent_start:consistent_start",
        "system": "bellcrank.dynamics.system:system_of",
        "system_parameters": "bellcrank.dynamics.system:system_parameters",
        "notes": "bellcrank.simulation.scene_notes:scene_notes",
    }

    def __repr__(self) -> str:
        return f"Scene('{self.name}', {self.robot!r}, from {self.source.name})"

    @property
    def name(self) -> str:
        """What the scene calls itself."""
        return self.config.name

    @property
    def source(self) -> Path:
        """The scene's file, or the URDF."""
        return self.config.source

    @cached_property
    def data(self) -> dict[str, Any]:
        """The scene's YAML mapping, overrides in it."""
        data: dict[str, Any] = plain(self.source_data)
        return data

    def motion(self, name: str) -> Motion:
        """One of the configuration's motions, made once; InputError or UnreachableError naming the place."""
        arguments.text("name", name, "the name of a motion")
        return self.motion_of(name)

    def with_overrides(self, overrides: Mapping[str, Any]) -> Scene:
        """The scene with changes by dotted path (overrides.py), checked anew; InputError names the override."""
        data, notes = apply_overrides(self.source_data, overrides, str(self.source))

        def own(mapping: Mapping[str, Any]) -> dict[str, Any]:
            return {key: plain(value) for key, value in mapping.items() if key not in SCENE_KEYS}

        notes = tuple(dict.fromkeys((*self.config.deprecations, *notes)))
        same_robot = own(data) == own(self.source_data)
        changed = _read(data, self.source, self.access, notes, self if same_robot else None)
        mine = tuple(constraint for constraint in self.constraints if isinstance(constraint, FunctionConstraint))
        return replace(changed, constraints=(*changed.constraints, *mine)) if mine else changed

    def with_constraint(self, function: Callable[[Symbols], Any], name: str = "own", unit: str = "1") -> Scene:
        """The scene with a constraint of your own: `function` takes Symbols (joints, frames, t, q, v, parameters) and
        gives casadi expressions that stay zero, each in `unit`: of positions, or linear in velocities.

        The run of such a scene cannot be saved, since no file holds the function. Raises InputError where it gives
        something else.
        """
        arguments.function("function", function, "a function of Symbols that gives casadi expressions")
        arguments.text("name", name)
        arguments.text("unit", unit, "a unit such as 'm' or 'rad/s', or '1'")
        if name in [constraint.name for constraint in self.constraints]:
            raise InputError(f"{self.source}: with_constraint: the name '{name}' is taken by another constraint")
        from bellcrank.elements.symbols import Symbols

        symbols = Symbols(self.robot, self.parameters, self.frames)
        own = function_constraint(function, name, unit, symbols, self.source)
        return replace(self, constraints=(*self.constraints, own))

    @property
    def files(self) -> dict[str, str]:
        """What the tables and motions held when they were read, by what is written under `file`."""
        found = dict(csv_texts(self.config.motions.values())) | self.loop_files
        return found | {
            str(p.place.raw("file")): p.text for p in self.forces if isinstance(p, Torque | Wrench) and p.text
        }

    @property
    def parameter_values(self) -> Array:
        """The values of the parameters (np,), in SI units."""
        return np.array([parameter.value for parameter in self.parameters.values()], dtype=np.float64)

    @property
    def own_parameters(self) -> Array:
        """The scene's parameters, and Baumgarte's gains where they are used."""
        s = self.settings.stabilisation
        gains = [s.alpha, s.beta] if self.constraints and s.kind == "baumgarte" else []
        return np.append(self.parameter_values, gains)

    @cached_property
    def structure_key(self) -> str:
        """A digest of all that the equations depend on besides the values of parameters."""
        from bellcrank.codegen.cache import digest
        from bellcrank.codegen.compile import sources

        return digest(self.robot.key, self.physics_key(), sources())

    # ---- signals

    @property
    def signal_sources(self) -> tuple[SignalSource, ...]:
        """Where the entries of u come from, in their order."""
        found = [part.source for part in (*self.forces, *self.control, *self.constraints)]
        return tuple(dict.fromkeys(source for source in found if source is not None))

    @cached_property
    def signals(self) -> tuple[Signal, ...]:
        """The signals u(t); InputError or UnreachableError where a motion cannot be made."""
        return tuple(signal_after(source, self.initial.clock) for source in self.signal_sources)

    @cached_property
    def stops(self) -> Array:
        """Times (k,) s at which signals jump, besides the breaks of kinked ones: no step should cross them."""
        stops = [stops_after(source, self.initial.clock) for source in self.signal_sources]
        return np.unique(np.concatenate([np.zeros(0), *stops]))

    def signals_at(self, times: Array) -> Array:
        """All signals (n, nu) at times (n,) s."""
        return values_at(self.signals, arguments.array("times", times, (None,), "s"))

    # ---- equations

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that forces, events and outputs use."""
        groups = [p.frames for p in (*self.forces, *self.control, *self.constraints)]
        groups += [e.frames for e in self.events] + [o.frames for o in self.outputs.values()]
        return tuple(dict.fromkeys(name for group in groups for name in group))

    def physics_key(self) -> str:
        """All that the equations depend on besides the robot, as a text: not the start, nor the values of parameters,
        nor solver settings, nor what motions and tables hold.
        """
        places = {source: k for k, source in enumerate(self.signal_sources)}
        targets = [[name, parameter.sets] for name, parameter in self.parameters.items()]
        baumgarte = bool(self.constraints) and self.settings.stabilisation.kind == "baumgarte"
        parts = [
            baumgarte,
            self.constraints,
            self.forces,
            self.control,
            targets,
            self.events,
            list(self.outputs.values()),
        ]
        if self.initial.clock:
            parts.append(["clock", self.initial.clock])
        return json.dumps(_content(parts, places))


def load_scene(path_or_name: str | Path, overrides: Mapping[str, Any] | None = None, *, trust: Trust = ()) -> Scene:
    """Read a scene from a file, or by the name of a bundled one; a URDF (path or name) is a scene without forces.

    `overrides` changes it by dotted path: {"initial.crank": "1.5 deg", "simulate.rtol": 1e-6} (overrides.py). Files
    that it names lie near it, or in the folders `trust` (files/access.py). Raises InputError, one sentence naming file
    and key, for whatever is not as it should be.
    """
    if overrides is not None:
        arguments.mapping("overrides", overrides, "a mapping such as {'simulate.rtol': 1e-6}")
    source, urdf = find_config(path_or_name)
    notes: tuple[str, ...] = ()
    if urdf:
        data = source_mapping({"name": source.stem, "urdf": str(source.resolve())})
        access = FileAccess.of(source.resolve(), trust)
        access = replace(access, trusted=(*access.trusted, source.resolve()))
    else:
        (data, notes), access = read_scene_data(source), FileAccess.of(source, trust)
    if overrides:
        data, more = apply_overrides(data, overrides, str(source))
        notes += more
    return _read(data, source, access, tuple(dict.fromkeys(notes)))


def load_held_scene(source: Path) -> Scene:
    """The scene of a file that may name files in its own folder only. Raises InputError as `load_scene`.

    Such a file was written by a program: old keys in it give no deprecation notes.
    """
    return _read(read_scene_data(source)[0], source, FileAccess(source.parent, source.parent, held=True))


def scene_of_run(source: Path) -> RunScene:
    """What a start takes from the scene inside a saved run."""
    scene = load_held_scene(source)
    return RunScene(scene.robot, scene.initial.clock, frozenset(rule.name for rule in scene.events if rule.latch))


def _read(
    data: Mapping[str, Any],
    source: Path,
    access: FileAccess,
    deprecations: tuple[str, ...] = (),
    like: Scene | None = None,
) -> Scene:
    """The scene of a mapping; configuration and robot are those of `like`, whose mapping has the same configuration."""
    read = Fields(data, str(source), access=access)
    config = config_from_fields(read, source)
    robot, motion_of = (config.robot(), None) if like is None else (like.robot, like.motion_of)
    config = replace(config if like is None else like.config, deprecations=deprecations)
    if motion_of is None:
        motion_of = _Motions(config, robot)
    names = read.raw("parameters", {})
    context = ReadContext(robot, config.motions, motion_of, names if isinstance(names, Mapping) else {})
    constraints = read_constraints(read, context)
    if not config.actuated:
        config = replace(config, actuated=imported_motors(constraints, robot))
    loop_files = {name: read_text(path) for name, path in _named_files(constraints).items()}
    forces = read_forces(read, robot)
    control = read_control(read, robot, config.motions, motion_of)
    refuse_joints_off_paths(constraints, control, robot, config.motions)
    initial = read_initial(read, robot, config.motions, scene_of_run)
    parts: tuple[Element, ...] = (*forces, *control, *constraints)
    parameters = read_parameters(read, robot, parts)
    events = read_events(read, robot, parameters, constraints)
    outputs = read_outputs(read, robot, parameters, parts)
    settings = read_settings(read.mapping("simulate", {}))
    try:
        check_rows(settings.samples, robot.nq + robot.nv)
    except InputError as error:
        raise read.mapping("simulate").error("samples", str(error)) from None
    read.done()
    return Scene(
        config=config,
        robot=robot,
        constraints=constraints,
        forces=forces,
        control=control,
        initial=initial,
        parameters=parameters,
        events=events,
        outputs=outputs,
        settings=settings,
        motion_of=motion_of,
        source_data=data,
        access=access,
        loop_files=loop_files,
    )


class _Motions(Portable):
    """The motions of a configuration for a robot by name, each made once, when first asked for."""

    def __init__(self, config: RobotConfig, robot: Robot) -> None:
        self.config, self.robot = config, robot

    @cached_property
    def _made(self) -> dict[str, Motion]:
        return {}

    def __call__(self, name: str) -> Motion:
        if name not in self._made:
            self._made[name] = self.config.motion(self.robot, name)
        return self._made[name]


def _named_files(constraints: Iterable[Constraint]) -> dict[str, Path]:
    return {str(c.place.raw("file")): c.place.file("file") for c in constraints if "file" in c.place}


def _content(value: Any, places: Mapping[SignalSource, int]) -> Any:
    """Data that JSON can hold of what forces, events and outputs say."""
    if isinstance(value, SignalSource):
        return ["signal", places[value], value.width, value.derivatives]
    if isinstance(value, RobotJoint):
        return value.name
    if is_dataclass(value):
        pairs = {f.name: _content(getattr(value, f.name), places) for f in fields(value) if f.compare}
        return [type(value).__name__, pairs]
    if isinstance(value, Mapping):
        return {str(key): _content(entry, places) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_content(entry, places) for entry in value]
    return value
