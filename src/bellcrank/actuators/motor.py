"""Motors: what a maker states of one, with None for what is not stated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Points = tuple[tuple[float, float], ...]
MotorKind = Literal["motor", "frameless", "servo", "actuator"]
TorqueConstantBasis = Literal["dc", "phase_rms", "phase_peak"]


@dataclass(frozen=True, kw_only=True)
class Motor:
    """One row of a motor catalogue, in SI units; None is unknown, never zero.

    Torques, speeds and inertias are those of the shaft that the product offers: the motor shaft, or the gear's output
    where `kind` is "actuator" (a motor and gear sold as one), whose `ratio` is that of the gear inside.

    Attributes:
        id: A name of its own in the catalogue.
        maker: The maker.
        model: The maker's name of the product.
        kind: "motor", "frameless" (rotor and stator), "servo" (with encoder, for a drive), or "actuator" (with gear).
        part_number: The maker's order number.
        nominal_voltage: V.
        torque_constant: k_t, N m/A, on the basis named next.
        torque_constant_basis: Per ampere "dc" (brushed or block commutation: at the terminals), "phase_rms"
            (sinusoidal, RMS phase current) or "phase_peak" (sinusoidal, amplitude of the phase current).
        speed_constant: Speed per back-EMF voltage, rad/s/V, at the terminals.
        resistance: Terminal (line-to-line) resistance at 25 °C, Ω.
        inductance: Terminal (line-to-line) inductance, H.
        pole_pairs: Number of pole pairs.
        no_load_speed: At the nominal voltage, rad/s.
        no_load_current: At the nominal voltage, A, on the basis of the torque constant.
        coulomb_friction: Friction and hysteresis torque that does not depend on speed, N m.
        viscous_friction: Friction and eddy-current torque per speed, N m s/rad.
        rotor_inertia: kg m², on the shaft's side.
        nominal_torque: Continuous torque at the nominal speed, N m.
        nominal_speed: rad/s.
        nominal_current: A.
        peak_torque: Largest torque, N m.
        peak_time: How long the peak torque may last, s.
        peak_current: A.
        stall_torque: At the nominal voltage, N m (the straight line to 0 at the no-load speed; not a permitted load).
        stall_current: A.
        max_speed: Largest permitted speed, rad/s.
        continuous_curve: Points (speed rad/s, torque N m) of the S1 curve that the maker prints.
        peak_curve: Points of the curve of short-time operation that the maker prints.
        resistance_winding_housing: Thermal resistance R_th2, K/W.
        resistance_housing_ambient: Thermal resistance R_th1, K/W.
        time_constant_winding: τ_1, s.
        time_constant_motor: τ_2, s.
        mechanical_time_constant: s.
        max_winding_temperature: °C.
        max_housing_temperature: °C.
        reference_temperature: Temperature at which the figures hold, °C.
        max_efficiency: 1.
        ratio: Ratio of the gear inside; "actuator" only.
        backlash: At the output, rad.
        brake_torque: Holding torque of the built-in brake, N m.
        tilting_moment: Permitted at the output, N m.
        axial_load: Permitted at the output, N.
        mass: kg.
        diameter: Of the body, m.
        length: Of the body, m.
        flange: The maker's name of the flange, to match a gear's `input_flange`.
        shaft_diameter: m.
        price: In `currency`.
        currency: Such as "EUR".
        quality: "datasheet", "manual", "product_page", "datasheet_transcription", "secondary" or "user".
        source: Where the figures are from.
        checked: The date on which they were compared with the source, ISO 8601.
        notes: What else the source says.
    """

    id: str
    maker: str
    model: str
    kind: MotorKind = "motor"
    part_number: str | None = None
    nominal_voltage: float | None = None
    torque_constant: float | None = None
    torque_constant_basis: TorqueConstantBasis | None = None
    speed_constant: float | None = None
    resistance: float | None = None
    inductance: float | None = None
    pole_pairs: float | None = None
    no_load_speed: float | None = None
    no_load_current: float | None = None
    coulomb_friction: float | None = None
    viscous_friction: float | None = None
    rotor_inertia: float | None = None
    nominal_torque: float | None = None
    nominal_speed: float | None = None
    nominal_current: float | None = None
    peak_torque: float | None = None
    peak_time: float | None = None
    peak_current: float | None = None
    stall_torque: float | None = None
    stall_current: float | None = None
    max_speed: float | None = None
    continuous_curve: Points | None = None
    peak_curve: Points | None = None
    resistance_winding_housing: float | None = None
    resistance_housing_ambient: float | None = None
    time_constant_winding: float | None = None
    time_constant_motor: float | None = None
    mechanical_time_constant: float | None = None
    max_winding_temperature: float | None = None
    max_housing_temperature: float | None = None
    reference_temperature: float | None = None
    max_efficiency: float | None = None
    ratio: float | None = None
    backlash: float | None = None
    brake_torque: float | None = None
    tilting_moment: float | None = None
    axial_load: float | None = None
    mass: float | None = None
    diameter: float | None = None
    length: float | None = None
    flange: str | None = None
    shaft_diameter: float | None = None
    price: float | None = None
    currency: str | None = None
    quality: str = "user"
    source: str = ""
    checked: str = ""
    notes: str = ""
