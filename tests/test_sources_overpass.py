"""Downloads against a server on loopback that answers as Overpass and its neighbours do."""

import json
import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from email.utils import formatdate
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import parse_qs

import pytest

from dojo_maps.errors import SourceError, UsageError
from dojo_maps.sources.download import Patience, quote
from dojo_maps.sources.overpass import Area, Download, area_around, download_area, find_place

GOOD = b"""<?xml version="1.0" encoding="UTF-8"?>
<osm version="0.6" generator="Overpass API 0.7.62.7 375dc00a">
<note>The data included in this document is from www.openstreetmap.org.</note>
<meta osm_base="2026-01-01T00:00:00Z"/>
  <node id="1" lat="60.17" lon="24.94"/>
  <node id="2" lat="60.171" lon="24.941"/>
  <way id="3"><nd ref="1"/><nd ref="2"/><tag k="highway" v="residential"/></way>
</osm>
"""
EMPTY = b'<?xml version="1.0" encoding="UTF-8"?>\n<osm version="0.6"><note>none</note></osm>\n'
REMARK = GOOD.replace(
    b"</osm>",
    b'<remark> runtime error: Query timed out in "query" at line 3 after 4 seconds. </remark>\n</osm>',
)
PAGE = b"""<?xml version="1.0" encoding="UTF-8"?>
<!DOCTYPE html PUBLIC "-//W3C//DTD XHTML 1.0 Strict//EN" "http://www.w3.org/TR/xhtml1/DTD/xhtml1-strict.dtd">
<html><head><title>OSM3S Response</title></head><body>
<p><strong style="color:#FF0000">Error</strong>: runtime error: open64: 0 Success dispatcher_client::1.
The server is probably too busy to handle your request. </p></body></html>
"""
HOSTILE = b'<?xml version="1.0"?><!DOCTYPE osm [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><osm>&b;</osm>'
AREA = Area(west=24.93, south=60.165, east=24.95, north=60.175)
QUICK = Patience(max_bytes=1 << 20, answer=5.0, pauses=(0.0, 0.0, 0.0), total=20.0)

Answer = Callable[["Overpass"], None]


class Overpass(BaseHTTPRequestHandler):
    """Answers each request with the next of the server's answers; the last one goes on."""

    server: "Server"

    def do_POST(self) -> None:
        form = parse_qs(self.rfile.read(int(self.headers["Content-Length"])).decode())
        self.server.queries.append(form["data"][0])
        self.server.agents.append(self.headers["User-Agent"])
        answers = self.server.answers
        (answers.pop(0) if len(answers) > 1 else answers[0])(self)

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the base class's name
        pass


class Server(ThreadingHTTPServer):
    daemon_threads = True
    answers: list[Answer]

    def __init__(self, answers: list[Answer]) -> None:
        super().__init__(("127.0.0.1", 0), Overpass)
        self.answers, self.queries, self.agents = answers, [], []  # type: ignore[var-annotated]
        self.url = f"http://127.0.0.1:{self.server_port}/api/interpreter"

    def handle_error(self, request: object, client_address: object) -> None:
        """Clients that hang up are part of the tests."""


def answer(body: bytes, status: int = 200, **headers: str) -> Answer:
    def send(request: Overpass) -> None:
        request.send_response(status)
        for name, value in {"Content-Length": str(len(body)), **headers}.items():
            request.send_header(name.replace("_", "-"), value)
        request.end_headers()
        request.wfile.write(body)

    return send


def endless(request: Overpass) -> None:
    request.send_response(200)
    request.end_headers()
    while True:
        request.wfile.write(b"<osm>" + b" " * 65536)


def drip(request: Overpass) -> None:
    request.send_response(200)
    request.end_headers()
    for _ in range(400):
        request.wfile.write(b" ")
        time.sleep(0.05)


def drip_headers(request: Overpass) -> None:
    request.wfile.write(b"HTTP/1.0 200 OK\r\nX: ")
    for _ in range(400):
        request.wfile.write(b"x")
        time.sleep(0.05)


def hang_up(request: Overpass) -> None:
    request.connection.close()


def not_http(request: Overpass) -> None:
    request.wfile.write(b"220 mail.example ESMTP\r\n")


@contextmanager
def overpass(*answers: Answer) -> Iterator[Server]:
    with Server(list(answers)) as server:
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True).start()
        yield server
        server.shutdown()


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "cache"
    monkeypatch.setenv("DOJO_CACHE", str(folder))
    for name in ("http_proxy", "https_proxy", "all_proxy"):
        monkeypatch.delenv(name, raising=False)
        monkeypatch.delenv(name.upper(), raising=False)
    return folder


