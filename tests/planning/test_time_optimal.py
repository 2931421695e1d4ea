"""The fastest motion along a path against closed forms, quadrature, a linear program and a dynamic programme."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq, linprog

import bellcrank as bc
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage

Array = NDArray[np.float64]
INERTIA, LENGTH, MASS = 0.7, 0.6, 1.3
ROTOR = """<robot name="rotor"><link name="base"/>
<link name="arm"><inertial><origin xyz="{x} 0 0"/><mass value="{mass}"/>
<inertia ixx="0.01" iyy="0.01" izz="{inertia}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-9" upper="9" effort="5" velocity="100"/></joint></robot>"""


def rotor(folder: Path, gravity: float = 0.0, **options: object) -> bc.Robot:
    """A link on a vertical wall, that is a pendulum where there is gravity, of the inertia INERTIA about its hinge."""
    path = folder / "rotor.urdf"
    own = INERTIA - MASS * LENGTH**2
    path.write_text(ROTOR.format(x=LENGTH, mass=MASS, inertia=own))
    return bc.load_robot(path, gravity=(0.0, -gravity, 0.0), **options)  # type: ignore[arg-type]


def fastest(robot: bc.Robot, angle: float, torque: float, **options: object) -> bc.results.FastestMotion:
    path = bc.joint_path(robot, [{}, {"hinge": angle}])
    limits = bc.MotionLimits(speed="none", torque={"hinge": torque})
    return bc.time_optimal(robot, path, limits, costs=False, **options)  # type: ignore[arg-type]


def test_a_pure_inertia_takes_twice_the_root_of_angle_times_inertia_over_torque(tmp_path: Path) -> None:
    found = fastest(rotor(tmp_path), 1.9, 5.0)
    assert found.duration == pytest.approx(2.0 * np.sqrt(1.9 * INERTIA / 5.0), rel=1e-8)
    assert found.motion.duration == pytest.approx(found.duration, rel=1e-12)


def test_a_pendulum_takes_the_time_of_the_quadrature_of_its_energy(tmp_path: Path) -> None:
    weight, torque, angle = MASS * 9.81 * LENGTH, 9.0, 2.2

    def accelerating(s: float) -> float:  # speed² from J ω²/2 = ∫ (τ - m g l cos s) ds
        return 2.0 / INERTIA * (torque * s - weight * np.sin(s))

    def braking(s: float) -> float:
        return 2.0 / INERTIA * (torque * (angle - s) + weight * (np.sin(angle) - np.sin(s)))

    switch = brentq(lambda s: accelerating(s) - braking(s), 1e-3, angle - 1e-3)
    rising = quad(lambda r: 2.0 * r / np.sqrt(accelerating(r * r)), 0.0, np.sqrt(switch), epsabs=1e-13)[0]
    falling = quad(lambda r: 2.0 * r / np.sqrt(braking(angle - r * r)), 0.0, np.sqrt(angle - switch), epsabs=1e-13)[0]
    assert fastest(rotor(tmp_path, gravity=9.81), angle, torque).duration == pytest.approx(rising + falling, rel=1e-8)


def test_viscous_friction_and_a_torque_speed_line_take_the_time_of_an_independent_integration(tmp_path: Path) -> None:
    ratio, viscous, angle, stall, top = 20.0, 0.8, 3.0, 0.5, 200.0
    robot = rotor(tmp_path, friction={"hinge": (viscous, 0.0)})
    actuator = bc.Actuator(
        ratio=ratio, rated_torque=0.2, peak_torque=stall, rated_speed=1e-9, max_speed=top, rotor_inertia=0.0,
        curve=((0.0, stall), (top, 0.0)),
    )  # fmt: skip
    limits = bc.MotionLimits(speed="none", torque="none")
    motion = bc.waypoints(robot, [0.0, 5.0], [{}, {"hinge": angle}])
    mechanism_motion = bc.size(robot, motion, {"hinge": actuator})
    assert mechanism_motion is not None
    found = _with_actuator(robot, motion, actuator, limits)

    def torque(speed: float) -> float:
        return ratio * stall * (1.0 - ratio * speed / top)

    def run(sign: float, speed: float, until: float) -> tuple[float, float]:
        """Time and speed after the way `until`, forward with the most torque, or backward from rest with the least."""

        def rate(_: float, x: Array) -> list[float]:
            push = torque(x[1]) if sign > 0 else -torque(x[1])
            return [x[1], sign * (push - viscous * x[1]) / INERTIA]

        def reached(_: float, x: Array) -> float:
            return float(x[0] - until)

        reached.terminal = True  # type: ignore[attr-defined]
        solved = solve_ivp(rate, (0.0, 50.0), [0.0, speed], events=reached, rtol=1e-12, atol=1e-14, method="DOP853")
        return float(solved.t_events[0][0]), float(solved.y_events[0][0][1])

    switch = brentq(lambda s: run(1.0, 0.0, s)[1] - run(-1.0, 0.0, angle - s)[1], 0.1, angle - 0.05, xtol=1e-13)
    exact = run(1.0, 0.0, switch)[0] + run(-1.0, 0.0, angle - switch)[0]
    assert found.duration == pytest.approx(exact, rel=1e-8)


def _with_actuator(
    robot: bc.Robot, motion: bc.Motion, actuator: bc.Actuator, limits: bc.MotionLimits
) -> bc.results.FastestMotion:
    from bellcrank.dynamics.inverse.mechanism import mechanism_of
    from bellcrank.planning.fastest_pass import fastest_refined
    from bellcrank.planning.joint_path import paths_of_motion
    from bellcrank.planning.limits.path_limits import PathLimits

    bounds = PathLimits(mechanism_of(robot), {"hinge": actuator}, limits)
    timing = fastest_refined(paths_of_motion(motion)[0], bounds)
    return timing  # type: ignore[return-value]


def linear_program_time(robot: bc.Robot, path: bc.JointPath, torque: Array, cells: int) -> float:
    """The time of the reachability passes with a linear program at each place (H. Pham, Q.-C. Pham, 2018)."""
    s = np.linspace(0.0, path.length, cells + 1)
    q, first, second = path.at(s)
    still = np.zeros_like(q)
    c = robot.inverse_dynamics(q, still, still)
    a, b = robot.inverse_dynamics(q, still, first) - c, robot.inverse_dynamics(q, first, second) - c
    step = s[1] - s[0]
    top = np.zeros(cells + 1)
    for i in range(cells - 1, -1, -1):
        rows = np.concatenate([np.column_stack([a[i], b[i]]), -np.column_stack([a[i], b[i]]),
                               [[2.0 * step, 1.0], [-2.0 * step, -1.0]]])  # fmt: skip
        right = np.concatenate([torque - c[i], torque + c[i], [top[i + 1], 0.0]])
        solved = linprog([0.0, -1.0], A_ub=rows, b_ub=right, bounds=[(None, None), (0.0, None)])
        top[i] = solved.x[1]
    x = np.zeros(cells + 1)
    for i in range(cells):
        rows = np.concatenate([a[i], -a[i], [2.0 * step]])[:, None]
        right = np.concatenate([torque - c[i] - b[i] * x[i], torque + c[i] + b[i] * x[i], [top[i + 1] - x[i]]])
        solved = linprog([-1.0], A_ub=rows, b_ub=right, bounds=[(None, None)])
        x[i + 1] = max(0.0, x[i] + 2.0 * step * solved.x[0])
    return float(np.sum(2.0 * step / (np.sqrt(x[1:]) + np.sqrt(x[:-1]))))


@pytest.mark.parametrize(("name", "torque"), [("planar_2r", 70.0), ("ur5", 60.0)])
def test_the_grid_gives_the_time_of_linear_programs(name: str, torque: float) -> None:
    robot = bc.load_robot(name, friction="none")
    rng = np.random.default_rng(7)
    path = bc.joint_path(robot, rng.uniform(-1.0, 1.0, (4, robot.nv)))
    most = np.full(robot.nv, torque)
    limits = bc.MotionLimits(speed="none", torque=dict.fromkeys(robot.joint_names, torque))
    found = bc.time_optimal(robot, path, limits, grid=60, costs=False)
    assert found.duration == pytest.approx(linear_program_time(robot, path, most, 60), rel=1e-7)


def programme_time(robot: bc.Robot, path: bc.JointPath, torque: float, cells: int, levels: int) -> float:
    """A bound of the shortest time from above, by a dynamic programme over speeds: x at each place is one of evenly
    spaced levels, and the acceleration between two is constant and allowed at the beginning of the cell.
    """
    s = np.linspace(0.0, path.length, cells + 1)
    q, first, second = path.at(s)
    step = s[1] - s[0]
    y = np.linspace(0.0, 8.0, levels)
    cost = np.full(levels, np.inf)
    cost[0] = 0.0
    for i in range(cells - 1, -1, -1):
        u = (y[None, :] ** 2 - y[:, None] ** 2) / (2.0 * step)
        n = levels * levels
        v = np.repeat(first[i][None] * y[:, None], levels, axis=0)
        acceleration = first[i] * u.reshape(-1, 1) + second[i] * np.repeat(y**2, levels)[:, None]
        need = robot.inverse_dynamics(np.repeat(q[i][None], n, axis=0), v, acceleration)
        allowed = (np.abs(need) <= torque * (1.0 + 1e-12)).all(axis=1).reshape(levels, levels)
        with np.errstate(divide="ignore"):
            time = 2.0 * step / (y[:, None] + y[None, :])
        cost = np.min(np.where(allowed, time + cost[None, :], np.inf), axis=1)
    return float(cost[0])


@pytest.mark.tier2
def test_no_dynamic_programme_over_speeds_is_faster_with_viscous_friction() -> None:
    robot = bc.load_robot("planar_2r", friction={"shoulder": (6.0, 1.0), "elbow": (4.0, 0.5)})
    path = bc.joint_path(robot, [{}, {"shoulder": 0.7, "elbow": -0.9}, {"shoulder": 1.5, "elbow": 0.2}])
    limits = bc.MotionLimits(speed="none", torque={"shoulder": 80.0, "elbow": 80.0})
    found = bc.time_optimal(robot, path, limits, grid=40, costs=False)
    bound = programme_time(robot, path, 80.0, 40, 300)
    assert found.duration <= bound * (1.0 + 1e-9)
    assert found.duration == pytest.approx(bound, rel=0.03)  # the programme's speeds are rounded to levels


@pytest.mark.tier2
@pytest.mark.parametrize(("name", "motion"), [("planar_2r", "elbow_up"), ("ur5", "circle"), ("geared_pendulum", None),
                                              ("xarm7", "stack"), ("ur5", "pick_and_place")])  # fmt: skip
def test_sizing_the_fastest_motion_finds_no_limit_exceeded_and_one_always_reached(
    name: str, motion: str | None
) -> None:
    scene = bc.load_scene(name)
    found = bc.time_optimal(scene, motion or next(iter(scene.motions)), costs=False)
    sizing = bc.size(scene, [found.motion])
    robot = scene.robot
    uses = []
    for joint in sizing.joints:
        column = robot.one_degree_joint(joint.name, "test").v
        margins = dict(joint.shaft.margins) if joint.shaft else {}
        uses += [1.0 - margins[key] for key in ("peak torque", "motor speed", "peak curve") if margins.get(key)]
        if not joint.shaft:
            uses.append(joint.peak_torque / robot.effort_limit[column])
        uses += [joint.peak_speed / robot.velocity_limit[column]]
    assert max(uses) <= 1.0 + 1e-6
    # of the xArm a torque of the URDF is closer to its limit; by the rounding of one processor or another, the cells
    # of planar_2r are refined otherwise, and the largest use is up to 1.6e-5 below 1
    assert -1e-6 <= found.excess - (max(uses) - 1.0) <= 2e-5
    durations = np.diff(found.time)
    idle = [not name for name in found.active]
    assert np.sum(durations[idle]) <= 1e-6 * found.duration


@pytest.mark.tier2
def test_each_shipped_limit_costs_time_and_more_of_it_saves_time() -> None:
    found = bc.time_optimal("planar_2r", "elbow_down")
    assert all(cost.derivative <= 1e-6 for cost in found.costs)
    total = sum(cost.derivative for cost in found.costs)
    assert -1.3 < total < -0.4  # all torques doubled: the time shrinks by about the root of 2, speeds allowing
    assert sum(cost.share for cost in found.costs) == pytest.approx(1.0, abs=1e-3)


def test_a_motion_that_stops_and_pauses_is_followed_part_by_part() -> None:
    robot = bc.load_robot("planar_2r")
    there = bc.waypoints(robot, [0.0, 2.0], [{}, {"elbow": 1.0}])
    back = bc.waypoints(robot, [0.0, 2.0], [{"elbow": 1.0}, {"shoulder": 0.4}])
    whole = bc.join(there, bc.dwell(robot, {"elbow": 1.0}, 1.0), back)
    found = bc.time_optimal(robot, whole, costs=False)
    parts = [bc.time_optimal(robot, part, costs=False).duration for part in (there, back)]
    assert found.duration == pytest.approx(sum(parts), rel=1e-6)
    assert any("2 parts" in warning for warning in found.warnings)


def test_torques_that_cannot_hold_the_arm_are_refused_with_the_place_and_the_limit(tmp_path: Path) -> None:
    robot = rotor(tmp_path, gravity=9.81)
    with pytest.raises(bc.BellcrankError, match=r"at .* % of the path the torque of hinge"):
        fastest(robot, 1.0, 0.5 * MASS * 9.81 * LENGTH)


def test_a_motion_that_nothing_limits_is_refused() -> None:
    robot = bc.load_robot("planar_2r")
    path = bc.joint_path(robot, [{}, {"shoulder": 1.0}])
    with pytest.raises(bc.InputError, match="nothing limits the motion"):
        bc.time_optimal(robot, path, bc.MotionLimits(speed="none", torque="none"))
    with pytest.raises(bc.InputError, match="nothing limits the acceleration"):
        bc.time_optimal(robot, path, bc.MotionLimits(torque="none"))


def test_forces_that_depend_on_time_are_refused(tmp_path: Path) -> None:
    (tmp_path / "push.csv").write_text("time [s],elbow torque [N m]\n0,0\n1,3\n")
    (tmp_path / "s.yaml").write_text(
        "name: s\nurdf: planar_2r\nforces:\n  - {kind: torque, name: push, joint: elbow, file: push.csv}\n"
        "motions:\n  swing: {kind: waypoints, times: [0, 1], positions: [{}, {elbow: 1}]}\n"
        "simulate: {duration: 1}\n"
    )
    with pytest.raises(bc.InputError, match="depends on time"):
        bc.time_optimal(bc.load_scene(tmp_path / "s.yaml"), "swing")


def test_an_acceleration_of_a_joint_is_kept() -> None:
    robot = bc.load_robot("planar_2r", friction="none")
    path = bc.joint_path(robot, [{}, {"shoulder": 1.0}])
    limits = bc.MotionLimits(speed="none", torque="none", acceleration={"shoulder": 2.0, "elbow": 1.0})
    found = bc.time_optimal(robot, path, limits, costs=False)
    assert found.duration == pytest.approx(2.0 * np.sqrt(0.5), rel=1e-8)
    assert found.warnings == ("no torque limits the motors at shoulder, elbow: none is known",)


def test_a_tool_speed_is_kept() -> None:
    robot = bc.load_robot("planar_2r", friction="none")
    path = bc.joint_path(robot, [{}, {"shoulder": 1.0}])
    limits = bc.MotionLimits(speed="none", torque="none", acceleration={"shoulder": 50.0}, tool="tip", tool_speed=0.5)
    motion = bc.time_optimal(robot, path, limits, costs=False).motion
    speed = np.linalg.norm(robot.frame_velocity("tip", motion.position, motion.velocity)[0], axis=1)
    assert speed.max() == pytest.approx(0.5, rel=1e-6)


def tool_accelerations(robot: bc.Robot, motion: bc.Motion, frame: str) -> tuple[Array, Array]:
    """Linear and angular accelerations (n, 3) of a frame between the rows, by differences of its velocity."""
    step = np.diff(motion.time)
    q, v, a = motion.at(np.concatenate([(motion.time[:-1] + share * step)[step > 0.0] for share in (0.2, 0.5, 0.8)]))
    h = 1e-6
    later, earlier = (robot.frame_velocity(frame, q + sign * h * v, v + sign * h * a) for sign in (1.0, -1.0))
    return (later[0] - earlier[0]) / (2.0 * h), (later[1] - earlier[1]) / (2.0 * h)


def test_the_acceleration_of_a_frame_is_that_of_differences() -> None:
    robot = bc.load_robot("ur5")
    rng = np.random.default_rng(4)
    q, v, a = rng.uniform(-1.0, 1.0, (3, 20, 6))
    linear, angular = robot.frame_acceleration("tool0", q, v, a)
    h = 1e-6
    later, earlier = (robot.frame_velocity("tool0", q + s * (v + 0.5 * s * a), v + s * a) for s in (h, -h))
    assert linear == pytest.approx((later[0] - earlier[0]) / (2.0 * h), abs=1e-8)
    assert angular == pytest.approx((later[1] - earlier[1]) / (2.0 * h), abs=1e-8)


@pytest.mark.tier2
@pytest.mark.parametrize("more", [{}, {"tool_speed": 1.0}, {"torque": {"shoulder": 60.0, "elbow": 40.0}}])
def test_the_acceleration_of_a_tool_is_kept_and_reached(more: dict[str, Any]) -> None:
    robot = bc.load_robot("planar_2r", friction="none")
    path = bc.joint_path(robot, [{}, {"shoulder": 0.7, "elbow": -0.9}, {"shoulder": 1.5, "elbow": 0.2}])
    limits = bc.MotionLimits(**{"speed": "none", "torque": "none", "tool": "tip", "tool_acceleration": 3.0, **more})
    found = bc.time_optimal(robot, path, limits)
    norm = np.linalg.norm(tool_accelerations(robot, found.motion, "tip")[0], axis=1)
    assert norm.max() <= 3.0 * (1.0 + 1e-6)
    assert found.excess <= 1e-6
    if not more:
        assert norm.min() >= 3.0 * (1.0 - 1e-6)  # the only limit is always reached
        assert found.costs[0].derivative == pytest.approx(-0.5, abs=1e-4)  # T is proportional to 1/√a


def test_the_angular_acceleration_of_a_tool_is_kept() -> None:
    robot = bc.load_robot("ur5", friction="none")
    path = bc.joint_path(robot, np.random.default_rng(2).uniform(-1.0, 1.0, (3, 6)))
    limits = bc.MotionLimits(
        speed="none", torque="none", tool="tool0", tool_angular_acceleration=8.0, tool_angular_speed=1.5
    )
    found = bc.time_optimal(robot, path, limits, costs=False)
    norm = np.linalg.norm(tool_accelerations(robot, found.motion, "tool0")[1], axis=1)
    assert norm.max() == pytest.approx(8.0, rel=1e-6)
    angular = np.linalg.norm(robot.frame_velocity("tool0", found.motion.position, found.motion.velocity)[1], axis=1)
    assert angular.max() == pytest.approx(1.5, rel=1e-6)


@pytest.mark.tier2
def test_a_circle_at_a_limited_acceleration_takes_the_time_of_its_closed_form() -> None:
    """u² + x²/r² = a² gives x = a r sin(2 s/r) until x = a r; then the speed stays √(a r)."""
    robot, a, r = bc.load_robot("planar_2r", friction="none"), 3.0, 0.3
    circle = bc.circle(robot, "tip", (1.2, 0.0, 0.0), r, duration=2.0, start={"elbow": 1.0})
    limits = bc.MotionLimits(speed="none", torque="none", tool="tip", tool_acceleration=a)
    rising = np.pi * r / 4.0
    start = quad(lambda w: 2.0 * w / np.sqrt(a * r * np.sin(2.0 * w * w / r)), 0.0, np.sqrt(rising), epsabs=1e-13)[0]
    exact = 2.0 * start + (2.0 * np.pi * r - 2.0 * rising) / np.sqrt(a * r)
    assert bc.time_optimal(robot, circle, limits, costs=False).duration == pytest.approx(exact, rel=1e-7)
    assert bc.time_optimal(robot, circle, limits, grid=2000, costs=False).duration == pytest.approx(exact, rel=2e-3)


def test_a_tool_without_limits_and_limits_without_a_tool_are_refused() -> None:
    for wrong in ({"tool": "tip"}, {"tool_acceleration": 1.0}, {"tool": "tip", "tool_angular_speed": 0.0},
                  {"tool": "tip", "tool_acceleration": np.nan}):  # fmt: skip
        with pytest.raises(bc.InputError, match=r"tool"):
            bc.MotionLimits(**wrong)  # type: ignore[arg-type]


def test_speed_factors_know_the_acceleration_of_a_tool() -> None:
    robot = bc.load_robot("planar_2r", friction="none")
    motion = bc.waypoints(robot, [0.0, 1.0], [{}, {"shoulder": 1.0, "elbow": 0.5}])
    limits = bc.MotionLimits(speed="none", torque="none", tool="tip", tool_acceleration=3.0)
    found = bc.speed_factor(robot, motion, limits)
    assert found.limit == "acceleration of frame tip"
    faster = found.scaled()
    norm = np.linalg.norm(tool_accelerations(robot, faster, "tip")[0], axis=1)
    assert norm.max() == pytest.approx(3.0, rel=1e-4)  # eight samples between two rows


@pytest.mark.tier2
def test_a_path_with_blends_is_passed_without_a_stop() -> None:
    robot = bc.load_robot("planar_2r", friction="none")
    postures = [{}, {"shoulder": 0.7, "elbow": -0.9}, {"shoulder": 1.5, "elbow": 0.2}]
    path = bc.joint_path(robot, postures, blend=0.3)
    limits = bc.MotionLimits(speed="none", torque={"shoulder": 60.0, "elbow": 40.0})
    found = bc.time_optimal(robot, path, limits, costs=False)
    assert found.excess <= 1e-6
    assert found.speed[5:-5].min() > 0.0
    corner = robot.posture(postures[1])
    missed = np.linalg.norm(path.at(np.linspace(0.0, path.length, 20001))[0] - corner, axis=1).min()
    assert 0.0 < missed <= 5.0 / 16.0 * 0.3
    with pytest.raises(bc.InputError, match="longer than half"):
        bc.joint_path(robot, postures, blend=2.0)
    with pytest.raises(bc.InputError, match="no 'parameters'"):
        bc.joint_path(robot, postures, [0.0, 1.0, 2.0], blend=0.1)


@pytest.mark.tier2
def test_the_derivatives_of_the_time_are_those_of_extrapolated_differences() -> None:
    robot = bc.load_robot("planar_2r", friction={"shoulder": (6.0, 1.0), "elbow": (4.0, 0.5)})
    path = bc.joint_path(robot, [{}, {"shoulder": 0.7, "elbow": -0.9}, {"shoulder": 1.5, "elbow": 0.2}])

    def found(limit: str = "", factor: float = 1.0, costs: bool = False) -> bc.results.FastestMotion:
        given = {"speed": {"elbow": 2.0}, "torque": {"shoulder": 80.0, "elbow": 30.0}}
        if limit:
            what, joint = limit.split(" of ")
            given[what][joint] *= factor
        return bc.time_optimal(robot, path, bc.MotionLimits(**given), costs=costs)

    whole = found(costs=True)
    assert len(whole.costs) >= 2
    for cost in whole.costs:
        wide, narrow = (
            (found(cost.limit, 1.0 + h).duration - found(cost.limit, 1.0 - h).duration) / (2.0 * h * whole.duration)
            for h in (0.04, 0.02)
        )
        assert cost.derivative == pytest.approx((4.0 * narrow - wide) / 3.0, abs=3e-3)


@pytest.mark.tier2
def test_a_linkage_that_turns_around_stops_there_and_keeps_its_limits() -> None:
    found = bc.time_optimal("five_bar", "pick", costs=False)
    assert found.excess <= 1e-6
    assert any("3 parts" in warning for warning in found.warnings)
    speed = np.abs(found.motion.velocity).max(axis=1)
    rest = np.flatnonzero(speed <= 1e-9 * speed.max())
    assert len(np.unique(found.motion.time[rest].round(9))) == 4  # begin, end, and twice where it turns around


@pytest.mark.tier2
def test_a_linkage_with_a_floating_platform_moves_along_its_path() -> None:
    linkage = Linkage(bc.load_scene("planar_delta"))
    motion = linkage.motion("pick")
    found = bc.time_optimal("planar_delta", "pick", grid=60, costs=False)
    assert found.motion.nq == motion.nq
    assert found.duration < motion.duration
    assert found.motion.position[-1] == pytest.approx(motion.position[-1], abs=1e-6)


@pytest.mark.parametrize("given", [{"acceleration": {"elbow": 1.0}}, {"tool": "base", "tool_acceleration": 1.0}])
def test_limits_of_what_rests_do_not_count(given: dict[str, Any]) -> None:
    robot = bc.load_robot("planar_2r")
    path = bc.joint_path(robot, [{}, {"shoulder": 1.0}])
    with pytest.raises(bc.InputError, match="nothing limits the acceleration of the motion at 0 %"):
        bc.time_optimal(robot, path, bc.MotionLimits(speed="none", torque="none", **given))


@pytest.mark.parametrize("speed", [1.0, 0.1, 0.01, 1e-4])
def test_short_ramps_at_both_ends_of_a_long_move_take_the_time_of_the_trapezoid(tmp_path: Path, speed: float) -> None:
    arm = rotor(tmp_path)
    limits = bc.MotionLimits(speed={"hinge": speed}, acceleration={"hinge": 2.0}, torque="none")
    found = bc.time_optimal(arm, bc.joint_path(arm, [{}, {"hinge": 1.5}]), limits, costs=False)
    assert found.duration == pytest.approx(1.5 / speed + speed / 2.0, rel=1e-10)


def test_a_stretch_of_the_path_that_nothing_limits_is_refused() -> None:
    arm = bc.load_robot("planar_2r", friction="none")
    path = bc.joint_path(arm, [[0.0, 0.0], [1.0, 0.0], [1.0, 0.02], [2.0, 0.02]], blend=0.005)
    limits = bc.MotionLimits(speed="none", torque="none", acceleration={"shoulder": 1.0})  # the elbow moves alone
    with pytest.raises(bc.InputError, match=r"nothing limits the motion at 49.* %"):
        bc.time_optimal(arm, path, limits, costs=False)


def test_a_urdf_that_gives_0_gives_no_limit(tmp_path: Path) -> None:
    path = tmp_path / "rotor.urdf"
    path.write_text(ROTOR.format(x=LENGTH, mass=MASS, inertia=INERTIA).replace('effort="5"', 'effort="0"'))
    robot = bc.load_robot(path)
    found = bc.time_optimal(
        robot, bc.joint_path(robot, [{}, {"hinge": 1.9}]), bc.MotionLimits(acceleration={"hinge": 5.0}), costs=False
    )
    assert found.duration == pytest.approx(2 * (1.9 / 5.0) ** 0.5, rel=1e-8)  # half of the way faster, half slower


def test_the_error_of_the_time_on_a_grid_is_of_first_order_in_the_cell(tmp_path: Path) -> None:
    robot = rotor(tmp_path, gravity=9.81)
    exact = fastest(robot, 1.9, 12.0).duration
    coarse, middle, fine = (fastest(robot, 1.9, 12.0, grid=cells).duration - exact for cells in (500, 1000, 2000))
    assert 1.9 < coarse / middle < 2.3 and 1.9 < middle / fine < 2.3


@pytest.mark.tier2
@pytest.mark.parametrize(
    "forces",
    [
        [{"kind": "damper", "joint": "elbow", "coefficient": 3.0}],
        [{"kind": "joint_spring", "joint": "elbow", "stiffness": 1e-9, "damping": 3.0}],
    ],
)
def test_a_linear_damper_is_viscous_friction(forces: list[dict[str, Any]]) -> None:
    """A damper of 3 N m s/rad at a joint, and the same coefficient as its friction, give the same fastest motion."""
    friction = bc.load_scene("planar_2r", {"friction": {"elbow": {"viscous": 3.0}}})
    damped = bc.load_scene("planar_2r", {"friction": {"elbow": {"viscous": 0.0}}, "forces": forces})
    plain = bc.load_scene("planar_2r", {"friction": {"elbow": {"viscous": 0.0}}})
    found, expected, without = (
        bc.time_optimal(one, "elbow_up", costs=False).duration for one in (damped, friction, plain)
    )
    assert found == pytest.approx(expected, rel=1e-6)  # the search ends where limits are met to 1e-6
    assert abs(expected - without) > 1e-4 * without
    sizing = bc.size(damped, bc.time_optimal(damped, "elbow_up", costs=False).motion)
    margins = [shaft.margins[key] for _, shaft in sizing.shafts for key in ("peak torque", "motor speed", "peak curve")]
    assert min(margins) > -2e-5


def test_rising_interpolants_are_those_of_scipy() -> None:
    from scipy.interpolate import PchipInterpolator

    from bellcrank.planning.joint_path import _rising

    random = np.random.default_rng(3)
    for count in [*range(2, 12)] * 20:
        x, y = np.cumsum(random.random(count) ** 3 + 1e-2), np.cumsum(random.random(count) ** 4 + 1e-6)
        at = np.linspace(x[0], x[-1], 300)
        found = _rising(x, y)(at)
        np.testing.assert_allclose(found, PchipInterpolator(x, y)(at), rtol=0.0, atol=1e-13 * y[-1])
        assert (np.diff(found) >= -1e-15 * y[-1]).all()
