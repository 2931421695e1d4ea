"""Size the motors of a UR5 that draws a circle, and see what a payload costs."""

import bellcrank as bc


def main() -> None:
    start = {"shoulder_lift_joint": -1.7, "elbow_joint": 1.6, "wrist_1_joint": -1.4, "wrist_2_joint": -1.57}
    peaks = {}
    for mass in (0.0, 3.0):
        payloads = [bc.Payload(mass, "tool0", cg=(0.0, 0.0, 0.08))] if mass else []
        robot = bc.load_robot("ur5", payloads=payloads)
        motion = bc.circle(
            robot, frame="tool0", center=(0.45, 0.1, 0.35), radius=0.15, duration=3.0, profile="s_curve", start=start,
            orientation="hold",
        )  # fmt: skip
        sizing = bc.size(robot, motion)
        peaks[mass] = {name: sizing.joint(name).peak_torque for name in robot.joint_names}
    print(f"{'joint':22} {'empty [N m]':>12} {'3 kg [N m]':>12}")
    for name, torque in peaks[0.0].items():
        print(f"{name:22} {torque:12.2f} {peaks[3.0][name]:12.2f}")
    assert peaks[3.0]["shoulder_lift_joint"] > peaks[0.0]["shoulder_lift_joint"]


if __name__ == "__main__":
    main()
