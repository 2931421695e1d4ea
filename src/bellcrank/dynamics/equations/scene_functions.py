"""A scene's equations of motion as a casadi Function, and the derivatives of accelerations and constraint forces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.dynamics.equations.assembly import assemble
from bellcrank.dynamics.equations.linear_equations import equation_code
from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.errors import InputError
from bellcrank.files.access import Trust

if TYPE_CHECKING:
    from pathlib import Path

    import casadi

    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene


@arguments.named
def scene_casadi(
    scene: Scene | Robot | str | Path,
    *,
    overrides: Mapping[str, Any] | None = None,
    trust: Trust = (),
) -> casadi.Function:
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
        overrides: Changes of the scene by dotted path, such as {"initial.crank": "1.5 deg"}.
        trust: Where `scene` is a file, folders whose files it may name, besides those near it.

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

    scene = given_scene(scene, overrides, trust)
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


@dataclass(frozen=True, eq=False, kw_only=True)
class Slopes:
    """The derivatives of a vector (k,) of a scene.

    Attributes:
        position: (k, nv), by a displacement δ: the position q ⊕ δ is q moved along E(q) δ, so that δ is in the axes
            of v (for a free base a translation and a rotation vector in its own axes).
        velocity: (k, nv), by v.
        time: (k,), explicitly by time, signals such as tables and motions advancing with it.
        torque: (k, nv), by additional joint forces, N m or N.
        parameters: (k, np), by the scene's parameters in their order.

    Example:
        >>> import bellcrank as bc
        >>> slopes = bc.scene_derivatives(bc.load_scene("pendulum")).of_acceleration
        >>> slopes.position.shape, slopes.torque.shape
        ((1, 1), (1, 1))
    """

    position: Array
    velocity: Array
    time: Array
    torque: Array
    parameters: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class SceneDerivatives:
    """Accelerations and constraint forces of a scene at one state, and their derivatives.

    Attributes:
        acceleration: v̇ (nv,).
        multipliers: λ (m,), N or N m.
        multiplier_names: (constraint, label) of each multiplier.
        of_acceleration: The derivatives of v̇.
        of_multipliers: The derivatives of λ.

    Example:
        >>> import bellcrank as bc
        >>> found = bc.scene_derivatives(bc.load_scene("four_bar"))
        >>> found.acceleration.shape, len(found.multiplier_names)
        ((3,), 2)
    """

    acceleration: Array
    multipliers: Array
    multiplier_names: tuple[tuple[str, str], ...]
    of_acceleration: Slopes
    of_multipliers: Slopes


@arguments.named
def scene_derivatives(
    scene: Scene | Robot | str | Path,
    q: Any = None,
    v: Any = None,
    time: float = 0.0,
    torque: Any = None,
    *,
    overrides: Mapping[str, Any] | None = None,
    trust: Trust = (),
) -> SceneDerivatives:
    """The derivatives of a scene's accelerations and constraint forces, exact to rounding.

    The equations M v̇ + h − f − τ − Jᵀ λ = 0 and J v̇ + γ = 0 are differentiated before they are solved, and one
    solution of the KKT system gives the derivatives of v̇ and λ. Forces, controllers, friction, tables and
    constraints are included; Baumgarte's terms, which vanish where the constraints hold, are not.

    Where rows of constraints are redundant, λ and its derivatives are those of least norm, and the derivatives hold
    along displacements and changes of velocity that keep the constraints.

    Args:
        scene: The scene.
        q: Position (nq,); that of the start where it is not given.
        v: Velocity (nv,); that of the start where it is not given.
        time: s.
        torque: Additional joint forces τ (nv,), N m or N.
        overrides: Changes of the scene by dotted path, such as {"initial.crank": "1.5 deg"}.
        trust: Where `scene` is a file, folders whose files it may name, besides those near it.

    Returns:
        v̇, λ and their derivatives.

    Raises:
        InputError: An argument is wrong, or the mass matrix is singular in a direction that the constraints allow.

    Example:
        The pendulum's acceleration is −9.81 sin θ:

        >>> import bellcrank as bc
        >>> found = bc.scene_derivatives(bc.load_scene("pendulum"), q=[0.0], v=[0.0])
        >>> found.of_acceleration.position.round(6)
        array([[-9.81]])
    """
    from bellcrank.scene.load import given_scene

    scene = given_scene(scene, overrides, trust)
    robot, start = scene.robot, None
    if q is None or v is None:
        start = consistent_start(scene)
    position = start[0] if q is None and start else arguments.vector("q", q, robot.nq)
    velocity = start[1] if v is None and start else arguments.vector("v", v, robot.nv)
    tau = None if torque is None else arguments.vector("torque", torque, robot.nv, "N m or N")
    at = equation_code(scene).at(arguments.number("time", time, "s"), position, velocity, tau)
    found = {name: at.solved_by(name) for name in ("position", "velocity", "time", "torque", "parameters")}
    slopes = [
        Slopes(
            position=found["position"][part],
            velocity=found["velocity"][part],
            time=found["time"][part][:, 0],
            torque=found["torque"][part],
            parameters=found["parameters"][part],
        )
        for part in (0, 1)
    ]
    return SceneDerivatives(
        acceleration=at.acceleration,
        multipliers=at.multipliers,
        multiplier_names=system_of(scene).multiplier_names,
        of_acceleration=slopes[0],
        of_multipliers=slopes[1],
    )
