"""The build backend keeps the wheel that it built, and builds anew where anything that it is made of has changed."""

import importlib.util
import os
import pty
import sys
import types
from pathlib import Path

import pytest


@pytest.fixture
def backend(tmp_path, monkeypatch):
    """The backend on a small checkout; `backend.built` lists the wheels that were compiled."""
    hooks = types.ModuleType("scikit_build_core.build")
    for name in (
        "build_editable",
        "build_sdist",
        "get_requires_for_build_editable",
        "get_requires_for_build_sdist",
        "get_requires_for_build_wheel",
        "prepare_metadata_for_build_editable",
        "prepare_metadata_for_build_wheel",
    ):
        setattr(hooks, name, None)
    package = types.ModuleType("scikit_build_core")
    package.build = hooks
    monkeypatch.setitem(sys.modules, "scikit_build_core", package)
    monkeypatch.setitem(sys.modules, "scikit_build_core.build", hooks)
    path = Path(__file__).parents[1] / "src" / "build_backend.py"
    spec = importlib.util.spec_from_file_location("build_backend_tried", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.built = []

    def compile_wheel(folder, settings, metadata):
        name = "bellcrank-1-cp311-cp311-linux_x86_64.whl"
        module.built.append(name)
        Path(folder, name).write_text((module.ROOT / "src" / "code.cpp").read_text())
        return name

    hooks.build_wheel = compile_wheel
    monkeypatch.setattr(module, "TOOLS", ("numpy",))
    monkeypatch.setattr(module, "ROOT", tmp_path / "checkout")
    monkeypatch.setattr(module, "KEPT", tmp_path / "checkout" / "build" / "wheels")
    for name in ("src", "urdf", "robots"):
        (module.ROOT / name).mkdir(parents=True)
    for name in ("pyproject.toml", "LICENSE", "README.md", "src/code.cpp"):
        (module.ROOT / name).write_text(name)
    return module


def made(backend, tmp_path, settings=None):
    """The text of the wheel."""
    folder = tmp_path / "out"
    folder.mkdir(exist_ok=True)
    return (folder / backend.build_wheel(str(folder), settings)).read_text()


def test_a_second_install_takes_the_wheel_of_the_first(backend, tmp_path):
    assert made(backend, tmp_path) == made(backend, tmp_path) == "src/code.cpp"
    assert len(backend.built) == 1


@pytest.mark.parametrize("name", ["src/code.cpp", "pyproject.toml", "urdf/new.urdf"])
def test_a_changed_or_new_source_is_compiled(name, backend, tmp_path):
    made(backend, tmp_path)
    (backend.ROOT / name).write_text("changed")
    text = made(backend, tmp_path)
    assert len(backend.built) == 2 and text == (backend.ROOT / "src/code.cpp").read_text()
    assert len(list(backend.KEPT.iterdir())) == 1  # the older one is deleted


def test_other_flags_and_settings_are_compiled_anew(backend, tmp_path, monkeypatch):
    made(backend, tmp_path)
    made(backend, tmp_path, {"cmake.build-type": "Debug"})
    monkeypatch.setenv("CXXFLAGS", "-g")
    made(backend, tmp_path)
    assert len(backend.built) == 3


def test_what_python_leaves_behind_is_no_source(backend, tmp_path):
    made(backend, tmp_path)
    (backend.ROOT / "src" / "__pycache__").mkdir()
    (backend.ROOT / "src" / "__pycache__" / "code.pyc").write_text("")
    (backend.ROOT / "src" / "_step.so").write_text("")
    made(backend, tmp_path)
    assert len(backend.built) == 1


def test_a_checkout_that_cannot_be_written_still_gives_a_wheel(backend, tmp_path, capsys):
    backend.KEPT.parent.mkdir()
    backend.KEPT.write_text("a file where the folder should be")
    assert made(backend, tmp_path) == "src/code.cpp"
    assert "not kept" in capsys.readouterr().err


def test_an_install_tells_the_terminal_that_it_compiles(backend, tmp_path, capfd):
    """Even where its output goes elsewhere, as pip's builds do; without a terminal, on standard error."""
    child, terminal = pty.fork()
    if child == 0:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.dup2(1, 2)
        made(backend, tmp_path)
        os._exit(0)
    with os.fdopen(terminal, "rb") as shown:
        said = shown.readline() + shown.readline()
    os.waitpid(child, 0)
    assert b"bellcrank: compiling" in said
