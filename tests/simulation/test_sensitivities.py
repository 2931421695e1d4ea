"""Sensitivities of runs against analytic derivatives, against extrapolated differences of runs, and by invariants."""

import math

import numpy as np
import pytest
from scipy.special import ellipe, ellipk

import bellcrank as bc
from bellcrank.dynamics.equations.directional_equations import DirectionalEquations
from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.errors import InputError
from tests.support.extrapolated import slope

TIGHT = {"rtol": 1e-12, "atol": 1e-13}


def with_parameters(name, targets, **changes):
    """A bundled scene with parameters p0, p1, … that set these targets to these values."""
    parameters = {f"p{k}": {"value": value, "sets": [target]} for k, (target, value) in enumerate(targets.items())}
    return bc.load_scene(name).with_overrides({"parameters": parameters, **changes})


def differences(scene, path, value, first, **settings):
    """The derivative of positions and velocities in the rows of runs, by extrapolated differences."""
    size = scene.robot.nq + scene.robot.nv

    def state(change):
        return bc.simulate(scene.with_overrides({path: value + change}), **TIGHT, **settings).state[:, :size]

    return slope(state, first)


def relative(found, expected):
    return np.abs(found - expected).max() / np.abs(expected).max()


def test_the_lock_time_of_the_four_bar_by_its_crank_length():
    def lock(change):
        scene = bc.load_scene("four_bar").with_overrides({"parameters.crank_length.value": 1.241 + change})
        return np.array([bc.simulate(scene, **TIGHT).events[-1].time])

    expected = slope(lock, 2e-4)[0]
    fine = bc.simulate("four_bar", sensitivities=["crank_length"], **TIGHT).sensitivity("crank_length")
    assert fine.event("lock").time == pytest.approx(expected, rel=1e-9)
    usual = bc.simulate("four_bar", sensitivities=["crank_length"]).sensitivity("crank_length")
    assert usual.event("lock").time == pytest.approx(expected, rel=1e-8)


def test_the_period_of_a_pendulum_by_its_length_and_its_amplitude():
    length, amplitude, gravity = 1.0, math.pi / 2.0, 9.81
    events = [{"name": "back", "when": {"joint": "swing", "velocity": 0.0}, "direction": "down", "stop": True}]
    mass = next(f for f in bc.load_scene("pendulum").robot.equations.tree.frames if f.mass > 0.0)
    scene = with_parameters("pendulum", {f"link.{mass.name}.cg.y": mass.lever[1]}, events=events)
    run = bc.simulate(scene, sensitivities=["p0", "initial.swing"], **TIGHT)
    k = math.sin(amplitude / 2.0)
    period = 4.0 * math.sqrt(length / gravity) * ellipk(k * k)
    by_modulus = (ellipe(k * k) - (1.0 - k * k) * ellipk(k * k)) / (k * (1.0 - k * k))
    by_amplitude = 4.0 * math.sqrt(length / gravity) * by_modulus * 0.5 * math.cos(amplitude / 2.0)
    assert mass.lever[1] == -length
    assert run.events[-1].time == pytest.approx(period / 2.0, rel=1e-11)  # at the other side
    # dT/dL = T/(2 L); the centre of mass is at −L, the start at −90 deg
    assert run.sensitivity("p0").event("back").time == pytest.approx(-period / (4.0 * length), rel=1e-10)
    assert run.sensitivity("initial.swing").event("back").time == pytest.approx(-by_amplitude / 2.0, rel=1e-10)


@pytest.mark.parametrize(
    ("name", "variable", "path", "value", "first", "bound"),
    [
        ("spring_pendulum", "initial.slide", "initial.slide", None, 1e-2, 1e-9),
        ("planar_2r_swing", "initial.shoulder", "initial.shoulder", None, 2e-3, 1e-8),
        ("planar_2r_swing", "initial.velocity.elbow", "initial.velocity.elbow", 0.0, 2e-3, 1e-8),
        ("four_bar", "crank_length", "parameters.crank_length.value", 1.241, 2e-4, 1e-8),
        ("four_bar", "initial.crank", "initial.crank", math.radians(1.0), 2e-3, 1e-8),
    ],
)
def test_rows_are_the_derivatives_of_runs(name, variable, path, value, first, bound):
    scene = bc.load_scene(name)
    if value is None:
        value = scene.initial.position[variable.removeprefix("initial.")]
    settings = {"duration": 3.0, "samples": 13}  # the motion of the 2R is chaotic: differences fail after some seconds
    run = bc.simulate(scene, sensitivities=[variable], **TIGHT, **settings)
    expected = differences(scene, path, value, first, **settings)
    assert relative(run.sensitivity(variable).state, expected) < bound


