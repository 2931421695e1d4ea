"""Constrained dynamics where it is hard: lost rank, repeated rows, no mass, wrong drawings; and its order."""

import numpy as np
import pytest

from bellcrank.dynamics.equations.system import system_of
from bellcrank.errors import InputError
from bellcrank.scene.scene import load_scene
from bellcrank.simulation.simulate import simulate
from bellcrank_bench.measurements.proximal_accuracy import SHARES, dense, proximal_studies, proximal_table
from bellcrank_bench.problems.n_four_bar import n_four_bar
from bellcrank_bench.problems.problem import scene_of
from bellcrank_bench.problems.rolling_disk import disk_scene
from bellcrank_bench.textbook.four_bar import FourBarWithMultipliers
from bellcrank_bench.textbook.integrate import integrate
from bellcrank_bench.textbook.n_four_bar import NFourBar
from bellcrank_bench.textbook.rolling_disk import SixCoordinateDisk

PIN = {"name": "pin", "kind": "point", "frame_a": "tip_b", "frame_b": "tip_c"}
ROD = {"name": "rod", "kind": "distance", "frame_a": "b", "frame_b": "tip_c", "length": 0.8}
NAIL = {"name": "nail", "kind": "point", "frame_a": "tip_b", "frame_b": "world", "point": [0.5, 0.5, 0.1]}
GRAVITY = {"x y": [0, -9.81, 0], "x z": [0, 0, -9.81]}


def four_bar(
    mass=(1, 1, 1), ground=1.0, stand="0 0 0", plane="x y", start=None, constraints=(PIN,), rocker_rpy="0 0 0", **more
):
    """A four-bar of links 0.3, 0.8 and 0.7 m; `stand` and `rocker_rpy` turn its ground and its rocker's bearing."""
    lengths = (0.3, 0.8, 0.7)

    def link(name, length, m):
        if not m:
            return f'<link name="{name}"/>'
        across = m * length**2 / 12
        return (
            f'<link name="{name}"><inertial><origin xyz="{length / 2} 0 0"/><mass value="{m}"/>'
            f'<inertia ixx="{m * 1e-4}" ixy="0" ixz="0" iyy="{across}" iyz="0" izz="{across}"/></inertial></link>'
        )

    def joint(name, parent, child, x, rpy="0 0 0"):
        return (
            f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{x} 0 0" rpy="{rpy}"/><axis xyz="0 0 1"/></joint>'
        )

    links = [link(name, length, m) for name, length, m in zip("abc", lengths, mass, strict=True)]
    urdf = (
        '<robot name="four_bar"><link name="world_link"/><link name="ground"/>'
        '<joint name="stand" type="fixed"><parent link="world_link"/><child link="ground"/>'
        f'<origin rpy="{stand}"/></joint>{"".join(links)}'
        + joint("crank", "ground", "a", 0)
        + joint("coupler", "a", "b", lengths[0])
        + joint("rocker", "ground", "c", ground, rocker_rpy)
        + "</robot>"
    )
    scene = {
        "gravity": GRAVITY[plane],
        "frames": {
            "tip_b": {"link": "b", "xyz": [lengths[1], 0, 0]},
            "tip_c": {"link": "c", "xyz": [lengths[2], 0, 0]},
        },
        "constraints": list(constraints),
        "initial": start
        or {"crank": 1.0, "coupler": {"guess": -0.5}, "rocker": {"guess": 1.5}, "velocity": {"crank": 2.0}},
        "simulate": {"duration": 3.0, "rtol": 1e-9, "atol": 1e-9},
    }
    return scene_of(urdf, scene | more)


@pytest.fixture(scope="module")
def plain():
    """The run of the four-bar that nothing is wrong with."""
    return simulate(four_bar())


def same(run, plain, bar=1e-7):
    """Whether a run ended well, closed, and as the plain one."""
    assert run.success and run.constraint_residual() < 1e-12 and run.velocity_residual() < 1e-12
    assert np.isfinite(run.multipliers).all()
    assert np.abs(run.position - plain.position).max() < bar
    return True


