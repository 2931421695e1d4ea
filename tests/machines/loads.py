"""A machine's scene with every kind of force, controller and output, with parameters and events, as files.

Numbers differ from each other, from 0 and from 1, so that one that is exchanged, forgotten or doubled is seen.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

TABLE = np.array([[0.0, 0.2], [0.05, 0.9], [0.11, -0.7], [0.3, 0.4]])  # s, shares of a joint's torque
NOWHERE = 1.0e3  # m: the level of events that do not happen unless a test sets it


@dataclass(frozen=True)
class Loads:
    """Where the forces of the loaded scene act, and how large they are.

    Attributes:
        links: A link, and another one where there is one, to which the frames `hook` and `eye` are fixed.
        joints: Two joints with one degree of freedom, or none, and the size of their torques, N m (N).
        force: The size of forces, N.
        reach: The size of lengths, m.
        start: What replaces keys of the scene: the start, gravity.
        duration: Of the run, s.
        passive: Which of the joints have no motor, so that no controller acts there.
    """

    links: tuple[str, str]
    joints: Mapping[str, float]
    force: float
    reach: float
    start: Mapping[str, Any]
    duration: float = 0.3
    passive: tuple[str, ...] = ()


def write_loaded_scene(scene: Mapping[str, Any], loads: Loads, folder: Path) -> Path:
    """The file of a scene (its mapping) with the loads, and the table of a torque beside it."""
    data = {**scene, "urdf": str(scene["urdf"]), **loads.start}
    joints = list(loads.joints.items())
    tip, other = loads.links
    size, f = loads.reach, loads.force
    data["frames"] = data.get("frames", {}) | {
        "hook": {"link": tip, "xyz": [0.31 * size, -0.12 * size, 0.17 * size], "rpy": [0.4, -0.3, 0.7]},
        "eye": {"link": other, "xyz": [-0.11 * size, 0.23 * size, 0.06 * size], "rpy": [-0.2, 0.5, 0.3]},
    }
    data["forces"] = [*data.get("forces", ()), *_forces_at_frames(loads), *_forces_at_joints(joints)]
    data["control"] = [*data.get("control", ()), *_controllers(joints, loads.passive)]
    data["parameters"] = data.get("parameters", {}) | {
        "stiffness": {"value": 1.7 * f / size, "sets": ["forces.tie.stiffness"]},
        "offset": {"value": 0.31 * size, "sets": ["frame.hook.origin.x"]},
        "load": {"value": 1.0, "sets": [f"link.{tip}.scale"]},
        "level": {"value": NOWHERE},
    }
    crossing = {"expression": "frame('hook').x - level"}
    data["events"] = [
        {"name": "rises", "when": crossing, "direction": "up"},
        {"name": "sinks", "when": crossing, "direction": "down"},
        {"name": "passes", "when": dict(crossing)},
    ]
    data["outputs"] = _outputs(data, loads.joints)
    data["simulate"] = {"duration": loads.duration, "solver": "DOP853", "rtol": 1e-11, "atol": 1e-12, "samples": 61}
    if joints:
        name, most = joints[0]
        rows = "".join(f"{t!r},{most * share!r}\n" for t, share in TABLE.tolist())
        (folder / "table.csv").write_text(f"time [s],{name} torque [N m]\n{rows}")
    path = folder / "loaded.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    return path


def table_torque(most: float, time: float) -> float:
    """The torque (N m) of the table at a time (s): linear between its rows, and constant after them."""
    return float(np.interp(time, TABLE[:, 0], most * TABLE[:, 1]))


def _forces_at_frames(loads: Loads) -> list[dict[str, Any]]:
    f, size = loads.force, loads.reach
    moment = f * size
    found = [
        {
            "name": "tie", "kind": "spring", "frame_a": "hook", "frame_b": "world",
            "point": [0.9 * size, 0.3 * size, -0.4 * size],
            "stiffness": 1.7 * f / size, "free_length": 0.35 * size, "damping": 0.23 * f / size,
        },
        {
            "name": "push", "kind": "wrench", "frame": "hook", "force": [0.3 * f, -0.21 * f, 0.13 * f],
            "torque": [0.04 * moment, 0.07 * moment, -0.05 * moment],
        },
        {
            "name": "jet", "kind": "wrench", "frame": "eye", "expressed_in": "frame",
            "force": [-0.11 * f, 0.17 * f, 0.23 * f], "torque": [0.02 * moment, -0.03 * moment, 0.05 * moment],
        },
        # what is left out has its default
        {"name": "cord", "kind": "spring", "frame_a": "eye", "frame_b": "world", "stiffness": 0.4 * f / size},
        {"name": "gust", "kind": "wrench", "frame": "eye", "force": [0.07 * f, 0.11 * f, -0.05 * f]},
        {"name": "twist", "kind": "wrench", "frame": "hook", "torque": [0.03 * moment, 0.01 * moment, 0.04 * moment]},
    ]  # fmt: skip
    if loads.links[0] != loads.links[1]:
        found.append(
            {
                "name": "band", "kind": "spring", "frame_a": "eye", "frame_b": "hook",
                "stiffness": 1.1 * f / size, "free_length": 0.21 * size, "damping": 0.13 * f / size,
            }
        )  # fmt: skip
    return found


def _forces_at_joints(joints: list[tuple[str, float]]) -> list[dict[str, Any]]:
    if not joints:
        return []
    (a, most), (b, least) = joints
    return [
        {
            "name": "coil", "kind": "joint_spring", "joint": a, "stiffness": 1.3 * most, "rest": 0.2,
            "preload": 0.31 * most, "damping": 0.07 * most,
        },
        {"name": "oil", "kind": "damper", "joint": b, "coefficient": 0.05 * least},
        {"name": "rub", "kind": "friction", "joint": a, "viscous": 0.03 * most, "coulomb": 0.2 * most, "width": 0.4},
        # what is left out has its default
        {"name": "soft", "kind": "joint_spring", "joint": b, "stiffness": 0.6 * least},
        {"name": "grease", "kind": "friction", "joint": b, "viscous": 0.02 * least},
        {"name": "constant", "kind": "torque", "joint": b, "value": 0.17 * least},
        {"name": "table", "kind": "torque", "joint": a, "file": "table.csv"},
    ]  # fmt: skip


def _controllers(joints: list[tuple[str, float]], passive: tuple[str, ...]) -> list[dict[str, Any]]:
    if not joints:
        return []
    (a, most), (b, least) = joints
    driven = [name for name in (a, b) if name not in passive]
    of = lambda values: {name: value for name, value in values.items() if name in driven}  # noqa: E731
    last, size = (driven[-1], least if driven[-1] == b else most)
    return [
        {
            "name": "servo", "kind": "pd", "joints": driven, "target": of({a: 0.3, b: -0.15}),
            "kp": of({a: 0.9 * most, b: 0.6 * least}), "kd": of({a: 0.11 * most, b: 0.08 * least}),
        },
        {"name": "brake", "kind": "pd", "target": {last: -2.5}, "kp": 3.0 * size, "limit": 0.13 * size},
        {"name": "weight", "kind": "gravity_compensation", "joints": driven, "mass_error": 0.15},
    ]  # fmt: skip


def _outputs(data: Mapping[str, Any], joints: Mapping[str, float]) -> dict[str, Any]:
    of_frames, of_joints = (
        ("position", "velocity", "rotation", "angular_velocity"),
        ("position", "velocity", "acceleration", "torque"),
    )
    found: dict[str, Any] = {f"hook_{what}": {"frame": "hook", "what": what} for what in of_frames}
    found |= {f"{name}_{what}": {"joint": name, "what": what} for name in joints for what in of_joints}
    found |= {f"energy_{what}": {"energy": what} for what in ("kinetic", "potential", "total")}
    found |= {f"force_{entry['name']}": {"force": entry["name"]} for entry in data["forces"] + data["control"]}
    for entry in data.get("constraints", ()):
        found[f"constraint_{entry['name']}"] = {"constraint": entry["name"]}
        if entry["kind"] == "rolling_disk":
            found |= {
                what: {"constraint": entry["name"], "what": what} for what in ("contact_point", "friction_demand")
            }
    if data.get("floating_base"):
        found |= {f"{what}_momentum": {"momentum": what} for what in ("linear", "angular")}
    found["mixed"] = {"expression": "2*frame('hook').vx**2 - 3*sin(frame('hook').z)*t + sqrt(1 + t**2)"}
    return found
