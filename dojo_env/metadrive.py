"""A recorded episode as a data set that MetaDrive's `ScenarioEnv` loads: the traffic on the converted map.

A recording has an instant per second and MetaDrive ten; in between, road users move straight on. What is
longer than three minutes becomes several scenarios. Trains and ships are left out, as their ways are.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_env.errors import ConfigError
from dojo_env.recording import Recording
from dojo_env.snapshot import Kind, Snapshot
from dojo_maps.bundle import Bundle
from dojo_maps.description import RoadMap
from dojo_maps.errors import ExportError
from dojo_maps.exports import file_stem
from dojo_maps.exports.metadrive import assemble_scenario, write_data_set
from dojo_maps.exports.metadrive_features import Feature, build_features
from dojo_maps.exports.metadrive_motion import LIGHTS, STEP, build_signal_states
from dojo_maps.input_files import is_there
from dojo_maps.whole_file import replaced_folder

Floats = NDArray[np.float64]

_LONGEST = 180
"""Seconds of one scenario."""
_PER_SECOND = round(1 / STEP)
_FASTEST = 70.0
"""m/s; who gets farther in a second was put elsewhere and did not drive there."""
_LEFT_OUT = (Kind.TRAIN, Kind.SHIP)
_CYCLISTS = (Kind.BICYCLE, Kind.SCOOTER, Kind.MOTORCYCLE, Kind.MOPED)
_CARS = (Kind.CAR, Kind.TAXI, Kind.HATCHBACK, Kind.SALOON, Kind.ESTATE, Kind.PICKUP)
_POSE = 9
"""Position, heading, velocity, and the three sizes, in this order."""


def export_recording(recording: Recording, bundle: Bundle, folder: Path) -> int:
    """Write the data set, whole or not at all.

    Args:
        recording: the episode.
        bundle: its map.
        folder: to make.

    Returns:
        How many scenarios there are.

    Raises:
        ConfigError: the folder is there already.
        ExportError: no vehicle was recorded.
        WriteError: the folder cannot be written.
    """
    if is_there(folder):
        raise ConfigError(f"{folder}: is there already; remove it, or choose another with -o")
    with replaced_folder(folder, parents=True) as fresh:
        count = write_data_set(fresh, _build_scenarios(recording, bundle.road_map))
        if not count:
            raise ExportError("no vehicle was recorded, and MetaDrive follows one; record a longer episode")
    return count


def _build_scenarios(recording: Recording, road_map: RoadMap) -> Iterator[tuple[str, dict[str, Any]]]:
    features = build_features(road_map)
    start = 0
    while start < len(recording) - 1:
        snapshots = list(recording[start : start + _LONGEST + 1])
        start += _LONGEST
        # The car that MetaDrive follows has to be there when a scenario begins.
        first = next((k for k, snapshot in enumerate(snapshots) if _find_cars(snapshot)), None)
        if first is not None and first < len(snapshots) - 1:
            name = f"{file_stem(road_map)}_{snapshots[first].time:.0f}"
            yield name, build_recorded_scenario(road_map, snapshots[first:], features, name=name)


def build_recorded_scenario(
    road_map: RoadMap, snapshots: list[Snapshot], features: dict[str, Feature], *, name: str
) -> dict[str, Any]:
    """Build a scenario from at least two seconds; the first has a vehicle that MetaDrive may follow.

    Args:
        road_map: the map.
        snapshots: a second apart.
        features: of the map, by id, as MetaDrive has them.
        name: of the scenario.

    Returns:
        The scenario, as MetaDrive reads it.
    """
    count = (len(snapshots) - 1) * _PER_SECOND + 1
    times = np.arange(count, dtype=np.float64) * STEP
    tracks = _build_tracks(snapshots, np.array([*road_map.origin, 0.0]))
    states = build_signal_states(road_map, features, times)
    for light in states.values():
        light["state"]["object_state"] = _recorded_lights(light["metadata"], snapshots, count)
    present = {car: int(tracks[car]["state"]["valid"].sum()) for car in _find_cars(snapshots[0])}
    ego = max(present, key=lambda car: present[car])
    return assemble_scenario(road_map, times, features, states, tracks, name=name, ego=ego)


def _find_cars(snapshot: Snapshot) -> list[str]:
    """List who may be followed: cars first, else any vehicle."""
    kinds = snapshot.kinds
    cars = [name for name, kind in zip(snapshot.ids, kinds, strict=True) if kind in _CARS]
    return cars or [
        name for name, kind in zip(snapshot.ids, kinds, strict=True) if _type(Kind(kind)) == "VEHICLE"
    ]


def _type(kind: Kind) -> str | None:
    if kind in _LEFT_OUT:
        return None
    if kind == Kind.PEDESTRIAN:
        return "PEDESTRIAN"
    return "CYCLIST" if kind in _CYCLISTS else "VEHICLE"


def _recorded_lights(metadata: dict[str, Any], snapshots: list[Snapshot], count: int) -> list[str]:
    """Give a link's light at each instant; it changes on the second."""
    signal, index = metadata["signal"], metadata["link_index"]
    letters = ["" if index is None else s.signals.get(signal, "")[index : index + 1] for s in snapshots]
    shown = [LIGHTS.get(letter, "LANE_STATE_UNKNOWN") for letter in letters]
    return [shown[k // _PER_SECOND] for k in range(count)]


def _build_tracks(snapshots: list[Snapshot], origin: Floats) -> dict[str, dict[str, Any]]:
    poses: dict[str, Floats] = {}
    kinds: dict[str, Kind] = {}
    for k, snapshot in enumerate(snapshots):
        for row, (name, kind) in enumerate(zip(snapshot.ids, snapshot.kinds.tolist(), strict=True)):
            if _type(Kind(kind)) is not None:
                kinds.setdefault(name, Kind(kind))
                pose = poses.setdefault(name, np.full((len(snapshots), _POSE), np.nan))
                pose[k] = _pose(snapshot, row, origin)
    return {name: _build_track(name, str(_type(kinds[name])), pose) for name, pose in poses.items()}


def _pose(snapshot: Snapshot, row: int, origin: Floats) -> Floats:
    """Take a road user's middle, heading, velocity and sizes; metres around the map's origin."""
    heading, slope, speed = snapshot.headings[row], snapshot.slopes[row], snapshot.speeds[row]
    ahead = np.array([np.cos(heading) * np.cos(slope), np.sin(heading) * np.cos(slope), np.sin(slope)])
    middle = snapshot.positions[row] - origin - ahead * snapshot.sizes[row, 0] / 2
    return np.array([*middle, heading, *(speed * ahead[:2]), *snapshot.sizes[row]])


def _build_track(name: str, kind: str, seconds: Floats) -> dict[str, Any]:
    """Fill in the instants between seconds; (seconds, 9), nan where the road user is not there."""
    before, after = seconds[:-1], seconds[1:]
    change = after - before
    change[:, 3] = (change[:, 3] + np.pi) % (2 * np.pi) - np.pi
    # From a second without a successor nobody moves on, and nobody drives as far as one who was put there.
    jumps = ~(np.hypot(change[:, 0], change[:, 1]) < _FASTEST)
    change[jumps] = np.nan
    shares = np.arange(_PER_SECOND)[:, None] * STEP
    between = before[:, None] + shares * change[:, None]
    between[:, 0] = before
    pose = np.concatenate([between.reshape(-1, _POSE), seconds[-1:]])
    valid = ~np.isnan(pose[:, 0])
    pose[~valid] = 0.0
    heading = (pose[:, 3] + np.pi) % (2 * np.pi) - np.pi
    state = {
        "position": pose[:, :3],
        "heading": np.where(valid, heading, 0.0),
        "velocity": pose[:, 4:6],
        "valid": valid,
        "length": pose[:, 6],
        "width": pose[:, 7],
        "height": pose[:, 8],
    }
    metadata = {"type": kind, "object_id": name, "track_length": len(pose)}
    return {"type": kind, "state": state, "metadata": metadata}
