"""A run as functions of the numbers that a page lets its reader change, compiled to WebAssembly.

The functions are those that `simulate` calls (dynamics/equations/compiled_equations.py), with Baumgarte's gains as
parameters where there are constraints; one more gives the start and the parameters of values of the settings, and one
what the page shows of a state. src/cpp/integrator/page_engine.cpp calls them: it finds a consistent start, steps and
finds events by the code that `simulate` uses. Besides it needs a list of numbers, in the order in which it reads them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.arrays import Array
from bellcrank.codegen.expression_graph import graph_of
from bellcrank.codegen.webassembly import webassembly
from bellcrank.dynamics.constraints.constraint_derivatives import aligned_constraints
from bellcrank.dynamics.constraints.constraint_rows import rows_of
from bellcrank.dynamics.equations.design_parameters import RowSampling, row_sampling
from bellcrank.dynamics.equations.kkt import REGULARISATION
from bellcrank.dynamics.equations.system import system_of
from bellcrank.dynamics.inverse.input_breakpoints import prescribed_motion_end
from bellcrank.dynamics.postures.consistent_start import starts_further_away
from bellcrank.dynamics.postures.start_equations import start_equations
from bellcrank.elements.element import joint_unit
from bellcrank.robot.model.joints import lengths_in_position
from bellcrank.scene.events import ContactLost, LiesFlat
from bellcrank.scene.free_joint_start import quaternion_of
from bellcrank.scene.settings import Stabilisation
from bellcrank.simulation.integration.integration import event_search, state_layout, step_control
from bellcrank.simulation.integration.statistics import Status
from bellcrank.simulation.live_settings import Setting, parameter_settings, slider_end

if TYPE_CHECKING:
    import casadi

    from bellcrank.dynamics.equations.assembly import Assembly
    from bellcrank.dynamics.equations.compiled_equations import System
    from bellcrank.robot.robot import Robot, RobotJoint
    from bellcrank.scene.free_joint_start import FreeJointStart
    from bellcrank.scene.scene import Scene
    from bellcrank.simulation.trajectory.trajectory import Trajectory

Shown = Callable[["Assembly"], "casadi.SX"]  # begins with T, V and W, J
KERNELS = (
    "rhs", "fallback", "project", "project_fallback", "events", "linearised", "rows", "inertia", "cosines", "aligned",
    "start", "shown",
)  # fmt: skip
KINDS = ("one", "planar", "floating", "spherical")  # of joints, as in start_search.hpp
MOST_OPERATIONS = 12_000  # of the right-hand side: all functions of a larger one are more than a page should hold
MOST_SECONDS = 2.0  # of the native integrator: a page takes some times as long
TURNS = math.pi  # rad: how far a slider turns a joint
GAIN = 100.0  # 1/s: the largest of Baumgarte's gains on a slider
STABILISATION = "simulate.stabilisation"


@dataclass(frozen=True, kw_only=True)
class LiveSimulation:
    """A run that a page computes.

    Attributes:
        settings: What the reader can change.
        fixed: Sentences on numbers of the scene that the reader cannot change.
        modules: The WebAssembly modules of `KERNELS`; empty where there is none.
        description: The numbers that the engine reads.
        shown: How many numbers the page shows of a state.
    """

    settings: tuple[Setting, ...]
    fixed: tuple[str, ...]
    modules: tuple[bytes, ...]
    description: Array
    shown: int


def live_simulation(run: Trajectory, show: Shown) -> LiveSimulation | str:
    """A run for a page; `show` gives what is shown of a state. Or a clause that says why a page cannot compute it."""
    why = _obstacle(run)
    if why:
        return why
    scene = _with_gains(run)
    settings = _Settings(scene, run)
    system = system_of(scene)
    assembly = system.assembly
    shown = show(assembly)
    functions = {name: made.graph for name, made in _kernels(scene, system).items()}
    functions["start"] = _graph(settings.function())
    functions["shown"] = _graph(system.function_of_state("shown", [shown]))
    modules = tuple(webassembly(functions[name]) if name in functions else b"" for name in KERNELS)
    description = _Numbers(scene, run, settings, shown.numel()).found
    return LiveSimulation(
        settings=tuple(settings.all),
        fixed=tuple(settings.fixed),
        modules=modules,
        description=description,
        shown=shown.numel(),
    )


def _obstacle(run: Trajectory) -> str:
    """Why a page cannot compute a run; empty where nothing of it says so."""
    scene, settings, cost = run.scene, run.settings, run.statistics
    system = system_of(scene)
    if settings.step or settings.solver not in ("DOP853", "auto"):
        return "the page has the solver DOP853 with error control only"
    if cost.implicit_steps:
        return "the scene is stiff, and the page has an explicit solver only"
    if scene.held_sources or system.nz:
        return "the scene has dry friction, stops, drives, sampled controllers or forces with switches"
    if scene.initial.saved is not None or (scene.constraints and scene.initial.motion is not None):
        return "it starts in the state of another run, or of a motion"
    if any(rule.latch for rule in scene.events):
        return "an event latches"
    end = prescribed_motion_end(scene)
    if end is not None and end.time <= settings.duration:
        return "a prescribed motion ends before the run does"
    if run.status in (Status.INTERRUPTED, Status.CHATTERING, Status.CONTACT, Status.TURNED_OVER):
        return f"the run is {run.status}"
    if cost.kernel_time > MOST_SECONDS:
        return f"the integrator takes {cost.kernel_time:.2g} s, and a page takes some times as long"
    if system.operations > MOST_OPERATIONS:
        return f"the equations have {system.operations} operations"
    if starts_further_away(scene):
        return "its start is found by searches that the page does not have"
    return ""


def _with_gains(run: Trajectory) -> Scene:
    """The scene of a run with Baumgarte's gains as parameters where it has constraints; 0 without his method."""
    scene, settings = run.scene, run.settings
    if scene.constraints:
        kind = settings.stabilisation
        gains = (kind.alpha, kind.beta) if kind.kind == "baumgarte" else (0.0, 0.0)
        settings = replace(settings, stabilisation=Stabilisation("baumgarte", *gains))
    return replace(scene, settings=settings)


