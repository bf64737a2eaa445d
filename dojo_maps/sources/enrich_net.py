"""Make a SUMO network with real sidewalks, crossings and walking areas, and report all that changed by it.

netconvert adds them; the original signal programs are then transplanted (`pedestrian_links`, `transplant`),
because netconvert replaces each by one of its own. The result is read again and compared with the input:
what the report calls equal has been compared, and a difference for vehicles is an error, never a report line.
"""

from collections.abc import Mapping, Sequence
from decimal import Decimal
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from dojo_maps.sources.enrich_report import (
    added_report,
    connection_report,
    junction_report,
    lane_report,
    signal_report,
)
from dojo_maps.sources.net_tree import NetTree, lane_classes, shifted
from dojo_maps.sources.netconvert import NetconvertError, build_again
from dojo_maps.sources.pedestrian_links import TransplantError, restore_link_indices
from dojo_maps.sources.pedestrian_timing import Walk
from dojo_maps.sources.transplant import ProgramChange, transplant_programs

FORMAT = "dojo-enrichment"
VERSION = 1
_URBAN_SPEED = "14"
"""m/s, 50 km/h however rounded: faster roads get no sidewalks, and crossings only at signals."""
_CONTROLLED = ("traffic_light", "rail_")
GUESS = (
    *("--sidewalks.guess", "--sidewalks.guess.max-speed", _URBAN_SPEED),
    *("--crossings.guess", "--crossings.guess.speed-threshold", _URBAN_SPEED, "--walkingareas"),
)


def enrich_network(
    data: bytes, *, path: Path, options: Sequence[str] = GUESS, connections: str = ""
) -> tuple[bytes, dict[str, Any]]:
    """Add sidewalks, crossings and walking areas to a network and keep its signal programs.

    Args:
        data: the network's bytes, unpacked.
        path: where they came from, for errors.
        options: of netconvert, that say what to add.
        connections: a plain connection file that names crossings to add.

    Returns:
        The new network's bytes, and the report as JSON values; both the same for the same input. Where no
        sidewalk or crossing fits, the bytes are the input's.

    Raises:
        SourceError: the bytes are not a SUMO network, or one of its signals is broken.
        NetconvertError: netconvert refuses the network or crashes on it.
        TransplantError: netconvert changed something for vehicles that cannot be put back.
        ToolMissingError: netconvert is not installed.
    """
    old = NetTree(data, path=path)
    try:
        built, warnings = build_again(data, options, connections=connections)
    except NetconvertError as error:
        raise NetconvertError(f"{path}: no sidewalks and crossings could be added: {error}") from error
    new = NetTree(built, path=path)
    match_junctions(old, new)
    lane_ids, shift = match_lanes(old, new)
    added = any(shift.values()) or len(new.crossings) > len(old.crossings)
    if not added:
        new, lane_ids = NetTree(data, path=path), {lane: lane for lane in lane_ids}
    walks = restore_link_indices(old, new, shift)
    programs = transplant_programs(old, new, walks, lane_ids)
    _keep_types(old, new)
    result = new.to_bytes() if added else data
    again = NetTree(result, path=path)
    return result, {
        "format": FORMAT,
        "version": VERSION,
        "sumo_version": new.root.get("version", ""),
        **lane_report(old, again, lane_ids),
        **added_report(old, again, shift),
        "connections_changed": connection_report(old, again, shift),
        "junctions_changed": junction_report(old, again),
        **_proof(old, again, shift, walks, programs),
        "netconvert_warnings": list(warnings),
    }


def match_lanes(old: NetTree, new: NetTree) -> tuple[dict[str, str], dict[str, int]]:
    """Find each lane of the old network in the new one.

    Args:
        old: the network before.
        new: the network as netconvert built it.

    Returns:
        New lane id by old one, and by road how far its lanes' indices moved: 1 where a sidewalk was added.

    Raises:
        TransplantError: roads or lanes differ by more than added sidewalks.
        SourceError: a lane's index is no whole number.
    """
    for road in old.roads.keys() ^ new.roads.keys():
        done = "dropped" if road in old.roads else "added"
        raise TransplantError(f"{old.path}: netconvert {done} the road {road}")
    lane_ids, shift = {}, {}
    for road in old.roads:
        before, after = old.lanes(road), new.lanes(road)
        shift[road] = len(after) - len(before)
        if shift[road] not in (0, 1) or (shift[road] and lane_classes(after[0]) != {"pedestrian"}):
            raise TransplantError(
                f"{old.path}: netconvert changed the lanes of road {road}, and not by a sidewalk"
            )
        for lane, moved in zip(before, after[shift[road] :], strict=True):
            lane_ids[lane.get("id", "")] = moved.get("id", "")
    return lane_ids, shift


