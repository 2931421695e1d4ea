"""Files of saved runs that were changed, made up or attacked: one sentence, no memory taken on their word."""

import io
import json
import struct
import tracemalloc
import zipfile

import numpy as np
import pytest

import bellcrank as bc
from bellcrank import InputError
from bellcrank.dynamics.equations.system import system_of
from bellcrank.scene.saved_state import saved_state
from bellcrank.scene.scene import scene_of_run

FREE = """
urdf: free.urdf
floating_base: true
base: {position: [0, 0, 1], angular_velocity: [0.1, 0.2, 0.3]}
events: [{name: low, when: {expression: "frame('body').z - 0.97"}}]
outputs: {height: {expression: "frame('body').z", unit: m}}
simulate: {duration: 0.1, samples: 5}
"""
BODY = """<robot name="free"><link name="body"><inertial><mass value="1"/>
<inertia ixx="0.1" iyy="0.2" izz="0.3" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The members of saved runs, one with a free base, one with constraints, one with signals: {name: bytes} each."""
    folder = tmp_path_factory.mktemp("runs")
    (folder / "free.urdf").write_text(BODY)
    (folder / "free.yaml").write_text(FREE)
    scenes = {"free": folder / "free.yaml", "closed": "four_bar", "signals": "planar_2r_tracking"}
    found = {}
    for name, scene in scenes.items():
        path = bc.simulate(scene, duration=0.1, samples=5).save(folder / f"{name}.npz")
        with zipfile.ZipFile(path) as archive:
            found[name] = {member: archive.read(member) for member in archive.namelist()}
    return found


def npy(array):
    out = io.BytesIO()
    np.save(out, array)
    return out.getvalue()


def array_of(members, name):
    return np.load(io.BytesIO(members[f"{name}.npy"]))


def about_of(members):
    return json.loads(array_of(members, "about").tobytes())


def written(path, members, kind=zipfile.ZIP_STORED):
    with zipfile.ZipFile(path, "w", kind) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return path


def with_about(members, change):
    about = about_of(members)
    change(about)
    return members | {"about.npy": npy(np.frombuffer(json.dumps(about).encode(), dtype=np.uint8))}


def with_array(members, name, change):
    array = array_of(members, name).copy()
    changed = change(array)
    return members | {f"{name}.npy": npy(array if changed is None else changed)}


def sentence(path, *used):
    """The one short sentence with which a file is refused, by load_run or by what uses the run."""
    with pytest.raises(InputError) as caught:
        run = bc.load_run(path)
        for use in used:
            use(run)
    text = str(caught.value)
    assert text.startswith(str(path)) and "\n" not in text and len(text) < 400 + len(str(path))
    return text


def put(path, value):
    """Sets an entry of the JSON text, by keys."""
    *way, last = path

    def change(about):
        for key in way:
            about = about[key]
        about[last] = value

    return change


def at(index, value):
    def change(array):
        array[index] = value

    return change


