"""Random arms and linkages whose drives every command must judge alike: `judge`, `size`, `select --keep`, a sweep of
sizings, and `judge` on the file that `select` wrote.

Each case is an arm of 1 to 6 joints, revolute or prismatic, with masses and inertias of any size, the last two perhaps
moved by two motors together, or a shipped linkage with another gravity. It has friction and damping, springs, a
payload, a motion with reversals and rests, or two along a duty program, motors and gears of the catalogue, and
conditions. Uses must agree to 1e-9, verdicts exactly.

python -m tests.campaigns.one_judge --cases 200 --seed 1
"""

import argparse
import math
import tempfile
from pathlib import Path

import numpy as np
import yaml

import bellcrank as bc
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage

AGREE = 1e-9
CATALOGUE = bc.load_catalogue()


LINKAGES = {"four_bar": "unfold", "five_bar": "draw", "delta": "pick"}


def random_case(seed, folder):
    """A random arm or linkage: its file or name, overrides, and its pairs "motor+gear" by joint."""
    rng = np.random.default_rng(seed)
    return _arm(rng, seed, folder) if rng.random() < 0.8 else _linkage(rng)


def _arm(rng, seed, folder):
    count = int(rng.integers(1, 7))
    kinds = ["prismatic" if rng.random() < 0.2 else "revolute" for _ in range(count)]
    urdf = folder / f"arm{seed}.urdf"
    urdf.write_text(_urdf(rng, kinds))
    names = [f"j{k}" for k in range(count)]
    drives = dict(zip(names, kinds, strict=True))
    coupled = kinds[-2:] == ["revolute"] * 2 and rng.random() < 0.3
    if coupled:  # the last two joints are moved by two motors together
        drives = dict(zip([*names[:-2], "left", "right"], kinds, strict=True))
    kept = {name: _pair(rng, kind) for name, kind in drives.items()}
    data = {
        "name": f"arm {seed}",
        "urdf": urdf.name,
        "gravity": [float(x) for x in rng.normal(scale=7.0, size=3)],
        "motions": {"go": _motion(rng, names)},
        "conditions": _conditions(rng),
        "actuators": {name: _named(pair) for name, pair in kept.items()},
    }
    if coupled:
        matrix = [[1.0, float(rng.uniform(0.2, 1.5))], [1.0, float(-rng.uniform(0.2, 1.5))]]
        data["transmissions"] = [{"joints": names[-2:], "motors": ["left", "right"], "matrix": matrix}]
    if rng.random() < 0.5:
        data["payloads"] = [{"mass": float(rng.uniform(0.1, 3.0)), "frame": f"l{count}"}]
    if rng.random() < 0.3:
        data["forces"] = [
            {"name": "coil", "kind": "joint_spring", "joint": names[-1], "stiffness": float(rng.uniform(0.1, 9.0))}
        ]
    if rng.random() < 0.3:
        data["motions"]["back"] = _motion(rng, names)
        data["duty"] = ["go", {"pause": float(rng.uniform(0.1, 2.0))}, {"motion": "back", "repeat": 2}]
    path = folder / f"arm{seed}.yaml"
    path.write_text(yaml.safe_dump(data))
    return path, None, kept


def _linkage(rng):
    name = str(rng.choice(list(LINKAGES)))
    plain = bc.load_scene(name)
    motors = [joint.name for joint in Linkage(plain).motors]
    kept = {motor: _pair(rng, "revolute") for motor in motors}
    changes = {
        "gravity": [float(x) for x in rng.normal(scale=7.0, size=3)],
        "conditions": _conditions(rng),
        "actuators": {motor: _named(pair) for motor, pair in kept.items()},
    }
    return name, changes, kept


def _conditions(rng):
    return {
        "voltage": float(rng.choice([24.0, 48.0, 325.0])),
        "voltage_ratio": float(rng.uniform(1.1, 4.0)),
        "ambient": float(rng.uniform(0.0, 45.0)),
        "altitude": float(rng.choice([0.0, 1800.0])),
        "safety_factor": float(rng.choice([1.0, 1.3, 2.0])),
        "inertia_ratio": float(10.0 ** rng.uniform(0.0, 2.0)),
        "assume": {
            "gear.efficiency": float(rng.uniform(0.4, 1.0)),
            "gear.back_efficiency": float(rng.uniform(0.2, 1.0)),
            "gear.inertia": 1e-6,
        },
    }


def differences(robot, overrides, kept, folder):
    """Sentences on what differs between `judge` and what other commands say of the same drives."""
    judged = bc.judge(robot, overrides=overrides)
    sizing = bc.size(robot, overrides=overrides)
    selection = bc.select(robot, keep=kept, feedback=False, candidates=1, overrides=overrides)
    found = []
    for one in judged.drives:
        for name, others in (
            ("size", dict(sizing.shafts)[one.axis].judged.criteria),
            ("select", selection.axis(one.axis).chosen.criteria),
        ):
            found += [f"{one.axis}: judge {mine}, {name} {theirs}" for mine, theirs in _unlike(one.criteria, others)]
    for mine, theirs in _unlike(judged.system, selection.system):
        found.append(f"all axes: judge {mine}, select {theirs}")
    if judged.inside != selection.inside:
        found.append(f"inside: judge {judged.inside}, select {selection.inside}")
    return found + _of_a_sweep(robot, overrides, judged) + _of_a_written_file(robot, overrides, kept, folder)


