"""Motions of joints and of frames, against closed forms, SciPy's polynomials and the kinematics of plain Pinocchio."""

from itertools import pairwise

import numpy as np
import pinocchio
import pytest
from machine import SEED, wandering
from path_profiles import fastest, stretched
from properties.dynamics import close
from scipy.interpolate import BPoly

import bellcrank as bc

LIMITS = {"speed": 0.45, "acceleration": 1.7, "jerk": 23.0}  # m, or rad, in SI units
KEPT = {"constant": 1, "trapezoid": 2, "quintic": 3, "s_curve": 3}  # how many of the limits a profile keeps


class JointMotions:
    """Of a tree with joints of one degree of freedom."""

    @pytest.fixture(scope="class")
    def wander(self, robot):
        return wandering(robot)

    def test_waypoints_are_the_quintic_spline_at_rest_at_both_ends(self, robot, wander):
        """Degree 5 between waypoints, four times differentiable at them: solved from these conditions."""
        random, columns = np.random.default_rng(SEED), [j.q for j in robot.joints if j.nv == 1]
        values, knots = random.uniform(-0.8, 0.8, (5, len(columns))), np.array([0.0, 0.4, 0.9, 1.3, 2.0])
        places = [j.v for j in robot.joints if j.nv == 1]
        pieces = spline(knots, values)
        k = np.clip(np.searchsorted(knots, wander.time, side="right") - 1, 0, 3)
        for order, found in enumerate((wander.position[:, columns], wander.velocity, wander.acceleration)):
            expected = [powers(t - knots[i], order) @ pieces[i] for t, i in zip(wander.time, k, strict=True)]
            close(found if order == 0 else found[:, places], expected, 1e-10)
        assert set(knots) <= set(wander.time) and len(wander.time) >= 61
        others = [i for i in range(robot.nq) if i not in columns]
        assert np.array_equal(wander.position[:, others], np.tile(robot.neutral[others], (len(wander), 1)))

    def test_between_rows_a_motion_is_the_quintic_of_its_rows(self, robot, wander):
        columns, places = ([getattr(j, key) for j in robot.joints if j.nv == 1] for key in "qv")
        derivatives = np.stack(
            [wander.position[:, columns], wander.velocity[:, places], wander.acceleration[:, places]], axis=1
        )
        polynomial = BPoly.from_derivatives(wander.time, list(derivatives))
        times = np.random.default_rng(3).uniform(0.0, wander.duration, 40)
        for order, found in enumerate(wander.at(times)):
            own = found[:, columns if order == 0 else places]
            assert own == pytest.approx(polynomial(times, order), rel=1e-9, abs=1e-9)
        for k in (0, 17, -1):
            for found, rows in zip(wander.at(wander.time[k]), (wander.position, wander.velocity), strict=False):
                assert np.array_equal(found, rows[k])

    @pytest.mark.parametrize("profile", ["trapezoid", "s_curve"])
    def test_point_to_point_is_the_fastest_along_straight_lines(self, robot, profile):
        """All joints in step, and in each interval one joint at a limit; the closed form of each stretch."""
        limits = joint_limits(robot, profile)
        postures, share = targets(robot), 0.8
        move = bc.point_to_point(robot, postures, profile=profile, share=share, samples=101, **limits)
        columns, places = ([getattr(j, key) for j in robot.joints if j.nv == 1] for key in "qv")
        begin = 0.0
        for start, end in pairwise([robot.posture(p)[columns] for p in postures]):
            way = end - start
            bounds = [
                min(share * limits[key][name] / abs(d) for name, d in zip(robot.joint_names, way, strict=True) if d)
                for key in limits
            ]
            duration, course = fastest(profile, 1.0, *bounds)
            rows = (move.time >= begin - 1e-12) & (move.time <= begin + duration + 1e-12)
            inside = rows & (np.abs(move.time - begin) > 1e-9) & (np.abs(move.time - begin - duration) > 1e-9)
            s, v, a = course(move.time[inside] - begin)
            assert move.position[np.ix_(inside, columns)] == pytest.approx(start + np.outer(s, way), abs=1e-12)
            assert move.velocity[np.ix_(inside, places)] == pytest.approx(np.outer(v, way), abs=1e-11)
            if profile == "s_curve":
                assert move.acceleration[np.ix_(inside, places)] == pytest.approx(np.outer(a, way), abs=1e-9)
            begin += duration
        assert move.duration == pytest.approx(begin, rel=1e-12)
        assert move.position[-1, columns] == pytest.approx(end, abs=1e-15)
        consistent(move.time, move.position[:, columns], move.velocity[:, places], move.acceleration[:, places])
        if profile == "trapezoid":  # each jump of the acceleration is a time that stands twice
            twice = np.flatnonzero(np.diff(move.time) == 0.0)
            assert len(twice) == len(move.pieces) - 1 >= 2
            assert np.abs(np.diff(move.acceleration, axis=0)[twice]).max(axis=1).min() > 1e-6

    @pytest.mark.parametrize("profile", ["trapezoid", "s_curve"])
    def test_blends_keep_the_limits_and_miss_the_posture_by_the_closed_form(self, robot, profile):
        """At its middle a blend r is 5/32 r |f − e| from the corner between the directions e and f."""
        limits = joint_limits(robot, profile)
        postures = targets(robot)
        columns, places = ([getattr(j, key) for j in robot.joints if j.nv == 1] for key in "qv")
        points = [robot.posture(p)[columns] for p in postures]
        e, f = (b - a for a, b in pairwise(points))
        blend = 0.3 * min(np.linalg.norm(e), np.linalg.norm(f))
        e, f = e / np.linalg.norm(e), f / np.linalg.norm(f)
        move = bc.point_to_point(robot, postures, profile=profile, blend=blend, samples=2001, **limits)
        missed = np.linalg.norm(move.position[:, columns] - points[1], axis=1)
        near = np.clip(np.argmin(missed) + np.array([-1, 1]), 0, len(move) - 1)
        close_by = move.at(np.linspace(*move.time[near], 401))[0][:, columns]
        least = np.linalg.norm(close_by - points[1], axis=1).min()
        assert least == pytest.approx(5.0 / 32.0 * blend * np.linalg.norm(f - e), rel=1e-6)
        assert np.abs(move.velocity).max(axis=1)[1:-1].min() > 0.0  # it does not stop
        consistent(move.time, move.position[:, columns], move.velocity[:, places], move.acceleration[:, places])
        used = []
        for key, rows in (("speed", move.velocity), ("acceleration", move.acceleration)):
            most = np.array([limits[key][name] for name in robot.joint_names])
            used.append((np.abs(rows[:, places]) / most).max())
        if profile == "s_curve":
            step = np.diff(move.time)
            jerk = np.diff(move.acceleration[:, places], axis=0)[step > 1e-9] / step[step > 1e-9, None]
            used.append((np.abs(jerk) / [limits["jerk"][name] for name in robot.joint_names]).max())
        assert max(used) <= 1.0 + 1e-6 and max(used) > 0.999
        outside = missed > 1.001 * blend  # straight lines
        behind = (move.position[:, columns] - points[1]) @ f > (move.position[:, columns] - points[1]) @ -e
        for side, direction in ((~behind, e), (behind, f)):
            away = (move.position[:, columns] - points[1])[outside & side]
            assert np.abs(away - np.outer(away @ direction, direction)).max() < 1e-12

    def test_joined_motions_follow_each_other_with_a_rest_between(self, robot, wander):
        last = wander.position[-1]
        still = bc.dwell(robot, last, 0.7)
        assert still.duration == 0.7 and len(still) == 2
        assert np.array_equal(still.position, [last, last]) and not still.velocity.any()
        columns = [j.q for j in robot.joints if j.nv == 1]
        on = bc.waypoints(robot, [3.0, 3.5], [last, robot.neutral], samples=21)
        whole = bc.join(wander, still, on)
        assert whole.duration == pytest.approx(2.0 + 0.7 + 0.5, rel=1e-15)
        for part, begin in ((wander, 0.0), (still, 2.0), (on, 2.7)):
            middle = part.time[0] + 0.37 * part.duration
            for found, expected in zip(whole.at(begin + 0.37 * part.duration), part.at(middle), strict=True):
                assert found == pytest.approx(expected, abs=1e-10)
        assert np.array_equal((wander + still).position, bc.join(wander, still).position)
        if columns:
            gap = robot.neutral.copy()
            gap[columns] = last[columns] + 2e-6
            with pytest.raises(bc.InputError, match="cannot be joined"):
                bc.join(wander, bc.dwell(robot, gap, 1.0))

    def test_files_give_a_motion_back_bit_by_bit_and_in_other_units(self, robot, wander, tmp_path):
        path = bc.write_motion(wander, tmp_path / "motion.csv")
        again = bc.read_motion(robot, path)
        for key in ("time", "position", "velocity", "acceleration"):
            assert np.array_equal(getattr(again, key), getattr(wander, key)), key
        joint = next(j for j in robot.joints if j.nv == 1)
        head, *rows = path.read_text().splitlines()
        titles = head.split(",")
        slides = joint.kind == "prismatic"
        unit, factor = ("mm", 1e3) if slides else ("deg", 180.0 / np.pi)
        for what, per in (("position", ""), ("velocity", "/s"), ("acceleration", "/s^2")):
            own = f"{joint.name} {what} [{'m' if slides else 'rad'}{per}]"
            place = titles.index(own)
            titles[place] = f"{joint.name} {what} [{unit}{per}]"
            for k, row in enumerate(rows):
                cells = row.split(",")
                cells[place] = repr(float(cells[place]) * factor)
                rows[k] = ",".join(cells)
        minutes = titles.index("time [s]")
        titles[minutes] = "time [min]"
        for k, row in enumerate(rows):
            cells = row.split(",")
            cells[minutes] = repr(float(cells[minutes]) / 60.0)
            rows[k] = ",".join(cells)
        (tmp_path / "other.csv").write_text("\n".join([",".join(titles), *rows]))
        other = bc.read_motion(robot, tmp_path / "other.csv")
        for key in ("time", "position", "velocity", "acceleration"):
            assert getattr(other, key) == pytest.approx(getattr(wander, key), rel=1e-12, abs=1e-13), key

    def test_rates_of_a_file_of_positions_are_the_derivatives(self, robot, tmp_path):
        """Of sines, sampled with all digits: the error is that of quintic splines."""
        joints = [j for j in robot.joints if j.nv == 1]
        time = np.linspace(0.0, 1.6, 161)
        phase, size = 0.3 + 0.2 * np.arange(len(joints)), 0.4 + 0.05 * np.arange(len(joints))
        rows = size * np.sin(3.0 * time[:, None] + phase)
        head = ["time [s]", *(f"{j.name} position [{'m' if j.kind == 'prismatic' else 'rad'}]" for j in joints)]
        fixed = [j for j in robot.joints if j.nv != 1]
        for joint in fixed:
            head += [f"{joint.name} position {x} [m]" for x in "xyz"]
            head += [f"{joint.name} position q{x} [1]" for x in "xyzw"]
        base = [x for joint in fixed for x in robot.neutral[joint.q : joint.q + 7]]
        lines = [",".join(map(repr, [t, *row, *base])) for t, row in zip(time.tolist(), rows.tolist(), strict=True)]
        (tmp_path / "sines.csv").write_text(
            "\n".join([",".join(head), *lines]).replace("np.float64(", "").replace(")", "")
        )
        found = bc.read_motion(robot, tmp_path / "sines.csv")
        places = [j.v for j in joints]
        assert np.array_equal(found.time, time)
        inner = slice(8, -8)
        speed = 3.0 * size * np.cos(3.0 * time[:, None] + phase)
        assert found.velocity[:, places][inner] == pytest.approx(speed[inner], abs=1e-8)
        assert found.acceleration[:, places][inner] == pytest.approx(-9.0 * rows[inner], abs=1e-6)
        assert found.velocity[:, places] == pytest.approx(speed, abs=1e-5)


