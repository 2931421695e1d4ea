"""Simulate Bricard's linkage, in which one row of the constraints is redundant; writes bricard.html."""

import numpy as np

import bellcrank as bc
from bellcrank.dynamics.equations.system import system_of

P3 = (0.9999999977, -1.000067258, 0.99993274)  # m at 5 s, IFToMM's benchmark problem A04


def main() -> None:
    run = bc.simulate("bricard")
    rank = run.constraint_rank()
    print(f"rank {rank.rank} of {len(system_of(run.scene).multiplier_names)} rows, drift {run.energy_drift():.0e}")
    at_five = bc.simulate("bricard", times=[5.0], duration=5.0).output("P3")[0]
    print(f"error of P3 at 5 s: {np.abs(at_five - P3).max():.1e} m")
    print(bc.replay(run, "bricard.html"))
    assert np.abs(at_five - P3).max() < 1e-6


if __name__ == "__main__":
    main()
