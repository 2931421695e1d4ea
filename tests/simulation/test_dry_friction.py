"""Dry friction: joints that stick at velocity 0, against closed forms, published periods and enumerations of modes."""

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp

import bellcrank as bc

BLOCK = """<robot name="block"><link name="ground"/><link name="block"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="slide" type="prismatic"><parent link="ground"/><child link="block"/><axis xyz="1 0 0"/>
<limit lower="-100" upper="100" effort="1000" velocity="1000"/>%s</joint></robot>"""
SPRING = {"name": "spring", "kind": "joint_spring", "joint": "slide", "stiffness": 1}


@pytest.fixture
def block(tmp_path):
    """Makes scenes of a block of 1 kg on a rail: keys of the scene, and of its dry friction."""

    def made(friction, *, dynamics="", **keys):
        (tmp_path / "block.urdf").write_text(BLOCK % dynamics)
        scene = {"urdf": "block.urdf", "gravity": [0, 0, 0], "joints": {"slide": {"dry_friction": friction}}, **keys}
        (tmp_path / "scene.yaml").write_text(yaml.safe_dump(scene))
        return bc.load_scene(tmp_path / "scene.yaml")

    return made


TIGHT = {"rtol": 1e-12, "atol": 1e-12}


@pytest.mark.parametrize(("x0", "mu", "halves", "rest"), [(1, 0.15, 3, -0.1), (10.3, 1, 5, -0.3), (1, 0.3, 2, -0.2)])
def test_a_coulomb_oscillator_loses_two_mu_a_half_swing_and_rests_for_ever(block, x0, mu, halves, rest):
    """x'' = −x ∓ μ: each half swing takes π and shortens by 2 μ; at rest where |x| <= μ."""
    scene = block({"coulomb": mu}, forces=[SPRING], initial={"slide": x0}, simulate={"duration": 30, **TIGHT})
    run = bc.simulate(scene)
    (interval,) = run.stuck("slide").tolist()
    assert interval == pytest.approx([halves * math.pi, 30.0], abs=1e-9)
    after = run.time > interval[0]
    assert abs(run.position[-1, 0] - rest) < 1e-9
    assert (run.velocity[after] == 0.0).all() and (run.position[after] == run.position[-1]).all()
    assert (run.acceleration[after] == 0.0).all() and run.energy_drift() < 1e-11
    assert "stuck" in run.table() and not run.warnings


def test_a_block_on_a_belt_has_the_published_period(block):
    """m = k = g = μ = 1, belt at 0.2 m/s, friction 1 / (1 + 3 |v|): Leine's sys_block_on_belt.m; its period to 13
    digits by DOP853 at 1e-13. In the axes of the belt the spring's other end moves.
    """
    scene = block(
        {"coulomb": 0, "static": 1, "speed": 1 / 3, "law": "hyperbolic"},
        forces=[{"kind": "torque", "joint": "slide", "value": "-(slide.position + 0.2*t)"}],
        initial={"slide": 1, "velocity": {"slide": -0.2}},
        simulate={"duration": 52, "rtol": 1e-13, "atol": 1e-13},
    )
    run = bc.simulate(scene)
    stuck = run.stuck("slide")
    assert np.diff(stuck[:, 0])[1:3] == pytest.approx([12.001031294791842] * 2, abs=1e-9)
    assert (stuck[1, 1] - stuck[1, 0]) / 12.001031294791842 == pytest.approx(0.6420308038583475, abs=1e-9)


def test_static_friction_falls_to_coulomb_friction_as_the_exponential_law_says(block):
    """Pulled with a constant force, against SciPy on m a = F − c − (s − c) exp(−v / w) − d v."""
    scene = block(
        {"coulomb": 1, "static": 3, "speed": 0.2, "viscous": 0.5},
        forces=[{"kind": "torque", "joint": "slide", "value": 3.5}],
        outputs={"friction": {"force": "dry_friction_slide"}},
        simulate={"duration": 2, "samples": 21, **TIGHT},
    )
    run = bc.simulate(scene)
    known = solve_ivp(
        lambda _, v: 3.5 - 1 - 2 * np.exp(-v / 0.2) - 0.5 * v, (0, 2), [0.0], "DOP853", run.time, rtol=1e-12, atol=1e-13
    )
    assert run.velocity[:, 0] == pytest.approx(known.y[0], abs=1e-10)
    assert run.output("friction").ravel() == pytest.approx(run.acceleration[:, 0] - 3.5, abs=1e-10)


