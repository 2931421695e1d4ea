"""What is not a finite number is told: outputs, events, constraints and loads that are NaN, infinite or overflow."""

import csv
import json
import math

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.actuators.actuator import Actuator
from bellcrank.cli import main
from bellcrank.commands.result_argument import verdict_of
from bellcrank.dynamics.constraints.mobility import rank_of
from bellcrank.elements.expression import parse_expression
from bellcrank.elements.rolling_constraint import RollingDisk
from bellcrank.simulation.integration.statistics import Status
from bellcrank.simulation.trajectory.non_finite import EACH
from bellcrank.simulation.trajectory.scene_notes import scene_notes
from bellcrank.sizing.loads.load_checks import refuse_non_finite_joint
from bellcrank.sizing.loads.motion_grid import root_mean_square
from bellcrank.studies.sweep import sweep

ARM = "name: Arm\nurdf: planar_2r\ngravity: [0, -9.81, 0]\ninitial: {shoulder: 0.3, elbow: 0.4}\n"
SHOULDER = "shoulder.position"


def scene(tmp_path, more, name="scene.yaml"):
    path = tmp_path / name
    path.write_text(ARM + more)
    return path


def closed(tmp_path, expression, initial="{shoulder: 0.3, elbow: {guess: 0.4}}"):
    path = tmp_path / "closed.yaml"
    path.write_text(
        f"name: Closed\nurdf: planar_2r\ngravity: [0, -9.81, 0]\ninitial: {initial}\n"
        f'constraints: [{{name: own, kind: expression, expression: "{expression}", unit: rad}}]\n'
        "simulate: {duration: 0.2, samples: 11}\n"
    )
    return path


# ---- outputs and events of a run

UNDEFINED = """
outputs:
  log: {expression: log(-1)}
  pole: {expression: 1/t}
  root: {expression: sqrt(t-0.5)}
  good: {expression: shoulder.position}
simulate: {duration: 1, samples: 11}
"""


@pytest.fixture(scope="module")
def undefined(tmp_path_factory):
    folder = tmp_path_factory.mktemp("undefined")
    return folder, bc.simulate(scene(folder, UNDEFINED))


def test_each_output_that_is_no_number_is_a_warning_with_its_rows_and_its_first_time(undefined):
    _, run = undefined
    assert run.status is Status.FINISHED
    rows = {
        "log": (11, 0.0),
        "pole": (1, 0.0),
        "root": (np.count_nonzero(run.time < 0.5), 0.0),
    }
    for name, (count, first) in rows.items():
        assert np.count_nonzero(~np.isfinite(run.output(name))) == count
        told = [text for text in run.warnings if text.startswith(f"output '{name}' ")]
        assert len(told) == 1
        assert f"in {count} of 11 rows, first at {first:g} s" in told[0]
    assert not any("'good'" in text for text in run.warnings)


def test_a_run_with_an_output_that_is_no_number_never_just_finishes(undefined):
    _, run = undefined
    assert "output 'log' is not a number" in run.message
    assert "output 'log' is not a number" in run.table()
    assert "output &#x27;log&#x27; is not a number" in run._repr_html_()
    assert "not all results are finite" in repr(run)
    figure = run.plot()
    assert "not all results are finite" in figure.get_suptitle()


def test_files_of_a_run_have_nan_in_csv_cells_and_none_in_the_json_of_pages(undefined):
    folder, run = undefined
    with run.to_csv(folder / "run.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["root [1]"]) for row in rows] == pytest.approx(run.output("root"), nan_ok=True)
    assert rows[0]["log [1]"] == "nan"
    assert rows[0]["pole [1]"] == "inf"
    page = bc.replay(run, folder / "run.html").read_text()
    text = page.split('type="application/json"', 1)[1].split(">", 1)[1].split("</script>", 1)[0]
    film = json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} in the page's JSON"))
    assert film["success"] is False
    assert any("output 'log'" in fact for _, fact in film["facts"])


def test_commands_end_with_1_where_an_output_is_no_number(undefined, capsys, tmp_path):
    folder, run = undefined
    assert main(["simulate", str(folder / "scene.yaml"), "--out", str(tmp_path / "out"), "--no-plots"]) == 1
    assert "output 'log' is not a number" in capsys.readouterr().out
    assert verdict_of(run) == (False, run.message)  # what `report` and `replay` end with


def test_more_outputs_than_are_told_one_by_one_are_all_named(tmp_path):
    names = [f"o{k}" for k in range(EACH + 3)]
    lines = "".join(f"  {name}: {{expression: log(-1)}}\n" for name in names)
    run = bc.simulate(scene(tmp_path, f"outputs:\n{lines}simulate: {{duration: 0.1, samples: 3}}\n"))
    said = " ".join(run.warnings)
    assert all(f"output '{name}'" in said for name in names)


