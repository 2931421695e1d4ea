"""Simulate a mass on a spring with several stiffnesses, and save a run; writes spring_pendulum.html."""

import tempfile
from pathlib import Path

import numpy as np

import bellcrank as bc


def main() -> None:
    run = bc.simulate("spring_pendulum")
    print(f"the spring pulls with up to {-run.output('spring_force').min():.1f} N; drift {run.energy_drift():.0e}")
    print(f"error of the positions: about {run.error_estimate():.1e}")
    for stiffness in ("10 N/m", "15 N/m", "40 N/m"):
        changed = bc.simulate("spring_pendulum", overrides={"forces.spring.stiffness": stiffness})
        slide = changed.joint("slide").position
        print(f"{stiffness:>7}: length {slide.min():.2f} m to {slide.max():.2f} m")
        assert changed.energy_drift() < 1e-8
    with tempfile.TemporaryDirectory() as folder:  # a run is a file, with its scene and robot in it
        again = bc.load_run(run.save(Path(folder) / "run.npz"))
        assert np.array_equal(again.position, run.position)
    print(bc.replay(run, "spring_pendulum.html"))


if __name__ == "__main__":
    main()