def _kernels(scene: Scene, system: System) -> dict[str, Any]:
    """The functions that `simulate` compiles as well."""
    found: dict[str, Any] = {"rhs": system.rhs}
    if scene.events:
        found["events"] = system.events
    if scene.constraints:
        found |= {"fallback": system.fallback, "project": system.project, "linearised": system.linearised}
        found["project_fallback"] = system.project_fallback
        if aligned_constraints(scene):
            found |= {"cosines": system.alignment_cosines, "aligned": system.alignment_residual}
        if rows_of(scene).parametric:
            sampling = row_sampling(scene)
            assert sampling.rows_code is not None
            found |= {"rows": sampling.rows_code, "inertia": sampling.inertia_code}
    return found


def _graph(function: casadi.Function) -> Any:
    return graph_of(function.serialize().encode("latin-1"))


class _Settings:
    """What the reader can change, and how the start and the parameters follow from it."""

    def __init__(self, scene: Scene, run: Trajectory) -> None:
        self.all: list[Setting] = []
        self.fixed: list[str] = []
        self.holds: list[int] = []  # the degree of freedom whose velocity a change holds, or -1
        self.gains: list[int] = []
        self._scene = scene
        self._motion = None if scene.initial.motion is None else scene.motion(scene.initial.motion)
        self._places: dict[tuple[Any, ...], int] = {}
        self._parameters()
        for joint in scene.robot.joints:
            if joint.nv == 1:
                self._joint(joint)
        for name, start in scene.initial.free.items():
            self._free(scene.robot, scene.robot.joint(name), start)
        if scene.constraints:
            kind = run.settings.stabilisation
            for k, (name, value) in enumerate(zip(("alpha", "beta"), scene.own_parameters[-2:].tolist(), strict=True)):
                self.gains.append(len(self.all))
                self._add(
                    ("gain", len(scene.parameters) + k),
                    Setting(
                        group="Baumgarte's gains" + ("" if kind.kind == "baumgarte" else f" in place of {kind.kind}"),
                        name=name,
                        unit="1/s",
                        value=value,
                        range=(0.0, slider_end(max(GAIN, 3.0 * value))),
                        path=STABILISATION,
                        entry=name,
                    ),
                )

    def _add(self, key: tuple[Any, ...], made: Setting, holds: int = -1) -> None:
        self._places[key] = len(self.all)
        self.all.append(made)
        self.holds.append(holds)

    def _parameters(self) -> None:
        found, fixed = parameter_settings(self._scene, self._scene.parameters)
        self.fixed += fixed
        for name, made in found.items():
            self._add(("parameter", name), made)

    def _joint(self, joint: RobotJoint) -> None:
        """Position and velocity at the start, of those that are given; without constraints of all joints."""
        scene, initial, name = self._scene, self._scene.initial, joint.name
        linear = joint.kind == "prismatic"
        if name in initial.position or not scene.constraints:
            value = float(initial.posture(scene.robot, self._motion)[joint.q])
            reach = slider_end(abs(value)) if linear else TURNS
            guess = name in initial.guesses
            self._add(
                ("position", joint.q),
                Setting(
                    group="guesses of positions at the start" if guess else "positions at the start",
                    name=name,
                    unit=joint_unit(joint, "position"),
                    value=value,
                    range=(value - reach, value + reach),
                    least=-math.inf,
                    path=f"initial.{name}" + (".guess" if guess else ""),
                ),
            )
        given = name in initial.velocity
        if given or not scene.constraints or (name in initial.position and name not in initial.guesses):
            value = float(initial.rates(scene.robot, scene.robot.neutral, self._motion)[joint.v])
            reach = slider_end(max(3.0 * abs(value), 1.0 if linear else 5.0))
            self._add(
                ("velocity", joint.v),
                Setting(
                    group="velocities at the start",
                    name=name,
                    unit=joint_unit(joint, "velocity"),
                    value=value,
                    range=(value - reach, value + reach),
                    least=-math.inf,
                    path=f"initial.velocity.{name}",
                ),
                -1 if given else joint.v,
            )

    def _free(self, robot: Robot, joint: RobotJoint, start: FreeJointStart) -> None:
        """The vectors of a joint with several degrees of freedom whose components are all given."""
        base = robot.floating_base and joint is robot.joints[0]
        path = "base" if base else f"initial.{joint.name}"
        written: Any = self._scene.data["base"] if base else self._scene.data["initial"][joint.name]
        size = len(start.linear.values)
        axes = "xyz" if joint.kind != "planar" else "xy"
        vectors = [
            ("position", "m", start.position, joint.q, "position"),
            ("linear_velocity", "m/s", start.linear, joint.v, "velocity"),
            ("angular_velocity", "rad/s", start.angular, joint.v + size, "velocity"),
        ]
        for key, unit, vector, first, kind in vectors:
            if not vector.given or not all(vector.given) or joint.kind == "planar":
                continue
            most = max(map(abs, vector.values))
            reach = slider_end(max(most, 1.0) if kind == "position" else max(3.0 * most, 1.0))
            guess = kind == "position" and not all(vector.held)
            for k, value in enumerate(vector.values):
                self._vector((kind, first + k), path, key + (".guess" if guess else ""), k, axes[k], unit, value, reach)
        rpy = written.get("rpy") if isinstance(written, dict) else None
        if start.rotation is not None and isinstance(rpy, list | dict) and joint.kind in ("floating", "spherical"):
            angles = _roll_pitch_yaw(start.rotation)
            for k, (name, value) in enumerate(zip(("roll", "pitch", "yaw"), angles, strict=True)):
                key = "rpy" if isinstance(rpy, list) else "rpy.guess"
                self._vector(("rpy", joint.q + size, k), path, key, k, name, "rad", value, TURNS)

    def _vector(
        self, key: tuple[Any, ...], path: str, what: str, k: int, name: str, unit: str, value: float, reach: float
    ) -> None:
        self._add(
            key,
            Setting(
                group=f"{path} at the start: {what.partition('.')[0].replace('_', ' ')}",
                name=name,
                unit=unit,
                value=value,
                range=(value - reach, value + reach),
                least=-math.inf,
                path=f"{path}.{what}",
                entry=str(k + 1),
            ),
        )

    def function(self) -> casadi.Function:
        """settings -> q (nq) where the search begins, v (nv) along the axes in which it is given, own parameters."""
        import casadi

        scene, robot, initial = self._scene, self._scene.robot, self._scene.initial
        s = casadi.SX.sym("settings", len(self.all))
        q = casadi.SX(casadi.DM(initial.posture(robot, self._motion)))
        still = replace(initial, free={})
        v = casadi.SX(casadi.DM(still.rates(robot, robot.neutral, self._motion)))
        for name, start in initial.free.items():
            joint = robot.joint(name)
            v[joint.v : joint.v + joint.nv] = casadi.DM([*start.linear.values, *start.angular.values])
        own = casadi.SX(casadi.DM(scene.own_parameters))
        names = list(scene.parameters)
        for key, place in self._places.items():
            kind = key[0]
            if kind == "position":
                q[key[1]] = s[place]
            elif kind == "velocity":
                v[key[1]] = s[place]
            elif kind == "rpy":
                if key[2] == 0:
                    angles: Any = tuple(s[place + k] for k in range(3))
                    turned = quaternion_of(angles)
                    q[key[1] : key[1] + 4] = casadi.vertcat(*turned)
            else:
                own[names.index(key[1]) if kind == "parameter" else key[1]] = s[place]
        return casadi.Function("start", [s], [casadi.densify(each) for each in (q, v, own)])


