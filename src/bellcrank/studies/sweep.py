"""`sweep`: a scene for many values of its parameters, without compiling anew.

Parameters are inputs of the compiled equations, so that a design costs no more than its integration; designs run in
threads. A design that cannot be built, or whose run does not come to what was asked for, is a row with its reason.
"""

from __future__ import annotations

import itertools
import math
import os
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.derived import Portable, cached_property
from bellcrank.errors import BellcrankError, InputError
from bellcrank.memory import check_memory
from bellcrank.messages import unknown_name
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.simulation.simulate import KEEP_EVERY, check_keep_every, simulate
from bellcrank.simulation.status import Status
from bellcrank.studies.axes import Axis, read_axis
from bellcrank.studies.measures import aims, measures_of, start_measures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bellcrank.simulation.trajectory import Trajectory

Array = NDArray[np.float64]
INFEASIBLE = "infeasible"
MOST_DESIGNS = 10**7
MOST_THREADS = 1024
DESIGN_BYTES = 3000  # of a design with its measures, of which a small scene has 35
UNKNOWN = "unknown"  # a run came to its end, and a measure of it is not a finite number
_LATEST = 0.05  # s between looks at Ctrl-C
_PATIENCE = 0.5  # s after it that designs have to end in; a compiler does not stop for it
_SHARE = 50  # of the time goes to keeping designs, at most


@dataclass(frozen=True)
class Design:
    """One row of a sweep: its place in the grid, how it ended ("infeasible", the status of its run, or "unknown" where
    a measure is not a finite number), the reason where it did not come to what was asked for, and its measures by name.
    """

    index: int
    status: str
    reason: str
    measures: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Sweep(Portable):
    """Designs of a scene over the grid of all combinations of its axes, the last axis fastest.

    `units` are the measures with their units (SI). `designs` are those that were run, in the order of the grid: all of
    them, unless the sweep was interrupted.
    """

    scene: Scene
    axes: tuple[Axis, ...]
    designs: tuple[Design, ...]
    units: Mapping[str, str] = field(repr=False)

    def __repr__(self) -> str:
        ended = sum(not design.reason for design in self.designs)
        axes = ", ".join(axis.path for axis in self.axes)
        return f"Sweep('{self.scene.name}' over {axes}: {len(self.designs)} designs, {ended} came to their end)"

    @property
    def shape(self) -> tuple[int, ...]:
        """The number of values along each axis."""
        return tuple(len(axis.values) for axis in self.axes)

    @property
    def complete(self) -> bool:
        """Whether every design was run."""
        return len(self.designs) == math.prod(self.shape)

    @cached_property
    def values(self) -> Array:
        """The values (designs, axes) of the axes, in their units."""
        place = np.unravel_index(np.array([design.index for design in self.designs], dtype=np.intp), self.shape)
        return np.column_stack([np.array(axis.numbers)[k] for axis, k in zip(self.axes, place, strict=True)])

    def column(self, measure: str) -> Array:
        """A measure of each design (designs,); NaN where it has none, or it is no number. Raises InputError with what
        there is.
        """
        if arguments.text("measure", measure, "the name of a measure") not in self.units:
            raise InputError(f"sweep of {self.scene.name}: {unknown_name('measure', measure, self.units)}")
        return np.array([design.measures.get(measure, math.nan) for design in self.designs])

    def grid(self, measure: str) -> Array:
        """The same in the shape of the grid, one dimension an axis; NaN where a design was not run."""
        column = self.column(measure)
        table = np.full(math.prod(self.shape), math.nan)
        table[[design.index for design in self.designs]] = column
        return table.reshape(self.shape)

    @property
    def telling(self) -> tuple[str, ...]:
        """The measures that answer first: of stopping events, else of all events, else the end of the run."""
        events = aims(self.scene) or [event.name for event in self.scene.events]
        prefixes = tuple(f"{name}." for name in events) or ("end.",)
        found = [name for name in self.units if name.startswith(prefixes)]
        told = tuple(name for name in found if not name.endswith(".velocity") and ".force." not in name)
        return told or tuple(name for name in ("end.time",) if name in self.units)

    def table(self, measures: Sequence[str] | None = None) -> str:
        """The designs as text, one a line; `measures` (default: the telling ones)."""
        from bellcrank.studies.report import text_table

        return text_table(self, self._measures(measures))

    def to_csv(self, path: str | Path) -> Path:
        """Write one row a design: axes, status, every measure (units in the header), reason; returns the path."""
        from bellcrank.studies.report import write_csv

        return write_csv(self, arguments.path("path", path, "the path of a file"))

    def to_json(self, path: str | Path) -> Path:
        """Write axes, units and designs as JSON; returns the path."""
        from bellcrank.studies.report import write_json

        return write_json(self, arguments.path("path", path, "the path of a file"))

    def plot(self, path: str | Path | None = None, measures: Sequence[str] | None = None) -> Figure:
        """Draw one panel a measure, a line over one axis, a map over two; written to `path` (PNG) if one is given."""
        from bellcrank.studies.plot import plot_sweep

        return plot_sweep(self, self._measures(measures), None if path is None else arguments.path("path", path))

    def _measures(self, given: object) -> tuple[str, ...]:
        if given is None:
            return self.telling
        listed = arguments.several("measures", given, str, "names of measures", alone=True)
        if not listed:
            arguments.refuse("measures", "at least one name of a measure", given)
        return listed