@pytest.mark.parametrize("direction", [1, -1])
def test_a_load_below_static_friction_is_held_for_an_hour_and_one_above_is_not(block, direction):
    friction = {"coulomb": 1.5, "static": 2, "speed": 0.1}

    def pulled(force):
        load = [{"kind": "torque", "joint": "slide", "value": direction * force}]
        return bc.simulate(block(friction, forces=load), duration=3600.0, samples=10)

    held = pulled(2 * 0.999)
    assert (held.position == 0.0).all() and (held.velocity == 0.0).all() and held.stuck("slide").tolist() == [[0, 3600]]
    moved = pulled(2 * 1.001)
    assert direction * moved.position[-1, 0] > 1.0 and moved.stuck("slide").shape == (0, 2)


def test_a_pendulum_gives_way_where_its_weight_exceeds_static_friction(tmp_path):
    """A motor's torque rises: the joint begins to move at its closed form's time."""
    scene = {
        "urdf": "pendulum",
        "joints": {"swing": {"dry_friction": {"coulomb": 2}}},
        "forces": [{"kind": "torque", "joint": "swing", "value": "0.5*t"}],
        "simulate": {"duration": 5, **TIGHT},
    }
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(scene))
    run = bc.simulate(tmp_path / "scene.yaml")
    assert run.stuck("swing")[0] == pytest.approx([0.0, 4.0], abs=1e-11)  # at rest it hangs down, without weight
    assert run.position[-1, 0] > 0.0


def random_chain(rng, folder):
    """A chain of 1 to 5 random joints, most with dry friction; the scene's file, and the friction by joint."""
    count = int(rng.integers(1, 6))
    parts = ['<robot name="chain"><link name="l0"/>']
    for k in range(count):
        axis, at = rng.normal(size=3), rng.normal(size=3) * 0.2
        axis /= np.linalg.norm(axis)
        inertia = rng.uniform(0.01, 0.1)
        parts.append(
            f'<link name="l{k + 1}"><inertial><origin xyz="{at[0]} {at[1]} {at[2]}"/>'
            f'<mass value="{rng.uniform(0.5, 3)}"/>'
            f'<inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="j{k}" type="{rng.choice(["continuous", "continuous", "prismatic"])}"><parent link="l{k}"/>'
            f'<child link="l{k + 1}"/><origin xyz="0.3 0 {0.1 * k}"/><axis xyz="{axis[0]} {axis[1]} {axis[2]}"/>'
            '<limit lower="-1e3" upper="1e3" effort="1e4" velocity="1e4"/></joint>'
        )
    (folder / "chain.urdf").write_text("".join([*parts, "</robot>"]))
    coulomb = {k: float(10 ** rng.uniform(-1, 1.5)) for k in range(count) if rng.random() < 0.8} or {0: 1.0}
    speed = {f"j{k}": 0.0 if k in coulomb and rng.random() < 0.8 else float(rng.normal()) for k in range(count)}
    scene = {
        "urdf": "chain.urdf",
        "joints": {f"j{k}": {"dry_friction": {"coulomb": c}} for k, c in coulomb.items()},
        "initial": {**{f"j{k}": float(rng.normal()) for k in range(count)}, "velocity": speed},
        "outputs": {f"f{k}": {"force": f"dry_friction_j{k}"} for k in coulomb},
        "simulate": {"duration": float(rng.uniform(0.2, 1.5)), "rtol": 1e-9, "atol": 1e-9, "samples": 40},
    }
    (folder / "chain.yaml").write_text(yaml.safe_dump(scene))
    return folder / "chain.yaml", coulomb


