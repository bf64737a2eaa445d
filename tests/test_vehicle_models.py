"""3D models of a user's: drawn as they are, in place of ours, and refused with one clear error."""

import base64
import contextlib
import json
import os
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import traffic
import trimesh

from dojo_env.config import SensingConfig
from dojo_env.errors import ConfigError, ModelError
from dojo_env.rendering.fleet import MOST_FACES, MOST_VERTICES, build_fleet
from dojo_env.rendering.lighting import to_linear
from dojo_env.rendering.model_files import MOST_TRIANGLES, read_model_file
from dojo_env.rendering.own_models import fit_model
from dojo_env.rendering.shapes import Part
from dojo_env.rendering.traffic import place_users
from dojo_env.snapshot import Kind, Snapshot
from dojo_env.vehicle_models import VehicleModel, settle_models

CUBE = [(x, y, z) for x in (0.0, 2.0) for y in (0.0, 1.0) for z in (0.0, 4.0)]
FACES = [
    *((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)),
    *((2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
]
"""A box 2 wide, 1 high and 4 long, y up, facing +z; turned outside."""


def _document(**changes: Any) -> dict[str, Any]:
    corners, indices = np.array(CUBE, "<f4").tobytes(), np.array(FACES, "<u2").tobytes()
    uri = "data:application/octet-stream;base64," + base64.b64encode(corners + indices).decode()
    document: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"name": "shell", "pbrMetallicRoughness": {"baseColorFactor": [1.0, 0.0, 0.0, 1.0]}}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 96},
            {"buffer": 0, "byteOffset": 96, "byteLength": 72},
        ],
        "buffers": [{"uri": uri, "byteLength": 168}],
    }
    return {**document, **changes}


def _write(folder: Path, document: Any, name: str = "box.gltf") -> Path:
    path = folder / name
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def test_box_fills_the_unit_box_and_keeps_its_colour(tmp_path: Path) -> None:
    variant, colours = fit_model(VehicleModel(file=_write(tmp_path, _document())))
    assert variant.size == pytest.approx((4.0, 2.0, 1.0))
    for model in variant.poses[0]:
        assert model.vertices.min(axis=0) == pytest.approx((-1.0, -0.5, 0.0))
        assert model.vertices.max(axis=0) == pytest.approx((0.0, 0.5, 1.0))
        assert set(model.parts) == {len(Part)}
        assert trimesh.Trimesh(model.vertices, model.faces).volume == pytest.approx(1.0)
    assert colours == pytest.approx(np.array([(1.0, 0.0, 0.0)]))


@pytest.mark.parametrize(("front", "up", "size"), [("+x", "y", (2, 4, 1)), ("-y", "z", (1, 2, 4))])
def test_front_and_up_turn_a_model(tmp_path: Path, front: str, up: str, size: tuple[int, ...]) -> None:
    variant, _ = fit_model(VehicleModel(file=_write(tmp_path, _document()), front=front, up=up))
    assert variant.size == pytest.approx(size)
    model = variant.poses[0][0]
    assert trimesh.Trimesh(model.vertices, model.faces).volume == pytest.approx(1.0)


def test_files_of_other_programs_are_read_as_they_read_them(tmp_path: Path) -> None:
    """trimesh writes a scene of turned parts as GLB and OBJ; both hold the same triangles as it says."""
    scene = trimesh.Scene()
    for k, colour in enumerate([(200, 30, 30, 255), (30, 30, 200, 255)]):
        ball = trimesh.creation.icosphere(subdivisions=2)
        ball.visual = trimesh.visual.TextureVisuals(
            material=trimesh.visual.material.PBRMaterial(name=f"paint{k}", baseColorFactor=colour)
        )
        turn = trimesh.transformations.rotation_matrix(0.7 * k, (1.0, 2.0, 0.5))
        turn[:3, 3] = (2.0 * k, 0.3, 1.0)
        scene.add_geometry(ball, transform=turn)
    (tmp_path / "two.glb").write_bytes(scene.export(file_type="glb"))
    (tmp_path / "two.obj").write_text(scene.to_mesh().export(file_type="obj", include_texture=False))
    expected = np.sort(np.array(scene.to_mesh().triangles).reshape(-1, 9), axis=0)
    for name in ("two.glb", "two.obj"):
        raw = read_model_file(tmp_path / name)
        assert np.sort(raw.triangles.reshape(-1, 9), axis=0) == pytest.approx(expected, abs=1e-5)


