"""Blocks of designs: each has the parameters, start, settings or reason that it has alone."""

import pickle
from dataclasses import dataclass

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.dynamics.equations import design_parameters as by_parameters
from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.errors import BellcrankError
from bellcrank.studies.designs.plain_axes import ValueKind, plain_axes
from bellcrank.studies.designs.scene_designs import SceneDesigns
from bellcrank.studies.execution.design_runner import infeasible_reason


@dataclass(frozen=True)
class Sampled:
    """An axis with a range, or with values that are not numbers."""

    path: str
    low: float = 0.0
    high: float = 0.0
    unit: str = ""
    choices: tuple = ()

    numeric = property(lambda self: not self.choices)

    def value(self, number):
        if self.choices:
            return self.choices[int(number)]
        return f"{number!r} {self.unit}" if self.unit else number

    def draw(self, random, count):
        if self.choices:
            return random.integers(len(self.choices), size=count).astype(float)
        return random.uniform(self.low, self.high, count)


RADII = {"r": {"value": 0.1, "sets": ["constraint.left_floor.radius", "constraint.right_floor.radius"]}}
SCENES = {
    "four-bar, lengths": (
        "four_bar",
        {},
        [
            Sampled("crank_length", 0.6, 1.6),
            Sampled("parameters.coupler_length", 1.0, 1.3),
            Sampled("parameters.rocker_length.value", 1.1, 1.4, "m"),
            Sampled("ground_length", 110.0, 130.0, "cm"),
        ],
    ),
    "four-bar, start and settings": (
        "four_bar",
        {},
        [
            Sampled("crank_length", 1.15, 1.24),
            Sampled("initial.crank", -5.0, 60.0, "deg"),
            Sampled("initial.coupler.guess", 5.0, 6.5),
            Sampled("initial.velocity.crank", -1.0, 1.0),
            Sampled("simulate.rtol", -1e-3, 1e-3),
            Sampled("simulate.duration", 1.0, 5.0),
            Sampled("simulate.max_step", 10.0, 50.0, "ms"),
        ],
    ),
    "four-bar, solvers": (
        "four_bar",
        {},
        [
            Sampled("simulate.solver", choices=("RK45", "RK4", "Radau", "none of them")),
            Sampled("simulate.step", -0.001, 0.01),
            Sampled("simulate.stabilisation", choices=("none", {"kind": "baumgarte", "alpha": 3, "beta": 2})),
        ],
    ),
    "five-bar, gains and lengths": (
        "five_bar",
        {
            "parameters": {
                "kp": {"value": 8, "sets": ["control.motors.kp"]},
                "reach": {"value": 0.09, "sets": ["frame.right_tip.origin.x"]},
            }
        },
        [
            Sampled("kp", -1.0, 20.0),
            Sampled("reach", 0.02, 0.12),
            Sampled("initial.left_elbow.guess", -90.0, 90.0, "deg"),
        ],
    ),
    "hinges in space": (
        "bricard",
        {"parameters": {"rod": {"value": 1, "sets": ["frame.P5.origin.y"]}}},
        [Sampled("rod", 0.99, 1.01)],
    ),
    "two loops": (
        "n_four_bar_2",
        {"parameters": {"post": {"value": 1, "sets": ["frame.B1.origin.y"]}}},
        [Sampled("post", 0.9, 1.1), Sampled("initial.velocity.crank_0", -2.0, 2.0)],
    ),
    "a disk on a free base": (
        "rolling_disk",
        {
            "parameters": {
                "r": {"value": 0.1, "sets": ["constraint.floor.radius"]},
                "m": {"value": 1, "sets": ["link.disk.mass"]},
            }
        },
        [
            Sampled("r", 0.05, 0.2),
            Sampled("m", -0.1, 1.0),
            Sampled("base.rpy", choices=([0.1, 0, 0], [1.5707963267948966, 0, 0])),
        ],
    ),
    "a disk in six coordinates": (
        "rolling_disk_six",
        {"parameters": {"r": {"value": 0.1, "sets": ["constraint.floor.radius"]}}},
        [
            Sampled("r", 0.05, 0.2),
            Sampled("initial.tilt", -90.0, 90.0, "deg"),
            Sampled("initial.velocity.spin", -400.0, 400.0, "deg/s"),
        ],
    ),
    "two wheels, whose side forces are redundant": (
        "two_wheeler",
        {"parameters": RADII, "base.position": {"x": 0}, "base.angular_velocity": {"x": 0, "y": 0}},
        [Sampled("r", 0.08, 0.12), Sampled("initial.velocity.left", -30.0, 30.0)],
    ),
    "a spring": (
        "spring_pendulum",
        {"parameters": {"k": {"value": 15, "sets": ["force.spring.stiffness"]}}},
        [
            Sampled("k", -5.0, 20.0),
            Sampled("initial.slide", 4.0, 6.0, "m"),
            Sampled("initial.velocity.swing", -1.0, 1.0),
        ],
    ),
    "inertias": (
        "pendulum",
        {
            "parameters": {
                "i": {"value": 0.2, "sets": ["link.rod.inertia.xx"]},
                "j": {"value": 0.0, "sets": ["link.rod.inertia.xz"]},
                "k": {"value": 0.2, "sets": ["link.rod.inertia.zz"]},
                "m": {"value": 1, "sets": ["link.rod.mass"]},
            }
        },
        [Sampled("i", -0.1, 0.5), Sampled("j", -0.3, 0.3), Sampled("m", -0.2, 1.0)],
    ),
    "a motion that is followed": (
        "planar_2r_tracking",
        {},
        [Sampled("mass_error", -150.0, 100.0, "%"), Sampled("initial.elbow", -1.5, -0.5)],
    ),
}


