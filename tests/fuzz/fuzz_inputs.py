"""Hostile inputs for the fuzz test: from a kind and a number, files and what to do with them; the same every time.

Each kind begins with inputs that are right and damages them: numbers at the edges of what doubles, lengths or counts
may be; words of other types, units and languages; pieces left out, doubled or exchanged; bytes flipped.
"""

from __future__ import annotations

import io
import json
import math
import random
import zipfile
from collections.abc import Callable

import fuzz_formats
import numpy as np
import yaml
from fuzz_case import Case, yaml_bytes
from fuzz_damage import Damage
from fuzz_seeds import (  # fmt: skip
    CONFIGURATION,
    DAE,
    DRIVEN,
    HELD,
    LOOP,
    MESHED,
    MJCF,
    MJCF_DEFAULTS,
    MOTION,
    NUMBERS,
    OBJ,
    SCENE,
    STL,
    TORQUE,
    URDF,
    WORDS,
)


def _urdf(d: Damage) -> Case:
    text = URDF.replace("%s", "")
    text = d.attributes(text) if d.rng.random() < 0.75 else d.text(text)
    data = d.bytes(text.encode("utf-8", "replace")) if d.rng.random() < 0.15 else text.encode("utf-8", "replace")
    return Case({"robot.urdf": data}, "robot", ("robot.urdf", {"floating_base": d.rng.random() < 0.2}))


def _mjcf(d: Damage) -> Case:
    files = {"robot.xml": MJCF, "defaults.xml": MJCF_DEFAULTS, "a.obj": OBJ}
    name = d.rng.choice(["robot.xml"] * 4 + list(files))
    text = files[name] if name == "a.obj" or d.rng.random() < 0.15 else d.attributes(files[name])
    damaged = d.text(text) if text == files[name] else text
    data = {key: each.encode() for key, each in files.items()} | {name: damaged.encode("utf-8", "replace")}
    return Case(data, "robot", ("robot.xml", {}))


def _scene(d: Damage) -> Case:
    return Case({"scene.yaml": yaml_bytes(d, d.rng.choice([SCENE, HELD, DRIVEN]))}, "scene", ("scene.yaml",))


def _constraints(d: Damage) -> Case:
    others = [
        {"name": "apex", "kind": "weld", "frame_a": "a", "frame_b": "b"},
        {"kind": "distance", "frame_a": "a", "frame_b": "world", "length": 0.5},
        {"name": "apex", "kind": "hinge", "frame_a": "a", "frame_b": "b", "axis": [0, 0, 1]},
        {"kind": "coupling", "joint_a": "crank", "joint_b": "rocker", "ratio": 2},
        {"name": "f", "kind": "expression", "expression": d.expression()},
        {"kind": "rolling_disk", "frame": "b", "axis": [0, 0, 1], "radius": 0.1},
    ]
    scene = json.loads(json.dumps(LOOP))
    if d.rng.random() < 0.6:
        scene["constraints"][:] = [*scene["constraints"][: d.rng.randrange(2)], d.rng.choice(others)]
    return Case({"loop.yaml": yaml_bytes(d, scene)}, "scene", ("loop.yaml",))


def _expression(d: Damage) -> Case:
    text, unit = d.expression(), d.rng.choice(["m", "N m", "1", "?"])
    scene = {key: SCENE[key] for key in ("urdf", "gravity", "initial", "simulate")}
    if d.rng.random() < 0.5:
        scene["outputs"] = {"x": {"expression": text, "unit": unit}}
    else:
        scene["events"] = [{"name": "e", "when": {"expression": text}, "stop": d.rng.random() < 0.5}]
    data = yaml.safe_dump(scene, allow_unicode=True).encode("utf-8", "replace")
    return Case({"scene.yaml": data}, "scene", ("scene.yaml",))


