"""What a replay draws of a robot: URDF visuals, mesh files, simplified surfaces, and stand-ins."""

from __future__ import annotations

import struct

import numpy as np
import pinocchio as pin
import pytest
from mesh_texts import CUBE, FACES, QUADS, ascii_stl, ball, binary_stl, dae, no_file, obj, visual, volume, write_urdf

import bellcrank as bc
from bellcrank.replays.geometry.mesh_files import MeshError
from bellcrank.replays.geometry.mesh_simplification import Simplifier, weld
from bellcrank.replays.geometry.meshes import named_files, read_parts
from bellcrank.replays.geometry.visuals import robot_bodies


def body_of(found, name):
    return next(body for body in found if body.name == name)


# ---- mesh files


@pytest.mark.parametrize(
    ("data", "suffix"),
    [(binary_stl(CUBE, FACES), ".stl"), (ascii_stl(CUBE, FACES), ".STL"), (obj(), ".obj"), (dae(1.0, node=""), ".dae")],
)
def test_every_kind_of_file_gives_the_cube_with_its_faces_outward(data, suffix):
    parts = read_parts(data, suffix, no_file)
    assert sum(len(part.faces) for part in parts) == 12
    assert sum(volume(part.vertices, part.faces) for part in parts) == pytest.approx(1.0, abs=1e-6)


def test_binary_stl_whose_header_begins_with_solid_is_read_as_binary():
    data = b"solid" + binary_stl(CUBE, FACES)[5:]
    assert len(read_parts(data, ".stl", no_file)[0].faces) == 12


def test_obj_takes_colours_from_its_material_file_and_opacity():
    mtl = b"newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 2\nd 0.5\n"
    parts = read_parts(obj("mtllib some colours.mtl\n"), ".obj", {"some colours.mtl": mtl}.get)
    assert {part.colour: len(part.faces) for part in parts} == {(1.0, 0.0, 0.0, 1.0): 4, (0.0, 0.0, 1.0, 0.5): 8}
    assert named_files(obj("mtllib some colours.mtl\n"), ".obj") == ("some colours.mtl",)


def test_collada_applies_unit_and_nodes_and_not_the_up_axis():
    (part,) = read_parts(dae(0.5), ".dae", no_file)
    corners = part.vertices[part.faces].reshape(-1, 3)
    assert corners.min(axis=0) == pytest.approx([-0.5, 0.0, 1.0], abs=1e-6)
    assert corners.max(axis=0) == pytest.approx([0.0, 0.5, 1.5], abs=1e-6)
    assert volume(part.vertices, part.faces) == pytest.approx(0.125)
    assert part.colour == (0.1, 0.2, 0.3, 1.0)


def test_collada_texture_becomes_its_mean_colour_or_grey(tmp_path):
    from PIL import Image

    picture = Image.new("RGB", (4, 2), (255, 0, 0))
    picture.paste((0, 0, 255), (0, 0, 2, 2))
    picture.save(tmp_path / "a picture.png")
    data = dae(colour='<texture texture="t" texcoord="u"/>')
    (part,) = read_parts(data, ".dae", lambda name: (tmp_path / name).read_bytes())
    assert part.colour == (0.5, 0.0, 0.5, 1.0)
    assert read_parts(data, ".dae", no_file)[0].colour == (0.7, 0.7, 0.7, 1.0)


@pytest.mark.tier2
@pytest.mark.parametrize(
    ("data", "suffix", "said"),
    [
        (b"", ".stl", "no STL"),
        (binary_stl(CUBE, FACES)[:-7], ".stl", "truncated"),
        (ascii_stl(CUBE, FACES)[:-60], ".stl", "truncated"),
        (binary_stl(CUBE, FACES[:0]), ".stl", "no triangle"),
        (b"\0" * 80 + struct.pack("<I", 2**32 - 1), ".stl", "truncated"),
        (binary_stl(CUBE * np.nan, FACES), ".stl", "not finite"),
        (ascii_stl(CUBE, FACES).replace(b"vertex 0", b"vertex x", 1), ".stl", "broken"),
        (b"v 0 0 0\nf 1 2 3\n", ".obj", "out of bounds"),
        (b"v 0 0 0\nf 1 1 -7\n", ".obj", "out of bounds"),
        (b"v 0 0\nv 1 0 0\nf 1 1 2\n", ".obj", "broken"),
        (b"hello", ".obj", "no triangle"),
        (dae()[:-40], ".dae", "XML Parsing Error"),
        (dae(p="0 0 1 0"), ".dae", "broken"),
        (dae(p=" ".join(["99 0"] * 24)), ".dae", "beyond"),
        (dae(unit="nan"), ".dae", "not finite"),
        (dae(node='<instance_node url="#n"/>' * 30_000), ".dae", "20000 parts"),
        (dae().replace(b'<node id="n">', b'<node id="n"><instance_node url="#n"/>'), ".dae", "not found"),
        (dae().replace(b"<COLLADA", b'<!DOCTYPE x [<!ENTITY a "b">]><COLLADA', 1), ".dae", "entities"),
        (b"<svg/>", ".dae", "no triangle"),
        (b"glTF", ".glb", "kind '.glb'"),
    ],
)
def test_a_broken_file_says_what_is_wrong_with_it(data, suffix, said):
    with pytest.raises(MeshError, match=said):
        read_parts(data, suffix, no_file)


