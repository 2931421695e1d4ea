"""The symbols of the expressions of forces, controllers and constraints, and kinematics and dynamics over them."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from bellcrank.cached_values import cached_property
from bellcrank.robot.model.traced_tree import trace_tree

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.element import AuxiliaryStates, Element
    from bellcrank.elements.expression import Term
    from bellcrank.elements.parameters import Parameter
    from bellcrank.elements.signals import SignalSource
    from bellcrank.robot.robot import Robot, RobotJoint

_FRAME = 18  # numbers for each frame: position 3, rotation 9, linear and angular velocity 3 each


class JointSymbols(NamedTuple):
    """A one-degree-of-freedom joint: position (rad or m), velocity, and its row in v."""

    position: casadi.SX
    velocity: casadi.SX
    row: int


class FrameSymbols(NamedTuple):
    """A frame in the world: position (3) m, rotation (3, 3), linear (3) m/s of its origin, angular (3) rad/s."""

    position: casadi.SX
    rotation: casadi.SX
    linear: casadi.SX
    angular: casadi.SX


class FrameSource(Protocol):
    """Frames as functions of other symbols than those of `Symbols`, such as the rotation of a free base."""

    def frame(self, name: str) -> FrameSymbols:
        """A frame's placement and velocity in the world."""
        ...

    def local_frame(self, name: str) -> tuple[FrameSymbols, casadi.SX]:
        """A frame in some axes B, and B (3, 3), as in `Symbols.local_frame`."""
        ...


class Additions(NamedTuple):
    """Symbols that are added to those of drives where their equations are linearised.

    Attributes:
        factor: By drive, what the torque that its speed controller asks is multiplied with.
        reference: By drive, what is added to its reference.
        torque: By drive, what is added to the torque of its motor.
        load: What is added to the joint forces (nv).
    """

    factor: Mapping[str, casadi.SX]
    reference: Mapping[str, casadi.SX]
    torque: Mapping[str, casadi.SX]
    load: casadi.SX