# ---- rows that repeat, contradict, or say nothing


def test_a_constraint_written_twice_moves_as_once_and_shares_its_force(plain):
    run = simulate(four_bar(constraints=(PIN, PIN | {"name": "again"})))
    assert same(run, plain)
    np.testing.assert_allclose(run.multipliers[:, :2] + run.multipliers[:, 2:], plain.multipliers, atol=1e-5)
    np.testing.assert_allclose(run.multipliers[:, :2], run.multipliers[:, 2:], atol=1e-5)


def test_a_rod_along_a_link_repeats_what_the_link_says(plain):
    """It does so on the constraint alone, so that the stages of a step contradict it a little, and steps shrink."""
    assert same(simulate(four_bar(constraints=(PIN, ROD)), rtol=1e-11, atol=1e-11), plain, 1e-4)


@pytest.mark.parametrize(
    ("constraints", "ground", "message"),
    [
        ((PIN, ROD | {"length": 0.9}), 1.0, "row push.* of 'rod'.*residuals: rod 0.0507 m, pin 0.0478 m"),
        ((PIN, NAIL), 1.0, "'nail' cannot hold: row z"),
        ((PIN,), 3.0, "of 'pin'.*residuals: pin 1.[0-9]+ m"),
    ],
)  # fmt: skip
def test_constraints_that_contradict_or_are_out_of_reach_say_which_and_by_how_much(constraints, ground, message):
    with pytest.raises(InputError, match=message):
        simulate(four_bar(constraints=constraints, ground=ground))


def test_a_constraint_that_a_motor_would_stretch_past_reach_ends_with_a_status():
    """The rocker follows a motion that the crank's 0.3 m cannot: at its dead centre the constraint holds no more."""
    motion = {"kind": "waypoints", "times": [0, 2], "positions": [{"rocker": 1.8}, {"rocker": 3.0}]}
    drive = {"name": "motor", "kind": "prescribed_motion", "joint": "rocker", "motion": "away"}
    start = {"crank": {"guess": 1.0}, "coupler": {"guess": -0.5}, "rocker": {"guess": 1.8}}
    scene = four_bar(constraints=(PIN, drive), motions={"away": motion}, start=start)
    run = simulate(scene, max_evaluations=50_000)
    assert not run.success and 0.0 < run.time[-1] < 2.0
    assert np.isfinite(run.state).all() and f"at {run.time[-1]:.9g} s" in run.message
    torn = simulate(scene, max_evaluations=50_000, stabilisation="none")  # nothing holds it together
    assert np.isfinite(torn.state).all() and any("constraint 'pin' has a residual" in text for text in torn.warnings)


# ---- drawings with rounded right angles


@pytest.mark.parametrize("angle", ["1.57079632679", "1.5708"])
def test_a_planar_loop_in_x_and_z_moves_as_in_x_and_y_however_its_right_angle_is_rounded(angle, plain):
    run = simulate(four_bar(stand=f"{angle} 0 0", plane="x z"))
    assert same(run, plain)
    assert len(system_of(run.scene).multiplier_names) == 2
    size = np.linalg.norm(run.multipliers, axis=1)
    np.testing.assert_allclose(size, np.linalg.norm(plain.multipliers, axis=1), rtol=1e-5, atol=1e-5)


def test_a_bearing_drawn_by_five_digits_does_not_open_the_loop(plain):
    run = simulate(four_bar(rocker_rpy="3.6e-6 0 0"))
    assert same(run, plain)
    assert len(system_of(run.scene).multiplier_names) == 2


# ---- masses


@pytest.mark.tier2
@pytest.mark.parametrize("link", [1, 2])
def test_a_massless_link_in_a_loop_is_the_limit_of_a_light_one(link):
    none, light = ([1.0, 1.0, 1.0] for _ in range(2))
    none[link], light[link] = 0, 1e-9
    run, limit = (simulate(four_bar(mass=mass), rtol=1e-11, atol=1e-11) for mass in (none, light))
    assert same(run, limit, 1e-6)
    np.testing.assert_allclose(run.multipliers, limit.multipliers, atol=1e-5 * np.abs(limit.multipliers).max())
    assert run.energy_drift() < 1e-8


