"""The networks that the acceptance tests run on.

Real ones are found in the installed `sumo_rl` and `sumo` packages; the others are built on the spot with
the netconvert and netgenerate of the `sumo` package, one per thing that a street can have.
"""

import gzip
import importlib.util
import math
import os
import random
import subprocess
from collections.abc import Callable
from pathlib import Path
from xml.sax.saxutils import quoteattr

SLOW = ("DRT-osm", "A10KW-osm", "bs3d-bs", "ingolstadt21", "OW")
ALWAYS = ("cologne1", "ingolstadt1", "fkk_in-ingolstadt", "RiLSA1-rilsa1", "rail-net")
SAMPLE_SIZE = 3
SAMPLE_SEED = 20260
GENERATED_SAMPLE = 2


def _package_folder(name: str) -> Path:
    """Find an installed package's folder without running any of its code."""
    spec = importlib.util.find_spec(name)
    if spec is None or not spec.submodule_search_locations:
        raise RuntimeError(f"the package {name} is not installed; the tests need it for its networks")
    return Path(spec.submodule_search_locations[0])


def installed_networks() -> dict[str, Path]:
    """List every network in the installed packages, by a short name."""
    sumo = _package_folder("sumo") / "tools"
    folders = (_package_folder("sumo_rl") / "nets", sumo / "game", sumo / "sumolib" / "scenario")
    found: dict[str, Path] = {}
    for folder in folders:
        for path in sorted([*folder.rglob("*.net.xml"), *folder.rglob("*.net.xml.gz")]):
            stem = path.name.split(".")[0]
            name = stem if stem == path.parent.name else f"{path.parent.name}-{stem}"
            if name in found:
                raise RuntimeError(f"two networks are called {name}: {found[name]} and {path}")
            found[name] = path
    return found


def default_sample() -> list[str]:
    """Choose the installed networks that are tested without --whole: a few fixed, a few by seed."""
    rest = sorted(set(installed_networks()) - set(SLOW) - set(ALWAYS))
    return [*ALWAYS, *random.Random(SAMPLE_SEED).sample(rest, SAMPLE_SIZE)]  # noqa: S311 - no secret


def read_network_bytes(path: Path) -> bytes:
    """Read a network as XML, whether packed or not."""
    data = path.read_bytes()
    return gzip.decompress(data) if path.suffix == ".gz" else data


