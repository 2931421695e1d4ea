"""Gains of servos that are to be found automatically (`gains: auto`).

With the small time constant T_σ of the innermost loop, half a sample time and the delay, and the inertia J of rotor and
load at the rotor in the posture at the start,

    current: kp = L/(2 T_σ), ki = R/(2 T_σ)          the absolute optimum; of a phase for model dq
    speed:   kp = J/(2 T), ti = 4 T                  the symmetric optimum with a = 2
    position: kp = 1/(8 T)                           the absolute optimum of an integrator with the lag 4 T

where T is what delays the torque: 2 T_σ of the current loop, and half a sample of the speed loop, a whole one where an
encoder with a resolution gives the speed. T is raised until the sampled loops with their elastic gears are stable with
twice the gain and with a lag of 30° (drive_loops.py). Sources: C. Kessler, Das symmetrische Optimum, Regelungstechnik 6
(1958); D. Schröder, Elektrische Antriebe – Regelung von Antriebssystemen (2015), ch. 3 and 8.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.cached_values import computed_once
from bellcrank.dynamics.inverse.drive_loops import DriveEquations, DriveLoop, refuse_nonlinear, smooth_scene
from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.elements.controller import Controller
from bellcrank.elements.drives import Drive
from bellcrank.elements.parameters import Parameter
from bellcrank.errors import InputError
from bellcrank.scene.output_quantities import ForceOutput, WorkOutput
from bellcrank.scene.outputs import Output

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene

GAIN_MARGIN, PHASE_MARGIN = 2.0, math.radians(30.0)
SLOWER = 1.25  # T is raised by this factor
MOST_STEPS = 40


@computed_once
def tuned(scene: Scene) -> Scene:
    """The scene with the gains of its servos found where they are to be. Raises InputError where there are none."""
    wanted = [drive for drive in scene.drives if drive.cascade is not None and drive.cascade.gains == "auto"]
    if not wanted:
        return scene
    refuse_nonlinear(scene)
    places = [f"control.{d.name}.servo.{loop}.{key}" for d in wanted for loop, key in _gains_of(d)]
    own = {f"gain {k}": Parameter(f"gain {k}", 1.0, "", (place,), ()) for k, place in enumerate(places)}
    bare = replace(smooth_scene(scene), parameters={**scene.parameters, **own})
    position = consistent_start(scene)[0]
    equations = DriveEquations(bare, np.zeros(1), position)
    inertia = {d.name: equations.inertia_at_rotor(d) for d in wanted}
    slow = dict.fromkeys(inertia, 1.0)
    for _ in range(MOST_STEPS):
        found = {d.name: _rules(d, inertia[d.name], slow[d.name]) for d in wanted}
        values = [found[d.name][loop][key] for d in wanted for loop, key in _gains_of(d)]
        equations.take(np.concatenate([scene.own_parameters, values]))
        short = [d.name for d in wanted if not _has_margins(equations, d)]
        if not short:
            control = tuple(_with_gains(part, found) for part in scene.control)
            return replace(scene, control=control, outputs=_of_the_same(scene, control))
        for name in short:
            slow[name] *= SLOWER
    raise InputError(
        f"{scene.source}: gains: auto finds no gains of {', '.join(short)} with margins of 6 dB and 30°; give gains, "
        "a stiffer gear, or shorter sample times"
    )


def _gains_of(drive: Drive) -> list[tuple[str, str]]:
    servo = drive.cascade
    assert servo is not None
    return [(loop, key) for loop in ("position", "speed", "current") for key in getattr(servo, loop)]


def _rules(drive: Drive, inertia: float, slow: float) -> dict[str, dict[str, float]]:
    """The gains of a drive by loop and key, with T `slow` times its least value."""
    servo = drive.cascade
    assert servo is not None
    samples, delay = servo.samples, servo.delay
    measuring = 1.0 if servo.resolution else 0.5
    current: dict[str, float] = {}
    if drive.model == "torque":
        lag = measuring * samples["speed"] + delay
    else:
        small = 0.5 * samples["current"] + delay
        resistance, inductance = drive.circuit["resistance"], drive.circuit["inductance"]
        current = {"kp": inductance / (2.0 * small), "ki": resistance / (2.0 * small)}
        lag = 2.0 * small + measuring * samples["speed"]
    lag *= slow
    return {
        "position": {"kp": 1.0 / (8.0 * lag)},
        "speed": {"kp": inertia / (2.0 * lag), "ti": 4.0 * lag},
        "current": current,
    }


def _has_margins(equations: DriveEquations, drive: Drive) -> bool:
    loop = DriveLoop(equations, drive.name)
    factors = [1.0, 0.5 * (1.0 + GAIN_MARGIN), GAIN_MARGIN]
    return all(loop.stable(factor) for factor in factors) and all(
        loop.stable(complex(np.exp(-1j * share * PHASE_MARGIN))) for share in (0.5, 1.0)
    )


def _of_the_same(scene: Scene, control: tuple[Controller, ...]) -> dict[str, Output]:
    """The outputs, those of drives of the drives with gains."""
    found, drives = dict(scene.outputs), {part.name: part for part in control}
    for name, output in scene.outputs.items():
        quantity = output.quantity
        if isinstance(quantity, ForceOutput) and isinstance(quantity.force, Drive):
            found[name] = Output(name, replace(quantity, force=drives[quantity.force.name]))
        if isinstance(quantity, WorkOutput):
            parts = tuple(drives.get(part.name, part) for part in quantity.parts)
            found[name] = Output(name, replace(quantity, parts=parts))
    return found


def _with_gains(part: Controller, found: dict[str, dict[str, dict[str, float]]]) -> Controller:
    if not isinstance(part, Drive) or part.cascade is None or part.name not in found:
        return part
    gains = found[part.name]
    servo = replace(
        part.cascade, gains="found", position=gains["position"], speed=gains["speed"], current=gains["current"]
    )
    return replace(part, servo=servo)