def designs_of(case, count=24):
    name, overrides, axes = SCENES[case]
    scene = bc.load_scene(name, overrides)
    random = np.random.default_rng(3)
    return scene, axes, np.column_stack([axis.draw(random, count) for axis in axes])


def alone(scene):
    """Position, p and x of a design by itself, and the error of a run of it."""
    found = [None, None, None, None]
    try:
        q, v = consistent_start(scene)
        found[0] = q
        bc.simulate(scene, duration=1e-7, step=1e-7)
        found[1] = system_parameters(scene)
        found[2] = np.concatenate([q, v, np.zeros(system_of(scene).size - len(q) - len(v))])
    except BellcrankError as error:
        found[3] = infeasible_reason(error, scene)
    return found


@pytest.mark.tier2
@pytest.mark.parametrize("case", SCENES)
def test_every_design_has_the_parameters_the_start_or_the_reason_that_it_has_alone(case):
    scene, axes, values = designs_of(case)
    designs = SceneDesigns(scene, axes)
    block = designs.block(values)
    where = {int(row): (group, k) for group in block.groups for k, row in enumerate(group.rows)}
    assert len(where) + len(block.infeasible) == len(values) and where.keys().isdisjoint(block.infeasible)
    assert len(where) > 3
    for row, numbers in enumerate(values.tolist()):
        try:
            design = scene.with_overrides(designs.overrides(numbers))
        except BellcrankError as error:
            assert block.infeasible[row] == infeasible_reason(error, scene)
            assert np.isnan(block.start_position[row]).all()
            continue
        position, p, x, reason = alone(design)
        expected = np.full(scene.robot.nq, np.nan) if position is None else position
        np.testing.assert_array_equal(block.start_position[row], expected)
        if reason is not None:
            assert block.infeasible[row] == reason
            continue
        group, k = where[row]
        assert system_of(group.scene) is system_of(design)
        np.testing.assert_array_equal(group.parameters[k], p)
        np.testing.assert_array_equal(group.start[k], x)
        settings, plain = design.settings, group.scene.settings
        assert (settings.solver, settings.stabilisation) == (plain.solver, plain.stabilisation)
        assert group.duration[k] == settings.duration
        for name in ("rtol", "atol", "step", "first_step", "max_step"):
            given = group.settings[name][k] if name in group.settings else getattr(plain, name)
            assert given == getattr(settings, name)


@pytest.mark.tier2
@pytest.mark.parametrize(
    "case",
    [
        "four-bar, lengths",
        "hinges in space",
        "a disk in six coordinates",
        "two wheels, whose side forces are redundant",
    ],
)
def test_plain_numbers_are_treated_at_once(monkeypatch, case):
    scene, axes, values = designs_of(case)
    designs = SceneDesigns(scene, axes)
    read = []
    monkeypatch.setattr(SceneDesigns, "_add_alone", lambda self, row, *rest: read.append(row))
    designs.block(values)
    assert not read


