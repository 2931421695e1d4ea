"""Compute the gravity torque of a Panda in 200,000 postures of its range, as one batch."""

import time

import numpy as np

import bellcrank as bc


def main() -> None:
    robot = bc.load_robot("panda")
    random = np.random.default_rng(1)
    postures = random.uniform(robot.lower, robot.upper, (200_000, robot.nq))
    robot.gravity_torque(postures[:16])  # the first call compiles
    start = time.perf_counter()
    torque = robot.gravity_torque(postures)
    seconds = time.perf_counter() - start
    worst = np.abs(torque).max(axis=0)
    print(f"{len(postures)} postures in {seconds * 1e3:.1f} ms")
    for name, value in zip(robot.joint_names, worst, strict=True):
        print(f"{name:16} {value:8.2f}")
    assert np.isfinite(torque).all()


if __name__ == "__main__":
    main()
