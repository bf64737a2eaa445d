"""A film from frame to frame: what its lanes have, and what a controller would do."""

from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from math import isnan
from typing import Any

from dojo_env.detectors.base import DetectorModel
from dojo_env.detectors.measuring import shift
from dojo_env.errors import ConfigError
from dojo_env.films.advice import Advice, Advisor
from dojo_env.films.measuring import Measured
from dojo_env.films.places import Place
from dojo_env.films.source import Frame
from dojo_maps.interruption import heed


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Look:
    """What one frame tells.

    Attributes:
        frame: the picture.
        measured: its lanes, and who is in it.
        advice: of each signal; none without a controller.
    """

    frame: Frame
    measured: Measured
    advice: tuple[Advice, ...]

    def to_json(self) -> dict[str, Any]:
        """Say it in plain values."""
        return {
            "time": round(self.frame.time, 3),
            "frame": self.frame.name,
            "lanes": {
                lane: {
                    "vehicles": vehicles,
                    "halting": halting,
                    "speed": None if isnan(speed) else round(speed, 2),
                }
                for lane, vehicles, halting, speed in self.measured.rows()
            },
            "signals": {
                each.signal: {
                    **{name: value for name, value in asdict(each).items() if name != "signal"},
                    "why": each.describe(),
                }
                for each in self.advice
            },
        }


def watch_film(
    frames: Iterable[Frame],
    detector: DetectorModel,
    place: Place,
    advisor: Advisor | None = None,
) -> Iterator[Look]:
    """Look at a film.

    Args:
        frames: pictures of one size.
        detector: finds road users.
        place: that they show.
        advisor: None only measures.

    Yields:
        What each frame tells, in their order.

    Raises:
        ConfigError: the frames are not all of one size, or not as the place is known.
    """
    size, measurer = None, None
    for frame in frames:
        heed()
        height, width = frame.picture.shape[:2]
        if measurer is None:
            size, measurer = (width, height), place.measure(width, height)
        if size != (width, height):
            raise ConfigError(f"frame {frame.name}: {width} x {height} pixels, the first has {size}")
        left, top, right, bottom = measurer.part or (0, 0, width, height)
        found = shift(detector.detect(frame.picture[top:bottom, left:right]), left, top)
        measured = measurer.update(frame.time, found)
        advice = advisor.advise(measured.lanes) if advisor is not None else ()
        yield Look(frame=frame, measured=measured, advice=advice)
