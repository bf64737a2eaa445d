"""Films of real cameras: reading them, counting their lanes, and what a controller would do."""

import json
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from itertools import pairwise

import cv2
import numpy as np
import pytest
from browser import Browser, needs_browser
from tiny_networks import build_network

from dojo_env.camera import Camera, write_cameras
from dojo_env.cli import main
from dojo_env.detectors.base import Detections
from dojo_env.detectors.measuring import LaneMeasurements
from dojo_env.errors import ConfigError, FilmError, RegionError
from dojo_env.films.advice import POLICIES, Advisor
from dojo_env.films.places import MapPlace
from dojo_env.films.regions import Region, RegionMeasurer, read_regions
from dojo_env.films.source import read_frames
from dojo_env.snapshot import Kind
from dojo_env.watching.video import open_video
from dojo_maps.bundle import read_bundle

SIGNAL = "GS_cluster_357187_359543"
STREET = Camera(
    name="street", position=(11841.5, 13323.1, 7.5), heading_deg=168.0, pitch_deg=-14.0,
    field_of_view_deg=62.0, width=256, height=128,
)  # fmt: skip


@pytest.fixture(scope="module")
def bundle(converted):
    return read_bundle(converted("cologne1").folder)


def picture_of(box):
    """A grey street with something red on it."""
    made = np.full((128, 256, 3), 90, np.uint8)
    left, top, right, bottom = box
    made[top:bottom, left:right] = (255, 0, 0)
    return made


@pytest.fixture
def film(tmp_path):
    """Six seconds of a red box that drives to the right and stops, two frames a second."""
    places = [20, 50, 80, 110, 140, 150, 150, 150, 150, 150, 150, 150]
    with open_video(tmp_path / "film.mp4", frame_rate=2.0) as video:
        for left in places:
            video.add(picture_of((left, 40, left + 60, 80)))
    return tmp_path / "film.mp4"


@needs_browser
@pytest.mark.parametrize("suffix", [".mp4", ".webm"])
def test_film_plays_in_a_browser(suffix, tmp_path):
    with open_video(tmp_path / f"film{suffix}") as video:
        for level in range(0, 250, 50):
            video.add(np.full((64, 96, 3), level, np.uint8))
    page = tmp_path / "page.html"
    page.write_text(f'<video src="film{suffix}" muted></video>')
    with Browser(page.as_uri(), tmp_path / "profile") as browser:
        shown = browser.run(
            "new Promise(done => { const film = document.querySelector('video');"
            "film.onended = () => done([film.videoWidth, film.videoHeight]);"
            "film.play().catch(error => done(String(error))); })"
        )
    assert shown == [96, 64]


def regions_file(path, regions, width=256, height=128):
    value = {"format": "dojo-regions", "version": 1, "width": width, "height": height, "regions": regions}
    path.write_text(json.dumps(value))
    return path


def test_a_film_gives_a_frame_for_each_look(film):
    assert [(frame.time, frame.name) for frame in read_frames(str(film))] == [
        (float(k), str(2 * k)) for k in range(6)
    ]
    every = list(read_frames(str(film), every=0.0))
    assert [frame.time for frame in every] == [k / 2 for k in range(12)]
    assert every[0].picture.shape == (128, 256, 3)
    red = every[0].picture[60, 50].astype(int)
    assert red[0] > red[2] + 100  # RGB, not BGR.


def test_a_folder_gives_its_pictures_in_order(tmp_path):
    for name in ("b.png", "a.png", "c.png"):
        cv2.imwrite(str(tmp_path / name), picture_of((20, 40, 60, 80)))
    (tmp_path / "notes.txt").write_text("no picture")
    assert [(frame.name, frame.time) for frame in read_frames(str(tmp_path), every=0.0, rate=4.0)] == [
        ("a.png", 0.0), ("b.png", 0.25), ("c.png", 0.5),
    ]  # fmt: skip
    assert [frame.name for frame in read_frames(str(tmp_path), every=0.5, rate=4.0)] == ["a.png", "c.png"]


def test_a_stream_is_read_until_it_ends(film, caplog):
    handler = partial(_Quiet, directory=str(film.parent))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://user:secret@127.0.0.1:{server.server_port}/film.mp4"
        frames = list(read_frames(address, every=0.0))
        with pytest.raises(FilmError, match="cannot be opened") as caught:
            next(read_frames(address.replace("film.mp4", "none.mp4")))
        server.shutdown()
    assert len(frames) == 12
    told = caplog.text + str(caught.value)
    assert "ended after 12 frames" in told
    assert "secret" not in told


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [("none.mp4", None, "no such file"),
     ("list.mp4", b"#EXTM3U\n#EXTINF:1,\nhttp://127.0.0.1/x.ts\n", "no film of a kind"),
     ("concat.mp4", b"ffconcat version 1.0\nfile /etc/hostname\n", "no film of a kind"),
     ("cut.mp4", b"\x00\x00\x00\x1cftypisom" + bytes(100), "cannot be opened"),
     ("empty.mp4", b"", "no film of a kind")],
)  # fmt: skip
def test_what_is_no_film_is_refused(tmp_path, name, data, message):
    if data is not None:
        (tmp_path / name).write_bytes(data)
    with pytest.raises(FilmError, match=message):
        next(read_frames(str(tmp_path / name)))
    with pytest.raises(FilmError, match="holds no JPEG or PNG"):
        (tmp_path / "folder").mkdir()
        next(read_frames(str(tmp_path / "folder")))


