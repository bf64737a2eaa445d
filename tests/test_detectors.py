"""Detectors in ONNX files: every style of output, tiles, classes, and files that are no detectors."""

import json
import sys

import numpy as np
import onnx
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from onnx import helper
from tiny_networks import STYLES, SURE, build_network

from dojo_env.detectors import DETECTOR_STYLES, DetectorModel, load_detector
from dojo_env.detectors.base import COCO_91
from dojo_env.detectors.suppression import measure_overlaps, suppress
from dojo_env.errors import ConfigError, DetectorError
from dojo_env.snapshot import Kind
from dojo_maps.errors import ToolMissingError

BOX = (80, 48, 208, 176)
"""Left, top, right and bottom of what is red. Two of its pixels are one of the networks' input."""


@pytest.fixture
def save(tmp_path):
    def build(style="yolo8", **options):
        file = tmp_path / f"{style}.onnx"
        file.write_bytes(build_network(style, **options))
        return file

    return build


def picture(width=256, height=256, boxes=(BOX,)):
    made = np.full((height, width, 3), 90, np.uint8)
    for left, top, right, bottom in boxes:
        made[top:bottom, left:right] = (255, 0, 0)
    return made


def test_every_style_is_tested():
    assert set(STYLES) == set(DETECTOR_STYLES)


@pytest.mark.parametrize("style", STYLES)
def test_each_style_is_guessed_and_read(style, save):
    detector = load_detector(save(style))
    assert isinstance(detector, DetectorModel)
    assert detector.style == style
    found = detector.detect(picture())
    assert found.kinds.tolist() == [Kind.CAR]
    np.testing.assert_allclose(found.boxes[0], BOX, atol=2.1)
    np.testing.assert_allclose(found.scores, SURE, atol=0.01)
    assert len(detector.detect(picture(boxes=()))) == 0


@pytest.mark.parametrize("style", ["nanodet", "centernet", "detr", "rt-detr", "ssd"])
def test_outputs_may_come_in_any_order(style, save):
    detector = load_detector(save(style, backwards=True))
    found = detector.detect(picture())
    assert (detector.style, found.kinds.tolist()) == (style, [Kind.CAR])
    np.testing.assert_allclose(found.boxes[0], BOX, atol=2.1)


@pytest.mark.parametrize("style", ["yolo8", "yolox", "ssd"])
def test_boxes_fit_pictures_of_other_shapes(style, save):
    box = (100, 40, 160, 72)
    found = load_detector(save(style)).detect(picture(256, 128, [box]))
    np.testing.assert_allclose(found.boxes[0], box, atol=4.1)


def test_tiles_find_each_vehicle_once(save):
    boxes = [(8, 8, 40, 30), (120, 10, 150, 34), (58, 140, 90, 160), (230, 100, 262, 124)]
    found = load_detector(save(), tile=64, tile_overlap=0.5).detect(picture(300, 200, boxes))
    order = np.lexsort(found.boxes.T[:2])
    wanted = np.array(sorted(boxes, key=lambda box: (box[1], box[0])))
    np.testing.assert_allclose(found.boxes[order], wanted, atol=1.1)


def test_one_look_without_tiles_sees_all_red_as_one(save):
    boxes = [(8, 8, 40, 30), (230, 100, 262, 124)]
    found = load_detector(save(), tile=0).detect(picture(300, 200, boxes))
    np.testing.assert_allclose(found.boxes, [(8, 8, 262, 124)], atol=5)


def test_the_same_picture_gives_the_same_bytes(save):
    file, noise = save("nanodet"), np.random.default_rng(1).integers(0, 255, (128, 128, 3)).astype(np.uint8)
    first, again = (load_detector(file).detect(noise) for _ in range(2))
    assert first.boxes.tobytes() == again.boxes.tobytes()
    assert first.scores.tobytes() == again.scores.tobytes()


def test_classes_come_from_the_file_or_from_settings(save):
    names = {"names": "{0: 'dog', 1: \"person\", 2: 'bus'}"}
    assert load_detector(save(metadata=names)).detect(picture()).kinds.tolist() == [Kind.BUS]
    named = load_detector(save(metadata=names), classes=("van", "person", "truck"))
    assert named.detect(picture()).kinds.tolist() == [Kind.TRUCK]
    with pytest.raises(DetectorError, match="none of its 80 classes"):
        load_detector(save(metadata={"names": "{0: 'dog', 1: 'cat'}"}))


def test_the_data_sets_own_numbers_have_gaps():
    known = {
        1: "person",
        3: "car",
        6: "bus",
        8: "truck",
        10: "traffic light",
        13: "stop sign",
        90: "toothbrush",
    }
    assert {number: COCO_91[number] for number in known} == known
    assert [number for number, name in enumerate(COCO_91) if not name][:3] == [0, 12, 26]


