"""What `bellcrank check` says about a mechanism: whether it has a start, its gaps if not, and its mobility."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bellcrank.arrays import Array
from bellcrank.dynamics.constraints.mobility import mobility
from bellcrank.dynamics.postures.consistent_start import (
    consistent_start,
    given_posture,
    start_failure,
    starts_further_away,
)
from bellcrank.dynamics.postures.start_diagnosis import Gap
from bellcrank.errors import InputError

if TYPE_CHECKING:
    from bellcrank.replays.film.film import Film
    from bellcrank.scene.scene import Scene


@dataclass(frozen=True, eq=False, kw_only=True)
class MechanismCheck:
    """Facts about a mechanism, and the posture that shows it.

    Attributes:
        scene: The mechanism.
        posture: Its start (nq,), or the position with the smallest gaps that was found.
        facts: (name, sentence), the result first; an "error" means that there is no start.
        gaps: The constraints that are not satisfied at the posture.
    """

    scene: Scene
    posture: Array
    facts: tuple[tuple[str, str], ...]
    gaps: tuple[Gap, ...] = ()

    @property
    def has_start(self) -> bool:
        """Whether there is a consistent start."""
        return not any(name == "error" for name, _ in self.facts)

    def __str__(self) -> str:
        return "\n".join(f"  {name:<8} {text}" for name, text in self.facts)

    def film(self) -> Film:
        """The robot at the posture, with its gaps."""
        from bellcrank.replays.film.posture_films import film_of_start

        return film_of_start(self.scene, self.posture, self.gaps, self.facts)


def check_mechanism(scene: Scene) -> MechanismCheck:
    """Search the start of a scene and look at its mobility. Raises InputError where constraints are invalid."""
    failure = start_failure(scene)
    if failure is not None:
        facts = [("error", "no start was found that satisfies the constraints")]
        facts += [("gaps", text) for text in failure.sentences()]
        return MechanismCheck(scene=scene, posture=failure.posture, facts=tuple(facts), gaps=failure.gaps)
    try:
        q, _ = consistent_start(scene)
    except InputError as error:  # of velocities, or where rows are undefined
        text = str(error).removeprefix(f"{scene.source}: ")
        return MechanismCheck(scene=scene, posture=given_posture(scene), facts=(("error", text),))
    away = "a consistent start was found"
    if starts_further_away(scene):
        away += ", but not near the given posture: another branch may be meant; write guesses nearer to it ({guess: …})"
    facts = [("start", away), *(("mobility", line) for line in mobility(scene).sentences)]
    return MechanismCheck(scene=scene, posture=q, facts=tuple(facts))
