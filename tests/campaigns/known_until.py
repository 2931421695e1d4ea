"""Random scenes, regular and chaotic: up to when a run says that it is known, against tight runs of two methods.

Each scene is a chain of 1 to 4 links, on revolute and prismatic joints, perhaps damped or with springs, or a shipped
scene with another start; it lasts 1 to 60 s at tolerances from 1e-5 to 1e-10. The truth is a run of DOP853 at 1e-13,
and holds only as long as one of Radau agrees with it to 1 % of the bound. A run must not be known where its true error
exceeds the bound, and must be known where that is below a tenth of it.

python -m tests.campaigns.known_until --cases 200 --seed 1
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np
import yaml

import bellcrank as bc
from bellcrank.simulation.trajectory.error_estimate import error_bounds

SHIPPED = ("four_bar", "rolling_disk", "spring_pendulum", "five_bar", "ur5_falling")
FINEST = 1e-13


def random_scene(seed, folder):
    """A random chain, or a shipped scene."""
    rng = np.random.default_rng(seed)
    rtol = float(10.0 ** rng.uniform(-10.0, -5.0))
    if rng.random() < 0.15:
        return bc.load_scene(str(rng.choice(SHIPPED)), {"simulate.rtol": rtol, "simulate.atol": rtol, "events": []})
    count = int(rng.integers(1, 5))
    (folder / f"chain{seed}.urdf").write_text(_urdf(rng, count))
    names = [f"j{k}" for k in range(count)]
    start = {name: float(rng.uniform(-2.0, 2.0)) for name in names}
    data = {
        "name": f"chain {seed}",
        "urdf": f"chain{seed}.urdf",
        "friction": {
            name: {"viscous": float(10.0 ** rng.uniform(-3.0, 0.0)) if rng.random() < 0.3 else 0.0} for name in names
        },
        "initial": start | {"velocity": {name: float(rng.normal(scale=2.0)) for name in names}},
        "simulate": {"duration": float(rng.uniform(1.0, 60.0)), "rtol": rtol, "atol": rtol},
        "forces": [
            {"kind": "joint_spring", "name": f"s{k}", "joint": name, "stiffness": float(rng.uniform(1.0, 20.0))}
            for k, name in enumerate(names)
            if rng.random() < 0.4
        ],
    }
    path = folder / f"chain{seed}.yaml"
    path.write_text(yaml.safe_dump(data))
    return bc.load_scene(path)


def _urdf(rng, count):
    parts = ['<robot name="chain"><link name="l0"/>']
    for k in range(count):
        mass, inertia = float(rng.uniform(0.3, 3.0)), float(rng.uniform(0.005, 0.05))
        xyz = " ".join(f"{x:.4f}" for x in rng.uniform(-0.4, 0.4, size=3))
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        parts.append(
            f'<link name="l{k + 1}"><inertial><origin xyz="{xyz}"/><mass value="{mass:.5f}"/>'
            f'<inertia ixx="{inertia:.6f}" iyy="{inertia:.6f}" izz="{inertia:.6f}" ixy="0" ixz="0" iyz="0"/></inertial>'
            f'</link><joint name="j{k}" type="continuous"><parent link="l{k}"/><child link="l{k + 1}"/>'
            f'<origin xyz="{xyz}"/><axis xyz="{axis[0]:.6f} {axis[1]:.6f} {axis[2]:.6f}"/></joint>'
        )
    return "".join(parts) + "</robot>"


def judged(scene):
    """(known until, true until, truth until, smallest time of a tenth of the bound), s, of a scene's run."""
    run = bc.simulate(scene)
    until = run.known_until
    if until is None:
        run.error_estimate()
        until = run.known_until
    tight = [bc.simulate(scene, solver=solver, rtol=FINEST, atol=FINEST) for solver in ("DOP853", "Radau")]
    rows = min(len(run), *(len(one) for one in tight))
    time, bounds = run.time[:rows], error_bounds(run)
    error = (np.abs(run.position[:rows] - tight[0].position[:rows]) / bounds).max(axis=1)
    apart = (np.abs(tight[0].position[:rows] - tight[1].position[:rows]) / bounds).max(axis=1)
    return until, _first(time, error > 1.0), _first(time, apart > 0.01), _first(time, error > 0.1)


def _first(time, there):
    """The first time at which something is so; infinite where it never is."""
    return float(time[np.argmax(there)]) if there.any() else np.inf


def verdict(until, wrong, truth, near):
    """What is wrong with the time until which a run says that it is known; empty where nothing is."""
    if until >= wrong and wrong < truth:
        return f"known until {until:.4g} s, but wrong from {wrong:.4g} s on"
    if until < near and until < truth:  # the error is below a tenth of the bound, and more time is known
        return (
            f"known until {until:.4g} s only: below a tenth of the bound until {near:.4g} s, truth until {truth:.4g} s"
        )
    return ""


def main():
    """Run the campaign and print what is wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    wrong, limited, shares = 0, 0, []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(given.cases):
            scene = random_scene(given.seed * 100_000 + number, Path(folder))
            found = judged(scene)
            said = verdict(*found)
            wrong += bool(said)
            if found[0] < np.inf:
                limited += 1
                if found[1] < min(found[2], np.inf):
                    shares.append(found[0] / found[1])
            if said:
                print(f"case {number}: {scene.name}: {said}", flush=True)
    span = f"{min(shares):.3f} to {max(shares):.3f}" if shares else "none"
    print(f"{given.cases} scenes, {limited} known for a limited time, at {span} of the true one; {wrong} wrong")


if __name__ == "__main__":
    main()