def test_random_changes_of_files_give_triangles_or_a_mesh_error():
    rng = np.random.default_rng(5)
    for data, suffix in ((binary_stl(CUBE, FACES), ".stl"), (obj(), ".obj"), (dae(), ".dae")):
        for _ in range(150):
            bent = bytearray(data)
            for place in rng.integers(0, len(bent), rng.integers(1, 6)):
                bent[place] = rng.integers(0, 256)
            try:
                parts = read_parts(bytes(bent[: rng.integers(len(bent) // 2, len(bent) + 1)]), suffix, no_file)
            except MeshError:
                continue
            assert all(len(part.faces) and np.isfinite(part.vertices[part.faces]).all() for part in parts)


# ---- simplification


def test_weld_joins_corners_and_drops_degenerate_faces():
    soup = CUBE[FACES].reshape(-1, 3)
    faces = np.concatenate([np.arange(36).reshape(-1, 3), [[0, 0, 1], [0, 1, 1]]])
    vertices, welded = weld(soup, faces)
    assert (len(vertices), len(welded)) == (8, 12)
    assert volume(vertices, welded) == pytest.approx(1.0)


@pytest.mark.parametrize("tolerance", [3e-3, 1e-2])
def test_a_simplified_ball_keeps_within_a_few_tolerances_of_the_ball(tolerance):
    surface = Simplifier(*ball(40))
    surface.reduce(tolerance)
    vertices, faces = surface.surface()
    assert len(faces) < 0.5 * 6240
    rng = np.random.default_rng(1)
    shares = rng.dirichlet(np.ones(3), len(faces) * 20)
    points = np.einsum("ij,ijk->ik", shares, vertices[np.repeat(faces, 20, axis=0)])
    away = np.abs(np.linalg.norm(points, axis=1) - 1.0)
    assert np.sqrt((away**2).mean()) < 2.0 * tolerance
    assert away.max() < 12.0 * tolerance
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    assert set(np.unique(edges, axis=0, return_counts=True)[1]) == {2}  # render_still closed
    assert volume(vertices, faces) == pytest.approx(4.0 / 3.0 * np.pi, rel=20.0 * tolerance)


@pytest.mark.parametrize("tolerance", [1e-6, 0.0])
def test_a_finely_divided_cube_simplifies_to_its_twelve_faces(tolerance):
    steps = np.linspace(0.0, 1.0, 9)
    soup = []
    for a, b, c, d in CUBE[np.array(QUADS)]:
        grid = np.array([[(1 - t) * ((1 - s) * a + s * b) + t * ((1 - s) * d + s * c) for s in steps] for t in steps])
        for i in range(8):
            for j in range(8):
                p, q, r, s = grid[i, j], grid[i, j + 1], grid[i + 1, j + 1], grid[i + 1, j]
                soup += [p, q, r, p, r, s]
    surface = Simplifier(*weld(np.array(soup), np.arange(len(soup)).reshape(-1, 3)))
    surface.reduce(tolerance)
    vertices, faces = surface.surface()
    assert (len(vertices), len(faces)) == (8, 12)
    assert volume(vertices, faces) == pytest.approx(1.0)


def test_a_sheet_keeps_its_border_with_one_side_or_two():
    x, y = np.meshgrid(np.linspace(0.0, 2.0, 12), np.linspace(0.0, 1.0, 7))
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    a = (np.arange(6)[:, None] * 12 + np.arange(11)).ravel()
    one = np.concatenate([np.stack([a, a + 1, a + 13], axis=1), np.stack([a, a + 13, a + 12], axis=1)])
    for faces, left in ((one, 2), (np.concatenate([one, one[:, ::-1]]), 4)):
        surface = Simplifier(points, faces)
        surface.reduce(1e-6)
        vertices, found = surface.surface()
        assert len(found) == left
        corners = vertices[found]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert 0.5 * np.linalg.norm(normals, axis=1).sum() == pytest.approx(left)


# ---- robots


def test_primitives_origins_and_colours_are_those_of_the_urdf(tmp_path):
    robot = write_urdf(
        tmp_path,
        visual('<box size="1 2 3"/>', '<origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/><material name="red"/>')
        + visual('<cylinder radius="0.1" length="2"/>', '<material name=""><color rgba="0 1 0 0.5"/></material>')
        + visual('<sphere radius="0.2"/>'),
        '<material name="red"><color rgba="1 0 0 1"/></material>',
    )
    found, notes = robot_bodies(robot)
    box, cylinder, sphere = body_of(found, "arm").shapes
    half = np.sqrt(0.5)
    assert (box.kind, box.size, box.colour) == ("box", (1.0, 2.0, 3.0), (1.0, 0.0, 0.0, 1.0))
    assert box.pose == pytest.approx((1.0, 0.0, 0.0, 0.0, 0.0, half, half))
    assert (cylinder.kind, cylinder.size, cylinder.colour) == ("cylinder", (0.1, 2.0), (0.0, 1.0, 0.0, 0.5))
    assert (sphere.kind, sphere.size, sphere.colour[3]) == ("sphere", (0.2,), 1.0)
    assert notes == ()


def test_one_mesh_file_used_twice_is_one_mesh_and_the_urdf_colour_overrides_the_files(tmp_path):
    for name in ("left.dae", "right.dae"):
        (tmp_path / name).write_bytes(dae())
    robot = write_urdf(
        tmp_path,
        visual('<mesh filename="left.dae" scale="1 -1 1"/>', '<material name="own"><color rgba="1 1 0 1"/></material>')
        + visual('<mesh filename="left.dae"/>')
        + visual('<mesh filename="right.dae"/>'),
    )
    first, second, third = body_of(robot_bodies(robot)[0], "arm").shapes
    assert first.mesh is second.mesh is third.mesh
    assert first.size == (1.0, -1.0, 1.0)
    assert (first.colour, second.colour) == ((1.0, 1.0, 0.0, 1.0), (0.1, 0.2, 0.3, 1.0))


def test_a_missing_mesh_gives_a_stand_in_and_a_note_that_names_file_and_link(tmp_path):
    found, notes = robot_bodies(write_urdf(tmp_path, visual('<mesh filename="package://gone/hand.stl"/>')))
    assert all(shape.placeholder for shape in body_of(found, "arm").shapes)
    (note,) = notes
    assert note.startswith(
        "a mesh file was not found: package://gone/hand.stl, of link 'arm' (looked for near the URDF"
    )


def test_a_missing_mesh_leaves_no_gap_before_a_fixed_link_that_is_drawn(tmp_path):
    path = tmp_path / "reach.urdf"
    path.write_text(
        '<robot name="reach"><link name="base"/><link name="arm">'
        '<visual><geometry><mesh filename="gone.stl"/></geometry></visual></link>'
        '<link name="hand"><visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual></link>'
        '<joint name="turn" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint>'
        '<joint name="end" type="fixed"><parent link="arm"/><child link="hand"/><origin xyz="0.5 0 0"/></joint></robot>'
    )
    found, _ = robot_bodies(bc.load_robot(path))
    rods = [shape for shape in body_of(found, "arm").shapes if shape.kind == "cylinder" and shape.size[1] == 0.5]
    assert len(rods) == 1 and rods[0].placeholder
    np.testing.assert_allclose(rods[0].pose[:3], (0.25, 0.0, 0.0), atol=1e-12)


def test_a_broken_mesh_gives_the_collision_shape_and_a_note(tmp_path):
    (tmp_path / "bad.stl").write_bytes(binary_stl(CUBE, FACES)[:100])
    collision = '<collision><geometry><sphere radius="0.3"/></geometry></collision>'
    found, notes = robot_bodies(write_urdf(tmp_path, visual('<mesh filename="bad.stl"/>') + collision))
    (shape,) = body_of(found, "arm").shapes
    assert (shape.kind, shape.size, shape.placeholder) == ("sphere", (0.3,), True)
    assert notes == (
        "the mesh file bad.stl of 'arm' is not drawn: it holds no triangle: it is empty, truncated or no STL file",
    )


@pytest.mark.parametrize(
    ("geometry", "said"),
    [
        ('<box size="1 2"/>', "3 numbers"),
        ('<box size="1 2 nan"/>', "not finite"),
        ('<sphere radius="-1"/>', "positive"),
        ('<cylinder radius="one" length="2"/>', "not numbers"),
        ('<mesh filename="" />', "no filename"),
        ('<mesh filename="a.stl" scale="1 0 1"/>', "scale of 0"),
        ("<torus/>", "unknown geometry <torus>"),
        ("", "no geometry"),
    ],
)
def test_a_visual_that_makes_no_sense_is_a_note_and_not_an_error(tmp_path, geometry, said):
    found, notes = robot_bodies(write_urdf(tmp_path, visual(geometry)))
    assert body_of(found, "arm").shapes[0].placeholder
    assert len(notes) == 1 and said in notes[0] and "'arm'" in notes[0]


def test_hostile_names_are_plain_text_in_bodies_and_notes(tmp_path):
    name = "__proto__ &lt;script&gt;alert(1)&lt;/script&gt; &quot;ü"
    plain = '__proto__ <script>alert(1)</script> "ü'
    file = "../../../../../../../../etc/passwd"
    found, notes = robot_bodies(write_urdf(tmp_path, visual(f'<mesh filename="{file}"/>') + "", name=name))
    assert body_of(found, plain).shapes
    assert len(notes) == 1 and plain in notes[0]


def test_materials_of_an_obj_are_read_only_from_beside_it(tmp_path):
    (tmp_path / "secret.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl blue\nKd 1 0 0\n")
    folder = tmp_path / "robot" / "meshes" / "arm"
    folder.mkdir(parents=True)
    (folder / "cube.obj").write_bytes(obj("mtllib ../../../secret.mtl\n"))
    robot = write_urdf(tmp_path, visual('<mesh filename="robot/meshes/arm/cube.obj"/>'))
    assert [shape.colour for shape in body_of(robot_bodies(robot)[0], "arm").shapes] == [(0.78, 0.79, 0.81, 1.0)]


def test_meshes_in_the_cache_are_made_anew_where_the_file_or_its_colours_change(tmp_path, fresh_cache):
    (tmp_path / "ball.stl").write_bytes(binary_stl(*ball(30)))
    robot = write_urdf(tmp_path, visual('<mesh filename="ball.stl"/>'))

    def shape():
        (one,) = body_of(robot_bodies(robot)[0], "arm").shapes
        return one

    first, again = shape(), shape()
    assert np.array_equal(first.mesh.vertices, again.mesh.vertices)
    assert np.array_equal(first.mesh.faces, again.mesh.faces)
    for entry in fresh_cache.glob("mesh-*"):
        entry.write_bytes(b"damaged")
    assert np.array_equal(shape().mesh.faces, first.mesh.faces)
    (tmp_path / "ball.stl").write_bytes(binary_stl(*ball(30, 2.0)))
    assert np.ptp(shape().mesh.vertices) == pytest.approx(2.0 * np.ptp(first.mesh.vertices), rel=1e-3)
    (tmp_path / "ball.stl").unlink()
    (tmp_path / "ball.stl").mkdir()
    assert robot_bodies(robot)[1][0].startswith("a mesh file was not found")


def test_a_bare_urdf_is_visible_by_bones_and_joints(tmp_path):
    path = tmp_path / "bare.urdf"
    path.write_text("""<robot name="bare"><link name="base"/><link name="one"/><link name="two"/><link name="tip"/>
<joint name="a" type="revolute"><parent link="base"/><child link="one"/><origin xyz="0 0 1"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="b" type="prismatic"><parent link="one"/><child link="two"/><origin xyz="0.5 0 0"/><axis xyz="0 0 -1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="c" type="fixed"><parent link="two"/><child link="tip"/><origin xyz="0 0.3 0.4"/></joint></robot>""")
    found, notes = robot_bodies(bc.load_robot(path))
    assert [body.name for body in found] == ["base", "one", "two"] and notes == ()
    assert all(shape.placeholder for body in found for shape in body.shapes)
    bone, _, pin_joint = found[1].shapes
    assert bone.size[1] == pytest.approx(0.5)
    rotate = pin.XYZQUATToSE3(np.array(bone.pose)).act(np.array([0.0, 0.0, 0.25]))
    assert rotate == pytest.approx([0.5, 0.0, 0.0])
    assert pin.XYZQUATToSE3(np.array(pin_joint.pose)).rotation[:, 2] == pytest.approx([0.0, 1.0, 0.0])
    assert found[2].shapes[-1].kind == "box"
    assert pin.XYZQUATToSE3(np.array(found[2].shapes[0].pose)).rotation[:, 2] == pytest.approx([0.0, 0.6, 0.8])
    assert len({body.shapes[0].colour for body in found}) == 3


def test_a_free_body_of_which_only_the_inertia_is_known_is_its_box(tmp_path):
    mass, (x, y, z) = 3.0, (0.1, 0.4, 0.7)
    ixx, iyy, izz = (mass / 12.0 * (p * p + q * q) for p, q in ((y, z), (x, z), (x, y)))
    path = tmp_path / "body.urdf"
    path.write_text(f"""<robot name="body"><link name="body"><inertial><origin xyz="1 2 3"/><mass value="{mass}"/>
<inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>""")
    ((body,), _) = robot_bodies(bc.load_robot(path, floating_base=True))
    (box,) = body.shapes
    pose = pin.XYZQUATToSE3(np.array(box.pose))
    assert np.abs(pose.rotation @ np.array(box.size)) == pytest.approx([x, y, z])
    assert pose.translation == pytest.approx([1.0, 2.0, 3.0])


def test_payloads_are_bodies_of_their_own_and_neighbours_differ_in_colour():
    robot = bc.load_robot("planar_2r").with_payloads([bc.Payload(2.0, "tip", (0.1, 0.0, 0.0))])
    found, _ = robot_bodies(robot)
    assert body_of(found, "payload 1").shapes[0].pose[:3] == pytest.approx((0.1, 0.0, 0.0))
    assert all(body.name in robot.frame_names for body in found)
    assert body_of(found, "link_1").shapes[0].colour != body_of(found, "link_2").shapes[0].colour
    assert not body_of(found, "link_1").shapes[0].placeholder


def pinocchio_extents(robot, name):
    """(low, high) of each link's visual meshes, in the link's frame, as Pinocchio reads the files."""
    model = pin.buildModelFromUrdf(str(robot.source))
    folders = [str(folder) for folder in robot.source.parents[2:5]]
    visuals = pin.buildGeomFromUrdf(model, str(robot.source), pin.GeometryType.VISUAL, package_dirs=folders)
    extents = {}
    for thing in visuals.geometryObjects:
        frame = model.frames[thing.parentFrame]
        if not hasattr(thing.geometry, "vertices"):
            continue
        points = thing.geometry.vertices()
        place = frame.placement.inverse() * thing.placement
        points = points @ place.rotation.T + place.translation
        low, high = extents.get(frame.name, (np.inf, -np.inf))
        extents[frame.name] = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
    return extents


@pytest.mark.tier2
@pytest.mark.parametrize(("name", "faces", "tolerance"), [("ur5", 15_000, 2e-3), ("talos", 30_000, 2e-2)])
def test_meshes_of_real_robots_are_as_large_as_pinocchio_reads_them(name, faces, tolerance):
    robot = bc.load_robot(name)
    found, notes = robot_bodies(robot)
    drawn = sum(len(s.mesh.faces) for body in found for s in body.shapes if s.mesh is not None)
    assert 0.4 * faces < drawn <= faces
    assert len(notes) == 1 and notes[0].startswith("meshes simplified from ") and f" to {drawn} faces" in notes[0]
    extents = pinocchio_extents(robot, name)
    assert len(extents) >= 7
    for body in found:
        points = []
        for shape in body.shapes:
            if shape.mesh is not None:
                place = pin.XYZQUATToSE3(np.array(shape.pose))
                points.append(shape.mesh.vertices * np.array(shape.size) @ place.rotation.T + place.translation)
        if points and len(points) == len(body.shapes):
            low, high = extents[body.name]
            every = np.concatenate(points)
            assert np.abs(every.min(axis=0) - low).max() < tolerance
            assert np.abs(every.max(axis=0) - high).max() < tolerance


def test_full_detail_keeps_every_face_that_has_an_area():
    found, notes = robot_bodies(bc.load_robot("ur5"), "full")
    drawn = sum(len(s.mesh.faces) for body in found for s in body.shapes if s.mesh is not None)
    assert 0.999 * 95_694 < drawn <= 95_694 and notes == ()


def test_every_named_robot_has_bodies_that_are_frames_with_finite_shapes():
    names = ("four_bar", "bricard", "thin_disk", "spring_pendulum", "five_bar", "delta", "planar_delta", "two_wheeler")
    for name in (*names, "simple_humanoid"):
        robot = bc.load_robot(name, floating_base=name == "thin_disk")
        found, _ = robot_bodies(robot)
        assert found and len({body.name for body in found}) == len(found)
        assert all(body.name in robot.frame_names and body.shapes for body in found)
        for shape in (shape for body in found for shape in body.shapes):
            assert np.isfinite([*shape.size, *shape.pose, *shape.colour]).all() and min(map(abs, shape.size)) > 0.0
            assert np.linalg.norm(shape.pose[3:]) == pytest.approx(1.0)
