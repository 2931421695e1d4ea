"""What is computed is kept: runs and sweeps while they go on, files whole or not at all, links, streams and signals."""

import contextlib
import json
import os
import random
import resource
import shutil
import signal
import stat
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.commands import simulate as simulate_command
from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.errors import InputError, NotSavedError
from bellcrank.files import atomic_write, temporaries
from bellcrank.simulation.files import checkpoints
from bellcrank.studies import sweep
from bellcrank.studies.designs.design_space import DesignRange
from bellcrank.studies.execution.execution import Part
from bellcrank.studies.results.study_columns import StudyColumns
from bellcrank.terminal import interruption

LONG = ["--duration", "1e6", "--samples", "1000001", "--set", "simulate.max_step=1e-3", "--no-plots"]
SWING = ["simulate", "planar_2r_swing"]
LASTS = {"duration": 1e4, "max_step": 1e-4}  # minutes of computing, of which a test takes the first second
PASSES = {"events": [{"name": "low", "when": {"joint": "swing", "position": 0.0}}]}


BEGUN = []


@pytest.fixture(autouse=True)
def none_left_running():
    """A test that fails leaves no process behind."""
    yield
    while BEGUN:
        process = BEGUN.pop()
        process.kill()
        process.communicate()


def begun(*arguments, **options):
    """A process of bellcrank that heeds SIGHUP, also where the tests were started by nohup, which has it ignored."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    try:
        process = subprocess.Popen(
            [sys.executable, "-m", "bellcrank", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            **options,
        )  # fmt: skip
    finally:
        signal.signal(signal.SIGHUP, before)
    BEGUN.append(process)
    return process


def wait_for(process, path):
    end = time.monotonic() + 60.0
    while not path.exists():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end, f"{path} did not appear"
        time.sleep(0.02)


def left(folder):
    """Temporary files below a folder."""
    return [path for path in Path(folder).rglob("*") if "bellcrank-" in path.name]


# ---- blocks of a run


def stopped_by_its_caller(scene, folder, blocks=3, **settings):
    """Simulate, and fail from outside once there are so many blocks; the folder of the blocks."""

    class FailureError(Exception):
        pass

    def fail(*_):
        if (folder / f"run.blocks/{blocks:04d}.npz").exists():
            raise FailureError

    with pytest.raises(FailureError), pytest.MonkeyPatch.context() as patch:
        patch.setattr(checkpoints, "SPACING", 0.0)
        bc.simulate(scene, progress=fail, checkpoint=folder / "run.npz", checkpoint_every=0.01, **settings)
    return folder / "run.blocks"


@pytest.mark.tier2
@pytest.mark.parametrize(
    ("name", "changes", "settings"),
    [
        ("pendulum", PASSES, {"samples": 400_001}),
        ("bricard", {}, {"duration": 100.0, "samples": 1_000_001}),
        ("planar_2r_swing", {}, {"solver": "Radau", "rtol": 1e-8, "times": "steps"}),
    ],
)
def test_blocks_are_the_rows_of_the_whole_run_to_the_bit_up_to_their_end(tmp_path, name, changes, settings):
    scene, settings = bc.load_scene(name).with_overrides(changes), {**LASTS, **settings}
    folder = stopped_by_its_caller(scene, tmp_path, **settings)
    part = bc.load_run(folder)
    assert part.status == "interrupted" and 0.0 < part.time[-1] < LASTS["duration"]
    assert any("ended before" in warning for warning in part.warnings)

    def stop(time, _):
        if time > part.time[-1]:
            raise KeyboardInterrupt

    whole = bc.simulate(scene, progress=stop, **settings)
    rows = len(part) - 1  # the last row is where the last block ends
    assert rows > 10 and np.array_equal(part.time[:rows], whole.time[:rows])
    assert np.array_equal(part.state[:rows], whole.state[:rows])
    there = whole.steps[whole.steps <= part.time[-1]]  # of many steps every other one is kept, of more fewer
    assert len(there) > 10 and np.isin(there, part.steps).all() and len(part.steps) >= len(there)
    assert part.time[-1] == part.steps[-1] and part.statistics.steps >= len(part.steps) - 1
    assert 0.0 < part.statistics.longest_step <= whole.statistics.longest_step
    assert part.statistics.kernel_time > 0.0 and part.statistics.evaluations < whole.statistics.evaluations
    mine, theirs = ([(e.name, e.time) for e in run.events] for run in (part, whole))
    assert mine == theirs[: len(mine)] and len(mine) == sum(time <= part.time[-1] for _, time in theirs)
    assert bool(mine) == (name == "pendulum")
    assert part.energy_drift() < 1e-6 and bc.replay(folder, tmp_path / "page.html").exists()


def test_a_run_that_ends_leaves_its_file_and_no_blocks_and_the_numbers_are_the_same(tmp_path):
    settings = {"duration": 20.0, "max_step": 1e-4}
    kept = bc.simulate("pendulum", checkpoint=tmp_path / "deep" / "run.npz", checkpoint_every=0.01, **settings)
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["run.npz"]
    plain, loaded = bc.simulate("pendulum", **settings), bc.load_run(tmp_path / "deep" / "run.npz")
    for run in (kept, loaded):
        assert np.array_equal(run.state, plain.state) and np.array_equal(run.steps, plain.steps)
        assert run.status == "finished"
    bc.simulate("pendulum", duration=0.1, checkpoint=tmp_path / "short")  # shorter than the time between blocks
    assert (tmp_path / "short.npz").is_file() and not left(tmp_path)


@pytest.mark.tier2
def test_blocks_of_an_unfinished_run_are_renamed_by_the_next_and_stay_readable(tmp_path, monkeypatch, capsys):
    first = bc.load_run(stopped_by_its_caller("pendulum", tmp_path, blocks=1, **LASTS))
    with pytest.raises(InputError, match=f"another simulation is writing there .process {os.getpid()}."):
        bc.simulate("pendulum", checkpoint=tmp_path / "run.npz", duration=0.1)  # this process runs
    monkeypatch.setattr(checkpoints, "is_running", lambda mark: False)
    assert main(["simulate", "pendulum", "--no-plots", "--out", str(tmp_path)]) == 0
    assert f"its partial results are now in {tmp_path / 'run.blocks.1'}" in capsys.readouterr().out
    again = bc.load_run(tmp_path / "run.blocks.1")
    assert np.array_equal(again.state, first.state) and np.array_equal(again.time, first.time)
    stopped_by_its_caller("pendulum", tmp_path, blocks=1, **LASTS)
    assert main(["report", str(tmp_path)]) == 2  # run.npz is the earlier run
    assert "give one path" in capsys.readouterr().err
    assert main(["report", str(tmp_path / "run.blocks"), "--out", str(tmp_path / "r.html")]) == 1
    assert "interrupted" in capsys.readouterr().out
    bc.simulate("pendulum", checkpoint=tmp_path / "run.npz", duration=0.1)
    assert {path.name for path in tmp_path.iterdir()} >= {"run.npz", "run.blocks.1", "run.blocks.2"}
    scene = bc.load_scene("pendulum").with_overrides({"initial": {"run": str(tmp_path / "run.blocks.1")}})
    assert consistent_start(scene)[0] == pytest.approx(first.position[-1], abs=1e-15)


def test_blocks_that_are_no_blocks_are_refused_in_one_sentence(tmp_path):
    folder = stopped_by_its_caller("pendulum", tmp_path, **LASTS)
    (folder / "0002.npz").unlink()
    with pytest.raises(InputError, match=r"0002.npz is missing"):
        bc.load_run(folder)
    shutil.copy(tmp_path / "run.blocks/about.npz", folder / "0002.npz")
    with pytest.raises(InputError, match="not a run"):
        bc.load_run(folder)
    with pytest.raises(InputError, match="found another folder"):
        bc.load_run(tmp_path)
    (tmp_path / "mine.blocks").mkdir()
    with pytest.raises(InputError, match="found something else"):
        bc.simulate("pendulum", duration=0.1, checkpoint=tmp_path / "mine.npz")
    for every in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match=r"checkpoint_every.*more than 0"):
            bc.simulate("pendulum", duration=0.1, checkpoint=tmp_path / "x.npz", checkpoint_every=every)


@pytest.mark.parametrize("name", ["about.npz", "0001.npz", "0002.npz"])
def test_a_block_that_is_a_link_is_not_opened_wherever_it_leads(tmp_path, name):
    folder = stopped_by_its_caller("pendulum", tmp_path, blocks=2, **LASTS)
    bc.load_run(folder)
    (folder / name).rename(tmp_path / "elsewhere.npz")
    (folder / name).symlink_to(tmp_path / "elsewhere.npz")
    with pytest.raises(InputError, match=f"{name}: expected a regular file, found a symbolic link"):
        bc.load_run(folder)


def test_what_compressed_blocks_unpack_to_is_limited_together(tmp_path, monkeypatch):
    folder = stopped_by_its_caller("pendulum", tmp_path, blocks=2, **LASTS)
    with np.load(folder / "0001.npz") as whole:
        about = whole["about"]
    count = len(list(folder.glob("0*.npz")))
    claimed = 4 * 10**6  # bytes of zeros a block: alone within what one file may hold, not all together
    np.savez_compressed(folder / "0001.npz", about=about, time=np.zeros(claimed // 8))
    size = (folder / "0001.npz").stat().st_size
    assert 20 * size < claimed / 2
    monkeypatch.setattr("bellcrank.scene.run_contents.UNPACKED", claimed * count // 2)
    with pytest.raises(InputError, match=r"0001.npz.*its members unpack to \d+ bytes"):
        bc.load_run(folder)


# ---- links in the folder that a command writes into


@pytest.mark.parametrize(
    ("command", "link"),
    [
        (["simulate", "pendulum"], "pendulum_run/run.csv"),
        (["simulate", "pendulum"], "pendulum_run/run.png"),
        (["simulate", "planar_2r", "--frame", "tip"], "planar_2r_run/path_tip.png"),
        (["simulate", "pendulum"], "pendulum_run"),
        (["simulate", "pendulum", "--out", "results"], "results/run.npz"),
        (["size", "planar_2r"], "planar_2r_sizing/sizing.json"),
        (["size", "planar_2r"], "planar_2r_sizing/history_circle.csv"),
        (["size", "planar_2r"], "planar_2r_sizing"),
        (["sweep", "pendulum", "--vary", "initial.swing=0.1,0.2"], "pendulum_sweep/sweep.csv"),
        (["replay", "pendulum"], "pendulum.html"),
        (["report", "pendulum"], "pendulum_report.html"),
        (["plot", "pendulum"], "pendulum.png"),
        (["plot", "planar_2r_tracking", "--frame", "tip"], "planar_2r_tracking_tip.png"),
    ],
)
def test_links_that_came_with_a_folder_lead_no_output_elsewhere(tmp_path, monkeypatch, capsys, command, link):
    mine, unpacked = tmp_path / "mine", tmp_path / "unpacked"
    mine.mkdir()
    (mine / "keys").write_text("mine", encoding="utf-8")
    path = unpacked / link
    path.parent.mkdir(parents=True)
    path.symlink_to(mine / "keys" if path.suffix else mine)
    monkeypatch.chdir(unpacked)
    assert main(command) == 2
    assert "is a link to" in (told := capsys.readouterr().err) and len(told.splitlines()) == 1
    assert (mine / "keys").read_text(encoding="utf-8") == "mine" and len(list(mine.iterdir())) == 1


def test_links_within_the_folder_and_a_folder_that_the_user_names_are_written_through(tmp_path, monkeypatch):
    (tmp_path / "here").mkdir(), (tmp_path / "disk").mkdir()
    (tmp_path / "here" / "run.csv").symlink_to("table.csv")
    (tmp_path / "named").symlink_to(tmp_path / "disk")
    monkeypatch.chdir(tmp_path / "here")
    short = ["simulate", "pendulum", "--duration", "0.1", "--no-plots", "--out"]
    assert main([*short, "."]) == 0 and Path("table.csv").stat().st_size > 0
    assert main([*short, str(tmp_path / "named")]) == 0 and (tmp_path / "disk" / "run.npz").is_file()


def test_a_disk_that_is_full_at_the_end_leaves_all_rows_in_blocks(tmp_path, monkeypatch):
    def full(*_, **__):
        raise InputError("cannot write run.npz: No space left on device")

    monkeypatch.setattr(checkpoints, "save_run", full)
    scene = bc.load_scene("pendulum").with_overrides(PASSES)
    with pytest.raises(NotSavedError, match=r"all of it is kept in .*run\.blocks") as found:
        bc.simulate(
            scene, duration=30.0, max_step=1e-4, samples=5001, checkpoint=tmp_path / "run.npz", checkpoint_every=0.01
        )
    run, kept = found.value.run, bc.load_run(tmp_path / "run.blocks")
    assert run.status == kept.status == "finished" and run.statistics == kept.statistics
    assert np.array_equal(run.time, kept.time) and np.array_equal(run.state, kept.state)
    assert np.array_equal(run.steps, kept.steps) and [e.time for e in run.events] == [e.time for e in kept.events]
    with pytest.raises(NotSavedError, match="nothing of the run is kept"):
        bc.simulate(scene, duration=0.1, checkpoint=tmp_path / "other.npz")
    assert not left(tmp_path)


def test_a_disk_that_is_full_for_a_while_is_told_and_costs_no_rows(tmp_path, monkeypatch):
    whole, calls = checkpoints.write_archive, []

    def sometimes(target, *rest):
        calls.append(target.name)
        if 2 < len(calls) < 4:
            raise InputError("cannot write: No space left on device")
        whole(target, *rest)

    monkeypatch.setattr(checkpoints, "write_archive", sometimes)
    with pytest.warns(UserWarning, match="No space left on device; the run goes on"):
        part = bc.load_run(stopped_by_its_caller("pendulum", tmp_path, blocks=2, times="steps", **LASTS))
    run = bc.simulate("pendulum", duration=part.time[-1] + 1.0, max_step=1e-4, times="steps")
    assert len(calls) >= 4 and np.array_equal(part.state, run.state[: len(part)])


def test_a_sweep_whose_last_table_cannot_be_written_names_the_one_that_is(tmp_path, monkeypatch, capsys):
    def full(*_):
        raise InputError("cannot write sweep.json: No space left on device")

    monkeypatch.setattr(bc.results.Sweep, "to_json", full)
    command = ["sweep", "planar_2r_swing", "--vary", "initial.elbow=0.1,0.2", "--no-plots", "--out", str(tmp_path)]
    assert main(command) == 2
    assert capsys.readouterr().err.endswith("left on device; all designs are in sweep.csv\n")
    assert len((tmp_path / "sweep.csv").read_text().splitlines()) == 3


def test_whoever_stops_a_run_waits_for_no_picture_and_no_long_table(tmp_path, monkeypatch, capsys):
    @contextlib.contextmanager
    def stopping(_):
        asked = []

        def stop(*_):
            if not asked:
                asked.append(1)
                raise KeyboardInterrupt

        yield stop

    monkeypatch.setattr(simulate_command, "simulation_progress", stopping)
    for most, names in ((0, {"run.npz"}), (10**6, {"run.npz", "run.csv"})):
        monkeypatch.setattr(simulate_command, "INTERRUPTED_ROWS", most)
        folder = tmp_path / str(most)
        command = [*SWING, "--duration", "1e4", "--set", "simulate.max_step=1e-4", "--out", str(folder)]
        assert main(command) == 130
        assert {path.name for path in folder.iterdir()} == names
    assert "run.csv was not written" in capsys.readouterr().out


def limited(size):
    """A limit on the size of files, which refuses to write as a full disk does."""
    return {"preexec_fn": lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))}


@pytest.mark.tier2
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_what_the_disk_takes_is_written_what_matters_most_first_and_the_rest_is_told(tmp_path):
    (tmp_path / "run.csv").write_text("earlier")
    process = begun(*SWING, "--out", str(tmp_path), **limited(100_000))
    out, err = process.communicate(timeout=100)
    assert process.returncode == 2 and "Traceback" not in err
    assert "run.csv: File too large" in err and len(err.splitlines()) == 1
    assert "wrote run.npz" in out and bc.load_run(tmp_path / "run.npz").success
    assert (tmp_path / "run.csv").read_text() == "earlier" and not left(tmp_path)


# ---- sweeps


def test_a_sweep_hands_over_what_is_done_ever_so_often(monkeypatch):
    seen = []
    vary = {"crank_length": np.linspace(1.2, 1.3, 400)}
    whole = bc.sweep("four_bar", vary, threads=1, on_checkpoint=seen.append, checkpoint_every=1e-3)
    counts = [len(part) for part in seen]
    assert counts == sorted(set(counts)) and 0 < counts[0] < 400 and not seen[0].complete
    for part in seen:
        assert np.array_equal(part.index, np.arange(len(part)))
        for name in whole.units:
            assert np.array_equal(part.column(name), whole.column(name)[: len(part)], equal_nan=True)

    class ThreeParts:
        def run(self, work):
            for k in range(3):
                yield Part(
                    DesignRange(k, k + 1), StudyColumns(statuses=("event",), status=np.zeros(1, np.int8), measures={})
                )

    clock = iter([0.0, 5.0, 6.0, 55.5, 56.5, 56.6])  # keeping takes 1 s: it waits for 50
    monkeypatch.setattr(sweep.time, "monotonic", lambda: next(clock))
    told = []
    watched = sweep.WatchedExecutor(ThreeParts(), whole, told.append, 4.0)
    assert len(list(watched.run(None))) == 3 and [len(part) for part in told] == [1, 3]


SLOW = ["--set", "simulate.max_step=1e-3", "--no-plots"]


@pytest.mark.tier2
def test_a_sweep_that_is_killed_keeps_its_designs_and_the_same_command_goes_on(tmp_path, capsys):
    command = ["sweep", "planar_2r_swing", "--vary", "initial.elbow=0.1:1.0:3000", *SLOW, "--out", str(tmp_path)]
    process = begun(*command, "--threads", "1", "--checkpoint-every", "0.05")
    wait_for(process, tmp_path / "checkpoints" / "000001.npz")
    process.kill()
    process.communicate()
    other = [*command[:3], "initial.elbow=0.1:1.0:3001", *command[4:]]
    assert main(other) == 2
    said = capsys.readouterr().err
    assert "unfinished study that differs in initial.elbow" in said and "--restart" in said
    assert main(command) == 0
    said = capsys.readouterr().out
    assert "of 3000 designs were done before" in said and "3000 designs, 3000 finished" in said
    assert {path.name for path in tmp_path.iterdir()} == {"sweep.csv", "sweep.json"}
    fresh = tmp_path / "fresh"
    assert main([*command[:-1], str(fresh)]) == 0
    assert (fresh / "sweep.csv").read_bytes() == (tmp_path / "sweep.csv").read_bytes()


# ---- signals


@pytest.mark.tier2
@pytest.mark.parametrize(
    ("number", "command", "result", "status"),
    [
        (signal.SIGTERM, [*SWING, *LONG, "--checkpoint-every", "0.1"], "run.npz", 143),
        (
            signal.SIGHUP,
            ["sweep", "four_bar", "--vary", "crank_length=1.21:1.24:100001", *SLOW, "--checkpoint-every", "0.05"],
            "sweep.partial.json",
            129,
        ),
    ],
)
def test_a_signal_keeps_what_was_computed_and_says_so(tmp_path, number, command, result, status):
    process = begun(*command, "--out", str(tmp_path))
    wait_for(process, tmp_path / ("run.blocks" if result == "run.npz" else "checkpoints"))
    process.send_signal(number)
    process.send_signal(number)  # as timeout(1) does
    out, err = process.communicate(timeout=100)
    assert process.returncode == status and "Traceback" not in err, err
    assert "interrupted" in out and not left(tmp_path)
    if result == "run.npz":
        run = bc.load_run(tmp_path / result)
        assert run.status == "interrupted" and 0.0 < run.time[-1] < 1e6
        assert {path.name for path in tmp_path.iterdir()} == {"run.npz", "run.csv"}
    else:
        table = json.loads((tmp_path / result).read_text())
        assert not table["complete"] and table["designs"]
        assert f"{len(table['designs'])} of 100001 designs were run" in out.splitlines()[-1]
        assert not any((tmp_path / name).exists() for name in ("sweep.csv", "sweep.json"))


@pytest.fixture
def handlers():
    """The signals' handlers as they are, put back at the end."""
    numbers = (*interruption.SIGNALS, signal.SIGALRM)
    before = [signal.getsignal(number) for number in numbers]
    yield
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)
    vars(interruption._request).update(vars(interruption._Request()))


