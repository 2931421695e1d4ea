"""Keys of scene files that were renamed: old keys are read as the new ones, and a note tells of each."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.scene.renamed_keys import read_scene_data, rename_path
from bellcrank.simulation.scene_notes import scene_notes

OLD = """urdf: planar_2r
motions:
  turn: {kind: waypoints, times: [0, 1], positions: [{shoulder: 0, elbow: 0.2}, {shoulder: 1, elbow: 0.5}]}
drives:
  shoulder: {ratio: 50, rated_torque: 1, peak_torque: 2, rated_speed: 300, max_speed: 400}
closures:
  - {kind: drive, joint: shoulder, motion: turn}
  - {kind: formula, name: bend, expression: elbow.position - 0.2 - lean * t, unit: rad}
  - {kind: distance, name: rod, frame_a: tip, frame_b: world, point: [0.5, 0.5, 0], length: 0.9}
parameters:
  lean: {value: 0.1}
  rod: {value: 0.9, sets: [closure.rod.length]}
events:
  - {name: close, when: {singular_closure: 1e-3}}
  - {name: line, when: {aligned: {joint_a: shoulder, joint_b: elbow, closure: bend}}}
outputs:
  motor: {closure: drive}
  push: {closure: rod}
"""
CHANGES = {"drives:": "actuators:", "closures:": "constraints:", "closure.rod": "constraint.rod",
           "kind: drive,": "name: drive, kind: prescribed_motion,", "kind: formula": "kind: expression",
           "closure: ": "constraint: ", "singular_constraint: ": "singular_constraints: "}  # fmt: skip


@pytest.fixture
def old(tmp_path: Path) -> Path:
    text = OLD.replace("  - {name: line, when: {aligned: {joint_a: shoulder, joint_b: elbow, closure: bend}}}\n", "")
    text = text.replace("  - {kind: distance, name: rod", "  # - {kind: distance, name: rod").replace(
        "  rod: {value: 0.9, sets: [closure.rod.length]}\n", ""
    )
    path = tmp_path / "old.yaml"
    path.write_text(text.replace("  push: {closure: rod}\n", ""))
    return path


def new_of(text: str) -> str:
    for before, after in CHANGES.items():
        text = text.replace(before, after)
    return text


def test_every_old_key_is_rewritten_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "old.yaml").write_text(OLD)
    (tmp_path / "new.yaml").write_text(new_of(OLD))
    data, notes = read_scene_data(tmp_path / "old.yaml")
    expected, none = read_scene_data(tmp_path / "new.yaml")
    assert data == expected and none == ()
    assert list(data) == list(expected) and data.lines == expected.lines
    assert notes == (
        "'closures' (line 6) is now 'constraints'; the old key works until 0.6",
        "'drives' (line 4) is now 'actuators'; the old key works until 0.6",
        "kind 'drive' (line 7) is now 'prescribed_motion'; the old kind works until 0.6",
        "kind 'formula' (line 8) is now 'expression'; the old kind works until 0.6",
        "'closure' (lines 15, 17, 18) is now 'constraint'; the old key works until 0.6",
        "'singular_closure' (line 14) is now 'singular_constraints'; the old key works until 0.6",
        "target 'closure.rod.length' (line 12) is now 'constraint.rod.length'; the old target works until 0.6",
    )


def test_an_old_file_is_the_same_scene_and_is_noted(old: Path) -> None:
    new = old.with_name("new.yaml")
    new.write_text(new_of(old.read_text()))
    scene, other = bc.load_scene(old), bc.load_scene(new)
    assert scene.physics_key() == other.physics_key()
    run, same = bc.simulate(scene, 1.0), bc.simulate(other, 1.0)
    np.testing.assert_array_equal(run.state, same.state)
    assert list(run.outputs) == list(same.outputs) == ["motor"]
    assert scene.config.deprecations[0].startswith("'closures' (line 6) is now 'constraints'")
    assert set(scene.config.deprecations) <= set(scene_notes(scene))
    assert not other.config.deprecations


def test_sizing_notes_an_old_key(old: Path) -> None:
    text = "urdf: planar_2r\n" + OLD[OLD.index("motions:") : OLD.index("closures:")]
    old.write_text(text)
    new = old.with_name("new.yaml")
    new.write_text(new_of(text))
    sizing, other = bc.size(old), bc.size(new)
    assert sizing.warnings[0] == "'drives' (line 4) is now 'actuators'; the old key works until 0.6"
    assert sizing.warnings[1:] == other.warnings and sizing.joints == other.joints


def test_a_saved_run_of_an_old_scene_is_loaded_without_a_note(old: Path) -> None:
    run = bc.load_run(bc.simulate(old, 0.1).save(old.with_name("run.npz")))
    assert run.scene.config.deprecations == ()
    # as version 0.4 wrote them: the scene in the file has the old keys
    with np.load(old.with_name("run.npz")) as archive:
        members: dict[str, Any] = dict(archive)
    about = json.loads(members["about"].tobytes())
    about["files"][about["scene"]] = old.read_text()
    members["about"] = np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)
    np.savez(old.with_name("former.npz"), **members)
    former = bc.load_run(old.with_name("former.npz"))
    np.testing.assert_array_equal(former.state, run.state)
    assert former.scene.config.deprecations == () and list(former.outputs) == ["motor"]


def test_an_old_key_beside_its_new_name_is_refused(old: Path) -> None:
    old.write_text(old.read_text() + "constraints: []\n")
    with pytest.raises(bc.InputError, match=r"old\.yaml: found 'closures' \(line 6\) and 'constraints' \(line 1\d\)"):
        bc.load_scene(old)
    with pytest.raises(bc.InputError, match="keep 'constraints' only"):
        bc.load_scene("four_bar", {"closures": [], "constraints": []})


@pytest.mark.parametrize(
    ("path", "new"),
    {
        "closures": "constraints",
        "closures.apex.kind": "constraints.apex.kind",
        "drives.shoulder.ratio": "actuators.shoulder.ratio",
        "outputs.force.closure": "outputs.force.constraint",
        "events.lock.when.singular_closure": "events.lock.when.singular_constraints",
        "events.lock.when.aligned.closure": "events.lock.when.aligned.constraint",
        "events.lock.when.friction_demand.closure": "events.lock.when.friction_demand.constraint",
    }.items(),
)
def test_overrides_by_old_paths_are_rewritten_and_noted(path: str, new: str) -> None:
    assert rename_path(new) == (new, None)
    found, note = rename_path(path)
    assert found == new and note is not None and f"(override '{path}') is now" in note


def test_words_that_are_no_keys_stay() -> None:
    for path in ("outputs.closure", "closures_of_mine", "initial.drives", "events.closure", "constraints.drive.motion"):
        assert rename_path(path) == (path, None)


def test_overrides_with_old_words_change_the_scene_and_are_noted() -> None:
    hinge = bc.load_scene("four_bar", {"closures.apex.kind": "hinge", "outputs.pin": {"closure": "apex"}})
    assert hinge.constraints[0].kind == "hinge" and "pin" in hinge.outputs
    assert hinge.config.deprecations == (
        "'closures' (override 'closures.apex.kind') is now 'constraints'; the old key works until 0.6",
        "'closure' (override 'outputs.pin') is now 'constraint'; the old key works until 0.6",
    )
    again = hinge.with_overrides({"constraints.apex.kind": "point"})
    assert again.constraints[0].kind == "point" and again.config.deprecations == hinge.config.deprecations
    with pytest.raises(bc.InputError, match=r"override 'closures\.apex\.kind': .*unknown kind 'pin'"):
        bc.load_scene("four_bar", {"closures.apex.kind": "pin"})


def test_a_configuration_gives_its_actuators_by_the_old_attribute_too() -> None:
    config = bc.load_robot_config("ur5")
    with pytest.warns(DeprecationWarning, match=r"'RobotConfig\.drives' is now 'RobotConfig\.actuators'"):
        assert config.drives is config.actuators  # type: ignore[attr-defined]
