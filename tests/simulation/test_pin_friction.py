"""Dry friction of pins and sliders that close loops: dense KKT systems, other cuts of the same loop, and rest."""

import itertools

import numpy as np
import pytest
import yaml

import bellcrank as bc

JOINTS = ["crank", "coupler", "rocker"]
AXIS = [0, 0, 1]


def four_bar(folder, pin, joints=None, **keys):
    """The deployable four-bar under gravity, without its spring, with dry friction `pin` at the apex."""
    scene = dict(bc.load_scene("four_bar").data)
    for key in ("forces", "events", "outputs"):
        scene.pop(key)
    scene["constraints"] = [{**scene["constraints"][0], "dry_friction": {"axis": AXIS, **pin}}]
    scene |= {"joints": {k: {"dry_friction": {"coulomb": c}} for k, c in (joints or {}).items()}}
    scene |= {"gravity": [0, -9.81, 0]}
    scene |= {"initial": {"crank": "50 deg", "coupler": {"guess": "310 deg"}, "rocker": {"guess": "50 deg"}}, **keys}
    scene["outputs"] = {name: {"force": f"dry_friction_{name}"} for name in (*(joints or {}), "apex")}
    (folder / "loop.yaml").write_text(yaml.safe_dump(scene))
    return folder / "loop.yaml"


def tips(q):
    """J (2, 3) of the distance between the tips of coupler and rocker, and J̇ as a function of v, by hand."""
    a, b, c = q[0], q[0] + q[1], q[2]
    first, second, third = (r * np.array([-np.sin(x), np.cos(x)]) for r, x in ((1.241, a), (1.2, b), (1.2, c)))
    jacobian = np.column_stack([first + second, second, -third])

    def drift(v):
        inward = [-r * np.array([np.cos(x), np.sin(x)]) for r, x in ((1.241, a), (1.2, b), (1.2, c))]
        return inward[0] * v[0] ** 2 + inward[1] * (v[0] + v[1]) ** 2 - inward[2] * v[2] ** 2

    return jacobian, drift


G = np.vstack([np.eye(3), [1.0, 1.0, -1.0]])  # the velocities of the four pins by those of the joints


def by_modes(robot, q, v, coulomb):
    """The accelerations that friction allows in some mode (forwards, backwards or stuck) of each pin at rest.

    By dense KKT systems in which stuck pins are rows too; their forces exist where the load on the linkage's one
    freedom is no larger than friction of all of them.
    """
    jacobian, drift = tips(q)
    mass, bias = robot.mass_matrix(q), robot.inverse_dynamics(q, v, np.zeros(3))
    way = np.linalg.svd(jacobian)[2][-1]
    speed = G @ v
    rest = [k for k in range(4) if speed[k] == 0.0]
    for modes in itertools.product((-1, 0, 1), repeat=len(rest)):
        direction = np.sign(speed)
        direction[rest] = modes
        stuck = [k for k in rest if direction[k] == 0.0]
        force = -G.T @ (coulomb * direction)
        rows = np.vstack([jacobian, G[stuck]])
        system = np.block([[mass, rows.T], [rows, np.zeros((len(rows), len(rows)))]])
        right = np.concatenate([force - bias, -drift(v), np.zeros(len(stuck))])
        a = np.linalg.lstsq(system, right, rcond=1e-12)[0][:3]
        left = way @ (force - bias)  # the load that stuck pins have to bear
        bears = not stuck or abs(left) <= (coulomb[stuck] * np.abs(G[stuck] @ way)).sum() * (1 + 1e-12)
        if bears and all(direction[k] * (G[k] @ a) >= -1e-10 for k in rest):
            yield a


