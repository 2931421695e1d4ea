"""Designs that differ in plain numbers only: their parameters and consistent starts, computed for all at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bellcrank.arrays import Array, Indices, Mask
from bellcrank.cached_values import cached_property
from bellcrank.dynamics.equations.design_parameters import design_parameters
from bellcrank.dynamics.equations.system import start_states, system_of
from bellcrank.dynamics.inverse.prescribed_motion_end import prescribed_motion_end
from bellcrank.dynamics.postures.consistent_start import consistent_postures, consistent_velocities, reason
from bellcrank.dynamics.postures.posture_search import Constrained
from bellcrank.errors import InputError
from bellcrank.scene.scene import Scene
from bellcrank.simulation.integration.integration import impossible_contacts, infinite_starts, open_contacts
from bellcrank.studies.designs.plain_axes import PlainAxis, ValueKind
from bellcrank.studies.execution.infeasible_reasons import infeasible_reason


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
