"""Outputs in the formulas of forces and controllers: output('NAME') or output('NAME').x stands for what it is of."""

from __future__ import annotations

from bellcrank.config.fields import Fields
from bellcrank.elements.element import read_frame, read_joint
from bellcrank.elements.expression import Expression, Term, parse_expression
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.robot.robot import Robot

FRAME_WHAT = {"position": "", "velocity": "v", "angular_velocity": "w"}  # what precedes x, y, z in a term


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
