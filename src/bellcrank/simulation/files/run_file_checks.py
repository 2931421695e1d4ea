"""Checks of a saved run's content when it is read.

Checked are the type and range of each entry, the shape and numbers of each array, and that these agree with each other
and with the scene in the file.

Whether the numbers are a motion of the scene is not checked here: that is what `Trajectory.warnings` is for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from bellcrank.arrays import Array
from bellcrank.dynamics.constraints.constraint_derivatives import aligned_constraints
from bellcrank.dynamics.inverse.input_breakpoints import prescribed_motion_end
from bellcrank.files.npz_archive import brief
from bellcrank.notes import MATTERS, OMISSIONS, Note
from bellcrank.robot.model.joints import unit_vectors
from bellcrank.scene.settings import ERROR_BOUND, STABILISATIONS, Settings, Stabilisation
from bellcrank.simulation.integration.statistics import Statistics, Status, Unresolved

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene


# ---- Checks of JSON values: functions that accept a value, or say which entry has what in place of what.

Check = Callable[[Any, str], Any]  # takes a value and its name; returns the value, or raises ValueError
LARGEST_COUNT = 2**62
LONGEST_PATH = 4096  # characters


def text(value: Any, name: str) -> str:
    """A text that can be written as UTF-8."""
    if not isinstance(value, str):
        _refuse(name, "a text", value)
    if any("\ud800" <= c <= "\udfff" for c in value):
        _refuse(name, "a text in UTF-8", value)
    return value


def path(value: Any, name: str) -> str:
    """A text that can be a path."""
    found = text(value, name)
    return found if "\0" not in found and len(found) <= LONGEST_PATH else _refuse(name, "a path", value)


def flag(value: Any, name: str) -> bool:
    """true or false."""
    return value if isinstance(value, bool) else _refuse(name, "true or false", value)


def count(value: Any, name: str) -> int:
    """A whole number, 0 or more."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= LARGEST_COUNT:
        _refuse(name, "a whole number of 0 or more", value)
    return value


