"""The cache on disk: it touches nothing but its own, executes nothing but the user's own, and never fails a run."""

import hashlib
import json
import os
import shutil
import stat
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.codegen import cache, cache_folder
from bellcrank.codegen import llvm as machine
from bellcrank.dynamics.equations.system import system_of

HEX = "0" * 64
BLOCK = 4096


@pytest.fixture(autouse=True)
def own_secret(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def key(name):
    return "entry-" + hashlib.sha256(str(name).encode()).hexdigest()


def entries(folder):
    return sorted(p.name for p in folder.iterdir() if "-" in p.name)


def swing(duration=0.05):
    """The state at the end of a closed linkage's run, by code made or read anew."""
    from bellcrank.dynamics.constraints import constraint_rows
    from bellcrank.dynamics.equations import system

    system._recent.clear(), system._systems.clear(), constraint_rows._samplers.clear(), constraint_rows._known.clear()
    return bc.simulate("four_bar", duration=duration, samples=3).state


def in_a_process(code, **environment):
    done = subprocess.run(
        [sys.executable, "-W", "always", "-c", code], capture_output=True, text=True, check=False,
        env=os.environ | {k: str(v) for k, v in environment.items()}, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done


# ---- the folder


def test_a_folder_with_a_users_files_keeps_them_and_its_mode(tmp_path, monkeypatch):
    mine = tmp_path / "mine"
    mine.mkdir(mode=0o755)
    mine.chmod(0o755)
    for k in range(3):
        (mine / f"object-{k:064x}").write_bytes(bytes(100_000))
        os.utime(mine / f"object-{k:064x}", (k, k))
    monkeypatch.setenv("BELLCRANK_CACHE", str(mine))
    monkeypatch.setenv("BELLCRANK_CACHE_LIMIT", "100 kB")
    for k in range(40):
        cache.store(key(k), bytes(20_000))
    assert stat.S_IMODE(mine.stat().st_mode) == 0o755
    assert [p.stat().st_size for p in sorted(mine.glob("object-*"))] == [100_000] * 3
    own = mine / cache_folder.NAME
    assert cache.folder() == own and stat.S_IMODE(own.stat().st_mode) == 0o700
    assert sum(p.stat().st_size for p in own.iterdir()) < 150_000
    assert (own / "CACHEDIR.TAG").read_text().startswith("Signature: 8a477f597d28d172789f06886806bc55\n")


def test_pruning_deletes_nothing_that_has_not_the_name_of_an_entry(fresh_cache, monkeypatch):
    monkeypatch.setenv("BELLCRANK_CACHE_LIMIT", "50 kB")
    cache.store(key(0), b"first")
    kept = ("notes.txt", "object-1", "object-" + "g" * 64, "OBJECT-" + HEX, "entry-" + HEX + ".bak")
    for name in kept:
        (fresh_cache / name).write_bytes(bytes(30_000))
        os.utime(fresh_cache / name, (1, 1))
    (fresh_cache / ("folder-" + HEX)).mkdir()
    (fresh_cache / ("link-" + HEX)).symlink_to(fresh_cache / "notes.txt")
    for k in range(20):
        cache.store(key(k), bytes(10_000))
    assert all((fresh_cache / name).exists() for name in (*kept, "folder-" + HEX, "link-" + HEX))


@pytest.mark.parametrize("fault", ["unmarked", "foreign marker", "writable", "symlink", "file", "open parent"])
def test_a_folder_that_is_not_the_caches_own_is_not_used_and_left_as_it_is(tmp_path, monkeypatch, fault):
    base = tmp_path / "base"
    base.mkdir()
    own = base / cache_folder.NAME
    if fault == "file":
        own.write_text("mine")
    elif fault == "symlink":
        (tmp_path / "elsewhere").mkdir(mode=0o700)
        own.symlink_to(tmp_path / "elsewhere")
    else:
        own.mkdir(mode=0o700)
        (own / key(1)).write_bytes(b"mine")
        if fault == "foreign marker":
            (own / "CACHEDIR.TAG").write_text("somebody else's")
        if fault in ("writable", "open parent"):
            cache_folder._mark(own)
        (base if fault == "open parent" else own).chmod(0o777)
    before = {p: (p.lstat().st_mode, p.lstat().st_mtime_ns) for p in base.rglob("*")}
    monkeypatch.setenv("BELLCRANK_CACHE", str(base))
    with pytest.warns(UserWarning, match="not used as a cache: "):
        assert cache.folder() is None
    cache.store(key(1), b"payload")
    assert cache.load(key(1)) is None
    assert {p: (p.lstat().st_mode, p.lstat().st_mtime_ns) for p in base.rglob("*")} == before


def test_a_folder_of_another_user_is_not_used(tmp_path, monkeypatch):
    monkeypatch.setenv("BELLCRANK_CACHE", str(tmp_path))
    cache_folder._own(tmp_path)
    me = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: me + 1)
    with pytest.warns(UserWarning, match="belongs to another user"):
        assert cache.folder() is None


def test_a_folder_that_another_process_is_making_is_taken_over(tmp_path, monkeypatch):
    own = tmp_path / cache_folder.NAME
    own.mkdir(mode=0o700)
    (own / ".CACHEDIR.TAG-0011223344556677").write_bytes(b"Sig")
    monkeypatch.setenv("BELLCRANK_CACHE", str(tmp_path))
    assert cache.folder() == own and (own / "CACHEDIR.TAG").exists()


def test_a_relative_folder_is_one_wherever_the_process_goes_and_a_tilde_is_the_home(tmp_path):
    (tmp_path / "a").mkdir()
    code = (
        "import os, bellcrank\nfrom bellcrank.codegen import cache\n"
        "os.chdir('a')\nprint(cache.folder())\nos.chdir('/')\nprint(cache.folder())\n"
    )
    for name, place in (("here/c", tmp_path / "here/c"), ("~/c", tmp_path / "home/c"), ("~", tmp_path / "home")):
        environment = os.environ | {"BELLCRANK_CACHE": name, "HOME": str(tmp_path / "home")}
        command = [sys.executable, "-c", code]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
        assert done.stdout.split() == [str(place / cache_folder.NAME)] * 2
    assert sorted(p.name for p in tmp_path.iterdir() if p.name != "state") == ["a", "here", "home"]


def test_the_users_folder_of_the_xdg_specification_holds_the_cache(tmp_path, monkeypatch):
    monkeypatch.delenv("BELLCRANK_CACHE")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache.folder() == tmp_path / "xdg" / "bellcrank" / cache_folder.NAME
    for relative in ("relative", "", "../x"):
        monkeypatch.setenv("XDG_CACHE_HOME", relative)
        assert cache.folder() == tmp_path / "home" / ".cache" / "bellcrank" / cache_folder.NAME


def test_a_home_that_does_not_exist_is_said_and_no_folder_of_that_name_made(tmp_path, monkeypatch):
    monkeypatch.setenv("BELLCRANK_CACHE", "~nobody-of-that-name/cache")
    with pytest.warns(UserWarning, match="home folder does not exist"):
        assert cache.folder() is None
    assert not Path("~nobody-of-that-name").exists()


# ---- what is the user's own


def test_the_secret_is_the_users_alone_and_lies_outside_the_cache(fresh_cache, tmp_path):
    cache.store(key(1), b"payload")
    path = tmp_path / "state" / "bellcrank" / "cache-secret"
    assert stat.S_IMODE(path.stat().st_mode) == 0o600 and len(path.read_bytes()) == 32
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700
    assert path.read_bytes() not in (fresh_cache / key(1)).read_bytes()


def test_an_entry_of_another_secret_is_not_used_such_as_that_of_a_folder_from_elsewhere(
    fresh_cache, tmp_path, monkeypatch
):
    cache.store(key(1), b"payload")
    assert cache.load(key(1)) == b"payload"
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "other"))
    assert cache.load(key(1)) is None
    cache.store(key(1), b"new")
    assert cache.load(key(1)) == b"new"


