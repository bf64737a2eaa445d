"""SUMO's vehicle classes: which may use a lane, and what kind of lane that makes it."""

from functools import lru_cache

from dojo_maps.description import LaneKind

VEHICLE_CLASSES = (
    "private", "emergency", "authority", "army", "vip", "pedestrian", "passenger", "hov", "taxi", "bus",
    "coach", "delivery", "truck", "trailer", "motorcycle", "moped", "bicycle", "evehicle", "tram",
    "rail_urban", "rail", "rail_electric", "rail_fast", "ship", "container", "cable_car", "subway",
    "aircraft", "wheelchair", "scooter", "drone", "custom1", "custom2",
)  # fmt: skip
"""Source: https://sumo.dlr.de/docs/Simulation/VehiclePermissions.html (SUMO 1.28)."""

_RENAMED = {
    "public_emergency": "emergency", "public_authority": "authority", "public_army": "army",
    "public_transport": "bus", "transport": "truck", "lightrail": "tram", "cityrail": "rail_urban",
    "rail_slow": "rail", "electric": "evehicle",
}  # fmt: skip
"""Names that networks older than SUMO 0.26 use."""

_EVERY = ("all", "ignoring")

_RAIL = {"tram", "rail_urban", "rail", "rail_electric", "rail_fast", "subway", "cable_car"}
_WALKING = {"pedestrian", "wheelchair"}
_CYCLING = {"bicycle", "scooter"}
_SERVICES = {"emergency", "authority", "army", "vip"}
_HARD_SHOULDER = {"emergency", "authority"}
_TRANSIT = {"bus", "coach", "taxi"}
_WATER = {"ship", "container"}
_OTHER = {"aircraft", "drone", "container"}


@lru_cache(maxsize=4096)
def allowed_classes(allow: str | None, disallow: str | None) -> tuple[str, ...]:
    """List the classes a lane's `allow` and `disallow` attributes let in, in SUMO's order.

    Args:
        allow: classes by spaces, or `all`; None where the lane has no such attribute.
        disallow: as `allow`; it only counts where `allow` is None or `all`.

    Returns:
        SUMO's names of today for those of older networks; words that are no classes are left out.
    """
    if allow is not None and allow != "all":
        named = {_RENAMED.get(name, name) for name in allow.split()}
        return tuple(name for name in VEHICLE_CLASSES if name in named)
    if disallow == "all":
        return ()
    named = {_RENAMED.get(name, name) for name in (disallow or "").split()}
    return tuple(name for name in VEHICLE_CLASSES if name not in named)


def unknown_classes(*lists: str | None) -> list[str]:
    """List the words of `allow` and `disallow` attributes that are no vehicle classes of SUMO's.

    Args:
        lists: the attributes' values; None and empty ones have no words.

    Returns:
        The words, as often as they stand there; names of older networks, `all` and `ignoring` are known.
    """
    known = {*VEHICLE_CLASSES, *_RENAMED, *_EVERY}
    return [name for words in lists if words for name in words.split() if name not in known]


@lru_cache(maxsize=4096)
def lane_kind(allow: tuple[str, ...]) -> LaneKind:
    """Name the kind of a lane by the classes that use it; the first rule that fits decides.

    Args:
        allow: as `allowed_classes` gives them; a lane for nobody is a shoulder.

    Returns:
        The kind; one for driving where no rule fits.
    """
    classes = set(allow)
    rules = (
        (classes <= _HARD_SHOULDER, LaneKind.SHOULDER),
        (classes <= _WALKING, LaneKind.SIDEWALK),
        (classes <= _WALKING | _CYCLING, LaneKind.BICYCLE),
        (classes <= _RAIL, LaneKind.RAIL),
        (classes <= _WATER and "ship" in classes, LaneKind.WATERWAY),
        (classes <= _OTHER, LaneKind.OTHER),
        (
            classes <= _TRANSIT | _SERVICES | _RAIL | _CYCLING | _WALKING and bool(classes & _TRANSIT),
            LaneKind.BUS,
        ),
    )
    return next((kind for fits, kind in rules if fits), LaneKind.DRIVING)
