"""Loops that universal, prismatic and planar joints close, against the kinematics and dynamics of textbooks."""

import numpy as np
import pytest
from extended_robots import diagonal, joint, link

import bellcrank as bc
from bellcrank.errors import InputError

Z = '<axis xyz="0 0 1"/>'
SLIDER_CRANK = "".join(
    [
        '<robot name="slider_crank"><link name="base"/>',
        link("crank", "0.15 0 0", 0.6),
        link("rod", "0.25 0 0", 0.4),
        link("slider", "0 0 0", 0.9),
        joint("turn", "continuous", "base", "crank", Z),
        joint("big_end", "continuous", "crank", "rod", Z, '<origin xyz="0.3 0 0"/>'),
        joint("small_end", "continuous", "rod", "slider", Z, '<origin xyz="0.5 0 0"/>'),
        "LOOP</robot>",
    ]
)
BETA = 0.6  # rad, between the shafts
SHAFTS = "".join(
    [
        '<robot name="shafts"><link name="base"/>',
        link("one", "0 0.1 0.05", 0.6),
        link("two", "0 0.05 0.1", 0.4),
        joint("input", "continuous", "base", "one", '<axis xyz="1 0 0"/>'),
        joint("output", "continuous", "base", "two", '<axis xyz="1 0 0"/>', f'<origin xyz="0 0 0" rpy="0 0 {BETA}"/>'),
        "LOOP</robot>",
    ]
)
SDF_SHAFTS = f"""<sdf version="1.9"><model name="shafts"><link name="base"/>
<link name="one"><pose>0 0 0 0 0 0</pose></link><link name="two"><pose>0 0 0 0 0 {BETA}</pose></link>
<joint name="ground" type="fixed"><parent>world</parent><child>base</child></joint>
<joint name="input" type="revolute"><parent>base</parent><child>one</child><axis><xyz>1 0 0</xyz></axis></joint>
<joint name="output" type="revolute"><parent>base</parent><child>two</child><axis><xyz>1 0 0</xyz></axis></joint>
<joint name="hooke" type="universal"><pose relative_to="one"/><parent>one</parent><child>two</child>
<axis><xyz expressed_in="one">0 1 0</xyz></axis><axis2><xyz expressed_in="two">0 0 1</xyz></axis2></joint>
</model></sdf>"""


def written(folder, text, loop="", **keys):
    (folder / "robot.urdf").write_text(text.replace("LOOP", loop))
    return bc.load_scene(folder / "robot.urdf", keys)


PRISMATIC = (
    '<loop name="guide" type="prismatic"><predecessor link="slider"/><successor link="base"/>'
    '<axis xyz="1 0 0"/></loop>',
    '<loop_joint name="guide" type="prismatic"><link1 link="slider" xyz="0 0 0" rpy="0 0 0"/>'
    '<link2 link="base" xyz="0.1 0 0" rpy="0 0 0"/><axis xyz="1 0 0"/></loop_joint>',
)


@pytest.mark.tier2
@pytest.mark.parametrize("way", ["yaml", *PRISMATIC])
def test_a_prismatic_loop_guides_the_slider_of_a_slider_crank(tmp_path, way):
    """x = r cos θ + √(l² − r² sin² θ); the slider does not turn."""
    keys = {"initial": {"turn": 0.7, "velocity": {"turn": 2.0}, "big_end": {"guess": -1.0}}}
    if way == "yaml":
        guide = {"name": "guide", "kind": "prismatic", "frame_a": "slider", "frame_b": "world"}
        scene = written(tmp_path, SLIDER_CRANK, constraints=[guide], **keys)
    else:
        scene = written(tmp_path, SLIDER_CRANK, way, **keys)
    run = bc.simulate(scene, 0.6, rtol=1e-10, atol=1e-10)
    angle, tip = run.joint("turn").position, run.frame("slider")
    assert np.ptp(angle) > 0.5
    wanted = 0.3 * np.cos(angle) + np.sqrt(0.25 - (0.3 * np.sin(angle)) ** 2)
    np.testing.assert_allclose(tip.position[:, 0], wanted, atol=1e-11)
    np.testing.assert_allclose(tip.position[:, 1:], 0.0, atol=1e-11)
    np.testing.assert_allclose(tip.rotation, np.tile(np.eye(3), (len(angle), 1, 1)), atol=1e-11)
    assert run.energy_drift() < 1e-7


