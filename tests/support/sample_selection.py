"""A selection for tests of the page, made by hand: real loads of an arm, products of no maker, verdicts as wanted."""

import dataclasses

import bellcrank as bc
from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.gear import DIRECT, Gear
from bellcrank.actuators.motor import Motor
from bellcrank.dynamics.inverse.mechanism import mechanism_of
from bellcrank.sizing.selection.axis_loads_of import axis_loads
from bellcrank.sizing.selection.criteria import CriterionResult
from bellcrank.sizing.selection.selection import AxisSelection, Candidate, ParetoPoint, Selection, SelectionInputs

# Products of no maker.
FULL = Motor(
    id="s40", maker="Bolt", model="S 40", nominal_voltage=320.0, torque_constant=0.7, torque_constant_basis="dc",
    resistance=1.1, no_load_speed=450.0, no_load_current=0.3, rotor_inertia=4e-4, nominal_torque=5.2,
    nominal_speed=314.0, max_speed=500.0, peak_torque=17.0, peak_time=2.0, resistance_winding_housing=0.31,
    resistance_housing_ambient=0.42, time_constant_winding=80.0, time_constant_motor=1500.0,
    max_winding_temperature=140.0, reference_temperature=25.0, mass=4.1, diameter=0.1, length=0.18, price=420.0,
    currency="EUR",
)  # fmt: skip
STRONG = dataclasses.replace(
    FULL, id="strong", model="S 80", maker="Acme", torque_constant=1.1, nominal_torque=9.5, peak_torque=30.0, mass=7.2,
    rotor_inertia=9e-4, resistance=0.9, price=760.0, no_load_speed=286.0, nominal_speed=200.0,
)  # fmt: skip
BARE = Motor(id="bare", maker="Acme", model="Bare", nominal_torque=3.0, nominal_speed=300.0, price=80.0, currency="EUR")
HARMONIC = Gear(
    id="wave", maker="Wave", model="W-40-100", kind="strain_wave", ratio=100.0, efficiency=0.7, inertia=7.9e-5,
    rated_torque=310.0, repeated_peak_torque=700.0, momentary_torque=1400.0, max_speed=400.0, mass=3.3, diameter=0.17,
    length=0.06, price=1900.0, currency="EUR",
)  # fmt: skip
PLANET = Gear(
    id="planet", maker="Acme", model="P 1:50", kind="planetary", ratio=50.0, efficiency=0.8, back_efficiency=0.75,
    efficiency_curve=((0.05, 0.5), (0.5, 0.75), (1.0, 0.8)), rated_torque=400.0, inertia=1.2e-5, mass=6.0,
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


def together(motor, gear, name):
    parts = getattr(motor, name), getattr(gear, name)
    return None if None in parts else sum(parts)


def candidate(motor, gear, use, unknown=0, loss=None, estimate=None):
    tier = "fails" if use > 1.0 else "passes what is known" if unknown else "all criteria shown"
    return Candidate(
        motor=motor,
        gear=gear,
        tier=tier,
        criteria=criteria(use, unknown, estimate),
        binding=NAMES[0],
        mass=together(motor, gear, "mass"),
        cost=together(motor, gear, "price"),
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
            conditions=Conditions(safety_factor=1.2),
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
            CriterionResult(
                name="regenerated energy", use=0.42, verdict="inside", text="The capacitor takes 8 J of 19 J."
            ),
        ),
        "iterations": (("s40+wave", "s40+wave"), ("s40+wave", "strong+wave")),
        "proof": "optimal: every combination was excluded or tried",
        "pareto": (
            ParetoPoint(14.8, 0.62, 28.0, 4640.0, pairs[0]),
            ParetoPoint(17.9, 0.62, 23.5, 4980.0, (pairs[0][0], pairs[1][1])),
            ParetoPoint(21.0, 0.31, 19.0, 5320.0, pairs[1]),
            ParetoPoint(26.4, 0.55, None, None, pairs[2]),
            ParetoPoint(None, 0.48, None, None, pairs[3]),
        ),
        "pareto_proof": "These are all such combinations.",
        "inputs": SelectionInputs(mechanism, (swing, lift)),
    }
    return Selection(**{**fields, **changes})
