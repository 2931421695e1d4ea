"""Sizing where things meet: forces with jumps of motions, friction in linkages, parameters, clocks, bases, mimics."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from page_series import decoded, value_at

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.dynamics.inverse.scene_inverse_dynamics import scene_inverse_dynamics
from bellcrank.sizing.loads.motion_grid import STILL, Sides

LINK = (
    '<link name="{name}"><inertial><origin xyz="{at}"/><mass value="{mass}"/><inertia ixx="0.01" iyy="0.02" izz="0.03" '
    'ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = (
    '<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{at}"/>'
    '<axis xyz="{axis}"/><limit lower="{low}" upper="{high}" effort="900" velocity="20"/>{more}</joint>'
)


def joint(name: str, kind: str, parent: str, at: str, axis: str, low: float, high: float, more: str = "") -> str:
    return JOINT.format(
        name=name, kind=kind, parent=parent, child=f"{name}_link", at=at, axis=axis, low=low, high=high, more=more
    )


def link(name: str, at: str, mass: float) -> str:
    return LINK.format(name=f"{name}_link", at=at, mass=mass)


SCARA = (
    '<robot name="scara"><link name="base"/>'
    + link("shoulder", "0.15 0 0", 4.0)
    + link("elbow", "0.12 0.01 0", 3.0)
    + link("quill", "0 0 -0.1", 1.5)
    + joint("shoulder", "revolute", "base", "0 0 0.5", "0 0 1", -2.5, 2.5)
    + joint("elbow", "revolute", "shoulder_link", "0.3 0 0", "0 0 1", -2.5, 2.5)
    + joint("quill", "prismatic", "elbow_link", "0.25 0 0", "0 0 -1", 0.0, 0.2)
    + "</robot>"
)
PRESS = {
    "kind": "waypoints",
    "times": [0, 1, 2],
    "positions": [
        {"shoulder": 0, "elbow": 0.5, "quill": 0},
        {"shoulder": 0.8, "elbow": -0.5, "quill": 0.15},
        {"shoulder": 0.2, "elbow": 0.3, "quill": 0.05},
    ],
}
BLOCK = (
    '<robot name="block"><link name="base"/>'
    + link("slide", "0 0 0", 2.0)
    + joint("slide", "prismatic", "base", "0 0 0", "1 0 0", -50.0, 50.0)
    + "</robot>"
)


def written(folder: Path, urdf: str, **more: Any) -> Path:
    """A scene's file with that URDF."""
    (folder / "robot.urdf").write_text(urdf)
    (folder / "scene.yaml").write_text(json.dumps({"urdf": "robot.urdf", **more}))
    return folder / "scene.yaml"


@pytest.mark.tier2
def test_a_process_force_on_a_scara_s_quill_changes_the_quill_s_motor_alone_and_everywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    free = bc.size(written(tmp_path, SCARA, motions={"press": PRESS}))
    up = {"kind": "wrench", "frame": "quill_link", "force": [0, 0, 500]}
    path = written(tmp_path, SCARA, motions={"press": PRESS}, forces=[up])
    pressed = bc.size(path)
    for name, more in (("shoulder", 0.0), ("elbow", 0.0), ("quill", 500.0)):
        before, after = (sizing.histories["press"].joint(name).torque for sizing in (free, pressed))
        np.testing.assert_allclose(after - before, more, rtol=0, atol=1e-12 * 500.0)
    # The quill's coordinate points down: m q'' = τ + m g − 500 N.
    history = pressed.histories["press"].joint("quill")
    np.testing.assert_allclose(history.torque, 1.5 * (history.acceleration - 9.81) + 500.0, rtol=1e-12)
    line = pressed.joint("quill")
    assert line.holding_torque == pytest.approx(500.0 - 1.5 * 9.81, rel=1e-12)
    assert main(["size", str(path), "--no-plots", "--out", "o"]) == 0
    table = np.genfromtxt(tmp_path / "o" / "history_press.csv", delimiter=",", names=True, deletechars="")
    assert np.abs(table["quill_torque_[N]"]).max() == pytest.approx(np.abs(history.torque).max(), rel=1e-15)
    assert line.peak_torque == pytest.approx(np.abs(history.torque).max(), rel=1e-3)
    bc.replay(pressed, tmp_path / "page.html")
    charts = {c["title"]: c["lines"] for c in decoded((tmp_path / "page.html").read_text())["charts"]}
    assert charts["joint force"][0]["values"].max() == pytest.approx(line.max_torque, rel=2e-3)