class FrameMotions:
    """Of a machine with a tool that follows paths in space; rotations are as the file has them."""

    @pytest.fixture(scope="class")
    def exact(self, machine):
        return machine.load_robot(clean=False)

    def test_circle_turns_at_a_constant_rate_about_its_normal(self, machine, exact, plain):
        """x = c + r (cos φ e₁ + sin φ n × e₁), φ = 2π turns t/T, e₁ the world's x made normal to n."""
        tool, duration, turns = machine.tool, 3.2, -0.8
        n = np.array(tool.normal) / np.linalg.norm(tool.normal)
        e1 = np.array([1.0, 0.0, 0.0]) - n[0] * n
        e1 /= np.linalg.norm(e1)
        e2, here = np.cross(n, e1), plain.frame(tool.frame, exact.posture(tool.start))["position"]
        radius = tool.reach
        motion = bc.circle(
            exact, tool.frame, here - radius * e1, radius, duration, start=tool.start, samples=81, normal=tool.normal,
            turns=turns, orientation=tool.orientation,
        )  # fmt: skip
        assert motion.duration == pytest.approx(duration, rel=1e-15)
        rate = 2.0 * np.pi * turns / duration
        cos, sin = (radius * function(rate * motion.time)[:, None] for function in (np.cos, np.sin))
        found = histories(plain, tool.frame, motion)
        assert found["position"] == pytest.approx(here - radius * e1 + cos * e1 + sin * e2, abs=1e-12)
        assert found["velocity"] == pytest.approx(rate * (cos * e2 - sin * e1), abs=1e-11)
        assert found["acceleration"] == pytest.approx(-(rate**2) * (cos * e1 + sin * e2), abs=1e-10)
        self.check_orientation(machine, exact, plain, found)
        self.check_joints(exact, motion)

    @pytest.mark.parametrize("profile", list(KEPT))
    def test_line_is_followed_in_the_shortest_time_within_limits(self, machine, exact, plain, profile):
        """The closed forms of the profiles; a given duration stretches them."""
        tool = machine.tool
        here = plain.frame(tool.frame, exact.posture(tool.start))["position"]
        way = tool.reach * np.array(tool.way)
        distance = float(np.linalg.norm(way))
        limits = dict(list(LIMITS.items())[: KEPT[profile]])
        scaled = {key: value * distance for key, value in limits.items()}
        quick = fastest(profile, distance, *scaled.values())
        turn = exact.frame_pose(tool.frame, exact.posture(tool.start))[1] @ pinocchio.exp3(np.array([0.2, -0.1, 0.15]))
        asked = (turn, pinocchio.rpy.matrixToRpy(turn))[len(profile) % 2] if tool.orientation else None
        for duration, orientation in ((None, tool.orientation), (1.25 * quick[0], asked)):
            motion = bc.line(
                exact, tool.frame, here + way, duration, start=tool.start, samples=41, profile=profile, begin=here,
                orientation=orientation, **scaled,
            )  # fmt: skip
            assert motion.duration == pytest.approx(duration or quick[0], rel=1e-12)
            found = histories(plain, tool.frame, motion)
            s, v, a = stretched(quick, motion.duration)(motion.time)
            along = way / distance
            assert found["position"] == pytest.approx(here + np.outer(s, along), abs=1e-12)
            rows = slice(None) if profile in ("quintic", "s_curve") else slice(1, -1)
            assert found["velocity"][rows] == pytest.approx(np.outer(v, along)[rows], abs=1e-10)
            if profile == "trapezoid":  # the limits from before and from after, where it jumps
                size = np.abs(found["acceleration"] @ along)
                top = max(abs(a))
                assert np.minimum(size, np.abs(size - top)) == pytest.approx(np.zeros(len(size)), abs=1e-8)
            else:
                assert found["acceleration"] == pytest.approx(np.outer(a, along), abs=1e-8)
            self.check_orientation(machine, exact, plain, found, None if duration is None else turn)
            self.check_joints(exact, motion)

    def test_tool_path_keeps_its_limits_along_lines_arcs_and_blends(self, machine, exact, plain):
        """It stops at points without a blend, passes blends by the closed form, and arcs through their three points."""
        tool, scale = machine.tool, machine.tool.reach
        here = plain.frame(tool.frame, exact.posture(tool.start))["position"]
        n = np.array(tool.normal) / np.linalg.norm(tool.normal)
        first = np.array(tool.way) - n * (n @ np.array(tool.way))
        first /= np.linalg.norm(first)
        second = np.cross(n, first)
        corner, stop = here + scale * first, here + scale * (0.9 * first + 0.8 * second)
        via, end = stop + scale * (-0.5 * first + 0.2 * second), stop + scale * (-0.8 * first - 0.1 * second)
        r = 0.2 * scale
        limits = {key: value * scale for key, value in LIMITS.items()}
        points = [corner, {"to": stop, "blend": 0.0}, {"via": via, "to": end}]
        motion = bc.tool_path(
            exact, tool.frame, points, blend=r, start=tool.start, samples=301, orientation=tool.orientation, **limits
        )
        found = histories(plain, tool.frame, motion)
        position = found["position"]
        e, f = first, (stop - corner) / np.linalg.norm(stop - corner)
        missed = np.linalg.norm(position - corner, axis=1)
        assert missed.min() == pytest.approx(5.0 / 32.0 * r * np.linalg.norm(f - e), rel=1e-3)
        at_stop = int(np.argmin(np.linalg.norm(position - stop, axis=1)))
        assert position[at_stop] == pytest.approx(stop, abs=1e-12)
        assert np.abs(motion.velocity[at_stop]).max() < 1e-9 * np.abs(motion.velocity).max()
        assert position[-1] == pytest.approx(end, abs=1e-12)
        straight = (motion.time <= motion.time[at_stop]) & (missed > 1.001 * r)
        lines = np.stack([np.linalg.norm(np.cross(position - corner, d), axis=1) for d in (e, f)]).min(axis=0)
        assert lines[straight].max() < 1e-12
        centre, radius = circumcircle(stop, via, end)
        bend = position[at_stop:]
        assert np.linalg.norm(bend - centre, axis=1) == pytest.approx(np.full(len(bend), radius), rel=1e-10)
        assert np.linalg.norm(bend - via, axis=1).min() < 2e-2 * radius
        sizes = [np.linalg.norm(found[key], axis=1) for key in ("velocity", "acceleration")]
        step = np.diff(motion.time)
        jerk = np.linalg.norm(np.diff(found["acceleration"], axis=0), axis=1)[step > 1e-9] / step[step > 1e-9]
        for values, limit in zip((*sizes, jerk), limits.values(), strict=True):
            assert values.max() <= limit * (1.0 + 1e-6)
        assert sizes[1].max() == pytest.approx(limits["acceleration"], rel=1e-6)
        assert jerk.max() == pytest.approx(limits["jerk"], rel=2e-2)
        consistent(motion.time, position, found["velocity"], found["acceleration"], 1e-6)
        self.check_orientation(machine, exact, plain, found)
        self.check_joints(exact, motion)

    def test_blend_from_a_line_into_an_arc_keeps_the_limits_without_a_stop(self, machine, exact, plain):
        tool, scale = machine.tool, machine.tool.reach
        here = plain.frame(tool.frame, exact.posture(tool.start))["position"]
        n = np.array(tool.normal) / np.linalg.norm(tool.normal)
        first = np.array(tool.way) - n * (n @ np.array(tool.way))
        first /= np.linalg.norm(first)
        second = np.cross(n, first)
        corner = here + scale * first
        via, end = corner + scale * (0.3 * first + 0.5 * second), corner + scale * (-0.1 * first + 0.9 * second)
        centre, radius = circumcircle(corner, via, end)
        limits, r = {key: value * scale for key, value in LIMITS.items()}, 0.25 * scale
        motion = bc.tool_path(
            exact, tool.frame, [corner, {"via": via, "to": end}], blend=r, start=tool.start, samples=301,
            orientation=tool.orientation, **limits,
        )  # fmt: skip
        found = histories(plain, tool.frame, motion)
        speeds, sizes = (np.linalg.norm(found[key], axis=1) for key in ("velocity", "acceleration"))
        assert speeds[1:-1].min() > 0.0 and speeds.max() <= limits["speed"] * (1.0 + 1e-6)
        assert sizes.max() <= limits["acceleration"] * (1.0 + 1e-6)
        step = np.diff(motion.time)
        jerk = np.linalg.norm(np.diff(found["acceleration"], axis=0), axis=1)[step > 1e-9] / step[step > 1e-9]
        assert jerk.max() <= limits["jerk"] * (1.0 + 1e-6)
        away = np.linalg.norm(found["position"] - corner, axis=1)
        assert 0.0 < away.min() <= 5.0 / 16.0 * r
        line = np.linalg.norm(np.cross(found["position"] - corner, first), axis=1)
        arc = np.abs(np.linalg.norm(found["position"] - centre, axis=1) - radius)
        assert np.minimum(line, arc)[away > 1.001 * r].max() < 1e-11
        # the speed is even in the blend, and as large as a turn of the tangents allows (docs: r is along the path)
        tangent = np.cross(n * np.sign(n @ np.cross(corner - centre, via - centre)), corner - centre) / radius
        turn = np.linalg.norm(tangent - first) + r / radius
        second_derivative = 1.0 / radius + turn * 15.0 / 8.0 / (2.0 * r)
        third = radius**-2 + 3.0 / radius * 15.0 / 8.0 / (2.0 * r) + turn * 10.0 / np.sqrt(3.0) / (2.0 * r) ** 2
        bound = min(
            limits["speed"], np.sqrt(limits["acceleration"] / second_derivative), np.cbrt(limits["jerk"] / third)
        )
        begin = int(np.argmin(np.abs(away - r) + line))  # where the frame leaves the line, a row
        assert away[begin] == pytest.approx(r, rel=1e-9)
        assert speeds[begin] == pytest.approx(bound, rel=1e-9)

    @staticmethod
    def check_orientation(machine, exact, plain, found, turn=None):
        if machine.tool.orientation == "hold":
            start = exact.posture(machine.tool.start)
            held = plain.frame(machine.tool.frame, start)["rotation"] if turn is None else turn
            assert found["rotation"] == pytest.approx(np.tile(held, (len(found["rotation"]), 1, 1)), abs=1e-11)
            assert np.abs(found["spin"]).max() < 1e-11 and np.abs(found["spin_up"]).max() < 1e-9

    @staticmethod
    def check_joints(exact, motion):
        """Rates are derivatives of positions, and joints that the tool does not need stay."""
        joints = [j for j in exact.joints if j.nv == 1]
        columns, places = [j.q for j in joints], [j.v for j in joints]
        consistent(
            motion.time, motion.position[:, columns], motion.velocity[:, places], motion.acceleration[:, places], 1e-5
        )
        for joint in exact.joints:
            if joint.nv != 1:
                assert not motion.velocity[:, joint.v : joint.v + joint.nv].any()
                assert np.ptp(motion.position[:, joint.q : joint.q + joint.nq], axis=0).max() == 0.0


