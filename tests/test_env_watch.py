"""The live page in a real browser, its pace, what strangers can do to its server, and how it ends."""

import http.client
import json
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Browser, needs_browser
from conftest import command_environment

from dojo_env.cli import main
from dojo_env.config import build_config
from dojo_env.errors import ConfigError
from dojo_env.local_world import LocalWorld
from dojo_env.watching.board import Board, Lamp, Scoreboard, read_board
from dojo_env.watching.pace import Pace
from dojo_env.watching.page import PageState
from dojo_env.watching.poster import draw_poster
from dojo_env.watching.server import LiveServer
from dojo_env.watching.views import Frame


class Watched:
    """The command in a process of its own, and where its page is."""

    def __init__(self, *arguments: str) -> None:
        command = [sys.executable, "-m", "dojo_env.cli", *arguments, "--no-browser"]
        self.process = subprocess.Popen(command, env=command_environment(), stderr=subprocess.PIPE, text=True)
        assert self.process.stderr is not None
        self.said = self.process.stderr.readline()
        found = re.search(r"http://127\.0\.0\.1:\d+/", self.said)
        assert found, self.said + self.process.stderr.read()
        self.url = found.group()

    def end(self, number: signal.Signals = signal.SIGINT) -> tuple[int, str]:
        """Interrupt it; returns its status and its last words."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        try:
            _, rest = self.process.communicate(timeout=60)
        finally:
            self.process.kill()
        return self.process.returncode, rest


def watching(*arguments: str) -> closing:
    watched = Watched(*arguments)
    watched.close = watched.end  # type: ignore[attr-defined]
    return closing(watched)  # type: ignore[type-var]


@pytest.mark.slow
@pytest.mark.sampled(1)
@needs_browser
@pytest.mark.parametrize("scenario", ["two-way", "cologne1"])
def test_the_page_shows_pauses_steps_and_goes_on(scenario: str, tmp_path: Path) -> None:
    arguments = ("watch", "--scenario", scenario, "--controller", "fixed-time", "--seconds", "3000")
    with watching(*arguments) as watched, Browser(watched.url, tmp_path / "profile") as page:

        def number() -> int:
            return int("".join(filter(str.isdigit, page.text("second"))) or 0)

        def rests() -> bool:
            before = number()
            time.sleep(1.0)
            return number() == before

        page.wait(lambda: number() > 40, 180)  # The map may have to be converted first, and kernels compiled.
        assert page.text("status") == "live"
        assert page.text("title") == f"{scenario}, fixed-time, seed 0"
        page.click("pause")
        page.wait(lambda: page.text("status") == "paused")
        # Seconds that had been simulated when the button was pressed may still be drawn.
        page.wait(rests, 20)
        stopped = number()
        time.sleep(1.0)
        assert number() == stopped
        for k in range(1, 4):
            page.click("step")
            page.wait(lambda k=k: number() == stopped + k)
        clock = page.text("clock")
        time.sleep(0.5)
        assert (number(), page.text("clock")) == (stopped + 3, clock)
        page.click("pause")
        page.wait(lambda: number() > stopped + 10)
        titles = page.run("[...document.querySelectorAll('figcaption')].map(each => each.textContent)")
        assert titles == ["From above", *(f"Approach {k}" for k in range(1, 5))]
        page.wait(lambda: page.run("[...document.images].every(each => each.naturalWidth > 300)"))
        assert page.run("document.querySelectorAll('#queue path').length") == 2
        assert page.run("document.querySelectorAll('.links i').length") in {12, 20}
        assert page.run("document.documentElement.scrollWidth <= innerWidth")


@pytest.mark.sampled(0)
@needs_browser
def test_the_page_chooses_among_signals_while_it_is_paused(tmp_path: Path) -> None:
    with watching("watch", "--scenario", "cologne3") as watched, Browser(watched.url, tmp_path) as page:
        page.wait(lambda: page.run("document.querySelectorAll('.row').length") == 3)
        page.click("pause")
        page.wait(lambda: page.text("status") == "paused")
        before = page.run("document.images[0].src")
        page.run("document.querySelectorAll('.row')[1].click()")
        page.wait(lambda: page.run("document.querySelectorAll('.row')[1].className").endswith("chosen"))
        page.wait(lambda: page.run("document.images.length") == 5)
        assert page.run("document.images[0].src") != before


@pytest.mark.slow
@needs_browser
def test_a_recording_is_watched_to_its_end(tmp_path: Path) -> None:
    arguments = ["run", "--scenario", "two-way", "--controller", "sotl", "--seconds", "20"]
    assert main([*arguments, "--record", str(tmp_path / "rec")]) == 0
    recording = str(tmp_path / "rec_ep1.npz")
    with watching("replay", recording) as watched, Browser(watched.url, tmp_path / "profile") as page:
        page.wait(lambda: page.text("status") == "episode over")
        page.wait(lambda: page.text("clock") == "00:00:20")
        assert page.text("second") == "frame 21"


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_ends_it_with_one_line_and_status_130(number: signal.Signals) -> None:
    watched = Watched("watch", "--scenario", "two-way", "--seconds", "3000")
    port = int(watched.url.rsplit(":", 1)[1].strip("/"))
    with socket.create_connection(("127.0.0.1", port)):
        time.sleep(1.0)
        status, words = watched.end(number)
    assert (status, words) == (130, "dojo-env: interrupted\n")
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", port))


@pytest.mark.slow
@pytest.mark.parametrize("becomes", ["pass", "raise TypeError('cannot compare') from None"])
def test_an_interruption_that_a_library_swallowed_or_renamed_ends_it_all_the_same(becomes: str) -> None:
    script = f"""
