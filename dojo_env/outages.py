"""Cameras that fail for a while: what they deliver then, and when."""

from collections.abc import Iterable
from dataclasses import dataclass

from dojo_env.errors import ConfigError

OUTAGES = ("black", "frozen")
"""What a camera that fails delivers: darkness, or its last good picture."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraOutage:
    """A camera fails.

    Attributes:
        camera: its name, such as `approach_0`, at every signal that has one; "" for all cameras.
        begin: seconds after the episode's begin.
        end: seconds after the episode's begin.
        kind: `black`, or `frozen`.
    """

    camera: str = ""
    begin: float
    end: float = float("inf")
    kind: str = "black"

    def __post_init__(self) -> None:
        """Refuse what cannot be.

        Raises:
            ConfigError: it ends before it begins, or its kind is unknown.
        """
        if not self.begin < self.end:
            raise ConfigError(f"camera outage: begin={self.begin!r}, end={self.end!r}; expected begin < end")
        if self.kind not in OUTAGES:
            raise ConfigError(f"camera outage: kind={self.kind!r}; expected one of {', '.join(OUTAGES)}")


def find_outage(outages: Iterable[CameraOutage], camera: str, time: float) -> CameraOutage | None:
    """Find what keeps a camera from delivering at a time, in seconds after the episode's begin.

    Args:
        outages: of the episode.
        camera: its name.
        time: seconds after the episode's begin.

    Returns:
        The outage, or None where the camera delivers.
    """
    for outage in outages:
        if outage.camera in ("", camera) and outage.begin <= time < outage.end:
            return outage
    return None
