"""Simulate a planar arm that swings freely, and with a damper, and check its energy; writes planar_2r_swing.html."""

import bellcrank as bc


def main() -> None:
    free = bc.simulate("planar_2r_swing")
    brake = {"kind": "damper", "joint": "elbow", "coefficient": 20}  # N m s/rad
    damped = bc.simulate("planar_2r_swing", overrides={"forces": [brake], "simulate.duration": 20})
    print(free.table())
    lost = damped.total_energy[0] - damped.total_energy[-1]
    print(f"with a damper the arm lost {lost:.3f} J, of which the damper took {-damped.work[-1]:.3f} J")
    print(bc.replay(free, "planar_2r_swing.html", trace=("tip",)))
    assert abs(lost + damped.work[-1]) < 1e-6 * lost
    assert free.energy_drift() < 1e-7


if __name__ == "__main__":
    main()
