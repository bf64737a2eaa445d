"""What comes from outside: regular files within bounds, strict JSON and plain XML, an error of each kind."""

import bz2
import gzip
import json
import os
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dojo_env.camera import read_cameras
from dojo_env.elements import read_elements
from dojo_env.encoders import load_encoder
from dojo_env.errors import CameraError, EncoderError, RecordingError, ScenarioError
from dojo_env.recording import read_recording
from dojo_env.scenario import Scenario, open_map
from dojo_maps import safe_json, safe_xml
from dojo_maps.conversion import convert
from dojo_maps.errors import DescriptionError, SourceError
from dojo_maps.input_files import MAX_EXPANSION, read_bytes, read_table, sha256_of
from dojo_maps.meshes.gltf_reader import read_scene
from dojo_maps.safe_json import read_json
from dojo_maps.safe_xml import parse_xml
from dojo_maps.sources.osm import read_osm
from dojo_maps.validation.exclusions import read_exclusions


def make_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as server:
        os.chdir(path.parent)  # The whole path may be longer than a socket's may.
        server.bind(path.name)


UNFIT: dict[str, Callable[[Path], object]] = {
    "missing": lambda _path: None,
    "folder": lambda path: path.mkdir(),
    "pipe": os.mkfifo,
    "device": lambda path: path.symlink_to("/dev/zero"),
    "socket": make_socket,
    "loop": lambda path: path.symlink_to(path.name),
    "empty": lambda path: path.touch(),
    "huge": lambda path: (path.touch(), os.truncate(path, 1 << 42)),
}
"""What is no file that can be read, and what makes it."""
READERS: dict[str, tuple[Callable[[Path], object], type[SourceError]]] = {
    "a.net.xml": (lambda path: convert(str(path), path.with_name("out.dojo")), SourceError),
    "a.osm": (read_osm, SourceError),
    "a.osm.pbf": (read_osm, SourceError),
    "a.rou.xml": (read_elements, ScenarioError),
    "b.net.xml": (lambda path: open_map(Scenario(map=path)), SourceError),
    "a.npz": (read_recording, RecordingError),
    "scene.glb": (read_scene, DescriptionError),
    "cameras.json": (read_cameras, CameraError),
    "exclusions.json": (read_exclusions, SourceError),
    "net.onnx": (lambda path: load_encoder(str(path)), EncoderError),
    "a.csv": (lambda path: read_table(path, ()), SourceError),
    "a.sha": (sha256_of, SourceError),
}
"""Every kind of file that is read, and the class of its errors."""


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("what", UNFIT)
def test_what_is_no_regular_file_is_refused_at_once(
    what: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if name == "net.onnx":
        pytest.importorskip("onnxruntime")
    if (name, what) == ("a.sha", "empty"):
        pytest.skip("nothing has a hash, too")
    monkeypatch.chdir(tmp_path)
    path, (read, error) = tmp_path / name, READERS[name]
    UNFIT[what](path)
    # A scenario sees by itself that its map is not there, or a folder.
    with pytest.raises(Exception, match=name) as caught:
        read(path)
    assert isinstance(caught.value, error) or (name, what) in {
        ("b.net.xml", "missing"),
        ("b.net.xml", "loop"),
    }
    assert len(str(caught.value).splitlines()) == 1


def bomb(pack: Callable[[bytes], bytes]) -> bytes:
    return pack(b"<net>" + b" " * (50 << 20))


PACKED: dict[str, tuple[bytes, str]] = {
    "gzip cut short": (gzip.compress(b"<net/>" * 1000)[:-9], "ends early"),
    "gzip header only": (gzip.compress(b"<net/>")[:10], "ends early"),
    "gzip with a name without end": (b"\x1f\x8b\x08\x08" + b"x" * 5_000_000, "ends early"),
    "gzip of another method": (b"\x1f\x8b\x07" + bytes(100), "broken gzip"),
    "gzip damaged": (
        bytes(byte ^ (k == 40) for k, byte in enumerate(gzip.compress(np.random.default_rng(1).bytes(99)))),
        "broken",
    ),
    "gzip bomb": (bomb(gzip.compress), "unpacks to more than"),
    "bzip2 cut short": (bz2.compress(b"<net/>" * 1000)[:-9], "ends early"),
    "bzip2 damaged": (b"BZh9" + bytes(100), "broken bzip2"),
    "bzip2 bomb": (bomb(bz2.compress), "unpacks to more than"),
    "blank": (b" \n" * 100, "empty"),
}


@pytest.mark.parametrize("kind", PACKED)
def test_packed_damage_is_one_error_of_the_reader_s_class(kind: str, tmp_path: Path) -> None:
    data, words = PACKED[kind]
    (tmp_path / "a.bin").write_bytes(data)
    with pytest.raises(RecordingError, match=rf"a\.bin: .*{words}"):
        read_bytes(tmp_path / "a.bin", error=RecordingError)


@pytest.mark.slow
@pytest.mark.parametrize("pack", [bytes, gzip.compress, bz2.compress])
@pytest.mark.parametrize("size", [1, 1000, 3 << 20])
def test_what_is_packed_is_read_as_it_was(pack: Callable[[bytes], bytes], size: int, tmp_path: Path) -> None:
    data = b"x" * (size // 2 + 1) + np.random.default_rng(size).bytes(size // 2)
    path = tmp_path / "a.bin"
    path.write_bytes(pack(data))
    assert read_bytes(path) == data
    if pack is not bytes:
        path.write_bytes(pack(data) + pack(data) + bytes(3) * (pack is gzip.compress))
        assert read_bytes(path) == 2 * data


def test_packed_data_may_have_its_usual_share_of_repetition(tmp_path: Path) -> None:
    data = b"<lane/>" * 2_000_000
    path = tmp_path / "a.gz"
    path.write_bytes(b"".join(gzip.compress(data[at : at + 2000]) for at in range(0, len(data), 2000)))
    assert len(data) / path.stat().st_size < MAX_EXPANSION
    assert read_bytes(path) == data


def nested(depth: int) -> str:
    return "[" * depth + "]" * depth


BAD_JSON: dict[str, str | bytes] = {
    "nan": '{"a": NaN}',
    "infinity": "[-Infinity]",
    "twice": '{"a": 1, "a": 2}',
    "cut": '{"a": [1, 2',
    "trailing": "{} {}",
    "comment": "{} // mine",
    "not utf-8": b'{"a": "\xff"}',
    "utf-16": '{"a": 1}'.encode("utf-16"),
    "lone surrogate": r'{"a": "\ud800"}',
    "lone surrogate as a name": r'{"\udfff": 1}',
    "raw surrogate": b'["\xed\xa0\x80"]',
    "control character": '["\x01"]',
    "deep list": nested(40),
    "very deep list": nested(200_000),
    "deep object": '{"a":' * 40 + "1" + "}" * 40,
    "endless number": "9" * 5000,
    "zeros": bytes(100),
}


@pytest.mark.parametrize("kind", BAD_JSON)
def test_json_is_strict_and_shallow(kind: str, tmp_path: Path) -> None:
    text = BAD_JSON[kind]
    (tmp_path / "a.json").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(CameraError, match=r"a\.json: not readable as JSON"):
        read_json(tmp_path / "a.json", error=CameraError)


def test_json_of_too_many_values_is_refused_before_it_fills_the_memory(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    with path.open("w") as file:
        file.write("[" + "[]," * safe_json.MAX_VALUES)
    with pytest.raises(SourceError, match="more than 20000000 values"):
        read_json(path)


@pytest.mark.parametrize("value", [None, 1, "x", [], {}, {"a": [[1.5, "ü😀"], {"b": None}]}])
def test_json_is_read_as_it_was_written(value: Any, tmp_path: Path) -> None:
    for number, ascii_only in enumerate((True, False)):
        path = tmp_path / f"{number}.json"
        path.write_text("\ufeff" * number + json.dumps(value, ensure_ascii=ascii_only))
        assert read_json(path) == value


def endless(start: bytes) -> Iterator[bytes]:
    """Go on and on; who reads it all never comes to an end."""
    yield start
    while True:
        yield b"x" * (1 << 20)


BAD_XML: dict[str, tuple[Callable[[], bytes | Iterator[bytes]], str]] = {
    "tag without end": (lambda: endless(b'<a b="'), "longer than 4194304 bytes"),
    "name without end": (lambda: endless(b"<a"), "longer than 4194304 bytes"),
    "end tag without end": (lambda: endless(b"<a></a"), "longer than 4194304 bytes|not well-formed"),
    "comment without end": (lambda: endless(b"<a><!--"), "longer than 4194304 bytes"),
    "instruction without end": (lambda: endless(b"<a><?b "), "longer than 4194304 bytes"),
    "document type without end": (lambda: endless(b"<!DOCTYPE "), "longer than 4194304 bytes"),
    "attribute of megabytes": (lambda: b'<a b="' + b"x" * (2 << 20) + b'"/>', "b of 2097152 letters"),
    "id of ten thousands": (
        lambda: b'<a id="' + b"x" * 20_000 + b'"/>',
        "id of 20000 letters",
    ),
    "attributes": (
        lambda: b"<a " + b" ".join(b'a%d="1"' % k for k in range(300)) + b"/>",
        "more than 256 attr",
    ),
    "depth": (lambda: b"<a>" * 40 + b"</a>" * 40, "nested more than 16 deep"),
    "document type": (lambda: b"<!DOCTYPE a><a/>", "document type"),
    "entity": (lambda: b'<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "document type"),
    "unknown encoding": (lambda: b'<?xml version="1.0" encoding="klingon"?><a/>', "encoding"),
    "nothing": (lambda: b" ", "not well-formed"),
    "two roots": (lambda: b"<a/><a/>", "not well-formed"),
}


@pytest.mark.parametrize("kind", BAD_XML)
def test_xml_is_bounded_in_every_direction(kind: str) -> None:
    make, words = BAD_XML[kind]
    with pytest.raises(ScenarioError, match=words):
        parse_xml(make(), "a.xml", root=None, kind="file", start=lambda _n, _a: None, error=ScenarioError)


def test_xml_of_too_many_elements_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(safe_xml, "MAX_ELEMENTS", 1000)
    data = b"<a>" + b"<b/>" * 1000 + b"</a>"
    with pytest.raises(SourceError, match="more than 1000 elements"):
        parse_xml(data, "a.xml", root="a", kind="file", start=lambda _n, _a: None)


def test_an_error_of_who_is_told_is_not_taken_for_the_file_s() -> None:
    def start(_name: str, attributes: dict[str, str]) -> None:
        attributes["missing"]

    with pytest.raises(KeyError):
        parse_xml(b"<a/>", "a.xml", root=None, kind="file", start=start)


def test_long_attributes_that_networks_have_are_read() -> None:
    shape = " ".join(["1234.56,7890.12"] * 5000)
    found: dict[str, str] = {}
    data = f'<net><lane id="{"x" * 9000}" shape="{shape}"/></net>'.encode()
    parse_xml(data, "a.xml", root="net", kind="file", start=lambda _n, attributes: found.update(attributes))
    assert found["shape"] == shape
