"""Events are roots of their functions along an independent solution; stops end runs; latches are plastic impacts."""

import numpy as np
import pytest
from scipy.optimize import brentq

import bellcrank as bc

DIGITS = 1e-8  # of robot files, see simulation.py
WAVE = 90.0  # rad/s, of a function that crosses zero several times within a step of some machines


def roots(function, end, samples):
    """The zeros of a function of time in (0, end), with the signs of its change."""
    times = np.linspace(0.0, end, samples)
    values = np.array([function(t) for t in times])
    at = np.flatnonzero(values[:-1] * values[1:] < 0.0)
    found = [brentq(function, times[k], times[k + 1], xtol=1e-13) for k in at]
    return found, np.sign(values[at + 1] - values[at])


class Events:
    @pytest.fixture(scope="class")
    def hook(self, plain_scene, scipy_motion):
        """The world's x of the hook as a function of time, along SciPy's solution."""

        def x(t):
            q, v = np.split(scipy_motion(t)[:-1], [plain_scene.nq])
            return plain_scene.at(t, q, v).frame("hook").position[0]

        return x

    @pytest.fixture(scope="class")
    def crossing(self, loaded, level):
        return bc.simulate(loaded, overrides={"level": level})

    def test_crossings_are_the_roots_along_scipys_solution(self, crossing, hook, level, loaded_run):
        times, signs = roots(lambda t: hook(t) - level, loaded_run.time[-1], 150)
        assert len(times) >= 1 and loaded_run.events == ()
        expected = [
            (t, name) for t, s in zip(times, signs, strict=True) for name in ("rises" if s > 0 else "sinks", "passes")
        ]
        assert [(event.name) for event in crossing.events] == [name for _, name in expected]
        assert [event.time for event in crossing.events] == pytest.approx(
            [t for t, _ in expected], abs=1e-6 * times[-1]
        )
        assert not any(event.stopped for event in crossing.events)

    def test_the_state_of_an_event_is_that_of_the_motion_and_on_the_level(self, crossing, plain_scene, level):
        event = crossing.events[-1]
        plain_scene.at(event.time, event.position, event.velocity)
        assert plain_scene.frame("hook").position[0] == pytest.approx(level, abs=DIGITS)
        run = bc.simulate(crossing.scene, times=[0.0, event.time], overrides={"level": 1e3})
        scale = np.abs(run.state).max()
        assert event.position == pytest.approx(run.position[-1], abs=1e-9 * scale)
        assert event.velocity == pytest.approx(run.velocity[-1], abs=1e-9 * scale)
        assert event.multipliers == pytest.approx(run.multipliers[-1], rel=1e-7)
        assert event.latch is None and event.impulse == event.energy_lost == 0.0

    def test_event_functions_of_rows_are_the_distances_to_the_level(self, crossing, level):
        x = crossing.frame("hook").position[:, 0]
        assert crossing.event_values[:, :3] == pytest.approx(np.tile(x - level, (3, 1)).T, abs=1e-13)

    @pytest.fixture(scope="class")
    def reached(self, machine, loaded_run, scipy_motion):
        """Positions and velocities that joints reach in the run: (joint, what, place in (q, v, W), value)."""
        found, robot = [], loaded_run.robot
        for name in machine.loads.joints:
            joint = robot.joint(name)
            for what, place in {"position": joint.q, "velocity": robot.nq + joint.v}.items():
                found.append((name, what, place, float(scipy_motion(0.61 * loaded_run.time[-1])[place])))
        return found

    @pytest.fixture(scope="class")
    def watched(self, loaded, loaded_run, reached):
        """A run with a wave, joints that reach positions and velocities, and an end before the last row."""
        wave = {"expression": f"sin({WAVE}*t - 0.5)"}
        events = [{"name": name, "when": wave, "direction": name} for name in ("up", "down", "any")]
        events += [{"name": f"{name} {what}", "when": {"joint": name, what: x}} for name, what, _, x in reached]
        events += [{"name": "end", "when": {"expression": f"t - {float(0.83 * loaded_run.time[-1])!r}"}, "stop": True}]
        return bc.simulate(loaded, overrides={"events": events})

    def test_an_event_that_stops_ends_the_run(self, watched, loaded_run):
        end = 0.83 * loaded_run.time[-1]
        assert watched.status == "event" and watched.success and watched.events[-1].stopped
        assert watched.time[-1] == watched.events[-1].time == pytest.approx(end, rel=1e-13)
        assert watched.time[:-1] == pytest.approx(loaded_run.time[loaded_run.time < end], rel=1e-13)
        assert watched.message.endswith(f"event at {watched.time[-1]:.9g} s: event 'end' ended the run")
        assert np.array_equal(watched.position[-1], watched.events[-1].position)
        assert not any(event.stopped for event in watched.events[:-1])

    def test_all_crossings_of_a_fast_wave_are_found(self, watched):
        """sin(ω t - 1/2) at (1/2 + k π)/ω, up where k is even, also several times within a step."""
        count = int((WAVE * watched.time[-1] - 0.5) / np.pi) + 1
        times = (0.5 + np.pi * np.arange(count)) / WAVE
        expected = [(name, t) for k, t in enumerate(times) for name in (("up", "down")[k % 2], "any")]
        found = [event for event in watched.events if event.name in ("up", "down", "any")]
        assert count >= 5 and [event.name for event in found] == [name for name, _ in expected]
        assert [event.time for event in found] == pytest.approx([t for _, t in expected], abs=1e-12)

    def test_joints_reach_positions_and_velocities_at_the_roots_along_scipys_solution(
        self, watched, scipy_motion, reached
    ):
        for name, what, place, x in reached:
            times, _ = roots(lambda t, at=place, level=x: scipy_motion(t)[at] - level, watched.time[-1], 200)
            events = [event for event in watched.events if event.name == f"{name} {what}"]
            assert len(events) >= 1
            assert [event.time for event in events] == pytest.approx(times, abs=1e-6 * watched.time[-1])
            at = [
                getattr(event, what)[watched.robot.joint(name).q if what == "position" else watched.robot.joint(name).v]
                for event in events
            ]
            assert at == pytest.approx([x] * len(at), abs=1e-9 * max(abs(x), 1.0))

    def test_a_latch_is_a_plastic_impact(self, loaded, level, plain_scene):
        """M (v⁺ − v⁻) = Jᵀ Λ with J v⁺ = 0 of the constraints and the level; the removed motion's energy is lost."""
        run = bc.simulate(loaded, overrides={"level": level, "events.passes.latch": True})
        event = run.events[-1]
        latch, before = event.latch, event.velocity
        assert run.status == "event" and latch is not None and event.name == "passes"
        plain_scene.at(event.time, event.position, before)
        rows, mass = plain_scene.frame("hook").jacobian[:1], plain_scene.mass_matrix()
        kept = []
        if plain_scene.scene_data.get("constraints"):
            jacobian = plain_scene.jacobian()[0]
            kept = np.flatnonzero(np.abs(jacobian).max(axis=1) > 1e-9)
            rows = np.vstack([jacobian[kept], rows])
        impulses = np.linalg.solve(rows @ np.linalg.solve(mass, rows.T), -rows @ before)
        jump = np.linalg.solve(mass, rows.T @ impulses)
        scale = np.abs(impulses).max()
        assert latch.velocity == pytest.approx(before + jump, abs=1e-6 * np.abs(before).max())
        assert latch.impulse == event.impulse == pytest.approx(impulses[-1], abs=1e-6 * scale)
        assert latch.constraint_impulses == pytest.approx(impulses[:-1], abs=1e-6 * scale)
        lost = 0.5 * before @ mass @ before - 0.5 * latch.velocity @ mass @ latch.velocity
        assert latch.energy_lost == event.energy_lost == pytest.approx(lost, rel=1e-6) and lost > 0.0
        assert latch.energy_lost == pytest.approx(0.5 * jump @ mass @ jump, rel=1e-6)
