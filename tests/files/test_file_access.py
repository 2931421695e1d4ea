"""Which files are read: regular ones of a limited size, and of those that a file names only what lies near it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bellcrank as bc
from bellcrank import cli
from bellcrank.errors import InputError
from bellcrank.files import bundled_data
from bellcrank.files.access import FileAccess, read_bytes, read_text
from bellcrank.replays.geometry.visuals import robot_bodies
from bellcrank.robot.catalog import find_urdf
from bellcrank.robot.checks.check import check_urdf

SECRET = "mallory:*:19000:0:99999:7:::\nalice:$6$hash:19000:0:99999:7:::\n"
TORQUES = "time [s],shoulder torque [N m]\n0,1\n1,2\n"
TRIANGLE = (
    b"solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n"
)


def arm(mesh: str) -> str:
    """A URDF whose one link is drawn from a mesh file."""
    visual = f'<visual><geometry><mesh filename="{mesh}"/></geometry></visual>'
    inertial = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    return (
        f'<robot name="arm"><link name="base"/><link name="arm">{visual}{inertial}</link>'
        '<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>'
        '<limit lower="-3" upper="3" effort="9" velocity="9"/></joint></robot>'
    )


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A project of two folders, with other things of the user beside it."""
    for name in ("project/robots", "project/urdf", "project/.git", "private"):
        (tmp_path / name).mkdir(parents=True)
    text = find_urdf("planar_2r").read_text()
    for name in ("project/urdf/x.urdf", "project/robots/x.urdf", "project/.git/x.urdf", "private/x.urdf"):
        (tmp_path / name).write_text(text)
    (tmp_path / "project/robots/torque.csv").write_text(TORQUES)
    (tmp_path / "private/torque.csv").write_text(TORQUES)
    return tmp_path / "project"


def scene(project: Path, text: str, name: str = "robots/scene.yaml") -> Path:
    path = project / name
    path.write_text(text)
    return path


# ---- reading


def test_only_regular_files_are_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero"), Path("/dev/null")):
        with pytest.raises(InputError, match="is a pipe, a device or a socket"):
            read_bytes(path)
    with pytest.raises(InputError, match="is a folder; name a file in it"):
        read_bytes(tmp_path)
    with pytest.raises(InputError, match="there is no such file"):
        read_bytes(tmp_path / "gone")
    with pytest.raises(InputError, match="cannot be read"):
        read_bytes(tmp_path / ("x" * 300))
    with pytest.raises(InputError, match="cannot be read"):
        read_bytes("a\0b")


def test_what_is_read_is_limited_and_not_what_the_file_system_claims(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"x" * 1000)
    assert read_bytes(path, 1000) == b"x" * 1000
    with pytest.raises(InputError, match="is too large"):
        read_bytes(path, 999)
    with path.open("r+b") as file:
        file.truncate(2**40)  # sparse: a terabyte that takes no room
    with pytest.raises(InputError, match="is too large; the limit for such files is 64 MiB"):
        read_bytes(path)
    if Path("/proc/self/maps").exists():  # these claim to hold nothing
        assert len(read_bytes("/proc/self/maps")) > 1000
        with pytest.raises(InputError, match="is too large"):
            read_bytes("/proc/self/maps", 100)