def test_a_whole_cache_from_elsewhere_is_made_anew_with_equal_results(fresh_cache, tmp_path, monkeypatch):
    expected = swing()
    shutil.copytree(fresh_cache.parent, tmp_path / "mailed")
    monkeypatch.setenv("BELLCRANK_CACHE", str(tmp_path / "mailed"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "theirs"))
    loads = []
    original = cache.load
    monkeypatch.setattr(cache, "load", lambda k: loads.append(original(k)) or loads[-1])
    np.testing.assert_array_equal(swing(), expected)
    kept = sum(found is not None for found in loads)
    assert kept < len(loads) / 2  # only what this run itself has stored
    assert not any(found is not None and b"ELF" in found[:300] for found in loads)


@pytest.mark.parametrize("fault", ["writable", "symlink", "fifo", "renamed", "checksum only", "huge", "another user"])
def test_an_entry_that_is_not_certainly_the_users_own_is_not_read(fresh_cache, tmp_path, monkeypatch, fault):
    cache.store(key(1), b"payload")
    path = fresh_cache / key(1)
    if fault == "writable":
        path.chmod(0o622)
    elif fault == "symlink":
        path.rename(tmp_path / "elsewhere")
        path.symlink_to(tmp_path / "elsewhere")
    elif fault == "fifo":
        path.unlink()
        os.mkfifo(path)
    elif fault == "renamed":
        path.rename(fresh_cache / key(2))
        assert cache.load(key(2)) is None
    elif fault == "checksum only":  # as 0.4.0 wrote them
        path.write_bytes(b"bellcrank-cache-2\n" + hashlib.sha256(b"payload").digest() + b"payload")
    elif fault == "huge":
        with path.open("r+b") as file:
            file.truncate(10**11)
    else:
        cache.secret()
        me = os.geteuid()
        monkeypatch.setattr(os, "geteuid", lambda: me + 1)
    assert cache.load(key(1)) is None


