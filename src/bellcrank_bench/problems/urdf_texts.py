"""URDF texts of the mechanisms of the reference problems: rods, point masses, chains, a free body, a disk."""

from __future__ import annotations

from collections.abc import Sequence

from bellcrank_bench.textbook.planar_2r import PlanarTwoLink

THIN = 1e-3  # kg m²: about a rod's own axis, without influence on a planar motion


def link(name: str, mass: float = 0.0, cg: Sequence[float] = (0, 0, 0), inertia: Sequence[float] = (0, 0, 0)) -> str:
    """A link: mass in kg, CG (3) in m, principal inertias (3) about it in kg m²; without mass an empty one."""
    if not mass:
        return f'<link name="{name}"/>'
    xx, yy, zz = (repr(float(x)) for x in inertia)
    return (
        f'<link name="{name}"><inertial><origin xyz="{_numbers(cg)}"/><mass value="{float(mass)!r}"/>'
        f'<inertia ixx="{xx}" ixy="0" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/></inertial></link>'
    )


def joint(
    name: str, kind: str, parent: str, child: str, xyz: Sequence[float] = (0, 0, 0), axis: Sequence[float] = (0, 0, 1)
) -> str:
    """A joint at xyz (3), m, in the parent link, with limits that no problem reaches."""
    limit = '<limit lower="-1000" upper="1000" effort="1e9" velocity="1e9"/>' if kind == "prismatic" else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_numbers(xyz)}"/><axis xyz="{_numbers(axis)}"/>{limit}</joint>'
    )


def robot(name: str, *parts: str) -> str:
    """A whole URDF."""
    return f'<robot name="{name}">{"".join(parts)}</robot>'


def two_link(arm: PlanarTwoLink) -> str:
    """The planar 2R arm of these numbers, joints `shoulder` and `elbow` about z, with the end of link 2 named `tip`."""
    return robot(
        "two_link",
        link("base"),
        link("link_1", arm.m1, (arm.r1, 0, 0), (arm.i1 * THIN, arm.i1, arm.i1)),
        link("link_2", arm.m2, (arm.r2, 0, 0), (arm.i2 * THIN, arm.i2, arm.i2)),
        link("tip"),
        joint("shoulder", "continuous", "base", "link_1"),
        joint("elbow", "continuous", "link_1", "link_2", (arm.l1, 0, 0)),
        joint("tip_mount", "fixed", "link_2", "tip", (arm.l2, 0, 0)),
    )


def upright_pendulum() -> str:
    """A point mass of 1 kg, 1 m above the joint `swing`, which is 0 upright."""
    return robot(
        "upright_pendulum", link("base"), link("rod", 1.0, (0, 1, 0)), joint("swing", "continuous", "base", "rod")
    )


def cart_pole(cart: float) -> str:
    """A cart (mass in kg) on a rail along x, joint `slide`, and a point mass of 1 kg 1 m below, joint `swing`."""
    return robot(
        "cart_pole",
        link("rail"), link("cart", cart), link("pole", 1.0, (0, -1, 0)),
        joint("slide", "prismatic", "rail", "cart", axis=(1, 0, 0)),
        joint("swing", "continuous", "cart", "pole"),
    )  # fmt: skip


def free_body(inertia: Sequence[float]) -> str:
    """A body of 1 kg with these principal inertias (3), kg m², about its frame's axes."""
    return robot("free_body", link("body", 1.0, (0, 0, 0), inertia))


def chain(links: int) -> str:
    """Uniform rods of 1 m and 1 kg in a row along x, all joints (`joint_1`, …) about z."""
    parts = [link("link_0")]
    for k in range(1, links + 1):
        parts.append(link(f"link_{k}", 1.0, (0.5, 0, 0), (THIN, 1 / 12, 1 / 12)))
        parts.append(joint(f"joint_{k}", "continuous", f"link_{k - 1}", f"link_{k}", (float(k > 1), 0, 0)))
    return robot(f"chain_{links}", *parts)


def rolling_disk(radius: float = 0.1, k: float = 0.25, mass: float = 0.5) -> str:
    """A thin disk or hoop in the lecture's six coordinates: joints x, y, z, heading, tilt, spin.

    The diametral inertia is k m r², the axial one, about y, 2 k m r²; radius in m, mass in kg.
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
        body = link(child, mass, (0, 0, 0), (inertia, 2 * inertia, inertia)).replace("</link>", _marked(radius))
        parts.append(body if last else f'<link name="{child}">{_DOT}</link>')
        parts.append(joint(name, kind, parent, child, axis=axis))
        parent = child
    return "\n  ".join(['<robot name="thin_disk_six">', *parts]) + "\n</robot>\n"


# the look of links that only connect two joints
_DOT = '<visual><geometry><sphere radius="0.001"/></geometry></visual>'


def _marked(radius: float) -> str:
    """The look of a disk about y, with a cross and a dot that show its spin, and the end of its link."""
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


def _numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(x)) for x in values)
