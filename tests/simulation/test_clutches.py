"""Clutches and freewheels: joints that slip, lock and overrun, against closed forms."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import bellcrank as bc

JA, JB = 0.4, 0.1
DISK = (
    '<link name="{0}"><inertial><mass value="1"/>'
    '<inertia ixx="{1}" iyy="{1}" izz="{1}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = '<joint name="{0}" type="continuous"><parent link="base"/><child link="{1}"/><axis xyz="0 0 1"/></joint>'


def disks(folder: Path, joints: dict[str, Any], **more: Any) -> Path:
    """Two disks on one axis, each on a joint of its own."""
    bodies = DISK.format("disk_a", JA) + DISK.format("disk_b", JB)
    bodies += JOINT.format("a", "disk_a") + JOINT.format("b", "disk_b")
    (folder / "disks.urdf").write_text(f'<robot name="disks"><link name="base"/>{bodies}</robot>')
    simulate = {"duration": 2.0, "rtol": 1e-11, "atol": 1e-11} | more.pop("simulate", {})
    data = {"urdf": "disks.urdf", "gravity": [0, 0, 0], "joints": joints, "simulate": simulate} | more
    path = folder / "disks.yaml"
    path.write_text(yaml.safe_dump(data))
    return path


@pytest.mark.parametrize("ratio", [1.0, -2.5])
def test_a_clutch_slips_until_both_sides_turn_together_and_then_locks(tmp_path: Path, ratio: float) -> None:
    """From t₀ on w = v_b − N v_a falls by T (1/J_b + N²/J_a); both sides then share the momentum."""
    torque, late, speed = 1.5, 0.3, 8.0
    clutch = {"with": "a", "ratio": ratio, "torque": torque, "engaged": "t - 0.2", "delay": 0.1}
    path = disks(tmp_path, {"b": {"clutch": clutch}}, initial={"velocity": {"a": speed}},
                 outputs={"through": {"force": "clutch_b"}})  # fmt: skip
    run = bc.simulate(path)
    locks = late + abs(ratio * speed) / (torque * (1 / JB + ratio**2 / JA))
    assert run.stuck("b clutch") == pytest.approx(np.array([[locks, 2.0]]), abs=1e-9)
    along = JA * speed / (JA + ratio**2 * JB)  # what is left at a
    assert run.velocity[-1] == pytest.approx([along, ratio * along], abs=1e-9)
    locked = run.time > locks
    assert np.abs(run.velocity[locked, 1] - ratio * run.velocity[locked, 0]).max() < 1e-13
    slips = (run.time > late) & (run.time < locks)
    assert run.output("through")[slips] == pytest.approx(math.copysign(torque, ratio * speed))
    assert not run.output("through")[run.time < late].any() and run.energy_drift() < 1e-10
    assert run.work[-1] == pytest.approx(0.5 * (JA + ratio**2 * JB) * along**2 - 0.5 * JA * speed**2)


@pytest.mark.parametrize(("share", "slips"), [(0.999, False), (1.001, True)])
def test_a_locked_clutch_transmits_up_to_its_torque_and_no_more(tmp_path: Path, share: float, slips: bool) -> None:
    torque = 2.0
    pull = share * torque * (JA + JB) / JB  # the clutch has to accelerate b
    path = disks(tmp_path, {"b": {"clutch": {"with": "a", "torque": torque}}},
                 forces=[{"kind": "torque", "joint": "a", "value": pull}])  # fmt: skip
    run = bc.simulate(path)
    apart = float(abs(run.velocity[-1, 0] - run.velocity[-1, 1]))
    assert (apart > 1e-3) is slips and (apart < 1e-12) is not slips
    assert run.velocity[-1, 1] == pytest.approx(2.0 * min(share, 1.0) * torque / JB, rel=1e-9)


@pytest.mark.parametrize("way", ["forward", "backward"])
def test_a_freewheel_turns_one_way_only(tmp_path: Path, way: str) -> None:
    """J v' = ± (A sin ω t − c): from where the torque turns positive to where v is 0 again; then it holds."""
    size, spin, load, sign = 3.0, 4.0, 1.0, 1.0 if way == "forward" else -1.0
    push = {"kind": "torque", "joint": "a", "value": f"{sign}*({size}*sin({spin}*t) - {load})"}
    one_way = {"a": {"clutch": {"torque": 100, "one_way": way}}}
    path = disks(tmp_path, one_way, simulate={"duration": 4.0}, forces=[push])
    run = bc.simulate(path)
    begin = math.asin(load / size) / spin

    def speed(t: float) -> float:
        return (size / spin * (math.cos(spin * begin) - math.cos(spin * t)) - load * (t - begin)) / JA

    low, high = begin + 0.3, begin + 2 * math.pi / spin
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if speed(middle) > 0 else (low, middle)
    held = run.stuck("a clutch")
    assert held[0] == pytest.approx([0.0, begin], abs=1e-6)  # it lets go at 1e-7 N m
    assert held[1] == pytest.approx([low, begin + 2 * math.pi / spin], abs=1e-6)
    assert (sign * run.velocity[:, 0] >= 0.0).all() and run.velocity[:, 0].any()
    at_rest = (run.time > held[1, 0]) & (run.time < held[1, 1])
    assert not run.velocity[at_rest, 0].any() and run.energy_drift() < 1e-9


def test_a_freewheel_between_two_joints_drives_and_overruns(tmp_path: Path) -> None:
    """a pushes b while it is the faster one; when a brakes, b goes on turning by itself."""
    path = disks(tmp_path, {"b": {"clutch": {"with": "a", "torque": 100, "one_way": "forward"}}},
                 forces=[{"kind": "torque", "joint": "a", "value": "2*sign(1 - t)"}])  # fmt: skip
    run = bc.simulate(path)
    together = 2.0 / (JA + JB)
    assert run.stuck("b clutch") == pytest.approx(np.array([[0.0, 1.0]]), abs=1e-6)
    assert run.velocity[-1] == pytest.approx([together - 2.0 / JA, together], abs=1e-5)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"torque": 1}, "requires the other joint"),
        ({"torque": 1, "with": "b"}, "expected another joint"),
        ({"torque": 1, "with": "c"}, "unknown joint 'c'"),
        ({"with": "a"}, "torque"),
        ({"torque": 0, "with": "a"}, "more than 0"),
        ({"torque": 1, "with": "a", "ratio": 0}, "other than 0"),
        ({"torque": 1, "one_way": "up"}, "forward"),
        ({"torque": 1, "one_way": "forward", "ratio": 2}, "'ratio' is that of two joints"),
        ({"torque": 1, "with": "a", "delay": 1}, "engaged"),
    ],
)
def test_a_wrong_clutch_is_refused_in_one_sentence(tmp_path: Path, entry: dict[str, Any], message: str) -> None:
    with pytest.raises(bc.InputError, match=message):
        bc.load_scene(disks(tmp_path, {"b": {"clutch": entry}}))


def test_a_clutch_is_taken_as_released_where_the_motion_is_given(tmp_path: Path) -> None:
    motions = {"turn": {"kind": "waypoints", "times": [0, 1], "positions": [{"a": 0}, {"a": 1}]}}
    path = disks(tmp_path, {"b": {"clutch": {"with": "a", "torque": 5}}}, motions=motions)
    sizing = bc.size(path)
    assert sizing.joint("b").peak_torque == 0.0 and "clutches (b clutch)" in " ".join(sizing.warnings)
