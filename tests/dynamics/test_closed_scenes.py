"""The bundled closed scenes start closed and stay so, and agree with equations written by hand."""

import numpy as np
import pytest

from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.errors import InputError
from bellcrank.files.bundled_data import folder
from bellcrank.scene.scene import load_scene
from bellcrank.simulation.simulate import simulate
from bellcrank_bench.measurements.hard_cases import loop_speed
from bellcrank_bench.problems.n_four_bar import judge, n_four_bar, n_four_bar_texts
from bellcrank_bench.problems.urdf_texts import rolling_disk
from bellcrank_bench.textbook.four_bar import FourBarWithMultipliers
from bellcrank_bench.textbook.integrate import integrate
from bellcrank_bench.textbook.n_four_bar import NFourBar
from bellcrank_bench.textbook.rolling_disk import SixCoordinateDisk, free_base

SHIPPED = {  # with the number of rows that bind
    "four_bar": 2, "rolling_disk": 3, "rolling_disk_b": 3, "rolling_disk_c": 3, "rolling_disk_six": 3,
    "n_four_bar_2": 4, "bricard": 5, "five_bar": 2, "two_wheeler": 6, "delta": 6, "planar_delta": 4,
}  # fmt: skip


@pytest.mark.tier2
@pytest.mark.parametrize("name", SHIPPED)
def test_a_bundled_scene_starts_closed_and_stays_so_at_every_output(name):
    run = simulate(name, duration=0.3)
    assert len(system_of(run.scene).multiplier_names) == SHIPPED[name]
    assert run.success and run.constraint_residual() < 1e-12 and run.velocity_residual() < 1e-12
    assert run.energy_drift() < 1e-7


# ---- the factory


@pytest.mark.parametrize("loops", [2, 40])
def test_the_bundled_n_four_bars_are_those_of_the_factory(loops):
    urdf, scene = n_four_bar_texts(loops)
    assert (folder("urdf") / f"n_four_bar_{loops}.urdf").read_text(encoding="utf-8") == urdf
    assert (folder("robots") / f"n_four_bar_{loops}.yaml").read_text(encoding="utf-8") == scene


def test_the_bundled_disk_in_six_coordinates_is_the_factorys():
    assert (folder("urdf") / "thin_disk_six.urdf").read_text(encoding="utf-8").endswith(rolling_disk())


def test_one_loop_of_the_factory_keeps_its_cranks_parallel_through_every_flat_posture():
    run = simulate(n_four_bar(1), duration=5.0, rtol=1e-10, atol=1e-10, samples=201)
    checks = {check.name: check for check in judge(run)}
    assert run.success and checks.pop("passages through the flat position").value >= 4
    assert [check for check in checks.values() if not check.passed] == []


def test_the_first_top_frame_is_b0_at_one_metre_a_second():
    scene = n_four_bar(3)
    run = simulate(scene, duration=0.1)
    assert run.frame("B0").velocity[0] == pytest.approx([1, 0, 0], abs=1e-12)
    assert scene.robot.nv == 7 and len(system_of(scene).multiplier_names) == 6


@pytest.mark.parametrize("loops", [0, -3, 10**6])
def test_a_number_of_loops_that_is_none_is_refused(loops):
    with pytest.raises(InputError, match="n_four_bar: expected 1 to 1000 loops"):
        n_four_bar(loops)


def test_a_step_costs_a_number_of_operations_proportional_to_the_loops():
    operations = {n: system_of(n_four_bar(n)).operations for n in (3, 6, 12)}
    assert operations[12] - operations[6] == pytest.approx(2 * (operations[6] - operations[3]), rel=0.05)


def test_loops_are_timed_against_the_fewest():
    first, *whole = loop_speed((1, 2))
    assert first.name.startswith("2 loops") and first.value > 0
    assert len(whole) == 6 and all(check.passed for check in whole)


# ---- the textbook's equations


