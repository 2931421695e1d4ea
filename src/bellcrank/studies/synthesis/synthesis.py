"""The result of `synthesise`: linkages, their table, picture and files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.atomic_write import write_text
from bellcrank.notes import Note, ranked
from bellcrank.present.results import Result
from bellcrank.present.tables import aligned
from bellcrank.studies.synthesis.linkage import WORDS, FourBar, SliderCrank
from bellcrank.studies.synthesis.scene_files import file_texts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SAME = 1e-6  # relative: linkages with errors this near are counted together
LONG = 0.99  # of the longest link over its limit
NEAR_LIMIT = 1e-4  # rad
# Lengths, angles and coordinates of a linkage with its coupler point, and numbers of a function's linkage with offsets.
NUMBERS, FUNCTION_NUMBERS = {"four_bar": 9, "slider_crank": 8, "stephenson": 15, "watt": 15}, 5
LOW = math.radians(20.0)  # a transmission angle below which friction may jam a linkage


@dataclass(frozen=True, eq=False, kw_only=True)
class Synthesis(Result):
    """The result of `synthesise`: linkages that are local optima, the best first.

    Attributes:
        linkage: "four_bar", "slider_crank", "stephenson" or "watt".
        points: The given points (n, 2), m; None where a function is given.
        timing: The prescribed crank angles (n,), rad, of which the first is free; None where the order alone counts.
        least_transmission_angle: The limit, rad; 0 for none.
        seed: Of the search.
        linkages: The linkages.
        directions: The coupler's given angles (n,) at the points, rad; None where they are free.
        function: The given crank angles, rad, and outputs (n, 2), rad of a rocker or m of a slider; None where points
            are given.
        longest: The limit of the links' lengths, m; None for none.

    Example:
        >>> import bellcrank as bc, numpy as np
        >>> angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
        >>> found = bc.synthesise("four_bar", np.c_[np.cos(angles), 0.5 * np.sin(angles)], "30 deg")
        >>> found.rms_distance < 1e-3, found.best.assembles
        (True, True)
    """

    points: Array | None
    timing: Array | None
    least_transmission_angle: float
    seed: int
    linkages: tuple[FourBar | SliderCrank, ...] = field(repr=False)
    directions: Array | None = None
    function: Array | None = None
    linkage: str = "four_bar"
    longest: float | None = None

    def __repr__(self) -> str:
        if self.function is not None:
            return f"Synthesis({self.linkage} with {self.count} outputs: RMS difference {self._shown})"
        return f"Synthesis({self.linkage} through {self.count} points: RMS distance {self._shown})"

    @property
    def _shown(self) -> str:
        """The RMS of the best linkage with its unit."""
        if self.function is None:
            return f"{self.rms_distance:.3g} m"
        rms = self.rms_output
        return f"{rms:.3g} m" if self.linkage == "slider_crank" else f"{math.degrees(rms):.3g} deg"

    @property
    def best(self) -> FourBar | SliderCrank:
        """The linkage with the least error."""
        return self.linkages[0]

    @property
    def count(self) -> int:
        """How many points or pairs are given."""
        return len(self.best.angles)

    @property
    def error(self) -> float:
        """The sum of the squared distances of the best linkage's coupler point from the points, m²; or of the squared
        differences of its output from a function, rad² or m².
        """
        return self.best.error

    @property
    def rms_distance(self) -> float:
        """The root of the mean squared distance, m. A function has none: a BellcrankError."""
        if self.function is not None:
            raise BellcrankError("rms_distance: a function is given, and no points; use rms_output")
        return math.sqrt(self.error / self.count)

    @property
    def rms_output(self) -> float:
        """The root of the mean squared difference of the output from the function, rad of a rocker or m of a slider.
        Points have none: a BellcrankError.
        """
        if self.function is None:
            raise BellcrankError("rms_output: points are given, and no function; use rms_distance")
        return math.sqrt(self.error / self.count)

    @property
    def rms_turn(self) -> float:
        """The root of the mean squared angle of the best linkage's coupler from given directions, rad; 0 without."""
        return math.sqrt(self.best.turn_error / self.count)

    def output_differences(self, linkage: int = 0) -> Array:
        """The differences of the output from the function.

        Args:
            linkage: The place among `linkages`, from 0, the best one.

        Returns:
            (n,) at the given crank angles, rad of a rocker or m of a slider.

        Raises:
            BellcrankError: Points are given, and no function.
            InputError: There is no such linkage.

        Example:
            >>> import bellcrank as bc, numpy as np
            >>> crank = np.linspace(0.0, 1.0, 9)
            >>> found = bc.synthesise("four_bar", function=np.c_[crank, 0.5 * crank**2])
            >>> bool(abs(found.output_differences()).max() < 1e-3)
            True
        """
        if self.function is None:
            raise BellcrankError("output_differences: points are given, and no function")
        chosen = self.linkages[arguments.whole("linkage", linkage, least=0, most=len(self.linkages) - 1)]
        found = chosen.output(chosen.angles) - self.function[:, 1]
        return found if self.linkage == "slider_crank" else np.angle(np.exp(1j * found))

    @cached_property
    def notes(self) -> tuple[Note, ...]:
        """What to know about the result, what matters most first."""
        function = self.function is not None
        kind = "crank-rockers" if self.linkage == "four_bar" and not function else f"{WORDS[self.linkage]}s"
        where = "the given range of the crank" if self.best.of_range else "a turn"
        found = [
            Note(
                f"each linkage is a local optimum among {kind}, and assembles at each of 720 angles of {where}; "
                "that there is no better one is not proved"
            )
        ]
        if not self.best.turns_fully:
            found.append(
                Note("the crank does not turn fully: assembly and transmission are those of its given range", "changes")
            )
        same = sum(abs(each.error - self.error) <= SAME * max(self.error, 1e-24) for each in self.linkages)
        if same > 1 and self.directions is None and not function:
            cognates = "; cognates trace the same curve" if self.linkage == "four_bar" else ""
            found.append(Note(f"{same} linkages pass the points equally well{cognates}"))
        angle, shown = self.best.transmission_angle, f"{math.degrees(self.best.transmission_angle):.4g} deg"
        if self.least_transmission_angle and angle <= self.least_transmission_angle + NEAR_LIMIT:
            found.append(Note(f"the transmission angle is at its limit, {shown}: a smaller one may bring it nearer"))
        elif angle < LOW:
            found.append(Note(f"the transmission angle falls to {shown}: the linkage may jam there", "changes"))
        if self.longest is not None:
            links = max(self.best.crank, *map(abs, self.best.lengths.values()))
            if links > LONG * self.longest:
                limited = f"the longest link, {links:.4g} m, is at its limit, where the search stops"
                found.append(Note(f"{limited}: a larger one may bring it nearer"))
        if self.count < self._determined:
            given = "have that function" if function else "pass them"
            found.append(Note(f"so few points do not determine a linkage: many others {given} too"))
        return ranked(found)

    @property
    def _determined(self) -> int:
        """So many points or pairs have more numbers than a linkage: a function's pair has one; a point has 2, with its
        direction 3, less one where its crank angle is free. The first crank angle and the coupler's turn are numbers of
        a linkage too.
        """
        if self.function is not None:
            return FUNCTION_NUMBERS + 1
        more = (self.timing is not None) + (self.directions is not None)
        return (NUMBERS[self.linkage] + more) // (1 + more) + 1

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
        lines: list[list[str]] = []
        for k, each in enumerate(self.linkages):
            row = self._errors(k) | {f"{name} [m]": value for name, value in each.lengths.items()}
            row["transmission [deg]"] = math.degrees(each.transmission_angle)
            if not lines:
                lines.append(list(row))
            lines.append([f"{value:.6g}" for value in row.values()])
        return "\n".join(aligned(lines, ()))

    def _errors(self, place: int) -> dict[str, float]:
        """How far a linkage is off, by the titles of columns."""
        linkage = self.linkages[place]
        rms = math.sqrt(linkage.error / self.count)
        if self.function is None:
            turn = math.degrees(math.sqrt(linkage.turn_error / self.count))
            return {"RMS distance [m]": rms} | ({} if self.directions is None else {"RMS turn [deg]": turn})
        largest = float(np.abs(self.output_differences(place)).max())
        if self.linkage == "slider_crank":
            return {"RMS difference [m]": rms, "largest [m]": largest}
        return {"RMS difference [deg]": math.degrees(rms), "largest [deg]": math.degrees(largest)}

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
            "linkage": self.linkage,
            "status": "local optima were found",
            "points": None if self.points is None else self.points.tolist(),
            "function": None if self.function is None else self.function.tolist(),
            "timing": None if self.timing is None else self.timing.tolist(),
            "directions": None if self.directions is None else self.directions.tolist(),
            "rms_turn": None if self.directions is None else self.rms_turn,
            "least_transmission_angle": self.least_transmission_angle,
            "longest": self.longest,
            "seed": self.seed,
            "rms_distance": None if self.points is None else self.rms_distance,
            "rms_output": None if self.function is None else self.rms_output,
            "linkages": [
                vars(each)
                | {"angles": each.angles.tolist(), "transmission_angle": each.transmission_angle}
                | {"turns_fully": each.turns_fully}
                for each in self.linkages
            ],
            "notes": [note.as_dict() for note in self.notes],
        }

    def _rows(self) -> list[Sequence[object]]:
        best = self.best
        if self.function is not None:
            name, unit = ("slider", "m") if self.linkage == "slider_crank" else ("rocker", "rad")
            labels = [("crank", "rad"), (name, unit), (f"{name} of the linkage", unit), ("crank from ground", "rad")]
            rows = np.c_[self.function, self.function[:, 1] + self.output_differences(), best.angles]
        else:
            assert self.points is not None
            labels = [("x", "m"), ("y", "m"), ("crank", "rad"), ("coupler point x", "m"), ("coupler point y", "m")]
            rows = np.c_[self.points, best.angles, best.path(best.angles)]
        if self.directions is not None:
            labels += [("coupler", "rad"), ("coupler turn", "rad")]
            rows = np.c_[rows, self.directions, np.unwrap(np.angle(best.directions(best.angles)))]
        return [[f"{name} [{unit}]" for name, unit in labels], *rows.tolist()]

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw the best linkage at the first point, the curve of its coupler point, and the given points; or its output
        and the function.

        Args:
            path: Where the picture is written, in the format of its suffix (PNG without one); None: nowhere.

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
        from bellcrank.present.plot_style import new_figure, write_figure
        from bellcrank.studies.synthesis.linkage_plot import draw_function, draw_linkage

        figure = new_figure(10.0 if self.function is not None else 6.0, 5.0)
        axes = figure.subplots(1, 1 if self.function is None else 2, squeeze=False)[0]
        draw_linkage(axes[0], self.best, self.points)
        if self.function is not None:
            draw_function(axes[1], self.best, self.function, self.output_differences())
        return write_figure(figure, path)

    def write_config(self, path: str | Path) -> Path:
        """Write the best linkage as a scene file, with its URDF beside it.

        In the scene the crank turns once, from the first point on; its output `point` is the coupler point. Where a
        function is given, the crank turns through its range, and the positions of the joints `crank` and `rocker` or
        `slider` are input and output of the function (an angle up to whole turns).

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
        if self.function is None:
            done = f"a coupler point through {self.count} points, within {self.rms_distance:.6g} m (RMS)"
        else:
            done = f"a function of the crank's angle by {self.count} pairs, within {self._shown} (RMS)"
        name = f"Synthesised {WORDS[self.linkage]}"
        remark = f"By bellcrank synthesise: {done}"
        urdf, scene = file_texts(self.best, self.function is not None, name, beside.name, remark)
        write_text(beside, urdf)
        write_text(target, scene)
        return target
