"""Simulate a thin disk that rolls without slip, from three starts; writes rolling_disk*.html."""

import numpy as np

import bellcrank as bc


def main() -> None:
    for name in ("rolling_disk", "rolling_disk_b", "rolling_disk_c"):
        run = bc.simulate(name)
        x, y, _ = run.position[-1, :3]
        normal, *friction = run.constraint("floor").multipliers.T
        demand = (np.linalg.norm(friction, axis=0) / normal).max()
        print(f"{name}: ends at ({x:.6f}, {y:.6f}) m, coefficient of friction needed: {demand:.3f}")
        print(f"energy drift {run.energy_drift():.0e}")
        print(bc.replay(run, f"{name}.html"))
        assert run.velocity_residual() < 1e-10  # no slip


if __name__ == "__main__":
    main()
