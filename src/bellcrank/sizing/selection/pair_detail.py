"""Motors and gears along the cycles of their axis: loads at the motor shaft, RMS point, and temperatures.

What a page, a plot or a table shows of a pair; criteria have their own, faster reductions (`load_reductions`).

All limits are the same for the opposite torque and speed together, so the half plane of positive speeds shows all of
them: positive torques drive, negative ones brake.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.continuous_torque import continuous_torque
from bellcrank.actuators.electrical import friction_torque
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.powertrain import PowerTrains, ShaftLoad
from bellcrank.actuators.product_arrays import Curves, GearArrays, MotorArrays
from bellcrank.actuators.short_time_limits import SpeedTorqueLimit, peak_curves, short_time_limits
from bellcrank.actuators.thermal import HeatCycle, ThermalModel, temperatures
from bellcrank.actuators.thermal_cycle import periodic_temperatures
from bellcrank.arrays import Array, Mask
from bellcrank.sizing.selection.axis_loads import LoadCycle
from bellcrank.sizing.selection.selection import AxisSelection, Candidate, Selection

POINTS = 121  # of a curve before points on straight lines are left out
STRAIGHT = 1e-4  # of a curve's range: deviation of a point that is left out
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
class MotorCurves:
    """Curves of one motor under some conditions; None where nothing is known of a curve.

    Attributes:
        continuous: S1 torque: points (k, 2) of speed rad/s and torque N m.
        short_time: The region of short-time operation: (k, 3) of speed, smallest and largest torque; infinite where no
            bound is known.
        voltage: The voltage limit: points (2, 2).
        unknown: What bounds the region of short-time operation and is not stated, such as "peak torque".
    """

    continuous: Array | None
    short_time: Array | None
    voltage: Array | None
    unknown: tuple[str, ...]


def motor_curves(motor: Motor, conditions: Conditions) -> MotorCurves:
    """The curves of a motor; values that the conditions assume fill what it does not state.

    Args:
        motor: The motor.
        conditions: Supply, surroundings and assumed values.

    Returns:
        The curves.

    Example:
        >>> from bellcrank.actuators.conditions import Conditions
        >>> from bellcrank.actuators.motor import Motor
        >>> motor = Motor(id="m", maker="", model="", nominal_torque=1.5, nominal_speed=300.0, peak_torque=4.0)
        >>> curves = motor_curves(motor, Conditions())
        >>> curves.continuous.tolist(), curves.voltage, curves.unknown
        ([[0.0, 1.5], [300.0, 1.5]], None, ('voltage limit', 'maximum speed'))
    """
    motors = MotorArrays.of([conditions.completed(motor)])
    limits = short_time_limits(motors, conditions)
    known = [limit for limit in limits if np.isfinite(limit.torque[0]) and np.isfinite(limit.speed[0])]
    voltage = next((limit for limit in known if limit.name == "voltage limit"), None)
    names = {limit.name for limit in known}
    torque_bound = names & {"peak torque", "peak current"} or motors.peak_curve.known[0]
    unknown = [] if torque_bound else ["peak torque"]
    unknown += [name for name in ("voltage limit", "maximum speed") if name not in names]
    return MotorCurves(
        continuous=_continuous(motors, conditions, _end(motors, known)),
        short_time=_short_time(motors, conditions, known),
        voltage=None if voltage is None else _voltage_line(motors, voltage),
        unknown=tuple(unknown),
    )


def _end(motors: MotorArrays, known: list[SpeedTorqueLimit]) -> float:
    """The speed up to which curves are drawn, rad/s: the largest that any limit or figure names."""
    stated = [
        motors.max_speed[0],
        motors.nominal_speed[0],
        motors.continuous_curve.last_x[0],
        motors.peak_curve.last_x[0],
    ]
    stated += [1.0 / limit.speed[0] for limit in known if limit.speed[0] > 0.0]
    finite = [float(speed) for speed in stated if np.isfinite(speed)]
    if np.isfinite(motors.max_speed[0]):
        return float(motors.max_speed[0])
    return max(finite, default=0.0)


def _continuous(motors: MotorArrays, conditions: Conditions, end: float) -> Array | None:
    """The S1 curve up to where it is known, or falls to zero."""
    stated = [motors.nominal_speed[0], *motors.continuous_curve.x[0]]
    speed = _speeds(end, [value for value in stated if np.isfinite(value)])
    torque = continuous_torque(motors, speed, conditions).torque
    known = np.isfinite(torque)
    if not known.any():
        return None
    zero = np.flatnonzero(torque == 0.0)
    known[zero[1:]] = False
    return straightened(np.column_stack([speed, torque])[known])


def _short_time(motors: MotorArrays, conditions: Conditions, known: list[SpeedTorqueLimit]) -> Array | None:
    """The largest and smallest torque of short-time operation over speed, within all limits that are known."""
    peak = peak_curves(motors, conditions)
    if not known and not peak.known[0]:
        return None
    ends = [1.0 / limit.speed[0] for limit in known if limit.name == "maximum speed"]
    ends += [float(peak.last_x[0])] if np.isfinite(peak.last_x[0]) else []
    ends += [2.0 / limit.speed[0] for limit in known if limit.name == "voltage limit"]  # where it brakes only
    if not ends:
        speed = np.array([0.0, np.inf])
        bound = min((1.0 / limit.torque[0] for limit in known if limit.torque[0] > 0.0), default=np.inf)
        return np.column_stack([speed, [-bound, -bound], [bound, bound]])
    speed = _speeds(min(ends), [value for value in peak.x[0] if np.isfinite(value)])
    friction = friction_torque(motors, speed)
    low, high = np.full(len(speed), -np.inf), np.full(len(speed), np.inf)
    for limit in known:
        a, b = limit.torque[0], limit.speed[0]
        if a > 0.0:
            own = friction if limit.basis == "electrical" else 0.0
            low = np.fmax(low, (-1.0 - b * speed) / a - own)
            high = np.fmin(high, (1.0 - b * speed) / a - own)
    if peak.known[0]:
        printed = peak.at(speed, beyond=0.0)
        low, high = np.fmax(low, -printed), np.fmin(high, printed)
    inside = high >= low
    return straightened(np.column_stack([speed, low, high])[inside])


def _voltage_line(motors: MotorArrays, limit: SpeedTorqueLimit) -> Array:
    """The line a T + b ω = 1 from standstill to the opposite torque."""
    speed = np.array([0.0, 2.0 / limit.speed[0]])
    torque = (1.0 - limit.speed[0] * speed) / limit.torque[0]
    if limit.basis == "electrical":
        torque = torque - np.nan_to_num(friction_torque(motors, np.maximum(speed, 1e-9)))
    return np.column_stack([speed, torque])


def _speeds(end: float, more: list[float]) -> Array:
    """Speeds from 0 to an end, with those of `more` in between."""
    return np.union1d(
        np.linspace(0.0, end, POINTS if end > 0.0 else 1), [value for value in more if 0.0 <= value <= end]
    )


def straightened(points: Array) -> Array:
    """Points (k, m) of a curve without those on straight lines between others (within STRAIGHT of each column's range).

    Source: D. Douglas, T. Peucker, The Canadian Cartographer 10, 1973, with vertical distances.
    """
    finite = np.where(np.isfinite(points), points, 0.0)
    scale = np.maximum(np.ptp(finite, axis=0), 1e-300)
    keep, stack = {0, len(points) - 1}, [(0, len(points) - 1)]
    while stack:
        first, last = stack.pop()
        if last - first < 2:
            continue
        inner = np.arange(first + 1, last)
        part = ((finite[inner, 0] - finite[first, 0]) / max(finite[last, 0] - finite[first, 0], 1e-300))[:, None]
        chord = finite[first] + part * (finite[last] - finite[first])
        off = np.max(np.abs(finite[inner] - chord) / scale, axis=1)
        worst = int(np.argmax(off))
        if off[worst] > STRAIGHT:
            middle = int(inner[worst])
            keep.add(middle)
            stack += [(first, middle), (middle, last)]
    return points[sorted(keep)]


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
