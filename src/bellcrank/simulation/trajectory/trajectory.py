"""The result of a simulation: its states, why it ended, and the means to judge it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from bellcrank import arguments
from bellcrank.arguments import Progress
from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.dynamics.constraints.constraint_alignment import alignment_cosines_along
from bellcrank.dynamics.constraints.constraint_derivatives import aligned_constraints
from bellcrank.dynamics.equations.system import system_of
from bellcrank.dynamics.inverse.input_breakpoints import prescribed_motion_end
from bellcrank.errors import InputError
from bellcrank.notes import Note, ranked, reached
from bellcrank.present.results import Result
from bellcrank.robot.model.joints import unit_vectors
from bellcrank.simulation.integration.statistics import Statistics, Status
from bellcrank.simulation.trajectory.events import Event
from bellcrank.simulation.trajectory.state_history import StateHistory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bellcrank.dynamics.constraints.mobility import ConstraintRank
    from bellcrank.scene.settings import Settings
    from bellcrank.simulation.sensitivities.sensitivities import ComputedSensitivities, RunSensitivity
    from bellcrank.simulation.trajectory.error_estimate import Accuracy


AT_REST = 1e-12  # of the energies: what changes less is rounding


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(StateHistory, Result):
    """The result of `simulate` or `load_run`.

    Rows of time and state, and everything that follows from them; SI units throughout. The last row is where the run
    ended. Quantities are computed from the states by the equations of motion when they are first asked for.

    Attributes:
        scene: The scene that was simulated.
        settings: The solver's settings.
        time: Times (n,) s of the rows.
        state: States (n, nx): q, v and, where forces do work that is not stored, W.
        parameters: Parameters of the compiled equations.
        signals: Tabulated forces and motions as piecewise polynomials.
        status: Why the run ended.
        events: The events in the order of time.
        statistics: What the run cost.
        steps: Start, then the ends of the solver's steps, s; of more than 100,000 steps every 2nd, 4th, … end and the
            last.
        repeat: What integrates the run's scene again, with other settings, rows and parameters, for its error estimate.

    Example:
        >>> import bellcrank as bc
        >>> run = bc.simulate("four_bar")
        >>> run
        Trajectory('Deployable four-bar', event at 12.2678 s, 492 rows)
        >>> run.success, run.events[-1].name, bool(run.energy_drift() < 1e-8)
        (True, 'lock', True)
    """

    status: Status
    events: tuple[Event, ...]
    statistics: Statistics
    steps: Array
    repeat: Callable[[Trajectory, Settings, Array, Array], Trajectory]

    def __repr__(self) -> str:
        rows = f"{len(self.time)} rows{', not all results are finite' if self.non_finite else ''}"
        return f"Trajectory('{self.scene.name}', {self.status} at {self.time[-1]:g} s, {rows})"

    # ---- the end of the run

    @property
    def success(self) -> bool:
        """Whether the run reached its duration or an event with `stop: true`."""
        return self.status.success

    @property
    def message(self) -> str:
        """One sentence: why the run ended, when, what to do about it, and which results are not finite.

        Example:
            >>> import bellcrank as bc
            >>> bc.simulate("pendulum", duration=1.0).message
            'Simple pendulum: finished at 1 s: the whole duration was simulated'
        """
        text = f"{self.scene.name}: {self.status} at {self.time[-1]:.9g} s: {self.reason}"
        if not self.non_finite:
            return text
        more = f" (and {len(self.non_finite) - 1} more warnings of this kind)" if len(self.non_finite) > 1 else ""
        return f"{text}; but {self.non_finite[0]}{more}"

    @property
    def reason(self) -> str:
        """Why the run ended and what to do about it, as a clause."""
        if self.status is Status.EVENT:
            return f"event '{next(e.name for e in self.events if e.stopped)}' ended the run"
        if self.status is Status.CONTACT:
            from bellcrank.simulation.trajectory.events import ending_contacts

            return ending_contacts(self)
        if self.status is Status.PRESCRIBED_MOTION_ENDED and (end := prescribed_motion_end(self.scene)) is not None:
            return end.sentence
        if self.status is Status.TURNED_OVER:
            last = self.part(slice(-1, None))
            cosine = alignment_cosines_along(self.scene, last.time, *last._arguments[1:])[-1]
            return f"constraint '{aligned_constraints(self.scene)[int(np.argmin(cosine))]}': {self.status.advice}"
        if self.status is Status.NON_FINITE:
            from bellcrank.simulation.trajectory.non_finite import cause

            return "; ".join(filter(None, [cause(self), self.status.advice]))
        return self.status.advice

    def _check_observed(self, acceleration: Array, energies: Array) -> None:
        if not self.success or self.origin is None:
            return
        good = np.isfinite(acceleration).all(axis=1) & np.isfinite(energies).all(axis=1)
        if not good.all():
            raise InputError(
                f"{self.origin}: the run says that it is '{self.status}', but its state at "
                f"{self.time[int(good.argmin())]:.6g} s has no finite acceleration or energy: the file was changed or "
                "is damaged; simulate it again"
            )

    # ---- how far the run can be trusted

    def energy_drift(self) -> float:
        """Compute how far the energy balance is violated.

        The drift is max |T + V − T₀ − V₀ − W| / max (T + |V − V₀| + |W|), counted from the first row. Energies are
        computed from the states; W is the solver's quadrature of the power of actuators, dampers and friction.

        Returns:
            A share of the largest energy; infinite where an energy is not finite. 0 where the energies change by no
            more than rounding, as at rest: 1e-12 of their size, or of the energy of lifting all masses by 1 m.

        Example:
            >>> import bellcrank as bc
            >>> bool(bc.simulate("pendulum", duration=1.0).energy_drift() < 1e-8)
            True
        """
        first = self.part(slice(0, 1))
        t0, v0, w0 = first.kinetic_energy, first.potential_energy, first.work

        def measures(run: Self) -> list[Any]:
            t, v, w = run.kinetic_energy, run.potential_energy - v0, run.work - w0
            size = np.abs(run.kinetic_energy) + np.abs(run.potential_energy)
            return [np.abs((t - t0) + v - w).max(), (t + np.abs(v) + np.abs(w)).max(), size.max()]

        weight = np.linalg.norm(self.robot.gravity) * sum(f.mass for f in self.robot.equations.tree.frames)
        with np.errstate(all="ignore"):  # energies may overflow
            gap, moved, size = self._largest(measures)
        return 0.0 if moved <= AT_REST * (size + weight) else _share(gap, moved)

    def equation_residual(self) -> float:
        """Compute how far the accelerations miss the equations of motion.

        The accelerations come from the articulated-body algorithm; the recursive Newton-Euler algorithm checks them
        (R. Featherstone, Rigid Body Dynamics Algorithms, 2008).

        Returns:
            The largest |inverse dynamics − joint forces|, as a share of the largest joint force of the run, applied or
            of bias (gravity, Coriolis and centrifugal forces).

        Example:
            >>> import bellcrank as bc
            >>> bool(bc.simulate("planar_2r_swing", duration=1.0).equation_residual() < 1e-12)
            True
        """

        def measures(run: Self) -> list[Any]:
            with np.errstate(all="ignore"):
                residual, bias = system_of(run.scene).residual(*run._arguments)
                return [np.abs(residual).max(), np.abs(run.torque).max(), np.abs(bias).max()]

        residual, torque, bias = self._largest(measures)
        return _share(residual, max(torque, bias))

    def constraint_residual(self) -> float:
        """Compute the largest violation of a position constraint, or of the unit length of a rotation.

        Returns:
            m or rad; infinite where it is not finite.

        Example:
            >>> import bellcrank as bc
            >>> bool(bc.simulate("four_bar").constraint_residual() < 1e-12)
            True
        """
        places = unit_vectors(self.scene.robot.joints)

        def measures(run: Self) -> list[Any]:
            with np.errstate(all="ignore"):
                units = [np.linalg.norm(run.state[:, place], axis=1) for place in places]
                return [run._position_residuals.max(initial=0.0), *(np.abs(x - 1.0).max() for x in units)]

        return _finite_or_infinite(self._largest(measures))

    def velocity_residual(self) -> float:
        """Compute the largest violation of a velocity constraint: φ̇ or ψ.

        Returns:
            m/s or rad/s; 0 for a tree, infinite where it is not finite.

        Example:
            >>> import bellcrank as bc
            >>> bool(bc.simulate("four_bar").velocity_residual() < 1e-12)
            True
        """
        return _finite_or_infinite(self._largest(lambda run: [np.abs(run._constraint[2]).max(initial=0.0)]))

    def stuck(self, joint: str) -> Array:
        """Return when dry friction kept a joint at rest.

        Args:
            joint: The name of a joint with `dry_friction` in the scene, or "JOINT rotor" for the rotor of a drive.

        Returns:
            Beginnings and ends (n, 2) of these intervals, s.

        Raises:
            InputError: There is no such joint with dry friction.

        Example:
            >>> import bellcrank as bc
            >>> friction = {"joints": {"swing": {"dry_friction": {"coulomb": 2.0}}}, "simulate.duration": 1.0}
            >>> run = bc.simulate("pendulum", overrides={**friction, "initial.swing": 0.1})
            >>> run.stuck("swing").tolist()
            [[0.0, 1.0]]
        """
        from bellcrank.simulation.trajectory.events import stuck_intervals

        arguments.text("joint", joint, "the name of a joint or rotor with dry friction")
        return stuck_intervals(self, joint)

    def at_stop(self, joint: str) -> Array:
        """Return when a stop held a joint.

        Args:
            joint: The name of a joint with a rigid `stop` in the scene.

        Returns:
            Beginnings and ends (n, 2) of these intervals, s.

        Raises:
            InputError: There is no such joint with a rigid stop.

        Example:
            >>> import bellcrank as bc
            >>> stop = {"joints": {"swing": {"stop": {"lower": 0.0, "upper": 1.0}}}, "initial.swing": 0.0}
            >>> bc.simulate("pendulum", duration=1.0, overrides=stop).at_stop("swing").tolist()
            []
        """
        from bellcrank.simulation.trajectory.events import intervals_at_stops

        arguments.text("joint", joint, "the name of a joint with a rigid stop")
        return intervals_at_stops(self, joint)

    def impacts(self, joint: str) -> Array:
        """Return a joint's impacts at its stops.

        Args:
            joint: The name of a joint with a rigid `stop` in the scene.

        Returns:
            Times, s, and impulses on the joint, N m s or N s, of each impact (n, 2).

        Raises:
            InputError: There is no such joint with a rigid stop.

        Example:
            A pendulum of 1 m and 1 kg strikes its stop below at 4.43 m/s:

            >>> import bellcrank as bc
            >>> stop = {"joints": {"swing": {"stop": {"lower": -2.0, "upper": 0.0}}}}
            >>> run = bc.simulate("pendulum", duration=1.0, overrides=stop)
            >>> run.impacts("swing")[0].round(3).tolist()
            [0.592, -4.429]
        """
        from bellcrank.simulation.trajectory.events import impacts_at_stops

        arguments.text("joint", joint, "the name of a joint with a rigid stop")
        return impacts_at_stops(self, joint)

    def constraint_rank(self, row: int = -1) -> ConstraintRank:
        """Compute the rank of the constraints in one row.

        Args:
            row: The row of the run, from −n to n − 1.

        Returns:
            Singular values, rank (0 without constraints), and which multipliers are unique.

        Raises:
            InputError: There is no such row, a number in it is not finite, or an inertia is negative.

        Example:
            >>> import bellcrank as bc
            >>> bc.simulate("four_bar").constraint_rank().rank
            2
        """
        from bellcrank.dynamics.constraints.mobility import ConstraintRank, rank_of

        count = len(self.time)
        row = arguments.whole("row", row, least=-count, most=count - 1)
        if not self.multiplier_names:
            return ConstraintRank.of_none()
        return rank_of(system_of(self.scene), *(a if a.ndim == 1 else a[row] for a in self._arguments))

    def error_estimate(self) -> float:
        """Estimate the error of the positions by repeated runs.

        The run is repeated with a hundredth of the tolerances (with a fixed step: half the step and Richardson's rule)
        and, where there are constraints, with ten times and a tenth of their regularisation; all repeated runs are
        projected onto the constraints. Where rtol < 2e-13 cannot be made smaller, ten times the tolerances are taken.
        The result is kept, so that a second call costs nothing.

        Returns:
            The largest difference on the same times, rad or m; infinite where there is nothing to compare, or a
            repeated run ended earlier.

        Raises:
            KeyboardInterrupt: A repeated run was interrupted.

        Example:
            >>> import bellcrank as bc
            >>> bool(bc.simulate("pendulum", duration=1.0).error_estimate() < 1e-8)
            True
        """
        known = self.known_accuracy
        if known is None:
            from bellcrank.simulation.trajectory.error_estimate import accuracy

            known = accuracy(self)
            assert known is not None  # None: a limit of time was passed, and there is none
            self.remember_estimate(known.estimate, known.known_until)
        return known.estimate

    @property
    def known_estimate(self) -> float | None:
        """The result of `error_estimate`, rad or m, if it was computed."""
        return None if self.known_accuracy is None else self.known_accuracy.estimate

    @property
    def known_until(self) -> float | None:
        """The last time of the run, s, up to which the error of every position is below its bound.

        The bound is `Settings.error_bound` of the range of the coordinate. Infinite where the whole run is known; None
        where the error is not known: it is estimated unless that takes more than about a second, which
        `error_estimate` takes if it has to.

        Example:
            >>> import bellcrank as bc
            >>> bc.simulate("pendulum", duration=1.0).known_until
            inf
        """
        from bellcrank.simulation.trajectory.error_estimate import unasked_accuracy

        found = unasked_accuracy(self)
        return None if isinstance(found, str) else found.known_until

    @property
    def known_accuracy(self) -> Accuracy | None:
        """The error of the positions and up to when they are known, if that was computed."""
        known: Accuracy | None = vars(self).get("_accuracy")
        return known

    def remember_estimate(self, value: float, known_until: float = math.inf) -> None:
        """Set `known_estimate` and `known_until`, such as from the file of the run.

        Args:
            value: The error of the positions, rad or m, 0 or more.
            known_until: Up to when the positions are known, s.

        Raises:
            InputError: A value is negative or not a number.
        """
        from bellcrank.simulation.trajectory.error_estimate import Accuracy

        if not (isinstance(value, float) and value == math.inf):
            value = arguments.number("value", value, "rad or m", least=0.0)
        if not (isinstance(known_until, float) and known_until == math.inf):
            known_until = arguments.number("known_until", known_until, "s", least=0.0)
        vars(self)["_accuracy"] = Accuracy(value, known_until)

    @cached_property
    def non_finite(self) -> tuple[str, ...]:
        """A clause for each output, energy, force, constraint and event function that is NaN or infinite in some row.

        Each says in how many rows, and the first time. They are among the `warnings`.
        """
        from bellcrank.simulation.trajectory.non_finite import non_finite

        return non_finite(self)

    @cached_property
    def notes(self) -> tuple[Note, ...]:
        """What to know about the run: what its files say and is not modelled, what was changed, what it reached.

        Those that are reached come first: the run depends on what is left out, and is not known.

        Example:
            >>> import bellcrank as bc
            >>> bc.simulate("pendulum", duration=1.0).notes
            ()
        """
        from bellcrank.simulation.trajectory.events import bus_limit, shared_rest, simultaneous_impacts
        from bellcrank.simulation.trajectory.reached import reached_notes
        from bellcrank.simulation.trajectory.scene_notes import scene_notes

        own = (*reached_notes(self), *shared_rest(self), *simultaneous_impacts(self), *bus_limit(self))
        return ranked((*own, *scene_notes(self.scene, self.settings.duration)))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Reasons not to trust the run, a sentence each: it ended early, a residual is large, or it is not known.

        It is not known where its error estimate is too large, or where it depends on what is left out (`notes`).

        Example:
            >>> import bellcrank as bc
            >>> bc.simulate("pendulum", duration=1.0).warnings
            ()
        """
        return (*self._own_warnings, *self.not_known)

    @property
    def not_known(self) -> tuple[str, ...]:
        """Why the run is not known, a sentence each: its error is too large, or it depends on what is left out.

        Example:
            >>> import bellcrank as bc
            >>> bc.simulate("pendulum", duration=1.0).not_known
            ()
        """
        from bellcrank.simulation.trajectory.run_warnings import not_known

        return (*not_known(self), *reached(self.notes))

    @cached_property
    def _own_warnings(self) -> tuple[str, ...]:
        from bellcrank.simulation.trajectory.run_warnings import run_warnings

        return run_warnings(self)

    # ---- sensitivities

    @property
    def sensitivities(self) -> tuple[str, ...]:
        """What derivatives of the run were computed by, such as ("crank_length",)."""
        known: ComputedSensitivities | None = vars(self).get("sensitivities.computed")
        return () if known is None else tuple(variable.name for variable in known.variables)

    @property
    def computed_sensitivities(self) -> ComputedSensitivities:
        """The derivatives of the run in all rows, and what they cost. Raises InputError where there are none.

        They are not part of a pickled run.
        """
        known: ComputedSensitivities | None = vars(self).get("sensitivities.computed")
        if known is None:
            raise InputError(
                f"{self.scene.name}: this run has no sensitivities; name them in simulate(…, sensitivities=[…]); parts "
                "of runs and runs from files have none"
            )
        return known

    def remember_sensitivities(self, known: ComputedSensitivities) -> None:
        """Keep derivatives of the run (simulation/sensitivities/sensitivity_integration.py).

        Args:
            known: The derivatives.

        Raises:
            InputError: The argument is something else.
        """
        from bellcrank.simulation.sensitivities.sensitivities import ComputedSensitivities

        vars(self)["sensitivities.computed"] = arguments.instance(
            "known", known, ComputedSensitivities, "sensitivities of a run"
        )

    def sensitivity(self, name: str) -> RunSensitivity:
        """Get the derivatives of the run by a parameter, or by a value of the start.

        Args:
            name: One of those that `simulate` was given as `sensitivities`.

        Returns:
            The derivatives of positions, velocities, outputs and events.

        Raises:
            InputError: The run has no such derivatives; the message lists those that it has.

        Example:
            >>> import bellcrank as bc
            >>> run = bc.simulate("pendulum", duration=1.0, samples=101, sensitivities=["initial.swing"])
            >>> print(f"{run.sensitivity('initial.swing').position[-1, 0]:.4f}")
            -0.5087
        """
        return self.computed_sensitivities.named(self, name)

    # ---- export

    def save(self, path: str | Path) -> Path:
        """Write the run to an .npz file, together with its scene and robot.

        Args:
            path: The file; the suffix .npz is added where it is missing.

        Returns:
            The path of the file. `load_run` reads it.

        Raises:
            InputError: The file cannot be written, or a constraint is a Python function.

        Example:
            >>> import bellcrank as bc, pathlib, tempfile
            >>> path = bc.simulate("pendulum", duration=1.0).save(pathlib.Path(tempfile.mkdtemp()) / "run")
            >>> path.name, len(bc.load_run(path))
            ('run.npz', 1001)
        """
        from bellcrank.simulation.files.save_run import save_run

        return save_run(self, arguments.path("path", path, "the path of a file"))

    def to_csv(self, path: str | Path, progress: Progress | None = None) -> Path:
        """Write times, states, accelerations, torques, energies, constraints and outputs as CSV.

        Args:
            path: The file, which is replaced in one step.
            progress: Called with the number of rows written so far, and of all.

        Returns:
            The path of the file. The header names columns and units; numbers that are not finite are `nan` or `inf`.

        Raises:
            InputError: The file cannot be written.

        Example:
            >>> import bellcrank as bc, pathlib, tempfile
            >>> run = bc.simulate("pendulum", duration=1.0)
            >>> path = run.to_csv(pathlib.Path(tempfile.mkdtemp()) / "run.csv")
            >>> path.read_text().split(",")[:2]
            ['time [s]', 'swing position [rad]']
        """
        from bellcrank.simulation.files.run_csv import write_run_csv

        if progress is not None:
            arguments.function("progress", progress, "a function of the number of rows written")
        return write_run_csv(self, arguments.path("path", path, "the path of a file"), progress)

    def plot(self, path: str | Path | None = None, frame: str | None = None) -> Figure:
        """Draw the run over time, or the path of a frame; the same as `bellcrank.plot`.

        Args:
            path: Where the picture is written, in the format of its suffix; None: nowhere.
            frame: A frame whose path is drawn in the world's plane in which it reaches furthest.

        Returns:
            A matplotlib figure.

        Raises:
            InputError: Unknown frame or picture format, or the file cannot be written.

        Example:
            >>> import bellcrank as bc
            >>> figure = bc.simulate("pendulum", duration=1.0).plot()
            >>> [axis.get_title(loc="left") for axis in figure.axes][:2]
            ['position', 'velocity']
        """
        from bellcrank.simulation.trajectory.run_plot import plot_run

        return plot_run(self, path, frame)

    def table(self) -> str:
        """The run in a few lines: why it ended, what it cost, residuals, warnings, and the end.

        Returns:
            Lines of text; notebooks show the same as a table.

        Example:
            >>> import bellcrank as bc
            >>> print(bc.simulate("pendulum", duration=1.0).table().splitlines()[1].strip())
            solver             DOP853, rtol 1e-10, atol 1e-10
        """
        from bellcrank.simulation.trajectory.summary import summary_text

        return summary_text(self)

    def as_dict(self) -> dict[str, Any]:
        """The run without its rows as data for JSON.

        Returns:
            Why it ended, settings, cost, events, energies, residuals, the end, and notes, in SI units.

        Example:
            >>> import bellcrank as bc
            >>> bc.simulate("pendulum", duration=1.0).as_dict()["status"]
            'finished'
        """
        from bellcrank.simulation.trajectory.summary import run_data

        return run_data(self)

    def _rows(self) -> list[Sequence[object]]:
        from bellcrank.simulation.files.run_csv import columns

        labels, table = columns(self)
        return [[f"{name} [{unit}]" for name, unit in labels], *table.tolist()]

    def _repr_html_(self) -> str:
        from bellcrank.simulation.trajectory.summary import summary_html

        return summary_html(self)


def _finite_or_infinite(largest: list[float]) -> float:
    """The largest of some numbers, at least 0; infinite where one is not finite."""
    most = float(np.max(largest, initial=0.0))
    return most if math.isfinite(most) else math.inf


def _share(gap: float, scale: float) -> float:
    """gap / scale: 0 where the gap is 0, infinite where it is not a number."""
    if gap == 0.0:
        return 0.0
    return float(gap / scale) if np.isfinite(gap) and np.isfinite(scale) and scale > 0.0 else float("inf")
