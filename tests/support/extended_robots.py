"""Texts of robots with spherical, universal and screw joints."""

INERTIA = '<inertia ixx="0.02" ixy="0.001" ixz="0.002" iyy="0.03" iyz="-0.001" izz="0.025"/>'


def link(name, xyz="0.1 0.05 -0.8", mass=1.3, inertia=INERTIA):
    return f'<link name="{name}"><inertial><origin xyz="{xyz}"/><mass value="{mass}"/>{inertia}</inertial></link>'


def joint(name, kind, parent, child, inner="", origin="", attributes=""):
    return (
        f'<joint name="{name}" type="{kind}" {attributes}>{origin}<parent link="{parent}"/><child link="{child}"/>'
        f"{inner}</joint>"
    )


def diagonal(xx, yy, zz):
    return f'<inertia ixx="{xx}" ixy="0" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/>'


MIXED = "\n".join(
    [
        '<robot name="mixed"><link name="world"/>',
        link("bob"),
        link("arm", "0.1 0.05 -0.3", 0.7),
        link("nut", "0.2 0 -0.1", 0.4),
        joint("ball", "spherical", "world", "bob", origin='<origin xyz="0.3 0.2 0.1" rpy="0.4 0.3 0.2"/>'),
        joint("cardan", "universal", "bob", "arm", '<axis xyz="1 0 0"/>', '<origin xyz="0 0 -0.8"/>'),
        joint(
            "screw", "screw", "arm", "nut",
            '<axis xyz="0.6 0 0.8"/><limit lower="-1" upper="2" effort="3" velocity="4"/>',
            '<origin xyz="0 0.1 -0.8"/>', 'pitch="0.1"',
        ),
        "</robot>",
    ]
)  # fmt: skip

TOP = "\n".join(
    [
        '<robot name="top"><link name="world"/>',
        link("body", "0 0 0.2", 0.5, diagonal(0.004, 0.004, 0.003)),
        joint("ball", "spherical", "world", "body"),
        "</robot>",
    ]
)

BOLT = "\n".join(
    [
        '<robot name="bolt"><link name="world"/>',
        link("nut", "0 0 0", 0.8, diagonal(0.002, 0.002, 0.003)),
        joint("screw", "screw", "world", "nut", '<axis xyz="0 0 1"/>', attributes='pitch="0.4"'),
        "</robot>",
    ]
)


def three_revolutes(urdf, name, child):
    """The robot with its spherical joint `name` replaced by revolute joints about x, y and z in this order."""
    found = urdf.replace(f'<joint name="{name}" type="spherical" >', f'<joint name="{name}_x" type="continuous" >')
    found = found.replace(f'<child link="{child}"/>', f'<child link="{child}_x"/><axis xyz="1 0 0"/>')
    rest = f'<link name="{child}_x"/><link name="{child}_y"/>'
    rest += joint(f"{name}_y", "continuous", f"{child}_x", f"{child}_y", '<axis xyz="0 1 0"/>')
    rest += joint(f"{name}_z", "continuous", f"{child}_y", child, '<axis xyz="0 0 1"/>')
    return found.replace("</robot>", rest + "</robot>")
