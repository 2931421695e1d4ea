"""`synthesise`: the links of a linkage whose coupler passes given points or takes given poses, or whose output is a
given function of the crank's angle.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.arguments import PROGRESS, Progress
from bellcrank.arrays import Array, Complex
from bellcrank.config.fields import parse_number
from bellcrank.errors import BellcrankError, InputError
from bellcrank.studies.designs.samples import LARGEST_SEED
from bellcrank.studies.synthesis.four_bar import CrankRockers, FourBarsOverRange
from bellcrank.studies.synthesis.linkage import WORDS, FourBar, SixBar, SliderCrank
from bellcrank.studies.synthesis.path_search import search
from bellcrank.studies.synthesis.placement import FunctionTask, PointTask
from bellcrank.studies.synthesis.six_bar import SixBars
from bellcrank.studies.synthesis.slider_crank import SliderCranks
from bellcrank.studies.synthesis.synthesis import Synthesis

LEAST_POINTS, MOST_POINTS = 4, 500
FURTHEST, ALIKE = 1e9, 1e-9  # m; of the latter also a share of the distance from the origin
KEPT = 8  # linkages in the result
LONGEST = 20.0  # of a six-bar's links over the RMS distance of the points from their mean, without another limit
AT_LIMIT = 1e-6  # rad
SLOW = 1e-4  # of lengths, and of angles in rad
TURN = 2.0 * np.pi


@arguments.named
def synthesise(
    linkage: str,
    points: Any = None,
    timing: Any = None,
    *,
    directions: Any = None,
    function: Any = None,
    transmission_angle: float | str = "30 deg",
    longest: float | str | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Synthesis:
    """Find linkages whose coupler point passes given points, in their order, or whose output is a given function.

    Four-bars that pass points are crank-rockers, and so are those in six-bars, which carry a dyad from the coupler to
    the ground (Stephenson III) or to the rocker (Watt I); the crank of each slider-crank turns fully. They assemble at
    each angle of it and stay on one branch. Four-bars whose rocker's angle is a function of the crank's angle assemble
    in the given range of the crank on one branch; whether it turns fully is said. What is linear, such as the placement
    and the coupler point, follows by linear least squares; the shape, and the crank's angles where they are not
    prescribed, by a global search with Sobol points and local searches from the best of them.

    Args:
        linkage: "four_bar", "slider_crank", "stephenson" (Stephenson III) or "watt" (Watt I).
        points: (n, 2) points x, y in m, in the order in which the coupler passes them: 4 to 500. None: see `function`.
        timing: The crank's angle from one point to the next, in rad or as "20 deg"; or the angles (n,) at the points,
            rad, up to a common one. Negative: clockwise. None: the angles are free, in their order within one turn.
        directions: The coupler's angles (n,) at the points, rad, to a common one: its poses are then given (motion
            generation). An error of 1 rad counts as one of the RMS distance of the points from their mean. None: free.
        function: (n, 2) pairs of a crank angle, rad, and the output there: the rocker's angle, rad, or the slider's
            position, m; 4 to 500 (function generation). Both are up to common offsets, which are found. A four-bar of
            any scale has the same function: its ground is 1 m. Crank angles rise or fall within one turn.
        transmission_angle: The least angle between coupler and rocker, or between coupler and the normal of the
            slider's guide, in rad or as "30 deg"; of six-bars that of the dyad's links too. 0 switches it off.
        longest: The largest length of a link, m or as "800 mm"; also of a slider-crank's offset. Not for functions.
            None: of six-bars 20 times the RMS distance of the points from their mean, of others no limit.
        seed: Of the Sobol points. The same seed gives the same result.
        progress: Called with the share that is done, 0 to 1, and 1.

    Returns:
        The linkages that were found, the best first.

    Raises:
        InputError: An argument is not as expected.
        BellcrankError: No linkage was found that passes the points in their order, or has the function.

    Example:
        >>> import bellcrank as bc, numpy as np
        >>> angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
        >>> found = bc.synthesise("four_bar", np.c_[np.cos(angles), 0.5 * np.sin(angles)], "30 deg")
        >>> found.best.assembles, round(np.rad2deg(found.best.transmission_angle)) >= 30
        (True, True)
    """
    arguments.one_of("linkage", linkage, tuple(WORDS))
    if function is None and points is None:
        raise InputError("argument 'points': expected points, or argument 'function', found neither")
    others = {"points": points, "timing": timing, "directions": directions, "longest": longest}
    given = [f"'{name}'" for name, value in others.items() if value is not None]
    if function is not None and given:
        raise InputError(f"argument 'function': it cannot be combined with {given[0]}; give one of them")
    if function is not None and linkage in ("stephenson", "watt"):
        raise InputError(f"argument 'function': it is for four_bar and slider_crank, found linkage '{linkage}'")
    least = _angle("transmission_angle", transmission_angle)
    if not 0.0 <= least < 0.5 * np.pi:
        arguments.refuse("transmission_angle", "an angle from 0 to less than 90 deg", transmission_angle)
    seed = arguments.whole("seed", seed, least=0, most=LARGEST_SEED)
    told = None if progress is None else arguments.function("progress", progress, PROGRESS)
    report = (lambda share: None) if told is None else lambda share: told(share, 1.0)
    if function is not None:
        return _of_function(linkage, _pairs(function, linkage), least, seed, report)
    places = _numbered("points", points)
    plane, centre, size = _scaled(places)
    angles = _angles(timing, len(places))
    turned = None if directions is None else _directions(directions, len(places))
    ways = None if turned is None else np.exp(1j * turned)
    kind = _kind(linkage, least)
    limit = (LONGEST * size if isinstance(kind, SixBars) else np.inf) if longest is None else _length(longest)
    task = PointTask(kind, (plane - centre) / size, ways, limit / size)
    found = search(task, angles, seed, report)
    placed = task.fit(found.shape, found.crank, found.branch, slopes=False).placement
    ratios = kind.ratios(found.shape, found.branch)
    linkages = []
    for k in range(len(found)):
        pivot, crank, coupler = centre + size * placed[k, 0], size * placed[k, 1], size * placed[k, 2]
        length, direction = float(abs(crank)), crank / abs(crank)
        point = coupler / direction  # the coupler's angle is measured from the ground
        own = _linkage(
            ratios[k], length, float(found.branch[k]), angles=found.crank[k],
            pivot=(float(pivot.real), float(pivot.imag)), ground_angle=float(np.angle(direction)),
            point=(float(point.real), float(point.imag)),
        )  # fmt: skip
        if isinstance(kind, SixBars):
            own = _six_bar(kind, own, found.shape[k], ratios[k])
        linkages.append(_with_errors(own, plane, ways))
    good = _good(linkages, least)
    if not good:
        within = "" if limit == np.inf else f" with links of at most {limit:.4g} m"
        raise BellcrankError(f"synthesise: no {WORDS[linkage]}{within} was found that passes the points in their order")
    if ways is not None:
        good.sort(key=lambda each: each.error + size**2 * each.turn_error)
    return Synthesis(
        points=places, timing=angles, least_transmission_angle=least, seed=seed, linkages=tuple(good),
        directions=turned, linkage=linkage, longest=None if limit == np.inf else limit,
    )  # fmt: skip


def _of_function(linkage: str, pairs: Array, least: float, seed: int, report: Callable[[float], object]) -> Synthesis:
    """Linkages whose output is a function."""
    slider = linkage == "slider_crank"
    centre, size = (float(pairs[:, 1].mean()), float(pairs[:, 1].std())) if slider else (0.0, 1.0)
    kind = SliderCranks(least) if slider else FourBarsOverRange(least)
    task = FunctionTask(kind, (pairs[:, 1] - centre) / size)
    found = search(task, pairs[:, 0] - pairs[0, 0], seed, report)
    placed = task.fit(found.shape, found.crank, found.branch, slopes=False).placement
    ratios = (
        kind.ratios(found.shape, found.branch)
        if isinstance(kind, SliderCranks)
        else kind.links(found.shape, found.crank)[0]
    )
    linkages = []
    for k in range(len(found)):
        angles, ratio = found.crank[k], ratios[k]
        if slider:
            length, branch, offset = float(size * placed[k, 1]), 1.0, -(centre + float(size * placed[k, 0]))
            if length < 0.0:  # the same linkage, turned by half a turn: the slider is behind the crank's end
                angles, length, branch, ratio = angles + np.pi, -length, -1.0, ratio * [1.0, -1.0]
        else:
            length, branch, offset = float(1.0 / ratio[0]), float(found.branch[k]), float(placed[k, 0])
        own = _linkage(
            ratio, length, branch, angles=angles, pivot=(0.0, 0.0), ground_angle=0.0,
            input_offset=float(angles[0] - pairs[0, 0]), output_offset=offset, of_range=not slider,
        )  # fmt: skip
        gaps = own.output(angles) - pairs[:, 1]
        gaps = gaps if slider else np.angle(np.exp(1j * gaps))
        linkages.append(replace(own, error=float((gaps**2).sum())))
    good = sorted(_good(linkages, least), key=lambda each: each.error)
    if not good:
        raise BellcrankError(f"synthesise: no {WORDS[linkage]} was found that assembles in the range of the function")
    return Synthesis(
        points=None, timing=None, least_transmission_angle=least, seed=seed, linkages=tuple(good), function=pairs,
        linkage=linkage,
    )  # fmt: skip


def _kind(linkage: str, least: float) -> CrankRockers | SliderCranks | SixBars:
    """The kind of a linkage that passes points."""
    if linkage == "four_bar":
        return CrankRockers(least)
    return SliderCranks(least) if linkage == "slider_crank" else SixBars(least, linkage == "watt")


def _six_bar(kind: SixBars, base: FourBar | SliderCrank, shape: Array, ratios: Array) -> SixBar:
    """A six-bar by its crank-rocker, its shape and its lengths over the crank."""
    assert isinstance(base, FourBar)
    joint, pivot = kind.places(shape, ratios) * base.crank
    more = {field.name: getattr(base, field.name) for field in fields(FourBar)}
    more["branch"] = float(np.sign(base.branch))
    return SixBar(
        **more,
        on_rocker=kind.on_rocker,
        joint=(float(joint.real), float(joint.imag)),
        second_pivot=(float(pivot.real), float(pivot.imag)),
        link=float(ratios[3] * base.crank),
        second_rocker=float(ratios[4] * base.crank),
        second_branch=1.0 if abs(base.branch) < 1.5 else -1.0,
    )


def _linkage(ratios: Array, length: float, branch: float, **more: Any) -> FourBar | SliderCrank:
    """A linkage with a crank of some length, m, by its other lengths over the crank."""
    lengths = [float(ratio * length) for ratio in ratios]
    if len(lengths) == 2:
        return SliderCrank(crank=length, coupler=lengths[0], offset=lengths[1], branch=branch, **more)
    ground, coupler, rocker = lengths[:3]
    return FourBar(ground=ground, crank=length, coupler=coupler, rocker=rocker, branch=branch, **more)


def _with_errors(linkage: FourBar | SliderCrank, points: Complex, ways: Complex | None) -> FourBar | SliderCrank:
    """The linkage with its distances from points and its turns from the coupler's directions."""
    gaps = linkage.path(linkage.angles) @ np.array([1.0, 1.0j]) - points
    found = replace(linkage, error=float((np.abs(gaps) ** 2).sum()))
    if ways is None:
        return found
    ahead = ways / found.directions(found.angles)  # its mean direction makes the squared chords least
    found = replace(found, turn=float(np.angle(ahead.sum())))
    return replace(found, turn_error=float((np.angle(ways / found.directions(found.angles)) ** 2).sum()))