def found(*boxes):
    return Detections(
        boxes=np.array(boxes, np.float64).reshape(-1, 4),
        scores=np.ones(len(boxes)),
        kinds=np.full(len(boxes), Kind.CAR, np.uint8),
    )


def test_regions_count_who_stands_and_who_drives():
    left, right = (
        Region(lane=name, polygon=np.array([(x, 0), (x + 100, 0), (x + 100, 100), (x, 100)], np.float64))
        for name, x in (("left", 0.0), ("right", 100.0))
    )
    measurer = RegionMeasurer((left, right))
    for second in range(6):
        # A car 30 px high, 1.5 m, that drives 60 px, 3 m, a second; and one that trembles.
        drives, stands = (10 + 60 * second, 40, 60 + 60 * second, 70), (30 + second % 2, 10, 70, 36)
        measured = measurer.update(float(second), found(drives, stands))
    assert measured.lanes.lanes == ("left", "right")
    assert measured.lanes.vehicles.tolist() == [1, 0]  # The first one has left both.
    assert measured.lanes.halting.tolist() == [1, 0]
    assert measured.lanes.waiting[0] == pytest.approx(5.0)
    by_number = {seen.number: seen for seen in measured.seen}
    assert set(by_number) == {1, 2}  # Nobody was lost and found again.
    assert by_number[1].speed == pytest.approx(3.0, rel=0.05)
    assert (by_number[1].lane, by_number[2].lane) == ("", "left")


@pytest.mark.parametrize(
    ("text", "message"),
    [("[]", "not a dojo-regions file"),
     ('{"format": "dojo-regions", "version": 1}', "width and height are missing"),
     ('{"format": "dojo-regions", "version": 1, "width": 9, "height": 9, "regions": {}}', "1 to 1000"),
     ('{"format": "dojo-regions", "version": 1, "width": 9, "height": 9, "regions": {"a": [[1, 2]]}}',
      "region 'a': expected 3 to 1000 corners"),
     ('{"format": "dojo-regions", "version": 1, "width": 9, "height": 9, "regions": {"a": [[1], 2]}}',
      "region 'a'")],
)  # fmt: skip
def test_broken_regions_are_refused(tmp_path, text, message):
    (tmp_path / "regions.json").write_text(text)
    with pytest.raises(RegionError) as caught:
        read_regions(tmp_path / "regions.json")
    assert message in str(caught.value)


def measured_at(time, queues):
    """Lanes with so many standing vehicles each."""
    counts = np.array(list(queues.values()), np.float64)
    return LaneMeasurements(
        time=time,
        lanes=tuple(queues),
        vehicles=counts,
        halting=counts,
        mean_speed=np.where(counts > 0, 0.0, np.nan),
        mean_length=np.where(counts > 0, 4.7, 0.0),
        waiting=counts,
        tracks=tuple(tuple(range(count)) for count in queues.values()),
    )


def lanes_of(bundle):
    return [lane.id for lane in bundle.road_map.lanes]


def serving(plan, phase):
    """The lanes that have green with priority in a phase."""
    return {lane for link, lane, _ in plan.links if plan.phases[phase][link] == "G"}


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "policy", ["max-pressure", "queue-pressure", "sotl", "max-pressure-paper", "learned"]
)
def test_controllers_give_green_to_the_queue(bundle, policy):
    advisor = Advisor(bundle, policy, lanes_of(bundle))
    plan = advisor.plans[SIGNAL]
    lane = (serving(plan, 2) - serving(plan, 0)).pop()
    for second in range(60):
        (advice,) = advisor.advise(measured_at(float(second), {lane: 7}))
        if second < 10:
            assert advice.state == plan.phases[0]  # The minimum green holds.
    assert lane in serving(plan, advice.phase)
    assert advice.state == plan.phases[advice.phase]
    assert advice.demand[advice.phase].halting == 7
    assert "7" in advice.describe()