# ---- jumps of motions, of tables, and ends of both


def pushed(folder: Path, rows: list[tuple[float, ...]], table: list[tuple[float, float]], interpolation: str) -> Path:
    """The file of a block that moves by rows (t, x, v, a) while a table of forces pushes it."""
    header = "time [s],slide position [m],slide velocity [m/s],slide acceleration [m/s^2]\n"
    (folder / "motion.csv").write_text(header + "".join(",".join(map(repr, row)) + "\n" for row in rows))
    (folder / "push.csv").write_text("time [s],force x [N]\n" + "".join(f"{t!r},{f!r}\n" for t, f in table))
    push = {"kind": "wrench", "frame": "slide_link", "file": "push.csv", "interpolation": interpolation}
    return written(folder, BLOCK, motions={"go": {"kind": "csv", "file": "motion.csv"}}, forces=[push])


def pieces_of(durations: list[float], accelerations: list[float]) -> tuple[list[float], list[tuple[float, ...]]]:
    """Ends of pieces of constant acceleration from rest, and the rows of both sides of each."""
    time, x, v = 0.0, 0.0, 0.0
    ends, rows = [0.0], []
    for duration, a in zip(durations, accelerations, strict=True):
        rows.append((time, x, v, a))
        time, x, v = time + duration, x + v * duration + 0.5 * a * duration**2, v + a * duration
        rows.append((time, x, v, a))
        ends.append(time)
    return ends, rows


def test_a_table_and_a_motion_that_jump_together_but_for_rounding_make_no_peak_between(tmp_path: Path) -> None:
    ends, rows = pieces_of([0.87, 0.51, 0.46, 1.0], [1.0, -2.0, 3.0, -4.0])
    assert ends[3] != 1.84 and abs(ends[3] - 1.84) < 1e-15
    path = pushed(tmp_path, rows, [(0.0, -3.0), (1.84, 5.0)], "hold")
    sizing = bc.size(path)
    line = sizing.joint("slide")
    # 2 kg: 2 + 3, −4 + 3, 6 + 3, −8 − 5 N; a piece with the acceleration after and the force before would need −5.
    assert (line.max_torque, line.min_torque) == pytest.approx((9.0, -13.0), abs=1e-9)
    torque = sizing.histories["go"].joint("slide").torque
    np.testing.assert_allclose(torque, [5, 5, -1, -1, 9, 9, -13, -13], atol=1e-9)
    path = pushed(tmp_path, rows, [(0.0, 5.0), (1.84, -5.0)], "hold")  # before: 1 N; a false peak would have −13 N
    line = bc.size(path).joint("slide")
    assert (line.max_torque, line.min_torque) == pytest.approx((1.0, -9.0), abs=1e-9)


def test_a_table_that_jumps_where_the_motion_ends_does_not_act_in_it(tmp_path: Path) -> None:
    ends, rows = pieces_of([0.5, 0.5], [2.0, -2.0])
    path = pushed(tmp_path, rows, [(0.0, 1.0), (ends[-1], 100.0)], "hold")
    sizing = bc.size(path)
    line, history = sizing.joint("slide"), sizing.histories["go"].joint("slide")
    assert line.peak_torque == pytest.approx(5.0, rel=1e-12) and line.sampled_torque == pytest.approx(5.0, rel=1e-12)
    np.testing.assert_allclose(history.torque, [3, 3, -5, -5], rtol=1e-12)
    found = scene_inverse_dynamics(bc.load_scene(path), "go")
    np.testing.assert_allclose(found.torque[:, 0], [3, 3, -5, -5], rtol=1e-12)
    bc.replay(sizing, tmp_path / "page.html")
    charts = {c["title"]: c["lines"] for c in decoded((tmp_path / "page.html").read_text())["charts"]}
    shown = value_at(charts["joint force"][0], np.array([0.1, 0.6, 1.0]))
    np.testing.assert_allclose(shown, [3, -5, -5], atol=1e-3)


