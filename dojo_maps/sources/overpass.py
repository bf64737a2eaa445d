"""Fetch the OpenStreetMap data around a junction from an Overpass server, once, into the user's cache.

The answer is OSM XML as the server sends it, with turn restrictions and whole buildings, which exports of
road graphs lose. Beside it the cache keeps the query and the date.
"""

import hashlib
import json
import math
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote_plus

from dojo_maps.cache import cache_folder, writing_cache
from dojo_maps.errors import SourceError, ToolMissingError, UsageError
from dojo_maps.input_files import sha256_of
from dojo_maps.safe_json import read_json
from dojo_maps.safe_xml import parse_xml
from dojo_maps.sources.download import BusyError, Patience, check_url, fetch, quote, within
from dojo_maps.whole_file import replaced_folder

SERVER = "https://overpass-api.de/api/interpreter"
MAX_SIDE = 5_000.0
"""Longest side of an area, metres: a large town's centre, some 50 MB."""
_EARTH_RADIUS = 6_371_008.8
_GEOCODING_SECONDS = 60.0
_REQUEST = "request.json"
_REMARK = re.compile(rb"<remark>(.{0,2000}?)</remark>", re.DOTALL)
_QUERY = """[out:xml][timeout:180][maxsize:268435456][bbox:{south:.7f},{west:.7f},{north:.7f},{east:.7f}];
(
way[highway];way[railway];way[footway];way[barrier];
way[building];way["building:part"];way[natural];way[waterway];way[landuse];way[leisure];
node[highway];node[crossing];node[natural=tree];node[barrier];
)->.things;
rel[type~"^restriction"]->.rules;
rel[type=multipolygon](if:count_members()<200)->.areas;
(.things;.things>;.rules;.areas;.areas>;);
out body;
"""
"""Ways with all their nodes; restrictions; areas made of several ways, but no forest of thousands."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Area:
    """A rectangle on the earth, degrees, WGS 84."""

    west: float
    south: float
    east: float
    north: float

    def __post_init__(self) -> None:
        """Refuse what is no rectangle, or one too large to be a neighbourhood."""
        sides = (self.west, self.south, self.east, self.north)
        if not all(map(math.isfinite, sides)):
            raise UsageError("an area's sides must be numbers of degrees")
        if not (-180 <= self.west < self.east <= 180 and -85 <= self.south < self.north <= 85):
            raise UsageError(
                f"{self.west:g},{self.south:g},{self.east:g},{self.north:g}: not an area; give "
                "west,south,east,north in degrees, west below east and south below north"
            )
        height = math.radians(self.north - self.south) * _EARTH_RADIUS
        width = math.radians(self.east - self.west) * _EARTH_RADIUS * math.cos(math.radians(self.south))
        if max(width, height) > MAX_SIDE:
            raise UsageError(
                f"the area is {width / 1000:.1f} by {height / 1000:.1f} km; at most {MAX_SIDE / 1000:g} km "
                "a side are downloaded; take less, or a file of OpenStreetMap data"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Download:
    """An area's data in the cache: where, and the day it was fetched, as 2026-01-31."""

    path: Path
    date: str


def area_around(latitude: float, longitude: float, radius: float) -> Area:
    """Take the square that holds a circle.

    Args:
        latitude: degrees north.
        longitude: degrees east.
        radius: metres.

    Returns:
        The square, whose sides are as far from the place as the radius.

    Raises:
        UsageError: the place is not on the earth, or the radius is too small or too large.
    """
    if not (abs(latitude) <= 84.9 and abs(longitude) <= 180):
        raise UsageError(f"{latitude:g},{longitude:g}: not a place with roads; give LAT,LON in degrees")
    if not 10 <= radius <= MAX_SIDE / 2:
        raise UsageError(f"radius {radius:g}: expected 10 to {MAX_SIDE / 2:g} m")
    up = math.degrees(radius / _EARTH_RADIUS)
    aside = up / math.cos(math.radians(latitude))
    return Area(west=longitude - aside, south=latitude - up, east=longitude + aside, north=latitude + up)


