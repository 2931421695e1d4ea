"""Names of bodies, joints and sites of an MJCF file, all different; those without a name get one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from bellcrank.robot.formats.mjcf_bodies import WORLD, MjcfBody
from bellcrank.robot.formats.mjcf_element import MjcfElement

MOST_LISTED = 6  # names in one sentence


def named(bodies: Sequence[MjcfBody]) -> list[MjcfBody]:
    """The bodies, every body and joint with a name of its own, unnamed sites left out.

    MuJoCo keeps names of bodies, joints and sites apart. Bodies and sites become links of one robot: a site with the
    name of a body is the link "site NAME". Raises InputError where a name is given twice.
    """
    _check_unique([(body.name, body.element) for body in bodies])
    _check_unique([(joint.name, joint.element) for body in bodies for joint in body.joints])
    _check_unique([(site.name, body.element) for body in bodies for site in body.sites])
    links = Names([body.name for body in bodies])
    joints = Names([joint.name for body in bodies for joint in body.joints])
    result: list[MjcfBody] = []
    for body in bodies:
        name = body.name or links.new(f"{result[body.parent].name}_child")
        fitted = tuple(replace(joint, name=joint.name or joints.new(f"{name}_{joint.kind}")) for joint in body.joints)
        sites = tuple(replace(site, link=links.new(site.name, f"site {site.name}")) for site in body.sites if site.name)
        result.append(replace(body, name=name, joints=fitted, sites=sites))
    return result


class Names:
    """Names that are taken."""

    def __init__(self, taken: Iterable[str]) -> None:
        self._taken = {WORLD, *taken}
        self._counts: dict[str, int] = {}

    def new(self, *wishes: str) -> str:
        """The first wish that is free, else the last one with a number; it is taken then."""
        for wish in wishes:
            if wish not in self._taken:
                self._taken.add(wish)
                return wish
        count = self._counts.get(wishes[-1], 1)
        while f"{wishes[-1]}_{count + 1}" in self._taken:
            count += 1
        self._counts[wishes[-1]] = count + 1
        found = f"{wishes[-1]}_{count + 1}"
        self._taken.add(found)
        return found


def listed(names: Sequence[str]) -> str:
    """The first names of several, and how many there are."""
    more = f", … ({len(names)} in all)" if len(names) > MOST_LISTED else ""
    return ", ".join(names[:MOST_LISTED]) + more


def _check_unique(names: Sequence[tuple[str, MjcfElement]]) -> None:
    seen: dict[str, MjcfElement] = {}
    for name, element in names:
        if name in seen and name:
            raise element.fail(
                f"the name '{name[:80]}' is used twice, also in line {seen[name].line}; rename one of them"
            )
        seen[name] = element
