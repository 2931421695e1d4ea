"""Runs the designs of a study on Dask: on a cluster of processes that it starts, or on the one of a scheduler."""

from __future__ import annotations

import contextlib
import logging
import queue
import reprlib
import time
import uuid
import warnings
from collections.abc import Iterator, Mapping
from typing import Any, Self

from bellcrank.errors import BellcrankError, InputError
from bellcrank.studies.designs.design_space import DesignRange, RangeSize
from bellcrank.studies.execution.dask_worker import RangeTask, run_range
from bellcrank.studies.execution.design_runner import DesignRunner
from bellcrank.studies.execution.execution import DESIGNS_A_THREAD, Part, Work
from bellcrank.studies.execution.local_cluster import LocalCluster
from bellcrank.studies.execution.software_and_processor import TARGETS_ALIKE, differences, environment
from bellcrank.studies.results.study_columns import StudyColumns
from bellcrank.terminal import interruption

IN_FLIGHT = 2  # ranges a thread of a worker: one runs, one waits
POLL = 0.1  # s between checks for Ctrl-C
FETCHING = 2.0  # s that a result may take before Ctrl-C is looked for; twice as long after each time that it does not
LOOK = 1.0  # s between counts of the workers
CONNECTING = 10.0  # s until a scheduler answers, and until its first worker is there
PATIENCE = 60.0  # s until a worker that is started here is there


