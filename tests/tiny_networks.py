"""Detectors of a few nodes, as real ONNX files: each finds what is red, and says so in a style of output."""

from collections.abc import Callable
from typing import Any

import numpy as np
from onnx import helper, numpy_helper

SIDE = 128
SURE = 0.9
CELLS = tuple((SIDE // stride) ** 2 for stride in (8, 16, 32))
STYLES = (
    "yolo5", "yolox", "yolo8", "end-to-end", "nanodet", "nanodet-plus", "centernet", "detr", "rt-detr", "ssd",
)  # fmt: skip


class Graph:
    """Nodes and constants, added one after another."""

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def constant(self, value: Any, kind: Any = np.float32) -> str:
        name = f"constant{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.asarray(value, kind), name))
        return name

    def add(self, operator: str, *inputs: str, **attributes: Any) -> str:
        name = f"value{len(self.nodes)}"
        self.nodes.append(helper.make_node(operator, list(inputs), [name], **attributes))
        return name

    def sum_of(self, a: str, b: str, factor: float = 1.0) -> str:
        return self.add("Add", a, self.add("Mul", b, self.constant(factor)))

    def column(self, *values: str) -> str:
        """Put numbers, each of shape (1, 1), on top of each other: (1, n, 1)."""
        return self.add("Unsqueeze", self.add("Concat", *values, axis=1), self.constant([2], np.int64))

    def pad(self, value: str, rows: int, columns: int) -> str:
        """Add zeros below and to the right of (1, n, m)."""
        return self.add("Pad", value, self.constant([0, 0, 0, 0, rows, columns], np.int64))


def build_network(style: str, *, metadata: dict[str, str] | None = None, backwards: bool = False) -> bytes:
    """Build the detector: for a picture of 128 x 128, one box around all that is red, as a car.

    `backwards` lists its outputs the last one first.
    """
    graph = Graph()
    sides = _find_red(graph)
    outputs = _TAILS[style](graph, *sides)
    tail = {
        name: graph.nodes.append(helper.make_node("Identity", [value], [name])) or name
        for name, value in outputs.items()
    }
    make = helper.make_tensor_value_info
    model = helper.make_model(
        helper.make_graph(
            graph.nodes,
            style,
            [make("image", 1, [1, 3, SIDE, SIDE])],
            [make(name, 1, None) for name in (reversed(tail) if backwards else tail)],
            graph.constants,
        ),
        opset_imports=[helper.make_opsetid("", 17)],
    )
    model.ir_version = 9
    helper.set_model_props(model, metadata or {})
    return model.SerializeToString()


def _find_red(graph: Graph) -> tuple[str, str, str, str, str]:
    """Give left, top, right and bottom of what is red, pixels, and how sure it is; each (1, 1)."""
    first, green, last = (graph.add("Gather", "image", graph.constant(k, np.int64), axis=1) for k in range(3))
    # Red is the first channel or the last one: whichever of them stands out.
    difference = graph.add("Sub", graph.add("Max", first, last), green)
    mask = graph.add("Cast", graph.add("Greater", difference, graph.constant(0.6)), to=1)
    ends = []
    for axis in (1, 2):  # Over rows, then over columns.
        line = graph.add("ReduceMax", mask, axes=[axis], keepdims=0)
        up, down = (graph.constant(values) for values in (np.arange(1, SIDE + 1), np.arange(SIDE, 0, -1)))
        high = graph.add("ReduceMax", graph.add("Mul", line, up), axes=[1], keepdims=1)
        low = graph.add("ReduceMax", graph.add("Mul", line, down), axes=[1], keepdims=1)
        ends.append((graph.add("Sub", graph.constant(SIDE), low), high))
    score = graph.add("ReduceMax", mask, axes=[2], keepdims=0)
    sure = graph.add("Mul", graph.add("ReduceMax", score, axes=[1], keepdims=1), graph.constant(SURE))
    (left, right), (top, bottom) = ends
    return left, top, right, bottom, sure


def _middles(graph: Graph, left: str, top: str, right: str, bottom: str, factor: float = 1.0) -> list[str]:
    pairs = ((left, right), (top, bottom))
    half = [graph.add("Mul", graph.sum_of(a, b), graph.constant(factor / 2)) for a, b in pairs]
    whole = [graph.add("Mul", graph.sum_of(b, a, -1.0), graph.constant(factor)) for a, b in pairs]
    return [*half, *whole]


def _number(graph: Graph, value: float) -> str:
    return graph.constant([[value]])


def _yolo5(graph: Graph, *sides: str) -> dict[str, str]:
    values = [*_middles(graph, *sides[:4]), sides[4], *(_number(graph, k == 2) for k in range(80))]
    rows = graph.pad(graph.column(*values), 0, 3 * sum(CELLS) - 1)
    return {"output": graph.add("Transpose", rows, perm=[0, 2, 1])}


def _yolox(graph: Graph, *sides: str) -> dict[str, str]:
    x, y, wide, high = _middles(graph, *sides[:4], factor=1 / 8)
    values = [x, y, graph.add("Log", wide), graph.add("Log", high), sides[4]]
    values += [_number(graph, k == 2) for k in range(80)]
    rows = graph.pad(graph.column(*values), 0, sum(CELLS) - 1)
    return {"output": graph.add("Transpose", rows, perm=[0, 2, 1])}


def _yolo8(graph: Graph, *sides: str) -> dict[str, str]:
    values = [*_middles(graph, *sides[:4]), _number(graph, 0), _number(graph, 0), sides[4]]
    return {"output0": graph.pad(graph.column(*values), 77, sum(CELLS) - 1)}


def _end_to_end(graph: Graph, *sides: str) -> dict[str, str]:
    rows = graph.pad(graph.column(*sides, _number(graph, 2)), 0, 299)
    return {"output0": graph.add("Transpose", rows, perm=[0, 2, 1])}


def _distances(graph: Graph, sides: tuple[str, ...], middle: float, bins: int) -> list[str]:
    """Give the weights of the bins of each side's distance from a cell, x and y of which are `middle`."""
    weights = []
    for k, side in enumerate(sides[:4]):
        sign = 1.0 if k >= 2 else -1.0
        distance = graph.add(
            "Mul", graph.sum_of(side, graph.constant(middle), -1.0), graph.constant(sign / 8)
        )
        off = graph.add("Sub", graph.constant(np.arange(bins)[None]), distance)
        weights.append(graph.add("Mul", graph.add("Mul", off, off), graph.constant(-50.0)))
    return weights


def _nanodet(graph: Graph, *sides: str) -> dict[str, str]:
    cell = 8 * 16 + 8  # Its middle is at (68, 68).
    weights = graph.column(*_distances(graph, sides, 68.0, 8))
    scores = graph.column(_number(graph, 0), _number(graph, 0), sides[4])
    made = {}
    for level, count in enumerate(CELLS):
        before = cell if level == 0 else 0
        for name, column, size in (("cls", scores, 80), ("dis", weights, 32)):
            rows = size - (3 if name == "cls" else 32)
            padded = graph.add(
                "Pad", column, graph.constant([0, 0, before, 0, rows, count - 1 - before], np.int64)
            )
            kept = padded if level == 0 else graph.add("Mul", padded, graph.constant(0.0))
            made[f"{name}{level}"] = graph.add("Transpose", kept, perm=[0, 2, 1])
    return made


def _nanodet_plus(graph: Graph, *sides: str) -> dict[str, str]:
    cell, cells = 8 * 16 + 8, sum(CELLS) + 4  # The corner of the cell is at (64, 64).
    values = [_number(graph, 0), _number(graph, 0), sides[4], graph.constant(np.zeros((1, 77)))]
    column = graph.column(*values, *_distances(graph, sides, 64.0, 8))
    rows = graph.add("Pad", column, graph.constant([0, 0, cell, 0, 0, cells - 1 - cell], np.int64))
    return {"output": graph.add("Transpose", rows, perm=[0, 2, 1])}


def _centernet(graph: Graph, *sides: str) -> dict[str, str]:
    side, cell = SIDE // 4, 9  # Cells of four pixels; the middle is told from cell (9, 9).
    x, y, wide, high = _middles(graph, *sides[:4], factor=1 / 4)
    there = np.zeros((1, 1, side, side))
    there[..., cell, cell] = 1
    spot = graph.constant(there)

    def spread(*values: str) -> str:
        maps = graph.add("Unsqueeze", graph.column(*values), graph.constant([3], np.int64))
        return graph.add("Mul", maps, spot)

    offsets = [graph.sum_of(each, graph.constant(cell), -1.0) for each in (x, y)]
    heat = spread(_number(graph, 0), _number(graph, 0), sides[4], graph.constant(np.zeros((1, 77))))
    return {"hm": heat, "wh": spread(wide, high), "reg": spread(*offsets)}


def _queries(graph: Graph, sides: tuple[str, ...], classes: int, car: int) -> dict[str, str]:
    boxes = graph.pad(graph.column(*_middles(graph, *sides[:4], factor=1 / SIDE)), 0, 99)
    # A sigmoid of log(.9 / .1) is .9, and so is the softmax beside a single 0 among -30.
    logit = graph.sum_of(graph.constant(-30.0), sides[4], (30.0 + np.log(SURE / (1 - SURE))) / SURE)
    base = np.full((1, classes, 100), -30.0)
    if classes == 92:
        base[:, -1] = 0.0
    one = np.zeros((1, classes, 100))
    one[0, car, 0] = 1
    shifted = graph.add("Mul", graph.constant(one), graph.sum_of(logit, graph.constant(30.0)))
    logits = graph.sum_of(graph.constant(base), shifted)
    return {
        "logits": graph.add("Transpose", logits, perm=[0, 2, 1]),
        "pred_boxes": graph.add("Transpose", boxes, perm=[0, 2, 1]),
    }


def _detr(graph: Graph, *sides: str) -> dict[str, str]:
    return _queries(graph, sides, 92, 3)


def _rt_detr(graph: Graph, *sides: str) -> dict[str, str]:
    return _queries(graph, sides, 80, 2)


def _ssd(graph: Graph, *sides: str) -> dict[str, str]:
    left, top, right, bottom = (graph.add("Mul", each, graph.constant(1 / SIDE)) for each in sides[:4])
    boxes = graph.pad(graph.column(top, left, bottom, right), 0, 9)
    scores = graph.add("Squeeze", graph.pad(graph.column(sides[4]), 9, 0), graph.constant([2], np.int64))
    return {
        "detection_boxes": graph.add("Transpose", boxes, perm=[0, 2, 1]),
        "detection_classes": graph.constant(np.full((1, 10), 3)),
        "detection_scores": scores,
        "num_detections": graph.constant([10]),
    }


_TAILS: dict[str, Callable[..., dict[str, str]]] = {
    "yolo5": _yolo5, "yolox": _yolox, "yolo8": _yolo8, "end-to-end": _end_to_end, "nanodet": _nanodet,
    "nanodet-plus": _nanodet_plus, "centernet": _centernet, "detr": _detr, "rt-detr": _rt_detr, "ssd": _ssd,
}  # fmt: skip
