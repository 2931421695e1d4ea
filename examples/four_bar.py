"""Simulate a four-bar linkage until it locks, and sweep the length of its crank; writes four_bar.html."""

import numpy as np

import bellcrank as bc


def main() -> None:
    run = bc.simulate("four_bar")
    lock = run.events[-1]
    print(f"{lock.name} at {lock.time:.9f} s, crank at {np.degrees(lock.position[0]):.6f} deg")
    first, last = np.linalg.norm(run.multipliers[[0, -1]], axis=1)
    print(f"force in the pin: {first:.1f} N at the start, {last:.1f} N at the lock")
    designs = bc.sweep("four_bar", {"crank_length": np.linspace(1.21, 1.24, 7)})
    print(designs.table())
    print(bc.replay(run, "four_bar.html"))
    assert abs(lock.time - 12.267788975800) < 1e-7
    assert run.constraint_residual() < 1e-12


if __name__ == "__main__":
    main()
