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
    timing_checks,
    topology_checks,
    turn_checks,
)

_THEMES = ("geometry", "topology", "signals", "pedestrians", "osm")
_MODULES = (
    overlap_checks, shape_checks, geometry_checks, drawing_checks, topology_checks, turn_checks,
    signal_checks, controller_checks, timing_checks, pedestrian_checks, osm_checks,
)  # fmt: skip

CHECKS = tuple(
    sorted(
        (check for module in _MODULES for check in module.CHECKS),
        key=lambda check: (_THEMES.index(check.id.partition(".")[0]), check.code),
    )
)
