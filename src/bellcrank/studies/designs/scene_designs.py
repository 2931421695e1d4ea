"""From the values of designs to what an ensemble of runs takes: parameters, consistent starts and settings.

Axes of plain numbers go into arrays (plain_axes.py, variant_designs.py). The other axes make variants of the scene, one
for each combination of their values, by `Scene.with_overrides`. Designs that these routes do not treat are made one by
one, as `simulate` makes them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.arrays import Array
from bellcrank.cached_values import Portable, cached_property
from bellcrank.dynamics.constraints.singular_mass_matrix import refuse_singular_mass_matrix
from bellcrank.dynamics.equations.system import start_states, system_of, system_parameters
from bellcrank.dynamics.inverse.prescribed_motion_end import prescribed_motion_end
from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.errors import BellcrankError, InputError
from bellcrank.scene.scene import Scene
from bellcrank.simulation.integration.baumgarte_gains import automatic_gains
from bellcrank.simulation.integration.drive_gains import tuned
from bellcrank.simulation.integration.integration import impossible_contacts, refuse_infinite_start, refuse_open_contact
from bellcrank.studies.designs.plain_axes import DesignAxis, PlainAxis, ValueKind, admitted, plain_axes
from bellcrank.studies.designs.variant_designs import VariantDesigns
from bellcrank.studies.execution.infeasible_reasons import infeasible_reason

Rows = NDArray[np.int64]
RECENT = 16  # variants that are kept between blocks


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
