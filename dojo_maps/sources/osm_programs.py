"""Give each signal of a network the program a city would run."""

from pathlib import Path

from dojo_maps.description import RoadMap


def program_signals(data: bytes, road_map: RoadMap, *, path: Path) -> bytes:
    """Replace the programs of a network."""
    return data
