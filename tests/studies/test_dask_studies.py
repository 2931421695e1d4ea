"""Studies on Dask workers: the same rows as without, whatever happens to the workers."""

import contextlib
import logging
import os
import pickle
import random
import signal
import subprocess
import sys
import threading
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
import small_study
from small_study import SmallRunner, SmallSpace, expected_columns, same_columns

import bellcrank as bc
from bellcrank.errors import BellcrankError, InputError
from bellcrank.studies.designs.axes import read_axis
from bellcrank.studies.designs.design_space import DesignSpace
from bellcrank.studies.execution import dask_execution, local_cluster
from bellcrank.studies.execution.dask_execution import DaskExecutor
from bellcrank.studies.execution.dask_worker import RangeTask, run_range
from bellcrank.studies.execution.simulation_runner import SimulationRunner
from bellcrank.studies.execution.software_and_processor import environment
from bellcrank.studies.execution.study import run_study
from bellcrank.studies.execution.study_folder import StudyFolder

pytestmark = pytest.mark.tier2
COUNT = 20_000


@pytest.fixture(scope="module")
def cluster():
    """Two workers, for all tests that do not kill them."""
    with DaskExecutor(workers=2) as executor:
        yield Borrowed(executor)


class Borrowed:
    """An executor whose cluster goes on after a study."""

    def __init__(self, executor):
        self.executor = executor
        self.environment, self.run = executor.environment, executor.run

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass


@pytest.mark.tier2
def test_rows_are_those_without_dask(cluster, tmp_path):
    with StudyFolder(tmp_path) as place:
        run = run_study(SmallSpace(COUNT), SmallRunner(), cluster, folder=place, checkpoint_every=0.0)
    assert run.complete and same_columns(run.columns, expected_columns(COUNT))
    notes = []
    with StudyFolder(tmp_path, notify=notes.append) as place:  # what workers began, threads go on with
        again = run_study(SmallSpace(COUNT), SmallRunner(), folder=place)
    assert again.found > 0 and "were done before" in notes[-1]
    assert same_columns(again.columns, expected_columns(COUNT))


@pytest.mark.tier2
def test_rows_of_a_scene_are_those_without_dask(cluster):
    scene = bc.load_scene("four_bar")
    space = DesignSpace((read_axis(scene, "crank_length", np.linspace(1.2, 4.0, 300)),))  # some cannot be built
    runner = SimulationRunner(scene, space.axes)
    here, there = run_study(space, runner), run_study(space, runner, cluster)
    assert same_columns(here.columns, there.columns) and here.columns.reasons
    assert np.isfinite(here.columns.measures["lock.time"]).any()
    assert len(pickle.dumps(runner)) < 100_000  # recipes and graphs


def test_what_threads_began_workers_go_on_with(cluster, tmp_path):
    with StudyFolder(tmp_path) as place:
        first = run_study(SmallSpace(COUNT), SmallRunner(interrupt_at=3000), folder=place)
    assert not first.complete
    with StudyFolder(tmp_path, notify=list) as place:
        run = run_study(SmallSpace(COUNT), SmallRunner(), cluster, folder=place)
    assert run.found == len(first.columns) and same_columns(run.columns, expected_columns(COUNT))


@pytest.mark.tier2
def test_ctrl_c_keeps_what_workers_have_done(cluster, tmp_path):
    def stop(done, of):
        if done > COUNT // 4:
            raise KeyboardInterrupt

    with StudyFolder(tmp_path) as place:
        run = run_study(SmallSpace(COUNT), SmallRunner(seconds=1e-4), cluster, folder=place, progress=stop)
    assert not run.complete and COUNT // 4 < len(run.columns) < COUNT
    assert same_columns(run.columns, small_study.chosen_rows(expected_columns(COUNT), run.designs))


def test_an_error_on_a_worker_is_that_of_the_study(cluster):
    with pytest.raises(BellcrankError, match="gave 32 rows of 3 measures, expected 2"):
        run_study(SmallSpace(64), Mislabelled(), cluster)


