"""Names of version 0.4 still work in 0.5, and each says its new name once it is used."""

import importlib
import sys

import pytest

import bellcrank as bc
from bellcrank import deprecated


@pytest.mark.parametrize("old", sorted(deprecated.NAMES))
def test_an_old_name_of_the_package_is_the_new_object_with_a_warning(old):
    new = deprecated.NAMES[old]
    with pytest.warns(DeprecationWarning, match=f"'bellcrank.{old}' is now 'bellcrank.{new}'"):
        assert getattr(bc, old) is getattr(bc, new)
    assert old not in bc.__all__ and new in bc.__all__


@pytest.mark.parametrize("old", sorted(deprecated.MODULES))
def test_an_old_module_has_what_the_new_one_has(old, monkeypatch):
    monkeypatch.delitem(sys.modules, f"bellcrank.{old}", raising=False)
    with pytest.warns(DeprecationWarning, match=f"'bellcrank.{old}' is now"):
        found = importlib.import_module(f"bellcrank.{old}")
    new = importlib.import_module(f"bellcrank.{deprecated.MODULES[old]}")
    public = [name for name in vars(new) if not name.startswith("_")]
    assert all(getattr(found, name) is getattr(new, name) for name in public)


def test_a_module_below_an_old_room_is_found():
    with pytest.warns(DeprecationWarning, match=r"'bellcrank.codegen.cache'"):
        old = importlib.import_module("bellcrank.machine_code.cache")
    assert old.digest("a") == importlib.import_module("bellcrank.codegen.cache").digest("a")
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("bellcrank.machine_code.nowhere")
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("bellcrank.nowhere")


def test_old_attributes_of_a_scene_are_the_new_ones():
    scene = bc.load_scene("four_bar")
    with pytest.warns(DeprecationWarning, match=r"'Scene.closures' is now 'Scene.constraints'"):
        assert scene.closures is scene.constraints
    with pytest.warns(DeprecationWarning, match="consistent_start"):
        position, _ = scene.start
    assert len(position) == scene.robot.nq
    with pytest.raises(AttributeError, match="'Scene' object has no attribute 'nothing'"):
        _ = scene.nothing


def test_an_old_keyword_argument_is_passed_on_by_its_new_name():
    @deprecated.renamed_arguments(old="new")
    def twice(new):
        return 2 * new

    assert twice(new=2) == twice(2) == 4
    with pytest.warns(DeprecationWarning, match=r"'twice\(old=…\)' is now 'twice\(new=…\)'"):
        assert twice(old=3) == 6
    with pytest.raises(TypeError, match="not both"):
        twice(old=1, new=2)