class DaskExecutor:
    """Runs designs on Dask workers.

    Args:
        workers: Start so many processes on this machine.
        scheduler: Or use the workers of this scheduler, such as "tcp://10.0.0.1:8786".
        threads: In each worker.
    """

    def __init__(self, *, workers: int | None = None, scheduler: str | None = None, threads: int = 1) -> None:
        self.workers, self.scheduler, self.threads = workers, scheduler, threads
        self._open = contextlib.ExitStack()
        self._client: Any = None
        self._local: LocalCluster | None = None
        self._slots, self._looked = 1, -LOOK
        self._fetching = FETCHING

    def __enter__(self) -> Self:
        """Raises InputError where Dask is not installed, or no worker answers."""
        dask, distributed = _dask()
        with contextlib.ExitStack() as opened:
            opened.enter_context(_quiet())
            self._client = self._connect(dask, distributed, opened)
            self._environment = self._common_environment()
            self._open = opened.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        with interruption.unbroken():
            self._open.close()

    @property
    def environment(self) -> Mapping[str, str]:
        """Versions and processor of the workers, which are the same."""
        return self._environment

    def run(self, work: Work) -> Iterator[Part]:
        """Run ranges of designs on the workers; parts come as they are done."""
        done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        running: dict[Any, DesignRange] = {}
        size = RangeSize(DESIGNS_A_THREAD * self.threads)
        key, pickled = uuid.uuid4().hex, _pickled(work.runner)
        try:
            while True:
                while len(running) < IN_FLIGHT * self._slots_now():
                    fair = max(work.undone.count // (IN_FLIGHT * self._slots), size.least)  # all end at the same time
                    designs = work.undone.take(min(size.count, fair))
                    if designs is None:
                        break
                    task = RangeTask(
                        key=key, runner=pickled, values=work.space.values(*designs), threads=self.threads,
                        environment=self._environment,
                    )  # fmt: skip
                    name = f"bellcrank-{key[:8]}-{designs.first}"
                    future = self._client.submit(run_range, task, key=name, pure=False)
                    running[future] = designs
                    future.add_done_callback(done.put)
                if not running:
                    return
                try:
                    future = done.get(timeout=POLL)
                except queue.Empty:
                    work.progress(0)
                    self._check_alive()
                    continue
                rows = self._rows(future, running[future])
                if rows is None:  # its worker died since
                    work.progress(0)
                    done.put(future)
                    continue
                columns, seconds = rows
                designs = running.pop(future)
                future.release()
                size.learn(designs.size, seconds)
                yield Part(designs, columns)
        finally:
            if running and self._client.status == "running":
                self._client.cancel(list(running))

    def _connect(self, dask: Any, distributed: Any, opened: contextlib.ExitStack) -> Any:
        """A client of the cluster; what is opened is closed with `opened`."""
        if self.scheduler is None:
            self._local = opened.enter_context(LocalCluster(dask, distributed, self.workers or 1))
            client = distributed.Client(
                self._local.cluster, security=self._local.security, set_as_default=False, direct_to_workers=True
            )
            opened.enter_context(client)
        else:
            client = opened.enter_context(_client(distributed, self.scheduler))
            if not self.scheduler.startswith("tls://"):
                warnings.warn(
                    f"the Dask scheduler {self.scheduler} has no TLS: whoever can connect to it or its workers can run "
                    "programs there; start it with certificates and name it as tls://…, or use a trusted network",
                    stacklevel=2,
                )
        try:
            client.wait_for_workers(1, timeout=PATIENCE if self.scheduler is None else CONNECTING)
        except TimeoutError:
            if self._local is not None:
                raise InputError(f"no Dask worker began to work within {PATIENCE:g} s") from None
            raise InputError(
                f"the Dask scheduler {self.scheduler} has no worker; start some with 'dask worker {self.scheduler}'"
            ) from None
        return client

    def _common_environment(self) -> dict[str, str]:
        """The environment of all workers. Raises InputError where they differ."""
        try:
            found: dict[str, dict[str, str]] = self._client.run(environment)
        except ModuleNotFoundError as error:
            raise _missing(error) from None
        first = next(iter(found))
        for address, other in found.items():
            differing = differences(found[first], other, (first, address))
            if differing:
                raise InputError(f"Dask workers differ in {differing}; {TARGETS_ALIKE}")
        return found[first]

    def _slots_now(self) -> int:
        """How many ranges the workers can run at once."""
        now = time.monotonic()
        if now - self._looked >= LOOK:
            self._looked = now
            with contextlib.suppress(OSError):  # that the connection is lost, the results say
                self._slots = max(sum(self._client.nthreads().values()), 1)
        return self._slots

    def _rows(self, future: Any, designs: DesignRange) -> tuple[StudyColumns, float] | None:
        """The result of a range; None where it does not come soon. Raises BellcrankError where there is none."""
        from distributed import CancelledError
        from distributed.scheduler import KilledWorker

        try:
            found: tuple[StudyColumns, float] = future.result(timeout=self._fetching)
            return found
        except TimeoutError:
            self._fetching *= 2.0  # or a slow network would never bring it
            return None
        except KilledWorker as error:
            raise BellcrankError(
                f"designs {designs.first + 1} to {designs.stop}: {error.allowed_failures + 1} workers that ran them "
                "died, one after the other; they may need more memory than the workers have, or be killed by the "
                "system; run these designs alone, without workers, to see why"
            ) from None
        except ModuleNotFoundError as error:
            raise _missing(error) from None
        except (CancelledError, OSError) as error:
            why = str(error)[:120] or type(error).__name__
            raise BellcrankError(
                f"the Dask scheduler lost the designs {designs.first + 1} to {designs.stop} ({why}); run again to go "
                "on from what is kept"
            ) from None

    def _check_alive(self) -> None:
        if self._client.status not in ("running", "connecting"):
            raise BellcrankError("the connection to the Dask scheduler was lost; run again to go on from what is kept")


def _client(distributed: Any, address: str) -> Any:
    """A client of the scheduler at an address. Raises InputError where none answers."""
    try:
        protocol, place = distributed.comm.parse_address(address)
        distributed.comm.parse_host_port(place)
        distributed.comm.registry.get_backend(protocol)
        if protocol == "inproc":
            raise ValueError("'inproc' is for one process")
    except ValueError as error:
        raise InputError(
            f"scheduler: {reprlib.repr(address)} is not the address of a Dask scheduler ({str(error)[:120]}); expected "
            "one such as 'tcp://10.0.0.1:8786'"
        ) from None
    client = distributed.Client.__new__(distributed.Client)
    try:
        client.__init__(address, timeout=CONNECTING, set_as_default=False)
    except Exception as error:  # of many kinds, if it is not a scheduler that answers
        client.status = "closed"  # or Dask tries to close it when it is freed, and complains
        if (loop := getattr(client, "_loop_runner", None)) is not None:
            loop.stop()  # or its thread stays
        raise InputError(
            f"no Dask scheduler answers at {reprlib.repr(address)} ({str(error)[:120]}); start one with "
            "'dask scheduler', and workers with 'dask worker ADDRESS'"
        ) from None
    return client


def _pickled(runner: DesignRunner) -> bytes:
    """The pickle of a runner, with what the user's program defines itself. Raises InputError where there is none."""
    import cloudpickle

    try:
        data: bytes = cloudpickle.dumps(runner)
        return data
    except Exception as error:  # whatever an object in the scene says
        raise InputError(f"the study cannot be sent to other processes ({error}); run it without workers") from None


def _missing(error: ModuleNotFoundError) -> InputError:
    return InputError(f"Dask workers cannot import {error.name}; install bellcrank where they run")


def _dask() -> tuple[Any, Any]:
    try:
        import cryptography  # noqa: F401
        import dask
        import distributed
    except ImportError as error:
        raise InputError(
            f"--workers and --scheduler need Dask ({error}); install it with: pip install 'bellcrank[cluster]'"
        ) from None
    return dask, distributed


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """In the block Dask logs nothing: what the user has to know is an error of the study."""
    names = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == "distributed"]
    levels = {name: logging.getLogger(name).level for name in names}
    for name in names:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)
