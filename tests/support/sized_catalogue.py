"""Catalogues of random motors and gears whose figures fit together as those of real ones do."""

from __future__ import annotations

import numpy as np

from bellcrank.actuators.catalogue.catalogue import Catalogue
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor


def random_motor(rng: np.random.Generator, number: int, size: float) -> Motor:
    """A motor of a size (1: about 50 N mm), with every figure that a criterion needs."""
    torque = 0.05 * size * rng.uniform(0.8, 1.25)
    constant = 0.03 * size**0.5 * rng.uniform(0.8, 1.25)
    resistance = rng.uniform(0.3, 1.2)
    return Motor(
        id=f"motor_{number:04d}",
        maker="maker",
        model="model",
        nominal_voltage=48.0,
        torque_constant=constant,
        torque_constant_basis="dc",
        resistance=resistance,
        coulomb_friction=0.01 * torque,
        viscous_friction=1e-6 * size,
        rotor_inertia=4e-6 * size**1.6 * rng.uniform(0.7, 1.4),
        nominal_torque=torque,
        nominal_speed=300.0,
        peak_torque=torque * rng.uniform(2.5, 5.0),
        peak_time=rng.uniform(0.5, 3.0),
        max_speed=rng.uniform(500.0, 1200.0),
        resistance_winding_housing=rng.uniform(0.8, 3.0) / size**0.5,
        resistance_housing_ambient=rng.uniform(4.0, 9.0) / size**0.5,
        time_constant_winding=rng.uniform(10.0, 40.0),
        time_constant_motor=rng.uniform(300.0, 900.0),
        max_winding_temperature=float(rng.choice([125.0, 155.0])),
        max_housing_temperature=110.0,
        reference_temperature=25.0,
        mass=round(0.15 * size**0.9 * rng.uniform(0.8, 1.25), 3),
        diameter=0.03 * size**0.3,
        length=0.05 * size**0.3,
        price=round(100.0 * size**0.7 * rng.uniform(0.7, 1.4), 2),
        currency="EUR",
    )


def random_gear(rng: np.random.Generator, number: int, size: float) -> Gear:
    """A gear of a size (1: about 10 N m), with every figure that a criterion needs."""
    rated = 10.0 * size * rng.uniform(0.8, 1.25)
    return Gear(
        id=f"gear_{number:04d}",
        maker="maker",
        model="model",
        kind="planetary",
        ratio=float(rng.choice([10.0, 16.0, 25.0, 36.0, 50.0, 80.0, 100.0, 120.0])),
        efficiency=rng.uniform(0.65, 0.95),
        back_efficiency=rng.uniform(0.5, 0.9),
        inertia=1e-6 * size * rng.uniform(0.5, 2.0),
        rated_torque=rated,
        rated_speed=200.0,
        average_torque=rated * rng.uniform(1.0, 1.3),
        repeated_peak_torque=rated * rng.uniform(1.5, 2.5),
        momentary_torque=rated * 4.0,
        average_speed=rng.uniform(250.0, 450.0),
        max_speed=rng.uniform(500.0, 900.0),
        life=7000.0,
        life_exponent=float(rng.choice([3.0, 10.0 / 3.0])),
        stiffness=1e4 * size,
        backlash=3e-4,
        mass=round(0.4 * size**0.8 * rng.uniform(0.8, 1.25), 3),
        diameter=0.05 * size**0.3,
        length=0.04 * size**0.3,
        price=round(300.0 * size**0.6 * rng.uniform(0.7, 1.4), 2),
        currency="EUR",
    )


def sized_catalogue(seed: int, motors: int, gears: int, largest: float = 30.0) -> Catalogue:
    """A catalogue with sizes from 0.3 to `largest`."""
    rng = np.random.default_rng(seed)
    sizes = np.geomspace(0.3, largest, motors), np.geomspace(0.3, largest, gears)
    return Catalogue(
        tuple(random_motor(rng, number, size) for number, size in enumerate(rng.permutation(sizes[0]))),
        tuple(random_gear(rng, number, size) for number, size in enumerate(rng.permutation(sizes[1]))),
    )
