"""Data sets: every format is read back by its own rules, and held against the depths that were drawn."""

import hashlib
import itertools
import json
import xml.etree.ElementTree as ET
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from dojo_env.camera import Camera, write_cameras
from dojo_env.cli import main
from dojo_env.datasets import FORMATS, DatasetSettings, write_dataset
from dojo_env.datasets.keypoints import model_points
from dojo_env.datasets.labels import KEYPOINTS, Category, PictureLabels
from dojo_env.datasets.parts import take_pictures
from dojo_env.datasets.settings import SPLITS, Job, Plan
from dojo_env.datasets.weather import draw_conditions
from dojo_env.datasets.workers import Worker
from dojo_env.errors import ConfigError
from dojo_env.rendering.masks import encode_masks
from dojo_env.rendering.models import build_models

coco_masks = pytest.importorskip("pycocotools.mask")
coco_files = pytest.importorskip("pycocotools.coco")
pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")
"""pycocotools' own."""

SETTINGS = DatasetSettings(
    scenarios=("cologne1",), pictures=16, per_episode=16, split=(1,), size=(320, 224), conditions=("day",),
    controllers=("fixed-time",), seconds=600, depth=True, smooth=False, negatives=0.25, least_pixels=30,
)  # fmt: skip
SHORT = {
    "scenarios": ("cologne1",), "pictures": 9, "per_episode": 3, "split": (0.6, 0.4), "size": (96, 64),
    "cameras": ("bev",), "format": "mot", "conditions": ("day", "rain"), "seconds": 200, "smooth": False,
    "imaging": ("traffic_camera",),
}  # fmt: skip
Pictures = tuple[PictureLabels, ...]


def collect(settings: DatasetSettings, job: Job, folder: Path) -> Pictures:
    return tuple(take_pictures(settings, job, folder))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("dataset")


@pytest.fixture(scope="module")
def pictures(folder: Path) -> Pictures:
    """An episode's pictures, taken in a process of our own, as always."""
    worker = Worker()
    try:
        worker.begin((collect, (SETTINGS, Plan(settings=SETTINGS).jobs[0], folder)))
        taken: Pictures = worker.end()
    finally:
        worker.close()
    return taken


def write_whole(name: str, pictures: Pictures, folder: Path) -> None:
    """Write a format's files, as from one part."""
    settings, made = replace(SETTINGS, format=name, negatives=0.0), FORMATS[name]
    lines = made.write_lines(pictures)
    wholes = made.finish(settings, lambda stream: iter(lines.get(stream, ())))
    for path, text in (*made.write_part(pictures, settings).items(), *wholes):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text("".join(text), encoding="utf-8")


def read_depth(folder: Path, picture: PictureLabels) -> NDArray[np.float64]:
    return cv2.imread(str(folder / picture.depth), cv2.IMREAD_UNCHANGED).astype(np.float64) / 256


def decode(record: dict[str, Any], each: dict[str, Any]) -> NDArray[np.bool_]:
    size = [record["height"], record["width"]]
    mask: NDArray[np.bool_] = coco_masks.decode({"size": size, "counts": each["mask"].encode()}) > 0
    return mask


@pytest.mark.slow
def test_masks_are_written_as_pycocotools_writes_them() -> None:
    random = np.random.default_rng(0)
    for _ in range(60):
        height, width = random.integers(1, 40, 2)
        instance = random.integers(0, 4, (height, width)).astype(np.int32)
        if random.random() < 0.5:
            instance[:, random.integers(0, width) :] = 2
        shown = encode_masks(instance, np.array([1, 2, 3, 9], np.int32))
        for k, number in enumerate((1, 2, 3, 9)):
            mask = np.asfortranarray((instance == number).astype(np.uint8))
            assert shown.pixels[k] == mask.sum()
            if mask.any():
                theirs = coco_masks.encode(mask)
                left, top, right, bottom = shown.boxes[k].tolist()
                assert shown.masks[k] == theirs["counts"].decode()
                assert coco_masks.toBbox(theirs).tolist() == [left, top, right - left, bottom - top]


