"""Calls compiled functions and integrates them over time (src/cpp/integrator)."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.dynamics.equations.design_parameters import RowSampling
from bellcrank.dynamics.postures.start_equations import StartEquations
from bellcrank.simulation.integration.ensemble import EnsembleProblem
from bellcrank.simulation.integration.integration_problem import IntegrationProblem
from bellcrank.simulation.sensitivities.sensitivity_integration import SensitivityProblem

def evaluate(
    address: int, inputs: tuple[Any, ...], input_sizes: tuple[int, ...], output_sizes: tuple[int, ...]
) -> tuple[NDArray[np.float64], ...] | None: ...
def evaluate_rows(
    address: int, inputs: list[NDArray[np.float64]], output_sizes: list[int], samples: int
) -> tuple[NDArray[np.float64], ...]:
    """The code for one sample, row by row; an input (1, m) holds for all samples."""

def code_maker() -> int:
    """The address of the C function void *(PyObject *maker): the address that the Python function `maker` returns."""

class SampleCall:
    """A compiled function of one sample with one output, of this address, whose code lives as long as `code`.

    A call takes up to three vectors of doubles; inputs after them have size 0. It returns a new array of the shape, or
    None where an input is not a finite contiguous numpy.ndarray of its size, or the answer is not finite: the caller
    then converts it, or says what is wrong.
    """

    def __init__(
        self, code: object, address: int, input_sizes: tuple[int, ...], shape: tuple[int, ...], array: type, empty: Any
    ) -> None: ...
    def __call__(self, *inputs: Any) -> NDArray[np.float64] | None: ...

class StepResult:
    """What a run found; arrays are views that keep it alive.

    `status`: 0 finished, 1 event, 2 step too small, 3 not finite, 4 evaluations spent, 5 interrupted, 6 chattering.
    `time` (k,) s and `state` (k, n) are the requested outputs that were reached and, where the run ended early, its
    end; `finite`: all of them are finite. `steps` are the start and the ends of the accepted steps, `event_*` the
    events in the order of time. Of more than 100,000 steps every 2nd, 4th, 8th, … end and the last are kept, so that
    there are 50,000 to 100,002; `longest_step` is that of all. Of more than 100,000 events each event function keeps at
    least its first 100 and its last; `event_counts` (events,) counts all. `unresolved_count` (events,) says in how many
    steps crossings may have been missed, `unresolved_time` when the first of these began; `undefined_count` in how many
    steps an event function was not a number, `undefined_time` when first.
    `stiff_steps`: accepted steps of an explicit method that stiffness held short, the first at `stiff_since` (s, NaN:
    none). `switch_time` (k,) s: when method "auto" went on with Radau, with DOP853 again, and so on, the first 1000 of
    `switches`; `implicit_*`: the part of Radau.
    `least` and `largest` (observed,): the extremes of the observed quantities.
    `held_time` (m,) s and `held_values` (m, k): the held entries of u, which have these values from these times on.
    `events_complete`: none was omitted or may have been missed.
    """

    @property
    def status(self) -> int: ...
    @property
    def time(self) -> NDArray[np.float64]: ...
    @property
    def state(self) -> NDArray[np.float64]: ...
    @property
    def end_time(self) -> float: ...
    @property
    def finite(self) -> bool: ...
    @property
    def events_complete(self) -> bool: ...
    @property
    def end_state(self) -> NDArray[np.float64]: ...
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
    def stiff_steps(self) -> int: ...
    @property
    def stiff_since(self) -> float: ...
    @property
    def implicit_steps(self) -> int: ...
    @property
    def implicit_evaluations(self) -> int: ...
    @property
    def least(self) -> NDArray[np.float64]: ...
    @property
    def largest(self) -> NDArray[np.float64]: ...
    @property
    def held_time(self) -> NDArray[np.float64]: ...
    @property
    def held_values(self) -> NDArray[np.float64]: ...
    @property
    def switches(self) -> int: ...
    @property
    def switch_time(self) -> NDArray[np.float64]: ...
    @property
    def seconds(self) -> float: ...
    @property
    def steps(self) -> NDArray[np.float64]: ...
    @property
    def longest_step(self) -> float: ...
    @property
    def event_index(self) -> NDArray[np.int32]: ...
    @property
    def event_time(self) -> NDArray[np.float64]: ...
    @property
    def event_state(self) -> NDArray[np.float64]: ...
    @property
    def event_counts(self) -> NDArray[np.int64]: ...
    @property
    def unresolved_count(self) -> NDArray[np.int64]: ...
    @property
    def unresolved_time(self) -> NDArray[np.float64]: ...
    @property
    def undefined_count(self) -> NDArray[np.int64]: ...
    @property
    def undefined_time(self) -> NDArray[np.float64]: ...

class StepBlock:
    """What was found since the last checkpoint, as new arrays by the names of `StepResult`.

    `steps`, counts and times of event functions are those of the whole run so far.
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
    def stiff_steps(self) -> int: ...
    @property
    def stiff_since(self) -> float: ...
    @property
    def implicit_steps(self) -> int: ...
    @property
    def implicit_evaluations(self) -> int: ...
    @property
    def switches(self) -> int: ...
    @property
    def switch_time(self) -> NDArray[np.float64]: ...
    @property
    def seconds(self) -> float: ...
    @property
    def steps(self) -> NDArray[np.float64]: ...
    @property
    def longest_step(self) -> float: ...
    @property
    def event_index(self) -> NDArray[np.int32]: ...
    @property
    def event_time(self) -> NDArray[np.float64]: ...
    @property
    def event_state(self) -> NDArray[np.float64]: ...
    @property
    def event_counts(self) -> NDArray[np.int64]: ...
    @property
    def unresolved_count(self) -> NDArray[np.int64]: ...
    @property
    def unresolved_time(self) -> NDArray[np.float64]: ...
    @property
    def undefined_count(self) -> NDArray[np.int64]: ...
    @property
    def undefined_time(self) -> NDArray[np.float64]: ...

