"""From the values of designs to what an ensemble of runs takes: parameters, consistent starts and settings.

Axes of plain numbers go into arrays (plain_axes.py, `VariantDesigns`). The other axes make variants of the scene, one
for each combination of their values, by `Scene.with_overrides`. Designs that these routes do not treat are made one by
one, as `simulate` makes them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.arrays import Array, Indices, Mask
from bellcrank.cached_values import Portable, cached_property
from bellcrank.dynamics.constraints.singular_mass_matrix import refuse_singular_mass_matrix
from bellcrank.dynamics.equations.design_parameters import design_parameters
from bellcrank.dynamics.equations.system import start_states, system_of, system_parameters
from bellcrank.dynamics.inverse.input_breakpoints import prescribed_motion_end
from bellcrank.dynamics.postures.consistent_start import (
    consistent_postures,
    consistent_start,
    consistent_velocities,
    reason,
)
from bellcrank.dynamics.postures.posture_search import Constrained
from bellcrank.errors import BellcrankError, InputError
from bellcrank.scene.scene import Scene
from bellcrank.simulation.integration.automatic_gains import automatic_gains, tuned
from bellcrank.simulation.integration.integration import (
    impossible_contacts,
    infinite_starts,
    open_contacts,
    refuse_infinite_start,
    refuse_open_contact,
)
from bellcrank.studies.designs.plain_axes import DesignAxis, PlainAxis, ValueKind, admitted, plain_axes
from bellcrank.studies.execution.design_runner import infeasible_reason

Rows = NDArray[np.int64]
RECENT = 16  # variants that are kept between blocks


@dataclass(frozen=True, eq=False, kw_only=True)
class Starts:
    """Parameters and starts of n designs.

    Attributes:
        parameters: p (n, np).
        start: x (n, size).
        alike: Which designs (n,) have the variant's equations; the others have to be made one by one.
        consistent: Which of them have a consistent start (n,).
        reasons: Why one of them cannot be run, by its number.
    """

    parameters: Array
    start: Array
    alike: Mask
    consistent: Mask
    reasons: dict[int, str]


class VariantDesigns:
    """The designs of a variant of a scene along axes of plain numbers.

    Raises InputError or another BellcrankError where the variant has no equations.
    """

    def __init__(self, scene: Scene, axes: Sequence[PlainAxis]) -> None:
        self.scene, self.axes = scene, tuple(axes)
        self.system = system_of(scene)
        initial, robot = scene.initial, scene.robot
        self._motion = None if initial.motion is None else scene.motion(initial.motion)
        self._position = initial.posture(robot, self._motion)
        self._held = initial.held(robot)

    @cached_property
    def plain(self) -> bool:
        """Whether all designs can be treated at once."""
        found = {(axis.kind, axis.name) for axis in self.axes}
        joints = {ValueKind.POSITION: self.scene.initial.position, ValueKind.VELOCITY: self.scene.initial.velocity}
        there = all(name in joints[kind] for kind, name in found if kind in joints)
        automatic = any(d.cascade is not None and d.cascade.gains == "auto" for d in self.scene.drives)
        return there and not self.scene.settings.stabilisation.auto and not automatic

    def starts(self, values: Array, threads: int) -> Starts:
        """Parameters and consistent starts of designs with values (n, axes) that the scene accepts."""
        found = design_parameters(self.scene, self._own_parameters(values), threads)
        system, count = self.system, len(values)
        x = np.zeros((count, system.size))
        reasons = dict[int, str]()
        consistent = found.alike.copy()
        rows = np.flatnonzero(consistent)
        designs = found.constrained.picked(rows)
        q = self._positions(values[rows])
        if self.scene.constraints:
            q, good = self._closed(designs, q, rows, reasons, threads)
            rows, designs, q = rows[good], designs.picked(good), q[good]
        v = self._velocities(values[rows], q)
        if self.scene.constraints:
            v, verdicts = consistent_velocities(self.scene, designs, q, v, self._held[1], threads)
            for k in np.flatnonzero(verdicts.code).tolist():
                reasons[int(rows[k])] = f"initial: {reason(self.scene, verdicts, k, self._held[0])}"
            good = np.flatnonzero(verdicts.code == 0)
            rows, designs, q, v = rows[good], designs.picked(good), q[good], v[good]
        consistent[:] = False
        consistent[rows] = True
        if len(rows):
            x[rows] = start_states(self.scene, q, v, designs.parameters)
        for k, text in self._refused(designs.parameters, x[rows]).items():
            reasons[int(rows[k])] = text
        return Starts(
            parameters=found.constrained.parameters,
            start=x,
            alike=found.alike,
            consistent=consistent,
            reasons=reasons,
        )

    def _closed(
        self, designs: Constrained, q: Array, rows: Indices, reasons: dict[int, str], threads: int
    ) -> tuple[Array, Indices]:
        """The consistent positions, and which designs have one."""
        q, verdicts = consistent_postures(self.scene, designs, q, self._held[0], threads)
        for k in np.flatnonzero(verdicts.code).tolist():
            reasons[int(rows[k])] = f"initial: {reason(self.scene, verdicts, k, self._held[0])}"
        return q, np.flatnonzero(verdicts.code == 0)

    def _refused(self, parameters: Array, start: Array) -> dict[int, str]:
        """Which designs with consistent starts cannot be run."""
        try:
            prescribed_motion_end(self.scene)
        except InputError as error:
            text = infeasible_reason(error, self.scene)
            return dict.fromkeys(range(len(start)), text)
        if not len(start):
            return {}
        found = infinite_starts(self.scene, parameters, start) | open_contacts(self.scene, parameters, start)
        return found | impossible_contacts(self.scene, parameters, start[:, : self.system.nq])

    def _own_parameters(self, values: Array) -> Array:
        """`Scene.own_parameters` of each design (n, …)."""
        own = np.tile(self.scene.own_parameters, (len(values), 1))
        places = {name: k for k, name in enumerate(self.scene.parameters)}
        for axis in self.axes:
            if axis.kind is ValueKind.PARAMETER:
                own[:, places[axis.name]] = axis.numbers(values)
        return own

    def _positions(self, values: Array) -> Array:
        """The given positions (n, nq)."""
        q = np.tile(self._position, (len(values), 1))
        for axis in self.axes:
            if axis.kind is ValueKind.POSITION:
                q[:, self.scene.robot.joint(axis.name).q] = axis.numbers(values)
        return q

    def _velocities(self, values: Array, q: Array) -> Array:
        """The given velocities (n, nv) at positions (n, nq)."""
        v = self.scene.initial.rates(self.scene.robot, q, self._motion)
        for axis in self.axes:
            if axis.kind is ValueKind.VELOCITY:
                v[:, self.scene.robot.joint(axis.name).v] = axis.numbers(values)
        return v


@dataclass(frozen=True, eq=False, kw_only=True)
class DesignGroup:
    """Designs of one block that have the same compiled equations, signals, events and solver.

    Attributes:
        scene: A scene that has what they share.
        rows: Their rows in the block (k,), rising.
        parameters: p (k, np), as `system_parameters` gives them.
        start: Consistent starts x (k, size).
        duration: s (k,).
        settings: The numbers of the step control that the axes vary (k,), by the names of StepControl.
    """

    scene: Scene
    rows: Rows
    parameters: Array
    start: Array
    duration: Array
    settings: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, kw_only=True)
class DesignBlock:
    """A block of designs, ready to be run.

    Attributes:
        groups: The designs that can be run; each is in one group.
        infeasible: Why each of the others cannot, by its row; without the path of the scene's file.
        start_position: The consistent position (n, nq) at the start, NaN where there is none. An infeasible design has
            one where it is refused for another reason.
    """

    groups: tuple[DesignGroup, ...]
    infeasible: Mapping[int, str]
    start_position: Array


@dataclass(eq=False)
class _Members:
    """The designs of a group while it is being made: parts in any order."""

    scene: Scene
    rows: list[Rows] = field(default_factory=list)
    parameters: list[Array] = field(default_factory=list)
    start: list[Array] = field(default_factory=list)

    def add(self, rows: Rows, parameters: Array, start: Array) -> None:
        """Add designs."""
        self.rows.append(rows)
        self.parameters.append(parameters)
        self.start.append(start)


class SceneDesigns(Portable):
    """The designs of a scene along the axes of a study. It can be pickled."""

    def __init__(self, scene: Scene, axes: Sequence[DesignAxis]) -> None:
        self.scene, self.axes = scene, tuple(axes)

    @cached_property
    def plain(self) -> tuple[PlainAxis, ...]:
        """The axes of plain numbers."""
        return plain_axes(self.scene, self.axes)

    @cached_property
    def _others(self) -> list[int]:
        """The columns of the other axes."""
        return [k for k in range(len(self.axes)) if k not in {axis.column for axis in self.plain}]

    @cached_property
    def _recent(self) -> dict[tuple[float, ...], VariantDesigns]:
        return {}

    def overrides(self, numbers: Sequence[float]) -> dict[str, Any]:
        """The overrides of the scene that make the design with these values (axes,)."""
        return {axis.path: axis.value(number) for axis, number in zip(self.axes, numbers, strict=True)}

    def block(self, values: Array, *, threads: int = 1) -> DesignBlock:
        """The block of designs with values (n, axes), in the units of the axes.

        A design's parameters and start depend on its own values alone, to the last bit.
        """
        values = np.ascontiguousarray(values, dtype=np.float64)
        infeasible: dict[int, str] = {}
        positions = np.full((len(values), self.scene.robot.nq), np.nan)
        groups: list[DesignGroup] = []
        accepted = admitted(self.scene, self.plain, values)
        for choice, rows in self._variants(values):
            members: dict[object, _Members] = {}
            alone = rows
            variant = self._variant(choice, values[rows[accepted[rows]]])
            if variant is not None:
                some = rows[accepted[rows]]
                found = variant.starts(values[some], threads)
                positions[some[found.consistent]] = found.start[found.consistent, : variant.system.nq]
                infeasible |= {int(some[k]): text for k, text in found.reasons.items()}
                good = found.consistent.copy()
                good[list(found.reasons)] = False
                if good.any():
                    members[variant.system] = _Members(variant.scene)
                    members[variant.system].add(some[good], found.parameters[good], found.start[good])
                alone = np.sort(np.concatenate([rows[~accepted[rows]], some[~found.alike]]))
            for row in alone.tolist():
                self._add_alone(row, values[row].tolist(), members, positions, infeasible)
            groups += [self._group(found, values) for found in members.values()]
        return DesignBlock(groups=tuple(groups), infeasible=dict(sorted(infeasible.items())), start_position=positions)

    def _variants(self, values: Array) -> Iterator[tuple[tuple[float, ...], Rows]]:
        """The distinct combinations of values of the other axes, and the rows of each, rising."""
        if not self._others:
            yield (), np.arange(len(values))
            return
        choices, which = np.unique(values[:, self._others], axis=0, return_inverse=True)
        order = np.argsort(which.ravel(), kind="stable")
        ends = np.cumsum(np.bincount(which.ravel(), minlength=len(choices)))
        for choice, rows in zip(choices.tolist(), np.split(order, ends[:-1]), strict=True):
            yield tuple(choice), rows

    def _variant(self, choice: tuple[float, ...], values: Array) -> VariantDesigns | None:
        """The variant with these values of the other axes; None where its designs have to be made one by one.

        The first of the values (n, axes) say what kind of start and which settings the designs have.
        """
        if choice in self._recent:
            return self._recent[choice]
        if not len(values):
            return None
        structural = {axis.column for axis in self.plain if axis.kind is not ValueKind.PARAMETER}
        overrides = {
            axis.path: axis.value(number)
            for k, (axis, number) in enumerate(zip(self.axes, values[0].tolist(), strict=True))
            if k in structural or k in self._others
        }
        try:
            scene = self.scene.with_overrides(overrides) if overrides else self.scene
            found = VariantDesigns(scene, self.plain)
            if not found.plain:
                return None
        except BellcrankError:
            return None
        self._recent[choice] = found
        if len(self._recent) > RECENT:
            del self._recent[next(iter(self._recent))]
        return found

    def _add_alone(
        self,
        row: int,
        numbers: Sequence[float],
        members: dict[object, _Members],
        positions: Array,
        infeasible: dict[int, str],
    ) -> None:
        """Make one design as `simulate` does."""
        try:
            scene = self.scene.with_overrides(self.overrides(numbers))
            positions[row] = consistent_start(scene)[0]
            scene, parameters, start = _checked_start(scene)
        except BellcrankError as error:
            infeasible[row] = infeasible_reason(error, self.scene)
            return
        group = members.setdefault(system_of(scene), _Members(scene))
        group.add(np.array([row]), parameters[None], start[None])

    def _group(self, members: _Members, values: Array) -> DesignGroup:
        rows = np.concatenate(members.rows)
        order = np.argsort(rows)
        rows = rows[order]
        settings = {axis.name: axis.numbers(values[rows]) for axis in self.plain if axis.kind is ValueKind.SETTING}
        duration = settings.pop("duration", np.full(len(rows), members.scene.settings.duration))
        return DesignGroup(
            scene=members.scene,
            rows=rows,
            parameters=np.concatenate(members.parameters)[order],
            start=np.concatenate(members.start)[order],
            duration=duration,
            settings=settings,
        )


def _checked_start(scene: Scene) -> tuple[Scene, Array, Array]:
    """The scene with the gains of its constraints, p and x of its start; InputError where a run cannot start."""
    scene = tuned(scene)
    settings = scene.settings
    if settings.stabilisation.auto:
        gains = automatic_gains(scene)
        chosen = replace(settings.stabilisation, alpha=gains.alpha, beta=gains.beta, auto=False)
        scene = replace(scene, settings=replace(settings, stabilisation=chosen))
    prescribed_motion_end(scene)
    refuse_singular_mass_matrix(scene)
    parameters = system_parameters(scene)
    q, v = consistent_start(scene)
    start = start_states(scene, q[None], v[None], parameters)[0]
    refuse_open_contact(scene, parameters, start)
    for text in impossible_contacts(scene, parameters[None], q[None]).values():
        raise InputError(f"{scene.source}: {text}")
    refuse_infinite_start(scene, parameters, start)
    return scene, parameters, start
