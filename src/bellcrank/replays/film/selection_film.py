"""The film of a selection: its motions, and the chosen motors and gears as cylinders at their mounts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.actuators.catalogue.catalogue import load_catalogue
from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.motion.kinematics.rotations import from_matrices
from bellcrank.replays.film.charts import with_rms_points
from bellcrank.replays.film.film import BodyLayer, Film
from bellcrank.replays.film.live_film import live_film, name_of, settled
from bellcrank.replays.film.motion_film import MotionSequence, Progress, film_of_motions
from bellcrank.replays.geometry.meshes import Detail
from bellcrank.replays.geometry.shapes import Colour, DrawnBody, DrawnShape
from bellcrank.sizing.live.live_choice import selected_sizing

if TYPE_CHECKING:
    from bellcrank.actuators.actuator import Actuator
    from bellcrank.actuators.gear import Gear
    from bellcrank.actuators.motor import Motor
    from bellcrank.sizing.live.live_choice import Choices
    from bellcrank.sizing.result import Sizing
    from bellcrank.sizing.selection.axis_loads import DrivenAxis
    from bellcrank.sizing.selection.selection import Candidate, Selection

MOTOR_COLOUR: Colour = (0.0, 0.45, 0.70, 1.0)
GEAR_COLOUR: Colour = (0.90, 0.62, 0.0, 1.0)
LINK_OPACITY = 0.3  # motors and gears are inside the links
STRIPES = 4  # rings of a cylinder of unknown size
UNKNOWN_SIZE = 0.05  # m, diameter and length that stand for unknown ones where no chosen product states its own
LEGEND = (
    "Cylinders are the chosen motors (blue) and gears (orange) in their catalogue size, centred at their mounts: the "
    "joint and its axis, unless the robot configuration says otherwise. Striped cylinders have a diameter or length "
    "that the catalogue does not state."
)


def film_of_selection(
    selection: Selection,
    *,
    trace: Iterable[str] = (),
    detail: Detail = "reduced",
    title: str | None = None,
    progress: Progress = None,
    live: bool | None = False,
) -> Film:
    """The film of a selection: its motions in sequence, and the chosen motors and gears.

    A page that computes has the torques of the chosen motors and gears, whose masses their sizing includes, and its
    reader chooses others; `live` is as in `film_of_sizing`. Another film has no charts and no torques.

    Raises InputError for an unknown frame, and for a selection without its motions.
    """
    if selection.inputs is None:
        raise InputError(f"selection of {selection.robot}: it does not hold its motions; make it with bellcrank.select")
    sized = "" if live is False else selected_sizing(selection)
    why: tuple[str, ...] = ()
    if not isinstance(sized, str):
        sizing, choices = sized
        film, starts = _film(selection, trace, detail, title, progress, sizing)
        command = _command(selection, choices)
        computed, why = settled("selection", live, lambda: live_film(sizing, starts, film, choices, command))
        if computed is not None:
            return replace(film, xy_plots=with_rms_points(film.xy_plots, sizing.joints), live=computed)
    elif sized:
        why = (f"this page replays the selection and does not compute its motors and gears again: {sized}",)
    film, _ = _film(selection, trace, detail, title, progress)
    return replace(film, charts=(), xy_plots=(), notes=(*film.notes, *why))


def _film(
    selection: Selection,
    trace: Iterable[str],
    detail: Detail,
    title: str | None,
    progress: Progress,
    sizing: Sizing | None = None,
) -> tuple[Film, list[float]]:
    """The film without arrows, with the torques of a sizing where it is given; and the times at which motions begin."""
    assert selection.inputs is not None
    mechanism, motions = selection.inputs.mechanism, selection.inputs.motions
    actuators: Mapping[str, Actuator] = {}
    if sizing is not None and sizing.inputs is not None:
        mechanism, motions, actuators = sizing.inputs.mechanism, tuple(sizing.inputs.motions), sizing.inputs.actuators
    chosen = [(each, each.chosen) for each in selection.axes if each.chosen is not None]
    usual = usual_size([candidate for _, candidate in chosen])
    bodies = tuple(
        DrawnBody(axis.axis.mount, tuple(_shapes(candidate, axis.axis, usual))) for axis, candidate in chosen
    )
    sequence = MotionSequence(mechanism=mechanism, motions=motions, actuators=actuators, more_bodies=bodies)
    film = film_of_motions(sequence, title or f"{selection.robot}: selection", trace, detail, progress)
    links = len(film.bodies) - len(bodies)
    layers = [BodyLayer("Robot", "links", tuple(range(links)))]
    layers += [
        BodyLayer("Motors and gears", f"{axis.axis.name}: {product_names(candidate)}", (links + k,))
        for k, (axis, candidate) in enumerate(chosen)
    ]
    made = replace(
        film,
        bodies=(*map(_seen_through, film.bodies[:links]), *film.bodies[links:]),
        layers=tuple(layers),
        arrows=(),
        success=selection.inside,
        notes=(LEGEND, *film.notes),
    )
    return made, sequence.starts


def _command(selection: Selection, choices: Choices) -> dict[str, Any] | None:
    """How the selection is made on the command line, less the pairs that are kept; None where it is not."""
    assert selection.inputs is not None
    config = selection.inputs.config
    if config is None or selection.conditions != config.conditions or not selection.feedback:
        return None
    own = () if config.catalogue is None else (config.catalogue,)
    known = {one.id for one in load_catalogue(*own).products}
    ids = {part for pairs in choices.pairs.values() for pair in pairs for part in pair.name.split("+")}
    extra = selection.inputs.mechanism.robot.payloads[len(config.payloads) :]
    if not ids <= known or extra or selection.inputs.duty:
        return None
    words = ["bellcrank", "select", name_of(config)]
    names = [motion.name for motion in selection.inputs.motions]
    if names != list(config.motions):
        words += [word for name in names for word in ("--motion", name)]
    return {"words": words, "overrides": [[path, value] for path, value in config.overrides.items()]}


def product_names(candidate: Candidate) -> str:
    """The motor and gear of a pair, such as "EC 45 flat + CSG-17-100"."""
    motor, gear = candidate.motor, candidate.gear
    return motor.model if gear.kind == "direct" else f"{motor.model} + {gear.model}"


@dataclass(frozen=True)
class CylinderSize:
    """Diameter and length (m) of a product's body; `known` says whether the catalogue states both."""

    diameter: float
    length: float
    known: bool


