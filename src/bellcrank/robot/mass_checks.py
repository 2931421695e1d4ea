"""Checks of what the joints of a URDF move: links without mass, and joints without inertia about their axis."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from bellcrank.errors import InputError
from bellcrank.robot.articulated_inertia import articulated_inertias, vanishing_inertia
from bellcrank.robot.finding import Finding, listed, without_source
from bellcrank.robot.urdf_file import Joint, Link, Urdf


def massless_findings(links: Mapping[str, Link]) -> Iterator[Finding]:
    """The note about links that have an <inertial> of mass 0."""
    zero = [link.name for link in links.values() if link.inertial is not None and link.inertial.mass == 0.0]
    if zero:
        yield Finding("note", listed("link", zero), "an <inertial> of mass 0 is treated as no <inertial>")


def moving_without_mass(urdf: Urdf, loaded: Iterable[str] = ()) -> list[Finding]:
    """The warning about links that a joint moves and that have no mass, links fixed to them included.

    `loaded` are links that carry a payload, which counts as mass.
    """
    carried: dict[str, float] = {name: 1.0 for name in loaded}
    order = [urdf.root]
    children: dict[str, list[Joint]] = {}
    for joint in urdf.joints.values():
        children.setdefault(joint.parent, []).append(joint)
    for name in order:
        order.extend(joint.child for joint in children.get(name, ()))
    for name in reversed(order):
        inertial = urdf.links[name].inertial
        fixed = (joint.child for joint in children.get(name, ()) if joint.type == "fixed")
        carried[name] = carried.get(name, 0.0) + (inertial.mass if inertial else 0.0) + sum(carried[x] for x in fixed)
    moved = {joint.child for joint in urdf.joints.values() if joint.type != "fixed"}
    bare = [name for name in order if name in moved and carried[name] == 0.0 and not urdf.links[name].between_axes]
    if not bare:
        return []
    one = len(bare) == 1
    missing = "no <inertial>" if all(urdf.links[name].inertial is None for name in bare) else "an <inertial> of mass 0"
    text = (
        f"{'moves' if one else 'move'} with a joint and {'has' if one else 'have'} no mass ({missing}): the torques "
        f"do not include "
        f"{'its' if one else 'their'} weight and inertia; add an <inertial> unless the real part has no mass"
    )
    return [Finding("warning", listed("link", bare), text)]


def articulated_findings(urdf: Urdf, already_wrong: bool) -> Iterator[Finding]:
    """The errors about joints whose inertia about their own axis vanishes, or is negative unless `already_wrong`."""
    try:
        inertias = articulated_inertias(urdf)
    except InputError as problem:
        yield Finding("error", "robot", without_source(urdf.source, str(problem)))
        return
    for name, (least, threshold) in inertias.items():
        what = "mass" if urdf.joints[name].type == "prismatic" else "inertia"
        if abs(least) <= threshold:
            yield Finding("error", f"joint '{name}'", vanishing_inertia(urdf, name, least))
        elif least < 0.0 and not already_wrong:
            yield Finding(
                "error",
                f"joint '{name}'",
                f"the {what} that it moves is negative ({least:.3g}): kinetic energy would be negative; check masses "
                f"and inertias",
            )