def _good(linkages: list[FourBar | SliderCrank], least: float) -> list[FourBar | SliderCrank]:
    """Those that keep the limits, by the intersection of circles; of linkages that are alike, one; at most as many as a
    result has.
    """
    found: list[FourBar | SliderCrank] = []
    for each in linkages:
        kept = each.assembles and each.transmission_angle >= least - AT_LIMIT
        if kept and len(found) < KEPT and not any(_alike(each, other) for other in found):
            found.append(each)
    return found


def _alike(one: FourBar | SliderCrank, other: FourBar | SliderCrank) -> bool:
    """Whether two linkages differ by less than a search that ends slowly may be off."""
    first, second = ([each.crank, *each.lengths.values(), *each.point] for each in (one, other))
    near = np.allclose(first, second, rtol=SLOW, atol=SLOW * one.crank)
    return bool(near and one.branch == other.branch and abs(np.sin(0.5 * (one.angles[0] - other.angles[0]))) < SLOW)


def _numbered(name: str, given: object) -> Array:
    """Rows (n, 2), as many as are allowed."""
    found = np.array(arguments.array(name, given, (None, 2), "m" if name == "points" else ""))
    what = "points" if name == "points" else "pairs"
    if not LEAST_POINTS <= len(found) <= MOST_POINTS:
        raise InputError(f"argument '{name}': expected {LEAST_POINTS} to {MOST_POINTS} {what}, found {len(found)}")
    return found


