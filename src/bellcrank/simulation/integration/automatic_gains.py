"""Gains that are found automatically: those of Baumgarte's stabilisation, and of servos with `gains: auto`.

Baumgarte's gains are α = β = 2 ω, where ω is the rate of the motion. They depend on the motion, not on solver, step
size and tolerance.

**Derivation.** With Baumgarte's terms a constraint obeys φ̈ + 2 α φ̇ + β² φ = the perturbation by the solver. α = β is
critical damping: of all gains with the same decay time, these have the smallest fast rate, which determines the cost.
Let each step of h seconds add d_φ h to φ and d_v h to φ̇. Then φ settles where perturbation and decay balance:

    φ = (2 α d_φ + d_v) / β²,    or  2 d_φ/α + d_v/α²  for α = β.                                                 (1)

If d did not depend on α, a larger α would always be better. It does. Along the normal of the constraints the exact
motion is some g(t), and the equations have the form of Prothero and Robinson, n̈ = g̈ − 2 α (ṅ − ġ) − α² (n − g). The
stages of an explicit method of order p approximate g to a low order only (the first ones to h), the gains feed this
back, and the order conditions leave of it

    d h = h^(p+1) Σ_j c_j α^j g^(p+1−j),  j = 0 … p − 1:   the method's error without gains, times Σ_j c_j (α/ω)^j,  (2)

for a motion of rate ω, |g^(k)| ~ ω^k. So gains begin to degrade the solution where α exceeds ω. This is a property of
the motion: the step size at which α h reaches 1, or the limit of stability (2.8 for RK4), does not matter. In detail:

- *Fixed step.* Below ω, (1) falls as h^p/α; above it, it grows as h^p α^(p−2). It is smallest near ω, at full order.
  A fixed α h, as is often recommended, makes it (α h)^(p−2) h²: constraints and motion then converge with order 2 only.
  Gains must not follow the step size.
- *Embedded error estimate* of order e. The controller keeps the estimate of (2) at the tolerance, at the cost of
  smaller steps: below ω none; above it h ∝ α^(−(e−1)/(e+1)), so the work grows as α^0.6 (RK45) or α^0.75 (DOP853), and
  as α once stability limits the step. As d h stays near the tolerance, φ ≤ tol (2/α + 1/α²)/h (`drift_bound`) hardly
  falls above ω. A smaller tolerance reduces h and d together: the transition stays where it is.
- *Radau* damps the fast part itself: its transition lies about ten times higher, and the same gains can be used.

**Finding ω.** A controller that keeps C (ω h)^(e+1) = tol makes steps from which ω follows. A pilot run (DOP853 at
1e-3, projected onto the constraints) has N steps in T seconds, and ω = tol^(1/8) N/T. On the rolling disk, pilot runs
of RK45 and DOP853 from 1e-2 to 1e-8 agree within a factor of 1.6; on the four-bar, which takes 3 to 30 steps, within 3;
on Bricard's linkage, whose motion RK45 at 1e-3 does not follow, those of DOP853 within 3 and those of RK45 within 5. C
is part of the factor 2, which was measured (`bellcrank bench --gains`): on the four-bar, the disk and Bricard's
linkage, with RK45 and DOP853 from 1e-6 to 1e-12, automatic gains took at most 1.35 times the evaluations of a run
without stabilisation (with the pilot run 1.70), and φ at the ends of steps stayed below 3.3 tol. From 3 ω on, more than
twice the evaluations were needed (Bricard's linkage).

**When to use gains.** Projection is better, and the default: φ and φ̇ are at rounding error, between steps too, with the
evaluations of a run without stabilisation, and without a pilot run. With automatic gains φ is proportional to the
tolerance, the motion is hardly better than without stabilisation, and between steps φ is that of the dense output (on
the four-bar up to 20 tol), which no gain can reduce. Gains are for equations that must remain a plain ẋ = f(t, x) whose
state nothing else changes: for another solver, or for a model in a controller.

Other reasons for short steps of the pilot run (signals that jump, a stiff scene) make ω and the gains too large, never
too small: such a run satisfies the constraints as well and costs more.

Sources: J. Baumgarte, Comput. Methods Appl. Mech. Eng. 1 (1972) 1; A. Prothero and A. Robinson, Math. Comp. 28 (1974)
145; E. Hairer and G. Wanner, Solving ODEs II (1996), IV.2 and IV.15; U. Ascher, H. Chin, L. Petzold and S. Reich, Mech.
Struct. Mach. 23 (1995) 135. (1) and (2) follow from these as shown; tests/simulation/test_baumgarte_gains.py checks the
statements.

**Gains of servos.** With the small time constant T_σ of the innermost loop, half a sample time and the delay, and the
inertia J of rotor and load at the rotor in the posture at the start,

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
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.cached_values import computed_once
from bellcrank.dynamics.equations.system import system_parameters
from bellcrank.dynamics.inverse.drive_loops import DriveEquations, DriveLoop, refuse_nonlinear, smooth_scene
from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.elements.controller import Controller
from bellcrank.elements.drives import Drive
from bellcrank.elements.parameters import Parameter
from bellcrank.errors import InputError
from bellcrank.scene.output_quantities import ForceOutput, WorkOutput
from bellcrank.scene.outputs import Output
from bellcrank.scene.settings import Settings, Stabilisation
from bellcrank.simulation.integration.integration import RunRows, prepared_integration
from bellcrank.simulation.integration.statistics import Status

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene
    from bellcrank.simulation.trajectory.trajectory import Trajectory


PER_RATE = 2.0  # α in units of ω, as the pilot run gives it
PILOT_TOLERANCE = 1e-3  # of the larger of rtol and atol
PILOT_ORDER = 8  # DOP853's error estimate falls with this power of the step size
PILOT_EVALUATIONS = 20_000  # a longer run is judged by its beginning
LARGEST_DECAY = 1.0  # α h of a fixed step: stable with a margin, where a step is too coarse for the motion
GAIN_MARGIN, PHASE_MARGIN = 2.0, math.radians(30.0)
SLOWER = 1.25  # T is raised by this factor
MOST_STEPS = 40


@dataclass(frozen=True)
class AutomaticGains:
    """Baumgarte gains that a pilot run gives.

    Attributes:
        alpha: 1/s.
        beta: 1/s.
        rate: The rate ω of the motion, 1/s.
        evaluations: Evaluations of the equations that the pilot run took.
    """

    alpha: float
    beta: float
    rate: float
    evaluations: int

    @property
    def stabilisation(self) -> Stabilisation:
        """The same as a setting."""
        return Stabilisation("baumgarte", self.alpha, self.beta)


def automatic_gains(scene: Scene, settings: Settings | None = None) -> AutomaticGains:
    """Baumgarte gains for a run of a scene with its own settings, or others, by a pilot run.

    The pilot run is cheap beside most runs: its tolerance is 1e-3, and it ends after 20,000 evaluations. Raises
    InputError for a scene without constraints.
    """
    settings = settings or scene.settings
    if not scene.constraints:
        raise InputError(
            f"{scene.source}: this scene has no constraints, so there is nothing to stabilise; remove stabilisation"
        )
    pilot = pilot_settings(settings)
    scene = replace(scene, settings=pilot)
    times = np.linspace(0.0, pilot.duration, pilot.samples)
    run = prepared_integration(scene, pilot, system_parameters(scene), RunRows(times), projected=True).run()
    if run.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    return gains_from(run, settings)


def pilot_settings(settings: Settings) -> Settings:
    """The settings of the pilot run for a run with these settings."""
    coarser = max(1.0, PILOT_TOLERANCE / max(settings.rtol, settings.atol))
    return replace(
        settings,
        solver="DOP853",
        rtol=coarser * settings.rtol,
        atol=coarser * settings.atol,
        step=None,
        first_step=None,
        max_step=None,
        samples=2,
        max_evaluations=PILOT_EVALUATIONS,
        stabilisation=Stabilisation("projection"),
    )


def gains_from(pilot: Trajectory, settings: Settings) -> AutomaticGains:
    """The gains that a pilot run gives for a run with these settings."""
    end, statistics = float(pilot.time[-1]), pilot.statistics
    steps = max(statistics.steps, 1) / (end if end > 0.0 else settings.duration)
    rate = float(max(pilot.settings.rtol, pilot.settings.atol) ** (1.0 / PILOT_ORDER) * steps)
    gain = PER_RATE * rate
    if settings.step is not None and settings.solver != "Radau":  # "auto" takes DOP853 then
        gain = min(gain, LARGEST_DECAY / settings.step)
    return AutomaticGains(gain, gain, rate, statistics.evaluations)


def drift_bound(alpha: float, beta: float, tolerance: float, step: float) -> float:
    """The bound on |φ| (m or rad) that gains (1/s) give: equation (1) of this module.

    `tolerance` (m or rad, and their rates) bounds the error of a step of `step` s. Runs stay well below it, since the
    error of a step is smaller than its estimate.
    """
    return tolerance / step * (2.0 * alpha + 1.0) / beta**2


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