UNIVERSAL = (
    '<loop name="hooke" type="universal"><predecessor link="one"/><successor link="two"/>'
    '<axis xyz="0 1 0"/><axis2 xyz="0 0 1"/></loop>'
)


@pytest.mark.parametrize("way", ["yaml", "urdf", "sdf"])
def test_a_universal_loop_is_hooke_s_joint(tmp_path, way):
    """tan θ₂ = tan θ₁ / cos β, and the speeds and torques that follow from it."""
    start = {"input": 0.3, "velocity": {"input": 4.0}}
    if way == "sdf":
        (tmp_path / "shafts.sdf").write_text(
            SDF_SHAFTS.replace("</link>", "<inertial><mass>1</mass></inertial></link>")
        )
        scene = bc.load_scene(tmp_path / "shafts.sdf", {"initial": start})
        assert scene.constraints[0].kind == "universal"
    elif way == "urdf":
        scene = written(tmp_path, SHAFTS, UNIVERSAL, initial=start)
    else:
        hooke = {"name": "hooke", "kind": "universal", "frame_a": "one", "frame_b": "two",
                 "axis": [0, 1, 0], "axis_2": [0, 0, 1]}  # fmt: skip
        scene = written(tmp_path, SHAFTS, constraints=[hooke], initial=start)
    run = bc.simulate(scene, 1.2, rtol=1e-10, atol=1e-10)
    first, second = run.joint("input"), run.joint("output")
    assert np.ptp(first.position) > 3.0
    angle = first.position
    residual = np.sin(second.position) * np.cos(angle) * np.cos(BETA) - np.cos(second.position) * np.sin(angle)
    np.testing.assert_allclose(residual, 0.0, atol=1e-11)
    ratio = np.cos(BETA) / (1.0 - (np.sin(BETA) * np.cos(angle)) ** 2)
    np.testing.assert_allclose(second.velocity, ratio * first.velocity, rtol=1e-9, atol=1e-9)
    assert run.energy_drift() < 1e-7


def test_a_body_slides_on_a_planar_loop(tmp_path):
    """On a plane at 30 deg without friction: g sin 30° along the slope, the spin about the normal stays, and the
    constraint's force is m g cos 30°.
    """
    slope = np.pi / 6
    normal = [float(-np.sin(slope)), 0.0, float(np.cos(slope))]
    (tmp_path / "body.urdf").write_text(
        '<robot name="body">' + link("puck", "0 0 0", 2.0, diagonal(0.02, 0.02, 0.03))
        + "</robot>"
    )  # fmt: skip
    scene = bc.load_scene(
        tmp_path / "body.urdf",
        {
            "floating_base": True,
            "frames": {"face": {"link": "puck", "xyz": [0, 0, 0]},},
            "constraints": [{"name": "table", "kind": "planar", "frame_a": "face", "frame_b": "world", "axis": normal}],
            "base": {"position": [0, 0, 0], "rpy": [0, 0, 0],
                     "angular_velocity": [3 * x for x in normal], "expressed_in": "world"},
            "outputs": {"force": {"constraint": "table"}},
        },
    )  # fmt: skip
    run = bc.simulate(scene, 0.8, rtol=1e-10, atol=1e-10)
    along = np.array([np.cos(slope), 0.0, np.sin(slope)])
    place = run.frame("puck").position
    np.testing.assert_allclose(place @ along, -0.5 * 9.81 * np.sin(slope) * run.time**2, atol=1e-9)
    np.testing.assert_allclose(place @ np.array(normal), 0.0, atol=1e-11)
    np.testing.assert_allclose(run.constraint("table").multipliers[:, 0], 2.0 * 9.81 * np.cos(slope), rtol=1e-6)
    np.testing.assert_allclose(
        run.frame("puck").rotation @ np.array(normal), np.tile(normal, (len(place), 1)), atol=1e-10
    )


@pytest.mark.parametrize(
    ("loop", "message"),
    [
        (UNIVERSAL.replace('<axis2 xyz="0 0 1"/>', ""), "is universal without a second axis"),
        (UNIVERSAL.replace("universal", "screw"), "unknown type of loop 'screw'"),
    ],
)
def test_loops_that_are_not_complete_are_refused(tmp_path, loop, message):
    with pytest.raises(InputError, match=message):
        written(tmp_path, SHAFTS, loop)
