"""The styles of output that detectors have, by name: how each is told by its shapes, and how it is read.

Another style is another entry of `DETECTOR_STYLES`. A function that reads may take for granted what its
function that counts has seen.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dojo_env.detectors.base import COCO_80, COCO_91, Floats
from dojo_env.detectors.scaling import Scaling

Outputs = Mapping[str, NDArray[Any]]
"""What a network puts out for one picture, by name, in its own order."""
_STRIDES = (8, 16, 32, 64)
"""Pixels of the input from cell to cell, at each level of a feature pyramid."""
_PLUS_SIDES = 32
"""Columns in which NanoDet-Plus tells the four sides: eight each."""
_SIDES = (32, 44)
"""Columns in which NanoDet tells them: eight or eleven each."""
_WITHOUT_OBJECT = (21, 92)
"""Classes of VOC and of COCO's 91, and one for no object: DETR's."""


class Question(NamedTuple):
    """What is asked of the outputs.

    Attributes:
        height: of the input, pixels.
        width: of the input, pixels.
        wanted: numbers of the classes that count.
        least: the score from which on.
    """

    height: int
    width: int
    wanted: NDArray[np.intp]
    least: float


class Found(NamedTuple):
    """Candidates: (n, 4) left, top, right, bottom in pixels of the input; (n,) scores; (n,) class numbers."""

    boxes: Floats
    scores: Floats
    classes: NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectorStyle:
    """One style of output.

    Attributes:
        what: its outputs, for people.
        count_classes: tells how many classes outputs of this style have, from the outputs and the input's
            height and width; None where they are not of this style.
        read: finds the candidates.
        scaling: how networks of this style usually want their pictures.
        side: of the input, pixels, where a network takes any.
        is_suppressed: the network has dropped all but one box of each object itself.
    """

    what: str
    count_classes: Callable[[Outputs, int, int], int | None]
    read: Callable[[Outputs, Question], Found]
    scaling: Scaling
    side: int = 640
    is_suppressed: bool = False


def guess_style(outputs: Outputs, height: int, width: int) -> str | None:
    """Find the first style of the table that outputs can have, by their names and shapes.

    Args:
        outputs: for one picture.
        height: of the input, pixels.
        width: of the input, pixels.

    Returns:
        Its name; None where the outputs fit none.
    """
    for name, style in DETECTOR_STYLES.items():
        if style.count_classes(outputs, height, width) is not None:
            return name
    return None


def _select(boxes: Floats, scores: Floats, ask: Question) -> Found:
    """Take each row's best class of those that count, and the rows that are sure enough.

    Args:
        boxes: (n, 4).
        scores: (n, classes).
        ask: which classes, and how sure.
    """
    scores = scores[:, ask.wanted]
    best = scores.argmax(axis=1)
    value = scores[np.arange(len(scores)), best]
    rows = np.flatnonzero(value >= ask.least)
    return Found(boxes[rows].astype(np.float64), value[rows].astype(np.float64), ask.wanted[best[rows]])


def _keep(boxes: Floats, scores: Floats, classes: Floats, ask: Question) -> Found:
    """Take the rows of a class that counts that are sure enough; each has one score and one class."""
    numbers = np.rint(classes).astype(np.intp)
    rows = np.flatnonzero((scores >= ask.least) & np.isin(numbers, ask.wanted))
    return Found(boxes[rows].astype(np.float64), scores[rows].astype(np.float64), numbers[rows])


def _corners(centres: Floats) -> Floats:
    """Turn (n, 4) middles and sizes into corners."""
    half = centres[:, 2:4] / 2
    return np.hstack([centres[:, :2] - half, centres[:, :2] + half])


def _sigmoid(values: Floats) -> Floats:
    return 1 / (1 + np.exp(-values))


def _cells(height: int, width: int, levels: int) -> list[tuple[int, int, int]]:
    """List rows, columns and stride of each level of a feature pyramid."""
    return [(-(-height // stride), -(-width // stride), stride) for stride in _STRIDES[:levels]]


def _count_cells(height: int, width: int, levels: int) -> int:
    return sum(rows * columns for rows, columns, _ in _cells(height, width, levels))


def _grid(height: int, width: int, levels: int) -> tuple[Floats, Floats]:
    """Give each cell's upper left corner in cells, (n, 2) as x, y, and its stride, (n, 1)."""
    places, strides = [], []
    for rows, columns, stride in _cells(height, width, levels):
        y, x = np.mgrid[:rows, :columns]
        places.append(np.column_stack([x.ravel(), y.ravel()]))
        strides.append(np.full((rows * columns, 1), stride))
    return np.vstack(places).astype(np.float64), np.vstack(strides).astype(np.float64)


