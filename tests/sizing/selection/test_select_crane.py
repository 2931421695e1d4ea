"""A prismatic joint takes the shipped screws and racks, and `size` of the written file gives the same shaft."""

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.actuators.catalogue.catalogue import Catalogue, load_catalogue
from bellcrank.actuators.powertrain import PowerTrains
from tests.support.crane import URDF

CONFIG = """name: Crane
urdf: crane.urdf
motions:
  swing: {kind: waypoints, times: [0, 1, 2], positions: [{elbow: 0.5}, {elbow: 1.0, slide: 0.3}, {elbow: 0.5}]}
"""
KEEP = {"shoulder": "maxon_607930+beckhoff_tp050_ma_55", "elbow": "maxon_397172+apex_af042_50"}
KEPT = ("maxon_607930", "maxon_397172", "maxon_267121", "maxon_ec45flat_30w_24v")


@pytest.fixture(scope="module")
def selection(tmp_path_factory):
    folder = tmp_path_factory.mktemp("crane")
    (folder / "crane.urdf").write_text(URDF)
    (folder / "crane.yaml").write_text(CONFIG)
    shipped = load_catalogue()
    gears = [one for one in shipped.gears if one.kind in ("screw", "rack") or one.id in " ".join(KEEP.values())]
    motors = [one for one in shipped.motors if one.id in KEPT]
    assert len(motors) == len(KEPT) and {one.kind for one in gears} >= {"screw", "rack"}
    products = Catalogue(tuple(motors), tuple(gears))
    return bc.select(folder / "crane.yaml", None, products, keep=KEEP, candidates=500), folder


@pytest.mark.tier2
def test_a_linear_axis_takes_screws_and_racks_only(selection):
    found, _ = selection
    slide, shoulder = found.axis("slide"), found.axis("shoulder")
    kinds = [one.gear.kind for one in slide.candidates]
    assert slide.axis.kind == "linear" and set(kinds) == {"screw", "rack"}
    assert not {one.gear.kind for one in shoulder.candidates} & {"screw", "rack"}
    assert slide.chosen.gear.maker == "HIWIN" and slide.chosen.tier == "all criteria shown"
    rack = next(one for one in slide.candidates if one.gear.kind == "rack")  # no efficiency is printed of the racks
    assert rack.tier != "all criteria shown" and "peak torque" in rack.unknown


def test_the_screw_by_hand(selection):
    """T = F/(N η) driving, F η'/N driven, plus (J_rotor + J_screw) N a; N = 2π/lead."""
    found, _ = selection
    chosen, [cycle] = found.axis("slide").chosen, found.cycles
    force, speed, acceleration = cycle.torque[:, 2], cycle.speed[:, 2], cycle.acceleration[:, 2]
    motor, screw = chosen.motor, chosen.gear
    through = np.where(force * speed >= 0.0, 1.0 / 0.85, 0.85) * force / screw.ratio
    torque = through + (motor.rotor_inertia + screw.inertia) * screw.ratio * acceleration
    uses = {one.name: one.use for one in chosen.criteria}
    assert uses["motor speed"] == pytest.approx(np.abs(speed).max() * screw.ratio / motor.max_speed, rel=1e-9)
    limit = motor.peak_torque or motor.nominal_torque
    assert uses["peak torque"] == pytest.approx(np.abs(torque).max() / limit, rel=1e-9)


@pytest.mark.tier2
def test_size_of_the_written_file_gives_the_same_shafts(selection):
    found, folder = selection
    sizing, [cycle] = bc.size(found.write_config(folder / "chosen.yaml")), found.cycles
    for k, one in enumerate(found.axes):
        train, shaft = PowerTrains.of(one.chosen.motor, one.chosen.gear), sizing.joint(one.axis.name).shaft
        torque = train.shaft_torque(cycle.torque[:, k], cycle.speed[:, k], cycle.acceleration[:, k])
        assert shaft.peak_torque.value == pytest.approx(np.abs(torque).max(), rel=1e-4)  # refined between samples
        assert shaft.rms_torque == pytest.approx(np.sqrt(cycle.weight @ torque**2 / cycle.duration), rel=1e-6)
        assert shaft.peak_speed.value == pytest.approx(np.abs(cycle.speed[:, k]).max() * one.chosen.gear.ratio, 1e-6)
