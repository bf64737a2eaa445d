"""The map in other programs' formats. Each writer loads only when it is called."""

import importlib
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

from dojo_maps.description import RoadMap

Exporter = Callable[[RoadMap, Path], None]
"""Takes the description, and an existing empty folder to write in."""


def _write(format_name: str, road_map: RoadMap, folder: Path) -> None:
    module = importlib.import_module(f"dojo_maps.exports.{format_name}")
    getattr(module, f"write_{format_name}")(road_map, folder)


EXPORTERS: dict[str, Exporter] = {
    name: partial(_write, name) for name in ("metadrive", "opendrive", "geojson", "lanelet2")
}
"""Every format by the name that `--export` takes."""


def file_stem(road_map: RoadMap) -> str:
    """Turn the map's name into one that is safe as a file's, whatever the description says.

    Args:
        road_map: whose name it is.

    Returns:
        The name with `_` for all but letters, digits, `_`, `.` and `-`; `map` where the map has no name.
    """
    return re.sub(r"[^\w.-]", "_", road_map.name) or "map"