def test_a_rolling_disk_by_its_inertia_and_by_a_scale_of_its_mass():
    disk = next(f for f in bc.load_scene("rolling_disk").robot.equations.tree.frames if f.mass > 0.0)
    targets = {f"link.{disk.name}.inertia.yy": disk.inertia[2], f"link.{disk.name}.scale": 1.0}
    scene = with_parameters("rolling_disk", targets)
    settings = {"duration": 2.0, "samples": 9}
    run = bc.simulate(scene, sensitivities=["p0", "p1"], **TIGHT, **settings)
    value = disk.inertia[2]
    expected = differences(scene, "parameters.p0.value", value, 0.02 * value, **settings)
    assert relative(run.sensitivity("p0").state, expected) < 1e-8
    assert np.abs(run.sensitivity("p1").state).max() < 1e-10  # heavier in all, it rolls the same


def test_a_linkage_that_passes_postures_where_its_constraints_lose_rank():
    scene = bc.load_scene("n_four_bar_2")
    run = bc.simulate(scene, duration=4.0, samples=41, sensitivities=["initial.velocity.crank_0"], **TIGHT)
    found = run.sensitivity("initial.velocity.crank_0")
    # no force does work: the derivative of the energy is that of the start
    energy = found.kinetic_energy + found.potential_energy
    assert energy == pytest.approx(np.full(41, energy[0]), rel=1e-4)
    expected = differences(scene, "initial.velocity.crank_0", -1.0, 1e-3, duration=4.0, samples=41)
    assert relative(found.state, expected) < 1e-4  # runs themselves lose digits in the flat postures


@pytest.mark.parametrize("name", ["spring_pendulum", "planar_2r_swing"])
def test_the_derivative_of_energy_is_constant_where_energy_is_conserved(name):
    scene = bc.load_scene(name)
    joint = next(iter(scene.initial.position))
    run = bc.simulate(scene, duration=3.0, samples=61, sensitivities=[f"initial.{joint}"], **TIGHT)
    found = run.sensitivity(f"initial.{joint}")
    energy = found.kinetic_energy + found.potential_energy
    largest = np.abs(found.kinetic_energy).max() + np.abs(found.potential_energy).max()
    assert np.abs(energy - energy[0]).max() < 1e-9 * largest


def test_sensitivities_satisfy_the_derivatives_of_the_constraints():
    scene = bc.load_scene("four_bar")
    run = bc.simulate(scene, samples=51, sensitivities=["coupler_length"])
    found = run.sensitivity("coupler_length")
    equations = DirectionalEquations(scene, (list(scene.parameters).index("coupler_length"),))
    for row in range(0, len(run), 10):
        point = np.array([run.time[row]]), run.state[row], np.zeros(0), run.parameters
        position, velocity = equations.residual(*point, found.state[row], np.ones(1))
        assert np.abs(position).max() < 1e-12 * max(1.0, np.abs(found.position[row]).max())
        assert np.abs(velocity).max() < 1e-12 * max(1.0, np.abs(found.state[row]).max())


@pytest.mark.parametrize("kind", ["projection", {"kind": "baumgarte", "alpha": 20, "beta": 20}, "none"])
def test_the_rate_along_directions_is_the_derivative_of_the_right_hand_side(kind):
    scene = bc.load_scene("four_bar").with_overrides({"simulate.stabilisation": kind})
    system, equations = system_of(scene), DirectionalEquations(scene, (0, 1, 2, 3))
    random = np.random.default_rng(3)
    start = bc.simulate(scene, duration=1.0, samples=2).state[-1]
    x, p = start + 1e-3 * random.normal(size=system.size), system_parameters(scene)
    dx, dp = random.normal(size=6), random.normal(size=4)

    def rate(step):
        changed = p.copy()
        changed[:4] += step * dp
        return system.rhs(np.zeros(1), x + step * np.append(dx, np.zeros(system.size - 6)), np.zeros(0), changed)[0][:6]

    point, along = equations.rate.point, equations.rate.along.graph
    *_, tape = point(np.zeros(1), x, np.zeros(0), p)
    found = evaluated(along, [tape, dx, dp])
    assert relative(found, slope(rate, 1e-3)) < 1e-10


def evaluated(graph, inputs):
    """The output of a graph of sums and products, operation by operation."""
    operations = {"add": np.add, "sub": np.subtract, "mul": np.multiply, "neg": np.negative, "twice": lambda x: x + x}
    values = []
    for node in graph.nodes:
        if node.op == "const":
            values.append(node.value)
        elif node.op == "input":
            values.append(inputs[node.place[0]][node.place[1]])
        else:
            values.append(operations[node.op](*[values[k] for k in node.args]))
    size, entries, nodes = graph.outputs[0]
    output = np.zeros(size)
    output[entries] = [values[k] for k in nodes]
    return output


