"""`sweep`: a scene for many values of its parameters, without compiling anew."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from bellcrank import arguments
from bellcrank.errors import InputError
from bellcrank.memory import check_memory
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.simulation.checkpoints import KEEP_EVERY, check_keep_every
from bellcrank.studies.axes import Axis, read_axis
from bellcrank.studies.parallel_runs import ParallelRuns, RegularCall
from bellcrank.studies.sweep_result import Sweep

MOST_DESIGNS = 10**7
MOST_THREADS = 1024
DESIGN_BYTES = 3000  # of a design with its measures, of which a small scene has 35


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
    """Simulate a scene for all combinations of values of its parameters.

    Parameters are inputs of the compiled equations, so that nothing is compiled for a design; designs run in threads. A
    design that cannot be built, or whose run does not reach its target, is a row with its reason.

    Args:
        scene: A scene, or the path or name of a scene file.
        vary: Parameters of the scene, or other dotted paths such as "initial.crank" and "simulate.rtol", with their
            values: numbers in SI units, or texts such as "1 deg". Only what leaves the equations unchanged can be
            varied: parameters, the start and the solver's settings.
        overrides: Changes of the scene beforehand, by dotted path.
        threads: How many designs run at once; by default as many as the machine has processors.
        progress: Called with the number of designs done and the number of all.
        checking: Called before, with the number of values of an axis that are checked and the number of all.
        keep: Called with the sweep of the designs that are done about every `keep_every` s, such as to write it to a
            file; less often where that takes long.
        keep_every: s.

    Returns:
        One row a design. Ctrl-C ends the sweep and keeps the designs that are done (`complete` is then false).

    Raises:
        InputError: A path does not exist, accepts none of its values, or changes the equations.

    Example:
        >>> import bellcrank as bc
        >>> result = bc.sweep("four_bar", {"crank_length": [1.22, 1.23, 1.24]})
        >>> [design.status for design in result.designs]
        ['event', 'event', 'event']
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
    _check_count(math.prod(len(axis) for axis in axes))
    for axis in axes:
        _check(scene, axis, checking)
    check_keep_every(keep_every)
    runs = ParallelRuns(scene, axes, threads or len(os.sched_getaffinity(0)))
    return runs.run(progress, None if keep is None else RegularCall(keep, keep_every))


def _check_count(count: int) -> None:
    """Refuse a grid of more designs than can be kept, before any list of them is made (InputError)."""
    if count > MOST_DESIGNS:
        raise InputError(f"the grid has {count} designs, and a sweep takes at most {MOST_DESIGNS}; vary fewer values")
    check_memory(count, DESIGN_BYTES, "designs")


def _check(scene: Scene, axis: Axis, checking: Callable[[int, int], None] | None) -> None:
    """Refuse a path that accepts none of its values or changes the equations (InputError).

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