def test_a_massless_link_beyond_the_loop_is_refused_with_its_joint():
    loose = ('<link name="loose"/><joint name="loose_joint" type="continuous"><parent link="a"/><child link="loose"/>'
             '<axis xyz="0 0 1"/></joint></robot>')  # fmt: skip
    scene = four_bar()
    text = (scene.source.parent / scene.data["urdf"]).read_text(encoding="utf-8").replace("</robot>", loose)
    with pytest.raises(
        InputError, match=r"'loose_joint' has no inertia: the mass matrix is singular; give link 'loose' mass"
    ):
        simulate(scene_of(text, scene.data | {"urdf": "replaced"}))


def test_a_loop_without_any_mass_is_refused():
    with pytest.raises(
        InputError, match="the motion of joint 'crank' and joint 'coupler' and joint 'rocker' has no inertia"
    ):
        simulate(four_bar(mass=(0, 0, 0)))


def arm(base, middle, tip, floating=True):
    """A base, a middle link and a tip on two hinges of the same axis, each with mass or without."""

    def link(name, mass):
        inertia = '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/>'
        inside = f'<inertial><origin xyz="0.2 0 0"/><mass value="1"/>{inertia}</inertial>' if mass else ""
        return f'<link name="{name}">{inside}</link>'

    def hinge(name, parent, child, x):
        ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{x} 0 0"/>'
        return f'<joint name="{name}" type="continuous">{ends}<axis xyz="0 0.6 0.8"/></joint>'

    text = "".join([link("base", base), link("middle", middle), link("tip", tip)])
    text += hinge("first", "base", "middle", 0.1) + hinge("second", "middle", "tip", 0.0)
    return scene_of(f'<robot name="arm">{text}</robot>', {"floating_base": floating, "simulate": {"duration": 0.2}})


@pytest.mark.parametrize(
    ("links", "floating", "message"),
    [
        ((0, 1, 1), True, "the free base and joint 'first' has no inertia.*link 'base' mass"),
        ((1, 0, 1), True, "joint 'first' and joint 'second' has no inertia.*link 'middle' mass"),
        ((1, 0, 1), False, "joint 'first' and joint 'second' has no inertia.*link 'middle' mass"),
        ((0, 0, 0), True, "the free base and joint 'first' and joint 'second' has no inertia"),
    ],
)
def test_a_free_base_or_a_coaxial_link_without_mass_is_refused_at_the_start(links, floating, message):
    with pytest.raises(InputError, match=message):
        simulate(arm(*links, floating=floating))


def test_a_massless_link_at_the_end_that_nothing_turns_is_no_hindrance():
    run = simulate(arm(1, 1, 0))
    assert run.success and not run.warnings


@pytest.mark.parametrize("coupler", [1e-6, 1e6])
def test_a_mass_ratio_of_a_million_across_a_loop_keeps_energy_and_constraint(coupler):
    run = simulate(four_bar(mass=(1, coupler, 1)), rtol=1e-11, atol=1e-11)
    assert run.success and run.energy_drift() < 1e-9
    assert run.constraint_residual() < 1e-12 and run.velocity_residual() < 1e-12


# ---- lost rank


@pytest.mark.parametrize("tolerance", [1e-7, 1e-9, 1e-11, 1e-13])
def test_the_n_four_bar_goes_through_singular_positions_at_every_tolerance(tolerance):
    run = simulate(n_four_bar(2), duration=4.0, rtol=tolerance, atol=tolerance, samples=101)
    angle = integrate(NFourBar(2).derivative, np.array([0.0, -1.0]), run.time)[:, 0]
    assert run.success and run.statistics.steps < 400
    assert np.abs(run.output("B0")[:, 0] + np.sin(angle)).max() < max(200 * tolerance, 3e-8)


