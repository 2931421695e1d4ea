"""The tables, files and pictures of a selection, and the configuration that it writes."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from own_products import write_products

import bellcrank as bc
from bellcrank.actuators.catalogue.catalogue import Catalogue, load_catalogue
from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.powertrain import PowerTrains
from bellcrank.errors import InputError
from bellcrank.files.json_files import list_files
from bellcrank.robot.model.payload import Payload
from bellcrank.simulation.simulate import simulate
from bellcrank.sizing.selection.plots import plots_aside, selection_figures
from bellcrank.sizing.selection.select import select
from bellcrank.sizing.selection.selection import Selection
from bellcrank.sizing.selection.selection_files import (
    FILES,
    RESULTS,
    earlier_files,
    json_text,
    write_results,
)
from bellcrank.sizing.selection.tables import WIDTH, selection_html, table, verdict
from bellcrank.sizing.size import size
from tests.support.written import csv_text

CONDITIONS = Conditions(safety_factor=1.1, assume={"gear.efficiency": 0.6})


@pytest.fixture(scope="module")
def products(tmp_path_factory: pytest.TempPathFactory) -> Catalogue:
    return load_catalogue(write_products(tmp_path_factory.mktemp("own")), shipped=False)


@pytest.fixture(scope="module")
def arm(products: Catalogue) -> Selection:
    """The planar arm with a payload, for which all axes have a pair."""
    found = select(
        "planar_2r", ["elbow_up"], products, conditions=CONDITIONS, payloads=[Payload(0.5, "tip")], candidates=4
    )
    assert all(one.chosen for one in found.axes)
    return found


@pytest.fixture(scope="module")
def failing(products: Catalogue) -> Selection:
    """The planar arm with the small motor alone, which cannot drive it."""
    return select("planar_2r", ["elbow_up"], products.filtered(exclude=["large", "huge", "bare"]), candidates=2)


@pytest.fixture(scope="module")
def unknown(products: Catalogue) -> Selection:
    """The pendulum with a motor of which little is known."""
    return select("geared_pendulum", None, products.filtered(exclude=["small", "large", "huge", "g100"]))


def refuse(constant: str) -> None:
    raise AssertionError(f"{constant} in JSON")


@pytest.mark.tier2
def test_tables_say_what_was_chosen_why_and_what_is_next(
    arm: Selection, failing: Selection, unknown: Selection
) -> None:
    text = str(arm)
    for one in arm.axes:
        assert one.chosen is not None
        assert one.chosen.motor.id in text and one.chosen.gear.id in text and one.chosen.binding in text
        assert f"{one.chosen.mass:.4g}" in text and f"{one.chosen.largest_use:.1%}" in text
        assert one.candidates[1].id in text
        assert all(f"{count} {tier}" in " ".join(text.split()) for tier, count in one.counts)
    assert "assumed gear.efficiency 0.6" in text and "safety factor 1.1" in text and arm.proof in " ".join(text.split())
    for each in (arm, failing, unknown):
        assert all(len(line) <= WIDTH for line in f"{table(each)}\n{verdict(each)}".split("\n")), each
        assert "nan" not in str(each).lower() and "inf%" not in str(each) and "None" not in str(each)
        assert selection_html(each).count("<table>") == selection_html(each).count("</table>") > 1


def test_the_verdict_tells_known_from_shown_and_from_failed(
    arm: Selection, failing: Selection, unknown: Selection
) -> None:
    assert arm.shown == ("All inside" in verdict(arm)) and arm.inside
    assert not failing.inside and verdict(failing).startswith("NOTHING FITS: ") and "nothing fits" in table(failing)
    assert "All inside" not in verdict(failing) and "as far as known" not in verdict(failing)
    text = verdict(unknown)
    assert unknown.inside and not unknown.shown
    assert text.startswith("Not verified: 1 motor may be far too weak or too slow")
    assert "- shoulder: bare+g160: voltage limit unknown" in text and "Inside" not in text
    assert "No known limit is exceeded" in text and "fit together, of shoulder" in text
    [axis] = unknown.axes
    assert axis.chosen is not None
    names = [each.name for each in axis.chosen.criteria if each.verdict == "unknown"]
    assert names and f"shoulder: {', '.join(names)}" in " ".join(text.split())


def test_the_csv_has_one_line_an_axis_and_candidate(arm: Selection, unknown: Selection) -> None:
    rows = list(csv.DictReader(csv_text(arm).splitlines()))
    assert len(rows) == sum(len(one.candidates) for one in arm.axes) and None not in rows[0]
    for one in arm.axes:
        own = [row for row in rows if row["axis"] == one.axis.name]
        assert one.chosen is not None and [row["chosen"] for row in own].count("yes") == 1
        [chosen] = [row for row in own if row["chosen"] == "yes"]
        assert (chosen["motor"], chosen["gear"]) == (one.chosen.motor.id, one.chosen.gear.id)
        assert (
            float(chosen["mass [kg]"]) == one.chosen.mass and float(chosen["largest use [1]"]) == one.chosen.largest_use
        )
        for each in one.chosen.criteria:
            assert chosen[f"{each.name} verdict"] == each.verdict
            cell = chosen[f"{each.name} use [1]"]
            assert (cell == "") == (each.use is None) and (each.use is None or float(cell) == each.use)
    [bare] = [row for row in csv.DictReader(csv_text(unknown).splitlines()) if row["chosen"] == "yes"]
    assert bare["mass [kg]"] == "" and bare["loss [W]"] == "" and bare["winding temperature verdict"] == "unknown"


def test_names_that_a_spreadsheet_would_compute_are_guarded(arm: Selection) -> None:
    first = arm.axes[0]
    assert first.chosen is not None
    evil = replace(first.chosen, motor=replace(first.chosen.motor, id="=1+1"))
    text = csv_text(replace(arm, axes=(replace(first, candidates=(evil,)), *arm.axes[1:])))
    assert "'=1+1" in text and ",=1+1" not in text


def test_the_json_is_whole_finite_and_in_si_units(arm: Selection, failing: Selection, unknown: Selection) -> None:
    for each in (arm, failing, unknown):
        document = json.loads(json_text(each), parse_constant=refuse)
        assert document["inside"] == each.inside and document["all_criteria_shown"] == each.shown
        assert [one["name"] for one in document["axes"]] == [one.axis.name for one in each.axes]
        assert [one["chosen"] for one in document["axes"]] == [one.chosen and one.chosen.id for one in each.axes]
    document = json.loads(json_text(arm))
    assert document["conditions"]["assume"] == {"gear.efficiency": 0.6} and document["mass"] == arm.mass
    [cycle] = document["cycles"]
    shoulder = cycle["axes"][0]
    held = arm.cycles[0]
    assert shoulder["rms_torque"] == pytest.approx(np.sqrt(held.weight @ held.torque[:, 0] ** 2 / held.duration))
    # figures are as the catalogue states them: an assumed one is not among them
    gears = [c["gear"] for one in json.loads(json_text(failing))["axes"] for c in one["candidates"] if c["gear"]]
    assert gears and all(("efficiency" in gear) == (gear["id"] != "g100") for gear in gears)


@pytest.mark.tier2
def test_pictures_are_drawn_also_where_torques_are_unknown(
    arm: Selection, failing: Selection, unknown: Selection, tmp_path: Path
) -> None:
    from PIL import Image

    with plots_aside(arm, tmp_path) as drawn:
        paths = drawn()
    assert {path.name for path in paths} <= set(FILES) and {path.name for path in paths} >= {"motors.png"}
    for path in paths:
        with Image.open(path) as image:
            assert image.format == "PNG" and image.width > 600
            assert len(image.convert("RGB").getcolors(1 << 20) or ()) > 20  # something is drawn
    axes = selection_figures(arm)["motors.png"].axes
    assert [one.axis.name in axis.get_title() for one, axis in zip(arm.axes, axes, strict=False)] == [True, True]
    bars = selection_figures(unknown)["utilisation.png"].axes[0]
    assert any(text.get_text() == "unknown" for text in bars.texts)
    assert "motors.png" not in selection_figures(failing) or any(one.chosen for one in failing.axes)
    with pytest.raises(InputError, match="did you mean 'pareto'"):
        arm.plot(what="paretto")
    with pytest.raises(InputError, match="unknown picture format 'exe'"):
        arm.plot(tmp_path / "x.exe")


def test_the_load_points_drawn_are_those_of_the_criteria(arm: Selection) -> None:
    """Torque and speed at the shaft, the safety factor on the whole of it, by the power train directly."""
    axis = selection_figures(arm)["motors.png"].axes[0]
    one, cycle = arm.axes[0], arm.cycles[0]
    assert one.chosen is not None
    train = PowerTrains.of(one.chosen.motor, one.chosen.gear)
    expected = 1.1 * train.shaft_torque(cycle.torque[:, 0], cycle.speed[:, 0], cycle.acceleration[:, 0])
    [points] = [line for line in axis.lines if line.get_label() == "elbow_up"]
    np.testing.assert_allclose(np.asarray(points.get_ydata()), expected, rtol=1e-12)


def test_files_of_an_earlier_selection_are_known_and_nothing_else(arm: Selection, tmp_path: Path) -> None:
    files = write_results(arm, tmp_path)
    assert [path.name for path in files] == ["selection.csv", "selection.json"]
    whole = json.loads(files[1].read_text())
    list_files(files[1], RESULTS, [*RESULTS, "motors.png", "pareto.png"])
    assert json.loads(files[1].read_text()) == whole | {"files": [*RESULTS, "motors.png", "pareto.png"]}
    assert earlier_files(tmp_path) == ["selection.csv", "motors.png", "pareto.png"]
    document = json.loads((tmp_path / "selection.json").read_text())
    (tmp_path / "selection.json").write_text(json.dumps(document | {"files": ["../x", "own.png", "motors.png", 3]}))
    assert earlier_files(tmp_path) == ["motors.png"]
    (tmp_path / "selection.json").write_text("[")
    assert earlier_files(tmp_path) == [] == earlier_files(tmp_path / "none")


# ---- the configuration with the chosen actuators


@pytest.fixture(scope="module")
def written(arm: Selection, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    yield arm.write_config(tmp_path_factory.mktemp("written") / "arm.yaml")


@pytest.mark.tier2
def test_size_of_the_written_file_has_the_loads_of_the_criteria(arm: Selection, written: Path) -> None:
    sizing = size(written, "elbow_up")
    cycle = arm.cycles[0]
    for k, one in enumerate(arm.axes):
        assert one.chosen is not None
        train = PowerTrains.of(one.chosen.motor, one.chosen.gear)
        torque = train.shaft_torque(cycle.torque[:, k], cycle.speed[:, k], cycle.acceleration[:, k])
        shaft = sizing.joint(one.axis.name).shaft
        assert shaft is not None and shaft.peak_torque is not None
        assert shaft.peak_torque.value == pytest.approx(np.abs(torque).max(), rel=1e-6)
        assert shaft.rms_torque == pytest.approx(np.sqrt(cycle.weight @ torque**2 / cycle.duration), rel=1e-6)
        assert shaft.actuator.safety_factor == 1.1
    masses = [mass for mass, _ in sizing.payloads]
    assert masses[0] == 0.5 and sum(masses) == pytest.approx(0.5 + (arm.mass or 0.0))


def test_the_written_file_keeps_the_original_and_names_sources(arm: Selection, written: Path) -> None:
    before, after = bc.load_scene("planar_2r").config, bc.load_scene(written).config
    assert after.gravity == before.gravity and list(after.motions) == list(before.motions) and after.name == before.name
    assert after.urdf == before.urdf
    text = written.read_text()
    assert "# shoulder: " in text and "invented" in text
    for one in arm.axes:
        assert one.chosen is not None
        actuator = after.actuators[one.axis.name]
        assert not actuator.by_ratings and (actuator.motor, actuator.gear) == arm.stated(one.chosen)
        assert actuator.conditions.assume == (("gear.efficiency", 0.6),)


def test_simulate_and_replay_open_the_written_file(arm: Selection, written: Path, tmp_path: Path) -> None:
    from bellcrank.replays.replay import replay

    run = simulate(str(written), duration=0.05)
    assert run.success
    for k, one in enumerate(arm.axes):
        assert one.chosen is not None
        inertia = PowerTrains.of(one.chosen.motor, one.chosen.gear).reflected_inertia[0]
        assert float(run.robot.rotor_inertia[k]) == pytest.approx(inertia, rel=1e-12)
    assert replay(size(written, "elbow_up"), tmp_path / "replay.html").stat().st_size > 100_000


def test_another_selection_of_the_written_file_replaces_the_masses(
    arm: Selection, written: Path, products: Catalogue
) -> None:
    """The masses are in the file once: the same pairs give the same loads again."""
    keep = {one.axis.name: one.chosen.id for one in arm.axes if one.chosen}
    again = select(written, ["elbow_up"], products, conditions=CONDITIONS, keep=keep)
    for one, other in zip(again.axes, arm.axes, strict=True):  # samples are elsewhere; extremes and means agree
        assert one.chosen is not None and other.chosen is not None and one.chosen.id == other.chosen.id
        uses = [(a.use, b.use) for a, b in zip(one.chosen.criteria, other.chosen.criteria, strict=True)]
        assert all(a == pytest.approx(b, rel=1e-5) for a, b in uses if a is not None)


def test_paths_are_relative_to_the_new_place(products: Catalogue, tmp_path: Path) -> None:
    from bellcrank.files import bundled_data

    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "arm.urdf").write_text((bundled_data.folder("urdf") / "geared_pendulum.urdf").read_text())
    lines = ["time [s],shoulder position [rad]", *(f"{t / 20},{0.3 * t / 20}" for t in range(21))]
    (tmp_path / "robots" / "lift.csv").write_text("\n".join(lines) + "\n")
    original = tmp_path / "robots" / "arm.yaml"
    original.write_text("name: Arm\nurdf: arm.urdf\nmotions: {lift: {kind: csv, file: lift.csv}}\n")
    (tmp_path / "chosen").mkdir()
    path = select(original, None, products).write_config(tmp_path / "chosen" / "arm.yaml")
    assert "urdf: ../robots/arm.urdf" in path.read_text() and "file: ../robots/lift.csv" in path.read_text()
    assert size(path).motions == ("lift",)


@pytest.mark.parametrize(
    ("name", "message"),
    [("arm.txt", "expected the name of a YAML file"), ("gone/arm.yaml", ""), ("arm.yaml", "")],
)
def test_where_a_configuration_can_be_written(arm: Selection, tmp_path: Path, name: str, message: str) -> None:
    if message:
        with pytest.raises(InputError, match=message):
            arm.write_config(tmp_path / name)
    else:
        assert bc.load_scene(arm.write_config(tmp_path / name)).config.actuators


def test_what_cannot_be_written_is_said(failing: Selection, arm: Selection, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not written, because no motor was found for shoulder"):
        failing.write_config(tmp_path / "x.yaml")
    with pytest.raises(InputError, match="was not made for a robot configuration"):
        replace(arm, inputs=None).write_config(tmp_path / "x.yaml")
    assert not list(tmp_path.iterdir())


def test_the_original_is_not_overwritten(products: Catalogue, tmp_path: Path) -> None:
    original = tmp_path / "robot.yaml"
    original.write_text(
        "urdf: geared_pendulum\n"
        "motions: {lift: {kind: waypoints, times: [0, 1], positions: [{shoulder: 0}, {shoulder: 1}]}}\n"
    )
    found = select(original, None, products)
    with pytest.raises(InputError, match="write another file"):
        found.write_config(original)
    changed = replace(found, inputs=found.inputs._replace(config=replace(found.inputs.config, gravity=(0.0, 0.0, 0.0))))
    with pytest.raises(InputError, match="'gravity' of the file is not that"):
        changed.write_config(tmp_path / "other.yaml")
    assert not (tmp_path / "other.yaml").exists()


def test_a_selection_chooses_from_the_robots_own_catalogue(tmp_path: Path) -> None:
    write_products(tmp_path / "own")
    (tmp_path / "robot.yaml").write_text(
        "urdf: geared_pendulum\ncatalogue: own\n"
        "motions: {lift: {kind: waypoints, times: [0, 1], positions: [{shoulder: 0}, {shoulder: 1}]}}\n"
    )
    found = select(tmp_path / "robot.yaml", makers=["Own"])
    assert found.axes[0].chosen is not None and found.axes[0].chosen.motor.maker == "Own"
    (tmp_path / "other").mkdir()
    again = bc.load_scene(found.write_config(tmp_path / "other" / "chosen.yaml")).config
    assert again.catalogue is not None and again.catalogue.resolve() == (tmp_path / "own").resolve()


BELT = """
name: Belt arm
urdf: planar_2r
gravity: [0, -9.81, 0]
motions:
  swing: {kind: waypoints, times: [0, 2, 4], positions: [{elbow: -30 deg}, {elbow: -90 deg}, {elbow: -30 deg}]}
