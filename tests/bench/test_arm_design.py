"""The two-link arm of `bellcrank bench --arm`: its motion and its torques against collocation, and by hand."""

import numpy as np
import pytest

from bellcrank_bench.measurements import arm_design

# By MAPTOR 0.2.1 (`bellcrank bench --arm`) with a tolerance of 1e-6: 12.88212, in 1.9520 s, 61.35 and 26.89 N m. Its
# published example, with a tolerance of 1e-3, has 60.7 and 26.9 N m in 1.95 s.
COLLOCATION = 12.88212
REACHED = 1.045  # with 6 inner waypoints at given times: accelerations of a spline are 0 at both ends


def test_the_arm_begins_and_ends_where_its_tip_is_asked_to_be():
    for point in (arm_design.FROM, arm_design.TO):
        q1, q2 = arm_design.posture(*point)
        tip = arm_design.LENGTH * np.array([np.cos(q1) + np.cos(q1 + q2), np.sin(q1) + np.sin(q1 + q2)])
        assert tip == pytest.approx(point, abs=1e-12) and q1 >= 0.0


@pytest.mark.tier2
def test_the_motion_of_least_cost_is_near_that_of_collocation_and_keeps_all_limits_by_the_textbook():
    best, _ = arm_design.bellcrank_optimum(6)
    by_hand = arm_design.evaluated(arm_design.motion_of(best))
    assert by_hand.objective == pytest.approx(best.objective, rel=1e-6)
    assert by_hand.excess < 1e-6 and best.keeps_limits
    assert COLLOCATION < best.objective < REACHED * COLLOCATION
    assert best.gradients[arm_design.OBJECTIVE] == "differences"