def test_signals_wait_while_something_is_kept_and_a_second_one_later_does_not(handlers, monkeypatch):
    now = [0.0]
    monkeypatch.setattr(interruption.time, "monotonic", lambda: now[0])
    done = []
    with interruption.handled():
        with interruption.held() as check:
            check()
            signal.raise_signal(signal.SIGTERM)
            signal.raise_signal(signal.SIGTERM)
            done.append("goes on")
            with pytest.raises(interruption.Interrupted):
                check()
            now[0] = 2.0
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(signal.SIGINT)
        now[0], interruption._request.number = 4.0, None
        with pytest.raises(interruption.Interrupted):  # noqa: SIM117
            with interruption.unbroken():
                signal.raise_signal(signal.SIGTERM)
                done.append("is written")
        assert done == ["goes on", "is written"]
        assert interruption.exit_status() == 143 and interruption.signal_name() == " (SIGTERM)"
    signal.raise_signal(signal.SIGTERM)  # on the way out


def test_a_signal_that_lands_where_python_drops_errors_comes_again(handlers):
    class Dropped:
        def __del__(self):
            signal.raise_signal(signal.SIGTERM)

    with interruption.handled():
        thing = Dropped()
        with pytest.raises(KeyboardInterrupt):
            del thing
            for _ in range(1000):
                time.sleep(0.01)


