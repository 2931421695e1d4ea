"""Linearised scenes against eigenvalues derived by hand."""

import csv
import json
import sys

import numpy as np
import pytest
from scipy.io import loadmat

import bellcrank as bc
from bellcrank.errors import BellcrankError, InputError

G = 9.81


def matched(found, expected, bound):
    """Whether each expected eigenvalue is found, and no others."""
    assert len(found) == len(expected)
    for x in expected:
        assert np.abs(found - x).min() <= bound * max(1.0, abs(x))


def test_pendulum():
    """m l² θ̈ = −m g l sin θ for a point mass: λ = ±i √(g/l), l = 1 m; inverted ±√(g/l)."""
    linear = bc.linearise("pendulum")
    assert linear.kind == "equilibrium" and linear.stable
    matched(linear.eigenvalues, [1j * np.sqrt(G), -1j * np.sqrt(G)], 1e-13)
    inverted = bc.linearise(bc.load_scene("pendulum", {"initial.swing": "175 deg"}))
    assert abs(abs(inverted.position[0]) - np.pi) < 1e-12 and inverted.stable is False
    matched(inverted.eigenvalues, [np.sqrt(G), -np.sqrt(G)], 1e-13)


def test_spring_pendulum_at_rest():
    """A mass m on a spring k: along it λ² = −k/m, sideways λ² = −g/r, r = rest + m g/k the stretched length.

    m = 2 kg, k = 15 N/m, rest 5 m.
    """
    linear = bc.linearise("spring_pendulum", at="equilibrium")
    radius = 5.0 + 2.0 * G / 15.0
    assert linear.kind == "equilibrium" and linear.position[1] == pytest.approx(radius, rel=1e-12)
    expected = 1j * np.sqrt([15.0 / 2.0, G / radius])
    matched(linear.eigenvalues, [*expected, *-expected], 1e-12)
    assert [mode.kind for mode in linear.modes] == ["oscillation"] * 2
    swing = linear.modes[0]  # the slow one: the mass moves along its circle only
    assert np.abs(swing.displacement[1]) < 1e-12 * np.abs(swing.displacement[0])


PARALLELOGRAM = """<robot name="parallelogram"><link name="ground"/>
  <link name="crank"><inertial><origin xyz="0.2 0 0"/><mass value="1.5"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.03"/></inertial></link>
  <link name="coupler"><inertial><origin xyz="0.5 0.1 0"/><mass value="2.5"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.06"/></inertial></link>
  <link name="rocker"><inertial><origin xyz="0.15 0 0"/><mass value="0.8"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.02"/></inertial></link>
  <joint name="crank" type="continuous"><parent link="ground"/><child link="crank"/><axis xyz="0 0 1"/></joint>
  <joint name="coupler" type="continuous"><parent link="crank"/><child link="coupler"/><origin xyz="0.4 0 0"/>
    <axis xyz="0 0 1"/></joint>
  <joint name="rocker" type="continuous"><parent link="ground"/><child link="rocker"/><origin xyz="1 0 0"/>
    <axis xyz="0 0 1"/></joint>
</robot>"""
SPRUNG = """name: Sprung parallelogram
urdf: parallelogram.urdf
gravity: [0, -9.81, 0]
frames: {coupler_end: {link: coupler, xyz: [1, 0, 0]}, rocker_end: {link: rocker, xyz: [0.4, 0, 0]}}
constraints: [{name: apex, kind: point, frame_a: coupler_end, frame_b: rocker_end}]
forces: [{kind: joint_spring, joint: crank, stiffness: STIFFNESS, rest: 1.3, damping: 0.7}]
initial: {crank: {guess: 55 deg}, coupler: {guess: -55 deg}, rocker: {guess: 55 deg}}
"""


