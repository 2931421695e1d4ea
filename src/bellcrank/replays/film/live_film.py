"""What the page of a sizing needs to compute it again: functions, motions, settings, and the sizing's own figures."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.arrays import Array
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.elements.symbols import Symbols
from bellcrank.files import bundled_data
from bellcrank.motion.coordinates import velocity_labels
from bellcrank.motion.motion import Motion
from bellcrank.replays.film.charts import kept_rows, shaft_plot
from bellcrank.replays.film.live_shapes import ShownExpressions
from bellcrank.scene.robot_config import RobotConfig
from bellcrank.sizing.joint_sizing import JointSizing
from bellcrank.sizing.live.live_choice import Choices
from bellcrank.sizing.live.live_motion import MotionPieces, motion_pieces
from bellcrank.sizing.live.live_sizing import EFFORT, FIGURES, NONE, VELOCITY, LiveSizing, live_sizing, module_of
from bellcrank.sizing.result import Sizing
from bellcrank.sizing.tables import verdict

if TYPE_CHECKING:
    from bellcrank.replays.film.film import Film
    from bellcrank.robot.robot import Robot

Command = dict[str, Any] | None
MOST_BYTES = 400_000  # that computing adds to a page without being asked for
NOT_RECOMPUTED = (
    "holding torques", "bearing forces and tilting moments", "temperatures of motors", "powers and energies",
    "whether the rows of a motion determine its peaks", "notes and warnings",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class LiveFilm:
    """A sizing, or a run, that a page computes.

    Attributes:
        content: What is written as JSON.
        engine: The size, deflated, of the integrator that the page adds; 0 where it needs none.
        blocks: The modules, then the 64-bit numbers of all motions in planes of bytes: times and lengths of the
            quintics, states at their begin and end column after column, cuts into pieces, signs of speeds in them,
            states at rest.
    """

    content: dict[str, Any]
    blocks: tuple[bytes, ...]
    engine: int = 0


def settled(
    what: str, wanted: bool | None, make: Callable[[], LiveFilm | str]
) -> tuple[LiveFilm | None, tuple[str, ...]]:
    """What the page of a sizing or run computes, and notes where it could be expected to compute and does not.

    `wanted` None: where it adds less than MOST_BYTES.
    """
    if wanted is False:
        return None, ()
    found = make()
    if isinstance(found, str):
        return None, (f"this page replays the {what} and does not compute it again: {found}",)
    size = (len(zlib.compress(b"".join(found.blocks))) + found.engine) * 4 // 3
    if wanted is None and size > MOST_BYTES:
        return None, (f"this page replays the {what} and does not compute it again, which takes {size / 1e6:.1f} MB",)
    return found, ()


def live_film(
    sizing: Sizing, starts: Sequence[float], film: Film, choices: Choices = NONE, command: Command = None
) -> LiveFilm | str:
    """The sizing for a page that shows `film`, in which its motions begin at times `starts`, s; or a clause that says
    why not. With `choices` its reader chooses motors and gears; `command` then says how the selection is made.
    """
    live = live_sizing(sizing, choices)
    if isinstance(live, str):
        return live
    assert sizing.inputs is not None
    motions = sizing.inputs.motions
    pieces = [motion_pieces(motion, sizing.inputs.mechanism.robot) for motion in motions]
    numbers = [
        np.concatenate([each.ravel() for each in (*one[:2], _columns(one.states), one.cuts, one.sides, one.rests)])
        for one in pieces
    ]
    mechanism = sizing.inputs.mechanism
    free = not isinstance(mechanism, Linkage)  # each joint can be moved by itself
    shapes = _Shapes(sizing, live, film)
    sample, verdict_module, close = (
        b"" if f is None else module_of(f) for f in (live.sample, live.verdict, live.close)
    )
    modules = (sample, verdict_module, shapes.module if free or shapes.moving else b"", close)
    names = [joint.name for joint in sizing.joints]
    content = {
        "kind": "sizing",
        "settings": [finite(asdict(one)) for one in live.settings],
        "sizes": live.sizes,
        "modules": [len(module) for module in modules],
        "closed": live.closed,
        "closing": live.closing,
        "fixed": (*live.fixed, *(["cylinders in the view stay those of the selection"] if choices.pairs else [])),
        "moving": shapes.moving,
        "shapes": shapes.content,
        "shapes_size": shapes.size,
        "postures": _ranges(mechanism.robot) if free else None,
        "dragged": [_moving(mechanism.robot, body.name) for body in film.bodies] if free else None,
        "motions": [_motion(motion, starts[k], live.speeds[k], pieces[k]) for k, motion in enumerate(motions)],
        "joints": [_joint(joint) for joint in sizing.joints],
        "coordinates": mechanism.robot.nq,
        "all_joints": _degrees(mechanism.robot),
        "uses": [
            [names.index(use.joint), use.name, use.place, *([] if use.listed is None else [use.listed, use.computed])]
            for use in live.uses
        ],
        "choices": _choices(sizing, live, choices) if choices.pairs else None,
        "stored": _stored(sizing, live),
        "exceeded": [text for joint in sizing.joints if (text := joint.beyond_range)],
        "undetermined": [str(text) for text in sizing.undetermined],
        "unjudged": _unjudged(sizing),
        "not_recomputed": NOT_RECOMPUTED,
        "command": command if choices.pairs else _command(sizing),
    }
    return LiveFilm(content=content, blocks=(*modules, byte_planes(np.concatenate(numbers))))


class _Shapes(ShownExpressions):
    """What the view shows at a place in a motion, as a module; `moving` are the settings that move it."""

    def __init__(self, sizing: Sizing, live: LiveSizing, film: Film) -> None:
        import casadi

        assert sizing.inputs is not None
        mechanism, posed = sizing.inputs.mechanism, live.posed
        super().__init__(film, mechanism.scene)
        frames = () if mechanism.scene is None else mechanism.scene.frames
        symbols = Symbols(mechanism.robot, posed.parameters, (*(body.name for body in film.bodies), *frames))
        self.add_shapes(symbols, posed.parameters)
        shapes = casadi.Function("shapes", [symbols.q, symbols.p], [casadi.densify(self.all())])
        shown = shapes(posed.position, posed.values)
        self.module = module_of(casadi.Function("shapes", list(posed.inputs), [casadi.densify(shown)]))
        own = [casadi.depends_on(shown, posed.inputs[3][k]) for k in range(len(live.settings))]
        self.moving = [k for k, moves in enumerate(own) if moves or k in live.closing]


def _ranges(robot: Robot) -> list[list[Any]]:
    """The range of a slider for each joint, rad or m, and its unit; a turn or a metre where the joint has no limits."""
    found: list[list[Any]] = []
    for joint, low, high in zip(robot.joints, robot.lower.tolist(), robot.upper.tolist(), strict=True):
        reach, unit = (1.0, "m") if joint.kind == "prismatic" else (math.pi, "rad")
        found.append([low if math.isfinite(low) else -reach, high if math.isfinite(high) else reach, unit])
    return found


def _degrees(robot: Robot) -> list[str]:
    """The degrees of freedom by the names that they have in charts."""
    names = [(joint, label) for joint in robot.joints for label, _ in velocity_labels([joint])]
    return [
        joint.name if joint.nv == 1 else label.replace(f"{joint.name} velocity", joint.name) for joint, label in names
    ]


def _moving(robot: Robot, body: str) -> int:
    """The number of the joint that carries a body, the last one between it and the world; -1 for none, and for a joint
    that mimics another one.
    """
    names = [joint.name for joint in robot.joints]
    carrier = next(iter(robot.supporting_joints(body)), "")
    return names.index(carrier) if carrier in names else -1


def _unjudged(sizing: Sizing) -> list[str]:
    """What the verdict of a sizing depends on besides limits of joints and motors, and the page does not recompute."""
    assert sizing.inputs is not None
    rows = [
        f"whether the rows of motion '{motion.name}' determine its peaks"
        for motion in sizing.inputs.motions
        if motion.interpolated.any()
    ]
    return [*rows, *(f"all axes together: {one.name}" for one in sizing.system if one.verdict != "note")]


def _columns(states: Array) -> Array:
    """States (m, 2, 3 n), column after column, which compresses better."""
    return np.ascontiguousarray(states.reshape(len(states), -1).T)


def byte_planes(numbers: Array) -> bytes:
    """The first bytes of all numbers, then the second ones, …: exponents change little."""
    return np.ascontiguousarray(numbers.view(np.uint8).reshape(-1, 8).T).tobytes()


def finite(setting: dict[str, Any]) -> dict[str, Any]:
    """A setting for JSON: without what it does not have."""
    found = {key: None if value == -math.inf else value for key, value in setting.items()}
    return {key: value for key, value in found.items() if key not in ("options", "above") or value}


def _motion(motion: Motion, start: float, speed: int, pieces: MotionPieces) -> dict[str, Any]:
    return {
        "name": motion.name,
        "start": float(start),
        "begin": float(motion.time[0]),
        "duration": motion.duration,
        "speed": speed,
        "quintics": len(pieces.time),
        "pieces": len(pieces.cuts),
        "rests": len(pieces.rests),
    }


def _joint(joint: JointSizing) -> dict[str, Any]:
    actuator = None if joint.shaft is None else joint.shaft.actuator
    return {
        "name": joint.name,
        "torque_unit": joint.torque_unit,
        "speed_unit": joint.speed_unit,
        "motor": actuator is not None,
        "at_shaft": actuator is not None and not actuator.unknown_of_torque,
    }


def _choices(sizing: Sizing, live: LiveSizing, choices: Choices) -> dict[str, Any]:
    """The motors and gears of each joint: their ids, the setting that chooses (null where there is only one), and title
    and limits of the torque-speed plane of each, as numbers of lines, which several may share.
    """
    assert sizing.inputs is not None
    lines: list[list[Any]] = []
    joints: list[dict[str, Any]] = []
    for joint in sizing.inputs.mechanism.motors:
        pairs = choices.pairs[joint.name]
        places = [k for k, one in enumerate(live.settings) if one.options and one.name == joint.name]
        planes = []
        for plane in [shaft_plot(joint, pair.actuator) for pair in pairs] if places else []:
            limits = [[text, _outline(points)] for text, points in plane.limits]
            lines += [line for line in limits if line not in lines]
            planes.append({"title": plane.title, "limits": [lines.index(line) for line in limits]})
        names = [pair.name for pair in pairs]
        joints.append({"pairs": names, "setting": places[0] if places else None, "planes": planes})
    return {"joints": joints, "lines": lines}


def _outline(points: Array) -> list[float]:
    """The corners (n, 2) of a line, row by row; those within 1/2000 of its ranges from the others are left out."""
    rows, _ = kept_rows(np.arange(len(points), dtype=np.float64), points, 0.0)
    return [float(f"{x:.5g}") for x in points[np.unique(np.concatenate(rows))].ravel()]


def _stored(sizing: Sizing, live: LiveSizing) -> dict[str, Any]:
    """What `size` and `judge` found: figures (of FIGURES, joint by joint; null where there is none) and uses."""
    figures: list[list[float | None]] = [[] for _ in FIGURES]
    for joint in sizing.joints:
        shaft = joint.shaft
        at_shaft = shaft is not None and shaft.peak_torque is not None and shaft.rms_torque is not None
        factor = shaft.actuator.safety_factor if shaft is not None else 1.0
        figures[0].append(joint.peak_torque)
        figures[1].append(joint.rms_torque)
        figures[2].append(joint.peak_speed)
        figures[3].append(factor * shaft.peak_torque.value if at_shaft and shaft and shaft.peak_torque else None)
        figures[4].append(factor * shaft.rms_torque if at_shaft and shaft and shaft.rms_torque is not None else None)
        figures[5].append(None)
    uses: list[float | None] = []
    for use in live.uses:
        if use.place is None:
            continue
        joint = sizing.joint(use.joint)
        margins = {} if joint.shaft is None else joint.shaft.margins
        margin = {EFFORT: joint.effort_margin, VELOCITY: joint.velocity_margin}.get(use.name, margins.get(use.name))
        known = margin is not None and (use.computed is None or 0 in use.computed)
        uses.append(1.0 - margin if known and margin is not None else None)
    sentence, *others = verdict(sizing).split("\n")
    word, _, rest = sentence.partition(": ")
    listed = [text.removeprefix("  - ") for text in others if text.startswith("  - ")]
    certain = sizing.verified and not sizing.unknown and any(use is not None for use in uses)
    return {
        "figures": [value for each in figures for value in each],
        "uses": uses,
        "good": certain or (None if sizing.inside else False),
        "word": word.capitalize() if word.isupper() else word,
        "sentences": [text for text in (rest, *listed) if text],
    }


def _command(sizing: Sizing) -> dict[str, Any] | None:
    """How the sizing is made on the command line; None where it is not."""
    config = sizing.config
    if config is None or sizing.inputs is None or sizing.allowed_massless:
        return None
    extra = sizing.inputs.mechanism.robot.payloads[len(config.payloads) :]
    if any(any((*one.cg, *one.inertia)) for one in extra) or not set(sizing.motions) <= set(config.motions):
        return None
    words = ["bellcrank", "size", name_of(config)]
    if list(sizing.motions) != list(config.motions):
        words += [word for name in sizing.motions for word in ("--motion", name)]
    words += [word for one in extra for word in ("--payload", f"{one.mass!r}@{one.frame}")]
    return {"words": words, "overrides": [[path, value] for path, value in config.overrides.items()]}


def name_of(config: RobotConfig) -> str:
    """The name under which a configuration is found: its own where it is bundled, else that of its file."""
    bundled = config.source.parent.resolve() == bundled_data.folder("robots").resolve()
    return config.source.stem if bundled else config.source.name
