"""`scene_casadi`: a scene's equations of motion as a casadi Function."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bellcrank import arguments
from bellcrank.dynamics.equations.assembly import assemble
from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.errors import InputError

if TYPE_CHECKING:
    from pathlib import Path

    import casadi

    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene


@arguments.named
def scene_casadi(scene: Scene | Robot | str | Path) -> casadi.Function:
    """The right-hand side of a scene's equations of motion as a casadi Function of expressions.

    Inputs: the time t (s), position q (nq), velocity v (nv), signals u (nu: what tables and motions give at t, then
    what sampled controllers hold, so that a controller of your own can be put there; `scene.signals_at` has both for
    the start), and parameters p (np: the scene's parameters in their order, then alpha and beta of Baumgarte's
    method where it is used; `scene.own_parameters` has their values). Outputs: q_rate (nq), the acceleration a (nv),
    and the multipliers of the constraints (none without constraints). Forces, control, friction and constraints are
    included, as simulations have them; all in SI units.

    The sides of `abs`, `sign`, `step`, `min`, `max` and `active` follow from t, q and v here; a simulation holds them
    between the times at which they change, and their entries in u have no effect.

    The constraints' equations are solved within the expressions by the proximal method. The usual sizes of their rows,
    by which they are weighted, are numbers: those of the scene's own parameters.

    Args:
        scene: The scene.

    Returns:
        (t, q, v, u, p) -> q_rate, a, multipliers: a casadi.Function of SX expressions.

    Raises:
        InputError: The argument is no scene, a force cannot act on its robot, or a constraint can never hold.

    Example:
        >>> import bellcrank as bc
        >>> scene = bc.load_scene("pendulum")
        >>> function = bc.scene_casadi(scene)
        >>> function.name_in(), function.name_out()
        (['t', 'q', 'v', 'u', 'p'], ['q_rate', 'a', 'multipliers'])
        >>> function(0, 0.5, 0, [], scene.own_parameters)[1]
        DM(-4.70316)
    """
    import casadi

    from bellcrank.scene.load import given_scene

    scene = given_scene(scene)
    if scene.drives:
        raise InputError(
            f"{scene.source}: a drive ({scene.drives[0].name}) has states besides position and velocity, which this "
            "function does not take; remove its 'model'"
        )
    switches = bool(scene.dry_friction or scene.contacts) or any(part.switches for part in scene.elements)
    assembly = assemble(scene, held_sides=False) if switches else system_of(scene).assembly
    multipliers = casadi.SX(0, 1) if assembly.solution is None else assembly.solution.proximal.multipliers
    outputs = [assembly.rate, assembly.acceleration, multipliers]
    inputs = [assembly.t, assembly.q, assembly.v, assembly.u]
    whole = casadi.Function("whole", [*inputs, assembly.p], outputs)
    own = casadi.SX.sym("p", len(scene.own_parameters))
    internal = casadi.DM(system_parameters(scene)[own.numel() :])
    return casadi.Function(
        "right_hand_side", [*inputs, own], whole.call([*inputs, casadi.vertcat(own, casadi.SX(internal))]),
        ["t", "q", "v", "u", "p"], ["q_rate", "a", "multipliers"],
    )  # fmt: skip
