"""A prepared simulation gives the runs of `simulate`, whatever it was called with before."""

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.errors import InputError

CASES = {
    "four_bar": ("crank_length", 1.2, 1.25),
    "spring_pendulum": ("initial.swing", -0.5, 0.5),
    "planar_2r_swing": ("initial.elbow", -1.0, 1.0),
    "n_four_bar_2": (None, 0.0, 0.0),
    "five_bar": ("initial.left_motor", 1.8, 1.9),
    "rolling_disk": (None, 0.0, 0.0),
}


def cases():
    for scene, (name, low, high) in CASES.items():
        loaded = bc.load_scene(scene)
        if name is None or name in loaded.parameters or name.removeprefix("initial.") in loaded.initial.position:
            yield scene, name, low, high
        else:
            raise AssertionError(f"{scene} has no {name}")


@pytest.mark.tier2
@pytest.mark.parametrize(("scene", "name", "low", "high"), cases())
def test_a_prepared_call_gives_the_bits_of_simulate(scene, name, low, high):
    settings = {"duration": 1.0, "rtol": 1e-7, "atol": 1e-7, "samples": 21}
    prepared, random = bc.prepare(scene, **settings), np.random.default_rng(5)
    drawn = [{}] if name is None else [{name: float(random.uniform(low, high))} for _ in range(4)]
    for values in [*drawn, *reversed(drawn), {}]:
        run = prepared(values)
        alone = bc.simulate(scene, overrides=values or None, **settings)
        assert run.status is alone.status
        assert np.array_equal(run.time, alone.time) and np.array_equal(run.state, alone.state)
        assert run.events == tuple((event.name, event.time) for event in alone.events)
        assert np.array_equal(run.trajectory().state, alone.state)


def test_a_prepared_simulation_refuses_what_the_scene_refuses():
    prepared = bc.prepare("four_bar", samples=2)
    with pytest.raises(InputError, match=r"unknown .*'crank_lenght'.*crank_length"):
        prepared({"crank_lenght": 1.2})
    with pytest.raises(InputError, match="constraints cannot be satisfied"):
        prepared({"crank_length": 9.0})
    with pytest.raises(InputError, match="crank_length"):
        prepared({"crank_length": float("nan")})
    assert prepared({"crank_length": 1.22}).events[-1][0] == "lock"


def test_the_results_of_a_call_do_not_change_those_of_the_next():
    scene = bc.load_scene("four_bar")
    for simulate in (lambda: bc.simulate(scene, samples=5), bc.prepare(scene, samples=5)):
        first = simulate()
        kept = first.state.copy()
        first.state[:], first.time[:] = 7.0, 3.0
        assert np.array_equal(simulate().state, kept)