def download(server: Server, patience: Patience = QUICK, area: Area = AREA) -> Download:
    return download_area(area, server=server.url, patience=patience)


def assert_nothing_kept(cache: Path) -> None:
    assert [path for path in cache.rglob("*") if path.is_file()] == []


def test_download_is_kept_with_its_query_and_date(cache: Path) -> None:
    with overpass(answer(GOOD)) as server:
        first = download(server)
        again = download(server)
    assert first == again
    assert first.path.read_bytes() == GOOD
    assert len(server.queries) == 1
    assert "[bbox:60.1650000,24.9300000,60.1750000,24.9500000]" in server.queries[0]
    assert "TrafficDojo" in server.agents[0]
    request = json.loads((first.path.parent / "request.json").read_text())
    assert request["query"] == server.queries[0]
    assert request["date"] == first.date == time.strftime("%Y-%m-%d", time.gmtime())
    assert sorted(path.name for path in cache.rglob("*") if path.is_file()) == ["area.osm", "request.json"]


def test_download_asks_again_for_another_area() -> None:
    with overpass(answer(GOOD)) as server:
        download(server)
        download(server, area=area_around(60.17, 24.94, 100))
    assert len(server.queries) == 2


def test_download_is_made_again_when_the_kept_file_was_changed() -> None:
    with overpass(answer(GOOD)) as server:
        kept = download(server)
        kept.path.write_bytes(GOOD[:200])
        assert download(server).path.read_bytes() == GOOD
    assert len(server.queries) == 2


@pytest.mark.parametrize(
    "trouble",
    [
        answer(PAGE, 429),
        answer(PAGE, 429, Retry_After="0"),
        answer(PAGE, 429, Retry_After=formatdate(usegmt=True)),
        answer(PAGE, 429, Retry_After="soon"),
        answer(b"", 504),
        answer(b"", 503),
        answer(PAGE),
        answer(b""),
        answer(GOOD[:300]),
        answer(GOOD[:300], Content_Length=str(len(GOOD))),
        answer(b"<p>", 504, Content_Length="100"),
        hang_up,
        not_http,
    ],
    ids=["429", "retry-after", "retry-date", "retry-odd", "504", "503", "page", "empty", "truncated",
         "short", "short-504", "hang-up", "not-http"],
)  # fmt: skip
def test_download_asks_a_busy_server_again(trouble: Answer) -> None:
    with overpass(trouble, trouble, answer(GOOD)) as server:
        assert download(server).path.read_bytes() == GOOD
    assert len(server.queries) == 3


def test_download_waits_as_long_as_the_server_wishes() -> None:
    with overpass(answer(b"", 429, Retry_After="1"), answer(GOOD)) as server:
        start = time.monotonic()
        download(server)
    assert time.monotonic() - start >= 1.0


def test_download_does_not_wait_longer_than_its_patience(cache: Path) -> None:
    with overpass(answer(PAGE, 429, Retry_After="99999999999")) as server:
        start = time.monotonic()
        with pytest.raises(SourceError, match=r"429 .*too busy.*--overpass-url"):
            download(server)
    assert time.monotonic() - start < 2.0
    assert len(server.queries) == 1
    assert_nothing_kept(cache)


@pytest.mark.parametrize(
    ("trouble", "message", "requests"),
    [
        (answer(PAGE, 504), "504 Gateway Timeout .*too busy", 4),
        (answer(PAGE), "page for people .*too busy", 4),
        (answer(GOOD[:300]), "ends early", 4),
        (answer(PAGE, 400), "400 Bad Request", 1),
        (answer(b"", 301, Location="http://169.254.169.254/"), "redirects to 'http://169", 1),
        (answer(b"", 302, Location="file:///etc/passwd"), "redirects to 'file:", 1),
        (answer(b"", 307, Location="/elsewhere"), "redirects", 1),
        (answer(REMARK), 'stopped before the end .*Query timed out in "query"', 1),
        (answer(HOSTILE), "document type or entities", 1),
        (answer(EMPTY), "no roads in this area", 1),
        (answer(b'{"elements": []}'), "not well-formed", 1),
        (answer(b"<gpx/>"), "root element is <gpx>", 1),
        (answer(GOOD.replace(b"</way>", b"")), "not well-formed", 1),
        (answer(b"\0" * 1000), "not well-formed", 1),
        (endless, "longer than 1 MiB", 1),
    ],
    ids=["504", "page", "truncated", "400", "redirect", "redirect-file", "redirect-self", "remark",
         "entities", "empty", "json", "gpx", "broken", "zeros", "endless"],
)  # fmt: skip
def test_download_refuses(trouble: Answer, message: str, requests: int, cache: Path) -> None:
    with overpass(trouble) as server:
        with pytest.raises(SourceError, match=message) as caught:
            download(server)
        assert len(server.queries) == requests
    assert caught.value.exit_status == 3
    assert "\n" not in str(caught.value)
    assert_nothing_kept(cache)