def test_ignored_signals_stay_ignored_and_import_handles_none(handlers):
    code = "import signal, bellcrank, bellcrank.cli, bellcrank.terminal.interruption; print(int(signal.getsignal(15)))"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert int(out) == signal.SIG_DFL
    signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
    with interruption.handled():
        signal.raise_signal(signal.SIGHUP)
    assert interruption.exit_status() is None


def test_runs_that_nobody_asks_for_their_status_are_not_taken_for_whole_ones(handlers):
    scene, again = bc.load_scene("pendulum"), []

    def stop(*_):
        again.append(0)
        raise KeyboardInterrupt

    assert bc.simulate(scene, duration=1e3, max_step=1e-4, progress=stop).status == "interrupted"
    with interruption.whole_runs(), pytest.raises(KeyboardInterrupt):
        bc.simulate(scene, duration=1e3, max_step=1e-4, progress=stop)
    assert len(again) == 2


# ---- streams


@pytest.mark.tier2
@pytest.mark.parametrize(
    ("tail", "status", "unbuffered"),
    [(">&- 2>&- <&-", 0, ""), ("2>&1 | true; exit ${PIPESTATUS[0]}", 0, "1"), ("> /dev/full", 2, "")],
)
def test_files_are_written_whatever_becomes_of_what_is_printed(tmp_path, tail, status, unbuffered):
    command = f"{sys.executable} -m bellcrank simulate planar_2r_swing --no-plots --out {tmp_path} {tail}"
    environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == status, done.stderr
    assert done.stderr == ("bellcrank: standard output: No space left on device\n" if status else "")
    assert bc.load_run(tmp_path / "run.npz").success and (tmp_path / "run.csv").exists()


