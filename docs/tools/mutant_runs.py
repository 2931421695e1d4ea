"""Copies of the installed package with a mutant in them, and sessions of pytest on such a copy."""

from __future__ import annotations

import contextlib
import importlib.metadata
import importlib.util
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mutant_cpp_places import CPP_ROOMS
from mutant_places import Mutant

ROOT = Path(__file__).parents[2]
PATIENCE = 120.0  # s that a test may take on a mutant, besides 10 times what its file usually takes
Record = dict[str, Any]


def installed() -> Path:
    """The folder of the package that is installed here."""
    spec = importlib.util.find_spec("bellcrank")
    if spec is None or spec.origin is None:
        raise SystemExit("bellcrank is not installed in this environment")
    return Path(spec.origin).parent


@contextlib.contextmanager
def copied(package: Path) -> Iterator[Path]:
    """A temporary folder with src/bellcrank, src/bellcrank_bench and the bundled data."""
    with tempfile.TemporaryDirectory(prefix="mutant-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        for one in (package, package.with_name("bellcrank_bench")):
            shutil.copytree(one, folder / "src" / one.name, ignore=shutil.ignore_patterns("*.pyc.*"))
        for data in ("urdf", "robots"):
            if not (package / "share" / data).exists():
                (folder / data).symlink_to(package.parents[1] / data)
        (folder / "tmp").mkdir()
        yield folder


def environment(copy: Path) -> dict[str, str]:
    """The variables with which the copy is imported, and all temporary files are below it."""
    paths = [str(copy / "src"), str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")]
    return os.environ | {
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
        "PYTHONPATH": os.pathsep.join(filter(None, paths)),
        "BELLCRANK_MUTANT": str(copy / "order.json"),
        "BELLCRANK_CPP_SOURCES": str(copy / "src" / "cpp" if (copy / "src" / "cpp").exists() else ROOT / "src" / "cpp"),
        "TMPDIR": str(copy / "tmp"),
    }


def lacks_for_cpp() -> list[str]:
    """What this environment lacks to compile the extensions."""
    path = environment(ROOT)["PATH"]
    programs = [name for name in ("g++", "cmake", "ninja") if shutil.which(name, path=path) is None]
    try:
        importlib.metadata.distribution("cmeel-eigen")
        eigen = []
    except importlib.metadata.PackageNotFoundError:
        eigen = ["cmeel-eigen"]
    return programs + ["nanobind"] * (importlib.util.find_spec("nanobind") is None) + eigen


class Builds:
    """A build folder of the extensions that is kept between mutants; one is built at a time."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.lock = folder, threading.Lock()

    def apply(self, mutant: Mutant, copy: Path) -> str:
        """Compile a mutant into the copy of the package; the compiler's first error, if any."""
        source, build = self.folder / "src", self.folder / "build"
        with self.lock:
            for path in [ROOT / "src" / "CMakeLists.txt", *sorted((ROOT / "src" / "cpp").rglob("*.[ch]pp"))]:
                text, to = path.read_text("utf-8"), source / path.relative_to(ROOT / "src")
                if to == source / "cpp" / mutant.file:
                    text = mutant.applied(text)
                if not to.exists() or to.read_text("utf-8") != text:  # an unchanged file is not compiled again
                    to.parent.mkdir(parents=True, exist_ok=True)
                    to.write_text(text, "utf-8")
            abi = "" if sys.version_info < (3, 12) else "Development.SABIModule"
            configure = ["cmake", "-G", "Ninja", "-S", str(source), "-B", str(build), f"-DSKBUILD_SABI_COMPONENT={abi}"]
            if failed := self._errors([*configure, f"-DPython_EXECUTABLE={sys.executable}"], copy):
                raise SystemExit(f"cmake does not configure {source}: {failed}")
            target = CPP_ROOMS[mutant.file.partition("/")[0]]
            if failed := self._errors(["cmake", "--build", str(build), "--target", target], copy):
                return failed
            package = copy / "src" / "bellcrank"
            for old in package.glob(f"{target}.*so"):
                old.unlink()
            for new in build.glob(f"{target}.*so"):
                shutil.copy2(new, package)
            shutil.copytree(source / "cpp", copy / "src" / "cpp")
        return ""

    def _errors(self, command: list[str], copy: Path) -> str:
        done = subprocess.run(command, env=environment(copy), capture_output=True, text=True, check=False)
        lines = (done.stdout + done.stderr).splitlines()
        wrong = [line.partition("error: ")[2] for line in lines if "error: " in line] or lines[-1:] or ["no output"]
        return wrong[0] if done.returncode else ""


def applied(mutant: Mutant, copy: Path, builds: Builds) -> str:
    """Put a mutant into a copy; why what it changes cannot be compiled or imported, empty where it can."""
    if mutant.is_cpp:
        if failed := builds.apply(mutant, copy):
            return failed
        module = CPP_ROOMS[mutant.file.partition("/")[0]]
    else:
        path = copy / "src" / "bellcrank" / mutant.file
        text = path.read_text("utf-8")
        path.write_text(mutant.applied(text), "utf-8")
        for compiled in (path.parent / "__pycache__").glob(f"{path.stem}.*"):
            compiled.unlink()
        module = mutant.file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    command = [sys.executable, "-c", f"import bellcrank.{module}"]
    try:
        done = subprocess.run(command, env=environment(copy), capture_output=True, text=True, timeout=300, check=False)
    except subprocess.TimeoutExpired:
        return "the import never ends"
    return (done.stderr.splitlines() or ["no output"])[-1] if done.returncode else ""


# ---- runs of tests

RUNNING: set[subprocess.Popen[bytes]] = set()
STOPPED = threading.Event()


@dataclass
class Run:
    """One session of pytest: `code` is its exit status, None where a test did not end; `log` its log."""

    code: int | None
    log: list[Record]
    output: str

    @property
    def last_begun(self) -> str:
        """The test that ran at the end."""
        return next((entry["begins"] for entry in reversed(self.log) if "begins" in entry), "collection")


def run_tests(copy: Path, arguments: list[str], tests: list[str] | None, seconds: dict[str, float]) -> Run:
    """Run tests on the package in a copy; `seconds` are the usual durations."""
    log, package = copy / "log.jsonl", copy / "src" / "bellcrank" / "__init__.py"
    log.write_text("", "utf-8")
    (copy / "order.json").write_text(json.dumps({"package": str(package), "tests": tests, "log": str(log)}), "utf-8")
    in_file: defaultdict[str, float] = defaultdict(float)  # a test may have to make what its whole file shares
    for test, duration in seconds.items():
        in_file[test.partition("::")[0]] += duration
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "mutant_session", *arguments]
    with (copy / "output.txt").open("wb") as output:
        process = subprocess.Popen(
            command, cwd=ROOT, env=environment(copy), stdout=output, stderr=subprocess.STDOUT, start_new_session=True
        )
        RUNNING.add(process)
        code: int | None = None
        while code is None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                code = process.wait(1.0)
            if code is None:
                entries = _entries(log)
                usual = in_file[entries[-1].get("begins", "").partition("::")[0]] if entries else 60.0
                if time.time() - log.stat().st_mtime > PATIENCE + 10.0 * usual:
                    break
        _kill(process)
        RUNNING.discard(process)
    if STOPPED.is_set():
        raise SystemExit("stopped")
    return Run(code, _entries(log), (copy / "output.txt").read_text("utf-8", "replace"))


def end_all() -> None:
    """End the sessions that run; what they would have said is not known."""
    STOPPED.set()
    for process in list(RUNNING):
        _kill(process)


def _entries(log: Path) -> list[Record]:
    return [json.loads(line) for line in log.read_text("utf-8").splitlines(keepends=True) if line.endswith("\n")]


def _kill(process: subprocess.Popen[bytes]) -> None:
    """End a session and what it started."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
