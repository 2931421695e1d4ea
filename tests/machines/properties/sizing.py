"""Sizing of a machine's motors over two motions, against loads by plain Pinocchio and formulas in NumPy."""

import csv
import json
import math

import numpy as np
import pytest
from plain_shaft import PlainShaft
from properties.dynamics import close
from scipy.interpolate import BPoly
from scipy.optimize import minimize

import bellcrank as bc

TIGHT = 1e-9  # of the largest load: rotations such as 1.5708 are made exact as they are read
SHORT_TIME = ("peak torque", "motor speed", "peak curve", "peak current", "voltage limit")  # one instant decides each
RATINGS = {"motor speed", "continuous torque", "peak torque", "peak curve"}  # what is judged of ratings, and no more
LEAST_MARGIN = -2e-5  # a limit that is met to this counts as kept


def quantities(loads, k):
    """The loads (n,) of motor k of which a sizing has the largest values."""
    torque, speed = loads.torque[:, k], loads.speed[:, k]
    return {
        "max_torque": torque, "min_torque": -torque, "peak_torque": np.abs(torque), "peak_speed": np.abs(speed),
        "peak_motoring_power": np.maximum(torque * speed, 0.0),
        "peak_regenerating_power": np.maximum(-torque * speed, 0.0),
        "largest_inertia": loads.inertia[:, k], "peak_bearing_force": loads.bearing[:, k],
        "peak_tilting_moment": loads.tilting[:, k],
    }  # fmt: skip


def at_peak(sized, plain_loads, peak):
    """The loads at the time of a peak, as those along a motion of one sample; and q there."""
    motion = next(one for one in sized.inputs.motions if one.name == peak.motion)
    q, v, a = (x[0] for x in motion.at([peak.time]))
    found = plain_loads.at(peak.time, q, v, a)
    one = {key: np.array([found[key]]) for key in ("torque", "inertia", "bearing", "tilting", "friction")}
    state = {"speed": v[plain_loads.columns][None], "acceleration": a[plain_loads.columns][None]}
    return type("One", (), one | state), q


def shaft_at(sized, joint, one, k):
    """The shaft of joint k's motor at one sample."""
    actuator = sized.inputs.actuators[joint.name]
    return PlainShaft(actuator, one.torque[:, k], one.speed[:, k], one.acceleration[:, k], np.ones(1))


def is_largest(peak, there, elsewhere, scale=None):
    """Whether a peak is what the load is at its time, and no sample of any motion is larger."""
    scale = max(abs(peak.value), 1e-12) if scale is None else scale
    assert abs(peak.value - there) <= 1e-8 * scale
    assert max(np.max(each) for each in elsewhere) <= peak.value + 1e-8 * scale


