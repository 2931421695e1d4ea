"""`bellcrank.repeated_cycle`: the pause, or the speed, with which a motion can be repeated indefinitely."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank import arguments
from bellcrank.actuators.actuator import Actuator
from bellcrank.dynamics.inverse.mechanism import Mechanism
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.access import Trust
from bellcrank.motion.motion import Motion, join
from bellcrank.motion.motion_entry import DutyStep
from bellcrank.planning.cycle_result import LIMITS, By, Limit, RepeatedCycle
from bellcrank.planning.speed_scaling import scaled_motion
from bellcrank.robot.model.payload import Payload
from bellcrank.sizing.drive_verdicts import pair_of
from bellcrank.sizing.mechanism_sizing import motion_warnings
from bellcrank.sizing.selection.axis_loads_of import axis_loads
from bellcrank.sizing.selection.load_reductions import ReducedCycle, ReducedLoads, reduce_loads
from bellcrank.sizing.selection.motor_criteria import ContinuousTorqueCriterion
from bellcrank.sizing.selection.thermal_criteria import WindingTemperature
from bellcrank.sizing.sizing_subject import sizing_subject

if TYPE_CHECKING:
    from bellcrank.actuators.coupled_transmission import CoupledTransmission
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene

REACHED = 1e-9  # a use may exceed 1 by this
LONGEST_PAUSE = 1e7  # times the motion's time
FACTORS = 60  # speed factors between 1 and SLOWEST at which the uses are looked at
SLOWEST = 1e-3
# What a cycle that repeats asks of motors, by the judge's own criteria: the temperature is that of the periodic state.
CRITERIA = {"rms": ContinuousTorqueCriterion(), "temperature": WindingTemperature()}


@dataclass(frozen=True, eq=False)
class MotorCycle:
    """The motor of one axis over a motion that repeats, with any pause after it.

    Attributes:
        actuator: Motor and gear.
        loads: The loads of the axis along the motion and a pause of 1 s.
    """

    actuator: Actuator
    loads: ReducedLoads

    @property
    def duration(self) -> float:
        """The time of the motion, s."""
        return self.loads.cycles[0].duration - 1.0

    def use(self, limit: Limit, pause: float) -> float | None:
        """The share of a limit that is used where the motion repeats with a pause, s; None where it is unknown."""
        loads = replace(self.loads, cycles=tuple(_with_pause(cycle, pause) for cycle in self.loads.cycles))
        pair, conditions, criterion = pair_of(self.actuator), self.actuator.conditions, CRITERIA[limit]
        if not criterion.applies(pair, loads.axis, conditions)[0]:
            return None
        use = float(criterion.use(pair, loads, conditions)[0])
        return None if np.isnan(use) else use


def _with_pause(cycle: ReducedCycle, pause: float) -> ReducedCycle:
    """A cycle whose last interval, a pause of 1 s, lasts for another time; without it where that is 0."""
    last = cycle.interval == cycle.interval[-1]
    if pause > 0.0:
        weight = np.where(last, pause * cycle.weight, cycle.weight)
        return replace(cycle, weight=weight, duration=cycle.duration - 1.0 + pause)
    return replace(
        cycle,
        duration=cycle.duration - 1.0,
        time=cycle.time[~last],
        weight=cycle.weight[~last],
        interval=cycle.interval[~last],
        sequence=cycle.sequence[:-1],
        features=cycle.features[~last],
        torque=cycle.torque[~last],
        inertia=cycle.inertia[~last],
    )


def motor_cycles(
    mechanism: Mechanism,
    actuators: Mapping[str, Actuator],
    motion: Motion,
    transmissions: Sequence[CoupledTransmission] = (),
) -> dict[str, MotorCycle]:
    """The motors that have an actuator, by the name of the axis: a joint, or the motor of a coupled transmission."""
    if not actuators:
        return {}
    duty = [DutyStep(motion.name), DutyStep(pause=1.0)]
    found = axis_loads(mechanism, [motion], duty, transmissions, drives=actuators)
    loads = reduce_loads(found.axes, found.cycles)
    return {one.axis.name: MotorCycle(actuators[one.axis.name], one) for one in loads if one.axis.name in actuators}


@arguments.named
def repeated_cycle(
    robot: Robot | Scene | str | Path,
    motion: Motion | str | Path,
    *,
    limit: Limit = "rms",
    by: By = "pause",
    actuators: Mapping[str, Actuator] | None = None,
    payloads: Iterable[Payload] = (),
    overrides: Mapping[str, Any] | None = None,
    trust: Trust = (),
) -> RepeatedCycle:
    """Find the shortest pause after a motion, or its highest speed, with which it can be repeated indefinitely.

    The uses are those of the judge (`bellcrank.judge`). With a pause, the posture at the end of the motion is held; the
    pause is a bracketed root of the use. A lower speed scales the whole motion in time, and the factor is the root that
    is nearest to 1. Neither is the shortest of all cycles: a motion that saves torque where it costs little time can be
    shorter.

    Args:
        robot: As in `bellcrank.size`: a Robot, a Scene, or the path or name of one.
        motion: A Motion, such as that of `time_optimal`, the name of a motion of the configuration, or a CSV file.
        limit: "rms": the RMS shaft torque stays within the continuous torque at the mean speed, with the safety factor,
            as in `bellcrank.size`. "temperature": the winding stays within its permitted temperature in the periodic
            state of the two-body thermal model; for motors of a catalogue.
        by: "pause" or "speed".
        actuators: Motor and gear by joint; by default those of the configuration.
        payloads: Payloads besides those that the robot carries.
        overrides: Values of a scene, configuration or URDF to change, by dotted path.
        trust: Folders whose files a configuration or URDF may name.

    Returns:
        The cycle.

    Raises:
        InputError: An argument is wrong, or no motor's limit is known.
        BellcrankError: No pause is long enough, or no speed low enough.

    Example:
        >>> import bellcrank as bc
        >>> fastest = bc.time_optimal("geared_pendulum", "lift_and_return", costs=False)
        >>> cycle = bc.repeated_cycle("geared_pendulum", fastest.motion)
        >>> verdict = bc.judge("geared_pendulum", [cycle.motion]).of("shoulder")
        >>> abs(verdict.margins["continuous torque"]) < 1e-6
        True
    """
    arguments.one_of("limit", limit, tuple(LIMITS))
    arguments.one_of("by", by, ("pause", "speed"))
    kinds = "a Motion, the name of a motion, or the path of a CSV file"
    arguments.instance("motion", motion, (Motion, str, Path), kinds)
    if actuators is not None:
        for name, one in arguments.mapping("actuators", actuators, "a mapping of joint names to Actuators").items():
            arguments.instance(f'actuators["{name:.80}"]', one, Actuator, "an Actuator")
    subject = sizing_subject(robot, [motion], payloads, trust, actuators, overrides, "motion")
    transmissions = subject.transmissions
    mechanism, given = subject.mechanism, subject.motions[0]
    if given.duration <= 0.0:
        raise InputError(f"motion '{given.name}' takes no time; there is nothing to repeat")

    def cycles_at(factor: float) -> dict[str, MotorCycle]:
        motion = scaled_motion(given, factor) if factor != 1.0 else given
        return motor_cycles(mechanism, subject.actuators, motion, transmissions)

    cycles = cycles_at(1.0)
    uses, unknown = _uses(cycles, limit, 0.0)
    if not uses:
        raise InputError(_nothing_known(limit, subject.actuators))
    pause, factor, joint, final = 0.0, 1.0, "", uses
    if max(uses.values()) > 1.0 + REACHED and by == "pause":
        pause, joint = _pause({name: cycles[name] for name in uses}, limit)
        final, _ = _uses(cycles, limit, pause)
        _check_bearable(final, limit)
    elif max(uses.values()) > 1.0 + REACHED:
        factor, joint, final = _factor(lambda k: _uses(cycles_at(k), limit, 0.0)[0], limit)
    name = mechanism.robot.name if subject.config is None else subject.config.name
    return RepeatedCycle(
        robot=name,
        motion=_whole(given, factor, pause),
        original_duration=given.duration,
        limit=limit,
        by=by,
        pause=pause,
        factor=factor,
        joint=joint,
        original_uses=uses,
        uses=final,
        warnings=(*subject.notes, *_warnings(given, mechanism, transmissions, {*uses}, unknown, limit)),
    )


def _uses(cycles: Mapping[str, MotorCycle], limit: Limit, pause: float) -> tuple[dict[str, float], list[str]]:
    """The known uses by joint, and the joints of unknown ones."""
    found = {name: cycle.use(limit, pause) for name, cycle in cycles.items()}
    return {n: use for n, use in found.items() if use is not None}, [n for n, use in found.items() if use is None]


def _pause(cycles: Mapping[str, MotorCycle], limit: Limit) -> tuple[float, str]:
    """The shortest pause that all motors need, s, and the joint of the motor that needs it."""
    needed = {name: _pause_of(name, cycle, limit) for name, cycle in cycles.items()}
    joint = max(needed, key=lambda name: needed[name])
    return needed[joint], joint


def _pause_of(name: str, cycle: MotorCycle, limit: Limit) -> float:
    from scipy.optimize import brentq

    def over(pause: float) -> float:
        use = cycle.use(limit, pause)
        if use is None:
            raise InputError(
                f"the {LIMITS[limit]} of the motor at joint '{name}' is known without a pause, but not with one of "
                f"{pause:.4g} s: its limit at low mean speed is unknown"
            )
        return min(use, 1e3) - 1.0  # finite on thermal runaway too

    if over(0.0) <= REACHED:
        return 0.0
    high, longest = cycle.duration, LONGEST_PAUSE * cycle.duration
    while over(high) > 0.0:
        high *= 4.0
        if high > longest:
            raise BellcrankError(
                f"no pause is long enough: to hold the last posture takes {100.0 * (over(high) + 1.0):.4g} % of the "
                f"{LIMITS[limit]} of the motor at joint '{name}'; end the motion in another posture, or choose a "
                "larger motor"
            )
    return float(brentq(over, 0.0, high, xtol=1e-12 * high, rtol=1e-14))


def _check_bearable(uses: Mapping[str, float], limit: Limit) -> None:
    worst = max(uses, key=lambda name: uses[name])
    if uses[worst] > 1.0 + 1e3 * REACHED:
        raise BellcrankError(
            f"no pause suffices for all motors: with the one that the others need, holding the last posture takes "
            f"{100.0 * uses[worst]:.4g} % of the {LIMITS[limit]} of the motor at joint '{worst}'; end the motion in "
            "another posture, or choose a larger motor"
        )


def _factor(uses: Callable[[float], dict[str, float]], limit: Limit) -> tuple[float, str, dict[str, float]]:
    """The largest speed factor below 1 at which no use exceeds 1, its joint, and the uses."""
    from scipy.optimize import brentq

    def over(factor: float) -> float:
        return min(max(uses(factor).values()), 1e3) - 1.0

    high = 1.0
    for low in np.geomspace(1.0, SLOWEST, FACTORS)[1:].tolist():
        if over(low) <= 0.0:
            root = float(brentq(over, low, high, xtol=1e-13, rtol=1e-13))
            found = uses(root)
            return root, max(found, key=lambda name: found[name]), found
        high = low
    found = uses(high)
    worst = max(found, key=lambda name: found[name])
    raise BellcrankError(
        f"no speed is low enough: at a thousandth of the speed the motion takes {100.0 * found[worst]:.4g} % of the "
        f"{LIMITS[limit]} of the motor at joint '{worst}', mostly to hold postures; choose a larger motor"
    )


def _whole(motion: Motion, factor: float, pause: float) -> Motion:
    if factor != 1.0:
        return scaled_motion(motion, factor)
    if pause == 0.0:
        return motion
    still = np.zeros((2, motion.nv))
    rest = Motion(
        motion.joints, np.array([0.0, pause]), np.repeat(motion.position[-1:], 2, axis=0), still, still, "pause"
    )
    return join(motion, rest, name=f"{motion.name} and pause")


def _nothing_known(limit: Limit, actuators: Mapping[str, Actuator]) -> str:
    if not actuators:
        return "no joint has an actuator; give actuators, or a configuration with some"
    if limit == "temperature":
        return (
            "no motor's temperature is known: actuators need motors of a catalogue with resistance, torque constant, "
            "thermal resistances and time constants, and the largest winding temperature"
        )
    return "no motor's continuous torque is known: give rated_torque"


def _warnings(
    motion: Motion,
    mechanism: Mechanism,
    transmissions: Sequence[CoupledTransmission],
    known: set[str],
    unknown: list[str],
    limit: Limit,
) -> tuple[str, ...]:
    found = motion_warnings(mechanism, [motion])
    moved = {joint for one in transmissions for joint in one.joints}
    axes = [joint.name for joint in mechanism.motors if joint.name not in moved]
    axes += [motor for one in transmissions for motor in one.motors]
    missing = [name for name in axes if name not in known and name not in unknown]
    if unknown:
        found.append(f"the limit of the {LIMITS[limit]} is unknown of the motors at {', '.join(unknown)}: left out")
    if missing:
        found.append(f"no motor, or not enough of it, is known at {', '.join(missing)}: left out")
    gap = float(np.max(np.abs(motion.position[-1] - motion.position[0])))
    if gap > 1e-6:
        found.append(f"the motion ends {gap:.3g} rad or m from where it starts; the way back is not part of the cycle")
    return tuple(dict.fromkeys(found))
