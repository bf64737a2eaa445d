"""H.264 as a camera's stream has it, by PyAV, which brings x264 (GPL); needed only where it is asked for."""

from fractions import Fraction
from math import log2
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dojo_maps.errors import ToolMissingError

Picture = NDArray[np.uint8]

_KEY_FRAME_S = 0.3
"""Seconds of a stream whose bits one key frame takes: with 25 frames a second and a key frame every two
seconds, about seven times what a frame between them takes."""
_USUAL, _FINEST, _COARSEST = 30, 1, 51
"""Quantisers of H.264."""
_HALVES = 6
"""By how much the quantiser grows until its step has doubled. Source: ITU-T H.264, section 8.5."""
_OPTIONS = {"preset": "veryfast", "tune": "zerolatency"}
_X264 = "keyint=1:threads=1:cpu-independent=1"


class Stream:
    """Compresses the pictures of one camera as key frames of a stream.

    Pictures here are often seconds apart, so none is predicted from another one: each gets the finest
    quantiser with which it is no larger than a key frame of the stream may be. The search for that begins
    with the last picture's.
    """

    def __init__(self, kbps: float) -> None:
        """Take the bit rate, kbit/s.

        Raises:
            ToolMissingError: PyAV is not installed, or has no x264.
        """
        self._most = 1000 * kbps / 8 * _KEY_FRAME_S
        self._quantiser = _USUAL
        self._av = _load()

    def compress(self, rgb: Picture) -> Picture:
        """Compress a picture, and unpack it again.

        Args:
            rgb: (h, w, 3).

        Returns:
            (h, w, 3), a new picture.
        """
        height, width = rgb.shape[:2]
        even = cv2.copyMakeBorder(rgb, 0, height % 2, 0, width % 2, cv2.BORDER_REPLICATE)
        planes = cv2.cvtColor(even, cv2.COLOR_RGB2YUV_I420)
        frame = self._av.VideoFrame.from_ndarray(planes, format="yuv420p")
        decoder = self._av.CodecContext.create("h264", "r")
        decoder.thread_count = 1
        shown = decoder.decode(self._fit(frame)) + decoder.decode(None)
        unpacked = cv2.cvtColor(shown[0].to_ndarray(), cv2.COLOR_YUV2RGB_I420)
        return np.ascontiguousarray(unpacked[:height, :width], dtype=np.uint8)

    def _fit(self, frame: Any) -> Any:
        """Find the finest quantiser that fits; gives the packet."""
        packet = self._encode(frame, self._quantiser)
        step = round(_HALVES * log2(packet.size / self._most))
        quantiser = min(_COARSEST, max(_FINEST, self._quantiser + step))
        if quantiser != self._quantiser:
            packet = self._encode(frame, quantiser)
        while packet.size > self._most and quantiser < _COARSEST:
            quantiser += 1
            packet = self._encode(frame, quantiser)
        while quantiser > _FINEST:
            finer = self._encode(frame, quantiser - 1)
            if finer.size > self._most:
                break
            quantiser, packet = quantiser - 1, finer
        self._quantiser = quantiser
        return packet

    def _encode(self, frame: Any, quantiser: int) -> Any:
        coder = self._av.CodecContext.create("libx264", "w")
        coder.width, coder.height, coder.pix_fmt = frame.width, frame.height, "yuv420p"
        coder.time_base, coder.thread_count = Fraction(1, 25), 1
        coder.options = {**_OPTIONS, "qp": str(quantiser), "x264-params": _X264}
        return (coder.encode(frame) + coder.encode(None))[0]


def find_av() -> Any:
    """Find PyAV with x264; None where there is none."""
    try:
        import av  # noqa: PLC0415 - an extra
    except ImportError:
        return None
    return av if "libx264" in av.codecs_available else None


def _load() -> Any:
    if (av := find_av()) is None:
        raise ToolMissingError('h264_kbps needs PyAV with x264: pip install "traffic-dojo[h264]"')
    return av
