"""What ways of people are, by their tags: crossings of a road, and sidewalks mapped beside one."""

from dojo_maps.sources.osm.read.data import Tags


def is_crossing_way(tags: Tags) -> bool:
    """Tell whether a way leads people over a road."""
    return "crossing" in (tags.get("footway"), tags.get("path")) and tags.get("crossing") != "no"


def is_sidewalk(tags: Tags) -> bool:
    """Tell whether a way is a separately mapped sidewalk."""
    return tags.get("footway") == "sidewalk" or tags.get("path") == "sidewalk"
