"""What a run has to show over time: its quantities in panels, one a unit; for pictures and for the replay."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.motion.coordinates import position_labels, velocity_labels
from bellcrank.simulation.run_csv import output_labels, titled, torque_unit

if TYPE_CHECKING:
    from bellcrank.simulation.trajectory import Array, Trajectory


@dataclass
class Panel:
    """What one panel shows: a quantity, its unit, and the lines (n,) by name."""

    title: str
    unit: str
    lines: list[tuple[str, Array]]
    logarithmic: bool = False

    @property
    def moves(self) -> bool:
        """Whether anything in it changes."""
        return any(np.any(values != values[0]) for _, values in self.lines)


def run_panels(run: Trajectory) -> list[Panel]:
    """The panels of a run, no two of one title: positions, velocities, energies, torques, closures and outputs that
    change, over the run's own rows, SI units.
    """
    joints = run.robot.joints
    one = [joint for joint in joints if joint.nv == 1]
    panels = by_unit("position", position_labels(joints), run.position)
    panels = panels[:1] + [panel for panel in panels[1:] if panel.moves]
    panels += [panel for panel in by_unit("velocity", velocity_labels(joints), run.velocity) if panel.moves]
    energies = [("kinetic T", run.kinetic_energy), ("potential V", run.potential_energy), ("T + V", run.total_energy)]
    if np.any(run.work):
        energies.append(("work W", run.work))
    panels.append(Panel(f"energy (drift {run.energy_drift():.1e})", "J", energies))
    labels = [(joint.name, torque_unit(joint.kind)) for joint in one]
    torques = by_unit("joint torque", labels, run.torque[:, [joint.v for joint in one]])
    panels += [panel for panel in torques if any(np.any(values) for _, values in panel.lines)]
    panels += _closure_panels(run)
    outputs = [(label, unit, column) for name in run.outputs for label, unit, column in _output_columns(run, name)]
    for unit in dict.fromkeys(unit for _, unit, _ in outputs):
        lines = [(label, column) for label, u, column in outputs if u == unit]
        names = ", ".join(n for n, output in run.scene.outputs.items() if unit in [titled(x)[1] for x in output.labels])
        panels.append(Panel(f"outputs: {textwrap.shorten(names, 60, placeholder='…')}", unit, lines))
    return titled_apart(panels)


def titled_apart(panels: list[Panel]) -> list[Panel]:
    """The panels, with the unit in the titles that stand twice."""
    titles = [panel.title for panel in panels]
    for panel in panels:
        if titles.count(panel.title) > 1:
            panel.title += f", {shown_unit(panel.unit)}"
    return panels


def by_unit(title: str, labels: Sequence[tuple[str, str]], table: Array) -> list[Panel]:
    """One panel a unit of a table's columns, (name, unit) each; the word for the quantity is in the panel's title, and
    need not stand in every line's name.
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
    """A unit as it is shown: "1" where there is none."""
    return unit.replace("^2", "²") or "1"


def _closure_panels(run: Trajectory) -> list[Panel]:
    """The multipliers of closures, one panel a unit, and how far they are apart."""
    if not run.scene.closures:
        return []
    names = [titled(f"{owner} {label}") for owner, label in run.scene.system.multiplier_names]
    panels = by_unit("multiplier", names, run.multipliers)
    apart = [run.closure(closure.name) for closure in run.scene.closures]
    lines = [
        ("position [m or rad]", np.max([each.residual for each in apart], axis=0)),
        ("velocity [m/s or rad/s]", np.max([each.velocity_residual for each in apart], axis=0)),
    ]
    return [*panels, Panel("closures apart", "m or rad, and /s", lines, logarithmic=True)]


def _output_columns(run: Trajectory, name: str) -> list[tuple[str, str, Array]]:
    values = run.output(name).reshape(len(run), -1)
    return [(label, unit, column) for (label, unit), column in zip(output_labels(run, name), values.T, strict=True)]
