"""Up to when a run is known: what its own error estimate allows, in warnings, reports, files and exit codes."""

import math

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.cli import main
from tests.campaigns.known_until import judged, random_scene, verdict


@pytest.fixture(scope="module")
def chain(tmp_path_factory):
    """A pendulum of four links without friction, which forgets its start within seconds."""
    folder = tmp_path_factory.mktemp("chain")
    inertial = '<inertial><origin xyz="0 0 -0.25"/><mass value="1"/>'
    inertial += '<inertia ixx="0.02" iyy="0.02" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>'
    parts = ['<robot name="chain"><link name="l0"/>']
    for k in range(1, 5):
        parts.append(
            f'<link name="l{k}">{inertial}</link><joint name="j{k}" type="continuous"><parent link="l{k - 1}"/>'
            f'<child link="l{k}"/><origin xyz="0 0 {-0.5 * (k > 1)}"/><axis xyz="0 1 0"/></joint>'
        )
    (folder / "chain.urdf").write_text("".join(parts) + "</robot>")
    path = folder / "chain.yaml"
    path.write_text(
        "urdf: chain.urdf\nfriction: none\ninitial: {j1: 2.0, j2: 0.5}\n"
        "simulate: {duration: 60, rtol: 1.0e-9, atol: 1.0e-9}\n"
    )
    return path


@pytest.fixture(scope="module")
def run(chain):
    return bc.simulate(chain)


def test_a_chaotic_run_is_known_for_most_of_the_time_in_which_it_is_right(chain, run):
    tight = bc.simulate(chain, duration=12.0, rtol=1e-13, atol=1e-13, samples=201)
    same = run.time <= 12.0
    bound = 1e-3 * np.ptp(run.position, axis=0)
    wrong = (np.abs(run.position[same] - tight.position) > bound).any(axis=1)
    first = float(run.time[same][np.argmax(wrong)])
    assert 0.8 * first < run.known_until < first
    assert run.known_estimate > 1.0


def test_warnings_and_summary_say_from_when_on_a_run_is_not_known(run):
    (warning,) = run.warnings
    assert f"not known beyond {run.known_until:.4g} s" in warning and "take smaller tolerances" in warning
    assert f"known up to {run.known_until:.4g} s" in run.table()


def test_a_report_of_a_run_that_is_not_known_is_not_ok(run, tmp_path):
    text = bc.report(run, tmp_path / "report.html").read_text()
    assert "Self-checks passed" not in text and "not known beyond" in text
    assert '<span class="word">Not known</span>' in text


def test_the_file_of_a_run_keeps_until_when_it_is_known(run, tmp_path):
    again = bc.load_run(run.save(tmp_path / "chain.npz"))
    assert again.known_until == run.known_until and again.warnings == run.warnings


def test_the_command_ends_with_1_where_the_run_is_not_known(chain, tmp_path, capsys):
    arguments = ["simulate", str(chain), "--no-plots", "--out", str(tmp_path / "out")]
    assert main([*arguments, "--duration", "30"]) == 1
    assert "not known beyond" in capsys.readouterr().out
    assert main([*arguments, "--duration", "3"]) == 0


def test_the_bound_is_a_setting_of_the_scene(chain):
    loose = bc.simulate(bc.load_scene(chain, {"simulate.error_bound": 1e3}))
    assert loose.known_until == math.inf and loose.warnings == ()
    strict = bc.simulate(bc.load_scene(chain, {"simulate.error_bound": 1e-6}))
    assert strict.known_until < bc.simulate(chain).known_until
    with pytest.raises(bc.InputError, match="error_bound"):
        bc.load_scene(chain, {"simulate.error_bound": 0.0})


def test_a_run_whose_error_takes_long_to_estimate_is_not_called_known(run, monkeypatch, tmp_path):
    slow = bc.simulate(run.scene, duration=2.0)
    monkeypatch.setattr("bellcrank.simulation.trajectory.error_estimate.UNASKED", 0.0)
    assert slow.known_until is None and slow.warnings == ()
    text = bc.report(slow, tmp_path / "report.html").read_text()
    assert "Self-checks passed" not in text and "the error of the positions is not estimated" in text
    assert '<span class="word">Error not estimated</span>' in text
    slow.error_estimate()
    assert slow.known_until == math.inf


def test_energy_drift_at_rest_is_zero_and_not_a_ratio_of_rounding(chain):
    still = bc.simulate(bc.load_scene(chain, {"initial": {"j1": 0.0}, "simulate.duration": 5.0}))
    assert still.energy_drift() == 0.0 and still.warnings == ()
    nudged = bc.simulate(bc.load_scene(chain, {"initial": {"j1": 1e-3}, "simulate.duration": 5.0}))
    assert 0.0 < nudged.energy_drift() < 1e-3


@pytest.mark.parametrize("seed", [500003, 500011])
def test_a_random_run_is_known_exactly_where_two_tight_runs_confirm_it(seed, tmp_path):
    assert verdict(*judged(random_scene(seed, tmp_path))) == ""


@pytest.mark.tier2
@pytest.mark.parametrize("seed", range(300000, 300020))
def test_random_runs_are_known_exactly_where_two_tight_runs_confirm_them(seed, tmp_path):
    assert verdict(*judged(random_scene(seed, tmp_path))) == ""