# ---- targets and temporaries


def test_a_link_is_written_through_and_permissions_stay(tmp_path):
    (tmp_path / "far").mkdir()
    real, link = tmp_path / "far" / "real.txt", tmp_path / "link.txt"
    link.symlink_to("far/real.txt")
    atomic_write.write_text(link, "one")  # what it names is not there yet
    assert link.is_symlink() and real.read_text() == "one"
    real.chmod(0o640)
    atomic_write.write_text(link, "two")
    assert link.is_symlink() and real.read_text() == "two" and stat.S_IMODE(real.stat().st_mode) == 0o640
    (tmp_path / "new").write_text("")
    atomic_write.write_text(tmp_path / "plain.txt", "")
    assert (tmp_path / "plain.txt").stat().st_mode == (tmp_path / "new").stat().st_mode
    run = bc.simulate("pendulum", duration=0.1)
    (tmp_path / "run.npz").symlink_to("far/kept.npz")
    run.save(tmp_path / "run.npz")
    assert (tmp_path / "run.npz").is_symlink() and bc.load_run(tmp_path / "far/kept.npz").success
    assert not left(tmp_path)


@pytest.mark.parametrize("kind", ["folder", "pipe", "device", "loop"])
def test_targets_that_cannot_be_files_are_refused_before_anything_is_computed(tmp_path, monkeypatch, capsys, kind):
    monkeypatch.chdir(tmp_path)
    for name in ("run.npz", "sizing.csv", "sweep.json", "page.html"):
        path = tmp_path / "out" / name
        path.parent.mkdir(exist_ok=True)
        if kind == "folder":
            path.mkdir()
        elif kind == "pipe":
            os.mkfifo(path)
        else:
            path.symlink_to("/dev/null" if kind == "device" else path)
    said = "the symbolic link is circular" if kind == "loop" else f"is a {kind}; expected"
    link = "is a link to /dev/null, which would be overwritten"  # in a folder: refused without a look at its end

    def compute(*_, **__):
        raise AssertionError("computed first")

    for where in (
        "simulation.simulate.simulate",
        "studies.sweep.run_sweep",
        "sizing.size.size",
        "scene.scene.load_scene",
    ):
        monkeypatch.setattr(f"bellcrank.{where}", compute)
    commands = [
        [*SWING, "--out", "out"],
        ["size", "planar_2r", "--out", "out"],
        ["sweep", "four_bar", "--vary", "crank_length=1.2", "--out", "out"],
        *([command, "planar_2r_swing", "--out", "out/page.html"] for command in ("replay", "report", "plot")),
    ]
    for command in commands:
        assert main(command) == 2
        err = capsys.readouterr().err
        assert said in err or (kind == "device" and link in err)
        assert err.startswith("bellcrank: ") and len(err.splitlines()) == 1, err
    with pytest.raises(InputError, match=said):
        atomic_write.write_text(tmp_path / "out" / "run.npz", "")


