"""Selection of a machine's motors and gears from a small catalogue, against criteria judged sample by sample."""

import csv
import json
import math

import numpy as np
import pytest
from brute_criteria import Brute
from plain_loads import PlainLoads
from properties.dynamics import close
from sized import SELECTED, SIZED

import bellcrank as bc

TIERS = ("all criteria shown", "passes what is known", "fails")
MAIN = ("motor speed", "continuous torque", "peak torque", "peak current", "voltage limit", "gear repeated peak torque")
NOTES = ("resonance", "error at the axis")
TOLERANCE = 2e-5  # of a limit, in every verdict
TEMPERATURES = ("winding temperature", "housing temperature")
MERGED = 2e-3  # of a temperature: the loss is averaged over short intervals


def conditions_of(sized, **others):
    """Of the selection, such that the bus stores a part of what comes back."""
    energy = sum(joint.regenerated_energy for joint in sized.joints)
    return bc.Conditions(
        voltage=45.0, voltage_ratio=1.7, voltage_reserve=0.06, winding_temperature=60.0, ambient=31.0, altitude=1300.0,
        safety_factor=1.1, inertia_ratio=23.0,
        life=900.0, brake=True, supply_power=2.0 * sized.peak_supply_power, bus_max_voltage=60.0,
        bus_capacitance=0.002 * energy / (0.5 * (60.0**2 - 45.0**2)), brake_resistor_power=3.0 * energy,
        momentary_loads={sized.joints[0].name: 3.1 * sized.joints[0].peak_torque}, **others,
    )  # fmt: skip


def cylinders(*products):
    """Mass, inertia along and across the axis of solid cylinders one behind the other."""
    parts = [(one.mass, one.diameter / 2.0, one.length) for one in products if one.kind != "direct"]
    mass, at, centres = sum(m for m, _, _ in parts), 0.0, []
    for _, _, length in parts:
        centres.append(at + length / 2.0)
        at += length
    middle = sum(m * x for (m, _, _), x in zip(parts, centres, strict=True)) / mass
    along = sum(m * r**2 / 2.0 for m, r, _ in parts)
    across = sum(
        m * (3.0 * r**2 + length**2) / 12.0 + m * (x - middle) ** 2
        for (m, r, length), x in zip(parts, centres, strict=True)
    )
    return mass, along, across