def _roll_pitch_yaw(quaternion: Sequence[float]) -> tuple[float, float, float]:
    """Angles, rad, whose quaternion (`quaternion_of`) is this one or its negative."""
    x, y, z, w = quaternion
    pitch = math.asin(min(max(2.0 * (w * y - z * x), -1.0), 1.0))
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    return roll, pitch, math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


class _Numbers:
    """The description of a scene, in the order in which page_engine.cpp reads it."""

    def __init__(self, scene: Scene, run: Trajectory, settings: _Settings, shown: int) -> None:
        self._parts: list[Array] = []
        system, layout, control = system_of(scene), state_layout(scene), step_control(run.settings)
        robot, own, signals = scene.robot, scene.own_parameters, scene.signals
        u = scene.signals_at(np.zeros(1))[0]
        self._put(system.nq, system.nv, system.size, layout.norm_size, len(own), len(settings.all), shown, len(u))
        mass = sum(frame.mass for frame in robot.equations.tree.frames)
        self._put(0, 1, 2, float(np.linalg.norm(robot.gravity)) * mass)
        self._put(*u, *(one.value for one in settings.all))
        self._put(run.settings.duration, control.rtol, control.atol, control.first_step)
        self._put(min(control.max_step, 1e300), control.max_evaluations)
        self._list(number for part in layout.unit_parts for number in part)
        far = lengths_in_position(robot)
        self._list(far if scene.constraints and far.any() else ())
        self._put(len(signals))
        for signal in signals:
            pieces, powers, width = signal.coefficients.shape
            self._put(pieces, powers, width, signal.derivatives, signal.kinked)
            self._put(*signal.breaks, *signal.coefficients.ravel())
        self._list(scene.stops)
        search = event_search(scene)
        self._list(search.terminal)
        self._list(search.direction)
        self._list(
            1 if isinstance(e.when, ContactLost) else 2 if isinstance(e.when, LiesFlat) else 0 for e in scene.events
        )
        self._put(search.samples)
        for held in scene.initial.held(robot):
            self._list(held)
        self._list(settings.holds)
        self._list(settings.gains)
        parametric = bool(scene.constraints) and rows_of(scene).parametric
        kind = run.settings.stabilisation.kind
        self._put(kind == "projection", bool(scene.constraints), parametric, REGULARISATION)
        self._start(scene)
        if scene.constraints:
            rows = rows_of(scene)
            self._list([*rows.unit, rows.length])
            if parametric:
                self._rows(row_sampling(scene))

    @property
    def found(self) -> Array:
        """All numbers."""
        return np.concatenate(self._parts)

    def _put(self, *numbers: float) -> None:
        self._parts.append(np.array(numbers, dtype=np.float64))

    def _list(self, numbers: Iterable[float]) -> None:
        listed = [float(number) for number in numbers]
        self._put(len(listed), *listed)

    def _start(self, scene: Scene) -> None:
        free = scene.initial.free
        if scene.constraints:
            equations = start_equations(scene)
            self._put(equations.heights, equations.rows)
            self._list(equations.entry_rows)
            self._list(equations.entry_columns)
            self._list(equations.lengths_in_velocity)
            self._put(equations.cosine_count)
            self._list(equations.alignment_owners)
            self._list(equations.sines)
        else:
            self._put(0, 0)
            for numbers in ((), (), [False] * scene.robot.nv):
                self._list(numbers)
            self._put(0, 0, 0)
        self._put(len(scene.robot.joints))
        for joint in scene.robot.joints:
            own = free.get(joint.name)
            kind = joint.kind if joint.kind in KINDS else "one"
            self._put(KINDS.index(kind), joint.q, joint.v, own is not None, own is not None and not own.in_body)

    def _rows(self, one: RowSampling) -> None:
        self._list(one.unit_kinds)
        self._list(one.constraint)
        self._list(one.rigid)
        self._put(one.sample_size, len(one.q))
        self._put(*one.q.ravel(), *one.moves.ravel(), *one.times.ravel(), *one.signals.ravel())
        self._list(one.entry_rows)
        self._list(one.entry_columns)
        self._list(one.levers)
        self._put(one.lengths_in_position)
        self._list(one.inertia_postures)
        self._put(*one.directions.ravel(), one.factorised)
        self._list(one.kept)
        self._put(one.longest)
        self._list(one.length_parameters)
        self._list(one.powers)
        self._put(one.least_power)
