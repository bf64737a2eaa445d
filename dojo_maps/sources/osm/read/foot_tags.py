"""Where people walk, by tags: crossings of a road, as nodes and as ways, and sidewalks beside one."""

from dojo_maps.sources.osm.read.data import Tags

_FOR_WALKERS = ("pedestrian_crossing", "pedestrian", "crossing")
"""Kinds of signals that stop traffic for people who cross."""
_MARKED = ("traffic_signals", "uncontrolled", "marked", "zebra", "island")
"""Kinds of crossings that are painted."""


def is_crossing_node(tags: Tags) -> bool:
    """Tell whether people cross a road at a node of it.

    Args:
        tags: of the node.

    Returns:
        Whether they do; not where it says `crossing=no`, nor at a railway.
    """
    named = tags.get("highway") == "crossing" or tags.get("crossing", "no") != "no"
    named = named or tags.get("traffic_signals") in _FOR_WALKERS
    return named and tags.get("crossing") != "no" and "railway" not in tags


def is_crossing_way(tags: Tags) -> bool:
    """Tell whether a way leads people over a road.

    Args:
        tags: of the way.

    Returns:
        Whether it does; not where it says `crossing=no`.
    """
    return "crossing" in (tags.get("footway"), tags.get("path")) and tags.get("crossing") != "no"


def is_sidewalk(tags: Tags) -> bool:
    """Tell whether a way is a separately mapped sidewalk.

    Args:
        tags: of the way.

    Returns:
        Whether it is, as a footway or as a path.
    """
    return tags.get("footway") == "sidewalk" or tags.get("path") == "sidewalk"


def is_signalised_crossing(tags: Tags) -> bool:
    """Tell whether those who cross have lights.

    Args:
        tags: of the crossing, a node or a way.

    Returns:
        Whether they have, as far as the tags say.
    """
    return (
        "traffic_signals" in (tags.get("crossing"), tags.get("highway"))
        or tags.get("crossing:signals") == "yes"
    )


def is_marked_crossing(tags: Tags) -> bool:
    """Tell whether a crossing is painted, so that traffic gives way; it is where nothing is said.

    Args:
        tags: of the crossing, a node or a way.

    Returns:
        Whether it is.
    """
    marks = tags.get("crossing:markings")
    if marks not in (None, "no"):
        return True
    return tags.get("crossing") in _MARKED or ("crossing" not in tags and marks is None)