@pytest.mark.parametrize("seed", range(12))
def test_pieces_of_acceleration_under_tables_of_forces_are_sized_as_their_integrals_say(
    tmp_path: Path, seed: int
) -> None:
    generator = np.random.default_rng(seed)
    count = int(generator.integers(2, 5))
    durations, a = np.round(generator.uniform(0.2, 1.0, count), 2), np.round(generator.uniform(-4.0, 4.0, count), 3)
    ends, rows = pieces_of(durations.tolist(), a.tolist())
    some = np.round(np.concatenate([ends, np.add(ends, 0.005), generator.uniform(-0.2, ends[-1] + 0.3, 6)]), 6)
    at = np.unique(generator.choice(some, 4, replace=False))
    force = np.round(generator.uniform(-30.0, 30.0, len(at)), 2)
    interpolation = ("hold", "linear")[seed % 2]
    sizing = bc.size(pushed(tmp_path, rows, list(zip(at.tolist(), force.tolist(), strict=True)), interpolation))
    line, history = sizing.joint("slide"), sizing.histories["go"].joint("slide").torque
    edges = np.unique(np.round(np.concatenate([ends, at[(at > 0.0) & (at < ends[-1])]]), 9))

    def held_at(t: float) -> float:
        if interpolation == "linear":
            return float(np.interp(t, at, force))
        return float(force[max(int(np.searchsorted(at, t, side="right")) - 1, 0)])

    torques, square, energy = [], 0.0, np.zeros(2)
    for low, high in pairwise(edges):
        middle = 0.5 * (low + high)
        k = int(np.searchsorted(ends, middle)) - 1
        t = np.linspace(low, high, 4001)
        torque = 2.0 * a[k] - np.array(
            [held_at(middle)] * len(t) if interpolation == "hold" else np.interp(t, at, force)
        )
        power = torque * (rows[2 * k][2] + a[k] * (t - ends[k]))
        torques += [torque.min(), torque.max()]
        square += np.trapezoid(torque**2, t)
        energy += [np.trapezoid(np.maximum(power, 0.0), t), np.trapezoid(np.maximum(-power, 0.0), t)]
    largest = np.abs(torques).max()
    np.testing.assert_allclose((history.max(), history.min()), (max(torques), min(torques)), atol=1e-8 * largest)
    torques.append(-held_at(0.0))  # at rest before the motion starts
    found = line.max_torque, line.min_torque
    np.testing.assert_allclose(found, (max(torques), min(torques)), rtol=0, atol=1e-8 * largest)
    assert line.rms_torque == pytest.approx(np.sqrt(square / ends[-1]), rel=1e-6)  # the trapezoids' own error: 1e-7
    np.testing.assert_allclose((line.motoring_energy, line.regenerated_energy), energy, atol=1e-5 * energy.sum())


# ---- friction, clocks, starts


def slider_crank(folder: Path, **more: Any) -> bc.Scene:
    urdf = (
        '<robot name="crank"><link name="base"/>'
        + link("crank", "0.1 0 0", 1.5)
        + link("rod", "0.35 0.02 0", 2.0)
        + link("slider", "0 0 0", 3.0)
        + joint("crank", "revolute", "base", "0 0 0", "0 0 1", -9, 9, '<dynamics friction="0.4"/>')
        + joint("rod", "revolute", "crank_link", "0.2 0 0", "0 0 1", -9, 9, '<dynamics friction="0.3"/>')
        + joint("slider", "prismatic", "base", "0 0 0", "1 0 0", -9, 9)
        + "</robot>"
    )
    turn = {"kind": "waypoints", "times": [0, 1], "positions": [{"crank": 0.4}, {"crank": 2.2}], "samples": 201}
    path = written(
        folder,
        urdf,
        gravity=[0, -9.81, 0],
        frames={"tip": {"link": "rod_link", "xyz": [0.7, 0, 0]}},
        constraints=[{"name": "pin", "kind": "point", "frame_a": "tip", "frame_b": "slider_link"}],
        initial={"crank": 0.4, "rod": {"guess": -0.5}, "slider": {"guess": 0.88}},
        actuated=["crank"],
        motions={"turn": turn},
    )
    return bc.load_scene(path, more)


@pytest.mark.tier2
def test_the_friction_share_of_a_linkage_s_motor_counts_friction_at_all_joints(tmp_path: Path) -> None:
    rub = {"kind": "friction", "joint": "slider", "coulomb": 200.0, "viscous": 30.0}
    with_it, without = slider_crank(tmp_path, forces=[rub]), slider_crank(tmp_path, friction="none")
    line = bc.size(with_it, "turn").joint("crank")
    peak = line.peaks["peak_torque"]
    torques = []
    for scene in (with_it, without):
        found = scene_inverse_dynamics(scene, "turn")
        at = np.array([peak.time])
        torques.append(float(found.mechanism.torques(at, *found.motion.at(at))[0][0, 0]))
    assert line.friction_share == pytest.approx(abs(torques[0] - torques[1]) / line.peak_torque, rel=1e-9)
    assert line.friction_share > 0.5


