"""Objectives and limits by formulas of measures, against closed forms."""

import numpy as np
import pytest
import yaml

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.errors import BellcrankError, InputError

MASS, DISTANCE = 3.0, 2.0  # kg, m
SLIDER = f"""<robot name="slider"><link name="rail"/><link name="cart"><inertial><mass value="{MASS}"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="slide" type="prismatic">
<parent link="rail"/><child link="cart"/><axis xyz="1 0 0"/><limit lower="-9" upper="9" effort="900" velocity="99"/>
</joint></robot>"""
# The quintic from rest to rest over a distance d in a time T: the peak acceleration is 10 d / (√3 T²), the
# peak speed 15 d / (8 T), and the mean squared acceleration 120 d² / (7 T⁴).
PEAK, SQUARE = 10.0 / np.sqrt(3.0), 120.0 / 7.0
TIME = {"motions.go.duration": (0.4, 4.0)}


@pytest.fixture
def slider(tmp_path):
    (tmp_path / "slider.urdf").write_text(SLIDER)
    go = {"kind": "waypoints", "times": [0.0, 1.0], "positions": [{"slide": 0.0}, {"slide": DISTANCE}]}
    path = tmp_path / "slider.yaml"
    path.write_text(yaml.safe_dump({"urdf": "slider.urdf", "motions": {"go": go}}))
    return path


def test_the_time_that_balances_a_peak_force_is_that_of_the_closed_form(slider):
    """min T + w F(T), F = c m d / T²: T³ = 2 w c m d."""
    weight = 0.02
    best = bc.optimise(
        slider, TIME, minimise=f"go.duration + {weight} * slide.peak_torque", size=True, samples=8, starts=2
    )
    expected = np.cbrt(2.0 * weight * PEAK * MASS * DISTANCE)
    assert best.converged and best.values["motions.go.duration"] == pytest.approx(expected, rel=1e-6)
    assert best.objective == pytest.approx(expected + weight * PEAK * MASS * DISTANCE / expected**2, rel=1e-9)


def test_an_integral_of_squares_and_a_limit_by_formula_are_those_of_closed_forms(slider):
    """min T + w T F_rms² = T + w m² (120/7) d² / T³: T⁴ = 3 w m² (120/7) d²; and v F <= P: 15 c m d² / (8 T³) = P."""
    weight, power = 1e-4, 30
    integral = f"go.duration + {weight} * go.duration * slide.rms_torque**2"
    free = bc.optimise(slider, TIME, minimise=integral, size=True, samples=8, starts=2)
    expected = (3.0 * weight * SQUARE * (MASS * DISTANCE) ** 2) ** 0.25
    assert free.converged and free.values["motions.go.duration"] == pytest.approx(expected, rel=1e-5)
    limit = f"slide.peak_speed * slide.peak_torque <= {power}"
    held = bc.optimise(slider, TIME, minimise=integral, limits=[limit], size=True, samples=8, starts=2)
    slower = np.cbrt(15.0 / 8.0 * PEAK * MASS * DISTANCE**2 / power)
    assert slower > expected and held.converged and held.active_limits == (limit,)
    assert held.values["motions.go.duration"] == pytest.approx(slower, rel=1e-6)


@pytest.mark.tier2
def test_a_formula_of_a_peak_has_the_optimum_and_the_exact_gradients_of_the_peak():
    vary = {"link.pendulum.cg.z": (-0.6, 0.4), "link.pendulum.mass": (1.0, 3.0)}
    scene = bc.load_scene("geared_pendulum")
    one = bc.optimise(scene, vary, minimise="shoulder.peak_torque", size=True, samples=32, starts=3)
    same = bc.optimise(scene, vary, minimise="2 * shoulder.peak_torque + 1", size=True, samples=32, starts=3)
    assert same.objective == pytest.approx(2.0 * one.objective + 1.0, rel=1e-6)
    assert set(same.gradients.values()) == set(one.gradients.values()) == {"exact"}
    most = bc.optimise(scene, vary, maximise="10 - shoulder.peak_torque", size=True, samples=32, starts=3)
    assert most.objective == pytest.approx(10.0 - one.objective, rel=1e-6)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"minimise": "slide.peak_torqu"}, "unknown measure 'slide.peak_torqu'; did you mean 'slide.peak_torque'"),
        ({"minimise": "2 * slide.force"}, "unknown measure 'slide.force'"),
        ({"maximise": "1 + 2"}, "names no measure"),
        ({"minimise": "slide.rms_torque +"}, "is not an expression"),
        ({"minimise": "wave(slide.rms_torque)"}, "unknown function 'wave'"),
        ({"minimise": "go.duration", "limits": ["slide.peak_torque + slide.rms_torque <= 3 kg"]}, "a number in N"),
        ({"minimise": "go.duration", "limits": ["slide.peak_torque * go.duration <= 3 N"]}, "expected a number"),
    ],
)
def test_formulas_that_mean_nothing_are_refused_in_one_sentence(slider, asked, words):
    with pytest.raises(InputError, match=words.replace("*", r"\*")) as caught:
        bc.optimise(slider, TIME, size=True, samples=4, **asked)
    assert "\n" not in str(caught.value)


def test_a_division_by_zero_is_an_infeasible_design_with_its_reason(slider):
    with pytest.raises(BellcrankError, match=r"'go\.duration / 0' has no finite value"):
        bc.optimise(slider, TIME, minimise="go.duration / 0", size=True, samples=4, starts=1)


def test_scene_and_command_take_formulas(slider, tmp_path, capsys):
    scene = yaml.safe_load(slider.read_text())
    scene["optimise"] = {
        "vary": {"motions.go.duration": [0.4, 4.0]},
        "minimise": "go.duration + 0.02 * slide.peak_torque",
    }
    scene["optimise"] |= {"size": True, "samples": 4, "starts": 1, "limits": ["2 * slide.peak_speed <= 3 m/s"]}
    slider.write_text(yaml.safe_dump(scene))
    assert main(["optimise", str(slider), "--out", str(tmp_path / "best")]) == 0
    said = capsys.readouterr().out
    assert "go.duration + 0.02 * slide.peak_torque" in said and "2 * slide.peak_speed <= 3 m/s" in said
    command = [
        "optimise",
        str(slider),
        "--minimise",
        "slide.rms_torque / go.duration",
        "--out",
        str(tmp_path / "other"),
    ]
    assert main(command) == 0 and "slide.rms_torque / go.duration" in capsys.readouterr().out
