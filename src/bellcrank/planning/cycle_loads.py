"""What a cycle that repeats asks of motors for ever, by the judge's own criteria: continuous torque, or the winding's
temperature in the periodic state. A pause at the end of the motion holds its last posture.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.actuators.actuator import Actuator
from bellcrank.motion.duty_program import DutyStep
from bellcrank.motion.motion import Motion
from bellcrank.planning.cycle_result import Limit
from bellcrank.sizing.drive_verdicts import pair_of
from bellcrank.sizing.selection.axis_loads_of import axis_loads
from bellcrank.sizing.selection.load_reductions import ReducedCycle, ReducedLoads, reduce_loads
from bellcrank.sizing.selection.motor_criteria import ContinuousTorqueCriterion
from bellcrank.sizing.selection.thermal_criteria import WindingTemperature

if TYPE_CHECKING:
    from bellcrank.actuators.coupled_transmission import CoupledTransmission
    from bellcrank.dynamics.mechanism import Mechanism

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
        pair, conditions, criterion = pair_of(self.actuator), self.actuator.judged_under, CRITERIA[limit]
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