def test_what_is_shown_goes_through_yellow_and_never_lets_foes_go(bundle):
    advisor = Advisor(bundle, "random", lanes_of(bundle))
    plan = advisor.plans[SIGNAL]
    states = []
    for second in range(400):
        (advice,) = advisor.advise(measured_at(float(second), dict.fromkeys(plan.lanes, 1)))
        states.append(advice.state)
    assert len(set(states)) > 4
    for before, now in pairwise(states):
        green = [k for k, letter in enumerate(now) if letter == "G"]
        assert not plan.conflicts.foes[np.ix_(green, green)].any()
        assert not any(a in "Gg" and b == "r" for a, b in zip(before, now, strict=True))


def test_nobody_waits_longer_than_the_longest_red(bundle):
    advisor = Advisor(bundle, "max-pressure", lanes_of(bundle))
    plan = advisor.plans[SIGNAL]
    busy = serving(plan, 0).pop()
    lonely = (serving(plan, 2) - serving(plan, 0)).pop()
    served = [
        second
        for second in range(300)
        for advice in advisor.advise(measured_at(float(second), {busy: 20, lonely: 1}))
        if lonely in serving(plan, advice.phase)
    ]
    assert served
    assert min(served) <= 130


def test_fixed_time_follows_the_networks_program(bundle):
    advisor = Advisor(bundle, "fixed-time", lanes_of(bundle))
    plan = advisor.plans[SIGNAL]
    cycle = sum(green.seconds + green.change for green in plan.greens)
    shown = [advisor.advise(measured_at(float(second), {}))[0].phase for second in range(int(3 * cycle))]
    for green in plan.greens:
        assert shown.count(green.phase) / len(shown) == pytest.approx(
            (green.seconds + green.change) / cycle, abs=0.08
        )


def test_controllers_that_sumo_runs_are_refused(bundle):
    for policy in ("actuated", "delay-based", "nobody"):
        assert policy not in POLICIES
        with pytest.raises(ConfigError, match=policy):
            Advisor(bundle, policy, lanes_of(bundle))
    with pytest.raises(ConfigError, match="'oncoming', leads to a signal"):
        Advisor(bundle, "max-pressure", ["oncoming"])


def test_a_camera_of_another_shape_is_refused(bundle):
    place = MapPlace(bundle, STREET)
    assert place.measure(512, 256).part is not None
    with pytest.raises(ConfigError, match="256 x 128, the film has 640 x 480"):
        place.measure(640, 480)
    up = Camera(name="up", position=STREET.position, pitch_deg=60.0)
    with pytest.raises(ConfigError, match="'up' sees no lane"):
        MapPlace(bundle, up)


def test_command_counts_regions_and_writes_a_film(film, tmp_path, capsys):
    (tmp_path / "red.onnx").write_bytes(build_network("yolo8"))
    half = {"first": [[0, 0], [64, 0], [64, 64], [0, 64]], "second": [[64, 0], [128, 0], [128, 64], [64, 64]]}
    regions = regions_file(tmp_path / "regions.json", half, width=128, height=64)  # Half the film's size.
    common = ["watch-video", str(film), "--detector", str(tmp_path / "red.onnx"), "--regions", str(regions)]
    assert main([*common, "--every", "0.5", "--output", str(tmp_path / "seen.mp4")]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [line["time"] for line in lines] == [k / 2 for k in range(12)]
    first, last = (line["lanes"] for line in (lines[0], lines[-1]))
    assert (first["first"]["vehicles"], first["second"]["vehicles"]) == (1, 0)
    assert last["second"] == {"vehicles": 1, "halting": 1, "speed": pytest.approx(0.0, abs=0.3)}
    seen = [frame.picture.shape for frame in read_frames(str(tmp_path / "seen.mp4"), every=0.0)]
    assert len(seen) == 12
    assert seen[0][0] > 128  # A line is written below.
    assert main([*common, "--json", str(tmp_path / "out.jsonl"), "--seconds", "2"]) == 0
    assert "first" in capsys.readouterr().out
    assert len((tmp_path / "out.jsonl").read_text().splitlines()) == 3


def test_command_tells_what_a_controller_would_do(bundle, film, tmp_path, capsys):
    (tmp_path / "red.onnx").write_bytes(build_network("yolo8"))
    write_cameras([STREET], tmp_path / "cameras.json")
    arguments = [
        "watch-video",
        str(film),
        "--detector",
        str(tmp_path / "red.onnx"),
        "--map",
        str(bundle.folder),
    ]
    assert main([*arguments, "--camera", str(tmp_path / "cameras.json"), "--policy", "learned"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert len(lines) == 6
    for line in lines:
        assert "-32038056#3_0" in line["lanes"]
        assert line["signals"][SIGNAL]["why"].startswith("phase")
    for wrong in (
        [],
        ["--camera", "c.json", "--regions", "r.json"],
        ["--regions", "r.json", "--every", "-1"],
    ):
        assert main([*arguments, *wrong]) in {2, 3}
        assert capsys.readouterr().err.count("\n") == 1
