"""Size the motors of a planar arm whose tip follows a circle; writes planar_2r_sizing.html."""

import bellcrank as bc


def main() -> None:
    sizing = bc.size("planar_2r")
    for joint in sizing.joints:
        verdict = joint.shaft.verdict if joint.shaft else "no actuator"
        print(f"{joint.name:10} peak {joint.peak_torque:8.2f} {joint.torque_unit}, motor {verdict}")
    print(bc.replay(sizing, "planar_2r_sizing.html"))
    assert sizing.joint("shoulder").peak_torque > sizing.joint("elbow").peak_torque


if __name__ == "__main__":
    main()
