"""A sweep says what of its table is noise, and what its designs reach that is not modelled."""

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.cli import main

CHAIN = """<robot name="chain">{links}</robot>"""


def chain(tmp_path, count):
    """A chain of hinged rods of 0.5 m, which is chaotic from four rods on."""
    inertia = '<inertia ixx="0.02" iyy="0.02" izz="0.001" ixy="0" ixz="0" iyz="0"/>'
    body = f'<inertial><origin xyz="0 0 -0.25"/><mass value="1"/>{inertia}</inertial>'
    parts = ['<link name="l0"/>']
    for k in range(count):
        parts.append(
            f'<link name="l{k + 1}">{body}</link><joint name="j{k}" type="continuous"><parent link="l{k}"/><child '
            f'link="l{k + 1}"/><origin xyz="0 0 {0.0 if k == 0 else -0.5}"/><axis xyz="0 1 0"/></joint>'
        )
    (tmp_path / "chain.urdf").write_text(CHAIN.format(links="".join(parts)))
    (tmp_path / "chain.yaml").write_text("urdf: chain.urdf\nsimulate: {duration: 1}\ninitial: {j0: 2}\n")
    return tmp_path / "chain.yaml"


def test_a_table_of_chaotic_runs_is_called_noise_and_one_of_short_runs_is_not(tmp_path, monkeypatch, capsys):
    path = chain(tmp_path, 4)
    vary = {"initial.j0": np.linspace(2.0, 2.5, 34).tolist()}
    short, long = (bc.sweep(bc.load_scene(path, {"simulate.duration": t}), vary) for t in (1.0, 25.0))
    assert short.not_known == () and max(short.check.shares.values()) < 1e-4
    assert len(short.check.designs) == 32 and short.check.rtol == pytest.approx(1e-11)
    [noise] = long.not_known
    assert noise.matter == "reached" and "noise" in noise and "end.j0" in noise
    monkeypatch.chdir(tmp_path)
    for duration, code in (("1", 0), ("25", 1)):
        (tmp_path / "chain.yaml").write_text(path.read_text().replace("duration: 1}", f"duration: {duration}}}"))
        assert main(["sweep", "chain.yaml", "--vary", "initial.j0=2:2.5:4", "--no-plots", "--out", duration]) == code
        out = capsys.readouterr().out
        assert "check: 4 designs were run again at rtol 1e-11" in out
        assert ("is noise: designs run again" in out) is bool(code)


def test_differences_of_the_check_are_those_of_runs_with_a_finer_tolerance():
    scene = bc.load_scene("planar_2r", {"simulate.rtol": 1e-6, "simulate.atol": 1e-6, "simulate.duration": 2})
    swept = bc.sweep(scene, {"initial.elbow": [0.1, 0.4]})
    finer = bc.sweep(
        scene.with_overrides({"simulate.rtol": 1e-8, "simulate.atol": 1e-8}), {"initial.elbow": [0.1, 0.4]}
    )
    gap = np.abs(swept.column("end.elbow") - finer.column("end.elbow"))
    assert swept.check.differences["end.elbow"] == pytest.approx(gap.max(), rel=1e-6)
    share = np.sqrt(np.mean(gap**2)) / swept.column("end.elbow").std()
    assert swept.check.shares["end.elbow"] == pytest.approx(share, rel=1e-6)


def test_a_joint_that_leaves_its_range_in_some_designs_is_said_with_the_first_time():
    """As the notes of the runs say that are simulated one by one."""
    scene, starts = bc.load_scene("planar_2r", {"simulate.duration": 3}), [-1.57, 2.5, 2.8]
    swept = bc.sweep(scene, {"initial.shoulder": starts})
    alone = [bc.simulate(scene, overrides={"initial.shoulder": start}).notes for start in starts]
    times = {k: note.time for k, notes in enumerate(alone) for note in notes if "'elbow' leaves" in note}
    assert 0 < len(times) < 3
    [note] = [note for note in swept.not_known if "'elbow'" in note]
    assert f"'elbow' leaves its range in {len(times)} of 3 designs" in note
    assert note.time == min(times.values()) and f"in design {min(times, key=times.get)};" in note


def test_sizings_tolerances_and_interrupted_sweeps_are_not_run_again():
    assert bc.sweep("geared_pendulum", {"link.pendulum.mass": [1.0, 2.0]}, size=True).check is None
    assert bc.sweep("four_bar", {"simulate.rtol": [1e-6, 1e-8]}).check is None
