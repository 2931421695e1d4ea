"""The use of a printed curve of short-time operation, measured along the ray from the origin."""

from __future__ import annotations

import numpy as np
import pytest
from random_catalogue import random_cycles
from scipy.optimize import brentq

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.gear import DIRECT
from bellcrank.actuators.motor import Motor
from bellcrank.sizing.selection.judge import in_words
from bellcrank.sizing.selection.load_reductions import reduce_loads
from bellcrank.sizing.selection.pairs import Pairs


@pytest.mark.parametrize("shape", ["convex", "dented"])
def test_the_use_is_the_factor_by_which_the_farthest_sample_lies_outside_the_curve(shape: str) -> None:
    axes, (cycle,) = random_cycles(1, 2, samples=100)
    loads = reduce_loads(axes, (cycle,))[0]
    torque, speed, inertia = np.abs(cycle.torque).max(), np.abs(cycle.speed).max(), 0.02
    middle = {"convex": (0.6, 1.2), "dented": (0.6, 0.3)}[shape]
    curve = ((0.0, 1.3 * torque), (middle[0] * speed, middle[1] * torque), (1.1 * speed, 0.2 * torque))
    motor = Motor(id="m", maker="", model="", rotor_inertia=inertia, coulomb_friction=0.0, viscous_friction=0.0,
                  peak_curve=curve)  # fmt: skip
    found = {one.name: one for one in in_words(Pairs.of((motor, DIRECT)), loads, Conditions())}

    corners = np.array(curve)
    uses = []
    for load, rate, change in zip(cycle.torque[:, 0], cycle.speed[:, 0], cycle.acceleration[:, 0], strict=True):
        shaft = abs(load + inertia * change)

        def outside(share: float, shaft: float = shaft, rate: float = abs(rate)) -> float:
            return float(shaft - share * np.interp(rate / share, *corners.T, right=-1.0))

        uses.append(max(brentq(outside, 1e-6, 100.0, xtol=1e-12), abs(rate) / corners[-1, 0]))
    assert found["peak curve"].use == pytest.approx(max(uses), rel=1e-9)