def enumerated(mass, bias, velocity, coulomb):
    """The accelerations that the law of friction allows, over all modes of the joints at rest, by dense solves."""
    inverse, count = np.linalg.inv(mass), len(bias)
    rest = [k for k in coulomb if velocity[k] == 0.0]
    sliding = np.array([-np.sign(velocity[k]) * coulomb.get(k, 0.0) for k in range(count)])
    for modes in itertools.product((-1, 0, 1), repeat=len(rest)):
        force, stuck = sliding.copy(), [k for k, mode in zip(rest, modes, strict=True) if mode == 0]
        for k, mode in zip(rest, modes, strict=True):
            force[k] = -mode * coulomb[k]
        found = inverse @ (force - bias)
        if stuck:
            force[stuck] = np.linalg.solve(inverse[np.ix_(stuck, stuck)], -found[stuck])
            found = inverse @ (force - bias)
        holds = all(abs(force[k]) <= coulomb[k] * (1 + 1e-9) for k in stuck)
        if holds and all(mode * found[k] >= -1e-9 for k, mode in zip(rest, modes, strict=True)):
            yield found


def check_chain(folder, seed):
    path, coulomb = random_chain(np.random.default_rng(seed), folder)
    run = bc.simulate(path)
    robot, still = run.robot, np.zeros(run.robot.nv)
    assert run.success
    for row in (0, 13, 26, 39):
        q, v, a = run.position[row], run.velocity[row], run.acceleration[row]
        known = list(enumerated(robot.mass_matrix(q), robot.inverse_dynamics(q, v, still), v, coulomb))
        assert min(np.abs(a - each).max() / (1 + np.abs(each).max()) for each in known) < 1e-9
    for k in coulomb:
        force, speed = run.output(f"f{k}").ravel(), run.velocity[:, robot.joint(f"j{k}").v]
        assert (force * speed <= 0.0).all() and (np.abs(force) <= coulomb[k] * (1 + 1e-9)).all()  # it never drives
    energy = run.kinetic_energy + run.potential_energy
    assert np.diff(energy).max() <= 1e-6 * (1 + np.abs(energy).max())  # errors of the integrator, at rtol 1e-9
    assert run.energy_drift() < 1e-6


@pytest.mark.parametrize("seed", range(4))
def test_a_random_chain_moves_as_the_enumeration_of_its_modes_says(tmp_path, seed):
    check_chain(tmp_path, seed)


@pytest.mark.tier2
@pytest.mark.parametrize("first", range(100, 300, 50))
def test_random_chains_move_as_the_enumeration_of_their_modes_says(tmp_path, first):
    for seed in range(first, first + 50):
        check_chain(tmp_path, seed)


def four_bar(folder, coulomb, **keys):
    """The deployable four-bar under gravity, with dry friction at these joints, and no other forces."""
    scene = dict(bc.load_scene("four_bar").data)
    for key in ("forces", "events", "outputs"):
        scene.pop(key)
    scene |= {"joints": {k: {"dry_friction": {"coulomb": c}} for k, c in coulomb.items()}, "gravity": [0, -9.81, 0]}
    scene |= {"initial": {"crank": "50 deg", "coupler": {"guess": "310 deg"}, "rocker": {"guess": "50 deg"}}, **keys}
    scene["outputs"] = {name: {"force": f"dry_friction_{name}"} for name in coulomb} | {"apex": {"constraint": "apex"}}
    (folder / "loop.yaml").write_text(yaml.safe_dump(scene))
    return folder / "loop.yaml"


@pytest.mark.parametrize("names", [["crank"], ["crank", "rocker"], ["crank", "coupler", "rocker"]])
def test_a_linkage_comes_to_rest_with_all_its_joints_at_velocity_zero(tmp_path, names):
    """Also where more joints than it has freedoms hold it; at rest friction is within its limits and the equations of
    motion hold, by the dense KKT system."""
    run = bc.simulate(four_bar(tmp_path, dict.fromkeys(names, 8.0), simulate={"duration": 60, "rtol": 1e-10}))
    begin, end = run.stuck("crank")[-1]
    assert end == run.time[-1] and all(run.stuck(name)[-1] == pytest.approx([begin, end], abs=1e-8) for name in names)
    rest = run.time > begin
    assert np.abs(run.velocity[rest]).max() < (1e-300 if len(names) == 3 else 1e-9)
    assert (run.velocity[rest][:, run.robot.joint("crank").v] == 0.0).all()
    assert np.abs(run.acceleration[rest]).max() < 1e-8 and run.energy_drift() < 1e-7
    assert all((np.abs(run.output(name)[rest]) <= 8.0 * (1 + 1e-9)).all() for name in names)
    assert run.equation_residual() < 1e-12
    assert any("not unique" in note for note in run.notes) == (len(names) > 1)


