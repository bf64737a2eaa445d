"""The scene's normals: smooth where a surface bends little, sharp where it does not, places untouched."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from dojo_maps.drawing import draw
from dojo_maps.input_files import read_bytes
from dojo_maps.meshes.gltf import write_scene
from dojo_maps.meshes.gltf_reader import read_scene
from dojo_maps.meshes.mesh import Mesh
from dojo_maps.sources.files import find_network
from dojo_maps.sources.sumo_net import read_network

_JOINED = ("sidewalk", "walking_area", "island")


@pytest.fixture(scope="module")
def meshes() -> tuple[Mesh, ...]:
    path, name = find_network("cologne1")
    return draw(read_network(read_bytes(path), path=path, name=name, sha256="")[0])[1]


@pytest.fixture(scope="module")
def scene(meshes, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("scene") / "scene.glb"
    write_scene(meshes, path)
    return path


def _mesh(name: str, vertices: object, faces: object) -> Mesh:
    triangles = np.array(faces)
    return Mesh(
        name=name,
        vertices=np.array(vertices, dtype=float),
        faces=triangles,
        sources=np.zeros(len(triangles), dtype=np.int64),
        ids=("x",),
    )


def _written(mesh: Mesh, folder: Path) -> trimesh.Trimesh:
    write_scene([mesh], folder / "x.glb")
    (found,) = trimesh.load_scene(folder / "x.glb", process=False).geometry.values()
    return found


def _document(path: Path) -> dict:
    data = path.read_bytes()
    return json.loads(data[20 : 20 + struct.unpack_from("<I", data, 12)[0]])


def test_write_scene_leaves_every_corner_in_its_place(meshes, scene):
    for mesh, read in zip(meshes, read_scene(scene), strict=True):
        assert (read.name, read.ids) == (mesh.name, mesh.ids)
        np.testing.assert_array_equal(read.sources, mesh.sources)
        np.testing.assert_array_equal(
            read.vertices[read.faces], mesh.vertices.astype(np.float32).astype(float)[mesh.faces]
        )


def test_write_scene_gives_every_vertex_a_unit_normal(scene):
    document = _document(scene)
    for mesh in document["meshes"]:
        (primitive,) = mesh["primitives"]
        counts = {document["accessors"][a]["count"] for a in primitive["attributes"].values()}
        assert set(primitive["attributes"]) == {"POSITION", "NORMAL"}
        assert len(counts) == 1
    for mesh in trimesh.load_scene(scene, process=False).geometry.values():
        np.testing.assert_allclose(np.linalg.norm(mesh.vertex_normals, axis=1), 1.0, atol=1e-6)


def test_write_scene_tells_what_surfaces_are_made_of(scene):
    """Every mesh has a material of its own; lamps glow, and glass lets light through."""
    document = _document(scene)
    made = {each["name"]: each for each in document["materials"]}
    assert [mesh["primitives"][0]["material"] for mesh in document["meshes"]] == list(range(len(made)))
    for material in made.values():
        finish = material["pbrMetallicRoughness"]
        assert len(finish["baseColorFactor"]) == 4
        assert 0.0 < min(finish["baseColorFactor"]) <= max(finish["baseColorFactor"]) <= 1.0
        assert 0.0 < finish["roughnessFactor"] <= 1.0
        assert finish["metallicFactor"] in (0.0, 1.0)
    lit = {name for name, each in made.items() if max(each.get("emissiveFactor", [0.0])) > 0.2}
    assert lit == {"signal/red", "signal/yellow", "signal/green"}
    assert made["building/lamp"]["pbrMetallicRoughness"]["metallicFactor"] == 1.0
    assert made["building/shelter/glass"]["alphaMode"] == "BLEND"
    assert made["building/shelter/glass"]["pbrMetallicRoughness"]["baseColorFactor"][3] < 0.5
    read = trimesh.load_scene(scene, process=False).geometry["signal/red"].visual.material
    assert read.emissiveFactor[0] > 0.2 > read.emissiveFactor[1]


def test_write_scene_gives_the_same_bytes_again(meshes, scene, tmp_path):
    path, name = find_network("cologne1")
    again = draw(read_network(read_bytes(path), path=path, name=name, sha256="")[0])[1]
    write_scene(again, tmp_path / "again.glb")
    assert (tmp_path / "again.glb").read_bytes() == scene.read_bytes()


def test_write_scene_lights_faces_as_they_lie_and_pavement_s_tops_level(scene):
    for name, mesh in trimesh.load_scene(scene, process=False).geometry.items():
        up = mesh.face_normals[:, 1] > 0.99
        if name == "tree":  # Crowns are smooth all over.
            continue
        seen = up if name.split("/")[0] in _JOINED else mesh.area_faces > 1e-9
        normals = mesh.vertex_normals[mesh.faces[seen]]
        agree = (normals * mesh.face_normals[seen][:, None]).sum(axis=2).min(axis=1)
        assert (agree > 0.85).mean() > 0.97, name


def test_write_scene_costs_no_more_than_eight_tenths(meshes, scene):
    plain = sum(12 * len(mesh.vertices) + 12 * len(mesh.faces) for mesh in meshes)
    assert scene.stat().st_size < 1.8 * (plain + len(json.dumps(_document(scene))))


def test_a_box_has_sharp_edges_and_a_bent_sheet_is_smooth(tmp_path):
    box = trimesh.creation.box()
    written = _written(_mesh("building", box.vertices, box.faces), tmp_path)
    assert len(written.vertices) == 24
    corners = [[x, y, z] for x, z in ((0, 0), (1, 0), (2, 0.2)) for y in (0, 1)]
    sheet = _mesh("terrain", corners, [[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5]])
    written = _written(sheet, tmp_path)
    assert len(written.vertices) == 6
    assert written.vertex_normals[:, 1].min() > 0.98


def test_pavement_keeps_its_corners_joined(tmp_path):
    box = trimesh.creation.box(extents=(20, 10, 0.12))
    written = _written(_mesh("sidewalk", box.vertices, box.faces), tmp_path)
    assert len(written.vertices) == 8
    assert written.is_watertight
    assert (written.vertex_normals[written.vertices[:, 1] > 0][:, 1] > 0.999).all()


def test_faces_without_area_have_normals_all_the_same(tmp_path):
    written = _written(_mesh("road", [[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]), tmp_path)
    np.testing.assert_array_equal(written.vertex_normals, [[0.0, 1.0, 0.0]] * 3)
