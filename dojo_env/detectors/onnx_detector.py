"""Detectors that are ONNX files: pictures cut into tiles, through the network, boxes put together again."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_env.detectors.base import CLASS_NAMES, NOTHING, Detections, Floats, Image, find_kinds
from dojo_env.detectors.scaling import Scaling
from dojo_env.detectors.styles import DETECTOR_STYLES, Outputs, Question, guess_style
from dojo_env.detectors.suppression import suppress
from dojo_env.errors import ConfigError, DetectorError
from dojo_maps.errors import ToolMissingError

_TRIED_SIDE, _LARGEST_SIDE = 640, 4096
"""Pixels of an input: what a network that takes any is tried with, and the most that one may ask for."""
_MOST_CANDIDATES = 2000
"""Of a picture; the surest count."""
_EDGE = 2.0
"""Pixels from a tile's edge within which a box is taken to be cut by it."""
_TYPES = {"tensor(float)": np.float32, "tensor(float16)": np.float16, "tensor(uint8)": np.uint8}


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectorSettings:
    """How a network is used; None leaves it to the network itself, or to its style.

    Attributes:
        style: of its output, one of `DETECTOR_STYLES`; None guesses it from names and shapes.
        classes: names of its classes in their order, or `coco-80` or `coco-91`; None takes what the file
            says, or else COCO's by their number.
        scaling: how it wants its pictures.
        size: height and width of its input, pixels, where it takes any.
        least_score: from which on a detection counts, 0 to 1.
        most_overlap: intersection over union up to which two boxes are two road users.
        tile: side of the overlapping squares that larger pictures are cut into, pixels; 0 cuts none.
        tile_overlap: share of a tile that its neighbour shows, too.
    """

    style: str | None = None
    classes: str | tuple[str, ...] | None = None
    scaling: Scaling | None = None
    size: tuple[int, int] | None = None
    least_score: float = 0.3
    most_overlap: float = 0.5
    tile: int = 640
    tile_overlap: float = 0.25

    def __post_init__(self) -> None:
        """Refuse what cannot be.

        Raises:
            ConfigError: a value is out of its range, or no style or list of classes has that name.
        """
        possible = (
            ("style", ", ".join(DETECTOR_STYLES), self.style is None or self.style in DETECTOR_STYLES),
            (
                "classes",
                f"names, or one of {', '.join(CLASS_NAMES)}",
                not isinstance(self.classes, str) or self.classes in CLASS_NAMES,
            ),
            (
                "size",
                f"height and width, 32 to {_LARGEST_SIDE} pixels",
                self.size is None or all(32 <= side <= _LARGEST_SIDE for side in self.size),
            ),
            ("least_score", "0 to 1", 0 <= self.least_score <= 1),
            ("most_overlap", "0 to 1", 0 <= self.most_overlap <= 1),
            ("tile", "0, or 64 pixels and more", self.tile == 0 or self.tile >= 64),
            ("tile_overlap", "0 to 0.9", 0 <= self.tile_overlap <= 0.9),
        )
        for name, wanted, is_possible in possible:
            if not is_possible:
                raise ConfigError(f"detector: {name}={getattr(self, name)!r}; expected {wanted}")


