"""Pages that compute, in a real Chromium, against Python with the overrides that the page states: a 2R arm, a UR5, a
Panda, a SCARA, a delta robot, a five-bar and an arm with a spring that are sized, a four-bar, a spring pendulum, a
rolling disk and Bricard's ring that are simulated, each with random settings.

It prints the largest difference of each quantity: figures of a sizing, of the largest of their kind over the joints;
shares of limits, of 1 or of themselves where they are larger; states of a run, of the largest value; times of ends and
events, s.

python -m tests.campaigns.live_pages --cases 20 --seed 1 --only ur5
"""

import argparse
import shutil
import tempfile
from pathlib import Path

import numpy as np

import bellcrank as bc
from bellcrank.sizing.live.live_sizing import FIGURES
from tests.replays import test_live_runs as runs
from tests.replays import test_live_sizing as sizings
from tests.support.browser import launched, open_in

SIZINGS = ("planar_2r", "ur5", "panda", "scara", "delta", "five_bar", "balanced_arm")
RUNS = ("four_bar", "spring_pendulum", "rolling_disk", "bricard")
STARTS = {"bricard": {"initial.hinge_0": 0.4, "initial.velocity.hinge_0": 0.5}}  # which the scene leaves out
# Without drawing, which takes a processor most of the time.
NO_DRAWING = """
const nothing = new Proxy(function () {}, { get: (_, name) => (name === Symbol.toPrimitive ? () => 0 : nothing),
  set: () => true, apply: () => nothing });
HTMLCanvasElement.prototype.getContext = (kind) => (/webgl/.test(kind) ? null : nothing);
"""
SCARA = """name: SCARA
urdf: scara.urdf
payloads: [{mass: 2.0, frame: quill}]
motions:
  pick:
    kind: waypoints
    times: [0, 0.3, 0.6, 1.0, 1.4]
    positions:
      - {shoulder: 0.2, elbow: 0.9, lift: 0.0, turn: 0.0}
      - {shoulder: 0.2, elbow: 0.9, lift: -0.1, turn: 0.4}
      - {shoulder: 0.9, elbow: 0.2, lift: 0.02, turn: 1.1}
      - {shoulder: 1.4, elbow: -0.8, lift: 0.0, turn: 0.6}
      - {shoulder: 1.4, elbow: -0.8, lift: -0.1, turn: 0.0}
"""
JOINTS = (  # kind, axis, origin of the joint, mass (kg) and its centre
    ("shoulder", "revolute", "0 0 0.3", 6.0, "0.15 0 0"), ("elbow", "revolute", "0.3 0 0", 4.0, "0.12 0 0"),
    ("lift", "prismatic", "0.25 0 0", 0.8, "0 0 -0.1"), ("turn", "revolute", "0 0 -0.2", 0.3, "0.01 0 0"),
)  # fmt: skip


def scara(folder):
    """The file of a SCARA: two revolute joints, a prismatic and a revolute one, all vertical."""
    links, parent = ['<robot name="scara"><link name="base"/>'], "base"
    for name, kind, origin, mass, centre in JOINTS:
        child = "quill" if name == "turn" else f"{name} link"
        links.append(
            f'<link name="{child}"><inertial><origin xyz="{centre}"/><mass value="{mass}"/><inertia ixx="0.01"'
            f' iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="{name}" type="{kind}">'
            f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{origin}"/><axis xyz="0 0 1"/>'
            f'<limit lower="-3" upper="3" effort="90" velocity="9"/><dynamics damping="0.1" friction="0.2"/></joint>'
        )
        parent = child
    (folder / "scara.urdf").write_text("".join([*links, "</robot>"]))
    (folder / "scara.yaml").write_text(SCARA)
    return folder / "scara.yaml"


def sizing_differences(page, subject, rng):
    """The difference of each quantity after random changes."""
    page.do("b.live.reset()")
    assert page.do("b.live.set(x)", sizings.random_changes(page, rng, GROUPS)), page.do("b.live.message")
    found, sizing = sizings.found_of(page), bc.size(subject, overrides=sizings.overrides_of(page))
    count, worst = len(sizing.joints), {}
    for number, kind in enumerate(sizings.expected(sizing)):
        mine = np.array(found["figures"][number * count : number * count + len(kind)])
        worst[FIGURES[number]] = float(np.abs(mine - kind).max() / max(kind))
    for joint, name, place in found["limits"]:
        margin, use = sizings._limits(sizing.joint(joint))[name], None if place is None else found["uses"][place]
        if use is not None and margin is not None and np.isfinite(use) and np.isfinite(margin):
            off = abs(use - (1.0 - margin)) / max(1.0, abs(use))
            worst[f"use: {name}"] = max(worst.get(f"use: {name}", 0.0), off)
    return worst


GROUPS = {
    **sizings.KINDS,
    "parameters": lambda rng, value: value * rng.uniform(0.6, 1.4),
    "coulomb": lambda rng, value: rng.choice([0.0, rng.uniform(0.0, 2.0)]),
}


def run_differences(page, name, rng):
    """The difference of each quantity after random changes; an infinite one where a run ends otherwise."""
    page.do("b.live.reset()")
    if not page.do("b.live.set(x)", runs.random_changes(page, rng)):
        return {f"refused: {page.do('b.live.message').partition(': ')[2]}": 0.0}
    found, overrides = page.do("b.live.result"), {**STARTS.get(name, {}), **runs.overrides_of(page)}
    time, state = np.array(found["time"]), np.array(found["state"]).reshape(len(found["time"]), -1)
    run = bc.simulate(name, overrides=overrides)
    events = [event.name for event in run.events]
    if found["status"] != str(run.status) or [event for event, _ in found["events"]] != events:
        return {"status and events": np.inf}
    asked = np.unique(time[time < min(run.time[-1], time[-1])])[::50]
    again = bc.simulate(name, overrides=overrides, times=asked)
    page_row, row = np.searchsorted(time, asked), np.searchsorted(again.time, asked)
    mine, size = again.state[row], np.abs(again.state).max()
    times = [abs(t - event.time) for (_, t), event in zip(found["events"], run.events, strict=True)]
    return {
        "state": float(np.abs(state[page_row] - mine).max() / size),
        "time of the end": abs(found["end"] - run.time[-1]),
        **({"times of events": max(times)} if times else {}),
    }


def worst_of(browser, name, seeds, folder):
    """The largest difference of each quantity and its seed, of the page of a robot or scene."""
    subject = scara(folder) if name == "scara" else name
    result = bc.size(subject) if name in SIZINGS else bc.simulate(subject, overrides=STARTS.get(name, {}))
    path = bc.replay(result, folder / f"{name}.html", live=True)
    page = open_in(browser, path, size=(1280, 800), script=NO_DRAWING)
    differences = sizing_differences if name in SIZINGS else run_differences
    worst = {}
    for seed in seeds:
        for quantity, off in differences(page, subject, np.random.default_rng(seed)).items():
            if quantity not in worst or off > worst[quantity][0]:
                worst[quantity] = off, seed
    assert page.clean, page.errors
    page.tab.context.close()
    return worst


def main():
    """Run the campaign and print the largest differences."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=(*SIZINGS, *RUNS))
    given = parser.parse_args()
    seeds = [given.seed * 100_000 + number for number in range(given.cases)]
    with tempfile.TemporaryDirectory() as folder, launched(shutil.which("chromium")) as browser:
        for name in given.only:
            for quantity, (off, seed) in worst_of(browser, name, seeds, Path(folder)).items():
                print(f"{name:16} {quantity:32} {off:9.1e}  (seed {seed})", flush=True)


if __name__ == "__main__":
    main()
