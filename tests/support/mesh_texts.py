"""Meshes as texts of mesh files, and a URDF that draws them."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

import bellcrank as bc

CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]  # outward
FACES = np.array([t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))])


def no_file(name: str) -> None:
    return None


def ball(rows: int, radius: float = 1.0):
    """A closed sphere of triangles, seen counter-clockwise from outside."""
    polar = np.linspace(0.0, np.pi, rows + 1)[1:-1]
    around = np.linspace(0.0, 2.0 * np.pi, 2 * rows, endpoint=False)
    rings = [[(np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), np.cos(p)) for a in around] for p in polar]
    points = np.array([(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), *(x for ring in rings for x in ring)]) * radius
    n, faces = len(around), []
    for k in range(n):
        m = (k + 1) % n
        faces += [(0, 2 + k, 2 + m), (1, 2 + (rows - 2) * n + m, 2 + (rows - 2) * n + k)]
        for r in range(rows - 2):
            a, b, c, d = (2 + (r + i) * n + j for i, j in ((0, k), (1, k), (1, m), (0, m)))
            faces += [(a, b, c), (a, c, d)]
    return points, np.array(faces)


def volume(vertices, faces):
    """The volume within a closed surface, by the divergence theorem."""
    a, b, c = (vertices[column] for column in np.asarray(faces).T)
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


def binary_stl(vertices, faces):
    corners = np.asarray(vertices)[faces].astype("<f4").reshape(-1, 9)
    return b"\0" * 80 + struct.pack("<I", len(faces)) + b"".join(b"\0" * 12 + c.tobytes() + b"\0\0" for c in corners)


def ascii_stl(vertices, faces):
    lines = ["solid thing"]
    for face in faces:
        lines += [
            "facet normal 0 0 0",
            "outer loop",
            *(f"vertex {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices[face]),
        ]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid thing"]).encode()


def obj(extra=""):
    lines = [f"v {x} {y} {z}" for x, y, z in CUBE]
    for k, quad in enumerate(QUADS):
        lines.append("usemtl red" if k < 2 else "usemtl blue")
        lines.append("f " + " ".join(f"{corner + 1}//1" if k % 2 else str(corner - 8) for corner in quad))
    return (extra + "\n".join(lines)).encode()


def dae(unit=0.5, colour="<color>0.1 0.2 0.3 1</color>", p=None, node="<translate>0 0 2</translate>"):
    counts = " ".join(["4"] * 6)
    corners = p or " ".join(f"{corner} 0" for quad in QUADS for corner in quad)
    numbers = " ".join(f"{x:g}" for x in CUBE.ravel())
    return f"""<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="{unit}"/><up_axis>Y_UP</up_axis></asset>
<library_images><image id="picture"><init_from>a%20picture.png</init_from></image></library_images>
<library_effects><effect id="e"><profile_COMMON>
<newparam sid="s"><surface type="2D"><init_from>picture</init_from></surface></newparam>
<newparam sid="t"><sampler2D><source>s</source></sampler2D></newparam>
<technique sid="c"><phong><diffuse>{colour}</diffuse></phong></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="f" count="24">{numbers}</float_array>
<technique_common><accessor source="#f" count="8" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor>
</technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist count="6" material="x"><input semantic="VERTEX" source="#v" offset="0"/>
<input semantic="NORMAL" source="#p" offset="1"/><vcount>{counts}</vcount><p>{corners}</p></polylist>
</mesh></geometry></library_geometries>
<library_nodes><node id="n"><instance_geometry url="#g"><bind_material><technique_common>
<instance_material symbol="x" target="#m"/></technique_common></bind_material></instance_geometry>
</node></library_nodes>
<library_visual_scenes><visual_scene id="scene"><node>{node}<rotate>0 0 1 90</rotate><instance_node url="#n"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#scene"/></scene></COLLADA>""".encode()


def write_urdf(folder: Path, visual: str, materials: str = "", name: str = "arm"):
    path = folder / "robot.urdf"
    path.write_text(f"""<robot name="r">{materials}<link name="base"/><link name="{name}"><inertial><mass value="1"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>{visual}</link>
<joint name="j" type="continuous"><parent link="base"/><child link="{name}"/><origin xyz="0 0 1"/></joint></robot>""")
    return bc.load_robot(path)


def visual(geometry, rest=""):
    return f"<visual>{rest}<geometry>{geometry}</geometry></visual>"
