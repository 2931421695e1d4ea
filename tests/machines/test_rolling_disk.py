"""Rolling thin disk: a free body with non-holonomic constraints.

It has no joints, so that no motor follows a motion and no derivative is by a joint's length; it rests nowhere, but
rolls steadily.
"""

import math

import numpy as np
import pytest
import yaml
from loads import Loads
from machine import Machine
from properties.certificates import Certificates
from properties.command_line import CommandLine
from properties.constrained_motion import ConstrainedMotion
from properties.derivatives import Derivatives, SceneDerivatives
from properties.dynamics import Dynamics, FreeBaseDynamics
from properties.events import Events
from properties.files import Continuation, RunFiles
from properties.free_base import FreeBase
from properties.messages import Messages
from properties.modes import LinearEquations, matched
from properties.pages import Pages
from properties.robot_files import RobotFiles
from properties.scene_dynamics import SceneEquations
from properties.sensitivities import LatchSensitivities, OutputSensitivities
from properties.simulation import Simulation
from properties.sizing_messages import NotSized
from properties.solvers import Solvers
from properties.sweep import ConstrainedSweeps, Sweeps

import bellcrank as bc

GRAVITY, RADIUS = 9.81, 0.1


class TestRollingDisk(
    RobotFiles,
    Dynamics,
    FreeBaseDynamics,
    Derivatives,
    SceneEquations,
    SceneDerivatives,
    LinearEquations,
    Certificates,
    FreeBase,
    Simulation,
    Solvers,
    ConstrainedMotion,
    Events,
    OutputSensitivities,
    Sweeps,
    RunFiles,
    Pages,
    Messages,
    CommandLine,
    Continuation,
    LatchSensitivities,
    ConstrainedSweeps,
    NotSized,
):
    machine = Machine(
        "thin_disk",
        "rolling_disk",
        floating_base=True,
        duration=2.0,
        loads=Loads(
            links=("disk", "disk"),
            joints={},
            force=0.6,
            reach=0.08,
            duration=0.5,
            start={"base": {"rpy": [0.2, 0.3, 0.8], "angular_velocity": [1.7, 3.5, 0.6], "expressed_in": "body"}},
        ),
    )

    def test_straight_rolling_grows_or_swings_as_published(self, scene):
        """λ² = 4 (g/r − 3 Ω²)/5 for a thin disk: stable above Ω² = g/(3 r) (Neimark & Fufaev 1972, ch. 2)."""
        upright, limit = {"rpy": [0, 0, 0.3], "expressed_in": "body"}, GRAVITY / (3.0 * RADIUS)
        spins = [[0.0, float(np.sqrt(share * limit)), 0.0] for share in (0.4, 0.9, 1.2, 3.0)]
        loci = bc.root_loci(scene, "base", [upright | {"angular_velocity": spin} for spin in spins])
        for spin, linear, row in zip(spins, loci.linearisations, loci.eigenvalues, strict=True):
            assert linear.kind == "relative equilibrium" and linear.stable is (spin[1] ** 2 > limit)
            root = np.sqrt(complex(0.8 * (GRAVITY / RADIUS - 3.0 * spin[1] ** 2)))
            matched(row, [root, -root, 0.0, 0.0], 1e-9)

    def test_multipliers_of_a_turn_are_exponentials_of_the_eigenvalues_of_straight_rolling(self, scene):
        """The disk returns after each turn; det Φ = exp(T trace A) = 1."""
        spin = 8.3
        base = {"rpy": [0, 0, 0.3], "angular_velocity": [0, spin, 0], "expressed_in": "body"}
        rolling = scene.with_overrides({"base": base})
        linear, found = bc.linearise(rolling), bc.floquet(rolling, 2.0 * np.pi / spin)
        matched(found.multipliers, np.exp(linear.eigenvalues * found.period), 1e-6)
        assert np.linalg.det(found.monodromy) == pytest.approx(1.0, abs=1e-9) and found.stable

    def test_an_upright_disk_that_is_pushed_rolls_straight_until_it_lifts_off(self, tmp_path):
        """m a = F + f and I a/r = -f r with I = m r²/2; the normal force is m g less a lift that grows with time."""
        mass, radius, g, push, growth, heading = 0.5, 0.1, 9.81, 0.7, 11.0, 0.6
        along = [math.cos(heading), math.sin(heading), 0.0]
        rows = "".join(f"{t},{push * along[0]!r},{push * along[1]!r},{growth * t!r}\n" for t in (0.0, 1.0))
        (tmp_path / "lift.csv").write_text(f"time [s],force x [N],force y [N],force z [N]\n{rows}")
        data = self.machine.load_scene().data
        data |= {"base": {"rpy": [0, 0, heading], "angular_velocity": [0, 12.0, 0], "expressed_in": "body"}}
        data |= {"forces": [{"name": "lift", "kind": "wrench", "frame": "disk", "file": "lift.csv"}]}
        (tmp_path / "scene.yaml").write_text(yaml.safe_dump(data))
        run = bc.simulate(tmp_path / "scene.yaml", duration=1.0, rtol=1e-11, atol=1e-11)
        t = run.time
        assert run.events[-1].name == "floor contact lost" and t[-1] == pytest.approx(mass * g / growth, rel=1e-9)
        way = radius * 12.0 * t + 0.5 * push / (1.5 * mass) * t**2
        assert run.position[:, :3] - run.position[0, :3] == pytest.approx(np.outer(way, along), abs=1e-9)
        normal, forwards, sideways = run.multipliers.T
        assert normal == pytest.approx(mass * g - growth * t, abs=1e-8)
        assert forwards == pytest.approx(np.full(len(t), -push / 3), abs=1e-8) and np.abs(sideways).max() < 1e-9
        assert run.output("contact") == pytest.approx(run.position[:, :3] - [0, 0, radius], abs=1e-10)
        assert run.output("friction")[:-1] == pytest.approx(push / 3 / (mass * g - growth * t[:-1]), rel=1e-7)
        assert run.work == pytest.approx(push * way, abs=1e-8)

    def test_friction_demand_is_reached_where_plain_pinocchio_has_it(self, loaded, loaded_run, plain_rows, plain_scene):
        normal, *friction = plain_rows["multipliers"].T
        assert loaded_run.output("friction_demand") == pytest.approx(np.hypot(*friction) / normal, rel=1e-8)
        centre = loaded_run.position[:, :3]
        contact = loaded_run.output("contact_point")
        assert contact[:, 2] == pytest.approx(0.0, abs=1e-12)
        assert np.linalg.norm(contact - centre, axis=1) == pytest.approx(0.1, abs=1e-12)
        limit = float(np.median(loaded_run.output("friction_demand")))
        when = {"friction_demand": {"constraint": "floor", "limit": limit}}
        run = bc.simulate(loaded, overrides={"events": [{"name": "slips", "when": when}]})
        event = next(event for event in run.events if event.name == "slips")
        plain_scene.at(event.time, event.position, event.velocity)
        normal, *friction = plain_scene.accelerations()[1]
        assert np.hypot(*friction) / normal == pytest.approx(limit, rel=1e-7)
        before = np.searchsorted(loaded_run.time, event.time) - 1
        assert loaded_run.output("friction_demand")[before] < limit < loaded_run.output("friction_demand")[before + 1]
