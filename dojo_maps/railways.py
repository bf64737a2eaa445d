"""What of a map belongs to trains."""

from dojo_maps.description import LaneKind, RoadMap, Signal

_JUNCTIONS = ("rail_signal", "rail_crossing")
"""SUMO's types of junctions that guard trains, and the street from them."""


def street_signals(road_map: RoadMap) -> tuple[Signal, ...]:
    """List the signals of the street; SUMO itself sees to those that guard railways only.

    Args:
        road_map: the map.

    Returns:
        The signals.
    """
    junctions = {junction.id: junction.kind for junction in road_map.junctions}
    lanes = {lane.id: lane.kind for lane in road_map.lanes}

    def guards_trains(signal: Signal) -> bool:
        if any(program.kind.startswith("rail") for program in signal.programs):
            return True
        if signal.junctions and all(junctions.get(name) in _JUNCTIONS for name in signal.junctions):
            return True
        kinds = [lanes[link.from_id] for link in signal.links if link.from_id in lanes]
        return bool(kinds) and all(kind is LaneKind.RAIL for kind in kinds)

    return tuple(signal for signal in road_map.signals if not guards_trains(signal))
