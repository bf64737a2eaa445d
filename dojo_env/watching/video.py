"""A video of what was shown, written whole or not at all."""

from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import cv2

from dojo_env.errors import ConfigError
from dojo_env.watching.views import Image
from dojo_maps.errors import ToolMissingError
from dojo_maps.whole_file import work_folder

FRAME_RATE = 10.0
"""Frames per second, each of them a simulated second."""
_CODECS = {".mp4": "mp4v", ".webm": "VP80"}
"""MPEG-4 for players, and VP8, which browsers play too and takes longer to write."""


class Video:
    """Collects pictures of one size; leave it as a context, and the file is there, or after an error none."""

    def __init__(self, path: Path | str) -> None:
        """Choose the file; its suffix says which kind, `.mp4` or `.webm`.

        Raises:
            ConfigError: another suffix, or the folder cannot be written to.
            ToolMissingError: the installed OpenCV cannot write this kind.
        """
        self._path = Path(path)
        self._codec = _CODECS.get(self._path.suffix.lower(), "")
        if not self._codec:
            raise ConfigError(f"{path}: a video's name ends in {' or '.join(_CODECS)}")
        if self._path.is_dir():
            raise ConfigError(f"{path}: is a folder; give the video another name")
        self._work = ExitStack()
        try:
            work = self._work.enter_context(work_folder(self._path.parent, ".video-"))
        except OSError as error:
            raise ConfigError(
                f"{path}: cannot be written ({error.strerror}); choose another folder"
            ) from error
        self._fresh = work / f"video{self._path.suffix.lower()}"
        self._writer: Any = None

    def add(self, picture: Image) -> None:
        """Add a picture: (h, w, 3) uint8 RGB, h and w even.

        Raises:
            ToolMissingError: the installed OpenCV cannot write this kind.
        """
        if self._writer is None:
            height, width = picture.shape[:2]
            code = cv2.VideoWriter.fourcc(*self._codec)
            self._writer = cv2.VideoWriter(str(self._fresh), code, FRAME_RATE, (width, height))
            if not self._writer.isOpened():
                raise ToolMissingError(
                    f"the installed OpenCV cannot write {self._path.suffix} videos ({self._codec}); "
                    f"try another suffix of {', '.join(_CODECS)}, or pip install opencv-python-headless"
                )
        self._writer.write(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))

    def __enter__(self) -> Self:
        """Begin."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Put the file in its place, or leave nothing."""
        with self._work:
            if self._writer is None:
                return
            self._writer.release()
            if kind is None:
                if not self._fresh.stat().st_size:
                    raise ToolMissingError(f"{self._path}: OpenCV wrote nothing; is the disk full?")
                self._fresh.replace(self._path)