LONG = "x" * 100_000
ENTRIES = {
    "duration is a text": (("settings", "duration"), "0.1", "settings.duration"),
    "duration is negative": (("settings", "duration"), -1.0, "settings.duration"),
    "duration is true": (("settings", "duration"), True, "settings.duration"),
    "duration is beyond doubles": (("settings", "duration"), 10**400, "settings.duration"),
    "rtol is finer than doubles": (("settings", "rtol"), 1e-300, "rtol"),
    "samples beyond memory": (("settings", "samples"), 10**15, "samples"),
    "samples with a fraction": (("settings", "samples"), 5.5, "settings.samples"),
    "an unknown solver": (("settings", "solver"), LONG, "solver"),
    "an unknown setting": (("settings", LONG), 1, "is not known"),
    "stabilisation is a text": (("settings", "stabilisation"), "projection", "settings.stabilisation"),
    "stabilisation of an unknown kind": (("settings", "stabilisation", "kind"), [], "settings.stabilisation.kind"),
    "a gain below zero": (("settings", "stabilisation", "alpha"), -1.0, "settings.stabilisation.alpha"),
    "statistics are a list": (("statistics",), [], "'statistics'"),
    "a negative count": (("statistics", "steps"), -1, "statistics.steps"),
    "a time that is a text": (("statistics", "kernel_time"), "1", "statistics.kernel_time"),
    "unresolved is a number": (("statistics", "unresolved"), 3, "statistics.unresolved"),
    "unresolved without its keys": (("statistics", "unresolved"), [{}], "unresolved"),
    "unresolved of an unknown event": (
        ("statistics", "unresolved"), [{"event": "gone", "steps": 1, "first": 0.0, "undefined": False}],
        "no event 'gone'",
    ),
    "omitted events of an unknown name": (("statistics", "omitted_events"), {"gone": 3}, "no event 'gone'"),
    "omitted events below zero": (("statistics", "omitted_events"), {"low": -3}, "omitted_events.low"),
    "a longest step that is a list": (("statistics", "longest_step"), [1.0], "longest_step"),
    "events are a mapping": (("events",), {}, "'events'"),
    "an event is a text": (("events", 0), "low", "events[0]"),
    "an event of another scene": (("events", 0, "name"), LONG, "no event 'xxx"),
    "an event that stopped and did not": (("events", 0, "stopped"), True, "ends the run in the scene, or in the file"),
    "a status of its own": (("status",), ["finished"], "'status'"),
    "ended by an event that did not stop it": (("status",), "event", "which its events contradict"),
    "turned over without a hinge": (("status",), "turned_over", "no weld or hinge"),
    "ended by a drive that is not there": (("status",), "prescribed_motion_ended", "no prescribed motion"),
    "an error estimate below zero": (("error_estimate",), -1.0, "error_estimate"),
    "files are a list": (("files",), ["a"], "'files'"),
    "a file that is a number": (("files", "free.yaml"), 5, "files.free.yaml"),
    "a file whose name leads away": (("files", "../" + LONG), "x", "names the file"),
    "a file that half a character ends": (("files", "free.yaml"), "\ud800", "UTF-8"),
    "a scene that is not there": (("scene",), "gone.yaml", "gone.yaml"),
    "a scene in another folder": (("scene",), "/etc/passwd", "names the file"),
    "a URDF that is a mapping": (("urdf",), {"a": 1}, "'urdf'"),
    "a URDF whose path no system has": (("urdf",), "a\0b", "'urdf'"),
    "an entry that no run has": (("speed",), 3, "'speed' is not known"),
    "a version of its own": (("version",), [LONG], "format version"),
    "signals that the scene does not have": (("signals",), [{"derivatives": 0, "kinked": False}], "signal_0_breaks"),
}  # fmt: skip


@pytest.mark.parametrize("what", ENTRIES)
def test_an_entry_of_the_wrong_kind_or_range_is_one_sentence(whole, tmp_path, what):
    way, value, words = ENTRIES[what]
    members = with_about(whole["free"], put(way, value))
    assert words in sentence(written(tmp_path / "run.npz", members))


MISSING = ("scene", "urdf", "files", "status", "settings", "statistics", "error_estimate", "events", "signals")


@pytest.mark.parametrize("key", MISSING)
def test_a_missing_entry_is_named(whole, tmp_path, key):
    members = with_about(whole["free"], lambda about: about.pop(key))
    assert key in sentence(written(tmp_path / "run.npz", members))


