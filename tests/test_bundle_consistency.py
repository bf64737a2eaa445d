"""A bundle is opened whole: whatever map.json says against its network is refused, or has no effect."""

import copy
import json
import shutil
from collections.abc import Callable, Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
from conftest import dojo_maps as run_dojo_maps

import dojo_maps
from dojo_env.cli import main
from dojo_maps.bundle import NETWORK, open_bundle
from dojo_maps.consistency import check_description
from dojo_maps.description import RoadMap
from dojo_maps.errors import DescriptionError, SourceError
from dojo_maps.serialization import to_json
from dojo_maps.sources.sumo_net import read_network

pytestmark = pytest.mark.sampled(4)

Value = dict[str, Any]
OF_THE_NETWORK = {
    *("projection", "origin", "bounds", "left_hand", "roads", "lanes", "connections", "junctions"),
    *("walking_areas", "walks"),
}
DELETED = object()


@pytest.fixture
def bundle(converted: Callable[..., Any], tmp_path: Path) -> Path:
    """A copy of a junction with signals, sidewalks and crossings."""
    return Path(shutil.copytree(converted("right_hand").bundle, tmp_path / "x.dojo"))


@pytest.fixture
def generated(converted: Callable[..., Any], tmp_path: Path) -> Path:
    """A copy of a junction whose sidewalks and crossings are generated."""
    return Path(shutil.copytree(converted("bare").bundle, tmp_path / "y.dojo"))


def read(folder: Path) -> Value:
    value: Value = json.loads((folder / "map.json").read_text(encoding="utf-8"))
    return value


def write(folder: Path, value: Value) -> None:
    (folder / "map.json").write_text(json.dumps(value), encoding="utf-8")


def of_the_network(road_map: RoadMap) -> Value:
    """Take what controlling signals depends on, and how many things there are."""
    value = to_json(road_map)
    for name in ("sidewalks", "crossings"):
        value[name] = [thing for thing in value[name] if thing["origin"] == "network"]
    value["signals"] = [{k: v for k, v in signal.items() if k != "heads"} for signal in value["signals"]]
    return {name: value[name] for name in (*OF_THE_NETWORK, "sidewalks", "crossings", "signals")}


def alterations(value: Any) -> Iterator[Any]:
    """Give other values for a value: of its type, of another, and none at all."""
    yield DELETED
    yield None if value is not None else "nope"
    if isinstance(value, bool):
        yield not value
    elif isinstance(value, int):
        yield from (value + 1, 10**9, -1, 0.5)
    elif isinstance(value, float):
        yield from (value + 1.0, float("nan"), -1e300)
    elif isinstance(value, str):
        yield from (value + "x", "", 7)
    elif isinstance(value, list):
        yield from ([], value[:-1], [*value, *value[-1:]], value[::-1], {})
    elif isinstance(value, dict):
        yield from ({}, [])


