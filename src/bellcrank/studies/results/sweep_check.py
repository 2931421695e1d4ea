"""How sure the table of a sweep is: some of its designs again with a finer tolerance, and what those runs reach."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.errors import BellcrankError
from bellcrank.notes import Note, Omission
from bellcrank.scene.scene import Scene
from bellcrank.scene.settings import FINEST_RTOL
from bellcrank.simulation.simulate import simulate
from bellcrank.simulation.trajectory.reached import may_reach, reached_notes
from bellcrank.studies.execution.simulation_runner import SimulationRunner

if TYPE_CHECKING:
    from bellcrank.studies.results.sweep_result import Sweep

DESIGNS, SEED = 32, 28  # run again
FINER = 100.0  # times the tolerance, or a quarter of a fixed step
NOISE = 0.1  # of the spread of a measure, from which its table is noise
REACHED: dict[Omission, tuple[str, str]] = {
    "limit": ("leaves its range", "joint limits are not enforced"),
    "contact": ("goes through a floor", "contacts are not modelled"),
    "friction": ("creeps where friction would hold it", "Coulomb friction is smoothed"),
}
OF_THE_COMPUTATION = ("energy_drift", "constraint_residual")  # measures that are errors themselves


@dataclass(frozen=True, kw_only=True)
class SweepCheck:
    """Some designs of a sweep that were run again with a finer tolerance.

    Attributes:
        designs: The numbers of these designs.
        rtol: The relative tolerance of the second runs.
        seconds: How long they took, s.
        differences: By measure, the largest difference of the two runs (SI units).
        shares: By measure that varies, the root mean square difference as a share of the measure's standard deviation
            in the table.
        notes: What of the table is noise, and what the designs reach that is not modelled.
    """

    designs: tuple[int, ...]
    rtol: float
    seconds: float
    differences: Mapping[str, float]
    shares: Mapping[str, float]
    notes: tuple[Note, ...]

    def __str__(self) -> str:
        agree = max(self.shares.values(), default=0.0)
        return (
            f"{len(self.designs)} designs were run again at rtol {self.rtol:.0e} in {self.seconds:.2g} s; their "
            f"measures agree within {agree:.1g} of the spread in the table"
        )


def check_sweep(sweep: Sweep) -> SweepCheck | None:
    """Run up to 32 designs of a sweep again, drawn with a fixed seed; None where that says nothing.

    That is so for sizings, sweeps that were interrupted, and where the tolerance is varied.
    """
    varied = any(axis.path.startswith("simulate.") and axis.path != "simulate.duration" for axis in sweep.axes)
    if sweep.sized or sweep.timed or not sweep.complete or not len(sweep) or varied:
        return None
    begin = time.perf_counter()
    rows = np.sort(np.random.default_rng(SEED).permutation(len(sweep))[:DESIGNS])
    finer = _finer(sweep.scene)
    again = SimulationRunner(finer, sweep.axes).run(sweep.values[rows])
    differences, shares, noise = dict[str, float](), dict[str, float](), list[Note]()
    for name in sweep.units:
        whole, new = sweep.column(name), again.measures.get(name)
        if new is None or name in OF_THE_COMPUTATION:
            continue
        with np.errstate(all="ignore"):  # measures may be infinite, or overflow here
            gap = np.abs(whole[rows] - new)
            gap, finite = gap[np.isfinite(gap)], whole[np.isfinite(whole)]
            if not len(gap) or not len(finite):
                continue
            differences[name] = float(gap.max())
            absolute, relative = sweep.noise
            spread = float(finite.std())
            if np.isfinite(spread) and np.ptp(finite) > absolute + relative * np.abs(finite).max():
                shares[name] = float(np.sqrt(np.mean(gap**2)) / spread)
    bad = [name for name, share in shares.items() if share > NOISE]
    if bad:
        worst = max(bad, key=lambda name: shares[name])
        others = ", ".join(name for name in bad if name != worst)
        text = (
            f"the table of {worst} is noise: designs run again at rtol {finer.settings.rtol:.0e} differ by up to "
            f"{differences[worst]:.3g} {sweep.units[worst]}, in root mean square by {100.0 * shares[worst]:.0f} % of "
            f"the spread{f'; so are those of {others}' if others else ''}; take smaller tolerances or shorter runs"
        )
        noise.append(Note(text, "reached"))
    before, after = sweep.status[rows], np.array(again.statuses or ("",))[again.status]
    if changed := int((before != after).sum()):
        text = f"{changed} of {len(rows)} designs run again at rtol {finer.settings.rtol:.0e} end otherwise"
        noise.append(Note(text, "reached"))
    noise += _reached(sweep, rows)
    return SweepCheck(
        designs=tuple((sweep.index[rows]).tolist()),
        rtol=finer.settings.rtol,
        seconds=time.perf_counter() - begin,
        differences=differences,
        shares=shares,
        notes=tuple(noise),
    )


def _finer(scene: Scene) -> Scene:
    """The scene with tolerances that are smaller by 100, or a quarter of its fixed step."""
    s = scene.settings
    changes: dict[str, Any] = {"simulate.rtol": max(s.rtol / FINER, FINEST_RTOL), "simulate.atol": s.atol / FINER}
    if s.step:
        changes["simulate.step"] = s.step / 4.0
    return scene.with_overrides(changes)


def _reached(sweep: Sweep, rows: NDArray[np.int64]) -> list[Note]:
    """A note on each thing that some of the designs reach and that is not modelled, with the first time and design."""
    if not may_reach(sweep.scene):
        return []
    designs = SimulationRunner(sweep.scene, sweep.axes).designs
    found = defaultdict[tuple[Omission, str], list[tuple[float, int]]](list)
    for row in rows.tolist():
        try:
            run = simulate(sweep.scene.with_overrides(designs.overrides(sweep.values[row].tolist())))
        except BellcrankError:
            continue  # it is infeasible, which the table says
        for note in reached_notes(run):
            who = "'".join(note.split("'")[:2])  # joint 'elbow
            found[note.omits, who].append((note.time or 0.0, int(sweep.index[row])))
    notes = []
    for (omits, who), all_of in found.items():
        (time, design), (does, why) = min(all_of), REACHED[omits]
        text = (
            f"{who}' {does} in {len(all_of)} of {len(rows)} designs that were looked at, first at {time:.4g} s in "
            f"design {design}; {why}"
        )
        notes.append(Note(text, "reached", omits, time=time))
    return notes
