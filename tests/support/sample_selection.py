"""A selection for tests of the page, made by hand: real loads and products, verdicts and names as each test wants them."""

import dataclasses

import bellcrank as bc
from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.gear import DIRECT, Gear
from bellcrank.actuators.motor import Motor
from bellcrank.dynamics.mechanism import mechanism_of
from bellcrank.sizing.selection.axis_loads_of import axis_loads
from bellcrank.sizing.selection.selection import (
    AxisSelection,
    Candidate,
    CriterionResult,
    ParetoPoint,
    Selection,
    SelectionInputs,
)

# maxon EC 45 flat, 70 W, 24 V (catalogue page of 651614); mass, size and price are of no product
FULL = Motor(
    id="flat70", maker="maxon", model="EC 45 flat 70 W", nominal_voltage=24.0, torque_constant=0.0404,
    torque_constant_basis="dc", resistance=0.573, no_load_speed=586.4, no_load_current=0.27, rotor_inertia=1.81e-5,
    nominal_torque=0.134, nominal_speed=497.4, max_speed=1047.2, peak_torque=0.4, peak_time=2.0,
    resistance_winding_housing=6.64, resistance_housing_ambient=2.55, time_constant_winding=43.1,
    time_constant_motor=127.0, max_winding_temperature=125.0, reference_temperature=25.0, mass=0.141, diameter=0.043,
    length=0.027, price=120.0, currency="EUR",
)  # fmt: skip
STRONG = dataclasses.replace(
    FULL, id="strong", model="Strong 150", maker="Acme", nominal_torque=0.45, peak_torque=1.3, mass=0.39,
    rotor_inertia=6e-5, resistance=0.2, price=260.0,
)  # fmt: skip
BARE = Motor(id="bare", maker="Acme", model="Bare 20", nominal_torque=0.3, nominal_speed=300.0, price=80.0, currency="EUR")
HARMONIC = Gear(
    id="csg17", maker="Harmonic Drive", model="CSG-17-100", kind="strain_wave", ratio=100.0, efficiency=0.7, inertia=7.9e-6,
    rated_torque=31.0, repeated_peak_torque=70.0, momentary_torque=143.0, max_speed=764.0, mass=0.15, diameter=0.06,
    length=0.03, price=700.0, currency="EUR",
)  # fmt: skip
PLANET = Gear(
    id="planet", maker="Acme", model="Planetary 1:50", kind="planetary", ratio=50.0, efficiency=0.8, back_efficiency=0.75,
    efficiency_curve=((0.05, 0.5), (0.5, 0.75), (1.0, 0.8)), rated_torque=20.0, inertia=1.2e-6, mass=0.4,
)  # fmt: skip
SILENT = Gear(id="silent", maker="Acme", model="Unstated 1:80", kind="planetary", ratio=80.0)
NAMES = ("voltage limit", "peak torque", "RMS torque", "winding temperature", "gear peak torque", "gear life")


def criteria(use, unknown=0, estimate=None):
    """One result a name, the first the largest; the last `unknown` ones unknown."""
    results = []
    for k, name in enumerate(NAMES):
        share = use * (1.0 - 0.13 * k)
        if k >= len(NAMES) - unknown:
            text = f"{name}: not stated: gear.{name.replace(' ', '_')}"
            results.append(CriterionResult(name=name, use=None, verdict="unknown", text=text, estimate=estimate))
        else:
            verdict = "exceeded" if share > 1.0 else "inside"
            results.append(CriterionResult(name=name, use=share, verdict=verdict, text=f"{name}: {share:.3g} of 1"))
    note = CriterionResult(name="inertia ratio", use=None, verdict="note", text="The inertia ratio is 3.4.")
    return (*results, note)


def candidate(motor, gear, use, unknown=0, loss=None, estimate=None):
    tier = "fails" if use > 1.0 else "passes what is known" if unknown else "all criteria shown"
    together = lambda name: None if None in (getattr(motor, name), getattr(gear, name)) else (  # noqa: E731
        getattr(motor, name) + getattr(gear, name)
    )
    return Candidate(
        motor=motor,
        gear=gear,
        tier=tier,
        criteria=criteria(use, unknown, estimate),
        binding=NAMES[0],
        mass=together("mass"),
        cost=together("price"),
        loss=loss,
        largest_use=use,
        fit="fits" if gear is HARMONIC else "fit not checked",
    )


def candidates():
    return (
        candidate(FULL, HARMONIC, 0.62, loss=14.0),
        candidate(STRONG, HARMONIC, 0.31, loss=9.5),
        candidate(STRONG, PLANET, 0.55, unknown=1, loss=21.0),
        candidate(FULL, SILENT, 0.48, unknown=4, estimate=0.4),
        candidate(BARE, HARMONIC, 0.9, unknown=3),
        candidate(STRONG, DIRECT, 14.2, loss=310.0),
    )


def selection(**changes):
    """A selection of a planar arm over two motions, with the loads of the arm and fields changed."""
    robot = bc.load_robot("planar_2r", gravity=(0, -9.81, 0))
    swing = bc.waypoints(
        robot, [0.0, 0.8, 1.6],
        [{"shoulder": -0.9, "elbow": 0.3}, {"shoulder": 0.7, "elbow": -1.0}, {"shoulder": -0.9, "elbow": 0.3}],
        name="swing",
    )  # fmt: skip
    lift = bc.waypoints(
        robot, [0.0, 1.0, 2.5], [{"elbow": -0.4}, {"shoulder": 0.9, "elbow": 1.2}, {"elbow": -0.4}], name="lift"
    )
    mechanism = mechanism_of(robot)
    loads = axis_loads(mechanism, [swing, lift])
    axes = tuple(
        AxisSelection(
            axis=axis,
            chosen=candidates()[k],
            candidates=candidates(),
            counts=(("all criteria shown", 2), ("passes what is known", 3), ("fails", 1)),
        )
        for k, axis in enumerate(loads.axes)
    )
    pairs = [tuple(one.id for one in each) for each in zip(*[candidates()] * 2, strict=True)]
    fields = {
        "robot": "planar_2r",
        "objective": "mass",
        "axes": axes,
        "cycles": loads.cycles,
        "conditions": Conditions(safety_factor=1.2),
        "system": (
            CriterionResult(name="supply power", use=None, verdict="unknown", text="The supply's power is not stated."),
            CriterionResult(name="regenerated energy", use=0.42, verdict="inside", text="The capacitor takes 8 J of 19 J."),
        ),
        "iterations": (("flat70+csg17", "flat70+csg17"), ("flat70+csg17", "strong+csg17")),
        "proof": "optimal: every combination was excluded or tried",
        "pareto": (
            ParetoPoint(0.582, 0.62, 28.0, 1640.0, pairs[0]),
            ParetoPoint(0.831, 0.62, 23.5, 1780.0, (pairs[0][0], pairs[1][1])),
            ParetoPoint(1.08, 0.31, 19.0, 1920.0, pairs[1]),
            ParetoPoint(1.33, 0.55, None, None, pairs[2]),
            ParetoPoint(None, 0.48, None, None, pairs[3]),
        ),
        "pareto_proof": "These are all such combinations.",
        "inputs": SelectionInputs(mechanism, (swing, lift)),
    }
    return Selection(**{**fields, **changes})