import signal, sys
from dojo_env import watch
from dojo_env.cli import main
from dojo_maps import interruption

note = watch.Scoreboard.note

def swallow(scores, snapshot):
    if snapshot.time == 5:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            {becomes}
    return note(scores, snapshot)

watch.Scoreboard.note = swallow
interruption.begin("dojo-env: interrupted")
sys.exit(main(["watch", "--scenario", "two-way", "--no-browser"]))
"""
    done = subprocess.run(
        [sys.executable, "-c", script], env=command_environment(),
        stderr=subprocess.PIPE, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr.splitlines()[1:]) == (130, ["dojo-env: interrupted"])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--scenario", "nowhere"], "nowhere"),
        (["--controller", "magic"], "magic"),
        (["--port", "70000"], "--port"),
        (["--conditions", "sunny"], "sunny"),
    ],
)
def test_wrong_usage_of_watch_is_one_line_and_a_status(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["watch", "--no-browser", *arguments]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


@pytest.mark.sampled(1)
@pytest.mark.parametrize("scenario", ["two-way", "cologne1", "cologne3"])
def test_figures_counted_from_snapshots_are_those_of_the_environment(scenario: str) -> None:
    world = LocalWorld(build_config(scenario=scenario, num_seconds=300))
    scores, counted = Scoreboard(world.map.plans), []
    world.watch(lambda snapshot: counted.append(scores.note(snapshot)))
    for _ in range(2):
        counted.clear()
        world.reset(1)
        ended, k = False, 0
        while not ended:
            *_, ended, _ = world.step(dict.fromkeys(world.signals, k // 4 % 2))
            k += 1
            own, found = read_board(world.instant), counted[-1]
            same = ("time", "queue", "vehicles", "arrived")
            assert [getattr(found, name) for name in same] == [getattr(own, name) for name in same]
            assert found.speed == pytest.approx(own.speed)
            assert found.waiting == pytest.approx(own.waiting, rel=0.02, abs=3)
            for a, b in zip(found.lamps, own.lamps, strict=True):
                assert (a.signal, a.phase, a.state, a.queue) == (b.signal, b.phase, b.state, b.queue)
                assert abs(a.green_time - b.green_time) <= 1
        assert len(counted) == 301
    world.close()


def test_pace_keeps_to_its_speed_and_stops_and_steps() -> None:
    pace = Pace(20)
    start = time.monotonic()
    for _ in range(21):
        assert pace.wait()
    assert 0.9 < time.monotonic() - start < 2.0
    pace.set_speed(0)
    start = time.monotonic()
    assert all(pace.wait() for _ in range(1000))
    assert time.monotonic() - start < 0.5
    pace.pause()
    passed: list[bool] = []
    thread = threading.Thread(target=lambda: passed.extend(pace.wait() for _ in range(4)))
    thread.start()
    time.sleep(0.2)
    assert not passed
    pace.step()
    pace.nudge()
    pace.step()
    time.sleep(0.2)
    assert sorted(passed) == [False, True, True]
    pace.play()
    thread.join(5)
    assert len(passed) == 4


def board(time: float, queue: int = 3) -> Board:
    lamp = Lamp(signal="a", phase=None, phases=2, state="Gr", green_time=0, queue=queue)
    return Board(time=time, queue=queue, waiting=1.0, vehicles=4, arrived=0, speed=2.0, lamps=(lamp,))


def test_a_page_s_charts_stay_small_and_keep_the_whole_episode() -> None:
    page = PageState("title", ("a",), None)
    for second in range(5000):
        page.note(board(float(second)))
    page.publish(Frame(board=board(4999.0), views={}))
    page.note(board(5000.0))
    history = json.loads(page.wait(0, 1))["history"]
    assert len(history) <= 401
    assert history[0][0] == 0
    assert history[-1][0] > 4950
    page.note(board(0.0))
    page.publish(Frame(board=board(0.0), views={}))
    assert json.loads(page.wait(0, 1))["history"] == [[0.0, 3, 1.0]]


@pytest.fixture
def served() -> Iterator[tuple[PageState, LiveServer, Pace]]:
    """A page with one frame, served."""
    pace = Pace()
    page = PageState("<title> & co", ("a", "b"), pace)
    page.note(board(1.0))
    page.publish(Frame(board=board(1.0), views={"view": np.zeros((8, 8, 3), np.uint8)}))
    server = LiveServer(page)
    yield page, server, pace
    server.close()


def ask(
    server: LiveServer, method: str, path: str, *, body: bytes | None = None, **headers: str
) -> tuple[int, bytes, dict[str, str]]:
    port = int(server.url.rsplit(":", 1)[1].strip("/"))
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request(method, path, body=body, headers=named)
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer.status, content, dict(answer.getheaders())


def token(server: LiveServer) -> str:
    found = re.search(rb'TOKEN = "([^"]+)"', ask(server, "GET", "/")[1])
    assert found
    return found.group(1).decode()


def test_the_page_loads_nothing_from_elsewhere(served: Any) -> None:
    status, content, headers = ask(served[1], "GET", "/")
    assert status == 200
    text = content.decode()
    assert not re.search(r"""(src|href)=["']|@import|url\(|https?://(?!www\.w3\.org/2000/svg)""", text)
    policy = headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert "{nonce}" not in text
    assert "{token}" not in text


