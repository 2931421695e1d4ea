"""One motor and gear along the cycles of its axis: loads at the motor shaft, RMS point, and temperatures.

What a page, a plot or a table shows of a pair; criteria have their own, faster reductions (`load_reductions`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.powertrain import PowerTrains
from bellcrank.actuators.product_arrays import Curves, GearArrays, MotorArrays
from bellcrank.sizing.selection.axis_loads import LoadCycle
from bellcrank.sizing.selection.selection import AxisSelection, Candidate, Selection

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class ShaftModel:
    """How a load at the axis becomes one at the motor shaft (`actuators.powertrain`).

    Attributes:
        ratio: N, rad/rad or rad/m.
        efficiency: η, driving; 1 with a curve of efficiency.
        back_efficiency: η_b, while the load gives power back; None: as the curve of efficiency says.
        efficiency_curve: Points (k, 2) of output torque, N m (N), and efficiency; None: the efficiency is constant.
        inertia: J_rotor + J_gear, kg m².
        safety_factor: On the axis torque.
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
        rms_torque: N m; None where the model leaves something out.
        temperature: Times (s), temperatures of winding and housing (°C) in the periodic steady state (k, 3); None where
            they are not known.
    """

    name: str
    speed: Array
    torque: Array
    mean_speed: float
    rms_torque: float | None
    temperature: Array | None


@dataclass(frozen=True, kw_only=True, eq=False)
class PairDetail:
    """A motor and gear along the cycles of an axis.

    Attributes:
        shaft: From the axis to the motor shaft; None where the gear's ratio is not stated.
        cycles: Each cycle; none without a shaft model.
        temperature_text: Why temperatures are not known; empty where they are.
    """

    shaft: ShaftModel | None
    cycles: tuple[ShaftCycle, ...]
    temperature_text: str


def pair_detail(selection: Selection, axis: AxisSelection, candidate: Candidate) -> PairDetail:
    """What a motor and gear bear along the cycles of a selection, which hold the masses of what was chosen.

    Args:
        selection: The selection.
        axis: One of its axes.
        candidate: A motor and gear for it.

    Returns:
        Loads at the shaft and temperatures.
    """
    conditions = selection.conditions
    motor, gear = conditions.completed(candidate.motor), conditions.completed(candidate.gear)
    if gear.ratio is None:
        return PairDetail(shaft=None, cycles=(), temperature_text="Temperature: unknown, the ratio is not stated.")
    shaft, train = shaft_model(motor, gear, conditions.safety_factor)
    column = [each.axis.name for each in selection.axes].index(axis.axis.name)
    cycles = tuple(_cycle(cycle, column, train, shaft) for cycle in selection.cycles)
    return PairDetail(shaft=shaft, cycles=cycles, temperature_text="Temperature: unknown.")


def shaft_model(motor: Motor, gear: Gear, safety_factor: float) -> tuple[ShaftModel, PowerTrains]:
    """The model of a pair whose ratio is stated, and its power train, ideal where the pair states nothing."""
    assert gear.ratio is not None
    curve = gear.efficiency_curve if gear.rated_torque is not None else None
    motors, gears, one, zero = MotorArrays.of([motor]), GearArrays.of([gear]), np.ones(1), np.zeros(1)
    left_out = []
    if gear.efficiency is None and curve is None:
        left_out.append("gear efficiency")
        gears = replace(gears, efficiency=one, driven_efficiency=one, efficiency_curve=Curves.of([None]))
    if gear.inertia is None:
        left_out.append("gear inertia")
        gears = replace(gears, inertia=zero)
    if motor.rotor_inertia is None:
        left_out.append("rotor inertia")
        motors = replace(motors, rotor_inertia=zero)
    train = PowerTrains(motors, gears)
    points = None if curve is None else np.array(curve) * [gear.rated_torque, 1.0]
    back = gears.back_efficiency if curve is not None else gears.driven_efficiency
    model = ShaftModel(
        ratio=gear.ratio,
        efficiency=1.0 if curve is not None else float(gears.efficiency[0]),
        back_efficiency=None if np.isnan(back[0]) else float(back[0]),
        efficiency_curve=points,
        inertia=float(train.shaft_inertia[0]),
        safety_factor=safety_factor,
        left_out=tuple(left_out),
    )
    return model, train


def _cycle(cycle: LoadCycle, column: int, train: PowerTrains, shaft: ShaftModel) -> ShaftCycle:
    torque = shaft.safety_factor * cycle.torque[:, column]
    load = train.load(torque, cycle.speed[:, column], cycle.acceleration[:, column])
    squared = float(cycle.weight @ load.torque**2) / cycle.duration
    return ShaftCycle(
        name=cycle.name,
        speed=load.speed,
        torque=load.torque,
        mean_speed=float(cycle.weight @ np.abs(load.speed)) / cycle.duration,
        rms_torque=None if shaft.left_out else float(np.sqrt(squared)),
        temperature=None,
    )
