"""Let a planar arm go: it swings and keeps its energy, until a damper at the elbow takes it out."""

import bellcrank as bc


def main() -> None:
    free = bc.simulate("planar_2r_swing")
    brake = {"kind": "damper", "joint": "elbow", "coefficient": 20}  # N m s/rad
    damped = bc.simulate("planar_2r_swing", overrides={"forces": [brake], "simulate.duration": 20})
    for run in (free, damped):
        print(run.summary(), end="\n\n")
    lost = damped.total_energy[0] - damped.total_energy[-1]
    print(f"the arm lost {lost:.3f} J, the damper took {-damped.work[-1]:.3f} J")
    assert abs(lost + damped.work[-1]) < 1e-6 * lost
    assert free.energy_drift() < 1e-7


if __name__ == "__main__":
    main()