EVENTS = """
events:
  - {name: never, when: {expression: sqrt(-1)}}
  - {name: half, when: {expression: sqrt(0.5-t)*(t-0.2)}}
  - {name: seen, when: {expression: t-0.7}}
"""


@pytest.mark.parametrize("times", ["steps", [0.0, 1.0]])
@pytest.mark.parametrize("solver", ["DOP853", "RK45", "Radau"])
def test_an_event_whose_function_is_no_number_is_told_by_the_solver_whatever_the_rows(tmp_path, times, solver):
    run = bc.simulate(scene(tmp_path, EVENTS), 1.0, solver=solver, times=times)
    told = {name: [t for t in run.warnings if f"event '{name}'" in t] for name in ("never", "half", "seen")}
    assert [len(texts) for texts in told.values()] == [1, 1, 0]
    assert "first seen at 0 s" in told["never"][0]
    assert "crossings there are not found" in told["half"][0]
    assert {event.name for event in run.events} == {"half", "seen"}
    first = next(it.first for it in run.statistics.unresolved if it.event == "half")
    assert 0.5 < first < 1.0


def test_blind_events_are_kept_in_the_file_of_a_run(tmp_path):
    run = bc.simulate(scene(tmp_path, EVENTS), 1.0, times=[0.0, 0.4])
    again = bc.load_run(run.save(tmp_path / "run.npz"))
    assert again.statistics.unresolved == run.statistics.unresolved
    assert again.warnings == run.warnings


def test_energies_that_overflow_are_told_and_certificates_are_infinite_not_nan(tmp_path):
    more = "forces: [{name: s, kind: joint_spring, joint: shoulder, stiffness: 1.0e-300, rest: 1.0e+308}]\n"
    run = bc.simulate(scene(tmp_path, more + "simulate: {duration: 0.1, samples: 3}\n"))
    assert np.isfinite(run.state).all()
    assert not np.isfinite(run.potential_energy).any()
    assert any(text.startswith("the potential energy is infinite in 3 of 3 rows") for text in run.warnings)
    assert run.energy_drift() == math.inf
    assert "unknown of the largest energy" in run.table()


# ---- constraints


@pytest.mark.parametrize("expression", ["t", "1e308*1e308", "sqrt(-1)", "log(0)", "1", "log(-1-t)"])
def test_a_formula_without_joints_is_refused_by_name(tmp_path, expression):
    with pytest.raises(bc.InputError, match="'own' cannot hold: its expression contains no joint") as error:
        bc.simulate(closed(tmp_path, expression))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "expression", [f"sqrt(-1)*{SHOULDER}", f"log({SHOULDER}-1.6)", f"1e160*({SHOULDER}-0.3)", f"1e308*1e308*{SHOULDER}"]
)
def test_a_formula_without_values_or_beyond_squares_is_refused_by_name(tmp_path, expression):
    with pytest.raises(bc.InputError, match="'own' cannot be evaluated"):
        bc.simulate(closed(tmp_path, expression))


@pytest.mark.parametrize("expression", [f"sqrt({SHOULDER}-0.2)-sqrt(0.1)", f"log({SHOULDER}-0.29)-log(0.01)"])
def test_a_formula_that_has_values_in_part_of_the_postures_binds(tmp_path, expression):
    """It was left out before, where one of the random postures had no value, and the arm fell."""
    run = bc.simulate(closed(tmp_path, expression))
    assert run.success
    assert np.abs(run.position[:, 0] - 0.3).max() < 1e-9
    assert abs(run.position[-1, 1] - 0.4) > 0.05  # the elbow falls
    assert run.multipliers.shape[1] == 1
    assert np.abs(run.multipliers).min() > 0.0


@pytest.mark.parametrize("expression", [f"sqrt({SHOULDER}-0.3)", f"1/({SHOULDER}-0.3)"])
def test_a_formula_without_a_derivative_at_the_start_is_refused_by_name(tmp_path, expression):
    with pytest.raises(
        bc.InputError, match=r"constraint 'own' or its derivative is undefined or larger than .* at the start"
    ):
        bc.simulate(closed(tmp_path, expression))


def test_a_formula_that_loses_its_value_ends_the_run_with_its_name_and_time(tmp_path):
    run = bc.simulate(closed(tmp_path, f"sqrt(0.05-t)*({SHOULDER}-0.3)"))
    assert run.status is Status.NON_FINITE
    assert run.time[-1] == pytest.approx(0.05, abs=1e-6)
    assert "constraint 'own' is not finite" in run.message


