"""Random scenes with dry friction, rigid stops and brakes, against the enumeration of modes and dense impacts.

Even seeds are chains of 1 to 5 joints, most with dry friction: rows against the enumeration of all modes, by dense
solves. Odd seeds are arms of 2 to 4 joints with stops, some with friction and brakes that come and go: energy never
rises, no stop is penetrated, stops only push, and the first impact is that of a dense solution.

python -m tests.campaigns.hybrid_scenes --cases 10000 --seed 1
"""

import argparse
import os
import tempfile
from pathlib import Path

from tests.simulation.test_dry_friction import check_chain
from tests.simulation.test_joint_stops import check_arm


def main():
    """Run the cases and print what was found."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    os.environ["BELLCRANK_CACHE"] = "off"  # thousands of kernels that nobody needs again
    wrong, impacts = [], 0
    for k in range(given.cases):
        seed = given.seed * 1_000_000 + k
        with tempfile.TemporaryDirectory() as folder:
            try:
                if k % 2:
                    impacts += check_arm(Path(folder), seed)
                else:
                    check_chain(Path(folder), seed)
            except Exception as error:
                wrong.append(seed)
                print(f"seed {seed}: {type(error).__name__}: {str(error)[:300]}", flush=True)
        if (k + 1) % 100 == 0:
            print(f"{k + 1} scenes, {impacts} impacts, {len(wrong)} wrong", flush=True)
    print(f"{given.cases} scenes, {impacts} impacts, {len(wrong)} wrong: {wrong}")


if __name__ == "__main__":
    main()