def test_a_secret_that_others_can_read_or_that_is_damaged_is_replaced(fresh_cache, tmp_path):
    path = tmp_path / "state" / "bellcrank" / "cache-secret"
    found = {cache.secret()}
    for damage in (lambda: path.chmod(0o644), lambda: path.write_bytes(b"short"), lambda: path.write_bytes(bytes(99))):
        damage()
        cache._kept.cache_clear()
        found.add(cache.secret())
        assert len(path.read_bytes()) == 32 and stat.S_IMODE(path.stat().st_mode) == 0o600
    assert len(found) == 4 and None not in found


def test_without_a_place_for_the_secret_runs_go_on_and_the_named_folder_is_said_not_to_be_used(
    fresh_cache, tmp_path, monkeypatch
):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    with pytest.warns(UserWarning, match="set XDG_STATE_HOME to a folder"):
        swing()
    assert not entries(fresh_cache)


@pytest.mark.tier2
@pytest.mark.parametrize("wrong", ["inputs", "outputs", "both"])
def test_a_recipe_of_wrong_sizes_is_made_anew(fresh_cache, wrong):
    """Sizes that were too small made the code write beyond the arrays that it was given."""
    expected = swing()
    q = np.full(2, 0.3)
    torque = bc.load_robot("planar_2r").inverse_dynamics(q, q, q)
    batch = bc.load_robot("planar_2r").inverse_dynamics(np.tile(q, (9, 1)), q, q)
    for name in entries(fresh_cache):
        if name.startswith("recipe-"):
            stored = json.loads(cache.load(name))
            for which in ("inputs", "outputs"):
                if wrong in (which, "both"):
                    stored[which] = [max(size - 1, 0) for size in stored[which]]
            cache.store(name, json.dumps(stored).encode())
    np.testing.assert_array_equal(swing(), expected)
    np.testing.assert_array_equal(bc.load_robot("planar_2r").inverse_dynamics(q, q, q), torque)
    np.testing.assert_array_equal(bc.load_robot("planar_2r").inverse_dynamics(np.tile(q, (9, 1)), q, q), batch)


@pytest.mark.tier2
@pytest.mark.parametrize(
    "nonsense", [b"", b"{}", b"[]", b"null", b"[[1], 2", b'{"has_work": 1}', b"\xff\xfe", b"[" * 9999]
)
def test_nonsense_that_is_well_sealed_is_made_anew(fresh_cache, nonsense):
    expected = swing()
    for name in entries(fresh_cache):
        cache.store(name, nonsense)
    np.testing.assert_array_equal(swing(), expected)


