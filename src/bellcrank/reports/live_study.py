"""The page of a study that computes its designs: the film of the scene itself, and which setting each axis is."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bellcrank.config.fields import parse_number
from bellcrank.errors import InputError
from bellcrank.replays.film.film import Film
from bellcrank.replays.film.run_film import film_of_run
from bellcrank.replays.film.sizing_film import film_of_sizing
from bellcrank.robot.model.traced_tree import ORIGIN
from bellcrank.simulation.simulate import simulate
from bellcrank.sizing.size import size
from bellcrank.studies.designs.sizing_changes import changes_of, present_duration

if TYPE_CHECKING:
    from bellcrank.reports.study_data import View
    from bellcrank.studies.designs.axes import StudyAxis
    from bellcrank.studies.results.sweep_result import Sweep

_PARAMETER = re.compile(r"\A(?:parameters\.)?(.+?)(?:\.value)?\Z")
_PAYLOAD = re.compile(r"\Apayloads?\.(?:(\d+)\.)?(mass|cg)(?:\.(\w+))?\Z")
_DURATION = re.compile(r"\A(motions\..+)\.duration\Z")


@dataclass(frozen=True, eq=False, kw_only=True)
class LiveStudy:
    """What the page of a study computes.

    Attributes:
        film: The film of the scene itself, which computes.
        settings: Of each axis the number of its setting, the factor from values of the axis to it, and whether the
            setting is the factor over the value, as the speed of a motion is over its duration.
    """

    film: Film
    settings: tuple[dict[str, Any], ...]


def live_study(sweep: Sweep, *, title: str, view: View) -> LiveStudy:
    """The film of a study's scene that computes its designs.

    Raises InputError where the page cannot compute the scene, or an axis is none of its settings.
    """
    options: dict[str, Any] = {"trace": view.trace, "detail": view.detail, "title": title, "live": True}
    if sweep.sized:
        film = film_of_sizing(size(sweep.scene), **options)
    else:
        film = film_of_run(simulate(sweep.scene), **options)
    if film.live is None:
        raise InputError(f"sweep of {sweep.scene.name}: {film.notes[-1]}")
    found = [_setting(sweep, axis, film.live.content["settings"]) for axis in sweep.axes]
    for axis, one in zip(sweep.axes, found, strict=True):
        if one is None:
            raise InputError(
                f"sweep of {sweep.scene.name}: its page cannot compute designs, because '{axis.path}' is none of the "
                "values that a page can change; leave live out, and the page keeps the motions of some designs"
            )
    return LiveStudy(film=film, settings=tuple(one for one in found if one is not None))


def _setting(sweep: Sweep, axis: StudyAxis, settings: list[dict[str, Any]]) -> dict[str, Any] | None:
    """The setting of an axis; None where there is none."""
    if not axis.numeric:
        return None
    path, entry, inverse = _PARAMETER.sub(r"\1", axis.path), "", False
    if (match := _PAYLOAD.match(axis.path)) is not None:
        number, what, component = match.groups()
        path = f"payloads.{number or 1}.{what}"
        entry = str(ORIGIN.index(component) + 1) if component in ORIGIN[:3] else component or ""
    elif (match := _DURATION.match(axis.path)) is not None:
        if changes_of(sweep.scene, [axis])[1][0].kind != "duration":
            return None  # it changes motions that are joined from it too
        path, inverse = f"{match[1]}.speed_factor", True
    for k, one in enumerate(settings):
        if (one.get("path"), one.get("entry", "")) == (path, entry) and not one.get("options"):
            try:
                factor = parse_number(axis.value(1.0), "s" if inverse else one["unit"])
            except ValueError:
                return None
            if inverse:
                duration = present_duration(sweep.scene, axis.path)
                if duration is None:  # a key of the motion's own
                    duration = sweep.scene.config.motion(sweep.scene.robot, axis.path.split(".", 1)[1][:-9]).duration
                factor = one["value"] * duration / factor
            return {"setting": k, "factor": factor, "inverse": inverse}
    return None
