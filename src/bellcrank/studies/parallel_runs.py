"""Runs the designs of a sweep in threads."""

from __future__ import annotations

import itertools
import math
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from functools import partial
from typing import TYPE_CHECKING, Any

from bellcrank.errors import BellcrankError, InputError
from bellcrank.simulation.simulate import simulate
from bellcrank.simulation.status import Status
from bellcrank.studies.lone_measures import run_measures, start_measures
from bellcrank.studies.measures import target_events
from bellcrank.studies.sweep_result import INFEASIBLE, UNKNOWN, Design, Sweep

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene
    from bellcrank.simulation.trajectory import Trajectory
    from bellcrank.studies.axes import Axis

INTERRUPT_INTERVAL = 0.05  # s between checks for Ctrl-C
PATIENCE = 0.5  # s after Ctrl-C in which designs may still end; a compiler cannot be stopped
SPACING = 50  # times as long as saving takes: at most 1/50 of the time is spent on it


class ParallelRuns:
    """Runs the designs of a grid in threads; the first design runs alone, so that machine code is loaded once."""

    def __init__(self, scene: Scene, axes: tuple[Axis, ...], threads: int) -> None:
        self.scene, self.axes, self.threads = scene, axes, threads
        self.stopping, self.warm, self.first = threading.Event(), threading.Event(), threading.Lock()
        self.units: dict[str, str] = {}

    def run(self, progress: Callable[[int, int], None] | None, keep: RegularCall | None) -> Sweep:
        """Run all designs; Ctrl-C ends the sweep with those that are done."""
        count = math.prod(len(axis) for axis in self.axes)
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
                finished, waiting = wait(waiting, INTERRUPT_INTERVAL, FIRST_COMPLETED)
                done += [design for future in finished if (design := future.result()) is not None]
                if progress is not None:
                    progress(len(done), count)
                if keep is not None:
                    keep(len(done), partial(self.result, done))
        except KeyboardInterrupt:
            pass
        finally:  # an error must not wait for the other designs either
            self.stopping.set()
            pool.shutdown(wait=False, cancel_futures=True)
        ended, _ = wait([future for future in waiting if not future.cancelled()], PATIENCE)
        whole = [future for future in ended if future.exception() is None]
        done += [design for future in whole if (design := future.result()) is not None]
        return self.result(done)

    def result(self, done: Iterable[Design]) -> Sweep:
        """The sweep with the designs that are done."""
        designs = tuple(sorted(done, key=lambda design: design.index))
        return Sweep(self.scene, self.axes, designs, dict(self.units))

    def _submitted(self, pool: ThreadPoolExecutor, index: int, values: tuple[Any, ...]) -> Future[Design | None]:
        try:
            return pool.submit(self.design, index, values)
        except RuntimeError as error:  # no thread, or no memory for one, is left
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
            run = simulate(scene, progress=self._check_interrupt)
            measures |= self._named(run_measures(run))
        except BellcrankError as error:
            return Design(index, INFEASIBLE, str(error).removeprefix(f"{self.scene.source}: "), measures)
        self.warm.set()
        if run.status is Status.INTERRUPTED:
            return None
        reason, status = _reason(run), str(run.status)
        if run.success and (blank := _unknown_measures(run, measures)):
            status, reason = UNKNOWN, "; ".join(filter(None, [reason, blank]))
        return Design(index, status, reason, measures)

    def _check_interrupt(self, time: float) -> None:
        if self.stopping.is_set():
            raise KeyboardInterrupt  # ends this integration only

    def _named(self, found: Iterable[tuple[str, str, float]]) -> dict[str, float]:
        measures = {}
        for name, unit, value in found:
            self.units.setdefault(name, unit)
            measures[name] = value
        return measures


class RegularCall:
    """Calls a function with the designs that are done, at most every `seconds` and for a small share of the time."""

    def __init__(self, call: Callable[[Sweep], object], seconds: float) -> None:
        self.call, self.seconds = call, seconds
        self.next, self.done = time.monotonic() + seconds, 0

    def __call__(self, count: int, made: Callable[[], Sweep]) -> None:
        """Call it if it is time, with what `made` returns; `count` designs are done."""
        begun = time.monotonic()
        if begun < self.next or count == self.done:
            return
        self.call(made())
        now = time.monotonic()
        self.next, self.done = now + max(self.seconds, SPACING * (now - begun)), count


def _reason(run: Trajectory) -> str:
    """Why a run did not reach its target; empty where it did."""
    wanted = target_events(run.scene)
    if run.status is Status.FINISHED and wanted:
        return f"no event {' nor '.join(map(repr, wanted))} within {run.settings.duration:g} s"
    if run.status is Status.EVENT:
        end = next(event.name for event in run.events if event.stopped)
        return "" if end in wanted else f"event '{end}' ended the run at {run.time[-1]:.6g} s"
    return "" if run.success else run.reason


def _unknown_measures(run: Trajectory, measures: Mapping[str, float]) -> str:
    """Which measures of a run are not finite numbers, and which target events could not be looked for, as a clause."""
    bad = [f"'{name}'" for name, value in measures.items() if not math.isfinite(value)]
    wanted = target_events(run.scene)
    bad += [
        f"the function of event '{it.event}'" for it in run.statistics.unresolved if it.undefined and it.event in wanted
    ]
    return f"{bad[0]}{f' and {len(bad) - 1} more' if len(bad) > 1 else ''} not a finite number" if bad else ""
