"""How long commands take until their files are complete, beside a bare script that saves one PNG with Matplotlib.

Each command is run once to fill the cache, then all are run in turn, and the median counts; the time ends when the
process and all its children have ended. Ratios compare machines and versions, seconds do not.

python docs/tools/command_times.py --repeats 5
"""

import argparse
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

BARE = """
import numpy as np
import matplotlib
matplotlib.use("Agg")
import matplotlib.pyplot as plt
x = np.linspace(0.0, 1.0, 1000)
figure, axes = plt.subplots()
axes.plot(x, np.sin(20.0 * x))
axes.set_xlabel("time [s]")
figure.savefig("bare.png")
"""
COMMANDS = (
    "simulate four_bar", "size planar_2r", "size ur5", "modes two_wheeler", "check ur5", "fastest ur5",
    "judge geared_pendulum", "select ur5",
)  # fmt: skip


def seconds(command: list[str], folder: Path) -> float:
    """The time of a command; the pipe closes when the last child that holds it ends."""
    begun = time.perf_counter()
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
        assert process.stdout is not None
        process.stdout.read()
    return time.perf_counter() - begun


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("commands", nargs="*", default=COMMANDS)
    parser.add_argument("--repeats", type=int, default=5)
    given = parser.parse_args()
    program = [sys.executable, "-m", "bellcrank"]
    jobs = {"bare script": [sys.executable, "-c", BARE]}
    for text in given.commands:
        jobs[text] = [*program, *text.split()]
        without = {"check": "", "judge": "", "modes": "--no-page"}.get(text.split()[0], "--no-plots")
        if without:
            jobs[f"{text} {without}"] = [*jobs[text], without]
    found: dict[str, list[float]] = {name: [] for name in jobs}
    for turn in range(given.repeats + 1):
        for name, command in jobs.items():
            folder = Path(tempfile.mkdtemp())
            taken = seconds(command, folder)
            shutil.rmtree(folder)
            if turn:
                found[name].append(taken)
    bare = statistics.median(found["bare script"])
    for name, times in found.items():
        middle = statistics.median(times)
        print(f"{name:32} {middle:6.2f} s {middle / bare:6.2f} x the bare script")


if __name__ == "__main__":
    main()
