"""What a robot file says and is not modelled is among the notes of every result made of the file."""

import json

import pytest

import bellcrank as bc

HOPPER = """<mujoco model="leg">
  <option timestep="0.002"/>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 0.1"/>
    <body name="thigh" pos="0 0 1">
      <joint name="hip" type="hinge" axis="0 1 0" range="-90 90"/>
      <geom type="capsule" size="0.03" fromto="0 0 0 0 0 -0.3" mass="1"/>
      <body name="shank" pos="0 0 -0.3">
        <joint name="knee" type="hinge" axis="0 1 0" range="-120 120"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.3" mass="0.5"/>
        <site name="foot" pos="0 0 -0.3"/>
      </body>
    </body>
  </worldbody>
  <actuator><position name="servo" joint="knee" kp="30"/></actuator>
  <sensor><touch name="ground" site="foot"/></sensor>
</mujoco>
"""
MOTION = {"kind": "waypoints", "times": [0, 0.5, 1], "positions": [{"hip": 0}, {"hip": 0.5, "knee": -0.5}, {"hip": 0}]}
RATINGS = {"ratio": 20, "rated_torque": 2.0, "peak_torque": 6.0, "rated_speed": 300.0, "max_speed": 500.0,
           "rotor_inertia": 1e-5}  # fmt: skip


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    folder = tmp_path_factory.mktemp("leg")
    (folder / "leg.xml").write_text(HOPPER)
    path = folder / "leg.yaml"
    data = {"urdf": "leg.xml", "motions": {"step": MOTION}, "actuators": {"hip": RATINGS, "knee": RATINGS},
            "simulate": {"duration": 0.2}}  # fmt: skip
    path.write_text(json.dumps(data))
    return path


def results(path):
    """Every kind of result of the file, with its notes."""
    scene = bc.load_scene(path)
    yield "run", bc.simulate(scene).notes
    yield "summary", bc.simulate(scene).summary()
    yield "sizing", bc.size(path).warnings
    yield "verdicts", bc.judge(path).warnings
    yield "selection", bc.select(path).warnings
    yield "fastest motion", bc.time_optimal(path, "step").warnings
    yield "linearisation", bc.linearise(scene).notes
    yield "sweep", bc.sweep(scene, {"initial.hip": [0.1, 0.2]}).notes
    yield "sweep of sizings", bc.sweep(scene, {"link.shank.mass": [0.5, 0.6]}, size=True).notes
    yield "report", bc.report(bc.simulate(scene), path.with_name("report.html")).read_text()


def test_every_result_lists_what_the_file_says_and_is_not_modelled(path):
    told = list(bc.load_scene(path).config.notes)
    assert any("servo" in note for note in told) and any("contact" in note for note in told)
    for name, notes in results(path):
        text = notes if isinstance(notes, str) else "\n".join(notes)
        for note in told:
            assert note.split("'")[0].split("<")[0].split("&")[0].strip()[:40] in text, (name, note)
