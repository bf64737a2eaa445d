"""Files of ours that were damaged, or forged: one error of their kind when they are opened, never later."""

import hashlib
import io
import json
import random
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Conversion
from test_whole_file import write_recording

from dojo_env.camera import LARGEST_SIDE, Camera, read_cameras, write_cameras
from dojo_env.errors import CameraError, EncoderError, RecordingError
from dojo_env.recording import read_recording
from dojo_maps.bundle import read_bundle
from dojo_maps.errors import DescriptionError
from dojo_maps.meshes.gltf_reader import read_scene

Arrays = dict[str, np.ndarray]
HUGE = 10**400
"""A whole number that no float can be."""


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("recording") / "good.npz"
    write_recording(path)
    assert len(list(read_recording(path))) == 60
    return path.read_bytes()


def text(codes: list[list[int]]) -> np.ndarray:
    """Make texts of any numbers, as a file may hold them."""
    return np.array(codes, dtype="<u4").view(f"<U{len(codes[0])}").reshape(-1)


def changed(name: str, row: Any, value: Any) -> Callable[[Arrays], None]:
    def change(arrays: Arrays) -> None:
        array = arrays[name].copy()
        array[row] = value
        arrays[name] = array

    return change


def put(name: str, value: Any) -> Callable[[Arrays], None]:
    return lambda arrays: arrays.update({name: np.asarray(value)})


def cast(name: str, dtype: str) -> Callable[[Arrays], None]:
    return lambda arrays: arrays.update({name: arrays[name].astype(dtype)})


ARRAYS: dict[str, Callable[[Arrays], object]] = {
    **{f"{name} as {dtype}": cast(name, dtype) for name, dtype in (
        ("times", "<i8"), ("times", ">f8"), ("times", "<f4"), ("times", "<c16"), ("times", "<M8[s]"),
        ("users", "<f8"), ("shown", "<f4"), ("counts", "<i8"), ("lights", "<i4"), ("seed", "<U5"),
        ("positions", "<U9"), ("version", "<f8"), ("scenario", "|S9"), ("counts", "|b1"),
    )},
    **{f"{name} is {value}": changed(name, 3, value) for name, value in (
        ("times", np.nan), ("times", np.inf), ("times", 1e300), ("positions", np.inf), ("positions", 1e200),
        ("headings", np.nan), ("slopes", 9.0), ("speeds", -np.inf), ("sizes", -1.0), ("sizes", 0.0),
        ("sizes", np.nan), ("sizes", 1e9), ("kinds", 200), ("numbers", 0), ("numbers", -5), ("users", -1),
        ("users", 2**31 - 1), ("lanes", -1), ("lanes", 10**6), ("counts", -20), ("counts", 2**31 - 1),
    )},
    "seed below zero": put("seed", np.int64(-1)),
    "times that stand still": changed("times", 4, 3.0),
    "one road user twice in an instant": changed("users", 21, 0),
    "two road users of one number": changed("numbers", 1, 1),
    "two road users of one id": put("user_ids", ["v0"] * 20),
    "ids beyond Unicode": put("user_ids", text([[0x110000 + k] for k in range(20)])),
    "ids of half a character": put("user_ids", text([[0xD800 + k] for k in range(20)])),
    "ids with a zero inside": put("user_ids", text([[65 + k, 0, 66] for k in range(20)])),
    "ids with a line break": put("user_ids", text([[65 + k, 10] for k in range(20)])),
    "a lane's name of control characters": put("lane_ids", text([[27, 91]])),
    "counts in two dimensions": put("counts", np.full((60, 1), 20, np.int32)),
    "one time for all": put("times", np.float64(1.0)),
    "no rows of numbers": put("numbers", np.empty(0, np.int32)),
    "a signal without states": put("shown", np.zeros((60, 1), np.int32) + 7),
    "two signals of one name": lambda arrays: (
        put("signals", ["a", "a"])(arrays), put("shown", np.zeros((60, 2), np.int32))(arrays)),
    "one array more": put("more", 1.0),
    "objects": put("times", np.array([None] * 60)),
    "rows of texts": put("scenario", ["a", "b"]),
}  # fmt: skip