class Mislabelled(SmallRunner):
    units = dict(list(small_study.UNITS.items())[:2])  # noqa: RUF012


def test_a_worker_with_another_environment_is_refused(cluster, monkeypatch):
    values = SmallSpace(COUNT).values(0, 32)
    other = environment() | {"processor target": "z80, 1 lanes"}
    task = RangeTask(key="x", runner=b"", values=values, threads=1, environment=other)
    with pytest.raises(BellcrankError, match=r"differs in processor target \(the other workers: z80.*BELLCRANK_TARGET"):
        run_range(task)
    found = {"tcp://a": environment(), "tcp://b": environment() | {"numpy": "1.0"}}
    monkeypatch.setattr(cluster.executor._client, "run", lambda function: found)
    with pytest.raises(InputError, match=r"Dask workers differ in numpy \(tcp://a: 2[^;]*; tcp://b: 1.0\)"):
        cluster.executor._common_environment()


def test_the_workers_of_a_scheduler_are_used(cluster):
    """Its certificates are those of Dask's own settings."""
    import dask

    address, local = cluster.executor._client.scheduler.address, cluster.executor._local
    of_client = local.security.get_tls_config_for_role("client")
    files = {name: of_client[name.replace("-", "_")] for name in ("ca-file", "cert", "key")}
    ours = {"distributed.comm.tls.ca-file": files["ca-file"]}
    ours |= {f"distributed.comm.tls.client.{name}": files[name] for name in ("cert", "key")}
    with dask.config.set(ours), warnings.catch_warnings():
        warnings.simplefilter("error")
        run = run_study(SmallSpace(COUNT), SmallRunner(), DaskExecutor(scheduler=address))
    assert same_columns(run.columns, expected_columns(COUNT))
    assert cluster.executor._client.status == "running"


STRANGER = """
import sys, distributed
kind, address = sys.argv[1:]
security = distributed.Security.temporary() if kind == "own" else None
try:
    with distributed.Client(address, security=security, timeout=3) as client:
        print("ran", client.submit(lambda: 6 * 7).result(timeout=3))
except Exception as error:
    print("refused", type(error).__name__)
"""


@pytest.mark.parametrize("kind", ["none", "own", "tcp"])
def test_another_program_of_this_machine_cannot_run_code_on_the_workers(cluster, kind):
    """Without certificates, with its own, or without TLS, on the scheduler's port and on a worker's."""
    client = cluster.executor._client
    for address in (client.scheduler.address, *client.scheduler_info()["workers"]):
        assert address.startswith("tls://127.0.0.1:")
        there = address.replace("tls", "tcp") if kind == "tcp" else address
        process = subprocess.run(
            [sys.executable, "-c", STRANGER, kind, there], capture_output=True, text=True, timeout=100, check=True
        )
        assert process.stdout.startswith("refused"), process.stdout
    assert run_study(SmallSpace(64), SmallRunner(), cluster).complete


def test_keys_of_workers_are_for_this_user_only(cluster):
    files = sorted(cluster.executor._local._folder.glob("*.pem"))
    assert [path.stem for path in files] == ["ca_file", "cert", "key"]
    assert all(path.stat().st_mode & 0o777 == 0o600 for path in files)
    assert files[0].parent.stat().st_mode & 0o777 == 0o700


@pytest.mark.tier2
def test_a_scheduler_that_does_not_answer_is_said(monkeypatch):
    monkeypatch.setattr(dask_execution, "CONNECTING", 1.0)
    before = threading.active_count()
    with pytest.raises(InputError, match=r"no Dask scheduler answers at 'tcp://127.0.0.1:9'.*start one"):
        DaskExecutor(scheduler="tcp://127.0.0.1:9").__enter__()
    for address in ("nonsense", "nonsense://x:1", "tcp://", "tcp://127.0.0.1", "inproc://1/2/3"):
        with pytest.raises(InputError, match=f"'{address}' is not the address of a Dask scheduler"):
            DaskExecutor(scheduler=address).__enter__()
    assert threading.active_count() == before


