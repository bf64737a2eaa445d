"""A headless browser for tests, told what to do over a pipe in Chromium's own protocol."""

import base64
import contextlib
import json
import os
import shutil
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

import pytest

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
_FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
)  # fmt: skip
WITHOUT_GL = ("--disable-gpu",)
WITH_GL = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
ONE_LOOK = (*_FLAGS, *WITH_GL, "--window-size=800,600", "--virtual-time-budget=10000")
"""For who opens a page once and takes what it then is."""
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")


class Browser:
    """One page of a browser, for the length of a context."""

    def __init__(
        self,
        url: str,
        profile: Path,
        *,
        size: tuple[int, int] = (1440, 900),
        flags: tuple[str, ...] = WITHOUT_GL,
    ) -> None:
        theirs_in, ours_out = os.pipe()
        ours_in, theirs_out = os.pipe()
        command = [
            str(CHROMIUM),
            *_FLAGS,
            *flags,
            "--remote-debugging-pipe",
            f"--window-size={size[0]},{size[1]}",
            f"--user-data-dir={profile}",
        ]
        # Chromium reads orders from descriptor 3 and answers on 4.
        shell = ["bash", "-c", f'exec "$@" 3<&{theirs_in} 4>&{theirs_out}', "bash", *command, "about:blank"]
        self._process = subprocess.Popen(
            shell, pass_fds=(theirs_in, theirs_out), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        os.close(theirs_in)
        os.close(theirs_out)
        self._in, self._out = os.fdopen(ours_in, "rb"), os.fdopen(ours_out, "wb")
        self._number, self._session, self._buffer = 0, "", b""
        self._reached: set[tuple[str, str]] = set()
        targets = self._call("Target.getTargets")["targetInfos"]
        page = next(target["targetId"] for target in targets if target["type"] == "page")
        self._session = self._call("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        screen = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": False}
        self._call("Emulation.setDeviceMetricsOverride", **screen)
        self._call("Page.enable")
        self._call("Page.setLifecycleEventsEnabled", enabled=True)
        loader = self._call("Page.navigate", url=url)["loaderId"]
        # The order is answered before there is a page; what is asked too early is asked of the blank one.
        while (loader, "DOMContentLoaded") not in self._reached:
            self._next_answer()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._session = ""
        with contextlib.suppress(OSError, EOFError):
            self._call("Browser.close")
        self._in.close()
        self._out.close()
        self._process.wait(20)

    def run(self, script: str) -> Any:
        """Give an expression's value on the page."""
        answer = self._call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def text(self, name: str) -> str:
        """Give the text of the element with an id."""
        return self.run(f"document.getElementById({name!r})?.textContent ?? ''")

    def click(self, name: str) -> None:
        """Press the mouse in the middle of the element with an id."""
        place = self.run(
            f"(r => [r.x + r.width / 2, r.y + r.height / 2])(document.getElementById({name!r})"
            ".getBoundingClientRect())"
        )
        for kind in ("mousePressed", "mouseReleased"):
            button = {"x": place[0], "y": place[1], "button": "left", "clickCount": 1}
            self._call("Input.dispatchMouseEvent", type=kind, **button)

    def wait(self, condition: Callable[[], Any], seconds: float = 60) -> Any:
        """Wait until a condition holds; returns what it gave."""
        end = time.monotonic() + seconds
        while not (found := condition()):
            assert time.monotonic() < end, "the page did not get there"
            time.sleep(0.05)
        return found

    def photograph(self) -> bytes:
        """Take a picture of the page, as PNG."""
        return base64.b64decode(self._call("Page.captureScreenshot", format="png")["data"])

    def _call(self, method: str, **parameters: Any) -> Any:
        self._number += 1
        order = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            order["sessionId"] = self._session
        self._out.write(json.dumps(order).encode() + b"\0")
        self._out.flush()
        while (answer := self._next_answer()).get("id") != self._number:
            pass
        assert "error" not in answer, answer["error"]
        return answer["result"]

    def _next_answer(self) -> dict[str, Any]:
        """Give the browser's next message; how far pages have come is kept."""
        message: dict[str, Any] = json.loads(self._read())
        if message.get("method") == "Page.lifecycleEvent":
            self._reached.add((message["params"]["loaderId"], message["params"]["name"]))
        return message

    def _read(self) -> bytes:
        while b"\0" not in self._buffer:
            more = os.read(self._in.fileno(), 1 << 16)
            if not more:
                raise EOFError("the browser has ended")
            self._buffer += more
        message, _, self._buffer = self._buffer.partition(b"\0")
        return message
