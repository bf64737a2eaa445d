"""The live page's server: on the loopback address only, for one page, with bounds on what strangers can do.

Another site in the same browser can reach the loopback address, too. So requests must name this host, which
stops rebound names, and orders must carry a token that only this page has.
"""

import contextlib
import json
import secrets
import socket
import threading
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from typing import Any
from urllib.parse import parse_qs, urlsplit

from dojo_env.errors import ConfigError
from dojo_env.watching.page import PageState

_HOST = "127.0.0.1"
_PATIENCE = 8.0
"""Seconds that an asked-for frame may take, and that a client gets to send its request."""
_MOST_CLIENTS = 16
_LONGEST_ORDER = 500
"""Bytes."""


class LiveServer:
    """Serves a page until it is closed, from threads of its own."""

    def __init__(self, page: PageState, *, port: int = 0) -> None:
        """Begin to serve; port 0 takes any that is free.

        Raises:
            ConfigError: the port is taken.
        """
        self._page = page
        try:
            self._server = _Server(page, port)
        except (OSError, OverflowError) as error:
            raise ConfigError(f"port {port} cannot be used ({error}); choose another, or none") from error
        self.url = f"http://{_HOST}:{self._server.server_port}/"
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.1,), daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop; every connection ends."""
        self._page.close()
        self._server.shutdown()
        self._thread.join()
        self._server.end_clients()
        self._server.server_close()


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, page: PageState, port: int) -> None:
        self.page = page
        self.token, self.nonce = secrets.token_urlsafe(24), secrets.token_urlsafe(16)
        self._clients: set[socket.socket] = set()
        self._gone = threading.Condition()
        super().__init__((_HOST, port), _Handler)
        self.hosts = {f"{_HOST}:{self.server_port}", f"localhost:{self.server_port}"}

    def server_bind(self) -> None:
        """Bind without asking a name server for this host's name."""
        self.socket.bind(self.server_address)
        self.server_address = self.socket.getsockname()
        self.server_name, self.server_port = _HOST, self.server_address[1]

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a client in a thread, unless there are too many."""
        with self._gone:
            if len(self._clients) >= _MOST_CLIENTS:
                self._hang_up(request)
                return
            self._clients.add(request)
        super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        """End a connection and note it."""
        self._hang_up(request)
        with self._gone:
            self._clients.discard(request)
            self._gone.notify_all()

    def _hang_up(self, request: Any) -> None:
        super().shutdown_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a client that has left."""

    def end_clients(self) -> None:
        """Cut every connection and wait until their threads have let go."""
        with self._gone:
            for client in self._clients:
                with contextlib.suppress(OSError):
                    client.shutdown(socket.SHUT_RDWR)
            self._gone.wait_for(lambda: not self._clients, _PATIENCE)


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    server_version, sys_version = "TrafficDojo", ""
    timeout = _PATIENCE

    def do_GET(self) -> None:
        """Send the page, or the next frame."""
        if not self._is_welcome():
            return
        address = urlsplit(self.path)
        if address.path == "/":
            self._send_page()
        elif address.path == "/frame":
            after = _number(parse_qs(address.query).get("after", [""])[0])
            if after is None:
                self.send_error(HTTPStatus.BAD_REQUEST)
                return
            self._send(self.server.page.wait(after, _PATIENCE), "application/json")
        else:
            self.send_error(HTTPStatus.NOT_FOUND)

    def do_POST(self) -> None:
        """Take an order of the page's."""
        if not self._is_welcome():
            return
        length = _number(self.headers.get("Content-Length", ""))
        given = self.headers.get("X-Dojo-Token", "").encode("utf-8", "replace")
        if urlsplit(self.path).path != "/control":
            self.send_error(HTTPStatus.NOT_FOUND)
        elif not secrets.compare_digest(given, self.server.token.encode()):
            self.send_error(HTTPStatus.FORBIDDEN)
        elif length is None or length > _LONGEST_ORDER:
            self.send_error(HTTPStatus.BAD_REQUEST)
        else:
            self._obey(self.rfile.read(length))

    def _obey(self, order: bytes) -> None:
        try:
            self.server.page.control(json.loads(order))
        except (ValueError, TypeError, RecursionError):
            self.send_error(HTTPStatus.BAD_REQUEST)
        else:
            self._send(b"{}", "application/json")

    def _is_welcome(self) -> bool:
        """Refuse whoever calls this host by another name, or comes from another page."""
        origin = self.headers.get("Origin")
        known = self.headers.get("Host", "") in self.server.hosts
        if known and (origin is None or origin.removeprefix("http://") in self.server.hosts):
            return True
        self.send_error(HTTPStatus.FORBIDDEN)
        return False

    def _send_page(self) -> None:
        page = resources.files("dojo_env.watching").joinpath("page.html").read_text(encoding="utf-8")
        page = page.replace("{nonce}", self.server.nonce).replace("{token}", self.server.token)
        trusted = f"'nonce-{self.server.nonce}'"
        policy = (
            f"default-src 'none'; script-src {trusted}; style-src {trusted}; "
            "img-src data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        )
        self._send(page.encode(), "text/html; charset=utf-8", policy)

    def _send(self, body: bytes, kind: str, policy: str = "default-src 'none'") -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Content-Security-Policy", policy)
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Cross-Origin-Resource-Policy", "same-origin")
        self.send_header("Referrer-Policy", "no-referrer")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002 - the base class's name
        """Keep quiet: a page asks ten times a second."""


def _number(text: str) -> int | None:
    """Read a whole number of a stranger's."""
    return int(text) if text.isascii() and text.isdigit() and len(text) < 18 else None
