"""Kinetic energy is ½ vᵀ M v, rotors included, whatever a joint's kind and axis; and simulations keep it."""

import numpy as np
import pinocchio as pin
import pytest
from kinetic_energy import half_v_m_v, rotors, traced_energy

import bellcrank as bc
from bellcrank.robot.dynamics.articulated_inertia import mass_matrix
from bellcrank.simulation.simulate import simulate
from bellcrank_bench.measurements.dynamics_speed import random_states
from bellcrank_bench.problems.problem import scene_of
from bellcrank_bench.problems.urdf_texts import joint, link, robot

SKEW = (0.6, 0.0, 0.8)
KINDS = {"revolute": "continuous", "prismatic": "prismatic"}


def random_tree(random):
    """A tree of 6 links on skew revolute and prismatic joints, some of which mimic an earlier one."""
    parts = [link("link_0", 1.0, random.normal(size=3) / 9, (0.1, 0.2, 0.15))]
    for k in range(1, 7):
        kind = ("continuous", "prismatic")[random.integers(2)]
        axis = random.normal(size=3)
        parts.append(link(f"link_{k}", random.uniform(0.2, 2), random.normal(size=3) / 4, random.uniform(0.1, 0.15, 3)))
        parent = f"link_{random.integers(k)}"
        made = joint(f"joint_{k}", kind, parent, f"link_{k}", random.normal(size=3), axis / np.linalg.norm(axis))
        if k in (4, 6):
            made = made.replace("</joint>", f'<mimic joint="joint_{k - 2}" multiplier="-1.5" offset="0.2"/></joint>')
        parts.append(made)
    return robot("random_tree", *parts)


@pytest.mark.parametrize("seed", range(8))
def test_kinetic_energy_of_trees_on_skew_axes_is_half_v_m_v(seed, tmp_path):
    random = np.random.default_rng(seed)
    path = tmp_path / "tree.urdf"
    path.write_text(random_tree(random))
    plain = bc.load_robot(path, floating_base=bool(seed % 2))
    tree = bc.load_robot(path, floating_base=bool(seed % 2), rotor_inertia=rotors(plain, random))
    q, v, _ = random_states(tree, 20)
    np.testing.assert_allclose(traced_energy(tree, q, v), half_v_m_v(tree, q, v), rtol=1e-11)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("axis", [SKEW, (1, 0, 0), (0, 0, -1), (-0.48, 0.6, 0.64)])
def test_the_rotor_of_a_joint_counts_in_its_energy_whatever_the_axis(kind, axis, tmp_path):
    path = tmp_path / "one.urdf"
    path.write_text(robot("one", link("base"), link("body", 2.0, (0, 0, 0), (0.55, 0.55, 0.55)),
                          joint("only", KINDS[kind], "base", "body", axis=axis)))  # fmt: skip
    one = bc.load_robot(path, rotor_inertia={"only": 1.0})
    inertia = {"revolute": 0.55, "prismatic": 2.0}[kind] + 1.0
    assert one.energy([0.3], [2.0])[0] == pytest.approx(0.5 * inertia * 4.0, rel=1e-14)


def test_a_run_with_rotors_on_skew_axes_keeps_its_energy():
    text = robot(
        "skew_arm",
        link("base", 3.0, (0, 0, 0), (0.2, 0.2, 0.2)),
        link("upper", 1.0, (0.3, 0, 0.1), (0.02, 0.03, 0.03)), link("fore", 0.7, (0.2, 0.1, 0), (0.02, 0.02, 0.03)),
        joint("shoulder", "continuous", "base", "upper", (0, 0, 0.2), SKEW),
        joint("elbow", "continuous", "upper", "fore", (0.6, 0, 0), (0, 0.6, -0.8)),
    )  # fmt: skip
    drive = {"ratio": 100, "rated_torque": 10, "peak_torque": 30, "rated_speed": 300, "max_speed": 500}
    scene = {
        "gravity": [0, 0, -9.81], "friction": "none",
        "actuators": {"shoulder": drive | {"rotor_inertia": 4e-5}, "elbow": drive | {"rotor_inertia": 2e-5}},
        "initial": {"shoulder": 0.4, "elbow": -0.7, "velocity": {"shoulder": 2.0, "elbow": -3.0}},
    }  # fmt: skip
    run = simulate(scene_of(text, scene), duration=2.0, rtol=1e-11, atol=1e-12)
    assert np.ptp(run.kinetic_energy) > 1.0 and run.energy_drift() < 1e-10
    quadratic = np.einsum("ni,nij,nj->n", run.velocity, run.robot.mass_matrix(run.position), run.velocity) / 2
    np.testing.assert_allclose(run.kinetic_energy, quadratic, rtol=1e-12)


@pytest.mark.parametrize("name", ["ur5", "talos", "solo12", "z1"])
@pytest.mark.parametrize("floating", [False, True])
def test_the_mass_matrix_by_composite_inertias_is_pinocchios_and_placements_are_where_joints_stand(name, floating):
    model = bc.load_robot(name, friction="none", floating_base=floating).model
    random = np.random.default_rng(2)
    model.armature = random.uniform(0, 1, model.nv)
    data, q = model.createData(), pin.integrate(model, pin.neutral(model), random.uniform(-2, 2, model.nv))
    expected = np.triu(pin.crba(model, data, q)) + np.triu(data.M, 1).T
    matrix, placements = mass_matrix(model, q)
    np.testing.assert_allclose(matrix, expected, atol=1e-12)
    pin.forwardKinematics(model, data, q)
    for ours, theirs in zip(placements, data.oMi, strict=True):
        np.testing.assert_allclose(ours.homogeneous, theirs.homogeneous, atol=1e-13)