def test_a_clock_that_starts_later_is_said_and_the_run_is_sized_with_its_clock_in_the_times(tmp_path: Path) -> None:
    (tmp_path / "push.csv").write_text("time [s],force x [N]\n0,0\n1,0\n1.5,30\n3,-30\n")
    sway = {"kind": "waypoints", "times": [0, 1, 2], "positions": [{"slide": 0}, {"slide": 1}, {"slide": 0}]}
    path = written(
        tmp_path,
        BLOCK,
        motions={"sway": sway},
        forces=[{"name": "push", "kind": "wrench", "frame": "slide_link", "file": "push.csv"}],
        control=[{"name": "hold", "kind": "pd", "joint": "slide", "kp": 800, "kd": 60, "motion": "sway"}],
        initial={"motion": "sway", "clock": 0.8},
        simulate={"duration": 1.2, "rtol": 1e-10, "atol": 1e-10, "samples": 241},
    )
    run = bc.simulate(bc.load_scene(path))
    run.to_csv(tmp_path / "run.csv")
    said = [text for text in bc.size(path, tmp_path / "run.csv").warnings if "initial.clock" in text]
    assert len(said) == 1 and "0.8 s" in said[0] and "wrench 'push'" in said[0]
    lines = (tmp_path / "run.csv").read_text().splitlines()
    cells = [line.split(",") for line in lines[1:]]
    later = [",".join([repr(float(row[0]) + 0.8), *row[1:]]) for row in cells]
    (tmp_path / "later.csv").write_text("\n".join([lines[0], *later]) + "\n")
    wanted = np.abs(run.joint("slide").actuator_torque).max()
    assert bc.size(path, tmp_path / "later.csv").joint("slide").sampled_torque == pytest.approx(wanted, rel=1e-9)
    still = bc.load_scene(path, {"initial": {"motion": "sway"}})
    assert not [text for text in bc.size(still, "sway").warnings if "clock" in text]


@pytest.mark.tier2
def test_a_base_that_sizing_cannot_turn_is_refused_and_one_that_the_motion_has_elsewhere_is_said(
    tmp_path: Path,
) -> None:
    tilted = {"rpy": [1.2, 0, 0]}
    path = written(tmp_path, SCARA, motions={"press": PRESS}, base=tilted)
    with pytest.raises(bc.InputError, match="base is fixed"):
        bc.size(path)
    path = written(tmp_path, SCARA, motions={"press": PRESS}, base=tilted, floating_base=True)
    assert [text for text in bc.size(path).warnings if "elsewhere" in text]
    path = written(tmp_path, SCARA, motions={"press": PRESS}, base={"rpy": [0, 0, 0]}, floating_base=True)
    assert not [text for text in bc.size(path).warnings if "elsewhere" in text]


@pytest.mark.parametrize("forces", [[], [{"kind": "damper", "joint": "elbow", "coefficient": 3}]])
def test_motors_that_an_open_chain_s_file_leaves_out_are_not_sized_as_if_they_were_there(
    tmp_path: Path, forces: list[dict[str, Any]]
) -> None:
    path = written(tmp_path, SCARA, motions={"press": PRESS}, forces=forces, actuated=["shoulder", "quill"])
    with pytest.raises(bc.InputError, match="leaves out elbow"):
        bc.size(path)
    path = written(tmp_path, SCARA, motions={"press": PRESS}, forces=forces, actuated=["shoulder", "elbow", "quil"])
    with pytest.raises(bc.InputError, match="'quil'"):
        bc.size(path)


# ---- masses, energies, sizes


@pytest.mark.tier2
def test_masses_that_parameters_take_away_or_give_decide_whether_a_motor_moves_mass(tmp_path: Path) -> None:
    for sets, value in (("link.quill_link.scale", 0.0), ("link.quill_link.mass", 0.0)):
        path = written(tmp_path, SCARA, motions={"press": PRESS}, parameters={"m": {"value": value, "sets": [sets]}})
        sizing = bc.size(path)
        assert not sizing.inside and "joint 'quill' moves no mass" in sizing.unsizable[0]
        assert "parameters" in sizing.unsizable[0]
        assert bc.size(path, allow_massless=["quill_link"]).inside
    empty = SCARA.replace(link("quill", "0 0 -0.1", 1.5), '<link name="quill_link"/>')
    path = written(tmp_path, empty, motions={"press": PRESS})
    assert bc.size(path).unsizable
    given = {"m": {"value": 1.5, "sets": ["link.quill_link.mass"]}}
    sizing = bc.size(written(tmp_path, empty, motions={"press": PRESS}, parameters=given))
    assert not sizing.unsizable and sizing.joint("quill").holding_torque == pytest.approx(1.5 * 9.81, rel=1e-12)