@pytest.mark.parametrize("coulomb", [0.3, 2.0, 8.0])
def test_a_linkage_with_friction_in_all_joints_moves_as_the_enumeration_of_modes_says(tmp_path, coulomb):
    """By its one freedom, v = T ẋ: Tᵀ (M a + h) = Tᵀ f with f = ∓c in motion; at rest |Tᵀ h| <= c Σ |T| holds it."""
    names = ["crank", "coupler", "rocker"]
    run = bc.simulate(
        four_bar(tmp_path, dict.fromkeys(names, coulomb), simulate={"duration": 20, "rtol": 1e-11, "samples": 41})
    )
    robot = run.robot
    for row in range(len(run.time)):
        q, v, a = run.position[row], run.velocity[row], run.acceleration[row]
        jacobian = _apex(robot, q)
        way = np.linalg.svd(jacobian)[2][-1]
        mass, bias = robot.mass_matrix(q), robot.inverse_dynamics(q, v, np.zeros(3))
        inertia, limit = way @ mass @ way, coulomb * np.abs(way).sum()
        if np.abs(v).max() == 0.0:
            load = -way @ bias
            known = 0.0 if abs(load) <= limit else (load - np.sign(load) * limit) / inertia
            assert abs(way @ mass @ a / inertia - known) < 1e-9
        else:
            friction = -np.sign(v) * coulomb
            h = 1e-5
            bent = (_apex(robot, q + h * v) - _apex(robot, q - h * v)) @ v / (2 * h)
            special = -np.linalg.pinv(jacobian) @ bent
            known = special + way * (way @ (friction - bias - mass @ special)) / inertia
            assert a == pytest.approx(known, abs=1e-6 * (1 + np.abs(known).max()))  # `bent` is a difference quotient


def _apex(robot, q):
    """The derivative (2, 3) of the distance between the two tips by the joints, exact: by velocities of frames."""
    columns = []
    for unit in np.eye(3):
        tips = [robot.frame_velocity(name, q, unit)[0] for name in ("coupler_tip", "rocker_tip")]
        columns.append((tips[0] - tips[1])[:2])
    return np.array(columns).T


def test_dry_friction_replaces_the_friction_of_the_robot_file_and_says_so(block):
    scene = block({"coulomb": 1}, dynamics='<dynamics damping="3" friction="2"/>', initial={"velocity": {"slide": 2}})
    run = bc.simulate(scene, duration=3.0, rtol=1e-11, atol=1e-11)
    assert run.stuck("slide")[0, 0] == pytest.approx(2.0, abs=1e-10) and run.position[-1, 0] == pytest.approx(2.0)
    assert any("replaces its other friction, viscous 3 N s/m and Coulomb 2 N" in note for note in run.notes)


def test_sizing_says_too_that_dry_friction_replaces_other_friction(tmp_path):
    scene = {
        "urdf": "planar_2r", "friction": {"elbow": {"coulomb": 2}},
        "joints": {"elbow": {"dry_friction": {"coulomb": 3}}},
        "motions": {"turn": {"kind": "waypoints", "times": [0, 1], "positions": [{}, {"elbow": 1}]}},
    }  # fmt: skip
    (tmp_path / "arm.yaml").write_text(yaml.safe_dump(scene))
    for result in (bc.size(tmp_path / "arm.yaml"), bc.select(tmp_path / "arm.yaml", candidates=1, effort=20)):
        assert any("'elbow': dry_friction replaces its other friction" in note for note in result.warnings)


def test_a_saved_run_keeps_when_joints_were_stuck_and_a_run_from_it_stays_at_rest(block, tmp_path):
    scene = block({"coulomb": 0.15}, forces=[SPRING], initial={"slide": 1})
    run = bc.simulate(scene, duration=12.0)
    again = bc.load_run(run.save(tmp_path / "run.npz"))
    assert again.stuck("slide").tolist() == run.stuck("slide").tolist()
    assert np.array_equal(again.acceleration, run.acceleration)
    further = bc.simulate(scene.with_overrides({"initial": {"run": str(tmp_path / "run.npz")}}), duration=5.0)
    assert (further.position == run.position[-1]).all() and len(further.stuck("slide")) == 1