def run_sumo_tool(tool: str, *arguments: str | Path) -> None:
    """Run one of the package's programs and fail with its own words."""
    home = _package_folder("sumo")
    program = home / "bin" / (f"{tool}.exe" if os.name == "nt" else tool)
    done = subprocess.run(
        [program, *map(str, arguments)],
        env={**os.environ, "SUMO_HOME": str(home)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    if done.returncode != 0:
        raise RuntimeError(f"{tool} failed with {done.returncode}: {done.stderr}")


def _tag(tag: str, **attributes: object) -> str:
    names = {"from_": "from", "type_": "type"}
    pairs = " ".join(f"{names.get(key, key)}={quoteattr(str(value))}" for key, value in attributes.items())
    return f"<{tag} {pairs}/>"


def _lanes(*lanes: dict[str, object]) -> str:
    return "".join(_tag("lane", index=index, **lane) for index, lane in enumerate(lanes))


def _edge(edge_id: str, from_: str, to: str, *lanes: dict[str, object], **attributes: object) -> str:
    opening = _tag("edge", id=edge_id, from_=from_, to=to, **attributes)
    return f"{opening[:-2]} numLanes='{len(lanes)}'>{_lanes(*lanes)}</edge>" if lanes else opening


def _node(node_id: str, x: float, y: float, z: float | None = None, **attributes: object) -> str:
    position = {"x": x, "y": y} if z is None else {"x": x, "y": y, "z": z}
    return _tag("node", id=node_id, **position, **attributes)


def _both_ways(edge_id: str, a: str, b: str, shape: str = "", **attributes: object) -> list[str]:
    """Two edges, one from a to b and one, with a minus before its id, back."""
    there = {"shape": shape} if shape else {}
    back = {"shape": " ".join(reversed(shape.split()))} if shape else {}
    return [_edge(edge_id, a, b, **there, **attributes), _edge(f"-{edge_id}", b, a, **back, **attributes)]


def _build(
    folder: Path,
    name: str,
    nodes: list[str],
    edges: list[str],
    *options: str,
    connections: list[str] | None = None,
) -> Path:
    """Turn plain XML into a network with netconvert."""
    target = folder / f"{name}.net.xml"
    nodes_file, edges_file = folder / f"{name}.nod.xml", folder / f"{name}.edg.xml"
    nodes_file.write_text(f"<nodes>{''.join(nodes)}</nodes>", encoding="utf-8")
    edges_file.write_text(f"<edges>{''.join(edges)}</edges>", encoding="utf-8")
    extra: tuple[str | Path, ...] = ()
    if connections:
        connections_file = folder / f"{name}.con.xml"
        connections_file.write_text(f"<connections>{''.join(connections)}</connections>", encoding="utf-8")
        extra = ("-x", connections_file)
    run_sumo_tool("netconvert", "-n", nodes_file, "-e", edges_file, *extra, "-o", target, *options)
    return target


_KEEP = "--offset.disable-normalization"
_WALK = ("--sidewalks.guess", "--crossings.guess", "--walkingareas")
_TOWN = {"numLanes": 2, "speed": 13.89, "priority": 3}


def _star(centre: str = "traffic_light", *, mirror: bool = False, tilt: tuple[float, float] | None = None):
    """Four slightly crooked legs around one junction, as nodes and edges without lanes."""
    ends = {"e": (140.0, 12.0), "n": (-18.0, 120.0), "w": (-130.0, -9.0), "s": (7.0, -150.0)}
    side = -1.0 if mirror else 1.0
    nodes = [_node("c", 0.0, 0.0, 0.0 if tilt else None, type_=centre)]
    for name, (x, y) in ends.items():
        height = None if tilt is None else tilt[0] * x + tilt[1] * y
        nodes.append(_node(name, side * x, y, height))
    return nodes, list(ends)


def _star_edges(ends: list[str], **attributes: object) -> list[str]:
    return [edge for end in ends for edge in _both_ways(end, end, "c", **attributes)]


def _many_legs(folder: Path, name: str, angles: list[float]) -> Path:
    """Legs at these angles (degrees) around one signal, with sidewalks and crossings."""
    places = {f"l{k}": math.radians(angle) for k, angle in enumerate(angles)}
    nodes = [_node("c", 0, 0, type_="traffic_light")]
    nodes += [_node(leg, 160 * math.cos(turn), 160 * math.sin(turn)) for leg, turn in places.items()]
    return _build(folder, name, nodes, _star_edges(list(places), **_TOWN), _KEEP, *_WALK)


def build_five_legs(folder: Path) -> Path:
    """Five legs, two of them in a sharp fork."""
    return _many_legs(folder, "five_legs", [5, 85, 118, 190, 275])


def build_six_legs(folder: Path) -> Path:
    """Six legs at skewed angles."""
    return _many_legs(folder, "six_legs", [0, 48, 110, 185, 230, 300])


def build_walkers_signal(folder: Path) -> Path:
    """A straight road with a signal for one crossing, and nothing else."""
    nodes = [_node("c", 0, 0, type_="traffic_light"), _node("w", -150, 0), _node("e", 150, 0)]
    crossing = ['<crossing node="c" edges="w -w" priority="1"/>']
    edges = _star_edges(["w", "e"], **_TOWN)
    return _build(
        folder,
        "walkers_signal",
        nodes,
        edges,
        _KEEP,
        "--sidewalks.guess",
        "--walkingareas",
        connections=crossing,
    )


def build_bridge(folder: Path) -> Path:
    """A road with sidewalks 6 m above another one, with ramps, and a slip road between the two."""
    nodes = [
        _node("west", -180, 0, 0),
        _node("low", 90, 0, 0),
        _node("east", 180, 0, 0),
        _node("south", 0, -180, 0),
        _node("deck_south", 0, -50, 6),
        _node("deck_north", 0, 50, 6),
        _node("north", 0, 180, 0),
    ]
    edges = [
        *_both_ways("lower", "west", "low", **_TOWN),
        *_both_ways("lower_end", "low", "east", **_TOWN),
        *_both_ways("ramp_up", "south", "deck_south", **_TOWN),
        *_both_ways("deck", "deck_south", "deck_north", **_TOWN),
        *_both_ways("ramp_down", "deck_north", "north", **_TOWN),
        *_both_ways("slip", "low", "north", numLanes=1, speed=8.3, shape="90,0,0 95,60,0 60,150,0 0,180,0"),
    ]
    return _build(folder, "bridge", nodes, edges, _KEEP, *_WALK)


def build_fork(folder: Path, *, left_hand: bool = False) -> Path:
    """A one-way road of three lanes of which the outer one leaves; the others go straight on."""
    side = -1 if left_hand else 1
    nodes = [_node("w", -150, 0), _node("c", 0, 0), _node("e", 150, 0), _node("off", 120, -60 * side)]
    edges = [
        _edge("in", "w", "c", numLanes=3, speed=13.89),
        _edge("straight", "c", "e", numLanes=2, speed=13.89),
        _edge("off", "c", "off", numLanes=1, speed=13.89),
    ]
    ways = [("straight", 1, 0), ("straight", 2, 1), ("off", 0, 0)]
    connections = [
        f'<connection from="in" to="{to}" fromLane="{start}" toLane="{end}"/>' for to, start, end in ways
    ]
    options = [_KEEP, *(["--lefthand"] if left_hand else [])]
    return _build(folder, "fork", nodes, edges, *options, connections=connections)


def build_slope(folder: Path) -> Path:
    """A signalised junction with sidewalks and crossings on a hillside of 8 % by 5 %."""
    nodes, ends = _star(tilt=(0.08, 0.05))
    return _build(folder, "slope", nodes, _star_edges(ends, **_TOWN), _KEEP, *_WALK)


def _signalised(folder: Path, name: str, *options: str, mirror: bool = False) -> Path:
    nodes, ends = _star(mirror=mirror)
    walk = {"allow": "pedestrian", "width": "2.5"}
    bike = {"allow": "bicycle", "width": "1.5"}
    drive = {"disallow": "pedestrian"}
    edges = []
    for end in ends:
        edges.append(_edge(end, end, "c", walk, bike, drive, drive, speed=13.89))
        edges.append(_edge(f"-{end}", "c", end, walk, bike, drive, speed=13.89))
    return _build(folder, name, nodes, edges, _KEEP, "--crossings.guess", "--walkingareas", *options)


def build_right_hand(folder: Path) -> Path:
    """A signalised junction with sidewalks, bike lanes and crossings."""
    return _signalised(folder, "right_hand")


def build_left_hand(folder: Path) -> Path:
    """The mirror image of the right-hand junction, with traffic on the left."""
    return _signalised(folder, "left_hand", "--lefthand", mirror=True)


def build_left_hand_bare(folder: Path) -> Path:
    """A left-hand signalised junction without sidewalks or crossings; mirrors the one called bare."""
    nodes, ends = _star(mirror=True)
    return _build(folder, "left_hand_bare", nodes, _star_edges(ends, **_TOWN), _KEEP, "--lefthand")


def build_bare(folder: Path) -> Path:
    """A signalised junction without sidewalks or crossings."""
    nodes, ends = _star()
    return _build(folder, "bare", nodes, _star_edges(ends, **_TOWN), _KEEP)


def build_far_away(folder: Path) -> Path:
    """The bare junction, 5,000 km from the coordinates' zero."""
    nodes, ends = _star()
    return _build(
        folder,
        "far_away",
        nodes,
        _star_edges(ends, **_TOWN),
        _KEEP,
        "--offset.x=4987654",
        "--offset.y=5012345",
    )


def build_spider(folder: Path) -> Path:
    """A spider's web of acute and obtuse angles with sidewalks and crossings."""
    target = folder / "spider.net.xml"
    shape = ("--spider", "--spider.arm-number=5", "--spider.circle-number=2", "--spider.space-radius=60")
    run_sumo_tool("netgenerate", *shape, *_WALK, "--default.lanenumber=1", "-j=traffic_light", "-o", target)
    return target


def build_random(folder: Path) -> Path:
    """A random net with several lanes, sidewalks and crossings."""
    target = folder / "random.net.xml"
    shape = ("--rand", "--rand.iterations=22", "--rand.min-distance=60", "--rand.max-distance=140")
    run_sumo_tool("netgenerate", *shape, *_WALK, "--seed=11", "--default.lanenumber=2", "-o", target)
    return target


def generate_network(folder: Path, seed: int) -> Path:
    """Let netgenerate make up a network: a tangle, a web or a grid, with pavement or not, either hand."""
    chance = random.Random(seed)  # noqa: S311 - no secret
    shape = chance.choice(
        [
            ["--rand", "--rand.iterations=40", f"--rand.min-angle={chance.choice([15, 45])}"],
            ["--spider", f"--spider.arm-number={chance.randint(3, 13)}", "--spider.space-radius=40"],
            ["--grid", f"--grid.number={chance.randint(2, 4)}", "--grid.length=60"],
        ]
    )
    pavement = chance.choice([(), ("--default.sidewalk-width=2",), _WALK])
    side = ("--lefthand",) if chance.random() < 0.5 else ()
    lanes = f"--default.lanenumber={chance.randint(1, 3)}"
    target = folder / f"generated{seed}.net.xml"
    run_sumo_tool(
        "netgenerate", *shape, *pavement, *side, lanes, f"--seed={seed}", "-j=traffic_light", "-o", target
    )
    return target


def build_crowded(folder: Path) -> Path:
    """A random net of wide roads with a signal at every end, so close that roads reach into each other."""
    target = folder / "crowded.net.xml"
    shape = ("--rand", "--rand.iterations=40", "--seed=5", "--default.lanenumber=3", "--turn-lanes=1")
    run_sumo_tool("netgenerate", *shape, *_WALK, "-j=traffic_light", "-o", target)
    return target


def build_mixed_lanes(folder: Path) -> Path:
    """Bus and bike lanes, tram tracks beside and in the road, custom widths, a hard shoulder, a canal."""
    nodes, ends = _star()
    walk, bike = {"allow": "pedestrian", "width": "3"}, {"allow": "bicycle", "width": "1.25"}
    bus, tram = {"allow": "bus", "width": "3.5"}, {"allow": "tram", "width": "2.8"}
    drive, narrow = {"disallow": "pedestrian"}, {"disallow": "pedestrian tram rail", "width": "2.6"}
    mixed = {"allow": "passenger tram bus bicycle", "width": "3.75"}
    shoulder = {"disallow": "all", "width": "2"}
    legs = {
        "e": [walk, bike, bus, narrow, tram],
        "n": [walk, drive, mixed],
        "w": [shoulder, narrow, narrow, drive],
        "s": [bike, bus, mixed],
    }
    edges = []
    for end in ends:
        kind = {"type_": "highway.primary|railway.tram"} if end == "n" else {}
        edges.append(_edge(end, end, "c", *legs[end], speed=13.89, **kind))
        edges.append(_edge(f"-{end}", "c", end, *legs[end], speed=13.89, **kind))
    nodes += [_node("quay_a", -150, -60), _node("quay_b", -60, -150), _node("track_a", 150, -40)]
    nodes += [_node("track_b", 40, -150)]
    edges.append(_edge("canal", "quay_a", "quay_b", {"allow": "ship", "width": "12"}, speed=3))
    edges.append(_edge("track", "track_a", "track_b", {"allow": "rail", "width": "3"}, speed=30))
    return _build(folder, "mixed_lanes", nodes, edges, _KEEP, "--crossings.guess", "--walkingareas")


def build_roundabout(folder: Path) -> Path:
    """A roundabout of two lanes with four legs, sidewalks and crossings."""
    ring = {"r0": (24, 0), "r1": (0, 24), "r2": (-24, 0), "r3": (0, -24)}
    legs = {"e": (140, 0), "n": (0, 140), "w": (-140, 0), "s": (0, -140)}
    nodes = [_node(name, *at) for name, at in {**ring, **legs}.items()]
    edges = [
        edge for leg, at in zip(legs, ring, strict=True) for edge in _both_ways(leg, leg, at, speed=13.89)
    ]
    arcs = ("22,9 17,17 9,22", "-9,22 -17,17 -22,9", "-22,-9 -17,-17 -9,-22", "9,-22 17,-17 22,-9")
    order = [*ring, "r0"]
    for index, arc in enumerate(arcs):
        a, b = order[index], order[index + 1]
        shape = " ".join(f"{x},{y}" for x, y in [ring[a], *_positions(arc), ring[b]])
        edges.append(_edge(f"ring{index}", a, b, numLanes=2, speed=8, priority=5, shape=shape))
    return _build(folder, "roundabout", nodes, edges, _KEEP, *_WALK, "--roundabouts.guess")


def _positions(text: str) -> list[tuple[str, ...]]:
    return [tuple(pair.split(",")) for pair in text.split()]


def build_rail_crossing(folder: Path) -> Path:
    """A road with sidewalks over two railway tracks."""
    nodes = [
        _node("c", 0, 0, type_="rail_crossing"),
        _node("e", 120, 0),
        _node("w", -120, 0),
        _node("n", 10, 150),
        _node("s", -10, -150),
    ]
    rail = {"allow": "rail", "width": "3"}
    edges = [*_both_ways("e", "e", "c", speed=13.89), *_both_ways("w", "w", "c", speed=13.89)]
    edges += [_edge("n_in", "n", "c", rail, speed=30), _edge("s_out", "c", "s", rail, speed=30)]
    edges += [_edge("s_in", "s", "c", rail, speed=30), _edge("n_out", "c", "n", rail, speed=30)]
    return _build(folder, "rail_crossing", nodes, edges, _KEEP, "--sidewalks.guess")


def build_lane_changes(folder: Path) -> Path:
    """Three equal roads of two lanes: changing lanes is free, forbidden, and allowed from one side only."""
    nodes, edges = [], []
    rules: dict[str, tuple[dict[str, object], dict[str, object]]] = {
        "free": ({}, {}),
        "closed": ({"changeLeft": "authority"}, {"changeRight": "authority"}),
        "half": ({}, {"changeRight": "authority"}),
    }
    for row, (name, lanes) in enumerate(rules.items()):
        nodes += [_node(f"{name}_a", 0, 60 * row), _node(f"{name}_b", 400, 60 * row)]
        edges.append(_edge(name, f"{name}_a", f"{name}_b", *lanes, speed=13.89))
    return _build(folder, "lane_changes", nodes, edges, _KEEP)


def build_strange_names(folder: Path) -> Path:
    """Names with everything XML has to escape and ids with everything that SUMO lets through."""
    nodes = [
        _node("a/b#1(x)", 0, 0, type_="traffic_light", tl="licht-größe%20{1}"),
        _node("straße", 120, 5),
        _node("c~d=e", -120, -5),
        _node("§$@", 10, 130),
        _node("-1", -10, -120),
    ]
    names = {
        "straße": 'Ampère & Söhne <b>\'s "Allee"',
        "c~d=e": "<script>alert(1)</script>",
        "§$@": "]]> & ; -- 東京",
        "-1": "  spaced   out  ",
    }
    edges = [
        edge
        for end, name in names.items()
        for edge in _both_ways(f"{end}+in", end, "a/b#1(x)", numLanes=2, speed=13.89, name=name)
    ]
    return _build(folder, "strange names & co", nodes, edges, _KEEP, "--output.street-names", *_WALK)


def build_village(folder: Path) -> Path:
    """Winding one-lane roads, a sharp fork, dead ends and a right-before-left junction; no signals."""
    nodes = [
        _node("c", 0, 0, type_="right_before_left"),
        _node("f", 90, 20, type_="priority"),
        _node("e1", 210, 40),
        _node("e2", 200, 75),
        _node("n", -40, 110),
        _node("w", -160, -20),
        _node("s", 15, -90, type_="dead_end"),
    ]
    edges = [
        *_both_ways("cf", "c", "f", numLanes=1, speed=8.3),
        *_both_ways("fe1", "f", "e1", numLanes=2, speed=13.89),
        *_both_ways("fe2", "f", "e2", numLanes=1, speed=8.3, width="2.75"),
        *_both_ways("cn", "c", "n", numLanes=1, speed=8.3, shape="0,0 15,30 -20,55 -5,80 -40,110"),
        *_both_ways("cw", "c", "w", numLanes=1, speed=8.3, spreadType="center"),
        *_both_ways("cs", "c", "s", numLanes=1, speed=8.3, width="4.4"),
    ]
    return _build(folder, "village", nodes, edges, _KEEP)


def build_no_internal_lanes(folder: Path) -> Path:
    """A signalised junction whose network has no internal lanes, as old or very large networks do."""
    nodes, ends = _star()
    return _build(
        folder, "no_internal_lanes", nodes, _star_edges(ends, **_TOWN), _KEEP, "--no-internal-links"
    )


def build_flat_overpass(folder: Path) -> Path:
    """Two roads that cross without a junction and without heights, as a bridge in careless map data."""
    nodes = [_node("w", -120, 0), _node("e", 120, 0), _node("s", -20, -120), _node("n", 20, 120)]
    edges = [*_both_ways("under", "w", "e", **_TOWN), *_both_ways("over", "s", "n", **_TOWN)]
    return _build(folder, "flat_overpass", nodes, edges, _KEEP)


_SECOND_PROGRAM = """
    <tlLogic id="c" type="actuated" programID="night &amp; fog" offset="12.50">
        <param key="max-gap" value="3.0"/>
        <phase duration="31.50" minDur="5.00" maxDur="45.00" state="{green}" name="go"/>
        <phase duration="3.00" state="{yellow}"/>
        <phase duration="42" state="{red}" next="0"/>
    </tlLogic>
"""


def build_two_programs(folder: Path) -> Path:
    """The bare junction with a second, actuated program with an offset."""
    text = build_bare(folder).read_text(encoding="utf-8")
    size = len(text.split('state="', 1)[1].split('"', 1)[0])
    states = {"green": "G" * (size // 2), "yellow": "y" * (size // 2), "red": "r" * (size // 2)}
    rest = size - size // 2
    program = _SECOND_PROGRAM.format(**{key: value + "r" * rest for key, value in states.items()})
    target = folder / "two_programs.net.xml"
    target.write_text(text.replace("</tlLogic>", f"</tlLogic>{program}", 1), encoding="utf-8")
    return target


def build_rough_shapes(folder: Path) -> Path:
    """A valid network with what real data brings: repeated points, a twisted and two empty floors, spikes."""
    nodes, ends = _star()
    nodes.append(_node("far", 300, 12))
    edges = [*_star_edges(ends, **_TOWN), *_both_ways("more", "far", "e", **_TOWN)]
    text = _build(folder, "rough_base", nodes, edges, _KEEP).read_text(encoding="utf-8")
    text = _change_shape(text, '<lane id="n_0"', lambda points: [points[0], *points, points[-1]])
    text = _change_shape(text, '<lane id="s_1"', lambda points: [points[0], points[0], points[-1]])
    text = _change_shape(text, '<junction id="c"', lambda points: [points[1], points[0], *points[2:]])
    text = _change_shape(text, '<junction id="far"', lambda points: points[:1] * 3)
    text = _change_shape(text, '<junction id="w"', lambda points: points[:2])
    target = folder / "rough_shapes.net.xml"
    target.write_text(text, encoding="utf-8")
    return target


def _change_shape(text: str, start: str, change: Callable[[list[str]], list[str]]) -> str:
    head, _, tail = text.partition(start)
    before, _, after = tail.partition(' shape="')
    shape, _, rest = after.partition('"')
    return f'{head}{start}{before} shape="{" ".join(change(shape.split()))}"{rest}'


BUILDERS: dict[str, Callable[[Path], Path]] = {
    "bridge": build_bridge,
    "slope": build_slope,
    "right_hand": build_right_hand,
    "left_hand": build_left_hand,
    "five_legs": build_five_legs,
    "six_legs": build_six_legs,
    "walkers_signal": build_walkers_signal,
    "bare": build_bare,
    "left_hand_bare": build_left_hand_bare,
    "far_away": build_far_away,
    "spider": build_spider,
    "random": build_random,
    "crowded": build_crowded,
    "mixed_lanes": build_mixed_lanes,
    "roundabout": build_roundabout,
    "rail_crossing": build_rail_crossing,
    "lane_changes": build_lane_changes,
    "strange_names": build_strange_names,
    "village": build_village,
    "no_internal_lanes": build_no_internal_lanes,
    "flat_overpass": build_flat_overpass,
    "two_programs": build_two_programs,
    "rough_shapes": build_rough_shapes,
}
