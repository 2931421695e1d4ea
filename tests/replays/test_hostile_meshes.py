"""Mesh files that claim, repeat or nest what nobody could draw: a phrase, in a time that grows as the file does."""

import io
import struct
import zlib

import numpy as np
import pytest
from mesh_texts import CUBE, FACES, binary_stl, dae, no_file, visual, write_urdf

from bellcrank.replays.geometry.mesh_files import MOST_FACES, MeshError
from bellcrank.replays.geometry.mesh_simplification import weld
from bellcrank.replays.geometry.meshes import load_meshes, named_files, read_parts
from bellcrank.replays.geometry.shapes import Textures, texture_colour
from bellcrank.replays.geometry.visuals import robot_bodies

TRIANGLE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"
FACET = b"facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"


def library(nodes, used="n0"):
    """The cube's file with a library of nodes, and an instance of one of them in its scene."""
    text = dae(1.0, node="").replace(
        b"<library_visual_scenes>", b"<library_nodes>" + nodes + b"</library_nodes><library_visual_scenes>"
    )
    return text.replace(b"</visual_scene>", f'<node><instance_node url="#{used}"/></node></visual_scene>'.encode())


def doubled(levels, inner=b'<instance_geometry url="#g"/>'):
    """Nodes that each use the next one twice."""
    nodes = b"".join(
        b'<node id="n%d"><instance_node url="#n%d"/><instance_node url="#n%d"/></node>' % (k, k + 1, k + 1)
        for k in range(levels)
    )
    return library(nodes + b'<node id="n%d">' % levels + inner + b"</node>")


REFUSED = {
    "2^40 uses of a shape": (doubled(40), ".dae", "20000 parts"),
    "2^40 uses of nothing": (doubled(40, b""), ".dae", "20000 parts"),
    "nodes that use each other in a row": (
        library(b"".join(b'<node id="n%d"><instance_node url="#n%d"/></node>' % (k, k + 1) for k in range(3000))
        + b'<node id="n3000"/>'), ".dae", "in a row",
    ),
    "a billion corners of polygons": (
        dae().replace(b"triangles", b"polylist").replace(b"<p>", b"<vcount>999999999</vcount><p>"), ".dae",
        "polygon vertices",
    ),
    "elements in elements": (b"<a>" * 5000 + b"</a>" * 5000, ".dae", "250 within"),
    "half a million elements": (b"<COLLADA>" + b"<a/>" * 500_000 + b"</COLLADA>", ".dae", "400000 elements"),
    "entities in UTF-16": ('<!DOCTYPE x [<!ENTITY a "b">]><COLLADA/>'.encode("utf-16"), ".dae", "entities"),
    "a blank <ref> without its end": (b"<ref>" + b" " * 10**6, ".dae", "XML Parsing Error"),
    "too many textures": (
        b"<COLLADA>" + b"".join(b"<ref>%d</ref>" % k for k in range(2000)) + b"</COLLADA>", ".dae", "1000 textures",
    ),
    "facets that are not there": (b"\0" * 80 + struct.pack("<I", 10**9), ".stl", "truncated"),
    "a vertex of two numbers": (b"solid\n" + FACET.replace(b"0 1 0", b"0 1") + b"endsolid\n", ".stl", "broken"),
    "a triangle of two vertices": (b"solid\n" + FACET.replace(b"vertex 0 1 0", b"") + b"endsolid\n", ".stl", "broken"),
    "a vertex of 1e308": (b"v 1e308 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n", ".obj", "not finite"),
    "a vertex of 400 digits": (b"v %s 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n" % (b"9" * 400), ".obj", "not finite"),
    "a face of the vertex 0": (TRIANGLE + b"f 0 1 2\n", ".obj", "out of bounds"),
    "a face of vertices to come": (TRIANGLE + b"f 1 2 -4\n", ".obj", "out of bounds"),
    "a face of a number of 5,000 digits": (TRIANGLE + b"f 1 2 " + b"9" * 5000, ".obj", "broken"),
    "a face of two": (TRIANGLE + b"f 1 2\n", ".obj", "broken"),
    "30,000 materials": (
        TRIANGLE + b"".join(b"usemtl m%d\nf 1 2 3\n" % k for k in range(30_000)), ".obj", "20000 parts",
    ),
    "30 libraries of materials": (b"".join(b"mtllib m%d\n" % k for k in range(30)), ".obj", "material files"),
    "no bytes": (b"", ".obj", "no triangle"),
}  # fmt: skip


@pytest.mark.tier2
@pytest.mark.parametrize("what", REFUSED)
def test_a_mesh_that_claims_or_repeats_too_much_is_a_phrase(what):
    data, suffix, words = REFUSED[what]
    with pytest.raises(MeshError, match=words) as caught:
        named_files(data, suffix)
        read_parts(data, suffix, no_file)
    assert len(str(caught.value)) < 200 and "\n" not in str(caught.value)


