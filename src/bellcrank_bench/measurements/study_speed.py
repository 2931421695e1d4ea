"""The time of whole studies: `bellcrank sweep` with its files in a new process, and sizings of many designs."""

from __future__ import annotations

import resource
import subprocess
import sys
from functools import partial

import numpy as np

from bellcrank.errors import BellcrankError
from bellcrank.files.temporaries import temporary_folder
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.sizing.size import size
from bellcrank.studies.execution.design_runner import DesignRunner
from bellcrank.studies.results.sizing_measures import measures_of
from bellcrank.studies.sweep_plan import SampleRequest, plan_sizings
from bellcrank_bench.measurements.ensemble_row import Duration, EnsembleRow, best_in_turns, clocked, thread_count
from bellcrank_bench.measurements.ensemble_speed import THREADS, TOLERANCE, VARIED, Ensemble

SIZED = {  # what the sized designs of ur5 differ in
    "joint.elbow_joint.origin.z": "uniform(0.38 m, 0.47 m)",
    "joint.wrist_1_joint.origin.z": "uniform(0.35 m, 0.43 m)",
    "payload.mass": "uniform(1 kg, 6 kg)",
    "actuators.elbow_joint.ratio": "uniform(80, 130)",
}
LENGTHS = (0.425, 0.39225)  # m, of the URDF's elbow_joint and wrist_1_joint, which `size` cannot change
PAYLOAD, RATIO = 5.0, 90.0  # kg, and of the elbow's gear, of the design that is compared with `size`
CALLS = 20  # of size


def study_rows(designs: int) -> list[EnsembleRow]:
    """`bellcrank sweep` of so many four-bars until they lock, in a new process, its start and files included.

    A sweep of few designs is run before: it fills the cache of compiled code.
    """
    base = Ensemble("four_bar", 1).lone()
    _study(64, base)
    return [_study(designs, base)]


def _study(designs: int, base: Duration) -> EnsembleRow:
    path, drawn = VARIED["four_bar"]
    with temporary_folder("bench") as folder:
        command = [
            sys.executable, "-m", "bellcrank", "sweep", "four_bar", "--vary", f"{path}={drawn}",
            "--sample", str(designs), "--method", "random", "--threads", str(THREADS), "--no-plots",
            "--set", f"simulate.rtol={TOLERANCE}", "--set", f"simulate.atol={TOLERANCE}",
            "--out", str(folder / "study"),
        ]  # fmt: skip
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = clocked(lambda: _run(command)).seconds
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        size_on_disk = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    memory = after.ru_maxrss * 1024 / 1e9  # the largest child so far
    return EnsembleRow(
        subject=f"{designs:,} four-bars",
        tool="bellcrank sweep",
        setting=thread_count(THREADS),
        time=Duration(seconds, cpu) / designs,
        base=base,
        note=f"{seconds:.2f} s in all, {cpu:.2f} s of CPU time, at most {memory:.2f} GB, "
        f"{size_on_disk / 1e6:.0f} MB of files; a new process, its start included",
    )


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise BellcrankError(f"'bellcrank sweep' failed: {''.join(done.stderr.strip().splitlines()[-1:])}")


def sizing_rows(designs: int, repeats: int) -> list[EnsembleRow]:
    """Sizings of so many UR5 over its motions, next to warm calls of `size` of its configuration."""
    scene = load_scene("ur5")
    plan = plan_sizings(scene, SIZED, SampleRequest(designs, "random", 0))
    runner, values = plan.runner, plan.space.values()
    error = _sizing_error(runner, scene)

    def calls() -> None:
        for _ in range(CALLS):
            size(scene)

    def sized(threads: int) -> Duration:
        return clocked(lambda: runner.run(values, threads=threads)) / designs

    one, *many = best_in_turns([lambda: clocked(calls) / CALLS, *(partial(sized, k) for k in (1, THREADS))], repeats)
    rows = [
        EnsembleRow(
            subject="ur5", tool="sizings of designs", setting=thread_count(threads), time=time, base=one,
            error=error, note=f"{designs:,} designs; error: of peak torques from size(), relative",
        )
        for threads, time in zip((1, THREADS), many, strict=True)
    ]  # fmt: skip
    first = EnsembleRow(subject="ur5", tool="size()", setting=f"{CALLS} warm calls", time=one, base=one)
    return [first, *rows]


def _sizing_error(runner: DesignRunner, scene: Scene) -> float:
    """Largest relative difference of peak torques from those of `size`, for one changed payload and ratio."""
    expected = measures_of(size(scene, overrides={"payloads.1.mass": PAYLOAD, "actuators.elbow_joint.ratio": RATIO}))
    found = runner.run(np.array([[*LENGTHS, PAYLOAD, RATIO]])).measures
    peaks = [name for name in expected if name.endswith(".peak_torque")]
    return max(abs(float(found[name][0]) / expected[name] - 1.0) for name in peaks)
