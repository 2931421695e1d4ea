"""Fastest motions of a machine, speed factors and cycles that can be repeated, against loads by plain Pinocchio."""

import json
import math

import numpy as np
import pytest
from plain_shaft import PlainShaft
from properties.dynamics import close
from scipy.spatial import KDTree
from sized import FASTEST

import bellcrank as bc

REFINED = 2e-6  # of a limit: by so much a fastest motion may exceed it
ACTIVE = 1e-3  # of a limit: nearer than this it is reached

MOMENTARY = ("peak torque", "motor speed", "peak curve", "voltage limit", "peak current")


class Fastest:
    @pytest.fixture(scope="class")
    def limits(self, machine):
        return bc.MotionLimits(**FASTEST[machine.sized_name])

    @pytest.fixture(scope="class")
    def fastest(self, sized_scene, sized, limits):
        return bc.time_optimal(sized_scene, sized.inputs.motions[0].name, limits, costs=False)

    @pytest.fixture(scope="class")
    def factor(self, sized_scene, sized, limits):
        return bc.speed_factor(sized_scene, sized.inputs.motions[0], limits)

    @pytest.fixture(scope="class")
    def uses_of(self, sized, plain_loads, limits):
        """The function of times and states that gives the share of each limit, by name."""

        def uses(time, q, v, a):
            loads = [plain_loads.at(*state)["torque"] for state in zip(time, q, v, a, strict=True)]
            return limit_uses(sized, plain_loads, limits, np.array(loads), (q, v, a))

        return uses

    # ---- fastest motions

    def test_a_fastest_motion_keeps_all_limits_and_always_reaches_one(self, fastest, uses_of):
        time = fastest.motion.time
        some = np.unique(np.concatenate([time[::9], 0.5 * (time[4:-4:11] + time[5:-3:11])]))
        uses = uses_of(some, *fastest.motion.at(some))
        largest = np.max(list(uses.values()), axis=0)
        assert largest.max() <= 1.0 + REFINED
        assert fastest.excess <= REFINED
        assert np.mean(largest >= 1.0 - ACTIVE) > 0.97
        for share, at in zip(largest[1:-1], some[1:-1], strict=True):
            place = np.clip(np.searchsorted(fastest.time, at) - 1, 0, len(fastest.active) - 1)
            around = {fastest.active[k] for k in range(max(0, place - 2), min(len(fastest.active), place + 3))}
            reached = {name for name, use in uses.items() if use[np.searchsorted(some, at)] >= 1.0 - ACTIVE}
            assert share < 1.0 - ACTIVE or around & reached, (at, around, reached)

    def test_a_fastest_motion_follows_the_path_from_rest_to_rest(self, fastest, sized):
        motion, given = fastest.motion, sized.inputs.motions[0]
        assert np.all(motion.velocity[[0, -1]] == 0.0)
        dense = given.at(np.linspace(given.time[0], given.time[-1], 20001))[0]
        away, _ = KDTree(dense).query(motion.position[:: max(1, len(motion) // 100)])
        step = np.linalg.norm(np.diff(dense, axis=0), axis=1).max()
        assert away.max() <= step
        close(motion.position[[0, -1]], given.position[[0, -1]], 1e-9)
        assert fastest.original_duration == given.duration
        assert fastest.duration == pytest.approx(motion.duration, rel=1e-12)
        places = np.diff(fastest.s)
        mean = 2.0 * places / (fastest.speed[1:] + fastest.speed[:-1])
        moving = (fastest.speed[1:] > 0.1 * fastest.speed.max()) & (places > 0.0)
        assert np.diff(fastest.time)[moving] == pytest.approx(mean[moving], rel=2e-2)
        assert np.all(fastest.speed <= fastest.largest_speed * (1.0 + 1e-9))

    def test_sized_again_a_fastest_motion_is_inside_its_motors_limits_of_a_moment(self, sized_scene, fastest, sized):
        again = bc.size(sized_scene, fastest.motion)
        bound = 1e-4 if sized.inputs.mechanism.closed else 2e-5  # a linkage's motion is found anew from its motors'
        for joint in again.joints:
            if joint.shaft is not None:
                known = joint.shaft.known_margins
                momentary = [known[name] for name in MOMENTARY if name in known]
                assert len(momentary) >= 3 and min(momentary) >= -bound
            if joint.effort_margin is not None:
                assert joint.effort_margin >= -bound

    def test_no_factor_of_the_motion_is_as_fast(self, fastest, factor):
        assert factor.factor > 0.0
        assert fastest.duration < factor.motion.duration / factor.factor

    def test_the_shares_of_time_are_those_of_the_active_limits(self, fastest):
        lengths = np.where(np.diff(fastest.s) > 0.0, np.diff(fastest.time), 0.0)
        shares = {}
        for name, length in zip(fastest.active, lengths, strict=True):
            if name:
                shares[name] = shares.get(name, 0.0) + length / lengths.sum()
        assert {cost.limit: cost.share for cost in fastest.costs} == pytest.approx(shares, rel=1e-6)
        listed = [cost.share for cost in fastest.costs]
        assert listed == sorted(listed, reverse=True)

    # ---- speed factor

    def test_at_the_factor_one_limit_is_reached_and_below_it_none(self, factor, uses_of):
        motion, k = factor.motion, factor.factor
        state = motion.at([factor.time])

        def uses(time, q, v, a, k):
            return uses_of(time, q, k * v, k * k * a)

        reached = uses(np.array([factor.time]), *state, k)
        assert reached[factor.limit][0] == pytest.approx(1.0, abs=1e-8)
        time = np.linspace(motion.time[0], motion.time[-1], 121)
        for share in (0.25, 0.5, 0.75, 1.0):
            least = min(1.0, k)
            one = least + share * (k - least)
            for name, each in uses(time, *motion.at(time), one).items():
                assert each.max() <= 1.0 + 1e-8, (name, one)
        assert uses(np.array([factor.time]), *state, 1.01 * k)[factor.limit][0] > 1.0
        scaled = factor.scaled()
        assert scaled.duration == pytest.approx(motion.duration / k, rel=1e-12)
        close(scaled.velocity, k * motion.velocity)
        close(scaled.acceleration, k * k * motion.acceleration)

    # ---- files

    def test_the_files_of_a_fastest_motion_hold_the_same_numbers(self, sized_scene, fastest, tmp_path):
        document = json.loads(fastest.to_json(tmp_path / "fastest.json").read_text(encoding="utf-8"))
        assert document["duration"] == fastest.duration and document["excess"] == fastest.excess
        assert document["original_duration"] == fastest.original_duration
        for entry, cost in zip(document["costs"], fastest.costs, strict=True):
            assert (entry["limit"], entry["share_of_time"]) == (cost.limit, cost.share)
        rows = fastest.to_csv(tmp_path / "limits.csv").read_text(encoding="utf-8").splitlines()
        assert rows[0] == "t [s],s,ds/dt [1/s],largest ds/dt [1/s],active limit from here"
        cells = [row.split(",") for row in rows[1:]]
        numbers = np.array([[float(cell) for cell in row[:4]] for row in cells])
        columns = (fastest.time, fastest.s, fastest.speed, fastest.largest_speed)
        assert np.array_equal(numbers, np.column_stack(columns))
        assert tuple(row[4] for row in cells[:-1]) == fastest.active
        bc.write_motion(fastest.motion, tmp_path / "motion.csv")
        read = bc.read_motion(sized_scene.robot, tmp_path / "motion.csv")
        written, kept = fastest.motion, np.isin(fastest.motion.time, read.time)
        step = np.diff(written.time)  # rows that rounding does not separate are merged as they are read
        close_by = 1e-3 * np.median(step)
        assert len(written) - np.count_nonzero(step <= close_by) <= len(read) == np.count_nonzero(kept)
        off = np.abs(read.position - written.position[kept]).max(axis=1)
        alone = np.flatnonzero(off <= 1e-12 * np.abs(written.position).max())
        assert len(read) - len(alone) <= np.count_nonzero(step <= close_by)
        assert off.max() <= close_by * np.abs(written.velocity).max()
        close(read.acceleration[alone], written.acceleration[kept][alone], 1e-9)


class FastestInDetail(Fastest):
    """What costs more: other methods, and cycles that can be repeated."""

    def test_a_grid_gives_the_same_time_to_first_order(self, sized_scene, sized, limits, fastest):
        errors = []
        for cells in (60, 240):
            found = bc.time_optimal(sized_scene, sized.inputs.motions[0].name, limits, grid=cells, costs=False)
            assert len(found.s) > cells
            errors.append(abs(found.duration / fastest.duration - 1.0))
        assert errors[0] < 0.06
        assert errors[1] < 0.02

    def test_uses_over_factors_are_those_of_the_scaled_motion(self, sized_scene, factor, limits, uses_of):
        rows = np.linspace(factor.motion.time[0], factor.motion.time[-1], 101)  # uses are looked at between rows
        motion = bc.Motion(factor.motion.joints, rows, *factor.motion.at(rows))
        found = bc.speed_factor(sized_scene, motion, limits)
        assert found.factor == pytest.approx(factor.factor, rel=1e-4)
        time = np.linspace(rows[0], rows[-1], 201)
        q, v, a = motion.at(time)
        for number in (30, 97):
            k = found.factors[number]
            expected = {name: use.max() for name, use in uses_of(time, q, k * v, k * k * a).items()}
            assert set(found.uses) == set(expected)
            for name, use in expected.items():
                if not name.startswith("motor torque"):  # of these the share of the torque at the speed counts here
                    assert found.uses[name][number] == pytest.approx(use, rel=2e-3, abs=1e-9), name

    @pytest.fixture(scope="class")
    def hasty(self, factor, sized, plain_loads):
        """A motion that is mostly inertia, and motors that do not bear to repeat it but to hold its end; its loads."""
        motion = factor.scaled(2.5)
        loads, held = plain_loads.along(motion, 240), plain_loads.held(motion.position[-1])
        resting = plain_loads.along(factor.scaled(0.02), 240)
        actuators = {}
        for k, joint in enumerate(sized.joints):
            ratio, safety = 61.0 + 7.0 * k, 1.1 + 0.05 * k
            squares = loads.rms(loads.torque[:, k]) ** 2, resting.rms(resting.torque[:, k]) ** 2, held[k] ** 2
            if max(squares[1:]) < 0.7 * squares[0]:
                middle = math.sqrt(0.6 * squares[0] + 0.4 * max(squares[1:]))
                actuators[joint.name] = bc.Actuator(
                    ratio=ratio, rated_torque=safety * middle / ratio, peak_torque=1e6, rated_speed=1e6, max_speed=2e6,
                    efficiency=0.999, safety_factor=safety,
                )  # fmt: skip
        assert actuators
        return motion, actuators, loads

    @staticmethod
    def shaft(sized, actuators, loads, name):
        """The shaft of a joint's motor along a motion."""
        k = next(k for k, joint in enumerate(sized.joints) if joint.name == name)
        state = (loads.torque[:, k], loads.speed[:, k], loads.acceleration[:, k])
        return k, PlainShaft(actuators[name], *state, loads.weight)

    def test_a_pause_brings_the_rms_torque_to_the_continuous_torque(self, sized, plain_loads, hasty):
        motion, actuators, loads = hasty
        cycle = bc.repeated_cycle(sized.inputs.mechanism, motion, actuators=actuators)
        held, needed, uses = plain_loads.held(motion.position[-1]), {}, {}
        for name, actuator in actuators.items():
            k, shaft = self.shaft(sized, actuators, loads, name)
            end = held[k] / (actuator.ratio * actuator.efficiency)
            squared, limit = shaft.weight @ shaft.torque**2, actuator.rated_torque / actuator.safety_factor
            uses[name] = math.sqrt(squared / motion.duration) / limit
            needed[name] = max(0.0, (squared - limit**2 * motion.duration) / (limit**2 - end**2))
        assert cycle.original_uses == pytest.approx(uses, rel=1e-3)
        assert cycle.joint == max(needed, key=needed.__getitem__)
        assert cycle.pause == pytest.approx(needed[cycle.joint], rel=5e-3)
        assert cycle.uses[cycle.joint] == pytest.approx(1.0, abs=1e-9)
        assert max(cycle.uses.values()) <= 1.0 + 1e-9
        assert cycle.duration == pytest.approx(motion.duration + cycle.pause, rel=1e-12)
        assert np.array_equal(cycle.motion.position[-1], motion.position[-1])

    def test_a_slower_motion_brings_the_rms_torque_to_the_continuous_torque(self, sized, plain_loads, hasty):
        motion, actuators, _ = hasty
        name = next(iter(actuators))
        given = {name: actuators[name]}
        cycle = bc.repeated_cycle(sized.inputs.mechanism, motion, actuators=given, by="speed")
        _, shaft = self.shaft(sized, given, plain_loads.along(cycle.motion, 240), name)
        assert cycle.factor < 1.0
        use = given[name].safety_factor * shaft.rms / given[name].rated_torque
        assert use == pytest.approx(1.0, abs=2e-3)
        assert cycle.duration == pytest.approx(motion.duration / cycle.factor, rel=1e-12)
        close(cycle.motion.velocity, cycle.factor * motion.velocity)
        close(cycle.motion.acceleration, cycle.factor**2 * motion.acceleration)


def limit_uses(sized, plain_loads, limits, torque, states):
    """The share (n,) of each momentary limit that torques (n, k) and states use, by name."""
    q, v, a = states
    robot, actuators, found = sized.inputs.mechanism.robot, sized.inputs.actuators, {}
    columns = {joint.name: place.v for joint, place in zip(sized.joints, plain_loads.joints, strict=True)}
    for k, joint in enumerate(sized.joints):
        column = columns[joint.name]
        if joint.effort_limit:
            found[f"torque of {joint.name}"] = np.abs(torque[:, k]) / joint.effort_limit
        if joint.name in actuators:
            one = actuators[joint.name]
            shaft = PlainShaft(one, torque[:, k], v[:, column], a[:, column], np.ones(len(q)))
            found[f"motor torque of {joint.name}"] = shaft.curve_use()
            tops = [one.max_speed]
            if not one.by_ratings:
                tops.append(one.gear.max_speed)
                load = one.safety_factor * np.abs(torque[:, k]) / one.gear.repeated_peak_torque
                found[f"gear torque of {joint.name}"] = load
            if one.__dict__.get("curve"):
                tops.append(one.curve[-1][0])
            found[f"motor speed of {joint.name}"] = np.abs(shaft.speed) / min(tops)
    for key, what in (("speed", "speed"), ("acceleration", "acceleration")):
        given = getattr(limits, key)
        if isinstance(given, str):
            given = {j.name: robot.velocity_limit[columns[j.name]] for j in sized.joints if given == "urdf"}
        for name, limit in given.items():
            if np.isfinite(limit) and limit > 0.0:
                values = {"speed": v, "acceleration": a}[key][:, columns[name]]
                found[f"{what} of {name}"] = np.abs(values) / limit
    if limits.tool:
        rows = [plain_loads.tree.frame(limits.tool, *state) for state in zip(q, v, a, strict=True)]
        for what, key in (("speed", "velocity"), ("acceleration", "acceleration"), ("angular speed", "spin")):
            limit = getattr(limits, f"tool_{what.replace(' ', '_')}")
            if limit is not None:
                size = np.linalg.norm([row[key] for row in rows], axis=1)
                found[f"{what} of frame {limits.tool}"] = size / limit
    return found


class StraightPaths:
    """Straight lines of all joints of an open chain, whose fastest times have closed forms."""

    @pytest.fixture(scope="class")
    def line(self, robot):
        """The path, and the largest path speed, acceleration and jerk that joints allow, with their limits."""
        random = np.random.default_rng(3)
        span = np.array([0.025 if joint.kind == "prismatic" else 1.0 for joint in robot.joints])
        begin, way = 0.3 * span * random.uniform(0.1, 1.0, robot.nq), span * random.uniform(0.3, 1.1, robot.nq)
        path = bc.joint_path(robot, [begin, begin + way])
        limits, tops = {}, {}
        for key, low, high in (("speed", 0.4, 1.0), ("acceleration", 3.0, 6.0), ("jerk", 40.0, 90.0)):
            values = span * random.uniform(low, high, robot.nq)
            limits[key] = dict(zip(robot.joint_names, values.tolist(), strict=True))
            shares = values / way
            tops[key] = float(shares.min()), f"{key} of {robot.joint_names[int(shares.argmin())]}"
        return path, limits, tops

    def test_with_limits_of_speed_and_acceleration_the_path_speed_is_a_trapezoid(self, robot, line):
        path, limits, tops = line
        found = bc.time_optimal(robot, path, bc.MotionLimits(**{**limits, "jerk": "none"}, torque="none"))
        (v, of_v), (a, of_a) = tops["speed"], tops["acceleration"]
        length = path.length
        v, a = v * length, a * length  # of the path parameter, which is the joints' way
        assert v * v / a < length
        time = length / v + v / a
        assert found.duration == pytest.approx(time, rel=1e-9)
        assert found.speed.max() == pytest.approx(v, rel=1e-9)
        costs = {cost.limit: cost for cost in found.costs if cost.share > 1e-3}
        assert set(costs) == {of_v, of_a}
        assert costs[of_a].share == pytest.approx(2.0 * v / a / time, rel=1e-3)
        assert costs[of_v].derivative == pytest.approx((v / a - length / v) / time, rel=2e-2)
        assert costs[of_a].derivative == pytest.approx(-v / a / time, rel=3e-2)

    def test_with_limits_of_jerk_it_is_the_curve_of_seven_segments(self, robot, line):
        path, limits, tops = line
        found = bc.time_optimal(robot, path, bc.MotionLimits(**limits, torque="none"))
        (v, of_v), (a, of_a), (j, of_j) = (tops[key] for key in ("speed", "acceleration", "jerk"))
        v, a, j, length = (x * path.length for x in (v, a, j, 1.0))
        assert v * j > a * a and length / v > v / a + a / j
        time = length / v + v / a + a / j
        assert found.duration == pytest.approx(time, rel=1e-4)  # a spline stands for the segments
        expected = {of_v: v / a - length / v, of_a: a / j - v / a, of_j: -a / j}
        costs = {cost.limit: cost.derivative for cost in found.costs if abs(cost.derivative) > 1e-3}
        assert costs == pytest.approx({name: value / time for name, value in expected.items()}, rel=1e-2, abs=1e-3)
        step = np.diff(found.motion.time)
        jerk = np.diff(found.motion.acceleration, axis=0)[step > 1e-4] / step[step > 1e-4, None]
        most = np.array([limits["jerk"][joint.name] for joint in robot.joints])
        assert np.all(np.abs(jerk).max(axis=0) <= most * (1.0 + 1e-4))
        assert np.max(np.abs(jerk) / most) > 0.999
        assert np.abs(found.motion.acceleration[[0, -1]]).max() <= 1e-9