def test_a_scheduler_without_workers_is_said(monkeypatch):
    import distributed

    monkeypatch.setattr(dask_execution, "CONNECTING", 1.0)
    with (
        pytest.warns(UserWarning, match="has no TLS: whoever can connect to it or its workers can run programs there"),
        distributed.LocalCluster(n_workers=0, dashboard_address="127.0.0.1:0", silence_logs=logging.CRITICAL) as empty,
        pytest.raises(InputError, match="has no worker; start some with 'dask worker tcp"),
    ):
        DaskExecutor(scheduler=empty.scheduler_address).__enter__()


def test_without_dask_the_remedy_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'bellcrank\[cluster\]'"):
        DaskExecutor(workers=1).__enter__()


@pytest.mark.tier2
def test_designs_that_kill_every_worker_are_said(monkeypatch, tmp_path):
    monkeypatch.setitem(local_cluster._SETTINGS, "distributed.scheduler.allowed-failures", 1)
    said = r"designs \d+ to \d+: 2 workers that ran them died, one after the other"
    with StudyFolder(tmp_path) as place, pytest.raises(BellcrankError, match=said):
        run_study(SmallSpace(COUNT), SmallRunner(deadly=9.9), DaskExecutor(workers=2), folder=place)
    notes = []
    with StudyFolder(tmp_path, notify=notes.append) as place:  # the others are kept
        assert run_study(SmallSpace(COUNT), SmallRunner(), folder=place).found > 100


@pytest.mark.tier2
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_two_of_four_workers_are_killed_and_nothing_is_lost(seed):
    """The workers are killed at random moments while they run designs; every row is that of the closed forms."""
    chance, executor, killed = random.Random(seed), DaskExecutor(workers=4), []
    begun = threading.Event()

    def kill_two():
        begun.wait(120.0)
        for _ in range(2):
            time.sleep(chance.uniform(0.1, 1.0))
            victim = chance.choice(sorted(executor._client.run(os.getpid).values()))
            with contextlib.suppress(ProcessLookupError):
                os.kill(victim, signal.SIGKILL)
                killed.append(victim)

    killer = threading.Thread(target=kill_two)
    killer.start()
    run = run_study(
        SmallSpace(COUNT), SmallRunner(seconds=1e-3), executor, progress=lambda done, of: begun.set() if done else None
    )
    killer.join()
    assert len(killed) == 2
    assert run.complete and same_columns(run.columns, expected_columns(COUNT))


SCRIPT = """
from small_study import SmallRunner, SmallSpace
from bellcrank.studies.designs.axes import read_axis
from bellcrank.studies.execution.dask_execution import DaskExecutor
from bellcrank.studies.execution.study import run_study

said = []

def say(done, of):
    if done and not said:
        said.append(print("some", flush=True))

if __name__ == "__main__":
    run = run_study(SmallSpace(10**6), SmallRunner(seconds=1e-3), DaskExecutor(workers=2), progress=say)
    print(run.complete, len(run.columns) > 0, flush=True)
"""


@pytest.mark.tier2
def test_ctrl_c_at_a_terminal_ends_the_workers_quietly(tmp_path):
    """Ctrl-C reaches every process of a terminal's foreground, the workers too."""
    script = tmp_path / "study.py"
    script.write_text(SCRIPT)
    path = os.pathsep.join([str(Path(small_study.__file__).parent), os.environ.get("PYTHONPATH", "")])
    process = subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True, env=os.environ | {"PYTHONPATH": path},
    )  # fmt: skip
    assert process.stdout.readline() == "some\n"
    os.killpg(process.pid, signal.SIGINT)
    out, noise = process.communicate(timeout=60)
    assert out.splitlines()[-1] == "False True" and noise == ""
    assert process.returncode == 0
    deadline = time.monotonic() + 10.0
    with pytest.raises(ProcessLookupError):  # when no process of the session is left
        while time.monotonic() < deadline:
            os.killpg(process.pid, 0)
            time.sleep(0.05)