def places(value: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Go through all fields, and the first two of every list."""
    items = list(value.items()) if isinstance(value, dict) else list(enumerate(value[:2]))
    for key, inner in items:
        yield (*place, key)
        if isinstance(inner, dict | list):
            yield from places(inner, (*place, key))


def altered(value: Value, place: tuple[Any, ...], new: Any) -> Value:
    changed = {**value, place[0]: copy.deepcopy(value[place[0]])}
    inner: Any = changed
    for key in place[:-1]:
        inner = inner[key]
    if new is DELETED:
        del inner[place[-1]]
    else:
        inner[place[-1]] = new
    return changed


def test_a_good_bundle_opens_as_it_was_converted(bundle: Path, generated: Path) -> None:
    for folder in (bundle, generated):
        assert to_json(open_bundle(folder).road_map) == read(folder)


@pytest.mark.slow
@pytest.mark.parametrize("name", [f.name for f in fields(RoadMap)])
def test_whatever_is_altered_is_refused_or_has_no_effect(bundle: Path, name: str) -> None:
    good, network = read(bundle), bundle / NETWORK
    described, _ = read_network(network.read_bytes(), path=network, name="", sha256="")
    same = of_the_network(described)
    refused = count = 0
    for place in places({name: good[name]}):
        inner: Any = good
        for key in place:
            inner = inner[key]
        for new in alterations(inner):
            count += 1
            try:
                found = check_description(altered(good, place, new), described, bundle / "map.json")
            except DescriptionError as error:
                refused += 1
                assert "map.json" in str(error)
                assert "\n" not in str(error)
                assert len(str(error)) < 600
            else:
                assert of_the_network(found) == same
    assert refused
    if name in OF_THE_NETWORK:
        # A field that was added later may be missing; an empty list's reverse is itself.
        assert refused > 0.8 * count


def swap_ids(value: Value) -> None:
    first, second = value["lanes"][:2]
    first["id"], second["id"] = second["id"], first["id"]


def swap_links(value: Value) -> None:
    links = value["signals"][0]["links"]
    links[0]["from"], links[-1]["from"] = links[-1]["from"], links[0]["from"]


def remove_foes(value: Value) -> None:
    for junction in value["junctions"]:
        for way in junction["right_of_way"]:
            way["foes"], way["response"] = [], []


def add_foes(value: Value) -> None:
    way = next(j for j in value["junctions"] if j["right_of_way"])["right_of_way"][0]
    way["foes"] = [*way["foes"], 999]


def call_a_crossing_generated(value: Value) -> None:
    value["crossings"][0]["origin"] = "generated"


def change_a_letter(value: Value) -> None:
    phase = value["signals"][0]["programs"][0]["phases"][0]
    phase["state"] = phase["state"].replace("r", "G")


def shorten_states(value: Value) -> None:
    for phase in value["signals"][0]["programs"][0]["phases"]:
        phase["state"] = phase["state"][:-1]


def point_a_head_beyond(value: Value) -> None:
    value["signals"][0]["heads"][0]["link_indices"] = [999]


def stop_on_no_lane(value: Value) -> None:
    value["stop_lines"][0]["lane"] = "nowhere_0"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (swap_ids, "lane .*: id is"),
        (swap_links, "signal c: .*from is"),
        (remove_foes, r"junction c: right_of_way\[0\].foes is 0 long|foes is"),
        (add_foes, "foes"),
        (call_a_crossing_generated, "crossings is 3 long, its network.net.xml has 4"),
        (change_a_letter, "signal c: .*state is"),
        (shorten_states, "signal c: .*state is"),
        (point_a_head_beyond, "signal c: its head of link 999"),
        (stop_on_no_lane, "nowhere_0: there is no such lane"),
        (lambda value: value.update(lanes=[]), "lanes is 0 long"),
    ],
)
def test_a_contradiction_is_named_with_its_element(
    bundle: Path, change: Callable[[Value], None], words: str
) -> None:
    value = read(bundle)
    change(value)
    write(bundle, value)
    with pytest.raises(DescriptionError, match=words) as caught:
        open_bundle(bundle)
    assert "convert the map again" in str(caught.value)


@pytest.mark.parametrize(
    ("place", "new"),
    [
        (("crossings", 0, "signal"), "c"),
        (("crossings", 0, "link_index"), 0),
        (("crossings", 0, "junction"), "nowhere"),
        (("crossings", 0, "roads"), ["nowhere"]),
        (("sidewalks", 0, "road"), "nowhere"),
    ],
)
def test_what_was_generated_refers_to_what_is_there(
    generated: Path, place: tuple[Any, ...], new: object
) -> None:
    write(generated, altered(read(generated), place, new))
    with pytest.raises(DescriptionError, match=r"generated|not there|there is no road"):
        open_bundle(generated)


def test_maps_of_before_a_field_was_added_take_it_from_the_network(bundle: Path) -> None:
    wanted = of_the_network(open_bundle(bundle).road_map)
    old = read(bundle)
    del old["walks"], old["source"]["network_sha256"]
    for junction in old["junctions"]:
        del junction["right_of_way"]
    for lane in old["lanes"]:
        del lane["opposite"]
    write(bundle, old)
    assert of_the_network(open_bundle(bundle).road_map) == wanted


def test_a_changed_network_is_refused(bundle: Path, converted: Callable[..., Any]) -> None:
    network, good = bundle / NETWORK, (bundle / NETWORK).read_text(encoding="utf-8")
    for changed in (
        good.replace('speed="', 'speed="1', 1),
        good.replace("</net>", "<!-- mine --></net>"),
        (Path(converted("bare").bundle) / NETWORK).read_text(encoding="utf-8"),
        good.replace('state="', 'state="r', 1),
    ):
        network.write_text(changed, encoding="utf-8")
        with pytest.raises(DescriptionError):
            open_bundle(bundle)
    network.write_text(good[:-2000], encoding="utf-8")
    with pytest.raises(SourceError, match=NETWORK):
        open_bundle(bundle)
    network.unlink()
    with pytest.raises(DescriptionError, match=f"no {NETWORK}"):
        open_bundle(bundle)
    network.mkdir()
    with pytest.raises(DescriptionError, match=f"no {NETWORK}"):
        open_bundle(bundle)
    network.rmdir()
    (bundle / "elsewhere").write_text(good, encoding="utf-8")
    network.symlink_to("elsewhere")
    assert to_json(open_bundle(bundle).road_map) == read(bundle)


def test_a_signal_whose_states_differ_in_length_is_refused_though_map_and_network_agree(
    network_path: Callable[[str], Path], tmp_path: Path
) -> None:
    uneven = network_path("bare").read_text(encoding="utf-8").replace('state="', 'state="r', 1)
    (tmp_path / "uneven.net.xml").write_text(uneven, encoding="utf-8")
    dojo_maps.convert(str(tmp_path / "uneven.net.xml"), tmp_path / "uneven.dojo")
    with pytest.raises(DescriptionError, match="signal c: its states have"):
        open_bundle(tmp_path / "uneven.dojo")


def test_values_nested_without_end_are_one_clear_error(bundle: Path) -> None:
    text = json.dumps(altered(read(bundle), ("lanes", 0, "road"), "@"))
    (bundle / "map.json").write_text(text.replace('"@"', "[" * 990 + "]" * 990), encoding="utf-8")
    with pytest.raises(DescriptionError):
        open_bundle(bundle)


@pytest.mark.slow
def test_commands_end_in_one_line(bundle: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (bundle / "demand.rou.xml").write_text("<routes/>", encoding="utf-8")
    value = read(bundle)
    add_foes(value)
    write(bundle, value)
    assert main(["run", "--scenario", str(bundle), "--controller", "fixed-time"]) == 3
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    for command in (("validate",), ("view", "-o", bundle / "page.html"), ("fix", "--dry-run")):
        done = run_dojo_maps(command[0], bundle, *command[1:])
        assert done.returncode in {0, 1}
        assert "Traceback" not in done.stderr
