"""A recording as the 3D page plays it: where everybody was, and of its own map only."""

from dataclasses import replace

import numpy as np
import pytest

from dojo_env.errors import RecordingError
from dojo_env.playback import read_playback
from dojo_env.recording import Recorder
from dojo_env.snapshot import Kind, Lights, Snapshot
from dojo_maps.bundle import read_bundle
from dojo_maps.cli import main
from dojo_maps.conversion import convert


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    folder = tmp_path_factory.mktemp("playback") / "cologne1.dojo"
    convert("cologne1", folder)
    return read_bundle(folder)


@pytest.fixture
def recording(bundle, tmp_path):
    """A braking red car that drives on, and somebody who walks in the second instant only."""
    place = np.array([*bundle.road_map.origin, 0.0])
    signal = bundle.road_map.signals[0].id
    recorder = Recorder(scenario="cologne1", map_sha256=bundle.road_map.source.sha256)
    for k, time in enumerate((10.0, 11.0)):
        count = k + 1
        recorder.add(
            Snapshot(
                time=time,
                ids=("car", "walker")[:count],
                numbers=np.arange(1, count + 1),
                kinds=[Kind.CAR, Kind.PEDESTRIAN][:count],
                positions=place + [[12.0 * k, 5, 0], [3, 9, 0.1]][:count],
                headings=[0.1, -1.0][:count],
                slopes=np.zeros(count),
                sizes=[[4.6, 1.8, 1.5], [0.5, 0.5, 1.7]][:count],
                colours=[[200, 0, 0], [1, 2, 3]][:count],
                lights=[Lights.BRAKE, 0][:count],
                speeds=np.ones(count),
                lanes=("",) * count,
                signals={signal: "rG"[k] * 4},
            )
        )
    path = tmp_path / "episode.npz"
    recorder.write(path)
    return path


def test_read_playback_gives_everybody_their_place_size_and_colour(bundle, recording):
    found = read_playback(recording, bundle.road_map)
    assert found.times.tolist() == [10, 11]
    assert found.counts.tolist() == [1, 2]
    assert [found.ids[k] for k in found.users] == ["car", "car", "walker"]
    np.testing.assert_allclose(found.places[:2], [[0, 5, 0], [12, 5, 0]])
    assert np.linalg.norm(found.places[2] - [3, 9, 0.1]) < 0.5
    np.testing.assert_allclose(found.sizes[0], [4.6, 1.8, 1.5])
    assert found.lights.tolist() == [Lights.BRAKE, Lights.BRAKE, 0]
    assert abs(found.colours[0, 0].astype(int) - [200, 0, 0]).max() <= 2
    assert [found.states[k] for k in found.shown[:, 0]] == ["rrrr", "GGGG"]
    for near, far in found.models:
        assert len(near.faces) >= len(far.faces) > 0
        assert near.faces.max() < len(near.vertices)
        assert near.parts.max() < len(found.palette)


def test_read_playback_refuses_a_recording_of_another_map(bundle, recording):
    other = replace(bundle.road_map, source=replace(bundle.road_map.source, sha256="0" * 64))
    with pytest.raises(RecordingError, match="another map"):
        read_playback(recording, other)


def test_view_writes_a_page_with_the_recording(bundle, recording, tmp_path, capsys):
    page = tmp_path / "page.html"
    assert main(["view", str(bundle.folder), "--recording", str(recording), "-o", str(page)]) == 0
    assert capsys.readouterr().out.strip() == str(page)
    assert page.stat().st_size > 500_000
    assert main(["view", str(bundle.folder), "--recording", str(tmp_path / "none.npz"), "-o", str(page)]) == 3
    assert "none.npz" in capsys.readouterr().err


def test_view_converts_what_is_no_bundle(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["view", "two-way", "-o", "page.html"]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]
    assert main(["view", "nowhere", "-o", "other.html"]) == 3
    assert "no such file" in capsys.readouterr().err