class Sizing:
    @pytest.fixture(scope="class")
    def along(self, sized, plain_loads):
        """The loads of each motion by plain Pinocchio."""
        return {motion.name: plain_loads.along(motion, 240) for motion in sized.inputs.motions}

    @pytest.fixture(scope="class")
    def shafts(self, sized, along):
        """(joint, motion) -> its motor's shaft."""
        actuators = sized.inputs.actuators
        return {
            (joint.name, name): PlainShaft(
                actuators[joint.name], loads.torque[:, k], loads.speed[:, k], loads.acceleration[:, k], loads.weight
            )
            for k, joint in enumerate(sized.joints)
            if joint.name in actuators
            for name, loads in along.items()
        }

    def test_motions_are_the_quintics_through_their_rows(self, sized):
        for motion in sized.inputs.motions:
            places = [(joint.q, joint.v) for joint in motion.joints if joint.nq == joint.nv == 1]
            time = np.linspace(motion.time[0], motion.time[-1], 57)
            for q, v in places:
                rows = np.column_stack([motion.position[:, q], motion.velocity[:, v], motion.acceleration[:, v]])
                spline = BPoly.from_derivatives(motion.time, rows)
                for order, found in enumerate((x[:, c] for x, c in zip(motion.at(time), (q, v, v), strict=True))):
                    close(found, spline(time, nu=order), 1e-9)

    def test_histories_are_inverse_dynamics_at_the_rows(self, sized, plain_loads):
        for motion in sized.inputs.motions:
            history = sized.histories[motion.name]
            states = (motion.position, motion.velocity, motion.acceleration)
            rows = [plain_loads.at(*row) for row in zip(motion.time, *states, strict=True)]
            assert np.array_equal(history.time, motion.time)
            torque = np.array([row["torque"] for row in rows])
            close(np.column_stack([joint.torque for joint in history.joints]), torque, TIGHT)
            for k, (joint, place) in enumerate(zip(history.joints, plain_loads.joints, strict=True)):
                assert np.array_equal(joint.position, motion.position[:, place.q])
                assert np.array_equal(joint.velocity, motion.velocity[:, place.v])
                assert np.array_equal(joint.acceleration, motion.acceleration[:, place.v])
                assert np.array_equal(joint.power, joint.torque * joint.velocity)
                actuator = sized.inputs.actuators.get(joint.name)
                if actuator is None:
                    assert joint.shaft is None
                    continue
                # at a zero of the speed the gear's loss has one of two limits, at the ends that inside the motion
                sided = []
                for beside in (np.append(motion.time[:-1] + 1e-4, motion.time[-1] - 1e-4),
                               np.append(motion.time[0] + 1e-4, motion.time[1:] - 1e-4)):  # fmt: skip
                    speed = np.where(
                        np.abs(joint.velocity) < 1e-9, 1e-30 * motion.at(beside)[1][:, place.v], joint.velocity
                    )
                    sided.append(PlainShaft(actuator, torque[:, k], speed, joint.acceleration, np.ones(len(motion))))
                after, before = (one.torque for one in sided)
                nearer = np.abs(joint.shaft.torque - after) <= np.abs(joint.shaft.torque - before)
                close(joint.shaft.torque, np.where(nearer, after, before), TIGHT)
                close(joint.shaft.speed, actuator.ratio * joint.velocity)
                assert np.array_equal(joint.shaft.power, joint.shaft.torque * joint.shaft.speed)
            multipliers = plain_loads.shown_multipliers(np.array([row["multipliers"] for row in rows]))
            assert len(history.multiplier_names) == multipliers.shape[1]
            close(history.multipliers, multipliers, TIGHT)

    def test_each_peak_is_the_load_at_its_time_and_no_load_is_larger(self, sized, plain_loads, along):
        for k, joint in enumerate(sized.joints):
            for name, peak in joint.peaks.items():
                if name == "sampled_torque":
                    continue
                one, q = at_peak(sized, plain_loads, peak)
                assert np.array_equal(q, peak.position)
                sign = -1.0 if name == "min_torque" or (name == "peak_torque" and peak.value < 0.0) else 1.0
                largest = type(peak)(sign * peak.value, peak.time, peak.motion, peak.position)
                there = quantities(one, k)[name][0]
                scale = max(abs(peak.value), 100.0 * joint.peak_power if "power" in name else 0.0)
                is_largest(largest, there, [quantities(each, k)[name] for each in along.values()], scale)
                assert getattr(joint, name) == (abs(peak.value) if name == "peak_torque" else peak.value)
            assert joint.peak_power == max(joint.peak_motoring_power, joint.peak_regenerating_power)

    def test_the_peak_at_the_rows_is_the_largest_torque_of_the_histories(self, sized):
        for joint in sized.joints:
            torque = {name: np.abs(each.joint(joint.name).torque) for name, each in sized.histories.items()}
            peak = joint.peaks["sampled_torque"]
            # The polynomial at a row is the row itself but for rounding, to which a closed mechanism's torque adds.
            assert joint.sampled_torque == peak.value == pytest.approx(max(map(np.max, torque.values())), rel=1e-12)
            row = np.argmax(torque[peak.motion])
            assert peak.time == sized.histories[peak.motion].time[row]

    def test_rms_torques_mean_speeds_and_energies_are_integrals_over_each_motion(self, sized, along, shafts):
        for k, joint in enumerate(sized.joints):
            for cycle, (name, loads) in zip(joint.cycles, along.items(), strict=True):
                power = loads.torque[:, k] * loads.speed[:, k]
                work = loads.integral(np.abs(power))
                assert (cycle.motion, cycle.duration) == (name, pytest.approx(loads.weight.sum(), rel=1e-12))
                assert cycle.rms_torque == pytest.approx(loads.rms(loads.torque[:, k]), rel=2e-6)
                assert cycle.mean_speed == pytest.approx(
                    loads.integral(np.abs(loads.speed[:, k])) / cycle.duration, rel=1e-9
                )
                net = cycle.motoring_energy - cycle.regenerated_energy
                assert net == pytest.approx(loads.integral(power), abs=2e-6 * work)
                assert cycle.motoring_energy + cycle.regenerated_energy == pytest.approx(work, rel=5e-3)  # kinks
                if joint.shaft is None:
                    assert cycle.rms_shaft_torque is None
                else:
                    # near rest the efficiency jumps, within a part of the motion over which the sum does not know it
                    assert cycle.rms_shaft_torque == pytest.approx(shafts[joint.name, name].rms, rel=1e-3)
            for name in ("rms_torque", "mean_speed", "motoring_energy", "regenerated_energy"):
                assert getattr(joint, name) == max(getattr(cycle, name) for cycle in joint.cycles)

    def test_shafts_bear_what_gear_and_rotor_make_of_the_loads(self, sized, plain_loads, along, shafts):
        for k, joint in enumerate(sized.joints):
            shaft = joint.shaft
            if shaft is None:
                assert joint.name in sized.joints_without_actuator
                continue
            own = [shafts[joint.name, name] for name in along]
            for peak, of in (
                (shaft.peak_torque, lambda one: np.abs(one.torque)),
                (shaft.peak_speed, lambda one: np.abs(one.speed)),
                (shaft.curve_use, PlainShaft.curve_use),
            ):
                there = shaft_at(sized, joint, at_peak(sized, plain_loads, peak)[0], k)
                is_largest(peak, of(there)[0], [of(one) for one in own])
            assert shaft.rms_torque == max(cycle.rms_shaft_torque for cycle in joint.cycles)
            actuator = shaft.actuator
            reflected = actuator.ratio**2 * (actuator.rotor_inertia + actuator.gear_inertia)
            assert actuator.reflected_inertia == pytest.approx(reflected, rel=1e-14)
            assert shaft.inertia_ratio == pytest.approx(joint.largest_inertia / reflected, rel=1e-14)

    def test_margins_are_what_is_left_of_the_limits_with_the_safety_factor(self, sized, shafts):
        for joint in sized.joints:
            if joint.shaft is None:
                continue
            shaft, safety = joint.shaft, joint.shaft.actuator.safety_factor
            uses = [
                safety * cycle.rms_shaft_torque / shafts[joint.name, cycle.motion].continuous_torque
                for cycle in joint.cycles
            ]
            limits, margins = shaft.actuator, shaft.margins
            of_ratings = limits.by_ratings
            assert set(margins) == RATINGS if of_ratings else set(margins) > RATINGS - {"peak curve"}
            expected = {
                "peak torque": 1.0 - safety * shaft.peak_torque.value / limits.peak_torque,
                "continuous torque": 1.0 - max(uses),
                "motor speed": 1.0 - shaft.peak_speed.value / limits.max_speed,
            }
            assert {name: margins[name] for name in expected} == pytest.approx(expected, rel=1e-12, abs=1e-9)
            least = min(margins[name] for name in SHORT_TIME if margins.get(name) is not None)
            if of_ratings:
                least = margins["peak curve"]
            assert least == pytest.approx(1.0 - shaft.curve_use.value, abs=1e-9)
            known = {name: margin for name, margin in margins.items() if margin is not None}
            tightest = min(known, key=lambda name: known[name])
            assert (shaft.tightest, shaft.tightest_margin) == (tightest, known[tightest])
            assert shaft.inside == (known[tightest] >= LEAST_MARGIN)
            missing = len(margins) - len(known)
            state = "exceeded" if not shaft.inside else "inside as far as known" if missing else "inside"
            unknown = f"; {missing} unknown" if missing else ""
            assert shaft.verdict == f"{state} ({tightest} {100 * known[tightest]:+.1f}%{unknown})"

    def test_margins_of_joints_are_what_is_left_of_the_urdfs_limits(self, sized, plain_loads):
        robot = sized.inputs.mechanism.robot
        model = plain_loads.tree.model
        for k, joint in enumerate(sized.joints):
            number = model.getJointId(joint.name)
            v, place = model.idx_vs[number], plain_loads.joints[k]
            for limit, margin, peak, stated in (
                (joint.effort_limit, joint.effort_margin, joint.peak_torque, model.effortLimit[v]),
                (joint.velocity_limit, joint.velocity_margin, joint.peak_speed, model.velocityLimit[v]),
            ):
                if limit is None:
                    assert margin is None and not stated < 1e299
                else:
                    assert (limit, margin) == (stated, 1.0 - peak / limit)
            reached = [motion.at(np.linspace(motion.time[0], motion.time[-1], 4001))[0][:, place.q]
                       for motion in sized.inputs.motions]  # fmt: skip
            low, high = min(map(np.min, reached)), max(map(np.max, reached))
            assert joint.position_range == pytest.approx((low, high), abs=2e-6)
            ends = (robot.lower[place.q], robot.upper[place.q])
            assert joint.position_limits == tuple(end if math.isfinite(end) else None for end in ends)
            distances = [joint.position_range[0] - ends[0], ends[1] - joint.position_range[1]]
            left = [one for one in distances if math.isfinite(one)]
            assert joint.position_margin == (min(left) if left else None)

    def test_each_exceeded_limit_is_named_and_decides_the_verdict(self, sized):
        exceeded = []
        for joint in sized.joints:
            urdf = (joint.effort_margin, joint.velocity_margin)
            exceeded += [joint.name for margin in urdf if margin is not None and margin < LEAST_MARGIN]
            exceeded += [joint.name] * (joint.position_margin is not None and joint.position_margin < 0.0)
            if joint.shaft is not None:
                margins = joint.shaft.margins.values()
                exceeded += [joint.name for margin in margins if margin is not None and margin < LEAST_MARGIN]
        assert [text.split("'")[1] for text in sized.exceeded] == exceeded
        assert sized.inside == (not exceeded)

    def test_friction_share_is_that_of_the_torque_at_the_peak(self, sized, plain_loads):
        for k, joint in enumerate(sized.joints):
            one, _ = at_peak(sized, plain_loads, joint.peaks["peak_torque"])
            share = abs(one.friction[0, k] / one.torque[0, k])
            assert share > 0.0
            assert joint.friction_share == pytest.approx(share, rel=1e-6)

    def test_supply_gives_what_all_motors_take_at_one_instant(self, sized, plain_loads, along, shafts):
        def power(loads, name):
            return sum(
                loads.torque[:, k] * loads.speed[:, k]
                if joint.shaft is None
                else name(joint).supply_power()
                for k, joint in enumerate(sized.joints)
            )  # fmt: skip

        numbers = {joint.name: k for k, joint in enumerate(sized.joints)}
        for sign, peak in ((1.0, sized.supply_peak), (-1.0, sized.regeneration_peak)):
            one, _ = at_peak(sized, plain_loads, peak)
            there = power(one, lambda joint, one=one: shaft_at(sized, joint, one, numbers[joint.name]))[0]
            every = [
                sign * power(loads, lambda joint, motion=motion: shafts[joint.name, motion])
                for motion, loads in along.items()
            ]
            is_largest(peak, sign * there, every)
        assert sized.peak_supply_power == sized.supply_peak.value
        assert sized.peak_regeneration == sized.regeneration_peak.value

    def test_holding_torque_is_the_largest_of_all_postures(self, sized, plain_loads, along):
        robot = sized.inputs.mechanism.robot
        held = {joint.name: (k, joint) for k, joint in enumerate(sized.joints)}
        for k, joint in held.values():
            torque = abs(plain_loads.held(np.array(joint.holding_position))[k])
            assert joint.holding_torque == pytest.approx(torque, rel=1e-9, abs=1e-9)
        if sized.inputs.mechanism.closed:
            postures = np.concatenate([motion.at(along[motion.name].time)[0] for motion in sized.inputs.motions])
            torques = np.array([plain_loads.held(q) for q in postures])
            assert np.all(
                np.abs(torques).max(axis=0) <= [joint.holding_torque * (1.0 + 1e-9) for joint in sized.joints]
            )
            return
        random = np.random.default_rng(5)
        low, high = (np.where(np.isfinite(end), end, turn) for end, turn in
                     ((robot.lower, -np.pi), (robot.upper, np.pi)))  # fmt: skip
        assert all(np.all(low <= joint.holding_position) and np.all(joint.holding_position <= high)
                   for joint in sized.joints)  # fmt: skip
        postures = random.uniform(low, high, (300, robot.nq))
        torques = np.array([plain_loads.held(q) for q in postures])
        for k, joint in held.values():
            for sign in (1.0, -1.0):
                begin = postures[np.argmax(sign * torques[:, k])]
                found = minimize(
                    lambda q, k=k, sign=sign: -sign * plain_loads.held(q)[k], begin, method="L-BFGS-B",
                    bounds=list(zip(low, high, strict=True)), options={"maxiter": 6},
                )  # fmt: skip
                assert -found.fun <= joint.holding_torque * (1.0 + 1e-9) + 1e-9

    def test_forces_in_the_structure_are_the_largest_of_constraints_and_free_joints(self, sized, along):
        names = list(next(iter(along.values())).structure) if sized.inputs.mechanism.closed else []
        assert [load.name for load in sized.structure] == names
        for load in sized.structure:
            for peak, part in ((load.peak_force, 0), (load.peak_moment, 1)):
                sizes = [loads.structure[load.name][part] for loads in along.values()]
                if sizes[0] is None:
                    assert peak is None
                    continue
                scale = max(each.max() for each in sizes)
                assert peak.value == pytest.approx(scale, rel=5e-3, abs=1e-9)
                motion = next(one for one in sized.inputs.motions if one.name == peak.motion)
                assert np.allclose(motion.at(peak.time)[0], peak.position, rtol=0.0, atol=1e-12)

    def test_a_reversed_motion_takes_back_what_was_given_but_for_friction(self, sized_scene, sized, plain_loads, along):
        """At −v the inertial and static torques are the same, and what opposes the speed changes its sign."""
        motion = sized.inputs.motions[-1]
        back = bc.size(
            sized_scene,
            bc.Motion(motion.joints, motion.time[-1] - motion.time[::-1], motion.position[::-1],
                      -motion.velocity[::-1], motion.acceleration[::-1], motion.name),
        )  # fmt: skip
        states = zip(motion.time, motion.position, motion.velocity, motion.acceleration, strict=True)
        lost = np.array([plain_loads.resistance(*state) for state in states])
        history, forward = back.histories[motion.name], sized.histories[motion.name]
        for k, (one, other) in enumerate(zip(history.joints, forward.joints, strict=True)):
            close(one.torque[::-1], other.torque - 2.0 * lost[:, k], TIGHT)
        loads = along[motion.name]
        states = zip(loads.time, *motion.at(loads.time), strict=True)
        power = loads.speed * [plain_loads.resistance(*state) for state in states]
        for k, (joint, other) in enumerate(zip(back.joints, sized.joints, strict=True)):
            [cycle], there = joint.cycles, other.cycles[-1]
            assert cycle.mean_speed == pytest.approx(there.mean_speed, rel=1e-9)
            net, forth = (each.motoring_energy - each.regenerated_energy for each in (cycle, there))
            assert net + forth == pytest.approx(2.0 * loads.integral(power[:, k]), rel=1e-6)

    def test_mass_tolerance_gives_the_worst_of_all_scaled_links(self, sized_scene, sized, plain_loads, along):
        """Each link's share of the torques is linear in its factor, so the worst case has all factors at their ends."""
        share = 0.13
        wide = bc.size(sized_scene, sized.inputs.motions[0], mass_tolerance=share)
        for k, joint in enumerate(wide.joints):
            nominal = sized.joints[k]
            for name, sign in (("max_torque", 1.0), ("min_torque", -1.0)):
                peak = joint.peaks[name]
                spread = share * np.abs(self._shares(sized, plain_loads, peak)[:, k]).sum()
                torque = at_peak(sized, plain_loads, peak)[0].torque[0, k]
                assert peak.value == pytest.approx(torque + sign * spread, rel=1e-8, abs=1e-9 * joint.peak_torque)
                loads = along[peak.motion]
                some = np.argsort(-sign * loads.torque[:, k])[:12]
                states = (x[some] for x in sized.inputs.motions[0].at(loads.time))
                others = [share * np.abs(plain_loads.link_shares(*x)[:, k]).sum() for x in zip(*states, strict=True)]
                most = np.max(sign * loads.torque[some, k] + others)
                assert most <= sign * peak.value + 1e-9 * joint.peak_torque
            q = np.array(joint.holding_position)
            rest = np.zeros(plain_loads.robot.nv)
            shares = plain_loads.link_shares(q, rest, rest)[:, k]
            held = abs(plain_loads.held(q)[k]) + share * np.abs(shares).sum()
            assert joint.holding_torque == pytest.approx(held, rel=1e-8, abs=1e-9)
            assert joint.holding_torque >= nominal.holding_torque * (1.0 - 1e-9)
            assert joint.rms_torque > nominal.cycles[0].rms_torque

    @staticmethod
    def _shares(sized, plain_loads, peak):
        motion = next(one for one in sized.inputs.motions if one.name == peak.motion)
        return plain_loads.link_shares(*(x[0] for x in motion.at([peak.time])))

    def test_the_csv_file_holds_the_same_numbers_with_units(self, sized, tmp_path):
        with sized.to_csv(tmp_path / "sizing.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        assert [row["joint"] for row in rows] == [one.name for one in (*sized.joints, *sized.structure)]
        for row, joint in zip(rows, sized.joints, strict=False):
            linear = joint.kind == "prismatic"
            assert (row["torque unit"], row["speed unit"]) == (("N", "m/s") if linear else ("N m", "rad/s"))
            expected = {
                "peak torque [torque unit]": joint.peak_torque,
                "peak torque at rows [torque unit]": joint.sampled_torque,
                "min torque [torque unit]": joint.min_torque, "max torque [torque unit]": joint.max_torque,
                "RMS torque [torque unit]": joint.rms_torque, "holding torque [torque unit]": joint.holding_torque,
                "peak speed [speed unit]": joint.peak_speed, "mean speed [speed unit]": joint.mean_speed,
                "peak motoring power [W]": joint.peak_motoring_power,
                "peak regenerating power [W]": joint.peak_regenerating_power,
                "motoring energy [J]": joint.motoring_energy, "regenerated energy [J]": joint.regenerated_energy,
                "friction share of peak [1]": joint.friction_share,
                "largest inertia [kg m^2 or kg]": joint.largest_inertia,
                "peak bearing force [N]": joint.peak_bearing_force,
                "peak tilting moment [N m]": joint.peak_tilting_moment,
                "peak torque at [s]": joint.peaks["peak_torque"].time,
                "effort limit [torque unit]": joint.effort_limit, "effort margin [1]": joint.effort_margin,
                "velocity limit [speed unit]": joint.velocity_limit, "velocity margin [1]": joint.velocity_margin,
                "position margin [rad or m]": joint.position_margin,
            }  # fmt: skip
            if shaft := joint.shaft:
                expected |= {
                    "shaft peak torque [N m]": shaft.peak_torque.value, "shaft RMS torque [N m]": shaft.rms_torque,
                    "shaft peak speed [rad/s]": shaft.peak_speed.value,
                    "load to rotor inertia [1]": shaft.inertia_ratio,
                    **{f"{name} margin [1]": margin for name, margin in shaft.margins.items()},
                    "tightest margin [1]": shaft.tightest_margin,
                }  # fmt: skip
            found = {key: float(row[key]) if row[key] else None for key in expected}
            assert found == expected
            assert row["peak torque in motion"] == joint.peaks["peak_torque"].motion
            assert row["tightest criterion"] == (joint.shaft.tightest if joint.shaft else "")
            assert row["shaft verdict"] == (joint.shaft.state if joint.shaft else "")
        for row, load in zip(rows[len(sized.joints) :], sized.structure, strict=True):
            assert float(row["peak bearing force [N]"]) == load.peak_force.value
            assert row["peak tilting moment [N m]"] == (str(load.peak_moment.value) if load.peak_moment else "")
            assert row["kind"] == load.kind

    def test_the_json_file_holds_the_same_numbers_with_places(self, sized, tmp_path):
        document = json.loads(sized.to_json(tmp_path / "sizing.json").read_text(encoding="utf-8"))

        def of(peak):
            return None if peak is None else vars(peak) | {"position": list(peak.position)}

        assert document["supply"] == of(sized.supply_peak) and document["regeneration"] == of(sized.regeneration_peak)
        assert document["gravity"] == list(sized.gravity) and document["inside"] == sized.inside
        assert document["exceeded"] == list(sized.exceeded)
        for entry, joint in zip(document["joints"], sized.joints, strict=True):
            assert entry["peaks"] == {name: of(peak) for name, peak in joint.peaks.items()}
            assert entry["cycles"] == [vars(cycle) for cycle in joint.cycles]
            assert entry["holding"] == {"torque": joint.holding_torque, "position": list(joint.holding_position)}
            assert entry["effort"] == {"limit": joint.effort_limit, "margin": joint.effort_margin}
            assert entry["velocity"] == {"limit": joint.velocity_limit, "margin": joint.velocity_margin}
            assert entry["position"]["range"] == list(joint.position_range)
            for name in ("rms_torque", "mean_speed", "motoring_energy", "regenerated_energy", "friction_share"):
                assert entry[name] == getattr(joint, name)
            if shaft := joint.shaft:
                assert entry["shaft"]["margins"] == dict(shaft.margins)
                for name in ("peak_torque", "peak_speed", "curve_use"):
                    assert entry["shaft"][name] == of(getattr(shaft, name))
                assert entry["shaft"]["rms_torque"] == shaft.rms_torque
                assert entry["shaft"]["actuator"]["ratio"] == shaft.actuator.ratio
        for entry, load in zip(document.get("structure", ()), sized.structure, strict=True):
            assert entry["peaks"] == {"force": of(load.peak_force), "moment": of(load.peak_moment)}
