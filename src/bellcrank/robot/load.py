"""Loading a robot: from a file or a name to checked data, kept on disk so that the next time is quick."""

from __future__ import annotations

import importlib.metadata
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank import arguments
from bellcrank.codegen import cache as disk
from bellcrank.files.access import FileAccess, Trust
from bellcrank.robot.catalog import find_urdf
from bellcrank.robot.friction import Friction, checked_friction
from bellcrank.robot.payload import Payload
from bellcrank.robot.robot import FRICTION_WIDTH, Robot
from bellcrank.robot.tree import FrameTable, Tree
from bellcrank.robot.xml_tree import read_text

if TYPE_CHECKING:
    from bellcrank.robot.urdf_file import Urdf


def load_robot(
    path: str | Path,
    gravity: Sequence[float] = (0.0, 0.0, -9.81),
    floating_base: bool = False,
    friction: Friction = "urdf",
    *,
    payloads: Iterable[Payload] = (),
    rotor_inertia: Mapping[str, float] | None = None,
    frames: FrameTable | None = None,
    clean: bool = True,
    friction_width: float = FRICTION_WIDTH,
    trust: Trust = (),
) -> Robot:
    """Load a URDF from disk, by the name of a bundled one, or by a name of example-robot-data ("ur5", "talos", …).

    gravity (3,) m/s² in the world, so a wall or ceiling mounting is a direction; friction "urdf" (as the file
    gives it), "none", or {joint: (viscous N m s/rad, coulomb N m)}, Coulomb friction smoothed over
    `friction_width` (rad/s, m/s); payloads fixed to frames; rotor_inertia {joint: kg m²} as felt at the joint;
    frames {name: (link, xyz, rpy)} adds frames to the URDF's own; clean=False keeps residues of rounded
    rotations. Meshes that the URDF names are drawn from files near it, or in the folders `trust`
    (files/access.py). Raises InputError, one sentence, for anything wrong with the file or the arguments.
    """
    g = tuple(arguments.vector("gravity", gravity, 3, "m/s²", most=arguments.LARGEST).tolist())
    floating_base, clean = arguments.flag("floating_base", floating_base), arguments.flag("clean", clean)
    width = arguments.number("friction_width", friction_width, "rad/s or m/s", above=0.0, most=arguments.LARGEST)
    friction = checked_friction(friction)
    loads = arguments.several("payloads", payloads, Payload, "Payloads")
    table = {} if frames is None else _frame_table(frames)
    arguments.path("path", path, "the path of a URDF, or the name of a robot")
    source = find_urdf(path)
    text = read_text(source)
    key = "robot-" + disk.digest(
        text,
        repr(floating_base),
        repr([asdict(p) for p in loads]),
        repr(sorted(table.items())),
        repr(clean),
        _version(),
    )
    data = _stored(key)
    if data is None:
        data = _read(source, text, floating_base, loads, table, clean)
        disk.store(key, json.dumps(data).encode())
    robot = Robot(
        source, text, data, gravity=g, floating_base=floating_base, friction=friction,
        friction_width=width, payloads=loads, rotor_inertia={} if rotor_inertia is None else rotor_inertia,
        frames=table, clean=clean,
    )  # fmt: skip
    robot.mesh_access = FileAccess.of(source.resolve(), trust)
    return robot


def _frame_table(frames: object) -> FrameTable:
    """Frames by name: (link, xyz, rpy) each. Raises InputError."""
    table: FrameTable = {}
    expected = "a mapping of names of frames to (link, xyz in m, rpy in rad)"
    for name, entry in arguments.mapping("frames", frames, expected).items():
        if not isinstance(entry, (list, tuple)) or len(entry) != 3:
            arguments.refuse("frames", expected, entry, remedy=f"it is the entry '{name:.80}'")
        link, xyz, rpy = entry
        own = f'frames["{name:.80}"]'
        place = arguments.vector(own, xyz, 3, "m", most=arguments.LARGEST)
        turn = arguments.vector(own, rpy, 3, "rad")
        table[name] = (arguments.text(own, link, "the name of a link"), tuple(place.tolist()), tuple(turn.tolist()))
    return table


_SIZES = {"revolute": (1, 1), "prismatic": (1, 1), "planar": (4, 3), "floating": (7, 6)}  # nq, nv
_TREE = {
    "joints": [{str: object}],
    "frames": [{str: object}],
    "mimics": [(int, int, float, float)],
    "cleaned_entries": int,
    "cleaned_largest": float,
}
_STORED = {
    "name": str, "tree": _TREE, "lower": [float | None], "upper": [float | None], "effort": [float | None],
    "velocity": [float | None], "friction": {str: (float, float)}, "findings": [str], "inertia_warnings": [str],
    "singular_joints": {str: str},
}  # fmt: skip


def _version() -> str:
    package = Path(__file__).parent.parent
    sources = sorted(package.glob("robot/*.py"))
    return importlib.metadata.version("libpinocchio") + disk.digest(*[p.read_bytes() for p in sources])


