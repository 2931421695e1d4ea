"""The result of `synthesise`: linkages, their table, picture and files."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.cached_values import cached_property
from bellcrank.errors import InputError
from bellcrank.files.atomic_write import write_text, writing
from bellcrank.files.csv_files import write_table
from bellcrank.files.json_files import write_json
from bellcrank.notes import Note, ranked
from bellcrank.studies.synthesis.linkage import FourBar, file_texts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
SAME = 1e-6  # relative: linkages with errors this near are counted together
NEAR_LIMIT = 1e-4  # rad
LOW = math.radians(20.0)  # a transmission angle below which friction may jam a linkage


@dataclass(frozen=True, eq=False, kw_only=True)
class Synthesis:
    """The result of `synthesise`: linkages that are local optima, the best first.

    Attributes:
        points: The given points (n, 2), m.
        timing: The prescribed crank angles (n,), rad, of which the first is free; None where the order alone counts.
        least_transmission_angle: The limit, rad; 0 for none.
        seed: Of the search.
        linkages: The linkages.

    Example:
        >>> import bellcrank as bc, numpy as np
        >>> angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
        >>> found = bc.synthesise("four_bar", np.c_[np.cos(angles), 0.5 * np.sin(angles)], "30 deg")
        >>> found.rms_distance < 1e-3, found.best.assembles
        (True, True)
    """

    points: Array
    timing: Array | None
    least_transmission_angle: float
    seed: int
    linkages: tuple[FourBar, ...] = field(repr=False)

    def __repr__(self) -> str:
        return f"Synthesis(four_bar through {len(self.points)} points: RMS distance {self.rms_distance:.3g} m)"

    @property
    def best(self) -> FourBar:
        """The linkage whose coupler point passes nearest."""
        return self.linkages[0]

    @property
    def error(self) -> float:
        """The sum of the squared distances of the best linkage's coupler point from the points, m²."""
        return self.best.error

    @property
    def rms_distance(self) -> float:
        """The root of the mean squared distance, m."""
        return math.sqrt(self.error / len(self.points))

    @cached_property
    def notes(self) -> tuple[Note, ...]:
        """What to know about the result, what matters most first."""
        found = [
            Note(
                "each linkage is a local optimum among crank-rockers, and assembles at each of 720 angles of a turn; "
                "that there is no better one is not proved"
            )
        ]
        same = sum(abs(each.error - self.error) <= SAME * max(self.error, 1e-24) for each in self.linkages)
        if same > 1:
            found.append(Note(f"{same} linkages pass the points equally well; cognates trace the same curve"))
        angle, shown = self.best.transmission_angle, f"{math.degrees(self.best.transmission_angle):.4g} deg"
        if self.least_transmission_angle and angle <= self.least_transmission_angle + NEAR_LIMIT:
            found.append(Note(f"the transmission angle is at its limit, {shown}: a smaller one may bring it nearer"))
        elif angle < LOW:
            found.append(Note(f"the transmission angle falls to {shown}: the linkage may jam there", "changes"))
        if len(self.points) < (6 if self.timing is not None else 10):
            found.append(Note("so few points do not determine a linkage: many others pass them too"))
        return ranked(found)

    def table(self) -> str:
        """Format the linkages as text.

        Returns:
            One line a linkage, with units in the header.

        Example:
            >>> import bellcrank as bc
            >>> found = bc.synthesise("four_bar", [(0, 0), (1, 0.2), (1.5, 1), (1, 1.5), (0, 1)], "72 deg")
            >>> print(found.table().split("  ")[0])
            RMS distance [m]
        """
        head = ("RMS distance [m]", "ground [m]", "crank [m]", "coupler [m]", "rocker [m]", "transmission [deg]")
        lines = ["  ".join(head)]
        for each in self.linkages:
            rms = math.sqrt(each.error / len(self.points))
            numbers = (rms, each.ground, each.crank, each.coupler, each.rocker, math.degrees(each.transmission_angle))
            cells = (f"{value:.6g}" for value in numbers)
            lines.append("  ".join(f"{cell:>{len(title)}}" for cell, title in zip(cells, head, strict=True)))
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """The result as data for JSON.

        Returns:
            Lengths in m, angles in rad.

        Example:
            >>> import bellcrank as bc
            >>> found = bc.synthesise("four_bar", [(0, 0), (1, 0.2), (1.5, 1), (1, 1.5), (0, 1)], "72 deg")
            >>> found.as_dict()["linkage"]
            'four_bar'
        """
        return {
            "linkage": "four_bar",
            "status": "local optima were found",
            "points": self.points.tolist(),
            "timing": None if self.timing is None else self.timing.tolist(),
            "least_transmission_angle": self.least_transmission_angle,
            "seed": self.seed,
            "rms_distance": self.rms_distance,
            "linkages": [
                {**vars(each), "angles": each.angles.tolist(), "transmission_angle": each.transmission_angle}
                for each in self.linkages
            ],
            "notes": [note.to_dict() for note in self.notes],
        }

    def to_json(self, path: str | Path) -> Path:
        """Write `as_dict` as JSON.

        Args:
            path: The file, which is replaced in one step.

        Returns:
            Its path.

        Raises:
            InputError: The file cannot be written.

        Example:
            >>> import bellcrank as bc, pathlib, tempfile
            >>> found = bc.synthesise("four_bar", [(0, 0), (1, 0.2), (1.5, 1), (1, 1.5), (0, 1)], "72 deg")
            >>> found.to_json(pathlib.Path(tempfile.mkdtemp()) / "four_bar.json").name
            'four_bar.json'
        """
        return write_json(arguments.path("path", path, "the path of a file"), self.as_dict(), indent=2)

    def to_csv(self, path: str | Path) -> Path:
        """Write the given points, the crank angles of the best linkage and its coupler points as CSV.

        Args:
            path: The file, which is replaced in one step.

        Returns:
            Its path. The header names units.

        Raises:
            InputError: The file cannot be written.

        Example:
            >>> import bellcrank as bc, pathlib, tempfile
            >>> found = bc.synthesise("four_bar", [(0, 0), (1, 0.2), (1.5, 1), (1, 1.5), (0, 1)], "72 deg")
            >>> found.to_csv(pathlib.Path(tempfile.mkdtemp()) / "points.csv").read_text().split(",")[0]
            'x [m]'
        """
        labels = [("x", "m"), ("y", "m"), ("crank", "rad"), ("coupler point x", "m"), ("coupler point y", "m")]
        rows = np.c_[self.points, self.best.angles, self.best.path(self.best.angles)]
        return write_table(arguments.path("path", path, "the path of a file"), labels, [rows])

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw the best linkage at the first point, the curve of its coupler point, and the given points.

        Args:
            path: Where the picture is written (PNG); None: nowhere.

        Returns:
            A matplotlib figure.

        Raises:
            InputError: The file cannot be written.

        Example:
            >>> import bellcrank as bc
            >>> found = bc.synthesise("four_bar", [(0, 0), (1, 0.2), (1.5, 1), (1, 1.5), (0, 1)], "72 deg")
            >>> len(found.plot().axes)
            1
        """
        from bellcrank.plot_style import DPI, colour, new_figure, plain, save_figure

        best = self.best
        figure = new_figure(6.0, 5.0)
        axis = figure.subplots()
        axis.plot(*best.path(np.linspace(0.0, 2.0 * np.pi, 361)).T, color=colour(0), label="coupler point")
        end, tip = best.postures(best.angles[:1])
        pivot = complex(*best.pivot)
        corner = best.path(best.angles[:1]) @ np.array([1.0, 1.0j])
        bars = np.array([pivot, end[0], tip[0], pivot + best.ground * np.exp(1j * best.ground_angle)])
        axis.plot(bars.real, bars.imag, "o-", color="0.4", label="crank, coupler, rocker")
        plate = np.array([end[0], corner[0], tip[0]])
        axis.fill(plate.real, plate.imag, color="0.4", alpha=0.15)
        axis.plot(*self.points.T, "x", color=colour(1), label="given points")
        axis.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
        axis.legend(fontsize="small")
        plain(axis)
        if path is not None:
            with writing(arguments.path("path", path, "the path of a picture")) as temporary:
                save_figure(figure, temporary, "png", dpi=DPI)
        return figure

    def write_config(self, path: str | Path) -> Path:
        """Write the best linkage as a scene file, with its URDF beside it.

        In the scene the crank turns once, from the first point on; its output `point` is the coupler point.

        Args:
            path: The YAML file, which is replaced in one step; the URDF has the same name.

        Returns:
            The path of the YAML file.

        Raises:
            InputError: The path is no YAML file's, or a file cannot be written.

        Example:
            >>> import bellcrank as bc, pathlib, tempfile
            >>> found = bc.synthesise("four_bar", [(0, 0), (1, 0.2), (1.5, 1), (1, 1.5), (0, 1)], "72 deg")
            >>> scene = bc.load_scene(found.write_config(pathlib.Path(tempfile.mkdtemp()) / "linkage.yaml"))
            >>> list(scene.parameters)
            ['crank_length', 'coupler_length', 'rocker_length', 'ground_length']
        """
        target = arguments.path("path", path, "the path of a YAML file")
        if target.suffix.lower() not in (".yaml", ".yml"):
            raise InputError(f"{target}: expected the name of a YAML file, such as {target.stem or 'linkage'}.yaml")
        beside = target.with_suffix(".urdf")
        count = len(self.points)
        remark = (
            f"By bellcrank synthesise: a coupler point through {count} points, within {self.rms_distance:.6g} m (RMS)"
        )
        urdf, scene = file_texts(self.best, "Synthesised four-bar", beside.name, remark)
        write_text(beside, urdf)
        write_text(target, scene)
        return target