def test_a_description_says_how_to_use_a_network(save, tmp_path):
    save()
    value = {"format": "dojo-detector", "version": 1, "model": "yolo8.onnx", "least_score": 0.95,
             "scaling": {"fit": "squash", "mean": [0, 0, 0]}}  # fmt: skip
    file = tmp_path / "d.json"
    file.write_text(json.dumps(value))
    assert len(load_detector(file).detect(picture())) == 0
    assert len(load_detector(file, least_score=0.5).detect(picture())) == 1
    for change, words in (
        ({"version": 2}, "version 1"), ({"model": 3}, "model is 3"), ({"tiles": 1}, "no setting 'tiles'"),
        ({"scaling": {"order": "hsv"}}, "order='hsv'"), ({"least_score": "x"}, "detector"),
        ({"scaling": {"x": 1}}, "detector"), ({"model": "other.onnx"}, "no such file"),
    ):  # fmt: skip
        file.write_text(json.dumps({**value, **change}))
        with pytest.raises(DetectorError, match=words):
            load_detector(file)


@pytest.mark.parametrize(
    ("settings", "words"),
    [({"style": "yolo9000"}, "style='yolo9000'"), ({"classes": "coco"}, "coco-80"), ({"tile": 10}, "tile=10"),
     ({"least_score": 2}, "least_score=2"), ({"size": (1, 1)}, "size"), ({"nms": 1}, "no setting 'nms'")],
)  # fmt: skip
def test_impossible_settings_are_refused(settings, words, save):
    with pytest.raises(ConfigError, match=words):
        load_detector(save(), **settings)


def test_files_that_are_no_detectors_are_refused(save, tmp_path):
    with pytest.raises(DetectorError, match="not a file"):
        load_detector(tmp_path)
    file = tmp_path / "x.onnx"
    with pytest.raises(DetectorError, match="no such file"):
        load_detector(file)
    file.write_bytes(b"GIF89a" * 100)
    with pytest.raises(DetectorError, match="cannot read it"):
        load_detector(file)
    with pytest.raises(DetectorError, match="not of style 'yolo5'"):
        load_detector(save(), style="yolo5")


def network(inputs, outputs, nodes, initializers=(), kind=1):
    make = helper.make_tensor_value_info
    graph = helper.make_graph(
        nodes,
        "g",
        [make(n, t, s) for n, t, s in inputs],
        [make(n, kind, None) for n in outputs],
        initializers,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 9
    return model.SerializeToString()


@pytest.mark.parametrize(
    ("inputs", "words"),
    [([("x", 1, [1, 3, 64, 64])], "no known style"), ([("x", 1, [4, 3, 64, 64])], "one input of one picture"),
     ([("x", 1, [1, 4, 64, 64])], "one input of one picture"), ([("x", 1, [64, 64])], "one input"),
     ([("x", 1, [1, 3, 9000, 64])], "at most 4096"), ([("x", 7, [1, 3, 64, 64])], "one input")],
)  # fmt: skip
def test_other_networks_are_refused(inputs, words, tmp_path):
    file = tmp_path / "x.onnx"
    file.write_bytes(network(inputs, ["y"], [helper.make_node("Cast", ["x"], ["y"], to=1)]))
    with pytest.raises(DetectorError, match=words):
        load_detector(file)


def test_networks_without_numbers_are_refused(tmp_path):
    file = tmp_path / "x.onnx"
    file.write_bytes(
        network([("x", 1, [1, 3, 64, 64])], ["y"], [helper.make_node("IsNaN", ["x"], ["y"])], kind=9)
    )
    with pytest.raises(DetectorError, match="array of numbers"):
        load_detector(file)


def test_weights_in_other_files_are_not_read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "secret.bin").write_bytes(np.zeros(4, np.float32).tobytes())
    tensor = onnx.TensorProto(name="w", data_type=1, dims=[4], data_location=onnx.TensorProto.EXTERNAL)
    tensor.external_data.add(key="location", value="secret.bin")
    node = helper.make_node("Identity", ["w"], ["y"])
    (tmp_path / "x.onnx").write_bytes(network([("x", 1, [1, 3, 64, 64])], ["y"], [node], [tensor]))
    with pytest.raises(DetectorError, match="cannot read it"):
        load_detector("x.onnx")


def test_a_missing_runtime_is_named(save, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(ToolMissingError, match=r"traffic-dojo\[detectors\]"):
        load_detector(save())


@given(arrays(np.float64, (12, 4), elements=st.floats(0, 50)), st.integers(0, 5))
def test_suppression_keeps_boxes_apart_and_the_surest(numbers, seed):
    boxes = np.hstack([numbers[:, :2], numbers[:, :2] + 1 + numbers[:, 2:]])
    scores = np.random.default_rng(seed).random(12)
    kept = suppress(boxes, scores, 0.5)
    overlaps = measure_overlaps(boxes, boxes)
    np.testing.assert_allclose(np.diag(overlaps), 1)
    assert scores[kept[0]] == scores.max()
    assert (overlaps[np.ix_(kept, kept)] <= 0.5)[~np.eye(len(kept), dtype=bool)].all()
    for row in set(range(12)) - set(kept.tolist()):
        assert (overlaps[row, kept] > 0.5).any()