class Symbols:
    """Time t, position q (nq), velocity v (nv), signals u and parameters p, and the kinematics and dynamics over them.

    The targets of parameters are symbols in every traced algorithm. `frames` may list the frames that will be used, so
    that they are traced together. In expressions of a scene file, t stands for t + `clock` (s). With `held_sides`, the
    sides of switches of forces are entries of u, which a simulation holds; else they follow from the state.
    """

    def __init__(
        self,
        robot: Robot,
        parameters: Mapping[str, Parameter] | None = None,
        frames: Iterable[str] = (),
        clock: float = 0.0,
        held_sides: bool = False,
    ):
        import casadi

        self.robot = robot
        self.clock = clock
        self.held_sides = held_sides
        self.parameters = dict(parameters or {})
        self.t, self.q, self.v = (casadi.SX.sym(n, k) for n, k in (("t", 1), ("q", robot.nq), ("v", robot.nv)))
        self.p = casadi.SX.sym("p", len(self.parameters))
        self._places = {name: k for k, name in enumerate(self.parameters)}
        self._setters = {target: k for k, (_, p) in enumerate(self.parameters.items()) for target in p.sets}
        self._settings = [(*place, k) for k, p in enumerate(self.parameters.values()) for place in p.places]
        self._groups: dict[SignalSource, casadi.SX] = {}
        self._auxiliary: dict[AuxiliaryStates, casadi.SX] = {}
        self._algorithms: dict[str, casadi.Function] = {}
        self._frames: dict[str, FrameSymbols] = {}
        self._gathered = list(dict.fromkeys(frames))
        self._frame_source: FrameSource | None = None
        self.additions: Additions | None = None
        self.load_at_start = casadi.SX(robot.nv, 1)  # the forces that drives have to exert there (drives.py)
        # forces that follow from the accelerations: of dry friction at a stuck joint (stuck_joints.py), and of the
        # losses of a rigid gear (gear_losses.py), by name; and the loads of such gears
        self.holding: dict[str, casadi.SX] = {}
        self.gear_loads: dict[str, casadi.SX] = {}

    # ---- inputs

    @property
    def u(self) -> casadi.SX:
        """All signals used so far (nu), in the order of their first use."""
        import casadi

        return casadi.vertcat(casadi.SX(0, 1), *self._groups.values())

    @property
    def signal_rates(self) -> casadi.SX:
        """du/dt (nu), taken from the derivatives in u; the rates of the highest derivatives are set to 0."""
        import casadi

        rates = [casadi.SX(0, 1)]
        for source, u in self._groups.items():
            rates += [u[source.width :]] if source.derivatives else []  # an empty slice of a scalar has the wrong shape
            rates += [casadi.SX.zeros(source.width, 1)]
        return casadi.vertcat(*rates)

    def signal(self, source: SignalSource) -> casadi.SX:
        """The entries of a signal in u, (width, derivatives + 1): a column of values, then columns of derivatives."""
        import casadi

        if source not in self._groups:
            self._groups[source] = casadi.SX.sym(f"u{len(self._groups)}", source.size)
        return casadi.reshape(self._groups[source], source.width, source.derivatives + 1)

    @property
    def z(self) -> casadi.SX:
        """All auxiliary states used so far (nz), in the order of their first use."""
        import casadi

        return casadi.vertcat(casadi.SX(0, 1), *self._auxiliary.values())

    def auxiliary(self, states: AuxiliaryStates) -> casadi.SX:
        """The auxiliary states of an element, a column."""
        import casadi

        if states not in self._auxiliary:
            self._auxiliary[states] = casadi.SX.sym(f"z{len(self._auxiliary)}", states.size)
        return self._auxiliary[states]

    def auxiliary_place(self, states: AuxiliaryStates) -> int:
        """The first place of an element's auxiliary states in z."""
        self.auxiliary(states)
        names = list(self._auxiliary)
        return sum(each.size for each in names[: names.index(states)])

    def sides(self, part: Element) -> Mapping[Term, casadi.SX]:
        """The entries of u that hold the sides of the switches of a force; none where they follow from the state."""
        import casadi

        source = part.switch_sides if self.held_sides else None
        if source is None:
            return {}
        return dict(zip(part.switches, casadi.vertsplit(self.signal(source)), strict=True))

    def parameter(self, name: str) -> casadi.SX:
        """The symbol of a parameter."""
        return self.p[self._places[name]]

    def value(self, owner_kind: str, owner_name: str, field: str, number: float) -> casadi.SX | float:
        """The symbol of the parameter that sets "force.NAME.FIELD" (or "control.…"); otherwise the number."""
        k = self._setters.get(f"{owner_kind}.{owner_name}.{field}")
        return number if k is None else self.p[k]

    @property
    def zero(self) -> casadi.SX:
        """The scalar 0, for forces without potential or power."""
        import casadi

        return casadi.SX(0)

    # ---- kinematics

    def joint(self, joint: str | RobotJoint) -> JointSymbols:
        """The symbols of a joint with one degree of freedom. Raises InputError for other joints."""
        j = self.robot.one_degree_joint(joint, "scene") if isinstance(joint, str) else joint
        return JointSymbols(self.q[j.q], self.v[j.v], j.v)

    def frame(self, name: str) -> FrameSymbols:
        """A frame's placement and velocity in the world. Raises InputError for an unknown frame."""
        if self._frame_source is not None:
            return self._frame_source.frame(name)
        if name not in self._frames:
            wanted = [n for n in dict.fromkeys([*self._gathered, name]) if n not in self._frames]
            self._frames |= self.frames_at(wanted, self.q)
        return self._frames[name]

    def with_frames(self, source: FrameSource) -> Symbols:
        """A copy with the same symbols and signals, and frames from another source."""
        other = copy.copy(self)
        other._frame_source = source
        return other

    @property
    def named_frames(self) -> tuple[str, ...]:
        """The frames that are traced together at the first use of one of them."""
        return tuple(self._gathered)

    def joint_frames(self) -> list[FrameSymbols]:
        """The frames of all joints, mimicking ones included, in the order of `Robot.all_joint_names`."""
        frames = self.robot.equations.tree.frames
        places = {frame.name: k for k, frame in enumerate(frames) if frame.is_joint}
        return self._traced_frames([places[name] for name in self.robot.all_joint_names], self.q)

    def frames_at(self, names: Sequence[str], q: casadi.SX) -> dict[str, FrameSymbols]:
        """Frames in the world at the position q (nq), traced together."""
        return dict(zip(names, self._traced_frames([self.robot.frame_index(n) for n in names], q), strict=True))

    def _traced_frames(self, indices: Sequence[int], q: casadi.SX) -> list[FrameSymbols]:
        import casadi

        rows = _function(self._tree.frames(list(indices)))(q, self.v, self.tracer_parameters)
        parts = [rows[_FRAME * k : _FRAME * (k + 1)] for k in range(len(indices))]
        return [FrameSymbols(x[:3], casadi.reshape(x[3:12], 3, 3).T, x[12:15], x[15:18]) for x in parts]

    def local_frame(self, name: str) -> tuple[FrameSymbols, casadi.SX]:
        """A frame's placement and velocity in axes B in which their expressions are short, and B (3, 3).

        B is the identity, except while constraints are differentiated: then it is the rotation of a free base.
        """
        import casadi

        if self._frame_source is not None:
            return self._frame_source.local_frame(name)
        return self.frame(name), casadi.SX.eye(3)

    # ---- dynamics

    @property
    def tracer_parameters(self) -> casadi.SX:
        """The argument p of the traced algorithms: all parameters if one has a target in the tree, else none."""
        import casadi

        return self.p if self._settings else casadi.SX(0, 1)

    def algorithm(self, name: str) -> casadi.Function:
        """A traced algorithm with its last argument p: "forward_dynamics" (q, v, tau, p), "energy" (q, v, p), …"""
        if name not in self._algorithms:
            self._algorithms[name] = _function(getattr(self._tree, name)())
        return self._algorithms[name]

    def inverse_dynamics(self, q: casadi.SX, v: casadi.SX, a: casadi.SX, scale: casadi.SX | float = 1.0) -> casadi.SX:
        """Joint forces (nv) without friction, of a robot whose links have `scale` times their mass and inertia.

        Rotors, reflected to the joints, keep their inertia.
        """
        import casadi

        torque = self.algorithm("inverse_dynamics")(q, v, a, self.tracer_parameters)
        if isinstance(scale, float) and scale == 1.0:
            return torque
        rotor = casadi.SX(casadi.sparsify(casadi.DM(self.robot.rotor_inertia))) * a
        return scale * (torque - rotor) + rotor

    def holding_force(self, q: casadi.SX, gravity: casadi.SX) -> casadi.SX:
        """Joint forces (nv) that hold the links at rest under an acceleration of gravity (3,), m/s²; linear in it."""
        import casadi

        rest = casadi.SX.zeros(self.robot.nv, 1)
        total = casadi.SX(rest)
        for k, unit in enumerate(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))):
            total += gravity[k] * _function(self._traced(unit).inverse_dynamics())(
                q, rest, rest, self.tracer_parameters
            )
        return total

    def inertia(self) -> casadi.Function:
        """(q, a, p) -> M(q) a, rotors included, by recursive Newton-Euler without gravity."""
        import casadi

        f = _function(self._traced((0.0, 0.0, 0.0)).inverse_dynamics())
        q, v, a, p = f.sx_in()
        return casadi.Function("inertia", [q, a, p], [casadi.densify(f(q, casadi.SX.zeros(v.shape), a, p))])

    def response(self, forces: Sequence[casadi.SX]) -> casadi.SX:
        """M⁻¹ f (nv, k) of generalised forces (nv), by the articulated-body algorithm without gravity."""
        import casadi

        f, rest = _function(self._traced((0.0, 0.0, 0.0)).forward_dynamics()), casadi.SX.zeros(self.robot.nv, 1)
        return casadi.horzcat(*[f(self.q, rest, force, self.tracer_parameters) for force in forces])

    def joint_force(self, index: int, value: casadi.SX | float) -> casadi.SX:
        """A generalised force (nv) with one entry."""
        import casadi

        force = casadi.SX.zeros(self.robot.nv, 1)
        force[index] = value
        return force

    @cached_property
    def _tree(self) -> Any:
        gravity = (float(self.robot.gravity[0]), float(self.robot.gravity[1]), float(self.robot.gravity[2]))
        return self._traced(gravity)

    def _traced(self, gravity: tuple[float, float, float]) -> Any:
        count = len(self.parameters) if self._settings else 0
        return trace_tree(self.robot.equations.tree, gravity, self._settings, count)


def _function(serialized: bytes) -> casadi.Function:
    import casadi

    return casadi.Function.deserialize(serialized.decode("latin-1"))