def test_a_disk_that_lies_flat_in_all_postures_is_refused_by_name(tmp_path):
    path = tmp_path / "disk.yaml"
    path.write_text(
        "urdf: planar_2r\nconstraints: [{name: floor, kind: rolling_disk, frame: tip, axis: [0, 0, 1], radius: 0.1, "
        "height: -0.1}]\n"
    )
    with pytest.raises(bc.InputError, match="'floor' has no lowest point to roll on: its disk lies flat"):
        bc.simulate(path)


def test_a_disk_on_a_base_that_is_fixed_is_refused_in_one_sentence(tmp_path):
    path = tmp_path / "disk.yaml"
    path.write_text(
        "urdf: thin_disk\nfloating_base: false\n"
        "constraints: [{name: floor, kind: rolling_disk, frame: disk, axis: [0, 1, 0], radius: 0.1}]\n"
    )
    loaded = bc.load_scene(path)
    assert isinstance(loaded.constraints[0], RollingDisk)
    with pytest.raises(bc.InputError, match="no movable joint"):
        bc.simulate(loaded)
    with pytest.raises(bc.InputError, match="'floor' cannot hold"):
        scene_notes(loaded)


def test_the_rank_of_constraints_does_not_need_a_mass_matrix_that_is_regular():
    """Rank and uniqueness are those of J in any metric: with a massless coordinate as without it."""
    jacobian = np.array([[1.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0, 0.0, 1.0]])

    class System:
        def __init__(self, mass):
            self.mass = mass

        def constraint_metric(self, *_):
            return jacobian, self.mass

    nothing = np.zeros(1)
    regular, singular = (
        rank_of(System(np.diag(d)), nothing, nothing, nothing, nothing) for d in ([1.0, 2.0, 3.0], [1.0, 2.0, 0.0])
    )
    assert regular.rank == singular.rank == 2
    assert regular.unique.tolist() == singular.unique.tolist() == [False, False, True]


def test_formulas_say_whether_a_joint_stands_in_them():
    robot = bc.load_robot("planar_2r")
    leaves = {text: parse_expression(text, robot, {}).term.leaves() for text in ("t + 1", "sin(elbow.position)")}
    assert [any(leaf.operation == "joint" for leaf in each) for each in leaves.values()] == [False, True]


# ---- sizing


@pytest.fixture(scope="module")
def arm():
    return bc.load_robot("planar_2r", gravity=(0.0, -9.81, 0.0))


@pytest.fixture(scope="module")
def swing(arm):
    return bc.waypoints(arm, [0.0, 1.0, 2.0], [{}, {"shoulder": 1.0}, {}], samples=21, name="swing")


DRIVE = {"ratio": 100.0, "rated_torque": 1.0, "peak_torque": 2.0, "rated_speed": 300.0, "max_speed": 400.0}


@pytest.mark.parametrize(
    ("force", "value"),
    [
        ("{name: s, kind: joint_spring, joint: shoulder, stiffness: 1.0e+200}", "e+"),
        ("{name: s, kind: torque, joint: shoulder, value: 1.0e+308}", "e+308"),
        ("{name: s, kind: friction, joint: shoulder, coulomb: 1, width: 1.0e-320}", "nan"),
    ],
)
def test_a_joint_whose_load_is_no_number_or_overflows_is_refused_with_motion_time_and_quantity(
    tmp_path, swing, force, value
):
    with pytest.raises(
        bc.InputError,
        match=r"motion 'swing': planar_2r: the motion and the scene's forces require .* of joint 'shoulder'",
    ) as error:
        bc.size(bc.load_scene(scene(tmp_path, f"forces: [{force}]\n")), swing)
    assert value in str(error.value)
    assert " at 0" in str(error.value)


@pytest.mark.parametrize("what", [*DRIVE, "rotor_inertia", "gear_inertia"])
def test_a_drive_beyond_what_has_squares_is_refused_by_name(what):
    with pytest.raises(bc.InputError, match=f"an actuator: argument '{what}': .* at most 1e\\+100, found 1e\\+200"):
        Actuator(**DRIVE | {"peak_torque": 1e99, "max_speed": 1e99, what: 1e200})


