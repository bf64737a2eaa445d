"""Road maps: read a SUMO network, describe it, mesh it, check it and export it."""

from dojo_maps import interruption

# Before anything that takes longer to load.
interruption.begin_command("dojo-maps", "dojo-maps: interrupted; every bundle is as it was, or complete")

import importlib  # noqa: E402
from typing import TYPE_CHECKING, Any  # noqa: E402

if TYPE_CHECKING:
    from dojo_maps.bundle import Bundle, read_bundle
    from dojo_maps.conversion import ConvertOptions, convert
    from dojo_maps.description import RoadMap
    from dojo_maps.errors import DojoError
    from dojo_maps.sources.files import list_files

__all__ = ["Bundle", "ConvertOptions", "DojoError", "RoadMap", "convert", "list_files", "read_bundle"]

_HOMES = {
    "Bundle": "bundle",
    "read_bundle": "bundle",
    "ConvertOptions": "conversion",
    "convert": "conversion",
    "RoadMap": "description",
    "DojoError": "errors",
    "list_files": "sources.files",
}


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used, so that commands start at once."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value
