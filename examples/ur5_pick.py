"""Size the motors of a UR5 that carries 3 kg from one box to another, and without it; writes ur5_pick.html."""

import bellcrank as bc


def main() -> None:
    sizing = bc.size("ur5", "pick_and_place")
    without = bc.size("ur5", "pick_and_place", overrides={"payloads": []})
    print(f"{'joint':22} {'empty [N m]':>12} {'3 kg [N m]':>12}  motor")
    for joint in sizing.joints:
        light = without.joint(joint.name).peak_torque
        print(f"{joint.name:22} {light:12.2f} {joint.peak_torque:12.2f}  {joint.shaft.verdict if joint.shaft else ''}")
    print(bc.replay(sizing, "ur5_pick.html"))
    assert sizing.joint("elbow_joint").peak_torque > without.joint("elbow_joint").peak_torque


if __name__ == "__main__":
    main()
