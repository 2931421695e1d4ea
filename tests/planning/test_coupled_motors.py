"""The fastest motion and the speed factor of motors that move several joints together, against sizings."""

import pytest
from coupled_robots import WRIST

import bellcrank as bc
from bellcrank.planning.speed_scaling import scaled_motion

SHAFT = "efficiency: 0.8, rotor_inertia: 2.0e-5, rated_torque: 0.3, peak_torque: 0.6, rated_speed: 3000 rpm"
MOTION = (
    "{kind: waypoints, times: [0, 0.5, 1], "
    "positions: [{pitch: 0, roll: 0}, {pitch: 1, roll: -0.6}, {pitch: 0.2, roll: 1}]}"
)
FREE = bc.MotionLimits(speed="none", torque="none")


def robot(folder, name, ratios, transmission=""):
    """The wrist with a motor of a ratio on each axis."""
    (folder / "wrist.urdf").write_text(WRIST)
    actuators = ", ".join(f"{axis}: {{ratio: {ratio}, {SHAFT}, max_speed: 4500 rpm}}" for axis, ratio in ratios.items())
    friction = "friction: {pitch: {coulomb: 0.2, viscous: 0.05}, roll: {coulomb: 0.1, viscous: 0.02}}"
    text = f"urdf: wrist.urdf\n{friction}\nmotions: {{go: {MOTION}}}\nactuators: {{{actuators}}}\n{transmission}"
    path = folder / f"{name}.yaml"
    path.write_text(text)
    return path


def differential(folder):
    """Both joints moved by two motors."""
    matrix = "transmissions:\n  - {joints: [pitch, roll], motors: [left, right], matrix: [[1, 0.7], [1, -0.7]]}\n"
    return robot(folder, "differential", {"left": 20, "right": 25}, matrix)


def largest_use(path, motion, folder):
    """Of peak torque, torque over speed, and speed of all motors, by `judge`."""
    judged = bc.judge(path, motions=[motion], trust=folder)
    names = ("peak torque", "peak curve", "motor speed")
    return max(each.use for one in judged.drives for each in one.criteria if each.name in names)


def test_the_fastest_motion_of_a_differential_uses_its_motors_up_to_their_limits(tmp_path) -> None:
    path = differential(tmp_path)
    found = bc.time_optimal(path, "go", FREE)
    # Limits are kept to 1e-6 between rows, and `judge` reads a peak between rows to about as much.
    assert 1.0 - 1e-4 < largest_use(path, found.motion, tmp_path) < 1.0 + 2e-6
    assert {name.split(" of ")[1].split(" ")[0] for name in found.active if "motor" in name} == {"left", "right"}
    assert found.lower_bound <= found.duration * (1.0 + 1e-12) and found.duration - found.lower_bound < 1e-3


@pytest.mark.tier2
def test_a_belt_is_a_gear_with_its_ratio(tmp_path) -> None:
    belts = "".join(
        f"  - {{joints: [{joint}], motors: [{joint}_motor], matrix: [[{ratio}]]}}\n"
        for joint, ratio in (("pitch", 2.0), ("roll", -1.6))
    )
    path = robot(tmp_path, "belts", {"pitch_motor": 10, "roll_motor": 12.5}, f"transmissions:\n{belts}")
    plain = robot(tmp_path, "plain", {"pitch": 20, "roll": 20})
    for limits in (FREE, bc.MotionLimits(speed={"pitch": 4.0}, torque={"roll": 6.0})):
        fastest = [bc.time_optimal(one, "go", limits, costs=False).duration for one in (path, plain)]
        assert fastest[0] == pytest.approx(fastest[1], rel=1e-7)
        factors = [bc.speed_factor(one, "go", limits).factor for one in (path, plain)]
        assert factors[0] == pytest.approx(factors[1], rel=1e-9)


def test_the_speed_factor_of_a_differential_is_where_judge_finds_a_limit_reached(tmp_path) -> None:
    path = differential(tmp_path)
    found = bc.speed_factor(path, "go", FREE)
    assert found.limit.startswith("motor") and found.limit.endswith(("left", "right"))
    for factor in (1.0 - 1e-8, 1.0, 1.0 + 1e-8):
        use = largest_use(path, scaled_motion(found.motion, found.factor * factor), tmp_path)
        assert use == pytest.approx(1.0, abs=3e-7)
    assert largest_use(path, scaled_motion(found.motion, found.factor * 0.99), tmp_path) < 1.0
    assert largest_use(path, scaled_motion(found.motion, found.factor * 1.01), tmp_path) > 1.005
