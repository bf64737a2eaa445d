"""What `enrich_net` reports: every lane's new id, what was added, what changed, and signal by signal.

JSON values only; lengths in metres, speeds in m/s, times in seconds.
"""

from collections.abc import Mapping, Sequence
from typing import Any
from xml.etree.ElementTree import Element

from dojo_maps.sources.net_tree import NetTree, crossing_junction, lane_classes, shifted
from dojo_maps.sources.pedestrian_timing import Walk
from dojo_maps.sources.transplant import ProgramChange

_PRECISION = 0.005
"""Half of netconvert's last digit, in metres and m/s."""


def lane_report(old: NetTree, new: NetTree, lane_ids: Mapping[str, str]) -> dict[str, Any]:
    """List every lane's new id, then the lanes whose length, speed, width or classes differ.

    Args:
        old: the network before.
        new: the network with sidewalks.
        lane_ids: new lane id by old one, for every lane of the old network.

    Returns:
        JSON values: `lane_ids`, `lengths` and `lanes_changed`.
    """
    before = {lane.get("id"): lane for road in old.roads for lane in old.lanes(road)}
    after = {lane.get("id"): lane for road in new.roads for lane in new.lanes(road)}
    lengths, others = [], []
    for lane, moved in lane_ids.items():
        first, last = before[lane], after[moved]
        length, *rest = (_numbers(first, last, key) for key in ("length", "speed", "width"))
        if length:
            lengths.append({"lane": moved, "was": lane, "before": length[0], "after": length[1]})
        changes: dict[str, Any] = {
            key: pair for key, pair in zip(("speed", "width"), rest, strict=True) if pair
        }
        changes |= {
            key: sorted(classes)
            for key, classes in (
                ("classes_added", lane_classes(last) - lane_classes(first)),
                ("classes_removed", lane_classes(first) - lane_classes(last)),
            )
            if classes
        }
        if changes:
            others.append({"lane": moved, "was": lane, **changes})
    return {"lane_ids": dict(lane_ids), "lengths": lengths, "lanes_changed": others}


def _numbers(before: Element, after: Element, key: str) -> list[float] | None:
    """Compare a lane's number, in metres or m/s; None where it stayed."""
    pair = [float(element.get(key, "3.2")) for element in (before, after)]
    return pair if abs(pair[0] - pair[1]) > _PRECISION else None


def connection_report(old: NetTree, new: NetTree, shift: Mapping[str, int]) -> list[dict[str, Any]]:
    """List connections whose direction or right of way netconvert judges differently now.

    Args:
        old: the network before.
        new: the network with sidewalks, with all of the old connections between roads.
        shift: by road, how far its lanes' indices moved.

    Returns:
        JSON values: the new network's lanes, and `dir` or `state` as [before, after] where they differ.
    """
    changes = []
    for key, before in old.vehicle_links.items():
        moved = shifted(key, shift)
        after = new.vehicle_links[moved]
        pairs = {word: [before.get(word), after.get(word)] for word in ("dir", "state")}
        differing = {word: pair for word, pair in pairs.items() if pair[0] != pair[1]}
        if differing:
            changes.append({"from": f"{moved[0]}_{moved[1]}", "to": f"{moved[2]}_{moved[3]}", **differing})
    return changes


def junction_report(old: NetTree, new: NetTree) -> list[dict[str, Any]]:
    """List junctions that are gone or have another kind.

    Args:
        old: the network before.
        new: the network after.

    Returns:
        JSON values: each one's id and [kind before, kind after]; None after where it is gone.
    """
    kinds = {junction: element.get("type") for junction, element in new.junctions.items()}
    return [
        {"junction": junction, "kind": [element.get("type"), kinds.get(junction)]}
        for junction, element in old.junctions.items()
        if kinds.get(junction) != element.get("type")
    ]


def added_report(old: NetTree, new: NetTree, shift: Mapping[str, int]) -> dict[str, Any]:
    """List sidewalks, crossings (lengths in metres) and walking areas that the old network did not have.

    Args:
        old: the network before.
        new: the network with sidewalks and crossings.
        shift: by road of the new network, how far its lanes' indices moved: 1 where a sidewalk was added.

    Returns:
        JSON values: `sidewalks_added`, `crossings_added` and `walking_areas_added`.
    """
    crossings = [crossing for crossing in new.crossings if crossing not in old.crossings]
    return {
        "sidewalks_added": [new.lanes(road)[0].get("id") for road in new.roads if shift[road]],
        "crossings_added": [
            {
                "id": crossing,
                "junction": crossing_junction(crossing),
                "roads": new.crossings[crossing].get("crossingEdges", "").split(),
                "length": new.crossing_length(crossing),
            }
            for crossing in crossings
        ],
        "walking_areas_added": [area for area in new.walking_areas if area not in old.walking_areas],
    }


def signal_report(
    walks: Mapping[str, Sequence[Walk]], programs: Sequence[ProgramChange], kept: Sequence[bool]
) -> list[dict[str, Any]]:
    """Tell by signal which letters were appended, and by program what it shows to them; times in seconds.

    Args:
        walks: the new crossings of each signal.
        programs: what was done to each program.
        kept: for each of `programs`, in order, whether vehicles are shown the same as before.

    Returns:
        JSON values, an object for each signal that has a program or a new crossing.
    """
    return [
        {
            "id": signal,
            "links_appended": [
                {"index": walk.index, "crossing": walk.crossing, "clearance": float(walk.clearance)}
                for walk in walks.get(signal, ())
            ],
            "programs": [
                _program_report(program, same)
                for program, same in zip(programs, kept, strict=True)
                if program.signal == signal
            ],
        }
        for signal in dict.fromkeys([*(program.signal for program in programs), *walks])
    ]


def _program_report(program: ProgramChange, same: bool) -> dict[str, Any]:
    return {
        "id": program.program,
        "kind": program.kind,
        "phases_before": program.phases[0],
        "phases_after": program.phases[1],
        "vehicle_letters_equal": same,
        "parameters_renamed": dict(program.renamed),
        "crossings": [
            {
                "crossing": crossing,
                "green": float(times.green),
                "shared_with_protected_turns": float(times.yielding),
                "never_green": times.reason,
            }
            for crossing, times in program.crossings.items()
        ],
    }
