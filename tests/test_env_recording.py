"""Snapshots against SUMO, and recordings that come back as they were, whoever made the file."""

import io
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from dojo_env.config import build_config
from dojo_env.errors import RecordingError
from dojo_env.local_world import LocalWorld
from dojo_env.recording import Recorder, read_recording
from dojo_env.snapshot import Kind, Lights, Snapshot


@pytest.fixture
def world(tmp_path: Path) -> Iterator[LocalWorld]:
    """A world that records."""
    made = LocalWorld(build_config(scenario="cologne1", num_seconds=100, record_name=str(tmp_path / "rec")))
    yield made
    made.close()


def same(a: Snapshot, b: Snapshot) -> bool:
    arrays = ("numbers", "kinds", "positions", "headings", "slopes", "sizes", "colours", "lights", "speeds")
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in arrays) and (
        a.time,
        a.ids,
        a.lanes,
        a.types,
        dict(a.signals),
    ) == (b.time, b.ids, b.lanes, b.types, dict(b.signals))


def test_snapshot_shows_every_vehicle_as_sumo_has_it(world: LocalWorld) -> None:
    world.reset(1)
    for _ in range(15):
        world.step({world.signals[0]: 0})
    snapshot = world.instant.snapshot
    import libsumo  # noqa: PLC0415 - the oracle

    assert snapshot.ids == libsumo.vehicle.getIDList()
    for row, name in enumerate(snapshot.ids):
        assert tuple(snapshot.positions[row]) == libsumo.vehicle.getPosition3D(name)
        x, y = np.cos(snapshot.headings[row]), np.sin(snapshot.headings[row])
        angle = np.radians(libsumo.vehicle.getAngle(name))
        assert (x, y) == pytest.approx((np.sin(angle), np.cos(angle)))
        assert snapshot.sizes[row, 0] == pytest.approx(4.3)
        assert snapshot.lanes[row] == libsumo.vehicle.getLaneID(name)
        braking = bool(libsumo.vehicle.getSignals(name) & 8)
        assert bool(snapshot.lights[row] & Lights.BRAKE) == braking
    assert set(snapshot.kinds) == {Kind.CAR}
    assert snapshot.signals[world.signals[0]] == world.map.plans[world.signals[0]].phases[0]


def test_a_recording_reads_back_as_it_was(world: LocalWorld, tmp_path: Path) -> None:
    world.reset(1)
    seen = [world.instant.snapshot]
    ended = False
    while not ended:
        *_, ended, _ = world.step({world.signals[0]: 1})
        seen.append(world.instant.snapshot)
    recording = read_recording(tmp_path / "rec_ep1.npz")
    assert len(recording) == 101
    assert all(same(recording[5 * k], snapshot) for k, snapshot in enumerate(seen))
    assert [s.time for s in recording[-2:]] == [25299, 25300]
    with pytest.raises(IndexError):
        recording[101]


def test_an_episode_that_is_broken_off_is_written(world: LocalWorld, tmp_path: Path) -> None:
    world.reset(1)
    world.step({})
    world.reset(2)
    world.step({})
    world.close()
    assert len(read_recording(tmp_path / "rec_ep1.npz")) == 6
    assert len(read_recording(tmp_path / "rec_ep2.npz")) == 6


def damaged(good: bytes, kind: str) -> bytes:  # noqa: C901, PLR0912 - a line per kind of damage
    """Damage a recording in one way."""
    if kind == "cut":
        return good[: len(good) // 2]
    if kind == "text":
        return b"not a recording"
    with zipfile.ZipFile(io.BytesIO(good)) as old:
        members = {name: old.read(name) for name in old.namelist()}
    arrays = {name.removesuffix(".npy"): np.load(io.BytesIO(data)) for name, data in members.items()}
    match kind:
        case "missing":
            del arrays["times"]
        case "version":
            arrays["version"] = np.array(99)
        case "objects":
            arrays["times"] = np.array([print] * len(arrays["times"]), dtype=object)
        case "index":
            arrays["users"] = arrays["users"] + 10**6
        case "length":
            arrays["headings"] = arrays["headings"][:-1]
        case "negative":
            arrays["counts"] = -arrays["counts"]
        case "order":
            arrays["times"] = arrays["times"][::-1]
        case "empty":
            arrays["times"], arrays["counts"] = arrays["times"][:0], arrays["counts"][:0]
        case "speed":
            arrays["speeds"] = arrays["speeds"] * np.inf
        case "seed":
            arrays["seed"] = np.array("one")
        case "nan":
            arrays["positions"] = arrays["positions"] * np.nan
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=True, **arrays)
    if kind != "huge":
        return buffer.getvalue()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as new:
        for name, data in members.items():
            if name == "times.npy":
                header = io.BytesIO()
                np.lib.format.write_array_header_1_0(
                    header, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)}
                )
                data = header.getvalue()  # noqa: PLW2901
            new.writestr(name, data)
    return buffer.getvalue()


@pytest.mark.parametrize(
    "kind",
    [
        "cut",
        "text",
        "missing",
        "version",
        "objects",
        "index",
        "length",
        "negative",
        "nan",
        "huge",
        "absent",
        "order",
        "empty",
        "speed",
        "seed",
    ],
)
def test_a_damaged_recording_gets_one_clear_error(world: LocalWorld, tmp_path: Path, kind: str) -> None:
    world.reset(1)
    world.step({})
    world.step({})
    world.close()
    path = tmp_path / "bad.npz"
    if kind != "absent":
        path.write_bytes(damaged((tmp_path / "rec_ep1.npz").read_bytes(), kind))
    with pytest.raises(RecordingError, match=r"bad\.npz"):
        list(read_recording(path))


def test_nothing_recorded_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="nothing"):
        Recorder().write(tmp_path / "none.npz")
