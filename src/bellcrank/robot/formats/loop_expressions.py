"""Relations of joint positions, of robot files, as texts of expressions that vanish."""

from __future__ import annotations

from bellcrank.robot.formats.robot_file import JointCoupling, JointRelation


def relation_text(loop: JointCoupling | JointRelation) -> str:
    """The expression, of joint positions, that a relation keeps at zero."""
    if isinstance(loop, JointRelation):
        terms = [(coefficient, _position(joint)) for joint, coefficient in loop.terms]
        constant = loop.constant
    else:
        constant, *powers = loop.coefficients
        terms = [(1.0, _position(loop.joint))]
        if loop.leader is not None:
            terms += [(-c, f"{_position(loop.leader)}**{k}") for k, c in enumerate(powers, 1) if c]
    text = " + ".join(f"({coefficient!r})*{term}" for coefficient, term in terms)
    return f"{text} + ({-constant!r})"


def _position(joint: str) -> str:
    return f"joint({joint!r}).position"