@pytest.mark.tier2
def test_a_fact_that_is_wrong_in_one_place_is_made_anew(fresh_cache):
    expected = swing()
    for name in entries(fresh_cache):
        if name.startswith("system-"):
            facts = json.loads(cache.load(name))
            cache.store(name, json.dumps(facts | {"has_work": not facts["has_work"]}).encode())
        if name.startswith("robot-"):
            facts = json.loads(cache.load(name))
            cache.store(
                name,
                json.dumps(facts | {"limits": facts["limits"] | {"lower": facts["limits"]["lower"][:-1]}}).encode(),
            )
    np.testing.assert_array_equal(swing(), expected)


# ---- the limit


def test_the_least_recently_used_entries_go_and_what_is_read_stays(fresh_cache, monkeypatch):
    monkeypatch.setenv("BELLCRANK_CACHE_LIMIT", str(10 * BLOCK))
    for k in range(8):
        cache.store(key(k), bytes(100))
        os.utime(fresh_cache / key(k), (1000 + k, 1000 + k))
    assert cache.load(key(0)) is not None  # which marks it as used
    for k in range(8, 14):
        cache.store(key(k), bytes(100))
    left = set(entries(fresh_cache))
    assert {key(0), key(13)} <= left and key(1) not in left
    assert len(left) <= 10