@pytest.mark.parametrize("kind", ARRAYS)
def test_a_recording_of_wrong_values_is_refused_when_it_is_opened(
    kind: str, recording: bytes, tmp_path: Path
) -> None:
    with np.load(io.BytesIO(recording)) as archive:
        arrays = {name: archive[name] for name in archive.files}
    ARRAYS[kind](arrays)
    path = tmp_path / "bad.npz"
    np.savez_compressed(path, **arrays)
    with pytest.raises(RecordingError, match=r"bad\.npz: "):
        read_recording(path)


def rezipped(data: bytes, change: Callable[[str, bytes], bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(made, "w", method) as new:
        for name in old.namelist():
            new.writestr(name, change(name, old.read(name)))
    return made.getvalue()


def flipped(data: bytes, at: int) -> bytes:
    return data[:at] + bytes([data[at] ^ 0x10]) + data[at + 1 :]


def many_members(data: bytes) -> bytes:
    made = io.BytesIO(data)
    with zipfile.ZipFile(made, "a") as archive:
        for number in range(3000):
            archive.writestr(f"x{number}.npy", b"")
    return made.getvalue()


FORGED: dict[str, Callable[[bytes], bytes]] = {
    "empty archive": lambda _data: b"PK\x05\x06" + bytes(18),
    "another archive": lambda _data: rezipped(b"PK\x05\x06" + bytes(18), lambda _n, data: data),
    "thousands of members": many_members,
    "packed otherwise": lambda data: rezipped(data, lambda _n, part: part, zipfile.ZIP_LZMA),
    "a header of code": lambda data: rezipped(
        data, lambda _n, part: part.replace(b"'fortran_order': False", b"'fortran_order': 1/0  ")
    ),
    "a header that promises terabytes": lambda data: rezipped(
        data, lambda _n, part: part.replace(b"'shape': (60,), }        ", b"'shape': (60000000000,), }")
    ),
    "version 3": lambda data: rezipped(data, lambda _n, part: part.replace(b"NUMPY\x01", b"NUMPY\x03")),
    "rows missing": lambda data: rezipped(data, lambda _n, part: part[:-8]),
    "rows too many": lambda data: rezipped(data, lambda _n, part: part + bytes(8)),
    "no array": lambda data: rezipped(data, lambda _n, _part: b"times"),
    "cut": lambda data: data[: len(data) // 2],
    "rubbish behind": lambda data: data + b"rubbish",
}


@pytest.mark.parametrize("kind", FORGED)
def test_an_archive_that_numpy_did_not_write_is_no_recording(
    kind: str, recording: bytes, tmp_path: Path
) -> None:
    path = tmp_path / "bad.npz"
    path.write_bytes(FORGED[kind](recording))
    assert path.read_bytes() != recording
    with pytest.raises(RecordingError, match=r"bad\.npz: "):
        read_recording(path)


def test_a_flipped_bit_of_a_recording_is_an_error_or_changes_nothing(
    recording: bytes, tmp_path: Path
) -> None:
    path, chance = tmp_path / "bad.npz", random.Random(1)  # noqa: S311 - the same bits on every run
    path.write_bytes(recording)
    good = [snapshot.positions.tobytes() for snapshot in read_recording(path)]
    refused = 0
    for at in chance.sample(range(len(recording)), 150):
        path.write_bytes(flipped(recording, at))
        try:
            found = [snapshot.positions.tobytes() for snapshot in read_recording(path)]
        except RecordingError:
            refused += 1
        else:
            assert found == good
    assert refused > 120


def parts_of(scene: bytes) -> tuple[Any, bytes]:
    (length,) = struct.unpack_from("<I", scene, 12)
    return json.loads(scene[20 : 20 + length]), scene[28 + length :]


def scene_of(document: Any, binary: bytes) -> bytes:
    words = json.dumps(document).encode()
    words += b" " * (-len(words) % 4)
    chunks = struct.pack("<II", len(words), 0x4E4F534A) + words
    chunks += struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


def at(*keys: Any, value: Any) -> Callable[[Any], None]:
    """Put a value somewhere into a document; a function makes it of what was there."""

    def change(document: Any) -> None:
        for key in keys[:-1]:
            document = document[key]
        document[keys[-1]] = value(document[keys[-1]]) if callable(value) else value

    return change


WRONG_NUMBERS = {
    "negative": -1,
    "huge": 2**62,
    "beyond": HUGE,
    "a part": 1.5,
    "text": "1",
    "none": None,
    "list": [1],
    "true": True,
}
PLACES: dict[str, tuple[Any, ...]] = {
    "count": ("accessors", 0, "count"),
    "offset of a view": ("bufferViews", 1, "byteOffset"),
    "view": ("accessors", 1, "bufferView"),
    "indices": ("meshes", 0, "primitives", 0, "indices"),
    "positions": ("meshes", 0, "primitives", 0, "attributes", "POSITION"),
    "mesh": ("nodes", -1, "mesh"),
    "faces of a source": ("meshes", 0, "extras", "sources", 0, 2),
    "kind of numbers": ("accessors", 0, "componentType"),
}
DOCUMENTS: dict[str, Callable[[Any], None]] = {
    **{
        f"{place} is {kind}": at(*keys, value=value)
        for place, keys in PLACES.items()
        for kind, value in WRONG_NUMBERS.items()
    },
    "corners as indices": lambda d: d["meshes"][0]["primitives"][0].update(
        indices=d["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
    ),
    "indices as corners": lambda d: d["meshes"][0]["primitives"][0]["attributes"].update(
        POSITION=d["meshes"][0]["primitives"][0]["indices"]
    ),
    "a stride": at("bufferViews", 1, value=lambda view: {**view, "byteStride": 24}),
    "a moved node": at("nodes", -1, value=lambda node: {**node, "matrix": [2.0] * 16}),
    "no name": at("nodes", -1, value=lambda node: {**node, "name": 7}),
    "no nodes": at("nodes", value=7),
    "nodes of numbers": at("nodes", value=[1, 2]),
    "one mesh a thousand times": at("nodes", value=lambda nodes: [n for n in nodes if "mesh" in n] * 1000),
    "accessors that are numbers": at("accessors", value=[1.5]),
    "two primitives": at("meshes", 0, "primitives", value=lambda found: found * 2),
    "sources that are no list": at("meshes", 0, "extras", "sources", value={"a": 1}),
}


@pytest.fixture(scope="module")
def bundle(converted: Callable[..., Conversion]) -> Path:
    return converted("bare").folder


@pytest.mark.parametrize("kind", DOCUMENTS)
def test_a_scene_whose_document_is_wrong_is_refused(kind: str, bundle: Path, tmp_path: Path) -> None:
    document, binary = parts_of((bundle / "scene.glb").read_bytes())
    DOCUMENTS[kind](document)
    path = tmp_path / "scene.glb"
    path.write_bytes(scene_of(document, binary))
    with pytest.raises(DescriptionError, match=r"scene\.glb: "):
        read_scene(path)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30, -1e9])
def test_a_scene_with_a_corner_far_away_is_refused(value: float, bundle: Path, tmp_path: Path) -> None:
    document, binary = parts_of((bundle / "scene.glb").read_bytes())
    accessor = document["accessors"][document["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]
    start = document["bufferViews"][accessor["bufferView"]].get("byteOffset", 0)
    path = tmp_path / "scene.glb"
    path.write_bytes(scene_of(document, binary[:start] + struct.pack("<f", value) + binary[start + 4 :]))
    with pytest.raises(DescriptionError, match="nowhere near the map"):
        read_scene(path)
    path.write_bytes(scene_of(document, binary))
    assert read_scene(path)


@pytest.mark.parametrize("value", ["1e999", "-1e999", str(HUGE), '"3"', "null", "[]", "true"])
def test_a_description_holds_finite_numbers_only(value: str, bundle: Path, tmp_path: Path) -> None:
    words = (bundle / "map.json").read_text()
    start = words.index('"width":') + len('"width":')
    end = words.index(",", start)
    (tmp_path / "map.json").write_text(words[:start] + value + words[end:])
    with pytest.raises(DescriptionError, match=r"map\.json: .*width"):
        read_bundle(tmp_path)


GOOD_CAMERA: dict[str, Any] = {"name": "a", "position": [0.0, 1.0, 9.0]}
WRONG: dict[str, list[Any]] = {
    "name": [None, 1, [1], {}],
    "position": [None, 1, "abc", [], [1, 2], *([1, 2, value] for value in (None, "3", HUGE, 1e300, True))],
    "width": [0, -1, 3.5, "356", None, LARGEST_SIDE + 1, HUGE, True, [356]],
    "height": [0, 0.5, 1e9],
    "heading_deg": [None, "north", HUGE, [0], True],
    "field_of_view_deg": [0, 180, -75, "wide"],
    "near": [0, -1, 500, None],
    "far": [0.1, 1e9, "far"],
    "distortion": [1, None, "none", [1], [1e9, 0, 0, 0], ["a", 0, 0, 0], [HUGE, 0, 0, 0]],
    "colour": ["red"],
}  # fmt: skip
"""What no camera can be, by the field."""


@pytest.mark.parametrize(("field", "value"), [(field, value) for field in WRONG for value in WRONG[field]])
def test_cameras_that_cannot_be_are_refused(field: str, value: Any, tmp_path: Path) -> None:
    path = tmp_path / "cameras.json"
    known = {"format": "dojo-cameras", "version": 1}
    path.write_text(json.dumps({**known, "cameras": [{**GOOD_CAMERA, field: value}]}))
    with pytest.raises(CameraError, match=r"cameras\.json: ") as caught:
        read_cameras(path)
    assert caught.value.exit_status == 3
    assert len(str(caught.value)) < 600
    path.write_text(json.dumps({**known, "cameras": [GOOD_CAMERA]}))
    assert read_cameras(path) == (Camera(name="a", position=(0, 1, 9)),)


@pytest.mark.parametrize("cameras", [[], 7, None, {"a": 1}, ["a"], [GOOD_CAMERA] * 2])
def test_a_file_without_cameras_is_refused(cameras: Any, tmp_path: Path) -> None:
    path = tmp_path / "cameras.json"
    path.write_text(json.dumps({"format": "dojo-cameras", "version": 1, "cameras": cameras}))
    with pytest.raises(CameraError, match=r"cameras\.json: "):
        read_cameras(path)


def test_pictures_that_no_memory_can_hold_are_refused(tmp_path: Path) -> None:
    path, side = tmp_path / "cameras.json", LARGEST_SIDE // 2
    large = [Camera(name=str(k), position=(0, 0, 9), width=side, height=side) for k in range(5)]
    write_cameras(large, path)
    with pytest.raises(CameraError, match="pixels together"):
        read_cameras(path)
    write_cameras(large[:4], path)
    assert len(read_cameras(path)) == 4


def test_a_network_that_is_damaged_is_no_encoder(tmp_path: Path) -> None:
    pytest.importorskip("onnx")
    pytest.importorskip("onnxruntime")
    from test_env_encoders import write_network  # noqa: PLC0415 - needs both

    from dojo_env.encoders import load_encoder  # noqa: PLC0415

    path = write_network(tmp_path / "net.onnx")
    good = path.read_bytes()
    for bad in (good[: len(good) // 2], good[: -len(good) // 8], b"\x00" * 500, good[::-1], b"PK\x03\x04"):
        path.write_bytes(bad)
        with pytest.raises(EncoderError, match=r"net\.onnx"):
            load_encoder(str(path))


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with weights, a checkpoint and settings of a training."""
    torch = pytest.importorskip("torch")
    pytest.importorskip("stable_baselines3")
    from dojo_env.learning import settings, tensor_files  # noqa: PLC0415

    folder = tmp_path_factory.mktemp("run")
    weights = {"layer": torch.arange(60, dtype=torch.float32)}
    tensor_files.save_tensors(weights, folder / "policy.pt")
    parts = dict.fromkeys(("parameters", "counters", "torch", "numpy", "actions", "buffer"))
    tensor_files.save_tensors(
        {**parts, "known": {"rows": [], "best": 1.5}, **weights}, folder / "checkpoint.pt"
    )
    torch.save(weights, folder / "old.pt")
    settings.write_training(settings.Training(scenario="two-way"), folder / "training.json")
    old = {"training": {"scenario": "two-way"}, "versions": {}}
    (folder / "old.json").write_text(json.dumps(old))
    return folder


def reader_of(name: str) -> Callable[[Path], Any]:
    from dojo_env.learning import checkpoints, settings, tensor_files  # noqa: PLC0415

    if name.endswith(".json"):
        return settings.read_training
    return checkpoints.read_checkpoint if name == "checkpoint.pt" else tensor_files.load_tensors


@pytest.mark.parametrize("name", ["policy.pt", "checkpoint.pt", "training.json"])
def test_every_flipped_bit_of_what_a_training_keeps_is_refused(name: str, kept: Path, tmp_path: Path) -> None:
    from dojo_env.learning.settings import RunFileError  # noqa: PLC0415

    good, read = (kept / name).read_bytes(), reader_of(name)
    read(kept / name)
    step = max(1, len(good) // 200)
    for place in {*range(0, len(good), step), len(good) - 1, len(good) - 40, len(good) - 34}:
        path = tmp_path / name
        path.write_bytes(flipped(good, place))
        with pytest.raises(RunFileError, match=name):
            read(path)


@pytest.mark.parametrize("name", ["policy.pt", "checkpoint.pt", "training.json", "old.pt", "old.json"])
@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.99])
def test_what_a_training_keeps_is_refused_when_it_is_cut(
    share: float, name: str, kept: Path, tmp_path: Path
) -> None:
    from dojo_env.learning.settings import RunFileError  # noqa: PLC0415

    good, path = (kept / name).read_bytes(), tmp_path / name
    path.write_bytes(good[: int(share * len(good))])
    with pytest.raises(RunFileError, match=name):
        reader_of(name)(path)


def test_what_was_kept_before_there_were_checksums_is_read(kept: Path, tmp_path: Path) -> None:
    from dojo_env.learning.settings import RunFileError  # noqa: PLC0415

    assert len(reader_of("old.pt")(kept / "old.pt")["layer"]) == 60
    assert reader_of("old.json")(kept / "old.json").scenario == "two-way"
    good = (kept / "old.pt").read_bytes()
    path = tmp_path / "old.pt"
    path.write_bytes(good.replace(np.float32(31).tobytes(), np.float32(30).tobytes(), 1))
    with pytest.raises(RunFileError, match="damaged"):
        reader_of("old.pt")(path)


def test_code_in_a_checkpoint_is_not_run(kept: Path, tmp_path: Path) -> None:
    torch = pytest.importorskip("torch")
    from dojo_env.learning.settings import RunFileError  # noqa: PLC0415

    class Harm:
        def __reduce__(self) -> tuple[Any, ...]:
            return (Path.touch, (tmp_path / "harm",))

    path = tmp_path / "policy.pt"
    torch.save({"layer": Harm()}, path)
    path.write_bytes(path.read_bytes() + b"\nsha256 " + hashlib.sha256(path.read_bytes()).digest())
    with pytest.raises(RunFileError, match="neither weights nor a checkpoint"):
        reader_of("policy.pt")(path)
    assert not (tmp_path / "harm").exists()
