"""`synthesise`: the links of a four-bar whose coupler passes given points."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.actuators.catalogue_columns import Column
from bellcrank.actuators.catalogue_tables import number, read_table
from bellcrank.actuators.row_checks import Range
from bellcrank.config.fields import parse_number
from bellcrank.errors import BellcrankError, InputError
from bellcrank.studies.samples import LARGEST_SEED
from bellcrank.studies.synthesis.four_bar import fit, lengths_of
from bellcrank.studies.synthesis.linkage import four_bar
from bellcrank.studies.synthesis.path_search import search
from bellcrank.studies.synthesis.synthesis import Synthesis

Array = NDArray[np.float64]
LINKAGES = ("four_bar",)
LEAST_POINTS, MOST_POINTS = 4, 500
FURTHEST, ALIKE = 1e9, 1e-9  # m; of the latter also a share of the distance from the origin
KEPT = 8  # linkages in the result
AT_LIMIT = 1e-6  # rad
TURN = 2.0 * np.pi


@arguments.named
def synthesise(
    linkage: str,
    points: Any,
    timing: Any = None,
    *,
    transmission_angle: float | str = "30 deg",
    seed: int = 0,
    progress: Callable[[float], object] | None = None,
) -> Synthesis:
    """Find four-bars whose coupler point passes given points, in their order.

    The linkages are crank-rockers whose crank turns fully; they assemble at each angle of it and stay on one branch.
    The placement and the coupler point follow by linear least squares; the shape, and the crank's angles where they are
    not prescribed, by a global search with Sobol points and local searches from the best of them.

    Args:
        linkage: "four_bar".
        points: (n, 2) points x, y in m, in the order in which the coupler passes them: 4 to 500.
        timing: The crank's angle from one point to the next, in rad or as "20 deg"; or the angles (n,) at the points,
            rad, up to a common one. Negative: clockwise. None: the angles are free, in their order within one turn.
        transmission_angle: The least angle between coupler and rocker, in rad or as "30 deg"; 0 switches it off.
        seed: Of the Sobol points. The same seed gives the same result.
        progress: Called with the share that is done, 0 to 1.

    Returns:
        The linkages that were found, the best first.

    Raises:
        InputError: An argument is not as expected.
        BellcrankError: No linkage was found that passes the points in their order.

    Example:
        >>> import bellcrank as bc, numpy as np
        >>> angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
        >>> found = bc.synthesise("four_bar", np.c_[np.cos(angles), 0.5 * np.sin(angles)], "30 deg")
        >>> found.best.assembles, round(np.rad2deg(found.best.transmission_angle)) >= 30
        (True, True)
    """
    arguments.one_of("linkage", linkage, LINKAGES)
    given = arguments.array("points", points, (None, 2), "m")
    if not LEAST_POINTS <= len(given) <= MOST_POINTS:
        raise InputError(f"argument 'points': expected {LEAST_POINTS} to {MOST_POINTS} points, found {len(given)}")
    given, furthest = np.array(given), float(np.abs(given).max())
    if furthest > FURTHEST:
        raise InputError(f"argument 'points': expected coordinates up to {FURTHEST:g} m, found {furthest:g} m")
    plane = given @ np.array([1.0, 1.0j])
    centre = complex(plane.mean())
    size = float(np.sqrt((np.abs(plane - centre) ** 2).mean()))
    if size <= ALIKE * max(1.0, furthest):
        raise InputError(
            f"argument 'points': expected points that differ by more than {ALIKE * max(1.0, furthest):.3g} m, found "
            f"{size:.3g} m; where they are far from the origin, rounding hides smaller differences"
        )
    angles = _angles(timing, len(given))
    least = _angle("transmission_angle", transmission_angle)
    if not 0.0 <= least < 0.5 * np.pi:
        arguments.refuse("transmission_angle", "an angle from 0 to less than 90 deg", transmission_angle)
    seed = arguments.whole("seed", seed, least=0, most=LARGEST_SEED)
    if progress is not None:
        arguments.function("progress", progress)
    found = search((plane - centre) / size, angles, least, seed, progress or (lambda share: None))
    placed = fit(found.shape, found.crank, found.branch, (plane - centre) / size, least, slopes=False).placement
    links = lengths_of(found.shape, least).links
    linkages = [
        four_bar(links[k], float(found.branch[k]), placed[k], found.crank[k], centre, size, plane)
        for k in range(len(found))
    ]
    good = [each for each in linkages if each.assembles and each.transmission_angle >= least - AT_LIMIT][:KEPT]
    if not good:
        raise BellcrankError("synthesise: no four-bar was found that passes the points in their order")
    return Synthesis(points=given, timing=angles, least_transmission_angle=least, seed=seed, linkages=tuple(good))


def read_points(file: Path) -> tuple[Array, Array | None]:
    """Points (n, 2), m, and crank angles (n,), rad, where there are some, of a CSV file with the columns "x [m]",
    "y [m]" and "crank [deg]". Raises InputError.
    """
    table = read_table(file, "a header 'x [m],y [m]' and rows of points")
    columns = {
        name: Column(name, name, unit, Range(above=None)) for name, unit in (("x", "m"), ("y", "m"), ("crank", "rad"))
    }
    headers = {header.column.name: header for header in table.headers(columns)}
    for name in ("x", "y"):
        if name not in headers:
            raise InputError(f"{file}: line {table.line}: there is no column '{name} [m]'")
    found = np.full((len(table.rows), len(headers)), np.nan)
    for k, row in enumerate(table.rows):
        for j, header in enumerate(headers.values()):
            if (value := number(row, header)) is None:
                raise row.error(header.title, "expected a number, found an empty cell")
            found[k, j] = value
    own = dict(zip(headers, found.T, strict=True))
    return np.stack([own["x"], own["y"]], axis=1), own.get("crank")


def _angle(name: str, value: object) -> float:
    try:
        if isinstance(value, str) or arguments.is_number(value):
            return parse_number(value, "rad")
    except ValueError:
        pass
    arguments.refuse(name, "an angle in rad, or a text such as '30 deg'", value)


def _angles(timing: object, count: int) -> Array | None:
    """Crank angles (count,) from 0 on; None where they are free. Raises InputError."""
    if timing is None:
        return None
    if isinstance(timing, str) or arguments.is_number(timing):
        step = _angle("timing", timing)
        angles = float(np.clip(step, -TURN, TURN)) * np.arange(count)
    else:
        angles = np.array(arguments.array("timing", timing, (count,), "rad"))
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.diff(angles)
    if not ((steps > 0.0).all() or (steps < 0.0).all()) or not abs(angles[-1] - angles[0]) < TURN:
        raise InputError(
            "argument 'timing': expected angles that rise, or fall, and stay within one turn, found "
            f"{np.rad2deg(angles[0]):.6g} to {np.rad2deg(angles[-1]):.6g} deg"
        )
    return np.asarray(angles - angles[0])
