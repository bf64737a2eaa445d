"""Fetch one answer from a web server that may be busy, slow, broken or hostile.

Every bound is ours: bytes, seconds for one answer, seconds in all. Redirects are refused, so an answer
comes from the server that was named or not at all. A busy server is asked again, no sooner than it wishes;
without a network the error comes at once.
"""

import email.utils
import html
import http.client
import itertools
import queue
import re
import socket
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from dataclasses import dataclass
from typing import IO, TypeVar
from urllib.parse import urlsplit

from dojo_maps.errors import SourceError, UsageError

_AGENT = "TrafficDojo/0.1 (road maps for traffic signal research)"
_BUSY = (429, 502, 503, 504)
_CHUNK = 1 << 16
_LONGEST_QUOTE = 200
_MARKUP = re.compile(r"<(style|script|head)\b.*?</\1\s*>|<[^>]*>", re.DOTALL | re.IGNORECASE)

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Patience:
    """How much is accepted and how long is waited.

    Attributes:
        max_bytes: of one answer.
        answer: seconds for one answer, from the first look-up of the server's name to the last byte.
        pauses: seconds before the second, third... attempt, where the server names none.
        total: seconds after which no further attempt begins.
    """

    max_bytes: int = 256 << 20
    answer: float = 200.0
    pauses: tuple[float, ...] = (5.0, 15.0, 45.0)
    total: float = 600.0


class BusyError(SourceError):
    """The server may well answer later; `after` is when it said so, in seconds from now."""

    def __init__(
        self, server: str, problem: str, element: str | None = None, *, after: float | None = None
    ) -> None:
        """Note what the server said."""
        super().__init__(server, problem, element)
        self.after = after


def check_url(url: str) -> str:
    """Take an address of a web server, and nothing else that a URL can be.

    Args:
        url: as a user gives it.

    Returns:
        The same.

    Raises:
        UsageError: it is not http or https, names no server, or holds blanks or what cannot be printed.
    """
    try:
        parts = urlsplit(url)
        known = parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
    except ValueError:
        known = False
    if not known or not url.isprintable() or " " in url:
        raise UsageError(f"{url[:80]!r}: not the address of a web server; give http://... or https://...")
    return url


def fetch(
    url: str,
    *,
    form: bytes,
    patience: Patience,
    check: Callable[[bytes], None],
    on_pause: Callable[[str], None] = lambda _message: None,
) -> bytes:
    """Send a form and return the answer, asking again while the server is busy.

    Args:
        url: of http or https.
        form: what is sent, as application/x-www-form-urlencoded.
        patience: the bounds.
        check: raises BusyError for an answer that a later attempt may better, any SourceError for one that
            none will.
        on_pause: told why and how long is waited.

    Returns:
        The answer's bytes, which `check` has accepted.

    Raises:
        SourceError: no network, no answer in time, too long, refused, or still busy after every attempt.
    """
    start = time.monotonic()
    for pause in itertools.chain(patience.pauses, [None]):
        try:
            data = within(patience.answer, lambda stop: _ask(url, form, patience.max_bytes, stop), url)
            check(data)
        except BusyError as error:
            wait = max(pause or 0.0, error.after or 0.0)
            if pause is None or time.monotonic() + wait - start > patience.total:
                raise SourceError(
                    url, f"{_problem(error)}; try again later, or a server of your choice with --overpass-url"
                ) from error
            on_pause(f"{error}; asking again in {wait:.0f} s")
            time.sleep(wait)
        else:
            return data
    raise AssertionError


def within(seconds: float, work: Callable[[threading.Event], T], server: str) -> T:
    """Do network work in a thread and give it up after some seconds, wherever it hangs.

    Looking up a name cannot be interrupted, and a server that sends a byte now and then never runs into a
    socket's own time limit. The work is told by its event that nobody waits for it any more.

    Args:
        seconds: that it may take.
        work: called in the thread; its event is set once nobody waits.
        server: what is asked, for the error.

    Returns:
        What the work returns.

    Raises:
        SourceError: the time is over. Whatever the work raises is raised here as well.
    """
    answers: queue.Queue[tuple[T | None, BaseException | None]] = queue.Queue()
    stop = threading.Event()

    def run() -> None:
        try:
            answers.put((work(stop), None))
        except BaseException as error:  # noqa: BLE001 - it is raised where somebody waits
            answers.put((None, error))

    threading.Thread(target=run, daemon=True).start()
    try:
        answer, error = answers.get(timeout=seconds)
    except queue.Empty:
        raise SourceError(
            server, f"no whole answer within {seconds:g} s; ask for a smaller area, or try again later"
        ) from None
    finally:
        stop.set()
    if error is not None:
        raise error
    return answer  # type: ignore[return-value]