def test_motors_give_what_the_mechanical_energy_gains_and_all_forces_take(tmp_path: Path) -> None:
    forces: list[dict[str, Any]] = [
        {"kind": "spring", "frame_a": "elbow_link", "frame_b": "world", "point": [0.2, 0.9, 0], "stiffness": 90,
         "free_length": 0.2, "damping": 8},
        {"kind": "damper", "joint": "shoulder", "coefficient": 2.0},
        {"kind": "friction", "joint": "elbow", "coulomb": 3.0, "width": 0.05},
        {"kind": "wrench", "frame": "quill_link", "force": [5, -8, 60], "torque": [1, 2, 3], "expressed_in": "frame"},
    ]  # fmt: skip
    sizing = bc.size(written(tmp_path, SCARA, gravity=[1, 2, -9], motions={"press": PRESS}, forces=forces))
    assert sizing.inputs is not None
    mechanism, (motion,), _ = sizing.inputs
    time, weight = np.polynomial.legendre.leggauss(40)
    edges = np.linspace(0.0, 2.0, 201)
    time, weight = (edges[:-1, None] + 0.005 * (time + 1.0)).ravel(), np.tile(0.005 * weight, 200)
    q, v, _ = motion.at(time)
    taken = float(weight @ np.einsum("nv,nv->n", mechanism.equations.applied(time, q, v), v))
    kinetic, potential = mechanism.robot.energy(motion.position[[0, -1]], motion.velocity[[0, -1]])
    gained = float(np.diff(kinetic + potential)[0])
    given = sum(line.motoring_energy - line.regenerated_energy for line in sizing.joints)
    whole = sum(line.motoring_energy + line.regenerated_energy for line in sizing.joints)
    # Energies of the sizing are sums over parts that end where power changes sign with the speed, not with the torque.
    assert given == pytest.approx(gained - taken, abs=2e-5 * whole)
    assert abs(taken) > 0.1 * whole


def test_forces_whose_squares_overflow_are_refused(tmp_path: Path) -> None:
    spring = {"kind": "joint_spring", "joint": "elbow", "stiffness": 1e200}
    with pytest.raises(bc.InputError, match="check units"):
        bc.size(written(tmp_path, SCARA, motions={"press": PRESS}, forces=[spring]))


def test_a_motor_with_a_follower_under_forces_is_held_by_the_multiplier_of_a_drive(tmp_path: Path) -> None:
    urdf = (
        '<robot name="grip"><link name="base"/>'
        + link("a", "0.1 0.02 0", 2.0)
        + link("b", "0.1 0 0.03", 1.0)
        + joint("a", "revolute", "base", "0 0 0", "0 1 0", -2, 2, '<dynamics damping="0.3" friction="0.4"/>')
        + joint("b", "revolute", "a_link", "0.3 0 0", "0 1 0", -4, 4,
                '<dynamics damping="0.5" friction="0.9"/><mimic joint="a" multiplier="-1.5" offset="0.2"/>')
        + "</robot>"
    )  # fmt: skip
    forces = [
        {"kind": "spring", "frame_a": "b_link", "frame_b": "world", "point": [0.2, 0.3, 0], "stiffness": 200,
         "free_length": 0.1, "damping": 5},
        {"kind": "wrench", "frame": "b_link", "force": [10, 20, -30], "torque": [1, 2, 3], "expressed_in": "frame"},
    ]  # fmt: skip
    go = {"kind": "waypoints", "times": [0, 1, 2], "positions": [{"a": 0}, {"a": 0.8}, {"a": -0.4}], "samples": 101}
    scene = bc.load_scene(written(tmp_path, urdf, gravity=[3, 1, -8], motions={"go": go}, forces=forces))
    times = np.array([0.0, 0.3, 0.77, 1.2, 1.9])
    motor = {"name": "d", "kind": "prescribed_motion", "joint": "a", "motion": "go"}
    held = {"constraints": [motor], "initial": {"motion": "go"},
            "simulate": {"duration": 2.0, "rtol": 1e-12, "atol": 1e-12}}  # fmt: skip
    run = bc.simulate(scene.with_overrides(held), times=times)
    found = scene_inverse_dynamics(scene, "go")
    torque = found.mechanism.torques(times, *found.motion.at(times))[0]
    np.testing.assert_allclose(torque, run.multipliers, rtol=0, atol=1e-9 * np.abs(torque).max())
    line, low, high = bc.size(scene).joint("a"), scene.robot.lower[0], scene.robot.upper[0]
    q = np.linspace(low, high, 20001)[:, None]
    static = np.abs(found.mechanism.torques(np.zeros(len(q)), q, 0 * q, 0 * q)[0]).max()
    assert line.holding_torque == pytest.approx(static, rel=1e-6) and line.holding_torque >= static * (1 - 1e-12)