def test_links_that_lie_flat_at_rest_fall_from_there():
    scene = n_four_bar(2).with_overrides({"initial": {"crank_0": "90 deg", "coupler_0": "-90 deg"}})
    run = simulate(scene, duration=1.0)
    assert run.success and np.isfinite(run.multipliers).all() and run.energy_drift() < 1e-6
    assert run.constraint_residual() < 1e-12


def test_a_four_bar_folded_exactly_flat_starts_and_keeps_its_energy():
    start = {"crank": 0, "coupler": {"guess": 0}, "rocker": {"guess": 0}}
    run = simulate(load_scene("four_bar", {"initial": start, "events": []}), duration=5.0)
    assert run.success and np.isfinite(run.state).all() and run.energy_drift() < 1e-6


# ---- the proximal solve


@pytest.fixture(scope="module")
def studies():
    """The proximal solve against the dense one, μ by μ."""
    return {study.state: study for study in proximal_studies()}


def test_the_proximal_solve_is_exact_for_regular_and_redundant_rows_from_1e_14_to_1e_6(studies):
    assert SHARES[0] == 1e-14 and SHARES[-1] == pytest.approx(1e-6)
    for name in ("four-bar, 1 rad from flat", "Bricard, one row redundant"):
        assert studies[name].acceleration.max() < 1e-12 and studies[name].force.max() < 1e-12


def test_near_a_lost_rank_its_error_grows_as_mu_to_the_fourth_over_the_distance_to_the_eighth(studies):
    at = list(SHARES).index
    near = studies["four-bar, 0.001 rad from flat"].acceleration
    assert near[at(1e-8)] / near[at(1e-9)] == pytest.approx(1e4, rel=0.3)
    nearer = studies["four-bar, 0.0001 rad from flat"].acceleration
    assert nearer[at(1e-11)] == pytest.approx(near[at(1e-9)], rel=0.1)  # μ/x² is the same
    assert studies["four-bar, 0.01 rad from flat"].acceleration[at(1e-9)] < 1e-13


def test_off_its_constraint_a_redundant_row_contradicts_the_others_unless_mu_is_above_a_hundredth_of_the_distance(
    studies,
):
    at, far, near = (
        list(SHARES).index,
        *(studies[f"Bricard mechanism, {d} off"].acceleration for d in ("0.01", "0.0001")),
    )
    assert far[at(1e-14)] > 0.5 and far[at(1e-10)] > 0.5 and near[at(1e-12)] > 0.5
    assert near[at(1e-8)] / near[at(1e-7)] == pytest.approx(10.0, rel=0.3)  # as distance²/μ
    assert near[at(1e-6)] < 2e-4  # no more than the distance changes what it would without that row


def test_the_table_of_the_study_has_a_row_a_state_and_a_column_a_mu(studies):
    lines = proximal_table(list(studies.values())).splitlines()
    assert len(lines) == 1 + len(studies) and all(len(line.split()) >= 10 for line in lines)


def test_the_dense_reference_obeys_newton_and_the_constraint():
    random = np.random.default_rng(2)
    root, j = random.normal(size=(5, 5)), random.normal(size=(2, 5))
    mass, force, right = root @ root.T + np.eye(5), random.normal(size=5), random.normal(size=2)
    for rows, wanted in ((j, right), (np.vstack([j, j]), np.r_[right, right])):
        a, reaction = dense(mass, rows, force, wanted)
        np.testing.assert_allclose(rows @ a, wanted, atol=1e-12)
        np.testing.assert_allclose(mass @ a, force + reaction, atol=1e-12)
        np.testing.assert_allclose(np.linalg.lstsq(rows.T, reaction, rcond=None)[0] @ rows, reaction, atol=1e-12)


# ---- order

STABILISATIONS = ["projection", "none", {"kind": "baumgarte", "alpha": 2.0, "beta": 2.0}]
# (solver, least slope, steps of the four-bar, of the disk) where the leading terms of the error rule; those of pairs
# are so small that the next order still shows: errors may fall faster, never more slowly
ORDERS = [
    ("RK4", 3.8, (80, 112, 160, 224), (160, 224, 320, 448)),
    ("RK45", 4.8, (64, 80, 96, 128, 160), (320, 480, 640, 800)),
    ("DOP853", 7.5, (24, 28, 32, 36, 40), (40, 48, 56, 64, 80)),
]