@pytest.mark.parametrize("stiffness", [60.0, 12.0])
def test_four_bar_with_a_spring_at_rest(stiffness, tmp_path):
    """A parallelogram: crank and rocker (a = 0.4 m) turn by θ alike, the coupler moves without turning.

    T = ½ I θ̇², I = I_c + I_r + m_b a² with moments about the pivots (0.03 + 1.5·0.2² + 0.02 + 0.8·0.15² + 2.5·0.4²);
    V = g S sin θ + ½ k (θ − θ₀)² with S = m_c·0.2 + m_r·0.15 + m_b·0.4. At rest g S cos θ + k (θ − θ₀) = 0, and
    I λ² + d λ + k − g S sin θ = 0. Gravity is carried by the multipliers, so that λ·∂²φ/∂q² is a large part of it.
    """
    (tmp_path / "parallelogram.urdf").write_text(PARALLELOGRAM)
    scene = tmp_path / "sprung.yaml"
    scene.write_text(SPRUNG.replace("STIFFNESS", str(stiffness)))
    linear = bc.linearise(scene)
    inertia = 0.03 + 1.5 * 0.2**2 + 0.02 + 0.8 * 0.15**2 + 2.5 * 0.4**2
    moment = 1.5 * 0.2 + 0.8 * 0.15 + 2.5 * 0.4
    angle = linear.position[0]
    assert G * moment * np.cos(angle) + stiffness * (angle - 1.3) == pytest.approx(0.0, abs=1e-11)
    slope = stiffness - G * moment * np.sin(angle)
    matched(linear.eigenvalues, np.roots([inertia, 0.7, slope]), 1e-11)
    assert linear.stable == (slope > 0.0) and len(linear.states) == 2
    displacement = linear.modes[0].displacement
    # crank and rocker alike, the coupler against them
    assert displacement == pytest.approx(displacement[0] * np.array([1.0, -1.0, 1.0]), abs=1e-12)


# ---- symmetries


CART = """<robot name="cart"><link name="rail"/><link name="cart"><inertial><mass value="3"/>
  <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
  <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>
  <joint name="slide" type="prismatic"><parent link="rail"/><child link="cart"/><axis xyz="1 0 0"/>
  <limit lower="-5" upper="5" effort="9" velocity="9"/></joint>
  <joint name="swing" type="continuous"><parent link="cart"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>"""


def test_a_cart_keeps_the_double_zero_of_its_position(tmp_path):
    """A cart of mass M with a pendulum m, l: λ = 0, 0, ±i √((M + m) g/(M l)); the double zero is exact."""
    (tmp_path / "cart.urdf").write_text(CART)
    linear = bc.linearise(tmp_path / "cart.urdf")
    assert linear.symmetries == ("shift of slide",) and not linear.symmetries_removed
    wanted = np.sqrt(5.0 * G / (3.0 * 0.5))
    assert sorted(np.abs(linear.eigenvalues)) == pytest.approx([0.0, 0.0, wanted, wanted], rel=1e-13)
    assert (np.abs(linear.eigenvalues) == 0.0).sum() == 2
    reduced = bc.linearise(tmp_path / "cart.urdf", keep_symmetries=False)
    assert [name for name, _ in reduced.states] == ["swing", "slide rate", "swing rate"]


# ---- operating points


def test_a_moment_of_a_motion_has_no_eigenvalues():
    linear = bc.linearise(bc.load_scene("pendulum", {"initial.swing": "40 deg"}), at=0.3)
    assert linear.kind == "not steady" and linear.stable is None and linear.modes == ()
    with pytest.raises(InputError, match="neither an equilibrium nor a steady motion"):
        linear.eigenvalues.any()
    assert len(linear.frozen_eigenvalues) == 2


def test_no_equilibrium_is_an_error(tmp_path):
    (tmp_path / "falling.urdf").write_text(CART.replace('<axis xyz="1 0 0"/>', '<axis xyz="0 0 1"/>'))
    with pytest.raises(InputError, match="no equilibrium was found"):
        bc.linearise(tmp_path / "falling.urdf", at="equilibrium")
    with pytest.raises(InputError, match="'at': unknown choice 'steadily'"):
        bc.linearise("pendulum", at="steadily")


def test_an_equilibrium_far_away_is_found_by_a_descent():
    """The UR5 without torque hangs: gravity has no moment about any axis, and its energy is least of all nearby."""
    scene = bc.load_scene("ur5")
    linear = bc.linearise(scene, at="equilibrium")
    assert linear.stable and not linear.velocity.any()
    assert np.abs(scene.robot.inverse_dynamics(linear.position, np.zeros(6), np.zeros(6))).max() < 1e-9
    heights = [scene.robot.frame_pose("tool0", q)[0][2] for q in (linear.position, linear.position + 0.3)]
    assert heights[0] < heights[1]


def test_a_singular_posture_is_refused(tmp_path):
    """A parallelogram that lies flat: the loop's conditions depend on each other there."""
    (tmp_path / "parallelogram.urdf").write_text(PARALLELOGRAM)
    flat = (
        SPRUNG.replace("STIFFNESS", "60")
        .replace("55 deg", "0")
        .replace("-0", "0")
        .replace("[0, -9.81, 0]", "[0, 0, 0]")
    )
    (tmp_path / "flat.yaml").write_text(flat)
    with pytest.raises(InputError, match="singular posture: 1 conditions of the constraints are independent there, 2"):
        bc.linearise(tmp_path / "flat.yaml", at="start")


