"""`root_loci`: the eigenvalues of a scene over one of its numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from scipy.optimize import linear_sum_assignment

from bellcrank import arguments
from bellcrank.analysis.linearisation import Linearisation
from bellcrank.analysis.linearise import linearise
from bellcrank.analysis.modes import complex_text, pair
from bellcrank.arguments import Progress
from bellcrank.arrays import Array, Complex
from bellcrank.errors import InputError
from bellcrank.files.access import Trust
from bellcrank.notes import Note, ranked
from bellcrank.present.results import JsonLayout, Result
from bellcrank.present.tables import aligned
from bellcrank.scene.load import given_scene
from bellcrank.scene.scene import Scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bellcrank.robot.robot import Robot

MOST_VALUES = 10_000


@dataclass(frozen=True, eq=False, kw_only=True)
class RootLoci(Result):
    """The eigenvalues of a scene over one of its numbers. Made by `root_loci`.

    `to_csv` writes one row a value: the real and the imaginary part of each eigenvalue.

    Attributes:
        name: The scene's name.
        parameter: The number that is varied, by its path in the scene.
        values: Its values (n,), as given.
        linearisations: The linear equations at each value; None where there is no steady operating point.
        eigenvalues: (n, k) 1/s, each column followed from value to value; NaN where there is none.
        failures: (value, why) of the values without a steady operating point.

    Example:
        >>> import bellcrank as bc
        >>> found = bc.root_loci("pendulum", "gravity", [[0, -1.0, 0], [0, -4.0, 0]])
        >>> found.eigenvalues[:, 0].round(6).tolist()
        [1j, 2j]
    """

    name: str
    parameter: str
    values: tuple[Any, ...]
    linearisations: tuple[Linearisation | None, ...]
    eigenvalues: Complex
    failures: tuple[tuple[Any, str], ...]
    json_layout: ClassVar = JsonLayout(1, ascii_only=True)

    @property
    def numbers(self) -> Array:
        """The values (n,) as numbers, in their own unit; counted from 1 where they are none.

        Example:
            >>> import bellcrank as bc
            >>> bc.root_loci("pendulum", "initial.swing", [0.1, 0.2]).numbers.tolist()
            [0.1, 0.2]
        """
        parts = [str(value).split(maxsplit=1) if isinstance(value, str) else [value] for value in self.values]
        if len({part[1] if len(part) > 1 else "" for part in parts}) == 1:  # one unit
            try:
                return np.array([float(part[0]) for part in parts])
            except (TypeError, ValueError, IndexError):
                pass
        return np.arange(1.0, len(self.values) + 1.0)

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw the eigenvalues in the complex plane, and their real and imaginary parts over the number.

        Args:
            path: Where the picture is written, in the format of its suffix (PNG without one); None: nowhere.

        Returns:
            A matplotlib figure.

        Raises:
            InputError: Unknown picture format, or the file cannot be written.

        Example:
            >>> import bellcrank as bc
            >>> figure = bc.root_loci("pendulum", "initial.swing", [0.1, 0.2]).plot()
            >>> len(figure.axes)
            4
        """
        from bellcrank.analysis.root_locus_plot import plot_root_loci

        return plot_root_loci(self, arguments.picture(path))

    @property
    def notes(self) -> tuple[Note, ...]:
        """What the scene's files say and is not modelled, and the values without a steady operating point."""
        found = [note for linear in self.linearisations if linear is not None for note in linear.notes]
        return ranked([*found, *(f"{self.parameter} = {value}: {why}" for value, why in self.failures)])

    def table(self) -> str:
        """The eigenvalues at each value as text for a terminal.

        Returns:
            Lines of text.

        Example:
            >>> import bellcrank as bc
            >>> print(bc.root_loci("pendulum", "gravity", [[0, -1.0, 0], [0, -4.0, 0]]).table().splitlines()[0])
            Simple pendulum: eigenvalues over gravity
        """
        rows = [[self.parameter, "stable", "eigenvalues [1/s]"]]
        for value, linear, row in zip(self.values, self.linearisations, self.eigenvalues.tolist(), strict=True):
            stable = "-" if linear is None else "yes" if linear.stable else "no"
            shown = "none" if linear is None else ", ".join(complex_text(x) for x in row)
            rows.append([str(value), stable, shown])
        head = f"{self.name}: eigenvalues over {self.parameter}"
        return "\n".join([head, *aligned(rows), *(f"{note.label}: {note}" for note in self.notes)])

    def _rows(self) -> list[Sequence[object]]:
        titles = [f"{part} {k + 1} [1/s]" for k in range(self.eigenvalues.shape[1]) for part in ("Re", "Im")]
        table: list[Sequence[object]] = [[self.parameter, *titles]]
        for value, row in zip(self.values, self.eigenvalues, strict=True):
            cells = ["" if np.isnan(x) else x for each in row.tolist() for x in pair(each)]
            table.append([value if isinstance(value, (int, float)) else str(value), *cells])
        return table

    def as_dict(self) -> dict[str, Any]:
        """The result as data that JSON can hold.

        Returns:
            The values of the parameter, and the eigenvalues of each.

        Example:
            >>> import bellcrank as bc
            >>> bc.root_loci("pendulum", "initial.swing", [0.1, 0.2]).as_dict()["values"]
            [0.1, 0.2]
        """
        return {
            "name": self.name,
            "parameter": self.parameter,
            "values": [value if isinstance(value, str) else _plain(value) for value in self.values],
            "eigenvalues": [
                None if np.isnan(row).any() else [pair(x) for x in row.tolist()] for row in self.eigenvalues
            ],
            "stable": [None if found is None else found.stable for found in self.linearisations],
            "failures": [[_plain(value), why] for value, why in self.failures],
        }


