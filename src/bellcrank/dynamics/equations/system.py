"""The compiled equations of motion of a scene, and the parameters that they take.

Systems are shared between scenes that differ only in numbers (start, parameters, tolerances).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING
from weakref import WeakValueDictionary

import numpy as np

from bellcrank.arrays import Array
from bellcrank.cached_values import computed_once
from bellcrank.codegen import cache as disk
from bellcrank.codegen.locks import making
from bellcrank.dynamics.constraints.constraint_rows import rows_of
from bellcrank.dynamics.equations.compiled_equations import System
from bellcrank.dynamics.equations.kkt import REGULARISATION

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene

RECENT = 16  # systems that are kept although no scene uses them
_systems: WeakValueDictionary[str, System] = WeakValueDictionary()
_recent: dict[str, System] = {}  # the last of them is the newest


@computed_once
def system_parameters(scene: Scene) -> Array:
    """The parameters p (np,) that the functions of a scene's system take; read-only.

    They are `Scene.own_parameters` and, with constraints, the usual sizes of the rows and, last, their regularisation.

    Args:
        scene: The scene.

    Returns:
        The values, SI units.

    Example:
        >>> import bellcrank as bc
        >>> from bellcrank.dynamics.equations.system import system_parameters
        >>> system_parameters(bc.load_scene("spring_pendulum")).shape == (
        ...     len(bc.load_scene("spring_pendulum").parameters),
        ... )
        True
    """
    own = scene.own_parameters
    found = np.concatenate([own, rows_of(scene).parameters, [REGULARISATION]]) if scene.constraints else own
    found.setflags(write=False)
    return found


def start_states(scene: Scene, position: Array, velocity: Array, parameters: Array) -> Array:
    """The states x (n, size) at the start of runs.

    The auxiliary states follow from the others, or go on from the saved run that the scene continues.

    Args:
        scene: The scene.
        position: Consistent positions (n, nq).
        velocity: Consistent velocities (n, nv).
        parameters: The parameters of its equations (np,) or (n, np).

    Returns:
        The states, with work 0.

    Example:
        >>> import numpy as np
        >>> import bellcrank as bc
        >>> from bellcrank.dynamics.equations.system import start_states, system_parameters
        >>> scene = bc.load_scene("pendulum")
        >>> start_states(scene, np.zeros((1, 1)), np.zeros((1, 1)), system_parameters(scene)).tolist()
        [[0.0, 0.0]]
    """
    system, saved = system_of(scene), scene.initial.saved
    moving = system.nq + system.nv
    x = np.zeros((len(position), system.size))
    x[:, : system.nq], x[:, system.nq : moving] = position, velocity
    if system.nz:
        u = scene.signals_at(np.zeros(1))[0]
        found = system.auxiliary_start.rows(
            np.zeros(1), x, u, np.broadcast_to(parameters, (len(x), parameters.shape[-1]))
        )
        x[:, moving : moving + system.nz] = found[0]
        if saved is not None:
            x[:, moving : moving + system.nz] = _continued(scene, saved.auxiliary, x[:, moving : moving + system.nz])
    return x


def _continued(scene: Scene, saved: Mapping[str, tuple[float, ...]], start: Array) -> Array:
    """Auxiliary states (n, nz) at the start, those that a saved run holds replaced by its own."""
    found, first = start.copy(), 0
    for states in scene.auxiliary_states:
        own = slice(first, first + states.size)
        if len(saved.get(states.name, ())) == states.size:
            found[:, own] = saved[states.name]
        first += states.size
    return found


@computed_once
def system_of(scene: Scene) -> System:
    """The compiled equations of motion of a scene, shared by scenes with the same equations.

    A system lives as long as one of these scenes, and those used last a little longer, so that scenes that are read
    again start at once.

    Args:
        scene: The scene, as `bellcrank.load_scene` reads it.

    Returns:
        The system, whose functions are compiled when first called.

    Raises:
        InputError: A force cannot act on this robot, or a constraint can never hold.

    Example:
        >>> import numpy as np
        >>> import bellcrank as bc
        >>> from bellcrank.dynamics.equations.system import system_of, system_parameters
        >>> scene = bc.load_scene("pendulum")
        >>> system = system_of(scene)
        >>> hanging = np.zeros(system.size)
        >>> rate = system.rhs(np.zeros(1), hanging, np.zeros(0), system_parameters(scene))
        >>> rate.shape == (system.size,)
        True
    """
    key = disk.digest(scene.structure_key, rows_of(scene).signature)
    with making:
        system = _systems.get(key)
        if system is None:
            system = _systems[key] = System(scene, key, len(system_parameters(scene)))
        _recent.pop(key, None)
        _recent[key] = system
        if len(_recent) > RECENT:
            del _recent[next(iter(_recent))]
        return system