def usual_size(candidates: Iterable[Candidate]) -> float:
    """The median of all stated diameters and lengths (m), which stands for those that are not stated."""
    products = [product for each in candidates for product in (each.motor, each.gear)]
    sizes = [size for product in products for size in (product.diameter, product.length) if size is not None]
    return float(np.median(sizes)) if sizes else UNKNOWN_SIZE


def cylinder_size(product: Motor | Gear, usual: float) -> CylinderSize:
    """The size of a product's body; `usual` (m) for what is not stated where nothing is."""
    diameter, length = product.diameter, product.length
    stated = [size for size in (diameter, length) if size is not None]
    default = stated[0] if stated else usual
    return CylinderSize(
        default if diameter is None else diameter, default if length is None else length, len(stated) == 2
    )


def _shapes(candidate: Candidate, axis: DrivenAxis, usual: float) -> Iterator[DrawnShape]:
    """The cylinders of a motor and its gear, one behind the other, centred at the mount."""
    products: list[tuple[Motor | Gear, Colour]] = [(candidate.motor, MOTOR_COLOUR)]
    if candidate.gear.kind != "direct":
        products.append((candidate.gear, GEAR_COLOUR))
    sizes = [cylinder_size(product, usual) for product, _ in products]
    begin = -0.5 * sum(size.length for size in sizes)
    for (_, colour), size in zip(products, sizes, strict=True):
        yield from _cylinder(size, begin, colour, axis)
        begin += size.length


def _cylinder(size: CylinderSize, begin: float, colour: Colour, axis: DrivenAxis) -> Iterator[DrawnShape]:
    """A cylinder that begins at a distance (m) from the mount along its axis; in rings if its size is not known."""
    point, direction = np.array(axis.mount_point), np.array(axis.mount_direction)
    parts = 1 if size.known else STRIPES
    height = size.length / (2 * parts - 1)
    for k in range(parts):
        centre = point + direction * (begin + (2 * k + 0.5) * height)
        yield DrawnShape(
            kind="cylinder",
            size=(0.5 * size.diameter, height),
            colour=colour,
            pose=(*centre.tolist(), *_along(direction)),
        )


def _along(direction: Array) -> tuple[float, ...]:
    """A unit quaternion x y z w that turns z to a unit direction."""
    aside = np.eye(3)[int(np.argmin(np.abs(direction)))]
    x = np.cross(aside, direction)
    x /= np.linalg.norm(x)
    matrix = np.stack([x, np.cross(direction, x), direction], axis=1)
    return tuple(float(value) for value in from_matrices(matrix))


def _seen_through(body: DrawnBody) -> DrawnBody:
    """A body whose shapes let the motors be seen."""
    return replace(
        body, shapes=tuple(replace(s, colour=(*s.colour[:3], min(s.colour[3], LINK_OPACITY))) for s in body.shapes)
    )
