"""Why a mechanism has no consistent start: which loops stay apart, and which would close if others were open."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.dynamics.constraints.constraint_alignment import alignment_cosines, full_angle_residuals
from bellcrank.dynamics.constraints.constraint_derivatives import aligned_constraints
from bellcrank.dynamics.constraints.constraint_rows import rows_of
from bellcrank.dynamics.constraints.constraint_sampling import in_metres
from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.dynamics.postures.posture_search import (
    Constrained,
    PostureSearch,
    Satisfied,
    StartCode,
    scattered,
    search_further,
    search_postures,
)
from bellcrank.dynamics.postures.start_equations import start_equations

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene

APART = 1e-9  # m or rad: a larger residual is a gap
RESTARTS = ((8, 0.5),)  # fewer than for a start, as many sets of constraints are tried
TRIALS = 24  # random postures from which the smallest gaps are searched


@dataclass(frozen=True)
class Gap:
    """How far a constraint is from being satisfied: its residuals in m (their norm), and in rad or other units."""

    constraint: str
    distance: float
    angle: float

    @property
    def size(self) -> float:
        """The larger of both."""
        return max(self.distance, self.angle)

    def __str__(self) -> str:
        parts = [f"{self.distance:.3g} m"] if self.distance > APART else []
        parts += [f"{np.degrees(self.angle):.3g} deg"] if self.angle > APART else []
        return f"{self.constraint} {' and '.join(parts) or '0 m'}"


@dataclass(frozen=True, eq=False, kw_only=True)
class StartFailure:
    """What is known of a mechanism for which no consistent start was found.

    Attributes:
        posture: The position (nq,) with the smallest residuals that was found.
        gaps: The constraints that are not satisfied there, the largest gap first.
        never: Constraints that cannot be satisfied even if all others are open.
        openings: Constraints of which one has to be open for the others to be satisfied.
        opened: Where no single one suffices, constraints without which the others are satisfied.
        as_points: Constraints without whose conditions on rotation all are satisfied, or none.
    """

    posture: Array
    gaps: tuple[Gap, ...]
    never: tuple[str, ...]
    openings: tuple[str, ...]
    opened: tuple[str, ...]
    as_points: tuple[str, ...]

    def sentences(self) -> tuple[str, ...]:
        """The findings as sentences, each without a full stop."""
        found = [f"smallest position residuals: {', '.join(map(str, self.gaps))}"]
        if self.never:
            found.append(f"cannot be satisfied even if all other constraints are open: {', '.join(self.never)}")
        if self.openings:
            found.append(f"the other constraints can be satisfied if one of these is open: {', '.join(self.openings)}")
        elif self.opened:
            found.append(f"the other constraints can be satisfied if these are open: {', '.join(self.opened)}")
        if self.as_points:
            found.append(
                "all constraints can be satisfied if these fix positions only, not rotations (kind: point; type 3d): "
                + ", ".join(self.as_points)
            )
        return tuple(found)


def constraint_gaps(scene: Scene, q: Array) -> tuple[Gap, ...]:
    """The gap of each constraint with position residuals, in the scene's order, at a position (nq,)."""
    system = system_of(scene)
    cosines = np.array([list(alignment_cosines(scene, q).values())])
    residuals = full_angle_residuals(scene, _residuals(scene, q[None]), cosines)[0]
    names = system.multiplier_names[: len(residuals)]
    metres = np.array([in_metres(label) for _, label in names], dtype=bool)
    return tuple(
        Gap(
            name,
            float(np.linalg.norm(residuals[metres & _of(names, [name])])),
            float(np.linalg.norm(residuals[~metres & _of(names, [name])])),
        )
        for name in dict.fromkeys(name for name, _ in names)
    )


def diagnose_start(scene: Scene, designs: Constrained, q: Array, held: Mask) -> StartFailure:
    """Which constraints keep a scene from having a consistent start near q (nq,) with `held` (nv) held.

    `designs` is the scene as one design of itself.
    """
    closure = _Closure(scene, designs, q, held)
    names = closure.names
    never = tuple(name for name in names if not closure.closes([name])) if len(names) > 1 else ()
    openings: tuple[str, ...] = ()
    if len(never) <= 1 and len(names) > 1:
        tried = never or names
        openings = tuple(name for name in tried if closure.closes([other for other in names if other != name]))
    opened = () if openings else closure.opened(never)
    posture = closure.smallest_residuals()
    gaps = sorted(
        (gap for gap in constraint_gaps(scene, posture) if gap.size > APART), key=lambda gap: gap.size, reverse=True
    )
    return StartFailure(
        posture=posture,
        gaps=tuple(gaps),
        never=never,
        openings=openings,
        opened=opened,
        as_points=closure.points(openings[:1] or opened or tuple(names)),
    )


