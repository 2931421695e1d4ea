"""Motors: what a maker states of one, with None for what is not stated."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

from bellcrank import arguments
from bellcrank.actuators.catalogue.product_checks import (
    NOT_NEGATIVE,
    SHARE,
    TEMPERATURE,
    Points,
    check_numbers,
    check_texts,
    torque_speed_curve,
)
from bellcrank.actuators.copper import resistance_factor

MotorKind = Literal["motor", "frameless", "servo", "actuator", "ratings"]
TorqueConstantBasis = Literal["dc", "phase_rms", "phase_peak"]
Commutation = Literal["brushed", "brushless"]
RANGES = {  # of numbers that are not more than 0
    "nominal_speed": NOT_NEGATIVE,  # 0: the nominal torque is stated at standstill
    "no_load_current": NOT_NEGATIVE,
    "coulomb_friction": NOT_NEGATIVE,
    "viscous_friction": NOT_NEGATIVE,
    "backlash": NOT_NEGATIVE,
    "price": NOT_NEGATIVE,
    "max_efficiency": SHARE,
    "max_winding_temperature": TEMPERATURE,
    "max_housing_temperature": TEMPERATURE,
    "reference_temperature": TEMPERATURE,
}
OF_RATINGS = RANGES | {"rotor_inertia": NOT_NEGATIVE}  # ratings may say that the rotor's inertia does not count
UNSTATED_REFERENCE = 25.0  # °C, of figures without one: the lower, and so the safer, of the usual ones (25 and 40)
_TO_DC = {"dc": 1.0, "phase_rms": math.sqrt(2.0 / 3.0), "phase_peak": 2.0 / math.sqrt(3.0)}


@dataclass(frozen=True, kw_only=True)
class Motor:
    """One row of a motor catalogue, in SI units; None is unknown, never zero.

    Torques, speeds and inertias are those of the shaft that the product offers: the motor shaft, or the gear's output
    where `kind` is "actuator" (a motor and gear sold as one), whose `ratio` is that of the gear inside.

    Attributes:
        id: A name of its own in the catalogue.
        maker: The maker.
        model: The maker's name of the product.
        kind: "motor", "frameless" (rotor and stator), "servo" (with encoder, for a drive), "actuator" (with gear), or
            "ratings": what is not stated is left to the user, and only what is stated is compared.
        part_number: The maker's order number.
        commutation: "brushed" or "brushless".
        nominal_voltage: Of the DC bus that the figures hold for, V (an AC supply: its rectified amplitude).
        torque_constant: k_t, N m/A, on the basis named next.
        torque_constant_basis: Per ampere "dc" (brushed or block commutation: at the terminals), "phase_rms"
            (sinusoidal, RMS phase current) or "phase_peak" (sinusoidal, amplitude of the phase current).
        speed_constant: Speed per back-EMF voltage, rad/s/V, at the terminals.
        voltage_constant: Line-to-line amplitude of the back-EMF per speed, V s/rad, where it does not follow from the
            torque constant: that of an actuator often has the losses of its gear in it.
        resistance: Terminal (line-to-line) resistance at 25 °C, Ω.
        inductance: Terminal (line-to-line) inductance, H.
        pole_pairs: Number of pole pairs.
        no_load_speed: At the nominal voltage, rad/s.
        no_load_current: At the nominal voltage, A, on the basis of the torque constant.
        coulomb_friction: Friction and hysteresis torque that does not depend on speed, N m.
        viscous_friction: Friction and eddy-current torque per speed, N m s/rad.
        rotor_inertia: kg m², on the shaft's side.
        nominal_torque: Continuous torque at the nominal speed, N m.
        nominal_speed: rad/s; 0 where the nominal torque is stated at standstill.
        nominal_current: A.
        peak_torque: Largest torque, N m.
        peak_time: How long the peak torque may last, s.
        peak_current: A.
        stall_torque: At the nominal voltage, N m (a straight line to 0 at the no-load speed; not a permitted load).
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

    Raises:
        InputError: For a number that is not finite or outside its range, a text that is none of those expected, or a
            curve that does not start at standstill; the message names the row and the field.

    Example:
        >>> from bellcrank.actuators.motor import Motor
        >>> motor = Motor(id="re25", maker="maxon", model="RE 25", torque_constant=0.0234, torque_constant_basis="dc",
        ...               resistance=2.18, no_load_current=0.0263)
        >>> round(motor.motor_constant, 5), round(motor.coulomb_torque, 6)
        (0.01585, 0.000615)
    """

    id: str
    maker: str
    model: str
    kind: MotorKind = "motor"
    part_number: str | None = None
    commutation: Commutation | None = None
    nominal_voltage: float | None = None
    torque_constant: float | None = None
    torque_constant_basis: TorqueConstantBasis | None = None
    speed_constant: float | None = None
    voltage_constant: float | None = None
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

    def __post_init__(self) -> None:
        arguments.text("id", self.id, "a name of the row", where="a motor")
        where = f"motor '{self.id}'"
        choices = {
            "kind": get_args(MotorKind),
            "commutation": get_args(Commutation),
            "torque_constant_basis": get_args(TorqueConstantBasis),
        }
        check_texts(self, where, choices)
        check_numbers(self, where, OF_RATINGS if self.by_ratings else RANGES)
        for name in ("continuous_curve", "peak_curve"):
            object.__setattr__(self, name, torque_speed_curve(name, getattr(self, name), where))
        if self.pole_pairs is not None and self.pole_pairs != round(self.pole_pairs):
            arguments.refuse("pole_pairs", "a whole number", self.pole_pairs, where)
        reference, hottest = self.reference_temperature, self.max_winding_temperature
        if reference is not None and hottest is not None and hottest <= reference:
            arguments.refuse(
                "max_winding_temperature", f"more than the reference temperature, {reference:g} °C", hottest, where
            )

    @property
    def dc_torque_constant(self) -> float | None:
        """The torque constant k of the DC-equivalent motor, N m/A; None where k_t or its basis is unknown.

        The DC-equivalent motor has the current I = T_e / k, the copper loss R I² and the voltage R I + k ω, with R the
        line-to-line resistance. For a sinusoidal motor with the phase current's amplitude î (in phase with the induced
        voltage) and k_t = T_e / î: the power 3/2 ê î = T_e ω gives the amplitude of the induced phase voltage
        ê = 2/3 k_t ω, and between two lines √3 ê = 2/√3 k_t ω, so k = 2/√3 k_t. Then I = √3/2 î. The copper loss
        3/2 R_phase î² is R I² with R = 2 R_phase (star), and the line-to-line amplitude √3 (R_phase î + ê) is
        R I + k ω, which the bus voltage bounds. With the RMS phase current, k_t = T_e √2 / î and k = √(2/3) k_t.
        The inductance is neglected (`electrical.voltage_with_inductance` says by how much that errs).
        """
        if self.torque_constant is None or self.torque_constant_basis is None:
            return None
        return _TO_DC[self.torque_constant_basis] * self.torque_constant

    @property
    def dc_voltage_constant(self) -> float | None:
        """Back-EMF over speed of the DC-equivalent motor, V s/rad: as stated, else k; None where neither is known."""
        return self.dc_torque_constant if self.voltage_constant is None else self.voltage_constant

    @property
    def motor_constant(self) -> float | None:
        """Torque per root of copper loss at 25 °C, k / √R, N m/√W; None where unknown."""
        if self.dc_torque_constant is None or self.resistance is None:
            return None
        return self.dc_torque_constant / math.sqrt(self.resistance)

    @property
    def reactance_per_speed(self) -> float | None:
        """Line-to-line reactance over the shaft's speed, pole pairs times inductance, Ω s/rad; None where unknown.

        The speed of an actuator's output counts times the `ratio` inside. Only for sinusoidal motors: a direct current
        has no reactance.
        """
        if self.torque_constant_basis not in ("phase_rms", "phase_peak"):
            return None
        if self.pole_pairs is None or self.inductance is None or (self.kind == "actuator" and self.ratio is None):
            return None
        return self.pole_pairs * self.inductance * (self.ratio or 1.0 if self.kind == "actuator" else 1.0)

    @property
    def by_ratings(self) -> bool:
        """Whether the motor is given by its ratings alone."""
        return self.kind == "ratings"

    @property
    def brushless(self) -> float | None:
        """1 for a brushless motor, 0 for one with brushes, None where neither is stated.

        A torque constant per phase current tells it too: only a brushless motor has phases.
        """
        if self.commutation is not None:
            return float(self.commutation == "brushless")
        return 1.0 if self.torque_constant_basis in ("phase_rms", "phase_peak") else None

    @property
    def frameless(self) -> bool:
        """Whether it is a rotor and a stator without housing and bearings."""
        return self.kind == "frameless"

    @property
    def power_rate(self) -> float | None:
        """Nominal torque squared over the rotor's inertia, W/s; None where unknown."""
        if self.nominal_torque is None or self.rotor_inertia is None:
            return None
        return self.nominal_torque**2 / self.rotor_inertia

    @property
    def nominal_acceleration(self) -> float | None:
        """Nominal torque over the rotor's inertia, rad/s²; None where unknown."""
        if self.nominal_torque is None or self.rotor_inertia is None:
            return None
        return self.nominal_torque / self.rotor_inertia

    @property
    def coulomb_torque(self) -> float | None:
        """Part T_c of the friction and iron torque T_c + c_v ω that does not depend on speed, N m.

        It is `coulomb_friction` where both friction figures are stated, else k_t I_0 of the no-load current, the whole
        of which then counts as constant; None where neither is known.
        """
        if self.coulomb_friction is not None and self.viscous_friction is not None:
            return self.coulomb_friction
        return self._torque_of(self.no_load_current)

    @property
    def viscous_coefficient(self) -> float | None:
        """Part c_v of the friction and iron torque T_c + c_v ω, N m s/rad; see `coulomb_torque`."""
        if self.coulomb_friction is not None and self.viscous_friction is not None:
            return self.viscous_friction
        return None if self.coulomb_torque is None else 0.0

    @property
    def continuous_torque(self) -> float | None:
        """The stated nominal torque, else that of the nominal current less friction at nominal speed, N m."""
        if self.nominal_torque is not None:
            return self.nominal_torque
        torque, coulomb, viscous = self._torque_of(self.nominal_current), self.coulomb_torque, self.viscous_coefficient
        if torque is None or coulomb is None or viscous is None or (viscous and self.nominal_speed is None):
            return None
        return max(torque - coulomb - viscous * (self.nominal_speed or 0.0), 0.0)

    @property
    def friction_heat_share(self) -> float:
        """Share of the friction and iron loss that counts as heat in the housing, from 0 to 1.

        The nominal point is by its definition one at which the winding reaches its largest temperature (maxon's motor
        data: nominal torque and current at nominal speed and 25 °C). Where the whole loss and the copper loss at this
        point would heat the winding further, only the share that fits counts: loss in the bearings also leaves through
        shaft and flange. It is 1 where the nominal point or a thermal figure is not stated, and where the nominal
        speed is 0. For the fast EC-4pole 30
        it is 0.49.
        """
        torque, speed, limit = self.continuous_torque, self.nominal_speed, self.max_winding_temperature
        constant, coulomb, viscous = self.motor_constant, self.coulomb_torque, self.viscous_coefficient
        winding, housing = self.resistance_winding_housing, self.resistance_housing_ambient
        if torque is None or speed is None or limit is None or constant is None:
            return 1.0
        if coulomb is None or viscous is None or winding is None or housing is None:
            return 1.0
        friction = coulomb + viscous * speed
        if friction * speed == 0.0:  # nominal torque at standstill: no such loss
            return 1.0
        reference = UNSTATED_REFERENCE if self.reference_temperature is None else self.reference_temperature
        copper = ((torque + friction) / constant) ** 2 * float(resistance_factor(limit))
        left = (limit - reference) - (winding + housing) * copper
        return min(max(left / (housing * friction * speed), 0.0), 1.0)

    @property
    def peak_electrical_torque(self) -> float | None:
        """Electrical torque k_t I_peak at the peak current, N m; None where unknown."""
        return self._torque_of(self.peak_current)

    def _torque_of(self, current: float | None) -> float | None:
        """Electrical torque of a current on the torque constant's basis; None where one of the three is unknown."""
        if self.torque_constant is None or self.torque_constant_basis is None or current is None:
            return None
        return self.torque_constant * current