def _table(outputs: Outputs) -> NDArray[Any] | None:
    """Give the only output, where it is a table of one picture: (rows, columns)."""
    only = next(iter(outputs.values()))
    return only[0] if len(outputs) == 1 and only.ndim == 3 and only.shape[0] == 1 else None


def _only(outputs: Outputs) -> NDArray[Any]:
    return next(iter(outputs.values()))[0]


# YOLO: a row for each cell, or each cell and anchor. The newer ones put rows across.


def _count_yolo5(outputs: Outputs, height: int, width: int) -> int | None:
    table = _table(outputs)
    fits = table is not None and len(table) == 3 * _count_cells(height, width, 3) and table.shape[1] > 5
    return table.shape[1] - 5 if fits and table is not None else None


def _read_yolo5(outputs: Outputs, ask: Question) -> Found:
    rows = _only(outputs)
    return _select(_corners(rows[:, :4]), rows[:, 5:] * rows[:, 4:5], ask)


def _count_yolox(outputs: Outputs, height: int, width: int) -> int | None:
    table = _table(outputs)
    fits = table is not None and len(table) == _count_cells(height, width, 3) and table.shape[1] > 5
    return table.shape[1] - 5 if fits and table is not None else None


def _read_yolox(outputs: Outputs, ask: Question) -> Found:
    """Source: Ge et al., YOLOX, 2021: cells tell their offsets and the logarithms of their sizes."""
    rows = _only(outputs).astype(np.float64)
    places, strides = _grid(ask.height, ask.width, 3)
    boxes = np.hstack([(rows[:, :2] + places) * strides, np.exp(np.minimum(rows[:, 2:4], 20.0)) * strides])
    return _select(_corners(boxes), rows[:, 5:] * rows[:, 4:5], ask)


def _count_yolo8(outputs: Outputs, height: int, width: int) -> int | None:
    table = _table(outputs)
    fits = table is not None and len(table) > 4 and table.shape[1] == _count_cells(height, width, 3)
    return len(table) - 4 if fits and table is not None else None


def _read_yolo8(outputs: Outputs, ask: Question) -> Found:
    rows = _only(outputs).T
    return _select(_corners(rows[:, :4]), rows[:, 4:], ask)


# A row for each object, after the network's own suppression: corners, score, class.


def _count_end_to_end(outputs: Outputs, height: int, width: int) -> int | None:
    table = _table(outputs)
    return len(COCO_80) if table is not None and table.shape[1] == 6 else None


def _read_end_to_end(outputs: Outputs, ask: Question) -> Found:
    rows = _only(outputs)
    return _keep(rows[:, :4], rows[:, 4], rows[:, 5], ask)


# NanoDet: each side's distance as a distribution. Source: Li et al., Generalized Focal Loss, 2020.


def _levels(outputs: Outputs) -> list[tuple[NDArray[Any], NDArray[Any]]]:
    """Pair each level's scores with its sides, in any order; the level of most cells comes first."""
    tables = sorted(outputs.values(), key=lambda each: (-each.shape[1], each.shape[2] in _SIDES))
    return [(scores[0], sides[0]) for scores, sides in zip(tables[::2], tables[1::2], strict=True)]


def _count_nanodet(outputs: Outputs, height: int, width: int) -> int | None:
    if len(outputs) not in (6, 8) or any(each.ndim != 3 or len(each) != 1 for each in outputs.values()):
        return None
    levels = _levels(outputs)
    cells = [rows * columns for rows, columns, _ in _cells(height, width, len(levels))]
    fits = all(len(a) == len(b) == n for (a, b), n in zip(levels, cells, strict=True))
    return levels[0][0].shape[1] if fits else None


def _read_nanodet(outputs: Outputs, ask: Question) -> Found:
    levels = _levels(outputs)
    scores, sides = (np.vstack([level[k] for level in levels]).astype(np.float64) for k in (0, 1))
    # Distances count from a cell's middle, and in NanoDet-Plus, with its four levels, from its corner.
    return _read_distances(scores, sides, len(levels), 0.5 if len(levels) == 3 else 0.0, ask)


def _count_nanodet_plus(outputs: Outputs, height: int, width: int) -> int | None:
    table = _table(outputs)
    fits = table is not None and len(table) == _count_cells(height, width, 4) and table.shape[1] > _PLUS_SIDES
    return table.shape[1] - _PLUS_SIDES if fits and table is not None else None


