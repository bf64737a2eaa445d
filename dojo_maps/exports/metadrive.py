"""MetaDrive's scenario format: a data set of scenarios that `ScenarioEnv` loads.

Positions are metres, x east and y north, around the map's origin, which the metadata keep as `map_origin`:
map = position + map_origin. MetaDrive moves a scenario so that its ego car starts at (0, 0) when it loads it,
and keeps that shift in `old_origin_in_current_coordinate`. It drives on flat ground: heights are kept in
lines, not in polygons.
"""

import io
import pickle
import sys
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from dojo_maps.description import VERSION, RoadMap
from dojo_maps.exports import file_stem
from dojo_maps.exports.metadrive_features import Feature, build_features
from dojo_maps.exports.metadrive_motion import EGO, STEP, build_ego_track, build_signal_states, choose_times
from dojo_maps.geometry.polylines import Floats

_DATASET = "dojo-map"


def write_metadrive(road_map: RoadMap, folder: Path) -> None:
    """Write the scenario, the data set's summary and its mapping.

    Args:
        road_map: what to write; its signals run their own programs.
        folder: exists, and is empty.

    Raises:
        ExportError: the map has no lane for cars.
        OSError: a file cannot be written.
    """
    write_data_set(folder, [(file_stem(road_map), build_scenario(road_map))])


def write_data_set(folder: Path, scenarios: Iterable[tuple[str, dict[str, Any]]]) -> int:
    """Write named scenarios one by one, and the data set's summary and mapping.

    Args:
        folder: exists, and is empty.
        scenarios: names that are safe as a file's, and what `build_scenario` and the like make.

    Returns:
        How many scenarios there are.

    Raises:
        OSError: a file cannot be written.
    """
    summaries: dict[str, Any] = {}
    for stem, scenario in scenarios:
        name = f"sd_{_DATASET}_v{VERSION}_{stem}.pkl"
        _write_pickle(folder / name, scenario)
        summaries[name] = _without_arrays(scenario["metadata"])
    _write_pickle(folder / "dataset_summary.pkl", summaries)
    _write_pickle(folder / "dataset_mapping.pkl", dict.fromkeys(summaries, ""))
    return len(summaries)


def build_scenario(road_map: RoadMap) -> dict[str, Any]:
    """Build a scenario of plain values and arrays, as MetaDrive's `ScenarioDescription` has it.

    Args:
        road_map: its signals run their own programs, and one car shows the way.

    Returns:
        The scenario; positions in metres around the map's origin.

    Raises:
        ExportError: the map has no lane for cars.
    """
    times = choose_times(road_map)
    features = build_features(road_map)
    states = build_signal_states(road_map, features, times)
    tracks = {EGO: build_ego_track(features, times)}
    return assemble_scenario(road_map, times, features, states, tracks, name=road_map.name, ego=EGO)


def assemble_scenario(
    road_map: RoadMap,
    times: Floats,
    features: dict[str, Feature],
    states: dict[str, Any],
    tracks: dict[str, Any],
    *,
    name: str,
    ego: str,
) -> dict[str, Any]:
    """Put together what a scenario consists of, with its summaries.

    Args:
        road_map: where the scenario takes place.
        times: (n,) the scenario's instants, seconds, `STEP` apart.
        features: of the map by id, as `build_features` makes them.
        states: the signals' lights, as `build_signal_states` makes them.
        tracks: who moves, by id; each has a state at every instant.
        name: the scenario's id.
        ego: id of the track that is followed.

    Returns:
        The scenario, which holds the arguments themselves and no copies.
    """
    summaries = {key: _summarize_track(key, track) for key, track in tracks.items()}
    metadata = {
        "metadrive_processed": False,
        "coordinate": "metadrive",
        "ts": times,
        "sample_rate": STEP,
        "dataset": _DATASET,
        "scenario_id": name,
        "source_file": road_map.source.file,
        "sdc_id": ego,
        "map_origin": list(road_map.origin),
        "left_hand": road_map.left_hand,
        "track_length": len(times),
        "object_summary": summaries,
        "number_summary": _count(summaries, states, features),
    }
    return {
        "id": name,
        "version": f"{_DATASET} v{VERSION}",
        "length": len(times),
        "metadata": metadata,
        "tracks": tracks,
        "dynamic_map_states": states,
        "map_features": features,
    }


def _summarize_track(name: str, track: dict[str, Any]) -> dict[str, Any]:
    valid = track["state"]["valid"]
    position = track["state"]["position"][valid]
    # The first row of instants without a gap.
    ends = np.flatnonzero(~valid & np.roll(valid, 1))
    first = int(valid.argmax())
    end = next((int(k) for k in ends if k > first), len(valid))
    return {
        "type": track["type"],
        "object_id": name,
        "track_length": len(valid),
        "moving_distance": float(np.hypot(*np.diff(position[:, :2], axis=0).T).sum()),
        "valid_length": len(position),
        "continuous_valid_length": end - first,
    }


def _count(
    summaries: dict[str, dict[str, Any]], states: dict[str, Any], features: dict[str, Feature]
) -> dict[str, Any]:
    """Count what MetaDrive's tools filter data sets by."""
    types = Counter(summary["type"] for summary in summaries.values())
    moving = Counter(summary["type"] for summary in summaries.values() if summary["moving_distance"] > 1)
    lights = Counter(light for state in states.values() for light in state["state"]["object_state"])
    heights = [f["polyline"][:, 2] for f in features.values() if f["type"].startswith("ROAD_LINE")]
    return {
        "num_objects": types.total(),
        "object_types": sorted(types),
        "num_objects_each_type": dict(types),
        "num_moving_objects": moving.total(),
        "num_moving_objects_each_type": dict(moving),
        "num_traffic_lights": len(states),
        "num_traffic_light_types": sorted(lights),
        "num_traffic_light_each_step": dict(sorted(lights.items())),
        "num_map_features": len(features),
        "map_height_diff": float(np.ptp(np.concatenate(heights))) if heights else 0.0,
    }


def _without_arrays(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return {key: _without_arrays(item) for key, item in value.items()}
    return value


class _Pickler(pickle.Pickler):
    """Writes arrays as calls of `numpy.array` on plain lists, which every version of numpy reads."""

    def reducer_override(self, value: Any) -> Any:
        """Replace numpy's own way, which names modules that moved between its versions 1 and 2."""
        if isinstance(value, np.ndarray):
            return np.array, (value.tolist(), sys.intern(value.dtype.str))
        return NotImplemented


def _write_pickle(path: Path, value: Any) -> None:
    buffer = io.BytesIO()
    # Protocol 4 is read by every Python that MetaDrive runs on.
    _Pickler(buffer, protocol=4).dump(_canonical(value))
    path.write_bytes(buffer.getvalue())


def _canonical(value: Any) -> Any:
    """Copy plain values so that equal strings are one object, as pickle writes an object only once."""
    if isinstance(value, str):
        return sys.intern(value)
    if isinstance(value, dict):
        return {_canonical(key): _canonical(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_canonical(item) for item in value]
    return value
