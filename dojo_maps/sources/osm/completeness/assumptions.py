"""What an import takes for granted of its extract, and why: the side of the road, the ground."""

from dojo_maps.issue import Issue, Severity
from dojo_maps.sources.osm.network.osm_network import OsmNetwork


def tell_driving_side(network: OsmNetwork) -> Issue:
    """Say which side traffic keeps to, and why.

    Args:
        network: as it was built.

    Returns:
        A note; a warning where something speaks for the other side.
    """
    country = network.layout.graph.country
    side = "left" if country.left_hand else "right"
    doubt = f", but {country.doubted}" if country.doubted else ""
    return _note(
        network,
        "osm.driving_side",
        f"traffic keeps {side}, for {country.told_by}{doubt}",
        "name the other side with --drive where this is wrong",
        severity=Severity.WARNING if doubt else Severity.NOTE,
    )


def tell_ground(network: OsmNetwork) -> Issue:
    """Say where the heights of streets are from.

    Args:
        network: as it was built.

    Returns:
        A note, also where streets are flat.
    """
    ground = network.layout.ground
    if ground is None:
        return _note(
            network,
            "osm.flat_ground",
            "streets are flat: neither elevations nor slopes are mapped",
            "give elevations of the ground with --terrain",
        )
    highest = max(float(heights.max()) for _, heights in ground.profiles.values())
    sea = (
        ""
        if ground.lowest is None
        else f"; the lowest place, here 0 m, is {ground.lowest:.1f} m above the sea"
    )
    return _note(
        network,
        "osm.ground",
        f"streets rise to {highest:.1f} m, {ground.steepest:.1%} at most, by {ground.told_by}{sea}",
        "look at the slopes; give better elevations with --terrain",
    )


def _note(
    network: OsmNetwork, check: str, message: str, hint: str, *, severity: Severity = Severity.NOTE
) -> Issue:
    position = (*network.road_map.origin, 0.0)
    return Issue(check=check, severity=severity, elements=(), position=position, message=message, hint=hint)
