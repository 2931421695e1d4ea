"""What an MJCF file says and is not modelled, one sentence each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from bellcrank.notes import Note, Omission
from bellcrank.robot.formats.mjcf_bodies import MjcfBody
from bellcrank.robot.formats.mjcf_element import MjcfElement
from bellcrank.robot.formats.mjcf_meshes import MjcfMeshes
from bellcrank.robot.formats.mjcf_urdf import Visuals
from bellcrank.robot.formats.urdf_writing import listed

PLACING = "name class childclass pos quat axisangle xyaxes zaxis euler user group"
DRAWING = "material rgba fitscale hfield castshadow"
CONTACT = (
    "contype conaffinity condim priority friction solmix margin gap adhesion surfacevel solref solimp solreflimit "
    "solimplimit solreffriction solimpfriction"
)
KNOWN: Final = {  # attributes that are used, or of which a sentence below speaks
    "body": f"{PLACING} mocap gravcomp fuse simple sleep",
    "joint": f"{PLACING} {CONTACT} type axis ref range limited stiffness damping frictionloss armature springref "
    "actuatorfrcrange actuatorfrclimited springdamper springyield",
    "freejoint": "name group",
    "geom": f"{PLACING} {DRAWING} {CONTACT} type size fromto mesh mass density shellinertia",
    "site": f"{PLACING} {DRAWING} type size fromto mesh",
    "inertial": f"{PLACING} mass diaginertia fullinertia",
    "frame": PLACING,
    "replicate": "count offset euler sep childclass",
    "compiler": "angle eulerseq autolimits inertiafromgeom inertiagrouprange boundmass boundinertia settotalmass "
    "balanceinertia meshdir texturedir assetdir discardvisual fusestatic strippath fitaabb usethread convexhull "
    "conflict coordinate saveinertial savecanonical savecompiled exactmeshinertia passthrough",
    "connect": "name class body1 body2 anchor site1 site2 active solref solimp",
    "weld": "name class body1 body2 anchor relpose torquescale site1 site2 active solref solimp",
    "key": "name qpos qvel ctrl act time mpos mquat plastic",
}  # fmt: skip
FLAGS: Final = ("gravity", "equality", "spring", "damper", "passive", "frictionloss")  # that are obeyed where disabled
QUIET: Final = ("visual", "statistic", "size", "custom", "extension", "sensor", "contact")
IN_BODIES: Final = ("light", "camera", "plugin")
TENDON_FORCES: Final = frozenset(("stiffness", "damping", "frictionloss", "limited", "range", "class"))
FLUID: Final = ("density", "viscosity", "wind", "magnetic")


def notes_of(root: MjcfElement, bodies: Sequence[MjcfBody], visuals: Visuals, meshes: MjcfMeshes) -> list[str]:
    """The sentences about a file."""
    return [
        *_contacts(bodies),
        *_joints(bodies),
        *_bodies(bodies),
        *_sections(root),
        *_options(root),
        *_attributes(root),
        *_drawing(visuals, meshes),
    ]


def _contacts(bodies: Sequence[MjcfBody]) -> Iterator[str]:
    shapes = [shape for body in bodies for shape in body.shapes]
    count = sum(shape.collides for shape in shapes)
    if count:
        yield Note(f"contacts are not modelled: {count} of {len(shapes)} shapes may collide in MuJoCo.", "changes")


def _joints(bodies: Sequence[MjcfBody]) -> Iterator[str]:
    joints = [joint for body in bodies for joint in body.joints]
    several = [joint for joint in joints if joint.kind in ("ball", "free")]
    free = [joint for joint in several if joint.kind == "free"]
    force: Omission = "force"
    nothing: Omission = ""
    unused = {
        "the stiffness of free joints is not used": (force, [j for j in free if j.stiffness[0]]),
        "damping, friction and armature of free joints are not used": (
            force, [j for j in free if j.damping[0] or j.friction or j.armature],
        ),
        "the range of ball joints is not used": (nothing, [j for j in several if j.range is not None]),
        "of stiffness and damping only the first, linear coefficient is used": (
            force, [j for j in joints if any((*j.stiffness[1:], *j.damping[1:]))],
        ),
        "springyield is not used": (force, [j for j in joints if "springyield" in j.element.attributes]),
    }  # fmt: skip
    for sentence, (omits, found) in unused.items():
        if found:
            yield Note(f"{sentence} ({listed([joint.name for joint in found])}).", "changes", omits)


def _bodies(bodies: Sequence[MjcfBody]) -> Iterator[str]:
    buoyant = [body.name for body in bodies[1:] if body.element.number("gravcomp", 0.0)]
    if buoyant:
        text = f"gravcomp is not used: the bodies have their full weight ({listed(buoyant)})."
        yield Note(text, "changes", "gravity")
    unknown = [body.name for body in bodies if body.has_unknown_mass]
    if unknown:
        text = f"the mass of still bodies is unknown and left out, as a mesh file is missing ({listed(unknown)})."
        yield Note(text, "changes")
    held = [body.name for body in bodies[1:] if body.element.flag("mocap", False)]
    if held:
        yield f"mocap bodies stand still ({listed(held)})."


def _sections(root: MjcfElement) -> Iterator[str]:
    found = {element.tag for element in root.children if element.children or element.attributes}
    found |= {element.tag for world in root.find_all("worldbody") for element in world.walk()} & {*IN_BODIES}
    quiet = [tag for tag in (*QUIET, *IN_BODIES) if tag in found]
    if quiet:
        yield f"not used: {', '.join(f'<{tag}>' for tag in quiet)}."
    for tag, what in (("tendon", "tendons"), ("deformable", "deformable bodies")):
        found_here = [element for section in root.find_all(tag) for element in section.children]
        if found_here:
            acts = tag == "deformable" or any(map(_acts, found_here))
            text = f"{len(found_here)} {what} are not modelled, nor are their springs, damping and limits."
            yield Note(text, "changes", "force" if acts else "")
    if any(section.children for section in root.find_all("equality")):
        yield "closed loops and couplings are exact: MuJoCo's softness (solref, solimp) is not used."
    known = {*KNOWN, *QUIET, *_TAKEN}
    for element in root.children:
        if element.tag not in known:
            yield Note(f"line {element.line}: <{element.tag[:40]}> is not known and not used.", "changes")


_TAKEN: Final = ("worldbody", "asset", "option", "default", "equality", "actuator", "keyframe", "tendon", "deformable")


def _acts(tendon: MjcfElement) -> bool:
    """Whether a tendon may exert a force without an actuator."""
    given = [value for key, value in tendon.attributes.items() if key in TENDON_FORCES]
    return any(value.strip().lower() != "false" and value.replace("0", "").strip(" .") for value in given)


def _options(root: MjcfElement) -> Iterator[str]:
    options = list(root.find_all("option"))
    fluid = [key for option in options for key in FLUID[:3] if any(option.numbers(key, 1, 3) or ())]
    if fluid:
        moving = any(any(option.numbers(key, 1, 3) or ()) for option in options for key in FLUID[:2])
        text = f"forces of a fluid are not modelled ({', '.join(fluid)} of <option>)."
        yield Note(text, "changes", "force" if moving else "")  # wind acts where there is a fluid
    solver = sorted({key for option in options for key in option.attributes} - {"gravity", *FLUID})
    if solver:
        yield f"MuJoCo's solver settings are not used ({', '.join(solver)})."
    flags = [key for o in options for f in o.find_all("flag") for key in f.attributes if key not in FLAGS]
    if flags:
        yield Note(f"flags of <option> are not used ({', '.join(flags)}).", "changes")


def _attributes(root: MjcfElement) -> Iterator[str]:
    """Attributes that bellcrank does not know, such as those of newer versions of MuJoCo, or misspelt ones."""
    lines: dict[tuple[str, str], list[int]] = {}
    for section in root.find_all("worldbody", "compiler", "default", "keyframe"):
        for element in section.walk():
            known = KNOWN.get(element.tag, "").split()
            for key in element.attributes:
                if known and key not in known:
                    lines.setdefault((element.tag, key), []).append(element.line)
    for (tag, key), where in lines.items():
        yield f"line {listed(list(map(str, where)))}: {key[:40]} of <{tag}> is not used."


def _drawing(visuals: Visuals, meshes: MjcfMeshes) -> Iterator[str]:
    if visuals.undrawn:
        yield f"shapes of these kinds are not drawn: {', '.join(sorted(visuals.undrawn))}."
    missing = meshes.missing()
    if missing:
        yield f"mesh files are missing and not drawn: {listed(missing)}."