def test_a_sweep_over_the_friction_gives_the_runs_of_its_designs(block):
    keys = {"forces": [SPRING], "initial": {"slide": 1}, "simulate": {"duration": 12, **TIGHT}}
    parameter = {"mu": {"value": 0.15, "sets": ["forces.dry_friction_slide.coulomb"]}}
    swept = bc.sweep(block({"coulomb": 0.1}, parameters=parameter, **keys), {"mu": [0.15, 0.3]}, threads=1)
    assert swept.column("end.slide") == pytest.approx([-0.1, -0.2], abs=1e-9)


def test_the_implicit_method_sticks_as_the_explicit_one_does(block):
    scene = block({"coulomb": 0.15}, forces=[SPRING], initial={"slide": 1})
    run = bc.simulate(scene, duration=12.0, solver="Radau", rtol=1e-11, atol=1e-11)
    assert run.stuck("slide")[0, 0] == pytest.approx(3 * math.pi, abs=1e-7)


def test_a_joint_that_a_sampled_controller_moves_sticks_between_its_samples(tmp_path):
    """The torque jumps at samples, from below to above the limit and back."""
    (tmp_path / "block.urdf").write_text(BLOCK % "")
    scene = {
        "urdf": "block.urdf", "gravity": [0, 0, 0], "joints": {"slide": {"dry_friction": {"coulomb": 1}}},
        "simulate": {"duration": 4, **TIGHT},
    }  # fmt: skip
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(scene))

    def pull(t, q, v):
        return {"slide": 2.0 if 1.0 <= t < 2.0 - 1e-9 else 0.5}

    run = bc.simulate(tmp_path / "scene.yaml", controller=pull, sample_time=0.5)
    # a = 1 from 1 to 2 s, then −0.5 for 2 s
    assert run.stuck("slide") == pytest.approx(np.array([[0.0, 1.0]]), abs=1e-9)
    assert run.position[-1, 0] == pytest.approx(0.5 + 2.0 - 1.0, abs=1e-9) and abs(run.velocity[-1, 0]) < 1e-9


def test_sizing_bears_dry_friction_and_counts_its_share(tmp_path):
    scene = {
        "urdf": "planar_2r", "gravity": [0, 0, 0], "friction": "none",
        "motions": {"turn": {"kind": "waypoints", "times": [0, 1], "positions": [{}, {"elbow": 1}]}},
    }  # fmt: skip
    path = tmp_path / "arm.yaml"
    path.write_text(yaml.safe_dump(scene))
    plain = bc.size(path).joint("elbow")
    path.write_text(yaml.safe_dump({**scene, "joints": {"elbow": {"dry_friction": {"coulomb": 3}}}}))
    rubbed = bc.size(path).joint("elbow")
    assert rubbed.max_torque == pytest.approx(plain.max_torque + 3.0) and plain.friction_share == 0.0
    assert rubbed.friction_share == pytest.approx(3.0 / rubbed.peak_torque)