def amount(value: Any, name: str) -> float:
    """A finite number, 0 or more."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        _refuse(name, "a number", value)
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    return number if 0.0 <= number < math.inf else _refuse(name, "a finite number of 0 or more", value)


def positive(value: Any, name: str) -> float:
    """A finite number of more than 0."""
    return amount(value, name) or _refuse(name, "more than 0", value)


def one_of(known: Collection[str]) -> Check:
    """One of these texts."""
    return lambda value, name: value if value in list(known) else _refuse(name, f"one of {', '.join(known)}", value)


def maybe(check: Check) -> Check:
    """null, or what the check accepts."""
    return lambda value, name: None if value is None else check(value, name)


def each(check: Check) -> Check:
    """A list of what the check accepts."""

    def checked(value: Any, name: str) -> list[Any]:
        if not isinstance(value, list):
            _refuse(name, "a list", value)
        return [check(entry, f"{name}[{k}]") for k, entry in enumerate(value)]

    return checked


def named(check: Check) -> Check:
    """A mapping of any names to what the check accepts."""

    def checked(value: Any, name: str) -> dict[str, Any]:
        if not isinstance(value, dict):
            _refuse(name, "a mapping", value)
        return {text(key, name): check(entry, f"{name}.{brief(key, '')}") for key, entry in value.items()}

    return checked


def keys(known: Mapping[str, Check]) -> Check:
    """A mapping of exactly these keys to what their checks accept."""

    def checked(value: Any, name: str) -> dict[str, Any]:
        if not isinstance(value, dict):
            _refuse(name or "its text", "a mapping", value)
        found = {}
        for key, entry in value.items():
            path = f"{name}.{brief(key, '')}" if name else brief(key, "")
            if key not in known:
                raise ValueError(f"'{path}' is not known; expected {', '.join(known)}")
            found[key] = known[key](entry, path)
        for key in known:
            if key not in found:
                raise ValueError(f"the key '{f'{name}.{key}' if name else key}' is missing")
        return found

    return checked


def anything(value: Any, name: str) -> Any:
    """Information for people, which is not read."""
    return value


def _refuse(name: str, expected: str, value: object) -> NoReturn:
    raise ValueError(f"'{name}': expected {expected}, found {brief(value)}")


UNIT = 1e-6  # by which the length of a unit vector in the state may differ from 1; the solver keeps it to rounding
SAME = 1e-9  # relative difference of a number that the file holds twice


_STABILISATION = keys({"kind": one_of(STABILISATIONS), "alpha": amount, "beta": amount, "auto": flag})
_SETTINGS = keys(
    {
        "duration": positive, "solver": text, "rtol": positive, "atol": positive, "step": maybe(positive),
        "first_step": maybe(positive), "max_step": maybe(positive), "samples": count, "max_evaluations": count,
        "error_bound": positive,
        "stabilisation": lambda value, name: Stabilisation(**_STABILISATION(value, name)),
    }
)  # fmt: skip
_UNRESOLVED = keys({"event": text, "steps": count, "first": amount, "undefined": flag})
_STATISTICS = keys(
    {
        "steps": count, "rejected": count, "evaluations": count, "jacobians": count, "factorisations": count,
        "kernel_time": amount,
        "stiff_steps": count, "stiff_since": maybe(amount), "implicit_steps": count, "implicit_evaluations": count,
        "switches": count, "switch_times": each(amount),
        "unresolved": each(lambda value, name: Unresolved(**_UNRESOLVED(value, name))),
        "longest_step": maybe(amount), "omitted_events": named(count),
    }
)  # fmt: skip
_NOTE = keys(
    {"text": text, "matter": one_of(MATTERS), "omits": one_of(OMISSIONS), "joints": each(text), "where": text,
     "time": maybe(amount)}
)  # fmt: skip
_ABOUT = keys(
    {
        "format": text, "version": count, "scene": text, "urdf": path, "files": named(text),
        "status": lambda value, name: Status(one_of(tuple(Status))(value, name)),
        "settings": lambda value, name: Settings(**_SETTINGS(value, name)),
        "statistics": _STATISTICS, "error_estimate": maybe(amount), "known_until": maybe(amount),
        "notes": maybe(each(lambda value, name: Note(**_NOTE(value, name)))),
        "events": each(keys({"name": text, "stopped": flag})),
        "signals": each(keys({"derivatives": count, "kinked": flag})),
        "versions": anything, "machine": anything,
    }
)  # fmt: skip


def checked_about(about: dict[str, Any]) -> dict[str, Any]:
    """The entries of a run's JSON text, with `status`, `settings` and `statistics` as objects.

    Raises ValueError, or InputError where a setting is out of its range.
    """
    about = {"known_until": None, "notes": None} | about  # files of 0.5 do not have them, nor the bound
    if isinstance(about.get("settings"), dict):
        about["settings"] = {"error_bound": ERROR_BOUND} | about["settings"]
    found: dict[str, Any] = _ABOUT(about, "")
    statistics = found["statistics"]
    lists = {name: tuple(statistics[name]) for name in ("unresolved", "switch_times")}
    found["statistics"] = Statistics(**statistics | lists)
    return found


# ---- the arrays


def check_arrays(about: Mapping[str, Any], arrays: Mapping[str, Array], scene: Scene, widths: Collection[int]) -> None:
    """Refuse arrays that do not fit each other, the checked text or the scene (ValueError).

    The state must have one of the `widths`.
    """
    robot, events = scene.robot, len(about["events"])
    sources, signals = scene.signal_sources, len(about["signals"])
    needed = ["time", "state", "parameters", "steps", *(f"event_{n}" for n in ("time", "position", "velocity"))]
    size = sum(states.size for states in scene.auxiliary_states)
    needed += ["event_auxiliary"] if size else []
    needed += [f"signal_{k}_{part}" for k in range(signals) for part in ("breaks", "coefficients")]
    for name in needed:
        if name not in arrays:
            raise ValueError(f"there is no '{name}'")
    for name in arrays:
        if name not in needed and name not in ("multipliers", "latch_velocity"):
            raise ValueError(f"'{name}' belongs to no signal of the run")
    rows, width = len(np.atleast_1d(arrays["time"])), arrays["state"].shape[-1] if arrays["state"].ndim else 0
    shapes = {
        "time": (rows,),
        "state": (rows, width if width in widths else max(widths)),
        "parameters": scene.own_parameters.shape,
        "event_time": (events,),
        "event_position": (events, robot.nq),
        "event_velocity": (events, robot.nv),
    }
    if size:
        shapes["event_auxiliary"] = (events, size)
    for name, shape in shapes.items():
        if arrays[name].shape != shape or rows == 0:
            raise ValueError(f"'{name}' has the shape {arrays[name].shape}, expected {shape if rows else 'rows'}")
    if arrays["steps"].ndim != 1:
        raise ValueError("'steps' is not a list of times")
    if "multipliers" in arrays and (arrays["multipliers"].ndim != 2 or len(arrays["multipliers"]) != rows):
        raise ValueError(f"'multipliers' has the shape {arrays['multipliers'].shape}, expected {rows} rows")
    if "latch_velocity" in arrays:
        latches = [rule.name for rule in scene.events if rule.latch]
        if not (events and about["events"][-1]["name"] in latches):
            raise ValueError("'latch_velocity' belongs to no latch of the run")
        if arrays["latch_velocity"].shape != (robot.nv,) or not np.isfinite(arrays["latch_velocity"]).all():
            raise ValueError("'latch_velocity' is not a velocity of the robot")
    if signals != len(sources):
        raise ValueError(f"it has {signals} signals, the scene has {len(sources)}")
    for k, (source, facts) in enumerate(zip(sources, about["signals"], strict=True)):
        if facts["derivatives"] != source.derivatives:
            raise ValueError(f"signal {k} has {facts['derivatives']} derivatives, the scene's has {source.derivatives}")
        _check_signal(f"signal_{k}", arrays[f"signal_{k}_breaks"], arrays[f"signal_{k}_coefficients"], source.width)
    _check_numbers(about, arrays)
    _check_rotations(arrays, scene)
    _check_agreement(about, arrays, scene)


def _check_signal(name: str, breaks: Array, coefficients: Array, width: int) -> None:
    pieces = max(len(breaks) - 1, 0) if breaks.ndim == 1 else 0
    if not pieces or coefficients.ndim != 3 or not coefficients.shape[1] or coefficients.shape[::2] != (pieces, width):
        raise ValueError(f"'{name}' has the shapes {breaks.shape} and {coefficients.shape}, which are no signal's")
    if not np.isfinite(breaks).all() or np.any(np.diff(breaks) <= 0.0):
        raise ValueError(f"'{name}_breaks' do not increase")
    if not np.isfinite(coefficients).all():
        raise ValueError(f"'{name}_coefficients' are not finite")


def _check_numbers(about: Mapping[str, Any], arrays: Mapping[str, Array]) -> None:
    """Times are finite, do not decrease and lie in the run; states are finite, but for the end of a failed run."""
    latest = about["settings"].duration * (1.0 + SAME)
    for name in ("time", "steps", "event_time"):
        values = arrays[name]
        if not np.isfinite(values).all() or np.any(np.diff(values) < 0.0):
            raise ValueError(f"'{name}' is not finite, or decreases")
        if len(values) and not 0.0 <= values[0] <= values[-1] <= latest:
            raise ValueError(
                f"'{name}' covers {values[0]:.6g} to {values[-1]:.6g} s, but the run ends at {latest:.6g} s"
            )
    whole = arrays["state"] if about["status"].success else arrays["state"][:-1]
    bad = np.flatnonzero(~np.isfinite(whole).all(axis=1))
    if len(bad):
        raise ValueError(f"'state' is not finite at {arrays['time'][bad[0]]:.6g} s")
    for name in ("parameters", "event_position", "event_velocity", "event_auxiliary"):
        if name in arrays and not np.isfinite(arrays[name]).all():
            raise ValueError(f"'{name}' is not finite")


def _check_rotations(arrays: Mapping[str, Array], scene: Scene) -> None:
    """Unit quaternions, and unit cosines and sines of planar joints, in all finite states and events."""
    for name in ("state", "event_position"):
        rows = arrays[name][np.isfinite(arrays[name]).all(axis=1)]
        for place in unit_vectors(scene.robot.joints):
            with np.errstate(over="ignore"):  # a length that overflows is not 1
                off = np.abs(np.sqrt(np.square(rows[:, place]).sum(axis=1)) - 1.0)
            if not (off <= UNIT).all():
                raise ValueError(f"'{name}' has a rotation whose length is not 1")


def _check_agreement(about: Mapping[str, Any], arrays: Mapping[str, Array], scene: Scene) -> None:
    """Status, events and parameters must agree with each other and with the scene."""
    status, events = about["status"], about["events"]
    rules = {rule.name: rule for rule in scene.events}
    for event in events:
        if event["name"] not in rules:
            raise ValueError(f"the scene has no event {brief(event['name'])}")
        if event["stopped"] != rules[event["name"]].stop:
            raise ValueError(
                f"the event {brief(event['name'])} ends the run in the scene, or in the file, but not in both"
            )
    stopped = [event["stopped"] for event in events]
    if ((status is Status.EVENT) != (stopped[-1:] == [True]) and status is not Status.TURNED_OVER) or any(stopped[:-1]):
        raise ValueError(f"the status is '{status}', which its events contradict")
    statistics = about["statistics"]
    for name in (*(entry.event for entry in statistics.unresolved), *statistics.omitted_events):
        if name not in rules:
            raise ValueError(f"the scene has no event {brief(name)}")
    if status is Status.CONTACT and not any(getattr(part, "ends_run", False) for part in scene.parts_with_modes):
        raise ValueError(f"the status is '{status}', and the scene has no stop or brake with stop: true")
    if status is Status.TURNED_OVER and not aligned_constraints(scene):
        raise ValueError(f"the status is '{status}', and the scene has no weld or hinge")
    if status is Status.PRESCRIBED_MOTION_ENDED and prescribed_motion_end(scene) is None:
        raise ValueError(f"the status is '{status}', and the scene has no prescribed motion that ends")
    steps, duration = arrays["steps"], about["settings"].duration
    if status is Status.FINISHED and not (len(steps) and steps[-1] >= duration * (1.0 - SAME)):
        raise ValueError(f"the status is '{status}', and its steps do not reach the duration of {duration:.6g} s")
    if not np.allclose(arrays["parameters"], scene.own_parameters, rtol=SAME, atol=0.0):
        raise ValueError("'parameters' are not those of the scene in it")