def _csv(d: Damage) -> Case:
    if d.rng.random() < 0.6:
        return Case({"motion.csv": _table(d, MOTION)}, "motion", ("motion.csv",))
    scene = {key: SCENE[key] for key in ("urdf", "gravity", "initial", "simulate")}
    scene["forces"] = [
        {
            "name": "motor",
            "kind": "torque",
            "joint": "shoulder",
            "file": "torque.csv",
            "interpolation": d.rng.choice(["linear", "cubic", "step"]),
        }
    ]
    return Case(
        {"torque.csv": _table(d, TORQUE), "scene.yaml": yaml.safe_dump(scene).encode()}, "scene", ("scene.yaml",)
    )


def _table(d: Damage, text: str) -> bytes:
    rows = [line.split(",") for line in text.splitlines()]
    for _ in range(d.rng.choice([0, 1, 1, 1, 2, 4])):
        row = d.rng.choice(rows)
        if not row:
            continue
        k = d.rng.randrange(len(row))
        what = d.rng.randrange(5)
        if what < 2 and row is not rows[0]:
            row[k] = str(d.rng.choice([d.number(), round(d.rng.uniform(-3.0, 3.0), 3)]))
        elif what == 2:
            row[k] = d.rng.choice(WORDS)
        elif what == 3:
            del row[k]
        else:
            rows.insert(d.rng.randrange(len(rows)), list(row))
    data = "\n".join(map(",".join, rows)).encode("utf-8", "replace")
    return d.bytes(data) if d.rng.random() < 0.1 else data


def _configuration(d: Damage) -> Case:
    return Case(
        {"arm.yaml": yaml_bytes(d, CONFIGURATION)}, "command", (["size", "arm.yaml", "--no-plots", "--out", "sized"],)
    )


def _saved_run(d: Damage) -> Case:
    return Case({}, "saved run", (d.rng.randrange(2**32),))  # made of a run of the child's own