def _stored(key: str) -> dict[str, Any] | None:
    data: dict[str, Any] | None = disk.load_data(key, _STORED)
    if data is None:
        return None
    followers = {mimic[0] for mimic in data["tree"]["mimics"]}
    try:
        sizes = [_SIZES[j["what"]] for k, j in enumerate(data["tree"]["joints"], 1) if k not in followers]
        sound = all((j["nq"], j["nv"]) == _SIZES[j["what"]] for j in data["tree"]["joints"])
    except KeyError:
        return None
    counts = [sum(nq for nq, _ in sizes)] * 2 + [sum(nv for _, nv in sizes)] * 2
    sound &= [len(data[name]) for name in ("lower", "upper", "effort", "velocity")] == counts
    return data if sound else None


def _read(
    source: Path, text: str, floating_base: bool, payloads: tuple[Payload, ...], frames: FrameTable, clean: bool
) -> dict[str, Any]:
    """Everything of the file that a robot needs, as data that JSON can hold."""
    from bellcrank.robot.articulated_inertia import articulated_inertias
    from bellcrank.robot.check import element_findings, moving_without_mass, vanishing_inertia
    from bellcrank.robot.tree import lay_out, pinocchio_model
    from bellcrank.robot.urdf_file import Urdf

    urdf = Urdf.from_text(text, source)
    full, cleaning = pinocchio_model(urdf, floating_base, payloads, frames, clean, mimic=False)
    tree = lay_out(full, urdf, cleaning, clean)
    followers = {m[0] for m in tree.mimics}
    lower: list[float] = []
    upper: list[float] = []
    effort: list[float] = []
    velocity: list[float] = []
    friction: dict[str, tuple[float, float]] = {}
    for k, joint in enumerate(tree.joints):
        if k + 1 in followers:
            _add_friction(friction, urdf, joint["name"])
            continue
        iq, iv = full.idx_qs[k + 1], full.idx_vs[k + 1]
        one = joint["nv"] == 1
        lower += full.lowerPositionLimit[iq : iq + joint["nq"]].tolist() if one else [-np.inf] * joint["nq"]
        upper += full.upperPositionLimit[iq : iq + joint["nq"]].tolist() if one else [np.inf] * joint["nq"]
        effort += full.effortLimit[iv : iv + joint["nv"]].tolist() if one else [np.inf] * joint["nv"]
        velocity += full.velocityLimit[iv : iv + joint["nv"]].tolist() if one else [np.inf] * joint["nv"]
        if one:
            _add_friction(friction, urdf, joint["name"])

    _tighten_by_followers(tree, urdf, lower, upper, velocity)

    # A free base and the joints' own model have the same tree beyond the base, which the URDF alone describes.
    loaded = full if not floating_base else pinocchio_model(urdf, False, payloads, frames, clean, mimic=False)[0]
    inertias = articulated_inertias(urdf, loaded)

    def finite(values: list[float]) -> list[float | None]:
        return [float(x) if np.isfinite(x) else None for x in values]

    return {
        "name": urdf.name, "tree": asdict(tree), "lower": finite(lower), "upper": finite(upper),
        "effort": finite(effort), "velocity": finite(velocity), "friction": friction,
        "findings": [f"{f.where}: {f.message}" for f in element_findings(urdf) if f.severity == "error"],
        "inertia_warnings": [
            f"{f.where}: {f.message}" for f in moving_without_mass(urdf, _carriers(full, urdf, payloads))
        ],
        "singular_joints": {
            name: f"joint '{name}': {vanishing_inertia(urdf, name, least)}"
            for name, (least, threshold) in inertias.items()
            if abs(least) <= threshold
        },
    }  # fmt: skip


def _carriers(model: Any, urdf: Urdf, payloads: tuple[Payload, ...]) -> list[str]:
    """The links that payloads are fixed to, those of frames that are no links included."""
    from bellcrank.robot.tree import frame_index

    found = []
    for load in payloads:
        frame = frame_index(model, load.frame, "frame")
        while frame and model.frames[frame].name not in urdf.links:
            frame = model.frames[frame].parentFrame
        if frame:
            found.append(model.frames[frame].name)
    return found


def _tighten_by_followers(
    tree: Tree, urdf: Urdf, lower: list[float], upper: list[float], velocity: list[float]
) -> None:
    """A leader stops where a joint that mimics it does: its range and speed are those that all of them allow."""
    followers = {m[0] for m in tree.mimics}
    place, q, v = {}, 0, 0
    for k, joint in enumerate(tree.joints):
        if k + 1 not in followers:
            place[k + 1] = (q, v)
            q, v = q + joint["nq"], v + joint["nv"]
    for follower, leader, multiplier, offset in tree.mimics:  # chains are resolved: each leader is independent
        if multiplier == 0.0 or leader not in place:
            continue
        limits = urdf.joints[tree.joints[follower - 1]["name"]]
        ends = sorted((x - offset) / multiplier for x in (limits.lower, limits.upper) if x is not None)
        iq, iv = place[leader]
        if len(ends) == 2 and max(lower[iq], ends[0]) <= min(upper[iq], ends[1]):
            lower[iq], upper[iq] = max(lower[iq], ends[0]), min(upper[iq], ends[1])
        if limits.velocity is not None:
            velocity[iv] = min(velocity[iv], limits.velocity / abs(multiplier))


def _add_friction(friction: dict[str, tuple[float, float]], urdf: Urdf, name: str) -> None:
    joint = urdf.joints[name]
    if joint.damping or joint.friction:
        friction[name] = (float(joint.damping or 0.0), float(joint.friction or 0.0))
