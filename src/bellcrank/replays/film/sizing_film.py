"""The film of a sizing: its motions, the torques of its motors, their limits, and where limits are exceeded."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

from bellcrank.errors import InputError
from bellcrank.replays.film.charts import with_rms_points
from bellcrank.replays.film.film import Film, TimelineEvent
from bellcrank.replays.film.live_film import live_film, settled
from bellcrank.replays.film.motion_film import MotionSequence, Progress, film_of_motions
from bellcrank.replays.geometry.meshes import Detail
from bellcrank.sizing.drive_verdicts import kept
from bellcrank.sizing.tables import verdict

if TYPE_CHECKING:
    from bellcrank.sizing.joint_sizing import JointSizing, Peak
    from bellcrank.sizing.result import Sizing


def film_of_sizing(
    sizing: Sizing,
    *,
    trace: Iterable[str] = (),
    detail: Detail = "reduced",
    title: str | None = None,
    progress: Progress = None,
    live: bool | None = None,
) -> Film:
    """The film of a sizing: its motions in sequence, torques, torque-speed plots, and events at exceeded limits.

    With `live` the page computes the sizing again; None: where it can, and adds less than 400 kB by that. Raises
    InputError for an unknown frame, and for a sizing without its motions.
    """
    if sizing.inputs is None:
        raise InputError(f"sizing of {sizing.robot}: it does not hold its motions; make it with bellcrank.size")
    mechanism, motions, actuators = sizing.inputs
    sequence = MotionSequence(mechanism=mechanism, motions=motions, actuators=actuators)
    name = title or f"{sizing.robot}: sizing"
    facts = sizing_facts(sizing)
    facts += [("motions", ", ".join(sizing.motions)), *((joint.name, _requirements(joint)) for joint in sizing.joints)]
    if sizing.robot not in name:
        facts.append(("robot", sizing.robot))
    stated = {text for _, text in facts}
    film = film_of_motions(sequence, name, trace, detail, progress)
    computed, why = settled("sizing", live, lambda: live_film(sizing, sequence.starts, film))
    return replace(
        film,
        events=tuple(sorted([*film.events, *_limit_events(sizing, sequence)], key=lambda event: event.time)),
        xy_plots=with_rms_points(film.xy_plots, sizing.joints),
        facts=(*facts, *film.facts),
        success=sizing.inside,
        notes=(*film.notes, *(text for text in sizing.warnings if text not in stated), *why),
        live=computed,
    )


def sizing_facts(sizing: Sizing) -> list[tuple[str, str]]:
    """The verdict of a sizing with the number of objections; then each objection, error and warning."""
    objections = [
        *(("cannot be sized", text) for text in sizing.unsizable),
        *(("exceeded", text) for text in sizing.exceeded),
        *(("not known", text) for text in sizing.undetermined),
    ]
    if len(objections) > 1:
        counts = [
            (len(sizing.unsizable), "joint cannot be sized", "joints cannot be sized"),
            (len(sizing.exceeded), "limit exceeded", "limits exceeded"),
            (len(sizing.undetermined), "figure not known", "figures not known"),
        ]
        answer = ", ".join(f"{count} {one if count == 1 else many}" for count, one, many in counts if count)
        facts = [("verdict", f"{answer}; the first: {objections[0][1]}"), *objections[1:]]
    elif objections:
        facts = [("verdict", f"{objections[0][0]}: {objections[0][1]}")]
    else:
        facts = [("verdict", verdict(sizing).partition("\n")[0])]
    facts += [("error", text) for text in sizing.urdf_errors]
    warnings = () if sizing.inputs is None else sizing.inputs[0].robot.inertia_warnings
    return facts + [("warning", text) for text in warnings]


def _requirements(joint: JointSizing) -> str:
    text = f"peak {joint.peak_torque:.4g} {joint.torque_unit}, RMS {joint.rms_torque:.4g} {joint.torque_unit}"
    return text if joint.shaft is None else f"{text}; motor {joint.shaft.verdict}"


def _limit_events(sizing: Sizing, sequence: MotionSequence) -> list[TimelineEvent]:
    """An event at each peak that exceeds a limit."""
    shifts = {motion.name: shift for motion, shift in zip(sequence.motions, sequence.shifts, strict=True)}
    return [
        TimelineEvent(shifts[peak.motion] + peak.time, text)
        for joint in sizing.joints
        for peak, text in exceeded_peaks(joint)
    ]


def exceeded_peaks(joint: JointSizing) -> list[tuple[Peak, str]]:
    """The peaks at which limits are exceeded most, with a sentence each."""
    found = []
    needs = f"needs {joint.peak_torque:.4g} {joint.torque_unit}, beyond the URDF's limit"
    reaches = f"reaches {joint.peak_speed:.4g} {joint.speed_unit}, beyond the URDF's limit"
    for margin, peak, text in (
        (joint.effort_margin, "peak_torque", needs),
        (joint.velocity_margin, "peak_speed", reaches),
    ):
        if not kept(margin):
            found.append((joint.peaks[peak], f"{joint.name} {text}"))
    if joint.shaft is not None:
        peaks = {
            "peak torque": joint.shaft.peak_torque, "motor speed": joint.shaft.peak_speed,
            "peak curve": joint.shaft.curve_use, "voltage limit": joint.shaft.curve_use,
            "peak current": joint.shaft.curve_use,
        }  # fmt: skip
        for name, margin in joint.shaft.known_margins.items():
            if not kept(margin) and (where := peaks.get(name)) is not None:
                found.append((where, f"{joint.name} exceeds its motor's {name} by {-margin:.1%}"))
    return found
