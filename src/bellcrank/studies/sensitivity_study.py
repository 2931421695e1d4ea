"""Designs for Sobol indices, their simulation, and `sobol_indices`."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bellcrank import arguments
from bellcrank.errors import InputError
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.studies.axes import read_axis
from bellcrank.studies.design_runner import DesignRunner
from bellcrank.studies.design_space import DesignSpace
from bellcrank.studies.intervals import LEAST_REPLICATES
from bellcrank.studies.local_execution import LocalExecutor
from bellcrank.studies.samples import LARGEST_SEED
from bellcrank.studies.sensitivity import Sensitivity
from bellcrank.studies.sensitivity_sample import REPLICATES, SensitivitySample
from bellcrank.studies.simulation_runner import SimulationRunner
from bellcrank.studies.study import StudyRun, run_study

MOST_THREADS = 1024


def sobol_indices(
    scene: Scene | str | Path,
    vary: Mapping[str, Any],
    *,
    n: int = 64,
    replicates: int = REPLICATES,
    seed: int = 0,
    overrides: Mapping[str, Any] | None = None,
    threads: int | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Sensitivity:
    """Find which parameters the spread of a scene's measures comes from.

    The first-order index of a parameter is the share of a measure's variance that it explains by itself, the total
    index the share with all interactions. The parameters are independent. `replicates` · n · (parameters + 2) designs
    are simulated (A. Saltelli et al., Comput. Phys. Commun. 181 (2010) 259-270); independent scramblings of the Sobol
    points give the errors.

    Args:
        scene: A scene, or the path or name of a scene file.
        vary: Parameters of the scene, or other dotted paths, with their distributions, such as "normal(1.24 m, 1 mm)"
            or "uniform(1 N m, 2 N m)".
        n: The number of Sobol points of each scrambling, a power of two.
        replicates: The number of independent scramblings, at least 10.
        seed: Of the scramblings: the same seed gives the same designs.
        overrides: Changes of the scene beforehand, by dotted path.
        threads: How many designs run at once; by default as many as the machine has processors.
        progress: Called with the number of designs done and the number of all.

    Returns:
        Indices of each measure with 95 % confidence intervals, and the measures' distributions (`statistics`). After
        Ctrl-C it has the scramblings that are complete.

    Raises:
        InputError: A path does not exist, has no distribution, or changes the equations.

    Example:
        >>> import bellcrank as bc
        >>> vary = {"crank_length": "normal(1.24 m, 1 mm)", "preload": "normal(1.96 N m, 0.02 N m)"}
        >>> found = bc.sobol_indices("four_bar", vary, n=16)
        >>> found.indices("lock.crank").total[0].value > 0.99
        True
    """
    if not isinstance(scene, Scene):
        scene = load_scene(arguments.subject("scene", scene, "a scene"))
    if overrides is not None:
        scene = scene.with_overrides(overrides)
    space = sensitivity_space(scene, vary, n=n, replicates=replicates, seed=seed)
    if threads is not None:
        threads = arguments.whole("threads", threads, least=1, most=MOST_THREADS)
    if progress is not None:
        arguments.function("progress", progress)
    runner = SimulationRunner(scene, space.axes)
    run = run_study(space, runner, LocalExecutor(threads or len(os.sched_getaffinity(0))), progress=progress)
    return sensitivity(scene.name, space, runner, run)


def sensitivity_space(
    scene: Scene, vary: Mapping[str, Any], *, n: int, replicates: int = REPLICATES, seed: int = 0
) -> DesignSpace:
    """The designs that Sobol indices need. Raises InputError for wrong arguments and an axis without a distribution."""
    vary = arguments.mapping("vary", vary, "a mapping of parameters to their distributions")
    if not vary:
        raise InputError(f"Sobol indices of {scene.name}: expected at least one parameter to vary, found none")
    axes = tuple(read_axis(scene, path, given) for path, given in vary.items())
    for axis in axes:
        if axis.distribution is None:
            raise InputError(
                f"Sobol indices of {scene.name}: '{axis.path}' has values and no distribution; write one such as "
                "normal(1.24 m, 1 mm)"
            )
    seed = arguments.whole("seed", seed, least=0, most=LARGEST_SEED)
    n, replicates = arguments.whole("n", n), arguments.whole("replicates", replicates)
    return DesignSpace(axes, SensitivitySample(len(axes), n, replicates, seed))


def sensitivity(title: str, space: DesignSpace, runner: DesignRunner, run: StudyRun) -> Sensitivity:
    """The result of a study of `sensitivity_space`, with the scramblings that are complete.

    Raises:
        KeyboardInterrupt: The study was interrupted before enough scramblings were complete.
    """
    sample, columns = space.sample, run.columns
    assert isinstance(sample, SensitivitySample)
    if not run.complete:
        done = np.zeros(sample.count, dtype=np.intp)
        done[run.designs] = 1
        whole = np.flatnonzero(done.reshape(sample.replicates, -1).all(axis=1))
        if len(whole) < LEAST_REPLICATES:
            raise KeyboardInterrupt
        each = sample.size * sample.block
        columns = columns.take((np.cumsum(done) - 1)[(whole[:, None] * each + np.arange(each)).ravel()])
        sample = SensitivitySample(sample.dimensions, sample.size, len(whole), sample.seed)
    return Sensitivity(
        title=title,
        axes=space.axes,
        units=runner.units,
        columns=columns,
        sample=sample,
        candidates=runner.default_measures,
        noise=runner.noise,
    )
