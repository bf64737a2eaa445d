"""A recording as the map's 3D page plays it: road users look as the cameras draw them.

`dojo-maps view --recording` finds `read_playback` here by its name, because maps know nothing of the
environment.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dojo_env.errors import RecordingError
from dojo_env.recording import Recording, read_recording
from dojo_env.snapshot import Lights
from dojo_maps.description import RoadMap
from dojo_maps.viewer import Model, Playback

if TYPE_CHECKING:
    from dojo_env.rendering.fleet import Library

_NEAR, _FAR = 1, 2
"""Levels of detail that the page has."""


def read_playback(path: Path, road_map: RoadMap) -> Playback:
    """Read a recording to be played on a map.

    Args:
        path: a file that `dojo-env run --record` wrote.
        road_map: the map of its episode.

    Returns:
        What a page plays.

    Raises:
        RecordingError: the file is missing, damaged, or of another map.
    """
    recording = read_recording(path)
    if recording.map_sha256 != road_map.source.sha256:
        raise RecordingError(
            path, f"was made on another map than {road_map.name} (source {road_map.source.sha256[:12]}, "
            f"recorded on {recording.map_sha256[:12]}); give the map it was made on"
        )  # fmt: skip
    return make_playback(recording, road_map)


def make_playback(recording: Recording, road_map: RoadMap) -> Playback:
    """Give every road user of a recording the model, the pose and the colours that cameras would see.

    Args:
        recording: the episode.
        road_map: its map.

    Returns:
        What a page plays.
    """
    from dojo_env.rendering.drawing import OWN, PALETTE  # noqa: PLC0415 - compiles
    from dojo_env.rendering.fleet import usual_fleet  # noqa: PLC0415
    from dojo_env.rendering.traffic import place_users  # noqa: PLC0415
    from dojo_env.rendering.ways import lay_ways  # noqa: PLC0415

    origin, ways = np.array([*road_map.origin, 0.0]), lay_ways(road_map)
    numbers: dict[str, int] = {}
    sizes: dict[int, NDArray[np.float64]] = {}
    colours: dict[int, NDArray[np.float64]] = {}
    rows: list[NDArray[np.float64]] = []
    counts: list[int] = []
    for snapshot in recording:
        placed = place_users(snapshot, origin, ways=ways)
        users = [numbers.setdefault(name, len(numbers)) for name in snapshot.ids]
        axes = np.linalg.norm(placed.frames, axis=1)
        sizes |= dict(zip(users, axes, strict=True))
        colours |= dict(zip(users, placed.colours, strict=True))
        counts.append(len(users))
        rows.append(
            np.column_stack(
                [users, placed.places, snapshot.headings, snapshot.slopes, placed.models, snapshot.lights]
            )
        )
    every = np.concatenate([np.empty((0, 8)), *rows])
    used, poses = np.unique(every[:, 6].astype(np.int32), return_inverse=True)
    library = usual_fleet().library
    states = list(dict.fromkeys(state for snapshot in recording for state in snapshot.signals.values()))
    number = {state: k for k, state in enumerate(states)}
    return Playback(
        times=recording.times,
        counts=np.array(counts, np.int32),
        users=every[:, 0].astype(np.int32),
        places=every[:, 1:4],
        headings=every[:, 4],
        slopes=every[:, 5],
        poses=poses.astype(np.int32),
        lights=every[:, 7].astype(np.uint8),
        ids=list(numbers),
        sizes=np.array([sizes[k] for k in range(len(numbers))]).reshape(-1, 3),
        colours=_to_srgb(np.array([colours[k] for k in range(len(numbers))]).reshape(-1, 5, 3)),
        models=[(_model(library, k, _NEAR), _model(library, k, _FAR)) for k in used.tolist()],
        palette=_to_srgb(PALETTE),
        own=OWN.astype(np.int8),
        lit=_lamps(),
        signals=recording.signals,
        states=states,
        shown=np.array(
            [[number[snapshot.signals[name]] for name in recording.signals] for snapshot in recording],
            np.int32,
        ).reshape(len(recording), -1),
    )


def _model(library: "Library", number: int, detail: int) -> Model:
    first, last, begin, end = library.spans[number, detail].tolist()
    return Model(
        vertices=library.vertices[first:last],
        faces=library.faces[begin:end],
        parts=library.parts[begin:end].astype(np.uint8),
    )


def _lamps() -> NDArray[np.uint8]:
    """Tell by part which of a road user's lights makes it shine."""
    from dojo_env.rendering.shapes import Part  # noqa: PLC0415 - only whoever draws needs it

    lamps = {
        Part.BRAKE: Lights.BRAKE,
        Part.LEFT: Lights.LEFT,
        Part.RIGHT: Lights.RIGHT,
        Part.BLUE: Lights.BLUE,
    }
    return np.array([lamps.get(part, 0) for part in Part], np.uint8)


def _to_srgb(linear: NDArray[np.float64]) -> NDArray[np.uint8]:
    from dojo_env.rendering.lighting import SRGB  # noqa: PLC0415 - only whoever draws needs it

    found: NDArray[np.uint8] = SRGB[np.rint(np.clip(linear, 0, 1) * (len(SRGB) - 1)).astype(int)]
    return found
