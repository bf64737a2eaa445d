"""What the tags of a way say of a track: a way of its own for trams, trains or bicycles.

Source: OpenStreetMap wiki, Key:railway, Tag:highway=cycleway.
"""

from dojo_maps.sources.osm.read.country import read_speed
from dojo_maps.sources.osm.read.data import Tags
from dojo_maps.sources.osm.read.lane_tags import LaneTags, LaneUse
from dojo_maps.sources.osm.read.lengths import read_length
from dojo_maps.sources.osm.read.way_tags import RoadTags, read_layer

TRAM, RAIL, CYCLEWAY = "railway.tram", "railway.rail", "highway.cycleway"
_RAILWAYS = {"tram": TRAM, "light_rail": TRAM, "rail": RAIL, "narrow_gauge": RAIL}
_SHARED_WAYS = ("path", "footway", "bridleway", "pedestrian")
"""Ways that are cycle tracks where bicycles are named as who they are for."""
_USES = {TRAM: LaneUse.TRAM, RAIL: LaneUse.RAIL}
_WIDTHS = {TRAM: 2.6, RAIL: 3.0, CYCLEWAY: 1.5}
"""Metres of one direction."""
_ONE_WAY_CYCLEWAY = 1.8
_NARROWEST, _WIDEST = 1.0, 3.0
"""Metres of one direction that a cycle track's width may give it."""
_SPEEDS = {TRAM: 50 / 3.6, RAIL: 80 / 3.6, CYCLEWAY: 30 / 3.6}
_NO = ("no", "private", "use_sidepath", "dismount")


def track_kind(tags: Tags) -> str | None:
    """Name the kind of a track as SUMO's types of edges do.

    Args:
        tags: of the way.

    Returns:
        `railway.tram`, `railway.rail` or `highway.cycleway`; None for a way that is no track.
    """
    if tags.get("area") == "yes":
        return None
    if "railway" in tags and tags["railway"] in _RAILWAYS:
        return _RAILWAYS[tags["railway"]]
    highway, bicycle = tags.get("highway"), tags.get("bicycle")
    if highway in _SHARED_WAYS:
        return CYCLEWAY if bicycle == "designated" else None
    shut = bicycle in _NO or (bicycle is None and tags.get("access") in _NO)
    return CYCLEWAY if highway == "cycleway" and not shut else None


def read_track(tags: Tags) -> RoadTags | None:
    """Read a track's tags.

    A track with no word on its direction is two-way. Both directions of a cycle track lie side by side, those
    of rails on the same ground.

    Args:
        tags: of the way.

    Returns:
        The track as a road with one lane in each direction that it is driven in; None for a way that is none.
    """
    kind = track_kind(tags)
    if kind is None:
        return None
    direction = _direction(tags, kind)
    use, width = _USES.get(kind) or _cycled(tags), _lane_width(tags, kind, 1 if direction else 2)
    lane = LaneTags(use=use, width=width)
    speed = _SPEEDS[kind] if kind == CYCLEWAY else read_speed(tags.get("maxspeed", "")) or _SPEEDS[kind]
    return RoadTags(
        kind=kind,
        name=tags.get("name", ""),
        speed=round(speed, 2),
        width=_WIDTHS[kind],
        forward=(lane,) if direction >= 0 else (),
        backward=(lane,) if direction <= 0 else (),
        sidewalks=("no", "no"),
        layer=read_layer(tags),
        roundabout=False,
    )


def is_crossing_track(tags: Tags) -> bool:
    """Tell whether a cycle track leads over a road, and no farther.

    Args:
        tags: of its way.

    Returns:
        Whether it does.
    """
    return "crossing" in (tags.get("cycleway"), tags.get("path"), tags.get("footway"))


def _cycled(tags: Tags) -> LaneUse:
    """Tell whom a cycle track is for besides bicycles."""
    if tags.get("foot") in _NO:
        return LaneUse.BICYCLE
    return LaneUse.SEGREGATED if tags.get("segregated") == "yes" else LaneUse.CYCLEWAY


def _direction(tags: Tags, kind: str) -> int:
    keys = ("oneway:bicycle", "oneway") if kind == CYCLEWAY else ("oneway", "railway:preferred_direction")
    said = next((tags[key] for key in keys if key in tags), "no")
    return {"yes": 1, "1": 1, "true": 1, "forward": 1, "-1": -1, "reverse": -1, "backward": -1}.get(said, 0)


def _lane_width(tags: Tags, kind: str, directions: int) -> float:
    usual = _ONE_WAY_CYCLEWAY if kind == CYCLEWAY and directions == 1 else _WIDTHS[kind]
    whole = read_length(tags.get("cycleway:width", tags.get("width", ""))) if kind == CYCLEWAY else None
    if whole is None or not _NARROWEST <= whole / directions <= _WIDEST:
        return usual
    return round(whole / directions, 2)
