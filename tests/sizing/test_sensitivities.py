"""Derivatives of sizings by parameters against extrapolated differences of sizings."""

from dataclasses import asdict

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.errors import InputError
from tests.support.extrapolated import slope

pytestmark = pytest.mark.tier2

RESULTS = (
    "max_torque", "min_torque", "peak_torque", "peak_speed", "peak_motoring_power", "peak_regenerating_power",
    "rms_torque", "motoring_energy", "regenerated_energy",
)  # fmt: skip


def differences(scene, name, value, first, **arguments):
    def results(change):
        sizing = bc.size(scene, overrides={f"parameters.{name}.value": value + change}, **arguments)
        return np.array([[getattr(joint, result) for result in RESULTS] for joint in sizing.joints])

    return slope(results, first)


def compared(scene, name, first, bound, **arguments):
    sizing = bc.size(scene, **arguments)
    value = {parameter: x for parameter, x, _ in sizing.parameters}[name]
    [found] = sizing.sensitivities([name])
    expected = differences(scene, name, value, first, **arguments)
    scale = np.abs(expected).max(axis=0) + 1e-9
    for joint, wanted in zip(found.joints, expected, strict=True):
        own = np.array([asdict(joint)[result] for result in RESULTS])
        assert (np.abs(own - wanted) <= bound * scale).all(), (joint.name, own, wanted)


@pytest.mark.parametrize("name", ["crank_length", "coupler_length"])
def test_a_closed_linkage_by_its_lengths(name):
    # the energy between two sign changes of the power ends on points of the grid, which do not move with a parameter
    compared("four_bar", name, 2e-4, 2e-5)


def test_an_open_chain_by_a_mass_a_centre_of_mass_and_a_length():
    robot = bc.load_scene("planar_2r").robot
    link = next(frame for frame in robot.equations.tree.frames if frame.name == "link_2" and frame.is_body)
    length = next(f for f in robot.equations.tree.frames if f.name == "elbow" and not f.is_body).in_parent.translation
    values = {
        "mass": (link.mass, "link.link_2.mass"),
        "cg": (link.lever[0], "link.link_2.cg.x"),
        "length": (length[0], "joint.elbow.origin.x"),
    }
    parameters = {name: {"value": float(value), "sets": [target]} for name, (value, target) in values.items()}
    scene = bc.load_scene("planar_2r").with_overrides({"parameters": parameters})
    for name in values:
        compared(scene, name, 1e-3, 1e-6)


def test_what_is_refused():
    sizing = bc.size("four_bar", "unfold")
    with pytest.raises(InputError, match="unknown parameter 'crank_lenght'"):
        sizing.sensitivities(["crank_lenght"])
    with pytest.raises(InputError, match="unknown joint 'x'"):
        sizing.sensitivities("crank_length")[0].joint("x")
    with pytest.raises(InputError, match="this sizing has none"):
        bc.size("geared_pendulum").sensitivities(["length"])
    with pytest.raises(InputError, match="mass_tolerance=0"):
        bc.size("four_bar", "unfold", mass_tolerance=0.1).sensitivities(["crank_length"])