class OnnxDetector:
    """A network with one input of pictures; on the processor, in one thread, so that nothing varies.

    Attributes:
        name: of the file.
        settings: as they were given.
        style: of its output, by name.
    """

    def __init__(self, path: Path, model: bytes, settings: DetectorSettings) -> None:
        """Open the network and try it on a grey picture.

        Args:
            path: where it comes from, for messages.
            model: the content of the file.
            settings: how to use it.

        Raises:
            ToolMissingError: onnxruntime is missing.
            DetectorError: the model is no network, or one of another kind.
        """
        self.name, self.settings, self._path = path.name, settings, path
        self._session = _open_session(path, model)
        self._input, self._dtype, self._is_planar, fixed = self._check_input()
        self._size = self._choose_size(fixed, _TRIED_SIDE)
        outputs = self._run(np.full((*self._size, 3), 114, np.uint8), Scaling())
        guessed = settings.style or guess_style(outputs, *self._size)
        if guessed is None:
            raise self._refusal(f"its outputs are of no known style: {_list_shapes(outputs)}")
        self.style = guessed
        self._style = DETECTOR_STYLES[guessed]
        self._scaling = settings.scaling or self._style.scaling
        count = self._style.count_classes(outputs, *self._size)
        if count is None:
            raise self._refusal(
                f"its outputs are not of style {guessed!r}, {self._style.what}: {_list_shapes(outputs)}"
            )
        self._size = self._choose_size(fixed, self._style.side)
        self._kinds = self._find_kinds(count)

    def detect(self, picture: Image) -> Detections:
        """See `DetectorModel`."""
        height, width = picture.shape[:2]
        windows = list_windows(height, width, self.settings)
        parts = [self._look(picture, window) for window in windows]
        boxes, scores, classes = (np.concatenate(column) for column in zip(*parts, strict=True))
        if not len(boxes):
            return NOTHING
        order = np.argsort(-scores, kind="stable")[:_MOST_CANDIDATES]
        if not self._style.is_suppressed or len(windows) > 1:
            order = order[suppress(boxes[order], scores[order], self.settings.most_overlap)]
        kinds = np.array([self._kinds[number] for number in classes[order].tolist()], np.uint8)
        return Detections(boxes=boxes[order], scores=scores[order], kinds=kinds)

    def _look(
        self, picture: Image, window: tuple[int, int, int, int]
    ) -> tuple[Floats, Floats, NDArray[np.intp]]:
        """Find candidates in a part of the picture, but those that its inner edges cut."""
        left, top, right, bottom = window
        image, fit = self._scaling.place(picture[top:bottom, left:right], *self._size)
        outputs = self._run(image, self._scaling)
        ask = Question(
            *self._size, np.array(sorted(self._kinds), np.intp), max(self.settings.least_score, 1e-6)
        )
        try:
            boxes, scores, classes = self._style.read(outputs, ask)
        except (ValueError, IndexError, KeyError) as error:
            raise self._refusal(f"its outputs changed: {_list_shapes(outputs)} ({error})") from error
        boxes = fit.to_picture(boxes) + np.array([left, top, left, top], np.float64)
        high, wide = picture.shape[:2]
        is_inner = np.array([left > 0, top > 0, right < wide, bottom < high])
        beyond = np.hstack([boxes[:, :2] - [left, top], [right, bottom] - boxes[:, 2:]]) < _EDGE
        boxes = np.clip(boxes, 0.0, np.array([wide, high, wide, high], np.float64))
        good = np.isfinite(boxes).all(axis=1) & (boxes[:, 2:] - boxes[:, :2] >= 1.0).all(axis=1)
        good &= ~(beyond & is_inner).any(axis=1)
        return boxes[good], scores[good], classes[good]

    def _run(self, image: Image, scaling: Scaling) -> Outputs:
        """Put an image of the input's size through the network."""
        ready = image if self._dtype == np.uint8 else scaling.normalise(image).astype(self._dtype)
        batch = np.ascontiguousarray(ready.transpose(2, 0, 1) if self._is_planar else ready)[None]
        try:
            made = self._session.run(None, {self._input: batch})
        except Exception as error:  # onnxruntime's errors have no common class of their own
            raise self._refusal(f"the network fails on a picture: {error}") from error
        names = [each.name for each in self._session.get_outputs()]
        outputs = {
            name: value.astype(np.float32) if value.dtype == np.float16 else value
            for name, value in zip(names, made, strict=True)
            if isinstance(value, np.ndarray) and value.dtype.kind in "fiu"
        }
        if not outputs:
            raise self._refusal(f"none of its outputs is an array of numbers: {', '.join(names)[:300]}")
        return outputs

    def _check_input(self) -> tuple[str, Any, bool, list[Any]]:
        """Find the input's name, type, whether its channels come first, and its height and width if fixed."""
        inputs = self._session.get_inputs()
        shape = list(inputs[0].shape) if inputs else []
        fits = len(inputs) == 1 and inputs[0].type in _TYPES and len(shape) == 4
        is_planar = fits and (shape[1] == 3 or shape[3] != 3)
        if not fits or (is_planar and isinstance(shape[1], int) and shape[1] != 3) or shape[0] in (0, *_MANY):
            found = ", ".join(f"{each.name} {each.type} {each.shape}" for each in inputs)
            raise self._refusal(
                f"expected one input of one picture, (1, 3, h, w) or (1, h, w, 3); it has {found[:300]}"
            )
        sides = shape[2:] if is_planar else shape[1:3]
        return inputs[0].name, _TYPES[inputs[0].type], is_planar, sides

    def _choose_size(self, fixed: list[Any], free: int) -> tuple[int, int]:
        """Find the input's height and width; `free` is what each is where it may be anything."""
        told = self.settings.size or (free, free)
        height, width = (
            side if isinstance(side, int) else any_ for side, any_ in zip(fixed, told, strict=True)
        )
        if not (1 <= height <= _LARGEST_SIDE and 1 <= width <= _LARGEST_SIDE):
            raise self._refusal(f"it takes pictures of {height} x {width}; at most {_LARGEST_SIDE} a side")
        return height, width

    def _find_kinds(self, count: int) -> Mapping[int, Any]:
        """Tell which classes are road users."""
        told = self.settings.classes or _read_names(self._session.get_modelmeta().custom_metadata_map)
        if not told:
            told = {80: "coco-80", 90: "coco-91", 91: "coco-91"}.get(count, ())
        names = CLASS_NAMES[told] if isinstance(told, str) else told
        kinds = {number: kind for number, kind in find_kinds(names).items() if number < count}
        if not kinds:
            raise self._refusal(
                f"none of its {count} classes is known as a road user; name them in their order: classes=..."
            )
        return kinds

    def _refusal(self, problem: str) -> DetectorError:
        return DetectorError(self._path, problem)


