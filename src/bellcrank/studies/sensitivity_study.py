"""`sobol_indices`: which parameters the spread of a scene's measures comes from."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bellcrank import arguments
from bellcrank.arguments import Progress
from bellcrank.robot.robot import Robot
from bellcrank.scene.scene import Scene
from bellcrank.studies.results.sensitivity import Sensitivity
from bellcrank.studies.sweep import sweep


@arguments.named
def sobol_indices(
    scene: Scene | Robot | str | Path,
    vary: Mapping[str, Any] | None = None,
    *,
    n: int = 64,
    seed: int | None = None,
    overrides: Mapping[str, Any] | None = None,
    threads: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    folder: str | Path | None = None,
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
        overrides: Changes of the scene beforehand, by dotted path.
        threads: How many threads run designs; by default as many as the machine has processors.
        workers: How many processes Dask starts on this machine to run designs, instead of threads.
        scheduler: The address of a Dask scheduler whose workers run the designs.
        folder: A folder in which the designs that are done are kept, as in `sweep`.
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