def test_orders_are_taken_from_the_page_alone(served: Any) -> None:
    page, server, pace = served
    good = token(server)
    pause = json.dumps({"action": "pause"}).encode()
    for headers in (
        {},
        {"X_Dojo_Token": "guess"},
        {"X_Dojo_Token": "\xe9"},
        {"X_Dojo_Token": good, "Origin": "http://evil.example"},
        {"X_Dojo_Token": good, "Origin": "null"},
        {"X_Dojo_Token": good, "Host": "evil.example"},
    ):
        assert ask(server, "POST", "/control", body=pause, **headers)[0] == 403
    assert not pace.paused
    assert ask(server, "POST", "/control", body=pause, X_Dojo_Token=good)[0] == 200
    assert pace.paused
    own = server.url.rstrip("/")
    signal_b = json.dumps({"action": "signal", "value": "b"}).encode()
    assert ask(server, "POST", "/control", body=signal_b, X_Dojo_Token=good, Origin=own)[0] == 200
    assert page.signal == "b"


@pytest.mark.parametrize(
    "order",
    [
        b"", b"{", b"[]", b"7", b'{"action": "close"}', b'{"action": "speed", "value": 1e99}',
        b'{"action": "speed", "value": [1]}', b'{"action": "speed", "value": {}}', b'{"action": ["pause"]}',
        b'{"action": "signal", "value": "c"}', b'{"action": "signal", "value": ["a"]}', b"\xff\xfe",
        b"[" * 400, b" " * 501,
    ],
)  # fmt: skip
def test_an_order_that_makes_no_sense_is_refused(order: bytes, served: Any) -> None:
    page, server, pace = served
    assert ask(server, "POST", "/control", body=order, X_Dojo_Token=token(server))[0] == 400
    assert (pace.paused, pace.speed, page.signal) == (False, 10, "a")


@pytest.mark.parametrize(
    ("method", "path", "host", "status"),
    [
        ("GET", "/", "evil.example", 403),
        ("GET", "/frame?after=0", "127.0.0.1", 403),
        ("GET", "/../page.html", "", 404),
        ("GET", "/frame", "", 400),
        ("GET", "/frame?after=-1", "", 400),
        ("GET", "/frame?after=" + "9" * 30, "", 400),
        ("POST", "/frame", "", 404),
        ("PUT", "/control", "", 501),
        ("DELETE", "/", "", 501),
    ],
)
def test_a_request_for_anything_else_is_refused(
    method: str, path: str, host: str, status: int, served: Any
) -> None:
    headers = {"Host": host} if host else {}
    assert ask(served[1], method, path, **headers)[0] == status


@pytest.mark.slow
def test_strangers_who_hold_connections_open_are_bounded_and_cut_off(served: Any) -> None:
    page, server, _ = served
    port = int(server.url.rsplit(":", 1)[1].strip("/"))
    before = threading.active_count()
    idle = [socket.create_connection(("127.0.0.1", port)) for _ in range(60)]
    time.sleep(0.5)
    assert threading.active_count() - before <= 16
    for each in idle:
        each.close()
    time.sleep(0.5)
    assert ask(server, "GET", "/frame?after=0")[0] == 200
    slow = socket.create_connection(("127.0.0.1", port))
    slow.sendall(b"POST /control HTTP/1.0\r\nContent-")
    start = time.monotonic()
    server.close()
    assert time.monotonic() - start < 3
    slow.close()
    assert page.control({"action": "pause"}) is None


def test_a_port_that_is_taken_gets_one_clear_error(served: Any) -> None:
    port = int(served[1].url.rsplit(":", 1)[1].strip("/"))
    with pytest.raises(ConfigError, match=f"port {port} cannot be used"):
        LiveServer(served[0], port=port)


@pytest.mark.parametrize(
    "sizes", [[(256, 1356), (256, 364)], [(300, 40)], [(256, 100), (64, 900), (70, 100)], [(512, 512)] * 3]
)
def test_a_picture_holds_every_view_whatever_its_size(sizes: list[tuple[int, int]]) -> None:
    views = {str(k): np.full((*size, 3), 200 + k, dtype=np.uint8) for k, size in enumerate(sizes)}
    drawn = draw_poster(Frame(board=board(0.0), views=views), title="")
    for name, view in views.items():
        seen = np.count_nonzero((drawn == int(name) + 200).all(axis=2))
        assert 0.8 * view[..., 0].size <= seen  # The title covers a corner.
