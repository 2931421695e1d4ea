"""What the fuzz test does with an input, and what must hold then."""

from __future__ import annotations

import contextlib
import functools
import io
import json
import math
import os
import shutil
import signal
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import fuzz_calls
import fuzz_formats
import fuzz_inputs
import numpy as np

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.simulation.integration.statistics import Status

LONGEST = 5000  # letters of a message


class Wrong(Exception):
    """What must not be: what came out, in a few words that are the same for the same fault."""


def judge(case: fuzz_inputs.Case) -> str:
    """Do what the case says, in the current folder, where its files lie; "accepted" or "refused". Raises Wrong."""
    try:
        with warnings.catch_warnings(record=True) as noise:
            warnings.simplefilter("always", RuntimeWarning)
            status = ACTIONS[case.action](*case.arguments)
        heard = [w for w in noise if issubclass(w.category, RuntimeWarning)]
        if heard:
            raise Wrong(f"warning on the terminal: {Path(heard[0].filename).name}: {heard[0].message}")
        verdict = "refused" if status == 2 else "accepted"
    except bc.BellcrankError as error:
        sentence(str(error))
        verdict = "refused"
    hidden = sorted(path.suffix for path in Path().rglob(".*"))
    if hidden:
        raise Wrong(f"left a hidden file behind ({hidden[0]})")
    return verdict


def sentence(text: str) -> None:
    """One line of text that a terminal can show."""
    if not text.strip() or len(text.splitlines()) != 1:
        raise Wrong(f"a message of {len(text.splitlines())} lines")
    if len(text) > LONGEST:
        raise Wrong("a message longer than any screen")
    if "\x1b" in text:
        raise Wrong("a message with an escape code")


def finished(run: bc.results.Trajectory) -> None:
    """Of a run that came to its end all numbers are finite, or a warning names what is not."""
    run.table()
    if not len(run.time) or not np.isfinite(run.time).all():
        raise Wrong("a run without finite times")
    if run.status is Status.NON_FINITE or not run.success:
        return
    told = " ".join(run.warnings)
    parts = {
        "position": run.position,
        "velocity": run.velocity,
        "acceleration": run.acceleration,
        "energy": run.total_energy,
        "torque": run.torque,
    }
    for name, values in parts.items():
        if not np.isfinite(values).all() and name not in told:
            raise Wrong(f"{name} is not finite and nothing says so")
    for name, values in run.outputs.items():
        if np.isnan(values).any() and name not in told:
            raise Wrong("an output is nan and no warning names it")
    for event in run.events:
        if not (math.isfinite(event.time) and np.isfinite(event.position).all()):
            raise Wrong("an event at no time")


def whole(folder: Path) -> None:
    """Files can be opened again."""
    for path in folder.rglob("*.*"):
        data = path.read_bytes()
        if path.suffix == ".npz":
            bc.load_run(path)
        elif path.suffix == ".json":
            json.loads(data)
        elif path.suffix == ".html" and not data.rstrip().endswith(b"</html>"):
            raise Wrong("half a page")
        elif path.suffix == ".png" and not data.startswith(b"\x89PNG"):
            raise Wrong("half a picture")
        elif path.suffix == ".csv" and not data.endswith(b"\n"):
            raise Wrong("half a table")


def robot(path: str, options: dict[str, Any]) -> None:
    it = bc.load_robot(path, **options)
    rng = np.random.default_rng(1)
    v, a = rng.uniform(-1.0, 1.0, (2, it.nv))
    q = it.neutral
    torque = it.inverse_dynamics(q, v, a)
    found = it.forward_dynamics(q, v, torque)
    if not (np.isfinite(torque).all() and np.isfinite(found).all()):
        raise Wrong("dynamics that are not finite")
    bc.check_urdf(path)


def scene(path: str) -> None:
    it = bc.load_scene(path)
    if it.settings.duration / (it.settings.step or math.inf) > 1e6 or it.settings.samples > 10**6:
        return  # an honest wish for long work
    finished(bc.simulate(it, max_evaluations=min(20_000, it.settings.max_evaluations)))


def motion(path: str) -> None:
    arm = bc.load_robot("planar_2r")
    it = bc.read_motion(arm, path)
    sized(bc.size(arm, it))
    again = bc.read_motion(arm, bc.write_motion(it, "again.csv"))
    if not np.array_equal(again.position, it.position):
        raise Wrong("a motion that is written and read is another one")


def sized(sizing: bc.results.Sizing) -> None:
    repr(sizing)
    for joint in sizing.joints:
        for name, value in vars(joint).items():
            if isinstance(value, float) and math.isnan(value):
                raise Wrong(f"sizing with {name} nan")


def command(argv: list[str]) -> int:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = main(argv)
        except SystemExit as error:  # argparse
            status = error.code if isinstance(error.code, int) else 2
            if status not in (0, 2):
                raise Wrong(f"exit code {status}") from None
            return status
    said = err.getvalue()
    if status == 70:
        raise Wrong("exit code 70: " + _last(said))
    if status not in (0, 1, 2):
        raise Wrong(f"exit code {status}")
    if status == 2:
        if not said.startswith("bellcrank: "):
            raise Wrong("exit code 2 without a sentence")
        sentence(said.removesuffix("\n"))
    elif "Warning:" in said or "Traceback" in said:
        raise Wrong("noise of Python on the terminal")
    if "\x1b" in out.getvalue():
        raise Wrong("an escape code in what is printed")
    whole(Path())
    return status


