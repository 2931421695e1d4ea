"""A run: what a simulation gives back, with the means to judge it.

Nothing here is copied from the solver's own bookkeeping where the equations can say it: accelerations, energies,
forces and residuals are computed anew from the states, when first asked for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.derived import Portable, cached_property
from bellcrank.dynamics.binding_rows import binding_of
from bellcrank.dynamics.constraint_angles import cosines_along, true_gaps, turning
from bellcrank.dynamics.prescribed_motion_end import drive_end
from bellcrank.dynamics.system import system_of
from bellcrank.elements.signals import Signal, values_at
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.simulation.record import ConstraintHistory, Event, FrameHistory, JointHistory, Statistics
from bellcrank.simulation.status import Status

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene
    from bellcrank.scene.settings import Settings
    from bellcrank.simulation.constraint_rank import ConstraintRank

Array = NDArray[np.float64]
# Rows that quantities are computed for at a time where only what follows from them is wanted: so many numbers of the
# state, in whole LEAST_ROWS, which SIMD lanes divide, so that every row has the same bits as in one block.
BLOCK_NUMBERS, LEAST_ROWS, MOST_ROWS = 500_000, 1024, 65_536


@dataclass(frozen=True, eq=False)
class Trajectory(Portable):
    """A run of a scene: rows of time (n,) s and state, and everything that follows from them.

    Position (n, nq), velocity and acceleration (n, nv): rad or m and their rates, one number a joint; a free base
    first, with position (world), quaternion x y z w, and velocity in its own frame. Energies and work in J. `steps` are
    the start and the ends of the solver's steps, s; of more than 100,000 steps every 2nd, 4th, 8th, … end and the last.
    Made by `simulate` and `load_run`.
    """

    scene: Scene
    settings: Settings
    time: Array
    state: Array
    parameters: Array
    signals: tuple[Signal, ...]
    status: Status
    events: tuple[Event, ...]
    statistics: Statistics
    steps: Array

    def __repr__(self) -> str:
        rows = f"{len(self.time)} rows{', not all of it finite numbers' if self.non_finite else ''}"
        return f"Trajectory('{self.scene.name}', {self.status} at {self.time[-1]:g} s, {rows})"

    def __len__(self) -> int:
        return len(self.time)

    # ---- rows

    def part(self, rows: slice | NDArray[np.intp]) -> Trajectory:
        """Some rows of the run, as a run; a slice, or whole numbers."""
        if not isinstance(rows, slice):
            expected = "a slice, or a list of rows of the run"
            numbers = arguments.instance("rows", rows, np.ndarray, expected)
            known = numbers.dtype.kind == "i" and numbers.ndim == 1 and not np.ma.is_masked(numbers)
            if not known or numbers.min(initial=0) < 0 or numbers.max(initial=0) >= len(self):
                arguments.refuse("rows", expected, rows)
        found = replace(self, time=self.time[rows], state=self.state[rows])
        if "_observed" in vars(self):  # known: not to be computed again
            vars(found)["_observed"] = tuple(each[rows] for each in self._observed)
        if self.origin is not None:
            found.remember_origin(self.origin)
        return found

    def parts(self) -> Iterator[Trajectory]:
        """The run in blocks of rows, one after the other: what is computed of a block goes with it, so that runs of any
        length need little memory beside their states. A short run is its own only block.
        """
        rows = min(max(BLOCK_NUMBERS // self.state.shape[1] // LEAST_ROWS, 1) * LEAST_ROWS, MOST_ROWS)
        if len(self) <= rows:
            yield self
            return
        for first in range(0, len(self), rows):
            yield self.part(slice(first, first + rows))

    def _largest(self, measures: Callable[[Trajectory], list[Any]]) -> list[float]:
        """The largest of each of some measures of a block, over the blocks; nan where one is."""
        return [float(np.max(each)) for each in zip(*map(measures, self.parts()), strict=True)]

    # ---- states

    @property
    def robot(self) -> Robot:
        """The robot of the scene."""
        return self.scene.robot

    @property
    def success(self) -> bool:
        """Whether the run came to the end that was asked for."""
        return self.status.success

    @property
    def message(self) -> str:
        """One sentence: why the run ended, when, and what to do about it; and what in it is not a finite number."""
        text = f"{self.scene.name}: {self.status} at {self.time[-1]:.9g} s: {self.reason}"
        if not self.non_finite:
            return text
        more = f" (and {len(self.non_finite) - 1} more warnings of this kind)" if len(self.non_finite) > 1 else ""
        return f"{text}; but {self.non_finite[0]}{more}"

    @property
    def reason(self) -> str:
        """Why the run ended, and what to do about it, as a clause."""
        if self.status is Status.EVENT:
            return f"event '{next(e.name for e in self.events if e.stopped)}' ended the run"
        if self.status is Status.DRIVE_ENDED and (end := drive_end(self.scene)) is not None:
            return end.sentence
        if self.status is Status.TURNED_OVER:
            last = self.part(slice(-1, None))
            cosine = cosines_along(self.scene, last.time, *last._arguments[1:])[-1]
            return f"constraint '{turning(self.scene)[int(np.argmin(cosine))]}': {self.status.advice}"
        if self.status is Status.NON_FINITE:
            from bellcrank.simulation.non_finite import cause

            return "; ".join(filter(None, [cause(self), self.status.advice]))
        return self.status.advice

    @property
    def position(self) -> Array:
        """Position (n, nq)."""
        return self.state[:, : self.robot.nq]

    @property
    def velocity(self) -> Array:
        """Velocity (n, nv)."""
        return self.state[:, self.robot.nq : self.robot.nq + self.robot.nv]

    @property
    def work(self) -> Array:
        """Work (n,) J that actuators, dampers and friction have put in since the start; the solver's quadrature."""
        return self.state[:, -1] if system_of(self.scene).has_work else np.zeros(len(self.time))

    @cached_property
    def inputs(self) -> Array:
        """Signals u (n, nu): tabulated torques and the motions that controllers follow."""
        return values_at(self.signals, self.time)

    @property
    def _arguments(self) -> tuple[Array, ...]:
        return self.time[:, None], self.state, self.inputs, self.parameters

    # ---- what follows from the states

    @cached_property
    def _observed(self) -> tuple[Array, ...]:
        found = tuple(system_of(self.scene).observation(*self._arguments))
        if self.success and self.origin is not None and not all(np.isfinite(rows).all() for rows in found[:2]):
            bad = ~(np.isfinite(found[0]).all(axis=1) & np.isfinite(found[1]).all(axis=1))
            when = self.time[np.flatnonzero(bad)[0]]
            raise InputError(
                f"{self.origin}: the run says that it is '{self.status}', and its state at {when:.6g} s has no finite "
                "acceleration or energy: the file was changed, or damaged; simulate it again"
            )
        return found

    @property
    def acceleration(self) -> Array:
        """Acceleration (n, nv)."""
        return self._observed[0]

    @property
    def kinetic_energy(self) -> Array:
        """Kinetic energy (n,) J."""
        return self._observed[1][:, 0]

    @property
    def potential_energy(self) -> Array:
        """Potential energy (n,) J of gravity and springs."""
        return self._observed[1][:, 1]

    @property
    def total_energy(self) -> Array:
        """Kinetic and potential energy (n,) J."""
        return self.kinetic_energy + self.potential_energy

    @property
    def actuator_torque(self) -> Array:
        """Torques of motors and controllers (n, nv), N m or N."""
        return self._observed[2]

    @property
    def torque(self) -> Array:
        """All joint forces of the scene (n, nv): actuators, springs, dampers, friction, wrenches; not gravity."""
        return self._observed[2] + self._observed[3]

    @property
    def multipliers(self) -> Array:
        """Lagrange multipliers (n, rows), N or N m, as `system.multiplier_names` names them; a tree has none."""
        return self._constraint[0]

    @cached_property
    def _constraint(self) -> tuple[Array, ...]:
        if not self.scene.constraints:
            none = np.zeros((len(self.time), 0))
            return none, none, none
        return tuple(system_of(self.scene).constraint(*self._arguments))

    @cached_property
    def _gaps(self) -> Array:
        """|φ| (n, h), m or rad, with the whole angles of welds and hinges."""
        if not self.scene.constraints:
            return np.zeros((len(self.time), 0))
        return true_gaps(self.scene, self._constraint[1], cosines_along(self.scene, self.time, *self._arguments[1:]))

    def constraint(self, name: str) -> ConstraintHistory:
        """What one constraint did, in the rows that bind. Raises InputError with what there is."""
        arguments.text("name", name, "the name of a constraint")
        names = [constraint.name for constraint in self.scene.constraints]
        if name not in names:
            raise InputError(f"{self.scene.name}: {unknown_name('constraint', name, names)}")
        rows = [k for k, (owner, _) in enumerate(system_of(self.scene).multiplier_names) if owner == name]
        multipliers, _, speed = self._constraint
        holonomic = [k for k in rows if k < self._gaps.shape[1]]
        gaps = self._gaps[:, holonomic]
        return ConstraintHistory(
            tuple(system_of(self.scene).multiplier_names[k][1] for k in rows), multipliers[:, rows],
            gaps.max(axis=1, initial=0.0), np.abs(speed[:, rows]).max(axis=1, initial=0.0),
            (gaps / binding_of(self.scene).unit[holonomic]).max(axis=1, initial=0.0),
        )  # fmt: skip

    @property
    def constraint_residuals(self) -> dict[str, Array]:
        """How far (n,) all constraints are apart, by unit: m and rad, m/s and rad/s, and "" for formulas' own."""
        units = {"[N]": "m", "[N m]": "rad"}
        found: dict[str, Array] = {}
        for per, table in (
            ("", self._gaps),
            ("/s", np.abs(self._constraint[2]) if self.scene.constraints else self._gaps),
        ):
            for (_, label), column in zip(system_of(self.scene).multiplier_names, table.T, strict=False):
                own = next((unit for end, unit in units.items() if label.endswith(end)), "")
                unit = own and own + per
                found[unit] = np.maximum(found.get(unit, 0.0), column)
        return found

    def constraint_rank(self, row: int = -1) -> ConstraintRank:
        """How well the constraints hold at a row of the run: singular values, rank, and which multipliers are unique."""
        from bellcrank.simulation.constraint_rank import rank_of

        count = len(self.time)
        row = arguments.whole("row", row, least=-count, most=count - 1)
        return rank_of(system_of(self.scene), *(a if a.ndim == 1 else a[row] for a in self._arguments))

    @property
    def event_values(self) -> Array:
        """The event functions (n, events) of the scene, whose zeros are its events."""
        rows = system_of(self.scene).events(*self._arguments)
        return np.asarray(rows).reshape(len(self), -1)

    @property
    def outputs(self) -> Mapping[str, Array]:
        """The scene's named outputs, (n,) or (n, k) each."""
        return dict(zip(self.scene.outputs, (self._output(k) for k in range(len(self.scene.outputs))), strict=True))

    def _output(self, k: int) -> Array:
        rows = self._observed[4 + k]
        return rows[:, 0] if rows.shape[1] == 1 else rows

    def output(self, name: str) -> Array:
        """A named output of the scene, (n,) or (n, k). Raises InputError with what there is."""
        if arguments.text("name", name, "the name of an output") not in self.scene.outputs:
            raise InputError(f"{self.scene.name}: {unknown_name('output', name, self.scene.outputs)}")
        return self._output(list(self.scene.outputs).index(name))

    def joint(self, name: str) -> JointHistory:
        """What one joint did. Raises InputError with what there is."""
        j = self.robot.joint(name)
        q, v = slice(j.q, j.q + j.nq), slice(j.v, j.v + j.nv)

        def column(rows: Array, where: slice) -> Array:
            part = rows[:, where]
            return part[:, 0] if part.shape[1] == 1 else part

        return JointHistory(
            column(self.position, q), column(self.velocity, v), column(self.acceleration, v),
            column(self.torque, v), column(self.actuator_torque, v),
        )  # fmt: skip

    def frame(self, name: str) -> FrameHistory:
        """What a frame did, in the world. Raises InputError with what there is."""
        if arguments.text("name", name, "the name of a frame") not in self.robot.frame_names:
            raise InputError(f"{self.scene.name}: {unknown_name('frame', name, self.robot.frame_names)}")
        rows = system_of(self.scene).frame(name)(*self._arguments)
        return FrameHistory(rows[:, :3], rows[:, 3:12].reshape(-1, 3, 3), rows[:, 12:15], rows[:, 15:18])

    # ---- the certificate

    def energy_drift(self) -> float:
        """How far energy is from its balance: max |T + V − T₀ − V₀ − W| / max (T + |V − V₀| + |W|);
        infinite where these are no numbers.

        Energies are computed anew from the states; W is the solver's quadrature of the power of actuators, dampers and
        friction. All are counted from the first row. 0 for a run that never had energy.
        """
        first = self.part(slice(0, 1))
        t0, v0, w0 = first.kinetic_energy, first.potential_energy, first.work

        def measures(run: Trajectory) -> list[Any]:
            t, v, w = run.kinetic_energy, run.potential_energy - v0, run.work - w0
            return [np.abs((t - t0) + v - w).max(), (t + np.abs(v) + np.abs(w)).max()]

        with np.errstate(all="ignore"):  # a run that blew up has energies beyond all numbers
            return _share(*self._largest(measures))

    def equation_residual(self) -> float:
        """How far the accelerations miss the equations of motion: the largest |inverse dynamics − joint forces|, as a
        share of the largest joint force of the run, applied or of bias (gravity, Coriolis and centrifugal).

        Forward dynamics (the articulated-body algorithm) made the accelerations; recursive Newton-Euler checks them.
        """

        def measures(run: Trajectory) -> list[Any]:
            with np.errstate(all="ignore"):
                residual, bias = system_of(run.scene).residual(*run._arguments)
                return [np.abs(residual).max(), np.abs(run.torque).max(), np.abs(bias).max()]

        residual, torque, bias = self._largest(measures)
        return _share(residual, max(torque, bias))

    @cached_property
    def non_finite(self) -> tuple[str, ...]:
        """A clause for each output, energy, force, constraint and event that is NaN or infinite in some row, with how many
        rows and the first time; they are among `warnings`.
        """
        from bellcrank.simulation.non_finite import non_finite

        return non_finite(self)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """What speaks against trusting the run, a sentence each: it ended early, or its certificate is bad."""
        from bellcrank.simulation.summary import run_warnings

        return run_warnings(self)

    def constraint_residual(self) -> float:
        """The largest violation of what positions must keep: constraints (m or rad) and the unit length of rotations;
        infinite where it is no number.
        """
        from bellcrank.simulation.simulate import unit_parts

        places = unit_parts(self.scene)

        def measures(run: Trajectory) -> list[Any]:
            with np.errstate(all="ignore"):
                units = [np.linalg.norm(run.state[:, first : first + length], axis=1) for first, length in places]
                return [run._gaps.max(initial=0.0), *(np.abs(x - 1.0).max() for x in units)]

        return _known(self._largest(measures))

    def velocity_residual(self) -> float:
        """The largest violation of a velocity constraint, m/s or rad/s: φ̇ and ψ of constraints; a tree has none. Infinite
        where it is no number.
        """
        return _known(self._largest(lambda run: [np.abs(run._constraint[2]).max(initial=0.0)]))

    def error_estimate(self) -> float:
        """How far the positions may be off (rad or m): the largest difference, on the same times, from runs made again
        with a hundredth of the tolerances (with a fixed step: half the step, by Richardson's rule), and with constraints
        also with ten times and a tenth of their regularisation, all of them projected; what rounding and singular
        positions leave is in it (simulation/second_run.py). Where rtol < 2e-13 can be no finer, ten times the
        tolerances are taken.

        Costs these runs, once; infinite where there is nothing to compare, or one of them ended earlier.
        """
        known = self.known_estimate
        if known is None:
            from bellcrank.simulation.second_run import error_estimate

            known = error_estimate(self)
            assert known is not None  # None is for a limit of time
            self.remember_estimate(known)
        return known

    @property
    def origin(self) -> Path | None:
        """The file that the run was loaded from, None for a run that was simulated here."""
        origin: Path | None = vars(self).get("_origin")
        return origin

    def remember_origin(self, file: Path) -> None:
        """Keep what file the run was loaded from."""
        vars(self)["_origin"] = arguments.path("file", file, "the path of a file")

    @property
    def known_estimate(self) -> float | None:
        """What `error_estimate` found, if it was computed."""
        known: float | None = vars(self).get("_estimate")
        return known

    def remember_estimate(self, value: float) -> None:
        """Keep what `error_estimate` found, such as in the file of the run."""
        if not (isinstance(value, float) and value == math.inf):
            value = arguments.number("value", value, "rad or m", least=0.0)
        vars(self)["_estimate"] = value

    # ---- out of the house

    def save(self, path: str | Path) -> Path:
        """Write the run as .npz, with the scene and the robot in it, for `load_run`."""
        from bellcrank.simulation.run_file import save_run

        return save_run(self, arguments.path("path", path, "the path of a file"))

    def to_csv(self, path: str | Path, progress: Callable[[int], None] | None = None) -> Path:
        """Write times, states, accelerations, torques, energies and outputs as CSV, units in the header; `nan` and
        `inf` stand where there is no finite number. `progress` is called with the number of rows written.
        """
        from bellcrank.simulation.run_csv import write_run_csv

        if progress is not None:
            arguments.function("progress", progress, "a function of the number of rows written")
        return write_run_csv(self, arguments.path("path", path, "the path of a file"), progress)

    def plot(self, path: str | Path | None = None, frame: str | None = None) -> Any:
        """Draw the run, or a frame's path: a matplotlib Figure, written to `path` in the format of its suffix."""
        from bellcrank.simulation.run_plot import plot_run

        return plot_run(self, path, frame)

    def summary(self) -> str:
        """The run in a few lines: why it ended, what it cost, and its certificate."""
        from bellcrank.simulation.summary import summary_text

        return summary_text(self)

    def _repr_html_(self) -> str:
        from bellcrank.simulation.summary import summary_html

        return summary_html(self)


def _known(largest: list[float]) -> float:
    """The largest of some numbers, at least 0; infinite where one is no number."""
    most = float(np.max(largest, initial=0.0))
    return most if math.isfinite(most) else math.inf


def _share(gap: float, scale: float) -> float:
    """gap / scale: 0 where both are 0, infinite where it is no number."""
    if gap == 0.0:
        return 0.0
    return float(gap / scale) if np.isfinite(gap) and np.isfinite(scale) and scale > 0.0 else float("inf")