def test_the_four_bars_equations_keep_its_energy_and_its_constraint():
    book = FourBarWithMultipliers()
    q, v = book.closed(np.array(0.5), np.array(0.2), np.array(1.0))
    x = integrate(book.derivative, np.r_[q, v], np.linspace(0.0, 3.0, 31))
    energy = sum(book.energy(x[:, :3], x[:, 3:]))
    assert np.ptp(energy) < 1e-11 * energy[0] and np.abs(book.constraint(x[:, :3])).max() < 1e-12


def test_the_four_bars_lock_angle_is_twice_the_arc_sine_and_missing_where_links_are_too_long():
    assert np.degrees(FourBarWithMultipliers().lock_angle) == pytest.approx(150.462301525, abs=1e-9)
    assert FourBarWithMultipliers().lock_angle == pytest.approx(2 * np.arcsin(2.4 / 2.482), abs=1e-15)
    assert np.isnan(FourBarWithMultipliers(length=(1.0, 1.2, 1.2)).lock_angle)


def test_both_branches_of_the_four_bar_are_mirror_images_about_the_line_between_tip_and_pivot():
    book, crank = FourBarWithMultipliers(), np.array([0.4, 1.1, 2.0])
    (q, _), (p, _) = (book.closed(crank, np.zeros(3), np.full(3, side)) for side in (1.0, -1.0))
    assert np.abs(book.constraint(q)).max() < 1e-15 and np.abs(book.constraint(p)).max() < 1e-15
    way = np.arctan2(-1.241 * np.sin(crank), 1.241 - 1.241 * np.cos(crank))
    np.testing.assert_allclose(np.exp(1j * (q + p)[:, 1]), np.exp(2j * (way - crank)), atol=1e-12)


def test_the_rolling_disks_equations_keep_its_energy_and_give_the_lectures_first_velocity():
    disk = SixCoordinateDisk()
    q = np.array([0, 0, 0.1 * np.cos(np.radians(10)), np.radians(45), np.radians(10), 0])
    v = disk.velocity(q, np.radians([0.0, 100.0, 200.0]))
    np.testing.assert_allclose(v[:3], (0.36836532, 0.12528834, -0.03030732), atol=5e-9)
    x = integrate(disk.derivative, np.r_[q, v], np.linspace(0.0, 1.0, 21))
    energy = sum(disk.energy(x[:, :6], x[:, 6:]))
    assert np.ptp(energy) < 1e-11 * energy[0]
    slip = np.einsum("nij,nj->ni", disk.rolling(x[:, :6]), x[:, 6:])
    assert np.abs(slip).max() < 1e-11


def test_circle_rates_and_the_critical_speed_are_those_of_the_closed_forms():
    rates = [SixCoordinateDisk(radius=0.3, k=k).circle_rate(np.radians(10), 1.0) for k in (0.25, 0.5)]
    assert rates == pytest.approx([1.069229755556, 0.923993906121], abs=1e-12)
    disk = SixCoordinateDisk(radius=0.3)
    assert disk.circle_rate(np.radians(10), 0.0) ** 2 == pytest.approx(9.81 / (0.075 * np.cos(np.radians(10))))
    assert disk.critical_speed**2 == pytest.approx(9.81 * 0.3 / 3)
    assert disk.stiffness(disk.critical_speed) == pytest.approx(0, abs=1e-12)


def test_six_coordinates_become_a_free_base_whose_frame_is_the_robots():
    random = np.random.default_rng(5)
    scene, free = load_scene("rolling_disk_six"), load_scene("rolling_disk")
    q, v = random.uniform(-1, 1, (5, 6)), random.normal(0, 1, (5, 6))
    place, speed = free_base(q, v)
    nothing, t = np.zeros((5, 0)), np.zeros((5, 1))
    six = system_of(scene).frame("disk")(t, np.hstack([q, v]), nothing, system_parameters(scene))
    one = system_of(free).frame("disk")(t, np.hstack([place, speed]), nothing, system_parameters(free))
    np.testing.assert_allclose(one, six, atol=1e-14)


def test_parallel_cranks_swing_as_one_physical_pendulum():
    """A single crank and half a coupler each: N → 0 leaves one rod of 1 m about its end, g sin θ · 3/2."""
    assert NFourBar(0).derivative(np.array([np.pi / 2, 2.0])) == pytest.approx([2.0, 1.5 * 9.81])