class Selection:
    @pytest.fixture(scope="class")
    def request_of(self, machine):
        """The arguments of the selection."""
        given = dict(SELECTED[machine.sized_name])
        if "mounts" in given:
            given["mounts"] = {name: bc.Mount(**mount) for name, mount in given["mounts"].items()}
        return given

    @pytest.fixture(scope="class")
    def selection(self, machine, sized, catalogue, request_of):
        name, changes = machine.sized_name, SIZED[machine.sized_name]
        given = {"catalogue": catalogue, "conditions": conditions_of(sized), "overrides": changes, **request_of}
        return bc.select(name, candidates=max(2, 8 // len(sized.joints)), effort=500, **given)

    @pytest.fixture(scope="class")
    def laden_loads(self, machine, sized_scene, selection):
        """The loads by plain Pinocchio with the chosen motors and gears on the robot."""
        bodies = {one.axis.name: cylinders(one.chosen.motor, one.chosen.gear) for one in selection.axes}
        mounts = SELECTED[machine.sized_name].get("mounts")
        return PlainLoads(sized_scene, [one.axis.name for one in selection.axes], bodies, mounts)

    @pytest.fixture(scope="class")
    def brutes(self, selection):
        """(axis, pair) -> the pair's criteria in each cycle, sample by sample."""
        return {
            (k, one.id): [Brute(one.motor, one.gear, cycle, k, axis.conditions) for cycle in selection.cycles]
            for k, axis in enumerate(selection.axes)
            for one in axis.candidates
        }

    # ---- loads

    @staticmethod
    def timeline(selection, motions, duty):
        """Of each cycle: (motion, pause, passes), in the order of the cycle; a pause holds the end of its motion."""
        if duty is None:
            return [[(motion, 0.0, 1)] for motion in motions]
        named, steps, before = {motion.name: motion for motion in motions}, [], None
        for step in duty:
            given = {"motion": step} if isinstance(step, str) else step
            before = named[given["motion"]] if "motion" in given else before
            new = (before, given.get("pause", 0.0), given.get("repeat", 1))
            if steps and steps[-1][:2] == new[:2]:
                new = (*new[:2], new[2] + steps.pop()[2])
            steps.append(new)
        return [steps]

    def test_cycles_are_the_loads_with_the_chosen_motors_on_the_robot(self, sized, selection, laden_loads, request_of):
        timeline = self.timeline(selection, sized.inputs.motions, request_of.get("duty"))
        places, columns = laden_loads.places, laden_loads.columns
        assert len(selection.cycles) == len(timeline)
        for cycle, steps in zip(selection.cycles, timeline, strict=True):
            lengths = [pause or motion.duration for motion, pause, _ in steps]
            assert cycle.duration == pytest.approx(
                sum(length * passes for length, (*_, passes) in zip(lengths, steps, strict=True)), rel=1e-12
            )
            assert [passes for *_, passes in cycle.sequence] == [passes for *_, passes in steps]
            begin, seen = 0.0, {}
            for (first, end, passes), (motion, pause, _), length in zip(cycle.sequence, steps, lengths, strict=True):
                rows = np.flatnonzero((cycle.interval >= first) & (cycle.interval < end))
                known = seen.setdefault((first, end), [begin, 0])
                known[1] += passes
                begin += length * passes
                seen[first, end] += [motion, pause, rows, length]
            for start, passes, motion, pause, rows, length, *_ in seen.values():
                assert cycle.weight[rows].sum() == pytest.approx(length * passes, rel=1e-12)
                some = rows[:: max(1, len(rows) // 60)]
                time = np.full(len(some), motion.time[-1]) if pause else cycle.time[some] - start + motion.time[0]
                q, v, a = motion.at(np.clip(time, motion.time[0], motion.time[-1]))
                v, a = (0.0 * x if pause else x for x in (v, a))
                loads = [laden_loads.at(*state) for state in zip(time, q, v, a, strict=True)]
                held = [laden_loads.held(*state) for state in zip(q, time, strict=True)]
                expected = {
                    "torque": [one["torque"] for one in loads], "static_torque": held, "position": q[:, places],
                    "speed": v[:, columns], "acceleration": a[:, columns],
                    "axial_force": [one["axial"] for one in loads],
                    "tilting_moment": [one["tilting"] for one in loads], "inertia": [one["inertia"] for one in loads],
                }  # fmt: skip
                for name, values in expected.items():
                    close(getattr(cycle, name)[some], values, 1e-8)

    def test_sums_over_a_cycle_are_integrals_and_its_samples_have_the_peaks(
        self, sized, selection, laden_loads, request_of
    ):
        motion = sized.inputs.motions[-1]
        loads = laden_loads.along(motion, 160)
        cycle = selection.cycles[0 if request_of.get("duty") else -1]
        rows = np.arange(len(cycle.time))
        if request_of.get("duty"):
            steps = self.timeline(selection, sized.inputs.motions, request_of["duty"])[0]
            part = cycle.sequence[next(k for k, step in enumerate(steps) if step[0] is motion and not step[1])]
            rows = np.flatnonzero((cycle.interval >= part[0]) & (cycle.interval < part[1]))
        share = cycle.weight[rows] / cycle.weight[rows].sum()
        for k in range(len(selection.axes)):
            torque, speed = cycle.torque[rows, k], np.abs(cycle.speed[rows, k])
            assert np.sqrt(share @ torque**2) == pytest.approx(loads.rms(loads.torque[:, k]), rel=1e-5)
            mean = loads.integral(np.abs(loads.speed[:, k])) / motion.duration
            assert share @ speed == pytest.approx(mean, rel=1e-6)
            assert np.abs(torque).max() >= np.abs(loads.torque[:, k]).max() * (1.0 - 1e-4)
            assert speed.max() >= np.abs(loads.speed[:, k]).max() * (1.0 - 1e-8)

    # ---- criteria

    def test_criteria_of_each_candidate_are_those_judged_sample_by_sample(self, selection, brutes):
        for k, axis in enumerate(selection.axes):
            momentary = dict(axis.conditions.momentary_loads)
            for rank, one in enumerate(axis.candidates):
                expected = {}
                for brute in brutes[k, one.id]:
                    hot = rank == 0
                    for name, use in brute.uses(temperatures=hot).items():
                        expected.setdefault(name, []).append(use)
                load = momentary.get(axis.axis.name, math.nan) * axis.conditions.safety_factor
                limit = one.gear.momentary_torque
                expected["gear momentary torque"] = [math.nan if limit is None else load / limit]
                if one.motor.peak_torque is None:  # what may act all the time may act as a peak
                    expected["peak torque"] = [
                        np.abs(brute.T).max() / one.motor.nominal_torque for brute in brutes[k, one.id]
                    ]
                for result in one.criteria:
                    uses = expected.get(result.name, [math.nan])
                    if result.name in TEMPERATURES and np.isnan(uses).any():  # not looked at, or shown by a bound
                        continue
                    if result.use is not None:
                        bound = MERGED if result.name in TEMPERATURES else 1e-8
                        slack = 1.5e-2 if result.name == "peak duration" else 1e-9  # samples differ at its ends
                        assert result.use == pytest.approx(np.max(uses), rel=bound, abs=slack), (one.id, result.name)
                        assert result.verdict == ("exceeded" if result.use > 1.0 + TOLERANCE else "inside")
                    else:
                        assert result.verdict in ("note", "unknown")

    def test_a_candidate_is_as_good_as_its_worst_criterion(self, selection):
        for axis in selection.axes:
            for one in axis.candidates:
                judged = {result.name: result for result in one.criteria if result.verdict != "note"}
                known = {name: result.use for name, result in judged.items() if result.use is not None}
                assert one.largest_use == pytest.approx(max(known.values()), rel=1e-12)
                assert known[one.binding] == max(known.values())
                assert one.unknown == tuple(name for name, result in judged.items() if result.verdict == "unknown")
                fails = any(result.verdict == "exceeded" for result in judged.values())
                assert one.tier == TIERS[2 if fails else 1 if one.unknown else 0]
                assert one.mass == pytest.approx(one.motor.mass + one.gear.mass, rel=1e-14)
                assert one.cost == pytest.approx(one.motor.price + (one.gear.price or 0.0), rel=1e-14)

    def test_the_loss_is_what_goes_in_less_what_comes_out(self, selection, brutes):
        """With the winding at 25 °C and without the power of the actuator's own inertia."""
        for (k, id_), each in brutes.items():
            one = next(candidate for candidate in selection.axes[k].candidates if candidate.id == id_)
            losses = []
            for brute in each:
                plain = Brute(one.motor, one.gear, brute.cycle, k, bc.Conditions())
                copper = one.motor.resistance * (plain.Te / plain.k) ** 2
                friction = plain.tc * np.sign(plain.omega) + plain.cv * plain.omega
                through = plain.through_gear() + friction
                losses.append(plain.mean(copper + through * plain.omega - plain.tau * plain.dq))
            assert one.loss == pytest.approx(max(losses), rel=1e-9)

    def test_notes_tell_resonance_and_error_at_the_axis_and_the_ratio_of_inertias_its_range(self, selection):
        for k, axis in enumerate(selection.axes):
            one, inertia = axis.chosen, np.concatenate([cycle.inertia[:, k] for cycle in selection.cycles])
            notes = {result.name: result for result in one.criteria if result.name in NOTES}
            assert {note.verdict for note in notes.values()} == {"note"}
            n, rotor, gear = one.gear.ratio, one.motor.rotor_inertia, one.gear.inertia
            (ratio,) = (result.text for result in one.criteria if result.name == "inertia ratio")
            assert f"{(inertia.max() / n**2 + gear) / rotor:.3g} times" in ratio
            held = math.sqrt(one.gear.stiffness / inertia.max()) / (2.0 * math.pi)
            free = math.sqrt(one.gear.stiffness * (1.0 / inertia.max() + 1.0 / (n**2 * (rotor + gear)))) / math.tau
            assert notes["resonance"].text.startswith(f"{held:.3g} Hz with the rotor held, {free:.3g} Hz free")
            torque = axis.conditions.safety_factor * max(np.abs(cycle.torque[:, k]).max() for cycle in selection.cycles)
            unit, factor = ("mm", 1e3) if axis.axis.kind == "linear" else ("arcmin", 60.0 * 180.0 / math.pi)
            text = notes["error at the axis"].text
            assert text.startswith(f"backlash {one.gear.backlash * factor:.3g} {unit}")
            assert f"wind-up {torque / one.gear.stiffness * factor:.3g} {unit}" in text or (
                f"wind-up {torque / axis.conditions.safety_factor / one.gear.stiffness * factor:.3g}" in text
            )

    def test_the_supply_and_the_bus_bear_all_axes_together(self, selection, brutes):
        conditions = selection.conditions
        supply, bus = [], []
        for number in range(len(selection.cycles)):
            chosen = [brutes[k, axis.chosen.id][number] for k, axis in enumerate(selection.axes)]
            supply.append(np.max(sum(self.power(one, one.motor.max_winding_temperature) for one in chosen)))
            bus.append(self.overflow(-sum(self.power(one, 25.0) for one in chosen), chosen[0], conditions))
        power, energy, bus_of_all = selection.system
        assert [one.name for one in selection.system] == ["supply power", "regenerated energy", "common bus"]
        assert bus_of_all.verdict == "note"  # the voltage is given, with which each motor is compared
        assert power.use == pytest.approx(max(supply) / conditions.supply_power, rel=1e-9)
        expected = max(bus) / conditions.brake_resistor_power
        assert expected > 0.0
        assert energy.use == pytest.approx(expected, rel=1e-6)
        for result in (power, energy):
            assert result.verdict == ("exceeded" if result.use > 1.0 + TOLERANCE else "inside")

    @staticmethod
    def power(brute, temperature):
        """From the bus (n,), W, with a winding of a temperature."""
        warm = brute.motor.resistance * (1.0 + 0.0039 * (temperature - 25.0))
        return warm * (brute.Te / brute.k) ** 2 + brute.Te * brute.omega

    @staticmethod
    def overflow(back, brute, conditions):
        """Mean power, W, that the capacitor leaves to the brake resistor, after cycles enough that it settles."""
        capacity = 0.5 * conditions.bus_capacitance * (conditions.bus_max_voltage**2 - conditions.voltage**2)
        energy = (back * brute.pass_weight())[brute.in_order()].tolist()
        stored = spilled = 0.0
        for _ in range(6):
            spilled = 0.0
            for change in energy:
                stored = max(stored + change, 0.0)
                spilled += max(stored - capacity, 0.0)
                stored = min(stored, capacity)
        return spilled / brute.t

    # ---- choice

    def test_candidates_are_ranked_by_tier_unknown_criteria_objective_and_use(self, selection):
        for axis in selection.axes:
            others = [one for one in axis.candidates if one.id != axis.chosen.id]
            keys = [self.key(selection.objective, one) for one in others]
            assert keys == sorted(keys)
            assert sum(count for _, count in axis.counts) >= len(axis.candidates)

    @staticmethod
    def key(objective, one):
        values = {"mass": one.mass, "cost": one.cost, "loss": one.loss, "margin": one.largest_use}
        value = values[objective] if one.tier != TIERS[1] or objective != "margin" else None
        main = sum(name in MAIN for name in one.unknown)
        known = round(value, 9) if value is not None else 0.0
        if one.tier == TIERS[2]:  # those that fail by how far they are from the limits
            return 1, 0, 0, round(one.largest_use, 9), value is None, known
        return 0, TIERS.index(one.tier), main, value is None, known, round(one.largest_use, 9)

    def test_totals_are_those_of_the_chosen_pairs(self, selection, request_of):
        chosen = [axis.chosen for axis in selection.axes]
        for name in ("mass", "cost", "loss"):
            assert getattr(selection, name) == pytest.approx(sum(getattr(one, name) for one in chosen), rel=1e-12)
        kept = request_of.get("keep", {})
        assert {axis.axis.name: axis.chosen.id for axis in selection.axes if axis.kept} == kept
        passes = all(one.tier != TIERS[2] for one in chosen)
        assert selection.inside == (passes and all(one.verdict != "exceeded" for one in selection.system))
        assert selection.shown == (
            all(one.tier == TIERS[0] for one in chosen)
            and all(one.verdict in ("inside", "note") for one in selection.system)
        )

    def test_no_combination_of_the_front_betters_another_one(self, selection):
        assert selection.pareto
        points = [(p.mass, p.largest_use, p.loss, p.cost) for p in selection.pareto]
        for k, point in enumerate(points):
            for other in points[:k] + points[k + 1 :]:
                assert not (np.all(np.array(other) <= point) and np.any(np.array(other) < point))
        candidates = {(k, one.id): one for k, axis in enumerate(selection.axes) for one in axis.candidates}
        for point in selection.pareto:
            known = [candidates.get((k, id_)) for k, id_ in enumerate(point.pairs)]
            if None not in known:
                assert point.mass == pytest.approx(sum(one.mass for one in known), rel=1e-12)
                assert point.cost == pytest.approx(sum(one.cost for one in known), rel=1e-12)

    # ---- files

    def test_the_files_hold_the_same_numbers_with_units(self, selection, tmp_path):
        document = json.loads(selection.to_json(tmp_path / "selection.json").read_text(encoding="utf-8"))
        with selection.to_csv(tmp_path / "selection.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        for name in ("mass", "cost", "loss", "objective", "proof", "inside"):
            assert document[name] == getattr(selection, name)
        listed = [(axis, one, rank) for axis in selection.axes for rank, one in enumerate(axis.candidates, 1)]
        for row, (axis, one, rank) in zip(rows, listed, strict=True):
            assert (row["axis"], row["rank"], row["class"]) == (axis.axis.name, str(rank), one.tier)
            assert row["chosen"] == ("yes" if one.id == axis.chosen.id else "no")
            assert (row["motor"], row["gear"]) == (one.motor.id, one.gear.id)
            for column, value in (
                ("largest use [1]", one.largest_use), ("mass [kg]", one.mass), ("price", one.cost),
                ("loss [W]", one.loss), *((f"{each.name} use [1]", each.use) for each in one.criteria),
            ):  # fmt: skip
                assert (float(row[column]) if row[column] else None) == value
            assert all(row[f"{each.name} verdict"] == each.verdict for each in one.criteria)
        for entry, axis in zip(document["axes"], selection.axes, strict=True):
            assert entry["chosen"] == axis.chosen.id and entry["counts"] == dict(axis.counts)
            for found, one in zip(entry["candidates"], axis.candidates, strict=True):
                assert found["criteria"] == [vars(each) for each in one.criteria]
        for entry, cycle in zip(document["cycles"], selection.cycles, strict=True):
            share = cycle.weight / cycle.duration
            for k, found in enumerate(entry["axes"]):
                assert found["rms_torque"] == pytest.approx(np.sqrt(share @ cycle.torque[:, k] ** 2), rel=1e-12)
                assert found["peak_torque"] == np.abs(cycle.torque[:, k]).max()
                assert found["mean_speed"] == pytest.approx(share @ np.abs(cycle.speed[:, k]), rel=1e-12)
                assert found["peak_speed"] == np.abs(cycle.speed[:, k]).max()

    def test_a_catalogue_is_read_as_it_was_written(self, catalogue, tmp_path):
        bc.write_catalogue(catalogue.motors, catalogue.gears, tmp_path / "own")
        found = bc.load_catalogue(tmp_path / "own", contradicting=True)
        for wanted, there in ((catalogue.motors, found.motors), (catalogue.gears, found.gears)):
            by_id = {one.id: one for one in there}
            for one in wanted:
                for name, value in vars(one).items():
                    other = getattr(by_id[one.id], name)
                    if isinstance(value, float | tuple):
                        assert np.allclose(other, value, rtol=1e-12, atol=0.0)
                    else:
                        assert other == value


class WrittenSelection(Selection):
    def test_the_written_configuration_is_sized_to_the_same_uses(self, selection, request_of, tmp_path):
        path = selection.write_config(tmp_path / "chosen.yaml")
        again = bc.size(path, trust=tmp_path)
        for k, axis in enumerate(selection.axes):
            one, shaft = axis.chosen, again.joint(axis.axis.name).shaft
            criteria = {each.name: each for each in one.criteria}
            assert (shaft.actuator.motor, shaft.actuator.gear) == selection.stated(one)
            judged = {name: 1.0 - margin for name, margin in shaft.margins.items() if margin is not None}
            assert judged == pytest.approx({name: each.use for name, each in criteria.items() if each.use is not None},
                                           rel=1e-9)  # fmt: skip
            plain = [Brute(one.motor, one.gear, cycle, k, bc.Conditions()) for cycle in selection.cycles]
            assert shaft.peak_torque.value == pytest.approx(max(np.abs(each.T).max() for each in plain), rel=1e-4)
            if not request_of.get("duty"):
                for cycle, each in zip(again.joint(axis.axis.name).cycles, plain, strict=True):
                    assert cycle.rms_shaft_torque == pytest.approx(math.sqrt(each.mean(each.T**2)), rel=2e-3)