# ---- parts


def powers(u, order):
    """The derivative of (1, u, …, u⁵) of an order."""
    return np.array(
        [np.polynomial.Polynomial(row).deriv(order)(u) if order else u**k for k, row in enumerate(np.eye(6))]
    )


def spline(knots, values):
    """Coefficients (pieces, 6, columns) of the quintic spline through values, at rest at both ends."""
    pieces, steps = len(knots) - 1, np.diff(knots)
    rows, right = [], []

    def add(terms, value):
        row = np.zeros(6 * pieces)
        for piece, weights in terms:
            row[6 * piece : 6 * piece + 6] += weights
        rows.append(row)
        right.append(value)

    for k in range(pieces):
        add([(k, powers(0.0, 0))], values[k])
        add([(k, powers(steps[k], 0))], values[k + 1])
    still = np.zeros(values.shape[1])
    for order in (1, 2):
        add([(0, powers(0.0, order))], still)
        add([(pieces - 1, powers(steps[-1], order))], still)
    for k in range(1, pieces):
        for order in (1, 2, 3, 4):
            add([(k - 1, powers(steps[k - 1], order)), (k, -powers(0.0, order))], still)
    return np.linalg.solve(np.array(rows), np.array(right)).reshape(pieces, 6, -1)


def targets(robot):
    """Three postures that move all joints by different amounts, within reach of each other."""
    k = np.arange(len(robot.joint_names))
    steps = np.array([0.0 * k, 0.5 + 0.07 * k, 0.9 - 0.11 * k])
    return [dict(zip(robot.joint_names, 0.3 * row, strict=True)) for row in steps]