@pytest.mark.slow
def test_coco_has_equal_areas_and_boxes_in_pycocotools(
    pictures: Pictures, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    evaluation = pytest.importorskip("pycocotools.cocoeval")
    write_whole("coco", pictures, tmp_path)
    read = coco_files.COCO(str(tmp_path / "annotations/instances_train.json"))
    assert len(read.imgs) == SETTINGS.pictures
    assert len(read.anns) == sum(len(picture.objects) for picture in pictures) > 30
    assert read.loadCats(read.getCatIds(["car"]))[0]["id"] == 3
    for image in read.getImgIds():
        masks = []
        for each in read.loadAnns(read.getAnnIds(imgIds=image, iscrowd=None)):
            masks.append(read.annToMask(each))
            assert masks[-1].sum() == each["area"]
            assert coco_masks.toBbox(read.annToRLE(each)).tolist() == each["bbox"]
            assert each["num_keypoints"] == np.count_nonzero(each["keypoints"][2::3])
        assert np.sum(masks, axis=0).max(initial=0) <= 1
    found = [
        {**{name: each[name] for name in ("image_id", "category_id", "segmentation", "bbox")}, "score": 1.0}
        for each in read.dataset["annotations"]
        if not each["iscrowd"]
    ]
    for kind in ("segm", "bbox"):
        judge = evaluation.COCOeval(read, read.loadRes(found), kind)
        judge.evaluate()
        judge.accumulate()
        judge.summarize()
        assert judge.stats[0] == pytest.approx(1.0)
    capsys.readouterr()


@pytest.mark.slow
def test_pixels_of_a_mask_lie_in_its_box_in_space(pictures: Pictures, folder: Path) -> None:
    """From depths and the camera's matrices alone."""
    shares = []
    for picture in pictures:
        record, depth = json.loads(json.dumps(picture.describe())), read_depth(folder, picture)
        k, r, t = (np.array(record["camera"][name]) for name in ("K", "R", "t"))
        for each in record["objects"]:
            rows, columns = np.nonzero(decode(record, each))
            rays = np.linalg.inv(k) @ [columns + 0.5, rows + 0.5, np.ones(len(rows))]
            points = r.T @ (rays * depth[rows, columns] - t[:, None])
            box = each["box_3d"]
            along = points.T - box["centre"]
            cos, sin = np.cos(box["heading"]), np.sin(box["heading"])
            turned = np.column_stack(
                [along[:, 0] * cos + along[:, 1] * sin, along[:, 1] * cos - along[:, 0] * sin, along[:, 2]]
            )
            # Mirrors stand out.
            margin = np.array([0.15, 0.35, 0.15])
            shares.append((np.abs(turned) < np.array(box["size"]) / 2 + margin).all(axis=1).mean())
    assert min(shares) > 0.8
    assert np.mean(shares) > 0.99


def test_boxes_hold_what_they_say(pictures: Pictures) -> None:
    assert {picture.is_empty for picture in pictures} == {True, False}
    assert {each.is_parked for picture in pictures for each in picture.objects} == {True, False}
    for picture in pictures:
        assert not (picture.is_empty and picture.objects)
        for each in picture.objects:
            assert each.is_parked == each.id.startswith("generated:parked:")
            assert not each.is_parked or (each.speed, each.lane, each.movement) == (0.0, "", "")
            left, top, right, bottom = each.box
            assert 0 <= left < right <= 320
            assert 0 <= top < bottom <= 224
            whole_left, whole_top, whole_right, whole_bottom = each.whole_box
            leaves = min(whole_left, whole_top) < 0 or whole_right > 320 or whole_bottom > 224
            assert leaves == (each.truncated > 0)
            assert each.is_ignored == (each.pixels < 30 or each.visible < 0.1)
            if each.link is not None:
                assert each.link.state == picture.signals[each.link.signal][each.link.link]
            elif each.lane.startswith(":"):
                assert each.movement


def test_keypoints_are_where_wheels_and_lamps_are(pictures: Pictures, folder: Path) -> None:
    names = [
        f"{kind.name} {number} {pose}"
        for kind, variants in build_models().items()
        for number, variant in enumerate(variants)
        for pose in range(len(variant.poses))
    ]
    points = dict(zip(names, model_points(), strict=True))
    for name, place in points.items():
        is_straight = name.endswith(" 0")
        if is_straight and name.startswith(("CAR", "TAXI", "VAN", "BUS", "TRUCK", "TRAILER", "ROAD", "ART")):
            front_left, front_right, rear_left, rear_right, *lamps = place
            assert np.isfinite(place).all(), name
            assert min(front_left[1], rear_left[1], lamps[0][1], lamps[2][1]) > 0.2
            assert max(front_right[1], rear_right[1], lamps[1][1], lamps[3][1]) < -0.2
            assert front_left[0] > rear_left[0] + 0.3
            assert (lamps[0][0] > -0.1) & (lamps[2][0] < -0.9)
            assert max(front_left[2], rear_right[2]) < 0.35
    seen = [
        (picture, each, dict(zip(KEYPOINTS, each.keypoints, strict=True)))
        for picture in pictures
        for each in picture.objects
        if each.keypoints is not None and each.visible == 1 and each.truncated == 0 and each.pixels > 800
    ]
    assert len(seen) > 5
    for picture, each, point in seen:
        mask = decode(picture.describe(), each.describe())
        shown = [
            place
            for name, place in point.items()
            if "_top" not in name and "bottom" not in name and place[2] == 2
        ]
        assert shown
        assert all(
            mask[max(0, int(y) - 2) : int(y) + 3, max(0, int(x) - 2) : int(x) + 3].any() for x, y, _ in shown
        )
        assert {value for _, _, value in point.values()} == {1.0, 2.0}


def test_yolo_has_the_same_boxes(pictures: Pictures, tmp_path: Path) -> None:
    write_whole("yolo", pictures, tmp_path)
    head = (tmp_path / "data.yaml").read_text().splitlines()
    assert head[:2] == ["train: images/train", "val: images/train"]
    names = [line.split(": ")[1] for line in head[head.index("names:") + 1 :]]
    assert names == [category.value for category in Category]
    for picture in pictures:
        rows = (tmp_path / f"labels/train/{picture.number:09d}.txt").read_text().splitlines()
        asked = [each for each in picture.objects if not each.is_ignored]
        assert len(rows) == len(asked)
        for row, each in zip(rows, asked, strict=True):
            number, *values = row.split()
            x, y, width, height = np.array(values, float) * [320, 224, 320, 224]
            assert names[int(number)] == each.category
            box = [x - width / 2, y - height / 2, x + width / 2, y + height / 2]
            assert box == pytest.approx(each.box, abs=0.001)


def test_kitti_s_boxes_in_space_fall_on_its_boxes(pictures: Pictures, tmp_path: Path) -> None:
    write_whole("kitti", pictures, tmp_path)
    assert (tmp_path / "ImageSets/train.txt").read_text().split() == [f"{p.number:06d}" for p in pictures]
    kinds = set()
    for picture in pictures:
        calibration = (tmp_path / f"training/calib/{picture.number:06d}.txt").read_text().splitlines()
        matrices = {
            name: np.array(v.split(), float) for name, v in (line.split(": ") for line in calibration)
        }
        projection = matrices["P2"].reshape(3, 4)
        rows = (tmp_path / f"training/label_2/{picture.number:06d}.txt").read_text().splitlines()
        for row, each in zip(rows, picture.objects, strict=True):
            kind, *values = row.split()
            kinds.add(kind)
            assert len(values) == 14
            assert (kind == "DontCare") == each.is_ignored
            if kind == "DontCare" or each.truncated > 0:
                continue
            box = np.array(values[3:7], float)
            height, width, length, x, y, z, turn = map(float, values[7:])
            # As devkit_object's computeBox3D has it.
            cos, sin = np.cos(turn), np.sin(turn)
            corners = np.array(list(itertools.product((-0.5, 0.5), (-1, 0), (-0.5, 0.5)))) * [
                length,
                height,
                width,
            ]
            turned = corners @ np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]]).T + [x, y, z]
            u, v, w = projection @ np.column_stack([turned, np.ones(8)]).T
            low, high = (u / w, v / w), (u / w, v / w)
            found = [low[0].min(), low[1].min(), high[0].max(), high[1].max()]
            assert found == pytest.approx(each.whole_box, abs=0.3)
            assert (box[:2] <= np.array(found[:2]) + 0.3).all()
            assert (box[2:] >= np.array(found[2:]) - 0.3).all()
            map_to_level = matrices["Tr_velo_to_cam"].reshape(3, 4)
            foot = 0.5 * (each.corners[0] + each.corners[6])
            assert map_to_level @ [*foot, 1] == pytest.approx([x, y, z], abs=0.01)
    assert "Car" in kinds


