"""Which country a place lies in, by the boundaries of time zones, which follow those of countries.

The package tzfpy carries the boundaries that OpenStreetMap has, to 111 m and out to sea; IANA's `zone.tab`,
in the package tzdata, names the country of each zone. Nothing is downloaded.
"""

import functools
import importlib.resources

import tzfpy


def country_at(lon: float, lat: float) -> str:
    """Name the country or territory of a place.

    Args:
        lon: degrees, WGS 84.
        lat: degrees.

    Returns:
        Its code of two letters (ISO 3166-1), empty on the high seas.
    """
    zone = tzfpy.get_tz(lon, lat)
    if zone == "Asia/Bangkok" and lat > 20.6 - 0.925 * (lon - 102.0):
        return "VN"  # the north of Vietnam has Thailand's zone; Laos lies between
    return _countries().get(zone, "")


@functools.cache
def _countries() -> dict[str, str]:
    table = importlib.resources.files("tzdata") / "zoneinfo" / "zone.tab"
    rows = (line.split("\t") for line in table.read_text(encoding="utf-8").splitlines())
    return {row[2]: row[0] for row in rows if not row[0].startswith("#")}
