"""Calls compiled functions and steps them through time (src/cpp/integrator)."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

def evaluate(
    address: int, inputs: tuple[Any, ...], input_sizes: tuple[int, ...], output_sizes: tuple[int, ...]
) -> tuple[NDArray[np.float64], ...] | None: ...

class StepResult:
    """What a run found.

    `status`: 0 finished, 1 event, 2 step too small, 3 not finite, 4 evaluations spent, 5 interrupted.
    `time` (k,) and `state` (k, n) are the requested outputs that were reached, `steps` the ends of the
    accepted steps with the start before them, `event_*` the events in the order of time. Times in s.
    Of more than 100,000 steps every 2nd, 4th, 8th, … end is kept and the last, so that there are 50,000 to 100,002;
    `longest_step` is that of all. Of more than 100,000 events each event function keeps at least its first 100 and its
    last; `event_counts` (events,) counts all. `unresolved_count` (events,) says in how many steps crossings may have
    been missed, `unresolved_time` when the first of these began.
    """

    @property
    def time(self) -> NDArray[np.float64]: ...
    @property
    def state(self) -> NDArray[np.float64]: ...
    @property
    def end_time(self) -> float: ...
    @property
    def end_state(self) -> NDArray[np.float64]: ...
    @property
    def status(self) -> int: ...
    @property
    def accepted(self) -> int: ...
    @property
    def rejected(self) -> int: ...
    @property
    def evaluations(self) -> int: ...
    @property
    def jacobians(self) -> int: ...
    @property
    def factorisations(self) -> int: ...
    @property
    def seconds(self) -> float: ...
    @property
    def steps(self) -> NDArray[np.float64]: ...
    @property
    def event_index(self) -> NDArray[np.int32]: ...
    @property
    def event_time(self) -> NDArray[np.float64]: ...
    @property
    def event_state(self) -> NDArray[np.float64]: ...
    @property
    def longest_step(self) -> float: ...
    @property
    def event_counts(self) -> NDArray[np.int64]: ...
    @property
    def unresolved_count(self) -> NDArray[np.int64]: ...
    @property
    def undefined_count(self) -> NDArray[np.int64]: ...
    @property
    def undefined_time(self) -> NDArray[np.float64]: ...
    @property
    def unresolved_time(self) -> NDArray[np.float64]: ...

def methods() -> dict[str, int]:
    """The methods and their orders."""

def tableau(method: str) -> dict[str, Any]:
    """Order and coefficients a, b, c of a method; for Radau the transformation and the eigenvalues of inverse a too."""

def integrate(
    rhs: int,
    method: str,
    t0: float,
    t1: float,
    x0: NDArray[np.float64],
    p: NDArray[np.float64],
    *,
    norm_size: int,
    rtol: float,
    atol: float,
    step: float = 0.0,
    first_step: float = 0.0,
    max_step: float = ...,
    times: NDArray[np.float64],
    every_step: bool,
    unit: Sequence[tuple[int, int]],
    signals: Sequence[tuple[NDArray[np.float64], NDArray[np.float64], int, bool]],
    stops: NDArray[np.float64],
    events: int,
    terminal: Sequence[bool],
    direction: Sequence[int],
    jacobian: int,
    tangent: int,
    lanes: int,
    max_evaluations: int,
    progress: Callable[[float], object] | None,
    block: Callable[[dict[str, Any]], float] | None = None,
    block_seconds: float = 0.0,
    staged: bool = False,
    fallback: int = 0,
    project: int = 0,
    project_fallback: int = 0,
    project_batch: int = 0,
    nq: int = 0,
    event_samples: int = 8,
    weights: NDArray[np.float64] | None = None,
) -> StepResult:
    """Step x' = rhs(t, x, u, p) from t0 to t1 (s); ValueError where arguments do not fit together.

    `step` > 0 fixes the step size; otherwise the error of the first `norm_size` entries is kept below
    atol + rtol |x|, as SciPy's solve_ivp does. `unit`: (start, length) parts of x that stay unit vectors.
    A `staged` right-hand side takes (t, x, u, p, k, s) and is that at x + s k (up to 16 states, not for Radau).
    `fallback` takes over where a second output of `rhs`, a guard, is not positive. `project`, (t, x, u, p) -> a
    correction of x and a guard, is Newton's step that every state that is handed on is corrected by, until it moves the
    first `nq` entries no more; `project_fallback` gives the correction where that guard is not positive, and
    `project_batch` many at once, for outputs. `weights` (nq,) tell how much 1 is in each of these entries.
    `event_samples` is how often event functions are looked at in a step at first: 2, or else 8 times. Where crossings
    may have been missed, `unresolved_count` and `unresolved_time` tell how often and from when on; where a function is
    not a number, `undefined_count` and `undefined_time` tell in how many steps and the first time found.
    `block` is called after about `block_seconds` of computing, and then after as many as it answers, with what was
    found since it was called before: new arrays by the names of StepResult, all `steps` and counts so far;
    `end_time` and `end_state` of the moment, `counts` (accepted to factorisations), `seconds` and `longest_step`.
    `signals`: (breaks (m + 1,), coefficients (m, powers, width), derivatives, kinked) pieces of u.
    """
