"""How traffic cameras usually hang, by name."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from dojo_env.errors import ConfigError


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraPreset:
    """How the cameras of a signal's approaches hang: each looks back at its own.

    Attributes:
        what: it stands for, for people.
        height: metres above the stop line.
        pitch_deg: above the horizon.
        field_of_view_deg: horizontal, as `Camera` has it.
        ahead: metres beyond the stop line, as traffic drives.
        reach: metres before the stop line to which it is to see the lanes.
        beside: metres from the kerb, away from the road; None hangs it above the middle of the lanes.
        distortion: of the lens, as `Camera` has it.
    """

    what: str
    height: float
    pitch_deg: float
    field_of_view_deg: float
    ahead: float
    reach: float = 40.0
    beside: float | None = None
    distortion: tuple[float, ...] = ()


PAPER, LONG_VIEW = "paper", "long_view"

_PAPER = CameraPreset(
    what="over the junction, steeply down", height=10.0, pitch_deg=-35.0, field_of_view_deg=75.0, ahead=8.0
)

CAMERA_PRESETS: Mapping[str, CameraPreset] = {
    PAPER: _PAPER,
    LONG_VIEW: replace(
        _PAPER,
        what="over the junction, less steeply, so that 100 m of the lanes are in the picture",
        pitch_deg=-32.0,
    ),
    "usual": CameraPreset(
        what="across the junction, on its far side",
        height=9.0,
        pitch_deg=-15.0,
        field_of_view_deg=60.0,
        ahead=25.0,
        reach=60.0,
    ),
    "mast_arm": CameraPreset(
        what="on a signal's mast arm", height=6.0, pitch_deg=-15.0, field_of_view_deg=60.0, ahead=15.0
    ),
    "low_pole": CameraPreset(
        what="on a post beside the lanes",
        height=3.0,
        pitch_deg=-6.0,
        field_of_view_deg=60.0,
        ahead=10.0,
        beside=1.5,
    ),
    "street_lamp": CameraPreset(
        what="on a lamp post beside the lanes",
        height=8.0,
        pitch_deg=-25.0,
        field_of_view_deg=70.0,
        ahead=12.0,
        beside=1.5,
    ),
    "roof": CameraPreset(
        what="on a corner house",
        height=18.0,
        pitch_deg=-45.0,
        field_of_view_deg=75.0,
        ahead=8.0,
        beside=6.0,
    ),
    "tele": CameraPreset(
        what="from afar, through a long lens",
        height=12.0,
        pitch_deg=-10.0,
        field_of_view_deg=30.0,
        ahead=40.0,
        reach=80.0,
    ),
    # The nominal field of view is 98 degrees; the barrel distortion makes it 110.
    "wide": CameraPreset(
        what="a wide lens that bends, close to the stop line",
        height=8.0,
        pitch_deg=-30.0,
        field_of_view_deg=98.0,
        ahead=4.0,
        distortion=(-0.12, 0.012, 0.0, 0.0),
    ),
}
"""Mounts of real traffic cameras: 3 to 18 m high, 5 to 45 degrees down, 30 to 110 degrees wide."""


def find_preset(name: str) -> CameraPreset:
    """Look a preset up.

    Args:
        name: one of `CAMERA_PRESETS`.

    Returns:
        The preset.

    Raises:
        ConfigError: there is none of this name.
    """
    if name not in CAMERA_PRESETS:
        raise ConfigError(f"cameras: no preset {name!r}; choose from {', '.join(CAMERA_PRESETS)}")
    return CAMERA_PRESETS[name]
