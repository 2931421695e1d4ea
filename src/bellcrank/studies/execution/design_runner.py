"""What a study does with each design: the protocol that simulation and sizing of many designs share."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Protocol

from bellcrank.arrays import Array, Indices
from bellcrank.codegen import cache as disk
from bellcrank.dynamics.postures.consistent_start import NoConsistentStart
from bellcrank.studies.results.study_columns import StudyColumns

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene


def infeasible_reason(error: Exception, scene: Scene) -> str:
    """The message of an error without the scene's file, and other files beside it without their folder; of a start that
    cannot be, without its diagnosis, so that designs that are made together and alone have the same reason.
    """
    text = error.brief if isinstance(error, NoConsistentStart) else str(error)
    return text.replace(f"{scene.source}: ", "").replace(f"{scene.source.parent}{os.sep}", "")


class StudyInterrupted(KeyboardInterrupt):
    """Ctrl-C ended a run of designs; those that are done are kept.

    Attributes:
        rows: (k,) the designs that are done, increasing, as numbers of the rows of `values`.
        columns: Their results, k rows.
    """

    def __init__(self, rows: Indices, columns: StudyColumns) -> None:
        super().__init__()
        self.rows, self.columns = rows, columns


class DesignRunner(Protocol):
    """Computes the measures of designs. It can be pickled, so that other processes and machines can run it."""

    @property
    def units(self) -> Mapping[str, str]:
        """Every measure by name with its unit, in the order of columns; known before any design is run."""
        ...

    @property
    def default_measures(self) -> tuple[str, ...]:
        """The measures that tables and plots show if they vary, the most telling first."""
        ...

    @property
    def noise(self) -> tuple[float, float]:
        """Differences of a measure up to absolute + relative × its magnitude are errors of the computation."""
        ...

    @property
    def identity(self) -> Mapping[str, str]:
        """What the results depend on, by a name that a user understands: scene, files, settings, version, lane width.

        Results of two runners may be mixed only where these are equal.
        """
        ...

    def run(self, values: Array, *, threads: int = 1, progress: Callable[[int], object] | None = None) -> StudyColumns:
        """The columns of designs whose values (n, axes) are given in the units of the axes.

        A row depends on its own values alone, to the last bit: not on its neighbours or on `threads`. A design that
        cannot be built is a row "infeasible" with its reason. `progress` is called with the number of designs done, at
        least every second; it may raise KeyboardInterrupt.
        Raises StudyInterrupted on Ctrl-C, with the designs that are done.
        """
        ...


def scene_identity(scene: Scene) -> dict[str, str]:
    """What the results of all designs of a scene depend on, by a name that a user understands."""
    return {
        "scene": f"{scene.name} ({disk.digest(repr(scene.data))[:12]})",
        "files of the scene": disk.digest(repr(sorted(scene.files.items())))[:12],
        "robot": f"{scene.robot.urdf.name} ({disk.digest(scene.robot.key)[:12]})",
    }
