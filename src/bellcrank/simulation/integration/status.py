"""Why a run ended, and what to do about it."""

from __future__ import annotations

from enum import StrEnum


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
