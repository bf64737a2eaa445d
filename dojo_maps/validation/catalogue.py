"""Every check, in the order of the report."""

from dojo_maps.validation import (
    controller_checks,
    drawing_checks,
    geometry_checks,
    osm_checks,
    overlap_checks,
    pedestrian_checks,
    shape_checks,
    signal_checks,
    sumo_checks,
    timing_checks,
    topology_checks,
    turn_checks,
)
from dojo_maps.validation.check import Check

_THEMES = ("geometry", "topology", "signals", "pedestrians", "sumo", "osm")
_MODULES = (
    overlap_checks, shape_checks, geometry_checks, topology_checks, turn_checks, signal_checks,
    controller_checks, timing_checks, pedestrian_checks, sumo_checks,
)  # fmt: skip

_CHECKS = [value for module in _MODULES for value in vars(module).values() if isinstance(value, Check)]

CHECKS = tuple(
    sorted(
        (*_CHECKS, *drawing_checks.CHECKS, *osm_checks.CHECKS),
        key=lambda check: (_THEMES.index(check.id.partition(".")[0]), check.code),
    )
)
