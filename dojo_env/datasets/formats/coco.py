"""COCO: a JSON file per split, with boxes, masks and the keypoints of vehicles. Source: cocodataset.org."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from dojo_env.datasets.formats.base import Format, Lines
from dojo_env.datasets.labels import COCO_IDS, KEYPOINTS, SKELETON, Category, ObjectLabel, PictureLabels

if TYPE_CHECKING:
    from dojo_env.datasets.settings import DatasetSettings

_MOST_OBJECTS = 10_000
"""Of a picture: numbers of annotations follow from the picture's."""
_MOST_TRACKS = 1_000_000
"""Of an episode: tracks are numbered across the data set."""


class Coco(Format):
    """`annotations/instances_train.json` and pictures in `train`, as in COCO's own archive.

    `iscrowd` is 1 where too little of a road user shows: trainers leave it out, and pycocotools counts
    neither finding nor missing it.
    """

    def place(self, split: str, sequence: str, frame: int, number: int) -> tuple[str, str]:
        """See `Format`."""
        return f"{split}/{number:012d}", f"depth/{split}/{number:012d}"

    def write_lines(self, pictures: Sequence[PictureLabels]) -> Mapping[str, list[str]]:
        """See `Format`."""
        split = pictures[0].split
        return {
            f"{split}.images": [json.dumps(_image(picture)) for picture in pictures],
            f"{split}.annotations": [
                json.dumps(_annotation(picture, each, k))
                for picture in pictures
                for k, each in enumerate(picture.objects, 1)
            ],
        }

    def finish(self, settings: "DatasetSettings", lines: Lines) -> Iterable[tuple[str, Iterable[str]]]:
        """See `Format`."""
        for split in settings.splits:
            yield f"annotations/instances_{split}.json", _write_split(split, lines)


def _write_split(split: str, lines: Lines) -> Iterator[str]:
    info = {"description": f"{split} split, simulated traffic seen by simulated cameras", "version": "1"}
    yield f'{{"info": {json.dumps(info)}, "licenses": [],\n"categories": {json.dumps(_categories())},\n'
    for name in ("images", "annotations"):
        yield f'"{name}": ['
        for k, line in enumerate(lines(f"{split}.{name}")):
            yield f"{',' if k else ''}\n{line}"
        yield "\n]" + (",\n" if name == "images" else "}\n")


def _categories() -> list[dict[str, object]]:
    skeleton = [[a + 1, b + 1] for a, b in SKELETON]
    return [
        {
            "id": number,
            "name": category.value,
            "supercategory": "person" if category is Category.PERSON else "vehicle",
            **({} if category is Category.PERSON else {"keypoints": list(KEYPOINTS), "skeleton": skeleton}),
        }
        for category, number in COCO_IDS.items()
    ]


def _image(picture: PictureLabels) -> dict[str, object]:
    return {
        "id": picture.number,
        "file_name": picture.file.partition("/")[2],
        "width": picture.camera.width,
        "height": picture.camera.height,
        "sequence": picture.sequence,
        "frame": picture.frame,
    }


def _annotation(picture: PictureLabels, label: ObjectLabel, k: int) -> dict[str, object]:
    left, top, right, bottom = label.box
    points = {}
    if label.keypoints is not None:
        points = {
            "keypoints": np.round(label.keypoints, 2).ravel().tolist(),
            "num_keypoints": int(np.count_nonzero(label.keypoints[:, 2])),
        }
    return {
        "id": picture.number * _MOST_OBJECTS + k,
        "image_id": picture.number,
        "category_id": COCO_IDS[label.category],
        "bbox": [left, top, right - left, bottom - top],
        "area": label.pixels,
        "segmentation": {"size": [picture.camera.height, picture.camera.width], "counts": label.mask},
        "iscrowd": int(label.is_ignored),
        "track_id": picture.episode * _MOST_TRACKS + label.track,
        "visible": round(label.visible, 4),
        "truncated": round(label.truncated, 4),
        "parked": label.is_parked,
        **points,
    }
