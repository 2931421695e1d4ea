"""A scene: a robot configuration with constraints, forces, controllers, a start, parameters, events and outputs.

One YAML file serves sizing and simulation. A scene adds these keys to those of a robot configuration
(robot_config.py), all of them optional: constraints, forces, joints and control (bellcrank.elements: constraints.py,
forces.py, dry_friction.py, controllers.py), parameters (elements/parameters.py), initial and base (initial.py), events
(events.py), outputs (outputs.py), simulate (settings.py), study and optimise (study.py).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.cached_values import Portable, cached_property
from bellcrank.config.fields import Fields
from bellcrank.config.yaml_file import read_yaml
from bellcrank.elements.clutch import read_clutches
from bellcrank.elements.constraint import Constraint, ReadContext
from bellcrank.elements.constraints import imported_motors, read_constraints
from bellcrank.elements.controller import ControlContext, Controller, Driven
from bellcrank.elements.controllers import StateFeedback, read_control
from bellcrank.elements.drive_fields import read_drives
from bellcrank.elements.drives import Drive
from bellcrank.elements.dry_friction import DryFriction, JointDryFriction, RestingJoint, read_dry_friction
from bellcrank.elements.element import AuxiliaryStates, Element, Force, HeldSource
from bellcrank.elements.expression_constraint import FunctionConstraint, function_constraint
from bellcrank.elements.forces import read_forces
from bellcrank.elements.formulas import FormulaReader
from bellcrank.elements.frame_forces import Wrench
from bellcrank.elements.frame_joints import refuse_joints_off_paths
from bellcrank.elements.joint_constraints import PrescribedMotion
from bellcrank.elements.joint_forces import Torque
from bellcrank.elements.joint_stops import GearContact, JointStop, read_joint_stops
from bellcrank.elements.parameters import Parameter, is_of_the_tree, read_parameters
from bellcrank.elements.pin_friction import read_pin_friction
from bellcrank.elements.rotor_friction import RotorFriction
from bellcrank.elements.sampled_controllers import StateSpace
from bellcrank.elements.signals import Signal, SignalSource, signal_after, stops_after, values_at
from bellcrank.elements.supply import Supply, read_supply
from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess, Trust, read_text
from bellcrank.motion.entry_kinds import csv_texts
from bellcrank.notes import Note, in_use
from bellcrank.robot.robot import Robot, RobotJoint
from bellcrank.scene.events import EventRule, read_events
from bellcrank.scene.initial import Initial, read_initial
from bellcrank.scene.output_quantities import WorkOutput
from bellcrank.scene.outputs import Output, OutputTerms, read_outputs
from bellcrank.scene.overrides import apply_overrides, declared
from bellcrank.scene.robot_config import (
    CONFIG_KEYS,
    SCENE_KEYS,
    RobotConfig,
    config_from_fields,
    find_config,
    robot_file_data,
)
from bellcrank.scene.robot_file_entries import with_robot_file, without_robot_file
from bellcrank.scene.saved_state import RunScene
from bellcrank.scene.settings import Settings, check_rows, read_settings
from bellcrank.scene.source_mapping import plain, source_mapping
from bellcrank.scene.study import OptimiseEntry, Study, read_optimise, read_study

if TYPE_CHECKING:
    from bellcrank.actuators.actuator import Actuator
    from bellcrank.elements.symbols import Symbols
    from bellcrank.motion.motion import Motion


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene(Portable):
    """The contents of a scene file, checked against the robot. Scenes are made by `load_scene`.

    A scene is a description only: `simulate`, `size`, `sweep` and `replay` take it and solve its equations. It does not
    change; `with_overrides` and `with_constraint` return new scenes.

    Attributes:
        config: The robot configuration in the same file: URDF, gravity, motions, actuators.
        robot: The robot that the configuration describes.
        constraints: Closed loops, couplings, prescribed motions, rolling contacts.
        forces: Springs, dampers, friction, torques, wrenches.
        control: The controllers.
        initial: Positions, velocities and clock at the start.
        parameters: Numbers that can be changed without compiling the equations again, by name.
        events: The conditions that are watched for during a simulation.
        outputs: The quantities that are recorded besides positions and velocities, by name.
        settings: The solver settings.
        study: What a sweep varies unless it is told something else.
        optimise: What `optimise` looks for unless it is told something else.
        motion_of: Function that returns a motion of the configuration by its name.
        source_data: The YAML mapping, with the line of each key and the override that set it.
        access: The rule which files the scene may name.
        loop_files: Texts of the files that constraints were read from, by the name written under `file`.

    Example:
        >>> import bellcrank as bc
        >>> scene = bc.load_scene("pendulum")
        >>> scene
        Scene('Simple pendulum', Robot('pendulum', 1 joints, nq=1, nv=1, pendulum.urdf), from pendulum.yaml)
        >>> list(scene.outputs)
        ['P1', 'energy']
    """

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
    study: Study
    optimise: OptimiseEntry
    motion_of: Callable[[str], Motion] = field(repr=False)
    source_data: Mapping[str, Any] = field(repr=False)
    access: FileAccess = field(repr=False)
    loop_files: dict[str, str] = field(repr=False, default_factory=dict)

    def __repr__(self) -> str:
        return f"Scene('{self.name}', {self.robot!r}, from {self.source.name})"

    @property
    def name(self) -> str:
        """The scene's name: its key `name`, or the name of the file."""
        return self.config.name

    @property
    def source(self) -> Path:
        """The path of the scene's file, or of the URDF where the scene was made from one."""
        return self.config.source

    @cached_property
    def data(self) -> dict[str, Any]:
        """The scene's YAML mapping as plain dictionaries and lists, with the overrides applied.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_scene("pendulum", {"initial.swing": "10 deg"}).data["initial"]
            {'swing': '10 deg'}
        """
        data: dict[str, Any] = plain(self.source_data)
        return data

    @property
    def motions(self) -> tuple[str, ...]:
        """The names of the motions under the key `motions`; `motion` computes one.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_scene("planar_2r").motions
            ('elbow_up', 'elbow_down')
        """
        return tuple(self.config.motions)

    @property
    def actuators(self) -> Mapping[str, Actuator]:
        """The motor and gear of joints, by joint; of a coupled transmission by motor.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_scene("geared_pendulum").actuators["shoulder"].ratio
            50.0
        """
        return self.config.actuators

    def motion(self, name: str) -> Motion:
        """Compute one of the configuration's motions. It is computed once and then kept.

        Args:
            name: The name of a motion under the key `motions`.

        Returns:
            The motion of the robot's joints.

        Raises:
            InputError: There is no such motion, or its entry is wrong; the message names file, line and key.
            UnreachableError: The robot cannot reach a point of the motion.

        Example:
            >>> import bellcrank as bc
            >>> motion = bc.load_scene("planar_2r_tracking").motion("circle")
            >>> motion.position.shape
            (1001, 2)
        """
        arguments.text("name", name, "the name of a motion")
        return self.motion_of(name)

    def with_overrides(self, overrides: Mapping[str, Any]) -> Scene:
        """Return a scene with some keys changed. The changed scene is checked as a file is.

        Constraints that were added by `with_constraint` are kept. The robot is loaded again only if a key of its
        configuration changes.

        Args:
            overrides: New values by dotted path, such as {"initial.crank": "1.5 deg", "simulate.rtol": 1e-6}. Entries
                of lists are addressed by their name, or by their number from 1; a parameter by its name.

        Returns:
            The changed scene.

        Raises:
            InputError: A path does not exist or a value is wrong; the message names the override.

        Example:
            >>> import bellcrank as bc
            >>> scene = bc.load_scene("four_bar").with_overrides({"crank_length": "1.25 m", "simulate.rtol": 1e-8})
            >>> scene.parameter_values.tolist()
            [1.25, 1.2, 1.2, 1.241]
        """
        overrides = declared(self, overrides)
        data = apply_overrides(self.source_data, overrides)

        def own(mapping: Mapping[str, Any]) -> dict[str, Any]:
            return {key: plain(value) for key, value in mapping.items() if key == "joints" or key not in SCENE_KEYS}

        if self.config.file is not None and any(data.get(k) != self.source_data.get(k) for k in ("urdf", "robot_file")):
            bare = without_robot_file(self.source_data, self.config.file)
            data = apply_overrides(bare, overrides)
        same_robot = own(data) == own(self.source_data)
        changed = read_scene(data, self.source, self.access, self if same_robot else None)
        mine = tuple(constraint for constraint in self.constraints if isinstance(constraint, FunctionConstraint))
        return replace(changed, constraints=(*changed.constraints, *mine)) if mine else changed

    def with_constraint(self, function: Callable[[Symbols], Any], name: str = "own", unit: str = "1") -> Scene:
        """Return a scene with an additional constraint that a Python function defines.

        The trajectory of such a scene cannot be saved, since no file holds the function.

        Args:
            function: A function of `Symbols` (joint(name), frame(name), t, q, v, parameter(name)). It returns a
                casadi.SX column, or a list, of residuals that the solver keeps at zero: functions of positions
                (holonomic), or functions linear in velocities (non-holonomic).
            name: The name of the constraint; outputs and events refer to it.
            unit: The unit of each residual: "m", "rad", "m/s", …, or "1".

        Returns:
            The scene with the constraint as its last one.

        Raises:
            InputError: The name is taken, or the function returns something else.

        Example:
            The second joint turns by the angle of the first one, in the opposite direction:

            >>> import bellcrank as bc
            >>> def opposite(s):
            ...     return s.joint("shoulder").position + s.joint("elbow").position
            >>> scene = bc.load_scene("planar_2r").with_constraint(opposite, name="opposite", unit="rad")
            >>> [constraint.name for constraint in scene.constraints]
            ['opposite']
        """
        arguments.function("function", function, "a function of Symbols that returns casadi expressions")
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
        """The texts of the files that forces, motions and constraints were read from, by the name under `file`."""
        found = dict(csv_texts(self.config.motions.values())) | self.loop_files
        for part in (*self.forces, *self.control):
            if isinstance(part, Torque | Wrench | StateFeedback | StateSpace) and part.text:
                found[str(part.place.raw("file"))] = part.text
        return found

    @property
    def parameter_values(self) -> Array:
        """The values of the parameters (np,), in SI units and in the order of `parameters`.

        Example:
            >>> import bellcrank as bc
            >>> scene = bc.load_scene("four_bar")
            >>> dict(zip(scene.parameters, scene.parameter_values.tolist()))
            {'crank_length': 1.241, 'coupler_length': 1.2, 'rocker_length': 1.2, 'ground_length': 1.241}
        """
        return np.array([parameter.value for parameter in self.parameters.values()], dtype=np.float64)

    @property
    def own_parameters(self) -> Array:
        """The values of the parameters (np,), followed by alpha and beta (1/s) where Baumgarte's method is used."""
        s = self.settings.stabilisation
        gains = [s.alpha, s.beta] if self.constraints and s.kind == "baumgarte" else []
        return np.append(self.parameter_values, gains)

    @cached_property
    def structure_key(self) -> str:
        """A digest of everything that the equations depend on, except for the values of parameters."""
        from bellcrank.codegen.cache import digest
        from bellcrank.codegen.compile import sources

        return digest(self.robot.key, self.physics_key(), sources())

    @cached_property
    def elements(self) -> tuple[Element, ...]:
        """The forces, controllers and constraints, what gears and rotors hold, and joints that these hold."""
        own = (*self._rotor_friction, *self.gear_contacts)
        return (*self.forces, *self.control, *self.constraints, *own, *self._resting_joints)

    @cached_property
    def dry_friction(self) -> tuple[DryFriction, ...]:
        """The dry friction of joints and pins, which is among the forces."""
        return tuple(part for part in self.forces if isinstance(part, DryFriction))

    @property
    def parts_with_modes(self) -> tuple[DryFriction | JointStop | RestingJoint, ...]:
        """What sticks or holds, in the order of its modes in u: dry friction and rigid stops, then the joints that
        these hold in a linkage or behind a gear with backlash.
        """
        return tuple(part for part in self.elements if isinstance(part, DryFriction | JointStop | RestingJoint))

    @cached_property
    def drives(self) -> tuple[Drive, ...]:
        """The drives of actuators with a `model`, which are among the controllers."""
        return tuple(part for part in self.control if isinstance(part, Drive))

    @cached_property
    def supply(self) -> Supply | None:
        """The supply of the drives, which is among the forces; None: their bus keeps its voltage."""
        return next((part for part in self.forces if isinstance(part, Supply)), None)

    @cached_property
    def _rotor_friction(self) -> tuple[RotorFriction, ...]:
        return tuple(drive.friction for drive in self.drives if drive.friction is not None)

    @cached_property
    def _resting_joints(self) -> tuple[RestingJoint, ...]:
        """The joints of a closed linkage with dry friction, and those behind rigid gears with backlash and rotors with
        friction, that have none of their own.
        """
        own = [part.joint for part in self.forces if isinstance(part, JointDryFriction)]
        joints = [drive.joint for drive in self.drives if drive.contact is not None and drive.friction is not None]
        if self.constraints and self.dry_friction:
            joints = [joint for joint in self.robot.joints if joint.nv == 1]
        places = [part.place for part in (*self.dry_friction, *self._rotor_friction)]
        return tuple(RestingJoint(f"rest_{joint.name}", places[0], joint) for joint in joints if joint not in own)

    @property
    def sticking(self) -> dict[str, DryFriction]:
        """What dry friction can keep at rest, by name: a joint, a constraint, or "JOINT rotor" of a drive."""
        rotors = {f"{part.joint.name} rotor": part for part in self._rotor_friction}
        return {part.held: part for part in self.dry_friction} | rotors

    @cached_property
    def auxiliary_states(self) -> tuple[AuxiliaryStates, ...]:
        """The states of elements besides positions and velocities, in the order in which they follow these in x."""
        found = [states for part in self.elements if (states := part.auxiliary) is not None]
        return (*found, *(work.states for work in self.works))

    @cached_property
    def works(self) -> tuple[WorkOutput, ...]:
        """The outputs of work, which the solver integrates."""
        return tuple(o.quantity for o in self.outputs.values() if isinstance(o.quantity, WorkOutput))

    @property
    def stops_of_joints(self) -> tuple[JointStop, ...]:
        """The rigid stops of joints, which are among the forces."""
        return tuple(part for part in self.forces if isinstance(part, JointStop))

    @cached_property
    def gear_contacts(self) -> tuple[GearContact, ...]:
        """The flanks of rigid gears with backlash."""
        return tuple(drive.contact for drive in self.drives if drive.contact is not None)

    @property
    def contacts(self) -> tuple[JointStop, ...]:
        """The rigid stops of joints, and the flanks of gears."""
        return (*self.stops_of_joints, *self.gear_contacts)

    # ---- signals

    @property
    def notes(self) -> tuple[Note, ...]:
        """What the scene's files say and is not modelled, and their own notes.

        What is not modelled is reached where it acts: forces, loops, and servos of joints that neither the scene's
        control nor a prescribed motion drives.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_scene("pendulum").notes
            ()
        """
        driven = {joint.name for part in self.control for joint in part.joints}
        driven |= {part.joint.name for part in self.constraints if isinstance(part, PrescribedMotion)}
        found = in_use(self.config.notes, driven, bool(self.robot.gravity.any()))
        return (*found, *self.replaced_friction())

    def replaced_friction(self) -> Iterator[Note]:
        """A note for each joint whose other friction dry friction replaces.

        Returns:
            The notes, none where no joint has other friction.

        Example:
            >>> import bellcrank as bc
            >>> list(bc.load_scene("pendulum").replaced_friction())
            []
        """
        for part in self.forces:
            if not isinstance(part, JointDryFriction):
                continue
            viscous, coulomb = self.robot.replaced_friction.get(part.joint.name, (0.0, 0.0))
            if viscous or coulomb:
                yield Note(
                    f"joint '{part.joint.name}': dry_friction replaces its other friction, viscous {viscous:g} "
                    f"{part.unit('damping')} and Coulomb {coulomb:g} {part.unit('torque')}."
                )

    @property
    def signal_sources(self) -> tuple[SignalSource, ...]:
        """The sources of the signals u(t), in the order of their entries in u."""
        found = [part.source for part in self.elements]
        return (*dict.fromkeys(source for source in found if source is not None), *self.held_sources)

    @cached_property
    def held_sources(self) -> tuple[HeldSource, ...]:
        """The last of them: entries of u that a run finds (elements/element.py).

        First the sides of switches, then the modes of joints with dry friction, then what controllers hold.
        """
        found = [
            *(part.switch_sides for part in self.elements),
            *(part.mode for part in self.elements),
            *(part.samples for part in self.elements),
        ]
        return tuple(source for source in found if source is not None)

    @cached_property
    def signals(self) -> tuple[Signal, ...]:
        """The signals u(t) that forces, controllers and constraints follow: tables and motions.

        They are functions of the simulation's time, which is the clock minus the clock at the start. Reading the
        property computes the motions, and raises InputError or UnreachableError where one cannot be computed.
        """
        return tuple(signal_after(source, self.initial.clock) for source in self.signal_sources)

    @cached_property
    def stops(self) -> Array:
        """Times (k,), s, at which signals or their derivatives jump, apart from the breaks of kinked signals.

        No integration step should cross them.
        """
        stops = [stops_after(source, self.initial.clock) for source in self.signal_sources]
        return np.unique(np.concatenate([np.zeros(0), *stops]))

    def signals_at(self, times: Array) -> Array:
        """Evaluate all signals at given times.

        Args:
            times: Times (n,), s.

        Returns:
            The signals (n, nu): for each source its values, then their first and second derivatives where they are
            used.

        Raises:
            InputError: `times` is not a one-dimensional array of finite numbers, or a motion cannot be computed.

        Example:
            The motion of two joints, with first and second derivatives:

            >>> import bellcrank as bc
            >>> bc.load_scene("planar_2r_tracking").signals_at([0.0, 1.0]).shape
            (2, 6)
        """
        return values_at(self.signals, arguments.array("times", times, (None,), "s"))

    # ---- equations

    @property
    def frames(self) -> tuple[str, ...]:
        """The names of the frames that forces, controllers, constraints, events and outputs use, each once."""
        groups = [p.frames for p in self.elements]
        groups += [e.frames for e in self.events] + [o.frames for o in self.outputs.values()]
        return tuple(dict.fromkeys(name for group in groups for name in group))

    def physics_key(self) -> str:
        """Everything that the equations depend on except for the robot.

        The start, the values of parameters, the solver settings and the numbers in motions and tables are not part of
        it: changing them does not require new equations.

        Returns:
            A JSON text; two scenes of one robot with equal texts have the same equations.
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


@arguments.named
def load_scene(path_or_name: str | Path, overrides: Mapping[str, Any] | None = None, *, trust: Trust = ()) -> Scene:
    """Read a scene from a file, or by the name of a bundled one.

    Args:
        path_or_name: Path of a YAML file or a URDF, or name of a bundled scene or robot (`bellcrank robots` lists
            them). A URDF gives a scene without forces, constraints and controllers.
        overrides: Values to change, by dotted path, such as {"initial.crank": "1.5 deg", "simulate.rtol": 1e-6}; see
            `Scene.with_overrides`.
        trust: Folders from which files that the scene names may be read, besides the scene's own surroundings.

    Returns:
        The scene, checked against its robot.

    Raises:
        InputError: The file, one of the files that it names, or an override is wrong; the message is one sentence with
            file, line and key.

    Example:
        >>> import bellcrank as bc
        >>> scene = bc.load_scene("pendulum", {"simulate.duration": "2 s"})
        >>> scene.settings.duration
        2.0
    """
    if overrides is not None:
        arguments.mapping("overrides", overrides, "a mapping such as {'simulate.rtol': 1e-6}")
    source, urdf = find_config(path_or_name)
    if urdf:
        data, access = robot_file_data(source, trust)
    else:
        data, access = source_mapping(read_yaml(source)), FileAccess.of(source, trust)
    named = data.get("parameters")
    names = named if isinstance(named, Mapping) else {}
    of_tree = {path: v for path, v in (overrides or {}).items() if path not in names and is_of_the_tree(path)}
    others = {path: value for path, value in (overrides or {}).items() if path not in of_tree}
    scene = read_scene(apply_overrides(data, others) if others else data, source, access)
    return scene.with_overrides(of_tree) if of_tree else scene


def load_held_scene(source: Path) -> Scene:
    """Read the scene of a file that may name files in its own folder only. Raises InputError as `load_scene` does."""
    return read_scene(source_mapping(read_yaml(source)), source, FileAccess(source.parent, source.parent, held=True))


def scene_of_run(source: Path) -> RunScene:
    """The facts that a start takes from the scene inside a saved run. Raises InputError as `load_scene` does."""
    scene = load_held_scene(source)
    held = tuple((source.name, source.width) for source in scene.held_sources)
    auxiliary = tuple((states.name, states.size) for states in scene.auxiliary_states)
    latches = frozenset(rule.name for rule in scene.events if rule.latch)
    return RunScene(scene.robot, scene.initial.clock, latches, held, auxiliary)


def read_scene(data: Mapping[str, Any], source: Path, access: FileAccess, like: Scene | None = None) -> Scene:
    """Read a scene from a mapping.

    `like` is a scene whose mapping has the same robot configuration; its configuration and robot are used again.
    """
    file = None
    if like is None:
        data, file = with_robot_file(data, source, access)
    read = Fields(data, str(source), access=access)
    read.only((*CONFIG_KEYS, *SCENE_KEYS))  # first: what refers to the entries of a misspelt key is then not blamed
    config = replace(config_from_fields(read, source), file=file)
    if like is None:
        robot = config.robot()
        motion_of: Callable[[str], Motion] = _Motions(config, robot)
    else:
        config, robot, motion_of = like.config, like.robot, like.motion_of
    names = read.raw("parameters", {})
    context = ReadContext(robot, config.motions, motion_of, names if isinstance(names, Mapping) else {})
    constraints = read_constraints(read, context)
    if not config.actuated:
        config = replace(config, actuated=imported_motors(constraints, robot))
    loop_files = {name: read_text(path) for name, path in _named_files(constraints).items()}
    formulas = FormulaReader(robot, context.parameters, OutputTerms(read, robot, context.parameters))
    forces = read_forces(read, formulas)
    forces = (*forces, *read_dry_friction(read, formulas, forces))
    forces = (*forces, *read_clutches(read, formulas, forces))
    sticking = [part.held for part in forces if isinstance(part, DryFriction)]
    forces = (*forces, *read_pin_friction(constraints, forces, sticking))
    driven = [part.joint.name for part in constraints if isinstance(part, PrescribedMotion)]
    forces = (*forces, *read_joint_stops(read, robot, formulas, [force.name for force in forces], driven))
    motors = config.actuated or config.joints_with_actuators
    initial = read_initial(read, robot, config.motions, motors, scene_of_run)
    held = {} if initial.saved is None else initial.saved.held
    control_context = ControlContext(Driven.of(robot, motors), config.motions, motion_of, formulas, initial.clock, held)
    control = read_control(read, control_context)
    taken = [force.name for force in forces]
    drives = read_drives(read, config.actuators, robot, control_context, sticking, control, taken)
    if supply := read_supply(read, config.conditions, drives, config.actuators, taken):
        drives, forces = supply.drives, (*forces, supply)
    control = (*control, *drives)
    refuse_joints_off_paths(constraints, control, robot, config.motions)
    parts: tuple[Element, ...] = (*forces, *control, *constraints)
    parameters = read_parameters(read, robot, parts)
    events = read_events(read, robot, parameters, constraints)
    outputs = read_outputs(read, robot, parameters, parts)
    settings = read_settings(read.mapping("simulate", {}))
    try:
        check_rows(settings.samples, robot.nq + robot.nv)
    except InputError as error:
        raise read.mapping("simulate").error("samples", str(error)) from None
    study = read_study(read.mapping("study", {}))
    optimise = read_optimise(read.mapping("optimise", {}))
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
        study=study,
        optimise=optimise,
        motion_of=motion_of,
        source_data=data,
        access=access,
        loop_files=loop_files,
    )


class _Motions(Portable):
    """The motions of a configuration for a robot, by name; each is computed once, when it is first used."""

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
    """Convert the fields of forces, events and outputs to data that JSON can hold."""
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
