"""Sampled controllers against loops written by hand: plain Pinocchio, scipy and numpy between the samples."""

import json
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from rotor import INERTIA, rotor
from scipy.integrate import solve_ivp

import bellcrank as bc
from bellcrank.errors import InputError

PERIOD = 0.05


def controller(**keys):
    return {"name": "servo", "kind": "state_space", "joint": "spin", "sample_time": PERIOD, **keys}


def by_hand(model, q, v, duration, instants, torque_of, rows):
    """States at times `rows`: plain forward dynamics, from each instant on with the torques torque_of(time, q, v)."""
    data = model.createData()
    edges = np.unique(np.round([0.0, duration, *(t for t in instants if 0.0 <= t < duration)], 12))
    state, found = np.concatenate([q, v]), {}
    for begin, end in pairwise(edges):
        torque = torque_of(begin, *np.split(state, 2))

        def rate(t, x, torque=torque):
            q, v = np.split(x, 2)
            return np.concatenate([v, pin.aba(model, data, q, v, torque)])

        inside = [t for t in rows if begin <= t < end or (end == duration and t == duration)]
        out = solve_ivp(
            rate, (begin, end), state, method="DOP853", rtol=1e-13, atol=1e-13, t_eval=sorted({*inside, end})
        )
        found |= dict(zip(inside, out.y.T, strict=False))
        state = out.y[:, -1]
    return np.array([found[t] for t in rows])


@pytest.mark.parametrize(("delay", "limit"), [(0.0, None), (0.02, None), (0.05, 6.0), (0.13, 9.0)])
def test_a_discrete_controller_with_delay_and_saturation_is_the_loop_by_hand(tmp_path, delay, limit):
    """Two joints of an arm under gravity, A, B, C and D full."""
    a, b = [[0.9, 0.1], [0.0, 0.8]], [[0.02, 0.0], [0.01, 0.03]]
    c, d = [[30.0, -5.0], [4.0, 12.0]], [[25.0, 1.0], [-2.0, 8.0]]
    wanted = np.array([0.4, -0.3])
    scene = {
        "urdf": "planar_2r", "gravity": [0, -9.81, 0], "initial": {"shoulder": 0.3, "elbow": -0.5},
        "simulate": {"duration": 0.6, "rtol": 1e-12, "atol": 1e-12, "solver": "DOP853"},
        "control": [{
            "name": "servo", "kind": "state_space", "joints": ["shoulder", "elbow"], "A": a, "B": b, "C": c, "D": d,
            "inputs": ["0.4 - shoulder.position", "-0.3 - elbow.position"], "sample_time": PERIOD, "delay": delay,
            "initial": [0.1, -0.2], **({} if limit is None else {"limit": limit}),
        }],
    }  # fmt: skip
    (tmp_path / "arm.yaml").write_text(json.dumps(scene))
    times = np.linspace(0.0, 0.6, 25)
    arm = bc.load_scene(tmp_path / "arm.yaml")
    run = bc.simulate(arm, times=times)

    samples = [k * PERIOD for k in range(13)]
    state, waiting = np.array([0.1, -0.2]), {}

    def torque(t, q, v):
        nonlocal state
        k = round(t / PERIOD)
        if abs(t - k * PERIOD) < 1e-9:
            y = wanted - q
            u = np.array(c) @ state + np.array(d) @ y
            waiting[k * PERIOD + delay] = u if limit is None else np.clip(u, -limit, limit)
            state = np.array(a) @ state + np.array(b) @ y
        due = [when for when in waiting if when <= t + 1e-9]
        return waiting[max(due)] if due else np.zeros(2)

    instants = [*samples, *(t + delay for t in samples)]
    expected = by_hand(arm.robot.model, np.array([0.3, -0.5]), np.zeros(2), 0.6, instants, torque, times.tolist())
    assert np.abs(run.position - expected[:, :2]).max() < 1e-10
    assert np.abs(run.velocity - expected[:, 2:]).max() < 1e-9
    if limit is not None:
        assert np.abs(run.actuator_torque).max() == limit


def test_between_two_samples_the_torque_is_constant_and_no_step_crosses_one(tmp_path):
    scene = rotor(tmp_path, control=[controller(inputs=["1 - spin.position"], D=[[8.0]])])
    run = bc.simulate(scene, times=[0.049, 0.051, 0.099, 0.999, 1.001])
    torque = run.joint("spin").actuator_torque
    assert torque[1] == torque[2] != torque[0]
    assert torque[0] == 8.0
    for k in range(1, 20):
        assert np.abs(run.steps - k * PERIOD).min() < 1e-12


