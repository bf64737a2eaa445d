"""Road maps: read a SUMO network, describe it, mesh it, check it and export it."""

from dojo_maps.bundle import Bundle, read_bundle
from dojo_maps.convert import ConvertOptions, convert
from dojo_maps.description import RoadMap
from dojo_maps.errors import DojoError

__all__ = ["Bundle", "ConvertOptions", "DojoError", "RoadMap", "convert", "read_bundle"]
