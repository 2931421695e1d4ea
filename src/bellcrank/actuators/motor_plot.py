"""The torque-speed plane of one motor: continuous torque, short-time limits and the voltage line."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.continuous_torque import SOURCES, continuous_torque
from bellcrank.actuators.electrical import friction_torque
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.product_arrays import MotorArrays
from bellcrank.actuators.short_time_limits import peak_curves, short_time_limits, voltage_limit_source
from bellcrank.arrays import Array
from bellcrank.config.units import RPM
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.present.plot_style import literal, new_figure, plain, write_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

POINTS = 401
_CONTINUOUS, _SHORT, _VOLTAGE, _LIMIT = "#009E73", "#0072B2", "#D55E00", "#5a5a5a"


def write_motor_plot(motor: Motor, path: Path, conditions: Conditions) -> Path:
    """Write `motor_figure` as PNG, PDF or SVG, by the suffix of the path (PNG without one); returns the path."""
    kind = path.suffix.lower().removeprefix(".") or "png"
    if kind not in ("png", "pdf", "svg"):
        raise InputError(f"--out {path}: {unknown_name('picture format', path.suffix, ('.png', '.pdf', '.svg'))}")
    write_figure(motor_figure(motor, conditions), path)
    return path


def motor_figure(motor: Motor, conditions: Conditions) -> Figure:
    """The torque-speed plane of a motor, with what is known of its limits; what is not known is said below.

    Args:
        motor: The motor.
        conditions: Bus voltage, reserve, ambient temperature and altitude.

    Returns:
        A figure: torque (N m) over speed (rpm) at the shaft, or at the output of an actuator.
    """
    with np.errstate(all="ignore"):  # numbers of a catalogue may overflow
        return _figure(motor, conditions)


def _figure(motor: Motor, conditions: Conditions) -> Figure:
    figure = new_figure(8.5, 5.2)
    axis = figure.add_subplot()
    plain(axis)
    motors = MotorArrays.of([motor])
    fastest = _fastest(motor, motors, conditions)
    speed = np.union1d(np.linspace(0.0, fastest, POINTS), motor.nominal_speed or 0.0)
    unknown: list[str] = []
    continuous = _draw_continuous(axis, motors, conditions, speed, unknown)
    limits = [*_draw_short_time(axis, motors, conditions, speed, unknown)]
    limits.append(_draw_voltage_line(axis, motor, motors, conditions, speed, unknown))
    usable = np.fmin.reduce([continuous, *limits])
    usable = np.where(np.isnan(continuous) | (speed > (motor.max_speed or math.inf)), np.nan, np.maximum(usable, 0.0))
    axis.fill_between(speed * RPM, usable, color=_CONTINUOUS, alpha=0.15, linewidth=0.0)
    if motor.nominal_torque is not None and motor.nominal_speed is not None:
        axis.plot([motor.nominal_speed * RPM], [motor.nominal_torque], "o", color="#1a1a1a", label="nominal point")
    heights = [motor.nominal_torque, motor.peak_torque, *(np.nanmax(one, initial=0.0) for one in limits[:-1])]
    heights.append(np.nanmax(continuous, initial=0.0))
    top = max([float(one) for one in heights if one], default=motor.stall_torque or 1.0)
    axis.set_ylim(0.0, 1.4 * top)  # room for the legend
    axis.set_xlim(0.0, fastest * RPM)
    place = "at the output" if motor.kind == "actuator" else "at the shaft"
    axis.set_xlabel(f"speed {place} [rpm]")
    axis.set_ylabel(f"torque {place} [N m]")
    title = f"{motor.maker} {motor.model} ({motor.id}), {_voltage(motor, conditions)}"
    axis.set_title(literal(title, 85), fontsize="medium", loc="left")
    if axis.get_legend_handles_labels()[0]:
        axis.legend(loc="upper right", fontsize="small")
    else:
        axis.text(0.5, 0.5, "no limit is stated", transform=axis.transAxes, ha="center")
        axis.set(xticks=[], yticks=[])
    if unknown:
        figure.supxlabel(literal(f"Not known: {', '.join(unknown)}.", 110), fontsize="small")
    return figure


def _voltage(motor: Motor, conditions: Conditions) -> str:
    voltage = motor.nominal_voltage if conditions.voltage is None else conditions.voltage
    return "no voltage known" if voltage is None else f"{voltage:g} V less {conditions.voltage_reserve:.0%} reserve"


def _fastest(motor: Motor, motors: MotorArrays, conditions: Conditions) -> float:
    """The speed where the picture ends, rad/s: beyond every speed that is stated, and where the voltage line ends."""
    curves = [curve[-1][0] for curve in (motor.continuous_curve, motor.peak_curve) if curve]
    speeds = [motor.max_speed, motor.no_load_speed, motor.nominal_speed, *curves]
    stated = [one for one in speeds if one]
    line = _line_end(motors, conditions)
    if stated and line is not None and line > 3.0 * max(stated):
        line = None  # a bus far above the nominal voltage: the picture shows what the motor may do
    ends = [*stated, *([line] if line is not None else [])]
    return 1.05 * max(ends, default=100.0)


def _line_end(motors: MotorArrays, conditions: Conditions) -> float | None:
    """The speed at which the voltage limit leaves no electrical torque, rad/s."""
    slopes = [float(one.speed[0]) for one in short_time_limits(motors, conditions) if one.name == "voltage limit"]
    known = [slope for slope in slopes if math.isfinite(slope) and slope > 0.0]
    return 1.0 / known[0] if known else None


def _draw_continuous(
    axis: Axes, motors: MotorArrays, conditions: Conditions, speed: Array, unknown: list[str]
) -> Array:
    """The continuous torque (n,) over speed, NaN where it is unknown."""
    found = continuous_torque(motors[:, None], speed[None, :], conditions)
    torque, source = np.asarray(found.torque[0]), found.source[0]
    known = np.isfinite(torque)
    if not known.any():
        unknown.append("continuous torque")
        return torque
    label = "continuous (S1): " + ", ".join(dict.fromkeys(SOURCES[k] for k in source[known]))
    axis.plot(speed * RPM, torque, color=_CONTINUOUS, linewidth=2.0, label=label)
    if not known.all():
        last = speed[known].max() * RPM
        unknown.append(f"continuous torque above {last:.4g} rpm" if last else "continuous torque but at standstill")
    return torque


def _draw_short_time(
    axis: Axes, motors: MotorArrays, conditions: Conditions, speed: Array, unknown: list[str]
) -> list[Array]:
    """The limits of short-time operation; returns those of the torque (n,)."""
    limits = {(one.name, one.basis): one for one in short_time_limits(motors, conditions)}
    peak = float(1.0 / limits["peak torque", "shaft"].torque[0])
    current = float(1.0 / limits["peak current", "electrical"].torque[0])
    drawn = []
    if math.isfinite(peak):
        time = float(motors.peak_time[0])
        how_long = f", for {time:g} s" if math.isfinite(time) else ", time not stated"
        drawn.append(np.full_like(speed, peak))
        axis.plot(speed * RPM, drawn[-1], color=_SHORT, linewidth=1.6, label=f"peak torque {peak:.4g} N m{how_long}")
    elif math.isfinite(current):
        drawn.append(current - _friction(motors, speed))
        axis.plot(speed * RPM, drawn[-1], color=_SHORT, linewidth=1.6, label="torque of the peak current")
    else:
        unknown.append("peak torque")
    curves = peak_curves(motors, conditions)
    if curves.known[0]:
        axis.plot(curves.x[0] * RPM, curves.y[0], color=_SHORT, dashes=(5, 2), label="short-time curve of the maker")
        drawn.append(curves.at(speed, beyond=0.0))
    fastest = float(motors.max_speed[0])
    if math.isfinite(fastest):
        label = f"largest speed {fastest * RPM:.5g} rpm"
        axis.axvline(fastest * RPM, color=_LIMIT, linewidth=1.4, dashes=(2, 2), label=label)
    else:
        unknown.append("largest speed")
    return drawn


def _draw_voltage_line(
    axis: Axes, motor: Motor, motors: MotorArrays, conditions: Conditions, speed: Array, unknown: list[str]
) -> Array:
    """The torque (n,) that the voltage leaves: T = (1 - b ω) / a, less friction where it is electrical; else NaN."""
    for limit in short_time_limits(motors, conditions):
        if limit.name != "voltage limit" or not math.isfinite(float(limit.torque[0])):
            continue
        torque = (1.0 - limit.speed[0] * speed) / limit.torque[0]
        if limit.basis == "electrical":
            torque = torque - _friction(motors, speed)
        label = f"voltage: {voltage_limit_source(motor)}"
        axis.plot(speed * RPM, torque, color=_VOLTAGE, linewidth=1.6, label=label)
        return np.asarray(torque)
    unknown.append("voltage line")
    return np.full_like(speed, np.nan)


def _friction(motors: MotorArrays, speed: Array) -> Array:
    """Friction torque (n,) over speed; 0 where it is unknown."""
    return np.nan_to_num(friction_torque(motors, speed))
