"""Where pictures come from: a film, a folder of photographs, or a live stream."""

import os
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dojo_env.errors import FilmError
from dojo_env.notes import say_once
from dojo_env.photographs import read_photograph
from dojo_maps.input_files import opened
from dojo_maps.progress import quiet_output
from dojo_maps.wording import counted

Image = NDArray[np.uint8]

STREAMS = ("rtsp://", "rtsps://", "http://", "https://")
_PHOTOGRAPHS = (".jpg", ".jpeg", ".png")
_MAX_BYTES = 1 << 40
_LARGEST_SIDE = 8192
_USUAL_RATE = 25.0
_FASTEST = 1000.0
"""Frames a second that a film may claim."""


_TIMEOUT_MS = 10_000
"""That a stream may take to open, or to give a frame."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frame:
    """A picture and when it was taken.

    Attributes:
        time: seconds from the begin.
        name: number of the frame in the film, or name of the photograph.
        picture: (h, w, 3) uint8 RGB.
    """

    time: float
    name: str
    picture: Image


def read_frames(source: str, *, every: float = 1.0, rate: float | None = None) -> Iterator[Frame]:
    """Give a frame for each look.

    A stream is read until it ends, or breaks off.

    Args:
        source: a film (MP4, MOV, MKV, WebM, AVI, MPEG-TS), a folder of JPEG or PNG pictures, in the order of
            their names, or the address of a stream (rtsp, http).
        every: seconds from look to look.
        rate: pictures a second of a folder (default 1), or of a film that tells none or a wrong one.

    Returns:
        The frames in the order of time, read one by one; what cannot be read is told as they are asked for.

    Raises:
        FilmError: there is none, it is of no known kind, it cannot be read, or a stream gives no picture.
        PhotographError: a picture of the folder cannot be read.
    """
    if source.startswith(STREAMS):
        return _read_stream(source, every)
    path = Path(source)
    return _read_folder(path, every, rate or 1.0) if path.is_dir() else _read_film(path, every, rate)


def _read_folder(folder: Path, every: float, rate: float) -> Iterator[Frame]:
    names = sorted(each for each in folder.iterdir() if each.suffix.lower() in _PHOTOGRAPHS)
    if not names:
        raise FilmError(folder, "holds no JPEG or PNG pictures")
    due = 0.0
    for number, path in enumerate(names):
        if number / rate >= due - 0.5 / rate:
            yield Frame(time=number / rate, name=path.name, picture=read_photograph(path))
            due += max(every, 1.0 / rate)


def _read_film(path: Path, every: float, rate: float | None) -> Iterator[Frame]:
    with opened(path, most=_MAX_BYTES, error=FilmError) as file:
        if not _is_film(file.read(400)):
            raise FilmError(path, "no film of a kind that is read: MP4, MOV, MKV, WebM, AVI or MPEG-TS")
    with closing(_Capture(str(path.absolute()), "file")) as capture:
        claimed = capture.rate
        rate = rate or (claimed if 0.0 < claimed <= _FASTEST else _USUAL_RATE)
        number, due = 0, 0.0
        while capture.skip():
            if number / rate >= due - 0.5 / rate:
                picture = capture.take()
                if picture is None:
                    break
                yield Frame(time=number / rate, name=str(number), picture=picture)
                due += max(every, 1.0 / rate)
            number += 1
        if not number:
            raise FilmError(path, "holds no picture that can be read; copy it again, or convert it to MP4")


def _read_stream(address: str, every: float) -> Iterator[Frame]:
    """Look at what is there when the time has come; what came meanwhile is left out."""
    with closing(_Capture(address, "rtsp,rtp,udp,tcp,tls,http,https,crypto")) as capture:
        begun, due, number = time.monotonic(), 0.0, 0
        while capture.skip():
            number += 1
            now = time.monotonic() - begun
            if now >= due:
                picture = capture.take()
                if picture is None:
                    break
                yield Frame(time=now, name=str(number), picture=picture)
                due = max(due + every, now)
        if not number:
            raise FilmError(_without_password(address), "gives no picture")
        say_once(f"{_without_password(address)}: the stream has ended after {counted(number, 'frame')}")


class _Capture:
    """OpenCV's reader, with FFmpeg alone behind it, which may open nothing but what it is told to."""

    def __init__(self, source: str, protocols: str) -> None:
        before = os.environ.get("OPENCV_FFMPEG_CAPTURE_OPTIONS")
        os.environ["OPENCV_FFMPEG_CAPTURE_OPTIONS"] = f"protocol_whitelist;{protocols}"
        limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, _TIMEOUT_MS, cv2.CAP_PROP_READ_TIMEOUT_MSEC, _TIMEOUT_MS]
        try:
            with quiet_output():
                self._capture: Any = cv2.VideoCapture(source, cv2.CAP_FFMPEG, limits)
        finally:
            if before is None:
                del os.environ["OPENCV_FFMPEG_CAPTURE_OPTIONS"]
            else:
                os.environ["OPENCV_FFMPEG_CAPTURE_OPTIONS"] = before
        if not self._capture.isOpened():
            raise FilmError(_without_password(source), "cannot be opened as a film")
        sides = [self._capture.get(each) for each in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)]
        if max(sides) > _LARGEST_SIDE:
            raise FilmError(source, f"{sides[0]:.0f} x {sides[1]:.0f} pixels; at most {_LARGEST_SIDE} a side")
        self.rate = float(self._capture.get(cv2.CAP_PROP_FPS))

    def skip(self) -> bool:
        """Go to the next frame; tell whether there is one."""
        return bool(self._capture.grab())

    def take(self) -> Image | None:
        """Decode the present frame; None where it is broken."""
        found, picture = self._capture.retrieve()
        return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), np.uint8) if found else None

    def close(self) -> None:
        """Let go of it."""
        self._capture.release()


def _is_film(start: bytes) -> bool:
    """Tell films from playlists and other texts, by which FFmpeg would open what they name."""
    return (
        start[4:8] in (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip")
        or start.startswith(b"\x1a\x45\xdf\xa3")
        or (start.startswith(b"RIFF") and start[8:12] == b"AVI ")
        or (start[:1] == b"\x47" and start[188:189] == b"\x47")
    )


def _without_password(address: str) -> str:
    scheme, separator, rest = address.partition("://")
    return f"{scheme}://{rest.rpartition('@')[2]}" if separator else address