def _read_nanodet_plus(outputs: Outputs, ask: Question) -> Found:
    rows = _only(outputs).astype(np.float64)
    return _read_distances(rows[:, :-_PLUS_SIDES], rows[:, -_PLUS_SIDES:], 4, 0.0, ask)


def _read_distances(scores: Floats, sides: Floats, levels: int, middle: float, ask: Question) -> Found:
    rows = np.flatnonzero(scores[:, ask.wanted].max(axis=1) >= ask.least)
    places, strides = (each[rows] for each in _grid(ask.height, ask.width, levels))
    weights = sides[rows].reshape(len(rows), 4, sides.shape[1] // 4)
    weights = np.exp(weights - weights.max(axis=2, keepdims=True))
    distances = weights @ np.arange(weights.shape[2]) / weights.sum(axis=2) * strides
    middles = (places + middle) * strides
    boxes = np.hstack([middles - distances[:, :2], middles + distances[:, 2:]])
    return _select(boxes, scores[rows], ask)


# CenterNet: peaks of a map. Source: Zhou, Wang, Krähenbühl, Objects as Points, 2019.


def _maps(outputs: Outputs) -> list[NDArray[Any]]:
    """Give the peaks, the sizes or sides, and perhaps the offsets, in whichever order they come.

    Sizes are two maps and sides four; offsets are two, as sizes are, and known by their names.
    """

    def rank(item: tuple[str, NDArray[Any]]) -> tuple[bool, int, bool]:
        name, count = item[0].lower(), item[1].shape[1]
        return count in (2, 4), -count, "reg" in name or "off" in name

    return [each for _, each in sorted(outputs.items(), key=rank)]


def _count_centernet(outputs: Outputs, height: int, width: int) -> int | None:
    if len(outputs) not in (2, 3) or any(each.ndim != 4 or len(each) != 1 for each in outputs.values()):
        return None
    heat, *others = _maps(outputs)
    fits = all(each.shape[1] in (2, 4) and each.shape[2:] == heat.shape[2:] for each in others)
    return heat.shape[1] if fits else None


def _read_centernet(outputs: Outputs, ask: Question) -> Found:
    import cv2  # noqa: PLC0415 - OpenCV is large; few need it

    heat, sizes, *offsets = (each[0] for each in _maps(outputs))
    heat = heat[ask.wanted].astype(np.float32)
    if heat.min() < 0 or heat.max() > 1:
        heat = _sigmoid(heat)
    peaks = np.stack([each == cv2.dilate(each, np.ones((3, 3), np.uint8)) for each in heat])
    classes, rows, columns = np.nonzero(peaks & (heat >= ask.least))
    cell = np.array([ask.width / heat.shape[2], ask.height / heat.shape[1]])
    middles = np.column_stack([columns, rows]).astype(np.float64)
    for offset in offsets:
        middles += offset[:, rows, columns].T
    middles *= cell
    told = sizes[:, rows, columns].T.astype(np.float64)
    if len(sizes) == 4:  # Distances to the sides, in pixels of the input.
        boxes = np.hstack([middles - told[:, :2], middles + told[:, 2:]])
    else:
        boxes = _corners(np.hstack([middles, told * cell]))
    return Found(boxes, heat[classes, rows, columns].astype(np.float64), ask.wanted[classes])


# DETR: queries, of which few find something. Source: Carion et al., End-to-End Object Detection with
# Transformers, 2020.


def _queries(outputs: Outputs) -> tuple[NDArray[Any], NDArray[Any]] | None:
    """Give logits and boxes, in whichever order they come."""
    tables = [each for each in outputs.values() if each.ndim == 3 and len(each) == 1]
    if len(outputs) != 2 or len(tables) != 2 or tables[0].shape[1] != tables[1].shape[1]:
        return None
    logits, boxes = tables if tables[1].shape[2] == 4 else reversed(tables)
    return (logits[0], boxes[0]) if boxes.shape[2] == 4 else None


def _count_detr(outputs: Outputs, height: int, width: int) -> int | None:
    found = _queries(outputs)
    return found[0].shape[1] - 1 if found and found[0].shape[1] in _WITHOUT_OBJECT else None


def _count_rt_detr(outputs: Outputs, height: int, width: int) -> int | None:
    found = _queries(outputs)
    return found[0].shape[1] if found else None


def _read_queries(outputs: Outputs, ask: Question, shares: Callable[[Floats], Floats]) -> Found:
    found = _queries(outputs)
    if found is None:
        raise ValueError("no logits and boxes")
    logits, boxes = (each.astype(np.float64) for each in found)
    return _select(_corners(boxes) * np.tile([ask.width, ask.height], 2), shares(logits), ask)


def _softmax_without_last(logits: Floats) -> Floats:
    shares = np.exp(logits - logits.max(axis=1, keepdims=True))
    return (shares / shares.sum(axis=1, keepdims=True))[:, :-1]


# SSD and its kin, as TensorFlow's object detection exports them; only names tell scores from classes.


def _named(outputs: Outputs) -> dict[str, NDArray[Any]]:
    """Give boxes, scores and classes by these names, as many as there are."""
    parts = ("boxes", "scores", "classes")
    return {part: value for part in parts for name, value in outputs.items() if part in name.lower()}


def _count_ssd(outputs: Outputs, height: int, width: int) -> int | None:
    named = _named(outputs)
    if len(named) < 3 or named["boxes"].ndim != 3 or named["boxes"].shape[::2] != (1, 4):
        return None
    rows = named["boxes"].shape[:2]
    return len(COCO_91) if named["scores"].shape == named["classes"].shape == rows else None


def _read_ssd(outputs: Outputs, ask: Question) -> Found:
    named = _named(outputs)
    corners = named["boxes"][0][:, [1, 0, 3, 2]] * np.tile([ask.width, ask.height], 2)
    return _keep(corners, named["scores"][0], named["classes"][0], ask)


_YOLO = Scaling(fit="centre")
_RAW = (1 / 255,) * 3
_IMAGENET = Scaling(mean=(0.485, 0.456, 0.406), deviation=(0.229, 0.224, 0.225))
_NANODET = Scaling(
    order="bgr",
    mean=(103.53 / 255, 116.28 / 255, 123.675 / 255),
    deviation=(57.375 / 255, 57.12 / 255, 58.395 / 255),
)

DETECTOR_STYLES: Mapping[str, DetectorStyle] = MappingProxyType(
    {
        "nanodet-plus": DetectorStyle(
            what="(1, cells, classes + 32), four levels",
            count_classes=_count_nanodet_plus,
            read=_read_nanodet_plus,
            scaling=_NANODET,
        ),
        "yolo5": DetectorStyle(
            what="(1, 3 * cells, 5 + classes)", count_classes=_count_yolo5, read=_read_yolo5, scaling=_YOLO
        ),
        "yolox": DetectorStyle(
            what="(1, cells, 5 + classes)",
            count_classes=_count_yolox,
            read=_read_yolox,
            scaling=Scaling(order="bgr", deviation=_RAW, fit="corner"),
        ),
        "yolo8": DetectorStyle(
            what="(1, 4 + classes, cells), also of YOLO 9, 11 and 12",
            count_classes=_count_yolo8,
            read=_read_yolo8,
            scaling=_YOLO,
        ),
        "end-to-end": DetectorStyle(
            what="(1, objects, 6): corners, score, class; YOLO 10, 26, and exports with suppression",
            count_classes=_count_end_to_end,
            read=_read_end_to_end,
            scaling=_YOLO,
            is_suppressed=True,
        ),
        "nanodet": DetectorStyle(
            what="at each of three or four levels (1, cells, classes) and (1, cells, 4 * bins)",
            count_classes=_count_nanodet,
            read=_read_nanodet,
            scaling=_NANODET,
        ),
        "centernet": DetectorStyle(
            what="maps (1, classes, h, w), (1, 2 or 4, h, w) of sizes or sides, and perhaps offsets",
            count_classes=_count_centernet,
            read=_read_centernet,
            scaling=Scaling(deviation=_RAW),
            side=512,
        ),
        "detr": DetectorStyle(
            what="logits (1, queries, 92 or 21), the last one no object, and boxes (1, queries, 4)",
            count_classes=_count_detr,
            read=lambda outputs, ask: _read_queries(outputs, ask, _softmax_without_last),
            scaling=_IMAGENET,
            side=800,
            is_suppressed=True,
        ),
        "rt-detr": DetectorStyle(
            what="logits (1, queries, classes) and boxes (1, queries, 4)",
            count_classes=_count_rt_detr,
            read=lambda outputs, ask: _read_queries(outputs, ask, _sigmoid),
            scaling=Scaling(),
            is_suppressed=True,
        ),
        "ssd": DetectorStyle(
            what="boxes (1, n, 4) as shares, top first, scores (1, n), classes (1, n), by such names",
            count_classes=_count_ssd,
            read=_read_ssd,
            scaling=Scaling(deviation=_RAW),
            is_suppressed=True,
        ),
    }
)
"""The styles by name, in the order in which they are tried."""
