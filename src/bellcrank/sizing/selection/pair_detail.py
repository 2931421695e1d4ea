"""Motors and gears along the cycles of their axis: loads at the motor shaft, RMS point, and temperatures.

What a page, a plot or a table shows of a pair; criteria have their own, faster reductions (`load_reductions`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.powertrain import PowerTrains, ShaftLoad
from bellcrank.actuators.product_arrays import Curves, GearArrays, MotorArrays
from bellcrank.actuators.thermal import HeatCycle, ThermalModel, temperatures
from bellcrank.actuators.thermal_cycle import periodic_temperatures
from bellcrank.arrays import Array, Mask
from bellcrank.sizing.selection.axis_loads import LoadCycle
from bellcrank.sizing.selection.selection import AxisSelection, Candidate, Selection

MOST_INTERVALS = 500  # of a temperature curve; in a longer cycle neighbours are averaged
THERMAL_FIGURES = {  # what temperatures need of a motor, in words
    "resistance": "resistance",
    "dc_torque_constant": "torque constant",
    "resistance_winding_housing": "thermal resistance from winding to housing",
    "resistance_housing_ambient": "thermal resistance from housing to ambient",
    "time_constant_winding": "thermal time constant of the winding",
    "time_constant_motor": "thermal time constant of the motor",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class ShaftModel:
    """How a load at the axis becomes one at the motor shaft (`actuators.powertrain`).

    Attributes:
        ratio: N, rad/rad or rad/m; NaN where it is not stated.
        efficiency: η, driving; 1 with a curve of efficiency.
        back_efficiency: η_b, while the load gives power back; None: as the curve of efficiency says.
        efficiency_curve: Points (k, 2) of output torque, N m (N), and efficiency; None: the efficiency is constant.
        inertia: J_rotor + J_gear, kg m².
        safety_factor: On the torque at the motor shaft.
        left_out: What is not stated and taken as ideal (efficiency 1, inertia 0): "gear efficiency", "rotor inertia",
            "gear inertia". Where there is any, the torque at the shaft is not known.
    """

    ratio: float
    efficiency: float
    back_efficiency: float | None
    efficiency_curve: Array | None
    inertia: float
    safety_factor: float
    left_out: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class ShaftCycle:
    """A pair along one cycle.

    Attributes:
        name: Name of the cycle.
        speed: Speed (n,) of the motor shaft, rad/s.
        torque: Torque (n,) at the motor shaft with the safety factor, N m; without what the model leaves out.
        mean_speed: Mean of the shaft's |speed| over time, rad/s.
        rms_torque: N m; None where it is not known.
        temperature: Times (s), temperatures of winding and housing (°C) in the periodic steady state (k, 3); None where
            they are not known.
        runaway: Whether the temperatures rise without end.
    """

    name: str
    speed: Array
    torque: Array
    mean_speed: float
    rms_torque: float | None
    temperature: Array | None
    runaway: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class PairDetail:
    """A motor and gear along the cycles of an axis.

    Attributes:
        shaft: From the axis to the motor shaft.
        cycles: Each cycle.
        temperature_text: Why temperatures are not known, or that they rise without end; empty where they are known.
    """

    shaft: ShaftModel
    cycles: tuple[ShaftCycle, ...]
    temperature_text: str


def pair_details(selection: Selection, axis: AxisSelection, candidates: Sequence[Candidate]) -> tuple[PairDetail, ...]:
    """What motors and gears bear along the cycles of a selection, which hold the masses of what was chosen.

    Args:
        selection: The selection.
        axis: One of its axes.
        candidates: m motors and gears for it.

    Returns:
        Loads at the shaft and temperatures of each.
    """
    if not candidates:
        return ()
    conditions = axis.conditions
    motors = [conditions.completed(one.motor) for one in candidates]
    gears = [conditions.completed(one.gear) for one in candidates]
    trains, left_out = _ideal_where_unknown(motors, gears)
    column = [each.axis.name for each in selection.axes].index(axis.axis.name)
    cycles = [
        _cycles(cycle, column, trains, [bool(names) for names in left_out], conditions) for cycle in selection.cycles
    ]
    shafts = [
        _shaft_model(trains, k, gear, names, conditions)
        for k, (gear, names) in enumerate(zip(gears, left_out, strict=True))
    ]
    return tuple(
        PairDetail(shaft=shaft, cycles=own, temperature_text=_temperature_text(motor, shaft, own))
        for motor, shaft, *own_cycles in zip(motors, shafts, *cycles, strict=True)
        for own in (tuple(own_cycles),)
    )


def pair_detail(selection: Selection, axis: AxisSelection, candidate: Candidate) -> PairDetail:
    """What one motor and gear bear, as in `pair_details`."""
    return pair_details(selection, axis, (candidate,))[0]


def _ideal_where_unknown(motors: Sequence[Motor], gears: Sequence[Gear]) -> tuple[PowerTrains, list[tuple[str, ...]]]:
    """Power trains (m,) that are ideal where a pair states nothing, and what each of them leaves out."""
    motor, gear = MotorArrays.of(motors), GearArrays.of(gears)
    curve = gear.efficiency_curve.known & ~np.isnan(gear.rated_torque)
    unknown = {
        "gear efficiency": np.isnan(gear.efficiency) & ~curve,
        "gear inertia": np.isnan(gear.inertia),
        "rotor inertia": np.isnan(motor.rotor_inertia),
    }
    no_efficiency = unknown["gear efficiency"]
    ideal = gear.with_figures(
        efficiency=np.where(no_efficiency, 1.0, gear.efficiency),
        driven_efficiency=np.where(no_efficiency, 1.0, gear.driven_efficiency),
        efficiency_curve=Curves.of(
            [one.efficiency_curve if use else None for one, use in zip(gears, curve, strict=True)]
        ),
        inertia=np.nan_to_num(gear.inertia),
    )
    turning = motor.with_figures(rotor_inertia=np.nan_to_num(motor.rotor_inertia))
    left_out = [tuple(name for name, where in unknown.items() if where[k]) for k in range(len(motors))]
    return PowerTrains(turning, ideal), left_out


def _shaft_model(
    trains: PowerTrains, k: int, gear: Gear, left_out: tuple[str, ...], conditions: Conditions
) -> ShaftModel:
    """The model of the k-th pair."""
    gears = trains.gears
    curve = bool(gears.efficiency_curve.known[k])
    points = np.array(gear.efficiency_curve) * [gear.rated_torque, 1.0] if curve else None
    back = float((gears.back_efficiency if curve else gears.driven_efficiency)[k])
    return ShaftModel(
        ratio=float(gears.ratio[k]),
        efficiency=1.0 if curve else float(gears.efficiency[k]),
        back_efficiency=None if np.isnan(back) else back,
        efficiency_curve=points,
        inertia=float(trains.shaft_inertia[k]),
        safety_factor=conditions.safety_factor,
        left_out=left_out,
    )


def _cycles(
    cycle: LoadCycle, column: int, trains: PowerTrains, incomplete: Sequence[bool], conditions: Conditions
) -> list[ShaftCycle]:
    """One cycle of every pair."""
    factor = conditions.safety_factor
    with np.errstate(invalid="ignore"):
        load = trains[:, None].load(cycle.torque[:, column], cycle.speed[:, column], cycle.acceleration[:, column])
    load = replace(load, torque=factor * load.torque, copper_loss=factor**2 * load.copper_loss)
    mean_speed = np.abs(load.speed) @ cycle.weight / cycle.duration
    rms = np.sqrt(load.torque**2 @ cycle.weight / cycle.duration)
    time, winding, housing, runaway = _temperatures(cycle, trains.motors, load, conditions)
    unknown = np.asarray(incomplete) | ~(np.isfinite(winding) & np.isfinite(housing)).all(axis=1)
    return [
        ShaftCycle(
            name=cycle.name,
            speed=load.speed[k],
            torque=load.torque[k],
            mean_speed=float(mean_speed[k]),
            rms_torque=None if incomplete[k] or np.isnan(rms[k]) else float(rms[k]),
            temperature=None if unknown[k] else np.column_stack([time, winding[k], housing[k]]),
            runaway=bool(runaway[k]) and not incomplete[k],
        )
        for k in range(len(incomplete))
    ]


def _temperatures(
    cycle: LoadCycle, motors: MotorArrays, load: ShaftLoad, conditions: Conditions
) -> tuple[Array, Array, Array, Mask]:
    """Times (s), winding and housing (m, k) in the periodic steady state, °C, and runaway (m,)."""
    order = np.concatenate([np.tile(np.arange(first, end), passes) for first, end, passes in cycle.sequence])
    duration = cycle.interval_duration[order]
    losses = [cycle.interval_mean(loss.T)[order].T for loss in (load.copper_loss, load.friction_loss)]
    group = np.arange(len(order)) * min(MOST_INTERVALS, len(order)) // len(order)
    starts = np.flatnonzero(np.diff(group, prepend=-1))
    total = np.add.reduceat(duration, starts)
    length = np.where(total > 0.0, total, 1.0)
    copper, friction = (np.add.reduceat(loss * duration, starts, axis=1) / length for loss in losses)
    heat = HeatCycle(duration=total, copper_loss=copper, friction_loss=friction)
    model = ThermalModel.of(motors, conditions)
    periodic = periodic_temperatures(model, heat)
    begin = [np.where(np.isfinite(start), start, np.nan) for start in (periodic.winding_start, periodic.housing_start)]
    time, winding, housing = temperatures(model, heat, (begin[0], begin[1]))
    return time, winding, housing, periodic.runaway


def _temperature_text(motor: Motor, shaft: ShaftModel, cycles: Sequence[ShaftCycle]) -> str:
    """Why temperatures are not known; empty where those of a cycle are, and none rises without end."""
    endless = [cycle.name for cycle in cycles if cycle.runaway]
    if endless:
        return f"Thermal runaway: in {', '.join(endless)} the temperature rises without end."
    if any(cycle.temperature is not None for cycle in cycles):
        return ""
    missing = [words for name, words in THERMAL_FIGURES.items() if getattr(motor, name) is None]
    missing += [*shaft.left_out, *(["ratio"] if np.isnan(shaft.ratio) else [])]
    return f"Unknown: not stated: {', '.join(missing)}." if missing else "Unknown."
