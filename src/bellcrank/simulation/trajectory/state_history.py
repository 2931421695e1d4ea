"""Rows of time and state, and every quantity that the equations of motion give for them.

Nothing here is taken from the solver's bookkeeping: accelerations, energies, forces and residuals are computed from the
states when they are first asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array, Indices
from bellcrank.cached_values import Portable, cached_property
from bellcrank.dynamics.constraints.constraint_alignment import alignment_cosines_along, full_angle_residuals
from bellcrank.dynamics.constraints.constraint_rows import rows_of
from bellcrank.dynamics.equations.system import system_of
from bellcrank.elements.signals import Signal, values_at
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.simulation.trajectory.histories import ConstraintHistory, FrameHistory, JointHistory

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene
    from bellcrank.scene.settings import Settings

UNITS = {"[N]": "m", "[N m]": "rad"}  # of a residual, by the unit of its multiplier
# Rows of a block: about BLOCK_NUMBERS numbers of the state, a multiple of LEAST_ROWS and so of the SIMD lanes, so that
# every row has the same bits as if all rows were computed at once.
BLOCK_NUMBERS, LEAST_ROWS, MOST_ROWS = 500_000, 1024, 65_536


@dataclass(frozen=True, eq=False)
class StateHistory(Portable):
    """Rows of time (n,) s and state (n, nx) of a scene; the base class of `Trajectory`.

    The state x is q, v and, where forces do work that is not stored, the work W (J).
    """

    scene: Scene
    settings: Settings
    time: Array
    state: Array
    parameters: Array
    signals: tuple[Signal, ...]

    def __len__(self) -> int:
        return len(self.time)

    # ---- rows

    def part(self, rows: slice | Indices) -> Self:
        """Select rows.

        Args:
            rows: A slice, or an array of row numbers from 0 to n - 1.

        Returns:
            An object of the same class with these rows only.

        Raises:
            InputError: `rows` is something else, or a number is out of range.

        Example:
            >>> import bellcrank as bc
            >>> run = bc.simulate("pendulum", duration=1.0, samples=101)
            >>> len(run.part(slice(0, None, 10)))
            11
        """
        if not isinstance(rows, slice):
            expected = "a slice, or a list of rows of the run"
            numbers = arguments.instance("rows", rows, np.ndarray, expected)
            known = numbers.dtype.kind == "i" and numbers.ndim == 1 and not arguments.is_masked(numbers)
            if not known or numbers.min(initial=0) < 0 or numbers.max(initial=0) >= len(self):
                arguments.refuse("rows", expected, rows)
        found = replace(self, time=self.time[rows], state=self.state[rows])
        if "_observed" in vars(self):  # computed already
            vars(found)["_observed"] = tuple(each[rows] for each in self._observed)
        if self.origin is not None:
            found.remember_origin(self.origin)
        return found

    def parts(self) -> Iterator[Self]:
        """Iterate over consecutive blocks of rows.

        Quantities that are computed for a block are freed with it, so that a long run needs little memory beside its
        states. A short run is one block.

        Yields:
            Objects of the same class.

        Example:
            >>> import bellcrank as bc
            >>> run = bc.simulate("pendulum", duration=1.0, samples=101)
            >>> max(part.kinetic_energy.max() for part in run.parts()) == run.kinetic_energy.max()
            np.True_
        """
        rows = min(max(BLOCK_NUMBERS // self.state.shape[1] // LEAST_ROWS, 1) * LEAST_ROWS, MOST_ROWS)
        if len(self) <= rows:
            yield self
            return
        for first in range(0, len(self), rows):
            yield self.part(slice(first, first + rows))

    @property
    def origin(self) -> Path | None:
        """The file that the run was loaded from; None for a run that was simulated in this process."""
        origin: Path | None = vars(self).get("_origin")
        return origin

    def remember_origin(self, file: Path) -> None:
        """Set `origin`.

        Args:
            file: The file that the run was loaded from.

        Raises:
            InputError: The argument is not a path.
        """
        vars(self)["_origin"] = arguments.path("file", file, "the path of a file")

    # ---- states

    @property
    def robot(self) -> Robot:
        """The robot of the scene."""
        return self.scene.robot

    @property
    def position(self) -> Array:
        """Positions q (n, nq): rad or m, one number a joint.

        A free base comes first: position in the world (m), then its quaternion x, y, z, w.
        """
        return self.state[:, : self.robot.nq]

    @property
    def velocity(self) -> Array:
        """Velocities v (n, nv): rad/s or m/s. Those of a free base are expressed in its own frame."""
        return self.state[:, self.robot.nq : self.robot.nq + self.robot.nv]

    @property
    def auxiliary(self) -> Array:
        """States of drives (n, nz), in the order of `auxiliary_names`: rotors, currents, integrators of controllers."""
        first = self.robot.nq + self.robot.nv
        return self.state[:, first : first + system_of(self.scene).nz]

    @property
    def auxiliary_names(self) -> tuple[str, ...]:
        """The names of the states of drives (nz), with the name of the drive and the unit."""
        return tuple(f"{own.name} {label}" for own in self.scene.auxiliary_states for label in own.labels)

    @property
    def work(self) -> Array:
        """Work W (n,) J that actuators, dampers and friction have done since the start, integrated by the solver."""
        return self.state[:, -1] if system_of(self.scene).has_work else np.zeros(len(self.time))

    @cached_property
    def inputs(self) -> Array:
        """Signals u (n, nu): tabulated forces and the motions that controllers follow."""
        return values_at(self.signals, self.time)

    @property
    def _arguments(self) -> tuple[Array, ...]:
        """The arguments (t, x, u, p) of the compiled functions."""
        return self.time[:, None], self.state, self.inputs, self.parameters

    # ---- quantities that follow from the states

    @cached_property
    def _observed(self) -> tuple[Array, ...]:
        """Acceleration, energies (kinetic, potential), actuator and passive forces, then the outputs."""
        found = tuple(system_of(self.scene).observation(*self._arguments))
        self._check_observed(*found[:2])
        return found

    def _check_observed(self, acceleration: Array, energies: Array) -> None:
        """Refuse quantities that the run cannot have; a history of states alone has nothing to compare them with."""

    @property
    def acceleration(self) -> Array:
        """Accelerations dv/dt (n, nv): rad/s² or m/s²."""
        return self._observed[0]

    @property
    def kinetic_energy(self) -> Array:
        """Kinetic energy T (n,) J."""
        return self._observed[1][:, 0]

    @property
    def potential_energy(self) -> Array:
        """Potential energy V (n,) J of gravity and springs."""
        return self._observed[1][:, 1]

    @property
    def total_energy(self) -> Array:
        """Total energy T + V (n,) J."""
        return self.kinetic_energy + self.potential_energy

    @property
    def actuator_torque(self) -> Array:
        """Joint torques of actuators and controllers (n, nv): N m or N."""
        return self._observed[2]

    @property
    def torque(self) -> Array:
        """Joint torques of all forces of the scene (n, nv): N m or N.

        Actuators, springs, dampers, friction and wrenches; gravity is not included.
        """
        return self._observed[2] + self._observed[3]

    @property
    def multipliers(self) -> Array:
        """Lagrange multipliers (n, rows): N or N m, in the order of `multiplier_names`; a tree has none."""
        return self._constraint[0]

    @property
    def multiplier_names(self) -> tuple[tuple[str, str], ...]:
        """(constraint, row with unit) of each column of `multipliers`, such as ("apex", "x [N]").

        Example:
            >>> import bellcrank as bc
            >>> bc.simulate("four_bar").multiplier_names
            (('apex', 'x [N]'), ('apex', 'y [N]'))
        """
        return system_of(self.scene).multiplier_names

    @cached_property
    def _constraint(self) -> tuple[Array, ...]:
        """Multipliers, position residuals φ and velocity residuals (φ̇, ψ)."""
        if not self.scene.constraints:
            none = np.zeros((len(self.time), 0))
            return none, none, none
        return tuple(system_of(self.scene).constraint(*self._arguments))

    @cached_property
    def _position_residuals(self) -> Array:
        """|φ| (n, h), m or rad; the rotation residuals of welds and hinges as whole angles."""
        if not self.scene.constraints:
            return np.zeros((len(self.time), 0))
        return full_angle_residuals(
            self.scene, self._constraint[1], alignment_cosines_along(self.scene, self.time, *self._arguments[1:])
        )

    @property
    def constraint_residuals(self) -> dict[str, Array]:
        """Largest residual (n,) of all constraints, by unit: "m", "rad", "m/s", "rad/s"; "" for other units."""
        positions = self._position_residuals
        velocities = np.abs(self._constraint[2]) if self.scene.constraints else positions
        found: dict[str, Array] = {}
        for unit, speed, k in residual_columns(self.multiplier_names, positions.shape[1], velocities.shape[1]):
            found[unit] = np.maximum(found.get(unit, 0.0), (velocities if speed else positions)[:, k])
        return found

    @property
    def event_values(self) -> Array:
        """Event functions (n, events) of the scene; an event is a zero of its function."""
        rows = system_of(self.scene).events(*self._arguments)
        return np.asarray(rows).reshape(len(self), -1)

    @property
    def outputs(self) -> Mapping[str, Array]:
        """The named outputs of the scene, (n,) or (n, k) each."""
        return dict(zip(self.scene.outputs, (self._output(k) for k in range(len(self.scene.outputs))), strict=True))

    def _output(self, k: int) -> Array:
        rows = self._observed[4 + k]
        return rows[:, 0] if rows.shape[1] == 1 else rows

    # ---- quantities by name

    def output(self, name: str) -> Array:
        """Get a named output of the scene.

        Args:
            name: The name under `outputs` in the scene.

        Returns:
            Values (n,) or (n, k), in the unit that the scene says.

        Raises:
            InputError: The scene has no such output; the message lists the names.

        Example:
            >>> import bellcrank as bc
            >>> bc.simulate("pendulum", duration=1.0, samples=101).output("P1").shape
            (101, 3)
        """
        if arguments.text("name", name, "the name of an output") not in self.scene.outputs:
            raise InputError(f"{self.scene.name}: {unknown_name('output', name, self.scene.outputs)}")
        return self._output(list(self.scene.outputs).index(name))

    def joint(self, name: str) -> JointHistory:
        """Get position, velocity, acceleration and torque of one joint.

        Args:
            name: The joint's name in the URDF.

        Returns:
            The joint's columns.

        Raises:
            InputError: The robot has no such joint; the message lists the names.

        Example:
            >>> import bellcrank as bc
            >>> swing = bc.simulate("pendulum", duration=1.0, samples=101).joint("swing")
            >>> print(f"{swing.position[-1]:.4f} rad, {swing.velocity[-1]:.4f} rad/s")
            1.4050 rad, 1.7993 rad/s
        """
        j = self.robot.joint(name)
        q, v = slice(j.q, j.q + j.nq), slice(j.v, j.v + j.nv)

        def column(rows: Array, where: slice) -> Array:
            part = rows[:, where]
            return part[:, 0] if part.shape[1] == 1 else part

        return JointHistory(
            position=column(self.position, q),
            velocity=column(self.velocity, v),
            acceleration=column(self.acceleration, v),
            torque=column(self.torque, v),
            actuator_torque=column(self.actuator_torque, v),
        )

    def frame(self, name: str) -> FrameHistory:
        """Get the motion of one frame, in world axes.

        Args:
            name: A frame of the URDF or of the scene.

        Returns:
            Position, rotation, velocity and angular velocity of the frame.

        Raises:
            InputError: There is no such frame; the message lists the names.

        Example:
            >>> import bellcrank as bc
            >>> tip = bc.simulate("pendulum", duration=1.0, samples=101).frame("P1")
            >>> tip.position.shape, tip.rotation.shape
            ((101, 3), (101, 3, 3))
        """
        if arguments.text("name", name, "the name of a frame") not in self.robot.frame_names:
            raise InputError(f"{self.scene.name}: {unknown_name('frame', name, self.robot.frame_names)}")
        rows = system_of(self.scene).frame(name)(*self._arguments)
        return FrameHistory(rows[:, :3], rows[:, 3:12].reshape(-1, 3, 3), rows[:, 12:15], rows[:, 15:18])

    def constraint(self, name: str) -> ConstraintHistory:
        """Get multipliers and residuals of one constraint.

        Args:
            name: The constraint's name in the scene.

        Returns:
            The rows of the constraint that bind.

        Raises:
            InputError: The scene has no such constraint; the message lists the names.

        Example:
            >>> import bellcrank as bc
            >>> apex = bc.simulate("four_bar").constraint("apex")
            >>> apex.labels, bool(apex.residual.max() < 1e-12)
            (('x [N]', 'y [N]'), True)
        """
        arguments.text("name", name, "the name of a constraint")
        names = [constraint.name for constraint in self.scene.constraints]
        if name not in names:
            raise InputError(f"{self.scene.name}: {unknown_name('constraint', name, names)}")
        owners = self.multiplier_names
        rows = [k for k, (owner, _) in enumerate(owners) if owner == name]
        multipliers, _, speed = self._constraint
        holonomic = [k for k in rows if k < self._position_residuals.shape[1]]
        residuals = self._position_residuals[:, holonomic]
        return ConstraintHistory(
            labels=tuple(owners[k][1] for k in rows),
            multipliers=multipliers[:, rows],
            residual=residuals.max(axis=1, initial=0.0),
            velocity_residual=np.abs(speed[:, rows]).max(axis=1, initial=0.0),
            relative=(residuals / rows_of(self.scene).unit[holonomic]).max(axis=1, initial=0.0),
        )

    def _largest(self, measures: Callable[[Self], list[Any]]) -> list[float]:
        """The largest of each of some measures of a block, over the blocks; NaN where one is."""
        return [float(np.max(each)) for each in zip(*map(measures, self.parts()), strict=True)]


def residual_columns(
    names: Sequence[tuple[str, str]], positions: int, velocities: int
) -> Iterator[tuple[str, bool, int]]:
    """(unit, whether it is a velocity, its number) of each residual; `names` are those of the multipliers."""
    for speed, count in ((False, positions), (True, velocities)):
        for k, (_, label) in enumerate(names[:count]):
            own = next((unit for end, unit in UNITS.items() if label.endswith(end)), "")
            yield own and own + "/s" * speed, speed, k
