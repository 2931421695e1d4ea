"""The probability that a measure exceeds a limit, such as "lock.time > 13 s", with its confidence interval.

Designs without the measure (they cannot be built, did not reach the event, or the measure is not finite) are counted.
What is known of all designs together are bounds: the lower end of the interval if none of those exceeded the limit, and
the upper end if all of them did.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array, Mask
from bellcrank.config.fields import parse_number
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.studies.results.intervals import Interval, SampleLayout, proportion
from bellcrank.studies.results.study_columns import StudyColumns

_RELATION, _CONDITION = re.compile(r"[<>]=?"), re.compile(r"[<>]=?|=")
EXPECTED = "expected MEASURE > VALUE or MEASURE < VALUE, such as 'lock.time > 13 s'"
EXPECTED_CONDITION = "expected MEASURE <= VALUE, MEASURE >= VALUE or MEASURE = VALUE, such as 'lock.crank <= 120 deg'"


@dataclass(frozen=True)
class Limit:
    """A limit of a measure.

    Attributes:
        measure: The name of the measure.
        relation: ">" or "<": on which side of `value` the limit is exceeded (">=" and "<=" include the value itself).
        value: In the unit of the measure.
        unit: The unit of the measure.
    """

    measure: str
    relation: str
    value: float
    unit: str

    def __str__(self) -> str:
        return f"{self.measure} {self.relation} {self.value:.6g} {'' if self.unit == '1' else self.unit}".rstrip()

    def exceeded(self, values: Array) -> Mask:
        """Where values (n,) of the measure exceed the limit; NaN does not."""
        with np.errstate(invalid="ignore"):
            sign = -1.0 if self.relation.startswith("<") else 1.0
            above: Mask = sign * values > sign * self.value
            return above | (values == self.value) if self.relation.endswith("=") else above


@dataclass(frozen=True, kw_only=True)
class Exceedance:
    """The probability that a limit is exceeded.

    Attributes:
        limit: The limit.
        probability: Among the designs that have the measure; NaN where there is none.
        interval: Its 95 % confidence interval.
        bounds: The lower end of the interval if no design without the measure exceeded the limit, and the upper end if
            all of them did: what holds for all designs.
        exceeded: The number of designs that exceed the limit.
        count: The number of designs that have the measure.
        missing: The number of the others by the status of their run, such as "infeasible".
        method: How the interval was computed.
    """

    limit: Limit
    probability: float
    interval: Interval
    bounds: Interval
    exceeded: int
    count: int
    missing: Mapping[str, int] = field(default_factory=dict)
    method: str

    def __str__(self) -> str:
        """The result in one sentence, and a second one where designs are without the measure."""
        text = (
            f"P({self.limit}) = {_share(self.probability)}, 95 % interval {interval_text(self.interval)} "
            f"({self.exceeded} of {self.count} designs; {self.method})"
        )
        if not self.missing:
            return text
        return (
            f"{text}; {missing_text(self.missing)}: between none and all of them exceed, {interval_text(self.bounds)}"
        )


def parse_limit(text: str, units: Mapping[str, str], option: str = "--limit", *, kept: bool = False) -> Limit:
    """The limit that a text such as "lock.time > 13 s" names, in the unit of its measure.

    Args:
        text: The measure, "<" or ">", and a number with or without a unit.
        units: The unit of each measure by name.
        option: What the message calls the text.
        kept: Whether it is a condition that designs are to keep, where "=" is a relation too.

    Returns:
        The limit.

    Raises:
        InputError: The text has another form, the measure does not exist, or the unit is not one of the measure's.
    """
    found, where = (_CONDITION if kept else _RELATION).search(text), f"{option} {arguments.found(text)}"
    if found is None or not text[: found.start()].strip():
        raise InputError(f"{where}: {EXPECTED_CONDITION if kept else EXPECTED}")
    measure = text[: found.start()].strip()
    try:
        if measure not in units:
            raise InputError(unknown_name("measure", measure, units))
        unit = units[measure]
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    try:
        value = parse_number(text[found.end() :].strip(), "" if unit == "1" else unit)
    except ValueError as error:
        raise InputError(f"{where}: {error}") from None
    return Limit(measure, found[0], value, unit)


def exceedance(columns: StudyColumns, limit: Limit, layout: SampleLayout) -> Exceedance:
    """The probability that a limit is exceeded, estimated from the designs of a sample.

    Args:
        columns: The measures of the designs.
        limit: The limit.
        layout: How the designs depend on each other.

    Returns:
        The probability with its interval: Clopper-Pearson for independent designs, Student's t for replicates.
    """
    values = columns.measures[limit.measure]
    there = np.isfinite(values)
    exceeded = limit.exceeded(values) & there
    probability, interval = proportion(exceeded, there, layout)
    everyone = np.ones(len(values), dtype=bool)
    lowest = proportion(exceeded, everyone, layout)[1][0]
    highest = proportion(exceeded | ~there, everyone, layout)[1][1]
    return Exceedance(
        limit=limit,
        probability=probability,
        interval=interval,
        bounds=(lowest, highest),
        exceeded=int(exceeded.sum()),
        count=int(there.sum()),
        missing=missing_by_status(columns, there),
        method=layout.method,
    )


def missing_by_status(columns: StudyColumns, there: Mask) -> dict[str, int]:
    """The number of designs outside `there` (n,) by the name of their status, in the order of `columns.statuses`."""
    counts = np.bincount(columns.status[~there], minlength=len(columns.statuses))
    return {name: int(n) for name, n in zip(columns.statuses, counts, strict=True) if n}


def missing_text(missing: Mapping[str, int]) -> str:
    """A clause on designs without a measure, such as "12 designs without it (12 infeasible)"."""
    count = sum(missing.values())
    parts = ", ".join(f"{n} {status}" for status, n in missing.items())
    return f"{count} design{'' if count == 1 else 's'} without it ({parts})"


def interval_text(interval: Interval) -> str:
    """An interval of a probability as text."""
    return f"{_share(interval[0])} to {_share(interval[1])}"


def _share(probability: float) -> str:
    """A probability with four digits, but 0 and 1 only where they are meant."""
    text = f"{probability:.4g}"
    return f"{probability:.10g}" if text == "1" and probability < 1.0 else text
