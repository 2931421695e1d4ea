"""Optimised code, compiled in another process while quickly compiled code runs.

llvmlite lets one thread at a time into LLVM, and a thread in LLVM cannot be ended; a process can. There is at most one
such process for each that asks, of low priority. It is ended when there has been no work for a while, and when the
program exits. Where it cannot be started or fails, the quickly compiled code stays.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import queue
import subprocess
import sys
import threading
import time
import weakref
import zlib
from dataclasses import dataclass
from typing import Protocol

from bellcrank import arguments
from bellcrank.codegen import object_code
from bellcrank.codegen.llvm import Target
from bellcrank.files.limited_process import environment_here

IDLE = 5.0  # s without work after which the process ends
_LEVEL = 2


class Improvable(Protocol):
    """What runs quickly compiled code."""

    def improve(self, code: bytes, ir: str) -> None:
        """Use optimised code of the IR from now on."""


@dataclass(frozen=True)
class _Job:
    asked: weakref.ref[Improvable]
    ir: bytes  # compressed
    target: Target


class _Optimiser:
    """A thread that hands work to the compiling process and its results to who asked."""

    def __init__(self) -> None:
        self._jobs: queue.SimpleQueue[_Job] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._left = 0  # jobs that are not done
        self._ended = False

    def ask(self, job: _Job) -> None:
        with self._lock:
            if self._ended:
                return
            self._left += 1
            self._jobs.put(job)
            if self._thread is None:
                self._thread = threading.Thread(target=self._work, name="bellcrank-optimiser", daemon=True)
                try:
                    self._thread.start()
                except RuntimeError:  # there is no room for a thread, or the interpreter ends
                    self._thread, self._ended, self._left = None, True, 0

    def wait(self, seconds: float) -> bool:
        end = time.monotonic() + seconds
        while self._left and time.monotonic() < end:
            time.sleep(0.005)
        return not self._left

    def end(self) -> None:
        """End the process at once, and the thread."""
        with self._lock:
            self._ended, thread = True, self._thread
            self._stop()
        if thread is not None:
            thread.join(5.0)

    def _work(self) -> None:
        while not self._ended:
            try:
                job = self._jobs.get(timeout=IDLE)
            except queue.Empty:
                with self._lock:
                    if not self._jobs.empty():
                        continue
                    self._stop()
                    self._thread = None
                    return
            with contextlib.suppress(OSError, ValueError, EOFError, RuntimeError, KeyError):  # of LLVM the last two
                self._do(job)
            with self._lock:
                self._left -= 1

    def _do(self, job: _Job) -> None:
        if job.asked() is None:  # nobody needs it any more
            return
        with self._lock:
            if self._ended:
                return
            process = self._process = self._process or _started()
        request = json.dumps([len(job.ir), job.target.cpu, job.target.features, _LEVEL])
        try:
            _write(process, request.encode() + b"\n" + job.ir)
            size = int.from_bytes(_read(process, 8), "little")
            code = _read(process, size)
        except (OSError, ValueError, EOFError):
            with self._lock:
                self._stop()
            raise
        asked = job.asked()
        if code and asked is not None and not self._ended:
            asked.improve(code, zlib.decompress(job.ir).decode())

    def _stop(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
            for pipe in (process.stdin, process.stdout):
                with contextlib.suppress(OSError):
                    if pipe is not None:
                        pipe.close()


def _write(process: subprocess.Popen[bytes], data: bytes) -> None:
    assert process.stdin is not None
    left = memoryview(data)
    while left:
        left = left[process.stdin.write(left) :]


def _read(process: subprocess.Popen[bytes], size: int) -> bytes:
    assert process.stdout is not None
    parts = []
    while size:
        part = process.stdout.read(size)
        if not part:
            raise EOFError
        parts.append(part)
        size -= len(part)
    return b"".join(parts)


def _started() -> subprocess.Popen[bytes]:
    """The compiling process, in a session of its own, so that Ctrl-C at a terminal is for this process only."""
    if not sys.executable:
        raise OSError("the interpreter is not known")
    return subprocess.Popen(
        [sys.executable, "-P", object_code.__file__],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, bufsize=0,
        start_new_session=True, env=environment_here(),
    )  # fmt: skip


_optimiser = _Optimiser()


def ask(asked: Improvable, ir: bytes, target: Target) -> None:
    """Let `asked` have the optimised code of compressed IR, by and by."""
    _optimiser.ask(_Job(weakref.ref(asked), ir, target))


def wait_for_optimised_code(seconds: float = 600.0) -> bool:
    """Wait until all code that was called is optimised, as measurements of speed should.

    Long code is compiled quickly first, and optimised in another process meanwhile; both give the same bits.

    Args:
        seconds: The longest time to wait, s.

    Returns:
        Whether it is.

    Raises:
        InputError: `seconds` is not a number of 0 or more.

    Example:
        >>> import bellcrank as bc
        >>> robot = bc.load_robot("planar_2r")
        >>> _ = robot.inverse_dynamics([0.1, 0.2], [0.0, 0.0], [1.0, 0.0])
        >>> bc.wait_for_optimised_code()
        True
    """
    return _optimiser.wait(arguments.number("seconds", seconds, least=0.0))


def compressed(ir: str) -> bytes:
    """IR as `ask` takes it."""
    return zlib.compress(ir.encode(), 1)


def _in_child() -> None:
    """A forked process has no such thread, and the compiling process is not its own."""
    global _optimiser
    _of_parents.append(_optimiser)
    _optimiser = _Optimiser()


_of_parents: list[_Optimiser] = []  # kept, because freeing them would wait for the process
os.register_at_fork(after_in_child=_in_child)
atexit.register(lambda: _optimiser.end())
