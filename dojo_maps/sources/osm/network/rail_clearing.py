"""Take people off the tracks of trams; netconvert's input lets them there so that pavements lead over."""

import re
from collections import Counter

_ON_RAILS = re.compile(rb'allow="pedestrian tram"')
_PAVEMENT = re.compile(rb' *<edge id="(:[^"]*_w\d+)" function="walkingarea">.*?</edge>\n', re.DOTALL)
_RAIL_EDGE = re.compile(rb'<edge id="([^"]*)"[^>]*type="railway\.')
_FROM_PAVEMENT = re.compile(rb' *<connection from=":[^"]*_w\d+" to="([^"]*)"[^>]*/>\n')
_TO_PAVEMENT = re.compile(rb' *<connection from="([^"]*)" to=":[^"]*_w\d+"[^>]*/>\n')
_NAME = re.compile(rb'"(:[^"]*_w\d+)"')


def clear_rails(network: bytes) -> bytes:
    """Take people off the tracks of trams in a network of netconvert's; they cross them at junctions.

    Args:
        network: the file's bytes.

    Returns:
        The network with nobody there but trams; the same object where it has no rails.
    """
    rails = set(_RAIL_EDGE.findall(network))
    if not rails:
        return network
    for pattern in (_FROM_PAVEMENT, _TO_PAVEMENT):
        network = pattern.sub(lambda found: b"" if found[1] in rails else found[0], network)
    used = Counter(_NAME.findall(network))
    network = _PAVEMENT.sub(lambda found: found[0] if used[found[1]] > 1 else b"", network)
    return _ON_RAILS.sub(b'allow="tram"', network)