def test_kitti_refuses_a_lens_that_bends(pictures: Pictures) -> None:
    bent = replace(pictures[0], camera=replace(pictures[0].camera, distortion=(-0.2, 0.0, 0.0, 0.0)))
    with pytest.raises(ConfigError, match="its lens bends"):
        FORMATS["kitti"].write_part((bent,), SETTINGS)


def test_cvat_is_xml_whatever_lanes_are_called(pictures: Pictures, tmp_path: Path) -> None:
    evil = '<a & "b"]]>\n--><box'
    picture = next(picture for picture in pictures if picture.objects)
    objects = tuple(replace(each, lane=evil, is_ignored=False) for each in picture.objects)
    write_whole("cvat", (replace(picture, objects=objects),), tmp_path)
    root = ET.parse(tmp_path / "annotations.xml").getroot()  # noqa: S314 - we have just written it
    (image,) = root.findall("image")
    assert image.get("width") == "320"
    boxes = image.findall("box")
    assert len(boxes) == len(objects)
    names = {label.findtext("name") for label in root.iter("label")}
    for box, each in zip(boxes, objects, strict=True):
        values = {part.get("name"): part.text for part in box}
        assert values["lane"] == " ".join(evil.split())
        assert box.get("label") in names
        assert [float(box.get(side, "")) for side in ("xtl", "ytl", "xbr", "ybr")] == list(each.box)