def test_size_checks_its_folder_before_it_computes(tmp_path, monkeypatch, capsys):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr("bellcrank.sizing.size.size", lambda *_, **__: pytest.fail("computed first"))
    assert main(["size", "planar_2r", "--out", str(tmp_path / "file" / "deep")]) == 2
    assert "is a file; expected a folder" in capsys.readouterr().err


def dead_mark():
    """The mark of a process of this machine that is gone."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    mark = temporaries.own_mark().split("-")
    process.wait()
    return f"{mark[0]}-{process.pid}-{mark[2]}"


def test_what_killed_processes_left_goes_with_the_next_write_and_nothing_else_does(tmp_path, monkeypatch):
    monkeypatch.setattr(temporaries, "_cleaned", set())
    monkeypatch.setattr(temporaries.tempfile, "gettempdir", lambda: str(tmp_path))
    dead, mine, other = dead_mark(), temporaries.own_mark(), "00000000-1-1"
    names = {
        f".bellcrank-file-{dead}-01234567.npz": False, f".bellcrank-file-{mine}-01234567.npz": True,
        f".bellcrank-file-{other}-01234567.npz": True, f".bellcrank-file-{other}-89abcdef": False,
        f"bellcrank-file-{dead}-1234567.npz": True, f".my-bellcrank-file-{dead}-01234567": True, "run.npz": True,
        f".bellcrank-file-{dead}-01234567.npz.bak.old": True, "bellcrank-run-abcdefgh": True,
    }  # fmt: skip
    for name in names:
        (tmp_path / name).write_text("")
    old = time.time() - 2 * temporaries.OLD
    os.utime(tmp_path / f".bellcrank-file-{other}-89abcdef", (old, old))
    folders = {
        f"bellcrank-run-{dead}-01234567": False, f"bellcrank-run-{mine}-01234567": True,
        f"bellcrank-show-{dead}-01234567": True,
    }  # fmt: skip
    for name in folders:
        (tmp_path / name).mkdir()
        (tmp_path / name / "robot.urdf").write_text("")
    link = tmp_path / f".bellcrank-file-{dead}-aaaaaaaa"
    link.symlink_to("run.npz")
    with temporaries.temporary_folder("test") as own:
        assert own.parent == tmp_path and stat.S_IMODE(own.stat().st_mode) == 0o700
    assert {name: (tmp_path / name).exists() for name in {**names, **folders}} == {**names, **folders}
    assert link.is_symlink() and not own.exists()


def check_files(folder):
    """Every file that stands under its final name opens, and is whole."""
    for path in Path(folder).rglob("*"):
        if path.name.startswith(".bellcrank-") or any(part.startswith(".bellcrank-") for part in path.parts):
            continue
        if path.suffix == ".npz":
            with zipfile.ZipFile(path) as archive:
                assert archive.testzip() is None
        elif path.suffix == ".json":
            json.loads(path.read_text())
        elif path.suffix == ".csv":
            widths = {line.count(",") for line in path.read_text().splitlines() if '"' not in line}
            assert len(widths) == 1 and path.read_text().endswith("\n"), path
        elif path.suffix == ".html":
            assert path.read_text().rstrip().endswith("</html>")
        elif path.is_dir() and ".blocks" in path.name:
            assert bc.load_run(path).status == "interrupted"


@pytest.mark.tier2
def test_no_kill_at_any_moment_leaves_half_a_file_and_the_next_run_cleans_up(tmp_path):
    dice = random.Random(11)
    commands = [
        ([*SWING, *LONG, "--checkpoint-every", "0.05", "--out", "run"], 1.8),
        (["sweep", "planar_2r_swing", "--vary", "initial.elbow=0.1:1:999", *SLOW, "--checkpoint-every", "0.05",
          "--out", "sweep"], 1.6),
        (["replay", "planar_2r_swing", "--out", "page.html"], 1.2),
    ]  # fmt: skip
    for k in range(9):
        command, most = commands[k % 3]
        process = begun(*command, cwd=tmp_path)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(dice.uniform(0.5, most))
        process.kill()
        process.communicate()
        check_files(tmp_path)
    for command in ([*SWING, "--no-plots", "--out", "run"], ["replay", "planar_2r_swing", "--out", "page.html"]):
        process = begun(*command, cwd=tmp_path)
        _, err = process.communicate(timeout=100)
        assert process.returncode == 0, err
    check_files(tmp_path)
    assert bc.load_run(tmp_path / "run" / "run.npz").success and not (tmp_path / "run" / "run.blocks").exists()
    assert not left(tmp_path / "run") and not [path for path in left(tmp_path) if path.parent == tmp_path]