@pytest.mark.tier2
def test_a_latch():
    events = [{"name": "lock", "when": {"aligned": {"joint_a": "coupler", "joint_b": "rocker"}}, "latch": True}]
    scene = bc.load_scene("four_bar").with_overrides({"events": events})

    def latched(change):
        event = bc.simulate(scene.with_overrides({"parameters.crank_length.value": 1.241 + change}), **TIGHT).events[-1]
        return np.concatenate([event.latch.velocity, event.position, [event.latch.impulse, event.energy_lost]])

    expected = slope(latched, 2e-4)
    found = bc.simulate(scene, sensitivities=["crank_length"], **TIGHT).sensitivity("crank_length").event("lock")
    assert relative(found.position, expected[3:6]) < 1e-8
    # the differences have rounding of the runs: 1e-12 of the time at a step of 1e-5
    assert found.impulse == pytest.approx(expected[6], rel=1e-6)
    assert found.energy_lost == pytest.approx(expected[7], rel=1e-6)
    assert np.abs(found.latch_velocity).max() < 1e-9 > np.abs(expected[:3]).max()  # locked, whatever the length


@pytest.mark.parametrize("solver", ["Radau", "RK45", "auto"])
def test_runs_of_other_solvers_have_the_same_sensitivities(solver):
    by = {"duration": 2.0, "samples": 21, "sensitivities": ["initial.shoulder"]}
    expected = bc.simulate("planar_2r_swing", **TIGHT, **by).sensitivity("initial.shoulder").state
    found = bc.simulate("planar_2r_swing", solver=solver, rtol=1e-10, atol=1e-10, **by)
    assert relative(found.sensitivity("initial.shoulder").state, expected) < 1e-7


def test_rows_at_the_ends_of_steps_and_of_outputs():
    run = bc.simulate("four_bar", times="steps", sensitivities=["crank_length", "initial.crank"])
    found = run.sensitivity("initial.crank")
    assert found.state.shape == (len(run), 6)
    assert found.output("apex_force").shape == run.output("apex_force").shape
    assert np.isfinite(found.acceleration).all() and np.isfinite(found.multipliers).all()
    assert run.sensitivities == ("crank_length", "initial.crank")


def test_what_is_refused():
    with pytest.raises(InputError, match="sensitivities: unknown parameter or start 'crank_lenght'; did you mean"):
        bc.simulate("four_bar", sensitivities=["crank_lenght"])
    with pytest.raises(InputError, match="'crank_length' is there twice"):
        bc.simulate("four_bar", sensitivities=["crank_length", "crank_length"])
    with pytest.raises(InputError, match=r"'initial\.velocity\.crank' has no value in the scene"):
        bc.simulate("four_bar", sensitivities=["initial.velocity.crank"])
    with pytest.raises(InputError, match="this run has no sensitivities"):
        bc.simulate("four_bar", samples=3).sensitivity("crank_length")
    run = bc.simulate("four_bar", samples=3, sensitivities="crank_length")
    with pytest.raises(InputError, match="unknown sensitivity 'rocker_length'"):
        run.sensitivity("rocker_length")
    with pytest.raises(InputError, match="unknown event of the run 'lok'"):
        run.sensitivity("crank_length").event("lok")


def test_files(tmp_path):
    run = bc.simulate("four_bar", samples=11, sensitivities=["crank_length"])
    found = run.sensitivity("crank_length")
    head, first, *_ = found.to_csv(tmp_path / "s.csv").read_text().splitlines()
    titles = head.split(",")
    assert titles[0] == "time [s]" and "d(coupler velocity)/d(crank_length) [rad/s per m]" in titles
    assert [float(x) for x in first.split(",")][1:4] == found.position[0].tolist()


def test_a_start_that_the_constraints_do_not_determine():
    scene = bc.load_scene("n_four_bar_2").with_overrides({"initial": {"crank_0": {"guess": 0.3}}})
    run = bc.simulate(scene, duration=0.2, samples=3, sensitivities=["initial.crank_0"], **TIGHT)
    found = run.sensitivity("initial.crank_0")
    assert "nearest start" in found.notes[0]
    guessed = {"initial.crank_0": {"guess": 0.3}}

    def start(change):
        guessed["initial.crank_0"] = {"guess": 0.3 + change}
        return bc.simulate(scene.with_overrides(guessed), duration=0.2, samples=3, **TIGHT).state[:, :10]

    assert relative(found.state, slope(start, 1e-2)) < 1e-7
