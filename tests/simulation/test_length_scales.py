"""The same mechanism from micrometres to kilometres: the same motion, whatever unit its lengths are of the size of."""

import re

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.dynamics.constraints.constraint_rows import characteristic_length
from bellcrank.dynamics.equations.system import system_of
from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.errors import InputError
from bellcrank.scene.scene import load_scene

SIZES = (1e-6, 1e-3, 1e3)
KINDS = ("point", "distance", "weld", "slider", "rolling", "hinge in space")
GAP = re.compile(r"smallest position residuals: loop (\S+) m")


def link(name, s, length, mass):
    """A rod along x as URDF, s times as long and s times as heavy."""
    m, i = mass * s, mass * length**2 / 12.0 * s**3
    return (
        f'<link name="{name}"><inertial><origin xyz="{0.5 * length * s!r} 0 0"/><mass value="{m!r}"/>'
        f'<inertia ixx="{0.1 * i!r}" ixy="0" ixz="0" iyy="{i!r}" iyz="0" izz="{i!r}"/></inertial></link>'
    )


def joint(name, kind, parent, x, s, axis="0 0 1", rpy="0 0 0"):
    limit = f'<limit lower="{-9 * s!r}" upper="{9 * s!r}" effort="1" velocity="1"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{name}_link"/>'
        f'<origin xyz="{x * s!r} 0 0" rpy="{rpy}"/><axis xyz="{axis}"/>'
        f"{'' if kind == 'continuous' else limit}</joint>"
    )


def mechanism(kind, s, folder):
    """The scene of one of KINDS, s times as large: lengths and masses s, gravity s, forces s², times as they are."""
    ground = '<link name="ground"/>'
    rods = [
        joint("crank", "continuous", "ground", 0.0, s), link("crank_link", s, 0.4, 2.0),
        joint("rod", "continuous", "crank_link", 0.4, s), link("rod_link", s, 1.1, 1.0),
    ]  # fmt: skip
    rocker = [joint("rocker", "continuous", "ground", 1.2, s), link("rocker_link", s, 1.0, 1.5)]
    slider = [joint("slider", "prismatic", "ground", 0.0, s, axis="1 0 0"), link("slider_link", s, 0.2, 0.7)]
    frames = {"rod_tip": {"link": "rod_link", "xyz": [1.1 * s, 0, 0]}}
    initial = {"crank": "70 deg", "rod": {"guess": "-50 deg"}, "rocker": {"guess": "80 deg"}}
    scene = {
        "name": kind, "urdf": str(folder / f"{kind}.urdf"), "gravity": [0, -9.81 * s, 0], "frames": frames,
        "initial": initial, "simulate": {"duration": 1.0, "solver": "RK4", "step": 2e-3, "samples": 11},
    }  # fmt: skip
    parts = [ground, *rods]
    if kind in ("point", "distance"):
        parts += rocker
        frames["rocker_tip"] = {"link": "rocker_link", "xyz": [1.0 * s, 0, 0]}
        constraint = {"kind": "point", "frame_a": "rod_tip", "frame_b": "rocker_tip"}
        if kind == "distance":
            constraint = {"kind": "distance", "frame_a": "rod_link", "frame_b": "rocker_tip", "length": 1.1 * s}
            initial["rod"] = "-30 deg"
    elif kind == "weld":  # a rod that ends in a link of a second chain, three joints in a row
        parts += [*rocker, joint("tip", "continuous", "rocker_link", 1.0, s), link("tip_link", s, 0.1, 0.2)]
        frames["end"] = {"link": "rod_link", "xyz": [1.1 * s, 0, 0], "rpy": [0, 0, 0.4]}
        constraint = {"kind": "weld", "frame_a": "end", "frame_b": "tip_link"}
    elif kind == "slider":
        parts += slider
        del initial["rocker"]
        initial["slider"] = {"guess": 1.2 * s}
        constraint = {"kind": "point", "frame_a": "rod_tip", "frame_b": "slider_link"}
        scene["forces"] = [{"kind": "joint_spring", "joint": "slider", "stiffness": 3.0 * s, "rest": 0.5 * s}]
    elif kind == "hinge in space":
        parts += [*slider, joint("turn", "continuous", "slider_link", 0.0, s), link("turn_link", s, 0.1, 0.3)]
        del initial["rocker"]
        initial["slider"] = {"guess": 1.2 * s}
        constraint = {"kind": "hinge", "frame_a": "rod_tip", "frame_b": "turn_link"}
    else:
        parts = ['<link name="wheel">', link("wheel", s, 0.1, 1.0).removeprefix('<link name="wheel">')]
        scene |= {
            "floating_base": True, "initial": {}, "frames": {}, "gravity": [0, 0, -9.81 * s],
            "base": {"position": [0, 0, 0.5 * s], "rpy": [0.2, 0, 0], "angular_velocity": [0.3, 4.0, 0.1]},
        }  # fmt: skip
        constraint = {"kind": "rolling_disk", "frame": "wheel", "radius": 0.5 * s, "axis": [0, 1, 0]}
        scene["base"] = {"rpy": [0.2, 0, 0], "angular_velocity": [0.3, 4.0, 0.1]}
    scene["constraints"] = [{"name": "loop", **constraint}]
    (folder / f"{kind}.urdf").write_text(f'<robot name="machine">{"".join(parts)}</robot>')
    return scene