def test_a_gain_alone_is_the_map_of_a_sampled_double_integrator(tmp_path):
    """x+ = x + v T + u T^2 / 2J, v+ = v + u T / J with u = k (1 - x) - d v."""
    scene = rotor(tmp_path, control=[controller(inputs=["1 - spin.position", "spin.velocity"], D=[[8.0, -3.0]])])
    run = bc.simulate(scene, times=np.arange(60) * PERIOD)
    x = v = 0.0
    for k in range(60):
        assert run.joint("spin").position[k] == pytest.approx(x, abs=1e-12)
        u = 8.0 * (1.0 - x) - 3.0 * v
        x, v = x + v * PERIOD + 0.5 * u / INERTIA * PERIOD**2, v + u / INERTIA * PERIOD


def test_matrices_of_a_file_are_those_of_the_scene(tmp_path):
    matrices = {"A": [[1.0]], "B": [[PERIOD]], "C": [[2.0]], "D": [[8.0]], "sample_time": PERIOD}
    given = controller(inputs=["1 - spin.position"], **matrices)
    named = {
        "name": "servo",
        "kind": "state_space",
        "joint": "spin",
        "inputs": ["1 - spin.position"],
        "file": "pi.json",
    }
    one = bc.simulate(rotor(tmp_path, control=[given]))
    two = bc.simulate(rotor(tmp_path, {"pi.json": json.dumps(matrices)}, control=[named]))
    assert (one.state == two.state).all()
    again = bc.load_run(two.save(tmp_path / "run.npz"))
    assert (again.actuator_torque == two.actuator_torque).all()
    repeated = bc.simulate(again.scene)
    assert (repeated.state == two.state).all()


def test_state_feedback_is_its_formula_and_reads_its_gain_from_a_file(tmp_path):
    feedback = {"name": "hold", "kind": "state_feedback", "joints": ["spin", "slide"],
                "states": ["spin.position", "spin.velocity", "slide.position", "slide.velocity"],
                "reference": ["30 deg", 0, "0.1 * t", 0.1], "feedforward": [0.5, "2 * t"]}  # fmt: skip
    gain = [[8.0, 2.0, 0.5, 0.0], [0.0, 0.3, 9.0, 3.0]]
    one = bc.simulate(rotor(tmp_path, control=[{**feedback, "gain": gain}]))
    text = "# K of the regulator\n" + "\n".join(", ".join(map(str, row)) for row in gain) + "\n"
    two = bc.simulate(rotor(tmp_path, {"gain.csv": text}, control=[{**feedback, "file": "gain.csv"}]))
    assert (one.state == two.state).all()
    spin, slide, t = one.joint("spin"), one.joint("slide"), one.time
    x = np.stack([spin.position - np.pi / 6, spin.velocity, slide.position - 0.1 * t, slide.velocity - 0.1])
    expected = np.stack([0.5 + 0 * t, 2 * t]) - np.array(gain) @ x
    assert np.abs(np.stack([spin.actuator_torque, slide.actuator_torque]) - expected).max() < 1e-12


def test_the_gain_of_a_linearisation_moves_the_poles_where_the_regulator_wants_them(tmp_path):
    """K for poles of the slider at -2 and -3: k = 6 m, d = 5 m; the closed scene has these eigenvalues."""
    plant = bc.linearise(rotor(tmp_path), inputs=["slide"])
    assert [name for name, _ in plant.states] == ["slide", "spin", "slide rate", "spin rate"]
    feedback = {"kind": "state_feedback", "joint": "slide", "gain": [12, 0, 10, 0]}
    closed = bc.linearise(rotor(tmp_path, control=[feedback]))
    assert sorted(np.real(closed.eigenvalues)) == pytest.approx([-3, -2, 0, 0], abs=1e-7)


def test_a_limit_of_a_formula_controller_is_located(tmp_path):
    """v' = min(2 (1 - t), 1) of a motor with a limit: the corner at t = 0.5 is a switch."""
    torque = {"name": "push", "kind": "torque", "joint": "spin", "value": f"{INERTIA} * 2 * (1 - t)", "limit": INERTIA}
    run = bc.simulate(rotor(tmp_path, control=[torque]), times=[0.5, 1.0, 1.5, 2.0])
    assert run.joint("spin").velocity == pytest.approx([0.5, 0.75, 0.5, 0.0], abs=1e-12)
    assert run.signals[-1].breaks[1:-1] == pytest.approx([0.5, 1.5], abs=1e-12)


