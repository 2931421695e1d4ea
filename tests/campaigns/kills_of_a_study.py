"""A study killed at random moments, again and again: nothing that was kept is lost, and the table is the same.

PYTHONPATH=tests/support python -m tests.campaigns.kills_of_a_study --cases 50 --seed 2
"""

import argparse
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import small_study

DESIGNS = 40_000


def check(folder, kills, seed):
    """Assert what this module says of a study in an empty folder."""
    killed, lines = killed_again_and_again(folder, kills, seed)
    assert killed == kills
    found = [int(line.split()[1]) for line in lines if "were done before" in line]
    assert found and found[0] > 0
    assert lines[-1] == f"digest {small_study.digest(small_study.expected_columns(DESIGNS))}"
    assert list(folder.iterdir()) == []  # no half file either


def killed_again_and_again(folder, kills, seed):
    """Kill a process that runs a study, at random moments; returns what the last one, which is left alone, says."""
    chance = random.Random(seed)
    window = 0.2  # s after a line of its output in which a process is killed
    seconds = str((0.25 * kills + 2.0) / DESIGNS)  # of a design: longer in all than the processes live
    command = [sys.executable, small_study.__file__, str(folder), str(DESIGNS), seconds, "0.01"]
    kept, killed = 0, 0
    while True:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        lines = []
        if killed < kills:
            awaited = chance.choice(["begun", "running", "kept"]) if killed < kills - 1 else "kept"
            while not lines or (lines[-1] and not lines[-1].startswith(awaited)):
                lines.append(process.stdout.readline())
            time.sleep(chance.uniform(0.0, window))
            process.send_signal(signal.SIGKILL)
        out, _ = process.communicate()
        lines += out.splitlines()
        found = [int(line.split()[1]) for line in lines if "were done before" in line]
        if "running" in (line.strip() for line in lines):
            assert max(found, default=0) >= kept, "rows that were kept are lost"
        assert not any("damaged" in line for line in lines), lines
        kept = max([int(line.split()[1]) for line in lines if line.startswith("kept ")], default=kept)
        if process.returncode == 0:
            return killed, lines
        assert process.returncode == -signal.SIGKILL
        killed += 1


def main():
    """Kill one study as often as asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=50, help="kills")
    parser.add_argument("--seed", type=int, default=2)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        check(Path(folder), given.cases, given.seed)
    print(f"{given.cases} kills: no row that was kept is lost, and the table is the same")


if __name__ == "__main__":
    main()
