"""Studies in ranges: kept in a folder while they run, found again after any end, never mixed with another study."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import zipfile

import numpy as np
import pytest
import small_study
from small_study import SmallRunner, SmallSpace, expected_columns, same_columns

from bellcrank.errors import BellcrankError, InputError
from bellcrank.studies.designs.design_space import LARGEST, DesignRange, RangeSize, UndoneDesigns, true_ranges
from bellcrank.studies.execution import study_folder
from bellcrank.studies.execution.execution import LocalExecutor, Part
from bellcrank.studies.execution.executors import choose_executor
from bellcrank.studies.execution.software_and_processor import differences, environment
from bellcrank.studies.execution.study import run_study
from bellcrank.studies.execution.study_folder import NAME, FolderLock, StudyFolder, StudyRows
from bellcrank.studies.results.study_columns import StudyColumns
from tests.campaigns.kills_of_a_study import check

COUNT = 3000


class InRanges(LocalExecutor):
    """Runs ranges of `size` designs, and ends after `parts` of them as Ctrl-C or an error would."""

    def __init__(self, size=100, parts=None, ending=KeyboardInterrupt):
        super().__init__(1)
        self.size, self.parts, self.ending = size, parts, ending

    def run(self, work):
        count = 0
        while (designs := work.undone.take(self.size)) is not None:
            if count == self.parts:
                raise self.ending
            yield Part(designs, work.runner.run(work.space.values(*designs)))
            count += 1


def unfinished(folder, parts=12, checkpoint_every=1e6, **identity):
    """Run the first `parts` ranges of 100 designs, and be interrupted."""
    space, runner = SmallSpace(COUNT), SmallRunner()
    space.identity |= identity
    with StudyFolder(folder, notify=list) as place:
        run = run_study(space, runner, InRanges(parts=parts), folder=place, checkpoint_every=checkpoint_every)
    assert not run.complete and len(run.columns) == 100 * parts
    return run


def resumed(folder, notes=None, **options):
    with StudyFolder(folder, notify=[].append if notes is None else notes.append, **options) as place:
        return run_study(SmallSpace(COUNT), SmallRunner(), LocalExecutor(1), folder=place)


# ---- ranges


def test_ranges_cover_what_is_undone_exactly_once():
    done = np.random.default_rng(3).random(5000) < 0.3
    undone, size, seen = UndoneDesigns(done), RangeSize(7), np.zeros(5000, dtype=int)
    while (designs := undone.take(size.count)) is not None:
        assert 0 < designs.size <= size.count
        seen[designs.first : designs.stop] += 1
        size.learn(designs.size, 1e-3)
    assert undone.count == 0
    np.testing.assert_array_equal(seen, (~done).astype(int))
    assert true_ranges(np.array([True, True, False, True])) == [DesignRange(0, 2), DesignRange(3, 4)]


def test_ranges_take_about_a_second():
    size = RangeSize(32)
    size.learn(32, 5.0)  # compiling
    assert size.count == 32
    size.learn(32, 32 * 1e-5)
    assert size.count == 16 * 32  # it grows by steps
    for _ in range(5):
        size.learn(size.count, size.count * 1e-4)
    assert size.count == 10_000
    for _ in range(5):
        size.learn(size.count, size.count * 1e-9)
    assert size.count == LARGEST
    size.learn(LARGEST, 1e4)
    assert size.count == 32


# ---- rows


def test_rows_of_a_whole_study_are_not_copied():
    rows = StudyRows(COUNT, list(small_study.UNITS))
    rows.add(DesignRange(0, COUNT), expected_columns(COUNT))
    columns = rows.columns()
    assert same_columns(columns, expected_columns(COUNT))
    assert all(np.shares_memory(values, rows.measures) for values in columns.measures.values())


def test_rows_of_half_a_study_are_those_that_are_done():
    expected = expected_columns(COUNT)
    rows = StudyRows(COUNT, list(small_study.UNITS))
    chosen = np.r_[100:250, 900:1000]
    rows.add(DesignRange(900, 1000), expected.rows(900, 1000))
    rows.add(DesignRange(100, 250), expected.rows(100, 250))
    assert same_columns(rows.columns(), small_study.chosen_rows(expected, chosen))


def test_rows_of_another_study_are_refused():
    rows = StudyRows(COUNT, list(small_study.UNITS))
    with pytest.raises(BellcrankError, match="100 designs gave 99 rows of 3 measures"):
        rows.add(DesignRange(0, 100), expected_columns(COUNT).rows(0, 99))
    rows.add(DesignRange(0, 100), expected_columns(COUNT).rows(0, 100))
    other = expected_columns(COUNT).rows(100, 200)
    with pytest.raises(BellcrankError, match="statuses"):
        rows.add(DesignRange(100, 200), StudyColumns(statuses=("a",), status=other.status, measures=other.measures))


def test_a_study_too_large_for_the_memory_is_refused():
    with pytest.raises(InputError, match="designs need about "):
        run_study(SmallSpace(10**12), SmallRunner())


# ---- what is kept


def test_a_short_study_writes_nothing(tmp_path):
    assert same_columns(resumed(tmp_path / "out").columns, expected_columns(COUNT))
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize("checkpoint_every", [0.0, 1e6])
def test_a_study_goes_on_where_it_was_interrupted(tmp_path, checkpoint_every):
    first = unfinished(tmp_path, checkpoint_every=checkpoint_every)
    np.testing.assert_array_equal(first.designs, np.arange(1200))
    notes = []
    run = resumed(tmp_path, notes)
    assert run.complete and run.found == 1200
    assert notes == [f"1200 of 3000 designs were done before, in {tmp_path / 'checkpoints'}"]
    assert same_columns(run.columns, expected_columns(COUNT))
    with StudyFolder(tmp_path) as place:
        place.remove_checkpoints()
    assert list(tmp_path.iterdir()) == []


def test_designs_of_an_interrupted_range_are_kept(tmp_path):
    with StudyFolder(tmp_path, notify=list) as place:
        run = run_study(SmallSpace(COUNT), SmallRunner(interrupt_at=500), LocalExecutor(100), folder=place)
    chosen = np.delete(np.arange(500), 250)
    assert not run.complete
    np.testing.assert_array_equal(run.designs, chosen)
    assert same_columns(run.columns, small_study.chosen_rows(expected_columns(COUNT), chosen))
    assert resumed(tmp_path).found == 499


def test_an_error_keeps_what_is_done(tmp_path):
    with StudyFolder(tmp_path) as place, pytest.raises(ZeroDivisionError):
        run_study(SmallSpace(COUNT), SmallRunner(), InRanges(parts=7, ending=ZeroDivisionError), folder=place)
    assert resumed(tmp_path).found == 700


def test_a_full_disk_does_not_end_a_study(tmp_path, monkeypatch):
    def full(*_, **__):
        raise InputError("cannot write it: No space left on device")

    notes = []
    with monkeypatch.context() as patched, StudyFolder(tmp_path, notify=notes.append) as place:
        patched.setattr(study_folder, "write_archive", full)
        run = run_study(SmallSpace(COUNT), SmallRunner(), InRanges(), folder=place, checkpoint_every=0.0)
    assert run.complete and same_columns(run.columns, expected_columns(COUNT))
    assert len(notes) == 1 and "No space left" in notes[0] and "the study goes on" in notes[0]


def test_progress_counts_all_designs(tmp_path):
    unfinished(tmp_path, parts=20)
    seen = []
    with StudyFolder(tmp_path, notify=list) as place:
        run_study(
            SmallSpace(COUNT), SmallRunner(), LocalExecutor(1), folder=place,
            progress=lambda done, of: seen.append((done, of)),
        )  # fmt: skip
    assert seen[0] == (2000, COUNT) and seen[-1] == (COUNT, COUNT) and seen == sorted(seen)
    assert len({done for done, _ in seen}) > 4  # ranges, and progress within them


# ---- what is refused


@pytest.mark.parametrize(
    ("space", "runner", "said"),
    [
        ({"a": "0 … 20"}, {}, r"differs in a \(there: 0 … 10; now: 0 … 20\)"),
        ({}, {"scene": "another"}, r"differs in scene \(there: closed forms; now: another\)"),
        ({"seed": "7"}, {}, r"differs in seed \(there: nothing; now: 7\)"),
    ],
)
def test_another_study_is_not_mixed_in(tmp_path, space, runner, said):
    unfinished(tmp_path)
    other, how = SmallSpace(COUNT), SmallRunner()
    other.identity |= space
    how.identity |= runner
    before = sorted((tmp_path / "checkpoints").iterdir())
    with StudyFolder(tmp_path) as place, pytest.raises(InputError, match=f"{said}; choose another .*--restart"):
        run_study(other, how, LocalExecutor(1), folder=place)
    assert sorted((tmp_path / "checkpoints").iterdir()) == before  # and nothing is lost


def test_another_version_is_not_mixed_in(tmp_path, monkeypatch):
    unfinished(tmp_path)
    monkeypatch.setattr("bellcrank.studies.execution.software_and_processor.version", lambda: "9.0.0")
    with pytest.raises(InputError, match=r"differs in bellcrank \(there: 0[^;]*; now: 9.0.0"):
        resumed(tmp_path)


def test_another_number_of_designs_is_not_mixed_in(tmp_path):
    unfinished(tmp_path)
    with (
        StudyFolder(tmp_path) as place,
        pytest.raises(InputError, match=r"differs in designs \(there: 3000; now: 40\)"),
    ):
        run_study(SmallSpace(40), SmallRunner(), folder=place)


def test_restart_sets_the_earlier_study_aside(tmp_path):
    for number in (1, 2):
        unfinished(tmp_path, parts=number)
        notes = []
        with StudyFolder(tmp_path, restart=True, notify=notes.append) as place:
            run = run_study(SmallSpace(COUNT), SmallRunner(), InRanges(), folder=place)
        assert run.found == 0 and same_columns(run.columns, expected_columns(COUNT))
        assert notes == [f"the unfinished study that was there is now in {tmp_path / f'checkpoints.{number}'}"]
    shutil.move(tmp_path / "checkpoints.2", tmp_path / "checkpoints")
    assert resumed(tmp_path).found == 200


def test_checkpoints_without_a_description_are_refused(tmp_path):
    unfinished(tmp_path)
    about = {"format": "bellcrank study", "version": 1, "identity": {"bellcrank": 3}, "designs": 1, "measures": []}
    named = json.dumps(about | {"identity": {}, "measures": [3]})
    for text in ("{", "[]", '{"identity": 3}', "", json.dumps(about), named):
        (tmp_path / "checkpoints" / "study.json").write_text(text)
        with pytest.raises(InputError, match="does not say what study"):
            resumed(tmp_path)
    about = {"format": "bellcrank study", "version": 99, "identity": {}, "designs": 1, "measures": []}
    (tmp_path / "checkpoints" / "study.json").write_text(json.dumps(about))
    with pytest.raises(InputError, match="another format"):
        resumed(tmp_path)


def test_a_description_without_rows_is_replaced(tmp_path):
    unfinished(tmp_path, a="other")
    for path in (tmp_path / "checkpoints").glob("*.npz"):
        path.unlink()
    unfinished(tmp_path, parts=3)
    assert resumed(tmp_path).found == 300


# ---- damage


def _cut(data):
    return data[: len(data) // 2]


def _flip(data):
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]


@pytest.mark.parametrize("damage", [_cut, _flip, lambda data: b"", lambda data: b"\0" * len(data)])
def test_a_damaged_file_is_computed_anew_and_said(tmp_path, damage):
    unfinished(tmp_path, checkpoint_every=0.0)
    files = sorted((tmp_path / "checkpoints").glob("*.npz"))
    assert len(files) >= 2
    files[0].write_bytes(damage(files[0].read_bytes()))
    notes = []
    run = resumed(tmp_path, notes)
    assert len(notes) == 2 and str(files[0]) in notes[0] and "damaged" in notes[0] and "computed anew" in notes[0]
    assert 0 < run.found < 1200 and same_columns(run.columns, expected_columns(COUNT))


def test_a_file_whose_numbers_do_not_fit_is_computed_anew(tmp_path):
    unfinished(tmp_path)
    (path,) = (tmp_path / "checkpoints").glob("*.npz")
    whole = dict(np.load(path))
    wrong = [
        {"ranges": whole["ranges"] + 0.5}, {"ranges": whole["ranges"] + COUNT}, {"ranges": whole["ranges"][:, ::-1]},
        {"status": whole["status"] + 7.0}, {"measures": whole["measures"][:2]}, {"status": whole["status"][1:]},
        {"reason_texts": whole["reason_texts"] + 1e3}, {"reason_designs": whole["reason_designs"] - 1e4},
    ]  # fmt: skip
    for change in wrong:
        np.savez(path, **whole | change)
        notes = []
        run = resumed(tmp_path, notes)
        assert run.found == 0 and "damaged" in notes[0] and same_columns(run.columns, expected_columns(COUNT))
        unfinished(tmp_path)


# ---- two processes


def test_two_studies_cannot_write_one_folder(tmp_path):
    with StudyFolder(tmp_path):
        script = (
            "from bellcrank.studies.execution.study_folder import StudyFolder\n"
            f"with StudyFolder({str(tmp_path)!r}): pass"
        )
        other = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
        assert f"another study is writing there (process {os.getpid()} on " in other.stderr
        with pytest.raises(InputError, match="wait for it, or choose another folder"):
            StudyFolder(tmp_path).__enter__()
    assert not (tmp_path / NAME).exists()
    with StudyFolder(tmp_path):
        pass


def test_a_lock_is_released_by_the_death_of_its_process(tmp_path):
    script = (
        f"import os\nfrom pathlib import Path\nfrom bellcrank.studies.execution.study_folder import FolderLock\n"
        f"FolderLock(Path({str(tmp_path)!r})).__enter__()\nos.kill(os.getpid(), 9)"
    )
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == -9
    assert (tmp_path / NAME).exists()
    with FolderLock(tmp_path):
        pass


def test_a_folder_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot write in"):
        StudyFolder(tmp_path / "file").__enter__()
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "checkpoints").symlink_to(tmp_path)
    with pytest.raises(InputError, match="is a link"):
        StudyFolder(tmp_path / "out").__enter__()


# ---- the choice of what runs a study


def test_executors_are_chosen_by_their_arguments():
    assert choose_executor(3).threads == 3
    assert choose_executor(None).threads == len(os.sched_getaffinity(0))
    with pytest.raises(InputError, match="'workers': expected a whole number of at least 1"):
        choose_executor(None, 0)
    with pytest.raises(InputError, match="workers and scheduler were given; expected one"):
        choose_executor(None, 2, "tcp://localhost:8786")


def test_what_differs_between_environments_is_said_briefly():
    here = environment()
    assert differences(here, dict(here), ("one", "two")) == ""
    assert {"bellcrank", "numpy", "scipy", "llvmlite", "processor target"} <= set(here)
    long = "x" * 200
    said = differences({"a": long + "1", "b": "1"}, {"a": long + "2", "c": "2"}, ("one", "two"))
    assert said == (
        f"a (one: …{'x' * 20}1; two: …{'x' * 20}2), b (one: 1; two: nothing), c (one: nothing; two: 2)"
    )  # fmt: skip


# ---- kill -9


@pytest.mark.tier2
def test_a_study_that_is_killed_loses_nothing_that_was_kept(tmp_path):
    check(tmp_path, kills=4, seed=1)


@pytest.mark.tier2
def test_a_sweep_command_that_is_killed_again_and_again_gives_the_same_table(tmp_path):
    command = [
        sys.executable, "-m", "bellcrank", "sweep", "planar_2r_swing", "--vary", "initial.elbow=0.1:1.0:1000",
        "--set", "simulate.max_step=1e-3", "--no-plots", "--threads", "1", "--checkpoint-every", "0.05", "--out",
    ]  # fmt: skip
    for name in ("compiled", "whole"):
        begun = time.monotonic()
        subprocess.run([*command, str(tmp_path / name)], check=True, capture_output=True)
        takes = time.monotonic() - begun
    chance, killed, folder = random.Random(5), 0, tmp_path / "killed"
    kept = {}
    while killed < 4:
        process = subprocess.Popen([*command, str(folder)], stdout=subprocess.PIPE, text=True)
        time.sleep(chance.uniform(0.0, takes))
        process.send_signal(signal.SIGKILL)
        out, _ = process.communicate()
        assert "damaged" not in out
        if process.returncode == 0:  # it had ended before
            assert_same_tables(folder, tmp_path / "whole")
            shutil.rmtree(folder)
            kept = {}
            continue
        killed += 1
        if (folder / "sweep.csv").exists():  # its end had begun: it is finished by the next
            kept = {}
            continue
        before, kept = kept, {}
        for path in (folder / "checkpoints").glob("[0-9]*.npz"):
            with zipfile.ZipFile(path) as archive:
                assert archive.testzip() is None
            with np.load(path) as arrays:
                kept[path.name] = arrays["ranges"].tolist()
        assert kept.items() >= before.items()
    last = subprocess.run([*command, str(folder)], check=True, capture_output=True, text=True)
    assert "damaged" not in last.stdout
    assert_same_tables(folder, tmp_path / "whole")


def assert_same_tables(folder, other):
    assert {path.name for path in folder.iterdir()} == {"sweep.csv", "sweep.json"}
    for name in ("sweep.csv", "sweep.json"):
        assert (folder / name).read_bytes() == (other / name).read_bytes()
