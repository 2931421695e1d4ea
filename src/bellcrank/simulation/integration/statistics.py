"""Why a run ended, what it cost, and which events may have been missed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.arrays import Array

if TYPE_CHECKING:
    from bellcrank._step import StepBlock, StepResult
    from bellcrank.scene.scene import Scene


class Status(StrEnum):
    """Why a run ended; first the integrator's statuses, in the order of its numbers (cpp/integrator/problem.hpp)."""

    FINISHED = "finished"
    EVENT = "event"
    STEP_TOO_SMALL = "step_too_small"
    NON_FINITE = "non_finite"
    EVALUATIONS_SPENT = "evaluations_spent"
    INTERRUPTED = "interrupted"
    CHATTERING = "chattering"
    CONTACT = "contact"
    # not the integrator's
    PRESCRIBED_MOTION_ENDED = "prescribed_motion_ended"
    TURNED_OVER = "turned_over"

    @property
    def success(self) -> bool:
        """Whether the run reached its duration, or an event, a stop or a brake with `stop: true`."""
        return self in (Status.FINISHED, Status.EVENT, Status.CONTACT)

    @property
    def advice(self) -> str:
        """What happened and what to try, as a clause."""
        return _ADVICE[self]


_ADVICE = {
    Status.FINISHED: "the whole duration was simulated",
    Status.EVENT: "an event with stop: true ended the run",
    Status.CONTACT: "a joint met its stop, or a brake brought it to rest, and `stop: true` ends the run there",
    Status.STEP_TOO_SMALL: "the step size fell below the resolution of time; the scene is stiff (try solver auto), a "
    "force jumps, or the mechanism is close to a singular configuration there",
    Status.NON_FINITE: "the accelerations are no longer finite; check the configuration and the forces there, and for "
    "a fixed step try a smaller one",
    Status.EVALUATIONS_SPENT: "the limit of evaluations is reached; raise max_evaluations, loosen the tolerances, or "
    "take solver auto or Radau if the scene is stiff",
    Status.CHATTERING: "a force switches back and forth without end there: its sign, step or `active` jumps against "
    "the motion; smooth it, such as sign(v) by v / sqrt(v**2 + width**2), sample it (sample_time), or give "
    "the joint dry_friction (joints), or the force kind friction; or a prescribed motion moves a joint beyond its stop",
    Status.PRESCRIBED_MOTION_ENDED: "a prescribed motion ends, or its velocity jumps, while the joint moves; extend "
    "the motion or shorten the run",
    Status.TURNED_OVER: "a weld or hinge is turned by more than a quarter turn: its equations also hold at half a "
    "turn, so its links have passed through each other; take smaller tolerances or steps, and check the forces on that "
    "constraint",
    Status.INTERRUPTED: "the simulation was interrupted; the results up to that time are kept",
}


@dataclass(frozen=True)
class Unresolved:
    """An event of which crossings may have been missed.

    Attributes:
        event: The event's name.
        steps: In how many steps of the solver.
        first: When first, s.
        undefined: Its function is not a number there; otherwise it oscillates too fast.
    """

    event: str
    steps: int
    first: float
    undefined: bool = False


@dataclass(frozen=True, kw_only=True)
class Statistics:
    """What the solver did.

    Attributes:
        steps: Accepted steps.
        rejected: Rejected steps.
        evaluations: Evaluations of the right-hand side.
        jacobians: Evaluations of its Jacobian.
        factorisations: LU factorisations.
        kernel_time: Time in the integrator alone, s.
        unresolved: Events of which crossings may have been missed.
        stiff_steps: Steps of an explicit method that stiffness held short.
        stiff_since: When the first of them began, s; None: there is none.
        implicit_steps: How many of the steps are those of an implicit method.
        implicit_evaluations: How many of the evaluations are.
        switches: How often solver "auto" changed between DOP853 and Radau.
        switch_times: When, s: first to Radau, then back, and so on; at most 1000.
        longest_step: The longest step, s; None where it is not known.
        omitted_events: How many events of a name happened that the run does not keep: of more than 100,000 events, each
            name keeps at least its first 100 and its last.
    """

    steps: int
    rejected: int
    evaluations: int
    jacobians: int
    factorisations: int
    kernel_time: float
    stiff_steps: int = 0
    stiff_since: float | None = None
    implicit_steps: int = 0
    implicit_evaluations: int = 0
    switches: int = 0
    switch_times: tuple[float, ...] = ()
    unresolved: tuple[Unresolved, ...] = ()
    longest_step: float | None = None
    omitted_events: Mapping[str, int] = field(default_factory=dict)


def statistics_of(scene: Scene, found: StepResult | StepBlock, kept: NDArray[np.int32] | None) -> Statistics:
    """Statistics from what the integrator found so far.

    `kept` are the event functions of the events that are kept; None: all are, and no crossing may have been missed.
    """
    unresolved: tuple[Unresolved, ...] = ()
    omitted: dict[str, int] = {}
    if kept is not None and scene.events:
        unresolved = (
            *_unresolved(scene, found.unresolved_count, found.unresolved_time),
            *_unresolved(scene, found.undefined_count, found.undefined_time, undefined=True),
        )
        omitted = _omitted(scene, found.event_counts, kept)
    return Statistics(
        steps=found.accepted,
        rejected=found.rejected,
        evaluations=found.evaluations,
        jacobians=found.jacobians,
        factorisations=found.factorisations,
        kernel_time=found.seconds,
        stiff_steps=found.stiff_steps,
        stiff_since=found.stiff_since if found.stiff_steps else None,
        implicit_steps=found.implicit_steps,
        implicit_evaluations=found.implicit_evaluations,
        switches=found.switches,
        switch_times=tuple(found.switch_time.tolist()) if found.switches else (),
        unresolved=unresolved,
        longest_step=found.longest_step,
        omitted_events=omitted,
    )


def _unresolved(
    scene: Scene, count: NDArray[np.int64], first: Array, undefined: bool = False
) -> tuple[Unresolved, ...]:
    """Events of which crossings may have been missed, from the number of such steps and a time (s) in the first."""
    return tuple(
        Unresolved(scene.events[k].name, steps, float(first[k]), undefined)
        for k, steps in enumerate(count.tolist())
        if steps
    )


def _omitted(scene: Scene, count: NDArray[np.int64], kept: NDArray[np.int32]) -> dict[str, int]:
    """How many events of each name were found that are not among those `kept`."""
    if sum(count.tolist()) == len(kept):  # the usual case, decided quickly
        return {}
    left = count - np.bincount(kept, minlength=len(count))
    omitted: dict[str, int] = {}
    for k in np.flatnonzero(left).tolist():
        omitted[scene.events[k].name] = omitted.get(scene.events[k].name, 0) + int(left[k])
    return omitted
