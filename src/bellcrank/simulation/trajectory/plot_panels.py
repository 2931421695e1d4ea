"""Panels: the quantities of a run over time, grouped by unit, for plots and for the replay."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.motion.coordinates import position_labels, velocity_labels
from bellcrank.motion.sampled.resampling import BETWEEN, SHARE, extreme_rows, ranges, refined
from bellcrank.simulation.files.run_csv import output_labels, titled, torque_unit
from bellcrank.simulation.trajectory.interpolation import between, with_jumps

if TYPE_CHECKING:
    from bellcrank.simulation.trajectory.trajectory import Trajectory

CONSERVED = 1e-8  # of the largest value of a unit: conserved sums are not known better between rows
LEFT_OUT = 100  # rows that are left out to test whether a line is smooth between rows
LONG = 200_000  # rows: of longer runs only extremes are drawn, which is all that a picture can show
DRAWN = 100_000  # about so many rows of them
ENERGY, WORK, OUTPUTS = "energy", "work W", "outputs:"


@dataclass
class Panel:
    """One panel of a plot.

    Attributes:
        title: The quantity.
        unit: Its unit; "1" where there is none.
        lines: (name, values (n,)) of each line.
        logarithmic: Whether the axis is logarithmic.
        time: Times (n,) s.
        off: The error of straight lines between rows, as a fraction of a line's range.
        extremes: Whether the rows are extremes of a longer run, with nothing known between them.
    """

    title: str
    unit: str
    lines: list[tuple[str, Array]]
    logarithmic: bool = False
    time: Array = field(default_factory=lambda: np.zeros(0))
    off: float = 0.0
    extremes: bool = False

    @property
    def moves(self) -> bool:
        """Whether a line changes."""
        return any(np.any(values != values[0]) for _, values in self.lines)


def run_panels(run: Trajectory) -> list[Panel]:
    """The panels of a run, with different titles: positions, velocities, energies, torques, constraints, outputs.

    Quantities that do not change are left out. Lines have the run's rows, and more times between them, also on both
    sides of jumps, so that straight lines between all of them are accurate. Constraint residuals are known at the rows
    only. Of a run of more than LONG rows only the extremes are drawn.
    """
    few = extremes(run, _everything)
    panels = linear_panels(few)
    shown = [k == 0 or _shown(panel) for k, panel in enumerate(panels)]
    if few is run:
        time, table, off = _refined(run, panels)
    else:
        time, table = few.time, _table(panels)
        off = np.zeros(table.shape[1])
    column = 0
    for panel in panels:
        panel.time, panel.extremes = time, few is not run
        panel.lines = [(name, table[:, column + k]) for k, (name, _) in enumerate(panel.lines)]
        panel.off = float(off[column : column + len(panel.lines)].max(initial=0.0))
        column += len(panel.lines)
        if panel.title == ENERGY:
            panel.title = f"{ENERGY} (drift {run.energy_drift():.1e})"
            panel.lines = [line for line in panel.lines if line[0] != WORK or np.any(line[1])]
    first_output = next((k for k, panel in enumerate(panels) if panel.title.startswith(OUTPUTS)), len(panels))
    found = [panel for panel, there in zip(panels, shown, strict=True) if there]
    place = sum(shown[:first_output])
    return titled_apart([*found[:place], *residual_panels(few, few is not run), *found[place:]])


def extremes(run: Trajectory, table: Callable[[Trajectory], Array]) -> Trajectory:
    """The run itself where it has at most LONG rows; of a longer run about DRAWN rows.

    They hold the minima and maxima of each column of a table (n, columns) over short intervals. The table is computed
    for one block of rows at a time.
    """
    if len(run) <= LONG:
        return run
    rows, first = [], 0
    for part in run.parts():
        rows.append(first + extreme_rows(table(part), DRAWN * len(part) // len(run)))
        first += len(part)
    return run.part(np.concatenate(rows))


def _everything(run: Trajectory) -> Array:
    return np.column_stack([_table(linear_panels(run)), *run.constraint_residuals.values()])


def _shown(panel: Panel) -> bool:
    if panel.title.startswith(("joint torque", "joint force")):
        return any(np.any(values) for _, values in panel.lines)
    return panel.moves or not panel.title.startswith(("position", "orientation", "velocity"))


def linear_panels(run: Trajectory) -> list[Panel]:
    """All panels with linear axes, over the rows, also those that do not change."""
    joints = run.robot.joints
    one = [joint for joint in joints if joint.nv == 1]
    panels = by_unit("position", position_labels(joints), run.position)
    panels += by_unit("velocity", velocity_labels(joints), run.velocity)
    energies = [("kinetic T", run.kinetic_energy), ("potential V", run.potential_energy), ("T + V", run.total_energy)]
    panels.append(Panel(ENERGY, "J", [*energies, (WORK, run.work)]))
    labels = [(joint.name, torque_unit(joint.kind)) for joint in one]
    panels += by_unit("joint torque", labels, run.torque[:, [joint.v for joint in one]])
    if run.scene.constraints:
        names = [titled(f"{owner} {label}") for owner, label in run.multiplier_names]
        panels += by_unit("multiplier", names, run.multipliers)
    outputs = [(label, unit, column) for name in run.outputs for label, unit, column in _output_columns(run, name)]
    for unit in dict.fromkeys(unit for _, unit, _ in outputs):
        lines = [(label, column) for label, u, column in outputs if u == unit]
        names_of = [n for n, output in run.scene.outputs.items() if unit in [titled(x)[1] for x in output.labels]]
        panels.append(Panel(f"{OUTPUTS} {textwrap.shorten(', '.join(names_of), 60, placeholder='…')}", unit, lines))
    return panels


def _table(panels: Sequence[Panel]) -> Array:
    return np.column_stack([values for panel in panels for _, values in panel.lines])


def _refined(run: Trajectory, panels: Sequence[Panel]) -> tuple[Array, Array, Array]:
    """Times, the panels' lines as columns, and each line's `Panel.off`, refined so that straight lines are accurate.

    Rows from the first one on that is not finite, or whose time decreases, are not refined.
    """
    table, lines = _table(panels), [len(panel.lines) for panel in panels]
    good = np.isfinite(run.state).all(axis=1) & np.append(True, np.diff(run.time) > 0.0)
    rows = len(good) if good.all() else int(good.argmin())
    if rows < 2:
        return run.time, table, np.zeros(table.shape[1])
    head = run if rows == len(run) else replace(run, time=run.time[:rows], state=run.state[:rows])
    jumps = with_jumps(head)
    here = table[:rows] if len(jumps) == rows else _table(linear_panels(jumps))
    ends = np.cumsum(lines)
    reach = np.concatenate([ranges(here[:, b - n : b]) for b, n in zip(ends, lines, strict=True)])
    units = np.repeat([panel.unit for panel in panels], [len(panel.lines) for panel in panels])
    sizes = np.abs(np.where(np.isfinite(here), here, 0.0)).max(axis=0)
    least = CONSERVED * np.array([sizes[units == unit].max() for unit in units])
    bound = BETWEEN * SHARE * reach
    curved = (bound > least) & _better_curved(jumps, here, bound)
    at = between(jumps)
    time, here, left = refined(
        jumps.time, here, lambda times: _table(linear_panels(at(times))), np.where(curved, bound, np.inf)
    )
    known = np.isin(time, jumps.time)
    for k in np.flatnonzero(~curved):
        here[:, k] = np.interp(time, time[known], here[known, k])
    off = np.where(curved, left, 0.0) / np.where(reach > 0.0, reach, 1.0)
    return np.concatenate([time, run.time[rows:]]), np.concatenate([here, table[rows:]]), off


def titled_apart(panels: list[Panel]) -> list[Panel]:
    """The panels, with the unit added to titles that occur twice."""
    titles = [panel.title for panel in panels]
    for panel in panels:
        if titles.count(panel.title) > 1:
            panel.title += f", {shown_unit(panel.unit)}"
    return panels


def by_unit(title: str, labels: Sequence[tuple[str, str]], table: Array) -> list[Panel]:
    """One panel a unit for the columns of a table; `labels` are their (name, unit).

    The quantity stands in the panel's title and is removed from the names of its lines.
    """
    panels = []
    for unit in dict.fromkeys(unit for _, unit in labels):
        lines = [
            (name.replace(f" {title}", ""), table[:, k]) for k, (name, own) in enumerate(labels) if own == unit
        ]  # fmt: skip
        what = "orientation" if unit == "1" else "joint force" if unit == "N" and title == "joint torque" else title
        panels.append(Panel(what, unit, lines))
    return panels


def shown_unit(unit: str) -> str:
    """A unit as plots show it; "1" where there is none."""
    return unit.replace("^2", "²") or "1"


def _better_curved(run: Trajectory, table: Array, bound: Array) -> Mask:
    """Whether smooth interpolation between rows is better than straight lines, for each line.

    It is tested by leaving out every other row: smooth interpolation must have a smaller error in most of those where
    straight lines have an error above the bound. It fails for lines of rounding errors, such as a conserved energy.
    """
    k = np.arange(1, len(run) - 1, 2)
    k = k[np.unique(np.linspace(0, len(k) - 1, LEFT_OUT).astype(int))] if len(k) else k
    rows = np.unique(np.concatenate([np.zeros(0, dtype=int), k - 1, k, k + 1]))
    step = np.diff(run.time)
    k = k[np.maximum(step[k - 1], step[k]) < 2.0 * np.minimum(step[k - 1], step[k])]  # not beside a jump
    if not len(k):
        return np.ones(table.shape[1], dtype=np.bool_)
    some = np.setdiff1d(rows, k)
    there = replace(run, time=run.time[some], state=run.state[some])
    with np.errstate(all="ignore"):
        curved = np.abs(_table(linear_panels(between(there)(run.time[k]))) - table[k])
        share = ((run.time[k] - run.time[k - 1]) / (run.time[k + 1] - run.time[k - 1]))[:, None]
        straight = np.abs(table[k - 1] + share * (table[k + 1] - table[k - 1]) - table[k])
    missed = straight > bound
    accurate = (curved / 64.0 < bound) | (
        straight > 0.1 * np.ptp(table, axis=0)
    )  # the error falls with the sixth power of the step
    better = missed & accurate & (curved < 0.5 * straight)
    return np.asarray(better.sum(axis=0) >= 0.5 * missed.sum(axis=0), dtype=np.bool_)


def residual_panels(run: Trajectory, extremes: bool) -> list[Panel]:
    """Constraint residuals, one panel a unit."""
    panels = []
    for unit, values in run.constraint_residuals.items():
        title = f"constraint {'velocity' if unit.endswith('/s') else 'position'} residual"
        lines = [("largest", values)]
        panels.append(Panel(title, unit or "1", lines, logarithmic=True, time=run.time, extremes=extremes))
    return panels


def _output_columns(run: Trajectory, name: str) -> list[tuple[str, str, Array]]:
    values = run.output(name).reshape(len(run.time), -1)
    return [(label, unit, column) for (label, unit), column in zip(output_labels(run, name), values.T, strict=True)]
