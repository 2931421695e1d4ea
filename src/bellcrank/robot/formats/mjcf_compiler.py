"""What the elements <compiler> and <option> of an MJCF file say, and its default classes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from bellcrank.messages import unknown_name
from bellcrank.robot.formats.mjcf_element import MjcfElement
from bellcrank.robot.formats.mjcf_placement import NOTATIONS, Angles
from bellcrank.robot.formats.urdf_elements import Vector3

ACTUATORS = (
    "general", "motor", "position", "velocity", "intvelocity", "orientation", "pid", "damper", "cylinder", "muscle",
    "adhesion", "dcmotor", "plugin",
)  # fmt: skip
MAIN = "main"  # the default class of elements that name none


@dataclass(frozen=True, kw_only=True)
class Compiler:
    """How the file is to be read; the defaults are MuJoCo's.

    `inertia_from_geoms` is "true" (always), "false" (never) or "auto" (for bodies without <inertial>), by the geoms
    whose group lies in `inertia_groups`. Masses (kg) and inertias (kg m²) are at least `least_mass`, `least_inertia`.
    """

    angles: Angles = field(default_factory=Angles)
    autolimits: bool = True
    inertia_from_geoms: str = "auto"
    inertia_groups: tuple[float, ...] = (0.0, 5.0)
    least_mass: float = 0.0
    least_inertia: float = 0.0
    total_mass: float | None = None
    balance_inertia: bool = False
    mesh_folder: str = ""

    @classmethod
    def of(cls, elements: Iterable[MjcfElement]) -> Compiler:
        """The <compiler> elements, the attributes of later ones before those of earlier ones. Raises InputError."""
        merged: MjcfElement | None = None
        for each in elements:
            merged = each if merged is None else replace(each, attributes={**merged.attributes, **each.attributes})
        if merged is None:
            return cls()
        sequence = merged.attributes.get("eulerseq", "xyz")
        if len(sequence) != 3 or set(sequence.lower()) - set("xyz"):
            raise merged.fail(f"eulerseq: expected three of the letters x y z X Y Z, found {sequence[:20]!r}")
        if merged.choice("coordinate", "local", "local", "global") == "global":
            raise merged.fail('coordinate="global" is not supported, as in MuJoCo since 2.3.4; write local coordinates')
        total = merged.number("settotalmass", -1.0)
        folder = merged.attributes.get("meshdir", merged.attributes.get("assetdir", ""))
        return cls(
            angles=Angles(merged.choice("angle", "degree", "degree", "radian") == "degree", sequence),
            autolimits=merged.flag("autolimits", True),
            inertia_from_geoms=merged.choice("inertiafromgeom", "auto", "true", "false", "auto"),
            inertia_groups=merged.vector("inertiagrouprange", (0.0, 5.0)),
            least_mass=merged.number("boundmass", 0.0, 0.0),
            least_inertia=merged.number("boundinertia", 0.0, 0.0),
            total_mass=total if total > 0.0 else None,
            balance_inertia=merged.flag("balanceinertia", False),
            mesh_folder=folder,
        )


def gravity_of(root: MjcfElement) -> Vector3:
    """The acceleration of gravity, m/s². Raises InputError."""
    found: Vector3 = (0.0, 0.0, -9.81)
    for option in root.find_all("option"):
        x, y, z = option.vector("gravity", found)
        found = x, y, z
    return (0.0, 0.0, 0.0) if "gravity" in disabled_flags(root) else found


class Defaults:
    """The default classes of a file: attributes of elements by class and kind of element."""

    def __init__(self, root: MjcfElement) -> None:
        self._classes: dict[str, dict[str, dict[str, str]]] = {MAIN: {}}
        for element in root.find_all("default"):
            name = element.attributes.get("class", MAIN)
            if name != MAIN:
                self._classes[name] = self._classes[MAIN]
            self._read(element, self._classes[MAIN])

    def _read(self, element: MjcfElement, own: dict[str, dict[str, str]]) -> None:
        for child in element.children:
            if child.tag != "default":
                own.setdefault("actuator" if child.tag in ACTUATORS else child.tag, {}).update(
                    {key: text for key, text in child.attributes.items() if key != "class"}
                )
        for child in element.find_all("default"):
            name = child.required("class")
            if name in self._classes:
                raise child.fail(f"the default class '{name[:80]}' is defined twice; rename one of them")
            self._classes[name] = {kind: dict(attributes) for kind, attributes in own.items()}
            self._read(child, self._classes[name])

    def check(self, element: MjcfElement, name: str) -> None:
        """Raises InputError where there is no such class."""
        if name not in self._classes:
            raise element.fail(unknown_name("default class", name, self._classes))

    def resolved(self, element: MjcfElement, kind: str, childclass: str | None = None) -> MjcfElement:
        """The element with the attributes of its class, else of the enclosing `childclass`, else of the main one.

        `kind` is the tag, "actuator" or "equality". An orientation of its own replaces one of the class, whatever its
        notation. Raises InputError.
        """
        name = element.attributes.get("class", childclass or MAIN)
        self.check(element, name)
        given = self._classes[name].get(kind, {})
        if any(key in element.attributes for key in NOTATIONS):
            given = {key: text for key, text in given.items() if key not in NOTATIONS}
        return replace(element, attributes={**given, **element.attributes})


def disabled_flags(root: MjcfElement) -> frozenset[str]:
    """The parts of the physics that <option><flag> disables. Raises InputError."""
    states: dict[str, str] = {}
    for option in root.find_all("option"):
        for flag in option.find_all("flag"):
            states |= {key: flag.choice(key, "", "enable", "disable") for key in flag.attributes}
    return frozenset(key for key, state in states.items() if state == "disable")
