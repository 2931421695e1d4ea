"""Gears, screws and racks: what a maker states of one, with None for what is not stated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from bellcrank import arguments
from bellcrank.actuators.catalogue.product_checks import (
    NOT_NEGATIVE,
    SHARE,
    Points,
    Range,
    check_numbers,
    check_texts,
    curve_points,
)

GearKind = Literal["direct", "strain_wave", "planetary", "cycloidal", "spur", "belt", "screw", "rack"]
LINEAR_KINDS = ("screw", "rack")
RANGES = {  # of numbers that are not more than 0
    "efficiency": SHARE,
    "back_efficiency": Range(above=None, least=0.0, most=1.0),  # 0: the load cannot drive the gear
    "inertia": NOT_NEGATIVE,
    "backlash": NOT_NEGATIVE,
    "lost_motion": NOT_NEGATIVE,
    "starting_torque": NOT_NEGATIVE,
    "mass": NOT_NEGATIVE,
    "price": NOT_NEGATIVE,
}


@dataclass(frozen=True, kw_only=True)
class Gear:
    """One row of a gear catalogue, in SI units; None is unknown, never zero.

    Torques are those of the output (forces in N for a screw or rack), speeds those of the input.

    Attributes:
        id: A name of its own in the catalogue.
        maker: The maker.
        model: The maker's name of the product.
        kind: "strain_wave", "planetary", "cycloidal", "spur", "belt", "screw" or "rack"; "direct" is no gear at all.
        part_number: The maker's order number.
        ratio: Input angle over output angle, rad/rad; rad/m for a screw (2π over the lead) and a rack (1 over the
            pinion's radius).
        stages: Number of stages.
        efficiency: η at the rated load, driving.
        efficiency_curve: Points (output torque over the rated torque, η) of the efficiency over load.
        back_efficiency: η while the load gives power back; unknown: the same as driving.
        inertia: kg m², at the input (`inertia_side`).
        inertia_side: "input" or "output": which side the maker's figure refers to; `inertia` holds it at the input.
        rated_torque: At the rated speed, for the rated life, N m.
        rated_speed: Input speed of the rated torque and life, rad/s.
        average_torque: Limit of the average (root-mean-cube) torque, N m.
        repeated_peak_torque: Limit of the torque at each start and stop, N m.
        momentary_torque: Limit of a torque that happens rarely (a collision), N m.
        average_speed: Limit of the average input speed, rad/s.
        max_speed: Limit of the input speed, rad/s.
        life: L10 life at the rated torque and speed, hours.
        life_exponent: p of the life law L = life · (n_rated / n) (T_rated / T)^p, and of the average torque.
        stiffness: Torsional, N m/rad at the output.
        backlash: rad at the output.
        lost_motion: rad at the output.
        starting_torque: No-load starting torque at the input, N m.
        tilting_moment: Limit at the output bearing, N m.
        axial_load: Limit at the output bearing, N.
        mass: kg.
        diameter: Of the body, m.
        length: Of the body, m.
        input_flange: The maker's names of the motor flanges that fit, separated by ";". A name that begins with the
            gear's maker is of a gear built into that maker's motors, and fits only motors that state it.
        input_shaft_diameter: Largest motor shaft that fits, m.
        price: In `currency`.
        currency: Such as "EUR".
        quality: As `Motor.quality`.
        source: Where the figures are from.
        checked: The date on which they were compared with the source, ISO 8601.
        notes: What else the source says.

    Raises:
        InputError: For a number that is not finite or outside its range, a text that is none of those expected, or a
            curve whose points do not rise; the message names the row and the field.

    Example:
        >>> from bellcrank.actuators.gear import Gear
        >>> Gear(id="csf", maker="Harmonic Drive", model="CSF-17-50", kind="strain_wave", ratio=50.0).linear
        False
    """

    id: str
    maker: str
    model: str
    kind: GearKind
    part_number: str | None = None
    ratio: float | None = None
    stages: float | None = None
    efficiency: float | None = None
    efficiency_curve: Points | None = None
    back_efficiency: float | None = None
    inertia: float | None = None
    inertia_side: Literal["input", "output"] | None = None
    rated_torque: float | None = None
    rated_speed: float | None = None
    average_torque: float | None = None
    repeated_peak_torque: float | None = None
    momentary_torque: float | None = None
    average_speed: float | None = None
    max_speed: float | None = None
    life: float | None = None
    life_exponent: float | None = None
    stiffness: float | None = None
    backlash: float | None = None
    lost_motion: float | None = None
    starting_torque: float | None = None
    tilting_moment: float | None = None
    axial_load: float | None = None
    mass: float | None = None
    diameter: float | None = None
    length: float | None = None
    input_flange: str | None = None
    input_shaft_diameter: float | None = None
    price: float | None = None
    currency: str | None = None
    quality: str = "user"
    source: str = ""
    checked: str = ""
    notes: str = ""

    def __post_init__(self) -> None:
        arguments.text("id", self.id, "a name of the row", where="a gear")
        where = f"gear '{self.id}'"
        check_texts(self, where, {"kind": get_args(GearKind), "inertia_side": ("input", "output")})
        check_numbers(self, where, RANGES)
        if self.stages is not None and self.stages != round(self.stages):
            arguments.refuse("stages", "a whole number", self.stages, where)
        curve = curve_points("efficiency_curve", self.efficiency_curve, where)
        object.__setattr__(self, "efficiency_curve", curve)
        for load, efficiency in curve or ():
            if load <= 0.0 or not 0.0 < efficiency <= 1.0:
                arguments.refuse(
                    "efficiency_curve",
                    "points of a load of more than 0 and an efficiency of more than 0 and at most 1",
                    [load, efficiency],
                    where,
                )

    @property
    def linear(self) -> bool:
        """Whether the output moves along a line: a screw or a rack."""
        return self.kind in LINEAR_KINDS

    @property
    def driven_efficiency(self) -> float | None:
        """Efficiency while the load gives power back: `back_efficiency`, else the same as driving."""
        return self.efficiency if self.back_efficiency is None else self.back_efficiency


DIRECT = Gear(
    id="direct", maker="", model="direct drive", kind="direct", ratio=1.0, efficiency=1.0, inertia=0.0, mass=0.0,
    source="no gear",
)  # fmt: skip