class _Closure:
    """Searches for postures that satisfy some of a scene's constraints."""

    def __init__(self, scene: Scene, designs: Constrained, q: Array, held: Mask) -> None:
        self.scene, self.designs, self.q, self.held = scene, designs, q, held
        equations = start_equations(scene)
        self.rows = system_of(scene).multiplier_names[: equations.heights]
        self.names = tuple(dict.fromkeys(name for name, _ in self.rows))
        self.aligned = aligned_constraints(scene)

    def closes(self, names: Iterable[str], points: Sequence[str] = ()) -> bool:
        """Whether a posture satisfies these constraints; of `points` only the rows in m."""
        names = list(names)
        metres = np.array([in_metres(label) for _, label in self.rows], dtype=bool)
        rows = _of(self.rows, names) & (metres | ~_of(self.rows, points))
        cosines = np.array([name in names and name not in points for name in self.aligned], dtype=bool)
        search = PostureSearch(self.held, satisfied=Satisfied(rows, cosines))
        q = self.q[None]
        if search_postures(self.scene, self.designs, q, search)[1].code[0] == StartCode.CONSISTENT:
            return True
        return bool(search_further(self.scene, self.designs, q, search, restarts=RESTARTS)[0][0])

    def opened(self, never: Sequence[str]) -> tuple[str, ...]:
        """Constraints, first those of `never`, without which the others are satisfied; each other is needed."""
        left = [name for name in self.names if name not in never]
        if not left or self.closes(left):
            return tuple(never)
        kept: list[str] = []
        for name in left:
            if self.closes([*kept, name]):
                kept.append(name)
        return tuple(name for name in self.names if name not in kept)

    def points(self, opened: Sequence[str]) -> tuple[str, ...]:
        """Welds and hinges without whose rotations all constraints are satisfied: `opened`, with one more if needed."""
        base = tuple(name for name in opened if name in self.aligned)
        if not base:
            return ()
        for more in ((), *((name,) for name in self.aligned if name not in base)):
            if self.closes(self.names, (*base, *more)):
                return tuple(name for name in self.names if name in (*base, *more))
        return ()

    def smallest_residuals(self) -> Array:
        """The posture (nq,) with the least sum of squares of the residuals among those where searches end."""
        random = np.random.default_rng(0).uniform(-1.0, 1.0, (TRIALS, self.scene.robot.nq))
        guesses = np.concatenate([self.q[None], scattered(self.scene, self.q[None], random, 0.3, self.held)[0]])
        designs = self.designs.picked(np.zeros(len(guesses), dtype=np.intp))
        found, _ = search_postures(self.scene, designs, guesses, PostureSearch(self.held, "damped"))
        sizes = np.linalg.norm(_residuals(self.scene, found) / rows_of(self.scene).unit[: len(self.rows)], axis=1)
        best = int(np.argmin(np.where(np.isfinite(sizes), sizes, np.inf)))
        return np.asarray(
            search_postures(self.scene, self.designs, found[best : best + 1], PostureSearch(self.held))[0][0]
        )


def _residuals(scene: Scene, q: Array) -> Array:
    """φ (n, heights) at positions (n, nq)."""
    system = system_of(scene)
    x = np.zeros((len(q), system.size))
    x[:, : system.nq] = q
    inputs = np.repeat(scene.signals_at(np.zeros(1)), len(q), axis=0)
    parameters = np.repeat(system_parameters(scene)[None], len(q), axis=0)
    return np.asarray(system.linearised(np.zeros((len(q), 1)), x, inputs, parameters)[0])


def _of(rows: Sequence[tuple[str, str]], names: Iterable[str]) -> Mask:
    """Which rows belong to these constraints."""
    wanted = set(names)
    return np.array([name in wanted for name, _ in rows], dtype=bool)
