"""Of pairs that pass what is known, the one of which the most is known comes first, however light another is."""

from __future__ import annotations

from typing import Any

import pytest

import bellcrank as bc

STATED = bc.Motor(
    id="stated", maker="Own", model="S", nominal_voltage=48.0, torque_constant=0.5, torque_constant_basis="dc",
    rotor_inertia=4e-3, nominal_torque=40.0, nominal_speed=50.0, peak_torque=90.0, max_speed=94.0, mass=5.0,
)  # fmt: skip
SILENT = bc.Motor(id="silent", maker="Own", model="Q", rotor_inertia=4e-3, nominal_torque=40.0, mass=3.0)


@pytest.mark.parametrize("objective", ["mass", "margin"])
def test_fewer_unknown_criteria_come_before_the_objective(objective: Any) -> None:
    robot = bc.load_robot("planar_2r", gravity=(0.0, 0.0, 0.0))
    move = bc.waypoints(robot, [0.0, 2.0], [{}, {"elbow": 0.5, "shoulder": 0.5}])
    direct = {"inertia_ratio": 1e5}  # without a gear
    selection = bc.select(robot, [move], bc.Catalogue((SILENT, STATED), ()), objective=objective, conditions=direct)
    for axis in selection.axes:
        first, second = axis.candidates
        assert {first.tier, second.tier} == {"passes what is known"}
        assert (axis.chosen.id, first.id, second.id) == ("stated", "stated", "silent")
        assert set(first.unknown) < set(second.unknown)