def damaged_run(whole: bytes, seed: int) -> bytes:
    """A saved run with bytes, an array or its JSON text damaged, checksums right again but for the bytes."""
    d = Damage(random.Random(seed))
    if d.rng.random() < 0.15:
        return d.bytes(whole)
    with zipfile.ZipFile(io.BytesIO(whole)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = d.rng.choice(["about.npy", "about.npy", *members])
    array = np.load(io.BytesIO(members[name]))
    if name == "about.npy":
        about = d.data(json.loads(array.tobytes()), gentle=0.3)
        array = np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)
    else:
        what = d.rng.randrange(6)
        if what == 0 and array.size:
            array = array.copy()
            array.flat[d.rng.randrange(array.size)] = float(d.rng.choice([math.nan, math.inf, -1.0, 1e308]))
        elif what == 1:
            array = array[: len(array) // 2]
        elif what == 2:
            array = array.astype(d.rng.choice([np.float32, np.int64, np.complex128, "U5"]))
        elif what == 3:
            array = array.reshape(-1, 1) if array.ndim == 1 else array.ravel()
        elif what == 4:
            array = np.zeros(0)
    out = io.BytesIO()
    np.save(out, array)
    members[name] = d.bytes(out.getvalue()) if d.rng.random() < 0.1 else out.getvalue()
    if d.rng.random() < 0.1:
        del members[name]
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for key, data in members.items():
            archive.writestr(key, data)
    return packed.getvalue()


def _mesh(d: Damage) -> Case:
    name, text = d.rng.choice([("a.obj", OBJ), ("a.stl", STL), ("a.dae", DAE)])
    data = (d.attributes(text) if name == "a.dae" else d.text(text)).encode("utf-8", "replace")
    if d.rng.random() < 0.3:
        data = d.bytes(data)
    files = {
        name: data,
        "a.mtl": d.text("newmtl m\nKd 1 0 0\nmap_Kd a.png\n").encode("utf-8", "replace"),
        "robot.urdf": URDF.replace("%s", MESHED % name).encode(),
    }
    return Case(files, "page", ("robot.urdf",))


def _command(d: Damage) -> Case:
    what = d.rng.choice(["simulate", "size", "check", "robots", "sweep", "report", "replay", "plot", "simulate", ""])
    right = {
        "size": "planar_2r",
        "check": "planar_2r",
        "report": "scene.yaml",
        "replay": "scene.yaml",
        "plot": "pendulum",
        "sweep": "pendulum",
    }
    subject = right.get(what, "planar_2r_swing")
    if d.rng.random() < 0.25:
        subject = d.rng.choice(["nothing", "scene.yaml", "/dev/null", ".", "planar_2r.urdf", *WORDS[:20]])
    options = {
        "simulate": ["--duration", "--samples", "--rtol", "--step", "--solver", "--set", "--frame", "--csv"],
        "size": ["--margin", "--motion", "--set"],
        "sweep": ["--vary", "--threads", "--set"],
        "report": ["--title"],
        "replay": ["--window", "--fps", "--at", "--trace"],
        "plot": ["--frame"],
    }.get(what, [])
    argv = [what, *([subject] if what != "robots" else [])]
    if what == "simulate":
        argv += ["--duration", "0.1", "--samples", "5", "--no-plots"]
    for option in d.rng.sample(options, min(len(options), d.rng.randrange(3))):
        value = d.rng.choice(
            [str(d.number()), d.rng.choice(WORDS), "initial.elbow=" + str(d.value(3)), "initial.shoulder=0:1:3"]
        )
        argv += [option] if option == "--csv" else [option, value]
    if what in ("size", "sweep", "plot"):
        argv += ["--out", "made"]
    argv = [text.replace("\x00", "") for text in argv]  # no argument of a process can hold it
    return Case({"scene.yaml": yaml_bytes(d, SCENE)}, "command", (argv,))


def _override(d: Damage) -> Case:
    keys = [
        "initial.shoulder",
        "simulate.rtol",
        "gravity",
        "forces.rope.stiffness",
        "parameters.k",
        "simulate",
        "outputs",
        "frames.hook.xyz",
        "name",
        "urdf",
        *WORDS,
    ]
    if d.rng.random() < 0.5:
        return Case(
            {"scene.yaml": yaml.safe_dump(SCENE).encode()},
            "override",
            ("scene.yaml", {d.rng.choice(keys): d.value() for _ in range(d.rng.choice([1, 2]))}),
        )
    axis = d.rng.choice(
        [
            [0.1, 0.2],
            [d.number(), d.number()],
            d.value(),
            {"from": d.number(), "to": d.number(), "count": d.rng.choice([2, 0, 10**12, "x"])},
        ]
    )
    return Case(
        {"scene.yaml": yaml.safe_dump(SCENE).encode()},
        "sweep",
        ("scene.yaml", {d.rng.choice(["initial.shoulder", "parameters.k", d.rng.choice(keys)]): axis}, {}),
    )


def _argument(d: Damage) -> Case:
    things = [
        *NUMBERS,
        *WORDS[:24],
        None,
        True,
        (),
        [],
        {},
        [[]],
        [1],
        [1, 2],
        [1, 2, 3],
        {"elbow": math.nan},
        {"a": 1},
        b"x",
        1j,
        object,
        print,
        [None],
        ["a"],
    ]
    return Case(
        {},
        "argument",
        (d.rng.randrange(10**6), things[d.rng.randrange(len(things))], things[d.rng.randrange(len(things))]),
    )


KINDS: dict[str, Callable[[Damage], Case]] = {
    "urdf": _urdf,
    "mjcf": _mjcf,
    "scene": _scene,
    "constraints": _constraints,
    "expression": _expression,
    "csv": _csv,
    "configuration": _configuration,
    "saved_run": _saved_run,
    "mesh": _mesh,
    "command": _command,
    "override": _override,
    "argument": _argument,
    **fuzz_formats.KINDS,
}


def case(kind: str, seed: int, number: int) -> Case:
    """The case of that number: of a kind, a seed and a number alone. Kinds "fault NAME" are for the test of the net."""
    if kind.startswith("fault "):
        return Case({}, "fault", (kind.removeprefix("fault "), number))
    return KINDS[kind](Damage(random.Random(f"{kind} {seed} {number}")))