NUMBERS = {
    "a time that is NaN": ("free", "time", at(1, np.nan), "'time'"),
    "time that goes back": ("free", "time", lambda a: a[::-1], "'time'"),
    "time before the start": ("free", "time", lambda a: a - 1.0, "'time' covers"),
    "time beyond the duration": ("free", "time", lambda a: a * 2.0, "'time' covers"),
    "a state that is infinite": ("free", "state", at((1, 0), np.inf), "'state' is not finite at 0.025 s"),
    "a rotation of length 2": ("free", "state", at((2, slice(3, 7)), 1.0), "rotation"),
    "a rotation of length 0": ("free", "state", at((2, slice(3, 7)), 0.0), "rotation"),
    "an event beyond the run": ("free", "event_time", at(0, 9.0), "'event_time' covers"),
    "an event's position that is NaN": ("free", "event_position", at((0, 1), np.nan), "'event_position'"),
    "an event's rotation of length 0": ("free", "event_position", at((0, slice(3, 7)), 0.0), "rotation"),
    "an event's velocity of another robot": ("free", "event_velocity", lambda a: a[:, :2], "'event_velocity'"),
    "steps that are NaN": ("free", "steps", at(0, np.nan), "'steps'"),
    "steps that end early": ("free", "steps", lambda a: a[:2], "steps do not reach"),
    "steps of three dimensions": ("free", "steps", lambda a: a.reshape(-1, 1, 1), "'steps'"),
    "time that is one number": ("free", "time", lambda a: np.array(0.0), "'time'"),
    "a column too many": ("free", "state", lambda a: np.hstack([a, a]), "'state'"),
    "parameters that are NaN": ("closed", "parameters", lambda a: a * np.nan, "'parameters'"),
    "parameters of another scene": ("closed", "parameters", lambda a: a * 1.01, "not those of the scene"),
    "parameters of more dimensions": ("closed", "parameters", lambda a: a[:, None], "'parameters'"),
    "multipliers of other rows": ("closed", "multipliers", lambda a: a[:2], "'multipliers'"),
    "breaks that go back": ("signals", "signal_0_breaks", lambda a: a[::-1], "do not increase"),
    "breaks that are none": ("signals", "signal_0_breaks", lambda a: a[:0], "no signal's"),
    "breaks that are NaN": ("signals", "signal_0_breaks", at(0, np.nan), "do not increase"),
    "coefficients that are infinite": ("signals", "signal_0_coefficients", at((0, 0, 0), np.inf), "not finite"),
    "coefficients of no degree": ("signals", "signal_0_coefficients", lambda a: a[:, :0], "no signal's"),
    "coefficients of fewer columns": ("signals", "signal_0_coefficients", lambda a: a[:, :, :1], "no signal's"),
    "single precision": ("free", "state", lambda a: a.astype(np.float32), "float32"),
    "the other order of bytes": ("free", "state", lambda a: a.astype(">f8"), ">f8"),
    "complex numbers": ("free", "state", lambda a: a.astype(complex), "complex128"),
}


@pytest.mark.parametrize("what", NUMBERS)
def test_numbers_that_cannot_be_a_runs_are_one_sentence(whole, tmp_path, what):
    run, name, change, words = NUMBERS[what]
    path = written(tmp_path / "run.npz", with_array(whole[run], name, change))
    assert words in sentence(path)
    if name not in ("time", "state"):  # a start from the run reads nothing else
        assert saved_state(path, None, scene_of_run).velocity.any()
        return
    with pytest.raises(InputError, match=r"is no|'time'|'state'|rotation|holds|float"):
        saved_state(path, None, scene_of_run)


def test_what_a_run_that_failed_leaves_in_its_last_row_is_kept_and_nowhere_else(whole, tmp_path):
    failed = with_about(whole["free"], put(("status",), "non_finite"))
    last = with_array(failed, "state", at((-1, 0), np.nan))
    assert np.isnan(bc.load_run(written(tmp_path / "run.npz", last)).state[-1, 0])
    assert "'state' is not finite" in sentence(
        written(tmp_path / "run.npz", with_array(failed, "state", at((-2, 0), np.nan)))
    )


def test_states_that_are_no_motion_of_the_scene_fail_the_certificate(whole, tmp_path):
    path = written(tmp_path / "run.npz", with_array(whole["closed"], "state", at((2, 0), 0.3)))
    run = bc.load_run(path)
    assert run.status == "finished"
    assert any("has a residual of" in text for text in run.warnings) and run.constraint_residual() > 1e-3
    # far away, where no acceleration is a number, a run cannot have "finished"
    path = written(tmp_path / "far.npz", with_array(whole["closed"], "state", at((2, -2), 1e308)))
    assert "no finite acceleration or energy" in sentence(path, lambda run: run.table())