WRONG = {
    "static below coulomb": ({"coulomb": 2, "static": 1, "speed": 1}, "expected at least 'coulomb', 2, found 1"),
    "no speed": ({"coulomb": 1, "static": 2}, "'static' requires 'speed'"),
    "no static": ({"coulomb": 1, "speed": 2}, "'speed' says how friction falls from 'static', which is not given"),
    "nothing": ({"coulomb": 0}, "expected more than 0, found 0"),
    "negative": ({"coulomb": -1}, "expected 0 N or more, found -1"),
    "unknown law": ({"coulomb": 1, "static": 2, "speed": 1, "law": "linear"}, "law"),
    "unknown key": ({"coulomb": 1, "width": 2}, "width"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_dry_friction_is_refused_in_one_sentence(block, case):
    friction, said = WRONG[case]
    with pytest.raises(bc.InputError, match=r"scene.yaml: joints\.slide") as found:
        block(friction)
    assert said in str(found.value) and "\n" not in str(found.value)


def test_two_frictions_of_one_joint_and_unknown_joints_are_refused(block, tmp_path):
    other = [{"name": "rub", "kind": "friction", "joint": "slide", "coulomb": 1}]
    with pytest.raises(bc.InputError, match="force 'rub' is friction of the same joint; remove one of the two"):
        block({"coulomb": 1}, forces=other)
    (tmp_path / "scene.yaml").write_text("urdf: planar_2r\njoints: {elbo: {dry_friction: {coulomb: 1}}}\n")
    with pytest.raises(bc.InputError, match="elbow"):
        bc.load_scene(tmp_path / "scene.yaml")
    (tmp_path / "scene.yaml").write_text("urdf: planar_2r\njoints: {elbow: {}}\n")
    with pytest.raises(bc.InputError, match="expected one of dry_friction, stop, brake, clutch, found nothing"):
        bc.load_scene(tmp_path / "scene.yaml")


@pytest.mark.parametrize(
    "function",
    [bc.linearise, bc.scene_casadi, bc.scene_derivatives, lambda s: bc.root_loci(s, "initial.slide", [0.0, 1.0])],
)
def test_what_needs_smooth_equations_refuses_a_joint_that_sticks(block, function):
    with pytest.raises(bc.InputError, match="dry_friction"):
        function(block({"coulomb": 1}, forces=[SPRING]))


def test_unknown_joints_of_stuck_are_refused(block):
    run = bc.simulate(block({"coulomb": 1}), duration=0.1)
    with pytest.raises(bc.InputError, match="joint or rotor with dry friction 'elbow'"):
        run.stuck("elbow")


def test_a_load_that_approaches_the_limit_without_passing_it_ends_in_rest(tmp_path):
    """Motors with PD control move a five-bar slower and slower, until friction takes all of their torque."""
    scene = dict(bc.load_scene("five_bar").data)
    names = ("left_elbow", "left_motor", "right_motor")
    scene |= {"joints": {name: {"dry_friction": {"coulomb": 0.5}} for name in names}, "outputs": {}, "events": []}
    scene["simulate"] = {"duration": 1.5, "rtol": 1e-9, "atol": 1e-9}
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(scene))
    run = bc.simulate(tmp_path / "scene.yaml")
    assert run.success and np.abs(run.velocity[-1]).max() < 1e-8
    assert run.energy_drift() < 1e-6


def test_a_run_that_cannot_begin_is_refused(block):
    """Forces beyond all numbers at the start: no mode was found."""
    spring = {"kind": "spring", "frame_a": "block", "frame_b": "world", "point": [1e308, 0, 0], "stiffness": 40}
    with pytest.raises(bc.InputError, match="not finite at the start"):
        bc.simulate(block({"coulomb": 1}, forces=[{**spring, "free_length": 0.5}]), duration=0.1)


def test_a_joint_whose_motion_is_prescribed_rubs_and_does_not_stick(block):
    """Through rest and reversal: the friction is against the motion, and the drive bears it."""
    scene = block(
        {"coulomb": 2},
        motions={"back": {"kind": "waypoints", "times": [0, 1, 2], "positions": [{}, {"slide": 1}, {}]}},
        constraints=[{"name": "drive", "kind": "prescribed_motion", "joint": "slide", "motion": "back"}],
        outputs={"friction": {"force": "dry_friction_slide"}},
        simulate={"duration": 2, "samples": 41, "rtol": 1e-10, "atol": 1e-10},
    )
    run, motion = bc.simulate(scene), scene.motion("back")
    known = np.interp(run.time, motion.time, motion.position[:, 0])
    assert run.success and run.position[:, 0] == pytest.approx(known, abs=1e-5)  # rows of the motion, in lines
    inside = np.abs(run.velocity[:, 0]) > 1e-6
    assert run.output("friction").ravel()[inside] == pytest.approx(-2 * np.sign(run.velocity[inside, 0]))
    assert np.abs(run.velocity[:, 0]).max() > 1.0 and len(run.stuck("slide")) == 0


def test_a_limit_of_its_own_and_one_that_is_the_coulomb_friction_are_other_equations(block):
    """Both with 0.15 N in the file; a parameter then sets the Coulomb friction alone, or the limit with it."""
    keys = {"parameters": {"mu": {"value": 0.15, "sets": ["forces.dry_friction_slide.coulomb"]}}, "forces": [SPRING]}
    one = block({"coulomb": 0.15}, **keys)
    two = block({"coulomb": 0.15, "static": 0.15, "speed": 1}, **keys)
    assert one.physics_key() != two.physics_key()
    low = {"mu": 0.05, "initial.slide": 0.1}
    assert len(bc.simulate(one.with_overrides(low), duration=0.1).stuck("slide")) == 0  # the spring's 0.1 N move it
    assert len(bc.simulate(two.with_overrides(low), duration=0.1).stuck("slide")) == 1
    with pytest.raises(bc.InputError, match=r"static friction 0.15 is below Coulomb friction 0.2"):
        bc.simulate(two.with_overrides({"mu": 0.2}), duration=0.1)


def test_sizing_sweep_and_inverse_dynamics_see_the_same_friction(tmp_path):
    scene = {
        "urdf": "planar_2r", "gravity": [0, -9.81, 0], "joints": {"elbow": {"dry_friction": {"coulomb": 3}}},
        "motions": {"turn": {"kind": "waypoints", "times": [0, 1], "positions": [{}, {"elbow": 1}]}},
    }  # fmt: skip
    path = tmp_path / "arm.yaml"
    path.write_text(yaml.safe_dump(scene))
    sizing = bc.size(path).joint("elbow")
    swept = bc.sweep(path, {"motions.turn.duration": ["1 s", "2 s"]}, size=True)
    assert swept.column("elbow.peak_torque")[0] == pytest.approx(sizing.peak_torque, rel=1e-12)
    torque = bc.scene_inverse_dynamics(path, bc.load_scene(path).motion("turn")).torque[:, 1]
    assert np.abs(torque).max() == pytest.approx(sizing.peak_torque, rel=1e-4)  # rows of the motion


def test_a_brake_that_falls_in_late_stops_a_mass_where_its_force_says(tmp_path: Path) -> None:
    # a mass of 2 kg slides at 3 m/s; from 0.5 s + 0.2 s on a force of 12 N acts: it stops 3/6 s later, and stays
    brake = {"torque": 12.0, "engaged": "t - 0.5", "delay": 0.2}
    run = bc.simulate(_slider(tmp_path, brake), duration=3.0)
    assert run.stuck("slide") == pytest.approx(np.array([[1.2, 3.0]]), abs=1e-9)
    assert run.position[-1, 0] == pytest.approx(3.0 * 0.7 + 0.5 * 3.0 * 0.5, abs=1e-9)
    assert run.velocity[-1, 0] == 0.0
    assert run.energy_drift() < 1e-9


def test_a_brake_holds_while_it_is_engaged_and_lets_go_after(tmp_path: Path) -> None:
    run = bc.simulate(_slider(tmp_path, {"torque": 12.0, "engaged": "1.5 - t"}, speed=0.0, push=4.0), duration=2.0)
    assert run.stuck("slide") == pytest.approx(np.array([[0.0, 1.5]]), abs=1e-9)
    assert run.velocity[-1, 0] == pytest.approx(4.0 / 2.0 * 0.5, abs=1e-9)


def test_a_brake_with_a_delay_must_be_a_formula_of_time(tmp_path: Path) -> None:
    path = _slider(tmp_path, {"torque": 1.0, "engaged": "joint('slide').velocity", "delay": 0.1})
    with pytest.raises(bc.InputError, match="formula of time alone"):
        bc.load_scene(path)


def _slider(folder: Path, brake: dict[str, object], speed: float = 3.0, push: float = 0.0) -> Path:
    (folder / "slider.urdf").write_text(
        '<robot name="s"><link name="base"/><link name="mass"><inertial><mass value="2"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="slide" type="prismatic"><parent link="base"/><child link="mass"/><axis xyz="1 0 0"/>'
        '<limit lower="-100" upper="100" velocity="100" effort="100"/></joint></robot>'
    )
    data = {
        "urdf": "slider.urdf", "joints": {"slide": {"brake": brake}}, "initial": {"velocity": {"slide": speed}},
        "forces": [{"kind": "joint_force", "joint": "slide", "value": push}], "simulate": {"rtol": 1e-10},
    }  # fmt: skip
    path = folder / "slider.yaml"
    path.write_text(yaml.safe_dump(data))
    return path