@pytest.mark.tier2
def test_redundant_conditions_and_idle_symmetries_do_no_harm():
    """Bricard: 5 conditions of rank 4, one freedom. The delta's platform cannot turn: moved in its own axes and back in
    the world's, nothing moves, which is no symmetry.
    """
    bricard = bc.linearise("bricard", at="start")
    assert len(bricard.states) == 2
    delta = bc.linearise("delta", at="equilibrium")
    assert delta.symmetries == () and len(delta.states) == 6 and delta.stable


def test_a_row_of_a_run_is_linearised_where_it_is():
    run = bc.simulate("planar_2r_swing", duration=1.0, samples=11)
    linear = bc.linearise(run, at=0.5)
    assert linear.time == 0.5 and linear.position == pytest.approx(run.position[5])
    found = bc.scene_derivatives(run.scene, run.position[5], run.velocity[5], 0.5)
    expected = np.hstack([found.of_acceleration.position, found.of_acceleration.velocity])
    assert linear.A[2:] == pytest.approx(expected, rel=1e-12)
    with pytest.raises(InputError, match=r"no row at 0\.55 s"):
        bc.linearise(run, at=0.55)


# ---- outputs and files


def test_outputs_follow_small_changes_of_states():
    scene = bc.load_scene("planar_2r_swing")
    linear = bc.linearise(scene, at="equilibrium")
    assert [name for name, _ in linear.outputs][:3] == ["tip x", "tip y", "tip z"]
    step = 1e-5
    for k in range(2):
        change = step * np.eye(2)[k]
        there, back = (scene.robot.frame_pose("tip", linear.position + s * change)[0] for s in (1, -1))
        assert linear.C[:3, k] == pytest.approx((there - back) / (2 * step), abs=1e-8)


def test_multipliers_as_outputs_follow_torques(tmp_path):
    """D of a constraint force is ∂λ/∂τ."""
    (tmp_path / "parallelogram.urdf").write_text(PARALLELOGRAM)
    (tmp_path / "s.yaml").write_text(SPRUNG.replace("STIFFNESS", "60") + "outputs: {pin: {constraint: apex}}\n")
    scene = bc.load_scene(tmp_path / "s.yaml")
    linear = bc.linearise(scene)
    found = bc.scene_derivatives(scene, linear.position, linear.velocity)
    shown = [k for k, (name, _) in enumerate(linear.outputs) if name in ("pin x", "pin y")]
    assert linear.D[shown] == pytest.approx(found.of_multipliers.torque, rel=1e-12)


def test_files(tmp_path):
    linear = bc.linearise("spring_pendulum", at="equilibrium")
    linear.to_json(tmp_path / "modes.json")
    data = json.loads((tmp_path / "modes.json").read_text())
    assert data["A"] == linear.A.tolist() and len(data["modes"]) == 2 and data["stable"] is True
    linear.to_mat(tmp_path / "modes.mat")
    mat = loadmat(tmp_path / "modes.mat")
    assert np.array_equal(mat["A"], linear.A) and mat["states"][0, 0][0] == "swing [rad]"
    assert np.array_equal(mat["eigenvalues"].ravel(), linear.eigenvalues)


def test_python_control_takes_the_matrices(monkeypatch):
    linear = bc.linearise("pendulum")
    system = linear.to_control()
    assert np.array_equal(system.A, linear.A) and system.input_labels == ["swing torque"]
    assert sorted(system.poles().imag) == pytest.approx(sorted(linear.eigenvalues.imag), rel=1e-12)
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(BellcrankError, match="pip install control"):
        linear.to_control()


def test_the_csv_of_root_loci_has_its_values_as_they_are_given(tmp_path):
    """A number may be negative; only texts that a spreadsheet takes for formulas are marked."""
    file = tmp_path / "loci.csv"
    found = bc.root_loci("pendulum", "initial.swing", [-0.1, "2 deg"], "equilibrium")
    found.to_csv(file)
    with file.open(encoding="utf-8") as text:
        head, *rows = csv.reader(text)
    assert head == ["initial.swing", "Re 1 [1/s]", "Im 1 [1/s]", "Re 2 [1/s]", "Im 2 [1/s]"]
    assert [row[0] for row in rows] == ["-0.1", "2 deg"]
    parts = [[complex(float(row[k]), float(row[k + 1])) for k in (1, 3)] for row in rows]
    assert np.array_equal(parts, found.eigenvalues) and min(found.eigenvalues[0].imag) < 0.0