transmissions: [{joints: [elbow], motors: [elbow_motor], matrix: [[2]]}]
mounts: {elbow_motor: {link: base, axis: [0, 0, 1]}}
duty: [swing, {pause: 2 s}]
"""


@pytest.mark.tier2
def test_actuators_of_coupled_transmissions_are_written_by_motor(products: Catalogue, tmp_path: Path) -> None:
    (tmp_path / "belt.yaml").write_text(BELT)
    found = select(tmp_path / "belt.yaml", None, products)
    assert [one.axis.name for one in found.axes] == ["shoulder", "elbow_motor"]
    path = found.write_config(tmp_path / "chosen.yaml")
    config = bc.load_scene(path).config
    assert set(config.actuators) == {"shoulder", "elbow_motor"} and config.duty == found.inputs.config.duty
    sizing = size(path)
    shafts, cycle = dict(sizing.shafts), found.cycles[0]
    for k, one in enumerate(found.axes):
        shaft = shafts[one.axis.name]
        assert one.chosen is not None and shaft.peak_torque is not None
        train = PowerTrains.of(one.chosen.motor, one.chosen.gear)
        torque = train.shaft_torque(cycle.torque[:, k], cycle.speed[:, k], cycle.acceleration[:, k])
        assert shaft.peak_torque.value == pytest.approx(np.abs(torque).max(), rel=1e-6)
    assert not sizing.unsizable and sizing.joint("elbow").shaft is None
    assert simulate(str(path), duration=0.02).success


def test_the_included_part_of_an_actuator_is_taken_off(products: Catalogue, tmp_path: Path) -> None:
    text = BELT.replace("{link: base, axis: [0, 0, 1]}", "{included_mass: 1.0}").replace(
        "transmissions: [{joints: [elbow], motors: [elbow_motor], matrix: [[2]]}]\n", ""
    )
    (tmp_path / "arm.yaml").write_text(text.replace("elbow_motor", "elbow"))
    found = select(tmp_path / "arm.yaml", None, products, keep={"elbow": "large+g160", "shoulder": "huge+g160"})
    config = bc.load_scene(found.write_config(tmp_path / "chosen.yaml")).config
    assert sorted(load.mass for load in config.payloads) == pytest.approx([3.5, 7.5])
    heavy = text.replace("elbow_motor", "elbow").replace("included_mass: 1.0", "included_mass: 9.0")
    (tmp_path / "heavy.yaml").write_text(heavy)
    found = select(tmp_path / "heavy.yaml", None, products, keep={"elbow": "large+g160", "shoulder": "huge+g160"})
    with pytest.raises(InputError, match="contains an actuator of 9 kg"):
        found.write_config(tmp_path / "no.yaml")
    assert not (tmp_path / "no.yaml").exists()


def test_without_feedback_no_masses_are_written(products: Catalogue, tmp_path: Path) -> None:
    path = select("geared_pendulum", None, products, feedback=False).write_config(tmp_path / "chosen.yaml")
    assert not bc.load_scene(path).config.payloads and not bc.load_scene(path).config.mounts


def test_an_unknown_mass_is_said_and_not_written(unknown: Selection, tmp_path: Path) -> None:
    from bellcrank.sizing.selection.written_config import write_config

    path, notes = write_config(unknown, tmp_path / "chosen.yaml")
    assert notes == ("the mass of bare+g160 is unknown, and not part of the file",)
    assert not bc.load_scene(path).config.payloads
