"""`sweep`: a scene for many values of its parameters, without compiling anew."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from bellcrank import arguments
from bellcrank.arguments import Progress
from bellcrank.files.access import Trust
from bellcrank.robot.robot import Robot
from bellcrank.scene.load import given_scene
from bellcrank.scene.scene import Scene
from bellcrank.simulation.files.checkpoints import CHECKPOINT_EVERY, SPACING, check_checkpoint_every
from bellcrank.studies.execution.execution import Executor, Part, Work
from bellcrank.studies.execution.executors import choose_executor
from bellcrank.studies.execution.fastest_runner import FastestRunner
from bellcrank.studies.execution.sizing_runner import SizingRunner
from bellcrank.studies.execution.study import run_study
from bellcrank.studies.execution.study_folder import StudyFolder
from bellcrank.studies.results.sensitivity import Sensitivity
from bellcrank.studies.results.study_columns import StudyColumns
from bellcrank.studies.results.sweep_result import Sweep
from bellcrank.studies.sweep_plan import SampleRequest, SweepPlan, planner


@arguments.named
def sweep(
    scene: Scene | Robot | str | Path,
    vary: Mapping[str, Any] | None = None,
    *,
    size: bool = False,
    fastest: bool = False,
    sample: int | None = None,
    method: str | None = None,
    seed: int | None = None,
    sobol: int | None = None,
    threads: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    folder: str | Path | None = None,
    restart: bool = False,
    checking: Progress | None = None,
    on_checkpoint: Callable[[Sweep], object] | None = None,
    checkpoint_every: float = CHECKPOINT_EVERY,
    overrides: Mapping[str, Any] | None = None,
    trust: Trust = (),
    progress: Progress | None = None,
) -> Sweep:
    """Simulate or size a scene for all combinations of values of its parameters, or for a sample of distributions.

    Parameters are inputs of the compiled equations, so that nothing is compiled for a design; many designs are
    integrated at once. A design that cannot be built, or whose run does not reach its target, is a row with its reason.

    Args:
        scene: A scene or robot, or the path or name of its file.
        vary: Parameters of the scene, or other dotted paths such as "initial.crank" and "simulate.rtol". Each has
            values (numbers in SI units, or texts such as "1 deg"), a range "FIRST:LAST:COUNT", or a distribution:
            "normal(MEAN, SD)", "uniform(LOW, HIGH)", "truncnormal(MEAN, SD, LOW, HIGH)", "triangular(LOW, MODE,
            HIGH)", "loguniform(LOW, HIGH)", with units as in "normal(1.241 m, 1 mm)". Only what leaves the equations
            unchanged can be varied: parameters, the start and the solver's settings. None: as the scene says under
            `study`.
        size: Whether designs are sized over the motions of the configuration, as `size` does, instead of simulated.
            Then link lengths and masses (such as "link.forearm_link.mass" and "joint.elbow.origin.x"), "payload.mass",
            ratings of actuators ("actuators.elbow.ratio") and durations ("motions.pick.duration") can be varied too.
        fastest: Whether the fastest motions along the paths of the configuration's motions are found, as `time_optimal`
            does, instead. What is varied as for `size`, but no durations.
        sample: How many designs are drawn from the distributions; each point of a grid of other values gets all of
            them. By default as the scene says.
        method: "sobol" (scrambled Sobol points, the default; a power of two is best), "latin" (a Latin hypercube) or
            "random" (independent points).
        seed: Of the random numbers, by default 0. A sample is the same for the same seed and version of SciPy.
        sobol: Instead of a sample, the designs of Sobol indices (`Sweep.sensitivity`): 16 scramblings of this number of
            Sobol points, a power of two, each with as many designs as there are parameters and 2.
        threads: How many threads run designs; by default as many as the machine has processors.
        workers: How many processes Dask starts on this machine to run designs, instead of threads.
        scheduler: The address of a Dask scheduler whose workers run the designs.
        folder: A folder in which the designs that are done are kept while the sweep goes on. The same sweep with the
            same folder goes on where an earlier process was stopped; another sweep is refused.
        restart: Set an earlier sweep in the folder aside, instead of going on with it.
        checking: Called before, with the number of values of an axis that are checked and the number of all.
        on_checkpoint: Called with the sweep of the designs that are done about every `checkpoint_every` s; less often
            where that takes long.
        checkpoint_every: s between two calls of `on_checkpoint`, and between two checkpoints in `folder`.
        overrides: Changes of the scene beforehand, by dotted path.
        trust: Where `scene` is a file, folders whose files it may name, besides those near it.
        progress: Called with the number of designs done and the number of all.

    Returns:
        One row a design. Ctrl-C ends the sweep and keeps the designs that are done (`complete` is then false).

    Raises:
        InputError: A path does not exist, accepts none of its values, or changes the equations; a distribution or the
            folder is not as expected.

    Example:
        >>> import bellcrank as bc
        >>> result = bc.sweep("four_bar", {"crank_length": [1.22, 1.23, 1.24]})
        >>> result.column("lock.time").round(2)
        array([18.56, 16.13, 12.11])
        >>> result = bc.sweep("four_bar", {"crank_length": "normal(1.23 m, 1 mm)"}, sample=64, seed=1)
        >>> bool(16.0 < result.column("lock.time").mean() < 16.2)
        True
    """
    scene = given_scene(scene, overrides, trust)
    for name, called in (("progress", progress), ("checking", checking), ("on_checkpoint", on_checkpoint)):
        if called is not None:
            arguments.function(name, called)
    check_checkpoint_every(checkpoint_every)
    executor = choose_executor(threads, workers, scheduler)
    if folder is not None:
        folder = arguments.path("folder", folder, "the path of a folder")
    planned = planner("sweep", size=arguments.flag("size", size), fastest=arguments.flag("fastest", fastest))
    plan = planned(scene, vary, SampleRequest(sample, method, seed, sobol), checking)
    restart = arguments.flag("restart", restart)
    with contextlib.nullcontext() if folder is None else StudyFolder(folder, restart=restart) as opened:
        return run_sweep(
            plan,
            executor,
            folder=opened,
            progress=progress,
            on_checkpoint=on_checkpoint,
            checkpoint_every=checkpoint_every,
        )


def run_sweep(
    plan: SweepPlan,
    executor: Executor,
    *,
    folder: StudyFolder | None = None,
    progress: Progress | None = None,
    on_checkpoint: Callable[[Sweep], object] | None = None,
    checkpoint_every: float = CHECKPOINT_EVERY,
) -> Sweep:
    """Run the designs of a plan; the caller has opened the folder. Raises InputError as `sweep`."""
    runner = plan.runner
    sweep_of = Sweep(
        scene=plan.scene,
        space=plan.space,
        units=runner.units,
        candidates=runner.default_measures,
        noise=runner.noise,
        notes=plan.notes,
        sized=isinstance(runner, SizingRunner),
        timed=isinstance(runner, FastestRunner),
    )
    if on_checkpoint is not None:
        executor = WatchedExecutor(executor, sweep_of, on_checkpoint, checkpoint_every)
    found = run_study(plan.space, runner, executor, folder=folder, progress=progress, checkpoint_every=checkpoint_every)
    return replace(sweep_of, columns=found.columns, index=found.designs)


# ---- Hands over the designs that are done while a sweep goes on.


class WatchedExecutor:
    """An executor that calls a function with the designs that it has run, about every `seconds`.

    Args:
        executor: What runs the designs.
        sweep: The sweep without rows.
        keep: The function; calls take a small share of the time.
        seconds: s.
    """

    def __init__(self, executor: Executor, sweep: Sweep, keep: Callable[[Sweep], object], seconds: float) -> None:
        self.executor, self.sweep, self.keep, self.seconds = executor, sweep, keep, seconds

    def __enter__(self) -> Self:
        self.executor.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self.executor.__exit__(*error)  # type: ignore[arg-type]

    @property
    def environment(self) -> Mapping[str, str]:
        """That of the executor."""
        return self.executor.environment

    def run(self, work: Work) -> Iterator[Part]:
        """The parts of the executor."""
        parts: list[Part] = []
        due = time.monotonic() + self.seconds
        for part in self.executor.run(work):
            parts.append(part)
            if (begun := time.monotonic()) >= due:
                self.keep(self._so_far(parts))
                now = time.monotonic()
                due = now + max(self.seconds, SPACING * (now - begun))
            yield part

    def _so_far(self, parts: list[Part]) -> Sweep:
        parts.sort(key=lambda part: part.designs.first)
        index = np.concatenate([np.arange(*part.designs) for part in parts])
        return replace(self.sweep, columns=StudyColumns.joined([part.columns for part in parts]), index=index)


@arguments.named
def sobol_indices(
    scene: Scene | Robot | str | Path,
    vary: Mapping[str, Any] | None = None,
    *,
    n: int = 64,
    seed: int | None = None,
    threads: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    folder: str | Path | None = None,
    overrides: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> Sensitivity:
    """Find which parameters the spread of a scene's measures comes from.

    The first-order index of a parameter is the share of a measure's variance that it explains by itself, the total
    index the share with all interactions. The parameters are independent. 16 n (parameters + 2) designs are simulated
    (A. Saltelli et al., Comput. Phys. Commun. 181 (2010) 259-270), from 16 scramblings of n Sobol points, whose spread
    gives the errors.

    Args:
        scene: A scene or robot, or the path or name of its file.
        vary: Parameters of the scene, or other dotted paths, with their distributions, such as "normal(1.24 m, 1 mm)"
            or "uniform(1 N m, 2 N m)". None: as the scene says under `study`.
        n: The number of Sobol points of each scrambling, a power of two.
        seed: Of the scramblings, by default 0: the same seed gives the same designs.
        threads: How many threads run designs; by default as many as the machine has processors.
        workers: How many processes Dask starts on this machine to run designs, instead of threads.
        scheduler: The address of a Dask scheduler whose workers run the designs.
        folder: A folder in which the designs that are done are kept, as in `sweep`.
        overrides: Changes of the scene beforehand, by dotted path.
        progress: Called with the number of designs done and the number of all.

    Returns:
        Indices of each measure with 95 % confidence intervals, and the measures' distributions (`statistics`). After
        Ctrl-C it has the scramblings that are complete.

    Raises:
        InputError: A path does not exist, has no distribution, or changes the equations; or fewer than 10 scramblings
            are complete.

    Example:
        >>> import bellcrank as bc
        >>> vary = {"crank_length": "normal(1.235 m, 2 mm)", "coupler_length": "normal(1.2 m, 0.1 mm)"}
        >>> found = bc.sobol_indices("four_bar", vary, n=4)
        >>> crank, coupler = found.indices("lock.crank").total
        >>> crank.value > 10.0 * coupler.value
        True
    """
    arguments.whole("n", n, least=2)
    done = sweep(
        scene, vary, sobol=n, seed=seed, overrides=overrides, threads=threads, workers=workers, scheduler=scheduler,
        folder=folder, progress=progress,
    )  # fmt: skip
    return done.sensitivity
