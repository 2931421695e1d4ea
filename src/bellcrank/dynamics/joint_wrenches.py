"""What each joint passes on: the tree's reaction, less what constraints and forces at frames put on links beyond it."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING

from bellcrank.dynamics.constraint_rows import rows_of
from bellcrank.elements.symbols import FrameSymbols, Symbols

if TYPE_CHECKING:
    import casadi

    from bellcrank.scene.scene import Scene


def joint_wrenches(scene: Scene) -> casadi.Function:
    """(t, q, v, u, p, a, λ) -> the wrench through each joint, joint after joint: force (N) then moment (N m) that the
    parent link exerts on the child link, in the joint's own (child) frame, about its origin.

    A virtual displacement δ of a frame changes φ by G δ (a virtual velocity changes ψ so), hence constraints put the
    wrench Gᵀ λ on the frame's link; springs and wrenches of the scene put theirs on the links of their frames. What the
    parent gives a joint's child is what the motion of all links beyond needs (recursive Newton-Euler), less all that
    others give them. What acts between joint coordinates (couplings, motors, joint springs, friction) passes across
    joints and not through them.
    """
    import casadi

    s = Symbols(scene.robot, scene.parameters, scene.frames, scene.initial.clock)
    for source in scene.signal_sources:  # all of them, in the order of the scene's signals
        s.signal(source)
    given = [item for force in scene.forces for item in force.wrenches(s)]
    kept = rows_of(scene).kept if scene.constraints else ()
    a, multipliers = casadi.SX.sym("a", scene.robot.nv), casadi.SX.sym("lambda", len(kept))
    tree = s.algorithm("reactions")(s.q, s.v, a, s.tracer_parameters)
    if scene.constraints:
        given += _loads(scene, s, kept, multipliers)
    wrenches = [(_joints_below(scene, name), s.frame(name).position, w) for name, w in given]
    columns = []
    for k, own in enumerate(s.joint_frames()):
        force, moment = tree[6 * k : 6 * k + 3], tree[6 * k + 3 : 6 * k + 6]
        for beyond, point, wrench in wrenches:
            if k + 1 in beyond:
                force -= own.rotation.T @ wrench[:3]
                moment -= own.rotation.T @ (wrench[3:] + casadi.cross(point - own.position, wrench[:3]))
        columns += [force, moment]
    return casadi.Function("joint_wrenches", [s.t, s.q, s.v, s.u, s.p, a, multipliers], [casadi.vertcat(*columns)])


def _loads(scene: Scene, s: Symbols, kept: tuple[int, ...], multipliers: casadi.SX) -> list[tuple[str, casadi.SX]]:
    """(frame, wrench of all constraints on its link: force, moment about its origin, world axes)."""
    import casadi

    names = list(dict.fromkeys(name for constraint in scene.constraints for name in constraint.frames))
    shift, speed = casadi.SX.sym("shift", 6, len(names)), casadi.SX.sym("speed", 6, len(names))
    touched = copy.copy(s)
    touched._frames = {name: _displaced(s.frame(name), shift[:, k], speed[:, k]) for k, name in enumerate(names)}
    residuals = [constraint.residual(touched) for constraint in scene.constraints]
    position = casadi.vertcat(casadi.SX(0, 1), *[r.position for r in residuals])
    velocity = casadi.vertcat(casadi.SX(0, 1), *[r.velocity for r in residuals])
    still = casadi.SX.zeros(6 * len(names), 1)
    both = casadi.vertcat(casadi.vec(shift), casadi.vec(speed))
    slope = casadi.vertcat(casadi.jacobian(position, casadi.vec(shift)), casadi.jacobian(velocity, casadi.vec(speed)))[
        list(kept), :
    ]
    slope = casadi.substitute(slope, both, casadi.vertcat(still, still))
    load = slope.T @ multipliers
    return [(name, load[6 * k : 6 * k + 6]) for k, name in enumerate(names)]


def _displaced(frame: FrameSymbols, shift: casadi.SX, speed: casadi.SX) -> FrameSymbols:
    """A frame after a small displacement (translation, rotation vector) and with a twist more, world axes."""
    import casadi

    return FrameSymbols(
        frame.position + shift[:3], (casadi.SX.eye(3) + casadi.skew(shift[3:])) @ frame.rotation,
        frame.linear + speed[:3], frame.angular + speed[3:],
    )  # fmt: skip


def _joints_below(scene: Scene, frame: str) -> set[int]:
    """The joints (numbers from 1) between a frame's link and the world."""
    robot = scene.robot
    return set(robot.equations.tree.supporting_joints(robot.frame_index(frame)))
