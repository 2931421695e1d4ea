"""A catalogue of motors and gears of no maker for a machine: some fit its axes, some do not, some state little."""

from dataclasses import replace

import numpy as np

import bellcrank as bc

VOLTAGE = 48.0


def machine_catalogue(sized, seed=7):
    """Two motors and a gear for each of three joints, from that with most power to that with least, and odd ones.

    A motor fits its joint with its gear in spite of the masses of the others, the weaker one of the two narrowly so.
    """
    random = np.random.default_rng(seed)
    rotary = [joint for joint in sized.joints if joint.kind == "revolute"]
    rotary.sort(key=lambda joint: -joint.rms_torque * joint.peak_speed)
    chosen = [rotary[k] for k in sorted({0, len(rotary) // 2, len(rotary) - 1})]
    chosen += [joint for joint in sized.joints if joint.kind == "prismatic"]
    motors, gears = [], []
    for number, joint in enumerate(chosen):
        gears.append(_gear(random, number, joint))
        motors += [
            _motor(random, f"{number}{name}", joint, gears[-1], spare) for name, spare in (("a", 1.5), ("b", 3.0))
        ]
    return bc.Catalogue((*motors, *_odd_motors(motors)), (*gears, *_odd_gears(gears)))


def _gear(random, number, joint):
    linear = joint.kind == "prismatic"
    peak = 1.9 * joint.peak_torque
    ratio = 260.0 / joint.peak_speed * random.uniform(0.8, 1.1)
    mass = 0.3 + 0.6 * (0.0 if linear else peak / 60.0) ** 0.8
    return bc.Gear(
        id=f"g{number}", maker="Wheel", model=f"G {number}", kind="screw" if linear else "planetary", ratio=ratio,
        efficiency=random.uniform(0.7, 0.85), back_efficiency=random.uniform(0.5, 0.68),
        inertia=0.03 * joint.largest_inertia / ratio**2 * random.uniform(0.7, 1.4), inertia_side="input",
        rated_torque=0.7 * peak,
        rated_speed=180.0, average_torque=peak * random.uniform(0.8, 1.0), repeated_peak_torque=1.2 * peak,
        momentary_torque=2.9 * peak, average_speed=330.0, max_speed=640.0, life=7000.0, life_exponent=10.0 / 3.0,
        stiffness=700.0 * peak, backlash=7e-4, tilting_moment=90.0 * mass, axial_load=1700.0 * mass, mass=mass,
        diameter=0.06 + 0.02 * mass, length=0.05 + 0.013 * mass, price=90.0 + 31.0 * number, currency="EUR",
        starting_torque=0.002, lost_motion=3e-4,
    )  # fmt: skip


def _motor(random, name, joint, gear, spare):
    inertia = 0.11 * joint.largest_inertia / gear.ratio**2 * random.uniform(0.7, 1.4)
    static = 1.4 * joint.rms_torque / (gear.ratio * gear.efficiency)
    dynamic = (inertia + gear.inertia) * gear.ratio * 3.0 * joint.peak_speed
    torque = spare * (static + dynamic) * random.uniform(0.9, 1.1)
    speed, constant = 330.0, 0.078 * random.uniform(0.9, 1.1)
    resistance = VOLTAGE * random.uniform(0.02, 0.05) * constant / torque
    rise = random.uniform(95.0, 120.0)
    copper = resistance * (1.03 * torque / constant) ** 2 * (1.0 + 0.0039 * rise)
    thermal = rise / copper * random.uniform(0.95, 1.2)
    share = random.uniform(0.2, 0.4)
    mass = 0.12 + 0.9 * torque**0.8 * random.uniform(0.8, 1.2)
    return bc.Motor(
        id=f"m{name}", maker="Coil", model=f"M {name}", nominal_voltage=VOLTAGE, torque_constant=constant,
        torque_constant_basis="dc", resistance=resistance, coulomb_friction=0.013 * torque,
        viscous_friction=0.02 * torque / speed, rotor_inertia=inertia, nominal_torque=torque, nominal_speed=speed,
        nominal_current=1.03 * torque / constant, peak_torque=random.uniform(3.1, 4.2) * torque,
        peak_current=4.4 * torque / constant, peak_time=random.uniform(0.7, 2.1),
        max_speed=random.uniform(500.0, 700.0),
        resistance_winding_housing=share * thermal, resistance_housing_ambient=(1.0 - share) * thermal,
        time_constant_winding=random.uniform(7.0, 25.0), time_constant_motor=random.uniform(400.0, 1500.0),
        max_winding_temperature=25.0 + rise, max_housing_temperature=25.0 + 0.86 * rise, reference_temperature=25.0,
        brake_torque=1.1 * torque, mass=mass, diameter=0.03 + 0.02 * mass, length=0.05 + 0.03 * mass,
        price=60.0 + 43.0 * torque, currency="EUR",
    )  # fmt: skip


def _odd_motors(motors):
    first, last = motors[0], motors[1]
    torque, top = last.nominal_torque, last.max_speed
    sinusoidal = replace(
        last, id="curves", torque_constant=last.torque_constant / np.sqrt(2.0 / 3.0), torque_constant_basis="phase_rms",
        coulomb_friction=None, viscous_friction=None, no_load_current=0.02 * torque / last.torque_constant,
        peak_current=3.7 * torque / last.torque_constant, mass=1.1 * last.mass, price=1.3 * last.price,
        continuous_curve=((0.0, 1.2 * torque), (250.0, torque), (top, 0.6 * torque)),
        peak_curve=((0.0, 3.4 * torque), (0.6 * top, 3.3 * torque), (top, 1.2 * torque)),
    )  # fmt: skip
    silent = replace(
        first, id="silent", mass=0.5 * first.mass, peak_torque=None, peak_current=None, max_housing_temperature=None,
        time_constant_motor=None, price=0.3 * first.price,
    )  # fmt: skip
    return sinusoidal, silent


def _odd_gears(gears):
    first = gears[0]
    curve = ((0.1, 0.6 * first.efficiency), (0.5, 0.92 * first.efficiency), (1.0, 1.05 * first.efficiency))
    curved = replace(first, id="curved", efficiency=None, back_efficiency=None, efficiency_curve=curve,
                     mass=1.2 * first.mass, price=1.7 * first.price)  # fmt: skip
    return (curved,)
