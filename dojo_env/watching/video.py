"""A video of what was shown, written whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any

import cv2

from dojo_env.errors import ConfigError
from dojo_env.sensors.h264 import find_av
from dojo_env.watching.views import Image
from dojo_maps.errors import ToolMissingError, WriteError
from dojo_maps.input_files import is_there
from dojo_maps.progress import quiet_output, say
from dojo_maps.whole_file import replaced

# What could not be written is told once, by us.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
FRAME_RATE = 10.0
"""Frames per second, each of them a simulated second."""
_CODECS = {".mp4": "vp09", ".webm": "VP80"}
"""What OpenCV writes: VP9 and VP8, which browsers play. PyAV writes H.264 in a tenth of VP9's time."""
_QUALITY = {"preset": "veryfast", "crf": "23"}


@contextmanager
def open_video(path: Path | str, *, frame_rate: float = FRAME_RATE) -> Iterator["Video"]:
    """Give a video to add pictures to; the file is there when the context is left, or after an error none.

    Args:
        path: the file; its suffix says which kind, `.mp4` or `.webm`.
        frame_rate: frames per second.

    Yields:
        The video; it is finished when the context is left.

    Raises:
        ConfigError: another suffix, or the path is a folder or a device.
        ToolMissingError: the installed OpenCV cannot write this kind.
        UsageError: the path lies in no folder.
        WriteError: the folder cannot be written, or has no room for all pictures.
    """
    path = Path(path)
    if path.suffix.lower() not in _CODECS:
        raise ConfigError(f"{path}: a video's name ends in {' or '.join(_CODECS)}")
    if is_there(path) and not path.is_file():
        raise ConfigError(f"{path}: is a folder or a device; give the video another name")
    with replaced(path) as fresh:
        video = Video(fresh, frame_rate)
        try:
            yield video
        finally:
            video.close()
        written = _count_frames(fresh)
        if not video.count or written != video.count:
            raise WriteError(f"{path}: {written} of {video.count} pictures were written; is the disk full?")


class Video:
    """Collects pictures of one size; `count` tells how many."""

    def __init__(self, path: Path, frame_rate: float = FRAME_RATE) -> None:
        """Take where to write, at how many frames per second; the file begins with the first picture."""
        self._path, self._frame_rate = path, frame_rate
        self._writer: _H264 | _OpenCV | None = None
        self.count = 0

    def add(self, picture: Image) -> None:
        """Add a picture; the first one begins the file.

        Args:
            picture: (h, w, 3) uint8 RGB, h and w even, the same for all pictures.

        Raises:
            ToolMissingError: the installed OpenCV cannot write this kind.
        """
        if self._writer is None:
            is_mp4 = self._path.suffix.lower() == ".mp4"
            av = find_av() if is_mp4 else None
            if is_mp4 and av is None:
                say(f'{self._path.name}: VP9, slowly; pip install "traffic-dojo[h264]", or name it .webm')
            height, width = picture.shape[:2]
            self._writer = (
                _OpenCV(self._path, self._frame_rate, width, height)
                if av is None
                else _H264(av, self._path, self._frame_rate, width, height)
            )
        self._writer.write(picture)
        self.count += 1

    def close(self) -> None:
        """Write what is left."""
        if self._writer is not None:
            self._writer.close()


class _H264:
    """Writes by PyAV."""

    def __init__(self, av: Any, path: Path, frame_rate: float, width: int, height: int) -> None:
        self._make = av.VideoFrame.from_ndarray
        self._file = av.open(str(path), "w", options={"movflags": "faststart"})
        rate = Fraction(frame_rate).limit_denominator(1000)
        self._stream = self._file.add_stream("libx264", rate=rate, options=_QUALITY)
        self._stream.width, self._stream.height, self._stream.pix_fmt = width, height, "yuv420p"

    def write(self, picture: Image) -> None:
        self._mux(self._make(picture, "rgb24"))

    def close(self) -> None:
        self._mux(None)
        self._file.close()

    def _mux(self, frame: Any) -> None:
        for packet in self._stream.encode(frame):
            self._file.mux(packet)


class _OpenCV:
    """Writes by OpenCV, which does not tell when it cannot."""

    def __init__(self, path: Path, frame_rate: float, width: int, height: int) -> None:
        codec = _CODECS[path.suffix.lower()]
        code = cv2.VideoWriter.fourcc(*codec)
        with quiet_output():
            self._writer = cv2.VideoWriter(str(path), code, frame_rate, (width, height))
        if not self._writer.isOpened():
            raise ToolMissingError(
                f"the installed OpenCV cannot write {path.suffix} videos ({codec}); "
                f"try another suffix of {', '.join(_CODECS)}, or pip install opencv-python-headless"
            )

    def write(self, picture: Image) -> None:
        self._writer.write(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))

    def close(self) -> None:
        self._writer.release()


def _count_frames(path: Path) -> int:
    """Count what can be played of a video, for OpenCV does not tell when it could not write."""
    if not path.is_file():
        return 0
    capture = cv2.VideoCapture(str(path))
    count = round(capture.get(cv2.CAP_PROP_FRAME_COUNT))
    capture.set(cv2.CAP_PROP_POS_FRAMES, count - 1)
    return count if capture.grab() else 0