def match_junctions(old: NetTree, new: NetTree) -> None:
    """Check that every junction with a signal or a rail crossing is still there and controlled as it was.

    Args:
        old: the network before.
        new: the network as netconvert built it.

    Raises:
        TransplantError: one is not, such as a rail crossing without rails, which netconvert converts.
    """
    for junction, before in old.junctions.items():
        kind = before.get("type", "")
        after = new.junctions[junction].get("type", "") if junction in new.junctions else "nothing"
        if after != kind and kind.startswith(_CONTROLLED):
            raise TransplantError(f"{old.path}: netconvert made {after} of the {kind} junction {junction}")


def compare_links(old: NetTree, new: NetTree, shift: Mapping[str, int]) -> bool:
    """Tell whether every connection and every old crossing has the signal and the letter it had.

    Args:
        old: the network before.
        new: the network with crossings and their signals' letters.
        shift: by road, how far its lanes' indices moved.

    Returns:
        Whether it has; False, too, where connections between roads went missing or came up.
    """

    def control(link: Element) -> tuple[str | None, str | None]:
        return link.get("tl"), link.get("linkIndex")

    before = {shifted(key, shift): control(link) for key, link in old.vehicle_links.items()}
    after = {key: control(link) for key, link in new.vehicle_links.items()}
    walks_after = {key: control(link) for key, link in new.walk_links.items()}
    return before == after and all(
        walks_after.get(key) == control(link) for key, link in old.walk_links.items()
    )


def compare_programs(before: Element, after: Element) -> bool:
    """Tell whether a program shows its old links the same letters, for the same times, in the same order.

    Each old phase must come back as one phase or several in a row with its letters, that last as long
    together; where a program may choose (actuated), their least and longest times must add up as well.
    `next` must name the first of each following phase's.

    Args:
        before: the program's `tlLogic` in the old network.
        after: that in the new one, where letters may have been appended to the states.

    Returns:
        Whether it does, and its own attributes are the same.
    """
    attributes = [dict(logic.attrib) for logic in (before, after)]
    phases, parts = before.findall("phase"), after.findall("phase")
    groups = _group_parts(phases, parts)
    if attributes[0] != attributes[1] or groups is None:
        return False
    firsts = {start: str(sum(map(len, groups[:start]))) for start in range(len(groups))}
    chooses = before.get("type", "static") != "static"
    for phase, group in zip(phases, groups, strict=True):
        following = [firsts.get(int(start), "") for start in phase.get("next", "").split()]
        if group[-1].get("next", "").split() != following or any(
            "next" in part.attrib for part in group[:-1]
        ):
            return False
        if len(group) > 1 and chooses and not _sums_equal(phase, group, ("minDur", "maxDur")):
            return False
        if len(group) == 1 and _other_attributes(phase) != _other_attributes(group[0]):
            return False
    return True


def _group_parts(phases: Sequence[Element], parts: Sequence[Element]) -> list[list[Element]] | None:
    """Collect the parts of each phase by their letters and by the time they take; None if they do not fit."""
    rest = list(parts)
    groups = []
    for phase in phases:
        state, wanted, lasted = phase.get("state", ""), Decimal(phase.get("duration", "0")), Decimal(0)
        group: list[Element] = []
        while rest and (not group or lasted < wanted):
            if rest[0].get("state", "")[: len(state)] != state:
                return None
            lasted += Decimal(rest[0].get("duration", "0"))
            group.append(rest.pop(0))
        if not group or lasted != wanted:
            return None
        groups.append(group)
    return None if rest else groups


def _sums_equal(phase: Element, group: Sequence[Element], keys: Sequence[str]) -> bool:
    return all(
        Decimal(phase.attrib[key]) == sum(Decimal(part.get(key, "NaN")) for part in group)
        for key in keys
        if key in phase.attrib
    )


def _other_attributes(phase: Element) -> dict[str, str]:
    return {key: value for key, value in phase.attrib.items() if key not in ("state", "next")}


def _keep_types(old: NetTree, new: NetTree) -> None:
    """Bring back the edge types that netconvert leaves out because no road uses them."""
    known = {kind.get("id") for kind in new.root.iterfind("type")}
    for number, kind in enumerate(kind for kind in old.root.findall("type") if kind.get("id") not in known):
        new.root.insert(1 + number, kind)


def _proof(
    old: NetTree,
    new: NetTree,
    shift: Mapping[str, int],
    walks: Mapping[str, Sequence[Walk]],
    programs: Sequence[ProgramChange],
) -> dict[str, Any]:
    """Compare links and programs of the two networks as they were read, and report signal by signal.

    Raises:
        TransplantError: one of them differs for vehicles.
    """
    ids = {logic.get("id") for logic in old.logics()}
    after = [logic for logic in new.logics() if logic.get("id") in ids]
    links = compare_links(old, new, shift)
    kept = [compare_programs(*pair) for pair in zip(old.logics(), after, strict=True)]
    if not links or not all(kept):
        wrong = [program.signal for program, same in zip(programs, kept, strict=True) if not same]
        raise TransplantError(
            f"{old.path}: signals changed for vehicles ({', '.join(wrong) or 'links'}); report this network"
        )
    return {"vehicle_links_equal": links, "signals": signal_report(walks, programs, kept)}