def _scaled(given: Array) -> tuple[Complex, complex, float]:
    """Points as x + i y, their mean and their RMS distance from it, m. Raises InputError where they do not differ."""
    furthest = float(np.abs(given).max())
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
    return plane, centre, size


def _pairs(given: object, linkage: str) -> Array:
    """Crank angles, rad, and outputs (n, 2). Raises InputError."""
    found = _numbered("function", given)
    furthest = float(np.abs(found).max())
    if furthest > FURTHEST:
        raise InputError(f"argument 'function': expected numbers up to {FURTHEST:g}, found {furthest:g}")
    _check_turn("function", found[:, 0])
    output = found[:, 1]
    apart = output if linkage == "slider_crank" else np.angle(np.exp(1j * (output - output[0])))
    if np.std(apart) <= ALIKE * max(1.0, float(np.abs(output).max())):
        raise InputError("argument 'function': expected outputs that differ")
    return found


def _directions(given: object, count: int) -> Array:
    """The coupler's angles (count,), rad. Raises InputError where they do not differ."""
    found = np.array(arguments.array("directions", given, (count,), "rad"))
    if np.abs(found).max() > FURTHEST:
        arguments.refuse("directions", f"angles up to {FURTHEST:g} rad", given)
    if np.abs(np.angle(np.exp(1j * (found - found[0])))).max() < ALIKE:
        raise InputError("argument 'directions': expected angles that differ: a coupler that moves always turns")
    return found


def _length(given: object) -> float:
    """The largest length of a link, m. Raises InputError."""
    found = 0.0
    with contextlib.suppress(ValueError):
        if isinstance(given, str) or arguments.is_number(given):
            found = parse_number(given, "m")
    if not 0.0 < found <= FURTHEST:
        arguments.refuse("longest", f"a length above 0 m, up to {FURTHEST:g} m, or a text such as '800 mm'", given)
    return found


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
    _check_turn("timing", angles)
    return np.asarray(angles - angles[0])


def _check_turn(name: str, angles: NDArray[Any]) -> None:
    """Raises InputError unless angles rise, or fall, within one turn."""
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.diff(angles)
    if not ((steps > 0.0).all() or (steps < 0.0).all()) or not abs(angles[-1] - angles[0]) < TURN:
        raise InputError(
            f"argument '{name}': expected angles{' of the crank' * (name == 'function')} that rise, or fall, and stay "
            f"within one turn, found {np.rad2deg(angles[0]):.6g} to {np.rad2deg(angles[-1]):.6g} deg"
        )