def order(scene, end, exact, solver, steps, stabilisation):
    """The slope of the error, over a run's four quarters, by the number of steps."""
    errors, times = [], np.linspace(0.0, end, 5)[1:]
    for n in steps:
        run = simulate(scene, duration=end, solver=solver, step=end / n, times=times, stabilisation=stabilisation)
        errors.append(np.sqrt(np.mean((run.state - exact) ** 2)))
    assert errors[0] > errors[-1] > 3e-13
    return -np.polyfit(np.log(steps), np.log(errors), 1)[0]


@pytest.fixture(scope="module")
def quick_four_bar():
    """The four-bar with its crank at 6 rad/s, for 0.32 s, and its state at the quarters to 1e-13."""
    book, end = FourBarWithMultipliers(), 0.32
    q, v = book.closed(np.array(0.5), np.array(6.0), np.array(1.0))
    start = {
        "crank": 0.5,
        "coupler": {"guess": float(q[1])},
        "rocker": {"guess": float(q[2])},
        "velocity": {"crank": 6},
    }
    scene = load_scene("four_bar", {"initial": start, "events": []})
    times = np.linspace(0.0, end, 5)
    exact = simulate(scene, duration=end, solver="DOP853", step=end / 160, times=times).state
    np.testing.assert_allclose(exact[:, :6], integrate(book.derivative, np.r_[q, v], times), rtol=0, atol=1e-11)
    return scene, end, exact[1:]


@pytest.fixture(scope="module")
def quick_disk():
    """The lecture's case A for 0.4 s, and its state at the quarters."""
    end = 0.4
    return load_scene("rolling_disk"), end, simulate(
        "rolling_disk", rtol=1e-13, atol=1e-13, times=np.linspace(0.0, end, 5)[1:]
    ).state  # fmt: skip


@pytest.mark.parametrize("stabilisation", STABILISATIONS, ids=str)
@pytest.mark.parametrize(("solver", "least", "steps", "_"), ORDERS)
def test_every_explicit_method_keeps_its_order_on_the_four_bar(solver, least, steps, _, stabilisation, quick_four_bar):
    assert order(*quick_four_bar, solver, steps, stabilisation) > least


@pytest.mark.parametrize("stabilisation", STABILISATIONS, ids=str)
@pytest.mark.parametrize(("solver", "least", "_", "steps"), ORDERS)
def test_every_explicit_method_keeps_its_order_on_the_rolling_disk(solver, least, _, steps, stabilisation, quick_disk):
    """Non-holonomic rows, a quaternion, and projection of both."""
    assert order(*quick_disk, solver, steps, stabilisation) > least


# ---- disks that lie down


@pytest.mark.parametrize("heading", [0.0, 50.0])
def test_a_disk_that_falls_flat_ends_the_run_there(heading):
    scene = disk_scene(SixCoordinateDisk(), {"tilt": "89.9 deg"}, {"heading": heading})
    run = simulate(scene, duration=5.0)
    assert run.status.value == "event" and np.isfinite(run.state).all()
    assert run.events[-1].name in ("floor lies flat", "floor contact lost")
    assert run.energy_drift() < 1e-8 and run.velocity_residual() < 1e-10


def test_a_disk_at_rest_near_flat_takes_as_long_as_its_rim_turns_about_the_contact():
    """From 0.1 deg at rest, (1 + k) r θ̈ = g to first order."""
    run = simulate(disk_scene(SixCoordinateDisk(), {"tilt": "89.9 deg"}, {}), duration=5.0)
    angle = np.radians(0.1) - 1e-4
    assert run.time[-1] == pytest.approx(np.sqrt(2 * angle * 1.25 * 0.1 / 9.81), rel=1e-4)


def test_a_disk_that_lies_flat_is_refused_as_a_start():
    with pytest.raises(InputError, match="lies flat"):
        simulate("rolling_disk", overrides={"base": {"rpy": ["90 deg", 0, 0]}})
