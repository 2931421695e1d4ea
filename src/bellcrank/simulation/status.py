"""Why a run ended, and what to do about it."""

from __future__ import annotations

from enum import StrEnum


class Status(StrEnum):
    """The ways to end, first those of the stepper in the order of its numbers (cpp/integrator/problem.hpp)."""

    FINISHED = "finished"
    EVENT = "event"
    STEP_TOO_SMALL = "step_too_small"
    NON_FINITE = "non_finite"
    EVALUATIONS_SPENT = "evaluations_spent"
    INTERRUPTED = "interrupted"
    DRIVE_ENDED = "drive_ended"  # not the stepper's: the run is as long as its drives' motions allow
    TURNED_OVER = "turned_over"

    @property
    def success(self) -> bool:
        """Whether the run came to the end that was asked for: the duration, or a stopping event."""
        return self in (Status.FINISHED, Status.EVENT)

    @property
    def advice(self) -> str:
        """What happened and what to try, as a clause."""
        return _ADVICE[self]


_ADVICE = {
    Status.FINISHED: "the whole duration was simulated",
    Status.EVENT: "a stopping event ended the run",
    Status.STEP_TOO_SMALL: "the step that the tolerances ask for is smaller than time can resolve; the scene is stiff "
    "(try solver Radau), has a jump, or runs into a singular posture there",
    Status.NON_FINITE: "the accelerations are no longer finite numbers; look at the posture and the forces there, and "
    "for a fixed step try a smaller one",
    Status.EVALUATIONS_SPENT: "the evaluations allowed are spent; allow more (max_evaluations), loosen the "
    "tolerances, or try solver Radau if the scene is stiff",
    Status.DRIVE_ENDED: "the motion of a drive ends, or its speed jumps, while the joint moves; let the motion go on, "
    "or shorten the run",
    Status.TURNED_OVER: "a weld or hinge came to be turned half around, where its equations hold too: its links have "
    "passed through each other; take smaller tolerances or steps, and look at the forces on that constraint",
    Status.INTERRUPTED: "it was interrupted; what was computed until then is kept",
}