@arguments.named
def root_loci(
    scene: Scene | Robot | str | Path,
    parameter: str,
    values: Sequence[Any],
    at: str | None = None,
    *,
    overrides: Mapping[str, Any] | None = None,
    trust: Trust = (),
    progress: Progress | None = None,
) -> RootLoci:
    """Linearise a scene for several values of one of its numbers.

    Symmetries are left out of the states, so that the number of eigenvalues is the same for every value.

    Args:
        scene: A scene or robot, or the path or name of its file.
        parameter: The number that is varied, by its path as in `Scene.with_overrides`: a parameter's name,
            "initial.velocity.wheel", ….
        values: Its values.
        at: The operating point, as in `linearise`: "equilibrium", "steady" or "start".
        overrides: Changes of the scene by dotted path, such as {"initial.crank": "1.5 deg"}.
        trust: Where `scene` is a file, folders whose files it may name, besides those near it.
        progress: Called with the number of values done and of all.

    Returns:
        The eigenvalues, followed from value to value.

    Raises:
        InputError: There is no such number, or no value has a steady operating point.

    Example:
        >>> import bellcrank as bc
        >>> found = bc.root_loci("spring_pendulum", "forces.spring.stiffness", [15.0, 60.0], at="equilibrium")
        >>> abs(found.eigenvalues).max(axis=1).round(4).tolist()
        [2.7386, 5.4772]
    """
    scene = given_scene(scene, overrides, trust)
    if not arguments.text("parameter", parameter, "the path of a number of the scene").isprintable():
        arguments.refuse("parameter", "the path of a number of the scene", parameter)
    listed = arguments.several("values", values, object, "values")
    if not 1 <= len(listed) <= MOST_VALUES:
        raise InputError(f"argument 'values': expected 1 to {MOST_VALUES} values, found {len(listed)}")
    if at is not None:
        arguments.one_of("at", at, ("start", "equilibrium", "steady"))
    if progress is not None:
        arguments.function("progress", progress, "a function of two numbers")
    found: list[Linearisation | None] = []
    failures: list[tuple[Any, str]] = []
    for k, value in enumerate(listed):
        try:
            changed = scene.with_overrides({parameter: value})
        except InputError as error:
            raise InputError(f"arguments 'parameter' and 'values': {error}") from None
        try:
            linear = linearise(changed, at, keep_symmetries=False)
            if not linear.steady:
                raise InputError(f"the operating point is not steady (residual {linear.residual:.2g})")
            found.append(linear)
        except InputError as error:
            found.append(None)
            failures.append((value, str(error)))
        if progress is not None:
            progress(k + 1, len(listed))
    if all(linear is None for linear in found):
        raise InputError(f"{parameter}: no value has a steady operating point; for {listed[0]}: {failures[0][1]}")
    return RootLoci(
        name=scene.name, parameter=parameter, values=listed, linearisations=tuple(found),
        eigenvalues=_followed([None if each is None else each.eigenvalues for each in found]), failures=tuple(failures),
    )  # fmt: skip


def _followed(rows: Sequence[Complex | None]) -> Complex:
    """The eigenvalues (n, k), each column continuing with the values nearest to it on the whole."""
    count = max(len(row) for row in rows if row is not None)
    table = np.full((len(rows), count), np.nan + 0j)
    last: Complex | None = None
    for k, row in enumerate(rows):
        if row is None:
            continue
        padded = np.concatenate([row, np.full(count - len(row), np.nan + 0j)])
        if last is None:
            order = np.argsort(-padded.imag, kind="stable")
            table[k] = padded[order]
        else:
            distance = np.abs(last[:, None] - padded[None])
            largest = np.nanmax(distance, initial=1.0)
            _, order = linear_sum_assignment(np.where(np.isnan(distance), 1e3 * largest, distance))
            table[k] = padded[order]
        last = table[k]
    return table


def _plain(value: Any) -> Any:
    return np.asarray(value).tolist() if not isinstance(value, (str, dict)) else value
