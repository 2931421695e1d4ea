"""Random scenes with dry friction, rigid stops and brakes, against the enumeration of modes and dense impacts.

In turn: chains of 1 to 5 joints, most with dry friction, whose rows are compared with the enumeration of all modes, by
dense solves; arms of 2 to 4 joints with stops, some with friction and brakes that come and go, in which energy never
rises, no stop is penetrated, stops only push, and the first impact is that of a dense solution; and four-bars with
friction in all four pins, against the enumeration of modes with a dense KKT system; and chains behind rigid gears with
losses by load, against the enumeration of their sides, half of them with stops, in which no impact raises the energy;
and chains behind rigid gears with backlash, against the enumeration of their modes.

python -m tests.campaigns.hybrid_scenes --cases 10000 --seed 1
"""

import argparse
import os
import tempfile
from pathlib import Path

from tests.simulation.test_dry_friction import check_chain
from tests.simulation.test_gear_losses import check_geared, check_geared_stops
from tests.simulation.test_joint_stops import check_arm
from tests.simulation.test_pin_friction import check_random_four_bar
from tests.simulation.test_rigid_backlash import check_rattling

CHECKS = (
    check_chain,
    check_arm,
    check_random_four_bar,
    check_geared,
    check_arm,
    check_rattling,
    check_chain,
    check_geared_stops,
)


def main():
    """Run the cases and print what was found."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="go on from this case")
    given = parser.parse_args()
    os.environ["BELLCRANK_CACHE"] = "off"  # thousands of kernels that nobody needs again
    wrong, impacts = [], 0
    for k in range(given.first, given.cases):
        seed = given.seed * 1_000_000 + k
        with tempfile.TemporaryDirectory() as folder:
            try:
                check = CHECKS[k % len(CHECKS)]
                impacts += check(Path(folder), seed) or 0
            except Exception as error:
                wrong.append(seed)
                print(f"seed {seed}: {type(error).__name__}: {str(error)[:300]}", flush=True)
        if (k + 1) % 100 == 0:
            print(f"{k + 1} scenes, {impacts} impacts, {len(wrong)} wrong", flush=True)
    print(f"{given.cases} scenes, {impacts} impacts, {len(wrong)} wrong: {wrong}")


if __name__ == "__main__":
    main()
