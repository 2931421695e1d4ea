"""Size both motors of a five-bar robot, a closed linkage, over a pick; writes five_bar_sizing.html."""

import bellcrank as bc


def main() -> None:
    sizing = bc.size("five_bar", "pick")  # the motors' motion is given, the elbows follow
    for joint in sizing.joints:
        margin = "no limit" if joint.effort_margin is None else f"{joint.effort_margin:+.0%}"
        print(f"{joint.name:12} peak {joint.peak_torque:.3f} N m, {joint.peak_speed:.2f} rad/s, margin {margin}")
    print(bc.replay(sizing, "five_bar_sizing.html"))
    assert {joint.name for joint in sizing.joints} == {"left_motor", "right_motor"}


if __name__ == "__main__":
    main()