def check_four_bar(path, coulomb):
    """Rows of a run against the enumeration of modes; each friction (4,) resists within its limit. The run.

    Where the linkage lies nearly flat, at a smallest singular value σ of J below 1e-3 of the largest, accelerations are
    not compared: rounding of the velocities is amplified by 1/σ², with friction or without. For the same reason the
    energy may drift by up to 1e-6: a run that passes such a posture was seen to drift by 1.6e-7.
    """
    run = bc.simulate(path)
    assert run.success and run.energy_drift() < 1e-6
    force = np.column_stack([run.output(name) for name in (*JOINTS, "apex")])
    for row in range(len(run.time)):
        q, v, a = run.position[row], run.velocity[row], run.acceleration[row]
        sizes = np.linalg.svd(tips(q)[0])[1]
        known = list(by_modes(run.robot, q, v, coulomb))
        assert (
            sizes[1] < 1e-3 * sizes[0]
            or min(np.abs(a - each).max() / (1 + np.abs(each).max()) for each in known) < 1e-9
        )
        speed = G @ v
        moving = np.abs(speed) > 1e-9
        assert (np.abs(force[row] + coulomb * np.sign(speed)) <= 1e-12 * coulomb)[moving].all()
        assert (np.abs(force[row]) <= coulomb * (1 + 1e-9)).all()
    return run


@pytest.mark.parametrize("coulomb", [0.3, 2.0, 8.0])
def test_a_four_bar_with_friction_in_all_pins_moves_as_the_enumeration_of_its_modes_says(tmp_path, coulomb):
    simulate = {"duration": 20, "rtol": 1e-11, "samples": 81}
    path = four_bar(tmp_path, {"coulomb": coulomb}, dict.fromkeys(JOINTS, coulomb), simulate=simulate)
    run = check_four_bar(path, np.full(4, coulomb))
    assert bool((run.velocity[-1] == 0.0).all()) == (coulomb == 8.0)


def check_random_four_bar(folder, seed):
    """A four-bar with random friction in its pins, from a random posture and speed."""
    rng = np.random.default_rng(seed)
    coulomb = 10 ** rng.uniform(-1, 1.3, 4)
    crank, speed = float(rng.uniform(0.3, 1.3)), float(rng.choice([0.0, rng.normal()]))
    initial = {"crank": crank, "coupler": {"guess": -crank}, "rocker": {"guess": crank}, "velocity": {"crank": speed}}
    simulate = {"duration": float(rng.uniform(0.5, 6)), "rtol": 1e-10, "atol": 1e-10, "samples": 31}
    joints = dict(zip(JOINTS, coulomb.tolist(), strict=False))
    path = four_bar(folder, {"coulomb": float(coulomb[3])}, joints, simulate=simulate)
    data = yaml.safe_load(path.read_text())
    path.write_text(yaml.safe_dump(data | {"initial": initial}))
    check_four_bar(path, coulomb)


@pytest.mark.parametrize("seed", range(4))
def test_a_four_bar_with_random_friction_in_its_pins_moves_as_the_enumeration_of_its_modes_says(tmp_path, seed):
    check_random_four_bar(tmp_path, seed)


def limit_at(q, robot):
    """The friction in the apex alone that just holds the four-bar in a posture, N m: by virtual work."""
    jacobian, _ = tips(q)
    way = np.linalg.svd(jacobian)[2][-1]
    bias = robot.inverse_dynamics(q, np.zeros(3), np.zeros(3))
    return float(abs(way @ bias) / abs(G[3] @ way))


def test_a_linkage_whose_pin_bears_99_9_percent_holds_for_an_hour_and_one_of_100_1_percent_moves(tmp_path):
    start = bc.simulate(four_bar(tmp_path, {"coulomb": 1.0}), duration=1e-6)
    limit = limit_at(start.position[0], start.robot)
    held = bc.simulate(four_bar(tmp_path, {"coulomb": limit / 0.999}), duration=3600.0)
    assert (held.velocity == 0.0).all() and (held.position == held.position[0]).all()
    assert held.stuck("apex") == pytest.approx(np.array([[0.0, 3600.0]]))
    assert np.abs(held.output("apex")) == pytest.approx(limit, rel=1e-9)
    moves = bc.simulate(four_bar(tmp_path, {"coulomb": limit / 1.001}), duration=2.0)
    assert len(moves.stuck("apex")) == 0 and np.abs(moves.position[-1] - moves.position[0]).max() > 1e-3