def test_entries_of_all_kinds_count_and_one_that_is_too_large_is_not_kept(fresh_cache, monkeypatch):
    monkeypatch.setenv("BELLCRANK_CACHE_LIMIT", "0.2 MB")
    for k, kind in enumerate(("object", "recipe", "robot", "mesh", "plan", "system", "binding", "massless") * 20):
        cache.store(kind + key(k).removeprefix("entry"), bytes(1000 + 200 * (k % 40)))
        assert (
            sum(-(-p.stat().st_size // BLOCK) * BLOCK for p in fresh_cache.iterdir() if "-" in p.name)
            <= 200_000 + 12_288
        )
    cache.store(key("large"), bytes(250_000))
    assert key("large") not in entries(fresh_cache)


def test_a_store_looks_at_all_entries_only_when_the_limit_may_be_reached(fresh_cache, monkeypatch):
    scans = []
    original = os.scandir
    monkeypatch.setattr(os, "scandir", lambda path: scans.append(path) or original(path))
    monkeypatch.setenv("BELLCRANK_CACHE_LIMIT", str(100 * BLOCK))
    for k in range(300):
        cache.store(key(k), bytes(100))
    assert 1 < len(scans) < 300 / 15


def test_temporaries_of_killed_processes_go_and_those_of_living_ones_stay(fresh_cache, monkeypatch):
    monkeypatch.setenv("BELLCRANK_CACHE_LIMIT", str(20 * BLOCK))
    cache.store(key(0), b"first")
    old, new = (fresh_cache / f"temporary-{k:032x}" for k in (1, 2))
    for path in (old, new):
        path.write_bytes(bytes(10))
    os.utime(old, (time.time() - 7200,) * 2)
    for k in range(40):
        cache.store(key(k), bytes(100))
    assert not old.exists() and new.exists()


@pytest.mark.parametrize(
    ("text", "size"),
    [("", 10**9), ("500 MB", 500 * 10**6), ("2GB", 2 * 10**9), ("1.5 gb", 15 * 10**8), ("40", 40), ("1 MiB", 2**20)],
)  # fmt: skip
def test_the_limit_is_a_size_with_its_unit(monkeypatch, text, size):
    monkeypatch.setenv("BELLCRANK_CACHE_LIMIT", text)
    assert cache_folder.limit() == size


@pytest.mark.parametrize("text", ["-1", "much", "1 apple", "1e9", "nan", "٣", "9" * 400])
def test_a_limit_that_cannot_be_read_is_said_and_is_1_gb(monkeypatch, text):
    monkeypatch.setenv("BELLCRANK_CACHE_LIMIT", text)
    cache_folder._limit.cache_clear()
    with pytest.warns(UserWarning, match="not a size"):
        assert cache_folder.limit() == 10**9


@pytest.mark.tier2
def test_processes_that_store_and_prune_at_once_all_go_on(fresh_cache):
    code = (
        "import sys, hashlib\nfrom bellcrank.codegen import cache\n"
        "for k in range(150):\n"
        "    name = 'entry-' + hashlib.sha256(b'%d' % (k % 40)).hexdigest()\n"
        "    cache.store(name, name.encode() * 100)\n"
        "    found = cache.load(name)\n"
        "    assert found is None or found == name.encode() * 100\n"
    )
    environment = os.environ | {"BELLCRANK_CACHE_LIMIT": "100 kB"}
    running = [subprocess.Popen([sys.executable, "-c", code], env=environment) for _ in range(3)]
    assert [process.wait(60) for process in running] == [0, 0, 0]
    assert not list(fresh_cache.glob("temporary-*"))


# ---- nothing fails a run


@pytest.mark.tier2
@pytest.mark.parametrize("fault", ["directory", "used is a directory", "full disk", "vanished"])
def test_what_cannot_be_stored_is_not_kept_and_the_run_goes_on(fresh_cache, monkeypatch, fault):
    expected = swing()
    for name in entries(fresh_cache):
        if fault == "directory":
            (fresh_cache / name).unlink()
            (fresh_cache / name).mkdir()
    if fault == "used is a directory":
        (fresh_cache / "used").unlink()
        (fresh_cache / "used").mkdir()
    if fault == "vanished":
        shutil.rmtree(fresh_cache.parent)
    if fault == "full disk":
        for name in entries(fresh_cache):
            (fresh_cache / name).unlink()

        def full(*_):
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(os, "replace", full)
    np.testing.assert_array_equal(swing(), expected)
    if fault == "full disk":
        assert not entries(fresh_cache)  # no temporary either


@pytest.mark.tier2
def test_a_disk_that_is_full_leaves_no_half_entry(fresh_cache):
    """A limit on the size of files stands for the full disk: what is beyond it cannot be written."""
    code = (
        "import resource, signal\nsignal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (200, 200))\n"
        "import bellcrank as bc\nprint(bc.simulate('planar_2r_swing', duration=0.01).status)\n"
    )
    assert in_a_process(code).stdout == "finished\n"
    assert all((fresh_cache / name).stat().st_size <= 200 for name in entries(fresh_cache))
    assert not list(fresh_cache.glob("temporary-*"))


@pytest.mark.tier2
def test_machine_code_of_scenes_that_are_gone_is_freed():
    import gc

    freed = []
    scene = bc.load_scene("planar_2r_swing")

    def one(k):
        changed = scene.with_overrides({"outputs": {"x": {"expression": f"{k} * sin(t)"}}})
        run = bc.simulate(changed, duration=0.01, samples=2)
        return [run, *system_of(changed).rhs._codes.values(), *system_of(changed).stage._codes.values()]

    import weakref

    from bellcrank.dynamics.equations import system

    held, *codes = one(0.5)
    assert codes
    for code in codes:
        weakref.finalize(code, freed.append, 1)
    del codes, code
    for k in range(system.RECENT + 2):
        one(k + 1.25)
    gc.collect()
    assert not freed  # its run is still there
    end = held.kinetic_energy.copy()
    np.testing.assert_array_equal(held.kinetic_energy, end)
    del held
    gc.collect()
    assert freed
    assert len(system._recent) <= system.RECENT


@pytest.mark.tier2
def test_a_prepared_call_keeps_its_code():
    import gc

    lanes = machine.target().lanes
    q = np.random.default_rng(0).normal(size=(4 * lanes, 2))
    robot = bc.load_robot("planar_2r")
    expected = robot.inverse_dynamics(q, q, q)
    out = np.empty_like(q)
    call = robot.dynamics("inverse_dynamics").prepared([q, q, q], [out])
    del robot
    gc.collect()
    assert call() == 0
    np.testing.assert_array_equal(out, expected)


@pytest.mark.parametrize("name", ["used", cache_folder.MARKER])
def test_a_pipe_or_a_large_file_in_the_place_of_the_caches_own_files_is_not_waited_for_or_read(fresh_cache, name):
    cache.store(key(1), b"payload")
    (fresh_cache / name).unlink()
    if name == "used":
        os.mkfifo(fresh_cache / name)
        cache.store(key(2), b"another")  # returns
        assert cache.load(key(1)) == b"payload"
    else:
        with (fresh_cache / name).open("wb") as file:
            file.truncate(2**36)  # read whole, it would fill the memory
        with pytest.raises(OSError, match="was not made by bellcrank"):
            cache_folder._check(fresh_cache)
