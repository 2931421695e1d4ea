"""Numbers of the robot's tree, such as link.NAME.mass, are overridden alike in runs, sizings and sweeps."""

import pytest

import bellcrank as bc
from bellcrank.cli import main

MASS = "link.pendulum.mass"


def test_a_mass_of_the_tree_is_sized_the_same_as_override_and_in_a_sweep():
    """The holding torque m g l of 1 m, and the same number from three commands."""
    sizing = bc.size("geared_pendulum", overrides={MASS: "5000 g"})
    other = bc.judge("geared_pendulum", overrides={MASS: 5.0})
    swept = bc.sweep("geared_pendulum", {MASS: [5.0]}, size=True).designs[0].measures
    peak = sizing.joint("shoulder").peak_torque
    assert peak == pytest.approx(swept["shoulder.peak_torque"], rel=1e-12)
    assert peak > 2.0 * bc.size("geared_pendulum").joint("shoulder").peak_torque
    assert any(f"{MASS} = 5000 g" in note for note in sizing.warnings)
    assert any(f"{MASS} = 5.0" in note for note in other.warnings)


def test_a_length_and_a_mass_of_the_tree_change_a_run_as_the_parameters_do():
    """The period of a simple pendulum goes with the square root of its length, whatever its mass."""
    start = {"initial.swing": 0.01, "simulate.duration": 3.0}
    run = bc.simulate("pendulum", overrides=start)
    heavy = bc.simulate("pendulum", overrides=start | {"link.rod.mass": 3.0})
    assert heavy.position[-1, 0] == pytest.approx(run.position[-1, 0], abs=1e-9)
    assert heavy.kinetic_energy.max() == pytest.approx(3.0 * run.kinetic_energy.max(), rel=1e-9)
    scene = bc.load_scene("four_bar")
    changed = scene.with_overrides({"joint.coupler.origin.x": 1.22})  # set by the parameter crank_length
    assert changed.parameters.keys() == scene.parameters.keys()
    assert changed.parameters["crank_length"].value == 1.22
    twice = bc.load_scene("pendulum", {"link.rod.mass": 2.0}).with_overrides({"link.rod.mass": 4.0})
    assert [parameter.value for parameter in twice.parameters.values() if "link.rod.mass" in parameter.sets] == [4.0]


def test_a_sweep_varies_a_number_of_the_tree_without_compiling_anew():
    swept = bc.sweep("planar_2r", {"link.link_1.mass": [0.5, 2.0]})
    for design, mass in zip(swept.designs, (0.5, 2.0), strict=True):
        run = bc.simulate("planar_2r", overrides={"link.link_1.mass": mass})
        assert design.measures["end.shoulder"] == pytest.approx(run.position[-1, 0], abs=1e-6)


@pytest.mark.parametrize("more", [[], ["--size"]], ids=["simulated", "sized"])
@pytest.mark.parametrize(
    ("path", "meant"),
    [
        ("link.pendulm.mass", "unknown link 'pendulm'; did you mean 'pendulum'"),
        ("joint.sholder.origin.x", "unknown joint 'sholder'; did you mean 'shoulder'"),
        ("simulate.rtoll", "unknown key 'rtoll'; did you mean 'rtol'"),
        ("frictoin.shoulder", "'frictoin'; did you mean 'friction'"),
        ("paylods.1.mass", "'paylods'; did you mean 'payloads'"),
    ],
)
def test_an_unknown_path_is_answered_by_the_nearest_one_whether_designs_are_sized_or_not(path, meant, more, capsys):
    assert main(["sweep", "geared_pendulum", "--vary", f"{path}=1,2", *more]) == 2
    assert meant in capsys.readouterr().err


CART = """<robot name="cart"><link name="rail"/><link name="cart"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="x" type="prismatic"><parent link="rail"/><child link="cart"/><axis xyz="1 0 0"/>
<limit lower="-9" upper="9" effort="9" velocity="9"/><dynamics damping="DAMPING"/></joint></robot>"""


@pytest.mark.parametrize(
    ("damping", "words"), [("0", "neutral: nothing grows, and a push"), ("2", "stable but for its place")]
)
def test_a_free_cart_is_not_called_stable(damping, words, tmp_path):
    """x'' = −d x': without damping a push is never stopped, with damping it leaves the cart elsewhere."""
    (tmp_path / "cart.urdf").write_text(CART.replace("DAMPING", damping))
    linear = bc.linearise(tmp_path / "cart.urdf")
    assert f"cart: equilibrium, {words}" in linear.table().splitlines()[0]
    assert "pendulum: equilibrium, stable" in bc.linearise("pendulum").table().splitlines()[0]