def test_singular_constraints_have_no_rank_and_the_summary_says_so(whole, tmp_path, monkeypatch):
    run = bc.load_run(written(tmp_path / "run.npz", whole["closed"]))
    jacobian, mass = system_of(run.scene).constraint_metric(*(a if a.ndim == 1 else a[-1] for a in run._arguments))
    monkeypatch.setattr(system_of(run.scene), "constraint_metric", lambda *a: (jacobian, -mass))
    with pytest.raises(InputError, match="rank of the constraints cannot be computed"):
        run.constraint_rank()
    assert "unknown: the rank of the constraints cannot be computed" in run.table()


@pytest.mark.parametrize("kind", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_runs_that_were_packed_anew_are_read_to_the_bit(whole, tmp_path, kind):
    for name in whole:
        run = bc.load_run(written(tmp_path / "run.npz", whole[name], kind))
        assert np.array_equal(run.state, array_of(whole[name], "state"))
    fortran = with_array(whole["free"], "state", np.asfortranarray)
    assert b"'fortran_order': True" in fortran["state.npy"]
    assert np.array_equal(bc.load_run(written(tmp_path / "run.npz", fortran)).state, array_of(whole["free"], "state"))


# ---- archives that lie


def header(shape, descr="<f8"):
    text = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}".encode()
    text += b" " * (-(len(text) + 11) % 64) + b"\n"
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(text)) + text


def with_member(name, content):
    return lambda members: members | {f"{name}.npy": content}


LIES = {
    "rows beyond memory": with_member("time", header("(9999999999,)") + b"\0" * 40),
    "a product beyond 64 bits": with_member("time", header("(4611686018427387904, 4)")),
    "a negative shape": with_member("time", header("(-5,)") + b"\0" * 40),
    "a header of parentheses": with_member("time", header("(" * 400 + ")" * 400)),
    "a header of its own length": with_member("time", b"\x93NUMPY\2\0" + struct.pack("<I", 2**32 - 1) + b" " * 99),
    "a header that is no mapping": with_member("time", header("(1,)").replace(b"'shape'", b"[hape'")),
    "objects": with_member("time", header("(5,)", "|O") + b"\0" * 40),
    "texts": with_member("time", header("(5,)", "<U2") + b"\0" * 40),
    "more than it claims": with_member("time", npy(np.zeros(5)) + b"\0"),
    "less than it claims": with_member("time", npy(np.zeros(5))[:-1]),
    "no header": with_member("time", b""),
    "an unknown member": with_member("other", npy(np.zeros(5))),
    "a signal too many": with_member("signal_7_breaks", npy(np.zeros(5))),
    "a member with a path": lambda members: members | {"../../time.npy": npy(np.zeros(5))},
    "text that is no JSON": with_member("about", npy(np.frombuffer(b"{'a': 1}", np.uint8))),
    "text that is no UTF-8": with_member("about", npy(np.frombuffer(b'{"a": "\xff"}', np.uint8))),
    "a list": with_member("about", npy(np.frombuffer(b"[1]", np.uint8))),
    "lists in lists": with_member("about", npy(np.frombuffer(b"[" * 100_000, np.uint8))),
    "NaN": with_member("about", npy(np.frombuffer(b'{"format": NaN}', np.uint8))),
    "a key twice": with_member("about", npy(np.frombuffer(b'{"a": 1, "a": 1}', np.uint8))),
    "a number of many digits": with_member("about", npy(np.frombuffer(b'{"a": 1' + b"0" * 9999 + b"}", np.uint8))),
    "an unfinished text": with_member("about", npy(np.frombuffer(b'"' + b'\\"' * 500_000, np.uint8))),
}


