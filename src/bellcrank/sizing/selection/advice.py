"""What would help where nothing in the catalogue can drive an axis.

Each remedy is tried: the nearest pair is judged again with other ratios, with higher voltages and along slower cycles,
and only what then passes all known criteria is named.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from bellcrank.sizing.selection.axis_loads import LoadCycle
from bellcrank.sizing.selection.joint_problem import Masses
from bellcrank.sizing.selection.judge import judge
from bellcrank.sizing.selection.judged_axes import JudgedAxes
from bellcrank.sizing.selection.load_reductions import ReducedLoads, reduce_cycle
from bellcrank.sizing.selection.matching_criteria import MotorType
from bellcrank.sizing.selection.pairs import Pairs, failing_order
from bellcrank.sizing.selection.selection import AxisSelection, Candidate
from bellcrank.sizing.selection.tables import percent

RATIOS = np.geomspace(0.1, 10.0, 201)  # tried, of the gear's ratio
VOLTAGES = np.geomspace(1.02, 5.0, 80)  # tried, of the voltage
DURATIONS = np.geomspace(1.05, 10.0, 47)  # tried, of the cycle's duration
SLOWER_PAIRS = 50  # nearest pairs that are tried along slower cycles


def advice_for(problem: JudgedAxes, axis: int, masses: Masses, one: AxisSelection) -> AxisSelection:
    """The selection of an axis, with advice where nothing passes, or the given pair fails."""
    if one.chosen is not None and one.chosen.tier != "fails":
        return one
    failing = [each for each in one.candidates if each.tier == "fails"]
    if not failing:
        needed = "a screw or rack, which a linear axis takes" if one.axis.kind == "linear" else "a motor"
        return replace(
            one, advice=f"no pair of the catalogue can be mounted on this {one.axis.kind} axis; add {needed}"
        )
    failing.sort(key=lambda each: each.largest_use)
    nearest = one.chosen or failing[0]
    remedies = _Remedies(problem, axis, masses, nearest)
    ratio = next((text for each in ([nearest] if one.kept else failing) if (text := remedies.ratio(each))), "")
    exceeded = [result for result in nearest.criteria if result.verdict == "exceeded"]
    listed = "; ".join(f"{result.name} {percent(result.use or 0.0)} ({result.text})" for result in exceeded)
    helpful = [text for text in (ratio, remedies.voltage(), remedies.slower()) if text]
    if any(result.name == MotorType.name for result in exceeded):
        helpful.append("motors of this type in a catalogue of your own, or other 'commutation' or 'construction'")
    factors = ", ".join(
        f"{result.use:.2f} times as high in '{result.name}'"
        for result in exceeded
        if result.use is not None and math.isfinite(result.use)
    )
    if factors:
        helpful.append(f"limits {factors}: a larger motor or gear, as far as its own inertia does not add to the load")
    elif not helpful:
        helpful.append("a larger motor or gear")
    kept = "the given pair" if one.kept else "nearest to the limits is"
    return replace(one, advice=f"{kept} {nearest.id}: {listed}. It would help: {'; or '.join(helpful)}")


class _Remedies:
    """Remedies for one failing pair of an axis: texts, empty where nothing of the kind helps."""

    def __init__(self, problem: JudgedAxes, axis: int, masses: Masses, pair: Candidate) -> None:
        self.problem, self.axis, self.masses = problem, axis, masses
        self.conditions = problem.conditions[axis]
        self.motor, self.gear = pair.motor, pair.gear
        self.exceeded = {result.name for result in pair.criteria if result.verdict == "exceeded"}
        self.loads = problem.axis_loads(axis, masses)

    def ratio(self, pair: Candidate) -> str:
        """Other ratios of the gear of a pair."""
        if pair.gear.ratio is None or pair.gear.kind == "direct":
            return ""
        ratios = pair.gear.ratio * RATIOS
        geared = Pairs.of(*((pair.motor, replace(pair.gear, ratio=float(ratio))) for ratio in ratios))
        passing = ratios[judge(geared, self.loads, self.conditions).tier < 2]
        if not len(passing):
            return ""
        unit = "" if self.problem.axes[self.axis].axis.kind == "rotary" else " rad/m"
        between = f"{passing[0]:.3g} to {passing[-1]:.3g}{unit}"
        return f"a ratio of {between} in place of {pair.gear.ratio:.4g} (of {pair.id})"

    def voltage(self) -> str:
        """A higher voltage."""
        now = self.motor.nominal_voltage if self.conditions.voltage is None else self.conditions.voltage
        if now is None or not self.exceeded & {"voltage limit", "peak curve"}:
            return ""

        def passes(factor: float) -> bool:
            conditions = replace(self.conditions, voltage=now * factor)
            return bool(judge(Pairs.of((self.motor, self.gear)), self.loads, conditions).tier[0] < 2)

        factor = _first(VOLTAGES.tolist(), passes)
        return f"a voltage of {now * factor:.3g} V in place of {now:g} V" if factor else ""

    def slower(self) -> str:
        """A slower cycle."""
        keys, one = self.problem.keys(self.axis, self.masses), self.problem.axes[self.axis]
        pairs = one.pairs.take(failing_order(keys)[:SLOWER_PAIRS])
        cycles = self.problem.cycles(self.masses)

        def passing(factor: float) -> np.ndarray[tuple[int, ...], np.dtype[np.intp]]:
            reduced = tuple(
                reduce_cycle(slower_cycle(cycle, factor), self.problem.loads.axes, self.axis) for cycle in cycles
            )
            loads = ReducedLoads(axis=one.axis, cycles=reduced)
            return np.flatnonzero(judge(pairs, loads, self.conditions).tier < 2)

        factor = _first(DURATIONS.tolist(), lambda each: len(passing(each)) > 0)
        if not factor:
            return ""
        motor, gear = pairs.rows(int(passing(factor)[0]))
        name = motor.id if gear.kind == "direct" else f"{motor.id}+{gear.id}"
        return f"motions that last about {factor:.2f} times as long (then {name} passes what is known)"


def _first(values: Sequence[float], passes: Callable[[float], bool]) -> float | None:
    """The first value that passes."""
    return next((value for value in values if passes(value)), None)


def slower_cycle(cycle: LoadCycle, factor: float) -> LoadCycle:
    """A cycle that lasts `factor` times as long: what does not hold the axis at rest falls with the factor's square.

    Inertial, Coriolis and centrifugal torques do (Hollerbach, Dynamic scaling of manipulator trajectories, 1984).
    Friction falls less, so the result is approximate where there is friction.
    """
    moving = cycle.torque - cycle.static_torque
    return replace(
        cycle,
        duration=cycle.duration * factor,
        time=cycle.time * factor,
        weight=cycle.weight * factor,
        torque=cycle.static_torque + moving / factor**2,
        speed=cycle.speed / factor,
        acceleration=cycle.acceleration / factor**2,
    )
