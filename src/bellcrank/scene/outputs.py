"""The outputs of a scene: named quantities that a simulation records besides positions and velocities.

outputs: {NAME: ENTRY}, where an entry is one of

- {frame, what: position | velocity | rotation | angular_velocity}, in world axes;
- {joint, what: position | velocity | acceleration | torque};
- {energy: kinetic | potential | total};
- {momentum: linear | angular} of a robot with a free base, the angular momentum about the world's origin;
- {force: NAME} of a force or controller: the generalised force at its joints, positive along their coordinates
  (negative for a stretched joint_spring), the tension of a spring, or a wrench in world axes;
- {work: NAME | all}: the work of a force or controller since the start, or of all of them, of the robot's friction, and
  of constraints that move and impacts together;
- {constraint: NAME, what: multipliers | contact_point | friction_demand}: multipliers are forces on the body of the
  first frame; the others, of a rolling disk, are the point of contact in the world and friction over normal force;
- {expression, unit} (elements/expression.py).

A drive (elements/drives.py) that none of them names has an output of its own name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bellcrank.config.fields import Fields
from bellcrank.elements.constraint import Constraint
from bellcrank.elements.drives import Drive
from bellcrank.elements.element import Element, Force, read_frame, read_joint
from bellcrank.elements.expression import Expression, Term, parse_expression
from bellcrank.elements.joint_stops import JointStop
from bellcrank.elements.rolling_constraint import RollingDisk
from bellcrank.elements.supply import Supply
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.robot.robot import Robot
from bellcrank.scene.events import read_expression
from bellcrank.scene.output_quantities import (
    CONSTRAINT_WHAT,
    ENERGIES,
    FRAME_LABELS,
    JOINT_WHAT,
    MOMENTA,
    ConstraintOutput,
    ContactOutput,
    DemandOutput,
    EnergyOutput,
    ExpressionOutput,
    ForceOutput,
    FrameOutput,
    JointOutput,
    MomentumOutput,
    OutputQuantity,
    WorkOutput,
)

if TYPE_CHECKING:
    import casadi

    from bellcrank.scene.output_quantities import EquationSymbols


FRAME_WHAT = {"position": "", "velocity": "v", "angular_velocity": "w"}  # what precedes x, y, z in a term
ALL = "all"  # forces and controllers


class OutputTerms:
    """The terms of a scene's outputs, read from the entries of `outputs` when they are named."""

    def __init__(self, read: Fields, robot: Robot, parameters: object) -> None:
        self._read, self._robot, self._parameters = read, robot, parameters if isinstance(parameters, dict) else {}
        self._open: list[str] = []  # outputs that are being read

    def __call__(self, name: str, component: str) -> Term:
        """The term of an output, or of a component of it. Raises InputError where a force cannot depend on it."""
        table = self._read.mapping("outputs", {})
        if name not in table:
            raise InputError(unknown_name("output", name, table.keys()))
        if name in self._open:
            raise InputError(f"the outputs {', '.join([*self._open, name])} depend on each other")
        self._open.append(name)
        try:
            return self._term(table.mapping(name), name, component)
        finally:
            self._open.pop()

    def _term(self, entry: Fields, name: str, component: str) -> Term:
        if "frame" in entry:
            what = entry.choice("what", (*FRAME_WHAT, "rotation"), "position")
            if what in FRAME_WHAT:
                if component not in ("x", "y", "z"):
                    raise InputError(f"expected output('{name}').x, .y or .z")
                return Term("frame", value=(read_frame(entry, self._robot), FRAME_WHAT[what] + component))
        if component and ("joint" in entry or "expression" in entry):
            raise InputError(f"output '{name}' is one number; write output('{name}')")
        if "joint" in entry:
            joint = read_joint(entry, self._robot)
            return Term("joint", value=(joint.name, entry.text("what", "position")))
        if "expression" in entry:
            return self._expression(entry).term
        raise InputError(
            f"output '{name}' is not a position or velocity; a force can depend on outputs of a frame, a joint or an "
            "expression"
        )

    def _expression(self, entry: Fields) -> Expression:
        given = entry.raw("expression")
        return parse_expression(str(given), self._robot, self._parameters, self)