def test_a_python_function_is_sampled_as_the_same_controller_of_the_scene(tmp_path):
    calls = []

    def law(t, q, v):
        calls.append(t)
        return {"spin": 8.0 * (1.0 - q[1]) - 3.0 * v[1]}

    run = bc.simulate(rotor(tmp_path), controller=law, sample_time=PERIOD)
    same = controller(inputs=["1 - spin.position", "spin.velocity"], D=[[8.0, -3.0]])
    other = bc.simulate(rotor(tmp_path, control=[same]))
    assert np.abs(run.position - other.position).max() < 1e-12
    assert calls == pytest.approx(np.arange(60) * PERIOD)
    assert (run.joint("spin").actuator_torque[:-1] != 0.0).any()
    with pytest.raises(InputError, match="no file can hold"):
        run.save(tmp_path / "run.npz")
    as_array = bc.simulate(rotor(tmp_path), controller=lambda t, q, v: [0.0, law(t, q, v)["spin"]], sample_time=PERIOD)
    assert (as_array.state == run.state).all()


@pytest.mark.parametrize(
    ("law", "sample_time", "why"),
    [
        (lambda t, q, v: "x", 0.1, "at t = 0 s it returned 'x'; expected the torques of slide, spin"),
        (lambda t, q, v: [0.0, np.nan if t > 0.25 else 0.0], 0.1, "at t = 0.3 s"),
        (lambda t, q, v: [0.0], 0.1, "expected the torques of slide, spin"),
        (lambda t, q, v: {"arm": 1.0}, 0.1, "'arm' is not one of the joints with motors"),
        (lambda t, q, v: [0, 0], None, "expected the seconds between two calls"),
        (lambda t, q, v: [0, 0], -1.0, "sample_time"),
        (None, 0.1, "nothing without a `controller`"),
        (3, 0.1, "controller"),
    ],
)
def test_a_function_that_is_no_controller_is_refused(tmp_path, law, sample_time, why):
    with pytest.raises(InputError, match=why):
        bc.simulate(rotor(tmp_path), controller=law, sample_time=sample_time)


def test_an_error_in_the_function_is_raised_as_it_is(tmp_path):
    with pytest.raises(ZeroDivisionError):
        bc.simulate(rotor(tmp_path), controller=lambda t, q, v: 1 / 0, sample_time=0.1)


@pytest.mark.parametrize(
    ("keys", "why"),
    [
        ({"inputs": ["t"], "D": [[1.0]], "sample_time": 0}, "sample_time"),
        ({"inputs": ["t"], "D": [[1.0, 2.0]]}, "D"),
        ({"inputs": ["t"], "A": [[1.0]], "C": [[1.0]]}, "'B' is missing"),
        ({"inputs": ["t"], "A": [[1.0, 0.0]], "B": [[1]], "C": [[1]]}, "A"),
        ({"inputs": [], "D": [[1.0]]}, "inputs"),
        ({"inputs": ["t"], "D": [[1.0]], "delay": 1e3}, "at most 1000 sample times"),
        ({"inputs": ["spin.acceleration"], "D": [[1.0]]}, "accelerations"),
        ({"inputs": ["t"], "D": [[1.0]], "file": "x.json"}, "x.json|exclude"),
        ({"D": [[1.0]]}, "'inputs' is missing"),
    ],
)
def test_a_discrete_controller_that_cannot_be_meant_is_refused(tmp_path, keys, why):
    with pytest.raises(InputError, match=why):
        rotor(tmp_path, control=[controller(**keys)])


def test_a_continuous_state_space_is_refused_with_the_remedy(tmp_path):
    keys = {key: value for key, value in controller(inputs=["t"], D=[[1.0]]).items() if key != "sample_time"}
    with pytest.raises(InputError, match="cont2discrete"):
        rotor(tmp_path, control=[keys])


def test_what_needs_continuous_equations_says_so(tmp_path):
    scene = rotor(tmp_path, control=[controller(inputs=["1 - spin.position"], D=[[8.0]])])
    with pytest.raises(InputError, match="control 'servo' is sampled"):
        bc.linearise(scene)


def test_a_sweep_of_a_sampled_loop_is_its_runs(tmp_path):
    servo = controller(inputs=["wanted - spin.position", "spin.velocity"], D=[[8.0, -3.0]])
    scene = rotor(tmp_path, control=[servo], parameters={"wanted": {"value": 1.0}}, outputs={"u": {"force": "servo"}})
    study = bc.sweep(scene, {"wanted": [0.5, 1.0, 2.0]})
    for row, wanted in enumerate((0.5, 1.0, 2.0)):
        run = bc.simulate(scene, overrides={"wanted": wanted})
        assert study.column("end.spin")[row] == pytest.approx(run.joint("spin").position[-1], abs=1e-12)
        assert study.column("largest.u")[row] == pytest.approx(8.0 * wanted, abs=1e-12)
        assert study.column("end.u")[row] == pytest.approx(run.output("u")[-1], abs=1e-10)


