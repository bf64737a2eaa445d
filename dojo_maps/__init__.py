"""Road maps: read a SUMO network or OpenStreetMap, describe it, mesh it, check it, mend it and export it."""

from dojo_maps import interruption

# Before anything that takes longer to load.
interruption.begin_command("dojo-maps", "dojo-maps: interrupted; every bundle is as it was, or complete")

from typing import TYPE_CHECKING  # noqa: E402

from dojo_maps.lazy_names import attach  # noqa: E402

if TYPE_CHECKING:
    from dojo_maps.bundle import Bundle, open_bundle, read_bundle
    from dojo_maps.conversion import ConvertOptions, convert
    from dojo_maps.demand import DemandOptions
    from dojo_maps.description import RoadMap
    from dojo_maps.errors import DojoError, SourceError, UsageError
    from dojo_maps.operations import add_demand, draw_signal, fix, import_osm, validate
    from dojo_maps.sources.files import list_files

    __version__: str

__all__ = [
    "Bundle",
    "ConvertOptions",
    "DemandOptions",
    "DojoError",
    "RoadMap",
    "SourceError",
    "UsageError",
    "add_demand",
    "convert",
    "draw_signal",
    "fix",
    "import_osm",
    "list_files",
    "open_bundle",
    "read_bundle",
    "validate",
]

__getattr__, __dir__ = attach(
    __name__,
    {
        "bundle": "Bundle open_bundle read_bundle",
        "conversion": "ConvertOptions convert",
        "demand": "DemandOptions",
        "description": "RoadMap",
        "errors": "DojoError SourceError UsageError",
        "operations": "add_demand draw_signal fix import_osm validate",
        "sources.files": "list_files",
    },
)