def _ask(url: str, form: bytes, max_bytes: int, stop: threading.Event) -> bytes:
    request = urllib.request.Request(url, data=form, headers={"User-Agent": _AGENT})  # noqa: S310 - checked
    try:
        try:
            with _opener().open(request, timeout=60) as answer:
                return _read(answer, url, max_bytes, stop)
        except urllib.error.HTTPError as error:
            with error:
                raise _refusal(url, error) from error
    except TimeoutError as error:
        raise BusyError(url, "fell silent for 60 s") from error
    except urllib.error.URLError as error:
        raise _unreachable(url, error.reason) from error
    except (http.client.HTTPException, OSError) as error:
        raise BusyError(url, f"the answer broke off ({type(error).__name__})") from error


def _opener() -> urllib.request.OpenerDirector:
    """Speak http and https, also through the proxy that the environment names, and follow no redirect."""
    opener = urllib.request.OpenerDirector()
    for handler in (
        urllib.request.ProxyHandler(),
        urllib.request.HTTPHandler(),
        urllib.request.HTTPSHandler(),
        urllib.request.HTTPErrorProcessor(),
        urllib.request.HTTPDefaultErrorHandler(),
    ):
        opener.add_handler(handler)
    return opener


def _read(answer: "IO[bytes]", url: str, max_bytes: int, stop: threading.Event) -> bytes:
    data = bytearray()
    while chunk := answer.read(_CHUNK):
        data += chunk
        if stop.is_set():
            break
        if len(data) > max_bytes:
            raise SourceError(url, f"the answer is longer than {max_bytes >> 20} MiB; ask for a smaller area")
    expected = getattr(answer, "length", None)
    if expected:
        raise BusyError(url, f"the answer broke off {expected} bytes before its end")
    return bytes(data)


def _refusal(url: str, error: urllib.error.HTTPError) -> SourceError:
    if 300 <= error.code < 400:
        target = str(error.headers.get("Location", "nowhere"))[:_LONGEST_QUOTE]
        return SourceError(url, f"redirects to {target!r}, which is not followed; name the server itself")
    said = quote(error.read(_CHUNK))
    problem = f"answers {error.code} {http.client.responses.get(error.code, '')}".rstrip()
    problem += f" ({said})" if said else ""
    if error.code in _BUSY:
        return BusyError(url, problem, after=_retry_after(error.headers.get("Retry-After")))
    return SourceError(url, problem)


def _unreachable(url: str, reason: object) -> SourceError:
    if isinstance(reason, TimeoutError):
        return BusyError(url, "cannot be reached within 60 s")
    if isinstance(reason, ConnectionResetError | BrokenPipeError):
        return BusyError(url, "closed the connection")
    cause = reason.strerror if isinstance(reason, OSError) and reason.strerror else str(reason)
    kind = "its name cannot be found" if isinstance(reason, socket.gaierror) else "cannot be reached"
    return SourceError(
        url,
        f"{kind} ({cause}); without a network, give a file: download the area elsewhere, for example with "
        "Export on www.openstreetmap.org, and run dojo-maps import-osm FILE",
    )


def quote(page: bytes) -> str:
    """Say in one line what a page tells people, without its markup.

    Args:
        page: HTML or plain text; bytes that are no UTF-8 are replaced.

    Returns:
        Printable words, at most 200 characters; empty where it tells nothing.
    """
    text = html.unescape(_MARKUP.sub(" ", page.decode("utf-8", "replace")))
    line = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    return line if len(line) <= _LONGEST_QUOTE else line[: _LONGEST_QUOTE - 1] + "…"


def _retry_after(text: str | None) -> float | None:
    """Read the seconds or the date of a Retry-After header. Source: RFC 9110, section 10.2.3."""
    if text is None:
        return None
    if text.strip().isascii() and text.strip().isdecimal():
        return float(text) if len(text.strip()) < 9 else 1e9
    try:
        return max(0.0, email.utils.parsedate_to_datetime(text).timestamp() - time.time())
    except (ValueError, TypeError, OverflowError):
        return None


def _problem(error: SourceError) -> str:
    return str(error).removeprefix(f"{error.path}: ")
