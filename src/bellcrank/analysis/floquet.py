"""`floquet`: the stability of a periodic motion by its Floquet multipliers.

Small deviations y of a motion follow the variational equation ẏ = A(t) y, with A the linearised field along the motion.
After a period T they are y(T) = Φ y(0); the eigenvalues of the monodromy matrix Φ are the multipliers, and the motion
is stable if none exceeds 1. Along a motion of autonomous equations one multiplier is 1. The equation is integrated by
Gauss collocation of order 8, A being evaluated at its nodes. Sources: Hairer, Lubich & Wanner, Geometric Numerical
Integration, 2nd ed., II.1.3; A. H. Nayfeh & B. Balachandran, Applied Nonlinear Dynamics (1995), 3.2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from bellcrank import arguments
from bellcrank.analysis.modes import Quotient, eigen, pair
from bellcrank.analysis.operating_point import independent_states, operating_point, state_names, state_units
from bellcrank.analysis.symmetries import adjoint, symmetries_of
from bellcrank.arrays import Array, Complex
from bellcrank.dynamics.equations.linear_equations import LinearEquations, equation_code
from bellcrank.errors import InputError
from bellcrank.files.access import Trust
from bellcrank.notes import Note, ranked
from bellcrank.present.results import JsonLayout, Result
from bellcrank.robot.robot import Robot
from bellcrank.scene.load import given_scene
from bellcrank.scene.scene import Scene
from bellcrank.simulation.simulate import simulate
from bellcrank.simulation.trajectory.scene_notes import file_notes

TOLERANCE = 1e-12  # of the run along which A is evaluated
PERIODIC = 1e-6  # of the largest entries: how well velocities and equations must return
FEWEST, MOST = 32, 1024  # intervals of a period
WANTED = 1e-10  # of the largest entry of Φ: the change at which the intervals are fine enough
NODES = (1.0 + np.polynomial.legendre.leggauss(4)[0]) / 2.0  # of Gauss collocation, order 8


@dataclass(frozen=True, eq=False, kw_only=True)
class FloquetModes(Result):
    """The stability of a periodic motion. Made by `floquet`.

    `to_csv` writes one row a multiplier.

    Attributes:
        name: The scene's name.
        time: The time, s, at which the period begins.
        period: T, s.
        states: (name, unit) of each state (n); directions along symmetries are left out.
        monodromy: Φ (n, n).
        multipliers: Its eigenvalues (n,), largest first.
        error: The estimated error of each multiplier (n,).
        symmetries: The motions along which nothing changes.
        notes: What the scene's files say and is not modelled.

    Example:
        >>> import bellcrank as bc
        >>> scene = bc.load_scene("pendulum", {"initial.swing": "1e-6 deg"})
        >>> found = bc.floquet(scene, 6.283185307179586 / 9.81**0.5)
        >>> abs(found.multipliers).round(4).tolist()
        [1.0, 1.0]
    """

    name: str
    time: float
    period: float
    states: tuple[tuple[str, str], ...]
    monodromy: Array
    multipliers: Complex
    error: Array
    symmetries: tuple[str, ...]
    notes: tuple[Note, ...] = ()
    json_layout: ClassVar = JsonLayout(1, ascii_only=True)

    @property
    def exponents(self) -> Complex:
        """The Floquet exponents (n,), 1/s: log(multiplier)/T, with imaginary parts within ±π/T.

        Example:
            >>> import bellcrank as bc
            >>> scene = bc.load_scene("pendulum", {"initial.swing": "1e-6 deg"})
            >>> found = bc.floquet(scene, 6.283185307179586 / 9.81**0.5)
            >>> abs(found.exponents).max() < 1e-3
            np.True_
        """
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(self.multipliers) / self.period)

    @property
    def stable(self) -> bool:
        """Whether no multiplier exceeds 1 by more than its error."""
        return bool((np.abs(self.multipliers) <= 1.0 + self.error).all())

    def table(self) -> str:
        """The multipliers as text for a terminal.

        Returns:
            Lines of text.

        Example:
            >>> import bellcrank as bc
            >>> scene = bc.load_scene("pendulum", {"initial.swing": "1e-6 deg"})
            >>> found = bc.floquet(scene, 6.283185307179586 / 9.81**0.5)
            >>> print(found.table().splitlines()[0])
            Simple pendulum: periodic motion of 2.00607 s from 0 s, stable (Floquet multipliers)
        """
        word = "stable" if self.stable else "unstable: a deviation grows"
        lines = [
            f"{self.name}: periodic motion of {self.period:.6g} s from {self.time:g} s, {word} (Floquet multipliers)",
            "multiplier                        magnitude     error",
        ]
        for value, error in zip(self.multipliers.tolist(), self.error.tolist(), strict=True):
            shown = f"{value.real:.8g} {'-' if value.imag < 0 else '+'} {abs(value.imag):.8g}i"
            lines.append(f"{shown:32}  {abs(value):<12.9g}  {error:.1g}")
        if self.symmetries:
            lines.append(f"symmetries (left out of the states): {'; '.join(self.symmetries)}")
        return "\n".join([*lines, *(f"{note.label}: {note}" for note in self.notes)])

    def _rows(self) -> list[Sequence[object]]:
        header = ["real part", "imaginary part", "magnitude", "error"]
        numbers = zip(self.multipliers.tolist(), self.error.tolist(), strict=True)
        return [header, *([*pair(value), abs(value), error] for value, error in numbers)]

    def as_dict(self) -> dict[str, Any]:
        """The result as data that JSON can hold.

        Returns:
            Multipliers and modes; complex numbers as [real, imaginary].

        Example:
            >>> import bellcrank as bc
            >>> scene = bc.load_scene("pendulum", {"initial.swing": "1e-6 deg"})
            >>> found = bc.floquet(scene, 6.283185307179586 / 9.81**0.5)
            >>> found.as_dict()["stable"]
            True
        """
        return {
            "name": self.name,
            "kind": "periodic",
            "time": self.time,
            "period": self.period,
            "stable": self.stable,
            "states": [list(entry) for entry in self.states],
            "monodromy": self.monodromy.tolist(),
            "multipliers": [pair(x) for x in self.multipliers.tolist()],
            "errors": self.error.tolist(),
            "symmetries": list(self.symmetries),
            "notes": [note.as_dict() for note in self.notes],
        }


@arguments.named
def floquet(
    scene: Scene | Robot | str | Path,
    period: float,
    at: float = 0.0,
    *,
    overrides: Mapping[str, Any] | None = None,
    trust: Trust = (),
) -> FloquetModes:
    """The Floquet multipliers of a periodic motion of a scene.

    This is for motions that are no relative equilibria of `linearise`: a driven mechanism that turns round and round, a
    pendulum that swings. The motion must return after the period: velocities and linearised equations must be the same
    (joints may have turned by whole turns, and a free base may have moved along a symmetry).

    Args:
        scene: A scene or robot, or the path or name of its file.
        period: T, s.
        at: The time, s, of a run from the scene's start at which the period begins: late enough that a start that is
            not on the periodic motion has settled.
        overrides: Changes of the scene by dotted path, such as {"initial.crank": "1.5 deg"}.
        trust: Where `scene` is a file, folders whose files it may name, besides those near it.

    Returns:
        The multipliers.

    Raises:
        InputError: The motion does not return after the period, or the run ends before.

    Example:
        >>> import bellcrank as bc
        >>> scene = bc.load_scene("pendulum", {"initial.swing": "1e-6 deg"})
        >>> bc.floquet(scene, 6.283185307179586 / 9.81**0.5).stable
        True
    """
    scene = given_scene(scene, overrides, trust)
    period = arguments.number("period", period, "s", above=0.0)
    at = arguments.number("at", at, "s", least=0.0)
    last, count = None, FEWEST
    while True:
        found = _Period(scene, at, period, count)
        if last is not None:
            change = float(np.abs(found.monodromy - last.monodromy).max(initial=0.0))
            if change <= WANTED * max(float(np.abs(found.monodromy).max(initial=0.0)), 1.0) or count >= MOST:
                return found.result(max(change, TOLERANCE))
        last, count = found, 2 * count


class _Period:
    """The variational equation integrated over one period in `count` intervals."""

    def __init__(self, scene: Scene, at: float, period: float, count: int) -> None:
        self.scene, self.at, self.period = scene, at, period
        if held := scene.held_sources:
            raise InputError(
                f"{scene.source}: Floquet multipliers require forces that are smooth along the period, and there are "
                f"{', '.join(source.name for source in held)}"
            )
        code, step = equation_code(scene), period / count
        inner = (np.arange(count)[:, None] + NODES).ravel() * step
        times = np.concatenate([[0.0] if at == 0.0 else [0.0, at], at + inner, [at + period]])
        run = simulate(scene, duration=at + period, times=times, rtol=TOLERANCE, atol=TOLERANCE)
        if not run.success or abs(run.time[-1] - at - period) > 1e-9 * (at + period):
            raise InputError(f"{scene.source}: the run ended before the period did: {run.message}")
        rows = slice(len(times) - len(inner) - 2, None)
        states = list(zip(run.time[rows], run.position[rows], run.velocity[rows], strict=True))
        _, self.q, self.v = states[0]
        first, *middle = [(code.at(float(t), q, v), v) for t, q, v in states]
        self._check_return(first, middle.pop())
        self.point = operating_point(scene, at, self.q, self.v, symmetries_of(scene, at, self.q, self.v))
        self.independent = independent_states(self.point)
        flow = self.independent.embedding
        fields = [_field(scene, equations, v) for equations, v in middle]
        for k in range(count):
            flow = _gauss_step(fields[4 * k : 4 * k + 4], flow, step)
        self.monodromy: Array = flow[self.independent.rows]

    def result(self, change: float) -> FloquetModes:
        """The multipliers, with the error that a change of Φ makes in each."""
        fields = self.point.fields
        rows = self.independent.rows
        directions = np.concatenate([fields.displacement, fields.change])[rows]
        units = np.tile(state_units(self.scene), 2)[rows]
        quotient = Quotient.of(directions, len(self.independent.positions), units)
        reduced = quotient.field(self.monodromy)
        values, _, error = eigen(reduced, change)
        order = np.argsort(-np.abs(values), kind="stable")
        names = state_names(self.scene, self.independent)
        return FloquetModes(
            name=self.scene.name,
            time=self.at,
            period=self.period,
            states=tuple(names[k] for k in quotient.kept),
            monodromy=reduced,
            multipliers=np.asarray(values[order], dtype=np.complex128),
            error=error[order],
            symmetries=self.point.symmetries.names,
            notes=ranked(file_notes(self.scene)),
        )

    def _check_return(self, first: tuple[LinearEquations, Array], last: tuple[LinearEquations, Array]) -> None:
        """Raise InputError where velocities or equations at the end of the period are not those at its begin."""
        parts = {
            "velocities": (first[1], last[1]),
            "accelerations": (first[0].acceleration, last[0].acceleration),
            "constraints": (first[0].jacobian, last[0].jacobian),
            "linearised equations": (_field(self.scene, *first), _field(self.scene, *last)),
        }
        for name, (here, there) in parts.items():
            size = max(float(np.abs(here).max(initial=0.0)), float(np.abs(there).max(initial=0.0)))
            change = float(np.abs(there - here).max(initial=0.0))
            if change > PERIODIC * max(size, 1.0):
                raise InputError(
                    f"{self.scene.source}: the motion does not return after {self.period:g} s: the {name} differ by "
                    f"{change / max(size, 1.0):.2g} of the largest entry; give its exact period, or a later time "
                    "'at' by which it has settled"
                )


def _field(scene: Scene, at: LinearEquations, v: Array) -> Array:
    """The linearised field (2 nv, 2 nv) at one moment."""
    nv = len(v)
    by_q, by_v = at.solved_by("position")[0], at.solved_by("velocity")[0]
    return np.block([[-adjoint(scene.robot, v), np.eye(nv)], [by_q, by_v]])


def _gauss_step(fields: list[Array], flow: Array, step: float) -> Array:
    """One step of Gauss collocation of ẏ = A(t) y for all columns of `flow`."""
    n, count = len(flow), len(NODES)
    powers = np.arange(1, count + 1)
    vandermonde = NODES[:, None] ** (powers - 1)
    weights = np.linalg.solve(vandermonde.T, 1.0 / powers)
    inner = (NODES[:, None] ** powers / powers) @ np.linalg.inv(vandermonde)
    whole = np.eye(count * n)
    for i in range(count):
        for j in range(count):
            whole[i * n : (i + 1) * n, j * n : (j + 1) * n] -= step * inner[i, j] * fields[i]
    slopes = np.linalg.solve(whole, np.concatenate([field @ flow for field in fields]))
    return np.asarray(flow + step * sum(weights[i] * slopes[i * n : (i + 1) * n] for i in range(count)))