def methods() -> dict[str, int]:
    """The methods and their orders."""

def tableau(method: str) -> dict[str, Any]:
    """Order and coefficients a, b, c of a method; for Radau the transformation and the eigenvalues of inverse a too."""

class PreparedProblem:
    """x' = rhs(t, x, u, p) from t0 to t1 (s), read once and integrated again and again, from several threads too.

    Raises TypeError where an attribute has the wrong type, ValueError where attributes do not fit together.
    """

    def __init__(self, problem: IntegrationProblem) -> None: ...
    def run(
        self,
        progress: Callable[[float], object] | None = None,
        checkpoint: Callable[[StepBlock], float] | None = None,
        interval: float = 0.0,
        x0: NDArray[np.float64] | None = None,
        parameters: NDArray[np.float64] | None = None,
        updates: Sequence[Callable[..., NDArray[np.float64]] | None] = (),
    ) -> StepResult:
        """Integrate, from another start or with other parameters where they are given.

        `updates`: for each update of the held entries, the function (t, x, values) -> values that computes it where it
        has no address.

        `progress` is called with the time about every 0.1 s; `checkpoint` with what was found since it was called
        before, first after `interval` seconds of computing, and returns the seconds until its next call. Raises what
        they raise; Ctrl-C ends the run (status 5).
        """

def has_lanes(width: int) -> bool:
    """Whether this machine can step runs in so many SIMD lanes."""

def integrate_ensemble(problem: EnsembleProblem) -> dict[str, Any]:
    """Step many runs at once, in SIMD lanes and threads: the entries of an EnsembleResult.

    Raises TypeError where an attribute has the wrong type, ValueError where attributes do not fit together, and what
    `progress` raises; Ctrl-C ends the runs.
    """

def consistent_postures(
    equations: StartEquations,
    parameters: NDArray[np.float64],
    units: NDArray[np.float64],
    lengths: NDArray[np.float64],
    q: NDArray[np.float64],
    held: NDArray[np.bool_],
    rows: NDArray[np.bool_],
    cosines: NDArray[np.bool_],
    method: str,
    threads: int,
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.int32], NDArray[np.float64]]:
    """The consistent positions (n, nq) of designs, and for each a StartCode with its index and value."""

def consistent_velocities(
    equations: StartEquations,
    parameters: NDArray[np.float64],
    units: NDArray[np.float64],
    lengths: NDArray[np.float64],
    q: NDArray[np.float64],
    v: NDArray[np.float64],
    held: NDArray[np.bool_],
    threads: int,
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.int32], NDArray[np.float64]]:
    """The consistent velocities (n, nv) of designs, and for each a StartCode with its index and value."""

def followed_postures(
    equations: StartEquations,
    parameters: NDArray[np.float64],
    units: NDArray[np.float64],
    lengths: NDArray[np.float64],
    q: NDArray[np.float64],
    times: NDArray[np.float64],
    inputs: NDArray[np.float64],
    wanted: NDArray[np.float64],
    leading_q: Sequence[int],
    leading_v: Sequence[int],
    longest: float,
    rounded: float,
    threads: int,
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float64]]:
    """The positions (n, rows nq) of designs along a motion that begins in the first row of `times`, `inputs` and
    `wanted`; how many rows each reached; and the share of the way to the next row that it was last tried to reach.
    """

def row_sizes(
    sampling: RowSampling, parameters: NDArray[np.float64], threads: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Scale, square and unit of the kept rows and L (designs, 3 rows + 1), and which designs are clearly regular."""

def csv_rows(columns: list[NDArray[np.float64] | tuple[NDArray[np.int32], list[str]]], blank: bool) -> bytes:
    """The lines of a CSV file, UTF-8, from columns of numbers (n,), or of codes (n,) with the text of each code.

    Numbers are written as `repr` does; those that are not finite as nan, inf and -inf, or where `blank` as empty cells.
    Raises ValueError where columns differ in length or a code has no text.
    """

def spline_coefficients(
    knots: NDArray[np.float64], at: NDArray[np.float64], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The coefficients (n, m) of the quintic spline with knots (n + 6,) through values (k, m) at k places, which rise.

    With k = n − 4 its first and second derivative are 0 at both ends. Raises ValueError where two places are too close.
    """

def spline_values(
    knots: NDArray[np.float64], coefficients: NDArray[np.float64], at: NDArray[np.float64], derivative: int
) -> NDArray[np.float64]:
    """Values (k, m) of a derivative of a quintic spline at k places."""

class SensitivityResult:
    """Sensitivities along a run: in its rows (directions, n, nq + nv) and at marks (directions, m, nq + nv).

    `status` is that of StepResult; `steps`, `rejected` and `evaluations` count the work, `seconds` its time.
    """

    @property
    def rows(self) -> NDArray[np.float64]: ...
    @property
    def marked(self) -> NDArray[np.float64]: ...
    @property
    def status(self) -> int: ...
    @property
    def steps(self) -> int: ...
    @property
    def rejected(self) -> int: ...
    @property
    def evaluations(self) -> int: ...
    @property
    def seconds(self) -> float: ...

def propagate_sensitivities(run: IntegrationProblem, problem: SensitivityProblem) -> SensitivityResult:
    """Integrate sensitivities along a run of this problem; raises where the records do not fit."""
