"""Does a bundle hold together: map.json against the network that it describes, and what it adds against both.

The network is described anew, and that description is used. What map.json repeats of it must be the same;
what it adds must refer to what is there.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from dojo_maps.description import Origin, RoadMap, Signal
from dojo_maps.errors import DescriptionError
from dojo_maps.serialization import from_json, to_json

_VALUES = ("projection", "origin", "bounds", "left_hand")
_LISTS = ("roads", "lanes", "connections", "junctions", "walking_areas", "walks")
"""What map.json repeats of the network, whole."""
_ADDED_TO = ("sidewalks", "crossings")
"""What holds generated things, too."""
_MOST_LETTERS = 10_000
"""Of a signal without a program that would tell how many it has."""


def check_description(value: Any, network: RoadMap, path: object) -> RoadMap:
    """Build a bundle's description from its network, and from what its map.json adds.

    Args:
        value: map.json, parsed.
        network: the bundle's network, described anew.
        path: of map.json, for errors.

    Returns:
        The description.

    Raises:
        DescriptionError: map.json is no description, contradicts the network, or refers to what is not there;
            or a signal of the network has other letters than links.
    """
    wanted = _repeated(to_json(network))
    try:
        said = _repeated(value)
    except (AttributeError, KeyError, TypeError):
        said = {}
    if said != wanted:
        from_json(value, path=path)  # Has words for what is no description at all.
        _refuse_contradiction(said, wanted, path)
    # What has been compared need not be read a second time; maps of before a list was added lack it.
    own = from_json({**value, **{name: [] for name in _LISTS if name in value}}, path=path)
    heads = {signal.id: signal.heads for signal in own.signals}
    road_map = replace(
        network,
        name=own.name,
        source=own.source,
        sidewalks=network.sidewalks + tuple(s for s in own.sidewalks if s.origin is Origin.GENERATED),
        crossings=network.crossings + tuple(c for c in own.crossings if c.origin is Origin.GENERATED),
        signals=tuple(replace(signal, heads=heads[signal.id]) for signal in network.signals),
        stop_lines=own.stop_lines,
        props=own.props,
    )
    for element, problem in (*_find_dangling(road_map), *_find_misfits(road_map.signals)):
        raise DescriptionError(path, f"{problem}, then convert the map again", element=element)
    return road_map


def _repeated(value: Mapping[str, Any]) -> dict[str, Any]:
    """Take from a map's JSON values what its network says."""
    repeated = {name: value[name] for name in (*_VALUES, *_LISTS) if name in value}
    for name in _ADDED_TO:
        repeated[name] = [thing for thing in value[name] if thing["origin"] == Origin.NETWORK]
    repeated["signals"] = [{k: v for k, v in signal.items() if k != "heads"} for signal in value["signals"]]
    return repeated


def _refuse_contradiction(said: Mapping[str, Any], wanted: Mapping[str, Any], path: object) -> None:
    """Name the first value that differs; a field that maps did not have once says nothing."""
    for name, found in said.items():
        there = wanted[name]
        if name in _VALUES:
            difference = _first_difference(found, there, name)
            if difference:
                raise DescriptionError(path, difference)
        elif len(found) != len(there):
            raise DescriptionError(path, _contradiction(name, f"{len(found)} long", len(there)))
        else:
            for thing, same in zip(found, there, strict=True):
                difference = _first_difference(thing, same, "")
                if difference:
                    named = same.get("id") or f"{same['from']}->{same['to']}"
                    raise DescriptionError(path, difference, element=f"{name.removesuffix('s')} {named}")


def _first_difference(found: Any, wanted: Any, where: str) -> str | None:
    """Say where JSON values differ first, if anywhere."""
    if isinstance(found, dict) and isinstance(wanted, dict):
        pairs = [(found[key], wanted[key], f"{where}.{key}".lstrip(".")) for key in found if key in wanted]
    elif isinstance(found, list) and isinstance(wanted, list) and len(found) == len(wanted):
        pairs = [(f, w, f"{where}[{k}]") for k, (f, w) in enumerate(zip(found, wanted, strict=True))]
    else:
        return None if found == wanted else _contradiction(where, repr(found), repr(wanted))
    return next(filter(None, (_first_difference(*pair) for pair in pairs)), None)


def _contradiction(where: str, found: object, wanted: object) -> str:
    return f"{where} is {found!s:.60}, its network.net.xml has {wanted!s:.60}; convert the map again"


def _find_dangling(road_map: RoadMap) -> Iterator[tuple[str, str]]:
    """List what was added to a map and refers to what it does not have, and how."""
    roads = {road.id for road in road_map.roads}
    lanes = {lane.id for lane in road_map.lanes}
    junctions = {junction.id for junction in road_map.junctions}
    for line in road_map.stop_lines:
        if line.lane not in lanes:
            yield f"stop_line of {line.lane}", "there is no such lane; mend that"
    for walk in road_map.sidewalks:
        if walk.road is not None and walk.road not in roads:
            yield f"sidewalk {walk.id}", f"there is no road {walk.road!r:.60}; mend that"
    for crossing in road_map.crossings:
        if crossing.origin is Origin.NETWORK:
            continue
        if crossing.junction not in junctions or not roads.issuperset(crossing.roads):
            yield f"crossing {crossing.id}", "it lies at a junction or road that is not there; mend that"
        if (crossing.signal, crossing.link_index) != (None, None):
            yield f"crossing {crossing.id}", "it has a signal, as no generated crossing has; mend that"


def _find_misfits(signals: Iterable[Signal]) -> Iterator[tuple[str, str]]:
    """List signals whose states, links and heads do not fit each other, and how."""
    for signal in signals:
        lengths = sorted({len(phase.state) for program in signal.programs for phase in program.phases})
        if len(lengths) > 1:
            yield f"signal {signal.id}", f"its states have {lengths} letters; mend the network"
        letters = lengths[0] if lengths else _MOST_LETTERS
        for thing, indices in (
            ("link", [link.index for link in signal.links]),
            ("head of link", [index for head in signal.heads for index in head.link_indices]),
        ):
            beyond = [index for index in indices if not 0 <= index < letters]
            if beyond:
                yield (
                    f"signal {signal.id}",
                    f"its {thing} {beyond[0]} has none of {letters} letters; mend that",
                )
