"""A recorded episode seen again, through any cameras and lidars, in any light, without SUMO."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from dojo_env.camera import Camera
from dojo_env.config import SensingConfig
from dojo_env.errors import ConfigError, RecordingError
from dojo_env.keywords import DrawingSettings
from dojo_env.recording import Recording, read_recording
from dojo_env.scenario import PACKAGED, Scenario, open_map, packaged_scenario
from dojo_env.sensors.eyes import Eyes
from dojo_env.snapshot import Snapshot
from dojo_maps.bundle import Bundle
from dojo_maps.demand.patterns import split_pattern
from dojo_maps.wording import counted, did_you_mean

if TYPE_CHECKING:
    from dojo_env.rendering.outputs import Picture
    from dojo_env.sensors.lidar import Lidar, LidarScanner, Scan


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Replayed:
    """An instant of a recording, and what was seen of it.

    Attributes:
        snapshot: the instant.
        pictures: one per camera.
        scans: one per lidar.
    """

    snapshot: Snapshot
    pictures: "tuple[Picture, ...]"
    scans: "tuple[Scan, ...]"

    def __repr__(self) -> str:
        """Tell when it is, and how much was seen."""
        pictures, scans = counted(len(self.pictures), "picture"), counted(len(self.scans), "scan")
        return f"Replayed({self.snapshot!r}, {pictures}, {scans})"

    def _repr_png_(self) -> bytes | None:
        """Give what a notebook shows. Source: IPython's "rich display" protocol."""
        from dojo_env.rendering.display import colour_outputs, encode_images  # noqa: PLC0415 - loads OpenCV

        images = [image for picture in self.pictures for image in colour_outputs(picture.outputs)]
        return encode_images(images) if images else None


def replay(
    recording: Recording | str | Path,
    cameras: Sequence[Camera] | None = None,
    *,
    lidars: "Sequence[Lidar]" = (),
    outputs: Sequence[str] = ("rgb",),
    every: int = 1,
    map: str | Path | None = None,  # noqa: A002 - as in `Scenario`
    **sensing: Unpack[DrawingSettings],
) -> Iterator[Replayed]:
    """Look at a recorded episode again; under the episode's own conditions, pictures have its own bytes.

    Args:
        recording: the episode, or its file.
        cameras: what looks; None takes all that are placed for the recording's first signal.
        lidars: what scans.
        outputs: of the cameras: `rgb`, `depth`, `semantic`, `instance`, `boxes`.
        every: seconds from one instant to the next.
        map: the episode's map; see `find_map`.
        sensing: as an environment takes them: `conditions`, `width`, `height`, `renderer` and so on.

    Yields:
        Each instant, and what was seen of it.

    Raises:
        RecordingError: the map is not the one of the recording, or cannot be found.
        ConfigError: a setting cannot work.
    """
    if every < 1:
        raise ConfigError(f"every={every}: expected a number of seconds above 0")
    for name, given in (("cameras", cameras), ("lidars", lidars), ("outputs", outputs)):
        if given is not None and (isinstance(given, str) or not isinstance(given, Sequence)):
            raise ConfigError(f"{name}={given!r}: expected a list; write {name}=[...]")
    if not isinstance(recording, Recording):
        recording = read_recording(recording)
    eyes = open_eyes(recording, find_map(recording, map), **sensing)
    try:
        scanner = _open_scanner(eyes) if lidars else None
        if cameras is None and not recording.signals:
            raise RecordingError(recording.path, "has no signals to look at; give cameras")
        chosen = eyes.cameras(recording.signals[0]) if cameras is None else tuple(cameras)
        for number in range(0, len(recording), every):
            snapshot = recording[number]
            yield Replayed(
                snapshot=snapshot,
                pictures=eyes.look(snapshot, chosen, outputs) if chosen else (),
                scans=scanner.scan(snapshot, lidars) if scanner else (),
            )
    finally:
        eyes.close()


def _open_scanner(eyes: Eyes) -> "LidarScanner":
    from dojo_env.sensors.lidar import LidarScanner  # noqa: PLC0415 - loads a compiler

    return LidarScanner(eyes.scene, seed=eyes.conditions.seed)


def open_eyes(recording: Recording, bundle: Bundle, **sensing: Any) -> Eyes:
    """Open what draws a recording, with everything random as in its episode.

    Args:
        recording: the episode.
        bundle: its map.
        sensing: as an environment takes it.

    Returns:
        What draws; `close` it.

    Raises:
        ConfigError: a setting cannot work.
    """
    known = [each.name for each in fields(SensingConfig)]
    if unknown := [name for name in sensing if name not in known]:
        raise ConfigError(f"there is no setting {unknown[0]!r} of sight{did_you_mean(unknown[0], known)}")
    config = SensingConfig(**sensing)
    eyes = Eyes(bundle, config)
    eyes.reset(recording.seed)
    return eyes


def find_map(recording: Recording, map: str | Path | None = None) -> Bundle:  # noqa: A002 - as in `Scenario`
    """Open the map of a recording.

    Args:
        recording: the episode.
        map: a bundle, a network, or a packaged scenario's name; None for the scenario that was recorded.

    Returns:
        The map.

    Raises:
        RecordingError: it is another map, or none is given and the scenario is not a packaged one.
    """
    name = recording.scenario if map is None else str(map)
    packaged, _ = split_pattern(name)
    if packaged in PACKAGED:
        scenario = packaged_scenario(packaged)
    elif map is None:
        raise RecordingError(
            recording.path, f"is of scenario {name!r}, which is not packaged; give the map it was made on"
        )
    else:
        scenario = Scenario(map=Path(map))
    bundle = open_map(scenario)
    found = bundle.road_map.source.sha256
    if found != recording.map_sha256:
        raise RecordingError(
            recording.path, f"was made on another map than {name} (source {found[:12]}, "
            f"recorded on {recording.map_sha256[:12]}); give the map it was made on"
        )  # fmt: skip
    return bundle