def test_a_circle_of_nodes_does_not_hide_how_often_others_are_used():
    circle = b'<node id="a"><instance_node url="#b"/></node><node id="b"><instance_node url="#a"/></node>'
    data = doubled(40).replace(b"<library_nodes>", b"<library_nodes>" + circle)
    with pytest.raises(MeshError, match="20000 parts"):
        read_parts(data, ".dae", no_file)


def test_many_groups_materials_solids_and_kinds_of_faces_are_read_in_linear_time():
    """Each of these took minutes: they were split again at each material, solid or kind of face."""
    many = 15_000
    (part,) = read_parts(TRIANGLE + b"".join(b"usemtl m%d\nf 1 2 3\n" % k for k in range(many)), ".obj", no_file)
    assert len(part.faces) == many
    (part,) = read_parts(TRIANGLE + b"".join(b"g a%d\nf 1 2 3\nf 1 2 3 1\n" % k for k in range(many)), ".obj", no_file)
    assert len(part.faces) == 3 * many
    (part,) = read_parts((b"solid vertex\n" + FACET + b"endsolid vertex\n") * many, ".stl", no_file)
    assert len(part.faces) == many


def test_faces_count_from_the_last_vertex_so_far_and_polygons_are_fans():
    text = TRIANGLE + b"f -3/1/1 -2/2/2 -1//3\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\nf -4 -3 -1 \\\n-2\n"
    (part,) = read_parts(text, ".obj", no_file)
    expected = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 0, 1], [1, 1, 1]], [[0, 0, 1], [1, 1, 1], [0, 1, 1]]
    assert np.array_equal(part.vertices[part.faces], np.array(expected, dtype=float))


def test_many_faces_in_one_point_have_no_area():
    many = 200_000
    (part,) = read_parts(b"\0" * 80 + struct.pack("<I", many) + b"\0" * 50 * many, ".stl", no_file)
    assert len(part.faces) == many < MOST_FACES
    assert len(weld(part.vertices, part.faces)[1]) == 0


def test_empty_and_hostile_meshes_leave_stand_ins_and_notes(tmp_path):
    (tmp_path / "empty.obj").write_bytes(b"")
    (tmp_path / "nodes.dae").write_bytes(doubled(40))
    found, notes = robot_bodies(
        write_urdf(tmp_path, visual('<mesh filename="empty.obj"/>') + visual('<mesh filename="nodes.dae"/>'))
    )
    assert any("empty.obj" in note and "no triangle" in note for note in notes)
    assert any("nodes.dae" in note and "20000 parts" in note for note in notes)
    assert any(shape.placeholder for body in found for shape in body.shapes)
    assert load_meshes({tmp_path / "empty.obj": [1.0]}, 1.0).parts == {}


def png(width, height):
    """A PNG that claims so many pixels and holds none of them."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"\0" * 99)) + chunk(b"IEND", b"")


def test_textures_that_claim_too_many_pixels_or_need_other_programs_are_not_decoded():
    from PIL import Image

    assert texture_colour(png(65_500, 65_500)) is None
    assert texture_colour(b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 10 10\n%%EndComments\nshowpage\n") is None
    good = io.BytesIO()
    Image.new("RGB", (8, 8), (51, 102, 153)).save(good, "PNG")
    assert texture_colour(good.getvalue()) == (0.2, 0.4, 0.6, 1.0)
    asked = []

    def content(name):
        asked.append(name)
        return good.getvalue() if name != "large" else png(8000, 7999)

    textures = Textures(content)
    assert [textures.colour("a"), textures.colour("a")] == [(0.2, 0.4, 0.6, 1.0)] * 2 and asked == ["a"]
    textures._left = 63  # pixels, fewer than those of the next
    assert textures.colour("b") is None


def test_a_material_without_its_texture_keeps_its_own_colour():
    mtl = b"newmtl red\nKd 1 0 0\nmap_Kd gone.png\nnewmtl grey\nKd 0.5\nnewmtl light\nKd spectral file.rfl\n"
    assert named_files(mtl, ".mtl") == ("gone.png",)
    faces = b"".join(b"usemtl %s\nf 1 2 3\n" % name for name in (b"red", b"grey", b"light", b"unknown"))
    parts = read_parts(b"mtllib a.mtl\n" + TRIANGLE + faces, ".obj", {"a.mtl": mtl}.get)
    assert [part.colour for part in parts] == [(1.0, 0.0, 0.0, 1.0), (0.5, 0.5, 0.5, 1.0), None]


def test_binary_stl_is_read_as_before():
    (part,) = read_parts(binary_stl(CUBE, FACES), ".stl", no_file)
    assert np.array_equal(part.vertices[part.faces], CUBE[FACES].astype(np.float32))
