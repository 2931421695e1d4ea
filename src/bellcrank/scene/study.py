"""The study of a scene, under the key `study`: what `sweep` varies unless it is told something else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from bellcrank.config.fields import Fields
from bellcrank.messages import format_value

METHODS = ("sobol", "latin", "random")
MOST_POINTS = 10**7


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