def test_texts_are_utf8_without_mark_and_with_plain_line_ends(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes("\ufeffa\r\nb\rc\n°".encode())
    assert read_text(path) == "a\nb\nc\n°"
    path.write_bytes(b"caf\xe9 secret")
    with pytest.raises(InputError, match="not valid UTF-8 at byte 3") as caught:
        read_text(path)
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize("command", ["simulate pipe.yaml", "simulate pipe.urdf", "check pipe.urdf", "replay pipe.npz",
    "size planar_2r --motion pipe.csv", "report pipe.npz", "sweep pipe.yaml --vary a=1,2"])  # fmt: skip
def test_a_pipe_on_the_command_line_is_refused_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    for kind in ("yaml", "urdf", "csv", "npz"):
        os.mkfifo(tmp_path / f"pipe.{kind}")
    assert cli.main(command.split()) == 2
    assert "expected a regular file" in capsys.readouterr().err


# ---- which files may be named


def test_the_own_folder_what_is_below_and_what_lies_beside_may_be_named(project: Path) -> None:
    access = FileAccess.of(project / "robots" / "scene.yaml")
    for name in ("a", "b/c", "./a", "b/../a", "../urdf/x.urdf", "../robots/a", ".hidden/a", "../../project/urdf/a",
                 str(project / "robots/a"), str(project / "robots/b/c")):  # fmt: skip
        assert access.path(name).resolve().is_relative_to(project)
    (project / "robots" / "link").symlink_to(project.parent / "private")
    (project / "robots" / "near").symlink_to(project / "urdf")
    assert access.path("near/x.urdf")
    refused = (
        "../../private/x.urdf", "../../gone", "../..", "../.git/config", "../.gone", "/etc/passwd", "link/x.urdf",
        "link/gone", str(project / "urdf/x.urdf"), str(project / "robots/link/x.urdf"), "~/a", "a\0b",
    )  # fmt: skip
    for name in refused:
        with pytest.raises(InputError, match=r"is not allowed: expected a relative path to a file in .*--trust DIR"):
            access.path(name)


def test_a_refusal_says_the_same_of_files_that_are_there_and_of_others(project: Path) -> None:
    access = FileAccess.of(project / "robots" / "scene.yaml")
    (project / "robots" / "here").symlink_to(project.parent / "private" / "x.urdf")
    (project / "robots" / "gone").symlink_to(project.parent / "private" / "none")
    pairs = [("../../private/x.urdf", "../../private/none"), ("/etc/passwd", "/etc/none"), ("here", "gone")]
    for there, absent in pairs:
        messages = []
        for name in (there, absent):
            with pytest.raises(InputError) as caught:
                access.path(name)
            messages.append(str(caught.value).replace(name, "NAME"))
        assert messages[0] == messages[1]


def test_in_a_home_or_a_temporary_folder_what_lies_beside_is_other_people_s(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home, shared = tmp_path / "home", tmp_path / "tmp"
    for folder in (home / "Downloads" / "zip", home / "work" / "robots", home / ".ssh", shared / "mine"):
        folder.mkdir(parents=True)
    shared.chmod(0o1777)
    monkeypatch.setenv("HOME", str(home))

    def allowed(folder: Path, *names: str) -> list[str]:
        access = FileAccess.of(folder / "scene.yaml")
        return [name for name in names if access.allows(folder / name)]

    assert allowed(home, "a", "work/a", ".ssh/id", "../a") == ["a", "work/a"]
    assert allowed(home / "work", "a", "b/a", "../a", "../.ssh/id") == ["a", "b/a"]
    assert allowed(home / "work" / "robots", "a", "../a", "../../a") == ["a", "../a"]
    assert allowed(home / "Downloads", "a", "../a") == ["a"]
    assert allowed(home / "Downloads" / "zip", "a", "../a", "../../a") == ["a"]
    assert allowed(shared / "mine", "a", "../a") == ["a"]
    assert allowed(Path("/"), "a", "etc/passwd") == ["a"]
    assert allowed(Path("/etc"), "a", "../a") == ["a"]


SCENES = {
    "urdf": "urdf: {}x.urdf\n",
    "a table of torques": "urdf: planar_2r\nforces: [{{kind: torque, joint: shoulder, file: {}torque.csv}}]\n",
    "a table of a wrench": "urdf: planar_2r\nforces: [{{kind: wrench, frame: tip, file: {}torque.csv}}]\n",
    "a motion": "urdf: planar_2r\nmotions: {{go: {{kind: csv, file: {}torque.csv}}}}\n",
    "a motion in a join": (
        "urdf: planar_2r\nmotions: {{go: {{kind: join, parts: [{{kind: csv, file: {}torque.csv}}]}}}}\n"
    ),
    "a run to start from": "urdf: planar_2r\ninitial: {{run: {}run.npz}}\n",
    "loops of Gepetto": "urdf: planar_2r\nconstraints: [{{kind: gepetto, file: {}loops.yaml}}]\n",
    "loops of MJCF": "urdf: planar_2r\nconstraints: [{{kind: mjcf, file: {}loops.xml}}]\n",
    "loops of SDF": "urdf: planar_2r\nconstraints: [{{kind: sdf, file: {}loops.sdf}}]\n",
}


@pytest.mark.parametrize("what", SCENES)
@pytest.mark.parametrize("place", ["../../private/", "{private}/", "/dev/../etc/", "link/", "../.git/"])
def test_every_file_that_a_scene_names_is_refused_from_elsewhere(project: Path, what: str, place: str) -> None:
    (project / "robots" / "link").symlink_to(project.parent / "private")
    path = scene(project, SCENES[what].format(place.format(private=project.parent / "private")))
    with pytest.raises(InputError, match=r"scene.yaml: .*(urdf|file|run).* is not allowed: .*--trust DIR") as caught:
        bc.load_scene(path)
    assert "\n" not in str(caught.value)


def test_trust_allows_by_argument_by_variable_and_by_option(
    project: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    private = project.parent / "private"
    table = SCENES["a table of torques"].format("../../private/")
    path = scene(
        project, table.replace("planar_2r", str(private / "x.urdf")) + "simulate: {duration: 0.01, samples: 2}\n"
    )
    with pytest.raises(InputError, match="is not allowed"):
        bc.load_scene(path)
    again = bc.load_scene(path, trust=private).with_overrides({"initial.shoulder": 0.1})
    assert again.robot.source == private / "x.urdf"
    assert bc.load_scene(path, trust=[project, str(private)]).forces
    run = bc.simulate(path, trust=private)
    assert run.success and bc.prepare(path, trust=private)().status == run.status
    assert bc.sweep(path, {"initial.shoulder": [0.1]}, trust=private, threads=1).designs[0].status == "finished"
    saved = run.save(project / "run.npz")
    for call in (
        partial(bc.simulate, run.scene), partial(bc.prepare, run.scene), partial(bc.sweep, run.scene),
        partial(bc.replay, run), partial(bc.show, run),
    ):  # fmt: skip
        with pytest.raises(InputError, match=r"'trust': applies only to paths, and '(scene|source)' is loaded already"):
            call(trust=private)
    assert bc.replay(saved, project / "page.html", trust=private, plots=False).is_file()
    with pytest.raises(InputError, match=r"'trust': .*there is no such folder"):
        bc.replay(saved, project / "page.html", trust=project / "gone")
    monkeypatch.chdir(project)
    command = ["simulate", "robots/scene.yaml", "--no-plots", "--out", "run"]
    assert cli.main(command) == 2
    assert cli.main([*command, "--trust", "urdf", "--trust", "../private"]) == 0
    monkeypatch.setenv("BELLCRANK_TRUST", os.pathsep.join(["/gone", "", str(private)]))
    assert bc.load_scene(path).forces
    monkeypatch.delenv("BELLCRANK_TRUST")
    capsys.readouterr()
    with pytest.raises(InputError, match=r"'trust': .*there is no such folder"):
        bc.load_scene(path, trust=project / "gone")
    for each in ("simulate", "size", "replay", "report", "plot"):
        assert cli.main([each, "robots/scene.yaml", "--trust", "gone"]) == 2
        assert "gone: there is no such folder" in capsys.readouterr().err


def test_what_the_user_writes_on_the_command_line_is_read_wherever_it_is(project: Path) -> None:
    private = project.parent / "private"
    path = scene(project, "urdf: x.urdf\nforces: [{name: push, kind: torque, joint: shoulder, file: torque.csv}]\n")
    changed = bc.load_scene(path, {"urdf": str(private / "x.urdf"), "forces.push.file": str(private / "torque.csv")})
    assert changed.robot.source == private / "x.urdf" and changed.with_overrides({"initial.elbow": 0.2}).forces
    with pytest.raises(InputError, match="is not allowed"):  # of another key
        bc.load_scene(scene(project, f"urdf: {private}/x.urdf\n"), {"gravity": [0, 0, -1]})
    assert bc.load_scene(private / "x.urdf").robot.name == "planar_2r"
    assert bc.load_scene(private / "x.urdf").config.robot().name == "planar_2r"


def test_bundled_robots_and_data_may_be_named_from_anywhere(project: Path) -> None:
    data = bundled_data.folder("urdf") / "planar_2r.urdf"
    for name in ("planar_2r", "ur5", "../urdf/x.urdf", "x.urdf", str(data), str(find_urdf("ur5"))):
        assert bc.load_scene(scene(project, f"urdf: {name}\n")).robot.nv in (2, 6)


def test_a_name_that_is_a_robot_s_is_not_looked_up_in_the_working_folder(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(project.parent / "private")
    (project.parent / "private" / "mine").write_text(SECRET)
    with pytest.raises(InputError, match="unknown robot 'mine'"):
        bc.load_scene(scene(project, "urdf: mine\n"))


# ---- messages


@pytest.mark.parametrize("what", SCENES)
def test_messages_tell_nothing_of_a_file_that_is_not_what_was_expected(project: Path, what: str) -> None:
    secrets = [SECRET, "<mallory><alice/></mallory>", "<alice><mallory>", "mallory alice", "- mallory\n- alice\n"]
    secrets += ['{"mallory": "alice"}', "mallory,alice\n1,2\n2,3\n", "mallory;alice\n", "'mallory alice", "*mallory"]
    secrets += ["&mallory [*alice]", "!!mallory alice"]
    for secret in secrets:
        for name in ("x.urdf", "torque.csv", "run.npz", "loops.yaml", "loops.xml", "loops.sdf"):
            (project / "robots" / name).write_text(secret)
        path = scene(project, SCENES[what].format(""))
        try:
            loaded = bc.load_scene(path)
            loaded.motion("go")
        except InputError as error:
            told = str(error).replace(str(project), "")
            assert "mallory" not in told and "alice" not in told and "hash" not in told, (secret, told)
        else:
            raise AssertionError(secret)


def test_a_table_with_a_time_still_has_its_columns_named(project: Path) -> None:
    (project / "robots/torque.csv").write_text("time [s],sholder torque [N m]\n0,1\n1,2\n")
    with pytest.raises(InputError, match="sholder torque"):
        bc.load_scene(scene(project, SCENES["a table of torques"].format("")))


# ---- meshes


def drawn(robot: Any) -> tuple[bool, str]:
    """Whether the mesh of the arm is drawn, and the notes."""
    found, notes = robot_bodies(robot)
    return any(shape.mesh is not None for body in found for shape in body.shapes), " ".join(notes)


def test_meshes_are_read_near_the_urdf_and_from_trusted_folders(tmp_path: Path) -> None:
    for name in ("arm/urdf", "arm/meshes", "arm/.git", "private"):
        (tmp_path / name).mkdir(parents=True)
    for name in ("arm/urdf/m.stl", "arm/meshes/m.stl", "arm/.git/m.stl", "private/m.stl"):
        (tmp_path / name).write_bytes(TRIANGLE)
    (tmp_path / "arm/urdf/link.stl").symlink_to(tmp_path / "private/m.stl")
    path = tmp_path / "arm/urdf/arm.urdf"
    for mesh in ("m.stl", "../meshes/m.stl", "package://arm/meshes/m.stl", f"file://{tmp_path}/arm/meshes/m.stl"):
        path.write_text(arm(mesh))
        assert drawn(bc.load_robot(path)) == (True, ""), mesh
        assert not [f for f in check_urdf(path) if "mesh" in f.message]
    escapes = (
        "../../private/m.stl", "link.stl", "../.git/m.stl", f"file://{tmp_path}/private/m.stl",
        "package://private/m.stl", "package://arm/../private/m.stl", "package://../private/m.stl",
        "package://./private/m.stl", f"package:/{tmp_path}/private/m.stl", str(tmp_path / "private/m.stl"),
    )  # fmt: skip
    for mesh in escapes:
        path.write_text(arm(mesh))
        there, note = drawn(bc.load_robot(path))
        assert not there and "not found" in note and "--trust DIR" in note, mesh
        assert any("--trust DIR" in f.message for f in check_urdf(path)), mesh
    for mesh in ("../../private/m.stl", "link.stl", str(tmp_path / "private/m.stl"), "package://private/m.stl"):
        path.write_text(arm(mesh))
        assert drawn(bc.load_robot(path, trust=tmp_path / "private")) == (True, ""), mesh
        assert not [f for f in check_urdf(path, trust=tmp_path / "private") if "mesh" in f.message]
    carrying = bc.load_robot(path, trust=tmp_path / "private").with_payloads([bc.Payload(1.0, "arm")])
    assert drawn(carrying)[0]


def test_packages_of_a_ros_workspace_find_each_other(tmp_path: Path) -> None:
    source = tmp_path / "ws" / "src"
    for name in ("a_description/urdf/deep", "b_meshes/meshes", "b_meshes/.git", "c_none/meshes"):
        (source / name).mkdir(parents=True)
    for name in ("a_description", "b_meshes"):
        (source / name / "package.xml").write_text("<package/>")
    for name in ("b_meshes/meshes/y.stl", "b_meshes/.git/y.stl", "c_none/meshes/y.stl", "a_description/y.stl"):
        (source / name).write_bytes(TRIANGLE)
    (source / "b_meshes" / "out.stl").symlink_to(source / "c_none" / "meshes" / "y.stl")
    path = source / "a_description/urdf/deep/x.urdf"
    for mesh, there in (
        ("package://b_meshes/meshes/y.stl", True),
        ("package://a_description/y.stl", True),
        ("../../y.stl", True),  # of the same package
        ("package://c_none/meshes/y.stl", False),  # no package
        ("package://b_meshes/../c_none/meshes/y.stl", False),
        ("package://b_meshes/.git/y.stl", False),
        ("package://b_meshes/out.stl", False),
        ("package://etc/passwd", False),
    ):
        path.write_text(arm(mesh))
        assert drawn(bc.load_robot(path))[0] is there, mesh


def test_a_scene_does_not_lend_its_urdf_a_wider_area(project: Path) -> None:
    """The URDF lies in the folder above the scene's, whose own folder above is none of the scene's business."""
    (project / "up.urdf").write_text(arm("../private/m.stl"))
    (project.parent / "private" / "m.stl").write_bytes(TRIANGLE)
    path = scene(project, "urdf: ../up.urdf\n")
    assert not drawn(bc.load_scene(path).robot)[0]
    assert not drawn(bc.load_scene(path).config.robot())[0]
    assert drawn(bc.load_scene(path, trust=project.parent / "private").config.robot())[0]
    assert drawn(bc.load_robot(project / "up.urdf"))[0]  # named by the user, it has an area of its own


def test_materials_and_textures_of_meshes_lie_where_meshes_may(tmp_path: Path) -> None:
    """A red material of an .obj is found beside it, and not beyond."""
    for name in ("arm/urdf", "arm/meshes", "private"):
        (tmp_path / name).mkdir(parents=True)
    for name in ("arm/meshes/red.mtl", "private/red.mtl"):
        (tmp_path / name).write_text("newmtl red\nKd 1 0 0\n")
    path = tmp_path / "arm/urdf/arm.urdf"
    path.write_text(arm("../meshes/m.obj"))
    colours = []
    for library in ("red.mtl", "../../private/red.mtl", str(tmp_path / "private/red.mtl")):
        (tmp_path / "arm/meshes/red.mtl").write_text("newmtl red\nKd 1 0 0\n" if library == "red.mtl" else "")
        (tmp_path / "arm/meshes/m.obj").write_text(
            f"mtllib {library}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n"
        )
        (shape,) = next(body for body in robot_bodies(bc.load_robot(path))[0] if body.name == "arm").shapes
        colours.append(shape.colour[:3] == (1.0, 0.0, 0.0))
    assert colours == [True, False, False]


# ---- saved runs


@pytest.fixture(scope="module")
def mesh_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A run of an arm with a mesh, saved elsewhere, and the folder of the arm."""
    folder = tmp_path_factory.mktemp("sender")
    (folder / "meshes").mkdir()
    (folder / "meshes" / "m.stl").write_bytes(TRIANGLE)
    (folder / "arm.urdf").write_text(arm("meshes/m.stl"))
    run = bc.simulate(folder / "arm.urdf", duration=0.1)
    return run.save(tmp_path_factory.mktemp("mail") / "run.npz"), folder


def changed(path: Path, target: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """A copy of a run's file with its JSON text changed."""
    with np.load(path) as stored:
        content = {name: stored[name] for name in stored.files}
    about = json.loads(content["about"].tobytes())
    change(about)
    content["about"] = np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)
    np.savez(target, **content)
    return target


def test_a_mailed_run_opens_no_mesh_beyond_its_folder(mesh_run: tuple[Path, Path], tmp_path: Path) -> None:
    path, folder = mesh_run
    there, note = drawn(bc.load_run(path).scene.robot)
    assert not there and "looked for in the folder of the run" in note and "--trust DIR" in note
    assert drawn(bc.load_run(path, trust=folder).scene.robot) == (True, "")
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "m.stl").write_bytes(TRIANGLE)
    near = changed(path, tmp_path / "run.npz", lambda about: about.update(urdf="/home/sender/robots/arm.urdf"))
    assert drawn(bc.load_run(near).scene.robot) == (True, "")  # the meshes were mailed with it
    (tmp_path / "meshes" / "m.stl").unlink()
    (tmp_path / "meshes" / "m.stl").symlink_to(folder / "meshes" / "m.stl")
    assert not drawn(bc.load_run(near).scene.robot)[0]
    (folder / "package.xml").write_text("<package/>")
    assert not drawn(bc.load_run(path).scene.robot)[0]  # nor by the way of packages
    page = bc.replay(bc.load_run(path), tmp_path / "page.html")
    assert isinstance(page, Path) and page.exists()


@pytest.mark.parametrize("what", [*SCENES, "another scene"])
@pytest.mark.parametrize("place", ["{private}/", "../../private/"])
def test_the_scene_in_a_run_names_no_file_that_the_run_does_not_hold(
    mesh_run: tuple[Path, Path], project: Path, what: str, place: str
) -> None:
    private = project.parent / "private"
    text = SCENES.get(what, "urdf: x.urdf").format(place.format(private=private))

    def change(about: dict[str, Any]) -> None:
        about["files"][about["scene"]] = text
        if what == "another scene":
            about["scene"] = str(private / "x.urdf") if "{" in place else "planar_2r"

    path = changed(mesh_run[0], project / "robots" / "run.npz", change)
    for open_it in (bc.load_run, lambda run: bc.load_scene(scene(project, "urdf: x.urdf\ninitial: {run: run.npz}\n"))):
        with pytest.raises(
            InputError, match=r"run.npz: the scene in it cannot be rebuilt|run.npz: not a run, or damaged"
        ) as caught:
            open_it(path)
        assert "shoulder torque" not in str(caught.value)


def test_a_run_of_example_robots_still_shows_their_meshes(tmp_path: Path) -> None:
    path = bc.simulate("double_pendulum", duration=0.01).save(tmp_path / "run.npz")
    there, note = drawn(bc.load_run(path).scene.robot)
    assert there and "not found" not in note


@pytest.mark.tier2
def test_nothing_is_opened_beyond_the_folder_of_a_mailed_run(mesh_run: tuple[Path, Path], tmp_path: Path) -> None:
    """What Python opens while a hostile run is loaded and drawn, by its audit hook: nothing of the private folder."""
    private = tmp_path / "private"
    private.mkdir()
    (private / "m.stl").write_bytes(TRIANGLE)
    (private / "arm.urdf").write_text(arm("m.stl"))
    (tmp_path / "mail").mkdir()
    path = changed(
        mesh_run[0], tmp_path / "mail" / "run.npz", lambda about: about.update(urdf=str(private / "arm.urdf"))
    )
    script = (
        "import sys\nopened = []\n"
        "sys.addaudithook(lambda event, args: opened.append(str(args[0])) if event in ('open', 'os.open') else None)\n"
        "import bellcrank as bc\nfrom bellcrank.replays.geometry.visuals import robot_bodies\n"
        f"robot_bodies(bc.load_run({str(path)!r}).scene.robot)\n"
        "print('\\n'.join(opened))\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert str(path) in done.stdout and str(private) not in done.stdout
