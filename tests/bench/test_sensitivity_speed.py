"""The cost of gradients of runs."""

import pytest

from bellcrank.codegen.expression_graph import contracted
from bellcrank.dynamics.equations.directional_equations import DirectionalEquations
from bellcrank.dynamics.equations.system import system_of
from bellcrank.scene.scene import load_scene
from bellcrank_bench.measurements import sensitivity_speed


@pytest.mark.parametrize("name", ["four_bar", "ur5_falling"])
def test_twenty_directions_cost_a_few_evaluations(name):
    scene, variables = sensitivity_speed.with_parameters(load_scene(name), 20)
    assert len(variables) == 20
    equations = DirectionalEquations(scene, tuple(range(len(scene.parameters))))
    rate = contracted(system_of(scene).rhs.graph).operations
    point, along = (contracted(half.graph).operations for half in (equations.rate.point, equations.rate.along))
    # three blocks of eight lanes cover 20 directions; the run itself evaluates the rate once
    assert (rate + point + 3 * along) / rate < 8.0


def test_a_row(monkeypatch):
    monkeypatch.setattr(sensitivity_speed, "SETTLING", 0.0)
    rows = list(sensitivity_speed.sensitivity_rows(["planar_2r_swing"], 2))
    assert rows and all(row.gradient > row.run > 0.0 and row.gradient_steps >= row.run_steps for row in rows)
    assert len(sensitivity_speed.table(rows)) == len(rows) + 1
    assert sensitivity_speed.as_json(rows)[0]["ratio"] == rows[0].ratio
