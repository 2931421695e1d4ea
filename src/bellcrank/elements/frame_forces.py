"""Forces at frames: a spring with a damper, and a wrench. The generalised force is Jᵀ F."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Self

from bellcrank.config.fields import Fields
from bellcrank.elements.element import NONNEGATIVE, Force, GeneralisedForce, Settable, number, read_frame
from bellcrank.elements.expression import Expression, Sides, Term
from bellcrank.elements.force_table import COMPONENTS, INTERPOLATIONS, read_wrench_table
from bellcrank.elements.formulas import FormulaReader, active_switches, common, on_or_off, read_active
from bellcrank.elements.signals import SignalSource
from bellcrank.robot.robot import Robot

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols

WORLD = "world"
# A spring's length is sqrt(d² + (SHORTEST free_length)² + NOTHING²), which is differentiable where its ends meet.
SHORTEST = 1e-9  # of its free length
NOTHING = 1e-30  # m


@dataclass(frozen=True)
class Spring(Force):
    """A spring with a damper between the origins of two frames, or between a frame and a point of the world.

    With the vector d from a to b and the length l = sqrt(d·d): tension = stiffness (l − free_length) + damping l̇ and
    V = ½ stiffness (l − free_length)². A length of 1e-9 times the free length is added in quadrature, so that l is
    differentiable where the ends meet. stiffness is in N/m; damping (N s/m) and free_length (m) are 0 by default.
    `frame_b: world` is the fixed world at `point` [x, y, z], m; the point is required where the robot has a frame
    `world` that is not fixed at the world's origin. The generalised force is Jᵀ F with J the Jacobian of the velocities
    of the ends.
    """

    frame_a: str
    frame_b: str
    stiffness: float
    damping: float
    free_length: float
    point: tuple[float, ...]
    kind: ClassVar[str] = "spring"

    @classmethod
    def read(cls, name: str, read: Fields, formulas: FormulaReader) -> Self:
        """Read it from its entry. Raises InputError naming file and key."""
        robot = formulas.robot
        read.known("frame_a", "frame_b", "point", "stiffness", "damping", "free_length")
        a = read_frame(read, robot, "frame_a")
        fixed = read.text("frame_b") == WORLD
        b = WORLD if fixed else read_frame(read, robot, "frame_b")
        if not fixed and "point" in read:
            raise read.error(
                "point", "'point' is only used with 'frame_b: world'; the origin of a frame is used otherwise"
            )
        if fixed and "point" not in read and _is_elsewhere(WORLD, robot):
            raise read.error(
                "frame_b",
                "'world' means the fixed world, but this robot also has a frame 'world' that is not fixed at the "
                "world's origin: for the fixed world write point: [0, 0, 0]; for the frame add another one by "
                "frames: {NAME: {link: world}} and write frame_b: NAME",
            )
        if a == b:
            raise read.error("frame_b", f"expected two different frames, found '{a}' twice")
        return cls(
            name, read, a, b,
            read.number("stiffness", "N/m"),
            number(read, "damping", "N s/m", 0.0, NONNEGATIVE),
            number(read, "free_length", "m", 0.0, NONNEGATIVE),
            read.vector("point", 3, "m", (0.0, 0.0, 0.0)),
        )  # fmt: skip

    @property
    def settable(self) -> dict[str, Settable]:
        """Every number can be set."""
        point = {f"point.{c}": Settable("m") for c in "xyz"} if self.frame_b == WORLD else {}
        return {
            "stiffness": Settable("N/m"), "damping": Settable("N s/m", NONNEGATIVE),
            "free_length": Settable("m", NONNEGATIVE), **point,
        }  # fmt: skip

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames at its ends."""
        return (self.frame_a,) if self.frame_b == WORLD else (self.frame_a, self.frame_b)

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The generalised force, potential energy and power that it adds to the equations of motion."""
        import casadi

        way, rate, length, slope, pull = self._geometry(symbols)
        force = casadi.jtimes(rate, symbols.v, -pull * way, True)
        stretch = length - self.value(symbols, "free_length")
        potential = 0.5 * self.value(symbols, "stiffness") * stretch * stretch
        return GeneralisedForce(force, potential, -self.value(symbols, "damping") * slope * slope, False)

    def wrenches(self, symbols: Symbols) -> tuple[tuple[str, casadi.SX], ...]:
        """The forces on the bodies at its ends, along the line between them, without moments about the origins."""
        import casadi

        way, _, _, _, pull = self._geometry(symbols)
        on_a, none = pull * way, casadi.SX.zeros(3, 1)
        found = ((self.frame_a, casadi.vertcat(on_a, none)), (self.frame_b, casadi.vertcat(-on_a, none)))
        return found[: len(self.frames)]

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """The tension."""
        return ("[N]",)

    def measure(self, symbols: Symbols) -> casadi.SX:
        """The tension, N: positive where it pulls its ends together."""
        _, _, length, _, pull = self._geometry(symbols)
        return pull * length

    def _geometry(self, symbols: Symbols) -> tuple[casadi.SX, ...]:
        """The vector d, ḋ, l, l̇ and tension / l."""
        import casadi

        a = symbols.frame(self.frame_a)
        if self.frame_b == WORLD:
            way, rate = self.vector(symbols, "point") - a.position, -a.linear
        else:
            b = symbols.frame(self.frame_b)
            way, rate = b.position - a.position, b.linear - a.linear
        stiffness, damping, free = (self.value(symbols, k) for k in ("stiffness", "damping", "free_length"))
        least = SHORTEST * free
        length = casadi.sqrt(casadi.dot(way, way) + (least * least + NOTHING * NOTHING))
        slope = casadi.dot(way, rate) / length
        pull = stiffness * (1.0 - free / length) + damping * slope / length
        return way, rate, length, slope, pull


@dataclass(frozen=True)
class Wrench(Force):
    """A force (N) at a frame's origin and a torque (N m): numbers, formulas, or a table in a CSV `file`.

    `expressed_in` is "world" (the default) or "frame". Each component is a number or a formula (expression.py) of time,
    positions, velocities, parameters and outputs. A table over time has the column "time [s]" and one or more of "force
    x [N]", "force y [N]", "force z [N]", "torque x [N m]", "torque y [N m]" and "torque z [N m]"; components without a
    column are 0. A table over a formula, `over`, has its values in the first column (formulas.py). `interpolation` is
    "linear" (the default), "cubic" (a not-a-knot spline) or, over time, "hold" (each value until the next). The first
    and last values are held before and after the table. With `active`, a formula, it acts while that is positive. Its
    power is part of the work W.
    """

    frame: str
    force: tuple[float, ...]
    torque: tuple[float, ...]
    expressed_in: str
    table: SignalSource | None = None
    text: str = field(default="", repr=False, compare=False)  # of the table's file
    formula: Mapping[str, Expression] = field(default_factory=dict)  # by component: "force x", …
    active: Expression | None = None
    kind: ClassVar[str] = "wrench"

    @classmethod
    def read(cls, name: str, read: Fields, formulas: FormulaReader) -> Self:
        """Read it from its entry. Raises InputError naming file and key."""
        robot = formulas.robot
        read.known("frame", "force", "torque", "expressed_in", "file", "interpolation", "over")
        nothing, active = (0.0, 0.0, 0.0), read_active(read, formulas)
        frame, axes = read_frame(read, robot), read.choice("expressed_in", (WORLD, "frame"), WORLD)
        if "file" in read:
            for key in ("force", "torque"):
                if key in read:
                    raise read.error(key, f"'{key}' and 'file' exclude each other; remove one of them")
            if "over" in read:
                found, text = formulas.tables(read, COMPONENTS)
                return cls(name, read, frame, nothing, nothing, axes, None, text, found, active)
            interpolation = read.choice("interpolation", INTERPOLATIONS, "linear")
            table, text = read_wrench_table(read, interpolation)
            return cls(name, read, frame, nothing, nothing, axes, table, text, active=active)
        for key in ("interpolation", "over"):
            if key in read:
                raise read.error(key, f"'{key}' requires a 'file'; a wrench without a table is not interpolated")
        if "force" not in read and "torque" not in read:
            raise read.error("", "the key 'force' or 'torque' is missing: a wrench requires one of them, or a 'file'")
        vectors: list[tuple[float, ...]] = []
        formula: dict[str, Expression] = {}
        for key, unit in (("force", "N"), ("torque", "N m")):
            given = read.raw(key, nothing)
            if isinstance(given, (list, tuple)) and len(given) == 3 and any(isinstance(x, str) for x in given):
                each = [formulas.parsed(read, key, x, unit) for x in given]
                moving = [k for k, one in enumerate(each) if one.operations - {"number"}]
                formula |= {f"{key} {'xyz'[k]}": each[k] for k in moving}
                numbers = [0.0 if k in moving else read.parsed(key, x, unit) for k, x in enumerate(given)]
                vectors.append(tuple(numbers))
            else:
                vectors.append(read.vector(key, 3, unit, nothing))
        return cls(name, read, frame, vectors[0], vectors[1], axes, formula=formula, active=active)

    @property
    def settable(self) -> dict[str, Settable]:
        """Every component that is a number can be set."""
        if self.text:
            return {}
        every = {f"force.{c}": Settable("N") for c in "xyz"} | {f"torque.{c}": Settable("N m") for c in "xyz"}
        return {name: how for name, how in every.items() if name.replace(".", " ") not in self.formula}

    @property
    def formulas(self) -> tuple[Expression, ...]:
        """Its formulas, and `active`."""
        return (*self.formula.values(), *(() if self.active is None else (self.active,)))

    @property
    def switches(self) -> tuple[Term, ...]:
        """Those of its formulas, and `active`."""
        return active_switches(super().switches, self.active)

    @property
    def source(self) -> SignalSource | None:
        """The table."""
        return self.table

    @property
    def frames(self) -> tuple[str, ...]:
        """The frame it acts on, and those in its formulas."""
        return tuple(dict.fromkeys((self.frame, *common(self.formulas))))

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The generalised force, potential energy and power that it adds to the equations of motion."""
        import casadi

        at = symbols.frame(self.frame)
        wrench = self.measure(symbols)
        velocity = casadi.vertcat(at.linear, at.angular)
        force = casadi.jtimes(velocity, symbols.v, wrench, True)
        return GeneralisedForce(force, symbols.zero, casadi.dot(wrench, velocity), False)

    def wrenches(self, symbols: Symbols) -> tuple[tuple[str, casadi.SX], ...]:
        """The wrench on the frame's body."""
        return ((self.frame, self.measure(symbols)),)

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """Components of force and torque in world axes."""
        return (*(f"{c} [N]" for c in "xyz"), *(f"r{c} [N m]" for c in "xyz"))

    def measure(self, symbols: Symbols) -> casadi.SX:
        """Force (3), N, and torque (3), N m, in world axes."""
        import casadi

        sides = symbols.sides(self)
        if self.table is None:
            force, torque = (
                casadi.vertcat(*[self._component(symbols, name, c, sides) for c in "xyz"])
                for name in ("force", "torque")
            )
        else:
            both = symbols.signal(self.table)[:, 0]
            force, torque = both[:3], both[3:]
        if self.active is not None:
            on = on_or_off(self.active, symbols, sides)
            force, torque = on * force, on * torque
        if self.expressed_in == WORLD:
            return casadi.vertcat(force, torque)
        turn = symbols.frame(self.frame).rotation
        return casadi.vertcat(turn @ force, turn @ torque)

    def _component(self, symbols: Symbols, name: str, axis: str, sides: Sides) -> casadi.SX:
        import casadi

        formula = self.formula.get(f"{name} {axis}")
        return (
            casadi.SX(self.value(symbols, f"{name}.{axis}")) if formula is None else formula.value(symbols, None, sides)
        )


def _is_elsewhere(name: str, robot: Robot) -> bool:
    """Whether a frame of that name moves, or is not at the world's origin."""
    frames = [frame for frame in robot.equations.tree.frames[1:] if frame.name == name]
    return any(frame.parent_joint > 0 or any(frame.placement.translation) for frame in frames)