LINK = (
    '<link name="{0}"><inertial><origin xyz="{1} 0 0"/><mass value="{2}"/>'
    '<inertia ixx="0.1" iyy="0.1" izz="{3}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = (
    '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin xyz="{4} 0 0"/><axis xyz="{5}"/>'
    '<limit lower="-10" upper="10" effort="1e4" velocity="1e4"/></joint>'
)


def slider_crank(folder, cut):
    """A crank of 0.3 m, a rod of 0.8 m and a slider of 3 kg on a rail along x with friction. The loop is cut at the
    rail, whose friction is then the constraint's, or at the pin of the slider.
    """
    bodies = [LINK.format("crank_link", 0.15, 1.0, 0.02), LINK.format("rod_link", 0.4, 2.0, 0.1)]
    joints = [
        JOINT.format("crank", "continuous", "base", "crank_link", 0, "0 0 1"),
        JOINT.format("rod", "continuous", "crank_link", "rod_link", 0.3, "0 0 1"),
    ]
    friction = {"coulomb": 25.0, "static": 32.0, "speed": 0.1, "viscous": 0.5}
    scene = {"urdf": f"{cut}.urdf", "gravity": [0, -9.81, 0]}
    at = {"crank": 1.0, "rod": {"guess": -1.32}}
    bodies.append(LINK.format("slider", 0, 3.0, 0.02))
    if cut == "rail":
        joints.append(JOINT.format("pin", "continuous", "rod_link", "slider", 0.8, "0 0 1"))
        rail = {"name": "rail", "kind": "prismatic", "frame_a": "slider", "frame_b": "base", "axis": [1, 0, 0]}
        scene |= {"constraints": [{**rail, "dry_friction": friction}], "initial": {**at, "pin": {"guess": 0.32}}}
    else:
        joints.append(JOINT.format("rail", "prismatic", "base", "slider", 0, "1 0 0"))
        scene["frames"] = {"tip": {"link": "rod_link", "xyz": [0.8, 0, 0]}}
        scene["constraints"] = [{"name": "pin", "kind": "hinge", "frame_a": "tip", "frame_b": "slider"}]
        scene |= {"joints": {"rail": {"dry_friction": friction}}, "initial": {**at, "rail": {"guess": 0.9}}}
    scene["forces"] = [
        {"kind": "torque", "joint": "crank", "value": "15*sin(2*t)"},
        {"kind": "damper", "joint": "crank", "coefficient": 4},
    ]
    scene["outputs"] = {"rub": {"force": "dry_friction_rail"}}
    scene["simulate"] = {"duration": 6.0, "rtol": 1e-11, "samples": 61}
    (folder / f"{cut}.urdf").write_text(f'<robot name="s"><link name="base"/>{"".join([*bodies, *joints])}</robot>')
    (folder / f"{cut}.yaml").write_text(yaml.safe_dump(scene))
    return bc.simulate(folder / f"{cut}.yaml")


def test_a_slider_that_closes_the_loop_rubs_as_a_joint_of_the_tree_does(tmp_path):
    """Two cuts of one slider-crank; the one sticks and slides by the constraint's friction, the other by a joint's."""
    by_rail, by_pin = slider_crank(tmp_path, "rail"), slider_crank(tmp_path, "pin")
    assert by_rail.stuck("rail") == pytest.approx(by_pin.stuck("rail"), abs=1e-8) and len(by_pin.stuck("rail")) > 1
    for name in ("crank", "rod"):
        columns = [run.position[:, run.robot.joint(name).q] for run in (by_rail, by_pin)]
        assert columns[0] == pytest.approx(columns[1], abs=1e-8)
    rows = ~np.isin(np.round(by_pin.time, 9), np.round(by_pin.stuck("rail").ravel(), 9))
    assert by_rail.output("rub")[rows] == pytest.approx(by_pin.output("rub")[rows], abs=1e-6)
    assert by_rail.work[-1] == pytest.approx(by_pin.work[-1], abs=1e-8)


