"""Closed linkages made by a factory: the N four-bar mechanism for any N, rods between points, disks of any lean."""

from __future__ import annotations

from bellcrank.errors import InputError
from bellcrank.scene.scene import Scene
from bellcrank_bench.problems import urdf_texts as urdf
from bellcrank_bench.problems.problem import scene_of

MOST_LOOPS = 1000
ROD = 1 / 12  # kg m²: a uniform rod of 1 kg and 1 m about its middle


def n_four_bar(loops: int) -> Scene:
    """The N four-bar mechanism of the IFToMM library of computational benchmark problems (A02), for 10 s.

    N + 1 cranks on the ground 1 m apart, their tops joined by N couplers; all uniform rods of 1 m and 1 kg. It starts
    upright with the top of the first crank, frame `B0`, moving at 1 m/s along x. Raises InputError for N below 1.
    """
    import yaml

    text, scene = n_four_bar_texts(loops)
    return scene_of(text, yaml.safe_load(scene))


def n_four_bar_texts(loops: int) -> tuple[str, str]:
    """Its URDF and its scene file as texts; joints `crank_0`, `coupler_0`, `crank_1`, …, 0 where it starts."""
    if not 1 <= loops <= MOST_LOOPS:
        raise InputError(f"n_four_bar: expected 1 to {MOST_LOOPS} loops, found {loops}")
    parts = [urdf.link("ground")]
    for k in range(loops + 1):
        parts.append(urdf.link(f"crank_link_{k}", 1.0, (0, 0.5, 0), (ROD, 0, ROD)))
        parts.append(urdf.joint(f"crank_{k}", "continuous", "ground", f"crank_link_{k}", (k, 0, 0)))
        if k < loops:
            parts.append(urdf.link(f"coupler_link_{k}", 1.0, (0.5, 0, 0), (0, ROD, ROD)))
            parts.append(urdf.joint(f"coupler_{k}", "continuous", f"crank_link_{k}", f"coupler_link_{k}", (0, 1, 0)))
    name = f"n_four_bar_{loops}"
    robot = "\n  ".join([f'<robot name="{name}">', *parts]) + "\n</robot>\n"
    lines = [
        f"# {loops + 1} cranks and {loops} couplers of 1 m and 1 kg, upright at first: A02 of the IFToMM library of "
        "benchmark problems.",
        f"name: N four-bar, N = {loops}",
        f"urdf: {name}",
        "gravity: [0, -9.81, 0]                  # m/s^2",
        "frames:",
        *(f"  B{k}: {{link: crank_link_{k}, xyz: [0, 1, 0]}}" for k in range(loops + 1)),
        *(f"  C{k}: {{link: coupler_link_{k}, xyz: [1, 0, 0]}}" for k in range(loops)),
        "constraints:",
        *(f"  - {{name: top_{k + 1}, kind: point, frame_a: C{k}, frame_b: B{k + 1}}}" for k in range(loops)),
        "initial: {crank_0: 0, velocity: {crank_0: -1}}       # rad/s; the rest follows",
        "outputs:",
        "  B0: {frame: B0, what: position}",
        "  energy: {energy: total}",
        f"simulate: {{duration: {10 if loops < 40 else 20}, solver: DOP853, rtol: 1.0e-10, atol: 1.0e-10}}",
    ]
    return '<?xml version="1.0"?>\n' + robot, "\n".join(lines) + "\n"


def disk_urdf(radius: float = 0.1, k: float = 0.25, mass: float = 0.5) -> str:
    """A thin disk or hoop on the lecture's six coordinates: joints x, y, z, heading, tilt, spin (textbook_closed.py).

    The diametral inertia is k m r², the axial one, about y, 2 k m r².
    """
    inertia = k * mass * radius**2
    parts = [f'<link name="floor">{_DOT}</link>']
    chain = [
        ("x", "prismatic", (1, 0, 0)), ("y", "prismatic", (0, 1, 0)), ("z", "prismatic", (0, 0, 1)),
        ("heading", "continuous", (0, 0, 1)), ("tilt", "continuous", (1, 0, 0)), ("spin", "continuous", (0, 1, 0)),
    ]  # fmt: skip
    parent = "floor"
    for name, kind, axis in chain:
        last = name == "spin"
        child = "disk" if last else f"{name}_frame"
        body = urdf.link(child, mass, (0, 0, 0), (inertia, 2 * inertia, inertia)).replace("</link>", _marked(radius))
        parts.append(body if last else f'<link name="{child}">{_DOT}</link>')
        parts.append(urdf.joint(name, kind, parent, child, axis=axis))
        parent = child
    return "\n  ".join(['<robot name="thin_disk_six">', *parts]) + "\n</robot>\n"


# a frame that nothing is to be seen of
_DOT = '<visual><geometry><sphere radius="0.001"/></geometry></visual>'


def _marked(radius: float) -> str:
    """What a disk about y looks like, with a cross and a dot that show its spin; and the end of its link."""
    flat = "1.5707963267948966 0 0"
    looks = [
        (f'<cylinder radius="{radius!r}" length="{0.04 * radius:.4g}"/>', (0, 0, 0), flat, "0.16 0.38 0.58 1"),
        (
            f'<box size="{1.8 * radius:.4g} {0.05 * radius:.4g} {0.12 * radius:.4g}"/>',
            (0, 0, 0),
            "0 0 0",
            "0.93 0.94 0.95 1",
        ),
        (
            f'<box size="{0.12 * radius:.4g} {0.05 * radius:.4g} {1.8 * radius:.4g}"/>',
            (0, 0, 0),
            "0 0 0",
            "0.93 0.94 0.95 1",
        ),
        (
            f'<cylinder radius="{0.13 * radius:.4g}" length="{0.06 * radius:.4g}"/>',
            (0.7 * radius, 0, 0),
            flat,
            "0.9 0.62 0 1",
        ),
    ]
    shapes = [
        f'<visual><origin xyz="{x:.4g} {y} {z}" rpy="{turn}"/><geometry>{solid}</geometry>'
        f'<material name=""><color rgba="{colour}"/></material></visual>'
        for solid, (x, y, z), turn, colour in looks
    ]  # fmt: skip
    return "".join(f"\n    {shape}" for shape in shapes) + "</link>"
