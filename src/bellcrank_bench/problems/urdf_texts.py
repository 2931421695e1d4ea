"""URDF texts of the reference problems' mechanisms: rods, point masses, chains, a free body."""

from __future__ import annotations

from collections.abc import Sequence

from bellcrank_bench.textbook.open_chains import PlanarTwoLink

THIN = 1e-3  # kg m²: about a rod's own axis, which a motion in the plane never asks for


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
    """A joint at xyz (3), m, in the parent link; without limits that matter."""
    limit = '<limit lower="-1000" upper="1000" effort="1e9" velocity="1e9"/>' if kind == "prismatic" else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_numbers(xyz)}"/><axis xyz="{_numbers(axis)}"/>{limit}</joint>'
    )


def robot(name: str, *parts: str) -> str:
    """A whole URDF."""
    return f'<robot name="{name}">{"".join(parts)}</robot>'


def two_link(arm: PlanarTwoLink) -> str:
    """The planar 2R arm of these numbers, joints `shoulder` and `elbow` about z, the end of link 2 named `tip`."""
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
    """A point mass of 1 kg 1 m above the joint `swing`, which is 0 where it stands."""
    return robot(
        "upright_pendulum", link("base"), link("rod", 1.0, (0, 1, 0)), joint("swing", "continuous", "base", "rod")
    )


def cart_pole(cart: float) -> str:
    """A cart (kg) on a rail along x, joint `slide`, and a point mass of 1 kg 1 m below it, joint `swing`."""
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


def _numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(x)) for x in values)
