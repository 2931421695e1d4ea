"""Chooses what runs the designs of a study: threads, processes of this machine, or a cluster."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Self

from bellcrank import arguments
from bellcrank.errors import InputError
from bellcrank.studies.execution.execution import Executor, LocalExecutor, Part, Work

MOST_THREADS = 1024
MOST_WORKERS = 1024


class Opened:
    """An executor whose block lasts longer than one study."""

    def __init__(self, executor: Executor) -> None:
        self.executor = executor

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    @property
    def environment(self) -> Mapping[str, str]:
        """That of the executor."""
        return self.executor.environment

    def run(self, work: Work) -> Iterator[Part]:
        """The parts of the executor."""
        return self.executor.run(work)


def choose_executor(threads: int | None, workers: int | None = None, scheduler: str | None = None) -> Executor:
    """The executor of the arguments `threads`, `workers` and `scheduler` of a study.

    Args:
        threads: By default one a processor, and one in each worker.
        workers: Processes that Dask starts on this machine.
        scheduler: The address of a Dask scheduler.

    Raises:
        InputError: An argument is not as expected, or both `workers` and `scheduler` are given.
    """
    if threads is not None:
        threads = arguments.whole("threads", threads, least=1, most=MOST_THREADS)
    if workers is not None:
        workers = arguments.whole("workers", workers, least=1, most=MOST_WORKERS)
    if scheduler is not None:
        scheduler = arguments.text("scheduler", scheduler, "an address such as 'tcp://10.0.0.1:8786'")
    if workers is not None and scheduler is not None:
        raise InputError("workers and scheduler were given; expected one: workers starts a cluster, scheduler uses one")
    if workers is None and scheduler is None:
        return LocalExecutor(threads)
    from bellcrank.studies.execution.dask_execution import DaskExecutor

    return DaskExecutor(workers=workers, scheduler=scheduler, threads=threads or 1)