def read(data, folder):
    import yaml

    path = folder / "scene.yaml"
    path.write_text(yaml.safe_dump(data))
    return load_scene(path)


def in_own_lengths(robot, rows, s):
    """Positions or velocities (n, nq or nv) with lengths as shares of s."""
    far = np.zeros(rows.shape[1], dtype=bool)
    for j in robot.joints:
        first = j.q if rows.shape[1] == robot.nq else j.v
        far[first : first + {"prismatic": 1, "floating": 3}.get(j.kind, 0)] = True
    return rows / np.where(far, s, 1.0)


@pytest.mark.tier2
@pytest.mark.parametrize("kind", KINDS)
def test_a_mechanism_moves_alike_from_micrometres_to_kilometres(kind, tmp_path):
    def run_of(s):
        scene = read(mechanism(kind, s, tmp_path), tmp_path)
        run = bc.simulate(scene)
        assert run.success and run.warnings == ()
        assert run.constraint("loop").relative.max() < 1e-13
        names = [label for _, label in system_of(scene).multiplier_names]
        powers = np.array([2 if label.endswith("[N]") else 3 for label in names])
        both = [in_own_lengths(scene.robot, x, s) for x in (run.position, run.velocity)]
        return scene, names, np.hstack(both), run.multipliers / s**powers, run.energy_drift()

    scene, names, states, multipliers, drift = run_of(1.0)
    assert np.ptp(states, axis=0).max() > 0.3  # it does move
    for s in SIZES:
        other, labels, same, forces, lost = run_of(s)
        assert labels == names
        assert characteristic_length(other) == pytest.approx(s * characteristic_length(scene), rel=1e-12)
        np.testing.assert_allclose(same, states, rtol=0, atol=1e-11)
        np.testing.assert_allclose(forces, multipliers, rtol=0, atol=1e-10 * np.abs(multipliers).max())
        assert lost == pytest.approx(drift, rel=1e-3, abs=1e-13)


@pytest.mark.tier2
@pytest.mark.parametrize("s", [1e-6, 3e-4, 1e3])
def test_a_rod_of_any_length_is_as_long_as_it_says(s, tmp_path):
    """By the positions of its ends from Pinocchio, in an adaptive run from guesses that are rounded or far off."""
    data = mechanism("distance", s, tmp_path)
    data["initial"] |= {"rod": {"guess": "-10 deg"}, "rocker": {"guess": "120 deg"}}
    data["simulate"] = {"duration": 0.5, "samples": 21}
    scene = read(data, tmp_path)
    run = bc.simulate(scene)
    assert run.success and run.warnings == ()
    apart = np.linalg.norm(run.frame("rod_link").position - run.frame("rocker_tip").position, axis=1)
    np.testing.assert_allclose(apart, 1.1 * s, rtol=1e-12)
    data["initial"] |= {"rod": "-30 deg", "rocker": f"{np.degrees(consistent_start(scene)[0][2]) + 0.5:.3f} deg"}
    with pytest.raises(InputError, match="of 'loop'") as refused:
        bc.simulate(read(data, tmp_path))
    gap = float(GAP.search(str(refused.value))[1])
    assert 0.005 < gap / s < 0.01  # about a hundredth of the rod's length, whatever that is


@pytest.mark.tier2
@pytest.mark.parametrize("s", [1e-6, 1e-3])
def test_inverse_dynamics_of_a_small_slider_crank_are_those_of_a_large_one(s, tmp_path):
    def torques(size):
        data = mechanism("slider", size, tmp_path) | {"actuated": ["crank"]}
        data["motions"] = {
            "turn": {"kind": "waypoints", "times": [0, 1], "positions": [{"crank": 1.2}, {"crank": 2.9}]}
        }
        found = bc.scene_inverse_dynamics(read(data, tmp_path), "turn")
        assert found.equation_residual() < 1e-12 and found.constraint_residual() < 1e-12 * size
        return found.torque / size**3, found.position[:, 2] / size

    for mine, large in zip(torques(s), torques(1.0), strict=True):
        np.testing.assert_allclose(mine, large, rtol=0, atol=1e-9 * np.abs(large).max())


def test_a_mass_too_small_to_compute_with_is_refused(tmp_path):
    data = mechanism("point", 1e-17, tmp_path)
    with pytest.raises(InputError, match=r"'crank_link' has a mass of 2e-17 kg; masses below 2\.3e-16 kg"):
        read(data, tmp_path)