def _of_a_sweep(robot, overrides, judged):
    """What a sweep of one sizing says otherwise of the smallest margin of each drive."""
    scene = bc.load_scene(robot, overrides)
    ambient = scene.config.conditions.ambient
    swept, found = bc.sweep(scene, {"conditions.ambient": [ambient]}, size=True), []
    for one in judged.drives:
        margins = list(one.margins.values())
        known = [margin for margin in margins if margin is not None]
        least = min(known, default=math.nan)
        expected = math.nan if None in margins and not least < -2e-5 else least
        margin = float(swept.column(f"{one.axis}.drive_margin")[0])
        if margin != expected and not math.isclose(margin, expected, rel_tol=AGREE, abs_tol=AGREE):
            found += (
                []
                if math.isnan(margin) and math.isnan(expected)
                else [f"{one.axis}: judge leaves {expected}, a sweep {margin}"]
            )
    return found


def _of_a_written_file(robot, overrides, kept, folder):
    """What `judge` says otherwise of the file that a selection with the masses of its actuators wrote."""
    selection = bc.select(robot, keep=kept, candidates=1, overrides=overrides)
    if any(one.chosen is None or one.chosen.mass is None for one in selection.axes):
        return []
    written = bc.judge(selection.write_config(folder / "written.yaml"), trust=Path("/"))
    return [
        f"{one.axis}: select {mine}, judge on its file {theirs}"
        for one in written.drives
        for mine, theirs in _unlike(selection.axis(one.axis).chosen.criteria, one.criteria)
    ]


def _unlike(results, others):
    return [(mine, theirs) for mine, theirs in zip(results, others, strict=True) if not alike(mine, theirs)]


def alike(one, other):
    """Whether two results of a criterion are the same, uses up to rounding."""
    same = (one.name, one.verdict) == (other.name, other.verdict) and (one.use is None) == (other.use is None)
    return same and (one.use is None or math.isclose(one.use, other.use, rel_tol=AGREE, abs_tol=1e-12))


def _pair(rng, kind):
    linear = kind == "prismatic"
    motors = [one for one in CATALOGUE.motors if not (linear and one.kind == "actuator")]
    motor = motors[int(rng.integers(len(motors)))]
    gears = [gear for gear in CATALOGUE.gears if gear.linear == linear and gear.ratio is not None]
    if motor.kind == "actuator" or (not linear and rng.random() < 0.15):
        return f"{motor.id}+direct"
    for place in rng.permutation(len(gears)).tolist():  # one that fits
        if _goes(motor, gears[place], kind):
            return f"{motor.id}+{gears[place].id}"
    return _pair(rng, kind)


def _goes(motor, gear, kind):
    from bellcrank.sizing.selection.pairs import Pairs

    pairs = Pairs.possible([motor], [gear], "linear" if kind == "prismatic" else "rotary")
    return bool(pairs.with_gear.any())


def _named(pair):
    motor, plus, gear = pair.partition("+")
    return {"motor": motor} | ({"gear": gear} if plus else {})


def _motion(rng, names):
    """Waypoints with a rest in the middle and a reversal at each row."""
    times = np.cumsum([0.0, *rng.uniform(0.3, 1.5, size=4)])
    rows = rng.uniform(-0.8, 0.8, size=(5, len(names)))
    rows[3] = rows[2]
    positions = [dict(zip(names, map(float, row), strict=True)) for row in rows]
    return {"kind": "waypoints", "times": [float(t) for t in times], "positions": positions}


def _urdf(rng, kinds):
    parts = ['<robot name="arm"><link name="l0"/>']
    for k, kind in enumerate(kinds):
        mass = float(10.0 ** rng.uniform(-1.5, 1.0))
        inertia = mass * float(rng.uniform(1e-3, 5e-2))
        xyz = " ".join(f"{x:.6f}" for x in rng.uniform(-0.3, 0.3, size=3))
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        parts.append(
            f'<link name="l{k + 1}"><inertial><origin xyz="{xyz}"/><mass value="{mass:.8f}"/>'
            f'<inertia ixx="{inertia:.9f}" iyy="{inertia:.9f}" izz="{inertia:.9f}" ixy="0" ixz="0" iyz="0"/></inertial>'
            f'</link><joint name="j{k}" type="{kind}"><parent link="l{k}"/><child link="l{k + 1}"/>'
            f'<origin xyz="{xyz}"/><axis xyz="{axis[0]:.9f} {axis[1]:.9f} {axis[2]:.9f}"/>'
            f'<limit lower="-9" upper="9" effort="1e4" velocity="1e3"/>'
            f'<dynamics damping="{rng.uniform(0.0, 0.2):.6f}" friction="{rng.uniform(0.0, 0.5):.6f}"/></joint>'
        )
    return "".join(parts) + "</robot>"


def main():
    """Run the campaign and print what differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        for number in range(given.cases):
            found = differences(*random_case(given.seed * 100_000 + number, Path(folder)), Path(folder))
            wrong += bool(found)
            print(*(f"case {number}: {text}" for text in found), sep="\n", end="\n" if found else "")
    print(f"{given.cases} cases, {wrong} differ")


if __name__ == "__main__":
    main()