@pytest.mark.parametrize("slow", [drip, drip_headers], ids=["body", "headers"])
def test_download_gives_up_a_slow_server(slow: Answer, cache: Path) -> None:
    with overpass(slow) as server:
        start = time.monotonic()
        with pytest.raises(SourceError, match=r"within 0\.5 s"):
            download(server, Patience(answer=0.5, pauses=(0.0,)))
        assert time.monotonic() - start < 3.0
    assert_nothing_kept(cache)


def test_download_without_a_network_says_how_to_use_a_file(cache: Path) -> None:
    with overpass(answer(GOOD)) as server:
        closed = server.url
    start = time.monotonic()
    with pytest.raises(SourceError, match=r"cannot be reached.*import-osm FILE"):
        download_area(AREA, server=closed)
    with pytest.raises(SourceError, match="import-osm FILE"):
        download_area(AREA, server="http://no-such-server.invalid/api/interpreter")
    assert time.monotonic() - start < 10.0
    assert_nothing_kept(cache)


@pytest.mark.parametrize(
    "url", ["file:///etc/passwd", "ftp://server/x", "", "server", "http://", "http://[", "http://a b/"]
)
def test_download_refuses_what_is_no_server(url: str) -> None:
    with pytest.raises(UsageError, match="web server"):
        download_area(AREA, server=url)


def test_download_says_so_when_the_cache_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("DOJO_CACHE", str(tmp_path / "file" / "cache"))
    with pytest.raises(UsageError, match="DOJO_CACHE"):
        download_area(AREA, server="http://127.0.0.1:9/")


@pytest.mark.parametrize(
    "sides",
    [
        (24.95, 60.165, 24.93, 60.175),
        (24.93, 60.175, 24.95, 60.165),
        (24.0, 60.0, 25.0, 61.0),
        (24.93, 89.0, 24.95, 89.1),
        (179.99, 0.0, 180.01, 0.01),
        (math.nan, 0.0, 0.01, 0.01),
        (0.0, 0.0, math.inf, 0.01),
    ],
)
def test_area_refuses(sides: tuple[float, float, float, float]) -> None:
    with pytest.raises(UsageError):
        Area(west=sides[0], south=sides[1], east=sides[2], north=sides[3])


@pytest.mark.parametrize("place", [(91.0, 0.0, 100.0), (0.0, 181.0, 100.0), (0.0, 0.0, 1.0), (0.0, 0.0, 1e5)])
def test_area_around_refuses(place: tuple[float, float, float]) -> None:
    with pytest.raises(UsageError):
        area_around(*place)


def test_area_around_reaches_the_radius_on_every_side() -> None:
    area = area_around(-33.87, 151.2, 200)
    assert math.isclose((area.north - area.south) * 111_195, 400, rel_tol=1e-3)
    width = (area.east - area.west) * 111_195 * math.cos(math.radians(33.87))
    assert math.isclose(width, 400, rel_tol=1e-3)


def test_quote_leaves_markup_and_control_characters_out() -> None:
    assert quote(b"<style>p {}</style><p>too\x1b[31m busy &amp; tired</p>") == "too [31m busy & tired"
    assert len(quote(b"x" * 5000)) == 200


class Nominatim(BaseHTTPRequestHandler):
    """Knows one place."""

    def do_GET(self) -> None:
        known = "Kamppi" in self.path
        body = json.dumps([{"lat": "60.168", "lon": "24.931", "display_name": "Kamppi"}] if known else [])
        self.send_response(200)
        self.end_headers()
        self.wfile.write(body.encode())

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the base class's name
        pass


@pytest.mark.slow
def test_find_place_asks_by_name(cache: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    osmnx = pytest.importorskip("osmnx")
    monkeypatch.chdir(tmp_path)
    with ThreadingHTTPServer(("127.0.0.1", 0), Nominatim) as server:
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True).start()
        monkeypatch.setattr(osmnx.settings, "nominatim_url", f"http://127.0.0.1:{server.server_port}/")
        assert find_place("Kamppi, Helsinki") == (60.168, 24.931)
        with pytest.raises(SourceError, match=r"--point LAT,LON"):
            find_place("Nowhere at all")
        server.shutdown()
    with pytest.raises(SourceError, match="import-osm FILE"):
        find_place("Another place")
    assert {path.name for path in tmp_path.iterdir()} == {"cache"}