def test_textures_and_corner_colours_reach_the_faces(tmp_path: Path) -> None:
    picture = np.zeros((8, 8, 3), np.uint8)
    picture[:, 4:] = (0, 255, 0)
    done, png = cv2.imencode(".png", picture)
    assert done
    (tmp_path / "skin.png").write_bytes(png.tobytes())
    spots = np.array([(0.9, 0.5) if x else (0.1, 0.5) for x, _, _ in CUBE], "<f4").tobytes()
    document = _document(images=[{"uri": "skin.png"}], textures=[{"source": 0}])
    document["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    document["buffers"].append({"uri": "data:;base64," + base64.b64encode(spots).decode(), "byteLength": 64})
    document["bufferViews"].append({"buffer": 1, "byteLength": 64})
    document["accessors"].append({"bufferView": 2, "componentType": 5126, "count": 8, "type": "VEC2"})
    document["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = 2
    raw = read_model_file(_write(tmp_path, document))
    right = (raw.triangles[:, :, 0] == 2.0).all(axis=1)
    left = (raw.triangles[:, :, 0] == 0.0).all(axis=1)
    assert raw.colours[right] == pytest.approx(np.tile(to_linear(np.array([0, 255, 0])), (2, 1)))
    assert raw.colours[left].max() == 0.0


def test_sumo_s_own_models_take_their_place_by_type() -> None:
    fleet = build_fleet(settle_models({"small": "sumo:car-normal-citrus", "tram": "sumo:tram"}))
    spans = fleet.library.spans
    assert (spans[:, :, 3] - spans[:, :, 2]).max() < MOST_FACES
    assert (spans[:, :, 1] - spans[:, :, 0]).max() < MOST_VERTICES
    car = fleet.variants[fleet.own["small"]].poses[0][0]
    assert {Part.BODY, Part.GLASS, Part.TYRE, Part.BRAKE, Part.HEADLAMP} <= set(car.parts.tolist())
    lamps = car.vertices[car.faces[car.parts == Part.HEADLAMP]]
    assert lamps[..., 0].min() > -0.2, "it faces ahead"
    base = Snapshot(time=0.0)
    poses = [(0.0, 0.0, 0.0, 0.0)] * 3
    snapshot = traffic.users(poses, [Kind.CAR] * 3, base, types=("small", "other", "tram"))
    models = place_users(snapshot, np.zeros(3), fleet=fleet).models
    usual = place_users(snapshot, np.zeros(3)).models
    assert models[1] == usual[1]
    assert models[0] >= len(fleet.library.spans) - 2
    assert models[2] == models[0] + 1


@pytest.mark.slow
def test_too_fine_a_model_is_made_simple_and_keeps_its_shape(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=6)
    (tmp_path / "ball.obj").write_text(ball.export(file_type="obj", include_normals=False))
    variant, _ = fit_model(VehicleModel(file=tmp_path / "ball.obj"))
    assert len(ball.faces) > 20 * len(variant.poses[0][0].faces)
    for model, volume in zip(variant.poses[0], (0.5, 0.48, 0.42, 0.28), strict=True):
        assert trimesh.Trimesh(model.vertices, model.faces).volume > volume


def test_table_of_models_counts_paths_from_its_folder(tmp_path: Path) -> None:
    (tmp_path / "models").mkdir()
    _write(tmp_path / "models", _document())
    table = tmp_path / "models.toml"
    table.write_text('bus = "models/box.gltf"\n[car]\nfile = "models/box.gltf"\nfront = "-x"\n')
    settled = SensingConfig(models=table).models
    assert isinstance(settled, dict)
    assert settled["bus"].file == tmp_path / "models/box.gltf"
    assert settled["car"].front == "-x"


@pytest.mark.parametrize(
    ("models", "text"),
    [({"bus": 3}, "expected a file"), ({"bus": "bus.stl"}, "not one of .glb"), ({"bus": "b.glb"}, "no such"),
     ({"bus": "sumo:bus"}, "there are car-"), ({"bus": {"file": "sumo:tram", "front": "up"}}, "front='up'"),
     ({"bus": {"file": "sumo:tram", "size": 3}}, "file, front, up"), (7, "expected files by vehicle type")],
)  # fmt: skip
def test_settings_that_cannot_be_are_refused(models: Any, text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        SensingConfig(models=models)


def _broken() -> dict[str, Any]:
    """Documents that no reader should trust."""
    accessors = _document()["accessors"]
    part = {"attributes": {"POSITION": 0}, "indices": 1}
    return {
        "no scene": {"asset": {"version": "2.0"}},
        "a list": [1, 2],
        "nodes in a ring": _document(nodes=[{"children": [1]}, {"children": [0]}]),
        "far node": _document(scenes=[{"nodes": [7]}]),
        "negative": _document(scenes=[{"nodes": [-1]}]),
        "huge accessor": _document(
            accessors=[{"bufferView": 0, "componentType": 5126, "count": 10**12, "type": "VEC3"}] * 2
        ),
        "no buffer view": _document(accessors=[{"componentType": 5126, "count": 10**9, "type": "VEC3"}] * 2),
        "before its buffer": _document(bufferViews=[{"buffer": 0, "byteOffset": -90}] * 2),
        "stride of none": _document(bufferViews=[{"buffer": 0, "byteStride": 0}] * 2),
        "far corners": _document(
            meshes=[{"primitives": [part]}],
            accessors=[{**accessors[0], "count": 4}, accessors[1]],
        ),
        "again and again": _document(meshes=[{"primitives": [part] * (MOST_TRIANGLES // 12 + 1)}]),
        "outside": _document(buffers=[{"uri": "../secret.bin", "byteLength": 168}]),
        "absolute": _document(buffers=[{"uri": "/etc/passwd", "byteLength": 168}]),
        "from the net": _document(buffers=[{"uri": "https://example.org/a.bin", "byteLength": 168}]),
        "packed": _document(extensionsRequired=["KHR_draco_mesh_compression"]),
        "text for numbers": _document(nodes=[{"mesh": 0, "scale": ["a", 1, 1]}]),
        "short matrix": _document(nodes=[{"mesh": 0, "matrix": [1.0] * 3}]),
        "flat": _document(nodes=[{"mesh": 0, "scale": [1.0, 0.0, 1.0]}]),
    }


@pytest.mark.parametrize("name", _broken())
def test_broken_files_are_refused_with_one_error(tmp_path: Path, name: str) -> None:
    path = _write(tmp_path, json.loads(json.dumps(_broken()[name])))
    (tmp_path.parent / "secret.bin").write_bytes(bytes(168))
    with pytest.raises(ModelError, match=r"box\.gltf"):
        fit_model(VehicleModel(file=path))


def test_no_other_than_regular_files_are_read(tmp_path: Path) -> None:
    (tmp_path / "link.gltf").symlink_to("/etc/passwd")
    os.mkfifo(tmp_path / "pipe.obj")
    (tmp_path / "empty.glb").write_bytes(b"")
    (tmp_path / "short.glb").write_bytes(struct.pack("<4sII", b"glTF", 2, 12))
    (tmp_path / "far.obj").write_text("v 0 0 0\nf 1 2 3\n")
    (tmp_path / "up.obj").write_text("mtllib ../../x.mtl\nv 0 0 0\n")
    for name in ("link.gltf", "pipe.obj", "empty.glb", "short.glb", "far.obj", "up.obj"):
        with pytest.raises(ModelError, match=name):
            fit_model(VehicleModel(file=tmp_path / name))


def test_random_damage_gives_a_model_or_the_error(tmp_path: Path) -> None:
    random = np.random.default_rng(5)
    text = json.dumps(_document()).encode()
    for _ in range(150):
        data = bytearray(text)
        for place in random.integers(0, len(data), 3):
            data[place] = random.integers(32, 127)
        path = tmp_path / "box.gltf"
        path.write_bytes(bytes(data))
        with contextlib.suppress(ModelError):
            fit_model(VehicleModel(file=path))