def joint_limits(robot, profile):
    """Limits of each joint, which all differ."""
    keys = ("speed", "acceleration", "jerk")[: KEPT[profile]]
    sizes = {"speed": 0.9, "acceleration": 3.1, "jerk": 41.0}
    names = robot.joint_names
    return {key: {name: sizes[key] * (1.0 + 0.13 * k) for k, name in enumerate(names)} for key in keys}


def histories(plain, frame, motion):
    rows = [
        plain.frame(frame, *state) for state in zip(motion.position, motion.velocity, motion.acceleration, strict=True)
    ]
    return {key: np.array([row[key] for row in rows]) for key in rows[0]}


def consistent(time, x, first, second, bound=1e-9):
    """x(t + h) − x(t) = h (ẋ + ẋ')/2 + h² (ẍ − ẍ')/12 between rows, exact up to the fourth power of h."""
    h = np.diff(time)[:, None]
    change = h / 2.0 * (first[1:] + first[:-1]) + h**2 / 12.0 * (second[:-1] - second[1:])
    assert np.abs(np.diff(x, axis=0) - change).max() <= bound * np.ptp(x, axis=0).max()
    moved = h / 2.0 * (second[1:] + second[:-1])
    smooth = np.abs(np.diff(first, axis=0) - moved).max() <= 0.02 * np.abs(first).max()
    assert smooth


def circumcircle(a, b, c):
    """Centre and radius of the circle through three points."""
    u, w = b - a, c - a
    rows = np.array([u, w, np.cross(u, w)])
    centre = a + np.linalg.solve(rows, [u @ u / 2.0, w @ w / 2.0, 0.0])
    return centre, np.linalg.norm(a - centre)
