"""Random motors, gears and load cycles: plausible figures, and rows that lack some of them."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TypeVar

import numpy as np

from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.sizing.selection.axis_loads import DrivenAxis, LoadCycle

Row = TypeVar("Row", Motor, Gear)
NEVER_MISSING = ("nominal_torque", "nominal_speed", "voltage_constant")


def random_motors(number: int, seed: int, missing: float = 0.0) -> list[Motor]:
    """Motors from 10 W to 3 kW whose figures agree with each other; a share of the figures is left out."""
    rng = np.random.default_rng(seed)
    return [_without(_motor(rng, k), rng, missing) for k in range(number)]


def random_gears(number: int, seed: int, missing: float = 0.0, linear: bool = False) -> list[Gear]:
    """Gears of ratio 3 to 160 (screws with leads of 2 to 40 mm); a share of the figures is left out."""
    rng = np.random.default_rng(seed + 1_000_003)
    return [_without(_gear(rng, k, linear), rng, missing) for k in range(number)]


def _motor(rng: np.random.Generator, number: int) -> Motor:
    power = 10.0 ** rng.uniform(1.0, 3.5)
    nominal_speed = rng.uniform(150.0, 600.0)
    torque = power / nominal_speed
    voltage = float(rng.choice([24.0, 48.0, 325.0]))
    constant = voltage / nominal_speed * rng.uniform(0.6, 0.8)
    current = torque / constant
    resistance = voltage / current * rng.uniform(0.02, 0.1)
    rise = rng.uniform(80.0, 130.0)
    copper = resistance * current**2 * (1.0 + 0.0039 * rise)
    thermal = rise / copper * rng.uniform(0.9, 1.3)
    share = rng.uniform(0.2, 0.7)
    peak = rng.uniform(2.0, 4.0)
    top = nominal_speed * rng.uniform(1.0, 1.6)
    curves = rng.random() < 0.15
    return Motor(
        id=f"m{number:04d}",
        maker="random",
        model=f"{power:.0f} W",
        nominal_voltage=voltage,
        torque_constant=constant,
        torque_constant_basis="dc",
        voltage_constant=constant * (1.0 + 0.02 * (number % 9)) if number % 3 == 0 else None,
        resistance=resistance,
        coulomb_friction=torque * rng.uniform(0.0, 0.05),
        viscous_friction=torque / nominal_speed * rng.uniform(0.0, 0.05),
        rotor_inertia=1e-5 * torque ** rng.uniform(1.0, 1.5) * 10.0 ** rng.uniform(-0.3, 0.7),
        nominal_torque=torque,
        nominal_speed=nominal_speed,
        peak_torque=peak * torque,
        peak_current=peak * current * 1.1,
        peak_time=rng.uniform(0.5, 10.0),
        max_speed=top,
        continuous_curve=((0.0, 1.2 * torque), (nominal_speed, torque), (top, 0.7 * torque)) if curves else None,
        peak_curve=((0.0, peak * torque), (0.8 * top, peak * torque), (top, 0.6 * peak * torque)) if curves else None,
        resistance_winding_housing=thermal * share,
        resistance_housing_ambient=thermal * (1.0 - share),
        time_constant_winding=rng.uniform(5.0, 60.0),
        time_constant_motor=rng.uniform(300.0, 3000.0),
        max_winding_temperature=25.0 + rise,
        max_housing_temperature=25.0 + rise * rng.uniform(0.7, 1.0),
        reference_temperature=25.0,
        brake_torque=torque * rng.uniform(1.0, 2.0),
        mass=0.1 + power / 150.0 * rng.uniform(0.7, 1.4),
        price=50.0 + power * rng.uniform(0.5, 2.0),
    )


def _gear(rng: np.random.Generator, number: int, linear: bool) -> Gear:
    rated = 10.0 ** rng.uniform(0.5, 3.0)
    kind = "screw" if linear else str(rng.choice(["strain_wave", "planetary", "cycloidal"]))
    ratio = 2.0 * np.pi / rng.uniform(0.002, 0.04) if linear else rng.uniform(3.0, 160.0)
    scale = 20.0 if linear else 1.0
    speed = rng.uniform(200.0, 400.0)
    efficiency = rng.uniform(0.65, 0.95)
    curve = rng.random() < 0.03
    return Gear(
        id=f"g{number:04d}",
        maker="random",
        model=f"{rated:.0f} N m",
        kind=kind,  # type: ignore[arg-type]
        ratio=ratio,
        efficiency=efficiency,
        efficiency_curve=((0.1, 0.5 * efficiency), (0.5, 0.9 * efficiency), (1.0, efficiency)) if curve else None,
        back_efficiency=efficiency * rng.uniform(0.8, 1.0),
        inertia=1e-6 * rated ** rng.uniform(0.6, 1.0),
        rated_torque=rated * scale,
        rated_speed=speed * 0.6,
        average_torque=1.3 * rated * scale,
        repeated_peak_torque=2.2 * rated * scale,
        momentary_torque=4.5 * rated * scale,
        average_speed=speed,
        max_speed=2.0 * speed,
        life=float(rng.choice([7000.0, 10000.0, 20000.0])),
        life_exponent=float(rng.choice([3.0, 10.0 / 3.0])),
        stiffness=2000.0 * rated,
        backlash=rng.uniform(0.0, 1e-3),
        tilting_moment=3.0 * rated,
        axial_load=100.0 * rated,
        mass=0.2 + rated / 40.0,
        price=100.0 + 8.0 * rated,
    )


def _without(row: Row, rng: np.random.Generator, missing: float) -> Row:
    numbers = [f.name for f in fields(row) if str(f.type) == "float | None" and f.name not in NEVER_MISSING]
    lost = {name: None for name in numbers if name != "ratio" and rng.random() < missing}
    return replace(row, **lost) if lost else row


def random_cycles(
    axes: int, seed: int, samples: int = 200, parts: int = 2, scale: float = 60.0
) -> tuple[tuple[DrivenAxis, ...], tuple[LoadCycle, ...]]:
    """Axes and one cycle of several parts: smooth random torques in all four quadrants, pauses, and passes."""
    rng = np.random.default_rng(seed + 2_000_003)
    names = tuple(DrivenAxis(name=f"joint{k}", kind="rotary", joints=(f"joint{k}",), mount="base") for k in range(axes))
    return names, (random_cycle(rng, axes, samples, parts, scale),)


def random_cycle(rng: np.random.Generator, axes: int, samples: int, parts: int, scale: float) -> LoadCycle:
    """One cycle: each part has 10 intervals of as many samples; the last part is a pause."""
    intervals, orders = 10, np.array([1.0, 2.0, 5.0])
    each = max(samples // intervals, 2)
    lengths, blocks, sequence = [], [], []
    for part in range(parts):
        pause = part == parts - 1 and parts > 1
        duration = rng.uniform(0.5, 4.0)
        phase = np.linspace(0.0, 2.0 * np.pi, intervals * each, endpoint=False)[:, None]
        angles = rng.uniform(0.0, 2.0 * np.pi, (2, 3, axes))
        size = rng.uniform(0.1, 1.0, (2, 3, axes))
        base = 2.0 * np.pi / duration * orders

        def wave(k: int, derivative: int, base=base, size=size, angles=angles, phase=phase):  # type: ignore[no-untyped-def]
            turned = phase[:, :, None] * orders[:, None] + angles[k] + derivative * np.pi / 2.0
            return (size[k] * base[:, None] ** derivative * np.sin(turned)).sum(axis=1)

        amplitude = rng.uniform(0.05, 0.3, axes)
        inertia = rng.uniform(0.1, 1.0, axes) * scale / 60.0
        speed, acceleration = amplitude * wave(0, 1), amplitude * wave(0, 2)
        torque = 0.5 * scale * wave(1, 0) + inertia * acceleration
        if pause:
            speed, acceleration = np.zeros_like(speed), np.zeros_like(speed)
            torque = np.broadcast_to(torque[:1], torque.shape)
        blocks.append((torque, speed, acceleration, np.broadcast_to(inertia, torque.shape)))
        lengths.append(duration)
        passes = int(rng.integers(1, 4))
        sequence.append((part * intervals, (part + 1) * intervals, passes))
    torque, speed, acceleration, inertia = (np.concatenate(column) for column in zip(*blocks, strict=True))
    n = intervals * each
    weight = np.concatenate([np.full(n, d / n * s[2]) for d, s in zip(lengths, sequence, strict=True)])
    starts = np.cumsum([0.0, *[d * s[2] for d, s in zip(lengths, sequence, strict=True)][:-1]])
    interval = np.repeat(np.arange(parts * intervals), each)
    static = np.abs(torque).max(axis=0) * rng.uniform(0.3, 0.8, (len(torque), axes))
    return LoadCycle(
        name="duty",
        duration=float(weight.sum()),
        time=np.concatenate([start + np.arange(n) * d / n for start, d in zip(starts, lengths, strict=True)]),
        weight=weight,
        interval=interval,
        sequence=tuple(sequence),
        torque=torque,
        static_torque=static,
        speed=speed,
        acceleration=acceleration,
        position=np.zeros_like(torque),
        axial_force=rng.uniform(0.0, 2000.0, torque.shape),
        tilting_moment=rng.uniform(0.0, 100.0, torque.shape),
        inertia=inertia,
    )
