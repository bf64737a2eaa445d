"""Where cars park along a road, and how wide that is.

Source: OpenStreetMap wiki, Street parking, and Key:parking:lane for the older tags.
"""

from dojo_maps.sources.osm.read.data import Tags
from dojo_maps.sources.osm.read.lengths import read_length

_WIDTHS = {"parallel": 2.0, "diagonal": 4.3, "perpendicular": 5.0}
"""Metres across the cars that stand there, by how they stand."""
_PLACES = {"lane": 1.0, "street_side": 1.0, "half_on_kerb": 0.5, "on_street": 1.0, "painted_area_only": 1.0}
"""Share of that on the carriageway, or in bays beside it."""
_WIDEST = 6.0


def parking_width(tags: Tags, side: str) -> float:
    """Give the width of the cars that park along one side of a road.

    Args:
        tags: of the way.
        side: `left` or `right`, seen along the way.

    Returns:
        Metres of the carriageway, or of bays beside it, that they take; 0 for none.
    """
    place = _first(tags, (f"parking:{side}", "parking:both"))
    if place is not None:
        said = read_length(_first(tags, (f"parking:{side}:width", "parking:both:width")) or "")
        stand = _first(tags, (f"parking:{side}:orientation", "parking:both:orientation")) or "parallel"
        width = said if said is not None and 0 < said <= _WIDEST else _WIDTHS.get(stand, 0.0)
        return round(width * _PLACES.get(place, 0.0), 2)
    stand = _first(tags, (f"parking:lane:{side}", "parking:lane:both")) or ""
    place = _first(tags, (f"parking:lane:{side}:{stand}", f"parking:lane:both:{stand}")) or "on_street"
    return round(_WIDTHS.get(stand, 0.0) * _PLACES.get(place, 0.0), 2)


def _first(tags: Tags, keys: tuple[str, ...]) -> str | None:
    return next((tags[key] for key in keys if key in tags), None)