@pytest.mark.parametrize("what", LIES)
def test_a_member_that_is_not_what_it_says_is_one_sentence(whole, tmp_path, what):
    assert "not a run" in sentence(written(tmp_path / "run.npz", LIES[what](whole["free"])))


def claiming(path, name, size):
    """The archive with another unpacked size of a member, in both of its headers."""
    data = bytearray(path.read_bytes())
    for signature, name_at, size_at in ((b"PK\3\4", 30, 22), (b"PK\1\2", 46, 24)):
        place = data.find(signature)
        while data[place + name_at : place + name_at + len(name)] != name:
            place = data.find(signature, place + 1)
        struct.pack_into("<I", data, place + size_at, size)
    path.write_bytes(data)
    return path


def test_members_that_claim_more_than_their_file_can_hold_take_no_memory(whole, tmp_path, monkeypatch):
    monkeypatch.setattr("bellcrank.files.npz_archive.UNPACKED", 2**20)
    bomb = header("(4194304,)") + b"\0" * 2**25  # 32 MB of 32 kB
    paths = [written(tmp_path / "bomb.npz", whole["free"] | {"time.npy": bomb}, zipfile.ZIP_DEFLATED)]
    for kind in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        path = written(tmp_path / f"claim_{kind}.npz", whole["free"], kind)
        paths.append(claiming(path, b"time.npy", 0xFFFFFFF0))
    del bomb
    for path in paths:
        tracemalloc.start()
        assert "members unpack to" in sentence(path)
        assert tracemalloc.get_traced_memory()[1] < 2e6
        tracemalloc.stop()


def test_archives_of_another_make_are_one_sentence(whole, tmp_path):
    path = tmp_path / "run.npz"
    data = written(path, whole["free"]).read_bytes()
    with pytest.warns(UserWarning, match="Duplicate name"), zipfile.ZipFile(path, "a") as archive:
        archive.writestr("time.npy", npy(np.zeros(5)))
    assert "two members" in sentence(path)
    for kind in (zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA):
        assert "unusual way" in sentence(written(path, whole["free"], kind))
    encrypted = bytearray(data)
    encrypted[data.find(b"PK\1\2") + 8] |= 1
    path.write_bytes(encrypted)
    assert "encrypted" in sentence(path)
    path.write_bytes(data + b"more")
    assert "not a zip archive" in sentence(path)
    lying = bytearray(data)
    first = data.find(b"PK\1\2")
    second = data.find(b"PK\1\2", first + 1)
    lying[second + 42 : second + 46] = data[first + 42 : first + 46]  # both at one place
    path.write_bytes(lying)
    assert "overlap" in sentence(path)
    with zipfile.ZipFile(path, "w") as archive:
        for k in range(2000):
            archive.writestr(f"{k:05}" + "x" * 5000, b"")
    assert "list of members" in sentence(path)


@pytest.mark.tier2
def test_random_changes_of_a_runs_bytes_and_entries_give_a_run_or_one_sentence(whole, tmp_path):
    random = np.random.default_rng(5)
    path = tmp_path / "run.npz"
    values = [None, True, -1, 0, 1e308, 10**30, "", "x", [], {}, [[]], {"a": 1}, 0.5, "finished", LONG]
    refused = 0
    for _ in range(150):
        members = whole[("free", "closed", "signals")[random.integers(3)]]

        def change(about):
            place = about
            while True:
                key = list(place)[random.integers(len(place))] if isinstance(place, dict) else None
                inner = place[key]
                if isinstance(inner, dict) and inner and random.random() < 0.8:
                    place = inner
                    continue
                place[key] = values[random.integers(len(values))]
                return

        members = with_about(members, change)
        if random.random() < 0.5:
            name = list(members)[random.integers(len(members))]
            content = bytearray(members[name])
            for _ in range(3):
                content[random.integers(len(content))] = random.integers(256)
            members = members | {name: bytes(content)}
        written(path, members)
        try:
            run = bc.load_run(path)
            run.table()
        except InputError as error:
            refused += 1
            assert "\n" not in str(error) and len(str(error)) < 500
    assert refused > 100