_MANY = range(2, 1 << 16)
"""Fixed batches of more than one picture."""


def list_windows(height: int, width: int, settings: DetectorSettings) -> list[tuple[int, int, int, int]]:
    """List the parts of a picture that are looked at.

    Args:
        height: of the picture, pixels.
        width: pixels.
        settings: the tiles.

    Returns:
        Left, top, right and bottom of each, pixels, row by row; the whole picture where it is no larger
        than a tile, or where none are cut.
    """
    side = settings.tile or max(height, width)
    step = max(1, round(side * (1 - settings.tile_overlap)))

    def list_starts(length: int) -> list[int]:
        return [*range(0, max(1, length - side), step), *([length - side] if length > side else [])]

    return [
        (x, y, min(x + side, width), min(y + side, height))
        for y, x in product(list_starts(height), list_starts(width))
    ]


def _open_session(path: Path, model: bytes) -> Any:
    try:
        import onnxruntime  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise ToolMissingError(
            f"detector {path}: onnxruntime is missing ({error}); pip install 'traffic-dojo[detectors]'"
        ) from error
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4
    # A file is all there is to a network: no weights out of others, wherever it says that they lie.
    options.add_session_config_entry("session.model_external_initializers_file_folder_path", "/dev/null/none")
    try:
        return onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's errors have no common class of their own
        raise DetectorError(path, f"onnxruntime cannot read it as a network: {error}") from error


def _read_names(metadata: Mapping[str, str]) -> tuple[str, ...]:
    """Read the classes that exports of the YOLO family note: {0: 'person', 1: 'bicycle'}."""
    pairs = re.findall(r"(\d{1,4}): *(['\"])(.{0,80}?)\2", metadata.get("names", ""))
    named = {int(number): name for number, _, name in pairs}
    return tuple(named.get(number, "") for number in range(max(named, default=-1) + 1))


def _list_shapes(outputs: Outputs) -> str:
    return ", ".join(f"{name} {value.shape}" for name, value in outputs.items())[:300] or "none"