@pytest.mark.tier2
@pytest.mark.parametrize("closed", [False, True])
def test_a_page_of_a_motion_with_its_scene_shows_the_torques_under_the_scene_s_forces(
    tmp_path: Path, closed: bool
) -> None:
    (tmp_path / "push.csv").write_text("time [s],torque z [N m]\n0,40\n0.6,-90\n2,5\n")
    frame = "crank_link" if closed else "elbow_link"
    push = {"name": "push", "kind": "wrench", "frame": frame, "file": "push.csv", "interpolation": "hold"}
    if closed:
        scene, name, moved = slider_crank(tmp_path, forces=[push]), "turn", "crank"
    else:
        scene = bc.load_scene(written(tmp_path, SCARA, motions={"press": PRESS}, forces=[push]))
        name, moved = "press", "elbow"
    motion = scene_inverse_dynamics(scene, name).motion
    bc.replay(motion, tmp_path / "page.html", robot=scene)
    lines = {
        line["name"]: line
        for chart in decoded((tmp_path / "page.html").read_text())["charts"]
        if chart["title"] == "joint torque"
        for line in chart["lines"]
    }
    wanted = bc.size(scene, motion).histories[name].joint(moved)
    rows = np.flatnonzero(np.diff(motion.time, prepend=-1.0) > 0.0)
    time = motion.time[rows][:-1]
    history = np.interp(time, bc.size(scene, motion).histories[name].time, wanted.torque)
    far = np.abs(time - 0.6) > 0.02
    off = np.abs(value_at(lines[moved], time) - history)[far].max()
    assert off < 2e-3 * np.ptp(wanted.torque)


def test_a_drive_that_follows_another_motion_than_the_one_that_is_sized_is_said(tmp_path: Path) -> None:
    drive = {"name": "lift", "kind": "prescribed_motion", "joint": "quill", "motion": "press"}
    path = written(
        tmp_path, SCARA, motions={"press": PRESS, "slow": {**PRESS, "times": [0, 2, 4]}}, constraints=[drive]
    )
    assert [text for text in bc.size(path, "slow").warnings if "constraint 'lift'" in text and "'press'" in text]
    assert not [text for text in bc.size(path, "press").warnings if "prescribes" in text]


def test_a_joint_that_sets_off_softly_has_a_direction_from_the_start_and_one_with_rounding_in_a_dwell_rests() -> None:
    edges = np.linspace(0.0, 1.0, 201)
    end = np.minimum(edges[1:], 0.5)  # from 0.5 s on it dwells
    speed = end**2 * (0.5 - np.minimum(edges[:-1], 0.5)) ** 5  # below 1e-9 for the last 8 ms before that
    noise = 3e-13 * np.random.default_rng(0).uniform(-1.0, 1.0, 200)
    velocity = np.where(edges[1:] <= 0.5, speed, noise)[:, None]
    sides = Sides.of(0.0, edges[1:], np.arange(200), velocity)
    assert (np.abs(velocity[:100]) < STILL).any()
    assert (sides.velocity[:100, 0] > 0.0).all() and (sides.velocity[102:, 0] == 0.0).all()
    backwards = Sides.of(0.0, edges[1:], np.arange(200), velocity[::-1])
    np.testing.assert_array_equal(backwards.velocity, sides.velocity[::-1])


def test_rms_torques_do_not_depend_on_the_speed_below_which_signs_are_rounding(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of Panda's circle, whose joint 6 sets off as t^5; signs of all speeds but 0 are the independent answer."""
    friction = {f"panda_joint{k}": {"coulomb": 1.0} for k in range(1, 8)}
    found = []
    for still in (STILL, 1e-18):
        monkeypatch.setattr("bellcrank.sizing.loads.motion_grid.STILL", still)
        sizing = bc.size("panda", ["circle"], overrides={"friction": friction})
        found.append([joint.shaft.rms_torque for joint in sizing.joints if joint.shaft])
    np.testing.assert_allclose(*found, rtol=1e-8)