def _last(said: str) -> str:
    lines = [line.strip() for line in said.splitlines() if "Error" in line or ("bellcrank" in line and "line" in line)]
    return " ".join(Path(part).name if "/" in part else part for line in lines[-3:-1] for part in line.split())[:160]


@functools.cache
def _run_file() -> bytes:
    path = Path("whole.npz")
    data = bc.simulate("planar_2r_swing", duration=0.1, samples=5).save(path).read_bytes()
    path.unlink()
    return data


def saved_run(seed: int) -> None:
    Path("run.npz").write_bytes(fuzz_inputs.damaged_run(_run_file(), seed))
    run = bc.load_run("run.npz")
    finished(run)
    run.to_csv("again.csv")
    bc.load_run(run.save("again.npz"))


def page(path: str) -> None:
    arm = bc.load_robot(path)
    still = bc.waypoints(arm, [0.0, 1.0], np.zeros((2, arm.nq)))
    bc.replay(still, "page.html", robot=arm)
    whole(Path())


def override(path: str, changes: dict[str, Any]) -> None:
    finished(bc.simulate(bc.load_scene(path).with_overrides(changes), max_evaluations=5000))


def sweep(path: str, axes: Any, more: dict[str, Any]) -> None:
    swept(bc.sweep(path, axes, threads=1, **{key: value for key, value in more.items() if key in SAMPLING}))


SAMPLING = ("sample", "method", "seed")


def swept(found: bc.results.Sweep) -> None:
    repr(found)
    for design in found.designs:
        if not design.reason and any(math.isnan(value) for value in design.measures.values()):
            raise Wrong("a design with a measure that is nan and no reason")


def catalogue(folder: str) -> None:
    found = bc.load_catalogue(folder, shipped=False)
    bc.write_catalogue(found.motors, found.gears, "again")
    again = bc.load_catalogue("again", shipped=False)
    if [each.id for each in again.motors + again.gears] != [each.id for each in found.motors + found.gears]:
        raise Wrong("a catalogue that is written and read is another one")
    if command(["catalogue", "check", folder]) == 2:
        raise Wrong("a catalogue that is read and cannot be checked")


def select(path: str, objective: str, judged: bool) -> None:
    if judged:
        verdict(bc.judge(path))
        return
    found = bc.select(path, objective=objective, candidates=2, effort=200)
    repr(found)
    found.to_json("selection.json")
    found.write_config("chosen.yaml")
    whole(Path())


def verdict(found: bc.results.DriveVerdicts) -> None:
    """A use that is not known is none: never nan."""
    if "NaN" in found.to_json("judged.json").read_text():
        raise Wrong("a verdict with nan")


def moves(path: str) -> None:
    config, arm = bc.load_scene(path).config, bc.load_robot("planar_2r")
    for name in config.motions:
        it = config.motion(arm, name)
        if not all(np.isfinite(part).all() for part in (it.time, it.position, it.velocity, it.acceleration)):
            raise Wrong("a motion that is not finite")
        if not (np.diff(it.time) > 0.0).all():
            raise Wrong("times of a motion that do not rise")


