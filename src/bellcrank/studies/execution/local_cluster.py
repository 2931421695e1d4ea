"""A Dask cluster on this machine: a scheduler in this process, and workers that are started anew when they die.

The workers are processes of their own session, so that Ctrl-C at a terminal is for this process only, and they do not
import the program that started them. They end when the scheduler does, in whatever way.

A scheduler and its workers run what they are sent, and any user of this machine can connect to them. So connections
are encrypted, and both ends have to show a certificate that is made anew for each cluster: its key lies in the memory
of this process, and for the workers in a folder that only this user can read.
"""

from __future__ import annotations

import contextlib
import logging
import subprocess
import sys
import threading
from typing import Any, Self

from bellcrank.errors import InputError
from bellcrank.files.limited_process import environment_here
from bellcrank.files.temporaries import temporary_folder

ALLOWED_DEATHS = 6  # of workers that run one range; more are the range's fault
LOOK = 0.3  # s between looks for workers that have died
HERE = "127.0.0.1"
_SETTINGS = {"distributed.scheduler.allowed-failures": ALLOWED_DEATHS}
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class LocalCluster:
    """`count` workers in the block of this context manager.

    Attributes:
        cluster: Dask's object, to which a client connects.
        security: The certificates that a client needs, Dask's object.
        workers: The processes.
    """

    def __init__(self, dask: Any, distributed: Any, count: int) -> None:
        self._dask, self._distributed, self.count = dask, distributed, count
        self.workers: list[subprocess.Popen[bytes]] = []
        self._closing = threading.Event()
        self._open = contextlib.ExitStack()

    def __enter__(self) -> Self:
        """Raises InputError where processes cannot be started."""
        with contextlib.ExitStack() as opened:
            self._folder = opened.enter_context(temporary_folder("workers"))
            self.security = self._distributed.Security.temporary()
            self._certificates = self._written_certificates()
            opened.enter_context(self._dask.config.set(_SETTINGS))
            self.cluster = opened.enter_context(
                self._distributed.LocalCluster(
                    n_workers=0, host=HERE, protocol="tls://", security=self.security, dashboard_address=f"{HERE}:0",
                    scheduler_kwargs={"dashboard": False}, silence_logs=logging.CRITICAL,
                )
            )  # fmt: skip
            opened.callback(self._kill)
            for _ in range(self.count):
                self.workers.append(self._worker())
            keeper = threading.Thread(target=self._revive, name="workers", daemon=True)
            keeper.start()
            opened.callback(keeper.join)
            opened.callback(self._closing.set)
            self._open = opened.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def _revive(self) -> None:
        """Start a worker for each that has died, until the cluster is closed."""
        while not self._closing.wait(LOOK):
            with contextlib.suppress(InputError):  # there may be room for a process later
                for k, worker in enumerate(self.workers):
                    if worker.poll() is not None:
                        self.workers[k] = self._worker()

    def _written_certificates(self) -> list[str]:
        """The options of a worker that name files of certificates, which only this user can read."""
        of_worker, options = self.security.get_tls_config_for_role("worker"), []
        for option, key in (("--tls-ca-file", "ca_file"), ("--tls-cert", "cert"), ("--tls-key", "key")):
            path = self._folder / f"{key}.pem"
            path.touch(mode=0o600, exist_ok=False)
            path.write_text(of_worker[key], encoding="ascii")
            options += [option, str(path)]
        return options

    def _worker(self) -> subprocess.Popen[bytes]:
        command = [
            sys.executable, "-P", "-m", "distributed.cli.dask_worker", self.cluster.scheduler_address, "--no-nanny",
            "--nthreads", "1", "--memory-limit", "0", "--host", HERE, "--no-dashboard", "--dashboard-address",
            f"{HERE}:0", "--death-timeout", "60", "--local-directory", str(self._folder), *self._certificates,
        ]  # fmt: skip
        environment = environment_here() | dict.fromkeys(_THREADS, "1")
        try:
            return subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                start_new_session=True, env=environment,
            )  # fmt: skip
        except OSError as error:
            raise InputError(f"workers: {self.count} cannot be started ({error.strerror}); ask for fewer") from None

    def _kill(self) -> None:
        """End the workers at once: they hold nothing that is needed."""
        for worker in self.workers:
            worker.kill()
        for worker in self.workers:
            worker.wait()