def test_sizes_of_rows_in_cpp_are_those_of_each_design_to_the_bit(monkeypatch):
    scene, _, values = designs_of("four-bar, lengths", 200)
    called, one, whole = [], by_parameters._other_rows, by_parameters.row_sizes
    monkeypatch.setattr(by_parameters, "_other_rows", lambda *design: called.append(design) or one(*design))
    found = by_parameters.design_parameters(scene, values)
    assert not called and found.alike.all()

    def never(*arguments):
        sizes, clear = whole(*arguments)
        return np.zeros_like(sizes), np.zeros_like(clear)

    monkeypatch.setattr(by_parameters, "row_sizes", never)
    expected = by_parameters.design_parameters(scene, values)
    assert len(called) == 200 and expected.alike.all()
    for have, want in zip(found.constrained, expected.constrained, strict=True):
        np.testing.assert_array_equal(have, want)


def test_a_design_does_not_depend_on_its_neighbours_or_on_threads():
    scene, axes, values = designs_of("four-bar, lengths", 300)
    designs = SceneDesigns(scene, axes)
    whole = designs.block(values, threads=4)
    (group,) = whole.groups
    for rows in (np.arange(5, 6), np.arange(100, 203), np.arange(300)[::-1]):
        part = designs.block(values[rows])
        (some,) = part.groups or (None,)
        kept = np.array([row for k, row in enumerate(rows) if k not in part.infeasible])
        at = np.searchsorted(group.rows, kept)
        assert [whole.infeasible[int(rows[k])] for k in part.infeasible] == list(part.infeasible.values())
        if some is not None:
            np.testing.assert_array_equal(some.parameters, group.parameters[at])
            np.testing.assert_array_equal(some.start, group.start[at])


def test_designs_with_other_equations_are_made_alone(monkeypatch):
    scene, axes, values = designs_of("four-bar, lengths", 40)
    expected = SceneDesigns(scene, axes).block(values)
    whole = by_parameters.design_parameters

    def doubtful(scene, own, threads):
        found = whole(scene, own, threads)
        return found._replace(alike=np.arange(len(own)) % 3 == 0)

    monkeypatch.setattr("bellcrank.studies.designs.scene_designs.design_parameters", doubtful)
    found = SceneDesigns(scene, axes).block(values)
    (group,), (other,) = expected.groups, found.groups
    np.testing.assert_array_equal(other.rows, group.rows)
    np.testing.assert_array_equal(other.parameters, group.parameters)
    np.testing.assert_array_equal(other.start, group.start)
    assert found.infeasible == expected.infeasible


def test_automatic_gains_are_those_of_each_design():
    overrides = {"simulate.stabilisation": {"kind": "baumgarte", "gains": "auto"}, "simulate.duration": 2}
    scene = bc.load_scene("four_bar", overrides)
    axes = [Sampled("crank_length", 1.2, 1.24)]
    values = np.array([[1.22], [1.235]])
    (group,) = SceneDesigns(scene, axes).block(values).groups
    for row, (length,) in enumerate(values):
        run = bc.simulate(scene.with_overrides({"crank_length": float(length)}))
        np.testing.assert_array_equal(group.parameters[row], run.parameters)


def test_paths_of_one_number_that_are_given_twice_are_left_to_the_scene():
    scene = bc.load_scene("four_bar")
    axes = [
        Sampled("crank_length", 1.2, 1.24),
        Sampled("parameters.crank_length.value", 1.2, 1.24),
        Sampled("initial.crank"),
    ]
    assert [(axis.column, axis.kind) for axis in plain_axes(scene, axes)] == [(2, ValueKind.POSITION)]


def test_the_designs_of_a_scene_can_be_pickled():
    scene, axes, values = designs_of("four-bar, lengths", 20)
    designs = SceneDesigns(scene, axes)
    expected = designs.block(values)
    found = pickle.loads(pickle.dumps(designs)).block(values)
    np.testing.assert_array_equal(found.groups[0].start, expected.groups[0].start)
    assert found.infeasible == expected.infeasible
