"""Runs fuzz cases in a child process with a limit of memory and of time a case; a case that fails is named.

python tests/fuzz/fuzz_run.py KIND SEED NUMBER    runs one case again, and shows its files, traceback and verdict
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import select
import shlex
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

MEMORY = 4 * 2**30  # bytes of addresses
START = 300.0  # s that the child may take until it begins, on a busy machine
SECONDS = float(os.environ.get("BELLCRANK_FUZZ_SECONDS", "300"))  # of wall time a case; most take 0.05 s, if not busy


@dataclass(frozen=True)
class Failure:
    """A fault, how many cases had it, and the first of them, with the line that runs it again."""

    what: str
    kind: str
    seed: int
    number: int
    count: int = 1

    def __str__(self) -> str:
        again = f"{sys.executable} {Path(__file__).resolve()} {shlex.quote(self.kind)} {self.seed} {self.number}"
        return f"{self.count} x {self.what}\n    {again}"


def fuzz(
    kind: str, seed: int, count: int, seconds: float = SECONDS, first: int = 0
) -> tuple[Counter[str], list[Failure]]:
    """How often cases of a kind were accepted, refused and failed, and the distinct failures."""
    verdicts: Counter[str] = Counter()
    failures: dict[str, Failure] = {}

    def note(number: int, verdict: str) -> None:
        good = verdict in ("accepted", "refused")
        verdicts[verdict if good else "failed"] += 1
        if not good:
            known = failures.get(verdict)
            failures[verdict] = Failure(
                verdict, kind, seed, number if known is None else known.number, 1 if known is None else known.count + 1
            )

    number = first
    while number < first + count:
        with tempfile.TemporaryDirectory(prefix="bellcrank-fuzz-") as folder:
            number = _child(kind, seed, number, first + count, seconds, Path(folder), note)
    return verdicts, list(failures.values())


def _child(kind: str, seed: int, number: int, end: int, seconds: float, folder: Path, note: Any) -> int:
    """Let a child do cases until all are done or it dies; the number of the next case."""
    read, write = os.pipe()
    log = folder / "log"
    with log.open("wb") as said:
        child = subprocess.Popen(
            [
                sys.executable,
                __file__,
                "--child",
                kind,
                str(seed),
                str(number),
                str(end),
                str(write),
                str(folder / "work"),
            ],
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=said,
            pass_fds=[write],
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        )
    os.close(write)
    buffer, waiting = b"", START + seconds
    try:
        while True:
            if not select.select([read], [], [], waiting)[0]:
                note(number, f"hang: no answer within {seconds:g} s")
                return number + 1
            chunk = os.read(read, 65536)
            if not chunk:
                break
            waiting = seconds
            buffer += chunk
            *lines, buffer = buffer.split(b"\n")
            for line in lines:
                record = json.loads(line)
                if "verdict" in record:
                    note(record["number"], record["verdict"])
                    number = record["number"] + 1
        status = child.wait()
        if number < end:
            how = signal.Signals(-status).name if status < 0 else f"exit {status}"
            last = [line for line in log.read_text(errors="replace").splitlines() if line.strip()]
            note(number, f"crash: {how} {last[-1][:120] if last else ''}")
            return number + 1
        return number
    finally:
        os.close(read)
        if child.poll() is None:
            child.send_signal(signal.SIGKILL)
        child.wait()


def _place(error: BaseException) -> str:
    """An error and where in bellcrank it came from, the same for the same fault."""
    ours = [f for f in traceback.extract_tb(error.__traceback__) if f"{os.sep}bellcrank{os.sep}" in f.filename]
    where = f" at {Path(ours[-1].filename).name} in {ours[-1].name}" if ours else ""
    return f"{type(error).__name__}{where}"


def verdict_of(kind: str, seed: int, number: int, folder: Path, loud: bool = False) -> str:
    """Do one case in a folder of its own; "accepted", "refused", or what is wrong."""
    import fuzz_actions
    import fuzz_inputs

    made = fuzz_inputs.case(kind, seed, number)
    folder.mkdir(parents=True)
    for name, data in made.files.items():
        (folder / name).write_bytes(data)
        if loud:
            print(f"---- {name}\n{data.decode('utf-8', 'replace')[:3000]}")
    if loud:
        print("----", made.action, repr(made.arguments)[:2000])
    with contextlib.chdir(folder):
        try:
            return fuzz_actions.judge(made)
        except fuzz_actions.Wrong as wrong:
            return str(wrong)
        except BaseException as error:  # whatever it is, it is told, and the next case is tried
            if loud:
                traceback.print_exc()
            return f"traceback: {_place(error)}"


def _work(kind: str, seed: int, first: int, end: int, answers: int, folder: Path) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with os.fdopen(answers, "w", buffering=1) as pipe:
        for number in range(first, end):
            verdict = verdict_of(kind, seed, number, folder / str(number))
            pipe.write(json.dumps({"number": number, "verdict": verdict}) + "\n")


def main(arguments: Sequence[str]) -> int:
    """The child of `fuzz`, or one case by hand."""
    if arguments[:1] == ["--child"]:
        kind, seed, first, end, answers, folder = arguments[1:]
        _work(kind, int(seed), int(first), int(end), int(answers), Path(folder))
        return 0
    kind, seed, number = arguments
    with tempfile.TemporaryDirectory(prefix="bellcrank-fuzz-") as folder:
        begun = time.monotonic()
        verdict = verdict_of(kind, int(seed), int(number), Path(folder) / "work", loud=True)
        print(f"---- {verdict}, {time.monotonic() - begun:.2f} s")
    return 0 if verdict in ("accepted", "refused") else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