def find_place(name: str) -> tuple[float, float]:
    """Look up the middle of a place by its name.

    Args:
        name: as people write it, such as a street and its town.

    Returns:
        Its latitude and longitude, degrees, WGS 84.

    Raises:
        SourceError: no such place, no network, or no answer in time.
        ToolMissingError: the package osmnx is not installed.
    """
    try:
        import osmnx  # noqa: PLC0415 - heavy, and needed for names only
        import requests  # noqa: PLC0415 - comes with osmnx
    except ImportError:
        raise ToolMissingError("looking up a place needs the package osmnx: pip install osmnx") from None
    osmnx.settings.cache_folder = str(cache_folder() / "places")
    where = f"place {name!r}"
    try:
        latitude, longitude = within(_GEOCODING_SECONDS, lambda _stop: osmnx.geocode(name), where)
    except requests.ConnectionError as error:
        raise SourceError(
            where, "cannot be looked up without a network; give a file: dojo-maps import-osm FILE"
        ) from error
    except (requests.RequestException, ValueError) as error:
        problem = " ".join(str(error).split())[:200]
        raise SourceError(
            where, f"cannot be found ({problem}); name its town as well, or give --point LAT,LON"
        ) from error
    return float(latitude), float(longitude)


def download_area(
    area: Area,
    *,
    name: str = "area",
    server: str = SERVER,
    patience: Patience | None = None,
    on_pause: Callable[[str], None] = lambda _message: None,
) -> Download:
    """Fetch an area's data, or find it in the cache.

    Args:
        area: what to fetch.
        name: of the file, without its suffix.
        server: address of an Overpass server's interpreter.
        patience: bounds on bytes and seconds.
        on_pause: told why and how long is waited.

    Returns:
        Where the data lies, and the day on which it was fetched.

    Raises:
        SourceError: the data cannot be had, or is not what an Overpass server sends; nothing is kept then.
        UsageError: the server's address is none, or the cache cannot be written.
    """
    server = check_url(server)
    query = _QUERY.format(west=area.west, south=area.south, east=area.east, north=area.north)
    folder = (
        cache_folder() / "overpass" / hashlib.sha256(f"{server}\n{name}\n{query}".encode()).hexdigest()[:24]
    )
    path = folder / f"{name}.osm"
    kept = _kept(path)
    if kept is not None:
        return kept
    with writing_cache():
        folder.parent.mkdir(parents=True, exist_ok=True)
    data = fetch(
        server,
        form=b"data=" + quote_plus(query).encode(),
        patience=patience or Patience(),
        check=lambda answer: _check(answer, server),
        on_pause=on_pause,
    )
    return _keep(path, data, {"server": server, "query": query})


def _check(answer: bytes, server: str) -> None:
    """Accept a whole answer with roads in it.

    Servers answer 200 before they know how the query ends, so a failure may hide in a remark, in a page
    for people, or in an answer that just ends.
    """
    if not answer.strip():
        raise BusyError(server, "the answer is empty")
    if b"<html" in answer[:2000].lower():
        raise BusyError(server, f"answers with a page for people ({quote(answer[:20_000])})")
    if answer.lstrip().startswith(b"<") and not answer.rstrip().endswith((b"</osm>", b"/>")):
        raise BusyError(server, "the answer ends early")
    seen: set[str] = set()
    parse_xml(answer, server, root="osm", kind="OSM answer", start=lambda name, _attributes: seen.add(name))
    if "remark" in seen:
        remark = _REMARK.search(answer)
        problem = f"stopped before the end ({quote(remark[1]) if remark else 'it does not say why'})"
        raise SourceError(server, f"{problem}; ask for a smaller area, or another server")
    if not {"node", "way"} <= seen:
        raise SourceError(server, "OpenStreetMap has no roads in this area; check the coordinates' order")


def _kept(path: Path) -> Download | None:
    """Find an earlier download; one that was changed since is not trusted."""
    try:
        request = read_json(path.with_name(_REQUEST))
        same = sha256_of(path) == request["sha256"]
        return Download(path=path, date=str(request["date"])[:10]) if same else None
    except (SourceError, KeyError, TypeError):
        return None


def _keep(path: Path, data: bytes, request: dict[str, str]) -> Download:
    """Write a download beside its place and move it there whole."""
    folder = path.parent
    date = time.strftime("%Y-%m-%d", time.gmtime())
    request = {**request, "date": date, "sha256": hashlib.sha256(data).hexdigest()}
    with writing_cache(), replaced_folder(folder, parents=True) as fresh:
        (fresh / path.name).write_bytes(data)
        (fresh / _REQUEST).write_text(json.dumps(request, indent=1) + "\n", encoding="utf-8")
    return Download(path=path, date=date)