def test_samples_follow_the_clock_of_the_start(tmp_path):
    servo = controller(inputs=["t"], D=[[1.0]], sample_time=0.2)
    run = bc.simulate(rotor(tmp_path, control=[servo], initial={"clock": 0.25}), times=[0.0, 0.1, 0.16, 0.4])
    assert run.joint("spin").actuator_torque == pytest.approx([0.0, 0.0, 0.4, 0.6], abs=1e-12)


def test_checkpoints_of_a_sampled_loop_open_as_a_run(tmp_path):
    servo = controller(inputs=["1 - spin.position", "spin.velocity"], D=[[8.0, -3.0]], sample_time=1e-3)
    scene = rotor(tmp_path, control=[servo])
    reached = []

    def stop(t, _):
        reached.append(t)
        if len(reached) > 3:
            raise RuntimeError("stopped")

    with pytest.raises(RuntimeError, match="stopped"):
        bc.simulate(
            scene, duration=1e4, samples=100_001, checkpoint=tmp_path / "run.npz", checkpoint_every=0.05, progress=stop
        )
    part = bc.load_run(tmp_path / "run.blocks")
    whole = bc.simulate(scene, duration=1.0, times=[0.9])
    row = int(np.argmin(np.abs(part.time - 0.9)))
    assert part.joint("spin").actuator_torque[row] == pytest.approx(whole.joint("spin").actuator_torque[0], abs=1e-9)
    assert part.joint("spin").position[row] == pytest.approx(whole.joint("spin").position[0], abs=1e-9)


@pytest.mark.parametrize("delay", [*(pytest.param(d, marks=pytest.mark.tier2) for d in (0.0, 0.05)), 0.08])
@pytest.mark.parametrize("split", [0.3, 0.32], ids=["at a sample", "between samples"])
def test_a_run_that_goes_on_from_a_saved_one_keeps_what_a_discrete_controller_holds(tmp_path, split, delay):
    """In two parts as in one: its states, the torques that wait, and when it samples."""
    scene = {
        "urdf": "planar_2r", "gravity": [0, -9.81, 0], "initial": {"shoulder": 0.3, "elbow": -0.5},
        "simulate": {"duration": 0.6, "rtol": 1e-12, "atol": 1e-12},
        "control": [{
            "name": "servo", "kind": "state_space", "joints": ["shoulder", "elbow"], "A": [[0.9, 0.1], [0.0, 0.8]],
            "B": [[0.02, 0.0], [0.01, 0.03]], "C": [[30.0, -5.0], [4.0, 12.0]], "D": [[25.0, 1.0], [-2.0, 8.0]],
            "inputs": ["0.4 - shoulder.position", "-0.3 - elbow.position"], "sample_time": PERIOD, "delay": delay,
            "initial": [0.1, -0.2],
        }],
    }  # fmt: skip
    (tmp_path / "arm.yaml").write_text(json.dumps(scene))
    whole = bc.simulate(tmp_path / "arm.yaml")
    bc.simulate(tmp_path / "arm.yaml", duration=split).save(tmp_path / "half.npz")
    rest = bc.simulate(tmp_path / "arm.yaml", duration=0.6 - split, overrides={"initial": {"run": "half.npz"}})
    np.testing.assert_allclose(rest.state[-1, :4], whole.state[-1, :4], atol=1e-9)  # the work counts anew
    assert any("initial state is not used; it goes on with that of half.npz" in note for note in rest.notes)
    other = {**scene, "initial": {"run": "half.npz"}, "control": [{**scene["control"][0], "name": "another"}]}
    (tmp_path / "other.yaml").write_text(json.dumps(other))
    notes = bc.simulate(tmp_path / "other.yaml", duration=0.01).notes
    assert any("control 'another' starts anew: half.npz holds no state that fits it" in note for note in notes)
    rest.save(tmp_path / "rest.npz")  # it holds the start of the controller too
    (tmp_path / "half.npz").unlink()
    again = bc.simulate(bc.load_run(tmp_path / "rest.npz").scene, duration=0.6 - split)
    np.testing.assert_allclose(again.state[-1], rest.state[-1], atol=1e-12)