def sweep(
    scene: Scene | str | Path,
    vary: Mapping[str, Iterable[Any]],
    *,
    overrides: Mapping[str, Any] | None = None,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
    checking: Callable[[int, int], None] | None = None,
    keep: Callable[[Sweep], object] | None = None,
    keep_every: float = KEEP_EVERY,
) -> Sweep:
    """Simulate a scene (or the file or name of one) for all combinations of values of parameters.

    `vary` maps parameters, or other dotted paths (overrides.py), to their values: numbers in SI units or texts such as
    "1 deg". Only what leaves the equations as they are can be varied: parameters, the start, solver settings.
    `overrides` changes the scene beforehand; `threads` defaults to the machine's; `progress` is called with the number
    of designs done and of all, and `checking` before, with the number of values of an axis checked and of all. Ctrl-C
    ends the sweep and keeps what is done (`complete` is then false). `keep` is called with the sweep as far as it is
    about every `keep_every` s, such as to write it to a file; more rarely where that takes long.

    Raises InputError where a path leads nowhere, takes none of its values, or changes the equations.
    """
    if not isinstance(scene, Scene):
        scene = load_scene(arguments.subject("scene", scene, "a scene"))
    if overrides is not None:
        scene = scene.with_overrides(overrides)
    vary = arguments.mapping("vary", vary, "a mapping of parameters to their values")
    if threads is not None:
        threads = arguments.whole("threads", threads, least=1, most=MOST_THREADS)
    for name, called in (("progress", progress), ("checking", checking), ("keep", keep)):
        if called is not None:
            arguments.function(name, called)
    if not vary:
        raise InputError(f"sweep of {scene.name}: expected at least one parameter to vary, found none")
    axes = tuple(read_axis(scene, path, values) for path, values in vary.items())
    _check_count(math.prod(len(axis.values) for axis in axes))
    for axis in axes:
        _check(scene, axis, checking)
    check_keep_every(keep_every)
    pool = _Pool(scene, axes, threads or len(os.sched_getaffinity(0)))
    return pool.run(progress, None if keep is None else _Regularly(keep, keep_every))


def _check_count(count: int) -> None:
    """Refuse a grid of more designs than can be kept, before any list of them is made (InputError)."""
    if count > MOST_DESIGNS:
        raise InputError(f"the grid has {count} designs, and a sweep takes at most {MOST_DESIGNS}; vary fewer values")
    check_memory(count, DESIGN_BYTES, "designs")


def _check(scene: Scene, axis: Axis, checking: Callable[[int, int], None] | None) -> None:
    """Refuse a path none of whose values the scene takes, and one that changes the equations (InputError).

    A parameter is an input of the equations, whatever its value, so that one value that the scene takes is enough.
    """
    parameter = axis.path.removeprefix("parameters.") in scene.parameters
    refused: list[InputError] = []
    for k, value in enumerate(axis.values):
        if checking is not None:
            checking(k, len(axis.values))
        try:
            design = scene.with_overrides({axis.path: value})
        except InputError as error:
            refused.append(error)
            continue
        if design.structure_key != scene.structure_key:
            raise InputError(
                f"sweep over '{axis.path}': it changes the equations, which would be compiled for every value; make it "
                f"a parameter of the scene (parameters: {{NAME: {{value: …, sets: […]}}}}) and vary that"
            )
        if parameter:
            return
    if len(refused) == len(axis.values):
        raise refused[0]


def _reason(run: Trajectory) -> str:
    """Why a run did not come to what was asked for; empty where it did."""
    wanted = aims(run.scene)
    if run.status is Status.FINISHED and wanted:
        return f"no event {' nor '.join(map(repr, wanted))} within {run.settings.duration:g} s"
    if run.status is Status.EVENT:
        end = next(event.name for event in run.events if event.stopped)
        return "" if end in wanted else f"event '{end}' ended the run at {run.time[-1]:.6g} s"
    return "" if run.success else run.reason


