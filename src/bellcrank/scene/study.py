"""The keys `study` and `optimise` of a scene: what `sweep` and `optimise` do unless they are told otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from bellcrank.config.fields import Fields
from bellcrank.messages import format_value

METHODS = ("sobol", "latin", "random")
MOST_POINTS = 10**7
MOST_DESIGNS, MOST_STARTS, MOST_FRONT_POINTS = 10**6, 1000, 1000
STEPPED = ("lower", "upper", "step")


@dataclass(frozen=True)
class Study:
    """What a sweep of the scene varies.

    Attributes:
        vary: Texts or lists of values by path, as `sweep` takes them.
        sample: The number of points at which distributions are sampled; None where nothing is said.
        method: One of `METHODS`; None where nothing is said.
        seed: Of the sample; None where nothing is said.
        place: Where `vary` is written, for messages.
    """

    vary: Mapping[str, Any] = field(default_factory=dict)
    sample: int | None = None
    method: str | None = None
    seed: int | None = None
    place: Fields | None = field(default=None, compare=False, repr=False)


def read_study(read: Fields) -> Study:
    """Read the mapping `study`. Raises InputError naming file and key."""
    place = read.mapping("vary", {})
    vary = {path: place.raw(path) for path in place}
    for path, values in vary.items():
        if isinstance(values, str) and values.count("(") != values.count(")"):
            raise place.error(path, f"put {format_value(values)}… in quotes: between {{ and }} a comma ends an entry")
        if not isinstance(values, (str, list)) or not values:
            raise place.error(
                path,
                "expected a list of values, a range in quotes such as '1.21:1.24:31', or a distribution such as "
                f"normal(1.241 m, 1 mm), found {format_value(values)}",
            )
    sample = read.integer("sample", minimum=1) if "sample" in read else None
    if sample is not None and sample > MOST_POINTS:
        raise read.error("sample", f"expected at most {MOST_POINTS}, found {sample}")
    method = read.choice("method", METHODS) if "method" in read else None
    seed = read.integer("seed") if "seed" in read else None
    read.known("sample", "method", "seed")
    read.done()
    return Study(vary, sample, method, seed, place)


@dataclass(frozen=True)
class OptimiseEntry:
    """The search for a best design of the scene; what is None or empty is not said.

    Attributes:
        vary: Bounds (lower, upper), or standard sizes (`sizes_as_written`), by parameter or path, as written.
        minimise: The measures to be made small.
        maximise: The measures to be made large.
        limits: Conditions on measures, such as "lock.crank <= 120 deg".
        size: Whether designs are sized instead of simulated.
        fastest: Whether their fastest motions are found, instead.
        samples: The number of designs of the global search.
        starts: The number of local searches.
        seed: Of the sample.
        tolerances: Distributions of deviations by parameter or path, as written.
        robust: How a design is judged within them: "worst" or "mean + k sd".
        points: The number of values of each other objective along a front.
        place: Where it is written, for messages.
    """

    vary: Mapping[str, Any] = field(default_factory=dict)
    minimise: tuple[str, ...] = ()
    maximise: tuple[str, ...] = ()
    limits: tuple[str, ...] = ()
    size: bool | None = None
    fastest: bool | None = None
    samples: int | None = None
    starts: int | None = None
    seed: int | None = None
    points: int | None = None
    tolerances: Mapping[str, str] = field(default_factory=dict)
    robust: str | None = None
    place: Fields | None = field(default=None, compare=False, repr=False)


def sizes_as_written(given: Mapping[str, Any]) -> list[Any]:
    """The values of {"sizes": [0.3, 0.31, …]}, or lower, upper and step of {"lower": …, "upper": …, "step": …}.

    Raises ValueError with what was expected.
    """
    if set(given) == set(STEPPED):
        return [given[name] for name in STEPPED]
    if set(given) == {"sizes"} and isinstance(given["sizes"], (list, tuple)):
        return list(given["sizes"])
    raise ValueError(
        "expected standard sizes as {sizes: [0.3, 0.31]} or {lower: 0.3, upper: 0.4, step: 5 mm}, found "
        f"{format_value(dict(given))}"
    )


def read_optimise(read: Fields) -> OptimiseEntry:
    """Read the mapping `optimise`. Raises InputError naming file and key."""
    vary = read.mapping("vary", {})
    bounds = {path: vary.raw(path) for path in vary}
    for path, pair in bounds.items():
        if isinstance(pair, dict):
            try:
                sizes_as_written(pair)
            except ValueError as error:
                raise vary.error(path, str(error)) from None
        elif not isinstance(pair, list) or len(pair) != 2:
            raise vary.error(path, f"expected two bounds, such as [1.2, 1.3], found {format_value(pair)}")
    minimise, maximise = _measures(read, "minimise"), _measures(read, "maximise")
    if both := set(minimise) & set(maximise):
        raise read.error("maximise", f"expected {min(both)} under one of minimise and maximise, found both")
    limits = read.raw("limits", [])
    if not isinstance(limits, list) or not all(isinstance(limit, str) for limit in limits):
        raise read.error("limits", f"expected a list such as ['lock.crank <= 120 deg'], found {format_value(limits)}")
    around = read.mapping("tolerances", {})
    tolerances = {path: around.raw(path) for path in around}
    for path, text in tolerances.items():
        if not isinstance(text, str):
            what = "a distribution of deviations, such as uniform(-1 mm, 1 mm)"
            raise around.error(path, f"expected {what}, found {format_value(text)}")
    counts: dict[str, int | None] = {}
    for name, least, most in (
        ("samples", 1, MOST_DESIGNS), ("starts", 1, MOST_STARTS), ("seed", 0, 10**9), ("points", 2, MOST_FRONT_POINTS),
    ):  # fmt: skip
        counts[name] = read.integer(name, minimum=least) if name in read else None
        if (counts[name] or 0) > most:
            raise read.error(name, f"expected at most {most}, found {counts[name]}")
    found = OptimiseEntry(
        vary=bounds,
        minimise=minimise,
        maximise=maximise,
        limits=tuple(limits),
        size=read.flag("size", False) if "size" in read else None,
        fastest=read.flag("fastest", False) if "fastest" in read else None,
        tolerances=tolerances,
        robust=read.text("robust") if "robust" in read else None,
        place=read,
        **counts,
    )
    read.known("minimise", "maximise", "size", "fastest", "samples", "starts", "seed", "points", "tolerances", "robust")
    read.done()
    return found


def _measures(read: Fields, key: str) -> tuple[str, ...]:
    """A measure, or a list of them; none where the key is not there. Raises InputError."""
    if key not in read:
        return ()
    given = read.raw(key)
    listed = given if isinstance(given, list) else [given]
    if not listed or not all(isinstance(name, str) for name in listed):
        raise read.error(key, f"expected a measure such as lock.time, or a list of them, found {format_value(given)}")
    return tuple(listed)