@dataclass(frozen=True)
class Output:
    """A named quantity of a simulation, with one or several columns."""

    name: str
    quantity: OutputQuantity

    @property
    def labels(self) -> tuple[str, ...]:
        """The titles of its columns, such as "coriolis [m/s^2]"."""
        return tuple(f"{self.name} {suffix}" for suffix in self.quantity.suffixes())

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that it uses."""
        return self.quantity.frames

    def value(self, equations: EquationSymbols) -> casadi.SX:
        """The values of the columns (len(labels)) over the symbols of a scene and the solution of its equations."""
        return self.quantity.value(equations)


def read_outputs(
    read: Fields, robot: Robot, parameters: Mapping[str, Any], parts: Sequence[Element]
) -> dict[str, Output]:
    """Read the mapping `outputs` of a scene with these elements. Raises InputError naming file and key."""

    def frame(entry: Fields) -> OutputQuantity:
        return FrameOutput(read_frame(entry, robot), entry.choice("what", tuple(FRAME_LABELS), "position"))

    def joint(entry: Fields) -> OutputQuantity:
        return JointOutput(read_joint(entry, robot), entry.choice("what", JOINT_WHAT, "position"))

    def energy(entry: Fields) -> OutputQuantity:
        return EnergyOutput(entry.choice("energy", ENERGIES))

    def momentum(entry: Fields) -> OutputQuantity:
        if not robot.floating_base:
            raise entry.error("momentum", "'momentum' requires a free base; write floating_base: true")
        return MomentumOutput(entry.choice("momentum", tuple(MOMENTA)))

    def force(entry: Fields) -> OutputQuantity:
        name = entry.text("force")
        forces = [part for part in parts if isinstance(part, Force)]
        found = [part for part in forces if part.name == name]
        if not found:
            raise entry.error("force", unknown_name("force or controller", name, [part.name for part in forces]))
        if len(found) > 1:
            raise entry.error("force", f"a force and a controller are both named '{name}'; rename one of them")
        return ForceOutput(found[0], found[0].labels(robot))

    def work(entry: Fields) -> OutputQuantity:
        forces, name = [part for part in parts if isinstance(part, Force)], entry.text("work")
        if name == ALL:
            acting = tuple(part for part in forces if not isinstance(part, JointStop))
            return WorkOutput(entry.path.rpartition(".")[2], acting, True)
        found = tuple(part for part in forces if part.name == name)
        if not found:
            known = [ALL, *(part.name for part in forces)]
            raise entry.error("work", unknown_name("force or controller", name, known))
        return WorkOutput(entry.path.rpartition(".")[2], found, False)

    def constraint(entry: Fields) -> OutputQuantity:
        constraints = {part.name: part for part in parts if isinstance(part, Constraint)}
        name, what = entry.text("constraint"), entry.choice("what", CONSTRAINT_WHAT, "multipliers")
        if name not in constraints:
            raise entry.error("constraint", unknown_name("constraint", name, constraints))
        chosen = constraints[name]
        if what == "multipliers":
            return ConstraintOutput(chosen, chosen.labels(robot))
        if not isinstance(chosen, RollingDisk):
            raise entry.error(
                "what", f"'{what}' requires a rolling disk, but constraint '{name}' is of kind '{chosen.kind}'"
            )
        return ContactOutput(chosen) if what == "contact_point" else DemandOutput(chosen)

    def expression(entry: Fields) -> OutputQuantity:
        return ExpressionOutput(read_expression(entry, robot, parameters), entry.unit())

    kinds: dict[str, Callable[[Fields], OutputQuantity]] = {
        "frame": frame, "joint": joint, "energy": energy, "momentum": momentum, "force": force, "work": work,
        "constraint": constraint, "expression": expression,
    }  # fmt: skip
    table = read.mapping("outputs", {})
    outputs = {}
    for name in table:
        entry = table.mapping(name)
        there = [kind for kind in kinds if kind in entry]
        if len(there) != 1:
            found = " and ".join(there) or ", ".join(entry.keys()) or "nothing"
            raise table.error(name, f"expected one of the keys {', '.join(kinds)}, found {found}")
        outputs[name] = Output(name, kinds[there[0]](entry))
        entry.done()
    for part in parts:
        if isinstance(part, Drive | Supply) and output_of(outputs, part) is None:
            name = part.name
            while name in outputs:
                name += "_"
            outputs[name] = Output(name, ForceOutput(part, part.labels(robot)))
    return outputs


def output_of(outputs: Mapping[str, Output], force: Force) -> Output | None:
    """The first output of a force or controller; None where there is none."""
    for output in outputs.values():
        if isinstance(output.quantity, ForceOutput) and output.quantity.force.name == force.name:
            return output
    return None