def _not_known(run: Trajectory, measures: Mapping[str, float]) -> str:
    """Which measures of a run are not finite numbers, and which events it is meant to reach could not be looked for."""
    bad = [f"'{name}'" for name, value in measures.items() if not math.isfinite(value)]
    wanted = aims(run.scene)
    bad += [
        f"the function of event '{it.event}'" for it in run.statistics.unresolved if it.undefined and it.event in wanted
    ]
    return f"{bad[0]}{f' and {len(bad) - 1} more' if len(bad) > 1 else ''} not a finite number" if bad else ""


class _Regularly:
    """Calls with a sweep, each so many s or more after the one before, so that they take a small share of the time."""

    def __init__(self, call: Callable[[Sweep], object], seconds: float) -> None:
        self.call, self.seconds = call, seconds
        self.next, self.done = time.monotonic() + seconds, 0

    def __call__(self, count: int, made: Callable[[], Sweep]) -> None:
        begun = time.monotonic()
        if begun < self.next or count == self.done:
            return
        self.call(made())
        now = time.monotonic()
        self.next, self.done = now + max(self.seconds, _SHARE * (now - begun)), count


class _Pool:
    """Runs the designs of a grid in threads; the first runs alone, so that machine code is loaded once."""

    def __init__(self, scene: Scene, axes: tuple[Axis, ...], threads: int) -> None:
        self.scene, self.axes, self.threads = scene, axes, threads
        self.stopping, self.warm, self.first = threading.Event(), threading.Event(), threading.Lock()
        self.units: dict[str, str] = {}

    def run(self, progress: Callable[[int, int], None] | None, keep: _Regularly | None) -> Sweep:
        count = math.prod(len(axis.values) for axis in self.axes)
        combinations = enumerate(itertools.product(*(axis.values for axis in self.axes)))
        done: list[Design] = []
        waiting: set[Future[Design | None]] = set()
        pool = ThreadPoolExecutor(min(self.threads, count), "sweep")
        try:
            while True:
                for index, values in itertools.islice(combinations, 4 * self.threads - len(waiting)):
                    waiting.add(self._submitted(pool, index, values))
                if not waiting:
                    break
                finished, waiting = wait(waiting, _LATEST, FIRST_COMPLETED)
                done += [design for future in finished if (design := future.result()) is not None]
                if progress is not None:
                    progress(len(done), count)
                if keep is not None:
                    keep(len(done), partial(self.result, done))
        except KeyboardInterrupt:
            pass
        finally:  # an error of ours must not wait for the other designs either
            self.stopping.set()
            pool.shutdown(wait=False, cancel_futures=True)
        ended, _ = wait([future for future in waiting if not future.cancelled()], _PATIENCE)
        whole = [future for future in ended if future.exception() is None]
        done += [design for future in whole if (design := future.result()) is not None]
        return self.result(done)

    def result(self, done: Iterable[Design]) -> Sweep:
        """The sweep as far as it is."""
        designs = tuple(sorted(done, key=lambda design: design.index))
        return Sweep(self.scene, self.axes, designs, dict(self.units))

    def _submitted(self, pool: ThreadPoolExecutor, index: int, values: tuple[Any, ...]) -> Future[Design | None]:
        try:
            return pool.submit(self.design, index, values)
        except RuntimeError as error:  # the system has no thread, or no memory for one, left
            raise InputError(f"threads: {self.threads} cannot run at once here ({error}); ask for fewer") from None

    def design(self, index: int, values: tuple[Any, ...]) -> Design | None:
        """The row of one design; None where the sweep was interrupted before it was done."""
        if not self.warm.is_set():
            with self.first:
                return self._design(index, values)
        return self._design(index, values)

    def _design(self, index: int, values: tuple[Any, ...]) -> Design | None:
        if self.stopping.is_set():
            return None
        measures: dict[str, float] = {}
        try:
            changes = {axis.path: value for axis, value in zip(self.axes, values, strict=True)}
            scene = self.scene.with_overrides(changes)
            measures |= self._named(start_measures(scene))
            run = simulate(scene, progress=self._look)
            measures |= self._named(measures_of(run))
        except BellcrankError as error:
            return Design(index, INFEASIBLE, str(error).removeprefix(f"{self.scene.source}: "), measures)
        self.warm.set()
        if run.status is Status.INTERRUPTED:
            return None
        reason, status = _reason(run), str(run.status)
        if run.success and (blank := _not_known(run, measures)):
            status, reason = UNKNOWN, "; ".join(filter(None, [reason, blank]))
        return Design(index, status, reason, measures)

    def _look(self, time: float) -> None:
        if self.stopping.is_set():
            raise KeyboardInterrupt  # which ends the integration and nothing else

    def _named(self, found: Iterable[tuple[str, str, float]]) -> dict[str, float]:
        measures = {}
        for name, unit, value in found:
            self.units.setdefault(name, unit)
            measures[name] = value
        return measures