@pytest.mark.parametrize("kind", ["projection", "baumgarte"])
def test_a_pin_that_sticks_in_a_linkage_of_two_freedoms_keeps_its_angle(tmp_path, kind):
    """The five-bar goes on to swing about the pin that no longer turns: the angle between its tips stays."""
    scene = dict(bc.load_scene("five_bar").data)
    for key in ("control", "outputs", "events", "motions"):
        scene.pop(key, None)
    loop = {**scene["constraints"][0], "dry_friction": {"coulomb": 40.0, "axis": AXIS}}
    scene |= {"constraints": [loop], "gravity": [0, -9.81, 0], "simulate": {"duration": 3, "rtol": 1e-10}}
    scene["simulate"]["stabilisation"] = {"kind": kind, "gains": "auto"} if kind == "baumgarte" else {"kind": kind}
    path = tmp_path / "five_bar.yaml"
    path.write_text(yaml.safe_dump(scene))
    run = bc.simulate(path)
    (begin, end), *_ = run.stuck(loop["name"])[::-1]
    inside = (run.time > begin) & (run.time < end)
    assert inside.sum() > 20 and np.abs(run.velocity[inside]).max() > 0.1
    turn = [run.robot.frame_pose(loop[side], q)[1] for q in run.position[inside] for side in ("frame_a", "frame_b")]
    between = [b.T @ a for a, b in zip(turn[::2], turn[1::2], strict=True)]
    assert np.abs(np.array(between) - between[0]).max() < 1e-8
    assert run.energy_drift() < 1e-7 and run.equation_residual() < 1e-10


@pytest.mark.parametrize(
    ("kind", "dry", "message"),
    [
        ("point", {"coulomb": 1}, "requires the 'axis' of its pin"),
        ("point", {"coulomb": 2, "static": 1, "axis": AXIS}, "at least 'coulomb'"),
        ("point", {"coulomb": 1, "axis": AXIS, "brake": 1}, "unknown key 'brake'"),
        ("hinge", {"coulomb": 1, "axis": AXIS}, "unknown key 'axis'"),
        ("weld", {"coulomb": 1}, "no axis of friction"),
    ],
)
def test_wrong_friction_of_a_pin_is_refused_in_one_sentence(tmp_path, kind, dry, message):
    path = four_bar(tmp_path, {"coulomb": 1})
    data = yaml.safe_load(path.read_text())
    data["constraints"] = [{**data["constraints"][0], "kind": kind, "dry_friction": dry}]
    data["outputs"] = {}
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(bc.InputError, match=message):
        bc.load_scene(path)


def test_sizing_counts_the_friction_of_a_pin(tmp_path):
    """Power of the motor at constant speed, averaged over there and back: twice the friction times |G v|."""
    path = four_bar(tmp_path, {"coulomb": 3.0})
    motions = {"turn": {"kind": "waypoints", "times": [0, 4], "positions": [{"crank": 0.8}, {"crank": 1.2}]}}
    scene = bc.load_scene(path, overrides={"motions": motions})
    with_it = bc.scene_inverse_dynamics(scene, scene.motion("turn"))
    without = bc.load_scene(path, overrides={"motions": motions, "constraints.apex.dry_friction.coulomb": 1e-9})
    plain = bc.scene_inverse_dynamics(without, without.motion("turn"))
    k, inner = scene.robot.joint("crank").v, slice(5, -5)
    more = (with_it.torque - plain.torque)[inner, k]
    v = with_it.motion.velocity[inner]
    assert more * v[:, k] == pytest.approx(3.0 * np.abs(v @ G[3]), rel=1e-6)
    assert any("friction of pins (apex)" in note for note in with_it.notes)


def test_a_saved_run_keeps_when_a_pin_was_stuck(tmp_path):
    run = bc.simulate(four_bar(tmp_path, {"coulomb": 40.0}), duration=20.0)
    run.save(tmp_path / "run.npz")
    again = bc.load_run(tmp_path / "run.npz")
    assert again.stuck("apex") == pytest.approx(run.stuck("apex")) and len(run.stuck("apex"))
    assert "stuck" in again.table() and "apex" in again.table()