def test_a_sizing_of_loads_near_the_largest_has_finite_numbers_and_valid_json(tmp_path, arm, swing):
    heavy = arm.with_payloads([bc.Payload(1e90, "tip")])
    sizing = bc.size(heavy, swing, {"shoulder": Actuator(**DRIVE, rotor_inertia=1e-4)})
    line = sizing.joint("shoulder")
    assert not sizing.inside
    assert all(
        math.isfinite(margin) and margin < 0.0 for name, margin in line.shaft.margins.items() if "torque" in name
    )
    torque = np.abs(sizing.histories["swing"].joint("shoulder").torque)
    assert line.rms_torque == pytest.approx(
        1e89 * np.sqrt(np.trapezoid((torque / 1e89) ** 2, swing.time) / 2.0), rel=0.02
    )
    text = sizing.to_json(tmp_path / "sizing.json").read_text()
    json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} in sizing.json"))


def test_an_rms_has_no_overflow_of_squares():
    weight = np.full(8, 0.25)
    rows = np.column_stack([np.full(8, 3e200), np.full(8, 3.0)])
    assert root_mean_square(weight, rows.T, 2.0) == pytest.approx([3e200, 3.0], rel=1e-14)


def test_a_line_with_a_number_that_is_none_is_refused(arm, swing):
    line = bc.size(arm, swing).joint("elbow")
    refuse_non_finite_joint("arm", line)
    object.__setattr__(line, "holding_torque", math.nan)
    with pytest.raises(bc.InputError, match="the holding torque of joint 'elbow' is not a number"):
        refuse_non_finite_joint("arm", line)


# ---- sweeps


def test_a_design_whose_measure_is_no_number_is_unknown_and_not_among_those_that_finished(tmp_path, capsys):
    more = "outputs: {root: {expression: sqrt(shoulder.position)}}\nparameters: {start: {value: 1}}\n"
    path = scene(tmp_path, more.split("parameters", maxsplit=1)[0] + "simulate: {duration: 0.01, samples: 3}\n")
    result = sweep(path, {"initial.shoulder": [-0.5, 0.5]}, threads=1)
    assert [design.status for design in result.designs] == ["unknown", "finished"]
    assert "'end.root' and 2 more not a finite number" in result.designs[0].reason
    assert repr(result) == "Sweep('Arm' over initial.shoulder: 2 designs, 1 finished)"
    assert result.table(["end.root"]).split("\n")[2].split()[:3] == ["-0.5", "unknown", "unknown"]
    with result.to_csv(tmp_path / "sweep.csv").open() as file:
        assert [row["end.root [1]"] == "" for row in csv.DictReader(file)] == [True, False]
    design = json.loads(result.to_json(tmp_path / "sweep.json").read_text())["designs"][0]
    assert (design["status"], design["measures"]["end.root"]) == ("unknown", None)
    legend = result.plot(None, ["end.root"]).axes[0].get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["none, or unknown (1 of 2)"]
    code = main(
        ["sweep", str(path), "--vary", "initial.shoulder=-0.5,-0.4", "--out", str(tmp_path / "s"), "--no-plots"]
    )
    assert code == 1
    assert "0 finished, 0 did not, 2 unknown (see their reasons)" in capsys.readouterr().out


def test_a_design_whose_aim_could_not_be_looked_for_is_unknown(tmp_path):
    more = "events: [{name: aim, when: {expression: sqrt(shoulder.position-2)}, stop: true}]\n"
    path = scene(tmp_path, more + "simulate: {duration: 0.01, samples: 3}\n")
    design = sweep(path, {"initial.shoulder": [0.5]}, threads=1).designs[0]
    assert design.status == "unknown"
    assert "the function of event 'aim' not a finite number" in design.reason


def test_an_event_function_near_the_largest_number_is_no_oscillation(tmp_path):
    """Differences of its samples overflow; it was sampled 200,000 times a step for it."""
    path = tmp_path / "far.yaml"
    path.write_text(
        "urdf: planar_2r\ninitial: {shoulder: 0.3, elbow: 1.7e+308}\n"
        "events: [{name: far, when: {joint: elbow, position: 6.0}}, {name: near, when: {expression: t-0.05}}]\n"
        "simulate: {duration: 0.1, samples: 3}\n"
    )
    run = bc.simulate(path)
    assert [event.name for event in run.events] == ["near"]
    assert run.statistics.unresolved == ()


def test_a_run_that_flies_apart_under_a_useless_tolerance_ends_before_the_first_row_that_is_not_finite():
    run = bc.simulate("planar_2r_swing", overrides={"initial.shoulder": 100.0}, duration=7.0, rtol=1.0, atol=1e300)
    assert run.status is Status.NON_FINITE and 0.0 < run.time[-1] < 7.0
    assert np.isfinite(run.position).all() and np.isfinite(run.velocity).all()
    assert any("the run ended before its duration" in text for text in run.warnings)