@functools.cache
def _study_folder() -> dict[str, bytes]:
    """The folder of a study that was interrupted."""

    def interrupt(done: int, _of: int) -> None:
        if done:
            raise KeyboardInterrupt

    folder = Path("made")
    with contextlib.suppress(KeyboardInterrupt):
        bc.sweep("pendulum", AXES, threads=1, folder=folder, overrides=STUDY, progress=interrupt)
    files = {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    shutil.rmtree(folder)
    return files


AXES = {"initial.swing": "0.1:1:5"}
STUDY = {"simulate.duration": 0.1, "simulate.samples": 3}


@functools.cache
def _whole_study() -> list[dict[str, float]]:
    return [design.measures for design in bc.sweep("pendulum", AXES, threads=1, overrides=STUDY).designs]


def study(seed: int) -> None:
    """A damaged study is refused, or its designs are those of a whole one."""
    for name, data in fuzz_formats.damaged_folder(_study_folder(), seed).items():
        path = Path("study", name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    found = bc.sweep("pendulum", AXES, threads=1, folder="study", overrides=STUDY)
    swept(found)
    if [design.measures for design in found.designs] != _whole_study():
        raise Wrong("a resumed study with other results")


def casadi(path: str) -> None:
    """The function says at the start what the compiled equations say."""
    it = bc.load_scene(path)
    function = bc.scene_casadi(it)
    run = bc.simulate(it, duration=1e-6, samples=2, max_evaluations=5000)
    q, v, known = run.position[0], run.velocity[0], run.acceleration[0]
    found = np.asarray(function(0.0, q, v, it.signals_at([0.0])[0], it.own_parameters)[1]).ravel()
    if not (np.abs(known) < 1e9).all():  # not finite, or rounding alone
        return finished(run)
    close = np.abs(found - known) <= 1e-6 * (1.0 + np.abs(known).max(initial=0.0))  # loops: proximal, of Baumgarte
    if not close.all():
        raise Wrong("casadi's accelerations are not those of the compiled equations")


def call(seed: int) -> None:
    fuzz_calls.call(seed)


def argument(which: int, first: Any, second: Any) -> None:
    calls = list(_calls(first, second))
    try:
        found = calls[which % len(calls)]()
    except bc.BellcrankError:
        raise
    if isinstance(found, np.ndarray) and not np.isfinite(found).all():
        raise Wrong("numbers that are not finite from a function that refused nothing")


def _calls(x: Any, y: Any) -> Iterator[Callable[[], Any]]:
    arm = bc.load_robot("planar_2r")
    swing = bc.waypoints(arm, [0.0, 1.0], [[0.0, 0.0], [1.0, -1.0]])
    run = bc.simulate("planar_2r_swing", duration=0.05, samples=5)
    at_rest = {"q": [0.0, 0.0], "v": [0.0, 0.0], "a": [0.0, 0.0]}
    short = {"duration": 0.01, "samples": 3, "max_evaluations": 2000}
    for key in at_rest:
        yield functools.partial(arm.inverse_dynamics, **(at_rest | {key: x}))
    yield functools.partial(arm.forward_dynamics, [0.0, 0.0], x, [0.0, 0.0])
    for method in (arm.mass_matrix, arm.gravity_torque, arm.posture):
        yield functools.partial(method, x)
    yield functools.partial(arm.frame_pose, x, [0.0, 0.0])
    yield functools.partial(arm.energy, x, [0.0, 0.0])
    for key in ("gravity", "floating_base", "friction", "payloads", "rotor_inertia", "frames", "friction_width"):
        yield functools.partial(bc.load_robot, "planar_2r", **{key: x})
    yield functools.partial(bc.load_robot, x)
    yield functools.partial(bc.waypoints, arm, x, [[0.0, 0.0], [1.0, 1.0]])
    yield functools.partial(bc.waypoints, arm, [0.0, 1.0], x)
    yield functools.partial(bc.dwell, arm, x, y)
    circle = {
        "frame": "tip",
        "center": (1.2, 1.2, 0.0),
        "radius": 0.2,
        "duration": 1.0,
        "start": {"elbow": -1.0},
        "samples": 11,
    }
    for key in circle:
        yield functools.partial(bc.circle, arm, **(circle | {key: x}))
    line = {
        "frame": "tip",
        "end": (1.3, 0.9, 0.0),
        "start": {"shoulder": 1.2, "elbow": -1.0},
        "duration": 1.0,
        "samples": 11,
    }
    for key in line:
        yield functools.partial(bc.line, arm, **(line | {key: x}))
    yield functools.partial(bc.join, x, swing)
    for key in (
        *short,
        "solver",
        "rtol",
        "atol",
        "step",
        "times",
        "overrides",
        "first_step",
        "max_step",
        "stabilisation",
        "progress",
    ):
        yield functools.partial(bc.simulate, "planar_2r_swing", **(short | {key: x}))
    yield functools.partial(bc.simulate, x)
    yield functools.partial(bc.size, arm, x)
    yield functools.partial(bc.size, x, swing)
    yield functools.partial(bc.sweep, "pendulum", x)
    yield functools.partial(bc.sweep, "pendulum", {"simulate.rtol": [1e-6]}, threads=x)
    yield functools.partial(bc.Payload, x, y)
    yield functools.partial(bc.Motion, arm.joints, x, [[0.0, 0.0]], [[0.0, 0.0]], [[0.0, 0.0]])
    yield functools.partial(bc.load_run, x)
    yield functools.partial(bc.load_scene, x)
    yield functools.partial(bc.load, x)
    yield functools.partial(bc.read_motion, arm, x)
    yield functools.partial(bc.check_urdf, x)
    for method in (run.joint, run.frame, run.output, run.constraint):
        yield functools.partial(method, x)


FAULTS: dict[str, Callable[[], object]] = {
    "traceback": lambda: {}["missing"],
    "hang": lambda: time.sleep(60.0),
    "crash": lambda: os.kill(os.getpid(), signal.SIGSEGV),
    "memory": lambda: bytearray(2**40),
    "hidden": Path(".half.npz").touch,
    "noise": lambda: warnings.warn("overflow", RuntimeWarning, stacklevel=1),
}


def fault(name: str, number: int) -> None:
    """A fault in case 1, by which the net itself is tested."""
    if number == 1:
        FAULTS[name]()


ACTIONS: dict[str, Callable[..., int | None]] = {
    "robot": robot, "scene": scene, "motion": motion, "command": command, "saved run": saved_run, "page": page,
    "override": override, "sweep": sweep, "argument": argument,
    "catalogue": catalogue, "select": select, "moves": moves, "study": study, "casadi": casadi, "call": call,
    "fault": fault,
}  # fmt: skip
