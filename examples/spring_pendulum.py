"""A mass on a spring swings and bounces: simulate a shipped scene, change it, keep the run in a file and load it."""

import tempfile
from pathlib import Path

import numpy as np

import bellcrank as bc


def main() -> None:
    scene = bc.load_scene("spring_pendulum")
    run = bc.simulate(scene)
    print(run.summary())
    print(f"the spring pulls with up to {-run.output('spring_force').min():.1f} N")
    print(f"positions are off by about {run.error_estimate():.1e}")
    for stiffness in ("10 N/m", "15 N/m", "40 N/m"):
        changed = bc.simulate(scene, overrides={"forces.spring.stiffness": stiffness})
        slide = changed.joint("slide").position
        print(f"{stiffness:>7}: length {slide.min():.2f} m to {slide.max():.2f} m, drift {changed.energy_drift():.0e}")
        assert changed.energy_drift() < 1e-8
    with tempfile.TemporaryDirectory() as folder:
        again = bc.load_run(run.save(Path(folder) / "run.npz"))
        run.plot(Path(folder) / "run.png")
        assert np.array_equal(again.position, run.position) and again.energy_drift() == run.energy_drift()


if __name__ == "__main__":
    main()