def digest(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


class StopHereError(Exception):
    pass


@pytest.fixture(scope="module")
def sequences(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("mot") / "whole"
    made = write_dataset(folder, jobs=1, **SHORT)
    assert made["counts"]["totals"]["pictures"] == 9
    return folder


@pytest.mark.slow
def test_an_interrupted_data_set_goes_on_to_the_same_bytes(sequences: Path, tmp_path: Path) -> None:
    def stop(words: str) -> None:
        raise StopHereError(words)

    folder = tmp_path / "whole"
    with pytest.raises(StopHereError, match="3 of 9 pictures"):
        write_dataset(folder, jobs=1, on_stage=stop, **SHORT)
    assert not (folder / "train").exists()
    told: list[str] = []
    write_dataset(folder, jobs=2, on_stage=told.append, **SHORT)
    assert told == ["6 of 9 pictures", "9 of 9 pictures"]
    assert digest(folder) == digest(sequences)
    write_dataset(folder, on_stage=stop, **SHORT)  # It is whole.


@pytest.mark.slow
def test_mot_s_tracks_go_on_from_frame_to_frame(sequences: Path) -> None:
    files = sorted(sequences.rglob("gt.txt"))
    assert {file.relative_to(sequences).parts[0] for file in files} == {"train", "val"}
    pairs = 0
    for file in files:
        frames: dict[int, dict[int, NDArray[np.float64]]] = defaultdict(dict)
        for row in file.read_text().splitlines():
            frame, track, *values = (float(value) for value in row.split(","))
            assert len(values) == 7
            frames[int(frame)][int(track)] = np.array(values)
            assert values[5] in (1, 3, 4, 5, 6)
        info = dict(
            line.split("=") for line in (file.parents[1] / "seqinfo.ini").read_text().splitlines()[1:]
        )
        assert (info["frameRate"], info["seqLength"], info["imWidth"]) == ("10", "3", "96")
        assert len(list((file.parents[1] / "img1").glob("*.jpg"))) == 3
        for one, two in itertools.pairwise(sorted(frames)):
            assert two == one + 1
            for track in frames[one].keys() & frames[two].keys():
                moved = np.abs(frames[one][track][:2] - frames[two][track][:2]).max()
                assert moved < 3
                pairs += 1
    assert pairs > 10


def test_another_data_set_s_folder_is_left_alone(sequences: Path, tmp_path: Path) -> None:
    before = digest(sequences)
    with pytest.raises(ConfigError, match="other settings: seed 0, not 1"):
        write_dataset(sequences, **{**SHORT, "seed": 1})
    assert digest(sequences) == before
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(ConfigError, match="holds something else"):
        write_dataset(tmp_path, **SHORT)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
    (tmp_path / "dataset.json").write_text('{"format": "dojo-dataset"}')
    with pytest.raises(ConfigError, match="does not describe a data set"):
        write_dataset(tmp_path, **SHORT)


def test_the_card_tells_what_is_in_it(sequences: Path) -> None:
    card, facts = (sequences / "README.md").read_text(), json.loads((sequences / "dataset.json").read_text())
    assert facts["complete"]
    assert facts["command"] in card
    assert "CC BY-NC-SA 4.0" in card
    labels = [json.loads(line) for line in (sequences / "labels.jsonl").read_text().splitlines()]
    assert [label["id"] for label in labels] == list(range(1, 10))
    assert all((sequences / label["file"]).is_file() for label in labels)
    objects = [each for label in labels for each in label["objects"]]
    totals = facts["counts"]["totals"]
    assert totals["objects"] + totals["ignored"] == len(objects)
    assert sum(facts["counts"]["boxes"].values()) == totals["objects"]
    assert sum(facts["counts"]["pictures by light"].values()) == 9
    by_split: dict[str, set[str]] = defaultdict(set)
    for label in labels:
        by_split[label["split"]].add(f"{label['seed']}")
    assert not by_split["train"] & by_split["val"]


@pytest.mark.parametrize("split", [(0.8, 0.1, 0.1), (0.5, 0.5), (1.0,), (0.34, 0.33, 0.33)])
@pytest.mark.parametrize("pictures", [200, 1237])
def test_every_picture_is_planned_once(pictures: int, split: tuple[float, ...]) -> None:
    plan = Plan(settings=DatasetSettings(scenarios=("a", "b", "c"), pictures=pictures, split=split, seed=3))
    numbers = [n for job in plan.jobs for n in range(job.first, job.first + job.pictures)]
    assert numbers == list(range(1, pictures + 1))
    assert len({job.seed for job in plan.jobs}) == len(plan.jobs)
    for name, share in zip(SPLITS, split, strict=False):
        found = sum(job.pictures for job in plan.jobs if job.split == name)
        assert found == pytest.approx(share * pictures, abs=max(job.pictures for job in plan.jobs))


def test_held_out_scenarios_are_those_named_last() -> None:
    names = ("a", "b", "c", "d", "e")
    settings = DatasetSettings(scenarios=names, pictures=1000, split=(0.7, 0.1, 0.2), split_by="scenario")
    jobs = Plan(settings=settings).jobs
    assert [n for job in jobs for n in range(job.first, job.first + job.pictures)] == list(range(1, 1001))
    held = {split: {job.scenario for job in jobs if job.split == split} for split in SPLITS}
    assert held == {"train": {"a", "b", "c"}, "val": {"d"}, "test": {"e"}}
    counts = [sum(job.pictures for job in jobs if job.split == split) for split in SPLITS]
    assert counts == [700, 100, 200]


@pytest.mark.slow
def test_held_out_cameras_take_no_pictures_for_training(tmp_path: Path) -> None:
    made = write_dataset(
        tmp_path / "set", scenarios="cologne1", pictures=8, split=(0.5, 0.25, 0.25), split_by="camera",
        seconds=400, smooth=False, size=(64, 48), conditions="day", jobs=1, per_episode=2, interval=2,
    )  # fmt: skip
    assert len(made["counts"]["pictures by camera"]) >= 3
    labels = [json.loads(line) for line in (tmp_path / "set/labels.jsonl").read_text().splitlines()]
    assert {label["split"] for label in labels} == set(SPLITS)
    splits = {label["camera"]["name"]: label["split"] for label in labels}
    assert all(splits[label["camera"]["name"]] == label["split"] for label in labels)
    assert "No camera is in two of them" in (tmp_path / "set/README.md").read_text()


def test_conditions_follow_from_the_seed_and_stay_in_range() -> None:
    drawn = [draw_conditions(("random",), seed) for seed in range(200)]
    assert drawn == [draw_conditions(("random",), seed) for seed in range(200)]
    assert len({each.hour for each in drawn}) == 200
    assert 0.08 < np.mean([each.rain > 0 for each in drawn]) < 0.25
    ranged = [draw_conditions(("hour=6..7,rain=0.4", "night"), seed) for seed in range(50)]
    assert {each.hour == 23.0 or 6 <= each.hour <= 7 for each in ranged} == {True}
    assert {each.rain for each in ranged} == {0.0, 0.4}


WRONG = [
    (["--format", "voc"], "format='voc'"),
    (["--split", "0.5,0.6"], "split=(0.5, 0.6)"),
    (["--split", "a"], "expected shares"),
    (["--size", "640"], "size=(640,)"),
    (["--size", "1x1"], "16 to"),
    (["--conditions", "sunny"], "conditions 'sunny'"),
    (["--conditions", "hour=9..6"], "range of hour is empty"),
    (["--conditions", "dropped=0..0.5"], "no dropped"),
    (["--controllers", "me"], "controllers=('me',)"),
    (["--cameras", "nowhere"], "cameras 'nowhere'"),
    (["--cameras", "missing.json"], "no such file"),
    (["--per-episode", "100"], "none is left to val"),
    (["--split-by", "lane"], "split_by='lane'"),
    (["--split-by", "scenario"], "of 1 scenario none is left to val"),
    (["--split-by", "camera", "--cameras", "bev"], "of 1 camera none is left to val"),
    (["--negatives", "0.1", "--format", "mot"], "negatives=0.1"),
    (["--imaging", "eyes"], "imaging 'eyes'"),
    (["--quality", "0"], "quality=0"),
    (["--picture", "gif"], "picture='gif'"),
    (["--ray", "127.0.0.1:1"], "no Ray cluster answers"),
    (["--jobs", "0"], "jobs=0"),
]


@pytest.mark.parametrize(("arguments", "words"), WRONG)
def test_wrong_settings_are_one_line(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if "--ray" in arguments:
        pytest.importorskip("ray")
    status = main(["dataset", "two-way", "-n", "20", "-o", str(tmp_path / "set"), *arguments])
    errors = capsys.readouterr().err
    assert status in (2, 3), errors
    assert words in errors
    assert len(errors.splitlines()) == 1
    assert not (tmp_path / "set/parts").exists() or not any((tmp_path / "set/parts").iterdir())
    assert "--split-by" not in arguments or not (tmp_path / "set").exists(), "found before anything is made"


@pytest.mark.slow
def test_cameras_of_a_file_take_the_pictures(tmp_path: Path) -> None:
    file = tmp_path / "cameras.json"
    (middle,) = (
        Camera(name="../up", position=(11830.0, 13330.0, 80.0), pitch_deg=-90.0, width=64, height=48),
    )
    write_cameras([middle], file)
    made = write_dataset(
        tmp_path / "set", scenarios="cologne1", pictures=2, split=(1,), cameras=str(file), seconds=300,
        smooth=False,
        conditions="day", jobs=1, per_episode=2, interval=2,
    )  # fmt: skip
    assert made["counts"]["pictures by camera"] == {"cologne1: ../up": 2}
    label = json.loads((tmp_path / "set/labels.jsonl").read_text().splitlines()[0])
    assert label["sequence"] == "cologne1-000000-00-_up"
    assert cv2.imread(str(tmp_path / "set" / label["file"])).shape == (48, 64, 3)
