"""How well a built network keeps what its extract says; each loss becomes an issue with a link to it."""

from typing import Any

from dojo_maps.issue import Issue
from dojo_maps.sources.osm import OsmData
from dojo_maps.sources.osm_network import OsmNetwork


def score_network(data: OsmData, network: OsmNetwork) -> tuple[dict[str, Any], tuple[Issue, ...]]:
    """Measure a network against its source.

    Returns:
        The figures as JSON values, and the losses.
    """
    return {}, ()
